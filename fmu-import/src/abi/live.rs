//! An instance of the facade, over the calls of either standard. Dropping it frees the instance.

use super::arguments::{Answer, Given};
use super::calls::{Request, Updates};
use super::functions::{CType, Calls, Way};
use super::log::{Log, Message, Status, copy_text};
use super::logger::{Called, Listener, logger};
use super::raw::{Buffer, Count, Interface, Sensitivity, Simple, StepResults, StepStatus, Vector, type_name, width};
use super::signatures::v2::{Callbacks, calloc, free};
use crate::standard::{
    CompletedStep, Directions, Experiment, Kind, Outcome, Refusal, Stepped, Update, misfit, same_length,
};
use crate::trace;
use crate::value::Values;
use model_description::{BaseType, FmiVersion};
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::AtomicPtr;
use std::time::Duration;

/// `fmi2DoStepStatus`.
const DO_STEP_STATUS: i32 = 0;
/// `fmi2LastSuccessfulTime`, a status kind.
const LAST_SUCCESSFUL_TIME: i32 = 2;
/// `fmi2Terminated`, a status kind.
const TERMINATED: i32 = 3;

/// Receives the messages of FMI 2.0.
struct Facade;

impl Listener for Facade {
    unsafe fn hear(called: Called) {
        let text = called.text.map(|formatted| formatted.text).unwrap_or_default();
        let text = String::from_utf8_lossy(&text).into_owned();
        // SAFETY: the FMU passes C strings.
        let category = unsafe { copy_text(called.category) };
        Log::receive(called.environment, Message { status: called.status, category, text });
    }
}

unsafe extern "C" fn log_message(
    environment: *mut c_void,
    status: Status,
    category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the FMU passes C strings.
    let (category, text) = unsafe { (copy_text(category), copy_text(message)) };
    Log::receive(environment, Message { status, category, text });
}

/// A pointer from an FMU to an instance or to a saved state. Only the FMU dereferences it.
#[derive(Clone, Copy)]
pub(crate) struct Pointer(*mut c_void);

// SAFETY: an instance and its states go from thread to thread together, and every call takes the instance by `&mut`, so that
// calls follow one another. Neither standard lets an FMU require more: "FMI functions of one instance do not need to be
// thread-safe", and the importer that calls them from several threads guarantees the calling sequence (FMI 2.0.5, 2.1; FMI
// 3.0.2, 2.2.1).
unsafe impl Send for Pointer {}

/// An instance.
pub(crate) struct Live {
    calls: Arc<Calls>,
    /// Alive until this is dropped; null after [`abandon`](Self::abandon).
    instance: Pointer,
    /// FMI 3.0 receives the times on entering initialization mode.
    experiment: Experiment,
    /// `lastSuccessfulTime` of the last step (FMI 3.0).
    last_successful_time: f64,
    /// Number of saved states; without any, the instance cannot return to an earlier time.
    saved: usize,
    /// FMI 2.0 before its revision 5 let the FMU keep the pointer to the callbacks.
    _callbacks: Arc<Callbacks>,
}

impl Live {
    pub(super) fn new(
        calls: &Arc<Calls>,
        texts: [&CStr; 3],
        log: &Arc<Log>,
        [logging, visible]: [bool; 2],
        kind: Kind,
    ) -> Outcome<Self> {
        let (interface, event_mode, early_return) = match kind {
            Kind::CoSimulation { event_mode, early_return } => (Interface::CoSimulation, event_mode, early_return),
            Kind::ModelExchange => (Interface::ModelExchange, false, false),
        };
        let environment = log.environment();
        let callbacks = Arc::new(Callbacks {
            logger: Some(logger::<Facade>),
            allocate: Some(calloc),
            free: Some(free),
            step_finished: None,
            environment: AtomicPtr::new(environment),
        });
        let request = Request {
            texts: texts.map(Some),
            interface,
            logging,
            visible,
            event_mode,
            early_return,
            callbacks: Arc::as_ptr(&callbacks),
            logger: Some(log_message),
            environment,
            updates: Updates::default(),
        };
        // SAFETY: the callbacks outlive the instance; the environment is a number that is never dereferenced.
        let (name, pointer) = unsafe { calls.instantiate(&request) };
        let missing = || Refusal::Impossible(format!("the function {name} is missing"));
        trace::note(name, || if pointer.is_some_and(|p| !p.is_null()) { "an instance" } else { "no instance" }.into());
        let pointer = pointer.ok_or_else(missing)?;
        if pointer.is_null() {
            return Err(Refusal::Null(name));
        }
        let experiment = Experiment { start: 0.0, stop: None, tolerance: None };
        let (calls, instance) = (calls.clone(), Pointer(pointer));
        Ok(Self { calls, instance, experiment, last_successful_time: 0.0, saved: 0, _callbacks: callbacks })
    }

    fn is_v2(&self) -> bool {
        self.calls.version == FmiVersion::V2
    }

    /// For a call while this is borrowed.
    #[inline]
    fn given(&self) -> Given<'_> {
        // SAFETY: an instance of this library, alive as long as `self`, or null.
        unsafe { Given::new(self.instance.0) }
    }

    /// A saved state, for a call.
    fn state<'a>(state: Pointer) -> Given<'a> {
        // SAFETY: the facade passes only states that it got and has not freed.
        unsafe { Given::new(state.0) }
    }

    #[inline]
    pub(crate) fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Outcome {
        let n = references.len().min(values.len());
        let (list, place) = ((&references[..n]).into(), values.as_mut_ptr().cast());
        // SAFETY: there are n doubles.
        unsafe { self.calls.transfer(Way::Get, self.given(), CType::DOUBLE, list, place, n) }.outcome()
    }

    #[inline]
    pub(crate) fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Outcome {
        let n = references.len().min(values.len());
        let (list, place) = ((&references[..n]).into(), values.as_ptr().cast_mut().cast());
        // SAFETY: there are n doubles, which a setter only reads.
        unsafe { self.calls.transfer(Way::Set, self.given(), CType::DOUBLE, list, place, n) }.outcome()
    }

    /// Gets or sets the elements of one variable.
    fn transfer(&self, way: Way, base: BaseType, reference: u32, buffer: &mut Buffer) -> Outcome {
        let kind = CType::named(type_name(base, self.calls.version), self.calls.version);
        let kind = kind.ok_or_else(|| Refusal::Impossible(format!("values of the type {base} are not supported")))?;
        let n = buffer.count();
        let (list, place) = ([reference], buffer.words.as_mut_ptr().cast());
        // SAFETY: the buffer has the values of one variable, in FMI 2.0 one; texts to set are C strings that outlive the call.
        unsafe { self.calls.transfer(way, self.given(), kind, list[..].into(), place, n) }.outcome()
    }

    pub(crate) fn get(&mut self, base: BaseType, reference: u32, count: usize) -> Outcome<Values> {
        let count = if self.is_v2() { 1 } else { count };
        if base == BaseType::Binary {
            return self.calls.get_binary(self.given(), reference, count).map(Values::Binaries);
        }
        let mut buffer = Buffer::of(base, self.calls.version, &vec![0; count]);
        self.transfer(Way::Get, base, reference, &mut buffer)?;
        let bits = buffer.bits().into_iter();
        let low = |x: u64| u32::try_from(x & 0xffff_ffff).unwrap_or_default();
        Ok(match base {
            BaseType::Float64 => Values::Reals(bits.map(f64::from_bits).collect()),
            BaseType::Float32 => Values::Reals(bits.map(|x| f32::from_bits(low(x)).into()).collect()),
            BaseType::Boolean => Values::Booleans(bits.map(|x| x != 0).collect()),
            BaseType::String => {
                let pointer = |x: u64| ptr::with_exposed_provenance::<c_char>(usize::try_from(x).unwrap_or(0));
                // SAFETY: the FMU's strings live until its next call.
                Values::Strings(bits.map(|x| unsafe { copy_text(pointer(x)) }).collect())
            }
            BaseType::UInt8 | BaseType::UInt16 | BaseType::UInt32 | BaseType::UInt64 => {
                Values::Integers(bits.map(i128::from).collect())
            }
            _ => {
                let shift = 64 - 8 * width(base, self.calls.version);
                Values::Integers(bits.map(|x| ((x << shift).cast_signed() >> shift).into()).collect())
            }
        })
    }

    pub(crate) fn set(&mut self, base: BaseType, reference: u32, values: &Values) -> Outcome {
        let refused = || misfit(base, values);
        if self.is_v2() && values.len() != 1 {
            return Err(refused());
        }
        if let (BaseType::Binary, Values::Binaries(values)) = (base, values) {
            return self.calls.set_binary(self.given(), reference, values);
        }
        let mut texts = Vec::new();
        let bits: Vec<u64> = match (base, values) {
            (BaseType::Float64, Values::Reals(x)) => x.iter().map(|x| x.to_bits()).collect(),
            #[expect(clippy::cast_possible_truncation, reason = "the FMU takes single precision")]
            (BaseType::Float32, Values::Reals(x)) => x.iter().map(|&x| (x as f32).to_bits().into()).collect(),
            (BaseType::Boolean, Values::Booleans(x)) => x.iter().map(|&x| x.into()).collect(),
            (BaseType::String, Values::Strings(x)) => {
                let all: Result<_, _> = x.iter().map(|x| CString::new(x.as_str())).collect();
                texts = all.map_err(|_| refused())?;
                texts.iter().map(|text: &CString| text.as_ptr().expose_provenance() as u64).collect()
            }
            (base, Values::Integers(x)) if base.is_integer() => {
                integers(base, 8 * width(base, self.calls.version), x).ok_or_else(refused)?
            }
            _ => return Err(refused()),
        };
        let mut buffer = Buffer::with_bits(base, self.calls.version, &bits);
        let outcome = self.transfer(Way::Set, base, reference, &mut buffer);
        drop(texts);
        outcome
    }

    /// Applies to all categories, or only to the given one.
    pub(crate) fn set_debug_logging(&mut self, on: bool, category: Option<&CStr>) -> Outcome {
        let list = category.map(|category| [Some(category)]);
        let list = list.as_ref().map(<[_; 1]>::as_slice);
        self.calls.debug_logging(self.given(), on, list, list.map_or(0, <[_]>::len)).outcome()
    }

    pub(crate) fn setup(&mut self, x: Experiment) -> Outcome {
        self.experiment = x;
        let all = || self.calls.experiment(self.given(), x.tolerance, x.start, x.stop);
        if self.is_v2() { all().outcome() } else { Ok(()) }
    }

    pub(crate) fn enter_initialization(&mut self) -> Outcome {
        if self.is_v2() {
            return self.simple(Simple::EnterInitializationMode);
        }
        let Experiment { start, stop, tolerance } = self.experiment;
        self.calls.experiment(self.given(), tolerance, start, stop).outcome()
    }

    #[inline]
    pub(crate) fn simple(&mut self, name: Simple) -> Outcome {
        self.calls.simple(name, self.given()).outcome()
    }

    /// `noSetFMUStatePriorToCurrentPoint`: no earlier point was saved, so the importer cannot return to one.
    fn no_prior(&self) -> bool {
        self.saved == 0
    }

    #[inline]
    pub(crate) fn do_step(&mut self, t: f64, h: f64) -> Outcome<Stepped> {
        let before = StepResults { event: 0, terminate: 0, early: 0, last: t };
        let answer = self.calls.do_step(self.given(), (t, h), self.no_prior(), [true; 4], before);
        if self.is_v2() {
            let answer = self.awaited(answer);
            let terminate = answer.was(Status::DISCARD) && self.terminated();
            let last = if terminate { self.last_successful_time().unwrap_or(t + h) } else { t + h };
            let stepped = Stepped { terminate, event: false, early: false, last };
            return if terminate { Ok(stepped) } else { answer.outcome().map(|_| stepped) };
        }
        let StepResults { event, terminate, early, last } = answer.outcome()?;
        self.last_successful_time = last;
        Ok(Stepped { terminate: terminate != 0, event: event != 0, early: early != 0, last })
    }

    /// The answer of a step of FMI 2.0 when the step is over: an FMU that runs asynchronously returns Pending before.
    #[inline]
    fn awaited(&self, answer: Answer<StepResults>) -> Answer<StepResults> {
        if answer.was(Status::PENDING) { self.wait_for(answer) } else { answer }
    }

    #[cold]
    fn wait_for(&self, answer: Answer<StepResults>) -> Answer<StepResults> {
        let pending = u64::from(Status::PENDING.0.cast_unsigned());
        loop {
            let asked = self.calls.step_status(StepStatus::GetStatus, self.given(), DO_STEP_STATUS, pending).result();
            let status = match asked {
                Some((status, _)) if !status.is_ok() => status,
                Some((_, value)) => Status((value & 0xffff_ffff) as i32),
                None => return answer,
            };
            if status != Status::PENDING {
                return Answer(answer.0, answer.1.map(|(_, results)| (status, results)));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Whether an FMU of FMI 2.0 discarded a step because it ends the simulation.
    #[cold]
    fn terminated(&self) -> bool {
        let asked = self.calls.step_status(StepStatus::GetBooleanStatus, self.given(), TERMINATED, 0);
        asked.result().is_some_and(|(status, ended)| status == Status::OK && ended & 0xffff_ffff != 0)
    }

    pub(crate) fn last_successful_time(&mut self) -> Outcome<f64> {
        if !self.is_v2() {
            return Ok(self.last_successful_time);
        }
        let asked = self.calls.step_status(StepStatus::GetRealStatus, self.given(), LAST_SUCCESSFUL_TIME, 0);
        asked.outcome().map(f64::from_bits)
    }

    pub(crate) fn get_state(&mut self) -> Outcome<Pointer> {
        let state = self.calls.get_state(self.given(), Some(Given::NULL)).outcome().map(Pointer)?;
        self.saved += 1;
        Ok(state)
    }

    pub(crate) fn set_state(&mut self, state: Pointer) -> Outcome {
        self.calls.set_state(self.given(), Self::state(state)).outcome()
    }

    pub(crate) fn free_state(&mut self, state: Pointer) -> Outcome {
        self.saved = self.saved.saturating_sub(1);
        // SAFETY: the facade forgets the state.
        unsafe { self.calls.free_state(self.given(), Some(Self::state(state))) }.outcome().map(drop)
    }

    pub(crate) fn serialize(&mut self, state: Pointer) -> Outcome<Vec<u8>> {
        let size = self.calls.state_size(self.given(), Self::state(state)).outcome()?;
        let mut bytes = room(size, 0).map_err(Refusal::Impossible)?;
        self.calls.serialize(self.given(), Self::state(state), bytes[..].as_mut().into()).outcome().map(|()| bytes)
    }

    pub(crate) fn deserialize(&mut self, bytes: &[u8]) -> Outcome<Pointer> {
        let state = self.calls.deserialize(self.given(), bytes.into()).outcome().map(Pointer)?;
        self.saved += 1;
        Ok(state)
    }

    pub(crate) fn update_discrete_states(&mut self) -> Outcome<Update> {
        let x = self.calls.update_discrete_states(self.given(), false, (0, 0.0)).outcome()?;
        Ok(Update {
            again: x.again != 0,
            terminate: x.terminate != 0,
            nominals_changed: x.nominals_changed != 0,
            states_changed: x.states_changed != 0,
            next_event_time: (x.next_event_time_defined != 0).then_some(x.next_event_time),
        })
    }

    pub(crate) fn clock(&mut self, clock: u32) -> Outcome<bool> {
        self.calls.clock(self.given(), clock, 0).outcome().map(|active| active != 0)
    }

    pub(crate) fn activate(&mut self, clock: u32) -> Outcome {
        self.calls.activate(self.given(), clock).outcome()
    }

    /// The interval of a clock, if it has changed or was not yet reported.
    pub(crate) fn interval(&mut self, clock: u32) -> Outcome<Option<f64>> {
        /// `fmi3IntervalChanged`.
        const CHANGED: i32 = 2;
        let (interval, qualifier) = self.calls.interval(self.given(), clock, (0.0, 0)).outcome()?;
        Ok((qualifier == CHANGED).then_some(interval))
    }

    pub(crate) fn shift(&mut self, clock: u32) -> Outcome<f64> {
        self.calls.shift(self.given(), clock, 0.0).outcome()
    }

    pub(crate) fn completed_integrator_step(&mut self) -> Outcome<CompletedStep> {
        let [event, terminate] = self.calls.completed(self.given(), self.no_prior(), false, 0).outcome()?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate: terminate != 0 })
    }

    #[inline]
    pub(crate) fn set_time(&mut self, t: f64) -> Outcome {
        self.calls.set_time(self.given(), t).outcome()
    }

    #[inline]
    pub(crate) fn set_states(&mut self, x: &[f64]) -> Outcome {
        self.calls.set_states(self.given(), x.into()).outcome()
    }

    #[inline]
    pub(crate) fn vector(&mut self, name: Vector, values: &mut [f64]) -> Outcome {
        self.calls.vector(name, self.given(), values.into()).outcome()
    }

    #[inline]
    pub(crate) fn derivatives(&mut self, dx: &mut [f64]) -> Outcome {
        self.vector(if self.is_v2() { Vector::GetDerivatives } else { Vector::GetContinuousStateDerivatives }, dx)
    }

    /// Numbers of continuous states and event indicators; `None` if they are only in the description.
    pub(crate) fn counts(&mut self) -> Outcome<Option<(usize, usize)>> {
        if self.is_v2() {
            return Ok(None);
        }
        let count = |name| self.calls.count(name, self.given(), false).outcome();
        Ok(Some((count(Count::GetNumberOfContinuousStates)?, count(Count::GetNumberOfEventIndicators)?)))
    }

    pub(crate) fn sensitivity(&mut self, name: Sensitivity, d: Directions<'_>, results: &mut [f64]) -> Outcome {
        if self.is_v2() {
            if name == Sensitivity::GetAdjointDerivative {
                return Err(Refusal::Impossible("FMI 2.0 has no adjoint derivatives".into()));
            }
            same_length("unknowns and sensitivity", &[d.unknowns.len(), results.len()])?;
            same_length("knowns and seed", &[d.knowns.len(), d.seed.len()])?;
        }
        let lists = [d.unknowns.into(), d.knowns.into()];
        self.calls.sensitivity(name, self.given(), lists, d.seed.into(), results.into()).outcome()
    }

    pub(crate) fn output_derivatives(&mut self, references: &[u32], orders: &[i32], values: &mut [f64]) -> Outcome {
        if self.is_v2() {
            same_length("references, orders and values", &[references.len(), orders.len(), values.len()])?;
        }
        same_length("references and orders", &[references.len(), orders.len()])?;
        self.calls.output_derivatives(self.given(), references, orders, values).outcome()
    }

    pub(crate) fn set_input_derivatives(&mut self, references: &[u32], orders: &[i32], values: &[f64]) -> Outcome {
        if !self.is_v2() {
            return Err(Refusal::Impossible("FMI 3.0 has no input derivatives".into()));
        }
        same_length("references, orders and values", &[references.len(), orders.len(), values.len()])?;
        self.calls.input_derivatives(self.given(), references.into(), orders.into(), values.into()).outcome()
    }

    /// Forgets the instance without freeing it: after a fatal error the standard forbids every further call.
    pub(crate) fn abandon(&mut self) {
        self.instance = Pointer(ptr::null_mut());
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        if !self.instance.0.is_null() {
            trace::note(self.calls.free.0, String::new);
            // SAFETY: the instance is alive and not used afterwards.
            unsafe { self.calls.free(self.given()) };
        }
    }
}

/// Integers converted to the given number of bits; `None` if one does not fit.
fn integers(base: BaseType, bits: usize, values: &[i128]) -> Option<Vec<u64>> {
    let unsigned = matches!(base, BaseType::UInt8 | BaseType::UInt16 | BaseType::UInt32 | BaseType::UInt64);
    let range = if unsigned { 0..1_i128 << bits } else { -1_i128 << (bits - 1)..1_i128 << (bits - 1) };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the low bits are the value")]
    values.iter().map(|x| range.contains(x).then_some(*x as u64)).collect()
}

/// Largest serialized state in bytes, 1 GiB. The FMU states the size, and reserving memory for it must not end the process.
const LARGEST_STATE: usize = 1 << 30;

/// The fill byte of buffers.
pub(super) const FILL: u8 = 0xc5;

/// A buffer for a serialized state of this `size`, followed by `more` bytes.
///
/// # Errors
/// The size exceeds [`LARGEST_STATE`] or the available memory.
pub(super) fn room(size: usize, more: usize) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    if size > LARGEST_STATE || bytes.try_reserve_exact(size + more).is_err() {
        return Err(format!("the FMU state has {size} bytes, more than {LARGEST_STATE} or than the available memory"));
    }
    bytes.resize(size + more, FILL);
    Ok(bytes)
}
