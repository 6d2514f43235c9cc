//! An imposed shaft whose angle jumps turns the rotor under the stator flux linkage: the field does work on the shaft.
#![allow(missing_docs)]

use drive_base::frame::Phases;
use drive_plant::PmsmPlant;
use fmu_core::{Block, Elapsed, Step};

/// Energy in J of the field of the currents, beyond that of the magnets.
fn stored(block: &Block<PmsmPlant>) -> f64 {
    let motor = &block.model.parameters.motor;
    0.75 * (motor.L_d * block.out.i_d.powi(2) + motor.L_q * block.out.i_q.powi(2))
}

#[test]
fn a_jump_of_the_angle_takes_its_work_from_the_field() {
    let mut block = Block::<PmsmPlant>::default();
    block.model.parameters.mechanics.imposed = true;
    (block.model.inputs.enable, block.model.inputs.u) = (true, Phases { a: 40.0, b: -20.0, c: -20.0 });
    block.initialize();
    let mut step = Step { start: Elapsed::ZERO, h: 2e-3 };
    block.step(&step).unwrap();
    for jump in [0.2, -0.3] {
        let (before, energy) = (stored(&block), block.out.energy);
        assert!(before > 0.01, "{before} J");
        block.model.inputs.angle_shaft += jump;
        // So short that only the jump transfers energy.
        step = Step { start: step.end(), h: 1e-9 };
        block.step(&step).unwrap();
        let [mech, elec] = [block.out.energy.mech - energy.mech, block.out.energy.r#in - energy.r#in];
        assert!(mech.abs() > 0.01 && elec.abs() < 1e-5, "{mech} J, {elec} J");
        assert!((mech + stored(&block) - before).abs() < 1e-5, "{mech} J of {before} J, {} J remain", stored(&block));
    }
}
