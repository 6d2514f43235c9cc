//! What an FMU may not do to the process that it is a guest of: its threads, its processor, its files.

use super::bench::{Bench, Blocked};
use super::lifecycle::difference;
use super::{Check, Levels, Run};
use fmu_import::raw::{Raw, Simple, float_control};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

#[rustfmt::skip]
pub(super) const CHECKS: &[Check] = &[
    Check { id: "B06", requirement: "The binary loads and lives in a thread that is not the first, with a stack of 256 KiB.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(small_stack) },
    Check { id: "B08f", requirement: "No call changes the floating-point control (rounding, exceptions, flushing to zero), nor does loading.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(floating_point) },
    Check { id: "B08p", requirement: "A whole life, from loading to unloading, leaves the process as it was: threads, open files, working directory, environment, umask, signals, the FMU's own folder.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(surroundings) },
    Check { id: "Z09", requirement: "The FMU lives in a folder with blanks, '%', '#', letters beyond ASCII and more than 200 characters in its path, of which only its own binaries and resources were unpacked.", clause: "2.0.5, 2.1.5 and 2.3; 3.0.2, 2.3.1 and 2.5", levels: Levels::SHOULD, run: Run::Probe(odd_folder) },
];

/// Bytes of stack of a thread that a modest importer makes.
const STACK: usize = 256 << 10;

fn failed(e: &std::io::Error) -> Blocked {
    Blocked(e.to_string())
}

/// Copies a folder with all that is in it.
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

/// A copy of the binary below the working directory, which is thrown away; so that it is loaded once more.
fn second_binary(bench: &Bench, folder: &str) -> Result<PathBuf, Blocked> {
    let home = std::env::current_dir().map_err(|e| failed(&e))?.join(folder);
    copy(bench.binary.parent().unwrap_or(&home), &home).map_err(|e| failed(&e))?;
    Ok(home.join(bench.binary.file_name().unwrap_or_default()))
}

fn small_stack(bench: &Bench) -> Result<(), Blocked> {
    let binary = second_binary(bench, "small")?;
    let mut twin = bench.twin(60)?;
    bench.calling(&format!("loading and a life in a thread with {STACK} bytes of stack"));
    let version = bench.md.version;
    let work = move || {
        twin.raw = Raw::open(&binary, version).map_err(Blocked)?;
        let it = twin.stepping()?;
        for k in 0..5 {
            it.excite(k)?;
            it.steps(1, twin.h())?;
            let _ = it.snapshot(&twin.watched())?;
        }
        let _ = it.simple(Simple::Terminate)?;
        it.free()
    };
    let thread = std::thread::Builder::new().stack_size(STACK).spawn(work).map_err(|e| failed(&e))?;
    match thread.join() {
        Ok(Ok(())) => {}
        Ok(Err(Blocked(why))) => bench.violated(why),
        Err(_) => bench.violated("the thread died"),
    }
    Ok(())
}

/// What is called, and how.
type Call<'a> = (&'a str, &'a dyn Fn() -> Result<(), Blocked>);

fn floating_point(bench: &Bench) -> Result<(), Blocked> {
    let Some(before) = float_control() else {
        return bench.not_applicable("the control registers of this processor are not known here");
    };
    let look = |what: &str| {
        let now = float_control().unwrap_or(before);
        bench.require(now == before, || {
            format!("{what} changed the floating-point control from {before:#x} to {now:#x}")
        });
        now == before
    };
    let binary = second_binary(bench, "floating")?;
    bench.calling("loading the binary once more");
    let twin = bench.twin_of(Raw::open(&binary, bench.md.version).map_err(Blocked)?, 61)?;
    // One finding is enough: afterwards everything differs.
    if !look("loading") {
        return Ok(());
    }
    let it = twin.fresh()?;
    let steps: [Call<'_>; 6] = [
        ("the instantiation", &|| Ok(())),
        ("entering initialisation mode", &|| it.enter()),
        ("leaving initialisation mode", &|| it.exit()),
        ("setting inputs", &|| it.excite(1)),
        ("DoStep", &|| it.steps(3, twin.h())),
        ("getting outputs", &|| it.snapshot(&twin.watched()).map(|_| ())),
    ];
    for (what, step) in steps {
        step()?;
        if !look(what) {
            return Ok(());
        }
    }
    let _ = it.simple(Simple::Terminate)?;
    it.free()?;
    look("the end of the life");
    Ok(())
}

/// What of the process an FMU has no business with.
#[derive(PartialEq)]
struct Surroundings {
    threads: usize,
    files: Vec<PathBuf>,
    folder: Option<PathBuf>,
    environment: Vec<(OsString, OsString)>,
    /// Lines of `/proc/self/status`.
    status: Vec<String>,
    /// Files below the unpacked FMU with size and time.
    own: Vec<(PathBuf, u64, Option<std::time::SystemTime>)>,
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
    fn now(own: &Path) -> Self {
        let count = |folder: &str| fs::read_dir(folder).map_or(0, Iterator::count);
        let links = fs::read_dir("/proc/self/fd").into_iter().flatten().flatten();
        // The folder that is being read is one of them, under a name that changes.
        let mut files: Vec<_> =
            links.filter_map(|e| fs::read_link(e.path()).ok()).filter(|p| !p.ends_with("fd")).collect();
        files.sort();
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let told = ["Umask:", "SigIgn:", "SigCgt:", "SigBlk:"];
        let mut environment: Vec<_> = std::env::vars_os().collect();
        environment.sort();
        let mut found = Vec::new();
        list(own, &mut found);
        found.sort();
        Self {
            threads: count("/proc/self/task"),
            files,
            folder: std::env::current_dir().ok(),
            environment,
            status: status.lines().filter(|l| told.iter().any(|t| l.starts_with(t))).map(str::to_owned).collect(),
            own: found,
        }
    }

    fn differences(&self, after: &Self) -> Vec<String> {
        let mut found = Vec::new();
        if self.threads != after.threads {
            found.push(format!("there were {} threads, and now there are {}", self.threads, after.threads));
        }
        found
            .extend(after.files.iter().filter(|f| !self.files.contains(f)).map(|f| format!("{} is open", f.display())));
        if self.folder != after.folder {
            found.push("the working directory is another".into());
        }
        let changed = after.environment.iter().chain(&self.environment);
        let changed = changed.filter(|v| !self.environment.contains(v) || !after.environment.contains(v));
        found
            .extend(changed.map(|(name, _)| format!("the environment variable {} is another", name.to_string_lossy())));
        for (old, new) in self.status.iter().zip(&after.status).filter(|(old, new)| old != new) {
            found.push(format!("{:?} is now {:?}", old.replace('\t', " "), new.replace('\t', " ")));
        }
        found.extend(
            after.own.iter().filter(|f| !self.own.contains(f)).map(|f| format!("{} was written", f.0.display())),
        );
        found
    }
}

fn surroundings(bench: &Bench) -> Result<(), Blocked> {
    let binary = second_binary(bench, "guest")?;
    let own = bench.binary.ancestors().nth(3).unwrap_or(&bench.binary).to_owned();
    let before = Surroundings::now(&own);
    bench.calling("loading, a whole life, unloading");
    {
        let twin = bench.twin_of(Raw::open(&binary, bench.md.version).map_err(Blocked)?, 62)?;
        let it = twin.stepping()?;
        for k in 0..20 {
            it.excite(k)?;
            it.steps(1, twin.h())?;
            let _ = it.snapshot(&twin.watched())?;
        }
        let _ = it.simple(Simple::Terminate)?;
        it.free()?;
    }
    let mut found = before.differences(&Surroundings::now(&own));
    // A thread that was told to end may still be on its way, for long on a busy machine.
    for _ in 0..200 {
        if found.is_empty() {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
        found = before.differences(&Surroundings::now(&own));
    }
    for f in found {
        bench.violated(format!("after a whole life {f}"));
    }
    Ok(())
}

fn odd_folder(bench: &Bench) -> Result<(), Blocked> {
    let run = |bench: &Bench| {
        let it = bench.stepping()?;
        it.run(10, bench.h())
    };
    let plain = run(bench)?;
    let home = std::env::current_dir().map_err(|e| failed(&e))?;
    let home = home.join(format!("an FMU %41 #1 \u{e4}\u{4e2d} {}", "x".repeat(120))).join("y".repeat(120));
    let platform = bench.binary.parent().ok_or_else(|| Blocked("the binary has no folder".into()))?;
    let binaries = home.join("binaries").join(platform.file_name().unwrap_or_default());
    copy(platform, &binaries).map_err(|e| failed(&e))?;
    let resources = bench.resources();
    if resources.is_dir() {
        copy(&resources, &home.join("resources")).map_err(|e| failed(&e))?;
    }
    let binary = binaries.join(bench.binary.file_name().unwrap_or_default());
    bench.calling(&format!("a life in {}", home.display()));
    let raw = match Raw::open(&binary, bench.md.version) {
        Ok(raw) => raw,
        Err(why) => {
            bench.violated(format!("in {} the binary does not load: {why}", home.display()));
            return Ok(());
        }
    };
    let mut twin = bench.twin_of(raw, 63)?;
    twin.live_in(&home);
    match run(&twin) {
        Err(Blocked(why)) => bench.violated(format!("in {}: {why}", home.display())),
        Ok(rows) => {
            if let Some((step, i)) = difference(&plain, &rows) {
                bench.violated(format!("{} differs after {} steps", bench.watched()[i].name, step + 1));
            }
        }
    }
    Ok(())
}
