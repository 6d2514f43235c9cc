//! The low-speed law: a d-axis current that the rotor follows at speeds too low for estimation.
//!
//! Rasmussen (25): i_sd,ref = i_0 exp(-|w_r^| / w_0), with the MECHANICAL speed.
//!
//! With maximum torque per ampere, the share 1 - exp(-|w_r^| / w_0) of its i_d is added, and i_q supplies the rest of the torque;
//! the current limit sets the maximum torque.
//!
//! In torque mode, i_0 also flows while the torque reference is zero, and heats the winding with 1.5 R_s i_0^2. A small load is
//! held if R^ < R, for example 0.2 N.m on the reference motor with R^ = 0.9 R; with R^ = R the frame follows the rotor, and the
//! shaft is free. With `release`, tau_ref = 0 requests no current: the shaft is free. Without current, a flux observer cannot
//! determine the angle at standstill; as soon as a torque is requested, i_0 pulls the rotor along, as at a start.
//!
//! With `by_need`, the current at standstill is min(i_0, max(1.5 n, 0.35 i_0)), where n is the need: |i_q,ref|, which decays with the
//! time constant 0.5 s. i_q must carry the load, as in Rasmussen with a measured resistance, of which it uses less than there is. At
//! 0.3 of the rated load, the copper loss is 16 % of that with i_0, the mean of 16 machines; these are the smallest factors with which
//! all of them hold load steps of 0.7 of the rated torque. Otherwise `lock_lost` rises.

use drive_base::math::exp;
use fmu_core::unit::{AMPERE, SPEED};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// d-axis current per ampere of i_q, and its minimum as a share of i_0, with `by_need`.
const PER_AMPERE: f64 = 1.5;
const LEAST: f64 = 0.35;
/// Time constant in s with which a need is forgotten.
const MEMORY: f64 = 0.5;

/// Parameters of the law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZeroSpeed {
    /// Current at standstill in A, >= 0, which holds a load up to K i_0.
    pub i_0: f64,
    /// Mechanical speed in rad/s at which the current has fallen to 1/e, > 0.
    pub w_0: f64,
    /// In torque mode, no torque means no current.
    pub release: bool,
    /// The current at standstill follows the torque.
    pub by_need: bool,
}

impl Default for ZeroSpeed {
    fn default() -> Self {
        Self { i_0: 5.0, w_0: 10.0, release: false, by_need: false }
    }
}

impl ZeroSpeed {
    /// Share of `i_0` at the estimated mechanical speed in rad/s.
    #[inline]
    pub fn share(&self, speed_hat: f64) -> f64 {
        exp(-speed_hat.abs() * (1.0 / self.w_0))
    }

    /// Current in A at standstill for a need of i_q of `need` (A), at most `i_0` (A).
    #[inline]
    pub fn i_0_for(i_0: f64, need: f64) -> f64 {
        (PER_AMPERE * need).max(LEAST * i_0).min(i_0)
    }

    /// Need of i_q in A one sample of `T_s` (s) after `need` (A), with `i_q` (A).
    #[inline]
    pub fn need(need: f64, i_q: f64, T_s: f64) -> f64 {
        i_q.abs().max(need - T_s / MEMORY * need)
    }

    /// Whether a reference of `tau` (N.m) requests no current.
    #[inline]
    pub fn releases(&self, tau: f64) -> bool {
        tau == 0.0 && self.release
    }

    /// Reference of i_sd in A at the estimated mechanical speed in rad/s.
    #[inline]
    pub fn i_d_ref(&self, speed_hat: f64) -> f64 {
        self.i_0 * self.share(speed_hat)
    }
}

type P = Row<ZeroSpeed>;

/// Variables of the law; their owner supplies the prefix `zero_speed.`.
pub const ZERO_SPEED: &Table<ZeroSpeed> = table![
    P::parameter(
        "i_0",
        &AMPERE,
        "d-axis current reference of Rasmussen and FluxObserver at standstill, eq (25)",
        |p| &mut p.i_0,
    )
    .at_least(0.0)
    .tunable(),
    P::parameter(
        "w_0",
        &SPEED,
        "Mechanical speed at which the d-axis current reference has fallen to 1/e, eq (25)",
        |p| &mut p.w_0,
    )
    .above(0.0)
    .tunable(),
    P::boolean_parameter(
        "by_need",
        "The current at standstill is proportional to |i_q|, at most zero_speed.i_0; false: i_0 flows without load, too",
        |p| &mut p.by_need,
    ),
    P::boolean_parameter(
        "release",
        "In torque mode, tau_ref = 0 asks for no current, and the shaft is free; false: i_0 flows, with the copper loss 1.5 R_s i_0^2",
        |p| &mut p.release,
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falls_to_one_over_e_on_both_sides() {
        let law = ZeroSpeed::default();
        assert!((law.i_d_ref(0.0) - 5.0).abs() < 1e-15);
        assert!((law.i_d_ref(-10.0) - 5.0 / std::f64::consts::E).abs() < 1e-14);
    }

    /// i_0 holds a load of up to K i_0: the share at a speed is the same in both directions, and w_0 is its scale.
    #[test]
    fn the_share_follows_the_speed() {
        let law = ZeroSpeed { i_0: 4.0, w_0: 20.0, ..ZeroSpeed::default() };
        for (speed, share) in
            [(0.0, 1.0), (20.0_f64 * std::f64::consts::LN_2, 0.5), (-20.0 * std::f64::consts::LN_2, 0.5)]
        {
            assert!((law.share(speed) - share).abs() < 1e-12 && (law.i_d_ref(speed) - 4.0 * share).abs() < 1e-12);
        }
    }
}
