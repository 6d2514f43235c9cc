//! Model Exchange of the native models: derivatives and events, integrated in steps of 1 us between events, against
//! Co-Simulation.
#![allow(clippy::float_cmp)]

use drive::control::signals::ControllerInputs;
use drive::frame::{AlphaBeta, Dq, Phases};
use drive::plant::inverter::Inverter;
use drive::plant::pwm::{InverterMode, OpenPhase, OpenSwitch, PwmUpdate, ZeroSequence};
use drive::plant::signals::PlantOutputs;
use drive::{PmsmDrive, PmsmPlant, SensorlessController};
use fmu_core::events::grid;
use fmu_core::log::Warnings;
use fmu_core::{
    Block, Capabilities, ContinuousTime, Elapsed, Events, Interface, Model, Sampled, Slot, Step, Warns, integrate,
};
use std::f64::consts::PI;

const T_S: f64 = 1e-4;
const RPM: f64 = PI / 30.0;
/// Maximum integration step in s.
const FINE: f64 = 1e-6;

/// A model in Co-Simulation, and the same model integrated from its derivatives and events.
struct Both<M: Model, const N: usize> {
    stepped: Block<M>,
    integrated: Block<M>,
    now: Elapsed,
}

impl<M: ContinuousTime + Events + Clone, const N: usize> Both<M, N> {
    fn new(set: impl FnOnce(&mut M)) -> Self {
        let mut stepped = Block::<M>::default();
        set(&mut stepped.model);
        stepped.initialize();
        Self { integrated: stepped.clone(), stepped, now: Elapsed::ZERO }
    }

    /// Sets inputs of both.
    fn set(&mut self, set: impl Fn(&mut M)) {
        set(&mut self.stepped.model);
        set(&mut self.integrated.model);
    }

    /// One communication step of `h` (s) of both; the integrated one takes substeps of at most `longest` (s).
    fn step(&mut self, h: f64, longest: f64) {
        let step = Step { start: self.now, h };
        self.stepped.step(&step).unwrap();
        let Block { model, out } = &mut self.integrated;
        integrate::hybrid::<M, N>(model, &step, longest).unwrap();
        self.now = step.end();
        model.observe(self.now, out);
    }
}

/// Largest difference of the currents (A), and difference of the speeds (rad/s).
fn apart(a: &PlantOutputs, b: &PlantOutputs) -> (f64, f64) {
    let pairs = [(a.i.a, b.i.a), (a.i.b, b.i.b), (a.i.c, b.i.c), (a.i_d, b.i_d), (a.i_q, b.i_q)];
    (pairs.iter().map(|(a, b)| (a - b).abs()).fold(0.0, f64::max), (a.speed - b.speed).abs())
}

#[test]
fn the_drive_starts_from_the_opposite_angle_and_takes_a_load_step() {
    let mut drive = Both::<PmsmDrive, 5>::new(|drive| {
        drive.pair.plant.model.parameters.initial.theta_e = PI;
        drive.inputs.speed_ref = 500.0 * RPM;
    });
    let (mut current, mut speed, mut highest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for k in 0..6000 {
        if k == 4000 {
            drive.set(|drive| drive.inputs.tau_load = 2.0);
        }
        drive.step(T_S, FINE);
        let (di, dw) = apart(&drive.stepped.out.plant, &drive.integrated.out.plant);
        (current, speed) = (current.max(di), speed.max(dw));
        assert_eq!(drive.stepped.out.controller.enabled, drive.integrated.out.controller.enabled);
        let (ours, theirs) = (drive.stepped.out.controller.speed_est, drive.integrated.out.controller.speed_est);
        assert!((ours - theirs).abs() < 1e-3, "the same sample is visible at {k} T_s: {ours} {theirs}");
        highest = highest.max(drive.stepped.out.plant.i_q.abs());
    }
    println!("currents {current:e} A, speed {speed:e} rad/s apart; i_q up to {highest} A");
    assert!(current < 1e-5 && speed < 1e-4, "{current} A, {speed} rad/s");
    let end = drive.stepped.out.plant.speed;
    assert!(highest > 3.0 && (end - 500.0 * RPM).abs() < 100.0 * RPM, "the run is not trivial: {highest} A, {end}");
}

#[test]
fn the_drive_does_not_depend_on_the_importers_step() {
    // The events at k T_s do not depend on the communication points.
    let run = |h: f64, steps: u32| {
        let mut drive = Block::<PmsmDrive>::default();
        drive.model.inputs.speed_ref = 30.0;
        drive.initialize();
        let mut now = Elapsed::ZERO;
        for _ in 0..steps {
            let step = Step { start: now, h };
            integrate::hybrid::<PmsmDrive, 5>(&mut drive.model, &step, 10e-6).unwrap();
            now = step.end();
        }
        drive.model.observe(now, &mut drive.out);
        drive.out
    };
    let reference = run(T_S, 5110);
    for (h, steps) in [(0.7e-4, 7300), (1e-3, 511), (7.3e-3, 70)] {
        let out = run(h, steps);
        let (current, speed) = apart(&reference.plant, &out.plant);
        let estimate = (reference.controller.speed_est - out.controller.speed_est).abs();
        println!("h = {h} s: {current:e} A, {speed:e} rad/s, estimates {estimate:e} rad/s apart");
        assert!(current < 1e-9 && speed < 1e-9 && estimate < 1e-8, "h = {h} s: {current} A, {speed}, {estimate} rad/s");
    }
}

#[test]
fn an_enabled_plant_is_integrated_to_the_same_currents() {
    let dead_time: fn(&mut PmsmPlant) = |plant| plant.parameters.inverter.dead_time = 2e-6;
    let saturated = |plant: &mut PmsmPlant| {
        let saturation = &mut plant.parameters.saturation;
        (saturation.s_2, saturation.s_3, saturation.s_dq) = (40.0, 40.0, 7.0);
    };
    // Most of the voltages lie outside of the hexagon of this link.
    let limited = |plant: &mut PmsmPlant| plant.inputs.u_dc = 95.0;
    // Dead time has kinks, which reduce the order of the substeps of Co-Simulation.
    let cases = [
        ("dead time", dead_time, 5e-4, 1e-4),
        ("linear", |_| (), 1e-7, 1e-6),
        ("saturated", saturated, 1e-7, 1e-6),
        ("hexagon", limited, 1e-7, 1e-6),
    ];
    for (name, set, allowed, allowed_speed) in cases {
        let w = 1000.0 * RPM;
        let mut plant = Both::<PmsmPlant, 4>::new(|plant| {
            (plant.parameters.initial.speed, plant.parameters.mechanics.J) = (w, 0.05);
            set(plant);
        });
        let (mut largest, mut highest) = ((0.0_f64, 0.0_f64), 0.0_f64);
        for k in 0..500 {
            let theta = 3.0 * w * T_S * f64::from(k) + PI / 2.0;
            let u = 0.15 * 3.0 * w + 10.0 + 8.0 * f64::from(k % 7) / 6.0;
            plant.set(|plant| plant.inputs.u = Phases::from_stator(AlphaBeta::new(u * theta.cos(), u * theta.sin())));
            plant.step(T_S, FINE);
            let (di, dw) = apart(&plant.stepped.out, &plant.integrated.out);
            largest = (largest.0.max(di), largest.1.max(dw));
            highest = highest.max(plant.stepped.out.i_q);
        }
        println!("{name}: {:e} A, {:e} rad/s apart, up to {highest} A", largest.0, largest.1);
        assert!(largest.0 < allowed && largest.1 < allowed_speed, "{name}: {largest:?}");
        assert!(highest > 0.5, "{name}: {highest} A");
    }
}

/// A switched inverter, with these settings of the inverter and other parameters.
type Switching = (&'static str, fn(&mut Inverter), fn(&mut PmsmPlant));

#[test]
fn a_switched_inverter_is_integrated_to_the_same_currents() {
    let dead = |inverter: &mut Inverter| inverter.dead_time = 2e-6;
    let lossy = |inverter: &mut Inverter| {
        inverter.dead_time = 2e-6;
        let devices = &mut inverter.devices;
        (devices.u_transistor, devices.r_transistor, devices.u_diode, devices.r_diode) = (0.9, 0.06, 0.7, 0.05);
    };
    let cases: [Switching; 7] = [
        ("ideal", |_| (), |_| ()),
        ("dead time", dead, |_| ()),
        ("devices", lossy, |_| ()),
        ("saturation", dead, |plant| plant.parameters.saturation.s_2 = 40.0),
        (
            "double update",
            |inverter| {
                (inverter.dead_time, inverter.pwm.carrier_delay) = (3e-6, 1.3e-5);
                (inverter.pwm.update, inverter.pwm.zero_sequence) = (PwmUpdate::Double, ZeroSequence::DpwmAlternating);
            },
            |_| (),
        ),
        ("open switch", |inverter| inverter.pwm.open_switch = OpenSwitch::UpperB, |_| ()),
        ("open phase", |inverter| inverter.pwm.open_phase = OpenPhase::C, |_| ()),
    ];
    for (name, inverter, set) in cases {
        let w = 300.0 * RPM;
        let mut plant = Both::<PmsmPlant, 4>::new(|plant| {
            (plant.parameters.initial.speed, plant.parameters.mechanics.J) = (w, 0.05);
            plant.parameters.inverter.pwm.mode = InverterMode::Switched;
            inverter(&mut plant.parameters.inverter);
            set(plant);
        });
        let (mut largest, mut highest, mut blocked) = ((0.0_f64, 0.0_f64), 0.0_f64, 0);
        for k in 0..300 {
            let theta = 3.0 * w * T_S * f64::from(k) + PI / 2.0;
            // Up to 7 A; small ones change sign within a period.
            let u = 0.15 * 3.0 * w + 14.0 * f64::from(k % 40) / 39.0;
            plant.set(|plant| {
                plant.inputs.u = Phases::from_stator(AlphaBeta::new(u * theta.cos(), u * theta.sin()));
                plant.inputs.enable = !(200..230).contains(&k);
            });
            // Every second time, to points within a period.
            for h in if k % 2 == 0 { vec![T_S] } else { vec![0.37 * T_S, 0.63 * T_S] } {
                plant.step(h, 2.0 * FINE);
                let (di, dw) = apart(&plant.stepped.out, &plant.integrated.out);
                largest = (largest.0.max(di), largest.1.max(dw));
                highest = highest.max(plant.stepped.out.i_q);
                blocked += u32::from(plant.integrated.out.i == Phases::default());
            }
        }
        println!("{name}: {:e} A, {:e} rad/s apart, up to {highest} A, {blocked} times blocked", largest.0, largest.1);
        assert!(largest.0 < 2e-6 && largest.1 < 1e-6, "{name}: {largest:?}");
        assert!(highest > 0.5 && blocked > 10, "{name}: {highest} A, {blocked}");
    }
}

/// All currents of a dead time end one after the other: each indicator is above 0 after an event, and one falls below 0 at the next.
#[test]
fn the_legs_indicators_are_positive_after_each_event() {
    let mut plant = Block::<PmsmPlant>::default();
    let inverter = &mut plant.model.parameters.inverter;
    (inverter.pwm.mode, inverter.devices.u_diode) = (InverterMode::Switched, 0.7);
    plant.model.inputs.enable = false;
    let z = |plant: &PmsmPlant| {
        let mut z = [0.0; 3];
        plant.indicators(Elapsed::ZERO, &mut z);
        z
    };
    for signs in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0], [2.0, -1.0]] {
        plant.initialize();
        let model = &mut plant.model;
        *model.flux_mut() = Dq::new(model.parameters.motor.psi_M + 1e-3 * signs[0], 2e-3 * signs[1]);
        model.event(Elapsed::ZERO).unwrap();
        let (mut events, mut now) = (0, 0.0);
        while plant.model.flux_mut().q() != 0.0 && now < 1e-3 {
            assert!(z(&plant.model).iter().all(|&z| z > 0.0), "{signs:?} after {events} events: {:?}", z(&plant.model));
            let mut dx = [0.0; 4];
            while z(&plant.model).iter().all(|&z| z > 0.0) && now < 1e-3 {
                plant.model.derivatives(Elapsed::ZERO, &mut dx).unwrap();
                let psi = plant.model.flux_mut();
                *psi = Dq::new(psi.d() + 1e-9 * dx[0], psi.q() + 1e-9 * dx[1]);
                now += 1e-9;
            }
            plant.model.event(Elapsed::ZERO).unwrap();
            events += 1;
        }
        assert!(events >= 2 && now < 1e-4, "{signs:?}: {events} events in {now} s");
        assert_eq!(z(&plant.model).map(|z| z > 0.0), [true; 3]);
    }
}

/// In a dead time, the voltages amplify a difference of the currents, so those of the integration grow in a closed loop.
#[test]
fn a_drive_with_a_switched_inverter_takes_the_same_load_step() {
    for (dead_time, allowed) in [(0.0, 1e-5), (2e-6, 5e-3)] {
        let mut drive = Both::<PmsmDrive, 5>::new(|drive| {
            let inverter = &mut drive.pair.plant.model.parameters.inverter;
            (inverter.pwm.mode, inverter.dead_time) = (InverterMode::Switched, dead_time);
            drive.inputs.speed_ref = 500.0 * RPM;
        });
        let (mut current, mut speed, mut highest) = (0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..6000 {
            if k == 4000 {
                drive.set(|drive| drive.inputs.tau_load = 2.0);
            }
            drive.step(T_S, 5.0 * FINE);
            let (di, dw) = apart(&drive.stepped.out.plant, &drive.integrated.out.plant);
            (current, speed) = (current.max(di), speed.max(dw));
            highest = highest.max(drive.stepped.out.plant.i_q.abs());
        }
        println!("dead time {dead_time}: {current:e} A, {speed:e} rad/s apart; i_q up to {highest} A");
        assert!(current < allowed && speed < allowed, "{dead_time} s: {current} A, {speed} rad/s");
        assert!(highest > 3.0, "the run is not trivial: {highest} A");
    }
}

#[test]
fn gates_off_the_current_decays_and_the_diodes_block() {
    // 1 ms with voltage, then the gates are off: the current returns to the link until the diodes block.
    let mut plant = Both::<PmsmPlant, 4>::new(|plant| plant.parameters.initial.speed = 100.0);
    plant.set(|plant| plant.inputs.u = Phases { a: 30.0, b: 20.0, c: -50.0 });
    plant.step(1e-3, FINE);
    assert!(plant.integrated.out.i.c < -2.0, "{:?}", plant.integrated.out);
    plant.set(|plant| plant.inputs.enable = false);
    let (mut largest, mut gone) = ((0.0_f64, 0.0_f64), [0_u32; 2]);
    for k in 1..2000 {
        plant.step(FINE, FINE / 10.0);
        let (stepped, integrated) = (&plant.stepped.out, &plant.integrated.out);
        for (gone, out) in gone.iter_mut().zip([stepped, integrated]) {
            if *gone == 0 && out.i == Phases::default() {
                *gone = k;
            }
        }
        if (gone[0] == 0) == (gone[1] == 0) {
            let (di, dw) = apart(stepped, integrated);
            largest = (largest.0.max(di), largest.1.max(dw));
        }
    }
    println!("{largest:?}, blocked after {gone:?} us");
    assert!(gone[0].abs_diff(gone[1]) <= 1 && gone[1] > 10, "{gone:?} us");
    // Co-Simulation blocks at the end of a step: up to 1 us later, with the torque of 0.1 A.
    assert!(largest.0 < 1e-4 && largest.1 < 5e-5, "{largest:?}");
    // With blocking diodes the machine coasts; only friction brakes it.
    plant.step(0.2, FINE);
    let (di, dw) = apart(&plant.stepped.out, &plant.integrated.out);
    assert!(di == 0.0 && dw < 5e-5 && plant.integrated.out.speed < 97.0, "{di} A, {dw} rad/s");
    let powers = plant.integrated.out.powers;
    assert!(powers.p_in == 0.0 && powers.i_dc == 0.0 && powers.p_loss > 0.0, "{powers:?}");
}

#[test]
fn diodes_conduct_while_the_emf_exceeds_the_link() {
    // 600 rad/s: 468 V line to line. The link falls from 600 V to 325 V and rises again.
    let mut plant = Both::<PmsmPlant, 4>::new(|plant| {
        (plant.parameters.initial.speed, plant.parameters.mechanics.J) = (600.0, 1.0);
        (plant.inputs.enable, plant.inputs.u_dc) = (false, 600.0);
    });
    for (u_dc, conducts) in [(600.0, false), (325.0, true), (600.0, false), (468.5, false), (400.0, true)] {
        plant.set(|plant| plant.inputs.u_dc = u_dc);
        let (mut current, mut torque) = (0.0_f64, 0.0_f64);
        for k in 0..100 {
            plant.step(T_S, FINE);
            let (di, _) = apart(&plant.stepped.out, &plant.integrated.out);
            current = current.max(di);
            // A current takes a few milliseconds to decay.
            if k > 50 {
                torque = torque.min(plant.integrated.out.tau_e);
            }
        }
        println!("{u_dc} V: {current} A apart, torque {torque} N.m");
        assert!(current < 5e-4, "{u_dc} V: {current} A apart");
        let none = plant.integrated.out.i == Phases::default();
        assert_eq!((torque < -0.5, !none), (conducts, conducts), "{u_dc} V: {:?}", plant.integrated.out);
        let powers = plant.integrated.out.powers;
        assert!(if conducts { powers.p_in < 0.0 } else { powers.p_in == 0.0 }, "{powers:?}");
    }
}

#[test]
fn indicators_stand_on_the_side_of_the_decision() {
    let mut plant = Block::<PmsmPlant>::default();
    plant.initialize();
    let z = |plant: &PmsmPlant| {
        let mut z = [f64::NAN; 2];
        plant.indicators(Elapsed::ZERO, &mut z);
        z
    };
    assert_eq!(z(&plant.model), [1.0, 1.0], "enabled");
    plant.model.inputs.enable = false;
    let outcome = plant.model.event(Elapsed::ZERO).unwrap();
    assert!(!outcome.states_changed && !outcome.again, "nothing to change at standstill: {outcome:?}");
    assert!(z(&plant.model).iter().all(|&z| z < 0.0), "blocked");
    // The EMF of exactly the link voltage opens the diodes, and the indicator is not 0.
    let legs = 3.0_f64.sqrt() * 0.15 * 3.0;
    plant.model.inputs.u_dc = legs * 400.0;
    PmsmPlant::STATES[2].at(&mut plant.model);
    *PmsmPlant::STATES[2].at(&mut plant.model) = 400.0;
    plant.model.settle();
    let before = z(&plant.model);
    assert!(!plant.model.event(Elapsed::ZERO).unwrap().states_changed);
    assert!(before[1].abs() < 2e-9 && z(&plant.model)[1] != 0.0, "{before:?} {:?}", z(&plant.model));
    // A remaining current is discarded only once; a second event changes nothing.
    *PmsmPlant::STATES[2].at(&mut plant.model) = 10.0;
    *PmsmPlant::STATES[1].at(&mut plant.model) += 1e-4;
    assert!(plant.model.event(Elapsed::ZERO).unwrap().states_changed);
    assert!(!plant.model.event(Elapsed::ZERO).unwrap().states_changed);
    // A link without voltage never blocks, and no indicator is NaN.
    plant.model.inputs.u_dc = 0.0;
    plant.model.event(Elapsed::ZERO).unwrap();
    assert!(z(&plant.model).iter().all(|z| z.is_finite() && *z != 0.0) && z(&plant.model)[1] > 0.0);
}

#[test]
fn an_imposed_shaft_replaces_the_mechanical_states() {
    let mut plant = Both::<PmsmPlant, 4>::new(|plant| {
        plant.parameters.mechanics.imposed = true;
        plant.inputs.u = Phases { a: 20.0, b: -10.0, c: -10.0 };
    });
    let speed = 80.0;
    for k in 0..200 {
        let angle = speed * T_S * f64::from(k);
        plant.set(|plant| (plant.inputs.speed_shaft, plant.inputs.angle_shaft) = (speed, angle));
        // Between two events, the importer advances the angle.
        let step = Step { start: plant.now, h: T_S };
        plant.stepped.step(&step).unwrap();
        let model = &mut plant.integrated.model;
        model.event(plant.now).unwrap();
        let mut now = plant.now;
        for _ in 0..100 {
            heun(model, now, FINE, |model, t| model.inputs.angle_shaft = angle + speed * t.since(plant.now));
            now = now.plus(FINE);
        }
        model.observe(now, &mut plant.integrated.out);
        plant.now = now;
        let (a, b) = (&plant.stepped.out, &plant.integrated.out);
        let (di, dw) = apart(a, b);
        assert!(di < 1e-5 && dw == 0.0, "{k}: {di} A, {dw} rad/s");
        assert!((a.angle - b.angle).abs() < 1e-9 && (a.tau_e - b.tau_e).abs() < 1e-5, "{a:?} {b:?}");
        // The state also follows the angle of the shaft.
        let state = *PmsmPlant::STATES[3].at(&mut plant.integrated.model);
        assert!((state - b.angle).abs() < 1e-9, "{state} {}", b.angle);
    }
    assert!(plant.stepped.out.tau_e.abs() > 0.5, "{:?}", plant.stepped.out);
}

/// One step of `h` (s) of Heun's method with a changing input.
fn heun(plant: &mut PmsmPlant, now: Elapsed, h: f64, mut input: impl FnMut(&mut PmsmPlant, Elapsed)) {
    let (mut k_1, mut k_2) = ([0.0; 4], [0.0; 4]);
    input(plant, now);
    plant.derivatives(now, &mut k_1).unwrap();
    let x: Vec<f64> = PmsmPlant::STATES.iter().map(|state| *state.at(plant)).collect();
    let write = |plant: &mut PmsmPlant, dx: &dyn Fn(usize) -> f64| {
        for (i, state) in PmsmPlant::STATES.iter().enumerate() {
            *state.at(plant) = x[i] + dx(i);
        }
        plant.settle();
    };
    write(plant, &|i| h * k_1[i]);
    input(plant, now.plus(h));
    plant.derivatives(now.plus(h), &mut k_2).unwrap();
    write(plant, &|i| 0.5 * h * (k_1[i] + k_2[i]));
}

/// Currents of a plant that turns, and a controller that is off for a while.
fn at_instant(k: u64, inputs: &mut ControllerInputs) {
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let t = T_S * k as f64;
    let i = 2.0 * (1.0 - (-t / 0.02).exp());
    inputs.i = Phases::from_stator(AlphaBeta::new(i * (90.0 * t).cos(), i * (90.0 * t).sin()));
    inputs.speed_ref = 30.0 + 5.0 * (40.0 * t).sin();
    inputs.enable = !(700..900).contains(&k);
}

fn controller() -> Block<SensorlessController> {
    let mut controller = Block::<SensorlessController>::default();
    at_instant(0, &mut controller.model.inputs);
    controller.initialize();
    controller
}

/// Debug text, which distinguishes -0 from 0, and numbers that differ in one bit.
fn shown(controller: &SensorlessController, now: Elapsed) -> String {
    let mut out = <SensorlessController as Model>::Outputs::default();
    controller.output(now, &mut out);
    format!("{out:?}")
}

#[test]
fn a_controller_with_events_is_the_one_stepped_at_t_s() {
    // Its inputs are set at every instant, in Co-Simulation and in the event.
    let (mut stepped, mut eventful) = (controller(), controller().model);
    let mut now = Elapsed::ZERO;
    for k in 0..2000 {
        at_instant(k, &mut stepped.model.inputs);
        eventful.begin(now);
        let before = shown(&eventful, now);
        assert_eq!(shown(&stepped.model, now), before, "visible on entering the event {k}");
        at_instant(k, &mut eventful.inputs);
        eventful.event(now).unwrap();
        eventful.event(now).unwrap();
        assert_eq!(before, shown(&eventful, now), "nothing passes straight through");
        let step = Step { start: now, h: T_S };
        stepped.step(&step).unwrap();
        now = step.end();
    }
    eventful.begin(now);
    assert_eq!(stepped.model, eventful);
    assert!(stepped.out.speed_est.abs() > 1.0, "{:?}", stepped.out);
}

#[test]
fn a_controller_stepped_at_any_step_is_the_one_with_events() {
    for h in [0.7e-4, T_S, 1e-3, 7.3e-3] {
        let (mut stepped, mut eventful) = (controller(), controller().model);
        let mut now = Elapsed::ZERO;
        while now.seconds() < 0.2 {
            let held = grid(&eventful).first_after(now);
            at_instant(held, &mut stepped.model.inputs);
            at_instant(held, &mut eventful.inputs);
            let step = Step { start: now, h };
            stepped.step(&step).unwrap();
            // Every instant of the step except its end.
            while grid(&eventful).passed(eventful.samples(), step.end()) {
                let due = Elapsed::periods(eventful.samples(), T_S);
                eventful.begin(due);
                eventful.event(due).unwrap();
            }
            now = step.end();
            eventful.begin(now);
            assert_eq!(format!("{:?}", stepped.out), shown(&eventful, now), "h = {h} s, {} s", now.seconds());
            assert_eq!(stepped.model, eventful, "h = {h} s, {} s", now.seconds());
        }
        assert!(stepped.model.samples() > 1900);
    }
}

#[test]
fn late_and_foreign_events_lose_no_sample() {
    let mut controller = controller().model;
    controller.begin(Elapsed::ZERO);
    controller.event(Elapsed::ZERO).unwrap();
    assert_eq!(controller.samples(), 1);
    let before = controller.clone();
    controller.begin(Elapsed::ZERO.plus(0.4e-4));
    controller.event(Elapsed::ZERO.plus(0.4e-4)).unwrap();
    assert_eq!(controller, before, "nothing is due");
    // One ulp early is on time.
    controller.event(Elapsed::ZERO.plus(1e-4_f64.next_down())).unwrap();
    assert_eq!(controller.samples(), 2);
    controller.event(Elapsed::ZERO.plus(9.5e-4)).unwrap();
    assert_eq!(controller.samples(), 10);
    let far = controller.event(Elapsed::ZERO.plus(1e6)).unwrap_err();
    assert!(far.message().contains("at most 10000000 sample periods of 0.0001 s"), "{far}");
    controller.inputs.i.a = f64::NAN;
    controller.event(Elapsed::ZERO.plus(1e-3)).unwrap_err();
    assert_eq!(controller.samples(), 10);
}

#[test]
fn a_delay_of_no_sample_is_refused_with_events() {
    let mut drive = PmsmDrive::default();
    for delay in [1, 2] {
        drive.pair.controller.model.parameters.delay = delay;
        for interface in [Interface::CoSimulation, Interface::EventMode, Interface::ModelExchange] {
            drive.validate_for(interface).unwrap();
        }
    }
    drive.pair.controller.model.parameters.delay = 0;
    drive.validate_for(Interface::CoSimulation).unwrap();
    for interface in [Interface::EventMode, Interface::ModelExchange] {
        let fault = drive.validate_for(interface).unwrap_err();
        assert!(fault.message().starts_with("controller.timing.delay = 0 is not allowed: 1 or 2"), "{fault}");
    }
}

#[test]
fn a_lost_rotor_is_warned_of() {
    let warnings = |controller: &SensorlessController| {
        let mut found = Vec::new();
        let mut sink = |(_, key, text): fmu_core::log::Said<'_>| found.push((key, text()));
        controller.warn(&mut Warnings::to(&mut sink));
        found
    };
    let mut block = controller();
    let mut now = Elapsed::ZERO;
    // A voltage without any current: a wrong resistance explains it only beside a current limit that is large for it.
    for (speed_ref, limit, resistance) in [(10.0, 1e3, true), (10.0, 10.0, false), (100.0, 10.0, false)] {
        (block, now) = (controller(), Elapsed::ZERO);
        assert_eq!(warnings(&block.model), []);
        block.model.inputs = ControllerInputs { speed_ref, ..ControllerInputs::default() };
        while block.out.lock_lost < 1.0 {
            let step = Step { start: now, h: T_S };
            block.step(&step).unwrap();
            now = step.end();
            assert!(now.seconds() < 1.0);
        }
        block.model.parameters.limit.i = limit;
        let found = warnings(&block.model);
        assert!(found.len() == 1 && found[0].0 == "lock_lost", "{found:?}");
        assert!(found[0].1.contains("rad/s") && found[0].1.contains("L_q = 0.006 H"), "{found:?}");
        assert!(found[0].1.contains("i_a, i_b and i_c are not connected"), "{found:?}");
        assert_eq!(found[0].1.contains("R_s = 1.8 Ohm"), resistance, "{found:?}");
    }
    // An enormous current: the estimate turns too fast, and the controller restarts.
    block.model.inputs.i = Phases { a: 1e12, b: -1e12, c: 3e11 };
    let mut keys = Vec::new();
    for _ in 0..100 {
        let step = Step { start: now, h: T_S };
        block.step(&step).unwrap();
        now = step.end();
        keys.extend(warnings(&block.model).into_iter().map(|(key, _)| key));
    }
    assert!(keys.contains(&"restarted"), "{keys:?}");
}

#[test]
fn the_states_are_rows_of_the_tables() {
    let plant = Capabilities::<PmsmPlant>::NONE.ContinuousTime().Events().Differentiable();
    let drive = Capabilities::<PmsmDrive>::NONE.ContinuousTime().Events().Differentiable().Warns();
    let nominals = |rows: Vec<usize>, find: &dyn Fn(usize) -> (String, Option<f64>)| -> Vec<(String, Option<f64>)> {
        rows.into_iter().map(find).collect()
    };
    let expected = [("psi_d", 0.1), ("psi_q", 0.1), ("speed", 100.0), ("angle", 1.0), ("u_cap", 100.0)]
        .map(|(n, x)| (n.to_owned(), Some(x)));
    let of_plant = |i| PmsmPlant::TABLE.locate(i).map(|(name, meta, _)| (name, meta.nominal)).unwrap();
    let of_drive = |i| PmsmDrive::TABLE.locate(i).map(|(name, meta, _)| (name, meta.nominal)).unwrap();
    assert_eq!(nominals(plant.rows().unwrap(), &of_plant), expected[..4]);
    assert_eq!(nominals(drive.rows().unwrap(), &of_drive), expected);
    // A state and its variable have the same value.
    let mut block = Block::<PmsmDrive>::default();
    block.model.pair.plant.model.parameters.initial.speed = 20.0;
    block.initialize();
    for (state, index) in PmsmDrive::STATES.iter().zip(drive.rows().unwrap()) {
        *state.at(&mut block.model) += 0.1;
        block.model.settle();
        let x = *state.at(&mut block.model);
        block.model.observe(Elapsed::ZERO, &mut block.out);
        let Some((_, Slot::Real(shown))) = PmsmDrive::TABLE.entry(&mut block, index) else {
            panic!("{} is a real number", state.name)
        };
        assert_eq!(x.to_bits(), shown.to_bits(), "{}", state.name);
    }
}
