//! The Reference-FMUs of the Modelica Association, written again in Rust (examples/reference-fmus): the results that the
//! originals are known by, in this importer and in FMPy.
#![allow(missing_docs)]

#[path = "../common/mod.rs"]
mod common;
mod feedthrough;

use fmu::commands::build::{self, Build};
use fmu_import::Fmu;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The packages, built together.
const PACKAGES: [&str; 1] = ["feedthrough"];

/// Folder of the archives and of files of these tests.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| common::python::scratch().join("reference-fmus"))
}

/// The archive of FMI 3.0 of a package.
fn archive(package: &str) -> &'static Path {
    static FILES: OnceLock<BTreeMap<String, PathBuf>> = OnceLock::new();
    let files = FILES.get_or_init(|| {
        let package = PACKAGES.map(String::from).to_vec();
        let written = build::run(&Build { package, out: Some(folder().into()), ..Build::default() }).unwrap();
        let name = |file: &PathBuf| file.file_stem().unwrap().to_string_lossy().to_lowercase();
        written.into_iter().filter(|f| f.parent().unwrap().ends_with("fmi3")).map(|f| (name(&f), f)).collect()
    });
    &files[&package.replace('-', "")]
}

fn open(package: &str) -> Fmu {
    Fmu::open(archive(package)).unwrap()
}

/// What the checker finds in an archive, but for the linker's matters.
fn checks(package: &str) {
    let program = Some(PathBuf::from(env!("CARGO_BIN_EXE_fmu")));
    let options = fmu_check::Options { program, ..Default::default() };
    let report = fmu_check::run(archive(package), &options).unwrap();
    let found = report.violated().filter(|f| !["B03", "B04"].contains(&f.id)).count();
    assert_eq!(found, 0, "{}", report.text(false));
}

/// Runs a script with FMPy.
fn fmpy(script: &str, arguments: &[&Path]) {
    let requirements = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy/requirements.txt");
    let mut python = Command::new(common::python::environment(&requirements));
    let output = python.args(["-c", script]).args(arguments).env_remove("PYTHONPATH").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
