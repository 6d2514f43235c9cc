//! `fmu preset`: FMUs with other start values, in this program's importer and in FMPy, both standards.
#![allow(missing_docs)]
#![allow(clippy::float_cmp, reason = "the bits of start values and results")]

#[path = "../common/mod.rs"]
mod common;
mod machines;
mod refused;
mod types;

use fmu_check::Level;
use fmu_core::preset::FILE;
use fmu_import::{Fmu, Instance, Kind, Values, contents};
use fmu_system::cosimulation::{Recording, Schedule, Settings, System};
use model_description::FmiVersion::{V2, V3};
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

const REFERENCE: &str = "extra/org.fmi-standard.fmi-ls-ref/";

/// Runs `fmu`; returns its standard output and standard error.
fn fmu(arguments: &[&str]) -> Result<String, String> {
    let output = Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().unwrap();
    let said = String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned();
    match output.status.code() {
        Some(0) => Ok(said),
        code => Err(format!("{code:?} {said}")),
    }
}

/// The archive `NAME.fmu` of `fmu build`, for each standard.
fn built(name: &str) -> [PathBuf; 2] {
    ["fmi2", "fmi3"].map(|standard| common::archives().join(standard).join(name).with_extension("fmu"))
}

/// Presets `from` with these values.
fn preset(from: &Path, to: &Path, values: &[&str]) -> Result<String, String> {
    let sets: Vec<&str> = values.iter().flat_map(|value| ["--set", value]).collect();
    fmu(&[&["preset", text(from), "--out", text(to)], &sets[..]].concat())
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// In Initialization Mode.
fn entered(archive: &Path, kind: Kind) -> Instance {
    let mut it = Fmu::open(archive).unwrap().instantiate_as(kind, "it", false).unwrap();
    enter(&mut it);
    it
}

fn enter(it: &mut Instance) {
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
}

/// A start from rest with a load, the outputs recorded.
fn run(archive: &Path, values: &[(&str, &str)]) -> Recording {
    let fmu = Fmu::open(archive).unwrap();
    let mut system = System::default();
    system.add("it", &fmu, false).unwrap();
    for (name, value) in values {
        system.set(&format!("it.{name}"), value).unwrap();
    }
    for v in fmu.description().variables.iter().filter(|v| v.causality == model_description::Causality::Output) {
        system.record_as(&format!("it.{}", v.name), &v.name).unwrap();
    }
    system.input("it.speed_ref", Schedule::parse("0:0,0.05:60").unwrap()).unwrap();
    system.input("it.tau_load", Schedule::parse("0:0,0.2:1").unwrap()).unwrap();
    let settings = Settings { start: 0.0, stop: 0.3, step: 1e-3, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

fn bits(recording: &Recording) -> Vec<Vec<u64>> {
    recording.columns.iter().map(|c| c.values.iter().map(|x| x.to_bits()).collect()).collect()
}

const SETS: [&str; 6] = [
    "plant.motor.R_s=3.25",
    "plant.initial.speed=30 rpm",
    "controller.estimator=FluxObserver",
    "controller.current.mtpa=true",
    "controller.motor.n_p=4",
    "plant.motor.n_p=4",
];
/// The same for an importer that sets them, and the description.
const VALUES: [(&str, &str, &str); 6] = [
    ("plant.motor.R_s", "3.25", "3.25"),
    ("plant.initial.speed", "30rpm", "3.141592653589793"),
    ("controller.estimator", "FluxObserver", "15"),
    ("controller.current.mtpa", "true", "true"),
    ("controller.motor.n_p", "4", "4"),
    ("plant.motor.n_p", "4", "4"),
];

/// Description, instance, reset, saved states and results have the preset; the binaries are the same.
#[test]
fn a_preset_is_in_the_description_and_in_every_instance() {
    let dir = tempfile::tempdir().unwrap();
    for (archive, version) in built("PmsmDrive").iter().zip([V2, V3]) {
        let new = dir.path().join("new.fmu");
        let said = preset(archive, &new, &SETS).unwrap();
        for line in [
            "  plant.motor.R_s = 3.25 Ohm (was 2.0)\n",
            "  plant.initial.speed = 3.141592653589793 rad/s (was 0.0)\n",
            "  controller.estimator = FluxObserver (was Rasmussen)\n",
            "new.fmu\n",
        ] {
            assert!(said.contains(line), "{said}");
        }
        let ((old_md, old), (md, files)) = (contents(archive).unwrap(), contents(&new).unwrap());
        for (new, old) in md.variables.iter().zip(&old_md.variables) {
            let value = VALUES.iter().find(|(name, ..)| *name == new.name);
            assert_eq!(new.start.as_deref(), value.map(|v| v.2).or(old.start.as_deref()), "{}", new.name);
            assert_eq!(
                (&new.name, new.value_reference, &new.declared_type),
                (&old.name, old.value_reference, &old.declared_type)
            );
        }
        assert_eq!((&md.outputs, &md.derivatives), (&old_md.outputs, &old_md.derivatives));
        assert_eq!((&md.initial_unknowns, &md.event_indicators), (&old_md.initial_unknowns, &old_md.event_indicators));
        let suffix = fmu_core::preset::suffix(&files[&format!("resources/{FILE}")]);
        assert_eq!((md.version, &md.model_name), (version, &old_md.model_name));
        assert_eq!(md.token, old_md.token.clone() + &suffix);
        assert_eq!(md.co_simulation.unwrap().model_identifier, "PmsmDrive");
        for (name, bytes) in old {
            let same = !name.starts_with(REFERENCE)
                && !["modelDescription.xml", "documentation/index.html"].contains(&name.as_str());
            if same {
                assert_eq!(files[&name], bytes, "{name}");
            }
            if name.ends_with("_ref.csv") {
                assert_ne!(files[&name], bytes, "the reference result is run anew");
            }
        }
        assert!(!files.keys().any(|name| name.contains(".ssv")), "it contains the differences from other start values");
        let page = String::from_utf8(files["documentation/index.html"].clone()).unwrap();
        for part in [
            "<li><a href=\"#preset\">Preset</a></li>",
            "A preset of PmsmDrive</b>, of which <a href=\"#preset\">6 start values</a> differ",
            "<tr><td class=\"name\">plant.motor.R_s</td><td class=\"number\">3.25</td><td class=\"unit\">Ohm</td><td class=\"number\">2</td></tr>",
            "<td class=\"number\">FluxObserver</td>",
        ] {
            assert!(page.contains(part), "{part}");
        }

        let set: Vec<(&str, &str)> = VALUES.iter().map(|(name, value, _)| (*name, *value)).collect();
        assert_eq!(bits(&run(&new, &[])), bits(&run(archive, &set)), "as an importer that sets the values");
        assert_ne!(bits(&run(&new, &[])), bits(&run(archive, &[])));
        for kind in [Kind::default(), Kind::ModelExchange] {
            let mut it = entered(&new, kind);
            let resistance = |it: &mut Instance| it.get("plant.motor.R_s").unwrap();
            assert_eq!(resistance(&mut it), Values::Reals(vec![3.25]));
            let state = it.get_state().unwrap();
            let bytes = it.serialize_state(state).unwrap();
            it.set("plant.motor.R_s", Values::Reals(vec![1.0])).unwrap();
            let state = it.deserialize_state(&bytes).unwrap();
            it.set_state(state).unwrap();
            assert_eq!(resistance(&mut it), Values::Reals(vec![3.25]));
            it.set("plant.motor.R_s", Values::Reals(vec![1.0])).unwrap();
            it.reset().unwrap();
            enter(&mut it);
            assert_eq!(resistance(&mut it), Values::Reals(vec![3.25]), "a reset returns to the preset");
            assert_eq!(it.get("controller.estimator").unwrap(), Values::Integers(vec![15]));
        }
    }
}

/// A preset of a preset keeps its values, except those set again, and its name.
#[test]
fn a_preset_of_a_preset_merges() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    for archive in built("PmsmPlant") {
        let ssv = path("values.ssv");
        let parameters = r#"<ParameterSet><Parameters>
            <Parameter name="motor.R_s"><Real value="4" unit="Ohm"/></Parameter>
            <Parameter name="motor.n_p"><Integer value="5"/></Parameter></Parameters></ParameterSet>"#;
        fs::write(&ssv, parameters).unwrap();
        let (first, second, third) = (path("first.fmu"), path("second.fmu"), path("third.fmu"));
        let (name, out) = (["--name", "My pump"], ["--out", text(&first)]);
        let given = ["preset", text(&archive), "--ssv", text(&ssv), "--set", "motor.n_p=6"];
        fmu(&[&given[..], &name, &out].concat()).unwrap();
        preset(&first, &second, &["motor.psi_M=0.2", "motor.R_s=5"]).unwrap();
        // In another order, and over its own archive: the same FMU.
        fmu(&[
            "preset",
            text(&archive),
            "--set",
            "motor.psi_M=0.2",
            "--set",
            "motor.n_p=6",
            "--name",
            "My pump",
            "--out",
            text(&third),
        ])
        .unwrap();
        preset(&third, &third, &["motor.R_s=5"]).unwrap();
        let ((a, of_a), (b, of_b)) = (contents(&second).unwrap(), contents(&third).unwrap());
        assert_eq!((&a.token, &a.model_name), (&b.token, &b.model_name));
        assert_eq!(a.model_name, "My pump");
        let file = format!("resources/{FILE}");
        let preset: serde_json::Value = serde_json::from_slice(&of_a[&file]).unwrap();
        let start = serde_json::json!({"motor.n_p": "6", "motor.R_s": "5.0", "motor.psi_M": "0.2"});
        assert_eq!(preset, serde_json::json!({"format": "fmu preset", "version": 2, "start": start}));
        assert_eq!(of_a[&file], of_b[&file]);
        assert!(of_a.contains_key(&format!("{REFERENCE}My pump_ref.csv")), "{:?}", of_a.keys());
        let mut it = entered(&second, Kind::default());
        assert_eq!(it.get("motor.n_p").unwrap(), Values::Integers(vec![6]));
        assert_eq!(it.get("motor.psi_M").unwrap(), Values::Reals(vec![0.2]));
    }
}

/// `fmu check` and `fmu prove` report the same as for the FMU itself.
#[test]
fn check_and_prove_treat_it_as_any_fmu() {
    let dir = tempfile::tempdir().unwrap();
    let program = Some(PathBuf::from(env!("CARGO_BIN_EXE_fmu")));
    let mut archives = Vec::new();
    for (archive, standard) in built("PmsmPlant").iter().zip(["fmi2", "fmi3"]) {
        let new = dir.path().join(format!("{standard}.fmu"));
        preset(archive, &new, &["motor.R_s=3", "motor.n_p=2"]).unwrap();
        let options = fmu_check::Options { program: program.clone(), ..Default::default() };
        let report = fmu_check::run(&new, &options).unwrap();
        let must: Vec<_> = report.violated().filter(|f| f.level == Level::Must).map(|f| f.id).collect();
        assert!(must.is_empty(), "{}", report.text(false));
        let plain = fmu_check::run(archive, &options).unwrap();
        assert!(report.violated().map(|f| f.id).eq(plain.violated().map(|f| f.id)), "{}", plain.text(false));
        archives.push(new);
    }
    let python =
        common::python::environment(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy/requirements.txt"));
    let folder = dir.path().join("proof");
    let given = ["prove", text(&folder), text(&archives[0]), text(&archives[1]), "--python", text(&python)];
    let said = fmu(&given).unwrap();
    assert!(!said.contains("note: "), "{said}");
    for standard in ["fmi2", "fmi3"] {
        let readme = fs::read_to_string(folder.join(standard).join("PmsmPlant/Readme.txt")).unwrap();
        assert!(readme.contains("FMPy 0.3.32: 0.0e0") || readme.contains("FMPy 0.3.32: "), "{readme}");
    }
}

/// The archive with the resources changed or gone: the binary names the cause, and no FMU runs with other values.
#[test]
fn without_its_preset_the_fmu_does_not_run() {
    let dir = tempfile::tempdir().unwrap();
    let (new, broken) = (dir.path().join("new.fmu"), dir.path().join("broken.fmu"));
    for archive in built("PmsmPlant") {
        preset(&archive, &new, &["motor.R_s=3"]).unwrap();
        let cases: [(Option<&[u8]>, &str); 3] = [
            (None, "fmu-preset.json: No such file or directory"),
            (Some(br#"{"format": "fmu preset", "version": 2, "start": {"motor.R_s": "4.0"}}"#), "its hash is {"),
            (Some(b""), "its hash is {"),
        ];
        for (content, why) in cases {
            common::rewrite(&new, &broken, |name, bytes| {
                if name == format!("resources/{FILE}") { content.map(<[u8]>::to_vec) } else { Some(bytes) }
            });
            for kind in [Kind::default(), Kind::ModelExchange] {
                let error = Fmu::open(&broken).unwrap().instantiate_as(kind, "it", false).err().unwrap().to_string();
                assert!(error.contains(why), "{error}");
            }
            let out = dir.path().join("none.fmu");
            let said = preset(&broken, &out, &["motor.L_d=0.01"]).unwrap_err();
            assert!(said.contains("is missing or does not match modelDescription.xml") && !out.exists(), "{said}");
        }
    }
}

#[test]
fn fmpy_runs_presets() {
    let folder = common::python::scratch().join(format!("presets-{}", std::process::id()));
    for (archive, standard) in built("PmsmDrive").iter().zip(["fmi2", "fmi3"]) {
        let out = folder.join(standard).join("Pump.fmu");
        let sets: Vec<&str> = SETS.iter().flat_map(|value| ["--set", value]).collect();
        fmu(&[&["preset", text(archive), "--name", "Pump", "--out", text(&out)], &sets[..]].concat()).unwrap();
    }
    common::python::pytest("fmpy", "preset", &["test_preset.py"], &[("FMU_PRESETS", &folder)]);
    fs::remove_dir_all(&folder).unwrap();
}
