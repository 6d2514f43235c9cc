//! Clocks of an instance (FMI 3.0.2, 2.2.8): the facade generates their ticks, so that users of an instance only have to handle
//! time events. Clocked variables are read and set while the clock is active; at other times, a read returns the last value,
//! and a set value is stored until the next tick.

use super::Instance;
use crate::abi::journal::Call;
use crate::error::Error;
use crate::standard::Update;
use crate::value::Values;
use model_description::IntervalVariability::{Changing, Countdown, Triggered};
use model_description::{BaseType, Causality, ClockTiming, ModelDescription};
use std::collections::BTreeMap;

/// Fraction of an interval by which rounding may advance a tick.
const SAME: f64 = 1e-6;

/// A clock.
struct Clock {
    reference: u32,
    timing: ClockTiming,
    /// The FMU ticks it.
    own: bool,
    active: bool,
    /// Time (s) of the next tick, and of the first one.
    due: Option<f64>,
    first: f64,
    /// Interval in s.
    interval: f64,
    ticks: u32,
}

/// Phase of a run.
#[derive(Clone, Copy, PartialEq)]
enum Phase {
    /// Before the end of the initialization: all variables can be used.
    Start,
    Event,
    Between,
}

/// The clocks of an instance and their variables.
pub(super) struct Clocks {
    list: Vec<Clock>,
    /// The clocks of a variable, by value references.
    on: BTreeMap<u32, Vec<u32>>,
    /// Last values read.
    read: BTreeMap<u32, Values>,
    /// Values waiting to be set.
    waits: BTreeMap<u32, (BaseType, Values)>,
    phase: Phase,
    start: f64,
    pub(super) time: f64,
}

impl Clocks {
    /// The clocks of an FMU, if it has any.
    pub(super) fn of(description: &ModelDescription) -> Option<Box<Self>> {
        let clocks = description.variables.iter().filter(|v| v.base == BaseType::Clock);
        let list: Vec<Clock> = clocks
            .filter_map(|v| {
                let timing = v.timing?;
                let interval = timing.interval.unwrap_or(0.0);
                let own = v.causality != Causality::Input;
                let reference = v.value_reference;
                Some(Clock { reference, timing, own, active: false, due: None, first: 0.0, interval, ticks: 0 })
            })
            .collect();
        let others = description.variables.iter().filter(|v| v.base != BaseType::Clock && !v.clocks.is_empty());
        let on = others.map(|v| (v.value_reference, v.clocks.clone())).collect();
        let (read, waits) = (BTreeMap::new(), BTreeMap::new());
        let all = Self { list, on, read, waits, phase: Phase::Start, start: 0.0, time: 0.0 };
        (!all.list.is_empty()).then(|| Box::new(all))
    }

    /// The simulation begins at `start` (s).
    pub(super) fn begin(&mut self, start: f64) {
        (self.start, self.time, self.phase) = (start, start, Phase::Start);
        for clock in &mut self.list {
            (clock.active, clock.due, clock.ticks) = (false, None, 0);
        }
        self.read.clear();
    }

    /// Whether a variable can be used now.
    fn is_open(&self, reference: u32) -> bool {
        let active = |clock: &u32| self.list.iter().any(|c| c.reference == *clock && c.active);
        match (self.on.get(&reference), self.phase) {
            (None, _) | (_, Phase::Start) => true,
            (Some(clocks), Phase::Event) => clocks.iter().any(active),
            (Some(_), Phase::Between) => false,
        }
    }

    /// Step Mode, or Continuous-Time Mode.
    pub(super) fn leave_event(&mut self) {
        self.phase = Phase::Between;
    }

    fn next(&self) -> Option<f64> {
        self.list.iter().filter_map(|clock| clock.due).reduce(f64::min)
    }
}

impl Clock {
    /// The next tick after one of a clock with a period; rounded once.
    fn proceed(&mut self) {
        self.ticks += 1;
        self.due = match self.timing.ticks {
            Triggered | Countdown | Changing => None,
            _ => Some(f64::mul_add(f64::from(self.ticks), self.interval, self.first)),
        };
    }

    fn is_due(&self, time: f64) -> bool {
        let width = (SAME * self.interval).max(4.0 * f64::EPSILON * time.abs());
        self.due.is_some_and(|due| due <= time + width)
    }
}

impl Instance {
    /// Reads the intervals to the first ticks, at the end of the initialization.
    pub(super) fn plan_clocks(&mut self) -> Result<(), Error> {
        let Some(mut clocks) = self.clocks.take() else { return Ok(()) };
        let start = clocks.start;
        let planned = clocks.list.iter_mut().filter(|clock| !clock.own).try_for_each(|clock| {
            let (ticks, reference) = (clock.timing.ticks, clock.reference);
            if matches!(ticks, Changing | Countdown) {
                let interval = self.call(Call::Evaluation, |s| s.interval(reference))?;
                clock.interval = interval.unwrap_or(0.0);
                clock.due = interval.map(|interval| start + interval);
            } else if ticks != Triggered {
                let mut shift = clock.timing.shift;
                if clock.timing.interval.is_none() {
                    clock.interval = self.call(Call::Evaluation, |s| s.interval(reference))?.unwrap_or(0.0);
                    shift = self.call(Call::Evaluation, |s| s.shift(reference))?;
                }
                if clock.interval.is_nan() || clock.interval <= 0.0 {
                    return Err(Error::usage(&self.name, format!("a clock has the interval {} s", clock.interval)));
                }
                clock.first = start + shift;
                clock.due = Some(clock.first);
            }
            Ok(())
        });
        self.clocks = Some(clocks);
        planned
    }

    /// Event Mode has begun: activates the due clocks, and sets the values that wait for them.
    pub(super) fn tick(&mut self) -> Result<(), Error> {
        let Some(mut clocks) = self.clocks.take() else { return Ok(()) };
        clocks.phase = Phase::Event;
        let time = clocks.time;
        let due = |clock: &&mut Clock| !clock.own && !clock.active && clock.is_due(time);
        let mut done = clocks.list.iter_mut().filter(due).try_for_each(|clock| {
            clock.active = true;
            self.call(Call::Events, |s| s.activate(clock.reference))
        });
        if done.is_ok() {
            done = self.set_waiting(&mut clocks);
        }
        self.clocks = Some(clocks);
        done
    }

    fn set_waiting(&mut self, clocks: &mut Clocks) -> Result<(), Error> {
        let open: Vec<u32> = clocks.waits.keys().copied().filter(|reference| clocks.is_open(*reference)).collect();
        for reference in open {
            if let Some((base, values)) = clocks.waits.remove(&reference) {
                self.call(Call::Set, |s| s.set(base, reference, &values))?;
            }
        }
        Ok(())
    }

    /// After an update: no clock is active; reads the intervals to the next ticks. A tick that is due at once follows in
    /// another update.
    pub(super) fn tock(&mut self, mut update: Update) -> Result<Update, Error> {
        let Some(mut clocks) = self.clocks.take() else { return Ok(update) };
        let time = clocks.time;
        let planned = clocks.list.iter_mut().try_for_each(|clock| {
            let ticked = std::mem::take(&mut clock.active);
            if clock.own {
                return Ok(());
            }
            if ticked {
                clock.proceed();
            }
            let reference = clock.reference;
            let has_interval = clock.timing.ticks == Countdown || (clock.timing.ticks == Changing && ticked);
            if has_interval && let Some(interval) = self.call(Call::Events, |s| s.interval(reference))? {
                (clock.interval, clock.due) = (interval, Some(time + interval));
            }
            Ok(())
        });
        let next = clocks.next();
        let again = clocks.list.iter().any(|clock| !clock.own && clock.is_due(time));
        self.clocks = Some(clocks);
        planned?;
        if again {
            update.again = true;
            self.tick()?;
        }
        update.next_event_time = match (update.next_event_time, next) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        Ok(update)
    }

    /// Reads a variable of an instance with clocks; `None` if its clock has not ticked.
    pub(super) fn get_clocked(
        &mut self,
        base: BaseType,
        reference: u32,
        count: usize,
    ) -> Result<Option<Values>, Error> {
        let Some(mut clocks) = self.clocks.take() else { return self.get_known(base, reference, count) };
        let read = self.read_clocked(&mut clocks, base, reference, count);
        self.clocks = Some(clocks);
        read
    }

    fn read_clocked(
        &mut self,
        clocks: &mut Clocks,
        base: BaseType,
        reference: u32,
        count: usize,
    ) -> Result<Option<Values>, Error> {
        if base == BaseType::Clock {
            return self.ticks(clocks, reference).map(|is| Some(Values::Booleans(vec![is])));
        }
        if clocks.phase == Phase::Event {
            // The clocks of the FMU that the variable is on may have ticked.
            for clock in clocks.on.get(&reference).cloned().unwrap_or_default() {
                if clocks.list.iter().any(|c| c.reference == clock && c.own) {
                    self.ticks(clocks, clock)?;
                }
            }
        }
        if !clocks.is_open(reference) {
            return Ok(clocks.read.get(&reference).cloned());
        }
        let value = self.call(Call::Get, |s| s.get(base, reference, count))?;
        // Before the first tick, a value comes from the initialization.
        if clocks.phase != Phase::Start && clocks.on.contains_key(&reference) {
            clocks.read.insert(reference, value.clone());
        }
        Ok(Some(value))
    }

    /// Whether a clock is active. One of the FMU, found active, stays so until the next update: the FMU need not say it twice.
    fn ticks(&mut self, clocks: &mut Clocks, reference: u32) -> Result<bool, Error> {
        if clocks.phase != Phase::Event {
            return Ok(false);
        }
        let Some(clock) = clocks.list.iter_mut().find(|clock| clock.reference == reference) else { return Ok(false) };
        clock.active = clock.active || (clock.own && self.call(Call::Get, |s| s.clock(reference))?);
        Ok(clock.active)
    }

    /// Whether a clock is active.
    pub fn has_active_clock(&self) -> bool {
        self.clocks.as_ref().is_some_and(|clocks| clocks.list.iter().any(|clock| clock.active))
    }

    /// Whether a clock that the importer ticks is active.
    pub fn is_active(&self, reference: u32) -> bool {
        let is = |clock: &Clock| clock.reference == reference && !clock.own && clock.active;
        self.clocks.as_ref().is_some_and(|clocks| clocks.list.iter().any(is))
    }

    /// Sets a variable of an instance with clocks, or activates a clock.
    pub(super) fn set_clocked(&mut self, base: BaseType, reference: u32, values: &Values) -> Result<(), Error> {
        let Some(mut clocks) = self.clocks.take() else { return self.set_at(base, reference, values) };
        let mut done = Ok(());
        if base == BaseType::Clock {
            let begins = *values == Values::Booleans(vec![true]) && clocks.phase == Phase::Event;
            let clock = clocks.list.iter_mut().find(|clock| clock.reference == reference && !clock.active && begins);
            if let Some(clock) = clock {
                clock.active = true;
                done = self.call(Call::Events, |s| s.activate(reference));
                done = done.and_then(|()| self.set_waiting(&mut clocks));
            }
        } else if clocks.is_open(reference) {
            done = self.call(Call::Set, |s| s.set(base, reference, values));
        } else {
            clocks.waits.insert(reference, (base, values.clone()));
        }
        self.clocks = Some(clocks);
        done
    }
}
