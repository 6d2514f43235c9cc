//! Self-commissioning inside the controller: start and end, the drive with the bits of the pair, and states that are saved and
//! restored during the sequence.
#![allow(clippy::float_cmp)]

use drive::control::commission::{CommissionFault as Fault, CommissionState as State, Results};
use drive::control::commissioning::{CommissionMode, CommissionParameters};
use drive::control::tables::ControllerParameters;
use drive::control::trip::Cause;
use drive::modulation::PwmUpdate;
use drive::motor::Motor;
use drive::plant::inverter::{Gates, Inverter};
use drive::plant::pwm::{InverterMode, ZeroSequence};
use drive::{Pair, PmsmDrive, SensorlessController};
use fmu_core::log::Warnings;
use fmu_core::{Block, ContinuousTime, Elapsed, Model, Slot, Step, Warns, integrate};

const T_S: f64 = 1e-4;

/// The 2.2 kW machine with the default estimator; the controller waits for `commission_start`.
fn set(controller: &mut SensorlessController) {
    let par = &mut controller.parameters;
    (par.motor, par.J, par.s_2) = (Motor::IPMSM_2_2_KW, 0.015, 40.0);
    (par.limit.i, par.limit.i_q) = (15.0, 15.0);
    (par.commission.mode, par.commission.i, par.commission.speed) = (CommissionMode::Standstill, 15.0, 157.0);
}

fn pair() -> Pair {
    let mut pair = Pair::default();
    set(&mut pair.controller.model);
    let plant = &mut pair.plant.model.parameters;
    (plant.motor, plant.mechanics.J, plant.initial.theta_e) = (Motor::IPMSM_2_2_KW, 0.015, 0.5);
    (plant.inverter.dead_time, plant.inverter.i_zero) = (1e-6, 0.1);
    pair.controller.model.parameters.sensor.noise = 0.01;
    pair.controller.model.parameters.sensor.offset.a = 0.05;
    pair.set_inputs(0.0, 0.0, 540.0);
    pair
}

fn started() -> Pair {
    started_in(CommissionMode::Standstill)
}

fn started_in(mode: CommissionMode) -> Pair {
    let mut pair = pair();
    pair.controller.model.parameters.commission.mode = mode;
    pair.controller.model.inputs.commission_start = true;
    pair.start().unwrap();
    pair
}

fn status(pair: &Pair) -> (State, Fault) {
    (pair.controller.out.commission_state, pair.controller.out.commission_fault)
}

fn gates(pair: &Pair) -> Gates {
    pair.plant.model.inputs.gates()
}

fn results(pair: &mut Pair) -> Results {
    *pair.controller.model.commissioning_mut().as_ref().unwrap().shown()
}

fn steps(pair: &mut Pair, n: usize) {
    for _ in 0..n {
        pair.step(T_S).unwrap();
    }
}

/// Runs until it is in this state, at most 60 s.
fn until(pair: &mut Pair, state: State) {
    for _ in 0..600_000 {
        if status(pair).0 == state {
            return;
        }
        pair.step(T_S).unwrap();
    }
    panic!("{state:?} is not reached: {:?}", status(pair));
}

const STATES: [State; 9] = [
    State::Offsets,
    State::Probe,
    State::Align,
    State::Resistance,
    State::Swing,
    State::Axes,
    State::Saturation,
    State::Start,
    State::Levels,
];

#[test]
fn it_ends_with_results_that_stay_until_the_next_start() {
    let mut pair = started();
    assert!(!pair.controller.out.enabled, "the gates are off from the beginning");
    until(&mut pair, State::Done);
    assert_eq!(status(&pair).1, Fault::None);
    let found = results(&mut pair);
    let motor = Motor::IPMSM_2_2_KW;
    for (value, truth) in [(found.R_s, motor.R_s), (found.L_d, motor.L_d), (found.L_q, motor.L_q), (found.u_dead, 5.4)]
    {
        assert!(value.u < 0.05 && (value.value / truth - 1.0).abs() < 0.01, "{value:?} {truth}");
    }
    // While the request is active, nothing else happens.
    pair.set_inputs(50.0, 0.0, 540.0);
    steps(&mut pair, 2000);
    assert!(gates(&pair) == Gates::Off && !pair.controller.out.enabled);
    assert!(pair.plant.out.speed.abs() < 0.1, "{} rad/s: the machine coasts", pair.plant.out.speed);
    // Then the controller operates, and the values stay.
    pair.controller.model.inputs.commission_start = false;
    steps(&mut pair, 20_000);
    assert!(gates(&pair) == Gates::Switch && (pair.plant.out.speed / 50.0 - 1.0).abs() < 0.05);
    assert_eq!((status(&pair), results(&mut pair)), ((State::Done, Fault::None), found));
    // A start of a turning machine is refused. A further one discards the values.
    pair.controller.model.inputs.commission_start = true;
    steps(&mut pair, 3);
    assert_eq!((status(&pair).0, results(&mut pair), gates(&pair)), (State::Offsets, Results::default(), Gates::Off));
    until(&mut pair, State::Refused);
    steps(&mut pair, 1);
    assert_eq!((status(&pair), gates(&pair)), ((State::Refused, Fault::NotFollowing), Gates::Off));
    let mut said = String::new();
    pair.controller.model.warn(&mut Warnings::to(&mut |(_, _, text)| said += &text()));
    assert!(said.contains("commission_fault = NotFollowing: The rotor turns at the start"), "{said}");
}

/// The rotor turns in the positive direction, at up to half of commission.speed, and all values are found.
#[test]
fn a_turning_machine_tells_its_flux_linkage_inertia_and_friction() {
    let mut pair = started_in(CommissionMode::Spin);
    let mut fastest = 0.0_f64;
    while status(&pair).0 != State::Done {
        pair.step(T_S).unwrap();
        assert!(status(&pair).1 == Fault::None && pair.now.seconds() < 60.0, "{:?}", status(&pair));
        fastest = fastest.max(pair.plant.out.speed);
    }
    assert!((0.45..0.5).contains(&(fastest / 157.0)), "{fastest} rad/s");
    let (r, mechanics) = (results(&mut pair), pair.plant.model.parameters.mechanics.clone());
    let friction = mechanics.friction(0.3 * 157.0);
    for (found, truth, limit) in
        [(r.psi_M, Motor::IPMSM_2_2_KW.psi_M, 0.003), (r.J, mechanics.J, 0.01), (r.tau_friction, friction, 0.05)]
    {
        assert!(found.u < 1.0 && (found.value / truth - 1.0).abs() < limit, "{found:?} {truth}");
    }
    // It coasts to rest.
    let w = pair.plant.out.speed;
    steps(&mut pair, 100);
    assert!(w < 0.12 * 157.0 && (0.0..=w).contains(&pair.plant.out.speed) && gates(&pair) == Gates::Off);
}

/// The friction's current is inside the ripple, where the dead time of switching legs costs nothing: without account of it, the
/// radius of the reference machine would be 1.3 to 3 % off with 1 and 2 us.
#[test]
fn a_switching_inverter_with_dead_time_has_true_values() {
    for (mode, dead_time) in
        [(InverterMode::Switched, 1e-6), (InverterMode::Switched, 2e-6), (InverterMode::Average, 2e-6)]
    {
        let mut pair = Pair::default();
        let (controller, plant) = (&mut pair.controller.model, &mut pair.plant.model.parameters);
        let par = &mut controller.parameters;
        (par.commission.mode, par.commission.i, par.commission.speed) = (CommissionMode::Spin, 7.5, 314.0);
        (par.sensor.noise, par.sensor.resolution) = (0.01, 0.01);
        controller.inputs.commission_start = true;
        (plant.inverter.pwm.mode, plant.inverter.dead_time, plant.initial.theta_e) = (mode, dead_time, 0.7);
        pair.set_inputs(0.0, 0.0, 325.0);
        pair.start().unwrap();
        until(&mut pair, State::Done);
        let (r, plant) = (results(&mut pair), &pair.plant.model.parameters);
        let (motor, mechanics) = (&plant.motor, &plant.mechanics);
        for (name, found, truth, limit) in [
            ("R_s", r.R_s, motor.R_s, 0.001),
            ("u_dead", r.u_dead, dead_time / T_S * 325.0, 0.001),
            ("L_d", r.L_d, motor.L_d, 0.02),
            ("L_q", r.L_q, motor.L_q, 0.03),
            ("psi_M", r.psi_M, motor.psi_M, 0.003),
            ("J", r.J, mechanics.J, 0.02),
            ("tau_friction", r.tau_friction, mechanics.friction(0.3 * 314.0), 0.08),
        ] {
            let error = found.value / truth - 1.0;
            println!("{mode:?}, {dead_time} s: {name} {:+.3} % +-{:.3} %", 100.0 * error, 100.0 * found.u);
            assert!(found.u < limit && error.abs() < found.u, "{mode:?}, {dead_time} s: {name} {error} {found:?}");
        }
    }
}

/// A blocked rotor is refused, with the values of standstill.
#[test]
fn a_blocked_rotor_keeps_the_values_of_standstill() {
    let mut pair = pair();
    pair.controller.model.parameters.commission.mode = CommissionMode::Spin;
    pair.controller.model.inputs.commission_start = true;
    pair.plant.model.parameters.mechanics.imposed = true;
    pair.start().unwrap();
    until(&mut pair, State::Refused);
    steps(&mut pair, 1);
    let r = results(&mut pair);
    assert_eq!((status(&pair).1, gates(&pair)), (Fault::NotFollowing, Gates::Off));
    assert!(r.R_s.u < 0.01 && r.L_q.u < 0.05 && [r.psi_M, r.J, r.tau_friction].iter().all(|x| x.u >= 1.0), "{r:?}");
}

/// The current of a controller at rest does not count as an offset.
#[test]
fn the_current_before_the_start_is_no_offset() {
    let mut pair = pair();
    pair.start().unwrap();
    steps(&mut pair, 5000);
    assert!(pair.controller.out.i_ref.d > 4.0, "the low-speed law holds 5 A");
    pair.controller.model.inputs.commission_start = true;
    until(&mut pair, State::Probe);
    let stored = serde_json::to_value(&pair.controller.model).unwrap();
    let sequence = &stored["commissioning"]["sequence"];
    let [sigma, a] = [&sequence["bench"]["sigma"], &sequence["offset"]["a"]].map(|x| x.as_f64().unwrap());
    assert!((0.006..0.01).contains(&sigma), "noise of 10 mA in three phases: {sigma}");
    assert!((a - 0.05 * 2.0 / 3.0).abs() < 1e-3, "without the common part of the phases: {a}");
}

#[test]
fn an_abort_opens_the_gates_at_once_in_every_state() {
    let mut pair = started_in(CommissionMode::Spin);
    for state in STATES {
        until(&mut pair, state);
        steps(&mut pair, 7);
        for how in 0..4 {
            let mut aborted = pair.clone();
            let model = &mut aborted.controller.model;
            match how {
                0 => model.inputs.commission_start = false,
                1 => model.inputs.enable = false,
                2 => model.inputs.asc = true,
                _ => (model.parameters.trip.used, model.parameters.trip.u_dc, model.inputs.u_dc) = (true, 550.0, 551.0),
            }
            // The sample that detects it, and the exchange of the command with the plant.
            steps(&mut aborted, 1);
            assert_eq!(status(&aborted), (State::Refused, Fault::Aborted), "{state:?} {how}");
            assert!(!aborted.controller.out.enabled && aborted.controller.out.u == drive::frame::Phases::default());
            steps(&mut aborted, 1);
            assert_eq!(gates(&aborted), if how == 2 { Gates::Short } else { Gates::Off }, "{state:?} {how}");
            let tripped = if how == 3 { Cause::OverVoltage } else { Cause::None };
            assert_eq!(aborted.controller.out.tripped, tripped);
            if how == 1 {
                // Enabled again, it does not restart, and the controller waits for the end of the request.
                aborted.controller.model.inputs.enable = true;
                steps(&mut aborted, 10);
                assert_eq!((status(&aborted), gates(&aborted)), ((State::Refused, Fault::Aborted), Gates::Off));
            }
            if how < 2 {
                aborted.controller.model.inputs.commission_start = false;
                steps(&mut aborted, 3);
                assert!(aborted.controller.out.enabled && status(&aborted) == (State::Refused, Fault::Aborted));
            }
        }
    }
}

#[test]
fn a_link_that_falls_by_a_fifth_and_too_little_time_are_named() {
    for state in [State::Offsets, State::Probe, State::Align, State::Resistance, State::Levels] {
        let mut pair = started_in(CommissionMode::Spin);
        until(&mut pair, state);
        steps(&mut pair, 300);
        pair.set_inputs(0.0, 0.0, 430.0);
        steps(&mut pair, 2);
        assert_eq!((status(&pair), gates(&pair)), ((State::Refused, Fault::Voltage), Gates::Off), "{state:?}");
    }
    let mut pair = started();
    pair.controller.model.parameters.commission.t_max = 0.5;
    pair.start().unwrap();
    until(&mut pair, State::Refused);
    assert_eq!(status(&pair).1, Fault::Time);
}

#[test]
fn a_rising_edge_counts_while_the_controller_is_enabled() {
    let mut pair = pair();
    pair.controller.model.inputs.enable = false;
    pair.start().unwrap();
    steps(&mut pair, 3);
    pair.controller.model.inputs.commission_start = true;
    steps(&mut pair, 3);
    pair.controller.model.inputs.enable = true;
    steps(&mut pair, 3000);
    assert_eq!((status(&pair), gates(&pair)), ((State::Idle, Fault::None), Gates::Off));
    pair.controller.model.inputs.commission_start = false;
    steps(&mut pair, 3);
    pair.controller.model.inputs.commission_start = true;
    steps(&mut pair, 2);
    assert_eq!(status(&pair).0, State::Offsets);
}

/// Without a mode, the input has no effect, nothing is allocated, and the outputs report no result.
#[test]
fn off_it_is_not_there() {
    let mut off = pair();
    off.controller.model.parameters.commission = CommissionParameters::default();
    let mut asked = off.clone();
    asked.controller.model.inputs.commission_start = true;
    off.start().unwrap();
    asked.start().unwrap();
    for _ in 0..2000 {
        off.step(T_S).unwrap();
        asked.step(T_S).unwrap();
        assert!(off.controller.out == asked.controller.out && off.plant.out == asked.plant.out);
    }
    assert!(asked.controller.model.commissioning_mut().is_none());
    assert_eq!(shown(&mut asked.controller, "identified_R_s"), 0.0);
    assert_eq!(shown(&mut asked.controller, "identified_R_s_u"), 1.0);
    assert!(asked.controller.out.enabled);
}

fn shown<M: Model>(block: &mut Block<M>, name: &str) -> f64 {
    let index = (0..M::TABLE.len()).find(|&i| M::TABLE.locate(i).is_some_and(|(found, ..)| found == name)).unwrap();
    match M::TABLE.entry(block, index) {
        Some((_, Slot::Constant(fmu_core::Constant::Real(x)))) => x,
        other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn a_current_above_the_limit_is_refused_before_the_start() {
    let mut pair = pair();
    pair.controller.model.parameters.commission.i = 15.1;
    let fault = pair.controller.model.validate().unwrap_err();
    assert_eq!(fault.message(), "commission.i = 15.1 A is not allowed: at most limit.i = 15 A");
    pair.controller.model.parameters.commission.mode = CommissionMode::Off;
    pair.controller.model.validate().unwrap();
}

fn drive() -> Block<PmsmDrive> {
    let mut drive = Block::<PmsmDrive>::default();
    drive.model.pair = pair();
    (drive.model.inputs.u_dc, drive.model.inputs.commission_start) = (540.0, true);
    drive.initialize();
    drive.model.validate().unwrap();
    drive
}

/// Bit for bit: the drive in steps of 1 ms, the pair in steps of T_s.
#[test]
fn the_drive_is_the_pair() {
    let (mut pair, mut drive) = (started(), drive());
    let (mut now, mut done) = (Elapsed::ZERO, 0);
    for k in 0..30_000 {
        let start = k != 25_000;
        pair.controller.model.inputs.commission_start = start;
        drive.model.inputs.commission_start = start;
        steps(&mut pair, 10);
        let step = Step { start: now, h: 1e-3 };
        drive.step(&step).unwrap();
        now = step.end();
        assert!(drive.out.controller == pair.controller.out && drive.out.plant.i == pair.plant.out.i, "{k} ms");
        for name in ["identified_R_s", "identified_L_q_u"] {
            assert_eq!(
                shown(&mut drive, name).to_bits(),
                shown(&mut pair.controller, name).to_bits(),
                "{k} ms: {name}"
            );
        }
        done += u32::from(status(&pair).0 == State::Done);
    }
    assert!(done > 1000 && status(&pair).0 != State::Done, "a second start");
}

/// In Model Exchange the sequence finds the same values.
#[test]
fn model_exchange_finds_the_same_resistance() {
    let (mut pair, mut drive, mut now) = (started(), drive(), Elapsed::ZERO);
    while shown(&mut drive, "identified_R_s") == 0.0 {
        let step = Step { start: now, h: T_S };
        integrate::hybrid::<PmsmDrive, 5>(&mut drive.model, &step, 1e-5).unwrap();
        now = step.end();
        let Block { model, out } = &mut drive;
        model.observe(now, out);
        assert!(now.seconds() < 15.0 && out.controller.commission_fault == Fault::None);
    }
    until(&mut pair, State::Axes);
    let [here, there] = [shown(&mut drive, "identified_R_s"), shown(&mut pair.controller, "identified_R_s")];
    assert!((here / there - 1.0).abs() < 1e-5, "{here} {there}");
}

/// A drive that is stored in the middle of each state and then restored continues with the same bits.
#[test]
fn a_restored_drive_is_the_same_drive() {
    let (mut whole, mut restored) = (started_in(CommissionMode::Spin), started_in(CommissionMode::Spin));
    let (mut seen, mut last, mut since) = (vec![], State::Idle, 0);
    while status(&whole).0 != State::Done {
        since = if status(&whole).0 == last { since + 1 } else { 0 };
        last = status(&whole).0;
        if since == 40 {
            seen.push(last);
            let bytes = postcard::to_stdvec(&restored).unwrap();
            restored = started();
            steps(&mut restored, 500);
            restored = postcard::from_bytes(&bytes).unwrap();
        }
        steps(&mut whole, 1);
        steps(&mut restored, 1);
        assert!(whole.controller.out == restored.controller.out && whole.plant.out == restored.plant.out, "{last:?}");
    }
    assert!(whole.controller.model == restored.controller.model);
    assert!(STATES.iter().all(|state| seen.contains(state)), "{seen:?}");
}

/// A controller without commissioning has a tenth of its size.
#[test]
fn the_default_is_small() {
    let (with, without) = (size_of::<drive::control::commission::Commission>(), size_of::<SensorlessController>());
    assert!(with > 20_000 && 10 * without < with, "{with} and {without} bytes");
}

type Setting = fn(&mut Inverter, &mut ControllerParameters);

/// A self-commissioning that takes the carrier for another than it is, or whose samples contain the ripple.
#[test]
fn another_carrier_is_refused_by_name() {
    let said = |set: Setting| {
        let mut drive = Block::<PmsmDrive>::default();
        let Pair { plant, controller, .. } = &mut drive.model.pair;
        plant.model.parameters.inverter.pwm.mode = InverterMode::Switched;
        plant.model.parameters.inverter.dead_time = 1e-6;
        controller.model.parameters.commission.mode = CommissionMode::Spin;
        set(&mut plant.model.parameters.inverter, &mut controller.model.parameters);
        drive.model.validate().map_err(|fault| fault.message().to_owned())
    };
    assert_eq!(said(|_, _| ()), Ok(()));
    assert_eq!(
        said(|inverter, par| {
            (inverter.T_pwm, inverter.pwm.update) = (2e-4, PwmUpdate::Double);
            par.commission.update = PwmUpdate::Double;
        }),
        Ok(())
    );
    let refused: [(Setting, _); 6] = [
        (
            |inverter, _| (inverter.T_pwm, inverter.pwm.update) = (2e-4, PwmUpdate::Double),
            "plant.inverter.update = 2 (Double)",
        ),
        (|_, par| par.commission.update = PwmUpdate::Double, "controller.commission.update = 2 (Double): with"),
        (|inverter, _| inverter.T_pwm = 5e-5, "plant.inverter.T_pwm = 0.00005 s"),
        (|inverter, _| inverter.pwm.carrier_delay = 1e-6, "plant.inverter.carrier_delay = 0.000001 s"),
        (
            |inverter, _| inverter.pwm.zero_sequence = ZeroSequence::DpwmLow,
            "plant.inverter.zero_sequence = 4 (DpwmLow)",
        ),
        (|inverter, _| inverter.pwm.zero_sequence = ZeroSequence::DpwmHigh, "controller.commission.mode = 3 (Spin)"),
    ];
    for (set, named) in refused {
        let why = said(set).expect_err(named);
        assert!(why.contains(named) && !why.contains("plant.plant"), "{named}: {why}");
        println!("{why}");
    }
    // Without a dead time or a commissioning, nothing depends on it.
    assert_eq!(
        said(|inverter, _| (inverter.dead_time, inverter.pwm.zero_sequence) = (0.0, ZeroSequence::DpwmLow)),
        Ok(())
    );
    assert_eq!(said(|inverter, par| (inverter.T_pwm, par.commission.mode) = (2e-4, CommissionMode::Off)), Ok(()));
}
