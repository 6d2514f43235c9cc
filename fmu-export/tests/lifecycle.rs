//! Every function in every state, against tables written by hand from FMI 2.0.5, 4.2.4 and FMI 3.0.2, 2.3 and 4.2.
//!
//! States: i instantiated, n initialization, s step, t terminated, e error. After a success the state is the one named
//! (`.`: as before), after a failure it is e, and there is one message that names the function.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod common;

use common::model::*;
use common::unsupported::{FMI2_UNSUPPORTED, FMI3_UNSUPPORTED, Unsupported};
use common::*;
use fmu_export::abi::types::*;
use std::ptr::{null, null_mut};

/// Name, states that allow it, state afterwards, the call with otherwise valid arguments.
type Line = (&'static str, &'static str, char, fn(InstancePointer) -> c_int);

fn check(version: u8, table: &[Line], unsupported: &[Unsupported]) {
    let unsupported = unsupported.iter().map(|&(name, call)| (name, "", '.', call));
    for (name, allowed, after, call) in table.iter().copied().chain(unsupported) {
        for state in "inste".chars() {
            let fmu = Fmu::in_state(version, state);
            let status = call(fmu.it);
            if allowed.contains(state) {
                assert_eq!(status, OK, "{name} in {state}: {:?}", fmu.journal.0.borrow());
                assert!(fmu.journal.0.borrow().is_empty());
                assert_eq!(fmu.state(), if after == '.' { state } else { after }, "{name} in {state}");
            } else {
                assert_eq!(status, ERROR, "{name} in {state}");
                assert!(fmu.error().starts_with(&format!("{name}: ")));
                assert_eq!(fmu.state(), 'e', "{name} in {state}");
            }
        }
        assert_eq!(call(null_mut()), ERROR, "{name} without an instance");
    }
}

/// Works on a state that another instance made, since not every state can be saved.
fn with_state<T>(work: impl FnOnce(&Fmu, &mut FmuState) -> T) -> T {
    let other = Fmu::started(3);
    let mut state = null_mut();
    assert_eq!(other.save(&mut state), OK);
    let result = work(&other, &mut state);
    assert_eq!(other.free_state(&mut state), OK);
    result
}

const FMI2: &[Line] = &[
    ("fmi2SetDebugLogging", "inste", '.', |it| unsafe { fmi2SetDebugLogging(it, Fmi2Boolean(0), 0, null()) }),
    ("fmi2SetupExperiment", "i", '.', |it| unsafe {
        fmi2SetupExperiment(it, Fmi2Boolean(1), 1e-6, 0.0, Fmi2Boolean(1), 1.0)
    }),
    // Without fmi2SetupExperiment before it, an error everywhere; with it, see `experiment_first`.
    ("fmi2EnterInitializationMode", "", '.', |it| unsafe { fmi2EnterInitializationMode(it) }),
    ("fmi2ExitInitializationMode", "n", 's', |it| unsafe { fmi2ExitInitializationMode(it) }),
    ("fmi2Terminate", "s", 't', |it| unsafe { fmi2Terminate(it) }),
    ("fmi2Reset", "inste", 'i', |it| unsafe { fmi2Reset(it) }),
    ("fmi2GetReal", "nste", '.', |it| unsafe { fmi2GetReal(it, &X, 1, &mut 0.0) }),
    ("fmi2GetInteger", "nste", '.', |it| unsafe { fmi2GetInteger(it, &N, 1, &mut Fmi2Integer(0)) }),
    ("fmi2GetBoolean", "nste", '.', |it| unsafe { fmi2GetBoolean(it, &FLAG, 1, &mut Fmi2Boolean(0)) }),
    ("fmi2GetString", "nste", '.', |it| unsafe { fmi2GetString(it, null(), 0, null_mut()) }),
    ("fmi2SetReal", "ins", '.', |it| unsafe { fmi2SetReal(it, &U, 1, &2.0) }),
    ("fmi2SetInteger", "in", '.', |it| unsafe { fmi2SetInteger(it, &N, 1, &Fmi2Integer(2)) }),
    ("fmi2SetBoolean", "ins", '.', |it| unsafe { fmi2SetBoolean(it, &ON, 1, &Fmi2Boolean(2)) }),
    ("fmi2SetString", "ins", '.', |it| unsafe { fmi2SetString(it, null(), 0, null()) }),
    ("fmi2GetFMUstate", "inst", '.', |it| unsafe { fmi2GetFMUstate(it, &mut null_mut()) }),
    ("fmi2SetFMUstate", "inste", 's', |it| with_state(|_, state| unsafe { fmi2SetFMUstate(it, *state) })),
    ("fmi2FreeFMUstate", "inste", '.', |it| with_state(|_, state| unsafe { fmi2FreeFMUstate(it, state) })),
    ("fmi2SerializedFMUstateSize", "inste", '.', |it| {
        with_state(|_, state| unsafe { fmi2SerializedFMUstateSize(it, *state, &mut 0) })
    }),
    ("fmi2SerializeFMUstate", "inste", '.', |it| {
        with_state(|other, state| {
            let mut bytes = vec![0; other.size(*state)];
            unsafe { fmi2SerializeFMUstate(it, *state, bytes.as_mut_ptr(), bytes.len()) }
        })
    }),
    ("fmi2DeSerializeFMUstate", "inste", '.', |it| {
        let bytes = Fmu::new(2).bytes();
        unsafe { fmi2DeSerializeFMUstate(it, bytes.as_ptr(), bytes.len(), &mut null_mut()) }
    }),
    ("fmi2DoStep", "s", '.', |it| unsafe { fmi2DoStep(it, 0.0, 0.1, Fmi2Boolean(1)) }),
    ("fmi2GetRealStatus", "st", '.', |it| unsafe { fmi2GetRealStatus(it, 2, &mut 0.0) }),
    ("fmi2GetBooleanStatus", "st", '.', |it| unsafe { fmi2GetBooleanStatus(it, 3, &mut Fmi2Boolean(1)) }),
];

const NO: Fmi3Boolean = Fmi3Boolean(0);

const FMI3: &[Line] = &[
    ("fmi3SetDebugLogging", "inste", '.', |it| unsafe { fmi3SetDebugLogging(it, NO, 0, null()) }),
    ("fmi3EnterInitializationMode", "i", 'n', |it| unsafe {
        fmi3EnterInitializationMode(it, NO, 0.0, 0.0, Fmi3Boolean(1), 1.0)
    }),
    ("fmi3ExitInitializationMode", "n", 's', |it| unsafe { fmi3ExitInitializationMode(it) }),
    ("fmi3Terminate", "s", 't', |it| unsafe { fmi3Terminate(it) }),
    ("fmi3Reset", "inste", 'i', |it| unsafe { fmi3Reset(it) }),
    ("fmi3GetFloat64", "inste", '.', |it| unsafe { fmi3GetFloat64(it, &X, 1, &mut 0.0, 1) }),
    ("fmi3GetInt32", "inste", '.', |it| unsafe { fmi3GetInt32(it, &N, 1, &mut 0, 1) }),
    ("fmi3GetInt64", "inste", '.', |it| unsafe { fmi3GetInt64(it, &MODE, 1, &mut 0, 1) }),
    ("fmi3GetBoolean", "inste", '.', |it| unsafe { fmi3GetBoolean(it, &FLAG, 1, &mut Fmi3Boolean(0), 1) }),
    ("fmi3GetFloat32", "inste", '.', |it| unsafe { fmi3GetFloat32(it, null(), 0, null_mut(), 0) }),
    ("fmi3GetInt8", "inste", '.', |it| unsafe { fmi3GetInt8(it, null(), 0, null_mut(), 0) }),
    ("fmi3GetUInt8", "inste", '.', |it| unsafe { fmi3GetUInt8(it, null(), 0, null_mut(), 0) }),
    ("fmi3GetInt16", "inste", '.', |it| unsafe { fmi3GetInt16(it, null(), 0, null_mut(), 0) }),
    ("fmi3GetUInt16", "inste", '.', |it| unsafe { fmi3GetUInt16(it, null(), 0, null_mut(), 0) }),
    ("fmi3GetUInt32", "inste", '.', |it| unsafe { fmi3GetUInt32(it, null(), 0, null_mut(), 0) }),
    ("fmi3GetUInt64", "inste", '.', |it| unsafe { fmi3GetUInt64(it, null(), 0, null_mut(), 0) }),
    ("fmi3GetString", "inste", '.', |it| unsafe { fmi3GetString(it, null(), 0, null_mut(), 0) }),
    ("fmi3GetBinary", "inste", '.', |it| unsafe { fmi3GetBinary(it, null(), 0, null_mut(), null_mut(), 0) }),
    ("fmi3SetFloat64", "ins", '.', |it| unsafe { fmi3SetFloat64(it, &U, 1, &2.0, 1) }),
    ("fmi3SetInt32", "in", '.', |it| unsafe { fmi3SetInt32(it, &N, 1, &2, 1) }),
    ("fmi3SetInt64", "in", '.', |it| unsafe { fmi3SetInt64(it, &MODE, 1, &2, 1) }),
    // A fixed parameter may be set to its present value.
    ("fmi3SetInt64", "ins", '.', |it| unsafe { fmi3SetInt64(it, &MODE, 1, &1, 1) }),
    ("fmi3SetBoolean", "ins", '.', |it| unsafe { fmi3SetBoolean(it, &ON, 1, &NO, 1) }),
    ("fmi3SetFloat32", "ins", '.', |it| unsafe { fmi3SetFloat32(it, null(), 0, null(), 0) }),
    ("fmi3SetInt8", "ins", '.', |it| unsafe { fmi3SetInt8(it, null(), 0, null(), 0) }),
    ("fmi3SetUInt8", "ins", '.', |it| unsafe { fmi3SetUInt8(it, null(), 0, null(), 0) }),
    ("fmi3SetInt16", "ins", '.', |it| unsafe { fmi3SetInt16(it, null(), 0, null(), 0) }),
    ("fmi3SetUInt16", "ins", '.', |it| unsafe { fmi3SetUInt16(it, null(), 0, null(), 0) }),
    ("fmi3SetUInt32", "ins", '.', |it| unsafe { fmi3SetUInt32(it, null(), 0, null(), 0) }),
    ("fmi3SetUInt64", "ins", '.', |it| unsafe { fmi3SetUInt64(it, null(), 0, null(), 0) }),
    ("fmi3SetString", "ins", '.', |it| unsafe { fmi3SetString(it, null(), 0, null(), 0) }),
    ("fmi3SetBinary", "ins", '.', |it| unsafe { fmi3SetBinary(it, null(), 0, null(), null(), 0) }),
    ("fmi3GetFMUState", "inst", '.', |it| unsafe { fmi3GetFMUState(it, &mut null_mut()) }),
    ("fmi3SetFMUState", "inste", 's', |it| with_state(|_, state| unsafe { fmi3SetFMUState(it, *state) })),
    ("fmi3FreeFMUState", "inste", '.', |it| with_state(|_, state| unsafe { fmi3FreeFMUState(it, state) })),
    ("fmi3SerializedFMUStateSize", "inste", '.', |it| {
        with_state(|_, state| unsafe { fmi3SerializedFMUStateSize(it, *state, &mut 0) })
    }),
    ("fmi3SerializeFMUState", "inste", '.', |it| {
        with_state(|other, state| {
            let mut bytes = vec![0; other.size(*state)];
            unsafe { fmi3SerializeFMUState(it, *state, bytes.as_mut_ptr(), bytes.len()) }
        })
    }),
    ("fmi3DeserializeFMUState", "inste", '.', |it| {
        let bytes = Fmu::new(3).bytes();
        unsafe { fmi3DeserializeFMUState(it, bytes.as_ptr(), bytes.len(), &mut null_mut()) }
    }),
    ("fmi3DoStep", "s", '.', |it| {
        let (mut a, mut b, mut c, mut d) = (NO, NO, NO, 0.0);
        unsafe { fmi3DoStep(it, 0.0, 0.1, NO, &mut a, &mut b, &mut c, &mut d) }
    }),
];

#[test]
fn fmi2_functions_in_all_states() {
    // 44 functions in fmi2Functions.h; four take no instance or are Free, three status kinds are in `statuses`.
    assert_eq!(FMI2.len() + FMI2_UNSUPPORTED.len() + 4 + 3, 44);
    check(2, FMI2, FMI2_UNSUPPORTED);
}

#[test]
fn fmi3_functions_in_all_states() {
    // 75 functions in fmi3Functions.h; five take no instance or are Free.
    assert_eq!(FMI3.len() - 1 + FMI3_UNSUPPORTED.len() + 5, 75);
    check(3, FMI3, FMI3_UNSUPPORTED);
}

#[test]
fn experiment_first() {
    let fmu = Fmu::new(2);
    assert_eq!(unsafe { fmi2EnterInitializationMode(fmu.it) }, ERROR);
    assert!(fmu.error().contains("fmi2SetupExperiment must be called"));
    let fmu = Fmu::new(2);
    assert_eq!(fmu.enter(0.0, None), OK);
    assert_eq!(fmu.state(), 'n');
    // A reset forgets the experiment.
    assert_eq!((fmu.reset(), unsafe { fmi2EnterInitializationMode(fmu.it) }), (OK, ERROR));
}

#[test]
fn statuses_that_do_not_exist_are_discarded() {
    let calls: [fn(InstancePointer, c_int) -> c_int; 5] = [
        |it, kind| unsafe { fmi2GetStatus(it, kind, &mut 0) },
        |it, kind| unsafe { fmi2GetIntegerStatus(it, kind, &mut Fmi2Integer(0)) },
        |it, kind| unsafe { fmi2GetStringStatus(it, kind, &mut null()) },
        |it, kind| unsafe { fmi2GetRealStatus(it, kind, &mut 0.0) },
        |it, kind| unsafe { fmi2GetBooleanStatus(it, kind, &mut Fmi2Boolean(0)) },
    ];
    for (i, call) in calls.into_iter().enumerate() {
        for kind in -1..5 {
            let exists = (i, kind) == (3, 2) || (i, kind) == (4, 3);
            for (state, expected) in [('i', ERROR), ('n', ERROR), ('s', DISCARD), ('t', DISCARD), ('e', ERROR)] {
                let fmu = Fmu::in_state(2, state);
                let expected = if exists && expected == DISCARD { OK } else { expected };
                assert_eq!(call(fmu.it, kind), expected, "{i} {kind} {state}");
                assert_eq!(fmu.state(), if expected == ERROR { 'e' } else { state });
            }
        }
    }
}

#[test]
fn last_successful_time_is_the_end_of_the_step() {
    let fmu = Fmu::started(2);
    assert_eq!(fmu.step(0.0, 0.1), OK);
    assert_eq!(fmu.step(0.1, 0.2), OK);
    let (mut time, mut over) = (0.0, Fmi2Boolean(1));
    unsafe {
        assert_eq!(fmi2GetRealStatus(fmu.it, 2, &mut time), OK);
        assert_eq!(fmi2GetBooleanStatus(fmu.it, 3, &mut over), OK);
    }
    assert_eq!((time.to_bits(), over.0), ((0.1_f64 + 0.2).to_bits(), 0));
}

#[test]
fn instances_are_freed_in_every_state_and_null_is_nothing() {
    for version in [2, 3] {
        for state in "inste".chars() {
            drop(Fmu::in_state(version, state));
        }
    }
    unsafe {
        fmi2FreeInstance(null_mut());
        fmi3FreeInstance(null_mut());
    }
}

#[test]
fn versions_and_platform() {
    let text = |text: Text| unsafe { std::ffi::CStr::from_ptr(text) };
    assert_eq!(text(fmi2GetVersion()), c"2.0");
    assert_eq!(text(fmi2GetTypesPlatform()), c"default");
    assert_eq!(text(fmi3GetVersion()), c"3.0");
}

#[test]
fn an_instance_of_one_standard_is_refused_by_the_other() {
    let fmu = Fmu::started(2);
    assert_eq!(unsafe { fmi3Terminate(fmu.it) }, ERROR);
    assert!(fmu.error().contains("other standard"));
}
