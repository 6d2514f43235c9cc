//! Clocks, intermediate updates and Scheduled Execution: faults of a small C FMU with a clock of each kind.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::{check, each, library, listed, pack_with, violated};
use fmu_check::Verdict;

const GROUPS: [&str; 3] = ["clocks", "intermediate-update", "scheduled-execution"];

const FAULTS: &[(&str, &[&str])] = &[
    ("NONE", &[]),
    ("K00", &["K00"]),
    // An active clock that was never set.
    ("K01", &["K01", "K02"]),
    ("K02", &["K02"]),
    // An interval, a shift, an interval that cannot be set.
    ("K03", &["K03"]),
    ("K03s", &["K03"]),
    ("K03f", &["K03"]),
    ("K04", &["K04"]),
    ("K05", &["K05"]),
    // A clock that the FMU ticks; Step Mode.
    ("K06", &["K06"]),
    ("K06s", &["K06"]),
    ("K07", &["K07"]),
    ("K08", &["K08"]),
    // A time after the step, another environment, a call outside of a step.
    ("U00", &["U00"]),
    ("U00e", &["U00"]),
    ("U00g", &["U00"]),
    ("U01", &["U01"]),
    ("U02", &["U02"]),
    ("U03", &["U03"]),
    ("U05", &["U05"]),
    ("U06", &["U06"]),
    ("P00", &["P00"]),
    ("P01", &["P01"]),
    ("P02", &["P02"]),
    // A lock that stays; a call of NULL.
    ("P03", &["P03"]),
    ("P03n", &["P03"]),
    ("P04", &["P04"]),
    ("P04e", &["P04"]),
    ("P05", &["P05"]),
];

#[test]
fn clocks_tick_and_callbacks_come_as_they_should() {
    let (dir, xml) = (tempfile::tempdir().unwrap(), include_str!("ticks.xml"));
    if library("ticks.c", &[], "NONE").is_none() {
        return;
    }
    each(FAULTS, |(fault, ids)| {
        let binary = library("ticks.c", &[], fault).unwrap();
        let report = check(&pack_with(dir.path(), fault, xml, &binary), &GROUPS);
        let open = |v: &Verdict| matches!(v, Verdict::NotDetermined(_) | Verdict::NotApplicable(_));
        let open = report.findings.iter().find(|f| *fault == "NONE" && f.id != "U04" && open(&f.verdict));
        let good = violated(&report) == *ids && open.is_none();
        if good { Ok(()) } else { Err(format!("{fault}: {} {open:?}", listed(&report))) }
    });
    // The callback of an FMU that does not announce it.
    let silent = xml.replace("providesIntermediateUpdate=\"true\" canReturnEarlyAfterIntermediateUpdate=\"true\"", "");
    let report = check(&pack_with(dir.path(), "U04", &silent, &library("ticks.c", &[], "NONE").unwrap()), &GROUPS);
    assert_eq!(violated(&report), ["U04"], "{}", listed(&report));
}

/// An FMU for Scheduled Execution alone is checked as such.
#[test]
fn scheduled_execution_alone() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = library("ticks.c", &[], "NONE") else { return };
    let xml: Vec<_> = include_str!("ticks.xml").lines().filter(|line| !line.contains("<CoSimulation")).collect();
    let path = pack_with(dir.path(), "scheduled", &xml.join("\n"), &binary);
    let report = check(&path, &["L00", "T01a", "K00", "E00", "P00", "P03"]);
    for id in ["L00", "T01a", "K00", "E00"] {
        let verdict = &report.finding(id).unwrap().verdict;
        assert!(
            matches!(verdict, Verdict::NotApplicable(why) if why.contains("no interface for")),
            "{id}: {verdict:?}"
        );
    }
    for id in ["P00", "P03"] {
        assert!(matches!(report.finding(id).unwrap().verdict, Verdict::Pass(_)), "{id}: {report:?}");
    }
}

/// Requirements and recommendations of FMI 3.0 also apply to an FMU for Scheduled Execution alone: a fault of the library, or
/// an edit of the description, and the violated checks.
#[test]
fn faults_of_scheduled_execution_alone() {
    const ELEMENT: &str = "<ScheduledExecution modelIdentifier=\"Small\"/>";
    const IN_ELEMENT: [(&str, &[&str]); 4] = [
        ("", &[]),
        ("canGetAndSetFMUstate=\"true\"", &["X01s"]),
        ("canSerializeFMUState=\"true\"", &["X08"]),
        ("needsExecutionTool=\"true\"", &["Z04c"]),
    ];
    const EDITS: [(&str, &str, &[&str]); 4] = [
        ("modelIdentifier=\"Small\"", "modelIdentifier=\"Other\"", &["X03"]),
        (
            "causality=\"output\" intervalVariability=\"triggered\"",
            "causality=\"output\" intervalVariability=\"countdown\"",
            &["V17"],
        ),
        ("intervalDecimal=\"0.25\"", "intervalDecimal=\"250\"", &["V19"]),
        ("stopTime=\"4\"", "stopTime=\"0\"", &["X10"]),
    ];
    const LIBRARY: [(&str, &[&str]); 8] = [
        ("NONE", &[]),
        ("X02b", &["X02b"]),
        ("X04", &["X04"]),
        ("L01a", &["L01a"]),
        ("G_L2a", &["G-L2a"]),
        ("G_L2b", &["G-L2b"]),
        ("P01", &["P01"]),
        ("P02", &["P02"]),
    ];
    let dir = tempfile::tempdir().unwrap();
    if library("ticks.c", &[], "NONE").is_none() {
        return;
    }
    let text = include_str!("ticks.xml").replace(
        "<DefaultExperiment",
        "<LogCategories><Category name=\"logStatusError\"/></LogCategories>\n  <DefaultExperiment",
    );
    let xml = text.lines().filter(|line| !line.contains("<CoSimulation")).collect::<Vec<_>>().join("\n");
    let groups = ["archive", "xml", "variables", "structure"];
    // Findings that the description always has.
    let lacks = violated(&check(&pack_with(dir.path(), "plain", &xml, b"no library"), &groups));
    assert!(!lacks.iter().any(|id| ["X01s", "X08", "Z04c", "X03", "V17", "V19", "X10"].contains(id)), "{lacks:?}");
    let elements = IN_ELEMENT.iter().map(|(flag, ids)| (ELEMENT, ELEMENT.replace("/>", &format!(" {flag}/>")), *ids));
    let edits: Vec<_> = elements.chain(EDITS.iter().map(|(from, to, ids)| (*from, (*to).to_owned(), *ids))).collect();
    each(&edits.iter().enumerate().collect::<Vec<_>>(), |(k, (from, to, ids))| {
        assert!(xml.contains(from), "{from}");
        let report = check(&pack_with(dir.path(), &format!("edit{k}"), &xml.replace(from, to), b"no library"), &groups);
        let found: Vec<_> = violated(&report).into_iter().filter(|id| !lacks.contains(id)).collect();
        if found == *ids { Ok(()) } else { Err(format!("{to}: {found:?}\n{}", listed(&report))) }
    });
    let probes = ["X02b", "X04", "L01a", "L08n", "G-L2a", "G-L2b", "G-L3c", "scheduled-execution"];
    each(&LIBRARY, |(fault, ids)| {
        let path = pack_with(dir.path(), &format!("library-{fault}"), &xml, &library("ticks.c", &[], fault).unwrap());
        let report = check(&path, &probes);
        let open = report.findings.iter().find(|f| !matches!(f.verdict, Verdict::Pass(_) | Verdict::Violated(_)));
        let good = violated(&report) == *ids && (*fault != "NONE" || open.is_none());
        if good { Ok(()) } else { Err(format!("{fault}: {} {open:?}", listed(&report))) }
    });
}
