//! The C interface: the only place with `unsafe`. It only turns pointers into Rust values.
//!
//! Every call passes `gate.rs`, which also calls the importer back ([`callbacks`]); `record.rs` writes the calls of instances with a
//! call log, from pointers to values by [`recorded`]; `calls.rs` contains the calls that both
//! standards share; [`fmi2`] and [`fmi3`] are the tables of their functions, from which [`export!`](crate::export) generates C
//! functions.

pub mod callbacks;
mod calls;
mod fault;
pub mod fmi2;
pub mod fmi3;
mod gate;
mod logger;
mod pointer;
pub mod record;
pub mod recorded;
mod structs;
pub mod types;

use crate::blob;
use crate::instance::{Instance, Refusal};
use crate::preset::Made;
use crate::snapshot::Snapshot;
use fmu_core::description::Dependencies;
use fmu_core::{Capabilities, Description, Exported, Fault, Interface, Model, preset};
use std::ffi::{CStr, c_int, c_void};
use std::ops::{Deref, DerefMut};
use std::panic::{catch_unwind, set_hook};
use std::path::Path;
use std::sync::Once;
use types::InstancePointer;

/// The answer to a call: done, or why not.
pub type Answer = Result<(), Refusal>;

/// An instance behind the gate, with the functions of the C interface; calls without pointers are those of the instance.
pub struct Abi<'a, E: Exported>(&'a mut Instance<E>);

impl<E: Exported> Deref for Abi<'_, E> {
    type Target = Instance<E>;

    fn deref(&self) -> &Instance<E> {
        self.0
    }
}

impl<E: Exported> DerefMut for Abi<'_, E> {
    fn deref_mut(&mut self) -> &mut Instance<E> {
        self.0
    }
}

impl<E: Exported> Abi<'_, E> {
    /// Passes a call through the gate.
    ///
    /// # Safety
    /// The instance is NULL, or was created by this binary and not freed, and is used by one thread at a time.
    #[inline]
    pub unsafe fn enter<F: types::Function>(
        instance: InstancePointer,
        body: impl FnOnce(Abi<'_, E>) -> Answer,
        unusual: impl FnOnce() -> c_int,
    ) -> c_int {
        // SAFETY: the caller's promise.
        unsafe { gate::enter::<E, F>(instance, body, unusual) }
    }

    /// Frees an instance in the function `name`.
    ///
    /// # Safety
    /// The instance is NULL, or one that this binary made and has not freed; it is not in use now and not used again.
    pub unsafe fn free_instance(instance: InstancePointer, name: &'static str) {
        // SAFETY: the caller's promise.
        unsafe { gate::close::<E>(instance, name) }
    }

    /// Passes the model's description to `sink` as JSON and returns 0, or a message and 1. `resources` is the folder of the
    /// model's resources, or NULL; with `dependencies` = 0, no variable has dependencies.
    ///
    /// # Safety
    /// `resources` is NULL or a C string.
    pub unsafe fn describe(
        sink: extern "C" fn(context: *mut c_void, bytes: *const u8, len: usize),
        context: *mut c_void,
        resources: types::Text,
        dependencies: c_int,
    ) -> c_int {
        let dependencies = if dependencies == 0 { Dependencies::Omitted } else { Dependencies::Probed };
        // SAFETY: the caller's promise.
        let resources = crate::resources::folder(unsafe { pointer::text(resources) });
        let json = catch_unwind(|| {
            let mut made = Made::<E::Model>::described(&E::CAN, resources.as_deref())?;
            if changes_on_loading(&E::CAN, &made, resources.as_deref())? {
                return Err(Fault::new("load changes what a state saves: store what it reads in a Resource"));
            }
            made.block.model.load(resources.as_deref())?;
            let mut description = Description::instantiated::<E>(made.block, dependencies)?;
            description.token.push_str(&made.suffix);
            description.json()
        });
        let json = json.unwrap_or_else(|payload| Err(fault::panicked(payload.as_ref())));
        let (text, status) = match json {
            Ok(text) => (text, 0),
            Err(fault) => (fault.to_string(), 1),
        };
        sink(context, text.as_ptr(), text.len());
        status
    }
}

/// Whether `load` changes more than resources: a reset would undo the change, and a saved state would contain it.
fn changes_on_loading<M: Model>(
    can: &Capabilities<M>,
    made: &Made<M>,
    resources: Option<&Path>,
) -> Result<bool, Fault> {
    let (Some(saving), Some(storing)) = (&can.saved, &can.stored) else { return Ok(false) };
    let fresh = || Snapshot::of(Interface::CoSimulation, saving.block(&made.block));
    let mut loaded = fresh();
    loaded.block.model.load(resources)?;
    let before = blob::write(&fresh(), storing)?;
    // A model whose bytes vary from run to run, for example because of a hash map, cannot be compared.
    Ok(before == blob::write(&fresh(), storing)? && before != blob::write(&loaded, storing)?)
}

/// A panic becomes a log message, so the hook that would print it is silenced; where a panic ends the program, the hook keeps
/// its text. The hook belongs to the binary: a cdylib has its own standard library.
pub fn quiet() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| set_hook(Box::new(fault::keep)));
}

/// The text of the panic that ended the last call, or NULL: for a host in which panics do not unwind and calls end without a
/// result.
pub fn fault() -> types::Text {
    fault::text()
}

/// The importer's arguments for a new instance.
pub(crate) struct Wanted {
    /// Its name.
    name: String,
    /// The suffix of the model's token; empty without a preset.
    suffix: String,
}

/// Name and preset, if name and token are right.
fn credentials<E: Exported>(name: Option<&CStr>, token: Option<&CStr>) -> Result<Wanted, Fault> {
    let name = name.map(CStr::to_string_lossy).filter(|name| !name.trim().is_empty());
    let Some(name) = name else { return Err(Fault::new("the instance name is missing: NULL, empty or blank")) };
    let (expected, token) = (E::TOKEN, token.map(CStr::to_string_lossy));
    match token.as_deref().and_then(|token| preset::suffix_of(token, expected.as_str())) {
        Some(suffix) => Ok(Wanted { name: name.into_owned(), suffix: suffix.into() }),
        None => Err(Fault::new(format!(
            "the instantiation token (GUID) is {}, and {} is expected: description and binary are of different builds",
            token.as_deref().unwrap_or("NULL"),
            expected.as_str()
        ))),
    }
}

/// Messages for missing capabilities.
#[doc(hidden)]
pub fn lacks(capability: &str) -> &'static str {
    match capability {
        "resizable" => "there are no structural parameters",
        _ => "clocks",
    }
}

/// C functions from a table of them. One line of the table reads: name in C, arguments after the instance, row of the lifecycle
/// table (and the capability without which the call is unsupported), function of [`Abi`] or of the instance with its arguments.
#[doc(hidden)]
#[macro_export]
macro_rules! functions {
    ($standard:ident $exported:ty; $(
        $name:ident($($argument:ident: $type:ty),*) => $call:ident $(if $capability:ident)?: $function:ident($($passed:expr),*);
    )*) => { $(
        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn $name(instance: InstancePointer $(, $argument: $type)*) -> c_int {
            struct Here;
            impl Function for Here {
                const ENTRY: Entry = Entry::new(
                    Standard::$standard,
                    Call::$call$(.of(<$exported as Exported>::CAN.$capability.is_some()))?,
                    stringify!($name),
                );
            }
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::Abi::<$exported>::enter::<Here>(
                    instance,
                    |mut abi| {
                        $(if const { <$exported as Exported>::CAN.$capability.is_none() } {
                            return abi.unsupported($crate::abi::lacks(stringify!($capability)));
                        })?
                        abi.$function($($passed),*)?;
                        Ok(())
                    },
                    $crate::unusual!($exported, $name(instance $(, $argument: $type)*)),
                )
            }
        }
    )* };
}

/// Turns the crate into the binary of an FMU: it exports all C functions of FMI 2.0 and FMI 3.0 for one model, and
/// `fmu_description`, which passes its description to `fmu build`.
///
/// The model is followed by its [capabilities](fmu_core::capability), all of which it must implement; without any, the FMU is
/// for co-simulation.
///
/// ```ignore
/// fmu_export::export!(drive::PmsmPlant: ContinuousTime + Events + Differentiable);
/// ```
///
/// A capability whose trait the model lacks does not compile:
///
/// ```compile_fail,E0277
/// # use fmu_core::*;
/// #[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
/// struct Still;
/// # type Whole = Block<Still>;
/// impl Model for Still {
///     # type Outputs = ();
///     # const INFO: Info = Info { name: "Still", ..Info::DEFAULT };
///     # const TABLE: &'static Table<Whole> = table![];
///     # fn initialize(&mut self) {}
///     # fn output(&self, _: Elapsed, (): &mut ()) {}
///     # fn advance(&mut self, _: &Step) -> Result<(), Fault> { Ok(()) }
///     // ...
/// }
/// fmu_export::export!(Still: ContinuousTime); // the trait `ContinuousTime` is not implemented for `Still`
/// # fn main() {}
/// ```
///
/// and without it, it compiles:
///
/// ```
/// # use fmu_core::*;
/// # #[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
/// # struct Still;
/// # type Whole = Block<Still>;
/// # impl Model for Still {
/// #     type Outputs = ();
/// #     const INFO: Info = Info { name: "Still", ..Info::DEFAULT };
/// #     const TABLE: &'static Table<Whole> = table![];
/// #     fn initialize(&mut self) {}
/// #     fn output(&self, _: Elapsed, (): &mut ()) {}
/// #     fn advance(&mut self, _: &Step) -> Result<(), Fault> { Ok(()) }
/// # }
/// fmu_export::export!(Still);
/// # fn main() {}
/// ```
#[macro_export]
macro_rules! export {
    ($model:ty: Unsaved $(+ $more:ident)*) => { $crate::export!(@ $model, unsaved $($more)*); };
    ($model:ty: Unstored $(+ $more:ident)*) => { $crate::export!(@ $model, unstored $($more)*); };
    ($model:ty $(: $first:ident $(+ $more:ident)*)?) => { $crate::export!(@ $model, stored $($first $($more)*)?); };
    (@ $model:ty, $keeps:ident $($more:ident)*) => {
        #[allow(non_snake_case, unused_imports, clippy::wildcard_imports, clippy::too_many_arguments)]
        mod fmi {
            use super::*;
            use $crate::abi::types::*;

            pub(crate) struct This;

            impl $crate::Exported for This {
                type Model = $model;
                const CAN: $crate::Capabilities<$model> =
                    $crate::Capabilities::<$model>::$keeps()$(.$more())*;
            }

            const _: () = $crate::check::<This>();

            #[cfg(not(target_family = "wasm"))]
            $crate::export_fmi2!(This);
            $crate::export_fmi3!(This);

            #[cfg(panic = "abort")]
            #[unsafe(no_mangle)]
            pub(crate) extern "C" fn fmu_fault() -> Text {
                $crate::abi::fault()
            }

            // A page has the description of the native library.
            #[cfg(not(target_family = "wasm"))]
            #[unsafe(no_mangle)]
            pub(crate) unsafe extern "C" fn fmu_description(
                sink: extern "C" fn(context: *mut c_void, bytes: *const u8, len: usize),
                context: *mut c_void,
                resources: Text,
                dependencies: c_int,
            ) -> c_int {
                $crate::abi::quiet();
                // SAFETY: what `fmu build` passes.
                unsafe { $crate::abi::Abi::<This>::describe(sink, context, resources, dependencies) }
            }
        }
    };
}
