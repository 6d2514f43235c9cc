//! Model Exchange: the master integrates all FMUs of a system as one, [`Fmus`](super::coupled::Fmus).
//!
//! Outputs are propagated to continuous inputs until all values are stable; a point of a schedule is an event. FMUs for
//! Co-Simulation in the system step from one communication point to the next: between two points, the other FMUs receive their
//! outputs at the first point. A communication point is an event of all FMUs.

use super::coupled::{Equations, Feed};
use super::exchange::{Exchange, Inputs};
use super::grid::Grid;
use super::method::Integration;
use super::point::{CommunicationPoint, Ended, end};
use crate::integration::{Driver, TrialError, advice};
use fmu_import::{Error, Instance, Kind, Number};
use std::ops::ControlFlow;

impl Feed for Exchange {
    fn settle(&mut self, instances: &mut [Instance], t: f64, inputs: Inputs) -> Result<bool, Error> {
        Self::settle(self, instances, t, inputs)
    }

    fn event(&mut self, _: &mut [Instance], t: f64) -> Result<(), Error> {
        self.since = Some(t);
        Ok(())
    }

    fn next_point(&self, t: f64) -> Option<f64> {
        Self::next_point(self, t)
    }

    fn limited(&mut self, t: f64, h: f64) {
        if let Some(advice) = advice(t, h, self.stop) {
            self.note(advice);
        }
    }
}

/// Simulates instances that are initialized and in event mode; [`simulate`](super::run::simulate) begins and ends the run.
pub(super) fn run(
    instances: &mut [Instance],
    exchange: &mut Exchange,
    grid: &Grid,
    integration: &Integration,
    row: &mut Vec<Number>,
    hook: &mut impl FnMut(&mut CommunicationPoint<'_>) -> Result<ControlFlow<()>, Error>,
) -> Result<Ended, Error> {
    let start = grid.settings().start;
    let mut ended = Ended { time: start, by: None };
    let steppers: Vec<usize> = (0..instances.len()).filter(|&i| instances[i].kind() != Kind::ModelExchange).collect();
    let mut equations = Equations::new(instances, integration)?;
    exchange.stop = grid.settings().stop;
    steppers.iter().try_for_each(|&i| exchange.read(i, &mut instances[i]))?;
    let mut ended_by = None;
    let (mut driver, mut flow) =
        Driver::start(&mut equations.of(instances, exchange), integration.solver, grid.settings().step, start)?;
    for index in 0..=grid.steps() {
        let time = grid.time(index);
        if index > 0 && steppers.is_empty() {
            flow = driver.run_to(&mut equations.of(instances, exchange), time)?;
        } else if index > 0 {
            flow = driver.run_before(&mut equations.of(instances, exchange), time)?;
            for &i in &steppers {
                if flow.is_continue() && instances[i].do_step(grid.time(index - 1), grid.size(index - 1))?.is_break() {
                    (flow, ended_by) = (ControlFlow::Break(()), Some(i));
                }
                exchange.read(i, &mut instances[i])?;
            }
            if flow.is_continue() {
                flow = driver.interrupt(&mut equations.of(instances, exchange))?;
            }
        }
        if flow.is_break() {
            ended.by = equations.ended_by().or(ended_by).map(|i| instances[i].name().to_owned());
            let last = driver.point().0;
            end(instances, exchange, row, hook, (index, last), &mut ended)?;
            break;
        }
        ended.time = time;
        let (t, x) = driver.point();
        equations.of(instances, exchange).place(t, x).map_err(TrialError::into_error)?;
        exchange.read_all(instances)?;
        exchange.row(t, row);
        if index < grid.steps() {
            steppers.iter().try_for_each(|&i| exchange.write(i, &mut instances[i], time))?;
        }
        let mut point = CommunicationPoint { index, time, values: row, instances, touched: false };
        if hook(&mut point)?.is_break() {
            break;
        }
        if point.touched {
            // The hook may have set variables on which the derivatives depend.
            equations.forget();
            driver.forget();
        }
    }
    Ok(ended)
}
