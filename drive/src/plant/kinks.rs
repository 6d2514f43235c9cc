//! Integration steps that end at the kinks of the inverter's voltages.
//!
//! Legs with dead time and devices with a threshold have a voltage that depends on the sign of a current. Across such a kink
//! the method loses its order, so a step ends where a current enters or leaves the zone +-`inverter.i_zero`.

use crate::frame::{AlphaBeta, Dq};
use crate::motor::Motor;
use crate::plant::circuit::{Circuit, Passed};
use crate::plant::integration::LONGEST_STEP;
use crate::plant::legs::Legs;
use crate::plant::losses::flow::{Dissipation, Drops, Path, Switches};
use crate::plant::losses::sides::Sides;
use crate::plant::mechanics::{Coulomb, Shaft, Standstill, Whole};
use crate::plant::model::PmsmPlant;
use crate::plant::state::State;

/// Longest integration step in s while a current is in the zone.
const LONGEST_STEP_IN_ZONE: f64 = 50e-6;

/// Shortest integration step in s at a kink; where the zone asks for shorter ones, as long as those.
const SHORTEST_AT_KINK: f64 = 0.5e-6;

/// Largest electrical angle in rad in an integration step with losses: the energies are then in balance to 1e-7 over a drive
/// cycle.
const LARGEST_TURN_WITH_LOSSES: f64 = 0.0625;

/// An integration step of `h` (s) under the voltage `u` (V), with the sides of the currents if they keep them.
struct Step<'a> {
    h: f64,
    u: AlphaBeta,
    switches: &'a Switches,
    sides: Option<&'a Sides>,
}

impl PmsmPlant {
    /// The integration steps over `h` (s) from `state` on with these `switches` under the voltage `u` (V), and the current (A)
    /// by the iron at their end.
    pub(super) fn pass_kinks(
        &self,
        state: &mut State,
        h: f64,
        u: AlphaBeta,
        legs: &Legs,
        switches: Switches,
    ) -> (Passed, Dq) {
        let (parameters, machine) = (&self.parameters, self.machine::<false>());
        let (zone, kinks) = (legs.i_zone(), switches.kinks());
        let in_zone = Self::longest_in_zone(&self.warm.motor, legs, parameters.inverter.devices.threshold());
        let dissipation = |speed| Dissipation::at(parameters, machine.resistance(), machine.electrical(speed));
        let at_start = dissipation(state.speed);
        let guide = |state: &State| at_start.guide(u, state.axis.to_stator(machine.current(state.psi)));
        let (mut passed, mut left, mut start) = (Passed::default(), h, guide(state));
        let mut sides = Sides::of(start, zone);
        // A step that is known to end at a kink: its length, and the sides from there on.
        let mut to_kink = None;
        loop {
            let apart = !kinks || sides.apart();
            let longest = if apart { LONGEST_STEP } else { in_zone };
            let w = machine.electrical(state.speed).abs();
            let (h, then) = match to_kink.take() {
                Some((h, then)) => (h, Some(then)),
                None if left <= longest && w * left <= LARGEST_TURN_WITH_LOSSES => (left, None),
                None => (left / (left / longest.min(LARGEST_TURN_WITH_LOSSES / w) - 1e-9).ceil().max(1.0), None),
            };
            let step = Step { h, u, switches: &switches, sides: apart.then_some(&sides) };
            let mechanics = &parameters.mechanics;
            let (next, step, dissipation) = if mechanics.is_whole(state.speed) {
                self.integrate_kinks(state, &step, Whole::new(mechanics, state.speed))
            } else {
                self.integrate_kinks(state, &step, Standstill::new(mechanics, state.speed))
            };
            let end = guide(&next);
            if let Some(then) = then {
                sides = then;
            } else if kinks && let Some((share, then)) = sides.change(start, end, zone) {
                if share < 0.99 {
                    to_kink = Some(((h * share).max(SHORTEST_AT_KINK.min(in_zone)).min(h), then));
                    continue;
                }
                sides = then;
            }
            start = end;
            passed.add(&step);
            *state = next;
            left -= h;
            if left <= 1e-9 * h || self.is_too_fast(state.speed) {
                let by_iron = self.by_iron_at(state, &Path { u, dissipation, drops: switches });
                return (passed, by_iron);
            }
        }
    }

    /// The current (A) at the terminals less that of the flux linkage.
    #[inline(never)]
    fn by_iron_at<D: Drops<f64>>(&self, state: &State, path: &Path<D>) -> Dq {
        if path.dissipation.G.is_none() {
            return Dq::ZERO;
        }
        let machine = self.machine::<false>();
        let i = state.axis.to_stator(machine.current(state.psi));
        let psi = machine.to_stator(state.axis, state.psi);
        state.axis.from_stator(path.flow(psi, i, machine.electrical(state.speed)).i - i)
    }

    /// An integration step, and what dissipated in it: that of the speed in the middle of the step.
    #[inline(never)]
    fn integrate_kinks<C: Coulomb<f64>>(
        &self,
        start: &State,
        &Step { h, u, switches, sides }: &Step<'_>,
        coulomb: C,
    ) -> (State, Passed, Dissipation) {
        let (parameters, machine) = (&self.parameters, self.machine::<false>());
        let shaft = Shaft::new(&parameters.mechanics, self.inputs.tau_load, coulomb);
        let tau_e = machine.torque(start.psi, machine.current(start.psi));
        let speed = start.speed + 0.5 * h * shaft.motion(start.speed, tau_e).acceleration;
        let dissipation = Dissipation::at(parameters, machine.resistance(), machine.electrical(speed));
        let (next, passed) = if let Some(sides) = sides {
            let path = Path { u, dissipation, drops: switches.one_sided(u, sides) };
            self.integrate(start, h, &Circuit { machine, path, shaft })
        } else {
            let path = Path { u, dissipation, drops: *switches };
            self.integrate(start, h, &Circuit { machine, path, shaft })
        };
        (next, passed, dissipation)
    }

    /// [`integrate`](Self::integrate) with voltages that follow the currents.
    #[inline(never)]
    pub(super) fn integrate_switches(
        &self,
        start: &State,
        h: f64,
        circuit: &Circuit<'_, Switches, Standstill>,
    ) -> (State, Passed) {
        self.integrate(start, h, circuit)
    }

    /// Longest integration step in s with a current in the zone where the voltages of the legs and of devices with this
    /// `threshold` (V) fall linearly.
    #[inline]
    pub(super) fn longest_in_zone(motor: &Motor, legs: &Legs, threshold: f64) -> f64 {
        LONGEST_STEP_IN_ZONE.min(0.5 * legs.time(motor, threshold))
    }
}
