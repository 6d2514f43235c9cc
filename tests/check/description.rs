//! Faults of the description: of a small one of FMI 2.0, and of our plant's of FMI 3.0.

use crate::zip::{Entry, write};
use crate::{check, common, told, violated};
use std::io::Read;

fn found(dir: &std::path::Path, xml: &str) -> (Vec<&'static str>, String) {
    let path = dir.join("x.fmu");
    write(&path, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/fmu.c", b"x")]);
    let report = check(&path, &["xml", "variables", "structure"]);
    (violated(&report), told(&report))
}

fn each(xml: &str, faults: &[(&[&str], &str, &str)]) {
    let dir = tempfile::tempdir().unwrap();
    let (ids, text) = found(dir.path(), xml);
    assert!(ids.is_empty(), "without a fault: {text}");
    for (expected, from, to) in faults {
        assert!(xml.contains(from), "{from}");
        let (ids, text) = found(dir.path(), &xml.replacen(from, to, 1));
        assert_eq!(ids, *expected, "{from} -> {to}: {text}");
    }
}

#[test]
fn faults_of_fmi_2() {
    each(
        include_str!("fmu.xml"),
        &[
            (&["X01a"], "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", ""),
            (&["X01a"], "encoding=\"UTF-8\"", "encoding=\"latin1\""),
            (&["X01a"], "</ModelStructure>", ""),
            (&["X01b", "X08"], "canGetAndSetFMUstate", "canGetAndSetFMUState"),
            (&["X01b"], "<Real start=\"0\"/>", "<Real start=\"0\" color=\"red\"/>"),
            (&["X01b"], "<DefaultExperiment startTime=\"0\" stopTime=\"10\" stepSize=\"0.01\"/>", "<Surprise/>"),
            (&["X02a"], "fmiVersion=\"2.0\"", "fmiVersion=\"2.0.5\""),
            (&["X05"], "03:04:05Z", "03:04:05+00:00"),
            (&["X06"], " license=\"MIT\"", ""),
            (&["X08"], "canGetAndSetFMUstate=\"true\"", "canGetAndSetFMUstate=\"false\""),
            (&["X10"], "stopTime=\"10\"", "stopTime=\"-1\""),
            (&["X11"], "<Real start=\"0\"/>", "<Real start=\"0\" reinit=\"false\"/>"),
            (&["X12"], "max=\"10\" start", "max=\"INF\" start"),
            (&["G-L1a"], "<Category name=\"logStatusError\"/>", "<Category name=\"logEvents\"/>"),
            (&["V01a"], "name=\"flag\"", "name=\"label\""),
            (&["V01b"], "name=\"flag\"", "name=\"my flag\""),
            (&["V02b"], "name=\"u\" valueReference=\"2\"", "name=\"u\" valueReference=\"1\""),
            (
                &["V03"],
                "<Real/></ScalarVariable>\n    <ScalarVariable name=\"gain\"",
                "<Real start=\"0\"/></ScalarVariable>\n    <ScalarVariable name=\"gain\"",
            ),
            (
                &["V04a"],
                "variability=\"fixed\" initial=\"exact\"><Real",
                "variability=\"discrete\" initial=\"exact\"><Real",
            ),
            (
                &["V04b"],
                "causality=\"input\" variability=\"continuous\"",
                "causality=\"input\" variability=\"continuous\" initial=\"exact\"",
            ),
            (&["V04c"], "<Real start=\"0\"/>", "<Real/>"),
            (&["V04c"], "initial=\"calculated\"><Real/>", "initial=\"calculated\"><Real start=\"1\"/>"),
            (
                &["V05"],
                "variability=\"discrete\" initial=\"calculated\"><Integer",
                "variability=\"continuous\" initial=\"calculated\"><Integer",
            ),
            (&["V06a"], "start=\"2\"", "start=\"20\""),
            (&["V06a"], "min=\"0\" max=\"10\"", "min=\"10\" max=\"0\""),
            (&["V08a"], "<Real start=\"0\"/>", "<Real declaredType=\"None\" start=\"0\"/>"),
            (&["V09a"], "<Real start=\"0\"/>", "<Real unit=\"V\" start=\"0\"/>"),
            (&["S01"], "<Outputs>\n      <Unknown index=\"4\"/>", "<Outputs>"),
            (&["S02a"], "<InitialUnknowns>\n      <Unknown index=\"4\" dependencies=\"\"/>", "<InitialUnknowns>"),
            (
                &["S02b"],
                "<Unknown index=\"4\" dependencies=\"\"/>\n      <Unknown index=\"5\" dependencies=\"\"/>",
                "<Unknown index=\"5\"/><Unknown index=\"4\"/>",
            ),
            (&["S03a"], "index=\"4\" dependencies=\"\"", "index=\"4\" dependencies=\"99\""),
            (&["S03k"], "index=\"4\" dependencies=\"\"", "index=\"4\" dependencies=\"5\""),
            (
                &["S03b"],
                "index=\"4\" dependencies=\"\"",
                "index=\"4\" dependencies=\"2\" dependenciesKind=\"dependent dependent\"",
            ),
        ],
    );
}

#[test]
fn faults_of_fmi_3() {
    let mut zip =
        zip::ZipArchive::new(std::fs::File::open(common::archives().join("fmi3/PmsmPlant.fmu")).unwrap()).unwrap();
    let mut xml = String::new();
    zip.by_name("modelDescription.xml").unwrap().read_to_string(&mut xml).unwrap();
    let reference = xml.split("<Output valueReference=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
    let output = format!("<Output valueReference=\"{reference}\"");
    each(
        &xml,
        &[
            (&["X01s", "X08"], "canGetAndSetFMUState", "canGetAndSetFMUstate"),
            (&["X02a"], "fmiVersion=\"3.0\"", "fmiVersion=\"3.0.2\""),
            (
                &["X08"],
                "canHandleVariableCommunicationStepSize=\"true\"",
                "canHandleVariableCommunicationStepSize=\"true\" canReturnEarlyAfterIntermediateUpdate=\"true\"",
            ),
            // Others depend on the input whose reference is gone.
            (&["V02a", "S03a"], "valueReference=\"2\"", "valueReference=\"1\""),
            (&["V03"], "causality=\"independent\"", "causality=\"local\" initial=\"calculated\""),
            (&["V09a"], "unit=\"N.m\" start", "unit=\"Nm\" start"),
            (
                &["V09b"],
                "<Unit name=\"H\">",
                "<Unit name=\"Wb\"><BaseUnit kg=\"1\" m=\"2\" s=\"-2\" A=\"-1\"/></Unit><Unit name=\"H\">",
            ),
            (
                &["V09c"],
                "<BaseUnit kg=\"1\" m=\"2\" s=\"-3\" A=\"-2\"/>",
                "<BaseUnit kg=\"1\" m=\"2\" s=\"-3\" A=\"-1\"/>",
            ),
            (&["V09d"], "factor=\"9.549296585513721\"", "factor=\"0.1047197551\""),
            (
                &["V11"],
                "causality=\"input\" variability=\"discrete\"",
                "causality=\"input\" variability=\"discrete\" intermediateUpdate=\"true\"",
            ),
            (&["V14"], "start=\"325\"", "start=\"3,25\""),
            (&["V13"], "start=\"325\"", "start=\"325 326\""),
            // The first output, in whose place an input is listed.
            (&["S01"], &output, "<Output valueReference=\"1\""),
        ],
    );
}

#[test]
fn faults_of_aliases_and_clocked_states() {
    let state = "<ClockedState valueReference=\"5\"/>\n    <InitialUnknown valueReference=\"3\"";
    let clocked =
        include_str!("fmu3.xml").replace("<Int32 name=\"n\"", "<Int32 name=\"n\" clocks=\"9\" previous=\"8\"");
    let clocked = clocked.replace("<InitialUnknown valueReference=\"5\" dependencies=\"\"/>", "");
    let clocked = clocked.replace("<InitialUnknown valueReference=\"3\"", state).replace(
        "</ModelVariables>",
        "<Int32 name=\"before\" valueReference=\"8\" causality=\"local\" variability=\"discrete\" clocks=\"9\" initial=\"exact\" start=\"0\"/>
         <Clock name=\"tick\" valueReference=\"9\" causality=\"input\" intervalVariability=\"triggered\"/></ModelVariables>",
    );
    let clocked = clocked.replace("canSerializeFMUState", "hasEventMode=\"true\" canSerializeFMUState");
    each(
        include_str!("fmu3.xml"),
        &[
            (&["V10"], "displayUnit=\"mm\"", "displayUnit=\"km\""),
            (&["V10"], "<Alias name=\"count\"/>", "<Alias name=\"count\" displayUnit=\"mm\"/>"),
        ],
    );
    each(
        &clocked,
        &[
            (&["S06"], "previous=\"8\"", "previous=\"5\""),
            (&["S06"], "previous=\"8\"", ""),
            (&["S06"], "<ClockedState valueReference=\"5\"/>", "<ClockedState valueReference=\"4\"/>"),
        ],
    );
}
