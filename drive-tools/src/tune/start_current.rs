//! The current of the I-f start, from the torque that it has to hold: 1.4 times the rated one.
//!
//! The rotor hangs on the current vector by 1.5 n_p (psi_M - dL I cos delta) I sin delta, dL = L_q - L_d, with the stiffness k = psi_M - dL I
//! per 1.5 n_p I where it lies along the current, which must be 0.5 psi_M or more. With more reluctance it lies at cos delta = psi_M / (dL I),
//! with k = dL I - psi_M^2 / (dL I), 0.5 psi_M or more from dL I = 1.28 psi_M on, and holds the torque of maximum torque per ampere
//! ([`start`](drive::control::start)). In between, nothing holds the rotor without a load.

use super::motor::{Data, electrical, torque_constant};
use drive::control::limits::Limits;
use drive::control::reference::{max_torque, max_torque_per_ampere};

/// Torque of the start in units of the rated torque.
const TORQUE: f64 = 1.4;
/// Minimum reluctance (L_q - L_d) I in units of psi_M where the rotor does not lie along the current.
const LEAST: f64 = 1.28;
/// Maximum current with much reluctance as a share of the maximum current: the damping adds half of it at a right angle.
const SHARE: f64 = 0.89;

/// The current vector of a start.
pub struct Lead {
    /// Current in A.
    pub i: f64,
    /// Maximum torque that it holds in N.m.
    pub torque: f64,
    /// Frequency of the rotor's swing in rad/s.
    pub swing: f64,
    /// Share of the damping that reluctance leaves.
    pub damped: f64,
    /// Whether the rotor lies far from the current.
    pub reluctant: bool,
    /// The rule.
    pub rule: &'static str,
}

impl Lead {
    /// For a machine.
    pub fn of(data: &Data) -> Self {
        let (machine, limit) = (electrical(data), *data.rating.current.get_ref());
        let (k, torque) = (torque_constant(data), *data.rating.torque.get_ref());
        let (dL, n_p, J) = (machine.L_q - machine.L_d, f64::from(machine.n_p), *data.mechanics.J.get_ref());
        let (wanted, stable) = ((TORQUE * torque / k).min(limit), 0.5 * machine.psi_M / dL.abs());
        let reluctant = max_torque_per_ampere(&machine, TORQUE * torque).magnitude();
        let i = reluctant.min(SHARE * limit).max(LEAST * machine.psi_M / dL);
        if dL > 0.0 && stable < wanted && i <= SHARE * limit {
            let flux = dL * i - machine.psi_M * machine.psi_M / (dL * i);
            return Self {
                i,
                torque: held(data, i),
                swing: (1.5 * n_p * n_p * i * flux / J).sqrt(),
                damped: 1.0,
                reluctant: true,
                rule: "1.4 times the rated torque by maximum torque per ampere, at least 1.28 psi_M / (L_q - L_d), at most 0.89 of the \
                       maximum current",
            };
        }
        let i = wanted.min(stable);
        Self {
            i,
            torque: k * i,
            swing: (n_p * k * i / J).sqrt(),
            damped: 1.0 - dL.abs() * i / machine.psi_M,
            reluctant: false,
            rule: "1.4 times the rated torque / K, at most the maximum current and psi_M / (2 |L_q - L_d|)",
        }
    }
}

/// Maximum torque in N.m of a current of `i` (A).
fn held(data: &Data, i: f64) -> f64 {
    let machine = electrical(data);
    max_torque(&machine, &Limits { i_q: i, i, tau: f64::INFINITY }, true)
}
