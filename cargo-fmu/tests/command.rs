//! The command as Cargo runs it.
#![allow(missing_docs)]

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX, EXE_SUFFIX};
use std::path::Path;
use std::process::{Command, Output};
use std::{env, fs};

/// `cargo fmu ...` in a folder; `programs` comes first in PATH.
fn cargo_fmu(folder: &Path, programs: &Path, arguments: &[&str]) -> Output {
    let own = Path::new(env!("CARGO_BIN_EXE_cargo-fmu"));
    let mut command = Command::new(own);
    let cargo = Path::new(env!("CARGO")).parent().unwrap();
    command.env("PATH", env::join_paths([programs, cargo, Path::new("/usr/bin"), Path::new("/bin")]).unwrap());
    command.arg("fmu").args(arguments).current_dir(folder).output().unwrap()
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

#[test]
fn cargo_runs_it_as_a_subcommand() {
    let dir = tempfile::tempdir().unwrap();
    let programs = Path::new(env!("CARGO_BIN_EXE_cargo-fmu")).parent().unwrap();
    let path =
        env::join_paths([programs.to_owned()].into_iter().chain(env::split_paths(&env::var_os("PATH").unwrap())));
    let output = Command::new(env!("CARGO")).args(["fmu", "--version"]).env("PATH", path.unwrap()).output().unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), format!("cargo fmu {}\n", env!("CARGO_PKG_VERSION")));
    let help = said(&cargo_fmu(dir.path(), dir.path(), &["build", "--help"]));
    assert!(help.contains("Usage: cargo fmu build") && help.contains("\n  cargo fmu build --target"), "{help}");
}

#[test]
fn a_folder_without_an_fmu_is_refused_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |parts: &[&str]| {
        let output = cargo_fmu(dir.path(), dir.path(), &["build"]);
        let said = said(&output);
        assert!(output.status.code() == Some(2) && said.lines().count() == 1, "{said}");
        for part in parts {
            assert!(said.contains(part), "{part}: {said}");
        }
    };
    let here = dir.path().display().to_string();
    refused(&["error: no Cargo package here: expected a Cargo.toml in ", &here, "fmu new my-model"]);
    // A package that is not an FMU.
    let manifest = "[package]\nname = \"plain\"\nversion = \"0.1.0\"\nedition = \"2024\"\n[workspace]\n";
    fs::write(dir.path().join("Cargo.toml"), manifest).unwrap();
    fs::create_dir(dir.path().join("src")).unwrap();
    fs::write(dir.path().join("src/lib.rs"), "").unwrap();
    refused(&["error: no FMU package here: expected crate-type = [\"cdylib\"] and the dependency fmu-export"]);
    fs::write(dir.path().join("Cargo.toml"), "[package]\nname = 1\n").unwrap();
    refused(&["error: cargo metadata: "]);
}

/// A command that this program lacks is that of `fmu`, with its output and its exit status.
#[cfg(unix)]
#[test]
fn other_commands_are_passed_to_fmu() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let output = cargo_fmu(dir.path(), dir.path(), &["check", "x.fmu"]);
    let text = said(&output);
    assert!(output.status.code() == Some(2) && text.lines().count() == 1, "{text}");
    assert!(text.starts_with("error: check: is not a command of cargo fmu, which has new, build, info and simulate"));
    let program = dir.path().join(format!("fmu{EXE_SUFFIX}"));
    fs::write(&program, "#!/bin/sh\necho \"$@\"\nexit 7\n").unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    let output = cargo_fmu(dir.path(), dir.path(), &["check", "--strict", "x.fmu"]);
    assert_eq!((said(&output).as_str(), output.status.code()), ("check --strict x.fmu\n", Some(7)));
}

/// A model that does not return, takes all memory or crashes while it is described ends its own process, and the build names the library.
#[cfg(target_os = "linux")]
#[test]
fn a_model_that_hangs_or_crashes_ends_with_an_error() {
    let dir = tempfile::tempdir().unwrap();
    for (name, body, timeout, part) in [
        ("hangs", "for (;;) {}", "1", "did not return within 1 s; --timeout changes the limit"),
        ("takes", "for (;;) memset(malloc(1 << 28), 1, 1 << 28);", "60", "ended the process by SIGSEGV"),
        ("aborts", "abort();", "60", "ended the process by SIGABRT"),
    ] {
        let source =
            format!("#include <stdlib.h>\n#include <string.h>\nint fmu_description(void) {{ {body} return 0; }}\n");
        fs::write(dir.path().join("model.c"), source).unwrap();
        let library = format!("lib{name}.so");
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-O0", "-o", &library, "model.c"]).current_dir(dir.path());
        assert!(compiler.status().unwrap().success());
        let arguments = ["build", "--library", &library, "--out", "out", "--timeout", timeout, "--memory", "1"];
        let output = cargo_fmu(dir.path(), dir.path(), &arguments);
        let text = said(&output);
        assert!(output.status.code() == Some(2) && text.lines().count() == 1, "{text}");
        let begins = format!("/{library}: describing the model");
        assert!(text.starts_with("error: ") && text.contains(&begins) && text.contains(part), "{text}");
        let limit = text.contains("; its address space is limited to 1 GiB: --memory changes the limit");
        assert_eq!(limit, name != "hangs", "{text}");
        assert!(!dir.path().join("out").exists());
    }
}

/// From a compiled model to a curve. The process of the FMU is started by the same program.
#[test]
fn it_packs_and_runs_a_model() {
    let dir = tempfile::tempdir().unwrap();
    let name = format!("{DLL_PREFIX}own_fmu{DLL_SUFFIX}");
    // Built by `.ci/run`, or here.
    let library = if let Some(folder) = env::var_os("FMU_TEST_LIBRARIES") {
        Path::new(&folder).join(name)
    } else {
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let profile = if cfg!(debug_assertions) { "debug" } else { "release" };
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["build", "--quiet", "--locked", "--package", "own-fmu", "--target-dir"]).arg(target);
        if profile == "release" {
            cargo.arg("--release");
        }
        assert!(cargo.current_dir(root).status().unwrap().success());
        target.join(profile).join(name)
    };
    let output = cargo_fmu(
        dir.path(),
        dir.path(),
        &["build", "--library", library.to_str().unwrap(), "--out", ".", "--fmi", "3"],
    );
    assert!(output.status.success(), "{}", said(&output));
    let run =
        ["simulate", "fmi3/RcCircuit.fmu", "--input", "u=5", "--stop", "1", "--html", "run.html", "--csv", "run.csv"];
    let output = cargo_fmu(dir.path(), dir.path(), &run);
    assert!(output.status.success() && said(&output).contains("page: run.html"), "{}", said(&output));
    let csv = fs::read_to_string(dir.path().join("run.csv")).unwrap();
    assert!(csv.starts_with("time,u_c") && csv.lines().count() > 10, "{csv}");
    assert!(fs::read_to_string(dir.path().join("run.html")).unwrap().contains("u_c"));
    let output = cargo_fmu(dir.path(), dir.path(), &["info", "fmi3/RcCircuit.fmu"]);
    assert!(output.status.success() && said(&output).contains("RcCircuit"), "{}", said(&output));
}
