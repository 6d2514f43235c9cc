//! The packed FMUs in a foreign importer: FMPy validates and co-simulates them, and a suite of host sins calls their C
//! interface through ctypes. The tests themselves are in `tests/fmpy/`; this runs them with pytest in a virtual
//! environment of their own, so that Rust and Python 3 are all that a machine needs.
#![allow(missing_docs)]

mod common;

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use std::{env, fs, io, process};

#[test]
fn fmpy_validates_and_cosimulates() {
    pytest("fmpy", &["test_validate.py", "test_controller.py", "test_cosimulation.py", "test_simulate_fmu.py"]);
}

#[test]
fn misuse_of_the_c_interface() {
    pytest("misuse", &["test_misuse.py"]);
}

#[test]
fn every_estimator_as_natively() {
    pytest("estimators", &["test_estimators.py"]);
}

/// Runs files of `tests/fmpy/` on freshly packed archives.
fn pytest(name: &str, files: &[&str]) {
    let python = python();
    let archives = common::archives();
    let temporary = scratch().join(format!("pytest-{name}-{}", process::id()));
    let output = Command::new(python)
        .args(["-m", "pytest", "-q", "--tb=short", "--durations=3", "-p", "no:cacheprovider"])
        .arg("--basetemp")
        .arg(&temporary)
        .args(files)
        .current_dir(folder())
        .env("FMU_ARCHIVES", archives)
        .env("FMU_ESTIMATORS", estimators())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env_remove("PYTHONPATH")
        .env_remove("PYTEST_ADDOPTS")
        .output()
        .expect("the Python of the virtual environment");
    let _ = fs::remove_dir_all(&temporary);
    show(&output);
    assert!(output.status.success(), "pytest {}: {}", files.join(" "), output.status);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains(" passed"), "pytest ran no test");
}

/// Past the test harness, which keeps what is printed to itself when a test passes.
fn show(output: &Output) {
    let mut out = io::stdout().lock();
    let _ = out.write_all(&output.stdout).and_then(|()| out.write_all(&output.stderr)).and_then(|()| out.flush());
}

/// The file with the estimators' experiments and what came out natively.
fn estimators() -> &'static Path {
    static FILE: OnceLock<PathBuf> = OnceLock::new();
    FILE.get_or_init(|| {
        let file = scratch().join(format!("estimators-{}.json", process::id()));
        fs::write(&file, common::estimators::experiments().to_string()).expect("a file below the target folder");
        file
    })
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy")
}

/// Cargo's folder for the files of integration tests.
fn scratch() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

/// The Python of a virtual environment that has what `requirements.txt` says.
fn python() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| environment().unwrap_or_else(|why| panic!("{why}")))
}

/// Finds the environment, or makes it. Its name holds a hash of the requirements and of the Python that made it, and it
/// gets its name when it is complete: one that exists can be used.
fn environment() -> Result<PathBuf, String> {
    let (base, version) = base_python()?;
    let requirements = folder().join("requirements.txt");
    let wanted = fs::read_to_string(&requirements).map_err(|e| format!("{}: {e}", requirements.display()))?;
    let mut hasher = DefaultHasher::new();
    (&wanted, &version).hash(&mut hasher);
    let complete = scratch().join(format!("venv-{:016x}", hasher.finish()));
    let inside = if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" };
    if complete.is_dir() {
        return Ok(complete.join(inside));
    }
    let partial = scratch().join(format!("venv-partial-{}", process::id()));
    let _ = fs::remove_dir_all(&partial);
    run(
        Command::new(base).args(["-m", "venv"]).arg(&partial),
        "a virtual environment (on Debian: package python3-venv)",
    )?;
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement"];
    run(
        Command::new(partial.join(inside)).args(install).arg(&requirements),
        "the packages of tests/fmpy/requirements.txt from a Python package index",
    )?;
    // Another test program may have been faster: then its environment is as good.
    if let Err(error) = fs::rename(&partial, &complete) {
        let _ = fs::remove_dir_all(&partial);
        if !complete.is_dir() {
            return Err(format!("{}: {error}", complete.display()));
        }
    }
    Ok(complete.join(inside))
}

/// A Python 3 and what it says of itself: `PYTHON`, or the usual names.
fn base_python() -> Result<(String, String), String> {
    let named = env::var("PYTHON").ok();
    let usual = ["python3", "python"].map(String::from);
    let candidates = named.map_or_else(|| usual.to_vec(), |name| vec![name]);
    for name in &candidates {
        let ask = "import sys; assert sys.version_info >= (3, 10); print(sys.version, sys.executable)";
        let answer = Command::new(name).args(["-c", ask]).output();
        if let Ok(Output { status, stdout, .. }) = answer
            && status.success()
        {
            return Ok((name.clone(), String::from_utf8_lossy(&stdout).into_owned()));
        }
    }
    Err(format!(
        "these tests need Python 3.10 or later with venv and pip; tried {} (PYTHON names another)",
        candidates.join(", ")
    ))
}

/// Runs a command to its end; otherwise one line with what was to be had, and what the command said.
fn run(command: &mut Command, what: &str) -> Result<(), String> {
    let output =
        command.output().map_err(|e| format!("no {what}: {}: {e}", command.get_program().to_string_lossy()))?;
    if output.status.success() {
        return Ok(());
    }
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned());
    Err(format!("no {what}: {}: {}", output.status, said.join("\n").trim()))
}
