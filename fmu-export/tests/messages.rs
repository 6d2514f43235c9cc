//! Logging: messages, their escapes and receivers; and the creation of instances.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod common;

use common::model::*;
use common::*;
use fmu_export::abi::types::*;
use std::ffi::{CStr, CString};
use std::ptr::{null, null_mut};
use std::rc::Rc;

/// An instance with logging on, its messages so far included.
fn talking(version: u8) -> Fmu {
    let journal = Rc::<Journal>::default();
    let it = Fmu::open(version, c"drive 1", &token(), &raw const *journal, true, true);
    Fmu { version, it, journal }
}

fn drain(journal: &Journal) -> Vec<Message> {
    journal.0.borrow_mut().drain(..).collect()
}

fn free(version: u8, it: InstancePointer) {
    assert!(!it.is_null());
    drop(Fmu { version, it, journal: Rc::default() });
}

#[test]
fn the_events_of_a_life() {
    for version in [2, 3] {
        let fmu = talking(version);
        assert_eq!((fmu.set(&[R, U], &[3.5, 1.0]), fmu.enter(2.0, None), fmu.exit()), (OK, OK, OK));
        assert_eq!((fmu.step(2.0, 0.5), fmu.terminate(), fmu.reset()), (OK, OK, OK));
        let messages = drain(&fmu.journal);
        let texts: Vec<&str> = messages.iter().map(|m| m.text.as_str()).collect();
        let expected = [
            "drive 1: instance of Probe 1.0",
            "drive 1: initialized at 2 s with motor.R = 3.5",
            "drive 1: terminated at 2.5 s",
            "drive 1: reset",
        ];
        assert_eq!(texts, expected);
        let name = (version == 2).then(|| "drive 1".to_owned());
        assert!(messages.iter().all(|m| (m.status, m.category.as_str()) == (OK, "logEvents") && m.instance == name));
    }
}

#[test]
fn errors_are_heard_with_logging_off_and_nothing_else_is() {
    for version in [2, 3] {
        let fmu = Fmu::started(version);
        assert_eq!((fmu.step(0.0, 0.1), fmu.terminate()), (OK, OK));
        assert_eq!(fmu.step(0.1, 0.1), ERROR);
        assert_eq!(
            fmu.error(),
            format!("fmi{version}DoStep: not allowed in the state Terminated; allowed in: Step Mode")
        );
    }
    let fmu = Fmu::started(2);
    assert_eq!(unsafe { fmi2GetStatus(fmu.it, 0, &mut 0) }, DISCARD);
    assert!(drain(&fmu.journal).is_empty());
    let fmu = talking(2);
    assert_eq!((fmu.enter(0.0, None), fmu.exit()), (OK, OK));
    drain(&fmu.journal);
    assert_eq!(unsafe { fmi2GetStatus(fmu.it, 0, &mut 0) }, DISCARD);
    let messages = drain(&fmu.journal);
    assert_eq!((messages.len(), messages[0].status, messages[0].category.as_str()), (1, DISCARD, "logStatusDiscard"));
}

#[test]
fn percent_and_hash_are_escaped() {
    for (version, expected) in
        [(2, "x left the finite numbers by 50 %%, see ##4"), (3, "x left the finite numbers by 50 %, see ##4")]
    {
        let fmu = Fmu::entered(version);
        assert_eq!((fmu.set_mode(FAULTY), fmu.exit(), fmu.step(0.0, 0.1)), (OK, OK, ERROR));
        assert_eq!(fmu.error(), format!("fmi{version}DoStep: {expected}"));
    }
}

fn switch(fmu: &Fmu, on: bool, categories: &[&CStr]) -> c_int {
    let list: Vec<Text> = categories.iter().map(|c| c.as_ptr()).collect();
    let pointer = if list.is_empty() { null() } else { list.as_ptr() };
    unsafe {
        if fmu.version == 2 {
            fmi2SetDebugLogging(fmu.it, Fmi2Boolean(on.into()), list.len(), pointer)
        } else {
            fmi3SetDebugLogging(fmu.it, Fmi3Boolean(on.into()), list.len(), pointer)
        }
    }
}

/// Whether a reset is logged.
fn hears_events(fmu: &Fmu) -> bool {
    drain(&fmu.journal);
    assert_eq!(fmu.reset(), OK);
    !drain(&fmu.journal).is_empty()
}

#[test]
fn categories_are_switched() {
    for version in [2, 3] {
        let fmu = Fmu::new(version);
        assert!(!hears_events(&fmu));
        for (on, categories, heard) in [
            (true, &[][..], true),
            (false, &[], false),
            (true, &[c"logStatusError", c"logStatusFatal"], false),
            (true, &[c"logEvents"], true),
            (true, &[c"logEvents"], true),
            (false, &[c"logStatusError"], true),
            (false, &[c"logEvents"], false),
            (true, &[], true),
            // FMI 2.0.5, 2.1.5: only these; FMI 3.0.2, 2.3.1: these too.
            (true, &[c"logStatusWarning"], version == 3),
        ] {
            assert_eq!(switch(&fmu, on, categories), OK);
            assert_eq!(hears_events(&fmu), heard, "{version} {on} {categories:?}");
        }
        assert_eq!(switch(&fmu, true, &[c"logAll"]), if version == 2 { OK } else { ERROR });
        for categories in [&[c"logEvents", c"logNothing"][..], &[c""], &[c"\xff"]] {
            let fmu = Fmu::new(version);
            assert_eq!(switch(&fmu, true, categories), ERROR);
            let message = fmu.error();
            assert!(message.contains("does not exist; these do: logEvents,") || message.contains("not UTF-8"));
            assert!(!hears_events(&fmu));
        }
        let fmu = Fmu::new(version);
        let list = [c"logEvents".as_ptr(), null()];
        let status = unsafe {
            if version == 2 {
                fmi2SetDebugLogging(fmu.it, Fmi2Boolean(1), 2, list.as_ptr())
            } else {
                fmi3SetDebugLogging(fmu.it, Fmi3Boolean(1), 2, list.as_ptr())
            }
        };
        assert_eq!(status, ERROR);
        assert!(fmu.error().contains("a log category is NULL"));
    }
}

#[test]
fn names_and_tokens_that_are_wrong() {
    for version in [2, 3] {
        let journal = Journal::default();
        let refused = |name: &CStr, token: &CStr, why: &str| {
            assert!(Fmu::open(version, name, token, &raw const journal, true, false).is_null());
            let messages = drain(&journal);
            assert_eq!((messages.len(), messages[0].status), (1, ERROR));
            assert!(messages[0].text.contains(why), "{messages:?}");
            // Without a logger: silent, and no crash.
            assert!(Fmu::open(version, name, token, &raw const journal, false, true).is_null());
            assert!(drain(&journal).is_empty());
        };
        refused(c"", &token(), "name is missing");
        refused(c" \t\n", &token(), "name is missing");
        refused(c"a", c"", "expected: description and binary are of different builds");
        refused(c"a", c"{00000000-0000-0000-0000-000000000000}", "{00000000-0000-0000-0000-000000000000}");
        let bare = CString::new(token().to_str().unwrap().trim_matches(['{', '}'])).unwrap();
        refused(c"a", &bare, token().to_str().unwrap());
        free(version, Fmu::open(version, c"a", &token(), null(), false, true));
    }
}

#[test]
fn null_arguments_of_fmi2_instantiate() {
    let (no, token) = (Fmi2Boolean(0), token());
    loud();
    unsafe {
        assert!(fmi2Instantiate(null(), 1, token.as_ptr(), null(), null(), no, no).is_null());
        assert!(fmi2Instantiate(c"a".as_ptr(), 1, null(), null(), null(), no, no).is_null());
        assert!(fmi2Instantiate(c"a".as_ptr(), 0, token.as_ptr(), null(), null(), no, no).is_null(), "Model Exchange");
        assert!(fmi2Instantiate(c"a".as_ptr(), 2, token.as_ptr(), null(), null(), no, no).is_null());
        for resources in [null(), c"".as_ptr(), c"file:///nowhere/%20".as_ptr(), c"\xff".as_ptr()] {
            free(2, fmi2Instantiate(c"a".as_ptr(), 1, token.as_ptr(), resources, null(), no, Fmi2Boolean(1)));
        }
    }
}

#[test]
fn wishes_of_fmi3_that_are_refused() {
    let (no, yes, token, journal) = (Fmi3Boolean(0), Fmi3Boolean(1), token(), Journal::default());
    loud();
    let environment = (&raw const journal).cast_mut().cast();
    let open = |event_mode: Fmi3Boolean, early: Fmi3Boolean, n: usize, logger: Option<Fmi3Logger>| unsafe {
        let vr = [X];
        let intermediate = if n == 0 { null() } else { vr.as_ptr() };
        let (name, token) = (c"a".as_ptr(), token.as_ptr());
        fmi3InstantiateCoSimulation(
            name,
            token,
            null(),
            no,
            no,
            event_mode,
            early,
            intermediate,
            n,
            environment,
            logger,
            None,
        )
    };
    for (event_mode, n, why) in [(yes, 0, "hasEventMode = false"), (no, 1, "providesIntermediateUpdate = false")] {
        assert!(open(event_mode, no, n, Some(log3)).is_null());
        assert!(drain(&journal)[0].text.contains(why));
        assert!(open(event_mode, no, n, None).is_null());
    }
    free(3, open(no, yes, 0, Some(log3)));
    assert!(drain(&journal).is_empty());
    let (name, token) = (c"a".as_ptr(), token.as_ptr());
    unsafe {
        assert!(fmi3InstantiateModelExchange(name, token, null(), no, no, environment, Some(log3)).is_null());
        assert!(drain(&journal)[0].text.contains("Model Exchange"));
        let it =
            fmi3InstantiateScheduledExecution(name, token, null(), no, no, environment, Some(log3), None, None, None);
        assert!(it.is_null() && drain(&journal)[0].text.contains("Scheduled Execution"));
        assert!(fmi3InstantiateModelExchange(null(), null(), null(), no, no, null_mut(), None).is_null());
    }
}

#[test]
fn the_binary_tells_the_versions_of_the_standards() {
    let said = |text: Text| unsafe { CStr::from_ptr(text) };
    let versions = [fmi2GetVersion(), fmi2GetTypesPlatform(), fmi3GetVersion()].map(said);
    assert_eq!(versions, [c"2.0", c"default", c"3.0"]);
}
