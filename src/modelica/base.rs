//! `Base.mo`: the imported block with parameters in a dialog, connectors for its inputs, ports of DC link and heat.

use super::interface::{Heat, Interface, Kind, Variable};
use super::text::{declare, html};
use anyhow::{Result, bail};
use model_description::Area;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Prefix of the groups of the estimators: in a common tab, they would bury the controller's other groups.
pub(super) const ESTIMATORS: [&str; 14] = [
    "adaptation",
    "carrier",
    "emf",
    "flux_observer",
    "gradient",
    "hybrid",
    "kalman",
    "matsui",
    "near_pwm",
    "pulsating",
    "rasmussen",
    "sliding_mode",
    "square_wave",
    "tracker",
];

/// Tab and group of a parameter: the parts of its name before the last.
pub(super) fn dialog(fmi: &str) -> (String, String) {
    let parts: Vec<&str> = fmi.split('.').collect();
    let (tab, group) = match parts.as_slice() {
        [] | [_] => ("General", "Parameters"),
        [group, _] if ESTIMATORS.contains(group) => ("Estimators", *group),
        [tab @ ("plant" | "controller"), _] => (*tab, "general"),
        [group, _] => ("Parameters", *group),
        [_, group, ..] if ESTIMATORS.contains(group) => ("Estimators", *group),
        [tab, group, ..] => (*tab, *group),
    };
    let mut letters = tab.chars();
    let tab = letters.next().map(|c| c.to_ascii_uppercase()).into_iter().chain(letters).collect();
    (tab, group.replace('_', " "))
}

/// `Placement` of a connector.
fn placement(Area { x1, y1, x2, y2 }: Area) -> String {
    format!("Placement(transformation(extent={{{{{x1},{y1}}},{{{x2},{y2}}}}}))")
}

fn around(x: f64, y: f64, half: f64) -> Area {
    Area { x1: x - half, y1: y - half, x2: x + half, y2: y + half }
}

/// Positions from top to bottom along an edge.
fn column(count: usize) -> impl Iterator<Item = f64> {
    let rows = u32::try_from(count).unwrap_or(u32::MAX);
    let pitch = 160.0 / f64::from(rows.max(2) - 1);
    (0..rows).map(move |i| if rows == 1 { 60.0 } else { (80.0 - pitch * f64::from(i)).round() })
}

/// The connector of an input.
fn port(v: &Variable) -> Result<&'static str> {
    match v.kind {
        _ if v.is_array => bail!("{}: an input that is an array has no connector", v.fmi),
        Kind::Real { .. } => Ok("RealInput"),
        Kind::Integer => Ok("IntegerInput"),
        Kind::Boolean => Ok("BooleanInput"),
        Kind::Text | Kind::Enumeration { .. } => bail!("{}: an input of this type has no connector", v.fmi),
    }
}

/// A switch between a constant and a connector or port.
fn switch(name: &str, about: &str, group: &str) -> String {
    let annotation = format!("Evaluate=true, HideResult=true, choices(checkBox=true), Dialog(group=\"{group}\")");
    declare("parameter Boolean", &format!("use_{name}"), &[], "false", about, &annotation)
}

/// The assertion that an enumeration has the value of the FMU.
fn unchanged(v: &Variable) -> String {
    let (start, fmi) = (v.start(), &v.fmi);
    let item = start.rsplit('.').next().unwrap_or(&start);
    format!(
        "  assert({} == {start},\n    \"{fmi} of the FMU is {item}, and no enumeration is sent to it. For another value: \
         fmu preset FILE.fmu --set {fmi}=VALUE --out NEW.fmu, then import NEW.fmu and write this package again\");\n",
        v.name
    )
}

/// The value of an unconnected input: its start value, or the machine's.
fn constant(v: &Variable, group: &str, disabled_by: &str, machine: &BTreeSet<String>) -> String {
    let value = if machine.contains(&v.fmi) { format!("machine.{}", v.name) } else { v.start() };
    let annotation = format!("Dialog(group=\"{group}\", enable=not use_{disabled_by})");
    let head = format!("parameter {}", v.head());
    declare(&head, &format!("{}_constant", v.name), &v.modifiers(), &value, &v.about, &annotation)
}

/// The text of the file. `machine` has the variables that a record of `Machines` sets.
///
/// # Errors
/// An input has a type without a connector; two declarations would have one name.
pub(super) fn text(package: &str, about: &str, interface: &Interface, machine: &BTreeSet<String>) -> Result<String> {
    let mut out = format!("within {package};\npartial model Base\n  \"{}\"\n", html(about));
    let mut equations = String::new();
    let mut inside = String::new();
    if !machine.is_empty() {
        let annotation = "choicesAllMatching=true, Dialog(group=\"Machine\")";
        out += &declare(
            "parameter Machines.Values",
            "machine",
            &[],
            "Machines.Values()",
            "Values of a machine and its controller",
            annotation,
        );
    }
    let signals: Vec<&Variable> = interface.signals().collect();
    for v in &signals {
        out += &switch(&v.name, &format!("Connector {} instead of a constant", v.name), "Inputs");
        out += &constant(v, "Inputs", &v.name, machine);
    }
    if let Some((u, ..)) = &interface.link {
        out += &switch("dc_link", "Pins of the DC link instead of a constant voltage", "DC link");
        out += &interface.input(u).map(|v| constant(v, "DC link", "dc_link", machine)).unwrap_or_default();
    }
    for Heat { name, temperature, .. } in &interface.heats {
        out += &switch(name, "Heat port instead of a constant temperature", "Heat");
        out += &interface.input(temperature).map(|v| constant(v, "Heat", name, machine)).unwrap_or_default();
    }
    let flag = interface.imposed.as_ref().map(|(_, flag, _)| flag.as_str());
    for v in &interface.parameters {
        if flag == Some(&v.name) {
            out += &declare("parameter Boolean", &v.name, &[], "", &v.about, "Dialog(enable=false)");
            continue;
        }
        let value = if machine.contains(&v.fmi) { format!("machine.{}", v.name) } else { v.start() };
        let (tab, group) = dialog(&v.fmi);
        let head = format!("parameter {}", v.head());
        let annotation = format!("Dialog(tab=\"{tab}\", group=\"{group}\")");
        out += &declare(&head, &v.name, &v.modifiers(), &value, &v.about, &annotation);
        if let Kind::Enumeration { .. } = v.kind {
            equations += &unchanged(v);
        }
    }
    for (v, y) in signals.iter().zip(column(signals.len())) {
        let connector = port(v)?;
        let units: Vec<String> = v.modifiers().into_iter().filter(|m| m.starts_with("unit")).collect();
        let head = format!("Modelica.Blocks.Interfaces.{connector}");
        let name = &v.name;
        let conditional = if units.is_empty() { String::new() } else { format!("({})", units.join(", ")) };
        out += &declare(
            &head,
            &format!("{name}{conditional} if use_{name}"),
            &[],
            "",
            &v.about,
            &placement(around(-120.0, y, 12.0)),
        );
        let sink = head.replace("Input", "Output");
        inside += &declare(
            &sink,
            &format!("{name}_internal"),
            &[],
            "",
            "The connector, or the constant if there is none",
            "",
        );
        let _ = writeln!(equations, "  connect({name}, {name}_internal);");
        let _ = writeln!(equations, "  if not use_{name} then\n    {name}_internal = {name}_constant;\n  end if;");
        let _ = writeln!(equations, "  fmu.{name} = {name}_internal;");
    }
    if let Some((u, i, area)) = &interface.link {
        let Area { x1, y1, x2, y2 } = area.unwrap_or(around(0.0, 100.0, 10.0));
        let (x, y) = (f64::midpoint(x1, x2), f64::midpoint(y1, y2));
        for (pin, class, sign, at, what) in
            [("p", "Positive", "", x - 40.0, "Positive"), ("n", "Negative", "-", x + 40.0, "Negative")]
        {
            let head = format!("Modelica.Electrical.Analog.Interfaces.{class}Pin");
            let name = format!("dc_{pin}(final v=v_{pin}, final i={sign}fmu.{i}) if use_dc_link");
            let about = format!("{what} pin of the DC link");
            out += &declare(&head, &name, &[], "", &about, &placement(around(at, y, 10.0)));
            inside +=
                &declare("Real", &format!("v_{pin}"), &["unit=\"V\"".into()], "", &format!("{what} potential"), "");
        }
        let _ = writeln!(equations, "  if not use_dc_link then\n    v_p = {u}_constant;\n    v_n = 0;\n  end if;");
        let _ = writeln!(equations, "  fmu.{u} = v_p - v_n;");
    }
    for Heat { name, about, temperature: t, flow: heat, area } in &interface.heats {
        let head = "Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_a";
        // Heat is positive out of the FMU, and Q_flow into it.
        let port = format!("{name}(final T=fmu.{t}, final Q_flow=-fmu.{heat}) if use_{name}");
        out += &declare(head, &port, &[], "", about, &placement(area.unwrap_or(around(0.0, -100.0, 10.0))));
        let _ = writeln!(equations, "  if not use_{name} then\n    fmu.{t} = {t}_constant;\n  end if;");
    }
    out += &outputs(interface);
    out += &block(interface);
    if !inside.is_empty() {
        let _ = write!(out, "protected\n{inside}");
    }
    let _ = write!(out, "equation\n{equations}  annotation(Icon(graphics={{{}}}));\nend Base;\n", icon(package));
    unique(&out)?;
    Ok(out)
}

/// The picture of the FMU, and the name of the component.
pub(super) fn icon(package: &str) -> String {
    format!(
        "\n    Bitmap(extent={{{{-100,-100}},{{100,100}}}}, fileName=\"modelica://{package}/Resources/Images/icon.png\"),\n    \
         Text(extent={{{{-150,150}},{{150,110}}}}, textColor={{0,0,255}}, textString=\"%name\")"
    )
}

/// Outputs with their units; those that a terminal sends have connectors.
fn outputs(interface: &Interface) -> String {
    let mut out = String::new();
    let sent = interface.outputs.iter().filter(|v| interface.sent.contains(&v.name) && !v.is_array);
    let sent: Vec<&str> = sent.map(|v| v.name.as_str()).collect();
    // Below each other, without the middle, where the flange is.
    let row = |i: u32| f64::from(if i < 3 { 80 } else { 20 }) - 20.0 * f64::from(i);
    let rows: Vec<(&&str, f64)> = sent.iter().zip((0..).map(row)).collect();
    // The type of an enumeration belongs to the block: read it there, as fmu.tripped.
    for v in interface.outputs.iter().filter(|v| !matches!(v.kind, Kind::Enumeration { .. })) {
        let units: Vec<String> = v.modifiers().into_iter().filter(|m| !m.starts_with('m')).collect();
        let value = match &v.kind {
            _ if v.is_array && !v.elements.is_empty() => {
                format!("{{{}}}", v.elements.iter().map(|e| format!("fmu.{e}")).collect::<Vec<_>>().join(", "))
            }
            _ => format!("fmu.{}", v.name),
        };
        let (head, at) = match (&v.kind, rows.iter().find(|(name, _)| **name == v.name)) {
            (Kind::Real { .. }, Some((_, y))) => {
                ("Modelica.Blocks.Interfaces.RealOutput".into(), placement(around(110.0, *y, 10.0)))
            }
            (Kind::Boolean, Some((_, y))) => {
                ("Modelica.Blocks.Interfaces.BooleanOutput".into(), placement(around(110.0, *y, 10.0)))
            }
            _ => (v.head(), String::new()),
        };
        out += &declare(&head, &v.name, &units, &value, &v.about, &at);
    }
    out
}

/// The imported block with its parameters.
fn block(interface: &Interface) -> String {
    let mut modifiers = Vec::new();
    for v in interface.parameters.iter().filter(|v| !matches!(v.kind, Kind::Enumeration { .. })) {
        let elements = v.elements.iter().zip(1..).map(|(element, i)| format!("final {element}={}[{i}]", v.name));
        modifiers.extend(elements);
        if v.elements.is_empty() {
            modifiers.push(format!("final {0}={0}", v.name));
        }
    }
    format!("  Block fmu(\n    {})\n    \"The imported FMU\";\n", modifiers.join(",\n    "))
}

/// Checks that every name is declared once.
fn unique(text: &str) -> Result<()> {
    let mut names = BTreeSet::new();
    let declared = text.lines().take_while(|line| *line != "equation").filter_map(|line| {
        let line = line.strip_prefix("  ").filter(|l| !l.starts_with([' ', '"']))?;
        let line = line.strip_prefix("parameter ").unwrap_or(line);
        let name = line.split_once(' ')?.1;
        Some(&name[..name.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(name.len())])
    });
    for name in declared {
        if !names.insert(name) {
            bail!("two declarations of the package would be named {name}");
        }
    }
    Ok(())
}
