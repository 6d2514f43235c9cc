//! Arguments of the functions of clocks that are NULL, and the number of allocations of these functions.

use super::counting::{calls, neighbor};
use super::*;

type Call = fn(InstancePointer) -> c_int;

/// The state, as in [`Host::in_state`], with a call for each pointer of a function that is NULL there.
const NULLS: &[(char, &str, &[Call])] = &[
    (
        'v',
        "SetClock",
        &[
            |it| unsafe { fmi3SetClock(it, null(), 1, &Fmi3Boolean(1)) },
            |it| unsafe { fmi3SetClock(it, &FIXED, 1, null()) },
        ],
    ),
    (
        'v',
        "GetClock",
        &[
            |it| unsafe { fmi3GetClock(it, null(), 1, &mut Fmi3Boolean(9)) },
            |it| unsafe { fmi3GetClock(it, &FIXED, 1, null_mut()) },
        ],
    ),
    (
        'n',
        "GetIntervalDecimal",
        &[
            |it| unsafe { fmi3GetIntervalDecimal(it, null(), 1, &mut 0.0, &mut 0) },
            |it| unsafe { fmi3GetIntervalDecimal(it, &FIXED, 1, null_mut(), &mut 0) },
            |it| unsafe { fmi3GetIntervalDecimal(it, &FIXED, 1, &mut 0.0, null_mut()) },
        ],
    ),
    (
        'n',
        "GetIntervalFraction",
        &[
            |it| unsafe { fmi3GetIntervalFraction(it, null(), 1, &mut 0, &mut 0, &mut 0) },
            |it| unsafe { fmi3GetIntervalFraction(it, &FRACTION, 1, null_mut(), &mut 0, &mut 0) },
            |it| unsafe { fmi3GetIntervalFraction(it, &FRACTION, 1, &mut 0, null_mut(), &mut 0) },
            |it| unsafe { fmi3GetIntervalFraction(it, &FRACTION, 1, &mut 0, &mut 0, null_mut()) },
        ],
    ),
    (
        'n',
        "SetIntervalDecimal",
        &[
            |it| unsafe { fmi3SetIntervalDecimal(it, null(), 1, &0.4) },
            |it| unsafe { fmi3SetIntervalDecimal(it, &FIXED, 1, null()) },
        ],
    ),
    ('n', "SetIntervalFraction", &[|it| unsafe { fmi3SetIntervalFraction(it, null(), 1, &1, &3) }]),
    (
        'n',
        "GetShiftDecimal",
        &[
            |it| unsafe { fmi3GetShiftDecimal(it, null(), 1, &mut 0.0) },
            |it| unsafe { fmi3GetShiftDecimal(it, &FIXED, 1, null_mut()) },
        ],
    ),
    (
        'n',
        "GetShiftFraction",
        &[
            |it| unsafe { fmi3GetShiftFraction(it, null(), 1, &mut 0, &mut 0) },
            |it| unsafe { fmi3GetShiftFraction(it, &FRACTION, 1, null_mut(), &mut 0) },
            |it| unsafe { fmi3GetShiftFraction(it, &FRACTION, 1, &mut 0, null_mut()) },
        ],
    ),
    (
        'n',
        "SetShiftDecimal",
        &[
            |it| unsafe { fmi3SetShiftDecimal(it, null(), 1, &0.01) },
            |it| unsafe { fmi3SetShiftDecimal(it, &FIXED, 1, null()) },
        ],
    ),
    ('n', "SetShiftFraction", &[|it| unsafe { fmi3SetShiftFraction(it, null(), 1, &1, &3) }]),
];

#[test]
fn a_null_pointer_is_an_error_of_its_instance_alone() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        let other = Host::started(kind);
        for (state, name, calls) in NULLS {
            let state = match (kind, state) {
                (Kind::Se, 'v') => 'a',
                (_, state) => *state,
            };
            for (which, call) in calls.iter().enumerate() {
                if (kind, *name) == (Kind::Se, "SetClock") {
                    continue;
                }
                let host = Host::in_state(kind, state);
                assert_eq!(call(host.it.get()), ERROR, "{name}, pointer {which}, {kind:?}");
                let errors = host.errors();
                assert!(errors.len() == 1 && errors[0].contains(name) && errors[0].contains(" is NULL"), "{errors:?}");
                assert_eq!((host.ticks(), unsafe { fmi3Reset(host.it.get()) }), (0, OK));
            }
        }
        // Unused arguments need no pointer.
        let it = Host::in_state(kind, 'n');
        assert_eq!(unsafe { fmi3GetIntervalDecimal(it.it.get(), null(), 0, null_mut(), null_mut()) }, OK);
        assert_eq!(unsafe { fmi3SetIntervalDecimal(it.it.get(), null(), 0, null()) }, OK);
        assert_eq!((other.clock(FIXED), other.ticks()), (Some(false), 0));
    }
}

/// Allocations of 20 calls of `work`, which has run before.
fn allocations(mut work: impl FnMut(f64)) -> u64 {
    work(0.0);
    let before = calls();
    for k in 1..20 {
        work(f64::from(k) * 0.2);
    }
    calls() - before
}

#[test]
fn ticks_do_not_allocate() {
    let _neighbor = neighbor();
    for kind in [Kind::Cs, Kind::Me] {
        let host = Host::started(kind);
        let tick = |t: f64| {
            let (yes, pair, none) = ([Fmi3Boolean(1); 2], [FIXED, TRIGGERED], [Fmi3Boolean(0); 2]);
            let it = host.it.get();
            assert_eq!(unsafe { fmi3SetClock(it, pair.as_ptr(), 2, yes.as_ptr()) }, OK);
            let trips = host.clock(TRIP);
            assert_eq!((host.set_clock(CHANGING, true), host.set(U, t), trips.is_some()), (OK, OK, true));
            assert!(host.get(Y).is_some() && host.ticks() >= 0);
            assert_eq!((host.update(), host.clock(TRIP)), (OK, Some(false)));
            assert!(host.interval(CHANGING).is_some());
            assert!(host.interval(COUNTDOWN).is_some_and(|(x, qualifier)| (x - 0.25).abs() < 1e-12 && qualifier == 2));
            assert_eq!(unsafe { fmi3SetClock(it, pair.as_ptr(), 2, none.as_ptr()) }, OK);
            assert_eq!((host.set_interval(TUNABLE, 0.5), host.interval(TUNABLE).is_some()), (OK, true));
            host.proceed(t, (t / 0.2).round() * 0.2 + 0.2);
        };
        assert_eq!(allocations(tick), 0, "{kind:?}");
        assert_eq!(host.ticks(), 60);
        // The counter counts.
        assert!(allocations(|_| assert_eq!(host.set_clock(TRIP, true), ERROR)) > 0);
    }
    let host = Host::started(Kind::Se);
    *host.act.borrow_mut() = Some(Box::new(|host| {
        assert!(host.clock(TRIP).is_some() && host.interval(COUNTDOWN).is_some());
    }));
    let tick = |t: f64| {
        assert_eq!((host.set(U, t), host.activate(FIXED, t), host.activate(TRIGGERED, t)), (OK, OK, OK));
        assert_eq!((host.activate(CHANGING, t), host.interval(CHANGING).is_some()), (OK, true));
        assert!(host.get(Y).is_some() && host.clock(TRIP) == Some(false));
    };
    assert_eq!(allocations(tick), 0, "Scheduled Execution");
    assert_eq!((host.ticks(), host.updates.get()), (60, 20));
}
