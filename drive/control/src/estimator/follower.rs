//! The estimator that voltage model and current model share: parameters, and the frame that turns at a calculated speed.
//! A model gives the [`Rows`] of the voltage equation.
//!
//! The speed comes from the q row, smoothed by a low-pass. The angle integrates it, corrected by the d row's error e:
//! theta' = w + x + rho e, x' = rho^2/4 e. Without the integral x, a speed bias becomes an angle error bias / rho: with
//! L_q + 20 %, the drive then loses synchronism at half the rated speed. Both angle poles are at -rho/2.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample};
use crate::estimator::emf::{Direction, EmfParameters};
use crate::estimator::interval::Interval;
use fmu_core::unit::RAD_PER_S;
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::marker::PhantomData;

/// Largest angle error in rad that is passed on.
const CLIP: f64 = 0.5;

/// The parameters with the prefix `matsui.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatsuiParameters {
    /// Angle gain rho in rad/s, > 0.
    pub bandwidth: f64,
    /// Bandwidth of the speed low-pass in rad/s, > 0.
    pub filter: f64,
    /// Uses the integral.
    pub integral: bool,
}

impl Default for MatsuiParameters {
    fn default() -> Self {
        Self { bandwidth: TAU * 15.0, filter: TAU * 50.0, integral: true }
    }
}

/// Both rows of the machine's voltage equation in the estimated frame.
pub trait Rows<All> {
    /// Smooths the electrical speed `w` (rad/s) with the speed of the q row, and returns the voltage -w psi_M sin theta~ (V) of
    /// the d row. `slip` is the frame-speed term in rad/s.
    fn rows(w: &mut f64, context: &ContextOf<All>, x: &Interval, slip: f64) -> f64;
}

/// State at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Follower<R> {
    /// Electrical angle at this sample in rad, not wrapped.
    pub theta: f64,
    /// Electrical angle at the last sample in rad.
    pub theta_last: f64,
    /// Smoothed speed from the q row in rad/s.
    pub w: f64,
    /// Integral of the angle error in rad/s: the correction to w.
    pub x: f64,
    /// Frame speed until the next sample in rad/s.
    w_frame: f64,
    direction: Direction,
    model: PhantomData<R>,
}

impl<R: Rows<All>, All: AsRef<MatsuiParameters> + AsRef<EmfParameters>> Estimating<All> for Follower<R> {
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        (Self::at(theta, w, context.T_s), Estimate::new(theta, w, sample))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        self.advance(context.T_s);
        let x = Interval::new(self.theta_last, self.theta, sample, context.T_s);
        let slip = context.of::<EmfParameters>().slip(&x, self.w);
        let e_d = R::rows(&mut self.w, context, &x, slip);
        self.correct(context, e_d);
        Estimate::new(self.theta, self.speed(), sample)
    }
}

impl<R> Follower<R> {
    /// At the electrical angle `theta` (rad), turning at `w` (rad/s).
    pub fn at(theta: f64, w: f64, T_s: f64) -> Self {
        let (theta_last, direction) = (theta - T_s * w, Direction::of(w));
        Self { theta, theta_last, w, x: 0.0, w_frame: w, direction, model: PhantomData }
    }

    /// Advances to the next sample; each update calls this first.
    #[inline]
    pub fn advance(&mut self, T_s: f64) {
        self.theta_last = self.theta;
        self.theta += T_s * self.w_frame;
    }

    /// The best estimate of the electrical speed in rad/s.
    #[inline]
    pub fn speed(&self) -> f64 {
        self.w + self.x
    }

    /// Corrects the state with the voltage -w psi_M sin theta~ (V) from the d row.
    #[inline]
    pub fn correct<All: AsRef<MatsuiParameters> + AsRef<EmfParameters>>(&mut self, context: &ContextOf<All>, e_d: f64) {
        let par = context.of::<MatsuiParameters>();
        let s = self.direction.update(self.w, context.of::<EmfParameters>().w_sign);
        let e = -s * e_d / (context.motor.psi_M * self.w.abs().max(context.of::<EmfParameters>().w_sign));
        let e = e.clamp(-CLIP, CLIP);
        if par.integral {
            self.x += context.T_s * 0.25 * par.bandwidth * par.bandwidth * e;
        }
        self.w_frame = self.w + self.x + par.bandwidth * e;
    }
}

type P = Row<MatsuiParameters>;

/// The variables; their owner adds the prefix `matsui.`.
pub const MATSUI: &Table<MatsuiParameters> = table![
    P::parameter("bandwidth", &RAD_PER_S, "Gain of the angle error in voltage and current model", |p| {
        &mut p.bandwidth
    })
    .above(0.0)
    .tunable(),
    P::parameter("filter", &RAD_PER_S, "Bandwidth of the speed filter in voltage and current model", |p| {
        &mut p.filter
    })
    .above(0.0)
    .tunable(),
    P::boolean_parameter(
        "integral",
        "Integrate the angle error, so that a speed bias causes no angle error; false: as printed, VoltageModel and CurrentModel alone",
        |p| &mut p.integral,
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use drive_base::motor::Motor;

    /// Both poles of the angle are at -rho/2: next to a rotor whose speed is off by dw, the error follows dw t e^{-rho t / 2}.
    #[test]
    fn both_poles_are_at_half_the_gain() {
        let (par, motor, w, off) = (EstimatorParameters::default(), Motor::default(), 300.0, 4.0);
        let (rho, T_s) = (par.matsui.bandwidth, 1e-6);
        let context = ContextOf { par: &par, motor: &motor, J: 1.5e-3, T_s };
        for sign in [1.0, -1.0] {
            let mut follower = Follower::<()>::at(0.0, sign * w, T_s);
            let n = 2.0 / (rho * T_s);
            let (mut theta, mut k) = (0.0, 0.0);
            while k < n {
                follower.advance(T_s);
                theta += T_s * (sign * w + off);
                follower.correct(&context, -sign * w * motor.psi_M * (theta - follower.theta));
                k += 1.0;
            }
            let (t, error) = (k * T_s, theta - follower.theta);
            let expected = off * t * (-0.5 * rho * t).exp();
            assert!((error / expected - 1.0).abs() < 0.01, "{error} rad, not {expected} rad");
            assert!((follower.speed() - follower.w - follower.x).abs() < 1e-12 && follower.x * off > 0.0);
        }
    }
}
