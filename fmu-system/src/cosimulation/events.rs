//! Co-Simulation of FMI 3.0 with event mode and early return.
//!
//! Between two communication points the master stops at every event: at the next event time that an FMU announces, and where an
//! FMU returns early. There, outputs are passed on to inputs as at a communication point, and FMUs with event mode handle their
//! events with these inputs (FMI 3.0.2, 4.2.1). An FMU without event mode and early return is stepped to the same instants.
//!
//! FMUs that may return early step first; the others follow to the time reached. If one of several returns before the others, the
//! others return to the state saved before the step: they need `canGetAndSetFMUState`.

use super::exchange::Exchange;
use super::grid::Grid;
use super::iteration::{Iterated, iterate};
use super::point::{CommunicationPoint, Ended, end};
use fmu_import::{Error, FmuState, Instance, Kind, Number, Stepped};
use model_description::Interface;
use std::ops::ControlFlow;

/// Maximum number of stops at one instant, and of early returns of one step.
const STOPS: u32 = 100;

/// The FMUs between two stops.
struct Fmus<'a> {
    instances: &'a mut [Instance],
    exchange: &'a mut Exchange,
    /// Instances with event mode; those that may return early; the others.
    with_events: Vec<usize>,
    early: Vec<usize>,
    plain: Vec<usize>,
    outcomes: Vec<Iterated>,
    /// Result of the last step of each instance.
    stepped: Vec<Stepped>,
    /// Instants that are closer than this (s) are the same.
    near: f64,
    /// Index of the instance that requested the end of the simulation.
    ended_by: Option<usize>,
}

impl Fmus<'_> {
    /// Whether an instance has an event at `t`.
    fn event_is_due(&self, t: f64) -> bool {
        let due = |&i: &usize| self.stepped[i].event || self.outcomes[i].next.is_some_and(|next| next <= t + self.near);
        self.with_events.iter().any(due)
    }

    /// Event mode at the time `at` (s), and back to step mode. After the initialization, the instances are in event mode.
    fn event(&mut self, at: f64, initial: bool) -> Result<(), Error> {
        // The time of the event itself if a communication point differs from it only by rounding, so that schedules give the same
        // bits at any communication step.
        let next = self.with_events.iter().filter_map(|&i| self.outcomes[i].next);
        let t = next.filter(|next| (next - at).abs() <= self.near).fold(f64::INFINITY, f64::min);
        let t = if t.is_finite() { t } else { at };
        let Self { instances, exchange, with_events, outcomes, stepped, .. } = self;
        for &index in with_events.iter() {
            stepped[index].event = false;
            if !initial {
                instances[index].enter_event_mode()?;
            }
        }
        let pass_on = |instances: &mut [Instance]| exchange.pass_on_once(instances, t, with_events);
        self.ended_by = iterate(instances, with_events, outcomes, t, pass_on)?;
        if self.ended_by.is_none() {
            with_events.iter().try_for_each(|&index| instances[index].enter_step_mode())?;
        }
        Ok(())
    }

    /// Steps all instances from `t` by `h`, or to the earliest early return; returns the time (s) reached.
    fn step(&mut self, t: f64, to: f64, h: f64) -> Result<f64, Error> {
        let mut saved: Vec<Option<FmuState>> = vec![None; self.instances.len()];
        if self.early.len() > 1 {
            for &index in &self.early {
                let can = self.instances[index].description().co_simulation.as_ref();
                if can.is_some_and(Interface::can_get_and_set_state) {
                    saved[index] = Some(self.instances[index].get_state()?);
                }
            }
        }
        let outcome = self.step_early(t, to, h, &saved);
        for (instance, state) in self.instances.iter_mut().zip(saved) {
            if let Some(state) = state {
                instance.free_state(state)?;
            }
        }
        let reached = outcome?;
        if reached <= t {
            return Ok(t);
        }
        let h = if reached < to { reached - t } else { h };
        for i in 0..self.plain.len() {
            self.advance(self.plain[i], t, h)?;
        }
        Ok(reached)
    }

    /// Steps the instances that may return early until all have reached the same time.
    fn step_early(&mut self, t: f64, to: f64, h: f64, saved: &[Option<FmuState>]) -> Result<f64, Error> {
        let (mut goal, mut h) = (to, h);
        let mut came: Vec<Option<f64>> = vec![None; self.instances.len()];
        for _ in 0..STOPS {
            let mut shorter = None;
            for i in 0..self.early.len() {
                let index = self.early[i];
                match came[index] {
                    Some(time) if time <= goal + self.near => continue,
                    Some(time) => self.go_back(index, time, goal, saved)?,
                    None => {}
                }
                let stepped = self.advance(index, t, h)?;
                if stepped.early && stepped.last < goal - self.near {
                    shorter = Some(stepped.last);
                    came[index] = shorter;
                    break;
                }
                came[index] = Some(goal);
            }
            let Some(time) = shorter else { return Ok(goal) };
            if time < t {
                let cause = format!("a step from {t} s returned early at {time} s, before its beginning");
                return Err(Error::usage("early return", cause));
            }
            (goal, h) = (time, time - t);
            if h <= self.near {
                // An instance returned at its start time: the others go back.
                for (index, time) in came.iter().enumerate() {
                    if let Some(time) = time.filter(|time| *time > goal + self.near) {
                        self.go_back(index, time, goal, saved)?;
                    }
                }
                return Ok(t);
            }
        }
        Err(Error::usage("early return", format!("more than {STOPS} early returns of the step from {t} s to {to} s")))
    }

    /// Restores the state of an instance that stepped to `time` when another returned at `goal`.
    fn go_back(&mut self, index: usize, time: f64, goal: f64, saved: &[Option<FmuState>]) -> Result<(), Error> {
        self.stepped[index].event = false;
        let instance = &mut self.instances[index];
        let Some(state) = saved[index] else {
            let cause = format!(
                "stepped to {time} s, but another FMU returned early at {goal} s, and without canGetAndSetFMUState it cannot \
                 go back; run without early return, or with a shorter step"
            );
            return Err(Error::usage(instance.name(), cause));
        };
        instance.set_state(state)
    }

    fn advance(&mut self, index: usize, t: f64, h: f64) -> Result<Stepped, Error> {
        let stepped = self.instances[index].advance(t, h)?;
        self.stepped[index] = stepped;
        if stepped.terminate {
            self.ended_by = Some(index);
        }
        Ok(stepped)
    }
}

/// Simulates instances that are initialized; [`simulate`](super::run::simulate) begins and ends the run.
pub(super) fn run(
    instances: &mut [Instance],
    exchange: &mut Exchange,
    grid: &Grid,
    row: &mut Vec<Number>,
    hook: &mut impl FnMut(&mut CommunicationPoint<'_>) -> Result<ControlFlow<()>, Error>,
) -> Result<Ended, Error> {
    let (start, near) = (grid.settings().start, 1e-9 * grid.settings().step);
    let of = |wanted: fn(Kind) -> bool| -> Vec<usize> {
        instances.iter().enumerate().filter(|(_, instance)| wanted(instance.kind())).map(|(i, _)| i).collect()
    };
    let with_events = of(|kind| matches!(kind, Kind::CoSimulation { event_mode: true, .. }));
    let early = of(|kind| matches!(kind, Kind::CoSimulation { early_return: true, .. }));
    let plain = of(|kind| !matches!(kind, Kind::CoSimulation { early_return: true, .. }));
    let still = Stepped { terminate: false, event: false, early: false, last: start };
    let (outcomes, stepped) = (vec![Iterated::default(); instances.len()], vec![still; instances.len()]);
    let mut fmus = Fmus { instances, exchange, with_events, early, plain, outcomes, stepped, near, ended_by: None };
    let mut ended = Ended { time: start, by: None };
    let mut stops = 0;
    fmus.event(start, true)?;
    'run: for index in 0..=grid.steps() {
        let time = grid.time(index);
        if fmus.ended_by.is_some() {
            break;
        }
        ended.time = time;
        fmus.exchange.read_all(fmus.instances)?;
        fmus.exchange.row(time, row);
        if index < grid.steps() {
            fmus.exchange.write_all(fmus.instances, time)?;
        }
        let flow =
            hook(&mut CommunicationPoint { index, time, values: row, instances: fmus.instances, touched: false })?;
        if flow.is_break() || index == grid.steps() {
            break;
        }
        let point = grid.time(index + 1);
        let mut t = time;
        while t < point {
            let next = fmus.with_events.iter().filter_map(|&i| fmus.outcomes[i].next).fold(f64::INFINITY, f64::min);
            // An input that jumps is met like an event.
            let jump = if grid.meets { fmus.exchange.jumps_between(t, point).next() } else { None };
            let next = jump.map_or(next, |jump| next.min(jump));
            let to = if next < point - near { next.max(t) } else { point };
            let h = if (t, to) == (time, point) { grid.size(index) } else { to - t };
            let reached = if h > 0.0 { fmus.step(t, to, h)? } else { t };
            if let Some(by) = fmus.ended_by {
                let last = fmus.stepped[by].last.min(to);
                end(fmus.instances, fmus.exchange, row, hook, (index + 1, last), &mut ended)?;
                break 'run;
            }
            stops = if reached > t + near { 0 } else { stops + 1 };
            if stops > STOPS {
                return Err(Error::usage("events", format!("more than {STOPS} events or early returns at t = {t} s")));
            }
            t = reached;
            if fmus.event_is_due(t) {
                fmus.event(t, false)?;
                if fmus.ended_by.is_some() {
                    end(fmus.instances, fmus.exchange, row, hook, (index + 1, t), &mut ended)?;
                    break 'run;
                }
            } else if t < point {
                fmus.exchange.pass_on_once(fmus.instances, t, &[])?;
            }
        }
    }
    ended.by = fmus.ended_by.map(|i| fmus.instances[i].name().to_owned());
    Ok(ended)
}
