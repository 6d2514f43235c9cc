//! Steps a system to communication points and handles its events.

use super::hybrid::{HybridSystem, TrialError};
use super::locate::{crossed, first_crossing};
use super::stability::Stability;
use super::steps::Step;
use super::{dopri, rk4};
use fmu_import::Error;
use std::ops::ControlFlow;

/// Maximum number of events at one instant.
const EVENTS: u32 = 100;
/// Number of steps between two checks of the progress towards the target.
const STEPS_CHECKED: u32 = 100_000;
/// Maximum number of steps towards a target, extrapolated from the progress so far. A billion takes a quarter of an hour or more.
const MOST_STEPS: f64 = 1e9;
/// Width of the interval in which a state event is located, relative to the step.
const WIDTH: f64 = 1e-10;

/// The integration method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solver {
    /// The classical Runge-Kutta method of order 4, with the communication step as its step; a step cut by an event, an input
    /// or a communication point is shorter.
    Rk4,
    /// The method of Dormand and Prince of order 5, with an adaptive step.
    Dopri {
        /// Relative tolerance of a step; the absolute one is this times the nominal value of each state.
        rtol: f64,
    },
}

impl Default for Solver {
    /// Adaptive, with a relative tolerance of 1e-6.
    fn default() -> Self {
        Self::Dopri { rtol: 1e-6 }
    }
}

impl Solver {
    /// Relative tolerance, if the step is adaptive.
    pub(crate) fn tolerance(&self) -> Option<f64> {
        match self {
            Self::Rk4 => None,
            Self::Dopri { rtol } => Some(*rtol),
        }
    }
}

/// The reason why the driver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The target is reached.
    Target,
    /// An event was handled, at or before the target.
    Event,
    /// The system requests the end of the simulation.
    End,
}

impl StopReason {
    fn of(flow: ControlFlow<()>, otherwise: Self) -> Self {
        if flow.is_break() { Self::End } else { otherwise }
    }
}

/// The state of an integration.
pub struct Driver {
    solver: Solver,
    /// Longest step of a fixed-step solver in s.
    longest: f64,
    step: Step,
    /// Size of the next step of an adaptive solver in s; infinite before the first.
    proposed: f64,
    /// The derivative at the beginning of the step is known.
    known: bool,
    /// Indicators at the beginning of the step, and at its end.
    z: Vec<f64>,
    z_end: Vec<f64>,
    next_event: Option<f64>,
    /// Number of consecutive events at the same time.
    events: u32,
    last_event: f64,
    stability: Stability,
    pace: Pace,
}

/// The steps towards a target.
struct Pace {
    /// Target in s.
    until: f64,
    /// Where they began, in s.
    from: f64,
    steps: u32,
}

impl Driver {
    /// Begins with the event that ends the initialization; breaks if the system requests the end of the simulation.
    ///
    /// # Errors
    /// The system cannot handle the event.
    pub fn start(
        system: &mut impl HybridSystem,
        solver: Solver,
        longest: f64,
        t: f64,
    ) -> Result<(Self, ControlFlow<()>), Error> {
        let (states, indicators) = (system.nominals().len(), system.indicator_count());
        let mut driver = Self {
            solver,
            longest,
            step: Step::new(states),
            proposed: f64::INFINITY,
            known: false,
            z: vec![0.0; indicators],
            z_end: vec![0.0; indicators],
            next_event: None,
            events: 0,
            last_event: f64::NEG_INFINITY,
            stability: Stability::default(),
            pace: Pace { until: f64::NAN, from: t, steps: 0 },
        };
        driver.step.t = t;
        let flow = driver.event(system)?;
        Ok((driver, flow))
    }

    /// Time in s and states.
    pub fn point(&self) -> (f64, &[f64]) {
        (self.step.t, &self.step.x)
    }

    /// Inputs may have changed: the derivative is computed anew.
    pub fn forget(&mut self) {
        self.known = false;
    }

    /// Integrates to the time `until`, and over an event that differs from it only by rounding. Breaks if the system requests
    /// the end of the simulation.
    ///
    /// # Errors
    /// The system cannot be integrated to that time.
    pub fn run_to(&mut self, system: &mut impl HybridSystem, until: f64) -> Result<ControlFlow<()>, Error> {
        self.all_towards(system, until, true)
    }

    /// Integrates to the time `until`, or to the first event before it or there, which it handles.
    ///
    /// # Errors
    /// As for [`run_to`](Self::run_to).
    pub fn stop_at(&mut self, system: &mut impl HybridSystem, until: f64) -> Result<StopReason, Error> {
        self.towards(system, until, true)
    }

    /// Integrates to the time `until` and leaves the events there to [`interrupt`](Self::interrupt).
    ///
    /// # Errors
    /// As for [`run_to`](Self::run_to).
    pub fn run_before(&mut self, system: &mut impl HybridSystem, until: f64) -> Result<ControlFlow<()>, Error> {
        self.all_towards(system, until, false)
    }

    fn all_towards(
        &mut self,
        system: &mut impl HybridSystem,
        until: f64,
        events_there: bool,
    ) -> Result<ControlFlow<()>, Error> {
        loop {
            match self.towards(system, until, events_there)? {
                StopReason::Target => return Ok(ControlFlow::Continue(())),
                StopReason::Event => {}
                StopReason::End => return Ok(ControlFlow::Break(())),
            }
        }
    }

    fn towards(&mut self, system: &mut impl HybridSystem, until: f64, events_there: bool) -> Result<StopReason, Error> {
        loop {
            let near = near(self.step.t, until);
            let last = if events_there { until + near } else { until - near };
            let (target, event) = match self.next_event {
                Some(next) if next <= last => (next, true),
                _ => (until, false),
            };
            if target - self.step.t > near {
                self.count_a_step(until)?;
                if let Some(stop) = self.advance(system, target)? {
                    return Ok(stop);
                }
            } else if event {
                self.step.t = self.step.t.max(target);
                return Ok(StopReason::of(self.event(system)?, StopReason::Event));
            } else {
                return Ok(StopReason::Target);
            }
        }
    }

    /// Handles an event at the time reached, requested by the system or caused by a change outside it.
    ///
    /// # Errors
    /// The system cannot handle the event.
    pub fn interrupt(&mut self, system: &mut impl HybridSystem) -> Result<ControlFlow<()>, Error> {
        self.event(system)
    }

    /// Counts a step towards the time `until` (s).
    ///
    /// # Errors
    /// The target is out of reach at this pace.
    fn count_a_step(&mut self, until: f64) -> Result<(), Error> {
        let t = self.step.t;
        if self.pace.until.to_bits() != until.to_bits() {
            self.pace = Pace { until, from: t, steps: 0 };
        }
        self.pace.steps = self.pace.steps.saturating_add(1);
        let Pace { from, steps, .. } = self.pace;
        if !steps.is_multiple_of(STEPS_CHECKED) || f64::from(steps) * (until - from) <= MOST_STEPS * (t - from) {
            return Ok(());
        }
        let (passed, why) = (t - from, "the derivatives change too fast, or events follow each other too closely");
        Err(Error::usage(
            "integration",
            format!("{steps} steps from t = {from} s on lead only {passed:.1e} s further: {why}"),
        ))
    }

    /// One step towards `target`, to its end or to the first state event in it, with the event there.
    fn advance(&mut self, system: &mut impl HybridSystem, target: f64) -> Result<Option<StopReason>, Error> {
        if !self.known {
            let Step { t, x, f, .. } = &mut self.step;
            system.derivatives(*t, x, f).map_err(TrialError::into_error)?;
            self.known = true;
        }
        self.accepted_step(system, target)?;
        if self.solver != Solver::Rk4 && self.stability.limits(&self.step, system.nominals()) {
            system.limited(self.step.t, self.step.t_end - self.step.t);
        }
        let mut event = false;
        if !self.z.is_empty() {
            system.indicators(self.step.t_end, &self.step.x_end, &mut self.z_end).map_err(TrialError::into_error)?;
            event = crossed(&self.z, &self.z_end);
        }
        if event {
            self.cut_at_crossing(system)?;
        }
        self.step.accept();
        std::mem::swap(&mut self.z, &mut self.z_end);
        let completed = system.completed_step(self.step.t, &self.step.x)?;
        if completed.terminate {
            return Ok(Some(StopReason::End));
        }
        let event = event || completed.enter_event_mode;
        if event { Ok(Some(StopReason::of(self.event(system)?, StopReason::Event))) } else { Ok(None) }
    }

    /// A step that the system can compute and whose error is small enough.
    fn accepted_step(&mut self, system: &mut impl HybridSystem, target: f64) -> Result<(), Error> {
        let t = self.step.t;
        let rest = target - t;
        let mut h = match self.solver {
            Solver::Rk4 => self.longest,
            Solver::Dopri { rtol } if self.proposed.is_infinite() => self.first_size(rtol, system.nominals()),
            Solver::Dopri { .. } => self.proposed,
        };
        let mut may_grow = true;
        loop {
            // An excess of a millionth is rounding.
            let whole = h >= rest * (1.0 - 1e-6);
            self.step.t_end = if whole { target } else { t + h };
            let size = self.step.t_end - t;
            let tried = match self.solver {
                Solver::Rk4 => rk4::step(system, &mut self.step).map(|()| 0.0),
                Solver::Dopri { rtol } => {
                    dopri::step(system, &mut self.step).map(|()| dopri::error(&self.step, rtol, system.nominals()))
                }
            };
            h = match tried {
                Ok(error) if error <= 1.0 => {
                    let factor = dopri::factor(error);
                    let next = size * if may_grow { factor } else { factor.min(1.0) };
                    // A step cut only by a target does not reduce the previous size.
                    self.proposed = if whole && self.proposed.is_finite() { next.max(self.proposed) } else { next };
                    return Ok(());
                }
                Ok(error) => size * dopri::factor(error).min(0.9),
                Err(TrialError::Discard(_)) => 0.5 * size,
                Err(TrialError::Stop(error)) => return Err(error),
            };
            may_grow = false;
            self.proposed = h;
            if h <= 4.0 * f64::EPSILON * t.abs().max(rest) {
                return Err(match tried {
                    Err(trial) => trial.into_error().during(&format!("every step from t = {t} s, down to {h:e} s")),
                    Ok(_) => Error::usage(
                        "integration",
                        format!(
                            "no step from t = {t} s, down to {h:e} s, reaches the tolerance: the derivatives may jump without an event"
                        ),
                    ),
                });
            }
        }
    }

    /// Size of the very first step: one hundredth of the time in which the states change by their size.
    fn first_size(&self, rtol: f64, nominals: &[f64]) -> f64 {
        let Step { x, f, .. } = &self.step;
        let sizes = nominals.iter().zip(x).zip(f).map(|((nominal, x), f)| 0.01 * nominal.max(x.abs()) / f.abs());
        // The fifth root of the tolerance relates it to the order.
        sizes.fold(f64::INFINITY, f64::min) * (rtol / 1e-6).powf(0.2)
    }

    /// Ends the step just behind the first state event in it.
    fn cut_at_crossing(&mut self, system: &mut impl HybridSystem) -> Result<(), Error> {
        let Self { step, z, z_end, solver, .. } = self;
        let (t, h) = (step.t, step.t_end - step.t);
        let interpolate = match solver {
            Solver::Rk4 => rk4::interpolate,
            Solver::Dopri { .. } => dopri::interpolate,
        };
        let mut x = step.x.clone();
        let width = WIDTH.max(4.0 * f64::EPSILON * t.abs().max(step.t_end.abs()) / h);
        let theta = first_crossing(z, z_end, width, |theta, z| {
            interpolate(step, theta, &mut x);
            system.indicators(t + theta * h, &x, z).map_err(TrialError::into_error)
        })?;
        if theta < 1.0 {
            interpolate(step, theta, &mut x);
            step.t_end = t + theta * h;
            step.x_end.copy_from_slice(&x);
        }
        Ok(())
    }

    /// Handles the event at this time, and restarts.
    fn event(&mut self, system: &mut impl HybridSystem) -> Result<ControlFlow<()>, Error> {
        let t = self.step.t;
        self.events = if t - self.last_event <= near(t, t) { self.events + 1 } else { 1 };
        self.last_event = t;
        let update = system.event(t, &mut self.step.x)?;
        self.known = false;
        self.next_event = update.next_event_time;
        if update.terminate {
            return Ok(ControlFlow::Break(()));
        }
        if self.events > EVENTS {
            let next = self.next_event.map(|next| format!("; the next event time is {next} s")).unwrap_or_default();
            return Err(Error::usage(&system.name(t), format!("more than {EVENTS} events at t = {t} s{next}")));
        }
        if !self.z.is_empty() {
            system.indicators(t, &self.step.x, &mut self.z).map_err(TrialError::into_error)?;
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// Instants that are closer than this (s) are the same: sums and products of times, rounded.
fn near(t: f64, other: f64) -> f64 {
    64.0 * f64::EPSILON * t.abs().max(other.abs())
}
