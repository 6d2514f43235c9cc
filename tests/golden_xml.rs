//! The modelDescription.xml of every FMU, as it was last looked at and accepted: a changed name, unit, range, start value,
//! dependency or token shows as a difference. `UPDATE_GOLDEN=1 cargo test --test golden_xml` accepts.
#![allow(missing_docs)]

use drive::{PmsmDrive, PmsmPlant, SensorlessController};
use fmu_core::{Description, Model};
use model_description::{FmiVersion, Generation, write};
use std::path::Path;

fn check<M: Model>() {
    let description = Description::of::<M>().unwrap();
    let generation = Generation { tool: "fmu".into(), date_and_time: "2000-01-01T00:00:00Z".into() };
    for version in [FmiVersion::V2, FmiVersion::V3] {
        let xml = write(&description, version, &generation);
        let name = format!("{}-{version}.xml", M::INFO.name);
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
    check::<PmsmPlant>();
}

#[test]
fn controller() {
    check::<SensorlessController>();
}

#[test]
fn whole_drive() {
    check::<PmsmDrive>();
}
