//! The way of the power from the link to the flux linkage, with all losses of inverter and machine, at an instant.
//!
//! ```text
//! e = (u - drop - R i_m) / (1 + R G), R = R_s (1 + k_ac w^2)          i_s = i_m + G e          p_in = 1.5 u i_s + p_sw
//! ```
//!
//! u is the voltage of the legs with dead time, i_m the current of the flux linkage. Dead time, and the diodes with the
//! gates off, follow the current that i_s is in steady state, i_m + G j w psi; the devices' drop follows what i_s would be
//! without it, from which i_s differs by G drop, mA. So everything is explicit, no loss is negative, and the balance p_in =
//! p_cu + p_iron + p_cond + p_sw + 1.5 i_m e holds exactly. With i_m instead, the drops would be those of a current that is
//! 10 % less at a fifth of the torque, and diodes would block the wrong current.

use crate::iron::Iron;
use crate::legs::Legs;
use crate::losses::conduction::Conduction;
use crate::losses::region::{Affine, Region, Sides};
use crate::losses::{Losses, switching};
use crate::tables::PlantParameters;
use drive_base::frame::{AlphaBeta, Rotor, Stator, Vector};
use fmu_core::Scalar;

/// Losses of inverter and machine over an integration step.
#[derive(Clone, Copy, Debug)]
pub struct Lossy<'a, S = f64> {
    iron: &'a Iron,
    /// Growth of the resistance with the square of the electrical speed in s2/rad2.
    k_ac: f64,
    n_p: f64,
    conduction: Option<Conduction<S>>,
    /// Switching loss in W per ampere.
    sw: S,
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

impl<'a, S: Scalar> Lossy<'a, S> {
    /// At the DC-link voltage `u_dc` (V), with switching legs or the gates off, whose voltages fall linearly below `i_zone`
    /// (A), and with the switching loss `sw` (W per ampere); `None` without [`any`](super::any) of these losses.
    pub fn new(parameters: &'a PlantParameters, switching: bool, u_dc: S, i_zone: S, sw: S) -> Option<Self> {
        let PlantParameters { motor, inverter, iron, winding, .. } = parameters;
        super::any(parameters).then(|| Self {
            iron,
            k_ac: winding.k_ac,
            n_p: f64::from(motor.n_p),
            conduction: Conduction::new(&inverter.devices, switching, u_dc, i_zone),
            sw,
        })
    }

    /// Whether the losses have kinks where a current changes its sign.
    pub fn kinks(&self) -> bool {
        self.conduction.is_some() || self.sw.value() > 0.0
    }

    /// Resistance (Ohm) and conductance (S) at the electrical speed `w` (rad/s), with the resistance `R_s` (Ohm) at
    /// standstill.
    #[inline]
    pub fn circuit(&self, R_s: S, w: S) -> (S, S) {
        let R = (w * w * self.k_ac + S::from(1.0)) * R_s;
        (R, if self.iron.is_none() { 0.0.into() } else { self.iron.conductance(w) })
    }

    /// Current (A) at the terminals in steady state with the flux linkage `psi` (Wb), its current `i` (A) and the
    /// mechanical `speed` (rad/s).
    pub fn steady(&self, psi: Vector<Rotor, S>, i: Vector<Rotor, S>, speed: S) -> Vector<Rotor, S> {
        if self.iron.is_none() {
            return i;
        }
        let w = speed * self.n_p;
        i + psi.turned().scaled(self.iron.conductance(w) * w)
    }

    /// With the resistance `R_s` (Ohm), the voltage `u` (V) of the legs, the current `i` (A) of the flux linkage and the
    /// mechanical `speed` (rad/s).
    pub fn flow(&self, R_s: S, u: Vector<Stator, S>, i: Vector<Stator, S>, speed: S) -> Flow<S> {
        let w = speed * self.n_p;
        let one = S::from(1.0);
        let (R, G) = self.circuit(R_s, w);
        let part = one / (R * G + one);
        let driving = (u - i.scaled(R)).scaled(part);
        let none = Vector::fixed(Vector::ZERO);
        let drop = self.conduction.map_or(none, |conduction| conduction.drop(u, i + driving.scaled(G)));
        let e = driving - drop.scaled(part);
        let i = i + e.scaled(G);
        let losses = Losses {
            cu: i.dot(i) * R * 1.5,
            iron: e.dot(e) * G * 1.5,
            cond: drop.dot(i) * 1.5,
            sw: switching::magnitudes(i) * self.sw,
            friction: 0.0.into(),
        };
        Flow { i, d_psi: e, p_in: u.dot(i) * 1.5 + losses.sw, losses }
    }
}

impl Lossy<'_> {
    /// Inverter and machine while the currents keep their `sides`, with resistance and conductance of the `circuit` (Ohm, S)
    /// and the voltage `u` (V) of the legs before dead time.
    #[inline]
    pub fn region(&self, circuit: (f64, f64), u: AlphaBeta, legs: &Legs, sides: &Sides) -> Region {
        let signs = sides.legs();
        let u = if legs.drop() { u - legs.loss_beyond(signs) } else { u };
        let none = Affine { at_0: AlphaBeta::ZERO, by: [0.0; 3] };
        let drop = self.conduction.as_ref().map_or(none, |conduction| conduction.affine(u, signs));
        Region::new(u, circuit, drop, signs.to_stator() * (1.5 * self.sw))
    }
}

/// The current (A) whose sides count: that at the terminals without any drop of the legs, with resistance and conductance
/// of the `circuit` (Ohm, S) and the voltage `u` (V) of the legs before dead time, as a function of the current (A) of the
/// flux linkage.
#[inline]
pub fn guide((R, G): (f64, f64), u: AlphaBeta) -> impl Fn(AlphaBeta) -> AlphaBeta {
    let part = 1.0 / (R * G + 1.0);
    let rest = u * (part * G);
    move |i| i * part + rest
}
