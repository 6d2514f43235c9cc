//! Flux maps in the plant: for a linear machine and one that saturates, in both interfaces, over temperature.
#![expect(clippy::cast_precision_loss, reason = "a few intervals")]

use drive_base::frame::{Dq, Phases};
use drive_base::motor::Motor;
use drive_plant::PmsmPlant;
use drive_plant::flux_map::{FluxMap, linear};
use drive_plant::machine::{self, Magnetics};
use drive_plant::tables::PlantParameters;
use fmu_core::log::Warnings;
use fmu_core::{Block, ContinuousTime, Elapsed, Step, Warns, integrate};

/// The plant after `set` and 40 steps of 0.1 ms under a rotating voltage, in Co-Simulation or Model Exchange.
fn run(exchange: bool, set: impl Fn(&mut PlantParameters)) -> Block<PmsmPlant> {
    let mut block = Block::<PmsmPlant>::default();
    set(&mut block.model.parameters);
    block.initialize();
    let mut now = Elapsed::ZERO;
    for k in 0..40_u32 {
        let angle = 0.02 * f64::from(k);
        block.model.inputs.u =
            Phases { a: 30.0 * angle.cos(), b: 30.0 * (angle - 2.1).cos(), c: 30.0 * (angle + 2.1).cos() };
        let step = Step { start: now, h: 1e-4 };
        if exchange {
            integrate::hybrid::<PmsmPlant, 4>(&mut block.model, &step, 2e-6).unwrap();
            block.model.observe(step.end(), &mut block.out);
        } else {
            block.step(&step).unwrap();
        }
        now = step.end();
    }
    block
}

fn apart(a: &Block<PmsmPlant>, b: &Block<PmsmPlant>) -> f64 {
    let of = |block: &Block<PmsmPlant>| [block.out.i_d, block.out.i_q, block.out.tau_e, block.out.speed];
    of(a).iter().zip(of(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A map with the inductances of the default machine in the middle and lower ones outward.
fn saturating() -> FluxMap {
    let mut map = linear(&Motor::default(), [-0.2, 0.1], 0.12);
    for (m, row) in map.w.iter_mut().enumerate() {
        for (n, w) in row.iter_mut().enumerate() {
            let (x, q) = (-0.2 + (m as f64 - 1.0) / 30.0, n as f64 * 0.12 / 7.0);
            *w += 4e4 * (x.powi(4) + q.powi(4) + 2.0 * x * x * q * q);
        }
    }
    // The current is zero at the magnet's flux linkage.
    let rest = map.current(Dq::ZERO).d();
    map.w.iter_mut().enumerate().for_each(|(m, row)| row.iter_mut().for_each(|w| *w -= rest * (m as f64 - 7.0) / 30.0));
    map
}

#[test]
fn the_map_of_a_linear_machine_is_that_machine() {
    // The flux linkage leaves the grid, and the inductances continue outside.
    for exchange in [false, true] {
        let map = run(exchange, |par| par.flux_map = linear(&par.motor, [-0.02, 0.01], 0.01));
        let machine = run(exchange, |_| ());
        assert!(machine.out.i_q.abs() > 2.0 && apart(&map, &machine) < 1e-10, "{}", apart(&map, &machine));
    }
}

#[test]
fn both_interfaces_have_the_map() {
    let set = |par: &mut PlantParameters| par.flux_map = saturating();
    let (stepped, exchanged) = (run(false, set), run(true, set));
    assert!(apart(&stepped, &exchanged) < 2e-5, "{}", apart(&stepped, &exchanged));
    assert!(apart(&stepped, &run(false, |_| ())) > 0.1, "the map saturates");
    // Every parameter of the map has an effect.
    for set in [
        (|par| par.flux_map.d_min -= 0.05) as fn(&mut PlantParameters),
        |par| par.flux_map.d_max += 0.05,
        |par| par.flux_map.q_max += 0.05,
        |par| par.flux_map.w.iter_mut().flatten().for_each(|w| *w *= 1.1),
    ] {
        let moved = run(false, |par| {
            par.flux_map = saturating();
            set(par);
        });
        assert!(apart(&stepped, &moved) > 1e-3);
    }
}

#[test]
fn the_energy_balance_closes() {
    let block = run(false, |par| {
        par.flux_map = saturating();
        (par.mechanics.imposed, par.initial.speed) = (false, 50.0);
    });
    let (model, energy) = (&block.model, block.out.energy);
    let [d, q, speed] = [0, 1, 2].map(|k: usize| {
        let mut model = model.clone();
        *PmsmPlant::STATES[k].at(&mut model)
    });
    let par = &model.parameters;
    let magnetic = machine::magnetic_energy(&par.motor, Magnetics::Map(&par.flux_map), Dq::new(d, q));
    let stored = magnetic + 0.5 * par.mechanics.J * (speed * speed - 2500.0);
    let rest = energy.r#in - energy.mech - energy.loss - stored;
    assert!(magnetic > 0.01 && rest.abs() < 1e-6 * energy.r#in.abs(), "{rest} J of {energy:?}");
}

#[test]
fn a_warm_magnet_moves_the_map() {
    let hot = |par: &mut PlantParameters| {
        par.flux_map = saturating();
        (par.thermal.alpha_psi, par.thermal.T_start) = (-1.1e-3, 393.15);
    };
    let mut block = Block::<PmsmPlant>::default();
    hot(&mut block.model.parameters);
    block.initialize();
    assert!(block.out.i_d == 0.0 && block.out.i_q == 0.0, "no current without flux: {} A", block.out.i_d);
    assert!(apart(&run(false, hot), &run(false, |par| par.flux_map = saturating())) > 0.1);
}

#[test]
fn a_state_beyond_the_map_is_told() {
    let warned = |map: FluxMap| {
        let block = run(false, |par| par.flux_map = map.clone());
        let mut said = Vec::new();
        block.model.warn(&mut Warnings::to(&mut |(_, key, text)| said.push(format!("{key}: {}", text()))));
        said
    };
    assert!(warned(saturating()).is_empty());
    let said = warned(linear(&Motor::default(), [-0.02, 0.01], 0.01));
    assert!(said.len() == 1 && said[0].contains("is beyond the flux map"), "{said:?}");
}
