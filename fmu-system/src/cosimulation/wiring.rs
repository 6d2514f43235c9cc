//! The connections of a system: who feeds whom, and what becomes of a value on its way.

use super::parts::Port;
use super::schedule::Schedule;
use super::sequence::Held;
use fmu_import::Number;
use model_description::{Conversion, Measured};
use std::sync::Arc;

/// The effect of a connection between different units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Units {
    /// It converts the number.
    #[default]
    Convert,
    /// It passes the number on as it is.
    PassOn,
}

/// The path of a value from an output to an input.
#[derive(Clone, Copy, Debug, Default)]
pub struct Crossing<'a> {
    /// Whether units are converted.
    pub units: Units,
    /// Units of source and target, for an FMU that names none.
    pub stated: [Option<Measured<'a>>; 2],
    /// Conversion after that of the units.
    pub transformation: Option<Conversion>,
    /// Source values and what becomes of them, as a user writes them; instead of any conversion.
    pub table: Option<&'a [(String, String)]>,
}

/// What becomes of a value on its way.
#[derive(Clone)]
pub(super) enum Change {
    Linear(Conversion),
    /// Values and what becomes of each.
    Table(Arc<[(Number, Number)]>),
}

impl Change {
    /// The number that arrives; missing if a table does not have it.
    pub(super) fn apply(&self, number: Number) -> Number {
        match self {
            _ if number == Number::Missing => number,
            Self::Linear(conversion) => Number::Real(conversion.apply(number.real())),
            Self::Table(table) => {
                table.iter().find(|(sent, _)| *sent == number).map_or(Number::Missing, |(_, taken)| *taken)
            }
        }
    }
}

/// Source of an input.
#[derive(Clone)]
pub(super) enum Source {
    /// A variable of another instance, converted to the unit of the target.
    Port(Port, Option<Change>),
    /// A schedule.
    Schedule(Schedule),
}

impl Source {
    /// Whether it may have no value: before a clock ticks, or beyond a table.
    pub(super) fn may_lack(&self) -> bool {
        matches!(self, Self::Port(port, change) if !port.clocks.is_empty() || matches!(change, Some(Change::Table(_))))
    }
}

/// An input and its source.
#[derive(Clone)]
pub(super) struct Feed {
    pub(super) target: Port,
    pub(super) source: Source,
    /// The input is continuous: in Model Exchange it is set at every evaluation, a discrete one at events.
    pub(super) continuous: bool,
}

/// Who feeds whom.
#[derive(Clone, Default)]
pub(super) struct Wiring {
    pub(super) feeds: Vec<Feed>,
    /// Inputs other than single numbers, with their values over time.
    pub(super) held: Vec<(Port, Held)>,
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
                Source::Port(port, conversion) => Source::Port(port.shifted(instances), conversion.clone()),
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
