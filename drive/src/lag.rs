//! The torque of the current loop over a step, and the speed loop's integrator at a limit, for the drives without sampling.
//!
//! ```text
//! x = w_c h:   end = target + (start - target) exp(-x)      mean = target + (start - target) (1 - exp(-x)) / x
//! ```
//!
//! Torques in N.m, w_c in rad/s, h in s.

use drive_base::math::exp;

/// Width of the band above the limit, as a share of it, over which the integrator is brought to a stop.
const BAND: f64 = 0.01;

/// Torque after `h` (s) from `start` with the constant reference `target` at the `bandwidth` (rad/s); and the weight w of the start in the
/// mean, end + (start - end) w.
pub(crate) fn lagging(bandwidth: f64, start: f64, target: f64, h: f64) -> (f64, f64) {
    let x = h * bandwidth;
    let decay = exp(-x);
    let share = if x > 1e-3 { 1.0 / x - decay / (1.0 - decay) } else { 0.5 - x * (1.0 / 12.0) };
    (target + (start - target) * decay, share)
}

/// Share of the integration that goes on while the limits, of which the `highest` is given (N.m), cut the wanted torque by `cut` (N.m):
/// the integrator stops where the `error` of the speed (rad/s) would increase the cut, over a band, so that the rates are continuous.
pub(crate) fn integrates(cut: f64, error: f64, highest: f64) -> f64 {
    if cut * error > 0.0 { (1.0 - cut.abs() / (BAND * highest.max(1e-9))).max(0.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the sum of a fine grid, on both sides of the series.
    #[test]
    fn the_mean_is_that_of_the_exponential() {
        for x in [1e-6, 0.9e-3, 1.1e-3, 0.3, 5.0, 50.0] {
            let (end, share) = lagging(x, 3.0, 1.0, 1.0);
            let n = 100_000;
            let sum: f64 = (0..n).map(|k| 1.0 + 2.0 * exp(-x * (f64::from(k) + 0.5) / f64::from(n))).sum();
            let mean = sum / f64::from(n);
            assert!((end + (3.0 - end) * share - mean).abs() < 1e-7, "{x}");
            assert!((end - (1.0 + 2.0 * exp(-x))).abs() < 1e-15, "{x}");
        }
    }

    #[test]
    fn the_integrator_stops_over_a_band() {
        assert!((integrates(0.1, 1.0, 20.0) - 0.5).abs() < 1e-12);
        for (found, expected) in [
            (integrates(1.0, 1.0, 20.0), 0.0),
            (integrates(1.0, -1.0, 20.0), 1.0),
            (integrates(0.0, 1.0, 0.0), 1.0_f64),
        ] {
            assert_eq!(found.to_bits(), expected.to_bits());
        }
    }
}
