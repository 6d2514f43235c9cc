//! Start values that the importer sets, and the end of the simulation: faults of a small C FMU.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::{check, compile, each, listed, pack, pack_with, violated};
use fmu_check::Verdict;

/// The descriptions with an output that starts exactly.
fn exact(version: u8) -> String {
    if version == 2 {
        let xml = include_str!("fmu.xml").replace(
            "name=\"y\" valueReference=\"3\" causality=\"output\" variability=\"continuous\" initial=\"calculated\"><Real/>",
            "name=\"y\" valueReference=\"3\" causality=\"output\" variability=\"continuous\" initial=\"exact\"><Real start=\"0\"/>",
        );
        xml.replace("      <Unknown index=\"4\" dependencies=\"\"/>\n", "")
            .replace("index=\"9\" dependencies=\"\"", "index=\"9\" dependencies=\"4\"")
    } else {
        let xml = include_str!("fmu3.xml")
            .replace("initial=\"calculated\" unit=\"m\"", "initial=\"exact\" unit=\"m\" start=\"0\"");
        let xml = xml.replace("    <InitialUnknown valueReference=\"3\" dependencies=\"\"/>\n", "");
        xml.replace(
            "<InitialUnknown valueReference=\"9\" dependencies=\"\"/>",
            "<InitialUnknown valueReference=\"9\" dependencies=\"3\"/>",
        )
    }
}

#[test]
fn starts_stand() {
    let dir = tempfile::tempdir().unwrap();
    for version in [2, 3] {
        let xml = exact(version);
        assert!(xml.matches("exact").count() == if version == 2 { 5 } else { 6 }, "{xml}");
        let faults: &[(&str, &[&str])] =
            &[("NONE", &[]), ("G09i", &["G09"]), ("G09e", &["G09"]), ("G09x", &["G09"]), ("G09r", &["L06", "G09"])];
        let Some(without) = compile(version, "NONE") else { return };
        each(faults, |(fault, ids)| {
            let binary = compile(version, &format!("STARTS {fault}")).unwrap();
            let report = check(&pack_with(dir.path(), fault, &xml, &binary), &[]);
            let same = violated(&report) == *ids;
            if same { Ok(()) } else { Err(format!("FMI {version}, {fault}: {}", listed(&report))) }
        });
        let report = check(&pack(dir.path(), version, "NONE", &without), &["G09"]);
        assert!(matches!(report.finding("G09").unwrap().verdict, Verdict::NotApplicable(_)));
    }
}

#[test]
fn the_end_is_told_and_no_step_follows() {
    let dir = tempfile::tempdir().unwrap();
    for version in [2, 3] {
        for (fault, ids) in [("ENDS", &[][..]), ("T12t", &["T12"]), ("T12e", &["L00"]), ("T12s", &["T12s"])] {
            // In FMI 3.0 the step itself contains the time, which T06a checks.
            if (version, fault) == (3, "T12t") {
                continue;
            }
            let Some(binary) = compile(version, fault) else { return };
            let report = check(&pack(dir.path(), version, fault, &binary), &["time", "lifecycle"]);
            assert_eq!(violated(&report), ids, "FMI {version}, {fault}: {}", listed(&report));
        }
    }
}
