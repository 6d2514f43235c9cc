//! A value without effect is reported by name, once, and only such values are reported.

use drive::control::start::StartMode;
use drive::estimator::Kind;
use drive::plant::thermal::ThermalMode;
use drive::{PmsmDrive, PmsmDriveMean, PmsmPlant, SensorlessController, SensorlessControllerClocked};
use fmu_core::idle::Watch;
use fmu_core::log::Warnings;
use fmu_core::{Block, Causality, Elapsed, Model, Slot, Step, Warns};

/// Messages of a watch at its first check.
fn said<M: Model>(block: &mut Block<M>, watch: &mut Watch) -> Vec<String> {
    let mut all = Vec::new();
    watch.look(block, |message| all.push(message.to_owned()));
    all
}

fn first<M: Model>(set: impl Fn(&mut M)) -> String {
    let mut block = Block::<M>::default();
    set(&mut block.model);
    said(&mut block, &mut Watch::default()).join("\n")
}

fn contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn the_models_name_what_has_no_effect() {
    let dc_limit = |p: &mut drive::control::tables::ControllerParameters| p.dc.max = 150.0;
    let limit = "limit.i_dc_max = 150 A: no effect without limit.i_dc_use";
    contains(&first::<SensorlessController>(|m| dc_limit(&mut m.parameters)), &[limit]);
    contains(&first::<PmsmDrive>(|m| dc_limit(&mut m.pair.controller.model.parameters)), &["controller.", limit]);
    let mean = first::<PmsmDriveMean>(|m| {
        m.drive.controller.trip.i = 150.0;
        (m.link_parameters.dc_link.C, m.inputs.sensor_valid) = (1e-2, false);
    });
    contains(&mean, &["controller.trip.i = 150 A", "dc_link.C = 0.01 F", "sensor_valid = false"]);
    contains(&mean, &["no effect in PmsmDriveMean, which has no capacitor"]);
    assert_eq!(mean.lines().count(), 1, "one message for one reason: {mean}");
    contains(
        &first::<PmsmDrive>(|m| m.inputs.tau_ref = 3.0),
        &["tau_ref = 3 N.m: no effect without speed_loop.torque_mode"],
    );
    contains(
        &first::<PmsmPlant>(|m| m.parameters.mechanics.imposed = true),
        &["mechanics.imposed = true: speed_shaft and"],
    );
    contains(&first::<PmsmDriveMean>(|m| m.inputs.u_dc = 0.0), &["u_dc = 0 V: the DC link has no voltage"]);
    contains(
        &first::<PmsmDriveMean>(|m| m.inputs.speed_shaft = 2.0),
        &["speed_shaft = 2 rad/s: no effect without mechanics.imposed"],
    );
    for quiet in [
        first::<PmsmPlant>(|_| ()),
        first::<PmsmDriveMean>(|_| ()),
        first::<SensorlessControllerClocked>(|_| ()),
        first::<PmsmDrive>(|m| (m.inputs.tau_load, m.inputs.speed_ref, m.inputs.u_dc) = (1.0, 30.0, 300.0)),
        // A parameter set to 0 requests nothing.
        first::<SensorlessController>(|m| {
            (m.parameters.estimator, m.parameters.zero_speed.i_0) = (Kind::EmfObserver, 0.0);
        }),
    ] {
        assert!(quiet.is_empty(), "{quiet}");
    }
}

/// An input is checked until it is set, and reported once.
#[test]
fn an_input_that_is_set_later_is_named_then() {
    let (mut block, mut watch) = (Block::<PmsmDrive>::default(), Watch::default());
    assert!(said(&mut block, &mut watch).is_empty());
    block.model.inputs.tau_ref = 2.0;
    contains(&said(&mut block, &mut watch).join("\n"), &["tau_ref = 2 N.m"]);
    assert!(said(&mut block, &mut watch).is_empty());
}

/// Outputs of a drive over an electrical period with a load, after a start of each kind.
fn outputs(block: &mut Block<PmsmDrive>) -> Option<Vec<u64>> {
    block.model.derive();
    block.model.validate().ok()?;
    block.initialize();
    let (mut now, mut bits) = (Elapsed::ZERO, Vec::new());
    for k in 0..30 {
        block.model.inputs.tau_load = if k < 10 { 0.0 } else { 0.5 };
        let step = Step { start: now, h: 1e-3 };
        block.step(&step).ok()?;
        now = step.end();
        for index in PmsmDrive::TABLE.indices() {
            if let Some((meta, Slot::Real(x))) = PmsmDrive::TABLE.entry(block, index)
                && meta.causality == Causality::Output
            {
                bits.push(x.to_bits());
            }
        }
    }
    Some(bits)
}

/// Changes a value to another allowed one.
fn moved(block: &mut Block<PmsmDrive>, index: usize) {
    match PmsmDrive::TABLE.entry(block, index) {
        Some((meta, Slot::Real(x))) => {
            let next = if *x == 0.0 { 0.3 } else { 1.2 * *x };
            *x = if meta.range.contains(next) { next } else { 0.8 * *x };
        }
        Some((_, Slot::Boolean(x))) => *x = !*x,
        Some((_, Slot::Integer(x))) => assert!(x.set(x.get() * 2) || x.set(x.get() + 1)),
        Some((_, Slot::Enumeration(x))) => assert!(x.set(x.get() + 1) || x.set(x.get() - 1)),
        _ => (),
    }
}

/// With every estimator and in both modes, a value reported as having no effect changes no bit.
#[test]
fn what_is_reported_has_no_effect() {
    let (mut tried, mut wrong) = (0, Vec::new());
    for &kind in Kind::ALL {
        for mode in 0..3 {
            let drive = || {
                let mut block = Block::<PmsmDrive>::default();
                let par = &mut block.model.pair.controller.model.parameters;
                par.estimator = kind;
                par.speed_loop.torque_mode = mode == 1;
                if mode == 2 {
                    par.start.mode = StartMode::CurrentFrequency;
                    par.compensation.u_dead = 5.0;
                    block.model.pair.plant.model.parameters.thermal.mode = ThermalMode::Imposed;
                    block.model.pair.plant.model.parameters.inverter.dead_time = 1e-6;
                }
                block.model.pair.plant.model.parameters.initial.speed = 40.0;
                block.model.pair.controller.model.parameters.speed_est = 40.0;
                (block.model.inputs.speed_ref, block.model.inputs.tau_ref) = (60.0, 1.0);
                block
            };
            // Some estimators refuse a start or a mode.
            let Some(plain) = outputs(&mut drive()) else { continue };
            for index in PmsmDrive::TABLE.indices() {
                let Some((name, meta, 0)) = PmsmDrive::TABLE.locate(index) else { continue };
                let settable = matches!(meta.causality, Causality::Parameter | Causality::Input);
                if !settable || drive().model.idle(&name).is_none() || name == "plant.mechanics.imposed" {
                    continue;
                }
                let mut other = drive();
                moved(&mut other, index);
                tried += 1;
                if outputs(&mut other).is_some_and(|bits| bits != plain) {
                    wrong.push(format!("{name} with {kind:?}, {mode}"));
                }
            }
        }
    }
    println!("{tried} values");
    assert!(wrong.is_empty() && tried > 1000, "have an effect: {wrong:#?}");
}

/// `PmsmDriveMean` reports once that its current loop cannot hold the current; with the gates off, its diodes feed the link.
#[test]
fn a_drive_that_cannot_be_is_named_once() {
    for enable in [true, false] {
        let mut block = Block::<PmsmDriveMean>::default();
        block.model.drive.plant.mechanics.imposed = true;
        block.model.drive.controller.speed_loop.torque_mode = true;
        (block.model.inputs.speed_shaft, block.model.inputs.enable) = (2000.0, enable);
        block.initialize();
        let (mut now, mut all) = (Elapsed::ZERO, Vec::new());
        for k in 0..30 {
            block.model.inputs.speed_shaft = if k < 10 { 100.0 } else { 2000.0 };
            let step = Step { start: now, h: 0.1 };
            block.step(&step).unwrap();
            now = step.end();
            block.model.warn(&mut Warnings::to(&mut |(_, key, text)| all.push((k, key, text()))));
        }
        if enable {
            let named: Vec<_> = all.iter().filter(|(_, key, _)| *key == "limit.i").collect();
            assert!(
                named.len() == 1
                    && named[0].0 == 10
                    && named[0].2.contains("A exceeds limit.i = 7.5 A, because at 2000.0 rad/s"),
                "{all:?}"
            );
        } else {
            assert!(all.is_empty() && block.out.drive.plant.powers.p_in < -1e3, "{all:?}");
        }
    }
}
