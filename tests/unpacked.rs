//! The folders of unpacked archives: a process removes its own; a later one removes those of killed processes.
#![allow(missing_docs)]
#![cfg(unix)]

mod common;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// `fmu simulate` for `stop` seconds of the plant, with its temporary files below `temporary`.
fn simulate(fmu: &Path, stop: &str, temporary: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
    command.arg("simulate").arg(fmu).args(["--step", "1e-4", "--stop", stop, "--record", "p.speed", "--in-process"]);
    command.env("TMPDIR", temporary).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn names(folder: &Path) -> Vec<String> {
    fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

fn wait(until: impl Fn() -> bool, what: &str) {
    let begun = Instant::now();
    while !until() {
        assert!(begun.elapsed() < Duration::from_mins(1), "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The processes whose temporary files are below this folder.
#[cfg(target_os = "linux")]
fn users(temporary: &Path) -> Vec<String> {
    let variable = [b"TMPDIR=", temporary.as_os_str().as_encoded_bytes()].concat();
    let uses = |entry: &fs::DirEntry| {
        let environment = fs::read(entry.path().join("environ")).unwrap_or_default();
        environment.split(|&b| b == 0).any(|v| v.starts_with(&variable))
    };
    let all = fs::read_dir("/proc").unwrap().flatten().filter(uses);
    all.map(|e| e.file_name().into_string().unwrap()).collect()
}

/// `fmu simulate` is killed: its worker ends, and the unpacked files are removed.
#[test]
#[cfg(target_os = "linux")]
fn a_worker_ends_with_its_command() {
    let dir = tempfile::tempdir().unwrap();
    let fmu = format!("p={}", common::archives().join("fmi3/PmsmPlant.fmu").display());
    let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
    command.args(["simulate", &fmu, "--step", "1e-4", "--stop", "1e5", "--record", "p.speed"]);
    let mut killed = command.env("TMPDIR", dir.path()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let loaded = |id: &String| fs::read_to_string(format!("/proc/{id}/maps")).is_ok_and(|m| m.contains("PmsmPlant.so"));
    wait(|| users(dir.path()).iter().any(loaded), "no worker loads the FMU");
    killed.kill().unwrap();
    killed.wait().unwrap();
    wait(|| users(dir.path()).is_empty(), "the worker or its guard outlives the command");
    assert_eq!(names(dir.path()), Vec::<String>::new());
}

/// Waits until the process has loaded the FMU.
fn loaded(child: &Child) {
    let maps = || fs::read_to_string(format!("/proc/{}/maps", child.id())).unwrap();
    wait(|| maps().contains("PmsmPlant.so"), "does not load");
}

#[test]
#[cfg(target_os = "linux")]
fn a_killed_process_leaves_nothing_that_the_next_does_not_remove() {
    let dir = tempfile::tempdir().unwrap();
    let (temporary, with_resources) = (dir.path().join("tmp"), dir.path().join("p.fmu"));
    fs::create_dir(&temporary).unwrap();
    let original = common::archives().join("fmi3/PmsmPlant.fmu");
    let plain = format!("p={}", original.display());
    fs::copy(&original, &with_resources).unwrap();
    let archive = fs::File::options().read(true).write(true).open(&with_resources).unwrap();
    let mut archive = zip::ZipWriter::new_append(archive).unwrap();
    archive.start_file("resources/table.csv", zip::write::SimpleFileOptions::default()).unwrap();
    archive.finish().unwrap();

    let mut one = simulate(Path::new(&plain), "1e5", &temporary).spawn().unwrap();
    loaded(&one);
    wait(|| names(&temporary).is_empty(), "a loaded binary needs no file");
    one.kill().unwrap();
    one.wait().unwrap();

    let mut killed = simulate(&with_resources, "1e5", &temporary).spawn().unwrap();
    loaded(&killed);
    let mut running = simulate(&with_resources, "1e5", &temporary).spawn().unwrap();
    loaded(&running);
    killed.kill().unwrap();
    killed.wait().unwrap();
    let of =
        |child: &Child| names(&temporary).iter().filter(|n| n.starts_with(&format!("fmu-{}-", child.id()))).count();
    assert_eq!((of(&killed), of(&running)), (1, 1), "{:?}", names(&temporary));

    assert!(simulate(&with_resources, "0.01", &temporary).status().unwrap().success());
    assert_eq!((of(&killed), of(&running)), (0, 1), "{:?}", names(&temporary));
    assert_eq!(names(&temporary).len(), 1, "a process that ends removes its own: {:?}", names(&temporary));
    running.kill().unwrap();
    running.wait().unwrap();
}
