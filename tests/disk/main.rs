//! The library `shim.c` is preloaded into a command. It makes one of the command's reads or writes fail, fills the disk, shortens a write or
//! kills the process. The command must then name the file, and leave neither a partial nor a temporary one; the next run must succeed.
//!
//! The crate `tempfile` renames without the C library, so its renames do not fail here.
#![allow(missing_docs)]
#![cfg(target_os = "linux")]

#[path = "../common/mod.rs"]
mod common;

use fmu_core::draw::Draw;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::thread;
use std::time::{Duration, Instant};

/// The ways in which a call fails.
const KINDS: [&str; 5] = ["full", "once", "short", "kill", "read"];

/// What is in `out/` before a run.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Files {
    None,
    /// A file of each name, with the content [`OLD`].
    Old,
    /// What the kill before, or the whole run after it, has left.
    OfTheLastKill,
}

const OLD: &[u8] = b"an older file";

/// A command, with the files that it reads in `in/` and those that it writes in `out/`.
struct Case {
    folder: tempfile::TempDir,
    arguments: Vec<String>,
    /// All files of `out/` after a run without faults.
    expected: BTreeMap<String, Vec<u8>>,
    /// Its folders.
    folders: BTreeSet<String>,
    /// The duration of that run.
    lasts: Duration,
}

/// Whether a file has a temporary name.
fn is_hidden(name: &str) -> bool {
    Path::new(name).file_name().unwrap().to_string_lossy().starts_with('.')
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
        let (expected, folders, lasts) = (BTreeMap::new(), BTreeSet::new(), Duration::ZERO);
        let mut case = Self { folder, arguments, expected, folders, lasts };
        let begin = Instant::now();
        let output = case.command().output().unwrap();
        assert!(output.status.success(), "{output:?}");
        case.lasts = begin.elapsed();
        (case.expected, case.folders) = case.content();
        assert!(!case.expected.is_empty());
        case
    }

    fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
        command.args(&self.arguments).current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
        command.env("TMPDIR", self.folder.path().join("tmp")).env("SOURCE_DATE_EPOCH", "0");
        command
    }

    /// The files of `out/` and their bytes.
    fn written(&self) -> BTreeMap<String, Vec<u8>> {
        self.content().0
    }

    /// The files of `out/` and their bytes, and its folders; a log has times.
    fn content(&self) -> (BTreeMap<String, Vec<u8>>, BTreeSet<String>) {
        let (mut files, mut folders) = (BTreeMap::new(), BTreeSet::new());
        let out = self.folder.path().join("out");
        let mut left = vec![out.clone()];
        while let Some(folder) = left.pop() {
            for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
                let name = entry.strip_prefix(&out).unwrap().display().to_string();
                if entry.is_dir() {
                    folders.insert(name);
                    left.push(entry);
                } else if !entry.ends_with("log.txt") {
                    files.insert(name, fs::read(&entry).unwrap());
                }
            }
        }
        (files, folders)
    }

    /// An empty folder `out/`.
    fn empty(&self) {
        let out = self.folder.path().join("out");
        fs::remove_dir_all(&out).unwrap();
        fs::create_dir(&out).unwrap();
    }

    fn temporary(&self) -> Vec<PathBuf> {
        fs::read_dir(self.folder.path().join("tmp")).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    /// Runs the command with the fault `kind` in call number `at`, in an empty folder `out/`.
    fn faulty(&self, kind: &str, at: Option<usize>) -> Output {
        self.empty();
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
            assert!(killed || !is_hidden(name), "{place}: leaves {name}");
            assert!(is_hidden(name) || self.expected.get(name) == Some(bytes), "{place}: {name} is not whole");
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
        self.succeeds(&place);
    }

    /// The next run succeeds, and what the one before has left is gone.
    fn succeeds(&self, place: &str) {
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

    /// SIGKILL at a random instant of the run: each file is whole or as it was before, and no new folder stays.
    fn kill(&self, draw: &mut Draw, files: Files) -> bool {
        if files != Files::OfTheLastKill {
            self.empty();
        }
        if files == Files::Old {
            for name in self.expected.keys().filter(|name| !name.contains('/')) {
                fs::write(self.folder.path().join("out").join(name), OLD).unwrap();
            }
        }
        let before = self.written();
        let mut child = self.command().stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let after = self.lasts.mul_f64(1.1 * draw.share());
        thread::sleep(after);
        child.kill().unwrap();
        let killed = child.wait().unwrap().signal() == Some(9);
        let place = format!("{} killed after {after:?}, {files:?}", self.arguments[0]);
        let (written, folders) = self.content();
        for (name, bytes) in &written {
            let whole = self.expected.get(name) == Some(bytes) || before.get(name) == Some(bytes);
            assert!(whole || is_hidden(name) && killed, "{place}: {name} is not whole");
        }
        let gone = before.keys().find(|name| !is_hidden(name) && !written.contains_key(*name));
        assert_eq!(gone, None, "{place}: a file is gone");
        assert!(folders.is_subset(&self.folders), "{place}: leaves {folders:?}");
        killed
    }

    /// `times` kills, and a whole run after most of them.
    fn kills(&self, draw: &mut Draw, times: u32) {
        let mut inside = 0;
        for time in 0..times {
            let files = [Files::None, Files::Old, Files::OfTheLastKill][time as usize % 3];
            inside += u32::from(self.kill(draw, files));
            if files == Files::OfTheLastKill || draw.share() < 0.5 {
                self.succeeds(&format!("{} killed, {files:?}", self.arguments[0]));
            }
        }
        println!("{}: {inside} of {times} killed before the end, a run lasts {:.0?}", self.arguments[0], self.lasts);
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

fn page() -> Case {
    let (description, _) = fmu_import::contents(&common::archives().join("fmi3/PmsmPlant.fmu")).unwrap();
    let module = common::pages::module(&description.token);
    let arguments = ["page", "IN/PmsmPlant.fmu", "--module", "IN/m.wasm", "--out", "OUT/P.html"];
    Case::new(&[("PmsmPlant.fmu", plant()), ("m.wasm", module)], &arguments)
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
}

/// Of its hundreds of calls, most unpack a library.
#[test]
#[ignore = "runs the command hundreds of times, in minutes"]
fn many_calls_of_preset() {
    preset().faults(&KINDS, 60);
}

#[test]
#[ignore = "runs the command hundreds of times, in minutes"]
fn many_calls_of_page() {
    page().faults(&KINDS, 60);
}

/// `KILLS` of each command instead of 60, `FMU_SEED` for other instants.
#[test]
#[ignore = "kills the commands hundreds of times, in minutes"]
fn random_instants() {
    let number = |name| std::env::var(name).ok().map(|n| n.parse().unwrap_or_else(|_| panic!("{name} = {n:?}")));
    let (times, seed) = (number("KILLS").unwrap_or(60), number("FMU_SEED").unwrap_or(1));
    let mut draw = Draw(seed.into());
    for case in [sweep(), preset(), merge(), tune(), identify(), page()] {
        case.kills(&mut draw, times);
    }
}
