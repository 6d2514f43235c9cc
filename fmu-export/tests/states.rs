//! FMU states: exact continuation, other instances, wrong handles, wrong bytes.
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
use std::ptr::{null_mut, without_provenance_mut};

/// Steps from `from` to `to` with inputs and a tunable parameter that change, and returns the outputs' bits.
fn run(fmu: &Fmu, from: u32, to: u32) -> Vec<u64> {
    let mut bits = Vec::new();
    for k in from..to {
        let t = f64::from(k) * 0.01;
        assert_eq!(fmu.set(&[U, K, GAIN], &[t.sin(), 2.0 * t.cos(), 1.0 + 0.5 * t]), OK);
        assert_eq!(fmu.step(t, 0.01), OK);
        bits.extend([fmu.get(X), fmu.get(DOUBLE_GAIN), fmu.get(GAIN), fmu.time()].map(f64::to_bits));
    }
    bits
}

#[test]
fn a_restored_state_continues_bit_for_bit() {
    for version in [2, 3] {
        for k in [0, 1, 17, 60] {
            let fmu = Fmu::started(version);
            run(&fmu, 0, k);
            let mut state = null_mut();
            assert_eq!(fmu.save(&mut state), OK);
            let bytes = fmu.bytes();
            let first = run(&fmu, k, 100);
            // Back, several times; also from bytes; also in another instance, of either standard.
            for _ in 0..2 {
                assert_eq!(fmu.restore(state), OK);
                assert_eq!(run(&fmu, k, 100), first);
            }
            for other in [Fmu::new(version), Fmu::in_state(5 - version, 'e')] {
                assert_eq!(other.restore(state), OK);
                assert_eq!(run(&other, k, 100), first);
                let mut again = null_mut();
                assert_eq!(other.deserialize(&bytes, &mut again), OK);
                assert_ne!(again, state);
                assert_eq!(other.restore(again), OK);
                assert_eq!(run(&other, k, 100), first);
                assert_eq!(other.free_state(&mut again), OK);
            }
            assert_eq!(fmu.free_state(&mut state), OK);
            assert!(state.is_null());
        }
    }
}

#[test]
fn a_state_holds_parameters_that_no_step_has_seen() {
    let fmu = Fmu::started(3);
    assert_eq!(fmu.set(&[GAIN], &[4.0]), OK);
    let mut state = null_mut();
    assert_eq!(fmu.save(&mut state), OK);
    assert_eq!((fmu.set(&[GAIN], &[9.0]), fmu.step(0.0, 0.1)), (OK, OK));
    assert_eq!(fmu.restore(state), OK);
    assert_eq!((fmu.get(GAIN), fmu.step(0.0, 0.1), fmu.get(DOUBLE_GAIN)), (4.0, OK, 8.0));
    assert_eq!(fmu.free_state(&mut state), OK);
}

#[test]
fn a_state_brings_its_place_in_the_lifecycle() {
    for version in [2, 3] {
        for state in "inst".chars() {
            let mut saved = null_mut();
            let fmu = Fmu::in_state(version, state);
            assert_eq!(fmu.save(&mut saved), OK);
            for other in "inste".chars() {
                let other = Fmu::in_state(version, other);
                assert_eq!(other.restore(saved), OK);
                assert_eq!(other.state(), state);
            }
            assert_eq!(fmu.free_state(&mut saved), OK);
        }
    }
}

#[test]
fn a_handle_is_reused_and_nothing_needs_freeing() {
    let fmu = Fmu::started(2);
    let mut state = null_mut();
    assert_eq!(fmu.save(&mut state), OK);
    let handle = state;
    run(&fmu, 0, 3);
    assert_eq!((fmu.save(&mut state), state), (OK, handle));
    let expected = run(&fmu, 3, 9);
    assert_eq!((fmu.restore(state), run(&fmu, 3, 9)), (OK, expected));
    assert_eq!(fmu.free_state(&mut state), OK);
    assert_eq!(fmu.free_state(&mut state), OK, "NULL");
    assert_eq!(unsafe { fmi2FreeFMUstate(fmu.it, null_mut()) }, OK);
    assert_eq!(unsafe { fmi3FreeFMUState(Fmu::new(3).it, null_mut()) }, OK);
}

#[test]
fn wrong_handles_are_errors() {
    for version in [2, 3] {
        let maker = Fmu::started(version);
        let mut freed = null_mut();
        assert_eq!(maker.save(&mut freed), OK);
        let old = freed;
        assert_eq!(maker.free_state(&mut freed), OK);
        let mut elsewhere = 5_u64;
        let foreign = (&raw mut elsewhere).cast();
        for wrong in [old, foreign, maker.it, without_provenance_mut(1), without_provenance_mut(usize::MAX)] {
            let calls: [&dyn Fn(&Fmu) -> c_int; 5] = [
                &|fmu| fmu.restore(wrong),
                &|fmu| fmu.save(&mut { wrong }),
                &|fmu| fmu.free_state(&mut { wrong }),
                &|fmu| fmu.serialize(wrong, &mut [0; 500]),
                &|fmu| unsafe {
                    let mut size = 0;
                    if version == 2 {
                        fmi2SerializedFMUstateSize(fmu.it, wrong, &mut size)
                    } else {
                        fmi3SerializedFMUStateSize(fmu.it, wrong, &mut size)
                    }
                },
            ];
            for call in calls {
                let fmu = Fmu::started(version);
                assert_eq!(call(&fmu), ERROR);
                assert!(fmu.error().contains("is not one that this FMU gave, or it was freed"));
            }
        }
        let fmu = Fmu::started(version);
        assert_eq!(fmu.restore(null_mut()), ERROR);
        assert!(fmu.error().contains("the FMU state is NULL"));
        assert_eq!(elsewhere, 5);
    }
}

#[test]
fn an_error_cannot_be_saved_and_leaves_saved_states_alone() {
    let fmu = Fmu::started(2);
    let mut state = null_mut();
    assert_eq!((fmu.save(&mut state), fmu.step(0.0, -1.0)), (OK, ERROR));
    let handle = state;
    assert_eq!((fmu.save(&mut state), state), (ERROR, handle));
    assert_eq!((fmu.restore(state), fmu.step(0.0, 0.1)), (OK, OK));
    assert_eq!(fmu.free_state(&mut state), OK);
}

#[test]
fn bytes_have_one_size_and_are_the_same_in_every_instance() {
    let fresh = Fmu::new(2).bytes();
    for version in [2, 3] {
        let (a, b) = (Fmu::started(version), Fmu::started(version));
        let (x, y) = (run(&a, 0, 300), run(&b, 0, 300));
        assert_eq!((x, a.bytes()), (y, b.bytes()));
        assert_eq!(a.bytes().len(), fresh.len());
        assert_ne!(a.bytes(), fresh);
    }
}

#[test]
fn every_changed_byte_and_every_other_length_is_noticed() {
    let fmu = Fmu::started(3);
    run(&fmu, 0, 5);
    let bytes = fmu.bytes();
    let refused = |bytes: &[u8], what: &str| {
        let mut state = null_mut();
        assert_eq!(fmu.deserialize(bytes, &mut state), ERROR, "{what}");
        assert!(state.is_null());
        assert!(fmu.error().contains("are not a state of this FMU: "), "{what}");
    };
    for i in 0..bytes.len() {
        for flip in [1, 0x80, 0xff] {
            let mut changed = bytes.clone();
            changed[i] ^= flip;
            refused(&changed, &format!("byte {i}"));
        }
    }
    for length in 0..bytes.len() {
        refused(&bytes[..length], &format!("length {length}"));
    }
    let mut longer = bytes.clone();
    for _ in 0..300 {
        longer.push(0);
        refused(&longer, "longer");
        let mut sealed = longer.clone();
        seal(&mut sealed);
        refused(&sealed, "longer, with a checksum that fits");
    }
    let mut state = null_mut();
    assert_eq!(fmu.deserialize(&bytes, &mut state), OK);
    assert_eq!(fmu.free_state(&mut state), OK);
}

/// The bytes of a state with a value changed behind the setters' back, and a checksum that fits.
fn forged(fmu: &Fmu, from: f64, to: f64) -> Vec<u8> {
    let mut bytes = fmu.bytes();
    let at = bytes.windows(8).position(|w| w == from.to_le_bytes()).expect("the value is in the state");
    bytes[at..at + 8].copy_from_slice(&to.to_le_bytes());
    seal(&mut bytes);
    bytes
}

/// Writes the checksum that fits.
fn seal(bytes: &mut [u8]) {
    let body = bytes.len() - 4;
    let checksum = reference_crc(&bytes[..body]);
    bytes[body..].copy_from_slice(&checksum.to_le_bytes());
}

/// CRC-32 by its definition as a polynomial division, bit by bit from the opposite end.
fn reference_crc(bytes: &[u8]) -> u32 {
    let mut remainder = 0xffff_ffff_u32;
    for byte in bytes {
        for bit in 0..8 {
            let top = (remainder >> 31) ^ u32::from((byte >> bit) & 1);
            remainder = (remainder << 1) ^ (0x04c1_1db7 * top);
        }
    }
    (!remainder).reverse_bits()
}

#[test]
fn values_that_no_importer_could_have_set_are_noticed() {
    let fmu = Fmu::started(3);
    assert_eq!(fmu.set(&[U, GAIN], &[0.123_456, 7.654_321]), OK);
    let deserialize = |bytes: &[u8]| {
        let mut state = null_mut();
        let status = fmu.deserialize(bytes, &mut state);
        if status == OK {
            assert_eq!(fmu.restore(state), OK);
            assert_eq!(fmu.free_state(&mut state), OK);
            return String::new();
        }
        fmu.error()
    };
    let forge = |from, to| deserialize(&forged(&Fmu::restored(&fmu), from, to));
    assert_eq!(forge(7.654_321, 7.5), "", "a value in range is fine, so the forgery works");
    assert_eq!(fmu.get(GAIN), 7.5);
    assert_eq!(fmu.set(&[GAIN], &[7.654_321]), OK);
    assert!(forge(7.654_321, 10.5).contains("gain = 10.5 is not allowed: at least 0 and at most 10"));
    assert!(forge(7.654_321, f64::NAN).contains("gain = NaN"));
    assert!(forge(0.123_456, f64::INFINITY).contains("u = inf"));
}

#[test]
fn a_time_that_no_simulation_came_to_is_noticed() {
    let (start, h) = (2.0, 0.123);
    let answer = |from: f64, to: f64| {
        let fmu = Fmu::new(3);
        assert_eq!((fmu.enter(start, None), fmu.exit(), fmu.step(start, h)), (OK, OK, OK));
        let mut state = null_mut();
        if fmu.deserialize(&forged(&fmu, from, to), &mut state) == OK {
            assert_eq!(fmu.free_state(&mut state), OK);
            return "taken".to_owned();
        }
        fmu.error()
    };
    assert_eq!(answer(h, h * (1.0 + 1e-9)), "taken");
    // The time since the start, and the last communication point.
    for (from, to) in
        [(h, 3.0 * h), (h, -h), (h, f64::NAN), (start + h, start + 3.0 * h), (start + h, f64::INFINITY), (start, 0.0)]
    {
        let said = answer(from, to);
        assert!(said.contains("s of simulation from"), "{from} {to}: {said}");
    }
    // Before the first step, the time is the start time.
    let fmu = Fmu::new(3);
    assert_eq!(fmu.enter(start, None), OK);
    assert_eq!(fmu.deserialize(&forged(&fmu, start, start + 1.0), &mut null_mut()), ERROR);
    assert!(fmu.error().contains("time 2 after 0 s of simulation from 3"));
}

#[test]
fn bytes_of_another_fmu_are_told_from_damaged_ones() {
    for (place, why) in [
        (0, "they lack the header of a state"),
        (8, "written by another version of this FMU"),
        (10, "written by another version of this FMU"),
        (12, "another model, or another version than"),
        (27, "another model, or another version than"),
    ] {
        let fmu = Fmu::started(2);
        let mut bytes = fmu.bytes();
        bytes[place] ^= 1;
        seal(&mut bytes);
        assert_eq!(fmu.deserialize(&bytes, &mut null_mut()), ERROR);
        assert!(fmu.error().contains(why), "{place}: {}", fmu.error());
    }
}

impl Fmu {
    /// A new instance with the values of another.
    fn restored(from: &Self) -> Self {
        let fmu = Self::started(from.version);
        assert_eq!(fmu.set(&[U, GAIN], &[0.123_456, 7.654_321]), OK);
        fmu
    }
}

#[test]
fn sizes_and_null() {
    let fmu = || Fmu::started(2);
    let (maker, mut state) = (fmu(), null_mut());
    assert_eq!(maker.save(&mut state), OK);
    let size = maker.size(state);
    for wrong in [0, 1, size - 1, size + 1] {
        let mut bytes = vec![7; wrong];
        assert_eq!(fmu().serialize(state, &mut bytes), ERROR);
        assert_eq!(bytes, vec![7; wrong]);
    }
    unsafe {
        assert_eq!(fmi2SerializedFMUstateSize(fmu().it, state, null_mut()), ERROR);
        assert_eq!(fmi2SerializeFMUstate(fmu().it, state, null_mut(), size), ERROR);
        assert_eq!(fmi2DeSerializeFMUstate(fmu().it, std::ptr::null(), size, &mut null_mut()), ERROR);
        assert_eq!(fmi2DeSerializeFMUstate(fmu().it, maker.bytes().as_ptr(), size, null_mut()), ERROR);
        assert_eq!(fmi2GetFMUstate(fmu().it, null_mut()), ERROR);
    }
    assert_eq!(maker.free_state(&mut state), OK);
}

#[test]
fn a_reset_is_a_fresh_instance() {
    for version in [2, 3] {
        let fresh = Fmu::new(version).bytes();
        let expected = run(&Fmu::started(version), 0, 20);
        for state in "inste".chars() {
            let fmu = Fmu::in_state(version, state);
            assert_eq!(fmu.reset(), OK);
            assert_eq!(fmu.bytes(), fresh);
        }
        let fmu = Fmu::new(version);
        assert_eq!((fmu.set(&[R, U], &[7.0, 7.0]), fmu.enter(5.0, Some(6.0)), fmu.exit()), (OK, OK, OK));
        assert_eq!((fmu.step(5.0, 0.5), fmu.step(5.5, 1.0), fmu.reset()), (OK, ERROR, OK));
        assert_eq!((fmu.enter(0.0, None), fmu.exit()), (OK, OK));
        assert_eq!(run(&fmu, 0, 20), expected);
    }
}
