//! Random FMUs of our exporter in our importer and in FMPy, bit for bit, and in the checker, with and without faults: `generator.rs` writes
//! a model for each seed.
//!
//! CI takes two seeds, a model with events of both kinds and one with a clock. `DIFFERENTIAL=100 DIFFERENTIAL_FROM=40` takes 100 from 40 on.
#![allow(missing_docs)]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

#[path = "../common/mod.rs"]
mod common;

#[path = "../../fmu-check/tests/faults/findings.rs"]
#[allow(unreachable_pub, clippy::missing_panics_doc)]
mod findings;
mod generator;
mod seeded;

use findings::{check, listed};
use fmu::commands::build::{self, Models};
use fmu_check::{Level, Verdict, report::Report};
use fmu_core::draw::Draw;
use fmu_import::{BaseType, Causality, FmiVersion, Fmu, Instance, ModelVariable, Values, Variability};
use fmu_system::cosimulation::{CommunicationPoint, Method, Settings, System};
use generator::{Sort, name, sort, source};
use serde_json::{Value, json};
use std::fmt::Write;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

/// What runs the probes. Many models deserve the checker's own program: a quarter of the size, so its processes start in half the time.
static PROGRAM: LazyLock<String> = LazyLock::new(|| {
    let fmu = Path::new(env!("CARGO_BIN_EXE_fmu"));
    let folder = fmu.parent().unwrap();
    if number("DIFFERENTIAL", 2) < BATCH {
        return fmu.display().to_string();
    }
    let profile = if folder.ends_with("release") { "release" } else { "dev" };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--quiet", "--package", "fmu-check", "--profile", profile]);
    assert!(cargo.env("CARGO_TARGET_DIR", folder.parent().unwrap()).status().unwrap().success());
    folder.join("fmu-check").display().to_string()
});

/// Models that are compiled together.
const BATCH: u64 = 20;
const STEPS: u32 = 8;
const STEP: f64 = 0.125;

/// Compiles models; returns their libraries.
fn compiled(folder: &Path, seeds: &[u64]) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    fs::create_dir_all(folder.join("src")).unwrap();
    fs::write(folder.join("src/lib.rs"), "").unwrap();
    let crates =
        ["fmu-core", "fmu-export"].map(|name| format!("{name} = {{ path = \"{}\" }}\n", root.join(name).display()));
    let mut manifest = format!(
        "[workspace]\n[package]\nname = \"differential\"\nedition = \"2024\"\n[profile.dev]\ndebug = 0\n\
         [profile.dev.package.differential]\nstrip = \"symbols\"\n[dependencies]\n{}\
         serde = {{ version = \"1\", features = [\"derive\"] }}\n",
        crates.concat()
    );
    for &seed in seeds {
        let file = format!("{}.rs", name(seed));
        fs::write(folder.join("src").join(&file), source(seed)).unwrap();
        let name = name(seed);
        let _ = write!(manifest, "[[example]]\nname = \"{name}\"\npath = \"src/{file}\"\ncrate-type = [\"cdylib\"]\n");
    }
    fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    fs::copy(root.join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    // The test of the compiler's messages has the same dependencies, compiled in the same way.
    let target = common::python::scratch().join("compile_errors/target");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--offline", "--quiet", "--examples"]).current_dir(folder).env("CARGO_TARGET_DIR", &target);
    assert!(cargo.status().unwrap().success(), "{}", folder.display());
    seeds.iter().map(|&seed| target.join("debug/examples").join(format!("lib{}.so", name(seed)))).collect()
}

/// The archives of models, of FMI 2.0 where there is one, and of FMI 3.0.
fn packed(folder: &Path, seeds: &[u64]) -> Vec<(u64, PathBuf)> {
    let libraries = compiled(folder, seeds);
    let mut all = Vec::new();
    for clocked in [false, true] {
        let of = |seed: u64| (sort(seed) == Sort::Clocked) == clocked;
        for (library, _) in libraries.iter().zip(seeds).filter(|(_, seed)| of(**seed)) {
            let library = vec![library.display().to_string()];
            build::models(&Models { library, out: Some(folder.into()), ..Models::default() }).unwrap();
        }
        for standard in if clocked { &["fmi3"][..] } else { &["fmi2", "fmi3"] } {
            let file = |seed: u64| (seed, folder.join(standard).join(name(seed)).with_extension("fmu"));
            all.extend(seeds.iter().copied().filter(|seed| of(*seed)).map(file));
        }
    }
    for library in &libraries {
        fs::remove_file(library).unwrap();
    }
    all
}

/// A random value that the variable can have.
fn random(draw: &mut Draw, v: &ModelVariable, count: usize) -> Option<Values> {
    let (low, high) = (v.min.unwrap_or(-20.0), v.max.unwrap_or(20.0));
    let (low, high) = if low < high { (low, high) } else { (low, low + 1.0) };
    let all = 0..count;
    Some(match v.base {
        // Strictly inside, because a bound may be excluded.
        BaseType::Float64 | BaseType::Float32 => {
            Values::Reals(all.map(|_| low + (0.1 + 0.8 * draw.share()) * (high - low)).collect())
        }
        BaseType::Boolean => Values::Booleans(all.map(|_| draw.below(2) == 1).collect()),
        BaseType::String => Values::Strings(all.map(|_| draw.of(&["", "text", "\u{b5} <&>\n"]).into()).collect()),
        BaseType::Enumeration => Values::Integers(all.map(|_| draw.of(&[1, 2, 5])).collect()),
        BaseType::Binary | BaseType::Clock => return None,
        _ => Values::Integers(all.map(|_| i128::try_from(draw.below(100)).unwrap()).collect()),
    })
}

/// Values as the other importer reads them: the bits of real numbers, and integers as texts.
fn written(values: &Values) -> Value {
    match values {
        Values::Reals(all) => all.iter().map(|x| x.to_bits().to_string()).collect(),
        Values::Integers(all) => all.iter().map(ToString::to_string).collect(),
        Values::Booleans(all) => all.iter().copied().collect(),
        Values::Strings(all) => all.iter().cloned().collect(),
        Values::Binaries(_) => panic!("no bytes"),
    }
}

fn entry(v: &ModelVariable, values: &Values) -> Value {
    json!([format!("{:?}", v.base), v.value_reference, written(values), v.name])
}

/// Sets some of the variables of a causality; returns what was set.
fn some(it: &mut Instance, draw: &mut Draw, of: impl Fn(&ModelVariable) -> bool) -> Value {
    let chosen: Vec<ModelVariable> = it.description().variables.iter().filter(|v| of(v)).cloned().collect();
    let mut set = Vec::new();
    for v in chosen {
        let count = it.elements(&v).unwrap();
        if count > 0
            && draw.below(3) > 0
            && let Some(values) = random(draw, &v, count)
        {
            it.set(&v.name, values.clone()).unwrap();
            set.push(entry(&v, &values));
        }
    }
    set.into()
}

/// All values of an instance that change.
fn values(it: &mut Instance) -> Value {
    let shown = |v: &&ModelVariable| v.base != BaseType::Clock && v.causality != Causality::Independent;
    let all: Vec<ModelVariable> = it.description().variables.iter().filter(shown).cloned().collect();
    let mut got = Vec::new();
    for v in all {
        // A size of 0 leaves no element.
        if it.elements(&v).unwrap() > 0 {
            let values = it.get(&v.name).unwrap();
            got.push(entry(&v, &values));
        }
    }
    got.into()
}

/// A run in our importer with random values, as the other importer repeats it.
fn run(seed: u64, file: &Path) -> Value {
    let fmu = Fmu::open(file).unwrap();
    if sort(seed) == Sort::Clocked {
        return json!({ "fmu": file, "clocked": clocked(&fmu) });
    }
    let (mut draw, mut it) = (Draw(seed), fmu.instantiate("it", false).unwrap());
    let three = fmu.description().version == FmiVersion::V3;
    let size = fmu.description().variables.iter().find(|v| v.causality == Causality::StructuralParameter).cloned();
    let mut sizes = json!([]);
    if let Some(v) = size.filter(|_| three) {
        let size = Values::Integers(vec![i128::try_from(draw.below(7)).unwrap()]);
        it.configure(&[(&v.name, &size)]).unwrap();
        sizes = json!([entry(&v, &size)]);
    }
    let parameters = some(&mut it, &mut draw, |v| v.causality == Causality::Parameter);
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
    it.exit_initialization().unwrap();
    let mut steps = Vec::new();
    for k in 0..STEPS {
        let moves = |v: &ModelVariable| v.causality == Causality::Input || v.variability == Variability::Tunable;
        let set = some(&mut it, &mut draw, |v| moves(v) && v.causality != Causality::StructuralParameter);
        let _ = it.do_step(f64::from(k) * STEP, STEP).unwrap();
        steps.push(json!({ "set": set, "expected": values(&mut it) }));
    }
    json!({ "fmu": file, "step": STEP, "sizes": sizes, "parameters": parameters, "steps": steps })
}

/// The outputs after each tick of a clock, which our importer ticks in Event Mode.
fn clocked(fmu: &Fmu) -> Value {
    let mut system = System::new(Method::CoSimulation { event_mode: true, early_return: false });
    system.add("it", fmu, false).unwrap();
    let scalar = |v: &&ModelVariable| v.causality == Causality::Output && v.dimensions.is_empty();
    let number = |v: &&ModelVariable| !matches!(v.base, BaseType::Clock | BaseType::String);
    let all = fmu.description().variables.iter();
    let outputs: Vec<ModelVariable> = all.filter(scalar).filter(number).cloned().collect();
    for v in &outputs {
        system.record(&format!("it.{}", v.name)).unwrap();
    }
    let mut rows = Vec::new();
    let settings = Settings { start: 0.0, stop: f64::from(STEPS) * STEP, step: STEP, sequential: false };
    let each = |point: &mut CommunicationPoint<'_>| {
        let values = outputs.iter().zip(point.values);
        let row = values.map(|(v, x)| entry(v, &Values::from_number(*x, v.base).unwrap()));
        // The first tick comes after the first point.
        if point.index > 0 {
            rows.push(row.collect::<Vec<Value>>());
        }
        Ok(ControlFlow::Continue(()))
    };
    system.run(&settings, each).unwrap();
    json!({ "interval": STEP, "shift": STEP / 2.0, "ticks": rows })
}

/// The findings of a must that the FMU violates.
fn musts(report: &Report) -> Vec<&'static str> {
    let violated =
        report.findings.iter().filter(|f| matches!(f.verdict, Verdict::Violated(_)) && f.level == Level::Must);
    // A build without zig needs the C library of this computer.
    violated.map(|f| f.id).filter(|id| !["B03", "B04"].contains(id)).collect()
}

fn number(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |text| text.parse().unwrap())
}

#[test]
fn random_fmus_in_two_importers_and_in_the_checker() {
    let (count, from) = (number("DIFFERENTIAL", 2), number("DIFFERENTIAL_FROM", 3));
    let python =
        common::python::environment(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy/requirements.txt"));
    let (mut fmus, mut faults, mut compared) = (0, 0, 0);
    let all: Vec<u64> = (from..from + count).collect();
    for seeds in all.chunks(usize::try_from(BATCH).unwrap()) {
        let folder = common::python::scratch().join(format!("differential-{from}"));
        let archives = packed(&folder, seeds);
        let jobs: Vec<Value> = archives.iter().map(|(seed, file)| run(*seed, file)).collect();
        let list = folder.join("jobs.json");
        fs::write(&list, serde_json::to_vec(&jobs).unwrap()).unwrap();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/differential/replay.py");
        let output = Command::new(&python).arg(script).arg(&list).env("PYTHONDONTWRITEBYTECODE", "1").output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
        compared += said.trim().parse::<u64>().unwrap();
        for (seed, file) in &archives {
            let report = check(file, &[]);
            let found = musts(&report);
            assert!(found.is_empty(), "seed {seed}, {}: {}", file.display(), listed(&report));
            faults += seeded::all(*seed, file, &folder);
            fmus += 1;
        }
        println!("seeds {} to {}: {fmus} FMUs, {compared} values, {faults} faults", from, seeds.last().unwrap());
        fs::remove_dir_all(&folder).unwrap();
    }
    assert!(compared > 100 * fmus && faults >= 8 * fmus, "{compared} values and {faults} faults of {fmus} FMUs");
}
