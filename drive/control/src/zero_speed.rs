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

use drive_base::math::exp;
use fmu_core::unit::{AMPERE, SPEED};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters of the law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZeroSpeed {
    /// Current at standstill in A, >= 0, which holds a load up to K i_0.
    pub i_0: f64,
    /// Mechanical speed in rad/s at which the current has fallen to 1/e, > 0.
    pub w_0: f64,
    /// In torque mode, no torque means no current.
    pub release: bool,
}

impl Default for ZeroSpeed {
    fn default() -> Self {
        Self { i_0: 5.0, w_0: 10.0, release: false }
    }
}

impl ZeroSpeed {
    /// Share of `i_0` at the estimated mechanical speed in rad/s.
    #[inline]
    pub fn share(&self, speed_hat: f64) -> f64 {
        exp(-speed_hat.abs() * (1.0 / self.w_0))
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
