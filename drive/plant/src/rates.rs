//! Derivatives and powers of inverter, machine and shaft at an instant.

use crate::legs::Legs;
use crate::losses::Losses;
use crate::losses::flow::{Flow, Lossy};
use crate::losses::region::Region;
use crate::machine::Machine;
use crate::mechanics::{Motion, Shaft};
use crate::power::Energy;
use drive_base::frame::{AlphaBeta, Axis, Rotor, Stator, Vector};
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
    /// Torque of the shaft on the load in N.m.
    pub(super) tau_shaft: S,
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
    /// Integral of the torque of an imposed shaft, in N.m.s.
    pub(super) impulse: f64,
}

impl Passed {
    /// Adds what passed in a further step.
    #[inline]
    pub(super) fn add(&mut self, step: &Self) {
        self.energy.add(&step.energy);
        self.losses.add(&step.losses);
        self.impulse += step.impulse;
    }
}

impl<S: Scalar> Held<'_, S> {
    /// Derivatives and powers with the d-axis on `axis`, the flux linkage `psi` (Wb), its current `i` (A) and the `speed`
    /// (rad/s).
    #[expect(clippy::inline_always, reason = "its four calls take half of the time of a step")]
    #[inline(always)]
    pub(super) fn rates(&self, axis: Axis<Rotor, S>, psi: Vector<Rotor, S>, i: Vector<Rotor, S>, speed: S) -> Rates<S> {
        let Motion { acceleration, tau_shaft, p_shaft, p_friction } =
            self.shaft.motion(speed, self.machine.torque(psi, i));
        let applied = |i| self.legs.map_or(self.u, |legs| self.u - legs.loss(i));
        if let Some(lossy) = self.lossy {
            let u = applied(axis.to_stator(lossy.steady(psi, i, speed)));
            let Flow { i, d_psi, p_in, losses } = lossy.flow(self.machine.resistance(), u, axis.to_stator(i), speed);
            let losses = Losses { friction: p_friction, ..losses };
            return Rates { d_psi, acceleration, tau_shaft, p_in, p_mech: p_shaft, p_loss: losses.sum(), losses, i };
        }
        let i = axis.to_stator(i);
        let u = applied(i);
        let losses = Losses { cu: self.machine.copper_loss(i), friction: p_friction, ..Losses::none() };
        let d_psi = self.machine.flux_derivative(u, i);
        let (p_in, p_loss) = (u.dot(i) * 1.5, losses.cu + p_friction);
        Rates { d_psi, acceleration, tau_shaft, p_in, p_mech: p_shaft, p_loss, losses, i }
    }

    /// The same while the diodes block: the current `i` (A) of the flux linkage `psi` (Wb) flows through the iron only,
    /// which brakes with its loss.
    pub(super) fn idle_rates(&self, psi: Vector<Rotor, S>, i: Vector<Rotor, S>, speed: S) -> Rates<S> {
        let tau_e = self.machine.torque(psi, i);
        let Motion { acceleration, tau_shaft, p_shaft, p_friction } = self.shaft.motion(speed, tau_e);
        let losses = Losses { iron: S::from(0.0) - tau_e * speed, friction: p_friction, ..Losses::none() };
        let none = Vector::fixed(Vector::ZERO);
        Rates {
            d_psi: none,
            acceleration,
            tau_shaft,
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
    /// What passes at an instant.
    type At;

    /// Derivatives of the flux linkage in stator axes (V) and of the speed (rad/s2), and what passes, with the d-axis on
    /// `axis`, the flux linkage `psi` (Wb) in stator axes and the `speed` (rad/s).
    fn slopes(&self, axis: Axis<Rotor>, psi: AlphaBeta, speed: f64) -> (AlphaBeta, f64, Self::At);

    /// What passes in a step of `h` (s) with these four stages, in which the shaft turns by `turned` (rad).
    fn passed(&self, stages: &[Self::At; 4], h: f64, turned: f64) -> Passed;
}

/// The integral over `h` (s) of the values of the four stages, by the weights of the Runge-Kutta method.
#[inline]
pub(super) fn integral<T>(h: f64, [a, b, c, d]: &[T; 4], value: impl Fn(&T) -> f64) -> f64 {
    h * (1.0 / 6.0) * (value(a) + 2.0 * (value(b) + value(c)) + value(d))
}

/// [`Held`] with every loss, or with none besides those of a constant resistance and of friction.
pub(super) struct Driven<'a, const LOSSY: bool>(pub(super) Held<'a>);

impl<const LOSSY: bool> Circuit for Driven<'_, LOSSY> {
    type At = Rates;

    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn slopes(&self, axis: Axis<Rotor>, psi: AlphaBeta, speed: f64) -> (AlphaBeta, f64, Rates) {
        let Self(held) = self;
        let psi = held.machine.from_stator(axis, psi);
        let rates = held.rates(axis, psi, held.machine.current(psi), speed);
        (rates.d_psi, rates.acceleration, rates)
    }

    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn passed(&self, stages: &[Rates; 4], h: f64, _turned: f64) -> Passed {
        passed::<LOSSY>(stages, h)
    }
}

/// Energies from the powers of each stage.
#[expect(clippy::inline_always, reason = "as for `Held::rates`")]
#[inline(always)]
fn passed<const LOSSY: bool>(stages: &[Rates; 4], h: f64) -> Passed {
    let over = |power: fn(&Rates) -> f64| integral(h, stages, power);
    let energy = Energy { r#in: over(|k| k.p_in), mech: over(|k| k.p_mech), loss: over(|k| k.p_loss) };
    let friction = over(|k| k.losses.friction);
    let losses = if LOSSY {
        let [cu, iron] = [over(|k| k.losses.cu), over(|k| k.losses.iron)];
        Losses { cu, iron, cond: over(|k| k.losses.cond), sw: over(|k| k.losses.sw), friction }
    } else {
        Losses { cu: energy.loss - friction, friction, ..Losses::none() }
    };
    Passed { energy, losses, impulse: over(|k| k.tau_shaft) }
}

/// Inverter, machine and shaft while the currents keep their sides.
pub(super) struct Between<'a> {
    pub(super) machine: Machine<'a>,
    pub(super) region: Region,
    pub(super) shaft: Shaft<'a>,
}

impl Circuit for Between<'_> {
    type At = Rates;

    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn slopes(&self, axis: Axis<Rotor>, psi: AlphaBeta, speed: f64) -> (AlphaBeta, f64, Rates) {
        let psi = self.machine.from_stator(axis, psi);
        let i = self.machine.current(psi);
        let Motion { acceleration, tau_shaft, p_shaft, p_friction } =
            self.shaft.motion(speed, self.machine.torque(psi, i));
        let Flow { i, d_psi, p_in, losses } = self.region.flow(axis.to_stator(i));
        let losses = Losses { friction: p_friction, ..losses };
        let p_loss = losses.sum();
        let rates = Rates { d_psi, acceleration, tau_shaft, p_in, p_mech: p_shaft, p_loss, losses, i };
        (d_psi, acceleration, rates)
    }

    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn passed(&self, stages: &[Rates; 4], h: f64, _turned: f64) -> Passed {
        passed::<true>(stages, h)
    }
}
