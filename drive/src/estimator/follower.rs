//! What voltage model and current model share: parameters, and the frame that turns at a calculated speed.
//!
//! The speed comes from the q row, smoothed by a low-pass; the angle follows it and is drawn by the d row's error e:
//! theta' = w + x + rho e, x' = rho^2/4 e. Without the integral x a bias of the speed becomes an angle error bias / rho:
//! L_q + 20 % then loses the drive at half the rated speed. Both poles of the angle are at -rho/2.

use crate::estimator::Context;
use crate::estimator::emf::Direction;
use fmu_core::unit::RAD_PER_S;
use fmu_core::{Row, Table};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Greatest angle error in rad that is passed on.
const CLIP: f64 = 0.5;

/// The parameters with the prefix `matsui.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatsuiParameters {
    /// Gain rho of the angle in rad/s, > 0.
    pub bandwidth: f64,
    /// Bandwidth of the speed's low-pass in rad/s, > 0.
    pub filter: f64,
    /// With the integral.
    pub integral: bool,
}

impl Default for MatsuiParameters {
    fn default() -> Self {
        Self { bandwidth: TAU * 15.0, filter: TAU * 50.0, integral: true }
    }
}

/// State at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Follower {
    /// Electrical angle at this sample in rad, not wrapped.
    pub theta: f64,
    /// Electrical angle at the last sample in rad.
    pub theta_last: f64,
    /// Smoothed speed of the q row in rad/s.
    pub w: f64,
    /// Integral of the angle error in rad/s: what w lacks.
    pub x: f64,
    /// Speed of the frame to the next sample in rad/s.
    w_frame: f64,
    direction: Direction,
}

impl Follower {
    /// At the electrical angle `theta` (rad), turning at `w` (rad/s).
    pub fn at(theta: f64, w: f64, T_s: f64) -> Self {
        Self { theta, theta_last: theta - T_s * w, w, x: 0.0, w_frame: w, direction: Direction::of(w) }
    }

    /// To the next sample: first thing in an update.
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

    /// Corrects by the voltage -w psi_M sin theta~ (V) that the d row shows.
    #[inline]
    pub fn correct(&mut self, context: &Context, e_d: f64) {
        let par = &context.par.matsui;
        let s = self.direction.update(self.w, context.par.emf.w_sign);
        let e = -s * e_d / (context.motor.psi_M * self.w.abs().max(context.par.emf.w_sign));
        let e = e.clamp(-CLIP, CLIP);
        if par.integral {
            self.x += context.T_s * 0.25 * par.bandwidth * par.bandwidth * e;
        }
        self.w_frame = self.w + self.x + par.bandwidth * e;
    }
}

type P = Row<MatsuiParameters>;

/// The variables; their owner gives the prefix `matsui.`.
pub const MATSUI: &Table<MatsuiParameters> = &Table::new(
    const {
        &[
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
                "Integrate the angle error, so that a speed bias causes no angle error; false: as printed",
                |p| &mut p.integral,
            ),
        ]
    },
);
