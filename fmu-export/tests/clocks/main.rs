//! Clocks in Event Mode of Co-Simulation and Model Exchange, and in Scheduled Execution: every kind of clock, cell by cell.
#![allow(missing_docs, clippy::float_cmp, clippy::borrow_as_ptr)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod arguments;
mod calls;
#[path = "../counting/mod.rs"]
mod counting;
#[path = "../common/journal.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod journal;
#[path = "../common/oracle.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod oracle;
#[path = "../common/played.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod played;
mod random;
mod scheduled;
mod ticks;

use fmu_core::unit::{ONE, SECOND};
use fmu_core::*;
use fmu_export::abi::types::*;
use journal::{Journal, log3};
use serde::{Deserialize, Serialize};
use std::cell::{Cell, RefCell};
use std::ffi::CString;
use std::ptr::{null, null_mut};
use std::rc::Rc;

/// A model with a clock of every kind. The result of the last tick of `fixed` becomes visible at the next one.
#[derive(Clone, Serialize, Deserialize)]
struct Kinds {
    fixed: f64,
    tunable: f64,
    u: f64,
    x: f64,
    y: f64,
    computed: f64,
    counts: [i32; 8],
    due: Option<f64>,
    tripped: bool,
    panics: bool,
}

impl Default for Kinds {
    fn default() -> Self {
        let zero = 0.0;
        Self {
            fixed: 0.2,
            tunable: 0.3,
            u: zero,
            x: zero,
            y: zero,
            computed: zero,
            counts: [0; 8],
            due: None,
            tripped: false,
            panics: false,
        }
    }
}

type V = Row<Block<Kinds>>;

const CONSTANT: u32 = 1;
const FRACTION: u32 = 2;
const FIXED: u32 = 3;
const TUNABLE: u32 = 4;
const CHANGING: u32 = 5;
const COUNTDOWN: u32 = 6;
const TRIGGERED: u32 = 7;
const TRIP: u32 = 8;
const U: u32 = 9;
const X: u32 = 10;
const Y: u32 = 11;
const TICKS: u32 = 12;
const FREE: u32 = 13;
const PANICS: u32 = 15;
/// With this input, the clock `changing` has no interval; with a greater one of the other sign, a negative interval.
const BROKEN: f64 = 1e3;
const CLOCKS: [u32; 8] = [CONSTANT, FRACTION, FIXED, TUNABLE, CHANGING, COUNTDOWN, TRIGGERED, TRIP];

impl Model for Kinds {
    type Outputs = i32;
    const INFO: Info = Info { name: "Kinds", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::clock("constant", "", Clock::constant(0.1)).shift(0.05).priority(0),
        V::clock("fraction", "", Clock::fraction(1, 3)).shift(1.0).priority(1),
        V::clock("fixed", "", Clock::fixed(|m| &mut m.model.fixed)).priority(2),
        V::clock("tunable", "", Clock::tunable(|m| &mut m.model.tunable)).priority(3),
        V::clock("changing", "", Clock::changing()).priority(4),
        V::clock("countdown", "", Clock::countdown()).priority(5),
        V::clock("triggered", "", Clock::triggered()).priority(6),
        V::clock_output("trip", "Every second tick of triggered"),
        V::input("u", &ONE, "", |m| &mut m.model.u).on("fixed triggered"),
        V::input("x", &ONE, "", |m| &mut m.model.x),
        V::output("y", &ONE, "u of the tick before", |m| &mut m.model.y).on("fixed"),
        V::integer_output("ticks", "", |m| &mut m.out),
        V::state("free", &ONE, "", |m| &mut m.model.computed),
        V::calculated("T_fixed", &SECOND, "", |m| &mut m.model.fixed),
        V::boolean_parameter("panics", "", |m| &mut m.model.panics).tunable(),
    ];

    fn validate(&self) -> Result<(), Fault> {
        if self.fixed > 10.0 { Err(Fault::new("fixed is too long")) } else { Ok(()) }
    }

    fn initialize(&mut self) {
        *self = Self {
            fixed: self.fixed,
            tunable: self.tunable,
            u: self.u,
            x: self.x,
            panics: self.panics,
            ..Self::default()
        };
    }

    fn output(&self, _: Elapsed, ticks: &mut i32) {
        *ticks = self.counts.iter().sum();
    }

    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl Clocked for Kinds {
    fn activate(&mut self, clock: usize, _: Elapsed) {
        if clock == 2 {
            self.y = self.computed;
        }
    }

    fn tick(&mut self, clock: usize, now: Elapsed) -> Result<(), Fault> {
        assert!(!self.panics, "panics is set");
        self.counts[clock] += 1;
        match clock {
            2 => self.computed = self.u + self.x,
            5 => self.due = None,
            6 => {
                self.due = Some(now.seconds() + 0.25);
                self.tripped = self.counts[6] % 2 == 0;
            }
            _ => {}
        }
        Ok(())
    }

    fn interval(&self, clock: usize, now: Elapsed) -> Option<f64> {
        match clock {
            4 if self.x == BROKEN => None,
            4 if self.x < -BROKEN => Some(self.x),
            4 => Some(0.1 * f64::from(self.counts[4] + 1)),
            _ => self.due.map(|due| (due - now.seconds()).max(0.0)),
        }
    }

    fn ticked(&mut self, _: usize) -> bool {
        std::mem::take(&mut self.tripped)
    }
}

fmu_export::export!(Kinds: Clocked + ScheduledExecution);

use fmi::*;

const OK: c_int = 0;
const ERROR: c_int = 3;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Cs,
    Me,
    Se,
}

type Act = Box<dyn Fn(&Host)>;

/// An importer and its instance; the environment of the callbacks.
#[repr(C)]
struct Host {
    // The first field, because the logger treats the environment as a journal.
    journal: Journal,
    kind: Kind,
    it: Cell<InstancePointer>,
    updates: Cell<u32>,
    act: RefCell<Option<Act>>,
}

extern "C" fn clock_update(environment: *mut c_void) {
    let host = unsafe { &*environment.cast::<Host>() };
    host.updates.set(host.updates.get() + 1);
    if let Some(act) = &*host.act.borrow() {
        act(host);
    }
}

impl Host {
    fn open(kind: Kind) -> Rc<Self> {
        fmu_export::abi::quiet();
        drop(std::panic::take_hook());
        let host = Rc::new(Self {
            journal: Journal::default(),
            kind,
            it: Cell::new(null_mut()),
            updates: Cell::new(0),
            act: RefCell::default(),
        });
        let token = CString::new(This::TOKEN.as_str()).unwrap();
        let (name, token, no, yes) = (c"kinds".as_ptr(), token.as_ptr(), Fmi3Boolean(0), Fmi3Boolean(1));
        let (environment, log) = (Rc::as_ptr(&host).cast_mut().cast(), Some(log3 as Fmi3Logger));
        host.it.set(unsafe {
            match kind {
                Kind::Cs => {
                    fmi3InstantiateCoSimulation(name, token, null(), no, no, yes, no, null(), 0, environment, log, None)
                }
                Kind::Me => fmi3InstantiateModelExchange(name, token, null(), no, no, environment, log),
                Kind::Se => fmi3InstantiateScheduledExecution(
                    name,
                    token,
                    null(),
                    no,
                    no,
                    environment,
                    log,
                    Some(clock_update),
                    None,
                    None,
                ),
            }
        });
        assert!(!host.it.get().is_null(), "{:?}", host.journal.0.borrow());
        host
    }

    fn entered(kind: Kind) -> Rc<Self> {
        let host = Self::open(kind);
        let no = Fmi3Boolean(0);
        assert_eq!(unsafe { fmi3EnterInitializationMode(host.it.get(), no, 0.0, 0.0, no, 0.0) }, OK);
        host
    }

    /// In Event Mode, or in Clock Activation Mode.
    fn started(kind: Kind) -> Rc<Self> {
        let host = Self::entered(kind);
        assert_eq!(host.exit(), OK, "{:?}", host.errors());
        host
    }

    /// By a letter: i instantiated, n initialization, v event, s step or continuous time, a activation, t terminated, e error.
    fn in_state(kind: Kind, state: char) -> Rc<Self> {
        let host = match state {
            'i' => Self::open(kind),
            'n' => Self::entered(kind),
            _ => Self::started(kind),
        };
        match state {
            's' => {
                assert_eq!(host.update(), OK);
                assert_eq!(host.leave(), OK);
            }
            't' => assert_eq!(unsafe { fmi3Terminate(host.it.get()) }, OK),
            'e' => assert_eq!(host.exit(), ERROR),
            _ => {}
        }
        host.journal.0.borrow_mut().clear();
        host
    }

    fn exit(&self) -> c_int {
        unsafe { fmi3ExitInitializationMode(self.it.get()) }
    }

    fn update(&self) -> c_int {
        let ([mut a, mut b, mut c, mut d, mut e], mut next) = ([Fmi3Boolean(9); 5], 0.0);
        let it = self.it.get();
        let status = unsafe { fmi3UpdateDiscreteStates(it, &mut a, &mut b, &mut c, &mut d, &mut e, &mut next) };
        assert!(status != OK || e.0 == 0, "clocks are not time events");
        status
    }

    fn leave(&self) -> c_int {
        match self.kind {
            Kind::Cs => unsafe { fmi3EnterStepMode(self.it.get()) },
            _ => unsafe { fmi3EnterContinuousTimeMode(self.it.get()) },
        }
    }

    /// From Event Mode at `from` to Event Mode at `to`.
    fn proceed(&self, from: f64, to: f64) {
        assert_eq!(self.leave(), OK);
        let it = self.it.get();
        if self.kind == Kind::Cs {
            let ([mut a, mut b, mut c], mut last) = ([Fmi3Boolean(9); 3], 0.0);
            let status = unsafe { fmi3DoStep(it, from, to - from, Fmi3Boolean(0), &mut a, &mut b, &mut c, &mut last) };
            assert_eq!((status, a.0, c.0), (OK, 0, 0), "{:?}", self.errors());
        } else {
            assert_eq!(unsafe { fmi3SetTime(it, to) }, OK);
        }
        assert_eq!(unsafe { fmi3EnterEventMode(it) }, OK);
    }

    fn set_clock(&self, vr: u32, active: bool) -> c_int {
        unsafe { fmi3SetClock(self.it.get(), &vr, 1, &Fmi3Boolean(active.into())) }
    }

    fn clock(&self, vr: u32) -> Option<bool> {
        let mut active = Fmi3Boolean(9);
        (unsafe { fmi3GetClock(self.it.get(), &vr, 1, &mut active) } == OK).then_some(active.0 == 1)
    }

    fn interval(&self, vr: u32) -> Option<(f64, c_int)> {
        let (mut interval, mut qualifier) = (f64::NAN, -1);
        let status = unsafe { fmi3GetIntervalDecimal(self.it.get(), &vr, 1, &mut interval, &mut qualifier) };
        (status == OK).then_some((interval, qualifier))
    }

    fn set_interval(&self, vr: u32, interval: f64) -> c_int {
        unsafe { fmi3SetIntervalDecimal(self.it.get(), &vr, 1, &interval) }
    }

    fn activate(&self, vr: u32, t: f64) -> c_int {
        unsafe { fmi3ActivateModelPartition(self.it.get(), vr, t) }
    }

    fn set(&self, vr: u32, x: f64) -> c_int {
        unsafe { fmi3SetFloat64(self.it.get(), &vr, 1, &x, 1) }
    }

    fn get(&self, vr: u32) -> Option<f64> {
        let mut x = f64::NAN;
        (unsafe { fmi3GetFloat64(self.it.get(), &vr, 1, &mut x, 1) } == OK).then_some(x)
    }

    fn ticks(&self) -> i32 {
        let mut n = -1;
        assert_eq!(unsafe { fmi3GetInt32(self.it.get(), &TICKS, 1, &mut n, 1) }, OK);
        n
    }

    fn errors(&self) -> Vec<String> {
        self.journal.0.borrow_mut().drain(..).map(|m| m.text).collect()
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.it.get()) }
    }
}

#[test]
fn the_description_has_the_clocks() {
    let description = Description::exported::<This>().unwrap();
    let y = description.variable("y").unwrap();
    assert_eq!(
        (&y.clocks[..], y.variability, y.dependencies.as_deref()),
        (&[FIXED][..], Variability::Discrete, Some(&[FIXED][..]))
    );
    assert_eq!(y.initial_dependencies, None);
    assert_eq!(description.variable("u").unwrap().clocks, [FIXED, TRIGGERED]);
    assert!(description.variable("T_fixed").unwrap().initial_dependencies.is_some());
    assert!(description.model_exchange.unwrap().scheduled);
}

/// Plays the scenario that the environment names; without one, nothing.
#[test]
fn scenarios() {
    if let Some(name) = played::scenario() {
        assert_eq!(name, "scheduled");
        scheduled::preemption::logged();
    }
}

#[test]
fn an_interval_that_no_clock_has_is_an_error_of_the_model() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        for (x, why) in [
            (BROKEN, "changing has no interval"),
            (-2e3, "the interval of changing = -2000 is not allowed: finite and not negative"),
        ] {
            let host = Host::entered(kind);
            assert_eq!((host.set(X, x), host.exit()), (OK, ERROR));
            let errors = host.errors();
            assert!(errors[0].contains(why), "{errors:?}");
        }
    }
}

#[test]
fn shifts_are_times_of_clocks_that_can_be_shifted() {
    for (vr, shift, why) in [
        (FIXED, -0.1, "the shift of fixed = -0.1 is not allowed: finite and not negative"),
        (TUNABLE, f64::NAN, "the shift of tunable = NaN is not allowed: finite and not negative"),
        (CONSTANT, 0.1, "constant has a constant shift"),
        (TRIGGERED, 0.1, "triggered has no period, so no shift"),
    ] {
        let host = Host::entered(Kind::Se);
        assert_eq!(
            unsafe { fmi3SetShiftDecimal(host.it.get(), [FIXED, vr].as_ptr(), 2, [0.05, shift].as_ptr()) },
            ERROR
        );
        assert!(host.errors()[0].contains(why), "{why}");
    }
}
