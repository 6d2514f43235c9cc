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

/// Minimum fraction of a step when a discarded one is repeatedly halved.
const HALVES: u32 = 10;

/// Simulates instances whose values are set, from start to stop. `hook` is called at every communication point, including the
/// last one, and may end the run. All runs begin and end here.
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

/// Steps an instance; breaks when the FMU requests the end of the simulation. With a careful grid, a step that the FMU discards is
/// taken in halves from the state before it, and so are these.
fn advance(instance: &mut Instance, grid: &Grid, (t, h): (f64, f64), halves: u32) -> Result<ControlFlow<()>, Error> {
    if !grid.careful || halves == HALVES || !may_halve(instance) {
        return instance.do_step(t, h);
    }
    let state = instance.get_state()?;
    let outcome = match instance.do_step(t, h) {
        Err(error) if error.is_discard() => {
            instance.set_state(state)?;
            let half = 0.5 * h;
            match advance(instance, grid, (t, half), halves + 1)? {
                ControlFlow::Continue(()) => advance(instance, grid, (t + half, h - half), halves + 1),
                end @ ControlFlow::Break(()) => Ok(end),
            }
        }
        outcome => outcome,
    };
    instance.free_state(state)?;
    outcome
}

/// Whether an FMU can go back before a step and take shorter ones.
fn may_halve(instance: &Instance) -> bool {
    let of = instance.description().co_simulation.as_ref();
    of.is_some_and(|of| of.can_get_and_set_state() && of.flag("canHandleVariableCommunicationStepSize"))
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
        let (mut from, next) = (time, grid.time(index + 1));
        let between: Vec<f64> = if grid.meets { exchange.jumps_between(time, next).collect() } else { Vec::new() };
        for to in between.iter().copied().chain([next]) {
            let h = if between.is_empty() { grid.size(index) } else { to - from };
            if from > time {
                exchange.read_all(instances)?;
                exchange.write_all(instances, from)?;
            }
            for (i, instance) in instances.iter_mut().enumerate() {
                if settings.sequential {
                    exchange.write(i, instance, from)?;
                }
                if advance(instance, grid, (from, h), 0)?.is_break() {
                    last = instance.last_successful_time().unwrap_or(to).min(to).min(last);
                    ended.by = Some(instance.name().into());
                }
                if settings.sequential {
                    exchange.read(i, instance)?;
                }
            }
            if ended.by.is_some() {
                break;
            }
            from = to;
        }
        if ended.by.is_some() {
            end(instances, exchange, row, hook, (index + 1, last), &mut ended)?;
            break;
        }
    }
    Ok(ended)
}

impl System {
    /// Simulates from start to stop. `hook` is called at every communication point, including the last one, and may end the run.
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
        let mut recording = Recording::new(self.columns.iter().cloned());
        recording.texts =
            self.texts.iter().map(|(_, name)| TextColumn { name: name.clone(), values: vec![] }).collect();
        let mut grid = match self.grid(settings) {
            Ok(grid) => grid,
            Err(error) => return (recording, Err(error)),
        };
        let mut exchange =
            Exchange::new(self.instances.len(), &self.wiring, &self.records, self.texts.iter().map(|(port, _)| port));
        exchange.listener = self.listener;
        let mut ended = self.attempt(&grid, &mut exchange, &mut recording, &mut hook);
        // A discarded step needs the state before it, which is not saved without need. The run is the same until there.
        let steps = matches!(self.method, Method::CoSimulation { event_mode: false, early_return: false });
        let halve = |error: &Error| steps && error.is_discard() && self.instances.iter().any(may_halve);
        if ended.as_ref().err().is_some_and(halve) && self.restart().is_ok() {
            grid.careful = true;
            let at = recording.time.last().copied().unwrap_or_default();
            let retried = self.attempt(&grid, &mut exchange, &mut recording, &mut hook);
            if retried.is_ok() {
                self.note(format!("an FMU refused the step after {at} s as too long: it took shorter ones"));
            }
            ended = retried;
        }
        self.notes.append(&mut exchange.notes);
        let outcome = ended.map(|ended| recording.ended_by = ended.by);
        (recording, outcome)
    }

    /// Instances as before the run, with the values set.
    fn restart(&mut self) -> Result<(), Error> {
        for (part, instance) in self.parts.0.iter().zip(&mut self.instances) {
            if instance.reset().is_err() {
                *instance = part.fmu.instantiate_as(part.kind, &part.name, part.logging)?;
            }
            part.configure(instance)?;
        }
        let Self { instances, set, .. } = self;
        set.iter().try_for_each(|(port, values)| instances[port.instance].set_at(port.base, port.reference, values))
    }

    /// Runs, and records the points after those that are recorded.
    fn attempt(
        &mut self,
        grid: &Grid,
        exchange: &mut Exchange,
        recording: &mut Recording,
        hook: &mut impl FnMut(&mut CommunicationPoint<'_>) -> Result<ControlFlow<()>, Error>,
    ) -> Result<Ended, Error> {
        let (texts, known) = (&self.texts, recording.time.len());
        let mut points = 0;
        simulate(&self.method, &mut self.instances, exchange, grid, &mut Vec::new(), |point| {
            points += 1;
            if points <= known {
                return Ok(ControlFlow::Continue(()));
            }
            // Texts first: where one cannot be read, no column is longer than another.
            let mut cells = Vec::with_capacity(texts.len());
            for (port, _) in texts {
                let values = port.read(&mut point.instances[port.instance])?;
                cells.push(values.map(|values| values.cell()).unwrap_or_default());
            }
            recording.push(point.time, point.values);
            recording.texts.iter_mut().zip(cells).for_each(|(column, cell)| column.values.push(cell));
            hook(point)
        })
    }
}
