//! Integration steps that end at the kinks of the inverter's voltages.
//!
//! Legs with dead time and devices with a threshold have a voltage that depends on the sign of a current. Across such a kink
//! the method loses its order, so a step ends where a current enters or leaves the zone +-`inverter.i_zero`.

use crate::circuit::{Circuit, Passed};
use crate::legs::Legs;
use crate::losses::flow::{Drops, Path, Switches};
use crate::losses::sides::{OneSided, Sides};
use crate::losses::zone::InZone;
use crate::mechanics::{Coulomb, SHORTEST_STEP, Shaft, Standstill, Whole};
use crate::model::PmsmPlant;
use crate::state::State;
use drive_base::frame::{AlphaBeta, Dq};

/// Minimum integration step in s for which a kink is searched, unless the zone requires shorter steps.
const SHORTEST_AT_KINK: f64 = 0.5e-6;

/// Maximum integration step that resolves a current in the zone, as a share of its time constant.
const RESOLVED: f64 = 0.625;

/// Maximum electrical angle in rad of an integration step with losses: the energies then balance to 1e-7 over a drive cycle.
const LARGEST_TURN_WITH_LOSSES: f64 = 0.0625;

/// [`LARGEST_TURN_WITH_LOSSES`] with a current inside the zone: a damped step there is two half steps.
const LARGEST_TURN_DAMPED: f64 = 0.125;

/// Maximum damped step in s.
const LONGEST_STEP_DAMPED: f64 = 50e-6;

/// Legs and devices in the simplest form that holds for a step.
enum Form {
    /// No current is in the zone, and each keeps its side.
    OneSided(OneSided),
    /// Each current keeps its side.
    InZone(InZone),
    /// The step contains kinks.
    Any(Switches),
}

/// An integration step of `h` (s) under the voltage `u` (V).
struct Step<'a> {
    h: f64,
    u: AlphaBeta,
    form: &'a Form,
    /// The step is long compared with the time constant of a current in the zone.
    damped: bool,
}

/// Maximum number per second of steps that are repeated to end at a kink: it bounds the work of a step for any parameters.
const MOST_SEARCHES: f64 = 1e6;

/// Time in s below which a step that resolves a current in the zone is replaced by damped ones, which cost three times as much.
const SHORTEST_RESOLVED: f64 = 10e-6;

/// Difference of the flux linkage for the damping, as a share of the flux linkage of the zone's current.
const DIFFERENCE: f64 = 1e-3;

impl PmsmPlant {
    /// Integrates over `h` (s) from `state` on with these `switches` under the voltage `u` (V); returns what passed, and the
    /// current (A) by the iron at the end.
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
        let time = legs.time(self.warm.least_inductance, parameters.inverter.devices.threshold());
        let resolved = self.warm.longest.min(RESOLVED * time);
        let dissipation = |speed| parameters.dissipation(machine.resistance(), machine.electrical(speed));
        let at_start = dissipation(state.speed);
        let guide = |state: &State, form: &Form| {
            let psi = machine.to_stator(state.axis, state.psi);
            let (i, w) = (state.axis.to_stator(machine.current(state.psi)), machine.electrical(state.speed));
            switches.guided(match *form {
                Form::OneSided(drops) => Path { u, dissipation: at_start, drops }.guides(psi, i, w),
                Form::InZone(drops) => Path { u, dissipation: at_start, drops }.guides(psi, i, w),
                Form::Any(drops) => Path { u, dissipation: at_start, drops }.guides(psi, i, w),
            })
        };
        // Damped steps contain kinks; others end at them.
        let resolves = resolved > SHORTEST_RESOLVED;
        let form = |sides: &Sides| {
            if !kinks || sides.apart() {
                Form::OneSided(switches.one_sided(u, sides))
            } else {
                switches.in_zone(u, sides).filter(|_| resolves).map_or(Form::Any(switches), Form::InZone)
            }
        };
        let (mut passed, mut left, mut start) = (Passed::default(), h, guide(state, &Form::Any(switches)));
        let mut sides = Sides::of(start, zone);
        let mut now = form(&sides);
        // Time since the last kink or change of the voltage, and maximum length of the next step.
        let (mut since, mut limit) = (0.0, f64::INFINITY);
        let mut searches = 1000.0 + h * MOST_SEARCHES;
        loop {
            let apart = matches!(now, Form::OneSided(_));
            let longest = match now {
                Form::OneSided(_) => self.warm.longest,
                _ if resolves => resolved,
                _ => Self::longest_damped(since, time),
            };
            let turn = if apart { LARGEST_TURN_WITH_LOSSES } else { LARGEST_TURN_DAMPED };
            let longest = longest.min(turn / machine.electrical(state.speed).abs());
            let h = if left <= longest {
                left
            } else if apart || resolves {
                left / (left / longest - 1e-9).ceil()
            } else {
                longest
            };
            let h = h.min(limit);
            let step = Step { h, u, form: &now, damped: !resolves && h > resolved };
            let mechanics = &parameters.mechanics;
            let (next, step) = if mechanics.is_whole(state.speed) {
                self.integrate_kinks(state, &step, Whole::new(mechanics, state.speed))
            } else {
                self.integrate_kinks(state, &step, Standstill::new(mechanics, state.speed))
            };
            if let Some(shorter) = mechanics.shorter(h, state.speed, next.speed) {
                limit = shorter;
                continue;
            }
            let end = guide(&next, &now);
            let shortest = SHORTEST_AT_KINK.min(resolved).max(SHORTEST_STEP);
            (limit, since) = (f64::INFINITY, since + h);
            let then = Sides::of(end, zone);
            if kinks && then != sides {
                if h > shortest
                    && searches > 0.0
                    && let Some(share) = sides.first_crossing(start, end, zone, switches.tolerances())
                {
                    (limit, since) = ((h * share).max(shortest), since - h);
                    searches -= 1.0;
                    continue;
                }
                (sides, since) = (then, 0.0);
                now = form(&sides);
            }
            start = end;
            passed.add(&step);
            *state = next;
            left -= h;
            if left <= 1e-9 * h || self.is_too_fast(state.speed) {
                let path = Path { u, dissipation: dissipation(state.speed), drops: switches };
                return (passed, self.by_iron_at(state, &path));
            }
        }
    }

    /// Maximum damped step in s with a current in the zone that settles with this `time` constant (s), `since` (s) after the
    /// voltage changed: first 1.5 and 4.5 time constants, for the energies of the settling.
    fn longest_damped(since: f64, time: f64) -> f64 {
        let longest = if since < 1.4 * time {
            1.5 * time
        } else if since < 5.9 * time {
            4.5 * time
        } else {
            LONGEST_STEP_DAMPED
        };
        longest.clamp(SHORTEST_STEP, LONGEST_STEP_DAMPED)
    }

    /// The current (A) at the terminals minus the flux linkage's.
    #[inline(never)]
    pub(super) fn by_iron_at<D: Drops<f64>>(&self, state: &State, path: &Path<D>) -> Dq {
        if path.dissipation.G.is_none() {
            return Dq::ZERO;
        }
        let machine = self.machine::<false>();
        let i = state.axis.to_stator(machine.current(state.psi));
        let psi = machine.to_stator(state.axis, state.psi);
        state.axis.from_stator(path.flow(psi, i, machine.electrical(state.speed)).i - i)
    }

    /// An integration step with the resistance and conductance at the speed in its middle.
    #[inline(never)]
    fn integrate_kinks<C: Coulomb<f64>>(
        &self,
        start: &State,
        &Step { h, u, form, damped }: &Step<'_>,
        coulomb: C,
    ) -> (State, Passed) {
        let (parameters, machine) = (&self.parameters, self.machine::<false>());
        let shaft = Shaft::new(&parameters.mechanics, self.inputs.tau_load, coulomb);
        let tau_e = machine.torque(start.psi, machine.current(start.psi));
        let speed = start.speed + 0.5 * h * shaft.motion(start.speed, tau_e).acceleration;
        let dissipation = parameters.dissipation(machine.resistance(), machine.electrical(speed));
        match *form {
            Form::OneSided(drops) => {
                self.integrate(start, h, &Circuit { machine, path: Path { u, dissipation, drops }, shaft })
            }
            Form::InZone(drops) => {
                self.integrate(start, h, &Circuit { machine, path: Path { u, dissipation, drops }, shaft })
            }
            Form::Any(drops) => {
                let circuit = Circuit { machine, path: Path { u, dissipation, drops }, shaft };
                if damped {
                    let small = DIFFERENCE * drops.legs.i_zone() * self.warm.least_inductance;
                    self.integrate_damped(start, h, &circuit, small)
                } else {
                    self.integrate(start, h, &circuit)
                }
            }
        }
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
}
