//! Frequency responses by a swept sine: the running system, with its sampled parts, is excited at one frequency after another.
//!
//! Each frequency is a run of its own. The system reaches its operating point under the sine, then windows of whole periods are
//! measured (file `fit.rs`) until two agree. Frequencies are moved to the grid of the communication steps, so that a window also has whole
//! sample periods of a part that samples on this grid.
//!
//! An FMU holds an input over a communication step h, and an importer reads outputs at its end: a continuous part receives the
//! sine h/2 late, a sampled one in time. Both agree as h tends to 0, so the response at h and h/2 is extrapolated, G = 2 G(h/2) -
//! G(h), with at least 40 steps a period. The result describes the response of the output signal, held or not, to a continuous
//! sine at the input. A run at half the amplitude shows whether the system is linear there.
//!
//! Sources: G. F. Franklin, J. D. Powell, M. Workman, Digital Control of Dynamic Systems, 3rd ed., 1998, for sampled loops; the
//! extrapolation is Richardson's. Sines of single frequencies, settled periods left out, correspond to a sinestream in
//! Simulink's frequency response estimator.

mod fit;
mod margins;

pub use margins::{
    Margins, Passband, ResponsePoint, active_ranges, band, crossovers, decibels, margins, open_loop, phases,
};
pub use num_complex::Complex64;

use crate::error::invalid;
use crate::plan::Plan;
use crate::{Error, pool};
use fit::{Periods, SineFit};
use fmu_import::journal;
use fmu_system::cosimulation::{CoarseSteps, Settings, Sine, SystemPlan};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

/// Excitation and measured variables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Excitation {
    /// The input, or tunable parameter, that gets the sine.
    pub input: String,
    /// The measured variables.
    pub outputs: Vec<String>,
    /// A measured variable used in place of the input: the responses are ratios to it.
    pub over: Option<String>,
    /// Variables whose largest magnitude during the measurement is reported, such as flags of limits.
    pub watch: Vec<String>,
    /// Frequencies in Hz; none: 10 a decade, three decades up to a fifth of the frequency of the communication steps, and more where the
    /// response bends.
    pub frequencies: Vec<f64>,
    /// Amplitude in the unit of the input; by default a hundredth of its size, reduced until the system is linear.
    pub amplitude: Option<f64>,
    /// Time in s from the start to the operating point; by default from start to stop.
    pub settle: Option<f64>,
}

/// The responses at one frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct FrequencyPoint {
    /// Frequency in Hz, on the grid of the communication steps.
    pub frequency: f64,
    /// Amplitude of the input.
    pub amplitude: f64,
    /// A value for each output.
    pub values: Vec<Complex64>,
    /// Largest magnitude of each watched variable.
    pub watched: Vec<f64>,
    /// Relative change of the values at half the amplitude.
    pub nonlinear: f64,
    /// Relative change of the values between the last two windows.
    pub unsettled: f64,
    /// Relative change of the values with half the communication step; `None` if the FMUs do not allow it.
    pub stepped: Option<f64>,
    /// The first warning of the FMUs.
    pub warning: Option<String>,
}

/// Relative changes above which a value is doubtful: 2 % are 0.2 dB or 1.1 degrees. The extrapolation leaves about the square of
/// the change by the step.
pub const DOUBTFUL: f64 = 0.02;

/// Relative change with half the communication step above which a value is doubtful.
pub const COARSE: f64 = 0.3;

impl FrequencyPoint {
    /// Why the values are doubtful.
    pub fn doubts(&self) -> Vec<String> {
        let percent = |x: f64| format!("{:.1} %", 100.0 * x);
        let mut found = Vec::new();
        if self.nonlinear.is_nan() || self.nonlinear > DOUBTFUL {
            found.push(format!("changes by {} at half the amplitude", percent(self.nonlinear)));
        }
        if self.unsettled.is_nan() || self.unsettled > DOUBTFUL {
            found.push(format!("not settled: {} from period to period", percent(self.unsettled)));
        }
        if let Some(x) = self.stepped.filter(|x| x.is_nan() || *x > COARSE) {
            found.push(format!("changes by {} with half the communication step", percent(x)));
        }
        found
    }
}

/// The outcome of a frequency: its point, or the error in one line.
pub type FrequencyOutcome = (f64, Result<FrequencyPoint, String>);

/// Minimum number of communication steps in a period.
const STEPS: f64 = 40.0;
/// Change between two windows at which a measurement ends.
const SETTLED: f64 = 3e-4;
/// Maximum number of windows, and of the settling time for which windows follow each other.
const WINDOWS: (f64, f64) = (10.0, 500.0);
/// Maximum number of reductions of the amplitude, each to a quarter, and the change at half the amplitude that justifies
/// another one.
const REDUCTIONS: (u32, f64) = (6, 0.005);
/// Maximum number of passes that add frequencies, and the change of the response's logarithm that triggers one.
const REFINEMENTS: usize = 2;
const BEND: f64 = 0.15;
/// Share of the sampling frequency up to which a sine is measured.
const HIGHEST: f64 = 0.45;

/// A sine on the grid of the communication steps.
#[derive(Clone, Copy, Debug)]
struct Tone {
    /// Periods of a window, and its communication steps of the plan.
    window: Periods,
    /// Communication step (s) of the plan.
    step: f64,
}

impl Tone {
    /// The sine nearest to `f` (Hz): the shortest window of at least 16 steps in which it is within a thousandth, or else the nearest
    /// of up to 200 periods.
    fn near(f: f64, step: f64) -> Option<Self> {
        let with = |periods: u32| {
            let samples = (f64::from(periods) / (f * step)).round().max(3.0);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
            (samples < 1e9).then_some(Self { window: Periods { periods, samples: samples as u32 }, step })
        };
        let apart = |tone: &Self| (tone.frequency() / f - 1.0).abs();
        let all = || (1..=200).filter_map(with);
        let near = all().find(|tone| apart(tone) < 1e-3 && tone.window.samples >= 16);
        near.or_else(|| all().min_by(|a, b| apart(a).total_cmp(&apart(b))))
    }

    fn frequency(&self) -> f64 {
        f64::from(self.window.periods) / (f64::from(self.window.samples) * self.step)
    }
}

/// A measurement at one amplitude and step.
struct Measured {
    values: Vec<Complex64>,
    unsettled: f64,
    watched: Vec<f64>,
    warning: Option<String>,
}

/// Common settings of all measurements.
struct Sweep<'a> {
    /// Records the variable that replaces the input, the outputs, then the watched variables.
    plan: SystemPlan,
    excitation: &'a Excitation,
    /// The input, written `instance.variable`.
    port: String,
    settle: f64,
}

impl Plan {
    /// Measures responses at all frequencies on `threads` threads. `progress` is called with the number of frequencies done, and may
    /// stop. The measures of the plan are not used.
    ///
    /// # Errors
    /// A variable does not exist or is not a number, the input cannot follow a sine, or a number is out of range. An error of a
    /// run is reported for its frequency.
    pub fn frequency_response(
        &self,
        excitation: &Excitation,
        threads: usize,
        progress: &(dyn Fn(u64) -> ControlFlow<()> + Sync),
    ) -> Result<Vec<FrequencyOutcome>, Error> {
        let sweep = self.sweep(excitation)?;
        let threads = if self.only_one_instance().is_some() { 1 } else { threads };
        let frequencies = if excitation.frequencies.is_empty() {
            usual(sweep.plan.settings().step)
        } else {
            excitation.frequencies.clone()
        };
        let mut outcomes = sweep.run(&frequencies, &[], (threads, progress))?;
        if excitation.frequencies.is_empty() {
            for _ in 0..REFINEMENTS {
                outcomes = sweep.run(&bends(&outcomes), &outcomes, (threads, progress))?;
            }
        }
        Ok(outcomes)
    }

    fn sweep<'a>(&self, excitation: &'a Excitation) -> Result<Sweep<'a>, Error> {
        let Excitation { input, outputs, over, watch, amplitude, settle, .. } = excitation;
        if outputs.is_empty() {
            return invalid("a frequency response needs an output");
        }
        if let Some(x) = amplitude.filter(|x| !(x.is_finite() && *x > 0.0)) {
            return invalid(format!("amplitude {x}: expected a number above 0"));
        }
        let Settings { start, stop, .. } = *self.settings();
        let settle = settle.unwrap_or(stop - start);
        if !(settle.is_finite() && settle >= 0.0) {
            return invalid(format!("settling time {settle} s: expected a number of at least 0"));
        }
        let [port] = &self.ports(input)?[..] else {
            return invalid(format!("{input}: feeds several inputs; excite one of them"));
        };
        let names = over.iter().chain(outputs).chain(watch);
        let outlets = names.map(|name| self.outlet(name)).collect::<Result<Vec<_>, _>>()?;
        let plan = self.system().recording(&outlets)?;
        Ok(Sweep { plan, excitation, port: port.clone(), settle })
    }
}

/// The usual frequencies (Hz) with steps of `step` (s).
fn usual(step: f64) -> Vec<f64> {
    (0..=30).map(|k| 0.2 / step * 10.0_f64.powf(0.1 * f64::from(k) - 3.0)).collect()
}

/// Frequencies between points at which the logarithm of the response bends.
fn bends(outcomes: &[FrequencyOutcome]) -> Vec<f64> {
    let value = |(f, outcome): &FrequencyOutcome| Some((*f, outcome.as_ref().ok()?.values[0]));
    let points: Vec<(f64, Complex64)> = outcomes.iter().filter_map(value).collect();
    let mut between = Vec::new();
    for three in points.windows(3) {
        let [(a, x), (b, y), (c, z)] = three else { continue };
        // On a straight line of gain and phase, the middle is the geometric mean; the sign of its root is chosen to match the
        // middle.
        let share = (b / a).ln() / (c / a).ln();
        let straight = x * ((z / x).ln() * share).exp();
        if (y / straight).ln().norm() > BEND {
            between.extend([(a * b).sqrt(), (b * c).sqrt()]);
        }
    }
    between
}

/// The largest relative change from `a` to `b`; a value below its `floor` is 0.
fn apart(a: &[Complex64], b: &[Complex64], floors: &[f64]) -> f64 {
    let of = |((a, b), floor): ((&Complex64, &Complex64), &f64)| {
        let size = a.norm().max(b.norm());
        if size <= *floor { 0.0 } else { (a - b).norm() / size }
    };
    a.iter().zip(b).zip(floors).map(of).fold(0.0, |x, y| if y.is_nan() { y } else { x.max(y) })
}

impl Sweep<'_> {
    fn tone(&self, f: f64) -> Result<Tone, Error> {
        let step = self.plan.settings().step;
        let highest = HIGHEST / step;
        let tone = (f.is_finite() && f > 0.0 && f <= highest).then(|| Tone::near(f, step)).flatten();
        tone.ok_or_else(|| {
            Error::Invalid(format!(
                "frequency {f} Hz: expected a number above 0, and at most {highest} Hz with communication steps of {step} s"
            ))
        })
    }

    /// Measures at frequencies (Hz), in addition to those `known`, on threads.
    fn run(
        &self,
        frequencies: &[f64],
        known: &[FrequencyOutcome],
        (threads, progress): (usize, &(dyn Fn(u64) -> ControlFlow<()> + Sync)),
    ) -> Result<Vec<FrequencyOutcome>, Error> {
        let mut tones: Vec<Tone> = frequencies.iter().map(|f| self.tone(*f)).collect::<Result<_, _>>()?;
        tones.sort_by(|a, b| a.frequency().total_cmp(&b.frequency()));
        tones.dedup_by(|a, b| a.window == b.window);
        let is_known = |tone: &Tone| known.iter().any(|(f, _)| (f / tone.frequency() - 1.0).abs() < 1e-3);
        tones.retain(|tone| !is_known(tone));
        let Some(first) = tones.first() else { return Ok(known.to_vec()) };
        // Names and types are the same for all frequencies.
        self.runnable(*first)?;
        let done = u64::try_from(known.len()).unwrap_or(u64::MAX);
        let outcomes = Mutex::new((known.to_vec(), done));
        pool::run(
            u64::try_from(tones.len()).unwrap_or(u64::MAX),
            threads,
            |_| Ok(()),
            |(), block| {
                let tone = tones[usize::try_from(block).unwrap_or(usize::MAX)];
                let outcome = self.point(tone).map_err(|error| error.to_string());
                let mut all = outcomes.lock().unwrap_or_else(PoisonError::into_inner);
                all.0.push((tone.frequency(), outcome));
                all.1 += 1;
                let done = all.1;
                drop(all);
                if progress(done).is_break() { Err(Error::Interrupted) } else { Ok(()) }
            },
        )?;
        let mut all = outcomes.into_inner().unwrap_or_else(PoisonError::into_inner).0;
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(all)
    }

    /// Checks that a run is possible.
    fn runnable(&self, tone: Tone) -> Result<(), Error> {
        let sine = Sine { amplitude: 1.0, frequency: tone.frequency(), zero: 0.0 };
        Ok(self.plan.excited(&self.port, sine, self.plan.settings(), CoarseSteps::default()).map(drop)?)
    }

    /// The responses at a frequency.
    fn point(&self, tone: Tone) -> Result<FrequencyPoint, Error> {
        let (varies, any) = self.plan.varies_steps();
        let mut fine = 1;
        while any && f64::from(fine) < STEPS * tone.frequency() * tone.step {
            fine *= 2;
        }
        let measure = |amplitude: f64, fine: u32| self.measure(tone, amplitude, fine, varies);
        let change = |a: &Measured, b: &Measured| apart(&a.values, &b.values, &vec![0.0; a.values.len()]);
        let mut amplitude = match self.excitation.amplitude {
            Some(amplitude) => amplitude,
            None => 0.01 * self.plan.magnitude(&self.port)?,
        };
        let mut found = measure(amplitude, fine)?;
        let mut nonlinear = change(&found, &measure(0.5 * amplitude, fine)?);
        let reductions = if self.excitation.amplitude.is_some() { 0 } else { REDUCTIONS.0 };
        let mut next = amplitude;
        for _ in 0..reductions {
            if nonlinear <= REDUCTIONS.1 {
                break;
            }
            next *= 0.25;
            let smaller = measure(next, fine)?;
            let then = change(&smaller, &measure(0.5 * next, fine)?);
            if then < nonlinear || nonlinear.is_nan() {
                (amplitude, found, nonlinear) = (next, smaller, then);
            }
        }
        let half = any.then(|| measure(amplitude, 2 * fine)).transpose()?;
        let Measured { values, mut unsettled, mut watched, warning } = found;
        let stepped = half.as_ref().map(|half| apart(&values, &half.values, &vec![0.0; values.len()]));
        let values = match half {
            Some(half) => {
                unsettled = unsettled.max(half.unsettled);
                watched = watched.iter().zip(&half.watched).map(|(a, b)| a.max(*b)).collect();
                values.iter().zip(half.values).map(|(a, b)| 2.0 * b - a).collect()
            }
            None => values,
        };
        let frequency = tone.frequency();
        Ok(FrequencyPoint { frequency, amplitude, values, watched, nonlinear, unsettled, stepped, warning })
    }

    /// Measures with `fine` communication steps in each of the plan.
    fn measure(&self, tone: Tone, amplitude: f64, fine: u32, varies: bool) -> Result<Measured, Error> {
        let Settings { start, step, sequential, .. } = *self.plan.settings();
        let window = Periods { samples: tone.window.samples * fine, ..tone.window };
        let length = f64::from(tone.window.samples) * step;
        let most = (self.settle / length).ceil().clamp(WINDOWS.0, WINDOWS.1);
        let before = (self.settle / step - 1e-6).ceil().max(0.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        let before = if before < 1e9 {
            before as u32
        } else {
            return invalid(format!("settling time {} s: too long", self.settle));
        };
        let zero = start + f64::from(before) * step;
        let sine = Sine { amplitude, frequency: tone.frequency(), zero };
        let short = step / f64::from(fine);
        let approach = if varies && fine > 1 { CoarseSteps { steps: before, step } } else { CoarseSteps::default() };
        let skipped = if approach.steps > 0 { before } else { before * fine };
        let from = if approach.steps > 0 { zero } else { start };
        let settings = Settings { start: from, stop: zero + (most + 1.0) * length, step: short, sequential };
        let plan = Arc::new(self.plan.excited(&self.port, sine, &settings, approach)?);
        let signals = self.plan.columns().len();
        let over = usize::from(self.excitation.over.is_some());
        let outputs = self.excitation.outputs.len();
        let watched = over + outputs;
        let mut point = 0_u32;
        let (mut fits, mut last) = (vec![SineFit::default(); watched], None::<Vec<SineFit>>);
        let mut largest = vec![0.0_f64; signals - watched];
        let (mut values, mut unsettled, mut windows) = (Vec::new(), f64::INFINITY, 0_u32);
        let mut worker = plan.worker()?;
        worker.hear(true);
        worker
            .run([] as [(&_, f64); 0], |time, row| {
                journal::reached(time);
                let at = point;
                point += 1;
                if at < skipped {
                    return ControlFlow::Continue(());
                }
                let k = (at - skipped) % window.samples;
                if k == 0 && at > skipped {
                    if let Some(last) = &last {
                        let phasor = |(fit, last): (&SineFit, &SineFit)| fit.phasor(last, window);
                        let phasors: Vec<Complex64> = fits.iter().zip(last).map(phasor).collect();
                        let by = if over > 0 { phasors[0] } else { Complex64::new(amplitude, 0.0) };
                        // Rounding of a large constant part is not a response.
                        let floors: Vec<f64> =
                            fits[over..].iter().map(|fit| 1e-11 * fit.largest() / by.norm()).collect();
                        let now: Vec<Complex64> = phasors[over..].iter().map(|x| x / by).collect();
                        if !values.is_empty() {
                            unsettled = apart(&now, &values, &floors);
                        }
                        values = now;
                        windows += 1;
                    }
                    if windows > 1 && (unsettled <= SETTLED || f64::from(windows) >= most) {
                        return ControlFlow::Break(());
                    }
                    last = Some(std::mem::replace(&mut fits, vec![SineFit::default(); watched]));
                }
                let wave = window.wave(k);
                fits.iter_mut().zip(row).for_each(|(fit, x)| fit.add(wave, x.real()));
                largest.iter_mut().zip(&row[watched..]).for_each(|(most, x)| *most = most.max(x.real().abs()));
                ControlFlow::Continue(())
            })
            .map_err(Error::from)
            .and_then(|ended| match ended.by {
                Some(name) => invalid(format!("{name} ended the simulation at {} s", ended.time)),
                None if values.iter().any(|x| !x.is_finite()) => invalid("a measured variable is not finite"),
                None => {
                    Ok(Measured { values, unsettled, watched: largest, warning: worker.warnings().into_iter().next() })
                }
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_are_added_where_the_response_bends() {
        let point = |f: f64| {
            let values = vec![1.0 / Complex64::new(1.0 - f * f / 1e4, 2e-3 * f)];
            let point = FrequencyPoint {
                frequency: f,
                amplitude: 1.0,
                values,
                watched: vec![],
                nonlinear: 0.0,
                unsettled: 0.0,
                stepped: None,
                warning: None,
            };
            (f, Ok(point))
        };
        let outcomes: Vec<FrequencyOutcome> = usual(1e-3).into_iter().map(point).collect();
        let added = bends(&outcomes);
        assert!(!added.is_empty() && added.iter().all(|f| (50.0..200.0).contains(f)), "{added:?}");
    }

    #[test]
    fn a_tone_has_whole_periods_of_whole_steps() {
        for (f, expected) in [(100.0, 100.0), (743.0, 743.0), (2000.0, 2000.0), (3.1, 3.1), (4444.0, 4444.0)] {
            let tone = Tone::near(f, 1e-4).unwrap();
            assert!((tone.frequency() / expected - 1.0).abs() < 1e-3, "{f}: {tone:?}");
        }
        assert_eq!(Tone::near(2000.0, 1e-4).unwrap().window, Periods { periods: 4, samples: 20 });
        let usual = usual(1e-4);
        assert!((usual[0] - 2.0).abs() < 1e-9 && (usual[30] - 2000.0).abs() < 1e-9 && usual.len() == 31);
    }
}
