//! The torque-speed plane of the reference drive, drawn for the documentation page: what the equations allow, and what the
//! running drive gave.
//!
//! A [`Panel`] holds curves over the speed; filled curves reach down to zero. To stack quantities, fill their sums, the
//! greatest first.

use crate::plot::drawing;
use crate::reproduce::plots::tick;
use crate::runner;
use anyhow::{Result, anyhow};
use drive::Pair;
use drive::control::envelope::{Envelope, Warm};
use drive::estimator::Kind;
use plotters::prelude::*;
use std::f64::consts::PI;

const RPM: f64 = PI / 30.0;
/// Size of a panel in pixels.
const SIZE: (u32, u32) = (820, 360);
const BLUE_INK: RGBColor = RGBColor(0, 114, 178);
const RED_INK: RGBColor = RGBColor(213, 94, 0);
const GRAY: RGBColor = RGBColor(120, 120, 120);

/// A curve over the speed.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Name in the legend.
    pub name: &'static str,
    /// Its color.
    pub color: RGBColor,
    /// Whether the area between it and zero is filled.
    pub filled: bool,
    /// Speed in rpm and value.
    pub points: Vec<(f64, f64)>,
}

/// Curves of one unit over the speed.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Caption.
    pub title: String,
    /// Label of the vertical axis.
    pub unit: &'static str,
    /// The curves, in the order in which they are drawn.
    pub curves: Vec<Curve>,
    /// What runs gave: speed in rpm and value.
    pub dots: Vec<(f64, f64)>,
    /// Speeds in rpm with a label each.
    pub marks: Vec<(f64, String)>,
}

/// Draws panels, one below the other.
///
/// # Errors
/// When drawing fails.
pub fn svg(panels: &[Panel]) -> Result<String> {
    let mut text = String::new();
    {
        let size = (SIZE.0, SIZE.1 * u32::try_from(panels.len())?);
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE).map_err(drawing)?;
        for (panel, area) in panels.iter().zip(root.split_evenly((panels.len(), 1))) {
            let points = || panel.curves.iter().flat_map(|c| &c.points).chain(&panel.dots);
            let right = points().map(|p| p.0).fold(0.0, f64::max);
            let (low, high) = points().fold((0.0_f64, 0.0_f64), |(low, high), p| (low.min(p.1), high.max(p.1)));
            let margin = 0.08 * (high - low);
            let mut chart = ChartBuilder::on(&area)
                .caption(&panel.title, ("sans-serif", 18))
                .margin(8)
                .x_label_area_size(38)
                .y_label_area_size(64)
                .build_cartesian_2d(0.0..1.04 * right, low - margin..high + margin)
                .map_err(drawing)?;
            chart
                .configure_mesh()
                .x_desc("speed [rpm]")
                .y_desc(panel.unit)
                .x_label_formatter(&tick)
                .y_label_formatter(&tick)
                .light_line_style(TRANSPARENT)
                .bold_line_style(RGBColor(225, 225, 225))
                .label_style(("sans-serif", 15))
                .draw()
                .map_err(drawing)?;
            for Curve { name, color, filled, points } in &panel.curves {
                if *filled {
                    let area = AreaSeries::new(points.iter().copied(), 0.0, color.mix(0.15));
                    chart.draw_series(area).map_err(drawing)?;
                }
                let style = color.stroke_width(2);
                let line = chart.draw_series(LineSeries::new(points.iter().copied(), style)).map_err(drawing)?;
                line.label(*name).legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
            }
            for (speed, label) in &panel.marks {
                let line = PathElement::new([(*speed, low - margin), (*speed, high + margin)], GRAY);
                let name = Text::new(label.clone(), (*speed + 0.01 * right, high + 0.9 * margin), ("sans-serif", 15));
                chart.draw_series([line]).map_err(drawing)?;
                chart.draw_series([name]).map_err(drawing)?;
            }
            let dots = panel.dots.iter().map(|&at| Circle::new(at, 3, BLACK.filled()));
            let drawn = chart.draw_series(dots).map_err(drawing)?;
            if !panel.dots.is_empty() {
                drawn.label("PmsmDrive").legend(|(x, y)| Circle::new((x + 9, y), 3, BLACK.filled()));
            }
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::MiddleLeft)
                .background_style(WHITE.mix(0.8))
                .border_style(GRAY)
                .label_font(("sans-serif", 15))
                .draw()
                .map_err(drawing)?;
        }
        root.present().map_err(drawing)?;
    }
    Ok(text)
}

/// The reference drive with field weakening, exact estimates and a sensor, on a shaft that turns at an imposed speed.
fn reference() -> Pair {
    let mut pair = Pair::default();
    let plant = &mut pair.plant.model.parameters;
    plant.mechanics.imposed = true;
    let par = &mut pair.controller.model.parameters;
    par.motor.clone_from(&plant.motor);
    par.estimator = Kind::Sensored;
    (par.speed_loop.torque_mode, par.weakening.used) = (true, true);
    (par.limit.i_q, par.limit.tau) = (par.limit.i, 1000.0);
    pair
}

/// The torque (N.m) of the running drive at `rpm` if it is asked for `tau` (N.m): the mean of the last tenth of 0.5 s.
///
/// # Errors
/// A step fails.
pub fn torque(rpm: f64, tau: f64) -> Result<f64> {
    let (mut pair, mut sum, mut n) = (reference(), 0.0, 0.0);
    let survived = runner::run_in_steps(&mut pair, 1e-4, 0.5, |t, pair| {
        let plant = &mut pair.plant.model.inputs;
        (plant.speed_shaft, plant.angle_shaft) = (rpm * RPM, rpm * RPM * t);
        pair.controller.model.inputs.tau_ref = tau;
        if t > 0.45 {
            (sum, n) = (sum + pair.plant.out.tau_e, n + 1.0);
        }
    })
    .map_err(|fault| anyhow!("{fault}"))?;
    if survived { Ok(sum / n) } else { Err(anyhow!("a step failed at {rpm} rpm")) }
}

/// The envelope of the reference drive.
#[derive(Clone, Debug)]
pub struct Plane {
    /// Base speed in rpm.
    pub base: f64,
    /// Speed in rpm above which there is no motoring torque.
    pub end: f64,
    /// Greatest motoring and generating torque.
    pub panel: Panel,
}

/// The envelope of the reference drive: its curves, and the torque of the running drive at the speeds of `measured` (rpm).
///
/// # Errors
/// As [`torque`].
pub fn envelope(measured: &[f64]) -> Result<Plane> {
    let pair = reference();
    let (par, u_dc) = (&pair.controller.model.parameters, pair.plant.model.inputs.u_dc);
    let (envelope, U) = (Envelope::new(&par.motor, par.limit.i), par.weakening.k_u * u_dc / 3.0_f64.sqrt());
    let electrical = f64::from(par.motor.n_p) * RPM;
    let limit = |rpm: f64, s: f64| {
        let mut warm = Warm::default();
        (0..8).map(|_| s * envelope.limit(rpm * electrical, s, U, &mut warm).tau).last().unwrap_or_default()
    };
    let base = envelope.base_speed(U) / electrical;
    let (mut end, mut beyond) = (base, 10.0 * base);
    while beyond - end > 1e-6 {
        let mid = 0.5 * (end + beyond);
        *(if limit(mid, 1.0) > 0.0 { &mut end } else { &mut beyond }) = mid;
    }
    let curve = |name, color, s: f64| {
        let speeds = (0..=200).map(|k| end * f64::from(k) / 200.0);
        Curve { name, color, filled: true, points: speeds.map(|rpm| (rpm, limit(rpm, s))).collect() }
    };
    let mut dots = Vec::new();
    for &rpm in measured {
        for tau in [20.0, -20.0] {
            dots.push((rpm, torque(rpm, tau)?));
        }
    }
    let panel = Panel {
        title: format!("reference motor, {} A, {u_dc} V", par.limit.i),
        unit: "torque [N.m]",
        curves: vec![curve("motoring", BLUE_INK, 1.0), curve("generating", RED_INK, -1.0)],
        dots,
        marks: vec![(base, format!("base speed {base:.0} rpm"))],
    };
    Ok(Plane { base, end, panel })
}
