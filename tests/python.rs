//! The Python package `fmurun`, built and installed from `python/`: its tests in `python/tests/`, its examples, its figures.
#![allow(missing_docs)]

mod common;

use common::python::{environment, pytest_with, run, scratch};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::{env, fs, process};

const TESTS: &str = "../python/tests";

/// The folder that the package is installed in, once a test program.
fn installed() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
        let python = environment(&package.join("tests/requirements.txt"));
        let folder = scratch().join(format!("fmurun-{}", process::id()));
        let programs = python.parent().expect("python is in a folder").to_owned();
        let path =
            env::join_paths([programs].into_iter().chain(env::split_paths(&env::var_os("PATH").unwrap_or_default())));
        let mut pip = Command::new(&python);
        pip.args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--no-deps",
            "--no-build-isolation",
        ]);
        // maturin is in the environment; it builds in this workspace's target folder.
        pip.arg("--target").arg(&folder).arg(&package).env("PATH", path.expect("a search path"));
        run(&mut pip, "package fmurun").unwrap_or_else(|why| panic!("{why}"));
        folder
    })
}

fn tests(name: &str, files: &[&str]) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    pytest_with("requirements.txt", TESTS, name, files, &[("FMURUN", installed()), ("FMU_ROOT", root)]);
}

#[test]
fn the_package() {
    tests("fmurun", &["test_simulate.py", "test_fmpy.py", "test_batch.py"]);
    let _ = fs::remove_dir_all(installed());
}
