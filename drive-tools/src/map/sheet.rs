//! The points of a map at one voltage and one temperature, on a grid of speed and relative torque.
//!
//! The shaft torque is given as a share x of the maximum with its sign at that speed, x = tau / tau_max or tau / |tau_min|,
//! in
//! -1..1: the grid has no holes, and no cell lies across the envelope.

use crate::queue;
use drive::plant::thermal::Temperatures;
use drive::steady::{At, Condition, Point, Region, Steady};

/// The grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axes {
    /// Mechanical speeds in rad/s, ascending from 0.
    pub speed: Vec<f64>,
    /// Torque at the shaft as a share of the maximum of its sign, from -1 to 1.
    pub x: Vec<f64>,
}

#[expect(clippy::cast_precision_loss, reason = "at most a few thousand")]
fn even(from: f64, to: f64, count: usize) -> Vec<f64> {
    let last = (count - 1) as f64;
    (0..count).map(|k| if k + 1 == count { to } else { from + (to - from) * (k as f64 / last) }).collect()
}

impl Axes {
    /// Evenly spaced, with this many speeds up to `top` (rad/s) and this many torques; at least 2 and 3.
    pub fn new((speeds, torques): (usize, usize), top: f64) -> Self {
        Self { speed: even(0.0, top, speeds), x: even(-1.0, 1.0, torques) }
    }
}

/// The points of a grid at one voltage and temperature.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// DC-link voltage in V.
    pub u_dc: f64,
    /// Temperature of winding and magnet in K.
    pub T: f64,
    /// Minimum and maximum torque at the shaft in N.m at each speed; 0 if that sign is out of reach.
    pub limits: Vec<[f64; 2]>,
    /// Positions of the minimum and the maximum torque.
    pub regions: Vec<[Region; 2]>,
    /// The points, torque by torque for each speed; `None` out of reach.
    pub points: Vec<Option<Point>>,
}

/// The drive under a condition.
pub fn at(drive: &Steady, speed: f64, u_dc: f64, T: f64) -> At<'_> {
    drive.at(&Condition { speed, u_dc, temperatures: Temperatures::all(T) })
}

/// The points of minimum and maximum torque at the shaft, if the voltage allows a torque of that sign.
pub fn ends(at: &At<'_>) -> [Option<Point>; 2] {
    let [low, high] = at.ends();
    let reached = |point: &Point, sign: f64| at.fits(point) && sign * point.powers.tau_shaft > 0.0;
    [Some(low).filter(|p| reached(p, -1.0)), Some(high).filter(|p| reached(p, 1.0))]
}

/// The points at one speed.
struct Column {
    ends: [Option<Point>; 2],
    points: Vec<Option<Point>>,
}

fn column(drive: &Steady, x: &[f64], speed: f64, u_dc: f64, T: f64) -> Column {
    let at = at(drive, speed, u_dc, T);
    let ends = ends(&at);
    let point = |&x: &f64| {
        let end = ends[usize::from(x > 0.0)];
        if x.abs() >= 1.0 {
            return end;
        }
        let tau = if x == 0.0 { 0.0 } else { x.abs() * end?.powers.tau_shaft };
        at.by_shaft(tau).filter(|point| at.fits(point))
    };
    Column { points: x.iter().map(point).collect(), ends }
}

/// The sheets of every voltage (V) and temperature (K), temperature by temperature for each voltage.
pub fn all(drive: &Steady, axes: &Axes, u_dc: &[f64], T: &[f64]) -> Vec<Sheet> {
    let conditions: Vec<(f64, f64)> = u_dc.iter().flat_map(|&u_dc| T.iter().map(move |&T| (u_dc, T))).collect();
    let jobs: Vec<(f64, f64, f64)> =
        conditions.iter().flat_map(|&(u_dc, T)| axes.speed.iter().map(move |&speed| (speed, u_dc, T))).collect();
    let mut columns = queue::map(&jobs, |&(speed, u_dc, T)| column(drive, &axes.x, speed, u_dc, T)).into_iter();
    let sheet = |(u_dc, T)| {
        let mut sheet = Sheet { u_dc, T, limits: Vec::new(), regions: Vec::new(), points: Vec::new() };
        for Column { ends, points } in columns.by_ref().take(axes.speed.len()) {
            sheet.limits.push(ends.map(|end| end.map_or(0.0, |end| end.powers.tau_shaft)));
            sheet.regions.push(ends.map(|end| end.map_or(Region::Limit, |end| end.region)));
            sheet.points.extend(points);
        }
        sheet
    };
    conditions.into_iter().map(sheet).collect()
}
