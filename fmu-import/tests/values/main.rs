//! Values that the importer passes and receives, call by call, with an FMU in C that records and returns them (`fmu.c`).
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use fmu_import::{CompletedStep, Fmu, Instance, Stepped, Update, Values};
use model_description::BaseType::{
    self, Binary, Boolean, Enumeration, Float32, Float64, Int8, Int16, Int32, Int64, String as Text, UInt8, UInt16,
    UInt32, UInt64,
};
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;

fn instance(folder: &Path, version: u32) -> Instance {
    let library = folder.join("x.so");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/values/fmu.c");
    let mut cc = Command::new("cc");
    cc.args(["-std=c11", "-D_GNU_SOURCE", "-shared", "-fPIC", "-w", "-o"]).arg(&library).arg(source);
    assert!(cc.status().unwrap().success());
    let (root, platform) = if version == 2 {
        ("fmiVersion='2.0' guid='g'", "linux64")
    } else {
        ("fmiVersion='3.0' instantiationToken='g'", "x86_64-linux")
    };
    let description = format!(
        "<fmiModelDescription {root} modelName='m'><CoSimulation modelIdentifier='x'/>\
         <ModelVariables/><ModelStructure/></fmiModelDescription>"
    );
    let path = folder.join(format!("{version}.fmu"));
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    for (entry, bytes) in [
        ("modelDescription.xml".to_owned(), description.into_bytes()),
        (format!("binaries/{platform}/x.so"), std::fs::read(library).unwrap()),
    ] {
        zip.start_file(entry, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&bytes).unwrap();
    }
    zip.finish().unwrap();
    Fmu::open(path).unwrap().instantiate("m", false).unwrap()
}

fn both(test: impl Fn(&mut Instance, u32)) {
    let folder = tempfile::tempdir().unwrap();
    for version in [2, 3] {
        test(&mut instance(folder.path(), version), version);
    }
}

fn integers<const N: usize>(x: [i128; N]) -> Values {
    Values::Integers(x.to_vec())
}

/// Sets values of one type and reads the bytes as another.
#[test]
fn values_cross_in_the_layout_of_their_type() {
    let folder = tempfile::tempdir().unwrap();
    let mut it = instance(folder.path(), 3);
    let mut reread = |set: BaseType, values: Values, get: BaseType, count: usize| {
        it.set_at(set, 1, &values).unwrap_or_else(|e| panic!("{set}: {e}"));
        it.get_at(get, 1, count).unwrap()
    };
    assert_eq!(reread(Int8, integers([-1, 127, -128]), UInt8, 3), integers([255, 127, 128]));
    assert_eq!(reread(UInt8, integers([255, 1]), Int8, 2), integers([-1, 1]));
    assert_eq!(reread(Int16, integers([-2, 5]), UInt16, 2), integers([65534, 5]));
    assert_eq!(reread(UInt16, integers([65535]), Int16, 1), integers([-1]));
    assert_eq!(reread(Int32, integers([i32::MIN.into(), 7]), UInt32, 2), integers([1 << 31, 7]));
    assert_eq!(reread(UInt32, integers([u32::MAX.into()]), Int32, 1), integers([-1]));
    assert_eq!(reread(Int64, integers([i64::MIN.into(), -3]), UInt64, 2), integers([1 << 63, (1 << 64) - 3]));
    assert_eq!(reread(UInt64, integers([u64::MAX.into()]), Int64, 1), integers([-1]));
    assert_eq!(reread(Enumeration, integers([-5]), Int64, 1), integers([-5]));
    assert_eq!(reread(Int64, integers([-6]), Enumeration, 1), integers([-6]));
    assert_eq!(reread(Float32, Values::Reals(vec![1.5, -2.0]), UInt32, 2), integers([0x3fc0_0000, 0xc000_0000]));
    assert_eq!(reread(UInt32, integers([0x3fc0_0000]), Float32, 1), Values::Reals(vec![1.5]));
    assert_eq!(reread(Boolean, Values::Booleans(vec![true, false]), UInt8, 2), integers([1, 0]));
    assert_eq!(reread(UInt8, integers([2, 0, 255]), Boolean, 3), Values::Booleans(vec![true, false, true]));
    let texts = Values::Strings(vec!["one".into(), "zwei \u{e4}".into()]);
    assert_eq!(reread(Text, texts.clone(), Text, 2), texts);
}

#[test]
fn values_cross_in_both_standards() {
    both(|it, version| {
        for (base, values) in [
            (Float64, Values::Reals(vec![-0.1])),
            (Int32, integers([-7])),
            (Boolean, Values::Booleans(vec![true])),
            (Text, Values::Strings(vec!["text".into()])),
        ] {
            it.set_at(base, 6, &values).unwrap();
            assert_eq!(it.get_at(base, 6, 1).unwrap(), values, "{version}");
        }
        it.set_reals(&[6, 7], &[1.25, -3.5]).unwrap();
        let mut read = [0.0; 2];
        it.get_reals(&[7, 6], &mut read).unwrap();
        assert_eq!(read.map(f64::to_bits), [-3.5_f64, 1.25].map(f64::to_bits));
    });
}

#[test]
fn values_that_do_not_fit_are_refused() {
    both(|it, version| {
        let mut refused = |base: BaseType, values: Values| {
            let error = it.set_at(base, 1, &values).unwrap_err().to_string();
            assert!(error.contains(&format!("is not a value of the type {base}")), "{version}: {error}");
        };
        refused(Int32, integers([1 << 31]));
        refused(Int32, integers([-(1 << 31) - 1]));
        refused(Int32, Values::Reals(vec![1.0]));
        refused(Boolean, integers([1]));
        refused(Text, Values::Strings(vec!["a\0b".into()]));
        if version == 2 {
            refused(Enumeration, integers([1 << 31]));
            refused(Float64, Values::Reals(vec![1.0, 2.0]));
            return;
        }
        for (base, low, high) in [
            (Int8, -128, 127),
            (UInt8, 0, 255),
            (Int16, -32768, 32767),
            (UInt16, 0, 65535),
            (UInt32, 0, u32::MAX.into()),
            (Int64, i64::MIN.into(), i64::MAX.into()),
            (UInt64, 0, u64::MAX.into()),
            (Enumeration, i64::MIN.into(), i64::MAX.into()),
        ] {
            refused(base, integers([low - 1]));
            refused(base, integers([0, high + 1]));
        }
        let error = it.get_at(Binary, 1, 1).unwrap_err().to_string();
        assert!(error.contains("fmi3GetBinary is missing"), "{error}");
    });
}

/// Every result has its position: one at a time is true.
#[test]
fn results_have_their_places() {
    both(|it, version| {
        let mask = |it: &mut Instance, bit: usize| it.set_reals(&[0], &[f64::from(1 << bit)]).unwrap();
        for bit in 0..5 {
            mask(it, bit);
            let flag = |k| k == bit;
            let expected = Update {
                again: flag(0),
                terminate: flag(1),
                nominals_changed: flag(2),
                states_changed: flag(3),
                next_event_time: flag(4).then_some(7.0),
            };
            assert_eq!(it.update_discrete_states().unwrap(), expected, "{version} {bit}");
            let expected = CompletedStep { enter_event_mode: flag(0), terminate: flag(1) };
            assert_eq!(it.completed_integrator_step().unwrap(), expected, "{version} {bit}");
            let stepped = it.advance(1.0, 0.5).unwrap();
            let of_3 = Stepped { event: flag(0), terminate: flag(1), early: flag(2), last: 1.25 };
            // FMI 2.0 reports the time of the end by fmi2LastSuccessfulTime.
            let last = if flag(1) { 0.25 } else { 1.5 };
            let of_2 = Stepped { event: false, terminate: flag(1), early: false, last };
            assert_eq!(stepped, if version == 2 { of_2 } else { of_3 }, "{version} {bit}");
        }
        let last = if version == 2 { 0.25 } else { 1.25 };
        assert_eq!(it.last_successful_time().unwrap().to_bits(), f64::to_bits(last));
        mask(it, 1);
        assert_eq!(it.do_step(0.0, 1.0).unwrap(), ControlFlow::Break(()));
    });
}

#[test]
fn times_have_their_places() {
    for (start, stop, tolerance) in [(2.0, Some(5.0), Some(1e-3)), (-1.0, None, Some(0.5)), (3.0, Some(4.0), None)] {
        both(|it, version| {
            it.setup_with(start, stop, tolerance).unwrap();
            it.enter_initialization().unwrap();
            let mut received = [0.0; 5];
            it.get_reals(&[1, 2, 3, 4, 5], &mut received).unwrap();
            let has = |x: Option<f64>| f64::from(u8::from(x.is_some()));
            let expected = [has(tolerance), tolerance.unwrap_or(0.0), start, has(stop), stop.unwrap_or(0.0)];
            assert_eq!(received.map(f64::to_bits), expected.map(f64::to_bits), "{version}");
        });
    }
}

fn real(it: &mut Instance, reference: u32) -> f64 {
    let mut one = [f64::NAN];
    it.get_reals(&[reference], &mut one).unwrap();
    one[0]
}

/// An FMU that never has to go back in time may discard data: one of the public FMUs then computes a different result.
#[test]
fn only_a_saved_state_can_bring_back_an_earlier_time() {
    both(|it, version| {
        for (saved, expected) in [(false, 1.0), (true, 0.0), (false, 1.0)] {
            let state = saved.then(|| it.get_state().unwrap());
            assert!(it.do_step(0.0, 1.0).unwrap().is_continue());
            assert_eq!(real(it, 6).to_bits(), f64::to_bits(expected), "FMI {version}");
            if let Some(state) = state {
                it.free_state(state).unwrap();
            }
        }
    });
}

#[test]
fn a_pending_step_is_awaited() {
    let folder = tempfile::tempdir().unwrap();
    let mut it = instance(folder.path(), 2);
    it.set_reals(&[0], &[32.0]).unwrap();
    assert!(it.do_step(0.0, 1.0).unwrap().is_continue());
    assert_eq!(real(&mut it, 7).to_bits(), 3.0_f64.to_bits());
    // Discarded in the end, because the FMU ends the simulation.
    it.set_reals(&[0], &[34.0]).unwrap();
    assert!(it.do_step(1.0, 1.0).unwrap().is_break());
}
