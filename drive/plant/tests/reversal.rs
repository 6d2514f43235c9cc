//! Reversal with fast acceleration through a narrow zone of Coulomb friction.

use drive_base::frame::{AlphaBeta, Phases};
use drive_plant::PmsmPlant;
use fmu_core::{Block, Elapsed, Step};

/// Speed (rad/s) and current (A) after each 0.3 ms of a machine that reverses under 30 N.m of load, in steps of a `parts`-th.
fn run(tau_coulomb: f64, dead_time: f64, parts: u32) -> Vec<[f64; 3]> {
    let mut block = Block::<PmsmPlant>::default();
    let par = &mut block.model.parameters;
    (par.mechanics.J, par.mechanics.tau_coulomb, par.mechanics.w_coulomb) = (1e-3, tau_coulomb, 0.5);
    (par.initial.speed, par.inverter.dead_time) = (40.0, dead_time);
    block.model.inputs.tau_load = 30.0;
    block.initialize();
    let h = 3e-4 / f64::from(parts);
    let mut now = Elapsed::ZERO;
    let sample = |k: u32| {
        let e = 18.0 - 13.0 * f64::from(k);
        block.model.inputs.u = Phases::from_stator(AlphaBeta::new(3.0, e));
        for _ in 0..parts {
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
        }
        [block.out.speed, block.out.i_d, block.out.i_q]
    };
    (0..10).map(sample).collect()
}

#[test]
fn the_zone_of_coulomb_friction_is_resolved() {
    // At 3e4 rad/s2 the zone takes 33 us, a third of an integration step.
    for (tau_coulomb, dead_time) in [(0.1, 0.0), (1.0, 0.0), (0.0, 0.0), (0.1, 2e-6)] {
        let (coarse, fine) = (run(tau_coulomb, dead_time, 1), run(tau_coulomb, dead_time, 64));
        let error = |k: usize| coarse.iter().zip(&fine).map(|(a, b)| (a[k] - b[k]).abs()).fold(0.0, f64::max);
        let (speed, current) = (error(0), error(1).max(error(2)));
        println!("{tau_coulomb} N.m, dead time {dead_time} s: {speed:e} rad/s, {current:e} A");
        assert!(fine[0][0] > 20.0 && fine[9][0] < -20.0, "reverses: {fine:?}");
        assert!(speed < 1e-4 && current < 1e-4, "{tau_coulomb} N.m: {speed} rad/s, {current} A");
    }
}
