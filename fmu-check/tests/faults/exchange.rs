//! Faults of Model Exchange, of event mode and of partial derivatives: a small C FMU that breaks no rule, with one fault
//! at a time.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::{check, each, library, listed, pack_with, violated};
use fmu_check::Verdict;

const GROUPS: [&str; 9] = ["exchange", "events", "derivatives", "event-mode", "T13", "B07a", "B08", "B08f", "B08g"];

/// Fault, and the checks that must fail.
const FAULTS: &[(&str, &[&str])] = &[
    ("NONE", &[]),
    ("E00", &["E00"]),
    ("E01", &["E01"]),
    ("E01i", &["E01i"]),
    ("E02", &["E02"]),
    ("E03", &["E03"]),
    ("E04a", &["E04a", "E04b"]),
    ("E04b", &["E04b"]),
    ("E05", &["E05", "D01"]),
    // A derivative that remembers the last one shows wherever it is read twice.
    ("E06a", &["E06a", "E06b", "E07", "E09", "E15", "D04"]),
    ("E06b", &["E06b", "D04"]),
    ("E07", &["E07"]),
    // Event indicators of the last time; a time that may not go back, or does not; what a step, a mode or an update forgets.
    ("E06z", &["E06a"]),
    ("E06t", &["E06a"]),
    ("E08b", &["E08"]),
    ("E07u", &["E07", "E19"]),
    ("E16u", &["E16", "E19"]),
    ("E16t", &["E16"]),
    ("E16s", &["E16"]),
    ("E05u", &["E05"]),
    ("E16d", &["E16", "E19"]),
    ("E12m", &["E12"]),
    ("E12g", &["E12"]),
    ("E13g", &["E13"]),
    ("E15x", &["E15"]),
    ("E17", &["E17"]),
    ("B07e", &["B07a"]),
    ("B08e", &["B08"]),
    ("B08f", &["B08f"]),
    ("B08g", &["B08g"]),
    ("D01s", &["D01"]),
    ("E08", &["E08"]),
    ("E09", &["E09"]),
    ("E10", &["E10"]),
    ("E11", &["E11"]),
    ("E11h", &["E11", "D01"]),
    ("E12", &["E12"]),
    ("E13", &["E13"]),
    ("E14", &["E14"]),
    ("E15", &["E15", "E19"]),
    ("E16", &["E16"]),
    // Co-simulation is slower, or its time events have no effect; freeing an instance changes the others.
    ("E19", &["T13", "E19"]),
    ("E19t", &["E19"]),
    ("E17f", &["E17"]),
    ("E20", &["E19", "E20"]),
    ("E21", &["E18", "E21"]),
    ("E22", &["E22"]),
    ("E23", &["E23"]),
    ("E24a", &["E24a"]),
    ("E24b", &["E24b"]),
    ("E24n", &["E24n"]),
    ("E25", &["E25"]),
    ("E26", &["E26"]),
    // A Boolean that changes before the event begins, and one that follows a state without an event.
    ("E26b", &["E26"]),
    ("E26c", &["E26"]),
    ("D01", &["D01"]),
    ("D03", &["D03"]),
    ("D04", &["D04"]),
    ("D05", &["D05"]),
    ("T13", &["T13"]),
];

/// Faults specific to FMI 3.0, and one for each function that differs.
const FAULTS3: &[(&str, &[&str])] = &[
    ("NONE", &[]),
    ("E03", &["E03"]),
    ("E05", &["E05", "D01"]),
    ("E07", &["E07"]),
    ("E13", &["E13"]),
    ("E15", &["E15", "E19"]),
    ("E16", &["E16"]),
    ("E21", &["E18", "E21"]),
    ("E24b", &["E24b"]),
    ("E24n", &["E24n"]),
    ("E26b", &["E26"]),
    ("E26c", &["E26"]),
    ("T13", &["T13"]),
    ("D03", &["D03"]),
    ("D05", &["D05"]),
    ("D02", &["D02"]),
    ("D02s", &["D02"]),
    ("E06z", &["E06a"]),
    ("E08b", &["E08"]),
    ("E16d", &["E16", "E19"]),
    ("E17", &["E17"]),
    ("E19t", &["E19"]),
    ("E17f", &["E17"]),
    ("B08g", &["B08g"]),
    ("N00", &["N01"]),
    ("N01", &["N01"]),
    ("N02", &["N02"]),
    // A step from a wrong time is refused.
    ("N03", &["N01", "N03", "N03e"]),
    ("N03e", &["N01", "N03e"]),
    ("N04", &["N04"]),
    ("N05", &["N05"]),
    ("N06", &["N06"]),
    ("N07", &["N07"]),
];

fn all(version: u8, faults: &[(&str, &[&str])]) {
    let dir = tempfile::tempdir().unwrap();
    let (xml, standard): (_, &[&str]) =
        if version == 2 { (include_str!("exchange2.xml"), &[]) } else { (include_str!("exchange3.xml"), &["-DFMI3"]) };
    if library("exchange.c", standard, "NONE").is_none() {
        eprintln!("there is no C compiler: not tested");
        return;
    }
    each(faults, |(fault, ids)| {
        let report =
            check(&pack_with(dir.path(), fault, xml, &library("exchange.c", standard, fault).unwrap()), &GROUPS);
        if violated(&report) != *ids {
            return Err(format!("{fault}: {}", listed(&report)));
        }
        // Everything not hidden by the fault is determined.
        match report.findings.iter().find(|f| matches!(f.verdict, Verdict::NotDetermined(_))) {
            Some(open) if *fault == "NONE" => Err(format!("{fault}: {open:?}")),
            _ => Ok(()),
        }
    });
}

/// Derivatives computed once per time, and a start value lost only in Model Exchange.
#[test]
fn faults_of_a_time_and_of_a_start() {
    let dir = tempfile::tempdir().unwrap();
    let xml = include_str!("exchange2.xml");
    let calculated = "initial=\"calculated\"><Real nominal=\"2\"";
    let exact = xml.replace(calculated, "initial=\"exact\"><Real start=\"1\" nominal=\"2\"");
    assert!(exact != xml);
    let rows: [(&str, &str, &str, &[&str]); 6] = [
        (&exact, "STARTS", "V07", &[]),
        (&exact, "STARTS V07m", "V07", &["V07"]),
        (xml, "NONE", "E06a", &[]),
        (xml, "E06k", "E06a", &["E06a"]),
        (&exact, "STARTS", "G09", &[]),
        (&exact, "STARTS G09m", "G09", &["G09"]),
    ];
    for (xml, faults, id, expected) in rows {
        let Some(binary) = library("exchange.c", &[], faults) else { return };
        let report = check(&pack_with(dir.path(), "time", xml, &binary), &[id]);
        assert_eq!(violated(&report), expected, "{faults}: {}", listed(&report));
    }
}

#[test]
fn each_fault_is_found_by_its_check() {
    all(2, FAULTS);
}

#[test]
fn each_fault_of_fmi_3_is_found_by_its_check() {
    all(3, FAULTS3);
}

/// An FMU for Model Exchange alone is run as such; the requirements of co-simulation do not apply.
#[test]
fn an_fmu_without_co_simulation_is_run() {
    let dir = tempfile::tempdir().unwrap();
    for (xml, more) in [(include_str!("exchange2.xml"), &[][..]), (include_str!("exchange3.xml"), &["-DFMI3"])] {
        let Some(binary) = library("exchange.c", more, "NONE") else { return };
        let without: Vec<_> = xml.lines().filter(|line| !line.contains("<CoSimulation")).collect();
        let report = check(&pack_with(dir.path(), "exchange-only", &without.join("\n"), &binary), &[]);
        let verdict = |id: &str| report.finding(id).map(|f| f.verdict.clone()).unwrap();
        assert!(matches!(verdict("E00"), Verdict::Pass(_)), "{}", listed(&report));
        assert!(matches!(verdict("E13"), Verdict::Pass(_)), "{}", listed(&report));
        assert!(matches!(verdict("B00"), Verdict::Pass(_)), "{}", listed(&report));
        for id in ["L00", "L07", "T01a", "F02a", "D05"] {
            assert!(matches!(verdict(id), Verdict::NotApplicable(_)), "{id}: {:?}", verdict(id));
        }
        for id in ["X08", "L03"] {
            assert!(!matches!(verdict(id), Verdict::Violated(_)), "{id}: {:?}", verdict(id));
        }
    }
}
