//! The library `shim.c` is preloaded into a command. It makes one of the command's reads or writes fail, fills the disk, shortens a write or
//! kills the process. The command must then name the file, and leave neither a partial nor a temporary one; the next run must succeed.
//!
//! The crate `tempfile` renames without the C library, so its renames do not fail here.
#![allow(missing_docs)]
#![cfg(target_os = "linux")]

#[path = "../common/mod.rs"]
mod common;

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

/// The ways in which a call fails.
const KINDS: [&str; 5] = ["full", "once", "short", "kill", "read"];

/// A command, with the files that it reads in `in/` and those that it writes in `out/`.
struct Case {
    folder: tempfile::TempDir,
    arguments: Vec<String>,
    /// All files of `out/` after a run without faults.
    expected: BTreeMap<String, Vec<u8>>,
}

/// The library that makes calls fail.
fn shim() -> &'static Path {
    static FILE: OnceLock<PathBuf> = OnceLock::new();
    FILE.get_or_init(|| {
        let file = common::python::scratch().join(format!("disk-{}.so", std::process::id()));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/disk/shim.c");
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-O1", "-o"]).arg(&file).arg(source).arg("-ldl");
        assert!(cc.status().unwrap().success(), "the compiler cc is needed");
        file
    })
}

impl Case {
    /// `IN` and `OUT` in the arguments are the two folders.
    fn new(files: &[(&str, Vec<u8>)], arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for name in ["in", "out", "tmp"] {
            fs::create_dir(folder.path().join(name)).unwrap();
        }
        for (name, bytes) in files {
            fs::write(folder.path().join("in").join(name), bytes).unwrap();
        }
        let place = |text: &&str| {
            let below = |name: &str| format!("{}/{name}/", folder.path().display());
            text.replace("IN/", &below("in")).replace("OUT/", &below("out"))
        };
        let arguments = arguments.iter().map(place).collect();
        let mut case = Self { folder, arguments, expected: BTreeMap::new() };
        let output = case.command().output().unwrap();
        assert!(output.status.success(), "{output:?}");
        case.expected = case.written();
        assert!(!case.expected.is_empty());
        case
    }

    fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
        command.args(&self.arguments).current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
        command.env("TMPDIR", self.folder.path().join("tmp")).env("SOURCE_DATE_EPOCH", "0");
        command
    }

    /// The files of `out/` and their bytes; a log has times.
    fn written(&self) -> BTreeMap<String, Vec<u8>> {
        let mut files = BTreeMap::new();
        let out = self.folder.path().join("out");
        let mut folders = vec![out.clone()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
                if entry.is_dir() {
                    folders.push(entry);
                } else if !entry.ends_with("log.txt") {
                    let name = entry.strip_prefix(&out).unwrap().display().to_string();
                    files.insert(name, fs::read(&entry).unwrap());
                }
            }
        }
        files
    }

    fn temporary(&self) -> Vec<PathBuf> {
        fs::read_dir(self.folder.path().join("tmp")).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    /// Runs the command with the fault `kind` in call number `at`, in an empty folder `out/`.
    fn faulty(&self, kind: &str, at: Option<usize>) -> Output {
        let out = self.folder.path().join("out");
        fs::remove_dir_all(&out).unwrap();
        fs::create_dir(&out).unwrap();
        let mut command = self.command();
        command.env("LD_PRELOAD", shim()).env("FAULT_BELOW", self.folder.path()).env("FAULT_KIND", kind);
        command.env("FAULT_COUNT", self.folder.path().join("count"));
        if let Some(at) = at {
            command.env("FAULT_AT", at.to_string());
        }
        command.output().unwrap()
    }

    /// Number of calls that can fail in this way.
    fn calls(&self, kind: &str) -> usize {
        let output = self.faulty(kind, None);
        assert!(output.status.success() && self.written() == self.expected, "{output:?}");
        fs::read_to_string(self.folder.path().join("count")).unwrap().parse().unwrap()
    }

    /// One fault: what must hold after it, and after the next run.
    fn fault(&self, kind: &str, at: usize) {
        let output = self.faulty(kind, Some(at));
        let said = String::from_utf8_lossy(&output.stderr);
        let place = format!("{} {kind} {at}: {:?} {said}", self.arguments[0], output.status);
        let (written, killed) = (self.written(), kind == "kill");
        for (name, bytes) in &written {
            let hidden = Path::new(name).file_name().unwrap().to_string_lossy().starts_with('.');
            assert!(killed || !hidden, "{place}: leaves {name}");
            assert!(hidden || self.expected.get(name) == Some(bytes), "{place}: {name} is not whole");
        }
        match (output.status.code(), kind) {
            (None, "kill") => assert_eq!(output.status.signal(), Some(9), "{place}"),
            // A second attempt, or nothing was lost.
            (Some(0), "short" | "once" | "read") => assert!(written == self.expected, "{place}"),
            (Some(status), "full" | "once" | "read") => {
                assert!(matches!(status, 1 | 2), "{place}");
                let named = said.contains(&self.folder.path().display().to_string());
                assert!(named && said.contains("os error"), "{place}: names no file and no reason");
                assert!(said.lines().filter(|line| line.starts_with("error: ")).count() == 1, "{place}: not one line");
                assert_eq!(said.matches("os error").count(), 1, "{place}: says it twice");
            }
            _ => panic!("{place}"),
        }
        assert!(killed || self.temporary().is_empty(), "{place}: leaves {:?}", self.temporary());
        let output = self.command().output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{place} and then {said}");
        assert_eq!(
            self.written().keys().collect::<Vec<_>>(),
            self.expected.keys().collect::<Vec<_>>(),
            "{place}, then"
        );
        assert!(self.written() == self.expected, "{place}, and then other bytes");
        assert!(self.temporary().is_empty(), "{place}: leaves {:?} after the next run", self.temporary());
    }

    /// Every call, or about `most` of them: the first and the last ones, and some between.
    fn faults(&self, kinds: &[&str], most: usize) {
        for kind in kinds {
            let calls = self.calls(kind);
            let from_end = |at: usize| at <= most / 3 || at + most / 3 > calls;
            let chosen = |at: &usize| calls <= most || from_end(*at) || at.is_multiple_of(calls.div_ceil(most / 3));
            let all: Vec<usize> = (1..=calls).filter(chosen).collect();
            println!("{} {kind}: {} of {calls} calls", self.arguments[0], all.len());
            for at in all {
                self.fault(kind, at);
            }
        }
    }
}

fn plant() -> Vec<u8> {
    fs::read(common::archives().join("fmi3/PmsmPlant.fmu")).unwrap()
}

fn sweep() -> Case {
    let text = "fmus = ['p=PmsmPlant.fmu']\nstop = 0.002\nstep = 1e-3\n\
        design = { kind = 'sobol', runs = 4, seed = 7, part = 2 }\n[vary]\n'p.motor.R_s' = { uniform = [2.5, 3.5] }\n\
        [measure]\nlast = { of = 'p.speed', is = 'final' }\n";
    let files = [("PmsmPlant.fmu", plant()), ("a.toml", text.into())];
    Case::new(&files, &["sweep", "IN/a.toml", "--out", "OUT/a", "--csv", "OUT/a.csv", "--jobs", "1"])
}

fn preset() -> Case {
    let arguments = ["preset", "IN/PmsmPlant.fmu", "--set", "motor.R_s=2.9", "--out", "OUT/P.fmu"];
    Case::new(&[("PmsmPlant.fmu", plant())], &arguments)
}

fn merge() -> Case {
    let files = [("PmsmPlant.fmu", plant())];
    Case::new(&files, &["merge", "IN/PmsmPlant.fmu", "IN/PmsmPlant.fmu", "--out", "OUT/P.fmu"])
}

fn tune() -> Case {
    let motor = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("motors/ipmsm-2.2kw.toml")).unwrap();
    Case::new(&[("m.toml", motor)], &["tune", "IN/m.toml", "--out", "OUT/"])
}

fn identify() -> Case {
    let record = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/bench.csv")).unwrap();
    let text = "identify IN/bench.csv --n-p 3 --current 15 --speed 157 --torque 14 --u-dc 540 --delay 0 --every 5 --out OUT/b.toml \
                --html OUT/b.html";
    Case::new(&[("bench.csv", record)], &text.split(' ').collect::<Vec<_>>())
}

/// The commands that take tenths of a second have fewer faults.
#[test]
fn some_calls() {
    sweep().faults(&KINDS, 9);
    identify().faults(&KINDS, 3);
    merge().faults(&["full", "kill"], 3);
    preset().faults(&["kill"], 3);
}

#[test]
#[ignore = "runs the commands thousands of times, in a quarter of an hour"]
fn every_call() {
    for case in [merge(), tune(), identify(), sweep()] {
        case.faults(&KINDS, usize::MAX / 2);
    }
    // Of its 2000 calls, most unpack a library.
    preset().faults(&KINDS, 60);
}
