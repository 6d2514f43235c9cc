//! Trajectories: the watched variables after each step.

use crate::instance::Instance;
use crate::session::NotDetermined;

/// Steps `n` times with changing inputs and returns all watched variables after each step.
pub(super) fn trajectory(instance: &Instance<'_>, n: u32) -> Result<Vec<Vec<Vec<u64>>>, NotDetermined> {
    let watched = instance.session.watched();
    (0..n)
        .map(|k| {
            instance.change_inputs(k)?;
            instance.steps(1, instance.session.h())?;
            instance.snapshot(&watched)
        })
        .collect()
}

/// The first place where two trajectories differ: step and variable.
pub(super) fn difference(a: &[Vec<Vec<u64>>], b: &[Vec<Vec<u64>>]) -> Option<(usize, usize)> {
    if a.len() != b.len() {
        return Some((a.len().min(b.len()), 0));
    }
    a.iter().zip(b).enumerate().find_map(|(k, (x, y))| Some((k, x.iter().zip(y).position(|(x, y)| x != y)?)))
}
