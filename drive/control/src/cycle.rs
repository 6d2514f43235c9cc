//! One sample of the controller, in the order of Rasmussen 2006, Fig. 2: measure, estimate, reference, modulate.

#![expect(clippy::inline_always, reason = "one sample is one function: its values stay in registers")]

use crate::current::CurrentGains;
use crate::current_limit::{Predictor, may_exceed};
use crate::estimator::{Estimate, Estimating, Estimator, EstimatorParameters, Injection, Kind, Sample};
use crate::gains::Gains;
use crate::lock::Lock;
use crate::model::SensorlessController;
use crate::modes::Follows;
use crate::signals::{ControllerInputs, ControllerOutputs};
use crate::speed::SpeedController;
use crate::start::{StartMode, StartState};
use crate::state::{Command, Leader, Mode, References, context};
use crate::tables::{Compensation, ControllerParameters};
use crate::trip::Cause;
use crate::weakening::share;
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated, Phases, Turn};
use drive_base::hexagon::within_hexagon;
use drive_base::math::{at_most, wrap};
use drive_base::modulation::dead_time_loss;
use drive_base::overmodulation::Applied;
use fmu_core::Elapsed;

/// The estimated rotor frame at a sample and the quantities controlled in it.
struct Frame {
    axis: Axis<Estimated>,
    /// Electrical angle in rad.
    theta: f64,
    /// Electrical speed in rad/s.
    w: f64,
    /// The rotation by `w` in half a sample.
    half: Turn,
    /// Stator current to control in A, with the carrier removed.
    i: DqHat,
    /// Injected voltage in V.
    injection: Injection,
}

/// What the controller does in a sample, beside its estimate.
#[derive(Clone, Copy)]
struct Phase {
    mode: Mode,
    start: StartState,
    /// Parameters have changed.
    tuned: bool,
    /// Estimated stator resistance in Ohm.
    R_s_est: f64,
}

/// The result of the modulation.
struct Modulated {
    /// Voltage references in V.
    u: Phases,
    /// Whether the hexagon limited them.
    voltage_limited: bool,
    /// Whether the current limit changed them.
    cut: bool,
    /// Share of u_dc / sqrt(3) that was requested.
    u_share: f64,
}

impl SensorlessController {
    /// One sample: currents in, voltage references out.
    #[inline]
    pub(super) fn control(&mut self) {
        let Self { inputs, tuned, state, .. } = self;
        let follows = !inputs.modes.brake && !inputs.modes.coast && state.follows == Follows::Reference;
        let steady = state.k > state.rise && !*tuned && follows && matches!(state.leader, Leader::Estimator);
        if steady && matches!(state.estimator, Estimator::Rasmussen(_)) && !self.measures_resistance() {
            let sample = self.measure();
            let Self { parameters: par, in_use, state, .. } = self;
            // Here the compiler knows estimator and mode, and omits all others from what follows.
            if let Estimator::Rasmussen(observer) = &mut state.estimator {
                let estimate = observer.update(&context(par, &in_use.estimators, &in_use.motor), &sample);
                let R_s_est = observer.resistance(&context(par, &in_use.estimators, &par.motor));
                self.state.computed = self.act(
                    &sample,
                    estimate,
                    Phase { mode: Mode::ClosedLoop, start: StartState::Running, tuned: false, R_s_est },
                );
                return;
            }
        }
        self.any_cycle();
    }

    /// Whether a drive that starts at rest still measures its resistance: until then, it rests on i_0 and follows no reference.
    #[inline]
    pub fn measures_resistance(&self) -> bool {
        let ControllerParameters { estimators: EstimatorParameters { adaptation, .. }, estimator, start, .. } =
            &self.parameters;
        adaptation.resistance
            && *estimator == Kind::Rasmussen
            && start.mode == StartMode::Direct
            && self.parameters.speed_est == 0.0
            && self.state.found.is_none()
            && Elapsed::periods(self.state.k, self.parameters.T_s).seconds() < adaptation.longest_rest()
            && match &self.state.estimator {
                Estimator::Rasmussen(observer) => self.state.k == 0 || !observer.knows_resistance(),
                _ => self.state.k == 0,
            }
    }

    /// Whether the torque limits still rise after a flying start.
    #[inline]
    pub fn rises(&self) -> bool {
        self.state.k <= self.state.rise && self.state.rise > 0
    }

    #[inline(never)]
    fn any_cycle(&mut self) {
        let ControllerInputs { speed_ref, tau_ref, modes, derating, .. } = self.inputs;
        let ControllerParameters { speed_loop, zero_speed, modes: limits, .. } = &self.parameters;
        let (ramp, torque_mode, release, tau_used) =
            (speed_loop.ramp, speed_loop.torque_mode, zero_speed.release, limits.tau_used);
        let measures = self.measures_resistance();
        self.follow(modes.follows());
        if self.rises() {
            #[expect(clippy::cast_precision_loss, reason = "some hundreds")]
            let share = self.state.k as f64 / self.state.rise as f64;
            self.inputs.derating *= share;
        }
        if measures {
            (self.inputs.speed_ref, self.inputs.tau_ref, self.parameters.zero_speed.release) = (0.0, 0.0, false);
        }
        self.state.computed = self.cycle();
        if measures {
            self.state.computed.start_state = StartState::Aligning;
        }
        (self.inputs.speed_ref, self.inputs.tau_ref, self.inputs.modes) = (speed_ref, tau_ref, modes);
        self.inputs.derating = derating;
        let ControllerParameters { speed_loop, zero_speed, modes: limits, .. } = &mut self.parameters;
        (speed_loop.ramp, speed_loop.torque_mode, zero_speed.release, limits.tau_used) =
            (ramp, torque_mode, release, tau_used);
    }

    /// Sets the references and limits of this sample for what the loops follow; a change of that begins at the present speed and torque.
    fn follow(&mut self, follows: Follows) {
        let Self { inputs, parameters: par, gains, state, .. } = self;
        let before = std::mem::replace(&mut state.follows, follows);
        if before != follows {
            let speed = state.computed.speed_est;
            state.speed = SpeedController::default();
            if follows == Follows::Reference && !par.speed_loop.torque_mode {
                state.w_ref = speed;
                let w_ref = par.speed_loop.ramped(speed, inputs.speed_ref, par.T_s);
                state.speed = SpeedController::take_over(&gains.speed, w_ref, speed, state.tau_ref / gains.k);
            }
        }
        match follows {
            Follows::Reference => {}
            Follows::Brake => {
                if par.modes.frees(follows) {
                    state.speed = SpeedController::default();
                }
                [inputs.modes.tau_min, inputs.modes.tau_max] = par.modes.torques(&inputs.modes);
                (inputs.speed_ref, par.speed_loop.ramp) = (0.0, 0.0);
                (par.speed_loop.torque_mode, par.modes.tau_used) = (false, true);
            }
            Follows::Coast => {
                inputs.tau_ref = 0.0;
                (par.speed_loop.torque_mode, par.zero_speed.release) = (true, true);
            }
        }
    }

    /// One sample in any state of the controller. Changed parameters act on the estimator from the next sample on.
    #[inline(always)]
    fn cycle(&mut self) -> ControllerOutputs {
        let first = self.state.k == 0;
        let tuned = std::mem::take(&mut self.tuned) && !first;
        if first {
            self.begin();
        }
        let sample = self.measure();
        let Self { inputs, parameters: par, gains, in_use, state, .. } = self;
        let (estimate, mode) = state.estimate(gains, par, in_use, inputs, &sample);
        if tuned {
            let new = context(par, &par.estimators, &par.motor);
            state.estimator.retune(&context(par, &in_use.estimators, &in_use.motor), &new);
            in_use.take_up(par);
        }
        let R_s_est = state.estimator.resistance(&context(par, &in_use.estimators, &par.motor));
        let start = state.leader.start_state();
        self.act(&sample, estimate, Phase { mode, start, tuned, R_s_est })
    }

    /// What follows from an estimate: the loops, the modulation and the outputs. Compiled twice: for any state, and without calls for
    /// that of the default (its estimator supplies the angle, the start is over, nothing has been tuned).
    #[inline(always)]
    fn act(&mut self, sample: &Sample, estimate: Estimate, phase: Phase) -> ControllerOutputs {
        let Phase { mode, start, tuned, R_s_est } = phase;
        let Estimate { theta, axis, w, half, i, injection } = estimate;
        let half = half.unwrap_or_else(|| Turn::new(0.5 * self.parameters.T_s * w));
        let frame = Frame { axis, theta, w, half, i: axis.from_stator(i), injection };
        let speed = frame.w * (1.0 / f64::from(self.parameters.motor.n_p));
        let References { i: i_ref, limited: current_limited, tau: (low, high), weakens } =
            self.reference(mode, speed, frame.injection, tuned);
        if self.parameters.speed_loop.torque_mode {
            self.state.stands.update(&self.parameters, mode == Mode::ClosedLoop, speed, i_ref, at_most(low, high));
        } else {
            let limited = current_limited && mode == Mode::ClosedLoop;
            self.state.overload.update(self.parameters.T_s, limited, self.state.w_ref, [speed; 2]);
        }
        let Modulated { u, voltage_limited, cut, u_share } = self.modulate(mode, &frame, sample, i_ref, tuned);
        let lock_lost = self.lock(mode, &frame, sample, R_s_est, at_most(low, high));
        self.keep(mode, sample, i_ref, frame.i);

        ControllerOutputs {
            u,
            speed_est: speed,
            theta_est: wrap(frame.theta + self.parameters.T_s * frame.w),
            i: frame.i.into(),
            i_ref: i_ref.into(),
            lock_lost,
            enabled: true,
            short_circuit: false,
            tripped: Cause::None,
            sensor_lost: self.state.sensor_lost,
            voltage_limited,
            current_limited: current_limited || cut,
            tau_max: high,
            tau_min: -low,
            u_share,
            weakens,
            R_s_est,
            start_state: start,
            ..ControllerOutputs::default()
        }
    }

    /// Prepares the first sample, which repeats its current.
    #[cold]
    fn begin(&mut self) {
        self.in_use.take_up(&self.parameters);
        self.state.i_last = self.currents().to_stator();
    }

    /// Measured currents in A, less the offsets measured at rest.
    #[inline(always)]
    pub(super) fn currents(&self) -> Phases {
        if self.has_one_shunt() {
            return self.shunt.currents();
        }
        let Phases { a, b, c } = self.parameters.sensor.measure(self.inputs.i, self.state.samples);
        let zero = self.state.offset.i;
        Phases { a: a - zero.a, b: b - zero.b, c: c - zero.c }
    }

    /// Values from the sensors and the previous samples.
    #[inline(always)]
    pub(super) fn measure(&self) -> Sample {
        let Self { inputs, parameters: par, gains, state, .. } = self;
        let i = self.currents().to_stator();
        let (theta_meas, w_meas) = self.measured_position();
        // The command applied since the last sample: the newest one if there is no delay.
        let [newest, older, oldest] = &state.commands;
        let Command { mut u, injected } = *match par.delay {
            0 => newest,
            1 => older,
            _ => oldest,
        };
        let Compensation { u_dead, i_zero, observe, .. } = par.compensation;
        if observe && u_dead > 0.0 {
            // The trapezoid over the interval.
            let lost = |i: AlphaBeta| dead_time_loss(0.5 * u_dead, i_zero, Phases::from_stator(i));
            u = u - (lost(state.i_last) + lost(i));
        }
        Sample {
            k: state.k,
            i,
            i_last: state.i_last,
            u,
            u_injected: injected,
            u_pi: state.u_pi,
            i_ref: state.i_ref,
            tau_ref: state.tau_ref,
            rho: if state.weakening.weakens { gains.weakening.tracker(state.i_ref) } else { 0.0 },
            theta_meas,
            w_meas,
            u_dc: inputs.u_dc,
            speed_ref: (!par.speed_loop.torque_mode).then_some(inputs.speed_ref),
        }
    }

    /// The references at the estimated mechanical `speed` (rad/s) in addition to an `injection`.
    #[inline(always)]
    fn reference(&mut self, mode: Mode, speed: f64, injection: Injection, tuned: bool) -> References {
        let Self { inputs, parameters: par, gains, last_gains, state, .. } = self;
        match mode {
            Mode::Current(i) => References { i, ..References::default() },
            Mode::Voltage(_) => References::default(),
            Mode::AfterStart | Mode::AfterSearch | Mode::ClosedLoop => {
                let old = (tuned && mode == Mode::ClosedLoop).then_some(&last_gains.speed);
                state.references(gains, old, par, inputs, speed, injection)
            }
        }
    }

    /// Current control, the current limit, injection, the hexagon and dead-time compensation.
    #[inline(always)]
    fn modulate(&mut self, mode: Mode, frame: &Frame, sample: &Sample, i_ref: DqHat, tuned: bool) -> Modulated {
        let Self { inputs, parameters: par, gains, last_gains, state, .. } = self;
        let (motor, T_s) = (&par.motor, par.T_s);
        let of = |gains| current_gains(gains, mode);
        if tuned && mode != Mode::AfterSearch {
            state.current.retune(of(last_gains), of(gains), i_ref, frame.i);
        }
        let own = of(gains);
        let requested =
            if let Mode::Voltage(u) = mode { u } else { state.current.command(own, motor, i_ref, frame.i, frame.w) };
        let magnitude = requested.magnitude();
        let u_share = share(magnitude, inputs.u_dc);
        if par.weakening.used && matches!(mode, Mode::ClosedLoop) {
            state.weakening.integrate(&gains.weakening, &par.weakening, (magnitude, inputs.u_dc), T_s);
        }
        // The command acts from `delay` to `delay + 1` samples from now, so rotate it to the middle of that interval.
        let mut acting = frame.axis.ahead(frame.half);
        for _ in 0..par.delay {
            acting = acting.ahead(frame.half).ahead(frame.half);
        }
        let injected = match frame.injection {
            Injection::None => None,
            Injection::Stator(u) => Some(u),
            Injection::Estimated(u) => Some(acting.to_stator(u)),
        };
        let without = acting.to_stator(requested);
        let mut whole = injected.map_or(without, |injected| without + injected);
        let mut cut = false;
        let shown = state.fresh.update(inputs.i, sample.u);
        if may_exceed(sample, par.limit.i) && shown && injected.is_none() && !matches!(mode, Mode::Voltage(_)) {
            let [newest, older, _] = &state.commands;
            let waiting = [older.u, newest.u, whole];
            let commands = &waiting[usize::from(par.delay < 2) + usize::from(par.delay < 1)..];
            let predictor = Predictor { motor, T_s, axis: frame.axis, w: frame.w };
            if let Some(change) = predictor.correction(sample, commands, par.limit.i) {
                whole += change;
                cut = true;
            }
        }
        let injected = injected.unwrap_or_default();
        let Applied { u: mut command, limited } = par.modulation.mode.apply(whole, inputs.u_dc);
        // The fundamental: what overmodulation adds to it is no limitation.
        let fundamental = limited.unwrap_or(whole);
        let limited = limited.is_some();
        let limitation = (limited || cut).then(|| acting.from_stator(fundamental - injected) - requested);
        state.current.integrate(own, i_ref - frame.i, limitation, T_s);
        let injected = if limited { injected * (fundamental.magnitude() / whole.magnitude()) } else { injected };
        let (mut output, mut beyond) = (command, false);
        if par.compensation.u_dead > 0.0 {
            let legs = Phases::from_stator(acting.to_stator(i_ref));
            let loss = dead_time_loss(par.compensation.u_dead, par.compensation.i_zero, legs);
            (output, beyond) = within_hexagon(command + loss, inputs.u_dc);
            if par.compensation.observe {
                command = output;
            }
        }
        state.commands[2] = state.commands[1];
        state.commands[1] = state.commands[0];
        state.commands[0] = Command { u: command, injected };
        Modulated { u: Phases::from_stator(output), voltage_limited: limited || beyond, cut, u_share }
    }

    /// The output `lock_lost`; 0 during a start sequence, because its angle is not an estimate.
    #[inline(always)]
    fn lock(&mut self, mode: Mode, frame: &Frame, sample: &Sample, R_s: f64, tau: f64) -> f64 {
        let Self { parameters: par, gains, state, .. } = self;
        match mode {
            Mode::Current(_) | Mode::Voltage(_) | Mode::AfterSearch => {
                state.lock = Lock::default();
                0.0
            }
            Mode::AfterStart | Mode::ClosedLoop => {
                let n_p = f64::from(par.motor.n_p);
                // A brake that does not hold lets a load turn the shaft.
                let follows_speed = !par.speed_loop.torque_mode && !par.modes.frees(state.follows);
                let w_ref = follows_speed.then_some(n_p * state.w_ref);
                state.lock.update(&gains.lock, &par.motor, R_s, sample, frame.axis, (frame.w, w_ref, tau))
            }
        }
    }

    /// Stores the values for the next sample: the references and the current `i` (A) of this sample.
    #[inline(always)]
    fn keep(&mut self, mode: Mode, sample: &Sample, i_ref: DqHat, i: DqHat) {
        let Self { parameters: par, gains, state, .. } = self;
        state.i_last = sample.i;
        state.i_ref = i_ref;
        state.tau_ref = par.motor.torque(i_ref.d(), i_ref.q());
        state.u_pi = state.current.output(current_gains(gains, mode), i_ref - i);
    }
}

/// The gains of the current loop: during a start, the frame may be off the rotor.
#[inline(always)]
fn current_gains(gains: &Gains, mode: Mode) -> &CurrentGains {
    if matches!(mode, Mode::Current(_)) { &gains.off_rotor } else { &gains.current }
}

#[cfg(test)]
mod tests;
