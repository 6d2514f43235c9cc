//! Terminals: which variables belong together where models are connected, and pictures (FMI 3.0.2, 2.4.9).
//!
//! A terminal names variables of the table and adds nothing to them: an importer without support for terminals loses nothing, and
//! the instantiation token does not change.

use crate::refusal::{demand, same_text};
use serde::{Deserialize, Serialize};

/// A group of variables that is connected as a whole.
#[derive(Clone, Copy, Debug)]
pub struct Terminal {
    /// Name, unique within the model.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// How the members of two connected terminals are matched.
    pub rule: MatchingRule,
    /// The variables that it groups.
    pub members: &'static [Member],
    /// Its position and icon; with `None`, the importer chooses.
    pub picture: Option<Picture>,
}

/// How the members of two connected terminals are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum MatchingRule {
    /// By name; all members must match.
    Plug,
    /// By name; only the members that both terminals have.
    Bus,
    /// A node of a network: what one side sends, the other receives (FMI-LS-BUS 1.0.0, FMI 3.0).
    Transceiver,
    /// A map on a rectilinear grid, with tables over the same points: FMI-LS-STRUCT 1.0.0-rc.1 (FMI 3.0).
    Map,
}

impl MatchingRule {
    /// Whether it is of a layered standard on top of FMI 3.0.
    pub const fn is_layered(self) -> bool {
        matches!(self, Self::Transceiver | Self::Map)
    }
}

/// A variable of a terminal.
#[derive(Clone, Copy, Debug)]
pub struct Member {
    /// Name within the terminal, the same on both sides of a connection.
    pub name: &'static str,
    /// Name of the variable in the table.
    pub variable: &'static str,
    /// How a connection combines the values of a member.
    pub kind: MemberKind,
}

/// How a connection combines the values of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum MemberKind {
    /// Both sides have the same value.
    Signal,
    /// Flow into the model through the terminal; the inflows of all connected terminals sum to zero.
    Inflow,
    /// Flow out of the model through the terminal.
    Outflow,
    /// Grid points of an axis of a map.
    Domain,
    /// The coordinate on this axis at which the map is read.
    DomainInput,
    /// The values of a map, row by row: an extent for each axis.
    Codomain,
    /// The value read from the map.
    CodomainOutput,
}

/// Where a terminal is drawn: its center, in a coordinate system from -100 to 100 with y upwards, and its icon.
#[derive(Clone, Copy, Debug)]
pub struct Picture {
    /// What is drawn.
    pub icon: &'static Icon,
    /// Center, to the right.
    pub x: f64,
    /// Center, upwards.
    pub y: f64,
}

/// The icon of terminals of one kind.
#[derive(Clone, Copy, Debug)]
pub struct Icon {
    /// Base name of its files: letters, digits and `_`, not `icon`.
    pub name: &'static str,
    /// SVG document without text: a renderer may have no fonts.
    pub svg: &'static str,
    /// Color of lines that connect such terminals: red, green, blue.
    pub color: [u8; 3],
}

impl Picture {
    /// Half of a terminal's width and height in the coordinate system.
    pub const HALF: f64 = 10.0;
}

impl Terminal {
    /// A terminal that can only be connected as a whole.
    ///
    /// # Panics
    /// At compile time, on two members with the same name or on no members.
    pub const fn plug(name: &'static str, description: &'static str, members: &'static [Member]) -> Self {
        Self::new(name, description, MatchingRule::Plug, members)
    }

    /// A terminal that may be connected partially.
    ///
    /// # Panics
    /// Same as [`plug`](Self::plug).
    pub const fn bus(name: &'static str, description: &'static str, members: &'static [Member]) -> Self {
        Self::new(name, description, MatchingRule::Bus, members)
    }

    /// A node of a network, such as CAN: `Tx_Data` on the clock `Tx_Clock`, `Rx_Data` on the clock `Rx_Clock`, in this
    /// order.
    ///
    /// # Panics
    /// At compile time, unless the members are these four.
    pub const fn transceiver(name: &'static str, description: &'static str, members: &'static [Member; 4]) -> Self {
        let roles = ["Tx_Data", "Tx_Clock", "Rx_Data", "Rx_Clock"];
        let mut i = 0;
        while i < 4 {
            let is = same_text(members[i].name, roles[i]);
            demand(is, members[i].name, "a transceiver has Tx_Data, Tx_Clock, Rx_Data and Rx_Clock");
            i += 1;
        }
        Self::new(name, description, MatchingRule::Transceiver, members)
    }

    /// A map: arrays with the grid points of its axes, an array for each of its tables, and the coordinates at which it is
    /// read. Each [`Member::domain_input`] follows its domain, each [`Member::codomain_output`] its codomain.
    ///
    /// # Panics
    /// At compile time, on two members with the same name, without a domain or a codomain, or on another order.
    pub const fn map(name: &'static str, description: &'static str, members: &'static [Member]) -> Self {
        let (mut domains, mut codomains, mut i) = (0, 0, 0);
        while i < members.len() {
            match members[i].kind {
                MemberKind::Domain => domains += 1,
                MemberKind::Codomain => codomains += 1,
                MemberKind::DomainInput => {
                    let follows = i > 0 && matches!(members[i - 1].kind, MemberKind::Domain);
                    demand(follows, members[i].name, "a domain_input follows its domain");
                }
                MemberKind::CodomainOutput => {
                    let follows = i > 0 && matches!(members[i - 1].kind, MemberKind::Codomain);
                    demand(follows, members[i].name, "a codomain_output follows its codomain");
                }
                _ => demand(false, members[i].name, "a map has domains and codomains"),
            }
            i += 1;
        }
        demand(domains > 0 && codomains > 0, name, "a map has a domain and a codomain");
        Self::new(name, description, MatchingRule::Map, members)
    }

    const fn new(
        name: &'static str,
        description: &'static str,
        rule: MatchingRule,
        members: &'static [Member],
    ) -> Self {
        assert!(!members.is_empty(), "a terminal needs a member");
        let mut last = 0;
        while last < members.len() {
            let mut before = 0;
            while before < last {
                assert!(!same_text(members[before].name, members[last].name), "two members have the same name");
                before += 1;
            }
            last += 1;
        }
        Self { name, description, rule, members, picture: None }
    }

    /// Draws the terminal with its center at (x, y).
    pub const fn drawn(mut self, icon: &'static Icon, x: f64, y: f64) -> Self {
        self.picture = Some(Picture { icon, x, y });
        self
    }
}

impl Member {
    /// A member whose value is the same on both sides, named like its variable.
    pub const fn signal(name: &'static str) -> Self {
        Self { name, variable: name, kind: MemberKind::Signal }
    }

    /// A member that flows into the model.
    pub const fn inflow(name: &'static str) -> Self {
        Self { name, variable: name, kind: MemberKind::Inflow }
    }

    /// A member that flows out of the model.
    pub const fn outflow(name: &'static str) -> Self {
        Self { name, variable: name, kind: MemberKind::Outflow }
    }

    /// The points on an axis of a [map](Terminal::map): a parameter or a constant with one extent.
    pub const fn domain(name: &'static str) -> Self {
        Self { name, variable: name, kind: MemberKind::Domain }
    }

    /// The coordinate on the preceding axis at which a [map](Terminal::map) is read.
    pub const fn domain_input(name: &'static str) -> Self {
        Self { name, variable: name, kind: MemberKind::DomainInput }
    }

    /// The values of a [map](Terminal::map): an array with an extent for each axis.
    pub const fn codomain(name: &'static str) -> Self {
        Self { name, variable: name, kind: MemberKind::Codomain }
    }

    /// The value read from the preceding table.
    pub const fn codomain_output(name: &'static str) -> Self {
        Self { name, variable: name, kind: MemberKind::CodomainOutput }
    }

    /// Selects a different variable for the member.
    pub const fn of(mut self, variable: &'static str) -> Self {
        self.variable = variable;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{UnwindSafe, catch_unwind};

    /// The refusal of a terminal, made at run time.
    fn refusal(make: impl FnOnce() -> Terminal + UnwindSafe) -> Option<String> {
        let text = |panic: Box<dyn std::any::Any + Send>| match panic.downcast::<String>() {
            Ok(text) => *text,
            Err(other) => (*other.downcast::<&str>().unwrap()).to_owned(),
        };
        catch_unwind(make).err().map(text)
    }

    #[test]
    fn a_terminal_has_members_of_different_names() {
        const TWICE: &[Member] = &[Member::signal("a"), Member::inflow("b"), Member::outflow("a")];
        const LATE: &[Member] = &[Member::signal("a"), Member::inflow("b"), Member::outflow("b")];
        assert_eq!(refusal(|| Terminal::plug("t", "", TWICE.split_at(2).0)), None);
        for make in [|| Terminal::plug("t", "", TWICE), || Terminal::bus("t", "", LATE)] {
            assert_eq!(refusal(make).as_deref(), Some("two members have the same name"));
        }
        assert_eq!(refusal(|| Terminal::bus("t", "", &[])).as_deref(), Some("a terminal needs a member"));
    }

    #[test]
    fn a_transceiver_has_its_four_members_in_order() {
        const fn four(names: [&'static str; 4]) -> [Member; 4] {
            let [a, b, c, d] = names;
            [Member::signal(a), Member::signal(b), Member::signal(c), Member::signal(d)]
        }
        const RIGHT: [Member; 4] = four(["Tx_Data", "Tx_Clock", "Rx_Data", "Rx_Clock"]);
        const LAST: [Member; 4] = four(["Tx_Data", "Tx_Clock", "Rx_Data", "Rx_Clocks"]);
        const SWAPPED: [Member; 4] = four(["Rx_Data", "Tx_Clock", "Tx_Data", "Rx_Clock"]);
        let rule = "a transceiver has Tx_Data, Tx_Clock, Rx_Data and Rx_Clock";
        assert_eq!(refusal(|| Terminal::transceiver("can", "", &RIGHT)), None);
        assert_eq!(refusal(|| Terminal::transceiver("can", "", &LAST)), Some(format!("Rx_Clocks: {rule}")));
        assert_eq!(refusal(|| Terminal::transceiver("can", "", &SWAPPED)), Some(format!("Rx_Data: {rule}")));
    }

    fn map<const N: usize>(members: [Member; N]) -> Option<String> {
        let members: &'static [Member] = Box::leak(Box::new(members));
        refusal(move || Terminal::map("map", "", members))
    }

    #[test]
    fn a_map_has_its_members_in_order() {
        use Member as M;
        let (x, x_in) = (M::domain("x"), M::domain_input("x_in"));
        let (z, z_out) = (M::codomain("z"), M::codomain_output("z_out"));
        assert_eq!((map([x, x_in, z, z_out]), map([x, z])), (None, None));
        let input = Some("x_in: a domain_input follows its domain".to_owned());
        assert_eq!((map([x_in, x]), map([x, z, x_in])), (input.clone(), input));
        let output = Some("z_out: a codomain_output follows its codomain".to_owned());
        assert_eq!((map([z_out]), map([z, x, z_out])), (output.clone(), output));
        let both = Some("map: a map has a domain and a codomain".to_owned());
        assert_eq!((map([x]), map([z])), (both.clone(), both));
        assert_eq!(map([x, z, M::signal("s")]).as_deref(), Some("s: a map has domains and codomains"));
    }

    #[test]
    fn layered_rules_and_places() {
        const ICON: Icon = Icon { name: "shaft", svg: "", color: [0, 0, 0] };
        const OTHER: &[Member] = &[Member::signal("a").of("b")];
        let rules = [MatchingRule::Plug, MatchingRule::Bus, MatchingRule::Transceiver, MatchingRule::Map];
        assert_eq!(rules.map(MatchingRule::is_layered), [false, false, true, true]);
        let drawn = Terminal::plug("t", "", OTHER).drawn(&ICON, 1.0, -2.0);
        assert_eq!((drawn.members[0].name, drawn.members[0].variable), ("a", "b"));
        assert!(drawn.picture.is_some_and(|at| (at.x, at.y, at.icon.name) == (1.0, -2.0, "shaft")));
    }
}
