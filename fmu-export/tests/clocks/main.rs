//! Clocks in Event Mode of Co-Simulation and Model Exchange, and in Scheduled Execution: every kind of clock, cell by cell.
#![allow(missing_docs, clippy::float_cmp, clippy::borrow_as_ptr)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod arguments;
#[path = "../counting/mod.rs"]
mod counting;
#[path = "../common/draw.rs"]
#[allow(unreachable_pub, reason = "a module of several test programs")]
mod draw;
#[path = "../common/journal.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod journal;
mod random;
mod scheduled;

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

/// A call and, for the clocks in their order, the states that allow it: i n v s in Co-Simulation and Model Exchange, i n a in
/// Scheduled Execution, t and e allow nothing.
type Cell3 = (&'static str, [&'static str; 8], fn(&Host, u32) -> bool);

/// FMI 3.0.2, 2.2.8.4 and 2.3: no clock has ticked.
const CELLS: &[Cell3] = &[
    ("SetClock", ["v", "v", "v", "v", "v", "v", "v", ""], |h, vr| h.set_clock(vr, true) == OK),
    ("GetClock", ["va", "va", "va", "va", "va", "va", "va", "va"], |h, vr| h.clock(vr).is_some()),
    ("GetInterval", ["n", "n", "n", "nva", "n", "nv", "", ""], |h, vr| h.interval(vr).is_some()),
    ("SetInterval", ["", "", "n", "nva", "", "", "", ""], |h, vr| h.set_interval(vr, 0.4) == OK),
    ("GetIntervalFraction", ["", "n", "", "", "", "", "", ""], |h, vr| {
        let (mut counter, mut resolution, mut qualifier) = (0, 0, 0);
        let it = h.it.get();
        let done = unsafe { fmi3GetIntervalFraction(it, &vr, 1, &mut counter, &mut resolution, &mut qualifier) } == OK;
        assert!(!done || (counter, resolution, qualifier) == (1, 3, 2));
        done
    }),
    ("SetIntervalFraction", ["", "", "", "", "", "", "", ""], |h, vr| unsafe {
        fmi3SetIntervalFraction(h.it.get(), &vr, 1, &1, &3) == OK
    }),
    ("GetShift", ["n", "n", "n", "n", "", "", "", ""], |h, vr| {
        let mut shift = f64::NAN;
        let done = unsafe { fmi3GetShiftDecimal(h.it.get(), &vr, 1, &mut shift) } == OK;
        assert!(!done || shift == [0.05, 1.0, 0.0, 0.0][vr as usize - 1]);
        done
    }),
    ("GetShiftFraction", ["", "n", "", "", "", "", "", ""], |h, vr| {
        let (mut counter, mut resolution) = (0, 0);
        let done = unsafe { fmi3GetShiftFraction(h.it.get(), &vr, 1, &mut counter, &mut resolution) } == OK;
        assert!(!done || (counter, resolution) == (3, 3));
        done
    }),
    ("SetShift", ["", "", "n", "n", "", "", "", ""], |h, vr| unsafe {
        fmi3SetShiftDecimal(h.it.get(), &vr, 1, &0.01) == OK
    }),
    ("SetShiftFraction", ["", "", "", "", "", "", "", ""], |h, vr| unsafe {
        fmi3SetShiftFraction(h.it.get(), &vr, 1, &1, &3) == OK
    }),
    ("ActivateModelPartition", ["a", "a", "a", "a", "a", "a", "a", ""], |h, vr| h.activate(vr, 0.0) == OK),
    // No clock: a variable, and no reference of the model.
    ("SetClock", ["", "", "", "", "", "", "", ""], |h, vr| h.set_clock(vr + 8, true) == OK),
    ("GetInterval", ["", "", "", "", "", "", "", ""], |h, vr| h.interval(vr + 200).is_some()),
];

#[test]
fn every_call_in_every_state_of_every_clock() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        let states = if kind == Kind::Se { "inate" } else { "invste" };
        for (name, allowed, call) in CELLS {
            for (vr, allowed) in CLOCKS.into_iter().zip(allowed) {
                for state in states.chars() {
                    let host = Host::in_state(kind, state);
                    let place = format!("{name} of {vr} in {state}, {kind:?}");
                    assert_eq!(call(&host, vr), allowed.contains(state), "{place}: {:?}", host.errors());
                    let errors = host.errors();
                    assert_eq!(errors.len(), usize::from(!allowed.contains(state)), "{place}: {errors:?}");
                }
            }
        }
    }
}

/// Clocked variables can be used while their clock is active in Event Mode; before the start, and in Scheduled Execution,
/// always.
#[test]
fn variables_on_clocks() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        let states = if kind == Kind::Se { "ina" } else { "invs" };
        for state in states.chars() {
            let open = "ina".contains(state);
            let place = format!("{state}, {kind:?}");
            assert_eq!(Host::in_state(kind, state).set(U, 1.0) == OK, open, "{place}");
            assert_eq!(Host::in_state(kind, state).get(U).is_some(), open, "{place}");
            assert_eq!(Host::in_state(kind, state).get(Y).is_some(), open, "{place}");
            // Without a clock.
            assert_eq!(Host::in_state(kind, state).set(X, 1.0), OK, "{place}");
            assert!(Host::in_state(kind, state).get(FREE).is_some(), "{place}");
            assert_eq!(Host::in_state(kind, state).ticks(), 0);
        }
    }
    for kind in [Kind::Cs, Kind::Me] {
        let host = Host::started(kind);
        assert_eq!(host.set_clock(TRIGGERED, true), OK);
        assert_eq!((host.set(U, 1.0), host.get(U)), (OK, Some(1.0)), "u is on two clocks");
        assert_eq!(host.get(Y), None, "y is on the other one");
        assert!(host.errors()[0].contains("y can be read in Event Mode while fixed is active"));
        let host = Host::started(kind);
        assert_eq!((host.set_clock(FIXED, true), host.set(U, 1.0), host.update()), (OK, OK, OK));
        assert_eq!(host.get(Y), None, "the update ends the tick");
    }
}

/// Outputs of an active clock belong to the tick before; inputs may be set repeatedly; the update ticks once.
#[test]
fn a_tick_in_event_mode() {
    for kind in [Kind::Cs, Kind::Me] {
        let host = Host::started(kind);
        for k in 0..10 {
            let (t, u) = (f64::from(k) * 0.2, f64::from(k + 1));
            assert_eq!(host.clock(FIXED), Some(false));
            assert_eq!(host.set_clock(FIXED, true), OK);
            assert_eq!(host.set_clock(FIXED, true), OK, "again has no effect");
            assert_eq!((host.clock(FIXED), host.clock(CONSTANT)), (Some(true), Some(false)));
            assert_eq!((host.set(U, 77.0), host.get(Y), host.set(U, u)), (OK, Some(f64::from(k)), OK));
            assert_eq!((host.ticks(), host.update(), host.ticks()), (k, OK, k + 1));
            assert_eq!((host.clock(FIXED), host.update(), host.ticks()), (Some(false), OK, k + 1));
            host.proceed(t, t + 0.2);
        }
        assert!(host.errors().is_empty());
    }
}

#[test]
fn a_clock_ticks_once_at_an_instant() {
    for kind in [Kind::Cs, Kind::Me] {
        for (vr, again) in [(CONSTANT, false), (FIXED, false), (TUNABLE, false), (CHANGING, true), (TRIGGERED, true)] {
            let host = Host::started(kind);
            assert_eq!((host.set_clock(vr, true), host.update()), (OK, OK));
            assert_eq!(host.set_clock(vr, true) == OK, again, "{vr}");
        }
        let host = Host::started(kind);
        assert_eq!((host.set_clock(FIXED, false), host.set_clock(FIXED, true)), (OK, OK));
        assert_eq!(host.set_clock(FIXED, false), ERROR);
        assert!(host.errors()[0].contains("canBeDeactivated = false"));
    }
    // Two clocks, in both orders, at one instant and in one update.
    for pair in [[FIXED, TRIGGERED], [TRIGGERED, FIXED]] {
        for kind in [Kind::Cs, Kind::Me] {
            let host = Host::started(kind);
            let yes = [Fmi3Boolean(1); 2];
            assert_eq!(unsafe { fmi3SetClock(host.it.get(), pair.as_ptr(), 2, yes.as_ptr()) }, OK);
            assert_eq!((host.set(U, 5.0), host.update(), host.ticks(), host.get(FREE)), (OK, OK, 2, Some(5.0)));
            // All or none.
            let bad = [pair[0], TRIP];
            let host = Host::started(kind);
            assert_eq!(unsafe { fmi3SetClock(host.it.get(), bad.as_ptr(), 2, yes.as_ptr()) }, ERROR);
            assert!(host.errors()[0].contains("trip is an output clock"));
        }
        // In Scheduled Execution, one activation after the other.
        let host = Host::started(Kind::Se);
        assert_eq!((host.set(U, 5.0), host.activate(pair[0], 1.0), host.activate(pair[1], 1.0)), (OK, OK, OK));
        assert_eq!((host.ticks(), host.get(FREE), host.updates.get() > 0), (2, Some(5.0), true));
    }
}

/// Qualifiers: 0 not yet known, 1 unchanged, 2 changed.
#[test]
fn intervals_and_qualifiers() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        let host = Host::entered(kind);
        for (vr, interval) in [(CONSTANT, 0.1), (FRACTION, 1.0 / 3.0), (FIXED, 0.2), (TUNABLE, 0.3), (CHANGING, 0.1)] {
            assert_eq!((host.interval(vr), host.interval(vr)), (Some((interval, 2)), Some((interval, 1))), "{vr}");
        }
        assert_eq!((host.interval(COUNTDOWN), host.interval(COUNTDOWN)), (Some((0.0, 0)), Some((0.0, 0))));
        assert_eq!((host.set_interval(FIXED, 0.25), host.interval(FIXED)), (OK, Some((0.25, 2))));
        assert_eq!(host.get(14), Some(0.25), "T_fixed");
        assert_eq!(host.exit(), OK);
        if kind == Kind::Se {
            // Afterwards, as in `scheduled`.
            continue;
        }
        // A changing clock has an interval where it ticked.
        assert_eq!((host.set_clock(CHANGING, true), host.update()), (OK, OK));
        assert_eq!((host.interval(CHANGING), host.interval(CHANGING)), (Some((0.2, 2)), Some((0.2, 1))));
        // A countdown begins at an event of another clock, and reports it once.
        assert_eq!(
            (host.interval(COUNTDOWN), host.set_clock(TRIGGERED, true), host.update()),
            (Some((0.0, 0)), OK, OK)
        );
        assert_eq!((host.interval(COUNTDOWN), host.interval(COUNTDOWN)), (Some((0.25, 2)), Some((0.25, 1))));
        host.proceed(0.0, 0.25);
        assert_eq!(host.interval(COUNTDOWN), Some((0.25, 1)));
        assert_eq!((host.set_clock(COUNTDOWN, true), host.update()), (OK, OK));
        assert_eq!(host.interval(COUNTDOWN), Some((0.25, 0)), "the next tick is not known");
        // Tunable: in Event Mode too, checked with the other parameters at the update.
        assert_eq!((host.set_interval(TUNABLE, 0.5), host.interval(TUNABLE)), (OK, Some((0.5, 2))));
        assert_eq!(host.interval(CHANGING), None, "it did not tick here");
    }
    for bad in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        assert_eq!(Host::entered(Kind::Cs).set_interval(FIXED, bad), ERROR);
    }
    let host = Host::entered(Kind::Cs);
    assert_eq!((host.set_interval(FIXED, 11.0), host.exit()), (OK, ERROR));
    assert!(host.errors()[0].contains("fixed is too long"));
}

/// An output clock is active from the tick that activates it to the update.
#[test]
fn an_output_clock_in_event_mode() {
    for kind in [Kind::Cs, Kind::Me] {
        let host = Host::started(kind);
        for (k, trips) in [(1, false), (2, true), (3, false), (4, true)] {
            assert_eq!(host.clock(TRIP), Some(false));
            assert_eq!((host.set_clock(TRIGGERED, true), host.clock(TRIP)), (OK, Some(trips)), "tick {k}");
            assert_eq!((host.ticks(), host.clock(TRIP)), (k - 1, Some(trips)), "a getter changes nothing");
            assert_eq!((host.update(), host.clock(TRIP), host.ticks()), (OK, Some(false), k));
        }
    }
}

/// A state saved in Event Mode contains the active clocks and the reported intervals, as a handle and as bytes.
#[test]
fn a_saved_state_holds_the_clocks() {
    for kind in [Kind::Cs, Kind::Me] {
        let host = Host::started(kind);
        let it = host.it.get();
        assert_eq!((host.set_clock(TRIGGERED, true), host.update(), host.set_clock(FIXED, true)), (OK, OK, OK));
        assert_eq!(host.set(U, 3.0), OK);
        let (mut state, mut copy, mut size) = (null_mut(), null_mut(), 0);
        unsafe {
            assert_eq!(fmi3GetFMUState(it, &mut state), OK);
            assert_eq!(fmi3SerializedFMUStateSize(it, state, &mut size), OK);
            let mut bytes = vec![0; size];
            assert_eq!(fmi3SerializeFMUState(it, state, bytes.as_mut_ptr(), size), OK);
            assert_eq!(fmi3DeserializeFMUState(it, bytes.as_ptr(), size, &mut copy), OK);
        }
        for saved in [state, copy] {
            assert_eq!(host.update(), OK);
            assert_eq!(host.clock(FIXED), Some(false));
            assert_eq!(unsafe { fmi3SetFMUState(it, saved) }, OK);
            assert_eq!(
                (host.clock(FIXED), host.get(U), host.interval(COUNTDOWN)),
                (Some(true), Some(3.0), Some((0.25, 2)))
            );
        }
        let mut states = [state, copy];
        for state in &mut states {
            assert_eq!(unsafe { fmi3FreeFMUState(it, state) }, OK);
        }
    }
}

#[test]
fn a_tick_beside_its_grid_is_a_warning() {
    for (t, warns) in [(0.2, false), (0.2 + 1e-7, false), (0.2 + 4e-6, true), (0.19, true)] {
        let host = Host::started(Kind::Cs);
        unsafe { assert_eq!(fmi3SetDebugLogging(host.it.get(), Fmi3Boolean(1), 0, null()), OK) };
        assert_eq!((host.set_clock(FIXED, true), host.update()), (OK, OK));
        host.proceed(0.0, t);
        assert_eq!((host.set_clock(FIXED, true), host.update()), (OK, OK));
        let errors = host.errors();
        let heard = errors.iter().any(|text| text.contains("fixed ticks"));
        assert_eq!(heard, warns, "{t}: {errors:?}");
    }
}

/// Clocks need event mode; updates of clocks need their callback.
#[test]
fn instances_that_cannot_be() {
    let host = Host::open(Kind::Cs);
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    let (name, token, no) = (c"kinds".as_ptr(), token.as_ptr(), Fmi3Boolean(0));
    let (environment, log) = (Rc::as_ptr(&host).cast_mut().cast(), Some(log3 as Fmi3Logger));
    unsafe {
        let it = fmi3InstantiateCoSimulation(name, token, null(), no, no, no, no, null(), 0, environment, log, None);
        assert!(it.is_null() && host.errors()[0].contains("eventModeUsed = false is not allowed"));
        let it = fmi3InstantiateScheduledExecution(name, token, null(), no, no, environment, log, None, None, None);
        assert!(it.is_null() && host.errors()[0].contains("clockUpdate is NULL"));
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
