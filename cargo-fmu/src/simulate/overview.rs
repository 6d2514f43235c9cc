//! The default plot of a run: speed, torque, currents, angle error and power of any drive with these names.

use fmu_core::digits;
use fmu_plot::figure::{Curve, Figure};
use fmu_system::cosimulation::{Column, Recording};
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// Panels, each with its variables, without the names of their instances.
const PANELS: [&[&str]; 4] = [
    &["speed", "speed_ref", "speed_est"],
    &["tau_e", "tau_load", "tau_ref"],
    &["i_d", "i_q", "i_d_ref", "i_q_ref"],
    &["p_in", "p_mech", "p_loss"],
];

/// Inputs that the default plot shows if they are fed.
pub(super) const INPUTS: [&str; 3] = ["speed_ref", "tau_load", "tau_ref"];

/// Maximum number of panels, and of curves in a panel, for a run with none of these names.
const MOST: (usize, usize) = (5, 6);

/// The columns of the default plot, with the angle error if there are `theta_est` and `theta_e`.
pub(super) fn overview(recording: &Recording) -> Recording {
    let named = |name: &&str| recording.columns.iter().find(|c| last(&c.name) == *name);
    let mut columns: Vec<Column> = PANELS.concat().iter().filter_map(named).cloned().collect();
    if let (Some(estimate), Some(rotor)) = (named(&"theta_est"), named(&"theta_e")) {
        let values = estimate.values.iter().zip(&rotor.values).map(|(a, b)| wrap(a - b)).collect();
        columns.push(Column { name: "theta_est - theta_e".into(), values, exact: Vec::new(), ..rotor.clone() });
    }
    if columns.is_empty() {
        let mut panels: Vec<(&str, usize)> = Vec::new();
        for column in &recording.columns {
            let full = panels.len() >= MOST.0;
            match panels.iter_mut().find(|(unit, _)| *unit == column.shown_unit()) {
                Some((_, count)) if *count >= MOST.1 => continue,
                Some((_, count)) => *count += 1,
                None if full => continue,
                None => panels.push((column.shown_unit(), 1)),
            }
            columns.push(column.clone());
        }
    }
    Recording { columns, time: recording.time.clone(), ended_by: recording.ended_by.clone(), ..Recording::default() }
}

/// The last values of the default plot: a line per panel, in its unit.
pub(super) fn at_the_end(figure: &Figure) -> String {
    let time = figure.panels.first().map_or(f64::NAN, |panel| panel.window.1);
    let mut text = format!("at {} s:", four(time));
    for panel in &figure.panels {
        let unit = if panel.unit == "no unit" { String::new() } else { format!(" {}", panel.unit) };
        let value =
            |curve: &Curve| format!("{} {}{unit}", curve.name, four(curve.y.last().copied().unwrap_or(f64::NAN)));
        let values: Vec<String> = panel.curves.iter().map(value).collect();
        let _ = write!(text, "\n  {}", values.join(", "));
    }
    text
}

/// An angle within half a turn.
fn wrap(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// A number with four digits.
fn four(x: f64) -> String {
    digits::text(x, 4, 1e6)
}

/// The name of a variable without the name of its instance.
pub(super) fn last(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::super::curves;
    use super::*;

    fn recording(names: &[(&str, &str)]) -> Recording {
        let column = |(name, unit): &(&str, &str)| Column {
            name: (*name).into(),
            unit: (*unit).into(),
            values: vec![0.0, 3.0],
            ..Column::default()
        };
        Recording { time: vec![0.0, 1.0], columns: names.iter().map(column).collect(), ..Recording::default() }
    }

    fn shown(names: &[(&str, &str)]) -> Vec<String> {
        overview(&recording(names)).columns.into_iter().map(|c| c.name).collect()
    }

    #[test]
    fn a_drive_shows_what_matters() {
        let names =
            [("p.i_a", "A"), ("p.i_q", "A"), ("p.speed", "rad/s"), ("p.theta_e", "rad"), ("c.theta_est", "rad")];
        assert_eq!(shown(&names), ["p.speed", "p.i_q", "theta_est - theta_e"]);
        let mut turned = recording(&names);
        turned.columns[4].values = vec![0.1, -3.2];
        let error = overview(&turned).columns.pop().unwrap();
        assert!((error.values[1] - (TAU - 6.2)).abs() < 1e-12, "wrapped: {error:?}");
    }

    #[test]
    fn the_end_is_a_line_per_panel() {
        let mut run = recording(&[("d.speed", "rad/s"), ("d.speed_est", "rad/s"), ("d.tau_e", "N.m")]);
        run.columns[1].values[1] = 2.999_96;
        let figure = curves::figure(&[("", &overview(&run))]);
        assert_eq!(at_the_end(&figure), "at 1 s:\n  d.speed 3 rad/s, d.speed_est 3 rad/s\n  d.tau_e 3 N.m");
    }

    #[test]
    fn another_model_shows_the_first_of_each_unit() {
        let names: Vec<String> = (0..9).map(|k| format!("x{k}")).collect();
        let mut all: Vec<(&str, &str)> = names.iter().map(|name| (name.as_str(), "m")).collect();
        all.extend([("a", "A"), ("b", "V"), ("c", "W"), ("d", "K"), ("e", "J")]);
        assert_eq!(shown(&all), ["x0", "x1", "x2", "x3", "x4", "x5", "a", "b", "c", "d"]);
    }
}
