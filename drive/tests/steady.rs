//! The algebra of the steady state against an independent calculation and against a settled drive.

use crate::lossy::{Drive, Figures, SILICON_CARBIDE};
use crate::machines::{Machine, RPM, envelope_figures, inside_figures};
use crate::{lossy, machines, random_machines};
use drive::PmsmDrive;
use drive::control::reference::max_torque_per_ampere;
use drive::frame::Dq;
use drive::motor::Motor;
use drive::plant::power::Powers;
use drive::plant::tables::PlantParameters;
use drive::plant::thermal::Temperatures;
use drive::steady::{At, Condition, Diodes, Point, Region, Steady};
use fmu_core::{Block, Elapsed, Model, Step};

/// A machine without iron, inverter and friction losses.
fn bare(machine: &Machine) -> Steady {
    let mut plant = PlantParameters { motor: machine.motor.clone(), ..PlantParameters::default() };
    (plant.mechanics.B, plant.mechanics.tau_coulomb) = (0.0, 0.0);
    Steady::new(plant, machine.parameters())
}

/// A machine with all losses.
fn lossy(drive: &Drive, machine: &Machine) -> Steady {
    Steady::new(drive.par.clone(), machine.parameters())
}

fn all() -> [(Drive, Machine, &'static [Figures]); 3] {
    [
        (lossy::a(), machines::a(), &lossy::A),
        (lossy::b(), machines::b(), &lossy::B),
        (lossy::c(), machines::c(240.0), &lossy::C),
    ]
}

fn at(drive: &Steady, rpm: f64, u_dc: f64) -> At<'_> {
    drive.at(&Condition { speed: rpm * RPM, u_dc, temperatures: drive.start_temperatures() })
}

fn losses(powers: &Powers) -> [f64; 5] {
    let l = &powers.losses;
    [l.cu, l.iron, l.cond, l.sw, l.friction]
}

#[test]
fn the_loss_split_of_three_machines() {
    for (drive, machine, figures) in all() {
        let steady = lossy(&drive, &machine);
        for &(rpm, torque, [i_d, i_q], wanted, p_in, efficiency) in figures {
            let point = at(&steady, rpm, drive.u_dc).by_shaft(torque).unwrap();
            let got = losses(&point.powers);
            println!("{rpm} rpm, {torque} N.m: {:?}, {got:.4?} of {wanted:?}, {}", point.i, point.efficiency);
            let digits = if machine.i > 100.0 { 6e-4 } else { 6e-5 };
            let off = point.i - Dq::new(i_d, i_q);
            assert!(off.d().abs() < digits && off.q().abs() < digits, "{rpm} rpm, {torque} N.m: {:?}", point.i);
            for (got, wanted) in got.iter().zip(wanted) {
                assert!((got - wanted).abs() <= 5e-4 * wanted, "{rpm} rpm, {torque} N.m: {got} W, not {wanted} W");
            }
            assert!((point.powers.p_in / p_in - 1.0).abs() < 2e-6, "{} W, not {p_in} W", point.powers.p_in);
            assert!((point.efficiency - efficiency).abs() < 1e-5, "{}, not {efficiency}", point.efficiency);
            assert!((point.powers.tau_shaft / torque - 1.0).abs() < 1e-9);
            assert!((point.powers.i_dc * drive.u_dc / p_in - 1.0).abs() < 2e-6);
            // The other direction of rotation is the mirror image.
            let mirrored = at(&steady, -rpm, drive.u_dc).by_shaft(-torque).unwrap();
            assert!((mirrored.powers.p_in / point.powers.p_in - 1.0).abs() < 1e-9);
            assert!((mirrored.i - Dq::new(point.i.d(), -point.i.q())).magnitude() < 1e-9 * machine.i);
        }
    }
}

#[test]
fn silicon_carbide() {
    let (drive, torques) = (lossy::c_sic(), [80.0, 25.0]);
    let steady = lossy(&drive, &machines::c(240.0));
    for ((rpm, _, [cond, sw], efficiency), torque) in SILICON_CARBIDE.into_iter().zip(torques) {
        let point = at(&steady, rpm, drive.u_dc).by_shaft(torque).unwrap();
        let found = point.powers.losses;
        println!("{rpm} rpm: {} W, {} W, {}", found.cond, found.sw, point.efficiency);
        assert!((found.cond / cond - 1.0).abs() < 5e-4 && (found.sw / sw - 1.0).abs() < 5e-4);
        assert!((point.efficiency - efficiency).abs() < 1e-5);
    }
}

#[test]
fn the_envelope() {
    for (machine, rpm, motoring, generating) in envelope_figures() {
        let steady = bare(&machine);
        let [least, most] = at(&steady, rpm, machine.u_dc).ends();
        let digits = if motoring > 100.0 { 6e-4 } else { 6e-5 };
        for (point, figure) in [(most, motoring), (least, -generating)] {
            let Point { powers, tau_ref, i, u_share, region, .. } = point;
            assert!((powers.tau_shaft - figure).abs() < digits, "{rpm} rpm: {} N.m, not {figure}", powers.tau_shaft);
            assert!((tau_ref - powers.tau_shaft).abs() < 1e-9 && u_share < 0.95 + 1e-9, "{tau_ref} N.m, {u_share}");
            let on_the_circle = i.magnitude() > machine.i * (1.0 - 1e-6);
            assert_eq!(region == Region::Limit, on_the_circle, "{rpm} rpm: {region:?}");
        }
        assert!(at(&steady, rpm, machine.u_dc).by_shaft(1.001 * motoring).is_none());
        assert!(at(&steady, rpm, machine.u_dc).by_shaft(-1.001 * generating).is_none());
        let again = at(&steady, rpm, machine.u_dc).by_shaft(most.powers.tau_shaft).unwrap();
        assert_eq!(again.region, most.region);
        assert!(at(&steady, rpm, machine.u_dc).by_shaft(f64::NAN).is_none());
    }
    for (machine, rpm) in [(machines::a(), 999.14), (machines::b(), 3330.11), (machines::c(240.0), 3075.23)] {
        let steady = bare(&machine);
        let base = steady.base_speed(machine.u_dc) / RPM;
        assert!((base - rpm).abs() < 6e-3, "{base} rpm, not {rpm}");
    }
    for (machine, rpm) in [(machines::a(), 1821.0), (machines::b(), 3982.0), (machines::c(240.0), 11138.0)] {
        let speed = bare(&machine).diode_speed(machine.u_dc, 293.15) / RPM;
        assert!((speed - rpm).abs() < 1.0, "{speed} rpm, not {rpm}");
    }
    let beyond = at(&bare(&machines::b()), 5400.0, 325.0).ends().map(|point| point.tau_ref);
    assert!(beyond[1] == 0.0, "no torque above the maximum speed: {beyond:?}");
}

#[test]
fn points_inside() {
    for (machine, rpm, tau, i_d, i_q, weakens) in inside_figures() {
        let point = at(&bare(&machine), rpm, machine.u_dc).by_reference(tau);
        let error = (point.i - Dq::new(i_d, i_q)).magnitude() / machine.i;
        let region = if weakens { Region::Weakening } else { Region::Mtpa };
        assert!(error < 1e-4 && point.region == region, "{rpm} rpm {tau} N.m: {point:?}");
        assert!((point.tau_e - tau).abs() < 1e-9);
    }
}

#[test]
fn the_steady_temperatures() {
    // Coolant, T_winding, T_stator, T_magnet in degC and p_cu in W, without the friction's heat; the magnet keeps its flux.
    let figures = [
        (1500.0, [-0.9792, 5.6996], 20.0, [87.380, 68.345, 72.454], 228.42, [12.0, 6.0, 1.5]),
        (3000.0, [0.0, 3.8776], 40.0, [133.570, 100.950, 103.583], 65.24, [2.0, 1.2, 0.3]),
        (3000.0, [-92.549, 126.193], 65.0, [86.204, 72.316, 75.619], 833.27, [60.0, 150.0, 8.0]),
    ];
    for ((drive, machine, _), (rpm, [i_d, i_q], coolant, wanted, p_cu, [ws, sc, sr])) in all().into_iter().zip(figures)
    {
        let mut steady = lossy(&drive, &machine);
        let plant = &mut steady.plant;
        [plant.mechanics.B, plant.mechanics.tau_coulomb, plant.mechanics.k_w] = [0.0; 3];
        plant.thermal.alpha_R = 3.93e-3;
        let network = &mut plant.thermal.network;
        (network.G_ws, network.G_sc, network.G_sr, network.G_inverter) = (ws, sc, sr, 20.0);
        let held = |at: &At<'_>| Some(at.by_current(Dq::new(i_d, i_q)));
        let (found, point) = steady.warmed(rpm * RPM, drive.u_dc, coolant + 273.15, held).unwrap();
        let Temperatures { winding, stator, magnet, inverter } = found;
        println!("{found:?} K, {:?}", point.powers.losses);
        for (got, wanted) in [winding, stator, magnet].iter().zip(wanted) {
            assert!((got - 273.15 - wanted).abs() < 0.01, "{} degC, not {wanted} degC", got - 273.15);
        }
        assert!((point.powers.losses.cu / p_cu - 1.0).abs() < 1e-4, "{} W, not {p_cu}", point.powers.losses.cu);
        let hot = (point.powers.losses.cond + point.powers.losses.sw) / 20.0;
        assert!((inverter - 273.15 - coolant - hot).abs() < 1e-6, "{inverter} K");
        // Above a current, the winding runs away: p alpha (1/G_ws + 1/G_sc) >= 1.
        let p = p_cu / (1.0 + 3.93e-3 * (wanted[0] - 20.0));
        let most = 1.0 / (3.93e-3 * p * (1.0 / ws + 1.0 / sc)).sqrt();
        let times = |k: f64| move |at: &At<'_>| Some(at.by_current(Dq::new(k * i_d, k * i_q)));
        assert!(steady.warmed(rpm * RPM, drive.u_dc, coolant + 273.15, times(0.9 * most)).is_some());
        assert!(steady.warmed(rpm * RPM, drive.u_dc, coolant + 273.15, times(1.01 * most)).is_none());
    }
}

/// Means over the second half of a run of PmsmDrive at constant speed (rad/s) and torque reference (N.m): p_in, the five losses,
/// torque at the shaft, and u_share and the limits at the end.
fn settled(steady: &Steady, speed: f64, u_dc: f64, tau_ref: f64) -> ([f64; 7], f64, [f64; 2]) {
    let mut block = Block::<PmsmDrive>::default();
    let pair = &mut block.model.pair;
    pair.plant.model.parameters = steady.plant.clone();
    pair.plant.model.parameters.mechanics.imposed = true;
    pair.controller.model.parameters = steady.controller.clone();
    pair.controller.model.parameters.speed_loop.torque_mode = true;
    let inputs = &mut block.model.inputs;
    (inputs.speed_shaft, inputs.u_dc, inputs.tau_ref) = (speed, u_dc, tau_ref);
    block.initialize();
    block.model.validate().unwrap();
    let (mut now, mut sum, count) = (Elapsed::ZERO, [0.0; 7], 10_000_u32);
    for k in 0..2 * count {
        block.model.inputs.angle_shaft = speed * now.seconds();
        let step = Step { start: now, h: 1e-4 };
        block.step(&step).unwrap();
        now = step.end();
        if k >= count {
            let powers = &block.out.plant.powers;
            let [cu, iron, cond, sw, friction] = losses(powers);
            let values = [powers.p_in, cu, iron, cond, sw, friction, powers.tau_shaft];
            for (sum, value) in sum.iter_mut().zip(values) {
                *sum += value / f64::from(count);
            }
        }
    }
    let out = &block.out.controller;
    (sum, out.u_share, [out.tau_min, out.tau_max])
}

/// The power within 0.05 % and each loss within 0.2 % of a settled drive with a sensor.
#[test]
fn points_of_a_settled_drive() {
    let b = |torque_reference| (lossy::b(), machines::b(), 2000.0, torque_reference);
    let cases = [
        (lossy::a(), machines::a(), 700.0, 14.0),
        (lossy::a(), machines::a(), 1900.0, -10.0),
        b(2.0),
        b(-3.0),
        (lossy::c(), machines::c(240.0), 1000.0, 100.0),
        (lossy::c(), machines::c(240.0), 4000.0, -90.0),
        (lossy::c(), machines::c(240.0), 7000.0, 30.0),
        (lossy::c(), machines::c(240.0), -3000.0, 80.0),
        (lossy::c(), machines::c(240.0), 10_000.0, -30.0),
        (lossy::c(), machines::c(400.0), 9000.0, 100.0),
    ];
    for (drive, machine, rpm, tau_ref) in cases {
        let steady = lossy(&drive, &machine).sampled();
        let point = at(&steady, rpm, drive.u_dc).by_reference(tau_ref);
        compare(&steady, rpm, drive.u_dc, tau_ref, &point);
    }
}

fn compare(steady: &Steady, rpm: f64, u_dc: f64, tau_ref: f64, point: &Point) {
    let ([p_in, five @ .., tau], u_share, limits) = settled(steady, rpm * RPM, u_dc, tau_ref);
    let got = losses(&point.powers);
    println!(
        "{rpm} rpm, {tau_ref} N.m: {:.3} of {p_in:.3} W ({:+.3} %), {got:.3?} of {five:.3?}, {:.4} of {tau:.4} N.m, u_share {:.4} of {u_share:.4}, {:?}",
        point.powers.p_in,
        100.0 * (point.powers.p_in / p_in - 1.0),
        point.powers.tau_shaft,
        point.u_share,
        point.region,
    );
    assert!((point.powers.p_in / p_in - 1.0).abs() < 5e-4, "{} W, not {p_in} W", point.powers.p_in);
    for (got, wanted) in got.iter().zip(five) {
        assert!((got - wanted).abs() <= 2e-3 * wanted.abs(), "{got} W, not {wanted} W");
    }
    assert!((point.powers.tau_shaft / tau - 1.0).abs() < 1e-3, "{} N.m, not {tau} N.m", point.powers.tau_shaft);
    for (got, wanted) in point.limits.iter().zip(limits) {
        assert!((got / wanted - 1.0).abs() < 1e-3, "limits {:?}, not {limits:?}", point.limits);
    }
}

/// At 36 V, the diode drop of 0.7 V matters in the legs' voltage: without it, the conduction loss is 2 % too high.
#[test]
fn the_drop_of_the_devices_is_in_the_legs() {
    let motor = Motor { n_p: 15, R_s: 0.2, L_d: 0.35e-3, L_q: 0.35e-3, psi_M: 0.0155 };
    let machine = Machine { motor, i: 25.0, u_dc: 36.0, J: 0.01 };
    let mut steady = bare(&machine).sampled();
    let devices = &mut steady.plant.inverter.devices;
    (devices.r_transistor, devices.u_diode, devices.r_diode) = (5e-3, 0.7, 5e-3);
    for (rpm, tau_ref) in [(573.0, 5.2), (430.0, -6.9), (239.0, -1.7)] {
        let point = at(&steady, rpm, machine.u_dc).by_reference(tau_ref);
        let ([p_in, _, _, cond, ..], ..) = settled(&steady, rpm * RPM, machine.u_dc, tau_ref);
        let size = 1.5 * point.u.magnitude() * point.i.magnitude();
        println!("{rpm} rpm: {} of {cond} W, {} of {p_in} W", point.powers.losses.cond, point.powers.p_in);
        assert!((point.powers.losses.cond / cond - 1.0).abs() < 1e-2, "{} W, not {cond} W", point.powers.losses.cond);
        assert!((point.powers.p_in - p_in).abs() < 1e-3 * size, "{} W, not {p_in} W", point.powers.p_in);
    }
}

/// Saturation, AC copper loss, a warm machine and wrong estimates, with the trim of field weakening active.
#[test]
fn points_of_a_drive_that_is_not_as_its_controller_thinks() {
    let (drive, machine) = (lossy::a(), machines::a());
    let mut steady = lossy(&drive, &machine).sampled();
    let plant = &mut steady.plant;
    (plant.saturation.s_2, plant.saturation.s_3, plant.saturation.s_dq) = (4.0, 12.0, 4.0);
    plant.winding.k_ac = 4e-7;
    (plant.thermal.alpha_R, plant.thermal.alpha_psi, plant.thermal.T_start) = (3.93e-3, -1.1e-3, 353.15);
    for (rpm, tau_ref) in [(600.0, 20.0), (1500.0, -12.0), (2200.0, 15.0)] {
        let point = at(&steady, rpm, drive.u_dc).by_reference(tau_ref);
        compare(&steady, rpm, drive.u_dc, tau_ref, &point);
    }
    let mut wrong = lossy(&drive, &machine).sampled();
    wrong.controller.motor.L_q *= 0.8;
    wrong.derive();
    for (rpm, tau_ref) in [(1500.0, 38.0), (2500.0, 30.0)] {
        let point = at(&wrong, rpm, drive.u_dc).by_reference(tau_ref);
        assert!((point.u_share - 0.98).abs() < 1e-8, "the trim holds k_t: {}", point.u_share);
        compare(&wrong, rpm, drive.u_dc, tau_ref, &point);
    }
}

/// Rasmussen's i_d at low speed causes copper loss, which the algebra includes.
#[test]
fn the_low_speed_law_acts() {
    let mut steady = bare(&machines::b());
    steady.controller = drive::control::tables::ControllerParameters::default();
    steady.controller.motor.R_s = 2.0;
    steady.derive();
    let still = at(&steady, 0.0, 325.0).by_reference(0.0);
    assert!((still.i - Dq::new(5.0, 0.0)).magnitude() < 1e-12 && (still.powers.p_in - 1.5 * 2.0 * 25.0).abs() < 1e-9);
    let fast = at(&steady, 1000.0, 325.0).by_reference(1.0);
    assert!(fast.i.d() < 1e-3 && (fast.i.q() - 1.0 / 0.675).abs() < 1e-6, "{:?}", fast.i);
}

#[test]
fn without_field_weakening_the_voltage_limits_the_torque() {
    let machine = machines::a();
    let mut steady = bare(&machine);
    steady.controller.weakening.used = false;
    steady.derive();
    let below = at(&steady, 900.0, machine.u_dc).by_reference(30.0);
    assert!((below.tau_e - 30.0).abs() < 1e-9 && below.region == Region::Mtpa);
    let beyond = at(&steady, 1500.0, machine.u_dc).by_reference(30.0);
    assert!(beyond.tau_e < 29.0 && beyond.tau_e > 5.0 && (beyond.u_share - 1.0).abs() < 1e-9, "{beyond:?}");
    assert_eq!(beyond.region, Region::Limit);
    // A settled drive has that torque too, except at the corners of the hexagon.
    let none = at(&steady, 2500.0, machine.u_dc).by_reference(30.0);
    assert!(none.tau_e.abs() < 1e-12, "the EMF is above the voltage: {none:?}");
    for weakening in [false, true] {
        steady.controller.weakening.used = weakening;
        steady.derive();
        let dead = at(&steady, 900.0, 0.0).by_reference(30.0);
        assert!(dead.tau_e.abs() < 1e-9 && dead.u_share == 0.0 && dead.powers.i_dc == 0.0, "no link: {dead:?}");
    }
}

#[test]
fn gates_off_iron_and_friction_brake() {
    for (drive, machine, rpm, watt, torque) in [
        (lossy::a(), machines::a(), 1500.0, 53.35, -0.33964),
        (lossy::c(), machines::c(240.0), 8000.0, 205.94, -0.85374),
    ] {
        let steady = lossy(&drive, &machine);
        let point = at(&steady, rpm, drive.u_dc).off(Diodes::Blocked);
        assert!((point.powers.losses.iron / watt - 1.0).abs() < 5e-5, "{:?}", point.powers);
        assert!((point.powers.tau_shaft - torque).abs() < 1e-5 && point.powers.p_in == 0.0, "{:?}", point.powers);
        let balance = point.powers.p_mech + point.powers.p_loss;
        assert!(balance.abs() < 1e-9 * point.powers.p_loss, "{balance} W");
    }
}

/// The input power, also computed as 1.5 u i, is the shaft power plus the losses.
#[test]
fn the_powers_are_balanced() {
    for (drive, machine, _) in all() {
        let steady = lossy(&drive, &machine);
        for rpm in [-4000.0, -300.0, 0.0, 1.0, 700.0, 3100.0] {
            for share in [-1.0, -0.4, 0.0, 0.3, 1.0] {
                let at = at(&steady, rpm, drive.u_dc);
                let [least, most] = at.limits();
                let point = at.by_reference(if share < 0.0 { -share * least } else { share * most });
                let Powers { p_in, losses, .. } = point.powers;
                let electric = 1.5 * point.u.dot(point.i) + losses.cond + losses.sw;
                let size = p_in.abs() + losses.sum();
                assert!((p_in - electric).abs() <= 1e-12 * size, "{rpm} rpm, {share}: {p_in} W, {electric} W");
                assert!(point.efficiency.is_finite() && losses.sum().is_finite());
            }
        }
    }
}

/// Maximum torques of machines with R i up to 0.6 of the link's voltage, with and without field weakening, against brute force.
#[test]
fn the_limits_of_random_machines() {
    for machine in random_machines::all() {
        let (motor, mut steady) = (&machine.motor, bare(&machine));
        for w in random_machines::speeds(&machine) {
            let speed = w / f64::from(motor.n_p);
            let under = |U| random_machines::Brute { motor, I: machine.i, w, U };
            (steady.controller.weakening.used, steady.controller.weakening.bandwidth) = (true, 0.0);
            steady.derive();
            let condition = Condition { speed, u_dc: machine.u_dc, temperatures: steady.start_temperatures() };
            let ends = steady.at(&condition).ends();
            let most = steady.at(&Condition { speed: 0.0, u_dc: 1e9, ..condition }).limits()[1];
            for (end, s) in ends.into_iter().zip([-1.0, 1.0]) {
                let (wanted, _) = under(machine.U(0.95)).limit(s);
                assert!(
                    (s * end.tau_e - wanted).abs() < 1e-6 * most,
                    "{motor:?}, {w} rad/s, {s}: {end:?}, not {wanted}"
                );
            }
            // Without it: along the plain references.
            steady.controller.weakening.used = false;
            steady.derive();
            let (brute, at) = (under(machine.U(1.0)), steady.at(&condition));
            for s in [-1.0, 1.0] {
                let fits = |share: f64| {
                    let i = max_torque_per_ampere(motor, s * share * most);
                    brute.voltage([i.d(), i.q()]) <= brute.U * (1.0 + 1e-12)
                };
                let last = (0..=2000).rev().map(|k| f64::from(k) / 2000.0).find(|&share| fits(share)).unwrap_or(0.0);
                let (tau, found) = (last * most, s * at.by_reference(s * most).tau_e);
                assert!(
                    found > tau - 1e-6 * most && found < tau + 6e-4 * most,
                    "{motor:?}, {w} rad/s, {s}: {found}, not {tau}"
                );
            }
        }
    }
}
