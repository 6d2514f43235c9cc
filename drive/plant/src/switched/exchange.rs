//! The switched inverter in Model Exchange: between two events every leg has one state.
//!
//! The carrier's extremes, the commands of the legs and the ends of their dead times are time events, because they are known when the
//! period begins. A current whose sign determines a voltage, and the voltage of a leg that blocks, are state events:
//!
//! ```text
//! z_x = side i_x / i_0 + SHIFT                  a leg that conducts one sign of the current     i_0 = u_dc T_pwm / L
//!       min(u_x - low, high - u_x)/u_0 + SHIFT  a leg that blocks, with the voltage u_x that keeps its current at 0; u_0 = u_dc
//!       1                                       any other leg
//! ```
//!
//! In an event the states of the legs are found as in Co-Simulation, from the same [bridge](super::bridge), and a current that has
//! passed zero in a dead time ends. The derivatives are exact between two events: while a leg blocks, its voltage follows from
//! n . di/dt = 0, with the inductances of the instant. Switching losses are energies of the events, without power between them.

use super::bridge::{Command, DIRECTIONS, Ways};
use super::segment::{Blocked, OneWay, Point, Voltages};
use super::state::Signals;
use crate::circuit::{Circuit, Rates};
use crate::losses::flow::Path;
use crate::losses::switching;
use crate::machine::{Machine, slope};
use crate::mechanics::{Shaft, Standstill};
use crate::model::PmsmPlant;
use crate::signals::PlantInputs;
use crate::state::{Instant, State};
use drive_base::frame::{Dq, Stator, Vector};
use drive_base::motor::Motor;
use fmu_core::{Elapsed, Next, Outcome, Scalar};

/// Shift of the indicators to the side of the last event's decision, so that none stays at 0.
const SHIFT: f64 = 1e-9;

/// Times that agree to this share are the same, as for [`Next::At`].
const SAME: f64 = 1e-9;

impl PmsmPlant {
    /// Current (A) that the link drives through the machine in a carrier period: the unit of the indicators.
    fn driven(&self, inputs: &PlantInputs) -> f64 {
        let driven = inputs.u_dc * self.parameters.inverter.T_pwm / self.warm.least_inductance;
        if driven > 0.0 { driven } else { 1.0 }
    }

    /// The legs as the last event has left them, on a link of `u_dc` (V).
    fn held(&self, u_dc: f64) -> Voltages {
        let ways = Ways::new(&self.parameters.inverter, u_dc).at(&self.bridge.legs);
        Voltages::watched(ways, self.bridge.sides.unwrap_or([1; 3]))
    }

    /// Whether all legs block, on a link of `u_dc` (V).
    pub(crate) fn rests(&self, u_dc: f64) -> bool {
        self.held(u_dc).blocked() == Blocked::All
    }

    /// Derivatives and powers at an instant between two events.
    #[inline(never)]
    pub(crate) fn switched_rates<S: Scalar>(
        &self,
        inputs: &PlantInputs<S>,
        (machine, shaft): (Machine<'_, S>, Shaft<'_, Standstill, S>),
        at: &Instant<S>,
    ) -> Rates<S> {
        let (voltages, psi) = (self.held(inputs.u_dc.value()), machine.to_stator(at.axis, at.psi));
        let (w, drop) = (machine.electrical(at.speed), voltages.drop());
        let dissipation = self.parameters.dissipation(machine.resistance(), w);
        let mut u = Vector::<_, S>::fixed(voltages.upper()).scaled(inputs.u_dc);
        if let Blocked::One(x) = voltages.blocked() {
            let n = Vector::<Stator, S>::fixed(DIRECTIONS[x]);
            let i = machine.stator_current(at.axis, psi);
            // n . (H (d psi/dt - j w psi) + j w i) = 0, with H = di/dpsi in rotor axes.
            let driven = at.axis.from_stator(u - drop.at(i) - i.scaled(dissipation.R) - psi.turned().scaled(w));
            let [d, cross, q] = self.slope_at(inputs, at);
            let along = at.axis.from_stator(n);
            let by = Vector::new(along.d() * d + along.q() * cross, along.d() * cross + along.q() * q);
            let missing = by.dot(driven) + n.dot(i.turned().scaled(w));
            u = u - n.scaled(missing / by.dot(along));
        }
        let path = Path { u, dissipation, drops: OneWay(Some(drop)) };
        Circuit { machine, path, shaft }.rates(at.axis, psi, at.speed)
    }

    /// d i / d psi (1/H) at an instant.
    fn slope_at<S: Scalar>(&self, inputs: &PlantInputs<S>, at: &Instant<S>) -> [f64; 3] {
        let Motor { n_p, R_s, L_d, L_q, psi_M } = self.motor(inputs);
        let motor = Motor { n_p, R_s: R_s.value(), L_d, L_q, psi_M: psi_M.value() };
        slope(&motor, self.parameters.magnetics(), Dq::new(at.psi.d().value(), at.psi.q().value()))
    }

    /// The indicators of the three legs.
    pub(crate) fn leg_indicators(&self, inputs: &PlantInputs, at: &Instant, z: &mut [f64]) {
        let (voltages, i_0) = (self.held(inputs.u_dc), self.driven(inputs));
        let point = self.point(&State { psi: at.psi, speed: at.speed, angle: at.angle, axis: at.axis });
        let i = self.current_at(&point);
        let within = self.blocking(&point, &voltages) / if inputs.u_dc > 0.0 { inputs.u_dc } else { 1.0 };
        for ((z, n), side) in z.iter_mut().zip(DIRECTIONS).zip(voltages.watched_sides()) {
            let margin = match side {
                None => 1.0,
                Some(0) => within.min(1.0),
                Some(side) => f64::from(side) * n.dot(i) / i_0,
            };
            let shifted = margin + SHIFT;
            *z = if shifted == 0.0 { SHIFT } else { shifted };
        }
    }

    /// Takes the legs through the event at `now`.
    pub(crate) fn switch(&mut self, now: Elapsed, state: &State) -> Outcome {
        let inverter = &self.parameters.inverter;
        let (half, u, u_dc) = (0.5 * inverter.T_pwm, self.inputs.u, self.inputs.u_dc);
        let same = SAME * (half + now.seconds());
        let (mut bridge, mut due) = (self.bridge.clone(), [0.0; 3]);
        let (voltages, was_off) = (self.held(u_dc), bridge.legs.map(|leg| leg.on() == Command::Off));
        bridge.pass(now.since(bridge.reached), same, &mut due);
        let mut time = bridge.carrier.locate(inverter, now, u, u_dc);
        if time >= half - same {
            time = bridge.carrier.pass(inverter, half, u, u_dc);
        }
        due = [0.0; 3];
        bridge.command(inverter, Signals::Inputs(self.inputs.gates()), time + same, &mut due);
        let next = bridge.legs.iter().zip(due).map(|(leg, due)| {
            let due = due + same;
            if leg.wait > 0.0 { leg.wait.min(due) } else { due }
        });
        bridge.next = bridge.carrier.instant(inverter, time + next.fold(f64::INFINITY, f64::min));
        bridge.reached = now;
        let mut at = self.point(state);
        let i = self.current_at(&at);
        let (mut lost, mut ended, open) = (0.0, false, inverter.pwm.open_phase.leg());
        let mut end = |at: &mut Point, x: Option<usize>| {
            lost += match x {
                Some(x) => self.end_current(at, x),
                None => self.end_all(at),
            };
            ended = true;
        };
        let sides = voltages.watched_sides();
        let ends = |x: usize| {
            let passed = sides[x].is_some_and(|side| f64::from(side) * DIRECTIONS[x].dot(i) <= 0.0);
            passed && was_off[x] && self.bridge.sides.is_some() || open == Some(x)
        };
        // Two currents of zero leave none.
        match [ends(0), ends(1), ends(2)] {
            [false, false, false] => {}
            [true, false, false] => end(&mut at, Some(0)),
            [false, true, false] => end(&mut at, Some(1)),
            [false, false, true] => end(&mut at, Some(2)),
            _ => end(&mut at, None),
        }
        let ways = Ways::new(inverter, u_dc).at(&bridge.legs);
        let voltages = self.dependent(ways, &at, 4.0 * SHIFT * self.driven(&self.inputs));
        match voltages.blocked() {
            Blocked::None => {}
            Blocked::One(x) => end(&mut at, Some(x)),
            Blocked::All => end(&mut at, None),
        }
        let commutation = half * switching::per_ampere(&inverter.devices, inverter.T_pwm, u_dc);
        let switched = commutation * bridge.commutated(voltages.at_upper_rails(), self.current_at(&at));
        bridge.sides = Some(voltages.watched_sides().map(|side| side.unwrap_or(1)));
        let psi = if ended { self.machine::<false>().from_stator(at.axis, at.psi) } else { state.psi };
        self.bridge = bridge;
        self.energy.r#in += switched;
        self.energy.loss += switched + lost;
        let next = State { psi, ..*state };
        let states_changed = next != self.state;
        self.state = next;
        Outcome { states_changed, ..Outcome::default() }
    }

    /// When the next leg is commanded, or its dead time ends, or the carrier has its next extreme.
    pub(crate) fn next_instant(&self, now: Elapsed) -> Next {
        let extreme = self.bridge.carrier.next(&self.parameters.inverter);
        extreme.or(self.bridge.next.map_or(Next::Never, Next::At), now)
    }

    /// Ends all currents; returns the energy (J) that they had.
    fn end_all(&self, at: &mut Point) -> f64 {
        let none = at.axis.to_stator(Dq::new(self.warm.motor.psi_M, 0.0));
        let lost = self.stored(at);
        at.psi = none;
        lost
    }
}
