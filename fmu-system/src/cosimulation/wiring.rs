//! The connections of a system: the source of each input, and the transformation of values on the way.

use super::parts::Port;
use super::schedule::Schedule;
use super::sequence::Held;
use fmu_import::Number;
use model_description::Conversion;
use std::sync::Arc;

/// The effect of a connection between different units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Units {
    /// It converts the number.
    #[default]
    Convert,
    /// It passes the number on unchanged.
    PassOn,
}

/// The path of a value from an output to an input.
#[derive(Clone, Debug, Default)]
pub struct Crossing {
    /// Whether units are converted.
    pub units: Units,
    /// Transformation after the conversion of the units.
    pub transformation: Option<Transformation>,
}

/// The transformation of a value, as a user writes it.
#[derive(Clone, Debug, PartialEq)]
pub enum Transformation {
    /// A number is converted.
    Linear(Conversion),
    /// Values and their images; other values stay unchanged.
    Table(Arc<[(String, String)]>),
}

impl Transformation {
    /// One transformation after the other; `None` is none.
    ///
    /// # Errors
    /// One is a table, and the other is not.
    pub fn then(first: Option<Self>, second: Option<Self>) -> Result<Option<Self>, String> {
        match (first, second) {
            (Some(Self::Linear(a)), Some(Self::Linear(b))) => {
                Ok(Conversion::then(Some(a), Some(b)).map(Transformation::Linear))
            }
            (Some(Self::Table(a)), Some(Self::Table(b))) => {
                let after = |x: &String| b.iter().find(|(sent, _)| sent == x).map_or(x, |(_, taken)| taken).clone();
                let known = |x: &String| a.iter().any(|(sent, _)| sent == x);
                let all = a.iter().map(|(sent, taken)| (sent.clone(), after(taken)));
                Ok(Some(Self::Table(all.chain(b.iter().filter(|(sent, _)| !known(sent)).cloned()).collect())))
            }
            (Some(_), Some(_)) => Err("a table and a linear transformation on one path are not supported".into()),
            (one, other) => Ok(one.or(other)),
        }
    }
}

/// A variable to record, and the transformation of its values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outlet {
    /// `instance.variable`.
    pub port: String,
    /// Name of the column.
    pub name: String,
    /// Transformation of the values.
    pub transformation: Option<Transformation>,
    /// Unit after the transformation; `None` means the variable's.
    pub unit: Option<String>,
    /// Numbers and names of the values after a table.
    pub items: Vec<(i64, String)>,
}

/// Transformation of a value on its way.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    Linear(Conversion),
    /// Values and their images.
    Table {
        entries: Arc<[(Number, Number)]>,
        /// Values without an entry stay unchanged; otherwise they are missing, because the type of the target has no such value.
        keeps: bool,
    },
}

impl Change {
    /// The resulting number; missing if a table has no entry for it.
    pub(super) fn apply(&self, number: Number) -> Number {
        match self {
            _ if number == Number::Missing => number,
            Self::Linear(conversion) => converted(conversion, number),
            Self::Table { entries, keeps } => {
                let otherwise = if *keeps { number } else { Number::Missing };
                entries.iter().find(|(sent, _)| *sent == number).map_or(otherwise, |(_, taken)| *taken)
            }
        }
    }
}

/// A number after a conversion. An integer keeps its digits where factor and offset are integers.
pub(crate) fn converted(conversion: &Conversion, number: Number) -> Number {
    #[expect(clippy::cast_possible_truncation, reason = "an integer below 2^53")]
    let whole = |x: f64| (x.fract() == 0.0 && x.abs() < 9e15).then_some(x as i128);
    let (factor, offset) = (whole(conversion.factor), whole(conversion.offset));
    let exact = |i: i128| i.checked_mul(factor?)?.checked_add(offset?);
    match number {
        Number::Integer(i) => exact(i).map_or_else(|| Number::Real(conversion.apply(number.real())), Number::Integer),
        other => Number::Real(conversion.apply(other.real())),
    }
}

/// A recorded variable.
#[derive(Clone)]
pub(super) struct Record {
    pub(super) port: Port,
    pub(super) change: Option<Change>,
}

impl Record {
    /// This variable in the instance `count` positions later.
    pub(super) fn shifted(&self, count: usize) -> Self {
        Self { port: self.port.shifted(count), change: self.change.clone() }
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
    /// Whether it may have no value: before a clock ticks, or without a table entry.
    pub(super) fn may_lack(&self) -> bool {
        matches!(self, Self::Port(port, change) if !port.clocks.is_empty() || matches!(change, Some(Change::Table { .. })))
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
    /// Inputs that are not single numbers, with their values over time.
    pub(super) held: Vec<(Port, Held)>,
}

impl Wiring {
    pub(super) fn add(&mut self, target: Port, source: Source, continuous: bool) {
        self.feeds.push(Feed { target, source, continuous });
    }

    pub(super) fn hold(&mut self, target: Port, values: Held) {
        self.held.push((target, values));
    }

    /// These connections and schedules, and the same for a copy of the instances, numbered from `instances` on.
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

    /// Whether the variable with this reference, or an element of it, is fed.
    pub(super) fn feeds_any(&self, instance: usize, reference: Option<u32>) -> bool {
        self.targets().any(|target| target.instance == instance && Some(target.reference) == reference)
    }

    pub(super) fn feeds(&self, instance: usize, name: &str) -> bool {
        self.targets().any(|target| target.instance == instance && target.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_keep_their_digits_through_whole_factors() {
        let of = |factor, offset, number| converted(&Conversion { factor, offset }, number);
        let wide = (1_i128 << 53) + 1;
        assert_eq!(of(1.0, 0.0, Number::Integer(wide)), Number::Integer(wide));
        assert_eq!(of(-2.0, 3.0, Number::Integer(wide)), Number::Integer(3 - 2 * wide));
        assert_eq!(of(0.5, 0.0, Number::Integer(3)), Number::Real(1.5));
        assert_eq!(of(2.0, 0.5, Number::Real(1.0)), Number::Real(2.5));
    }
}
