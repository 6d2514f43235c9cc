//! The preset of a machine: the values of `fmu tune`, and the inputs of its reference result.

use crate::commands::tune::place;
use anyhow::{Result, bail};
use cargo_fmu::message;
use drive::MappedDrive;
use drive_tools::datasheet::MappedSheet;
use drive_tools::tune::{
    joined,
    setting::{Setting, Tuned, Value},
};
use fmu_core::{Description, Model};
use fmu_pack::preset::{NewExperiment, PresetFmu};
use std::fmt::Write as _;

/// Sets the values of the machine, even those that equal the model's start values, because the FMU may be a preset for another
/// machine. A note lists the values of that machine that remain. Returns the default experiment.
///
/// # Errors
/// The FMU is not one of the drive's.
pub(super) fn set(preset: &mut PresetFmu, tuned: &Tuned) -> Result<NewExperiment> {
    let named = |settings: &[Setting]| settings.iter().map(|s| (s.name.to_owned(), s.value.clone())).collect();
    let values: Vec<(String, Value)> = match place(preset.own())? {
        Some(0) => joined(&tuned.plant, &tuned.controller),
        Some(1) => named(&tuned.plant),
        Some(2) => named(&tuned.controller),
        _ => bail!(
            "{}: a machine is for PmsmDrive, PmsmDriveMean, PmsmPlant and SensorlessController as this program builds them; \
             --set and --ssv are for every FMU",
            preset.own().name
        ),
    };
    for (name, value) in values {
        preset.set(&name, &text(&value), None)?;
    }
    let stay = preset.earlier().join(", ");
    if !stay.is_empty() {
        message::note(&format!("values of the earlier preset that {} does not have remain: {stay}", tuned.name));
    }
    Ok(course(preset.own(), tuned))
}

/// A value as `--set` takes it.
fn text(value: &Value) -> String {
    match value {
        Value::Real(x) => format!("{x:?}"),
        Value::Reals(all) => all.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(","),
        Value::Integer(x) => x.to_string(),
        Value::Boolean(x) => x.to_string(),
        Value::Item(item) => item.clone(),
    }
}

/// Sets the values of a data sheet. Returns the default experiment: half of the maximum speed, then half of the continuous torque
/// there.
///
/// # Errors
/// The FMU is not `MappedDrive`.
pub(super) fn set_sheet(preset: &mut PresetFmu, sheet: &MappedSheet) -> Result<NewExperiment> {
    if preset.own().name != MappedDrive::INFO.name {
        bail!("{}: a data sheet is for MappedDrive", preset.own().name);
    }
    for (name, value) in sheet.values() {
        preset.set(name, &text(&value), None)?;
    }
    let half = 0.5 * sheet.map.last();
    let torque = 0.5 * sheet.map.tau_continuous.iter().copied().fold(f64::INFINITY, f64::min);
    let tenths = |t: f64| (10.0 * t).ceil() / 10.0;
    let reached = tenths((0.5 + 2.0 * sheet.J * half / (2.0 * torque).max(1e-9)).min(60.0));
    let stop = reached + 1.0;
    let edge = preset.own().experiment.step;
    let rows = [
        (0.0, 0.0, 0.0),
        (0.1, 0.0, 0.0),
        (0.1 + edge, half, 0.0),
        (reached, half, 0.0),
        (reached + edge, half, torque),
    ];
    let mut stimuli = String::from("\"time\",\"speed_ref\",\"tau_load\"\n");
    for (time, speed, load) in rows.into_iter().chain([(stop, half, torque)]) {
        let _ = writeln!(stimuli, "{time},{speed},{load}");
    }
    Ok(NewExperiment { stimuli, stop, step: None })
}

/// The default experiment for this machine. The drive stays at rest until the rotor has aligned itself, then turns at half of
/// the rated speed, and then takes half of the rated torque, after the I-f start, if any. The plant alone gets a tenth
/// of that torque and a third of the voltage for its maximum current at standstill; the controller alone gets a tenth of the
/// speed and an eighth of its maximum current.
fn course(own: &Description, tuned: &Tuned) -> NewExperiment {
    let of = |settings: &[Setting], wanted: &str| {
        settings.iter().find_map(|s| match s.value {
            Value::Real(x) if s.name == wanted => Some(x),
            _ => None,
        })
    };
    let controller = |name| of(&tuned.controller, name);
    let (w, tau, i) = (tuned.speed, tuned.torque, controller("limit.i").unwrap_or(1.0));
    let u = of(&tuned.plant, "motor.R_s").unwrap_or(1.0) * i / 3.0;
    // The columns with their values after the first and after the second change.
    let columns: &[(&str, f64, f64)] = match own.name.as_str() {
        "PmsmPlant" => {
            &[("u_a", -0.5 * u, -0.5 * u), ("u_b", u, u), ("u_c", -0.5 * u, -0.5 * u), ("tau_load", 0.0, 0.1 * tau)]
        }
        "SensorlessController" => {
            &[("speed_ref", 0.1 * w, 0.1 * w), ("i_a", 0.0, i / 8.0), ("i_b", 0.0, -i / 16.0), ("i_c", 0.0, -i / 16.0)]
        }
        _ => &[("speed_ref", 0.5 * w, 0.5 * w), ("tau_load", 0.0, 0.5 * tau)],
    };
    // The I-f start: two alignments, the ramp to start.speed, the time there.
    let start = ["start.t_align", "start.speed", "start.acceleration", "start.settle"].map(controller);
    let start = if let [Some(align), Some(speed), Some(acceleration), Some(settle)] = start {
        2.0 * align + speed / acceleration + settle
    } else {
        0.0
    };
    let tenths = |t: f64| (10.0 * t).ceil() / 10.0;
    let settles = (12.0 / controller("speed_loop.bandwidth").unwrap_or(80.0)).clamp(0.4, 10.0);
    let first = tenths(tuned.rest.clamp(0.1, 10.0));
    let second = tenths(first + start.min(10.0) + settles);
    let stop = tenths(second + settles).max(1.0);
    let step = controller("T_s").filter(|t_s| *t_s < own.experiment.step && own.name == "SensorlessController");
    let edge = step.unwrap_or(own.experiment.step);
    let times = [(0.0, 0), (first, 0), (first + edge, 1), (second, 1), (second + edge, 2), (stop, 2)];
    let head = columns.iter().map(|(name, ..)| format!("\"{name}\""));
    let mut lines = vec![std::iter::once("\"time\"".to_owned()).chain(head).collect::<Vec<_>>()];
    for (t, which) in times {
        let value = |(_, one, two): &(&str, f64, f64)| [0.0, *one, *two][which].to_string();
        lines.push(std::iter::once(t.to_string()).chain(columns.iter().map(value)).collect());
    }
    NewExperiment { stimuli: lines.into_iter().map(|line| line.join(",") + "\n").collect(), stop, step }
}
