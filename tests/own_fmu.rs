//! The example of a user's FMU: built with the commands of its first lines, run, and checked.
#![allow(missing_docs)]

use fmu::commands::build::{self, Models};
use fmu_check::Level;
use fmu_import::Fmu;
use fmu_system::cosimulation::{Recording, Schedule, Settings, System, Units};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::OnceLock;

/// RcCircuit.fmu of both standards.
fn archives() -> &'static [PathBuf] {
    static FILES: OnceLock<Vec<PathBuf>> = OnceLock::new();
    FILES.get_or_init(|| {
        let out = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("own-fmu");
        build::models(&Models { package: vec!["own-fmu".into()], out: Some(out), ..Models::default() }).unwrap()
    })
}

fn run(mut system: System, stop: f64) -> Recording {
    system.record_outputs().unwrap();
    let settings = Settings { start: 0.0, stop, step: 0.1, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

#[test]
fn it_charges_as_its_equation_says() {
    for file in archives() {
        let mut system = System::default();
        system.add("rc", &Fmu::open(file).unwrap(), false).unwrap();
        system.set("rc.R", "2000").unwrap();
        system.input("rc.u", Schedule::parse("5").unwrap()).unwrap();
        let recording = run(system, 5.0);
        assert_eq!(recording.time.len(), 51);
        for (t, u_c) in recording.time.iter().zip(&recording.column("rc.u_c").unwrap().values) {
            let expected = 5.0 * (1.0 - (-t / 2.0).exp());
            assert!((u_c - expected).abs() < 1e-12, "{t} s: {u_c} V, {expected} V");
        }
    }
}

/// Three lines of physics give both interfaces in both standards, with the state's derivative.
#[test]
fn it_has_model_exchange_besides() {
    for file in archives() {
        let fmu = Fmu::open(file).unwrap();
        let md = fmu.description();
        for interface in [&md.model_exchange, &md.co_simulation] {
            assert_eq!(interface.as_ref().unwrap().model_identifier, "RcCircuit");
        }
        let state = md.state_of(md.variable("der(u_c)").unwrap()).unwrap();
        assert!(md.derivatives.len() == 1 && state.name == "u_c");
    }
}

/// A value passes through a chain of FMUs within initialization, in any order.
#[test]
fn a_chain_is_consistent_at_the_start() {
    for file in archives() {
        let fmu = Fmu::open(file).unwrap();
        for order in [["a", "b", "c"], ["c", "b", "a"]] {
            // The current of one is the voltage of the next.
            let mut system = System::default().with_units(Units::PassOn);
            for name in order {
                system.add(name, &fmu, false).unwrap();
            }
            system.input("a.u", Schedule::parse("8").unwrap()).unwrap();
            system.set("a.R", "2").unwrap();
            for (from, to) in [("a", "b"), ("b", "c")] {
                system.connect(&format!("{from}.i"), &format!("{to}.u")).unwrap();
                system.set(&format!("{to}.R"), "2").unwrap();
            }
            let i = run(system, 0.1).column("c.i").unwrap().values[0];
            assert!((i - 1.0).abs() < 1e-15, "{order:?}: {i} A");
        }
    }
}

#[test]
fn it_violates_no_must() {
    let program = Some(PathBuf::from(env!("CARGO_BIN_EXE_fmu")));
    for file in archives() {
        let report =
            fmu_check::run(file, &fmu_check::Options { program: program.clone(), ..Default::default() }).unwrap();
        let must: Vec<_> = report.violated().filter(|f| f.level == Level::Must).collect();
        assert!(must.is_empty(), "{}", report.text(false));
        assert!(report.findings.len() > 100);
    }
}
