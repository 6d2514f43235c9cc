//! What dead time and losses cost: the time of `PmsmDrive` with them, divided by its time without, natively.
//!
//! The reference machine at light load, from standstill to 300 rad/s, in steps of 1 ms; a traction machine without torque in
//! steps of 10 ms. Both drives of a pair run alternately; the figures are the minimum over many runs, free of other load.
#![allow(missing_docs, non_snake_case)]

#[path = "../plant/tests/lossy/mod.rs"]
mod lossy;
#[path = "../control/tests/machines/mod.rs"]
mod machines;

use drive::PmsmDrive;
use drive::estimator::Kind;
use drive_control::tables::ControllerParameters;
use drive_plant::tables::PlantParameters;
use fmu_core::{Block, Elapsed, Step};
use std::time::Instant;

const DEAD_TIME: f64 = 2e-6;
/// Mechanical speeds in rad/s.
const SPEEDS: [f64; 5] = [0.0, 10.0, 30.0, 100.0, 300.0];
/// Load torques in N.m.
const LOADS: [f64; 6] = [0.0, 0.1, 0.2, 0.5, 1.0, 2.5];
const TURNS: usize = 40;

/// Both sets of parameters, and the DC-link voltage in V.
#[derive(Clone)]
struct Drive {
    plant: PlantParameters,
    controller: ControllerParameters,
    u_dc: f64,
}

impl Drive {
    /// With dead time, which the controller compensates, at currents above `i_zero` (A).
    fn with_dead_time(mut self, i_zero: f64) -> Self {
        (self.plant.inverter.dead_time, self.plant.inverter.i_zero) = (DEAD_TIME, i_zero);
        let compensation = &mut self.controller.compensation;
        (compensation.u_dead, compensation.i_zero) = (self.plant.inverter.u_dead(self.u_dc), i_zero);
        self
    }

    /// With the losses of iron and devices of another plant.
    fn with_losses(mut self, of: &PlantParameters) -> Self {
        self.plant.iron = of.iron.clone();
        self.plant.inverter.devices = of.inverter.devices.clone();
        self
    }

    /// A function that makes `count` steps of `h` (s) and returns the time of one in ns: at the mechanical speed `speed` (rad/s)
    /// with the torque `tau` (N.m).
    fn run(self, h: f64, count: u32, speed: f64, tau: f64) -> impl FnMut() -> f64 {
        let mut block = Block::<PmsmDrive>::default();
        block.model.pair.plant.model.parameters = self.plant;
        block.model.pair.controller.model.parameters = self.controller;
        let inputs = &mut block.model.inputs;
        (inputs.speed_ref, inputs.speed_shaft, inputs.u_dc) = (speed, speed, self.u_dc);
        (inputs.tau_load, inputs.tau_ref) = (tau, tau);
        block.initialize();
        let mut now = Elapsed::ZERO;
        let mut advance = move |count: u32| {
            for _ in 0..count {
                block.model.inputs.angle_shaft = speed * now.seconds();
                let step = Step { start: now, h };
                block.step(&step).unwrap();
                now = step.end();
            }
        };
        // The drive has started.
        advance(10 * count);
        move || {
            let start = Instant::now();
            advance(count);
            1e9 * start.elapsed().as_secs_f64() / f64::from(count)
        }
    }
}

/// The times of these drives in ns, the minimum of each.
fn least<const N: usize>(mut runs: [Box<dyn FnMut() -> f64>; N]) -> [f64; N] {
    let mut least = [f64::INFINITY; N];
    for _ in 0..TURNS {
        for (run, least) in runs.iter_mut().zip(&mut least) {
            *least = least.min(run());
        }
    }
    least
}

fn main() {
    let reference =
        Drive { plant: PlantParameters::default(), controller: ControllerParameters::default(), u_dc: 325.0 };
    let losses = lossy::b().par;
    let with = [
        ("dead time", reference.clone().with_dead_time(0.1)),
        ("dead time and losses", reference.clone().with_dead_time(0.1).with_losses(&losses)),
    ];
    for (name, drive) in with {
        println!("{name}, 1 ms\n  rad/s{}", LOADS.map(|tau| format!("{tau:>6} N.m")).concat());
        let mut all = Vec::new();
        for speed in SPEEDS {
            let ratio = |tau| {
                let run =
                    |drive: &Drive| -> Box<dyn FnMut() -> f64> { Box::new(drive.clone().run(1e-3, 100, speed, tau)) };
                let [without, with] = least([run(&reference), run(&drive)]);
                with / without
            };
            let ratios = LOADS.map(ratio);
            println!("{speed:>7}{}", ratios.map(|ratio| format!("{ratio:>10.2}")).concat());
            all.extend(ratios);
        }
        let count = f64::from(u32::try_from(all.len()).unwrap_or(u32::MAX));
        let most = all.iter().copied().fold(0.0, f64::max);
        println!("  mean {:.2}, maximum {most:.2}\n", all.iter().sum::<f64>() / count);
    }

    let lossy::Drive { mut par, u_dc } = lossy::c();
    let losses = par.clone();
    (par.iron, par.inverter) = <_>::default();
    let mut controller = machines::c(240.0).parameters();
    (controller.estimator, controller.speed_loop.torque_mode) = (Kind::Sensored, true);
    let traction = Drive { plant: par, controller, u_dc };
    println!("traction machine without torque, dead time and losses, 10 ms\n  rad/s  i_zero 0.1 A     4.8 A");
    for speed in [3.0, 30.0, 100.0, 300.0, 628.0] {
        let run = |drive: Drive| -> Box<dyn FnMut() -> f64> { Box::new(drive.run(1e-2, 10, speed, 0.0)) };
        let lossy = |i_zero| run(traction.clone().with_dead_time(i_zero).with_losses(&losses));
        let [without, narrow, wide] = least([run(traction.clone()), lossy(0.1), lossy(4.8)]);
        println!("{speed:>7}{:>14.2}{:>10.2}", narrow / without, wide / without);
    }
}
