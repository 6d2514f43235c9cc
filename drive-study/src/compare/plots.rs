//! Plots over time: speed and angle error of all estimators in one picture per scenario and, for each estimator that
//! injects a voltage, the carrier current and the angle found in it (Fig. 8 and 11 of the review).

use super::Cell;
use crate::plot;
use anyhow::Result;
use fmu_import::cosimulation::{Column, Recording};

/// A picture.
#[derive(Debug)]
pub struct Plot {
    /// File name without extension.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// The picture.
    pub svg: String,
}

/// All pictures of the cells.
///
/// # Errors
/// When drawing fails.
pub fn all(cells: &[Cell]) -> Result<Vec<Plot>> {
    let mut plots = Vec::new();
    for id in ["ramp", "reversal", "load-0", "load-0.1", "load-0.5", "load-1", "weakening"] {
        let with_trace: Vec<&Cell> = cells.iter().filter(|c| c.scenario.id == id && c.trace().is_some()).collect();
        if !with_trace.is_empty() {
            plots.push(together(id, &with_trace)?);
        }
    }
    for cell in cells.iter().filter(|c| c.scenario.id == "signal-trace") {
        plots.extend(signal(cell)?);
    }
    Ok(plots)
}

fn column(name: String, unit: &str, values: Vec<f64>) -> Column {
    Column { name, unit: unit.into(), display: None, values }
}

/// All estimators in a scenario.
fn together(id: &str, cells: &[&Cell]) -> Result<Plot> {
    let mut recording = Recording::default();
    for cell in cells {
        let Some(trace) = cell.trace() else { continue };
        if trace.t.len() > recording.time.len() {
            recording.time.clone_from(&trace.t);
        }
    }
    let full = |values: &[f64]| {
        let missing = recording.time.len() - values.len();
        // A lost rotor may have any angle; a curve that leaves the picture would hide all others.
        values.iter().map(|x| x.clamp(-100.0, 100.0)).chain(std::iter::repeat_n(f64::NAN, missing)).collect()
    };
    let mut columns = Vec::new();
    for cell in cells {
        let Some(trace) = cell.trace() else { continue };
        let name = cell.entry.label();
        columns.push(column(name.clone(), "speed in pu", full(&trace.speed)));
        columns.push(column(name, "theta - theta^ in deg", full(&trace.error)));
    }
    recording.columns = columns;
    let title = format!("{id}: {}", cells[0].scenario.title);
    Ok(Plot { name: id.into(), title, svg: plot::svg(&recording)? })
}

/// Fig. 8 and 11: the carrier current over six milliseconds, and the angle found in it.
fn signal(cell: &Cell) -> Result<Vec<Plot>> {
    let Some(trace) = cell.trace() else { return Ok(Vec::new()) };
    let name = cell.entry.name;
    let figure = match name {
        "RotatingInjection" => "Fig. 8 of the review, ",
        "PulsatingInjection" => "Fig. 11 of the review, ",
        _ => "",
    };
    let index = |t: f64| trace.t.partition_point(|x| *x < t);
    let (from, to) = (index(0.3), index(0.306));
    let picture = |part: &str, title: &str, unit: &str, names: [&str; 2], values: &[[f64; 2]], time: &[f64]| {
        let of = |axis: usize| column(names[axis].into(), unit, values.iter().map(|x| x[axis]).collect());
        let recording = Recording { time: time.to_vec(), columns: vec![of(0), of(1)], ended_by: None };
        anyhow::Ok(Plot {
            name: format!("signal-{name}-{part}"),
            title: format!("{figure}{name} at 0.05 pu: {title}"),
            svg: plot::svg(&recording)?,
        })
    };
    let currents = trace.current.get(from..to).unwrap_or_default();
    let time = trace.t.get(from..to).unwrap_or_default();
    Ok(vec![
        picture("current", "stator current", "A", ["i_alpha", "i_beta"], currents, time)?,
        picture("angle", "estimated angle", "angle in deg", ["true", "estimated"], &trace.angles, &trace.t)?,
    ])
}
