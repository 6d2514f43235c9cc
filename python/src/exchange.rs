//! The loops of FMPy's `simulate_fmu` for Model Exchange: forward Euler with FMPy's bits, and our integrators between its points.

use crate::course::{Course, cut};
use crate::input::{Input, is_close};
use crate::record::Record;
use crate::stepping::update;
use fmu_import::{Error, Instance};
use fmu_system::cosimulation::{Equations, Feed, Inputs, Integration, Solver};
use fmu_system::integration::{Driver, StopReason, TrialError, advice};
use pyo3::exceptions::PyRuntimeWarning;
use pyo3::prelude::*;
use std::ffi::CString;
use std::slice;

/// FMPy's forward Euler: one step from point to point; events are not located.
pub(crate) struct Euler {
    record_events: bool,
    /// The regular point of the last step.
    regular: f64,
    x: Vec<f64>,
    dx: Vec<f64>,
    z: Vec<f64>,
    z_before: Vec<f64>,
    completes: bool,
    next_event: Option<f64>,
}

fn ends(instance: &Instance) -> Error {
    Error::Usage { instance: instance.name().into(), cause: "asked to end the simulation in its first event".into() }
}

impl Euler {
    pub(crate) fn new(record_events: bool, start: f64) -> Self {
        let none = Vec::new;
        Self {
            record_events,
            regular: start,
            x: none(),
            dx: none(),
            z: none(),
            z_before: none(),
            completes: false,
            next_event: None,
        }
    }

    /// The event that ends the initialization.
    pub(crate) fn begin(&mut self, instance: &mut Instance) -> Result<(), Error> {
        let updated = update(instance, self.regular)?;
        if updated.terminate {
            return Err(ends(instance));
        }
        self.next_event = updated.next_event_time;
        instance.enter_continuous_time_mode()?;
        let (states, indicators) = instance.state_and_indicator_counts()?;
        (self.x, self.dx) = (vec![0.0; states], vec![0.0; states]);
        (self.z, self.z_before) = (vec![0.0; indicators], vec![0.0; indicators]);
        let description = instance.description();
        let interface = description.model_exchange.as_ref();
        self.completes = interface.is_some_and(|i| i.needs_completed_integrator_step(description.version));
        instance.get_event_indicators(&mut self.z)
    }

    /// The sample of this point, and the step to the next; false at the end.
    pub(crate) fn step(&mut self, course: &mut Course, instance: &mut Instance) -> Result<bool, Error> {
        if self.record_events || is_close(course.time, self.regular) {
            course.record.sample(instance, course.time)?;
        }
        if course.is_over() {
            return Ok(false);
        }
        let time = course.time;
        self.regular = course.regular();
        let input_event = course.input.next_event(time);
        let next = cut(self.regular, input_event);
        let next = self.next_event.map_or(next, |event| cut(next, event));
        let next = cut(next, course.stop);
        let at_input = is_close(next, input_event);
        let at_time = self.next_event.is_some_and(|event| is_close(next, event));

        let at_state = self.integrate(instance, next - time)?;
        course.time = next;
        instance.set_time(next)?;
        course.input.apply_to(instance, next, false, |group| group.continuous)?;
        if is_close(next, self.regular) {
            course.reached += 1;
        }
        let mut event = at_input || at_time || at_state;
        if self.completes {
            let completed = instance.completed_integrator_step()?;
            if completed.terminate {
                course.ended = true;
                return Ok(false);
            }
            event |= completed.enter_event_mode;
        }
        if event {
            if self.record_events {
                course.record.sample(instance, next)?;
            }
            instance.enter_event_mode()?;
            if at_input {
                course.input.apply(instance, next, true)?;
            }
            let updated = update(instance, next)?;
            if updated.terminate {
                course.ended = true;
                return Ok(false);
            }
            self.next_event = updated.next_event_time;
            instance.enter_continuous_time_mode()?;
        }
        Ok(true)
    }

    /// Whether an indicator crosses zero. The FMU still has the time of the beginning, as in FMPy.
    fn integrate(&mut self, instance: &mut Instance, h: f64) -> Result<bool, Error> {
        instance.get_continuous_states(&mut self.x)?;
        instance.get_derivatives(&mut self.dx)?;
        self.x.iter_mut().zip(&self.dx).for_each(|(x, dx)| *x += h * dx);
        instance.set_continuous_states(&self.x)?;
        self.z_before.copy_from_slice(&self.z);
        instance.get_event_indicators(&mut self.z)?;
        let crosses = |(a, b): (&f64, &f64)| (*a < 0.0 && *b >= 0.0) || (*a > 0.0 && *b <= 0.0);
        Ok(self.z_before.iter().zip(&self.z).any(crosses))
    }
}

/// Our integrators: they hit time events exactly, and locate state events.
pub(crate) struct Integrating {
    integration: Integration,
    /// Step of a fixed-step solver (s).
    step: f64,
    record_events: bool,
    regular: f64,
    /// Since the first event.
    running: Option<(Equations, Driver)>,
    /// Time of the last event.
    since: f64,
}

/// Sets the inputs, and records at events.
struct Signals<'a> {
    /// End of the run (s).
    stop: f64,
    input: &'a Input,
    record: &'a mut Record,
    since: &'a mut f64,
    records: bool,
}

impl Feed for Signals<'_> {
    fn settle(&mut self, instances: &mut [Instance], t: f64, inputs: Inputs) -> Result<bool, Error> {
        let all = inputs == Inputs::All;
        let after_event = all || t <= *self.since || is_close(t, *self.since);
        self.input.apply_to(&mut instances[0], t, after_event, |group| all || group.continuous)?;
        Ok(false)
    }

    fn event(&mut self, instances: &mut [Instance], t: f64) -> Result<(), Error> {
        *self.since = t;
        if self.records { self.record.sample(&mut instances[0], t) } else { Ok(()) }
    }

    fn next_point(&self, t: f64) -> Option<f64> {
        Some(self.input.next_event(t)).filter(|event| event.is_finite())
    }

    fn limited(&mut self, t: f64, h: f64) {
        let text = advice(t, h, self.stop).and_then(|text| CString::new(text).ok());
        if let Some(text) = text {
            // Where warnings are errors, this one cannot interrupt the integration.
            Python::attach(|py| PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &text, 1).unwrap_or_default());
        }
    }
}

impl Integrating {
    pub(crate) fn new(solver: Solver, step: f64, record_events: bool) -> Self {
        let integration = Integration { solver, ..Integration::default() };
        Self { integration, step, record_events, regular: f64::NAN, running: None, since: f64::NEG_INFINITY }
    }

    /// The event that ends the initialization.
    pub(crate) fn begin(&mut self, course: &mut Course, instance: &mut Instance) -> Result<(), Error> {
        self.regular = course.start;
        let Course { input, record, .. } = course;
        let mut signals = Signals { stop: course.stop, input, record, since: &mut self.since, records: false };
        let mut equations = Equations::new(slice::from_mut(instance), &self.integration)?;
        let mut fmus = equations.of(slice::from_mut(instance), &mut signals);
        let (driver, flow) = Driver::start(&mut fmus, self.integration.solver, self.step, course.start)?;
        self.running = Some((equations, driver));
        if flow.is_break() { Err(ends(instance)) } else { Ok(()) }
    }

    /// The sample of this point, and the integration to the next regular point or event; false at the end.
    pub(crate) fn step(&mut self, course: &mut Course, instance: &mut Instance) -> Result<bool, Error> {
        let Some((equations, driver)) = &mut self.running else { return Ok(false) };
        // Callbacks may have set variables of the FMU.
        equations.forget();
        driver.forget();
        let (records, over, next) = (self.record_events, course.is_over(), cut(course.regular(), course.stop));
        let sampled = records || is_close(course.time, self.regular);
        let Course { input, record, .. } = course;
        let mut signals = Signals { stop: course.stop, input, record, since: &mut self.since, records };
        let mut fmus = equations.of(slice::from_mut(instance), &mut signals);
        let (t, x) = driver.point();
        fmus.place(t, x).map_err(TrialError::into_error)?;
        if sampled {
            signals.record.sample(instance, course.time)?;
        }
        if over {
            return Ok(false);
        }
        let stop = driver.stop_at(&mut equations.of(slice::from_mut(instance), &mut signals), next)?;
        self.regular = course.regular();
        course.time = if stop == StopReason::Target { next } else { driver.point().0 };
        if is_close(course.time, self.regular) {
            course.reached += 1;
        }
        course.ended = stop == StopReason::End;
        Ok(!course.ended)
    }
}
