//! Derating: the maximum torque falls with the temperature of the winding.
//!
//! ```text
//! share = 1 up to limit.T_winding, 0 from limit.T_winding_max on, a straight line between       tau_max, tau_min within share * full
//! share over T by straight lines between the points of a table, constant beyond its ends       with limit.T_winding_table
//! ```
//!
//! The full torque is that of the current and torque limits below the base speed; field weakening and the limits of the DC link act
//! besides. The drive measures the winding's temperature exactly. T in K.

use drive_base::implausible;
use fmu_core::log::Warnings;
use fmu_core::unit::{KELVIN, ONE};
use fmu_core::{Fault, Row, Table, table};
use serde::{Deserialize, Serialize};

/// Number of points of the table.
pub const POINTS: usize = 8;

/// Parameters of the derating.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Derating {
    /// It is in use.
    pub used: bool,
    /// Temperature in K above which the torque falls.
    pub T_winding: f64,
    /// Temperature in K from which on there is none.
    pub T_winding_max: f64,
    /// The share follows the table.
    pub by_table: bool,
    /// Temperatures in K of the table, not decreasing.
    pub at: [f64; POINTS],
    /// Shares of the full torque at these temperatures.
    pub shares: [f64; POINTS],
}

impl Default for Derating {
    /// The limits of the insulation classes F and H; the table has the same line.
    fn default() -> Self {
        let mut default = Self {
            used: false,
            T_winding: 428.15,
            T_winding_max: 453.15,
            by_table: false,
            at: [0.0; POINTS],
            shares: [0.0; POINTS],
        };
        for k in 0..POINTS {
            #[expect(clippy::cast_precision_loss, reason = "a small number")]
            let x = k as f64 / (POINTS - 1) as f64;
            default.at[k] = default.T_winding + x * (default.T_winding_max - default.T_winding);
            default.shares[k] = 1.0 - x;
        }
        default
    }
}

impl Derating {
    /// Share of the full torque with the winding at `T_winding` (K).
    #[inline]
    pub fn share(&self, T_winding: f64) -> f64 {
        if !self.used {
            return 1.0;
        }
        if self.by_table {
            return self.of_table(T_winding);
        }
        ((self.T_winding_max - T_winding) / (self.T_winding_max - self.T_winding)).clamp(0.0, 1.0)
    }

    /// The share of the table at `T` (K).
    fn of_table(&self, T: f64) -> f64 {
        let above = self.at.partition_point(|at| *at <= T);
        if above == 0 || above == POINTS {
            return self.shares[if above == 0 { 0 } else { POINTS - 1 }];
        }
        let [[from, to], [share, next]] = [&self.at, &self.shares].map(|of| [of[above - 1], of[above]]);
        share + (next - share) * (T - from) / (to - from)
    }

    /// Checks the limits, where they are in use.
    ///
    /// # Errors
    /// States the variable, its value and the allowed range.
    pub fn validate(&self) -> Result<(), Fault> {
        if self.used && self.by_table {
            let wrong = (1..POINTS).find(|&k| self.at[k].is_nan() || self.at[k] < self.at[k - 1]);
            return wrong.map_or(Ok(()), |k| {
                let name = |k: usize| format!("limit.T_winding_at[{}]", k + 1);
                let allowed = format!("at least {} = {} K", name(k - 1), self.at[k - 1]);
                Err(Fault::value(&name(k), format!("{} K", self.at[k]), allowed))
            });
        }
        if self.used && (self.T_winding_max.is_nan() || self.T_winding_max <= self.T_winding) {
            let from = DERATING.tell(self, |p| &mut p.T_winding);
            return Err(DERATING.fault(self, |p| &mut p.T_winding_max, format!("above {from}")));
        }
        Ok(())
    }
}

impl Derating {
    /// Warns of temperatures that look like degrees Celsius.
    pub fn warn(&self, log: &mut Warnings<'_>) {
        if self.used && self.by_table {
            implausible::temperature("limit.T_winding_at", self.at[0], log);
        } else if self.used {
            implausible::temperature("limit.T_winding", self.T_winding, log);
            implausible::temperature("limit.T_winding_max", self.T_winding_max, log);
        }
    }
}

type P = Row<Derating>;

/// Variables of the derating.
pub const DERATING: &Table<Derating> = table![
    P::boolean_parameter(
        "limit.T_winding_use",
        "The maximum torque falls with the temperature of the winding; false: no derating",
        |p| &mut p.used,
    ),
    P::parameter("limit.T_winding", &KELVIN, "Temperature of the winding above which the maximum torque falls", |p| {
        &mut p.T_winding
    })
    .above(0.0),
    P::parameter(
        "limit.T_winding_max",
        &KELVIN,
        "Temperature of the winding at which the maximum torque is 0, on a straight line from limit.T_winding",
        |p| &mut p.T_winding_max,
    )
    .above(0.0),
    P::boolean_parameter(
        "limit.T_winding_table",
        "The maximum torque follows limit.T_winding_share over limit.T_winding_at; false: the straight line from limit.T_winding to limit.T_winding_max",
        |p| &mut p.by_table,
    ),
    P::array_parameter(
        "limit.T_winding_at",
        &KELVIN,
        "Temperatures of the winding of limit.T_winding_share, not decreasing; a shorter table repeats its last point",
        POINTS,
        |p| &mut p.at,
    )
    .above(0.0),
    P::array_parameter(
        "limit.T_winding_share",
        &ONE,
        "Maximum torque as a share of the full torque over limit.T_winding_at, on straight lines, constant beyond the ends",
        POINTS,
        |p| &mut p.shares,
    )
    .at_least(0.0)
    .at_most(1.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_torque_falls_on_a_straight_line() {
        let with = Derating { used: true, T_winding: 400.0, T_winding_max: 440.0, ..Derating::default() };
        for (T, share) in [(300.0, 1.0), (400.0, 1.0), (410.0, 0.75), (440.0, 0.0), (500.0, 0.0)] {
            assert!((with.share(T) - share).abs() < 1e-12, "{T} K");
            assert!((Derating { used: false, ..with.clone() }.share(T) - 1.0).abs() < 1e-15);
        }
        let wrong = Derating { T_winding_max: 390.0, ..with };
        let said = wrong.validate().unwrap_err().to_string();
        assert!(said.contains("limit.T_winding_max = 390 K") && said.contains("limit.T_winding = 400 K"), "{said}");
    }

    /// A curve with a step and a repeated last point; the table at the start is the line.
    #[test]
    fn the_torque_follows_the_table() {
        let mut with = Derating { used: true, by_table: true, ..Derating::default() };
        let line = Derating { by_table: false, ..with.clone() };
        for T in [300.0, 428.15, 431.0, 440.0, 453.15, 500.0] {
            assert!((with.share(T) - line.share(T)).abs() < 1e-12, "{T} K");
        }
        with.at = [390.0, 400.0, 400.0, 420.0, 440.0, 440.0, 440.0, 440.0];
        with.shares = [1.0, 0.9, 0.8, 0.7, 0.1, 0.1, 0.1, 0.1];
        with.validate().unwrap();
        let expected =
            [(300.0, 1.0), (395.0, 0.95), (400.0, 0.8), (410.0, 0.75), (430.0, 0.4), (440.0, 0.1), (500.0, 0.1)];
        for (T, share) in expected {
            assert!((with.share(T) - share).abs() < 1e-12, "{T} K: {}", with.share(T));
        }
        with.at[3] = 399.0;
        let said = with.validate().unwrap_err().to_string();
        assert_eq!(said, "limit.T_winding_at[4] = 399 K is not allowed: at least limit.T_winding_at[3] = 400 K");
    }
}
