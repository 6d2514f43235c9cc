//! The packed FMUs give the results of the Rust types, in both standards, bit for bit.
#![allow(missing_docs)]

mod common;

use common::Native;
use drive_study::reproduce::experiment::{ALL, ClosedLoop, Experiment, RPM, at};
use drive_study::reproduce::packed::Packed;
use fmu_import::{Fmu, Values};

fn compare(experiment: &Experiment, h: f64) {
    let native = Native.run(experiment, h).unwrap();
    for standard in ["fmi2", "fmi3"] {
        let pair = Packed::open(&common::archives().join(standard)).unwrap();
        let packed = pair.run(experiment, h).unwrap();
        for ((name, a), (_, b)) in native.columns().iter().zip(packed.columns()) {
            assert_eq!(a.len(), b.len());
            let apart = a.iter().zip(b).position(|(a, b)| a.to_bits() != b.to_bits());
            assert_eq!(apart, None, "{standard}, {}, h = {h}: {name} differs from this point on", experiment.id);
        }
    }
}

#[test]
fn every_experiment_at_the_sample_period() {
    for experiment in &ALL {
        compare(experiment, 1e-4);
    }
}

#[test]
fn other_communication_steps() {
    for h in [0.5e-4, 1e-4 / 3.0, 0.7e-4, 3e-4] {
        compare(&Experiment { duration: 0.3, ..ALL[0] }, h);
    }
}

/// PmsmDrive at 1 ms is the pair of packed FMUs at T_s.
#[test]
fn the_whole_drive_in_one_fmu() {
    let experiment = Experiment { duration: 0.6, ..ALL[0] };
    let pair = Packed::open(&common::archives().join("fmi3")).unwrap().run(&experiment, 1e-4).unwrap();
    for standard in ["fmi2", "fmi3"] {
        let fmu = Fmu::open(common::archives().join(standard).join("PmsmDrive.fmu")).unwrap();
        let mut drive = fmu.instantiate("drive", false).unwrap();
        drive.set_text("plant.initial.theta_e", &std::f64::consts::PI.to_string()).unwrap();
        drive.setup(0.0, Some(1.0)).unwrap();
        drive.enter_initialization().unwrap();
        drive.exit_initialization().unwrap();
        for k in 0..600_u32 {
            let t = f64::from(k) * 1e-3;
            drive.set("speed_ref", Values::Reals(vec![at(experiment.speed_ref, t) * RPM])).unwrap();
            let _ = drive.do_step(t, 1e-3).unwrap();
        }
        for (name, expected) in [("speed", &pair.speed), ("speed_est", &pair.speed_est)] {
            let got = drive.get(name).unwrap().number().unwrap() / RPM;
            assert_eq!(got.to_bits(), expected.last().unwrap().to_bits(), "{standard}, {name}");
        }
    }
}
