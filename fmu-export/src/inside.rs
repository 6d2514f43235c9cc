//! Intermediate update: a communication step in parts, between which the importer reads and sets variables, and may end the
//! step (FMI 3.0.2, 4.2.2). The gate calls the importer while nothing here is borrowed.
//!
//! Only accepted parts are shown, so each is the end of a finished step of the solver.

use crate::access::index;
use crate::instance::{Instance, Refusal, StepResult};
use crate::message;
use crate::value::CValue;
use fmu_core::description::TIME;
use fmu_core::{Causality, Elapsed, Exported, Fault, Model, integrate};
use std::mem::{MaybeUninit, swap};

/// The importer's use of intermediate updates.
pub struct IntermediateUpdates<M: Model> {
    /// The variables that it requested at instantiation.
    required: Vec<u32>,
    /// The outputs at the last communication point: variables that are not intermediate keep them.
    outputs: M::Outputs,
}

/// A communication step in progress: its remaining parts.
pub(crate) struct Parts {
    start: Elapsed,
    t: f64,
    h: f64,
    count: f64,
    done: f64,
    /// End of the last part.
    end: f64,
    stepped: StepResult,
}

/// The importer must be called.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pause {
    /// Time in s.
    pub time: f64,
    /// It may end the step.
    pub can_return: bool,
}

/// Its answer: the requested end (s) of the step, if any.
pub type Reply = Option<f64>;

/// The action after a part of a step.
pub(crate) enum Then {
    /// The importer is called, and the step continues.
    Call(Pause),
    /// The step is done.
    Done(StepResult),
}

impl<E: Exported> Instance<E> {
    /// The importer will be called inside steps and uses these variables there.
    ///
    /// # Errors
    /// A variable does not exist.
    pub(crate) fn look_inside(&mut self, required: &[u32]) -> Result<(), Fault> {
        let table = E::Model::TABLE;
        let last = table.len() + E::CAN.scalars() + E::CAN.indicators().len() + table.wide();
        if let Some(&reference) = required.iter().find(|&&reference| reference as usize > last) {
            return Err(message::unknown::<E>(reference, self.standard));
        }
        self.inside = Some(Box::new(IntermediateUpdates {
            required: required.to_vec(),
            outputs: self.current.block.out.clone(),
        }));
        Ok(())
    }

    /// Begins a communication step from `t` to `t + h` at its first call, then advances by one part.
    ///
    /// # Errors
    /// As [`do_step`](Self::do_step), or the importer requests an end outside of the step.
    pub(crate) fn step_part(
        &mut self,
        (t, h): (f64, f64),
        under_way: &mut Option<Parts>,
        reply: Reply,
    ) -> Result<Then, Fault> {
        let Some(parts) = under_way else {
            self.begin_step(t, h)?;
            if let Some(inside) = &mut self.inside {
                inside.outputs.clone_from(&self.current.block.out);
            }
            let parts = self.divide(t, h)?;
            return self.advance_part(under_way.insert(parts));
        };
        if let Some(until) = reply {
            let (now, end) = (self.current.end, parts.end);
            if !(now..=end).contains(&until) {
                let allowed = format_args!("from {now}, the time of the intermediate update, to {end}");
                return Err(Fault::value("earlyReturnTime", until, allowed));
            }
            let early = parts.stepped.early || until < end;
            if until > now {
                *parts = self.divide(now, until - now)?;
            }
            (parts.end, parts.stepped) = (until, StepResult { early, ..StepResult::default() });
            if until <= now {
                return Ok(Then::Done(parts.stepped));
            }
        }
        if parts.done < parts.count { self.advance_part(parts) } else { Ok(Then::Done(parts.stepped)) }
    }

    /// The parts of the next `h` seconds.
    fn divide(&self, t: f64, h: f64) -> Result<Parts, Fault> {
        let longest = E::CAN.intermediate.map_or(h, |longest| longest(&self.current.block.model));
        if longest.is_nan() || longest <= 0.0 {
            return Err(Fault::value("the longest part of a step", longest, "greater than 0: an error of the model"));
        }
        let count = integrate::substeps(h, longest)?;
        Ok(Parts { start: self.current.elapsed, t, h, count, done: 0.0, end: t + h, stepped: StepResult::default() })
    }

    fn advance_part(&mut self, parts: &mut Parts) -> Result<Then, Fault> {
        let h = parts.h / parts.count;
        let early = parts.stepped.early;
        let t = parts.t + parts.done * h;
        parts.done += 1.0;
        let last = parts.done >= parts.count;
        let next = if last { parts.start.plus(parts.h) } else { self.current.elapsed.plus(h) };
        parts.stepped = self.advance(t, h, next)?;
        if parts.stepped.terminate {
            if E::CAN.event_mode() && self.early_return {
                parts.stepped.early |= self.current.end < parts.end;
            } else {
                (self.current.elapsed, self.current.end) = (parts.start.plus(parts.h), parts.end);
            }
            return Ok(Then::Done(parts.stepped));
        }
        // An event ends the step where the importer takes steps that end early.
        if parts.stepped.early || (parts.stepped.event && self.early_return && !last) {
            return Ok(Then::Done(StepResult { early: true, ..parts.stepped }));
        }
        self.current.elapsed = next;
        self.current.end = if last { parts.end } else { (parts.t + parts.done * h).min(parts.end) };
        parts.stepped.early = early;
        Ok(Then::Call(Pause { time: self.current.end, can_return: self.early_return }))
    }

    /// Refuses variables that the importer did not request at instantiation, and refuses to set those that are not
    /// intermediate.
    ///
    /// # Errors
    /// Names the first one.
    pub(crate) fn check_inside(&self, references: &[u32], sets: bool) -> Result<(), Fault> {
        let Some(inside) = &self.inside else { return Ok(()) };
        for reference in references {
            if *reference == TIME && !sets {
                continue;
            }
            let name = || message::name::<E::Model>(index::<E>(*reference));
            if !inside.required.contains(reference) {
                let name = name();
                return Err(Fault::new(format!(
                    "{name} is not one of the requiredIntermediateVariables of the instance"
                )));
            }
            if sets && !is_intermediate::<E>(*reference, Causality::Input) {
                let name = name();
                return Err(Fault::new(format!("{name} cannot be set inside a step: it is not an intermediate input")));
            }
        }
        Ok(())
    }

    /// The variables' values inside a step: at this instant if they are intermediate, else at the last communication point.
    ///
    /// # Errors
    /// As [`get`](Self::get) and [`check_inside`](Self::check_inside).
    pub(crate) fn get_inside<T: CValue>(
        &mut self,
        references: &[u32],
        out: &mut [MaybeUninit<T>],
    ) -> Result<(), Refusal> {
        self.check_inside(references, false)?;
        self.check_count(references, out.len())?;
        let mut out = out;
        for reference in references {
            let (place, rest) = out.split_at_mut(self.elements(*reference)?);
            out = rest;
            let kept = E::Model::TABLE.locate(index::<E>(*reference)).is_some()
                && !is_intermediate::<E>(*reference, Causality::Output);
            self.exchange_outputs(kept);
            let read = self.get(std::slice::from_ref(reference), place);
            self.exchange_outputs(kept);
            read?;
        }
        Ok(())
    }

    fn exchange_outputs(&mut self, kept: bool) {
        if let Some(inside) = self.inside.as_mut().filter(|_| kept) {
            swap(&mut inside.outputs, &mut self.current.block.out);
        }
    }
}

/// Whether a variable is marked as intermediate.
fn is_intermediate<E: Exported>(reference: u32, causality: Causality) -> bool {
    let found = E::Model::TABLE.locate(index::<E>(reference));
    found.is_some_and(|(_, meta, _)| meta.intermediate && meta.causality == causality)
}
