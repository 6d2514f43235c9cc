//! A step of plant and controller does not allocate, regardless of the estimator, nor does saving and restoring the FMU state
//! with a reused handle. A separate test program: it replaces the allocator.
#![allow(missing_docs)]

#[path = "../fmu-export/tests/counting/mod.rs"]
mod counting;

use counting::{calls, neighbor};
use drive::estimator::Kind;
use drive_study::runner::{self, RATED_SPEED};
use fmu_core::{Block, Elapsed, Plain, Step, Stored};
use fmu_export::instance::Instance;
use fmu_export::lifecycle::Standard;
use fmu_export::log::{Log, Sink, Status};
use fmu_export::registry;
use fmu_export::snapshot::Snapshot;

/// Saves and restores a block's state.
fn again_and_again<M: Stored>(block: Block<M>, what: &str) {
    let log = Log::new(Box::new(Silent), false);
    let mut instance =
        Instance::<Plain<M>>::new(Standard::Fmi3, what.into(), log, Snapshot { block, ..Snapshot::default() });
    let handle = instance.save(0).unwrap();
    let before = calls();
    for _ in 0..100 {
        assert_eq!(instance.save(handle).unwrap(), handle);
        instance.restore(handle).unwrap();
    }
    assert_eq!(calls(), before, "saving and restoring {} with {what}", M::INFO.name);
    registry::free::<M>(handle).unwrap();
}

struct Silent;

impl Sink for Silent {
    fn write(&self, _: Status, _: &str, _: &str) {}

    fn hears(&self) -> bool {
        false
    }
}

#[test]
fn a_step_does_not_allocate() {
    let _neighbor = neighbor();
    for &kind in Kind::ALL {
        let mut pair = runner::turning(runner::drive(kind), 0.1);
        pair.start().unwrap();
        pair.set_inputs(0.1 * RATED_SPEED, 2.0, 540.0);
        let before = calls();
        for _ in 0..2000 {
            pair.step(1e-4).unwrap();
        }
        assert_eq!(calls(), before, "{}", kind.name());
        again_and_again(pair.controller, kind.name());
        again_and_again(pair.plant, kind.name());
    }
    let mut mean = Block::<drive::PmsmDriveMean>::default();
    mean.model.inputs.speed_ref = 100.0;
    mean.initialize();
    let (mut now, before) = (Elapsed::ZERO, calls());
    for _ in 0..200 {
        let step = Step { start: now, h: 1e-2 };
        mean.step(&step).unwrap();
        now = step.end();
    }
    assert_eq!(calls(), before, "PmsmDriveMean");
    again_and_again(mean, "speed control");
    let mut mapped = Block::<drive::MappedDrive>::default();
    mapped.model.inputs.speed_ref = 100.0;
    mapped.initialize();
    let (mut now, before) = (Elapsed::ZERO, calls());
    for _ in 0..200 {
        let step = Step { start: now, h: 1e-2 };
        mapped.step(&step).unwrap();
        now = step.end();
    }
    assert_eq!(calls(), before, "MappedDrive");
    again_and_again(mapped, "speed control");
    let before = calls();
    drop(std::hint::black_box(Box::new(1)));
    assert!(calls() > before, "the counter counts");
}
