//! Ticks in Event Mode, intervals, and their place in a saved state.

use super::*;

/// Outputs of an active clock belong to the tick before; inputs may be set repeatedly; the update ticks once.
#[test]
fn a_tick_in_event_mode() {
    for kind in [Kind::Cs, Kind::Me] {
        let host = Host::started(kind);
        for k in 0..10 {
            let (t, u) = (f64::from(k) * 0.2, f64::from(k + 1));
            assert_eq!(host.clock(FIXED), Some(false));
            assert_eq!(host.set_clock(FIXED, true), OK);
            assert_eq!(host.set_clock(FIXED, true), OK, "again has no effect");
            assert_eq!((host.clock(FIXED), host.clock(CONSTANT)), (Some(true), Some(false)));
            assert_eq!((host.set(U, 77.0), host.get(Y), host.set(U, u)), (OK, Some(f64::from(k)), OK));
            assert_eq!((host.ticks(), host.update(), host.ticks()), (k, OK, k + 1));
            assert_eq!((host.clock(FIXED), host.update(), host.ticks()), (Some(false), OK, k + 1));
            host.proceed(t, t + 0.2);
        }
        assert!(host.errors().is_empty());
    }
}

#[test]
fn a_clock_ticks_once_at_an_instant() {
    for kind in [Kind::Cs, Kind::Me] {
        for (vr, again) in [(CONSTANT, false), (FIXED, false), (TUNABLE, false), (CHANGING, true), (TRIGGERED, true)] {
            let host = Host::started(kind);
            assert_eq!((host.set_clock(vr, true), host.update()), (OK, OK));
            assert_eq!(host.set_clock(vr, true) == OK, again, "{vr}");
        }
        let host = Host::started(kind);
        assert_eq!((host.set_clock(FIXED, false), host.set_clock(FIXED, true)), (OK, OK));
        assert_eq!(host.set_clock(FIXED, false), ERROR);
        assert!(host.errors()[0].contains("canBeDeactivated = false"));
    }
    // Two clocks, in both orders, at one instant and in one update.
    for pair in [[FIXED, TRIGGERED], [TRIGGERED, FIXED]] {
        for kind in [Kind::Cs, Kind::Me] {
            let host = Host::started(kind);
            let yes = [Fmi3Boolean(1); 2];
            assert_eq!(unsafe { fmi3SetClock(host.it.get(), pair.as_ptr(), 2, yes.as_ptr()) }, OK);
            assert_eq!((host.set(U, 5.0), host.update(), host.ticks(), host.get(FREE)), (OK, OK, 2, Some(5.0)));
            // All or none.
            let bad = [pair[0], TRIP];
            let host = Host::started(kind);
            assert_eq!(unsafe { fmi3SetClock(host.it.get(), bad.as_ptr(), 2, yes.as_ptr()) }, ERROR);
            assert!(host.errors()[0].contains("trip is an output clock"));
        }
        // In Scheduled Execution, one activation after the other.
        let host = Host::started(Kind::Se);
        assert_eq!((host.set(U, 5.0), host.activate(pair[0], 1.0), host.activate(pair[1], 1.0)), (OK, OK, OK));
        assert_eq!((host.ticks(), host.get(FREE), host.updates.get() > 0), (2, Some(5.0), true));
    }
}

/// Qualifiers: 0 not yet known, 1 unchanged, 2 changed.
#[test]
fn intervals_and_qualifiers() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        let host = Host::entered(kind);
        for (vr, interval) in [(CONSTANT, 0.1), (FRACTION, 1.0 / 3.0), (FIXED, 0.2), (TUNABLE, 0.3), (CHANGING, 0.1)] {
            assert_eq!((host.interval(vr), host.interval(vr)), (Some((interval, 2)), Some((interval, 1))), "{vr}");
        }
        assert_eq!((host.interval(COUNTDOWN), host.interval(COUNTDOWN)), (Some((0.0, 0)), Some((0.0, 0))));
        assert_eq!((host.set_interval(FIXED, 0.25), host.interval(FIXED)), (OK, Some((0.25, 2))));
        assert_eq!(host.get(14), Some(0.25), "T_fixed");
        assert_eq!(host.exit(), OK);
        if kind == Kind::Se {
            // Afterwards, as in `scheduled`.
            continue;
        }
        // A changing clock has an interval where it ticked.
        assert_eq!((host.set_clock(CHANGING, true), host.update()), (OK, OK));
        assert_eq!((host.interval(CHANGING), host.interval(CHANGING)), (Some((0.2, 2)), Some((0.2, 1))));
        // A countdown begins at an event of another clock, and reports it once.
        assert_eq!(
            (host.interval(COUNTDOWN), host.set_clock(TRIGGERED, true), host.update()),
            (Some((0.0, 0)), OK, OK)
        );
        assert_eq!((host.interval(COUNTDOWN), host.interval(COUNTDOWN)), (Some((0.25, 2)), Some((0.25, 1))));
        host.proceed(0.0, 0.25);
        assert_eq!(host.interval(COUNTDOWN), Some((0.25, 1)));
        assert_eq!((host.set_clock(COUNTDOWN, true), host.update()), (OK, OK));
        assert_eq!(host.interval(COUNTDOWN), Some((0.25, 0)), "the next tick is not known");
        // Tunable: in Event Mode too, checked with the other parameters at the update.
        assert_eq!((host.set_interval(TUNABLE, 0.5), host.interval(TUNABLE)), (OK, Some((0.5, 2))));
        assert_eq!(host.interval(CHANGING), None, "it did not tick here");
    }
    for bad in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        assert_eq!(Host::entered(Kind::Cs).set_interval(FIXED, bad), ERROR);
    }
    let host = Host::entered(Kind::Cs);
    assert_eq!((host.set_interval(FIXED, 11.0), host.exit()), (OK, ERROR));
    assert!(host.errors()[0].contains("fixed is too long"));
}

/// An output clock is active from the tick that activates it to the update.
#[test]
fn an_output_clock_in_event_mode() {
    for kind in [Kind::Cs, Kind::Me] {
        let host = Host::started(kind);
        for (k, trips) in [(1, false), (2, true), (3, false), (4, true)] {
            assert_eq!(host.clock(TRIP), Some(false));
            assert_eq!((host.set_clock(TRIGGERED, true), host.clock(TRIP)), (OK, Some(trips)), "tick {k}");
            assert_eq!((host.ticks(), host.clock(TRIP)), (k - 1, Some(trips)), "a getter changes nothing");
            assert_eq!((host.update(), host.clock(TRIP), host.ticks()), (OK, Some(false), k));
        }
    }
}

/// A state saved in Event Mode contains the active clocks and the reported intervals, as a handle and as bytes.
#[test]
fn a_saved_state_holds_the_clocks() {
    for kind in [Kind::Cs, Kind::Me] {
        let host = Host::started(kind);
        let it = host.it.get();
        assert_eq!((host.set_clock(TRIGGERED, true), host.update(), host.set_clock(FIXED, true)), (OK, OK, OK));
        assert_eq!(host.set(U, 3.0), OK);
        let (mut state, mut copy, mut size) = (null_mut(), null_mut(), 0);
        unsafe {
            assert_eq!(fmi3GetFMUState(it, &mut state), OK);
            assert_eq!(fmi3SerializedFMUStateSize(it, state, &mut size), OK);
            let mut bytes = vec![0; size];
            assert_eq!(fmi3SerializeFMUState(it, state, bytes.as_mut_ptr(), size), OK);
            assert_eq!(fmi3DeserializeFMUState(it, bytes.as_ptr(), size, &mut copy), OK);
        }
        for saved in [state, copy] {
            assert_eq!(host.update(), OK);
            assert_eq!(host.clock(FIXED), Some(false));
            assert_eq!(unsafe { fmi3SetFMUState(it, saved) }, OK);
            assert_eq!(
                (host.clock(FIXED), host.get(U), host.interval(COUNTDOWN)),
                (Some(true), Some(3.0), Some((0.25, 2)))
            );
        }
        let mut states = [state, copy];
        for state in &mut states {
            assert_eq!(unsafe { fmi3FreeFMUState(it, state) }, OK);
        }
    }
}

#[test]
fn a_tick_beside_its_grid_is_a_warning() {
    for (t, warns) in [(0.2, false), (0.2 + 1e-7, false), (0.2 + 4e-6, true), (0.19, true)] {
        let host = Host::started(Kind::Cs);
        unsafe { assert_eq!(fmi3SetDebugLogging(host.it.get(), Fmi3Boolean(1), 0, null()), OK) };
        assert_eq!((host.set_clock(FIXED, true), host.update()), (OK, OK));
        host.proceed(0.0, t);
        assert_eq!((host.set_clock(FIXED, true), host.update()), (OK, OK));
        let errors = host.errors();
        let heard = errors.iter().any(|text| text.contains("fixed ticks"));
        assert_eq!(heard, warns, "{t}: {errors:?}");
    }
}

/// Clocks need event mode; updates of clocks need their callback.
#[test]
fn instances_that_cannot_be() {
    let host = Host::open(Kind::Cs);
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    let (name, token, no) = (c"kinds".as_ptr(), token.as_ptr(), Fmi3Boolean(0));
    let (environment, log) = (Rc::as_ptr(&host).cast_mut().cast(), Some(log3 as Fmi3Logger));
    unsafe {
        let it = fmi3InstantiateCoSimulation(name, token, null(), no, no, no, no, null(), 0, environment, log, None);
        assert!(it.is_null() && host.errors()[0].contains("eventModeUsed = false is not allowed"));
        let it = fmi3InstantiateScheduledExecution(name, token, null(), no, no, environment, log, None, None, None);
        assert!(it.is_null() && host.errors()[0].contains("clockUpdate is NULL"));
    }
}
