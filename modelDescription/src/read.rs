//! reader (next)
use crate::description::ModelDescription;
use crate::error::Error;

/// Reads.
///
/// # Errors
/// Not XML.
pub fn read(_xml: impl AsRef<[u8]>) -> Result<ModelDescription, Error> {
    Err(Error::NotXml { line: 1, reason: String::new() })
}
