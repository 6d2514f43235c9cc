//! Derivatives and powers of inverter, machine and shaft at an instant.

use crate::frame::{AlphaBeta, Axis, Dq, Rotor, Stator, Vector};
use crate::plant::legs::Legs;
use crate::plant::losses::Losses;
use crate::plant::losses::flow::{Flow, Lossy};
use crate::plant::losses::region::Region;
use crate::plant::machine::Machine;
use crate::plant::mechanics::{Motion, Shaft};
use crate::plant::power::Energy;
use fmu_core::Scalar;

/// What stays over an integration step.
pub(super) struct Held<'a, S = f64> {
    pub(super) machine: Machine<'a, S>,
    /// Stator voltage without the drop of the legs, in V.
    pub(super) u: Vector<Stator, S>,
    /// Legs with a voltage drop.
    pub(super) legs: Option<&'a Legs<S>>,
    /// Losses of inverter and machine besides that of a constant resistance.
    pub(super) lossy: Option<&'a Lossy<'a, S>>,
    pub(super) shaft: Shaft<'a, S>,
}

/// Derivatives and powers at an instant.
pub(super) struct Rates<S = f64> {
    /// Derivative of the flux linkage in stator axes, in V.
    pub(super) d_psi: Vector<Stator, S>,
    /// Acceleration in rad/s2.
    pub(super) acceleration: S,
    /// Power from the DC link, to the load, lost, in W.
    pub(super) p_in: S,
    pub(super) p_mech: S,
    pub(super) p_loss: S,
    /// Each loss in W.
    pub(super) losses: Losses<S>,
    /// Current at the terminals in A.
    pub(super) i: Vector<Stator, S>,
}

/// What passes in a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Passed {
    pub(super) energy: Energy,
    /// In J.
    pub(super) losses: Losses,
}

impl<S: Scalar> Held<'_, S> {
    /// Derivatives and powers with the d-axis on `axis`, the flux linkage `psi` (Wb), its current `i` (A) and the `speed`
    /// (rad/s).
    #[expect(clippy::inline_always, reason = "its four calls take half of the time of a step")]
    #[inline(always)]
    pub(super) fn rates(&self, axis: Axis<Rotor, S>, psi: Vector<Rotor, S>, i: Vector<Rotor, S>, speed: S) -> Rates<S> {
        let Motion { acceleration, p_shaft, p_friction } = self.shaft.motion(speed, self.machine.torque(psi, i));
        let applied = |i| self.legs.map_or(self.u, |legs| self.u - legs.loss(i));
        if let Some(lossy) = self.lossy {
            let u = applied(axis.to_stator(lossy.steady(psi, i, speed)));
            let Flow { i, d_psi, p_in, losses } = lossy.flow(self.machine.resistance(), u, axis.to_stator(i), speed);
            let losses = Losses { friction: p_friction, ..losses };
            return Rates { d_psi, acceleration, p_in, p_mech: p_shaft, p_loss: losses.sum(), losses, i };
        }
        let i = axis.to_stator(i);
        let u = applied(i);
        let losses = Losses { cu: self.machine.copper_loss(i), friction: p_friction, ..Losses::none() };
        let d_psi = self.machine.flux_derivative(u, i);
        Rates { d_psi, acceleration, p_in: u.dot(i) * 1.5, p_mech: p_shaft, p_loss: losses.cu + p_friction, losses, i }
    }

    /// The same while the diodes block: the current `i` (A) of the flux linkage `psi` (Wb) flows through the iron only,
    /// which brakes with its loss.
    pub(super) fn idle_rates(&self, psi: Vector<Rotor, S>, i: Vector<Rotor, S>, speed: S) -> Rates<S> {
        let tau_e = self.machine.torque(psi, i);
        let Motion { acceleration, p_shaft, p_friction } = self.shaft.motion(speed, tau_e);
        let losses = Losses { iron: S::from(0.0) - tau_e * speed, friction: p_friction, ..Losses::none() };
        let none = Vector::fixed(Vector::ZERO);
        Rates {
            d_psi: none,
            acceleration,
            p_in: 0.0.into(),
            p_mech: p_shaft,
            p_loss: losses.iron + p_friction,
            losses,
            i: none,
        }
    }
}

/// What the integrator integrates.
pub(super) trait Circuit {
    fn machine(&self) -> &Machine<'_>;

    /// Derivatives and powers with the d-axis on `axis`, the flux linkage `psi` (Wb), its current `i` (A) and the `speed`
    /// (rad/s).
    fn rates(&self, axis: Axis<Rotor>, psi: Dq, i: Dq, speed: f64) -> Rates;

    /// The same with the flux linkage `psi` (Wb) in stator axes.
    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn rates_in_stator(&self, axis: Axis<Rotor>, psi: AlphaBeta, speed: f64) -> Rates {
        let psi = self.machine().from_stator(axis, psi);
        self.rates(axis, psi, self.machine().current(psi), speed)
    }
}

impl Circuit for Held<'_> {
    #[inline]
    fn machine(&self) -> &Machine<'_> {
        &self.machine
    }

    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn rates(&self, axis: Axis<Rotor>, psi: Dq, i: Dq, speed: f64) -> Rates {
        Held::rates(self, axis, psi, i, speed)
    }
}

/// Inverter, machine and shaft while the currents keep their sides.
pub(super) struct Between<'a> {
    pub(super) machine: Machine<'a>,
    pub(super) region: Region,
    pub(super) shaft: Shaft<'a>,
}

impl Circuit for Between<'_> {
    #[inline]
    fn machine(&self) -> &Machine<'_> {
        &self.machine
    }

    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn rates(&self, axis: Axis<Rotor>, psi: Dq, i: Dq, speed: f64) -> Rates {
        let Motion { acceleration, p_shaft, p_friction } = self.shaft.motion(speed, self.machine.torque(psi, i));
        let Flow { i, d_psi, p_in, losses } = self.region.flow(axis.to_stator(i));
        let losses = Losses { friction: p_friction, ..losses };
        Rates { d_psi, acceleration, p_in, p_mech: p_shaft, p_loss: losses.sum(), losses, i }
    }
}
