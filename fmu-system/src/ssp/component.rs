//! The elements of a system.

use super::ssm::MappingEntry;
use super::ssv::Parameter;
use model_description::Conversion;

/// An FMU of the system.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// Name, by which connections refer to it.
    pub name: String,
    /// Its archive, a path within the SSP.
    pub source: String,
    /// Variables that can be connected.
    pub connectors: Vec<Connector>,
    /// Values of its variables.
    pub bindings: Vec<Binding>,
    /// It is made for Model Exchange alone.
    pub model_exchange: bool,
    /// Line of the element.
    pub line: usize,
}

/// A variable that can be connected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Connector {
    /// Name; of a component, that of the variable.
    pub name: String,
    /// `input`, `output`, `parameter`, `calculatedParameter` or `inout`.
    pub kind: String,
    /// Unit, if the file gives one.
    pub unit: Option<String>,
    /// Line of the element.
    pub line: usize,
}

/// Source values and what becomes of them.
pub(super) type Table = std::sync::Arc<[(String, String)]>;

/// Two connectors; which of them sends follows from their kinds.
#[derive(Clone, Debug, PartialEq)]
pub struct Connection {
    /// One end.
    pub start: ConnectionEnd,
    /// The other.
    pub end: ConnectionEnd,
    /// Whether values pass without conversion, even between different units.
    pub no_conversion: bool,
    /// Conversion of the value, after that of the units.
    pub transformation: Option<Conversion>,
    /// Source values and what becomes of them, instead of a conversion.
    pub table: Option<Table>,
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
    pub values: ParameterValues,
    /// Prefix of every name.
    pub prefix: String,
    /// Mapping of the names.
    pub mapping: Option<Mapping>,
}

/// Location of a mapping.
#[derive(Clone, Debug, PartialEq)]
pub enum Mapping {
    /// In a file of the archive.
    File(String),
    /// In the description itself.
    Inline(Vec<MappingEntry>),
}

/// Location of values.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterValues {
    /// In a file of the archive.
    File(String),
    /// In the description itself.
    Inline(Vec<Parameter>),
}
