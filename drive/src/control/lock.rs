//! Detects a lost rotor: compares the applied voltage with the voltage that a machine at the estimate would need.
//!
//! psi^ = e^{j theta^} (L e^{-j theta^} i + psi_M) is the flux linkage of a rotor at the estimated angle with the
//! measured current. Over the last interval, `epsilon = u - R (i[k-1] + i[k]) / 2 - (psi^[k] - psi^[k-1]) / T_s` is
//! zero if the estimate and the machine values are correct, with any injection. A rotor at another angle leaves j w
//! psi_M (e^{j theta} - e^{j theta^}), with magnitude 2 sin(theta~/2) |w| psi_M; a wrong speed leaves the difference of
//! the two back EMFs. epsilon is transformed to the estimated frame, smoothed at 50 Hz, and divided by lock.u + 2
//! sin(lock.angle / 2) psi_M |w^|. The quotient, smoothed with lock.time, is the output `lock_lost`: 0 means that the
//! estimate fits, 1 and above that it is lost; the maximum is 10. It does not depend on the estimator, so it is the
//! same for all of them.
//!
//! `lock.u` covers the errors that remain with a good estimate: (R - R^) i, and for the dead time 4/3 of a leg's
//! voltage. A smaller value detects more if the machine values are accurate.
//! Limits: only the back EMF reveals an angle error. Below |w| psi_M = lock.u / 2, nothing reveals a lost rotor; this
//! includes the creep of a Rasmussen observer with R^ > R.
//!
//! Derived here from Kim & Sul 2011, eq (1), for all estimators alike. u in V, psi in Wb, theta in rad, w in rad/s
//! (electrical).

use crate::estimator::Sample;
use crate::frame::{AlphaBeta, Axis, DqHat, Estimated};
use crate::math::{exp, sin_cos};
use crate::motor::Motor;
use fmu_core::unit::{RADIAN, SECOND, VOLT};
use fmu_core::{Row, Table};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Maximum value, also reported by a controller that had to restart.
pub const LOST: f64 = 10.0;
/// Bandwidth in rad/s of the voltage smoothing.
const FILTER: f64 = TAU * 50.0;

/// The parameters with the prefix `lock.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LockParameters {
    /// Tolerated voltage error in V, > 0.
    pub u: f64,
    /// Angle error in rad at which the lock counts as lost, if the back EMF reveals it, > 0.
    pub angle: f64,
    /// Time constant of the output in s, > 0.
    pub time: f64,
}

impl Default for LockParameters {
    fn default() -> Self {
        Self { u: 5.0, angle: PI / 6.0, time: 0.05 }
    }
}

/// Gains computed from the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LockGains {
    filter: f64,
    level: f64,
    u: f64,
    /// Voltage per speed in Wb.
    psi: f64,
    /// 1/T_s in 1/s.
    rate: f64,
}

impl LockGains {
    /// For the machine estimates `motor` and the sample period `T_s` (s).
    pub fn new(par: &LockParameters, motor: &Motor, T_s: f64) -> Self {
        Self {
            filter: 1.0 - exp(-FILTER * T_s),
            level: 1.0 - exp(-T_s / par.time),
            u: par.u,
            psi: 2.0 * sin_cos(0.5 * par.angle).0 * motor.psi_M,
            rate: 1.0 / T_s,
        }
    }
}

/// State at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lock {
    /// Whether a sample has been taken.
    started: bool,
    /// Flux linkage of a rotor at the estimate in Wb.
    psi: AlphaBeta,
    /// Smoothed voltage in V.
    e: DqHat,
    /// The output.
    level: f64,
}

impl Lock {
    /// Clearly lost.
    pub fn lost() -> Self {
        Self { level: LOST, ..Self::default() }
    }

    /// `lock_lost` after a sample with the estimated frame on `axis`, turning at `w` (rad/s).
    #[inline]
    pub fn update(&mut self, gains: &LockGains, motor: &Motor, sample: &Sample, axis: Axis<Estimated>, w: f64) -> f64 {
        let i = axis.from_stator(sample.i);
        let psi = axis.to_stator(DqHat::new(motor.L_d * i.d() + motor.psi_M, motor.L_q * i.q()));
        if self.started {
            let resistive = (sample.i_last + sample.i) * (0.5 * motor.R_s);
            let epsilon = sample.u - resistive - (psi - self.psi) * gains.rate;
            self.e += (axis.from_stator(epsilon) - self.e) * gains.filter;
            let quotient = (self.e.magnitude() / (gains.u + gains.psi * w.abs())).min(LOST);
            self.level += (quotient - self.level) * gains.level;
        }
        (self.started, self.psi) = (true, psi);
        self.level
    }
}

type P = Row<LockParameters>;

/// The variables; their owner supplies the prefix `lock.`.
pub const LOCK: &Table<LockParameters> = &Table::new(
    const {
        &[
            P::parameter("u", &VOLT, "Voltage error tolerated before lock_lost rises", |p| &mut p.u).above(0.0),
            P::parameter("angle", &RADIAN, "Angle error at which lock_lost is 1, where the back EMF shows it", |p| {
                &mut p.angle
            })
            .above(0.0)
            .at_most(PI),
            P::parameter("time", &SECOND, "Time constant of lock_lost", |p| &mut p.time).above(0.0),
        ]
    },
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Dq, Rotor};
    use crate::plant::machine::flux;

    const T_S: f64 = 1e-4;

    /// `lock_lost` for an estimate `theta_tilde` (rad) off a loaded rotor turning at `w` (rad/s), estimated as `w_hat`.
    fn beside(theta_tilde: f64, w: f64, w_hat: f64) -> f64 {
        let (motor, i) = (Motor { L_q: 9e-3, ..Motor::default() }, Dq::new(-1.0, 4.0));
        let gains = LockGains::new(&LockParameters { u: 1e-9, ..LockParameters::default() }, &motor, T_S);
        let at = |theta: f64, v: Dq| -> AlphaBeta { Axis::<Rotor>::at(theta).to_stator(v) };
        let (mut lock, mut level) = (Lock::default(), 0.0);
        for k in 0..10_000 {
            let (t, last) = (T_S * f64::from(k), T_S * f64::from(k - 1));
            let (i_now, i_last) = (at(w * t, i), at(w * last, i));
            let u = (at(w * t, flux(&motor, i)) - at(w * last, flux(&motor, i))) * (1.0 / T_S)
                + (i_now + i_last) * (0.5 * motor.R_s);
            let sample = Sample { i: i_now, i_last, u, ..Sample::default() };
            level = lock.update(&gains, &motor, &sample, Axis::at(w_hat * t - theta_tilde), w_hat);
        }
        level
    }

    #[test]
    fn an_angle_error_is_measured_by_the_emf() {
        assert!(beside(0.0, 300.0, 300.0) < 1e-9);
        // Without saliency it would be exactly 1; here (L_q - L_d) i adds to the back EMF.
        for (degrees, expected) in [(-30.0_f64, 1.0), (30.0, 1.0), (180.0, 1.0 / 15.0_f64.to_radians().sin())] {
            let level = beside(degrees.to_radians(), -300.0, -300.0);
            assert!((level / expected - 1.0).abs() < 0.1, "{degrees} deg: {level}");
        }
    }

    #[test]
    fn a_wrong_speed_is_seen() {
        let level = beside(0.0, 0.0, 300.0);
        assert!(level > 1.5, "a rotor at rest, the estimate running: {level}");
        let level = beside(0.0, 300.0, 1.0);
        assert!(level > 5.0, "a rotor that runs, the estimate at rest: {level}");
    }
}
