//! A document: its text, and the name of its root.

use crate::error::Error;
use crate::xml::Element;

/// The text of a document; both standards require UTF-8.
///
/// # Errors
/// It is in another encoding: names UTF-16 and UTF-32, which have a byte order mark or null bytes.
pub fn decode(bytes: &[u8]) -> Result<&str, Error> {
    let other = match bytes {
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => Some("UTF-32"),
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [b'<', 0, ..] | [0, b'<', ..] => Some("UTF-16"),
        _ => None,
    };
    if let Some(other) = other {
        return Err(Error::NotXml { line: 1, reason: format!("the encoding is {other}, expected UTF-8") });
    }
    std::str::from_utf8(bytes).map_err(|e| {
        let line = bytes[..e.valid_up_to()].split(|&b| b == b'\n').count();
        Error::NotXml { line, reason: "not UTF-8".into() }
    })
}

/// Whether the root has this name.
pub(super) fn of_kind(root: &Element, expected: &'static str) -> Result<(), Error> {
    if root.name == expected {
        return Ok(());
    }
    Err(Error::OtherRoot { line: root.line, found: root.name.clone(), expected })
}
