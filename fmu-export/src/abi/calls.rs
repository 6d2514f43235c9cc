//! The calls that both standards have: from pointers to the instance's functions.

use super::Abi;
use super::gate::{Function, enter};
use super::pointer::{array, numbers, place, room, text};
use super::types::{FmuState, InstancePointer, References};
use crate::value::Value;
use crate::{blob, registry};
use fmu_core::{Exported, Fault};
use std::ffi::{c_char, c_int};

/// # Safety
/// For every function here, the importer follows the standard: the instance is NULL, or one that this binary created and
/// has not freed, used by one thread at a time; a pointer to an array is NULL or points to as many elements as the call
/// states.
#[allow(missing_docs, clippy::missing_safety_doc, reason = "named as in the standards; the section above covers all")]
impl<E: Exported> Abi<E> {
    pub unsafe fn get<T: Value>(
        entry: impl Function,
        instance: InstancePointer,
        references: References,
        n: usize,
        values: *mut T,
        room_for: usize,
    ) -> c_int {
        // SAFETY: the importer's arrays, of these lengths.
        unsafe {
            enter::<E, _>(entry, instance, move |instance| {
                let out = room(values, room_for, "values")?;
                instance.get(array(references, n, "value references")?, out)
            })
        }
    }

    pub unsafe fn set<T: Value>(
        entry: impl Function,
        instance: InstancePointer,
        references: References,
        n: usize,
        values: *const T,
        n_values: usize,
    ) -> c_int {
        // SAFETY: the importer's arrays, of these lengths.
        unsafe {
            enter::<E, _>(entry, instance, move |instance| {
                let values = array(values, n_values, "values")?;
                instance.set(array(references, n, "value references")?, values)
            })
        }
    }

    /// The texts stay where they are until the next getter of texts (FMI 2.0.5, 2.1.7; FMI 3.0.2, 2.2.7.2).
    pub unsafe fn get_texts(
        entry: impl Function,
        instance: InstancePointer,
        references: References,
        n: usize,
        values: *mut *const c_char,
        room_for: usize,
    ) -> c_int {
        // SAFETY: the importer's arrays, of these lengths.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                let out = room(values, room_for, "values")?;
                let texts = instance.get_texts(array(references, n, "value references")?, out.len())?;
                for (place, text) in out.iter_mut().zip(texts) {
                    place.write(text.as_ptr());
                }
                Ok(())
            })
        }
    }

    pub unsafe fn set_texts(
        entry: impl Function,
        instance: InstancePointer,
        references: References,
        n: usize,
        values: *const *const c_char,
        n_values: usize,
    ) -> c_int {
        // SAFETY: the importer's arrays, of these lengths, the second one of C strings if the variables are texts.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                let values = array(values, n_values, "values")?;
                let references = array(references, n, "value references")?;
                Ok(instance.set_texts(references, values.len(), |i| text(values[i]))?)
            })
        }
    }

    /// A getter or setter of a type that no variable has: succeeds only for zero variables.
    pub unsafe fn none(
        entry: impl Function,
        instance: InstancePointer,
        references: References,
        n: usize,
        n_values: usize,
        carries: &str,
    ) -> c_int {
        // SAFETY: the importer's array, of this length.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                instance.refuse(array(references, n, "value references")?, carries)?;
                if n_values == 0 { Ok(()) } else { Err(Fault::value("nValues", n_values, "0 for no reference").into()) }
            })
        }
    }

    pub unsafe fn set_debug_logging(
        entry: impl Function,
        instance: InstancePointer,
        on: bool,
        n: usize,
        categories: *const *const c_char,
    ) -> c_int {
        // SAFETY: the importer's array of C strings.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                let mut names = Vec::new();
                for &category in array(categories, n, "categories")? {
                    let category = text(category).ok_or_else(|| Fault::new("a log category is NULL"))?;
                    names.push(category.to_str().map_err(|_| Fault::new("a log category is not UTF-8"))?);
                }
                Ok(instance.log.switch(instance.standard, on, &names)?)
            })
        }
    }

    pub unsafe fn exit_initialization(entry: impl Function, instance: InstancePointer) -> c_int {
        // SAFETY: the importer's instance.
        unsafe { enter::<E, _>(entry, instance, |instance| Ok(instance.exit_initialization()?)) }
    }

    pub unsafe fn terminate(entry: impl Function, instance: InstancePointer) -> c_int {
        // SAFETY: the importer's instance.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                instance.terminate();
                Ok(())
            })
        }
    }

    pub unsafe fn reset(entry: impl Function, instance: InstancePointer) -> c_int {
        // SAFETY: the importer's instance.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                instance.reset();
                Ok(())
            })
        }
    }

    /// `state` points to NULL, or to a state to be overwritten (FMI 2.0.5, 2.1.8; FMI 3.0.2, 2.2.7.4).
    pub unsafe fn save_state(entry: impl Function, instance: InstancePointer, state: *mut FmuState) -> c_int {
        // SAFETY: the importer's variable, which it has initialized as the standard says.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                let state = place(state, "FMUState")?.assume_init_mut();
                *state = handle(instance.save(state.addr())?);
                Ok(())
            })
        }
    }

    pub unsafe fn restore_state(entry: impl Function, instance: InstancePointer, state: FmuState) -> c_int {
        // SAFETY: the importer's instance; the state is only a number.
        unsafe { enter::<E, _>(entry, instance, |instance| Ok(instance.restore(state.addr())?)) }
    }

    /// Ignores NULL and a variable that holds NULL.
    pub unsafe fn free_state(entry: impl Function, instance: InstancePointer, state: *mut FmuState) -> c_int {
        // SAFETY: the importer's variable, which it has initialized as the standard says.
        unsafe {
            enter::<E, _>(entry, instance, |_| {
                if state.is_null() {
                    return Ok(());
                }
                let state = place(state, "FMUState")?.assume_init_mut();
                registry::free::<E::Model>(state.addr())?;
                *state = handle(0);
                Ok(())
            })
        }
    }

    pub unsafe fn serialized_size(
        entry: impl Function,
        instance: InstancePointer,
        state: FmuState,
        size: *mut usize,
    ) -> c_int {
        // SAFETY: the importer's variable; the state is only a number.
        unsafe {
            enter::<E, _>(entry, instance, |_| {
                let size = place(size, "size")?;
                size.write(registry::with::<E::Model, _>(state.addr(), |state| blob::size(state))?);
                Ok(())
            })
        }
    }

    pub unsafe fn serialize(
        entry: impl Function,
        instance: InstancePointer,
        state: FmuState,
        bytes: *mut u8,
        size: usize,
    ) -> c_int {
        // SAFETY: the importer's array of this size; the state is only a number.
        unsafe {
            enter::<E, _>(entry, instance, |_| {
                let out = room(bytes, size, "serializedState")?;
                let bytes = registry::with::<E::Model, _>(state.addr(), |state| blob::write(state))?;
                if bytes.len() != size {
                    return Err(Fault::value("size", size, format_args!("{} for this state", bytes.len())).into());
                }
                for (place, byte) in out.iter_mut().zip(bytes) {
                    place.write(byte);
                }
                Ok(())
            })
        }
    }

    /// Always creates a new state and ignores the previous value of the variable.
    pub unsafe fn deserialize(
        entry: impl Function,
        instance: InstancePointer,
        bytes: *const u8,
        size: usize,
        state: *mut FmuState,
    ) -> c_int {
        // SAFETY: the importer's array of this size, and its variable.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                let state = place(state, "FMUState")?;
                state.write(handle(instance.deserialize(array(bytes, size, "serializedState")?)?));
                Ok(())
            })
        }
    }

    pub unsafe fn enter_event(entry: impl Function, instance: InstancePointer) -> c_int {
        // SAFETY: the importer's instance.
        unsafe { enter::<E, _>(entry, instance, |instance| Ok(instance.enter_event()?)) }
    }

    pub unsafe fn enter_continuous(entry: impl Function, instance: InstancePointer) -> c_int {
        // SAFETY: the importer's instance.
        unsafe { enter::<E, _>(entry, instance, |instance| Ok(instance.leave_event()?)) }
    }

    pub unsafe fn set_time(entry: impl Function, instance: InstancePointer, time: f64) -> c_int {
        // SAFETY: the importer's instance.
        unsafe { enter::<E, _>(entry, instance, |instance| Ok(instance.set_time(time)?)) }
    }

    pub unsafe fn set_states(entry: impl Function, instance: InstancePointer, x: *const f64, n: usize) -> c_int {
        // SAFETY: the importer's array, of this length.
        unsafe { enter::<E, _>(entry, instance, |instance| instance.set_states(array(x, n, "continuous states")?)) }
    }

    pub unsafe fn get_states(entry: impl Function, instance: InstancePointer, x: *mut f64, n: usize) -> c_int {
        // SAFETY: the importer's array, of this length.
        unsafe {
            enter::<E, _>(entry, instance, |instance| Ok(instance.get_states(numbers(x, n, "continuous states")?)?))
        }
    }

    pub unsafe fn derivatives(entry: impl Function, instance: InstancePointer, dx: *mut f64, n: usize) -> c_int {
        // SAFETY: the importer's array, of this length.
        unsafe { enter::<E, _>(entry, instance, |instance| instance.derivatives(numbers(dx, n, "derivatives")?)) }
    }

    pub unsafe fn indicators(entry: impl Function, instance: InstancePointer, z: *mut f64, n: usize) -> c_int {
        // SAFETY: the importer's array, of this length.
        unsafe { enter::<E, _>(entry, instance, |instance| instance.indicators(numbers(z, n, "event indicators")?)) }
    }

    pub unsafe fn nominals(entry: impl Function, instance: InstancePointer, x: *mut f64, n: usize) -> c_int {
        // SAFETY: the importer's array, of this length.
        unsafe { enter::<E, _>(entry, instance, |instance| Ok(instance.nominals(numbers(x, n, "nominals")?)?)) }
    }

    /// No step of the integrator is an event, and none ends the simulation: both flags are 0.
    pub unsafe fn completed_step<B>(
        entry: impl Function,
        instance: InstancePointer,
        event: *mut B,
        end: *mut B,
    ) -> c_int
    where
        B: From<bool>,
    {
        // SAFETY: the importer's variables.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                let end = place(end, "terminateSimulation")?;
                place(event, "enterEventMode")?.write(false.into());
                end.write(false.into());
                Ok(instance.completed_step()?)
            })
        }
    }

    pub unsafe fn directional(
        entry: impl Function,
        instance: InstancePointer,
        (unknowns, n_unknowns): (References, usize),
        (knowns, n_knowns): (References, usize),
        (seed, n_seed): (*const f64, usize),
        (sensitivity, n_sensitivity): (*mut f64, usize),
        adjoint: bool,
    ) -> c_int {
        // SAFETY: the importer's arrays, of these lengths.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                let (unknowns, knowns) = (array(unknowns, n_unknowns, "unknowns")?, array(knowns, n_knowns, "knowns")?);
                let (seed, out) = (array(seed, n_seed, "seed")?, numbers(sensitivity, n_sensitivity, "sensitivity")?);
                if adjoint {
                    instance.adjoint(unknowns, knowns, seed, out)
                } else {
                    instance.directional(unknowns, knowns, seed, out)
                }
            })
        }
    }

    pub unsafe fn output_derivatives(
        entry: impl Function,
        instance: InstancePointer,
        references: References,
        n: usize,
        orders: *const i32,
        values: *mut f64,
        n_values: usize,
    ) -> c_int {
        // SAFETY: the importer's arrays, of these lengths.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                let (references, orders) = (array(references, n, "value references")?, array(orders, n, "orders")?);
                instance.output_derivatives(references, orders, numbers(values, n_values, "values")?)
            })
        }
    }

    pub unsafe fn input_derivatives(
        entry: impl Function,
        instance: InstancePointer,
        references: References,
        n: usize,
        orders: *const i32,
        values: *const f64,
    ) -> c_int {
        // SAFETY: the importer's arrays, of this length.
        unsafe {
            enter::<E, _>(entry, instance, |instance| {
                let (references, orders) = (array(references, n, "value references")?, array(orders, n, "orders")?);
                Ok(instance.input_derivatives(references, orders, array(values, n, "values")?)?)
            })
        }
    }

    /// A function of a capability that this FMU does not have.
    pub unsafe fn unsupported(entry: impl Function, instance: InstancePointer, why: &str) -> c_int {
        // SAFETY: the importer's instance.
        unsafe { enter::<E, _>(entry, instance, |_| Err(Fault::new(format!("not supported: {why}")).into())) }
    }
}

/// A handle in C: a number stored in a pointer.
fn handle(number: usize) -> FmuState {
    std::ptr::without_provenance_mut(number)
}
