//! Packages of this workspace as FMUs.

use fmu::commands::build::{self, Models};
use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The archives of the package in `folder` of this workspace, of FMI 2.0 and of FMI 3.0, in `out`, with the resources of `folder`.
pub fn packed(folder: &str, package: &str, out: &Path) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let library = library(package);
    let resources = root.join(folder).join("resources");
    let build = Models {
        library: vec![library.display().to_string()],
        resources: resources.is_dir().then_some(resources),
        out: Some(out.into()),
        ..Models::default()
    };
    build::models(&build).unwrap()
}

/// The library of a package, with the profile of the tests: from `FMU_TEST_LIBRARIES`, set by `.ci/run`, or built here. A build of one
/// package has other features of its dependencies than the whole workspace, so that it compiles most of them again.
pub fn library(package: &str) -> PathBuf {
    let name = format!("{DLL_PREFIX}{}{DLL_SUFFIX}", package.replace('-', "_"));
    if let Some(folder) = std::env::var_os("FMU_TEST_LIBRARIES") {
        return Path::new(&folder).join(name);
    }
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let profile = if cfg!(debug_assertions) { "debug" } else { "release" };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--quiet", "--locked", "--package", package, "--target-dir"]).arg(target);
    if profile == "release" {
        cargo.arg("--release");
    }
    assert!(cargo.current_dir(env!("CARGO_MANIFEST_DIR")).status().unwrap().success(), "{package} compiles");
    target.join(profile).join(name)
}
