//! Tests written in Python: run with pytest in a separate virtual environment below Cargo's target folder, so that a machine
//! needs only Rust and Python 3.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Mutex;
use std::{env, fs, io, process};

/// Runs `files` of the folder tests/`folder`/ with pytest on freshly packed archives, with variables of the environment.
pub fn pytest(folder: &str, name: &str, files: &[&str], variables: &[(&str, &Path)]) {
    pytest_with("requirements.txt", folder, name, files, variables);
}

/// As [`pytest`], with the folder's file of `requirements`.
pub fn pytest_with(requirements: &str, folder: &str, name: &str, files: &[&str], variables: &[(&str, &Path)]) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(folder);
    let python = environment(&folder.join(requirements));
    let archives = super::archives();
    let temporary = scratch().join(format!("pytest-{name}-{}", process::id()));
    let output = Command::new(&python)
        .args(["-m", "pytest", "-q", "--tb=short", "--durations=3", "-p", "no:cacheprovider"])
        .arg("--basetemp")
        .arg(&temporary)
        .args(files)
        .current_dir(folder)
        .env("FMU_ARCHIVES", archives)
        .envs(variables.iter().copied())
        .env("LD_LIBRARY_PATH", libraries(&python))
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

/// The folder of shared libraries that packages link (tbb, which Ecos needs), and the previous search path.
fn libraries(python: &Path) -> std::ffi::OsString {
    let own = python.parent().and_then(Path::parent).map(|venv| venv.join("lib"));
    let inherited = env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    env::join_paths(own.into_iter().chain(env::split_paths(&inherited))).unwrap_or(inherited)
}

/// Bypasses the test harness, which hides the output of a passing test.
fn show(output: &Output) {
    let mut out = io::stdout().lock();
    let _ = out.write_all(&output.stdout).and_then(|()| out.write_all(&output.stderr)).and_then(|()| out.flush());
}

/// Cargo's folder for the files of integration tests.
pub fn scratch() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

/// The Python of a virtual environment with the packages of the file of requirements.
pub fn environment(requirements: &Path) -> PathBuf {
    // Two tests of one program may need the same environment; the second reuses it.
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    find_or_make(requirements).unwrap_or_else(|why| panic!("{why}"))
}

/// Finds the environment, or creates it. Its name contains a hash of the requirements and of its Python, and it gets its name
/// when it is complete, so an existing one can be used.
fn find_or_make(requirements: &Path) -> Result<PathBuf, String> {
    let (base, version) = base_python()?;
    let wanted = fs::read_to_string(requirements).map_err(|e| format!("{}: {e}", requirements.display()))?;
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
    // Python compiles what a test imports; to compile all of it takes as long as the rest of the installation.
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-compile", "--requirement"];
    run(
        Command::new(partial.join(inside)).args(install).arg(requirements),
        &format!("the packages of {} from a Python package index", requirements.display()),
    )?;
    // Another test program may have been faster: its environment is equivalent.
    if let Err(error) = fs::rename(&partial, &complete) {
        let _ = fs::remove_dir_all(&partial);
        if !complete.is_dir() {
            return Err(format!("{}: {error}", complete.display()));
        }
    }
    Ok(complete.join(inside))
}

/// A Python 3 and its version: `PYTHON`, or the usual names.
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

/// Runs a command to its end; an error is one line with the goal and the output of the command.
pub fn run(command: &mut Command, what: &str) -> Result<(), String> {
    let output =
        command.output().map_err(|e| format!("cannot get {what}: {}: {e}", command.get_program().to_string_lossy()))?;
    if output.status.success() {
        return Ok(());
    }
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned());
    Err(format!("cannot get {what}: {}: {}", output.status, said.join("\n").trim()))
}
