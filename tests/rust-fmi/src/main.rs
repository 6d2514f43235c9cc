//! Runs start-up and load step of the pair with rust-fmi's crate `fmi` (Jacobi exchange), and compares them with the native run.
//!
//! Arguments: the folder with PmsmPlant.fmu and SensorlessController.fmu for FMI 2.0, and the file of references.

use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation, Common, InstanceCS};
use fmi::traits::{FmiImport, FmiInstance};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

/// Communication step in s.
const T_S: f64 = 1e-4;

#[derive(Deserialize)]
struct Experiment {
    name: String,
    theta_e: f64,
    speed_ref: Vec<(f64, f64)>,
    load: Vec<(f64, f64)>,
    every: usize,
    steps: usize,
    jacobi: Trace,
}

#[derive(Deserialize)]
struct Trace {
    speed: Vec<f64>,
    theta_est: Vec<f64>,
}

/// An FMU with its value references by name.
struct Unit {
    // Before `import`, whose folder contains the library: fields are dropped in this order.
    instance: InstanceCS,
    references: BTreeMap<String, u32>,
    _import: Fmi2Import,
}

impl Unit {
    fn load(folder: &str, name: &str, instance: &str) -> Result<Self, Box<dyn Error>> {
        let import: Fmi2Import = fmi::import::from_path(Path::new(folder).join(format!("{name}.fmu")))?;
        let variables = &import.model_description().model_variables.variables;
        let references = variables.iter().map(|v| (v.name.clone(), v.value_reference)).collect();
        let instance = import.instantiate_cs(instance, false, false)?;
        Ok(Self { instance, references, _import: import })
    }

    fn of(&self, names: &[&str]) -> Vec<u32> {
        names.iter().map(|name| self.references[*name]).collect()
    }

    fn initialize(&mut self) -> Result<(), Box<dyn Error>> {
        FmiInstance::enter_initialization_mode(&mut self.instance, None, 0.0, None)?;
        FmiInstance::exit_initialization_mode(&mut self.instance)?;
        Ok(())
    }
}

fn at(schedule: &[(f64, f64)], t: f64) -> f64 {
    schedule.iter().rev().find(|(from, _)| t >= from - 1e-9).map_or(0.0, |(_, value)| *value)
}

fn run(folder: &str, experiment: &Experiment) -> Result<usize, Box<dyn Error>> {
    let mut plant = Unit::load(folder, "PmsmPlant", "plant")?;
    let mut controller = Unit::load(folder, "SensorlessController", "controller")?;
    plant.instance.set_real(&plant.of(&["initial.theta_e"]), &[experiment.theta_e])?;
    plant.initialize()?;
    controller.initialize()?;
    let (from_plant, to_plant) = (plant.of(&["i_a", "i_b", "i_c", "speed"]), plant.of(&["u_a", "u_b", "u_c", "tau_load"]));
    let from_controller = controller.of(&["u_a", "u_b", "u_c", "theta_est"]);
    let to_controller = controller.of(&["i_a", "i_b", "i_c", "speed_ref"]);
    let (mut out, mut command, mut compared) = ([0.0; 4], [0.0; 4], 0);
    for k in 0..experiment.steps {
        let t = k as f64 * T_S;
        plant.instance.get_real(&from_plant, &mut out)?;
        controller.instance.get_real(&from_controller, &mut command)?;
        if k % experiment.every == 0 {
            let native = [experiment.jacobi.speed[compared], experiment.jacobi.theta_est[compared]];
            if [out[3], command[3]].map(f64::to_bits) != native.map(f64::to_bits) {
                return Err(format!("{} at {t} s: {} rad/s, {} rad; native {native:?}", experiment.name, out[3], command[3]).into());
            }
            compared += 1;
        }
        (out[3], command[3]) = (at(&experiment.speed_ref, t), at(&experiment.load, t));
        plant.instance.set_real(&to_plant, &command)?;
        controller.instance.set_real(&to_controller, &out)?;
        plant.instance.do_step(t, T_S, true)?;
        controller.instance.do_step(t, T_S, true)?;
    }
    Ok(compared)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, references] = arguments.as_slice() else { return Err("arguments: FOLDER REFERENCES.json".into()) };
    for experiment in serde_json::from_str::<Vec<Experiment>>(&std::fs::read_to_string(references)?)? {
        let compared = run(folder, &experiment)?;
        println!("{}: {compared} points equal to the native run, bit for bit", experiment.name);
    }
    Ok(())
}
