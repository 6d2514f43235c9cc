//! Steps that continue a simulation.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod common;

use common::model::*;
use common::*;

#[test]
fn a_step_begins_where_the_last_one_ended() {
    for version in [2, 3] {
        for start in [0.0, -5.0, 1e4, 1e9] {
            let h = 1e-3;
            let fmu = Fmu::new(version);
            assert_eq!((fmu.enter(start, None), fmu.exit()), (OK, OK));
            assert_eq!(fmu.time(), start);
            assert_eq!(fmu.step(start, h), OK);
            assert_eq!(fmu.time(), start + h);
            assert_eq!(fmu.step(start + h, h), OK);
            for away in [0.02 * h, -0.02 * h, h, -h, f64::NAN, f64::INFINITY] {
                let fmu = Fmu::new(version);
                assert_eq!((fmu.enter(start, None), fmu.exit(), fmu.step(start, h)), (OK, OK, OK));
                let x = fmu.get(X);
                assert_eq!(fmu.step(start + h + away, h), ERROR, "{start} {away}");
                let message = fmu.error();
                assert!(
                    message.contains("DoStep: currentCommunicationPoint = ")
                        && message.contains("the last step ended at")
                );
                assert_eq!(fmu.get(X), x);
                assert!(version == 2 || fmu.get(TIME) == start + h);
                assert_eq!(fmu.state(), 'e');
            }
        }
    }
}

#[test]
fn a_hundredth_of_a_step_is_tolerated() {
    let fmu = Fmu::started(3);
    assert_eq!(fmu.step(0.009e-3, 1e-3), OK);
    assert_eq!(fmu.step(1.000e-3, 1e-3), OK);
    assert_eq!(fmu.step(2.011e-3, 1e-3), ERROR);
}

#[test]
fn step_sizes_are_finite_and_positive() {
    for version in [2, 3] {
        for h in [0.0, -0.0, -1e-3, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324] {
            let fmu = Fmu::started(version);
            assert_eq!(fmu.step(0.0, h), ERROR, "{h}");
            assert!(fmu.error().contains("communicationStepSize = "));
        }
        let fmu = Fmu::new(version);
        assert_eq!((fmu.enter(1e9, None), fmu.exit()), (OK, OK));
        assert_eq!(fmu.step(1e9, 1e-9), ERROR);
        assert!(fmu.error().contains("does not advance the time"));
    }
}

#[test]
fn a_million_accumulated_steps() {
    for version in [2, 3] {
        let fmu = Fmu::new(version);
        let h = 1e-4 / 3.0;
        let stop = 1e6 * h;
        assert_eq!((fmu.enter(0.0, Some(stop)), fmu.exit()), (OK, OK));
        let mut t = 0.0;
        for k in 0..1_000_000 {
            assert_eq!(fmu.step(t, h), OK, "step {k} at {t}");
            t += h;
        }
        assert_eq!(fmu.time(), t);
        assert_ne!(t, stop);
        assert_eq!(fmu.step(t, h), ERROR);
        assert!(fmu.error().contains("beyond the stop time"));
    }
}

#[test]
fn the_last_step_may_be_cut_by_a_rounded_time() {
    let stop = 100.0;
    // Whether the importer's sum runs ahead of the true one or behind it depends on h.
    let mut off = Vec::new();
    for h in [1e-4, 3e-4, 7e-4, 9e-4] {
        let fmu = Fmu::new(2);
        assert_eq!((fmu.enter(0.0, Some(stop)), fmu.exit()), (OK, OK));
        let (mut t, mut whole) = (0.0, 0.0);
        while stop - t > h {
            assert_eq!(fmu.step(t, h), OK, "{t}");
            t += h;
            whole += 1.0;
        }
        assert_eq!(fmu.step(t, stop - t), OK, "the last of {h}");
        off.push(whole * h - t);
    }
    assert!(off.iter().any(|off| *off > 1e-12) && off.iter().any(|off| *off < -1e-12), "{off:?}");
}

#[test]
fn a_time_may_be_off_by_its_rounding() {
    // A hundredth of h is below the resolution of a time of 1e6 s.
    let (start, h) = (1e6, 1e-8);
    let fmu = Fmu::new(3);
    assert_eq!((fmu.enter(start, None), fmu.exit()), (OK, OK));
    let (mut end, mut apart) = (start, 0);
    for k in 0..1000 {
        let t = start + f64::from(k) * h;
        apart += i32::from(t != end);
        assert_eq!(fmu.step(t, h), OK, "step {k}");
        end = t + h;
    }
    assert!(apart > 10, "{apart}");
}

#[test]
fn no_step_goes_beyond_the_stop_time() {
    for version in [2, 3] {
        for start in [0.0, 1e6, -1.0] {
            let stop = start + 1.0;
            let started = || {
                let fmu = Fmu::new(version);
                assert_eq!((fmu.enter(start, Some(stop)), fmu.exit()), (OK, OK));
                fmu
            };
            assert_eq!(started().step(start, 1.0), OK);
            let fmu = started();
            assert_eq!(fmu.step(start, 1.0 + 1e-6), ERROR);
            assert!(fmu.error().contains(&format!("beyond the stop time {stop}")));
            let fmu = started();
            assert_eq!((fmu.step(start, 0.9), fmu.step(start + 0.9, 0.1)), (OK, OK));
            assert_eq!(fmu.step(start + 1.0, 1e-3), ERROR);
        }
    }
    assert_eq!(Fmu::started(2).step(0.0, 1e6), OK, "without a stop time");
}

#[test]
fn experiments_that_make_no_sense() {
    for version in [2, 3] {
        for (start, stop) in
            [(f64::NAN, None), (f64::INFINITY, None), (0.0, Some(f64::NAN)), (0.0, Some(f64::INFINITY))]
        {
            let fmu = Fmu::new(version);
            assert_eq!(fmu.enter(start, stop), ERROR);
            assert!(fmu.error().contains("Time = "));
        }
        for stop in [1.0, 0.5, -1.0] {
            let fmu = Fmu::new(version);
            assert_eq!(fmu.enter(1.0, Some(stop)), ERROR);
            assert!(fmu.error().contains("greater than startTime = 1"));
        }
    }
}

#[test]
fn out_pointers_of_fmi3_are_needed() {
    use fmu_export::abi::types::Fmi3Boolean;
    for missing in 0..4 {
        let fmu = Fmu::started(3);
        let mut flags = [Fmi3Boolean(7); 3];
        let mut last = 7.0;
        let null = std::ptr::null_mut();
        let flag: Vec<_> = flags.iter_mut().enumerate().map(|(i, f)| if i == missing { null } else { f }).collect();
        let time = if missing == 3 { std::ptr::null_mut() } else { &raw mut last };
        let x = fmu.get(X);
        assert_eq!(unsafe { fmi3DoStep(fmu.it, 0.0, 0.1, Fmi3Boolean(1), flag[0], flag[1], flag[2], time) }, ERROR);
        assert!(fmu.error().contains("is NULL"));
        assert_eq!((fmu.get(X), fmu.get(TIME)), (x, 0.0));
    }
}
