//! Temperatures in plant and drive: R_s(T) and psi_M(T), the network with the losses of three operating points, the
//! drive against the pair, imposed temperatures, and what is refused.
//!
//! The figures are an independent calculation for three machines: a, the 2.2 kW machine of Kim & Sul; b, the reference
//! motor; c, a traction machine (gym-electric-motor's default, which cites DOI 10.1109/TPEL.2020.3006779). The thermal
//! parameters are assumed.

use drive::control::current::CurrentLoop;
use drive::control::envelope::{Envelope, Limit, WarmStart};
use drive::control::limits::Limits;
use drive::estimator::Kind;
use drive::frame::{AlphaBeta, Phases};
use drive::motor::Motor;
use drive::plant::power::Powers;
use drive::plant::thermal::network::Network;
use drive::plant::thermal::{Temperatures, Thermal, ThermalInputs, ThermalMode};
use drive::{Pair, PmsmDrive, PmsmDriveMean, PmsmPlant};
use fmu_core::log::Warnings;
use fmu_core::{Block, ContinuousTime, Elapsed, Events, Interface, Model, Step, Warns};

const RPM: f64 = std::f64::consts::PI / 30.0;
const ZERO: f64 = 273.15;

fn thermal() -> Thermal {
    Thermal { alpha_R: 3.93e-3, alpha_psi: -1.1e-3, ..Thermal::default() }
}

fn traction() -> Motor {
    Motor { n_p: 3, R_s: 18e-3, L_d: 0.37e-3, L_q: 1.2e-3, psi_M: 66e-3 }
}

#[test]
fn the_envelope_at_temperature() {
    // A hot magnet costs torque; it raises the base speed of c.
    let figures = [
        (Motor::IPMSM_2_2_KW, 15.0, 540.0, 3000.0, [14.703, 17.853], [35.649, 40.992]),
        (traction(), 240.0, 400.0, 9000.0, [66.815, 73.071], [154.543, 163.054]),
    ];
    for (motor, i, u_dc, rpm, limits, ends) in figures {
        let U = 0.95 * u_dc / 3.0_f64.sqrt();
        for ((celsius, limit), end) in [120.0, -20.0].into_iter().zip(limits).zip(ends) {
            let motor = thermal().motor(&motor, &Temperatures::all(celsius + ZERO));
            let envelope = Envelope::new(&motor, i);
            let mut warm = WarmStart::default();
            let mut at = |rpm: f64| (0..8).map(|_| envelope.limit(3.0 * rpm * RPM, 1.0, U, &mut warm)).last().unwrap();
            let (Limit { tau, .. }, Limit { tau: mtpa, i: full }) = (at(rpm), at(100.0));
            println!("{celsius} degC, {rpm} rpm: {tau} of {limit} N.m; {mtpa} of {end} N.m");
            assert!((tau - limit).abs() < 6e-4 && (mtpa - end).abs() < 6e-4, "{tau} {limit}, {mtpa} {end}");
            if celsius > 100.0 && i > 100.0 {
                let (mut low, mut high) = (1000.0, 6000.0);
                for _ in 0..50 {
                    let mid = 0.5 * (low + high);
                    *(if envelope.excess(full, 3.0 * mid * RPM, U) <= 0.0 { &mut low } else { &mut high }) = mid;
                }
                println!("base speed {low} of 3089.9 rpm");
                assert!((low - 3089.9).abs() < 0.06, "{low} rpm");
            }
        }
    }
}

/// An operating point of the figures: machine, link, speed, torque at the shaft, network; coolant in degC and the losses
/// of copper at 20 degC and of the iron in W; temperatures in degC, steady and after 600 s.
struct Figures {
    motor: Motor,
    u_dc: f64,
    rpm: f64,
    torque: f64,
    network: Network,
    coolant: f64,
    losses: [f64; 2],
    steady: [f64; 3],
    late: [f64; 3],
}

fn network([C_winding, C_stator, C_rotor, G_ws, G_sc, G_sr]: [f64; 6]) -> Network {
    Network { C_winding, C_stator, C_rotor, C_inverter: 500.0, G_ws, G_sc, G_sr, G_inverter: 20.0 }
}

fn points() -> [Figures; 3] {
    [
        Figures {
            motor: Motor::IPMSM_2_2_KW,
            u_dc: 540.0,
            rpm: 1500.0,
            torque: 14.0,
            network: network([1200.0, 6000.0, 2500.0, 12.0, 6.0, 1.5]),
            coolant: 20.0,
            losses: [180.60, 61.64],
            steady: [87.380, 68.345, 72.454],
            late: [48.461, 34.181, 23.493],
        },
        Figures {
            motor: Motor::default(),
            u_dc: 325.0,
            rpm: 3000.0,
            torque: 2.5,
            network: network([150.0, 900.0, 250.0, 2.0, 1.2, 0.3]),
            coolant: 40.0,
            losses: [45.11, 7.90],
            steady: [133.570, 100.950, 103.583],
            late: [88.172, 62.338, 47.841],
        },
        Figures {
            motor: traction(),
            u_dc: 400.0,
            rpm: 3000.0,
            torque: 80.0,
            network: network([2500.0, 12_000.0, 6000.0, 60.0, 150.0, 8.0]),
            coolant: 65.0,
            losses: [661.23, 264.18],
            steady: [86.204, 72.316, 75.619],
            late: [85.787, 71.957, 69.999],
        },
    ]
}

impl Figures {
    /// The drive on a shaft at constant speed, in torque mode with a sensor and exact estimates.
    fn drive(&self) -> Block<PmsmDrive> {
        let mut drive = Block::<PmsmDrive>::default();
        let Pair { plant, controller, .. } = &mut drive.model.pair;
        let par = &mut plant.model.parameters;
        (par.motor, par.mechanics.imposed, par.iron.G_e) = (self.motor.clone(), true, 1e-4);
        // Friction heats no node of the figures.
        (par.mechanics.B, par.mechanics.tau_coulomb) = (0.0, 0.0);
        (par.thermal.alpha_R, par.thermal.network) = (3.93e-3, self.network.clone());
        let par = &mut controller.model.parameters;
        (par.motor, par.estimator, par.speed_loop.torque_mode) = (self.motor.clone(), Kind::Sensored, true);
        par.limit = Limits { i: 400.0, i_q: 400.0, tau: 1e4 };
        par.current = CurrentLoop { mtpa: true, active_resistance: true, ..CurrentLoop::default() };
        drive.model.inputs.u_dc = self.u_dc;
        drive
    }

    /// Runs for a time in s, in steps of 1 ms.
    fn run(&self, drive: &mut Block<PmsmDrive>, seconds: f64) {
        let mut now = drive.model.pair.now;
        let until = now.plus(seconds);
        while until.since(now) > 1e-6 {
            let inputs = &mut drive.model.inputs;
            (inputs.speed_shaft, inputs.angle_shaft) = (self.rpm * RPM, self.rpm * RPM * now.seconds());
            let step = Step { start: now, h: 1e-3 };
            drive.step(&step).unwrap();
            now = step.end();
        }
    }

    /// The drive with the losses of the figures, settled at 20 degC, by adjusting the torque reference and the conductance of
    /// the iron.
    fn settled(&self) -> Block<PmsmDrive> {
        let [p_20, p_iron] = self.losses;
        let (mut tau, mut G_e) = (self.torque, 1e-4);
        loop {
            let mut drive = self.drive();
            drive.model.pair.plant.model.parameters.iron.G_e = G_e;
            drive.model.inputs.tau_ref = tau;
            drive.initialize();
            self.run(&mut drive, 0.1);
            let Powers { losses, .. } = drive.out.plant.powers;
            let (copper, iron) = (losses.cu / p_20, losses.iron / p_iron);
            if (copper - 1.0).abs() < 1e-8 && (iron - 1.0).abs() < 1e-8 {
                return drive;
            }
            tau /= copper.sqrt();
            G_e /= iron;
        }
    }

    /// The temperatures (degC) of the network after a time in s, shortened by the factor `faster` with smaller capacities.
    fn heated(&self, settled: &Block<PmsmDrive>, seconds: f64, faster: f64) -> [f64; 3] {
        let mut drive = settled.clone();
        let plant = &mut drive.model.pair.plant.model;
        plant.parameters.thermal.T_start = self.coolant + ZERO;
        drive.model.inputs.thermal.coolant = self.coolant + ZERO;
        // The currents settle at the temperature of the coolant before the network begins.
        drive.initialize();
        self.run(&mut drive, 0.1);
        let thermal = &mut drive.model.pair.plant.model.parameters.thermal;
        thermal.mode = ThermalMode::Network;
        let Network { C_winding, C_stator, C_rotor, C_inverter, .. } = &mut thermal.network;
        for C in [C_winding, C_stator, C_rotor, C_inverter] {
            *C /= faster;
        }
        self.run(&mut drive, seconds / faster);
        let Temperatures { winding, stator, magnet, .. } = drive.out.plant.temperatures;
        [winding - ZERO, stator - ZERO, magnet - ZERO]
    }
}

#[test]
fn the_plant_reaches_the_temperatures_of_the_figures() {
    for point in points() {
        let settled = point.settled();
        let found = [point.heated(&settled, 30_000.0, 1e3), point.heated(&settled, 600.0, 100.0)];
        println!(
            "steady {:.4?} of {:?}, after 600 s {:.4?} of {:?} degC",
            found[0], point.steady, found[1], point.late
        );
        for (found, wanted) in found.iter().flatten().zip([point.steady, point.late].iter().flatten()) {
            assert!((found - wanted).abs() < 0.01, "{found} degC, not {wanted} degC");
        }
    }
}

/// Sets all losses and a network with short time constants.
fn quick(plant: &mut PmsmPlant) {
    let par = &mut plant.parameters;
    (par.iron.G_e, par.inverter.devices.r_transistor, par.inverter.devices.r_diode) = (1.3e-4, 0.08, 0.08);
    let network = Network { C_inverter: 0.2, G_inverter: 2.0, ..network([0.5, 3.0, 1.0, 2.0, 1.2, 0.3]) };
    par.thermal = Thermal { mode: ThermalMode::Network, T_start: 313.15, network, ..thermal() };
    par.initial.theta_e = std::f64::consts::PI;
    plant.inputs.thermal.coolant = 308.15;
}

#[test]
fn the_drive_with_the_network_is_the_pair_bit_for_bit() {
    let reference = |k: u32| if k < 500 { 0.0 } else { 50.0 };
    let mut pair = Pair::default();
    quick(&mut pair.plant.model);
    pair.start().unwrap();
    for k in 0..6000 {
        pair.set_inputs(reference(k), 0.5, 325.0);
        pair.step(1e-4).unwrap();
    }
    for samples in [1, 10, 100] {
        let mut drive = Block::<PmsmDrive>::default();
        quick(&mut drive.model.pair.plant.model);
        (drive.model.inputs.thermal.coolant, drive.model.inputs.tau_load) = (308.15, 0.5);
        drive.initialize();
        drive.model.validate().unwrap();
        let mut now = Elapsed::ZERO;
        for k in 0..6000 / samples {
            drive.model.inputs.speed_ref = reference(k * samples);
            let step = Step { start: now, h: 1e-4 * f64::from(samples) };
            drive.step(&step).unwrap();
            now = step.end();
            if k == 3000 / samples {
                // Saved and restored: the temperatures are part of the state.
                drive = drive.clone();
                assert!((drive.out.plant.temperatures.winding - 313.15).abs() > 1.0, "{:?}", drive.out.plant);
            }
        }
        assert_eq!(drive.out.plant, pair.plant.out, "{samples} samples a step");
    }
    let out = &pair.plant.out;
    println!("{:?} {:?} {} rad/s", out.temperatures, out.heat, out.speed);
    assert!(out.temperatures.winding > 316.0 && out.speed > 45.0, "{out:?}");
}

#[test]
fn the_heat_leaves_the_drive() {
    let mut drive = Block::<PmsmDrive>::default();
    quick(&mut drive.model.pair.plant.model);
    (drive.model.inputs.thermal.coolant, drive.model.inputs.tau_load, drive.model.inputs.speed_ref) =
        (308.15, 1.0, 60.0);
    let run = |drive: &mut Block<PmsmDrive>| {
        drive.initialize();
        let (mut now, mut to_coolant) = (Elapsed::ZERO, 0.0);
        for _ in 0..2000 {
            let before = drive.out.plant.heat.coolant;
            let step = Step { start: now, h: 1e-3 };
            drive.step(&step).unwrap();
            now = step.end();
            to_coolant += 0.5e-3 * (before + drive.out.plant.heat.coolant);
            let (heat, p_loss) = (&drive.out.plant.heat, drive.out.plant.powers.p_loss);
            let sum = heat.winding + heat.iron + heat.magnet + heat.inverter;
            assert!((sum - p_loss).abs() <= 1e-12 * p_loss.abs(), "{heat:?} of {p_loss} W");
        }
        to_coolant
    };
    // The lost energy is in the coolant or in the capacities.
    let to_coolant = run(&mut drive);
    let T = &drive.out.plant.temperatures;
    let stored =
        0.5 * (T.winding - 313.15) + 3.0 * (T.stator - 313.15) + (T.magnet - 313.15) + 0.2 * (T.inverter - 313.15);
    let lost = drive.out.plant.energy.loss;
    println!("{lost} J lost, {to_coolant} J to the coolant, {stored} J stored; {T:?}");
    assert!(
        (to_coolant + stored - lost).abs() < 1e-4 * lost && to_coolant > 0.1 * lost,
        "{to_coolant} {stored} {lost}"
    );
    // Without the network, all losses flow to the coolant at once; imposed, to the four parts.
    for (mode, share) in [(ThermalMode::Constant, 1.0), (ThermalMode::Imposed, 0.0)] {
        drive.model.pair.plant.model.parameters.thermal.mode = mode;
        run(&mut drive);
        let (Q, p_loss) = (drive.out.plant.heat.coolant, drive.out.plant.powers.p_loss);
        assert!((Q - share * p_loss).abs() < 1e-12 * p_loss && p_loss > 1.0, "{mode:?}: {Q} W of {p_loss} W");
    }
}

/// The plant with imposed temperatures (degC) of winding and magnets.
fn imposed(winding: f64, magnet: f64) -> Block<PmsmPlant> {
    let mut block = Block::<PmsmPlant>::default();
    block.model.parameters.thermal = Thermal { mode: ThermalMode::Imposed, ..thermal() };
    impose(&mut block, winding, magnet);
    block
}

fn impose(block: &mut Block<PmsmPlant>, winding: f64, magnet: f64) {
    let T = &mut block.model.inputs.thermal.imposed;
    (T.winding, T.magnet) = (winding + ZERO, magnet + ZERO);
}

fn run(block: &mut Block<PmsmPlant>, now: &mut Elapsed, seconds: f64) {
    let step = Step { start: *now, h: seconds };
    block.step(&step).unwrap();
    *now = step.end();
}

#[test]
fn imposed_temperatures_act_in_the_machine() {
    for (celsius, resistance, magnet) in
        [(-20.0, 0.84280, 1.0440), (80.0, 1.23580, 0.9340), (120.0, 1.39300, 0.8900), (150.0, 1.51090, 0.8570)]
    {
        // Voltage divided by current at standstill; EMF at speed without current. Both change from the next step on.
        let (mut still, mut now) = (imposed(20.0, 20.0), Elapsed::ZERO);
        still.model.parameters.mechanics.imposed = true;
        still.model.inputs.u = Phases::from_stator(AlphaBeta::new(4.0, 0.0));
        still.initialize();
        run(&mut still, &mut now, 0.2);
        assert!((still.out.i_d - 2.0).abs() < 1e-9, "{} A", still.out.i_d);
        impose(&mut still, celsius, 20.0);
        run(&mut still, &mut now, 0.2);
        println!("{celsius} degC: {} A", still.out.i_d);
        assert!((2.0 / still.out.i_d - resistance).abs() < 1e-9, "{} A", still.out.i_d);
        run(&mut still, &mut now, 1e-3);
        assert!((still.out.powers.losses.cu - 6.0 * still.out.i_d).abs() < 1e-4, "{:?}", still.out.powers);
        assert!((still.out.temperatures.winding - celsius - ZERO).abs() < 1e-9);

        let (mut coasting, mut now) = (imposed(20.0, 20.0), Elapsed::ZERO);
        coasting.model.inputs.enable = false;
        coasting.initialize();
        impose(&mut coasting, 20.0, celsius);
        run(&mut coasting, &mut now, 1e-3);
        let psi = *PmsmPlant::STATES[0].at(&mut coasting.model);
        assert!((psi / 0.15 - magnet).abs() < 1e-9 && coasting.out.i_d == 0.0, "{psi} Wb, {} A", coasting.out.i_d);
        // Blocking diodes also keep blocking in Model Exchange.
        let mut exchanged = imposed(20.0, 20.0);
        exchanged.model.inputs.enable = false;
        exchanged.initialize();
        exchanged.model.event(Elapsed::ZERO).unwrap();
        impose(&mut exchanged, 20.0, celsius);
        let mut z = [f64::NAN; 2];
        exchanged.model.indicators(Elapsed::ZERO, &mut z);
        exchanged.model.event(Elapsed::ZERO).unwrap();
        exchanged.model.observe(Elapsed::ZERO, &mut exchanged.out);
        assert!(z.iter().all(|&z| z < 0.0) && exchanged.out.i == Phases::default(), "{z:?}");
    }
}

#[test]
fn saturation_follows_the_magnet() {
    // With saturation, a machine at the flux linkage of its magnets still has no current.
    let (mut block, mut now) = (imposed(20.0, 140.0), Elapsed::ZERO);
    let saturation = &mut block.model.parameters.saturation;
    (saturation.s_2, saturation.s_3, saturation.s_dq) = (40.0, 40.0, 7.0);
    block.initialize();
    run(&mut block, &mut now, 1e-3);
    assert_eq!(block.out.i, Phases::default(), "{:?}", block.out);
}

#[test]
#[expect(clippy::float_cmp, reason = "exact numbers")]
fn temperatures_without_coefficients_change_nothing() {
    let run = |set: &dyn Fn(&mut PmsmDrive)| {
        let mut drive = Block::<PmsmDrive>::default();
        set(&mut drive.model);
        drive.model.inputs.speed_ref = 60.0;
        drive.initialize();
        let mut now = Elapsed::ZERO;
        for _ in 0..300 {
            let step = Step { start: now, h: 1e-3 };
            drive.step(&step).unwrap();
            now = step.end();
        }
        let out = drive.out.plant;
        [out.speed, out.i_d, out.i_q, out.powers.p_in, out.powers.p_loss, out.energy.loss]
    };
    let today = run(&|_| ());
    let imposed = run(&|drive| {
        drive.pair.plant.model.parameters.thermal.mode = ThermalMode::Imposed;
        drive.inputs.thermal.imposed = Temperatures::all(400.0);
    });
    assert_eq!(today, imposed);
    assert!(today[0] > 10.0, "{today:?}");
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |set: &dyn Fn(&mut PmsmPlant), parts: &[&str]| {
        let mut drive = Block::<PmsmDrive>::default();
        let plant = &mut drive.model.pair.plant.model;
        plant.parameters.thermal = thermal();
        set(plant);
        drive.model.inputs.thermal = plant.inputs.thermal;
        drive.initialize();
        let fault = drive.model.validate().expect_err("must be refused");
        println!("{fault}");
        assert!(fault.message().starts_with("plant."), "{fault}");
        assert!(parts.iter().all(|part| fault.message().contains(part)), "{parts:?}: {fault}");
    };
    refused(
        &|plant| plant.parameters.thermal.mode = ThermalMode::Network,
        &[
            "thermal.C_winding = 0 J/K is not allowed: greater than 0 with thermal.mode = 2 (Network)",
            "thermal.mode = 1",
        ],
    );
    let full = |plant: &mut PmsmPlant| {
        quick(plant);
        plant.parameters.thermal.network.C_inverter = 0.0;
    };
    refused(&full, &["thermal.C_inverter = 0 J/K"]);
    // 20 K instead of 20 degC.
    refused(&|plant| plant.parameters.thermal.T_start = 20.0, &["thermal.T_start = 20 K", "resistance", "20 degC"]);
    let hot = |plant: &mut PmsmPlant| {
        plant.parameters.thermal.mode = ThermalMode::Imposed;
        plant.inputs.thermal.imposed.magnet = 1300.0;
    };
    refused(&hot, &["T_magnet_imposed = 1300 K", "magnet.alpha = -0.0011 1/K", "flux linkage", "-0.016", "Wb"]);

    // Also in a step, where the refusal changes nothing.
    let (mut block, mut now) = (imposed(20.0, 20.0), Elapsed::ZERO);
    block.initialize();
    run(&mut block, &mut now, 1e-3);
    let before = block.model.clone();
    block.model.inputs.thermal.imposed.winding = 1.0;
    let fault = block.step(&Step { start: now, h: 1e-3 }).unwrap_err();
    assert!(fault.message().contains("T_winding_imposed = 1 K"), "{fault}");
    block.model.inputs = before.inputs.clone();
    assert_eq!(block.model, before);
    // A network that becomes too hot.
    let mut block = Block::<PmsmPlant>::default();
    quick(&mut block.model);
    block.model.parameters.thermal.network.G_sc = 0.0;
    block.model.parameters.mechanics.imposed = true;
    block.model.inputs.u = Phases::from_stator(AlphaBeta::new(150.0, 0.0));
    block.initialize();
    let mut now = Elapsed::ZERO;
    let fault = loop {
        let step = Step { start: now, h: 0.1 };
        now = step.end();
        if let Err(fault) = block.step(&step) {
            break fault;
        }
        assert!(now.seconds() < 10.0);
    };
    println!("{fault}");
    assert!(
        ["T_magnet = ", "reduce the current", "thermal.G_sc"].iter().all(|x| fault.message().contains(x)),
        "{fault}"
    );
}

#[test]
fn model_exchange_has_no_network() {
    let mut drive = PmsmDrive::default();
    quick(&mut drive.pair.plant.model);
    drive.validate_for(Interface::CoSimulation).unwrap();
    let fault = drive.validate_for(Interface::ModelExchange).unwrap_err();
    println!("{fault}");
    let message = fault.message();
    assert!(
        message.starts_with("plant.thermal.mode = 2 (Network) is not allowed: 1 (Constant) or 3 (Imposed)"),
        "{fault}"
    );
    for mode in [ThermalMode::Constant, ThermalMode::Imposed] {
        drive.pair.plant.model.parameters.thermal.mode = mode;
        drive.validate_for(Interface::ModelExchange).unwrap();
    }
    let mut block = imposed(20.0, 20.0);
    block.initialize();
    block.model.inputs.thermal.imposed.winding = 1.0;
    let fault = block.model.event(Elapsed::ZERO).unwrap_err();
    assert!(fault.message().contains("T_winding_imposed = 1 K"), "{fault}");
}

/// Degrees Celsius instead of K, degrees instead of rad, percent instead of 1, mJ instead of J: the run goes on, and the warning names
/// the value, mostly with both readings.
#[test]
fn values_in_another_unit_are_reported() {
    macro_rules! said {
        ($model:ty, $drive:ident => $set:expr) => {
            said!($model, $drive => $set, "80 deg", "80 K")
        };
        ($model:ty, $drive:ident => $set:expr, $text:literal, $other:literal) => {{
            let mut block = Block::<$model>::default();
            let $drive = &mut block.model;
            $set;
            block.initialize();
            block.step(&Step { start: Elapsed::ZERO, h: 1e-3 }).unwrap();
            let mut keys = Vec::new();
            block.model.warn(&mut Warnings::to(&mut |(_, key, text)| {
                if text().contains($text) || text().contains($other) {
                    keys.push(key);
                }
            }));
            keys
        }};
    }
    let imposed = |thermal: &mut Thermal, inputs: &mut ThermalInputs| {
        thermal.mode = ThermalMode::Imposed;
        inputs.imposed.winding = 80.0;
    };
    assert_eq!(said!(PmsmPlant, m => m.parameters.thermal.T_start = 80.0), ["thermal.T_start"]);
    assert_eq!(said!(PmsmPlant, m => m.parameters.initial.theta_e = 180.0), ["initial.theta_e"]);
    assert_eq!(said!(PmsmPlant, m => imposed(&mut m.parameters.thermal, &mut m.inputs.thermal)), ["T_winding_imposed"]);
    assert_eq!(said!(PmsmDrive, m => m.pair.plant.model.parameters.thermal.T_start = 80.0), ["thermal.T_start"]);
    assert_eq!(
        said!(PmsmDrive, m => imposed(&mut m.pair.plant.model.parameters.thermal, &mut m.inputs.thermal)),
        ["T_winding_imposed"]
    );
    assert_eq!(said!(PmsmDrive, m => (m.derating.used, m.derating.T_winding) = (true, 80.0)), ["limit.T_winding"]);
    assert_eq!(said!(PmsmDrive, m => m.pair.controller.model.parameters.theta_est = -180.0), ["initial.theta_est"]);
    macro_rules! inverter {
        ($model:ty, $drive:ident => $parameters:expr) => {
            assert_eq!(
                said!($model, $drive => $parameters.inverter.devices.E_sw = 25.0, "25 J in each", "25 J in each"),
                ["inverter.E_sw"]
            );
            assert_eq!(
                said!($model, $drive => $parameters.thermal.alpha_psi = 1.1e-3, "strengthens", "strengthens"),
                ["magnet.alpha"]
            );
        };
    }
    inverter!(PmsmPlant, m => m.parameters);
    inverter!(PmsmDrive, m => m.pair.plant.model.parameters);
    inverter!(PmsmDriveMean, m => m.drive.plant);
    assert_eq!(said!(PmsmDriveMean, m => m.drive.plant.thermal.T_start = 80.0), ["thermal.T_start"]);
    assert_eq!(
        said!(PmsmDriveMean, m => (m.drive.derating.used, m.drive.derating.T_winding) = (true, 80.0)),
        ["limit.T_winding"]
    );
}
