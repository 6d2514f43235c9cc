//! The path of the power from the link to the flux linkage at an instant: legs, devices, resistance, iron.
//!
//! ```text
//! e = (u - drop - R i_m) / (1 + R G), R = R_s (1 + k_ac w^2)          i_s = i_m + G e          p_in = 1.5 u i_s + p_sw
//! ```
//!
//! u is the voltage of the legs with dead time, i_m the current of the flux linkage, G the conductance of the
//! [`iron`](crate::iron). Dead time, and the diodes with the gates off, depend on the value of i_s in steady state,
//! i_m + G j w psi; the drop of the devices depends on i_s without that drop, a difference of G drop, mA. So everything is
//! explicit, no loss is negative, and the balance p_in = p_cu + p_iron + p_cond + p_sw + 1.5 i_m e holds exactly. With i_m
//! instead, the drops would belong to a current that is 10 % lower at a fifth of the torque, and diodes would block the wrong
//! current.

use crate::inverter::{Gates, Inverter};
use crate::iron::Iron;
use crate::legs::Legs;
use crate::losses::conduction::Conduction;
use crate::losses::{Losses, switching};
use drive_base::frame::{AlphaBeta, Stator, Vector};
use fmu_core::Scalar;
use serde::{Deserialize, Serialize};

/// Winding parameters other than its resistance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Winding {
    /// Growth of the resistance with the square of the electrical speed, in s2/rad2: R = R_s (1 + k_ac w^2), >= 0.
    pub k_ac: f64,
}

/// Dissipation at a speed: the resistance of the winding and the conductance of the iron.
#[derive(Clone, Copy, Debug)]
pub struct Dissipation<S = f64> {
    /// Resistance in Ohm.
    pub R: S,
    /// Conductance parallel to the flux linkage in S; `None` without iron loss.
    pub G: Option<S>,
}

impl<S: Scalar> Dissipation<S> {
    /// With the resistance `R_s` (Ohm) at standstill, at the electrical speed `w` (rad/s).
    #[inline]
    pub fn at(winding: &Winding, iron: &Iron, R_s: S, w: S) -> Self {
        let R = (w * w * winding.k_ac + S::from(1.0)) * R_s;
        Self { R, G: (!iron.is_none()).then(|| iron.conductance(w)) }
    }

    /// Voltage (V) behind the resistance of a winding with iron parallel to it, under the voltage `u` (V).
    #[inline]
    fn behind(&self, u: Vector<Stator, S>) -> Vector<Stator, S> {
        self.G.map_or(u, |G| u.scaled(S::from(1.0) / (self.R * G + S::from(1.0))))
    }

    /// Current (A) at the terminals with the current `i` (A) of the flux linkage and the voltage `e` (V) behind the resistance.
    #[inline]
    fn through(&self, i: Vector<Stator, S>, e: Vector<Stator, S>) -> Vector<Stator, S> {
        self.G.map_or(i, |G| i + e.scaled(G))
    }

    /// Current (A) at the terminals in steady state with the flux linkage `psi` (Wb), its current `i` (A) and the electrical
    /// speed `w` (rad/s).
    #[inline]
    fn steady(&self, psi: Vector<Stator, S>, i: Vector<Stator, S>, w: S) -> Vector<Stator, S> {
        self.G.map_or(i, |G| i + psi.turned().scaled(G * w))
    }
}

/// Voltages that the legs subtract from the reference.
pub trait Drops<S> {
    /// Devices without drop and without switching loss, as a constant for the compiler.
    const IDEAL: bool = false;

    /// Voltage (V) of the legs with dead time, for the reference `u` (V); `steady` gives the current (A) at the terminals in
    /// steady state.
    fn legs(&self, u: Vector<Stator, S>, steady: impl FnOnce() -> Vector<Stator, S>) -> Vector<Stator, S>;

    /// Voltage drop (V) of the devices, with the voltage `u` (V) of the legs and the current `i` (A).
    fn devices(&self, u: Vector<Stator, S>, i: Vector<Stator, S>) -> Option<Vector<Stator, S>>;

    /// Switching loss in W at the current `i` (A).
    fn switching(&self, i: Vector<Stator, S>) -> Option<S>;
}

/// Legs without dead time and losses.
pub struct Ideal;

impl<S> Drops<S> for Ideal {
    const IDEAL: bool = true;

    #[inline]
    fn legs(&self, u: Vector<Stator, S>, _steady: impl FnOnce() -> Vector<Stator, S>) -> Vector<Stator, S> {
        u
    }

    #[inline]
    fn devices(&self, _u: Vector<Stator, S>, _i: Vector<Stator, S>) -> Option<Vector<Stator, S>> {
        None
    }

    #[inline]
    fn switching(&self, _i: Vector<Stator, S>) -> Option<S> {
        None
    }
}

/// Legs whose voltage depends on the current: dead time or the diodes with the gates off, devices, switching.
#[derive(Clone, Copy, Debug)]
pub struct Switches<S = f64> {
    pub(crate) legs: Legs<S>,
    pub(super) conduction: Option<Conduction<S>>,
    /// Switching loss in W per ampere.
    pub(super) sw: S,
}

impl<S: Scalar> Switches<S> {
    /// With these `legs` and `gates` at the DC-link voltage `u_dc` (V). An active short circuit conducts through the transistors
    /// of one side and their diodes; upper and lower ones alternate, so each leg has the mean drop of both.
    #[inline]
    pub fn new(inverter: &Inverter, gates: Gates, u_dc: S, legs: Legs<S>) -> Self {
        let &Inverter { T_pwm, ref devices, .. } = inverter;
        let sw = if gates == Gates::Switch { switching::per_ampere(devices, T_pwm, u_dc) } else { 0.0.into() };
        Self { legs, conduction: Conduction::new(devices, gates != Gates::Off, u_dc, legs.i_zone()), sw }
    }

    /// Whether a voltage or a loss has a kink where a current changes its sign.
    #[inline]
    pub fn kinks(&self) -> bool {
        self.legs.drop() || self.conduction.is_some() || self.sw.value() > 0.0
    }
}

impl<S: Scalar> Drops<S> for Switches<S> {
    #[inline]
    fn legs(&self, u: Vector<Stator, S>, steady: impl FnOnce() -> Vector<Stator, S>) -> Vector<Stator, S> {
        if self.legs.drop() { u - self.legs.loss(steady()) } else { u }
    }

    #[inline]
    fn devices(&self, u: Vector<Stator, S>, i: Vector<Stator, S>) -> Option<Vector<Stator, S>> {
        self.conduction.map(|conduction| conduction.drop(u, i))
    }

    #[inline]
    fn switching(&self, i: Vector<Stator, S>) -> Option<S> {
        Some(switching::magnitudes(i) * self.sw)
    }
}

/// Path from the link to the flux linkage, under a constant voltage.
pub struct Path<D, S = f64> {
    /// Voltage reference in stator axes, inside the hexagon, in V.
    pub u: Vector<Stator, S>,
    /// Winding and iron.
    pub dissipation: Dissipation<S>,
    /// Legs and devices.
    pub drops: D,
}

/// Currents, voltages and losses at an instant.
pub struct Flow<S> {
    /// Current at the terminals in A.
    pub i: Vector<Stator, S>,
    /// Derivative of the flux linkage in stator axes, in V.
    pub d_psi: Vector<Stator, S>,
    /// Power from the link in W.
    pub p_in: S,
    /// Losses in W, without friction.
    pub losses: Losses<S>,
}

impl<S: Scalar, D: Drops<S>> Path<D, S> {
    /// With the flux linkage `psi` (Wb), its current `i` (A) and the electrical speed `w` (rad/s).
    #[expect(clippy::inline_always, reason = "as for `Circuit::rates`")]
    #[inline(always)]
    pub fn flow(&self, psi: Vector<Stator, S>, i: Vector<Stator, S>, w: S) -> Flow<S> {
        let Self { u, dissipation, drops } = self;
        let &Dissipation { R, G } = dissipation;
        let u = drops.legs(*u, || dissipation.steady(psi, i, w));
        let driving = dissipation.behind(u - i.scaled(R));
        let drop = drops.devices(u, dissipation.through(i, driving));
        let e = drop.map_or(driving, |drop| driving - dissipation.behind(drop));
        let i = dissipation.through(i, e);
        let zero = S::from(0.0);
        let sw = drops.switching(i);
        let losses = Losses {
            cu: i.dot(i) * (R * 1.5),
            iron: G.map_or(zero, |G| e.dot(e) * (G * 1.5)),
            cond: drop.map_or(zero, |drop| drop.dot(i) * 1.5),
            sw: sw.unwrap_or(zero),
            friction: zero,
        };
        let p_in = u.dot(i) * 1.5;
        Flow { i, d_psi: e, p_in: sw.map_or(p_in, |sw| p_in + sw), losses }
    }
}

impl<D: Drops<f64>> Path<D> {
    /// The currents (A) whose signs determine the dead-time voltage, and those that determine the drop of the devices;
    /// arguments as for [`flow`](Self::flow).
    #[inline]
    pub fn guides(&self, psi: AlphaBeta, i: AlphaBeta, w: f64) -> [AlphaBeta; 2] {
        let Self { u, dissipation, drops } = self;
        let steady = dissipation.steady(psi, i, w);
        let driving = dissipation.behind(drops.legs(*u, || steady) - i * dissipation.R);
        [steady, dissipation.through(i, driving)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive_base::frame::Vector;

    #[test]
    fn in_steady_state_the_dead_time_follows_the_terminals() {
        let (winding, iron) = (Winding { k_ac: 1e-7 }, Iron { G_e: 2e-3, G_h: 0.3, ..Iron::default() });
        let inverter = Inverter::default();
        let (psi, i, w) = (AlphaBeta::new(0.12, -0.05), AlphaBeta::new(1.5, 3.0), 400.0);
        let dissipation = Dissipation::at(&winding, &iron, 2.0, w);
        // Voltage at which the flux linkage turns with the rotor.
        let steady = dissipation.steady(psi, i, w);
        let u = psi.turned() * w + steady * dissipation.R;
        let flow = Path { u, dissipation, drops: Ideal }.flow(psi, i, w);
        assert!((flow.d_psi - psi.turned() * w).magnitude() < 1e-12, "{:?}", flow.d_psi);
        assert!((flow.i - steady).magnitude() < 1e-13 && (steady - i).magnitude() > 0.1, "{:?}, {steady:?}", flow.i);
        let none: Vector<_> = AlphaBeta::ZERO;
        let switches = Switches::new(&inverter, Gates::Switch, 300.0, Legs::switching(&inverter, 300.0));
        let path = Path { u: none, dissipation: Dissipation { R: 2.0, G: None }, drops: switches };
        assert_eq!(path.guides(psi, i, w), [i; 2], "without iron, both are the current of the flux linkage");
    }
}
