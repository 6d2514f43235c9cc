//! Elements of the files of SSP: names without their prefixes, lists, units.

use model_description::{BaseUnit, Element};

/// Name without its namespace prefix.
pub(super) fn local(element: &Element) -> &str {
    element.name.rsplit(':').next().unwrap_or_default()
}

pub(super) fn child<'a>(parent: &'a Element, name: &str) -> Option<&'a Element> {
    parent.children.iter().find(|c| local(c) == name)
}

/// The children of a child, or none.
pub(super) fn list<'a>(parent: &'a Element, name: &str) -> impl Iterator<Item = &'a Element> {
    child(parent, name).into_iter().flat_map(|e| &e.children).filter(|e| local(e) != "Annotations")
}

pub(super) fn at(e: &Element, what: impl std::fmt::Display) -> String {
    format!("line {}: {what}", e.line)
}

pub(super) fn required(e: &Element, name: &str) -> Result<String, String> {
    e.get(name).map(str::to_owned).ok_or_else(|| at(e, format!("<{}> has no attribute {name}", e.name)))
}

/// The units of a file: name and relation to the SI base units (SSP 1.0, 4.3).
pub(super) fn units(root: &Element) -> Result<Vec<(String, BaseUnit)>, String> {
    let one = |e: &Element| {
        let base = child(e, "BaseUnit").map(BaseUnit::read).transpose().map_err(|why| at(e, why))?;
        Ok::<_, String>((required(e, "name")?, base))
    };
    let all = list(root, "Units").map(one).collect::<Result<Vec<_>, _>>()?;
    Ok(all.into_iter().filter_map(|(name, base)| Some((name, base?))).collect())
}

/// The unit of a typed element. Some tools write `None` for none.
pub(super) fn unit(typed: &Element) -> Option<String> {
    typed.get("unit").filter(|unit| !["", "None"].contains(unit)).map(str::to_owned)
}
