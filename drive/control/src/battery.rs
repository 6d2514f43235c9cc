//! Limits of the current of the DC link, which the controller keeps by limiting the torque.
//!
//! With the estimates of the machine, the torque tau at the mechanical speed w requires the power
//!
//! ```text
//! p(tau) = w tau + 1.5 R (i_d^2 + i_q^2),  i_q = tau / (1.5 n_p (psi_M - dL i_d)),  dL = L_q - L_d
//! i_dc_min u_dc <= p(tau) <= i_dc_max u_dc
//! ```
//!
//! i_d is taken from the last references; p is then a parabola, and each torque limit is one of its roots. The loss of
//! i_d follows the references through a low-pass: with maximum torque per ampere i_d depends on the torque, and the limits
//! would otherwise alternate between two samples. The controller neglects the losses of iron and inverter.
//!
//! At standstill, i_0 of the low-speed law consumes 1.5 R i_0^2 without producing torque. It is lowered to the current that uses
//! half of the limit; the other half remains for i_q, so that the drive can start:
//!
//! ```text
//! i_0 <= sqrt(i_dc_max u_dc / (3 R))
//! ```
//!
//! Derived here. u in V, i in A, w in rad/s, tau in N.m.

use drive_base::frame::DqHat;
use drive_base::motor::Motor;
use fmu_core::unit::AMPERE;
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Share of the new loss in the low-pass at each sample.
const SHARE: f64 = 0.25;

/// Maximum number of rounds for a settled drive, and the relative change of the limit at which they end.
const ROUNDS: u32 = 100;
const SMALL: f64 = 1e-12;

/// Limits of the current of the DC link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DcLimits {
    /// They are in use.
    pub used: bool,
    /// Maximum current in A, >= 0.
    pub max: f64,
    /// Minimum current in A, <= 0.
    pub min: f64,
}

impl Default for DcLimits {
    fn default() -> Self {
        Self { used: false, max: 10.0, min: -10.0 }
    }
}

impl DcLimits {
    /// Maximum i_0 (A) of the low-speed law on a link of `u_dc` (V).
    #[inline]
    pub fn i_0(&self, motor: &Motor, u_dc: f64) -> f64 {
        (self.max * u_dc / (3.0 * motor.R_s)).sqrt()
    }
}

/// State: the loss of i_d.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Battery {
    /// In W.
    p_d: f64,
}

impl Battery {
    /// Maximum magnitudes of negative and of positive torque at the mechanical `speed` (rad/s) and the link's `u_dc` (V), after a
    /// sample with the references `i` (A).
    pub fn limits(&mut self, par: &DcLimits, motor: &Motor, u_dc: f64, speed: f64, i: DqHat) -> (f64, f64) {
        let R = 1.5 * motor.R_s;
        self.p_d += SHARE * (R * i.d() * i.d() - self.p_d);
        par.torques(motor, u_dc, speed, (i.d(), self.p_d))
    }
}

impl DcLimits {
    /// Maximum magnitudes of negative and of positive torque of a settled drive, whose i_d follows from the torque: `i_d` gives it
    /// (A) for a torque (N.m). The fixed point of [`Battery::limits`] for each sign, with a request beyond it.
    pub fn settled(&self, motor: &Motor, u_dc: f64, speed: f64, i_d: impl Fn(f64) -> f64) -> (f64, f64) {
        let of = |sign: f64, pick: fn((f64, f64)) -> f64| {
            let mut p_d = 0.0;
            let mut last = f64::INFINITY;
            let mut at = i_d(0.0);
            for _ in 0..ROUNDS {
                let limit = pick(self.torques(motor, u_dc, speed, (at, p_d)));
                if (limit - last).abs() <= SMALL * limit {
                    break;
                }
                last = limit;
                at = i_d(sign * limit);
                p_d += 0.5 * (1.5 * motor.R_s * at * at - p_d);
            }
            pick(self.torques(motor, u_dc, speed, (at, p_d)))
        };
        (of(-1.0, |limits| limits.0), of(1.0, |limits| limits.1))
    }

    /// Maximum magnitudes of negative and of positive torque with this i_d (A) and the loss (W) of it.
    #[inline]
    fn torques(&self, motor: &Motor, u_dc: f64, speed: f64, (i_d, p_d): (f64, f64)) -> (f64, f64) {
        let (R, par) = (1.5 * motor.R_s, self);
        let per_i_q = motor.torque(i_d, 1.0);
        let (a, w) = (R / (per_i_q * per_i_q), speed.abs());
        // Roots of a tau^2 + w tau = p, by their stable forms: with the speed, and against it.
        let far = |root: f64| if a > 0.0 { 0.5 * (w + root) / a } else { f64::INFINITY };
        let near = |p: f64, root: f64| if p > 0.0 { 2.0 * p / (w + root) } else { 0.0 };
        let free = par.max * u_dc - p_d;
        let root = (w * w + 4.0 * a * free).max(0.0).sqrt();
        let (with, mut against) = (near(free, root), if free > 0.0 || root > 0.0 { far(root) } else { 0.0 });
        let returned = p_d - par.min * u_dc;
        let square = w * w - 4.0 * a * returned;
        if square > 0.0 {
            against = against.min(near(returned, square.sqrt()));
        }
        if speed >= 0.0 { (against, with) } else { (with, against) }
    }
}

type P = Row<DcLimits>;

/// Variables of the limits; their owner supplies the prefix `limit.`.
pub const DC_LIMITS: &Table<DcLimits> = table![
    P::boolean_parameter(
        "i_dc_use",
        "Limits of the current of the DC link, kept by limiting the torque; false: no such limits",
        |p| &mut p.used,
    ),
    P::parameter("i_dc_max", &AMPERE, "Maximum current of the DC link with i_dc_use, 0 or more", |p| { &mut p.max })
        .tunable(),
    P::parameter("i_dc_min", &AMPERE, "Minimum current of the DC link with i_dc_use, 0 or less", |p| &mut p.min)
        .tunable(),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// The power of the torque `tau` with i_d = `i_d`.
    fn power(motor: &Motor, tau: f64, speed: f64, i_d: f64) -> f64 {
        let i_q = tau / motor.torque(i_d, 1.0);
        tau * speed + 1.5 * motor.R_s * (i_d * i_d + i_q * i_q)
    }

    /// At standstill, i_d = i_q = i_0 heat the winding with the power of the maximum current.
    #[test]
    fn the_current_of_the_low_speed_law_takes_the_power_of_the_limit() {
        let (motor, par) = (Motor::IPMSM_2_2_KW, DcLimits { used: true, max: 2.0, min: -1.0 });
        let i_0 = par.i_0(&motor, 540.0);
        let p = power(&motor, motor.torque(i_0, i_0), 0.0, i_0);
        assert!((p / 1080.0 - 1.0).abs() < 1e-12 && i_0 > 1.5, "{i_0} A, {p} W");
    }

    #[test]
    fn the_limits_take_the_power_of_the_limits() {
        let motor = Motor::IPMSM_2_2_KW;
        let par = DcLimits { used: true, max: 2.0, min: -1.0 };
        for speed in [-200.0, -60.0, -1.0, 0.0, 1.0, 60.0, 200.0] {
            for i_d in [0.0, -3.0] {
                let mut battery = Battery { p_d: 1.5 * motor.R_s * i_d * i_d };
                let (low, high) = battery.limits(&par, &motor, 540.0, speed, DqHat::new(i_d, 1.0));
                for tau in [high, -low] {
                    let p = power(&motor, tau, speed, i_d);
                    let [max, min] = [2.0 * 540.0, -540.0];
                    let at = if tau * speed >= 0.0 {
                        max
                    } else if p < 0.0 {
                        min
                    } else {
                        max
                    };
                    assert!((p - at).abs() < 1e-9 * max, "{speed} rad/s, {tau} N.m: {p} W, not {at} W");
                }
                assert!(low > 0.0 && high > 0.0, "{low} {high}");
            }
        }
    }

    #[test]
    fn nothing_is_left_where_i_d_alone_takes_it() {
        let (motor, par) = (Motor::IPMSM_2_2_KW, DcLimits { used: true, max: 0.1, min: -1.0 });
        let mut battery = Battery { p_d: 200.0 };
        let (low, high) = battery.limits(&par, &motor, 540.0, 10.0, DqHat::new(-6.0, 0.0));
        assert!(high.abs() < 1e-12 && low >= 0.0, "{low} {high}");
    }

    #[test]
    fn without_resistance_it_is_power_over_speed() {
        let (motor, par) = (Motor { R_s: 0.0, ..Motor::IPMSM_2_2_KW }, DcLimits { used: true, max: 2.0, min: -1.0 });
        let (low, high) = Battery::default().limits(&par, &motor, 500.0, 50.0, DqHat::ZERO);
        assert!((high - 20.0).abs() < 1e-12 && (low - 10.0).abs() < 1e-12, "{low} {high}");
    }

    /// The power of i_d is smoothed: a quarter of the change in a sample.
    #[test]
    fn the_power_of_i_d_follows_in_some_samples() {
        let (motor, par, mut battery) = (Motor::IPMSM_2_2_KW, DcLimits::default(), Battery::default());
        let whole = 1.5 * motor.R_s * 16.0;
        for share in [0.25, 0.4375] {
            battery.limits(&par, &motor, 540.0, 50.0, DqHat::new(-4.0, 1.0));
            assert!((battery.p_d / whole - share).abs() < 1e-12, "{} W of {whole} W", battery.p_d);
        }
    }
}
