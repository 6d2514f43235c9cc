//! The rotor and its coupled load: one inertia with viscous and Coulomb friction and windage.
//!
//! J d speed/dt = tau_e - tau_load - B speed - k_w speed |speed| - tau_coulomb tanh(speed / w_coulomb).
//!
//! With an imposed speed, the external drive train integrates the motion: speed and angle are inputs, tau_e minus
//! friction is an output, and J belongs to the drive train.
//!
//! Rasmussen 2006 gives the torque but not the load; the friction belongs to the assumed machine. J in kg.m2, B in
//! N.m.s/rad, torques in N.m, speeds in rad/s (mechanical).

use drive_base::math::{abs, reciprocal, tanh};
use fmu_core::unit::{KG_M2, NEWTON_METER, NM_S_PER_RAD, NM_S2_PER_RAD2, SPEED};
use fmu_core::{Row, Scalar, Table, table};
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
        let whole = self.is_whole(speed.value());
        let coulomb = if whole { Whole::new(self, speed.value()).coulomb(speed) } else { self.near(speed) };
        viscous(self.B, self.k_w, speed) + coulomb
    }

    /// The Coulomb torque close to standstill.
    fn near<S: Scalar>(&self, speed: S) -> S {
        Standstill::new(self, speed.value()).coulomb(speed)
    }

    /// Torque of the shaft on the load in N.m: `tau_load`, or with an imposed speed the torque `given` (N.m) by the machine.
    #[inline]
    pub fn tau_shaft<S>(&self, given: S, tau_load: S) -> S {
        if self.imposed { given } else { tau_load }
    }

    /// Whether the Coulomb torque is at its full value at this `speed` (rad/s): tanh rounds to +-1.
    #[inline]
    pub fn is_whole(&self, speed: f64) -> bool {
        speed.abs() > 20.0 * self.w_coulomb
    }
}

/// Speed divided by w_coulomb up to which steps resolve the Coulomb torque; above, it is constant within 1e-3.
const RESOLVED: f64 = 4.0;

/// Minimum step in s, there and at the kinks of the inverter: it bounds the work for any parameters.
pub const SHORTEST_STEP: f64 = 1e-9;

/// Maximum change of the speed in a step there, divided by w_coulomb.
const LARGEST_CHANGE: f64 = 0.25;

impl Mechanics {
    /// A shorter length (s) for a step of `h` (s) between these speeds (rad/s) that was too long for a Coulomb torque that
    /// changes its sign: the step then ends at the zone's edge, or covers a small part of the zone. `None` if it was short enough.
    #[expect(clippy::inline_always, reason = "the compiler would call it")]
    #[inline(always)]
    pub fn shorter(&self, h: f64, from: f64, to: f64) -> Option<f64> {
        let (edge, small) = (RESOLVED * self.w_coulomb, LARGEST_CHANGE * self.w_coulomb);
        let (beyond, change) = (from.min(to) > edge || from.max(to) < -edge, (to - from).abs());
        // A larger change, or NaN, comes from a coupling that diverges.
        let diverges = change.is_nan() || change >= 1e5 * small.max(1.0);
        if beyond || diverges || h <= SHORTEST_STEP || change <= 1.01 * small || self.tau_coulomb == 0.0 || self.imposed
        {
            return None;
        }
        Some((h * (from.abs() - edge).max(small) / change).min(0.5 * h).max(SHORTEST_STEP))
    }
}

/// Torque of viscous friction and windage in N.m at the `speed` (rad/s).
#[inline]
fn viscous<S: Scalar>(B: f64, k_w: f64, speed: S) -> S {
    speed * (abs(speed) * k_w + B.into())
}

/// The Coulomb torque over a step.
pub trait Coulomb<S> {
    /// In N.m at the `speed` (rad/s).
    fn coulomb(&self, speed: S) -> S;
}

/// The full Coulomb torque in N.m, with the sign of the speed, valid where [`Mechanics::is_whole`].
#[derive(Clone, Copy, Debug)]
pub struct Whole(f64);

impl Whole {
    /// At speeds with the sign of this `speed` (rad/s).
    #[inline]
    pub fn new(mechanics: &Mechanics, speed: f64) -> Self {
        Self(mechanics.tau_coulomb.copysign(speed))
    }
}

impl<S: Scalar> Coulomb<S> for Whole {
    #[inline]
    fn coulomb(&self, _speed: S) -> S {
        self.0.into()
    }
}

/// The Coulomb torque at any speed, fast close to the speed at which a step begins.
#[derive(Clone, Copy, Debug)]
pub struct Standstill {
    tau_coulomb: f64,
    by_w_coulomb: f64,
    /// The speed in rad/s.
    speed: f64,
    /// Series of tanh x about it, x = speed / w_coulomb.
    series: [f64; 5],
}

impl Standstill {
    /// Maximum change of x for the series: the first omitted term is below 2e-16.
    const REACH: f64 = 1e-3;

    /// Close to this `speed` (rad/s). The coefficients of y = tanh x follow from y' = 1 - y^2.
    #[inline]
    pub fn new(mechanics: &Mechanics, speed: f64) -> Self {
        let by_w_coulomb = reciprocal(mechanics.w_coulomb);
        let y = tanh(speed * by_w_coulomb);
        let c_1 = 1.0 - y * y;
        let c_2 = -y * c_1;
        let c_3 = (-2.0 * y * c_2 - c_1 * c_1) * (1.0 / 3.0);
        let series = [y, c_1, c_2, c_3, -0.5 * (y * c_3 + c_1 * c_2)];
        Self { tau_coulomb: mechanics.tau_coulomb, by_w_coulomb, speed, series }
    }

    /// tanh(speed / w_coulomb) farther away.
    #[cold]
    #[inline(never)]
    fn far(&self, speed: f64) -> f64 {
        tanh(speed * self.by_w_coulomb)
    }
}

impl<S: Scalar> Coulomb<S> for Standstill {
    #[inline]
    fn coulomb(&self, speed: S) -> S {
        let &Self { tau_coulomb, by_w_coulomb, speed: near, series: [c_0, c_1, c_2, c_3, c_4] } = self;
        let x = (speed.value() - near) * by_w_coulomb;
        let y = if x.abs() <= Self::REACH {
            c_0 + x * ((c_1 + c_2 * x) + x * x * (c_3 + c_4 * x))
        } else {
            self.far(speed.value())
        };
        speed.chain(tau_coulomb * y, tau_coulomb * (1.0 - y * y) * by_w_coulomb)
    }
}

/// The shaft with constants for many evaluations.
#[derive(Clone, Copy, Debug)]
pub struct Shaft<'a, C, S = f64> {
    mechanics: &'a Mechanics,
    /// 1/J in 1/(kg.m2); 0 with an imposed speed.
    by_J: f64,
    /// Load torque in N.m.
    tau_load: S,
    coulomb: C,
}

/// The motion of the shaft at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Motion<S = f64> {
    /// Acceleration in rad/s2; 0 with an imposed speed.
    pub acceleration: S,
    /// Torque of the machine less friction in N.m.
    pub tau_given: S,
    /// Friction loss in W.
    pub p_friction: S,
}

impl<'a, C: Coulomb<S>, S: Scalar> Shaft<'a, C, S> {
    /// With the load `tau_load` (N.m).
    #[inline]
    pub fn new(mechanics: &'a Mechanics, tau_load: S, coulomb: C) -> Self {
        let by_J = if mechanics.imposed { 0.0 } else { reciprocal(mechanics.J) };
        Self { mechanics, by_J, tau_load, coulomb }
    }

    /// This shaft with a different form of its Coulomb torque.
    #[inline]
    pub fn with<D>(&self, coulomb: D) -> Shaft<'a, D, S> {
        let &Self { mechanics, by_J, tau_load, .. } = self;
        Shaft { mechanics, by_J, tau_load, coulomb }
    }

    /// Torque on the load in N.m if the machine delivers `tau_given` (N.m) in excess of friction.
    #[inline]
    pub fn tau_shaft(&self, tau_given: S) -> S {
        self.mechanics.tau_shaft(tau_given, self.tau_load)
    }

    /// The motion at `speed` (rad/s) and the torque `tau_e` (N.m).
    #[inline]
    pub fn motion(&self, speed: S, tau_e: S) -> Motion<S> {
        let &Self { mechanics, by_J, tau_load, ref coulomb } = self;
        let friction = viscous(mechanics.B, mechanics.k_w, speed) + coulomb.coulomb(speed);
        let tau_given = tau_e - friction;
        Motion { acceleration: (tau_given - tau_load) * by_J, tau_given, p_friction: friction * speed }
    }
}

type P = Row<Mechanics>;

/// Mechanical variables; their owner supplies the prefix `mechanics.`.
pub const MECHANICS: &Table<Mechanics> = table![
    P::parameter("J", &KG_M2, "Moment of inertia of rotor and load", |m| &mut m.J).above(0.0),
    P::parameter("B", &NM_S_PER_RAD, "Viscous friction coefficient", |m| &mut m.B).at_least(0.0),
    P::parameter("tau_coulomb", &NEWTON_METER, "Coulomb friction torque", |m| &mut m.tau_coulomb).at_least(0.0),
    P::parameter("w_coulomb", &SPEED, "Speed over which the Coulomb torque changes sign", |m| &mut m.w_coulomb)
        .above(0.0),
    P::parameter("k_w", &NM_S2_PER_RAD2, "Windage: torque over the square of the speed; 0: none", |m| { &mut m.k_w })
        .at_least(0.0),
    P::boolean_parameter(
        "imposed",
        "The drive train imposes speed_shaft and angle_shaft, receives tau_shaft and includes the inertia; false: the \
                 shaft turns freely under tau_load",
        |m| &mut m.imposed,
    ),
];

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
            let shaft = Shaft::new(&m, 0.4, Standstill::new(&m, start));
            for speed in [start, start + 0.1, start - 0.14, start + 3.0, -start, start * 2.0] {
                let Motion { acceleration, tau_given, p_friction } = shaft.motion(speed, 1.0);
                let friction = m.friction(speed);
                assert!((acceleration - (1.0 - 0.4 - friction) / m.J).abs() < 1e-12, "{start} {speed}");
                assert!(
                    (shaft.tau_shaft(tau_given) - 0.4).abs() < 1e-15 && (p_friction - friction * speed).abs() < 1e-14
                );
            }
        }
        let imposed = Mechanics { imposed: true, ..m };
        let shaft = Shaft::new(&imposed, 0.4, Standstill::new(&imposed, 2.0));
        let Motion { acceleration, tau_given, .. } = shaft.motion(2.0, 1.0);
        let tau_shaft = shaft.tau_shaft(tau_given);
        assert!((tau_shaft - 1.0 + imposed.friction(2.0)).abs() < 1e-15);
        assert!(acceleration == 0.0);
    }

    #[test]
    fn the_series_is_the_hyperbolic_tangent() {
        let m = Mechanics { tau_coulomb: 1.0, w_coulomb: 0.25, ..Mechanics::default() };
        for start in [-4.0, -0.3, -0.05, 0.0, 0.02, 0.21, 0.8, 6.0] {
            let near = Standstill::new(&m, start);
            for x in [-1e-3, -4e-4, 1e-5, 7e-4, 1e-3, 2e-3, -0.7] {
                let speed: f64 = start + 0.25 * 0.999 * x;
                let (got, wanted): (f64, f64) = (near.coulomb(speed), (speed / 0.25).tanh());
                assert!((got - wanted).abs() < 5e-16, "{start}, {x}: {got}, not {wanted}");
            }
        }
    }

    #[test]
    fn a_step_across_standstill_is_too_long() {
        let m = Mechanics { w_coulomb: 0.5, ..Mechanics::default() };
        // The zone ends at 2 rad/s; a step may change the speed by 0.125 rad/s there.
        assert_eq!(m.shorter(1e-4, 30.0, 2.5), None);
        assert_eq!(m.shorter(1e-4, -2.1, -9.0), None);
        assert_eq!(m.shorter(1e-4, 1.0, 0.9), None);
        let to_the_edge = m.shorter(1e-4, 3.0, -1.0).unwrap();
        assert!((to_the_edge - 0.25e-4).abs() < 1e-12, "{to_the_edge} s");
        let inside = m.shorter(1e-4, 1.0, -1.5).unwrap();
        assert!((inside - 0.05e-4).abs() < 1e-12, "{inside} s");
        assert_eq!(m.shorter(1e-4, 1.0, f64::NAN), None);
        assert_eq!(Mechanics { tau_coulomb: 0.0, ..m }.shorter(1e-4, 1.0, -1.5), None);
    }
}
