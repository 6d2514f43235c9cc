//! Structural parameters: faults of a small C FMU with two sizes.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::{check, each, library, listed, pack_with, violated};
use fmu_check::Verdict;

const FAULTS: &[(&str, &[&str])] = &[
    ("NONE", &[]),
    // Arrays that keep their sizes; a step that fails with others.
    ("C04", &["C04", "C05", "C08"]),
    ("C04s", &["C04", "C08"]),
    ("C05", &["C05"]),
    ("C05s", &["C05"]),
    ("C06", &["C06"]),
    ("C07", &["C07"]),
    ("C08", &["C08"]),
    ("C09", &["C09"]),
    ("C10", &["C10"]),
];

#[test]
fn sizes_are_followed() {
    let (dir, xml) = (tempfile::tempdir().unwrap(), include_str!("sizes.xml"));
    if library("sizes.c", &[], "NONE").is_none() {
        return;
    }
    let report = |fault: &str| {
        let binary = library("sizes.c", &[], fault).unwrap();
        check(&pack_with(dir.path(), fault, xml, &binary), &["configuration"])
    };
    each(FAULTS, |(fault, ids)| {
        let report = report(fault);
        let open = report.findings.iter().find(|f| *fault == "NONE" && !matches!(f.verdict, Verdict::Pass(_)));
        let good = violated(&report) == *ids && open.is_none();
        if good { Ok(()) } else { Err(format!("{fault}: {} {open:?}", listed(&report))) }
    });
    let said = format!("{:?}", report("C08f").finding("C08"));
    assert!(said.contains("Set(k), a fixed one, in Reconfiguration Mode returned OK"), "{said}");
}
