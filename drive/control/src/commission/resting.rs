//! The rotor rests along a direct current: at 120 degrees, where a salient rotor is checked and the first staircase runs, and
//! after its swing at 0, where the second one runs.

use super::align::{Align, Dc, LONGEST};
use super::alignment::{Alignment, Looked};
use super::bench::{Bench, Part, Sample};
use super::excitation::Record;
use super::probe::{Probe, Probed};
use super::resistance::{Staircase, adopt};
use super::results::Results;
use super::status::{CommissionFault as Fault, CommissionState};
use super::swing::Swing;
use drive_base::frame::AlphaBeta;
use serde::{Deserialize, Serialize};

/// Angle in rad of the first alignment; the second one is at 0.
const FIRST: f64 = 2.0 * std::f64::consts::FRAC_PI_3;
/// Ratio of the probe's inductances above which the position of the rotor at rest is checked.
const SALIENT: f64 = 1.6;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Step {
    #[default]
    First,
    Look,
    FirstStaircase,
    Return,
    Swing,
    SecondStaircase,
}

/// Alignments, staircases and the swing between them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Resting {
    step: Step,
    align: Align,
    probe: Probe,
    alignment: Alignment,
    staircases: [Staircase; 2],
    swing: Swing,
}

/// The rotor rests at 0.
pub(super) struct Rested {
    /// The direct current there.
    pub(super) dc: Dc,
    /// The magnet seems to lie along the greater inductance.
    pub(super) inverse: bool,
}

impl Resting {
    /// After the `probe`.
    pub(super) fn new(probe: Probe) -> Self {
        Self { align: Align::new(Dc::at(FIRST)), probe, ..Self::default() }
    }

    /// What it does now.
    pub(super) fn state(&self) -> CommissionState {
        match self.step {
            Step::First | Step::Look | Step::Return => CommissionState::Align,
            Step::FirstStaircase | Step::SecondStaircase => CommissionState::Resistance,
            Step::Swing => CommissionState::Swing,
        }
    }

    fn enter(&mut self, step: Step) {
        self.step = step;
        self.align.restart();
    }

    /// One sample.
    pub(super) fn update(
        &mut self,
        bench: &mut Bench,
        sample: &Sample,
        record: &mut Record,
        results: &mut Results,
    ) -> Result<Part<Rested>, Fault> {
        let u = match self.step {
            Step::First => {
                let (u, rests) = self.align.update(bench, sample, 0.6)?;
                if rests && bench.tensor.ratio() > SALIENT && !self.alignment.over {
                    self.enter(Step::Look);
                    self.probe = self.probe.again(bench);
                } else if rests {
                    self.enter(Step::FirstStaircase);
                }
                u
            }
            Step::Look => self.look(bench, sample)?,
            Step::FirstStaircase => {
                if let Some(u) = self.staircases[0].update(bench, &mut self.align.dc, sample)? {
                    return Ok(Part::Voltage(u));
                }
                adopt(bench, &self.staircases[..1])?;
                self.enter(Step::Return);
                AlphaBeta::ZERO
            }
            Step::Return => {
                let (u, rests) = self.align.update(bench, sample, 0.1)?;
                if rests {
                    self.enter(Step::Swing);
                    self.align.dc.turn(0.0);
                    self.swing = Swing::start(bench, sample);
                    record.clear();
                }
                u
            }
            Step::Swing => self.swing(bench, sample, record, results)?,
            Step::SecondStaircase => {
                if let Some(u) = self.staircases[1].update(bench, &mut self.align.dc, sample)? {
                    return Ok(Part::Voltage(u));
                }
                adopt(bench, &self.staircases)?;
                results.show_resistance(bench, [&self.staircases[0].line, &self.staircases[1].line]);
                return Ok(Part::Over(Rested { dc: self.align.dc.clone(), inverse: self.alignment.inverse }));
            }
        };
        Ok(Part::Voltage(u))
    }

    fn look(&mut self, bench: &mut Bench, sample: &Sample) -> Result<AlphaBeta, Fault> {
        match self.probe.update(bench, sample) {
            Probed::Voltage(u) => return Ok(u),
            Probed::Refused(fault) => return Err(fault),
            Probed::Done(_, tensor) => {
                self.align.dc.u = 0.0;
                bench.tensor = tensor;
                let i = [bench.aligned(), bench.I];
                let again = self.alignment.look(i, tensor.saliency(), tensor.axis() - FIRST) == Looked::Lower;
                (bench.i_0, bench.psi_1) = (self.alignment.i_0, self.alignment.psi_1);
                self.enter(if again { Step::First } else { Step::FirstStaircase });
            }
        }
        Ok(AlphaBeta::ZERO)
    }

    fn swing(
        &mut self,
        bench: &mut Bench,
        sample: &Sample,
        record: &mut Record,
        results: &mut Results,
    ) -> Result<AlphaBeta, Fault> {
        self.swing.update(bench, sample, record);
        let (u, rests) = self.align.hold(bench, sample);
        if rests {
            let inverse = self.alignment.inverse;
            let magnet = self.swing.finish(bench, sample, record, inverse);
            results.blocked = bench.blocked;
            if !bench.blocked {
                if self.alignment.stuck || inverse && !magnet {
                    return Err(Fault::Inductance);
                }
                bench.tensor = bench.tensor.aligned(inverse);
            }
            self.enter(Step::SecondStaircase);
        } else if self.align.time(bench) > LONGEST {
            return Err(Fault::NotFollowing);
        }
        Ok(u)
    }
}
