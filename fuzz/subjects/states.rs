//! Stored states of our models, damaged under a right checksum: the first byte selects a model, the second a state of its life, and each
//! three others are an offset and the byte there. So the corpus outlives a change of a model.

use crate::trial::{quiet, seeds, trial};
use drive::{MappedDrive, PmsmDrive, PmsmDriveMean, PmsmPlant, SensorlessController};
use fmu_core::{Block, Stored};
use std::sync::OnceLock;

pub(crate) fn run(bytes: &[u8]) {
    quiet();
    let [model, state, edits @ ..] = bytes else { return };
    match model % 5 {
        0 => damaged::<PmsmPlant>(0, *state, edits),
        1 => damaged::<SensorlessController>(1, *state, edits),
        2 => damaged::<PmsmDriveMean>(2, *state, edits),
        3 => damaged::<MappedDrive>(3, *state, edits),
        _ => damaged::<PmsmDrive>(4, *state, edits),
    }
}

fn damaged<M: Stored>(model: usize, state: u8, edits: &[u8]) {
    static STATES: [OnceLock<Vec<Vec<u8>>>; 5] = [const { OnceLock::new() }; 5];
    let states = STATES[model].get_or_init(|| seeds(Block::<M>::default()));
    let stored = &states[usize::from(state) % states.len()];
    let mut content = stored[..stored.len() - 4].to_vec();
    for edit in edits.as_chunks::<3>().0 {
        let at = usize::from(u16::from_le_bytes([edit[0], edit[1]])) % content.len();
        content[at] = edit[2];
    }
    let mut crc = flate2::Crc::new();
    crc.update(&content);
    content.extend(crc.sum().to_le_bytes());
    let _ = trial::<M>(&content);
}
