//! Three machines: a, the 2.2 kW machine of Kim & Sul; b, the reference motor; c, a traction machine (gym-electric-motor's
//! default, which cites DOI 10.1109/TPEL.2020.3006779), with an assumed link of 400 V.
#![allow(dead_code, reason = "each test program uses a part")]

use drive_base::frame::DqHat;
use drive_base::motor::Motor;
use drive_control::current::CurrentLoop;
use drive_control::envelope::{Envelope, Limit, WarmStart};
use drive_control::estimator::Kind;
use drive_control::limits::Limits;
use drive_control::reference::max_torque_per_ampere;
use drive_control::tables::ControllerParameters;
use drive_control::tracking::LeastTracker;
use drive_control::weakening::{Weakening, WeakeningGains, WeakeningParameters};
use std::f64::consts::TAU;

pub(crate) const RPM: f64 = std::f64::consts::PI / 30.0;

/// A machine with its current limit (A), link (V) and inertia (kg.m2).
#[derive(Clone)]
pub(crate) struct Machine {
    pub(crate) motor: Motor,
    pub(crate) i: f64,
    pub(crate) u_dc: f64,
    pub(crate) J: f64,
}

/// Machine a.
pub(crate) fn a() -> Machine {
    Machine { motor: Motor::IPMSM_2_2_KW, i: 15.0, u_dc: 540.0, J: 0.015 }
}

/// Machine b.
pub(crate) fn b() -> Machine {
    Machine { motor: Motor::default(), i: 7.5, u_dc: 325.0, J: 1.5e-3 }
}

/// Machine c.
pub(crate) fn c(i: f64) -> Machine {
    let motor = Motor { n_p: 3, R_s: 18e-3, L_d: 0.37e-3, L_q: 1.2e-3, psi_M: 66e-3 };
    Machine { motor, i, u_dc: 400.0, J: 0.03883 }
}

impl Machine {
    pub(crate) fn w(&self, rpm: f64) -> f64 {
        f64::from(self.motor.n_p) * rpm * RPM
    }

    pub(crate) fn U(&self, k_u: f64) -> f64 {
        k_u * self.u_dc / 3.0_f64.sqrt()
    }

    pub(crate) fn envelope(&self) -> Envelope {
        Envelope::new(&self.motor, self.i)
    }

    /// The limit at `rpm` of the sign `s`: cold, and after six more samples.
    pub(crate) fn limit(&self, rpm: f64, s: f64) -> [Limit; 2] {
        let mut warm = WarmStart::default();
        let mut step = || self.envelope().limit(self.w(rpm), s, self.U(0.95), &mut warm);
        let first = step();
        [first, (0..6).map(|_| step()).last().unwrap()]
    }

    /// Speed in rpm up to which `holds` is true.
    pub(crate) fn last_speed(holds: impl Fn(f64) -> bool) -> f64 {
        let (mut low, mut high) = (100.0, 30_000.0);
        for _ in 0..60 {
            let mid = 0.5 * (low + high);
            *(if holds(mid) { &mut low } else { &mut high }) = mid;
        }
        low
    }

    /// The controller's parameters.
    pub(crate) fn parameters(&self) -> ControllerParameters {
        ControllerParameters {
            estimator: Kind::Sensored,
            motor: self.motor.clone(),
            limit: Limits { i: self.i, i_q: self.i, tau: 1e4 },
            J: self.J,
            weakening: WeakeningParameters { used: true, ..WeakeningParameters::default() },
            current: CurrentLoop {
                bandwidth: TAU * 200.0,
                active_resistance: true,
                mtpa: true,
                ..CurrentLoop::default()
            },
            ..ControllerParameters::default()
        }
    }
}

/// The currents that the controller requests.
pub(crate) fn currents(machine: &Machine, rpm: f64, tau: f64) -> (DqHat, Weakening) {
    let par = machine.parameters();
    let most = machine.limit(100.0, 1.0)[1].tau;
    let gains = WeakeningGains::new(&par.motor, &par.limit, most, true, 1.0, LeastTracker::default());
    let (w, mut state) = (machine.w(rpm), Weakening::default());
    let plain = max_torque_per_ampere(&par.motor, tau);
    let mut i = DqHat::ZERO;
    for k in 0..8 {
        state.limits(&gains, &par.weakening, (w, machine.u_dc, 0.0), most / par.motor.torque_constant(), k);
        i = state.currents(&gains, tau, w, machine.i, true, || plain);
    }
    (i, state)
}

/// Maximum torque at a speed in rpm, motoring and generating in N.m: an independent calculation, k_u = 0.95.
pub(crate) fn envelope_figures() -> [(Machine, f64, f64, f64); 19] {
    [
        (a(), 1000.0, 39.4584, 39.4584),
        (a(), 1500.0, 31.7936, 38.4032),
        (a(), 2000.0, 24.9058, 32.8101),
        (a(), 3000.0, 17.0599, 23.7330),
        (a(), 4000.0, 12.9075, 18.2818),
        (b(), 3000.0, 5.0625, 5.0625),
        (b(), 4000.0, 4.2045, 5.0493),
        (b(), 4500.0, 3.0945, 4.5584),
        (b(), 5000.0, 1.7105, 3.4982),
        (c(240.0), 3000.0, 160.612, 160.612),
        (c(240.0), 4000.0, 145.520, 148.200),
        (c(240.0), 6000.0, 105.892, 109.118),
        (c(240.0), 9000.0, 71.4046, 73.9718),
        (c(240.0), 12_000.0, 52.1503, 54.1841),
        (c(400.0), 3000.0, 295.149, 307.700),
        (c(400.0), 4000.0, 218.983, 231.184),
        (c(400.0), 6000.0, 126.747, 134.171),
        (c(400.0), 9000.0, 74.2701, 77.7263),
        (c(400.0), 12_000.0, 52.1988, 54.3298),
    ]
}

/// Currents inside the envelope, from the same calculation: rpm, N.m, i_d and i_q in A, and whether the drive weakens the field.
pub(crate) fn inside_figures() -> [(Machine, f64, f64, f64, f64, bool); 9] {
    [
        (a(), 100.0, 14.0, -0.8376, 5.5798, false),
        (c(240.0), 100.0, 100.0, -108.261, 142.581, false),
        (a(), 1900.0, 10.0, -3.28415, 3.73946, true),
        (a(), 3000.0, 10.0, -8.7774, 3.2841, true),
        (a(), 2500.0, -20.0, -8.06669, -6.67334, true),
        (b(), 4500.0, 2.0, -5.10044, 2.96296, true),
        (c(240.0), 8000.0, 25.0, -36.569, 57.6588, true),
        (c(240.0), 10_000.0, -30.0, -80.3153, -50.2531, true),
        (c(400.0), 9000.0, 60.0, -172.622, 63.7117, true),
    ]
}
