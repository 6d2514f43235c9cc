//! The part that both standards share: functions with one C type, and an instance that calls them.

use super::signatures::{
    Deserialize, FreeInstance, GetVector, InstancePointer, OfInstance, Serialize, SetState, SetTime, SetVector,
    StatePlace, StateSize,
};
use crate::standard::{Outcome, Refusal, judge};
use libloading::Library;
use model_description::FmiVersion;
use std::ffi::c_void;
use std::ptr;
use std::sync::Arc;

/// A function with its full name; `None` if the library does not have it.
struct Function<T> {
    name: &'static str,
    pointer: Option<T>,
}

impl<T: Copy> Function<T> {
    fn get(&self) -> Outcome<T> {
        self.pointer.ok_or_else(|| missing(self.name))
    }

    fn required(self) -> Result<Self, String> {
        if self.pointer.is_some() { Ok(self) } else { Err(format!("the function {} is missing", self.name)) }
    }
}

/// The refusal of a call whose function the library does not have.
#[cold]
pub(super) fn missing(name: &str) -> Refusal {
    Refusal::Impossible(format!("the function {name} is missing"))
}

/// Functions that have one C type in both standards. An FMU may omit those of saved states and of interfaces that it does not
/// have.
pub(super) struct SharedFunctions {
    free: Function<FreeInstance>,
    exit_initialization: Function<OfInstance>,
    terminate: Function<OfInstance>,
    reset: Function<OfInstance>,
    get_state: Function<StatePlace>,
    set_state: Function<SetState>,
    free_state: Function<StatePlace>,
    state_size: Function<StateSize>,
    serialize: Function<Serialize>,
    deserialize: Function<Deserialize>,
    enter_event_mode: Function<OfInstance>,
    enter_continuous_time_mode: Function<OfInstance>,
    enter_step_mode: Function<OfInstance>,
    set_time: Function<SetTime>,
    set_states: Function<SetVector>,
    vectors: [Function<GetVector>; 4],
}

/// What a Model Exchange instance fills an array with: the index of its function.
#[derive(Clone, Copy)]
pub(crate) enum Vector {
    States,
    Derivatives,
    Indicators,
    Nominals,
}

impl SharedFunctions {
    /// Finds the functions; names the first missing one that no FMU may omit.
    ///
    /// # Safety
    /// Where the library has these symbols, they are functions of the standard's types. The struct is not used after the
    /// library is closed.
    pub(super) unsafe fn load(library: &Library, version: FmiVersion) -> Result<Self, String> {
        /// # Safety
        /// As for `load`.
        unsafe fn find<T: Copy>(library: &Library, version: FmiVersion, names: [&'static str; 2]) -> Function<T> {
            let name = names[usize::from(version == FmiVersion::V3)];
            // SAFETY: the caller promises the type.
            Function { name, pointer: unsafe { library.get::<T>(name) }.ok().map(|symbol| *symbol) }
        }
        // SAFETY: each name comes with the type that both standards give it.
        unsafe {
            let (l, v) = (library, version);
            Ok(Self {
                free: find(l, v, ["fmi2FreeInstance", "fmi3FreeInstance"]).required()?,
                exit_initialization: find(l, v, ["fmi2ExitInitializationMode", "fmi3ExitInitializationMode"])
                    .required()?,
                terminate: find(l, v, ["fmi2Terminate", "fmi3Terminate"]).required()?,
                reset: find(l, v, ["fmi2Reset", "fmi3Reset"]).required()?,
                get_state: find(l, v, ["fmi2GetFMUstate", "fmi3GetFMUState"]),
                set_state: find(l, v, ["fmi2SetFMUstate", "fmi3SetFMUState"]),
                free_state: find(l, v, ["fmi2FreeFMUstate", "fmi3FreeFMUState"]),
                state_size: find(l, v, ["fmi2SerializedFMUstateSize", "fmi3SerializedFMUStateSize"]),
                serialize: find(l, v, ["fmi2SerializeFMUstate", "fmi3SerializeFMUState"]),
                deserialize: find(l, v, ["fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState"]),
                enter_event_mode: find(l, v, ["fmi2EnterEventMode", "fmi3EnterEventMode"]),
                enter_continuous_time_mode: find(l, v, ["fmi2EnterContinuousTimeMode", "fmi3EnterContinuousTimeMode"]),
                // FMI 2.0 has none, under no name.
                enter_step_mode: find(l, v, ["fmi2EnterStepMode", "fmi3EnterStepMode"]),
                set_time: find(l, v, ["fmi2SetTime", "fmi3SetTime"]),
                set_states: find(l, v, ["fmi2SetContinuousStates", "fmi3SetContinuousStates"]),
                vectors: [
                    find(l, v, ["fmi2GetContinuousStates", "fmi3GetContinuousStates"]),
                    find(l, v, ["fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives"]),
                    find(l, v, ["fmi2GetEventIndicators", "fmi3GetEventIndicators"]),
                    find(l, v, ["fmi2GetNominalsOfContinuousStates", "fmi3GetNominalsOfContinuousStates"]),
                ],
            })
        }
    }
}

/// Largest serialized state in bytes, 1 GiB. The size is what an FMU says, and memory for it must not take the process down.
const LARGEST_STATE: usize = 1 << 30;

/// What fills room for bytes.
pub(super) const FILL: u8 = 0xc5;

/// Room for a serialized state of this `size` with `more` bytes behind it.
///
/// # Errors
/// The size is more than [`LARGEST_STATE`], or there is no memory for it.
pub(super) fn room(size: usize, more: usize) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    if size > LARGEST_STATE || bytes.try_reserve_exact(size + more).is_err() {
        return Err(format!("the FMU state has {size} bytes, more than {LARGEST_STATE} or than there is memory for"));
    }
    bytes.resize(size + more, FILL);
    Ok(bytes)
}

/// A pointer that an FMU gave out, to an instance or to a saved state. Only the FMU follows it.
#[derive(Clone, Copy)]
pub(crate) struct Handle(*mut c_void);

// SAFETY: an instance and its states go from thread to thread together, and every call takes the instance by `&mut`, so that
// calls follow one another. More than that neither standard lets an FMU ask for: "FMI functions of one instance do not need to
// be thread-safe", and the importer that calls them from several threads guarantees the calling sequence (FMI 2.0.5, 2.1;
// FMI 3.0.2, 2.2.1).
unsafe impl Send for Handle {}

/// An instance with the functions that both standards share. Dropping it frees the instance.
pub(crate) struct SharedInstance {
    functions: Arc<SharedFunctions>,
    /// Alive until this is dropped; null after [`abandon`](Self::abandon).
    instance: Handle,
}

impl SharedInstance {
    /// The instance that the function `name` returned, or the refusal if it returned NULL.
    ///
    /// # Safety
    /// `pointer` is an instance of the library of these functions, or NULL. The library stays loaded as long as this
    /// lives.
    pub(super) unsafe fn new(
        name: &'static str,
        functions: &Arc<SharedFunctions>,
        pointer: InstancePointer,
    ) -> Outcome<Self> {
        if pointer.is_null() {
            Err(Refusal::Null(name))
        } else {
            Ok(Self { functions: functions.clone(), instance: Handle(pointer) })
        }
    }

    /// For a call while this is borrowed mutably.
    #[inline]
    pub(super) fn pointer(&self) -> InstancePointer {
        self.instance.0
    }

    /// Calls a function that takes only the instance.
    pub(super) fn call(&self, name: &'static str, function: OfInstance) -> Outcome {
        // SAFETY: the instance is alive.
        judge(name, unsafe { function(self.pointer()) })
    }

    pub(crate) fn exit_initialization(&self) -> Outcome {
        let function = &self.functions.exit_initialization;
        self.call(function.name, function.get()?)
    }

    pub(crate) fn terminate(&self) -> Outcome {
        self.call(self.functions.terminate.name, self.functions.terminate.get()?)
    }

    pub(crate) fn reset(&self) -> Outcome {
        self.call(self.functions.reset.name, self.functions.reset.get()?)
    }

    pub(crate) fn get_state(&self) -> Outcome<Handle> {
        let (function, mut state) = (self.functions.get_state.get()?, ptr::null_mut());
        // SAFETY: the instance is alive; a null state asks for a new one.
        judge(self.functions.get_state.name, unsafe { function(self.pointer(), &raw mut state) })
            .map(|()| Handle(state))
    }

    pub(crate) fn set_state(&self, state: Handle) -> Outcome {
        let function = self.functions.set_state.get()?;
        // SAFETY: the instance is alive; the facade passes only states that it got and has not freed.
        judge(self.functions.set_state.name, unsafe { function(self.pointer(), state.0) })
    }

    pub(crate) fn free_state(&self, mut state: Handle) -> Outcome {
        let function = self.functions.free_state.get()?;
        // SAFETY: as above; the facade forgets the state.
        judge(self.functions.free_state.name, unsafe { function(self.pointer(), &raw mut state.0) })
    }

    pub(crate) fn serialize(&self, state: Handle) -> Outcome<Vec<u8>> {
        let (size_of, serialize) = (self.functions.state_size.get()?, self.functions.serialize.get()?);
        let mut size = 0;
        // SAFETY: the instance and the state are alive; there is room for the size.
        judge(self.functions.state_size.name, unsafe { size_of(self.pointer(), state.0, &raw mut size) })?;
        let mut bytes = room(size, 0).map_err(Refusal::Impossible)?;
        // SAFETY: as above; the buffer has the size that the FMU asked for.
        let status = unsafe { serialize(self.pointer(), state.0, bytes.as_mut_ptr(), size) };
        judge(self.functions.serialize.name, status).map(|()| bytes)
    }

    pub(crate) fn deserialize(&self, bytes: &[u8]) -> Outcome<Handle> {
        let (function, mut state) = (self.functions.deserialize.get()?, ptr::null_mut());
        // SAFETY: the instance is alive; the pointer and the length are those of one slice.
        let status = unsafe { function(self.pointer(), bytes.as_ptr(), bytes.len(), &raw mut state) };
        judge(self.functions.deserialize.name, status).map(|()| Handle(state))
    }

    pub(crate) fn enter_event_mode(&self) -> Outcome {
        self.call(self.functions.enter_event_mode.name, self.functions.enter_event_mode.get()?)
    }

    pub(crate) fn enter_continuous_time_mode(&self) -> Outcome {
        let function = &self.functions.enter_continuous_time_mode;
        self.call(function.name, function.get()?)
    }

    pub(crate) fn enter_step_mode(&self) -> Outcome {
        self.call(self.functions.enter_step_mode.name, self.functions.enter_step_mode.get()?)
    }

    pub(crate) fn set_time(&self, t: f64) -> Outcome {
        let function = self.functions.set_time.get()?;
        // SAFETY: the instance is alive.
        judge(self.functions.set_time.name, unsafe { function(self.pointer(), t) })
    }

    pub(crate) fn set_states(&self, x: &[f64]) -> Outcome {
        let function = self.functions.set_states.get()?;
        // SAFETY: the instance is alive; the pointer and the length are those of one slice.
        judge(self.functions.set_states.name, unsafe { function(self.pointer(), x.as_ptr(), x.len()) })
    }

    pub(crate) fn get_vector(&self, which: Vector, values: &mut [f64]) -> Outcome {
        let function = &self.functions.vectors[which as usize];
        let get = function.get()?;
        // SAFETY: the instance is alive; the pointer and the length are those of one slice.
        judge(function.name, unsafe { get(self.pointer(), values.as_mut_ptr(), values.len()) })
    }

    /// Forgets the instance without freeing it: after a fatal error the standard forbids every further call.
    pub(crate) fn abandon(&mut self) {
        self.instance = Handle(ptr::null_mut());
    }
}

impl Drop for SharedInstance {
    fn drop(&mut self) {
        if let (false, Some(free)) = (self.pointer().is_null(), self.functions.free.pointer) {
            // SAFETY: the instance is alive, and nothing uses it after this.
            unsafe { free(self.pointer()) };
        }
    }
}
