//! The run itself.

use super::exchange::Exchange;
use super::{Column, Port, Recording, Settings, System, take_messages};
use crate::{Error, Instance, Message};
use std::ops::ControlFlow;

/// A communication point, as a hook sees it: outputs are read, inputs are set, the step is to come.
pub struct Point<'a> {
    /// Number of the point, from 0.
    pub index: u32,
    /// Time in s.
    pub time: f64,
    /// The recorded values, in the order of [`System::record`].
    pub values: &'a [f64],
    instances: &'a mut [Instance],
}

impl Point<'_> {
    /// An instance by its name: to read more, or to set what is not connected.
    pub fn instance(&mut self, name: &str) -> Option<&mut Instance> {
        self.instances.iter_mut().find(|i| i.name() == name)
    }

    /// Log messages since the last call, with the names of the instances.
    pub fn take_messages(&self) -> Vec<(String, Message)> {
        take_messages(self.instances)
    }
}

impl System {
    /// Simulates from start to stop. `hook` sees every communication point, the last one included, and may end the run.
    ///
    /// # Errors
    /// The settings make no sense, or an FMU refuses.
    pub fn run(
        &mut self,
        settings: &Settings,
        mut hook: impl FnMut(&mut Point<'_>) -> Result<ControlFlow<()>, Error>,
    ) -> Result<Recording, Error> {
        let grid = settings.grid().map_err(|cause| Error::usage("settings", cause))?;
        let mut exchange = Exchange::new(self.instances.len(), &self.wiring, &self.records);
        let mut recording =
            Recording::new(self.records.iter().zip(&self.columns).map(|(p, name)| self.column(p, name)));
        let Self { instances, .. } = self;
        for instance in instances.iter_mut() {
            instance.setup(settings.start, Some(settings.stop))?;
            instance.enter_initialization()?;
        }
        // An initial output may depend on an input, through as many FMUs as there are.
        for _ in 0..instances.len() {
            exchange.read_all(instances)?;
            exchange.write_all(instances, settings.start)?;
        }
        for instance in instances.iter_mut() {
            instance.exit_initialization()?;
        }
        let mut row = Vec::new();
        for index in 0..=grid.steps() {
            let time = grid.time(index);
            exchange.read_all(instances)?;
            exchange.row(time, &mut row);
            recording.push(time, &row);
            if index < grid.steps() {
                exchange.write_all(instances, time)?;
            }
            let mut flow = hook(&mut Point { index, time, values: &row, instances: instances.as_mut_slice() })?;
            if flow.is_break() || index == grid.steps() {
                break;
            }
            for (i, instance) in instances.iter_mut().enumerate() {
                if settings.sequential {
                    exchange.write(i, instance, time)?;
                }
                if instance.do_step(time, grid.size(index))?.is_break() {
                    recording.ended_by = Some(instance.name().into());
                    flow = ControlFlow::Break(());
                }
                if settings.sequential {
                    exchange.read(i, instance)?;
                }
            }
            if flow.is_break() {
                break;
            }
        }
        for instance in instances.iter_mut() {
            instance.terminate()?;
        }
        Ok(recording)
    }

    fn column(&self, port: &Port, name: &str) -> Column {
        let instance = &self.instances[port.instance];
        let description = instance.description();
        let variable = description.variable(&port.name);
        let unit = variable.and_then(|v| v.unit.clone());
        let shown = variable.and_then(|v| v.display_unit.as_ref());
        let definition = unit.as_ref().and_then(|u| description.unit(u));
        let display = definition.zip(shown).and_then(|(unit, name)| unit.display_unit(name));
        Column { name: name.into(), unit: unit.unwrap_or_default(), display: display.cloned(), values: Vec::new() }
    }
}
