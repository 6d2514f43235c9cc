//! The elements of a system.

use super::path::{Hop, StatedUnit};
use super::ssm::MappingEntry;
use super::ssv::Parameter;

/// An FMU of the system.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// Name used by connections.
    pub name: String,
    /// Its archive, a path within the SSP.
    pub source: String,
    /// Variables that can be connected.
    pub connectors: Vec<Connector>,
    /// Values of its variables.
    pub bindings: Vec<Binding>,
    /// `CoSimulation` or `ModelExchange`, if it supports only this one.
    pub implementation: Option<String>,
    /// Line of the element.
    pub line: usize,
}

/// A variable that can be connected.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Connector {
    /// Name; for a component, the variable's name.
    pub name: String,
    /// `input`, `output`, `parameter` and so on.
    pub kind: String,
    /// Its type, as in `Real`, if the file gives one.
    pub base: Option<String>,
    /// Unit, if the file gives one.
    pub unit: Option<StatedUnit>,
    /// Numbers and names of an enumeration.
    pub items: Vec<(i64, String)>,
    /// `intervalVariability` of a clock.
    pub ticks: Option<String>,
    /// The clocks of the variable.
    pub clocks: Vec<String>,
    /// Extents of an array; `None` for one that the file leaves open.
    pub extents: Vec<Option<usize>>,
    /// Line of the element.
    pub line: usize,
}

/// Two connectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Connection {
    /// One end; in a [`Structure`](super::structure::Structure), the source.
    pub start: ConnectionEnd,
    /// The other.
    pub end: ConnectionEnd,
    /// The path of the value: in a [`Structure`](super::structure::Structure) through the connectors of inner systems.
    pub hops: Vec<Hop>,
    /// Line of the element.
    pub line: usize,
}

/// An end of a connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConnectionEnd {
    /// The component; `None` for the system itself.
    pub element: Option<String>,
    /// Name of the connector.
    pub connector: String,
}

impl std::fmt::Display for ConnectionEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.element {
            Some(element) => write!(f, "{element}.{}", self.connector),
            None => write!(f, "{} of the system", self.connector),
        }
    }
}

/// Parameter values of a component or of the system.
#[derive(Clone, Debug, PartialEq)]
pub struct Binding {
    /// File within the SSP, or the values themselves.
    pub values: Contents<Vec<Parameter>>,
    /// Prefix of every name of the values.
    pub prefix: String,
    /// Mapping of the names, and where these names begin.
    pub mapping: Option<Contents<Vec<MappingEntry>>>,
    /// Path of the system of the binding, which ends with a dot; empty for a component and the outer system.
    pub path: String,
}

/// Content of a file or of the description itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Contents<T> {
    /// In a file of the archive.
    File(String),
    /// In a file of the component's archive.
    InComponent(String),
    /// In the description itself.
    Inline(T),
}
