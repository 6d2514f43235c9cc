//! Clocks in Event Mode and in Scheduled Execution (FMI 3.0.2, 2.2.8, 2.3.5 and 5): active clocks, the times of the next ticks,
//! and the variables that can be used.

mod intervals;

use crate::access::index;
use crate::instance::{Instance, Refusal};
use crate::lifecycle::State;
use crate::message;
use crate::value::Fmi3Boolean;
use fmu_core::time::SAME_INSTANT;
use fmu_core::{Causality, Elapsed, Exported, Fault, Interface, Kind, Kinds, Model, Slot, Ticks, Timing};
use serde::{Deserialize, Serialize};
use std::mem::MaybeUninit;

/// `fmi3IntervalQualifier`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(i32)]
pub enum Qualifier {
    /// The model has not determined the interval yet.
    NotYetKnown = 0,
    /// Unchanged since it was last reported.
    Unchanged = 1,
    /// It is new.
    Changed = 2,
}

/// The changing state of a clock.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tick {
    /// It is active.
    active: bool,
    /// It has ticked in this Event Mode; in Scheduled Execution, it was the last one to tick.
    done: bool,
    /// The qualifier of the interval for the next getter.
    qualifier: Qualifier,
    /// The interval in s that was reported last.
    interval: f64,
    /// Time of the tick at the end of the interval, in s from the start.
    due: f64,
    /// Time of the last tick, in s from the start.
    last: Option<f64>,
    /// Time of the first tick, in s from the start.
    shift: f64,
}

impl Tick {
    const fn new(timing: &Timing) -> Self {
        let qualifier = if timing.ticks.is_aperiodic() { Qualifier::NotYetKnown } else { Qualifier::Changed };
        Self { active: false, done: false, qualifier, interval: 0.0, due: 0.0, last: None, shift: timing.shift }
    }

    /// Whether the values are possible: a stored state may contain any bytes.
    pub(crate) fn is_sane(&self) -> bool {
        let Self { interval, due, last, shift, .. } = self;
        interval.is_finite() && due.is_finite() && last.is_none_or(f64::is_finite) && *shift >= 0.0 && shift.is_finite()
    }

    /// Event Mode begins.
    pub(crate) const fn begin(&mut self) {
        (self.active, self.done) = (false, false);
    }
}

/// The clocks of a new model.
pub(crate) fn ticks<M: Model>() -> Option<Box<[Tick]>> {
    if const { !M::TABLE.kinds().meets(Kinds::CLOCK) } {
        return None;
    }
    let clock =
        |i| M::TABLE.locate(i).and_then(|(_, meta, _)| if let Kind::Clock(t) = meta.kind { Some(t) } else { None });
    let all: Box<[Tick]> = (0..M::TABLE.len()).filter_map(clock).map(|timing| Tick::new(&timing)).collect();
    (!all.is_empty()).then_some(all)
}

/// The constant properties of a model's clocks.
pub struct Clocks {
    /// In the order of the table: index, timing, and whether the importer ticks it.
    list: Vec<(usize, Timing, bool)>,
    /// For each variable, a bit for each clock that it is on.
    on: Vec<u64>,
}

impl Clocks {
    pub(crate) fn of<E: Exported>() -> Option<Box<Self>> {
        if const { E::CAN.clocked.is_none() } {
            return None;
        }
        let table = E::Model::TABLE;
        let (mut list, mut names) = (Vec::new(), Vec::new());
        for i in 0..table.len() {
            if let Some((name, meta, _)) = table.locate(i)
                && let Kind::Clock(timing) = meta.kind
            {
                list.push((i, timing, meta.causality == Causality::Input));
                names.push(name);
            }
        }
        let bit = |clock: &str| names.iter().position(|name| name == clock).map_or(0, |number| 1 << number);
        let on = |i| table.clocks_of(i).split_whitespace().map(bit).fold(0, |all: u64, one: u64| all | one);
        Some(Box::new(Self { list, on: (0..table.len()).map(on).collect() }))
    }
}

/// A clock that a reference denotes.
#[derive(Clone, Copy)]
struct Found {
    number: usize,
    index: usize,
    timing: Timing,
    ticked_by_importer: bool,
}

impl<E: Exported> Instance<E> {
    /// The clock with this reference.
    fn clock(&self, reference: u32) -> Result<Found, Fault> {
        let wanted = index::<E>(reference);
        let list = self.clocks.as_ref().map_or(&[][..], |clocks| &clocks.list);
        if let Some(number) = list.iter().position(|(index, ..)| *index == wanted) {
            let (index, timing, ticked_by_importer) = list[number];
            return Ok(Found { number, index, timing, ticked_by_importer });
        }
        match E::Model::TABLE.locate(wanted) {
            Some((_, meta, _)) => Err(message::type_of::<E::Model>(wanted, meta, "clocks")),
            None => Err(message::unknown::<E>(reference, self.standard)),
        }
    }

    fn tick_of(&mut self, number: usize) -> Option<&mut Tick> {
        self.current.ticks.as_mut()?.get_mut(number)
    }

    fn no(clock: Found, why: &str) -> Fault {
        Fault::new(format!("{} {why}", message::name::<E::Model>(clock.index)))
    }

    /// Refuses variables on inactive clocks: they can be used before the start, in Event Mode while one of their clocks is
    /// active, and in Scheduled Execution.
    ///
    /// # Errors
    /// Names the variable; or an output cannot be computed.
    pub(crate) fn check_clocked(&mut self, references: &[u32], sets: bool) -> Result<(), Fault> {
        let state = self.current.life.state();
        if !matches!(state, State::Event | State::Step | State::Continuous) {
            return Ok(());
        }
        let on = |instance: &Self, reference: &u32| {
            instance.clocks.as_ref().and_then(|clocks| clocks.on.get(index::<E>(*reference)).copied()).unwrap_or(0)
        };
        if references.iter().all(|reference| on(self, reference) == 0) {
            return Ok(());
        }
        self.evaluate_clocks(!sets)?;
        let mut active = 0_u64;
        if state == State::Event {
            let ticks = self.current.ticks.iter().flatten().enumerate();
            active = ticks.fold(0, |all, (number, tick)| all | u64::from(tick.active) << number);
        }
        match references.iter().find(|reference| on(self, reference) != 0 && on(self, reference) & active == 0) {
            None => Ok(()),
            Some(&closed) => {
                let (name, clocks) =
                    (message::name::<E::Model>(index::<E>(closed)), E::Model::TABLE.clocks_of(index::<E>(closed)));
                let which = clocks.replace(' ', " or ");
                let doing = if sets { "set" } else { "read" };
                Err(Fault::new(format!(
                    "{name} can be {doing} in Event Mode while {which} is active, and this is {state}"
                )))
            }
        }
    }

    /// In Event Mode, computes the effect of pending ticks on output clocks and, with feedthrough, on the outputs: on a copy.
    fn evaluate_clocks(&mut self, outputs: bool) -> Result<(), Fault> {
        let (Some(functions), State::Event) = (&E::CAN.clocked, self.current.life.state()) else { return Ok(()) };
        let announced = self.clocks.as_ref().is_some_and(|clocks| clocks.list.iter().any(|(.., ticked)| !ticked));
        if !(announced || functions.feedthrough && outputs && self.stale) {
            return Ok(());
        }
        // A model with clocks can be saved.
        let Some(saving) = &E::CAN.saved else { return Ok(()) };
        let mut model = saving.model(&self.current.block.model);
        let now = self.current.elapsed;
        for number in 0..self.number_of_clocks() {
            if self.is_ticking(number) {
                (functions.tick)(&mut model, number, now)?;
            }
        }
        for number in 0..self.number_of_clocks() {
            let own = self.clocks.as_ref().is_some_and(|clocks| !clocks.list[number].2);
            let ticked = own && (functions.ticked)(&mut model, number);
            if let Some(tick) = self.tick_of(number).filter(|_| own) {
                tick.active = ticked;
            }
        }
        if functions.feedthrough {
            model.output(now, &mut self.current.block.out);
            self.stale = false;
        }
        Ok(())
    }

    fn number_of_clocks(&self) -> usize {
        self.current.ticks.as_ref().map_or(0, |ticks| ticks.len())
    }

    /// Whether the importer has made the clock active.
    fn is_ticking(&self, number: usize) -> bool {
        let theirs = self.clocks.as_ref().is_some_and(|clocks| clocks.list[number].2);
        theirs && self.current.ticks.as_ref().is_some_and(|ticks| ticks[number].active)
    }

    /// The active clocks. In Scheduled Execution, a clock that has ticked is reported once.
    ///
    /// # Errors
    /// A reference that is not a clock; a model that fails.
    pub fn get_clocks(&mut self, references: &[u32], out: &mut [MaybeUninit<Fmi3Boolean>]) -> Result<(), Fault> {
        for &reference in references {
            self.clock(reference)?;
        }
        self.evaluate_clocks(false)?;
        let scheduled = self.current.life.interface() == Interface::ScheduledExecution;
        for (&reference, place) in references.iter().zip(out) {
            let clock = self.clock(reference)?;
            let Some(tick) = self.tick_of(clock.number) else { continue };
            place.write(tick.active.into());
            tick.active &= !scheduled;
        }
        Ok(())
    }

    /// Makes clocks active: all of them or, on an error, none.
    ///
    /// # Errors
    /// A clock that the model ticks; a periodic clock that has ticked in this Event Mode; deactivating an active clock
    /// (`canBeDeactivated` is false).
    pub fn set_clocks(&mut self, references: &[u32], values: &[Fmi3Boolean]) -> Result<(), Fault> {
        for (&reference, value) in references.iter().zip(values) {
            let clock = self.clock(reference)?;
            let Some(tick) = self.tick_of(clock.number).copied() else { continue };
            let why = match (clock.ticked_by_importer, value.0 != 0) {
                (false, _) => "is an output clock: the model ticks it",
                (true, false) if tick.active => "is active until the update: canBeDeactivated = false",
                (true, true) if tick.done && clock.timing.ticks.is_periodic() => "has ticked at this instant",
                _ => continue,
            };
            return Err(Self::no(clock, why));
        }
        for (&reference, value) in references.iter().zip(values) {
            let clock = self.clock(reference)?;
            let begins = self.tick_of(clock.number).is_some_and(|tick| !tick.active) && value.0 != 0;
            let (true, Some(functions)) = (begins, &E::CAN.clocked) else { continue };
            if let Some(tick) = self.tick_of(clock.number) {
                tick.active = true;
            }
            // Event Mode does not end without this tick.
            self.current.pending = true;
            (functions.activate)(&mut self.current.block.model, clock.number, self.current.elapsed);
            self.stale = true;
        }
        Ok(())
    }

    pub(crate) fn has_active_clocks(&self) -> bool {
        self.current.ticks.iter().flatten().any(|tick| tick.active)
    }

    /// Ticks the active clocks when the discrete states are updated; then no clock is active.
    ///
    /// # Errors
    /// The model reports an error.
    pub(crate) fn tick_all(&mut self) -> Result<(), Fault> {
        for number in 0..self.number_of_clocks() {
            if self.is_ticking(number) {
                self.tick_one(number)?;
            }
        }
        if let Some(functions) = &E::CAN.clocked {
            for number in 0..self.number_of_clocks() {
                let _ = (functions.ticked)(&mut self.current.block.model, number);
            }
        }
        self.current.ticks.iter_mut().flatten().for_each(|tick| tick.active = false);
        self.plan_ticks(false)
    }

    fn tick_one(&mut self, number: usize) -> Result<(), Fault> {
        let Some(functions) = &E::CAN.clocked else { return Ok(()) };
        self.watch_grid(number);
        let now = self.current.elapsed;
        (functions.tick)(&mut self.current.block.model, number, now)?;
        if let Some(tick) = self.tick_of(number) {
            (tick.done, tick.last) = (true, Some(now.seconds()));
        }
        Ok(())
    }

    /// Warns of a tick that is not at a multiple of the period.
    fn watch_grid(&mut self, number: usize) {
        let Some((index, timing, _)) = self.clocks.as_ref().map(|clocks| clocks.list[number]) else { return };
        let (Some(period), Some(&mut Tick { last, shift, .. })) =
            (self.period(index, &timing), self.tick_of(number).filter(|_| timing.ticks.is_periodic()))
        else {
            return;
        };
        let (now, expected) = (self.current.elapsed.seconds(), last.map_or(shift, |last| last + period));
        if (now - expected).abs() > SAME_INSTANT * period {
            let name = message::name::<E::Model>(index);
            self.warn_of("clock", || format!("{name} ticks {now} s after the start, where {expected} s are due"));
        }
    }

    /// The interval of a clock with a period.
    fn period(&mut self, index: usize, timing: &Timing) -> Option<f64> {
        timing.interval.or_else(|| match E::Model::TABLE.entry(&mut self.current.block, index) {
            Some((_, Slot::Clock(Some(interval)))) => Some(*interval),
            _ => None,
        })
    }

    /// Asks the model for the next ticks of its aperiodic clocks: at the `start` and after each update.
    ///
    /// # Errors
    /// An interval that is negative or not finite, or a missing interval of a changing clock that ticks.
    pub(crate) fn plan_ticks(&mut self, start: bool) -> Result<(), Fault> {
        let Some(functions) = &E::CAN.clocked else { return Ok(()) };
        let now = self.current.elapsed;
        for number in 0..self.number_of_clocks() {
            let Some((index, timing, _)) = self.clocks.as_ref().map(|clocks| clocks.list[number]) else { continue };
            let (Some(tick), true) = (self.tick_of(number).copied(), timing.ticks.is_aperiodic()) else { continue };
            if timing.ticks == Ticks::Changing && !(start || tick.done) {
                continue;
            }
            let interval = (functions.interval)(&self.current.block.model, number, now);
            if let Some(x) = interval.filter(|x| !(x.is_finite() && *x >= 0.0)) {
                let name = message::name::<E::Model>(index);
                return Err(Fault::value(&format!("the interval of {name}"), x, "finite and not negative"));
            }
            let missing = interval.is_none() && timing.ticks == Ticks::Changing;
            let Some(tick) = self.tick_of(number).filter(|_| !missing) else {
                return Err(Fault::new(format!("{} has no interval", message::name::<E::Model>(index))));
            };
            tick.plan(interval, now, start);
        }
        Ok(())
    }

    /// Activates the partition of a clock at `t` (s): Scheduled Execution. Returns whether the importer must be notified of
    /// clocks.
    ///
    /// # Errors
    /// An output clock, a time not after the last tick of the clock, inconsistent tunable parameters, or an error of the model.
    pub fn activate_partition(&mut self, reference: u32, t: f64) -> Result<bool, Refusal> {
        let clock = self.clock(reference)?;
        if !clock.ticked_by_importer {
            return Err(Self::no(clock, "is an output clock: the model ticks it").into());
        }
        let start = self.current.experiment.map_or(0.0, |e| e.start);
        let after = self.tick_of(clock.number).and_then(|tick| tick.last).map(|last| start + last);
        let follows = t.is_finite() && t >= start && after.is_none_or(|after| t > after);
        if !follows {
            let allowed = match after {
                Some(after) => {
                    format!("after {after}, the last activation of {}", message::name::<E::Model>(clock.index))
                }
                None => format!("not before the start at {start}"),
            };
            return Err(Fault::value("activationTime", t, allowed).into());
        }
        if self.current.dirty {
            self.current.adopt(&E::CAN)?;
            self.current.dirty = false;
        }
        (self.current.elapsed, self.current.end) = (Elapsed::between(start, t), t);
        let Some(functions) = &E::CAN.clocked else { return Ok(false) };
        let now = self.current.elapsed;
        (functions.activate)(&mut self.current.block.model, clock.number, now);
        self.current.ticks.iter_mut().flatten().for_each(|tick| tick.done = false);
        self.tick_one(clock.number)?;
        self.current.block.model.output(now, &mut self.current.block.out);
        self.plan_ticks(false)?;
        let mut news = false;
        for number in 0..self.number_of_clocks() {
            let Some((_, timing, theirs)) = self.clocks.as_ref().map(|clocks| clocks.list[number]) else { continue };
            let ticked = !theirs && (functions.ticked)(&mut self.current.block.model, number);
            let Some(tick) = self.tick_of(number) else { continue };
            tick.active |= ticked;
            news |= ticked || timing.ticks == Ticks::Countdown && tick.qualifier == Qualifier::Changed;
        }
        self.warn();
        Ok(news)
    }
}

impl Tick {
    /// A new answer of the model at `now`.
    fn plan(&mut self, interval: Option<f64>, now: Elapsed, start: bool) {
        let Some(interval) = interval else {
            if self.done || start {
                self.qualifier = Qualifier::NotYetKnown;
            }
            return;
        };
        let due = now.seconds() + interval;
        let known = self.qualifier != Qualifier::NotYetKnown && !self.done;
        let passed = interval == 0.0 && self.due <= due;
        if known && (passed || (due - self.due).abs() <= 1e-9 * due.abs()) {
            return;
        }
        (self.qualifier, self.interval, self.due) = (Qualifier::Changed, interval, due);
    }
}
