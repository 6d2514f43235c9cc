//! An importer: it calls the C functions, in Scheduled Execution and in Event Mode.
#![allow(clippy::undocumented_unsafe_blocks, clippy::borrow_as_ptr, reason = "an importer calls C functions")]

use super::fmi::*;
use fmu_core::Exported;
use fmu_export::abi::types::*;
use std::cell::Cell;
use std::ffi::CString;
use std::ptr::{null, null_mut};

const IN: [u32; 3] = [1, 2, 3];
const OUT: u32 = 4;
const COUNTS: [u32; 4] = [5, 6, 7, 8];

/// The schedule of `scs_synchronous.c`; ticks of the three clocks, of all, and of the output clock, at 0 to 9 s.
const ROWS: [([i32; 4], bool); 10] = [
    ([1, 1, 0, 2], false),
    ([2, 2, 0, 4], false),
    ([3, 2, 0, 5], true),
    ([4, 2, 0, 6], false),
    ([5, 2, 1, 8], false),
    ([6, 2, 1, 9], false),
    ([7, 2, 1, 10], true),
    ([8, 2, 1, 11], false),
    ([9, 3, 1, 13], false),
    ([10, 4, 1, 15], true),
];

/// The instance, the qualifier of `inClock3`, and whether `outClock` has ticked.
struct Heard(Cell<InstancePointer>, Cell<c_int>, Cell<bool>);

extern "C" fn update(environment: *mut c_void) {
    let heard = unsafe { &*environment.cast::<Heard>() };
    let (mut interval, mut qualifier, mut out) = (f64::NAN, -1, Fmi3Boolean(9));
    unsafe {
        assert_eq!(fmi3GetIntervalDecimal(heard.0.get(), &IN[2], 1, &mut interval, &mut qualifier), 0);
        assert_eq!(fmi3GetClock(heard.0.get(), &OUT, 1, &mut out), 0);
    }
    heard.1.set(qualifier);
    heard.2.set(out.0 == 1);
}

fn start(it: InstancePointer) {
    let no = Fmi3Boolean(0);
    assert!(!it.is_null());
    unsafe {
        assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), 0);
        assert_eq!(fmi3ExitInitializationMode(it), 0);
    }
}

fn token() -> CString {
    CString::new(This::TOKEN.as_str()).unwrap()
}

#[test]
fn scheduled() {
    let (no, token) = (Fmi3Boolean(0), token());
    let heard = Heard(Cell::new(null_mut()), Cell::new(0), Cell::new(false));
    let environment = (&raw const heard).cast_mut().cast();
    let it = unsafe {
        fmi3InstantiateScheduledExecution(
            c"clocks".as_ptr(),
            token.as_ptr(),
            null(),
            no,
            no,
            environment,
            None,
            Some(update),
            None,
            None,
        )
    };
    heard.0.set(it);
    start(it);
    for (row, k) in ROWS.iter().zip(0_u32..) {
        let t = f64::from(k);
        let (activate, mut ticked) = (|clock| unsafe { fmi3ActivateModelPartition(it, clock, t) }, false);
        let second = [0, 1, 8, 9].contains(&k);
        for (clock, due) in [(0, true), (1, second), (2, k == 4)] {
            // Only inClock1 requests inClock3, at 4 s.
            assert!(clock != 2 || due == (heard.1.replace(0) == 2), "{t}");
            if due {
                assert_eq!(activate(IN[clock]), 0);
                ticked |= heard.2.replace(false);
            }
        }
        let mut counts = [-1; 4];
        assert_eq!(unsafe { fmi3GetInt32(it, COUNTS.as_ptr(), 4, counts.as_mut_ptr(), 4) }, 0);
        assert_eq!((counts, ticked), *row, "at {t} s");
    }
    unsafe { fmi3FreeInstance(it) };
}

/// In Co-Simulation, an event at every second; clocks that are due together tick one after the other.
#[test]
fn in_event_mode() {
    let (no, token) = (Fmi3Boolean(0), token());
    let it = unsafe {
        fmi3InstantiateCoSimulation(
            c"clocks".as_ptr(),
            token.as_ptr(),
            null(),
            no,
            no,
            Fmi3Boolean(1),
            no,
            null(),
            0,
            null_mut(),
            None,
            None,
        )
    };
    start(it);
    let mut counts = [0; 4];
    for (row, k) in ROWS.iter().zip(0_u32..) {
        let (second, mut third, mut ticked) = ([0, 1, 8, 9].contains(&k), false, false);
        for clock in 0..3 {
            if ![true, second, third][clock] {
                continue;
            }
            let (mut out, mut interval, mut qualifier) = (Fmi3Boolean(9), f64::NAN, -1);
            let [mut a, mut b, mut c, mut d, mut e] = [Fmi3Boolean(9); 5];
            unsafe {
                assert_eq!(fmi3SetClock(it, &IN[clock], 1, &Fmi3Boolean(1)), 0);
                assert_eq!(fmi3GetClock(it, &OUT, 1, &mut out), 0);
                // Before the update, the counts are those after it.
                assert_eq!(fmi3GetInt32(it, &COUNTS[clock], 1, &mut counts[clock], 1), 0);
                assert_eq!(fmi3GetInt32(it, &COUNTS[3], 1, &mut counts[3], 1), 0);
                assert_eq!(fmi3UpdateDiscreteStates(it, &mut a, &mut b, &mut c, &mut d, &mut e, &mut 0.0), 0);
                assert_eq!(fmi3GetIntervalDecimal(it, &IN[2], 1, &mut interval, &mut qualifier), 0);
            }
            ticked |= out.0 == 1;
            third |= qualifier == 2 && interval == 0.0;
        }
        assert_eq!((counts, ticked), *row, "at {k} s");
        let [mut a, mut b, mut c] = [Fmi3Boolean(9); 3];
        unsafe {
            assert_eq!(fmi3EnterStepMode(it), 0);
            assert_eq!(fmi3DoStep(it, k.into(), 1.0, no, &mut a, &mut b, &mut c, &mut 0.0), 0);
            assert_eq!(fmi3EnterEventMode(it), 0);
        }
    }
    unsafe { fmi3FreeInstance(it) };
}
