//! Three machines with all losses, and figures of their operating points: a is `motors/ipmsm-2.2kw.toml`, b
//! `motors/reference.toml`, c the traction machine of gym-electric-motor's default (DOI 10.1109/TPEL.2020.3006779). Parameters
//! of losses and inverters are assumed. The figures are an independent calculation with the closed forms of the inverter: MTPA
//! or field weakening (k_u = 0.95), with the torque reference that gives the torque at the shaft.
#![allow(dead_code, reason = "each test program uses a part")]

use drive_base::motor::Motor;
use drive_plant::losses::conduction::Devices;
use drive_plant::tables::PlantParameters;

/// Machine and inverter of the figures, and the DC-link voltage in V.
pub(crate) struct Drive {
    pub(crate) par: PlantParameters,
    pub(crate) u_dc: f64,
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

/// Machine a.
pub(crate) fn a() -> Drive {
    let devices = devices((0.9, 0.06), (0.9, 0.05), (2.5e-3, 15.0, 600.0));
    drive(Motor::IPMSM_2_2_KW, (2.7e-4, 0.127), [0.0; 3], devices, 540.0)
}

/// Machine b.
pub(crate) fn b() -> Drive {
    let devices = devices((0.8, 0.08), (0.8, 0.08), (0.5e-3, 10.0, 300.0));
    drive(Motor::default(), (1.3e-4, 0.12), [2e-4, 0.03, 0.0], devices, 325.0)
}

fn traction() -> Motor {
    Motor { n_p: 3, R_s: 18e-3, L_d: 0.37e-3, L_q: 1.2e-3, psi_M: 66e-3 }
}

/// Machine c.
pub(crate) fn c() -> Drive {
    let devices = devices((0.8, 2.2e-3), (0.9, 1.6e-3), (25e-3, 300.0, 400.0));
    drive(traction(), (3e-3, 5.0), [2e-4, 0.3, 2e-7], devices, 400.0)
}

/// Machine c with a silicon-carbide inverter.
pub(crate) fn c_sic() -> Drive {
    let mut drive = c();
    drive.par.inverter.devices = devices((0.0, 3.5e-3), (0.0, 3.5e-3), (6e-3, 300.0, 400.0));
    drive
}

/// rpm, torque at the shaft in N.m, i_d and i_q in A, then cu, iron, cond, sw, friction, p_in in W, and the efficiency.
pub(crate) type Figures = (f64, f64, [f64; 2], [f64; 5], f64, f64);
/// Points of machine a.
pub(crate) const A: [Figures; 4] = [
    (1500.0, 3.0, [-0.0509, 1.3602], [10.005, 53.805, 2.504, 3.778, 0.0], 541.331, 0.87052),
    (1500.0, 14.0, [-0.9792, 5.6996], [180.601, 61.644, 12.916, 16.052, 0.0], 2470.328, 0.89021),
    (1900.0, 10.0, [-3.3919, 3.8569], [142.454, 55.919, 11.176, 14.256, 0.0], 2213.481, 0.89889),
    (1500.0, -14.0, [-0.7983, -5.4444], [163.503, 61.915, 11.789, 15.273, 0.0], -1946.636, 0.88519),
];
/// Points of machine b.
pub(crate) const B: [Figures; 3] = [
    (1000.0, 2.5, [0.0, 3.8033], [43.395, 1.742, 7.547, 4.030, 5.335], 323.848, 0.80840),
    (3000.0, 2.5, [0.0, 3.8776], [45.108, 7.899, 7.729, 4.109, 29.164], 879.407, 0.89310),
    (3000.0, -2.5, [0.0, -3.5298], [37.379, 7.867, 6.888, 3.740, 29.164], -700.360, 0.89173),
];
/// Points of machine c.
pub(crate) const C: [Figures; 4] = [
    (1000.0, 140.0, [-138.296, 173.560], [1329.72, 121.79, 501.33, 353.20, 33.84], 17000.64, 0.86237),
    (3000.0, 80.0, [-92.549, 126.193], [661.23, 264.18, 322.67, 249.07, 120.19], 26750.08, 0.93954),
    (8000.0, 25.0, [-40.009, 58.427], [135.39, 352.75, 125.69, 112.70, 509.29], 22179.77, 0.94428),
    (10000.0, -30.0, [-76.324, -49.470], [223.36, 340.10, 175.41, 144.76, 763.16], -29769.14, 0.94758),
];

/// Machine c with silicon carbide: rpm, i_d and i_q in A, cond and sw in W, and the efficiency.
pub(crate) const SILICON_CARBIDE: [(f64, [f64; 2], [f64; 2], f64); 2] =
    [(3000.0, [-92.549, 126.193], [128.57, 59.78], 0.95320), (8000.0, [-40.009, 58.427], [26.33, 27.05], 0.95222)];
