//! `Machines.mo`: a record for each machine, with the values of `fmu tune` for the plant and for the controller.

use super::base::dialog;
use super::interface::{Interface, Kind, Variable};
use super::text::{declare, html, identifier};
use anyhow::{Context, Result, bail, ensure};
use drive_tools::tune::{
    self,
    setting::{Tuned, Value},
};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A machine: the name of its record, its description, and its values.
pub(super) struct Machine {
    name: String,
    about: String,
    values: Vec<(String, Value)>,
}

/// Reads machines, with the names that their values have in the FMU.
///
/// # Errors
/// A file is invalid; the FMU lacks the variables of a machine; two files have the same name.
pub(super) fn read(files: &[PathBuf], interface: &Interface) -> Result<Vec<Machine>> {
    let mut all: Vec<Machine> = Vec::new();
    for file in files {
        let tuned = tune::tune(file)?;
        let machine = of(file, &tuned, interface).with_context(|| file.display().to_string())?;
        if all.iter().any(|m| m.name == machine.name) {
            bail!("--motor {}: another machine is named {}", file.display(), machine.name);
        }
        all.push(machine);
    }
    Ok(all)
}

fn of(file: &Path, tuned: &Tuned, interface: &Interface) -> Result<Machine> {
    let drive = interface.parameters.iter().any(|p| p.fmi.starts_with("plant."));
    let values = if drive {
        tune::joined(&tuned.plant, &tuned.controller)
    } else {
        tuned.plant.iter().map(|s| (s.name.to_owned(), s.value.clone())).collect()
    };
    for (name, _) in &values {
        ensure!(variable(interface, name).is_some(), "a machine has {name}, but the FMU has no such parameter");
    }
    let stem = file.file_stem().and_then(|s| s.to_str()).context("its name is not valid UTF-8")?;
    let name = identifier(stem);
    let name = if name.starts_with(|c: char| c.is_ascii_digit()) { format!("m_{name}") } else { name };
    super::text::check("the record", &name)?;
    Ok(Machine { name, about: format!("{}. {}", tuned.name.trim_end_matches('.'), tuned.source), values })
}

fn variable<'a>(interface: &'a Interface, fmi: &str) -> Option<&'a Variable> {
    interface.parameters.iter().chain(&interface.inputs).find(|v| v.fmi == fmi)
}

/// The variables that some machine sets.
pub(super) fn names(machines: &[Machine]) -> BTreeSet<String> {
    machines.iter().flat_map(|m| &m.values).map(|(name, _)| name.clone()).collect()
}

/// The text of the file.
///
/// # Errors
/// A value does not fit its variable.
pub(super) fn text(package: &str, machines: &[Machine], interface: &Interface) -> Result<String> {
    let set = names(machines);
    let mut out = format!(
        "within {package};\npackage Machines\n  \"Machines with the values of fmu tune, for the parameter machine of a drive\"\n  \
         extends Modelica.Icons.RecordsPackage;\n\n  record Values\n    \"Start values of the FMU\"\n    extends Modelica.Icons.Record;\n"
    );
    let fields: Vec<&Variable> =
        interface.inputs.iter().chain(&interface.parameters).filter(|v| set.contains(&v.fmi)).collect();
    for v in &fields {
        let (tab, group) = dialog(&v.fmi);
        let annotation = format!("Dialog(tab=\"{tab}\", group=\"{group}\")");
        let line = declare(&v.head(), &v.name, &v.modifiers(), &v.start(), &v.about, &annotation);
        for line in line.lines() {
            out += "  ";
            out += line;
            out += "\n";
        }
    }
    out += "  end Values;\n";
    for Machine { name, about, values } in machines {
        let modifiers: Vec<String> = fields
            .iter()
            .filter_map(|v| values.iter().find(|(name, _)| *name == v.fmi).map(|(_, value)| (*v, value)))
            .map(|(v, value)| Ok(format!("{}={}", v.name, literal(v, value)?)))
            .collect::<Result<_>>()
            .with_context(|| name.clone())?;
        let _ = write!(
            out,
            "\n  record {name}\n    \"{}\"\n    extends Values(\n      {});\n  end {name};\n",
            html(about),
            modifiers.join(",\n      ")
        );
    }
    Ok(out + "end Machines;\n")
}

/// A value in Modelica notation.
fn literal(v: &Variable, value: &Value) -> Result<String> {
    let fits = match (value, &v.kind) {
        (Value::Reals(all), Kind::Real { .. }) => v.is_array && all.len() == v.start.len(),
        (Value::Real(_), Kind::Real { .. })
        | (Value::Integer(_), Kind::Integer)
        | (Value::Boolean(_), Kind::Boolean) => !v.is_array,
        (Value::Item(item), Kind::Enumeration { items, .. }) => items.iter().any(|(_, name)| name == item),
        _ => false,
    };
    ensure!(fits, "{} = {value:?} does not fit the variable of the FMU", v.fmi);
    Ok(match (value, &v.kind) {
        (Value::Item(item), Kind::Enumeration { of, .. }) => format!("Types.{of}.{item}"),
        (Value::Real(x), _) => format!("{x:?}"),
        (Value::Reals(all), _) => {
            format!("{{{}}}", all.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(", "))
        }
        (Value::Integer(x), _) => x.to_string(),
        (Value::Boolean(x), _) => x.to_string(),
        (Value::Item(item), _) => item.clone(),
    })
}
