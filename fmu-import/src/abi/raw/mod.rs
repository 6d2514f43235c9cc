//! Raw calls of an FMU's binary, for the checker: every function of both standards, with arguments that a well-behaved
//! importer would never pass.
//!
//! No argument that safe code can form makes a call undefined behavior by itself. Instances and saved states are places in
//! a table that [`Raw`] owns: one that is freed, or of another binary, is refused before the call. Arrays are at least as
//! long as the count that goes with them, or NULL; pointers to texts come from [`CStr`] only; a function is named by a type
//! whose values all have one C signature. The calls of a `Raw` follow one another. The checker tests how the FMU reacts to
//! NULL, to unknown value references, to a call in the wrong state; it calls from a process of its own.
//!
//! # Panics
//! Every call panics if its instance or its state is freed or of another binary.

mod buffer;
mod callbacks;
mod equations;
mod instantiate;
mod names;
mod optional;
mod owned;
mod processor;
mod states;

pub use buffer::{Buffer, type_name, width};
pub use callbacks::{Event, allocations, take_events};
pub use equations::{SensitivityArguments, Updated};
pub use instantiate::{Arguments, Interface};
pub use names::{Count, Optional, Sensitivity, Simple, StepStatus, Text, Vector};
pub use owned::{Handle, SavedState};
pub use processor::float_control;

use super::log::Status;
use super::signatures::{FreeInstance, OfInstance, Text as TextFunction, v2, v3};
use buffer::CANARY;
use callbacks::optional;
use libloading::Library;
use model_description::{BaseType, FmiVersion};
use owned::Owned;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;
use std::ptr;
use std::sync::Mutex;

/// Which results of `fmi3DoStep` get a pointer; the others get NULL.
pub type ResultPointers = [bool; 4];

/// The results of `fmi3DoStep`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stepped {
    /// `eventHandlingNeeded`, as a byte.
    pub event: u8,
    /// `terminateSimulation`, as a byte.
    pub terminate: u8,
    /// `earlyReturn`, as a byte.
    pub early: u8,
    /// `lastSuccessfulTime`.
    pub last: f64,
}

/// A loaded binary.
#[derive(Debug)]
pub struct Raw {
    library: Library,
    version: FmiVersion,
    owned: Mutex<Owned>,
}

impl Raw {
    fn of(library: Library, version: FmiVersion) -> Self {
        Self { library, version, owned: Mutex::new(Owned::new()) }
    }

    /// Loads a binary.
    ///
    /// # Errors
    /// The error message of the system.
    pub fn open(path: &Path, version: FmiVersion) -> Result<Self, String> {
        crate::abi::library::load(path).map(|library| Self::of(library, version)).map_err(|e| e.cause())
    }

    /// Loads a binary with its symbols visible to all libraries loaded later, and resolved at once.
    ///
    /// # Errors
    /// The error message of the system.
    #[cfg(unix)]
    pub fn open_global(path: &Path, version: FmiVersion) -> Result<Self, String> {
        use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW};
        // SAFETY: as `library::load`: the code has every right of this process.
        let library = unsafe { Library::open(Some(path), RTLD_NOW | RTLD_GLOBAL) };
        library.map(|library| Self::of(library.into(), version)).map_err(|e| e.to_string())
    }

    /// Unloads the binary.
    ///
    /// # Errors
    /// The error message of the system.
    pub fn close(self) -> Result<(), String> {
        self.library.close().map_err(|e| e.to_string())
    }

    /// The standard.
    pub fn version(&self) -> FmiVersion {
        self.version
    }

    /// Name with the prefix of the standard: `fmi2` or `fmi3`.
    pub fn name(&self, name: &str) -> String {
        match self.version {
            FmiVersion::V2 => format!("fmi2{name}"),
            FmiVersion::V3 => format!("fmi3{name}"),
        }
    }

    /// Whether there is a function of this name, without prefix.
    pub fn has(&self, name: &str) -> bool {
        self.function::<OfInstance>(name).is_some()
    }

    /// A function by its name without prefix. The type must be that of the standard, which every caller below ensures.
    fn function<T: Copy>(&self, name: &str) -> Option<T> {
        // SAFETY: only copied here; called below under the type that the standard gives this name.
        unsafe { self.library.get::<T>(self.name(name)) }.ok().map(|f| *f)
    }

    /// A constant string of the FMU.
    pub fn text(&self, name: Text) -> Option<String> {
        let function: TextFunction = self.function(name.as_str())?;
        // SAFETY: the standard's type; the text is a constant of the FMU.
        unsafe { optional(function()) }
    }

    /// `FreeInstance`; `None` if it is missing.
    pub fn free(&self, instance: Handle) -> Option<()> {
        let f: FreeInstance = self.function("FreeInstance")?;
        let mut owned = self.owned();
        let pointer = owned.forget_instance(instance);
        // SAFETY: an instance of this FMU, which the table forgot with its states, or NULL.
        unsafe { f(pointer) };
        Some(())
    }

    /// Calls a function that takes only the instance. `fmi3EnterInitializationMode` takes more: see
    /// [`experiment`](Self::experiment).
    pub fn simple(&self, name: Simple, instance: Handle) -> Option<Status> {
        if name == Simple::EnterInitializationMode && self.version == FmiVersion::V3 {
            return None;
        }
        let f: OfInstance = self.function(name.as_str())?;
        // SAFETY: all functions that `Simple` names have this type.
        Some(unsafe { f(self.owned().pointer(instance)) })
    }

    /// `fmi2SetupExperiment` or `fmi3EnterInitializationMode`.
    pub fn experiment(
        &self,
        instance: Handle,
        tolerance: Option<f64>,
        start: f64,
        stop: Option<f64>,
    ) -> Option<Status> {
        let (has_tolerance, has_stop) = (tolerance.is_some(), stop.is_some());
        let (tolerance, stop) = (tolerance.unwrap_or(0.0), stop.unwrap_or(0.0));
        // SAFETY: the standards' types.
        Some(unsafe {
            match self.version {
                FmiVersion::V2 => {
                    let f: v2::SetupExperiment = self.function("SetupExperiment")?;
                    f(
                        self.owned().pointer(instance),
                        c_int::from(has_tolerance),
                        tolerance,
                        start,
                        c_int::from(has_stop),
                        stop,
                    )
                }
                FmiVersion::V3 => {
                    let f: v3::EnterInitializationMode = self.function("EnterInitializationMode")?;
                    f(self.owned().pointer(instance), has_tolerance, tolerance, start, has_stop, stop)
                }
            }
        })
    }

    /// A getter: `references` and `values` may be NULL; `n` and `n_values` (FMI 3.0 only) may be less than their lengths.
    ///
    /// # Panics
    /// An array is shorter than its count, the buffer is of another type, or the type is Binary or Clock, whose functions
    /// take other arguments.
    pub fn get(
        &self,
        instance: Handle,
        base: BaseType,
        references: Option<&[u32]>,
        n: usize,
        values: Option<&mut Buffer>,
        n_values: usize,
    ) -> Option<Status> {
        self.transfer(&self.owned(), "Get", instance, base, references, n, values, n_values)
    }

    /// A setter, as [`get`](Self::get). Texts are NULL; [`set_strings`](Self::set_strings) sets others.
    ///
    /// # Panics
    /// As [`get`](Self::get), or a text is not NULL.
    pub fn set(
        &self,
        instance: Handle,
        base: BaseType,
        references: Option<&[u32]>,
        n: usize,
        values: Option<&mut Buffer>,
        n_values: usize,
    ) -> Option<Status> {
        // A getter may have left pointers there, which are the FMU's.
        let null = |buffer: &&mut Buffer| buffer.words[..n.max(n_values)].iter().all(|word| *word == 0);
        assert!(base != BaseType::String || values.as_ref().is_none_or(null), "a pointer that is not ours");
        self.transfer(&self.owned(), "Set", instance, base, references, n, values, n_values)
    }

    #[expect(clippy::too_many_arguments, reason = "those of the C function")]
    fn transfer(
        &self,
        owned: &Owned,
        way: &str,
        instance: Handle,
        base: BaseType,
        references: Option<&[u32]>,
        n: usize,
        values: Option<&mut Buffer>,
        n_values: usize,
    ) -> Option<Status> {
        let kind = type_name(base, self.version);
        assert!(!matches!(base, BaseType::Binary | BaseType::Clock), "{way}{kind} takes other arguments");
        assert!(references.is_none_or(|r| n <= r.len()), "there are fewer references than n");
        let references = references.map_or(ptr::null(), <[u32]>::as_ptr);
        let values = values.map_or(ptr::null_mut(), |buffer| {
            assert!(buffer.holds(kind), "the buffer is not of the type {kind}");
            assert!(n_values.max(n) <= buffer.capacity(), "there are fewer values than n_values");
            buffer.words.as_mut_ptr().cast::<c_void>()
        });
        let name = format!("{way}{kind}");
        let instance = owned.pointer(instance);
        // SAFETY: the standards' types, whatever the values are: they only differ in what the pointer points to. The
        // arrays are NULL or have the lengths that are passed.
        Some(unsafe {
            match self.version {
                FmiVersion::V2 => self.function::<v2::Get<c_void>>(&name)?(instance, references, n, values),
                FmiVersion::V3 => self.function::<v3::Get<c_void>>(&name)?(instance, references, n, values, n_values),
            }
        })
    }

    /// Texts; NULL pointers come back as `None`.
    pub fn get_strings(
        &self,
        instance: Handle,
        references: &[u32],
        count: usize,
    ) -> Option<(Status, Vec<Option<String>>)> {
        let mut buffer = Buffer::room(BaseType::String, self.version, count);
        for word in &mut buffer.words[..count] {
            *word = 0;
        }
        // Held until the texts are copied, which the next call may end.
        let owned = self.owned();
        let (list, n) = (Some(references), references.len());
        let status = self.transfer(&owned, "Get", instance, BaseType::String, list, n, Some(&mut buffer), count)?;
        if !status.is_ok() {
            return Some((status, Vec::new()));
        }
        let pointer = |word: u64| ptr::with_exposed_provenance::<c_char>(usize::try_from(word).unwrap_or(0));
        // SAFETY: C strings of the FMU, alive until its next call, or NULL.
        Some((status, buffer.bits().into_iter().map(|word| unsafe { optional(pointer(word)) }).collect()))
    }

    /// Sets texts; `None` for NULL. The buffer is overwritten afterwards.
    ///
    /// # Panics
    /// There are fewer texts than references.
    pub fn set_strings(&self, instance: Handle, references: &[u32], texts: &[Option<&CStr>]) -> Option<Status> {
        assert!(references.len() <= texts.len(), "there are fewer texts than references");
        let mut copies: Vec<Option<Vec<u8>>> =
            texts.iter().map(|t| t.map(|t| t.to_bytes_with_nul().to_vec())).collect();
        let address = |copy: &Option<Vec<u8>>| copy.as_ref().map_or(0, |c| c.as_ptr().expose_provenance() as u64);
        let bits: Vec<u64> = copies.iter().map(address).collect();
        let mut buffer = Buffer::with_bits(BaseType::String, self.version, &bits);
        let (list, n) = (Some(references), references.len());
        let values = Some(&mut buffer);
        let status = self.transfer(&self.owned(), "Set", instance, BaseType::String, list, n, values, texts.len());
        for copy in copies.iter_mut().flatten() {
            let end = copy.len().saturating_sub(1);
            copy[..end].fill(b'#');
        }
        status
    }

    /// `DoStep`; `pointers` are FMI 3.0's.
    pub fn do_step(
        &self,
        instance: Handle,
        t: f64,
        h: f64,
        no_prior: bool,
        pointers: ResultPointers,
    ) -> Option<(Status, Stepped)> {
        let mut results = Stepped { event: 0xc5, terminate: 0xc5, early: 0xc5, last: f64::NAN };
        // SAFETY: the standards' types; the places are ours or NULL.
        let status = unsafe {
            match self.version {
                FmiVersion::V2 => {
                    let f: v2::DoStep = self.function("DoStep")?;
                    f(self.owned().pointer(instance), t, h, c_int::from(no_prior))
                }
                FmiVersion::V3 => {
                    let f: v3::DoStep = self.function("DoStep")?;
                    let null = ptr::null_mut;
                    f(
                        self.owned().pointer(instance),
                        t,
                        h,
                        no_prior,
                        if pointers[0] { &raw mut results.event } else { null() },
                        if pointers[1] { &raw mut results.terminate } else { null() },
                        if pointers[2] { &raw mut results.early } else { null() },
                        if pointers[3] { &raw mut results.last } else { ptr::null_mut() },
                    )
                }
            }
        };
        Some((status, results))
    }

    /// `SetDebugLogging`; `categories` may be NULL, and an element of it.
    ///
    /// # Panics
    /// There are fewer than `n` categories.
    pub fn debug_logging(
        &self,
        instance: Handle,
        on: bool,
        categories: Option<&[Option<&CStr>]>,
        n: usize,
    ) -> Option<Status> {
        let list: Vec<*const c_char> =
            categories.unwrap_or_default().iter().map(|c| c.map_or(ptr::null(), CStr::as_ptr)).collect();
        let pointer = if categories.is_some() { list.as_ptr() } else { ptr::null() };
        assert!(categories.is_none() || n <= list.len(), "the array has fewer than n elements");
        // SAFETY: the standards' types; as many strings as said, or NULL.
        Some(unsafe {
            match self.version {
                FmiVersion::V2 => self.function::<v2::SetDebugLogging>("SetDebugLogging")?(
                    self.owned().pointer(instance),
                    c_int::from(on),
                    n,
                    pointer,
                ),
                FmiVersion::V3 => self.function::<v3::SetDebugLogging>("SetDebugLogging")?(
                    self.owned().pointer(instance),
                    on,
                    n,
                    pointer,
                ),
            }
        })
    }

    /// `fmi2Get...Status` with a place for any of its results; returns the first eight bytes of it.
    pub fn step_status(&self, name: StepStatus, instance: Handle, kind: c_int) -> Option<(Status, u64)> {
        let f: v2::GetStatus<u64> = self.function(name.as_str())?;
        let mut value = CANARY;
        // SAFETY: FMI 2.0's type but for the place, which has room for each of its values.
        Some((unsafe { f(self.owned().pointer(instance), kind, &raw mut value) }, value))
    }
}
