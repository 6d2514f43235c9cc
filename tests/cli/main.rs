//! The command line: its output, its files, its exit status.
#![allow(missing_docs)]

#[path = "../common/mod.rs"]
mod common;

mod map;
#[cfg(unix)]
mod pages;
mod simulate;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// The arguments fail with this status and one line that contains all of these.
fn fails(arguments: &[&str], status: i32, parts: &[&str]) {
    let output = fmu(arguments);
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{arguments:?}: {error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    for part in std::iter::once(&"error: ").chain(parts) {
        assert!(error.contains(part), "{arguments:?}: {part:?} is not in {error}");
    }
}

/// The first word of a message and the help are colored only on a terminal; files and pipes are colored on request.
#[test]
fn color_is_for_terminals() {
    let said = |arguments: &[&str], variables: &[(&str, &str)]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
        for name in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
            command.env_remove(name);
        }
        let output = command.args(arguments).envs(variables.iter().copied()).output().unwrap();
        text(&output.stderr) + &text(&output.stdout)
    };
    let drive = archive("fmi3", "PmsmDrive");
    for arguments in [&["info", "no.fmu"][..], &["simulate", drive.to_str().unwrap(), "--stop", "0.01"], &["--help"]] {
        let plain = said(arguments, &[]);
        assert!(!plain.contains('\x1b'), "{plain}");
        let forced = said(arguments, &[("CLICOLOR_FORCE", "1")]);
        assert!(forced.contains("\x1b["), "{forced}");
        assert_eq!(said(arguments, &[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]), plain);
    }
}

fn archive(standard: &str, name: &str) -> PathBuf {
    common::archives().join(standard).join(name).with_extension("fmu")
}

#[test]
fn info_tells_what_an_fmu_is() {
    for (standard, version) in [("fmi2", "FMI 2.0"), ("fmi3", "FMI 3.0")] {
        let drive = archive(standard, "PmsmDrive");
        let printed = text(&fmu(&["info", drive.to_str().unwrap()]).stdout);
        for part in [
            version,
            "Co-Simulation and Model Exchange",
            "step 0.001 s",
            "inputs (",
            "speed_ref",
            "0 rad/s",
            "Rasmussen",
        ] {
            assert!(printed.contains(part), "{part}: {printed}");
        }
        let limits = text(&fmu(&["info", drive.to_str().unwrap(), "limit"]).stdout);
        assert!(limits.contains("controller.limit.i ") && !limits.contains("speed_ref"), "{limits}");
    }
    fails(&["info", "Cargo.toml"], 2, &["Cargo.toml: "]);
    assert!(text(&fmu(&["completions", "bash"]).stdout).contains("--auto-connect"));
}

/// Two builds agree byte for byte, and contain no local paths.
#[test]
fn builds_are_reproducible() {
    let dir = tempfile::tempdir().unwrap();
    let build = |name: &str| {
        let out = dir.path().join(name);
        let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
        command.args(["build", "PmsmPlant", "--out"]).arg(&out).env("SOURCE_DATE_EPOCH", "1700000000");
        assert!(command.output().unwrap().status.success());
        ["fmi2", "fmi3"].map(|standard| std::fs::read(out.join(standard).join("PmsmPlant.fmu")).unwrap())
    };
    assert!(build("a") == build("b"), "two builds differ");
    let root = env!("CARGO_MANIFEST_DIR").as_bytes();
    let mut zip = zip::ZipArchive::new(File::open(dir.path().join("a/fmi3/PmsmPlant.fmu")).unwrap()).unwrap();
    for index in 0..zip.len() {
        let mut bytes = Vec::new();
        std::io::copy(&mut zip.by_index(index).unwrap(), &mut bytes).unwrap();
        assert!(!bytes.windows(root.len()).any(|w| w == root), "entry {index} names {}", env!("CARGO_MANIFEST_DIR"));
    }
}

#[test]
fn help_has_an_example_for_the_pair() {
    let help = text(&fmu(&["simulate", "--help"]).stdout);
    assert!(help.contains("PmsmPlant.fmu target/fmu/fmi3/SensorlessController.fmu --auto-connect"), "{help}");
    assert!(text(&fmu(&["build", "--help"]).stdout).contains("fmu build --package own-fmu"));
}

/// An atlas writes its files with the same bytes for any number of jobs, and refuses requests that cannot be run.
#[test]
fn an_atlas_is_written_or_refused() {
    let dir = tempfile::tempdir().unwrap();
    let run = |jobs: &str, out: &str| {
        let out = dir.path().join(out);
        let cells = [
            "atlas",
            "--resistance",
            "0.9",
            "--flux",
            "1",
            "--load",
            "0,-1",
            "--speed",
            "0.01",
            "--jobs",
            jobs,
            "--out",
        ];
        let output = fmu(&[&cells[..], &[out.to_str().unwrap()]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(text(&output.stdout).contains("| 1 of 2 (50 %) |"), "{}", text(&output.stdout));
        ["atlas.csv", "atlas.md", "atlas.html", "atlas-Rasmussen.svg"]
            .map(|name| std::fs::read(out.join(name)).unwrap())
    };
    let [.., page, map] = run("1", "a");
    common::pages::stands_alone(&text(&page), |file| file == "atlas.csv");
    // A map explains its dots, on the page, in the file and in the documentation.
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let kept = std::fs::read_to_string(root.join("docs/atlas-Rasmussen.svg")).unwrap();
    for part in ["white dot: lost, and lock_lost does not report it", "red dot: held although lock_lost"] {
        for drawn in [&text(&map), &text(&page), &kept] {
            assert!(drawn.contains(part), "{part}");
        }
    }
    let words = std::fs::read_to_string(root.join("docs/atlas.md")).unwrap();
    assert!(words.contains("A white dot marks a lost cell that `lock_lost` does not report"));
    assert!(run("1", "a") == run("2", "b"));
    for (arguments, parts) in [
        (&["--load="][..], &["--load has no value", "at least one", "leave the option out"][..]),
        (&["--scenario="], &["--scenario has no value"]),
        (&["--estimator="], &["--estimator has no value"]),
        (&["--flux", "-1"], &["--flux -1: must be within 0.1..10; correct the value"]),
        (&["--speed", "fast"], &["--speed fast: is not a number; write for example --speed 0.9,1"]),
        (&["--every", "0"], &["--every 0: must be 1 or more"]),
        (&["--scenario", "storm"], &["--scenario storm: unknown scenario; available: load, speed, heating"]),
        (&["--estimator", "Luenberger"], &["--estimator Luenberger: unknown estimator; available: Rasmussen"]),
        (&["--set", "R=1"], &["--set R: is not a parameter of SensorlessController"]),
        (
            &["--estimator", "ExtendedEmf", "--set", "adaptation.resistance=true"],
            &["adaptation.resistance = true is not allowed with estimator = 4 (ExtendedEmf)"],
        ),
        (&["none.toml"], &["reading none.toml"]),
    ] {
        fails(&[&["atlas"][..], arguments].concat(), 2, parts);
    }
}
