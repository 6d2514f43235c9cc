//! An instance under test.

use crate::encoding::show;
use crate::level::Level;
use crate::session::{ENDED, NotDetermined, Session};
use fmu_import::Status;
use fmu_import::raw::{Arguments, Buffer, Handle, Interface, Raw, SavedState, Simple, StepStatus, width};
use model_description::{FmiVersion, ModelVariable};
use std::cell::Cell;

/// Number of variables from which on their calls are one entry of the journal.
pub(super) const MANY: usize = 100;
/// Number of variables that one call reads.
const TOGETHER: usize = 1000;

/// An instance. Dropping it does not free it: a separate probe checks freeing.
pub(super) struct Instance<'b> {
    pub(super) session: &'b Session,
    pub(super) handle: Handle,
    event_mode: bool,
    /// Number of the instance within the case, from 1.
    number: usize,
    start: Cell<f64>,
    stop: Cell<Option<f64>>,
    /// Start time of the next step in s.
    pub(super) time: Cell<f64>,
    /// A step has requested the end of the simulation, as an FMU may.
    pub(super) over: Cell<bool>,
}

/// Marks a call with the number of its instance; the first of a case needs none.
fn mark(number: usize) -> String {
    if number > 1 { format!("[{number}] ") } else { String::new() }
}

impl Session {
    /// Instantiates; `None` for NULL.
    pub(super) fn instantiate(&self, arguments: &Arguments) -> Result<Option<Instance<'_>>, NotDetermined> {
        let function = self.function_for(arguments.interface);
        let mark = mark(self.made_in_case() + 1);
        let mut text = format!("{:?}", arguments.name.as_deref().unwrap_or_default());
        if self.is_v2() && arguments.interface == Interface::ModelExchange {
            text += ", fmi2ModelExchange";
        }
        let token = arguments.token.as_ref().map(|token| token.to_string_lossy());
        if token.as_deref() != Some(self.description.token.as_str()) {
            text += &token.map_or_else(|| ", guid=NULL".into(), |token| format!(", guid={token:?}"));
        }
        for (given, name) in [(arguments.logging, ", loggingOn"), (arguments.event_mode, ", eventModeUsed")] {
            text += if given { name } else { "" };
        }
        self.record_call(&format!("{mark}{function}({text})"));
        let handle = self.raw.instantiate(arguments).map_err(NotDetermined)?;
        let made = handle.map(|handle| Instance::new(self, handle, arguments.event_mode));
        self.record_result(if made.is_some() { &"an instance" } else { &"NULL" });
        Ok(made)
    }

    /// Name of the function that makes instances for co-simulation.
    pub(super) fn instantiation(&self) -> &'static str {
        match self.description.version {
            FmiVersion::V2 => "fmi2Instantiate",
            FmiVersion::V3 => "fmi3InstantiateCoSimulation",
        }
    }

    /// A new instance; NULL ends the probe.
    pub(super) fn fresh(&self) -> Result<Instance<'_>, NotDetermined> {
        self.prepare(|| self.made(&self.arguments("probe")))
    }

    /// Instantiates; NULL ends the probe.
    pub(super) fn made(&self, arguments: &Arguments) -> Result<Instance<'_>, NotDetermined> {
        let made = self.instantiate(arguments)?;
        made.ok_or_else(|| NotDetermined(format!("{} returned NULL", self.function_for(arguments.interface))))
    }

    /// Name of the function that makes instances for this interface.
    pub(super) fn function_for(&self, interface: Interface) -> &'static str {
        match (self.description.version, interface) {
            (FmiVersion::V3, Interface::ModelExchange) => "fmi3InstantiateModelExchange",
            (FmiVersion::V3, Interface::ScheduledExecution) => "fmi3InstantiateScheduledExecution",
            _ => self.instantiation(),
        }
    }

    /// A new instance in initialization mode.
    pub(super) fn initializing(&self) -> Result<Instance<'_>, NotDetermined> {
        let instance = self.fresh()?;
        self.prepare(|| instance.enter())?;
        Ok(instance)
    }

    /// A new instance that is ready to step.
    pub(super) fn stepping(&self) -> Result<Instance<'_>, NotDetermined> {
        let instance = self.initializing()?;
        self.prepare(|| instance.exit())?;
        Ok(instance)
    }
}

impl<'b> Instance<'b> {
    fn new(session: &'b Session, handle: Handle, event_mode: bool) -> Self {
        let (start, stop, time) = (Cell::new(session.start()), Cell::new(None), Cell::new(session.start()));
        let number = session.another();
        Self { session, handle, event_mode, number, start, stop, time, over: Cell::new(false) }
    }
}

impl Instance<'_> {
    /// Calls a function that the FMU must have, after recording the call.
    pub(super) fn call(
        &self,
        call: &str,
        function: impl FnOnce(&Raw) -> Option<Status>,
    ) -> Result<Status, NotDetermined> {
        Ok(self.call_for(call, |raw| Some((function(raw)?, ())))?.0)
    }

    /// Calls a function that also returns a value.
    pub(super) fn call_for<T>(
        &self,
        call: &str,
        function: impl FnOnce(&Raw) -> Option<(Status, T)>,
    ) -> Result<(Status, T), NotDetermined> {
        let name = || self.session.raw.name(call);
        if self.session.silent.get() {
            self.session.show_progress();
        } else {
            self.session.record_call(&format!("{}{}", mark(self.number), name()));
        }
        let missing =
            || NotDetermined(format!("the function {} is missing", name().split('(').next().unwrap_or_default()));
        let (status, value) = function(&self.session.raw).ok_or_else(missing)?;
        self.session.record_result(&status);
        Ok((status, value))
    }

    /// A function without arguments.
    pub(super) fn simple(&self, name: Simple) -> Result<Status, NotDetermined> {
        self.call(name.as_str(), |raw| raw.simple(name, self.handle))
    }

    /// A function without arguments that must succeed.
    pub(super) fn perform(&self, name: Simple) -> Result<(), NotDetermined> {
        self.must(name.as_str(), self.simple(name)?)
    }

    pub(super) fn must(&self, name: &str, status: Status) -> Result<(), NotDetermined> {
        if status.is_ok() {
            Ok(())
        } else {
            Err(NotDetermined(format!("{} returned {status}", self.session.raw.name(name))))
        }
    }

    /// Sets the experiment's times, before [`enter`](Self::enter).
    pub(super) fn experiment(&self, start: f64, stop: Option<f64>) {
        self.start.set(start);
        self.time.set(start);
        self.stop.set(stop);
    }

    /// Enters initialization mode.
    pub(super) fn enter(&self) -> Result<(), NotDetermined> {
        let (start, stop) = (self.start.get(), self.stop.get());
        let name = if self.session.is_v2() { "SetupExperiment" } else { "EnterInitializationMode" };
        let end = stop.map_or_else(|| "undefined".into(), |stop| format!("{stop:?}"));
        let status = self.call(&format!("{name}(startTime={start}, stopTime={end})"), |raw| {
            raw.experiment(self.handle, None, start, stop)
        })?;
        self.must(name, status)?;
        if self.session.is_v2() {
            self.perform(Simple::EnterInitializationMode)?;
        }
        Ok(())
    }

    /// Leaves initialization mode; the instance is then ready to step.
    pub(super) fn exit(&self) -> Result<(), NotDetermined> {
        self.perform(Simple::ExitInitializationMode)?;
        if self.event_mode { self.events() } else { Ok(()) }
    }

    /// Enters initialization mode and leaves it.
    pub(super) fn initialize(&self) -> Result<(), NotDetermined> {
        self.enter()?;
        self.exit()
    }

    /// Passes through event mode to step mode.
    fn events(&self) -> Result<(), NotDetermined> {
        for _ in 0..100 {
            let (status, updated) = self.update()?;
            self.must("UpdateDiscreteStates", status)?;
            if updated.again == 0 {
                break;
            }
        }
        self.perform(Simple::EnterStepMode)
    }

    /// A step from the end of the last one.
    pub(super) fn step(&self, h: f64) -> Result<Status, NotDetermined> {
        let t = self.time.get();
        let status = self.step_at(t, h)?;
        if status.is_ok() {
            self.time.set(t + h);
        }
        Ok(status)
    }

    /// A step from any time.
    pub(super) fn step_at(&self, t: f64, h: f64) -> Result<Status, NotDetermined> {
        self.step_with(t, h, false)
    }

    /// A step from any time, with a value of `noSetFMUStatePriorToCurrentPoint`.
    pub(super) fn step_with(&self, t: f64, h: f64, no_prior: bool) -> Result<Status, NotDetermined> {
        let mark = if no_prior { ", noSetFMUStatePriorToCurrentPoint=true" } else { "" };
        let call = if self.session.silent.get() { "DoStep".into() } else { format!("DoStep(t={t:?}, h={h:?}{mark})") };
        let v2 = self.session.is_v2();
        let status = self.call(&call, |raw| {
            let (status, stepped) = raw.do_step(self.handle, t, h, no_prior, [true; 4])?;
            // fmi2Terminated is 3.
            let ends = || raw.step_status(StepStatus::GetBooleanStatus, self.handle, 3);
            let over = if v2 {
                status == Status::DISCARD && ends().is_some_and(|(s, value)| s.is_ok() && value & 0xffff_ffff == 1)
            } else {
                status.is_ok() && stepped.terminate == 1
            };
            self.over.set(self.over.get() || over);
            Some(status)
        })?;
        if self.event_mode && status.is_ok() {
            self.perform(Simple::EnterEventMode)?;
            self.events()?;
        }
        Ok(status)
    }

    /// Steps that must succeed.
    pub(super) fn steps(&self, n: usize, h: f64) -> Result<(), NotDetermined> {
        for _ in 0..n {
            let status = self.step(h)?;
            // A legal end; what comes after it is open.
            if self.over.get() {
                return Err(NotDetermined(format!("{ENDED} at {}", self.time.get())));
            }
            self.must("DoStep", status)?;
        }
        Ok(())
    }

    /// A variable's values; `None` if the getter returned OK and wrote nothing.
    pub(super) fn get(&self, v: &ModelVariable) -> Result<(Status, Vec<u64>), NotDetermined> {
        let n = self.session.elements(v);
        let version = self.session.description.version;
        let mut buffer = Buffer::room(v.base, version, n);
        let call = if self.session.silent.get() { "Get".into() } else { format!("Get({})", v.name) };
        let status =
            self.call(&call, |raw| raw.get(self.handle, v.base, Some(&[v.value_reference]), 1, Some(&mut buffer), n))?;
        let not_written = status.is_ok() && buffer.is_unwritten();
        self.session.unwritten.set(self.session.unwritten.get() || not_written);
        if !self.session.silent.get() && status.is_ok() {
            let value = if not_written { "not written".into() } else { show(v, version, &buffer.bits()) };
            self.session.record_value(&value);
        }
        if !buffer.intact() {
            return Err(NotDetermined(format!("getting {} wrote past its {n} values", v.name)));
        }
        // A value that keeps the fill pattern was not written by the FMU.
        Ok((status, if not_written { Vec::new() } else { buffer.bits() }))
    }

    /// A variable's values after it was set; `None` where they cannot be read. FMI 2.0 allows few variables to be read in
    /// Initialization Mode, so this is a fault only in FMI 3.0.
    pub(super) fn get_back(&self, v: &ModelVariable) -> Result<Option<Vec<u64>>, NotDetermined> {
        let (status, back) = self.get(v)?;
        if status.is_ok() {
            return Ok(Some(back));
        }
        let text = format!("{} was set, and Get({}) returned {status}", v.name, v.name);
        if self.session.is_v2() {
            self.session.note(text);
        } else {
            self.session.lesser(Level::Should, text);
        }
        Ok(None)
    }

    /// Sets a variable's values.
    pub(super) fn set(&self, v: &ModelVariable, values: &[u64]) -> Result<Status, NotDetermined> {
        let mut buffer = Buffer::of(v.base, self.session.description.version, values);
        let shown = || format!("Set({} = {})", v.name, show(v, self.session.description.version, values));
        let call = if self.session.silent.get() { "Set".into() } else { shown() };
        self.call(&call, |raw| {
            raw.set(self.handle, v.base, Some(&[v.value_reference]), 1, Some(&mut buffer), values.len())
        })
    }

    /// The values of several variables; those that cannot be read are left out. Many are one entry of the journal.
    pub(super) fn snapshot(&self, variables: &[&ModelVariable]) -> Result<Vec<Vec<u64>>, NotDetermined> {
        let silent = &self.session.silent;
        let read = || {
            // A script repeats each call.
            if variables.len() >= MANY && silent.get() {
                return self.together(variables);
            }
            variables.iter().map(|v| self.readable(v)).collect()
        };
        if variables.len() < MANY || silent.get() {
            return read();
        }
        self.session.record_calls(&format!("getting {} variables", variables.len()), read)
    }

    /// The values of a variable; none if it cannot be read.
    fn readable(&self, v: &ModelVariable) -> Result<Vec<u64>, NotDetermined> {
        self.get(v).map(|(status, bits)| if status.is_ok() { bits } else { Vec::new() })
    }

    /// The values of many variables: scalars of one type that follow each other with one call, and each alone if that fails.
    fn together(&self, variables: &[&ModelVariable]) -> Result<Vec<Vec<u64>>, NotDetermined> {
        let version = self.session.description.version;
        let mut values = vec![None; variables.len()];
        // A narrow value may have the bits of the pattern that shows what was not written.
        let fits = |k: usize, base| {
            let v = variables[k];
            v.base == base && !v.is_array() && width(base, version) >= 4
        };
        let mut from = 0;
        while let Some(first) = variables.get(from) {
            let (base, end) = (first.base, variables.len().min(from + TOGETHER));
            let to = (from..end).find(|k| !fits(*k, base)).unwrap_or(end).max(from + 1);
            let part = from..to;
            from = to;
            if !fits(part.start, base) {
                continue;
            }
            let references: Vec<u32> = variables[part.clone()].iter().map(|v| v.value_reference).collect();
            let n = references.len();
            let mut buffer = Buffer::room(base, version, n);
            let status =
                self.call("Get", |raw| raw.get(self.handle, base, Some(&references), n, Some(&mut buffer), n))?;
            if !buffer.intact() {
                return Err(NotDetermined(format!("getting {n} variables of the type {base} wrote past their values")));
            }
            if status.is_ok() && !buffer.is_unwritten() {
                for (value, bits) in values[part].iter_mut().zip(buffer.bits()) {
                    *value = Some(vec![bits]);
                }
            }
        }
        variables.iter().zip(values).map(|(v, found)| found.map_or_else(|| self.readable(v), Ok)).collect()
    }

    /// The values of scalars of the type Float64; NaN for those that cannot be read.
    pub(super) fn numbers(&self, variables: &[&ModelVariable]) -> Result<Vec<f64>, NotDetermined> {
        let all = self.snapshot(variables)?;
        Ok(all.iter().map(|bits| bits.first().map_or(f64::NAN, |b| f64::from_bits(*b))).collect())
    }

    /// Steps `n` times with constant inputs and returns all watched variables after each step.
    pub(super) fn run(&self, n: usize, h: f64) -> Result<Vec<Vec<Vec<u64>>>, NotDetermined> {
        let watched = self.session.watched();
        self.session.record_calls(
            &format!("{n} steps of {h} from {}, each followed by getting all outputs", self.time.get()),
            || {
                (0..n)
                    .map(|_| {
                        self.steps(1, h)?;
                        self.snapshot(&watched)
                    })
                    .collect()
            },
        )
    }

    /// Changes every numeric input slightly, which the standard allows between steps.
    pub(super) fn change_inputs(&self, k: u32) -> Result<(), NotDetermined> {
        for v in self.session.float_inputs() {
            if let Some(values) = self.session.different_value(v, f64::from(k % 5)) {
                let _ = self.set(v, &values)?;
            }
        }
        Ok(())
    }

    /// Saves the state.
    pub(super) fn save(&self) -> Result<SavedState, NotDetermined> {
        let mut state = SavedState::NULL;
        let status = self.call("GetFMUState", |raw| raw.get_state(self.handle, Some(&mut state)))?;
        self.must("GetFMUState", status)?;
        Ok(state)
    }

    /// Restores a state that was saved at `time`.
    pub(super) fn restore(&self, state: SavedState, time: f64) -> Result<(), NotDetermined> {
        let status = self.call("SetFMUState", |raw| raw.set_state(self.handle, state))?;
        self.must("SetFMUState", status)?;
        self.time.set(time);
        Ok(())
    }

    /// A saved state as bytes.
    pub(super) fn serialize(&self, state: SavedState) -> Result<Vec<u8>, NotDetermined> {
        let (status, size) = self.call_for("SerializedFMUStateSize", |raw| raw.state_size(self.handle, state))?;
        self.must("SerializedFMUStateSize", status)?;
        let (status, out) = self.call_for(&format!("SerializeFMUState(size={size})"), |raw| {
            match raw.serialize(self.handle, state, size) {
                Ok(done) => done.map(|(status, bytes, intact)| (status, Ok((bytes, intact)))),
                Err(why) => Some((Status::ERROR, Err(why))),
            }
        })?;
        let (bytes, intact) = out.map_err(NotDetermined)?;
        self.must("SerializeFMUState", status)?;
        if !intact {
            return Err(NotDetermined(format!("SerializeFMUState wrote past its {size} bytes")));
        }
        Ok(bytes)
    }

    /// Frees the instance.
    pub(super) fn free(self) -> Result<(), NotDetermined> {
        self.session.record_call(&format!("{}{}", mark(self.number), self.session.raw.name("FreeInstance")));
        self.session.raw.free(self.handle).ok_or_else(|| NotDetermined("the function FreeInstance is missing".into()))
    }
}
