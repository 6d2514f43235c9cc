//! Data shared by the parts of the commissioning: the test conditions and the results of earlier parts.

use super::curve::Curve;
use super::tensor::Tensor;
use drive_base::frame::AlphaBeta;
use serde::{Deserialize, Serialize};

/// Share of I of the alignment.
const ALIGNED: f64 = 0.4;

/// A sample: currents, and the voltage that acted since the last one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sample {
    /// Current in A, less the offsets, at this sample and at the last one.
    pub(super) i: AlphaBeta,
    pub(super) i_last: AlphaBeta,
    /// Command in V that acted between the two.
    pub(super) u: AlphaBeta,
    /// DC-link voltage in V.
    pub(super) u_dc: f64,
}

/// Result of a sample of a part of the sequence.
pub(super) enum Part<T> {
    /// The voltage of this sample in V.
    Voltage(AlphaBeta),
    /// The part is over: 0 V, and the input of the next part.
    Over(T),
}

/// Conditions and findings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Bench {
    /// Sample period, and period of the PWM carrier, in s.
    pub(super) T: f64,
    pub(super) carrier: f64,
    /// Samples from the command to its action.
    pub(super) delay: f64,
    /// Maximum current in A of the commissioning.
    pub(super) I: f64,
    /// u_dc / sqrt 3 at the start in V.
    pub(super) U: f64,
    /// U over the rated electrical speed: the flux linkage lies within 0.25 and 1.15 of it. In Wb.
    pub(super) psi_r: f64,
    /// Standard deviation of a component of the current in A.
    pub(super) sigma: f64,
    /// Smallest inductance in H found by the probe, and the inductance in each direction.
    pub(super) L_c: f64,
    pub(super) tensor: Tensor,
    /// Stator resistance in Ohm, with one transistor; 0: unknown.
    pub(super) R: f64,
    /// Dead-time voltage in V, and the current in A where the line of a leg ends.
    pub(super) u_dead: f64,
    pub(super) i_x: f64,
    pub(super) curve: Curve,
    /// Start values: flux linkage in Wb, and rad/s of a swing about 0.4 I.
    pub(super) psi_0: f64,
    pub(super) w_0: f64,
    /// Current in A of an alignment where 0.4 I turns the magnet away from it, and about the flux linkage in Wb by that; 0: it
    /// does not.
    pub(super) i_0: f64,
    pub(super) psi_1: f64,
    /// The rotor does not turn.
    pub(super) blocked: bool,
    /// Number of pole pairs.
    pub(super) n_p: f64,
}

impl Bench {
    /// Bandwidth of the dc current control in rad/s.
    pub(super) fn w_c(&self) -> f64 {
        0.12 / self.T
    }

    /// Current of an alignment in A.
    pub(super) fn aligned(&self) -> f64 {
        if self.i_0 > 0.0 { self.i_0 } else { ALIGNED * self.I }
    }

    /// Smallest flux linkage in Wb of the magnet.
    pub(super) fn psi_least(&self) -> f64 {
        let least = 0.25 * self.psi_r;
        if self.psi_1 > 0.0 { least.min(0.4 * self.psi_1) } else { least }
    }

    /// J / (n_p K) in A.s2/rad by the swing.
    pub(super) fn inertia(&self) -> f64 {
        self.aligned() / (self.w_0 * self.w_0)
    }

    /// Square of the rate in 1/s at which the reluctance turns the rotor away from the current of a loop, over that of its
    /// amplitude: a fifth of it is the mean square.
    pub(super) fn reluctance(&self) -> f64 {
        0.2 * self.tensor.saliency() / (self.psi_0 * self.inertia())
    }

    /// Rated electrical speed in rad/s.
    pub(super) fn w_r(&self) -> f64 {
        self.U / self.psi_r
    }

    /// Proportional gain in Ohm.
    pub(super) fn K_p(&self) -> f64 {
        self.w_c() * self.L_c
    }

    /// Integral gain in Ohm/s: without overshoot for every R.
    pub(super) fn K_i(&self) -> f64 {
        0.25 * self.w_c() * self.K_p().max(self.R)
    }
}
