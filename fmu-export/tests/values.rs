//! Getting and setting: times at which values may be set, ranges, types, arrays, atomicity, and the texts of errors.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod common;

use common::model::*;
use common::*;
use fmu_export::abi::types::*;
use std::ptr::{null, null_mut};

/// Sets one real variable in a fresh instance in `state`; the message if it was refused.
fn refusal(version: u8, state: char, vr: u32, value: f64) -> String {
    let fmu = Fmu::in_state(version, state);
    assert_eq!(fmu.set(&[vr], &[value]), ERROR, "{vr} = {value}");
    assert_eq!(fmu.state(), 'e');
    let fmu = Fmu::in_state(version, state);
    let _ = fmu.set(&[vr], &[value]);
    fmu.error()
}

#[test]
fn messages_name_variable_value_and_range() {
    let set = |vr, value| refusal(2, 'n', vr, value);
    assert_eq!(set(R, -1.0), "fmi2SetReal: motor.R = -1 is not allowed: greater than 0");
    assert_eq!(set(R, 0.0), "fmi2SetReal: motor.R = 0 is not allowed: greater than 0");
    assert_eq!(set(K, 5.5), "fmi2SetReal: k = 5.5 is not allowed: at least -5 and at most 5");
    assert_eq!(set(U, f64::NAN), "fmi2SetReal: u = NaN is not allowed: any finite number");
    assert_eq!(set(MAP + 2, -2.0), "fmi2SetReal: map[3] = -2 is not allowed: at least -1");
    assert_eq!(set(X, 1.0), "fmi2SetReal: x is an output and cannot be set");
    assert_eq!(set(DOUBLE_GAIN, 1.0), "fmi2SetReal: double_gain is a calculated parameter and cannot be set");
    assert_eq!(set(UNKNOWN, 1.0), "fmi2SetReal: value reference 16 does not exist; 1 to 15 do");
    assert_eq!(set(u32::MAX, 1.0), "fmi2SetReal: value reference 4294967295 does not exist; 1 to 15 do");
    assert!(refusal(3, 'n', TIME, 1.0).starts_with("fmi3SetFloat64: time "));
    assert_eq!(set(N, 1.0), "fmi2SetReal: n is an integer, and this function takes a real number");
    let late = refusal(3, 's', R, 1.0);
    assert!(late.contains("motor.R is a fixed parameter") && late.contains("Step Mode"), "{late}");
}

/// Archives of FMI 2.0 have no variable for time: value reference 0 is as unknown as any other.
#[test]
fn time_is_a_variable_of_fmi3_alone() {
    let unknown = "value reference 0 does not exist; 1 to 15 do";
    assert_eq!(refusal(2, 'n', TIME, 1.0), format!("fmi2SetReal: {unknown}"));
    let fmu = Fmu::started(2);
    assert_eq!(fmu.try_get(&[TIME], &mut [0.0]), ERROR);
    assert_eq!(fmu.error(), format!("fmi2GetReal: {unknown}"));
    let fmu = Fmu::started(2);
    assert_eq!(unsafe { fmi2GetInteger(fmu.it, &TIME, 1, &mut Fmi2Integer(0)) }, ERROR);
    assert_eq!(fmu.error(), format!("fmi2GetInteger: {unknown}"));
    assert_eq!(Fmu::started(3).get(TIME), 0.0);
}

#[test]
fn infinite_values_are_refused_everywhere() {
    for version in [2, 3] {
        for state in ['i', 'n', 's'] {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert!(refusal(version, state, U, value).contains("any finite number"));
            }
        }
    }
}

#[test]
fn integers_enumerations_and_truth_values() {
    for version in [2, 3] {
        let fmu = Fmu::new(version);
        assert_eq!(fmu.set_integer(N, 0), ERROR);
        assert!(fmu.error().ends_with("n = 0 is not allowed: at least 1"));
        let fmu = Fmu::new(version);
        assert_eq!(fmu.set_mode(3), ERROR);
        assert!(fmu.error().ends_with("mode = 3 is not allowed: 1 (Plain), 2 (Faulty), 4 (Panicky)"));
        let fmu = Fmu::entered(version);
        assert_eq!((fmu.set_integer(N, 7), fmu.set_mode(4)), (OK, OK));
        let (mut n, mut mode) = (0, 0);
        unsafe {
            if version == 2 {
                let mut both = [Fmi2Integer(0); 2];
                assert_eq!(fmi2GetInteger(fmu.it, [N, MODE].as_ptr(), 2, both.as_mut_ptr()), OK);
                (n, mode) = (both[0].0, both[1].0.into());
            } else {
                assert_eq!(fmi3GetInt32(fmu.it, &N, 1, &mut n, 1), OK);
                assert_eq!(fmi3GetInt64(fmu.it, &MODE, 1, &mut mode, 1), OK);
            }
        }
        assert_eq!((n, mode), (7, 4));
    }
}

#[test]
fn any_byte_is_a_truth_value() {
    for (raw, expected) in [(0, 0), (1, 1), (2, 1), (255, 1)] {
        let fmu = Fmu::new(3);
        let mut value = Fmi3Boolean(9);
        unsafe {
            assert_eq!(fmi3SetBoolean(fmu.it, &FLAG, 1, &Fmi3Boolean(raw), 1), OK);
            assert_eq!(fmi3GetBoolean(fmu.it, &FLAG, 1, &mut value, 1), OK);
        }
        assert_eq!(value.0, expected);
    }
    for (raw, expected) in [(0, 0), (-1, 1), (256, 1)] {
        let fmu = Fmu::entered(2);
        let mut value = Fmi2Boolean(9);
        unsafe {
            assert_eq!(fmi2SetBoolean(fmu.it, &FLAG, 1, &Fmi2Boolean(raw)), OK);
            assert_eq!(fmi2GetBoolean(fmu.it, &FLAG, 1, &mut value), OK);
        }
        assert_eq!(value.0, expected);
    }
    // A fixed parameter that keeps its value in Step Mode.
    for raw in [1, 2, 255] {
        let fmu = Fmu::entered(2);
        assert_eq!(unsafe { fmi2SetBoolean(fmu.it, &FLAG, 1, &Fmi2Boolean(1)) }, OK);
        assert_eq!(fmu.exit(), OK);
        assert_eq!(unsafe { fmi2SetBoolean(fmu.it, &FLAG, 1, &Fmi2Boolean(raw)) }, OK, "{raw}");
        assert_eq!(unsafe { fmi2SetBoolean(fmu.it, &FLAG, 1, &Fmi2Boolean(0)) }, ERROR);
        let fmu = Fmu::entered(3);
        let set = |raw| unsafe { fmi3SetBoolean(fmu.it, &FLAG, 1, &Fmi3Boolean(raw), 1) };
        assert_eq!((set(1), fmu.exit()), (OK, OK));
        assert_eq!((set(u8::try_from(raw).unwrap()), set(0)), (OK, ERROR), "{raw}");
    }
}

#[test]
fn types_do_not_mix() {
    let fmu = || Fmu::entered(3);
    unsafe {
        assert_eq!(fmi3GetInt32(fmu().it, &MODE, 1, &mut 0, 1), ERROR);
        assert_eq!(fmi3GetInt64(fmu().it, &N, 1, &mut 0, 1), ERROR);
        assert_eq!(fmi3SetInt64(fmu().it, &N, 1, &1, 1), ERROR);
        assert_eq!(fmi3SetInt32(fmu().it, &MODE, 1, &1, 1), ERROR);
        assert_eq!(fmi3SetInt64(fmu().it, &MODE, 1, &(1 << 32), 1), ERROR);
        assert_eq!(fmi3GetFloat64(fmu().it, &FLAG, 1, &mut 0.0, 1), ERROR);
        assert_eq!(fmi3GetInt32(fmu().it, &TIME, 1, &mut 0, 1), ERROR);
        assert_eq!(fmi3SetBoolean(fmu().it, &U, 1, &Fmi3Boolean(0), 1), ERROR);
        let fmu = fmu();
        assert_eq!(fmi3GetFloat32(fmu.it, &X, 1, &mut 0.0, 1), ERROR);
        assert_eq!(fmu.error(), "fmi3GetFloat32: x is a real number, and this function takes a Float32");
    }
}

/// As many values as scalars.
#[test]
fn scalars_have_one_value_each() {
    for (vr, values) in [(&[U][..], &[4.0, 5.0][..]), (&[U, K], &[4.0]), (&[U], &[]), (&[], &[4.0])] {
        let fmu = Fmu::entered(3);
        assert_eq!(fmu.set(vr, values), ERROR, "{vr:?} {values:?}");
        let expected = format!("nValues = {} is not allowed: {} for these value references", values.len(), vr.len());
        assert!(fmu.error().ends_with(&expected), "{}", fmu.error());
        assert_eq!([fmu.get(U), fmu.get(K)], [1.0, 0.0]);
    }
}

#[test]
fn a_vector_is_set_whole_or_not_at_all() {
    for version in [2, 3] {
        for state in ['i', 'n', 's'] {
            for bad in [(X, 0.0), (K, 6.0), (GAIN, -1.0), (UNKNOWN, 0.0), (U, f64::NAN)] {
                let fmu = Fmu::in_state(version, state);
                assert_eq!(fmu.set(&[U, K, GAIN, bad.0], &[4.0, 4.0, 4.0, bad.1]), ERROR);
                assert_eq!([fmu.get(U), fmu.get(K), fmu.get(GAIN)], [1.0, 0.0, 1.0], "{version} {state} {bad:?}");
            }
        }
    }
}

#[test]
fn a_long_vector_is_set_whole_or_not_at_all() {
    for version in [2, 3] {
        for length in 1..20_u32 {
            // The second variable comes late, outside the buffer of a short vector.
            let vr: Vec<u32> = (0..length).map(|i| if i < 9 { U } else { K }).collect();
            let good: Vec<f64> = (0..length).map(|i| 2.0 - 0.1 * f64::from(i)).collect();
            for bad in 0..length as usize {
                let mut values = good.clone();
                values[bad] = f64::NAN;
                let fmu = Fmu::started(version);
                assert_eq!(fmu.set(&vr, &values), ERROR);
                assert_eq!((fmu.get(U), fmu.get(K)), (1.0, 0.0), "{length} {bad}");
                assert!(fmu.error().contains(" = NaN is not allowed"));
            }
            let fmu = Fmu::started(version);
            assert_eq!((fmu.set(&vr, &good), fmu.get(vr[vr.len() - 1])), (OK, good[good.len() - 1]));
        }
    }
}

#[test]
fn the_last_of_two_sets_wins_and_both_gets_are_filled() {
    let fmu = Fmu::started(2);
    assert_eq!(fmu.set(&[U, K, U], &[4.0, 3.0, -0.0]), OK);
    let mut values = [9.0; 3];
    assert_eq!(fmu.try_get(&[U, U, K], &mut values), OK);
    assert_eq!(values.map(f64::to_bits), [(-0.0_f64).to_bits(), (-0.0_f64).to_bits(), 3.0_f64.to_bits()]);
}

#[test]
fn arrays_are_one_variable_in_fmi3_and_scalars_in_fmi2() {
    let fmu = Fmu::entered(3);
    assert_eq!(fmu.set(&[U, MAP, GAIN], &[5.0, 0.1, 0.2, 0.3, 6.0]), OK);
    let mut values = [0.0; 5];
    assert_eq!(fmu.try_get(&[GAIN, MAP, U], &mut values), OK);
    assert_eq!(values, [6.0, 0.1, 0.2, 0.3, 5.0]);
    for count in [0, 1, 2, 4, 5] {
        let fmu = Fmu::entered(3);
        assert_eq!(fmu.set(&[MAP], &vec![9.0; count]), ERROR);
        assert_eq!(
            fmu.error(),
            format!("fmi3SetFloat64: nValues = {count} is not allowed: 3 for these value references")
        );
        let mut canary = vec![7.0; count];
        assert_eq!(fmu.try_get(&[MAP], &mut canary), ERROR);
        assert_eq!(canary, vec![7.0; count]);
        let mut values = [0.0; 3];
        assert_eq!(fmu.try_get(&[MAP], &mut values), OK);
        assert_eq!(values, [0.0, 1.0, 2.0]);
    }
    let fmu = Fmu::entered(3);
    assert_eq!(fmu.set(&[MAP + 1], &[0.5]), ERROR);
    assert!(fmu.error().contains("map[2] belongs to the array with reference 8"));

    let fmu = Fmu::entered(2);
    assert_eq!(fmu.set(&[MAP + 1, MAP + 2], &[0.5, 0.6]), OK);
    assert_eq!([fmu.get(MAP), fmu.get(MAP + 1), fmu.get(MAP + 2)], [0.0, 0.5, 0.6]);
}

#[test]
fn initialization_can_be_iterated_in_any_order() {
    for version in [2, 3] {
        let fmu = Fmu::entered(version);
        assert_eq!(fmu.get(X), 0.5);
        assert_eq!(fmu.set(&[R, U], &[4.0, 8.0]), OK);
        assert_eq!((fmu.get(X), fmu.get(DOUBLE_GAIN)), (2.0, 2.0));
        // A single input set after a get also has an effect.
        assert_eq!((fmu.set(&[U], &[4.0]), fmu.get(X)), (OK, 1.0));
        assert_eq!((fmu.set(&[U], &[8.0]), fmu.get(X)), (OK, 2.0));
        assert_eq!(fmu.set(&[GAIN], &[3.0]), OK);
        assert_eq!(fmu.set_integer(N, 2), OK);
        assert_eq!((fmu.get(X), fmu.get(DOUBLE_GAIN)), (4.0, 6.0));
        // Set before Initialization Mode, in another order, never read: the same.
        let other = Fmu::new(version);
        assert_eq!((other.set_integer(N, 2), other.set(&[GAIN, U, R], &[3.0, 8.0, 4.0])), (OK, OK));
        assert_eq!((other.enter(0.0, None), other.exit(), fmu.exit()), (OK, OK, OK));
        assert_eq!((other.get(X), other.get(DOUBLE_GAIN)), (4.0, 6.0));
        assert_eq!(fmu.bytes(), other.bytes());
    }
}

#[test]
fn start_values_can_be_read_at_once_in_fmi3() {
    let fmu = Fmu::new(3);
    assert_eq!((fmu.get(X), fmu.get(R), fmu.get(TIME)), (0.5, 2.0, 0.0));
    assert_eq!(fmu.set(&[R], &[1.0]), OK);
    assert_eq!(fmu.get(X), 1.0);
}

#[test]
fn in_step_mode_a_get_shows_the_last_step() {
    for version in [2, 3] {
        let fmu = Fmu::started(version);
        let x = fmu.get(X);
        assert_eq!(fmu.set(&[U, GAIN], &[3.0, 2.0]), OK);
        assert_eq!((fmu.get(U), fmu.get(GAIN), fmu.get(X), fmu.get(DOUBLE_GAIN)), (3.0, 2.0, x, 2.0));
        assert_eq!(fmu.step(0.0, 0.1), OK);
        // The tunable parameter reaches the calculated one with the next step: x' = 4*3/2 - 0.1 x + map[2].
        assert_eq!(fmu.get(DOUBLE_GAIN), 4.0);
        assert!((fmu.get(X) - (x + 0.1 * (6.0 - 0.05 + 1.0) + 1e-4)).abs() < 1e-12);
    }
}

#[test]
fn parameters_are_judged_together_on_leaving_initialization() {
    for version in [2, 3] {
        let fmu = Fmu::entered(version);
        let set = if version == 2 { fmu.set(&[MAP], &[3.0]) } else { fmu.set(&[MAP], &[3.0, 1.0, 2.0]) };
        assert!(set == OK && fmu.get(X).is_nan());
        // The message gives the model's reason, not the NaN that follows from it.
        assert_eq!(fmu.exit(), ERROR);
        assert!(fmu.error().ends_with("ExitInitializationMode: map[1] is greater than map[3]"));
        assert_eq!(fmu.state(), 'e');
    }
}

#[test]
fn values_can_be_read_after_the_end_and_after_an_error() {
    for version in [2, 3] {
        let fmu = Fmu::started(version);
        assert_eq!(fmu.step(0.0, 0.5), OK);
        let x = fmu.get(X);
        assert_eq!(fmu.terminate(), OK);
        assert_eq!((fmu.get(X), fmu.time()), (x, 0.5));
        assert_eq!(fmu.terminate(), ERROR);
        assert_eq!(fmu.get(X), x);
        assert!(version == 2 || fmu.get(TIME) == 0.5);
    }
}

#[test]
fn null_pointers_and_no_variables() {
    let (one, mut value) = (U, 0.0);
    unsafe {
        for (vr, values) in [(null(), null_mut()), (&raw const one, null_mut()), (null(), &raw mut value)] {
            let fmu = Fmu::started(2);
            assert_eq!(fmi2GetReal(fmu.it, vr, 0, values), OK);
            assert_eq!(fmi2SetReal(fmu.it, vr, 0, values), OK);
            assert_eq!(fmi2GetReal(fmu.it, vr, 1, values), ERROR);
            assert!(fmu.error().contains("NULL"));
            let fmu = Fmu::started(3);
            assert_eq!(fmi3SetFloat64(fmu.it, vr, 0, values, 0), OK);
            assert_eq!(fmi3SetFloat64(fmu.it, vr, 1, values, 1), ERROR);
            assert!(fmu.error().contains("NULL"));
        }
        let fmu = Fmu::started(3);
        assert_eq!(fmi3GetFloat64(fmu.it, null(), 0, &mut 0.0, 1), ERROR);
        let fmu = Fmu::started(3);
        assert_eq!(fmi3GetFloat32(fmu.it, null(), 0, &mut 0.0, 1), ERROR);
        let fmu = Fmu::started(2);
        assert_eq!(fmi2GetReal(fmu.it, &X, usize::MAX / 4, &mut 0.0), ERROR);
    }
}
