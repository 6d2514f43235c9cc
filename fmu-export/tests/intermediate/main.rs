//! Intermediate update of FMI 3.0: the importer reads and sets variables inside a communication step, and ends it; forbidden
//! calls there fail without side effects.
#![allow(missing_docs, clippy::float_cmp, clippy::borrow_as_ptr, clippy::type_complexity)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

#[path = "../common/journal.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod journal;
#[path = "../common/oracle.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod oracle;
mod random;

use fmu_core::unit::{METER, METER_PER_S, ONE};
use fmu_core::*;
use fmu_export::abi::types::*;
use journal::{Journal, log3};
use serde::{Deserialize, Serialize};
use std::cell::{Cell, RefCell};
use std::ffi::CString;
use std::ptr::{null, null_mut};
use std::rc::Rc;

/// x' = u - x, in substeps of 10 ms.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Lag {
    u: f64,
    on: bool,
    x: f64,
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    x: f64,
    twice: f64,
}

type V = Row<Block<Lag>>;

const TIME: u32 = 0;
const U: u32 = 1;
const ON: u32 = 2;
const X: u32 = 3;
const TWICE: u32 = 4;
const HELD: u32 = 5;

impl Model for Lag {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Lag", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("u", &METER, "Input", |m| &mut m.model.u).intermediate(),
        V::boolean_input("on", "Without effect", |m| &mut m.model.on),
        V::output("x", &METER, "State", |m| &mut m.out.x).intermediate(),
        V::output("twice", &METER, "Twice the state", |m| &mut m.out.twice),
        V::input("held", &ONE, "Without effect", |m| &mut m.model.x).optional(),
    ];

    fn initialize(&mut self) {
        self.x = 0.0;
    }

    fn output(&self, _: Elapsed, out: &mut Outputs) {
        *out = Outputs { x: self.x, twice: 2.0 * self.x };
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, 1>(self, step, 1e-2)
    }
}

impl ContinuousTime for Lag {
    const STATES: &'static [State<Self>] = &[State::new("x", &METER_PER_S, |m| &mut m.x)];

    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        if self.u > 1e6 {
            return Err(Fault::new("u is too large"));
        }
        dx[0] = self.u - self.x;
        Ok(())
    }
}

impl Intermediate for Lag {
    fn longest(&self) -> f64 {
        1e-2
    }
}

fmu_export::export!(Lag: ContinuousTime + Intermediate);

use fmi::*;

const OK: c_int = 0;
const ERROR: c_int = 3;

/// The arguments of the callback.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Heard {
    time: f64,
    flags: [u8; 4],
}

type Act = Box<dyn Fn(InstancePointer, f64) -> Option<f64>>;

/// An importer with a callback; the environment of its instance.
#[repr(C)]
struct Importer {
    // The first field: the logger takes the environment for a journal.
    journal: Journal,
    it: Cell<InstancePointer>,
    heard: RefCell<Vec<Heard>>,
    act: Act,
}

extern "C" fn update(
    environment: *mut c_void,
    time: f64,
    set: Fmi3Boolean,
    get: Fmi3Boolean,
    finished: Fmi3Boolean,
    can_return: Fmi3Boolean,
    requested: *mut Fmi3Boolean,
    until: *mut f64,
) {
    let importer = unsafe { &*environment.cast::<Importer>() };
    importer.heard.borrow_mut().push(Heard { time, flags: [set.0, get.0, finished.0, can_return.0] });
    if let Some(end) = (importer.act)(importer.it.get(), time) {
        unsafe {
            *requested = Fmi3Boolean(1);
            *until = end;
        }
    }
}

#[derive(Debug, PartialEq)]
struct Stepped {
    status: c_int,
    early: bool,
    end: f64,
}

impl Importer {
    /// An instance in Step Mode at 0 s; `early`: steps may end early.
    fn start(early: bool, required: &[u32], called: bool, act: Act) -> Rc<Self> {
        let importer = Self::open(early, required, called, act);
        assert!(!importer.it.get().is_null(), "{:?}", importer.journal.0.borrow());
        let (it, no) = (importer.it.get(), Fmi3Boolean(0));
        unsafe {
            assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), OK);
            assert_eq!(fmi3ExitInitializationMode(it), OK);
        }
        importer
    }

    fn open(early: bool, required: &[u32], called: bool, act: Act) -> Rc<Self> {
        fmu_export::abi::quiet();
        drop(std::panic::take_hook());
        let importer =
            Rc::new(Self { journal: Journal::default(), it: Cell::new(null_mut()), heard: RefCell::default(), act });
        let token = CString::new(This::TOKEN.as_str()).unwrap();
        let (no, early) = (Fmi3Boolean(0), Fmi3Boolean(early.into()));
        let it = unsafe {
            fmi3InstantiateCoSimulation(
                c"lag".as_ptr(),
                token.as_ptr(),
                null(),
                no,
                no,
                no,
                early,
                required.as_ptr(),
                required.len(),
                (&raw const *importer).cast_mut().cast(),
                Some(log3),
                called.then_some(update),
            )
        };
        importer.it.set(it);
        importer
    }

    fn step(&self, t: f64, h: f64) -> Stepped {
        let (mut event, mut end, mut early, mut last) = (Fmi3Boolean(9), Fmi3Boolean(9), Fmi3Boolean(9), f64::NAN);
        let no = Fmi3Boolean(0);
        let status = unsafe { fmi3DoStep(self.it.get(), t, h, no, &mut event, &mut end, &mut early, &mut last) };
        assert!(status != OK || (event.0, end.0) == (0, 0));
        Stepped { status, early: early.0 == 1, end: last }
    }

    fn get(&self, vr: u32) -> f64 {
        get(self.it.get(), vr).unwrap()
    }

    fn errors(&self) -> Vec<String> {
        self.journal.0.borrow_mut().drain(..).map(|m| m.text).collect()
    }
}

impl Drop for Importer {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.it.get()) }
    }
}

fn get(it: InstancePointer, vr: u32) -> Option<f64> {
    let mut x = f64::NAN;
    let status = unsafe { fmi3GetFloat64(it, &raw const vr, 1, &raw mut x, 1) };
    (status == OK).then_some(x)
}

fn set(it: InstancePointer, vr: u32, x: f64) -> c_int {
    unsafe { fmi3SetFloat64(it, &raw const vr, 1, &raw const x, 1) }
}

fn silent() -> Act {
    Box::new(|_, _| None)
}

/// Bits of the state after steps of these sizes, the input being a sine of the communication points.
fn run(called: bool, early: bool, act: Act) -> (Vec<u64>, Vec<Heard>) {
    let importer = Importer::start(early, &[], called, act);
    let (mut bits, mut t) = (Vec::new(), 0.0_f64);
    for h in [0.1, 0.07, 0.005, 0.0999, 1.0, 1e-4].into_iter().cycle().take(60) {
        assert_eq!(set(importer.it.get(), U, t.sin()), OK);
        assert_eq!(importer.step(t, h), Stepped { status: OK, early: false, end: t + h });
        t += h;
        bits.extend([importer.get(X).to_bits(), importer.get(TWICE).to_bits(), importer.get(TIME).to_bits()]);
    }
    (bits, importer.heard.take())
}

#[test]
fn a_silent_callback_changes_no_bit() {
    let (plain, heard) = run(false, false, silent());
    assert!(heard.is_empty());
    for early in [false, true] {
        let (called, heard) = run(true, early, silent());
        assert_eq!(called, plain);
        // 10 + 7 + 1 + 10 + 100 + 1 substeps, ten times.
        assert_eq!(heard.len(), 1290);
        assert!(heard.iter().all(|heard| heard.flags == [1, 1, 1, early.into()]));
        assert!(heard.is_sorted_by(|a, b| a.time < b.time));
        assert_eq!(&heard[9..11].iter().map(|h| h.time).collect::<Vec<_>>(), &[0.1, 0.1 + 0.07 / 7.0]);
    }
}

/// Inside a step `x` follows; variables that are not intermediate keep the value of the last communication point.
#[test]
fn values_inside_are_those_of_the_instant() {
    let act = |it: InstancePointer, time: f64| {
        assert_eq!(get(it, TIME), Some(time));
        let x = get(it, X).unwrap();
        assert!((x - (1.0 - (-time).exp())).abs() < 1e-9, "{x} at {time}");
        assert_eq!(get(it, TWICE), Some(0.0));
        let mut rate = f64::NAN;
        assert_eq!(unsafe { fmi3GetOutputDerivatives(it, &X, 1, &1, &raw mut rate, 1) }, OK);
        assert!((rate - (1.0 - x)).abs() < 1e-8);
        None
    };
    let importer = Importer::start(false, &[X, TWICE, U], true, Box::new(act));
    assert_eq!(set(importer.it.get(), U, 1.0), OK);
    assert_eq!(importer.step(0.0, 0.5).status, OK);
    assert_eq!(importer.heard.borrow().len(), 50);
    assert_eq!(importer.get(TWICE), 2.0 * importer.get(X));
}

/// x' = u - x with u = t: x = t - 1 + exp(-t).
#[test]
fn a_ramp_that_is_set_inside_is_ten_times_better_than_one_that_is_held() {
    let error = |act: Act| {
        let importer = Importer::start(false, &[U], true, act);
        let mut worst = 0.0_f64;
        for k in 0..20 {
            let t = f64::from(k) * 0.1;
            assert_eq!(set(importer.it.get(), U, t), OK);
            let end = importer.step(t, 0.1).end;
            worst = worst.max((importer.get(X) - (end - 1.0 + (-end).exp())).abs());
        }
        worst
    };
    let held = error(silent());
    let ramp = error(Box::new(|it, time| {
        assert_eq!(set(it, U, time + 0.005), OK);
        None
    }));
    assert!(held > 0.02 && ramp * 10.0 < held, "{held} {ramp}");
}

#[test]
fn the_importer_ends_a_step() {
    // (requested at 30 ms, the step to 100 ms ends there)
    for (until, calls) in [(0.03, 3), (0.0425, 5), (0.1, 10)] {
        let act: Act = Box::new(move |_, time| (time == 0.03).then_some(until));
        let importer = Importer::start(true, &[], true, act);
        assert_eq!(set(importer.it.get(), U, 1.0), OK);
        let stepped = importer.step(0.0, 0.1);
        assert_eq!(stepped, Stepped { status: OK, early: until < 0.1, end: until });
        assert_eq!(importer.heard.borrow().len(), calls, "{:?}", importer.heard.borrow());
        assert_eq!((importer.get(TIME), importer.get(TWICE)), (until, 2.0 * importer.get(X)));
        assert!((importer.get(X) - (1.0 - (-until).exp())).abs() < 1e-9);
        // The next step begins there.
        assert_eq!(importer.step(until, 0.2 - until).end, 0.2);
        assert!((importer.get(X) - (1.0 - (-0.2_f64).exp())).abs() < 1e-9);
    }
    for outside in [0.0, 0.029_999, 0.100_1, f64::NAN, f64::INFINITY] {
        let importer = Importer::start(true, &[], true, Box::new(move |_, time| (time == 0.03).then_some(outside)));
        assert_eq!(importer.step(0.0, 0.1).status, ERROR);
        assert!(importer.errors()[0].contains("earlyReturnTime"));
    }
    // Not allowed at instantiation, so the answer is ignored.
    let importer = Importer::start(false, &[], true, Box::new(|_, _| Some(0.05)));
    assert_eq!(importer.step(0.0, 0.1), Stepped { status: OK, early: false, end: 0.1 });
}

#[test]
fn only_variables_of_the_list_are_for_the_inside() {
    let refused: [(&str, fn(InstancePointer) -> c_int); 7] = [
        ("x is not one of the requiredIntermediateVariables", |it| unsafe { fmi3GetFloat64(it, &X, 1, &mut 0.0, 1) }),
        ("u is not one of the requiredIntermediateVariables", |it| set(it, U, 1.0)),
        ("held cannot be set inside a step", |it| set(it, HELD, 1.0)),
        ("on is not one of the", |it| unsafe { fmi3SetBoolean(it, &ON, 1, &Fmi3Boolean(1), 1) }),
        ("twice cannot be set inside a step", |it| set(it, TWICE, 1.0)),
        ("x is not one of the", |it| unsafe { fmi3GetOutputDerivatives(it, &X, 1, &1, &mut 0.0, 1) }),
        ("variable 76 is not one of the", |it| set(it, 77, 1.0)),
    ];
    for (why, call) in refused {
        let importer = Importer::start(
            true,
            &[TWICE, HELD],
            true,
            Box::new(move |it, _| {
                assert_eq!(call(it), ERROR);
                None
            }),
        );
        assert_eq!(importer.step(0.0, 0.1).status, ERROR);
        assert_eq!(importer.heard.borrow().len(), 1, "the step is over");
        let errors = importer.errors();
        assert!(errors.len() == 2 && errors[0].contains(why), "{why}: {errors:?}");
        assert!(errors[1].contains("fmi3DoStep: a call of the callback failed"), "{errors:?}");
        assert_eq!(importer.step(0.0, 0.1).status, ERROR);
    }
    let importer = Importer::open(false, &[X, 88], true, silent());
    assert!(importer.it.get().is_null());
    assert!(importer.errors()[0].contains("value reference 88 does not exist"));
    // Without a callback the list has no meaning.
    assert!(!Importer::open(false, &[X, TWICE], false, silent()).it.get().is_null());
    let importer = Importer::open(false, &[], true, silent());
    assert!(!importer.it.get().is_null());
}

/// Calls for the time between two calls fail inside one, and the step with it. Nothing is freed; a reset recovers the instance.
#[test]
fn other_calls_are_refused_inside() {
    type Refused = fn(InstancePointer) -> c_int;
    let refused: [(&str, Refused); 12] = [
        ("fmi3DoStep", |it| {
            let [mut a, mut b, mut c] = [Fmi3Boolean(0); 3];
            unsafe { fmi3DoStep(it, 0.0, 0.1, Fmi3Boolean(0), &mut a, &mut b, &mut c, &mut 0.0) }
        }),
        ("fmi3Reset", |it| unsafe { fmi3Reset(it) }),
        ("fmi3Terminate", |it| unsafe { fmi3Terminate(it) }),
        ("fmi3EnterInitializationMode", |it| unsafe {
            fmi3EnterInitializationMode(it, Fmi3Boolean(0), 0.0, 0.0, Fmi3Boolean(0), 0.0)
        }),
        ("fmi3ExitInitializationMode", |it| unsafe { fmi3ExitInitializationMode(it) }),
        ("fmi3EnterEventMode", |it| unsafe { fmi3EnterEventMode(it) }),
        ("fmi3EnterStepMode", |it| unsafe { fmi3EnterStepMode(it) }),
        ("fmi3GetFMUState", |it| unsafe { fmi3GetFMUState(it, &mut null_mut()) }),
        ("fmi3SetFMUState", |it| unsafe { fmi3SetFMUState(it, null_mut()) }),
        ("fmi3GetDirectionalDerivative", |it| unsafe {
            fmi3GetDirectionalDerivative(it, &X, 1, &U, 1, &1.0, 1, &mut 0.0, 1)
        }),
        ("fmi3SetDebugLogging", |it| unsafe { fmi3SetDebugLogging(it, Fmi3Boolean(0), 0, null()) }),
        ("fmi3GetContinuousStates", |it| unsafe { fmi3GetContinuousStates(it, &mut 0.0, 1) }),
    ];
    for (name, call) in refused {
        let other = Importer::start(false, &[], true, silent());
        let importer = Importer::start(
            true,
            &[X],
            true,
            Box::new(move |it, _| {
                assert_eq!(call(it), ERROR, "{name}");
                // Not even the calls that leave the Error state.
                assert_eq!(unsafe { fmi3Reset(it) }, ERROR, "{name}");
                assert_eq!(get(it, X), None, "{name}");
                unsafe { fmi3FreeInstance(it) };
                None
            }),
        );
        assert_eq!(importer.step(0.0, 0.1).status, ERROR, "{name}");
        assert!(importer.errors()[0].contains(name), "{name}");
        let it = importer.it.get();
        assert_eq!(importer.step(0.0, 0.1).status, ERROR, "{name}");
        unsafe { assert_eq!(fmi3Reset(it), OK, "{name}") };
        assert_eq!(other.step(0.0, 0.1).status, OK);
    }
}

#[test]
fn a_callback_that_frees_frees_nothing() {
    let importer = Importer::start(
        true,
        &[X],
        true,
        Box::new(|it, _| {
            unsafe { fmi3FreeInstance(it) };
            assert!(get(it, X).is_some());
            None
        }),
    );
    assert_eq!(importer.step(0.0, 0.1), Stepped { status: OK, early: false, end: 0.1 });
    assert_eq!(importer.heard.borrow().len(), 10);
}

/// A model that fails inside a step: the callback is not called again.
#[test]
fn a_fault_ends_the_step() {
    let importer = Importer::start(
        true,
        &[U],
        true,
        Box::new(|it, time| {
            assert_eq!(set(it, U, if time > 0.045 { 2e6 } else { 1.0 }), OK);
            None
        }),
    );
    assert_eq!(importer.step(0.0, 0.1).status, ERROR);
    assert_eq!(importer.heard.borrow().len(), 5);
    assert!(importer.errors()[0].contains("u is too large"));
}

#[test]
fn the_description_says_so() {
    let description = Description::exported::<This>().unwrap();
    let marked: Vec<&str> = description.variables.iter().filter(|v| v.intermediate).map(|v| &*v.name).collect();
    assert_eq!(marked, ["u", "x"]);
}
