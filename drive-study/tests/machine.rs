//! `fmu compare MOTOR.toml`: methods tuned for a machine, compared on it.
#![allow(missing_docs)]

use drive::estimator::Kind;
use drive_study::compare::scenario::Effort;
use drive_study::compare::trials::TRIALS;
use drive_study::compare::{self, OnMachine, Outcome};
use drive_tools::tune::motor::MotorFile;
use std::path::Path;

fn compared(motor: &str, kinds: &[Kind]) -> OnMachine {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors").join(motor);
    let scenarios: Vec<_> = TRIALS.iter().collect();
    compare::on_machine(&MotorFile::read(&path).unwrap(), kinds, &scenarios, Effort::Reduced, || ()).unwrap()
}

/// The values of a method in a scenario.
fn values(compared: &OnMachine, kind: Kind, id: &str) -> Vec<f64> {
    let run = compared.runs.iter().find(|run| run.entry.kind == kind && run.scenario.id == id).unwrap();
    assert!(!matches!(run.outcome, Outcome::Refused(_)), "{id}: {:?}", run.outcome);
    run.measures().iter().map(|m| m.value).collect()
}

#[test]
fn methods_are_compared_on_a_machine() {
    let methods = [Kind::ExtendedEmf, Kind::PulsatingInjection, Kind::Sensored];
    let on = compared("ipmsm-2.2kw.toml", &methods);
    assert!(on.refused.is_empty() && on.runs.len() == methods.len() * TRIALS.len());
    for kind in methods {
        assert!(values(&on, kind, "start")[1] < 0.5, "{} starts", kind.name());
        let load = values(&on, kind, "load");
        assert!(load[0] < 30.0 && load[2] > 0.01 && load[2] < 0.5, "{}: {load:?}", kind.name());
    }
    // A sensor does not depend on parameters; the EMF vanishes at zero speed; injection works at standstill.
    for id in ["lowest", "r-high", "r-low", "l-q", "psi", "dead-time"] {
        assert_eq!(values(&on, Kind::Sensored, id), [0.0], "{id}");
    }
    assert_eq!(values(&on, Kind::PulsatingInjection, "lowest"), [0.0]);
    let emf = values(&on, Kind::ExtendedEmf, "lowest")[0];
    assert!(emf > 0.0 && emf <= 0.2, "{emf}");
    assert!(values(&on, Kind::ExtendedEmf, "dead-time")[0] >= emf, "a wrong voltage does not help");
    // Only the injection costs.
    let cost = values(&on, Kind::PulsatingInjection, "signal");
    assert!(cost[0] > 0.01 && cost[1] > 0.0 && cost[2] > 1.0, "{cost:?}");
    assert_eq!(values(&on, Kind::ExtendedEmf, "signal")[..3], [0.0, 0.0, 0.0]);
    assert!(on.nanoseconds.len() == methods.len() && on.nanoseconds.iter().all(|(_, ns)| *ns > 1.0));
}

#[test]
fn a_method_that_the_machine_does_not_suit_is_listed_with_the_reason() {
    let on = compared("reference.toml", &[Kind::PulsatingInjection]);
    assert!(on.runs.is_empty());
    let folder = std::env::temp_dir().join(format!("compare-{}", std::process::id()));
    compare::write_machine(&on, &folder).unwrap();
    for file in ["compare.csv", "compare.txt", "compare.md", "compare.html"] {
        let text = std::fs::read_to_string(folder.join(file)).unwrap();
        assert!(text.contains("PulsatingInjection") && text.contains("(L_q + L_d) = 0.000"), "{file}: {text}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}
