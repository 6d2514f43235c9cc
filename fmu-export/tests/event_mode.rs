//! Event Mode and early return of FMI 3.0 Co-Simulation, and Model Exchange, for a sampled model: every sample reads the values
//! set at its instant, for any communication step.
//!
//! States: i instantiated, n initialization, s step, v event, t terminated, e error.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod solver;

use fmu_core::{Capabilities, Exported, Interface, Next, Plain};
use fmu_export::abi::types::*;
use fmu_export::instance::Instance as Native;
use fmu_export::log::{Log, Sink, Status};
use fmu_export::snapshot::Snapshot;
use fmu_export::{blob, lifecycle};
use solver::sampler::*;
use solver::table::{Line, check, with_state};
use solver::*;
use std::ptr::null_mut;

fmu_export::export!(Sampler: Sampled + Warns);

use fmi::*;

const SAMPLER: &[Line] = &[
    ("fmi3SetDebugLogging", "insvte", '.', |f| f.logging(false, &[])),
    ("fmi3EnterInitializationMode", "i", 'n', |f| f.enter(0.0, Some(1.0))),
    ("fmi3ExitInitializationMode", "n", 'v', Fmu::exit),
    ("fmi3Terminate", "sv", 't', Fmu::terminate),
    ("fmi3Reset", "insvte", 'i', Fmu::reset),
    ("fmi3GetFloat64", "insvte", '.', |f| f.try_get(&[TIME, X, Y], &mut [0.0; 3])),
    ("fmi3GetInt32", "insvte", '.', |f| unsafe { fmi3GetInt32(f.it, &COUNT, 1, &mut 0, 1) }),
    ("fmi3SetFloat64", "insv", '.', |f| f.set(&[X, D, GAIN], &[2.0, 3.0, 4.0])),
    ("fmi3SetBoolean", "insv", '.', |f| f.set_boolean(ON, false)),
    ("fmi3SetFloat64", "in", '.', |f| f.set(&[FIXED], &[2.0])),
    ("fmi3SetFloat64", "", '.', |f| f.set(&[Y], &[2.0])),
    ("fmi3GetFMUState", "insvt", '.', |f| f.save(&mut null_mut())),
    ("fmi3SetFMUState", "insvte", 's', |f| with_state(f.kind, |_, state| f.restore(*state))),
    ("fmi3FreeFMUState", "insvte", '.', |f| with_state(f.kind, |_, state| f.free_state(state))),
    ("fmi3DeserializeFMUState", "insvte", '.', |f| f.deserialize(&Fmu::running(f.kind, 0.0).bytes(), &mut null_mut())),
    ("fmi3DoStep", "s", '.', |f| f.step(0.0, 0.001).0),
    ("fmi3EnterEventMode", "s", 'v', Fmu::event),
    ("fmi3UpdateDiscreteStates", "v", '.', |f| f.try_update().0),
    ("fmi3EvaluateDiscreteStates", "v", '.', |f| unsafe { fmi3EvaluateDiscreteStates(f.it) }),
    ("fmi3EnterStepMode", "v", 's', Fmu::leave),
    ("fmi3EnterContinuousTimeMode", "", '.', |f| unsafe { fmi3EnterContinuousTimeMode(f.it) }),
    ("fmi3CompletedIntegratorStep", "", '.', Fmu::completed),
    ("fmi3SetTime", "", '.', |f| f.set_time(0.0)),
    ("fmi3SetContinuousStates", "", '.', |f| f.set_states(&[])),
    ("fmi3GetContinuousStates", "", '.', |f| f.try_states(&mut [])),
    ("fmi3GetContinuousStateDerivatives", "", '.', |f| f.try_derivatives(&mut [])),
    ("fmi3GetEventIndicators", "", '.', |f| f.try_indicators(&mut [])),
    ("fmi3GetNominalsOfContinuousStates", "", '.', |f| f.try_nominals(&mut [])),
    ("fmi3GetNumberOfContinuousStates", "", '.', |f| unsafe { fmi3GetNumberOfContinuousStates(f.it, &mut 0) }),
    // Without states there are no derivatives.
    ("fmi3GetDirectionalDerivative", "", '.', |f| f.directional(&[], &[], &[], &mut [])),
    ("fmi3GetAdjointDerivative", "", '.', |f| f.adjoint(&[], &[], &[], &mut [])),
    ("fmi3GetOutputDerivatives", "", '.', |f| f.output_derivatives(&[], &[], &mut [])),
];

#[test]
fn every_function_in_every_state() {
    for early in [false, true] {
        check(Kind::Cs3 { event: true, early }, "insvte", SAMPLER);
        let exits = |table: &[Line]| -> Vec<Line> {
            let without = |&(name, allowed, next, call): &Line| match name {
                "fmi3ExitInitializationMode" => (name, allowed, 's', call),
                _ if !allowed.contains('s') && allowed.contains('v') => (name, "", next, call),
                "fmi3EnterEventMode" => (name, "", next, call),
                _ => (name, allowed, next, call),
            };
            table.iter().map(without).collect()
        };
        check(Kind::Cs3 { event: false, early }, "inste", &exits(SAMPLER));
    }
}

/// The importer's values at instant k.
fn inputs(k: u64) -> [f64; 2] {
    let k = f64::from(u32::try_from(k).unwrap());
    [(0.7 * k).sin(), (1.3 * k).cos()]
}

const T: f64 = 0.01;
const SAMPLES: u64 = 400;

/// The instant that is now, if one is.
fn instant(fmu: &Fmu, start: f64) -> Option<u64> {
    let k = ((fmu.get(TIME) - start) / T).round();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    ((fmu.get(TIME) - start - k * T).abs() < 1e-5 * T).then_some(k as u64)
}

/// Outputs at the instants k T by steps of T without any event handling: the expected outputs of every importer.
fn reference(start: f64) -> Vec<u64> {
    let fmu = Fmu::running(Kind::Cs3 { event: false, early: false }, start);
    let mut outputs = vec![fmu.get(Y).to_bits()];
    for k in 0..SAMPLES {
        assert_eq!(fmu.set(&[X, D], &inputs(k)), OK);
        let t = f64::mul_add(f64::from(u32::try_from(k).unwrap()), T, start);
        assert_eq!(fmu.step(t, T).0, OK);
        outputs.push(fmu.get(Y).to_bits());
    }
    outputs
}

/// An event at instant k: the new output is visible before the update, and a second update has no effect.
fn act(fmu: &Fmu, k: u64, start: f64, seen: &mut [u64]) -> Option<f64> {
    let before = fmu.get(Y).to_bits();
    assert_eq!(fmu.set(&[X, D], &[77.0, 4.0]), OK, "inputs may change any number of times");
    assert_eq!(fmu.set(&[X, D], &inputs(k)), OK);
    let update = fmu.update();
    let wanted = f64::mul_add(f64::from(u32::try_from(k + 1).unwrap()), T, start);
    assert_eq!(update, Update { next: Some(wanted), ..Update::default() });
    assert_eq!(fmu.set(&[X], &[99.0]), OK);
    assert_eq!(fmu.update(), update);
    assert_eq!(fmu.get(Y).to_bits(), before, "the new command is not visible before the next instant");
    seen[usize::try_from(k).unwrap()] = before;
    update.next
}

#[test]
fn every_sample_reads_what_was_set_at_its_instant() {
    for start in [0.0, 1e4] {
        let wanted = reference(start);
        for (event, early) in [(true, true), (true, false), (false, true)] {
            for share in [0.3, 0.7, 1.0, 2.5, 7.3] {
                let fmu = Fmu::started(Kind::Cs3 { event, early }, start);
                let mut seen = vec![0; wanted.len()];
                let mut next = None;
                if event {
                    next = act(&fmu, 0, start, &mut seen);
                    assert_eq!(fmu.leave(), OK);
                } else {
                    seen[0] = fmu.get(Y).to_bits();
                    assert_eq!(fmu.set(&[X, D], &inputs(0)), OK);
                }
                let (mut t, mut n) = (start, 1.0);
                loop {
                    // An importer that takes no early return stops at the next event.
                    let point = start + n * share * T;
                    let end = if early { point } else { point.min(next.unwrap()) };
                    let (status, stepped) = fmu.step(t, end - t);
                    assert_eq!(status, OK, "{:?}", fmu.messages());
                    assert!(early || !stepped.early);
                    t = stepped.end;
                    assert_eq!(t, fmu.get(TIME));
                    if !stepped.early && end == point {
                        n += 1.0;
                    }
                    let k = instant(&fmu, start);
                    assert!(!stepped.early || k.is_some(), "an early return is at an instant");
                    assert_eq!(stepped.event, event && k.is_some());
                    let Some(k) = k else { continue };
                    if event {
                        assert_eq!(fmu.event(), OK);
                        next = act(&fmu, k, start, &mut seen);
                        assert_eq!(fmu.leave(), OK);
                    } else {
                        seen[usize::try_from(k).unwrap()] = fmu.get(Y).to_bits();
                        assert_eq!(fmu.set(&[X, D], &inputs(k)), OK);
                    }
                    if k == SAMPLES {
                        break;
                    }
                }
                assert_eq!(seen, wanted, "event {event}, early {early}, h = {share} T from {start}");
            }
        }
    }
}

/// An importer that does not enter an offered Event Mode loses no sample: each reads the held inputs.
#[test]
fn without_entering_event_mode_nothing_is_lost() {
    for early in [false, true] {
        for share in [0.3, 0.7, 1.0, 2.5, 7.3] {
            let plain = Fmu::running(Kind::Cs3 { event: false, early: false }, 0.0);
            let fmu = Fmu::started(Kind::Cs3 { event: true, early }, 0.0);
            assert_eq!(fmu.leave(), OK);
            let mut t = 0.0;
            for n in 1..100_u32 {
                let end = f64::from(n) * share * T;
                let x = [f64::from(n).sin(), f64::from(n).cos()];
                assert_eq!((plain.set(&[X, D], &x), fmu.set(&[X, D], &x)), (OK, OK));
                assert_eq!(plain.step(t, end - t).0, OK);
                let mut at = t;
                loop {
                    let (status, stepped) = fmu.step(at, end - at);
                    assert_eq!(status, OK, "{:?}", fmu.messages());
                    at = stepped.end;
                    if !stepped.early {
                        break;
                    }
                }
                t = end;
                // At an instant, the new output waits for Event Mode.
                if instant(&fmu, 0.0).is_none() {
                    assert_eq!(fmu.get(Y).to_bits(), plain.get(Y).to_bits(), "{share} {n}");
                    assert_eq!(fmu.get_integer(COUNT), plain.get_integer(COUNT));
                }
            }
            assert!(plain.get_integer(COUNT) > 25);
        }
    }
}

/// A sampler whose next event is always now.
struct Stuck;

impl Exported for Stuck {
    type Model = Sampler;
    const CAN: Capabilities<Sampler> = {
        let mut can = Capabilities::NONE.Sampled();
        if let Some(events) = &mut can.events {
            events.next = |_, now| Next::At(now);
        }
        can
    };
}

#[test]
fn an_importer_is_not_led_into_a_loop() {
    let log = Log::new(Box::new(Deaf), false);
    let fresh = Snapshot::new(Interface::ModelExchange);
    let mut stuck = Native::<Stuck>::new(lifecycle::Standard::Fmi3, "stuck".into(), log, fresh);
    stuck.set_up(2.0, None).unwrap();
    stuck.exit_initialization().unwrap();
    let fault = stuck.update_discrete().unwrap_err();
    assert_eq!(fault.message(), "after the event at 2 s the next one is due at once: an error of the model");
}

struct Deaf;

impl Sink for Deaf {
    fn write(&self, _: Status, _: &str, _: &str) {}
    fn hears(&self) -> bool {
        false
    }
}

/// An importer that handles no events gets the bits, and the bytes of the state, of a model without the capability.
#[test]
fn without_both_flags_nothing_changes() {
    for share in [0.3, 0.7, 1.0, 2.5, 7.3] {
        for kind in CS {
            let fmu = Fmu::running(kind, 0.0);
            let log = Log::new(Box::new(Deaf), false);
            let mut plain =
                Native::<Plain<Sampler>>::new(lifecycle::Standard::Fmi3, "plain".into(), log, Snapshot::default());
            plain.set_up(0.0, None).unwrap();
            plain.exit_initialization().unwrap();
            plain.current.life.after(true, lifecycle::Next::Start);
            let mut t = 0.0;
            for n in 0..200_u32 {
                let x = [f64::from(n).sin(), f64::from(n).cos()];
                assert_eq!(fmu.set(&[X, D], &x), OK);
                plain.set(&[X, D], &x).unwrap();
                assert_eq!(fmu.step(t, share * T), (OK, Stepped { end: t + share * T, ..Stepped::default() }));
                plain.do_step(t, share * T).unwrap();
                assert!(
                    fmu.bytes() == blob::write(&plain.current, &Capabilities::NONE.stored.unwrap()).unwrap(),
                    "{share} {n}"
                );
                t += share * T;
            }
        }
    }
}

/// Model Exchange: due instants in Event Mode, early and late by rounding, with foreign events in between.
#[test]
fn model_exchange_samples_at_its_time_events() {
    for kind in ME {
        for start in [0.0, 1e4] {
            for off in [0.0, -1.0, 1.0] {
                let wanted = reference(start);
                let mut seen = vec![0; wanted.len()];
                let fmu = Fmu::started(kind, start);
                let mut next = act(&fmu, 0, start, &mut seen).unwrap();
                for k in 1..=SAMPLES {
                    assert_eq!(fmu.leave(), OK);
                    // Another FMU's event: no sample is due.
                    assert_eq!((fmu.set_time(next - 0.4 * T), fmu.event()), (OK, OK));
                    let shown = fmu.get(Y);
                    assert_eq!(fmu.set(&[X, D], &[55.0, 1.0]), OK);
                    assert_eq!(fmu.update(), Update { next: Some(next), ..Update::default() });
                    assert_eq!((fmu.leave(), fmu.get(Y)), (OK, shown));
                    // An ulp early or late.
                    let at = next + off * f64::EPSILON * next;
                    assert_eq!((fmu.set_time(at + 0.3 * T), fmu.get(Y)), (OK, shown), "no output depends only on time");
                    assert_eq!((fmu.set_time(at), fmu.completed(), fmu.get(Y)), (OK, OK, shown));
                    assert_eq!(fmu.event(), OK);
                    next = act(&fmu, k, start, &mut seen).unwrap();
                }
                assert_eq!(seen, wanted, "{kind:?} {start} {off}");
            }
        }
    }
}

/// A late event handles everything that is due, with the inputs as set; so does leaving Event Mode without an update.
#[test]
fn late_and_forgotten_events() {
    for kind in ME {
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!((fmu.get_integer(COUNT), fmu.set_time(3.5 * T), fmu.event()), (1, OK, OK));
        assert_eq!((fmu.get_integer(COUNT), fmu.update().next, fmu.get_integer(COUNT)), (1, Some(4.0 * T), 4));
        assert_eq!((fmu.leave(), fmu.set_time(4.0 * T), fmu.event(), fmu.leave()), (OK, OK, OK, OK));
        assert_eq!(fmu.get_integer(COUNT), 5);
    }
}

/// Values that are set in Event Mode do not run `derive` again; a tunable parameter does, at the update.
#[test]
fn a_tunable_parameter_acts_at_the_update() {
    for kind in [Kind::Cs3 { event: true, early: false }, Kind::Me2, Kind::Me3] {
        let fmu = Fmu::started(kind, 0.0);
        fmu.settle();
        let derived = fmu.get_integer(DERIVED);
        assert_eq!(fmu.set(&[X, D], &[1.0, 2.0]), OK);
        fmu.settle();
        assert_eq!(fmu.get_integer(DERIVED), derived);
        assert_eq!((fmu.set(&[GAIN], &[3.0]), fmu.get(PRODUCT)), (OK, 1.0));
        fmu.settle();
        assert_eq!((fmu.get(PRODUCT), fmu.get_integer(DERIVED)), (3.0, derived + 1));
        let fmu = Fmu::entered(kind, 0.0);
        assert_eq!((fmu.set(&[FIXED], &[10.0]), fmu.exit(), fmu.set(&[GAIN], &[6.0])), (OK, OK, OK));
        assert_eq!(fmu.try_update().0, ERROR);
        assert!(fmu.error().ends_with("gain times fixed is greater than 50"));
    }
}

/// An FMU state inside Event Mode keeps the pending event, also as bytes.
#[test]
fn a_state_inside_event_mode() {
    for kind in [Kind::Cs3 { event: true, early: true }, Kind::Me2, Kind::Me3] {
        let fmu = Fmu::running(kind, 0.0);
        if kind.exchanges() {
            assert_eq!(fmu.set_time(T), OK);
        } else {
            assert_eq!(fmu.step(0.0, 2.5 * T), (OK, Stepped { event: true, early: true, end: T }));
        }
        assert_eq!((fmu.event(), fmu.set(&[X], &[5.0])), (OK, OK));
        let bytes = fmu.bytes();
        let go = |fmu: &Fmu| {
            let update = fmu.update();
            (update, fmu.bytes())
        };
        let first = go(&fmu);
        let other = Fmu::new(kind);
        let mut state = null_mut();
        assert_eq!((other.deserialize(&bytes, &mut state), other.restore(state)), (OK, OK));
        assert_eq!((other.get(X), other.get_integer(COUNT), other.state()), (5.0, 1, 'v'));
        assert_eq!(other.restore(state), OK);
        assert!(go(&other) == first);
        assert_eq!(other.free_state(&mut state), OK);
    }
}

/// States of the three interfaces do not mix.
#[test]
fn states_of_interfaces_do_not_mix() {
    let kinds = [Kind::Me3, Kind::Cs3 { event: true, early: false }, Kind::Cs3 { event: false, early: false }];
    for from in kinds {
        for to in kinds {
            let bytes = Fmu::running(from, 0.0).bytes();
            let fmu = Fmu::running(to, 0.0);
            let mut state = null_mut();
            assert_eq!(fmu.deserialize(&bytes, &mut state), OK);
            assert_eq!(fmu.restore(state), if from == to { OK } else { ERROR }, "{from:?} {to:?}");
            assert_eq!(fmu.free_state(&mut state), OK);
        }
    }
    // Permission to return early is not part of the state.
    let bytes = Fmu::running(Kind::Cs3 { event: false, early: true }, 0.0).bytes();
    let fmu = Fmu::new(kinds[2]);
    let mut state = null_mut();
    assert_eq!((fmu.deserialize(&bytes, &mut state), fmu.restore(state), fmu.free_state(&mut state)), (OK, OK, OK));
}

#[test]
fn a_fault_of_a_sample_is_an_error() {
    for kind in [Kind::Cs2, Kind::Cs3 { event: true, early: false }, Kind::Cs3 { event: false, early: true }, Kind::Me2]
    {
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!(fmu.set(&[X], &[2e6]), OK);
        let status = if kind.exchanges() {
            assert_eq!((fmu.set_time(T), fmu.event()), (OK, OK));
            fmu.try_update().0
        } else {
            match fmu.step(0.0, 1.5 * T) {
                (OK, stepped) => {
                    assert!(stepped.early);
                    fmu.step(stepped.end, 0.5 * T).0
                }
                (status, _) => status,
            }
        };
        assert_eq!(status, ERROR, "{kind:?}");
        assert!(fmu.error().contains("x = 2000000 is not allowed: at most 1e6"));
        assert_eq!(fmu.state(), 'e');
    }
}

/// A step of a year returns at the next sample; if it may not return early, it is refused, because it would never end.
#[test]
fn a_step_of_a_year() {
    let year = 3.15e7;
    for event in [false, true] {
        let fmu = Fmu::running(Kind::Cs3 { event, early: true }, 0.0);
        assert_eq!(fmu.step(0.0, year), (OK, Stepped { event, early: true, end: T }));
        let fmu = Fmu::running(Kind::Cs3 { event, early: false }, 0.0);
        assert_eq!(fmu.step(0.0, year).0, ERROR);
        assert!(fmu.error().contains("at most 10000000 sample periods of 0.01 s"));
    }
}

#[test]
fn warnings_come_once_a_second_in_every_mode() {
    let kinds = [
        Kind::Cs2,
        Kind::Cs3 { event: false, early: true },
        Kind::Cs3 { event: true, early: false },
        Kind::Me2,
        Kind::Me3,
    ];
    for kind in kinds {
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!((fmu.logging(true, &[c"logStatusWarning"]), fmu.set(&[X], &[200.0])), (OK, OK));
        let mut times = Vec::new();
        for k in 1..350_u32 {
            let t = f64::from(k) * T;
            if kind.exchanges() {
                assert_eq!(fmu.set_time(t), OK);
            } else {
                assert_eq!(fmu.step(f64::from(k - 1) * T, T).0, OK);
            }
            if kind.handles_events() {
                assert_eq!(fmu.event(), OK);
                fmu.settle();
                assert_eq!(fmu.leave(), OK);
            }
            for message in fmu.messages() {
                assert_eq!((message.status, message.category.as_str()), (1, "logStatusWarning"));
                assert!(message.text.ends_with("is large"), "{}", message.text);
                times.push(t);
            }
        }
        assert!(times.len() == 4 && times.windows(2).all(|w| w[1] - w[0] >= 1.0 - 1e-9), "{kind:?} {times:?}");
    }
}
