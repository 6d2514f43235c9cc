//! Inner systems of an SSP, resolved: only components, connections between them and the connectors of the outer system remain.
//!
//! A component `b` of the inner system `in` becomes the component `in.b`. A connector of a system is a name for the connectors of
//! components that it reaches. The references to a signal dictionary share its entries.

use super::component::{Binding, Component, Connection, ConnectionEnd, Connector};
use super::path::{Hop, StatedUnit};

/// A system as described by its element.
#[derive(Default)]
pub(super) struct Level {
    /// Names of the systems around its contents, each with a dot; empty for the outer one.
    pub path: String,
    pub components: Vec<Component>,
    pub connectors: Vec<Connector>,
    pub connections: Vec<Connection>,
    pub bindings: Vec<Binding>,
    pub inner: Vec<Level>,
    /// Names of signal dictionaries and their entries.
    pub dictionaries: Vec<(String, Vec<Connector>)>,
    pub references: Vec<Reference>,
}

/// A signal dictionary as an element of a system.
pub(super) struct Reference {
    pub name: String,
    pub dictionary: String,
    pub connectors: Vec<Connector>,
}

/// Connector of a component that a name reaches.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Reached {
    /// `component.variable`.
    pub port: String,
    /// Unit of the connector with the name.
    pub unit: Option<StatedUnit>,
    pub hops: Vec<Hop>,
}

/// Names and their targets.
pub(super) type Reach = Vec<(String, Vec<Reached>)>;

/// A system without inner ones.
#[derive(Default)]
pub(super) struct Flat {
    pub components: Vec<Component>,
    pub connectors: Vec<Connector>,
    pub connections: Vec<Connection>,
    /// Inner ones first.
    pub bindings: Vec<Binding>,
    pub reach: Reach,
    /// Connections without effect.
    pub notes: Vec<String>,
}

#[derive(Clone, Copy, PartialEq)]
enum Owner {
    Component,
    System,
    Dictionary,
}

/// A connector with the full name of its owner.
#[derive(Clone, PartialEq)]
struct Node {
    of: Owner,
    /// Full name of a component, or path of a system or of a dictionary, which ends with a dot.
    owner: String,
    connector: String,
}

impl Node {
    fn name(&self) -> String {
        match self.of {
            Owner::Component => format!("{}.{}", self.owner, self.connector),
            Owner::System => format!("{}{}", self.owner, self.connector),
            Owner::Dictionary => {
                format!("the entry {} of the dictionary {}", self.connector, self.owner.trim_end_matches('.'))
            }
        }
    }

    /// A connector of the outer system.
    fn is_outside(&self) -> bool {
        self.of == Owner::System && self.owner.is_empty()
    }

    /// Where a path begins or ends.
    fn is_end(&self) -> bool {
        self.of == Owner::Component || self.is_outside()
    }

    fn end(&self) -> ConnectionEnd {
        let element = (!self.owner.is_empty()).then(|| self.owner.clone());
        ConnectionEnd { element, connector: self.connector.clone() }
    }
}

/// A connection from its source to its target.
struct Edge {
    from: Node,
    to: Node,
    /// Unit of the source.
    unit: Option<StatedUnit>,
    hop: Hop,
    /// It sets a value before the run.
    is_parameter: bool,
    line: usize,
}

/// Resolves the inner systems.
///
/// # Errors
/// The line of a connection, and its error.
pub(super) fn flat(outer: &Level) -> Result<Flat, String> {
    let mut levels = Vec::new();
    collect(&[outer], &mut levels);
    let mut edges = Vec::new();
    for around in &levels {
        for connection in around.last().into_iter().flat_map(|level| &level.connections) {
            edges.push(edge(around, connection).map_err(|cause| format!("line {}: {cause}", connection.line))?);
        }
    }
    let mut flat = Flat::default();
    for edge in edges.iter().filter(|edge| edge.to.is_end()) {
        let at = |cause: String| format!("line {}: {cause}", edge.line);
        let mut path = vec![edge];
        while let Some(first) = path.last().filter(|first| !first.from.is_end()) {
            let mut feeding = edges.iter().filter(|other| other.to == first.from);
            let Some(next) = feeding.next() else { break };
            if feeding.next().is_some() {
                return Err(at(format!("{} is fed twice: remove one of the connections", first.from.name())));
            }
            if path.len() > edges.len() {
                return Err(at(format!("{} is connected with itself", first.from.name())));
            }
            path.push(next);
        }
        path.reverse();
        let hops: Vec<Hop> = path.iter().map(|edge| edge.hop.clone()).collect();
        if edge.to.of == Owner::Component {
            for (k, from) in path.iter().enumerate().filter(|(_, edge)| edge.from.of == Owner::System) {
                let reached = Reached { port: edge.to.name(), unit: from.unit.clone(), hops: hops[k..].to_vec() };
                let name = from.from.name();
                match flat.reach.iter_mut().find(|(known, _)| *known == name) {
                    Some((_, targets)) => targets.push(reached),
                    None => flat.reach.push((name, vec![reached])),
                }
            }
        }
        let from = &path[0].from;
        // Parameters are set, not connected, and an unconnected input keeps its value.
        if path.iter().any(|edge| edge.is_parameter) {
            continue;
        }
        if from.is_end() {
            let (start, end) = (from.end(), edge.to.end());
            flat.connections.push(Connection { start, end, hops, line: edge.line });
        } else {
            let (from, to) = (from.name(), edge.to.name());
            flat.notes.push(format!("line {}: nothing feeds {from}: {to} keeps its value", edge.line));
        }
    }
    flat.connectors.clone_from(&outer.connectors);
    let levels: Vec<&Level> = levels.iter().filter_map(|around| around.last().copied()).collect();
    flat.bindings.extend(levels.iter().rev().flat_map(|level| level.bindings.iter().cloned()));
    flat.components = levels.iter().flat_map(|level| level.components.iter().cloned()).collect();
    Ok(flat)
}

/// Every system, after those around it.
fn collect<'a>(around: &[&'a Level], all: &mut Vec<Vec<&'a Level>>) {
    all.push(around.to_vec());
    for inner in around.last().into_iter().flat_map(|level| &level.inner) {
        collect(&[around, &[inner]].concat(), all);
    }
}

/// Whether a value may pass (SSP 2.0, Allowed Connections); each side with its owner, an element or the system around it.
fn allowed([(from_element, from), (to_element, to)]: [(bool, &str); 2]) -> bool {
    let targets: &[&str] = match (from_element, from, to_element) {
        (false, "structuralParameter", true) | (true, "constant", true) => {
            &["structuralParameter", "parameter", "input", "inout"]
        }
        (false, "parameter", true) | (true, "calculatedParameter", true) => &["parameter", "input", "inout"],
        (false, "input", true) | (true, "output" | "local", true) => &["input", "inout"],
        (true, "inout", true) => &["input"],
        (true, "constant", false) => &["constant", "calculatedParameter", "output", "local"],
        (true, "output" | "local" | "inout", false) | (false, "input", false) => &["output", "local"],
        (true, "calculatedParameter", false) | (false, "parameter" | "structuralParameter", false) => {
            &["calculatedParameter", "output", "local"]
        }
        _ => &[],
    };
    targets.contains(&to)
}

/// The connection with its direction, which follows from the kinds of the connectors and not from start and end.
fn edge(around: &[&Level], c: &Connection) -> Result<Edge, String> {
    let ((start, one), (end, other)) = (node(around, &c.start)?, node(around, &c.end)?);
    // A clock that requests ticks counts as an output.
    let kind = |c: &Connector| match c.ticks.as_deref() {
        Some(ticks) if ticks != "triggered" => "output".to_owned(),
        _ => c.kind.clone(),
    };
    let (one_kind, other_kind) = (kind(&one), kind(&other));
    let side = |end: &ConnectionEnd| end.element.is_some();
    let ends = [(side(&c.start), one_kind.as_str()), (side(&c.end), other_kind.as_str())];
    for (end, connector) in [(&c.start, &one), (&c.end, &other)] {
        if connector.kind == "unspecified" {
            return Err(format!("{end} is of kind unspecified, which is not supported: give its kind"));
        }
    }
    let (from, to, unit, into) = match (allowed(ends), allowed([ends[1], ends[0]])) {
        (true, _) => (start, end, one.unit, other),
        (_, true) => (end, start, other.unit, one),
        _ => {
            return Err(format!(
                "connects {} ({one_kind}) with {} ({other_kind}): expected an output and an input of components, or one of \
                 them and the same kind of the system",
                c.start, c.end
            ));
        }
    };
    if !side(&c.start) && !side(&c.end) && around.len() == 1 {
        return Err("connects the system with itself, which is not supported: remove it".into());
    }
    let from_kind = if allowed(ends) { &one_kind } else { &other_kind };
    let is_parameter = |kind: &str| ["parameter", "structuralParameter"].contains(&kind);
    if ["constant", "calculatedParameter"].contains(&from_kind.as_str()) && is_parameter(&into.kind) {
        let (from, to) = (from.name(), to.name());
        return Err(format!("a value that is computed cannot set a parameter: give {to} a value instead of {from}"));
    }
    let hop = Hop { unit: into.unit, ..c.hops.first().cloned().unwrap_or_default() };
    Ok(Edge { is_parameter: is_parameter(from_kind), from, to, unit, hop, line: c.line })
}

/// The connector at an end.
fn node(around: &[&Level], end: &ConnectionEnd) -> Result<(Node, Connector), String> {
    let Some(level) = around.last() else { return Err("is in no system".into()) };
    let (of, connectors, owner, label) = match &end.element {
        None => (Owner::System, &level.connectors, level.path.clone(), "the system"),
        Some(element) => {
            let full = format!("{}{element}", level.path);
            let path = format!("{full}.");
            let component = level.components.iter().find(|c| c.name == full);
            let inner = level.inner.iter().find(|inner| inner.path == path);
            if let Some(component) = component {
                (Owner::Component, &component.connectors, full, element.as_str())
            } else if let Some(inner) = inner {
                (Owner::System, &inner.connectors, path, element.as_str())
            } else if let Some(reference) = level.references.iter().find(|reference| reference.name == *element) {
                return entry(around, reference, end);
            } else {
                let names = level.components.iter().map(|c| c.name.as_str());
                let inner = level.inner.iter().map(|inner| inner.path.trim_end_matches('.'));
                let all = names.chain(inner).chain(level.references.iter().map(|r| r.name.as_str()));
                let all = all.collect::<Vec<_>>().join(", ");
                return Err(format!("there is no component {element}; available: {all}"));
            }
        }
    };
    let connector = connector(connectors, &end.connector, label)?.clone();
    Ok((Node { of, owner, connector: end.connector.clone() }, connector))
}

/// The entry of a dictionary, accessed through a reference. Its name is sought in the system of the reference, then in those
/// around it.
fn entry(around: &[&Level], reference: &Reference, end: &ConnectionEnd) -> Result<(Node, Connector), String> {
    let mut seen = connector(&reference.connectors, &end.connector, &reference.name)?.clone();
    let defined = |level: &&&Level| level.dictionaries.iter().any(|(name, _)| *name == reference.dictionary);
    let level = around.iter().rev().find(defined);
    let none = || format!("{} refers to the dictionary {}, which no system has", reference.name, reference.dictionary);
    let level = level.ok_or_else(none)?;
    let entries = level.dictionaries.iter().filter(|(name, _)| *name == reference.dictionary);
    let entries: Vec<Connector> = entries.flat_map(|(_, entries)| entries.iter().cloned()).collect();
    let label = format!("the dictionary {}", reference.dictionary);
    let entry = connector(&entries, &end.connector, &label)?;
    match (&seen.unit, &entry.unit) {
        (Some(one), Some(other)) if one != other => {
            let (name, one, other) = (&end.connector, &one.name, &other.name);
            return Err(format!("{}.{name} is in {one}, and {label} has {name} in {other}", reference.name));
        }
        (None, _) => seen.unit.clone_from(&entry.unit),
        _ => {}
    }
    let owner = format!("{}{}.", level.path, reference.dictionary);
    Ok((Node { of: Owner::Dictionary, owner, connector: end.connector.clone() }, seen))
}

fn connector<'a>(all: &'a [Connector], name: &str, of: &str) -> Result<&'a Connector, String> {
    let names = || all.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
    all.iter().find(|c| c.name == name).ok_or_else(|| format!("{of} has no connector {name}; it has {}", names()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The kinds of a component's connectors to which a value may pass.
    fn targets(from_component: bool, from: &str) -> Vec<&str> {
        let kinds = ["structuralParameter", "parameter", "input", "inout", "output", "local", "constant"];
        kinds.into_iter().filter(|to| allowed([(from_component, from), (true, to)])).collect()
    }

    #[test]
    fn values_pass_to_what_is_set_as_late() {
        let (any, fixed, inputs) = (
            ["structuralParameter", "parameter", "input", "inout"],
            ["parameter", "input", "inout"],
            ["input", "inout"],
        );
        assert_eq!(targets(false, "structuralParameter"), any);
        assert_eq!(targets(true, "constant"), any);
        assert_eq!(targets(false, "parameter"), fixed);
        assert_eq!(targets(true, "calculatedParameter"), fixed);
        assert_eq!(targets(true, "output"), inputs);
        assert_eq!(targets(false, "input"), inputs);
        assert_eq!(targets(true, "inout"), ["input"]);
        assert_eq!(targets(true, "parameter"), [""; 0]);
    }
}
