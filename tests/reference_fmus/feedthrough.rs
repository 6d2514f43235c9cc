//! Feedthrough: an input and an output of every type.

use super::{archive, open, script};
use fmu_import::{Number, Values};
use fmu_sweep::{Definition, Options, Sweep};
use fmu_system::cosimulation::{Recording, Sequence, Settings, System};
use model_description::BaseType;
use model_description::FmiVersion::V3;
use std::fs;
use std::ops::ControlFlow;

/// The inputs of the original's Feedthrough_in.csv: the ends of every integer type.
const ENDS: &str = "time,Int8_input,UInt8_input,Int16_input,UInt16_input,Int32_input,UInt32_input,Int64_input,UInt64_input\n\
     0.0,-128,0,-32768,0,-2147483648,0,-9223372036854775808,0\n\
     1.0,127,255,32767,65535,2147483647,4294967295,9223372036854775807,18446744073709551615\n";

/// Runs it over its default experiment with a file of inputs.
fn run(name: &str, inputs: &str) -> Recording {
    let mut system = System::default();
    system.add("it", &open("feedthrough"), false).unwrap();
    let file = super::archives().join(format!("feedthrough-{name}.csv"));
    fs::write(&file, inputs).unwrap();
    for (input, texts) in Sequence::read_csv(&file, |_| true).unwrap() {
        system.sequence(&format!("it.{input}"), &texts).unwrap();
    }
    system.record_outputs().unwrap();
    let settings = Settings { start: 0.0, stop: 2.0, step: 0.1, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

/// 34 variables in addition to time, with the value references of the original's ValueReference.
#[test]
fn its_variables_are_those_of_the_original() {
    let fmu = open("feedthrough");
    let md = fmu.description();
    assert_eq!((md.variables.len(), md.outputs.len(), md.initial_unknowns.len()), (35, 16, 16));
    assert!(md.co_simulation.is_some() && md.model_exchange.is_some());
    for (name, base, reference) in [
        ("Float32_continuous_input", BaseType::Float32, 1),
        ("Float64_discrete_output", BaseType::Float64, 10),
        ("UInt64_output", BaseType::UInt64, 26),
        ("String_input", BaseType::String, 29),
        ("Binary_output", BaseType::Binary, 32),
        ("Enumeration_output", BaseType::Enumeration, 34),
    ] {
        let v = md.variable(name).unwrap();
        assert_eq!((v.base, v.value_reference), (base, reference), "{name}");
    }
    let start = |name: &str| md.variable(name).unwrap().start_texts.clone();
    assert_eq!((start("String_input"), start("Binary_input")), (vec!["Set me!".into()], vec!["666f6f".into()]));
}

/// Integers of 64 bits keep their digits over time, as single values and in a file, with or without a decimal point and zeros; items
/// have their names.
#[test]
fn integers_over_time_keep_their_digits() {
    let recording = run(
        "digits",
        "time_ms,Int64_input,UInt64_input,Enumeration_input\n0,9007199254740993,18446744073709551615,Option2\n\
         500,-9.007199254740993000e+15,9223372036854775809,1.0\n1000,-9223372036854775808,9007199254740993,Option2\n",
    );
    let all = |name: &str| {
        let column = recording.column(&format!("it.{name}_output")).unwrap();
        [0, 6, 20].map(|k| column.at(k))
    };
    let whole = |numbers: [i128; 3]| numbers.map(Number::Integer);
    assert_eq!(all("Int64"), whole([9_007_199_254_740_993, -9_007_199_254_740_993, i128::from(i64::MIN)]));
    assert_eq!(all("UInt64"), whole([u64::MAX.into(), (1 << 63) + 1, 9_007_199_254_740_993]));
    assert_eq!(all("Enumeration"), whole([2, 1, 2]));
    let error = |port: &str, text: &str| {
        let mut system = System::default();
        system.add("it", &open("feedthrough"), false).unwrap();
        system.sequence(port, &Sequence::parse(text).unwrap()).unwrap_err().to_string()
    };
    for (port, text, cause) in [
        ("it.Int64_input", "0:1.5", "Int64_input = 1.5 is not an integer"),
        ("it.Int8_input", "0:300.0", "Int8_input = 300.0 is not of the type Int8: -128 to 127"),
        ("it.Boolean_input", "0:2.0", "Boolean_input = 2.0 is not true or false"),
        ("it.Enumeration_input", "0:Option3", "Enumeration_input = Option3 is not one of Option1, Option2"),
    ] {
        assert!(error(port, text).contains(cause), "{}", error(port, text));
    }
}

/// 21 rows, all of them the start values.
#[test]
fn without_inputs_the_outputs_are_the_start_values() {
    let recording = run("none", "time,Int8_input\n0,0\n");
    assert_eq!(recording.time.len(), 21);
    for column in &recording.columns {
        let expected = if column.name.contains("Enumeration") { 1.0 } else { 0.0 };
        assert!(column.values.iter().all(|x| x.to_bits() == f64::to_bits(expected)), "{}", column.name);
    }
    let texts: Vec<_> = recording.texts.iter().map(|c| (c.name.as_str(), c.values.as_slice())).collect();
    assert_eq!(texts.len(), 2);
    assert!(texts[0].0.ends_with("String_output") && texts[0].1.iter().all(|x| x == "Set me!"), "{texts:?}");
    assert!(texts[1].0.ends_with("Binary_output") && texts[1].1.iter().all(|x| x == "666f6f"), "{texts:?}");
}

/// Integers are held from their time on and arrive with every digit: an output follows one step later.
#[test]
fn the_ends_of_every_integer_arrive_exactly() {
    let mut instance = open("feedthrough").instantiate("it", false).unwrap();
    let recording = run("ends", ENDS);
    let rows: Vec<Vec<&str>> = ENDS.lines().map(|line| line.split(',').collect()).collect();
    for (k, name) in rows[0].iter().enumerate().skip(1) {
        let output = name.replace("_input", "_output");
        let values = &recording.column(&format!("it.{output}")).unwrap().values;
        #[expect(clippy::cast_precision_loss, reason = "columns are of doubles")]
        let expected = |row: usize| rows[row][k].parse::<i128>().unwrap() as f64;
        for (n, x) in values.iter().enumerate() {
            let row = if n <= 10 { 1 } else { 2 };
            assert_eq!(x.to_bits(), expected(row).to_bits(), "{output} at row {n}");
        }
        instance.set_text(name, rows[2][k]).unwrap();
    }
    instance.setup(0.0, None).unwrap();
    instance.enter_initialization().unwrap();
    instance.exit_initialization().unwrap();
    assert_eq!(instance.get("UInt64_output").unwrap(), Values::Integers(vec![u64::MAX.into()]));
    assert_eq!(instance.get("Int64_output").unwrap(), Values::Integers(vec![i64::MAX.into()]));
}

/// From one FMU to another, into a recording, a file and a measure, an integer keeps every digit; texts and bytes are also
/// transferred.
#[test]
fn connected_values_keep_their_type() {
    let large = 9_007_199_254_740_993_i128;
    let mut system = System::default();
    for name in ["a", "b"] {
        system.add(name, &open("feedthrough"), false).unwrap();
    }
    for name in ["Int64", "UInt64", "String", "Binary", "Boolean", "Enumeration"] {
        system.connect(&format!("a.{name}_output"), &format!("b.{name}_input")).unwrap();
    }
    system.connect("a.Int32_output", "b.Float64_discrete_input").unwrap();
    let set = [
        ("Int64", "-9007199254740993"),
        ("UInt64", "18446744073709551615"),
        ("String", "x, \"y\""),
        ("Binary", "00ff"),
    ];
    for (name, value) in [&set[..], &[("Boolean", "true"), ("Enumeration", "Option2"), ("Int32", "-7")]].concat() {
        system.set(&format!("a.{name}_input"), value).unwrap();
    }
    system.record_outputs().unwrap();
    let settings = Settings { start: 0.0, stop: 0.4, step: 0.1, sequential: false };
    let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    let last = |name: &str| recording.column(&format!("b.{name}_output")).unwrap().last();
    assert_eq!(["Int64", "UInt64"].map(last), [Number::Integer(-large), Number::Integer(u64::MAX.into())]);
    assert_eq!((last("Boolean").real(), last("Enumeration")), (1.0, Number::Integer(2)));
    assert_eq!(last("Float64_discrete"), Number::Real(-7.0));
    let texts = |name: &str| recording.texts.iter().find(|c| c.name == name).unwrap().values.last().unwrap().clone();
    assert_eq!(["b.String_output", "b.Binary_output"].map(texts), ["x, \"y\"", "00ff"]);
    let mut csv = Vec::new();
    recording.write_csv(&mut csv).unwrap();
    let csv = String::from_utf8(csv).unwrap();
    assert_eq!(csv.lines().last().unwrap().matches("-9007199254740993,18446744073709551615").count(), 2, "{csv}");
    let wrong = |from: &str, to: &str| {
        let mut system = System::default();
        for name in ["a", "b"] {
            system.add(name, &open("feedthrough"), false).unwrap();
        }
        system.connect(from, to).unwrap_err().to_string()
    };
    let said = wrong("a.String_output", "b.Binary_input");
    assert_eq!(said, "b.Binary_input: has the type Binary, a.String_output has String");
}

/// A sweep varies integers of 64 bits and measures them with all digits; so does a list from a file.
#[test]
fn a_sweep_keeps_the_digits_of_integers() {
    let folder = super::archives().join("sweep-digits");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("list.csv"), "it.Int64_input\n9007199254740993\n-9223372036854775808\n").unwrap();
    let head = format!("fmus = ['it={}']\nstop = 0.2\nstep = 0.1\n", archive("feedthrough", V3).display());
    let tail = "[measure]\nlast = { of = 'it.Int64_output', is = 'final' }\n\
        above = { of = 'it.Int64_output - it.Int32_output', is = 'max' }\n";
    let grid = "design = { kind = 'grid' }\n[vary]\n'it.Int64_input' = { values = [9007199254740993, -9223372036854775808] }\n";
    for (name, design) in [("grid", grid), ("list", "design = { kind = 'list', file = 'list.csv' }\n")] {
        let definition = Definition::parse(&format!("{head}{design}{tail}")).unwrap();
        let sweep = Sweep::new(definition, folder.clone()).unwrap();
        let out = folder.join(name);
        let done = fmu_sweep::run(&sweep, &out, &Options { restart: true, ..Options::default() }, &Quiet).unwrap();
        let rows = fs::read_to_string(done.results.unwrap()).unwrap();
        let expected = "0,9007199254740993,9007199254740993,9007199254740993,0.2,\n\
            1,-9223372036854775808,-9223372036854775808,-9223372036854775808,0.2,\n";
        assert_eq!(rows.split_once('\n').unwrap().1, expected, "{name}");
    }
}

pub(crate) struct Quiet;

impl fmu_sweep::Progress for Quiet {
    fn note(&self, _text: &str) {}
    fn progress(&self, _done: u64, _failed: u64, _all: u64) {}
}

/// Straight lines for continuous values, jumps where a time occurs twice, and texts and bytes held constant.
#[test]
fn inputs_of_every_kind_come_from_one_file() {
    let recording = run(
        "mixed",
        "time,Float64_continuous_input,Float32_continuous_input,Int32_input,String_input,Binary_input,Boolean_input\n\
         0,3,0,1,\"foo, \"\"bar\"\"\",,false\n1,3,1,1,\"foo, \"\"bar\"\"\",,false\n1,2,1,1,foo,00ff,true\n2,3,2,2,bar,00ff,true\n",
    );
    let at = |name: &str, row: usize| recording.column(&format!("it.{name}_output")).unwrap().values[row];
    let real = |name: &str, row: usize, expected: f64| assert!((at(name, row) - expected).abs() < 1e-6, "{name} {row}");
    for (row, double, single) in [(0, 3.0, 0.0), (10, 3.0, 0.9), (11, 2.0, 1.0), (16, 2.5, 1.5)] {
        real("Float64_continuous", row, double);
        real("Float32_continuous", row, single);
    }
    real("Int32", 20, 1.0);
    assert_eq!((at("Boolean", 10).to_bits(), at("Boolean", 11).to_bits()), (0, 1.0_f64.to_bits()));
    let text = |row: usize| recording.texts.iter().map(|c| c.values[row].as_str()).collect::<Vec<_>>();
    assert_eq!((text(5), text(11)), (vec!["foo, \"bar\"", ""], vec!["foo", "00ff"]));
}

/// Outputs follow their inputs at once in Model Exchange, discrete ones in Event Mode.
#[test]
fn model_exchange_passes_values_through() {
    let mut it = open("feedthrough").instantiate_as(fmu_import::Kind::ModelExchange, "it", false).unwrap();
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
    it.exit_initialization().unwrap();
    let (text, bytes) = (Values::Strings(vec!["event".into()]), Values::Binaries(vec![vec![0, 255, 7]]));
    it.set("String_input", &text).unwrap();
    it.set("Binary_input", &bytes).unwrap();
    assert_eq!((it.get("String_output").unwrap(), it.get("Binary_output").unwrap()), (text.clone(), bytes.clone()));
    it.update_discrete_states().unwrap();
    it.enter_continuous_time_mode().unwrap();
    it.set("Float32_continuous_input", Values::Reals(vec![0.25])).unwrap();
    assert_eq!(it.get("Float32_continuous_output").unwrap(), Values::Reals(vec![0.25]));
    for (name, value) in [("String_input", &text), ("Binary_input", &bytes)] {
        let error = it.set(name, value).unwrap_err().to_string();
        assert!(error.contains("Discard"), "{error}");
    }
    assert_eq!((it.get("String_output").unwrap(), it.get("Binary_output").unwrap()), (text, bytes));
}

#[test]
fn fmpy_gives_the_same() {
    let packed = archive("feedthrough", V3);
    let inputs = super::archives().join("feedthrough-fmpy.csv");
    fs::write(&inputs, ENDS).unwrap();
    script(include_str!("feedthrough.py"), &[&packed, &inputs]);
}
