//! Whether stability limits the steps of the method of Dormand and Prince, not its error: the equations are stiff.
//!
//! The last two stages are derivatives at the end of the step, at two states. Their difference divided by the states'
//! difference estimates the largest eigenvalue; times the step, it is at most 3.3 in a stable step. Source: E. Hairer, G.
//! Wanner, Solving Ordinary Differential Equations II, 2nd ed., Springer 1996, IV.2, and their code DOPRI5 for the numbers.

use super::steps::Step;

/// Steps from one test to the next.
const EVERY: u32 = 200;
/// Product of step and eigenvalue above which a step is close to the limit.
const LIMIT: f64 = 3.25;
/// Number of steps close to the limit after which it is the limit.
const STIFF: u32 = 15;
/// Number of other steps after which the count begins again.
const NOT_STIFF: u32 = 6;
/// Remaining steps of a run that are worth a message: seconds.
const MANY: f64 = 1e5;

/// Counts of accepted steps.
#[derive(Default)]
pub(super) struct Stability {
    accepted: u32,
    close: u32,
    far: u32,
    known: bool,
}

impl Stability {
    /// Watches an accepted step; true once, when stability is known to limit the steps.
    pub(super) fn limits(&mut self, step: &Step, nominals: &[f64]) -> bool {
        self.accepted = self.accepted.wrapping_add(1);
        if self.known || self.close == 0 && !self.accepted.is_multiple_of(EVERY) {
            return false;
        }
        if eigenvalue(step, nominals) * (step.t_end - step.t) > LIMIT {
            (self.close, self.far) = (self.close + 1, 0);
            self.known = self.close == STIFF;
        } else {
            self.far += 1;
            if self.far == NOT_STIFF {
                (self.close, self.far) = (0, 0);
            }
        }
        self.known
    }
}

/// The magnitude of the largest eigenvalue in 1/s, estimated from an accepted step.
fn eigenvalue(step: &Step, nominals: &[f64]) -> f64 {
    let [.., k] = &step.k;
    let (mut slopes, mut states) = (0.0, 0.0);
    for (i, nominal) in nominals.iter().enumerate() {
        slopes += ((step.f_end[i] - k[i]) / nominal).powi(2);
        states += ((step.x_end[i] - step.trial[i]) / nominal).powi(2);
    }
    // Equal states have no eigenvalue to show.
    if states > 0.0 { f64::sqrt(slopes / states) } else { 0.0 }
}

/// Advice about steps of the size `h` (s) at the time `t` (s), if the run to the time `stop` (s) needs many of them.
pub fn advice(t: f64, h: f64, stop: f64) -> Option<String> {
    let steps = (stop - t) / h;
    (steps > MANY).then(|| {
        format!(
            "the equations are stiff: stability limits the steps of the explicit solver to {h:.1e} s at any tolerance, and the run to \
             {stop} s needs about {steps:.0e} of them; an implicit solver, such as CVode in FMPy, takes longer ones, and so may \
             the FMU itself in Co-Simulation"
        )
    })
}
