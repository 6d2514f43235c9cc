//! The run itself.

use super::exchange::Exchange;
use super::grid::{Grid, Settings};
use super::method::Method;
use super::point::{CommunicationPoint, Ended, end};
use super::recording::{Recording, TextColumn};
use super::system::System;
use super::{continuous, events};
use fmu_import::{Error, Instance, Kind, Number};
use std::ops::ControlFlow;

/// Simulates instances whose values are set, from start to stop. `hook` sees every communication point, the last one included,
/// and may end the run. All runs begin and end here.
pub(super) fn simulate(
    method: &Method,
    instances: &mut [Instance],
    exchange: &mut Exchange,
    grid: &Grid,
    row: &mut Vec<Number>,
    mut hook: impl FnMut(&mut CommunicationPoint<'_>) -> Result<ControlFlow<()>, Error>,
) -> Result<Ended, Error> {
    let settings = grid.settings();
    let kinds: Vec<Kind> = instances.iter().map(Instance::kind).collect();
    method.check(&kinds, settings.sequential)?;
    exchange.begin();
    for instance in instances.iter_mut() {
        let tolerance = match method {
            // Of the algorithms inside an FMU that our solver calls.
            Method::ModelExchange(integration) if instance.kind() == Kind::ModelExchange => {
                integration.solver.tolerance()
            }
            _ => grid.tolerance.or(instance.description().default_experiment.tolerance),
        };
        instance.setup_with(settings.start, Some(settings.stop), tolerance)?;
        instance.enter_initialization()?;
    }
    // An initial output may depend on an input through any number of FMUs.
    for _ in 0..instances.len() {
        exchange.read_all(instances)?;
        exchange.write_all(instances, settings.start)?;
    }
    for instance in instances.iter_mut() {
        instance.exit_initialization()?;
    }
    let ended = match method {
        Method::CoSimulation { event_mode: false, early_return: false } => {
            step(instances, exchange, grid, row, &mut hook)?
        }
        Method::CoSimulation { .. } => events::run(instances, exchange, grid, row, &mut hook)?,
        Method::ModelExchange(integration) => continuous::run(instances, exchange, grid, integration, row, &mut hook)?,
    };
    for instance in instances.iter_mut() {
        instance.terminate()?;
    }
    Ok(ended)
}

/// Steps instances that are initialized.
fn step(
    instances: &mut [Instance],
    exchange: &mut Exchange,
    grid: &Grid,
    row: &mut Vec<Number>,
    hook: &mut impl FnMut(&mut CommunicationPoint<'_>) -> Result<ControlFlow<()>, Error>,
) -> Result<Ended, Error> {
    let settings = grid.settings();
    let (mut ended, mut last) = (Ended { time: settings.start, by: None }, f64::INFINITY);
    for index in 0..=grid.steps() {
        let time = grid.time(index);
        ended.time = time;
        exchange.read_all(instances)?;
        exchange.row(time, row);
        if index < grid.steps() {
            exchange.write_all(instances, time)?;
        }
        let flow = hook(&mut CommunicationPoint { index, time, values: row, instances, touched: false })?;
        if flow.is_break() || index == grid.steps() {
            break;
        }
        for (i, instance) in instances.iter_mut().enumerate() {
            if settings.sequential {
                exchange.write(i, instance, time)?;
            }
            if instance.do_step(time, grid.size(index))?.is_break() {
                let of_step = || grid.time(index + 1);
                last = instance.last_successful_time().unwrap_or_else(|_| of_step()).min(of_step()).min(last);
                ended.by = Some(instance.name().into());
            }
            if settings.sequential {
                exchange.read(i, instance)?;
            }
        }
        if ended.by.is_some() {
            end(instances, exchange, row, hook, (index + 1, last), &mut ended)?;
            break;
        }
    }
    Ok(ended)
}

impl System {
    /// Simulates from start to stop. `hook` sees every communication point, the last one included, and may end the run.
    ///
    /// # Errors
    /// The settings are invalid, or an FMU refuses.
    pub fn run(
        &mut self,
        settings: &Settings,
        hook: impl FnMut(&mut CommunicationPoint<'_>) -> Result<ControlFlow<()>, Error>,
    ) -> Result<Recording, Error> {
        let (recording, outcome) = self.run_keeping(settings, hook);
        outcome.map(|()| recording)
    }

    /// Like [`run`](Self::run); the recording ends before an error.
    pub fn run_keeping(
        &mut self,
        settings: &Settings,
        mut hook: impl FnMut(&mut CommunicationPoint<'_>) -> Result<ControlFlow<()>, Error>,
    ) -> (Recording, Result<(), Error>) {
        let mut recording = Recording::new(self.columns());
        recording.texts =
            self.texts.iter().map(|(_, name)| TextColumn { name: name.clone(), values: vec![] }).collect();
        let grid = match self.grid(settings) {
            Ok(grid) => grid,
            Err(error) => return (recording, Err(error)),
        };
        let mut exchange =
            Exchange::new(self.instances.len(), &self.wiring, &self.records, self.texts.iter().map(|(port, _)| port));
        let texts = &self.texts;
        let ended = simulate(&self.method, &mut self.instances, &mut exchange, &grid, &mut Vec::new(), |point| {
            // Texts first: where one cannot be read, no column is longer than another.
            let mut cells = Vec::with_capacity(texts.len());
            for (port, _) in texts {
                let values = port.read(&mut point.instances[port.instance])?;
                cells.push(values.map(|values| values.cell()).unwrap_or_default());
            }
            recording.push(point.time, point.values);
            recording.texts.iter_mut().zip(cells).for_each(|(column, cell)| column.values.push(cell));
            hook(point)
        });
        let outcome = ended.map(|ended| recording.ended_by = ended.by);
        (recording, outcome)
    }
}
