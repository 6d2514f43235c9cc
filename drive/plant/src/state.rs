//! The state of machine and shaft, an instant of it, and a point of the importer's solution.

use crate::signals::PlantInputs;
use drive_base::frame::{Axis, Dq, Rotor, Vector};
use drive_base::math::all_finite;
use drive_base::motor::Motor;
use fmu_core::Elapsed;
use serde::{Deserialize, Serialize};

/// The state of machine and shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    /// Stator flux linkage in Wb.
    pub(super) psi: Dq,
    /// Mechanical speed in rad/s.
    pub(super) speed: f64,
    /// Mechanical angle in rad, not wrapped.
    pub(super) angle: f64,
    /// The rotor's d-axis at this angle.
    pub(super) axis: Axis<Rotor>,
}

impl State {
    #[inline]
    pub(super) fn new(motor: &Motor, psi: Dq, speed: f64, angle: f64) -> Self {
        Self { psi, speed, angle, axis: axis_at(motor, angle) }
    }

    pub(super) fn is_finite(&self) -> bool {
        all_finite([self.psi.d(), self.psi.q(), self.speed, self.angle])
    }

    /// For messages.
    pub(super) fn described(&self) -> String {
        let Self { psi, speed, angle, .. } = self;
        format!("psi_d = {} Wb, psi_q = {} Wb, speed = {speed} rad/s, angle = {angle} rad", psi.d(), psi.q())
    }
}

/// The rotor's d-axis at the mechanical `angle` (rad).
#[inline]
pub(super) fn axis_at(motor: &Motor, angle: f64) -> Axis<Rotor> {
    Axis::at(f64::from(motor.n_p) * angle)
}

/// The state at an instant; as [`Dual`](fmu_core::Dual) numbers, with its change.
pub(super) struct Instant<S = f64> {
    /// Stator flux linkage in Wb.
    pub(super) psi: Vector<Rotor, S>,
    /// Its current in A; with iron loss, that at the terminals differs.
    pub(super) i: Vector<Rotor, S>,
    /// Mechanical speed in rad/s.
    pub(super) speed: S,
    /// Mechanical angle in rad, not wrapped.
    pub(super) angle: S,
    /// The rotor's d-axis at this angle.
    pub(super) axis: Axis<Rotor, S>,
    /// The diodes block: no current at the terminals.
    pub(super) idle: bool,
}

/// Model Exchange: a point of the solution that the importer accepted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Accepted {
    pub(super) time: Elapsed,
    pub(super) inputs: PlantInputs,
    pub(super) state: State,
    /// Integral of the torque of the shaft up to here.
    pub(super) impulse: f64,
}
