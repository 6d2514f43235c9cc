//! Parameter values as a file of SSP 1.0 (System Structure Parameter Values), and back.
//!
//! Numbers are in the units of the variables (SI), so no unit is named; an enumeration's value is the name of its item.

use super::rules::{Setting, Value};
use model_description::Element;
use std::fmt::Write as _;

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ssv:ParameterSet \
     xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" \
     xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" version=\"1.0\"";

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The file.
pub fn text(name: &str, settings: &[Setting]) -> String {
    text_of(name, settings.iter().map(|s| (s.name, &s.value)))
}

/// The file of any names and values.
pub fn text_of<'a>(name: &str, values: impl IntoIterator<Item = (&'a str, &'a Value)>) -> String {
    let mut text =
        format!("{HEAD} name=\"{}\" generationTool=\"{}\">\n  <ssv:Parameters>\n", escape(name), crate::pack::TOOL);
    for (name, value) in values {
        let (kind, value) = match value {
            Value::Real(x) => ("Real", x.to_string()),
            Value::Integer(i) => ("Integer", i.to_string()),
            Value::Boolean(b) => ("Boolean", b.to_string()),
            Value::Item(item) => ("Enumeration", escape(item)),
        };
        let _ = writeln!(
            text,
            "    <ssv:Parameter name=\"{}\"><ssv:{kind} value=\"{value}\"/></ssv:Parameter>",
            escape(name)
        );
    }
    text.push_str("  </ssv:Parameters>\n</ssv:ParameterSet>\n");
    text
}

/// A value of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Name of the variable.
    pub name: String,
    /// Its value, as a user writes it.
    pub value: String,
    /// Its unit, where the file tells it.
    pub unit: Option<String>,
    /// Line of the element.
    pub line: usize,
}

/// The values of a file.
///
/// # Errors
/// Says what is no parameter set.
pub fn read(text: &str) -> Result<Vec<Parameter>, String> {
    parameters(&Element::parse(text).map_err(|e| e.to_string())?)
}

/// The values of a parameter set.
///
/// # Errors
/// The element is none, or a parameter has no name or no value.
pub fn parameters(root: &Element) -> Result<Vec<Parameter>, String> {
    let local = |element: &Element| element.name.rsplit(':').next().unwrap_or_default().to_owned();
    if local(root) != "ParameterSet" {
        return Err(format!("line {}: is no ParameterSet of SSP but {}", root.line, root.name));
    }
    let sets = root.children.iter().filter(|c| local(c) == "Parameters");
    sets.flat_map(|set| &set.children)
        .filter(|c| local(c) == "Parameter")
        .map(|parameter| {
            let at = |what: &str| format!("line {}: {what}", parameter.line);
            let name = parameter.get("name").ok_or_else(|| at("a parameter without a name"))?;
            let typed = parameter.children.iter().find(|c| !["Annotations", "MetaData"].contains(&local(c).as_str()));
            let value = typed.and_then(|v| v.get("value")).ok_or_else(|| at(&format!("{name} has no value")))?;
            let unit = typed.and_then(|v| v.get("unit")).map(str::to_owned);
            Ok(Parameter { name: name.to_owned(), value: value.to_owned(), unit, line: parameter.line })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back() {
        let setting = |name, value| Setting { name, value, rule: String::new(), origin: None };
        let settings = [
            setting("motor.R_s", Value::Real(0.1 + 0.2)),
            setting("motor.n_p", Value::Integer(3)),
            setting("current.mtpa", Value::Boolean(true)),
            setting("estimator", Value::Item("ExtendedEmf".into())),
        ];
        let back: Vec<_> =
            read(&text("a \"b\" <c>", &settings)).unwrap().into_iter().map(|p| (p.name, p.value)).collect();
        let expected = [
            ("motor.R_s", "0.30000000000000004"),
            ("motor.n_p", "3"),
            ("current.mtpa", "true"),
            ("estimator", "ExtendedEmf"),
        ];
        assert_eq!(back, expected.map(|(n, v)| (n.to_owned(), v.to_owned())));
        assert!(read("<a/>").unwrap_err().contains("no ParameterSet"));
        assert!(
            read("<ParameterSet><Parameters>\n<Parameter/></Parameters></ParameterSet>")
                .unwrap_err()
                .contains("line 2")
        );
    }
}
