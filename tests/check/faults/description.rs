//! Faults of the description, in small ones of both standards.

use crate::zip::{Entry, write};
use crate::{check, told, violated};

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
fn faults_of_aliases_and_clocked_states() {
    let state = "<ClockedState valueReference=\"5\"/>\n    <InitialUnknown valueReference=\"3\"";
    let clocked =
        include_str!("fmu3.xml").replace("<Int32 name=\"n\"", "<Int32 name=\"n\" clocks=\"19\" previous=\"18\"");
    let clocked = clocked.replace("<InitialUnknown valueReference=\"5\" dependencies=\"\"/>", "");
    let clocked = clocked.replace("<InitialUnknown valueReference=\"3\"", state).replace(
        "</ModelVariables>",
        "<Int32 name=\"before\" valueReference=\"18\" causality=\"local\" variability=\"discrete\" clocks=\"19\" initial=\"exact\" start=\"0\"/>
         <Clock name=\"tick\" valueReference=\"19\" causality=\"input\" intervalVariability=\"triggered\"/></ModelVariables>",
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
            (&["S06"], "previous=\"18\"", "previous=\"5\""),
            (&["S06"], "previous=\"18\"", ""),
            (&["S06"], "<ClockedState valueReference=\"5\"/>", "<ClockedState valueReference=\"4\"/>"),
        ],
    );
}
