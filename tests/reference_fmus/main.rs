//! The Reference-FMUs in Rust, `examples/reference-fmus/`: packed, in our importer and in FMPy, with the bits of the originals; and
//! `examples/current-map` and `examples/can-bus`.
#![allow(missing_docs, clippy::float_cmp)]

mod bouncing_ball;
mod can_bus;
mod clocks;
mod current_map;
mod dahlquist;
mod feedthrough;
#[path = "../../fmu-import/examples/model_exchange.rs"]
#[allow(dead_code, reason = "its main function")]
mod model_exchange;
mod originals;
#[path = "../common/packed.rs"]
#[allow(unreachable_pub, reason = "a module of several test programs")]
mod package;
mod prove;
#[path = "../common/python.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs")]
mod python;
mod resource;
mod roberts;
mod ssp;
mod stair;
mod state_space;
mod van_der_pol;

use fmu_import::{Fmu, Kind};
use fmu_system::cosimulation::{Integration, Method, Recording, Settings, Solver, System};
use model_description::FmiVersion::{self, V2, V3};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// The archives of a package of `examples/`, of FMI 2.0 and of FMI 3.0.
fn packed(package: &str) -> Vec<PathBuf> {
    type Once = Arc<OnceLock<Vec<PathBuf>>>;
    static ALL: Mutex<BTreeMap<String, Once>> = Mutex::new(BTreeMap::new());
    let one = ALL.lock().unwrap_or_else(PoisonError::into_inner).entry(package.into()).or_default().clone();
    one.get_or_init(|| package::packed(&format!("examples/reference-fmus/{package}"), package, archives())).clone()
}

/// Folder of the archives.
fn archives() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| python::scratch().join("reference-fmus"))
}

fn archive(package: &str, version: FmiVersion) -> PathBuf {
    let folder = if version == V3 { "fmi3" } else { "fmi2" };
    packed(package).into_iter().find(|file| file.parent().is_some_and(|parent| parent.ends_with(folder))).unwrap()
}

/// Our importer with these values set, up to `stop` in steps of `h`.
fn run(method: Method, fmu: &Path, set: &[(&str, &str)], stop: f64, h: f64) -> Recording {
    let mut system = System::new(method);
    system.add("it", &Fmu::open(fmu).unwrap(), false).unwrap();
    for (name, value) in set {
        system.set(&format!("it.{name}"), value).unwrap();
    }
    system.record_outputs().unwrap();
    let settings = Settings { start: 0.0, stop, step: h, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

/// The values of a column.
fn column(recording: &Recording, name: &str) -> Vec<f64> {
    recording.column(&format!("it.{name}")).unwrap().values.clone()
}

/// Model Exchange by Runge-Kutta steps of the communication step.
fn exchange() -> Method {
    Method::ModelExchange(Integration { solver: Solver::Rk4, ..Integration::default() })
}

/// Euler's method: all steps of `s`, from `x`; a row for every `n`-th point.
fn euler<const N: usize>(
    mut x: [f64; N],
    s: f64,
    rows: usize,
    n: usize,
    f: impl Fn([f64; N]) -> [f64; N],
) -> Vec<[f64; N]> {
    let mut all = vec![x];
    for k in 1..=(rows - 1) * n {
        let dx = f(x);
        x = std::array::from_fn(|i| x[i] + s * dx[i]);
        if k % n == 0 {
            all.push(x);
        }
    }
    all
}

/// FMPy's run of an archive: the columns of its recording with the time, as text that keeps every bit.
fn fmpy(fmu: &Path, arguments: &str) -> Vec<Vec<f64>> {
    let script = "import sys, fmpy\n\
        from fmpy.validation import validate_fmu\n\
        problems = validate_fmu(sys.argv[1])\n\
        assert problems == [], problems\n\
        result = eval('fmpy.simulate_fmu(sys.argv[1], ' + sys.argv[2] + ')')\n\
        for name in result.dtype.names:\n    print(*(float(x).hex() for x in result[name]))\n";
    let said = self::script(script, &[fmu, Path::new(arguments)]);
    said.lines().map(|line| line.split(' ').map(hexadecimal).collect()).collect()
}

/// A number in the form of Python's `float.hex`.
fn hexadecimal(text: &str) -> f64 {
    let (sign, text) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    let (mantissa, exponent) = text.strip_prefix("0x").and_then(|text| text.split_once('p')).unwrap();
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = u64::from_str_radix(&format!("{whole}{fraction}"), 16).unwrap();
    let exponent: i32 = exponent.parse::<i32>().unwrap() - 4 * i32::try_from(fraction.len()).unwrap();
    #[expect(clippy::cast_precision_loss, reason = "53 bits")]
    let digits = digits as f64;
    // In two parts, because a power below 2^-1022 is not exact.
    sign * digits * 2.0_f64.powi(exponent.max(-1000)) * 2.0_f64.powi(exponent.min(-1000) + 1000)
}

const BOTH: [FmiVersion; 2] = [V2, V3];

/// The archive of FMI 3.0.
fn open(package: &str) -> Fmu {
    Fmu::open(archive(package, V3)).unwrap()
}

/// The checker's findings in the archives, except those about the linker.
fn checks(package: &str) {
    for file in packed(package) {
        let program = Some(PathBuf::from(env!("CARGO_BIN_EXE_fmu")));
        let options = fmu_check::Options { program, ..Default::default() };
        let report = fmu_check::run(&file, &options).unwrap();
        let found = report.violated().filter(|f| !["B03", "B04"].contains(&f.id)).count();
        assert_eq!(found, 0, "{}: {}", file.display(), report.text(false));
    }
}

#[test]
fn every_archive_violates_nothing() {
    const PACKAGES: [&str; 9] = [
        "dahlquist",
        "van-der-pol",
        "bouncing-ball",
        "stair",
        "resource",
        "feedthrough",
        "state-space",
        "roberts",
        "clocks",
    ];
    for package in PACKAGES {
        checks(package);
        // FMI 2.0 has neither bytes nor clocks.
        let standards = if ["feedthrough", "clocks"].contains(&package) { 1 } else { 2 };
        assert_eq!(packed(package).len(), standards, "{package}");
    }
}

/// Runs a script with FMPy.
fn script(script: &str, arguments: &[&Path]) -> String {
    let mut python = Command::new(python::environment(Path::new("tests/fmpy/requirements.txt")));
    let output = python.args(["-c", script]).args(arguments).env_remove("PYTHONPATH").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}
