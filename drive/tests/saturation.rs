//! Flux linkages beyond the saturation polynomial or the flux map: every model warns or returns an error.

use drive::plant::flux_map;
use drive::plant::tables::PlantParameters;
use drive::{PmsmDrive, PmsmDriveMean};
use fmu_core::log::Warnings;
use fmu_core::{Block, Elapsed, Model, Step, Warns};

/// Speed in rad/s at which the short-circuit current almost cancels the flux linkage of the magnet.
const FAST: f64 = 300.0;

/// The messages about flux of a model that is short-circuited at this speed: its warnings, and the error that ends the run.
fn reports<M: Model + Warns>(block: &mut Block<M>, h: f64, shaft: fn(&mut M) -> [&mut f64; 2]) -> Vec<String> {
    *shaft(&mut block.model)[0] = FAST;
    block.initialize();
    let (mut now, mut said) = (Elapsed::ZERO, Vec::new());
    while now.seconds() < 0.1 {
        *shaft(&mut block.model)[1] = FAST * now.seconds();
        let step = Step { start: now, h };
        if let Err(fault) = block.step(&step) {
            said.push(fault.to_string());
            break;
        }
        now = step.end();
    }
    block.model.warn(&mut Warnings::to(&mut |(_, key, text)| said.push(format!("{key}: {}", text()))));
    said.retain(|text| text.contains("flux"));
    said
}

fn drive(set: impl Fn(&mut PlantParameters)) -> Vec<String> {
    let mut drive = Block::<PmsmDrive>::default();
    let plant = &mut drive.model.pair.plant.model.parameters;
    plant.mechanics.imposed = true;
    set(plant);
    drive.model.inputs.asc = true;
    reports(&mut drive, 1e-4, |model| [&mut model.inputs.speed_shaft, &mut model.inputs.angle_shaft])
}

fn mean(set: impl Fn(&mut PlantParameters)) -> Vec<String> {
    let mut mean = Block::<PmsmDriveMean>::default();
    let plant = &mut mean.model.drive.plant;
    plant.mechanics.imposed = true;
    set(plant);
    mean.model.inputs.asc = true;
    reports(&mut mean, 1e-2, |model| [&mut model.inputs.speed_shaft, &mut model.inputs.angle_shaft])
}

#[test]
fn a_short_circuit_beyond_the_saturation_warns() {
    for s_2 in [-400.0, 0.0, 40.0] {
        let set = |plant: &mut PlantParameters| plant.saturation.s_2 = s_2;
        assert_eq!((drive(set), mean(set)), (vec![], vec![]), "{s_2}");
    }
    // From x = -1 / (2 L_d s_2) on, more flux needs less current.
    let beyond = |plant: &mut PlantParameters| plant.saturation.s_2 = 600.0;
    let said = [drive(beyond), mean(beyond)];
    assert!(said[0].len() == 1 && said[0][0].contains("describes no machine"), "{said:?}");
    assert!(said[1].iter().any(|text| text.contains("no flux linkage gives the current at this speed")), "{said:?}");
}

#[test]
fn a_short_circuit_beyond_the_flux_map_warns() {
    let map = |d_min| {
        move |plant: &mut PlantParameters| {
            plant.flux_map = flux_map::linear(&plant.motor, [d_min, 0.1], 0.3);
            plant.flux_map.used = true;
        }
    };
    assert_eq!((drive(map(-0.3)), mean(map(-0.3))), (vec![], vec![]));
    for said in [drive(map(-0.1)), mean(map(-0.1))] {
        assert!(said.len() == 1 && said[0].contains("is beyond the flux map"), "{said:?}");
    }
}
