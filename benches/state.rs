//! Saving and restoring the FMU state of the controller through the C functions, with a reused handle: `cargo bench --bench
//! state`. The goal is 200 ns each.
#![allow(missing_docs)]

#[path = "../fmu-export/benches/timing/mod.rs"]
mod timing;

use drive::SensorlessController;
use fmu_core::Exported;
use fmu_export::abi::types::{Fmi2Boolean, FmuState, InstancePointer, c_int};
use fmu_export::snapshot::Snapshot;
use std::ffi::CString;
use std::hint::black_box;
use std::ptr::{null, null_mut};
use timing::time;

fmu_export::export!(SensorlessController);

fn main() {
    let (no, h) = (Fmi2Boolean(0), 1e-4);
    let token = CString::new(fmi::This::TOKEN.as_str()).unwrap_or_default();
    // An importer calls through pointers unknown to the compiler.
    let save: unsafe extern "C" fn(InstancePointer, *mut FmuState) -> c_int = black_box(fmi::fmi2GetFMUstate);
    let restore: unsafe extern "C" fn(InstancePointer, FmuState) -> c_int = black_box(fmi::fmi2SetFMUstate);
    let step: unsafe extern "C" fn(InstancePointer, f64, f64, Fmi2Boolean) -> c_int = black_box(fmi::fmi2DoStep);
    // SAFETY: used as the standard requires: one thread, freed once.
    unsafe {
        let it = fmi::fmi2Instantiate(c"bench".as_ptr(), 1, token.as_ptr(), null(), null(), no, no);
        assert_eq!(fmi::fmi2SetupExperiment(it, no, 0.0, 0.0, no, 0.0), 0);
        assert_eq!((fmi::fmi2EnterInitializationMode(it), fmi::fmi2ExitInitializationMode(it)), (0, 0));
        let mut t = 0.0;
        let step = time(|| {
            let status = step(it, t, h, no);
            t += h;
            status
        });
        let mut state = null_mut();
        let saved = time(|| save(it, black_box(&raw mut state)));
        let restored = time(|| restore(it, black_box(state)));
        assert_eq!(fmi::fmi2FreeFMUstate(it, &raw mut state), 0);
        fmi::fmi2FreeInstance(it);
        let size = size_of::<Snapshot<SensorlessController>>();
        println!(
            "a state of {size} bytes: saved in {saved:.0} ns, restored in {restored:.0} ns; a step of the controller takes \
             {step:.0} ns, {:.2} times as long as both; goal: 200 ns each",
            step / (saved + restored)
        );
    }
}
