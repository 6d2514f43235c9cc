//! Cost of the interface: a set of six, a step and a get of six on an empty model, through the C functions. `cargo bench -p
//! fmu-export`. The goal is 60 ns together.
#![allow(missing_docs)]

mod timing;

use fmu_core::unit::VOLT;
use fmu_core::{Block, Elapsed, Experiment, Exported, Fault, Info, Model, Row, Step, Table, table};
use fmu_export::abi::types::{Fmi2Boolean, InstancePointer, References, c_int};
use serde::{Deserialize, Serialize};
use std::ffi::CString;
use std::hint::black_box;
use std::ptr::null;
use timing::time;

#[derive(Clone, Default, Serialize, Deserialize)]
struct Empty {
    u: [f64; 6],
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    y: [f64; 6],
}

type V = Row<Block<Empty>>;

impl Model for Empty {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "Empty",
        version: "1",
        experiment: Experiment { stop: 1.0, step: 1e-4, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("u1", &VOLT, "", |m| &mut m.model.u[0]),
        V::input("u2", &VOLT, "", |m| &mut m.model.u[1]),
        V::input("u3", &VOLT, "", |m| &mut m.model.u[2]),
        V::input("u4", &VOLT, "", |m| &mut m.model.u[3]),
        V::input("u5", &VOLT, "", |m| &mut m.model.u[4]),
        V::input("u6", &VOLT, "", |m| &mut m.model.u[5]),
        V::output("y1", &VOLT, "", |m| &mut m.out.y[0]),
        V::output("y2", &VOLT, "", |m| &mut m.out.y[1]),
        V::output("y3", &VOLT, "", |m| &mut m.out.y[2]),
        V::output("y4", &VOLT, "", |m| &mut m.out.y[3]),
        V::output("y5", &VOLT, "", |m| &mut m.out.y[4]),
        V::output("y6", &VOLT, "", |m| &mut m.out.y[5]),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, _: &mut Outputs) {}
    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

fmu_export::export!(Empty);

fn main() {
    let no = Fmi2Boolean(0);
    let token = CString::new(fmi::This::TOKEN.as_str()).unwrap_or_default();
    // An importer calls through pointers unknown to the compiler.
    let set: unsafe extern "C" fn(InstancePointer, References, usize, *const f64) -> c_int =
        black_box(fmi::fmi2SetReal);
    let step: unsafe extern "C" fn(InstancePointer, f64, f64, Fmi2Boolean) -> c_int = black_box(fmi::fmi2DoStep);
    let get: unsafe extern "C" fn(InstancePointer, References, usize, *mut f64) -> c_int = black_box(fmi::fmi2GetReal);
    let (inputs, outputs, mut values) = ([1, 2, 3, 4, 5, 6], [7, 8, 9, 10, 11, 12], [1.0; 6]);
    let (mut t, h) = (0.0, 1e-4);
    // SAFETY: used as the standard requires: one thread, arrays of the given lengths, freed once.
    unsafe {
        let it = fmi::fmi2Instantiate(c"bench".as_ptr(), 1, token.as_ptr(), null(), null(), no, no);
        assert_eq!(fmi::fmi2SetupExperiment(it, no, 0.0, 0.0, Fmi2Boolean(1), 1e9), 0);
        assert_eq!((fmi::fmi2EnterInitializationMode(it), fmi::fmi2ExitInitializationMode(it)), (0, 0));
        let set = time(|| set(it, inputs.as_ptr(), 6, black_box(values.as_ptr())));
        let step = time(|| {
            let status = step(it, t, h, no);
            t += h;
            status
        });
        let get = time(|| get(it, outputs.as_ptr(), 6, black_box(values.as_mut_ptr())));
        fmi::fmi2FreeInstance(it);
        let all = set + step + get;
        println!(
            "set of six {set:.1} ns, step {step:.1} ns, get of six {get:.1} ns, together {all:.1} ns; goal: 60 ns"
        );
    }
}
