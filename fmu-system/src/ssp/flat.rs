//! Inner systems of an SSP, resolved: only components, connections between them and the connectors of the outer system remain.
//!
//! A component `b` of the inner system `in` becomes the component `in.b`. A connector of an inner system, and a parameter of any
//! system, is a name for the connectors of components that it reaches.

use super::component::{Binding, Component, Connection, ConnectionEnd, Connector};
use model_description::Conversion;

/// A system as its element has it.
#[derive(Default)]
pub(super) struct Level {
    /// Names of the systems around its contents, each with a dot; empty for the outer one.
    pub path: String,
    pub components: Vec<Component>,
    pub connectors: Vec<Connector>,
    pub connections: Vec<Connection>,
    pub bindings: Vec<Binding>,
    pub inner: Vec<Level>,
}

/// Names and what they reach: connectors of components, each with a conversion of the value.
pub(super) type Reach = Vec<(String, Vec<(String, Option<Conversion>)>)>;

/// A system without inner ones.
#[derive(Default)]
pub(super) struct Flat {
    pub components: Vec<Component>,
    pub connectors: Vec<Connector>,
    pub connections: Vec<Connection>,
    /// Inner ones first.
    pub bindings: Vec<Binding>,
    pub reach: Reach,
}

/// A connector with the full name of its owner.
#[derive(Clone, PartialEq)]
struct Node {
    /// Full name of a component, or path of a system, which ends with a dot.
    owner: String,
    connector: String,
    is_component: bool,
}

impl Node {
    fn name(&self) -> String {
        if self.is_component {
            format!("{}.{}", self.owner, self.connector)
        } else {
            format!("{}{}", self.owner, self.connector)
        }
    }

    /// A connector of the outer system.
    fn is_outside(&self) -> bool {
        !self.is_component && self.owner.is_empty()
    }

    fn end(&self) -> ConnectionEnd {
        let element = (!self.owner.is_empty()).then(|| self.owner.clone());
        ConnectionEnd { element, connector: self.connector.clone() }
    }
}

/// A connection from its source to its target.
struct Edge<'a> {
    from: Node,
    to: Node,
    is_parameter: bool,
    of: &'a Connection,
}

/// Resolves the inner systems.
///
/// # Errors
/// The line of a connection, and what is wrong with it.
pub(super) fn flat(outer: &Level) -> Result<Flat, String> {
    let mut levels = Vec::new();
    collect(outer, &mut levels);
    let mut edges = Vec::new();
    for level in &levels {
        for connection in &level.connections {
            edges.push(edge(level, connection).map_err(|cause| format!("line {}: {cause}", connection.line))?);
        }
    }
    let mut flat = Flat::default();
    for edge in edges.iter().filter(|edge| edge.to.is_component || edge.to.is_outside()) {
        let at = |cause: String| format!("line {}: {cause}", edge.of.line);
        let (mut from, mut conversion, mut plain) = (&edge.from, edge.of.transformation, edge.of.no_conversion);
        let mut table = edge.of.table.clone();
        let mut passed = vec![(from.clone(), conversion)];
        while !from.is_component && !from.is_outside() {
            let mut feeding = edges.iter().filter(|other| other.to == *from);
            let Some(next) = feeding.next() else { break };
            if feeding.next().is_some() {
                return Err(at(format!("{} is fed twice: remove one of the connections", from.name())));
            }
            if passed.len() > edges.len() {
                return Err(at(format!("{} is connected with itself", from.name())));
            }
            if (table.is_some() || next.of.table.is_some()) && (conversion, &table) != (None, &None) {
                return Err(at("a table and another transformation on one path are not supported".into()));
            }
            table = table.or_else(|| next.of.table.clone());
            conversion = Conversion::then(next.of.transformation, conversion);
            plain |= next.of.no_conversion;
            from = &next.from;
            passed.push((from.clone(), conversion));
        }
        if edge.is_parameter && table.is_some() {
            return Err(at("a table for a parameter is not supported: write a ParameterMapping".into()));
        }
        if edge.to.is_component {
            for (node, conversion) in passed.iter().filter(|(node, _)| !node.is_component) {
                if edge.is_parameter || !node.is_outside() {
                    reached(&mut flat.reach, node.name(), (edge.to.name(), *conversion));
                }
            }
        }
        // What nothing feeds keeps its value, and parameters are set and not connected.
        if !edge.is_parameter && (from.is_component || from.is_outside()) {
            if (conversion.is_some() || table.is_some()) && (from.is_outside() || edge.to.is_outside()) {
                return Err(at("a transformation at a connector of the system is not supported".into()));
            }
            let (start, end) = (from.end(), edge.to.end());
            let line = edge.of.line;
            flat.connections.push(Connection {
                start,
                end,
                no_conversion: plain,
                transformation: conversion,
                table,
                line,
            });
        }
    }
    flat.connectors.clone_from(&outer.connectors);
    for level in levels.iter().rev() {
        flat.bindings.extend(
            level.bindings.iter().map(|b| Binding { prefix: format!("{}{}", level.path, b.prefix), ..b.clone() }),
        );
    }
    flat.components = levels.iter().flat_map(|level| level.components.iter().cloned()).collect();
    Ok(flat)
}

fn collect<'a>(level: &'a Level, all: &mut Vec<&'a Level>) {
    all.push(level);
    level.inner.iter().for_each(|inner| collect(inner, all));
}

fn reached(reach: &mut Reach, name: String, target: (String, Option<Conversion>)) {
    match reach.iter_mut().find(|(known, _)| *known == name) {
        Some((_, targets)) => targets.push(target),
        None => reach.push((name, vec![target])),
    }
}

/// The connection with its direction: an output of an element or an input of the system is the source, regardless of start and
/// end.
fn edge<'a>(level: &Level, c: &'a Connection) -> Result<Edge<'a>, String> {
    let ((start, one), (end, other)) = (node(level, &c.start)?, node(level, &c.end)?);
    let inside = |end: &ConnectionEnd| end.element.is_some();
    let sends = |end: &ConnectionEnd, kind: &str| match kind {
        "output" | "calculatedParameter" => inside(end),
        "input" | "parameter" | "structuralParameter" => !inside(end),
        _ => false,
    };
    let takes = |end: &ConnectionEnd, kind: &str| match kind {
        "input" | "parameter" | "structuralParameter" => inside(end),
        "output" | "calculatedParameter" => !inside(end),
        _ => false,
    };
    let value = |kind: &str| ["input", "output"].contains(&kind);
    let alike = value(&one) == value(&other);
    let (from, to) = if alike && sends(&c.start, &one) && takes(&c.end, &other) {
        (start, end)
    } else if alike && sends(&c.end, &other) && takes(&c.start, &one) {
        (end, start)
    } else {
        return Err(format!(
            "connects {} ({one}) with {} ({other}): expected an output and an input of components, or one of them and the \
             same kind of the system",
            c.start, c.end
        ));
    };
    let calculated = [&one, &other].iter().any(|kind| *kind == "calculatedParameter");
    if calculated {
        return Err(format!("connects {} with {}: a calculatedParameter cannot be connected", c.start, c.end));
    }
    if from.is_outside() && to.is_outside() {
        return Err("connects the system with itself, which is not supported: remove it".into());
    }
    Ok(Edge { from, to, is_parameter: ["parameter", "structuralParameter"].contains(&one.as_str()), of: c })
}

/// The connector at an end, and its kind.
fn node(level: &Level, end: &ConnectionEnd) -> Result<(Node, String), String> {
    let (of, connectors, owner, is_component) = match &end.element {
        None => ("the system".to_owned(), &level.connectors, level.path.clone(), false),
        Some(element) => {
            let full = format!("{}{element}", level.path);
            let component =
                level.components.iter().find(|c| c.name == full).map(|c| (&c.connectors, full.clone(), true));
            let inner = level.inner.iter().find(|inner| inner.path == format!("{full}."));
            let found = component.or_else(|| inner.map(|inner| (&inner.connectors, inner.path.clone(), false)));
            let none = || {
                let names = level.components.iter().map(|c| c.name.as_str());
                let inner = level.inner.iter().map(|inner| inner.path.trim_end_matches('.'));
                format!(
                    "there is no component {element}; available: {}",
                    names.chain(inner).collect::<Vec<_>>().join(", ")
                )
            };
            let (connectors, owner, is_component) = found.ok_or_else(none)?;
            (element.clone(), connectors, owner, is_component)
        }
    };
    let names = || connectors.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
    let found = connectors.iter().find(|c| c.name == end.connector);
    let found = found.ok_or_else(|| format!("{of} has no connector {}; it has {}", end.connector, names()))?;
    Ok((Node { owner, connector: end.connector.clone(), is_component }, found.kind.clone()))
}
