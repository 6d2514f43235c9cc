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

/// The value of an element: an attribute, or in SSP 2.0 an element for each element of an array.
fn value(e: &Element) -> Option<String> {
    let all = e.children.iter().filter(|c| c.name.rsplit(':').next() == Some("Value"));
    let all: Vec<&str> = all.map(|c| c.get("value")).collect::<Option<_>>()?;
    let quoted = |text: &&str| if text.contains(',') { format!("\"{text}\"") } else { (*text).to_owned() };
    match e.get("value") {
        None if !all.is_empty() => Some(all.iter().map(quoted).collect::<Vec<_>>().join(",")),
        value => value.map(str::to_owned),
    }
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
            let value = typed.and_then(value).ok_or_else(|| at(&format!("{name} has no value")))?;
            let unit = typed.and_then(unit);
            let base = defined.iter().find(|(name, _)| unit.as_ref() == Some(name)).map(|(_, base)| *base);
            Ok(Parameter { name: name.to_owned(), value, unit, base, line: parameter.line })
        })
        .collect()
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
        assert!(of("<v:String/>").unwrap_err().ends_with("p has no value"));
    }

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
