//! Every option of the controller with every estimator has the described effect, or is refused by name.

mod cases;

use crate::tuned::{RATED, T_S, drive, turning};
use cases::CASES;
use drive::Pair;
use drive::control::tables::PARAMETERS;
use drive::estimator::{Class, Kind};
use drive::frame::AlphaBeta;
use drive::math::wrap;
use fmu_core::Kind as Type;

/// Speed in rad/s at which every method works.
const SLOW: f64 = 0.1 * RATED;
/// Voltage in V lost per leg by a dead time of 2 us.
const U_DEAD: f64 = 10.8;

/// Turning at an imposed `speed` (rad/s), in torque mode.
fn imposed(pair: Pair, speed: f64) -> Pair {
    let mut pair = turning(pair, speed);
    pair.plant.model.parameters.mechanics.imposed = true;
    pair.controller.model.parameters.speed_loop.torque_mode = true;
    // Above that speed, the low-speed law is inactive.
    pair.controller.model.parameters.zero_speed.w_0 = 1.0;
    pair
}

/// Runs for `seconds` and calls `each` after every sample.
fn run(pair: &mut Pair, seconds: f64, mut each: impl FnMut(f64, &mut Pair)) {
    pair.start().unwrap();
    let speed = pair.plant.model.parameters.initial.speed;
    let mut k = 0_u32;
    while f64::from(k) * T_S < seconds {
        let inputs = &mut pair.plant.model.inputs;
        (inputs.speed_shaft, inputs.angle_shaft) = (speed, speed * f64::from(k) * T_S);
        pair.step(T_S).unwrap();
        k += 1;
        each(f64::from(k) * T_S, pair);
    }
}

/// Magnitude of the angle error in degrees.
fn off(pair: &Pair) -> f64 {
    wrap(pair.plant.out.theta_e - pair.controller.out.theta_est).to_degrees().abs()
}

fn command(pair: &Pair) -> AlphaBeta {
    pair.controller.out.u.to_stator()
}

#[test]
fn every_option_acts_or_is_refused() {
    let mut wrong = Vec::new();
    for case in CASES {
        let mut honored = 0;
        for &kind in Kind::ALL {
            let name = format!("{} with {}", case.option, kind.name());
            let without = (case.on)(kind);
            if let Err(fault) = without.clone().start() {
                wrong.push(format!("{name}: the start value is refused: {}", fault.message()));
                continue;
            }
            let mut with = without.clone();
            (case.ask)(&mut with.controller.model.parameters);
            if let Err(fault) = with.clone().start() {
                let message = fault.message();
                let estimator = format!("estimator = {} ({})", kind as i32, kind.name());
                let parts = [format!("{} = ", case.option), estimator, "set ".into()];
                if !parts.iter().all(|part| message.contains(part.as_str())) {
                    wrong.push(format!("{name}: {message}"));
                }
                continue;
            }
            let (without, with) = ((case.figures)(without), (case.figures)(with));
            println!("{name}: {without:.4?} {with:.4?}");
            honored += 1;
            if !(case.acts)(kind, without, with) {
                wrong.push(format!("{name} does not act: {without:?} without, {with:?} with it"));
            }
        }
        assert!(honored > 0, "{} acts nowhere", case.option);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A new switch or choice needs a case above.
#[test]
fn no_option_is_forgotten() {
    for (name, meta, _) in (0..PARAMETERS.len()).filter_map(|i| PARAMETERS.locate(i)) {
        if matches!(meta.kind, Type::Boolean | Type::Enumeration(_)) && name != "estimator" {
            assert!(CASES.iter().any(|case| case.option == name), "{name}");
        }
    }
    for case in CASES {
        assert!((0..PARAMETERS.len()).any(|i| PARAMETERS.locate(i).is_some_and(|found| found.0 == case.option)));
    }
}

/// The d-axis current at standstill comes from `zero_speed` with the two estimators named in its description, and is zero with
/// the others.
#[test]
fn the_low_speed_law_is_that_of_the_flux_observers() {
    for &kind in Kind::ALL {
        let mut pair = drive(kind);
        pair.controller.model.parameters.zero_speed.i_0 = 3.0;
        run(&mut pair, 0.05, |_, _| ());
        let i_d = if kind.class() == Class::FluxObserver { 3.0 } else { 0.0 };
        assert!((pair.controller.out.i_ref.d - i_d).abs() < 0.1, "{kind:?}: {:?}", pair.controller.out.i_ref);
    }
}
