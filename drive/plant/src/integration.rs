//! The integration of the currents and the shaft: Runge-Kutta steps, which end at the kinks of the inverter's voltages.

use crate::legs::Legs;
use crate::losses::flow::{self, Lossy};
use crate::losses::region::Sides;
use crate::mechanics::Shaft;
use crate::model::PmsmPlant;
use crate::rates::{Between, Circuit, Driven, Held, Passed};
use crate::state::{State, axis_at};
use crate::tables::PlantParameters;
use drive_base::frame::{AlphaBeta, Dq, Turn};
use drive_base::motor::Motor;

/// Longest integration step in s without a voltage that depends on the sign of a current: at 4500 rpm of the reference
/// motor, the current error is less than 2e-6 A.
pub(super) const LONGEST_SUBSTEP: f64 = 100e-6;

/// The same with such a voltage, which has kinks where a current changes its sign.
const LONGEST_SUBSTEP_WITH_KINKS: f64 = 50e-6;

/// Shortest integration step in s at a kink; where the zone asks for shorter ones, as long as those.
const SHORTEST_AT_KINK: f64 = 0.5e-6;

/// Largest electrical angle in rad that the rotor turns in an integration step.
pub(super) const LARGEST_TURN: f64 = 0.25;

/// The same with losses, whose energies are then in balance to 1e-7 over a drive cycle.
const LARGEST_TURN_WITH_LOSSES: f64 = 0.0625;

impl PmsmPlant {
    /// One integration step of `h` (s) with the classical Runge-Kutta method ([`rk4`](drive_base::integrate::rk4)): the flux
    /// linkage in stator axes, and the angle as the deviation from a motion at constant speed.
    ///
    /// In stator axes, the flux linkage is the integral of the held voltage minus R_s i. Only this small resistive part
    /// follows the rotor, so a step is more exact than two of half its length in rotor axes. The axes of the motion at
    /// constant speed do not wait for the stages, whose accelerations then turn them a little.
    #[expect(clippy::inline_always, reason = "as a call, it passes the state through memory: 10 % of a period")]
    #[inline(always)]
    pub(super) fn drive(&self, start: &State, h: f64, circuit: &impl Circuit) -> (State, Passed) {
        let (motor, machine) = (&self.warm.motor, self.machine());
        let (n_p, half, sixth, speed) = (f64::from(motor.n_p), 0.5 * h, h * (1.0 / 6.0), start.speed);
        let middle = start.axis.ahead(Turn::new(n_p * half * speed));
        let end = axis_at(motor, start.angle + h * speed);
        let psi = machine.to_stator(start.axis, start.psi);

        let (e_1, a_1, k_1) = circuit.slopes(start.axis, psi, speed);
        let (e_2, a_2, k_2) = circuit.slopes(middle, psi + e_1 * half, speed + a_1 * half);
        let axis = middle.slightly_ahead(n_p * half * half * a_1);
        let (e_3, a_3, k_3) = circuit.slopes(axis, psi + e_2 * half, speed + a_2 * half);
        let axis = end.slightly_ahead(n_p * half * h * a_2);
        let (e_4, a_4, k_4) = circuit.slopes(axis, psi + e_3 * h, speed + a_3 * h);

        let psi = psi + (e_1 + (e_2 + e_3) * 2.0 + e_4) * sixth;
        let deviation = h * sixth * (a_1 + a_2 + a_3);
        let turned = h * speed + deviation;
        let axis = end.ahead(Turn::tiny(n_p * deviation));
        let speed = speed + sixth * (a_1 + 2.0 * (a_2 + a_3) + a_4);
        let state = State { psi: machine.from_stator(axis, psi), speed, angle: start.angle + turned, axis };
        (state, circuit.passed(&[k_1, k_2, k_3, k_4], h, turned))
    }

    /// [`drive`](Self::drive) under the voltage `u` (V).
    #[expect(clippy::inline_always, reason = "as for `drive`")]
    #[inline(always)]
    pub(super) fn drive_held<const LOSSY: bool>(
        &self,
        start: &State,
        h: f64,
        u: AlphaBeta,
        legs: &Legs,
        lossy: Option<&Lossy<'_>>,
    ) -> (State, Passed) {
        let shaft = Shaft::new(&self.parameters.mechanics, self.inputs.tau_load, start.speed);
        let held = Held {
            machine: self.machine(),
            u,
            legs: legs.drop().then_some(legs),
            // Known to the compiler, so that a step without them takes no time for them.
            lossy: if LOSSY { lossy } else { None },
            shaft: if LOSSY { shaft } else { shaft.without_windage() },
        };
        self.drive(start, h, &Driven::<LOSSY>(held))
    }

    /// The same with losses besides that of a constant resistance.
    #[inline(never)]
    pub(super) fn drive_lossy(
        &self,
        start: &State,
        h: f64,
        u: AlphaBeta,
        legs: &Legs,
        lossy: Option<&Lossy<'_>>,
    ) -> (State, Passed) {
        self.drive_held::<true>(start, h, u, legs, lossy)
    }

    /// [`drive`](Self::drive) while the currents keep their sides; a function of its own has registers enough.
    #[inline(never)]
    fn drive_between(&self, start: &State, h: f64, circuit: &Between<'_>) -> (State, Passed) {
        self.drive(start, h, circuit)
    }

    /// Integration steps over `h` (s) from `state` on with switching legs and losses, and the current (A) by the iron at
    /// their end. A step ends where a current enters or leaves the zone of the kinks: across a kink, the method loses its
    /// order.
    #[expect(clippy::inline_always, reason = "as for `drive`")]
    #[inline(always)]
    pub(super) fn switch(
        &self,
        state: &mut State,
        h: f64,
        u: AlphaBeta,
        legs: &Legs,
        lossy: &Lossy<'_>,
    ) -> (Passed, Dq) {
        let PlantParameters { inverter, mechanics, .. } = &self.parameters;
        let (motor, zone, machine) = (&self.warm.motor, legs.i_zone(), self.machine());
        let (R_s, n_p) = (machine.resistance(), f64::from(motor.n_p));
        let kinks = legs.drop() || lossy.kinks();
        let within = if kinks { Self::within_the_zone(motor, legs, inverter.devices.threshold()) } else { 0.0 };
        let guide = flow::guide(lossy.circuit(R_s, n_p * state.speed), u);
        let guide = |state: &State| guide(state.axis.to_stator(machine.current(state.psi)));
        let (mut passed, mut left, mut start) = (Passed::default(), h, guide(state));
        let mut sides = Sides::of(start, zone);
        // A step that is known to end at a kink: its length, and the sides from there on.
        let mut to_kink = None;
        loop {
            let apart = !kinks || sides.apart();
            let longest = if apart { LONGEST_SUBSTEP } else { within };
            let w = (n_p * state.speed).abs();
            let (h, then) = match to_kink.take() {
                Some((h, then)) => (h, Some(then)),
                None if left <= longest && w * left <= LARGEST_TURN_WITH_LOSSES => (left, None),
                None => (left / (left / longest.min(LARGEST_TURN_WITH_LOSSES / w) - 1e-9).ceil().max(1.0), None),
            };
            let between = apart.then(|| {
                let shaft = Shaft::new(mechanics, self.inputs.tau_load, state.speed);
                let tau_e = machine.torque(state.psi, machine.current(state.psi));
                // Resistance and conductance of the middle of the step.
                let speed = state.speed + 0.5 * h * shaft.motion(state.speed, tau_e).acceleration;
                let region = lossy.region(lossy.circuit(R_s, n_p * speed), u, legs, &sides);
                Between { machine, region, shaft }
            });
            let (next, step) = match &between {
                Some(between) => self.drive_between(state, h, between),
                None => self.drive_lossy(state, h, u, legs, Some(lossy)),
            };
            let end = guide(&next);
            if let Some(then) = then {
                sides = then;
            } else if kinks && let Some((share, then)) = sides.change(start, end, zone) {
                if share < 0.99 {
                    to_kink = Some(((h * share).max(SHORTEST_AT_KINK.min(within)).min(h), then));
                    continue;
                }
                sides = then;
            }
            start = end;
            passed.add(&step);
            *state = next;
            left -= h;
            if left <= 1e-9 * h || self.is_too_fast(state.speed) {
                let i = state.axis.to_stator(machine.current(state.psi));
                let emf = match &between {
                    Some(between) => between.region.emf(i),
                    None => self.emf(state, i, u, legs, lossy),
                };
                let (_, G) = lossy.circuit(R_s, n_p * state.speed);
                return (passed, state.axis.from_stator(emf * G));
            }
        }
    }

    /// Voltage (V) behind the resistance with the current `i` (A) of the flux linkage and the voltage `u` (V) of the legs.
    #[inline(never)]
    fn emf(&self, state: &State, i: AlphaBeta, u: AlphaBeta, legs: &Legs, lossy: &Lossy<'_>) -> AlphaBeta {
        let machine = self.machine();
        let steady = lossy.steady(state.psi, machine.current(state.psi), state.speed);
        let u = if legs.drop() { u - legs.loss(state.axis.to_stator(steady)) } else { u };
        lossy.flow(machine.resistance(), u, i, state.speed).d_psi
    }

    /// Longest integration step in s with a current in the zone where the voltages of the legs and of devices with this
    /// `threshold` (V) fall linearly.
    #[inline]
    pub(super) fn within_the_zone(motor: &Motor, legs: &Legs, threshold: f64) -> f64 {
        LONGEST_SUBSTEP_WITH_KINKS.min(0.5 * legs.time(motor, threshold))
    }
}
