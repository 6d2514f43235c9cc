//! The machines of `motors/`: each starts from many angles and takes rated torque; notes name the exceptions.
#![allow(missing_docs, non_snake_case)]

use drive_tools::tune::limits::{self, Limit};
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::remedy::What;
use drive_tools::tune::rules;
use drive_tools::tune::setting::{Tuned, Value};
use drive_tools::tune::trial::{self, Task, Trial};
use std::path::{Path, PathBuf};

/// The eleven classes of machine that were measured from outside.
const CLASSES: [&str; 11] = [
    "servo-48v",
    "spindle-40krpm",
    "wind-5kw",
    "hub-36v",
    "pump-12v",
    "drone-22v",
    "flat-24v",
    "traction-80kw",
    "traction-60kw",
    "ipmsm-2.2kw",
    "elevator-5kw",
];

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors").join(format!("{name}.toml"))
}

fn tuned(name: &str) -> Tuned {
    drive_tools::tune::tune(&file(name)).unwrap()
}

/// The file of a machine with its inertia changed by a factor, and `more` at its end.
fn changed(name: &str, inertia: f64, more: &str) -> MotorFile {
    let path = file(name);
    let text = std::fs::read_to_string(&path).unwrap();
    let line = text.lines().find(|line| line.starts_with("J = ")).unwrap();
    let J: f64 = line["J = ".len()..].split_whitespace().next().unwrap().parse().unwrap();
    let text = text.replacen(line, &format!("J = {}", inertia * J), 1) + more;
    MotorFile::parse(&text, &path).unwrap()
}

/// The rated torque as a step at `level` (pu) from `angles` angles.
fn tried(tuned: &Tuned, level: f64, angles: u32) -> Trial {
    trial::at(tuned, &Task { level, torque: tuned.torque, rise: 0.0 }, angles)
}

/// The notes on a machine that was tried from `angles` angles.
fn announced(motor: &MotorFile, angles: u32) -> Vec<Limit> {
    let tuned = rules::tune(motor).unwrap();
    limits::of(motor, &tuned, &trial::all(&tuned, angles)).0
}

fn value(tuned: &Tuned, name: &str) -> f64 {
    match tuned.controller.iter().find(|setting| setting.name == name).map(|setting| &setting.value) {
        Some(Value::Real(x)) => *x,
        other => panic!("{name}: {other:?}"),
    }
}

/// Every machine from `angles` angles.
fn all(angles: u32) {
    let mut files: Vec<_> =
        std::fs::read_dir(file("x").parent().unwrap()).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let names: Vec<_> = files.iter().map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    assert!(CLASSES.iter().all(|class| names.iter().any(|name| name == class)), "{names:?}");
    for name in names {
        for trial in trial::all(&tuned(&name), angles) {
            assert!(trial.starts() && trial.holds(), "{name}: {trial:?}");
        }
    }
}

#[test]
fn each_machine_starts_and_holds_its_rated_torque() {
    all(4);
}

/// `cargo test --release -p drive-tools --test machines -- --ignored`
#[test]
#[ignore = "a minute in a debug build"]
fn from_all_24_angles() {
    all(24);
}

/// More inertia: the start waits until the rotor has settled on the current vector, and R^ comes closer to R.
#[test]
fn a_heavy_rotor_gets_the_time_it_needs() {
    let heavier = |name| rules::tune(&changed(name, 30.0, "")).unwrap();
    let (light, heavy) = (tuned("traction-60kw"), heavier("traction-60kw"));
    let time = |tuned: &Tuned| (value(tuned, "start.t_align"), value(tuned, "start.settle"));
    assert!(time(&light).0 < 0.3 && time(&heavy).0 > 0.45, "{:?} {:?}", time(&light), time(&heavy));
    let heaviest = rules::fixed(&changed("traction-60kw", 1000.0, "")).unwrap();
    assert!(time(&light).1 < 0.25 && time(&heaviest).1 > 0.5, "{:?} {:?}", time(&light), time(&heaviest));
    assert_eq!(tried(&heavy, 0.5, 4).held, 4);
    let short = |tuned: &Tuned| value(tuned, "motor.R_s") / 0.05;
    let fixed = |motor: &MotorFile| rules::fixed(motor).unwrap();
    let (light, heavy) = (fixed(&MotorFile::read(&file("drone-22v")).unwrap()), fixed(&changed("drone-22v", 30.0, "")));
    assert!((short(&light) - 0.9).abs() < 1e-9 && short(&heavy) > 0.95, "{} {}", short(&light), short(&heavy));
    assert_eq!(tried(&heavy, 0.1, 4).held, 4);
    // With 10 % below R, it does not start.
    assert!(tried(&heavy.with("motor.R_s", Value::Real(0.9 * 0.05)), 0.1, 4).started < 4);
}

/// A fixed R^ is closer to R if (R - R^) i is a large share of the EMF at 0.1 pu, and farther from R if the estimate would hardly
/// drift.
#[test]
fn the_resistance_fits_the_machine() {
    let machine = |R_s: f64| {
        let text = std::fs::read_to_string(file("servo-6.6kw")).unwrap();
        let text = text.replacen("R_s = 0.268", &format!("R_s = {R_s}"), 1).replacen("J = 0.0146", "J = 0.002", 1);
        let text = text.split_once("[bandwidth]").unwrap().0.to_owned();
        rules::fixed(&MotorFile::parse(&text, Path::new("m.toml")).unwrap()).unwrap()
    };
    // i_0 = 25.7 A, w_0 = 194 rad/s: 0.025 w_0 psi_M / i_0 is missing. 0.15 of 0.1 times 231 V at 19.03 A.
    for (R_s, missing) in [(0.03_f64, 0.025 * 194.4 * 0.12258 / 25.696), (0.5, 0.05), (3.0, 0.015 * 231.06 / 19.035)] {
        let found = R_s - value(&machine(R_s), "motor.R_s");
        let expected = f64::min(missing, 0.5 * R_s);
        assert!((found / expected - 1.0).abs() < 5e-3, "{R_s}: {found}, not {expected}");
    }
}

/// The adaptation measures the resistance of a cold and of a hot winding, where the drive with a fixed one loses starts and loads; the
/// bandwidth follows the swing of the rotor on i_0. It is left off, with a note, if it does harm: here the rotor keeps swinging.
#[test]
fn the_adaptation_is_on_where_it_does_no_harm() {
    let both = |motor: &MotorFile| (rules::fixed(motor).unwrap(), rules::tune(motor).unwrap());
    let (fixed, adapting) = both(&MotorFile::read(&file("hub-36v")).unwrap());
    let lost = |tuned: &Tuned, celsius| {
        let trials = trial::all(&trial::at_temperature(tuned, celsius), 4);
        trials.iter().filter(|trial| !(trial.starts() && trial.holds())).count()
    };
    for celsius in trial::TEMPERATURES {
        assert!(lost(&fixed, celsius) > 0 && lost(&adapting, celsius) == 0, "{celsius} degC");
    }
    assert!((value(&adapting, "adaptation.start") - 0.75).abs() < 1e-12);
    // w_0 = sqrt(n_p 1.35 T / J), at most 20 1/s.
    assert!((value(&adapting, "adaptation.bandwidth") - 0.25 * 35.59).abs() < 0.01, "{adapting:?}");
    assert!(adapting.notes.iter().any(|note| note.contains("measures R^")), "{:?}", adapting.notes);
    let (fixed, tuned) = both(&MotorFile::read(&file("elevator-5kw")).unwrap());
    let why = |note: &String| note.contains("starts and loads held");
    assert!(tuned.notes.iter().any(why), "{:?}", tuned.notes);
    let off = fixed.with("adaptation.resistance", Value::Boolean(false));
    let values = |tuned: &Tuned| tuned.controller.iter().map(|s| (s.name, s.value.clone())).collect::<Vec<_>>();
    assert_eq!(values(&tuned), values(&off));
}

#[test]
fn the_sample_period_follows_the_speed() {
    for (name, T_s) in [("drone-22v", 5e-5), ("spindle-40krpm", 5e-5), ("reference", 1e-4)] {
        assert!((value(&tuned(name), "T_s") / T_s - 1.0).abs() < 1e-12, "{name}");
    }
    let slow = rules::tune(&changed("drone-22v", 1.0, "[control]\nT_s = 1e-4\n")).unwrap();
    assert!(slow.notes.iter().any(|note| note.contains("2 pi / (w T_s) = 6.1 samples")), "{:?}", slow.notes);
}

/// The ripple under switched voltages is noted where it is a large part of the maximum current; a higher switching frequency lowers it.
#[test]
fn a_ripple_that_the_average_inverter_hides_is_noted() {
    let ripples = |name: &str, more: &str| {
        let tuned = rules::fixed(&changed(name, 1.0, more)).unwrap();
        tuned.notes.into_iter().find(|note| note.contains("currents ripple by up to"))
    };
    let noted: Vec<_> = CLASSES.into_iter().filter(|name| ripples(name, "").is_some()).collect();
    assert!(noted.is_empty(), "{noted:?}");
    // 24 V / (6 x 0.1815 mH x 4 kHz).
    let note = ripples("flat-24v", "[inverter]\nf_sw = 4000.0\n").expect("a note");
    assert!(
        note.contains("a switching period of 2.5e-4 s") && note.contains("= 5.510 A peak to peak, 0.8 times"),
        "{note}"
    );
    assert_eq!(ripples("flat-24v", "[inverter]\nf_sw = 40000.0\n"), None);
}

/// With active resistance, the current loop subtracts R^: where w_c L is small, a cold winding would make it oscillate.
#[test]
fn the_active_resistance_is_left_out_where_a_cold_winding_would_not_allow_it() {
    let sensored = |L: &str| {
        let text = std::fs::read_to_string(file("flat-24v")).unwrap().replace("= 0.1815e-3", &format!("= {L}"));
        let mut motor = MotorFile::parse(&text, Path::new("flat.toml")).unwrap();
        motor.choose("Sensored").unwrap();
        rules::fixed(&motor).unwrap()
    };
    let active =
        |tuned: &Tuned| tuned.controller.iter().find(|s| s.name == "current.active_resistance").unwrap().value.clone();
    assert_eq!(active(&sensored("0.1815e-3")), Value::Boolean(true));
    assert_eq!(active(&sensored("0.02e-3")), Value::Boolean(false));
}

/// The highest speed sets the sample period and field weakening, and is tried.
#[test]
fn the_highest_speed_sets_the_sample_period() {
    let fast = |name: &str, top: &str, more: &str| {
        let path = file(name);
        let text = std::fs::read_to_string(&path).unwrap();
        let text = text.replacen("[rating]\n", &format!("[rating]\nspeed_max = {top}\n"), 1) + more;
        rules::tune(&MotorFile::parse(&text, &path).unwrap())
    };
    // Four pole pairs at 2000 rad/s: 7.9 samples of 100 us in a period, 15.7 of 50 us.
    let tuned = fast("traction-60kw", "2000.0", "").unwrap();
    assert!((value(&tuned, "T_s") / 5e-5 - 1.0).abs() < 1e-12);
    assert!(tuned.controller.iter().any(|s| s.name == "weakening.use") && tuned.top > 1999.0);
    let last = trial::all(&tuned, 4).pop().unwrap();
    assert!(last.task.level > 6.9 && last.started == 4 && last.held == 4, "{last:?}");
    let refused = |name: &str, top: &str, more: &str, parts: &[&str]| {
        let error = fast(name, top, more).unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)) && error.lines().count() == 1, "{error}");
    };
    refused("traction-60kw", "200.0", "", &["rating.speed_max = 200 rad/s", "0.692", "expected 1 to 10"]);
    refused("traction-60kw", "9500.0", "", &["9500 rpm would fit: write 994.8 rad/s"]);
    refused("traction-60kw", "2000.0", "[control]\nT_s = 1e-4\n", &["7.9 samples", "rating.speed_max", "1571 rad/s"]);
    refused("spindle-40krpm", "30000.0", "", &["8.4 samples per electrical period at rating.speed_max"]);
    refused("reference", "700.0", "", &["rating.speed_max = 700 rad/s", "even field weakening gives at most 0.00 N.m"]);
}

#[test]
fn a_start_that_fails_is_told() {
    let limits = announced(&changed("pmsyrm-5.5kw", 10.0, ""), 4);
    assert_eq!(limits.len(), 1, "{limits:?}");
    assert!(limits[0].what == What::Start && limits[0].level < 0.2 && !limits[0].cures.is_empty(), "{limits:?}");
    let text = limits[0].to_string();
    assert!(text.starts_with("will not hold START at 0.1 pu: from 4 of 4 angles, the speed loop acts"), "{text}");
}

/// The rated torque acts from the first sample on: a drive with a sensor carries it; an I-f start whose current holds less than the load
/// does not, and the note has the count and the time.
#[test]
fn a_load_from_rest_is_carried_or_announced() {
    let sensored = rules::tune(&changed("reference", 1.0, "[control]\nestimator = \"Sensored\"\n")).unwrap();
    let (level, started) = trial::loaded(&sensored, 4);
    assert_eq!((level, started, limits::under_load(&sensored, level, (started, 4))), (0.5, 4, None));
    let lost = tuned("traction-60kw");
    let (level, started) = trial::loaded(&lost, 4);
    let note = limits::under_load(&lost, level, (started, 4)).unwrap();
    let head = format!(
        "under the rated torque from rest, the drive gets to 0.5 pu from {started} of 4 angles: the growth of the"
    );
    assert!(started < 4 && note.starts_with(&head) && note.contains("takes 0.083 s"), "{note}");
}

#[test]
fn lock_and_emf_are_scaled_to_the_machine() {
    for (name, u) in [("reference", 5.0), ("drone-22v", 0.45), ("flat-24v", 0.688)] {
        let found = value(&tuned(name), "lock.u");
        assert!((found / u - 1.0).abs() < 1e-3, "{name}: {found} V");
    }
    // The estimate half a turn beside the rotor at 0.1 pu leaves twice the EMF: lock_lost shows it.
    for name in CLASSES {
        let tuned = tuned(name);
        let par = &tuned.pair().controller.model.parameters;
        let emf = 0.1 * f64::from(par.motor.n_p) * tuned.speed * par.motor.psi_M;
        let lost = 2.0 * emf / (par.lock.u + 2.0 * (0.5 * par.lock.angle).sin() * emf);
        assert!(lost > 1.3, "{name}: {lost}");
    }
    let w_sign = value(&tuned("traction-63kw"), "emf.w_sign");
    assert!((w_sign - 18.85).abs() < 0.01, "{w_sign} rad/s");
}

/// The plant alone has the values of the plant beside its tuned controller.
#[test]
fn the_plant_alone_is_that_of_the_tuned_drive() {
    let mut files = 0;
    for entry in std::fs::read_dir(file("reference").parent().unwrap()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let motor = MotorFile::read(&path).unwrap();
            let (mut plant, pair) = (rules::plant_of(&motor).unwrap(), rules::fixed(&motor).unwrap().pair());
            plant.initialize();
            let mut tuned = pair.plant;
            tuned.initialize();
            assert!(plant.model == tuned.model, "{}", path.display());
            files += 1;
        }
    }
    assert!(files > 10);
    // A machine that suits no controller is still a machine.
    let text = std::fs::read_to_string(file("reference")).unwrap() + "\n[control]\nT_s = 5e-3\n";
    let slow = MotorFile::parse(&text, &file("reference")).unwrap();
    assert!(rules::fixed(&slow).is_err() && rules::plant_of(&slow).is_ok());
}
