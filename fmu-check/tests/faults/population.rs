//! Publicly reported faults, each reproduced in a small FMU: the complete check finds it and nothing else.
//!
//! The reports are of exporters and of FMUs of many tools. A row lists the thread, the fault, and the expected findings.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::zip::{Entry, write};
use crate::{check, compile, each, library, listed, pack_with, violated};
use std::path::Path;

/// Where a fault is made.
#[derive(Clone, Copy, Debug)]
enum Of {
    /// `fmu.c` in FMI 2.0 and `fmu3.c` in FMI 3.0.
    Small(u8),
    /// `exchange.c`, which has both interfaces.
    Both(u8),
}

use Of::{Both, Small};

/// Thread, FMU, fault, and the violated checks.
type Row = (&'static str, Of, &'static str, &'static [&'static str]);

/// Faults at run time.
const RUN: &[Row] = &[
    // Reset does not reset counters; an FMU is reused.
    ("modelica/Reference-FMUs/issues/204", Small(2), "L06e", &["L06"]),
    ("CATIA-Systems/FMPy/issues/183", Small(3), "L06", &["L06"]),
    ("CATIA-Systems/FMIKit-Simulink/issues/211", Small(2), "RESETS", &["L06", "L09b"]),
    ("modelica/Reference-FMUs/pull/180", Both(2), "E12", &["L06", "E12"]),
    // Instances share parameters, or end each other.
    ("CATIA-Systems/FMIKit-Simulink/issues/307", Small(2), "L04g", &["L04a"]),
    ("CATIA-Systems/FMIKit-Simulink/issues/326", Both(3), "E17f", &["E17"]),
    ("NTNU-IHB/PythonFMU/pull/213", Small(2), "AGAIN", &["B07a"]),
    // Memory and files that each instance leaves.
    ("NTNU-IHB/PythonFMU/pull/70", Small(2), "B07s", &["B07a", "B07l"]),
    ("OpenModelica/OpenModelica/issues/5775", Small(3), "B07a", &["B07a"]),
    ("CATIA-Systems/FMPy/issues/110", Small(2), "B08o", &["B08p"]),
    // States without parameters, without the time, as bytes that only their instance reads.
    ("OpenModelica/OpenModelica/issues/15216", Small(2), "F02p", &["F02b", "F04a"]),
    ("OpenModelica/OpenModelica/issues/12260", Small(2), "TIME_STAYS", &["F02a"]),
    ("CATIA-Systems/FMPy/issues/811", Small(2), "F04a", &["F04a"]),
    // Time: the start, rounding, steps shorter or longer than the internal one.
    ("OpenModelica/OpenModelica/issues/11855", Small(2), "T01s", &["T01a"]),
    ("CATIA-Systems/FMIKit-Simulink/issues/310", Small(2), "T01k", &["T01c"]),
    ("CATIA-Systems/FMIKit-Simulink/issues/68", Small(2), "T03l", &["T03"]),
    ("hyumo/qFMU/issues/23", Small(3), "T03w", &["T03"]),
    ("OpenModelica/OpenModelica/issues/5311", Small(2), "L12", &["L12"]),
    // Start values and parameters.
    ("INTO-CPS-Association/unifmu/issues/14", Small(2), "V07", &["V07"]),
    ("CATIA-Systems/FMIKit-Simulink/issues/11", Both(2), "V07m", &["E19"]),
    ("CATIA-Systems/FMIKit-Simulink/issues/142", Small(2), "G04i", &["G04"]),
    // Texts and messages.
    ("NTNU-IHB/PythonFMU/pull/51", Small(2), "G05", &["G05", "F02b", "F04a"]),
    ("OpenModelica/OpenModelica/issues/11500", Small(2), "B08", &["B08"]),
    ("viproma/cppfmu/issues/8", Small(2), "G_L1b", &["G-L1b"]),
    ("modelica/Reference-FMUs/issues/670", Small(3), "G_L5", &["G-L5"]),
    ("modelica/Reference-FMUs/issues/121", Small(3), "L01b", &["L01b"]),
    // Resources: a path with blanks, and a URI in its other form.
    ("modelica/Reference-FMUs/issues/74", Small(2), "Z09s", &["Z09"]),
    ("modelica-tools/FMUComplianceChecker/issues/33", Small(2), "Z09u", &["Z09"]),
    // The library, and what it computes for a solver.
    ("CATIA-Systems/FMPy/issues/642", Small(2), "B01", &["B01"]),
    ("OpenModelica/OpenModelica/issues/8548", Small(2), "UNDEFINED", &["B00"]),
    ("OpenModelica/OpenModelica/pull/8611", Both(2), "D01", &["D01"]),
    ("OpenModelica/OpenModelica/issues/16172", Both(2), "E25s", &["E25"]),
];

#[test]
fn reported_faults_at_run_time() {
    let dir = tempfile::tempdir().unwrap();
    if compile(2, "NONE").is_none() {
        eprintln!("there is no C compiler: not tested");
        return;
    }
    // Findings of the fault-free FMU with both interfaces are ignored unless the row lists them.
    let clean = |of: Of| violated(&report(dir.path(), of, "NONE"));
    let base = [Both(2), Both(3)].map(clean);
    each(RUN, |(thread, of, fault, ids)| {
        let report = report(dir.path(), *of, fault);
        let lacks = |id: &&str| matches!(of, Both(version) if base[usize::from(*version) - 2].contains(id));
        let found: Vec<_> = violated(&report).into_iter().filter(|id| !lacks(id)).collect();
        if found == *ids { Ok(()) } else { Err(format!("{thread}, {of:?} {fault}: {found:?}\n{}", listed(&report))) }
    });
}

fn report(dir: &Path, of: Of, fault: &str) -> fmu_check::report::Report {
    let (xml, binary) = match of {
        Small(2) => (include_str!("fmu.xml"), compile(2, fault)),
        Small(_) => (include_str!("fmu3.xml"), compile(3, fault)),
        Both(2) => (include_str!("exchange2.xml"), library("exchange.c", &["-DALL_OF_EXCHANGE"], fault)),
        Both(_) => (include_str!("exchange3.xml"), library("exchange.c", &["-DFMI3"], fault)),
    };
    check(&pack_with(dir, &format!("{of:?}-{fault}"), xml, &binary.unwrap()), &[])
}

/// Descriptions: thread, the description, what is replaced and by what, and the violated checks of the file.
type Edit = (&'static str, &'static str, &'static str, &'static str, &'static [&'static str]);

const XML2: &str = include_str!("fmu.xml");
const XML3: &str = include_str!("fmu3.xml");
const BOTH2: &str = include_str!("exchange2.xml");
const OUTPUT_N: &str = "variability=\"discrete\" initial=\"calculated\"><Integer";
const UNITS: &str = "<LogCategories>";

const DESCRIPTIONS: &[Edit] = &[
    // Start values and initial.
    (
        "NatLabRockies/Spawn/issues/16",
        XML2,
        "initial=\"calculated\"><Real/>",
        "initial=\"calculated\"><Real start=\"0.0\"/>",
        &["V04c"],
    ),
    ("modelica/Reference-FMUs/issues/36", XML2, "initial=\"calculated\"><Integer", "><Integer start=\"0\"", &["V04c"]),
    (
        "CATIA-Systems/FMPy/issues/68",
        XML2,
        "<Real start=\"0\"/></ScalarVariable>\n    <ScalarVariable name=\"y\"",
        "<Real/></ScalarVariable>\n    <ScalarVariable name=\"y\"",
        &["V04c"],
    ),
    (
        "OpenModelica/OpenModelica/issues/5686",
        XML2,
        "causality=\"input\" variability=\"continuous\"",
        "causality=\"input\" variability=\"fixed\"",
        &["V04a"],
    ),
    (
        "CATIA-Systems/FMPy/issues/189",
        XML2,
        "variability=\"fixed\" initial=\"exact\"><Real",
        "variability=\"constant\" initial=\"exact\"><Real",
        &["V04a"],
    ),
    // The variability of variables other than Real.
    (
        "NTNU-IHB/PythonFMU/issues/112",
        XML2,
        OUTPUT_N,
        "variability=\"continuous\" initial=\"calculated\"><Integer",
        &["V05"],
    ),
    (
        "CATIA-Systems/FMPy/issues/747",
        XML2,
        "variability=\"discrete\" initial=\"calculated\"><Boolean",
        "initial=\"calculated\"><Boolean",
        &["V05"],
    ),
    ("modelica/Reference-FMUs/pull/378", XML2, OUTPUT_N, "><Integer", &["V05"]),
    // The model structure.
    (
        "NTNU-IHB/PythonFMU/issues/193",
        XML2,
        "<InitialUnknowns>\n      <Unknown index=\"4\" dependencies=\"\"/>",
        "<InitialUnknowns>",
        &["S02a"],
    ),
    (
        "CATIA-Systems/FMPy/issues/267",
        XML2,
        "<Outputs>\n      <Unknown index=\"4\"/>\n      <Unknown index=\"5\"/>\n      <Unknown index=\"9\"/>\n    </Outputs>",
        "",
        &["S01"],
    ),
    (
        "modelica-tools/FMUComplianceChecker/issues/27",
        BOTH2,
        "<Derivatives>\n      <Unknown index=\"5\"",
        "<Derivatives>\n      <Unknown index=\"4\"",
        &["S02a", "S05"],
    ),
    (
        "modelica/Reference-FMUs/issues/675",
        XML2,
        "index=\"4\" dependencies=\"\"",
        "index=\"4\" dependencies=\"2 3\" dependenciesKind=\"constant\"",
        &["S03b"],
    ),
    (
        "dnv-opensource/mlfmu/issues/86",
        XML2,
        "<Outputs>\n      <Unknown index=\"4\"/>",
        "<Outputs>\n      <Unknown index=\"3\"/>",
        &["S01"],
    ),
    (
        "OpenModelica/OMSimulator/issues/838",
        XML2,
        "index=\"4\" dependencies=\"\"",
        "index=\"4\" dependencies=\"0\"",
        &["S03a"],
    ),
    // Names and references.
    ("modelica/fmi-cross-check/pull/74", XML2, "name=\"high\"", "name=\"high(1)\"", &["V01b"]),
    ("OpenModelica/OpenModelica/issues/11265", XML2, "name=\"high\"", "name=\"previous(high)\"", &["V01b"]),
    ("modelica/fmi-standard/issues/415", XML2, "name=\"flag\"", "name=\"label\"", &["V01a"]),
    (
        "OpenModelica/OpenModelica/issues/13250",
        XML2,
        "name=\"bias\" valueReference=\"4\"",
        "name=\"bias\" valueReference=\"1\"",
        &["V02b"],
    ),
    // XML: encodings, characters, attributes, the date, no variables.
    ("CATIA-Systems/FMIKit-Simulink/issues/99", XML2, "encoding=\"UTF-8\"", "encoding=\"windows-1252\"", &["X01a"]),
    ("OpenModelica/OpenModelica/issues/12344", XML2, "name=\"high\"", "name=\"hi\"gh\"", &["X01a"]),
    ("CATIA-Systems/FMIKit-Simulink/issues/155", XML2, "A small FMU", "Temperature < 3 & up", &["X01a"]),
    ("Hopsan/hopsan/issues/1846", XML2, "2026-01-02T03:04:05Z", "2019-05-10_16_10", &["X01b", "X05"]),
    (
        "hyumo/qFMU/issues/27",
        XML3,
        "generationDateAndTime=\"2026-01-02T03:04:05Z\"",
        "generationDateAndTime=\"2023-10-09 20:45:22.102681\"",
        &["X01b", "X05"],
    ),
    (
        "modelon-community/fmi-library/issues/128",
        XML2,
        "<CoSimulation ",
        "<CoSimulation stepSize=\"0.001\" ",
        &["X01b"],
    ),
    (
        "OpenModelica/OpenModelica/pull/7139",
        XML2,
        "name=\"n\" valueReference=\"0\"",
        "name=\"n\" clockIndex=\"1\" valueReference=\"0\"",
        &["X01b"],
    ),
    ("modelica/Reference-FMUs/issues/405", XML3, "<Start value=\"a\"/>", "", &["V04c"]),
    // Units.
    (
        "OpenModelica/OpenModelica/issues/5845",
        XML2,
        "<Real start=\"0\"/>",
        "<Real unit=\"m/s\" start=\"0\"/>",
        &["V09a"],
    ),
    (
        "modelica/fmi-standard/issues/74",
        XML2,
        UNITS,
        "<UnitDefinitions><Unit name=\"rad/s\"><BaseUnit rad=\"1\" s=\"-1\"/>\
         <DisplayUnit name=\"deg/s\" factor=\"0.017453292519943295\"/></Unit></UnitDefinitions><LogCategories>",
        &["V09d"],
    ),
    (
        "OpenModelica/OpenModelica/pull/896",
        XML2,
        UNITS,
        "<UnitDefinitions><Unit name=\"degF\"><BaseUnit K=\"1\" factor=\"0.5555555555555556\"/></Unit></UnitDefinitions><LogCategories>",
        &["V09c"],
    ),
    // FMI 3.0 requires time.
    (
        "Hopsan/hopsan/pull/2241",
        XML3,
        "causality=\"independent\" variability=\"continuous\"",
        "causality=\"local\" variability=\"continuous\"",
        &["V03"],
    ),
];

#[test]
fn reported_faults_of_descriptions() {
    let dir = tempfile::tempdir().unwrap();
    let of = |xml: &str| {
        let path = dir.path().join("x.fmu");
        write(&path, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/fmu.c", b"x")]);
        check(&path, &["xml", "variables", "structure"])
    };
    let mut wrong = Vec::new();
    for (thread, xml, from, to, ids) in DESCRIPTIONS {
        assert!(xml.contains(from), "{thread}: {from}");
        let base = violated(&of(xml));
        let report = of(&xml.replacen(from, to, 1));
        let found: Vec<_> = violated(&report).into_iter().filter(|id| !base.contains(id)).collect();
        if found != *ids {
            wrong.push(format!("{thread}: {found:?}\n{}", listed(&report)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // An archive with backslashes, and one with links.
    let path = dir.path().join("x.fmu");
    let xml = Entry::new("modelDescription.xml", XML2.as_bytes());
    let link = Entry { mode: 0o120_777, ..Entry::new("binaries/linux64/Small.so", b"libsmall.so.1") };
    for (thread, entry, ids) in [
        ("modelica/fmi-cross-check/issues/43", Entry::new("sources\\fmu.c", b"x"), &["Z01b", "Z02a"][..]),
        ("modelica-tools/FMUComplianceChecker/issues/66", link, &["Z01i"][..]),
    ] {
        write(&path, &[xml.clone(), entry]);
        let report = check(&path, &["Z01b", "Z01i", "Z02a"]);
        assert_eq!(violated(&report), ids, "{thread}: {}", listed(&report));
    }
}

/// The population contains at least 30 faults of each kind.
#[test]
fn the_population_is_large_enough() {
    assert!(RUN.len() >= 30 && DESCRIPTIONS.len() + 2 >= 30, "{} and {}", RUN.len(), DESCRIPTIONS.len());
}
