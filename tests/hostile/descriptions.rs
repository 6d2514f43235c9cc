//! Descriptions that attack the XML reader, or code that trusts their numbers.

use crate::zip::{Entry, write};
use crate::{Place, XML, described, entries, library};

fn with(from: &str, to: &str) -> Place {
    assert!(XML.contains(from), "{from}");
    described(&XML.replacen(from, to, 1))
}

#[test]
fn xml_attacks() {
    let entities = "<!DOCTYPE x [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;\">]>";
    let file = "<!DOCTYPE x [<!ENTITY b SYSTEM \"file:///etc/passwd\">]>";
    for doctype in [entities, file] {
        let xml = XML.replace("<fmiModelDescription", &format!("{doctype}<fmiModelDescription"));
        described(&xml.replace("modelName=\"Hostile\"", "modelName=\"&b;\"")).is_refused(doctype, 1, "line 2: ");
    }
    with("modelName=\"Hostile\"", "modelName=\"&b;\"").is_refused("an entity that is not declared", 1, "line 2: ");
    with("<ModelStructure>", &format!("<ModelStructure>{}", "<a>".repeat(100_000))).is_refused(
        "depth",
        1,
        "levels of elements",
    );
    with("</fmiModelDescription>", "").is_refused("an open end", 1, "is not closed");
    let name = "n".repeat(1 << 20);
    let long = with("name=\"y\"", &format!("name=\"{name}\"")).runs("simulate", &[]);
    assert!(long.status == 0 || library().is_none(), "{:.300}", long.errors);
}

#[test]
fn encodings_are_named() {
    let utf16 = |big: bool| {
        let bytes = |x: u16| if big { x.to_be_bytes() } else { x.to_le_bytes() };
        std::iter::once(0xfeff).chain(XML.encode_utf16()).flat_map(bytes).collect::<Vec<u8>>()
    };
    let utf32: Vec<u8> =
        std::iter::once('\u{feff}').chain(XML.chars()).flat_map(|c| u32::from(c).to_le_bytes()).collect();
    for (bytes, part) in [
        (utf16(false), "the encoding is UTF-16, expected UTF-8"),
        (utf16(true), "the encoding is UTF-16, expected UTF-8"),
        (utf32, "the encoding is UTF-32, expected UTF-8"),
        (XML.replace("Hostile", "H\u{e9}").chars().map(|c| u8::try_from(c).unwrap()).collect(), "not UTF-8"),
    ] {
        let place = Place::new();
        let mut all = entries(XML);
        all[0] = Entry::new("modelDescription.xml", &bytes);
        write(&place.fmu(), &all);
        place.is_refused(part, 1, part);
        assert!(place.runs("check", &["--only", "X01a"]).out.contains(part), "{part}");
    }
}

#[test]
fn numbers_are_not_believed() {
    let variable = |k: usize| format!("<ScalarVariable name=\"v{k}\" valueReference=\"{k}\"><Real/></ScalarVariable>");
    let many: String = (2..200_102).map(variable).collect();
    with("<ModelVariables>", &format!("<ModelVariables>{many}")).is_refused(
        "variables",
        2,
        "has 200101 variables; the limit is 200000",
    );
    with("<ModelVariables>", &format!("<ModelVariables>{}", "<a/>".repeat(2_000_000))).is_refused(
        "elements",
        2,
        "elements and attributes; the limit is 2000000",
    );
    let three = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Hostile" instantiationToken="g"><CoSimulation modelIdentifier="Hostile"/><ModelVariables>
<Float64 name="time" valueReference="0" causality="independent"/>
<Float64 name="y" valueReference="1" causality="output">EXTENT</Float64></ModelVariables>
<ModelStructure><Output valueReference="1"/></ModelStructure></fmiModelDescription>"#;
    let dimension = r#"<Dimension start="1000000000"/>"#;
    described(&three.replace("EXTENT", dimension)).is_refused(
        "a dimension",
        2,
        "y: has variables of 1000000000 values in all",
    );
    // The product exceeds 64 bits.
    described(&three.replace("EXTENT", &dimension.repeat(3))).is_refused("dimensions", 2, "the limit is 10000000");
    let dependencies = format!("<Unknown index=\"1\" dependencies=\"{}\"/>", "1 ".repeat(2_000_001));
    with("<Unknown index=\"1\"/>", &dependencies).is_refused("dependencies", 2, "has 2000001 dependencies in one list");
}

#[test]
fn experiments_that_make_no_sense() {
    for (step, part) in [
        ("1e308", "the step 1e308 s is longer than the simulation of 1 s"),
        ("1e-300", "the limit is 2147483648"),
        ("NaN", "must be finite"),
        ("-1", "be positive"),
        ("0", "be positive"),
    ] {
        let place = with("stepSize=\"0.1\"", &format!("stepSize=\"{step}\""));
        let ended = place.runs("simulate", &[]);
        assert!(library().is_none() || (ended.status == 2 && ended.errors.contains(part)), "{step}: {ended:?}");
    }
}

/// Names with control sequences are escaped: `runs` looks for control characters.
#[test]
fn names_are_escaped() {
    // XML has no escape character; those of eight bits are allowed.
    let refused = "line 5: not well-formed XML: the attribute name has the character U+001B, which XML does not allow";
    with("name=\"y\"", "name=\"y&#27;[2J\"").is_refused("escape", 1, refused);
    let place = with("name=\"y\"", "name=\"y&#x9b;2J&#x9d;0;title&#x9c;&#x202e;\" description=\"&#x9b;31m\"");
    if library().is_some() {
        let ended = place.runs("simulate", &[]);
        assert!(ended.status == 0 && ended.out.contains("\\u{9b}2J") && ended.out.contains("\\u{202e}"), "{ended:?}");
        let ended = place.runs("simulate", &["--set", "x.y=1", "--record", "x.y\u{1b}"]);
        assert_eq!(ended.status, 2);
        // Also in the header of a recording.
        let ended = place.runs("simulate", &["--csv", "-"]);
        let header = "time,y\\u{9b}2J\\u{9d}0;title\\u{9c}\\u{202e}\n0,1\n";
        assert!(ended.status == 0 && ended.out.starts_with(header), "{ended:?}");
        // A name from the command line, on standard error.
        let named = format!("\u{1b}[2J={}", place.fmu().display());
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_fmu"))
            .args(["simulate", &named, "--logging", "--csv", "-"])
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && errors.contains("\\u{1b}[2J"), "{errors}");
        assert!(![&output.stdout, &output.stderr].iter().any(|said| said.contains(&0x1b)), "{errors}");
    }
    let ended = place.runs("check", &["--only", crate::STATIC, "--verbose"]);
    assert!(ended.status < 2, "{ended:?}");
}

#[test]
fn an_identifier_that_is_a_path() {
    for identifier in ["../../../../tmp/x", "/lib/x86_64-linux-gnu/libm", "", "a b", &"x".repeat(10_000)] {
        with("modelIdentifier=\"Hostile\"", &format!("modelIdentifier=\"{identifier}\"")).is_refused(
            "identifier",
            1,
            "for this platform",
        );
    }
}
