//! Side effects on the importer's process that an FMU must not have: threads, processor, files.

use crate::check::{Check, Levels, Run};
use crate::checks::process::instances::only_once;
use crate::checks::process::shared::copies::{copy, failed, second_binary};
use crate::checks::process::shared::surroundings::{left_behind, settings, written};
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use fmu_import::raw::{Arguments, Raw, Simple, float_control};
use std::ffi::CString;

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "B06", clause: "hardening", levels: Levels::HARD, run: Run::Probe(small_stack),
        requirement: "The binary loads and runs in a secondary thread with a stack of 256 KiB.",
        tried: "Loads and runs in a thread with 256 KiB.", fix: "Put large arrays on the heap." },
    Check { id: "B08f", clause: "3.0.2, 2.2.1", levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Any(floating_point),
        requirement: "Neither loading nor any call changes the floating-point control (rounding, exceptions, flushing to zero).",
        tried: "Reads the control registers after each call.", fix: "Restore them before returning; avoid -ffast-math when linking." },
    Check { id: "B08g", clause: "3.0.2, 2.2.1", levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Any(settings),
        requirement: "A complete run changes no setting of the process: working directory, environment, umask, signals, locale, processors, priority, \
            timers and limits.",
        tried: "Compares the settings before loading and after unloading.", fix: "Do not change them, or restore them before returning." },
    Check { id: "B08r", clause: "3.0.2, 2.5.1.5", levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Any(written),
        requirement: "A run neither writes nor removes files in the folder of the FMU, including its resources.",
        tried: "Compares the folder before loading and after unloading.", fix: "Write to a path given by the importer, for example as a parameter." },
    Check { id: "B08p", clause: "hardening", levels: Levels::HARD, run: Run::Any(left_behind),
        requirement: "A complete run, from loading to unloading, leaves nothing behind: no threads, child processes, open files, files in temporary folders.",
        tried: "Compares the process and these folders before loading and after unloading.",
        fix: "Close and remove files, end threads and processes." },
    Check { id: "Z09", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels::SHOULD, run: Run::Probe(unusual_path),
        requirement: "The FMU runs from a folder whose path has blanks, '%', '#', non-ASCII letters and more than 200 characters, and that contains only \
            its binaries and resources; in FMI 2.0 also with the location file:/PATH.",
        tried: "Runs from such a folder and compares; in FMI 2.0, initializes with the location file:/PATH.",
        fix: "Decode the URI in FMI 2.0, and use paths of any length." },
];

/// Minimum stack, in bytes, of a thread in which an importer may run the FMU.
const STACK: usize = 256 << 10;

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
    if session.description.co_simulation.is_some() {
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
        if !check_control("termination") {
            return Ok(());
        }
    }
    session.record_call("Instantiate once more, after FreeInstance, and a run of all interfaces");
    duplicate.complete_run()?;
    check_control("a run of all interfaces");
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
    copy(platform, &binaries, &[]).map_err(|e| failed(&e))?;
    let resources = session.resources();
    if resources.is_dir() {
        copy(&resources, &folder_of_run.join("resources"), &[]).map_err(|e| failed(&e))?;
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
    short_uri(session)
}

/// A URI of a file need not have an authority, not even an empty one (FMI 2.0.5, 2.1.5).
fn short_uri(session: &Session) -> Result<(), NotDetermined> {
    let arguments = session.arguments("probe");
    let uri = arguments.resources.as_ref().map(|uri| uri.to_string_lossy().replacen("file:///", "file:/", 1));
    let Some(uri) = uri.filter(|uri| session.is_v2() && uri.starts_with("file:/") && !only_once(session)) else {
        return Ok(());
    };
    let Some(instance) = session.instantiate(&Arguments { resources: CString::new(uri).ok(), ..arguments })? else {
        session
            .violated("with the resource location file:/PATH instead of file:///PATH, fmi2Instantiate returned NULL");
        return Ok(());
    };
    if let Err(why) = instance.initialize() {
        session.failed("with the resource location file:/PATH instead of file:///PATH", why);
    }
    Ok(())
}
