//! The classical Runge-Kutta method of order 4.
//!
//! Source: E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., Springer 1993, table II.1.2.
//! Between the ends of a step, the cubic Hermite polynomial of states and derivatives interpolates with order 3 (II.6).

use super::hybrid::{HybridSystem, TrialError};
use super::steps::Step;

/// Steps from `step.t` to `step.t_end`.
pub(super) fn step<H: HybridSystem>(system: &mut H, step: &mut Step) -> Result<(), TrialError> {
    step.stage(system, 0, 0.5, &[0.5])?;
    step.stage(system, 1, 0.5, &[0.0, 0.5])?;
    step.stage(system, 2, 1.0, &[0.0, 0.0, 1.0])?;
    step.finish(system, &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0])
}

/// The state at `t + theta h`.
pub(super) fn interpolate(step: &Step, theta: f64, x: &mut [f64]) {
    let h = step.t_end - step.t;
    for (i, x) in x.iter_mut().enumerate() {
        let (x0, x1) = (step.x[i], step.x_end[i]);
        let (f0, f1) = (h * step.f[i], h * step.f_end[i]);
        let cubic = (1.0 - 2.0 * theta) * (x1 - x0) + (theta - 1.0) * f0 + theta * f1;
        *x = (1.0 - theta) * x0 + theta * x1 + theta * (theta - 1.0) * cubic;
    }
}
