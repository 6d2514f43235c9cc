//! The modelDescription.xml of every packed FMU, as last reviewed and accepted: a changed name, unit, range, start value,
//! dependency, capability or token shows as a difference. `UPDATE_GOLDEN=1 cargo test --test golden_xml` accepts.
#![allow(missing_docs)]

mod common;

use std::path::Path;

/// The file without the parts that differ from build to build.
fn lasting(xml: &str) -> String {
    let mut xml = xml.to_owned();
    for (attribute, value) in [("generationTool", "fmu"), ("generationDateAndTime", "2000-01-01T00:00:00Z")] {
        let open = format!("{attribute}=\"");
        let start = xml.find(&open).expect("the attribute") + open.len();
        let end = start + xml[start..].find('"').expect("the end of the attribute");
        xml.replace_range(start..end, value);
    }
    xml
}

fn check(model: &str) {
    check_of(model, &[("fmi2", "2.0"), ("fmi3", "3.0")]);
}

fn check_of(model: &str, standards: &[(&str, &str)]) {
    for (folder, version) in standards {
        let archive = common::archives().join(folder).join(format!("{model}.fmu"));
        let (_, files) = fmu_import::contents(&archive).unwrap();
        let xml = lasting(std::str::from_utf8(&files["modelDescription.xml"]).unwrap());
        let name = format!("{model}-{version}.xml");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(&name);
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            std::fs::write(&path, &xml).unwrap();
        }
        let golden = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let line = golden.lines().zip(xml.lines()).position(|(a, b)| a != b);
        let at = line.map(|k| (k + 1, golden.lines().nth(k), xml.lines().nth(k)));
        assert!(golden == xml, "{name} differs: line, golden and now: {at:?}; UPDATE_GOLDEN=1 accepts");
    }
}

#[test]
fn plant() {
    check("PmsmPlant");
}

#[test]
fn controller() {
    check("SensorlessController");
}

/// Clocks exist in FMI 3.0 only.
#[test]
fn clocked_controller() {
    check_of("SensorlessControllerClocked", &[("fmi3", "3.0")]);
}

#[test]
fn whole_drive() {
    check("PmsmDrive");
}

#[test]
fn mean_drive() {
    check("PmsmDriveMean");
}

#[test]
fn mapped_drive() {
    check("MappedDrive");
}
