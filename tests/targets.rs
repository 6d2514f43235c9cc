//! `fmu build --target`: missing tools are reported before anything is compiled, in one line with the remedy.
#![allow(missing_docs)]

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A program of the toolchain, which is not searched in `PATH`.
fn toolchain(program: &str) -> PathBuf {
    let output = Command::new("rustc").args(["--print", "sysroot"]).output().unwrap();
    let root = String::from_utf8(output.stdout).unwrap();
    let path = Path::new(root.trim()).join("bin").join(format!("{program}{}", std::env::consts::EXE_SUFFIX));
    if path.is_file() { path } else { program.into() }
}

/// `fmu build` of a small FMU with these targets and this `PATH`.
fn build(targets: &str, path: impl AsRef<OsStr>, environment: &[(&str, &str)]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        if text.ends_with("_LINKER") || text == "CARGO_UNSTABLE_BUILD_STD" {
            command.env_remove(name);
        }
    }
    command.env("RUSTC", toolchain("rustc")).env("CARGO", toolchain("cargo")).env("PATH", path);
    command
        .args(["build", "--package", "own-fmu", "--target", targets])
        .envs(environment.iter().copied())
        .output()
        .unwrap()
}

fn fails(targets: &str, path: &str, environment: &[(&str, &str)], parts: &[&str]) {
    let output = build(targets, path, environment);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{targets}: {error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    for part in std::iter::once(&"error: --target ").chain(parts) {
        assert!(error.contains(part), "{targets}: {part:?} is not in {error}");
    }
}

#[test]
fn targets_that_are_none() {
    fails("x86_64-plan9", "", &[], &["x86_64-plan9: rustc has no such target", "rustc --print target-list"]);
    fails("wasm32-unknown-unknown", "", &[], &["is not a supported platform of FMUs; available: x86_64-linux, "]);
    fails("x86_64-unknown-linux-musl", "", &[], &["for musl", "use x86_64-unknown-linux-gnu"]);
    // The second of several, in either spelling.
    fails("x86_64-plan9,wasm32-unknown-unknown", "", &[], &["x86_64-plan9"]);
}

#[test]
#[cfg(target_os = "linux")]
fn tools_that_are_missing() {
    let install = "pip install cargo-zigbuild ziglang";
    let foreign = if cfg!(target_arch = "x86_64") { "aarch64" } else { "x86_64" };
    let linux = format!("{foreign}-unknown-linux-gnu");
    fails(&linux, "", &[], &[&linux, "cargo-zigbuild, which is not in PATH", install]);
    fails("aarch64-apple-darwin", "", &[], &["aarch64-apple-darwin", install]);
    let mingw = ["x86_64-w64-mingw32-gcc is missing", "apt install gcc-mingw-w64-x86-64-win32"];
    fails("x86_64-pc-windows-gnu", "", &[], &mingw);
    fails("x86_64-pc-windows-msvc", "", &[], &["only on Windows", "use x86_64-pc-windows-gnu"]);
    // Nothing is compiled for the first target if a tool for the second is missing.
    fails(&format!("{}-unknown-linux-gnu,x86_64-pc-windows-gnu", std::env::consts::ARCH), "", &[], &mingw);
    // A target without a separate linker that could be missing, and hardly ever a standard library here.
    let rare = "aarch64-pc-windows-gnullvm";
    fails(rare, "", &[], &["standard library for it is missing", "rustup target add aarch64-pc-windows-gnullvm"]);
}

#[test]
#[cfg(target_os = "linux")]
fn a_cargo_zigbuild_without_zig() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let program = dir.path().join("cargo-zigbuild");
    fs::write(&program, "#!/bin/sh\nexit 1\n").unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    let path = dir.path().to_str().unwrap();
    fails("x86_64-apple-darwin", path, &[], &["cargo-zigbuild finds none", "pip install cargo-zigbuild ziglang"]);
}

/// Without zig, the build names the C library that it needs, in agreement with the checks.
#[test]
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn a_plain_build_names_its_requirements() {
    let path = std::env::var_os("PATH").unwrap();
    let plain = std::env::split_paths(&path).filter(|folder| !folder.join("cargo-zigbuild").is_file());
    let target = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let output = build(&target, std::env::join_paths(plain).unwrap(), &[]);
    let [files, printed] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success(), "{printed}");
    let platform = format!("{}-linux", std::env::consts::ARCH);
    let start = format!("note: RcCircuit for {platform} requires ");
    let note = printed.lines().find_map(|line| line.strip_prefix(&start));
    for file in files.lines() {
        let check =
            Command::new(env!("CARGO_BIN_EXE_fmu")).args(["check", file, "--only", "B03,B04"]).output().unwrap();
        let found = String::from_utf8(check.stdout).unwrap();
        let needs = found.lines().filter_map(|line| line.rsplit_once(": needs ")).map(|(_, what)| what);
        let needs: Vec<&str> = needs.collect();
        let note = note.map(|n| n.split_once(", which fmu check reports (B03, B04): ").unwrap().0);
        assert_eq!(note.is_some(), !needs.is_empty(), "{printed}{found}");
        for what in needs {
            assert!(note.is_some_and(|n| n.contains(what)), "{printed}{found}");
        }
    }
    assert_eq!(files.lines().count(), 2);
}

#[test]
fn two_targets_of_one_platform() {
    // With named linkers and a standard library from source, nothing is missing.
    let environment = [
        ("CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER", "ld"),
        ("CARGO_TARGET_X86_64_PC_WINDOWS_MSVC_LINKER", "ld"),
        ("CARGO_UNSTABLE_BUILD_STD", "std"),
    ];
    let both = "x86_64-pc-windows-gnu,x86_64-pc-windows-msvc";
    fails(both, "", &environment, &["is for x86_64-windows, as x86_64-pc-windows-gnu is; take one"]);
}
