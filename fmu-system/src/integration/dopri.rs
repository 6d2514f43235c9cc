//! The method of Dormand and Prince of order 5, with its error estimate of order 4 and its dense output of order 4.
//!
//! Source: J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comput. Appl. Math. 6 (1980) 19-26; dense
//! output and step control: E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., Springer
//! 1993, II.4 to II.6. The last stage is the derivative at the end, with which the next step begins.

use super::hybrid::{HybridSystem, TrialError};
use super::steps::Step;

/// Weights of the result.
const B: [f64; 6] = [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0];
/// Weights of the error estimate: the difference between the orders 5 and 4.
const E: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339_200.0, 22.0 / 525.0, -1.0 / 40.0];
/// Weights of the dense output's last coefficient.
const D: [f64; 7] = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
];

/// Steps from `step.t` to `step.t_end`.
pub(super) fn step<H: HybridSystem>(system: &mut H, step: &mut Step) -> Result<(), TrialError> {
    step.stage(system, 0, 1.0 / 5.0, &[1.0 / 5.0])?;
    step.stage(system, 1, 3.0 / 10.0, &[3.0 / 40.0, 9.0 / 40.0])?;
    step.stage(system, 2, 4.0 / 5.0, &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0])?;
    let a = [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0];
    step.stage(system, 3, 8.0 / 9.0, &a)?;
    let a = [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0];
    step.stage(system, 4, 1.0, &a)?;
    step.finish(system, &B)
}

/// Slopes of state `i` in the order of the weights.
fn slopes(step: &Step, i: usize) -> [f64; 7] {
    let [a, b, c, d, e] = step.k.each_ref().map(|k| k[i]);
    [step.f[i], a, b, c, d, e, step.f_end[i]]
}

/// The error estimate relative to the tolerance, root mean square over the states: a step with at most 1 is accepted.
pub(super) fn error(step: &Step, rtol: f64, nominals: &[f64]) -> f64 {
    let h = step.t_end - step.t;
    let of = |(i, nominal): (usize, &f64)| {
        let e: f64 = h * slopes(step, i).iter().zip(E).map(|(k, e)| e * k).sum::<f64>();
        let size = nominal.max(step.x[i].abs()).max(step.x_end[i].abs());
        (e / (rtol * size)).powi(2)
    };
    #[expect(clippy::cast_precision_loss, reason = "a number of states")]
    let count = nominals.len().max(1) as f64;
    (nominals.iter().enumerate().map(of).sum::<f64>() / count).sqrt()
}

/// Factor from the size of a step with this error to the size of the next one.
pub(super) fn factor(error: f64) -> f64 {
    // An error that is not finite shrinks the step as much as a large one.
    if error.is_finite() { (0.9 * error.powf(-0.2)).clamp(0.2, 5.0) } else { 0.2 }
}

/// The state at `t + theta h`.
pub(super) fn interpolate(step: &Step, theta: f64, x: &mut [f64]) {
    let h = step.t_end - step.t;
    let rest = 1.0 - theta;
    for (i, x) in x.iter_mut().enumerate() {
        let difference = step.x_end[i] - step.x[i];
        let start = h * step.f[i] - difference;
        let end = difference - h * step.f_end[i] - start;
        let last = h * slopes(step, i).iter().zip(D).map(|(k, d)| d * k).sum::<f64>();
        *x = step.x[i] + theta * (difference + rest * (start + theta * (end + rest * last)));
    }
}
