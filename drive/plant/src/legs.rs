//! Voltage drop of an inverter leg that opposes its current: from dead time, or from the diodes if the gates are off.
//!
//! Averaged over a PWM period, the leg voltage has an error of `-share u_dc sign(i)`, linear in the current below
//! i_zone. Dead time: share = dead_time / T_pwm, i_zone = `inverter.i_zero`. Gates off: the current selects the diode
//! to the upper or the lower rail, so share = 1/2, and the leg has no other voltage.
//!
//! Blocking diodes: if no current exceeds i_zone and no line-to-line back EMF exceeds u_dc, the currents become and
//! stay zero. The energy of the remaining current, 0.75 L i_zone^2, is lost at once. i_zone is `inverter.i_zero`, or
//! larger if the machine would leave that zone faster than the minimum substep resolves.
//!
//! Derived here from the ideal diode bridge; `drive-study/tests/gates_off.rs` compares it with such a bridge in stator axes.
//! u in V, i in A.

use crate::inverter::Inverter;
use drive_base::frame::{AlphaBeta, Axis, Dq, Phases, Rotor, Stator, Vector};
use drive_base::modulation::{clamp_unit, dead_time_loss};
use drive_base::motor::Motor;
use fmu_core::Scalar;

/// Minimum substep in s that the diodes require.
const SHORTEST_SUBSTEP: f64 = 1e-6;

/// Voltage drop of the legs at a given DC-link voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Legs<S = f64> {
    /// The maximum voltage drop as a fraction of the DC-link voltage.
    share: f64,
    /// The maximum voltage drop in V.
    u: S,
    /// Current in A below which the drop falls linearly.
    i_zone: S,
    /// Threshold voltage of the diode in V, which the back EMF must exceed in addition to the link.
    u_diode: f64,
}

impl<S: Scalar> Legs<S> {
    /// For switching legs.
    #[inline]
    pub fn switching(inverter: &Inverter, u_dc: S) -> Self {
        let share = if inverter.dead_time > 0.0 { inverter.dead_time / inverter.T_pwm } else { 0.0 };
        Self { share, u: u_dc * share, i_zone: inverter.i_zero.into(), u_diode: inverter.devices.u_diode }
    }

    /// For legs that short-circuit the machine: nothing switches, so dead time costs no voltage.
    #[inline]
    pub fn shorted(inverter: &Inverter) -> Self {
        Self { share: 0.0, u: 0.0.into(), i_zone: inverter.i_zero.into(), u_diode: inverter.devices.u_diode }
    }

    /// For legs with the gates off, with the smallest inductance (H) of the machine.
    pub fn off(inverter: &Inverter, least_inductance: f64, u_dc: S) -> Self {
        let narrowest = u_dc * SHORTEST_SUBSTEP / S::from(least_inductance);
        let i_zone = if narrowest.value() > inverter.i_zero { narrowest } else { inverter.i_zero.into() };
        Self { share: 0.5, u: u_dc * 0.5, i_zone, u_diode: inverter.devices.u_diode }
    }

    /// Current in A below which the drop falls linearly.
    #[inline]
    pub fn i_zone(&self) -> S {
        self.i_zone
    }

    /// Whether the legs drop a voltage.
    #[inline]
    pub fn drop(&self) -> bool {
        self.u.value() > 0.0
    }

    /// Voltage (V) lost at the stator with the current `i` (A).
    #[inline(never)]
    pub fn loss(&self, i: Vector<Stator, S>) -> Vector<Stator, S> {
        dead_time_loss(self.u, self.i_zone, Phases::from_stator(i))
    }

    /// Current (A) that legs with the currents `i` (A) feed into the DC link through this voltage drop.
    #[inline]
    pub fn feed(&self, i: Phases<S>) -> S {
        let leg = |i: S| clamp_unit(i / self.i_zone) * i;
        let current = leg(i.a) + leg(i.b) + leg(i.c);
        // Without current it is 0 for any dead time.
        if self.share > 0.0 && current.value() > 0.0 { current * self.share } else { 0.0.into() }
    }
}

impl Legs {
    /// Voltage (V) lost at the stator with currents of these `signs` beyond the zone.
    #[inline]
    pub fn loss_beyond(&self, signs: Phases) -> AlphaBeta {
        signs.to_stator() * self.u
    }

    /// Time constant in s of a current within the zone, with the smallest inductance (H) of the machine: the legs, which drop
    /// `threshold` (V) in their devices, act as resistances there. Infinite without a voltage.
    #[inline]
    pub fn time(&self, least_inductance: f64, threshold: f64) -> f64 {
        self.i_zone * least_inductance / (self.u + threshold)
    }

    /// Line-to-line back EMF in V above which diodes conduct.
    fn opening(&self) -> f64 {
        2.0 * (self.u + self.u_diode)
    }

    /// Whether diodes block the current `i` (A) of a machine that turns at the electrical speed `w` (rad/s).
    pub fn block(&self, motor: &Motor, axis: Axis<Rotor>, i: Dq, w: f64) -> bool {
        let (highest, span) = Self::extent(motor, axis, i, w);
        highest <= self.i_zone && span < self.opening()
    }

    /// Quantities that open blocking diodes when either is above 0: the maximum current divided by the zone, and the
    /// line-to-line back EMF divided by the DC-link voltage, both minus 1.
    pub fn excess(&self, motor: &Motor, axis: Axis<Rotor>, i: Dq, w: f64) -> [f64; 2] {
        let (highest, span) = Self::extent(motor, axis, i, w);
        // Without a DC link the diodes never block.
        [highest / self.i_zone - 1.0, if self.drop() { (span / self.opening() - 1.0).min(1.0) } else { 1.0 }]
    }

    /// The maximum phase current (A) and the maximum line-to-line back EMF (V).
    fn extent(motor: &Motor, axis: Axis<Rotor>, i: Dq, w: f64) -> (f64, f64) {
        let phases = |v: Dq| Phases::from_stator(axis.to_stator(v));
        let Phases { a, b, c } = phases(i);
        (a.abs().max(b.abs()).max(c.abs()), phases(Dq::new(0.0, w * motor.psi_M)).span())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With the gates off, the diodes of two legs conduct where the line-to-line back EMF exceeds the link and their thresholds.
    #[test]
    fn the_diodes_open_by_the_link_and_their_thresholds() {
        let (motor, mut inverter) = (Motor::default(), Inverter::default());
        inverter.devices.u_diode = 10.0;
        let legs = Legs::off(&inverter, motor.L_d, 300.0);
        // Along phase a, the line-to-line voltage of the EMF on the q-axis is at its maximum.
        let axis = Axis::<Rotor>::at(0.0);
        for (share, blocks) in [(0.99, true), (1.01, false)] {
            let w = share * 320.0 / (3.0_f64.sqrt() * motor.psi_M);
            assert_eq!(legs.block(&motor, axis, Dq::ZERO, w), blocks, "{share}");
            let [current, voltage] = legs.excess(&motor, axis, Dq::ZERO, w);
            assert!((current + 1.0).abs() < 1e-12 && (voltage - share + 1.0).abs() < 1e-12, "{current} {voltage}");
        }
        assert!(!legs.block(&motor, axis, Dq::new(2.0 * legs.i_zone(), 0.0), 0.0), "the diodes carry a current");
    }
}
