//! The current loop of a small machine, whose L/R is a fifth of the sample period, on a warm and on a cold winding.

use drive::PmsmDrive;
use drive::estimator::Kind;
use drive::motor::Motor;
use fmu_core::log::Warnings;
use fmu_core::{Block, Elapsed, Step, Warns};

/// Mean deviation of the current from its reference, as a share of it, and whether the log names the active resistance.
fn run(active: bool, resistance: f64) -> (f64, bool) {
    let mut block = Block::<PmsmDrive>::default();
    let pair = &mut block.model.pair;
    let motor = Motor { n_p: 1, R_s: 4.6, L_d: 9e-5, L_q: 9e-5, psi_M: 1.2e-3 };
    let (plant, controller) = (&mut pair.plant.model.parameters, &mut pair.controller.model.parameters);
    (plant.motor, controller.motor) = (Motor { R_s: resistance * motor.R_s, ..motor.clone() }, motor);
    (plant.mechanics.J, plant.mechanics.B, plant.mechanics.tau_coulomb) = (1e-9, 1e-7, 0.0);
    (controller.estimator, controller.speed_loop.torque_mode) = (Kind::Sensored, true);
    (controller.current.active_resistance, controller.limit.i, controller.limit.i_q) = (active, 0.8, 0.8);
    (block.model.inputs.u_dc, block.model.inputs.tau_ref) = (12.0, 3e-4);
    block.initialize();
    let (mut now, mut off, mut named) = (Elapsed::ZERO, 0.0, false);
    for k in 0..2000 {
        let step = Step { start: now, h: 1e-4 };
        block.step(&step).unwrap();
        now = step.end();
        let i = &block.out.plant;
        off += if k < 1000 { 0.0 } else { (i.i_q - 3e-4 / 1.8e-3).hypot(i.i_d) / (1e3 * 3e-4 / 1.8e-3) };
        block.model.warn(&mut Warnings::to(&mut |(_, key, text)| {
            named |= key == "current.active_resistance" && text().contains("6 % below that");
        }));
    }
    println!("active resistance: {active}, {resistance} R_s: {off}");
    (off, named)
}

#[test]
fn a_cold_winding_needs_a_loop_that_does_not_subtract_its_resistance() {
    let (cold, named) = run(true, 0.8);
    assert!(cold > 0.1 && named, "{cold}");
    for (active, resistance) in [(true, 1.0), (false, 0.8), (false, 1.0), (false, 1.5)] {
        let (off, named) = run(active, resistance);
        assert!(off < 5e-3 && named == active, "{active}, {resistance}: {off}");
    }
}
