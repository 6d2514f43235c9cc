//! Faults of terminalsAndIcons.xml, in the terminals of our own plant.

use crate::zip::{Entry, write};
use crate::{check, common, listed, violated};
use std::fs::File;
use std::io::Read;

/// Entries of the packed plant that the checks of its terminals look at.
fn entries(standard: &str) -> Vec<Entry> {
    let path = common::archives().join(standard).join("PmsmPlant.fmu");
    let mut zip = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    let names: Vec<String> = zip.file_names().map(|n| n.unwrap().into_owned()).collect();
    let wanted = names.iter().filter(|n| n.starts_with("terminalsAndIcons/") || *n == "modelDescription.xml");
    let mut entries: Vec<Entry> = wanted
        .map(|name| {
            let mut bytes = Vec::new();
            zip.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
            Entry::new(name, &bytes)
        })
        .collect();
    entries.push(Entry::new("sources/fmu.c", b"x"));
    entries
}

#[test]
fn each_fault_is_found_by_its_check() {
    let member = |name: &str, variable: &str| {
        format!("<TerminalMemberVariable variableName=\"{variable}\" memberName=\"{name}\" variableKind=\"signal\"/>")
    };
    let faults: &[(&[&str], &str, &str)] = &[
        (&[], "", ""),
        (&["I01"], "variableName=\"u_a\"", "variableName=\"u_x\""),
        (&["I01"], "fmiVersion=\"3.0\"", "fmiVersion=\"2.0\""),
        (&["I01"], "<Terminals>", "<Ports/><Terminals>"),
        (&["I01"], "matchingRule=\"plug\"", "matchingRule=\"plug\" color=\"red\""),
        (&["I01"], "defaultConnectionColor=\"217 72 15\"", "defaultConnectionColor=\"217 72 256\""),
        (&["I01"], "</fmiTerminalsAndIcons>", ""),
        (&["I01n"], " memberName=\"u_b\"", ""),
        (&["I01n"], &member("u_b", "u_b"), &member("u_a", "u_b")),
        (&["I01n"], "<Terminal name=\"sensor\"", "<Terminal name=\"phases\""),
        (&["I01k"], "matchingRule=\"plug\"", "matchingRule=\"socket\""),
        (&["I01k"], "variableName=\"angle\"", "variableName=\"psi_d\""),
        (&["I01p"], "iconBaseName=\"shaft\"", "iconBaseName=\"flange\""),
        (&["I01p"], "<CoordinateSystem x1=\"-100\"", "<CoordinateSystem x1=\"100\""),
    ];
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    for standard in ["fmi2", "fmi3"] {
        let good = entries(standard);
        for (expected, from, to) in faults {
            let mut faulty = good.clone();
            let file = faulty.iter_mut().find(|e| e.name.ends_with("terminalsAndIcons.xml")).unwrap();
            let xml = String::from_utf8(file.bytes.clone()).unwrap();
            assert!(xml.contains(from), "{from}");
            file.bytes = xml.replacen(from, to, 1).into_bytes();
            write(&path, &faulty);
            let report = check(&path, &["I01", "I01n", "I01k", "I01p"]);
            // An unreadable file or one without a color is reported by the first check only.
            assert_eq!(violated(&report), *expected, "{standard}: {from} -> {to}: {}", listed(&report));
        }
        let mut faulty = good.clone();
        faulty.iter_mut().find(|e| e.name.ends_with("shaft.png")).unwrap().bytes = b"no picture".into();
        write(&path, &faulty);
        let report = check(&path, &["terminals"]);
        assert_eq!(violated(&report), ["I01p"], "{standard}: {}", listed(&report));
    }
}
