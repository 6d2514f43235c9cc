//! Co-simulation of a model that is given by its derivatives, its events or its samples: the whole of its
//! [`advance`](crate::Model::advance) in one line.
//!
//! | | integrates | events |
//! |---|---|---|
//! | [`smooth`] | by Runge-Kutta | none |
//! | [`hybrid`], [`to_event`] | by Runge-Kutta | where they are due |
//! | [`euler`] | by Euler's method on a grid | none |
//! | [`euler_hybrid`], [`euler_to_event`] | by Euler's method on a grid | at the next point of the grid |
//! | [`sampled`] | nothing | samples |
//!
//! The classical Runge-Kutta method with equal substeps; an indicator's change of sign is located by regula
//! falsi and bisection in turn, each trial being a substep as accurate as the integration itself.

mod euler;

pub use euler::{euler, euler_hybrid, euler_to_event};

use crate::events::{bounded_by, grid};
use crate::rules::check_number;
use crate::{ContinuousTime, Elapsed, Events, Fault, Outcome, Sampled, Step, Stop};

/// Maximum number of substeps in one communication step.
const MAX_SUBSTEPS: f64 = 1e8;
/// Maximum number of events located by indicators in one communication step, in addition to one in every substep.
const MAX_LOCATED: f64 = 1e5;
/// Maximum number of calls of [`Events::event`] at one instant.
const MAX_ITERATIONS: usize = 100;
/// Maximum number of event indicators.
const MAX_INDICATORS: usize = 16;
/// An event is located to this fraction of a substep.
const WIDTH: f64 = 1e-9;

/// Advances a model without events: `N` is the number of its states, `longest` the longest substep in s.
///
/// ```ignore
/// fn advance(&mut self, step: &Step) -> Result<(), Fault> {
///     integrate::smooth::<Self, { Self::SCALARS }>(self, step, 1e-4)
/// }
/// ```
///
/// # Errors
/// Those of [`ContinuousTime::derivatives`], a state that is not finite, or an unreasonable number of substeps.
pub fn smooth<M: ContinuousTime, const N: usize>(model: &mut M, step: &Step, longest: f64) -> Result<(), Fault> {
    const { check_number::<M>(N) };
    let count = substeps(step.h, longest)?;
    let h = step.h / count;
    let (mut now, mut left) = (step.start, count);
    while left > 0.0 {
        rk4::<M, N>(model, now, h)?;
        now = now.plus(h);
        left -= 1.0;
    }
    Ok(())
}

/// Integrates a model with events, which happen where they are due: time events exactly, others where an indicator
/// changes its sign. Every step begins with an event, because inputs may have changed; an event due at the end of the step
/// belongs to the next one.
///
/// # Errors
/// Those of [`smooth`] and of [`Events::event`], including [`Fault::end`]; an unlimited sequence of events.
pub fn hybrid<M: ContinuousTime + Events, const N: usize>(
    model: &mut M,
    step: &Step,
    longest: f64,
) -> Result<(), Fault> {
    // Here and not in `run`: the compiler then names the line that calls this function.
    const { check_number::<M>(N) };
    let stop = run::<M, N>(model, step, longest, false)?;
    model.begin(stop.at);
    Ok(())
}

/// [`hybrid`] up to the first event after the beginning of the step, which the importer handles:
/// [`EventMode::to_event`](crate::EventMode::to_event) in one line.
///
/// # Errors
/// As [`hybrid`].
pub fn to_event<M: ContinuousTime + Events, const N: usize>(
    model: &mut M,
    step: &Step,
    longest: f64,
) -> Result<Stop, Fault> {
    const { check_number::<M>(N) };
    run::<M, N>(model, step, longest, true)
}

/// Integrates to the end of the step, or only to the first event.
fn run<M: ContinuousTime + Events, const N: usize>(
    model: &mut M,
    step: &Step,
    longest: f64,
    stops: bool,
) -> Result<Stop, Fault> {
    const { check_indicators::<M>() };
    let (mut now, end) = (step.start, step.end());
    let count = substeps(step.h, longest)?;
    let (mut budget, mut located) = (count + MAX_SUBSTEPS, count + MAX_LOCATED);
    handle(model, now)?;
    loop {
        let rest = end.since(now);
        if rest <= f64::EPSILON * step.h {
            break;
        }
        // An event at the end belongs to the next step, with its inputs.
        let next = model.next(now);
        let left = match next.left(now) {
            Some(left) if left < rest - next.width(end) => left,
            _ => rest,
        };
        if left <= 0.0 {
            return Err(standstill(now));
        }
        let h = left / substeps(left, longest)?;
        let passed = substep::<M, N>(model, now, h)?;
        budget -= 1.0;
        located -= f64::from(u8::from(passed.is_some()));
        if budget < 0.0 || located < 0.0 {
            return Err(standstill(now));
        }
        now = now.plus(passed.unwrap_or(h));
        if passed.is_some() || (model.next(now).is_due(now) && end.since(now) > model.next(now).width(now)) {
            if stops {
                return Ok(Stop { at: now, event: true, settles: passed.is_some() });
            }
            handle(model, now)?;
        }
    }
    Ok(Stop { at: end, event: stops && model.next(end).is_due(end), settles: false })
}

/// Checks that the event indicators fit.
const fn check_indicators<M: Events>() {
    assert!(M::INDICATORS.len() <= MAX_INDICATORS, "more event indicators than the integrator has room for");
}

/// Advances a model that acts only at its sample instants, with constant inputs.
///
/// # Errors
/// Those of [`Sampled::sample`]; more than 1e7 samples in the step.
#[inline]
pub fn sampled<M: Sampled>(model: &mut M, step: &Step) -> Result<(), Fault> {
    let (grid, end) = (grid(model), step.end());
    let (mut past, width) = (grid.past(model.samples(), end), grid.width());
    bounded_by(model, past, end)?;
    while past > width {
        model.show();
        model.sample()?;
        past = grid.past(model.samples(), end);
    }
    if past >= -width {
        model.show();
    }
    Ok(())
}

/// Handles an event at `now` until it needs no further update, or ends the simulation.
fn handle<M: Events>(model: &mut M, now: Elapsed) -> Result<(), Fault> {
    model.begin(now);
    for _ in 0..MAX_ITERATIONS {
        match model.event(now)? {
            Outcome { terminate: true, .. } => return Err(Fault::end(now)),
            Outcome { again: false, .. } => return Ok(()),
            _ => {}
        }
    }
    Err(Fault::new(format!("the event at {} s after the start does not settle", now.seconds())))
}

/// Whether an indicator has changed its sign.
fn crossed(before: &[f64], after: &[f64]) -> bool {
    before.iter().zip(after).any(|(a, b)| (*a > 0.0) != (*b > 0.0))
}

/// One substep of `h` (s), or a part of it that ends just after an indicator changes sign; returns its length.
fn substep<M: ContinuousTime + Events, const N: usize>(
    model: &mut M,
    now: Elapsed,
    h: f64,
) -> Result<Option<f64>, Fault> {
    let count = M::INDICATORS.len();
    let start = states::<M, N>(model);
    let (mut before, mut after) = ([0.0; MAX_INDICATORS], [0.0; MAX_INDICATORS]);
    model.indicators(now, &mut before[..count]);
    rk4::<M, N>(model, now, h)?;
    model.indicators(now.plus(h), &mut after[..count]);
    let crossed = |z: &[f64; MAX_INDICATORS]| crossed(&before[..count], z);
    if !crossed(&after) {
        return Ok(None);
    }
    // The bracket, with the indicators at its ends; the sign at its lower end equals the sign at the start.
    let (mut low, mut high, mut at_low, mut at_high, mut halve) = (0.0, h, before, after, false);
    while high - low > WIDTH * h {
        let line = |i: usize| at_low[i].abs() / (at_low[i].abs() + at_high[i].abs());
        let changed = (0..count).filter(|&i| (at_low[i] > 0.0) != (at_high[i] > 0.0));
        let share = if halve { 0.5 } else { changed.map(line).fold(1.0, f64::min).clamp(0.01, 0.99) };
        let middle = low + (high - low) * share;
        write::<M, N>(model, &start);
        rk4::<M, N>(model, now, middle)?;
        let mut z = [0.0; MAX_INDICATORS];
        model.indicators(now.plus(middle), &mut z[..count]);
        if crossed(&z) {
            (high, at_high) = (middle, z);
        } else {
            (low, at_low) = (middle, z);
        }
        halve = !halve;
    }
    write::<M, N>(model, &start);
    rk4::<M, N>(model, now, high)?;
    Ok(Some(high))
}

/// The states; those that the model has now come first.
fn states<M: ContinuousTime, const N: usize>(model: &mut M) -> [f64; N] {
    let mut all = [0.0; N];
    if const { !has_arrays::<M>() } {
        all = std::array::from_fn(|i| *M::STATES[i].at(model));
    } else {
        let mut places = all.iter_mut();
        for state in M::STATES {
            for (x, place) in state.all(model).iter().zip(&mut places) {
                *place = *x;
            }
        }
    }
    all
}

fn write<M: ContinuousTime, const N: usize>(model: &mut M, x: &[f64; N]) {
    if const { !has_arrays::<M>() } {
        for (state, x) in M::STATES.iter().zip(x) {
            *state.at(model) = *x;
        }
    } else {
        let mut values = x.iter();
        for state in M::STATES {
            for (place, x) in state.all(model).iter_mut().zip(&mut values) {
                *place = *x;
            }
        }
    }
    model.settle();
}

/// Number of states that the model has now: `N`, unless an array has become shorter.
fn count<M: ContinuousTime, const N: usize>(model: &mut M) -> usize {
    if const { !has_arrays::<M>() } {
        return N;
    }
    M::STATES.iter().map(|state| state.all(model).len()).sum::<usize>().min(N)
}

const fn has_arrays<M: ContinuousTime>() -> bool {
    let mut i = 0;
    while i < M::STATES.len() {
        if M::STATES[i].dimension().is_some() {
            return true;
        }
        i += 1;
    }
    false
}

/// One step of `h` (s) of the classical Runge-Kutta method.
fn rk4<M: ContinuousTime, const N: usize>(model: &mut M, now: Elapsed, h: f64) -> Result<(), Fault> {
    let start = states::<M, N>(model);
    let (mut sum, mut k, n) = ([0.0; N], [0.0; N], count::<M, N>(model));
    for (at, weight) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
        if at > 0.0 {
            let x = std::array::from_fn(|i| start[i] + at * h * k[i]);
            write::<M, N>(model, &x);
        }
        model.derivatives(if at > 0.0 { now.plus(at * h) } else { now }, &mut k[..n])?;
        for i in 0..N {
            sum[i] += weight * k[i];
        }
    }
    let end = std::array::from_fn(|i| start[i] + h / 6.0 * sum[i]);
    arrive(model, now, &start, &end)
}

/// Writes the states at the end of a substep from `now`; restores those at its `start` if one is not finite.
fn arrive<M: ContinuousTime, const N: usize>(
    model: &mut M,
    now: Elapsed,
    start: &[f64; N],
    end: &[f64; N],
) -> Result<(), Fault> {
    if let Some(i) = (0..N).find(|&i| !end[i].is_finite()) {
        write::<M, N>(model, start);
        let at = now.seconds();
        return Err(Fault::value(name_of::<M>(i), end[i], format_args!("a finite number, {at} s after the start")));
    }
    write::<M, N>(model, end);
    Ok(())
}

/// The name of the state that a scalar belongs to.
#[cold]
fn name_of<M: ContinuousTime>(scalar: usize) -> &'static str {
    let mut first = 0;
    let named = M::STATES.iter().find(|state| {
        first += state.most();
        scalar < first
    });
    named.map_or("a state", |state| state.name)
}

/// Number of equal substeps into which a step of `h` (s) is divided.
///
/// # Errors
/// An unreasonable number of substeps.
pub fn substeps(h: f64, longest: f64) -> Result<f64, Fault> {
    let count = (h / longest - 1e-9).ceil().max(1.0);
    if count <= MAX_SUBSTEPS {
        return Ok(count);
    }
    Err(Fault::value("the step size", format!("{h} s"), format_args!("at most {} s", MAX_SUBSTEPS * longest)))
}

#[cold]
fn standstill(now: Elapsed) -> Fault {
    Fault::new(format!("{} s after the start, events follow each other without time between them", now.seconds()))
}
