//! The controller state from one sample to the next, and the source of the angle: a start sequence or the estimator.

use crate::battery::Battery;
use crate::catch::{Catch, Refusal};
use crate::current::CurrentController;
use crate::current_limit::Fresh;
use crate::estimator::{Context, Estimate, Estimator, EstimatorParameters, Injection, Kind, Sample};
use crate::gains::{Gains, Law};
use crate::lock::Lock;
use crate::modes::Follows;
use crate::overload::Overload;
use crate::polarity::{PolaritySearch, SearchStep};
use crate::sensor::Offset;
use crate::signals::{ControllerInputs, ControllerOutputs};
use crate::speed::{SpeedController, SpeedGains};
use crate::stands::Stands;
use crate::start::{CurrentFrequencyStart, StartMode, StartState, StartStep};
use crate::tables::ControllerParameters;
use crate::trip::Trip;
use crate::weakening::Weakening;
use crate::zero_speed::ZeroSpeed;
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::math::{at_most, within, wrap};
use drive_base::motor::Motor;
use serde::{Deserialize, Serialize};

/// Parameters available to an estimator: its own and the machine estimates.
pub(super) fn context<'a>(
    par: &'a ControllerParameters,
    estimators: &'a EstimatorParameters,
    motor: &'a Motor,
) -> Context<'a> {
    Context { par: estimators, motor, J: par.J, T_s: par.T_s }
}

/// Parameters the estimator uses: at the first sample after retuning, still the previous ones.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct InUse {
    pub(super) estimators: EstimatorParameters,
    pub(super) motor: Motor,
}

impl InUse {
    pub(super) fn take_up(&mut self, par: &ControllerParameters) {
        self.estimators.clone_from(&par.estimators);
        self.motor.clone_from(&par.motor);
    }
}

/// Source of the angle used for current control.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) enum Leader {
    /// The estimator.
    #[default]
    Estimator,
    /// The I-f start: the rotor follows its current vector.
    Start(CurrentFrequencyStart),
    /// The search for the north pole at standstill.
    Search(PolaritySearch),
}

impl Leader {
    /// The initial source for `start.mode` = `mode`.
    fn of(mode: StartMode) -> Self {
        match mode {
            StartMode::CurrentFrequency => Self::Start(CurrentFrequencyStart::default()),
            StartMode::Injection => Self::Search(PolaritySearch::default()),
            StartMode::Direct => Self::Estimator,
        }
    }

    /// What the start does.
    pub(super) fn start_state(&self) -> StartState {
        match self {
            Self::Estimator => StartState::Running,
            Self::Start(start) => start.state(),
            Self::Search(_) => StartState::Aligning,
        }
    }
}

/// Action of the loops in a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mode {
    /// A start sequence is active: control this current (A), without speed control.
    Current(DqHat),
    /// A start sequence is active: apply this voltage (V), without current control.
    Voltage(DqHat),
    /// The first sample of speed and current control after the I-f start.
    AfterStart,
    /// The first sample of speed and current control after the search.
    AfterSearch,
    /// Speed and current control.
    ClosedLoop,
}

/// The references of a sample.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct References {
    /// Currents in A.
    pub(super) i: DqHat,
    /// Whether a limit reduced them.
    pub(super) limited: bool,
    /// Maximum magnitude of negative and of positive torque in N.m.
    pub(super) tau: (f64, f64),
    /// Whether field weakening lowers i_d.
    pub(super) weakens: bool,
}

/// Values passed from one sample to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    /// Number of samples taken: the next one is at `samples` T_s.
    #[serde(with = "fixed_size")]
    pub(super) samples: u64,
    /// Number of samples since the controller began to operate: at t_0, or when it was enabled.
    #[serde(with = "fixed_size")]
    pub(super) k: u64,
    pub(super) estimator: Estimator,
    pub(super) leader: Leader,
    /// The flying start, until it ends.
    pub(super) catch: Option<Catch>,
    /// Angle (rad) and electrical speed (rad/s) at which the flying start has found the rotor.
    pub(super) found: Option<(f64, f64)>,
    /// The rotor was caught turning against the speed reference, and the I-f start will reverse it.
    pub(super) against: bool,
    /// Need of i_q in A at standstill, with `zero_speed.by_need`.
    pub(super) need: f64,
    /// What the loops have followed at the last sample.
    pub(super) follows: Follows,
    /// Samples in which the torque limits rise after a flying start.
    #[serde(with = "fixed_size")]
    pub(super) rise: u64,
    /// Why the flying start took the rotor to be at rest although it seemed to turn.
    pub(super) slow: Option<Refusal>,
    pub(super) speed: SpeedController,
    pub(super) current: CurrentController,
    /// Recent commands, the newest first: the one at `timing.delay` was applied since the last sample.
    pub(super) commands: [Command; 3],
    /// Current of the last sample in A.
    pub(super) i_last: AlphaBeta,
    /// Whether the measured currents are new.
    pub(super) fresh: Fresh,
    /// References of the last sample in A.
    pub(super) i_ref: DqHat,
    /// Torque reference of the last sample in N.m.
    pub(super) tau_ref: f64,
    /// Speed reference of the last sample in rad/s, on its ramp.
    pub(super) w_ref: f64,
    /// Output of the current PI at the last sample in V.
    pub(super) u_pi: DqHat,
    pub(super) offset: Offset,
    pub(super) lock: Lock,
    pub(super) trip: Trip,
    /// The sensor is lost: `sensor.fallback` replaces it until enable falls.
    pub(super) sensor_lost: bool,
    pub(super) weakening: Weakening,
    pub(super) battery: Battery,
    /// Time in s for which a limit has reduced the references, while field weakening or limits of the DC link are in use.
    pub(super) limited_for: f64,
    /// Time in s for which a torque has been requested without a speed in the estimate; [`Stands`](crate::stands).
    pub(super) stands: Stands,
    /// Watch for a load above the torque of the drive.
    pub(super) overload: Overload,
    /// Outputs of the last sample.
    pub(super) computed: ControllerOutputs,
    /// The outputs of the last sample wait for the next sample instant.
    pub(super) hidden: bool,
    /// Outputs visible now.
    pub(super) shown: ControllerOutputs,
}

impl State {
    /// Before the first sample.
    pub(super) fn new(par: &ControllerParameters, enabled: bool) -> Self {
        let shown = ControllerOutputs {
            theta_est: wrap(par.theta_est),
            enabled,
            R_s_est: par.motor.R_s,
            ..ControllerOutputs::default()
        };
        let catch = par.start.catch.then(Catch::default);
        Self {
            leader: Leader::of(par.start.mode),
            catch,
            w_ref: par.speed_est,
            computed: shown,
            shown,
            ..Self::default()
        }
    }

    /// Changes from the I-f start's frame at `theta_frame` (rad) to the estimated one at `theta` (rad), which turns at
    /// `w` (rad/s), with unchanged voltage and torque.
    pub(super) fn take_over(
        &mut self,
        gains: &Gains,
        par: &ControllerParameters,
        speed_ref: f64,
        sample: &Sample,
        (theta, w, theta_frame): (f64, f64, f64),
    ) {
        let motor = &par.motor;
        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let i_q = motor.torque(i.d(), i.q()) / gains.k;
        let in_frame = Axis::<Estimated>::at(theta_frame).from_stator(sample.i);
        self.current = self.current.taken_over(&gains.off_rotor, in_frame, &gains.current, theta_frame - theta);
        // A ramp begins at the rotor's speed.
        self.w_ref = w / f64::from(motor.n_p);
        let w_ref = par.speed_loop.ramped(self.w_ref, speed_ref, par.T_s);
        self.speed = SpeedController::take_over(&gains.speed, w_ref, w / f64::from(motor.n_p), i_q);
        self.leader = Leader::Estimator;
    }

    /// The estimate at a sample, from the active source, and the action of the loops.
    pub(super) fn estimate(
        &mut self,
        gains: &Gains,
        par: &ControllerParameters,
        in_use: &InUse,
        inputs: &ControllerInputs,
        sample: &Sample,
    ) -> (Estimate, Mode) {
        let context = context(par, &in_use.estimators, &in_use.motor);
        let kind = par.estimator_with(self.sensor_lost);
        let first = (sample.k == 0).then(|| {
            let (theta, w) = self.found.unwrap_or((par.theta_est, f64::from(par.motor.n_p) * par.speed_est));
            let (estimator, estimate) = Estimator::start(kind, &context, sample, theta, w);
            self.estimator = estimator;
            estimate
        });
        let first = first.or_else(|| self.fall_back(kind, &context, sample));
        let first = first.or_else(|| self.come_back(gains, kind, &context, sample));
        let reference = if par.speed_loop.torque_mode { inputs.tau_ref } else { inputs.speed_ref };
        match &mut self.leader {
            Leader::Start(start) => match start.update(&par.start, &context, par.theta_est, reference, sample) {
                StartStep::Current { theta, w, i_ref } => (Estimate::new(theta, w, sample), Mode::Current(i_ref)),
                StartStep::HandOver { theta, w, theta_frame } => {
                    self.estimator.place(&context, sample, theta, w);
                    self.take_over(gains, par, inputs.speed_ref, sample, (theta, w, theta_frame));
                    (Estimate::new(theta, w, sample), Mode::AfterStart)
                }
            },
            Leader::Search(search) => match search.update(&par.polarity, &context, sample) {
                SearchStep::Inject => {
                    let estimate = first.unwrap_or_else(|| self.estimator.update(&context, sample));
                    search.sees(estimate.theta);
                    (estimate, Mode::Current(DqHat::ZERO))
                }
                SearchStep::Pulse { theta, u } => (Estimate::new(theta, 0.0, sample), Mode::Voltage(u)),
                SearchStep::Found(theta) => {
                    self.estimator.place(&context, sample, theta, 0.0);
                    self.begin_at_rest();
                    (Estimate::new(theta, 0.0, sample), Mode::AfterSearch)
                }
            },
            Leader::Estimator => (first.unwrap_or_else(|| self.estimator.update(&context, sample)), Mode::ClosedLoop),
        }
    }

    /// The estimate of the fallback, if the sensor was lost at this sample: it starts where the last one with the sensor leads.
    fn fall_back(&mut self, kind: Kind, context: &Context, sample: &Sample) -> Option<Estimate> {
        if !self.sensor_lost || !matches!(self.estimator, Estimator::Sensored(_)) {
            return None;
        }
        let (theta, w) = (self.computed.theta_est, f64::from(context.motor.n_p) * self.computed.speed_est);
        (self.estimator, _) = Estimator::start(kind, context, sample, theta, w);
        self.estimator.place(context, sample, theta, w);
        Some(Estimate::new(theta, w, sample))
    }

    /// The estimate of the sensor, if it takes over again at this sample: with the voltage and the torque of its fallback.
    fn come_back(&mut self, gains: &Gains, kind: Kind, context: &Context, sample: &Sample) -> Option<Estimate> {
        if kind != Kind::Sensored || matches!(self.estimator, Estimator::Sensored(_)) {
            return None;
        }
        let (estimator, estimate) = Estimator::start(kind, context, sample, 0.0, 0.0);
        let motor = context.motor;
        let turn = self.computed.theta_est - sample.theta_meas;
        self.current = self.current.in_frame_behind(turn);
        let i = Axis::<Estimated>::at(sample.theta_meas).from_stator(sample.i);
        let speed = sample.w_meas / f64::from(motor.n_p);
        let i_q = motor.torque(i.d(), i.q()) / gains.k;
        self.speed = SpeedController::take_over(&gains.speed, self.w_ref, speed, i_q);
        (self.estimator, self.leader) = (estimator, Leader::Estimator);
        Some(estimate)
    }

    /// The references at the estimated mechanical `speed` (rad/s) in addition to an `injection`; `old` are the gains of a speed loop
    /// that is retuned at this sample.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "as for `SensorlessController::cycle`")]
    pub(super) fn references(
        &mut self,
        gains: &Gains,
        old: Option<&SpeedGains>,
        par: &ControllerParameters,
        inputs: &ControllerInputs,
        speed: f64,
        injection: Injection,
    ) -> References {
        self.w_ref = par.speed_loop.ramped(self.w_ref, inputs.speed_ref, par.T_s);
        let w_ref = self.w_ref;
        if let Some(old) = old {
            self.speed.retune(old, &gains.speed, w_ref, speed);
        }
        let mut i_0 = par.zero_speed.i_0;
        if par.dc.used {
            i_0 = at_most(i_0, par.dc.i_0(&par.motor, inputs.u_dc));
        }
        if par.zero_speed.by_need {
            self.need = ZeroSpeed::need(self.need, self.i_ref.q(), par.T_s);
            i_0 = ZeroSpeed::i_0_for(i_0, self.need);
        }
        let mut law = gains.law(par, i_0, speed);
        if par.speed_loop.torque_mode && par.zero_speed.releases(inputs.tau_ref) || par.modes.frees(self.follows) {
            law = law.released();
        }
        let limit = law.limit * inputs.derating;
        if par.weakening.used || par.dc.used || par.modes.tau_used {
            return self.limited(gains, par, inputs, (speed, w_ref), &law, injection);
        }
        let (i_q_ref, requested) = if par.speed_loop.torque_mode {
            let requested = inputs.tau_ref / gains.k;
            let limited = if par.modes.speed.used {
                self.in_range(gains, par, (speed, requested), (-limit, limit))
            } else {
                within(requested, limit)
            };
            (limited, requested)
        } else {
            self.speed.update(&gains.speed, w_ref, speed, (-limit, limit), par.T_s)
        };
        let tau = gains.k * limit;
        let i = gains.currents(par, &law, i_q_ref);
        References { i, limited: requested.abs() > limit, tau: (tau, tau), weakens: false }
    }

    /// The reference of i_q (A) in torque mode for the `requested` one (A), within the range of the speed.
    #[cold]
    #[inline(never)]
    fn in_range(&mut self, gains: &Gains, par: &ControllerParameters, at: (f64, f64), limits: (f64, f64)) -> f64 {
        self.speed.within_range((&gains.speed, par.speed_loop.bandwidth), &par.modes.speed, at, limits, par.T_s)
    }

    /// [`references`](Self::references) with field weakening or with limits of the DC link or by the inputs.
    #[inline(never)]
    fn limited(
        &mut self,
        gains: &Gains,
        par: &ControllerParameters,
        inputs: &ControllerInputs,
        (speed, w_ref): (f64, f64),
        law: &Law,
        injection: Injection,
    ) -> References {
        let w = f64::from(par.motor.n_p) * speed;
        let at = (w, inputs.u_dc, injection.magnitude());
        let (mut low, mut high) = if par.weakening.used {
            self.weakening.limits(&gains.weakening, &par.weakening, at, law.limit, self.k)
        } else {
            (law.limit, law.limit)
        };
        if par.dc.used {
            let (least, most) = self.battery.limits(&par.dc, &par.motor, inputs.u_dc, speed, self.i_ref);
            (low, high) = (low.min(least / gains.k), high.min(most / gains.k));
        }
        let derated = law.limit * inputs.derating;
        (low, high) = (low.min(derated), high.min(derated));
        if par.modes.tau_used {
            (low, high) = (low.min(-inputs.modes.tau_min / gains.k), high.min(inputs.modes.tau_max / gains.k));
        }
        let (i_q_ref, requested) = if par.speed_loop.torque_mode {
            let requested = inputs.tau_ref / gains.k;
            let limited = if par.modes.speed.used {
                self.in_range(gains, par, (speed, requested), (-low, high))
            } else {
                requested.clamp(-low, high)
            };
            (limited, requested)
        } else {
            let (limited, wanted) = self.speed.update(&gains.speed, w_ref, speed, (-low, high), par.T_s);
            self.speed.follow(par.speed_loop.bandwidth, limited - wanted, par.T_s);
            (limited, wanted)
        };
        let limited = requested > high || requested < -low;
        self.limited_for = if limited { self.limited_for + par.T_s } else { 0.0 };
        let tau = gains.k * i_q_ref;
        let plain = || gains.currents(par, law, i_q_ref);
        if !par.weakening.used {
            return References { i: plain(), limited, tau: (gains.k * low, gains.k * high), weakens: false };
        }
        let i = self.weakening.currents(&gains.weakening, tau, w, par.limit.i_q, par.current.mtpa, plain);
        References { i, limited, tau: (gains.k * low, gains.k * high), weakens: self.weakening.weakens }
    }

    /// The north pole is known: the estimator supplies the angle, and both loops start at rest.
    fn begin_at_rest(&mut self) {
        (self.current, self.speed) = (CurrentController::default(), SpeedController::default());
        self.leader = Leader::Estimator;
    }
}

/// A voltage command in stator axes, limited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Command {
    /// Total voltage in V.
    pub(super) u: AlphaBeta,
    /// The injected part, in V.
    pub(super) injected: AlphaBeta,
}

/// A count stored in eight bytes regardless of its value, so that every stored state has the same size.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gains::tests::controller;

    /// The voltage in stator axes stays when the frame changes at the handover, and so does the torque.
    #[test]
    fn a_handover_keeps_voltage_and_torque() {
        let (gains, par) = controller(|p| p.speed_loop.ramp = 100.0);
        let mut state = State::default();
        state.current.integrate(&gains.current, DqHat::new(30.0, -50.0), None, 1e-2);
        let (theta, theta_frame, w) = (0.9, 1.3, 60.0);
        let voltage = |state: &State, theta: f64| {
            Axis::<Estimated>::at(theta).to_stator(state.current.output(&gains.current, DqHat::ZERO))
        };
        let before = voltage(&state, theta_frame);
        let i = Axis::<Estimated>::at(theta).to_stator(DqHat::new(0.5, 2.0));
        let sample = Sample { i, ..Sample::default() };
        state.take_over(&gains, &par, 100.0, &sample, (theta, w, theta_frame));
        assert!((voltage(&state, theta) - before).magnitude() < 1e-12 && before.magnitude() > 1.0);
        let speed = w / f64::from(par.motor.n_p);
        assert!((state.w_ref - speed).abs() < 1e-12, "the ramp begins at the rotor's speed: {}", state.w_ref);
        let inputs = ControllerInputs { speed_ref: 100.0, ..ControllerInputs::default() };
        let References { i, .. } = state.references(&gains, None, &par, &inputs, speed, Injection::None);
        assert!((i.q() - 2.0).abs() < 1e-9, "the torque stays: {i:?}");
    }

    /// Beyond the base speed, the references give the torque of the limit in the requested direction, and the integral of the
    /// speed loop follows the limit.
    #[test]
    fn the_limits_of_field_weakening_act_in_both_directions() {
        let set = |p: &mut ControllerParameters| {
            (p.motor, p.estimator) = (Motor::IPMSM_2_2_KW, crate::estimator::Kind::Sensored);
            (p.weakening.used, p.current.mtpa, p.limit.i, p.limit.i_q) = (true, true, 15.0, 15.0);
        };
        let (gains, mut par) = controller(set);
        let inputs =
            |tau_ref| ControllerInputs { u_dc: 540.0, speed_ref: 400.0, tau_ref, ..ControllerInputs::default() };
        for speed in [250.0, -250.0] {
            par.speed_loop.torque_mode = true;
            let at = |tau_ref: f64| {
                let mut state = State::default();
                (0..20)
                    .map(|_| state.references(&gains, None, &par, &inputs(tau_ref), speed, Injection::None))
                    .last()
                    .unwrap()
            };
            for tau_ref in [100.0, -100.0] {
                let References { i, tau: (low, high), limited, .. } = at(tau_ref);
                let (tau, most) = (par.motor.torque(i.d(), i.q()), if tau_ref > 0.0 { high } else { -low });
                assert!(limited && (tau / most - 1.0).abs() < 0.02, "{speed} rad/s: {tau} N.m instead of {most} N.m");
            }
        }
        par.speed_loop.torque_mode = false;
        let mut state = State { w_ref: 400.0, ..State::default() };
        state.speed = SpeedController::take_over(&gains.speed, 400.0, 250.0, 14.0);
        let wanted = |state: &State| state.speed.clone().update(&gains.speed, 400.0, 250.0, (-99.0, 99.0), 1e-4).1;
        let before = wanted(&state);
        for _ in 0..500 {
            state.references(&gains, None, &par, &inputs(0.0), 250.0, Injection::None);
        }
        let after = wanted(&state);
        assert!(after < before - 1.0, "{before} A, later {after} A");
    }
}
