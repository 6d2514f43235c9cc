//! Model Exchange and Event Mode: the importer integrates the states and handles the events (FMI 2.0.5, 3.1 and 3.2;
//! FMI 3.0.2, 2.3.5, 3.1 and 3.2).

use crate::clocks::Tick;
use crate::habit::Habit;
use crate::instance::{Instance, Refusal};
use crate::lifecycle::{Standard, State};
use crate::message;
use fmu_core::{Account, Elapsed, Exported, Fault, Interface, Model, Next, Outcome, SampleGrid};

/// Maximum number of updates of one event that an instance performs by itself.
pub(crate) const MAX_ITERATIONS: usize = 100;

/// The result of an update of the discrete states.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Updated {
    /// What the event did.
    pub outcome: Outcome,
    /// Time in s of the next time event, if any.
    pub next: Option<f64>,
}

impl<E: Exported> Instance<E> {
    /// Event Mode begins.
    ///
    /// # Errors
    /// The model reports an error.
    pub fn enter_event(&mut self) -> Result<(), Fault> {
        let again = self.standard == Standard::Fmi3 && self.current.life.state() == State::Event;
        if again {
            self.forgive(Habit::Event);
            if self.current.end <= self.current.settled {
                return Ok(());
            }
        }
        self.complete(true)?;
        let current = &mut self.current;
        current.settled = current.completed;
        current.pending = true;
        if const { E::CAN.clocked.is_some() } {
            current.ticks.iter_mut().flatten().for_each(Tick::begin);
        }
        if let Some(events) = &E::CAN.events {
            (events.begin)(&mut current.block.model, current.elapsed);
        }
        self.changed();
        Ok(())
    }

    /// In Model Exchange, informs the model that the solution passes through the present point, where an `event` begins or
    /// ends, or a step is complete.
    fn complete(&mut self, event: bool) -> Result<(), Fault> {
        let current = &mut self.current;
        // Some solvers complete every iteration at a point; the last one counts.
        let again = !event && current.end <= current.completed && current.completed > current.settled;
        current.completed = current.completed.max(current.end);
        if let Some(completing) = &E::CAN.complete
            && current.life.interface() == Interface::ModelExchange
        {
            let (model, now) = (&mut current.block.model, current.elapsed);
            if again {
                (completing.account)(model, Account::Again(now));
            }
            (completing.complete)(model, now)?;
            (completing.account)(model, if event { Account::Event(now) } else { Account::Step(now) });
            self.stale = true;
        }
        Ok(())
    }

    /// Updates the discrete states with the present inputs. Tunable parameters take effect here, all together.
    ///
    /// # Errors
    /// Tunable parameters that do not fit together, or an error of the model.
    pub fn update_discrete(&mut self) -> Result<Updated, Fault> {
        self.stale |= self.exchanges();
        let current = &mut self.current;
        if current.dirty {
            current.adopt(&E::CAN)?;
            current.dirty = false;
        }
        let mut update = Updated::default();
        if const { E::CAN.clocked.is_some() } {
            self.tick_all()?;
        }
        let current = &mut self.current;
        if let Some(events) = &E::CAN.events {
            let (model, now) = (&mut current.block.model, current.elapsed);
            update.outcome = (events.event)(model, now)?;
            let start = current.experiment.map_or(0.0, |e| e.start);
            let next = (events.next)(model, now);
            if !update.outcome.again && next.is_due(now) {
                let at = current.end;
                return Err(Fault::new(format!(
                    "after the event at {at} s the next one is due at once: an error of the model"
                )));
            }
            update.next = match next {
                Next::Never => None,
                Next::Grid { k, period } => Some(SampleGrid { period }.instant(k, start)),
                Next::At(time) => Some(start + time.seconds()),
            };
        }
        self.current.pending = update.outcome.again;
        self.changed();
        self.warn();
        Ok(update)
    }

    /// Leaves Event Mode; an event that the importer did not update, and tunable parameters set since, are processed now.
    ///
    /// # Errors
    /// As [`update_discrete`](Self::update_discrete); an event that does not settle.
    pub fn leave_event(&mut self) -> Result<(), Fault> {
        if !self.begun {
            self.warn_of_unfed();
        }
        for _ in 0..MAX_ITERATIONS {
            if !self.current.pending && !self.current.dirty {
                // The importer may have advanced the time since the event began, and can go back to it.
                return self.complete(self.current.end <= self.current.settled);
            }
            self.update_discrete()?;
        }
        Err(Fault::new(format!("the event at {} s does not settle", self.current.end)))
    }

    /// Marks the outputs as old; in Model Exchange, the next getter recomputes them.
    fn changed(&mut self) {
        if self.exchanges() {
            self.stale = true;
        } else {
            let current = &mut self.current;
            current.block.model.output(current.elapsed, &mut current.block.out);
        }
    }

    /// Sets the time (s).
    ///
    /// # Errors
    /// Not a finite number, or before the last event. There is no check against the stop time: solvers try times beyond it.
    pub fn set_time(&mut self, t: f64) -> Result<(), Fault> {
        let current = &mut self.current;
        if !(t.is_finite() && t >= current.settled - rounding(current.settled)) {
            let allowed = format_args!("finite and not before {}, the last event", current.settled);
            return Err(Fault::value("time", t, allowed));
        }
        let start = current.experiment.map_or(0.0, |e| e.start);
        (current.elapsed, current.end) = (Elapsed::between(start, t.max(start)), t.max(start));
        self.stale = true;
        if t < self.current.completed - rounding(self.current.completed) {
            self.go_back();
        }
        if self.standard == Standard::Fmi3 && self.current.life.state() == State::Event {
            self.forgive(Habit::Time);
        }
        Ok(())
    }

    /// Discards counts after the present time.
    #[cold]
    fn go_back(&mut self) {
        self.forgive(Habit::Back);
        let current = &mut self.current;
        current.completed = current.end.max(current.settled);
        if let Some(completing) = &E::CAN.complete {
            (completing.account)(&mut current.block.model, Account::Back(current.elapsed));
        }
    }

    /// An integrator step is complete.
    ///
    /// # Errors
    /// The model reports an error.
    pub fn completed_step(&mut self) -> Result<(), Fault> {
        self.complete(false)?;
        self.warn();
        Ok(())
    }

    /// Sets all states.
    ///
    /// # Errors
    /// The array does not have one element for each state (Error); a state that is out of its range or not finite (Discard):
    /// the instance is unchanged.
    #[inline]
    pub fn set_states(&mut self, x: &[f64]) -> Result<(), Refusal> {
        count("nContinuousStates", x.len(), self.state_count())?;
        if let Some((i, number)) = self.first_refused(x) {
            let name = E::CAN.state_of(number).map_or("a state", |(state, _)| state.name);
            return Err(Refusal::Discard(Fault::value(name, x[i], self.ranges[number])));
        }
        if self.current.life.state() != State::Continuous && self.keeps_states(x) {
            return Ok(());
        }
        let mut values = x.iter();
        E::CAN.each_state(&mut self.current.block.model, |_, place| {
            if let Some(x) = values.next() {
                *place = *x;
            }
        });
        self.settle();
        self.stale = true;
        Ok(())
    }

    /// Outside of Continuous-Time Mode: whether the states already have these values.
    #[cold]
    fn keeps_states(&mut self, x: &[f64]) -> bool {
        self.forgive(Habit::States);
        self.refresh_initial();
        let (mut values, mut equal) = (x.iter(), true);
        E::CAN.each_state(&mut self.current.block.model, |_, held| equal &= values.next() == Some(&*held));
        self.current.stated |= !equal && self.current.life.state() == State::Initialization;
        equal
    }

    /// The first value that is not in the range of its state, with the number of that state.
    #[inline]
    fn first_refused(&mut self, x: &[f64]) -> Option<(usize, usize)> {
        if const { !E::CAN.has_arrays() } {
            let refused = x.iter().zip(&self.ranges).position(|(x, range)| !range.contains(*x));
            return refused.map(|i| (i, i));
        }
        let (mut values, ranges, mut refused) = (x.iter().enumerate(), &self.ranges, None);
        E::CAN.each_state(&mut self.current.block.model, |number, _| {
            if let Some((i, _)) = values.next().filter(|(_, x)| !ranges[number].contains(**x)) {
                refused = refused.or(Some((i, number)));
            }
        });
        refused
    }

    /// Sets one state of a model with several, by its number: in Model Exchange, or its start value.
    pub(crate) fn set_state(&mut self, number: usize, x: f64) {
        if let Some(place) = E::CAN.scalar(&mut self.current.block.model, number) {
            *place = x;
        }
        self.settle();
    }

    fn settle(&mut self) {
        if let Some(continuous) = &E::CAN.continuous {
            (continuous.settle)(&mut self.current.block.model);
        }
    }

    /// Reads all states.
    ///
    /// # Errors
    /// The array does not have one element for each state.
    pub fn get_states(&mut self, out: &mut [f64]) -> Result<(), Fault> {
        count("nContinuousStates", out.len(), self.state_count())?;
        self.refresh_initial();
        let mut places = out.iter_mut();
        E::CAN.each_state(&mut self.current.block.model, |_, x| {
            if let Some(place) = places.next() {
                *place = *x;
            }
        });
        Ok(())
    }

    /// Reads the derivatives of all states.
    ///
    /// # Errors
    /// The array does not have one element for each state (Error); derivatives that do not exist or are not finite (Discard).
    #[inline]
    pub fn derivatives(&mut self, dx: &mut [f64]) -> Result<(), Refusal> {
        count("nContinuousStates", dx.len(), self.state_count())?;
        self.refresh_initial();
        let Some(continuous) = &E::CAN.continuous else { return Ok(()) };
        (continuous.derivatives)(&self.current.block.model, self.current.elapsed, dx).map_err(Refusal::Discard)?;
        match dx.iter().position(|x| !x.is_finite()) {
            None => Ok(()),
            Some(i) => {
                let name = message::calculated::<E>(self.number_of_state(i));
                Err(Refusal::Discard(Fault::value(&name, dx[i], "a finite number")))
            }
        }
    }

    /// In Initialization Mode, lets parameters and inputs take effect.
    #[inline]
    fn refresh_initial(&mut self) {
        if self.current.life.state() == State::Initialization {
            self.refresh();
        }
    }

    /// Reads the event indicators.
    ///
    /// # Errors
    /// The array does not have one element for each indicator (Error); indicators that are not a number (Discard).
    #[inline]
    pub fn indicators(&mut self, z: &mut [f64]) -> Result<(), Refusal> {
        let list = E::CAN.indicators();
        count("nEventIndicators", z.len(), list.len())?;
        self.refresh_initial();
        if let Some(events) = &E::CAN.events {
            (events.indicators)(&self.current.block.model, self.current.elapsed, z);
        }
        match z.iter().position(|z| z.is_nan()) {
            None => Ok(()),
            Some(i) => Err(Refusal::Discard(Fault::value(list[i].name, z[i], "a number"))),
        }
    }

    /// Reads the nominal values of the states.
    ///
    /// # Errors
    /// The array does not have one element for each state.
    pub fn nominals(&mut self, out: &mut [f64]) -> Result<(), Fault> {
        count("nContinuousStates", out.len(), self.state_count())?;
        for (i, nominal) in out.iter_mut().enumerate() {
            let number = if const { E::CAN.has_arrays() } { self.number_of_state(i) } else { i };
            *nominal = message::nominal::<E::Model>(&mut self.current.block, self.states[number]);
        }
        Ok(())
    }
}

/// Times closer than this to `t` are the same time.
fn rounding(t: f64) -> f64 {
    4.0 * f64::EPSILON * t.abs()
}

fn count(name: &str, given: usize, needed: usize) -> Result<(), Fault> {
    if given == needed { Ok(()) } else { Err(Fault::value(name, given, format_args!("{needed} for this model"))) }
}
