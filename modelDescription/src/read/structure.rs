//! `ModelStructure`.

use super::attributes::{integers, owned, required_integer};
use crate::description::Unknown;
use crate::error::Error;
use crate::version::FmiVersion;
use crate::xml::Element;

/// The unknowns of one list: in FMI 2.0 an element with `Unknown`s in it, in FMI 3.0 all elements of one name.
pub(super) fn unknowns(
    structure: &Element,
    version: FmiVersion,
    list: &str,
    single: &str,
) -> Result<Vec<Unknown>, Error> {
    match version {
        FmiVersion::V2 => {
            let list = structure.child(list).into_iter().flat_map(|list| list.all("Unknown"));
            list.map(|e| unknown(e, "index")).collect()
        }
        FmiVersion::V3 => structure.all(single).map(|e| unknown(e, "valueReference")).collect(),
    }
}

fn unknown(element: &Element, reference: &str) -> Result<Unknown, Error> {
    let words = |text: String| text.split_ascii_whitespace().map(str::to_owned).collect();
    Ok(Unknown {
        reference: required_integer(element, reference)?,
        dependencies: integers(element, "dependencies")?,
        kinds: owned(element, "dependenciesKind").map(words),
        line: element.line,
    })
}
