//! Calls and variables by state and clock.

use super::*;

/// A call and, for the clocks in their order, the states that allow it: i n v s in Co-Simulation and Model Exchange, i n a in
/// Scheduled Execution, t and e allow no call.
type Cell3 = (&'static str, [&'static str; 8], fn(&Host, u32) -> bool);

/// FMI 3.0.2, 2.2.8.4 and 2.3: no clock has ticked.
const CELLS: &[Cell3] = &[
    ("SetClock", ["v", "v", "v", "v", "v", "v", "v", ""], |h, vr| h.set_clock(vr, true) == OK),
    ("GetClock", ["va", "va", "va", "va", "va", "va", "va", "va"], |h, vr| h.clock(vr).is_some()),
    ("GetInterval", ["n", "n", "n", "nva", "n", "nv", "", ""], |h, vr| h.interval(vr).is_some()),
    ("SetInterval", ["", "", "n", "nva", "", "", "", ""], |h, vr| h.set_interval(vr, 0.4) == OK),
    ("GetIntervalFraction", ["", "n", "", "", "", "", "", ""], |h, vr| {
        let (mut counter, mut resolution, mut qualifier) = (0, 0, 0);
        let it = h.it.get();
        let done = unsafe { fmi3GetIntervalFraction(it, &vr, 1, &mut counter, &mut resolution, &mut qualifier) } == OK;
        assert!(!done || (counter, resolution, qualifier) == (1, 3, 2));
        done
    }),
    ("SetIntervalFraction", ["", "", "", "", "", "", "", ""], |h, vr| unsafe {
        fmi3SetIntervalFraction(h.it.get(), &vr, 1, &1, &3) == OK
    }),
    ("GetShift", ["n", "n", "n", "n", "", "", "", ""], |h, vr| {
        let mut shift = f64::NAN;
        let done = unsafe { fmi3GetShiftDecimal(h.it.get(), &vr, 1, &mut shift) } == OK;
        assert!(!done || shift == [0.05, 1.0, 0.0, 0.0][vr as usize - 1]);
        done
    }),
    ("GetShiftFraction", ["", "n", "", "", "", "", "", ""], |h, vr| {
        let (mut counter, mut resolution) = (0, 0);
        let done = unsafe { fmi3GetShiftFraction(h.it.get(), &vr, 1, &mut counter, &mut resolution) } == OK;
        assert!(!done || (counter, resolution) == (3, 3));
        done
    }),
    ("SetShift", ["", "", "n", "n", "", "", "", ""], |h, vr| unsafe {
        fmi3SetShiftDecimal(h.it.get(), &vr, 1, &0.01) == OK
    }),
    ("SetShiftFraction", ["", "", "", "", "", "", "", ""], |h, vr| unsafe {
        fmi3SetShiftFraction(h.it.get(), &vr, 1, &1, &3) == OK
    }),
    ("ActivateModelPartition", ["a", "a", "a", "a", "a", "a", "a", ""], |h, vr| h.activate(vr, 0.0) == OK),
    // No clock: a variable, and no reference of the model.
    ("SetClock", ["", "", "", "", "", "", "", ""], |h, vr| h.set_clock(vr + 8, true) == OK),
    ("GetInterval", ["", "", "", "", "", "", "", ""], |h, vr| h.interval(vr + 200).is_some()),
];

#[test]
fn every_call_in_every_state_of_every_clock() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        let states = if kind == Kind::Se { "inate" } else { "invste" };
        for (name, allowed, call) in CELLS {
            for (vr, allowed) in CLOCKS.into_iter().zip(allowed) {
                for state in states.chars() {
                    let host = Host::in_state(kind, state);
                    let place = format!("{name} of {vr} in {state}, {kind:?}");
                    assert_eq!(call(&host, vr), allowed.contains(state), "{place}: {:?}", host.errors());
                    let errors = host.errors();
                    assert_eq!(errors.len(), usize::from(!allowed.contains(state)), "{place}: {errors:?}");
                }
            }
        }
    }
}

/// Clocked variables can be used while their clock is active in Event Mode; before the start, and in Scheduled Execution,
/// always.
#[test]
fn variables_on_clocks() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        let states = if kind == Kind::Se { "ina" } else { "invs" };
        for state in states.chars() {
            let open = "ina".contains(state);
            let place = format!("{state}, {kind:?}");
            assert_eq!(Host::in_state(kind, state).set(U, 1.0) == OK, open, "{place}");
            assert_eq!(Host::in_state(kind, state).get(U).is_some(), open, "{place}");
            assert_eq!(Host::in_state(kind, state).get(Y).is_some(), open, "{place}");
            // Without a clock.
            assert_eq!(Host::in_state(kind, state).set(X, 1.0), OK, "{place}");
            assert!(Host::in_state(kind, state).get(FREE).is_some(), "{place}");
            assert_eq!(Host::in_state(kind, state).ticks(), 0);
        }
    }
    for kind in [Kind::Cs, Kind::Me] {
        let host = Host::started(kind);
        assert_eq!(host.set_clock(TRIGGERED, true), OK);
        assert_eq!((host.set(U, 1.0), host.get(U)), (OK, Some(1.0)), "u is on two clocks");
        assert_eq!(host.get(Y), None, "y is on the other one");
        assert!(host.errors()[0].contains("y can be read in Event Mode while fixed is active"));
        let host = Host::started(kind);
        assert_eq!((host.set_clock(FIXED, true), host.set(U, 1.0), host.update()), (OK, OK, OK));
        assert_eq!(host.get(Y), None, "the update ends the tick");
    }
}
