//! `fmu map`: its files, its output, and its refusals.

use super::{common, fails, fmu, text};
use std::path::Path;

fn motor(name: &str) -> String {
    format!("{}/motors/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn a_map_is_written_whole_or_not_at_all() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("map");
    let traction = motor("traction-63kw");
    let arguments =
        ["map", &traction, "--u-dc", "350,400", "--T", "20", "--grid", "11x11", "--out", out.to_str().unwrap()];
    let output = fmu(&arguments);
    let printed = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for part in ["Best point of the motor", "Driving cycle", "10 points agree with PmsmDrive within", "map.npz"] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    let names = ["envelope.csv", "map.csv", "map.html", "map.npz", "map.svg"];
    let written = |folder: &Path| -> Vec<String> {
        let entries = std::fs::read_dir(folder).map(|all| all.map(|e| e.unwrap().file_name().into_string().unwrap()));
        let mut all: Vec<String> = entries.map(Iterator::collect).unwrap_or_default();
        all.sort();
        all
    };
    assert_eq!(written(&out), names);
    let page = std::fs::read_to_string(out.join("map.html")).unwrap();
    common::pages::stands_alone(&page, |file| names.contains(&file) && file != "map.html");
    // Equal requests give equal bytes, also with one thread.
    let before: Vec<Vec<u8>> = names.iter().map(|name| std::fs::read(out.join(name)).unwrap()).collect();
    assert!(fmu(&arguments).status.success());
    for (name, before) in names.iter().zip(before) {
        assert!(std::fs::read(out.join(name)).unwrap() == before, "{name}");
    }
    // Another cycle: at rest, the vehicle takes no energy.
    let cycle = dir.path().join("rest.csv");
    std::fs::write(&cycle, "t,v\n0,0\n10,0\n").unwrap();
    let with = [&arguments[..], &["--verify", "0", "--cycle", cycle.to_str().unwrap()]].concat();
    let resting = text(&fmu(&with).stdout);
    let energy = |printed: &str| printed.split_once("Driving cycle").unwrap().1.to_owned();
    assert!(energy(&resting) != energy(&printed) && resting.contains("0.00000"), "{resting}");
    std::fs::write(&cycle, "t,v\n0,0\n0,50\n").unwrap();
    fails(&with, 2, &["rest.csv", "the time 0 s does not increase"]);
    // A failed request leaves no files.
    let none = dir.path().join("none");
    fails(&["map", &traction, "--T", "-300", "--out", none.to_str().unwrap()], 2, &["--T -300"]);
    assert!(!none.exists());
}

#[test]
fn what_has_no_map_is_refused() {
    let traction = motor("traction-63kw");
    for (arguments, parts) in [
        (
            &["--grid", "0x41"][..],
            &["--grid 0x41: write SPEEDSxTORQUES, for example 47x41", "an odd number of torques"][..],
        ),
        (&["--grid", "47"], &["--grid 47: "]),
        (&["--grid", "-1x5"], &["--grid -1x5: "]),
        (&["--u-dc", "-300"], &["--u-dc -300: must be greater than 0 V and at most 10000 V"]),
        (&["--u-dc", "300,volt"], &["--u-dc volt: is not a number"]),
        (&["--u-dc="], &["--u-dc has no value"]),
        (&["--u-dc", "nan"], &["--u-dc NaN: must be greater than 0 V"]),
        (&["--T", "-274"], &["--T -274: must be above absolute zero, -273.15 degC"]),
        (&["--T", "-260"], &["--T -260: with the coefficients of [temperature]", "greater than 0"]),
        (&["--verify", "1000"], &["--verify: 1000 are too many; at most 100"]),
    ] {
        fails(&[&["map", &traction][..], arguments].concat(), 2, parts);
    }
    fails(&["map", "none.toml"], 2, &["reading none.toml"]);
    let dir = tempfile::tempdir().unwrap();
    for (from, to, part) in [
        ("torque = 100.0 ", "torque = 105.5 ", "not the 105.5 N.m of rating.torque"),
        ("torque = 100.0 ", "torque = nan ", "rating.torque"),
        ("E_sw = 25e-3", "E_sw = -1.0", "inverter.E_sw of PmsmPlant = -1 must be"),
    ] {
        let path = dir.path().join("m.toml");
        let file = std::fs::read_to_string(&traction).unwrap();
        assert!(file.contains(from), "{from}");
        std::fs::write(&path, file.replacen(from, to, 1)).unwrap();
        fails(&["map", path.to_str().unwrap()], 2, &["m.toml:", part]);
    }
}
