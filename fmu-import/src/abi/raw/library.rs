//! A loaded binary with its instances: the calls of every FMU.

use super::buffer::{Buffer, type_name};
use super::callbacks::optional;
use super::names::{Simple, StepStatus, Text};
use super::owned::{Handle, Owned};
use super::results::{ResultPointers, StepResults, UNTOUCHED, UNTOUCHED_NUMBER};
use crate::abi::arguments::Array;
use crate::abi::functions::{CType, Calls, Way};
use crate::abi::library;
use crate::abi::log::Status;
use crate::abi::signatures::Text as TextFunction;
use libloading::Library;
use model_description::{BaseType, FmiVersion};
use std::ffi::{CStr, c_char, c_int};
use std::path::Path;
use std::ptr;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A loaded binary.
pub struct Raw {
    pub(super) calls: Calls,
    owned: Mutex<Owned>,
}

impl Raw {
    fn of(library: Library, version: FmiVersion) -> Self {
        // SAFETY: an FMU's functions have the types of the standard that its description names.
        Self { calls: unsafe { Calls::new(library, version, None) }, owned: Mutex::new(Owned::new()) }
    }

    /// Loads a binary.
    ///
    /// # Errors
    /// The error message of the system.
    pub fn open(path: &Path, version: FmiVersion) -> Result<Self, String> {
        library::load(path).map(|library| Self::of(library, version)).map_err(|e| e.cause())
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

    /// The table, locked for one call: the calls of a `Raw` follow one another, even from several threads.
    pub(super) fn owned(&self) -> MutexGuard<'_, Owned> {
        // A refusal has no side effects, so the table is valid afterwards.
        self.owned.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Unloads the binary.
    ///
    /// # Errors
    /// The error message of the system.
    pub fn close(self) -> Result<(), String> {
        self.calls.into_library().close().map_err(|e| e.to_string())
    }

    /// The standard.
    pub fn version(&self) -> FmiVersion {
        self.calls.version
    }

    /// Name with the prefix of the standard: `fmi2` or `fmi3`.
    pub fn name(&self, name: &str) -> String {
        let prefix = if self.calls.version == FmiVersion::V2 { "fmi2" } else { "fmi3" };
        format!("{prefix}{name}")
    }

    /// Whether there is a function of this name, without prefix.
    pub fn has(&self, name: &str) -> bool {
        self.calls.has(&self.name(name))
    }

    /// A constant string of the FMU.
    pub fn text(&self, name: Text) -> Option<String> {
        // SAFETY: the standard's type; the text is a constant of the FMU.
        unsafe { optional(self.calls.function::<TextFunction>(&self.name(name.as_str()))?()) }
    }

    /// `FreeInstance`; `None` if it is missing.
    pub fn free(&self, instance: Handle) -> Option<()> {
        let mut owned = self.owned();
        let pointer = owned.forget_instance(instance);
        // SAFETY: an instance of this FMU, already removed from the table with its states, or NULL.
        unsafe { self.calls.free(pointer) }
    }

    /// Calls a function that takes only the instance. `fmi3EnterInitializationMode` takes more: see
    /// [`experiment`](Self::experiment).
    pub fn simple(&self, name: Simple, instance: Handle) -> Option<Status> {
        self.calls.simple(name, self.owned().pointer(instance)).status()
    }

    /// `fmi2SetupExperiment` or `fmi3EnterInitializationMode`.
    pub fn experiment(
        &self,
        instance: Handle,
        tolerance: Option<f64>,
        start: f64,
        stop: Option<f64>,
    ) -> Option<Status> {
        self.calls.experiment(self.owned().pointer(instance), tolerance, start, stop).status()
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
        self.transfer(&self.owned(), Way::Get, instance, base, references, n, values, n_values)
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
        // A getter may have left pointers of the FMU there.
        let null = |buffer: &&mut Buffer| buffer.words[..n.max(n_values)].iter().all(|word| *word == 0);
        assert!(base != BaseType::String || values.as_ref().is_none_or(null), "a pointer that is not ours");
        self.transfer(&self.owned(), Way::Set, instance, base, references, n, values, n_values)
    }

    #[expect(clippy::too_many_arguments, reason = "those of the C function")]
    fn transfer(
        &self,
        owned: &Owned,
        way: Way,
        instance: Handle,
        base: BaseType,
        references: Option<&[u32]>,
        n: usize,
        values: Option<&mut Buffer>,
        n_values: usize,
    ) -> Option<Status> {
        let kind = type_name(base, self.version());
        assert!(!matches!(base, BaseType::Binary | BaseType::Clock), "the function for {kind} takes other arguments");
        assert!(references.is_none_or(|r| n <= r.len()), "there are fewer references than n");
        let values = values.map_or(ptr::null_mut(), |buffer| {
            assert!(buffer.holds(kind), "the buffer is not of the type {kind}");
            assert!(n_values.max(n) <= buffer.capacity(), "there are fewer values than n_values");
            buffer.words.as_mut_ptr().cast()
        });
        let (i, kind, list) = (owned.pointer(instance), CType::named(kind, self.version())?, Array::of(references, n));
        // SAFETY: the values are NULL or a buffer of this type, large enough for both counts; `set` and `set_strings` pass
        // texts that are NULL or C strings.
        unsafe { self.calls.transfer(way, i, kind, list, values, n_values) }.status()
    }

    /// Texts; NULL pointers come back as `None`.
    pub fn get_strings(
        &self,
        instance: Handle,
        references: &[u32],
        count: usize,
    ) -> Option<(Status, Vec<Option<String>>)> {
        let mut buffer = Buffer::room(BaseType::String, self.version(), count);
        for word in &mut buffer.words[..count] {
            *word = 0;
        }
        // Locked until the texts are copied, because the next call may free them.
        let owned = self.owned();
        let (list, n) = (Some(references), references.len());
        let status = self.transfer(&owned, Way::Get, instance, BaseType::String, list, n, Some(&mut buffer), count)?;
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
        let mut buffer = Buffer::with_bits(BaseType::String, self.version(), &bits);
        let (list, n) = (Some(references), references.len());
        let values = Some(&mut buffer);
        let status = self.transfer(&self.owned(), Way::Set, instance, BaseType::String, list, n, values, texts.len());
        for copy in copies.iter_mut().flatten() {
            let end = copy.len().saturating_sub(1);
            copy[..end].fill(b'#');
        }
        status
    }

    /// Bytes of variables, `None` where the FMU gives NULL (FMI 3.0).
    pub fn get_binaries(&self, instance: Handle, references: &[u32]) -> Option<(Status, Vec<Option<Vec<u8>>>)> {
        // Locked until the bytes are copied, because the next call may free them.
        let owned = self.owned();
        self.calls.binaries(owned.pointer(instance), references)
    }

    /// Sets bytes (FMI 3.0). Those that were passed are overwritten afterwards.
    ///
    /// # Panics
    /// There is not one value for each reference.
    pub fn set_binaries(&self, instance: Handle, references: &[u32], values: &[&[u8]]) -> Option<Status> {
        assert_eq!(references.len(), values.len(), "a value for each reference");
        let mut copies: Vec<Vec<u8>> = values.iter().map(|value| value.to_vec()).collect();
        let status = self.calls.put_binaries(self.owned().pointer(instance), references, &copies).status();
        for copy in &mut copies {
            copy.fill(b'#');
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
    ) -> Option<(Status, StepResults)> {
        let before = StepResults { event: UNTOUCHED, terminate: UNTOUCHED, early: UNTOUCHED, last: UNTOUCHED_NUMBER };
        self.calls.do_step(self.owned().pointer(instance), (t, h), no_prior, pointers, before).result()
    }

    /// `SetDebugLogging`; `categories` and its elements may be NULL.
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
        self.calls.debug_logging(self.owned().pointer(instance), on, categories, n).status()
    }

    /// `fmi2Get...Status` with a buffer for any of its results; returns its first eight bytes.
    pub fn step_status(&self, name: StepStatus, instance: Handle, kind: c_int) -> Option<(Status, u64)> {
        self.calls.step_status(name, self.owned().pointer(instance), kind, UNTOUCHED_NUMBER.to_bits()).result()
    }
}
