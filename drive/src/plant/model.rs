//! The model `PmsmPlant`: inverter, machine and mechanics, integrated with held inputs.

use crate::frame::{AlphaBeta, Axis, Dq, Phases, Rotor, Stator, Turn, Vector};
use crate::integrate::rk4;
use crate::math::{all_finite, wrap};
use crate::modulation::limit_to_hexagon;
use crate::motor::Motor;
use crate::plant::inverter::Inverter;
use crate::plant::legs::Legs;
use crate::plant::losses::flow::{self, Flow, Lossy};
use crate::plant::losses::region::{Region, Sides};
use crate::plant::losses::{self, Losses, efficiency, switching};
use crate::plant::machine::{self, Machine};
use crate::plant::mechanics::{Motion, Shaft};
use crate::plant::power::{Energy, Powers};
use crate::plant::signals::{PlantInputs, PlantOutputs};
use crate::plant::tables::{PlantParameters, TABLE};
use crate::plant::thermal::warm::Warm;
use crate::plant::thermal::{Temperatures, ThermalMode};
use fmu_core::{Block, Elapsed, Experiment, Fault, Info, Interface, Model, Scalar, Step, Table, Terminal};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// Longest integration step in s without a voltage that depends on the sign of a current: at 4500 rpm of the reference
/// motor, the current error is less than 2e-6 A.
const LONGEST_SUBSTEP: f64 = 100e-6;

/// The same with such a voltage, which has kinks where a current changes its sign.
const LONGEST_SUBSTEP_WITH_KINKS: f64 = 50e-6;

/// Shortest integration step at a kink, as a share of the longest within the zone.
const SHORTEST_SHARE: f64 = 0.01;

/// Largest electrical angle in rad that the rotor turns in an integration step.
const LARGEST_TURN: f64 = 0.25;

/// Maximum number of substeps in one communication step: 1000 s of simulated time.
const MAX_SUBSTEPS: f64 = 1e7;

/// The state of machine and shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    /// Stator flux linkage in Wb.
    pub(super) psi: Dq,
    /// Mechanical speed in rad/s.
    pub(super) speed: f64,
    /// Mechanical angle in rad, not wrapped.
    pub(super) angle: f64,
    /// The rotor's d-axis at this angle.
    pub(super) axis: Axis<Rotor>,
}

impl State {
    #[inline]
    pub(super) fn new(motor: &Motor, psi: Dq, speed: f64, angle: f64) -> Self {
        Self { psi, speed, angle, axis: axis_at(motor, angle) }
    }

    pub(super) fn is_finite(&self) -> bool {
        all_finite([self.psi.d(), self.psi.q(), self.speed, self.angle])
    }

    /// For messages.
    pub(super) fn tell(&self) -> String {
        let Self { psi, speed, angle, .. } = self;
        format!("psi_d = {} Wb, psi_q = {} Wb, speed = {speed} rad/s, angle = {angle} rad", psi.d(), psi.q())
    }
}

/// The rotor's d-axis at the mechanical `angle` (rad).
#[inline]
fn axis_at(motor: &Motor, angle: f64) -> Axis<Rotor> {
    Axis::at(f64::from(motor.n_p) * angle)
}

/// The state at an instant, with or without its change.
pub(super) struct Instant<S = f64> {
    /// Stator flux linkage in Wb.
    pub(super) psi: Vector<Rotor, S>,
    /// Its current in A; with iron loss, that at the terminals differs.
    pub(super) i: Vector<Rotor, S>,
    /// Mechanical speed in rad/s.
    pub(super) speed: S,
    /// Mechanical angle in rad, not wrapped.
    pub(super) angle: S,
    /// The rotor's d-axis at this angle.
    pub(super) axis: Axis<Rotor, S>,
    /// The diodes block: there is no current at the terminals.
    pub(super) idle: bool,
}

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
struct Passed {
    energy: Energy,
    /// In J.
    losses: Losses,
}

impl<S: Scalar> Held<'_, S> {
    /// Derivatives and powers with the d-axis on `axis`, the flux linkage `psi` (Wb), its current `i` (A) and the `speed`
    /// (rad/s).
    #[expect(clippy::inline_always, reason = "its four calls take half of the time of a step")]
    #[inline(always)]
    pub(super) fn rates(&self, axis: Axis<Rotor, S>, psi: Vector<Rotor, S>, i: Vector<Rotor, S>, speed: S) -> Rates<S> {
        let Motion { acceleration, p_shaft, p_friction } = self.shaft.motion(speed, self.machine.torque(psi, i));
        let applied = |i| self.legs.map_or(self.u, |legs| self.u - legs.loss(i));
        if let Some(lossy) = self.lossy {
            let u = applied(axis.to_stator(lossy.steady(psi, i, speed)));
            let Flow { i, d_psi, p_in, losses } = lossy.flow(self.machine.resistance(), u, axis.to_stator(i), speed);
            let losses = Losses { friction: p_friction, ..losses };
            return Rates { d_psi, acceleration, p_in, p_mech: p_shaft, p_loss: losses.sum(), losses, i };
        }
        let i = axis.to_stator(i);
        let u = applied(i);
        let losses = Losses { cu: self.machine.copper_loss(i), friction: p_friction, ..Losses::none() };
        let d_psi = self.machine.flux_derivative(u, i);
        Rates { d_psi, acceleration, p_in: u.dot(i) * 1.5, p_mech: p_shaft, p_loss: losses.cu + p_friction, losses, i }
    }

    /// The same while the diodes block: the current `i` (A) of the flux linkage `psi` (Wb) flows through the iron only,
    /// which brakes with its loss.
    pub(super) fn idle_rates(&self, psi: Vector<Rotor, S>, i: Vector<Rotor, S>, speed: S) -> Rates<S> {
        let tau_e = self.machine.torque(psi, i);
        let Motion { acceleration, p_shaft, p_friction } = self.shaft.motion(speed, tau_e);
        let losses = Losses { iron: S::from(0.0) - tau_e * speed, friction: p_friction, ..Losses::none() };
        let none = Vector::fixed(Vector::ZERO);
        Rates {
            d_psi: none,
            acceleration,
            p_in: 0.0.into(),
            p_mech: p_shaft,
            p_loss: losses.iron + p_friction,
            losses,
            i: none,
        }
    }
}

/// What [`PmsmPlant::drive`] integrates.
trait Circuit {
    fn machine(&self) -> &Machine<'_>;

    /// Derivatives and powers with the d-axis on `axis`, the flux linkage `psi` (Wb), its current `i` (A) and the `speed`
    /// (rad/s).
    fn rates(&self, axis: Axis<Rotor>, psi: Dq, i: Dq, speed: f64) -> Rates;

    /// The same with the flux linkage `psi` (Wb) in stator axes.
    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn rates_in_stator(&self, axis: Axis<Rotor>, psi: AlphaBeta, speed: f64) -> Rates {
        let psi = self.machine().from_stator(axis, psi);
        self.rates(axis, psi, self.machine().current(psi), speed)
    }
}

impl Circuit for Held<'_> {
    #[inline]
    fn machine(&self) -> &Machine<'_> {
        &self.machine
    }

    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn rates(&self, axis: Axis<Rotor>, psi: Dq, i: Dq, speed: f64) -> Rates {
        Held::rates(self, axis, psi, i, speed)
    }
}

/// Inverter, machine and shaft while the currents keep their sides.
struct Between<'a> {
    machine: Machine<'a>,
    region: Region,
    shaft: Shaft<'a>,
}

impl Circuit for Between<'_> {
    #[inline]
    fn machine(&self) -> &Machine<'_> {
        &self.machine
    }

    #[expect(clippy::inline_always, reason = "as for `Held::rates`")]
    #[inline(always)]
    fn rates(&self, axis: Axis<Rotor>, psi: Dq, i: Dq, speed: f64) -> Rates {
        let Motion { acceleration, p_shaft, p_friction } = self.shaft.motion(speed, self.machine.torque(psi, i));
        let Flow { i, d_psi, p_in, losses } = self.region.flow(axis.to_stator(i));
        let losses = Losses { friction: p_friction, ..losses };
        Rates { d_psi, acceleration, p_in, p_mech: p_shaft, p_loss: losses.sum(), losses, i }
    }
}

/// Permanent-magnet synchronous machine with an average inverter and one inertia.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PmsmPlant {
    /// Inputs, held over a communication step.
    pub inputs: PlantInputs,
    /// Parameters; a step never changes them.
    pub parameters: PlantParameters,
    pub(super) state: State,
    /// The diodes block while the gates are off: decided by [`Events::event`](fmu_core::Events::event) and at the end of
    /// a step.
    pub(super) blocked: bool,
    /// Means over the last step.
    pub(super) powers: Powers,
    /// Since the start.
    pub(super) energy: Energy,
    /// Temperatures and the machine at them, held over a step.
    pub(super) warm: Warm,
    /// Current (A) at the terminals less that of the flux linkage, at the end of a step.
    by_iron: Dq,
    /// The switching loss at the last link voltage.
    sw: switching::Last,
}

impl PmsmPlant {
    /// Voltage drop of the inverter legs.
    #[inline]
    pub(super) fn legs<S: Scalar>(&self, inputs: &PlantInputs<S>) -> Legs<S> {
        let PlantParameters { motor, inverter, .. } = &self.parameters;
        let u_dc = inputs.u_dc;
        if inputs.enable { Legs::switching(inverter, u_dc) } else { Legs::off(inverter, motor, u_dc) }
    }

    /// The current (A) that the flux linkage of this `motor` has while the diodes block, at the mechanical `speed` (rad/s).
    #[inline]
    pub(super) fn idle_current<S: Scalar>(&self, motor: &Motor<S>, speed: S) -> Vector<Rotor, S> {
        let iron = &self.parameters.iron;
        if iron.is_none() {
            return Vector::fixed(Dq::ZERO);
        }
        iron.idle_current(motor, speed * f64::from(motor.n_p))
    }

    /// The flux linkage (Wb) of [`idle_current`](Self::idle_current).
    pub(super) fn idle_flux<S: Scalar>(&self, motor: &Motor<S>, speed: S) -> Vector<Rotor, S> {
        machine::flux(motor, self.idle_current(motor, speed))
    }

    /// The losses besides that of a constant resistance, with the voltage drop of these `legs`.
    #[inline]
    pub(super) fn lossy<S: Scalar>(&self, inputs: &PlantInputs<S>, legs: &Legs<S>) -> Option<Lossy<'_, S>> {
        let Inverter { devices, T_pwm, .. } = &self.parameters.inverter;
        let sw = if inputs.enable { switching::per_ampere(devices, *T_pwm, inputs.u_dc) } else { 0.0.into() };
        Lossy::new(&self.parameters, inputs.enable, inputs.u_dc, legs.i_zone(), sw)
    }

    /// The present instant, at the end of a step.
    #[inline]
    fn reached(&self) -> Instant {
        let (motor, saturation) = (&self.warm.motor, &self.parameters.saturation);
        let State { psi, speed, angle, axis } = self.state;
        let i = machine::current(motor, saturation, psi);
        Instant { psi, i, speed, angle, axis, idle: self.blocked && !self.inputs.enable }
    }

    /// The same with iron loss, and the current (A) at the terminals.
    fn reached_with_iron(&self) -> (Instant, Dq) {
        let at = self.reached();
        let at = if at.idle { Instant { i: self.idle_current(&self.warm.motor, at.speed), ..at } } else { at };
        let i = at.axis.from_stator(self.rates(&self.inputs, &at).i);
        (at, i)
    }

    /// The current (A) at the terminals less that of the flux linkage.
    fn current_by_iron(&self) -> Dq {
        let (_, i) = self.reached_with_iron();
        i - self.reached().i
    }

    /// The outputs with iron loss.
    #[inline(never)]
    fn output_with_iron(&self, out: &mut PlantOutputs) {
        let at = self.reached();
        *out = self.shown(&self.inputs, &at, at.i + self.by_iron, self.warm.at, self.powers);
    }

    /// The outputs under these `inputs` with the current `i` (A) at the terminals, the `temperatures` (K) and these `powers`.
    #[expect(clippy::inline_always, reason = "as for `drive`")]
    #[inline(always)]
    pub(super) fn shown<S: Scalar>(
        &self,
        inputs: &PlantInputs<S>,
        at: &Instant<S>,
        i: Vector<Rotor, S>,
        temperatures: Temperatures<S>,
        powers: Powers<S>,
    ) -> PlantOutputs<S> {
        let PlantParameters { motor, saturation, mechanics, .. } = &self.parameters;
        let &Instant { psi, speed, angle, axis, .. } = at;
        let (theta, tau_e) = (angle * f64::from(motor.n_p), Machine::new(motor, saturation).torque(psi, at.i));
        let friction = if mechanics.imposed { mechanics.friction(speed) } else { 0.0.into() };
        PlantOutputs {
            i: Phases::from_stator(axis.to_stator(i)),
            speed,
            angle,
            theta_e: theta.chain(wrap(theta.value()), 1.0),
            tau_e,
            i_d: i.d(),
            i_q: i.q(),
            powers,
            tau_shaft: mechanics.tau_shaft(tau_e, inputs.tau_load, friction),
            energy: self.energy,
            efficiency: efficiency(powers.p_in, powers.p_mech),
            temperatures,
            heat: self.heat(inputs, &temperatures, &powers.losses),
        }
    }

    /// Stator currents in A.
    #[inline(never)]
    fn currents(&self) -> Phases {
        let (at, i) = self.reached_with_iron();
        Phases::from_stator(at.axis.to_stator(i))
    }

    /// The state at the beginning of a step and the energy needed to reach it: an imposed shaft takes the angle of the
    /// drive train. A difference from the angle at the end of the last step turns the rotor under the stator flux
    /// linkage, which cannot jump; the magnetic field then does work on the shaft.
    #[expect(clippy::inline_always, reason = "as for `drive`")]
    #[inline(always)]
    fn at_the_shaft(&self) -> (State, Energy) {
        let PlantParameters { saturation, mechanics, .. } = &self.parameters;
        let PlantInputs { speed_shaft, angle_shaft, .. } = self.inputs;
        if !mechanics.imposed {
            return (self.state, Energy::default());
        }
        let motor = &self.warm.motor;
        let axis = axis_at(motor, angle_shaft);
        let machine = Machine::new(motor, saturation);
        let psi = machine.from_stator(axis, machine.to_stator(self.state.axis, self.state.psi));
        let stored = |psi| machine::magnetic_energy(motor, saturation, psi);
        let energy = Energy { mech: stored(self.state.psi) - stored(psi), ..Energy::default() };
        (State { psi, speed: speed_shaft, angle: angle_shaft, axis }, energy)
    }

    /// Number of integration steps in a step of `h` (s) that begins at the mechanical `speed` (rad/s).
    #[expect(clippy::inline_always, reason = "as for `drive`")]
    #[inline(always)]
    fn substeps(&self, h: f64, speed: f64, legs: &Legs, lossy: bool) -> Result<f64, Fault> {
        let PlantParameters { motor, inverter, .. } = &self.parameters;
        let w = (f64::from(motor.n_p) * speed).abs();
        let threshold = if lossy { inverter.devices.threshold() } else { 0.0 };
        let longest = if legs.drop() || threshold > 0.0 {
            Self::within_the_zone(motor, legs, threshold)
        } else {
            LONGEST_SUBSTEP
        };
        if h <= longest && w * h <= LARGEST_TURN {
            return Ok(1.0);
        }
        Self::count(h, longest.min(LARGEST_TURN / w))
    }

    /// Number of integration steps of at most `longest` (s) in `h` (s).
    #[inline(never)]
    fn count(h: f64, longest: f64) -> Result<f64, Fault> {
        let count = (h / longest - 1e-9).ceil().max(1.0);
        if count > MAX_SUBSTEPS {
            let limit = MAX_SUBSTEPS * longest;
            return Err(Fault::value("the step size", format!("{h} s"), format!("at most {limit} s")));
        }
        Ok(count)
    }

    /// One integration step of `h` (s) under the voltage `u` (V), with the classical Runge-Kutta method ([`rk4`]): the
    /// flux linkage in stator axes, and the angle as the deviation from a motion at constant speed.
    ///
    /// In stator axes, the flux linkage is the integral of the held voltage minus R_s i. Only this small resistive part
    /// follows the rotor, so a step is more exact than two of half its length in rotor axes.
    #[expect(clippy::inline_always, reason = "as a call, it passes the state through memory: 10 % of a period")]
    #[inline(always)]
    fn drive<const LOSSY: bool>(&self, start: &State, h: f64, circuit: &impl Circuit) -> (State, Passed) {
        let motor = &self.warm.motor;
        let (n_p, half, speed) = (f64::from(motor.n_p), 0.5 * h, start.speed);
        let psi = circuit.machine().to_stator(start.axis, start.psi);
        let turn = Turn::new(n_p * half * speed);
        let middle = start.axis.ahead(turn);

        let k_1 = circuit.rates_in_stator(start.axis, psi, speed);
        let k_2 = circuit.rates_in_stator(middle, psi + k_1.d_psi * half, speed + k_1.acceleration * half);
        let axis = middle.ahead(Turn::tiny(n_p * half * half * k_1.acceleration));
        let k_3 = circuit.rates_in_stator(axis, psi + k_2.d_psi * half, speed + k_2.acceleration * half);
        let axis = middle.ahead(turn).ahead(Turn::tiny(n_p * half * h * k_2.acceleration));
        let k_4 = circuit.rates_in_stator(axis, psi + k_3.d_psi * h, speed + k_3.acceleration * h);

        let sixth = h / 6.0;
        let psi = psi + (k_1.d_psi + (k_2.d_psi + k_3.d_psi) * 2.0 + k_4.d_psi) * sixth;
        let acceleration = k_2.acceleration + k_3.acceleration;
        let angle = start.angle + h * (speed + sixth * (k_1.acceleration + acceleration));
        let speed = speed + sixth * (k_1.acceleration + 2.0 * acceleration + k_4.acceleration);
        let over = |power: fn(&Rates) -> f64| sixth * (power(&k_1) + 2.0 * (power(&k_2) + power(&k_3)) + power(&k_4));
        let energy = Energy { r#in: over(|k| k.p_in), mech: over(|k| k.p_mech), loss: over(|k| k.p_loss) };
        let friction = over(|k| k.losses.friction);
        let losses = if LOSSY {
            let [cu, iron] = [over(|k| k.losses.cu), over(|k| k.losses.iron)];
            Losses { cu, iron, cond: over(|k| k.losses.cond), sw: over(|k| k.losses.sw), friction }
        } else {
            Losses { cu: energy.loss - friction, friction, ..Losses::none() }
        };
        let axis = axis_at(motor, angle);
        (State { psi: circuit.machine().from_stator(axis, psi), speed, angle, axis }, Passed { energy, losses })
    }

    /// [`drive`](Self::drive) under the voltage `u` (V).
    #[expect(clippy::inline_always, reason = "as for `drive`")]
    #[inline(always)]
    fn drive_held<const LOSSY: bool>(
        &self,
        start: &State,
        h: f64,
        u: AlphaBeta,
        legs: &Legs,
        lossy: Option<&Lossy<'_>>,
    ) -> (State, Passed) {
        let PlantParameters { saturation, mechanics, .. } = &self.parameters;
        let shaft = Shaft::new(mechanics, self.inputs.tau_load, start.speed);
        let held = Held {
            machine: Machine::new(&self.warm.motor, saturation),
            u,
            legs: legs.drop().then_some(legs),
            // Known to the compiler, so that a step without them takes no time for them.
            lossy: if LOSSY { lossy } else { None },
            shaft: if LOSSY { shaft } else { shaft.without_windage() },
        };
        self.drive::<LOSSY>(start, h, &held)
    }

    /// The same with losses besides that of a constant resistance.
    #[inline(never)]
    fn drive_lossy(
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
        self.drive::<true>(start, h, circuit)
    }

    /// Integration steps over `h` (s) from `state` on with switching legs and losses, and the current (A) by the iron at
    /// their end. A step ends where a current enters or leaves the zone of the kinks: across a kink, the method loses its
    /// order.
    #[expect(clippy::inline_always, reason = "as for `drive`")]
    #[inline(always)]
    fn switch(&self, state: &mut State, h: f64, u: AlphaBeta, legs: &Legs, lossy: &Lossy<'_>) -> (Passed, Dq) {
        let PlantParameters { saturation, inverter, mechanics, .. } = &self.parameters;
        let (motor, zone) = (&self.warm.motor, legs.i_zone());
        let machine = Machine::new(motor, saturation);
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
                None if left <= longest && w * left <= LARGEST_TURN => (left, None),
                None => (left / (left / longest.min(LARGEST_TURN / w) - 1e-9).ceil().max(1.0), None),
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
                    to_kink = Some(((h * share).max(SHORTEST_SHARE * within).min(h), then));
                    continue;
                }
                sides = then;
            }
            start = end;
            passed.energy.add(&step.energy);
            passed.losses.add(&step.losses);
            *state = next;
            left -= h;
            if left <= 1e-9 * h {
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
        let machine = Machine::new(&self.warm.motor, &self.parameters.saturation);
        let steady = lossy.steady(state.psi, machine.current(state.psi), state.speed);
        let u = if legs.drop() { u - legs.loss(state.axis.to_stator(steady)) } else { u };
        lossy.flow(machine.resistance(), u, i, state.speed).d_psi
    }

    /// Longest integration step in s with a current in the zone where the voltages of the legs and of devices with this
    /// `threshold` (V) fall linearly.
    #[inline]
    fn within_the_zone(motor: &Motor, legs: &Legs, threshold: f64) -> f64 {
        LONGEST_SUBSTEP_WITH_KINKS.min(0.5 * legs.time(motor, threshold))
    }

    /// One integration step of `h` (s) with the gates off.
    #[inline(never)]
    fn coast(&self, start: &State, h: f64, legs: &Legs, lossy: Option<&Lossy<'_>>) -> (State, Passed) {
        let Some(lost) = self.remaining(start, legs) else {
            return match lossy {
                None => self.drive_held::<false>(start, h, AlphaBeta::ZERO, legs, None),
                lossy => self.drive_lossy(start, h, AlphaBeta::ZERO, legs, lossy),
            };
        };
        let PlantParameters { saturation, mechanics, .. } = &self.parameters;
        let motor = &self.warm.motor;
        let held = Held {
            machine: Machine::new(motor, saturation),
            u: AlphaBeta::ZERO,
            legs: None,
            lossy: None,
            shaft: Shaft::new(mechanics, self.inputs.tau_load, start.speed),
        };
        let x = rk4(SVector::from([start.speed, start.angle, 0.0, lost, 0.0]), h, |x| {
            let i = self.idle_current(motor, x[0]);
            let rates = held.idle_rates(machine::flux(motor, i), i, x[0]);
            SVector::from([rates.acceleration, x[0], rates.p_mech, rates.p_loss, rates.losses.iron])
        });
        let state = State::new(motor, self.idle_flux(motor, x[0]), x[0], x[1]);
        let losses = Losses { cu: lost, iron: x[4], friction: x[3] - lost - x[4], ..Losses::none() };
        (state, Passed { energy: Energy { r#in: 0.0, mech: x[2], loss: x[3] }, losses })
    }

    /// A communication step; `LOSSY`: with the gates off or with losses besides that of a constant resistance.
    #[expect(clippy::inline_always, reason = "as for `drive`")]
    #[inline(always)]
    fn step<const LOSSY: bool>(&mut self, step: &Step) -> Result<(), Fault> {
        let PlantInputs { enable, u_dc, .. } = self.inputs;
        let legs = self.legs(&self.inputs);
        let lossy = if LOSSY {
            let sw = if enable { self.sw.per_ampere(&self.parameters.inverter, u_dc) } else { 0.0 };
            Lossy::new(&self.parameters, enable, u_dc, legs.i_zone(), sw)
        } else {
            None
        };
        let (mut state, mut energy) = self.at_the_shaft();
        let mut losses = Losses::none();
        let mut left = self.substeps(step.h, state.speed, &legs, lossy.is_some())?;
        let h = step.h / left;
        let u = limit_to_hexagon(self.inputs.u, self.inputs.u_dc);
        let mut by_iron = None;
        if LOSSY
            && self.inputs.enable
            && let Some(lossy) = &lossy
        {
            let (passed, current) = self.switch(&mut state, step.h, u, &legs, lossy);
            energy.add(&passed.energy);
            (losses, by_iron, left) = (passed.losses, Some(current), 0.0);
        }
        while left > 0.0 {
            let (next, passed) = match (LOSSY, self.inputs.enable, lossy.as_ref()) {
                (false, ..) => self.drive_held::<false>(&state, h, u, &legs, None),
                (true, true, lossy) => self.drive_lossy(&state, h, u, &legs, lossy),
                (true, false, lossy) => self.coast(&state, h, &legs, lossy),
            };
            state = next;
            energy.add(&passed.energy);
            if LOSSY {
                losses.add(&passed.losses);
            } else {
                losses.friction += passed.losses.friction;
            }
            left -= 1.0;
        }
        let lost = if !LOSSY || self.inputs.enable { None } else { self.remaining(&state, &legs) };
        if let Some(lost) = lost {
            state.psi = self.idle_flux(&self.warm.motor, state.speed);
            energy.loss += lost;
            losses.cu += lost;
        }
        if !LOSSY {
            losses.cu = energy.loss - losses.friction;
        }
        if !(state.is_finite() && energy.is_finite()) {
            return Err(Fault::new(format!(
                "the machine's state left the finite numbers within a step of {} s; the step before it ended with {}",
                step.h,
                self.state.tell()
            )));
        }
        (self.state, self.blocked) = (state, lost.is_some());
        self.energy.add(&energy);
        if LOSSY && !self.parameters.iron.is_none() {
            self.by_iron = by_iron.unwrap_or_else(|| self.current_by_iron());
        }
        self.powers = Powers::mean(&energy, losses, step.h, &self.inputs, &legs, || self.currents());
        Ok(())
    }

    /// [`step`](Self::step) with losses and temperatures, out of the way of a step without them.
    #[inline(never)]
    fn step_with_losses(&mut self, step: &Step) -> Result<(), Fault> {
        let mode = self.parameters.thermal.mode;
        if mode == ThermalMode::Imposed {
            self.impose()?;
        }
        self.step::<true>(step)?;
        if mode == ThermalMode::Network {
            self.warm_up(step.h)?;
        }
        Ok(())
    }

    /// Energy (J) of the remaining current, which is lost at once when the diodes block; `None` while they conduct.
    fn remaining(&self, state: &State, legs: &Legs) -> Option<f64> {
        let (motor, saturation) = (&self.warm.motor, &self.parameters.saturation);
        let i = machine::current(motor, saturation, state.psi) - self.idle_current(motor, state.speed);
        let blocked = legs.block(motor, state.axis, i, f64::from(motor.n_p) * state.speed);
        let stored = |psi| machine::magnetic_energy(motor, saturation, psi);
        blocked.then(|| stored(state.psi) - stored(self.idle_flux(motor, state.speed)))
    }
}

impl Model for PmsmPlant {
    type Outputs = PlantOutputs;

    const INFO: Info = Info {
        name: "PmsmPlant",
        description: "Permanent-magnet synchronous machine with average inverter and mechanics",
        experiment: Experiment { start: 0.0, stop: 1.0, step: 1e-4 },
        documentation: crate::documentation::PLANT,
        ..crate::PROJECT
    };

    const TABLE: &'static Table<Block<Self>> = TABLE;

    const TERMINALS: &'static [Terminal] = crate::terminals::PLANT;

    const ICON: Option<&'static str> = Some(include_str!("../../icons/pmsm_plant.svg"));

    const STATE_VERSION: u16 = 8;

    fn derive(&mut self) {
        self.sw = switching::Last::default();
        self.take(self.warm.at);
    }

    fn validate(&self) -> Result<(), Fault> {
        self.parameters.thermal.validate()?;
        self.judge_temperatures(&self.inputs)
    }

    fn validate_for(&self, interface: Interface) -> Result<(), Fault> {
        self.validate_network(interface)
    }

    fn initialize(&mut self) {
        self.start_temperatures();
        let PlantParameters { mechanics, initial, .. } = &self.parameters;
        let motor = &self.warm.motor;
        let PlantInputs { speed_shaft, angle_shaft, .. } = self.inputs;
        let (speed, angle) = if mechanics.imposed {
            (speed_shaft, angle_shaft)
        } else {
            (initial.speed, initial.theta_e / f64::from(motor.n_p))
        };
        let psi = if self.inputs.enable { machine::flux(motor, Dq::ZERO) } else { self.idle_flux(motor, speed) };
        self.state = State::new(motor, psi, speed, angle);
        self.energy = Energy::default();
        self.blocked = self.blocks(&self.inputs);
        self.by_iron = self.current_by_iron();
        // No current yet: only the shaft has a power.
        let friction = mechanics.friction(speed);
        let tau_shaft = mechanics.tau_shaft(0.0, self.inputs.tau_load, friction);
        let losses = Losses { friction: friction * speed, ..Losses::default() };
        self.powers = Powers { p_mech: tau_shaft * speed, p_loss: losses.friction, losses, ..Powers::default() };
    }

    fn output(&self, _now: Elapsed, out: &mut PlantOutputs) {
        if !self.parameters.iron.is_none() {
            return self.output_with_iron(out);
        }
        let at = self.reached();
        *out = self.shown(&self.inputs, &at, at.i, self.warm.at, self.powers);
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        let PlantParameters { thermal, .. } = &self.parameters;
        if self.inputs.enable && thermal.mode == ThermalMode::Constant && !losses::any(&self.parameters) {
            self.step::<false>(step)
        } else {
            self.step_with_losses(step)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Current (A) of `motor` after each of 20 samples of 0.1 ms in steps of `h`, at the `speed` (rad/s), with a voltage that
    /// jumps at every sample.
    fn currents(motor: &Motor, speed: f64, h: f64) -> Vec<Dq> {
        let mut block = Block::<PmsmPlant>::default();
        block.model.parameters.motor = motor.clone();
        (block.model.parameters.initial.speed, block.model.parameters.mechanics.J) = (speed, 1e-2);
        block.initialize();
        let w = f64::from(motor.n_p) * speed;
        let mut now = Elapsed::ZERO;
        let sample = |k: u32| {
            let theta = w * 1e-4 * f64::from(k) + 1.8;
            let e = motor.psi_M * w;
            block.model.inputs.u_dc = 1e4;
            block.model.inputs.u =
                Phases::from_stator(AlphaBeta::new(e * theta.cos(), e * theta.sin() + f64::from(k % 3)));
            let mut done = 0.0;
            while done < 1e-4 - 0.5 * h {
                let step = Step { start: now, h };
                block.step(&step).unwrap();
                now = step.end();
                done += h;
            }
            Dq::new(block.out.i_d, block.out.i_q)
        };
        (0..20).map(sample).collect()
    }

    #[test]
    fn a_step_of_a_sample_period_is_as_good_as_64() {
        // With two steps in rotor axes instead of one in stator axes, the errors are 8.5, 0.9 and 92 uA.
        let servo = Motor { n_p: 4, R_s: 0.2, L_d: 1.2e-3, L_q: 1.2e-3, psi_M: 0.09 };
        // At 20 000 rpm, the rotor turns 0.84 rad in a sample: four steps.
        for (motor, rpm, allowed) in [
            (&Motor::default(), 4500.0, 2e-6),
            (&Motor::IPMSM_2_2_KW, 3000.0, 3e-7),
            (&servo, 4500.0, 1e-5),
            (&servo, 20_000.0, 1e-5),
        ] {
            let speed = rpm * std::f64::consts::PI / 30.0;
            let (coarse, fine) = (currents(motor, speed, 1e-4), currents(motor, speed, 1e-4 / 64.0));
            let error = coarse.iter().zip(&fine).map(|(&a, &b)| (a - b).magnitude()).fold(0.0, f64::max);
            assert!(error < allowed && error > 0.0, "{error} A with {motor:?} at {rpm} rpm");
            assert!(fine[19].magnitude() > 0.1, "the current is not trivial: {:?}", fine[19]);
        }
    }

    #[test]
    fn a_voltage_that_depends_on_the_currents_is_integrated_in_short_steps() {
        // Within 2 ms, the phase currents pass the zone of the dead time, +-0.5 A.
        let after = |h: f64, steps: u32| {
            let mut block = Block::<PmsmPlant>::default();
            let PlantParameters { inverter, initial, .. } = &mut block.model.parameters;
            (inverter.dead_time, inverter.i_zero, initial.speed) = (4e-6, 0.5, 200.0);
            block.model.inputs.u = Phases::from_stator(AlphaBeta::new(-80.0, 60.0));
            block.initialize();
            let mut now = Elapsed::ZERO;
            for _ in 0..steps {
                let step = Step { start: now, h };
                block.step(&step).unwrap();
                now = step.end();
            }
            Dq::new(block.out.i_d, block.out.i_q)
        };
        let (coarse, fine) = (after(2e-3, 1), after(1e-6, 2000));
        let error = (coarse - fine).magnitude();
        // The kinks at the edges of the zone cost the method its order: 0.6 mA; with substeps of 400 us, 4 mA.
        assert!(error < 1e-3 && fine.magnitude() > 1.0, "{error} A, {fine:?}");
    }

    #[test]
    fn dead_time_stops_a_current_at_zero() {
        // A voltage below u_dead, 6.5 V, in every leg drives no more than the zone's current, however narrow the zone is.
        for i_zero in [0.1, 1e-3] {
            let mut block = Block::<PmsmPlant>::default();
            let inverter = &mut block.model.parameters.inverter;
            (inverter.dead_time, inverter.i_zero) = (2e-6, i_zero);
            block.model.inputs.u = Phases { a: 4.0, b: -2.0, c: -2.0 };
            block.initialize();
            let mut now = Elapsed::ZERO;
            for _ in 0..100 {
                let step = Step { start: now, h: 1e-4 };
                block.step(&step).unwrap();
                now = step.end();
                assert!(block.out.i.a.abs() < i_zero, "{} A with a zone of {i_zero} A", block.out.i.a);
            }
        }
    }

    #[test]
    fn power_is_balanced() {
        // Over 20 ms: electrical energy in = copper loss + friction + change of magnetic and kinetic energy.
        let mut block = Block::<PmsmPlant>::default();
        block.model.inputs.u = Phases { a: 20.0, b: -10.0, c: -10.0 };
        block.model.parameters.motor.L_q = 9e-3;
        block.model.parameters.initial.theta_e = 0.9;
        block.initialize();
        let energy = |b: &Block<PmsmPlant>| {
            let PlantParameters { motor, mechanics, .. } = &b.model.parameters;
            let (i_d, i_q) = (b.out.i_d, b.out.i_q);
            0.75 * (motor.L_d * i_d * i_d + motor.L_q * i_q * i_q) + 0.5 * mechanics.J * b.out.speed * b.out.speed
        };
        let power = |b: &Block<PmsmPlant>| {
            let u = b.model.inputs.u;
            let input = u.a * b.out.i.a + u.b * b.out.i.b + u.c * b.out.i.c;
            let loss = 1.5 * b.model.parameters.motor.R_s * (b.out.i_d * b.out.i_d + b.out.i_q * b.out.i_q);
            input - loss - b.model.parameters.mechanics.friction(b.out.speed) * b.out.speed
        };
        let (mut now, mut work, mut last) = (Elapsed::ZERO, 0.0, power(&block));
        let h = 1e-6;
        for _ in 0..20_000 {
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
            let next = power(&block);
            work += 0.5 * h * (last + next);
            last = next;
        }
        assert!((energy(&block) - work).abs() < 1e-6 * work.abs(), "{} J stored, {work} J net in", energy(&block));
        assert!(energy(&block) > 0.01);
    }

    #[test]
    fn a_step_beyond_all_measure_is_refused() {
        let mut block = Block::<PmsmPlant>::default();
        block.initialize();
        let fault = block.step(&Step { start: Elapsed::ZERO, h: 1e300 }).unwrap_err();
        assert!(fault.message().contains("at most 1000 s"), "{fault}");
    }
}
