//! Model Exchange: all FMUs of a system as one system of differential equations with events.
//!
//! At every evaluation all FMUs get time and states, and outputs are passed on to continuous inputs until nothing changes.
//! Discrete inputs are set in event mode alone. At an event of any FMU, all FMUs enter event mode; outputs are passed on before
//! the first update of discrete states, and after each (FMI 2.0.5, 3.2; FMI 3.0.2, 3.2). A point of a schedule is an event too.

use super::exchange::{Exchange, Inputs};
use super::grid::Grid;
use super::iteration::{Iterated, iterate};
use super::method::Integration;
use super::run::{Ended, Point, end};
use crate::integration::{Driver, Hybrid, Trial};
use crate::{CompletedStep, Error, Instance, Update};
use std::ops::{ControlFlow, Range};

/// The FMUs as one system.
struct Fmus<'a> {
    instances: &'a mut [Instance],
    exchange: &'a mut Exchange,
    integration: &'a Integration,
    /// Where the states and the indicators of each instance are.
    states: Vec<Range<usize>>,
    indicators: Vec<Range<usize>>,
    /// Which instances ask for completed steps.
    completes: Vec<bool>,
    nominals: Vec<f64>,
    /// Order of updates.
    order: Vec<usize>,
    outcomes: Vec<Iterated>,
    /// Time and states that the FMUs have; the time is NaN when they are not known.
    t: f64,
    x: Vec<f64>,
    /// The FMUs are in event mode from their initialization.
    initial: bool,
    /// Index of the instance that asked to end the simulation.
    ended_by: Option<usize>,
}

impl<'a> Fmus<'a> {
    fn new(
        instances: &'a mut [Instance],
        exchange: &'a mut Exchange,
        integration: &'a Integration,
    ) -> Result<Self, Error> {
        let (mut states, mut indicators, mut completes) = (Vec::new(), Vec::new(), Vec::new());
        let (mut n, mut n_z) = (0, 0);
        for instance in instances.iter_mut() {
            let (own, own_z) = instance.state_and_indicator_counts()?;
            states.push(n..n + own);
            indicators.push(n_z..n_z + own_z);
            (n, n_z) = (n + own, n_z + own_z);
            let description = instance.description();
            let asks = |i: &model_description::Interface| i.needs_completed_integrator_step(description.version);
            completes.push(description.model_exchange.as_ref().is_some_and(asks));
        }
        let mut order: Vec<usize> = (0..instances.len()).collect();
        if integration.reversed {
            order.reverse();
        }
        let mut fmus = Self {
            outcomes: vec![Iterated::default(); instances.len()],
            nominals: vec![1.0; n],
            x: vec![0.0; n],
            t: f64::NAN,
            initial: true,
            ended_by: None,
            instances,
            exchange,
            integration,
            states,
            indicators,
            completes,
            order,
        };
        (0..fmus.instances.len()).try_for_each(|i| fmus.read_nominals(i))?;
        Ok(fmus)
    }

    fn read_nominals(&mut self, index: usize) -> Result<(), Error> {
        let (range, instance) = (self.states[index].clone(), &mut self.instances[index]);
        instance.get_nominals(&mut self.nominals[range.clone()])?;
        let bad = |x: &f64| !(*x > 0.0 && x.is_finite());
        match self.nominals[range].iter().position(bad) {
            Some(i) => {
                let value = self.nominals[self.states[index].start + i];
                let cause = format!("the nominal of {} is {value}, must be positive and finite", self.state(index, i));
                Err(Error::usage(self.instances[index].name(), cause))
            }
            None => Ok(()),
        }
    }

    /// The name of a state of an instance; its number, from 1, where the description does not name it.
    fn state(&self, instance: usize, state: usize) -> String {
        let (description, count) = (self.instances[instance].description(), self.states[instance].len());
        match description.states().get(state) {
            Some(variable) if description.states().len() == count => format!("state {}", variable.name),
            _ => format!("state number {}", state + 1),
        }
    }

    /// The first value that is not finite, as an error.
    fn finite(&self, what: &str, values: &[f64], t: f64) -> Result<(), Error> {
        let Some(at) = values.iter().position(|x| !x.is_finite()) else { return Ok(()) };
        let Some(index) = self.states.iter().position(|range| range.contains(&at)) else { return Ok(()) };
        let state = self.state(index, at - self.states[index].start);
        Err(Error::usage(self.instances[index].name(), format!("{what}{state} is {} at t = {t} s", values[at])))
    }

    /// Gives the FMUs this time, these states and the inputs that follow.
    fn place(&mut self, t: f64, x: &[f64]) -> Result<(), Trial> {
        let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
        if t.to_bits() == self.t.to_bits() && same(&self.x, x) {
            return Ok(());
        }
        self.finite("", x, t).map_err(Trial::Discard)?;
        self.t = f64::NAN;
        for (instance, range) in self.instances.iter_mut().zip(&self.states) {
            instance.set_time(t).map_err(trial)?;
            instance.set_continuous_states(&x[range.clone()]).map_err(trial)?;
        }
        self.exchange.settle(self.instances, t, Inputs::Continuous).map_err(trial)?;
        self.t = t;
        self.x.copy_from_slice(x);
        Ok(())
    }

    /// Time (s) of the next event after `t`.
    fn next_event(&self, t: f64) -> Option<f64> {
        let own = self.outcomes.iter().filter_map(|outcome| outcome.next).map(|next| next + self.integration.late);
        let extra = self.integration.extra_events.iter().copied().find(|&time| time > t);
        own.chain(extra).chain(self.exchange.next_point(t)).reduce(f64::min)
    }
}

/// A discarded call can be tried again with a shorter step.
fn trial(error: Error) -> Trial {
    if error.is_discard() { Trial::Discard(error) } else { Trial::Stop(error) }
}

impl Hybrid for Fmus<'_> {
    fn nominals(&self) -> &[f64] {
        &self.nominals
    }

    fn name(&self, t: f64) -> String {
        let due = self.outcomes.iter().position(|outcome| outcome.next.is_some_and(|next| next <= t));
        due.map_or_else(|| "events".into(), |index| self.instances[index].name().into())
    }

    fn indicator_count(&self) -> usize {
        self.indicators.last().map_or(0, |range| range.end)
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Trial> {
        self.place(t, x)?;
        for (instance, range) in self.instances.iter_mut().zip(&self.states) {
            instance.get_derivatives(&mut dx[range.clone()]).map_err(trial)?;
        }
        self.finite("the derivative of ", dx, t).map_err(Trial::Discard)
    }

    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<(), Trial> {
        self.place(t, x)?;
        for (instance, range) in self.instances.iter_mut().zip(&self.indicators) {
            instance.get_event_indicators(&mut z[range.clone()]).map_err(trial)?;
        }
        Ok(())
    }

    fn completed_step(&mut self, t: f64, x: &[f64]) -> Result<CompletedStep, Error> {
        let mut all = CompletedStep::default();
        if !self.completes.contains(&true) {
            return Ok(all);
        }
        self.place(t, x).map_err(Trial::into_error)?;
        for (index, instance) in self.instances.iter_mut().enumerate().filter(|(i, _)| self.completes[*i]) {
            let one = instance.completed_integrator_step()?;
            all.enter_event_mode |= one.enter_event_mode;
            if one.terminate {
                (all.terminate, self.ended_by) = (true, Some(index));
            }
        }
        Ok(all)
    }

    fn event(&mut self, t: f64, x: &mut [f64]) -> Result<Update, Error> {
        let first = std::mem::replace(&mut self.initial, false);
        if !first {
            self.place(t, x).map_err(Trial::into_error)?;
            self.instances.iter_mut().try_for_each(Instance::enter_event_mode)?;
        }
        self.t = f64::NAN;
        self.exchange.since = Some(t);
        let Self { instances, exchange, order, outcomes, .. } = self;
        let pass_on = |instances: &mut [Instance]| exchange.settle(instances, t, Inputs::All);
        self.ended_by = iterate(instances, order, outcomes, t, pass_on)?;
        if self.ended_by.is_some() {
            return Ok(Update { terminate: true, ..Update::default() });
        }
        for index in 0..self.instances.len() {
            let instance = &mut self.instances[index];
            instance.enter_continuous_time_mode()?;
            if first || self.outcomes[index].states_changed {
                instance.get_continuous_states(&mut x[self.states[index].clone()])?;
            }
            if self.outcomes[index].nominals_changed {
                self.read_nominals(index)?;
            }
        }
        self.finite("", x, t)?;
        Ok(Update { next_event_time: self.next_event(t), ..Update::default() })
    }
}

/// Simulates instances that are initialized and in event mode; [`simulate`](super::run::simulate) begins and ends the run.
pub(super) fn run(
    instances: &mut [Instance],
    exchange: &mut Exchange,
    grid: &Grid,
    integration: &Integration,
    row: &mut Vec<f64>,
    hook: &mut impl FnMut(&mut Point<'_>) -> Result<ControlFlow<()>, Error>,
) -> Result<Ended, Error> {
    let start = grid.settings().start;
    let mut ended = Ended { time: start, by: None };
    let mut fmus = Fmus::new(instances, exchange, integration)?;
    let (mut driver, mut flow) = Driver::start(&mut fmus, integration.solver, grid.settings().step, start)?;
    for index in 0..=grid.steps() {
        let time = grid.time(index);
        if index > 0 {
            flow = driver.run_to(&mut fmus, time)?;
        }
        if flow.is_break() {
            ended.by = fmus.ended_by.map(|i| fmus.instances[i].name().to_owned());
            let last = driver.point().0;
            end(fmus.instances, fmus.exchange, row, hook, (index, last), &mut ended)?;
            break;
        }
        ended.time = time;
        let (t, x) = driver.point();
        fmus.place(t, x).map_err(Trial::into_error)?;
        fmus.exchange.read_all(fmus.instances)?;
        fmus.exchange.row(t, row);
        let mut point = Point { index, time, values: row, instances: fmus.instances, touched: false };
        if hook(&mut point)?.is_break() {
            break;
        }
        if point.touched {
            // The hook may have set what the derivatives depend on.
            fmus.t = f64::NAN;
            driver.forget();
        }
    }
    Ok(ended)
}
