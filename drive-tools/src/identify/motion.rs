//! Angle and speed of the rotor without the steps of an encoder: a parabola through the neighbors of each row.

use super::record::BenchRecord;
use std::ops::Range;

/// Maximum half-width in s of the parabola around a row: a torque change inside it bends the parabola.
const REACH: f64 = 4e-3;

/// Noise of the angle in rad that hides such a change. Noise falls with the root of the time, the error of a bend grows with
/// its square, so the best time decreases with the noise to the power 0.4.
const NOISE: f64 = 1e-3;

/// Angle and speed. Rows near the end of a stretch have no parabola and belong to no stretch here.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Electrical angle in rad.
    pub theta: Vec<f64>,
    /// Electrical speed in rad/s.
    pub w: Vec<f64>,
    /// Intervals in which both are known.
    pub runs: Vec<Range<usize>>,
}

impl Motion {
    /// Least squares with `theta = c_0 + c_1 x + c_2 x^2` over `2 m + 1` rows: the angle is `c_0`, the speed `c_1`.
    pub fn of(record: &BenchRecord) -> Self {
        let reach = REACH * (noise(record) / NOISE).powf(0.4).min(1.0);
        let m = ((reach / record.step).round() as usize).max(3);
        let mut motion = Self { theta: record.theta.clone(), w: vec![0.0; record.theta.len()], runs: Vec::new() };
        let count = (2 * m + 1) as f64;
        // Sums of x^2 and x^4 over -m..=m.
        let square = |x: usize| (x * x) as f64;
        let (s_2, s_4) = (1..=m).fold((0.0, 0.0), |(a, b), x| (a + 2.0 * square(x), b + 2.0 * square(x) * square(x)));
        let determinant = count * s_4 - s_2 * s_2;
        for run in record.runs.iter().filter(|run| run.len() > 2 * m + 8) {
            let inner = run.start + m..run.end - m;
            // Running sums of 1, x and x^2 times the angle; started again now and then, because rounding
            // grows.
            for part in (inner.start..inner.end).step_by(16 * m).map(|from| from..(from + 16 * m).min(inner.end)) {
                let base = record.theta[part.start];
                let value = |k: usize| record.theta[k] - base;
                let [mut a, mut b, mut c] = [0.0; 3];
                for k in part.start - m..=part.start + m {
                    let x = k as f64 - part.start as f64;
                    (a, b, c) = (a + value(k), b + x * value(k), c + x * x * value(k));
                }
                for k in part.clone() {
                    if k > part.start {
                        // All x of the rows kept fall by one; a row leaves at -m - 1 and one comes at m.
                        let (old, new, edge) = (value(k - 1 - m), value(k + m), m as f64);
                        let (a_0, b_0) = (a - old, b + edge * old);
                        c = c - edge * edge * old - 2.0 * b_0 + a_0 + edge * edge * new;
                        b = b_0 - a_0 + edge * new;
                        a = a_0 + new;
                    }
                    motion.theta[k] = base + (s_4 * a - s_2 * c) / determinant;
                    motion.w[k] = b / s_2 / record.step;
                }
            }
            motion.runs.push(inner);
        }
        motion
    }
}

/// Noise of the angle in rad, steps of an encoder included: a smooth angle has no third difference.
fn noise(record: &BenchRecord) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0_f64);
    for w in record.runs.iter().flat_map(|run| record.theta[run.clone()].windows(4)) {
        squares += (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).powi(2);
        count += 1.0;
    }
    (squares / (20.0 * count.max(1.0))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_its_own_fit() {
        let (step, rows) = (1e-4, 9000);
        let at = |k: usize| {
            let t = k as f64 * step;
            (3.0 + 70.0 * t - 40.0 * t * t, 70.0 - 80.0 * t)
        };
        #[expect(clippy::single_range_in_vec_init, reason = "one stretch")]
        let record = BenchRecord {
            theta: (0..rows).map(|k| at(k).0).collect(),
            step,
            runs: vec![0..rows],
            ..BenchRecord::empty()
        };
        let motion = Motion::of(&record);
        assert_eq!((motion.runs.len(), motion.runs[0].clone()), (1, 3..rows - 3));
        for k in motion.runs[0].clone() {
            let (theta, w) = at(k);
            assert!(
                (motion.theta[k] - theta).abs() < 1e-9 && (motion.w[k] - w).abs() < 1e-6,
                "{k}: {} {theta}",
                motion.theta[k]
            );
        }
    }
}
