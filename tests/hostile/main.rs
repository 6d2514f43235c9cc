//! Hostile files and libraries, generated here: no crash, no hang, no file outside, nothing left behind, one line and the right
//! status.
#![allow(missing_docs, unreachable_pub, clippy::missing_panics_doc, clippy::new_without_default)]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

#[path = "../../fmu-check/tests/faults/zip.rs"]
mod zip;

mod archives;
mod descriptions;
mod libraries;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use zip::{Entry, write};

/// Time limit of a command, much longer than any command needs on a busy machine.
const HANG: Duration = Duration::from_secs(100);

/// The checks that do not run the binary.
const STATIC: &str = "archive,xml,variables,structure,terminals,binary";

/// A folder for one hostile file: `x.fmu`, the working directory and the folder for temporary files.
pub struct Place {
    dir: TempDir,
}

/// The result of a command.
#[derive(Debug)]
pub struct Ended {
    pub status: i32,
    pub out: String,
    pub errors: String,
}

impl Place {
    pub fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        for name in ["work", "temporary"] {
            fs::create_dir(dir.path().join(name)).unwrap();
        }
        Self { dir }
    }

    pub fn fmu(&self) -> PathBuf {
        self.dir.path().join("x.fmu")
    }

    /// Runs `fmu` with these arguments after the first and the file; checks that it leaves only the requested files.
    pub fn run(&self, command: &str, more: &[&str], act: &str) -> Ended {
        let (work, temporary) = (self.dir.path().join("work"), self.dir.path().join("temporary"));
        let file = |name: &str| fs::File::create(self.dir.path().join(name)).unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_fmu"))
            .arg(command)
            .arg(self.fmu())
            .args(more)
            .current_dir(&work)
            .env("TMPDIR", &temporary)
            .env("HOSTILE", act)
            .stdin(Stdio::null())
            .stdout(file("out"))
            .stderr(file("errors"))
            .spawn()
            .unwrap();
        let begun = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status.code();
            }
            if begun.elapsed() > HANG {
                child.kill().unwrap();
                panic!("fmu {command} {more:?} {act}: hangs");
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        let read = |name: &str| String::from_utf8_lossy(&fs::read(self.dir.path().join(name)).unwrap()).into_owned();
        let (out, errors) = (read("out"), read("errors"));
        let what = format!("fmu {command} {more:?} {act}: {errors}");
        assert!(status.is_some(), "crashed: {what}");
        let names = |folder: &Path| {
            let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
            names.sort();
            names
        };
        assert_eq!(names(self.dir.path()), ["errors", "out", "temporary", "work", "x.fmu"], "{what}");
        // The end of a guard that was killed takes a moment.
        let begun = Instant::now();
        while self.left() > 0 {
            assert!(begun.elapsed() < Duration::from_secs(20), "{} processes left: {what}", self.left());
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(names(&temporary).is_empty(), "{:?} left: {what}", names(&temporary));
        assert!(names(&work).is_empty() || more.contains(&"--csv"), "{:?} written: {what}", names(&work));
        Ended { status: status.unwrap_or(-1), out, errors }
    }

    /// The same; an error is one line with status 2.
    pub fn runs(&self, command: &str, more: &[&str]) -> Ended {
        let ended = self.run(command, more, "");
        let statuses: &[i32] = &[0, 1, 2];
        assert!(statuses.contains(&ended.status), "{ended:?}");
        if ended.status == 2 {
            let count = ended.errors.lines().filter(|line| line.starts_with("error: ")).count();
            assert_eq!(
                (count, ended.errors.lines().last().map(|l| l.starts_with("error: "))),
                (1, Some(true)),
                "{ended:?}"
            );
        }
        let printed = format!("{}{}", ended.out, ended.errors);
        assert!(!printed.contains(|c: char| c.is_control() && c != '\n'), "{printed:?}");
        ended
    }

    /// `fmu check` without running the binary, and `fmu simulate`, whose error has this part.
    pub fn is_refused(&self, what: &str, check: i32, part: &str) {
        let checked = self.runs("check", &["--only", STATIC]);
        assert_eq!(checked.status, check, "{what}: {checked:?}");
        let simulated = self.runs("simulate", &[]);
        assert!(simulated.status == 2 && simulated.errors.contains(part), "{what}: {simulated:?}");
        if check == 2 {
            assert!(checked.errors.contains(part), "{what}: the commands differ: {checked:?}");
        }
    }

    /// Number of processes that were started here and still run.
    fn left(&self) -> usize {
        let variable = [b"TMPDIR=", self.dir.path().as_os_str().as_encoded_bytes()].concat();
        let here = |entry: &fs::DirEntry| {
            let environment = fs::read(entry.path().join("environ")).unwrap_or_default();
            environment.split(|&b| b == 0).any(|v| v.starts_with(&variable))
        };
        fs::read_dir("/proc").unwrap().flatten().filter(here).count()
    }
}

/// Works on all of these, four at a time.
pub fn each<T: Sync>(all: &[T], work: impl Fn(&T) + Sync) {
    let next = Mutex::new(all.iter());
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                loop {
                    let one = next.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
                    let Some(one) = one else { return };
                    work(one);
                }
            });
        }
    });
}

pub const XML: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Hostile" guid="g">
<CoSimulation modelIdentifier="Hostile"/>
<DefaultExperiment startTime="0" stopTime="1" stepSize="0.1"/>
<ModelVariables><ScalarVariable name="y" valueReference="1" causality="output" initial="calculated"><Real/></ScalarVariable></ModelVariables>
<ModelStructure><Outputs><Unknown index="1"/></Outputs><InitialUnknowns><Unknown index="1"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>"#;

/// The library of fmu.c; `None` without a C compiler.
pub fn library() -> Option<&'static [u8]> {
    static LIBRARY: OnceLock<Option<Vec<u8>>> = OnceLock::new();
    let compile = || {
        let dir = tempfile::tempdir().ok()?;
        let (source, out) =
            (Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hostile/fmu.c"), dir.path().join("x.so"));
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-O1", "-w"]).arg(source).arg("-o").arg(&out);
        let output = cc.output().ok()?;
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        fs::read(out).ok()
    };
    let library = LIBRARY.get_or_init(compile).as_deref();
    if library.is_none() {
        eprintln!("there is no C compiler: not tested");
    }
    library
}

/// The entries of an FMU with a description and the library, or no library.
pub fn entries(xml: &str) -> Vec<Entry> {
    let folder = if xml.contains("fmiVersion=\"3.0\"") { "x86_64-linux" } else { "linux64" };
    let binary = library().map(|bytes| Entry::new(&format!("binaries/{folder}/Hostile.so"), bytes));
    std::iter::once(Entry::new("modelDescription.xml", xml.as_bytes())).chain(binary).collect()
}

/// An FMU with this description.
pub fn described(xml: &str) -> Place {
    let place = Place::new();
    write(&place.fmu(), &entries(xml));
    place
}

#[test]
fn the_fmu_that_does_no_harm_runs() {
    let ended = described(XML).runs("simulate", &[]);
    assert!(library().is_none() || (ended.status == 0 && ended.errors.is_empty()), "{ended:?}");
}

/// The page has the program's limits.
#[test]
fn the_page_has_the_limits() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/check.md");
    let page = fs::read_to_string(&path).unwrap();
    let (before, after) = page.split_once("<!-- limits -->\n").unwrap();
    let (_, after) = after.split_once("<!-- end of limits -->").unwrap();
    let list = fmu_import::limits::list();
    let expected = format!("{before}<!-- limits -->\n{list}<!-- end of limits -->{after}");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        fs::write(&path, expected).unwrap();
    } else {
        assert!(page == expected, "docs/check.md is old: UPDATE_GOLDEN=1 cargo test --test hostile writes it");
    }
}
