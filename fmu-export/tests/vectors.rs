//! Outputs in a `Vec` that has no elements before they are computed: the first getter finds all of them.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(clippy::undocumented_unsafe_blocks, clippy::borrow_as_ptr, reason = "an importer calls C functions")]

use fmu_core::unit::VOLT;
use fmu_core::{Block, Elapsed, Exported, Fault, Info, Items, Model, Row, Step, Table, table};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use std::ffi::CString;
use std::ptr::{null, null_mut};

#[derive(Clone, Default, Serialize, Deserialize)]
struct Late;

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    voltages: Vec<f64>,
    counts: Vec<i32>,
}

type V = Row<Block<Late>>;

impl Model for Late {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Late", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::array_output("voltages", &VOLT, "Three", 3, |m| &mut m.out.voltages).discrete(),
        V::list_output("counts", "Two", 2, &Items(|m| &mut m.out.counts)),
    ];

    fn initialize(&mut self) {}

    fn output(&self, _: Elapsed, out: &mut Outputs) {
        *out = Outputs { voltages: vec![1.0, 2.0, 3.0], counts: vec![4, 5] };
    }

    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

fmu_export::export!(Late);
use fmi::*;

#[test]
fn the_first_getter_finds_all_elements() {
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    let (no, no2) = (Fmi3Boolean(0), Fmi2Boolean(0));
    for counts_first in [false, true] {
        let (mut voltages, mut counts) = ([0.0; 3], [0; 2]);
        unsafe {
            let it = fmi3InstantiateCoSimulation(
                c"late".as_ptr(),
                token.as_ptr(),
                null(),
                no,
                no,
                no,
                no,
                null(),
                0,
                null_mut(),
                None,
                None,
            );
            assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), 0);
            if counts_first {
                assert_eq!(fmi3GetInt32(it, &4, 1, counts.as_mut_ptr(), 2), 0);
            }
            assert_eq!(fmi3GetFloat64(it, &1, 1, voltages.as_mut_ptr(), 3), 0);
            assert_eq!(fmi3GetInt32(it, &4, 1, counts.as_mut_ptr(), 2), 0);
            fmi3FreeInstance(it);
        }
        assert_eq!((voltages, counts), ([1.0, 2.0, 3.0], [4, 5]));
    }
    let mut voltages = [0.0; 3];
    unsafe {
        let it = fmi2Instantiate(c"late".as_ptr(), 1, token.as_ptr(), null(), null(), no2, no2);
        assert_eq!(fmi2SetupExperiment(it, no2, 0.0, 0.0, no2, 0.0), 0);
        assert_eq!(fmi2EnterInitializationMode(it), 0);
        assert_eq!(fmi2GetReal(it, [1, 2, 3].as_ptr(), 3, voltages.as_mut_ptr()), 0);
        fmi2FreeInstance(it);
    }
    assert_eq!(voltages, [1.0, 2.0, 3.0]);
}

/// The model has no Booleans: no reference can be read or set as one, but a list without references can.
#[test]
fn a_type_that_the_model_lacks_is_refused() {
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    let (no, no2) = (Fmi3Boolean(0), Fmi2Boolean(0));
    unsafe {
        let two = || {
            let it = fmi2Instantiate(c"late".as_ptr(), 1, token.as_ptr(), null(), null(), no2, no2);
            assert_eq!(fmi2SetupExperiment(it, no2, 0.0, 0.0, no2, 0.0), 0);
            it
        };
        let three = || {
            let (name, token) = (c"late".as_ptr(), token.as_ptr());
            fmi3InstantiateCoSimulation(name, token, null(), no, no, no, no, null(), 0, null_mut(), None, None)
        };
        for reference in [1, 4, 99] {
            let it = three();
            assert_eq!(fmi3SetBoolean(it, &reference, 1, &Fmi3Boolean(1), 1), 3, "set {reference}");
            fmi3FreeInstance(it);
            let (it, mut value) = (three(), Fmi3Boolean(0));
            assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), 0);
            assert_eq!(fmi3GetBoolean(it, &reference, 1, &mut value, 1), 3, "get {reference}");
            fmi3FreeInstance(it);
            let it = two();
            assert_eq!(fmi2SetBoolean(it, &reference, 1, &Fmi2Boolean(1)), 3, "set {reference}, FMI 2.0");
            fmi2FreeInstance(it);
        }
        let it = three();
        assert_eq!(fmi3SetBoolean(it, null(), 0, null(), 0), 0, "nothing to set");
        assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), 0);
        assert_eq!(fmi3GetBoolean(it, null(), 0, null_mut(), 0), 0, "nothing to get");
        fmi3FreeInstance(it);
    }
}
