//! `ModelStructure`.

use super::attributes::{integers, owned, required_integer};
use crate::description::Unknown;
use crate::error::Error;
use crate::limits;
use crate::version::FmiVersion;
use crate::xml::Element;

/// The unknowns of one list: in FMI 2.0 an element with `Unknown`s in it, in FMI 3.0 all elements of one name.
pub(super) fn unknowns(
    structure: &Element,
    version: FmiVersion,
    list: &str,
    single: &str,
) -> Result<Vec<Unknown>, Error> {
    let (elements, reference): (Vec<&Element>, _) = match version {
        FmiVersion::V2 => (structure.child(list).into_iter().flat_map(|list| list.all("Unknown")).collect(), "index"),
        FmiVersion::V3 => (structure.all(single).collect(), "valueReference"),
    };
    for words in ["dependencies", "dependenciesKind"] {
        let count = |e: &&Element| e.get(words).map_or(0, |text| text.split_ascii_whitespace().count() as u64);
        limits::DEPENDENCIES.check(elements.iter().map(count).sum()).map_err(Error::Limit)?;
    }
    elements.into_iter().map(|e| unknown(e, reference)).collect()
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
