//! Arrays of states with a fixed length: in FMI 3.0, the array of derivatives has the same length, and its inner elements have no
//! reference. The derivative of an output that accumulates.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

use fmi::*;
use fmu_core::unit::{ONE, PER_SECOND, SECOND};
use fmu_core::{
    Block, ContinuousTime, Elapsed, Exported, Fault, Info, Model, Row, State, Step, Table, integrate, table,
};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::ffi::{CStr, CString};
use std::ptr::{null, null_mut};

/// Three decays with their rates in 1/s, and a fourth one with 1/s.
#[derive(Clone, Serialize, Deserialize)]
struct Decays {
    rates: Vec<f64>,
    x: Vec<f64>,
    z: f64,
    area: f64,
}

impl Default for Decays {
    fn default() -> Self {
        Self { rates: vec![1.0, 2.0, 4.0], x: vec![8.0; 3], z: 5.0, area: 0.0 }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    area: f64,
}

type V = Row<Block<Decays>>;

impl Model for Decays {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Decays", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::array_parameter("rates", &PER_SECOND, "Rates", 3, |m| &mut m.model.rates),
        V::array_local("x", &ONE, "States", 3, |m| &mut m.model.x),
        V::state("z", &ONE, "One more state", |m| &mut m.model.z),
        V::output("area", &SECOND, "Integral of z", |m| &mut m.out.area),
    ];
    fn initialize(&mut self) {
        *self = Self { rates: self.rates.clone(), ..Self::default() };
    }
    fn output(&self, _: Elapsed, out: &mut Outputs) {
        out.area = self.area;
    }
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        let before = self.z;
        integrate::smooth::<Self, 4>(self, step, 0.01)?;
        self.area += before - self.z;
        Ok(())
    }
}

impl ContinuousTime for Decays {
    const STATES: &'static [State<Self>] =
        &[State::array("x", &PER_SECOND, 3, |m| &mut m.x), State::new("z", &PER_SECOND, |m| &mut m.z)];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        for ((dx, x), rate) in dx.iter_mut().zip(&self.x).zip(&self.rates) {
            *dx = -rate * x;
        }
        dx[3] = -self.z;
        Ok(())
    }
    fn integrands(&self, _: Elapsed, out: &mut Outputs) {
        out.area = self.z;
    }
}

fmu_export::export!(Decays: ContinuousTime);

const X: u32 = 4;
const AREA: u32 = 8;
const DER_X: u32 = 9;
const OK: c_int = 0;
const ERROR: c_int = 3;

thread_local! {
    static SAID: RefCell<String> = const { RefCell::new(String::new()) };
}

extern "C" fn log(_: *mut c_void, _: c_int, _: Text, message: Text) {
    SAID.set(unsafe { CStr::from_ptr(message) }.to_str().unwrap().to_owned());
}

/// An instance for Model Exchange, initialized.
fn started() -> InstancePointer {
    let (token, no) = (CString::new(This::TOKEN.as_str()).unwrap(), Fmi3Boolean(0));
    unsafe {
        let it = fmi3InstantiateModelExchange(c"it".as_ptr(), token.as_ptr(), null(), no, no, null_mut(), Some(log));
        assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), OK);
        assert_eq!(fmi3ExitInitializationMode(it), OK);
        it
    }
}

fn get(it: InstancePointer, references: &[u32], n: usize) -> (c_int, Vec<f64>) {
    let mut values = vec![0.0; n];
    (unsafe { fmi3GetFloat64(it, references.as_ptr(), references.len(), values.as_mut_ptr(), n) }, values)
}

#[test]
fn derivatives_have_the_length_of_their_states() {
    // The library silences panics; a test needs its own.
    fmu_export::abi::quiet();
    drop(std::panic::take_hook());
    let it = started();
    assert_eq!(get(it, &[X, DER_X], 6), (OK, vec![8.0, 8.0, 8.0, -8.0, -16.0, -32.0]));
    unsafe { fmi3FreeInstance(it) };
    let inner = [DER_X + 1, X + 1].map(|inner| [inner]);
    let cases = [
        (&[DER_X][..], 1),
        (&[DER_X], 2),
        (&[DER_X], 4),
        (&inner[0], 1),
        (&inner[0], 3),
        (&inner[1], 1),
        (&inner[1], 3),
    ];
    for (references, n) in cases {
        let it = started();
        assert_eq!(get(it, references, n).0, ERROR, "{references:?}: {n} values");
        unsafe { fmi3FreeInstance(it) };
    }
    let it = started();
    assert_eq!(get(it, &[DER_X + 2], 1).0, ERROR);
    unsafe { fmi3FreeInstance(it) };
    let why = "value reference 11 does not exist; it belongs to the array der(x) with reference 9";
    assert_eq!(SAID.take(), format!("fmi3GetFloat64: {why}"));
    let it = started();
    assert_eq!(unsafe { fmi3SetFloat64(it, &DER_X, 1, [1.0; 3].as_ptr(), 3) }, ERROR);
    unsafe { fmi3FreeInstance(it) };
    assert_eq!(SAID.take(), "fmi3SetFloat64: der(x) is calculated and cannot be set");
}

/// An output that accumulates grows with its integrand, at the start and after a step.
#[test]
fn the_derivative_of_a_counter_is_its_integrand() {
    let (token, no) = (CString::new(This::TOKEN.as_str()).unwrap(), Fmi3Boolean(0));
    let (name, token) = (c"it".as_ptr(), token.as_ptr());
    unsafe {
        let it = fmi3InstantiateCoSimulation(name, token, null(), no, no, no, no, null(), 0, null_mut(), None, None);
        assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), OK);
        assert_eq!(fmi3ExitInitializationMode(it), OK);
        for k in [0.0, 1.0] {
            let (mut rate, mut stop, mut time) = (0.0, [no; 3], 0.0);
            assert_eq!(fmi3GetOutputDerivatives(it, &AREA, 1, &1, &mut rate, 1), OK);
            let (_, z) = get(it, &[AREA - 1], 1);
            assert!(
                (rate / z[0] - 1.0).abs() < 1e-6 && (z[0] / (5.0 * (-k * 0.1_f64).exp()) - 1.0).abs() < 1e-6,
                "{rate}"
            );
            let [events, end, early] = &mut stop;
            assert_eq!(fmi3DoStep(it, k * 0.1, 0.1, no, events, end, early, &mut time), OK);
        }
        fmi3FreeInstance(it);
    }
}
