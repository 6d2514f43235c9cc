//! Euler's explicit method with a fixed step: x += s f(x) at the points k s of a grid that begins at the start of the simulation.
//!
//! A communication step takes the points in it, counted in integers, each with exactly the step s as weight; the remainder is
//! left to the next step, and until then the states keep their values at the last point. So the states at a grid point have the
//! same bits for any communication step. An event is handled at the grid point that follows it; it is not located.

use super::{MAX_INDICATORS, MAX_SUBSTEPS, arrive, check_indicators, count, crossed, handle, states};
use crate::rules::check_number;
use crate::{ContinuousTime, Elapsed, Events, Fault, SampleGrid, Step, Stop};
use std::ops::Range;

/// Advances a model without events by Euler's method: `N` is the number of its states, `fixed` the step of the method in s.
///
/// ```ignore
/// fn advance(&mut self, step: &Step) -> Result<(), Fault> {
///     integrate::euler::<Self, { Self::SCALARS }>(self, step, 0.1)
/// }
/// ```
///
/// # Errors
/// Those of [`ContinuousTime::derivatives`], a state that is not finite, or an unreasonable number of points.
pub fn euler<M: ContinuousTime, const N: usize>(model: &mut M, step: &Step, fixed: f64) -> Result<(), Fault> {
    const { check_number::<M>(N) };
    points(step, fixed)?.try_for_each(|k| forward::<M, N>(model, k, fixed))
}

/// [`euler`] for a model with events: a change of sign or a due time is handled at the next point of the grid, even at the end
/// of the step. Every step begins with an event, because inputs may have changed; an event due then is handled then.
///
/// # Errors
/// Those of [`euler`] and of [`Events::event`], including [`Fault::end`].
pub fn euler_hybrid<M: ContinuousTime + Events, const N: usize>(
    model: &mut M,
    step: &Step,
    fixed: f64,
) -> Result<(), Fault> {
    const { check_number::<M>(N) };
    let mut left = points(step, fixed)?;
    handle(model, step.start)?;
    while let Some(k) = walk::<M, N>(model, &mut left, fixed)? {
        handle(model, Elapsed::periods(k, fixed))?;
    }
    Ok(())
}

/// [`euler_hybrid`] up to the first event after the beginning of the step, which the importer handles:
/// [`EventMode::to_event`](crate::EventMode::to_event) in one line.
///
/// # Errors
/// As [`euler_hybrid`].
pub fn euler_to_event<M: ContinuousTime + Events, const N: usize>(
    model: &mut M,
    step: &Step,
    fixed: f64,
) -> Result<Stop, Fault> {
    const { check_number::<M>(N) };
    let (end, grid, mut left) = (step.end(), SampleGrid { period: fixed }, points(step, fixed)?);
    handle(model, step.start)?;
    let event = walk::<M, N>(model, &mut left, fixed)?;
    let at = event.filter(|&k| grid.passed(k, end)).map_or(end, |k| Elapsed::periods(k, fixed));
    Ok(Stop { at, event: event.is_some(), settles: event.is_some() })
}

/// Numbers of the points in a step: after its start, up to its end.
fn points(step: &Step, fixed: f64) -> Result<Range<u64>, Fault> {
    if step.h > MAX_SUBSTEPS * fixed {
        let allowed = format_args!("at most {} s", MAX_SUBSTEPS * fixed).to_string();
        return Err(Fault::value("the step size", format!("{} s", step.h), allowed));
    }
    let grid = SampleGrid { period: fixed };
    Ok(grid.first_after(step.start)..grid.first_after(step.end()))
}

/// Steps to the remaining points, up to the first with an event; returns its number.
fn walk<M: ContinuousTime + Events, const N: usize>(
    model: &mut M,
    left: &mut Range<u64>,
    fixed: f64,
) -> Result<Option<u64>, Fault> {
    const { check_indicators::<M>() };
    let count = M::INDICATORS.len();
    let (mut before, mut after) = ([0.0; MAX_INDICATORS], [0.0; MAX_INDICATORS]);
    model.indicators(Elapsed::periods(left.start.saturating_sub(1), fixed), &mut before[..count]);
    for k in left {
        forward::<M, N>(model, k, fixed)?;
        let now = Elapsed::periods(k, fixed);
        model.indicators(now, &mut after[..count]);
        if crossed(&before[..count], &after) || model.next(now).is_due(now) {
            return Ok(Some(k));
        }
        before = after;
    }
    Ok(None)
}

/// One step of the method, to the point `k`.
fn forward<M: ContinuousTime, const N: usize>(model: &mut M, k: u64, fixed: f64) -> Result<(), Fault> {
    let (now, start, mut dx) = (Elapsed::periods(k.saturating_sub(1), fixed), states::<M, N>(model), [0.0; N]);
    let n = count::<M, N>(model);
    model.derivatives(now, &mut dx[..n])?;
    let end = std::array::from_fn(|i| start[i] + fixed * dx[i]);
    arrive(model, now, &start, &end)
}
