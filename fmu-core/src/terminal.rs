//! Terminals: which variables belong together where models are connected, and pictures (FMI 3.0.2, 2.4.9).
//!
//! A terminal names variables of the table and adds nothing to them: an importer that knows no terminals loses nothing, and
//! the instantiation token does not change.

use crate::rules::same_text;
use serde::{Deserialize, Serialize};

/// A group of variables that is connected as a whole.
#[derive(Clone, Copy, Debug)]
pub struct Terminal {
    /// Name, unique within the model.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// How the members of two connected terminals find each other.
    pub rule: MatchingRule,
    /// The variables that it groups.
    pub members: &'static [Member],
    /// Its position and icon; with `None`, the importer chooses.
    pub picture: Option<Picture>,
}

/// How the members of two connected terminals find each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum MatchingRule {
    /// By name; all members must match.
    Plug,
    /// By name; only the members that both terminals have.
    Bus,
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

    /// A terminal that may be connected in part.
    ///
    /// # Panics
    /// Same as [`plug`](Self::plug).
    pub const fn bus(name: &'static str, description: &'static str, members: &'static [Member]) -> Self {
        Self::new(name, description, MatchingRule::Bus, members)
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

    /// Names another variable for the member.
    pub const fn of(mut self, variable: &'static str) -> Self {
        self.variable = variable;
        self
    }
}
