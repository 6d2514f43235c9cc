//! A machine's data from a record of a running drive with an angle: resistance with the inverter's dead time, inductances, magnet
//! flux, inertia and friction, each with an interval, or with the reason why the record does not determine it.
//!
//! - [`columns`]: headers, units, forms of columns. [`record`]: the checked record. [`motion`]: angle and speed.
//! - [`windows`]: the voltage equations in integral form; [`electrical`]: their linear fit; [`legs`]: the inverter's curve in it.
//! - [`mechanics`]: inertia and friction. [`interval`]: half-widths. [`verdict`]: accepted and refused values.
//! - [`machine_file`]: the file for `fmu tune`. [`page`]: the fits together with the record.
//! - [`run`]: the machine of a run of the self-commissioning instead.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    clippy::cast_possible_wrap,
    reason = "counts of rows, far below 2^52"
)]

pub mod columns;
pub mod electrical;
pub mod interval;
pub mod legs;
pub mod machine_file;
pub mod mechanics;
pub mod motion;
pub mod page;
pub mod record;
pub mod run;
pub mod verdict;
pub mod windows;

use crate::error::{Result, WithContext, bail, ensure};
use columns::Signals;
use electrical::Fit;
use mechanics::{MechanicalFit, Shown, TorqueWindow};
use motion::Motion;
use record::BenchRecord;
use verdict::{Facts, Quantity};
use windows::{Problem, Timing, Window};

pub use record::{Complex, Options};

/// The result.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The quantities, in the order of a motor file.
    pub values: Vec<Quantity>,
    /// The fit of the voltages.
    pub fit: Fit,
    /// The record as the fits see it.
    pub seen: Seen,
    /// When the voltage of a row acts.
    pub timing: Timing,
    /// Ratings, and whether they are given or are the maxima of the record.
    pub ratings: Ratings,
    /// Pole pairs.
    pub n_p: i32,
    /// Notes for the reader.
    pub notes: Vec<String>,
}

/// The record as the fits see it.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Windows of the voltage equations, in the axes of the fit.
    pub voltage: Vec<Window>,
    /// Their length in s.
    pub window: f64,
    /// Windows of the torque.
    pub torque: Vec<TorqueWindow>,
    /// The fit of inertia and friction, where the load is known.
    pub mechanics: Option<MechanicalFit>,
}

/// Ratings of the machine file: the value, and whether it was given.
#[derive(Clone, Copy, Debug)]
pub struct Ratings {
    /// Maximum current in A.
    pub current: (f64, bool),
    /// Rated speed in rad/s.
    pub speed: (f64, bool),
    /// Rated torque in N.m.
    pub torque: (f64, bool),
    /// DC-link voltage in V, if it is known.
    pub u_dc: Option<f64>,
}

impl Ratings {
    fn json(&self) -> serde_json::Value {
        let rating = |(x, given): (f64, bool)| serde_json::json!({ "value": x, "given": given });
        serde_json::json!({
            "current": rating(self.current),
            "speed": rating(self.speed),
            "torque": rating(self.torque),
        })
    }
}

impl Identified {
    /// The result for other programs: values with unit, relative half-width and reason, and the fit.
    pub fn json(&self) -> serde_json::Value {
        serde_json::json!({
            "values": self.values.iter().map(Quantity::json).collect::<serde_json::Map<_, _>>(),
            "n_p": self.n_p,
            "rating": self.ratings.json(),
            "u_dc": self.ratings.u_dc,
            "angle": { "offset": self.fit.theta_0, "delay": self.fit.tau },
            "voltage_delay": self.timing.delay,
            "rest": self.fit.rest,
            "noise": self.fit.noise,
            "condition": self.fit.condition,
            "saturation": self.fit.saturation().map(|[s_2, s_3, s_dq]| serde_json::json!({ "s_2": s_2, "s_3": s_3, "s_dq": s_dq })),
            "notes": self.notes,
        })
    }
}

/// What no interval contains.
const SCALE: &str = "values scale with the sensors: 1 % more current lowers R_s, L_d and L_q by 1 % and raises J and friction by 1 %; \
    1 % more voltage raises all of them and psi_M by 1 %";

/// Delays that are tried.
const DELAYS: [f64; 5] = [0.0, 0.5, 1.0, 1.5, 2.0];

/// Minimum factor by which voltages shifted by a row increase the residual of the fit.
const SHIFTED: f64 = 1.3;

/// Identifies the machine of a record.
///
/// # Errors
/// An option or a signal is wrong, or the record determines nothing.
pub fn identify(signals: &Signals, options: &Options) -> Result<Identified> {
    options.check()?;
    let Some(n_p) = options.n_p else {
        bail!("--n-p is missing: give the number of pole pairs; a record does not contain it");
    };
    let record = BenchRecord::new(signals, options)?;
    let motion = Motion::of(&record);
    ensure!(!motion.runs.is_empty(), "{}: no stretch is long enough for a speed", record.file);
    let i_max = options.current.unwrap_or_else(|| record.peak());
    ensure!(i_max > 0.0, "{}: all currents are 0", record.file);
    let (timing, first, doubt) = timed(&record, &motion, options, i_max)?;
    let fit = Problem::new(&record, &motion, timing, i_max).refined(first.clone()).unwrap_or(first);
    let shown = Shown::of(&record, &motion, &fit, f64::from(n_p));
    let mechanics: Option<MechanicalFit> = record.load.is_some().then(|| shown.fit()).flatten();
    let facts = Facts::of(&record, &motion, timing, &fit, &shown, i_max);
    let mut notes = record.notes.clone();
    let misfit = (facts.misfit() || !fit.is_possible()).then(|| verdict::better(&record, &motion, timing, i_max, &fit));
    notes.push(SCALE.into());
    let doubt = doubt.or_else(|| verdict::scales(&shown));
    let values = verdict::values(&fit, mechanics.as_ref(), &facts, misfit, doubt);
    let rating = |given: Option<f64>, seen: f64| (given.unwrap_or(seen), given.is_some());
    let ratings = Ratings {
        current: rating(options.current, i_max),
        speed: rating(options.speed, shown.speed),
        torque: rating(options.torque, shown.torque),
        u_dc: record.u_dc,
    };
    let problem = Problem::new(&record, &motion, timing, i_max);
    let seen = Seen { voltage: problem.seen(&fit), window: problem.length(), torque: shown.rows, mechanics };
    Ok(Identified { values, fit, seen, timing, ratings, n_p, notes })
}

/// The fit with the given delay, or with the best one; and why the delay is in doubt.
fn timed(
    record: &BenchRecord,
    motion: &Motion,
    options: &Options,
    i_max: f64,
) -> Result<(Timing, Fit, Option<String>)> {
    let every = options.every.unwrap_or(1);
    let fit = |delay| {
        let timing = Timing { delay, every };
        Problem::new(record, motion, timing, i_max).fit().map(|fit| (timing, fit))
    };
    let nothing = || format!("{}: determines no parameter: record a running motor with changing currents", record.file);
    if let Some(delay) = options.delay {
        let (timing, found) = fit(delay).with_context(nothing)?;
        // More is left than noise explains: perhaps a row is shifted.
        let others = [delay + 1.0, delay - 1.0].into_iter().filter(|d| *d >= 0.0 && found.rest > SHIFTED * found.noise);
        let better = others.filter_map(fit).find(|(_, other)| SHIFTED * other.rest < found.rest);
        let doubt = better.map(|(other, _)| {
            let way = if other.delay > delay { "later" } else { "earlier" };
            format!("the model fits better with voltages one row {way}, --delay {}: correct the columns", other.delay)
        });
        return Ok((timing, found, doubt));
    }
    let mut all: Vec<_> = DELAYS.into_iter().filter_map(fit).collect();
    all.sort_by(|(_, a), (_, b)| a.rest.total_cmp(&b.rest));
    let doubt = match &all[..] {
        [(best, a), (next, b), ..] if b.rest < 1.05 * a.rest => {
            Some(format!("the delay may be {} or {} samples: give --delay", best.delay, next.delay))
        }
        _ => None,
    };
    let (timing, fit) = all.into_iter().next().with_context(nothing)?;
    Ok((timing, fit, doubt))
}

impl Options {
    fn check(&self) -> Result<()> {
        self.naming.check()?;
        for (name, x) in [
            ("--current", self.current),
            ("--speed", self.speed),
            ("--torque", self.torque),
            ("--u-dc", self.u_dc),
            ("--rate", self.rate),
        ] {
            if let Some(x) = x {
                ensure!(x > 0.0 && x.is_finite(), "{name} {x}: expected a number above 0");
            }
        }
        for (name, x) in &self.given {
            ensure!(*x > 0.0 && x.is_finite(), "--given {name}={x}: expected a number above 0");
        }
        if let Some(n_p) = self.n_p {
            ensure!((1..=200).contains(&n_p), "--n-p {n_p}: expected 1 to 200");
        }
        if let Some(delay) = self.delay {
            ensure!((0.0..=4.0).contains(&delay), "--delay {delay}: expected 0 to 4 samples");
        }
        if let Some(every) = self.every {
            ensure!((1..=100).contains(&every), "--every {every}: expected 1 to 100 samples");
        }
        Ok(())
    }
}
