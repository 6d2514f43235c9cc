//! FMUs whose calls do not return, and a file whose checks take seconds: both have limits in seconds, so no other program runs
//! beside it, and its tests run one at a time.
#![allow(missing_docs, unreachable_pub, clippy::missing_panics_doc)]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

#[path = "../faults/findings.rs"]
mod findings;
#[path = "../faults/fmus.rs"]
mod fmus;
#[path = "../faults/zip.rs"]
mod zip;

use findings::{check_within, listed, violated};
use fmu_check::Verdict;
use fmus::{compile, pack};
use std::fmt::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use zip::{Entry, write};

/// What runs the probes.
const PROGRAM: &str = env!("CARGO_BIN_EXE_fmu-check");

/// Waits until no other test runs.
fn alone() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Fault, the checks that run, the seconds that a call may take, and the checks that must fail.
type Row = (&'static str, &'static [&'static str], u64, &'static [&'static str]);

const FAULTS: &[Row] = &[
    // A loop in a step with NaN or with an infinite step: these calls have 1 s.
    ("G07a", &["access"], 120, &["G07a"]),
    ("T02b", &["time"], 120, &["T02b"]),
    // An endless loop in every run of an FMU that is checked as a whole, and one that sleeps.
    ("HANG", &[], 4, &["L00"]),
    ("WAIT", &["L00"], 2, &["L00"]),
];

#[test]
fn each_hang_is_found_by_its_check() {
    let _alone = alone();
    let dir = tempfile::tempdir().unwrap();
    for (fault, only, seconds, ids) in FAULTS {
        let Some(binary) = compile(2, fault) else {
            eprintln!("there is no C compiler: not tested");
            return;
        };
        let report = check_within(&pack(dir.path(), 2, fault, &binary), only, *seconds);
        assert_eq!((violated(&report), report.fatal()), (ids.to_vec(), ids.to_vec()), "{fault}: {}", listed(&report));
    }
}

/// One case that hangs is enough: the probe does not wait for the others.
#[test]
fn a_second_hang_is_not_waited_for() {
    let _alone = alone();
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(2, "T02b") else { return };
    // Two of five cases hang.
    let path = pack(dir.path(), 2, "hang", &binary);
    let began = Instant::now();
    let report = check_within(&path, &["T02b"], 20);
    assert_eq!(report.fatal(), ["T02b"]);
    // One call has 1 s, because the arguments are wild; a busy machine may double that, and more.
    assert!(began.elapsed() < Duration::from_secs(18), "{:?}", began.elapsed());
    let printed = format!("{:?}", report.finding("T02b").unwrap().verdict);
    assert_eq!(printed.matches("did not return").count(), 1, "{printed}");
}

/// A second instance that hangs is reported by the check for it, not by every check that creates two.
#[test]
fn a_second_instance_that_hangs() {
    let _alone = alone();
    let dir = tempfile::tempdir().unwrap();
    for version in [2, 3] {
        let Some(binary) = compile(version, "SECOND") else { return };
        let path = pack(dir.path(), version, "SECOND", &binary);
        let report = check_within(&path, &["L04a", "T10", "G-L4"], 2);
        assert_eq!((violated(&report), report.fatal()), (vec!["L04a"], vec!["L04a"]), "{}", listed(&report));
        let Verdict::NotDetermined(why) = &report.finding("T10").unwrap().verdict else { panic!("{report:?}") };
        assert!(why.starts_with("[2] ") && why.ends_with("unlike in the first instance: see L04a"), "{why}");
    }
}

/// Many variables: the checks of the file take seconds, and all of them finish.
#[test]
fn a_hundred_thousand_variables() {
    let _alone = alone();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let (mut variables, mut outputs, mut unknowns) = (String::new(), String::new(), String::new());
    for n in 0..50_000 {
        let _ = writeln!(
            variables,
            "<Float64 name=\"part[{n}].u\" valueReference=\"{}\" causality=\"input\" start=\"0\" unit=\"m\"/>\
             <Float64 name=\"part[{n}].y\" valueReference=\"{}\" causality=\"output\" unit=\"m\"/>",
            100 + 2 * n,
            101 + 2 * n
        );
        let _ = writeln!(outputs, "<Output valueReference=\"{}\" dependencies=\"{}\"/>", 101 + 2 * n, 100 + 2 * n);
        let _ = writeln!(unknowns, "<InitialUnknown valueReference=\"{}\" dependencies=\"\"/>", 101 + 2 * n);
    }
    let xml = include_str!("../faults/fmu3.xml").replace("</ModelVariables>", &format!("{variables}</ModelVariables>"));
    let xml = xml.replacen("    <InitialUnknown", &format!("{outputs}    <InitialUnknown"), 1);
    let xml = xml.replace("</ModelStructure>", &format!("{unknowns}</ModelStructure>"));
    write(&path, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/fmu.c", b"x")]);
    let report = check_within(&path, &["archive", "xml", "variables", "structure", "terminals"], 120);
    let open = |v: &Verdict| matches!(v, Verdict::NotDetermined(why) if why.contains("take more than"));
    let open = report.findings.iter().find(|f| open(&f.verdict));
    assert!(open.is_none(), "{open:?}");
    assert!(report.violated().all(|f| ["Z04a", "Z07", "V01b"].contains(&f.id)), "{}", listed(&report));
}
