//! Call orders of importers that the standards forbid: the results of the packed FMUs, against the order of the standards in
//! our importer, whose results FMPy confirms. No other importer runs here: the orders are replayed from `order.rs`.
//!
//! `cargo test --release --test orders random -- --ignored --nocapture` makes a million calls in random orders; `FMU_CALLS` and
//! `FMU_SEED` select others.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]
#![allow(missing_docs, unreachable_pub)]

mod case;
#[path = "../common/mod.rs"]
mod common;
mod importer;
mod instance;
mod order;
mod packed;

use case::{Case, OURS, REFERENCE};
use fmu_core::draw::Draw;
use fmu_system::cosimulation::Method;
use importer::{run, stepped, strict};
use instance::Loaded;
use order::{Completes, ORDERS, Order, STRICT, Starts};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Mutex;

/// The FMUs share the log of the process.
static ONE: Mutex<()> = Mutex::new(());

fn ours(case: &Case, standard: usize) -> PathBuf {
    common::archives().join(["fmi2", "fmi3"][standard]).join(format!("{}.fmu", case.fmu))
}

/// Every order on a case in FMI 2.0 (0) and 3.0 (1): prints the largest deviation from our importer.
fn replay(case: &Case, standards: Range<usize>, file: impl Fn(usize) -> PathBuf) {
    for standard in standards {
        let (file, name) = (file(standard), ["FMI 2.0", "FMI 3.0"][standard]);
        let (fmu, reference) = (Loaded::new(&file), case.reference(&file));
        for order in ORDERS.iter().filter(|order| order.standards[standard]) {
            let made = run(&fmu, case, *order, &mut || true);
            let (deviation, output) = case.deviation(&made.rows, &reference);
            let line = format!("{:52} {:20} {name} {deviation:9.1e} {output}\n", order.name, case.fmu);
            print!("{line}");
            assert!(deviation <= case.tolerance, "{line}");
            let warned: Vec<_> = made.warnings.iter().filter(|text| text.contains("the importer")).collect();
            let lawful =
                order.completes != Completes::Evaluations && order.starts != Starts::After && !order.states_in_event;
            assert!(!lawful || warned.is_empty(), "{line}{warned:?}");
            let states = fmu.description.variables.iter().any(|v| v.derivative.is_some());
            assert!(order.late == 0.0 || !states || !warned.is_empty(), "{line}");
            assert!(
                (1..warned.len()).all(|i| !warned[..i].iter().any(|one| habit(one) == habit(warned[i]))),
                "{warned:?}"
            );
        }
    }
}

/// The subject of a warning, without the time.
fn habit(text: &str) -> &str {
    text.split_once("the importer").map_or(text, |(_, habit)| habit)
}

#[test]
fn the_drive_in_every_order() {
    let _one = ONE.lock();
    for case in OURS {
        replay(case, 0..2, |standard| ours(case, standard));
    }
}

#[test]
fn the_reference_fmus_in_every_order() {
    let _one = ONE.lock();
    for case in REFERENCE {
        // FMI 2.0 has no bytes, which Feedthrough has.
        let standards = if case.fmu == "Feedthrough" { 1..2 } else { 0..2 };
        replay(case, standards, |standard| packed::archive(case.fmu, standard));
    }
}

/// FMPy with CVode gives the reference of the orders. Straight lines are steps here: FMPy 0.3.32 sets inputs where it looks for
/// events and not where it reads derivatives.
#[test]
fn fmpy_gives_the_reference() {
    let _one = ONE.lock();
    let ours = OURS.iter().flat_map(|case| [0, 1].map(|standard| (case, standard, ours(case, standard))));
    let packed = REFERENCE.iter().flat_map(|case| {
        let standards = if case.fmu == "Feedthrough" { 1..2 } else { 0..2 };
        standards.map(move |standard| (case, standard, packed::archive(case.fmu, standard)))
    });
    let runs: Vec<_> = ours
        .chain(packed)
        .map(|(case, standard, file)| {
            let steps: Vec<_> = case.inputs.iter().map(|input| case::Input { linear: false, ..*input }).collect();
            let case = Case { inputs: steps.leak(), ..*case };
            let inputs = case.inputs.iter().map(
                |input| serde_json::json!({ "name": input.name, "points": input.points, "boolean": input.boolean }),
            );
            serde_json::json!({ "name": format!("{}, FMI {}.0", case.fmu, standard + 2), "file": file,
                "inputs": inputs.collect::<Vec<_>>(), "outputs": case.outputs,
                "times": (1..=case.points).map(|k| case.point(k)).collect::<Vec<_>>(), "rows": case.reference(&file),
                "tolerance": case.tolerance })
        })
        .collect();
    let path = common::python::scratch().join("orders.json");
    std::fs::write(&path, serde_json::to_vec(&runs).unwrap()).unwrap();
    common::python::pytest("fmpy", "orders", &["test_orders.py"], &[("FMU_ORDERS", &path)]);
}

/// With calls in the order of the standards there is no warning, and inputs fed with 0 by a tool are reported.
#[test]
fn inputs_at_zero_are_named_once() {
    const ZERO: &[(f64, f64)] = &[(0.0, 0.0)];
    let _one = ONE.lock();
    for (fmu, expected) in [
        ("PmsmPlant", "u_dc = 0 (start value 325), enable = false (start value true)"),
        (
            "PmsmDrive",
            "enable = false (start value true), sensor_valid = false (start value true), u_dc = 0 (start value 325)",
        ),
        (
            "PmsmDriveMean",
            "enable = false (start value true), sensor_valid = false (start value true), u_dc = 0 (start value 325)",
        ),
        (
            "SensorlessController",
            "enable = false (start value true), u_dc = 0 (start value 325), sensor_valid = false (start value true)",
        ),
    ] {
        let mut inputs = vec![case::steps("u_dc", ZERO), case::boolean("enable", ZERO)];
        if fmu != "PmsmPlant" {
            inputs.push(case::boolean("sensor_valid", ZERO));
        }
        let case = Case { fmu, inputs: inputs.leak(), outputs: &[], apart: 1e-4, points: 2, tolerance: 0.0 };
        for standard in 0..2 {
            let fmu = Loaded::new(&ours(&case, standard));
            for made in [strict(&fmu, &case), stepped(&fmu, &case, (false, false))] {
                let warned: Vec<_> = made.warnings.iter().filter(|text| text.contains("the run begins with")).collect();
                assert!(warned.len() == 1 && warned[0].contains(expected), "{:?}", made.warnings);
            }
            let fed = Case { inputs: &[], ..case };
            assert!(strict(&fmu, &fed).warnings.iter().all(|text| !text.contains("the run begins with")));
        }
    }
}

/// In Co-Simulation, inputs are constant over a step, and Modelica-FMI passes them on a step later; parameters are set before
/// the initialization and, by some tools, after it. The bits equal our importer's.
#[test]
fn the_orders_of_co_simulation() {
    let _one = ONE.lock();
    for case in OURS {
        let case = Case { apart: 1e-4, points: 300, ..*case }.jumping_at_points();
        for standard in 0..2 {
            let file = ours(&case, standard);
            let fmu = Loaded::new(&file);
            let reference = case.recorded(&file, Method::default());
            let plain = stepped(&fmu, &case, (false, false));
            assert_eq!(plain.rows, reference, "{}", case.fmu);
            assert!(plain.warnings.iter().all(|text| !text.contains("the importer")), "{:?}", plain.warnings);
            let set = stepped(&fmu, &case, (false, true));
            assert_eq!(set.rows, reference, "{}: parameters set to their present values", case.fmu);
            let warned = set.warnings.iter().filter(|text| text.contains("their values are unchanged")).count();
            assert_eq!(warned, 1, "{:?}", set.warnings);
            let later = stepped(&fmu, &case, (true, false)).rows;
            let apart = case.deviation(&later, &reference);
            println!("Modelica-FMI, inputs a step later: {:20} {:9.1e} {}", case.fmu, apart.0, apart.1);
        }
    }
}

/// Modelica-FMI passes enumerations of FMI 2.0 unconverted if they are tunable, and its code then does not compile.
#[test]
fn no_enumeration_is_tunable() {
    for case in OURS {
        for standard in 0..2 {
            let fmu = Loaded::new(&ours(case, standard));
            assert_eq!(importer::tunable_enumerations(&fmu.description), [""; 0], "{}", case.fmu);
        }
    }
}

/// Random orders: each habit and each of its calls occurs at random.
fn random(calls: u64) {
    let mut draw = Draw(std::env::var("FMU_SEED").map_or(1, |text| text.parse().expect("a whole number")));
    let short: Vec<Case> = OURS.iter().map(|case| Case { points: case.points / 4, ..*case }).collect();
    let all: Vec<_> = (0..short.len()).flat_map(|i| [(i, 0), (i, 1)]).collect();
    let loaded: Vec<_> = all
        .iter()
        .map(|&(i, standard)| {
            let file = ours(&short[i], standard);
            (Loaded::new(&file), short[i].reference(&file))
        })
        .collect();
    let (mut made, mut runs, mut worst) = (0, 0, vec![0.0_f64; all.len()]);
    while made < calls {
        let which = runs % all.len();
        let ((i, standard), (fmu, reference)) = (all[which], &loaded[which]);
        let mut flip = |n| draw.below(n) == 0;
        let order = Order {
            name: "random",
            standards: [standard == 0, standard == 1],
            starts: [Starts::Never, Starts::Before, Starts::After][usize::from(flip(2)) + usize::from(flip(2))],
            settles: flip(2),
            iterates: flip(2),
            completes: if flip(3) { Completes::Steps } else { Completes::Evaluations },
            states_in_event: flip(2),
            derivatives_in_event: flip(2),
            discrete_inputs: flip(2),
            late: [0.0, 1e-10, 1e-9][usize::from(flip(2)) + usize::from(flip(2))],
            blind: flip(2),
            repeats: 1 + u8::from(flip(2)),
            returns: flip(2),
            ..STRICT
        };
        let (case, rarity) = (&short[i], 1 + draw.below(4));
        let outcome = run(fmu, case, order, &mut || {
            made += 1;
            draw.below(rarity) == 0
        });
        let (deviation, output) = case.deviation(&outcome.rows, reference);
        assert!(
            deviation <= case.allowed(order.late),
            "{deviation} of {output} in {}: {order:?}, one in {rarity}",
            case.fmu
        );
        (runs, worst[which]) = (runs + 1, worst[which].max(deviation));
    }
    for (&(i, standard), worst) in all.iter().zip(worst) {
        println!("{:22} {} {worst:9.1e}", short[i].fmu, ["FMI 2.0", "FMI 3.0"][standard]);
    }
    println!("{made} calls that the standards forbid, or not made, in {runs} runs");
}

#[test]
fn some_random_orders() {
    let _one = ONE.lock();
    random(100_000);
}

#[test]
#[ignore = "minutes: see docs/testing.md"]
fn random_orders() {
    let _one = ONE.lock();
    random(std::env::var("FMU_CALLS").map_or(1_000_000, |text| text.parse().expect("a whole number")));
}
