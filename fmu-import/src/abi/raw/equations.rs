//! Calls of Model Exchange, event mode and derivatives with any arguments.

use super::super::log::Status;
use super::super::signatures::{GetVector, SetTime, v2, v3};
use super::{Count, Handle, Raw, Sensitivity, Vector};
use model_description::FmiVersion;
use std::ffi::c_int;
use std::ptr;

/// The results of an update of the discrete states; the flags as the FMU wrote them, 0xc5 where it did not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Updated {
    /// `newDiscreteStatesNeeded`, `discreteStatesNeedUpdate`.
    pub again: i32,
    /// `terminateSimulation`.
    pub terminate: i32,
    /// `nominalsOfContinuousStatesChanged`.
    pub nominals_changed: i32,
    /// `valuesOfContinuousStatesChanged`.
    pub states_changed: i32,
    /// `nextEventTimeDefined`.
    pub next_event_time_defined: i32,
    /// `nextEventTime`, NaN where the FMU did not write it.
    pub next_event_time: f64,
}

/// What a byte or an integer holds before the call.
const UNTOUCHED: u8 = 0xc5;

/// Pointer and length of an array that may be NULL; the count may be less than its length.
fn array<T>(values: Option<&[T]>, n: usize) -> *const T {
    assert!(values.is_none_or(|v| n <= v.len()), "the array has fewer than n elements");
    values.map_or(ptr::null(), <[T]>::as_ptr)
}

fn array_mut<T>(values: Option<&mut [T]>, n: usize) -> *mut T {
    assert!(values.as_ref().is_none_or(|v| n <= v.len()), "the array has fewer than n elements");
    values.map_or(ptr::null_mut(), <[T]>::as_mut_ptr)
}

/// Arguments of a directional or adjoint derivative. An array may be NULL; its count may be less than its length.
#[derive(Clone, Copy, Debug, Default)]
pub struct SensitivityArguments<'a> {
    /// Value references of the unknowns and their number.
    pub unknowns: (Option<&'a [u32]>, usize),
    /// Value references of the knowns and their number.
    pub knowns: (Option<&'a [u32]>, usize),
    /// The seed and its length, which FMI 2.0 takes from the knowns.
    pub seed: (Option<&'a [f64]>, usize),
}

impl Raw {
    /// `fmi2NewDiscreteStates` or `fmi3UpdateDiscreteStates`; with `null`, all results get NULL.
    pub fn update_discrete_states(&self, instance: Handle, null: bool) -> Option<(Status, Updated)> {
        match self.version {
            FmiVersion::V2 => {
                let f: v2::NewDiscreteStates = self.function("NewDiscreteStates")?;
                let untouched = c_int::from(UNTOUCHED);
                let mut info = v2::EventInfo {
                    new_discrete_states_needed: untouched,
                    terminate_simulation: untouched,
                    nominals_changed: untouched,
                    states_changed: untouched,
                    next_event_time_defined: untouched,
                    next_event_time: f64::NAN,
                };
                let place = if null { ptr::null_mut() } else { &raw mut info };
                // SAFETY: FMI 2.0's type; the struct is ours or NULL.
                let status = unsafe { f(self.owned().pointer(instance), place) };
                let updated = Updated {
                    again: info.new_discrete_states_needed,
                    terminate: info.terminate_simulation,
                    nominals_changed: info.nominals_changed,
                    states_changed: info.states_changed,
                    next_event_time_defined: info.next_event_time_defined,
                    next_event_time: info.next_event_time,
                };
                Some((status, updated))
            }
            FmiVersion::V3 => {
                let f: v3::UpdateDiscreteStates = self.function("UpdateDiscreteStates")?;
                let (mut flags, mut next) = ([UNTOUCHED; 5], f64::NAN);
                let [a, b, c, d, e] =
                    flags.each_mut().map(|flag| if null { ptr::null_mut() } else { ptr::from_mut(flag) });
                let time = if null { ptr::null_mut() } else { &raw mut next };
                // SAFETY: FMI 3.0's type; the places are ours or NULL.
                let status = unsafe { f(self.owned().pointer(instance), a, b, c, d, e, time) };
                let [again, terminate, nominals_changed, states_changed, next_event_time_defined] =
                    flags.map(i32::from);
                let next_event_time = next;
                let updated = Updated {
                    again,
                    terminate,
                    nominals_changed,
                    states_changed,
                    next_event_time_defined,
                    next_event_time,
                };
                Some((status, updated))
            }
        }
    }

    /// `SetTime`.
    pub fn set_time(&self, instance: Handle, t: f64) -> Option<Status> {
        let f: SetTime = self.function("SetTime")?;
        // SAFETY: the type of both standards.
        Some(unsafe { f(self.owned().pointer(instance), t) })
    }

    /// States, derivatives, event indicators or nominals: an array, which may be NULL, and its length.
    ///
    /// # Panics
    /// The array has fewer than `n` elements.
    pub fn vector(&self, name: Vector, instance: Handle, values: Option<&mut [f64]>, n: usize) -> Option<Status> {
        let f: GetVector = self.function(name.as_str())?;
        // SAFETY: all functions that `Vector` names have this type, up to the mutability of the array, which is ours, at
        // least n elements long, or NULL.
        Some(unsafe { f(self.owned().pointer(instance), array_mut(values, n), n) })
    }

    /// `CompletedIntegratorStep`: `enterEventMode` and `terminateSimulation` as the FMU wrote them; with `null`, both get NULL.
    pub fn completed_integrator_step(
        &self,
        instance: Handle,
        no_prior: bool,
        null: bool,
    ) -> Option<(Status, [i32; 2])> {
        match self.version {
            FmiVersion::V2 => {
                let f: v2::CompletedIntegratorStep = self.function("CompletedIntegratorStep")?;
                let mut flags = [c_int::from(UNTOUCHED); 2];
                let [a, b] = flags.each_mut().map(|flag| if null { ptr::null_mut() } else { ptr::from_mut(flag) });
                // SAFETY: the standard's type; the places are ours or NULL.
                let status = unsafe { f(self.owned().pointer(instance), c_int::from(no_prior), a, b) };
                Some((status, flags))
            }
            FmiVersion::V3 => {
                let f: v3::CompletedIntegratorStep = self.function("CompletedIntegratorStep")?;
                let mut flags = [UNTOUCHED; 2];
                let [a, b] = flags.each_mut().map(|flag| if null { ptr::null_mut() } else { ptr::from_mut(flag) });
                // SAFETY: the standard's type; the places are ours or NULL.
                let status = unsafe { f(self.owned().pointer(instance), no_prior, a, b) };
                Some((status, flags.map(i32::from)))
            }
        }
    }

    /// Number of states or event indicators (FMI 3.0 only); with `null`, the result gets NULL.
    pub fn count(&self, name: Count, instance: Handle, null: bool) -> Option<(Status, usize)> {
        let f: v3::Count = self.function(name.as_str())?;
        let mut count = usize::MAX;
        // SAFETY: FMI 3.0's type; the place is ours or NULL.
        let status = unsafe { f(self.owned().pointer(instance), if null { ptr::null_mut() } else { &raw mut count }) };
        Some((status, count))
    }

    /// Directional or adjoint derivatives.
    ///
    /// # Panics
    /// An array is shorter than its count.
    pub fn sensitivity(
        &self,
        name: Sensitivity,
        instance: Handle,
        arguments: SensitivityArguments<'_>,
        sensitivity: Option<&mut [f64]>,
        n_sensitivity: usize,
    ) -> Option<Status> {
        let SensitivityArguments { unknowns: (unknowns, n_unknowns), knowns: (knowns, n_knowns), seed: (seed, n_seed) } =
            arguments;
        let owned = self.owned();
        let (i, u, k) = (owned.pointer(instance), array(unknowns, n_unknowns), array(knowns, n_knowns));
        // SAFETY: of both: the standard's type; arrays are NULL or have the lengths that are passed. In FMI 2.0 the lists tell
        // the lengths of seed and sensitivity.
        Some(unsafe {
            match self.version {
                FmiVersion::V2 => {
                    let (s, to) = (array(seed, n_knowns), array_mut(sensitivity, n_unknowns));
                    self.function::<v2::Sensitivity>(name.as_str())?(i, u, n_unknowns, k, n_knowns, s, to)
                }
                FmiVersion::V3 => {
                    let (s, to) = (array(seed, n_seed), array_mut(sensitivity, n_sensitivity));
                    let f: v3::Sensitivity = self.function(name.as_str())?;
                    f(i, u, n_unknowns, k, n_knowns, s, n_seed, to, n_sensitivity)
                }
            }
        })
    }

    /// `fmi2SetRealInputDerivatives`.
    ///
    /// # Panics
    /// An array has fewer than `n` elements.
    pub fn input_derivatives(
        &self,
        instance: Handle,
        references: Option<&[u32]>,
        n: usize,
        orders: Option<&[c_int]>,
        values: Option<&[f64]>,
    ) -> Option<Status> {
        let f: v2::InputDerivatives = self.function("SetRealInputDerivatives")?;
        // SAFETY: FMI 2.0's type; the arrays are NULL or have n elements.
        Some(unsafe { f(self.owned().pointer(instance), array(references, n), n, array(orders, n), array(values, n)) })
    }
}
