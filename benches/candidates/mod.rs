//! What is measured of the drive: a name, and a function that runs a fixed number of periods.

use drive::Pair;
use drive_study::reproduce::experiment::RPM;
use fmu_import::{Fmu, Instance};
use std::path::Path;

const T_S: f64 = 1e-4;

/// Periods in one turn of a candidate: about 5 ms.
pub(crate) const PERIODS: u32 = 10_000;

/// Speed reference in rad/s and load torque in N.m of an operating point.
#[derive(Clone, Copy)]
pub(crate) struct Point {
    pub(crate) name: &'static str,
    pub(crate) speed: f64,
    pub(crate) load: f64,
}

pub(crate) const POINTS: [Point; 2] =
    [Point { name: "1000 rpm", speed: 1000.0 * RPM, load: 1.0 }, Point { name: "3 rpm", speed: 3.0 * RPM, load: 0.1 }];

/// A name and the function that runs [`PERIODS`] periods.
pub(crate) struct Candidate {
    pub(crate) name: String,
    pub(crate) turn: Box<dyn FnMut()>,
    /// Time of a period in ns, one value for each turn.
    pub(crate) times: Vec<f64>,
}

impl Candidate {
    pub(crate) fn new(name: impl Into<String>, turn: impl FnMut() + 'static) -> Self {
        Self { name: name.into(), turn: Box::new(turn), times: Vec::new() }
    }

    pub(crate) fn median(&mut self) -> f64 {
        self.times.sort_by(f64::total_cmp);
        self.times[self.times.len() / 2]
    }
}

pub(crate) fn native(point: Point) -> Candidate {
    let mut pair = Pair::default();
    pair.start().unwrap();
    pair.set_inputs(point.speed, point.load, 325.0);
    Candidate::new("native", move || {
        for _ in 0..PERIODS {
            pair.step(T_S).unwrap();
        }
    })
}

pub(crate) fn start(folder: &Path, name: &str, settings: &[(&str, &str)]) -> Instance {
    let mut instance = Fmu::open(folder.join(name).with_extension("fmu")).unwrap().instantiate(name, false).unwrap();
    instance.setup(0.0, None).unwrap();
    for &(name, value) in settings {
        instance.set_text(name, value).unwrap();
    }
    instance.enter_initialization().unwrap();
    instance.exit_initialization().unwrap();
    instance
}

pub(crate) fn references<const N: usize>(instance: &Instance, names: [&str; N]) -> [u32; N] {
    names.map(|name| instance.variable(name).unwrap().value_reference)
}

pub(crate) fn through_c(point: Point, folder: &Path, name: String) -> Candidate {
    let (mut plant, mut controller) = (start(folder, "PmsmPlant", &[]), start(folder, "SensorlessController", &[]));
    let (i, u) = (["i_a", "i_b", "i_c"], ["u_a", "u_b", "u_c"]);
    let (plant_i, plant_u) = (references(&plant, i), references(&plant, u));
    let (controller_i, controller_u) = (references(&controller, i), references(&controller, u));
    controller.set_reals(&references(&controller, ["speed_ref"]), &[point.speed]).unwrap();
    plant.set_reals(&references(&plant, ["tau_load"]), &[point.load]).unwrap();
    let (mut current, mut voltage, mut k) = ([0.0; 3], [0.0; 3], 0_u32);
    Candidate::new(name, move || {
        for _ in 0..PERIODS {
            plant.get_reals(&plant_i, &mut current).unwrap();
            controller.get_reals(&controller_u, &mut voltage).unwrap();
            plant.set_reals(&plant_u, &voltage).unwrap();
            controller.set_reals(&controller_i, &current).unwrap();
            let t = f64::from(k) * T_S;
            let _ = plant.do_step(t, T_S).unwrap();
            let _ = controller.do_step(t, T_S).unwrap();
            k += 1;
        }
    })
}

/// PmsmDrive in steps of 1 ms with these settings.
pub(crate) fn whole_drive(point: Point, folder: &Path, name: String, settings: &[(&str, &str)]) -> Candidate {
    let mut drive = start(folder, "PmsmDrive", settings);
    drive.set_reals(&references(&drive, ["speed_ref", "tau_load"]), &[point.speed, point.load]).unwrap();
    let mut k = 0_u32;
    Candidate::new(name, move || {
        for _ in 0..PERIODS / 10 {
            let _ = drive.do_step(f64::from(k) * 1e-3, 1e-3).unwrap();
            k += 1;
        }
    })
}
