//! An FMU with a variable of every type and causality, and with a resource file, packed for both standards: tests/types.
#![allow(missing_docs)]

mod common;

use fmu_import::{Fmu, Instance, Kind, Values};
use fmu_system::cosimulation::{Settings, System};
use fmu_system::ssp::{ssv, values};
use model_description::FmiVersion::{self, V2, V3};
use model_description::{BaseType, Causality};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// EveryType.fmu of FMI 2.0 and of FMI 3.0.
fn archives() -> &'static [PathBuf] {
    static FILES: OnceLock<Vec<PathBuf>> = OnceLock::new();
    FILES.get_or_init(|| common::packed::packed("tests/types", "types-fmu", &common::python::scratch().join("types")))
}

fn archive(version: FmiVersion) -> &'static Path {
    &archives()[usize::from(version == V3)]
}

fn fresh(version: FmiVersion) -> Instance {
    Fmu::open(archive(version)).unwrap().instantiate("it", false).unwrap()
}

/// In Initialization Mode, because FMI 2.0 allows no reads before it.
fn entered(version: FmiVersion) -> Instance {
    let mut instance = fresh(version);
    instance.setup(0.0, None).unwrap();
    instance.enter_initialization().unwrap();
    instance
}

fn integer(x: impl Into<i128>) -> Values {
    Values::Integers(vec![x.into()])
}

fn text(x: &str) -> Values {
    Values::Strings(vec![x.into()])
}

const INTEGERS: [(&str, BaseType, i128, i128); 8] = [
    ("int8", BaseType::Int8, i8::MIN as i128, i8::MAX as i128),
    ("uint8", BaseType::UInt8, 0, 200), // bounded by its row
    ("int16", BaseType::Int16, i16::MIN as i128, i16::MAX as i128),
    ("uint16", BaseType::UInt16, 0, u16::MAX as i128),
    ("int32", BaseType::Int32, i32::MIN as i128, i32::MAX as i128),
    ("uint32", BaseType::UInt32, 0, u32::MAX as i128),
    ("int64", BaseType::Int64, i64::MIN as i128, i64::MAX as i128),
    ("uint64", BaseType::UInt64, 0, u64::MAX as i128),
];

#[test]
fn integers_of_every_type_travel_to_the_end_of_their_range() {
    for version in [V2, V3] {
        let mut instance = entered(version);
        for (name, base, low, high) in INTEGERS {
            let (input, output) = (format!("in.{name}"), format!("out.{name}"));
            let v = instance.variable(&input).unwrap().clone();
            assert_eq!(v.base, if version == V2 { BaseType::Int32 } else { base }, "{input}");
            let (least, most) = (i128::from(i32::MIN), i128::from(i32::MAX));
            let (low, high) = if version == V2 { (low.max(least), high.min(most)) } else { (low, high) };
            if version == V2 {
                let printed = |x: i128, none: i128| (x != none).then(|| x.to_string());
                let said = (v.min.map(|x| x.to_string()), v.max.map(|x| x.to_string()));
                assert_eq!(said, (printed(low, least), printed(high, most)), "{input}");
            }
            for value in [low, high] {
                instance.set(&input, integer(value)).unwrap();
                assert_eq!(instance.get(&output).unwrap(), integer(value), "{output}");
            }
        }
        instance.exit_initialization().unwrap();
        let _ = instance.do_step(0.0, 0.1).unwrap();
        assert_eq!(instance.get("out.uint16").unwrap(), integer(65535));
    }
}

#[test]
fn what_does_not_fit_says_why() {
    let refusals = [
        (V2, "in.int8", 128, "in.int8 = 128 is not allowed: -128 to 127"),
        (V2, "in.uint64", -1, "in.uint64 = -1 is not allowed: 0 to 18446744073709551615"),
        (V2, "in.uint8", 201, "in.uint8 = 201 is not allowed: 0 to 200"),
        (V3, "in.uint8", 201, "in.uint8 = 201 is not allowed: 0 to 200"),
        (V3, "fixed.int32", -10, "fixed.int32 = -10 is not allowed: at least -9"),
    ];
    for (version, name, value, why) in refusals {
        let error = fresh(version).set(name, integer(value)).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    }
    // FMI 2.0 cannot represent the final value of a 64-bit variable.
    for version in [V2, V3] {
        let mut instance = entered(version);
        instance.set("fixed.uint64", integer(100_000)).unwrap();
        instance.exit_initialization().unwrap();
        match instance.get("local.uint64") {
            Ok(value) => assert!(version == V3 && value == integer(10_000_000_000_i128)),
            Err(error) => {
                let why = "local.uint64 = 10000000000 does not fit a 32-bit FMI 2.0 Integer; in FMI 3.0 it is UInt64";
                assert!(version == V2 && error.to_string().contains(why), "{error}");
            }
        }
    }
}

#[test]
fn single_precision_rounds_once() {
    for version in [V2, V3] {
        let mut instance = entered(version);
        let v = instance.variable("in.single").unwrap().clone();
        assert_eq!(v.base, if version == V2 { BaseType::Float64 } else { BaseType::Float32 });
        assert_eq!(v.start.unwrap(), if version == V2 { "0.10000000149011612" } else { "0.1" });
        instance.set("in.single", Values::Reals(vec![0.2])).unwrap();
        assert_eq!(instance.get("out.single").unwrap(), Values::Reals(vec![f64::from(0.2_f32)]));
        // The bound is also rounded, and a value outside single precision is not a number.
        instance.set("in.single", Values::Reals(vec![0.3])).unwrap();
        for (beyond, said) in [(0.301, "0.301"), (-1e39, "-")] {
            let error = fresh(version).set("in.single", Values::Reals(vec![beyond])).unwrap_err().to_string();
            assert!(error.contains(&format!("in.single = {said}")) && error.contains("at most 0.3"), "{error}");
        }
    }
}

#[test]
fn texts_are_set_and_said() {
    for version in [V2, V3] {
        let mut instance = entered(version);
        assert_eq!(instance.get("label").unwrap(), text("as built & <tested>"));
        assert_eq!(instance.get("revision").unwrap(), text("r1 \u{b5}"));
        let long = "\u{3c8}".repeat(10_000);
        for label in ["", "two\nlines, \"quoted\"", &long] {
            instance.set("label", text(label)).unwrap();
            assert_eq!((instance.get("label").unwrap(), instance.get("status").unwrap()), (text(label), text(label)));
        }
        instance.exit_initialization().unwrap();
        instance.set("in.truth", Values::Booleans(vec![false])).unwrap();
        let _ = instance.do_step(0.0, 0.1).unwrap();
        assert_eq!(instance.get("status").unwrap(), text("off"));
        let error = instance.set("label", text("late")).unwrap_err().to_string();
        assert!(error.contains("label is a fixed parameter"), "{error}");
        for (name, why) in [
            ("status", "status is an output and cannot be set"),
            ("revision", "revision is a constant and cannot be set"),
        ] {
            let error = fresh(version).set(name, text("x")).unwrap_err().to_string();
            assert!(error.contains(why), "{error}");
        }
        let mut instance = entered(version);
        let number = instance.variable("x").unwrap().value_reference;
        let error = instance.get_at(BaseType::String, number, 1).unwrap_err().to_string();
        assert!(error.contains("x is a real number, and this function takes a text"), "{error}");
        let label = fresh(version).variable("label").unwrap().value_reference;
        let error = entered(version).get_at(BaseType::Float64, label, 1).unwrap_err().to_string();
        assert!(error.contains("label is a text, and this function takes a real number"), "{error}");
    }
}

#[test]
fn matrices_are_row_by_row() {
    let mut two = entered(V2);
    assert!(two.variable("weights[2,3]").is_ok() && two.variable("weights[3,2]").is_err());
    two.set("weights[2,3]", Values::Reals(vec![10.0])).unwrap();
    two.set("matrix[1,2]", Values::Reals(vec![-2.0])).unwrap();
    let mut three = entered(V3);
    let shape = |name: &str| {
        let v = fresh(V3).variable(name).unwrap().clone();
        v.dimensions.iter().map(|d| format!("{d:?}")).collect::<Vec<_>>().join(" ")
    };
    assert_eq!((shape("weights"), shape("vector")), ("Fixed(2) Fixed(3)".into(), "Fixed(3)".into()));
    three.set_text("weights", "1, 0, 0, 0, 1, 10").unwrap();
    three.set_text("matrix", "1,-2,3,4").unwrap();
    two.exit_initialization().unwrap();
    three.exit_initialization().unwrap();
    // weights vector + offsets
    assert_eq!(three.get("sums").unwrap(), Values::Reals(vec![1.0, 2.0 + 30.0 + 0.5]));
    assert_eq!(two.get("sums[2]").unwrap(), Values::Reals(vec![32.5]));
    assert_eq!(three.get("transposed").unwrap(), Values::Reals(vec![1.0, 3.0, -2.0, 4.0]));
    assert_eq!(two.get("transposed[2,1]").unwrap(), Values::Reals(vec![-2.0]));
    let error = fresh(V2).set("weights[1,3]", Values::Reals(vec![f64::NAN])).unwrap_err().to_string();
    assert!(error.contains("weights[1,3] = NaN"), "{error}");
}

/// d x/dt = (voltage + vector[3] - x)/tau; sums = weights vector + offsets.
#[test]
fn derivatives_have_a_number_for_each_element() {
    let mut three = entered(V3);
    three.exit_initialization().unwrap();
    let vr = |name: &str| fresh(V3).variable(name).unwrap().value_reference;
    let unknowns = [vr("der(state)"), vr("sums")];
    let (knowns, seed, mut change) = ([vr("vector"), vr("voltage")], [1.0, 10.0, 100.0, 1000.0], [0.0; 3]);
    three.directional_derivative(&unknowns, &knowns, &seed, &mut change).unwrap();
    for (x, expected) in change.iter().zip([2.0 * 1100.0, 1.0, 110.0]) {
        assert!((x - expected).abs() < 1e-4 * expected, "{change:?}");
    }
}

/// A state from bytes has the data that the instance read, without reading its file again; so has a reset instance.
#[test]
fn resources_are_there_after_every_way_back() {
    for version in [V2, V3] {
        let square = |instance: &mut Instance| instance.get("square").unwrap();
        let mut first = entered(version);
        first.set("in.int32", integer(2)).unwrap();
        first.exit_initialization().unwrap();
        assert_eq!(square(&mut first), Values::Reals(vec![4.0]));
        let state = first.get_state().unwrap();
        let bytes = first.serialize_state(state).unwrap();
        let mut second = fresh(version);
        let state = second.deserialize_state(&bytes).unwrap();
        second.set_state(state).unwrap();
        for instance in [&mut first, &mut second] {
            let _ = instance.do_step(0.0, 0.1).unwrap();
            assert_eq!(square(instance), Values::Reals(vec![4.0]));
        }
        second.reset().unwrap();
        second.set("in.int32", integer(1)).unwrap();
        second.setup(0.0, None).unwrap();
        second.enter_initialization().unwrap();
        assert_eq!(square(&mut second), Values::Reals(vec![1.0]));
    }
}

#[test]
fn an_fmu_whose_resources_are_missing_or_wrong_says_so() {
    let folder = tempfile::tempdir().unwrap();
    for version in [V2, V3] {
        let (_, files) = fmu_import::contents(archive(version)).unwrap();
        let packed: Vec<_> = files.keys().filter(|name| name.starts_with("resources/")).collect();
        assert_eq!(packed, ["resources/tables/squares.csv"]);
        let cases: [(Option<&str>, &str); 3] = [
            (None, "tables/squares.csv: "),
            (Some("1,2\n3;4\n"), "tables/squares.csv: two numbers a line are needed"),
            (Some(""), "a fault in the model's code (panic): a table without rows"),
        ];
        for (content, why) in cases {
            let broken = folder.path().join("broken.fmu");
            common::rewrite(archive(version), &broken, |name, bytes| {
                if name.starts_with("resources/") { content.map(|text| text.as_bytes().to_vec()) } else { Some(bytes) }
            });
            let fmu = Fmu::open(&broken).unwrap();
            for kind in [Kind::default(), Kind::ModelExchange] {
                let error = fmu.instantiate_as(kind, "it", false).err().unwrap().to_string();
                assert!(error.contains(why), "{error}");
            }
        }
    }
}

#[test]
fn a_difference_is_shown_by_its_factor_alone() {
    for version in [V2, V3] {
        let mut instance = entered(version);
        let md = instance.description().clone();
        let band = md.variable("band").unwrap();
        let shown = md.display_unit(band, None).unwrap();
        assert_eq!((band.relative, shown.name.as_str(), shown.show(1.0)), (true, "degC", 1.0));
        let celsius = md.unit("K").unwrap().display_unit("degC").unwrap();
        assert!((celsius.show(274.15) - 1.0).abs() < 1e-12, "temperatures keep the offset");
        instance.set_text("band", "2.5degC").unwrap();
        assert_eq!(instance.get("band").unwrap(), Values::Reals(vec![2.5]));
        instance.exit_initialization().unwrap();
        assert_eq!(instance.get("x").unwrap(), Values::Reals(vec![2.5]));
    }
}

#[test]
fn a_parameter_file_sets_texts() {
    let file = r#"<ParameterSet><Parameters>
        <Parameter name="label"><String value="from a &lt;file&gt;"/></Parameter>
        <Parameter name="fixed.uint8"><Integer value="7"/></Parameter></Parameters></ParameterSet>"#;
    for version in [V2, V3] {
        let mut system = System::default();
        system.add("it", &Fmu::open(archive(version)).unwrap(), false).unwrap();
        let given = values::Given::all("it", "values.ssv", &ssv::read(file).unwrap());
        values::set(&mut system, &given).unwrap();
        system.record("it.local.uint8").unwrap();
        system.record("it.letters").unwrap();
        let settings = Settings { start: 0.0, stop: 0.1, step: 0.1, sequential: false };
        let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
        assert_eq!(recording.column("it.local.uint8").unwrap().values, [7.0, 7.0]);
        assert_eq!(recording.column("it.letters").unwrap().values, [13.0, 13.0]);
    }
}

/// Names with commas, patterns, truth values and items over time and in files; errors in a file are reported.
#[test]
fn the_command_line_reads_names_values_and_tables() {
    let folder = tempfile::tempdir().unwrap();
    let run = |file: &str, arguments: &[&str]| {
        let all = [&["simulate", file, "--stop", "0.2", "--step", "0.1", "--csv", "-"][..], arguments].concat();
        let output = Command::new(env!("CARGO_BIN_EXE_fmu")).args(all).output().unwrap();
        (output.status.success(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    };
    let table = |text: &str| {
        let path = folder.path().join("in.csv");
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    for file in archives() {
        let file = file.to_str().unwrap();
        let (done, said) = run(file, &["--record", "weights[1,2],x,sums[2]"]);
        assert!(done && said.contains("time,\"weights[1,2]\",x,sums[2]\n0,"), "{said}");
        let (done, said) = run(file, &["--record", "out.?int8,*.int16"]);
        let names = "out.uint8,in.int16,out.int16,local.int16";
        assert!(done && said.contains(&format!("time,{names}")), "{said}");
        let (done, said) = run(file, &["--record", "*"]);
        let [header] = said.lines().filter(|line| line.starts_with("time,")).collect::<Vec<_>>()[..] else {
            panic!("{said}")
        };
        assert!(done && header.contains(",label") && header.contains(",in.real,"), "{header}");
        let (done, said) = run(file, &["--record", "none.*"]);
        assert!(!done && said.contains("none.*: no variable has a name of this form"), "{said}");
        let over_time =
            ["--input", "in.truth=0:false,0.1:True", "--input", "in.fan=0:Off,0.2:On", "--record", "in.truth,in.fan"];
        let (done, said) = run(file, &over_time);
        assert!(done && said.contains("time,in.truth,in.fan\n0,0,1\n0.1,1,1\n0.2,1,2\n"), "{said}");
        let csv = table("time [ms],in.truth,in.fan,\"vector[2]\"\n0,false,Off,1\n100,true,Off,1\n200,TRUE,On,1\n");
        let (done, said) = run(file, &["--input", &csv, "--record", "in.truth,in.fan"]);
        assert!(done && said.contains("time,in.truth,in.fan\n0,0,1\n0.1,1,1\n0.2,1,2\n"), "{said}");
        for (text, why) in [
            (",time,voltage\n0,0,1\n", "the first column has no name: it numbers the rows (an index)"),
            ("time\tvoltage\n0\t1\n", "line 1: has tabs"),
            ("# made by a tool\ntime,voltage\n0,1\n", "line 1: begins with #"),
            ("time,voltage,\n0,1,\n", "line 1: ends with a comma"),
            ("time,voltage\n0,1\n0.1,\n", "line 3: a cell is empty"),
            ("time,in.fan\n0,On\n0.1,Of\n", "line 3: in.fan = Of is not one of Off, On"),
        ] {
            let (done, said) = run(file, &["--input", &table(text)]);
            assert!(!done && said.contains(why), "{text:?}: {said}");
        }
    }
}

/// `fmu simulate` feeds and records variables of every type, and names its limits.
#[test]
fn the_command_line_takes_texts_and_names_what_it_cannot_do() {
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().unwrap();
        (output.status.success(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    };
    let three = archive(V3).to_str().unwrap();
    let (done, said) =
        run(&["simulate", three, "--set", "label=a b,c", "--set", "weights=1,2,3,4,5,6", "--stop", "0.2", "--all"]);
    assert!(done && said.contains("\nout.uint64 "), "{said}");
    assert!(said.contains("\nstatus ") && said.contains(r#""a b,c""#), "{said}");
    for (option, value, why) in [
        ("--record", "sums[3]", "has no variable sums[3]"),
        ("--input", "vector=0:1", "vector=0:1: has 3 elements, and a value has another number"),
        ("--input", "vector[4]=0:1", "has no variable vector[4]"),
        ("--set", "weights[1,1]=1,2", "weights[1,1] = 1,2 is not one value"),
        ("--set", "weights=1 2", "weights has 6 elements, not 2"),
        ("--input", "label=3", "label=3: is not an input or a tunable parameter"),
        ("--set", "weights=1,2", "weights has 6 elements, not 2"),
        ("--set", "in.uint8=x", "in.uint8 = x is not an integer"),
        ("--set", "in.uint8=300", "in.uint8 = 300 is not of the type UInt8: 0 to 255"),
    ] {
        let (done, said) = run(&["simulate", three, option, value]);
        assert!(!done && said.contains(why), "{said}");
    }
    // An element of an array has its name of FMI 2.0; spaces or commas separate the elements of the whole array.
    for file in archives() {
        let file = file.to_str().unwrap();
        let elements =
            ["simulate", file, "--input", "vector[2]=0:3,0.1:4", "--input", "vector[3]=0:10", "--set", "vector[1]=5"];
        let others = ["--set", "weights[2,1]=100", "--record", "sums[2],status,sums[1]", "--stop", "0.2", "--csv", "-"];
        let (done, said) = run(&[&elements[..], &others].concat());
        let rows = "time,sums[2],sums[1],status\n0,513.5,5,as built & <tested>\n0.1,513.5,5,as built & <tested>\n0.2,514.5,5,as built & <tested>\n";
        assert!(done && said.contains(rows), "{said}");
    }
    let (done, said) = run(&[
        "simulate",
        three,
        "--set",
        "weights=1 2 3 4 5 6",
        "--set",
        "vector=1 1 1",
        "--record",
        "sums[1],sums[2]",
    ]);
    assert!(done && said.contains(" 6 V\n") && said.contains(" 15.5 V\n"), "{said}");
    // The whole array is one column, and one input.
    let whole = ["--input", "vector=0:1 2 3,0.1:4 5 6", "--record", "sums,x", "--stop", "0.2", "--csv", "-"];
    let (done, said) = run(&[&["simulate", three][..], &whole].concat());
    assert!(done && said.contains(",1 5.5\n0.1,") && said.contains(",4 11.5\n"), "{said}");
    let (_, said) = run(&["info", three]);
    for line in ["label         \"as built & <tested>\"", "weights[2,3]  1 0 0 0 1 1", "\"r1 \u{b5}\""] {
        assert!(said.contains(line), "{said}");
    }
}

#[test]
fn the_documentation_shows_types_and_extents() {
    let (_, files) = fmu_import::contents(archive(V3)).unwrap();
    let page = String::from_utf8(files["documentation/index.html"].clone()).unwrap();
    for part in [
        "weights[2,3]",
        "<small>text</small>",
        "\u{201c}as built &amp; &lt;tested&gt;\u{201d}",
        "<small>integer, UInt64</small>",
        "shown in degC, a difference",
        "<small>constant</small>",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

/// The system requirements of the binary depend on the linker.
#[test]
fn the_checker_finds_nothing() {
    let program = Some(PathBuf::from(env!("CARGO_BIN_EXE_fmu")));
    for file in archives() {
        let report =
            fmu_check::run(file, &fmu_check::Options { program: program.clone(), ..Default::default() }).unwrap();
        let found = report.violated().filter(|f| !["B03", "B04"].contains(&f.id)).count();
        assert_eq!(found, 0, "{}", report.text(false));
        assert!(report.findings.len() > 150);
    }
}

/// Every constructor is in the table: each type has each causality.
#[test]
fn every_type_has_every_causality() {
    let md = fresh(V3).description().clone();
    let none = [BaseType::String, BaseType::Binary, BaseType::Clock];
    for base in BaseType::ALL.iter().copied().filter(|base| !none.contains(base)) {
        for causality in [Causality::Input, Causality::Output, Causality::Local, Causality::Parameter] {
            assert!(md.variables.iter().any(|v| v.base == base && v.causality == causality), "{base} {causality}");
        }
    }
}

#[test]
fn fmpy_runs_it() {
    let folder = archives()[0].parent().and_then(Path::parent).unwrap();
    common::python::pytest("fmpy", "types", &["test_types.py"], &[("FMU_TYPES", folder)]);
}
