//! Faults of the description, in small ones of both standards.

use crate::zip::{Entry, write};
use crate::{check, listed, violated};

fn found(dir: &std::path::Path, xml: &str) -> (Vec<&'static str>, String) {
    let path = dir.join("x.fmu");
    write(&path, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/fmu.c", b"x")]);
    let report = check(&path, &["xml", "variables", "structure"]);
    (violated(&report), listed(&report))
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

/// A unit definition before the log categories.
fn unit(name: &str, base: &str) -> String {
    format!("<UnitDefinitions><Unit name=\"{name}\"><BaseUnit {base}/></Unit></UnitDefinitions><LogCategories>")
}

/// A unit of temperatures with a display unit of this offset.
fn kelvin(offset: &str) -> String {
    let display = format!("<DisplayUnit name=\"degC\" offset=\"{offset}\"/>");
    format!("<UnitDefinitions><Unit name=\"K\"><BaseUnit K=\"1\"/>{display}</Unit></UnitDefinitions><LogCategories>")
}

/// A start value that is not an item, and a tolerance that is not finite.
#[test]
fn faults_of_starts_and_tolerances() {
    let mode = "<TypeDefinitions><SimpleType name=\"Mode\"><Enumeration><Item name=\"a\" value=\"1\"/><Item name=\"b\" value=\"4\"/>\
                </Enumeration></SimpleType></TypeDefinitions>\n  <LogCategories>";
    let typed = include_str!("fmu.xml").replace("<LogCategories>", mode);
    let typed = typed.replace("<Boolean start=\"false\"/>", "<Enumeration declaredType=\"Mode\" start=\"1\"/>");
    each(
        &typed,
        &[
            (&["V06a"], "\"Mode\" start=\"1\"", "\"Mode\" start=\"2\""),
            (&[], "\"Mode\" start=\"1\"", "\"Mode\" start=\"4\""),
        ],
    );
    each(include_str!("fmu3.xml"), &[(&["X10"], "stopTime=\"10\"", "stopTime=\"10\" tolerance=\"INF\"")]);
}

#[test]
fn faults_of_fmi_2() {
    each(
        include_str!("fmu.xml"),
        &[
            (&["X01a"], "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", ""),
            (&["X01a"], "encoding=\"UTF-8\"", "encoding=\"latin1\""),
            (&["X01a"], "</ModelStructure>", ""),
            (&["X01a"], "A small FMU", "A small&#7; FMU"),
            // Revolutions per minute the wrong way round, and in the two right ways.
            (&["V09c"], "<LogCategories>", &unit("rpm", "rad=\"1\" s=\"-1\" factor=\"9.549296585513721\"")),
            (&[], "<LogCategories>", &unit("rpm", "rad=\"1\" s=\"-1\" factor=\"0.10471975511965977\"")),
            (&[], "<LogCategories>", &unit("1/min", "s=\"-1\" factor=\"0.016666666666666666\"")),
            // degC with the offset of the other direction, and with its own.
            (&["V09d"], "<LogCategories>", &kelvin("273.15")),
            (&[], "<LogCategories>", &kelvin("-273.15")),
            (&["X01b", "X08"], "canGetAndSetFMUstate", "canGetAndSetFMUState"),
            (&["X01b"], "<Real start=\"0\"/>", "<Real start=\"0\" color=\"red\"/>"),
            (&["X01b"], "<DefaultExperiment startTime=\"0\" stopTime=\"10\" stepSize=\"0.01\"/>", "<Surprise/>"),
            (&["X01b"], "\"structured\"", "\"tree\""),
            (&["X01b"], "  <LogCategories>", "text <LogCategories>"),
            (&["X01b"], "<Real start=\"0\"/>", "<Real start=\"0\">\n</Real>"),
            (&["X01b"], "<Real start=\"0\"/>", "<Real start=\"0\"/><Real start=\"0\"/>"),
            (&["X01b"], "<fmiModelDescription ", "<fmiModelDescription xmlns=\"urn:x\" "),
            (&["X01b"], "<fmiModelDescription ", "<fmiModelDescription xmlns:x=\"urn:x\" x:y=\"1\" "),
            (&["X01a", "X01b"], "<fmiModelDescription ", "<fmiModelDescription x:y=\"1\" "),
            (
                &[],
                "<fmiModelDescription ",
                "<fmiModelDescription xmlns:i=\"http://www.w3.org/2001/XMLSchema-instance\" i:schemaLocation=\"x\" ",
            ),
            (&["X01b"], "2026-01-02T03", "2026-02-30T03"),
            (&["X01b"], "max=\"1000000\"", "max=\"3000000000\""),
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
            (&["S05"], "<Real start=\"0\"/>", "<Real derivative=\"99\" start=\"0\"/>"),
            (&["S05"], "<Real start=\"0\"/>", "<Real derivative=\"3\" start=\"0\"/>"),
            (&["S05"], "<Real start=\"0\"/>", "<Real derivative=\"5\" start=\"0\"/>"),
            (&[], "<Real start=\"0\"/>", "<Real derivative=\"4\" start=\"0\"/>"),
            (&["S03k"], "index=\"4\" dependencies=\"\"", "index=\"4\" dependencies=\"5\""),
            (
                &["S03b"],
                "index=\"4\" dependencies=\"\"",
                "index=\"4\" dependencies=\"2\" dependenciesKind=\"dependent dependent\"",
            ),
        ],
    );
}

const TICK: &str = "causality=\"input\" intervalVariability=\"triggered\"";

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
            // References to itself, to nothing, to another type, to an input or a clock, and without clocks.
            (&["V15"], "previous=\"18\"", "previous=\"5\""),
            (&["V15"], "previous=\"18\"", "previous=\"99\""),
            (&["V15"], "previous=\"18\"", "previous=\"6\""),
            (&["V15"], "previous=\"18\"", "previous=\"19\""),
            (&["V15", "S02a", "S06"], " clocks=\"19\" previous=\"18\"", " previous=\"18\""),
            // Clock references to nothing, to a variable that is not a clock, or to itself.
            (&["V15"], "clocks=\"19\" previous", "clocks=\"99\" previous"),
            (&["V15"], "clocks=\"19\" previous", "clocks=\"19 6\" previous"),
            (&["V15"], "clocks=\"19\" previous", "clocks=\"5\" previous"),
            (&["V15", "S02a"], "clocks=\"19\" previous", "clocks=\"\" previous"),
            // A tunable parameter on a clock, and a clock that is not discrete.
            (
                &[],
                "<Clock",
                "<Float64 name=\"p\" valueReference=\"20\" causality=\"parameter\" variability=\"tunable\" clocks=\"19\" start=\"0\"/><Clock",
            ),
            (&["V15", "S01"], TICK, "causality=\"output\" variability=\"constant\" intervalVariability=\"triggered\""),
            (&["S03a"], "<ClockedState valueReference=\"5\"", "<ClockedState valueReference=\"5\" dependencies=\"99\""),
            (&["V16"], "intervalVariability=\"triggered\"", "intervalVariability=\"constant\""),
            (&["V16"], "intervalVariability=\"triggered\"", "intervalVariability=\"constant\" intervalDecimal=\"0\""),
            (&["V16"], "intervalVariability=\"triggered\"", "intervalVariability=\"triggered\" intervalDecimal=\"1\""),
            (&["V16"], "intervalVariability=\"triggered\"", "intervalVariability=\"countdown\" intervalDecimal=\"1\""),
            (
                &["V16"],
                "intervalVariability=\"triggered\"",
                "intervalVariability=\"fixed\" intervalDecimal=\"1\" shiftDecimal=\"-1\"",
            ),
            (
                &["V16"],
                "intervalVariability=\"triggered\"",
                "intervalVariability=\"fixed\" intervalCounter=\"0\" resolution=\"10\" supportsFraction=\"true\"",
            ),
            (
                &[],
                "intervalVariability=\"triggered\"",
                "intervalVariability=\"fixed\" intervalDecimal=\"0.1\" shiftDecimal=\"0.05\" priority=\"1\"",
            ),
            // Milliseconds.
            (&["V19"], "intervalVariability=\"triggered\"", "intervalVariability=\"fixed\" intervalDecimal=\"100\""),
            (&["V16"], TICK, "causality=\"local\" intervalVariability=\"triggered\" shiftDecimal=\"1\""),
            // An output clock with a priority, or with a period; a continuous variable on a clock; a local clock as an output.
            (&["V16", "S01"], TICK, "causality=\"output\" intervalVariability=\"triggered\" priority=\"1\""),
            (&["V17", "S01"], TICK, "causality=\"output\" intervalVariability=\"constant\" intervalDecimal=\"1\""),
            (
                &["V15"],
                "causality=\"output\" variability=\"continuous\"",
                "clocks=\"19\" causality=\"output\" variability=\"continuous\"",
            ),
            (
                &["S01"],
                "<Output valueReference=\"3\"/>",
                "<Output valueReference=\"3\"/><Output valueReference=\"19\"/>",
            ),
            (&["V17"], TICK, "causality=\"local\" intervalVariability=\"constant\" intervalDecimal=\"1\""),
            (
                &["V04a", "V17"],
                TICK,
                "causality=\"parameter\" variability=\"discrete\" intervalVariability=\"triggered\"",
            ),
            (
                &["S01"],
                "<Output valueReference=\"3\"/>",
                "<Output valueReference=\"3\"/><Output valueReference=\"18\"/>",
            ),
            (&["S06"], "previous=\"18\"", ""),
            (&["S06"], "<ClockedState valueReference=\"5\"/>", "<ClockedState valueReference=\"4\"/>"),
        ],
    );
}

/// Faults of types, arrays and lists, in small descriptions of both standards.
#[test]
fn faults_of_types_and_lists() {
    let types = "<TypeDefinitions><Float64Type name=\"Speed\"/></TypeDefinitions>\n  <LogCategories>";
    let typed = include_str!("fmu3.xml").replace("<LogCategories>", types).replace(
        "</ModelVariables>",
        "<UInt64 name=\"size\" valueReference=\"20\" causality=\"structuralParameter\" variability=\"fixed\" start=\"2\"/>
         <Float64 name=\"list\" valueReference=\"21\" causality=\"parameter\" variability=\"fixed\" start=\"1 2\">\
         <Dimension valueReference=\"20\"/></Float64></ModelVariables>",
    );
    each(
        &typed,
        &[
            (&["V08c"], "name=\"Speed\"", "name=\"gain\""),
            (
                &["V13"],
                "variability=\"fixed\" start=\"2\"/>",
                "variability=\"fixed\" start=\"2\"><Dimension start=\"1\"/></UInt64>",
            ),
            (&["V14"], "value=\"666f6f\"", "value=\"666f6f666f6f66\""),
            (
                &["V18"],
                "start=\"0\"/>\n    <Float64 name=\"y\"",
                "start=\"0\" reinit=\"true\"/>\n    <Float64 name=\"y\"",
            ),
            (&["X10"], "modelIdentifier=\"Small\"", "modelIdentifier=\"Small\" fixedInternalStepSize=\"-1\""),
        ],
    );
    let exchange = include_str!("exchange3.xml");
    let dir = tempfile::tempdir().unwrap();
    let only = ["V18", "S01", "S02a", "S07", "S08", "X11"];
    let of = |xml: &str| {
        let path = dir.path().join("x.fmu");
        write(&path, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/fmu.c", b"x")]);
        let report = check(&path, &only);
        (violated(&report), listed(&report))
    };
    let derivative = "<ContinuousStateDerivative valueReference=\"4\" dependencies=\"1 2 3\"/>";
    let faults: [(&[&str], &str, &str, &str); 10] = [
        (&[], exchange, "", ""),
        (&["S07"], exchange, derivative, &format!("{derivative}{derivative}")),
        (&["S07"], exchange, "<EventIndicator valueReference=\"8\"", "<EventIndicator valueReference=\"2\""),
        (&["S07"], exchange, "<EventIndicator valueReference=\"8\"", "<EventIndicator valueReference=\"7\""),
        (&["S07"], exchange, "<EventIndicator valueReference=\"8\"", "<EventIndicator valueReference=\"99\""),
        (&["V18"], exchange, "start=\"1\"/>", "start=\"1\" reinit=\"true\"/>"),
        (
            &["S08"],
            exchange,
            "variability=\"continuous\" initial=\"calculated\" derivative",
            "variability=\"discrete\" initial=\"calculated\" derivative",
        ),
        (&[], include_str!("exchange2.xml"), "", ""),
        (
            &["S07"],
            include_str!("exchange2.xml"),
            "<Unknown index=\"5\" dependencies=\"3 4\"/>",
            "<Unknown index=\"5\"/><Unknown index=\"5\"/>",
        ),
        (&["V18"], include_str!("exchange2.xml"), "<Real start=\"1\"/>", "<Real start=\"1\" reinit=\"true\"/>"),
    ];
    for (expected, xml, from, to) in faults {
        assert!(xml.contains(from), "{from}");
        let (ids, text) = of(&xml.replacen(from, to, 1));
        assert_eq!(ids, expected, "{from} -> {to}: {text}");
    }
    let (ids, text) = of(&include_str!("fmu.xml").replace("<Real min=\"0\"", "<Real reinit=\"true\" min=\"0\""));
    assert_eq!(ids, ["X11", "V18"], "{text}");
}
