//! One row in the list makes an estimator: name, class, start, update, retuning and placing all derive from it.

use drive_base::frame::AlphaBeta;
use drive_base::math::wrap;
use drive_base::motor::Motor;
use drive_control::SensorlessController;
use drive_control::estimator::{Class, Context, Estimator, EstimatorParameters, Injection, Kind, Sample};
use drive_control::start::StartMode;
use fmu_core::{Enumerated, Model};

/// The 2.2 kW machine: its saliency suits every method.
fn salient() -> Motor {
    Motor::IPMSM_2_2_KW
}

#[test]
fn the_row_is_an_item_of_the_enumeration() {
    assert_eq!(Kind::ENUMERATION.items.len(), Kind::ALL.len());
    for (place, (&kind, item)) in Kind::ALL.iter().zip(Kind::ENUMERATION.items).enumerate() {
        assert_eq!(
            usize::try_from(item.value),
            Ok(place + 1),
            "{}: the values are the positions in the list",
            item.name
        );
        assert_eq!((Kind::of(item.value), item.name), (Some(kind), kind.name()));
        assert!(!item.description.is_empty(), "{}", item.name);
    }
    let past_the_end = Kind::ENUMERATION.items.iter().map(|item| item.value + 1).max().unwrap();
    assert_eq!((Kind::of(0), Kind::of(past_the_end)), (None, None));
}

#[test]
fn the_row_dispatches_every_call() {
    let (par, motor) = (EstimatorParameters::default(), salient());
    let context = Context { par: &par, motor: &motor, J: 15e-3, T_s: 1e-4 };
    let at = |k, theta_meas| Sample { k, i: AlphaBeta::ZERO, theta_meas, ..Sample::default() };
    for &kind in Kind::ALL {
        let name = kind.name();
        let (mut estimator, estimate) = Estimator::start(kind, &context, &at(0, 0.3), 0.3, 0.0);
        assert!(format!("{estimator:?}").starts_with(name), "{name}: {estimator:?}");
        assert!((estimate.theta - 0.3).abs() < 1e-12, "{name} starts at the given angle: {}", estimate.theta);
        let injects = estimate.injection != Injection::None;
        assert_eq!(injects, kind.class().injects(), "{name} injects at standstill: {injects}");
        let before = estimator.clone();
        estimator.retune(&context, &context);
        assert_eq!(estimator, before, "{name}: the same parameters change nothing");
        estimator.place(&context, &at(1, 2.0), 2.0, 0.0);
        let estimate = estimator.update(&context, &at(2, 2.0));
        assert!(wrap(estimate.theta - 2.0).abs() < 0.01, "{name} continues from the given angle: {}", estimate.theta);
    }
}

#[test]
fn the_class_decides_how_a_drive_starts() {
    for &kind in Kind::ALL {
        let mut controller = SensorlessController::default();
        let par = &mut controller.parameters;
        (par.estimator, par.motor, par.s_2) = (kind, salient(), 40.0);
        (par.limit.i, par.limit.i_q) = (15.0, 15.0);
        par.current.reference_feed_forward = true;
        for (mode, allowed) in [
            (StartMode::Direct, true),
            (StartMode::CurrentFrequency, true),
            (StartMode::Injection, kind.class().injects()),
        ] {
            controller.parameters.start.mode = mode;
            let judged = controller.validate();
            assert_eq!(judged.is_ok(), allowed, "{}, start.mode = {mode:?}: {judged:?}", kind.name());
        }
        let loses_standstill = !kind.holds_standstill();
        assert!(!loses_standstill || kind.class() == Class::BackEmf, "{}: only the EMF vanishes", kind.name());
    }
}
