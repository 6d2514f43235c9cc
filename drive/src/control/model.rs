//! The model `SensorlessController`: one digital controller on its own sample grid.

use crate::control::current::{CurrentController, CurrentGains};
use crate::control::lock::{LOST, Lock, LockGains};
use crate::control::polarity::{Search, Searching};
use crate::control::reference::{greatest_torque, max_torque_per_ampere};
use crate::control::speed::{SpeedController, SpeedGains};
use crate::control::start::{CURRENT_FREQUENCY, INJECTION, Lead, Led};
use crate::control::tables::{ControllerParameters, OUTPUTS, PARAMETERS};
use crate::estimator::{Context, Estimate, Estimator, Injection, Kind, Sample};
use crate::frame::{AlphaBeta, Axis, DqHat, Estimated, Phases};
use crate::math::wrap;
use crate::plant::inverter::{dead_time_loss, limit_to_hexagon};
use fmu_core::unit::{AMPERE, RADIAN, SPEED, VOLT};
use fmu_core::{Block, Elapsed, Experiment, Fault, Info, Model, Part, Row, SampleGrid, Step, Table, Terminal};
use serde::{Deserialize, Serialize};

/// Greatest turn of the estimate in one sample in rad: beyond it nothing is estimated any more.
const FASTEST: f64 = 20.0 * std::f64::consts::PI;

/// Most samples of one communication step: a step ends, whatever the importer and T_s make of it.
const MOST_SAMPLES: f64 = 1e7;

/// Inputs, read at the sample instants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerInputs {
    /// Measured stator currents in A.
    pub i: Phases,
    /// Measured DC-link voltage in V, >= 0.
    pub u_dc: f64,
    /// Mechanical speed reference in rad/s.
    pub speed_ref: f64,
    /// Electrical angle of a sensor in rad.
    pub theta_meas: f64,
    /// Mechanical speed of a sensor in rad/s.
    pub speed_meas: f64,
}

impl ControllerInputs {
    fn is_finite(&self) -> bool {
        let Self { i, u_dc, speed_ref, theta_meas, speed_meas } = self;
        [i.a, i.b, i.c, *u_dc, *speed_ref, *theta_meas, *speed_meas].iter().all(|x| x.is_finite())
    }
}

impl Default for ControllerInputs {
    fn default() -> Self {
        Self { i: Phases::default(), u_dc: 325.0, speed_ref: 0.0, theta_meas: 0.0, speed_meas: 0.0 }
    }
}

/// Outputs: what sample k computed, shown from t_k + T_s on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControllerOutputs {
    /// Stator voltage references in V, inside the hexagon of u_dc.
    pub u: Phases,
    /// Estimated mechanical speed in rad/s.
    pub speed_est: f64,
    /// Estimated electrical angle in rad, in (-pi, pi], for the instant t_k + T_s.
    pub theta_est: f64,
    /// Stator current in the estimated rotor frame in A.
    pub i: DqParts,
    /// Its reference in A.
    pub i_ref: DqParts,
    /// Whether the estimate is at the rotor: 0 yes, 1 and more no.
    pub lock_lost: f64,
}

impl ControllerOutputs {
    fn is_finite(&self) -> bool {
        let Self { u, speed_est, theta_est, i, i_ref, lock_lost } = self;
        let all = [u.a, u.b, u.c, *speed_est, *theta_est, i.d, i.q, i_ref.d, i_ref.q, *lock_lost];
        all.iter().all(|x| x.is_finite())
    }
}

/// The two components of a vector, as variables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DqParts {
    /// Along the estimated magnet axis.
    pub d: f64,
    /// Across it.
    pub q: f64,
}

impl From<DqHat> for DqParts {
    fn from(v: DqHat) -> Self {
        Self { d: v.d(), q: v.q() }
    }
}

/// Gains computed from the parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Gains {
    current: CurrentGains,
    speed: SpeedGains,
    /// Torque constant in N.m/A.
    k: f64,
    /// Greatest torque in N.m over the torque constant: the limit of the speed loop in A.
    i_tau: f64,
    lock: LockGains,
}

/// What a sample hands on to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct State {
    /// Number of samples taken: the next one is at `samples` T_s.
    #[serde(with = "fixed_size")]
    samples: u64,
    estimator: Estimator,
    /// What leads the rotor before the estimator is at work.
    lead: Option<Lead>,
    /// What finds the magnet at standstill before speed is controlled.
    search: Option<Search>,
    speed: SpeedController,
    current: CurrentController,
    /// Commands of the last sample and of the one before it.
    commands: [Command; 2],
    /// Current of the last sample in A.
    i_last: AlphaBeta,
    /// References of the last sample in A.
    i_ref: DqHat,
    /// Torque reference of the last sample in N.m.
    tau_ref: f64,
    /// Output of the current PI at the last sample in V.
    u_pi: DqHat,
    lock: Lock,
    /// Outputs of the last sample, not shown before the next instant.
    computed: ControllerOutputs,
    /// Outputs shown now.
    shown: ControllerOutputs,
}

impl State {
    /// From the frame of the lead at the angle `frame` (rad) to the estimated one at `theta` (rad), turning at `w`
    /// (rad/s): the same voltage, the same torque.
    fn take_over(
        &mut self,
        gains: &Gains,
        par: &ControllerParameters,
        speed_ref: f64,
        sample: &Sample,
        (theta, w, frame): (f64, f64, f64),
    ) {
        let motor = &par.motor;
        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let i_q = motor.torque(i.d(), i.q()) / gains.k;
        self.current = self.current.in_frame_behind(frame - theta);
        self.speed = SpeedController::take_over(&gains.speed, speed_ref, w / f64::from(motor.n_p), i_q);
        self.lead = None;
    }

    /// The estimate at a sample, whoever gives it: what leads, what searches, or the estimator.
    fn estimate(
        &mut self,
        kind: Kind,
        gains: &Gains,
        par: &ControllerParameters,
        inputs: &ControllerInputs,
        sample: &Sample,
    ) -> (Estimate, Option<Led>, Option<Searching>) {
        let context = SensorlessController::context(par);
        let led = self.lead.as_mut().map(|lead| lead.update(&par.start, &context, par.theta_est, inputs, sample));
        let searching = self.search.as_mut().map(|search| search.update(&par.polarity, &context, sample));
        let estimate = if sample.k == 0 {
            let w = f64::from(par.motor.n_p) * par.speed_est;
            let (estimator, estimate) = Estimator::start(kind, &context, sample, par.theta_est, w);
            self.estimator = estimator;
            estimate
        } else if let Some(Led::HandOver(theta, w, frame)) = led {
            self.estimator.place(&context, sample, theta, w);
            self.take_over(gains, par, inputs.speed_ref, sample, (theta, w, frame));
            Estimate::new(theta, w, sample)
        } else if led.is_some() {
            Estimate::default()
        } else if let Some(Searching::Voltage(theta, _)) = searching {
            Estimate::new(theta, 0.0, sample)
        } else if let Some(Searching::Found(theta)) = searching {
            self.estimator.place(&context, sample, theta, 0.0);
            self.found();
            Estimate::new(theta, 0.0, sample)
        } else {
            self.estimator.update(&context, sample)
        };
        if let (Some(search), Some(Searching::Estimate)) = (&mut self.search, searching) {
            search.sees(estimate.theta);
        }
        let estimate = match led {
            Some(Led::Frame(theta, w, _)) => Estimate::new(theta, w, sample),
            _ => estimate,
        };
        (estimate, led, searching)
    }

    /// The magnet is found: the loops begin at rest.
    fn found(&mut self) {
        (self.current, self.speed, self.search) = (CurrentController::default(), SpeedController::default(), None);
    }
}

/// A voltage command in stator axes, limited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Command {
    /// All of it, in V.
    u: AlphaBeta,
    /// The injected part, in V.
    injected: AlphaBeta,
}

/// A count in eight bytes whatever its value, so that every stored state has the same size.
mod fixed_size {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
    pub(super) fn serialize<S: Serializer>(count: &u64, to: S) -> Result<S::Ok, S::Error> {
        count.to_le_bytes().serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
        <[u8; 8]>::deserialize(from).map(u64::from_le_bytes)
    }
}

/// Sensorless speed control of a permanent-magnet synchronous machine (Rasmussen, Fig. 2).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SensorlessController {
    /// Inputs.
    pub inputs: ControllerInputs,
    /// Parameters.
    pub parameters: ControllerParameters,
    gains: Gains,
    state: State,
}

impl SensorlessController {
    /// What the estimator may know of the parameters.
    fn context(par: &ControllerParameters) -> Context<'_> {
        let ControllerParameters { estimators, motor, current, J, T_s, delay, .. } = par;
        Context { par: estimators, motor, current, J: *J, T_s: *T_s, delay: f64::from(*delay) }
    }

    /// One sample of the controller: currents in, voltage references out. What a lost estimator makes of its state may
    /// leave the finite numbers; then the controller starts again from where it was last, at rest, and says so.
    fn sample(&mut self) -> ControllerOutputs {
        let out = self.control();
        let sane = (out.speed_est * f64::from(self.parameters.motor.n_p) * self.parameters.T_s).abs() < FASTEST;
        if sane && out.is_finite() { out } else { self.start_again() }
    }

    /// At the angle of the last sample and at rest; no voltage.
    #[cold]
    fn start_again(&mut self) -> ControllerOutputs {
        let Self { parameters: par, state, .. } = self;
        let theta = state.computed.theta_est;
        let kind = Kind::of(par.estimator).unwrap_or(Kind::Rasmussen);
        let nothing = Sample { k: state.samples, ..Sample::default() };
        let (estimator, _) = Estimator::start(kind, &Self::context(par), &nothing, theta, 0.0);
        *state = State {
            samples: state.samples,
            estimator,
            lock: Lock::lost(),
            computed: state.computed.clone(),
            shown: state.shown.clone(),
            ..State::default()
        };
        ControllerOutputs { theta_est: theta, lock_lost: LOST, ..ControllerOutputs::default() }
    }

    fn control(&mut self) -> ControllerOutputs {
        let Self { inputs, parameters: par, gains, state } = self;
        let (motor, T_s) = (&par.motor, par.T_s);
        let n_p = f64::from(motor.n_p);
        let i = par.sensor.measure(inputs.i, state.samples).to_stator();
        let first = state.samples == 0;
        // The command that acted since the last sample: with a delay of one it is not the newest.
        let acted = state.commands[usize::from(par.delay != 0)];
        let sample = Sample {
            k: state.samples,
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
        let (estimate, led, searching) = state.estimate(kind, gains, par, inputs, &sample);
        let Estimate { theta, w, i: controlled, injection } = estimate;
        let speed = w / n_p;

        let axis = Axis::<Estimated>::at(theta);
        let i_hat = axis.from_stator(controlled);
        // The low-speed law is Rasmussen's; it would only be a loss where the angle is known.
        let i_ref = if let Some(Led::Frame(.., i_ref)) = led {
            i_ref
        } else if state.search.is_some() {
            DqHat::ZERO
        } else if kind == Kind::Rasmussen {
            let i_d_ref = par.zero_speed.i_d_ref(speed);
            let limit = par.limit.i_q_beside(i_d_ref).min(gains.i_tau);
            DqHat::new(i_d_ref, state.speed.update(&gains.speed, inputs.speed_ref, speed, limit, T_s))
        } else {
            let i_q_ref = state.speed.update(&gains.speed, inputs.speed_ref, speed, gains.i_tau, T_s);
            if par.current.mtpa { max_torque_per_ampere(motor, gains.k * i_q_ref) } else { DqHat::new(0.0, i_q_ref) }
        };

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
        let command = limit_to_hexagon(Phases::from_stator(whole), inputs.u_dc);
        let cut = acting.from_stator(command - injected) - wanted;
        state.current.integrate(&gains.current, i_ref - i_hat, cut, T_s);
        let share = if whole.magnitude() > 0.0 { command.magnitude() / whole.magnitude() } else { 1.0 };
        state.commands = [Command { u: command, injected: injected * share }, state.commands[0]];
        let compensated = if par.compensation.u_dead > 0.0 {
            let legs = Phases::from_stator(acting.to_stator(i_ref));
            let loss = dead_time_loss(par.compensation.u_dead, par.compensation.i_zero, legs);
            limit_to_hexagon(Phases::from_stator(command + loss), inputs.u_dc)
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
        }
    }
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

    const STATE_VERSION: u16 = 3;

    fn derive(&mut self) {
        let ControllerParameters { current, speed_loop, motor, J, limit, estimator, lock, T_s, .. } = &self.parameters;
        let k = motor.torque_constant();
        let tau = if Kind::of(*estimator) == Some(Kind::Rasmussen) {
            limit.tau
        } else {
            greatest_torque(motor, limit, current.mtpa)
        };
        let speed = SpeedGains::new(speed_loop, *J, k);
        self.gains = Gains {
            current: CurrentGains::new(current, motor),
            speed,
            k,
            i_tau: tau / k,
            lock: LockGains::new(lock, motor, *T_s),
        };
    }

    fn validate(&self) -> Result<(), Fault> {
        let ControllerParameters { limit, zero_speed, estimator, start, polarity, motor, T_s, c_2, .. } =
            &self.parameters;
        let Some(kind) = Kind::of(*estimator) else {
            return Err(Fault::value("estimator", estimator, "one of the enumeration's values"));
        };
        if start.mode == CURRENT_FREQUENCY && start.i > limit.i {
            let allowed = format!("at most limit.i = {} A", limit.i);
            return Err(Fault::value("start.i", format!("{} A", start.i), allowed));
        }
        if start.mode == INJECTION {
            if !kind.injects() {
                return Err(Fault::new(format!(
                    "start.mode = {INJECTION} (Injection) and estimator = {estimator} ({}): the start by injection needs an \
                     estimator that injects",
                    kind.name()
                )));
            }
            polarity.validate(motor, *T_s, *c_2, limit.i)?;
        }
        kind.validate(&Self::context(&self.parameters))?;
        if zero_speed.i_0 > limit.i {
            let allowed = format!("at most limit.i = {} A", limit.i);
            return Err(Fault::value("zero_speed.i_0", format!("{} A", zero_speed.i_0), allowed));
        }
        Ok(())
    }

    fn initialise(&mut self) {
        let shown = ControllerOutputs { theta_est: wrap(self.parameters.theta_est), ..ControllerOutputs::default() };
        let lead = (self.parameters.start.mode == CURRENT_FREQUENCY).then(Lead::default);
        let search = (self.parameters.start.mode == INJECTION).then(Search::default);
        self.state = State { computed: shown.clone(), shown, lead, search, ..State::default() };
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
        if end.minus_periods(self.state.samples, grid.period) > MOST_SAMPLES * grid.period {
            let longest = format!("at most {MOST_SAMPLES} sample periods of {} s", grid.period);
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
                "Electrical rotor angle of a sensor, read by the sensored estimator",
                |m| &mut m.model.inputs.theta_meas,
            ),
            V::input("speed_meas", &SPEED, "Mechanical speed of a sensor, read by the sensored estimator", |m| {
                &mut m.model.inputs.speed_meas
            }),
            V::part("", &Part { table: OUTPUTS, lens: |m| &mut m.out }),
            V::part("", &Part { table: PARAMETERS, lens: |m| &mut m.model.parameters }),
        ]
    },
);
