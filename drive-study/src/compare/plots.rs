//! Plots over time: speed and angle error of all estimators in one plot per scenario and, for each estimator that
//! injects a voltage, the carrier current and the angle found in it (Fig. 8 and 11 of the review).

use super::run::Run;
use crate::ink;
use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::ink::{CURVES, REFERENCE};
use std::rc::Rc;

/// A plot and its name.
#[derive(Debug)]
pub struct Plot {
    /// File name without extension.
    pub name: String,
    /// What it shows.
    pub figure: Figure,
}

/// All plots of the runs.
pub fn all(cells: &[Run]) -> Vec<Plot> {
    let mut plots = Vec::new();
    for id in ["ramp", "reversal", "load", "load-0", "load-0.1", "load-0.5", "load-1", "weakening"] {
        let with_trace: Vec<&Run> = cells.iter().filter(|c| c.scenario.id == id && c.trace().is_some()).collect();
        if !with_trace.is_empty() {
            plots.push(together(id, &with_trace));
        }
    }
    plots.extend(cells.iter().filter(|c| c.scenario.id == "signal-trace").flat_map(signal));
    plots
}

fn panel(unit: &str, time: &[f64], curves: Vec<Curve>) -> Panel {
    let window = (time.first().copied().unwrap_or_default(), time.last().copied().unwrap_or_default());
    Panel { unit: unit.into(), window, curves, ..Panel::default() }
}

/// All estimators in a scenario, each until it loses the rotor.
fn together(id: &str, cells: &[&Run]) -> Plot {
    let (mut time, mut speeds, mut errors): (Rc<[f64]>, _, _) = (Rc::from([]), Vec::new(), Vec::new());
    let traces = || cells.iter().filter_map(|cell| Some((&cell.entry, cell.trace()?)));
    for (_, trace) in traces().filter(|(_, trace)| !trace.t.is_empty()) {
        if trace.t.len() > time.len() {
            time = trace.t.as_slice().into();
        }
    }
    for (entry, trace) in traces() {
        let end = trace.lost.map_or(trace.t.len(), |lost| trace.t.partition_point(|t| *t <= lost));
        let curve = |values: &[f64]| Curve {
            dashed: entry.name != entry.kind.name(),
            lost: trace.lost.is_some(),
            ..Curve::new(entry.label(), ink::of(entry.kind), &time, values[..end].to_vec())
        };
        speeds.push(curve(&trace.speed));
        errors.push(curve(&trace.error));
    }
    let panels = vec![panel("speed in pu", &time, speeds), panel("theta - theta^ in deg", &time, errors)];
    Plot {
        name: id.into(),
        figure: Figure { title: cells[0].scenario.title.into(), x: "time in s", columns: 1, panels },
    }
}

/// Fig. 8 and 11: the carrier current over six milliseconds, and the angle found in it.
fn signal(cell: &Run) -> Vec<Plot> {
    let Some(trace) = cell.trace() else { return Vec::new() };
    let name = cell.entry.name;
    let review = match name {
        "RotatingInjection" => "Fig. 8 of the review, ",
        "PulsatingInjection" => "Fig. 11 of the review, ",
        _ => "",
    };
    let index = |t: f64| trace.t.partition_point(|x| *x < t);
    let (from, to) = (index(0.3), index(0.306));
    let picture = |part: &str, what: &str, unit: &str, curves: [(&str, _); 2], values: &[[f64; 2]], time: &[f64]| {
        let x = time.into();
        let of = |axis: usize| {
            let (name, ink) = curves[axis];
            Curve::new(name, ink, &x, values.iter().map(|pair| pair[axis]).collect())
        };
        let panels = vec![panel(unit, time, vec![of(0), of(1)])];
        let title = format!("{review}{name} at 0.05 pu: {what}");
        Plot { name: format!("signal-{name}-{part}"), figure: Figure { title, x: "time in s", columns: 1, panels } }
    };
    let currents = trace.current.get(from..to).unwrap_or_default();
    let time = trace.t.get(from..to).unwrap_or_default();
    let axes = [("i_alpha", CURVES[0]), ("i_beta", CURVES[1])];
    let angles = [("true", REFERENCE), ("estimated", ink::of(cell.entry.kind))];
    vec![
        picture("current", "stator current", "A", axes, currents, time),
        picture("angle", "estimated angle", "angle in deg", angles, &trace.angles, &trace.t),
    ]
}
