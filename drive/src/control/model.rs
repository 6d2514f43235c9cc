//! The model `SensorlessController`: one digital controller on its own sample grid.

use crate::control::current::CurrentGains;
use crate::control::lock::{LOST, Lock, LockGains};
use crate::control::polarity::Searching;
use crate::control::reference::greatest_torque;
use crate::control::signals::{ControllerInputs, ControllerOutputs};
use crate::control::speed::SpeedGains;
use crate::control::start::{CURRENT_FREQUENCY, INJECTION, Led};
use crate::control::state::{Command, Gains, InUse, State, context};
use crate::control::tables::{ControllerParameters, OUTPUTS, PARAMETERS};
use crate::estimator::{Class, Estimate, Estimator, Injection, Kind, Sample};
use crate::frame::{AlphaBeta, Axis, DqHat, Estimated, Phases};
use crate::math::wrap;
use crate::modulation::{dead_time_loss, limit_to_hexagon};
use fmu_core::unit::{AMPERE, NEWTON_METRE, RADIAN, SPEED, VOLT};
use fmu_core::{Block, Elapsed, Experiment, Fault, Info, Model, Part, Row, SampleGrid, Step, Table, Terminal};
use serde::{Deserialize, Serialize};

/// Maximum rotation of the estimate in one sample in rad: a faster one is a lost estimator.
const MAX_TURN: f64 = 20.0 * std::f64::consts::PI;

/// Maximum number of samples in one communication step: bounds its duration for any step size and `T_s`.
const MAX_SAMPLES: f64 = 1e7;

/// Sensorless speed control of a permanent-magnet synchronous machine (Rasmussen, Fig. 2).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SensorlessController {
    /// Inputs.
    pub inputs: ControllerInputs,
    /// Parameters.
    pub parameters: ControllerParameters,
    gains: Gains,
    /// Those of the last sample.
    last_gains: Gains,
    /// A parameter was set since the last sample.
    tuned: bool,
    in_use: InUse,
    state: State,
}

impl SensorlessController {
    /// One sample of the controller: currents in, voltage references out. What a lost estimator makes of its state may
    /// leave the finite numbers; then the controller starts again from where it was last, at rest, and says so.
    fn sample(&mut self) -> ControllerOutputs {
        if !self.inputs.enable {
            return self.rest();
        }
        let out = self.control();
        self.state.k += 1;
        let sane = (out.speed_est * f64::from(self.parameters.motor.n_p) * self.parameters.T_s).abs() < MAX_TURN;
        if sane && out.is_finite() { out } else { self.start_again() }
    }

    /// Not enabled: all but the grid and what is shown stands as before the first sample.
    #[cold]
    fn rest(&mut self) -> ControllerOutputs {
        let Self { parameters: par, state, .. } = self;
        let new = State::new(par, false);
        let out = new.computed.clone();
        *state = State { samples: state.samples, shown: state.shown.clone(), ..new };
        out
    }

    /// At the angle of the last sample and at rest; no voltage.
    #[cold]
    fn start_again(&mut self) -> ControllerOutputs {
        let Self { parameters: par, state, .. } = self;
        let theta = state.computed.theta_est;
        let kind = Kind::of(par.estimator).unwrap_or(Kind::Rasmussen);
        let nothing = Sample { k: state.k, ..Sample::default() };
        let (estimator, _) = Estimator::start(kind, &context(par, &par.estimators, &par.motor), &nothing, theta, 0.0);
        *state = State {
            samples: state.samples,
            k: state.k,
            estimator,
            lock: Lock::lost(),
            computed: state.computed.clone(),
            shown: state.shown.clone(),
            ..State::default()
        };
        ControllerOutputs { theta_est: theta, lock_lost: LOST, enabled: true, ..ControllerOutputs::default() }
    }

    fn control(&mut self) -> ControllerOutputs {
        let Self { inputs, parameters: par, gains, last_gains, tuned, in_use, state } = self;
        let (motor, T_s) = (&par.motor, par.T_s);
        let n_p = f64::from(motor.n_p);
        let i = par.sensor.measure(inputs.i, state.samples).to_stator();
        let first = state.k == 0;
        let tuned = std::mem::take(tuned) && !first;
        if first {
            in_use.take_up(par);
        }
        // The command that acted since the last sample: the newest one without a delay.
        let acted = match (par.delay, state.commands) {
            (0, [newest, ..]) => newest,
            (1, [_, older, _]) => older,
            (_, [.., oldest]) => oldest,
        };
        let sample = Sample {
            k: state.k,
            i,
            i_last: if first { i } else { state.i_last },
            u: acted.u,
            u_injected: acted.injected,
            u_pi: state.u_pi,
            i_ref: state.i_ref,
            tau_ref: state.tau_ref,
            theta_meas: inputs.theta_meas,
            w_meas: n_p * inputs.speed_meas,
            u_dc: inputs.u_dc,
        };
        let kind = Kind::of(par.estimator).unwrap_or(Kind::Rasmussen);
        let begins = state.lead.is_some() || state.search.is_some();
        let (estimate, led, searching) = state.estimate(kind, gains, par, in_use, inputs, &sample);
        if tuned {
            let new = context(par, &par.estimators, motor);
            state.estimator.retune(&context(par, &in_use.estimators, &in_use.motor), &new);
            in_use.take_up(par);
        }
        let Estimate { theta, w, i: controlled, injection } = estimate;
        let speed = w / n_p;

        let axis = Axis::<Estimated>::at(theta);
        let i_hat = axis.from_stator(controlled);
        let (i_ref, current_limited) = if let Some(Led::Frame(.., i_ref)) = led {
            (i_ref, false)
        } else if state.search.is_some() {
            (DqHat::ZERO, false)
        } else {
            let old = (tuned && !begins).then_some(&last_gains.speed);
            state.references(kind, gains, old, par, inputs, speed)
        };
        if tuned && !matches!(searching, Some(Searching::Found(_))) {
            state.current.retune(&last_gains.current, &gains.current, i_ref, i_hat);
        }

        let wanted = if let Some(Searching::Voltage(_, u)) = searching {
            u
        } else {
            state.current.command(&gains.current, motor, i_ref, i_hat, w)
        };
        // The command acts from `delay` to `delay + 1` samples from now: turned to the middle of that interval.
        let acting = Axis::<Estimated>::at(theta + (f64::from(par.delay) + 0.5) * T_s * w);
        let injected = match injection {
            Injection::None => AlphaBeta::ZERO,
            Injection::Stator(u) => u,
            Injection::Estimated(u) => acting.to_stator(u),
        };
        let whole = acting.to_stator(wanted) + injected;
        let (command, mut voltage_limited) = within_hexagon(whole, inputs.u_dc);
        let cut = acting.from_stator(command - injected) - wanted;
        state.current.integrate(&gains.current, i_ref - i_hat, cut, T_s);
        let share = if whole.magnitude() > 0.0 { command.magnitude() / whole.magnitude() } else { 1.0 };
        let [newest, older, _] = state.commands;
        state.commands = [Command { u: command, injected: injected * share }, newest, older];
        let compensated = if par.compensation.u_dead > 0.0 {
            let legs = Phases::from_stator(acting.to_stator(i_ref));
            let loss = dead_time_loss(par.compensation.u_dead, par.compensation.i_zero, legs);
            let (compensated, limited) = within_hexagon(command + loss, inputs.u_dc);
            voltage_limited |= limited;
            compensated
        } else {
            command
        };
        // A current that leads is no estimate, and an axis that is still searched none either.
        let lock_lost = if matches!(led, Some(Led::Frame(..))) || searching.is_some() {
            state.lock = Lock::default();
            0.0
        } else {
            state.lock.update(&gains.lock, motor, &sample, axis, w)
        };
        state.i_last = i;
        state.i_ref = i_ref;
        state.tau_ref = motor.torque(i_ref.d(), i_ref.q());
        state.u_pi = state.current.output(&gains.current, i_ref - i_hat);

        ControllerOutputs {
            u: Phases::from_stator(compensated),
            speed_est: speed,
            theta_est: wrap(theta + T_s * w),
            i: i_hat.into(),
            i_ref: i_ref.into(),
            lock_lost,
            enabled: true,
            voltage_limited,
            current_limited,
        }
    }
}

/// The voltage `u` (V) within the hexagon of `u_dc` (V), and whether it was outside.
fn within_hexagon(u: AlphaBeta, u_dc: f64) -> (AlphaBeta, bool) {
    let phases = Phases::from_stator(u);
    (limit_to_hexagon(phases, u_dc), phases.span() > u_dc)
}

impl Model for SensorlessController {
    type Outputs = ControllerOutputs;

    const INFO: Info = Info {
        name: "SensorlessController",
        description: "Sensorless speed control of a permanent-magnet synchronous machine, zero speed included",
        experiment: Experiment { start: 0.0, stop: 1.0, step: 1e-4 },
        documentation: crate::documentation::CONTROLLER,
        ..crate::PROJECT
    };

    const TABLE: &'static Table<Block<Self>> = TABLE;

    const TERMINALS: &'static [Terminal] = crate::terminals::CONTROLLER;

    const ICON: Option<&'static str> = Some(include_str!("../../icons/sensorless_controller.svg"));

    const STATE_VERSION: u16 = 5;

    fn derive(&mut self) {
        let ControllerParameters { current, speed_loop, motor, J, limit, estimator, lock, T_s, .. } = &self.parameters;
        let k = motor.torque_constant();
        let tau = if Kind::of(*estimator).is_some_and(|kind| kind.class() == Class::FluxObserver) {
            limit.tau
        } else {
            greatest_torque(motor, limit, current.mtpa)
        };
        let speed = SpeedGains::new(speed_loop, *J, k);
        if !self.tuned {
            self.last_gains.clone_from(&self.gains);
        }
        self.tuned = true;
        self.gains = Gains {
            current: CurrentGains::new(current, motor),
            speed,
            k,
            i_tau: tau / k,
            lock: LockGains::new(lock, motor, *T_s),
        };
    }

    fn validate(&self) -> Result<(), Fault> {
        let ControllerParameters { limit, zero_speed, estimator, start, polarity, motor, T_s, s_2, .. } =
            &self.parameters;
        let Some(kind) = Kind::of(*estimator) else {
            return Err(Fault::value("estimator", estimator, "one of the enumeration's values"));
        };
        if start.mode == CURRENT_FREQUENCY && start.i > limit.i {
            let allowed = format!("at most limit.i = {} A", limit.i);
            return Err(Fault::value("start.i", format!("{} A", start.i), allowed));
        }
        if start.mode == INJECTION {
            if !kind.class().injects() {
                return Err(Fault::new(format!(
                    "start.mode = {INJECTION} (Injection) and estimator = {estimator} ({}): the start by injection needs an \
                     estimator that injects",
                    kind.name()
                )));
            }
            polarity.validate(motor, *T_s, *s_2, limit.i)?;
        }
        let par = &self.parameters;
        kind.validate(&context(par, &par.estimators, &par.motor))?;
        if zero_speed.i_0 > limit.i {
            let allowed = format!("at most limit.i = {} A", limit.i);
            return Err(Fault::value("zero_speed.i_0", format!("{} A", zero_speed.i_0), allowed));
        }
        Ok(())
    }

    fn initialise(&mut self) {
        self.state = State::new(&self.parameters, self.inputs.enable);
        self.tuned = false;
    }

    fn output(&self, _now: Elapsed, out: &mut ControllerOutputs) {
        out.clone_from(&self.state.shown);
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        let grid = SampleGrid { period: self.parameters.T_s };
        let end = step.end();
        if !self.inputs.is_finite() {
            return Err(Fault::new("an input of the controller is not a finite number"));
        }
        if end.minus_periods(self.state.samples, grid.period) > MAX_SAMPLES * grid.period {
            let longest = format!("at most {MAX_SAMPLES} sample periods of {} s", grid.period);
            return Err(Fault::value("the step size", format!("{} s", step.h), longest));
        }
        while grid.passed(self.state.samples, end) {
            self.state.shown = self.state.computed.clone();
            self.state.computed = self.sample();
            self.state.samples += 1;
        }
        if grid.reached(self.state.samples, end) {
            self.state.shown = self.state.computed.clone();
        }
        Ok(())
    }
}

type V = Row<Block<SensorlessController>>;

const TABLE: &Table<Block<SensorlessController>> = &Table::new(
    const {
        &[
            V::input("i_a", &AMPERE, "Measured stator current of phase a", |m| &mut m.model.inputs.i.a),
            V::input("i_b", &AMPERE, "Measured stator current of phase b", |m| &mut m.model.inputs.i.b),
            V::input("i_c", &AMPERE, "Measured stator current of phase c", |m| &mut m.model.inputs.i.c),
            V::input("u_dc", &VOLT, "Measured DC-link voltage", |m| &mut m.model.inputs.u_dc).at_least(0.0),
            V::input("speed_ref", &SPEED, "Mechanical speed reference", |m| &mut m.model.inputs.speed_ref),
            V::input(
                "theta_meas",
                &RADIAN,
                "Electrical rotor angle of a sensor; read only by the estimator Sensored",
                |m| &mut m.model.inputs.theta_meas,
            ),
            V::input("speed_meas", &SPEED, "Mechanical speed of a sensor; read only by the estimator Sensored", |m| {
                &mut m.model.inputs.speed_meas
            }),
            V::input("tau_ref", &NEWTON_METRE, "Torque reference; read only with speed_loop.torque_mode", |m| {
                &mut m.model.inputs.tau_ref
            }),
            V::boolean_input(
                "enable",
                "The controller runs; false: it commands 0 V, and starts anew when set to true",
                |m| &mut m.model.inputs.enable,
            ),
            V::part("", &Part { table: OUTPUTS, lens: |m| &mut m.out }),
            V::part("", &Part { table: PARAMETERS, lens: |m| &mut m.model.parameters }),
        ]
    },
);
