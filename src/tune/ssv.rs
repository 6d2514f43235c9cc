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
    let mut text = format!("{HEAD} name=\"{}\" generationTool=\"fmu tune\">\n  <ssv:Parameters>\n", escape(name));
    for Setting { name, value, .. } in settings {
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

/// Names and values of a file, the values as a user writes them.
///
/// # Errors
/// Says what is no parameter set.
pub fn read(text: &str) -> Result<Vec<(String, String)>, String> {
    let root = Element::parse(text).map_err(|e| e.to_string())?;
    let local = |element: &Element| element.name.rsplit(':').next().unwrap_or_default().to_owned();
    if local(&root) != "ParameterSet" {
        return Err(format!("is no ParameterSet of SSP but {}", root.name));
    }
    let sets = root.children.iter().filter(|c| local(c) == "Parameters");
    sets.flat_map(|set| &set.children)
        .map(|parameter| {
            let at = |what: &str| format!("line {}: {what}", parameter.line);
            let name = parameter.get("name").ok_or_else(|| at("a parameter without a name"))?;
            let value = parameter.children.iter().find(|c| !["Annotations", "MetaData"].contains(&local(c).as_str()));
            let value = value.and_then(|v| v.get("value")).ok_or_else(|| at(&format!("{name} has no value")))?;
            Ok((name.to_owned(), value.to_owned()))
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
        let back = read(&text("a \"b\" <c>", &settings)).unwrap();
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
