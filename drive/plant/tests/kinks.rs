//! Currents and energies with dead time and losses, in steps of a sample period against steps of a 64th.

use drive_base::frame::{AlphaBeta, Phases};
use drive_base::motor::Motor;
use drive_plant::PmsmPlant;
use drive_plant::losses::conduction::Devices;
use drive_plant::tables::PlantParameters;
use fmu_core::{Block, Elapsed, Step};

const T_S: f64 = 1e-4;
const DEAD_TIME: f64 = 2e-6;

/// A machine at constant speed under the voltage for a current, with dead time, with or without losses.
struct Case {
    name: &'static str,
    motor: Motor,
    u_dc: f64,
    devices: Devices,
    iron: (f64, f64),
    /// Mechanical speed in rad/s.
    speed: f64,
    /// Current in A.
    i: f64,
    losses: bool,
}

fn block(case: &Case) -> Block<PmsmPlant> {
    let mut block = Block::<PmsmPlant>::default();
    let par: &mut PlantParameters = &mut block.model.parameters;
    par.motor = case.motor.clone();
    par.mechanics.imposed = true;
    par.inverter.dead_time = DEAD_TIME;
    if case.losses {
        (par.iron.G_e, par.iron.G_h) = case.iron;
        par.inverter.devices = case.devices.clone();
    }
    block.model.inputs.u_dc = case.u_dc;
    block.model.inputs.speed_shaft = case.speed;
    block
}

/// The currents (A) at each sample of 20 ms, in steps of a `parts`-th of a sample period, and the energy lost (J).
fn run(case: &Case, parts: u32) -> (Vec<AlphaBeta>, f64) {
    let mut block = block(case);
    block.initialize();
    let h = T_S / f64::from(parts);
    let (m, w) = (&case.motor, f64::from(case.motor.n_p) * case.speed);
    let mut now = Elapsed::ZERO;
    let mut angle = 0.0;
    let mut currents = Vec::new();
    for k in 0..200_u32 {
        // The command of a controller for i_q = i, with its feedforward of dead time.
        let ahead = angle * f64::from(m.n_p) + 0.5 * w * T_S;
        let i = case.i * (1.0 + 0.02 * f64::from(k % 7));
        let (u_d, u_q) = (-w * m.L_q * i, m.R_s * i + w * m.psi_M);
        let (sin, cos) = ahead.sin_cos();
        let mut u = Phases::from_stator(AlphaBeta::new(u_d * cos - u_q * sin, u_d * sin + u_q * cos));
        let c = Phases::from_stator(AlphaBeta::new(-sin, cos) * i.max(0.02));
        let dead = DEAD_TIME / 1e-4 * case.u_dc;
        let sign = |x: f64| (x / 0.1).clamp(-1.0, 1.0) * dead;
        (u.a, u.b, u.c) = (u.a + sign(c.a), u.b + sign(c.b), u.c + sign(c.c));
        block.model.inputs.u = u;
        for _ in 0..parts {
            block.model.inputs.angle_shaft = angle;
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
            angle += case.speed * h;
        }
        currents.push(block.out.i.to_stator());
    }
    (currents, block.out.energy.loss)
}

fn cases() -> Vec<Case> {
    let devices = |u: f64, r: f64, e: f64| Devices {
        u_transistor: u,
        r_transistor: r,
        u_diode: 0.8 * u,
        r_diode: r,
        E_sw: e,
        ..Devices::default()
    };
    let traction = Motor { n_p: 6, R_s: 5.5e-3, L_d: 0.09e-3, L_q: 0.25e-3, psi_M: 0.038 };
    let machines = [
        ("traction", traction, 360.0, devices(0.9, 2e-3, 1e-3), (2e-2, 10.0), 314.0, 300.0),
        ("reference", Motor::default(), 325.0, devices(0.9, 0.06, 1e-3), (1.3e-4, 0.12), 104.7, 4.0),
        ("2.2 kW", Motor::IPMSM_2_2_KW, 540.0, devices(0.9, 0.06, 2.5e-3), (2.7e-4, 0.127), 157.0, 6.0),
    ];
    let mut cases = Vec::new();
    for (name, motor, u_dc, devices, iron, speed, i) in machines {
        for share in [0.0, 0.01, 0.1, 1.0] {
            for losses in [false, true] {
                cases.push(Case {
                    name,
                    motor: motor.clone(),
                    u_dc,
                    devices: devices.clone(),
                    iron,
                    speed,
                    i: i * share,
                    losses,
                });
            }
        }
    }
    cases
}

#[test]
fn a_step_of_a_sample_period_is_as_good_as_64() {
    for case in cases() {
        let ((coarse, loss), (fine, fine_loss)) = (run(&case, 1), run(&case, 64));
        let error = coarse.iter().zip(&fine).map(|(&a, &b)| (a - b).magnitude()).fold(0.0, f64::max);
        let greatest = fine.iter().map(|i| i.magnitude()).fold(0.0, f64::max);
        let Case { name, i, losses, .. } = case;
        let off = loss / fine_loss - 1.0;
        println!("{name}, {i} A, losses {losses}: {error:.1e} A of {greatest:.3} A, {off:.1e} of {fine_loss:.3} J");
        // The current of the traction machine settles in 1 us where it is in the zone.
        let (of_current, of_energy) = if name == "traction" { (8e-3, 1e-3) } else { (2e-3, 2e-5) };
        assert!(
            error < of_current * greatest && off.abs() < of_energy,
            "{name}, {i} A, losses {losses}: {error} A, {off}"
        );
    }
}
