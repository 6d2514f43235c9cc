//! The call log of `FMU_CALL_LOG`: each scenario runs in a separate process with that variable, and the test reads the files.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod common;
#[path = "common/played.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod played;

use common::model::*;
use common::*;
use fmu_core::call_log::{LogReader, LoggedCall};
use fmu_export::abi::types::*;
use played::{folder, logs, play};
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicPtr, Ordering};

fn calls(log: &str) -> Vec<LoggedCall> {
    let (head, reader) = LogReader::new(log).unwrap();
    let token = token();
    assert_eq!(
        (head.model.as_str(), head.version.as_str(), head.token.as_str()),
        ("Probe", "1.0", token.to_str().unwrap())
    );
    reader.map(Result::unwrap).collect()
}

/// Plays the scenario that the environment names; without one, nothing.
#[test]
fn scenarios() {
    let Some(name) = played::scenario() else { return };
    match name.as_str() {
        "run2" => run(2),
        "run3" => run(3),
        "abort" => {
            let fmu = Fmu::entered(3);
            assert_eq!((fmu.set_integer(N, ABORTING), fmu.exit()), (OK, OK));
            fmu.step(0.0, 0.1);
        }
        "reentrant" => reentrant(),
        "taken" => {
            let folder = std::env::var_os("FMU_CALL_LOG").unwrap();
            std::fs::write(Path::new(&folder).join(format!("Probe-{}-1.calls", std::process::id())), "another")
                .unwrap();
            Fmu::started(3);
        }
        "warned" => {
            let fmu = Fmu::started(3);
            println!("{:?}", fmu.journal.0.borrow());
            assert_eq!(fmu.step(0.0, 0.1), OK);
        }
        _ => unreachable!("{name}"),
    }
}

/// Two instances: one that simulates, one that fails.
fn run(version: u8) {
    let fmu = Fmu::entered(version);
    assert_eq!(fmu.set(&[U, K], &[0.1 + 0.2, -0.0]), OK);
    if version == 3 {
        assert_eq!(fmu.set(&[MAP], &[0.0, 1e300, f64::MIN_POSITIVE]), OK);
        assert_eq!(fmu.set(&[K], &[f64::INFINITY]), ERROR);
        assert_eq!((fmu.reset(), fmu.enter(0.5, Some(2.0))), (OK, OK));
    }
    assert_eq!(fmu.set_mode(1), OK);
    assert_eq!(fmu.exit(), OK);
    let start = if version == 3 { 0.5 } else { 0.0 };
    let (mut state, mut values) = (null_mut(), [0.0; 2]);
    assert_eq!((fmu.save(&mut state), fmu.step(start, 0.1), fmu.try_get(&[X, U], &mut values)), (OK, OK, OK));
    assert_eq!((fmu.restore(state), fmu.free_state(&mut state)), (OK, OK));
    let other = Fmu::entered(version);
    assert_eq!((other.set_mode(PANICKY), other.exit(), other.step(0.0, 0.1)), (OK, OK, ERROR));
    assert_eq!(other.set(&[U], &[1.0]), ERROR);
    unsafe {
        let nothing = if version == 2 {
            fmi2GetReal(other.it, null(), 3, null_mut())
        } else {
            fmi3GetFloat64(other.it, null(), 3, null_mut(), 0)
        };
        assert_eq!(nothing, ERROR);
    }
}

/// A logger that calls the instance back, which is refused.
fn reentrant() {
    static IT: AtomicPtr<c_void> = AtomicPtr::new(null_mut());
    extern "C" fn log(_: *mut c_void, _: c_int, _: Text, _: Text) {
        let it = IT.load(Ordering::Relaxed);
        if !it.is_null() {
            assert_eq!(unsafe { fmi3Reset(it) }, ERROR);
        }
    }
    loud();
    let (no, token) = (Fmi3Boolean(0), token());
    unsafe {
        let resources = c"/a \"b\"\n\xff".as_ptr();
        let logger = Some(log as Fmi3Logger);
        let (name, token) = (c"x".as_ptr(), token.as_ptr());
        let it = fmi3InstantiateCoSimulation(
            name,
            token,
            resources,
            Fmi3Boolean(1),
            no,
            no,
            no,
            null(),
            0,
            null_mut(),
            logger,
            None,
        );
        IT.store(it, Ordering::Relaxed);
        assert_eq!(fmi3Terminate(it), ERROR);
        IT.store(null_mut(), Ordering::Relaxed);
        fmi3FreeInstance(it);
        assert!(fmi3InstantiateModelExchange(name, token, null(), no, no, null_mut(), logger).is_null());
    }
}

const RUN_3: &str = r#"
- fmi3InstantiateCoSimulation(name="probe", token="TOKEN", resources=NULL, visible=0, logging_on=0, event_mode_used=0,
    early_return_allowed=0, required=NULL, n=0, logger=given, intermediate=NULL) -> instance
0.0 fmi3EnterInitializationMode(tolerance_defined=0, tolerance=0.0, start=0.0, stop_defined=0, stop=0.0) -> OK
0.0 fmi3SetFloat64(vr=[1, 2], n=2, values=[0.30000000000000004, -0.0], m=2) -> OK
0.0 fmi3SetFloat64(vr=[8], n=1, values=[0.0, 1e300, 2.2250738585072014e-308], m=3) -> OK
0.0 fmi3SetFloat64(vr=[2], n=1, values=[inf], m=1) -> Error
0.0 fmi3Reset() -> OK
0.0 fmi3EnterInitializationMode(tolerance_defined=0, tolerance=0.0, start=0.5, stop_defined=1, stop=2.0) -> OK
0.5 fmi3SetInt64(vr=[13], n=1, values=[1], m=1) -> OK
0.5 fmi3ExitInitializationMode() -> OK
0.5 fmi3GetFMUState(state=#0) -> OK state=#1
0.5 fmi3DoStep(t=0.5, h=0.1, no_set_state_prior=1, event_handling_needed=?1, terminate_simulation=?1, early_return=?1,
    last_successful_time=?1) -> OK event_handling_needed=0 terminate_simulation=0 early_return=0 last_successful_time=0.6
0.6 fmi3GetFloat64(vr=[4, 1], n=2, values=?2, m=2) -> OK values=[0.69..., 1.0]
0.6 fmi3SetFMUState(state=#1) -> OK
0.5 fmi3FreeFMUState(state=#1) -> OK state=#0
0.5 fmi3FreeInstance() -> done
"#;

const FAILED_2: &str = r#"
- fmi2Instantiate(name="probe", type=1, token="TOKEN", resources=NULL, callbacks=given, logger=given, visible=0, logging_on=0) -> instance
0.0 fmi2SetupExperiment(tolerance_defined=0, tolerance=0.0, start=0.0, stop_defined=0, stop=0.0) -> OK
0.0 fmi2EnterInitializationMode() -> OK
0.0 fmi2SetInteger(vr=[13], n=1, values=[4]) -> OK
0.0 fmi2ExitInitializationMode() -> OK
0.0 fmi2DoStep(t=0.0, h=0.1, no_set_state_prior=1) -> Error
0.0 fmi2SetReal(vr=[1], n=1, values=[1.0]) -> Error
0.0 fmi2GetReal(vr=NULL, n=3, values=NULL) -> Error
0.0 fmi2FreeInstance() -> done
"#;

/// Compares without the head; `0.69...` stands for any digits that follow, and `TOKEN` for the token. An indented line continues
/// the one before.
fn assert_is(log: &str, expected: &str) {
    let token = token();
    let expected = expected.trim().replace("\n    ", " ");
    let body = log.split_once("\n\n").unwrap().1;
    for (line, wanted) in body.lines().zip(expected.lines()) {
        let wanted = wanted.replace("TOKEN", token.to_str().unwrap());
        match wanted.split_once("...") {
            None => assert_eq!(line, wanted),
            Some((start, end)) => assert!(line.starts_with(start) && line.ends_with(end), "{line}"),
        }
    }
    assert_eq!(body.lines().count(), expected.lines().count(), "{body}");
}

#[test]
fn each_instance_has_a_file_with_all_its_calls() {
    let logs_3 = logs("run3");
    assert_eq!(logs_3.len(), 2);
    assert_is(&logs_3[0], RUN_3);
    let logs_2 = logs("run2");
    assert_is(&logs_2[1], FAILED_2);
    for (log, count) in [(&logs_3[0], 15), (&logs_3[1], 8), (&logs_2[0], 12), (&logs_2[1], 9)] {
        let calls = calls(log);
        assert_eq!(calls.len(), count, "{log}");
        assert!(calls.iter().all(|call| call.ended.is_some() && call.inside.is_empty()));
    }
}

/// Of an earlier process with the same number, or of another binary in this one.
#[test]
fn a_file_that_exists_is_kept() {
    let [taken, own] = &logs("taken")[..] else { panic!("two files") };
    assert_eq!(taken, "another");
    assert_eq!(calls(own)[0].name, "fmi3InstantiateCoSimulation");
}

#[test]
fn equal_runs_have_equal_files() {
    assert_eq!(logs("run2"), logs("run2"));
}

#[test]
fn a_call_in_which_the_process_ends_is_the_last_line() {
    let log = &logs("abort")[0];
    assert!(log.ends_with("last_successful_time=?1)"), "{log}");
    let last = calls(log).pop().unwrap();
    assert_eq!((last.name.as_str(), last.ended), ("fmi3DoStep", None));
}

#[test]
fn a_call_from_the_logger_is_inside_the_call_that_logs() {
    let logs = logs("reentrant");
    assert_eq!(logs.len(), 2);
    let [first, terminate, free] = &calls(&logs[0])[..] else { panic!("{}", logs[0]) };
    assert!(first.to_string().contains(r#"resources="/a \"b\"\n\xff", visible=1"#), "{first}");
    let inner: Vec<_> = terminate.inside.iter().map(|c| (c.name.as_str(), c.ended.clone().unwrap().status)).collect();
    assert_eq!(
        (inner, terminate.ended.clone().unwrap().status.as_str()),
        (vec![("fmi3Reset", "Error".into())], "Error")
    );
    assert_eq!(free.name, "fmi3FreeInstance");
    assert_eq!(calls(&logs[1])[0].ended.clone().unwrap().status, "NULL");
}

#[test]
fn a_folder_that_cannot_be_written_is_one_warning() {
    let said = play("warned", Some(Path::new("/no/such/folder")));
    assert!(said.contains("1 passed"), "{said}");
    assert_eq!(said.matches("logStatusWarning").count(), 1, "{said}");
    let path = format!("FMU_CALL_LOG: {}", Path::new("/no/such/folder").join("Probe-").display());
    assert!(said.contains(&path) && said.contains("cannot be written: No such file"), "{said}");
}

#[test]
fn without_the_variable_there_is_no_file_and_no_warning() {
    let folder = folder();
    for value in [None, Some(Path::new(""))] {
        let said = play("warned", value);
        assert!(said.contains("1 passed") && said.contains("[]"), "{said}");
    }
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
    std::fs::remove_dir(&folder).unwrap();
}
