//! The losses of copper, iron, inverter and friction, and the efficiency.
//!
//! ```text
//! p_in = p_mech + p_cu + p_iron + p_cond + p_sw + p_friction + d/dt (magnetic energy + J speed^2 / 2)
//! p_loss = p_cu + p_iron + p_cond + p_sw + p_friction
//! ```
//!
//! [`iron`](crate::iron), [`conduction`] and [`switching`] have the equations; [`flow`] joins them; between two kinks,
//! [`sides`] and [`zone`] replace legs and devices by simpler ones. The efficiency is p_mech / p_in of a motor, p_in / p_mech of a generator, and 0
//! elsewhere: where power enters from both sides, where p_mech is below 1 uW, and where the ratio is above 1 because stored
//! energy supplies the power.

pub mod conduction;
#[cfg(test)]
mod figures;
pub mod flow;
pub mod sides;
pub mod switching;
pub mod zone;

use fmu_core::unit::WATT;
use fmu_core::{Row, Scalar, Table, table};
use serde::{Deserialize, Serialize};

/// Losses: powers in W, or energies in J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Losses<S = f64> {
    /// Copper of the stator, including the current that blocking diodes end.
    pub cu: S,
    /// Iron.
    pub iron: S,
    /// Conduction of the inverter.
    pub cond: S,
    /// Switching of the inverter.
    pub sw: S,
    /// Friction and windage.
    pub friction: S,
}

impl<S: Scalar> Losses<S> {
    /// No losses.
    #[inline]
    pub fn none() -> Self {
        let x = S::from(0.0);
        Self { cu: x, iron: x, cond: x, sw: x, friction: x }
    }

    /// Their sum.
    #[inline]
    pub fn sum(&self) -> S {
        self.cu + self.iron + self.cond + self.sw + self.friction
    }

    /// Applies `f` to each.
    #[inline]
    pub fn map<T>(self, f: impl Fn(S) -> T) -> Losses<T> {
        let Self { cu, iron, cond, sw, friction } = self;
        Losses { cu: f(cu), iron: f(iron), cond: f(cond), sw: f(sw), friction: f(friction) }
    }
}

impl Losses {
    /// Adds the losses of a step.
    #[inline]
    pub fn add(&mut self, step: &Self) {
        *self = self.with(step, |a, b| a + b);
    }

    /// Applies `f` to each loss and its counterpart in `other`.
    #[inline]
    pub fn with(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            cu: f(self.cu, other.cu),
            iron: f(self.iron, other.iron),
            cond: f(self.cond, other.cond),
            sw: f(self.sw, other.sw),
            friction: f(self.friction, other.friction),
        }
    }
}

/// Efficiency of a drive with the power `p_in` (W) from the link and `p_mech` (W) to the load.
#[inline]
pub fn efficiency<S: Scalar>(p_in: S, p_mech: S) -> S {
    let (link, shaft) = (p_in.value(), p_mech.value());
    if shaft >= 1e-6 && shaft <= link {
        p_mech / p_in
    } else if shaft <= -1e-6 && link < 0.0 && shaft <= link {
        p_in / p_mech
    } else {
        0.0.into()
    }
}

type P = Row<Losses>;

/// Variables of the losses.
pub const LOSSES: &Table<Losses> = table![
            P::output(
                "p_cu",
                &WATT,
                "Copper loss of the stator, mean over the last step (PmsmDrive: over the last T_s; Model Exchange: at the instant)",
                |p| &mut p.cu,
            )
            .mean(),
            P::output(
                "p_iron",
                &WATT,
                "Iron loss, mean over the last step (PmsmDrive: over the last T_s; Model Exchange: at the instant)",
                |p| &mut p.iron,
            )
            .mean(),
            P::output(
                "p_cond",
                &WATT,
                "Conduction loss of the inverter, mean over the last step (PmsmDrive: over the last T_s; Model Exchange: at the instant)",
                |p| &mut p.cond,
            )
            .mean(),
            P::output(
                "p_sw",
                &WATT,
                "Switching loss of the inverter, mean over the last step (PmsmDrive: over the last T_s; Model Exchange: at the instant)",
                |p| &mut p.sw,
            )
            .mean(),
            P::output(
                "p_friction",
                &WATT,
                "Friction and windage loss, mean over the last step (PmsmDrive: over the last T_s; Model Exchange: at the instant)",
                |p| &mut p.friction,
            )
            .mean(),
        ];

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact numbers")]
mod tests {
    use super::*;

    #[test]
    fn efficiency_is_a_number_in_every_quadrant() {
        assert_eq!(efficiency(100.0, 80.0), 0.8);
        assert_eq!(efficiency(-80.0, -100.0), 0.8);
        for (p_in, p_mech) in [
            (0.0, 0.0),
            (5.0, 0.0),
            (5.0, -3.0),
            (-5.0, 3.0),
            (3.0, 5.0),
            (-5.0, -3.0),
            (0.0, 1.0),
            (1.0, 1e-7),
            (0.0, -1.0),
        ] {
            assert_eq!(efficiency(p_in, p_mech), 0.0, "{p_in} W, {p_mech} W");
        }
    }
}
