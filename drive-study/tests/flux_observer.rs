//! The flux observer on the 2.2 kW machine: the cells of wrong resistance and magnet flux, load and low speed that it holds, and
//! the reversal under load.
#![allow(missing_docs, non_snake_case)]

use drive::Pair;
use drive::estimator::Kind;
use drive::math::tanh;
use drive_study::runner::{self, RATED_SPEED, RATED_TORQUE, line};
use drive_tools::queue;

/// Resistance estimate as a share of the true value, load in pu, speed in pu.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cell(f64, f64, f64);

/// Which estimates adapt.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Adapts {
    Nothing,
    Resistance,
    Both,
}

/// The drive with shares `R_hat` and `psi_hat` of resistance and magnet flux.
fn drive(R_hat: f64, psi_hat: f64, adapts: Adapts) -> Pair {
    let mut pair = runner::drive(Kind::FluxObserver);
    let par = &mut pair.controller.model.parameters;
    par.motor.R_s *= R_hat;
    par.motor.psi_M *= psi_hat;
    par.estimators.adaptation.resistance = adapts != Adapts::Nothing;
    par.estimators.flux_observer.magnet = if adapts == Adapts::Both { 5.0 } else { 0.0 };
    pair
}

/// Slows down from 0.2 pu between 0.2 and 1 s, then takes the load between 1.5 and 1.8 s. Lost: more than 0.02 pu or 30 deg
/// off at any time in the last of 5 s.
fn loses(pair: Pair, Cell(_, load, speed): Cell) -> bool {
    let mut pair = runner::turning(pair, 0.2);
    let mut lost = false;
    runner::run(&mut pair, 5.0, |t, p| {
        p.controller.model.inputs.speed_ref = RATED_SPEED * line(t, 0.2, 0.2, 1.0, speed);
        p.plant.model.inputs.tau_load = RATED_TORQUE * line(t, 1.5, 0.0, 1.8, load);
        lost |= t >= 4.0 && ((runner::speed(p) - speed).abs() > 0.02 || runner::rotor_ahead(p).abs() > 30.0);
    });
    lost
}

/// The cells that are lost.
fn lost(cells: &[Cell], psi_hat: f64, adapts: Adapts) -> Vec<Cell> {
    let lost = queue::map(cells, |&cell| loses(drive(cell.0, psi_hat, adapts), cell));
    cells.iter().zip(lost).filter_map(|(cell, lost)| lost.then_some(*cell)).collect()
}

/// A few cells: lost with the constant resistance, all held with the adapted one.
#[test]
fn adaptation_holds_what_the_wrong_resistance_loses() {
    let without = [Cell(0.5, 1.0, 0.0), Cell(1.2, -1.0, 0.01), Cell(0.8, -0.5, 0.02), Cell(1.5, 1.0, 0.05)];
    let always = [Cell(1.0, 1.0, 0.05)];
    let cells: Vec<Cell> = without.into_iter().chain(always).collect();
    assert_eq!(lost(&cells, 1.0, Adapts::Nothing), without);
    assert_eq!(lost(&cells, 1.0, Adapts::Resistance), []);
    assert_eq!(lost(&cells, 1.05, Adapts::Both), []);
}

/// The whole map, with exact and wrong magnet flux:
/// `cargo test --release -p drive-study --test flux_observer -- --ignored --nocapture`.
#[test]
#[ignore = "1540 runs of 5 s"]
fn map_of_lost_cells() {
    let mut cells = vec![];
    for R_hat in [0.5, 0.8, 0.9, 1.0, 1.1, 1.2, 1.5] {
        for load in [0.0, 0.5, -0.5, 1.0, -1.0] {
            cells.extend([0.0, 0.01, 0.02, 0.05].map(|n| Cell(R_hat, load, n)));
        }
    }
    for (psi_hat, adapts, most) in [
        (1.0, Adapts::Nothing, 95),
        (1.0, Adapts::Resistance, 0),
        (0.95, Adapts::Resistance, 13),
        (1.05, Adapts::Resistance, 21),
        (0.8, Adapts::Both, 1),
        (0.9, Adapts::Both, 1),
        (0.95, Adapts::Both, 1),
        (1.0, Adapts::Both, 1),
        (1.05, Adapts::Both, 1),
        (1.1, Adapts::Both, 1),
        (1.2, Adapts::Both, 1),
    ] {
        let lost = lost(&cells, psi_hat, adapts);
        println!("psi^ = {psi_hat} psi, adapts {adapts:?}: {} of {} lost {lost:?}", lost.len(), cells.len());
        assert!(lost.len() <= most, "{lost:?}");
    }
}

/// The reversal from 0.5 to -0.5 pu in 0.5 s under a friction of `load` pu: peak error in deg, speed at the end in pu.
fn reversal(mut pair: Pair, load: f64) -> (f64, f64) {
    pair = runner::turning(pair, 0.5);
    let (mut peak, mut end) = (0.0_f64, 0.0);
    runner::run(&mut pair, 2.5, |t, p| {
        p.controller.model.inputs.speed_ref = RATED_SPEED * line(t, 0.7, 0.5, 1.2, -0.5);
        p.plant.model.inputs.tau_load = load * RATED_TORQUE * tanh(p.plant.out.speed / 2.0);
        if t > 0.5 {
            peak = peak.max(runner::rotor_ahead(p).abs());
        }
        end = runner::speed(p);
    });
    (peak, end)
}

/// Within 1 deg with the exact resistance; with a wrong one, the error at zero speed grows with the time spent there.
#[test]
fn a_reversal_is_held() {
    for (R_hat, adapts, most) in [
        (1.0, Adapts::Nothing, 1.0),
        (0.8, Adapts::Nothing, 10.0),
        (1.2, Adapts::Nothing, 30.0),
        (1.0, Adapts::Resistance, 4.0),
        (1.2, Adapts::Resistance, 4.0),
    ] {
        let (peak, end) = reversal(drive(R_hat, 1.0, adapts), 0.3);
        assert!(peak < most && (end + 0.5).abs() < 0.005, "R^ = {R_hat} R, adapts {adapts:?}: {peak} deg, {end} pu");
    }
}

/// Without `emf.hold_reversal`, the methods on the EMF lose the rotor by half a turn; with it, none does.
#[test]
fn no_emf_method_loses_a_reversal_that_it_holds() {
    use Kind::{DirectEmf, EmfObserver, ExtendedEmf, SlidingMode, VoltageFeedback};
    for kind in [DirectEmf, EmfObserver, ExtendedEmf, VoltageFeedback, SlidingMode] {
        for load in [0.0, 0.1, 0.3, 0.5] {
            let mut pair = runner::drive(kind);
            let (peak, end) = reversal(pair.clone(), load);
            // Some find it again, half a turn later.
            assert!(peak > 150.0, "{}, {load} pu: held, {peak} deg, {end} pu", kind.name());
            pair.controller.model.parameters.estimators.emf.hold_reversal = true;
            let (peak, end) = reversal(pair, load);
            assert!(peak < 20.0 && (end + 0.5).abs() < 0.005, "{}, {load} pu: {peak} deg, {end} pu", kind.name());
        }
    }
}
