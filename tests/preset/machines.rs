//! The values of a machine: `fmu preset --motor` and `fmu tune --fmu`.

use super::{REFERENCE, bits, built, contents, entered, fmu, run, text};
use fmu_import::ssp::ssv;
use fmu_import::{Kind, Values};
use std::fs;

const MOTORS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/");

/// The FMU with the values of `fmu tune` is the FMU that an importer gives the parameter file of `fmu tune`.
#[test]
fn a_tuned_fmu_needs_no_parameter_file() {
    let dir = tempfile::tempdir().unwrap();
    let motor = format!("{MOTORS}ipmsm-2.2kw.toml");
    fmu(&["tune", &motor, "--out", text(dir.path())]).unwrap();
    for name in ["PmsmDrive", "PmsmPlant", "SensorlessController"] {
        let parameters = fs::read_to_string(dir.path().join(format!("ipmsm-2.2kw.{name}.ssv"))).unwrap();
        let parameters = ssv::read(&parameters).unwrap();
        for archive in built(name) {
            let (tuned, by_preset) = (dir.path().join("tuned.fmu"), dir.path().join("preset.fmu"));
            let said = fmu(&["tune", &motor, "--fmu", text(&archive), "--out", text(&tuned)]).unwrap();
            assert!(said.ends_with(&format!("{}\n", text(&tuned))) && !said.contains("no reference result"), "{said}");
            fmu(&["preset", text(&archive), "--motor", &motor, "--out", text(&by_preset)]).unwrap();
            let ((md, files), (other, _)) = (contents(&tuned).unwrap(), contents(&by_preset).unwrap());
            assert_eq!(md.token, other.token);
            let mut it = entered(&tuned, Kind::default());
            let mut plain = entered(&archive, Kind::default());
            for p in &parameters {
                plain.set_text(&p.name, &p.value).unwrap();
            }
            for v in md.variables.iter().filter(|v| v.start.is_some()) {
                assert_eq!(it.get(&v.name).unwrap(), plain.get(&v.name).unwrap(), "{}", v.name);
            }
            if name == "PmsmDrive" {
                let values: Vec<_> = parameters.iter().map(|p| (p.name.as_str(), p.value.as_str())).collect();
                assert_eq!(bits(&run(&tuned, &[])), bits(&run(&archive, &values)));
                // Half of the rated speed is the reference in the default experiment, and it is reached.
                let csv = String::from_utf8(files[&format!("{REFERENCE}PmsmDrive_ref.csv")].clone()).unwrap();
                let column = csv.lines().next().unwrap().split(',').position(|name| name == "\"speed\"").unwrap();
                let row = csv.lines().find(|line| line.starts_with("0.6,")).unwrap();
                let speed: f64 = row.split(',').nth(column).unwrap().parse().unwrap();
                assert!((speed / (0.5 * 157.08) - 1.0).abs() < 0.02, "{row}");
            }
        }
    }
}

/// All values of the machine are set, so that nothing of another one stays.
#[test]
fn another_machine_takes_the_place_of_the_first() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let archive = &built("PmsmDrive")[1];
    let motor = |name: &str| format!("{MOTORS}{name}.toml");
    let (first, both, direct) = (path("first.fmu"), path("both.fmu"), path("direct.fmu"));
    fmu(&["preset", text(archive), "--motor", &motor("drone-22v"), "--out", text(&first)]).unwrap();
    fmu(&["preset", text(&first), "--motor", &motor("ipmsm-2.2kw"), "--out", text(&both)]).unwrap();
    fmu(&["preset", text(archive), "--motor", &motor("ipmsm-2.2kw"), "--out", text(&direct)]).unwrap();
    let (mut both, mut direct) = (entered(&both, Kind::default()), entered(&direct, Kind::default()));
    let names: Vec<String> =
        both.description().variables.iter().filter(|v| v.start.is_some()).map(|v| v.name.clone()).collect();
    let differ: Vec<&String> =
        names.iter().filter(|name| both.get(name).unwrap() != direct.get(name).unwrap()).collect();
    assert!(differ.is_empty(), "{differ:?}");
    assert_eq!(both.get("plant.motor.R_s").unwrap(), Values::Reals(vec![3.6]));
}
