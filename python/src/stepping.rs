//! The loop of FMPy's `simulate_fmu` for Co-Simulation: steps are differences of two points, and end at events of the input.

use crate::course::{Course, cut};
use crate::input::is_close;
use fmu_import::{Error, Instance, Update};

/// Maximum number of updates of discrete states of one event.
const UPDATES: usize = 1000;

/// The FMU steps itself.
#[expect(clippy::struct_excessive_bools, reason = "capabilities, and actions taken")]
pub(crate) struct Stepping {
    /// Steps may have any size: they end at input events and at the stop time.
    pub(crate) variable_step: bool,
    pub(crate) fmi2: bool,
    /// The instance uses event mode.
    pub(crate) event_mode: bool,
    /// The inputs of this point were set in event mode.
    pub(crate) applied: bool,
}

impl Stepping {
    /// The first row, after the event that ends the initialization.
    pub(crate) fn begin(&mut self, course: &mut Course, instance: &mut Instance) -> Result<(), Error> {
        if self.event_mode {
            course.ended = update(instance, course.time)?.terminate;
            instance.enter_step_mode()?;
        }
        course.record.sample(instance, course.time)
    }

    /// One step with its samples; false at the end.
    pub(crate) fn step(&mut self, course: &mut Course, instance: &mut Instance) -> Result<bool, Error> {
        if course.is_over() {
            return Ok(false);
        }
        let (time, regular) = (course.time, course.regular());
        let event = course.input.next_event(time);
        let mut next = if self.variable_step { cut(regular, event) } else { regular };
        if next > course.stop && !is_close(next, course.stop) {
            if !self.variable_step {
                return Ok(false);
            }
            next = course.stop;
        }
        if !self.applied {
            course.input.apply(instance, time, !self.event_mode)?;
        }
        let stepped = instance.advance(time, next - time)?;
        course.ended = stepped.terminate;
        let ended_early = course.ended && self.fmi2;
        course.time = if ended_early || (stepped.early && stepped.last < next) { stepped.last } else { next };
        course.record.sample(instance, course.time)?;
        if course.ended {
            return Ok(false);
        }
        self.applied = self.event_mode && (is_close(next, event) || stepped.event);
        if self.applied {
            instance.enter_event_mode()?;
            course.input.apply(instance, course.time, true)?;
            course.ended = update(instance, course.time)?.terminate;
            if course.ended {
                return Ok(false);
            }
            instance.enter_step_mode()?;
            course.record.sample(instance, course.time)?;
        }
        if is_close(course.time, regular) {
            course.reached += 1;
        }
        Ok(true)
    }
}

/// Updates the discrete states in event mode until they need no other update, or the FMU requests the end of the simulation.
pub(crate) fn update(instance: &mut Instance, time: f64) -> Result<Update, Error> {
    for _ in 0..UPDATES {
        let update = instance.update_discrete_states()?;
        if update.terminate || !update.again {
            return Ok(update);
        }
    }
    let cause = format!("needs more than {UPDATES} updates of its discrete states at t = {time} s");
    Err(Error::Usage { instance: instance.name().into(), cause })
}
