//! The archives of the Reference-FMUs in Rust.

use fmu::commands::build::{self, Build};
use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The archive of a model, of FMI 2.0 or FMI 3.0: a library as Cargo's tests are built.
pub fn archive(model: &str, standard: usize) -> PathBuf {
    let package: String = model.chars().enumerate().fold(String::new(), |name, (i, c)| {
        let dash = if i > 0 && c.is_uppercase() { "-" } else { "" };
        name + dash + &c.to_lowercase().to_string()
    });
    let target = super::common::python::scratch().parent().unwrap().to_owned();
    let profile = if cfg!(debug_assertions) { "debug" } else { "release" };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--quiet", "--locked", "--package", &package, "--target-dir"]).arg(&target);
    if profile == "release" {
        cargo.arg("--release");
    }
    assert!(cargo.current_dir(env!("CARGO_MANIFEST_DIR")).status().unwrap().success(), "{package} compiles");
    let library = target.join(profile).join(format!("{DLL_PREFIX}{}{DLL_SUFFIX}", package.replace('-', "_")));
    let resources = Path::new("examples/reference-fmus").join(&package).join("resources");
    let build = Build {
        library: vec![library.display().to_string()],
        resources: resources.is_dir().then_some(resources),
        out: Some(super::common::python::scratch().join("orders")),
        ..Build::default()
    };
    let files = build::run(&build).unwrap();
    let folder = ["fmi2", "fmi3"][standard];
    files.into_iter().find(|file| file.parent().is_some_and(|parent| parent.ends_with(folder))).unwrap()
}
