//! `fmu sweep`: the same bytes in every case, and one clear line for every error.
#![allow(missing_docs)]
#![cfg(unix)]

#[path = "../common/mod.rs"]
mod common;

mod failures;
mod same_bytes;
mod systems;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn fmu() -> Command {
    Command::new(env!("CARGO_BIN_EXE_fmu"))
}

/// A folder for one test.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A file of a sweep of the drive.
    fn define(&self, name: &str, text: &str) -> PathBuf {
        let drive = common::archives().join("fmi3/PmsmDrive.fmu");
        let text = format!("fmus = ['d={}']\n{text}", drive.display());
        fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    fn sweep(&self, file: &Path, out: &str) -> Command {
        let mut command = fmu();
        command.arg("sweep").arg(file).arg("--out").arg(self.path(out)).stdin(Stdio::null());
        command
    }

    /// All files of the results that must not differ, with their bytes.
    fn results(&self, out: &str) -> Vec<(String, Vec<u8>)> {
        let results = |name: &str| name == "results.csv" || name.starts_with("part-");
        let mut all: Vec<_> = names(&self.path(out)).into_iter().filter(|name| results(name)).collect();
        all.sort();
        all.into_iter().map(|name| (name.clone(), fs::read(self.path(out).join(name)).unwrap())).collect()
    }

    fn rows(&self, out: &str) -> Vec<String> {
        let text = fs::read_to_string(self.path(out).join("results.csv")).unwrap();
        text.lines().skip(1).map(str::to_owned).collect()
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).map(|all| all.map(|e| e.unwrap().file_name().into_string().unwrap()).collect());
    entries.unwrap_or_default()
}

/// Runs to the end; returns standard error.
fn ends(command: &mut Command, status: i32) -> String {
    let Output { status: found, stderr, stdout } = command.output().unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert_eq!(found.code(), Some(status), "{command:?}: {said}{}", String::from_utf8_lossy(&stdout));
    said
}

/// 400 starts in 40 parts, about 1 s of work.
const STARTS: &str = "stop = 0.4\nstep = 1e-3\ninput.'d.speed_ref' = '0:0,0.05:104.72'\n\
    design = { kind = 'sobol', runs = 400, seed = 7, part = 10 }\n\
    [vary]\n'd.plant.motor.R_s' = { normal = [3.0, 0.15], within = [2.5, 3.5] }\n\
    'd.controller.motor.R_s' = { same = 'd.plant.motor.R_s', times = 0.9 }\n\
    'd.tau_load' = { values = [0, 0.5, 1] }\n\
    [measure]\npeak = { of = 'd.speed', is = 'max' }\nlast = { of = 'd.speed', is = 'final' }\n\
    angle = { of = 'd.theta_est - d.theta_e', wrap = '2pi', is = 'rms', after = 0.005 }\n";
