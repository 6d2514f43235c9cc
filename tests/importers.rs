//! The packed FMUs in other importers than FMPy: Ecos, libcosim, an fmucontainer, PathSim, fmuloader, and on demand sofirpy,
//! gemseo-fmu, jaxonomy, fmi-sim and rust-fmi. Each runs a start-up and a load step, and is compared with the native run of the same exchange order.
#![allow(missing_docs)]

mod common;

use common::importers::{self, DRIVE_STEP, Experiment};
use common::python::{environment, pytest, pytest_with, run, scratch};
use fmu::commands::build;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs, process};

/// The file with the experiments and their native results.
fn references() -> PathBuf {
    let file = scratch().join(format!("importers-{}-{:?}.json", process::id(), std::thread::current().id()));
    fs::write(&file, importers::references().to_string()).expect("a file below the target folder");
    file
}

#[test]
fn ecos_libcosim_fmucontainer_pathsim_and_fmuloader() {
    let file = references();
    let files = ["test_ecos.py", "test_libcosim.py", "test_fmucontainer.py", "test_pathsim.py", "test_fmuloader.py"];
    pytest("importers", "importers", &files, &[("FMU_REFERENCE", &file)]);
}

/// FMUs of PythonFMU, pythonfmu3 and fmucontainer in `fmu simulate` and in FMPy: equal bits.
#[test]
fn fmus_of_other_tools_run_as_in_fmpy() {
    let variables = [("FMU_REFERENCE", &*references()), ("FMU_COMMAND", Path::new(env!("CARGO_BIN_EXE_fmu")))];
    pytest("importers", "foreign", &["test_foreign.py"], &variables);
}

/// PathSim integrates the template for users' FMUs; the test explains why the motor FMUs do not run there.
#[test]
#[ignore = "opt-in: cargo test --test importers pathsim_in_model_exchange -- --ignored (half a minute)"]
fn pathsim_in_model_exchange() {
    let own = scratch().join("pathsim-own-fmu");
    let template =
        build::Models { package: vec!["own-fmu".into()], out: Some(own.clone()), ..build::Models::default() };
    build::models(&template).unwrap();
    let variables = [("FMU_REFERENCE", &*references()), ("FMU_OWN", &*own)];
    pytest("importers", "pathsim-exchange", &["test_pathsim_exchange.py"], &variables);
}

/// sofirpy runs pair and drive of FMI 2.0.
#[test]
#[ignore = "needs PyPI, and installs 450 MB: a minute or two"]
fn sofirpy() {
    pytest_with("sofirpy.txt", "importers", "sofirpy", &["test_sofirpy.py"], &[("FMU_REFERENCE", &references())]);
}

/// gemseo-fmu runs the drive of FMI 2.0.
#[test]
#[ignore = "needs PyPI, and installs 1.1 GB: some minutes"]
fn gemseo() {
    pytest_with("gemseo.txt", "importers", "gemseo", &["test_gemseo.py"], &[("FMU_REFERENCE", &references())]);
}

/// jaxonomy runs the whole drive.
#[test]
#[ignore = "needs PyPI, and installs 1.4 GB with JAX: a minute or two"]
fn jaxonomy() {
    let file = references();
    pytest_with("jaxonomy.txt", "importers", "jaxonomy", &["test_jaxonomy.py"], &[("FMU_REFERENCE", &file)]);
}

/// fmucontainer turns the system of `fmu ssp` into one FMU. In FMI 2.0 it has the bits of the system; in FMI 3.0 the speed
/// follows its reference a step later.
#[test]
fn fmucontainer_reads_an_ssp_file() {
    let python = environment(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/importers/requirements.txt"));
    let folder = tempfile::tempdir().unwrap();
    let output = |command: &mut Command| {
        let output = command.current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let simulate = |file: &str| {
        let inputs = ["--input", "speed_ref=0:0,0.02:50", "--input", "tau_load=0:0,0.15:1"];
        let time = ["--stop", "0.3", "--step", "1e-4", "--csv", "-", "--record", "speed,i_q_est"];
        let csv = output(Command::new(env!("CARGO_BIN_EXE_fmu")).args(["simulate", file]).args(inputs).args(time));
        [column(&csv, "speed"), column(&csv, "i_q_est")]
    };
    for standard in ["2", "3"] {
        let (ssp, container) = (format!("x{standard}.ssp"), format!("x{standard}.fmu"));
        let mut write = Command::new(env!("CARGO_BIN_EXE_fmu"));
        output(write.args(["ssp", "--fmi", standard, "--out", &ssp, "--fmus"]).arg(common::archives()));
        let mut pack = Command::new(&python);
        pack.args(["-m", "fmu_manipulation_toolbox.cli.fmucontainer", "-fmi", standard, "-container"]);
        output(pack.arg(format!("{ssp}:1e-4")));
        for (ours, theirs) in simulate(&ssp).iter().zip(simulate(&container)) {
            assert!(ours.iter().any(|x| x.abs() > 0.5) && ours.len() == 3001, "it moves");
            let apart = ours.iter().zip(&theirs).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            let is_known = if standard == "2" { apart <= 0.0 } else { apart > 0.1 && apart < 1.0 };
            assert!(is_known, "FMI {standard}: {apart}");
        }
    }
}

/// OMSimulator runs the systems of `fmu ssp` unchanged, without a warning, and gives the values of `fmu simulate` to the 12
/// printed digits.
#[test]
#[ignore = "needs OMSimulator in PATH: half a minute"]
fn omsimulator() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let value = |name: &str, typed: &str| format!("<ssv:Parameter name=\"{name}\"><ssv:{typed}/></ssv:Parameter>");
    let values = value("speed_ref", "Real value=\"50\"") + &value("estimator", "Enumeration value=\"Sensored\"");
    let uri = "http://ssp-standard.org/SSP1/SystemStructureParameterValues";
    let set = format!("<ssv:ParameterSet xmlns:ssv=\"{uri}\" version=\"1.0\" name=\"x\"><ssv:Parameters>{values}");
    fs::write(path("x.ssv"), set + "</ssv:Parameters></ssv:ParameterSet>").unwrap();
    let of_controller = format!("controller={}", path("x.ssv"));
    let fmu = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    };
    for standard in ["2", "3"] {
        let name = |what: &str| path(&format!("fmi{standard}{what}"));
        let (ssp, csv, results, home) = (name(".ssp"), name(".csv"), name("-results.csv"), name("-home"));
        let archives = common::archives().to_str().unwrap();
        fmu(&["ssp", "--fmus", archives, "--fmi", standard, "--parameters", &of_controller, "--out", &ssp]);
        fmu(&["simulate", &ssp, "--stop", "0.3", "--csv", &csv]);
        fs::create_dir(&home).unwrap();
        let mut command = Command::new("OMSimulator");
        command.args(["--stopTime=0.3", &format!("--resultFile={results}"), &ssp]).current_dir(&home);
        let output = command.output().expect("OMSimulator in PATH");
        let said = String::from_utf8_lossy(&output.stdout);
        let complaint = said.lines().find(|line| ["warning:", "error:"].iter().any(|word| line.starts_with(word)));
        assert!(output.status.success() && complaint.is_none(), "FMI {standard}: {said}");
        let [ours, theirs] = [csv, results].map(|file| fs::read_to_string(file).unwrap());
        let theirs = theirs.replace(", ", ",");
        // It writes instants twice, before and after the exchange, and may end with one more step of a rounding error.
        let instants = |csv: &str| column(csv, "time").iter().map(|t| (t / 1e-4).round()).collect::<Vec<_>>();
        let (at, at_theirs) = (instants(&ours), instants(&theirs));
        for variable in ["speed", "speed_est", "i_a", "i_q", "tau_e", "p_in", "energy_in"] {
            let (ours, theirs) =
                (column(&ours, variable), column(&theirs, &format!("SensorlessDrive.SensorlessDrive.{variable}")));
            let scale = ours.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            assert!(scale > 0.1, "{variable} moves");
            for (k, x) in ours.iter().enumerate().take(ours.len() - 1) {
                let row = at_theirs.iter().rposition(|instant| instant.total_cmp(&at[k]).is_eq()).expect("the instant");
                assert!((x - theirs[row]).abs() < 1e-10 * scale, "FMI {standard}, {variable}: {x}, {}", theirs[row]);
            }
        }
        println!("OMSimulator, FMI {standard}: {} instants equal", at.len() - 1);
    }
}

/// A command of Cargo that builds bindings to C headers: libclang comes from PyPI, the headers of the compiler from gcc.
fn cargo_with_libclang(arguments: &[&str]) -> Command {
    let python = environment(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rust-fmi/requirements.txt"));
    let find = "import clang, pathlib; print(pathlib.Path(clang.__file__).parent / 'native', end='')";
    let libclang = Command::new(python).args(["-c", find]).output().expect("the Python of the virtual environment");
    let gcc = Command::new("gcc").arg("-print-file-name=include").output().expect("gcc, for its headers");
    let text = |output: process::Output| String::from_utf8_lossy(&output.stdout).trim().to_owned();
    let mut command = Command::new(env!("CARGO"));
    command
        .args(arguments)
        .env("LIBCLANG_PATH", text(libclang))
        .env("BINDGEN_EXTRA_CLANG_ARGS", format!("-I{}", text(gcc)))
        .env("CARGO_TARGET_DIR", scratch().join("rust-fmi"));
    command
}

/// rust-fmi's crate `fmi` runs the pair of the FMI 2.0 archives. (Its FMI 3.0 reader does not support units on variables.)
#[test]
#[ignore = "needs crates.io and PyPI, and builds 160 packages: some minutes"]
fn rust_fmi() {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rust-fmi/Cargo.toml");
    let mut command = cargo_with_libclang(&["run", "--locked", "--release", "--manifest-path"]);
    let output =
        command.arg(manifest).arg("--").arg(common::archives().join("fmi2")).arg(references()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    print!("{said}");
    assert_eq!(said.matches("bit for bit").count(), importers::experiments().len());
}

/// fmi-sim runs the whole drive in steps of 1 ms from the archives of both standards.
#[test]
#[ignore = "needs crates.io and PyPI, and builds fmi-sim: ten minutes"]
fn fmi_sim() {
    let root = scratch().join("fmi-sim");
    let program = root.join("bin").join(format!("fmi-sim{}", env::consts::EXE_SUFFIX));
    if !program.exists() {
        let mut install = cargo_with_libclang(&["install", "fmi-sim", "--version", "0.7.0", "--locked", "--root"]);
        run(install.arg(&root), "fmi-sim 0.7.0").unwrap_or_else(|why| panic!("{why}"));
    }
    let [fmi2, fmi3] = ["fmi2", "fmi3"].map(|standard| common::archives().join(standard).join("PmsmDrive.fmu"));
    let folder = tempfile::tempdir().unwrap();
    let fmi3_without_units = folder.path().join("without-units.fmu");
    common::rewrite(&fmi3, &fmi3_without_units, |name, bytes| {
        Some(if name == "modelDescription.xml" { without_units(&String::from_utf8(bytes).unwrap()) } else { bytes })
    });
    for experiment in importers::experiments() {
        // At the time of a jump fmi-sim applies the value before it in FMI 2.0, the one after it in FMI 3.0.
        let native = importers::drive_speed(&experiment, DRIVE_STEP);
        assert_same(&run_fmi_sim(&program, &fmi2, &experiment).unwrap(), &native, "FMI 2.0", &experiment);
        let native = importers::drive_speed(&experiment, 0.0);
        let speed = run_fmi_sim(&program, &fmi3_without_units, &experiment).unwrap();
        assert_same(&speed, &native, "FMI 3.0", &experiment);
        // If this fails, the copy above is no longer needed: run the original archive, and correct docs/import.md.
        let refused = run_fmi_sim(&program, &fmi3, &experiment).expect_err("units of FMI 3.0 are read now");
        assert!(refused.contains("unknown field"), "{refused}");
    }
}

/// fmi-sim 0.7 does not support `A` and `K` of a unit, `unit`, `displayUnit`, `unbounded` and `nominal` of a variable in FMI 3.0.
fn without_units(xml: &str) -> Vec<u8> {
    let (before, rest) = xml.split_once("<UnitDefinitions>").unwrap();
    let (_, after) = rest.split_once("</UnitDefinitions>").unwrap();
    let mut text = format!("{before}{after}");
    for attribute in [" unit=\"", " displayUnit=\"", " unbounded=\"", " nominal=\""] {
        let mut parts = text.split(attribute);
        let mut kept = parts.next().unwrap().to_owned();
        kept.extend(parts.map(|part| part.split_once('"').unwrap().1));
        text = kept;
    }
    text.into_bytes()
}

/// The drive's speed at every step, or fmi-sim's message.
fn run_fmi_sim(program: &Path, archive: &Path, experiment: &Experiment) -> Result<Vec<f64>, String> {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.csv"), folder.path().join("out.csv"));
    fs::write(&input, steps_as_csv(experiment)).unwrap();
    let status = Command::new(program)
        .arg("--model")
        .arg(archive)
        .arg("--input-file")
        .arg(&input)
        .arg("--output-file")
        .arg(&output)
        .arg("co-simulation")
        .args(["--output-interval", &DRIVE_STEP.to_string(), "-f", &experiment.duration.to_string()])
        .args(["--init-values", &format!("plant.initial.theta_e={:?}", experiment.theta_e)])
        .stdout(Stdio::null())
        .output()
        .unwrap();
    if !status.status.success() {
        return Err(String::from_utf8_lossy(&status.stderr).into_owned());
    }
    Ok(column(&fs::read_to_string(&output).unwrap(), "speed"))
}

fn assert_same(speed: &[f64], native: &[f64], standard: &str, experiment: &Experiment) {
    let name = experiment.name;
    assert_eq!(speed.len(), native.len(), "{standard}, {name}");
    for (k, (value, expected)) in speed.iter().zip(native).enumerate() {
        assert_eq!(value.to_bits(), expected.to_bits(), "{standard}, {name}, {k} ms: {value}, native {expected}");
    }
    assert!(speed.iter().any(|n| n.abs() > 10.0), "the rotor moved");
    println!("fmi-sim, {standard}, {name}: {} points equal, bit for bit", speed.len());
}

/// The experiment's inputs in the form for fmi-sim: interpolated between rows, with two rows at the time of a jump.
fn steps_as_csv(experiment: &Experiment) -> String {
    let inputs = |t: f64| (importers::at(&experiment.speed_ref, t), importers::at(&experiment.load, t));
    let jumps = experiment.speed_ref.iter().chain(&experiment.load).map(|(t, _)| *t);
    let mut rows = vec![(0.0, inputs(0.0))];
    for t in jumps {
        rows.extend([(t, rows[rows.len() - 1].1), (t, inputs(t))]);
    }
    rows.push((experiment.duration, inputs(experiment.duration)));
    let row = |(t, (speed_ref, load)): &(f64, (f64, f64))| format!("{t:?},{speed_ref:?},{load:?},325.0\n");
    format!("time,speed_ref,tau_load,u_dc\n{}", rows.iter().map(row).collect::<String>())
}

/// A column of a CSV file by its title.
fn column(csv: &str, title: &str) -> Vec<f64> {
    let mut lines = csv.lines().map(|line| line.split(','));
    let index = lines.next().unwrap().position(|name| name.trim_matches('"') == title).expect("the column");
    lines.map(|mut fields| fields.nth(index).unwrap().parse().unwrap()).collect()
}
