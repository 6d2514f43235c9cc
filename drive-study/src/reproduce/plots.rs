//! The paper's Fig. 4 and Fig. 5 in its own layout.

use super::experiment::Record;
use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::ink::{CURVES, Ink, REFERENCE};

const TRUE: Ink = CURVES[1];
const ESTIMATED: Ink = CURVES[0];

/// Name, color and values of a curve.
type Row<'a> = (&'static str, Ink, &'a [f64]);

fn panel<const N: usize>(title: &str, unit: &str, record: &Record, window: (f64, f64), rows: [Row<'_>; N]) -> Panel {
    let from = record.t.partition_point(|x| *x < window.0);
    let to = record.t.partition_point(|x| *x <= window.1);
    let x = record.t[from..to].into();
    let curve = |(name, ink, values): Row<'_>| Curve {
        dashed: ink == REFERENCE,
        ..Curve::new(name, ink, &x, values[from..to].to_vec())
    };
    let curves = rows.into_iter().map(curve).collect();
    Panel { title: title.into(), unit: unit.into(), window, curves, ..Panel::default() }
}

fn speed(title: &str, record: &Record, window: (f64, f64)) -> Panel {
    let rows = [
        ("reference", REFERENCE, &record.speed_ref[..]),
        ("true", TRUE, &record.speed),
        ("estimated", ESTIMATED, &record.speed_est),
    ];
    panel(title, "rpm", record, window, rows)
}

fn currents(title: &str, record: &Record, window: (f64, f64)) -> Panel {
    panel(title, "A", record, window, [("i_sd", CURVES[0], &record.i_d[..]), ("i_sq", CURVES[1], &record.i_q)])
}

fn error(title: &str, record: &Record, window: (f64, f64)) -> Panel {
    panel(title, "deg", record, window, [("error", CURVES[0], &record.error[..])])
}

/// Panels in rows of two.
fn figure<const N: usize>(title: &str, panels: [Panel; N]) -> Figure {
    Figure { title: title.into(), x: "time in s", columns: 2, panels: panels.into() }
}

/// Fig. 4: start from 180 deg (speed, angle) and the four speed steps.
pub fn figure_4(start: &Record, steps: [&Record; 4]) -> Figure {
    let angles = [("true", TRUE, &start.theta_e[..]), ("estimated", ESTIMATED, &start.theta_est)];
    figure(
        "Fig. 4: start-up and speed steps",
        [
            speed("(a) start from 180°: speed", start, (0.1, 1.0)),
            panel("(b) start from 180°: electrical rotor angle", "deg", start, (0.15, 0.5), angles),
            speed("(c) 0 - 20 rpm", steps[0], (0.0, 1.0)),
            speed("(d) 0 - 500 rpm", steps[1], (0.0, 0.6)),
            speed("(e) 0 - 1000 rpm", steps[2], (0.0, 0.6)),
            speed("(f) 0 - 1500 rpm", steps[3], (0.0, 0.6)),
        ],
    )
}

/// Section 3.2: the second start after a return to zero speed.
pub(super) fn second_start(start: &Record) -> Figure {
    figure(
        "Section 3.2: the second start",
        [
            speed("first start, stop, second start: speed", start, (0.0, 3.2)),
            error("first start, stop, second start: angle error", start, (0.0, 3.2)),
        ],
    )
}

/// Fig. 5: load steps at 0 rpm (left) and 1000 rpm (right).
pub fn figure_5(at_0: &Record, at_1000: &Record) -> Figure {
    let (left, right) = ((0.3, 2.5), (0.8, 2.0));
    figure(
        "Fig. 5: load steps",
        [
            speed("(a) 2 N.m at 0 rpm: speed", at_0, left),
            speed("(b) 2 N.m at 1000 rpm: speed", at_1000, right),
            currents("(c) currents", at_0, left),
            currents("(d) currents", at_1000, right),
            error("(e) angle error", at_0, left),
            error("(f) angle error", at_1000, right),
        ],
    )
}
