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

/// With a delay of one sample, the command acts 1.5 samples later on average: 1.5 * 0.1 ms * 400 rad/s.
#[test]
fn a_command_is_turned_to_where_it_acts() {
    let mut controller = SensorlessController::default();
    let half = Turn::new(0.5 * controller.parameters.T_s * 400.0);
    let frame = Frame { axis: Axis::at(0.0), theta: 0.0, w: 400.0, half, i: DqHat::ZERO, injection: Injection::None };
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
    controller.keep(Mode::ClosedLoop, &Sample::default(), i_ref, i);
    let (par, state) = (&controller.parameters, &controller.state);
    let expected = (i_ref - i) * (par.current.bandwidth * par.motor.L_d);
    assert!((state.u_pi - expected).magnitude() < 1e-9, "{:?}, not {expected:?}", state.u_pi);
    assert!((state.tau_ref - par.motor.torque(-1.0, 3.0)).abs() < 1e-12 && (state.i_ref - i_ref).magnitude() < 1e-15);
    assert_eq!(frame.theta.to_bits(), 0.7_f64.to_bits());
}

/// The angle output applies to the next sample, and the minimum torque is below 0.
#[test]
fn the_outputs_are_for_the_next_sample() {
    let (mut controller, _) = turning(0.0, |c| c.parameters.estimator = crate::estimator::Kind::Sensored);
    (controller.inputs.theta_meas, controller.inputs.speed_meas) = (0.4, 100.0);
    let out = controller.cycle();
    assert!((out.theta_est - 0.4 - 1e-4 * 300.0).abs() < 1e-12 && (out.speed_est - 100.0).abs() < 1e-12, "{out:?}");
    let most = controller.gains.k * controller.parameters.limit.i_q;
    assert!((out.tau_max - most).abs() < 1e-12 && (out.tau_min + most).abs() < 1e-12, "{out:?}");
}
