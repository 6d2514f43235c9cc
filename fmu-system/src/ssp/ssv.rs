//! Parameter values from a file of SSP 1.0 or 2.0 (System Structure Parameter Values).

use super::element::{Definitions, TYPES, local};
use model_description::{BaseUnit, Element};
use std::collections::BTreeSet;

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

/// The value of an element: an attribute, or in SSP 2.0 an element for each element of an array.
fn value(e: &Element, is_array: bool) -> Option<String> {
    let all = e.children.iter().filter(|c| local(c) == "Value");
    let all: Vec<&str> = all.map(|c| c.get("value")).collect::<Option<_>>()?;
    let quoted = |text: &&str| if text.contains(',') { format!("\"{text}\"") } else { (*text).to_owned() };
    match (e.get("value"), &all[..]) {
        (None, []) => None,
        (None, [one]) if !is_array => Some((*one).to_owned()),
        (None, all) => Some(all.iter().map(quoted).collect::<Vec<_>>().join(",")),
        (value, []) => value.map(str::to_owned),
        (Some(_), _) => None,
    }
}

/// The values of a parameter set.
///
/// # Errors
/// The element is not a parameter set, a parameter has no name or no value, or two have the same name.
pub fn parameters(root: &Element) -> Result<Vec<Parameter>, String> {
    if local(root) != "ParameterSet" {
        return Err(format!("line {}: <{}> is not a ParameterSet of SSP", root.line, root.name));
    }
    let defined = Definitions::read(root)?;
    let sets = root.children.iter().filter(|c| local(c) == "Parameters");
    let (mut all, mut names) = (Vec::new(), BTreeSet::new());
    for parameter in sets.flat_map(|set| &set.children).filter(|c| local(c) == "Parameter") {
        let at = |what: &str| format!("line {}: {what}", parameter.line);
        let name = parameter.get("name").ok_or_else(|| at("a parameter without a name"))?;
        let typed = parameter.children.iter().find(|c| TYPES.contains(&local(c)));
        let is_array = parameter.children.iter().any(|c| local(c) == "Dimension");
        let value = typed
            .and_then(|typed| value(typed, is_array))
            .ok_or_else(|| at(&format!("{name} has no value, or two")))?;
        let unit = typed.and_then(|typed| defined.unit(typed));
        if !names.insert(name) {
            return Err(at(&format!("{name} already has a value: remove one of them")));
        }
        let (unit, base) = unit.map_or((None, None), |unit| (Some(unit.name), unit.base));
        all.push(Parameter { name: name.to_owned(), value, unit, base, line: parameter.line });
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_of_ssp_2_have_an_element_for_each_value() {
        let of = |inside: &str| {
            let text = format!(
                "<ParameterSet><Parameters><Parameter name='p'>{inside}</Parameter></Parameters></ParameterSet>"
            );
            read(&text).map(|mut all| all.remove(0).value)
        };
        let texts = "<v:String><v:Value value='a b'/><v:Value value='c,d'/></v:String><c:Dimension size='2'/>";
        assert_eq!(of(texts).unwrap(), "a b,\"c,d\"");
        assert_eq!(of("<v:UInt64 value='18446744073709551615'/>").unwrap(), "18446744073709551615");
        assert_eq!(of("<v:Float64 value='1 2 3'/><c:Dimension size='3'/>").unwrap(), "1 2 3");
        for none in ["<v:String/>", "<v:String value='a'><v:Value value='b'/></v:String>"] {
            assert!(of(none).unwrap_err().ends_with("p has no value, or two"));
        }
        assert_eq!(of("<v:String><v:Value value='c,d'/></v:String>").unwrap(), "c,d");
    }

    #[test]
    fn what_is_no_parameter_set_is_refused() {
        assert!(read("<a/>").unwrap_err().contains("is not a ParameterSet"));
        assert!(
            read("<ParameterSet><Parameters>\n<Parameter/></Parameters></ParameterSet>")
                .unwrap_err()
                .contains("line 2")
        );
        let twice = "<v:Parameter name='p'><v:Real value='1'/></v:Parameter>".repeat(2);
        let error = read(&format!("<ParameterSet><Parameters>{twice}</Parameters></ParameterSet>")).unwrap_err();
        assert_eq!(error, "line 1: p already has a value: remove one of them");
    }
}
