//! Points of a map against `PmsmDrive` with a sensor, which runs until it has settled.

use super::sheet::{Axes, Sheet};
use crate::error::{Error, Result};
use crate::queue;
use drive::PmsmDrive;
use drive::plant::losses::Losses;
use drive::steady::{Point, Steady};
use fmu_core::{Block, Elapsed, Model, Step};

/// Maximum difference of the power from the link, as a share of the size of the powers ([`size`]), and of each loss.
const OF_POWER: f64 = 1e-3;
const OF_LOSS: f64 = 1e-2;
/// A loss below this share of the total is not compared separately.
const NEGLIGIBLE: f64 = 1e-3;

/// Times in s that the drive settles, and over which the means are taken.
const SETTLE: f64 = 1.0;
const MEAN: f64 = 1.0;

/// What the comparison found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verified {
    /// Number of points.
    pub points: usize,
    /// Maximum difference of the power from the link, as a share of the size of the powers.
    pub power: f64,
    /// Maximum relative difference of a loss.
    pub loss: f64,
    /// A sentence for each point that differs by more than allowed.
    pub apart: Vec<String>,
}

/// Minimum torque limit for a speed to be compared, as a share of the maximum: where the voltage is exhausted, there is no margin
/// for the ripple of a sampled drive.
const LEAST_LIMIT: f64 = 0.05;

/// Grid points spread evenly over speed and torque: speeds from a tenth of the maximum, no torque near 0 or on the limit.
fn places(axes: &Axes, sheet: &Sheet, count: usize) -> Vec<(f64, Point)> {
    let (speeds, torques) = (axes.speed.len(), axes.x.len());
    let greatest = sheet.limits.iter().flatten().fold(0.0_f64, |most, limit| most.max(limit.abs()));
    let eligible: Vec<usize> = (0..speeds * torques)
        .filter(|&k| {
            let (speed, x) = (axes.speed[k / torques], axes.x[k % torques]);
            let limit = sheet.limits[k / torques][usize::from(x > 0.0)].abs();
            let inside = (0.15..0.97).contains(&x.abs()) || torques == 3 && x != 0.0;
            let fast = speed >= 0.099 * axes.speed[speeds - 1];
            inside && fast && limit >= LEAST_LIMIT * greatest && sheet.points[k].is_some()
        })
        .collect();
    let count = count.min(eligible.len());
    // The middle of each of so many parts of the list, which goes speed by speed through all torques, moved by the golden
    // ratio within the part.
    let (mut chosen, mut moved) = (Vec::new(), 0.5);
    for k in 0..count {
        let (from, to) = (k * eligible.len() / count, (k + 1) * eligible.len() / count);
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0..to"
        )]
        let within = ((to - from) as f64 * moved) as usize;
        moved = (moved + 0.618_033_988_749_895) % 1.0;
        let k = eligible[(from + within).min(to - 1)];
        chosen.extend(sheet.points[k].map(|point| (axes.speed[k / torques], point)));
    }
    chosen
}

/// Compares `count` points of each sheet.
///
/// # Errors
/// The drive cannot run at one of them.
pub fn verify(drive: &Steady, axes: &Axes, sheets: &[Sheet], count: usize) -> Result<Verified> {
    let jobs: Vec<(&Sheet, f64, Point)> = sheets
        .iter()
        .flat_map(|sheet| places(axes, sheet, count).into_iter().map(move |(speed, point)| (sheet, speed, point)))
        .collect();
    let mut all = Verified { points: jobs.len(), ..Verified::default() };
    for one in queue::map(&jobs, |(sheet, speed, point)| compare(drive, sheet, *speed, point)) {
        let Difference { power, loss, apart } = one?;
        (all.power, all.loss) = (all.power.max(power), all.loss.max(loss));
        all.apart.extend(apart);
    }
    Ok(all)
}

/// Differences at one point.
#[derive(Clone, Debug, PartialEq)]
struct Difference {
    power: f64,
    loss: f64,
    /// Differences above the limit.
    apart: Option<String>,
}

/// Reference for the difference of a power (W): the apparent power of the machine, or the power of the link or the losses if
/// greater. p_in itself passes through 0, where the shaft alone covers the losses.
fn size(point: &Point) -> f64 {
    let apparent = 1.5 * point.u.magnitude() * point.i.magnitude();
    apparent.max(point.powers.p_in.abs()).max(point.powers.losses.sum())
}

/// The differences of the power and of a loss at one point.
fn compare(drive: &Steady, sheet: &Sheet, speed: f64, point: &Point) -> Result<Difference> {
    let place = || {
        let (rpm, tau) = (speed * 30.0 / std::f64::consts::PI, point.powers.tau_shaft);
        format!("at {rpm:.0} rpm, {tau:.4} N.m, {} V, {:.1} degC", sheet.u_dc, sheet.T - super::request::ZERO_CELSIUS)
    };
    let (p_in, losses) = run(drive, sheet, speed, point.tau_ref)
        .map_err(|e| Error::new(format!("PmsmDrive {}: {e}; --verify 0 leaves the comparison out", place())))?;
    let powers = &point.powers;
    let size = size(point);
    let power = (powers.p_in - p_in).abs() / size;
    let mut found = Difference { power, loss: 0.0, apart: None };
    if power.is_nan() || power > OF_POWER {
        found.apart = Some(format!(
            "the map differs from PmsmDrive {}: p_in is {:.3} W, not {p_in:.3} W, {:.2} % of {size:.3} W apart, allowed {} %",
            place(),
            powers.p_in,
            100.0 * power,
            100.0 * OF_POWER
        ));
    }
    let least = NEGLIGIBLE * powers.losses.sum();
    let parts = |l: &Losses| {
        [("p_cu", l.cu), ("p_iron", l.iron), ("p_cond", l.cond), ("p_sw", l.sw), ("p_friction", l.friction)]
    };
    for ((name, of_map), (_, of_run)) in parts(&powers.losses).into_iter().zip(parts(&losses)) {
        let loss = (of_map - of_run).abs() / of_run.abs().max(least);
        if (loss.is_nan() || loss > OF_LOSS) && found.apart.is_none() {
            found.apart = Some(format!(
                "the map differs from PmsmDrive {}: {name} is {of_map:.4} W, not {of_run:.4} W, {:.2} % apart, allowed {} %",
                place(),
                100.0 * loss,
                100.0 * OF_LOSS
            ));
        }
        found.loss = found.loss.max(loss);
    }
    Ok(found)
}

/// Mean power from the link and mean losses of the running drive.
fn run(drive: &Steady, sheet: &Sheet, speed: f64, tau_ref: f64) -> Result<(f64, Losses)> {
    let mut block = Block::<PmsmDrive>::default();
    let pair = &mut block.model.pair;
    pair.plant.model.parameters = drive.plant.clone();
    pair.plant.model.parameters.thermal.T_start = sheet.T;
    pair.controller.model.parameters = drive.controller.clone();
    let T_s = drive.controller.T_s;
    let inputs = &mut block.model.inputs;
    (inputs.speed_shaft, inputs.u_dc, inputs.tau_ref) = (speed, sheet.u_dc, tau_ref);
    block.initialize();
    block.model.validate().map_err(Error::new)?;
    let (mut now, mut count, mut p_in, mut losses) = (Elapsed::ZERO, 0.0, 0.0, Losses::none());
    while now.seconds() < SETTLE + MEAN {
        block.model.inputs.angle_shaft = speed * now.seconds();
        let step = Step { start: now, h: T_s };
        block.step(&step).map_err(Error::new)?;
        now = step.end();
        if now.seconds() > SETTLE {
            let powers = &block.out.plant.powers;
            (count, p_in) = (count + 1.0, p_in + powers.p_in);
            losses.add(&powers.losses);
        }
    }
    Ok((p_in / count, losses.map(|sum| sum / count)))
}
