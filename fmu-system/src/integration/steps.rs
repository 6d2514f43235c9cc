//! One step of an integrator, shared by both methods.

use super::hybrid::{HybridSystem, TrialError};

/// A step from `x` at `t`, with the derivative `f`, to `x_end` at `t_end`, with the derivative `f_end`.
pub(super) struct Step {
    pub(super) t: f64,
    pub(super) t_end: f64,
    pub(super) x: Vec<f64>,
    pub(super) f: Vec<f64>,
    pub(super) x_end: Vec<f64>,
    pub(super) f_end: Vec<f64>,
    /// The stages between.
    pub(super) k: [Vec<f64>; 5],
    /// A state of a stage.
    pub(super) trial: Vec<f64>,
}

impl Step {
    pub(super) fn new(states: usize) -> Self {
        let zeros = || vec![0.0; states];
        let k = std::array::from_fn(|_| zeros());
        Self { t: 0.0, t_end: 0.0, x: zeros(), f: zeros(), x_end: zeros(), f_end: zeros(), k, trial: zeros() }
    }

    /// Stage `i`: the derivative at `t + c h` and the state `x + h (a_0 f + a_1 k_0 + a_2 k_1 + ...)`.
    pub(super) fn stage(
        &mut self,
        system: &mut impl HybridSystem,
        i: usize,
        c: f64,
        a: &[f64],
    ) -> Result<(), TrialError> {
        let h = self.t_end - self.t;
        combine(&mut self.trial, &self.x, h, a, &self.f, &self.k);
        system.derivatives(self.t + c * h, &self.trial, &mut self.k[i])
    }

    /// The end of the step, `x + h (b_0 f + b_1 k_0 + ...)`, with its derivative.
    pub(super) fn finish(&mut self, system: &mut impl HybridSystem, b: &[f64]) -> Result<(), TrialError> {
        let h = self.t_end - self.t;
        combine(&mut self.x_end, &self.x, h, b, &self.f, &self.k);
        system.derivatives(self.t_end, &self.x_end, &mut self.f_end)
    }

    /// The next step begins where this one ended.
    pub(super) fn accept(&mut self) {
        self.t = self.t_end;
        std::mem::swap(&mut self.x, &mut self.x_end);
        std::mem::swap(&mut self.f, &mut self.f_end);
    }
}

/// `x + h (a_0 f + (a_1 k_0 + a_2 k_1 + ...))`, slope by slope: states are independent of one another.
fn combine(to: &mut [f64], x: &[f64], h: f64, a: &[f64], f: &[f64], k: &[Vec<f64>]) {
    // The neutral element of sums: -0 + x has the bits of x.
    to.fill(-0.0);
    for (a, k) in a[1..].iter().zip(k) {
        to.iter_mut().zip(k).for_each(|(to, k)| *to += a * k);
    }
    for ((to, x), f) in to.iter_mut().zip(x).zip(f) {
        *to = x + h * (a[0] * f + *to);
    }
}
