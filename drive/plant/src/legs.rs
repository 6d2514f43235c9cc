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
//! Dead time with `inverter.i_zero` = 0: the zone follows from the ripple. A leg switches on at a current `i - r` and off at
//! `i + r`, if i is its mean over the period; a current that changes sign in between loses no voltage, because at both instants
//! the diode already applies the voltage of the next switch. At each of the two instants the loss grows linearly over `W = 2
//! u_dc dead_time / (3 L)`: the currents that reach zero and are blocked within the dead time.
//!
//! ```text
//! loss / (share u_dc) = c((i - on) / W) - c((off - i) / W), c(x) = x limited to 0..1, on = r - (1 - b) W, off = b W - r
//! r = u_dc T_pwm / (2 L) (sum of max(d_y - d, 0) / 3 + (d - mean) (1 - d))          b = n / 2 + 3/2 (d - mean), 0..1
//! ```
//!
//! d are the duty cycles with the min-max zero sequence, b u_dc is the voltage of a blocked leg, and n counts the other legs that
//! are on when it switches; legs that switch within a dead time of each other count in part. L is the mean of both axes.
//!
//! Derived here from the ideal diode bridge; `drive-study/tests/gates_off.rs` compares it with such a bridge in stator axes.
//! u in V, i in A.

use crate::inverter::Inverter;
use drive_base::frame::{AlphaBeta, Axis, Dq, Phases, Rotor, Stator, Vector};
use drive_base::math::abs;
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
    /// Instead of a linear zone.
    ripple: Option<Ripple<S>>,
}

/// Zone of the dead time of each leg, from the ripple.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ripple<S> {
    /// Currents in A at which the turn-on loss begins and the turn-off loss ends.
    on: Phases<S>,
    off: Phases<S>,
    /// Current in A over which they grow.
    width: S,
}

/// Zone in A without ripple, where `inverter.i_zero` = 0 gives none.
const PLAIN_ZONE: f64 = 0.1;

/// The zone (A) of legs that do not switch.
fn plain(inverter: &Inverter) -> f64 {
    if inverter.i_zero > 0.0 { inverter.i_zero } else { PLAIN_ZONE }
}

/// `x`, limited to 0..1.
fn share<S: Scalar>(x: S) -> S {
    x.chain(x.value().clamp(0.0, 1.0), f64::from(u8::from((0.0..=1.0).contains(&x.value()))))
}

impl<S: Scalar> Legs<S> {
    /// For switching legs.
    #[inline]
    pub fn switching(inverter: &Inverter, u_dc: S) -> Self {
        let share = if inverter.dead_time > 0.0 { inverter.dead_time / inverter.T_pwm } else { 0.0 };
        let i_zone = plain(inverter).into();
        Self { share, u: u_dc * share, i_zone, u_diode: inverter.devices.u_diode, ripple: None }
    }

    /// For switching legs with the references `u` (V) of a machine of the mean inductance 1/`by_L` (H), whose ripple determines the
    /// zone.
    #[inline(never)]
    pub fn rippled(inverter: &Inverter, u: Phases<S>, u_dc: S, by_L: f64) -> Self {
        let legs = Self::switching(inverter, u_dc);
        let &Inverter { T_pwm, dead_time, .. } = inverter;
        if u_dc.value() <= 0.0 {
            return legs;
        }
        // Within the hexagon, without a common part: d - 1/2 = (u - middle) / u_dc.
        let span = u.span();
        let full = if span.value() > u_dc.value() { span } else { u_dc };
        let all = [u.a, u.b, u.c].map(|u| u / full);
        let extreme =
            |sign: f64| all.into_iter().fold(all[0], |a, b| if sign * (b.value() - a.value()) > 0.0 { b } else { a });
        let middle = (extreme(1.0) + extreme(-1.0)) * 0.5;
        let d = all.map(|u| u - middle + 0.5.into());
        let mean = (d[0] + d[1] + d[2]) * (1.0 / 3.0);
        let (scale, width) = (u_dc * (0.5 * T_pwm * by_L), u_dc * (2.0 / 3.0 * dead_time * by_L));
        let leg = |x: usize| {
            let (mut before, mut n) = (S::from(0.0), S::from(0.0));
            for y in (0..3).filter(|&y| y != x) {
                let earlier = d[y] - d[x];
                before += if earlier.value() > 0.0 { earlier } else { 0.0.into() };
                n += share(earlier * (T_pwm / (4.0 * dead_time)) + 0.5.into());
            }
            let above = d[x] - mean;
            let r = scale * (before * (1.0 / 3.0) + above * (S::from(1.0) - d[x]));
            let b = share(n * 0.5 + above * 1.5);
            (r - (S::from(1.0) - b) * width, b * width - r)
        };
        let legs_of = [leg(0), leg(1), leg(2)];
        let [(a, a_off), (b, b_off), (c, c_off)] = legs_of;
        let ripple = Ripple { on: Phases { a, b, c }, off: Phases { a: a_off, b: b_off, c: c_off }, width };
        let edges = legs_of.into_iter().flat_map(|(on, off)| [on, on + width, off, off - width]);
        let i_zone = edges.map(abs).fold(width, |most, edge| if edge.value() > most.value() { edge } else { most });
        Self { i_zone, ripple: Some(ripple), ..legs }
    }

    /// For legs that short-circuit the machine: without switching, dead time causes no voltage loss.
    #[inline]
    pub fn shorted(inverter: &Inverter) -> Self {
        let i_zone = plain(inverter).into();
        Self { share: 0.0, u: 0.0.into(), i_zone, u_diode: inverter.devices.u_diode, ripple: None }
    }

    /// For legs with the gates off, with the smallest inductance (H) of the machine.
    pub fn off(inverter: &Inverter, least_inductance: f64, u_dc: S) -> Self {
        let narrowest = u_dc * SHORTEST_SUBSTEP / S::from(least_inductance);
        let zone = plain(inverter);
        let i_zone = if narrowest.value() > zone { narrowest } else { zone.into() };
        Self { share: 0.5, u: u_dc * 0.5, i_zone, u_diode: inverter.devices.u_diode, ripple: None }
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
        let i = Phases::from_stator(i);
        let Some(Ripple { on, off, width }) = self.ripple else { return dead_time_loss(self.u, self.i_zone, i) };
        let leg = |i: S, on: S, off: S| self.u * (share((i - on) / width) - share((off - i) / width));
        Phases { a: leg(i.a, on.a, off.a), b: leg(i.b, on.b, off.b), c: leg(i.c, on.c, off.c) }.to_stator()
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
    /// Whether the zone follows from the ripple.
    #[inline]
    pub fn is_rippled(&self) -> bool {
        self.ripple.is_some()
    }

    /// The maximum voltage drop in V.
    #[inline]
    pub fn u_dead(&self) -> f64 {
        self.u
    }

    /// Voltage (V) lost at the stator for currents with these `signs` outside the zone.
    #[inline]
    pub fn loss_beyond(&self, signs: Phases) -> AlphaBeta {
        signs.to_stator() * self.u
    }

    /// Time constant in s of a current within the zone, with the smallest inductance (H) of the machine: the legs, which drop
    /// `threshold` (V) in their devices, act as resistances there. Infinite without a voltage.
    #[inline]
    pub fn time(&self, least_inductance: f64, threshold: f64) -> f64 {
        let zone = self.ripple.map_or(self.i_zone, |ripple| ripple.width);
        zone * least_inductance / (self.u + threshold)
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
    /// The ripple where a leg switches, beside the sum over the pieces of a period between the switching instants of all legs.
    #[test]
    fn the_ripple_is_that_of_the_switching_pattern() {
        let (u_dc, by_L) = (300.0, 50.0);
        let inverter = Inverter { dead_time: 1e-12, ..Inverter::default() };
        let T = inverter.T_pwm;
        for u in [[60.0, -10.0, -50.0], [-70.0, 90.0, -20.0], [20.0, 20.0, -40.0], [0.0, 0.0, 0.0]] {
            let [a, b, c] = u;
            let legs = Legs::<f64>::rippled(&inverter, Phases { a, b, c }, u_dc, by_L);
            let Ripple { on, off, .. } = legs.ripple.unwrap();
            let middle = 0.5 * (a.max(b).max(c) + a.min(b).min(c));
            let begins = u.map(|u| 0.5 * T * (0.5 - (u - middle) / u_dc));
            for (x, (on, off)) in [(on.a, off.a), (on.b, off.b), (on.c, off.c)].into_iter().enumerate() {
                // Until leg x switches on at t, the legs that are on drive its current, less the mean voltage u.
                let t = begins[x];
                let others: f64 = begins.iter().map(|begin| (t - begin).max(0.0)).sum();
                let current = by_L * (-u_dc / 3.0 * others - (u[x] - (a + b + c) / 3.0) * t);
                assert!((on + current).abs() < 1e-6 && (off - current).abs() < 1e-6, "{u:?}, leg {x}: {on}, {current}");
            }
        }
    }
}
