//! Start values of every type and causality: tests/types.

use super::{contents, enter, fmu, preset, text};
use crate::common::packed::packed;
use crate::common::python::scratch;
use fmu_import::{Fmu, Instance, Values};
use model_description::FmiVersion::{self, V2, V3};
use std::path::PathBuf;
use std::sync::OnceLock;

/// EveryType.fmu of FMI 2.0 and of FMI 3.0.
fn archives() -> &'static [PathBuf] {
    static FILES: OnceLock<Vec<PathBuf>> = OnceLock::new();
    FILES.get_or_init(|| packed("tests/types", "types-fmu", &scratch().join("preset-types")))
}

fn of(version: FmiVersion) -> &'static PathBuf {
    &archives()[usize::from(version == V3)]
}

const LABEL: &str = "two\nlines, \"quoted\" \\n \u{3c8}";

#[test]
fn every_type_has_a_start_value() {
    let dir = tempfile::tempdir().unwrap();
    let new = dir.path().join("new.fmu");
    let label = format!("label={LABEL}");
    let sets = [
        "voltage=-2.5",
        "in.single=0.2",
        "in.truth=false",
        "in.fan=Off",
        "fixed.fan=1",
        "in.int8=-128",
        "in.uint8=200",
        "in.int16=-32768",
        "in.uint16=65535",
        "in.int32=-2147483648",
        "in.uint32=2147483647",
        "fixed.uint64=7",
        "band=2.5degC",
        "weights=1,2,3,4,5,6e-7",
        "weights[1,3]=-3",
        "vector[2]=9",
        &label,
    ];
    for version in [V2, V3] {
        preset(of(version), &new, &sets).unwrap();
        let mut it: Instance = Fmu::open(&new).unwrap().instantiate("it", false).unwrap();
        for _ in 0..2 {
            enter(&mut it);
            let mut integer = |name: &str| match it.get(name).unwrap() {
                Values::Integers(x) => x[0],
                other => panic!("{other:?}"),
            };
            let integers = ["in.int8", "in.uint8", "in.int16", "in.uint16", "in.int32", "in.uint32", "fixed.uint64"];
            let expected = [-128, 200, -32768, 65535, -2_147_483_648, 2_147_483_647, 7];
            assert_eq!(integers.map(&mut integer), expected);
            assert_eq!(["in.fan", "fixed.fan"].map(&mut integer), [1, 1]);
            let mut real = |name: &str| match it.get(name).unwrap() {
                Values::Reals(x) => x,
                other => panic!("{other:?}"),
            };
            assert_eq!((real("voltage"), real("band")), (vec![-2.5], vec![2.5]));
            assert_eq!(real("in.single"), [f64::from(0.2_f32)]);
            if version == V3 {
                assert_eq!(real("weights"), [1.0, 2.0, -3.0, 4.0, 5.0, 6e-7]);
                assert_eq!(real("vector"), [1.0, 9.0, 3.0]);
            } else {
                assert_eq!(
                    (real("weights[1,3]"), real("weights[2,3]"), real("vector[2]")),
                    (vec![-3.0], vec![6e-7], vec![9.0])
                );
            }
            assert_eq!(it.get("in.truth").unwrap(), Values::Booleans(vec![false]));
            assert_eq!(it.get("label").unwrap(), Values::Strings(vec![LABEL.into()]));
            // Calculated values, and the data that `load` has read.
            assert_eq!(it.get("status").unwrap(), Values::Strings(vec!["off".into()]));
            it.reset().unwrap();
        }
        let (md, files) = contents(&new).unwrap();
        let start = |name: &str| md.variable(name).unwrap().start.clone().unwrap();
        assert_eq!((start("label"), start("in.fan"), start("in.truth")), (LABEL.into(), "1".into(), "false".into()));
        if version == V3 {
            assert_eq!((start("weights"), start("in.single")), ("1 2 -3 4 5 6e-7".into(), "0.2".into()));
        } else {
            assert_eq!((start("weights[1,3]"), start("weights[2,3]")), ("-3".into(), "6e-7".into()));
        }
        assert!(files.contains_key("resources/tables/squares.csv"));
        // A value returns to the model's.
        preset(&new, &new, &["label=as built & <tested>"]).unwrap();
        assert_eq!(contents(&new).unwrap().0.variable("label").unwrap().start.as_deref(), Some("as built & <tested>"));
    }
}

/// An Integer of FMI 2.0 has 32 bits.
#[test]
fn what_fmi_2_cannot_carry_is_refused_there() {
    let dir = tempfile::tempdir().unwrap();
    let new = dir.path().join("new.fmu");
    let said = preset(of(V2), &new, &["in.uint64=18446744073709551615"]).unwrap_err();
    assert!(
        said.contains("in.uint64 starts with 18446744073709551615, which does not fit a 32-bit FMI 2.0 Integer"),
        "{said}"
    );
    assert!(!new.exists());
    preset(of(V3), &new, &["in.uint64=18446744073709551615", "in.int64=-9223372036854775808"]).unwrap();
    let md = contents(&new).unwrap().0;
    assert_eq!(md.variable("in.uint64").unwrap().start.as_deref(), Some("18446744073709551615"));
    assert_eq!(md.variable("in.int64").unwrap().start.as_deref(), Some("-9223372036854775808"));
}

#[test]
fn wrong_names_and_values_are_told_and_nothing_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let new = dir.path().join("new.fmu");
    for (set, why) in [
        ("lable=x", "EveryType has no variable lable; did you mean label?"),
        ("time=1", "EveryType has no variable time"),
        ("weights[3,1]=1", "EveryType has no variable weights[3,1]"),
        ("sums=1,2", "sums is an output: a preset contains start values of inputs, parameters"),
        ("local.int8=1", "local.int8 is a local variable: a preset"),
        ("revision=r2", "revision is a local variable: a preset"),
        ("weights=1,2", "weights has 6 elements, not 2"),
        ("weights[1,3]=1,2", "weights[1,3] has 1 elements, not 2"),
        ("in.uint8=201", "in.uint8 = 201 is not allowed: 0 to 200"),
        ("in.uint8=300", "in.uint8 = 300 is not of the type UInt8: 0 to 255"),
        ("in.uint8=1.5", "in.uint8 = 1.5 is not an integer"),
        ("in.single=0.4", "in.single = 0.4 is not allowed: at most 0.3"),
        ("fixed.int32=-10", "fixed.int32 = -10 is not allowed: at least -9"),
        ("in.truth=maybe", "in.truth = maybe is not true or false"),
        ("in.fan=Fast", "in.fan = Fast is not one of Off, On"),
        ("in.fan=3", "in.fan = 3 is not allowed: 1 (Off), 2 (On)"),
        ("voltage=NaN", "voltage = NaN is not allowed: any finite number"),
        ("voltage=1A", "voltage = 1A is not a number in V"),
        ("label=\u{1}", "has a character that XML does not allow"),
        ("label", "label: is not --set NAME=VALUE"),
    ] {
        let said = preset(of(V3), &new, &["voltage=2", set]).unwrap_err();
        assert!(said.contains(why) && said.starts_with("Some(2) "), "{set}: {said}");
        assert!(!said.contains("/resources/"), "the path of the unpacked archive must not appear: {said}");
        assert!(!new.exists(), "{set}");
    }
    let none = fmu(&["preset", text(of(V3)), "--out", text(&new)]).unwrap_err();
    assert!(none.contains("nothing to preset: give --set NAME=VALUE"), "{none}");
}
