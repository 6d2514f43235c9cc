//! Detects a lost rotor from the voltage that it needs and from the speed that it does not reach.
//!
//! # Voltage
//! psi^ = e^{j theta^} (L e^{-j theta^} i + psi_M) is the flux linkage of a rotor at the estimated angle with the
//! measured current. Over the last interval, `epsilon = u - R (i[k-1] + i[k]) / 2 - (psi^[k] - psi^[k-1]) / T_s` is
//! zero if the estimate and the machine values are correct, with any injection. A rotor at another angle leaves j w
//! psi_M (e^{j theta} - e^{j theta^}), with magnitude 2 sin(theta~/2) |w| psi_M; a wrong speed leaves the difference of
//! the two back EMFs. A rotor that slips turns its EMF in the estimated frame: there the mean of epsilon is only the EMF of the
//! frame, and the mean square contains both, psi_M^2 (w^2 + w^^2). So epsilon is transformed to the estimated frame, smoothed,
//! and the quotient is
//!
//! ```text
//! min over dR of sqrt(mean |epsilon - dR i|^2) / (lock.u + 2 sin(lock.angle / 2) psi_M mean |w^|),  |dR| <= 0.3 R^
//! ```
//!
//! dR represents the part that a constant error of the resistance explains. The smoothing, 50 Hz or 4 lock.u / psi_M,
//! hides no relevant slip: above that frequency, the EMF of a rotor that turns with the slip still reaches 4 lock.u. A frame that
//! turns by more than pi / 2 in a sample follows no rotor: the quotient is 10.
//!
//! Near standstill the EMF is smaller than (R - R^) i and carries no information. There, the speed is used instead:
//!
//! # Speed
//! A rotor that turns with the estimated frame but not at the reference is lost, as the estimate itself reveals. The
//! speed error x, smoothed at 7 Hz, is the distance of the frame's speed from the reference, or from a model of it, whichever
//! is closer. The model lags by (1 - b) t_is / w_s, the share that the set-point weight leaves to the integral part, and
//! changes no faster than with half of the available torque:
//!
//! ```text
//! S = (1 / S_0) int |x| dt     while |x| > w_0 + 5 % of the reference + f; otherwise S decays with 8 lock.time
//! S_0 = 1.6 n_p i_max / K_i,   w_0 = n_p i_max / (K_i 60 lock.time)
//! ```
//!
//! f is the distance of w^ from the frame's speed, at most 20 % of the reference: an estimator that takes the speed from the
//! EMF is off by the error of psi_M, and so is the speed loop.
//!
//! n_p i_max / K_i is the error integral that takes the speed loop from zero torque to its limit. A load within the drive's
//! torque needs no more, so no load step, abrupt or gradual, reaches S = 1; a persistent error does. S is at most 2, and 0
//! while the EMF confirms the angle: psi_M |w^| > 2 lock.u and a quotient below 0.5; then the drive misses the speed because it
//! is at its limit.
//!
//! A drive at its limit does not swing. So half-waves about reference and model of w^, as far as the torque that the limits leave
//! moves the rotor, count, confirmed or not: W is the sum of their |x| over S_0 while |x| > 1.4 lock.u / psi_M,
//! which is 5 % of the rated speed with the lock.u of `fmu tune`, each
//! half-wave as far as the one before reached, which had the other sign; W decays with 20 lock.time and is at most 2. A load step and
//! its overshoot are one half-wave and a small one.
//!
//! There is no x in torque mode, where a rotor may swing with its load; the voltage detects an estimate that does not follow.
//!
//! The maximum of the quotient, S and W, smoothed with lock.time, is the output `lock_lost`: 0 means that the estimate
//! fits, 1 and above that it is lost; the maximum is 10. It does not depend on the estimator.
//!
//! `lock.u` covers the errors that remain with a good estimate: the residue of (R - R^) i, and for the dead time 4/3 of a leg's
//! voltage. A smaller value detects more if the machine values are accurate.
//!
//! Limits: a rotor that is blocked, or loaded beyond the torque, near standstill is reported as lost: the current is at
//! its limit and the speed is not reached in both cases. At |w| psi_M < lock.u / 2, a rotor at a wrong angle that
//! still turns at the reference is not detected; at standstill without a change of current, it cannot be.
//!
//! The voltage is derived here from Kim & Sul 2011, eq (1), the speed from the PI speed loop; for every estimator.
//! u in V, psi in Wb, theta in rad, w in rad/s (electrical).

use crate::estimator::Sample;
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::math::{at_least, at_most, exp, sin_cos, within};
use drive_base::motor::Motor;
use fmu_core::unit::{RADIAN, SECOND, VOLT};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Maximum value, also reported by a controller that had to restart.
pub const LOST: f64 = 10.0;
/// Bandwidth in rad/s of the smoothing of the voltage.
const FILTER: f64 = TAU * 50.0;
/// Bandwidth in rad/s of the smoothing of the speed error: an injection turns current noise into a noisy speed.
const SMOOTH: f64 = TAU * 7.0;
/// Minimum bandwidth of the voltage, in units of lock.u / psi_M: the EMF of a rotor that turns backwards faster than this still
/// counts.
const SLIP: f64 = 4.0;
/// Bandwidth in rad/s of the powers.
const MEAN: f64 = TAU * 8.0;
/// Maximum turn of the frame in a sample in rad.
const FASTEST: f64 = 0.5 * PI;
/// Half of a swing that counts, in units of lock.u / psi_M.
const SWING: f64 = 1.4;
/// Share of R^ by which the resistance may be wrong before the voltage indicates it.
const RESISTANCE: f64 = 0.3;
/// S_0 in units of the speed loop's error integral.
const MARGIN: f64 = 1.6;
/// Share of the reference by which the speed may be off.
const SPEED: f64 = 0.05;
/// Share of the reference explained by an error of psi_M if the estimated speed differs from the frame's.
const FLUX: f64 = 0.2;

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

/// Limits of the speed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Integral of the electrical speed error in rad that takes it from zero torque to its limit.
    pub integral: f64,
    /// Electrical acceleration in rad/s2 caused by a torque of 1 N.m.
    pub acceleration: f64,
    /// Lag of the speed behind a moving reference in s, due to the set-point weight.
    pub lag: f64,
}

/// Gains computed from the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LockGains {
    filter: f64,
    /// Smoothing of the powers.
    mean: f64,
    /// Smoothing of the speed error.
    smooth: f64,
    level: f64,
    u: f64,
    /// Voltage per speed in Wb.
    psi: f64,
    /// 1/T_s in 1/s.
    rate: f64,
    /// w_0 in rad/s.
    w_0: f64,
    /// T_s / S_0 in 1/rad.
    integrates: f64,
    /// Decay of S in a sample.
    decays: f64,
    /// Change of the reference model per sample in rad/s, for each N.m of available torque.
    follows: f64,
    /// The model's approach to the reference in a sample.
    lags: f64,
    /// Half of the swing in rad/s that counts.
    swing: f64,
    /// Decay of the swings in a sample.
    forgets: f64,
}

impl LockGains {
    /// For the machine estimates `motor`, the sample period `T_s` (s) and the speed loop's `reach`.
    pub fn new(par: &LockParameters, motor: &Motor, T_s: f64, reach: Reach) -> Self {
        Self {
            filter: 1.0 - exp(-(FILTER.max(SLIP * par.u / motor.psi_M)) * T_s),
            mean: 1.0 - exp(-MEAN * T_s),
            smooth: 1.0 - exp(-SMOOTH * T_s),
            level: 1.0 - exp(-T_s / par.time),
            u: par.u,
            psi: 2.0 * sin_cos(0.5 * par.angle).0 * motor.psi_M,
            rate: 1.0 / T_s,
            w_0: reach.integral / (60.0 * par.time),
            integrates: T_s / (MARGIN * reach.integral),
            decays: 1.0 - exp(-T_s / (8.0 * par.time)),
            follows: 0.5 * reach.acceleration * T_s,
            lags: T_s / (T_s + reach.lag),
            swing: SWING * par.u / motor.psi_M,
            forgets: 1.0 - exp(-T_s / (20.0 * par.time)),
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
    /// Means of |e|^2 in V2, of e . i in V.A and of |i|^2 in A2.
    powers: [f64; 3],
    /// Mean of |w^| in rad/s.
    w: f64,
    /// The output.
    level: f64,
    following: Following,
}

/// Whether the frame's speed follows the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Following {
    /// d axis at the last sample.
    d: AlphaBeta,
    /// Model of the reference in rad/s.
    w_m: f64,
    /// Estimated speed in rad/s as far as the drive's torque moves the rotor.
    w_r: f64,
    /// Estimated speed minus the frame's speed in rad/s, smoothed.
    apart: f64,
    /// Speed of the frame less the reference in rad/s, smoothed.
    off: f64,
    /// Speed of the frame less the model in rad/s, smoothed.
    off_m: f64,
    /// Integral of the speed error as a share of S_0.
    S: f64,
    /// Half-waves of a swing: the present one (signed) and the last one as shares of S_0, and their combined result.
    half: f64,
    last: f64,
    W: f64,
}

impl Following {
    /// S after a sample with the d axis at `d` and the reference `w_ref` (rad/s), none in torque mode; 0 if the EMF has
    /// `confirmed` the angle.
    #[inline]
    fn update(
        &mut self,
        gains: &LockGains,
        d: AlphaBeta,
        (w_hat, w_ref): (f64, Option<f64>),
        tau: f64,
        confirmed: bool,
    ) -> f64 {
        let w = self.d.cross(d) * gains.rate;
        self.d = d;
        let Some(w_ref) = w_ref else { return 0.0 };
        self.w_m += within((w_ref - self.w_m) * gains.lags, gains.follows * tau);
        let (high, low) = (at_least(w_ref, self.w_m), at_most(w_ref, self.w_m));
        self.w_r += within(w_hat - self.w_r, 2.0 * gains.follows * tau);
        self.swings(gains, at_least(self.w_r - high, 0.0) + at_most(self.w_r - low, 0.0));
        self.off += (w - w_ref - self.off) * gains.smooth;
        self.off_m += (w - self.w_m - self.off_m) * gains.smooth;
        self.apart += (w_hat - w - self.apart) * gains.smooth;
        let x = at_least(at_most(self.off, self.off_m), -at_least(self.off, self.off_m));
        if confirmed {
            self.S = 0.0;
        } else if x > gains.w_0 + SPEED * w_ref.abs() + at_most(self.apart.abs(), FLUX * w_ref.abs()) {
            self.S = at_most(self.S + gains.integrates * x, 2.0);
        } else {
            self.S -= self.S * gains.decays;
        }
        at_least(self.S, self.W)
    }

    /// Adds half-waves of the speed error `x` (rad/s), each limited to the size of the previous one.
    #[inline]
    fn swings(&mut self, gains: &LockGains, x: f64) {
        self.W -= self.W * gains.forgets;
        if x.abs() > gains.swing {
            if self.half * x < 0.0 {
                (self.last, self.half) = (self.half.abs(), 0.0);
            }
            let part = gains.integrates * x;
            self.half += part;
            if self.half.abs() < self.last {
                self.W = at_most(self.W + part.abs(), 2.0);
            }
        }
    }
}

impl Lock {
    /// Clearly lost.
    pub fn lost() -> Self {
        Self { level: LOST, ..Self::default() }
    }

    /// Voltage in V that the estimate does not explain with any resistance.
    pub fn voltage(&self) -> f64 {
        self.powers[0].sqrt()
    }

    /// `lock_lost` after a sample with the estimated frame on `axis`, turning at `w` (rad/s) with the reference `w_ref`
    /// (rad/s), none in torque mode; `R_s` (Ohm) is the resistance that the estimator uses, `tau` (N.m) the torque that the limits
    /// leave.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "as for `SensorlessController::cycle`")]
    pub fn update(
        &mut self,
        gains: &LockGains,
        motor: &Motor,
        R_s: f64,
        sample: &Sample,
        axis: Axis<Estimated>,
        (w, w_ref, tau): (f64, Option<f64>, f64),
    ) -> f64 {
        let i = axis.from_stator(sample.i);
        let psi = DqHat::new(motor.L_d * i.d() + motor.psi_M, motor.L_q * i.q());
        if self.started {
            let resistive = (sample.i_last + sample.i) * (0.5 * R_s);
            let epsilon = axis.from_stator(sample.u - resistive + self.psi * gains.rate) - psi * gains.rate;
            self.e += (epsilon - self.e) * gains.filter;
            self.w += (w.abs() - self.w) * gains.mean;
            for (mean, now) in self.powers.iter_mut().zip([self.e.dot(self.e), self.e.dot(i), i.dot(i)]) {
                *mean += (now - *mean) * gains.mean;
            }
            let [e, ei, ii] = self.powers;
            // The resistance error that explains the most; the tiny current avoids 0/0.
            let dR = within(ei / (ii + 1e-12), RESISTANCE * R_s);
            let left = at_least(e - dR * (2.0 * ei - dR * ii), 0.0);
            let quotient = at_most(left.sqrt() / (gains.u + gains.psi * self.w), LOST);
            let confirmed = quotient < 0.5 && motor.psi_M * w.abs() > 2.0 * gains.u;
            // A frame that turns by a quarter in a sample follows no rotor.
            let quotient = if w.abs() > FASTEST * gains.rate { LOST } else { quotient };
            let level = at_least(quotient, self.following.update(gains, axis.along(1.0), (w, w_ref), tau, confirmed));
            self.level += (level - self.level) * gains.level;
        }
        (self.started, self.psi) = (true, axis.to_stator(psi));
        self.level
    }
}

type P = Row<LockParameters>;

/// The variables; their owner supplies the prefix `lock.`.
pub const LOCK: &Table<LockParameters> = table![
    P::parameter("u", &VOLT, "Voltage error tolerated before lock_lost rises", |p| &mut p.u).above(0.0),
    P::parameter("angle", &RADIAN, "Angle error at which lock_lost is 1, where the back EMF shows it", |p| {
        &mut p.angle
    })
    .above(0.0)
    .at_most(PI),
    P::parameter("time", &SECOND, "Time constant of lock_lost", |p| &mut p.time).above(0.0),
];

#[cfg(test)]
mod tests;
