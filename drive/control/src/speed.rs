//! The speed loop: PI controller with set-point weight and limit; the integrator holds while the output is limited.
//!
//! i_q,ref = K_p (b w_ref - w) + I, K_p = J w_s / K, dI/dt = (K_p w_s / t_is)(w_ref - w), with K = 1.5 n_p psi_M and all
//! speeds mechanical. The integrator holds while i_q is at its limit and the error would increase the excess.
//!
//! With `ramp`, the reference approaches the set point at no more than that rate. In torque mode there is no speed
//! loop: the torque reference divided by K is the set point, within the same limits.
//!
//! The structure follows Rasmussen 2006, Fig. 2; the paper gives no gains. K_p cancels the inertia, so w_s is the
//! crossover frequency of the loop in rad/s; b < 1 reduces the overshoot. w in rad/s, K in N.m/A, J in kg.m2, K_p in
//! A.s/rad.

use crate::start::RAD_PER_S2;
use drive_base::math::{at_least, at_most};
use fmu_core::unit::{ONE, RAD_PER_S};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters of the speed loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpeedLoop {
    /// Bandwidth w_s in rad/s, > 0.
    pub bandwidth: f64,
    /// Integral time in units of 1/w_s, > 0.
    pub t_is: f64,
    /// Weight of the set point on the proportional part, 0..1.
    pub b: f64,
    /// Maximum rate of change of the reference in rad/s2, mechanical, >= 0; 0: no ramp.
    pub ramp: f64,
    /// Uses the torque reference instead of the speed reference.
    pub torque_mode: bool,
}

impl Default for SpeedLoop {
    fn default() -> Self {
        Self { bandwidth: 80.0, t_is: 4.0, b: 0.5, ramp: 0.0, torque_mode: false }
    }
}

impl SpeedLoop {
    /// Lag of the speed behind a moving reference in s: the proportional part acts on the share b, the integral part supplies
    /// the remainder.
    pub fn lag(&self) -> f64 {
        (1.0 - self.b) * self.t_is / self.bandwidth
    }

    /// The reference (rad/s) one sample of `T_s` (s) after `last`, on its way to `w_ref` (rad/s).
    #[inline]
    pub fn ramped(&self, last: f64, w_ref: f64, T_s: f64) -> f64 {
        let max_change = self.ramp * T_s;
        if self.ramp > 0.0 && (w_ref - last).abs() > max_change {
            last + max_change.copysign(w_ref - last)
        } else {
            w_ref
        }
    }
}

/// Gains, from bandwidth, inertia and torque constant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SpeedGains {
    k_p: f64,
    k_i: f64,
    b: f64,
}

impl SpeedGains {
    /// Gains for inertia `J` (kg.m2) and torque constant `k` (N.m/A); K_p in A.s/rad.
    pub fn new(par: &SpeedLoop, J: f64, k: f64) -> Self {
        let k_p = J * par.bandwidth / k;
        Self { k_p, k_i: k_p * par.bandwidth / par.t_is, b: par.b }
    }

    /// Reference of i_q in A without its limits, with the integral part `integral` (A) at the speeds `w_ref` and `w` (rad/s).
    #[inline]
    pub fn wanted(&self, integral: f64, w_ref: f64, w: f64) -> f64 {
        self.k_p * (self.b * w_ref - w) + integral
    }

    /// K_p in A.s/rad, and the change of the integral part with time and speed error in A/rad.
    #[inline]
    pub fn slopes(&self) -> [f64; 2] {
        [self.k_p, self.k_i]
    }

    /// Integral of the mechanical speed error in rad that takes the integral part from 0 to `i` (A).
    pub fn error_integral(&self, i: f64) -> f64 {
        i / self.k_i
    }
}

/// State: the integral part in A.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SpeedController {
    integral: f64,
}

impl SpeedController {
    /// Reference of i_q in A at speed reference `w_ref` and speed `w` (rad/s), within `limits` (A), and its value
    /// without them; one sample of `T_s` (s).
    #[inline]
    pub fn update(&mut self, gains: &SpeedGains, w_ref: f64, w: f64, limits: (f64, f64), T_s: f64) -> (f64, f64) {
        let ((low, high), error) = (limits, w_ref - w);
        let wanted = gains.wanted(self.integral, w_ref, w);
        let i_q_ref = if wanted >= low && wanted <= high { wanted } else { limited(wanted, low, high) };
        let further_in = (wanted - i_q_ref) * error > 0.0;
        if !further_in {
            self.integral += T_s * gains.k_i * error;
        }
        (i_q_ref, wanted)
    }
}

/// Not inlined, so that the current loop can begin before the limits are known.
#[cold]
#[inline(never)]
fn limited(wanted: f64, low: f64, high: f64) -> f64 {
    at_least(at_most(wanted, high), low)
}

impl SpeedController {
    /// The integral part in A.
    #[inline]
    pub fn integral(&self) -> f64 {
        self.integral
    }

    /// Integrates the speed `error` (rad/s) over one sample of `T_s` (s).
    pub fn integrate(&mut self, gains: &SpeedGains, error: f64, T_s: f64) {
        self.integral += T_s * gains.k_i * error;
    }

    /// Lets the integral part decay at the rate `bandwidth` (rad/s).
    pub fn fade(&mut self, bandwidth: f64, T_s: f64) {
        self.integral -= T_s * bandwidth * self.integral;
    }

    /// Moves the integral part by the `cut` (A) of a limit, at the rate `bandwidth` (rad/s).
    #[inline]
    pub fn follow(&mut self, bandwidth: f64, cut: f64, T_s: f64) {
        self.integral += T_s * bandwidth * cut;
    }

    /// Changes from gains `old` to `new` without a step in the output at speed reference `w_ref` and speed `w` (rad/s).
    pub fn retune(&mut self, old: &SpeedGains, new: &SpeedGains, w_ref: f64, w: f64) {
        let proportional = |gains: &SpeedGains| gains.k_p * (gains.b * w_ref - w);
        self.integral += proportional(old) - proportional(new);
    }

    /// Starts with the output `i_q` (A) at the speed reference `w_ref` and the speed `w` (rad/s).
    pub fn take_over(gains: &SpeedGains, w_ref: f64, w: f64, i_q: f64) -> Self {
        Self { integral: i_q - gains.k_p * (gains.b * w_ref - w) }
    }
}

type P = Row<SpeedLoop>;

/// Variables of the speed loop; their owner supplies the prefix `speed_loop.`.
pub const SPEED_LOOP: &Table<SpeedLoop> = table![
    P::parameter(
        "bandwidth",
        &RAD_PER_S,
        "Crossover frequency of the speed loop; from speed_ref to speed, the -3 dB bandwidth is half of it at b = 0.5",
        |p| &mut p.bandwidth,
    )
    .above(0.0)
    .tunable(),
    P::parameter("t_is", &ONE, "Integral time constant in units of 1/bandwidth", |p| &mut p.t_is).above(0.0).tunable(),
    P::parameter("b", &ONE, "Set-point weight of the proportional part", |p| &mut p.b)
        .at_least(0.0)
        .at_most(1.0)
        .tunable(),
    P::parameter("ramp", &RAD_PER_S2, "Maximum rate of change of the mechanical speed reference; 0: no ramp", |p| {
        &mut p.ramp
    })
    .at_least(0.0)
    .tunable(),
    P::boolean_parameter(
        "torque_mode",
        "Torque control by tau_ref within the limits, speed_ref ignored; false: speed control",
        |p| &mut p.torque_mode,
    ),
];

/// A message about bandwidths (rad/s) of the torque and of the speed loop in the wrong order.
///
/// At the crossover of the speed loop the lag of the torque takes 45 deg of the phase if both are equal, and with `t_is` = 4 nothing is
/// left if the torque has a quarter of the bandwidth.
pub fn order([torque, speed]: [f64; 2]) -> Option<String> {
    (speed > torque).then(|| {
        format!(
            "speed_loop.bandwidth = {speed} rad/s is above current.bandwidth = {torque} rad/s: the torque follows too slowly, and the speed \
             overshoots or oscillates; make current.bandwidth at least four times as large"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_follow_the_bandwidth() {
        let gains = SpeedGains::new(&SpeedLoop::default(), 1.5e-3, 0.675);
        assert!((gains.k_p - 1.5e-3 * 80.0 / 0.675).abs() < 1e-15);
        assert!((gains.k_i - gains.k_p * 20.0).abs() < 1e-12);
    }

    #[test]
    fn the_reference_comes_to_the_set_point_and_stays() {
        let ramp = SpeedLoop { ramp: 100.0, ..SpeedLoop::default() };
        let (mut w, mut n) = (5.0, 0);
        while (w + 2.0_f64).abs() > 1e-12 {
            let next = ramp.ramped(w, -2.0, 1e-3);
            assert!((w - next).abs() <= 0.1 + 1e-12 && next < w);
            (w, n) = (next, n + 1);
        }
        // Seventy steps, and one more for their rounding.
        assert!((70..=71).contains(&n), "{n}");
        assert_eq!(ramp.ramped(w, -2.0, 1e-3).to_bits(), (-2.0_f64).to_bits());
        assert_eq!(SpeedLoop::default().ramped(5.0, -2.0, 1e-3).to_bits(), (-2.0_f64).to_bits());
    }

    #[test]
    fn the_integrator_holds_at_the_limit_only_when_driven_in() {
        let gains = SpeedGains::new(&SpeedLoop::default(), 1.5e-3, 0.675);
        let mut held = SpeedController { integral: 7.0 };
        let (i_q_ref, wanted) = held.update(&gains, 10.0, 0.0, (-6.0, 6.0), 1e-4);
        assert!((i_q_ref - 6.0).abs() < 1e-15 && wanted > 7.0);
        assert!((held.integral - 7.0).abs() < 1e-15, "the error drives it in: held");
        held.update(&gains, -1.0, 0.0, (-6.0, 6.0), 1e-4);
        assert!(held.integral < 7.0, "the error drives it out: it moves");
    }

    /// K_p (b w_ref - w) + I, and I grows with K_i (w_ref - w).
    #[test]
    fn the_output_is_that_of_a_weighted_set_point() {
        let gains = SpeedGains::new(&SpeedLoop { b: 0.4, ..SpeedLoop::default() }, 1.5e-3, 0.675);
        let mut c = SpeedController { integral: 0.7 };
        let (i_q_ref, wanted) = c.update(&gains, 20.0, 11.0, (-6.0, 6.0), 1e-4);
        assert!((i_q_ref - (gains.k_p * (0.4 * 20.0 - 11.0) + 0.7)).abs() < 1e-12 && (wanted - i_q_ref).abs() < 1e-15);
        assert!((c.integral - 0.7 - 1e-4 * gains.k_i * 9.0).abs() < 1e-12);
        let (low, _) = c.update(&gains, 0.0, 90.0, (-6.0, 6.0), 1e-4);
        assert!((low + 6.0).abs() < 1e-15, "the lower limit: {low}");
    }

    #[test]
    fn tuning_and_a_handover_do_not_change_the_output() {
        let [old, new] = [80.0, 30.0].map(|bandwidth| {
            SpeedGains::new(&SpeedLoop { bandwidth, b: 0.01 * bandwidth, ..SpeedLoop::default() }, 1.5e-3, 0.675)
        });
        let (w_ref, w, limits) = (20.0, 11.0, (-60.0, 60.0));
        let mut c = SpeedController { integral: 0.7 };
        let (before, _) = c.clone().update(&old, w_ref, w, limits, 1e-4);
        c.retune(&old, &new, w_ref, w);
        let (after, _) = c.update(&new, w_ref, w, limits, 1e-4);
        assert!((after - before).abs() < 1e-12, "{before} {after}");
        let (begins, _) = SpeedController::take_over(&new, w_ref, w, 2.5).update(&new, w_ref, w, limits, 1e-4);
        assert!((begins - 2.5).abs() < 1e-12, "{begins}");
    }

    /// While a limit falls, the integral follows it: the unlimited output approaches the limit at the given rate.
    #[test]
    fn the_integral_follows_a_limit() {
        let mut c = SpeedController { integral: 5.0 };
        for _ in 0..1000 {
            c.follow(80.0, 2.0 - c.integral, 1e-4);
        }
        assert!((c.integral - 2.0 - 3.0 * (-8.0_f64).exp()).abs() < 1e-4, "{}", c.integral);
    }
}
