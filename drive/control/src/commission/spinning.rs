//! The rotor turns: its [start](super::starting), then the [levels](super::levels) of speed.

use super::bench::{Bench, Part, Sample};
use super::levels::{Level, Levels, rho};
use super::results::Results;
use super::starting::{Started, Starting};
use super::status::{CommissionFault as Fault, CommissionState};
use super::turning::Turning;
use drive_base::frame::AlphaBeta;
use serde::{Deserialize, Serialize};

/// The start, and the levels after it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Spinning {
    /// The rotor follows.
    started: bool,
    starting: Starting,
    turning: Turning,
    levels: Levels,
}

impl Spinning {
    /// A machine with these inductances in H.
    pub(super) fn new(bench: &Bench, L: [f64; 2]) -> Self {
        Self { turning: Turning::new(bench, L, rho(bench)), ..Self::default() }
    }

    /// What it does now.
    pub(super) fn state(&self) -> CommissionState {
        if self.started { CommissionState::Levels } else { CommissionState::Start }
    }

    /// The gates are off.
    pub(super) fn coasts(&self) -> bool {
        !self.started && self.starting.coasts()
    }

    /// One sample, with `left` (s) of the time remaining.
    pub(super) fn update(
        &mut self,
        bench: &Bench,
        sample: &Sample,
        left: f64,
        results: &mut Results,
    ) -> Result<Part<()>, Fault> {
        if self.started {
            return Ok(match self.levels.update(bench, &mut self.turning, sample, left, results)? {
                Level::Voltage(u) => Part::Voltage(u),
                Level::Done => Part::Over(()),
            });
        }
        match self.starting.update(bench, &mut self.turning, sample)? {
            Started::Voltage(u) => return Ok(Part::Voltage(u)),
            Started::Off => {}
            Started::Done(i_f) => {
                self.levels = Levels::new(bench, &self.turning, sample, i_f, results);
                self.started = true;
            }
        }
        Ok(Part::Voltage(AlphaBeta::ZERO))
    }
}
