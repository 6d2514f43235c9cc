//! The scenarios: what each step does that another one does not.

use crate::tuned::{RATED, T_S, drive, turning};
use drive::control::commissioning::CommissionMode;
use drive::control::start::StartMode;
use drive::control::tables::ControllerParameters;
use drive::dc_link::DcSource;
use drive::estimator::Kind;
use drive::plant::pwm::InverterMode;
use drive::plant::tables::PlantParameters;
use drive::plant::thermal::ThermalMode;
use drive::plant::thermal::network::Network;
use drive::{Pair, PmsmDrive};
use drive_base::overmodulation::ModulationMode;
use fmu_core::{Block, Elapsed, Model, Step};
use std::time::Instant;

/// A scenario.
pub(super) struct Case {
    pub(super) name: String,
    pub(super) steps: u32,
    /// Runs the step of this number, counted or not, and returns its time in s.
    pub(super) step: Box<dyn FnMut(u32, bool) -> f64>,
}

/// The step that is counted: callgrind finds it by its name.
#[inline(never)]
fn counted_step<M: Model>(block: &mut Block<M>, step: &Step) {
    block.step(step).unwrap();
}

/// Ends the count of a step.
#[inline(never)]
fn step_end() {
    std::hint::black_box(());
}

fn timed<M: Model>(block: &mut Block<M>, step: &Step, counted: bool) -> f64 {
    let start = Instant::now();
    if counted {
        counted_step(block, step);
        step_end();
    } else {
        block.step(step).unwrap();
    }
    start.elapsed().as_secs_f64()
}

/// Counts the controller alone.
fn controller(name: impl Into<String>, steps: u32, mut pair: Pair, act: fn(u32, &mut Pair)) -> Case {
    pair.start().unwrap();
    let step = move |k: u32, counted: bool| {
        act(k, &mut pair);
        let Pair { plant, controller, now } = &mut pair;
        plant.model.inputs.apply(controller.out.commanded());
        controller.model.inputs.measure(plant.out.measured());
        let (speed, step) = (plant.model.parameters.initial.speed, Step { start: *now, h: T_S });
        (plant.model.inputs.speed_shaft, plant.model.inputs.angle_shaft) = (speed, speed * now.seconds());
        plant.step(&step).unwrap();
        *now = step.end();
        timed(controller, &step, counted)
    };
    Case { name: name.into(), steps, step: Box::new(step) }
}

/// Counts a whole drive in steps of a sample.
fn whole(name: &str, set: fn(&mut PmsmDrive), act: fn(u32, &mut PmsmDrive)) -> Case {
    let mut block = Block::<PmsmDrive>::default();
    block.model.pair = turning(drive(Kind::Rasmussen), 0.2 * RATED);
    let inputs = &mut block.model.inputs;
    (inputs.speed_ref, inputs.u_dc) = (0.2 * RATED, 540.0);
    set(&mut block.model);
    block.model.validate().unwrap();
    block.initialize();
    let mut now = Elapsed::ZERO;
    let step = move |k: u32, counted: bool| {
        act(k, &mut block.model);
        let step = Step { start: now, h: T_S };
        now = step.end();
        timed(&mut block, &step, counted)
    };
    Case { name: format!("PmsmDrive: {name}"), steps: 2000, step: Box::new(step) }
}

/// Load, reversal, a new parameter, a new start of the turning machine, and a load that no drive holds.
fn life(k: u32, pair: &mut Pair) {
    let (inputs, par) = (&mut pair.controller.model.inputs, &mut pair.controller.model.parameters);
    match k {
        300 => pair.plant.model.inputs.tau_load = 7.0,
        600 => inputs.speed_ref = -0.2 * RATED,
        1000 => {
            par.estimators.tracker.bandwidth *= 1.1;
            pair.controller.model.derive();
        }
        1400 => inputs.enable = false,
        1420 => inputs.enable = true,
        1700 => pair.plant.model.inputs.tau_load = 100.0,
        _ => {}
    }
}

/// The controller of a machine that turns at `speed` (rad/s), set by `set`.
fn with(kind: Kind, speed: f64, set: fn(&mut ControllerParameters, &mut PlantParameters)) -> Pair {
    let mut pair = turning(drive(kind), speed);
    set(&mut pair.controller.model.parameters, &mut pair.plant.model.parameters);
    pair
}

/// Full torque at 1.6 times the rated speed.
fn weakened(mode: ModulationMode) -> Pair {
    let mut pair = with(Kind::Rasmussen, 1.6 * RATED, |par, plant| {
        (par.speed_loop.torque_mode, par.weakening.used, plant.mechanics.imposed) = (true, true, true);
        (par.dc.used, par.dc.max) = (true, 8.0);
    });
    pair.controller.model.parameters.modulation.mode = mode;
    pair
}

/// Full torque back and forth.
fn torque(k: u32, pair: &mut Pair) {
    pair.controller.model.inputs.tau_ref = if (k / 500).is_multiple_of(2) { 24.0 } else { -24.0 };
}

fn commissioned() -> Pair {
    let mut pair = with(Kind::Rasmussen, 0.0, |par, plant| {
        (par.s_2, par.commission.i, par.commission.speed, plant.initial.theta_e) = (40.0, 15.0, 157.0, 0.5);
        (plant.inverter.dead_time, plant.inverter.i_zero) = (1e-6, 0.1);
    });
    pair.controller.model.parameters.commission.mode = CommissionMode::Spin;
    pair.controller.model.inputs.commission_start = true;
    pair
}

fn devices(drive: &mut PmsmDrive) {
    let inverter = &mut drive.pair.plant.model.parameters.inverter;
    inverter.dead_time = 2e-6;
    let devices = &mut inverter.devices;
    (devices.u_transistor, devices.r_transistor, devices.u_diode, devices.r_diode) = (0.8, 0.02, 0.9, 0.02);
    devices.E_sw = 1e-3;
}

fn switched(drive: &mut PmsmDrive) {
    drive.pair.plant.model.parameters.inverter.pwm.mode = InverterMode::Switched;
}

fn load(k: u32, drive: &mut PmsmDrive) {
    drive.inputs.tau_load = if k < 1000 { 0.0 } else { 7.0 };
}

pub(super) fn cases() -> Vec<Case> {
    let each = |&kind: &Kind| controller(kind.name(), 2000, turning(drive(kind), 0.2 * RATED), life);
    let mut cases: Vec<Case> = Kind::ALL.iter().map(each).collect();
    cases.push(controller(
        "Rasmussen with adaptation and noise and observed dead time",
        2000,
        with(Kind::Rasmussen, 0.2 * RATED, |par, _| {
            (par.estimators.adaptation.resistance, par.compensation.observe) = (true, true);
            (par.sensor.noise, par.sensor.resolution, par.current.mtpa) = (0.01, 0.01, true);
        }),
        life,
    ));
    cases.push(controller(
        "I-f start and handover",
        4000,
        with(Kind::ExtendedEmf, 0.0, |par, _| {
            (par.start.mode, par.start.t_align, par.start.acceleration, par.start.settle) =
                (StartMode::CurrentFrequency, 0.05, 200.0, 0.05);
        }),
        |k, pair| pair.controller.model.inputs.speed_ref = if k < 10 { 0.0 } else { 0.4 * RATED },
    ));
    cases.push(controller(
        "injection start",
        4000,
        with(Kind::SquareWaveInjection, 0.0, |par, plant| {
            (par.start.mode, par.s_2) = (StartMode::Injection, 40.0);
            (plant.saturation.s_2, plant.saturation.s_3, plant.initial.theta_e) = (40.0, 40.0, 2.5);
        }),
        |_, _| (),
    ));
    cases.push(controller(
        "flying start",
        2000,
        with(Kind::Rasmussen, 0.2 * RATED, |par, _| {
            (par.start.catch, par.speed_est) = (true, 0.0);
        }),
        |_, _| (),
    ));
    cases.push(controller(
        "trip and active short circuit",
        2000,
        with(Kind::Rasmussen, 1.6 * RATED, |par, plant| {
            (par.trip.used, par.trip.asc, par.trip.i, par.trip.u_dc) = (true, true, 60.0, 580.0);
            (par.weakening.used, plant.mechanics.imposed) = (true, true);
        }),
        |k, pair| pair.set_inputs(1.6 * RATED, 0.0, if k < 1000 { 540.0 } else { 600.0 }),
    ));
    cases.push(controller(
        "Sensored with fallback",
        2000,
        with(Kind::Sensored, 0.2 * RATED, |par, _| {
            (par.fallback, par.resume) = (Kind::RotatingInjection, true);
        }),
        |k, pair| pair.controller.model.inputs.sensor_valid = !(1000..1500).contains(&k),
    ));
    cases.push(controller("field weakening: Linear", 2000, weakened(ModulationMode::Linear), torque));
    cases.push(controller("field weakening: MinimumPhase", 2000, weakened(ModulationMode::MinimumPhase), torque));
    cases.push(controller("field weakening: SixStep", 2000, weakened(ModulationMode::SixStep), torque));
    cases.push(controller("self-commissioning", 300_000, commissioned(), |_, _| ()));
    cases.extend(drives());
    cases
}

fn drives() -> [Case; 7] {
    [
        whole("average inverter", |_| (), load),
        whole(
            "saturation",
            |d| {
                let s = &mut d.pair.plant.model.parameters.saturation;
                (s.s_2, s.s_3) = (40.0, 40.0);
            },
            load,
        ),
        whole("dead time and device losses", devices, load),
        whole(
            "DC link and chopper",
            |d| {
                let link = &mut d.link_parameters;
                (link.dc_link.source, link.dc_link.f_mains, link.dc_link.C) = (DcSource::RectifierThree, 50.0, 5e-4);
                (link.dc_link.used, link.chopper.used, link.chopper.u_on, link.chopper.u_off) =
                    (true, true, 600.0, 580.0);
            },
            |k, d| d.inputs.speed_ref = if k < 1000 { 0.8 * RATED } else { 0.0 },
        ),
        whole(
            "thermal network and derating",
            |d| {
                devices(d);
                let thermal = &mut d.pair.plant.model.parameters.thermal;
                (thermal.mode, thermal.alpha_R, thermal.alpha_psi) = (ThermalMode::Network, 3.93e-3, -1.1e-3);
                let [C_winding, C_stator, C_rotor, C_inverter] = [500.0, 3000.0, 1000.0, 200.0];
                let [G_ws, G_sc, G_sr, G_inverter] = [20.0, 12.0, 3.0, 20.0];
                thermal.network = Network { C_winding, C_stator, C_rotor, C_inverter, G_ws, G_sc, G_sr, G_inverter };
                (d.derating.used, d.derating.T_winding, d.derating.T_winding_max) = (true, 283.15, 323.15);
            },
            load,
        ),
        whole("Switched", switched, load),
        whole(
            "Switched with dead time and device losses",
            |d| {
                devices(d);
                switched(d);
            },
            load,
        ),
    ]
}
