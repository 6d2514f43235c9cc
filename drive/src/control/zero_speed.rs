//! The low-speed law: a d-axis current that the rotor follows at speeds too low for estimation.
//!
//! Rasmussen (25): i_sd,ref = i_0 exp(-|w_r^| / w_0), with the MECHANICAL speed.

use crate::math::exp;
use fmu_core::unit::{AMPERE, SPEED};
use fmu_core::{Row, Table};
use serde::{Deserialize, Serialize};

/// Parameters of the law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZeroSpeed {
    /// Current at standstill in A, >= 0; holds a load of up to K i_0.
    pub i_0: f64,
    /// Mechanical speed in rad/s at which the current has fallen to 1/e, > 0.
    pub w_0: f64,
}

impl Default for ZeroSpeed {
    fn default() -> Self {
        Self { i_0: 5.0, w_0: 10.0 }
    }
}

impl ZeroSpeed {
    /// Reference of i_sd in A at the estimated mechanical speed in rad/s.
    #[inline]
    pub fn i_d_ref(&self, speed_hat: f64) -> f64 {
        self.i_0 * exp(-speed_hat.abs() * (1.0 / self.w_0))
    }
}

type P = Row<ZeroSpeed>;

/// Variables of the law; their owner supplies the prefix `zero_speed.`.
pub const ZERO_SPEED: &Table<ZeroSpeed> = &Table::new(
    const {
        &[
            P::parameter("i_0", &AMPERE, "d-axis current reference at standstill, eq (25)", |p| &mut p.i_0)
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
        ]
    },
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falls_to_one_over_e_on_both_sides() {
        let law = ZeroSpeed::default();
        assert!((law.i_d_ref(0.0) - 5.0).abs() < 1e-15);
        assert!((law.i_d_ref(-10.0) - 5.0 / std::f64::consts::E).abs() < 1e-14);
    }
}
