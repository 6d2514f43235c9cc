//! Robertson's stiff reaction, for Model Exchange only.

use super::*;
use model_description::{Causality, Initial};

/// Derivatives as in the original.
fn f([y1, y2]: [f64; 2]) -> [f64; 2] {
    let y3 = 1.0 - y1 - y2;
    [-0.04 * y1 + 1e4 * y2 * y3, 0.04 * y1 - 1e4 * y2 * y3 - 3e7 * y2 * y2]
}

#[test]
fn its_equations_are_those_of_the_original() {
    for version in BOTH {
        let fmu = Fmu::open(archive("roberts", version)).unwrap();
        assert!(fmu.instantiate("it", false).is_err(), "no Co-Simulation");
        let description = fmu.description();
        assert_eq!(description.default_experiment.tolerance, Some(1e-4));
        let y1 = description.variable("y1").unwrap();
        assert_eq!((y1.causality, y1.initial_or_default()), (Causality::Output, Some(Initial::Exact)));
        let mut it = fmu.instantiate_as(Kind::ModelExchange, "it", false).unwrap();
        it.set_text("y1", "0.9").unwrap();
        it.set_text("y2", "3e-5").unwrap();
        it.setup(1e-5, None).unwrap();
        it.enter_initialization().unwrap();
        let (mut dx, mut z, wanted) = ([f64::NAN; 2], [f64::NAN; 2], f([0.9, 3e-5]));
        it.get_derivatives(&mut dx).unwrap();
        it.get_event_indicators(&mut z).unwrap();
        for (dx, wanted) in dx.iter().zip(wanted) {
            assert!((dx - wanted).abs() < 1e-13, "{dx} {wanted}");
        }
        let y3 = 1.0 - 0.9 - 3e-5;
        assert_eq!(z, [0.9 - 1e-4, y3 - 0.01]);
        assert_eq!(it.get("y3").unwrap(), fmu_import::Values::Reals(vec![y3]));
    }
}

/// FMPy integrates with CVode; the values at 40 s agree with the literature.
#[test]
fn a_stiff_solver_of_fmpy_runs_it() {
    for version in BOTH {
        let columns = fmpy(
            &archive("roberts", version),
            "fmi_type='ModelExchange', start_time=1e-5, stop_time=40, output_interval=0.4, relative_tolerance=1e-8",
        );
        let last: Vec<f64> = columns.iter().map(|column| *column.last().unwrap()).collect();
        // Hindmarsh's table of this problem, at t = 40: 0.7158, 9.185e-6, 0.2842.
        for (found, wanted, width) in [(last[1], 0.7158, 1e-4), (last[2], 9.185e-6, 1e-8), (last[3], 0.2842, 1e-4)] {
            assert!((found - wanted).abs() < width, "{version:?}: {last:?}");
        }
    }
}

/// Our solvers are explicit: of a long run, they say so while it lasts.
#[test]
fn a_long_run_says_that_the_equations_are_stiff() {
    static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());
    let notes = |stop: f64, listens: bool| {
        let mut system = System::new(Method::ModelExchange(Integration::default()));
        if listens {
            system = system.with_listener(|note| HEARD.lock().unwrap().push(note.into()));
        }
        system.add("it", &Fmu::open(archive("roberts", V3)).unwrap(), false).unwrap();
        let settings = Settings { start: 0.0, stop, step: stop, sequential: false };
        system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
        system.take_notes()
    };
    assert_eq!(notes(40.0, false), [""; 0], "some seconds at most");
    let after = notes(400.0, false);
    assert!(after.len() == 1 && after[0].starts_with("the equations are stiff: stability limits "), "{after:?}");
    assert_eq!(notes(400.0, true), [""; 0]);
    assert_eq!(*HEARD.lock().unwrap(), after);
}
