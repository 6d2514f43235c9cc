//! Features for the CI of another exporter: known findings, formats, explanations, several files, time limits, calls.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::zip::{Entry, write};
use crate::{check, compile, pack};
use fmu_check::Level;
use model_description::FmiVersion;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Status, output and errors of the command.
fn fmu_check(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_fmu-check")).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// An archive without a binary; the change makes findings.
fn archive(dir: &Path, name: &str, change: fn(&str) -> String) -> PathBuf {
    let path = dir.join(name);
    let xml = change(include_str!("fmu.xml")).into_bytes();
    let text = |name: &str| Entry::new(name, b"x");
    write(&path, &[Entry::new("modelDescription.xml", &xml), text("documentation/index.html"), text("sources/fmu.c")]);
    path
}

/// A rule of thumb does not count for a CI that requests only certain findings.
#[test]
fn findings_below_a_confidence_do_not_count() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(2, "T03") else { return };
    let path = pack(dir.path(), 2, "T03", &binary);
    let run = |more: &[&str]| fmu_check(&[&[path.to_str().unwrap(), "--only", "T03", "--strict"], more].concat());
    let (code, text, _) = run(&[]);
    assert!(code == Some(1) && text.contains("T03    VIOLATED (hard, a hint)"), "{text}");
    assert_eq!(run(&["--confidence", "certain"]).0, Some(0));
    assert_eq!(run(&["--confidence", "hint"]).0, Some(1));
    let (_, json, _) = run(&["--format", "json"]);
    assert!(json.contains("\"confidence\": \"hint\""), "{json}");
}

/// Two findings at level must: S01 and X08.
fn two_faults(xml: &str) -> String {
    let without = xml.replacen("<Outputs>\n      <Unknown index=\"4\"/>", "<Outputs>", 1);
    without.replace("canGetAndSetFMUstate=\"true\"", "canGetAndSetFMUstate=\"false\"")
}

const STATIC: &str = "archive,xml,variables,structure";

#[test]
fn known_findings_do_not_count() {
    let dir = tempfile::tempdir().unwrap();
    let path = archive(dir.path(), "x.fmu", two_faults);
    let (path, baseline) = (path.to_str().unwrap(), dir.path().join("fmu-check.toml"));
    let baseline = baseline.to_str().unwrap();
    let run = |more: &[&str]| fmu_check(&[&[path, "--only", STATIC], more].concat());
    assert_eq!(run(&[]).0, Some(1));
    assert_eq!(run(&["--allow", "s01"]).0, Some(1));
    let (code, text, _) = run(&["--allow", "S01,X08"]);
    assert!(code == Some(0) && text.contains("VIOLATED (must, known)") && text.contains("2 known"), "{text}");
    assert_eq!(run(&["--allow", "nonsense"]).0, Some(2));
    // A baseline lists the findings at the time it was written.
    assert_eq!(run(&["--write-baseline", baseline]).0, Some(1));
    let written = std::fs::read_to_string(baseline).unwrap();
    assert!(written.contains("[\"Small, FMI 2.0\"]\nmust = [\"X08\",\"S01\"]"), "{written}");
    assert_eq!(run(&["--baseline", baseline]).0, Some(0));
    // It fails on new findings, including those below must, and reports them.
    let worse = archive(dir.path(), "worse.fmu", |xml| two_faults(xml).replace(" license=\"MIT\"", ""));
    let (code, text, _) = fmu_check(&[worse.to_str().unwrap(), "--only", STATIC, "--baseline", baseline]);
    assert!(code == Some(1) && text.contains("new: X06"), "{text}");
    // A finding that no longer occurs is named.
    let better = archive(dir.path(), "better.fmu", |xml| {
        two_faults(xml).replace("<Outputs>", "<Outputs><Unknown index=\"4\"/>")
    });
    let (code, text, _) = fmu_check(&[better.to_str().unwrap(), "--only", STATIC, "--baseline", baseline]);
    assert!(code == Some(0) && text.contains("no longer needed in the baseline: S01"), "{text}");
    // A finding that was a should is new as a must.
    std::fs::write(baseline, written.replace("must = ", "should = ")).unwrap();
    assert_eq!(run(&["--baseline", baseline]).0, Some(1));
    std::fs::write(baseline, "[x]\nmusst = []").unwrap();
    let (code, _, error) = run(&["--baseline", baseline]);
    assert!(code == Some(2) && error.contains("musst"), "{error}");
}

#[test]
fn formats_for_a_ci() {
    let dir = tempfile::tempdir().unwrap();
    let path = archive(dir.path(), "x & y.fmu", two_faults);
    let run =
        |format: &str| fmu_check(&[path.to_str().unwrap(), "--only", STATIC, "--allow", "X08", "--format", format]);
    let (code, junit, _) = run("junit");
    let suite = model_description::Element::parse(&junit).unwrap();
    let (suite, number) =
        (&suite.children[0], |name: &str| suite.children[0].get(name).unwrap().parse::<usize>().unwrap());
    assert!(code == Some(1) && suite.get("name").unwrap().ends_with("x & y.fmu"), "{junit}");
    assert_eq!((number("tests"), number("failures")), (suite.children.len(), 1), "{junit}");
    let with = |kind: &str| suite.children.iter().filter(|c| c.child(kind).is_some()).collect::<Vec<_>>();
    assert!(with("failure")[0].get("name").unwrap().starts_with("S01 ") && with("failure").len() == 1, "{junit}");
    assert_eq!(with("skipped").len(), number("skipped"));
    let (_, sarif, _) = run("sarif");
    let sarif: serde_json::Value = serde_json::from_str(&sarif).unwrap();
    assert_eq!(sarif["version"], "2.1.0");
    let run = &sarif["runs"][0];
    let ids: Vec<_> =
        run["tool"]["driver"]["rules"].as_array().unwrap().iter().map(|r| r["id"].as_str().unwrap()).collect();
    let results = run["results"].as_array().unwrap();
    assert!(results.iter().all(|r| ids.contains(&r["ruleId"].as_str().unwrap())));
    let of = |id: &str| results.iter().find(|r| r["ruleId"] == id).unwrap();
    assert_eq!(of("S01")["level"], "error");
    assert!(of("S01").get("suppressions").is_none() && of("X08").get("suppressions").is_some());
    let place = &of("X08")["locations"][0]["physicalLocation"];
    assert_eq!(place["region"]["startLine"], 3, "{place}");
}

#[test]
fn every_check_is_explained() {
    let (code, text, _) = fmu_check(&["--explain", "s02a"]);
    let parts = ["S02a (structure): must in FMI 2.0, must in FMI 3.0", "2.0.5, 2.2.8", "How it is tried", "Usual fix"];
    assert!(code == Some(0) && parts.iter().all(|part| text.contains(part)), "{text}");
    assert_eq!(fmu_check(&["--explain", "nonsense"]).0, Some(2));
    for check in fmu_check::GROUPS.iter().flat_map(|g| g.checks) {
        assert!(!check.tried.is_empty() && !check.fix.is_empty());
    }
}

/// The checks of the state tables list their calls for each state.
#[test]
fn tables_of_states_are_explained() {
    for (id, line) in [
        ("L07", "FMI 2.0: Terminate in Step\n"),
        ("L08", "FMI 3.0: DoStep in Instantiated, Initialization, Terminated\n"),
        ("E01", "FMI 3.0: GetContinuousStates in Event, Continuous, Terminated\n"),
        ("E01i", "FMI 2.0: GetContinuousStates in Initialization\n"),
        ("E02", "FMI 2.0: EnterContinuousTimeMode in Instantiated, Initialization, Continuous, Terminated\n"),
        ("N05", "FMI 3.0: DoStep in Event\n"),
    ] {
        let (_, text, _) = fmu_check(&["--explain", id]);
        assert!(text.contains(&format!("  {line}")), "{text}");
    }
    assert!(!fmu_check(&["--explain", "F02a"]).1.contains("The calls"));
}

/// The summary counts the requirements that could be checked, and does not claim conformity if most could not.
#[test]
fn the_summary_says_how_much_was_checked() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(2, "NONE") else { return };
    let all = pack(dir.path(), 2, "all", &binary);
    let text = check(&all, &["lifecycle"]).text(false);
    assert!(text.ends_with("not determined\nAll requirements hold.\n"), "{text}");
    // A file that is not a library: almost no check of the binary is possible.
    let text = check(&pack(dir.path(), 2, "none", b"no library"), &["lifecycle", "access", "xml"]).text(false);
    let counted = text.lines().find(|line| line.ends_with(" requirements could be checked.")).expect(&text);
    let numbers: Vec<usize> = counted.split(' ').filter_map(|word| word.parse().ok()).collect();
    assert!(numbers.len() == 2 && 2 * numbers[0] < numbers[1], "{counted}");
    assert!(text.ends_with("Most requirements could not be checked.\n"), "{text}");
    let (_, help, _) = fmu_check(&["--help"]);
    assert!(help.contains("Model Exchange"), "{help}");
}

/// Requirements of FMI 3.0 that FMI 2.0 does not have.
#[test]
fn levels_differ_between_the_standards() {
    for id in ["B08f", "B08g", "B08r", "G-L3a", "G-L3c", "L01b"] {
        let check = fmu_check::GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == id).unwrap();
        let levels = [FmiVersion::V2, FmiVersion::V3].map(|version| check.levels.of(version).unwrap());
        assert!(levels[0] > Level::Must && levels[1] == Level::Must, "{id}: {levels:?}");
    }
}

#[test]
fn several_files_have_one_summary() {
    let dir = tempfile::tempdir().unwrap();
    let good = archive(dir.path(), "good.fmu", str::to_owned);
    let one = archive(dir.path(), "one.fmu", two_faults);
    let two = archive(dir.path(), "two.fmu", |xml| two_faults(xml).replace(" license=\"MIT\"", ""));
    let files = [good.to_str().unwrap(), one.to_str().unwrap(), two.to_str().unwrap(), "--only", STATIC];
    let (code, text, _) = fmu_check(&files);
    assert_eq!(code, Some(1));
    assert_eq!(text.matches("S01 ").count(), 1, "{text}");
    assert!(text.contains("S01    VIOLATED (must) in 2 of 3 files, one.fmu, two.fmu: "), "{text}");
    assert_eq!(text.matches("X06 ").count(), 1, "{text}");
    assert!(text.ends_with("3 files, 2 of which violate requirements of the standard (must).\n"), "{text}");
    let (_, json, _) = fmu_check(&[&files[..], &["--format", "json"]].concat());
    assert_eq!(serde_json::from_str::<serde_json::Value>(&json).unwrap().as_array().unwrap().len(), 3);
    let (_, html, _) = fmu_check(&[&files[..], &["--format", "html"]].concat());
    assert_eq!((html.matches("<h1>").count(), html.matches("<html").count()), (3, 1));
}

/// A file that is not an FMU does not hide the reports of the others.
#[test]
fn the_others_are_reported_beside_a_broken_file() {
    let dir = tempfile::tempdir().unwrap();
    let [empty, lost] = ["empty.fmu", "lost.fmu"].map(|name| dir.path().join(name));
    std::fs::write(&empty, "").unwrap();
    let one = archive(dir.path(), "one.fmu", two_faults);
    let files = [&empty, &one, &lost].map(|path| path.to_str().unwrap());
    let baseline = dir.path().join("baseline.toml");
    let run = |more: &[&str]| fmu_check(&[&files[..], &["--only", STATIC], more].concat());
    let (code, text, error) = run(&["--write-baseline", baseline.to_str().unwrap()]);
    assert_eq!((code, baseline.exists()), (Some(2), false));
    assert!(text.contains("S01    VIOLATED (must)"), "{text}");
    assert!(error.contains("empty.fmu: not a ZIP archive") && error.contains("lost.fmu: "), "{error}");
    let (code, json, _) = run(&["--format", "json"]);
    let reports: Vec<serde_json::Value> = serde_json::from_str(&json).unwrap();
    assert_eq!((code, reports.len()), (Some(2), 1));
}

/// A reason that many checks share is printed once.
#[test]
fn a_common_reason_has_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let report = check(&pack(dir.path(), 2, "text", b"no library"), &[]);
    let text = report.text(false);
    assert_eq!(text.matches("the binary does not load").count(), 2, "B00, and the others:\n{text}");
    assert!(text.contains("\nNot determined, "), "{text}");
}

#[test]
fn the_whole_run_has_a_limit() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(2, "G07a") else { return };
    let path = pack(dir.path(), 2, "limit", &binary);
    let (_, text, _) = fmu_check(&[path.to_str().unwrap(), "--timeout", "0.2"]);
    assert!(text.contains("the run reached its time limit (see --timeout)"), "{text}");
    assert_eq!(fmu_check(&[path.to_str().unwrap(), "--timeout", "-1"]).0, Some(2));
}

/// A finding comes with the calls that led to it, and the calls can be made again.
#[test]
fn calls_are_told_and_repeated() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(2, "G01a") else { return };
    let path = pack(dir.path(), 2, "calls", &binary);
    let calls = check(&path, &["G01a"]).finding("G01a").unwrap().calls.clone();
    assert!(calls[0].starts_with("fmi2Instantiate") && calls[0].ends_with("-> an instance"), "{calls:?}");
    assert!(calls.iter().any(|call| call == "fmi2Get(Float64, NULL, 0, NULL, 0) -> Error"), "{calls:?}");
    let (code, text, _) = fmu_check(&[path.to_str().unwrap(), "--replay", "g01a#0"]);
    assert!(code == Some(1) && calls.iter().all(|call| text.contains(call.as_str())), "{text}");
    assert!(text.contains("# case 0") && !text.contains("# case 1"), "{text}");
    // The value returned by a getter, if any; the instance; both values of a difference.
    let replay = |faults: &str, id: &str, parts: &[&str]| {
        let path = pack(dir.path(), 2, faults, &compile(2, faults).unwrap());
        let (_, text, _) = fmu_check(&[path.to_str().unwrap(), "--replay", id]);
        assert!(parts.iter().all(|part| text.contains(part)), "{faults}: {text}");
    };
    replay("G15", "G15", &["fmi2Get(gain) -> OK, 2.0", "fmi2Get(n) -> OK, not written"]);
    replay("L06t", "L06", &["[2] fmi2Reset -> OK", "bias differs: 0.02, expected 0.0"]);
    replay("L06e", "L06", &["n differs: 4, expected 1"]);
    // A crash shows the call without a result.
    let binary = compile(2, "L08n").unwrap();
    let path = pack(dir.path(), 2, "crash", &binary);
    let (code, text, _) = fmu_check(&[path.to_str().unwrap(), "--replay", "L08n"]);
    assert!(code == Some(1) && text.contains("fmi2Terminate(NULL) ended the process by SIGSEGV"), "{text}");
    assert!(!text.contains("fmi2Terminate(NULL) ->"), "{text}");
    assert_eq!(fmu_check(&[path.to_str().unwrap(), "--replay", "S01"]).0, Some(2));
}
