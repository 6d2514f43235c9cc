//! One instance of an FMU of either standard.

mod clocks;
mod configuration;
mod equations;

use crate::abi::journal::{self, Call};
use crate::abi::live::{Live, Pointer};
use crate::abi::log::{Log, Message, Status};
use crate::abi::raw::Simple;
use crate::error::Error;
use crate::standard::{Experiment, Kind, Outcome, Refusal, explain};
use crate::typed::OtherType;
use crate::value::Values;
use clocks::Clocks;
use model_description::{BaseType, Causality, ModelDescription, ModelVariable};
use std::collections::BTreeMap;
use std::ffi::CStr;
use std::ops::ControlFlow;
use std::sync::Arc;

/// A saved state of an instance, as a number that only this instance understands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FmuState(usize);

/// An instance of an FMU, which may move between threads. Dropping it frees it.
pub struct Instance {
    name: String,
    /// Its number in the journal.
    id: u32,
    description: Arc<ModelDescription>,
    live: Live,
    kind: Kind,
    states: Vec<Option<Pointer>>,
    dead: bool,
    /// The clocks of the FMU, if it has any and events are used.
    clocks: Option<Box<Clocks>>,
    /// Structural parameters that differ from their start values, by value reference.
    sizes: BTreeMap<u32, usize>,
    // After the instance, which may log while it is freed.
    log: Arc<Log>,
}

impl Instance {
    pub(super) fn new(
        name: &str,
        id: u32,
        description: Arc<ModelDescription>,
        live: Live,
        kind: Kind,
        log: Arc<Log>,
    ) -> Self {
        let events = !matches!(kind, Kind::CoSimulation { event_mode: false, .. });
        let clocks = if events { Clocks::of(&description) } else { None };
        let (name, states, sizes) = (name.into(), Vec::new(), BTreeMap::new());
        Self { name, id, description, live, kind, states, dead: false, clocks, sizes, log }
    }

    /// The name that the instance was given.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The interface of the instance.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The contents of modelDescription.xml.
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// The messages since the previous call.
    pub fn take_messages(&self) -> Vec<Message> {
        self.log.take()
    }

    /// A variable by its name.
    ///
    /// # Errors
    /// The variable does not exist; the error has the names that resemble it.
    pub fn variable(&self, name: &str) -> Result<&ModelVariable, Error> {
        self.description.variable(name).ok_or_else(|| Error::variable(&self.name, name, &self.description))
    }

    /// Reads a variable.
    ///
    /// # Errors
    /// The variable does not exist, or the FMU refuses.
    pub fn get(&mut self, name: &str) -> Result<Values, Error> {
        let (base, reference, count) = self.place(name)?;
        self.get_at(base, reference, count)
    }

    /// Reads a variable as a type of Rust: `let speed: f64 = fmu.get_as("speed")?`; an array as a `Vec`, an enumeration as an
    /// integer.
    ///
    /// # Errors
    /// As [`get`](Self::get), or the variable has another type.
    pub fn get_as<T: TryFrom<Values, Error = OtherType>>(&mut self, name: &str) -> Result<T, Error> {
        let typed = self.get(name)?.try_into();
        typed.map_err(|other: OtherType| Error::usage(&self.name, format!("{name} = {other}")))
    }

    /// Writes a variable: a number, a Boolean, a text, [`Values`], or an array as a list; a structural parameter in a separate
    /// Configuration Mode, as [`configure`](Self::configure).
    ///
    /// # Errors
    /// The variable does not exist, the values do not fit, or the FMU refuses.
    pub fn set(&mut self, name: &str, values: impl Into<Values>) -> Result<(), Error> {
        let values = values.into();
        if self.variable(name)?.causality == Causality::StructuralParameter {
            return self.configure(&[(name, &values)]);
        }
        let (base, reference, count) = self.place(name)?;
        if values.len() != count {
            return Err(Error::usage(&self.name, format!("{name} has {count} elements, not {}", values.len())));
        }
        self.set_at(base, reference, &values)
    }

    /// Writes a variable as a user writes it: `3.3`, `true`, `Rasmussen`, or elements with commas between them.
    ///
    /// # Errors
    /// As [`set`](Self::set), or the text is not a value of the variable's type.
    pub fn set_text(&mut self, name: &str, text: &str) -> Result<(), Error> {
        let values = self.parse(name, text)?;
        self.set(name, &values)
    }

    /// The value of a variable that a user writes as in [`set_text`](Self::set_text).
    ///
    /// # Errors
    /// The variable does not exist, or the text is not a value of its type.
    pub fn parse(&self, name: &str, text: &str) -> Result<Values, Error> {
        Values::read(text, self.variable(name)?, &self.description).map_err(|cause| Error::usage(&self.name, cause))
    }

    /// Reads real scalars by value reference: the fast way.
    ///
    /// # Errors
    /// The FMU refuses.
    #[inline]
    pub fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), Error> {
        if self.clocks.is_some() {
            for (&reference, value) in references.iter().zip(values) {
                *value = self.get_at(BaseType::Float64, reference, 1)?.number().unwrap_or(f64::NAN);
            }
            return Ok(());
        }
        self.call(Call::Get, |s| s.get_reals(references, values))
    }

    /// Writes real scalars by value reference: the fast way.
    ///
    /// # Errors
    /// The FMU refuses.
    #[inline]
    pub fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Result<(), Error> {
        if self.clocks.is_some() {
            let mut all = references.iter().zip(values);
            return all.try_for_each(|(&reference, &x)| {
                self.set_clocked(BaseType::Float64, reference, &Values::Reals(vec![x]))
            });
        }
        self.call(Call::Set, |s| s.set_reals(references, values))
    }

    /// Reads `count` elements of the variable with this base type and value reference.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn get_at(&mut self, base: BaseType, reference: u32, count: usize) -> Result<Values, Error> {
        let known = self.get_known(base, reference, count)?;
        known.ok_or_else(|| {
            let name = self.description.referenced(reference).map_or("a variable", |v| &v.name);
            Error::usage(&self.name, format!("{name} is on a clock that has not ticked"))
        })
    }

    /// Like [`get_at`](Self::get_at); `None` for a variable whose clock has not ticked.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn get_known(&mut self, base: BaseType, reference: u32, count: usize) -> Result<Option<Values>, Error> {
        if self.clocks.is_some() {
            return self.get_clocked(base, reference, count);
        }
        self.call(Call::Get, |s| s.get(base, reference, count)).map(Some)
    }

    /// Writes the variable with this base type and value reference.
    ///
    /// # Errors
    /// The values do not fit, or the FMU refuses.
    pub fn set_at(&mut self, base: BaseType, reference: u32, values: &Values) -> Result<(), Error> {
        if self.clocks.is_some() {
            return self.set_clocked(base, reference, values);
        }
        self.call(Call::Set, |s| s.set(base, reference, values))
    }

    /// Switches logging on or off; errors are always logged.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn set_debug_logging(&mut self, on: bool) -> Result<(), Error> {
        self.call(Call::Evaluation, |s| s.set_debug_logging(on, None))
    }

    /// Requests warnings from an FMU that has a category for them, or no longer.
    ///
    /// # Errors
    /// The FMU refuses; the instance can only be freed.
    pub fn log_warnings(&mut self, on: bool) -> Result<(), Error> {
        const WARNING: &CStr = c"logStatusWarning";
        let listed =
            self.description.log_categories.iter().any(|category| category.name.as_bytes() == WARNING.to_bytes());
        if listed { self.call(Call::Evaluation, |s| s.set_debug_logging(on, Some(WARNING))) } else { Ok(()) }
    }

    /// Sets the start time of the simulation and, if it is known, the stop time.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn setup(&mut self, start: f64, stop: Option<f64>) -> Result<(), Error> {
        self.setup_with(start, stop, None)
    }

    /// Like [`setup`](Self::setup), with the relative tolerance of a solver inside the FMU.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn setup_with(&mut self, start: f64, stop: Option<f64>, tolerance: Option<f64>) -> Result<(), Error> {
        if let Some(clocks) = &mut self.clocks {
            clocks.begin(start);
        }
        self.call(Call::Setup, |s| s.setup(Experiment { start, stop, tolerance }))
    }

    /// Initialization begins: parameters and inputs are set, outputs may be read.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn enter_initialization(&mut self) -> Result<(), Error> {
        self.call(Call::EnterInitialization, Live::enter_initialization)
    }

    /// Initialization ends.
    ///
    /// # Errors
    /// The FMU refuses, for example parameters that do not fit together.
    pub fn exit_initialization(&mut self) -> Result<(), Error> {
        self.plan_clocks()?;
        self.call(Call::ExitInitialization, |s| s.simple(Simple::ExitInitializationMode))?;
        self.tick()
    }

    /// Steps from `t` to `t + h`; breaks when the FMU requests the end of the simulation.
    ///
    /// # Errors
    /// The FMU refuses.
    #[inline]
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<ControlFlow<()>, Error> {
        let stepped = self.call(Call::Step, |s| s.do_step(t, h))?;
        Ok(if stepped.terminate { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }

    /// Time (s) that the last step reached; it differs from its end if the FMU requested the end of the simulation.
    ///
    /// # Errors
    /// The FMU refuses, or does not report it.
    pub fn last_successful_time(&mut self) -> Result<f64, Error> {
        self.call(Call::Evaluation, Live::last_successful_time)
    }

    /// Ends the simulation; variables can still be read.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn terminate(&mut self) -> Result<(), Error> {
        self.call(Call::Terminate, |s| s.simple(Simple::Terminate))
    }

    /// Restores the state after instantiation.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn reset(&mut self) -> Result<(), Error> {
        self.sizes.clear();
        self.call(Call::Reset, |s| s.simple(Simple::Reset))
    }

    /// Saves the state.
    ///
    /// # Errors
    /// The FMU refuses the call or lacks the capability.
    pub fn get_state(&mut self) -> Result<FmuState, Error> {
        let state = self.call(Call::State, Live::get_state)?;
        self.states.push(Some(state));
        Ok(FmuState(self.states.len() - 1))
    }

    /// Goes back to a saved state.
    ///
    /// # Errors
    /// The FMU refuses, or the state was freed.
    pub fn set_state(&mut self, state: FmuState) -> Result<(), Error> {
        let state = self.state(state)?;
        self.call(Call::State, |s| s.set_state(state))?;
        self.read_sizes()
    }

    /// Frees a saved state. Those that remain are freed with the instance.
    ///
    /// # Errors
    /// The FMU refuses, or the state was freed before.
    pub fn free_state(&mut self, state: FmuState) -> Result<(), Error> {
        let raw = self.state(state)?;
        self.states[state.0] = None;
        self.call(Call::State, |s| s.free_state(raw))
    }

    /// A saved state as bytes.
    ///
    /// # Errors
    /// The FMU refuses the call, lacks the capability, or the state was freed.
    pub fn serialize_state(&mut self, state: FmuState) -> Result<Vec<u8>, Error> {
        let state = self.state(state)?;
        self.call(Call::State, |s| s.serialize(state))
    }

    /// A saved state from bytes; it is not yet set.
    ///
    /// # Errors
    /// The FMU refuses the call or lacks the capability.
    pub fn deserialize_state(&mut self, bytes: &[u8]) -> Result<FmuState, Error> {
        let state = self.call(Call::State, |s| s.deserialize(bytes))?;
        self.states.push(Some(state));
        Ok(FmuState(self.states.len() - 1))
    }

    fn state(&self, state: FmuState) -> Result<Pointer, Error> {
        let alive = self.states.get(state.0).copied().flatten();
        alive.ok_or_else(|| Error::usage(&self.name, "the state was freed, or is of another instance"))
    }

    /// Base type, value reference and number of elements.
    fn place(&self, name: &str) -> Result<(BaseType, u32, usize), Error> {
        let variable = self.variable(name)?;
        Ok((variable.base, variable.value_reference, self.elements(variable)?))
    }

    /// Number of elements of a variable: for an array, the product of its extents, where a structural parameter counts with its
    /// present value.
    ///
    /// # Errors
    /// A size is not known.
    pub fn elements(&self, variable: &ModelVariable) -> Result<usize, Error> {
        let shape = self.description.shape_with(variable, |reference| self.size(reference));
        let count = shape.and_then(|shape| shape.iter().try_fold(1_usize, |n, d| n.checked_mul(*d)));
        count.ok_or_else(|| Error::usage(&self.name, format!("the size of {} is not known", variable.name)))
    }

    /// Whether a call has returned the status Fatal.
    pub fn is_dead(&self) -> bool {
        self.dead
    }

    /// Forgets the instance without freeing it: another instance of its binary has returned the status Fatal.
    pub fn abandon(&mut self) {
        self.live.abandon();
        self.dead = true;
    }

    /// All calls to the FMU pass here.
    #[inline]
    fn call<T>(&mut self, what: Call, call: impl FnOnce(&mut Live) -> Outcome<T>) -> Result<T, Error> {
        if self.dead {
            return Err(self.buried());
        }
        journal::note(self.id, what);
        call(&mut self.live).map_err(|refusal| self.refused(refusal))
    }

    #[cold]
    fn buried(&self) -> Error {
        Error::usage(&self.name, "had a fatal error before, and takes no more calls")
    }

    #[cold]
    fn refused(&mut self, refusal: Refusal) -> Error {
        if matches!(refusal, Refusal::Status(_, Status::FATAL)) {
            self.abandon();
        }
        explain(&self.name, refusal, self.log.reason())
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        journal::note(self.id, Call::Free);
        for state in std::mem::take(&mut self.states).into_iter().flatten() {
            // A refusal can no longer be reported.
            let _ = self.call(Call::Free, |s| s.free_state(state));
        }
    }
}
