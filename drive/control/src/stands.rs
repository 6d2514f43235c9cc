//! Torque mode: detects a requested torque without a motion that the estimate can show.
//!
//! A resistance that is off by dR hides a rotor whose back EMF is below |dR| i: the estimated frame stands still or creeps while
//! the rotor moves, the current acts on the wrong axis, and the torque differs from the reference (for the threshold see
//! [`rasmussen`](crate::estimator::rasmussen) and [`flux_observer`](crate::estimator::flux_observer)). The controller cannot
//! distinguish such a rotor from a blocked one. It counts the time t in which
//!
//! ```text
//! |tau| > 2 % of the limit        psi_M |w^| < 0.3 R^ |i|        w^ smoothed over 0.3 s
//! ```
//!
//! or, where `emf.hold_reversal` leads a method with a back EMF through zero, |w^| < w_hold / 4, where little of its gain
//! remains. It warns once after 1 s, and after as long as the inertia needs: t |tau| / J = 2 w_s, w_s = 0.3 R^ |i| / (n_p psi_M).
//! A rotor that receives the whole torque exceeds w_s within this time.
//!
//! Derived here. tau in N.m, w in rad/s (electrical), w_s in rad/s (mechanical).

use crate::estimator::Class;
use crate::tables::ControllerParameters;
use drive_base::frame::DqHat;
use serde::{Deserialize, Serialize};

/// Share of R^ by which the resistance may be wrong, as in `lock_lost`.
const RESISTANCE: f64 = 0.3;
/// Speed as a share of `emf.w_hold` below which little of the angle's gain remains.
const FADED: f64 = 0.25;
/// Minimum torque as a share of the limit.
const LITTLE: f64 = 0.02;
/// Time constant of the speed in s.
const SMOOTH: f64 = 0.3;
/// Minimum time in s.
const SHORTEST: f64 = 1.0;
/// Time in s after which a warning is not repeated.
const SAID: f64 = 0.5;

/// State at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Stands {
    /// Time in s.
    time: f64,
    /// Magnitude of the torque reference in N.m.
    tau: f64,
    /// Mechanical speed in rad/s that the resistance may hide.
    hidden: f64,
    /// Estimated mechanical speed in rad/s, smoothed, because a rotor out of step with the frame swings.
    speed: f64,
}

impl Stands {
    /// After a sample with the references `i` (A) at the estimated mechanical `speed` (rad/s), with `most` (N.m) available within
    /// the limits; `works`: no start sequence is running.
    #[inline(never)]
    pub(crate) fn update(&mut self, par: &ControllerParameters, works: bool, speed: f64, i: DqHat, most: f64) {
        let motor = &par.motor;
        let tau = motor.torque(i.d(), i.q()).abs();
        let emf = &par.estimators.emf;
        let faded = if par.estimator.class() == Class::BackEmf && emf.hold_reversal { FADED * emf.w_hold } else { 0.0 };
        let hidden = (RESISTANCE * motor.R_s * i.magnitude() / motor.psi_M).max(faded) / f64::from(motor.n_p);
        let speed = self.speed + (speed - self.speed) * (par.T_s / (par.T_s + SMOOTH));
        let time = if works && tau > LITTLE * most && speed.abs() < hidden { self.time + par.T_s } else { 0.0 };
        *self = Self { time, tau, hidden, speed };
    }

    /// The time in s without motion, once it is long enough for the warning.
    pub(crate) fn reached(&self, par: &ControllerParameters) -> Option<f64> {
        let knows = matches!(par.estimator.class(), Class::FluxObserver | Class::BackEmf);
        let after = SHORTEST.max(2.0 * self.hidden * par.J / self.tau);
        (knows && self.time >= after && self.time < after + SAID).then_some(self.time)
    }
}

/// The warning of a torque reference (N.m) without motion for a `time` (s); `speed_est` in rad/s.
pub(crate) fn hidden(par: &ControllerParameters, tau_ref: f64, speed_est: f64, time: f64) -> String {
    format!(
        "tau_ref = {tau_ref} N.m has moved nothing for {time:.1} s that the estimate can show: speed_est = {speed_est:.3} rad/s; the shaft is \
         blocked or takes the torque, or motor.R_s = {} Ohm does not fit the machine and hides the rotor, and the torque is not tau_ref",
        par.motor.R_s
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::Kind;

    /// Time counts below 0.3 R^ |i| / (n_p psi_M), or below w_hold / 4 where `emf.hold_reversal` leads the extended EMF through zero.
    #[test]
    fn a_faded_emf_counts_as_no_speed() {
        let counts = |estimator: Kind, hold: bool, speed: f64| {
            let mut par = ControllerParameters { estimator, ..ControllerParameters::default() };
            (par.estimators.emf.hold_reversal, par.estimators.emf.w_hold) = (hold, 240.0);
            let mut stands = Stands::default();
            for _ in 0..20_000 {
                stands.update(&par, true, speed, DqHat::new(0.0, 2.0), 4.0);
            }
            stands.time > 1.0
        };
        // 0.3 * 1.8 Ohm * 2 A / (3 * 0.15 Wb) = 2.4 rad/s; 240 / 4 / 3 = 20 rad/s.
        for (estimator, hold, last) in
            [(Kind::ExtendedEmf, true, 20.0), (Kind::ExtendedEmf, false, 2.4), (Kind::Rasmussen, true, 2.4)]
        {
            assert!(counts(estimator, hold, 0.95 * last), "{estimator:?}, {hold}");
            assert!(!counts(estimator, hold, 1.05 * last), "{estimator:?}, {hold}");
        }
    }
}
