//! Sizes in Scheduled Execution: they change between two activations of partitions.
#![allow(missing_docs)]
#![allow(clippy::undocumented_unsafe_blocks, clippy::borrow_as_ptr, reason = "an importer calls C functions")]

use fmi::*;
use fmu_core::unit::ONE;
use fmu_core::{Block, Clock, Clocked, Elapsed, Exported, Fault, Info, Model, Resizable, Row, Step, Table, table};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use std::ffi::CString;
use std::ptr::{null, null_mut};
use std::sync::Once;

/// Adds up its inputs, at each tick.
#[derive(Clone, Serialize, Deserialize)]
struct Adder {
    n: u64,
    k: u64,
    u: Vec<f64>,
    sums: Vec<f64>,
    gains: Vec<f64>,
    offset: f64,
}

impl Default for Adder {
    fn default() -> Self {
        Self { n: 3, k: 1, u: vec![0.0; 3], sums: vec![0.0; 3], gains: vec![1.0], offset: 0.0 }
    }
}

type V = Row<Block<Adder>>;

impl Model for Adder {
    type Outputs = ();
    const INFO: Info = Info { name: "Adder", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::clock("tick", "Adds up", Clock::triggered()).priority(0),
        V::structural("n", "Number of inputs", |m| &mut m.model.n).at_most(4.0).tunable(),
        V::structural("k", "Number of gains", |m| &mut m.model.k).at_most(2.0),
        V::array_input("u", &ONE, "Inputs", 4, |m| &mut m.model.u).sized(&["n"]).on("tick"),
        V::array_output("sums", &ONE, "Sums", 4, |m| &mut m.model.sums).sized(&["n"]).on("tick"),
        V::input("offset", &ONE, "Added to each", |m| &mut m.model.offset),
        V::array_parameter("gains", &ONE, "Gains", 2, |m| &mut m.model.gains).sized(&["k"]),
    ];
    fn initialize(&mut self) {
        self.sums.fill(0.0);
    }
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl Clocked for Adder {
    fn tick(&mut self, _: usize, _: Elapsed) -> Result<(), Fault> {
        self.sums.iter_mut().zip(&self.u).for_each(|(sum, u)| *sum += self.gains[0] * u + self.offset);
        Ok(())
    }
}

impl Resizable for Adder {
    fn resize(&mut self) -> Result<(), Fault> {
        let (n, k) = (usize::try_from(self.n).unwrap(), usize::try_from(self.k).unwrap());
        (self.u, self.sums) = (vec![0.0; n], vec![0.0; n]);
        self.gains.resize(k, 2.0);
        if k == 0 { Err(Fault::new("a gain is needed")) } else { Ok(()) }
    }
}

fmu_export::export!(Adder: Clocked + ScheduledExecution + Resizable);

const TICK: u32 = 1;
const N: u32 = 2;
const K: u32 = 3;
const U: u32 = 4;
const SUMS: u32 = 8;
const OFFSET: u32 = 12;
const GAINS: u32 = 13;

const OK: c_int = 0;
const ERROR: c_int = 3;
const NO: Fmi3Boolean = Fmi3Boolean(0);

struct It(InstancePointer);

impl It {
    fn new() -> Self {
        // The library silences panics; a test needs its own.
        static LOUD: Once = Once::new();
        LOUD.call_once(|| {
            fmu_export::abi::quiet();
            drop(std::panic::take_hook());
        });
        let token = CString::new(This::TOKEN.as_str()).unwrap();
        let (name, token) = (c"it".as_ptr(), token.as_ptr());
        Self(unsafe {
            fmi3InstantiateScheduledExecution(name, token, null(), NO, NO, null_mut(), None, None, None, None)
        })
    }

    fn begun() -> Self {
        let it = Self::new();
        unsafe {
            assert_eq!(fmi3EnterInitializationMode(it.0, NO, 0.0, 0.0, NO, 0.0), OK);
            assert_eq!(fmi3ExitInitializationMode(it.0), OK);
        }
        it
    }

    fn enter(&self) -> c_int {
        unsafe { fmi3EnterConfigurationMode(self.0) }
    }

    fn exit(&self) -> c_int {
        unsafe { fmi3ExitConfigurationMode(self.0) }
    }

    fn set_size(&self, reference: u32, size: u64) -> c_int {
        unsafe { fmi3SetUInt64(self.0, &reference, 1, &size, 1) }
    }

    fn set(&self, reference: u32, values: &[f64]) -> c_int {
        unsafe { fmi3SetFloat64(self.0, &reference, 1, values.as_ptr(), values.len()) }
    }

    fn get(&self, reference: u32, n: usize) -> (c_int, Vec<f64>) {
        let mut values = vec![-7.0; n];
        let status = unsafe { fmi3GetFloat64(self.0, &reference, 1, values.as_mut_ptr(), n) };
        (status, values)
    }

    fn tick(&self, time: f64) -> c_int {
        unsafe { fmi3ActivateModelPartition(self.0, TICK, time) }
    }
}

impl Drop for It {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.0) }
    }
}

#[test]
fn sizes_change_between_ticks() {
    let it = It::begun();
    assert_eq!((it.set(U, &[1.0, 2.0, 3.0]), it.tick(0.0), it.tick(0.1)), (OK, OK, OK));
    assert_eq!(it.get(SUMS, 3), (OK, vec![2.0, 4.0, 6.0]));
    assert_eq!((it.enter(), it.set_size(N, 4), it.get(SUMS, 3)), (OK, OK, (OK, vec![2.0, 4.0, 6.0])));
    assert_eq!((it.exit(), it.get(SUMS, 4)), (OK, (OK, vec![0.0; 4])));
    assert_eq!((it.set(U, &[1.0; 4]), it.tick(0.2), it.get(SUMS, 4)), (OK, OK, (OK, vec![1.0; 4])));
    // A clock remembers its last tick.
    assert_eq!(
        (it.enter(), it.set_size(N, 0), it.exit(), it.tick(0.3), it.get(SUMS, 0)),
        (OK, OK, OK, OK, (OK, vec![]))
    );
    assert_eq!(it.tick(0.3), ERROR);
}

#[test]
fn each_mode_takes_its_own_parameters() {
    let it = It::new();
    assert_eq!((it.enter(), it.set_size(K, 2), it.set_size(N, 1), it.exit()), (OK, OK, OK, OK));
    assert_eq!((it.get(GAINS, 2), it.get(U, 1).0), ((OK, vec![1.0, 2.0]), OK));
    let refused: [&dyn Fn(&It) -> c_int; 6] = [
        &|it| it.set_size(K, 2),
        &|it| it.set_size(N, 5),
        &|it| it.tick(0.0),
        &|it| it.set(U, &[0.0; 3]),
        &|it| it.set(OFFSET, &[1.0]),
        &|it| it.enter(),
    ];
    for (number, call) in refused.into_iter().enumerate() {
        let it = It::begun();
        assert_eq!((it.enter(), call(&it)), (OK, ERROR), "{number}");
    }
    // Outside of the mode, and with values of the old sizes.
    assert_eq!(It::begun().set_size(N, 1), ERROR);
    assert_eq!(It::begun().exit(), ERROR);
    for n in [2, 4] {
        assert_eq!(It::begun().set(U, &vec![0.0; n]), ERROR);
        assert_eq!(It::begun().get(SUMS, n), (ERROR, vec![-7.0; n]));
    }
    let it = It::new();
    assert_eq!((it.enter(), it.set_size(K, 0), it.exit(), it.get(GAINS, 1)), (OK, OK, ERROR, (OK, vec![1.0])));
}
