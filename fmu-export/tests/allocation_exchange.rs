//! The calls of a solver do not allocate. A separate test program: it replaces the allocator.
#![allow(missing_docs)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod counting;
mod solver;

use counting::{calls, neighbor};
use solver::ball::*;
use solver::*;
use std::hint::black_box;
use std::ptr::null_mut;

fmu_export::export!(Ball: ContinuousTime + Events + Differentiable + Warns);

/// Allocations of `work`, which has run before.
fn allocations(mut work: impl FnMut()) -> u64 {
    work();
    let before = calls();
    for _ in 0..10 {
        work();
    }
    calls() - before
}

fn derivatives(fmu: &Fmu, knowns: [u32; 2]) {
    let mut out = [0.0; 3];
    assert_eq!(fmu.directional(&[DER_H, DER_V, E], &knowns, &[1.0, 2.0], &mut out), OK);
    if fmu.kind.version() == 3 {
        assert_eq!(fmu.adjoint(&[DER_H, DER_V, E], &knowns, &[1.0, 2.0, 3.0], &mut out[..2]), OK);
    }
}

#[test]
fn a_solver_does_not_allocate() {
    let _neighbor = neighbor();
    for kind in ME {
        // Warnings are on, but there is no logger, so no text is formatted.
        let fmu = Fmu::with(kind, false, true);
        assert_eq!((fmu.enter(0.0, None), fmu.exit(), fmu.leave()), (OK, OK, OK));
        let mut state = null_mut();
        assert_eq!(fmu.save(&mut state), OK);
        let (mut x, mut z, mut values) = ([0.0; 2], [0.0], [0.0; 6]);
        let step = || {
            assert_eq!((fmu.set_time(0.1), fmu.set_states(&[0.1, 3.0]), fmu.set(&[U, V], &[3.0, 4.0])), (OK, OK, OK));
            assert_eq!((fmu.try_derivatives(&mut x), fmu.try_indicators(&mut z), fmu.try_states(&mut x)), (OK, OK, OK));
            assert_eq!(fmu.try_get(&[H, E, A, V, DER_H, DER_V], &mut values), OK);
            assert_eq!((fmu.try_nominals(&mut x), fmu.completed()), (OK, OK));
            derivatives(&fmu, [U, V]);
            assert_eq!((fmu.event(), fmu.set(&[K], &[1.0])), (OK, OK));
            derivatives(&fmu, [K, H]);
            fmu.settle();
            assert_eq!(fmu.leave(), OK);
            assert_eq!((fmu.save(&mut state), fmu.restore(state)), (OK, OK));
        };
        assert_eq!(allocations(step), 0, "{kind:?}");
        // The counter counts.
        assert!(allocations(|| drop(black_box(Box::new(fmu.get(H))))) > 0);
        assert_eq!(fmu.free_state(&mut state), OK);
    }
    for kind in CS {
        let fmu = Fmu::with(kind, true, false);
        assert_eq!((fmu.enter(0.0, None), fmu.exit()), (OK, OK));
        let mut t = 0.0;
        let step = || {
            let mut out = [0.0; 2];
            assert_eq!((fmu.set(&[U, K], &[3.0, 1.0]), fmu.step(t, 0.01).0), (OK, OK));
            assert_eq!(fmu.output_derivatives(&[E, H], &[1, 1], &mut out), OK);
            derivatives(&fmu, [U, V]);
            t += 0.01;
        };
        assert_eq!(allocations(step), 0, "{kind:?}");
    }
}

/// A warning is built once a second, if it is logged.
#[test]
fn a_warning_is_built_when_it_is_heard() {
    let steps = |logger: bool, on: bool| {
        let fmu = Fmu::with(Kind::Cs3 { event: false, early: false }, logger, on);
        assert_eq!((fmu.enter(0.0, None), fmu.exit()), (OK, OK));
        assert_eq!(fmu.step(0.0, 0.01).0, OK);
        fmu.messages();
        let before = calls();
        for k in 1..50_u32 {
            assert_eq!(fmu.step(f64::from(k) * 0.01, 0.01).0, OK);
        }
        (calls() - before, fmu.messages().len())
    };
    assert_eq!((steps(false, true), steps(true, false)), ((0, 0), (0, 0)));
    let (built, heard) = steps(true, true);
    // The ball becomes fast, and then is low.
    assert!(heard == 2 && built > 0, "{built} {heard}");
}
