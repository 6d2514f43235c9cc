//! Parameter values from a file of SSP 1.0 (System Structure Parameter Values).

use super::element::{unit, units};
use model_description::{BaseUnit, Element};

/// A value of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name of the variable.
    pub name: String,
    /// Its value, as in user input.
    pub value: String,
    /// Its unit, if the file gives one.
    pub unit: Option<String>,
    /// The relation of the unit to the SI base units, if the file defines it.
    pub base: Option<BaseUnit>,
    /// Line of the element.
    pub line: usize,
}

/// The values of a file.
///
/// # Errors
/// The text is not XML or not a parameter set.
pub fn read(text: &str) -> Result<Vec<Parameter>, String> {
    parameters(&Element::parse(text).map_err(|e| e.to_string())?)
}

/// The values of a parameter set.
///
/// # Errors
/// The element is not a parameter set, or a parameter has no name or no value.
pub fn parameters(root: &Element) -> Result<Vec<Parameter>, String> {
    let local = |element: &Element| element.name.rsplit(':').next().unwrap_or_default().to_owned();
    if local(root) != "ParameterSet" {
        return Err(format!("line {}: <{}> is not a ParameterSet of SSP", root.line, root.name));
    }
    let defined = units(root)?;
    let sets = root.children.iter().filter(|c| local(c) == "Parameters");
    sets.flat_map(|set| &set.children)
        .filter(|c| local(c) == "Parameter")
        .map(|parameter| {
            let at = |what: &str| format!("line {}: {what}", parameter.line);
            let name = parameter.get("name").ok_or_else(|| at("a parameter without a name"))?;
            let typed = parameter.children.iter().find(|c| !["Annotations", "MetaData"].contains(&local(c).as_str()));
            let value = typed.and_then(|v| v.get("value")).ok_or_else(|| at(&format!("{name} has no value")))?;
            let unit = typed.and_then(unit);
            let base = defined.iter().find(|(name, _)| unit.as_ref() == Some(name)).map(|(_, base)| *base);
            Ok(Parameter { name: name.to_owned(), value: value.to_owned(), unit, base, line: parameter.line })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_parameter_set_is_refused() {
        assert!(read("<a/>").unwrap_err().contains("is not a ParameterSet"));
        assert!(
            read("<ParameterSet><Parameters>\n<Parameter/></Parameters></ParameterSet>")
                .unwrap_err()
                .contains("line 2")
        );
    }
}
