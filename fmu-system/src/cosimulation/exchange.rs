//! Moving values between FMUs: the variables read from each FMU, and the sources of those set.

use super::parts::Port;
use super::sequence::Held;
use super::{Schedule, loops};
use fmu_import::{Error, Instance, Kind, Values};
use model_description::Conversion;

/// Source of an input.
#[derive(Clone)]
pub(super) enum Source {
    /// A variable of another instance, converted to the unit of the target.
    Port(Port, Option<Conversion>),
    /// A schedule.
    Schedule(Schedule),
}

/// An input and its source.
#[derive(Clone)]
struct Feed {
    target: Port,
    source: Source,
    /// The input is continuous: in Model Exchange it is set at every evaluation, a discrete one at events.
    continuous: bool,
}

/// Who feeds whom.
#[derive(Clone, Default)]
pub(super) struct Wiring {
    feeds: Vec<Feed>,
    /// Inputs other than single numbers, with their values over time.
    held: Vec<(Port, Held)>,
}

impl Wiring {
    pub(super) fn add(&mut self, target: Port, source: Source, continuous: bool) {
        self.feeds.push(Feed { target, source, continuous });
    }

    pub(super) fn hold(&mut self, target: Port, values: Held) {
        self.held.push((target, values));
    }

    /// These connections and schedules, together with those of a copy of the instances, numbered from `instances` on.
    pub(super) fn with_copy(&self, instances: usize) -> Self {
        let mut both = self.clone();
        both.feeds.extend(self.feeds.iter().map(|feed| Feed {
            target: feed.target.shifted(instances),
            source: match &feed.source {
                Source::Port(port, conversion) => Source::Port(port.shifted(instances), *conversion),
                schedule @ Source::Schedule(_) => schedule.clone(),
            },
            continuous: feed.continuous,
        }));
        both.held.extend(self.held.iter().map(|(port, held)| (port.shifted(instances), held.clone())));
        both
    }

    /// Inputs that are fed over time, with the times (s) at which their values jump.
    pub(super) fn jumps(&self) -> impl Iterator<Item = (&Port, Vec<f64>)> {
        let feeds = self.feeds.iter().filter_map(|feed| match &feed.source {
            Source::Schedule(schedule) => Some((&feed.target, schedule.jumps().collect())),
            Source::Port(..) => None,
        });
        feeds.chain(self.held.iter().map(|(target, held)| (target, held.times().collect())))
    }

    fn targets(&self) -> impl Iterator<Item = &Port> {
        self.feeds.iter().map(|feed| &feed.target).chain(self.held.iter().map(|(target, _)| target))
    }

    /// Whether the variable with this reference is fed, or an element of it.
    pub(super) fn feeds_any(&self, instance: usize, reference: Option<u32>) -> bool {
        self.targets().any(|target| target.instance == instance && Some(target.reference) == reference)
    }

    pub(super) fn feeds(&self, instance: usize, name: &str) -> bool {
        self.targets().any(|target| target.instance == instance && target.name == name)
    }
}

/// Location of a number during the run.
#[derive(Clone)]
enum Place {
    Read { instance: usize, slot: usize, conversion: Option<Conversion> },
    Schedule(Schedule),
}

/// Traffic of one instance. Double-precision numbers are passed in one call, other values one by one.
#[derive(Clone, Default)]
struct Traffic {
    read: Vec<u32>,
    read_singly: Vec<Port>,
    /// Numbers of variables in `read` and `read_singly` that feed inputs: these come first.
    feeding: [usize; 2],
    /// Values read last: those of `read`, then those of `read_singly`.
    values: Vec<f64>,
    write: Vec<(u32, Place)>,
    write_singly: Vec<(Port, Place)>,
    /// Numbers of variables in `write` and `write_singly` that are continuous: these come first.
    continuous: [usize; 2],
    references: Vec<u32>,
    /// Values written last: those of `write`, then those of `write_singly`.
    buffer: Vec<f64>,
    singles: Vec<f64>,
    /// Inputs other than single numbers, and the index of the value written last.
    held: Vec<(Port, Held, Option<usize>)>,
}

/// All traffic of a run.
#[derive(Clone)]
pub(super) struct Exchange {
    traffic: Vec<Traffic>,
    row: Vec<Place>,
    /// Number of inputs that are fed.
    fed: usize,
    /// Time (s) since which step schedules are held; `None` if they are read at every exchange.
    pub(super) since: Option<f64>,
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
    /// Change of the input for a change of what feeds it: not 1 between different units.
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
    pub(super) fn new(instances: usize, wiring: &Wiring, records: &[Port]) -> Self {
        let mut traffic: Vec<Traffic> = (0..instances).map(|_| Traffic::default()).collect();
        let fed = |port: &Port| wiring.feeds.iter().find(|feed| feed.target == *port).map(|feed| &feed.source);
        // A fed input need not be read: its value is known here.
        let origin = |port: &Port| match fed(port) {
            Some(source) => source.clone(),
            None => Source::Port(port.clone(), None),
        };
        let origins: Vec<Source> = records.iter().map(origin).collect();
        let sources = wiring.feeds.iter().map(|feed| &feed.source).chain(&origins);
        for (index, source) in sources.enumerate() {
            let Source::Port(port, _) = source else { continue };
            let traffic = &mut traffic[port.instance];
            if !port.is_fast() {
                if !traffic.read_singly.contains(port) {
                    traffic.read_singly.push(port.clone());
                }
            } else if !traffic.read.contains(&port.reference) {
                traffic.read.push(port.reference);
            }
            if index < wiring.feeds.len() {
                traffic.feeding = [traffic.read.len(), traffic.read_singly.len()];
            }
        }
        let place = |traffic: &[Traffic], source: &Source| match source {
            Source::Port(port, conversion) => {
                let slot = traffic[port.instance].slot(port);
                Place::Read { instance: port.instance, slot, conversion: *conversion }
            }
            Source::Schedule(schedule) => Place::Schedule(schedule.clone()),
        };
        let row = origins.iter().map(|source| place(&traffic, source)).collect();
        let (continuous, discrete): (Vec<_>, Vec<_>) = wiring.feeds.iter().partition(|feed| feed.continuous);
        for Feed { target, source, continuous } in continuous.into_iter().chain(discrete) {
            let place = place(&traffic, source);
            let traffic = &mut traffic[target.instance];
            let fast = target.is_fast();
            if fast {
                traffic.references.push(target.reference);
                traffic.write.push((target.reference, place));
            } else {
                traffic.write_singly.push((target.clone(), place));
            }
            traffic.continuous[usize::from(!fast)] += usize::from(*continuous);
        }
        for t in &mut traffic {
            t.values = vec![0.0; t.read.len() + t.read_singly.len()];
            t.buffer = vec![0.0; t.write.len()];
            t.singles = vec![0.0; t.write_singly.len()];
        }
        for (port, values) in &wiring.held {
            traffic[port.instance].held.push((port.clone(), values.clone(), None));
        }
        Self { traffic, row, fed: wiring.feeds.len(), since: None }
    }

    /// A run begins: no value is held or has been written.
    pub(super) fn begin(&mut self) {
        self.since = None;
        self.traffic.iter_mut().flat_map(|t| &mut t.held).for_each(|(_, _, last)| *last = None);
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
        let mut singles = std::mem::take(&mut self.traffic[index].singles);
        let traffic = &self.traffic[index];
        for (value, (_, place)) in buffer.iter_mut().zip(&traffic.write) {
            *value = self.value(place, t);
        }
        if !buffer.is_empty() {
            instance.set_reals(&traffic.references, &buffer)?;
        }
        for ((port, place), single) in traffic.write_singly.iter().zip(&mut singles) {
            *single = self.value(place, t);
            write_single(instance, port, *single)?;
        }
        (self.traffic[index].buffer, self.traffic[index].singles) = (buffer, singles);
        self.hold(index, instance, t).map(drop)
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

    /// Passes outputs on to inputs until nothing changes: an output may depend on an input, through several FMUs. A loop of
    /// continuous inputs is solved. FMUs for Co-Simulation are excluded: they exchange values at communication points. Returns
    /// whether a discrete input changed.
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
                return Ok(discrete);
            }
        }
        loops::solve(self, instances, t).map(|()| discrete)
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
                if self.value(place, t).to_bits() != traffic.buffer[slot].to_bits() {
                    let (source, factor) = match place {
                        Place::Read { instance, slot, conversion } => {
                            let source = self.traffic[*instance].read.get(*slot).map(|r| (*instance, *r));
                            (source, conversion.map_or(1.0, |conversion| conversion.factor))
                        }
                        Place::Schedule(_) => (None, 1.0),
                    };
                    let source = source.filter(|_| slot < traffic.continuous[0]);
                    all.push(Unsettled { index, slot, reference: *reference, source, factor });
                }
            }
            for ((port, place), old) in traffic.write_singly.iter().zip(&traffic.singles) {
                if self.value(place, t).to_bits() != old.to_bits() {
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
        Ok(inputs.iter().map(|input| self.value(&self.traffic[input.index].write[input.slot].1, t)).collect())
    }

    /// The present values of these inputs.
    pub(super) fn values_of(&self, inputs: &[Unsettled]) -> Vec<f64> {
        inputs.iter().map(|input| self.traffic[input.index].buffer[input.slot]).collect()
    }

    /// Passes outputs on to inputs once, as at a communication point. Returns whether a discrete input of one of these
    /// instances changed.
    pub(super) fn pass_on_once(&mut self, instances: &mut [Instance], t: f64, of: &[usize]) -> Result<bool, Error> {
        self.read_all(instances)?;
        let mut discrete = false;
        for (index, instance) in instances.iter_mut().enumerate() {
            let (_, some) = self.pass_on(index, instance, t, Inputs::All)?;
            discrete |= some && of.contains(&index);
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
        let mut singles = std::mem::take(&mut self.traffic[index].singles);
        let traffic = &self.traffic[index];
        let [fast, single] = match inputs {
            Inputs::All => [buffer.len(), singles.len()],
            Inputs::Continuous => traffic.continuous,
        };
        let (mut changed, mut discrete) = (false, false);
        for (i, (value, (_, place))) in buffer.iter_mut().zip(&traffic.write).enumerate().take(fast) {
            let new = self.value(place, t);
            if new.to_bits() != value.to_bits() {
                *value = new;
                changed = true;
                discrete |= i >= traffic.continuous[0];
            }
        }
        if changed {
            instance.set_reals(&traffic.references[..fast], &buffer[..fast])?;
        }
        for (i, (value, (port, place))) in singles.iter_mut().zip(&traffic.write_singly).enumerate().take(single) {
            let new = self.value(place, t);
            if new.to_bits() != value.to_bits() {
                *value = new;
                write_single(instance, port, new)?;
                changed = true;
                discrete |= i >= traffic.continuous[1];
            }
        }
        (self.traffic[index].buffer, self.traffic[index].singles) = (buffer, singles);
        if inputs == Inputs::All && self.hold(index, instance, t)? {
            (changed, discrete) = (true, true);
        }
        Ok((changed, discrete))
    }

    /// The first point of a schedule after the time `t` (s).
    pub(super) fn next_point(&self, t: f64) -> Option<f64> {
        let next = |place: &Place| match place {
            Place::Read { .. } => None,
            Place::Schedule(schedule) => schedule.next_point(t),
        };
        let fast = self.traffic.iter().flat_map(|t| t.write.iter().map(|(_, place)| place));
        let singly = self.traffic.iter().flat_map(|t| t.write_singly.iter().map(|(_, place)| place));
        let held = self.traffic.iter().flat_map(|traffic| &traffic.held);
        let held = held.filter_map(|(_, values, _)| values.next_point(t));
        fast.chain(singly).filter_map(next).chain(held).reduce(f64::min)
    }

    /// The recorded values at time `t`.
    pub(super) fn row(&self, t: f64, row: &mut Vec<f64>) {
        row.clear();
        row.extend(self.row.iter().map(|place| self.value(place, t)));
    }

    fn value(&self, place: &Place, t: f64) -> f64 {
        match place {
            Place::Read { instance, slot, conversion } => {
                let value = self.traffic[*instance].values[*slot];
                conversion.map_or(value, |conversion| conversion.apply(value))
            }
            Place::Schedule(schedule) => match self.since {
                None => schedule.at(t),
                Some(since) => schedule.held(since, t),
            },
        }
    }
}

fn write_single(instance: &mut Instance, port: &Port, value: f64) -> Result<(), Error> {
    let value = Values::from_number(value, port.base).map_err(|cause| Error::usage(instance.name(), cause))?;
    let Some((element, count)) = port.element else { return instance.set_at(port.base, port.reference, &value) };
    // The other elements stay.
    let mut all = instance.get_at(port.base, port.reference, count)?;
    if !all.replace(element, &value) {
        return Err(Error::usage(instance.name(), format!("{} has no such element", port.name)));
    }
    instance.set_at(port.base, port.reference, &all)
}

impl Traffic {
    /// Reads the first of `read` and of `read_singly`.
    fn read(&mut self, [fast, single]: [usize; 2], instance: &mut Instance) -> Result<(), Error> {
        let (numbers, others) = self.values.split_at_mut(self.read.len());
        if fast > 0 {
            instance.get_reals(&self.read[..fast], &mut numbers[..fast])?;
        }
        for (port, value) in self.read_singly[..single].iter().zip(others) {
            let (element, count) = port.element.unwrap_or((0, 1));
            *value = instance.get_at(port.base, port.reference, count)?.number_at(element).unwrap_or(f64::NAN);
        }
        Ok(())
    }

    /// Location of a port's value among those read; the port is one of them.
    fn slot(&self, port: &Port) -> usize {
        let fast = || self.read.iter().position(|reference| *reference == port.reference);
        let slow = || self.read_singly.iter().position(|p| p == port).map(|i| i + self.read.len());
        (if port.is_fast() { fast() } else { slow() }).unwrap_or_default()
    }
}
