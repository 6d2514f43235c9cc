//! The rotor and its coupled load: one inertia with viscous and Coulomb friction and windage.
//!
//! J d speed/dt = tau_e - tau_load - B speed - k_w speed |speed| - tau_coulomb tanh(speed / w_coulomb).
//!
//! With an imposed speed, the external drive train integrates the motion: speed and angle are inputs, tau_e minus
//! friction is an output, and J belongs to the drive train.
//!
//! Rasmussen 2006 gives the torque but not the load; the friction is that of the assumed machine. J in kg.m2, B in
//! N.m.s/rad, torques in N.m, speeds in rad/s (mechanical).

use drive_base::math::{abs, reciprocal, tanh, tanh_beside};
use fmu_core::unit::{KG_M2, NEWTON_METER, NM_S_PER_RAD, NM_S2_PER_RAD2, SPEED};
use fmu_core::{Row, Scalar, Table};
use serde::{Deserialize, Serialize};

/// Inertia and friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mechanics {
    /// Moment of inertia in kg.m2, > 0.
    pub J: f64,
    /// Viscous friction in N.m.s/rad, >= 0.
    pub B: f64,
    /// Windage in N.m.s2/rad2, >= 0.
    pub k_w: f64,
    /// Coulomb friction torque in N.m, >= 0.
    pub tau_coulomb: f64,
    /// Speed in rad/s over which the Coulomb torque changes sign, > 0.
    pub w_coulomb: f64,
    /// Speed and angle come from an external drive train.
    pub imposed: bool,
}

impl Default for Mechanics {
    fn default() -> Self {
        Self { J: 1.5e-3, B: 2e-4, k_w: 0.0, tau_coulomb: 0.03, w_coulomb: 0.3, imposed: false }
    }
}

impl Mechanics {
    /// Friction torque in N.m at `speed` in rad/s, positive against positive speed.
    #[inline]
    pub fn friction<S: Scalar>(&self, speed: S) -> S {
        speed * viscous(self.B, self.k_w, speed) + self.coulomb(speed, tanh(speed.value() / self.w_coulomb))
    }

    /// Coulomb torque in N.m at `speed` (rad/s), where tanh(speed / w_coulomb) is `share`.
    #[inline]
    fn coulomb<S: Scalar>(&self, speed: S, share: f64) -> S {
        speed.chain(self.tau_coulomb * share, self.tau_coulomb * (1.0 - share * share) / self.w_coulomb)
    }

    /// Torque of the shaft on the load in N.m: `tau_load`, or with an imposed speed what the machine gives, `given` (N.m).
    #[inline]
    pub fn tau_shaft(&self, given: f64, tau_load: f64) -> f64 {
        if self.imposed { given } else { tau_load }
    }
}

/// Viscous friction and windage over the `speed` (rad/s), in N.m.s/rad.
#[inline]
fn viscous<S: Scalar>(B: f64, k_w: f64, speed: S) -> S {
    // A branch, so that a machine without windage does not wait for the sum.
    if k_w > 0.0 { abs(speed) * k_w + B.into() } else { B.into() }
}

/// The shaft with constants for many evaluations at almost the same speed.
#[derive(Clone, Copy, Debug)]
pub struct Shaft<'a, S = f64> {
    mechanics: &'a Mechanics,
    B: f64,
    k_w: f64,
    /// 1/J in 1/(kg.m2).
    by_J: f64,
    /// Load torque in N.m.
    tau_load: S,
    /// Speed in rad/s, and the share of the Coulomb torque at it, tanh(speed / w_coulomb).
    speed: f64,
    share: f64,
    /// The sign of the speed, and the speed in rad/s above which the share is +-1.
    sign: f64,
    full: f64,
    /// The whole Coulomb torque against the speed, in N.m.
    tau_full: f64,
}

/// The motion of the shaft at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Motion<S = f64> {
    /// Acceleration in rad/s2; 0 with an imposed speed.
    pub acceleration: S,
    /// Torque on the load in N.m.
    pub tau_shaft: S,
    /// Power to the load in W.
    pub p_shaft: S,
    /// Friction loss in W.
    pub p_friction: S,
}

impl<'a, S: Scalar> Shaft<'a, S> {
    /// With the load `tau_load` (N.m) at speeds close to `speed` (rad/s).
    #[inline]
    pub fn new(mechanics: &'a Mechanics, tau_load: S, speed: f64) -> Self {
        let sign = 1.0_f64.copysign(speed);
        // From here on, the nearest number to tanh is +-1.
        let full = 20.0 * mechanics.w_coulomb;
        let share = if speed.abs() > full { sign } else { tanh(speed / mechanics.w_coulomb) };
        let (B, k_w, by_J, tau_full) =
            (mechanics.B, mechanics.k_w, reciprocal(mechanics.J), sign * mechanics.tau_coulomb);
        Self { mechanics, B, k_w, by_J, tau_load, speed, share, sign, full, tau_full }
    }

    /// The same without windage.
    #[inline]
    pub fn without_windage(self) -> Self {
        Self { k_w: 0.0, ..self }
    }

    /// The motion at `speed` (rad/s) and the torque `tau_e` (N.m).
    #[inline]
    pub fn motion(&self, speed: S, tau_e: S) -> Motion<S> {
        let coulomb = if speed.value() * self.sign > self.full {
            self.tau_full.into()
        } else {
            self.mechanics.coulomb(speed, self.share(speed.value()))
        };
        let friction = speed * viscous(self.B, self.k_w, speed) + coulomb;
        let p_friction = friction * speed;
        if self.mechanics.imposed {
            let tau_shaft = tau_e - friction;
            return Motion { acceleration: 0.0.into(), tau_shaft, p_shaft: tau_shaft * speed, p_friction };
        }
        let acceleration = (tau_e - self.tau_load - friction) * self.by_J;
        Motion { acceleration, tau_shaft: self.tau_load, p_shaft: self.tau_load * speed, p_friction }
    }

    /// Share of the Coulomb torque at a `speed` (rad/s) near standstill.
    #[inline(never)]
    fn share(&self, speed: f64) -> f64 {
        let w_coulomb = self.mechanics.w_coulomb;
        let d = (speed - self.speed) * reciprocal(w_coulomb);
        if d.abs() <= 0.5 { tanh_beside(self.share, d) } else { tanh(speed / w_coulomb) }
    }
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
            P::parameter("k_w", &NM_S2_PER_RAD2, "Windage: torque over the square of the speed; 0: none", |m| {
                &mut m.k_w
            })
            .at_least(0.0),
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
        let windy = Mechanics { k_w: 2e-7, ..m };
        assert!((windy.friction(-800.0) - m.friction(-800.0) + 0.128).abs() < 1e-12, "against the motion");
    }

    #[test]
    fn the_shaft_near_a_speed_moves_as_its_equation_says() {
        let m = Mechanics { k_w: 1e-5, ..Mechanics::default() };
        for start in [-50.0, -6.01, -0.2, 0.0, 1e-3, 0.4, 5.9, 30.0] {
            let shaft = Shaft::new(&m, 0.4, start);
            for speed in [start, start + 0.1, start - 0.14, start + 3.0, -start, start * 2.0] {
                let Motion { acceleration, p_shaft, p_friction, .. } = shaft.motion(speed, 1.0);
                let friction = m.friction(speed);
                assert!((acceleration - (1.0 - 0.4 - friction) / m.J).abs() < 1e-12, "{start} {speed}");
                assert!((p_shaft - 0.4 * speed).abs() < 1e-15 && (p_friction - friction * speed).abs() < 1e-14);
            }
        }
        let imposed = Mechanics { imposed: true, ..m };
        let Motion { acceleration, tau_shaft, p_shaft, .. } = Shaft::new(&imposed, 0.4, 2.0).motion(2.0, 1.0);
        assert!((tau_shaft - 1.0 + imposed.friction(2.0)).abs() < 1e-15);
        assert!(acceleration == 0.0 && (p_shaft - 2.0 * (1.0 - imposed.friction(2.0))).abs() < 1e-15);
    }
}
