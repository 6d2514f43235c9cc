//! Side effects on the importer's process that an FMU must not have: threads, processor, files.

use crate::check::{Check, Levels, Run};
use crate::session::{NotDetermined, Session};
use fmu_import::guard;
use fmu_import::raw::{Raw, Simple, float_control};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

#[rustfmt::skip]
pub(super) const CHECKS: &[Check] = &[
    Check { id: "B06", clause: "hardening", levels: Levels::HARD, run: Run::Probe(small_stack),
        requirement: "The binary loads and runs in a secondary thread with a stack of 256 KiB.",
        tried: "Loads and runs in a thread with 256 KiB.", fix: "Put large arrays on the heap." },
    Check { id: "B08f", clause: "hardening", levels: Levels::HARD, run: Run::Probe(floating_point),
        requirement: "Neither loading nor any call changes the floating-point control (rounding, exceptions, flushing to zero).",
        tried: "Reads the control registers after each call.", fix: "Restore them before returning; avoid -ffast-math when linking." },
    Check { id: "B08p", clause: "hardening", levels: Levels::HARD, run: Run::Probe(surroundings),
        requirement: "A complete run, from loading to unloading, leaves the process unchanged: threads, child processes, open files, working directory, \
            environment, umask, signals and the folder of the FMU.",
        tried: "Compares the process before loading and after unloading.",
        fix: "Close files, end threads and processes, and leave directory, environment and signals alone." },
    Check { id: "Z09", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels::SHOULD, run: Run::Probe(unusual_path),
        requirement: "The FMU runs from a folder whose path has blanks, '%', '#', non-ASCII letters and more than 200 characters, and that contains only \
            its binaries and resources.",
        tried: "Runs from such a folder and compares.", fix: "Decode the URI in FMI 2.0, and use paths of any length." },
];

/// Stack in bytes of the smallest thread that an importer may run the FMU in.
const STACK: usize = 256 << 10;

pub(super) fn failed(e: &std::io::Error) -> NotDetermined {
    NotDetermined(e.to_string())
}

/// Copies a folder with its contents.
fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let (from, to) = {
            let e = entry?;
            (e.path(), to.join(e.file_name()))
        };
        if from.is_dir() {
            copy(&from, &to)?;
        } else {
            fs::copy(from, to)?;
        }
    }
    Ok(())
}

/// A copy of the binary below the working directory, which is temporary; under the new path it is loaded again.
pub(super) fn second_binary(session: &Session, folder: &str) -> Result<PathBuf, NotDetermined> {
    let folder_of_run = session.home.join(folder);
    copy(session.binary.parent().unwrap_or(&folder_of_run), &folder_of_run).map_err(|e| failed(&e))?;
    Ok(folder_of_run.join(session.binary.file_name().unwrap_or_default()))
}

fn small_stack(session: &Session) -> Result<(), NotDetermined> {
    let binary = second_binary(session, "small")?;
    let mut duplicate = session.duplicate(&session.binary, 60)?;
    session.record_call(&format!("loading and running in a thread with {STACK} bytes of stack"));
    let version = session.description.version;
    let work = move || {
        duplicate.raw = Raw::open(&binary, version).map_err(NotDetermined)?;
        let instance = duplicate.stepping()?;
        for k in 0..5 {
            instance.change_inputs(k)?;
            instance.steps(1, duplicate.h())?;
            let _ = instance.snapshot(&duplicate.watched())?;
        }
        let _ = instance.simple(Simple::Terminate)?;
        instance.free()
    };
    let thread = std::thread::Builder::new().stack_size(STACK).spawn(work).map_err(|e| failed(&e))?;
    match thread.join() {
        Ok(Ok(())) => {}
        Ok(Err(why)) => session.failed("in that thread", why),
        Err(_) => session.violated("the thread panicked"),
    }
    Ok(())
}

/// Name of a call and the call.
type Watched<'a> = (&'a str, &'a dyn Fn() -> Result<(), NotDetermined>);

fn floating_point(session: &Session) -> Result<(), NotDetermined> {
    let Some(before) = float_control() else {
        return session.not_applicable("the control registers of this processor are not supported");
    };
    let check_control = |what: &str| {
        let current = float_control().unwrap_or(before);
        session.require(current == before, || {
            format!("{what} changed the floating-point control from {before:#x} to {current:#x}")
        });
        current == before
    };
    let binary = second_binary(session, "floating")?;
    session.record_call("loading the binary once more");
    let duplicate = session.duplicate(&binary, 61)?;
    // One finding is enough: afterwards everything differs.
    if !check_control("loading") {
        return Ok(());
    }
    let instance = duplicate.fresh()?;
    let steps: [Watched<'_>; 6] = [
        ("the instantiation", &|| Ok(())),
        ("entering initialization mode", &|| instance.enter()),
        ("leaving initialization mode", &|| instance.exit()),
        ("setting inputs", &|| instance.change_inputs(1)),
        ("DoStep", &|| instance.steps(3, duplicate.h())),
        ("getting outputs", &|| instance.snapshot(&duplicate.watched()).map(|_| ())),
    ];
    for (what, step) in steps {
        step()?;
        if !check_control(what) {
            return Ok(());
        }
    }
    let _ = instance.simple(Simple::Terminate)?;
    instance.free()?;
    check_control("termination");
    Ok(())
}

/// Properties of the process that an FMU must leave unchanged.
#[derive(PartialEq)]
struct Surroundings {
    threads: usize,
    files: Vec<PathBuf>,
    folder: Option<PathBuf>,
    environment: Vec<(OsString, OsString)>,
    /// Processes that this one has started.
    children: Vec<String>,
    /// Lines of `/proc/self/status`.
    status: Vec<String>,
    /// Files below the unpacked FMU with size and time.
    fmu_folder: Vec<(PathBuf, u64, Option<std::time::SystemTime>)>,
}

fn list(folder: &Path, found: &mut Vec<(PathBuf, u64, Option<std::time::SystemTime>)>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let Ok(meta) = entry.metadata() else { continue };
        if meta.is_dir() {
            list(&entry.path(), found);
        } else {
            found.push((entry.path(), meta.len(), meta.modified().ok()));
        }
    }
}

impl Surroundings {
    fn current(fmu_folder: &Path) -> Self {
        let count = |folder: &str| fs::read_dir(folder).map_or(0, Iterator::count);
        let links = fs::read_dir("/proc/self/fd").into_iter().flatten().flatten();
        // Reading the folder opens it, under a name that changes.
        let mut files: Vec<_> =
            links.filter_map(|e| fs::read_link(e.path()).ok()).filter(|p| !p.ends_with("fd")).collect();
        files.sort();
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let fields = ["Umask:", "SigIgn:", "SigCgt:", "SigBlk:"];
        let mut environment: Vec<_> = std::env::vars_os().collect();
        environment.sort();
        let mut found = Vec::new();
        list(fmu_folder, &mut found);
        found.sort();
        Self {
            threads: count("/proc/self/task"),
            files,
            folder: std::env::current_dir().ok(),
            environment,
            children: guard::children(),
            status: status.lines().filter(|l| fields.iter().any(|t| l.starts_with(t))).map(str::to_owned).collect(),
            fmu_folder: found,
        }
    }

    fn differences(&self, after: &Self) -> Vec<String> {
        let mut found = Vec::new();
        if self.threads != after.threads {
            found.push(format!("the number of threads changed from {} to {}", self.threads, after.threads));
        }
        found
            .extend(after.files.iter().filter(|f| !self.files.contains(f)).map(|f| format!("{} is open", f.display())));
        if self.folder != after.folder {
            found.push("the working directory changed".into());
        }
        let changed = after.environment.iter().chain(&self.environment);
        let changed = changed.filter(|v| !self.environment.contains(v) || !after.environment.contains(v));
        found.extend(changed.map(|(name, _)| format!("the environment variable {} changed", name.to_string_lossy())));
        let children = after.children.iter().filter(|c| !self.children.contains(c));
        found.extend(children.map(|c| format!("the process {c} was left behind")));
        for (old, new) in self.status.iter().zip(&after.status).filter(|(old, new)| old != new) {
            found.push(format!("{:?} became {:?}", old.replace('\t', " "), new.replace('\t', " ")));
        }
        found.extend(
            after
                .fmu_folder
                .iter()
                .filter(|f| !self.fmu_folder.contains(f))
                .map(|f| format!("{} was written", f.0.display())),
        );
        found
    }
}

fn surroundings(session: &Session) -> Result<(), NotDetermined> {
    let binary = second_binary(session, "guest")?;
    let fmu_folder = session.binary.ancestors().nth(3).unwrap_or(&session.binary).to_owned();
    // The first loading may have left it already.
    std::env::set_current_dir(&session.home).map_err(|e| failed(&e))?;
    let before = Surroundings::current(&fmu_folder);
    session.record_call("loading, a complete run, unloading");
    {
        let duplicate = session.duplicate(&binary, 62)?;
        let instance = duplicate.stepping()?;
        for k in 0..20 {
            instance.change_inputs(k)?;
            instance.steps(1, duplicate.h())?;
            let _ = instance.snapshot(&duplicate.watched())?;
        }
        let _ = instance.simple(Simple::Terminate)?;
        instance.free()?;
    }
    let mut found = before.differences(&Surroundings::current(&fmu_folder));
    // A thread may take a while to end, especially on a busy machine.
    for _ in 0..200 {
        if found.is_empty() {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
        found = before.differences(&Surroundings::current(&fmu_folder));
    }
    for f in found {
        session.violated(format!("after a complete run: {f}"));
    }
    Ok(())
}

fn unusual_path(session: &Session) -> Result<(), NotDetermined> {
    let run = |session: &Session| {
        let instance = session.stepping()?;
        instance.run(10, session.h())
    };
    let plain = run(session)?;
    let folder_of_run =
        session.home.join(format!("an FMU %41 #1 \u{e4}\u{4e2d} {}", "x".repeat(120))).join("y".repeat(120));
    let platform = session.binary.parent().ok_or_else(|| NotDetermined("the binary has no folder".into()))?;
    let binaries = folder_of_run.join("binaries").join(platform.file_name().unwrap_or_default());
    copy(platform, &binaries).map_err(|e| failed(&e))?;
    let resources = session.resources();
    if resources.is_dir() {
        copy(&resources, &folder_of_run.join("resources")).map_err(|e| failed(&e))?;
    }
    let binary = binaries.join(session.binary.file_name().unwrap_or_default());
    session.record_call(&format!("a run in {}", folder_of_run.display()));
    let raw = match Raw::open(&binary, session.description.version) {
        Ok(raw) => raw,
        Err(why) => {
            session.violated(format!("in {} the binary does not load: {why}", folder_of_run.display()));
            return Ok(());
        }
    };
    let duplicate = session.duplicate_at(&folder_of_run, raw, 63)?;
    match run(&duplicate) {
        Err(why) => session.failed(&format!("in {}", folder_of_run.display()), why),
        Ok(rows) => session.compare("from there", &plain, &rows),
    }
    Ok(())
}
