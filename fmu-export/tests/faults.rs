//! Panics, callbacks that call back, instances side by side, threads, and absence of console output.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod common;

use common::model::*;
use common::*;
use fmu_core::Description;
use fmu_export::abi::types::*;
use std::process::Command;
use std::ptr::{null, null_mut};
use std::rc::Rc;

#[test]
fn a_panic_is_an_error_and_a_reset_recovers() {
    for version in [2, 3] {
        let fmu = Fmu::entered(version);
        assert_eq!((fmu.set_mode(PANICKY), fmu.exit()), (OK, OK));
        let mut before = null_mut();
        assert_eq!((fmu.save(&mut before), fmu.step(0.0, 0.1)), (OK, ERROR));
        assert_eq!(fmu.error(), format!("fmi{version}DoStep: a fault in the model's code (panic): the model panicked"));
        assert_eq!(fmu.state(), 'e');
        assert!(version == 2 || fmu.get(TIME) == 0.0);
        // Back in Step Mode, where inputs can be set and fixed parameters cannot.
        assert_eq!((fmu.restore(before), fmu.set(&[U], &[1.0]), fmu.set(&[R], &[1.0])), (OK, OK, ERROR));
        assert_eq!((fmu.free_state(&mut before), fmu.reset(), fmu.enter(0.0, None), fmu.exit()), (OK, OK, OK, OK));
        assert_eq!(fmu.step(0.0, 0.1), OK);
    }
}

#[test]
fn a_panic_in_a_getter() {
    for version in [2, 3] {
        let fmu = Fmu::entered(version);
        assert_eq!((fmu.set_integer(N, 13), fmu.try_get(&[X], &mut [0.0])), (OK, ERROR));
        assert!(fmu.error().ends_with("thirteen is bad luck"));
        assert_eq!((fmu.state(), fmu.try_get(&[X], &mut [0.0])), ('e', OK));
        assert_eq!((fmu.reset(), fmu.state()), (OK, 'i'));
    }
}

#[test]
fn a_fault_of_the_model_is_its_message() {
    let fmu = Fmu::entered(3);
    assert_eq!((fmu.set_mode(FAULTY), fmu.exit(), fmu.step(0.0, 0.1)), (OK, OK, ERROR));
    assert!(fmu.error().starts_with("fmi3DoStep: x left the finite numbers"));
    assert_eq!((fmu.state(), fmu.get(TIME)), ('e', 0.0));
}

/// The instance that logs, for the logger below.
struct Caller {
    it: InstancePointer,
    statuses: Vec<c_int>,
}

extern "C" fn calls_back(environment: *mut c_void, _: Text, _: c_int, _: Text, _: Text) {
    let caller = unsafe { &mut *environment.cast::<Caller>() };
    unsafe {
        caller.statuses.push(fmi2Reset(caller.it));
        caller.statuses.push(fmi2GetReal(caller.it, &X, 1, &mut 0.0));
        fmi2FreeInstance(caller.it);
    }
}

#[test]
fn a_logger_that_calls_back_is_refused() {
    loud();
    let mut caller = Caller { it: null_mut(), statuses: Vec::new() };
    let environment = &raw mut caller;
    let callbacks = Fmi2Callbacks {
        logger: Some(variadic(calls_back)),
        allocate_memory: null(),
        free_memory: null(),
        step_finished: null(),
        environment: environment.cast(),
    };
    let (no, token) = (Fmi2Boolean(0), token());
    unsafe {
        let it = fmi2Instantiate(c"a".as_ptr(), 1, token.as_ptr(), null(), &callbacks, no, no);
        (*environment).it = it;
        assert_eq!(fmi2Terminate(it), ERROR);
        assert_eq!((*environment).statuses, [ERROR, ERROR]);
        // It was not reset, and not freed.
        assert_eq!(fmi2EnterInitializationMode(it), ERROR);
        assert_eq!(fmi2Reset(it), OK);
        fmi2FreeInstance(it);
    }
}

/// A run with its own inputs.
fn trajectory(fmu: &Fmu, seed: f64, k: u32) -> u64 {
    let t = f64::from(k) * 0.01;
    assert_eq!(fmu.set(&[U], &[(seed * t).sin()]), OK);
    assert_eq!(fmu.step(t, 0.01), OK);
    fmu.get(X).to_bits()
}

#[test]
fn instances_do_not_know_of_each_other() {
    let alone: Vec<Vec<u64>> = (0..100)
        .map(|i| {
            let fmu = Fmu::started(2 + u8::try_from(i % 2).unwrap());
            (0..50).map(|k| trajectory(&fmu, f64::from(i), k)).collect()
        })
        .collect();
    let together: Vec<Fmu> = (0..100_u8).map(|i| Fmu::started(2 + i % 2)).collect();
    for k in 0..50 {
        for (i, fmu) in (0_u32..).zip(&together) {
            assert_eq!(trajectory(fmu, f64::from(i), k), alone[i as usize][k as usize]);
        }
        if k == 25 {
            let broken = Fmu::started(2);
            assert_eq!(broken.step(f64::NAN, 1.0), ERROR);
        }
    }
}

#[test]
fn instances_in_threads() {
    let run = |i: u32| -> Vec<u64> {
        let fmu = Fmu::started(3);
        (0..200).map(|k| trajectory(&fmu, f64::from(i), k)).chain([u64::from(fmu.bytes()[40])]).collect()
    };
    let expected: Vec<_> = (0..8).map(run).collect();
    let threads: Vec<_> = (0..8).map(|i| std::thread::spawn(move || run(i))).collect();
    for (thread, expected) in threads.into_iter().zip(expected) {
        assert_eq!(thread.join().unwrap(), expected);
    }
}

extern "C" fn collect(context: *mut c_void, bytes: *const u8, len: usize) {
    unsafe { (*context.cast::<Vec<u8>>()).extend_from_slice(std::slice::from_raw_parts(bytes, len)) }
}

#[test]
fn the_description_is_handed_out() {
    loud();
    let mut bytes = Vec::new();
    assert_eq!(unsafe { fmu_description(collect, (&raw mut bytes).cast(), null(), 1) }, 0);
    let description: Description = serde_json::from_slice(&bytes).unwrap();
    assert_eq!(description, Description::of::<Probe>().unwrap());
    assert_eq!(description.token, token().to_str().unwrap());
}

#[test]
fn nothing_is_printed() {
    if std::env::var_os(CHILD).is_some() {
        for version in [2, 3] {
            let journal = Journal::default();
            let it = Fmu::open(version, c"a", &token(), &raw const journal, false, true);
            let fmu = Fmu { version, it, journal: Rc::default() };
            assert_eq!((fmu.set_mode(PANICKY), fmu.enter(0.0, None), fmu.exit()), (OK, OK, OK));
            assert_eq!((fmu.step(0.0, 0.1), fmu.set(&[X], &[0.0]), fmu.reset()), (ERROR, ERROR, OK));
        }
        return;
    }
    let out = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "nothing_is_printed", "--nocapture"])
        .env(CHILD, "1")
        .output()
        .unwrap();
    assert!(out.status.success(), "{out:?}");
    assert_eq!(String::from_utf8(out.stderr).unwrap(), "");
    let lines: Vec<String> = String::from_utf8(out.stdout).unwrap().lines().map(Into::into).collect();
    assert_eq!(lines.iter().filter(|line| !line.is_empty()).count(), 3, "the test harness's own lines: {lines:?}");
}
