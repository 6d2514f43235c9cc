//! Promises of a step about states and stop times: noSetFMUStatePriorToCurrentPoint, stopTimeDefined, tunable parameters.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod common;

use common::model::*;
use common::*;
use fmu_export::abi::types::*;
use std::ptr::null_mut;

const H: f64 = 0.01;

/// Steps `from` to `to` with or without the promise; the outputs' bits.
fn run(fmu: &Fmu, from: u32, to: u32, promise: bool) -> Vec<u64> {
    let mut bits = Vec::new();
    for k in from..to {
        let t = f64::from(k) * H;
        assert_eq!(fmu.set(&[U, GAIN], &[t.sin(), 1.0 + t]), OK);
        assert_eq!(fmu.step_promising(t, H, promise), OK);
        bits.extend([fmu.get(X), fmu.get(DOUBLE_GAIN), fmu.time()].map(f64::to_bits));
    }
    bits
}

#[test]
fn without_the_promise_a_step_back_is_redone_bit_for_bit() {
    for version in [2, 3] {
        let fmu = Fmu::started(version);
        run(&fmu, 0, 10, false);
        let mut state = null_mut();
        assert_eq!(fmu.save(&mut state), OK);
        let first = run(&fmu, 10, 30, false);
        assert_eq!(fmu.restore(state), OK);
        assert_eq!(run(&fmu, 10, 30, false), first);
        assert_eq!(fmu.free_state(&mut state), OK);
    }
}

#[test]
fn the_promise_changes_no_result_and_leaves_the_current_point_open() {
    for version in [2, 3] {
        let (free, bound) = (Fmu::started(version), Fmu::started(version));
        assert_eq!(run(&free, 0, 10, false), run(&bound, 0, 10, true));
        // The current point: the end of the step that was made under the promise.
        let mut here = null_mut();
        assert_eq!(bound.save(&mut here), OK);
        let ahead = run(&free, 10, 20, false);
        assert_eq!((bound.restore(here), run(&bound, 10, 20, true)), (OK, ahead.clone()));
        // An importer that breaks its promise gets the same results as without the promise.
        assert_eq!((bound.restore(here), run(&bound, 10, 20, false)), (OK, ahead));
        assert_eq!(bound.free_state(&mut here), OK);
    }
}

#[test]
fn a_stop_time_that_is_not_defined_is_not_looked_at() {
    for stop in [f64::NAN, f64::NEG_INFINITY, -1.0, 0.0, 0.1] {
        for version in [2, 3] {
            let fmu = Fmu::new(version);
            let status = unsafe {
                if version == 2 {
                    let no = Fmi2Boolean(0);
                    let status = fmi2SetupExperiment(fmu.it, no, f64::NAN, 0.0, no, stop);
                    assert_eq!(status, OK);
                    fmi2EnterInitializationMode(fmu.it)
                } else {
                    fmi3EnterInitializationMode(fmu.it, Fmi3Boolean(0), f64::NAN, 0.0, Fmi3Boolean(0), stop)
                }
            };
            assert_eq!((status, fmu.exit(), fmu.step(0.0, 1.0), fmu.step(1.0, 1e3)), (OK, OK, OK, OK), "{stop}");
        }
    }
}

#[test]
fn a_stop_time_survives_in_a_state_and_not_a_reset() {
    for version in [2, 3] {
        let bound = Fmu::new(version);
        assert_eq!((bound.enter(0.0, Some(1.0)), bound.exit()), (OK, OK));
        let mut state = null_mut();
        assert_eq!(bound.save(&mut state), OK);
        let other = Fmu::started(version);
        assert_eq!((other.restore(state), other.step(0.0, 2.0)), (OK, ERROR));
        assert!(other.error().contains("beyond the stop time 1"));
        assert_eq!((other.reset(), other.enter(0.0, None), other.exit(), other.step(0.0, 2.0)), (OK, OK, OK, OK));
        assert_eq!(bound.free_state(&mut state), OK);
    }
}

/// In step mode with `motor.R` = 10, where a `gain` above 5 is refused.
fn resistive(version: u8) -> Fmu {
    let fmu = Fmu::entered(version);
    assert_eq!((fmu.set(&[R], &[10.0]), fmu.exit(), fmu.step(0.0, H)), (OK, OK, OK));
    fmu
}

#[test]
fn a_tunable_parameter_takes_effect_in_the_next_step() {
    for version in [2, 3] {
        let (tuned, plain) = (resistive(version), resistive(version));
        assert_eq!(tuned.set(&[GAIN], &[4.0]), OK);
        // Between steps a getter returns the values of the last step, and the parameter as set.
        assert_eq!((tuned.get(GAIN), tuned.get(DOUBLE_GAIN), tuned.get(X)), (4.0, 2.0, plain.get(X)));
        assert_eq!((tuned.step(H, H), plain.step(H, H)), (OK, OK));
        assert_eq!((tuned.get(DOUBLE_GAIN), plain.get(DOUBLE_GAIN)), (8.0, 2.0));
        assert!(tuned.get(X) > plain.get(X));
    }
}

#[test]
fn tunable_parameters_that_do_not_fit_are_refused_by_the_step_which_changes_nothing() {
    for version in [2, 3] {
        let fmu = resistive(version);
        let (x, count) = (fmu.get(X), fmu.time());
        assert_eq!(fmu.set(&[GAIN], &[6.0]), OK);
        let mut pending = null_mut();
        assert_eq!(fmu.save(&mut pending), OK);
        let bytes = fmu.bytes();
        assert_eq!(fmu.step(H, H), ERROR);
        assert_eq!(fmu.error(), format!("fmi{version}DoStep: gain times motor.R is greater than 50"));
        assert_eq!((fmu.get(X), fmu.get(GAIN), fmu.get(DOUBLE_GAIN)), (x, 6.0, 2.0));
        assert!(version == 2 || fmu.get(TIME) == count);
        assert_eq!(fmu.state(), 'e');
        // A state saved before the step is still unchecked, as bytes too, and can be corrected.
        let mut stored = null_mut();
        assert_eq!(fmu.deserialize(&bytes, &mut stored), OK);
        for state in [pending, stored] {
            assert_eq!((fmu.restore(state), fmu.step(H, H)), (OK, ERROR));
            assert_eq!((fmu.restore(state), fmu.set(&[GAIN], &[5.0]), fmu.step(H, H)), (OK, OK, OK));
            assert_eq!(fmu.get(DOUBLE_GAIN), 10.0);
        }
        assert_eq!((fmu.free_state(&mut pending), fmu.free_state(&mut stored)), (OK, OK));
    }
}

#[test]
fn parameters_that_do_not_fit_are_refused_at_the_end_of_initialization_which_changes_nothing() {
    for version in [2, 3] {
        let fmu = Fmu::entered(version);
        let x = fmu.get(X);
        assert_eq!((fmu.set(&[R, GAIN], &[10.0, 6.0]), fmu.exit()), (OK, ERROR));
        assert!(fmu.error().ends_with("gain times motor.R is greater than 50"));
        assert_eq!((fmu.get(X), fmu.get(DOUBLE_GAIN), fmu.get(GAIN)), (x, 2.0, 6.0));
    }
}
