//! Moving values between FMUs: the variables read from each FMU, and the sources of those set.

use super::grid::EARLY;
use super::parts::Port;
use super::schedule::SAME;
use super::sequence::Held;
use super::wiring::{Change, Feed, Record, Source, Wiring, converted};
use super::{Schedule, loops};
use fmu_import::{Error, Instance, Kind, Number, Values};
use model_description::{BaseType, Conversion};
use std::collections::BTreeMap;

/// Location of a value during the run.
#[derive(Clone)]
enum Place {
    /// One of the double-precision numbers read from an instance in one call.
    Fast {
        instance: usize,
        slot: usize,
        conversion: Option<Conversion>,
    },
    /// A variable read individually.
    Single {
        instance: usize,
        slot: usize,
        change: Option<Change>,
    },
    Schedule(Schedule),
}

/// Traffic of one instance. Double-precision numbers are passed in one call, other values one by one, in their types.
#[derive(Clone, Default)]
struct Traffic {
    read: Vec<u32>,
    read_singly: Vec<Port>,
    /// Numbers of variables in `read` and `read_singly` that feed inputs, which come first.
    feeding: [usize; 2],
    /// Values of `read`, read last.
    values: Vec<f64>,
    /// Values of `read_singly`, read last; `None` while the clock of one has not ticked.
    others: Vec<Option<Values>>,
    write: Vec<(u32, Place)>,
    /// Clocks come last: at a tick, the values of its variables are already set.
    write_singly: Vec<(Port, Place)>,
    /// Numbers of variables in `write` and `write_singly` that are continuous: these come first.
    continuous: [usize; 2],
    references: Vec<u32>,
    /// Values of `write`, written last.
    buffer: Vec<f64>,
    /// Values of `write_singly`, written last.
    singles: Vec<Option<Values>>,
    /// Inputs over time that are not single numbers, and the index of the value written last.
    held: Vec<(Port, Held, Option<usize>)>,
}

/// All traffic of a run.
#[derive(Clone)]
pub(super) struct Exchange {
    traffic: Vec<Traffic>,
    /// Recorded values and their types; none after a change.
    row: Vec<(Place, Option<BaseType>)>,
    /// Times (s) at which inputs over time jump, in ascending order.
    jumps: Vec<f64>,
    /// Number of inputs that are fed.
    fed: usize,
    /// Time (s) since which step schedules are held; `None` if they are read at every exchange.
    pub(super) since: Option<f64>,
    /// Time (s) at which the run ends.
    pub(super) stop: f64,
    /// Receives notes during the run.
    pub(super) listener: Option<fn(&str)>,
    /// Notes of the run.
    pub(super) notes: Vec<String>,
}

/// An input changed by a pass.
pub(super) struct Unsettled {
    /// Its instance.
    pub(super) index: usize,
    /// Position of its value among those written in one call.
    slot: usize,
    pub(super) reference: u32,
    /// Instance and reference of its source, if both are continuous double-precision numbers.
    pub(super) source: Option<(usize, u32)>,
    /// Change of the input per change of its source; not 1 between different units.
    pub(super) factor: f64,
}

/// The inputs to be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inputs {
    /// In event mode.
    All,
    /// In continuous-time mode.
    Continuous,
}

impl Exchange {
    /// `texts` are also recorded elsewhere; here they are read while their clocks are active.
    pub(super) fn new<'a>(
        instances: usize,
        wiring: &Wiring,
        records: &[Record],
        texts: impl Iterator<Item = &'a Port>,
    ) -> Self {
        let mut traffic: Vec<Traffic> = (0..instances).map(|_| Traffic::default()).collect();
        let key = |port: &Port| (port.instance, port.name.clone());
        let mut fed = BTreeMap::new();
        for feed in &wiring.feeds {
            fed.entry(key(&feed.target)).or_insert(&feed.source);
        }
        // A fed input need not be read: its value is known here, unless its source may have none yet.
        let origin = |record: &Record| match fed.get(&key(&record.port)).copied() {
            Some(source) if !source.may_lack() && record.change.is_none() => source.clone(),
            _ => Source::Port(record.port.clone(), record.change.clone()),
        };
        let origins: Vec<Source> = records.iter().map(origin).collect();
        let sources = wiring.feeds.iter().map(|feed| &feed.source).chain(&origins);
        // The slots in `read` and in `read_singly`.
        let (mut fast, mut single) = (BTreeMap::new(), BTreeMap::new());
        for (index, source) in sources.enumerate() {
            let Source::Port(port, _) = source else { continue };
            let traffic = &mut traffic[port.instance];
            if port.is_fast() {
                fast.entry((port.instance, port.reference)).or_insert_with(|| {
                    traffic.read.push(port.reference);
                    traffic.read.len() - 1
                });
            } else {
                single.entry(key(port)).or_insert_with(|| {
                    traffic.read_singly.push(port.clone());
                    traffic.read_singly.len() - 1
                });
            }
            if index < wiring.feeds.len() {
                traffic.feeding = [traffic.read.len(), traffic.read_singly.len()];
            }
        }
        for port in texts.filter(|port| !port.clocks.is_empty()) {
            traffic[port.instance].read_singly.push(port.clone());
        }
        let place = |source: &Source| match source {
            Source::Port(port, conversion) => {
                let instance = port.instance;
                if port.is_fast() {
                    // A table is not for real numbers.
                    let linear = |change: &Change| if let Change::Linear(x) = change { Some(*x) } else { None };
                    let conversion = conversion.as_ref().and_then(linear);
                    Place::Fast { instance, slot: fast[&(instance, port.reference)], conversion }
                } else {
                    Place::Single { instance, slot: single[&key(port)], change: conversion.clone() }
                }
            }
            Source::Schedule(schedule) => Place::Schedule(schedule.clone()),
        };
        let base = |record: &Record| record.change.is_none().then_some(record.port.base);
        let row = origins.iter().zip(records).map(|(source, record)| (place(source), base(record))).collect();
        let (continuous, mut discrete): (Vec<_>, Vec<_>) = wiring.feeds.iter().partition(|feed| feed.continuous);
        discrete.sort_by_key(|feed| feed.target.base == BaseType::Clock);
        for Feed { target, source, continuous } in continuous.into_iter().chain(discrete) {
            let place = place(source);
            let traffic = &mut traffic[target.instance];
            let fast = target.is_fast() && !source.may_lack();
            if fast {
                traffic.references.push(target.reference);
                traffic.write.push((target.reference, place));
            } else {
                traffic.write_singly.push((target.clone(), place));
            }
            traffic.continuous[usize::from(!fast)] += usize::from(*continuous);
        }
        for t in &mut traffic {
            t.values = vec![0.0; t.read.len()];
            t.others = vec![None; t.read_singly.len()];
            t.buffer = vec![0.0; t.write.len()];
            t.singles = vec![None; t.write_singly.len()];
        }
        for (port, values) in &wiring.held {
            traffic[port.instance].held.push((port.clone(), values.clone(), None));
        }
        let mut jumps: Vec<f64> = wiring.jumps().flat_map(|(_, times)| times).collect();
        jumps.sort_unstable_by(f64::total_cmp);
        jumps.dedup_by(|b, a| *b - *a <= SAME);
        let fed = wiring.feeds.len();
        Self { traffic, row, jumps, fed, since: None, stop: f64::INFINITY, listener: None, notes: Vec::new() }
    }

    /// Passes a note on during the run or, without a listener, after it.
    pub(super) fn note(&mut self, text: String) {
        match self.listener {
            Some(listener) => listener(&text),
            None => self.notes.push(text),
        }
    }

    /// Start of a run: no value is held or has been written.
    pub(super) fn begin(&mut self) {
        self.since = None;
        for t in &mut self.traffic {
            t.held.iter_mut().for_each(|(_, _, last)| *last = None);
            t.others.fill(None);
            t.singles.fill(None);
        }
    }

    pub(super) fn read_all(&mut self, instances: &mut [Instance]) -> Result<(), Error> {
        instances.iter_mut().enumerate().try_for_each(|(i, instance)| self.read(i, instance))
    }

    pub(super) fn write_all(&mut self, instances: &mut [Instance], t: f64) -> Result<(), Error> {
        instances.iter_mut().enumerate().try_for_each(|(i, instance)| self.write(i, instance, t))
    }

    pub(super) fn read(&mut self, index: usize, instance: &mut Instance) -> Result<(), Error> {
        let traffic = &mut self.traffic[index];
        traffic.read([traffic.read.len(), traffic.read_singly.len()], instance)
    }

    pub(super) fn write(&mut self, index: usize, instance: &mut Instance, t: f64) -> Result<(), Error> {
        let mut buffer = std::mem::take(&mut self.traffic[index].buffer);
        let traffic = &self.traffic[index];
        for (value, (_, place)) in buffer.iter_mut().zip(&traffic.write) {
            *value = self.number(place, t).real();
        }
        if !buffer.is_empty() {
            instance.set_reals(&traffic.references, &buffer)?;
        }
        self.traffic[index].buffer = buffer;
        self.set_singles(index, instance, t, (usize::MAX, true))?;
        self.hold(index, instance, t).map(drop)
    }

    /// Sets the first `count` of the inputs that are set one by one: all of them, or those that have changed. Returns whether any
    /// has changed, and whether a discrete one has.
    fn set_singles(
        &mut self,
        index: usize,
        instance: &mut Instance,
        t: f64,
        (count, all): (usize, bool),
    ) -> Result<(bool, bool), Error> {
        let mut singles = std::mem::take(&mut self.traffic[index].singles);
        let traffic = &self.traffic[index];
        let (mut changed, mut discrete) = (false, false);
        for (i, (last, (port, place))) in singles.iter_mut().zip(&traffic.write_singly).enumerate().take(count) {
            let Some(new) = self.values(place, port, t)? else { continue };
            if port.base == BaseType::Clock {
                if new != Values::Booleans(vec![true]) || instance.is_active(port.reference) {
                    continue;
                }
                // A tick transfers values even if they equal those of the last one.
                let on_it = |(other, _): &&(Port, Place)| other.clocks.contains(&port.reference);
                for (other, place) in traffic.write_singly.iter().filter(on_it) {
                    if let Some(values) = self.values(place, other, t)? {
                        other.write(instance, &values)?;
                    }
                }
            } else if !all && last.as_ref().is_some_and(|last| same(last, &new)) {
                continue;
            }
            port.write(instance, &new)?;
            *last = Some(new);
            changed = true;
            discrete |= i >= traffic.continuous[1];
        }
        self.traffic[index].singles = singles;
        Ok((changed, discrete))
    }

    /// Sets changed inputs other than single numbers; returns whether any has changed.
    fn hold(&mut self, index: usize, instance: &mut Instance, t: f64) -> Result<bool, Error> {
        let (mut changed, t) = (false, self.since.unwrap_or(t));
        for (port, values, last) in &mut self.traffic[index].held {
            let now = values.index(t);
            if last.replace(now) != Some(now) {
                instance.set_at(port.base, port.reference, values.value(now))?;
                changed = true;
            }
        }
        Ok(changed)
    }

    /// Propagates outputs to inputs until all values are stable: an output may depend on an input, through several FMUs. A loop
    /// of continuous inputs is solved. FMUs for Co-Simulation are excluded: they exchange values at communication points.
    /// Returns whether a discrete input changed.
    pub(super) fn settle(&mut self, instances: &mut [Instance], t: f64, inputs: Inputs) -> Result<bool, Error> {
        if inputs == Inputs::Continuous && self.traffic.iter().all(|traffic| traffic.continuous == [0, 0]) {
            return Ok(false);
        }
        let mut discrete = false;
        // Without a loop, each pass settles at least one more input.
        for _ in 0..self.fed + 2 {
            let (settled, some) = self.pass(instances, t, inputs)?;
            discrete |= some;
            if settled {
                return self.read_clocked(instances).map(|()| discrete);
            }
        }
        loops::solve(self, instances, t)?;
        self.read_clocked(instances).map(|()| discrete)
    }

    /// Reads all variables, recorded ones too, while a clock is active: later they have no other values.
    fn read_clocked(&mut self, instances: &mut [Instance]) -> Result<(), Error> {
        if instances.iter().any(Instance::has_active_clock) { self.read_all(instances) } else { Ok(()) }
    }

    /// Reads the sources of inputs, and sets the inputs that have changed; returns whether no input has changed, and whether a
    /// discrete one has.
    fn pass(&mut self, instances: &mut [Instance], t: f64, inputs: Inputs) -> Result<(bool, bool), Error> {
        let (mut settled, mut discrete) = (true, false);
        self.read_feeding(instances)?;
        for (index, instance) in instances.iter_mut().enumerate().filter(|(_, i)| i.kind() == Kind::ModelExchange) {
            let (some, some_discrete) = self.pass_on(index, instance, t, inputs)?;
            settled &= !some;
            discrete |= some_discrete;
        }
        Ok((settled, discrete))
    }

    fn read_feeding(&mut self, instances: &mut [Instance]) -> Result<(), Error> {
        let mut exchanging = self.traffic.iter_mut().zip(instances).filter(|(_, i)| i.kind() == Kind::ModelExchange);
        exchanging.try_for_each(|(traffic, instance)| traffic.read(traffic.feeding, instance))
    }

    /// The inputs that another pass would change.
    pub(super) fn unsettled(&mut self, instances: &mut [Instance], t: f64) -> Result<Vec<Unsettled>, Error> {
        self.read_feeding(instances)?;
        let mut all = Vec::new();
        for (index, traffic) in self.traffic.iter().enumerate() {
            if instances[index].kind() != Kind::ModelExchange {
                continue;
            }
            for (slot, (reference, place)) in traffic.write.iter().enumerate() {
                if self.number(place, t).real().to_bits() != traffic.buffer[slot].to_bits() {
                    let (source, factor) = match place {
                        Place::Fast { instance, slot, conversion } => {
                            let source = self.traffic[*instance].read.get(*slot).map(|r| (*instance, *r));
                            (source, conversion.map_or(1.0, |conversion| conversion.factor))
                        }
                        Place::Single { .. } | Place::Schedule(_) => (None, 1.0),
                    };
                    let source = source.filter(|_| slot < traffic.continuous[0]);
                    all.push(Unsettled { index, slot, reference: *reference, source, factor });
                }
            }
            for ((port, place), old) in traffic.write_singly.iter().zip(&traffic.singles) {
                let is = |new: &Values| old.as_ref().is_some_and(|old| same(old, new));
                if port.base != BaseType::Clock && self.values(place, port, t)?.is_some_and(|new| !is(&new)) {
                    let (slot, reference) = (usize::MAX, port.reference);
                    all.push(Unsettled { index, slot, reference, source: None, factor: 1.0 });
                }
            }
        }
        Ok(all)
    }

    /// Sets inputs to these values, and returns the values that would be set next.
    pub(super) fn try_values(
        &mut self,
        instances: &mut [Instance],
        t: f64,
        inputs: &[Unsettled],
        values: &[f64],
    ) -> Result<Vec<f64>, Error> {
        for (input, value) in inputs.iter().zip(values) {
            self.traffic[input.index].buffer[input.slot] = *value;
            instances[input.index].set_reals(&[input.reference], &[*value])?;
        }
        self.read_feeding(instances)?;
        let next = |input: &Unsettled| self.number(&self.traffic[input.index].write[input.slot].1, t).real();
        Ok(inputs.iter().map(next).collect())
    }

    /// The present values of these inputs.
    pub(super) fn values_of(&self, inputs: &[Unsettled]) -> Vec<f64> {
        inputs.iter().map(|input| self.traffic[input.index].buffer[input.slot]).collect()
    }

    /// Propagates outputs to inputs once, as at a communication point; while a clock is active, until all values are stable,
    /// because clocked variables depend on the inputs of the same instant. Returns whether a discrete input of one of these
    /// instances changed.
    pub(super) fn pass_on_once(&mut self, instances: &mut [Instance], t: f64, of: &[usize]) -> Result<bool, Error> {
        let mut discrete = false;
        for _ in 0..self.fed + 2 {
            self.read_all(instances)?;
            let mut changed = false;
            for (index, instance) in instances.iter_mut().enumerate() {
                let (some, some_discrete) = self.pass_on(index, instance, t, Inputs::All)?;
                changed |= some;
                discrete |= some_discrete && of.contains(&index);
            }
            if !changed || !instances.iter().any(Instance::has_active_clock) {
                break;
            }
        }
        Ok(discrete)
    }

    /// Sets the changed inputs of an instance; returns whether any has changed, and whether a discrete one has.
    fn pass_on(
        &mut self,
        index: usize,
        instance: &mut Instance,
        t: f64,
        inputs: Inputs,
    ) -> Result<(bool, bool), Error> {
        let mut buffer = std::mem::take(&mut self.traffic[index].buffer);
        let traffic = &self.traffic[index];
        let [fast, single] = match inputs {
            Inputs::All => [buffer.len(), usize::MAX],
            Inputs::Continuous => traffic.continuous,
        };
        let (mut changed, mut discrete) = (false, false);
        for (i, (value, (_, place))) in buffer.iter_mut().zip(&traffic.write).enumerate().take(fast) {
            let new = self.number(place, t).real();
            if new.to_bits() != value.to_bits() {
                *value = new;
                changed = true;
                discrete |= i >= traffic.continuous[0];
            }
        }
        if changed {
            instance.set_reals(&traffic.references[..fast], &buffer[..fast])?;
        }
        self.traffic[index].buffer = buffer;
        let (some, some_discrete) = self.set_singles(index, instance, t, (single, false))?;
        (changed, discrete) = (changed || some, discrete || some_discrete);
        if inputs == Inputs::All && self.hold(index, instance, t)? {
            (changed, discrete) = (true, true);
        }
        Ok((changed, discrete))
    }

    /// The first point of a schedule after the time `t` (s).
    pub(super) fn next_point(&self, t: f64) -> Option<f64> {
        let next = |place: &Place| match place {
            Place::Fast { .. } | Place::Single { .. } => None,
            Place::Schedule(schedule) => schedule.next_point(t),
        };
        let fast = self.traffic.iter().flat_map(|t| t.write.iter().map(|(_, place)| place));
        let singly = self.traffic.iter().flat_map(|t| t.write_singly.iter().map(|(_, place)| place));
        let held = self.traffic.iter().flat_map(|traffic| &traffic.held);
        let held = held.filter_map(|(_, values, _)| values.next_point(t));
        fast.chain(singly).filter_map(next).chain(held).reduce(f64::min)
    }

    /// Times (s) between two communication points at which the value of an input jumps, in ascending order.
    pub(super) fn jumps_between(&self, from: f64, to: f64) -> impl Iterator<Item = f64> {
        self.jumps.iter().copied().filter(move |t| *t > from + SAME && *t < to - SAME.max(EARLY * (to - from)))
    }

    /// The recorded values at time `t`.
    pub(super) fn row(&self, t: f64, row: &mut Vec<Number>) {
        row.clear();
        row.extend(self.row.iter().map(|(place, base)| match (self.number(place, t), base) {
            (number @ Number::Missing, _) | (number, None) => number,
            (Number::Real(x), Some(base)) if base.is_float() => Number::Real(x),
            // As the variable receives it.
            (number, Some(base)) => Values::from_number(number, *base).map_or(number, |values| values.one(0)),
        }));
    }

    /// The number at a place.
    fn number(&self, place: &Place, t: f64) -> Number {
        match place {
            Place::Fast { instance, slot, conversion } => {
                let value = self.traffic[*instance].values[*slot];
                Number::Real(conversion.map_or(value, |conversion| conversion.apply(value)))
            }
            Place::Single { instance, slot, change } => {
                let number = self.traffic[*instance].others[*slot].as_ref().map_or(Number::Missing, |v| v.one(0));
                change.as_ref().map_or(number, |change| change.apply(number))
            }
            Place::Schedule(schedule) => Number::Real(match self.since {
                None => schedule.at(t),
                Some(since) => schedule.held(since, t),
            }),
        }
    }

    /// The values at a position, converted for a target; `None` if there are none yet.
    fn values(&self, place: &Place, target: &Port, t: f64) -> Result<Option<Values>, Error> {
        let found = match place {
            Place::Single { instance, slot, change: None } => self.traffic[*instance].others[*slot].clone(),
            Place::Single { instance, slot, change: Some(Change::Linear(conversion)) } => {
                let found = self.traffic[*instance].others[*slot].as_ref();
                let numbers = |v: &Values| (0..v.len()).map(|k| converted(conversion, v.one(k))).collect::<Vec<_>>();
                found.map(|v| all_of(&numbers(v)))
            }
            Place::Single { instance, slot, change: Some(table) } => {
                let Some(found) = &self.traffic[*instance].others[*slot] else { return Ok(None) };
                let taken = Values::from_number(table.apply(found.one(0)), target.base);
                let none =
                    |_| Error::usage(&target.name, format!("the table of its connection has no entry for {found}"));
                Some(taken.map_err(none)?)
            }
            Place::Fast { .. } | Place::Schedule(_) => Some(Values::Reals(vec![self.number(place, t).real()])),
        };
        let fitting = found.map(|values| values.into_base(target.base)).transpose();
        fitting.map_err(|cause| Error::usage(&target.name, cause))
    }
}

/// Integers, or real numbers if one is.
fn all_of(numbers: &[Number]) -> Values {
    let whole = |number: &Number| if let Number::Integer(i) = number { Some(*i) } else { None };
    let whole: Option<Vec<i128>> = numbers.iter().map(whole).collect();
    whole.map_or_else(|| Values::Reals(numbers.iter().map(|number| number.real()).collect()), Values::Integers)
}

/// Whether values are equal to the last bit.
fn same(a: &Values, b: &Values) -> bool {
    match (a, b) {
        (Values::Reals(a), Values::Reals(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
        }
        _ => a == b,
    }
}

impl Traffic {
    /// Reads the first of `read` and of `read_singly`.
    fn read(&mut self, [fast, single]: [usize; 2], instance: &mut Instance) -> Result<(), Error> {
        if fast > 0 {
            instance.get_reals(&self.read[..fast], &mut self.values[..fast])?;
        }
        for (port, value) in self.read_singly[..single].iter().zip(&mut self.others) {
            *value = port.read(instance)?;
        }
        Ok(())
    }
}
