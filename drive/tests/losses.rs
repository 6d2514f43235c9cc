//! The power balance with all losses on, at random instants and over 20 ms; Model Exchange against Co-Simulation; dependencies
//! of the currents.

use drive::frame::{AlphaBeta, Phases};
use drive::motor::Motor;
use drive::plant::machine;
use drive::plant::tables::PlantParameters;
use drive::plant::thermal::{Temperatures, ThermalMode};
use drive::{PmsmDrive, PmsmPlant};
use fmu_core::draw::Draw;
use fmu_core::{Block, Capabilities, ContinuousTime, Description, Elapsed, Events, Exported, Step, integrate};
use std::f64::consts::PI;

/// Sets every loss, for a machine of 2.2 kW.
fn lossy(par: &mut PlantParameters) {
    par.motor = Motor::IPMSM_2_2_KW;
    (par.iron.G_e, par.iron.G_h, par.winding.k_ac) = (2.7e-4, 0.127, 1e-7);
    (par.mechanics.J, par.mechanics.k_w) = (15e-3, 1e-6);
    let devices = &mut par.inverter.devices;
    (devices.u_transistor, devices.r_transistor, devices.u_diode, devices.r_diode) = (0.9, 0.06, 0.7, 0.05);
    (devices.E_sw, devices.i_sw, devices.u_sw) = (2.5e-3, 15.0, 600.0);
    (par.inverter.dead_time, par.inverter.i_zero) = (2e-6, 0.1);
}

/// The same, with a warm machine.
fn warm(par: &mut PlantParameters) {
    (par.thermal.alpha_R, par.thermal.alpha_psi, par.thermal.T_start) = (3.93e-3, -1.1e-3, 393.15);
}

/// The machine at its temperature.
fn machine_of(par: &PlantParameters) -> Motor {
    par.thermal.motor(&par.motor, &Temperatures::all(par.thermal.T_start))
}

#[test]
fn the_powers_are_balanced_at_every_instant() {
    let (mut draw, mut worst, mut conducting) = (Draw(7), 0.0_f64, 0);
    for point in 0..300_u32 {
        let mut block = Block::<PmsmPlant>::default();
        let par = &mut block.model.parameters;
        lossy(par);
        if point % 2 == 1 {
            (par.saturation.s_2, par.saturation.s_3, par.saturation.s_dq) = (40.0, 40.0, 7.0);
        }
        if point % 5 > 2 {
            warm(par);
        }
        let inputs = &mut block.model.inputs;
        (inputs.u_dc, inputs.enable) = (540.0, point % 3 != 0);
        inputs.u = Phases { a: draw.around(300.0), b: draw.around(300.0), c: draw.around(300.0) };
        inputs.tau_load = draw.around(10.0);
        block.initialize();
        let values = [0.545 + draw.around(0.4), draw.around(0.4), draw.around(300.0), draw.around(1.0)];
        for (state, value) in PmsmPlant::STATES.iter().zip(values) {
            *state.at(&mut block.model) = value;
        }
        block.model.settle();
        block.model.event(Elapsed::ZERO).unwrap();
        let values = [0, 1, 2].map(|k: usize| *PmsmPlant::STATES[k].at(&mut block.model));
        let mut dx = [0.0; 4];
        block.model.derivatives(Elapsed::ZERO, &mut dx).unwrap();
        block.model.observe(Elapsed::ZERO, &mut block.out);
        let parameters = &block.model.parameters;
        let mechanics = &parameters.mechanics;
        let motor = &machine_of(&block.model.parameters);
        let i = machine::current(motor, parameters.magnetics(), drive::frame::Dq::new(values[0], values[1]));
        let stored = 1.5 * (i.d() * dx[0] + i.q() * dx[1]) + mechanics.J * values[2] * dx[2];
        let p = &block.out.powers;
        let l = &p.losses;
        let parts = [p.p_mech, l.cu, l.iron, l.cond, l.sw, l.friction, stored];
        let size = parts.iter().map(|x| x.abs()).fold(p.p_in.abs(), f64::max);
        worst = worst.max((p.p_in - parts.iter().sum::<f64>()).abs() / size);
        let flows = block.out.i_d != 0.0;
        conducting += u32::from(flows);
        assert!(l.iron >= 0.0 && l.friction >= 0.0 && (l.cu > 0.0 && l.cond > 0.0 || !flows), "{l:?}");
        assert!((p.p_loss - l.sum()).abs() <= 1e-15 * l.sum());
        assert!(block.out.efficiency.is_finite());
    }
    println!("largest residue {worst:e}, {conducting} points with current");
    assert!(worst < 1e-12 && (200..300).contains(&conducting), "{worst}, {conducting}");
}

/// The plant at 1500 rpm under a voltage that turns with it, in steps of `h` (s).
fn turning(h: f64, steps: u32, set: impl Fn(&mut PlantParameters)) -> Block<PmsmPlant> {
    let mut block = Block::<PmsmPlant>::default();
    let par = &mut block.model.parameters;
    lossy(par);
    par.initial.speed = 1500.0 * PI / 30.0;
    set(par);
    (block.model.inputs.u_dc, block.model.inputs.tau_load) = (540.0, 14.0);
    block.initialize();
    let mut now = Elapsed::ZERO;
    for k in 0..steps {
        let theta = 1500.0 * PI / 10.0 * 1e-4 * f64::from(k / (steps / 200)) + 2.0;
        block.model.inputs.u = Phases::from_stator(AlphaBeta::new(theta.cos(), theta.sin()) * 300.0);
        let step = Step { start: now, h };
        block.step(&step).unwrap();
        now = step.end();
    }
    block
}

#[test]
fn the_energies_are_balanced_over_20_ms() {
    let stored = |block: &mut Block<PmsmPlant>| {
        let [d, q, speed] = [0, 1, 2].map(|k: usize| *PmsmPlant::STATES[k].at(&mut block.model));
        let parameters = &block.model.parameters;
        let psi = drive::frame::Dq::new(d, q);
        machine::magnetic_energy(&machine_of(parameters), parameters.magnetics(), psi)
            + 0.5 * parameters.mechanics.J * speed * speed
    };
    let smooth = |par: &mut PlantParameters| {
        par.inverter.dead_time = 0.0;
        (par.inverter.devices.u_transistor, par.inverter.devices.u_diode, par.inverter.devices.E_sw) = (0.0, 0.0, 0.0);
        par.inverter.devices.r_diode = par.inverter.devices.r_transistor;
    };
    let kinks = |_: &mut PlantParameters| ();
    let hot = |par: &mut PlantParameters| {
        smooth(par);
        warm(par);
    };
    let none = |par: &mut PlantParameters| {
        (par.iron, par.inverter.devices, par.winding.k_ac) = Default::default();
        par.inverter.dead_time = 0.0;
        par.mechanics.k_w = 0.0;
    };
    for (name, set) in
        [("none", &none as &dyn Fn(&mut PlantParameters)), ("smooth", &smooth), ("hot", &hot), ("all", &kinks)]
    {
        // The method has the order 4: 16 times the residue with twice the step, with and without losses.
        for (h, steps, allowed) in [(5e-5, 400, 1e-8), (1e-4, 200, 2e-8)] {
            let mut start = turning(h, 0, set);
            let mut block = turning(h, steps, set);
            let change = stored(&mut block) - stored(&mut start);
            let energy = block.out.energy;
            let rest = energy.r#in - energy.mech - energy.loss - change;
            println!("{name}, {h} s: {energy:?}, stored {change} J, residue {rest:e} J, {:e}", rest / energy.r#in);
            assert!(rest.abs() < allowed * energy.r#in.abs().max(energy.loss), "{name}: {rest} J of {energy:?}");
            assert!(
                energy.loss > 1.0 && (block.out.powers.losses.iron > 10.0) == (name != "none"),
                "{:?}",
                block.out.powers
            );
        }
    }
}

#[test]
fn the_drive_with_iron_loss_and_temperatures_is_the_same_in_model_exchange() {
    let mut stepped = Block::<PmsmDrive>::default();
    let pair = &mut stepped.model.pair;
    let par = &mut pair.plant.model.parameters;
    (par.iron.G_e, par.iron.G_h) = (1.3e-4, 0.12);
    (par.inverter.devices.r_transistor, par.inverter.devices.r_diode) = (0.08, 0.08);
    par.initial.theta_e = PI;
    (par.thermal.mode, par.thermal.alpha_R, par.thermal.alpha_psi) = (ThermalMode::Imposed, 3.93e-3, -1.1e-3);
    stepped.model.inputs.thermal.imposed = Temperatures::all(323.15);
    stepped.model.inputs.speed_ref = 50.0;
    stepped.initialize();
    let mut integrated = stepped.clone();
    let (mut now, mut apart, mut highest) = (Elapsed::ZERO, 0.0_f64, 0.0_f64);
    for _ in 0..3000 {
        let step = Step { start: now, h: 1e-4 };
        stepped.step(&step).unwrap();
        let Block { model, out } = &mut integrated;
        integrate::hybrid::<PmsmDrive, 5>(model, &step, 2e-6).unwrap();
        now = step.end();
        model.observe(now, out);
        let (ours, theirs) = (stepped.out.controller.speed_est, out.controller.speed_est);
        apart = apart.max((ours - theirs).abs());
        highest = highest.max(stepped.out.plant.i_q.abs());
        assert!((stepped.out.plant.speed - out.plant.speed).abs() < 1e-3, "{now:?}");
    }
    println!("estimates {apart:e} rad/s apart, currents up to {highest} A");
    assert!(apart < 1e-3 && highest > 1.0, "{apart} rad/s, {highest} A");
}

#[test]
fn the_currents_depend_on_the_voltages() {
    struct Plant;
    impl Exported for Plant {
        type Model = PmsmPlant;
        const CAN: Capabilities<PmsmPlant> = Capabilities::NONE.ContinuousTime().Events().Differentiable();
    }
    let description = Description::exported::<Plant>().unwrap();
    let reference = |name: &str| description.variable(name).unwrap().value_reference;
    for name in ["i_a", "i_b", "i_c", "i_d", "i_q"] {
        let known = description.variable(name).unwrap().dependencies.clone().unwrap();
        for other in ["u_a", "u_b", "u_c", "u_dc", "enable", "speed"] {
            assert!(known.contains(&reference(other)), "{name} depends on {other}");
        }
    }
}

#[test]
fn a_machine_that_coasts_is_braked_by_its_iron() {
    let mut block = Block::<PmsmPlant>::default();
    let par = &mut block.model.parameters;
    lossy(par);
    par.initial.speed = 1500.0 * PI / 30.0;
    (block.model.inputs.u_dc, block.model.inputs.enable) = (540.0, false);
    block.initialize();
    let kinetic = |block: &Block<PmsmPlant>| 0.5 * 15e-3 * block.out.speed * block.out.speed;
    let before = kinetic(&block);
    block.step(&Step { start: Elapsed::ZERO, h: 0.1 }).unwrap();
    let (lost, energy) = (before - kinetic(&block), block.out.energy);
    println!("{lost} J, {energy:?}, {:?}", block.out.powers);
    assert!((lost / energy.loss - 1.0).abs() < 1e-6 && block.out.powers.losses.iron > 40.0, "{lost} J of {energy:?}");
    // In Model Exchange the braking torque is the same.
    let mut dx = [0.0; 4];
    block.model.event(Elapsed::ZERO).unwrap();
    block.model.derivatives(Elapsed::ZERO, &mut dx).unwrap();
    block.model.observe(Elapsed::ZERO, &mut block.out);
    let p = &block.out.powers;
    assert!((dx[2] * 15e-3 * block.out.speed + p.p_loss).abs() < 1e-12 * p.p_loss, "{p:?}");
    assert_eq!((block.out.i_d, block.out.i_q), (0.0, 0.0));
}
