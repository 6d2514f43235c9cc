//! What the controller keeps from one sample to the next, and who leads: the start, or the estimator.

use crate::control::current::{CurrentController, CurrentGains};
use crate::control::lock::{Lock, LockGains};
use crate::control::polarity::{Search, Searching};
use crate::control::reference::max_torque_per_ampere;
use crate::control::signals::{ControllerInputs, ControllerOutputs};
use crate::control::speed::{SpeedController, SpeedGains};
use crate::control::start::{CURRENT_FREQUENCY, INJECTION, Lead, Led};
use crate::control::tables::ControllerParameters;
use crate::estimator::{Class, Context, Estimate, Estimator, EstimatorParameters, Kind, Sample};
use crate::frame::{AlphaBeta, Axis, DqHat, Estimated};
use crate::math::wrap;
use crate::motor::Motor;
use serde::{Deserialize, Serialize};

/// What an estimator may know of the parameters, with its own ones and the estimates of the machine.
pub(super) fn context<'a>(
    par: &'a ControllerParameters,
    estimators: &'a EstimatorParameters,
    motor: &'a Motor,
) -> Context<'a> {
    let ControllerParameters { current, J, T_s, delay, .. } = par;
    Context { par: estimators, motor, current, J: *J, T_s: *T_s, delay: f64::from(*delay) }
}

/// Gains computed from the parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Gains {
    pub(super) current: CurrentGains,
    pub(super) speed: SpeedGains,
    /// Torque constant in N.m/A.
    pub(super) k: f64,
    /// Greatest torque in N.m over the torque constant: the limit of the speed loop in A.
    pub(super) i_tau: f64,
    pub(super) lock: LockGains,
}

/// What the estimator works with: at the first sample after a tuning still what it was.
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

/// What a sample hands on to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    /// Number of samples taken: the next one is at `samples` T_s.
    #[serde(with = "fixed_size")]
    pub(super) samples: u64,
    /// Number of them since the controller began to work: at t_0, or when it was enabled.
    #[serde(with = "fixed_size")]
    pub(super) k: u64,
    pub(super) estimator: Estimator,
    /// What leads the rotor before the estimator is at work.
    pub(super) lead: Option<Lead>,
    /// What finds the magnet at standstill before speed is controlled.
    pub(super) search: Option<Search>,
    pub(super) speed: SpeedController,
    pub(super) current: CurrentController,
    /// Commands of the last samples, the newest first: the one at `timing.delay` acted since the last sample.
    pub(super) commands: [Command; 3],
    /// Current of the last sample in A.
    pub(super) i_last: AlphaBeta,
    /// References of the last sample in A.
    pub(super) i_ref: DqHat,
    /// Torque reference of the last sample in N.m.
    pub(super) tau_ref: f64,
    /// Speed reference of the last sample in rad/s, on its ramp.
    pub(super) w_ref: f64,
    /// Output of the current PI at the last sample in V.
    pub(super) u_pi: DqHat,
    pub(super) lock: Lock,
    /// Outputs of the last sample, not shown before the next instant.
    pub(super) computed: ControllerOutputs,
    /// Outputs shown now.
    pub(super) shown: ControllerOutputs,
}

impl State {
    /// Before the first sample.
    pub(super) fn new(par: &ControllerParameters, enabled: bool) -> Self {
        let shown = ControllerOutputs { theta_est: wrap(par.theta_est), enabled, ..ControllerOutputs::default() };
        Self {
            lead: (par.start.mode == CURRENT_FREQUENCY).then(Lead::default),
            search: (par.start.mode == INJECTION).then(Search::default),
            w_ref: par.speed_est,
            computed: shown.clone(),
            shown,
            ..Self::default()
        }
    }

    /// From the frame of the lead at the angle `frame` (rad) to the estimated one at `theta` (rad), turning at `w`
    /// (rad/s): the same voltage, the same torque.
    pub(super) fn take_over(
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
        // A ramp begins at the rotor's speed.
        self.w_ref = w / f64::from(motor.n_p);
        let w_ref = par.speed_loop.ramped(self.w_ref, speed_ref, par.T_s);
        self.speed = SpeedController::take_over(&gains.speed, w_ref, w / f64::from(motor.n_p), i_q);
        self.lead = None;
    }

    /// The estimate at a sample, whoever gives it: what leads, what searches, or the estimator.
    pub(super) fn estimate(
        &mut self,
        kind: Kind,
        gains: &Gains,
        par: &ControllerParameters,
        in_use: &InUse,
        inputs: &ControllerInputs,
        sample: &Sample,
    ) -> (Estimate, Option<Led>, Option<Searching>) {
        let context = context(par, &in_use.estimators, &in_use.motor);
        let reference = if par.speed_loop.torque_mode { inputs.tau_ref } else { inputs.speed_ref };
        let led = self.lead.as_mut().map(|lead| lead.update(&par.start, &context, par.theta_est, reference, sample));
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

    /// The current references (A) at the estimated mechanical `speed` (rad/s), and whether a limit cut them; `old` gains of
    /// a speed loop tuned now.
    #[inline]
    pub(super) fn references(
        &mut self,
        kind: Kind,
        gains: &Gains,
        old: Option<&SpeedGains>,
        par: &ControllerParameters,
        inputs: &ControllerInputs,
        speed: f64,
    ) -> (DqHat, bool) {
        self.w_ref = par.speed_loop.ramped(self.w_ref, inputs.speed_ref, par.T_s);
        let w_ref = self.w_ref;
        if let Some(old) = old {
            self.speed.retune(old, &gains.speed, w_ref, speed);
        }
        let mut torque = |limit: f64| {
            let (i_q_ref, wanted) = if par.speed_loop.torque_mode {
                let wanted = inputs.tau_ref / gains.k;
                (wanted.clamp(-limit, limit), wanted)
            } else {
                self.speed.update(&gains.speed, w_ref, speed, limit, par.T_s)
            };
            (i_q_ref, wanted.abs() > limit)
        };
        // Only a flux observer needs the low-speed law at standstill; the other methods would pay losses for nothing.
        if kind.class() == Class::FluxObserver {
            let i_d_ref = par.zero_speed.i_d_ref(speed);
            let (i_q_ref, limited) = torque(par.limit.i_q_beside(i_d_ref).min(gains.i_tau));
            return (DqHat::new(i_d_ref, i_q_ref), limited);
        }
        let (i_q_ref, limited) = torque(gains.i_tau);
        let i_ref = if par.current.mtpa {
            max_torque_per_ampere(&par.motor, gains.k * i_q_ref)
        } else {
            DqHat::new(0.0, i_q_ref)
        };
        (i_ref, limited)
    }

    /// The magnet is found: the loops begin at rest.
    pub(super) fn found(&mut self) {
        (self.current, self.speed, self.search) = (CurrentController::default(), SpeedController::default(), None);
    }
}

/// A voltage command in stator axes, limited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Command {
    /// All of it, in V.
    pub(super) u: AlphaBeta,
    /// The injected part, in V.
    pub(super) injected: AlphaBeta,
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
