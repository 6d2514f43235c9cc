//! The sequence of the commissioning, one sample at a time.

use super::align::{Dc, LONGEST, Rest};
use super::alignment::{Alignment, Looked};
use super::axes::{Axes, Loops};
use super::bench::{Bench, Sample};
use super::curve::Curve;
use super::excitation::{Excitation, Plan, Record};
use super::levels::{Level, Levels, rho};
use super::offsets::Offsets;
use super::output_error::{Along, Magnetization, OutputError, Progress};
use super::probe::{Probe, Probed};
use super::resistance::{Staircase, adopt};
use super::results::Results;
use super::setup::{CommissionSetup, Voltage};
use super::starting::{Started, Starting};
use super::status::{CommissionFault as Fault, CommissionMode, CommissionState};
use super::swing::Swing;
use super::turning::Turning;
use drive_base::frame::{AlphaBeta, Phases};
use serde::{Deserialize, Serialize};

/// Angles in rad of the alignments.
const FIRST: f64 = 2.0 * std::f64::consts::FRAC_PI_3;
/// Current over I at which the gates go off.
const TOO_MUCH: f64 = 1.35;
/// Amplitudes of the loops over I: axes, small and large.
const SMALL: [f64; 2] = [0.3, 0.35];
const LARGE: f64 = 0.9;
/// Share of the flux linkage that the moving rotor may add: in small loops, and in loops whose fit accounts for it.
const MOTION: [f64; 2] = [0.004, 0.1];
/// Square of time times rate of a turn by reluctance: in small loops, and in large ones.
const GROWN: [f64; 2] = [0.1, 1.0];
/// Ratio of the probe's inductances above which the rest of the rotor is looked at.
const SALIENT: f64 = 1.6;
/// R T/L above which L(0) comes from a small loop's output error.
const SLOW: f64 = 0.005;

/// Parts of the sequence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    #[default]
    Offsets,
    Still,
    Probe,
    First,
    Look,
    FirstStaircase,
    Return,
    Swing,
    SecondStaircase,
    Ready,
    Down,
    Loop,
    Fit,
    Start,
    Levels,
    Done,
    Refused,
}

/// Loops in their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Excited {
    /// For the axes, at 0, 45, 90 and 135 degrees.
    #[default]
    At0,
    At45,
    At90,
    At135,
    LargeD,
    SmallD,
    LargeQ,
    SmallQ,
}

/// The commissioning of one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Commission {
    setup: CommissionSetup,
    stage: Stage,
    excited: Excited,
    fault: Fault,
    /// Samples since the start, and since the stage began.
    samples: f64,
    k: f64,
    /// Commands in V, the newest first.
    commands: [AlphaBeta; 3],
    offset: Phases,
    i_last: AlphaBeta,
    u_dc: f64,
    bench: Bench,
    offsets: Offsets,
    probe: Probe,
    dc: Dc,
    rest: Rest,
    alignment: Alignment,
    quiet: f64,
    staircases: [Staircase; 2],
    swing: Swing,
    record: Record,
    excitation: Excitation,
    loops: Loops,
    axes: Axes,
    fit: OutputError,
    /// The large loops; one without an amplitude was not found.
    large: [Magnetization; 2],
    starting: Starting,
    turning: Turning,
    levels: Levels,
    results: Results,
}

impl Commission {
    /// Before the first sample.
    pub fn new(setup: CommissionSetup) -> Self {
        let bench = Bench {
            T: setup.T_s,
            delay: f64::from(setup.delay),
            I: setup.i,
            n_p: f64::from(setup.n_p),
            curve: Curve::new(setup.i),
            ..Bench::default()
        };
        Self {
            setup,
            stage: Stage::Offsets,
            excited: Excited::At0,
            fault: Fault::None,
            samples: 0.0,
            k: 0.0,
            commands: [AlphaBeta::ZERO; 3],
            offset: Phases::default(),
            i_last: AlphaBeta::ZERO,
            u_dc: 0.0,
            bench,
            offsets: Offsets::default(),
            probe: Probe::default(),
            dc: Dc::default(),
            rest: Rest::default(),
            alignment: Alignment::default(),
            quiet: 0.0,
            staircases: [Staircase::default(), Staircase::default()],
            swing: Swing::default(),
            record: Record::default(),
            excitation: Excitation::default(),
            loops: Loops::default(),
            axes: Axes::default(),
            fit: OutputError::default(),
            large: [Magnetization::default(); 2],
            starting: Starting::default(),
            turning: Turning::default(),
            levels: Levels::default(),
            results: Results::default(),
        }
    }

    /// What it does now.
    pub fn state(&self) -> CommissionState {
        match self.stage {
            _ if self.setup.mode == CommissionMode::Off => CommissionState::Idle,
            Stage::Offsets => CommissionState::Offsets,
            Stage::Still | Stage::Probe => CommissionState::Probe,
            Stage::First | Stage::Look | Stage::Return => CommissionState::Align,
            Stage::FirstStaircase | Stage::SecondStaircase => CommissionState::Resistance,
            Stage::Swing => CommissionState::Swing,
            Stage::Ready | Stage::Down | Stage::Loop | Stage::Fit => match self.excited {
                Excited::At0 | Excited::At45 | Excited::At90 | Excited::At135 => CommissionState::Axes,
                Excited::LargeD | Excited::SmallD | Excited::LargeQ | Excited::SmallQ => CommissionState::Saturation,
            },
            Stage::Start => CommissionState::Start,
            Stage::Levels => CommissionState::Levels,
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

    /// Whether it has neither ended nor stopped.
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
        let coasts = self.stage == Stage::Start && self.starting.coasts();
        Voltage { u, gates: !(coasts || matches!(self.stage, Stage::Offsets | Stage::Done | Stage::Refused)) }
    }

    /// The gates are off.
    fn find_offsets(&mut self, measured: AlphaBeta) {
        // The common part of the phases has no effect.
        if let Some((offset, sigma)) = self.offsets.update(Phases::from_stator(measured), self.setup.T_s) {
            (self.offset, self.bench.sigma) = (offset, sigma);
            self.i_last = AlphaBeta::ZERO;
            self.enter(Stage::Still);
        }
    }

    fn enter(&mut self, stage: Stage) {
        (self.stage, self.k, self.quiet) = (stage, 0.0, 0.0);
        self.rest = Rest::default();
    }

    /// The gates are on: the command in V.
    fn drive(&mut self, sample: &Sample) -> Result<AlphaBeta, Fault> {
        self.k += 1.0;
        let t = self.k * self.bench.T;
        match self.stage {
            Stage::Offsets | Stage::Done | Stage::Refused => {}
            Stage::Still => {
                if sample.i.magnitude() > 0.05 * self.bench.I + 4.0 * self.bench.sigma {
                    return Err(Fault::NotFollowing);
                }
                if t > 0.02 && self.k >= 200.0 {
                    self.enter(Stage::Probe);
                }
            }
            Stage::Probe => match self.probe.update(&self.bench, sample) {
                Probed::Voltage(u) => return Ok(u),
                Probed::Refused(fault) => return Err(fault),
                Probed::Done(L_c, tensor) => {
                    (self.bench.L_c, self.bench.tensor) = (L_c, tensor);
                    self.dc.turn(FIRST);
                    self.enter(Stage::First);
                }
            },
            Stage::First => {
                let looks = self.bench.tensor.ratio() > SALIENT && !self.alignment.over;
                let next = if looks { Stage::Look } else { Stage::FirstStaircase };
                return self.align(sample, 0.6, next);
            }
            Stage::Look => match self.probe.update(&self.bench, sample) {
                Probed::Voltage(u) => return Ok(u),
                Probed::Refused(fault) => return Err(fault),
                Probed::Done(_, tensor) => {
                    self.dc.u = 0.0;
                    self.bench.tensor = tensor;
                    let i = [self.bench.aligned(), self.bench.I];
                    let again = self.alignment.look(i, tensor.saliency(), tensor.axis() - FIRST) == Looked::Lower;
                    (self.bench.i_0, self.bench.psi_1) = (self.alignment.i_0, self.alignment.psi_1);
                    self.enter(if again { Stage::First } else { Stage::FirstStaircase });
                }
            },
            Stage::Return => return self.align(sample, 0.1, Stage::Swing),
            Stage::Ready => return self.align(sample, 0.1, Stage::Down),
            Stage::FirstStaircase => return self.staircase(0, sample),
            Stage::SecondStaircase => return self.staircase(1, sample),
            Stage::Swing => return self.swing(sample),
            Stage::Down => return self.down(sample),
            Stage::Loop => {
                if let Some(u) = self.excitation.update(&self.bench, sample, &mut self.record) {
                    return Ok(u);
                }
                self.looped()?;
            }
            Stage::Fit => match self.fit.update(&self.bench, &self.excitation, &self.record) {
                Progress::Continues => {}
                Progress::Failed => self.fitted(None)?,
                Progress::Found(magnetization) => self.fitted(Some(magnetization))?,
            },
            Stage::Start => match self.starting.update(&self.bench, &mut self.turning, sample)? {
                Started::Voltage(u) => return Ok(u),
                Started::Off => {}
                Started::Done(i_f) => {
                    self.levels = Levels::new(&self.bench, &self.turning, sample, i_f, &self.results);
                    self.enter(Stage::Levels);
                }
            },
            Stage::Levels => {
                let left = self.setup.t_max - self.time();
                match self.levels.update(&self.bench, &mut self.turning, sample, left, &mut self.results)? {
                    Level::Voltage(u) => return Ok(u),
                    Level::Done => self.enter(Stage::Done),
                }
            }
        }
        Ok(AlphaBeta::ZERO)
    }

    /// Direct current of 0.4 I after a ramp of `rise` (s), until the rotor rests.
    fn align(&mut self, sample: &Sample, rise: f64, next: Stage) -> Result<AlphaBeta, Fault> {
        let t = self.k * self.bench.T;
        let i_ref = self.bench.aligned() * (t / rise).min(1.0);
        let u = self.dc.command(&self.bench, sample, i_ref);
        let still = t > rise && self.rest.update(&self.bench, self.dc.axis.from_stator(sample.i).q());
        if still {
            self.enter(next);
            if next == Stage::Look {
                self.probe = self.probe.again(&self.bench);
            } else if next == Stage::Swing {
                self.dc.turn(0.0);
                self.swing = Swing::start(&self.bench, sample);
                self.record.clear();
            }
        } else if t > LONGEST {
            return Err(Fault::NotFollowing);
        }
        Ok(u)
    }

    fn staircase(&mut self, n: usize, sample: &Sample) -> Result<AlphaBeta, Fault> {
        let stairs = &mut self.staircases[n];
        if let Some(u) = stairs.update(&self.bench, &mut self.dc, sample)? {
            return Ok(u);
        }
        adopt(&mut self.bench, &self.staircases[..=n])?;
        if n == 0 {
            self.enter(Stage::Return);
            return Ok(AlphaBeta::ZERO);
        }
        self.results.show_resistance(&self.bench, [&self.staircases[0].line, &self.staircases[1].line]);
        self.enter(if self.bench.blocked { Stage::Down } else { Stage::Ready });
        Ok(AlphaBeta::ZERO)
    }

    fn swing(&mut self, sample: &Sample) -> Result<AlphaBeta, Fault> {
        self.swing.update(&self.bench, sample, &mut self.record);
        let u = self.dc.command(&self.bench, sample, self.bench.aligned());
        if self.rest.update(&self.bench, self.dc.axis.from_stator(sample.i).q()) {
            let inverse = self.alignment.inverse;
            let magnet = self.swing.finish(&mut self.bench, sample, &self.record, inverse);
            self.results.blocked = self.bench.blocked;
            if !self.bench.blocked {
                if self.alignment.stuck || inverse && !magnet {
                    return Err(Fault::Inductance);
                }
                self.bench.tensor = self.bench.tensor.aligned(inverse);
            }
            self.enter(Stage::SecondStaircase);
        } else if self.k * self.bench.T > LONGEST {
            return Err(Fault::NotFollowing);
        }
        Ok(u)
    }

    /// The current ends; then the loop begins.
    fn down(&mut self, sample: &Sample) -> Result<AlphaBeta, Fault> {
        let i_ref = if self.bench.blocked { 0.0 } else { self.bench.aligned() * (1.0 - self.k / 40.0).max(0.0) };
        let gone = sample.i.magnitude() < 0.01 * self.bench.I + 4.0 * self.bench.sigma;
        self.quiet = if gone { self.quiet + 1.0 } else { 0.0 };
        if self.k >= 100.0 && self.quiet >= 5.0 {
            self.dc.u = 0.0;
            let (plan, phi) = self.plan();
            self.excitation = Excitation::new(plan, phi);
            self.enter(Stage::Loop);
            return Ok(AlphaBeta::ZERO);
        }
        if self.k * self.bench.T > 5.0 {
            return Err(Fault::NotFollowing);
        }
        Ok(self.dc.command(&self.bench, sample, i_ref))
    }

    /// The excitation that comes now, and its angle in rad.
    fn plan(&self) -> (Plan, f64) {
        use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
        let (bench, axes) = (&self.bench, &self.axes);
        let I = bench.I;
        let small = |phi: f64| (Plan::new(bench, SMALL[0] * I, bench.tensor.inductance(phi), MOTION[0], GROWN[0]), phi);
        match self.excited {
            Excited::At0 => small(0.0),
            Excited::At45 => small(FRAC_PI_4),
            Excited::At90 => small(FRAC_PI_2),
            Excited::At135 => small(3.0 * FRAC_PI_4),
            Excited::LargeD => (Plan::new(bench, LARGE * I, axes.L_d, f64::INFINITY, GROWN[1]), axes.axis),
            Excited::SmallD => (Plan::new(bench, SMALL[1] * I, axes.L_d, f64::INFINITY, GROWN[0]), axes.axis),
            Excited::LargeQ => (Plan::new(bench, LARGE * I, axes.L_q, MOTION[1], GROWN[1]), axes.axis + FRAC_PI_2),
            Excited::SmallQ => (Plan::new(bench, SMALL[1] * I, axes.L_q, MOTION[0], GROWN[0]), axes.axis + FRAC_PI_2),
        }
    }

    /// A loop is complete.
    fn looped(&mut self) -> Result<(), Fault> {
        let (along, L) = match self.excited {
            Excited::At0 | Excited::At45 | Excited::At90 | Excited::At135 => {
                self.loops.add(&self.bench, &self.excitation, &self.record);
                if self.excited == Excited::At135 {
                    self.axes = self.loops.axes(self.bench.blocked, self.alignment.inverse)?;
                    self.results.axis = self.axes.axis;
                }
                return self.next_loop();
            }
            Excited::LargeD | Excited::SmallD => (Along::D, self.axes.L_d),
            Excited::LargeQ | Excited::SmallQ => (Along::Q, self.axes.L_q),
        };
        match OutputError::start(&self.bench, &self.excitation, &self.record, along, L) {
            Some(fit) => {
                self.fit = fit;
                self.enter(Stage::Fit);
            }
            None => self.fitted(None)?,
        }
        Ok(())
    }

    /// The fit of a loop is over.
    fn fitted(&mut self, found: Option<Magnetization>) -> Result<(), Fault> {
        let Axes { L_d, L_q, .. } = self.axes;
        match self.excited {
            Excited::LargeD => self.large[0] = found.unwrap_or_default(),
            Excited::LargeQ => self.large[1] = found.unwrap_or_default(),
            Excited::SmallD => self.axes.L_d = found.map_or(L_d, |m| m.at_zero()),
            Excited::SmallQ => {
                self.axes.L_q = found.filter(|m| m.residual < 0.015).map_or(L_q, |m| m.at_zero());
            }
            Excited::At0 | Excited::At45 | Excited::At90 | Excited::At135 => {}
        }
        self.next_loop()
    }

    fn next_loop(&mut self) -> Result<(), Fault> {
        let slow = |L: f64| self.bench.R * self.bench.T / L > SLOW;
        let next = match self.excited {
            Excited::At0 => Excited::At45,
            Excited::At45 => Excited::At90,
            Excited::At90 => Excited::At135,
            Excited::At135 => Excited::LargeD,
            Excited::LargeD if slow(self.axes.L_d) => Excited::SmallD,
            Excited::LargeD | Excited::SmallD => Excited::LargeQ,
            Excited::LargeQ if slow(self.axes.L_q) => Excited::SmallQ,
            Excited::LargeQ | Excited::SmallQ => {
                let large = self.large.map(|m| (m.A > 0.0).then_some(m));
                self.results.show_inductances(&self.axes, large);
                return self.stood();
            }
        };
        self.excited = next;
        self.dc.u = 0.0;
        self.enter(if self.bench.blocked { Stage::Down } else { Stage::Ready });
        Ok(())
    }

    /// The part at standstill is complete.
    fn stood(&mut self) -> Result<(), Fault> {
        if self.setup.mode == CommissionMode::Standstill {
            self.enter(Stage::Done);
            return Ok(());
        }
        if self.bench.blocked {
            return Err(Fault::NotFollowing);
        }
        self.turning = Turning::new(&self.bench, [self.axes.L_d, self.axes.L_q], rho(&self.bench));
        self.starting = Starting::default();
        self.enter(Stage::Start);
        Ok(())
    }
}
