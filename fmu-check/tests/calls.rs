//! The table of calls against an FMU in C that breaks no rule, and against one fault at a time: in seconds, with the checker's own
//! program. `tests/check` at the root of the workspace has the faults of all checks.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use fmu_check::{Options, Verdict, run};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Checks that rest on the table of calls and on calls by name.
const SIMULATION: &[&str] = &["L07", "L08", "L08u", "L08n"];
const EXCHANGE: &[&str] = &["E01", "E01i", "E02", "N04", "N05"];

/// A C file of the workspace's faults, compiled with one of them.
fn fmu(folder: &Path, source: &str, version: u32, fault: &str, xml: &str) -> PathBuf {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/check");
    let library = folder.join("Small.so");
    let mut cc = Command::new("cc");
    cc.args(["-shared", "-fPIC", "-O1", "-w", "-fvisibility=hidden", &format!("-DFAULT_{fault}")]);
    if version == 3 && source == "exchange.c" {
        cc.arg("-DFMI3");
    }
    assert!(cc.arg(sources.join(source)).arg("-o").arg(&library).arg("-lm").status().unwrap().success(), "{fault}");
    let platform = if version == 2 { "linux64" } else { "x86_64-linux" };
    let path = folder.join(format!("{version}-{fault}.fmu"));
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    for (name, bytes) in [
        ("modelDescription.xml".to_owned(), std::fs::read(sources.join(xml)).unwrap()),
        (format!("binaries/{platform}/Small.so"), std::fs::read(library).unwrap()),
    ] {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&bytes).unwrap();
    }
    zip.finish().unwrap();
    path
}

/// Each fault violates the checks that are named, and no other of `checks`.
fn each(checks: &[&str], source: &str, version: u32, xml: &str, faults: &[(&str, &[&str])]) {
    let folder = tempfile::tempdir().unwrap();
    for (fault, expected) in faults {
        let options = Options {
            only: checks.iter().map(ToString::to_string).collect(),
            program: Some(env!("CARGO_BIN_EXE_fmu-check").into()),
            ..Options::default()
        };
        let report = run(&fmu(folder.path(), source, version, fault, xml), &options).unwrap_or_else(|e| panic!("{e}"));
        let violated: Vec<_> = report.violated().map(|finding| finding.id).collect();
        let told: Vec<_> = report.violated().map(|finding| &finding.verdict).collect();
        assert_eq!(violated, *expected, "{source} {version} {fault}: {told:?}");
        let open = report.findings.iter().find(|finding| matches!(finding.verdict, Verdict::NotDetermined(_)));
        assert!(open.is_none(), "{source} {version} {fault}: {open:?}");
    }
}

#[test]
fn calls_of_co_simulation() {
    let faults: &[(&str, &[&str])] = &[("NONE", &[]), ("L07", &["L07"]), ("L08", &["L08"]), ("L08u", &["L08u"])];
    each(SIMULATION, "fmu.c", 2, "fmu.xml", &[faults, &[("L08n", &["L08n"])]].concat());
    each(SIMULATION, "fmu3.c", 3, "fmu3.xml", faults);
}

#[test]
fn calls_of_model_exchange_and_event_mode() {
    let faults: &[(&str, &[&str])] = &[("NONE", &[]), ("E01", &["E01"]), ("E01i", &["E01i"]), ("E02", &["E02"])];
    each(EXCHANGE, "exchange.c", 2, "exchange2.xml", faults);
    each(EXCHANGE, "exchange.c", 3, "exchange3.xml", &[("NONE", &[]), ("N04", &["N04"]), ("N05", &["N05"])]);
}

/// Step Mode is reached with two steps: an FMU that fails after its first step is not taken for one that passes.
#[test]
fn step_mode_is_that_after_two_steps() {
    let folder = tempfile::tempdir().unwrap();
    let program = Some(env!("CARGO_BIN_EXE_fmu-check").into());
    let options = Options { only: vec!["L09a".into()], program, ..Options::default() };
    let report = run(&fmu(folder.path(), "fmu.c", 2, "L09a", "fmu.xml"), &options).unwrap_or_else(|e| panic!("{e}"));
    let calls = &report.finding("L09a").unwrap().calls;
    let steps: Vec<_> = calls.iter().filter(|call| call.starts_with("fmi2DoStep")).collect();
    let [first, second, wrong, after] = &steps[..] else { panic!("{calls:?}") };
    assert!(first.ends_with("OK") && second.ends_with("OK") && wrong.ends_with("Error") && after.ends_with("OK"));
}
