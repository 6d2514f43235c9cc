//! Structural parameters, arrays whose sizes they determine, and arrays of states.
#![allow(missing_docs)]
#![allow(
    clippy::float_cmp,
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

#[path = "../counting/mod.rs"]
#[allow(dead_code, reason = "a module of several test programs, each of which uses a part")]
mod counting;
#[path = "../common/oracle.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod oracle;
mod random;

use fmi::*;
use fmu_core::unit::{ONE, PER_SECOND};
use fmu_core::{
    Block, ContinuousTime, Description, Elapsed, Exported, Fault, Info, Items, Model, Part, Resizable, Row, State,
    Step, Table, integrate, table,
};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use std::ffi::CString;
use std::ptr::{null, null_mut};
use std::sync::Once;

/// A map of any size, inside a part: it has more elements than a table has indices.
#[derive(Clone, Serialize, Deserialize)]
struct Map {
    rows: u64,
    values: Vec<f64>,
}

/// A number of rows at which the model panics.
const UNLUCKY: u64 = 13;

/// A chain of `n` decays.
#[derive(Clone, Serialize, Deserialize)]
struct Chain {
    map: Map,
    n: u64,
    k: u64,
    gains: Vec<f64>,
    marks: Vec<i32>,
    x: Vec<f64>,
    z: f64,
}

impl Default for Chain {
    fn default() -> Self {
        let map = Map { rows: 2, values: Vec::new() };
        let (gains, marks, x) = (Vec::new(), Vec::new(), Vec::new());
        let mut fresh = Self { map, n: 2, k: 2, gains, marks, x, z: 0.0 };
        fresh.resize().unwrap();
        fresh
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    y: Vec<f64>,
}

type V = Row<Block<Chain>>;
type P = Row<Map>;

const MAP: &Table<Map> = table![
    P::structural("rows", "Number of rows", |m| &mut m.rows).at_least(1.0).at_most(200.0),
    P::array_parameter("values", &ONE, "A value for each row", 200, |m| &mut m.values).sized(&["rows"]),
];

impl Model for Chain {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Chain", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::part("map.", &Part { table: MAP, lens: |m: &mut Block<Chain>| &mut m.model.map }),
        V::structural("n", "Number of states", |m| &mut m.model.n).at_most(5.0).tunable(),
        V::structural("k", "Number of outputs", |m| &mut m.model.k).at_most(4.0),
        V::array_parameter("gains", &ONE, "Gains", 20, |m| &mut m.model.gains).sized(&["k", "n"]).tunable(),
        V::list_parameter("marks", "Marks", 4, &Items(|m: &mut Block<Chain>| &mut m.model.marks)).sized(&["k"]),
        V::array_local("x", &ONE, "States", 5, |m| &mut m.model.x).sized(&["n"]).at_least(-1e3).nominal(2.0),
        V::state("z", &ONE, "One more state", |m| &mut m.model.z).nominal(3.0),
        V::array_output("y", &ONE, "gains x", 4, |m| &mut m.out.y).sized(&["k"]),
    ];
    fn initialize(&mut self) {
        self.x = (1_u8..).take(self.x.len()).map(f64::from).collect();
        self.z = 10.0;
    }
    fn output(&self, _: Elapsed, out: &mut Outputs) {
        let n = self.x.len();
        let row = |i: usize| self.x.iter().zip(&self.gains[i * n..]).map(|(x, gain)| gain * x).sum();
        out.y = (0..self.marks.len()).map(row).collect();
    }
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, 6>(self, step, 0.01)
    }
}

impl ContinuousTime for Chain {
    const STATES: &'static [State<Self>] = &[
        State::array("x", &PER_SECOND, 5, |m: &mut Self| &mut m.x),
        State::new("z", &PER_SECOND, |m: &mut Self| &mut m.z),
    ];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        let (array, z) = dx.split_at_mut(self.x.len());
        for (i, (dx, x)) in array.iter_mut().zip(&self.x).enumerate() {
            *dx = if i > 0 { self.x[i - 1] - x } else { -x };
        }
        z[0] = -self.z;
        Ok(())
    }
}

impl Resizable for Chain {
    fn resize(&mut self) -> Result<(), Fault> {
        let (n, k) = (usize::try_from(self.n).unwrap(), usize::try_from(self.k).unwrap());
        if n == 5 && k == 4 {
            return Err(Fault::new("five states have at most three outputs"));
        }
        assert!(self.map.rows != UNLUCKY, "a model with a mistake");
        (self.gains, self.marks) = (vec![1.0; n * k], vec![7; k]);
        self.map.values = vec![0.5; usize::try_from(self.map.rows).unwrap()];
        self.x = (1_u8..).take(n).map(f64::from).collect();
        Ok(())
    }
}

fmu_export::export!(Chain: ContinuousTime + Resizable);

const ROWS: u32 = 1;
const N: u32 = 2;
const K: u32 = 3;
const GAINS: u32 = 4;
const MARKS: u32 = GAINS + 20;
const X: u32 = MARKS + 4;
const Z: u32 = X + 5;
const Y: u32 = Z + 1;
const DER_X: u32 = Y + 4;
const DER_Z: u32 = DER_X + 5;
const VALUES: u32 = DER_Z + 1;

const OK: c_int = 0;
const ERROR: c_int = 3;
const NO: Fmi3Boolean = Fmi3Boolean(0);

/// An instance of FMI 3.0, in its own state machine.
struct It(InstancePointer);

impl It {
    fn new(exchange: bool) -> Self {
        // The library silences panics; a test needs its own.
        static LOUD: Once = Once::new();
        LOUD.call_once(|| {
            fmu_export::abi::quiet();
            drop(std::panic::take_hook());
        });
        let token = CString::new(This::TOKEN.as_str()).unwrap();
        let (name, token, no) = (c"it".as_ptr(), token.as_ptr(), NO);
        Self(unsafe {
            if exchange {
                fmi3InstantiateModelExchange(name, token, null(), no, no, null_mut(), None)
            } else {
                fmi3InstantiateCoSimulation(name, token, null(), no, no, no, no, null(), 0, null_mut(), None, None)
            }
        })
    }

    fn begun(exchange: bool) -> Self {
        let it = Self::new(exchange);
        assert_eq!(it.begin(), OK);
        it
    }

    fn begin(&self) -> c_int {
        unsafe {
            assert_eq!(fmi3EnterInitializationMode(self.0, NO, 0.0, 0.0, NO, 0.0), OK);
            fmi3ExitInitializationMode(self.0)
        }
    }

    fn enter(&self) -> c_int {
        unsafe { fmi3EnterConfigurationMode(self.0) }
    }

    fn exit(&self) -> c_int {
        unsafe { fmi3ExitConfigurationMode(self.0) }
    }

    fn set_sizes(&self, references: &[u32], values: &[u64]) -> c_int {
        unsafe { fmi3SetUInt64(self.0, references.as_ptr(), references.len(), values.as_ptr(), values.len()) }
    }

    fn size(&self, reference: u32) -> u64 {
        let mut value = u64::MAX;
        assert_eq!(unsafe { fmi3GetUInt64(self.0, &reference, 1, &mut value, 1) }, OK);
        value
    }

    /// The values, and the memory after them.
    fn get(&self, reference: u32, n: usize) -> (c_int, Vec<f64>) {
        let mut values = vec![-7.0; n + 2];
        let status = unsafe { fmi3GetFloat64(self.0, &reference, 1, values.as_mut_ptr(), n) };
        let canary = values.split_off(n);
        assert_eq!(canary, [-7.0, -7.0], "{reference}: written beyond {n}");
        (status, values)
    }

    fn values(&self, reference: u32, n: usize) -> Vec<f64> {
        let (status, values) = self.get(reference, n);
        assert_eq!(status, OK, "{reference} has {n} values");
        values
    }

    fn set(&self, reference: u32, values: &[f64]) -> c_int {
        unsafe { fmi3SetFloat64(self.0, &reference, 1, values.as_ptr(), values.len()) }
    }

    fn step(&self, t: f64, h: f64) -> c_int {
        let (mut no, mut early, mut end, mut time) = (NO, NO, NO, 0.0);
        unsafe { fmi3DoStep(self.0, t, h, NO, &mut no, &mut end, &mut early, &mut time) }
    }

    /// A saved state, written to bytes and read from them.
    fn through_bytes(&self, state: *mut c_void) -> *mut c_void {
        let (mut size, mut again) = (0, null_mut());
        unsafe {
            assert_eq!(fmi3SerializedFMUStateSize(self.0, state, &mut size), OK);
            let mut bytes = vec![0; size];
            assert_eq!(fmi3SerializeFMUState(self.0, state, bytes.as_mut_ptr(), size), OK);
            assert_eq!(fmi3DeserializeFMUState(self.0, bytes.as_ptr(), size, &mut again), OK);
        }
        again
    }

    fn count(&self) -> usize {
        let mut n = usize::MAX;
        assert_eq!(unsafe { fmi3GetNumberOfContinuousStates(self.0, &mut n) }, OK);
        n
    }
}

impl Drop for It {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.0) }
    }
}

/// 1, 2, 3 and so on.
fn counted(n: usize) -> Vec<f64> {
    (1_u8..).take(n).map(f64::from).collect()
}

/// One reference for every element at the maximum sizes.
#[test]
fn references_do_not_move_with_the_sizes() {
    let d = Description::exported::<This>().unwrap();
    let names: Vec<_> = d.variables.iter().map(|v| (v.name.as_str(), v.value_reference, v.shape.clone())).collect();
    let expected: [(&str, u32, &[usize]); 11] = [
        ("map.rows", ROWS, &[]),
        ("n", N, &[]),
        ("k", K, &[]),
        ("gains", GAINS, &[2, 2]),
        ("marks", MARKS, &[2]),
        ("x", X, &[2]),
        ("z", Z, &[]),
        ("y", Y, &[2]),
        ("der(x)", DER_X, &[2]),
        ("der(z)", DER_Z, &[]),
        ("map.values", VALUES, &[2]),
    ];
    assert_eq!(names, expected.map(|(name, reference, shape)| (name, reference, shape.to_vec())));
    let sized = |name: &str| d.variable(name).unwrap().sized.clone();
    assert_eq!((sized("gains"), sized("der(x)"), sized("map.values")), (vec![K, N], vec![N], vec![ROWS]));
    let exchange = d.model_exchange.as_ref().unwrap();
    assert_eq!((&exchange.states[..], &exchange.derivatives[..]), (&[X, Z][..], &[DER_X, DER_Z][..]));
    // One tunable parameter is listed with all.
    assert_eq!(d.variable("y").unwrap().dependencies, Some((GAINS..=23).chain([X, X + 1]).collect()));
    assert_eq!(d.variable("der(x)").unwrap().dependencies, Some(vec![X, X + 1]));
}

/// Every size, before the start and in the simulation: it applies to arrays from the exit on, and one value more or less is an
/// Error without writes.
#[test]
fn arrays_have_the_sizes_that_were_set() {
    for (n, k) in (0..=5).flat_map(|n| (0..=4).map(move |k| (n, k))).filter(|&(n, k)| (n, k) != (5, 4)) {
        let it = It::new(false);
        assert_eq!((it.enter(), it.set_sizes(&[N, K, ROWS], &[n, k, 190])), (OK, OK));
        assert_eq!((it.size(N), it.values(GAINS, 4), it.values(VALUES, 2)), (n, vec![1.0; 4], vec![0.5; 2]), "held");
        assert_eq!(it.exit(), OK);
        let (n, k) = (usize::try_from(n).unwrap(), usize::try_from(k).unwrap());
        assert_eq!((it.values(GAINS, n * k), it.values(VALUES, 190)), (vec![1.0; n * k], vec![0.5; 190]));
        assert_eq!((it.values(X, n), it.begin()), (counted(n), OK));
        assert_eq!(it.values(DER_X, n), vec![-1.0; n], "each is one above the state before it");
        let sum: f64 = counted(n).iter().sum();
        assert_eq!((it.values(Y, k), it.step(0.0, 0.1)), (vec![sum; k], OK));
        for (reference, count) in [(GAINS, n * k), (X, n), (Y, k), (DER_X, n), (VALUES, 190)] {
            for wrong in [count + 1, count.saturating_sub(1)].into_iter().filter(|wrong| *wrong != count) {
                let other = It::new(false);
                assert_eq!((other.enter(), other.set_sizes(&[N, K, ROWS], &[n as u64, k as u64, 190])), (OK, OK));
                assert_eq!((other.exit(), other.get(reference, wrong)), (OK, (ERROR, vec![-7.0; wrong])));
            }
        }
        let mut marks = [0; 4];
        assert_eq!(unsafe { fmi3GetInt32(it.0, &MARKS, 1, marks.as_mut_ptr(), k) }, OK);
        assert_eq!(marks[..k], [7; 4][..k]);
        // While it runs.
        let m = (n + 2) % 4;
        let x = it.values(X, n);
        assert_eq!((it.enter(), it.set_sizes(&[N], &[m as u64]), it.values(X, n)), (OK, OK, x));
        assert_eq!((it.exit(), it.values(X, m), it.values(Z, 1).len()), (OK, counted(m), 1));
        assert_eq!((it.step(0.1, 0.1), it.values(X, m).len()), (OK, m));
    }
}

/// A type that the model does not have is refused where there is a value.
#[test]
fn an_empty_array_has_no_value_of_a_wrong_type() {
    for (k, status) in [(0, OK), (1, ERROR)] {
        let number = usize::try_from(k).unwrap();
        let sized = || {
            let it = It::new(false);
            assert_eq!((it.enter(), it.set_sizes(&[N, K], &[1, k]), it.exit()), (OK, OK, OK));
            it
        };
        let mut flag = Fmi3Boolean(0);
        assert_eq!(unsafe { fmi3GetBoolean(sized().0, &GAINS, 1, &mut flag, number) }, status, "{k}");
        assert_eq!(unsafe { fmi3SetBoolean(sized().0, &GAINS, 1, &flag, number) }, status, "{k}");
    }
}

/// A size above its bound is refused before memory is allocated, except for the message.
#[test]
fn sizes_are_judged() {
    let it = It::new(false);
    assert_eq!((it.enter(), it.set_sizes(&[N, ROWS], &[5, 200]), counting::largest() > 0), (OK, OK, true));
    assert_eq!((it.exit(), counting::largest()), (OK, 200 * 8));
    for (reference, size) in [(N, 6), (N, 1 << 32), (N, u64::MAX), (K, 5), (ROWS, 0), (ROWS, 201)] {
        for configuration in [true, false] {
            let it = It::new(false);
            if configuration {
                assert_eq!(it.enter(), OK);
            }
            counting::largest();
            assert_eq!(it.set_sizes(&[reference], &[size]), ERROR, "{reference} = {size}");
            let asked = counting::largest();
            assert!(asked < 256, "{reference} = {size}: {asked} bytes");
        }
    }
    // The model refuses combinations that bounds cannot express, without side effects.
    let it = It::new(false);
    assert_eq!((it.enter(), it.set_sizes(&[N, K], &[5, 4]), it.exit()), (OK, OK, ERROR));
    assert_eq!(it.values(GAINS, 4), [1.0; 4]);
    assert_eq!((unsafe { fmi3Reset(it.0) }, it.size(N), it.begin()), (OK, 2, OK));
}

/// A model that panics while it resizes: Error, in both modes. Nothing has changed, a reset makes the instance usable, and
/// others are unaffected.
#[test]
fn a_panic_while_sizes_change_is_an_error() {
    let other = It::begun(false);
    let y = other.values(Y, 2);
    for at_once in [false, true] {
        let it = It::new(false);
        if at_once {
            assert_eq!(it.set_sizes(&[N, ROWS], &[3, UNLUCKY]), ERROR);
            assert_eq!((it.size(N), it.size(ROWS)), (2, 2));
        } else {
            assert_eq!((it.enter(), it.set_sizes(&[N, ROWS], &[3, UNLUCKY]), it.exit()), (OK, OK, ERROR));
        }
        assert_eq!((it.values(GAINS, 4), it.values(VALUES, 2)), (vec![1.0; 4], vec![0.5; 2]));
        assert_eq!((it.enter(), unsafe { fmi3EnterInitializationMode(it.0, NO, 0.0, 0.0, NO, 0.0) }), (ERROR, ERROR));
        assert_eq!((unsafe { fmi3Reset(it.0) }, it.size(ROWS), it.begin()), (OK, 2, OK));
        assert_eq!((it.step(0.0, 0.1), it.values(X, 2).len()), (OK, 2));
    }
    assert_eq!((other.values(Y, 2), other.step(0.0, 0.1)), (y, OK));
}

#[test]
fn each_mode_takes_its_own_parameters() {
    let refused = |begun: bool, work: &dyn Fn(&It) -> c_int| {
        let it = if begun { It::begun(false) } else { It::new(false) };
        assert_eq!(it.enter(), OK);
        assert_eq!(work(&it), ERROR);
    };
    refused(true, &|it| it.set_sizes(&[K], &[1]));
    refused(true, &|it| it.set_sizes(&[ROWS], &[3]));
    for begun in [false, true] {
        refused(begun, &It::enter);
        refused(begun, &|it| it.set(GAINS, &[1.0; 4]));
        refused(begun, &|it| it.step(0.0, 0.1));
        refused(begun, &|it| it.get(DER_X, 2).0);
        refused(begun, &|it| unsafe { fmi3EnterInitializationMode(it.0, NO, 0.0, 0.0, NO, 0.0) });
    }
    // Outside of both.
    for it in [It::begun(false), It::begun(true)] {
        assert_eq!(it.set_sizes(&[N], &[1]), ERROR);
    }
    assert_eq!(It::new(false).exit(), ERROR);
    let it = It::new(false);
    assert_eq!(unsafe { fmi3EnterInitializationMode(it.0, NO, 0.0, 0.0, NO, 0.0) }, OK);
    assert_eq!(it.enter(), ERROR);
    // FMPy sets all start values after the instantiation.
    let it = It::new(false);
    assert_eq!((it.set_sizes(&[N, K], &[3, 1]), it.set(GAINS, &[1.0, 2.0, 3.0]), it.begin()), (OK, OK, OK));
    assert_eq!(it.values(Y, 1), [14.0]);
    // Continuous-Time Mode has none.
    let it = It::begun(true);
    assert_eq!((unsafe { fmi3EnterContinuousTimeMode(it.0) }, it.enter()), (OK, ERROR));
}

/// The state of another size, from a handle and from bytes, and one of a mode that is not left.
#[test]
fn saved_states_have_their_sizes() {
    let save = |it: &It| {
        let mut state = null_mut();
        assert_eq!(unsafe { fmi3GetFMUState(it.0, &mut state) }, OK);
        state
    };
    let it = It::new(false);
    assert_eq!((it.enter(), it.set_sizes(&[N], &[4])), (OK, OK));
    let configuring = save(&it);
    assert_eq!((it.exit(), it.begin(), it.step(0.0, 0.1)), (OK, OK, OK));
    let (large, x) = (save(&it), it.values(X, 4));
    assert_eq!((it.enter(), it.set_sizes(&[N], &[1]), it.exit(), it.step(0.1, 0.1)), (OK, OK, OK, OK));
    let again = it.through_bytes(large);
    for state in [large, again] {
        assert_eq!((unsafe { fmi3SetFMUState(it.0, state) }, it.size(N)), (OK, 4));
        assert_eq!((it.values(X, 4), it.step(0.1, 0.1), it.values(Y, 2).len()), (x.clone(), OK, 2));
    }
    assert_eq!((unsafe { fmi3SetFMUState(it.0, configuring) }, it.values(X, 2).len()), (OK, 2));
    assert_eq!((it.exit(), it.values(X, 4), it.begin()), (OK, counted(4), OK));
    for mut state in [configuring, large, again] {
        assert_eq!(unsafe { fmi3FreeFMUState(it.0, &mut state) }, OK);
    }
}

/// All states in one array, in the order of the list; derivatives and sensitivities of the present ones.
#[test]
fn the_number_of_states_follows() {
    let it = It::begun(true);
    assert_eq!(it.count(), 3);
    assert_eq!((it.enter(), it.set_sizes(&[N], &[1]), it.exit()), (OK, OK, OK));
    for n in [1, 0, 4] {
        assert_eq!((it.enter(), it.set_sizes(&[N], &[n]), it.exit()), (OK, OK, OK));
        let n = usize::try_from(n).unwrap();
        assert_eq!(it.count(), n + 1);
        let (mut x, mut dx, mut nominals) = (vec![0.0; n + 1], vec![0.0; n + 1], vec![0.0; n + 1]);
        unsafe {
            assert_eq!(fmi3EnterContinuousTimeMode(it.0), OK);
            let states: Vec<f64> = (1_u8..).take(n + 1).map(|x| f64::from(x * x)).collect();
            assert_eq!(fmi3SetContinuousStates(it.0, states.as_ptr(), n + 1), OK);
            assert_eq!(fmi3GetContinuousStates(it.0, x.as_mut_ptr(), n + 1), OK);
            assert_eq!(fmi3GetContinuousStateDerivatives(it.0, dx.as_mut_ptr(), n + 1), OK);
            assert_eq!(fmi3GetNominalsOfContinuousStates(it.0, nominals.as_mut_ptr(), n + 1), OK);
            assert_eq!((&x, nominals.pop(), nominals), (&states, Some(3.0), vec![2.0; n]));
        }
        assert_eq!((it.values(X, n), it.values(Z, 1)), (x[..n].to_vec(), x[n..].to_vec()));
        assert_eq!((it.values(DER_X, n), it.values(DER_Z, 1)), (dx[..n].to_vec(), dx[n..].to_vec()));
        assert_eq!(dx[n], -x[n]);
        // A direction: every state by 1.
        let (mut sensitivity, seed) = (vec![0.0; n + 1], vec![1.0; n + 1]);
        let status = unsafe {
            let (unknowns, knowns) = ([DER_X, DER_Z], [X, Z]);
            let (seed, out) = (seed.as_ptr(), sensitivity.as_mut_ptr());
            fmi3GetDirectionalDerivative(it.0, unknowns.as_ptr(), 2, knowns.as_ptr(), 2, seed, n + 1, out, n + 1)
        };
        assert_eq!(status, OK);
        for (i, found) in sensitivity.iter().enumerate() {
            let expected = if i == 0 || i == n { -1.0 } else { 0.0 };
            assert!((found - expected).abs() < 1e-6, "{i} of {n}: {found}");
        }
        // A state out of its range is discarded, and no state changes.
        if n > 0 {
            let mut wild = x.clone();
            wild[n - 1] = -2e3;
            assert_eq!(unsafe { fmi3SetContinuousStates(it.0, wild.as_ptr(), n + 1) }, 2);
            assert_eq!(it.values(X, n), x[..n]);
        }
        assert_eq!(unsafe { fmi3EnterEventMode(it.0) }, OK);
    }
    let wrong = It::begun(true);
    assert_eq!(unsafe { fmi3GetContinuousStates(wrong.0, [0.0; 6].as_mut_ptr(), 6) }, ERROR);
}

/// The reference of an inner element is invalid.
#[test]
fn elements_have_no_reference_of_their_own() {
    for inner in [X + 1, DER_X + 1, DER_X + 4, GAINS + 19, VALUES + 1] {
        assert_eq!(It::begun(false).get(inner, 1).0, ERROR, "{inner}");
    }
}

/// FMI 2.0 has the sizes of the start, and scalars.
#[test]
fn fmi2_has_the_elements_of_the_start() {
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    let (name, no) = (c"it".as_ptr(), Fmi2Boolean(0));
    unsafe {
        let it = fmi2Instantiate(name, 1, token.as_ptr(), null(), null(), no, no);
        assert_eq!(fmi2SetupExperiment(it, no, 0.0, 0.0, no, 0.0), OK);
        assert_eq!(fmi2EnterInitializationMode(it), OK);
        let (mut n, mut values) = (Fmi2Integer(0), [0.0; 4]);
        assert_eq!(fmi2GetInteger(it, &N, 1, &mut n), OK);
        let references = [X, X + 1, DER_X + 1, Y + 1];
        assert_eq!(fmi2GetReal(it, references.as_ptr(), 4, values.as_mut_ptr()), OK);
        assert_eq!((n.0, values), (2, [1.0, 2.0, -1.0, 3.0]));
        assert_eq!(fmi2GetReal(it, &(X + 2), 1, values.as_mut_ptr()), ERROR);
        fmi2FreeInstance(it);
        let it = fmi2Instantiate(name, 1, token.as_ptr(), null(), null(), no, no);
        assert_eq!(fmi2SetInteger(it, &N, 1, &Fmi2Integer(3)), ERROR);
        fmi2FreeInstance(it);
    }
}
