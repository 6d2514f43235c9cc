//! One sample of the controller, in the order of Rasmussen 2006, Fig. 2: measure, estimate, reference, modulate.

#![expect(clippy::inline_always, reason = "one sample is one function: its values stay in registers")]

use crate::current_limit::{Predictor, may_exceed};
use crate::estimator::{Estimate, Estimating, Estimator, EstimatorParameters, Injection, Kind, Sample};
use crate::lock::Lock;
use crate::model::SensorlessController;
use crate::signals::{ControllerInputs, ControllerOutputs};
use crate::start::StartMode;
use crate::state::{Command, Leader, Mode, References, context};
use crate::tables::{Compensation, ControllerParameters};
use crate::trip::Cause;
use crate::weakening::share;
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated, Phases, Turn};
use drive_base::hexagon::within_hexagon;
use drive_base::math::{at_most, wrap};
use drive_base::modulation::dead_time_loss;
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
        let Self { tuned, state, .. } = self;
        let steady = state.k > 0 && !*tuned && matches!(state.leader, Leader::Estimator);
        if steady && matches!(state.estimator, Estimator::Rasmussen(_)) && !self.measures_resistance() {
            self.state.computed = self.cycle(true);
        } else {
            self.any_cycle();
        }
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
            && Elapsed::periods(self.state.k, self.parameters.T_s).seconds() < adaptation.longest_rest()
            && match &self.state.estimator {
                Estimator::Rasmussen(observer) => self.state.k == 0 || !observer.knows_resistance(),
                _ => self.state.k == 0,
            }
    }

    #[inline(never)]
    fn any_cycle(&mut self) {
        let ControllerInputs { speed_ref, tau_ref, .. } = self.inputs;
        let release = self.parameters.zero_speed.release;
        if self.measures_resistance() {
            (self.inputs.speed_ref, self.inputs.tau_ref, self.parameters.zero_speed.release) = (0.0, 0.0, false);
        }
        self.state.computed = self.cycle(false);
        (self.inputs.speed_ref, self.inputs.tau_ref, self.parameters.zero_speed.release) =
            (speed_ref, tau_ref, release);
    }

    /// One sample, compiled twice: for any state of the controller, and without calls for the `steady` state of the default
    /// (its estimator supplies the angle, the start is over, nothing has been tuned).
    #[inline(always)]
    fn cycle(&mut self, steady: bool) -> ControllerOutputs {
        let first = !steady && self.state.k == 0;
        let tuned = !steady && std::mem::take(&mut self.tuned) && !first;
        if first {
            self.begin();
        }
        let sample = self.measure();
        let (frame, mode) = self.estimate(&sample, tuned, steady);
        let speed = frame.w * (1.0 / f64::from(self.parameters.motor.n_p));
        let References { i: i_ref, limited: current_limited, tau: (low, high), weakens } =
            self.reference(mode, speed, frame.injection, tuned);
        if self.parameters.speed_loop.torque_mode {
            self.state.stands.update(&self.parameters, mode == Mode::ClosedLoop, speed, i_ref, at_most(low, high));
        }
        let Modulated { u, voltage_limited, cut, u_share } = self.modulate(mode, &frame, &sample, i_ref, tuned);
        let R_s_est = self.state.estimator.resistance(&context(
            &self.parameters,
            &self.in_use.estimators,
            &self.parameters.motor,
        ));
        let lock_lost = self.lock(mode, &frame, &sample, R_s_est, at_most(low, high));
        self.keep(&sample, i_ref, frame.i);

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
        let Phases { a, b, c } = self.parameters.sensor.measure(self.inputs.i, self.state.samples);
        let zero = self.state.offset.i;
        Phases { a: a - zero.a, b: b - zero.b, c: c - zero.c }
    }

    /// Values from the sensors and the previous samples.
    #[inline(always)]
    fn measure(&self) -> Sample {
        let Self { inputs, parameters: par, gains, state, .. } = self;
        let i = self.currents().to_stator();
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
            theta_meas: inputs.theta_meas,
            w_meas: f64::from(par.motor.n_p) * inputs.speed_meas,
            u_dc: inputs.u_dc,
            speed_ref: (!par.speed_loop.torque_mode).then_some(inputs.speed_ref),
        }
    }

    /// The estimated frame and the action of the loops in it. Parameters that were `tuned` act on the estimator after that.
    #[inline(always)]
    fn estimate(&mut self, sample: &Sample, tuned: bool, steady: bool) -> (Frame, Mode) {
        let Self { inputs, parameters: par, gains, in_use, state, .. } = self;
        let (estimate, mode) = match &mut state.estimator {
            Estimator::Rasmussen(observer) if steady => {
                (observer.update(&context(par, &in_use.estimators, &in_use.motor), sample), Mode::ClosedLoop)
            }
            _ => state.estimate(gains, par, in_use, inputs, sample),
        };
        if tuned {
            let new = context(par, &par.estimators, &par.motor);
            state.estimator.retune(&context(par, &in_use.estimators, &in_use.motor), &new);
            in_use.take_up(par);
        }
        let Estimate { theta, axis, w, half, i, injection } = estimate;
        let half = half.unwrap_or_else(|| Turn::new(0.5 * par.T_s * w));
        (Frame { axis, theta, w, half, i: axis.from_stator(i), injection }, mode)
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
        if tuned && mode != Mode::AfterSearch {
            state.current.retune(&last_gains.current, &gains.current, i_ref, frame.i);
        }
        let requested = if let Mode::Voltage(u) = mode {
            u
        } else {
            state.current.command(&gains.current, motor, i_ref, frame.i, frame.w)
        };
        let magnitude = requested.magnitude();
        let u_share = share(magnitude, inputs.u_dc);
        if par.weakening.used && matches!(mode, Mode::ClosedLoop) {
            state.weakening.integrate(&par.weakening, magnitude, inputs.u_dc, T_s);
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
        let (mut command, limited) = within_hexagon(whole, inputs.u_dc);
        let limitation = (limited || cut).then(|| acting.from_stator(command - injected) - requested);
        state.current.integrate(&gains.current, i_ref - frame.i, limitation, T_s);
        let injected = if limited { injected * (command.magnitude() / whole.magnitude()) } else { injected };
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
                let w_ref = (!par.speed_loop.torque_mode).then_some(n_p * state.w_ref);
                state.lock.update(&gains.lock, &par.motor, R_s, sample, frame.axis, (frame.w, w_ref, tau))
            }
        }
    }

    /// Stores the values for the next sample: the references and the current `i` (A) of this sample.
    #[inline(always)]
    fn keep(&mut self, sample: &Sample, i_ref: DqHat, i: DqHat) {
        let Self { parameters: par, gains, state, .. } = self;
        state.i_last = sample.i;
        state.i_ref = i_ref;
        state.tau_ref = par.motor.torque(i_ref.d(), i_ref.q());
        state.u_pi = state.current.output(&gains.current, i_ref - i);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_core::Model;

    /// Both instances of the cycle compute the same bits: at speed, at the limits of current and voltage, and after tuning.
    #[test]
    fn the_steady_cycle_is_that_of_any_sample() {
        let mut quick = SensorlessController::default();
        quick.derive();
        quick.initialize();
        let mut general = quick.clone();
        for k in 0..3000_u32 {
            for controller in [&mut quick, &mut general] {
                let turn = 0.03 * f64::from(k);
                let phase = |shift: f64| 5.0 * drive_base::math::sin_cos(turn - shift).1;
                let SensorlessController { inputs, parameters, .. } = controller;
                inputs.i = Phases { a: phase(0.0), b: phase(2.0), c: phase(4.0) };
                (inputs.speed_ref, inputs.u_dc) = (0.1 * f64::from(k), if k < 2000 { 325.0 } else { 40.0 });
                if k == 1000 {
                    parameters.estimators.rasmussen.zeta = 0.7;
                    controller.derive();
                }
            }
            quick.control();
            general.any_cycle();
            quick.state.k += 1;
            general.state.k += 1;
            assert!(quick == general, "sample {k}: {:?} {:?}", quick.state, general.state);
        }
        assert!(quick.state.computed.voltage_limited && quick.state.computed.current_limited);
    }

    /// Inside +-i_zero a leg is a resistance of 6.5 V / 0.1 A: the current that rises from 0.02 to 0.06 A costs 65 * 0.04 V
    /// of the command that acted, the older one with a delay of one sample.
    #[test]
    fn the_estimators_see_what_the_legs_lose() {
        let mut controller = SensorlessController::default();
        let par = &mut controller.parameters;
        (par.compensation.u_dead, par.compensation.i_zero, par.compensation.observe) = (6.5, 0.1, true);
        let command = |u: f64| Command { u: AlphaBeta::new(u, 0.0), injected: AlphaBeta::ZERO };
        controller.state.commands = [command(99.0), command(10.0), command(-99.0)];
        (controller.state.k, controller.state.i_last) = (5, AlphaBeta::new(0.02, 0.0));
        controller.inputs.i = Phases { a: 0.06, b: -0.03, c: -0.03 };
        let u = controller.measure().u;
        assert!((u.alpha() - (10.0 - 65.0 * 0.04)).abs() < 1e-12 && u.beta().abs() < 1e-12, "{u:?}");
        controller.parameters.compensation.observe = false;
        assert!((controller.measure().u.alpha() - 10.0).abs() < 1e-12);
    }

    /// A drive with the adaptation ignores its references until the resistance is measured, here until the bound, without a current; a
    /// drive that starts at speed, and one without the adaptation, follow at once.
    #[test]
    fn the_references_wait_for_the_resistance() {
        let samples = |torque_mode: bool, adapts: bool, speed_est: f64| {
            let [mut asked, mut idle] = [30.0, 0.0].map(|reference| {
                let mut controller = SensorlessController::default();
                let par = &mut controller.parameters;
                (par.speed_loop.torque_mode, par.speed_est) = (torque_mode, speed_est);
                (par.estimators.adaptation.resistance, par.estimators.adaptation.bandwidth) = (adapts, 200.0);
                par.zero_speed.release = torque_mode;
                (controller.inputs.speed_ref, controller.inputs.tau_ref) = (reference, 0.1 * reference);
                controller.inputs.u_dc = 325.0;
                controller.derive();
                controller.initialize();
                controller
            });
            let equal = |asked: &SensorlessController, idle: &SensorlessController| asked.state == idle.state;
            let mut samples = 0;
            while samples < 2000 {
                for controller in [&mut asked, &mut idle] {
                    controller.control();
                    controller.state.k += 1;
                }
                if !equal(&asked, &idle) {
                    break;
                }
                assert!((asked.state.i_ref.d() - 5.0).abs() < 1e-12, "i_0 flows while the resistance is measured");
                samples += 1;
            }
            assert!((asked.inputs.speed_ref - 30.0).abs() < 1e-12, "the input stays");
            samples
        };
        for torque_mode in [false, true] {
            // 20 / 200 s.
            assert_eq!(samples(torque_mode, true, 0.0), 1000, "torque mode {torque_mode}");
            assert_eq!(samples(torque_mode, false, 0.0), 0);
            assert_eq!(samples(torque_mode, true, 5.0), 0);
        }
    }

    /// The newest command acted in the last interval; with a delay of 1 or 2, the second or third newest.
    #[test]
    fn the_delay_selects_the_command_that_acted() {
        let mut controller = SensorlessController::default();
        controller.inputs.u_dc = 325.0;
        let (axis, half) = (Axis::at(0.0), Turn::new(0.0));
        let frame = Frame { axis, theta: 0.0, w: 0.0, half, i: DqHat::ZERO, injection: Injection::None };
        for u in [3.0, 2.0, 1.0] {
            controller.modulate(Mode::Voltage(DqHat::new(u, 0.0)), &frame, &Sample::default(), DqHat::ZERO, false);
        }
        for (delay, u) in [(0, 1.0), (1, 2.0), (2, 3.0)] {
            controller.parameters.delay = delay;
            let acted = controller.measure().u;
            assert!((acted.alpha() - u).abs() < 1e-12 && acted.beta().abs() < 1e-12, "delay {delay}: {acted:?}");
        }
    }

    /// With a delay of one sample, the command acts 1.5 samples later on the average: 1.5 * 0.1 ms * 400 rad/s.
    #[test]
    fn a_command_is_turned_to_where_it_acts() {
        let mut controller = SensorlessController::default();
        let half = Turn::new(0.5 * controller.parameters.T_s * 400.0);
        let frame =
            Frame { axis: Axis::at(0.0), theta: 0.0, w: 400.0, half, i: DqHat::ZERO, injection: Injection::None };
        let Modulated { u, .. } =
            controller.modulate(Mode::Voltage(DqHat::new(10.0, 0.0)), &frame, &Sample::default(), DqHat::ZERO, false);
        let u = u.to_stator();
        assert!((u.beta().atan2(u.alpha()) - 0.06).abs() < 1e-12, "{u:?}");
    }

    /// A controller whose frame turns at `w` (rad/s).
    fn turning(w: f64, set: impl FnOnce(&mut SensorlessController)) -> (SensorlessController, Frame) {
        let mut controller = SensorlessController::default();
        set(&mut controller);
        controller.derive();
        controller.initialize();
        let half = Turn::new(0.5 * controller.parameters.T_s * w);
        (controller, Frame { axis: Axis::at(0.7), theta: 0.7, w, half, i: DqHat::ZERO, injection: Injection::None })
    }

    /// The voltage beyond the hexagon drives the integrators back: the request settles K_p e beyond it instead of growing with the
    /// error.
    #[test]
    fn what_the_hexagon_cuts_off_drives_the_integrators_back() {
        let (mut controller, frame) = turning(200.0, |c| c.inputs.u_dc = 60.0);
        let (sample, i_ref) = (Sample::default(), DqHat::new(-2.0, 4.0));
        let mut request =
            |n: u32| (0..n).map(|_| controller.modulate(Mode::ClosedLoop, &frame, &sample, i_ref, false)).last();
        let Modulated { voltage_limited: limited, u_share: share, .. } = request(20_000).unwrap();
        let Modulated { u_share: later, .. } = request(20_000).unwrap();
        assert!(limited && share < 2.5 && (later - share).abs() < 1e-3, "{share} and later {later} of u_dc / sqrt 3");
    }

    /// The voltage lost to the dead time is added, in the direction of the current reference.
    #[test]
    fn the_compensation_adds_the_loss_of_the_legs() {
        let (mut controller, frame) = turning(0.0, |c| c.parameters.compensation.u_dead = 6.5);
        let i_ref = DqHat::new(0.0, 4.0);
        let at = |u: Phases| frame.axis.from_stator(u.to_stator());
        let Modulated { u: with, .. } =
            controller.modulate(Mode::Voltage(DqHat::new(0.0, 20.0)), &frame, &Sample::default(), i_ref, false);
        let command = frame.axis.from_stator(controller.state.commands[0].u);
        assert!((command - DqHat::new(0.0, 20.0)).magnitude() < 1e-9, "the estimators see the command: {command:?}");
        let more = (at(with) - command).q();
        assert!(more > 6.5 && more < 6.5 * 4.0 / 3.0 + 1e-9, "{more} V");
    }

    /// The legs lose at the currents where the command acts: at 2000 rad/s, 1.5 samples of 0.1 ms turn them by 0.3 rad, and with
    /// a delay of 2 by 0.5 rad.
    #[test]
    fn the_compensation_knows_the_currents_where_it_acts() {
        for (w, delay, turned) in [(2000.0, 0, 0.1), (2000.0, 1, 0.3), (-2000.0, 1, -0.3), (2000.0, 2, 0.5)] {
            let (mut controller, frame) = turning(w, |c| {
                (c.parameters.compensation.u_dead, c.parameters.compensation.i_zero) = (6.5, 10.0);
                (c.parameters.delay, c.inputs.u_dc) = (delay, 325.0);
            });
            // Inside +-i_zero the legs are resistances: what they lose has the angle of the current.
            let i_ref = DqHat::new(-1.0, 4.0);
            let Modulated { u, .. } =
                controller.modulate(Mode::Voltage(DqHat::new(0.0, 20.0)), &frame, &Sample::default(), i_ref, false);
            let lost = Axis::<Estimated>::at(0.7 + turned).from_stator(u.to_stator() - controller.state.commands[0].u);
            assert!((lost - i_ref * 0.65).magnitude() < 1e-9, "{lost:?} V at {w} rad/s, delay {delay}");
        }
    }

    /// Beyond the hexagon the injection is cut in the same ratio; the estimators see the command, or with `observe` the output.
    #[test]
    fn the_estimators_see_what_is_left_of_an_injection() {
        let (mut controller, mut frame) = turning(200.0, |c| c.inputs.u_dc = 60.0);
        frame.injection = Injection::Stator(AlphaBeta::new(10.0, -20.0));
        controller.modulate(Mode::Voltage(DqHat::new(0.0, 90.0)), &frame, &Sample::default(), DqHat::ZERO, false);
        let Command { u, injected } = controller.state.commands[0];
        let whole = frame.axis.ahead(frame.half).ahead(frame.half).ahead(frame.half).to_stator(DqHat::new(0.0, 90.0))
            + AlphaBeta::new(10.0, -20.0);
        let share = u.magnitude() / whole.magnitude();
        assert!(share < 0.6 && (injected - AlphaBeta::new(10.0, -20.0) * share).magnitude() < 1e-9, "{injected:?}");
        for observe in [false, true] {
            let (mut controller, frame) = turning(200.0, |c| {
                (c.parameters.compensation.u_dead, c.parameters.compensation.observe) = (6.5, observe);
                c.inputs.u_dc = 325.0;
            });
            let (mode, i_ref) = (Mode::Voltage(DqHat::new(0.0, 20.0)), DqHat::new(0.0, 4.0));
            let Modulated { u: output, .. } = controller.modulate(mode, &frame, &Sample::default(), i_ref, false);
            let beside = (output.to_stator() - controller.state.commands[0].u).magnitude();
            assert_eq!(beside < 1e-9, observe, "{beside} V");
        }
    }

    /// The next sample reads the output of the PI, and the torque of the references.
    #[test]
    fn the_next_sample_reads_references_and_output() {
        let (mut controller, frame) = turning(0.0, |_| ());
        let (i_ref, i) = (DqHat::new(-1.0, 3.0), DqHat::new(-0.5, 2.0));
        controller.keep(&Sample::default(), i_ref, i);
        let (par, state) = (&controller.parameters, &controller.state);
        let expected = (i_ref - i) * (par.current.bandwidth * par.motor.L_d);
        assert!((state.u_pi - expected).magnitude() < 1e-9, "{:?}, not {expected:?}", state.u_pi);
        assert!(
            (state.tau_ref - par.motor.torque(-1.0, 3.0)).abs() < 1e-12 && (state.i_ref - i_ref).magnitude() < 1e-15
        );
        assert_eq!(frame.theta.to_bits(), 0.7_f64.to_bits());
    }

    /// The angle output is that of the next sample, and the minimum torque is below 0.
    #[test]
    fn the_outputs_are_for_the_next_sample() {
        let (mut controller, _) = turning(0.0, |c| c.parameters.estimator = crate::estimator::Kind::Sensored);
        (controller.inputs.theta_meas, controller.inputs.speed_meas) = (0.4, 100.0);
        let out = controller.cycle(false);
        assert!((out.theta_est - 0.4 - 1e-4 * 300.0).abs() < 1e-12 && (out.speed_est - 100.0).abs() < 1e-12, "{out:?}");
        let most = controller.gains.k * controller.parameters.limit.i_q;
        assert!((out.tau_max - most).abs() < 1e-12 && (out.tau_min + most).abs() < 1e-12, "{out:?}");
    }
}
