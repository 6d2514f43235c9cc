//! `PmsmDriveMean` beside `PmsmDrive`: a driving cycle, the lag of the torque, the speed loop, temperatures, both interfaces.
#![allow(missing_docs, non_snake_case)]

#[path = "../plant/tests/lossy/mod.rs"]
mod lossy;
#[path = "../control/tests/machines/mod.rs"]
mod machines;
mod vehicle;

use drive::plant::power::{Energy, Powers};
use drive::plant::tables::PlantParameters;
use drive::plant::thermal::ThermalMode;
use drive::pmsm_drive::{DriveInputs, DriveOutputs};
use drive::steady::{Condition, Steady};
use drive::{PmsmDrive, PmsmDriveMean};
use drive_control::tables::ControllerParameters;
use fmu_core::{Block, Causality, ContinuousTime, Description, Elapsed, Model, Slot, Step};
use machines::RPM;
use std::time::Instant;
use vehicle::{ENERGY, KWH, LOSSES, Vehicle};

/// A drive that takes the same inputs and gives the same outputs.
trait Drive: Model + Send {
    fn new(plant: &PlantParameters, controller: &ControllerParameters) -> Block<Self>;
    fn inputs(&mut self) -> &mut DriveInputs;
    fn outputs(out: &Self::Outputs) -> &DriveOutputs;
}

impl Drive for PmsmDrive {
    fn new(plant: &PlantParameters, controller: &ControllerParameters) -> Block<Self> {
        let mut block = Block::<Self>::default();
        block.model.pair.plant.model.parameters = plant.clone();
        block.model.pair.controller.model.parameters = controller.clone();
        block
    }

    fn inputs(&mut self) -> &mut DriveInputs {
        &mut self.inputs
    }

    fn outputs(out: &DriveOutputs) -> &DriveOutputs {
        out
    }
}

impl Drive for PmsmDriveMean {
    fn new(plant: &PlantParameters, controller: &ControllerParameters) -> Block<Self> {
        let mut block = Block::<Self>::default();
        (block.model.drive.plant, block.model.drive.controller) = (plant.clone(), controller.clone());
        block
    }

    fn inputs(&mut self) -> &mut DriveInputs {
        &mut self.inputs
    }

    fn outputs(out: &Self::Outputs) -> &DriveOutputs {
        &out.drive
    }
}

/// Machine c with all losses, in torque mode on an imposed shaft.
fn traction() -> (PlantParameters, ControllerParameters) {
    let mut controller = machines::c(240.0).parameters();
    controller.speed_loop.torque_mode = true;
    (lossy::c().par, controller)
}

/// Runs a drive for `seconds` in steps of `h` (s); `set` sees the inputs before each with the time, `each` the outputs after.
fn run<D: Drive>(
    block: &mut Block<D>,
    seconds: f64,
    h: f64,
    set: impl Fn(f64, &mut DriveInputs),
    mut each: impl FnMut(f64, &DriveOutputs),
) {
    set(0.0, block.model.inputs());
    block.initialize();
    block.model.validate().unwrap();
    let mut now = Elapsed::ZERO;
    while now.seconds() < seconds - 0.5 * h {
        set(now.seconds(), block.model.inputs());
        let step = Step { start: now, h };
        block.step(&step).unwrap();
        now = step.end();
        each(now.seconds(), D::outputs(&block.out));
    }
}

/// Torque references that give the cycle's torque at the shaft, at the middle of each step of 10 ms, with the speed there.
fn references() -> Vec<[f64; 2]> {
    let (plant, controller) = traction();
    let (drive, vehicle) = (Steady::new(plant, controller).sampled(), Vehicle::new());
    let (mut rows, mut k, h) = (Vec::new(), 0.0, 0.01);
    while k * h < vehicle.end() {
        let [speed, tau] = vehicle.at((k + 0.5) * h);
        let condition = Condition { speed, u_dc: 400.0, temperatures: drive.start_temperatures() };
        rows.push([speed, drive.at(&condition).by_shaft(tau).unwrap().tau_ref]);
        k += 1.0;
    }
    rows
}

fn energy<D: Drive>(h: f64) -> (Energy, [f64; 5]) {
    let (plant, controller) = traction();
    let mut block = D::new(&plant, &controller);
    let rows = references();
    let (mut losses, mut angle) = ([0.0; 5], 0.0);
    let end = Vehicle::new().end();
    let row = |t: f64| rows[((t + 0.1 * h) / 0.01).floor() as usize];
    let mut angles = vec![0.0];
    for k in 0..(end / h).round() as usize {
        angle += row(k as f64 * h)[0] * h;
        angles.push(angle);
    }
    let set = |t: f64, inputs: &mut DriveInputs| {
        inputs.u_dc = 400.0;
        [inputs.speed_shaft, inputs.tau_ref] = row(t);
        inputs.angle_shaft = angles[(t / h).round() as usize];
    };
    let mut last = Energy::default();
    run(&mut block, end, h, set, |_, out| {
        let l = &out.plant.powers.losses;
        for (sum, p) in losses.iter_mut().zip([l.cu, l.iron, l.cond, l.sw, l.friction]) {
            *sum += p * h * KWH;
        }
        last = out.plant.energy;
    });
    (last, losses)
}

#[test]
fn the_energy_of_the_cycle_by_algebra() {
    let (plant, controller) = traction();
    let (drive, vehicle) = (Steady::new(plant, controller), Vehicle::new());
    let (mut got, mut losses) = ([0.0; 3], [0.0; 5]);
    let mut t = 0.5;
    while t < vehicle.end() {
        let [speed, tau] = vehicle.at(t);
        let at = Condition { speed, u_dc: 400.0, temperatures: drive.start_temperatures() };
        let Powers { p_in, losses: l, .. } = drive.at(&at).by_shaft(tau.max(-80.0)).unwrap().powers;
        for (sum, p) in got.iter_mut().zip([p_in, p_in.max(0.0), p_in.min(0.0)]) {
            *sum += p * KWH;
        }
        for (sum, p) in losses.iter_mut().zip([l.cu, l.iron, l.cond, l.sw, l.friction]) {
            *sum += p * KWH;
        }
        t += 1.0;
    }
    println!("{got:.6?} of {ENERGY:?} kWh, {losses:.6?} of {LOSSES:?} kWh");
    for (got, wanted) in got.iter().zip(ENERGY).chain(losses.iter().zip(LOSSES)) {
        assert!((got / wanted - 1.0).abs() < 1e-3, "{got} kWh, not {wanted} kWh");
    }
}

#[test]
fn the_energy_of_the_cycle_is_that_of_the_drive() {
    let (whole, theirs) = energy::<PmsmDrive>(1e-3);
    for h in [1e-3, 1e-2] {
        let (mean, ours) = energy::<PmsmDriveMean>(h);
        let pairs = [(mean.r#in, whole.r#in), (mean.mech, whole.mech), (mean.loss, whole.loss)];
        println!("h = {h}: {:?} kWh; {ours:.5?} of {theirs:.5?} kWh", pairs.map(|(a, b)| (a * KWH, b * KWH)));
        for ((a, b), allowed) in pairs.into_iter().zip([1e-3, 1e-3, 5e-3]) {
            assert!((a / b - 1.0).abs() < allowed, "h = {h}: {a} J, not {b} J");
        }
        for (a, b) in ours.iter().zip(theirs) {
            assert!((a / b - 1.0).abs() < 5e-3, "h = {h}: {a} kWh, not {b} kWh");
        }
    }
}
