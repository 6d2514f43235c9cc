//! Allocation n fails, for each n: the library of an FMU under an importer in C, and the commands that load it.
//!
//! Rust's standard library ends the process when an allocation fails (SIGABRT, with the number of bytes), and no stable function changes
//! that: so does an FMU. Under the guard of `fmu simulate` and `fmu check` it ends its own process only.
#![allow(missing_docs)]
#![cfg(target_os = "linux")]

#[path = "../common/mod.rs"]
mod common;

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn compiled(source: &str, options: &[&str], folder: &Path) -> PathBuf {
    let file = folder.join(source.replace(".c", ""));
    let mut cc = Command::new("cc");
    cc.args(["-O1", "-w", "-o"])
        .arg(&file)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/memory").join(source));
    assert!(cc.args(options).status().unwrap().success(), "the compiler cc is needed");
    file
}

/// Each allocation of an instantiation, with the names of what must be freed by nobody else: the process ends with SIGABRT or there is
/// no instance. A step allocates nothing, so that it cannot fail.
#[test]
fn an_instance_is_whole_or_none() {
    let dir = tempfile::tempdir().unwrap();
    let shim = compiled("shim.c", &["-shared", "-fPIC"], dir.path());
    let importer = compiled("importer.c", &["-ldl", shim.to_str().unwrap()], dir.path());
    for (standard, name, folder) in [
        ("fmi2", "PmsmPlant", "linux64"),
        ("fmi3", "PmsmPlant", "x86_64-linux"),
        ("fmi2", "PmsmDrive", "linux64"),
        ("fmi3", "PmsmDrive", "x86_64-linux"),
    ] {
        let archive = common::archives().join(standard).join(name).with_extension("fmu");
        let (description, files) = fmu_import::contents(&archive).unwrap();
        let library = dir.path().join("library.so");
        fs::write(&library, &files[&format!("binaries/{folder}/{name}.so")]).unwrap();
        let mut run = Command::new(&importer);
        run.arg(&library).arg(&standard[3..]).arg(&description.token).env("LD_LIBRARY_PATH", dir.path());
        let output = run.output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{output:?}");
        let numbers: Vec<u64> = said.split_whitespace().map(|n| n.parse().unwrap()).collect();
        let [allocations, of_step, instances, nulls, aborts, others] = numbers[..] else { panic!("{said}") };
        println!("{standard} {name}: {allocations} allocations, {nulls} NULL, {aborts} aborts, {of_step} in a step");
        assert_eq!((of_step, instances, others), (0, 0, 0), "{standard} {name}: {said}");
        assert!(allocations > 0 && nulls + aborts == allocations, "{standard} {name}: {said}");
    }
}

/// `most` allocations of a command fail, one in each run: it ends with its result, with an error, or with a signal that says why; it
/// writes its file whole or not at all, and the next run finds nothing left behind.
fn command(arguments: &[&str], most: usize) {
    let dir = tempfile::tempdir().unwrap();
    let shim = compiled("shim.c", &["-shared", "-fPIC"], dir.path());
    let (temporary, out) = (dir.path().join("tmp"), dir.path().join("out.csv"));
    fs::create_dir(&temporary).unwrap();
    let fmu = common::archives().join("fmi3/PmsmPlant.fmu").display().to_string();
    let place = |text: &&str| text.replace("FMU", &fmu).replace("OUT", &out.display().to_string());
    let run = |at: Option<usize>| -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
        command.args(arguments.iter().map(place)).env("TMPDIR", &temporary).stdin(Stdio::null());
        command.env("RUST_BACKTRACE", "0").env("SOURCE_DATE_EPOCH", "0");
        match at {
            Some(at) => command.env("LD_PRELOAD", &shim).env("FAULT_AT", at.to_string()),
            None => &mut command,
        };
        command.output().unwrap()
    };
    let left = || fs::read_dir(&temporary).unwrap().map(|e| e.unwrap().path()).collect::<Vec<_>>();
    let good = run(None);
    assert!(matches!(good.status.code(), Some(0 | 1)), "{good:?}");
    let expected = fs::read(&out).ok();
    // Numbers of every size: commands allocate much at their beginning.
    let (mut at, mut ends) = (1, [0; 3]);
    for k in 0..most {
        let _ = fs::remove_file(&out);
        let output = run(Some(at));
        let said = String::from_utf8_lossy(&output.stderr);
        let place = format!("{arguments:?}, allocation {at}: {:?} {said}", output.status);
        let written = fs::read(&out).ok();
        assert!(written.is_none() || written == expected, "{place}: a file in parts");
        match (output.status.code(), output.status.signal()) {
            (code, None) if code == good.status.code() => ends[0] += 1,
            (Some(1 | 2 | 101), None) => {
                // A finding about the FMU is on standard output.
                assert!(!said.trim().is_empty() || !output.stdout.is_empty(), "{place}: no reason");
                ends[1] += 1;
            }
            // Before its first own line, a process may end in the loader.
            (Some(127), None) => ends[1] += 1,
            (None, Some(6)) => {
                assert!(said.contains("memory allocation of") || said.contains("error"), "{place}: no reason");
                ends[2] += 1;
            }
            _ => panic!("{place}"),
        }
        at += 1 + at * 12 / most.max(12) + k % 3;
    }
    println!(
        "{}: {most} runs up to allocation {at}: {} results, {} errors, {} aborts",
        arguments[0], ends[0], ends[1], ends[2]
    );
    assert!(run(None).status.code() == good.status.code() && fs::read(&out).ok() == expected, "the last run");
    let left = left();
    assert!(left.is_empty(), "{arguments:?} leaves {left:?}");
}

const SIMULATE: [&str; 8] = ["simulate", "p=FMU", "--stop", "0.001", "--step", "1e-4", "--csv", "OUT"];
const CHECK: [&str; 4] = ["check", "FMU", "--only", "L00,X01a,V01a"];
const PRESET: &[&str] = &["preset", "FMU", "--set", "motor.R_s=2.9", "--out", "OUT"];

#[test]
fn some_allocations_of_commands() {
    command(&SIMULATE, 40);
    command(&CHECK, 12);
}

#[test]
#[ignore = "runs each command hundreds of times, in minutes"]
fn many_allocations_of_commands() {
    command(&SIMULATE, 600);
    command(&CHECK, 200);
    command(PRESET, 200);
}
