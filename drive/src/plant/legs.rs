//! What stands against the current of a leg: its dead time, or with the gates off its diodes.
//!
//! The voltage of a leg on the mean of a PWM period is off by `-share u_dc sign(i)`, below i_zone by the linear part of it.
//! Dead time: share = dead_time / T_pwm, i_zone = `inverter.i_zero`. Gates off: the current chooses the diode to the one or
//! the other rail, so share = 1/2 and nothing else gives a voltage.
//!
//! Diodes block: where no current is above i_zone and no line-to-line EMF above u_dc, the currents are zero and stay so.
//! What is left in the zone goes at once, 0.75 L i_zone^2 of energy. i_zone is `inverter.i_zero`, or more where the machine
//! would leave that zone faster than the shortest substep resolves.
//!
//! Derived here from the ideal diode bridge; `drive/tests/gates_off.rs` compares it with such a bridge in stator axes. u in V, i in A.

use crate::frame::{AlphaBeta, Axis, Dq, Phases, Rotor};
use crate::modulation::dead_time_loss;
use crate::motor::Motor;
use crate::plant::inverter::Inverter;

/// Shortest substep in s that the diodes ask for.
const SHORTEST_SUBSTEP: f64 = 1e-6;

/// What stands against the current, at a DC-link voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Legs {
    /// The greatest voltage as a share of the DC link's.
    share: f64,
    /// The same in V.
    u: f64,
    /// Current in A below which it falls linearly.
    i_zone: f64,
}

impl Legs {
    /// Of legs that switch.
    #[inline]
    pub fn switching(inverter: &Inverter, u_dc: f64) -> Self {
        let share = inverter.dead_time / inverter.T_pwm;
        Self { share, u: share * u_dc, i_zone: inverter.i_zero }
    }

    /// Of legs whose gates are off.
    pub fn off(inverter: &Inverter, motor: &Motor, u_dc: f64) -> Self {
        let narrowest = SHORTEST_SUBSTEP * u_dc / motor.L_d.min(motor.L_q);
        Self { share: 0.5, u: 0.5 * u_dc, i_zone: inverter.i_zero.max(narrowest) }
    }

    /// Time constant in s of a current within the zone, where the legs are resistances; infinite without a voltage.
    #[inline]
    pub fn time(&self, motor: &Motor) -> f64 {
        self.i_zone * motor.L_d.min(motor.L_q) / self.u
    }

    /// The voltage (V) that the stator lacks with the current `i` (A) in the rotor frame on `axis`.
    #[inline]
    pub fn loss(&self, axis: Axis<Rotor>, i: Dq) -> AlphaBeta {
        if self.u > 0.0 {
            dead_time_loss(self.u, self.i_zone, Phases::from_stator(axis.to_stator(i)))
        } else {
            AlphaBeta::ZERO
        }
    }

    /// The current (A) that legs with the currents `i` (A) feed into the DC link so.
    #[inline]
    pub fn feed(&self, i: Phases) -> f64 {
        let leg = |i: f64| (i / self.i_zone).clamp(-1.0, 1.0) * i;
        let current = leg(i.a) + leg(i.b) + leg(i.c);
        // No current, no matter how absurd the dead time.
        if self.share > 0.0 && current > 0.0 { self.share * current } else { 0.0 }
    }

    /// Whether diodes block the current `i` (A) of a machine that turns at the electrical speed `w` (rad/s).
    pub fn block(&self, motor: &Motor, axis: Axis<Rotor>, i: Dq, w: f64) -> bool {
        let phases = |v: Dq| Phases::from_stator(axis.to_stator(v));
        let Phases { a, b, c } = phases(i);
        let greatest = a.abs().max(b.abs()).max(c.abs());
        greatest <= self.i_zone && phases(Dq::new(0.0, w * motor.psi_M)).span() < 2.0 * self.u
    }
}
