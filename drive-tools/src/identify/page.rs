//! A page with the values, and each fit together with the record: voltages over time, flux linkages over currents, torque over
//! time, and friction over speed.

use super::run::Commissioned;
use super::verdict::Quantity;
use super::windows::Window;
use super::{Identified, Seen};
use crate::error::Result;
use drive::control::commission::CommissionState;
use fmu_core::Enumerated;
use fmu_core::digits::rounded;
use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::ink::{CURVES, REFERENCE};
use fmu_plot::page::{self, escape};
use std::fmt::Write as _;
use std::rc::Rc;

/// Places along a current or a speed at which the record is averaged.
const PLACES: usize = 60;

/// Maximum change of a current within a window, as a share of the maximum current, for which its flux linkage is shown.
const STEADY: f64 = 0.03;

/// The page; `file` is the name of the record.
///
/// # Errors
/// Those of [`page::figure`].
pub fn page(found: &Identified, file: &str) -> Result<String> {
    drawn(file, &found.values, &found.notes, &figures(found))
}

/// The page of a commissioning: its values, and the run. `file` is the name of the recording.
///
/// # Errors
/// Those of [`page::figure`].
pub fn commissioning(found: &Commissioned, file: &str) -> Result<String> {
    let (time, signals) = &found.seen;
    let x: Rc<[f64]> = time.as_slice().into();
    let panels = [
        ("commission_state", "commission_state"),
        ("i_", "currents"),
        ("u_", "voltage references"),
        ("speed", "speed"),
    ]
    .into_iter()
    .filter_map(|(start, title)| {
        let of = || signals.iter().filter(|(name, ..)| name.starts_with(start));
        let unit = of().next()?.1;
        let curves = of().zip(CURVES).map(|((name, _, y), ink)| Curve::new(*name, ink, &x, y.clone())).collect();
        Some(panel(title, unit, curves))
    })
    .collect();
    let figure = Figure { title: "Run".into(), x: "time in s", columns: 1, panels };
    let states = CommissionState::ALL.iter().map(|state| format!("{} {}", state.value(), state.name()));
    let text = format!("The numbers of commission_state: {}.", states.collect::<Vec<_>>().join(", "));
    let values: Vec<_> = found.values.iter().chain(&found.more).cloned().collect();
    drawn(file, &values, &found.notes, &[(figure, &text)])
}

/// A page of values, notes, and figures with captions.
fn drawn(file: &str, values: &[Quantity], notes: &[String], figures: &[(Figure, &str)]) -> Result<String> {
    let refused = values.iter().filter(|v| v.refused.is_some()).count();
    let (class, verdict) = match refused {
        0 => ("", "all values are written".to_owned()),
        _ => (" off", format!("{} of {} values are written", values.len() - refused, values.len())),
    };
    let mut html = format!("<p class=\"verdict{class}\">{verdict}</p>\n{}", table(values));
    html.push_str("<ul class=\"notes\">\n");
    for note in notes {
        let _ = writeln!(html, "<li>{}</li>", escape(note));
    }
    html.push_str("</ul>\n");
    for (figure, text) in figures.iter().filter(|(figure, _)| !figure.is_empty()) {
        let drawn = page::figure(figure, "The plot needs JavaScript.")?;
        let _ = write!(html, "<h2>{}</h2>\n<p>{text}</p>\n{drawn}", escape(&figure.title));
    }
    Ok(page::page(&format!("Machine of {file}"), &html))
}

/// The values with their intervals, or the reasons why a value is missing.
fn table(values: &[Quantity]) -> String {
    let mut html = "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"values\"><table>\n<thead><tr><th class=\"name\">quantity</th>\
        <th class=\"number\">value</th><th>unit</th><th class=\"number\">interval</th><th>verdict</th></tr></thead>\n<tbody>\n"
        .to_owned();
    for value in values {
        let _ = write!(html, "<tr><th class=\"name\">{}</th>", value.name);
        let number = rounded(value.value, 5).to_string();
        let unit = value.unit;
        let _ = match &value.refused {
            None => writeln!(
                html,
                "<td class=\"number\">{}</td><td>{unit}</td><td class=\"number\">{}</td><td class=\"in\">written</td></tr>",
                number.replace('-', "−"),
                if value.half_width.is_nan() {
                    "given".into()
                } else {
                    format!("± {:.2} %", 100.0 * value.half_width)
                }
            ),
            Some(why) => writeln!(
                html,
                "<td class=\"number\">–</td><td>{unit}</td><td class=\"number\">–</td><td>refused: {}</td></tr>",
                escape(why)
            ),
        };
    }
    html + "</tbody></table></div>\n"
}

/// The figures with their captions.
fn figures(found: &Identified) -> [(Figure, &'static str); 4] {
    [
        (
            voltages(found),
            "Means over a window of some samples, in rotor axes. Below, the residual of the fit, which should look like \
            noise. A pattern that follows the course of the record indicates an effect missing in the model.",
        ),
        (
            fluxes(found),
            "The flux linkage that the voltages show beside the drops of the fit, averaged over like currents. The slope of the line is \
             the inductance, its height at no current the magnet's flux; a curve that bends away from the line is saturation.",
        ),
        (
            torques(found),
            "The torque of the currents without the load, in windows of 50 ms, beside inertia and friction of the fit.",
        ),
        (
            friction(found),
            "Torque that does not accelerate, averaged over similar speeds: a run-down. The line is tau_coulomb + B w.",
        ),
    ]
}

/// Times of some windows, with the gaps of the record.
fn over_time<T>(windows: &[T], t: impl Fn(&T) -> f64, length: f64, y: impl Fn(&T) -> f64) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::with_capacity(windows.len());
    for window in windows {
        let at = t(window);
        if let Some((last, _)) = points.last()
            && at - last > 1.5 * length
        {
            points.push((0.5 * (at + last), f64::NAN));
        }
        points.push((at, y(window)));
    }
    points
}

fn window(curves: &[Curve]) -> (f64, f64) {
    let all = || curves.iter().flat_map(|c| c.x.iter().copied());
    (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
}

fn panel(title: &str, unit: &str, curves: Vec<Curve>) -> Panel {
    Panel { title: title.into(), unit: unit.into(), window: window(&curves), curves, ..Panel::default() }
}

/// A record and its fit over the same axis.
fn pair(points: &[(f64, f64)], fit: &[(f64, f64)]) -> Vec<Curve> {
    let x: Rc<[f64]> = points.iter().map(|p| p.0).collect();
    let y = |points: &[(f64, f64)]| points.iter().map(|p| p.1).collect();
    vec![
        Curve::new("record", CURVES[0], &x, y(points)),
        Curve { dashed: true, ..Curve::new("fit", CURVES[1], &x, y(fit)) },
    ]
}

fn rest(points: &[(f64, f64)], fit: &[(f64, f64)]) -> Vec<Curve> {
    vec![Curve::through("record - fit", REFERENCE, points.iter().zip(fit).map(|(a, b)| (a.0, a.1 - b.1)))]
}

fn dot<const N: usize>(x: &[f64; N], p: &[f64; N]) -> f64 {
    x.iter().zip(p).map(|(x, p)| x * p).sum()
}

fn voltages(found: &Identified) -> Figure {
    let Seen { voltage, window, .. } = &found.seen;
    let over = |y: &dyn Fn(&Window) -> f64| over_time(voltage, |w| w.t, *window, |w| y(w) / window);
    let p = &found.fit.p;
    let (d, q) = (over(&|w| w.u.re), over(&|w| w.u.im));
    let (fit_d, fit_q) = (over(&|w| dot(&w.d, p)), over(&|w| dot(&w.q, p)));
    let panels = vec![
        panel("u_d", "V", pair(&d, &fit_d)),
        panel("u_q", "V", pair(&q, &fit_q)),
        panel("u_d: record - fit", "V", rest(&d, &fit_d)),
        panel("u_q: record - fit", "V", rest(&q, &fit_q)),
    ];
    Figure { title: "Voltages".into(), x: "time in s", columns: 2, panels }
}

/// Flux linkages over currents: psi_d from the q-equation, psi_q from the d-equation, where the rotor turns.
fn fluxes(found: &Identified) -> Figure {
    let Seen { voltage, window, .. } = &found.seen;
    let [_, L_d, L_q, psi_M, ..] = found.fit.p;
    let greatest = |y: &dyn Fn(&Window) -> f64| voltage.iter().map(y).fold(0.0, f64::max);
    let (top, most) = (greatest(&|w| w.q[3].abs()), greatest(&|w| w.d[0].hypot(w.q[0])) / window);
    // While a current changes, its inductance hides the flux.
    let steady = |w: &&Window| w.q[3].abs() > 0.1 * top && w.d[1].hypot(w.q[2]) < STEADY * most;
    let turning = || voltage.iter().filter(steady);
    // Residual of an equation without the terms of the rotor-fixed flux, over the angle.
    let psi_d = turning().map(|w| {
        let flux = L_d * w.q[1] + psi_M * w.q[3];
        (w.d[0] / window, (w.u.im - dot(&w.q, &found.fit.p) + flux) / w.q[3], w.q[3] * w.q[3])
    });
    let psi_q = turning().map(|w| {
        let flux = L_q * w.d[2];
        (w.q[0] / window, -(w.u.re - dot(&w.d, &found.fit.p) + flux) / w.q[3], w.q[3] * w.q[3])
    });
    let both = |points: Vec<(f64, f64)>, line: &dyn Fn(f64) -> f64| {
        let fit: Vec<_> = points.iter().map(|p| (p.0, line(p.0))).collect();
        pair(&points, &fit)
    };
    let panels = vec![
        panel("psi_d over i_d", "Wb", both(averaged(psi_d), &|i| psi_M + L_d * i)),
        panel("psi_q over i_q", "Wb", both(averaged(psi_q), &|i| L_q * i)),
    ];
    Figure { title: "Flux linkages".into(), x: "current in A", columns: 2, panels }
}

fn torques(found: &Identified) -> Figure {
    let Seen { torque, mechanics, .. } = &found.seen;
    let Some(fit) = mechanics else { return Figure::default() };
    let length = torque.first().map_or(0.0, |row| row.time);
    let made = over_time(torque, |row| row.t, length, |row| row.y / row.time);
    let fitted = over_time(torque, |row| row.t, length, |row| dot(&row.x, &fit.p) / row.time);
    let speed = over_time(torque, |row| row.t, length, |row| row.x[1] / row.time);
    let panels = vec![
        panel("torque without the load", "N.m", pair(&made, &fitted)),
        panel("record - fit", "N.m", rest(&made, &fitted)),
        panel("speed", "rad/s", vec![Curve::through("record", CURVES[0], speed.into_iter())]),
    ];
    Figure { title: "Torque".into(), x: "time in s", columns: 1, panels }
}

fn friction(found: &Identified) -> Figure {
    let Seen { torque, mechanics, .. } = &found.seen;
    let Some(fit) = mechanics else { return Figure::default() };
    let left = torque.iter().map(|row| (row.x[1] / row.time, (row.y - fit.p[0] * row.x[0]) / row.time, 1.0));
    let points = averaged(left);
    let line = averaged(torque.iter().map(|row| {
        let friction = fit.p[1] * row.x[1] + fit.p[2] * row.x[2];
        (row.x[1] / row.time, friction / row.time, 1.0)
    }));
    let panels = vec![panel("friction", "N.m", pair(&points, &line))];
    Figure { title: "Friction".into(), x: "speed in rad/s", columns: 1, panels }
}

/// Weighted means of points (x, y, weight) at several x, in ascending order.
fn averaged(points: impl Iterator<Item = (f64, f64, f64)>) -> Vec<(f64, f64)> {
    let points: Vec<_> = points.filter(|(x, y, weight)| x.is_finite() && y.is_finite() && *weight > 0.0).collect();
    let (low, high) =
        points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p.0), high.max(p.0)));
    let mut sums = vec![[0.0; 3]; PLACES];
    for (x, y, weight) in points {
        let place = ((x - low) / (high - low).max(f64::MIN_POSITIVE) * PLACES as f64) as usize;
        let [a, b, c] = &mut sums[place.min(PLACES - 1)];
        (*a, *b, *c) = (*a + weight, *b + weight * x, *c + weight * y);
    }
    sums.into_iter().filter(|[weight, ..]| *weight > 0.0).map(|[weight, x, y]| (x / weight, y / weight)).collect()
}
