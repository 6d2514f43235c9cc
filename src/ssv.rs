//! Parameter values as a file of SSP 1.0 (System Structure Parameter Values).
//!
//! Numbers are in the units of the variables (SI), so no unit is named; an enumeration's value is the name of its item.

use drive_tools::tune::setting::{Setting, Value};
use fmu_core::variable::position;
use fmu_pack::TOOL;
use fmu_plot::page::escape;
use std::fmt::Write as _;

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ssv:ParameterSet \
     xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" \
     xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" version=\"1.0\"";

/// The text of the file with these settings.
pub fn text(name: &str, settings: &[Setting]) -> String {
    text_of(name, settings.iter().map(|s| (s.name, &s.value)))
}

/// The file of any names and values.
pub fn text_of<'a>(name: &str, values: impl IntoIterator<Item = (&'a str, &'a Value)>) -> String {
    let mut text = format!("{HEAD} name=\"{}\" generationTool=\"{}\">\n  <ssv:Parameters>\n", escape(name), TOOL);
    let mut put = |name: &str, kind: &str, value: &str| {
        let name = escape(name);
        let _ = writeln!(text, "    <ssv:Parameter name=\"{name}\"><ssv:{kind} value=\"{value}\"/></ssv:Parameter>");
    };
    for (name, value) in values {
        match value {
            Value::Real(x) => put(name, "Real", &x.to_string()),
            // SSP 1.0 has no arrays: one parameter for each element, with its name in FMI 2.0.
            Value::Reals(all) => all.iter().enumerate().for_each(|(element, x)| {
                put(&format!("{name}{}", position(&[all.len()], element)), "Real", &x.to_string());
            }),
            Value::Integer(i) => put(name, "Integer", &i.to_string()),
            Value::Boolean(b) => put(name, "Boolean", &b.to_string()),
            Value::Item(item) => put(name, "Enumeration", &escape(item)),
        }
    }
    text.push_str("  </ssv:Parameters>\n</ssv:ParameterSet>\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_system::ssp::ssv::read;

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
    }
}
