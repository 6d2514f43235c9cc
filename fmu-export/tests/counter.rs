//! Events, parts of communication steps and texts in one model: where an event ends a step in parts, how the model ends the
//! simulation there, which outputs follow a text in Event Mode, and the call log of all this.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

#[path = "common/played.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod played;
mod solver;

use fmi::*;
use fmu_core::unit::{ONE, SECOND};
use fmu_core::{
    Block, ContinuousTime, Elapsed, EventMode, Events, Exported, Fault, Field, Info, Intermediate, Model, Next,
    Outcome, Row, State, Step, Stop, Table, enumeration, integrate, table,
};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use solver::{ERROR, Fmu, Journal, Kind, ME, OK, log3};
use std::cell::{Cell, RefCell};
use std::ffi::CString;
use std::ptr::{null, null_mut};
use std::rc::Rc;

/// Counts an event every `period` seconds, and ends the simulation with event number `last`; `x` is the time.
#[derive(Clone, Serialize, Deserialize)]
struct Counter {
    label: String,
    period: f64,
    longest: f64,
    last: i32,
    endless: bool,
    events: i32,
    x: f64,
    single: f32,
    number: i32,
    level: f64,
    spare: bool,
    listens: bool,
    mode: Mode,
}

enumeration! {
    #[derive(Serialize, Deserialize)]
    enum Mode("Mode", "Whether it reads level") {
        1 Off "No";
        2 On "Yes";
    }
}

impl Default for Counter {
    fn default() -> Self {
        Self {
            label: String::new(),
            period: 0.5,
            longest: 0.25,
            last: 100,
            endless: false,
            events: 0,
            x: 0.0,
            single: 0.5,
            number: 2,
            level: 3.0,
            spare: true,
            listens: true,
            mode: Mode::Off,
        }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    x: f64,
    events: i32,
    length: i32,
}

type V = Row<Block<Counter>>;

const LABEL: u32 = 1;
const X: u32 = 2;
const LENGTH: u32 = 4;
const PERIOD: u32 = 5;
const LONGEST: u32 = 6;
const LAST: u32 = 7;
const ENDLESS: u32 = 8;
const SINGLE: u32 = 9;
const NUMBER: u32 = 10;
const LEVEL: u32 = 11;
const SPARE: u32 = 12;
const LISTENS: u32 = 13;
const MODE: u32 = 14;
const DER_X: u32 = 15;

impl Model for Counter {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Counter", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::text_input("label", "Text", |m| &mut m.model.label),
        V::output("x", &SECOND, "Time", |m| &mut m.out.x).intermediate(),
        V::integer_output("events", "Events so far", |m| &mut m.out.events),
        V::integer_output("length", "Bytes of label", |m| &mut m.out.length),
        V::parameter("period", &SECOND, "Time between two events", |m| &mut m.model.period).above(0.0),
        V::parameter("longest", &ONE, "Longest part of a step in s", |m| &mut m.model.longest),
        V::integer_parameter("last", "Event that ends the simulation", |m| &mut m.model.last),
        V::boolean_parameter("endless", "An event requests the next update", |m| &mut m.model.endless),
        V::float32_input("single", &ONE, "Not used", |m| &mut m.model.single),
        V::integer_input("number", "Not used", |m| &mut m.model.number).read_with("listens", "true"),
        V::input("level", &ONE, "Not used", |m| &mut m.model.level).read_with("mode", "On"),
        V::boolean_input("spare", "Not used", |m| &mut m.model.spare).optional(),
        V::boolean_parameter("listens", "Whether it reads number", |m| &mut m.model.listens),
        V::enumeration_parameter("mode", "Whether it reads level", &Field(|m| &mut m.model.mode)),
    ];

    fn initialize(&mut self) {
        (self.events, self.x) = (0, 0.0);
    }

    fn output(&self, _: Elapsed, out: &mut Outputs) {
        let length = self.label.len().try_into().unwrap_or(i32::MAX);
        *out = Outputs { x: self.x, events: self.events, length };
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::hybrid::<Self, 1>(self, step, self.longest)
    }
}

impl ContinuousTime for Counter {
    const STATES: &'static [State<Self>] = &[State::new("x", &ONE, |m| &mut m.x)];

    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = 1.0;
        Ok(())
    }
}

impl Events for Counter {
    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        while self.next(now).is_due(now) {
            self.events += 1;
        }
        Ok(Outcome { again: self.endless, terminate: self.events >= self.last, ..Outcome::default() })
    }

    fn next(&self, _: Elapsed) -> Next {
        Next::At(Elapsed::periods(self.events.unsigned_abs().into(), self.period).plus(self.period))
    }
}

impl EventMode for Counter {
    fn to_event(&mut self, step: &Step) -> Result<Stop, Fault> {
        integrate::to_event::<Self, 1>(self, step, self.longest)
    }
}

impl Intermediate for Counter {
    fn longest(&self) -> f64 {
        self.longest
    }
}

fmu_export::export!(Counter: ContinuousTime + Events + EventMode + Intermediate);

type Act = fn(InstancePointer, f64) -> Option<f64>;

/// An importer that is called inside steps; the environment of its instance.
#[repr(C)]
struct Host {
    // The first field: the logger takes the environment for a journal.
    journal: Journal,
    it: Cell<InstancePointer>,
    /// The times of the calls in s.
    heard: RefCell<Vec<f64>>,
    act: Act,
}

extern "C" fn update(
    environment: *mut c_void,
    time: f64,
    _: Fmi3Boolean,
    _: Fmi3Boolean,
    _: Fmi3Boolean,
    _: Fmi3Boolean,
    requested: *mut Fmi3Boolean,
    until: *mut f64,
) {
    let host = unsafe { &*environment.cast::<Host>() };
    host.heard.borrow_mut().push(time);
    if let Some(end) = (host.act)(host.it.get(), time) {
        unsafe { (*requested, *until) = (Fmi3Boolean(1), end) };
    }
}

/// Flags and time of a step.
#[derive(Debug, PartialEq)]
struct Done {
    event: bool,
    terminate: bool,
    early: bool,
    end: f64,
}

impl Host {
    /// In Initialization Mode.
    fn new(event: bool, early: bool, act: Act) -> Rc<Self> {
        fmu_export::abi::quiet();
        drop(std::panic::take_hook());
        let it = Cell::new(null_mut());
        let host = Rc::new(Self { journal: Journal::default(), it, heard: RefCell::default(), act });
        let (token, no) = (CString::new(This::TOKEN.as_str()).unwrap(), Fmi3Boolean(0));
        let (name, token, required) = (c"counter".as_ptr(), token.as_ptr(), [X]);
        let (event, early) = (Fmi3Boolean(event.into()), Fmi3Boolean(early.into()));
        let environment = Rc::as_ptr(&host).cast_mut().cast();
        let (list, log, update) = (required.as_ptr(), Some(log3 as Fmi3Logger), Some(update as _));
        let it = unsafe {
            fmi3InstantiateCoSimulation(name, token, null(), no, no, event, early, list, 1, environment, log, update)
        };
        assert!(!it.is_null(), "{:?}", host.journal.0.borrow());
        host.it.set(it);
        assert_eq!(unsafe { fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0) }, OK);
        host
    }

    /// In Step Mode, with this time between two events in s and this last event.
    fn started((event, early): (bool, bool), period: f64, last: i32) -> Rc<Self> {
        let host = Self::new(event, early, |_, _| None);
        assert_eq!((host.set(PERIOD, period), host.set_integer(LAST, last)), (OK, OK));
        host.start(event);
        host
    }

    fn start(&self, event: bool) {
        let it = self.it.get();
        assert_eq!(unsafe { fmi3ExitInitializationMode(it) }, OK);
        assert!(!event || unsafe { fmi3EnterStepMode(it) } == OK, "{:?}", self.journal.0.borrow());
    }

    fn set(&self, vr: u32, x: f64) -> c_int {
        unsafe { fmi3SetFloat64(self.it.get(), &vr, 1, &x, 1) }
    }

    fn set_integer(&self, vr: u32, x: i32) -> c_int {
        unsafe { fmi3SetInt32(self.it.get(), &vr, 1, &x, 1) }
    }

    fn time(&self) -> f64 {
        let mut x = f64::NAN;
        assert_eq!(unsafe { fmi3GetFloat64(self.it.get(), &0, 1, &mut x, 1) }, OK);
        x
    }

    fn step(&self, t: f64, h: f64) -> Result<Done, String> {
        let ([mut event, mut terminate, mut early], mut end) = ([Fmi3Boolean(9); 3], f64::NAN);
        let (it, no) = (self.it.get(), Fmi3Boolean(0));
        match unsafe { fmi3DoStep(it, t, h, no, &mut event, &mut terminate, &mut early, &mut end) } {
            OK => Ok(Done { event: event.0 == 1, terminate: terminate.0 == 1, early: early.0 == 1, end }),
            _ => Err(self.journal.0.borrow_mut().remove(0).text),
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.it.get()) }
    }
}

/// A step of 4 s in parts of 0.25 s, with events at the ends of parts and inside them.
#[test]
fn an_event_ends_a_step_in_parts() {
    for (uses, period, calls, event, end) in [
        ((true, true), 0.5, 1, true, 0.5),
        ((true, true), 0.375, 1, true, 0.375),
        ((false, true), 0.375, 1, false, 0.375),
        ((true, true), 4.0, 16, true, 4.0),
        // Without early return, the model handles the events inside.
        ((true, false), 0.5, 16, true, 4.0),
        ((true, false), 0.375, 16, false, 4.0),
        ((false, false), 0.375, 16, false, 4.0),
    ] {
        let host = Host::started(uses, period, 100);
        let done = Done { event, terminate: false, early: end < 4.0, end };
        assert_eq!(host.step(0.0, 4.0), Ok(done), "{uses:?} {period}");
        assert_eq!((host.heard.borrow().len(), host.time()), (calls, end), "{uses:?} {period}");
        let rest = host.step(end, 0.125).unwrap();
        assert_eq!((rest.early, rest.end), (false, end + 0.125), "the next step goes on from there");
    }
}

/// The second event ends the simulation: at the beginning of a part, to which an event at the end of the one before belongs, and
/// inside a part.
#[test]
fn the_model_ends_the_simulation_in_a_part() {
    for (early, period, calls, end) in [(true, 0.5, 4, 1.0), (false, 0.5, 4, 4.0), (false, 0.3125, 2, 4.0)] {
        let host = Host::started((false, early), period, 2);
        let done = Done { event: false, terminate: true, early: end < 4.0, end };
        assert_eq!(host.step(0.0, 4.0), Ok(done), "{early} {period}");
        assert_eq!((host.heard.borrow().len(), host.time()), (calls, end), "{early} {period}");
        assert!(host.step(end, 0.25).unwrap_err().contains("Ended by the model"));
    }
}

#[test]
fn a_part_without_length_is_an_error_of_the_model() {
    for longest in [0.0, -0.25] {
        let host = Host::new(false, false, |_, _| None);
        assert_eq!(host.set(LONGEST, longest), OK);
        host.start(false);
        let said = host.step(0.0, 1.0).unwrap_err();
        assert!(
            said.contains(&format!("the longest part of a step = {longest} is not allowed: greater than 0")),
            "{said}"
        );
    }
}

/// FMI 2.0.5, 3.2.2, and FMI 3.0.2, 2.3.5: the event iteration ends when no further update is needed.
#[test]
fn an_event_that_does_not_settle_is_an_error() {
    for kind in ME {
        let fmu = Fmu::entered(kind, 0.0);
        assert_eq!((fmu.set_boolean(ENDLESS, true), fmu.exit()), (OK, OK));
        assert!(fmu.update().again);
        assert_eq!(fmu.leave(), ERROR, "{kind:?}");
        let said = fmu.error();
        assert!(said.contains("the event at 0 s does not settle"), "{said}");
    }
    for event in [false, true] {
        let fmu = Fmu::entered(Kind::Cs3 { event, early: true }, 0.0);
        assert_eq!((fmu.set_boolean(ENDLESS, true), fmu.exit()), (OK, OK));
        assert!(!event || fmu.leave() == OK);
        assert_eq!(fmu.step(0.0, 0.5).0, ERROR);
        assert!(fmu.error().contains("does not settle"));
    }
}

#[test]
fn outputs_follow_a_text_that_is_set_in_event_mode() {
    for kind in ME {
        let fmu = Fmu::started(kind, 0.0);
        assert_eq!(fmu.get_integer(LENGTH), 0);
        for text in [c"three", c"four", c""] {
            let set = match kind.version() {
                2 => unsafe { fmi2SetString(fmu.it, &LABEL, 1, &text.as_ptr()) },
                _ => unsafe { fmi3SetString(fmu.it, &LABEL, 1, &text.as_ptr(), 1) },
            };
            assert_eq!((set, fmu.get_integer(LENGTH)), (OK, i32::try_from(text.count_bytes()).unwrap()), "{kind:?}");
        }
    }
}

/// Some importers feed 0 to an input that is not connected; the model reads `number` and `level` with some parameters only.
#[test]
fn a_run_that_begins_with_inputs_at_zero_is_a_warning() {
    const LISTENING: &str = "number = 0 (start value 2)";
    for (listens, mode, fed, expected) in [
        (true, 1, 0.0, format!("single = 0 (start value 0.5), {LISTENING}, spare = false (start value true)")),
        (false, 1, 0.0, "single = 0 (start value 0.5), spare = false (start value true)".into()),
        (
            false,
            2,
            0.0,
            "single = 0 (start value 0.5), level = 0 (start value 3), spare = false (start value true)".into(),
        ),
        (true, 2, 1.0, String::new()),
    ] {
        let fmu = Fmu::with(Kind::Cs3 { event: false, early: false }, true, true);
        assert_eq!((fmu.enter(0.0, None), fmu.set_boolean(LISTENS, listens)), (OK, OK));
        #[expect(clippy::cast_possible_truncation, reason = "0 or 1")]
        let (single, number) = (fed as f32, fed as i32);
        unsafe {
            assert_eq!(fmi3SetInt64(fmu.it, &MODE, 1, &mode, 1), OK);
            assert_eq!(
                (fmi3SetFloat32(fmu.it, &SINGLE, 1, &single, 1), fmi3SetInt32(fmu.it, &NUMBER, 1, &number, 1)),
                (OK, OK)
            );
        }
        assert_eq!((fmu.set(&[LEVEL], &[fed]), fmu.set_boolean(SPARE, fed == 1.0), fmu.exit()), (OK, OK, OK));
        fmu.messages();
        assert_eq!((fmu.step(0.0, 0.1).0, fmu.step(0.1, 0.1).0), (OK, OK));
        let warned: Vec<_> =
            fmu.messages().into_iter().filter(|m| m.category == "logStatusWarning").map(|m| m.text).collect();
        let why = "some importers feed 0 to an input that is not connected";
        let wanted = (!expected.is_empty()).then(|| format!("it: at 0 s: the run begins with {expected}; {why}"));
        assert_eq!(warned, wanted.into_iter().collect::<Vec<_>>());
    }
}

/// Solvers set every input again. In FMI 2.0 a single-precision input comes as a double that it cannot represent, and true as any number.
#[test]
fn an_input_keeps_the_value_that_it_rounds_to() {
    let fmu = Fmu::in_state(Kind::Me2, 'v');
    let yes = |number| unsafe { fmi2SetBoolean(fmu.it, &SPARE, 1, &Fmi2Boolean(number)) };
    assert_eq!((fmu.set(&[SINGLE], &[0.1]), yes(1)), (OK, OK));
    fmu.settle();
    assert_eq!(fmu.leave(), OK);
    assert_eq!((fmu.set(&[SINGLE], &[0.1]), yes(2), fmu.get(SINGLE)), (OK, OK, f64::from(0.1_f32)));
    assert_ne!(yes(0), OK, "a discrete input changes at an event");
}

#[test]
fn a_derivative_is_a_real_number() {
    for kind in ME {
        let fmu = Fmu::started(kind, 0.0);
        assert_eq!(fmu.get(DER_X), 1.0);
        let mut text = null();
        let status = match kind.version() {
            2 => unsafe { fmi2GetString(fmu.it, &DER_X, 1, &mut text) },
            _ => unsafe { fmi3GetString(fmu.it, &DER_X, 1, &mut text, 1) },
        };
        assert_eq!(status, ERROR);
        let said = fmu.error();
        assert!(said.contains("a derivative or an event indicator is a real number; this call takes a text"), "{said}");
    }
}

/// Plays the scenario that the environment names; without one, nothing.
#[test]
fn scenarios() {
    match played::scenario().as_deref() {
        None => {}
        Some("inside") => {
            let host = Host::new(false, true, |it, time| {
                if time == 0.25 {
                    unsafe {
                        assert_eq!(fmi3GetFloat64(it, &X, 1, &mut 0.0, 1), OK);
                        fmi3FreeInstance(it);
                    }
                    return None;
                }
                Some(0.375)
            });
            assert_eq!(host.set(PERIOD, 8.0), OK);
            host.start(false);
            assert_eq!(host.step(0.0, 1.0).unwrap().end, 0.375);
        }
        Some("refused") => {
            let host = Host::new(false, true, |it, _| {
                assert_eq!(unsafe { fmi3Reset(it) }, ERROR);
                None
            });
            host.start(false);
            assert!(host.step(0.0, 1.0).is_err());
        }
        Some("event") => {
            let fmu = Fmu::entered(Kind::Me2, 0.5);
            assert_eq!((fmu.set(&[PERIOD], &[2.0]), fmu.exit()), (OK, OK));
            fmu.update();
        }
        Some(other) => unreachable!("{other}"),
    }
}

/// The lines of the only file of a scenario after its call of this function.
fn logged(scenario: &str, after: &str) -> String {
    let [log] = &played::logs(scenario)[..] else { panic!("one instance") };
    let at = log.find(after).unwrap();
    log[at..].split_once('\n').unwrap().1.to_owned()
}

#[test]
fn the_call_log_shows_calls_inside_a_step() {
    let step = "0.0 fmi3DoStep(t=0.0, h=1.0, no_set_state_prior=0, event_handling_needed=?1, terminate_simulation=?1, \
                early_return=?1, last_successful_time=?1) {\n";
    let inside = "  0.25 intermediateUpdate(can_return=1) {\n    \
                      0.25 fmi3GetFloat64(vr=[2], n=1, values=?1, m=1) -> OK values=[0.25]\n    \
                      0.25 fmi3FreeInstance() -> ignored\n  \
                    } -> done\n  \
                    0.5 intermediateUpdate(can_return=1) -> done early_return=0.375\n";
    let end = "} -> Error\n";
    let log = logged("inside", "fmi3ExitInitializationMode");
    assert!(log.starts_with(&format!("{step}{inside}")), "{log}");
    let log = logged("refused", "fmi3ExitInitializationMode");
    let inside = "  0.25 intermediateUpdate(can_return=1) {\n    0.25 fmi3Reset() -> Error\n  } -> done\n";
    assert!(log.starts_with(&format!("{step}{inside}{end}")), "{log}");
}

/// A struct of FMI 2.0 becomes one result for each of its fields.
#[test]
fn the_call_log_shows_an_event() {
    let log = logged("event", "fmi2ExitInitializationMode");
    let update =
        "0.5 fmi2NewDiscreteStates(info=?1) -> OK again=0 terminate=0 nominals=0 values=0 next_defined=1 next=2.5\n";
    assert_eq!(log, format!("{update}0.5 fmi2FreeInstance() -> done\n"));
}
