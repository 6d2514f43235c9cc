//! What a machine presets: the values of `fmu tune`, and the inputs of its reference result.

use crate::commands::tune::place;
use crate::preset::Preset;
use anyhow::{Result, bail};
use drive_study::tune::{
    joined,
    rules::{Setting, Tuned, Value},
};
use fmu_core::Description;

/// Sets the values of the machine that the FMU has: all of them, because the FMU may be a preset for another machine.
///
/// # Errors
/// The FMU is none of the drive.
pub(super) fn set(preset: &mut Preset, tuned: &Tuned) -> Result<()> {
    let named = |settings: &[Setting]| settings.iter().map(|s| (s.name.to_owned(), s.value.clone())).collect();
    let values: Vec<(String, Value)> = match place(preset.own())? {
        Some(0) => joined(&tuned.plant, &tuned.controller),
        Some(1) => named(&tuned.plant),
        Some(2) => named(&tuned.controller),
        _ => bail!(
            "{}: a machine is for PmsmDrive, PmsmPlant and SensorlessController as this program builds them; \
             --set and --ssv are for every FMU",
            preset.own().name
        ),
    };
    for (name, value) in values {
        let text = match value {
            Value::Real(x) => format!("{x:?}"),
            Value::Integer(x) => x.to_string(),
            Value::Boolean(x) => x.to_string(),
            Value::Item(item) => item,
        };
        preset.set(&name, &text, None)?;
    }
    Ok(())
}

/// The inputs of the default experiment for this machine: at rest until the rotor has aligned itself, then half of the rated
/// speed, and 0.5 s later half of the rated torque. Alone, the plant gets a tenth of that torque and a third of the voltage
/// that drives its largest current at standstill, the controller a tenth of the speed and an eighth of its largest current.
pub(super) fn stimuli(own: &Description, tuned: &Tuned) -> String {
    let of = |settings: &[Setting], wanted: &str| {
        settings.iter().find_map(|s| match s.value {
            Value::Real(x) if s.name == wanted => Some(x),
            _ => None,
        })
    };
    let (w, tau) = (tuned.speed, tuned.torque);
    let i = of(&tuned.controller, "limit.i").unwrap_or(1.0);
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
    let (first, stop, step) = (tuned.rest.max(0.1), own.experiment.stop, own.experiment.step);
    let at = |change: f64| (change / step).round() * step;
    let times = [(0.0, 0), (at(first), 0), (at(first) + step, 1), (at(first + 0.5), 1), (at(first + 0.5) + step, 2)];
    let last = times.iter().rev().find(|(t, _)| *t < stop).map_or(0, |(_, which)| *which);
    let head = columns.iter().map(|(name, ..)| format!("\"{name}\""));
    let mut lines = vec![std::iter::once("\"time\"".to_owned()).chain(head).collect::<Vec<_>>()];
    for (t, which) in times.into_iter().filter(|(t, _)| *t < stop).chain([(stop, last)]) {
        let value = |(_, one, two): &(&str, f64, f64)| [0.0, *one, *two][which].to_string();
        lines.push(std::iter::once(t.to_string()).chain(columns.iter().map(value)).collect());
    }
    lines.into_iter().map(|line| line.join(",") + "\n").collect()
}
