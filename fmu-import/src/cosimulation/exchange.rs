//! Moving values between FMUs: what is read from each, and where what is set comes from.

use super::Schedule;
use super::parts::Port;
use crate::{Error, Instance, Values};
use model_description::BaseType;

/// Source of an input.
#[derive(Clone)]
pub(super) enum Source {
    /// A variable of another instance.
    Port(Port),
    /// A schedule.
    Schedule(Schedule),
}

/// Who feeds whom.
#[derive(Clone, Default)]
pub(super) struct Wiring {
    feeds: Vec<(Port, Source)>,
}

impl Wiring {
    pub(super) fn add(&mut self, target: Port, source: Source) {
        self.feeds.push((target, source));
    }

    pub(super) fn feeds(&self, instance: usize, name: &str) -> bool {
        self.feeds.iter().any(|(target, _)| target.instance == instance && target.name == name)
    }
}

/// Where a number is found during the run.
#[derive(Clone)]
enum Place {
    Read { instance: usize, slot: usize },
    Schedule(Schedule),
}

/// What crosses the interface of one instance. Double-precision numbers go in one call, the rest one by one.
#[derive(Clone, Default)]
struct Traffic {
    read: Vec<u32>,
    read_singly: Vec<Port>,
    /// Values read last: those of `read`, then those of `read_singly`.
    values: Vec<f64>,
    write: Vec<(u32, Place)>,
    write_singly: Vec<(Port, Place)>,
    references: Vec<u32>,
    buffer: Vec<f64>,
}

/// All traffic of a run.
#[derive(Clone)]
pub(super) struct Exchange {
    traffic: Vec<Traffic>,
    row: Vec<Place>,
}

impl Exchange {
    pub(super) fn new(instances: usize, wiring: &Wiring, records: &[Port]) -> Self {
        let mut traffic: Vec<Traffic> = (0..instances).map(|_| Traffic::default()).collect();
        let fed = |port: &Port| wiring.feeds.iter().find(|(target, _)| target == port).map(|(_, source)| source);
        // A fed input need not be read: its value is known here.
        let origin = |port: &Port| match fed(port) {
            Some(Source::Port(source)) => Source::Port(source.clone()),
            Some(Source::Schedule(schedule)) => Source::Schedule(schedule.clone()),
            None => Source::Port(port.clone()),
        };
        let origins: Vec<Source> = records.iter().map(origin).collect();
        let sources = wiring.feeds.iter().map(|(_, source)| source).chain(&origins);
        for source in sources {
            let Source::Port(port) = source else { continue };
            let traffic = &mut traffic[port.instance];
            if port.base != BaseType::Float64 {
                if !traffic.read_singly.contains(port) {
                    traffic.read_singly.push(port.clone());
                }
            } else if !traffic.read.contains(&port.reference) {
                traffic.read.push(port.reference);
            }
        }
        let place = |traffic: &[Traffic], source: &Source| match source {
            Source::Port(port) => Place::Read { instance: port.instance, slot: traffic[port.instance].slot(port) },
            Source::Schedule(schedule) => Place::Schedule(schedule.clone()),
        };
        let row = origins.iter().map(|source| place(&traffic, source)).collect();
        for (target, source) in &wiring.feeds {
            let place = place(&traffic, source);
            let traffic = &mut traffic[target.instance];
            if target.base == BaseType::Float64 {
                traffic.references.push(target.reference);
                traffic.write.push((target.reference, place));
            } else {
                traffic.write_singly.push((target.clone(), place));
            }
        }
        for t in &mut traffic {
            t.values = vec![0.0; t.read.len() + t.read_singly.len()];
            t.buffer = vec![0.0; t.write.len()];
        }
        Self { traffic, row }
    }

    pub(super) fn read_all(&mut self, instances: &mut [Instance]) -> Result<(), Error> {
        instances.iter_mut().enumerate().try_for_each(|(i, instance)| self.read(i, instance))
    }

    pub(super) fn write_all(&mut self, instances: &mut [Instance], t: f64) -> Result<(), Error> {
        instances.iter_mut().enumerate().try_for_each(|(i, instance)| self.write(i, instance, t))
    }

    pub(super) fn read(&mut self, index: usize, instance: &mut Instance) -> Result<(), Error> {
        let Traffic { read, read_singly, values, .. } = &mut self.traffic[index];
        let (fast, slow) = values.split_at_mut(read.len());
        if !read.is_empty() {
            instance.get_reals(read, fast)?;
        }
        for (port, value) in read_singly.iter().zip(slow) {
            *value = instance.read(port.base, port.reference, 1)?.number().unwrap_or(f64::NAN);
        }
        Ok(())
    }

    pub(super) fn write(&mut self, index: usize, instance: &mut Instance, t: f64) -> Result<(), Error> {
        let mut buffer = std::mem::take(&mut self.traffic[index].buffer);
        let traffic = &self.traffic[index];
        for (value, (_, place)) in buffer.iter_mut().zip(&traffic.write) {
            *value = self.value(place, t);
        }
        if !buffer.is_empty() {
            instance.set_reals(&traffic.references, &buffer)?;
        }
        for (port, place) in &traffic.write_singly {
            let value = Values::from_number(self.value(place, t), port.base);
            let value = value.map_err(|cause| Error::usage(instance.name(), cause))?;
            instance.write(port.base, port.reference, &value)?;
        }
        self.traffic[index].buffer = buffer;
        Ok(())
    }

    /// The recorded values at time `t`.
    pub(super) fn row(&self, t: f64, row: &mut Vec<f64>) {
        row.clear();
        row.extend(self.row.iter().map(|place| self.value(place, t)));
    }

    fn value(&self, place: &Place, t: f64) -> f64 {
        match place {
            Place::Read { instance, slot } => self.traffic[*instance].values[*slot],
            Place::Schedule(schedule) => schedule.at(t),
        }
    }
}

impl Traffic {
    /// Where the value of a port is found among those that are read; the port is one of them.
    fn slot(&self, port: &Port) -> usize {
        let fast = || self.read.iter().position(|reference| *reference == port.reference);
        let slow = || self.read_singly.iter().position(|p| p == port).map(|i| i + self.read.len());
        (if port.base == BaseType::Float64 { fast() } else { slow() }).unwrap_or_default()
    }
}
