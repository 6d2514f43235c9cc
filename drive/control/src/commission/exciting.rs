//! The loops of current at standstill: four small ones for the axes, then large ones along d and q, with a small one where
//! R T/L needs it. Each begins after an alignment and without current.

use super::align::Align;
use super::axes::{Axes, Loops};
use super::bench::{Bench, Part, Sample};
use super::excitation::{Excitation, Plan, Record};
use super::output_error::{Along, Magnetization, OutputError, Progress};
use super::resting::Rested;
use super::results::Results;
use super::status::{CommissionFault as Fault, CommissionState};
use drive_base::frame::AlphaBeta;
use serde::{Deserialize, Serialize};

/// Amplitudes of the loops over I: axes, small and large.
const SMALL: [f64; 2] = [0.3, 0.35];
const LARGE: f64 = 0.9;
/// Share of the flux linkage that the motion of the rotor may add in small loops, and in loops whose fit accounts for it.
const MOTION: [f64; 2] = [0.004, 0.1];
/// Square of time times rate of a turn by reluctance: in small loops, and in large ones.
const GROWN: [f64; 2] = [0.1, 1.0];
/// R T/L above which L(0) comes from a small loop's output error.
const SLOW: f64 = 0.005;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Step {
    #[default]
    Ready,
    Down,
    Loop,
    Fit,
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

/// The loops, and what they have shown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Exciting {
    step: Step,
    excited: Excited,
    align: Align,
    /// Samples without current.
    quiet: f64,
    /// The magnet seems to lie along the greater inductance.
    inverse: bool,
    excitation: Excitation,
    loops: Loops,
    axes: Axes,
    fit: OutputError,
    /// The large loops; one without an amplitude was not found.
    large: [Magnetization; 2],
}

impl Exciting {
    /// The rotor has rested.
    pub(super) fn new(bench: &Bench, Rested { dc, inverse }: Rested) -> Self {
        let mut exciting = Self { align: Align::new(dc), inverse, ..Self::default() };
        exciting.begin(bench);
        exciting
    }

    /// What it does now.
    pub(super) fn state(&self) -> CommissionState {
        match self.excited {
            Excited::At0 | Excited::At45 | Excited::At90 | Excited::At135 => CommissionState::Axes,
            Excited::LargeD | Excited::SmallD | Excited::LargeQ | Excited::SmallQ => CommissionState::Saturation,
        }
    }

    fn enter(&mut self, step: Step) {
        (self.step, self.quiet) = (step, 0.0);
        self.align.restart();
    }

    /// A loop begins with an alignment, which a blocked rotor does not need.
    fn begin(&mut self, bench: &Bench) {
        self.enter(if bench.blocked { Step::Down } else { Step::Ready });
    }

    /// One sample; at the end, L_d and L_q in H.
    pub(super) fn update(
        &mut self,
        bench: &Bench,
        sample: &Sample,
        record: &mut Record,
        results: &mut Results,
    ) -> Result<Part<[f64; 2]>, Fault> {
        match self.step {
            Step::Ready => {
                let (u, rests) = self.align.update(bench, sample, 0.1)?;
                if rests {
                    self.enter(Step::Down);
                }
                Ok(Part::Voltage(u))
            }
            Step::Down => self.down(bench, sample).map(Part::Voltage),
            Step::Loop => match self.excitation.update(bench, sample, record) {
                Some(u) => Ok(Part::Voltage(u)),
                None => self.looped(bench, record, results),
            },
            Step::Fit => match self.fit.update(bench, &self.excitation, record) {
                Progress::Continues => Ok(Part::Voltage(AlphaBeta::ZERO)),
                Progress::Failed => Ok(self.fitted(bench, None, results)),
                Progress::Found(magnetization) => Ok(self.fitted(bench, Some(magnetization), results)),
            },
        }
    }

    /// The current ends; then the loop begins.
    fn down(&mut self, bench: &Bench, sample: &Sample) -> Result<AlphaBeta, Fault> {
        let Align { dc, k, .. } = &mut self.align;
        *k += 1.0;
        let i_ref = if bench.blocked { 0.0 } else { bench.aligned() * (1.0 - *k / 40.0).max(0.0) };
        let gone = sample.i.magnitude() < 0.01 * bench.I + 4.0 * bench.sigma;
        self.quiet = if gone { self.quiet + 1.0 } else { 0.0 };
        if *k >= 100.0 && self.quiet >= 5.0 {
            dc.u = 0.0;
            let (plan, phi) = self.plan(bench);
            self.excitation = Excitation::new(plan, phi);
            self.enter(Step::Loop);
            return Ok(AlphaBeta::ZERO);
        }
        if *k * bench.T > 5.0 {
            return Err(Fault::NotFollowing);
        }
        Ok(dc.command(bench, sample, i_ref))
    }

    /// The excitation that comes now, and its angle in rad.
    fn plan(&self, bench: &Bench) -> (Plan, f64) {
        use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
        let axes = &self.axes;
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
    fn looped(&mut self, bench: &Bench, record: &Record, results: &mut Results) -> Result<Part<[f64; 2]>, Fault> {
        let (along, L) = match self.excited {
            Excited::At0 | Excited::At45 | Excited::At90 | Excited::At135 => {
                self.loops.add(bench, &self.excitation, record);
                if self.excited == Excited::At135 {
                    self.axes = self.loops.axes(bench.blocked, self.inverse)?;
                    results.axis = self.axes.axis;
                }
                return Ok(self.next_loop(bench, results));
            }
            Excited::LargeD | Excited::SmallD => (Along::D, self.axes.L_d),
            Excited::LargeQ | Excited::SmallQ => (Along::Q, self.axes.L_q),
        };
        let Some(fit) = OutputError::start(bench, &self.excitation, record, along, L) else {
            return Ok(self.fitted(bench, None, results));
        };
        self.fit = fit;
        self.enter(Step::Fit);
        Ok(Part::Voltage(AlphaBeta::ZERO))
    }

    /// The fit of a loop is over.
    fn fitted(&mut self, bench: &Bench, found: Option<Magnetization>, results: &mut Results) -> Part<[f64; 2]> {
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
        self.next_loop(bench, results)
    }

    fn next_loop(&mut self, bench: &Bench, results: &mut Results) -> Part<[f64; 2]> {
        let slow = |L: f64| bench.R * bench.T / L > SLOW;
        self.excited = match self.excited {
            Excited::At0 => Excited::At45,
            Excited::At45 => Excited::At90,
            Excited::At90 => Excited::At135,
            Excited::At135 => Excited::LargeD,
            Excited::LargeD if slow(self.axes.L_d) => Excited::SmallD,
            Excited::LargeD | Excited::SmallD => Excited::LargeQ,
            Excited::LargeQ if slow(self.axes.L_q) => Excited::SmallQ,
            Excited::LargeQ | Excited::SmallQ => {
                let large = self.large.map(|m| (m.A > 0.0).then_some(m));
                results.show_inductances(&self.axes, large);
                return Part::Over([self.axes.L_d, self.axes.L_q]);
            }
        };
        self.align.dc.u = 0.0;
        self.begin(bench);
        Part::Voltage(AlphaBeta::ZERO)
    }
}
