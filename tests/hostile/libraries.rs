//! Libraries that hang, crash, end the process, fork, signal, print, allocate, close and change directory, wherever they are
//! called.

use crate::{XML, described, each, library};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

/// The action of an FMU, the status of `fmu simulate`, and a part of its message.
const ACTS: &[(&str, i32, &str)] = &[
    ("exit", 2, "ended the process with exit status 0"),
    ("_exit", 2, "ended the process with exit status 0"),
    ("exit3", 2, "ended the process with exit status 3"),
    ("terminate-group", 2, "ended the process by SIGTERM"),
    ("kill-group", 2, "ended the process by SIGKILL"),
    ("kill-guard", 2, "ended the process that guards it"),
    ("crash", 2, "ended the process by SIGSEGV (invalid memory access)"),
    ("abort", 2, "ended the process by SIGABRT (abort)"),
    ("recurse", 2, "ended the process by "),
    ("hang", 2, "did not return within 2 s"),
    ("spin", 2, "did not return within 2 s"),
    ("stop", 2, "did not return within 2 s"),
    ("deaf", 2, "did not return within 2 s"),
    ("fork", 0, "warning: the FMUs left processes behind, which are ended now: "),
    ("fork-many", 0, "warning: the FMUs left processes behind, which are ended now: "),
    ("fork-and-crash", 2, "ended the process by SIGSEGV"),
    ("print", 0, "hello"),
    ("allocate", 2, "ended the process by SIGSEGV"),
    ("files", 2, ""),
    ("close", 2, "x: the FMU closed or replaced standard input, standard output, standard error of its process"),
    ("scribble", 0, ""),
    ("chdir", 0, ""),
    ("temporary", 0, ""),
];

const PLACES: [(&str, &str); 5] = [
    ("load", "x.fmu: loading the library"),
    ("instantiate", "x: the instantiation"),
    ("initialize", "x: entering initialization mode"),
    ("step", "x: a step at or after t = 0.3"),
    ("free", "x: freeing the instance or unloading the library"),
];

#[test]
fn simulate_says_what_happened() {
    if library().is_none() {
        return;
    }
    let mut all = Vec::new();
    for (place, expected) in &PLACES {
        // Every action at its most likely call, and the shortest ones at every call.
        let rare = |act: &str| ["exit", "crash", "fork", "hang", "close", "kill-guard"].contains(&act);
        // Descriptors closed at the end no longer matter.
        let matters = |act: &str| (*place, act) != ("free", "close");
        let acts = ACTS.iter().filter(|(act, ..)| (*place == "step" || rare(act)) && matters(act));
        all.extend(acts.map(|act| (*place, *expected, *act)));
    }
    each(&all, |(place, expected, (act, status, part))| {
        let fmu = described(XML);
        let seconds = if part.contains("2 s") { "2" } else { "90" };
        let how = format!("{place} {act}");
        let ended = fmu.run("simulate", &["--timeout", seconds, "--memory", "1", "--csv", "out.csv"], &how);
        assert_eq!(ended.status, *status, "{how}: {ended:?}");
        // Descriptors closed while the archive is open end the process when the archive is closed.
        let named = how == "load close" && ended.errors.contains("x.fmu");
        assert!(named || ended.errors.contains(part), "{how}: {ended:?}");
        assert!(!ended.out.contains("hello"), "the output comes only from the command: {ended:?}");
        let error: Vec<_> = ended.errors.lines().filter(|l| l.starts_with("error: ")).collect();
        assert_eq!(error.len(), usize::from(*status == 2), "{how}: {ended:?}");
        if *status == 2 && !["close", "files"].contains(act) {
            assert!(error[0].contains(expected), "{how}: {ended:?}");
        }
    });
}

/// An FMU writes to foreign descriptors: the recording on standard output contains only data of the command.
#[test]
fn standard_output_is_the_recording() {
    if library().is_none() {
        return;
    }
    let plain = described(XML).run("simulate", &["--csv", "-"], "");
    assert!(plain.status == 0 && plain.out.starts_with("time,y\n0,1\n"), "{plain:?}");
    let acts: Vec<String> =
        ["scribble", "print"].iter().flat_map(|act| PLACES.map(|(place, _)| format!("{place} {act}"))).collect();
    each(&acts, |how| {
        let ended = described(XML).run("simulate", &["--csv", "-"], how);
        assert_eq!((ended.status, &ended.out), (0, &plain.out), "{how}: {ended:?}");
    });
}

/// A measurement of frequency responses ends with an error, and its results are the command's alone.
#[test]
fn bode_survives() {
    if library().is_none() {
        return;
    }
    let input = "<ScalarVariable name=\"u\" valueReference=\"2\" causality=\"input\"><Real start=\"0\"/></ScalarVariable></ModelVariables>";
    let xml = XML.replace("</ModelVariables>", input);
    let step = "x: a step at or after t = 0.3";
    let closed = "closed or replaced standard input, standard output, standard error of its process";
    let cases = [
        ("step exit", "1", step, "ended the process with exit status 0"),
        ("step crash", "1", step, "ended the process by SIGSEGV"),
        ("step hang", "1", step, "did not return within 2 s"),
        ("step crash", "2", step, "ended the process by SIGSEGV"),
        ("step hang", "2", step, "did not return within 2 s"),
        ("load crash", "2", "x.fmu: loading the library", "ended the process by SIGSEGV"),
        ("step close", "1", "x.fmu: an FMU", closed),
        ("step print", "1", "", ""),
    ];
    each(&cases, |(how, jobs, what, why)| {
        let options = ["--from", "u", "--to", "y", "--frequencies", "1,2", "--settle", "0.5", "--amplitude", "1"];
        let limits = ["--timeout", if how.contains("hang") { "2" } else { "90" }, "--memory", "1", "--jobs", *jobs];
        let ended = described(&xml).run("bode", &[&options[..], &limits].concat(), how);
        assert_eq!(ended.status, if why.is_empty() { 0 } else { 2 }, "{how}: {ended:?}");
        assert!(ended.errors.contains(what) && ended.errors.contains(why), "{how}: {ended:?}");
        assert!(!ended.out.contains("hello"), "the output is the command's alone: {ended:?}");
        assert_eq!(ended.out.contains("frequency Hz"), why.is_empty(), "{how}: {ended:?}");
    });
}

/// The checker names the call, or the remaining processes, and its other probes still run.
#[test]
fn check_survives() {
    if library().is_none() {
        return;
    }
    let cases = [
        ("step exit", "L00", "fmi2DoStep", "with exit status 0"),
        ("step terminate-group", "L00", "fmi2DoStep", "by SIGTERM"),
        ("load crash", "B00", "loading the binary", "by SIGSEGV"),
        ("instantiate hang", "L00", "fmi2Instantiate", "did not return within"),
        ("instantiate kill-guard", "L00", "fmi2Instantiate", "ended the process that guards it"),
        ("step allocate", "L00", "fmi2DoStep", "without it, the run took more than 4 GiB of memory"),
        ("instantiate close", "L00", "", ""),
        ("load fork", "B08p", "the process", "left behind"),
        ("step fork", "B08p", "the process", "left behind"),
        ("free fork-many", "B08p", "the process", "left behind"),
        ("step chdir", "B08g", "the working directory", "changed"),
    ];
    each(&cases, |(how, id, call, part)| {
        let fmu = described(XML);
        let seconds = if part.contains("return") { "3" } else { "90" };
        let more = ["--only", "B00,L00,B08g,B08p", "--patience", seconds, "--memory", "1"];
        let ended = fmu.run("check", &more, how);
        let status = i32::from(!id.starts_with("B08"));
        assert_eq!(ended.status, status, "{how}: {ended:?}");
        let found = ended.out.lines().skip_while(|l| !l.trim_start().starts_with(&format!("{id} "))).take(5);
        let found: Vec<_> = found.collect();
        let found = found.join("\n");
        assert!(found.contains("VIOLATED") && found.contains(call) && found.contains(part), "{how}: {ended:?}");
    });
}

/// Only the FMU can stop the process of a probe, which has its own session.
#[test]
fn a_library_that_stops_itself_is_found() {
    if library().is_none() {
        return;
    }
    let cases = [("instantiate stop", "fmi2Instantiate"), ("step stop", "fmi2DoStep")];
    each(&cases, |(how, call)| {
        let ended = described(XML).run("check", &["--only", "L00", "--patience", "1"], how);
        let found =
            ["L00    VIOLATED", call, "stopped the process (as by SIGSTOP), which was not continued within 1 s"];
        assert!(ended.status == 1 && found.iter().all(|part| ended.out.contains(part)), "{how}: {ended:?}");
    });
}

/// A signal to the process group of an FMU ends no other process: here the shell that started the command in its own group.
#[test]
fn the_group_of_the_caller_survives() {
    if library().is_none() {
        return;
    }
    for command in ["check", "simulate"] {
        let fmu = described(XML);
        let script = format!("\"$0\" {command} \"$1\" > /dev/null 2>&1; echo the shell saw $?");
        let output = std::process::Command::new("sh")
            .args(["-c", &script, env!("CARGO_BIN_EXE_fmu")])
            .arg(fmu.fmu())
            .env("HOSTILE", "step terminate-group")
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        let status = if command == "check" { 1 } else { 2 };
        assert_eq!(said.trim(), format!("the shell saw {status}"), "{output:?}");
    }
}

/// The FMU connects to this test; with `--sandbox` it cannot, or the command reports that no sandbox is available.
#[test]
fn a_sandbox_has_no_network() {
    if library().is_none() {
        return;
    }
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let how = format!("step network:{}", listener.local_addr().unwrap().port());
    let open = described(XML).run("simulate", &[], &how);
    assert!(open.errors.contains("exit status 7"), "{open:?}");
    let sandbox = described(XML).run("simulate", &["--sandbox"], &how);
    let refused = sandbox.status == 2 && sandbox.errors.contains("--sandbox is not available here: ");
    assert!(sandbox.status == 0 || refused, "{sandbox:?}");
    assert_eq!(sandbox.errors.lines().count(), usize::from(refused), "{sandbox:?}");
}

/// If a system cannot start threads and processes for a moment, no check reports a finding or ends; if it never can, every
/// check is undetermined. Run as another user, because such limits do not apply to root.
#[test]
fn a_system_without_room_is_no_finding() {
    let root = fs::read_to_string("/proc/self/status").unwrap().contains("\nUid:\t0\t");
    if library().is_none() || !root {
        eprintln!("there is no C compiler, or this is not root: not tested");
        return;
    }
    let place = described(XML);
    let dir = place.fmu().parent().unwrap().to_owned();
    let program = dir.join("fmu");
    fs::copy(env!("CARGO_BIN_EXE_fmu"), &program).unwrap();
    let open = |path: &Path| fs::set_permissions(path, fs::Permissions::from_mode(0o777)).unwrap();
    for path in [dir.clone(), dir.join("temporary"), dir.join("work")] {
        open(&path);
    }
    // This number is unused elsewhere.
    let user = 0x6000_0000 + std::process::id();
    let check = |script: &str| {
        let setpriv = ["setpriv", &format!("--reuid={user}"), &format!("--regid={user}"), "--clear-groups"];
        let mut command = Command::new(setpriv[0]);
        command.args(&setpriv[1..]).args(["bash", "-c", script]).arg(&program).arg(place.fmu());
        command.current_dir(dir.join("work")).env("TMPDIR", dir.join("temporary")).env("HOSTILE", "step chdir");
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{script}: {said}{errors}");
        said
    };
    let options = "check \"$1\" --only B00,L00,B08g,B08p --patience 90 --memory 1";
    let busy =
        check(&format!("ulimit -u 12; for k in 1 2 3 4 5 6 7 8 9 10; do (sleep 2 &); done; exec \"$0\" {options}"));
    assert!(busy.contains("after a complete run: the working directory changed"), "{busy}");
    assert!(!busy.contains("2 not determined") && !busy.contains("1 not determined"), "{busy}");
    let full = check(&format!("ulimit -u 1; exec \"$0\" {}", options.replace("B00,L00,", "")));
    assert!(full.contains("the probe could not be started: Resource temporarily unavailable"), "{full}");
}
