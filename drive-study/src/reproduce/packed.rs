//! The closed loop of the two packed FMUs, run by our own importer through the standard interface.

use super::experiment::{ClosedLoop, Experiment, Point, RPM, Record, at, samples_apart};
use fmu_import::{Error, Fmu, Instance};
use std::path::Path;

/// The archives of plant and controller, opened.
pub struct Packed {
    plant: Fmu,
    controller: Fmu,
}

impl Packed {
    /// Opens `PmsmPlant.fmu` and `SensorlessController.fmu` of a folder.
    ///
    /// # Errors
    /// An archive is missing or cannot run here.
    pub fn open(folder: &Path) -> Result<Self, Error> {
        let open = |name: &str| Fmu::open(folder.join(name).with_extension("fmu"));
        Ok(Self { plant: open("PmsmPlant")?, controller: open("SensorlessController")? })
    }
}

/// An instance with its parameters set, ready to step.
fn start(fmu: &Fmu, name: &str, parameters: &[(&str, f64)], stop: f64) -> Result<Instance, Error> {
    let mut instance = fmu.instantiate(name, false)?;
    for (parameter, value) in parameters {
        instance.set_text(parameter, &value.to_string())?;
    }
    instance.setup(0.0, Some(stop))?;
    instance.enter_initialization()?;
    instance.exit_initialization()?;
    Ok(instance)
}

/// Value references of real variables.
fn references<const N: usize>(instance: &Instance, names: [&str; N]) -> Result<[u32; N], Error> {
    let mut references = [0; N];
    for (reference, name) in references.iter_mut().zip(names) {
        *reference = instance.variable(name)?.value_reference;
    }
    Ok(references)
}

impl ClosedLoop for Packed {
    fn run(&self, experiment: &Experiment, h: f64) -> Result<Record, Error> {
        // The last step may end up to half a step away from the duration.
        let stop = experiment.duration + h;
        let mut plant = start(&self.plant, "plant", experiment.plant, stop)?;
        let mut controller = start(&self.controller, "controller", experiment.controller, stop)?;
        let plant_out = references(&plant, ["i_a", "i_b", "i_c", "speed", "theta_e"])?;
        let plant_in = references(&plant, ["u_a", "u_b", "u_c", "tau_load"])?;
        let controller_out = references(&controller, ["u_a", "u_b", "u_c", "speed_est", "theta_est", "i_d", "i_q"])?;
        let controller_in = references(&controller, ["i_a", "i_b", "i_c", "speed_ref"])?;

        let (mut record, mut k, every) = (Record::default(), 0_u32, samples_apart(h));
        let (mut from_plant, mut from_controller) = ([0.0; 5], [0.0; 7]);
        loop {
            let t = f64::from(k) * h;
            plant.get_reals(&plant_out, &mut from_plant)?;
            controller.get_reals(&controller_out, &mut from_controller)?;
            let [i_a, i_b, i_c, speed, theta_e] = from_plant;
            let [u_a, u_b, u_c, speed_est, theta_est, i_d, i_q] = from_controller;
            if k % every == 0 {
                record.push(experiment, t, &Point { speed, theta_e, speed_est, theta_est, i_d, i_q });
            }
            if t >= experiment.duration - 0.5 * h {
                break;
            }
            plant.set_reals(&plant_in, &[u_a, u_b, u_c, at(experiment.load, t)])?;
            controller.set_reals(&controller_in, &[i_a, i_b, i_c, at(experiment.speed_ref, t) * RPM])?;
            let _ = plant.do_step(t, h)?;
            let _ = controller.do_step(t, h)?;
            k += 1;
        }
        plant.terminate()?;
        controller.terminate()?;
        Ok(record)
    }
}
