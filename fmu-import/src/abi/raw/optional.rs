//! Functions of optional capabilities: the checker tests that an FMU without the capability refuses them.

use super::super::log::Status;
use super::super::signatures::v2;
use super::equations::SensitivityArguments;
use super::library::Raw;
use super::names::{Count, Optional, Sensitivity, Vector};
use super::owned::Handle;
use std::ffi::c_void;

impl Raw {
    /// A function of an optional capability, with arguments that are as valid as the instance allows: one variable, numbers
    /// of 0, room for results.
    pub fn optional(&self, function: Optional, instance: Handle, reference: u32) -> Option<Status> {
        use Optional as O;
        let name = function.as_str();
        let (list, mut room) = ([reference], [0.0; 64]);
        if let Some(name) = Sensitivity::named(name) {
            let lists = (Some(&list[..]), 1);
            let arguments = SensitivityArguments { unknowns: lists, knowns: lists, seed: (Some(&[0.0]), 1) };
            return self.sensitivity(name, instance, arguments, Some(&mut room), 1);
        }
        if let Some(name) = Vector::named(name) {
            return self.vector(name, instance, Some(&mut room), 1);
        }
        if let Some(name) = Count::named(name) {
            return self.count(name, instance, false).map(|(status, _)| status);
        }
        match function {
            O::GetOutputDerivatives | O::GetRealOutputDerivatives => {
                self.output_derivatives(instance, &list, 1).map(|(status, _)| status)
            }
            O::SetRealInputDerivatives => self.input_derivatives(instance, Some(&list), 1, Some(&[1]), Some(&[0.0])),
            O::UpdateDiscreteStates | O::NewDiscreteStates => {
                self.update_discrete_states(instance, false).map(|(status, _)| status)
            }
            O::CompletedIntegratorStep => {
                self.completed_integrator_step(instance, true, false).map(|(status, _)| status)
            }
            O::SetTime => self.set_time(instance, 0.0),
            _ => self.unused(function, instance, reference),
        }
    }

    /// A function that is called only here: for binary values, clocks, and dependencies of elements.
    fn unused(&self, function: Optional, instance: Handle, reference: u32) -> Option<Status> {
        use Optional as O;
        type Ref = *const u32;
        type Any = *mut c_void;
        type Two = unsafe extern "C" fn(Any, Ref, usize, Any, Any) -> Status;
        type Three = unsafe extern "C" fn(Any, Ref, usize, Any, Any, Any) -> Status;
        type Binary = unsafe extern "C" fn(Any, Ref, usize, Any, Any, usize) -> Status;
        type Number = unsafe extern "C" fn(Any, u32, Any) -> Status;
        type Dependencies = unsafe extern "C" fn(Any, u32, Any, Any, Any, Any, usize) -> Status;
        type Partition = unsafe extern "C" fn(Any, u32, f64) -> Status;
        let mut room = [[0_u64; 64]; 4];
        let [a, b, c, d] = room.each_mut().map(|place| place.as_mut_ptr().cast::<c_void>());
        let owned = self.owned();
        let (vr, i, name) = (&raw const reference, owned.pointer(instance).0, self.name(function.as_str()));
        let calls = &self.calls;
        // SAFETY: every type matches the standard, except for the target of data pointers; each buffer has 512 bytes, more
        // than one value needs.
        Some(unsafe {
            match function {
                O::GetBinary | O::SetBinary => calls.function::<Binary>(&name)?(i, vr, 1, a, b, 1),
                O::GetIntervalFraction => calls.function::<Three>(&name)?(i, vr, 1, a, b, c),
                O::GetIntervalDecimal | O::GetShiftFraction | O::SetShiftFraction | O::SetIntervalFraction => {
                    calls.function::<Two>(&name)?(i, vr, 1, a, b)
                }
                O::GetClock | O::SetClock | O::GetShiftDecimal | O::SetShiftDecimal | O::SetIntervalDecimal => {
                    calls.function::<v2::Transfer>(&name)?(i, vr, 1, a)
                }
                O::GetNumberOfVariableDependencies => calls.function::<Number>(&name)?(i, reference, a),
                O::GetVariableDependencies => calls.function::<Dependencies>(&name)?(i, reference, a, b, c, d, 1),
                O::ActivateModelPartition => calls.function::<Partition>(&name)?(i, reference, 0.0),
                _ => return None,
            }
        })
    }
}
