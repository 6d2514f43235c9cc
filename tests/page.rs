//! The pages that run FMUs in a browser: `page.toml`, the content of a page, and its runs.
#![allow(missing_docs)]

mod common;

use common::pages::module;
use drive::PmsmDrive;
use fmu_core::{Block, Capabilities, Constant, Description, Elapsed, Exported, Model, Slot, Step};
use fmu_pack::page::own::{Own, PresetRun};
use fmu_pack::page::{Source, judged, page};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

const OWN: &str = include_str!("../fmus/pmsm-drive/page.toml");

/// The description of the drive, found once: its dependencies take a second of the processor.
fn drive() -> Description {
    static DRIVE: LazyLock<Description> = LazyLock::new(|| Description::of::<PmsmDrive>().unwrap());
    DRIVE.clone()
}

fn presets() -> Vec<PresetRun> {
    judged(&drive(), Some((Path::new("page.toml"), OWN))).unwrap().presets
}

/// Sets a variable of a model by its name.
fn set<M: Model>(block: &mut Block<M>, name: &str, value: &Value) {
    let at = (0..M::TABLE.len()).find(|&i| M::TABLE.locate(i).is_some_and(|(n, ..)| n == name)).unwrap();
    match (M::TABLE.entry(block, at).unwrap().1, value) {
        (Slot::Real(x), value) => *x = value.as_f64().unwrap(),
        (Slot::Boolean(x), Value::Bool(on)) => *x = *on,
        (Slot::Enumeration(x), value) => assert!(x.set(value.as_i64().unwrap().try_into().unwrap())),
        _ => panic!("{name}"),
    }
}

/// The named real values of a model.
fn values<M: Model>(block: &mut Block<M>, names: &[String]) -> Vec<f64> {
    let find = |name: &String| (0..M::TABLE.len()).find(|&i| M::TABLE.locate(i).is_some_and(|(n, ..)| n == *name));
    let places: Vec<usize> = names.iter().map(|name| find(name).unwrap()).collect();
    let mut one = |at: usize| match M::TABLE.entry(block, at).unwrap().1 {
        Slot::Real(x) => *x,
        Slot::Boolean(x) => f64::from(u8::from(*x)),
        Slot::Enumeration(x) => x.get().into(),
        Slot::Constant(Constant::Real(x)) => x,
        Slot::Constant(Constant::Boolean(x)) => f64::from(u8::from(x)),
        Slot::Constant(Constant::Enumeration(x)) => x.into(),
        other => panic!("{at}: {other:?}"),
    };
    places.into_iter().map(&mut one).collect()
}

/// A run of the page, natively: a row at the start and after every step.
fn run<M: Model>(run: &PresetRun, names: &[String]) -> Vec<Vec<f64>> {
    let mut block = Block::<M>::default();
    run.set.iter().for_each(|(name, value)| set(&mut block, name, value));
    block.initialize();
    let experiment = M::INFO.experiment;
    let (mut now, mut rows) = (Elapsed::ZERO, vec![values(&mut block, names)]);
    let stop = run.stop.unwrap_or(experiment.stop);
    let mut k = 0_u32;
    while f64::from(k) < ((stop - experiment.start) / experiment.step).round() {
        for (_, name, value) in run.events.iter().filter(|event| event.0 == u64::from(k)) {
            set(&mut block, name, value);
            block.model.derive();
        }
        block.step(&Step { start: now, h: experiment.step }).unwrap();
        now = now.plus(experiment.step);
        rows.push(values(&mut block, names));
        k += 1;
    }
    rows
}

/// Every figure in the text of a preset comes from its run.
#[test]
fn the_presets_show_what_their_texts_say() {
    let names = ["speed", "theta_e", "theta_est", "i_d", "u_share"].map(String::from);
    let shown = |title: &str| -> (Vec<Vec<f64>>, Vec<f64>) {
        let preset = presets().into_iter().find(|preset| preset.title == title).unwrap();
        let rows = run::<PmsmDrive>(&preset, &names);
        let error = |row: &Vec<f64>| {
            let x = row[2] - row[1];
            (x - 2.0 * PI * (x / (2.0 * PI)).round()).to_degrees()
        };
        let errors = rows.iter().map(error).collect();
        (rows, errors)
    };
    let near = |what: &str, got: f64, wanted: f64| {
        assert!((got / wanted - 1.0).abs() < 0.01, "{what}: {got}, not {wanted}");
    };
    let (_, error) = shown("Start from any angle");
    let aligned = error.iter().rposition(|x| x.abs() > 1.0).unwrap() + 1;
    near("s to 1 degree", 1e-3 * f64::from(u16::try_from(aligned).unwrap()), 0.339);
    let (rows, error) = shown("Load step at standstill");
    near("dip in rpm", rows.iter().map(|row| row[0]).fold(0.0, f64::min) * 30.0 / PI, -127.4);
    near("error in degrees", error.last().unwrap().abs(), 35.38);
    let (_, error) = shown("Load step at 1000 rpm");
    near("error in degrees", error.last().unwrap().abs(), 0.1232);
    let (_, error) = shown("Wrong resistance");
    near("error in degrees before", error[790].abs(), 3.46);
    near("error in degrees after", error.last().unwrap().abs(), 8.24);
    let (_, error) = shown("Another estimator");
    assert!(error.last().unwrap().abs() < 0.001, "{}", error.last().unwrap());
    let (rows, _) = shown("Field weakening");
    near("i_d in A", rows.last().unwrap()[3], -6.19);
    near("share of the voltage", rows.last().unwrap()[4], 0.949);
}

/// A page of this text, or the reason for the mismatch.
fn refused(own: &str) -> String {
    judged(&drive(), Some((Path::new("page.toml"), own))).err().map(|e| e.to_string()).unwrap_or_default()
}

#[test]
fn what_is_wrong_in_a_page_toml_is_named() {
    let preset = |body: &str| format!("[[preset]]\ntitle = \"P\"\n{body}");
    let arrow = |body: &str| format!("[[plane]]\ntitle = \"T\"\narrows = [{{ name = \"a\", {body} }}]");
    let full = "full = 1.0";
    for (own, why) in [
        ("colour = 1", "line 1: unknown field `colour`"),
        ("inputs = [\"speed_reff\"]", "inputs: PmsmDrive has no variable speed_reff; did you mean speed_ref?"),
        ("inputs = [\"speed\"]", "inputs: speed is not an input"),
        ("parameters = [\"tau_load\"]", "parameters: tau_load is not a parameter"),
        (
            "[range]\n\"plant.motor.R_s\" = [\"-1 Ohm\", 3]",
            "range of plant.motor.R_s: plant.motor.R_s = -1 Ohm is not greater",
        ),
        ("[range]\nspeed_ref = [\"1 V\", \"2 V\"]", "range of speed_ref: "),
        ("[range]\nspeed_ref = [2, 1]", "range of speed_ref: 2 is not below 1"),
        ("[[plot]]\ntitle = \"A\"\ncurves = [\"plant.motor.R_s\"]", "plot \"A\": plant.motor.R_s is not a curve"),
        ("[[plot]]\ntitle = \"A\"\ncurves = []", "plot \"A\": has no curve"),
        (
            "[[plot]]\ntitle = \"A\"\ncurves = [\"speed\"]\n[[plot]]\ntitle = \"A\"\ncurves = [\"i_d\"]",
            "two plots have the name \"A\"",
        ),
        ("[[difference]]\nname = \"speed\"\nof = [\"speed\", \"speed_est\"]", "a variable has this name"),
        (&arrow(&format!("d = [\"speeed\"], q = [], {full}")), "arrow \"a\": PmsmDrive has no variable speeed"),
        (&arrow(&format!("d = [[1, [2, 3]]], q = [], {full}")), "a product has names and numbers only"),
        (&arrow("d = [1], q = [], full = \"0 Wb\""), "full = 0 Wb is not a number above 0"),
        (&arrow("d = [1], q = [], full = \"1 parsec\""), "full = 1 parsec is not a number above 0 with a unit"),
        (&preset("set = { \"plant.motor.R_s\" = 0 }"), "set: plant.motor.R_s = 0 is not greater than 0"),
        (&preset("set = { speed = 1 }"), "set: speed is not an input or a parameter with one value"),
        (&preset("set = { \"controller.estimator\" = \"Magic\" }"), "is not one of Rasmussen, DirectEmf"),
        (
            &preset("events = [[2.0, \"tau_load\", 1]]\nstop = 1"),
            "event at 2 s: it is not between the start and the stop, 1 s",
        ),
        (&preset("events = [[0.0005, \"tau_load\", 1]]"), "event at 0.0005 s: it is between two steps of 0.001 s"),
        (&preset("events = [[0.1, \"plant.motor.psi_M\", 1]]"), "does not change in a run"),
        (&preset("stop = -1"), "stop = -1 s is not after the start"),
        (&preset("rate = -1"), "rate is not a finite number"),
        (&preset("").repeat(2), "two presets have the name \"P\""),
    ] {
        let got = refused(own);
        assert!(got.starts_with("page.toml: ") && got.contains(why) && !got.contains('\n'), "{own}\n{got}\nnot {why}");
    }
    let many = (0..51).fold(String::new(), |all, k| all + &format!("[[preset]]\ntitle = \"{k}\"\n"));
    assert!(refused(&many).contains("51 presets; the maximum is 50"));
    assert!(Own::read(&" ".repeat(1 << 21)).unwrap_err().contains("; the maximum is "));
}

fn source<'a>(of: &'a Description, plain: &'a Description, module: &'a [u8]) -> Source<'a> {
    let own = Some((Path::new("page.toml"), OWN));
    Source { description: of, plain, module, own, stimuli: None, licenses: "MIT" }
}

#[test]
fn a_page_stands_alone_and_knows_the_model() {
    let of = drive();
    let module = module(&of.token);
    let html = page(&source(&of, &of, &module)).unwrap();
    assert_eq!(html, page(&source(&of, &of, &module)).unwrap(), "two pages of one model differ");
    common::pages::stands_alone(&html, |_| false);
    let json = html.split_once("id=\"fmu\">").unwrap().1.split_once("</script>").unwrap().0;
    let json: Value = serde_json::from_str(json).unwrap();
    let variable =
        |name: &str| json["variables"].as_array().unwrap().iter().find(|v| v["name"] == name).unwrap().clone();
    assert_eq!(variable("speed_ref")["display"][0], "rpm");
    assert_eq!(variable("plant.motor.R_s")["range"], json!([0.5, 5.0]));
    assert_eq!(variable("controller.estimator")["type"], "Estimator");
    assert_eq!((json["presets"].as_array().unwrap().len(), &json["starts"]), (6, &json!([])));
    assert_eq!(json["differences"][0]["like"]["display"][0], "deg");
    // The page contains the start values of a preset archive; the author's presets are for other values.
    let mut other = of.clone();
    let at = other.variables.iter().position(|v| v.name == "plant.motor.R_s").unwrap();
    other.variables[at].start = Some(vec![fmu_core::description::Value::Real(0.775)]);
    let html = page(&source(&other, &of, &module)).unwrap();
    assert!(html.contains("\"starts\":[[\"plant.motor.R_s\",0.775]]") && html.contains("Default experiment"));
}

#[test]
fn a_model_without_co_simulation_has_no_page() {
    let mut of = drive();
    fmu_pack::page::is_possible(&of).unwrap();
    of.model_exchange = Description::exported::<Alone>().unwrap().model_exchange;
    let said = fmu_pack::page::is_possible(&of).unwrap_err().to_string();
    assert!(said.contains("for Model Exchange only"), "{said}");
}

/// The drive for Model Exchange only.
struct Alone;

impl Exported for Alone {
    type Model = PmsmDrive;
    const CAN: Capabilities<PmsmDrive> = Capabilities::NONE.ContinuousTime().Events().ModelExchangeOnly();
}

#[test]
fn another_module_is_refused() {
    let of = drive();
    let good = module(&of.token);
    for (module, why) in [
        (b"\x7fELF".to_vec(), "not one of WebAssembly"),
        (good[..8].to_vec(), "no function fmi3DoStep"),
        (good[..18].to_vec(), "does not export its table"),
        (good[..good.len() - 1].to_vec(), "lacks the token"),
    ] {
        let said = page(&source(&of, &of, &module)).unwrap_err().to_string();
        assert!(said.contains(why), "{said}");
    }
}

/// Names of items, units in headings and truth values in the file that feeds the default experiment.
#[test]
fn the_default_experiment_has_names_and_units() {
    let of = drive();
    let module = module(&of.token);
    let dir = tempfile::tempdir().unwrap();
    let stimuli = dir.path().join("stimuli.csv");
    let made = |text: &str| {
        std::fs::write(&stimuli, text).unwrap();
        let html = page(&Source { own: None, stimuli: Some(&stimuli), ..source(&of, &of, &module) })?;
        let json = html.split_once("id=\"fmu\">").unwrap().1.split_once("</script>").unwrap().0;
        Ok::<_, anyhow::Error>(serde_json::from_str::<Value>(json).unwrap()["presets"][0].clone())
    };
    let run = made(
        "time [ms],speed_ref [rpm],enable,controller.estimator\n0,30,true,ExtendedEmf\n100,30,true,ExtendedEmf\n100,60,false,ExtendedEmf\n",
    );
    let run = run.unwrap();
    assert_eq!([&run["set"][1], &run["set"][2]], [&json!(["enable", true]), &json!(["controller.estimator", 4])]);
    let speed = |value: &Value| value.as_f64().unwrap() * 30.0 / PI;
    assert!((speed(&run["set"][0][1]) - 30.0).abs() < 1e-12, "{run}");
    assert_eq!((&run["events"][0][0], &run["events"][1]), (&json!(100), &json!([100, "enable", false])));
    assert!((speed(&run["events"][0][2]) - 60.0).abs() < 1e-12, "{run}");
    for (text, cause) in [
        (
            "time,controller.estimator\n0,Magic\n",
            "controller.estimator: line 2: controller.estimator = Magic is not one of",
        ),
        ("time,speed_ref [V]\n0,1\n", "speed_ref: speed_ref = 1V is not a number in rad/s or"),
    ] {
        let said = format!("{:#}", made(text).unwrap_err());
        assert!(said.contains(cause), "{said}");
    }
}

/// The functions of the page that write and read values, in Node.
fn in_node(script: &str) -> Option<String> {
    let text = include_str!("../fmu-pack/src/page/text.js");
    let output = Command::new("node").args(["-e", &format!("{text}\n{script}")]).output();
    let Ok(output) = output else {
        println!("not run: node is missing");
        return None;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

/// `fmu_import::csv` reads the CSV file of a page: the same quotation marks, headings with units, and numbers with all bits.
#[test]
fn a_csv_of_a_page_is_one_of_ours() {
    let names = ["time", "a,b", "m[1,2]", "say \"x\"", "plain name", "two\nlines", " blank "];
    let (numbers, given) =
        ([0.1 + 0.2, -0.0, 1e-300, f64::MAX, 4.0, f64::MIN_POSITIVE, 0.0], ["s", "", "V", "", "rad/s", "", ""]);
    let bits: Vec<String> = numbers.iter().map(|x| format!("{}n", x.to_bits())).collect();
    let script = format!(
        "const names = {}, units = {}, bits = [{}];\n\
         const numbers = bits.map((b) => new DataView(new BigUint64Array([b]).buffer).getFloat64(0, true));\n\
         process.stdout.write(line(names.map((name, i) => heading({{ name, unit: units[i] }}))) + line(numbers) + line([NaN, Infinity, -Infinity]));",
        json!(names),
        json!(given),
        bits.join(", ")
    );
    let Some(csv) = in_node(&script) else { return };
    let headings = names
        .iter()
        .zip(given)
        .map(|(name, unit)| if unit.is_empty() { (*name).to_owned() } else { format!("{name} [{unit}]") });
    assert!(csv.starts_with(&fmu_import::csv::line(headings)), "{csv}");
    assert!(csv.ends_with("NaN,inf,-inf\n"), "{csv}");
    let table = fmu_import::csv::Table::parse(csv.trim_end_matches("NaN,inf,-inf\n")).unwrap();
    let read: Vec<(&str, &str)> = table.headings.iter().map(|h| (h.name.as_str(), h.unit.as_str())).collect();
    let expected: Vec<(&str, &str)> = names.iter().map(|name| name.trim()).zip(given).collect();
    assert_eq!(read, expected);
    let back: Vec<u64> = table.rows[0].1.iter().map(|cell| cell.parse::<f64>().unwrap().to_bits()).collect();
    assert_eq!(back, numbers.map(f64::to_bits));
}

/// An address contains the names of enumeration items, or their numbers; a number may have the unit of the page.
#[test]
fn an_address_has_names_of_items() {
    let script = "
        globalThis.model = { enumerations: { E: [[1, 'Off', ''], [4, 'On, now', '']] } };
        const e = { kind: 'Enumeration', type: 'E' }, x = { kind: 'Float64', unit: 'rad/s', display: ['rpm', 2, 1] };
        const i = { kind: 'Int32' }, b = { kind: 'Boolean' }, s = { kind: 'String' };
        process.stdout.write(JSON.stringify([
          textOf(e, 4), textOf(e, 7), textOf(x, 0.5), textOf(b, false), textOf(s, ''),
          valueOf(e, 'On, now'), valueOf(e, '1'), valueOf(e, '2') ?? null, valueOf(e, 'on') ?? null,
          valueOf(x, '-1.5e3'), valueOf(x, '5 rpm'), valueOf(x, '5rad/s'), valueOf(x, '5 V') ?? null, valueOf(x, '') ?? null, valueOf(x, 'x') ?? null,
          valueOf(x, '1e999') ?? null, valueOf(i, '3'), valueOf(i, '3.5') ?? null, valueOf(b, 'true'), valueOf(b, '1') ?? null, valueOf(s, 'a:b'),
        ]));";
    let Some(said) = in_node(script) else { return };
    let expected = json!([
        "On, now", "7", "0.5", "false", "", 4, 1, null, null, -1500, 2, 5, null, null, null, null, 3, null, true, null,
        "a:b"
    ]);
    assert_eq!(serde_json::from_str::<Value>(&said).unwrap(), expected);
}

/// The serialized state of the packed FMU at the end of a run, in hexadecimal digits.
fn state(run: &PresetRun) -> String {
    let fmu = fmu_import::Fmu::open(common::archives().join("fmi3/PmsmDrive.fmu")).unwrap();
    let mut instance = fmu.instantiate("instance", false).unwrap();
    let set = |instance: &mut fmu_import::Instance, (name, value): &(String, Value)| {
        instance.set_text(name, value.to_string().trim_matches('"')).unwrap();
    };
    run.set.iter().for_each(|pair| set(&mut instance, pair));
    let experiment = PmsmDrive::INFO.experiment;
    instance.setup(experiment.start, None).unwrap();
    instance.enter_initialization().unwrap();
    instance.exit_initialization().unwrap();
    for k in 0..1000_u32 {
        for (_, name, value) in run.events.iter().filter(|event| event.0 == u64::from(k)) {
            set(&mut instance, &(name.clone(), value.clone()));
        }
        let _ = instance.do_step(f64::from(k) * experiment.step, experiment.step).unwrap();
    }
    let state = instance.get_state().unwrap();
    let bytes = instance.serialize_state(state).unwrap();
    bytes.iter().fold(String::new(), |text, byte| text + &format!("{byte:02x}"))
}

/// Pages in a Chromium: the bits of native runs in every column, states, live changes, addresses, faults, widths, keys.
#[test]
#[ignore = "opt-in: cargo test --test page browser -- --ignored (needs Chromium and Rust's standard library for WebAssembly)"]
fn pages_in_a_browser() {
    let folder = common::python::scratch().join("run-pages");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let make = |arguments: &[&str]| {
        let output =
            Command::new(env!("CARGO_BIN_EXE_fmu")).arg("page").args(arguments).arg("--out").arg(&folder).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    make(&["PmsmDrive"]);
    make(&["--package", "own-fmu", "--package", "faulty-fmu"]);
    let bytes = |name: &str| std::fs::metadata(folder.join(name)).unwrap().len();
    let sizes = ["PmsmDrive.html", "RcCircuit.html"].map(bytes);
    println!("PmsmDrive.html {} bytes, RcCircuit.html {} bytes", sizes[0], sizes[1]);
    // The experiment of the reference: start angle, speed step, load step, in all real outputs.
    let experiment = PresetRun {
        title: "bits".into(),
        text: String::new(),
        set: vec![("plant.initial.theta_e".into(), json!(3.0))],
        events: vec![(400, "speed_ref".into(), json!(100.0)), (700, "tau_load".into(), json!(1.5))],
        stop: Some(1.0),
        rate: Some(0.0),
        compare: false,
    };
    let outputs = drive().variables.into_iter();
    let names: Vec<String> =
        outputs.filter(|v| v.causality == fmu_core::Causality::Output && !v.is_array()).map(|v| v.name).collect();
    let rows = run::<PmsmDrive>(&experiment, &names);
    let bits: Vec<Vec<String>> =
        rows.iter().map(|row| row.iter().map(|x| format!("{:016x}", x.to_bits())).collect()).collect();
    let expected = json!({ "run": experiment.json(), "names": names, "rows": bits, "state": state(&experiment) });
    let path: PathBuf = folder.join("expected.json");
    std::fs::write(&path, expected.to_string()).unwrap();
    common::python::pytest("pages", "run-pages", &["test_run_page.py"], &[("FMU_PAGES", &folder)]);
    // 840,753 and 185,985 bytes on 2026-11-30: the first is missed; at 600,000, the drive had two thirds of its present code.
    assert!(sizes[0] <= 600_000 && sizes[1] <= 260_000, "{sizes:?} bytes");
}
