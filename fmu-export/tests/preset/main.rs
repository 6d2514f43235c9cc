//! Presets through the C functions: start values of every type from a file of the resources, before `load`, after a reset and
//! beside saved states; and refusals with their cause.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]
#![allow(clippy::float_cmp, reason = "the bits of a start value")]

mod importer;
mod model;

use fmi::*;
use fmu_core::description::Value;
use fmu_core::{Description, preset};
use fmu_export::abi::types::*;
use importer::*;
use model::All;
use std::ffi::CString;
use std::fs;
use std::ptr::{null, null_mut};

fmu_export::export!(All: Events);

/// A value of every type.
const ALL: [(&str, &str); 10] = [
    ("u", "-7.5"),
    ("real", "0.30000000000000004"),
    ("single", "0.2"),
    ("n", "12"),
    ("small", "200"),
    ("large", "18446744073709551615"),
    ("on", "true"),
    ("fan", "2"),
    ("label", "two\nlines \u{3c8}"),
    ("key", "00ff1A"),
];

#[test]
fn every_type_starts_with_its_value_before_load_and_after_a_reset() {
    let all = [&ALL[..], &[("weights[1,2]", "-3e-7"), ("weights[2,2]", "8")]].concat();
    for way in WAYS {
        let it = entered(way, with(way, &all).unwrap());
        let expected = [
            "-7.5",
            "0.30000000000000004",
            "0.6000000000000001",
            "-2.2500003000000004",
            // `load` sees the preset.
            "0.30000000000000004",
            "[12, 200, 2]",
            "true",
            "[1.0, -3e-7, 3.0, 8.0]",
            "0.20000000298023224",
            "two\nlines \u{3c8}",
        ];
        assert_eq!(values(way, it), expected, "{way:?}");
        if !is_two(way) {
            let mut large = 0;
            assert_eq!((unsafe { fmi3GetUInt64(it, &LARGE, 1, &mut large, 1) }, large), (0, u64::MAX));
            let (mut size, mut key) = (0, null());
            assert_eq!(unsafe { fmi3GetBinary(it, &KEY, 1, &mut size, &mut key, 1) }, 0);
            assert_eq!(unsafe { std::slice::from_raw_parts(key, size) }, [0, 255, 26]);
        }
        set(way, it, REAL, 9.0);
        set(way, it, U, 8.0);
        assert_eq!((real(way, it, DOUBLED), exit(way, it)), (18.0, 0));
        for _ in 0..2 {
            // The file is gone: the instance keeps its start values.
            reset(way, it);
            entered(way, it);
            assert_eq!(values(way, it), expected, "{way:?}");
        }
        free(way, it);
    }
}

/// The preset has the effect of an importer's setters.
#[test]
fn a_preset_is_equal_to_sets() {
    for way in WAYS {
        let preset = entered(way, with(way, &[("u", "4"), ("real", "0.1"), ("weights[2,1]", "5")]).unwrap());
        let set_later = open(way, &plain(), None).unwrap();
        set(way, set_later, U, 4.0);
        set(way, set_later, REAL, 0.1);
        let weights = [1.0, 2.0, 5.0, 4.0];
        unsafe {
            if is_two(way) {
                assert_eq!(fmi2SetReal(set_later, &(WEIGHTS + 2), 1, &weights[2]), 0);
            } else {
                assert_eq!(fmi3SetFloat64(set_later, &WEIGHTS, 1, weights.as_ptr(), 4), 0);
            }
        }
        entered(way, set_later);
        // The data of `load` differ.
        let but_seen = |it| values(way, it).into_iter().enumerate().filter(|(i, _)| *i != 4).collect::<Vec<_>>();
        assert_eq!(but_seen(preset), but_seen(set_later));
        free(way, preset);
        free(way, set_later);
    }
}

#[test]
fn a_plain_token_has_no_preset_whatever_is_in_the_folder() {
    let folder = Folder::new(preset::write([("real", "9")]).as_bytes());
    let broken = Folder::new(b"nonsense");
    for way in WAYS {
        let (preset, broken) = (folder.name(way), broken.name(way));
        for resources in [None, Some(""), Some("/does/not/exist"), Some(&preset), Some(&broken)] {
            let it = entered(way, open(way, &plain(), resources).unwrap());
            assert_eq!(real(way, it, REAL), 2.0, "{way:?} {resources:?}");
            free(way, it);
        }
    }
}

#[test]
fn a_token_without_its_preset_is_refused_with_the_cause() {
    let text = preset::write([("real", "9")]);
    let (token, other) = (token(text.as_bytes()), preset::write([("real", "8")]));
    let (empty, other) = (Folder::new(b""), Folder::new(other.as_bytes()));
    fs::remove_file(empty.0.join(preset::FILE)).unwrap();
    let directory = Folder::new(b"");
    fs::remove_file(directory.0.join(preset::FILE)).unwrap();
    fs::create_dir(directory.0.join(preset::FILE)).unwrap();
    let large = Folder::new(&vec![b'x'; (1 << 20) + 1]);
    for way in WAYS {
        let no_folder = "resources/fmu-preset.json, the start values of this FMU, and the importer names no folder";
        let changed = "its hash is {";
        let names = [&empty, &other, &directory, &large].map(|folder| folder.name(way));
        for (resources, why) in [
            (None, no_folder),
            (Some(""), no_folder),
            (Some("http://example.org/resources"), no_folder),
            (Some("/does/not/exist"), "/does/not/exist/fmu-preset.json: No such file or directory"),
            (Some(&names[0]), "fmu-preset.json: No such file or directory (os error 2); this file of the archive has"),
            (Some(&names[1]), changed),
            (Some(&names[2]), "fmu-preset.json: is not a file"),
            (Some(&names[3]), changed),
        ] {
            let said = open(way, &token, resources).unwrap_err();
            assert!(said.contains(why), "{way:?} {resources:?}: {said}");
        }
        let folder = Folder::new(text.as_bytes());
        let it = entered(way, open(way, &token, Some(&folder.name(way))).unwrap());
        assert_eq!(real(way, it, REAL), 9.0);
        free(way, it);
        // A wrong token is refused, preset or not.
        let wrong = [format!("{token}x"), format!("{}x", plain()), token[38..].to_owned(), format!("{}+", plain())];
        for wrong in wrong {
            let said = open(way, &wrong, Some(&folder.name(way))).unwrap_err();
            assert!(said.contains("its hash is") || said.contains("are of different builds"), "{said}");
        }
    }
}

#[test]
fn names_and_values_that_are_not_allowed_are_refused_when_they_are_read() {
    for (name, value, why) in [
        ("nothing", "1", "All has no variable nothing"),
        ("", "1", "All has no variable "),
        ("time", "1", "All has no variable time"),
        ("weights", "1", "All has no variable weights"),
        ("weights[3,1]", "1", "All has no variable weights[3,1]"),
        ("y", "1", "y is an output and cannot be set"),
        ("doubled", "1", "doubled is a calculated parameter and cannot be set"),
        ("made", "x", "made is a constant and cannot be set"),
        ("real", "0", "real = 0 is not allowed: greater than 0"),
        ("real", "NaN", "real = NaN is not allowed: greater than 0"),
        ("real", "inf", "real = inf is not allowed: greater than 0"),
        ("real", "1e999", "real = 1e999 is not allowed: greater than 0"),
        ("real", "", "real =  is not allowed: a number"),
        ("real", " 1", "real =  1 is not allowed: a number"),
        ("u", "1001", "u = 1001 is not allowed: at most 1000"),
        ("single", "0.31", "single = 0.31 is not allowed: at most 0.3"),
        ("single", "-1e39", "single = -1e39 is not allowed: at most 0.3"),
        ("n", "2.5", "n = 2.5 is not allowed: an integer"),
        ("n", "0", "n = 0 is not allowed: at least 1"),
        ("n", "2147483648", "n = 2147483648 is not allowed: 1 to 2147483647"),
        ("small", "201", "small = 201 is not allowed: 0 to 200"),
        ("small", "-1", "small = -1 is not allowed: 0 to 200"),
        ("large", "18446744073709551616", "large = 18446744073709551616 is not allowed: 0 to 18446744073709551615"),
        ("on", "1", "on = 1 is not allowed: true or false"),
        ("fan", "3", "fan = 3 is not allowed: 1 (Off), 2 (On)"),
        ("fan", "On", "fan = On is not allowed: 1 (Off), 2 (On)"),
        ("key", "0ff", "key = 0ff is not allowed: pairs of hexadecimal digits"),
        ("key", "000102030405060708", "key = 000102030405060708 is not allowed: at most 8 bytes"),
    ] {
        for way in WAYS {
            let said = with(way, &[(name, value)]).unwrap_err();
            assert!(said.contains(&format!("fmu-preset.json: {why}")), "{name} = {value}: {said}");
        }
        assert!(described(&[(name, value)]).unwrap_err().contains(why));
    }
    let twice = with(Way::Three, &[("n", "2"), ("u", "1"), ("n", "2")]).unwrap_err();
    assert!(twice.ends_with("n already has a value"), "{twice}");
    for bytes in [&b"nonsense"[..], b"fmu preset 1\nn\t2\n", br#"{"format": "fmu preset", "version": 9}"#] {
        let folder = Folder::new(bytes);
        let said = open(Way::Two, &token(bytes), Some(&folder.name(Way::Two))).unwrap_err();
        assert!(said.contains("fmu-preset.json: "), "{said}");
    }
}

extern "C" fn collect(context: *mut c_void, bytes: *const u8, len: usize) {
    unsafe { (*context.cast::<Vec<u8>>()).extend_from_slice(std::slice::from_raw_parts(bytes, len)) }
}

/// The description of the model with this preset in its resources.
fn described(values: &[(&str, &str)]) -> Result<Description, String> {
    let text = preset::write(values.iter().copied());
    let (folder, mut bytes) = (Folder::new(text.as_bytes()), Vec::new());
    let resources = CString::new(folder.name(Way::Two)).unwrap();
    match unsafe { fmu_description(collect, (&raw mut bytes).cast(), resources.as_ptr(), 0) } {
        0 => Ok(serde_json::from_slice(&bytes).unwrap()),
        _ => Err(String::from_utf8(bytes).unwrap()),
    }
}

#[test]
fn the_description_has_the_start_values_and_the_token() {
    let (own, preset) = (Description::exported::<This>().unwrap(), described(&ALL).unwrap());
    assert_eq!(preset.token, token(preset::write(ALL).as_bytes()));
    for (variable, start) in preset.variables.iter().zip(own.variables) {
        let value = ALL.iter().find(|(name, _)| *name == variable.name);
        assert_eq!(variable.start != start.start, value.is_some(), "{}", variable.name);
        assert_eq!((&variable.kind, variable.value_reference), (&start.kind, start.value_reference));
        assert_eq!((&variable.dependencies, &variable.initial_dependencies), (&None, &None), "{}", variable.name);
    }
    let start = |name: &str| preset.variable(name).unwrap().start.clone().unwrap();
    assert_eq!(start("large"), [Value::Integer(u64::MAX.into())]);
    assert_eq!(start("fan"), [Value::Integer(2)]);
    assert_eq!(start("label"), [Value::Text("two\nlines \u{3c8}".into())]);
    let said = described(&[("label", "\u{1}")]).unwrap_err();
    assert!(said.contains("has a character that XML does not allow"), "{said}");
}

/// A state contains all values, and can be restored in every instance of the model; a reset returns to the instance's preset.
#[test]
fn saved_states_work() {
    let one = entered(Way::Three, with(Way::Three, &[("real", "6"), ("label", "one")]).unwrap());
    let other = entered(Way::Three, with(Way::Three, &[("real", "7")]).unwrap());
    unsafe {
        set(Way::Three, one, U, 5.0);
        let (mut state, mut length) = (null_mut(), 0);
        assert_eq!(fmi3GetFMUState(one, &mut state), 0);
        assert_eq!(fmi3SerializedFMUStateSize(one, state, &mut length), 0);
        let mut bytes = vec![0; length];
        assert_eq!(fmi3SerializeFMUState(one, state, bytes.as_mut_ptr(), length), 0);
        let before = values(Way::Three, one);
        set(Way::Three, one, REAL, 1.0);
        assert_eq!(fmi3SetFMUState(one, state), 0);
        assert_eq!(values(Way::Three, one), before);
        let mut read = null_mut();
        assert_eq!(fmi3DeserializeFMUState(other, bytes.as_ptr(), length, &mut read), 0);
        assert_eq!(fmi3SetFMUState(other, read), 0);
        assert_eq!((real(Way::Three, other, REAL), real(Way::Three, other, U)), (6.0, 5.0));
        // The data of `load` belong to the instance.
        assert_eq!(real(Way::Three, other, SEEN), 7.0);
        assert_eq!((fmi3FreeFMUState(one, &mut state), fmi3FreeFMUState(other, &mut read)), (0, 0));
        reset(Way::Three, other);
        assert_eq!(real(Way::Three, entered(Way::Three, other), REAL), 7.0);
        assert_eq!(exit(Way::Three, other), 0);
    }
    free(Way::Three, one);
    free(Way::Three, other);
}

#[test]
fn the_log_tells_what_differs_from_the_preset() {
    for (value, expected) in [(6.0, "all start values unchanged"), (2.0, "with real = 2")] {
        let it = with(Way::Three, &[("real", "6")]).unwrap();
        set(Way::Three, it, REAL, value);
        entered(Way::Three, it);
        assert_eq!(exit(Way::Three, it), 0);
        assert!(SAID.take().iter().any(|line| line.contains("initialized") && line.ends_with(expected)));
        free(Way::Three, it);
    }
}

/// An Integer of FMI 2.0 has 32 bits; a Real is also for variables in single precision.
#[test]
fn fmi_2_reads_what_fits_its_types() {
    for way in [Way::Two, Way::TwoExchange] {
        let it = entered(way, with(way, &[("large", "4294967296")]).unwrap());
        set(way, it, SINGLE, 0.25);
        assert_eq!(real(way, it, SINGLE), 0.25);
        unsafe {
            let mut large = Fmi2Integer(7);
            assert_eq!((fmi2GetInteger(it, &LARGE, 1, &mut large), large.0), (3, 7));
            let why = "large = 4294967296 does not fit a 32-bit FMI 2.0 Integer; in FMI 3.0 it is UInt64";
            assert!(SAID.take().last().unwrap().contains(why));
            reset(way, it);
            assert_eq!(fmi2SetReal(it, &SINGLE, 1, &0.31), 3);
            assert!(SAID.take().last().unwrap().contains("single = 0.31 is not allowed: at most 0.3"));
        }
        free(way, it);
    }
}

#[test]
fn a_variable_of_another_type_is_named_with_its_type() {
    for (reference, name) in [
        (U, "u is a real number"),
        (SINGLE, "single is a Float32"),
        (N, "n is an integer"),
        (SMALL, "small is an integer of the type UInt8"),
        (FAN, "fan is an enumeration"),
        (LABEL, "label is a text"),
        (KEY, "key is bytes"),
    ] {
        let it = entered(Way::Three, open(Way::Three, &plain(), None).unwrap());
        assert_eq!(unsafe { fmi3GetBoolean(it, &reference, 1, &mut Fmi3Boolean(0), 1) }, 3);
        let said = SAID.take().pop().unwrap();
        assert_eq!(said, format!("fmi3GetBoolean: {name}, and this function takes a truth value"));
        reset(Way::Three, it);
        assert_eq!(unsafe { fmi3SetBoolean(it, &reference, 1, &Fmi3Boolean(0), 1) }, 3);
        assert!(SAID.take().pop().unwrap().contains(name));
        free(Way::Three, it);
    }
}
