//! FMUs for Model Exchange as one system of differential equations with events.
//!
//! At every evaluation, all FMUs receive time and states, and a [`Feed`] sets their continuous inputs. Discrete inputs are set
//! only in event mode. At an event of any FMU, all FMUs enter event mode; the feed passes values on before the first update of
//! discrete states, and after each (FMI 2.0.5, 3.2; FMI 3.0.2, 3.2). FMUs for Co-Simulation among them are skipped.

use super::exchange::Inputs;
use super::iteration::{Iterated, iterate};
use super::method::Integration;
use crate::integration::{HybridSystem, TrialError};
use fmu_import::{CompletedStep, Error, Instance, Kind, Update};
use std::ops::Range;

/// Sets the inputs of FMUs for Model Exchange.
pub trait Feed {
    /// Sets inputs at the time `t` (s) until all values are stable; returns whether a discrete input has changed.
    ///
    /// # Errors
    /// An FMU refuses, or the inputs do not settle.
    fn settle(&mut self, instances: &mut [Instance], t: f64, inputs: Inputs) -> Result<bool, Error>;

    /// An event begins at the time `t` (s); the FMUs still have the values before it. The end of the initialization is an
    /// event.
    ///
    /// # Errors
    /// An FMU refuses.
    fn event(&mut self, instances: &mut [Instance], t: f64) -> Result<(), Error>;

    /// Time (s) of the first event of the inputs after `t`.
    fn next_point(&self, t: f64) -> Option<f64>;

    /// Stability limits the steps of the solver, see [`HybridSystem::limited`].
    fn limited(&mut self, _t: f64, _h: f64) {}
}

/// State of the FMUs between two steps, for any number of successive runs.
pub struct Equations {
    integration: Integration,
    /// Ranges of the states and the indicators of each instance.
    states: Vec<Range<usize>>,
    indicators: Vec<Range<usize>>,
    /// Instances that need completed steps.
    completes: Vec<bool>,
    nominals: Vec<f64>,
    /// The instances for Model Exchange in the order of updates.
    order: Vec<usize>,
    outcomes: Vec<Iterated>,
    /// Time and states of the FMUs; the time is NaN when they are unknown.
    t: f64,
    x: Vec<f64>,
    /// The FMUs are in event mode from their initialization.
    initial: bool,
    /// Index of the instance that requested the end of the simulation.
    ended_by: Option<usize>,
}

impl Equations {
    /// Queries instances that are initialized and in event mode.
    ///
    /// # Errors
    /// An FMU refuses, or a nominal value is not positive.
    pub fn new(instances: &mut [Instance], integration: &Integration) -> Result<Self, Error> {
        let (mut states, mut indicators, mut completes) = (Vec::new(), Vec::new(), Vec::new());
        let (mut n, mut n_z) = (0, 0);
        for instance in instances.iter_mut() {
            let exchanges = instance.kind() == Kind::ModelExchange;
            let (own, own_z) = if exchanges { instance.state_and_indicator_counts()? } else { (0, 0) };
            states.push(n..n + own);
            indicators.push(n_z..n_z + own_z);
            (n, n_z) = (n + own, n_z + own_z);
            let description = instance.description();
            let asks = |i: &model_description::Interface| i.needs_completed_integrator_step(description.version);
            completes.push(exchanges && description.model_exchange.as_ref().is_some_and(asks));
        }
        let mut order: Vec<usize> =
            (0..instances.len()).filter(|&i| instances[i].kind() == Kind::ModelExchange).collect();
        if integration.reversed {
            order.reverse();
        }
        let mut equations = Self {
            outcomes: vec![Iterated::default(); instances.len()],
            nominals: vec![1.0; n],
            x: vec![0.0; n],
            t: f64::NAN,
            initial: true,
            ended_by: None,
            integration: integration.clone(),
            states,
            indicators,
            completes,
            order,
        };
        for (index, instance) in instances.iter_mut().enumerate() {
            equations.read_nominals(index, instance)?;
        }
        Ok(equations)
    }

    fn read_nominals(&mut self, index: usize, instance: &mut Instance) -> Result<(), Error> {
        let range = self.states[index].clone();
        instance.get_nominals(&mut self.nominals[range.clone()])?;
        let bad = |x: &f64| !(*x > 0.0 && x.is_finite());
        match self.nominals[range.clone()].iter().position(bad) {
            Some(i) => {
                let (value, state) = (self.nominals[range.start + i], self.state(instance, index, i));
                Err(Error::usage(
                    instance.name(),
                    format!("the nominal of {state} is {value}, must be positive and finite"),
                ))
            }
            None => Ok(()),
        }
    }

    /// The name of a state of an instance, or its number, from 1, if the description does not name it.
    fn state(&self, instance: &Instance, index: usize, state: usize) -> String {
        let (description, count) = (instance.description(), self.states[index].len());
        match description.states().get(state) {
            Some(variable) if description.states().len() == count => format!("state {}", variable.name),
            _ => format!("state number {}", state + 1),
        }
    }

    /// The first value that is not finite, as an error.
    fn finite(&self, instances: &[Instance], what: &str, values: &[f64], t: f64) -> Result<(), Error> {
        // 0 times a non-finite number is NaN: a single branch, because this runs twice in an evaluation.
        if values.iter().map(|x| 0.0 * x).sum::<f64>() == 0.0 {
            return Ok(());
        }
        let Some(at) = values.iter().position(|x| !x.is_finite()) else { return Ok(()) };
        let Some(index) = self.states.iter().position(|range| range.contains(&at)) else { return Ok(()) };
        let state = self.state(&instances[index], index, at - self.states[index].start);
        Err(Error::usage(instances[index].name(), format!("{what}{state} is {} at t = {t} s", values[at])))
    }

    /// Index of the instance that requested the end of the simulation.
    pub fn ended_by(&self) -> Option<usize> {
        self.ended_by
    }

    /// Other code has used the FMUs: their time and states are unknown.
    pub fn forget(&mut self) {
        self.t = f64::NAN;
    }

    /// The system for the next calls, with its instances.
    pub fn of<'a, F: Feed>(&'a mut self, instances: &'a mut [Instance], feed: &'a mut F) -> Fmus<'a, F> {
        Fmus { equations: self, instances, feed }
    }
}

/// The FMUs as one system.
pub struct Fmus<'a, F> {
    pub(super) equations: &'a mut Equations,
    pub(super) instances: &'a mut [Instance],
    pub(super) feed: &'a mut F,
}

impl<F: Feed> Fmus<'_, F> {
    /// Sets this time, these states and the resulting inputs in the FMUs.
    ///
    /// # Errors
    /// An FMU refuses.
    pub fn place(&mut self, t: f64, x: &[f64]) -> Result<(), TrialError> {
        let Self { equations, instances, feed } = self;
        let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
        if t.to_bits() == equations.t.to_bits() && same(&equations.x, x) {
            return Ok(());
        }
        equations.finite(instances, "", x, t).map_err(TrialError::Discard)?;
        equations.t = f64::NAN;
        for &index in &equations.order {
            instances[index].set_time(t).map_err(trial)?;
            instances[index].set_continuous_states(&x[equations.states[index].clone()]).map_err(trial)?;
        }
        feed.settle(instances, t, Inputs::Continuous).map_err(trial)?;
        equations.t = t;
        equations.x.copy_from_slice(x);
        Ok(())
    }

    /// Time (s) of the next event after `t`.
    fn next_event(&self, t: f64) -> Option<f64> {
        let Equations { outcomes, integration, .. } = &*self.equations;
        let own = outcomes.iter().filter_map(|outcome| outcome.next).map(|next| next + integration.late);
        let extra = integration.extra_events.iter().copied().find(|&time| time > t);
        own.chain(extra).chain(self.feed.next_point(t)).reduce(f64::min)
    }
}

/// A discarded call can be tried again with a shorter step.
fn trial(error: Error) -> TrialError {
    if error.is_discard() { TrialError::Discard(error) } else { TrialError::Stop(error) }
}

impl<F: Feed> HybridSystem for Fmus<'_, F> {
    fn nominals(&self) -> &[f64] {
        &self.equations.nominals
    }

    fn name(&self, t: f64) -> String {
        let due = self.equations.outcomes.iter().position(|outcome| outcome.next.is_some_and(|next| next <= t));
        due.map_or_else(|| "events".into(), |index| self.instances[index].name().into())
    }

    fn indicator_count(&self) -> usize {
        self.equations.indicators.last().map_or(0, |range| range.end)
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), TrialError> {
        self.place(t, x)?;
        for (instance, range) in self.instances.iter_mut().zip(&self.equations.states) {
            instance.get_derivatives(&mut dx[range.clone()]).map_err(trial)?;
        }
        self.equations.finite(self.instances, "the derivative of ", dx, t).map_err(TrialError::Discard)
    }

    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<(), TrialError> {
        self.place(t, x)?;
        for (instance, range) in self.instances.iter_mut().zip(&self.equations.indicators) {
            instance.get_event_indicators(&mut z[range.clone()]).map_err(trial)?;
        }
        Ok(())
    }

    fn completed_step(&mut self, t: f64, x: &[f64]) -> Result<CompletedStep, Error> {
        let mut all = CompletedStep::default();
        if !self.equations.completes.contains(&true) {
            return Ok(all);
        }
        self.place(t, x).map_err(TrialError::into_error)?;
        for (index, instance) in self.instances.iter_mut().enumerate() {
            if !self.equations.completes[index] {
                continue;
            }
            let one = instance.completed_integrator_step()?;
            all.enter_event_mode |= one.enter_event_mode;
            if one.terminate {
                (all.terminate, self.equations.ended_by) = (true, Some(index));
            }
        }
        Ok(all)
    }

    fn event(&mut self, t: f64, x: &mut [f64]) -> Result<Update, Error> {
        let first = std::mem::replace(&mut self.equations.initial, false);
        if !first {
            self.place(t, x).map_err(TrialError::into_error)?;
        }
        let Self { equations, instances, feed } = self;
        feed.event(instances, t)?;
        if !first {
            equations.order.iter().try_for_each(|&index| instances[index].enter_event_mode())?;
        }
        equations.t = f64::NAN;
        let pass_on = |instances: &mut [Instance]| feed.settle(instances, t, Inputs::All);
        equations.ended_by = iterate(instances, &equations.order, &mut equations.outcomes, t, pass_on)?;
        if equations.ended_by.is_some() {
            return Ok(Update { terminate: true, ..Update::default() });
        }
        for k in 0..equations.order.len() {
            let index = equations.order[k];
            let instance = &mut instances[index];
            instance.enter_continuous_time_mode()?;
            if first || equations.outcomes[index].states_changed {
                instance.get_continuous_states(&mut x[equations.states[index].clone()])?;
            }
            if equations.outcomes[index].nominals_changed {
                equations.read_nominals(index, instance)?;
            }
        }
        equations.finite(instances, "", x, t)?;
        Ok(Update { next_event_time: self.next_event(t), ..Update::default() })
    }

    fn limited(&mut self, t: f64, h: f64) {
        self.feed.limited(t, h);
    }
}
