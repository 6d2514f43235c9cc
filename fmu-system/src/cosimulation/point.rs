//! A communication point of a run.

use super::exchange::Exchange;
use fmu_import::{Error, Instance, Message, Number};
use std::ops::ControlFlow;

/// A communication point passed to a hook: outputs are read, inputs are set, the step has not been taken.
pub struct CommunicationPoint<'a> {
    /// Number of the point, from 0.
    pub index: u32,
    /// Time in s.
    pub time: f64,
    /// The recorded values, in the order of [`System::record`](super::System::record).
    pub values: &'a [Number],
    pub(super) instances: &'a mut [Instance],
    /// The hook has used an instance.
    pub(super) touched: bool,
}

impl CommunicationPoint<'_> {
    /// An instance by its name: to read further variables, or to set unconnected ones.
    pub fn instance(&mut self, name: &str) -> Option<&mut Instance> {
        self.touched = true;
        self.instances.iter_mut().find(|i| i.name() == name)
    }

    /// Log messages since the last call, with the names of the instances.
    pub fn take_messages(&self) -> Vec<(String, Message)> {
        take_messages(self.instances)
    }
}

/// The end of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// Time of the last communication point in s.
    pub time: f64,
    /// The instance that requested the end of the simulation, if any.
    pub by: Option<String>,
}

/// The last point of a run that an instance has ended: outputs are read, but no inputs are set.
pub(super) fn end(
    instances: &mut [Instance],
    exchange: &mut Exchange,
    row: &mut Vec<Number>,
    hook: &mut impl FnMut(&mut CommunicationPoint<'_>) -> Result<ControlFlow<()>, Error>,
    (index, time): (u32, f64),
    ended: &mut Ended,
) -> Result<(), Error> {
    if time > ended.time {
        ended.time = time;
        exchange.read_all(instances)?;
        exchange.row(time, row);
        // The run is over, regardless of the hook's result.
        hook(&mut CommunicationPoint { index, time, values: row, instances, touched: false }).map(drop)?;
    }
    Ok(())
}

/// Log messages since the last call, with the names of the instances.
pub(super) fn take_messages(instances: &[Instance]) -> Vec<(String, Message)> {
    let of = |i: &Instance| i.take_messages().into_iter().map(|m| (i.name().to_owned(), m)).collect::<Vec<_>>();
    instances.iter().flat_map(of).collect()
}

/// A message with the name of its instance, with which many FMUs begin.
pub fn with_name(instance: &str, text: String) -> String {
    let named = text.strip_prefix(instance).is_some_and(|rest| rest.starts_with(": "));
    if named { text } else { format!("{instance}: {text}") }
}
