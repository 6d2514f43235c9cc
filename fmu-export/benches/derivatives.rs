//! Cost of a solver's call: states, inputs, derivatives through the C functions, for four states with almost no equations.
//! `cargo bench -p fmu-export`. The goal is 40 ns; of 120 ns, 80 remain for the equations of a machine.
#![allow(missing_docs)]

mod timing;

use fmu_core::unit::{ONE, PER_SECOND};
use fmu_core::{
    Block, ContinuousTime, Elapsed, Experiment, Exported, Fault, Info, Model, Row, State, Step, Table, integrate, table,
};
use fmu_export::abi::types::{Fmi2Boolean, InstancePointer, References, c_int};
use serde::{Deserialize, Serialize};
use std::ffi::CString;
use std::hint::black_box;
use std::ptr::null;
use timing::time;

#[derive(Clone, Default, Serialize, Deserialize)]
struct Chain {
    u: [f64; 6],
    x: [f64; 4],
}

type V = Row<Block<Chain>>;

impl Model for Chain {
    type Outputs = ();
    const INFO: Info = Info {
        name: "Chain",
        version: "1",
        experiment: Experiment { stop: 1.0, step: 1e-4, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("u1", &ONE, "", |m| &mut m.model.u[0]),
        V::input("u2", &ONE, "", |m| &mut m.model.u[1]),
        V::input("u3", &ONE, "", |m| &mut m.model.u[2]),
        V::input("u4", &ONE, "", |m| &mut m.model.u[3]),
        V::input("u5", &ONE, "", |m| &mut m.model.u[4]),
        V::input("u6", &ONE, "", |m| &mut m.model.u[5]),
        V::output("x1", &ONE, "", |m| &mut m.model.x[0]),
        V::output("x2", &ONE, "", |m| &mut m.model.x[1]),
        V::output("x3", &ONE, "", |m| &mut m.model.x[2]),
        V::output("x4", &ONE, "", |m| &mut m.model.x[3]),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, 4>(self, step, 1e-4)
    }
}

impl ContinuousTime for Chain {
    const STATES: &'static [State<Self>] = &[
        State::new("x1", &PER_SECOND, |m: &mut Self| &mut m.x[0]),
        State::new("x2", &PER_SECOND, |m: &mut Self| &mut m.x[1]),
        State::new("x3", &PER_SECOND, |m: &mut Self| &mut m.x[2]),
        State::new("x4", &PER_SECOND, |m: &mut Self| &mut m.x[3]),
    ];

    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        for (i, dx) in dx.iter_mut().enumerate() {
            *dx = self.u[i] + self.u[(i + 4) % 6] - self.x[i];
        }
        Ok(())
    }
}

fmu_export::export!(Chain: ContinuousTime);

type Read = unsafe extern "C" fn(InstancePointer, *mut f64, usize) -> c_int;
type Write = unsafe extern "C" fn(InstancePointer, *const f64, usize) -> c_int;

fn main() {
    let no = Fmi2Boolean(0);
    let token = CString::new(fmi::This::TOKEN.as_str()).unwrap_or_default();
    // An importer calls through pointers unknown to the compiler.
    let set: unsafe extern "C" fn(InstancePointer, References, usize, *const f64) -> c_int =
        black_box(fmi::fmi2SetReal);
    let time_of: unsafe extern "C" fn(InstancePointer, f64) -> c_int = black_box(fmi::fmi2SetTime);
    let (write, read): (Write, Read) = (black_box(fmi::fmi2SetContinuousStates), black_box(fmi::fmi2GetDerivatives));
    let (inputs, u, mut x, mut dx) = ([1, 2, 3, 4, 5, 6], [1.0; 6], [0.5; 4], [0.0; 4]);
    // SAFETY: used as the standard requires: one thread, arrays of the given lengths, freed once.
    unsafe {
        let it = fmi::fmi2Instantiate(c"bench".as_ptr(), 0, token.as_ptr(), null(), null(), no, no);
        assert_eq!(fmi::fmi2SetupExperiment(it, no, 0.0, 0.0, no, 0.0), 0);
        assert_eq!((fmi::fmi2EnterInitializationMode(it), fmi::fmi2ExitInitializationMode(it)), (0, 0));
        assert_eq!(fmi::fmi2EnterContinuousTimeMode(it), 0);
        let set_time = time(|| time_of(it, black_box(1.0)));
        let states = time(|| write(it, black_box(x.as_mut_ptr()), 4));
        let set_inputs = time(|| set(it, inputs.as_ptr(), 6, black_box(u.as_ptr())));
        let get = time(|| read(it, black_box(dx.as_mut_ptr()), 4));
        let all = time(|| {
            write(it, black_box(x.as_mut_ptr()), 4)
                + set(it, inputs.as_ptr(), 6, black_box(u.as_ptr()))
                + read(it, black_box(dx.as_mut_ptr()), 4)
        });
        fmi::fmi2FreeInstance(it);
        println!(
            "set time {set_time:.1} ns, four states {states:.1} ns, six inputs {set_inputs:.1} ns, \
             derivatives {get:.1} ns; states, inputs and derivatives together {all:.1} ns; goal: 40 ns"
        );
    }
}
