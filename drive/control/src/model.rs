//! The model `SensorlessController`: one digital controller on its own sample grid. `cycle.rs` implements one sample.

use crate::checks;
use crate::commission::{CommissionFault, CommissionState};
use crate::commissioning::{CommissionMode, Held, IDENTIFIED, Turn};
use crate::estimator::{Class, Estimator, Kind, Sample, Setup, options, tracker};
use crate::gains::Gains;
use crate::idle;
use crate::lock::{LOST, Lock};
use crate::modes::{Follows, MODE_INPUTS};
use crate::one_shunt::OneShunt;
use crate::position::{Position, PositionSensor};
use crate::sensor::MeasuredPhases;
use crate::signals::{ControllerInputs, ControllerOutputs};
use crate::speed;
use crate::stands;
use crate::start::StartMode;
use crate::state::{InUse, State, context};
use crate::tables::{ControllerParameters, OUTPUTS, PARAMETERS};
use crate::trip::{Cause, Trip};
use crate::zero_speed::ZeroSpeed;
use drive_base::frame::Phases;
use drive_base::hexagon::within_hexagon;
use drive_base::implausible;
use drive_base::motor::Motor;
use drive_base::overmodulation::ModulationMode;
use fmu_core::idle::why;
use fmu_core::log::Warnings;
use fmu_core::unit::{AMPERE, NEWTON_METER, RADIAN, SPEED, VOLT};
use fmu_core::{
    Block, Elapsed, Enumerated, Experiment, Fault, Info, Interface, Model, Part, Row, Sampled, Step, Table, Terminal,
    Warns, integrate, rows,
};
use serde::{Deserialize, Serialize};

/// Maximum rotation of the estimate in one sample in rad: faster rotation means that the estimator is lost.
const MAX_TURN: f64 = 20.0 * std::f64::consts::PI;

/// Sensorless speed control of a permanent-magnet synchronous machine (Rasmussen, Fig. 2).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SensorlessController {
    /// Inputs, constant over a communication step.
    pub inputs: ControllerInputs,
    /// Parameters; a step never changes them.
    pub parameters: ControllerParameters,
    pub(super) gains: Gains,
    /// Gains of the last sample.
    pub(super) last_gains: Gains,
    /// A parameter has been set since the last sample.
    pub(super) tuned: bool,
    pub(super) in_use: InUse,
    pub(super) state: State,
    commissioning: Held,
    /// The position sensor.
    pub(super) position: Position,
    pub(super) shunt: OneShunt,
}

impl SensorlessController {
    /// The self-commissioning, unless `commission.mode` is Off.
    pub fn commissioning_mut(&mut self) -> &mut Held {
        &mut self.commissioning
    }

    /// The outputs that are visible now: the results of the last sample but one.
    #[inline]
    pub fn shown(&self) -> &ControllerOutputs {
        &self.state.shown
    }

    /// One sample of the controller: currents in, voltage references out. If a lost estimator makes the state
    /// non-finite, the controller restarts at rest from its last angle and reports the loss.
    fn compute(&mut self) {
        if !self.inputs.enable || self.inputs.asc {
            self.stop();
            return;
        }
        let watches = self.parameters.trip.used || !self.inputs.sensor_valid || self.state.sensor_lost;
        if watches && self.protect() {
            return;
        }
        if self.commissioning.is_some() && self.commissions() {
            return;
        }
        if self.state.against && self.state.k > 0 {
            self.turn_back();
        }
        if self.state.catch.is_some() && self.catches() {
            return;
        }
        let theta = self.state.computed.theta_est;
        self.control();
        self.state.k += 1;
        let (out, par) = (&self.state.computed, &self.parameters);
        let sane = (out.speed_est * f64::from(par.motor.n_p) * par.T_s).abs() < MAX_TURN;
        if !(sane && out.is_finite()) {
            self.start_again(theta);
        }
    }

    /// Rejects inputs that are not finite.
    #[inline]
    fn finite(&self) -> Result<(), Fault> {
        if self.inputs.is_finite() {
            return Ok(());
        }
        Err(Fault::new("an input of the controller is not a finite number"))
    }

    /// The sensor is `lost`, or with a new start in use again; the gains follow the estimator.
    #[cold]
    #[inline(never)]
    fn lose_sensor(&mut self, lost: bool) {
        if self.state.sensor_lost != lost {
            self.state.sensor_lost = lost;
            self.derive();
        }
    }

    /// Whether angle and speed come from a position sensor that is not ideal.
    #[inline]
    pub(super) fn has_position_sensor(&self) -> bool {
        let position = &self.parameters.position;
        position.kind != PositionSensor::Ideal || position.angle_offset != 0.0
    }

    /// Reads the position sensor.
    #[cold]
    #[inline(never)]
    fn read_position(&mut self) {
        let par = &self.parameters;
        self.position.read(&par.position, &self.inputs, par.motor.n_p, par.T_s);
    }

    /// Whether the currents come from one shunt in the DC link.
    #[inline]
    pub(super) fn has_one_shunt(&self) -> bool {
        self.parameters.sensor.phases == MeasuredPhases::One
    }

    /// Reads the shunt under the command applied since the last sample.
    #[cold]
    #[inline(never)]
    fn read_shunt(&mut self) {
        let Self { inputs, parameters: par, state, .. } = self;
        let command = state.commands[usize::try_from(par.delay).unwrap_or(0).min(state.commands.len() - 1)];
        let applied = state.shown.enabled.then(|| (Phases::from_stator(command.u), inputs.u_dc));
        self.shunt.read(&par.sensor, inputs.i, state.samples, par.T_s, applied);
    }

    /// Measured electrical angle (rad) and speed (rad/s).
    #[inline]
    pub(super) fn measured_position(&self) -> (f64, f64) {
        if self.has_position_sensor() {
            return self.position.seen;
        }
        (self.inputs.theta_meas, f64::from(self.parameters.motor.n_p) * self.inputs.speed_meas)
    }

    /// Whether a lost sensor takes over again.
    fn resumes(&self) -> bool {
        self.parameters.resume && self.inputs.sensor_valid
    }

    /// Watches the limits of the trips and the sensor; returns whether the controller rests.
    #[cold]
    #[inline(never)]
    fn protect(&mut self) -> bool {
        if self.parameters.trip.used && self.trips() {
            return true;
        }
        if !self.inputs.sensor_valid && self.parameters.has_fallback() {
            self.lose_sensor(true);
        } else if self.resumes() {
            self.lose_sensor(false);
        }
        false
    }

    /// Whether the drive has tripped, at this sample or before: then the controller rests.
    fn trips(&mut self) -> bool {
        if self.state.trip.cause == Cause::None {
            let cause = self.parameters.trip.cause(self.currents(), self.inputs.u_dc);
            if cause == Cause::None {
                return false;
            }
            self.state.trip = Trip::new(cause, self.state.computed.speed_est);
        }
        if self.state.trip.cause == Cause::UnderVoltage && self.parameters.trip.restarts(self.inputs.u_dc) {
            self.state.trip = Trip::default();
            return false;
        }
        let (_, w) = self.measured_position();
        let Self { inputs, parameters: par, state, .. } = self;
        let sensor = par.estimator == Kind::Sensored && inputs.sensor_valid && !state.sensor_lost;
        let speed = sensor.then(|| w / f64::from(par.motor.n_p));
        state.trip.update(&par.trip, &par.motor, inputs.u_dc, speed);
        self.stop();
        true
    }

    /// Takes the sample for the self-commissioning; returns whether the controller is inactive in this sample.
    #[cold]
    #[inline(never)]
    fn commissions(&mut self) -> bool {
        let (i, &ControllerInputs { commission_start, u_dc, .. }) = (self.currents(), &self.inputs);
        let Some(commissioning) = &mut self.commissioning else { return false };
        match commissioning.update(&self.parameters.commission_setup(), commission_start, i, u_dc) {
            Turn::Works => return false,
            Turn::Rests => self.state.computed = self.rest(),
            Turn::Commissions { voltage, first } => {
                if first {
                    self.state.computed = self.rest();
                }
                let (u, voltage_limited) = within_hexagon(voltage.u, u_dc);
                let out = &mut self.state.computed;
                *out = ControllerOutputs { u: Phases::from_stator(u), enabled: voltage.gates, voltage_limited, ..*out };
            }
        }
        true
    }

    /// Rests, and ends a self-commissioning that runs.
    #[cold]
    fn stop(&mut self) {
        if let Some(commissioning) = &mut self.commissioning {
            commissioning.rest(self.inputs.commission_start);
        }
        self.state.computed = self.rest();
    }

    /// Not enabled, short-circuited, or before and after a self-commissioning: resets everything except the sample grid and the displayed outputs.
    #[cold]
    fn rest(&mut self) -> ControllerOutputs {
        let sensor_lost = self.inputs.enable && self.state.sensor_lost && !self.resumes();
        self.lose_sensor(sensor_lost);
        let Self { inputs, parameters: par, state, .. } = self;
        let new = State::new(par, false);
        // A trip stays until enable falls.
        let trip = if inputs.enable { state.trip } else { Trip::default() };
        let short_circuit = inputs.asc || trip.shorts;
        let out = ControllerOutputs { short_circuit, tripped: trip.cause, sensor_lost, ..new.computed };
        let mut offset = state.offset;
        if par.compensation.calibrate && !short_circuit {
            offset.update(par.sensor.measure(inputs.i, state.samples), par.T_s);
        }
        *state = State { samples: state.samples, shown: state.shown, offset, trip, sensor_lost, ..new };
        out
    }

    /// Restarts at the angle `theta` (rad) of the last sample, at rest and without voltage.
    #[cold]
    fn start_again(&mut self, theta: f64) {
        let Self { parameters: par, state, .. } = self;
        let kind = par.estimator_with(state.sensor_lost);
        let nothing = Sample { k: state.k, ..Sample::default() };
        let (estimator, _) = Estimator::start(kind, &context(par, &par.estimators, &par.motor), &nothing, theta, 0.0);
        *state = State {
            samples: state.samples,
            k: state.k,
            offset: state.offset,
            estimator,
            lock: Lock::lost(),
            sensor_lost: state.sensor_lost,
            shown: state.shown,
            ..State::default()
        };
        let R_s_est = state.estimator.resistance(&context(par, &par.estimators, &par.motor));
        state.computed = ControllerOutputs {
            theta_est: theta,
            lock_lost: LOST,
            enabled: true,
            sensor_lost: state.sensor_lost,
            R_s_est,
            start_state: state.leader.start_state(),
            ..ControllerOutputs::default()
        };
    }

    /// Checks that the parameters fit together, with a DC link of `u_dc` (V) at the start.
    ///
    /// # Errors
    /// States the incompatible parameters and a remedy.
    pub fn validate_on(&self, u_dc: f64) -> Result<(), Fault> {
        let par = &self.parameters;
        self.validate_with(par, u_dc)?;
        if !par.has_fallback() {
            return Ok(());
        }
        let fallback = ControllerParameters { estimator: par.fallback, ..par.clone() };
        let is = PARAMETERS.tell(par, |p| &mut p.fallback);
        self.validate_with(&fallback, u_dc)
            .map_err(|fault| Fault::new(format!("{is} does not fit: as the estimator, {fault}")))
    }

    /// [`validate_on`](Self::validate_on) for these parameters.
    fn validate_with(&self, par: &ControllerParameters, u_dc: f64) -> Result<(), Fault> {
        let ControllerParameters { limit, zero_speed, estimator, start, .. } = par;
        let tell = |name: &str| PARAMETERS.tell_name(par, name).unwrap_or_else(|| name.to_owned());
        let setup = Setup {
            par: &par.estimators,
            motor: &par.motor,
            J: par.J,
            T_s: par.T_s,
            reference_feed_forward: par.current.reference_feed_forward,
            active_resistance: par.current.active_resistance,
            starts_by_injection: start.mode == StartMode::Injection,
            by_need: zero_speed.by_need,
            weakens: par.weakening.used,
            overmodulates: par.modulation.mode != ModulationMode::Linear,
            tell: &tell,
        };
        tracker::validate(&setup)?;
        options::validate(*estimator, &setup)?;
        estimator.validate(&setup)?;
        checks::current(par)?;
        if start.mode == StartMode::CurrentFrequency && start.i > limit.i {
            return Err(above_limit(par, |p| &mut p.start.i));
        }
        if start.mode == StartMode::Injection {
            checks::polarity(par)?;
        }
        // A running drive has to live with its DC link.
        let u_dc = if self.state.samples == 0 { u_dc } else { 0.0 };
        checks::weakening(par, u_dc)?;
        checks::trip(par, u_dc)?;
        checks::catch(par, u_dc)?;
        checks::position(par)?;
        checks::shunt(par)?;
        checks::commissioning(par)?;
        checks::dc_limits(par)?;
        // The start value is accepted with an estimator that does not read it.
        let reads = estimator.class() == Class::FluxObserver;
        if zero_speed.i_0 > limit.i && (reads || zero_speed.i_0 > ZeroSpeed::default().i_0) {
            return Err(above_limit(par, |p| &mut p.zero_speed.i_0));
        }
        checks::zero_speed(par)
    }
}

/// The fault reported for a current above the limit.
fn above_limit(par: &ControllerParameters, get: impl FnOnce(&mut ControllerParameters) -> &mut f64) -> Fault {
    let limit = PARAMETERS.tell(par, |p| &mut p.limit.i);
    PARAMETERS.fault(par, get, format!("at most {limit}"))
}

impl Model for SensorlessController {
    type Outputs = ControllerOutputs;

    const INFO: Info = Info {
        name: "SensorlessController",
        description: "Sensorless speed control of a permanent-magnet synchronous machine, zero speed included",
        experiment: Experiment { stop: 1.0, step: 1e-4, ..Experiment::DEFAULT },
        documentation: crate::documentation::CONTROLLER,
        ..drive_base::PROJECT
    };

    const TABLE: &'static Table<Block<Self>> = TABLE;

    const TERMINALS: &'static [Terminal] = crate::terminals::CONTROLLER;

    const ICON: Option<&'static str> = Some(include_str!("../icons/sensorless_controller.svg"));

    const STATE_VERSION: u16 = 29;

    fn idle(&self, name: &str) -> Option<&'static str> {
        if name == "u_dc" && self.inputs.u_dc == 0.0 {
            return Some(idle::NO_VOLTAGE);
        }
        why(idle::ACTS, &self.parameters, name)
    }

    fn derive(&mut self) {
        if !self.tuned {
            self.last_gains.clone_from(&self.gains);
        }
        self.tuned = true;
        self.gains = Gains::with(&self.parameters, self.parameters.estimator_with(self.state.sensor_lost));
    }

    fn validate(&self) -> Result<(), Fault> {
        self.validate_on(self.inputs.u_dc)
    }

    fn validate_for(&self, interface: Interface) -> Result<(), Fault> {
        // An importer that handles events exchanges values at the instant, before the sample is taken.
        if interface != Interface::CoSimulation && self.parameters.delay == 0 {
            let allowed =
                "1 or 2: at an event, the voltages of the last sample act, and the currents are sampled after that";
            return Err(PARAMETERS.fault(&self.parameters, |p| &mut p.delay, allowed));
        }
        Ok(())
    }

    fn initialize(&mut self) {
        self.lose_sensor(false);
        let ControllerInputs { enable, asc, commission_start, .. } = self.inputs;
        let commissions = self.parameters.commission.mode != CommissionMode::Off;
        self.commissioning = commissions.then(Box::default);
        let waits = self.parameters.start.catch || commissions && commission_start;
        self.state = State::new(&self.parameters, enable && !asc && !waits);
        self.state.shown.short_circuit = asc;
        (self.tuned, self.position, self.shunt) = (false, Position::default(), OneShunt::default());
    }

    fn output(&self, _now: Elapsed, out: &mut ControllerOutputs) {
        out.clone_from(&self.state.shown);
    }

    #[inline]
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::sampled(self, step)
    }
}

impl Sampled for SensorlessController {
    #[inline]
    fn period(&self) -> f64 {
        self.parameters.T_s
    }

    #[inline]
    fn samples(&self) -> u64 {
        self.state.samples
    }

    #[inline]
    fn show(&mut self) {
        if std::mem::take(&mut self.state.hidden) {
            self.state.shown.clone_from(&self.state.computed);
            if let Some(commissioning) = &mut self.commissioning {
                commissioning.show();
            }
        }
    }

    fn sample(&mut self) -> Result<(), Fault> {
        self.finite()?;
        if self.has_position_sensor() {
            self.read_position();
        }
        if self.has_one_shunt() {
            self.read_shunt();
        }
        self.compute();
        if let Some(commissioning) = &self.commissioning {
            let out = &mut self.state.computed;
            (out.commission_state, out.commission_fault) = commissioning.status();
        }
        self.state.hidden = true;
        self.state.samples += 1;
        Ok(())
    }
}

/// Description of the torque reference.
pub const TAU_REF: &str =
    "Torque reference; at 0, zero_speed.i_0 flows near standstill, or no current with zero_speed.release";

/// The warning about a torque reference (N.m) outside these limits (N.m) for a second.
pub fn clipped(tau_ref: f64, [tau_min, tau_max]: [f64; 2]) -> String {
    format!(
        "tau_ref = {tau_ref} N.m has been clipped for a second: at this speed and u_dc, the drive gives {tau_min} to {tau_max} N.m \
         (tau_min, tau_max)"
    )
}

impl Warns for SensorlessController {
    fn warn(&self, log: &mut Warnings<'_>) {
        let ControllerOutputs { tau_min, tau_max, .. } = self.state.shown;
        self.warn_with(log, self.inputs.tau_ref, [tau_min, tau_max]);
    }
}

impl SensorlessController {
    /// [`Warns::warn`], with the torque reference and its limits (N.m) as the user knows them.
    pub fn warn_with(&self, log: &mut Warnings<'_>, asked: f64, limits: [f64; 2]) {
        let (out, par, tau_ref) = (&self.state.shown, &self.parameters, self.inputs.tau_ref);
        if out.tripped != Cause::None {
            let stopped = if out.short_circuit { "the machine is short-circuited" } else { "the gates are off" };
            return log.warn("tripped", || {
                format!(
                    "{} beyond its limit: {stopped}, and the controller rests until {}",
                    out.tripped.what(&par.trip),
                    out.tripped.ends(&par.trip)
                )
            });
        }
        if self.inputs.commission_start && out.commission_state == CommissionState::Refused {
            return log.warn("commission", || {
                let why = out.commission_fault;
                let about = CommissionFault::ENUMERATION.items.iter().find(|item| item.value == why.value());
                format!(
                    "the self-commissioning is refused, commission_fault = {}: {}; the gates are off until commission_start falls",
                    why.name(),
                    about.map_or("", |item| item.description)
                )
            });
        }
        implausible::angle("initial.theta_est", par.theta_est, log);
        implausible::angle("sensor.angle_offset", par.position.angle_offset, log);
        if let Some(why) = self.not_caught() {
            log.warn("catch", || why.clone());
        }
        if let Some(why) = checks::subtracts(par) {
            log.warn("current.active_resistance", || why.clone());
        }
        // Where the low-speed law acts.
        if out.enabled && out.speed_est.abs() < par.zero_speed.w_0 && checks::lowers_i_0(par, self.inputs.u_dc) {
            log.warn("limit.i_dc_max", || checks::lowered_i_0(par, self.inputs.u_dc));
        }
        let beyond = (tau_ref > out.tau_max || tau_ref < out.tau_min) && par.modes.allows(&self.inputs.modes, tau_ref);
        let follows = self.state.follows == Follows::Reference;
        if follows && par.speed_loop.torque_mode && self.state.limited_for >= 1.0 && beyond {
            log.warn("tau_ref", || clipped(asked, limits));
        }
        if !par.speed_loop.torque_mode {
            self.state.overload.warn(true, [out.speed_est, self.state.w_ref], || limits, log);
        }
        if let Some(time) = self.state.stands.reached(par) {
            log.warn("stands", || stands::hidden(par, asked, out.speed_est, time));
        }
        if out.lock_lost < 1.0 {
            return;
        }
        let restarted = ControllerOutputs {
            theta_est: out.theta_est,
            lock_lost: LOST,
            enabled: true,
            sensor_lost: out.sensor_lost,
            R_s_est: out.R_s_est,
            commission_state: out.commission_state,
            commission_fault: out.commission_fault,
            start_state: out.start_state,
            ..ControllerOutputs::default()
        };
        if *out == restarted {
            log.warn("restarted", || {
                format!(
                    "the estimate was not finite or turned by more than {MAX_TURN} rad in a sample: the controller \
                     starts again at rest, theta_est = {} rad",
                    out.theta_est
                )
            });
            return;
        }
        let order = speed::order([par.current.bandwidth, par.speed_loop.bandwidth]);
        if let Some(why) = order.filter(|_| !par.speed_loop.torque_mode) {
            return log.warn("bandwidth", || why.clone());
        }
        let Motor { n_p, R_s, L_d, L_q, psi_M } = self.parameters.motor;
        // A wrong resistance changes the voltage by at most R_s i, which is outweighed by a back EMF or a mismatch of twice that; a dead
        // time matters at speeds as low.
        let emf = (psi_M * (f64::from(n_p) * out.speed_est).abs()).max(self.state.lock.voltage());
        let matters = emf <= 2.0 * R_s * par.limit.i;
        log.warn("lock_lost", || {
            let resistive = if matters {
                format!("R_s = {R_s} Ohm, compensation.u_dead = {} V, ", par.compensation.u_dead)
            } else {
                String::new()
            };
            let Phases { a, b, c } = self.inputs.i;
            let none = if a.abs().max(b.abs()).max(c.abs()) > 0.0 {
                ""
            } else {
                "the measured currents are 0 A, perhaps because i_a, i_b and i_c are not connected; "
            };
            format!(
                "lock_lost = {:.2}, 1 or more: {none}the estimate does not fit the applied voltage, or the speed is not reached; \
                 the rotor is not where theta_est = {:.4} rad and speed_est = {:.4} rad/s say, the load exceeds the torque, or the \
                 controller's {resistive}L_d = {L_d} H, L_q = {L_q} H, psi_M = {psi_M} Wb do not fit the machine and its inverter",
                out.lock_lost, out.theta_est, out.speed_est
            )
        });
    }
}

type V = Row<Block<SensorlessController>>;

const TABLE: &Table<Block<SensorlessController>> = &Table::new(ROWS);

/// The inputs, the outputs, and last the parameters.
pub(crate) const ROWS: &[V] = rows![
    V::input("speed_ref", &SPEED, "Mechanical speed reference", |m| &mut m.model.inputs.speed_ref),
    V::input("tau_ref", &NEWTON_METER, TAU_REF, |m| &mut m.model.inputs.tau_ref)
        .read_with("speed_loop.torque_mode", "true"),
    V::boolean_input("enable", "The controller runs; false: it commands 0 V, and starts anew when set to true", |m| {
        &mut m.model.inputs.enable
    })
    .optional(),
    V::boolean_input(
        "asc",
        "Active short circuit: the controller rests as without enable, and short_circuit passes the request to the inverter",
        |m| &mut m.model.inputs.asc,
    )
    .optional(),
    V::part("", &Part { table: MODE_INPUTS, lens: |m| &mut m.model.inputs.modes }),
    V::input("i_a", &AMPERE, "Measured stator current of phase a", |m| &mut m.model.inputs.i.a),
    V::input("i_b", &AMPERE, "Measured stator current of phase b", |m| &mut m.model.inputs.i.b),
    V::input("i_c", &AMPERE, "Measured stator current of phase c", |m| &mut m.model.inputs.i.c),
    V::input("u_dc", &VOLT, "Measured DC-link voltage", |m| &mut m.model.inputs.u_dc).at_least(0.0),
    V::input("theta_meas", &RADIAN, "Electrical rotor angle of a sensor", |m| &mut m.model.inputs.theta_meas)
        .read_with("estimator", "Sensored"),
    V::input("speed_meas", &SPEED, "Mechanical speed of a sensor", |m| &mut m.model.inputs.speed_meas)
        .read_with("estimator", "Sensored"),
    V::boolean_input("sensor_valid", "The sensor works; false: sensor.fallback takes over from it, if there is one", |m| {
        &mut m.model.inputs.sensor_valid
    })
    .optional(),
    V::boolean_input(
        "commission_start",
        "A rising edge starts the self-commissioning that commission.mode selects, while the controller is enabled; false aborts it, and \
         the controller works",
        |m| &mut m.model.inputs.commission_start,
    )
    .optional(),
    V::part("", &Part { table: OUTPUTS, lens: |m| &mut m.out }),
    V::part("", &Part { table: IDENTIFIED, lens: |m| &mut m.model.commissioning }),
    V::part("", &Part { table: PARAMETERS, lens: |m| &mut m.model.parameters }),
];

#[cfg(test)]
mod tests;
