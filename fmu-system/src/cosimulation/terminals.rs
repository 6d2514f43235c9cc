//! The variables connected by connecting two terminals (FMI 3.0.2, 2.4.9.2).
//!
//! The matching rules of both sides must be satisfied. A signal is connected to a signal, an inflow to an outflow: both sides
//! then have the same value, so one connection from output to input suffices. Two inflows would need opposite signs and are
//! refused.

use super::parts::Part;
use super::system::System;
use fmu_import::Error;
use model_description::{Causality, Member, Terminal};

impl System {
    /// Connects two terminals, both written `instance.terminal`; returns the connections, from output to input.
    ///
    /// # Errors
    /// A terminal does not exist, the two do not match, or a pair of members is not an output and an input.
    pub fn connect_terminals(&mut self, a: &str, b: &str) -> Result<Vec<(String, String)>, Error> {
        let ((i, one), (k, other)) = (self.terminal(a)?, self.terminal(b)?);
        let mut found = Vec::new();
        for (m, n) in pairs(&one, &other).map_err(|cause| Error::usage(a, format!("does not fit {b}: {cause}")))? {
            let full = |instance: usize, m: &Member| format!("{}.{}", self.instances[instance].name(), m.variable);
            let (left, right) = (full(i, &m), full(k, &n));
            let causality = |port: &str| self.parts.port(port).map(|p| self.parts.causality(&p));
            let ticks = |port: &str| self.parts.port(port).is_ok_and(|p| self.parts.is_timed_clock(&p));
            let member = m.name.as_deref().unwrap_or(&m.variable);
            match (causality(&left)?, causality(&right)?) {
                (Causality::Output, Causality::Input) => found.push((left, right)),
                (Causality::Input, Causality::Output) => found.push((right, left)),
                (Causality::Input, Causality::Input) if ticks(&left) && !ticks(&right) => found.push((left, right)),
                (Causality::Input, Causality::Input) if ticks(&right) && !ticks(&left) => found.push((right, left)),
                (from, to) => {
                    let cause = format!(
                        "does not fit {b}: member {member} is {from} {left} here and {to} {right} there, expected an output \
                         and an input"
                    );
                    return Err(Error::usage(a, cause));
                }
            }
        }
        for (from, to) in &found {
            self.connect(from, to)?;
        }
        Ok(found)
    }

    /// `instance.terminal`, and `instance.outer.inner` for one inside another.
    fn terminal(&self, text: &str) -> Result<(usize, Terminal), Error> {
        let (index, path) = self.parts.instance_and_rest(text, "TERMINAL")?;
        let Part { name, fmu, .. } = &self.parts.0[index];
        let missing = |has: String| Error::usage(name, format!("has no terminal {path}; {has}"));
        let Some(file) = fmu.terminals()? else {
            return Err(missing("its FMU has no terminals: connect its variables with --connect".into()));
        };
        let names: Vec<&str> = file.terminals.iter().map(|t| t.name.as_str()).collect();
        let found = file.terminal(path).ok_or_else(|| missing(format!("it has {}", names.join(", "))))?;
        Ok((index, found.clone()))
    }
}

/// The pairs of members to connect.
fn pairs(a: &Terminal, b: &Terminal) -> Result<Vec<(Member, Member)>, String> {
    for t in [a, b] {
        if !t.streams.is_empty() {
            return Err(format!("{} has stream members, which need a balance and not a connection", t.name));
        }
    }
    let mut pairs = match (rule(a)?, rule(b)?) {
        ("sequence", "sequence") if a.members.len() != b.members.len() => {
            return Err(format!("{} members here, {} there", a.members.len(), b.members.len()));
        }
        ("sequence", "sequence") => a.members.iter().cloned().zip(b.members.iter().cloned()).collect(),
        (TRANSCEIVER, TRANSCEIVER) => return transceivers(a, b),
        (rule @ ("sequence" | TRANSCEIVER), other) | (other, rule @ ("sequence" | TRANSCEIVER)) => {
            return Err(format!("one has the matchingRule {rule}, the other {other}"));
        }
        _ => by_name(a, b)?,
    };
    for (m, n) in &pairs {
        let name = m.name.as_deref().unwrap_or(&m.variable);
        match (m.kind.as_str(), n.kind.as_str()) {
            ("signal", "signal") | ("inflow", "outflow") | ("outflow", "inflow") => {}
            ("inflow", "inflow") | ("outflow", "outflow") => {
                return Err(format!("member {name} is an {} on both sides, which takes a change of sign", m.kind));
            }
            (kind, other) => return Err(format!("member {name} is {kind} here and {other} there")),
        }
    }
    for (one, other) in [(a, b), (b, a)] {
        for inner in &one.terminals {
            let there = other.terminals.iter().find(|t| t.name == inner.name);
            match there {
                // Both loops see a pair; the first one takes it.
                Some(there) if std::ptr::eq(one, a) => pairs.extend(self::pairs(inner, there)?),
                Some(_) => {}
                None if rule(one)? == "bus" => {}
                None => return Err(format!("there is no terminal {} in {}", inner.name, other.name)),
            }
        }
    }
    if pairs.is_empty() { Err("they have no member in common".into()) } else { Ok(pairs) }
}

/// The rule of a network (FMI-LS-BUS 1.0.0, Bus Terminal): what one side sends, the other receives.
const TRANSCEIVER: &str = "org.fmi-ls-bus.transceiver";

/// `Tx_Data` and `Tx_Clock` of each side with `Rx_Data` and `Rx_Clock` of the other. A terminal inside configures a node and is not
/// connected.
fn transceivers(a: &Terminal, b: &Terminal) -> Result<Vec<(Member, Member)>, String> {
    let member = |t: &Terminal, name: &str| {
        let found = t.members.iter().find(|m| m.name.as_deref() == Some(name)).cloned();
        found.ok_or_else(|| format!("{} is a transceiver without a member {name}", t.name))
    };
    let pair = |[of_a, of_b]: [&str; 2]| Ok((member(a, of_a)?, member(b, of_b)?));
    let names = [["Tx_Data", "Rx_Data"], ["Tx_Clock", "Rx_Clock"], ["Rx_Data", "Tx_Data"], ["Rx_Clock", "Tx_Clock"]];
    names.into_iter().map(pair).collect()
}

fn rule(t: &Terminal) -> Result<&str, String> {
    match t.matching_rule.as_str() {
        known @ ("plug" | "bus" | "sequence" | TRANSCEIVER) => Ok(known),
        other => Err(format!("{} has the matchingRule {other}: connect its variables singly with --connect", t.name)),
    }
}

fn by_name(a: &Terminal, b: &Terminal) -> Result<Vec<(Member, Member)>, String> {
    let same = |m: &Member, n: &Member| m.name.is_some() && m.name == n.name;
    for (one, other) in [(a, b), (b, a)] {
        for m in &one.members {
            let Some(name) = &m.name else { return Err(format!("{} of {} has no memberName", m.variable, one.name)) };
            let there = other.members.iter().any(|n| same(m, n));
            if !there && one.matching_rule == "plug" {
                return Err(format!("{} is a plug, and its member {name} is missing in {}", one.name, other.name));
            }
        }
    }
    let partner = |m: &Member| b.members.iter().find(|n| same(m, n)).map(|n| (m.clone(), n.clone()));
    Ok(a.members.iter().filter_map(partner).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A terminal from its rule and `name=variable:kind`, separated by spaces.
    fn terminal(rule: &str, members: &str) -> Terminal {
        let member = |word: &str| {
            let (names, kind) = word.split_once(':').unwrap_or((word, "signal"));
            let (name, variable) = names.split_once('=').unwrap_or((names, names));
            let name = Some(name.to_owned()).filter(|n| !n.is_empty());
            Member { variable: variable.into(), name, kind: kind.into(), line: 0 }
        };
        Terminal {
            name: "t".into(),
            matching_rule: rule.into(),
            kind: None,
            description: None,
            members: members.split_whitespace().map(member).collect(),
            streams: Vec::new(),
            terminals: Vec::new(),
            picture: None,
            line: 0,
        }
    }

    fn matched(a: &Terminal, b: &Terminal) -> Result<String, String> {
        let said = |(m, n): (Member, Member)| format!("{}-{}", m.variable, n.variable);
        Ok(pairs(a, b)?.into_iter().map(said).collect::<Vec<_>>().join(" "))
    }

    fn of(a: (&str, &str), b: (&str, &str)) -> Result<String, String> {
        matched(&terminal(a.0, a.1), &terminal(b.0, b.1))
    }

    #[test]
    fn each_rule_matches_its_way() {
        assert_eq!(of(("plug", "x=a y=b"), ("plug", "y=c x=d")).unwrap(), "a-d b-c");
        assert_eq!(of(("bus", "x=a y=b"), ("bus", "y=c z=d")).unwrap(), "b-c");
        assert_eq!(of(("plug", "y=b"), ("bus", "y=c z=d")).unwrap(), "b-c");
        assert_eq!(of(("sequence", "x=a y=b"), ("sequence", "=c =d")).unwrap(), "a-c b-d");
        assert_eq!(of(("plug", "q:inflow"), ("plug", "q:outflow")).unwrap(), "q-q");
        let [one, other] = ["a", "b"]
            .map(|n| ["Rx_Clock", "Rx_Data", "Tx_Clock", "Tx_Data"].map(|m| format!("{m}={n}.{m}")).join(" "));
        let crossed = "a.Tx_Data-b.Rx_Data a.Tx_Clock-b.Rx_Clock a.Rx_Data-b.Tx_Data a.Rx_Clock-b.Tx_Clock";
        assert_eq!(of((TRANSCEIVER, &one), (TRANSCEIVER, &other)).unwrap(), crossed);
    }

    #[test]
    fn what_does_not_match_is_told() {
        for (a, b, part) in [
            (("plug", "x y"), ("plug", "x"), "member y is missing"),
            (("bus", "x"), ("plug", "x y"), "member y is missing"),
            (("bus", "x"), ("bus", "y"), "no member"),
            (("sequence", "x y"), ("sequence", "x"), "2 members here, 1 there"),
            (("sequence", "x"), ("plug", "x"), "the matchingRule sequence, the other plug"),
            (("none", "x"), ("plug", "x"), "matchingRule none"),
            ((TRANSCEIVER, "Tx_Data"), (TRANSCEIVER, "Rx_Data"), "t is a transceiver without a member"),
            ((TRANSCEIVER, "Tx_Data"), ("bus", "Tx_Data"), "the other bus"),
            (("plug", "=x"), ("plug", "x"), "x of t has no memberName"),
            (("plug", "q:inflow"), ("plug", "q:inflow"), "an inflow on both sides"),
            (("plug", "q:inflow"), ("plug", "q"), "member q is inflow here and signal there"),
        ] {
            let error = of(a, b).unwrap_err();
            assert!(error.contains(part), "{a:?} {b:?}: {error}");
        }
    }

    #[test]
    fn terminals_inside_terminals() {
        let nested =
            |rule: &str, members: &str, inner: Vec<Terminal>| Terminal { terminals: inner, ..terminal(rule, members) };
        let one = nested("plug", "x=a", vec![terminal("plug", "y=b")]);
        assert_eq!(matched(&one, &nested("plug", "x=c", vec![terminal("plug", "y=d")])).unwrap(), "a-c b-d");
        assert!(matched(&one, &terminal("plug", "x=c")).unwrap_err().contains("there is no terminal t"));
        assert_eq!(matched(&nested("bus", "x=a", one.terminals), &terminal("plug", "x=c")).unwrap(), "a-c");
    }
}
