//! The values of a machine: `fmu preset --motor` and `fmu tune --fmu`.

use super::{REFERENCE, bits, built, contents, entered, fmu, run, text};
use fmu_import::{Kind, Values};
use fmu_system::ssp::ssv;
use std::fs;

const MOTORS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/");

/// The FMU with the values of `fmu tune` behaves like an FMU whose importer applies the parameter file of `fmu tune`.
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
                // In the default experiment, half of the rated speed is reached before the load comes.
                let csv = String::from_utf8(files[&format!("{REFERENCE}PmsmDrive_ref.csv")].clone()).unwrap();
                let column = csv.lines().next().unwrap().split(',').position(|name| name == "\"speed\"").unwrap();
                let number = |line: &str, column: usize| line.split(',').nth(column).unwrap().parse::<f64>().unwrap();
                let stop = md.default_experiment.stop.unwrap();
                assert!(stop > 1.5 && number(csv.lines().last().unwrap(), 0) == stop, "{stop}");
                let speeds: Vec<f64> = csv.lines().skip(1).map(|line| number(line, column) / (0.5 * 157.08)).collect();
                let reached = speeds.iter().filter(|speed| (*speed - 1.0).abs() < 0.02).count();
                assert!(reached > 20 && (speeds.last().unwrap() - 1.0).abs() < 0.1, "{speeds:?}");
            }
        }
    }
}

/// The values of a machine replace those of another one; a note names the remaining values.
#[test]
fn another_machine_takes_the_place_of_the_first() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let archive = &built("PmsmDrive")[1];
    let motor = |name: &str| format!("{MOTORS}{name}.toml");
    let (first, both, direct) = (path("first.fmu"), path("both.fmu"), path("direct.fmu"));
    fmu(&["preset", text(archive), "--motor", &motor("drone-22v"), "--out", text(&first)]).unwrap();
    let said = fmu(&["preset", text(&first), "--motor", &motor("ipmsm-2.2kw"), "--out", text(&both)]).unwrap();
    let note =
        said.lines().find(|line| line.starts_with("note: values of the earlier preset that ipmsm-2.2kw")).unwrap();
    fmu(&["preset", text(archive), "--motor", &motor("ipmsm-2.2kw"), "--out", text(&direct)]).unwrap();
    let (mut both, mut direct) = (entered(&both, Kind::default()), entered(&direct, Kind::default()));
    let md = both.description().clone();
    for v in md.variables.iter().filter(|v| v.start.is_some()) {
        let differs = both.get(&v.name).unwrap() != direct.get(&v.name).unwrap();
        assert!(!differs || note.contains(&v.name), "{} stays: {note}", v.name);
    }
    assert!(note.contains("controller.rasmussen.c_1"));
    assert_eq!(both.get("plant.motor.R_s").unwrap(), Values::Reals(vec![3.6]));
}
