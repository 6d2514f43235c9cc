//! The rotor and its coupled load: one inertia with viscous and Coulomb friction.
//!
//! J d speed/dt = tau_e - tau_load - B speed - tau_coulomb tanh(speed / w_coulomb).
//!
//! With an imposed speed, the external drive train integrates the motion: speed and angle are inputs, tau_e minus
//! friction is an output, and J belongs to the drive train.
//!
//! Rasmussen 2006 gives the torque but not the load; the friction is that of the assumed machine. J in kg.m2, B in
//! N.m.s/rad, torques in N.m, speeds in rad/s (mechanical).

use crate::math::{tanh, tanh_beside};
use fmu_core::unit::{KG_M2, NEWTON_METER, NM_S_PER_RAD, SPEED};
use fmu_core::{Row, Table};
use serde::{Deserialize, Serialize};

/// Inertia and friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mechanics {
    /// Moment of inertia in kg.m2, > 0.
    pub J: f64,
    /// Viscous friction in N.m.s/rad, >= 0.
    pub B: f64,
    /// Coulomb friction torque in N.m, >= 0.
    pub tau_coulomb: f64,
    /// Speed in rad/s over which the Coulomb torque changes sign, > 0.
    pub w_coulomb: f64,
    /// Speed and angle come from an external drive train.
    pub imposed: bool,
}

impl Default for Mechanics {
    fn default() -> Self {
        Self { J: 1.5e-3, B: 2e-4, tau_coulomb: 0.03, w_coulomb: 0.3, imposed: false }
    }
}

impl Mechanics {
    /// Friction torque in N.m at `speed` in rad/s, positive against positive speed.
    #[inline]
    pub fn friction(&self, speed: f64) -> f64 {
        self.B * speed + self.tau_coulomb * tanh(speed / self.w_coulomb)
    }

    /// What [`friction_beside`](Self::friction_beside) needs of the friction at `speed` (rad/s).
    #[inline]
    pub fn friction_at(&self, speed: f64) -> FrictionAt {
        FrictionAt { speed, share: tanh(speed / self.w_coulomb) }
    }

    /// Friction torque in N.m at a `speed` (rad/s), quickly if it is close to that of `start`.
    #[inline]
    pub fn friction_beside(&self, start: &FrictionAt, speed: f64) -> f64 {
        let d = (speed - start.speed) * (1.0 / self.w_coulomb);
        let share = if d.abs() > 0.5 {
            tanh(speed / self.w_coulomb)
        } else if start.share.abs() < 1.0 {
            tanh_beside(start.share, d)
        } else {
            start.share
        };
        self.B * speed + self.tau_coulomb * share
    }

    /// Torque of the shaft on the load in N.m: `tau_load`, or `tau_e` minus `friction` (N.m) with an imposed speed.
    #[inline]
    pub fn tau_shaft(&self, tau_e: f64, tau_load: f64, friction: impl FnOnce() -> f64) -> f64 {
        if self.imposed { tau_e - friction() } else { tau_load }
    }

    /// Acceleration in rad/s2 from electromagnetic, shaft and friction torque (N.m); zero with an imposed speed.
    #[inline]
    pub fn acceleration(&self, tau_e: f64, tau_shaft: f64, friction: f64) -> f64 {
        if self.imposed { 0.0 } else { (tau_e - tau_shaft - friction) * (1.0 / self.J) }
    }
}

/// The Coulomb friction at a speed, for the speeds close to it.
#[derive(Clone, Copy, Debug)]
pub struct FrictionAt {
    /// Speed in rad/s.
    speed: f64,
    /// Share of the Coulomb torque, tanh(speed / w_coulomb).
    share: f64,
}

type P = Row<Mechanics>;

/// Mechanical variables; their owner supplies the prefix `mechanics.`.
pub const MECHANICS: &Table<Mechanics> = &Table::new(
    const {
        &[
            P::parameter("J", &KG_M2, "Moment of inertia of rotor and load", |m| &mut m.J).above(0.0),
            P::parameter("B", &NM_S_PER_RAD, "Viscous friction coefficient", |m| &mut m.B).at_least(0.0),
            P::parameter("tau_coulomb", &NEWTON_METER, "Coulomb friction torque", |m| &mut m.tau_coulomb).at_least(0.0),
            P::parameter("w_coulomb", &SPEED, "Speed over which the Coulomb torque changes sign", |m| &mut m.w_coulomb)
                .above(0.0),
            P::boolean_parameter(
                "imposed",
                "The drive train imposes speed_shaft and angle_shaft and takes tau_shaft; the inertia is its own. false: the \
                 shaft turns freely under tau_load",
                |m| &mut m.imposed,
            ),
        ]
    },
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_is_odd_and_saturates() {
        let m = Mechanics::default();
        assert!((m.friction(10.0) - (2e-3 + 0.03)).abs() < 1e-9);
        assert_eq!(m.friction(-0.2).to_bits(), (-m.friction(0.2)).to_bits());
        assert!((m.acceleration(1.0, 0.4, m.friction(0.0)) - 400.0).abs() < 1e-9);
    }
}
