//! Whether Rasmussen's observer adapts the resistance (`adaptation.resistance`).
//!
//! With a fixed R^ = 0.9 R, a winding that is 25 K colder than its data makes the speed loop swing on some machines, and one that is
//! hotter loses torque and load. The adaptation measures R^ at rest, within 4 / b, before the controller follows a reference:
//!
//! - it begins with 0.75 R or less, below the 0.80 R of copper at -30 degC: R^ > R runs away at standstill before it is measured;
//! - b = 20 1/s, at most a quarter of w_0 = sqrt(n_p K i_0 / J), with which the rotor swings on i_0: a faster adaptation
//!   mistakes the swing for an error of R^. With half of w_0, R^ of wind-5kw came to 1.36 R from 120 deg beside the rotor,
//!   which then crept away.
//!
//! The rules switch it on, unless the [`trial`] fails more conditions with it, at the temperature of the data, at -30 or at 130
//! degC, or swings at more speeds. The loss of a leg due to dead time and thresholds is compensated
//! ([`losses`](super::losses)), so the loss does not count as resistance.

use super::motor::{Data, swing};
use super::rasmussen::zero_speed_current;
use super::setting::{Tuned, Value, given, real, set};
use super::trial::{self, TEMPERATURES, Trial};
use drive::estimator::Kind;

/// Start angles of a trial.
const ANGLES: u32 = 6;

/// Maximum of the first R^ as a share of R; maximum bandwidth at rest in 1/s, and as a share of the rotor's w_0 on i_0.
const START: f64 = 0.75;
const BANDWIDTH: (f64, f64) = (20.0, 0.25);

/// Usual time at rest in which R^ converges to R, relative to 1 / bandwidth: 0.05 of the error remains, because `adaptation.i` is
/// i_0 / 2.
const REST: f64 = 4.0;

/// The drive with the adaptation, unless it is harmful; then a note is added; `fixed` is the drive without adaptation.
pub fn chosen(data: &Data, fixed: Tuned) -> Tuned {
    let par = fixed.pair().controller.model.parameters;
    if par.estimator != Kind::Rasmussen {
        return fixed;
    }
    let with = adapting(data, &fixed, par.motor.R_s / data.machine.R_s.get_ref());
    match harm(&fixed, &with) {
        None => with,
        Some(reason) => {
            let mut fixed = fixed;
            fixed.controller.push(set("adaptation.resistance", Value::Boolean(false), "see the note"));
            fixed.notes.push(format!(
                "adaptation.resistance is left off: {reason}. R^ stays {:.3} of the R_s given, so a winding much colder or hotter than \
                 its data may swing or lose its load",
                par.motor.R_s / data.machine.R_s.get_ref()
            ));
            fixed
        }
    }
}

/// The drive with the adaptation, which begins with `start` R or less.
fn adapting(data: &Data, fixed: &Tuned, start: f64) -> Tuned {
    let mut with = fixed.clone();
    for setting in &mut with.controller {
        if setting.name == "motor.R_s" {
            *setting = given("motor.R_s", &data.machine.R_s);
        }
    }
    let i_0 = zero_speed_current(data);
    let bandwidth = BANDWIDTH.0.min(BANDWIDTH.1 * swing(data, i_0));
    let below = "of R_s: below the 0.80 of a winding of -30 degC";
    with.controller.extend([
        set("adaptation.resistance", Value::Boolean(true), "R^ is measured at rest; the trial holds no less with it"),
        real("adaptation.start", START.min(start), below),
        real("adaptation.bandwidth", bandwidth, "20 1/s, at most sqrt(n_p K i_0 / J) / 4"),
        real("adaptation.i", 0.5 * i_0, "half of zero_speed.i_0"),
    ]);
    // The rest of a fixed resistance is 5 / w_0 or 0.2 s, not longer than 4 / b.
    with.rest = REST / bandwidth;
    with.notes.push(format!(
        "the drive measures R^ at rest before it follows speed_ref or tau_ref: {:.2} s, at most {:.2} s",
        with.rest,
        with.pair().controller.model.parameters.estimators.adaptation.longest_rest()
    ));
    with
}

/// Conditions, if any, that the drive withstands with a `fixed` resistance but not `with` the adaptation.
fn harm(fixed: &Tuned, with: &Tuned) -> Option<String> {
    let fewer = |own: bool, of: &dyn Fn(&Tuned) -> Tuned| {
        let new = trial::all(&of(with), ANGLES);
        if new.iter().all(|trial| trial.starts() && trial.holds()) {
            return None;
        }
        let old = trial::all(&of(fixed), ANGLES);
        let sum = |trials: &[Trial]| trials.iter().map(|trial| trial.started + trial.held).sum::<u32>();
        let worse = |(new, old): (&Trial, &Trial)| new.started < old.started || new.held < old.held;
        let any = sum(&new) < sum(&old) || (own && new.iter().zip(&old).any(worse));
        any.then(|| (sum(&new), sum(&old)))
    };
    let reason =
        |at: &str, (new, old)| format!("{at}, the trial with it has {new} starts and loads held, {old} without it");
    if let Some(counts) = fewer(true, &Tuned::clone) {
        return Some(reason("with the data given", counts));
    }
    for celsius in TEMPERATURES {
        if let Some(counts) = fewer(false, &|tuned| trial::at_temperature(tuned, celsius)) {
            return Some(reason(&format!("at {celsius:.0} degC"), counts));
        }
    }
    let new = trial::swings(with).len();
    let more = new > 0 && new > trial::swings(fixed).len();
    more.then(|| format!("without a load, the drive swings with it at {new} of the speeds tried, more than without it"))
}
