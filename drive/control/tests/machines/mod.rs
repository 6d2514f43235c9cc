//! Three machines: a, the 2.2 kW machine of Kim & Sul; b, the reference motor; c, a traction machine (gym-electric-motor's
//! default, which cites DOI 10.1109/TPEL.2020.3006779), with an assumed link of 400 V.
#![allow(dead_code, reason = "each test program uses a part")]

use drive_base::frame::DqHat;
use drive_base::motor::Motor;
use drive_control::current::CurrentLoop;
use drive_control::envelope::{Envelope, Limit, WarmStart};
use drive_control::estimator::Kind;
use drive_control::reference::max_torque_per_ampere;
use drive_control::tables::{ControllerParameters, Limits};
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
    let gains = WeakeningGains::new(&par, most, true);
    let (w, mut state) = (machine.w(rpm), Weakening::default());
    let plain = max_torque_per_ampere(&par.motor, tau);
    let mut i = DqHat::ZERO;
    for k in 0..8 {
        state.limits(&gains, &par.weakening, (w, machine.u_dc, 0.0), most / par.motor.torque_constant(), k);
        i = state.currents(&gains, tau, w, machine.i, true, || plain);
    }
    (i, state)
}
