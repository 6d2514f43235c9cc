//! `fmu info`: summary of an FMU, in half a page.

use anyhow::Result;
use clap::Args;
use fmu_import::platform::Platform;
use fmu_import::{Outline, machine, printable};
use model_description::{BaseType, Causality, Dimension, Interface, ModelDescription, ModelVariable, Variability};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Describes an FMU: standard, interfaces, platforms, size, terminals, and its variables by group.
///
/// The command only reads the archive; it does not run the FMU.
///
/// The inputs, outputs and parameters of the drive, with units and start values:
///   fmu info target/fmu/fmi3/PmsmDrive.fmu
/// Only those whose name contains `limit`:
///   fmu info target/fmu/fmi3/PmsmDrive.fmu limit
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Info {
    /// FMU of FMI 2.0 or FMI 3.0
    #[arg(value_name = "FILE.fmu")]
    pub file: PathBuf,
    /// Show only variables whose name contains this
    #[arg(value_name = "PART")]
    pub part: Option<String>,
}

/// Runs the command and returns the text.
///
/// # Errors
/// The file is not an FMU.
pub fn run(args: &Info) -> Result<String> {
    let outline = fmu_import::outline(&args.file)?;
    let md = &outline.description;
    let size = std::fs::metadata(&args.file)?.len();
    let mut lines = Vec::new();
    if args.part.is_none() {
        lines.extend(head(&outline, size));
    }
    let part = args.part.as_deref().unwrap_or_default().to_lowercase();
    for (group, belongs) in GROUPS {
        let variables: Vec<&ModelVariable> =
            md.variables.iter().filter(|v| belongs(v) && v.name.to_lowercase().contains(&part)).collect();
        if variables.is_empty() {
            continue;
        }
        lines.push(format!("{}{group} ({})", if lines.is_empty() { "" } else { "\n" }, variables.len()));
        let width = variables.iter().map(|v| name(v).chars().count()).max().unwrap_or(0).min(40);
        lines.extend(variables.iter().map(|v| row(v, md, width)));
    }
    if lines.is_empty() {
        lines.push(format!("no variable of {} has {part} in its name", md.model_name));
    }
    Ok(lines.iter().map(|line| line.split('\n').map(printable).collect::<Vec<_>>().join("\n") + "\n").collect())
}

/// Whether a variable belongs to a group.
type Belongs = fn(&ModelVariable) -> bool;

/// Groups of variables, in the order of their use.
const GROUPS: [(&str, Belongs); 5] = [
    ("inputs", |v| v.causality == Causality::Input),
    ("outputs", |v| v.causality == Causality::Output),
    ("tunable parameters", |v| is_parameter(v) && v.variability == Variability::Tunable),
    ("parameters", |v| is_parameter(v) && v.variability != Variability::Tunable),
    ("local variables", |v| !matches!(v.causality, Causality::Input | Causality::Output) && !is_parameter(v)),
];

fn is_parameter(v: &ModelVariable) -> bool {
    matches!(v.causality, Causality::Parameter | Causality::StructuralParameter)
}

fn head(Outline { description: md, terminals, files, .. }: &Outline, size: u64) -> Vec<String> {
    let mut lines = vec![format!("{}: {}", md.model_name, md.description.as_deref().unwrap_or("(no description)"))];
    let mut line = |name: &str, text: String| lines.push(format!("  {name:<12} {text}"));
    let interface = |name: &str, of: &Option<Interface>| of.as_ref().map(|_| name.to_owned());
    let interfaces = [interface("Co-Simulation", &md.co_simulation), interface("Model Exchange", &md.model_exchange)];
    let interfaces: Vec<String> = interfaces.into_iter().flatten().collect();
    line("standard", format!("FMI {}; {}", md.version, interfaces.join(" and ")));
    // The names of FMI 2.0 do not identify the processor.
    let folder = |(name, bytes): (&String, &Vec<u8>)| {
        let (folder, _) = name.strip_prefix("binaries/")?.split_once('/')?;
        let platforms: Vec<&str> = machine::platforms(bytes).into_iter().map(Platform::tuple).collect();
        let known = platforms.is_empty() || platforms == [folder];
        Some(if known { folder.to_owned() } else { format!("{folder} ({})", platforms.join(" and ")) })
    };
    let platforms: BTreeSet<String> = files.iter().filter_map(folder).collect();
    let sources = files.keys().any(|name| name.starts_with("sources/")).then(|| "sources".to_owned());
    line("platforms", platforms.into_iter().chain(sources).collect::<Vec<_>>().join(", "));
    let by = [("version", &md.model_version), ("by", &md.author), ("license", &md.license)];
    for (name, value) in by {
        if let Some(value) = value {
            line(name, value.clone());
        }
    }
    line("size", format!("{} kB", size.div_ceil(1000)));
    let experiment = &md.default_experiment;
    let time = |name: &str, x: Option<f64>| x.map(|x| format!("{name} {x} s"));
    let times = [time("start", experiment.start), time("stop", experiment.stop), time("step", experiment.step)];
    let times: Vec<String> = times.into_iter().flatten().collect();
    if !times.is_empty() {
        line("experiment", times.join(", "));
    }
    let terminals: Vec<&str> = terminals.iter().flat_map(|t| &t.terminals).map(|t| t.name.as_str()).collect();
    if !terminals.is_empty() {
        line("terminals", terminals.join(", "));
    }
    lines
}

/// Name, with the extents of an array.
fn name(v: &ModelVariable) -> String {
    let extent = |dimension: &Dimension| match dimension {
        Dimension::Fixed(n) => n.to_string(),
        Dimension::Variable(reference) => format!("#{reference}"),
    };
    let extents: Vec<String> = v.dimensions.iter().map(extent).collect();
    if v.is_array() { format!("{}[{}]", v.name, extents.join(",")) } else { v.name.clone() }
}

/// Name, start value with its unit, description.
fn row(v: &ModelVariable, md: &ModelDescription, width: usize) -> String {
    let mut value = v.start.clone().unwrap_or_default();
    if v.is_array() && value.len() > 24 {
        value = "(array)".into();
    }
    if v.base == BaseType::String && v.start.is_some() {
        value = format!("{value:?}");
    }
    let definition = v.declared_type.as_ref().and_then(|t| md.type_definition(t));
    let named = definition.and_then(|d| d.items.iter().find(|i| Ok(i.value) == value.parse()));
    if let Some(item) = named {
        value.clone_from(&item.name);
    }
    let unit = v.unit.as_deref().map(|unit| if value.is_empty() { format!("in {unit}") } else { format!(" {unit}") });
    format!(
        "  {:<width$}  {:<16} {}",
        name(v),
        value + &unit.unwrap_or_default(),
        v.description.as_deref().unwrap_or_default()
    )
}
