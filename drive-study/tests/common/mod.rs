//! A plant stepped by hand.

use drive::PmsmPlant;
use drive::plant::tables::PlantParameters;
use fmu_core::{Block, Elapsed, Step};

/// Sample period in s.
pub(crate) const T_S: f64 = 1e-4;

/// A plant and its time.
pub(crate) struct SteppedPlant {
    pub(crate) block: Block<PmsmPlant>,
    now: Elapsed,
}

impl SteppedPlant {
    pub(crate) fn new(set: impl FnOnce(&mut PlantParameters)) -> Self {
        let mut block = Block::<PmsmPlant>::default();
        set(&mut block.model.parameters);
        block.initialize();
        Self { block, now: Elapsed::ZERO }
    }

    pub(crate) fn step(&mut self, h: f64) {
        let step = Step { start: self.now, h };
        self.block.step(&step).unwrap();
        self.now = step.end();
    }
}
