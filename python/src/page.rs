//! A figure of a run with zoom and readings at the cursor, as a page: the notebook representation of a result.

use crate::error::{gate, plain};
use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::ink::CURVES;
use fmu_plot::page;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use std::rc::Rc;

/// The page of curves over time: name, unit and values of each; curves of one unit share a panel.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn run_page(
    title: &str,
    time: PyReadonlyArray1<'_, f64>,
    curves: Vec<(String, String, PyReadonlyArray1<'_, f64>)>,
) -> PyResult<String> {
    gate(|| {
        let time: Rc<[f64]> = time.as_array().iter().copied().collect();
        let window = (time.first().copied().unwrap_or_default(), time.last().copied().unwrap_or_default());
        let mut panels: Vec<Panel> = Vec::new();
        for (name, unit, y) in curves {
            let unit = if unit.is_empty() { "no unit".to_owned() } else { unit };
            let at = panels.iter().position(|panel| panel.unit == unit).unwrap_or_else(|| {
                panels.push(Panel { unit, window, ..Panel::default() });
                panels.len() - 1
            });
            let ink = CURVES[panels[at].curves.len() % CURVES.len()];
            panels[at].curves.push(Curve::new(name, ink, &time, y.as_array().to_vec()));
        }
        let figure = Figure { title: String::new(), x: "time in s", columns: 1, panels };
        let body = page::figure(&figure, "This figure needs JavaScript; fmurun.plot draws it without.");
        body.map(|body| page::page(title, &body)).map_err(|e| plain(&e.to_string()))
    })
}
