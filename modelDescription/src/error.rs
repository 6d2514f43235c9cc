//! Reasons why a modelDescription.xml cannot be read.

/// The reason why the XML cannot be read: the line, the content found and expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Not a well-formed XML document in UTF-8.
    #[error("line {line}: not well-formed XML: {reason}")]
    NotXml {
        /// Line, from 1.
        line: usize,
        /// Message of the parser.
        reason: String,
    },
    /// The document exceeds one of the [`limits`](crate::limits) of readers.
    #[error("{0}")]
    Limit(String),
    /// An XML document of another kind.
    #[error("line {line}: the root element is <{found}>, expected <{expected}>")]
    OtherRoot {
        /// Line, from 1.
        line: usize,
        /// Name of the root element.
        found: String,
        /// Expected name.
        expected: &'static str,
    },
    /// FMI 1.0, or a version that does not exist.
    #[error("line {line}: fmiVersion=\"{found}\" is not supported, expected 2.0 or 3.0")]
    UnsupportedVersion {
        /// Line, from 1.
        line: usize,
        /// The value of `fmiVersion`.
        found: String,
    },
    /// A required attribute is missing.
    #[error("line {line}: <{element}> has no attribute \"{attribute}\"")]
    MissingAttribute {
        /// Line, from 1.
        line: usize,
        /// Name of the element.
        element: String,
        /// Name of the attribute.
        attribute: String,
    },
    /// A required element is missing.
    #[error("line {line}: <{parent}> has no element <{element}>")]
    MissingElement {
        /// Line of the parent, from 1.
        line: usize,
        /// Name of the parent.
        parent: String,
        /// Name of the missing element.
        element: String,
    },
    /// An attribute value has the wrong form.
    #[error("line {line}: <{element}> has {attribute}=\"{found}\", expected {expected}")]
    Value {
        /// Line, from 1.
        line: usize,
        /// Name of the element.
        element: String,
        /// Name of the attribute.
        attribute: String,
        /// The value.
        found: String,
        /// What was expected.
        expected: String,
    },
}
