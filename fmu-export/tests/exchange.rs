//! Model Exchange of both standards: which function in which state, statuses, events, states of an FMU; and
//! Co-Simulation of the same model. Tables written by hand from FMI 2.0.5, 3.2.3 and FMI 3.0.2, 2.3 and 3.2.
//!
//! States: i instantiated, n initialization, v event, c continuous time, s step, t terminated, e error.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod solver;

use fmu_export::abi::types::*;
use solver::ball::*;
use solver::rk4::solve;
use solver::table::{Line, check, with_state};
use solver::*;
use std::ptr::{null, null_mut};

fmu_export::export!(Ball: ContinuousTime + Events + Warns);

use fmi::*;

/// The content of a message, and the call.
type Trial = (&'static str, fn(&Fmu) -> c_int);

/// Mass and map of a fresh ball.
const START: [f64; 3] = [2.0, 9.81, 0.01];

const BALL2: &[Line] = &[
    ("fmi2SetDebugLogging", "invcste", '.', |f| f.logging(false, &[])),
    ("fmi2SetupExperiment", "i", '.', |f| f.set_up(0.0, None)),
    ("fmi2EnterInitializationMode", "", '.', |f| unsafe { fmi2EnterInitializationMode(f.it) }),
    ("fmi2Terminate", "vcs", 't', Fmu::terminate),
    ("fmi2Reset", "invcste", 'i', Fmu::reset),
    ("fmi2GetReal", "nvcste", '.', |f| f.try_get(&[H, V, E, DER_H, DER_V], &mut [0.0; 5])),
    ("fmi2GetInteger", "nvcste", '.', |f| unsafe { fmi2GetInteger(f.it, &BOUNCES, 1, &mut Fmi2Integer(0)) }),
    ("fmi2GetBoolean", "nvcste", '.', |f| unsafe { fmi2GetBoolean(f.it, &RESTING, 1, &mut Fmi2Boolean(0)) }),
    ("fmi2GetString", "nvcste", '.', |f| unsafe { fmi2GetString(f.it, null(), 0, null_mut()) }),
    ("fmi2SetReal", "invcs", '.', |f| f.set(&[U], &[2.0])),
    ("fmi2SetReal", "invs", '.', |f| f.set(&[C, K], &[0.2, 2.0])),
    ("fmi2SetReal", "in", '.', |f| f.set(&[M, MAP, MAP + 1], &[2.0, 3.0, 4.0])),
    // Their present values, also among others.
    ("fmi2SetReal", "invcs", '.', |f| f.set(&[M, MAP, MAP + 1, U], &[START[0], START[1], START[2], 0.3])),
    ("fmi2SetReal", "in", '.', |f| f.set(&[M, MAP, MAP + 1, U], &[START[0], START[1], 0.25, 0.3])),
    ("fmi2SetReal", "invcs", '.', |f| f.set(&[C], &[0.1])),
    ("fmi2SetReal", "vc", '.', |f| f.set(&[V], &[2.0])),
    ("fmi2SetReal", "", '.', |f| f.set(&[E], &[2.0])),
    ("fmi2SetReal", "", '.', |f| f.set(&[DER_V], &[2.0])),
    ("fmi2SetReal", "", '.', |f| f.set(&[TIME], &[2.0])),
    ("fmi2SetInteger", "invcs", '.', |f| unsafe { fmi2SetInteger(f.it, null(), 0, null()) }),
    ("fmi2SetBoolean", "invcs", '.', |f| unsafe { fmi2SetBoolean(f.it, null(), 0, null()) }),
    ("fmi2SetString", "invcs", '.', |f| unsafe { fmi2SetString(f.it, null(), 0, null()) }),
    ("fmi2GetFMUstate", "invcst", '.', |f| f.save(&mut null_mut())),
    ("fmi2FreeFMUstate", "invcste", '.', |f| with_state(f.kind, |_, state| f.free_state(state))),
    ("fmi2SerializedFMUstateSize", "invcste", '.', |f| {
        with_state(f.kind, |_, state| unsafe { fmi2SerializedFMUstateSize(f.it, *state, &mut 0) })
    }),
    ("fmi2SerializeFMUstate", "invcste", '.', |f| {
        with_state(f.kind, |other, state| {
            let mut bytes = other.serialized(*state);
            unsafe { fmi2SerializeFMUstate(f.it, *state, bytes.as_mut_ptr(), bytes.len()) }
        })
    }),
    ("fmi2DeSerializeFMUstate", "invcste", '.', |f| f.deserialize(&Fmu::running(f.kind, 0.0).bytes(), &mut null_mut())),
    ("fmi2GetDirectionalDerivative", "nvcste", '.', |f| f.directional(&[], &[], &[], &mut [])),
    ("fmi2CancelStep", "", '.', |f| unsafe { fmi2CancelStep(f.it) }),
    ("fmi2DoStep", "s", '.', |f| f.step(0.0, 0.1).0),
    ("fmi2GetRealStatus", "st", '.', |f| unsafe { fmi2GetRealStatus(f.it, 2, &mut 0.0) }),
    ("fmi2GetBooleanStatus", "st", '.', |f| unsafe { fmi2GetBooleanStatus(f.it, 3, &mut Fmi2Boolean(1)) }),
    ("fmi2GetRealOutputDerivatives", "ste", '.', |f| f.output_derivatives(&[E], &[1], &mut [0.0])),
    ("fmi2SetRealInputDerivatives", "ins", '.', |f| f.input_derivatives(&[U], &[1], &[0.5])),
    ("fmi2EnterEventMode", "vc", 'v', Fmu::event),
    ("fmi2NewDiscreteStates", "v", '.', |f| f.try_update().0),
    ("fmi2EnterContinuousTimeMode", "v", 'c', Fmu::leave),
    ("fmi2CompletedIntegratorStep", "c", '.', Fmu::completed),
    ("fmi2SetTime", "vc", '.', |f| f.set_time(0.0)),
    ("fmi2SetContinuousStates", "nvc", '.', |f| f.set_states(&[1.0, 2.0])),
    ("fmi2GetDerivatives", "nvcte", '.', |f| f.try_derivatives(&mut [0.0; 2])),
    ("fmi2GetEventIndicators", "nvcte", '.', |f| f.try_indicators(&mut [0.0])),
    ("fmi2GetContinuousStates", "nvcte", '.', |f| f.try_states(&mut [0.0; 2])),
    ("fmi2GetNominalsOfContinuousStates", "invcte", '.', |f| f.try_nominals(&mut [0.0; 2])),
];

const BALL3: &[Line] = &[
    ("fmi3SetDebugLogging", "invcste", '.', |f| f.logging(false, &[])),
    ("fmi3EnterInitializationMode", "i", 'n', |f| f.enter(0.0, Some(1.0))),
    ("fmi3Terminate", "vcs", 't', Fmu::terminate),
    ("fmi3Reset", "invcste", 'i', Fmu::reset),
    ("fmi3GetFloat64", "invcste", '.', |f| f.try_get(&[TIME, H, V, E, DER_H, DER_V, Z], &mut [0.0; 7])),
    ("fmi3GetInt32", "invcste", '.', |f| unsafe { fmi3GetInt32(f.it, &BOUNCES, 1, &mut 0, 1) }),
    ("fmi3GetBoolean", "invcste", '.', |f| unsafe { fmi3GetBoolean(f.it, &RESTING, 1, &mut Fmi3Boolean(0), 1) }),
    ("fmi3SetFloat64", "invcs", '.', |f| f.set(&[U], &[2.0])),
    ("fmi3SetFloat64", "invs", '.', |f| f.set(&[C, K], &[0.2, 2.0])),
    ("fmi3SetFloat64", "in", '.', |f| f.set(&[M, MAP], &[2.0, 3.0, 4.0])),
    ("fmi3SetFloat64", "invcs", '.', |f| f.set(&[M, MAP, U], &[START[0], START[1], START[2], 0.3])),
    ("fmi3SetFloat64", "in", '.', |f| f.set(&[M, MAP, U], &[START[0], START[1], 0.25, 0.3])),
    ("fmi3SetFloat64", "vc", '.', |f| f.set(&[V], &[2.0])),
    ("fmi3SetFloat64", "", '.', |f| f.set(&[E], &[2.0])),
    ("fmi3SetFloat64", "", '.', |f| f.set(&[DER_V], &[2.0])),
    ("fmi3SetFloat64", "", '.', |f| f.set(&[Z], &[2.0])),
    ("fmi3GetFMUState", "invcst", '.', |f| f.save(&mut null_mut())),
    ("fmi3FreeFMUState", "invcste", '.', |f| with_state(f.kind, |_, state| f.free_state(state))),
    ("fmi3SerializedFMUStateSize", "invcste", '.', |f| {
        with_state(f.kind, |_, state| unsafe { fmi3SerializedFMUStateSize(f.it, *state, &mut 0) })
    }),
    ("fmi3DeserializeFMUState", "invcste", '.', |f| f.deserialize(&Fmu::running(f.kind, 0.0).bytes(), &mut null_mut())),
    ("fmi3GetDirectionalDerivative", "nvcst", '.', |f| f.directional(&[], &[], &[], &mut [])),
    ("fmi3GetAdjointDerivative", "nvcst", '.', |f| f.adjoint(&[], &[], &[], &mut [])),
    ("fmi3DoStep", "s", '.', |f| f.step(0.0, 0.1).0),
    ("fmi3GetOutputDerivatives", "st", '.', |f| f.output_derivatives(&[E], &[1], &mut [0.0])),
    ("fmi3EnterStepMode", "", '.', |f| unsafe { fmi3EnterStepMode(f.it) }),
    ("fmi3EnterEventMode", "vc", 'v', Fmu::event),
    ("fmi3UpdateDiscreteStates", "v", '.', |f| f.try_update().0),
    ("fmi3EvaluateDiscreteStates", "v", '.', |f| unsafe { fmi3EvaluateDiscreteStates(f.it) }),
    ("fmi3EnterContinuousTimeMode", "v", 'c', |f| unsafe { fmi3EnterContinuousTimeMode(f.it) }),
    ("fmi3CompletedIntegratorStep", "c", '.', Fmu::completed),
    ("fmi3SetTime", "vc", '.', |f| f.set_time(0.0)),
    ("fmi3SetContinuousStates", "vc", '.', |f| f.set_states(&[1.0, 2.0])),
    ("fmi3GetContinuousStateDerivatives", "nvct", '.', |f| f.try_derivatives(&mut [0.0; 2])),
    ("fmi3GetEventIndicators", "nvct", '.', |f| f.try_indicators(&mut [0.0])),
    ("fmi3GetContinuousStates", "nvct", '.', |f| f.try_states(&mut [0.0; 2])),
    ("fmi3GetNominalsOfContinuousStates", "nvct", '.', |f| f.try_nominals(&mut [0.0; 2])),
    ("fmi3GetNumberOfContinuousStates", "invct", '.', |f| unsafe { fmi3GetNumberOfContinuousStates(f.it, &mut 0) }),
    ("fmi3GetNumberOfEventIndicators", "invct", '.', |f| unsafe { fmi3GetNumberOfEventIndicators(f.it, &mut 0) }),
    ("fmi3EnterConfigurationMode", "", '.', |f| unsafe { fmi3EnterConfigurationMode(f.it) }),
    ("fmi3GetClock", "", '.', |f| unsafe { fmi3GetClock(f.it, null(), 0, null_mut()) }),
];

/// Functions that Co-Simulation without Event Mode lacks, and those that Model Exchange lacks.
fn of(table: &[Line], kind: Kind) -> Vec<Line> {
    let exchange_only = |allowed: &str| !allowed.contains('s') && allowed.chars().any(|c| "vc".contains(c));
    let step_only = |allowed: &str| allowed.contains('s') && !allowed.chars().any(|c| "vc".contains(c));
    let none = |allowed: &str| if kind.exchanges() { step_only(allowed) } else { exchange_only(allowed) };
    table
        .iter()
        .map(|&(name, allowed, next, call)| (name, if none(allowed) { "" } else { allowed }, next, call))
        .collect()
}

#[test]
fn every_function_in_every_state() {
    for (kind, table) in [(Kind::Me2, BALL2), (Kind::Me3, BALL3)] {
        check(kind, "invcte", &of(table, kind));
        let exit = ["fmi2ExitInitializationMode", "fmi3ExitInitializationMode"][usize::from(kind.version() - 2)];
        check(kind, "invcte", &[(exit, "n", 'v', Fmu::exit)]);
    }
    for (kind, table) in [(Kind::Cs2, BALL2), (Kind::Cs3 { event: false, early: false }, BALL3)] {
        check(kind, "inste", &of(table, kind));
        let exit = ["fmi2ExitInitializationMode", "fmi3ExitInitializationMode"][usize::from(kind.version() - 2)];
        check(kind, "inste", &[(exit, "n", 's', Fmu::exit)]);
    }
}

/// A restored state brings its own state of the lifecycle, the pending event included.
#[test]
fn a_state_of_event_mode_keeps_its_event() {
    for kind in ME {
        for state in "invct".chars() {
            let (one, other) = (Fmu::in_state(kind, state), Fmu::in_state(kind, 'e'));
            let mut stored = null_mut();
            assert_eq!(other.deserialize(&one.bytes(), &mut stored), OK);
            assert_eq!((other.restore(stored), other.state()), (OK, state));
            assert_eq!((other.restore(stored), other.bytes()), (OK, one.bytes()));
            assert_eq!(other.free_state(&mut stored), OK);
        }
        // The tick at T is due but was skipped: leaving Event Mode performs it, also in the restored instance.
        let one = Fmu::running(kind, 0.0);
        assert_eq!((one.set(&[U], &[3.0]), one.set_time(0.3), one.event()), (OK, OK, OK));
        let bytes = one.bytes();
        let other = Fmu::new(kind);
        let mut stored = null_mut();
        assert_eq!((other.deserialize(&bytes, &mut stored), other.restore(stored)), (OK, OK));
        assert_eq!((other.get(HELD), other.leave(), other.get(HELD)), (0.0, OK, 3.0));
        assert_eq!(other.free_state(&mut stored), OK);
    }
}

#[test]
fn a_state_of_another_interface_is_refused() {
    let kinds = [Kind::Me3, Kind::Cs3 { event: false, early: false }];
    for (from, to) in [(kinds[0], kinds[1]), (kinds[1], kinds[0]), (Kind::Me2, Kind::Cs2), (Kind::Cs2, Kind::Me2)] {
        let (from, to) = (Fmu::running(from, 0.0), Fmu::running(to, 0.0));
        let mut state = null_mut();
        let (mut stored, bytes) = (null_mut(), from.bytes());
        assert_eq!((from.save(&mut state), to.deserialize(&bytes, &mut stored)), (OK, OK));
        for handle in [state, stored] {
            let before = Fmu::running(to.kind, 0.0);
            assert_eq!(before.restore(handle), ERROR);
            let error = before.error();
            assert!(
                error.contains("for Model Exchange") && error.contains("for Co-Simulation without Event Mode"),
                "{error}"
            );
            // Nothing else changed: the instance behaves as after any error, and a saved state restores it.
            assert_eq!((before.get(H), before.state()), (1.0, 'e'));
        }
        assert_eq!((to.free_state(&mut state), to.free_state(&mut stored)), (OK, OK));
    }
}

/// Discard: in Continuous-Time Mode a solver tries values, and nothing changes.
#[test]
fn a_trial_step_is_discarded() {
    let trials: [Trial; 10] = [
        // CVode integrates past an event, where FMPy already sets the later inputs.
        ("k changes at events only", |f| f.set(&[U, K], &[1.0, 2.0])),
        ("h = NaN", |f| f.set_states(&[f64::NAN, 0.0])),
        ("v = inf", |f| f.set_states(&[0.0, f64::INFINITY])),
        ("v = 2000000000", |f| f.set_states(&[0.0, 2e9])),
        ("v = -2000000000", |f| f.set(&[H, V], &[0.5, -2e9])),
        ("h = NaN", |f| f.set(&[U, H], &[1.0, f64::NAN])),
        ("u = NaN", |f| f.set(&[U], &[f64::NAN])),
        ("u = 101", |f| f.set(&[H, U], &[3.0, 101.0])),
        ("v = 2000000", |f| {
            assert_eq!(f.set_states(&[1.0, 2e6]), OK);
            let status = f.try_derivatives(&mut [0.0; 2]);
            assert_eq!((f.try_get(&[DER_V], &mut [0.0]), f.set_states(&[1.0, 0.0])), (DISCARD, OK));
            status
        }),
        ("der(v) = NaN", |f| {
            assert_eq!(f.set_states(&[1e5, -3.0]), OK);
            let status = f.try_derivatives(&mut [0.0; 2]);
            assert_eq!((f.try_get(&[DER_H, DER_V], &mut [0.0; 2]), f.set_states(&[1.0, 0.0])), (DISCARD, OK));
            status
        }),
    ];
    for kind in ME {
        for (what, trial) in trials {
            let fmu = Fmu::running(kind, 0.0);
            assert_eq!(fmu.logging(true, &[c"logStatusDiscard"]), OK);
            let before = fmu.bytes();
            assert_eq!(trial(&fmu), DISCARD, "{what} {kind:?}");
            let messages = fmu.messages();
            let status = |m: &Message| (m.status, m.category.as_str()) == (DISCARD, "logStatusDiscard");
            assert!(messages.iter().all(|m| status(m) && m.text.contains(what)), "{what}: {messages:?}");
            assert_eq!((fmu.bytes() == before, fmu.state()), (true, 'c'), "{what}");
        }
    }
}

/// In other states the same values are errors, as in Co-Simulation; so are wrong calls.
#[test]
fn bad_input_is_an_error_that_names_its_cause() {
    type Wrong = (char, &'static str, fn(&Fmu) -> c_int);
    let wrong: [Wrong; 25] = [
        ('v', "u = NaN", |f| f.set(&[U], &[f64::NAN])),
        ('v', "k = 6", |f| f.set(&[K], &[6.0])),
        ('v', "v = 2000000000", |f| f.set(&[V], &[2e9])),
        ('c', "c changes at events only", |f| f.set(&[C], &[0.2])),
        ('c', "m is a fixed parameter", |f| f.set(&[M], &[0.1])),
        ('c', "e is an output", |f| f.set(&[E], &[0.1])),
        ('c', "value reference 22 does not exist; ", |f| f.set(&[UNKNOWN], &[0.1])),
        ('c', "value reference 22 does not exist; ", |f| f.try_get(&[UNKNOWN], &mut [0.1])),
        ('c', "time = NaN", |f| f.set_time(f64::NAN)),
        ('c', "time = inf", |f| f.set_time(f64::INFINITY)),
        ('c', "time = -0.1", |f| f.set_time(-0.1)),
        ('c', "nContinuousStates = 1", |f| f.set_states(&[1.0])),
        ('c', "nContinuousStates = 3", |f| f.try_states(&mut [1.0; 3])),
        ('c', "nContinuousStates = 0", |f| f.try_derivatives(&mut [])),
        ('c', "nEventIndicators = 2", |f| f.try_indicators(&mut [1.0; 2])),
        ('c', "nContinuousStates = 1", |f| f.try_nominals(&mut [1.0])),
        ('c', "k is not a known", |f| f.directional(&[DER_V], &[K], &[1.0], &mut [0.0])),
        ('c', "c_m is not a known", |f| f.directional(&[DER_V], &[C_M], &[1.0], &mut [0.0])),
        ('c', "m is not a known", |f| f.directional(&[DER_V], &[M], &[1.0], &mut [0.0])),
        ('c', "u is not named once", |f| f.directional(&[DER_V], &[U, U], &[1.0, 1.0], &mut [0.0])),
        ('c', "der(v) is not named once", |f| f.directional(&[DER_V, A, DER_V], &[U], &[1.0], &mut [0.0; 3])),
        ('c', "held is not an unknown", |f| f.directional(&[HELD], &[U], &[1.0], &mut [0.0])),
        ('c', "value reference 21 is not an unknown", |f| f.directional(&[Z], &[U], &[1.0], &mut [0.0])),
        ('c', "value reference 22 is not a known", |f| f.directional(&[A], &[UNKNOWN], &[1.0], &mut [0.0])),
        ('c', "seed = NaN", |f| f.directional(&[A], &[U], &[f64::NAN], &mut [0.0])),
    ];
    for kind in ME {
        for (state, what, call) in wrong {
            let fmu = Fmu::in_state(kind, state);
            let values = || [H, V, U, K, C, E, HELD].map(|vr| fmu.get(vr).to_bits());
            let before = values();
            assert_eq!(call(&fmu), ERROR, "{what} {kind:?}");
            let error = fmu.error();
            assert!(error.contains(what), "{what}: {error}");
            assert_eq!((values(), fmu.state()), (before, 'e'), "{what}");
        }
    }
    // Lengths that FMI 2.0 does not pass.
    let lengths: [Trial; 6] = [
        ("nSeed = 2", |f| f.directional(&[A], &[U], &[1.0, 2.0], &mut [0.0])),
        ("nSeed = 0", |f| f.directional(&[A], &[U], &[], &mut [0.0])),
        ("nSensitivity = 2", |f| f.directional(&[A], &[U], &[1.0], &mut [0.0; 2])),
        ("nSeed = 2", |f| f.adjoint(&[A], &[U], &[1.0, 2.0], &mut [0.0])),
        ("nSensitivity = 0", |f| f.adjoint(&[A], &[U], &[1.0], &mut [])),
        ("nValues = 1", |f| f.set(&[MAP], &[1.0])),
    ];
    for (what, call) in lengths {
        let fmu = Fmu::in_state(Kind::Me3, if what == "nValues = 1" { 'n' } else { 'c' });
        assert_eq!(call(&fmu), ERROR, "{what}");
        let error = fmu.error();
        assert!(error.contains(what), "{what}: {error}");
    }
}

#[test]
fn an_event_call_names_the_mode_and_the_interface() {
    let fmu = Fmu::in_state(Kind::Me3, 'c');
    assert_eq!(fmu.try_update().0, ERROR);
    assert_eq!(
        fmu.error(),
        "fmi3UpdateDiscreteStates: not allowed in the state Continuous-Time Mode; allowed in: Event Mode"
    );
    let fmu = Fmu::running(Kind::Cs2, 0.0);
    assert_eq!(fmu.event(), ERROR);
    assert_eq!(
        fmu.error(),
        "fmi2EnterEventMode: not allowed: the instance is one for Co-Simulation without Event Mode"
    );
    let fmu = Fmu::running(Kind::Me2, 0.0);
    assert_eq!(fmu.step(0.0, 0.1).0, ERROR);
    assert_eq!(fmu.error(), "fmi2DoStep: not allowed: the instance is one for Model Exchange");
}

#[test]
fn instances_that_this_fmu_cannot_be() {
    let journal = Journal::default();
    for early in [false, true] {
        let it = Fmu::open(Kind::Cs3 { event: true, early }, &journal, true, false);
        assert!(it.is_null());
        let message = journal.0.borrow_mut().pop().unwrap();
        assert!(message.text.contains("hasEventMode = false"), "{}", message.text);
    }
    // Early return is a permission, which this FMU does not need.
    let fmu = Fmu::running(Kind::Cs3 { event: false, early: true }, 0.0);
    assert_eq!(fmu.step(0.0, 1.0), (OK, Stepped { end: 1.0, ..Stepped::default() }));
}

/// FMI 3.0.2, 3.2.1: time goes back as far as the last completed step; here at most to the last event.
#[test]
fn time_goes_back_to_the_last_event() {
    for kind in ME {
        let fmu = Fmu::running(kind, 2.0);
        assert_eq!((fmu.set_time(2.2), fmu.set_time(2.1), fmu.set_time(2.0)), (OK, OK, OK));
        assert_eq!((fmu.set_time(2.2), fmu.completed(), fmu.set_time(2.25), fmu.set_time(2.2)), (OK, OK, OK, OK));
        assert!(kind == Kind::Me2 || fmu.get(TIME) == 2.2);
        assert_eq!(fmu.set_time(2.2 - 1e-15), OK, "a rounding error");
        // The standards forbid going back before a completed step, but importers do it.
        assert_eq!((fmu.set_time(2.1), fmu.set_time(2.0)), (OK, OK));
        assert_eq!(fmu.set_time(1.9), ERROR);
        assert!(fmu.error().contains("time = 1.9 is not allowed: finite and not before 2, the last event"));
        let fmu = Fmu::running(kind, 2.0);
        assert_eq!((fmu.set_time(2.25), fmu.event()), (OK, OK));
        fmu.settle();
        assert_eq!((fmu.leave(), fmu.set_time(2.25), fmu.set_time(2.2)), (OK, OK, ERROR));
        // Beyond a stop time: solvers try it.
        let fmu = Fmu::new(kind);
        assert_eq!((fmu.enter(0.0, Some(1.0)), fmu.exit(), fmu.leave(), fmu.set_time(1.5)), (OK, OK, OK, OK));
    }
}

/// FMPy, PyFMI and OMSimulator set every input again in the root function of the solver.
#[test]
fn a_discrete_input_can_be_set_to_the_value_that_it_has() {
    for kind in ME {
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!(fmu.set(&[U, K], &[1.0, 0.0]), OK);
        assert_eq!((fmu.get(U), fmu.set(&[U, K], &[2.0, 0.5])), (1.0, DISCARD));
        assert_eq!(fmu.get(U), 1.0, "all or none");
    }
}

#[test]
fn a_getter_shows_present_states_time_and_inputs() {
    for kind in ME {
        let fmu = Fmu::running(kind, 0.0);
        let model = |h: f64, v: f64, u: f64, t: f64| {
            let a = u - 9.81 - v * v.abs() * (1.0 - h / 44_330.0_f64).powf(4.255) * 0.05;
            (v * v + 2.0 * 9.81 * h + 0.01 * t.sin(), a)
        };
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12 * (1.0 + b.abs());
        for (h, v, u, t) in [
            (2.0, -1.0, 3.0, 0.1),
            (2.5, -1.0, 3.0, 0.1),
            (2.5, 4.0, 3.0, 0.1),
            (2.5, 4.0, 3.0, 0.2),
            (2.5, 4.0, -7.0, 0.2),
        ] {
            assert_eq!((fmu.set_time(t), fmu.set_states(&[h, v]), fmu.set(&[U], &[u])), (OK, OK, OK));
            let (e, a) = model(h, v, u, t);
            assert!(close(fmu.get(E), e) && close(fmu.get(A), a), "{} {e} {} {a}", fmu.get(E), fmu.get(A));
            assert_eq!((fmu.get(H), fmu.get(V), fmu.states()), (h, v, [h, v]));
            let dx = fmu.derivatives::<2>();
            assert!(dx[0] == v && close(dx[1], a));
            assert_eq!([fmu.get(DER_H), fmu.get(DER_V)], dx);
            assert_eq!(fmu.indicators(), [h + 1e-9]);
            // By value reference, as CasADi sets them.
            assert_eq!(fmu.set(&[V, H], &[1.5, 0.25]), OK);
            assert_eq!((fmu.states(), fmu.get(DER_H)), ([0.25, 1.5], 1.5));
        }
        let mut nominals = [0.0; 2];
        assert_eq!((fmu.try_nominals(&mut nominals), nominals), (OK, [1.0, 5.0]));
    }
}

/// A tunable parameter that is set in Event Mode acts from the update on, or from leaving Event Mode on.
#[test]
fn a_tunable_parameter_acts_after_the_event() {
    for kind in ME {
        for update in [false, true] {
            let fmu = Fmu::running(kind, 0.0);
            assert_eq!((fmu.set_states(&[5.0, -2.0]), fmu.event()), (OK, OK));
            fmu.settle();
            assert_eq!(fmu.set(&[C], &[4.0]), OK);
            if update {
                fmu.settle();
            }
            assert_eq!((fmu.leave(), fmu.get(C_M)), (OK, 2.0));
            let rho = (1.0 - 5.0 / 44_330.0_f64).powf(4.255);
            assert!((fmu.derivatives::<2>()[1] - (8.0 * rho - 9.81)).abs() < 1e-12);
            // Inconsistent values are refused at once.
            assert_eq!((fmu.event(), fmu.set(&[C], &[30.0])), (OK, OK));
            assert_eq!(if update { fmu.try_update().0 } else { fmu.leave() }, ERROR);
            assert!(fmu.error().ends_with("c / m is greater than 10"));
        }
    }
}

/// The importer's own integration and Co-Simulation give the same motion, bounce by bounce.
#[test]
fn model_exchange_and_co_simulation_agree() {
    for (me, cs) in ME.into_iter().zip(CS) {
        for (start, late) in [(0.0, 0.0), (1000.0, 0.0), (0.0, 1e-12), (0.0, -1e-12)] {
            let (me, cs) = (Fmu::started(me, start), Fmu::started(cs, start));
            let (_, update) = me.settle();
            assert_eq!((update.next, me.leave()), (Some(start + 0.3), OK));
            let mut t = start;
            let h = 1e-3;
            let (ticks, bounces) = solve(&me, start, start + 3.0, update.next, late);
            assert_eq!(ticks.len(), 10 - usize::from(late > 0.0), "{ticks:?}");
            for k in 0..3000 {
                // The mean of the input over the step, to second order.
                assert_eq!(cs.set(&[U], &[(t + 0.5 * h).sin()]), OK);
                assert_eq!(cs.step(t, h).0, OK);
                t = start + f64::from(k + 1) * h;
            }
            assert!(bounces >= 3, "{bounces}");
            assert_eq!(bounces, cs.get_integer(BOUNCES));
            for vr in [H, V, E] {
                assert!((me.get(vr) - cs.get(vr)).abs() < 1e-4, "{vr}: {} {}", me.get(vr), cs.get(vr));
            }
        }
    }
}

/// Values of an FMU state come back bit for bit, in the midst of a solver's step and in Event Mode.
#[test]
fn a_run_continues_from_a_state_bit_for_bit() {
    for kind in ME {
        let fmu = Fmu::started(kind, 0.0);
        let (_, update) = fmu.settle();
        assert_eq!(fmu.leave(), OK);
        solve(&fmu, 0.0, 1.0, update.next, 0.0);
        assert_eq!((fmu.set_time(1.01), fmu.set_states(&[0.3, 1.0])), (OK, OK));
        let bytes = fmu.bytes();
        let run = |fmu: &Fmu| {
            assert_eq!(fmu.event(), OK);
            let (_, update) = fmu.settle();
            assert_eq!(fmu.leave(), OK);
            solve(fmu, 1.01, 2.0, update.next, 0.0);
            [H, V, E, A, HELD].map(|vr| fmu.get(vr).to_bits())
        };
        let first = run(&fmu);
        let other = Fmu::new(kind);
        let mut stored = null_mut();
        assert_eq!((other.deserialize(&bytes, &mut stored), other.restore(stored)), (OK, OK));
        assert_eq!(run(&other), first);
        assert_eq!((other.reset(), other.state(), other.free_state(&mut stored)), (OK, 'i', OK));
    }
}

/// Warnings of the model: a separate message while the call returns OK, once a second and key.
#[test]
fn warnings_come_once_a_second() {
    for kind in [Kind::Me2, Kind::Me3, Kind::Cs2, Kind::Cs3 { event: false, early: false }] {
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!(fmu.logging(true, &[c"logStatusWarning"]), OK);
        let mut heard = Vec::new();
        for k in 0..400_u32 {
            let t = f64::from(k) * 0.01;
            if kind.exchanges() {
                assert_eq!((fmu.set_time(t), fmu.set_states(&[0.1, 3.0]), fmu.completed()), (OK, OK, OK));
            } else {
                assert_eq!(fmu.step(t, 0.01).0, OK);
            }
            let now = f64::from(if kind.exchanges() { k } else { k + 1 }) / 100.0;
            for message in fmu.messages() {
                assert_eq!((message.status, message.category.as_str()), (1, "logStatusWarning"));
                assert!(message.text.starts_with(&format!("it: at {now} s: the ball ")), "{}", message.text);
                heard.push((message.text.contains("above the ground"), t));
            }
        }
        for low in [true, false] {
            let times: Vec<f64> = heard.iter().filter(|(key, _)| *key == low).map(|(_, t)| *t).collect();
            assert!(times.windows(2).all(|w| w[1] - w[0] > 1.0 - 1e-9), "{kind:?} {times:?}");
            assert!(times.len() >= 2, "{kind:?} {times:?}");
            if kind.exchanges() {
                assert_eq!(times.len(), 4, "{times:?}");
            }
        }
    }
}

/// A value without effect is reported once, by name, despite later messages; after a reset again.
#[test]
fn a_value_without_effect_is_said_once() {
    for kind in [Kind::Me2, Kind::Me3, Kind::Cs2, Kind::Cs3 { event: false, early: false }] {
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!(fmu.logging(true, &[c"logStatusWarning"]), OK);
        let mut heard = Vec::new();
        for k in 0..300_u32 {
            let t = f64::from(k) * 0.01;
            if k == 50 {
                assert_eq!(fmu.set(&[U], &[99.0]), OK);
            }
            if kind.exchanges() {
                assert_eq!((fmu.set_time(t), fmu.set_states(&[0.1, 3.0]), fmu.completed()), (OK, OK, OK));
            } else {
                assert_eq!(fmu.step(t, 0.01).0, OK);
            }
            heard.extend(fmu.messages().into_iter().filter(|m| m.text.contains("no effect")).map(|m| (k, m.text)));
        }
        let [(k, text)] = &heard[..] else { panic!("{kind:?}: {heard:?}") };
        assert!((50..=51).contains(k) && text.contains("u = 99 ") && text.contains("that much lift"), "{k}: {text}");
    }
}

/// What the standards forbid and does no harm is done, with a warning at its first time.
#[test]
fn a_habit_of_an_importer_is_one_warning() {
    let habits: [Trial; 5] = [
        ("the importer sets the continuous states outside Continuous-Time Mode", |f| f.set_states(&f.states::<2>())),
        ("the importer sets the time in Event Mode", |f| f.set_time(0.1)),
        ("the importer enters Event Mode in Event Mode", Fmu::event),
        ("the importer sets variables that cannot change now", |f| f.set(&[M], &[START[0]])),
        ("the importer sets a time before the last completed step", |f| {
            let all = [f.leave(), f.set_time(0.2), f.completed(), f.set_time(0.15), f.event()];
            all.into_iter().max().unwrap()
        }),
    ];
    for (why, habit) in habits {
        let fmu = Fmu::with(Kind::Me3, true, true);
        assert_eq!((fmu.enter(0.0, None), fmu.exit()), (OK, OK));
        fmu.settle();
        fmu.messages();
        assert_eq!((habit(&fmu), habit(&fmu)), (OK, OK), "{why}: {:?}", fmu.messages());
        let messages = fmu.messages();
        let warned: Vec<_> =
            messages.iter().filter(|m| m.category == "logStatusWarning" && m.text.contains("importer")).collect();
        assert!(warned.len() == 1 && warned[0].text.contains(why), "{why}: {messages:?}");
    }
}
