//! An output that two runs cannot reproduce is one finding: no other check compares it, and the others still find their faults.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::{check, compile, library, listed, pack, pack_with, violated};
use fmu_check::{Confidence, Level, Verdict};

#[test]
fn noise_and_a_measured_time_are_one_finding() {
    let dir = tempfile::tempdir().unwrap();
    for (version, property) in [(2, "NOISE"), (2, "CPU_TIME"), (3, "NOISE")] {
        let Some(binary) = compile(version, property) else { return };
        let report = check(&pack(dir.path(), version, property, &binary), &[]);
        assert_eq!(violated(&report), ["T10"], "{property}: {}", listed(&report));
        assert_eq!(report.varying, ["y"], "{property}");
        // y depends on everything, or so it seems: the dependencies of the other unknowns are still decided.
        let decided = &report.finding("S04").unwrap().verdict;
        assert!(!matches!(decided, Verdict::NotDetermined(_)), "{property}: {decided:?}");
        let finding = report.finding("T10").unwrap();
        assert_eq!((finding.level, finding.confidence), (Level::Hard, Confidence::Certain));
        assert!(report.text(false).contains("Not compared, because two plain runs differ (T10): y."));
    }
}

#[test]
fn noise_in_model_exchange_is_one_finding() {
    let dir = tempfile::tempdir().unwrap();
    for (xml, options) in [(include_str!("exchange2.xml"), &[][..]), (include_str!("exchange3.xml"), &["-DFMI3"])] {
        let Some(binary) = library("exchange.c", options, "NOISE") else { return };
        let alone: Vec<_> = xml.lines().filter(|line| !line.contains("<CoSimulation")).collect();
        let groups = ["S04", "G10", "G16", "time", "exchange", "events", "derivatives", "instances"];
        let report = check(&pack_with(dir.path(), "noise", &alone.join("\n"), &binary), &groups);
        assert_eq!(
            (violated(&report), &report.varying[..]),
            (vec!["T10"], &["y".to_owned()][..]),
            "{}",
            listed(&report)
        );
    }
}

/// Many variables are read with one call, and each alone where a getter discards one of them or leaves one unwritten.
#[test]
fn one_unreadable_variable_of_many_hides_no_fault_of_the_others() {
    let dir = tempfile::tempdir().unwrap();
    let y = r#"<ScalarVariable name="y" valueReference="3" causality="output" variability="continuous" initial="calculated"><Real/>"#;
    let xml = include_str!("fmu.xml");
    let (first, rest) = xml.split_once(y).unwrap();
    let wide = |range: std::ops::Range<u32>| {
        let one = |k| y.replace(r#""y""#, &format!("\"wide.y{k}\"")).replace(r#""3""#, &format!("\"{k}\""));
        range.map(one).collect::<Vec<_>>().join("</ScalarVariable>")
    };
    for range in [100..300, 100..250] {
        let many = wide(range.clone());
        let structure = rest.find("<ModelStructure>").unwrap();
        let xml = format!("{first}{many}{}<ModelStructure/></fmiModelDescription>", &rest[..structure]);
        let Some(binary) = compile(2, "WIDE L04f") else { return };
        let report = check(&pack_with(dir.path(), &format!("wide-{}", range.len()), &xml, &binary), &["L04a"]);
        assert!(listed(&report).contains("freed: wide.y"), "{range:?}: {}", listed(&report));
    }
}

/// A fault in another variable is found despite the noise.
#[test]
fn noise_hides_no_fault_of_another_variable() {
    let dir = tempfile::tempdir().unwrap();
    for (fault, id) in [("G13", "G13"), ("L06e", "L06"), ("F02", "F02b"), ("L04g", "L04a")] {
        let Some(binary) = compile(2, &format!("NOISE {fault}")) else { return };
        let report = check(&pack(dir.path(), 2, fault, &binary), &["T10", id]);
        assert_eq!(violated(&report).len(), 2, "{fault}: {}", listed(&report));
        assert!(violated(&report).contains(&id), "{fault}: {}", listed(&report));
    }
}
