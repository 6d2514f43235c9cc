//! Scenarios of a running drive: start, ramp, reversal, load steps, rated load, lowest speed, bandwidth.

use super::candidate::{Candidate, Class, opposing};
use super::measure::{Effort, Follow, Measure, Outcome};
use crate::runner::{self, Moment, line, step};
use drive::Pair;
use drive::estimator::tracker::TrackerKind;
use fmu_core::Fault;
use std::f64::consts::TAU;

/// Starts from standstill to half the rated speed at angles over the full circle: the number of failures, and the worst
/// successful start.
pub(super) fn start(candidate: &Candidate, effort: Effort) -> Result<Outcome, Fault> {
    let (count, every) = if effort == Effort::Full { (24_u32, 15.0) } else { (4, 105.0) };
    let speed = if candidate.class == Class::Injection { 0.1 } else { 0.5 };
    // Without the voltage distortion by dead time, the start would be too easy.
    let starting = candidate.starting().with_dead_time(true);
    let (mut failed, mut peak, mut settling) = (0.0, 0.0_f64, 0.0_f64);
    for k in 0..count {
        let load = if k % 2 == 0 { 0.0 } else { 0.3 };
        let target = if k % 4 < 2 { speed } else { -speed };
        let angle: f64 = every * f64::from(k);
        let at = starting.with(|p| p.plant.model.parameters.initial.theta_e = angle.to_radians());
        let (mut follow, mut after) = (Follow::default(), Follow::default());
        let course = |t: f64, p: &mut Pair| (if t > 0.6 { target } else { 0.0 }, opposing(p, load));
        let survived = at.bench.run(2.5, course, |moment| {
            if moment.t > 0.6 {
                follow.add(moment);
            }
            if moment.t > 1.5 {
                after.add(moment);
            }
        })?;
        let settled = follow.settling_time(0.6);
        if !survived || after.lost() || !settled.is_finite() {
            failed += 1.0;
            continue;
        }
        (peak, settling) = (peak.max(after.angle.peak), settling.max(settled));
    }
    let measures = vec![
        Measure::new("failed starts", "of all", failed),
        Measure::new("peak angle error", "deg", peak),
        Measure::new("settling time", "s", settling),
    ];
    Ok(Outcome::Measured(measures, None))
}

/// From standstill to rated speed, measured from 0.15 pu on.
pub(super) fn ramp(candidate: &Candidate, _effort: Effort) -> Result<Outcome, Fault> {
    if let Some(why) = candidate.no_speed(1.0) {
        return Ok(Outcome::NotApplicable(why));
    }
    let reference = |t: f64| if t < 0.5 { 0.0 } else { line(t, 1.4, 0.15, 2.4, 1.0) };
    let run = candidate.starting().follow(3.2, 1.4, |t, p| (reference(t), opposing(p, 0.3)))?;
    Ok(dynamic(run, 2.4, false))
}

/// Speed reversal through standstill. The hybrid runs the profile that has a figure in the review's list.
pub(super) fn reversal(candidate: &Candidate) -> Result<Outcome, Fault> {
    if candidate.class == Class::Hybrid {
        return both_ways(candidate);
    }
    let top = if candidate.class == Class::Injection { 0.1 } else { 0.5 };
    let reference = |t| line(t, 0.7, top, 1.2, -top);
    let run = candidate.turning(top).follow(2.5, 0.5, |t, p| (reference(t), opposing(p, 0.3)))?;
    Ok(dynamic(run, 1.2, false))
}

/// 0 -> 0.95 -> -0.95 -> 0 pu under a constant 0.8 pu of load. The list does not give the slope of its ramps, which
/// determines the peak: 0.375 s from rest to speed reproduce it.
fn both_ways(candidate: &Candidate) -> Result<Outcome, Fault> {
    let (top, ramp, stay, begin) = (0.95, 0.375, 0.5, 0.8);
    let (back, home) = (begin + ramp + stay, begin + 3.0 * ramp + 2.0 * stay);
    let reference = |t| {
        let up = line(t, begin, 0.0, begin + ramp, top);
        up - line(t, back, 0.0, back + 2.0 * ramp, 2.0 * top) + line(t, home, 0.0, home + ramp, top)
    };
    let load = |t| line(t, 0.1, 0.0, 0.4, 0.8);
    let run = candidate.follow(home + ramp + 0.5, f64::NEG_INFINITY, |t, _| (reference(t), load(t)))?;
    Ok(dynamic(run, home + ramp, false))
}

/// A step of the load at 0.5 s, at a constant speed, both in pu; false if a step failed.
///
/// # Errors
/// The parameters are inconsistent.
pub fn stepped(candidate: &Candidate, speed: f64, load: f64) -> Result<(Follow, bool), Fault> {
    let duration = if speed == 0.0 { 4.0 } else { 2.0 };
    candidate.turning(speed).follow(duration, 0.5, |t, _| (speed, load * step(t, 0.5)))
}

/// A load step at a constant speed.
pub(super) fn load_step(candidate: &Candidate, speed: f64, load: f64) -> Result<Outcome, Fault> {
    let none = if speed == 0.0 { candidate.no_standstill() } else { None };
    if let Some(why) = none.or(candidate.no_speed(speed)) {
        return Ok(Outcome::NotApplicable(why));
    }
    let mut run = stepped(candidate, speed, load)?;
    run.0.show_until(2.0);
    Ok(dynamic(run, 0.5, true))
}

fn dynamic((follow, survived): (Follow, bool), from: f64, with_dip: bool) -> Outcome {
    let dip = with_dip.then(|| Measure::new("dip", "pu", if follow.lost() { f64::INFINITY } else { follow.dip }));
    let mut measures = vec![follow.rms(), follow.peak(), follow.settled(from)];
    measures.extend(dip);
    if !survived {
        for m in &mut measures {
            m.value = f64::INFINITY;
        }
    }
    Outcome::Measured(measures, Some(follow.into_trace(survived)))
}

/// Rated load at a constant speed, measured in the last half second.
pub(super) fn rated(candidate: &Candidate, speed: f64) -> Result<Outcome, Fault> {
    let none = if speed == 0.0 { candidate.no_standstill() } else { None };
    if let Some(why) = none.or(candidate.no_speed(speed.abs())) {
        return Ok(Outcome::NotApplicable(why));
    }
    let follow = slowed_down(candidate, speed)?;
    Ok(Outcome::Measured(vec![follow.mean("mean angle error"), follow.std(), follow.rms()], None))
}

/// Applies rated load, then changes to `speed` (pu). The load is applied at 0.5 pu, so that the result is the lowest running
/// speed and not the lowest starting speed.
///
/// # Errors
/// The parameters are inconsistent.
pub fn slowed_down(candidate: &Candidate, speed: f64) -> Result<Follow, Fault> {
    let side = if speed < 0.0 { -1.0 } else { 1.0 };
    // Injection lacks the voltage for half the speed, so it takes the load at the target speed.
    let first = if candidate.class == Class::Injection { speed } else { side * speed.abs().max(0.5) };
    loaded(candidate, first, speed, side)
}

/// Takes `load` (pu) at speed `first` (pu) within 0.3 s, ramps to `speed` (pu) at 0.5 pu/s, settles for 1.5 s and
/// measures for 0.5 s.
///
/// # Errors
/// The parameters are inconsistent.
pub fn loaded(candidate: &Candidate, first: f64, speed: f64, load: f64) -> Result<Follow, Fault> {
    let arrival = 1.2 + (first - speed).abs() / 0.5;
    let reference = |t| line(t, 1.2, first, arrival.max(1.2 + 1e-9), speed);
    let course = |t, _: &mut Pair| (reference(t), line(t, 0.1, 0.0, 0.4, load));
    let mut follow = Follow::default();
    let survived = candidate.turning(first).bench.run(arrival + 2.0, course, |moment| {
        if moment.t > arrival + 1.5 {
            // The ramp ends at `speed`, apart from rounding.
            follow.add(&Moment { reference: speed, ..*moment });
        }
    })?;
    Ok(if survived { follow } else { Follow::default() })
}

/// Rated driving load, applied at `speed` (pu) within 0.3 s.
pub(super) fn generating(candidate: &Candidate, speed: f64) -> Result<Outcome, Fault> {
    let follow = loaded(candidate, speed, speed, -1.0)?;
    let mut measures = vec![follow.mean("mean angle error"), follow.std(), follow.rms()];
    if !follow.holds() {
        for m in &mut measures {
            m.value = f64::INFINITY;
        }
    }
    Ok(Outcome::Measured(measures, None))
}

/// How rated load is applied at a trial speed.
type Approach = fn(&Candidate, f64) -> Result<Follow, Fault>;

fn lowest_of(
    candidate: &Candidate,
    approach: Approach,
    speeds: impl IntoIterator<Item = f64>,
) -> Result<Outcome, Fault> {
    let mut lowest = f64::INFINITY;
    for speed in speeds {
        if !approach(candidate, speed)?.holds() {
            break;
        }
        lowest = speed;
    }
    Ok(Outcome::Measured(vec![Measure::new("held down to", "pu", lowest)], None))
}

/// Lowest speed at which rated load is held, approached from above.
pub(super) fn lowest(candidate: &Candidate, effort: Effort) -> Result<Outcome, Fault> {
    lowest_by(candidate, effort, slowed_down)
}

/// Lowest speed at which rated load may be applied within 0.3 s.
pub(super) fn arriving(candidate: &Candidate, effort: Effort) -> Result<Outcome, Fault> {
    lowest_by(candidate, effort, |candidate, speed| loaded(candidate, speed, speed, 1.0))
}

fn lowest_by(candidate: &Candidate, effort: Effort, approach: Approach) -> Result<Outcome, Fault> {
    let all: &[f64] = if effort == Effort::Full {
        &[0.2, 0.15, 0.12, 0.1, 0.08, 0.06, 0.05, 0.04, 0.03, 0.02, 0.01, 0.0]
    } else {
        &[0.2, 0.1, 0.05, 0.03, 0.02, 0.0]
    };
    let low = if candidate.no_standstill().is_some() { 1e-9 } else { 0.0 };
    lowest_of(candidate, approach, all.iter().copied().filter(|&speed| speed >= low))
}

/// Lowest speed at which rated load is held without the term that the review omits, for estimators that have it.
pub(super) fn as_printed(candidate: &Candidate) -> Result<Outcome, Fault> {
    if !["DirectEmf", "EmfObserver", "ExtendedEmf", "VoltageFeedback"].contains(&candidate.entry.kind.name()) {
        return Ok(Outcome::NotApplicable("has no frame-speed term to drop"));
    }
    let printed = candidate.with(|p| p.controller.model.parameters.estimators.emf.frame_term = false);
    lowest_of(&printed, slowed_down, (10..=30_u32).rev().map(|k| 0.01 * f64::from(k)))
}

/// Bandwidth (-3 dB) of the speed loop at half the rated speed, from the true speed.
pub(super) fn bandwidth(candidate: &Candidate, effort: Effort) -> Result<Outcome, Fault> {
    if effort == Effort::Reduced {
        return Ok(Outcome::NotApplicable("left out of the reduced grid"));
    }
    candidate.bench.pair.clone().start()?;
    let speed = if candidate.class == Class::Injection { 0.1 } else { 0.5 };
    let bandwidth = runner::speed_bandwidth(&candidate.bench.pair, speed);
    Ok(Outcome::Measured(vec![Measure::new("speed bandwidth", "Hz", bandwidth)], None))
}

/// Bandwidth of the speed loop that the review's faster figure has, with the mechanical observer where the figure needs it.
pub(super) fn bandwidth_fast(candidate: &Candidate, effort: Effort) -> Result<Outcome, Fault> {
    // Speed loop and tracker in Hz: the mechanical observer makes the fast speed loop possible.
    let (loop_hz, observer_hz) = match candidate.entry.kind.name() {
        "VoltageModel" | "CurrentModel" | "KalmanFilter" => (26.0, None),
        "ExtendedEmf" => (60.0, Some(15.0)),
        "RotatingInjection" => (34.0, Some(25.0)),
        "PulsatingInjection" => (45.0, Some(25.0)),
        "SquareWaveInjection" => (36.0, Some(25.0)),
        "NearPwmInjection" => (30.0, Some(25.0)),
        _ => return Ok(Outcome::NotApplicable("no faster figure")),
    };
    let fast = candidate.with(|p| {
        let par = &mut p.controller.model.parameters;
        par.speed_loop.bandwidth = TAU * loop_hz;
        if let Some(hz) = observer_hz {
            (par.estimators.tracker.kind, par.estimators.tracker.bandwidth) =
                (TrackerKind::MechanicalObserver, TAU * hz);
        }
    });
    bandwidth(&fast, effort)
}
