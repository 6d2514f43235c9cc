//! Rated load on the 2.2 kW machine: the courses of `fmu compare`, for drives with other parameters.
#![allow(dead_code)]

use drive::Pair;
use drive_study::compare::candidate::Candidate;
use drive_study::compare::measure::Follow;
use drive_study::compare::running;

fn candidate(pair: Pair) -> Candidate {
    let mut candidate = Candidate::of(pair.controller.model.parameters.estimator);
    candidate.bench.pair = pair;
    candidate
}

/// Takes `load` (pu) at `speed` (pu), settles and is measured for 0.5 s.
pub(crate) fn steady(pair: Pair, speed: f64, load: f64) -> Follow {
    running::loaded(&candidate(pair), speed, speed, load).unwrap()
}

/// Takes rated load at 0.5 pu, slows down to `speed` (pu), settles and is measured for 0.5 s.
pub(crate) fn slowed_down(pair: Pair, speed: f64) -> Follow {
    running::slowed_down(&candidate(pair), speed).unwrap()
}

/// A load step at `speed` (pu): dip of the speed in pu, peak angle error in deg.
pub(crate) fn load_step(pair: Pair, speed: f64, load: f64) -> (f64, f64) {
    let (follow, survived) = running::stepped(&candidate(pair), speed, load).unwrap();
    assert!(survived, "a step failed");
    (follow.dip, follow.angle.peak)
}
