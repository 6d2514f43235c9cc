//! Tangents of plant and drive by dual numbers against central differences, at random points.

use drive::motor::Motor;
use drive::plant::pwm::{InverterMode, OpenPhase};
use drive::plant::saturation::Saturation;
use drive::plant::thermal::{Temperatures, ThermalMode};
use drive::{PmsmDrive, PmsmPlant};
use fmu_core::{Block, Causality, ContinuousTime, Differentiable, Elapsed, Events, Kind, Model, Slot, Variability};

/// A deterministic stream of numbers (xorshift, Marsaglia 2003).
struct Draw(u64);

impl Draw {
    /// Uniform in 0..1.
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        f64::from(u32::try_from(self.0 >> 32).unwrap()) / f64::from(u32::MAX)
    }

    fn around(&mut self, size: f64) -> f64 {
        size * (2.0 * self.unit() - 1.0)
    }

    fn often(&mut self) -> bool {
        self.unit() < 0.5
    }
}

/// A known: its access in a model, and the size of a change.
struct Known<M: Model> {
    name: &'static str,
    at: fn(&mut Block<M>) -> &mut f64,
    size: f64,
}

/// The continuous inputs and the states of the plant, with the sizes of their changes.
fn knowns() -> Vec<Known<PmsmPlant>> {
    macro_rules! state {
        ($k:literal, $size:expr) => {
            Known { name: PmsmPlant::STATES[$k].name, at: |b| PmsmPlant::STATES[$k].at(&mut b.model), size: $size }
        };
    }
    vec![
        Known { name: "u_a", at: |b| &mut b.model.inputs.u.a, size: 100.0 },
        Known { name: "u_b", at: |b| &mut b.model.inputs.u.b, size: 100.0 },
        Known { name: "u_c", at: |b| &mut b.model.inputs.u.c, size: 100.0 },
        Known { name: "u_dc", at: |b| &mut b.model.inputs.u_dc, size: 100.0 },
        Known { name: "tau_load", at: |b| &mut b.model.inputs.tau_load, size: 1.0 },
        Known { name: "speed_shaft", at: |b| &mut b.model.inputs.speed_shaft, size: 100.0 },
        Known { name: "angle_shaft", at: |b| &mut b.model.inputs.angle_shaft, size: 1.0 },
        state!(0, 0.1),
        state!(1, 0.1),
        state!(2, 100.0),
        state!(3, 1.0),
        Known { name: "T_coolant", at: |b| &mut b.model.inputs.thermal.coolant, size: 5.0 },
        Known { name: "T_winding_imposed", at: |b| &mut b.model.inputs.thermal.imposed.winding, size: 5.0 },
        Known { name: "T_stator_imposed", at: |b| &mut b.model.inputs.thermal.imposed.stator, size: 5.0 },
        Known { name: "T_magnet_imposed", at: |b| &mut b.model.inputs.thermal.imposed.magnet, size: 5.0 },
        Known { name: "T_inverter_imposed", at: |b| &mut b.model.inputs.thermal.imposed.inverter, size: 5.0 },
    ]
}

/// The derivatives, then the continuous outputs.
fn unknowns<M: Model>(dx: &[f64], block: &mut Block<M>) -> Vec<f64> {
    let mut values = dx.to_vec();
    for i in 0..M::TABLE.len() {
        let (_, meta, _) = M::TABLE.locate(i).unwrap();
        let continuous = meta.variability == Variability::Continuous && matches!(meta.kind, Kind::Real(_));
        if continuous
            && meta.causality == Causality::Output
            && let Some((_, Slot::Real(x))) = M::TABLE.entry(block, i)
        {
            values.push(*x);
        }
    }
    values
}

/// Derivatives and outputs of the unchanged model.
fn evaluate<M: Differentiable + Clone>(block: &Block<M>) -> Vec<f64> {
    let (mut block, mut dx) = (block.clone(), vec![0.0; M::STATES.len()]);
    block.model.settle();
    block.model.derivatives(Elapsed::ZERO, &mut dx).unwrap();
    block.model.observe(Elapsed::ZERO, &mut block.out);
    unknowns(&dx, &mut block)
}

/// The tangent along `seed`.
fn tangent(base: &Block<PmsmPlant>, knowns: &[Known<PmsmPlant>], seed: &[f64]) -> Vec<f64> {
    // Everything else in `along` is noise, which must have no effect.
    let mut along = base.clone();
    for (known, change) in knowns.iter().zip(seed) {
        *(known.at)(&mut along) = *change;
    }
    let (mut dx, mut result) = ([f64::NAN; 4], base.clone());
    result.model.tangent(Elapsed::ZERO, &along.model, &mut dx, &mut result.out).unwrap();
    unknowns(&dx, &mut result)
}

/// The central difference along `seed` with steps of `h` and `h` / 2, extrapolated.
fn difference(base: &Block<PmsmPlant>, knowns: &[Known<PmsmPlant>], seed: &[f64], h: f64) -> Vec<f64> {
    let at = |h: f64| {
        let mut moved = base.clone();
        for (known, change) in knowns.iter().zip(seed) {
            *(known.at)(&mut moved) += h * change;
        }
        evaluate(&moved)
    };
    let central =
        |h: f64| -> Vec<f64> { at(h).iter().zip(at(-h)).map(|(plus, minus)| (plus - minus) / (2.0 * h)).collect() };
    central(0.5 * h).iter().zip(central(h)).map(|(fine, coarse)| (4.0 * fine - coarse) / 3.0).collect()
}

/// Counts of the kinds of points.
#[derive(Clone, Copy, Debug, Default)]
struct Kinds {
    standstill: u32,
    limited: u32,
    zone: u32,
    blocked: u32,
    conducting: u32,
    imposed: u32,
    saturated: u32,
    no_link: u32,
    lossy: u32,
    warm: u32,
    open: u32,
}

/// Number of points with the average inverter, and of all: the others switch.
const AVERAGE: u32 = 100;
const ALL: u32 = 140;

fn draw(draw: &mut Draw, point: u32, kinds: &mut Kinds) -> Block<PmsmPlant> {
    let mut block = Block::<PmsmPlant>::default();
    let par = &mut block.model.parameters;
    if draw.often() {
        par.motor = Motor::IPMSM_2_2_KW;
    }
    if draw.often() {
        (par.saturation.s_2, par.saturation.s_3, par.saturation.s_dq) = (40.0, 40.0, 7.0);
        kinds.saturated += 1;
    }
    if draw.often() {
        (par.inverter.dead_time, par.inverter.i_zero) = (2e-6, 1.0);
    }
    if point % 5 < 2 {
        (par.iron.G_e, par.iron.G_h, par.winding.k_ac, par.mechanics.k_w) = (2.7e-4, 0.127, 1e-7, 1e-6);
        let devices = &mut par.inverter.devices;
        (devices.u_transistor, devices.r_transistor, devices.u_diode, devices.r_diode) = (0.9, 0.06, 0.7, 0.05);
        (devices.E_sw, devices.i_sw, devices.u_sw) = (2.5e-3, 15.0, 600.0);
        kinds.lossy += 1;
    }
    if point >= AVERAGE {
        par.inverter.pwm.mode = InverterMode::Switched;
        (par.iron.G_e, par.iron.G_h) = (0.0, 0.0);
        if draw.often() {
            // One leg blocks; d i / d psi counts as constant then.
            (par.inverter.pwm.open_phase, par.saturation) = (OpenPhase::B, Saturation::default());
            kinds.open += 1;
        }
    }
    par.mechanics.imposed = point % 4 == 1;
    kinds.imposed += u32::from(par.mechanics.imposed);
    if point % 7 < 3 {
        let thermal = &mut par.thermal;
        (thermal.mode, thermal.alpha_R, thermal.alpha_psi) = (ThermalMode::Imposed, 3.93e-3, -1.1e-3);
        let warm = 293.15 + 30.0 * f64::from(point % 4);
        block.model.inputs.thermal.imposed =
            Temperatures { winding: warm + 50.0, stator: warm, magnet: warm, inverter: 310.0 };
        kinds.warm += 1;
    }
    let psi_m = par.thermal.motor(&par.motor, &block.model.inputs.thermal.imposed).psi_M;
    let inputs = &mut block.model.inputs;
    inputs.enable = point % 3 != 2;
    // Voltages up to three times the hexagon.
    (inputs.u.a, inputs.u.b, inputs.u.c) = (draw.around(300.0), draw.around(300.0), draw.around(300.0));
    inputs.u_dc = if point % 25 == 7 { 0.0 } else { 100.0 + 300.0 * draw.unit() };
    (inputs.tau_load, inputs.speed_shaft, inputs.angle_shaft) =
        (draw.around(3.0), draw.around(300.0), draw.around(9.0));
    // Diodes that block at the start would fix the states.
    let enable = std::mem::replace(&mut inputs.enable, true);
    block.initialize();
    block.model.inputs.enable = enable;
    let still = point % 10 < 2;
    kinds.standstill += u32::from(still);
    let known = knowns();
    let mut set = |name: &str, value: f64| {
        *(known.iter().find(|known| known.name == name).unwrap().at)(&mut block) = value;
    };
    // Half of the points have currents of the order of the dead-time zone.
    let size = if draw.often() { 1.0 } else { 0.05 };
    set("psi_d", psi_m + draw.around(0.05 * size));
    set("psi_q", draw.around(0.05 * size));
    set("speed", if still { 0.0 } else { draw.around(400.0) });
    set("angle", draw.around(20.0));
    if still {
        set("speed_shaft", 0.0);
    }
    if point % 6 == 5 {
        // A blocked machine has no current.
        set("psi_d", psi_m);
        set("psi_q", 0.0);
    }
    block.model.settle();
    block.model.event(Elapsed::ZERO).unwrap();
    block.model.observe(Elapsed::ZERO, &mut block.out);
    let inputs = &block.model.inputs;
    let none = block.out.i_d == 0.0 && block.out.i_q == 0.0;
    kinds.limited += u32::from(inputs.enable && inputs.u.span() > inputs.u_dc);
    kinds.blocked += u32::from(!inputs.enable && none);
    kinds.conducting += u32::from(!inputs.enable && !none);
    kinds.no_link += u32::from(inputs.u_dc == 0.0);
    let zone = block.model.parameters.inverter.dead_time > 0.0 && block.out.i.a.abs() < 1.0;
    kinds.zone += u32::from(inputs.enable && zone);
    block
}

#[test]
fn the_tangent_of_the_plant_is_its_derivative() {
    let (knowns, mut numbers, mut kinds) = (knowns(), Draw(0x9e37_79b9_7f4a_7c15), Kinds::default());
    let mut worst = 0.0_f64;
    // The row of the efficiency, found by its unique value.
    let mut marked = Block::<PmsmPlant>::default();
    marked.out.efficiency = 0.123;
    let efficiency = unknowns(&[0.0; 4], &mut marked).iter().position(|x| x.to_bits() == 0.123_f64.to_bits()).unwrap();
    for point in 0..ALL {
        let base = draw(&mut numbers, point, &mut kinds);
        let value = evaluate(&base);
        let no_link = base.model.inputs.u_dc == 0.0;
        let mut seeds: Vec<Vec<f64>> = (0..knowns.len())
            .map(|i| (0..knowns.len()).map(|j| if i == j { knowns[i].size } else { 0.0 }).collect())
            .collect();
        let mut along = |known: &Known<PmsmPlant>| {
            if known.name.starts_with("T_") { 0.4 * known.size } else { numbers.around(known.size) }
        };
        seeds.push(knowns.iter().map(&mut along).collect());
        for seed in &mut seeds {
            // The DC link's voltage has no negative side.
            seed[3] = if no_link { 0.0 } else { seed[3] };
        }
        let exact: Vec<Vec<f64>> = seeds.iter().map(|seed| tangent(&base, &knowns, seed)).collect();
        // The steps stay clear of the nearest kinks at these points.
        let near: Vec<Vec<f64>> = seeds.iter().map(|seed| difference(&base, &knowns, seed, 1e-5)).collect();
        // Without power at the shaft or from the link the efficiency has a kink: it is 0, and p_mech / p_in on one side.
        let powers = &base.out.powers;
        let kink = (powers.p_mech.abs().min(powers.p_in.abs()) < 1e-6).then_some(efficiency);
        for row in (0..value.len()).filter(|row| kink != Some(*row)) {
            let size = exact.iter().map(|column| column[row].abs()).fold(0.0, f64::max);
            for (exact, near) in exact.iter().zip(&near) {
                // Rounding of the difference: values of this size, or 1 % of 1 where the value is 0, divided by the step.
                let rounding = 1e-10 * value[row].abs() + 1e-12;
                let error = ((exact[row] - near[row]).abs() - rounding).max(0.0) / size.max(1e-9);
                assert!(
                    error < 1e-6,
                    "point {point}, unknown {row}: {} {} {kinds:?} of {}, {size} {:?}",
                    exact[row],
                    near[row],
                    value[row],
                    base.out.powers
                );
                worst = worst.max(error);
            }
        }
    }
    println!("worst relative error {worst:e}; points: {kinds:?}");
    let Kinds { standstill, limited, zone, blocked, conducting, imposed, saturated, no_link, lossy, warm, open } =
        kinds;
    let all = [standstill, limited, zone, blocked, conducting, imposed, saturated, no_link, lossy, warm, open];
    assert!(all.iter().all(|&count| count > 3), "{kinds:?}");
}

#[test]
fn tangents_are_linear() {
    let (knowns, mut numbers, mut kinds) = (knowns(), Draw(0x2545_f491_4f6c_dd1d), Kinds::default());
    for point in 0..ALL {
        let base = draw(&mut numbers, point, &mut kinds);
        let mut seed = || -> Vec<f64> { knowns.iter().map(|known| numbers.around(known.size)).collect() };
        let (v, w) = (seed(), seed());
        let sum: Vec<f64> = v.iter().zip(&w).map(|(v, w)| 2.0 * v - 3.0 * w).collect();
        let [a, b, together] = [&v, &w, &sum].map(|seed| tangent(&base, &knowns, seed));
        for row in 0..a.len() {
            let size = a[row].abs().max(b[row].abs());
            assert!(
                (2.0 * a[row] - 3.0 * b[row] - together[row]).abs() <= 1e-12 * size,
                "point {point}, unknown {row}"
            );
        }
        // Other values in `along` have no effect.
        let none = tangent(&base, &knowns, &vec![0.0; knowns.len()]);
        assert!(none.iter().all(|x| *x == 0.0), "{none:?}");
    }
}

#[test]
fn the_tangent_of_the_drive_is_that_of_its_plant() {
    let mut drive = Block::<PmsmDrive>::default();
    let plant = &mut drive.model.pair.plant.model.parameters;
    plant.initial.speed = 60.0;
    (plant.thermal.mode, plant.thermal.alpha_R, plant.thermal.alpha_psi) = (ThermalMode::Imposed, 3.93e-3, -1.1e-3);
    drive.model.inputs.speed_ref = 50.0;
    drive.initialize();
    let mut now = Elapsed::ZERO;
    for _ in 0..50 {
        let step = fmu_core::Step { start: now, h: 1e-4 };
        drive.step(&step).unwrap();
        now = step.end();
    }
    let base = drive.clone();
    let seed = |block: &mut Block<PmsmDrive>, h: f64, add: bool| {
        let inputs = &mut block.model.inputs;
        let change = |x: &mut f64, by: f64| *x = if add { *x + h * by } else { h * by };
        change(&mut inputs.tau_load, 0.7);
        change(&mut inputs.u_dc, 20.0);
        change(&mut inputs.speed_ref, 5.0);
        let imposed = &mut inputs.thermal.imposed;
        for (value, by) in [&mut imposed.winding, &mut imposed.stator, &mut imposed.magnet, &mut imposed.inverter]
            .into_iter()
            .zip([10.0, 3.0, -7.0, 2.0])
        {
            change(value, by);
        }
        change(&mut inputs.thermal.coolant, 5.0);
        for (state, by) in PmsmDrive::STATES.iter().zip([0.02, -0.03, 10.0, 0.3, 3.0]) {
            change(state.at(&mut block.model), by);
        }
    };
    let mut along = base.clone();
    seed(&mut along, 1.0, false);
    let (mut dx, mut result) = ([0.0; 5], base.clone());
    base.model.tangent(now, &along.model, &mut dx, &mut result.out).unwrap();
    assert_eq!(result.out.controller, drive::control::signals::ControllerOutputs::default(), "held");
    let at = |h: f64| {
        let mut moved = base.clone();
        seed(&mut moved, h, true);
        evaluate(&moved)
    };
    let (plus, minus) = (at(1e-6), at(-1e-6));
    for (row, exact) in unknowns(&dx, &mut result).into_iter().enumerate() {
        let near = (plus[row] - minus[row]) / 2e-6;
        assert!((exact - near).abs() < 1e-6 * exact.abs().max(0.1), "{row}: {exact} {near}");
    }
    assert!(result.out.plant.tau_e.abs() > 0.1, "{:?}", result.out.plant);
}
