//! The flying start in the controller: gates and voltage while the rotor is sought, and how estimator and loops begin at a rotor that
//! turns.

use crate::catch::{Catch, CatchStep, Refusal, Setup};
use crate::estimator::{Class, Kind, Sample};
use crate::model::SensorlessController;
use crate::overload::Overload;
use crate::signals::ControllerOutputs;
use crate::speed::SpeedController;
use crate::stands::Stands;
use crate::start::{CurrentFrequencyStart, StartMode, StartState};
use crate::state::{Command, Leader, State, context};
use crate::tables::PARAMETERS;
use crate::weakening::INVERSE_SQRT_3;
use drive_base::frame::{AlphaBeta, Axis, Estimated, Phases};
use drive_base::hexagon::within_hexagon;
use drive_base::math::wrap;

/// Minimum EMF of a rotor that turns, in units of R_s `limit.i`.
const EMF: f64 = 0.08;

/// Time in s in which the torque limits rise from 0 once the rotor is found.
const RISE: f64 = 0.1;

/// Share of `start.speed` below which an estimator without standstill takes over after the ramp of the I-f start.
const SLOW: f64 = 0.5;

/// Maximum EMF in units of u_dc / sqrt(3) at which an estimator that injects at any speed takes over: it is one for low speed.
const INJECTION: f64 = 0.2;

/// Maximum electrical speed at which an estimator with a sinusoidal carrier takes over, in units of the carrier frequency: its filters must
/// separate the carrier from the fundamental. Measured on six machines: all hold 0.06, some lose the rotor at 0.085.
const CARRIER: f64 = 0.0625;

/// Maximum electrical speed at which VoltageFeedback takes over, in units of the bandwidth of the current loop: the estimate lags with the
/// integrators of that loop. Measured on two machines: both hold 1.4, both oscillate at 1.7.
const FEEDBACK: f64 = 1.4;

impl SensorlessController {
    /// One sample of the flying start; returns false once it is over and the controller works.
    #[cold]
    #[inline(never)]
    pub(super) fn catches(&mut self) -> bool {
        let Some(mut catch) = self.state.catch else { return false };
        if catch == Catch::default() {
            self.state.i_last = self.currents().to_stator();
        }
        let sample = self.measure();
        let step = self.caught(&mut catch, &sample);
        self.state.i_last = sample.i;
        let (u, gates) = match step {
            CatchStep::Off => (AlphaBeta::ZERO, false),
            CatchStep::Apply(u) => (within_hexagon(u, self.inputs.u_dc).0, true),
            CatchStep::Turns { theta, w, gates } => {
                self.begin_turning(&sample, (theta, w), gates);
                return false;
            }
            CatchStep::Rests => {
                (self.state.catch, self.state.slow, self.state.commands) = (None, catch.refusal, Default::default());
                return false;
            }
        };
        let commands = &mut self.state.commands;
        commands.rotate_right(1);
        commands[0] = Command { u, ..Command::default() };
        self.state.catch = Some(catch);
        self.state.computed = ControllerOutputs {
            u: Phases::from_stator(u),
            enabled: gates,
            theta_est: wrap(self.parameters.theta_est),
            sensor_lost: self.state.sensor_lost,
            R_s_est: self.parameters.motor.R_s,
            start_state: StartState::Catching,
            ..ControllerOutputs::default()
        };
        true
    }

    /// The step of the flying start; a speed at which the estimator cannot work is refused.
    fn caught(&self, catch: &mut Catch, sample: &Sample) -> CatchStep {
        let Self { parameters: par, state, .. } = self;
        let kind = par.estimator_with(state.sensor_lost);
        if kind == Kind::Sensored {
            return CatchStep::Turns { theta: sample.theta_meas, w: sample.w_meas, gates: false };
        }
        let set = Setup {
            motor: &par.motor,
            T_s: par.T_s,
            delay: par.delay.try_into().unwrap_or(u8::MAX),
            i_max: par.limit.i,
            e_min: EMF * par.motor.R_s * par.limit.i,
        };
        match catch.update(&set, sample) {
            CatchStep::Turns { w, .. } if w.abs() > self.fastest(kind).0 => catch.refuse(Refusal::Estimator(w)),
            step => step,
        }
    }

    /// The maximum electrical speed (rad/s) at which the estimator takes over, and its meaning: a share of a quantity.
    fn fastest(&self, kind: Kind) -> (f64, f64, &'static str) {
        let par = &self.parameters;
        let by_emf = INJECTION * INVERSE_SQRT_3 * self.inputs.u_dc / par.motor.psi_M;
        let by_carrier = CARRIER * par.estimators.carrier.frequency;
        match kind {
            Kind::VoltageFeedback => (FEEDBACK * par.current.bandwidth, FEEDBACK, "current.bandwidth / motor.n_p"),
            Kind::RotatingInjection | Kind::PulsatingInjection if by_carrier < by_emf => {
                (by_carrier, CARRIER, "carrier.frequency / motor.n_p")
            }
            _ if kind.class() == Class::Injection => (by_emf, INJECTION, "u_dc / (sqrt(3) motor.n_p motor.psi_M)"),
            _ => (f64::INFINITY, f64::INFINITY, ""),
        }
    }

    /// The rotor is at `theta` (rad) and turns at `w` (rad/s): estimator, speed loop and current loop begin there, without torque.
    fn begin_turning(&mut self, sample: &Sample, (theta, w): (f64, f64), gates: bool) {
        let Self { inputs, parameters: par, gains, state, .. } = self;
        let speed = w / f64::from(par.motor.n_p);
        (state.catch, state.found, state.w_ref) = (None, Some((theta, w)), speed);
        let w_ref = par.speed_loop.ramped(speed, inputs.speed_ref, par.T_s);
        state.speed = SpeedController::take_over(&gains.speed, w_ref, speed, 0.0);
        state.leader = Leader::Estimator;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "T_s is at least some microseconds"
        )]
        let rise = (RISE / par.T_s).ceil() as u64;
        state.rise = rise;
        let kind = par.estimator_with(state.sensor_lost);
        if par.start.mode == StartMode::CurrentFrequency && kind.class() == Class::BackEmf {
            let reference = if par.speed_loop.torque_mode { inputs.tau_ref } else { inputs.speed_ref };
            let against = speed * reference < 0.0;
            if speed.abs() < if against { par.start.speed } else { SLOW * par.start.speed } {
                let context = context(par, &par.estimators, &par.motor);
                let start = CurrentFrequencyStart::turning(&par.start, &context, (theta, w), reference);
                state.leader = Leader::Start(start);
            } else {
                state.against = against && !par.speed_loop.torque_mode;
            }
        }
        if gates {
            return;
        }
        // Without current, the machine has the voltage of its EMF until the first command acts.
        for (k, command) in state.commands.iter_mut().enumerate() {
            #[expect(clippy::cast_precision_loss, reason = "at most 2")]
            let ahead = f64::from(par.delay) - k as f64 - 0.5;
            let axis = Axis::<Estimated>::at(theta + ahead * par.T_s * w);
            *command = Command { u: axis.along(w * par.motor.psi_M).turned(), ..Command::default() };
        }
        state.i_last = sample.i;
    }

    /// Reverses a rotor that was caught turning against the speed reference. A back-EMF estimator brakes it; below half of `start.speed`, a
    /// second flying start finds it without current, and the I-f start takes it through standstill. Without that, a rotor with a large
    /// inertia would spend too long near standstill, where there is no EMF.
    #[cold]
    pub(super) fn turn_back(&mut self) {
        let Self { inputs, parameters: par, state, .. } = self;
        let speed = state.computed.speed_est;
        state.against = speed * inputs.speed_ref <= 0.0;
        if state.against && inputs.speed_ref != 0.0 && speed.abs() < SLOW * par.start.speed {
            let &mut State { samples, offset, trip, sensor_lost, shown, .. } = state;
            *state = State { samples, offset, trip, sensor_lost, shown, ..State::new(par, false) };
        }
    }

    /// Begins at a rotor at the electrical angle `theta` (rad) that turns at the mechanical `speed` (rad/s), without a start sequence.
    pub fn begin_at(&mut self, theta: f64, speed: f64) {
        let w = f64::from(self.parameters.motor.n_p) * speed;
        let sample = Sample { theta_meas: theta, w_meas: w, ..Sample::default() };
        self.begin_turning(&sample, (theta, w), false);
        (self.state.leader, self.state.rise) = (Leader::Estimator, 0);
    }

    /// Begins anew with all that it knows: the next sample is the first one, and the speed loop holds the torque at `speed_ref` (rad/s).
    pub fn begin_here(&mut self, speed_ref: f64) {
        let Self { parameters: par, gains, state, .. } = self;
        state.samples = 0;
        (state.limited_for, state.stands, state.overload) = (0.0, Stands::default(), Overload::default());
        state.w_ref = speed_ref;
        state.speed = if par.speed_loop.torque_mode {
            SpeedController::default()
        } else {
            SpeedController::take_over(
                &gains.speed,
                speed_ref,
                state.computed.speed_est,
                gains.loop_output(par, state.i_ref),
            )
        };
        self.last_gains.clone_from(&self.gains);
        self.tuned = false;
    }

    /// Why the flying start has not caught the rotor, for the log.
    pub(super) fn not_caught(&self) -> Option<String> {
        let Self { parameters: par, inputs, state, .. } = self;
        let refusal = state.catch.map_or(state.slow, |catch| catch.refusal)?;
        let n_p = f64::from(par.motor.n_p);
        let off = "the gates stay off, and the rotor is tried again";
        Some(match refusal {
            Refusal::Diodes(i) => format!(
                "start.catch: with the gates off, {i:.3} A flow through the diodes: the EMF of the rotor is above u_dc / sqrt(3) = {:.1} V; \
                 the gates stay off until it slows down",
                inputs.u_dc * INVERSE_SQRT_3
            ),
            Refusal::Sampling(turn) => format!(
                "start.catch: the current of a short circuit shows a rotor that turns by about {turn:.2} rad in {}, too fast to be seen; {off}",
                PARAMETERS.tell(par, |p| &mut p.T_s)
            ),
            Refusal::Contradiction(w, expected) => format!(
                "start.catch: the rotor seems to turn at {:.4} rad/s, but the EMF has the magnitude of {:.4} rad/s: motor.psi_M, motor.L_q or \
                 the sensors do not fit; {off}",
                w / n_p,
                expected / n_p
            ),
            Refusal::Estimator(w) => {
                let kind = par.estimator_with(state.sensor_lost);
                let (most, share, of) = self.fastest(kind);
                format!(
                    "start.catch: the rotor turns at {:.4} rad/s, and {} takes over up to {:.4} rad/s ({share} {of}); {off}",
                    w / n_p,
                    kind.name(),
                    most / n_p
                )
            }
            Refusal::Slow(e) => format!(
                "start.catch: the EMF of {e:.4} V is below {:.4} V ({EMF} motor.R_s limit.i), too low to find the rotor: it starts as if at rest",
                EMF * par.motor.R_s * par.limit.i
            ),
        })
    }
}
