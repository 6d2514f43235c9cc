//! Rasmussen's flux observer with speed adaptation, eq (21), and with zeta = 0 its integral form (16).
//!
//! In the estimated rotor frame: psi_r^ = psi_s^ - L i, d psi_s^/dt = u - R i + v - j w^ psi_s^,
//! v = -c_1 (psi_rd^ - psi_M) - j c_2 psi_rq^, w^ = g_1 psi_rq^ + g_2 int psi_rq^ dt, d theta^/dt = w^.
//! The j on c_2 is missing in the text before (7) of the paper; (7), (16) and (21) have it.
//!
//! Gains by the poles of the speed adaptation: g_2 = w_n^2 / psi_M, g_1 = 2 zeta w_n / psi_M.
//!
//! Sampled without bias: psi_s^ is kept in stator axes, where nothing turns,
//! psi_s[k] = psi_s[k-1] + T_s (u - R (i[k-1] + i[k]) / 2 + v[k-1] e^{j (theta^[k-1] + w^ T_s / 2)}),
//! theta^[k] = theta^[k-1] + T_s w^[k-1]. Forward Euler in the estimated frame would be biased by w T_s / 2 (1.4 deg at
//! 1500 rpm and 10 kHz), the newest command instead of the one that acted by w T_s.
//!
//! Limits: at w = 0 the angle is not observable (the slow pole is -w^2/c_1 below |w| = c_1/2); a resistance estimate
//! above the true one runs away at standstill, one below it is the safe side.

use crate::estimator::{Estimate, Sample};
use crate::frame::{AlphaBeta, Axis, DqHat, Estimated};
use crate::motor::Motor;
use fmu_core::unit::{ONE, PER_SECOND, RAD_PER_S};
use fmu_core::{Row, Table};
use serde::{Deserialize, Serialize};

/// Parameters of the observer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RasmussenParameters {
    /// Feedback of the d flux error in 1/s, >= 0.
    pub c_1: f64,
    /// Feedback of the q flux in 1/s, >= 0.
    pub c_2: f64,
    /// Natural frequency of the speed adaptation in rad/s, > 0.
    pub w_n: f64,
    /// Damping of the speed adaptation, >= 0; 0 is the integral form (16).
    pub zeta: f64,
}

impl Default for RasmussenParameters {
    fn default() -> Self {
        Self { c_1: 50.0, c_2: 1.0, w_n: 300.0, zeta: 1.0 }
    }
}

/// State of the observer at the last sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rasmussen {
    /// Estimated stator flux linkage in Wb.
    psi_s: AlphaBeta,
    /// Feedback v in V.
    v: DqHat,
    /// Measured current in A.
    i: AlphaBeta,
    /// Integral part of the speed in rad/s, electrical.
    w_i: f64,
    /// Estimated electrical angle in rad, not wrapped.
    theta: f64,
    /// Estimated electrical speed in rad/s.
    w: f64,
}

impl Rasmussen {
    /// The observer at its first sample: the magnet's flux on the estimated d axis, standing still at `theta` (rad).
    pub fn start(motor: &Motor, theta: f64, i: AlphaBeta) -> Self {
        let axis = Axis::<Estimated>::at(theta);
        let psi_s = axis.to_stator(DqHat::new(motor.psi_M, 0.0) + inductive(motor, axis.from_stator(i)));
        Self { psi_s, i, theta, ..Self::default() }
    }

    /// The estimate at the last sample.
    pub fn estimate(&self) -> Estimate {
        Estimate { theta: self.theta, w: self.w }
    }

    /// One sample of `T_s` (s).
    #[inline]
    pub fn update(&mut self, par: &RasmussenParameters, motor: &Motor, sample: &Sample, T_s: f64) -> Estimate {
        let half_way = Axis::<Estimated>::at(self.theta + 0.5 * T_s * self.w);
        let resistive = (self.i + sample.i) * (0.5 * motor.R_s);
        self.psi_s += (sample.u - resistive + half_way.to_stator(self.v)) * T_s;
        self.i = sample.i;
        self.theta += T_s * self.w;

        let axis = Axis::<Estimated>::at(self.theta);
        let psi_r = axis.from_stator(self.psi_s) - inductive(motor, axis.from_stator(sample.i));
        let g_2 = par.w_n * par.w_n / motor.psi_M;
        let g_1 = 2.0 * par.zeta * par.w_n / motor.psi_M;
        self.w_i += T_s * g_2 * psi_r.q();
        self.w = g_1 * psi_r.q() + self.w_i;
        self.v = DqHat::new(-par.c_1 * (psi_r.d() - motor.psi_M), -par.c_2 * psi_r.q());
        self.estimate()
    }
}

/// L i in Wb.
#[inline]
fn inductive(motor: &Motor, i: DqHat) -> DqHat {
    DqHat::new(motor.L_d * i.d(), motor.L_q * i.q())
}

type P = Row<RasmussenParameters>;

/// The observer's variables; their owner gives the prefix `observer.`.
pub const OBSERVER: &Table<RasmussenParameters> = &Table::new(
    const {
        &[
            P::parameter("c_1", &PER_SECOND, "Feedback of the d flux error, eq (21)", |p| &mut p.c_1).at_least(0.0),
            P::parameter("c_2", &PER_SECOND, "Feedback of the q flux, eq (21)", |p| &mut p.c_2).at_least(0.0),
            P::parameter("w_n", &RAD_PER_S, "Natural frequency of the speed adaptation", |p| &mut p.w_n).above(0.0),
            P::parameter("zeta", &ONE, "Damping of the speed adaptation; 0 is the integral form (16)", |p| &mut p.zeta)
                .at_least(0.0),
        ]
    },
);
