//! `PmsmDriveMean` beside `PmsmDrive`: a driving cycle, the lag of the torque, the speed loop, temperatures, both interfaces.

use crate::vehicle::{ENERGY, KWH, LOSSES, Vehicle};
use crate::{lossy, machines};
use drive::dc_link::{Chopper, DcSource};
use drive::derating::Derating;
use drive::plant::flux_map;
use drive::plant::power::{Energy, Powers};
use drive::plant::tables::PlantParameters;
use drive::plant::thermal::ThermalMode;
use drive::pmsm_drive::{DriveInputs, DriveOutputs};
use drive::steady::{Condition, Steady};
use drive::{PmsmDrive, PmsmDriveMean};
use drive_control::battery::DcLimits;
use drive_control::modes::SpeedRange;
use drive_control::tables::ControllerParameters;
use fmu_core::log::Warnings;
use fmu_core::{Block, Causality, ContinuousTime, Description, Elapsed, Meta, Model, Slot, Step, Warns};

/// A drive with the same inputs and the same outputs.
trait Drive: Model + Send {
    fn new(plant: &PlantParameters, controller: &ControllerParameters) -> Block<Self>;
    fn inputs(&mut self) -> &mut DriveInputs;
    fn outputs(out: &Self::Outputs) -> &DriveOutputs;
}

impl Drive for PmsmDrive {
    fn new(plant: &PlantParameters, controller: &ControllerParameters) -> Block<Self> {
        let mut block = Block::<Self>::default();
        block.model.pair.plant.model.parameters = plant.clone();
        block.model.pair.controller.model.parameters = controller.clone();
        block
    }

    fn inputs(&mut self) -> &mut DriveInputs {
        &mut self.inputs
    }

    fn outputs(out: &DriveOutputs) -> &DriveOutputs {
        out
    }
}

impl Drive for PmsmDriveMean {
    fn new(plant: &PlantParameters, controller: &ControllerParameters) -> Block<Self> {
        let mut block = Block::<Self>::default();
        (block.model.drive.plant, block.model.drive.controller) = (plant.clone(), controller.clone());
        block
    }

    fn inputs(&mut self) -> &mut DriveInputs {
        &mut self.inputs
    }

    fn outputs(out: &Self::Outputs) -> &DriveOutputs {
        &out.drive
    }
}

/// Machine c with all losses, in torque mode on an imposed shaft.
fn traction() -> (PlantParameters, ControllerParameters) {
    let mut controller = machines::c(240.0).parameters();
    controller.speed_loop.torque_mode = true;
    (lossy::c().par, controller)
}

/// Runs a drive for `seconds` in steps of `h` (s); `set` receives the inputs and the time before each step, `each` the outputs
/// after it.
fn run<D: Drive>(
    block: &mut Block<D>,
    seconds: f64,
    h: f64,
    set: impl Fn(f64, &mut DriveInputs),
    mut each: impl FnMut(f64, &DriveOutputs),
) {
    set(0.0, block.model.inputs());
    block.initialize();
    block.model.validate().unwrap();
    let mut now = Elapsed::ZERO;
    while now.seconds() < seconds - 0.5 * h {
        set(now.seconds(), block.model.inputs());
        let step = Step { start: now, h };
        block.step(&step).unwrap();
        now = step.end();
        each(now.seconds(), D::outputs(&block.out));
    }
}

/// Torque references for the cycle's torque at the shaft in the middle of each step of 10 ms, with the speed there.
fn references() -> Vec<[f64; 2]> {
    let (plant, controller) = traction();
    let (drive, vehicle) = (Steady::new(plant, controller).sampled(), Vehicle::new());
    let (mut rows, mut k, h) = (Vec::new(), 0.0, 0.01);
    while k * h < vehicle.end() {
        let [speed, tau] = vehicle.at((k + 0.5) * h);
        let condition = Condition { speed, u_dc: 400.0, temperatures: drive.start_temperatures() };
        rows.push([speed, drive.at(&condition).by_shaft(tau).unwrap().tau_ref]);
        k += 1.0;
    }
    rows
}

/// Energies of the cycle with `count` steps in each 10 ms, and the losses in kWh.
fn energy<D: Drive>(count: u32) -> (Energy, [f64; 5]) {
    let (plant, controller) = traction();
    let mut block = D::new(&plant, &controller);
    block.model.inputs().u_dc = 400.0;
    block.initialize();
    block.model.validate().unwrap();
    let (mut losses, mut angle, mut now, h) = ([0.0; 5], 0.0, Elapsed::ZERO, 0.01 / f64::from(count));
    for [speed, tau] in references() {
        for _ in 0..count {
            let inputs = block.model.inputs();
            (inputs.speed_shaft, inputs.tau_ref, inputs.angle_shaft) = (speed, tau, angle);
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            (now, angle) = (step.end(), angle + speed * h);
            let l = &D::outputs(&block.out).plant.powers.losses;
            for (sum, p) in losses.iter_mut().zip([l.cu, l.iron, l.cond, l.sw, l.friction]) {
                *sum += p * h * KWH;
            }
        }
    }
    (D::outputs(&block.out).plant.energy, losses)
}

#[test]
fn the_energy_of_the_cycle_by_algebra() {
    let (plant, controller) = traction();
    let (drive, vehicle) = (Steady::new(plant, controller), Vehicle::new());
    let (mut got, mut losses) = ([0.0; 3], [0.0; 5]);
    let mut t = 0.5;
    while t < vehicle.end() {
        let [speed, tau] = vehicle.at(t);
        let at = Condition { speed, u_dc: 400.0, temperatures: drive.start_temperatures() };
        let Powers { p_in, losses: l, .. } = drive.at(&at).by_shaft(tau.max(-80.0)).unwrap().powers;
        for (sum, p) in got.iter_mut().zip([p_in, p_in.max(0.0), p_in.min(0.0)]) {
            *sum += p * KWH;
        }
        for (sum, p) in losses.iter_mut().zip([l.cu, l.iron, l.cond, l.sw, l.friction]) {
            *sum += p * KWH;
        }
        t += 1.0;
    }
    println!("{got:.6?} of {ENERGY:?} kWh, {losses:.6?} of {LOSSES:?} kWh");
    for (got, wanted) in got.iter().zip(ENERGY).chain(losses.iter().zip(LOSSES)) {
        assert!((got / wanted - 1.0).abs() < 1e-3, "{got} kWh, not {wanted} kWh");
    }
}

#[test]
fn the_energy_of_the_cycle_is_that_of_the_drive() {
    let (whole, theirs) = energy::<PmsmDrive>(10);
    for count in [10, 1] {
        let (mean, ours) = energy::<PmsmDriveMean>(count);
        let pairs = [(mean.r#in, whole.r#in), (mean.mech, whole.mech), (mean.loss, whole.loss)];
        println!(
            "{count} steps in 10 ms: {:?} kWh; {ours:.5?} of {theirs:.5?} kWh",
            pairs.map(|(a, b)| (a * KWH, b * KWH))
        );
        for ((a, b), allowed) in pairs.into_iter().zip([1e-3, 1e-3, 5e-3]) {
            assert!((a / b - 1.0).abs() < allowed, "{count} steps in 10 ms: {a} J, not {b} J");
        }
        for (a, b) in ours.iter().zip(theirs) {
            assert!((a / b - 1.0).abs() < 5e-3, "{count} steps in 10 ms: {a} kWh, not {b} kWh");
        }
    }
}

/// The torque follows its reference with 1 / current.bandwidth, regardless of the step; a request beyond the limit is clipped to it.
#[test]
fn the_lag_is_exact_at_any_step() {
    let (mut plant, controller) = traction();
    (plant.iron.G_e, plant.iron.G_h, plant.mechanics.tau_coulomb) = (0.0, 0.0, 0.0);
    let limit = machines::c(240.0).limit(100.0, 1.0)[1].tau;
    for (h, steps) in [(1e-4, 20.0), (1e-3, 2.0), (2e-3, 1.0)] {
        for (tau_ref, target) in [(100.0, 100.0), (-400.0, -limit), (400.0, limit)] {
            let mut block = PmsmDriveMean::new(&plant, &controller);
            let mut last = DriveOutputs::default();
            let set = |_, i: &mut DriveInputs| (i.u_dc, i.tau_ref) = (400.0, tau_ref);
            run(&mut block, h * steps, h, set, |_, out| last = out.clone());
            let wanted = target * (1.0 - (-2e-3 * controller.current.bandwidth).exp());
            let (got, limits) = (last.plant.tau_e, [last.controller.tau_min, last.controller.tau_max]);
            assert!((got / wanted - 1.0).abs() < 1e-9, "h = {h}: {got} N.m, not {wanted} N.m");
            assert!((limits[1] / limit - 1.0).abs() < 1e-9 && (limits[0] / limit + 1.0).abs() < 1e-9, "{limits:?}");
        }
    }
}

/// The reference motor with a sensor from rest to 150 rad/s with `ramp` (rad/s2), and a load at 0.6 s; the speed every 10 ms.
fn start<D: Drive>(h: f64, ramp: f64, torque_mode: bool) -> (Vec<f64>, DriveOutputs) {
    let (plant, mut controller) = (lossy::b().par, machines::b().parameters());
    let plant = PlantParameters {
        mechanics: drive::plant::mechanics::Mechanics { imposed: false, ..plant.mechanics },
        ..plant
    };
    (controller.speed_loop.ramp, controller.speed_loop.torque_mode) = (ramp, torque_mode);
    let mut block = D::new(&plant, &controller);
    let set = |t: f64, i: &mut DriveInputs| {
        (i.speed_ref, i.u_dc) = (if t < 0.04995 { 0.0 } else { 150.0 }, 325.0);
        i.tau_load = if t < 0.59995 { 0.1 } else { 2.0 };
        i.tau_ref = if t < 0.29995 { 3.0 } else { 1.5 };
    };
    let (mut speeds, mut last, mut next) = (Vec::new(), DriveOutputs::default(), 0.01);
    run(&mut block, 1.2, h, set, |t, out| {
        if t > next - 1e-9 {
            (next, last) = (next + 0.01, out.clone());
            speeds.push(out.plant.speed);
        }
    });
    (speeds, last)
}

/// Largest difference (rad/s) between two runs.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert!(a.len() == b.len() && a.len() > 100);
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_speed_loop_is_that_of_the_drive() {
    for (ramp, torque_mode, allowed) in [(0.0, false, 0.1), (400.0, false, 0.1), (0.0, true, 0.6)] {
        let (whole, of_whole) = start::<PmsmDrive>(1e-3, ramp, torque_mode);
        let (fine, of_fine) = start::<PmsmDriveMean>(1e-4, ramp, torque_mode);
        let off = apart(&whole, &fine);
        println!(
            "ramp {ramp}, torque mode {torque_mode}: {off} rad/s from the drive; at the end {} {}",
            whole[118], fine[118]
        );
        assert!(off < allowed, "{off} rad/s");
        for h in [1e-3, 1e-2] {
            let (mean, last) = start::<PmsmDriveMean>(h, ramp, torque_mode);
            let off = apart(&fine, &mean);
            let energies = |out: &DriveOutputs| [out.plant.energy.r#in, out.plant.energy.mech, out.plant.energy.loss];
            println!(
                "h = {h}: {off} rad/s from steps of 0.1 ms; {:?} {:?} {:?} J",
                energies(&last),
                energies(&of_fine),
                energies(&of_whole)
            );
            assert!(off < 0.05, "h = {h}: {off} rad/s");
            for (k, (a, b)) in energies(&last).into_iter().zip(energies(&of_whole)).enumerate() {
                assert!((a / b - 1.0).abs() < 0.01, "h = {h}: energy {k} {a} J, not {b} J");
            }
            let Energy { r#in, mech, loss } = last.plant.energy;
            let kinetic = 0.5 * lossy::b().par.mechanics.J * last.plant.speed.powi(2);
            let off = r#in - mech - loss - kinetic;
            assert!(off.abs() < 5e-4 * r#in, "h = {h}: {off} J of {in} J");
        }
    }
}

/// The energy from the link equals the sum of shaft, load and losses for any step and in both modes, and agrees with a run in
/// small steps.
#[test]
fn the_energy_is_balanced_at_every_step() {
    let (plant, mut controller) = traction();
    let mut plant = plant;
    (plant.mechanics.imposed, plant.mechanics.J) = (false, 1.5);
    controller.speed_loop.bandwidth = 5.0;
    // Acceleration and deceleration, with and without the gates.
    let ramp = |t: f64| 20.0 * t.min(20.0).min((40.0 - t).max(0.0));
    for (torque_mode, coasts) in [(false, false), (true, false), (false, true)] {
        controller.speed_loop.torque_mode = torque_mode;
        let set = |t: f64, i: &mut DriveInputs| {
            (i.u_dc, i.speed_ref, i.tau_load) = (400.0, ramp(t), if t > 10.0 { 15.0 } else { 0.0 });
            (i.tau_ref, i.enable) = (if t < 20.0 { 40.0 } else { -30.0 }, !coasts || t < 15.0);
        };
        let mut reference = 0.0;
        for h in [1e-3, 2e-3, 5e-3, 1e-2, 5e-2] {
            let mut block = PmsmDriveMean::new(&plant, &controller);
            let (mut most, mut worst) = (0.0_f64, 0.0_f64);
            run(&mut block, 40.0, h, set, |_, out| {
                let Energy { r#in, mech, loss } = out.plant.energy;
                most = most.max(r#in);
                worst = worst.max((r#in - mech - loss - 0.5 * 1.5 * out.plant.speed.powi(2)).abs());
            });
            if reference == 0.0 {
                reference = most;
            }
            println!("torque mode {torque_mode}, coasts {coasts}, h = {h}: {worst:.3e} J of {most} J ({reference} J)");
            assert!(worst < 1e-9 * most, "h = {h}: {worst} J of {most} J");
            // The reference on its ramp is constant over a step: with 50 ms, the shaft is 0.5 rad/s behind.
            assert!(h > 0.02 || (most / reference - 1.0).abs() < 1e-3, "h = {h}: {most} J, not {reference} J");
        }
    }
}

/// With the gates off, the shaft coasts under friction and iron loss, and the link supplies no power.
#[test]
fn without_enable_the_shaft_coasts() {
    let (mut plant, controller) = (lossy::b().par, machines::b().parameters());
    (plant.mechanics.imposed, plant.initial.speed) = (false, 200.0);
    let coast = |h: f64| {
        let mut block = PmsmDriveMean::new(&plant, &controller);
        let mut last = DriveOutputs::default();
        run(&mut block, 2.0, h, |_, i| (i.u_dc, i.enable) = (325.0, false), |_, out| last = out.clone());
        last
    };
    let whole = {
        let mut block = PmsmDrive::new(&plant, &controller);
        let mut last = DriveOutputs::default();
        run(&mut block, 2.0, 1e-3, |_, i| (i.u_dc, i.enable) = (325.0, false), |_, out| last = out.clone());
        last
    };
    for h in [1e-3, 1e-2, 0.1] {
        let out = coast(h);
        println!("h = {h}: {} of {} rad/s", out.plant.speed, whole.plant.speed);
        assert!((out.plant.speed - whole.plant.speed).abs() < 0.05 && out.plant.speed > 20.0);
        assert!(out.plant.powers.p_in == 0.0 && out.plant.energy.r#in == 0.0 && !out.controller.enabled);
        assert!((out.plant.energy.loss / whole.plant.energy.loss - 1.0).abs() < 2e-3, "{:?}", out.plant.energy);
    }
}

#[test]
fn the_temperatures_are_those_of_the_drive() {
    let (mut plant, mut controller) = (lossy::b().par, machines::b().parameters());
    controller.speed_loop.torque_mode = true;
    let thermal = &mut plant.thermal;
    (thermal.mode, thermal.alpha_R, thermal.alpha_psi) = (ThermalMode::Network, 3.93e-3, -1.1e-3);
    let network = &mut thermal.network;
    (network.C_winding, network.C_stator, network.C_rotor, network.C_inverter) = (15.0, 90.0, 25.0, 5.0);
    (network.G_ws, network.G_sc, network.G_sr, network.G_inverter) = (2.0, 1.2, 0.3, 4.0);
    let set = |t: f64, i: &mut DriveInputs| {
        (i.speed_shaft, i.angle_shaft, i.tau_ref, i.u_dc) = (200.0, 200.0 * t, 2.5, 325.0);
    };
    let (mut ours, mut theirs) = (DriveOutputs::default(), DriveOutputs::default());
    run(&mut PmsmDriveMean::new(&plant, &controller), 15.0, 1e-2, set, |_, out| ours = out.clone());
    run(&mut PmsmDrive::new(&plant, &controller), 15.0, 1e-3, set, |_, out| theirs = out.clone());
    let list = |out: &DriveOutputs| {
        let t = &out.plant.temperatures;
        [t.winding, t.stator, t.magnet, t.inverter]
    };
    println!("{:?} K, {:?} K", list(&ours), list(&theirs));
    for (a, b) in list(&ours).into_iter().zip(list(&theirs)) {
        assert!((a - b).abs() < 0.02 && a > 293.5, "{a} K, not {b} K");
    }
    assert!((ours.plant.heat.coolant / theirs.plant.heat.coolant - 1.0).abs() < 1e-3);
}

/// Model Exchange: the classical Runge-Kutta method on the derivatives yields the results of Co-Simulation.
#[test]
fn both_interfaces_agree() {
    let (mut plant, mut controller) = (lossy::b().par, machines::b().parameters());
    (plant.mechanics.imposed, controller.speed_loop.bandwidth) = (false, 40.0);
    let set = |i: &mut DriveInputs| (i.speed_ref, i.tau_load, i.u_dc) = (120.0, 1.0, 325.0);
    let mut stepped = PmsmDriveMean::new(&plant, &controller);
    run(&mut stepped, 0.5, 1e-3, |_, i| set(i), |_, _| ());
    let mut solved = PmsmDriveMean::new(&plant, &controller);
    set(&mut solved.model.inputs);
    solved.initialize();
    let states = PmsmDriveMean::STATES;
    let read = |m: &mut PmsmDriveMean| states.iter().map(|s| *s.at(m)).collect::<Vec<f64>>();
    let h = 1e-4;
    for _ in 0..5000 {
        let x = read(&mut solved.model);
        let mut sum = vec![0.0; x.len()];
        let mut slope = vec![0.0; x.len()];
        for (share, weight) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
            for (k, state) in states.iter().enumerate() {
                *state.at(&mut solved.model) = x[k] + share * h * slope[k];
            }
            solved.model.derivatives(Elapsed::ZERO, &mut slope).unwrap();
            for (sum, slope) in sum.iter_mut().zip(&slope) {
                *sum += weight / 6.0 * slope;
            }
        }
        for (k, state) in states.iter().enumerate() {
            *state.at(&mut solved.model) = x[k] + h * sum[k];
        }
    }
    solved.model.observe(Elapsed::ZERO, &mut solved.out);
    let (ours, theirs) = (&solved.out.drive.plant, &stepped.out.drive.plant);
    println!("{:?} {:?}; {} {} rad/s", ours.energy, theirs.energy, ours.speed, theirs.speed);
    let pairs = [
        (ours.speed, theirs.speed),
        (ours.angle, theirs.angle),
        (ours.i_q, theirs.i_q),
        (ours.energy.r#in, theirs.energy.r#in),
        (ours.energy.loss, theirs.energy.loss),
        (ours.powers.p_in, theirs.powers.p_in),
        (solved.out.drive.means.p_loss, stepped.out.drive.means.p_loss),
        (solved.out.drive.controller.tau_max, stepped.out.drive.controller.tau_max),
        (solved.out.drive.controller.speed_est, stepped.out.drive.controller.speed_est),
    ];
    for (a, b) in pairs {
        assert!((a / b - 1.0).abs() < 2e-3 && b != 0.0, "{a} in Model Exchange, {b} in Co-Simulation");
    }
    let mut network = PmsmDriveMean::default();
    network.drive.plant.thermal.mode = ThermalMode::Network;
    assert!(network.validate_for(fmu_core::Interface::ModelExchange).is_err(), "the network needs Co-Simulation");
}

/// All variables of `PmsmDrive` exist with the same name, kind, unit, range and start value.
#[test]
fn it_has_the_variables_of_the_drive() {
    let [whole, mean] = [Description::of::<PmsmDrive>(), Description::of::<PmsmDriveMean>()].map(Result::unwrap);
    let (mut without, mut with) = (0, 0);
    for (a, b) in whole.variables.iter().zip(&mean.variables) {
        assert_eq!((&a.name, a.value_reference, a.causality), (&b.name, b.value_reference, b.causality));
        assert_eq!((&a.start, a.min, a.max, &a.kind), (&b.start, b.min, b.max, &b.kind), "{}", a.name);
        let parameter = a.causality == Causality::Parameter;
        if parameter && !PmsmDriveMean::has_effect(&a.name) {
            without += 1;
            assert!(b.description.ends_with("; accepted, without effect in this model"), "{}", b.description);
        } else {
            with += usize::from(parameter);
            assert_eq!(a.description, b.description);
        }
    }
    assert_eq!(whole.terminals, mean.terminals);
    println!("{without} parameters without effect, {with} with");
    assert!(without > 60 && with > 60 && mean.variables.len() == whole.variables.len() + 3);
}

/// The first case with a DC link, those that trip by its voltage, also at a speed where the back EMF exceeds the link, and those with
/// another source.
const LINKED: usize = 5;
const OVER: usize = 6;
const UNDER: usize = 7;
const FAST: usize = 8;
const BATTERY: usize = 9;
const RECTIFIER: usize = 10;
const MODES: usize = 11;
const CASES: usize = 12;

/// Link and trips of a case with a DC link.
fn link_of(case: usize, model: &mut PmsmDriveMean) {
    let (link, trip) = (&mut model.link_parameters, &mut model.drive.controller.trip);
    (link.dc_link.used, link.dc_link.R_source) = (true, [6.0, 1.0, 1.0, 1.0, 1.0, 0.1][case - LINKED]);
    (trip.used, trip.i) = (case > LINKED, 500.0);
    link.chopper = Chopper { used: case == LINKED || case == BATTERY, u_on: 640.0, u_off: 505.0, R: 100.0 };
    (trip.u_dc, trip.u_dc_min, trip.u_dc_restart) = match case {
        LINKED | UNDER => (1000.0, 360.0, 460.0),
        OVER => (520.0, 10.0, 0.0),
        FAST => (1000.0, 395.0, 0.0),
        _ => (1000.0, 100.0, 0.0),
    };
    trip.asc = case == FAST;
    if case == BATTERY {
        (link.dc_link.source, link.dc_link.i_max, link.dc_link.i_min) = (DcSource::Battery, 30.0, -20.0);
        link.chopper.R = 15.0;
    } else if case == RECTIFIER {
        link.dc_link.source = DcSource::RectifierThree;
    }
}

/// Another value of a parameter than `x`, in its range.
fn another(meta: &Meta, x: f64) -> f64 {
    // The trim settles elsewhere only without bandwidth; a dead time is a small part of a PWM period.
    let from_0 = if meta.description.starts_with("Dead time") { 1e-6 } else { 0.3 };
    let moved = if x == 0.0 { from_0 } else { 0.8 * x };
    let moved = if meta.description.contains("0: no trim") { 0.0 } else { moved };
    if meta.range.contains(moved) { moved } else { x * 1.1 }
}

/// All outputs as bits after a run with the parameter `index` changed, or `None` if the value is refused.
fn with_moved(index: Option<usize>, case: usize) -> Option<Vec<u64>> {
    let (mut plant, mut controller) = traction();
    let linked = (LINKED..MODES).contains(&case);
    if linked {
        // Machine c on its link: limits of the battery, a chopper, over-voltage, under-voltage.
        controller.dc = DcLimits { used: true, max: 80.0, min: -50.0 };
    } else if case == 3 {
        plant.flux_map = flux_map::linear(&plant.motor, [-0.2, 0.1], 0.3);
    } else if case > 0 {
        (plant, controller) = (lossy::b().par, ControllerParameters::default());
        plant.mechanics.imposed = false;
        (controller.speed_loop.ramp, controller.speed_est) = (300.0, 5.0);
        (controller.zero_speed.i_0, controller.current.mtpa) = (2.0, case == 2);
        controller.speed_loop.torque_mode = case == 4 || case == MODES;
        if case == MODES {
            plant.initial.speed = 19.0;
            controller.modes.speed = SpeedRange { used: true, max: 20.0, min: -5.0 };
            (controller.modes.tau_used, controller.modes.brake.tau) = (true, 0.9);
        }
        if case == 2 {
            controller.limit.tau = 1.5;
        }
    }
    if case == 0 {
        let thermal = &mut plant.thermal;
        (thermal.mode, thermal.alpha_R, thermal.alpha_psi) = (ThermalMode::Network, 3.93e-3, -1.1e-3);
        let network = &mut thermal.network;
        (network.C_winding, network.C_stator, network.C_rotor, network.C_inverter) = (15.0, 90.0, 25.0, 5.0);
        (network.G_ws, network.G_sc, network.G_sr, network.G_inverter) = (2.0, 1.2, 0.3, 4.0);
        (plant.motor.L_q, controller.weakening.k_t) = (1.4e-3, 0.96);
    }
    let mut block = PmsmDriveMean::new(&plant, &controller);
    let before = block.model.drive.plant.flux_map.clone();
    if case == 4 {
        block.model.drive.derating =
            Derating { used: true, T_winding: 280.0, T_winding_max: 400.0, ..Derating::default() };
    }
    if case == 1 {
        let curve = Derating { used: true, by_table: true, ..Derating::default() };
        block.model.drive.derating = Derating { at: [280.0, 400.0, 410.0, 420.0, 430.0, 440.0, 450.0, 460.0], ..curve };
    }
    if linked {
        link_of(case, &mut block.model);
    }
    let moved = index.and_then(|index| PmsmDriveMean::TABLE.locate(index));
    if case == RECTIFIER && moved.as_ref().is_some_and(|(name, ..)| !name.starts_with("dc_link.")) {
        // Its periodic solutions take time, and the other cases move the rest.
        return None;
    }
    let map = &mut block.model.drive.plant.flux_map;
    match moved.as_ref().map_or("", |(name, ..)| name) {
        // A machine with other inductances; one of these values alone would make an invalid machine.
        "plant.flux_map.w" => map.w.iter_mut().flatten().for_each(|w| *w *= 1.2),
        "plant.flux_map.d_min" | "plant.flux_map.d_max" => (map.d_min, map.d_max) = (1.2 * map.d_min, 1.2 * map.d_max),
        _ => (),
    }
    let index = index.filter(|_| block.model.drive.plant.flux_map == before);
    if let Some(index) = index {
        match PmsmDriveMean::TABLE.entry(&mut block, index)? {
            (meta, Slot::Real(x)) => *x = another(meta, *x),
            (_, Slot::Integer(x)) => assert!(x.set(x.get() + 1) || x.set(x.get() - 1)),
            (_, Slot::Boolean(x)) => *x = !*x,
            (_, Slot::Enumeration(x)) => assert!(x.set(x.get() + 1) || x.set(1) && x.get() != 2),
            _ => return None,
        }
    }
    let inputs = &mut block.model.inputs;
    (inputs.u_dc, inputs.tau_ref, inputs.speed_shaft) = (400.0, if case == 4 { 0.0 } else { 190.0 }, 430.0);
    (inputs.speed_ref, inputs.tau_load) = (40.0, 0.7);
    if case == LINKED || case == OVER {
        inputs.tau_ref = -60.0;
    }
    if case == FAST {
        inputs.speed_shaft = 1300.0;
    }
    if case == MODES {
        (inputs.modes.tau_max, inputs.modes.tau_min) = (1.0, -1.0);
    }
    block.initialize();
    block.model.validate().ok()?;
    let mut now = Elapsed::ZERO;
    let mut bits = Vec::new();
    for k in 0..60 {
        if k == 20 {
            // The chopper is always on at first, and switches later.
            let later = if case == LINKED { -45.0 } else { -70.0 };
            let back = [LINKED, OVER, BATTERY, MODES].contains(&case);
            block.model.inputs.tau_ref = if back { later } else { 60.0 };
        }
        block.model.inputs.modes.brake = case == MODES && k >= 40;
        let step = Step { start: now, h: 3e-3 };
        block.step(&step).ok()?;
        now = step.end();
        for index in 0..PmsmDriveMean::TABLE.len() {
            let Some((meta, Slot::Real(x))) = PmsmDriveMean::TABLE.entry(&mut block, index) else { continue };
            if matches!(meta.causality, Causality::Output | Causality::Local) {
                bits.push(x.to_bits());
            }
        }
    }
    Some(bits)
}

/// The descriptions state the effect of each parameter correctly.
#[test]
fn parameters_have_an_effect_or_say_that_they_have_none() {
    let plain: [_; CASES] = std::array::from_fn(|case| with_moved(None, case).unwrap());
    let mut idle = Vec::new();
    for index in 0..PmsmDriveMean::TABLE.len() {
        let Some((name, meta, element)) = PmsmDriveMean::TABLE.locate(index) else { continue };
        if element > 0 || meta.causality != Causality::Parameter {
            continue;
        }
        let moved: [_; CASES] = std::array::from_fn(|case| with_moved(Some(index), case));
        let same = moved.iter().zip(&plain).all(|(moved, plain)| moved.as_ref().is_none_or(|bits| bits == plain));
        let tried = moved.iter().any(Option::is_some);
        if !PmsmDriveMean::has_effect(&name) {
            assert!(same && tried, "{name} has an effect, or is refused");
        } else if same && tried {
            idle.push(name);
        }
    }
    assert!(idle.is_empty(), "{idle:?} have no effect here");
}

#[test]
fn a_request_beyond_the_limits_is_clipped_and_told() {
    let (plant, controller) = traction();
    for (tau_ref, clipped) in [(100.0, false), (200.0, true)] {
        let mut block = PmsmDriveMean::new(&plant, &controller);
        let set = |_, i: &mut DriveInputs| (i.u_dc, i.tau_ref, i.speed_shaft) = (400.0, tau_ref, 630.0);
        run(&mut block, 1.05, 0.01, set, |_, _| ());
        let out = &block.out.drive.controller;
        assert_eq!((out.current_limited, out.voltage_limited), (clipped, false), "{out:?}");
        assert!(out.weakens && out.tau_max < 110.0 && out.tau_max > 100.0, "{out:?}");
        let mut messages = Vec::new();
        let mut sink = |(_, key, message): fmu_core::log::Said<'_>| messages.push((key, message()));
        block.model.warn(&mut Warnings::to(&mut sink));
        assert_eq!(messages.iter().any(|(key, text)| *key == "tau_ref" && text.contains("tau_ref = 200 N.m")), clipped);
    }
}
