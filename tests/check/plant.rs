//! Faults of the description of our own plant, of FMI 3.0.

use crate::zip::{Entry, write};
use crate::{check, common, listed, violated};
use std::io::Read;

fn found(path: &std::path::Path, xml: &str) -> (Vec<&'static str>, String) {
    write(path, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/fmu.c", b"x")]);
    let report = check(path, &["xml", "variables", "structure"]);
    (violated(&report), listed(&report))
}

#[test]
fn faults_of_fmi_3() {
    let mut zip =
        zip::ZipArchive::new(std::fs::File::open(common::archives().join("fmi3/PmsmPlant.fmu")).unwrap()).unwrap();
    let mut xml = String::new();
    zip.by_name("modelDescription.xml").unwrap().read_to_string(&mut xml).unwrap();
    let reference = xml.split("<Output valueReference=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
    let output = format!("<Output valueReference=\"{reference}\"");
    let faults: &[(&[&str], &str, &str)] = &[
        (&["X01s", "X08"], "canGetAndSetFMUState", "canGetAndSetFMUstate"),
        (&["X02a"], "fmiVersion=\"3.0\"", "fmiVersion=\"3.0.2\""),
        (
            &["X08"],
            "canHandleVariableCommunicationStepSize=\"true\"",
            "canHandleVariableCommunicationStepSize=\"true\" canReturnEarlyAfterIntermediateUpdate=\"true\"",
        ),
        // Others depend on the input whose reference was removed.
        (&["V02a", "S03a"], "valueReference=\"2\"", "valueReference=\"1\""),
        (&["V03"], "causality=\"independent\"", "causality=\"local\" initial=\"calculated\""),
        (&["V09a"], "unit=\"N.m\" start", "unit=\"Nm\" start"),
        (
            &["V09b"],
            "<Unit name=\"H\">",
            "<Unit name=\"Wb\"><BaseUnit kg=\"1\" m=\"2\" s=\"-2\" A=\"-1\"/></Unit><Unit name=\"H\">",
        ),
        (&["V09c"], "<BaseUnit kg=\"1\" m=\"2\" s=\"-3\" A=\"-2\"/>", "<BaseUnit kg=\"1\" m=\"2\" s=\"-3\" A=\"-1\"/>"),
        (&["V09d"], "factor=\"9.549296585513721\"", "factor=\"0.1047197551\""),
        (
            &["V11"],
            "causality=\"input\" variability=\"discrete\"",
            "causality=\"input\" variability=\"discrete\" intermediateUpdate=\"true\"",
        ),
        (&["X01b", "V14"], "start=\"325\"", "start=\"3,25\""),
        (&["V13"], "start=\"325\"", "start=\"325 326\""),
        // The first output, replaced by an input.
        (&["S01"], &output, "<Output valueReference=\"1\""),
    ];
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let (ids, text) = found(&path, &xml);
    assert!(ids.is_empty(), "without a fault: {text}");
    for (expected, from, to) in faults {
        assert!(xml.contains(from), "{from}");
        let (ids, text) = found(&path, &xml.replacen(from, to, 1));
        assert_eq!(ids, *expected, "{from} -> {to}: {text}");
    }
}
