//! A solver's evaluation of the plant in Model Exchange through the C functions: the time, three voltages and the states are
//! set, the derivatives read: `cargo bench --bench exchange`. The goal is 120 ns.
#![allow(missing_docs)]

#[path = "../fmu-export/benches/timing/mod.rs"]
mod timing;

use drive::PmsmPlant;
use fmu_core::Exported;
use fmu_export::abi::types::{Fmi2Boolean, InstancePointer, References, c_int};
use std::ffi::CString;
use std::hint::black_box;
use std::ptr::null;
use timing::time;

fmu_export::export!(PmsmPlant: ContinuousTime + Events + Differentiable + CompletedSteps);

fn main() {
    let no = Fmi2Boolean(0);
    let token = CString::new(fmi::This::TOKEN.as_str()).unwrap_or_default();
    // An importer calls through pointers unknown to the compiler.
    let set: unsafe extern "C" fn(InstancePointer, References, usize, *const f64) -> c_int =
        black_box(fmi::fmi2SetReal);
    let time_of: unsafe extern "C" fn(InstancePointer, f64) -> c_int = black_box(fmi::fmi2SetTime);
    let write: unsafe extern "C" fn(InstancePointer, *const f64, usize) -> c_int =
        black_box(fmi::fmi2SetContinuousStates);
    let read: unsafe extern "C" fn(InstancePointer, *mut f64, usize) -> c_int = black_box(fmi::fmi2GetDerivatives);
    // u_a, u_b, u_c.
    let (inputs, u, x, mut dx) = ([1, 2, 3], [20.0, -5.0, -15.0], [0.16, 0.02, 30.0, 0.4], [0.0; 4]);
    // SAFETY: used as the standard requires: one thread, arrays of the given lengths, freed once.
    unsafe {
        let it = fmi::fmi2Instantiate(c"bench".as_ptr(), 0, token.as_ptr(), null(), null(), no, no);
        assert_eq!(fmi::fmi2SetupExperiment(it, no, 0.0, 0.0, no, 0.0), 0);
        assert_eq!((fmi::fmi2EnterInitializationMode(it), fmi::fmi2ExitInitializationMode(it)), (0, 0));
        assert_eq!(fmi::fmi2EnterContinuousTimeMode(it), 0);
        let evaluation = time(|| {
            write(it, black_box(x.as_ptr()), 4)
                + set(it, inputs.as_ptr(), 3, black_box(u.as_ptr()))
                + read(it, black_box(dx.as_mut_ptr()), 4)
        });
        let with_time = time(|| {
            time_of(it, black_box(1.0))
                + write(it, black_box(x.as_ptr()), 4)
                + set(it, inputs.as_ptr(), 3, black_box(u.as_ptr()))
                + read(it, black_box(dx.as_mut_ptr()), 4)
        });
        let states = time(|| write(it, black_box(x.as_ptr()), 4));
        let derivatives = time(|| read(it, black_box(dx.as_mut_ptr()), 4));
        fmi::fmi2FreeInstance(it);
        println!(
            "states, inputs and derivatives {evaluation:.0} ns (goal: 120 ns), with the time {with_time:.0} ns; of these \
             the states {states:.0} ns, the derivatives {derivatives:.0} ns"
        );
    }
}
