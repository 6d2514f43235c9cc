//! The calls that both standards have: from pointers to the instance's functions. Calls without pointers go directly to the
//! [`Instance`](crate::instance::Instance).

use super::pointer::{array, numbers, place, room, text};
use super::types::{FmuState, References};
use super::{Abi, Answer};
use crate::instance::Instance;
use crate::lifecycle::State;
use crate::value::CValue;
use crate::{blob, registry};
use fmu_core::{Exported, Fault, Model};
use std::ffi::c_char;

/// # Errors
/// A pointer that is NULL or not aligned, a count that does not fit, or a refusal by the instance.
///
/// # Safety
/// For every function here, the importer follows the standard: a pointer to an array is NULL or points to as many elements
/// as the call states, a pointer to a variable is NULL or points to one.
#[allow(missing_docs, reason = "named as in the standards")]
#[allow(clippy::missing_safety_doc, clippy::missing_errors_doc, reason = "the sections above cover all")]
impl<E: Exported> Abi<'_, E> {
    pub unsafe fn get<T: CValue>(&mut self, vr: References, n: usize, values: *mut T, room_for: usize) -> Answer {
        // SAFETY: the importer's arrays, of these lengths.
        let (out, vr) = unsafe { (room(values, room_for, "values")?, array(vr, n, "value references")?) };
        if const { E::CAN.intermediate.is_some() } && self.0.current.life.state() == State::Intermediate {
            return self.0.get_inside(vr, out);
        }
        if const { E::CAN.clocked.is_some() } {
            self.0.check_clocked(vr, false)?;
        }
        self.0.get(vr, out)
    }

    pub unsafe fn set<T: CValue>(&mut self, vr: References, n: usize, values: *const T, n_values: usize) -> Answer {
        // SAFETY: the importer's arrays, of these lengths.
        let (values, vr) = unsafe { (array(values, n_values, "values")?, array(vr, n, "value references")?) };
        self.inside(vr, true)?;
        self.0.set(vr, values)
    }

    /// Checks the variables that the importer uses inside a step, or that are on clocks.
    #[inline]
    fn inside(&mut self, vr: &[u32], sets: bool) -> Answer {
        if const { E::CAN.clocked.is_some() } {
            self.0.check_clocked(vr, sets)?;
        }
        if const { E::CAN.intermediate.is_some() } && self.0.current.life.state() == State::Intermediate {
            self.0.check_inside(vr, sets)?;
        }
        Ok(())
    }

    /// The texts remain valid until the next getter of texts (FMI 2.0.5, 2.1.7; FMI 3.0.2, 2.2.7.2).
    pub unsafe fn get_texts(
        &mut self,
        vr: References,
        n: usize,
        values: *mut *const c_char,
        room_for: usize,
    ) -> Answer {
        // SAFETY: the importer's arrays, of these lengths.
        let (out, vr) = unsafe { (room(values, room_for, "values")?, array(vr, n, "value references")?) };
        self.inside(vr, false)?;
        let texts = self.0.get_texts(vr, out.len())?;
        for (place, text) in out.iter_mut().zip(texts) {
            place.write(text.as_ptr());
        }
        Ok(())
    }

    pub unsafe fn set_texts(
        &mut self,
        vr: References,
        n: usize,
        values: *const *const c_char,
        n_values: usize,
    ) -> Answer {
        // SAFETY: the importer's arrays, of these lengths.
        let (values, vr) = unsafe { (array(values, n_values, "values")?, array(vr, n, "value references")?) };
        self.inside(vr, true)?;
        // SAFETY: C strings, if the variables are texts; others are refused before one is read.
        self.0.set_texts(vr, values.len(), |i| unsafe { text(values[i]) })
    }

    /// The bytes remain valid until the next call that sets or computes them (FMI 3.0.2, 2.2.7.2); their pointer is never NULL.
    pub unsafe fn get_bytes(
        &mut self,
        vr: References,
        n: usize,
        sizes: *mut usize,
        values: *mut *const u8,
        room_for: usize,
    ) -> Answer {
        // SAFETY: the importer's arrays, of these lengths.
        let (out, vr) = unsafe { (room(values, room_for, "values")?, array(vr, n, "value references")?) };
        // SAFETY: the importer's array, of this length.
        let sizes = unsafe { room(sizes, room_for, "valueSizes")? };
        self.inside(vr, false)?;
        let mut places = out.iter_mut().zip(sizes);
        self.0.get_bytes(vr, room_for, |bytes| {
            if let Some((pointer, size)) = places.next() {
                pointer.write(bytes.as_ptr());
                size.write(bytes.len());
            }
        })
    }

    /// Every size is checked before a pointer is read.
    pub unsafe fn set_bytes(
        &mut self,
        vr: References,
        n: usize,
        sizes: *const usize,
        values: *const *const u8,
        n_values: usize,
    ) -> Answer {
        // SAFETY: the importer's arrays, of these lengths.
        let (values, vr) = unsafe { (array(values, n_values, "values")?, array(vr, n, "value references")?) };
        // SAFETY: the importer's array, of this length.
        let sizes = unsafe { array(sizes, n_values, "valueSizes")? };
        self.inside(vr, true)?;
        // SAFETY: NULL or as many bytes as the size states, if the variables are bytes; others are refused before any byte is
        // read.
        self.0.set_bytes(vr, sizes, |i| unsafe { array(values[i], sizes[i], "a binary value") })
    }

    pub unsafe fn set_debug_logging(&mut self, on: bool, n: usize, categories: *const *const c_char) -> Answer {
        let mut names = Vec::new();
        // SAFETY: the importer's array, of this length.
        for &category in unsafe { array(categories, n, "categories")? } {
            // SAFETY: a C string of the importer.
            let category = unsafe { text(category) }.ok_or_else(|| Fault::new("a log category is NULL"))?;
            names.push(category.to_str().map_err(|_| Fault::new("a log category is not UTF-8"))?);
        }
        Ok(self.0.log.switch(self.0.standard, on, &names, E::Model::INFO.categories)?)
    }

    pub fn terminate(&mut self) -> Answer {
        self.0.terminate();
        Ok(())
    }

    pub fn reset(&mut self) -> Answer {
        Ok(self.0.reset()?)
    }

    /// `state` points to NULL, or to a state to be overwritten (FMI 2.0.5, 2.1.8; FMI 3.0.2, 2.2.7.4).
    pub unsafe fn save_state(&mut self, state: *mut FmuState) -> Answer {
        // SAFETY: the importer's variable, which it has initialized as the standard requires.
        let state = unsafe { place(state, "FMUState")?.assume_init_mut() };
        *state = handle(self.0.save(state.addr())?);
        Ok(())
    }

    /// The state is only a number.
    pub fn restore_state(&mut self, state: FmuState) -> Answer {
        Ok(self.0.restore(state.addr())?)
    }

    /// Ignores NULL and a variable that is NULL.
    pub unsafe fn free_state(&mut self, state: *mut FmuState) -> Answer {
        if state.is_null() {
            return Ok(());
        }
        // SAFETY: the importer's variable, which it has initialized as the standard requires.
        let state = unsafe { place(state, "FMUState")?.assume_init_mut() };
        registry::free::<E::Model>(state.addr())?;
        *state = handle(0);
        Ok(())
    }

    pub unsafe fn serialized_size(&mut self, state: FmuState, size: *mut usize) -> Answer {
        // SAFETY: the importer's variable.
        let size = unsafe { place(size, "size")? };
        let storing = Instance::<E>::storing()?;
        size.write(registry::with::<E::Model, _>(state.addr(), |state| blob::size(state, storing))?);
        Ok(())
    }

    pub unsafe fn serialize(&mut self, state: FmuState, bytes: *mut u8, size: usize) -> Answer {
        // SAFETY: the importer's array of this size.
        let out = unsafe { room(bytes, size, "serializedState")? };
        let storing = Instance::<E>::storing()?;
        let bytes = registry::with::<E::Model, _>(state.addr(), |state| blob::write(state, storing))?;
        if bytes.len() != size {
            return Err(Fault::value("size", size, format_args!("{} for this state", bytes.len())).into());
        }
        for (place, byte) in out.iter_mut().zip(bytes) {
            place.write(byte);
        }
        Ok(())
    }

    /// Always creates a new state and ignores the previous value of the variable.
    pub unsafe fn deserialize(&mut self, bytes: *const u8, size: usize, state: *mut FmuState) -> Answer {
        // SAFETY: the importer's array of this size, and its variable.
        let (state, bytes) = unsafe { (place(state, "FMUState")?, array(bytes, size, "serializedState")?) };
        state.write(handle(self.0.deserialize(bytes)?));
        Ok(())
    }

    pub unsafe fn set_states(&mut self, x: *const f64, n: usize) -> Answer {
        // SAFETY: the importer's array, of this length.
        self.0.set_states(unsafe { array(x, n, "continuous states")? })
    }

    pub unsafe fn get_states(&mut self, x: *mut f64, n: usize) -> Answer {
        // SAFETY: the importer's array, of this length.
        Ok(self.0.get_states(unsafe { numbers(x, n, "continuous states")? })?)
    }

    pub unsafe fn derivatives(&mut self, dx: *mut f64, n: usize) -> Answer {
        // SAFETY: the importer's array, of this length.
        self.0.derivatives(unsafe { numbers(dx, n, "derivatives")? })
    }

    pub unsafe fn indicators(&mut self, z: *mut f64, n: usize) -> Answer {
        // SAFETY: the importer's array, of this length.
        self.0.indicators(unsafe { numbers(z, n, "event indicators")? })
    }

    pub unsafe fn nominals(&mut self, x: *mut f64, n: usize) -> Answer {
        // SAFETY: the importer's array, of this length.
        Ok(self.0.nominals(unsafe { numbers(x, n, "nominals")? })?)
    }

    /// No step of the integrator is an event, and none ends the simulation: both flags are 0.
    pub unsafe fn completed_step<B: From<bool>>(&mut self, event: *mut B, end: *mut B) -> Answer {
        // SAFETY: the importer's variables.
        let (end, event) = unsafe { (place(end, "terminateSimulation")?, place(event, "enterEventMode")?) };
        event.write(false.into());
        end.write(false.into());
        Ok(self.0.completed_step()?)
    }

    pub unsafe fn directional(
        &mut self,
        (unknowns, n_unknowns): (References, usize),
        (knowns, n_knowns): (References, usize),
        (seed, n_seed): (*const f64, usize),
        (sensitivity, n_sensitivity): (*mut f64, usize),
        adjoint: bool,
    ) -> Answer {
        // SAFETY: the importer's arrays, of these lengths.
        let (unknowns, knowns, seed, out) = unsafe {
            (
                array(unknowns, n_unknowns, "unknowns")?,
                array(knowns, n_knowns, "knowns")?,
                array(seed, n_seed, "seed")?,
                numbers(sensitivity, n_sensitivity, "sensitivity")?,
            )
        };
        if adjoint {
            self.0.adjoint(unknowns, knowns, seed, out)
        } else {
            self.0.directional(unknowns, knowns, seed, out)
        }
    }

    pub unsafe fn output_derivatives(
        &mut self,
        vr: References,
        n: usize,
        orders: *const i32,
        values: *mut f64,
        n_values: usize,
    ) -> Answer {
        // SAFETY: the importer's arrays, of these lengths.
        let (vr, orders, out) = unsafe {
            (array(vr, n, "value references")?, array(orders, n, "orders")?, numbers(values, n_values, "values")?)
        };
        self.inside(vr, false)?;
        self.0.output_derivatives(vr, orders, out)
    }

    pub unsafe fn input_derivatives(
        &mut self,
        vr: References,
        n: usize,
        orders: *const i32,
        values: *const f64,
    ) -> Answer {
        // SAFETY: the importer's arrays, of this length.
        let (vr, orders, values) =
            unsafe { (array(vr, n, "value references")?, array(orders, n, "orders")?, array(values, n, "values")?) };
        Ok(self.0.input_derivatives(vr, orders, values)?)
    }

    /// A function of a capability that this FMU lacks.
    pub fn unsupported(&mut self, why: &str) -> Answer {
        Err(Fault::new(format!("not supported: {why}")).into())
    }
}

/// A handle in C: a number stored in a pointer.
fn handle(number: usize) -> FmuState {
    std::ptr::without_provenance_mut(number)
}
