//! Modes beside speed and torque control: brake, coast, a speed limit in torque mode, and torque limits as inputs.
//!
//! ```text
//! brake              speed control at 0, without the ramp, |tau| <= brake.tau; without brake.hold, the integral part stays 0
//! coast              torque mode at 0 N.m, without the current of the low-speed law
//! limit.tau_use      tau_limit_min <= tau <= tau_limit_max, in every mode
//! limit.speed_use    in torque mode, i_q between L and U:    U = K_p (w_max - w) + I,   L = K_p (w_min - w) + I
//!                    beyond U dI/dt = K_i (w_max - w), beyond L dI/dt = K_i (w_min - w), between them dI/dt = -w_s I
//! ```
//!
//! The brake's torque is against the motion: |tau| = brake.tau down to the speed brake.tau / (K K_p) = brake.tau / (J w_s), from there
//! in proportion to the speed, so that it ends with the motion. A brake that holds then supplies the torque of the load at standstill;
//! without `brake.hold`, a load moves the shaft at tau_load / (J w_s), and no current of the low-speed law flows. `brake` has priority
//! over `coast`.
//!
//! Both bounds of the speed have one integral part: L < U always, so at most one of them acts. A constant torque reaches its bound with
//! the damping 1: the speed exceeds it by exp(-2) tau / (J w_s). K_p and K_i are those of the [speed loop](crate::speed).
//!
//! A change to the speed loop begins at the present speed and torque. Derived here; speeds mechanical in rad/s, i and I in A.

use crate::speed::{SpeedController, SpeedGains};
use fmu_core::unit::{NEWTON_METER, SPEED};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Torque in N.m that limits nothing.
const ANY: f64 = 1e6;

/// Bounds of the speed in torque mode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpeedRange {
    /// They act.
    pub used: bool,
    /// Maximum mechanical speed in rad/s, >= 0.
    pub max: f64,
    /// Minimum mechanical speed in rad/s, <= 0.
    pub min: f64,
}

/// The brake.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Brake {
    /// Maximum torque in N.m, > 0.
    pub tau: f64,
    /// It holds a load at standstill.
    pub hold: bool,
}

/// Parameters of the modes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Modes {
    /// Speed limit in torque mode.
    pub speed: SpeedRange,
    /// The inputs limit the torque.
    pub tau_used: bool,
    /// The brake.
    pub brake: Brake,
}

impl Default for Modes {
    fn default() -> Self {
        Self {
            speed: SpeedRange { used: false, max: 200.0, min: -200.0 },
            tau_used: false,
            brake: Brake { tau: ANY, hold: true },
        }
    }
}

/// Inputs of the modes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModeInputs {
    /// The drive brakes.
    pub brake: bool,
    /// The drive coasts.
    pub coast: bool,
    /// Maximum torque in N.m, >= 0.
    pub tau_max: f64,
    /// Minimum torque in N.m, <= 0.
    pub tau_min: f64,
}

impl Default for ModeInputs {
    fn default() -> Self {
        Self { brake: false, coast: false, tau_max: ANY, tau_min: -ANY }
    }
}

/// What the loops follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Follows {
    /// The speed or torque reference.
    #[default]
    Reference,
    /// Standstill.
    Brake,
    /// No torque.
    Coast,
}

impl ModeInputs {
    /// What the loops follow.
    #[inline]
    pub fn follows(&self) -> Follows {
        match *self {
            Self { brake: true, .. } => Follows::Brake,
            Self { coast: true, .. } => Follows::Coast,
            _ => Follows::Reference,
        }
    }
}

impl Modes {
    /// Whether the drive brakes without holding: the shaft is free at standstill.
    #[inline]
    pub fn frees(&self, follows: Follows) -> bool {
        follows == Follows::Brake && !self.brake.hold
    }

    /// Whether the inputs allow the torque `tau` (N.m).
    pub fn allows(&self, inputs: &ModeInputs, tau: f64) -> bool {
        !self.tau_used || (inputs.tau_min..=inputs.tau_max).contains(&tau)
    }

    /// Minimum and maximum torque in N.m under these `inputs`.
    pub fn torques(&self, inputs: &ModeInputs) -> [f64; 2] {
        let brake = if inputs.brake { self.brake.tau } else { f64::INFINITY };
        if self.tau_used { [inputs.tau_min.max(-brake), inputs.tau_max.min(brake)] } else { [-brake, brake] }
    }
}

impl SpeedRange {
    /// Bounds of i_q in A at the mechanical speed `w` (rad/s), with the integral part `integral` (A).
    #[inline]
    pub fn bounds(&self, gains: &SpeedGains, integral: f64, w: f64) -> [f64; 2] {
        let [k_p, _] = gains.slopes();
        [self.min, self.max].map(|bound| k_p * (bound - w) + integral)
    }
}

impl SpeedController {
    /// In torque mode, the reference of i_q in A for the `wanted` one (A) within a `range` of speed at the speed `w` (rad/s) and within
    /// `limits` (A); one sample of `T_s` (s). `bandwidth` is that of the speed loop in rad/s.
    pub fn within_range(
        &mut self,
        (gains, bandwidth): (&SpeedGains, f64),
        range: &SpeedRange,
        (w, wanted): (f64, f64),
        (low, high): (f64, f64),
        T_s: f64,
    ) -> f64 {
        let [lower, upper] = range.bounds(gains, self.integral(), w);
        let wanted = wanted.clamp(low, high);
        let bounded = wanted.min(upper).max(lower);
        let i_q = bounded.clamp(low, high);
        let error = if wanted > upper {
            range.max - w
        } else if wanted < lower {
            range.min - w
        } else {
            self.fade(bandwidth, T_s);
            return i_q;
        };
        if (bounded - i_q) * error <= 0.0 {
            self.integrate(gains, error, T_s);
        }
        i_q
    }
}

type P = Row<Modes>;

/// The parameters, with their whole names.
pub const MODES: &Table<Modes> = table![
    P::boolean_parameter(
        "limit.tau_use",
        "tau_limit_max and tau_limit_min limit the torque; false: they have no effect",
        |p| { &mut p.tau_used }
    ),
    P::boolean_parameter(
        "limit.speed_use",
        "In torque mode, the torque is reduced, and reversed, at limit.speed_max and limit.speed_min; false: no limit of the speed",
        |p| &mut p.speed.used,
    ),
    P::parameter("limit.speed_max", &SPEED, "Maximum mechanical speed in torque mode", |p| &mut p.speed.max)
        .at_least(0.0)
        .tunable(),
    P::parameter("limit.speed_min", &SPEED, "Minimum mechanical speed in torque mode, 0 or less", |p| &mut p.speed.min)
        .at_most(0.0)
        .tunable(),
    P::parameter(
        "brake.tau",
        &NEWTON_METER,
        "Maximum torque of the brake; beyond the limits of the drive, its full torque",
        |p| { &mut p.brake.tau }
    )
    .above(0.0)
    .tunable(),
    P::boolean_parameter(
        "brake.hold",
        "The brake holds a load at standstill; false: its torque is proportional to the speed near standstill, and ends there",
        |p| &mut p.brake.hold,
    ),
];

type I = Row<ModeInputs>;

/// The inputs.
pub const MODE_INPUTS: &Table<ModeInputs> = table![
    I::boolean_input(
        "brake",
        "Brakes to standstill with up to brake.tau against the motion, in speed and in torque control; false: the reference acts",
        |i| &mut i.brake,
    )
    .optional(),
    I::boolean_input(
        "coast",
        "No torque, in speed and in torque control, unless brake is true; false: the reference acts",
        |i| &mut i.coast,
    )
    .optional(),
    I::input("tau_limit_max", &NEWTON_METER, "Maximum torque, where tau_max applies", |i| &mut i.tau_max)
        .at_least(0.0)
        .read_with("limit.tau_use", "true"),
    I::input("tau_limit_min", &NEWTON_METER, "Minimum torque, where tau_min applies, 0 or less", |i| &mut i.tau_min)
        .at_most(0.0)
        .read_with("limit.tau_use", "true"),
];
