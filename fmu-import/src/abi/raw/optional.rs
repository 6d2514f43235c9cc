//! Functions of optional capabilities: the checker tests that an FMU without the capability refuses them.

use super::super::log::Status;
use super::super::signatures::{v2, v3};
use super::{Handle, Optional, Raw};
use model_description::FmiVersion;
use std::ffi::{c_int, c_void};

impl Raw {
    /// The derivatives of variables of double precision with respect to time.
    pub fn output_derivatives(&self, instance: Handle, references: &[u32], order: c_int) -> Option<(Status, Vec<f64>)> {
        let n = references.len();
        let (orders, mut values) = (vec![order; n], vec![f64::NAN; n]);
        let owned = self.owned();
        let (i, vr, orders, out) = (owned.pointer(instance), references.as_ptr(), orders.as_ptr(), values.as_mut_ptr());
        // SAFETY: the standards' types; all arrays have this length.
        let status = unsafe {
            match self.version {
                FmiVersion::V2 => {
                    self.function::<v2::OutputDerivatives>("GetRealOutputDerivatives")?(i, vr, n, orders, out)
                }
                FmiVersion::V3 => {
                    self.function::<v3::OutputDerivatives>("GetOutputDerivatives")?(i, vr, n, orders, out, n)
                }
            }
        };
        Some((status, values))
    }

    /// A function of an optional capability, with arguments that are as valid as the instance allows: one variable, numbers
    /// of 0, room for results.
    pub fn optional(&self, function: Optional, instance: Handle, reference: u32) -> Option<Status> {
        use Optional as O;
        type Ref = *const u32;
        type Any = *mut c_void;
        let (mut room, mut more, mut third, mut fourth) = ([0_u64; 64], [0_u64; 64], [0_u64; 64], [0_u64; 64]);
        if matches!(function, O::GetOutputDerivatives | O::SetRealInputDerivatives | O::GetRealOutputDerivatives) {
            // The order of the derivative.
            room[0] = 1;
        }
        let (a, b): (Any, Any) = (room.as_mut_ptr().cast(), more.as_mut_ptr().cast());
        let (c, d): (Any, Any) = (third.as_mut_ptr().cast(), fourth.as_mut_ptr().cast());
        let owned = self.owned();
        let (vr, i, name) = (&raw const reference, owned.pointer(instance), function.as_str());
        // SAFETY: every type is that of the standard, up to what a pointer to data leads to; each place has 512 bytes,
        // more than one value or 64 states need.
        Some(unsafe {
            match function {
                O::GetBinary | O::SetBinary => self
                    .function::<unsafe extern "C" fn(Any, Ref, usize, Any, Any, usize) -> Status>(name)?(
                    i, vr, 1, a, b, 1,
                ),
                O::GetIntervalFraction => self
                    .function::<unsafe extern "C" fn(Any, Ref, usize, Any, Any, Any) -> Status>(name)?(
                    i, vr, 1, a, b, c,
                ),
                O::GetIntervalDecimal
                | O::GetShiftFraction
                | O::SetShiftFraction
                | O::SetIntervalFraction
                | O::SetRealInputDerivatives => {
                    self.function::<unsafe extern "C" fn(Any, Ref, usize, Any, Any) -> Status>(name)?(i, vr, 1, a, b)
                }
                O::GetClock | O::SetClock | O::GetShiftDecimal | O::SetShiftDecimal | O::SetIntervalDecimal => {
                    self.function::<v2::Get<c_void>>(name)?(i, vr, 1, a)
                }
                O::GetNumberOfVariableDependencies => {
                    self.function::<unsafe extern "C" fn(Any, u32, Any) -> Status>(name)?(i, reference, a)
                }
                O::GetVariableDependencies => {
                    type F = unsafe extern "C" fn(Any, u32, Any, Any, Any, Any, usize) -> Status;
                    self.function::<F>(name)?(i, reference, a, b, c, d, 1)
                }
                O::GetDirectionalDerivative | O::GetAdjointDerivative => match self.version {
                    FmiVersion::V2 => {
                        type F = unsafe extern "C" fn(Any, Ref, usize, Ref, usize, Any, Any) -> Status;
                        self.function::<F>(name)?(i, vr, 1, vr, 1, a, b)
                    }
                    FmiVersion::V3 => {
                        type F = unsafe extern "C" fn(Any, Ref, usize, Ref, usize, Any, usize, Any, usize) -> Status;
                        self.function::<F>(name)?(i, vr, 1, vr, 1, a, 1, b, 1)
                    }
                },
                O::GetRealOutputDerivatives => {
                    self.function::<v2::OutputDerivatives>(name)?(i, vr, 1, a.cast(), b.cast())
                }
                O::GetOutputDerivatives => {
                    self.function::<v3::OutputDerivatives>(name)?(i, vr, 1, a.cast(), b.cast(), 1)
                }
                O::UpdateDiscreteStates => {
                    let at = |n: usize| a.wrapping_byte_add(n).cast();
                    self.function::<v3::UpdateDiscreteStates>(name)?(i, at(0), at(8), at(16), at(24), at(32), b.cast())
                }
                O::CompletedIntegratorStep => match self.version {
                    FmiVersion::V2 => {
                        self.function::<unsafe extern "C" fn(Any, c_int, Any, Any) -> Status>(name)?(i, 1, a, b)
                    }
                    FmiVersion::V3 => {
                        self.function::<unsafe extern "C" fn(Any, bool, Any, Any) -> Status>(name)?(i, true, a, b)
                    }
                },
                O::SetTime => self.function::<unsafe extern "C" fn(Any, f64) -> Status>(name)?(i, 0.0),
                O::SetContinuousStates
                | O::GetContinuousStateDerivatives
                | O::GetDerivatives
                | O::GetEventIndicators
                | O::GetContinuousStates
                | O::GetNominalsOfContinuousStates => {
                    self.function::<unsafe extern "C" fn(Any, Any, usize) -> Status>(name)?(i, a, 1)
                }
                O::NewDiscreteStates | O::GetNumberOfEventIndicators | O::GetNumberOfContinuousStates => {
                    self.function::<unsafe extern "C" fn(Any, Any) -> Status>(name)?(i, a)
                }
                O::ActivateModelPartition => {
                    self.function::<unsafe extern "C" fn(Any, u32, f64) -> Status>(name)?(i, reference, 0.0)
                }
            }
        })
    }
}
