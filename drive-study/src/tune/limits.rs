//! What the tuned drive will not do, told before anyone tries it. [`trial`](super::trial) tries it.
//!
//! - **Load.** A step of the rated torque T makes the speed loop (double pole at w_s / 2) dip by 2/e T / (J w_s). An estimator
//!   that lives on the EMF loses the rotor where the dip takes 0.6 of the speed; a flux observer, which holds zero speed,
//!   where it takes twice the speed. A load that rises in t_r makes it dip by 4 T / (J w_s^2 t_r) at most.
//! - **Start, flux observer.** At rest, R^ below R drives the estimate away at (R - R^) i_0 / psi_M, and the rotor follows with
//!   w_0 = sqrt(n_p K i_0 / J): the former must be less than the latter. The rules choose R^ for that; below 2 % nobody knows
//!   R.
//! - **Start, extended EMF.** A change of i_q acts on the estimated speed through (L_q - L_d) p i_q against the EMF; closed by
//!   the speed loop, the gain is J w_s (L_q - L_d) rho^2 / (K n_p w psi_M). Above 40 at 0.1 pu, the drive does not come to
//!   rest there after the hand-over.
//!
//! The limits 0.6, 2 and 40 are found by trial on the machines in `motors/`, with 0.3 to 30 times their inertia.

use super::bandwidth::{Bandwidths, DIP_OF_A_STEP, acceleration};
use super::motor::Data;
use super::rules::torque_constant;
use super::trial::LEVELS;
use std::fmt;

/// What a limit is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// To start from any angle.
    Start,
    /// To take rated torque as a step.
    Load,
}

impl fmt::Display for What {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "START",
            Self::Load => "LOAD",
        })
    }
}

/// Something that the drive will not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// What it will not hold.
    pub what: What,
    /// At which speed in pu.
    pub level: f64,
    /// Why.
    pub reason: String,
    /// What helps.
    pub remedy: String,
    /// Time in s in which the rated torque may rise instead, for a load.
    pub rise: Option<f64>,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "will not hold {} at {} pu: {}; {}", self.what, self.level, self.reason, self.remedy)
    }
}

/// Least share by which R^ can be kept below R.
const LEAST_MARGIN: f64 = 0.02;

/// Greatest loop gain through the EMF of the change of i_q, at 0.1 pu.
pub const GREATEST_GAIN: f64 = 40.0;

/// Greatest bandwidth of the observer in rad/s that a remedy asks for: 40 Hz.
const FASTEST: f64 = 252.0;

/// Share of R by which R^ is to be below it: 0.1, or what lets the rotor follow the estimate at rest.
pub fn resistance_margin(data: &Data) -> f64 {
    let i_0 = zero_speed_current(data);
    let drift = data.machine.R_s.get_ref() * i_0 / data.machine.psi_M.get_ref();
    (swing(data, i_0) / drift).min(0.1)
}

/// Current in A of the low-speed law: holds 1.35 times the rated torque.
pub fn zero_speed_current(data: &Data) -> f64 {
    1.35 * data.rating.torque.get_ref() / torque_constant(data)
}

/// Natural frequency in rad/s of the rotor on a current vector of `i` (A).
pub fn swing(data: &Data, i: f64) -> f64 {
    (f64::from(*data.machine.n_p.get_ref()) * torque_constant(data) * i / data.mechanics.J.get_ref()).sqrt()
}

/// Gain of the speed loop through the EMF that a change of i_q makes, per rad/s of w_s, at 0.1 pu and the tracker's `rho`
/// (rad/s).
pub fn gain_per_bandwidth(data: &Data, rho: f64) -> f64 {
    let (machine, n_p) = (&data.machine, f64::from(*data.machine.n_p.get_ref()));
    let saliency = (machine.L_q.get_ref() - machine.L_d.get_ref()).abs();
    let emf = n_p * LEVELS[0] * data.rating.speed.get_ref() * machine.psi_M.get_ref();
    data.mechanics.J.get_ref() * saliency * rho * rho / (torque_constant(data) * n_p * emf)
}

/// What the drive will not hold, and what it holds by a narrow margin.
pub fn of(data: &Data, bandwidths: &Bandwidths, flux_observer: bool) -> (Vec<Limit>, Vec<String>) {
    let (mut limits, mut notes) = (starts(data, bandwidths, flux_observer), Vec::new());
    let (w_s, rated) = (bandwidths.speed.value, *data.rating.speed.get_ref());
    let dip = DIP_OF_A_STEP * acceleration(data) / w_s;
    let share = if flux_observer { 2.0 } else { 0.6 };
    for level in LEVELS {
        let speed = level * rated;
        let reason = format!("a step of the rated torque takes 2/e T / (J w_s) = {dip:.3} of the {speed:.3} rad/s");
        if dip > share * speed {
            let excess = 1.1 * dip / (share * speed);
            let rise = 4.0 * acceleration(data) / (w_s * w_s * 0.5 * share * speed);
            let remedy =
                format!("let the load rise in {rise:.2} s or more{}", others(data, bandwidths, excess, flux_observer));
            limits.push(Limit { what: What::Load, level, reason, remedy, rise: Some(rise) });
        } else if dip > speed {
            notes.push(format!(
                "at {level} pu, {reason}: it falls through zero speed, where the estimate depends on R_s"
            ));
        }
    }
    (limits, notes)
}

/// Other remedies for a dip that is `excess` times too large, where they do not raise the gain of the start too far.
fn others(data: &Data, bandwidths: &Bandwidths, excess: f64, flux_observer: bool) -> String {
    let (w_s, rho) = (excess * bandwidths.speed.value, bandwidths.observer.value);
    let faster = (3.0 * w_s).max(rho);
    let calm = |rho: f64, w_s: f64| flux_observer || gain_per_bandwidth(data, rho) * w_s <= GREATEST_GAIN;
    let by_speed = (faster <= FASTEST.max(rho) && calm(faster, w_s))
        .then(|| format!(", or set bandwidth.speed to {w_s:.0} rad/s and bandwidth.observer to {faster:.0} rad/s"));
    let by_inertia = calm(rho, w_s).then(|| {
        let J = excess * data.mechanics.J.get_ref();
        format!(", or count the load's inertia in mechanics.J: {J:.2e} kg.m2 would hold")
    });
    by_speed.unwrap_or_default() + &by_inertia.unwrap_or_default()
}

fn starts(data: &Data, bandwidths: &Bandwidths, flux_observer: bool) -> Vec<Limit> {
    let limit = |level, reason: &str, remedy: &str| Limit {
        what: What::Start,
        level,
        reason: reason.to_owned(),
        remedy: remedy.to_owned(),
        rise: None,
    };
    if flux_observer {
        let margin = resistance_margin(data);
        if margin >= LEAST_MARGIN {
            return Vec::new();
        }
        let reason = format!(
            "at rest, the estimate leaves the rotor unless R_s is known to {:.1} %: (R - R^) i_0 / psi_M against \
             sqrt(n_p K i_0 / J)",
            100.0 * margin
        );
        return LEVELS.map(|level| limit(level, &reason, "lower mechanics.J, or start with a sensor")).into();
    }
    let rho = bandwidths.observer.value;
    let gain = gain_per_bandwidth(data, rho) * bandwidths.speed.value;
    if gain <= GREATEST_GAIN {
        return Vec::new();
    }
    let reason = format!(
        "the speed loop acts on the estimate through (L_q - L_d) p i_q with the gain J w_s (L_q - L_d) rho^2 / (K n_p w psi_M) \
         = {gain:.0}, more than {GREATEST_GAIN}"
    );
    let remedy = format!("lower bandwidth.speed to {:.3} rad/s", bandwidths.speed.value * GREATEST_GAIN / gain);
    vec![limit(LEVELS[0], &reason, &remedy)]
}
