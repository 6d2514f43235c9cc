//! `fmu build`: compiles models and packs them, and writes the files of a release.

use super::page::{self, Page};
use super::{preset, tune};
use anyhow::{Context, Result, bail};
pub use cargo_fmu::build::Models;
use cargo_fmu::build::{self, choose};
use cargo_fmu::message;
use clap::Args;
use fmu_import::elf::{FLOOR, Needs};
use fmu_pack::archive::GenerationTime;
use fmu_pack::compile::{Profile, program};
use fmu_pack::release;
use fmu_pack::target::{Tools, ZIG, has_modules};
use fmu_pack::workspace::Workspace;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The command: models, or a release.
#[derive(Debug, Default, Args)]
pub struct Build {
    #[command(flatten)]
    /// What is built, and how.
    pub models: Models,
    /// Write all files of a release to this folder
    ///
    /// The archives, with a binary for each of Linux, Windows and macOS that can be built here; pages/NAME.html (fmu page);
    /// presets/MACHINE.PmsmDrive.fmu for each file of motors/; wheels/, the Python package fmurun with these archives, if python3 (or
    /// PYTHON) has maturin and ziglang; SHA256SUMS; sbom.cdx.json with the crates in them and their licenses (CycloneDX); and, in the
    /// workspace that has them, the programs fmu, cargo-fmu and fmu-check for this computer, which need no other library if
    /// cargo-zigbuild builds them:
    ///   fmu build --release-dir release
    #[arg(long, value_name = "DIR", conflicts_with_all = ["package", "library", "resources", "out", "dev", "keep_symbols"], verbatim_doc_comment)]
    pub release_dir: Option<PathBuf>,
}

/// Runs the command; returns the files that were written.
///
/// # Errors
/// As [`build::run`].
pub fn run(args: &Build) -> Result<Vec<PathBuf>> {
    match &args.release_dir {
        Some(folder) => release(&args.models, folder),
        None => models(&args.models),
    }
}

/// Builds models; the archives of the drives have the parameters of an example.
///
/// # Errors
/// As [`build::run`].
pub fn models(args: &Models) -> Result<Vec<PathBuf>> {
    build::run(args, tune::example_for)
}

/// Targets of a release.
const RELEASED: [&str; 5] = [
    "x86_64-unknown-linux-gnu",
    "aarch64-unknown-linux-gnu",
    "x86_64-pc-windows-gnu",
    "x86_64-apple-darwin",
    "aarch64-apple-darwin",
];

/// Packages with the programs of a release, if the workspace contains them.
const PROGRAMS: [(&str, &str); 3] = [("fmu", "fmu"), ("cargo-fmu", "cargo-fmu"), ("fmu-check", "fmu-check")];

/// Writes all files of a release to a folder; returns them.
fn release(args: &Models, folder: &Path) -> Result<Vec<PathBuf>> {
    let (workspace, tools, moment) = (Workspace::find()?, Tools::find()?, GenerationTime::of_environment()?);
    let target = if args.target.is_empty() { available(&tools) } else { args.target.clone() };
    let (fmus, fmi, linux64) = (args.fmus.clone(), args.fmi.clone(), args.linux64);
    let mut packages: Vec<String> = choose(&workspace.fmus(), &fmus)?.iter().map(|p| p.name.clone()).collect();
    let mut written = models(&Models {
        fmus,
        fmi,
        target,
        linux64,
        out: Some(folder.into()),
        profile: Profile::Distribution,
        ..Models::default()
    })?;
    for (package, name) in PROGRAMS {
        if !workspace.package(package).is_some_and(|p| workspace.is_member(p)) {
            continue;
        }
        let built = program(&workspace, package, name, &tools.host())?;
        let bytes = fs::read(&built).with_context(|| built.display().to_string())?;
        if let Ok(needs) = Needs::of(&bytes)
            && !needs.are_modest()
        {
            message::note(&format!(
                "{name} requires {needs}; built with cargo-zigbuild ({ZIG}) it requires at most {FLOOR}"
            ));
        }
        let path = folder.join(built.file_name().unwrap_or_default());
        fs::copy(&built, &path).with_context(|| path.display().to_string())?;
        written.push(path);
        packages.push(package.into());
    }
    match has_modules() {
        Ok(()) => {
            let (fmus, package, module, site) = (args.fmus.clone(), Vec::new(), None, None);
            written.extend(page::run(&Page { fmus, package, out: Some(folder.join("pages")), module, site })?);
        }
        Err(why) => message::note(&format!("left out: pages that run the FMUs: {why:#}")),
    }
    written.extend(presets(&workspace, folder)?);
    match wheels(&workspace, folder) {
        Ok(files) => written.extend(files),
        Err(why) => message::note(&format!("left out: wheels of fmurun: {why:#}")),
    }
    packages.dedup();
    let others = release::finish(&workspace, &packages, folder, &written, moment)?;
    Ok(written.into_iter().chain(others).collect())
}

/// `PmsmDrive` with the start values of each machine of the workspace: presets/MACHINE.PmsmDrive.fmu.
fn presets(workspace: &Workspace, folder: &Path) -> Result<Vec<PathBuf>> {
    let (motors, drive) = (workspace.root.join("motors"), folder.join("fmi3/PmsmDrive.fmu"));
    if !motors.is_dir() {
        return Ok(Vec::new());
    }
    if !drive.is_file() {
        message::note("left out: presets for the machines of motors/: they need PmsmDrive of FMI 3.0");
        return Ok(Vec::new());
    }
    let entries = fs::read_dir(&motors).with_context(|| motors.display().to_string())?;
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|file| file.extension().is_some_and(|e| e == "toml"));
    files.sort();
    let mut written = Vec::new();
    for file in files {
        let tuned = drive_tools::tune::tune(&file)?;
        let path = folder.join("presets").join(format!("{}.PmsmDrive.fmu", tuned.name));
        fs::create_dir_all(folder.join("presets"))?;
        preset::of_machine(&drive, &tuned, &path)?;
        written.push(path);
    }
    Ok(written)
}

/// The wheels of the Python package of the workspace, with these archives; its script reports those that it cannot build.
fn wheels(workspace: &Workspace, folder: &Path) -> Result<Vec<PathBuf>> {
    let script = workspace.root.join("python/build/wheels.py");
    if !script.is_file() {
        return Ok(Vec::new());
    }
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
    let has = Command::new(&python).args(["-c", "import maturin, ziglang"]).output();
    if !has.is_ok_and(|output| output.status.success()) {
        bail!(
            "{python} has no maturin or ziglang: pip install maturin==1.16.0 ziglang==0.17.1 (PYTHON names another Python)"
        );
    }
    let out = folder.join("wheels");
    let mut command = Command::new(&python);
    command.arg(&script).arg("--archives").arg(folder).arg("--out").arg(&out).stderr(Stdio::inherit());
    let output = command.env("CARGO_TARGET_DIR", &workspace.target).output().context(python)?;
    if !output.status.success() {
        bail!("{}: {}", script.display(), output.status);
    }
    Ok(String::from_utf8_lossy(&output.stdout).lines().map(PathBuf::from).collect())
}

/// The targets of a release that can be built here; notes list what is missing for the others.
fn available(tools: &Tools) -> Vec<String> {
    let can = |triple: &&str| match tools.target(triple) {
        Ok(_) => true,
        Err(why) => {
            message::note(&format!("left out: {why:#}"));
            false
        }
    };
    RELEASED.into_iter().filter(can).map(str::to_owned).collect()
}
