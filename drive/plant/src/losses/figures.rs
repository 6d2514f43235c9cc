//! The loss split of three machines at eleven operating points, against figures of an independent calculation with the
//! closed forms of the inverter (the reference, section 2): 0.05 % of each loss and 1e-4 of the efficiency.
//! Machine a is `motors/ipmsm-2.2kw.toml`, b `motors/reference.toml`, c the traction machine of gym-electric-motor's
//! default (DOI 10.1109/TPEL.2020.3006779); parameters of losses and inverters are assumed.

use super::conduction::Devices;
use crate::circuit::{Circuit, Rates};
use crate::legs::Legs;
use crate::losses::conduction::Conduction;
use crate::losses::efficiency;
use crate::losses::flow::{Dissipation, Path, Switches};
use crate::machine::{Machine, flux};
use crate::mechanics::{Shaft, Standstill};
use crate::model::PmsmPlant;
use crate::tables::PlantParameters;
use drive_base::frame::{AlphaBeta, Axis, Dq, Rotor};
use drive_base::motor::Motor;
use std::f64::consts::{PI, TAU};

/// Machine and inverter of the figures, and the DC-link voltage in V.
struct Drive {
    par: PlantParameters,
    u_dc: f64,
}

fn drive(motor: Motor, iron: (f64, f64), friction: [f64; 3], devices: Devices, u_dc: f64) -> Drive {
    let mut par = PlantParameters { motor, ..PlantParameters::default() };
    (par.iron.G_e, par.iron.G_h, par.inverter.i_zero) = (iron.0, iron.1, 1e-4);
    [par.mechanics.B, par.mechanics.tau_coulomb, par.mechanics.k_w] = friction;
    par.mechanics.imposed = true;
    par.inverter.devices = devices;
    Drive { par, u_dc }
}

fn devices(transistor: (f64, f64), diode: (f64, f64), switching: (f64, f64, f64)) -> Devices {
    Devices {
        u_transistor: transistor.0,
        r_transistor: transistor.1,
        u_diode: diode.0,
        r_diode: diode.1,
        E_sw: switching.0,
        i_sw: switching.1,
        u_sw: switching.2,
        k_sw: 1.3,
    }
}

fn a() -> Drive {
    let devices = devices((0.9, 0.06), (0.9, 0.05), (2.5e-3, 15.0, 600.0));
    drive(Motor::IPMSM_2_2_KW, (2.7e-4, 0.127), [0.0; 3], devices, 540.0)
}

fn b() -> Drive {
    let devices = devices((0.8, 0.08), (0.8, 0.08), (0.5e-3, 10.0, 300.0));
    drive(Motor::default(), (1.3e-4, 0.12), [2e-4, 0.03, 0.0], devices, 325.0)
}

fn traction() -> Motor {
    Motor { n_p: 3, R_s: 18e-3, L_d: 0.37e-3, L_q: 1.2e-3, psi_M: 66e-3 }
}

fn c() -> Drive {
    let devices = devices((0.8, 2.2e-3), (0.9, 1.6e-3), (25e-3, 300.0, 400.0));
    drive(traction(), (3e-3, 5.0), [2e-4, 0.3, 2e-7], devices, 400.0)
}

/// Machine c with a silicon-carbide inverter.
fn c_sic() -> Drive {
    let mut drive = c();
    drive.par.inverter.devices = devices((0.0, 3.5e-3), (0.0, 3.5e-3), (6e-3, 300.0, 400.0));
    drive
}

impl Drive {
    /// Means over a period in steady state with the current `i_s` (A) at the terminals: p_in, p_mech, cu, iron, cond, sw,
    /// friction in W, and the efficiency.
    fn at(&self, rpm: f64, i_s: Dq) -> [f64; 8] {
        let Self { par, u_dc } = self;
        let motor = &par.motor;
        let (speed, w) = (rpm * PI / 30.0, rpm * PI / 30.0 * f64::from(motor.n_p));
        let g = par.iron.conductance(w) * w;
        let i_d = (i_s.d() + g * motor.L_q * (i_s.q() - g * motor.psi_M)) / (1.0 + g * g * motor.L_d * motor.L_q);
        let i = Dq::new(i_d, i_s.q() - g * (motor.psi_M + motor.L_d * i_d));
        let psi = flux(motor, i);
        let legs = Legs::switching(&par.inverter, *u_dc);
        let switches = Switches::new(par, true, *u_dc, legs);
        let conduction = Conduction::new(&par.inverter.devices, true, *u_dc, legs.i_zone()).unwrap();
        let count = 7200;
        let mut sum = [0.0; 7];
        for k in 0..count {
            let axis = Axis::<Rotor>::at(TAU * (f64::from(k) + 0.37) / f64::from(count));
            let (wanted, ideal) = (axis.to_stator(i_s), axis.to_stator(i_s * motor.R_s + psi.turned() * w));
            // The current controller supplies the drop too.
            let mut u = ideal;
            for _ in 0..20 {
                u = ideal + conduction.drop(u, wanted);
            }
            let machine = Machine::<_>::new(motor, par.magnetics());
            let shaft = Shaft::new(&par.mechanics, 0.0, Standstill::new(&par.mechanics, speed));
            let path = Path { u, dissipation: Dissipation::at(par, motor.R_s, w), drops: switches };
            let circuit = Circuit { machine, path, shaft };
            let Rates { p_in, tau_given, losses, d_psi, .. } = circuit.rates(axis, axis.to_stator(psi), speed);
            let p_mech = tau_given * speed;
            // Steady: d psi/dt = j w psi in stator axes, but for the resistance of the devices times G drop.
            let rest: AlphaBeta = d_psi - axis.to_stator(psi.turned() * w);
            assert!(rest.magnitude() < 1e-3, "{rest:?} V");
            let powers = [p_in, p_mech, losses.cu, losses.iron, losses.cond, losses.sw, losses.friction];
            for (sum, power) in sum.iter_mut().zip(powers) {
                *sum += power / f64::from(count);
            }
        }
        let [p_in, p_mech, cu, iron, cond, sw, friction] = sum;
        [p_in, p_mech, cu, iron, cond, sw, friction, efficiency(p_in, p_mech)]
    }
}

#[test]
fn the_loss_split_of_three_machines() {
    // rpm, torque at the shaft, i_d, i_q, then cu, iron, cond, sw, friction, p_in, efficiency.
    type Figures = (f64, f64, [f64; 2], [f64; 5], f64, f64);
    const A: [Figures; 4] = [
        (1500.0, 3.0, [-0.0509, 1.3602], [10.005, 53.805, 2.504, 3.778, 0.0], 541.331, 0.87052),
        (1500.0, 14.0, [-0.9792, 5.6996], [180.601, 61.644, 12.916, 16.052, 0.0], 2470.328, 0.89021),
        (1900.0, 10.0, [-3.3919, 3.8569], [142.454, 55.919, 11.176, 14.256, 0.0], 2213.481, 0.89889),
        (1500.0, -14.0, [-0.7983, -5.4444], [163.503, 61.915, 11.789, 15.273, 0.0], -1946.636, 0.88519),
    ];
    const B: [Figures; 3] = [
        (1000.0, 2.5, [0.0, 3.8033], [43.395, 1.742, 7.547, 4.030, 5.335], 323.848, 0.80840),
        (3000.0, 2.5, [0.0, 3.8776], [45.108, 7.899, 7.729, 4.109, 29.164], 879.407, 0.89310),
        (3000.0, -2.5, [0.0, -3.5298], [37.379, 7.867, 6.888, 3.740, 29.164], -700.360, 0.89173),
    ];
    const C: [Figures; 4] = [
        (1000.0, 140.0, [-138.296, 173.560], [1329.72, 121.79, 501.33, 353.20, 33.84], 17000.64, 0.86237),
        (3000.0, 80.0, [-92.549, 126.193], [661.23, 264.18, 322.67, 249.07, 120.19], 26750.08, 0.93954),
        (8000.0, 25.0, [-40.009, 58.427], [135.39, 352.75, 125.69, 112.70, 509.29], 22179.77, 0.94428),
        (10000.0, -30.0, [-76.324, -49.470], [223.36, 340.10, 175.41, 144.76, 763.16], -29769.14, 0.94758),
    ];
    let mut wrong = Vec::new();
    for (drive, figures) in [(a(), &A[..]), (b(), &B[..]), (c(), &C[..])] {
        for &(rpm, torque, [i_d, i_q], wanted, p_in, efficiency) in figures {
            let [link, shaft, got @ .., found] = drive.at(rpm, Dq::new(i_d, i_q));
            println!(
                "{rpm} rpm, {torque} N.m: {got:.4?} W of {wanted:?}, {link:.3} of {p_in}, {found:.5} of {efficiency}"
            );
            for (got, wanted) in got.iter().zip(wanted) {
                if (got - wanted).abs() > 5e-4 * wanted + 1e-3 {
                    wrong.push(format!("{rpm} rpm, {torque} N.m: {got} W, not {wanted} W"));
                }
            }
            let tau = shaft / (rpm * PI / 30.0);
            if (tau - torque).abs() > 2e-4 * torque.abs() {
                wrong.push(format!("{rpm} rpm: {tau} N.m, not {torque} N.m"));
            }
            if (found - efficiency).abs() > 1e-4 || (link / p_in - 1.0).abs() > 2e-4 {
                wrong.push(format!("{rpm} rpm, {torque} N.m: efficiency {found}, {link} W"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn silicon_carbide() {
    let figures =
        [(3000.0, [-92.549, 126.193], [128.57, 59.78], 0.95320), (8000.0, [-40.009, 58.427], [26.33, 27.05], 0.95222)];
    for (rpm, [i_d, i_q], [cond, sw], efficiency) in figures {
        let [_, _, _, _, p_cond, p_sw, _, found] = c_sic().at(rpm, Dq::new(i_d, i_q));
        println!("{rpm} rpm: {p_cond} W, {p_sw} W, {found}");
        assert!((p_cond / cond - 1.0).abs() < 5e-4 && (p_sw / sw - 1.0).abs() < 5e-4, "{p_cond} W, {p_sw} W");
        assert!((found - efficiency).abs() < 1e-4, "{found}");
    }
}

#[test]
fn blocked_the_iron_brakes() {
    // Without friction a loses 53.35 W at 1500 rpm, -0.33964 N.m; c 205.94 W in the iron at 8000 rpm, -0.85374 N.m with
    // friction.
    for (drive, rpm, watt, torque) in [(a(), 1500.0, 53.35, -0.33964), (c(), 8000.0, 205.94, -0.85374)] {
        let mut block = fmu_core::Block::<PmsmPlant>::default();
        block.model.parameters = drive.par.clone();
        let inputs = &mut block.model.inputs;
        (inputs.speed_shaft, inputs.u_dc, inputs.enable) = (rpm * PI / 30.0, 1000.0, false);
        block.initialize();
        block.step(&fmu_core::Step { start: fmu_core::Elapsed::ZERO, h: 1e-3 }).unwrap();
        let out = &block.out;
        println!("{rpm} rpm: {} W, {} N.m", out.powers.losses.iron, out.powers.tau_shaft);
        assert!((out.powers.losses.iron / watt - 1.0).abs() < 5e-5, "{} W", out.powers.losses.iron);
        assert!((out.powers.tau_shaft - torque).abs() < 1e-5, "{} N.m", out.powers.tau_shaft);
        assert_eq!((out.i_d, out.i_q, out.powers.p_in), (0.0, 0.0, 0.0));
    }
}
