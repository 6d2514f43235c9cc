//! An instance under test.

use super::bench::{Bench, Blocked, fine, show};
use fmu_import::Status;
use fmu_import::raw::{Buffer, Handle, Raw, SavedState, Simple};
use model_description::{FmiVersion, ModelVariable};
use std::cell::Cell;

/// An instance. It is not freed by itself: that the FMU frees it well is a probe of its own.
pub(super) struct It<'b> {
    pub(super) bench: &'b Bench,
    pub(super) handle: Handle,
    event_mode: bool,
    start: Cell<f64>,
    stop: Cell<Option<f64>>,
    /// Where the next step begins.
    pub(super) time: Cell<f64>,
}

impl<'b> It<'b> {
    pub(super) fn new(bench: &'b Bench, handle: Handle, event_mode: bool) -> Self {
        let (start, stop, time) = (Cell::new(bench.start()), Cell::new(None), Cell::new(bench.start()));
        Self { bench, handle, event_mode, start, stop, time }
    }
}

impl It<'_> {
    /// Calls a function that the FMU must have; notes it before.
    pub(super) fn call(&self, call: &str, function: impl FnOnce(&Raw) -> Option<Status>) -> Result<Status, Blocked> {
        let name = self.bench.raw.name(call);
        self.bench.calling(&name);
        let missing = || Blocked(format!("the function {} is missing", name.split('(').next().unwrap_or_default()));
        function(&self.bench.raw).ok_or_else(missing)
    }

    /// A function without arguments.
    pub(super) fn simple(&self, name: Simple) -> Result<Status, Blocked> {
        self.call(name.as_str(), |raw| raw.simple(name, self.handle))
    }

    fn must(&self, name: &str, status: Status) -> Result<(), Blocked> {
        if fine(status) { Ok(()) } else { Err(Blocked(format!("{} returned {status}", self.bench.raw.name(name)))) }
    }

    /// Sets the experiment's times, before [`enter`](Self::enter).
    pub(super) fn experiment(&self, start: f64, stop: Option<f64>) {
        self.start.set(start);
        self.time.set(start);
        self.stop.set(stop);
    }

    /// To initialisation mode.
    pub(super) fn enter(&self) -> Result<(), Blocked> {
        let (start, stop) = (self.start.get(), self.stop.get());
        let name = if self.bench.md.version == FmiVersion::V2 { "SetupExperiment" } else { "EnterInitializationMode" };
        let status = self.call(&format!("{name}(startTime={start}, stopTime={stop:?})"), |raw| {
            raw.experiment(self.handle, None, start, stop)
        })?;
        self.must(name, status)?;
        if self.bench.md.version == FmiVersion::V2 {
            self.must("EnterInitializationMode", self.simple(Simple::EnterInitializationMode)?)?;
        }
        Ok(())
    }

    /// From initialisation mode to where steps are made.
    pub(super) fn exit(&self) -> Result<(), Blocked> {
        self.must("ExitInitializationMode", self.simple(Simple::ExitInitializationMode)?)?;
        if self.event_mode { self.events() } else { Ok(()) }
    }

    /// Through event mode, to step mode.
    fn events(&self) -> Result<(), Blocked> {
        for _ in 0..100 {
            let mut again = false;
            let status = self.call("UpdateDiscreteStates", |raw| {
                let (status, more, _) = raw.update_discrete_states(self.handle)?;
                again = more;
                Some(status)
            })?;
            self.must("UpdateDiscreteStates", status)?;
            if !again {
                break;
            }
        }
        self.must("EnterStepMode", self.simple(Simple::EnterStepMode)?)
    }

    /// A step, from where the last one ended.
    pub(super) fn step(&self, h: f64) -> Result<Status, Blocked> {
        let t = self.time.get();
        let status = self.step_at(t, h)?;
        if fine(status) {
            self.time.set(t + h);
        }
        Ok(status)
    }

    /// A step from any time.
    pub(super) fn step_at(&self, t: f64, h: f64) -> Result<Status, Blocked> {
        let call = if self.bench.silent.get() { "DoStep".into() } else { format!("DoStep(t={t:?}, h={h:?})") };
        let status = self.call(&call, |raw| raw.do_step(self.handle, t, h, false, [true; 4]).map(|(s, _)| s))?;
        if self.event_mode && fine(status) {
            self.must("EnterEventMode", self.simple(Simple::EnterEventMode)?)?;
            self.events()?;
        }
        Ok(status)
    }

    /// Steps that must succeed.
    pub(super) fn steps(&self, n: usize, h: f64) -> Result<(), Blocked> {
        for _ in 0..n {
            self.must("DoStep", self.step(h)?)?;
        }
        Ok(())
    }

    /// A variable's values.
    pub(super) fn get(&self, v: &ModelVariable) -> Result<(Status, Vec<u64>), Blocked> {
        let n = self.bench.elements(v);
        let mut buffer = Buffer::room(v.base, self.bench.md.version, n);
        let status = self.call(&format!("Get({})", v.name), |raw| {
            raw.get(self.handle, v.base, Some(&[v.value_reference]), 1, Some(&mut buffer), n)
        })?;
        if !buffer.intact() {
            return Err(Blocked(format!("getting {} wrote behind its {n} values", v.name)));
        }
        Ok((status, buffer.bits()))
    }

    /// Sets a variable's values.
    pub(super) fn set(&self, v: &ModelVariable, values: &[u64]) -> Result<Status, Blocked> {
        let mut buffer = Buffer::of(v.base, self.bench.md.version, values);
        let call = format!("Set({} = {})", v.name, show(v, self.bench.md.version, values));
        self.call(&call, |raw| {
            raw.set(self.handle, v.base, Some(&[v.value_reference]), 1, Some(&mut buffer), values.len())
        })
    }

    /// The values of several variables; those that cannot be read are left out.
    pub(super) fn snapshot(&self, variables: &[&ModelVariable]) -> Result<Vec<Vec<u64>>, Blocked> {
        let read = |v: &&ModelVariable| self.get(v).map(|(status, bits)| if fine(status) { bits } else { Vec::new() });
        variables.iter().map(read).collect()
    }

    /// Steps `n` times and tells all watched variables after each: the trajectory.
    pub(super) fn run(&self, n: usize, h: f64) -> Result<Vec<Vec<Vec<u64>>>, Blocked> {
        let watched = self.bench.watched();
        self.bench.many(
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

    /// Moves every input that is a number, a bit; the standard allows it between steps.
    pub(super) fn excite(&self, k: u32) -> Result<(), Blocked> {
        for v in self.bench.float_inputs() {
            if let Some(values) = self.bench.other_value(v, f64::from(k % 5)) {
                let _ = self.set(v, &values)?;
            }
        }
        Ok(())
    }

    /// Saves the state.
    pub(super) fn save(&self) -> Result<SavedState, Blocked> {
        let mut state = SavedState::NULL;
        let status = self.call("GetFMUState", |raw| raw.get_state(self.handle, Some(&mut state)))?;
        self.must("GetFMUState", status)?;
        Ok(state)
    }

    /// Goes back to a saved state, which was saved at this time.
    pub(super) fn restore(&self, state: SavedState, time: f64) -> Result<(), Blocked> {
        let status = self.call("SetFMUState", |raw| raw.set_state(self.handle, state))?;
        self.must("SetFMUState", status)?;
        self.time.set(time);
        Ok(())
    }

    /// A saved state as bytes.
    pub(super) fn serialize(&self, state: SavedState) -> Result<Vec<u8>, Blocked> {
        let mut size = 0;
        let status = self.call("SerializedFMUStateSize", |raw| {
            let (status, n) = raw.state_size(self.handle, state)?;
            size = n;
            Some(status)
        })?;
        self.must("SerializedFMUStateSize", status)?;
        let mut out = (Vec::new(), true);
        let status = self.call(&format!("SerializeFMUState(size={size})"), |raw| {
            let (status, bytes, intact) = raw.serialize(self.handle, state, size)?;
            out = (bytes, intact);
            Some(status)
        })?;
        self.must("SerializeFMUState", status)?;
        if !out.1 {
            return Err(Blocked(format!("SerializeFMUState wrote behind its {size} bytes")));
        }
        Ok(out.0)
    }

    /// Frees the instance.
    pub(super) fn free(self) -> Result<(), Blocked> {
        self.bench.calling(&self.bench.raw.name("FreeInstance"));
        self.bench.raw.free(self.handle).ok_or_else(|| Blocked("the function FreeInstance is missing".into()))
    }
}
