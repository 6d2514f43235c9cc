//! The sequence of the commissioning, one sample at a time: each part owns its state and hands its findings over to the next one.

use super::bench::{Bench, Part, Sample};
use super::curve::Curve;
use super::excitation::Record;
use super::exciting::Exciting;
use super::offsets::Offsets;
use super::probing::Probing;
use super::resting::Resting;
use super::results::Results;
use super::setup::{CommissionSetup, Voltage};
use super::spinning::Spinning;
use super::status::{CommissionFault as Fault, CommissionMode, CommissionState};
use drive_base::frame::{AlphaBeta, Phases};
use serde::{Deserialize, Serialize};

/// Current over I at which the gates go off.
const TOO_MUCH: f64 = 1.35;

/// Parts of the sequence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    #[default]
    Offsets,
    Probing,
    Resting,
    Exciting,
    Spinning,
    Done,
    Refused,
}

/// The commissioning of one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Commission {
    setup: CommissionSetup,
    stage: Stage,
    fault: Fault,
    /// Samples since the start.
    samples: f64,
    /// Commands in V, the newest first.
    commands: [AlphaBeta; 3],
    offset: Phases,
    i_last: AlphaBeta,
    u_dc: f64,
    /// Findings that later parts use.
    bench: Bench,
    results: Results,
    /// Rows of the swing, and then of each loop.
    record: Record,
    offsets: Offsets,
    probing: Probing,
    resting: Resting,
    exciting: Exciting,
    spinning: Spinning,
}

impl Commission {
    /// Before the first sample.
    pub fn new(setup: CommissionSetup) -> Self {
        let bench = Bench {
            T: setup.T_s,
            carrier: setup.carrier,
            delay: f64::from(setup.delay),
            I: setup.i,
            n_p: f64::from(setup.n_p),
            curve: Curve::new(setup.i),
            ..Bench::default()
        };
        Self {
            setup,
            stage: Stage::Offsets,
            fault: Fault::None,
            samples: 0.0,
            commands: [AlphaBeta::ZERO; 3],
            offset: Phases::default(),
            i_last: AlphaBeta::ZERO,
            u_dc: 0.0,
            bench,
            results: Results::default(),
            record: Record::default(),
            offsets: Offsets::default(),
            probing: Probing::default(),
            resting: Resting::default(),
            exciting: Exciting::default(),
            spinning: Spinning::default(),
        }
    }

    /// What it does now.
    pub fn state(&self) -> CommissionState {
        match self.stage {
            _ if self.setup.mode == CommissionMode::Off => CommissionState::Idle,
            Stage::Offsets => CommissionState::Offsets,
            Stage::Probing => CommissionState::Probe,
            Stage::Resting => self.resting.state(),
            Stage::Exciting => self.exciting.state(),
            Stage::Spinning => self.spinning.state(),
            Stage::Done => CommissionState::Done,
            Stage::Refused => CommissionState::Refused,
        }
    }

    /// Why it has stopped.
    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// Its results so far.
    pub fn results(&self) -> &Results {
        &self.results
    }

    /// Time in s since the start.
    pub fn time(&self) -> f64 {
        self.samples * self.setup.T_s
    }

    /// Stops with the gates off, unless it is over.
    pub fn abort(&mut self) {
        if !self.is_over() {
            self.refuse(Fault::Aborted);
        }
    }

    /// Whether it is still running.
    pub fn is_running(&self) -> bool {
        !self.is_over()
    }

    fn is_over(&self) -> bool {
        matches!(self.stage, Stage::Done | Stage::Refused) || self.setup.mode == CommissionMode::Off
    }

    fn refuse(&mut self, fault: Fault) {
        (self.stage, self.fault) = (Stage::Refused, fault);
    }

    /// One sample: measured phase currents `i` in A, link voltage `u_dc` in V.
    pub fn update(&mut self, i: Phases, u_dc: f64) -> Voltage {
        if self.is_over() {
            return Voltage::default();
        }
        let measured = i.to_stator();
        self.samples += 1.0;
        if self.samples * self.setup.T_s > self.setup.t_max {
            self.refuse(Fault::Time);
        } else if !(measured.is_finite() && measured.magnitude() <= TOO_MUCH * self.setup.i) {
            self.refuse(Fault::Current);
        } else if self.u_dc <= 0.0 {
            self.u_dc = u_dc;
            self.bench.U = u_dc / drive_base::frame::SQRT_3;
            self.bench.psi_r = self.bench.U / self.setup.speed;
        }
        if self.is_over() {
            return Voltage::default();
        }
        if !(u_dc.is_finite() && u_dc > 0.8 * self.u_dc) {
            self.refuse(Fault::Voltage);
            return Voltage::default();
        }
        let Phases { a, b, c } = self.offset;
        let i = measured - Phases { a, b, c }.to_stator();
        let u = match self.setup.delay {
            0 => self.commands[0],
            1 => self.commands[1],
            _ => self.commands[2],
        };
        let sample = Sample { i, i_last: self.i_last, u, u_dc };
        self.i_last = i;
        let u = if self.stage == Stage::Offsets {
            self.find_offsets(measured);
            AlphaBeta::ZERO
        } else {
            match self.drive(&sample) {
                Ok(u) => u,
                Err(fault) => {
                    self.refuse(fault);
                    return Voltage::default();
                }
            }
        };
        self.commands = [u, self.commands[0], self.commands[1]];
        let coasts = self.stage == Stage::Spinning && self.spinning.coasts();
        Voltage { u, gates: !(coasts || matches!(self.stage, Stage::Offsets | Stage::Done | Stage::Refused)) }
    }

    /// The gates are off.
    fn find_offsets(&mut self, measured: AlphaBeta) {
        // The common part of the phases has no effect.
        if let Some((offset, sigma)) = self.offsets.update(Phases::from_stator(measured), self.setup.T_s) {
            (self.offset, self.bench.sigma) = (offset, sigma);
            self.i_last = AlphaBeta::ZERO;
            self.stage = Stage::Probing;
        }
    }

    /// The gates are on: the command in V.
    fn drive(&mut self, sample: &Sample) -> Result<AlphaBeta, Fault> {
        let left = self.setup.t_max - self.time();
        let Self { bench, record, results, .. } = self;
        match self.stage {
            Stage::Offsets | Stage::Done | Stage::Refused => {}
            Stage::Probing => match self.probing.update(bench, sample)? {
                Part::Voltage(u) => return Ok(u),
                Part::Over(probe) => (self.stage, self.resting) = (Stage::Resting, Resting::new(probe)),
            },
            Stage::Resting => match self.resting.update(bench, sample, record, results)? {
                Part::Voltage(u) => return Ok(u),
                Part::Over(rested) => (self.stage, self.exciting) = (Stage::Exciting, Exciting::new(bench, rested)),
            },
            Stage::Exciting => match self.exciting.update(bench, sample, record, results)? {
                Part::Voltage(u) => return Ok(u),
                Part::Over(_) if self.setup.mode == CommissionMode::Standstill => self.stage = Stage::Done,
                Part::Over(_) if bench.blocked => return Err(Fault::NotFollowing),
                Part::Over(L) => (self.stage, self.spinning) = (Stage::Spinning, Spinning::new(bench, L)),
            },
            Stage::Spinning => match self.spinning.update(bench, sample, left, results)? {
                Part::Voltage(u) => return Ok(u),
                Part::Over(()) => self.stage = Stage::Done,
            },
        }
        Ok(AlphaBeta::ZERO)
    }
}
