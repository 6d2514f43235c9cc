//! Parameters that do not fit together are refused before the start: with names from the table, values and the reason.
#![allow(missing_docs, non_snake_case)]

use drive_base::motor::Motor;
use drive_control::SensorlessController;
use drive_control::estimator::tracker::TrackerKind;
use drive_control::estimator::{Class, Kind};
use drive_control::start::StartMode;
use drive_control::tables::{ControllerParameters, PARAMETERS};
use drive_control::weakening::WeakeningParameters;
use fmu_core::Model;
use std::f64::consts::TAU;

/// A controller that starts with the 2.2 kW machine.
fn controller(kind: Kind) -> SensorlessController {
    let mut controller = SensorlessController::default();
    let par = &mut controller.parameters;
    (par.estimator, par.motor, par.s_2) = (kind, Motor::IPMSM_2_2_KW, 40.0);
    (par.limit.i, par.limit.i_q) = (15.0, 15.0);
    par.current.reference_feed_forward = kind == Kind::VoltageFeedback;
    controller.inputs.u_dc = 540.0;
    controller.validate().unwrap();
    controller
}

/// A working controller changed by `set` is refused; the message contains all `parts`, and names variables only by
/// their names in the table.
fn refused(kind: Kind, set: impl FnOnce(&mut ControllerParameters), parts: &[&str]) {
    let mut controller = controller(kind);
    set(&mut controller.parameters);
    let fault = controller.validate().expect_err("must be refused");
    let message = fault.message();
    for part in parts {
        assert!(message.contains(part), "{part}: {message}");
    }
    let words: Vec<&str> = message.split_whitespace().map(|word| word.trim_end_matches([':', ',', ';', '.'])).collect();
    let names: Vec<String> = (0..PARAMETERS.len()).filter_map(|i| PARAMETERS.locate(i)).map(|found| found.0).collect();
    for (word, next) in words.iter().zip(words.iter().skip(1).chain(&[""])) {
        let dotted = word.contains('.') && word.starts_with(|first: char| first.is_alphabetic()) && *word != "kg.m2";
        assert!(
            !(dotted || *next == "=") || names.iter().any(|name| name == word),
            "{word} is not a variable: {message}"
        );
    }
}

#[test]
fn injection_without_saliency() {
    for &kind in Kind::ALL.iter().filter(|kind| kind.class().injects()) {
        refused(kind, |p| p.motor.L_q = p.motor.L_d, &["motor.L_d = 0.036 H", "motor.L_q = 0.036 H", "differ"]);
    }
}

#[test]
fn a_carrier_off_the_sample_grid() {
    for kind in [Kind::RotatingInjection, Kind::PulsatingInjection] {
        for frequency in [1100.0, 2500.0, 200.0, 1e9, 1e-9] {
            let parts = ["carrier.frequency = ", "T_s = 0.0001 s", "whole number from 6 to 32"];
            refused(kind, |p| p.estimators.carrier.frequency = TAU * frequency, &parts);
        }
    }
    refused(
        Kind::SquareWaveInjection,
        |p| p.estimators.square_wave.samples = 3,
        &["square_wave.samples = 3", "2 or 4"],
    );
}

#[test]
fn bandwidths_and_speeds_in_the_wrong_order() {
    let same = |p: &mut ControllerParameters| p.estimators.hybrid.w_high = p.estimators.hybrid.w_low;
    refused(Kind::Hybrid, same, &["hybrid.w_high = ", "above hybrid.w_low = "]);
    let fast = |p: &mut ControllerParameters| p.estimators.tracker.bandwidth = 400.0;
    refused(Kind::ExtendedEmf, fast, &["tracker.bandwidth = 400 rad/s", "a third of emf.bandwidth = "]);
}

#[test]
fn a_load_observer_without_inertia() {
    for &kind in Kind::ALL {
        let weightless = |p: &mut ControllerParameters| {
            (p.estimators.tracker.kind, p.J) = (TrackerKind::MechanicalObserver, 0.0);
        };
        refused(kind, weightless, &["mechanics.J = 0 kg.m2", "tracker.kind = 2 (MechanicalObserver)"]);
    }
}

#[test]
fn voltage_feedback_in_another_current_loop() {
    let parts = |forward, active| {
        [
            format!("current.reference_feed_forward = {forward}"),
            format!("current.active_resistance = {active}"),
            "estimator = 7 (VoltageFeedback)".into(),
        ]
    };
    for (forward, active) in [(false, false), (true, true), (false, true)] {
        let set = |p: &mut ControllerParameters| {
            (p.current.reference_feed_forward, p.current.active_resistance) = (forward, active);
        };
        refused(Kind::VoltageFeedback, set, &parts(forward, active).each_ref().map(String::as_str));
    }
}

#[test]
fn starts_that_cannot_work() {
    for &kind in Kind::ALL.iter().filter(|kind| !kind.class().injects()) {
        let estimator = format!("estimator = {} ({})", kind as i32, kind.name());
        refused(kind, |p| p.start.mode = StartMode::Injection, &["start.mode = 3 (Injection)", &estimator]);
    }
    let injection = |set: fn(&mut ControllerParameters), parts: &[&str]| {
        let set = |p: &mut ControllerParameters| {
            p.start.mode = StartMode::Injection;
            set(p);
        };
        refused(Kind::SquareWaveInjection, set, parts);
    };
    let pulses = ["saturation.s_2 = 0 A/Wb2", "polarity.voltage = 150 V", "polarity.samples = 8", "T_s = 0.0001 s"];
    injection(|p| p.s_2 = 0.0, &pulses);
    injection(|p| p.polarity.voltage = 5.0, &["saturation.s_2 = 40 A/Wb2", "polarity.voltage = 5 V"]);
    injection(|p| p.polarity.samples = 80, &["polarity.samples = 80", "above limit.i = 15 A"]);
}

#[test]
fn currents_above_the_limit() {
    for &kind in Kind::ALL {
        refused(kind, |p| p.zero_speed.i_0 = 16.0, &["zero_speed.i_0 = 16 A", "at most limit.i = 15 A"]);
        let strong = |p: &mut ControllerParameters| (p.start.mode, p.start.i) = (StartMode::CurrentFrequency, 16.0);
        refused(kind, strong, &["start.i = 16 A", "at most limit.i = 15 A"]);
    }
}

#[test]
fn field_weakening_with_an_estimator_that_cannot() {
    let weaken = |p: &mut ControllerParameters| p.weakening.used = true;
    let name = |kind: Kind| format!("estimator = {} ({})", kind as i32, kind.name());
    for &kind in Kind::ALL.iter().filter(|kind| kind.class() == Class::Injection) {
        refused(kind, weaken, &["weakening.use = true", &name(kind), "Hybrid"]);
    }
    refused(Kind::VoltageModel, weaken, &["limit.i = 15 A", &name(Kind::VoltageModel), "10.597"]);
    let fed_back = Kind::VoltageFeedback;
    refused(fed_back, weaken, &["weakening.k_u = 0.95", "weakening.k_t = 0.98", &name(fed_back), "at most 0.9"]);
    let late = |p: &mut ControllerParameters| {
        p.weakening = WeakeningParameters { used: true, k_u: 0.9, k_t: 0.95, ..p.weakening.clone() };
    };
    refused(fed_back, late, &["weakening.k_t = 0.95"]);
    let early = |p: &mut ControllerParameters| {
        p.weakening = WeakeningParameters { used: true, k_t: 0.9, ..p.weakening.clone() };
    };
    refused(Kind::ExtendedEmf, early, &["weakening.k_t = 0.9", "at least weakening.k_u = 0.95"]);
    let reversed = |p: &mut ControllerParameters| {
        (p.weakening.used, p.motor.L_d, p.motor.L_q) = (true, p.motor.L_q, 0.2 * p.motor.L_d);
    };
    refused(Kind::ExtendedEmf, reversed, &["limit.i = 15 A", "L_q < L_d", "9.954"]);
    // Below the onset, with the 150 V of the injection off 0.95 u_dc / sqrt(3): 126 rad/s; without injection 299 rad/s.
    let injecting = |p: &mut ControllerParameters| {
        (p.weakening.used, p.current.mtpa, p.limit.tau) = (true, true, 1e3);
        p.estimators.hybrid.w_high = 130.0;
    };
    let parts = ["hybrid.w_high = 130 rad/s", "at most 126.", "square_wave.voltage = 150 V", "540 V", "lower it"];
    refused(Kind::Hybrid, injecting, &parts);
    let mut quieter = controller(Kind::Hybrid);
    injecting(&mut quieter.parameters);
    quieter.parameters.estimators.square_wave.voltage = 140.0;
    quieter.validate().unwrap();
    // The low-speed law's positive i_d, too, must leave torque to i_q: psi_M / (L_q - L_d) = 36.3 A.
    let strong = |p: &mut ControllerParameters| {
        (p.weakening.used, p.zero_speed.i_0, p.limit.i) = (true, 30.0, 40.0);
    };
    refused(Kind::Rasmussen, strong, &["zero_speed.i_0 = 30 A", "weakening.use = true", "29.066"]);
    // The others work, and these two within their limits.
    for &kind in Kind::ALL.iter().filter(|kind| kind.class() != Class::Injection) {
        let mut controller = controller(kind);
        let par = &mut controller.parameters;
        par.weakening = WeakeningParameters { used: true, ..WeakeningParameters::default() };
        match kind {
            Kind::VoltageModel => (par.limit.i, par.limit.i_q) = (10.5, 10.5),
            Kind::VoltageFeedback => (par.weakening.k_u, par.weakening.k_t) = (0.9, 0.9),
            _ => {}
        }
        controller.validate().unwrap();
    }
}

#[test]
fn resistance_adaptation_where_there_is_none() {
    let parts = ["adaptation.resistance = true", "estimator = 4 (ExtendedEmf)", "set estimator = Rasmussen"];
    refused(Kind::ExtendedEmf, |p| p.estimators.adaptation.resistance = true, &parts);
    let tracking = |p: &mut ControllerParameters| {
        (p.estimators.adaptation.resistance, p.estimators.adaptation.tracking) = (true, 0.15);
    };
    let parts = ["adaptation.tracking = 0.15", "(FluxObserver)", "set adaptation.tracking = 0"];
    refused(Kind::FluxObserver, tracking, &parts);
}

#[test]
fn clamps_of_the_resistance_that_exclude_the_parameter() {
    let with = |set: fn(&mut ControllerParameters), parts: &[&str]| {
        refused(
            Kind::Rasmussen,
            |p| {
                p.estimators.adaptation.resistance = true;
                set(p);
            },
            parts,
        );
    };
    with(|p| p.estimators.adaptation.min = 1.1, &["adaptation.min = 1.1", "at most 1", "lower it"]);
    with(|p| p.estimators.adaptation.max = 0.95, &["adaptation.max = 0.95", "at least 1", "raise it"]);
    with(|p| p.estimators.adaptation.start = 0.3, &["adaptation.start = 0.3", "0.4 to 2.5"]);
}

#[test]
fn what_another_estimator_adapts_or_holds() {
    let name = |kind: Kind| format!("estimator = {} ({})", kind as i32, kind.name());
    let reversal = |p: &mut ControllerParameters| p.estimators.emf.hold_reversal = true;
    for kind in [Kind::Rasmussen, Kind::VoltageModel, Kind::Hybrid, Kind::KalmanFilter, Kind::FluxObserver] {
        refused(kind, reversal, &["emf.hold_reversal = true", &name(kind), "set it to false", "SlidingMode"]);
    }
    let magnet = |p: &mut ControllerParameters| p.estimators.flux_observer.magnet = 5.0;
    for kind in [Kind::Rasmussen, Kind::GradientObserver] {
        refused(kind, magnet, &["flux_observer.magnet = 5 1/s", &name(kind), "FluxObserver"]);
    }
    for kind in [Kind::DirectEmf, Kind::SlidingMode, Kind::VoltageFeedback] {
        let mut holding = controller(kind);
        reversal(&mut holding.parameters);
        holding.validate().unwrap();
    }
    let mut adapting = controller(Kind::FluxObserver);
    magnet(&mut adapting.parameters);
    adapting.parameters.estimators.adaptation.resistance = true;
    adapting.validate().unwrap();
}

#[test]
fn a_sliding_mode_that_chatters() {
    let fast = |p: &mut ControllerParameters| p.estimators.sliding_mode.bandwidth = 11e3;
    refused(Kind::SlidingMode, fast, &["sliding_mode.bandwidth = 11000 rad/s", "at most 1 / T_s = 10000 rad/s"]);
}

#[test]
fn a_sample_period_too_long_for_the_current_loop() {
    // 2 pi 250 rad/s takes 0.24 ms with one sample of delay; the limit of the start values is exactly that.
    for (T_s, delay, most) in [(1e-3, 1, Some("376.99")), (2.4e-4, 1, None), (2.5e-4, 1, Some("1507.9"))] {
        let set = |p: &mut ControllerParameters| (p.T_s, p.delay) = (T_s, delay);
        let mut controller = SensorlessController::default();
        set(&mut controller.parameters);
        match most {
            None => controller.validate().unwrap(),
            Some(most) => {
                let message = controller.validate().expect_err("must be refused").message().to_owned();
                for part in [
                    "current.bandwidth = 1570.79",
                    &format!("at most {most}"),
                    "T_s = ",
                    "timing.delay = 1",
                    "lower it",
                ] {
                    assert!(message.contains(part), "{part}: {message}");
                }
            }
        }
    }
    let late = |p: &mut ControllerParameters| (p.T_s, p.delay) = (2e-4, 2);
    refused(
        Kind::Sensored,
        late,
        &["current.bandwidth = 1570.79", "2 pi 0.037 / T_s", "T_s = 0.0002 s", "timing.delay = 2"],
    );
    let mut early = controller(Kind::Sensored);
    (early.parameters.T_s, early.parameters.delay) = (4.5e-4, 0);
    early.validate().unwrap();
}

/// The start value of a current that an estimator does not read does not keep its limit up.
#[test]
fn an_unread_start_value_is_accepted() {
    for &kind in Kind::ALL {
        let mut low = controller(kind);
        (low.parameters.limit.i, low.parameters.limit.i_q) = (4.0, 4.0);
        assert_eq!(low.validate().is_ok(), kind.class() != Class::FluxObserver, "{kind:?}");
    }
}

#[test]
fn a_low_speed_law_that_leaves_no_torque() {
    // psi_M / (L_q - L_d) = 36.3 A.
    let strong = |p: &mut ControllerParameters| (p.zero_speed.i_0, p.limit.i) = (30.0, 40.0);
    for kind in [Kind::Rasmussen, Kind::FluxObserver] {
        let mtpa = |p: &mut ControllerParameters| {
            strong(p);
            p.current.mtpa = true;
        };
        refused(kind, mtpa, &["zero_speed.i_0 = 30 A", "current.mtpa = true", "29.066"]);
        let torque = |p: &mut ControllerParameters| {
            strong(p);
            p.speed_loop.torque_mode = true;
        };
        refused(kind, torque, &["zero_speed.i_0 = 30 A", "speed_loop.torque_mode = true", "29.066"]);
    }
}
