//! Refusals, which write nothing.

use super::{built, contents, fmu, preset, text};
use crate::common;
use std::fs;

#[test]
fn values_that_do_not_fit_together_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let new = dir.path().join("new.fmu");
    for archive in built("SensorlessController") {
        let said = preset(&archive, &new, &["limit.i=1"]).unwrap_err();
        let (refuses, names) = ("does not initialize for Co-Simulation with these start values", "limit.i");
        assert!(said.contains(refuses) && said.contains(names) && !new.exists(), "{said}");
    }
}

#[test]
fn files_that_are_no_fmus_of_this_program() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let [two, three] = built("PmsmPlant");
    fs::write(path("text.fmu"), "no archive").unwrap();
    common::rewrite(&two, &path("elsewhere.fmu"), |name, bytes| Some(bytes).filter(|_| !name.starts_with("binaries/")));
    common::rewrite(&three, &path("edited.fmu"), |name, bytes| {
        if name != "modelDescription.xml" {
            return Some(bytes);
        }
        Some(
            String::from_utf8(bytes).unwrap().replace("instantiationToken=\"{", "instantiationToken=\"{0").into_bytes(),
        )
    });
    for (file, why) in [
        ("none.fmu", "none.fmu: "),
        ("text.fmu", "not a ZIP archive"),
        ("elsewhere.fmu", "for this platform"),
        ("edited.fmu", "modelDescription.xml and binary are of different builds: build the FMU again"),
    ] {
        let said = preset(&path(file), &path("new.fmu"), &["motor.R_s=3"]).unwrap_err();
        assert!(said.contains(why) && said.starts_with("Some(2) ") && !path("new.fmu").exists(), "{said}");
    }
    let new = path("new.fmu");
    let (given, out) = (["preset", text(&two), "--set", "motor.R_s=3"], ["--out", text(&new)]);
    for (more, why) in [
        (&["--name", "a/b"][..], "--name a/b: a name has 1 to 100 letters of ASCII"),
        (&["--ssv", "none.ssv"], "none.ssv: No such file"),
        (&["--motor", "none.toml"], "none.toml"),
        (&["--stimuli", "none.csv"], "--stimuli none.csv: No such file"),
        (&["--stimuli", text(&path("text.fmu"))], "--stimuli "),
    ] {
        let said = fmu(&[&given[..], &out, more].concat()).unwrap_err();
        assert!(said.contains(why) && !new.exists(), "{said}");
    }
    let said = fmu(&given).unwrap_err();
    assert!(said.contains("--out"), "{said}");
    // The unit in a parameter file must be the variable's.
    let ssv = path("values.ssv");
    let values = "<Parameter name=\"motor.L_d\"><Real value=\"6\" unit=\"mH\"/></Parameter>";
    fs::write(&ssv, format!("<ParameterSet><Parameters>\n{values}</Parameters></ParameterSet>")).unwrap();
    let said = fmu(&["preset", text(&two), "--ssv", text(&ssv), "--out", text(&new)]).unwrap_err();
    assert!(
        said.contains("values.ssv: line 2: motor.L_d is given in mH, but PmsmPlant uses H: convert the value"),
        "{said}"
    );
    assert!(!new.exists() && contents(&two).is_ok());
}
