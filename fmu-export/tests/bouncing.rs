//! Start values that the importer sets, constants, the end of the simulation, Event Mode with states, and a model's log
//! categories: a ball of Euler's method, in both standards.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

mod solver;

use fmu_core::log::Warnings;
use fmu_core::unit::{METER, METER_PER_S, METER_PER_S2, ONE};
use fmu_core::{
    Block, ContinuousTime, Description, Elapsed, EventMode, Events, Fault, Indicator, Info, Model, Next, Outcome, Row,
    State, Step, Stop, Table, Warns, enumeration, integrate, table,
};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use solver::*;
use std::ffi::CStr;
use std::ptr::{null, null_mut};

enumeration! {
    enum Ground("Ground", "What it falls on") {
        1 Sand "Soft";
        2 Stone "Hard";
    }
}

#[derive(Clone, Serialize, Deserialize)]
struct Ball {
    h: f64,
    v: f64,
    e: f64,
    rests: bool,
    bounces: i32,
    limit: i32,
}

impl Default for Ball {
    fn default() -> Self {
        Self { h: 1.0, v: 0.0, e: 0.7, rests: false, bounces: 0, limit: 1000 }
    }
}

type V = Row<Block<Ball>>;

impl Model for Ball {
    type Outputs = [f64; 3];
    const INFO: Info =
        Info { name: "Ball", categories: &[("bounce", "Every bounce"), ("rest", "The end")], ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::output("h", &METER, "Height", |m| &mut m.out[0]).at_least(-1.0).exact(),
        V::output("v", &METER_PER_S, "Velocity", |m| &mut m.out[1]).exact(),
        V::output("energy", &ONE, "Per mass", |m| &mut m.out[2]),
        V::integer_output("bounces", "Counted", |m| &mut m.model.bounces).at_least(0.0).exact(),
        V::boolean_local("rests", "At rest", |m| &mut m.model.rests).exact(),
        V::parameter("e", &ONE, "Restitution", |m| &mut m.model.e).tunable(),
        V::integer_parameter("limit", "Bounces at the end", |m| &mut m.model.limit),
        V::constant("v_min", &METER_PER_S, "Minimum velocity", 0.1).as_output(),
        V::float32_constant("single", &METER, "Single", 0.1),
        V::integer_constant("int32", "32 bits", -7),
        V::uint64_constant("uint64", "64 bits", 9),
        V::boolean_constant("yes", "True", true),
        V::enumeration_constant::<Ground>("ground", "Stone", Ground::Stone as i32),
        V::array_constant("levels", &METER, "Heights", &[1.0, 0.49]),
        V::text_constant("made", "By whom", "here"),
        V::int8_constant("int8", "Minimum of 8 bits", i8::MIN),
        V::uint8_constant("uint8", "Maximum of 8 bits", u8::MAX),
        V::int16_constant("int16", "Minimum of 16 bits", i16::MIN),
        V::uint16_constant("uint16", "Maximum of 16 bits", u16::MAX),
        V::uint32_constant("uint32", "More than an Int32 has", 4_000_000_000),
        V::int64_constant("int64", "Of 64 bits", -3_000_000_000),
    ];

    fn initialize(&mut self) {}

    fn output(&self, _now: Elapsed, out: &mut [f64; 3]) {
        *out = [self.h, self.v, 9.81 * self.h + 0.5 * self.v * self.v];
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::euler_hybrid::<Self, 2>(self, step, 1e-3)
    }
}

impl ContinuousTime for Ball {
    const STATES: &'static [State<Self>] = &[
        State::new("h", &METER_PER_S, |m: &mut Self| &mut m.h).reinit(),
        State::new("v", &METER_PER_S2, |m: &mut Self| &mut m.v).reinit(),
    ];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx.copy_from_slice(&[self.v, if self.rests { 0.0 } else { -9.81 }]);
        Ok(())
    }
}

impl Events for Ball {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: "z", description: "Above the ground" }];

    fn indicators(&self, _now: Elapsed, z: &mut [f64]) {
        z[0] = self.h;
    }

    fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
        let bounces = self.h <= 0.0 && self.v < 0.0;
        if bounces {
            (self.h, self.v) = (f64::MIN_POSITIVE, -self.v * self.e);
            self.bounces += 1;
            self.rests = self.v < 0.1;
            self.v = if self.rests { 0.0 } else { self.v };
        }
        Ok(Outcome { states_changed: bounces, terminate: self.bounces >= self.limit, ..Outcome::default() })
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}

impl EventMode for Ball {
    fn to_event(&mut self, step: &Step) -> Result<Stop, Fault> {
        integrate::euler_to_event::<Self, 2>(self, step, 1e-3)
    }
}

impl Warns for Ball {
    fn warn(&self, log: &mut Warnings<'_>) {
        if self.bounces > 0 {
            log.log("bounce", "bounce", || format!("{} bounces", self.bounces));
            log.log("unknown", "unknown", || "said".into());
        }
        if self.v < -3.0 {
            log.warn("fast", || "fast".into());
        }
    }
}

fmu_export::export!(Ball: ContinuousTime + Events + EventMode + Warns);

use fmi::*;

const H: u32 = 1;
const V_: u32 = 2;
const ENERGY: u32 = 3;
const BOUNCES: u32 = 4;
const RESTS: u32 = 5;
const E: u32 = 6;
const LIMIT: u32 = 7;
const EVERY: [Kind; 7] = [
    Kind::Me2,
    Kind::Me3,
    Kind::Cs2,
    Kind::Cs3 { event: false, early: false },
    Kind::Cs3 { event: false, early: true },
    Kind::Cs3 { event: true, early: false },
    Kind::Cs3 { event: true, early: true },
];

fn set_integer(fmu: &Fmu, vr: u32, value: i32) -> c_int {
    let two = Fmi2Integer(value);
    match fmu.kind.version() {
        2 => unsafe { fmi2SetInteger(fmu.it, &vr, 1, &two) },
        _ => unsafe { fmi3SetInt32(fmu.it, &vr, 1, &value, 1) },
    }
}

fn bits(fmu: &Fmu) -> [u64; 3] {
    [H, V_, ENERGY].map(|vr| fmu.get(vr).to_bits())
}

#[test]
fn starts_stand_from_the_instantiation_on() {
    for kind in EVERY {
        let fmu = Fmu::new(kind);
        if kind.version() == 3 {
            assert_eq!(fmu.get(H), 1.0, "{kind:?}");
        }
        assert_eq!(fmu.set(&[H, V_], &[3.0, 2.0]), OK);
        assert_eq!((set_integer(&fmu, BOUNCES, 5), fmu.set_boolean(RESTS, true)), (OK, OK));
        let mut saved = null_mut();
        assert_eq!(fmu.save(&mut saved), OK);
        assert_eq!(fmu.enter(0.0, None), OK);
        assert_eq!((fmu.get(H), fmu.get(V_), fmu.get(ENERGY)), (3.0, 2.0, 9.81 * 3.0 + 2.0));
        assert_eq!(fmu.set(&[V_], &[4.0]), OK);
        assert_eq!((fmu.get(H), fmu.get(ENERGY)), (3.0, 9.81 * 3.0 + 8.0), "what depends on it follows");
        if kind.exchanges() {
            assert_eq!((fmu.derivatives(), fmu.states()), ([4.0, 0.0], [3.0, 4.0]));
        }
        assert_eq!(fmu.exit(), OK);
        assert_eq!((fmu.get(H), fmu.get(V_), fmu.get_integer(BOUNCES)), (3.0, 4.0, 5));
        assert_eq!(fmu.restore(saved), OK);
        assert_eq!(fmu.enter(0.0, None), OK);
        assert_eq!((fmu.get(V_), fmu.get_integer(BOUNCES)), (2.0, 5), "{kind:?}: as saved");
        assert_eq!(fmu.reset(), OK);
        assert_eq!(fmu.enter(0.0, None), OK);
        assert_eq!((fmu.get(H), fmu.get(V_), fmu.get_integer(BOUNCES)), (1.0, 0.0, 0), "{kind:?}: as instantiated");
        assert_eq!(fmu.free_state(&mut saved), OK);
    }
}

#[test]
fn starts_are_judged_and_end_with_the_initialization() {
    for kind in EVERY {
        for (vr, x) in [(H, -2.0), (H, f64::NAN), (V_, f64::INFINITY), (ENERGY, 1.0)] {
            let fmu = Fmu::new(kind);
            assert_eq!(fmu.set(&[V_, vr], &[7.0, x]), ERROR, "{kind:?} {vr} = {x}");
            assert_eq!(fmu.reset(), OK);
        }
        let fmu = Fmu::new(kind);
        assert_eq!(set_integer(&fmu, BOUNCES, -1), ERROR);
        for state in if kind.handles_events() { ['v', 't'] } else { ['s', 't'] } {
            let fmu = Fmu::in_state(kind, state);
            assert_eq!(set_integer(&fmu, BOUNCES, 1), ERROR, "{kind:?} {state}");
        }
        let fmu = Fmu::running(kind, 0.0);
        let wanted = if kind.exchanges() { OK } else { ERROR };
        assert_eq!(fmu.set(&[H], &[0.5]), wanted, "{kind:?}: a state of Model Exchange can be set, FMI 3.0.2, 3.2.1");
        if !kind.exchanges() {
            let said = fmu.error();
            assert!(said.contains("h has a start value, which can be set before and in Initialization Mode"), "{said}");
        }
    }
}

#[test]
fn constants_have_their_values_and_cannot_be_set() {
    let names = Description::exported::<fmi::This>().unwrap();
    let vr = |name: &str| names.variable(name).unwrap().value_reference;
    for kind in EVERY {
        let (fmu, mut made) = (Fmu::entered(kind, 0.0), null());
        assert_eq!((fmu.get(vr("v_min")), fmu.get_integer(vr("int32"))), (0.1, -7));
        if kind.version() == 3 {
            let (mut single, mut wide, mut item, mut yes) = (0.0, 0, 0, Fmi3Boolean(7));
            let mut levels = [0.0; 2];
            assert_eq!(unsafe { fmi3GetFloat32(fmu.it, &vr("single"), 1, &mut single, 1) }, OK);
            assert_eq!(unsafe { fmi3GetUInt64(fmu.it, &vr("uint64"), 1, &mut wide, 1) }, OK);
            assert_eq!(unsafe { fmi3GetInt64(fmu.it, &vr("ground"), 1, &mut item, 1) }, OK);
            assert_eq!(unsafe { fmi3GetBoolean(fmu.it, &vr("yes"), 1, &mut yes, 1) }, OK);
            assert_eq!(fmu.try_get(&[vr("levels")], &mut levels), OK);
            assert_eq!((single, wide, item, yes.0, levels), (0.1, 9, 2, 1, [1.0, 0.49]));
            macro_rules! reads {
                ($($get:ident $name:literal $value:expr;)*) => { $(
                    let (mut value, expected) = (0, $value);
                    assert_eq!(unsafe { $get(fmu.it, &vr($name), 1, &mut value, 1) }, OK, $name);
                    assert_eq!(value, expected, $name);
                )* };
            }
            reads! {
                fmi3GetInt8 "int8" i8::MIN;
                fmi3GetUInt8 "uint8" u8::MAX;
                fmi3GetInt16 "int16" i16::MIN;
                fmi3GetUInt16 "uint16" u16::MAX;
                fmi3GetUInt32 "uint32" 4_000_000_000_u32;
                fmi3GetInt64 "int64" -3_000_000_000_i64;
            }
            assert_eq!(unsafe { fmi3GetString(fmu.it, &vr("made"), 1, &mut made, 1) }, OK);
        } else {
            let mut yes = Fmi2Boolean(7);
            assert_eq!(unsafe { fmi2GetBoolean(fmu.it, &vr("yes"), 1, &mut yes) }, OK);
            assert_eq!((fmu.get_integer(vr("uint64")), fmu.get_integer(vr("ground")), yes.0), (9, 2, 1));
            assert_eq!((fmu.get(vr("single")), fmu.get(vr("levels") + 1)), (f64::from(0.1_f32), 0.49));
            let small = ["int8", "uint8", "int16", "uint16"].map(|name| fmu.get_integer(vr(name)));
            assert_eq!(small, [-128, 255, -32768, 65535]);
            assert_eq!(unsafe { fmi2GetString(fmu.it, &vr("made"), 1, &mut made) }, OK);
        }
        assert_eq!(unsafe { CStr::from_ptr(made) }, c"here");
        assert_eq!(fmu.set(&[vr("v_min")], &[0.1]), ERROR);
        assert!(fmu.error().contains("v_min is a constant and cannot be set"));
    }
}

/// `terminateSimulation`, `earlyReturn`, `eventHandlingNeeded` and the last successful time.
fn step(fmu: &Fmu, t: f64, h: f64) -> (c_int, [u8; 3], f64) {
    let (mut flags, mut last) = ([9_u8; 3].map(Fmi3Boolean), f64::NAN);
    let [end, early, event] = &mut flags;
    let status = unsafe { fmi3DoStep(fmu.it, t, h, Fmi3Boolean(1), event, end, early, &mut last) };
    (status, flags.map(|flag| flag.0), last)
}

#[test]
fn the_model_ends_the_simulation() {
    // The first bounce is at the 453rd step of 1 ms.
    for early in [false, true] {
        let fmu = Fmu::entered(Kind::Cs3 { event: false, early }, 5.0);
        assert_eq!(set_integer(&fmu, LIMIT, 1), OK);
        assert_eq!(fmu.exit(), OK);
        assert_eq!(step(&fmu, 5.0, 0.4), (OK, [0, 0, 0], 5.4));
        let ended = step(&fmu, 5.4, 0.1);
        if early {
            // The step stops at the event, and the next one handles it.
            assert_eq!(ended, (OK, [0, 1, 0], 5.0 + 0.453));
            assert_eq!(step(&fmu, ended.2, 0.047), (OK, [1, 1, 0], 5.0 + 0.453));
        } else {
            assert_eq!(ended, (OK, [1, 0, 0], 5.5), "no time before the end without early return");
        }
        assert_eq!((fmu.get(H), fmu.get_integer(BOUNCES)), (f64::MIN_POSITIVE, 1));
        let last = if early { 5.0 + 0.453 } else { 5.5 };
        let mut saved = null_mut();
        assert_eq!(fmu.save(&mut saved), OK);
        assert_eq!(step(&fmu, last, 0.1).0, ERROR, "no step follows");
        assert!(fmu.error().contains("Ended by the model"));
        assert_eq!((fmu.restore(saved), fmu.free_state(&mut saved), fmu.terminate()), (OK, OK, OK));
    }
    let fmu = Fmu::entered(Kind::Cs2, 5.0);
    assert_eq!(set_integer(&fmu, LIMIT, 1), OK);
    assert_eq!(fmu.exit(), OK);
    let status = |kind: c_int| {
        let (mut ended, mut last) = (Fmi2Boolean(7), f64::NAN);
        match kind {
            3 => (unsafe { fmi2GetBooleanStatus(fmu.it, 3, &mut ended) }, f64::from(ended.0)),
            _ => (unsafe { fmi2GetRealStatus(fmu.it, kind, &mut last) }, last),
        }
    };
    assert_eq!((fmu.step(5.0, 0.4).0, status(3), status(2)), (OK, (OK, 0.0), (OK, 5.4)));
    assert_eq!((fmu.step(5.4, 0.1).0, status(3), status(2)), (DISCARD, (OK, 1.0), (OK, 5.0 + 0.453)));
    assert_eq!((fmu.get(H), fmu.get_integer(BOUNCES)), (f64::MIN_POSITIVE, 1));
    assert_eq!(fmu.step(5.453, 0.1).0, ERROR, "no step follows");
    assert_eq!((fmu.reset(), fmu.enter(0.0, None), fmu.exit(), fmu.step(0.0, 0.1).0), (OK, OK, OK, OK));
    // In Event Mode, the update reports it, as in Model Exchange.
    let fmu = Fmu::entered(Kind::Cs3 { event: true, early: true }, 0.0);
    assert_eq!(set_integer(&fmu, LIMIT, 1), OK);
    assert_eq!(fmu.exit(), OK);
    assert!(!fmu.update().terminate);
    assert_eq!(fmu.leave(), OK);
    let (status, flags, last) = step(&fmu, 0.0, 1.0);
    assert_eq!((status, flags, last), (OK, [0, 1, 1], 0.453));
    assert_eq!(fmu.event(), OK);
    assert!(fmu.update().terminate);
    assert_eq!(fmu.terminate(), OK);
}

/// A call, the standards that allow it after the model has ended the simulation in a step, and the function.
type After = (&'static str, &'static [u8], fn(&Fmu) -> c_int);

/// FMI 2.0.5, 4.2.4, state stepFailed; FMI 3.0.2, 4.2.1: terminateSimulation, after which no step follows.
const ENDED: &[After] = &[
    ("SetDebugLogging", &[2, 3], |f| f.logging(false, &[])),
    ("EnterInitializationMode", &[], |f| f.enter(0.0, None)),
    ("ExitInitializationMode", &[], Fmu::exit),
    ("DoStep", &[], |f| f.step(5.453, 0.1).0),
    ("DoStep", &[], |f| f.step(5.5, 0.1).0),
    ("Terminate", &[2, 3], Fmu::terminate),
    ("Reset", &[2, 3], Fmu::reset),
    ("Get", &[2, 3], |f| f.try_get(&[H, V_], &mut [0.0; 2])),
    ("Set", &[3], |f| f.set(&[], &[])),
    ("GetFMUState", &[2, 3], |f| f.save(&mut null_mut())),
];

#[test]
fn every_call_after_the_model_has_ended_the_simulation() {
    for kind in [Kind::Cs2, Kind::Cs3 { event: false, early: false }] {
        for (name, standards, call) in ENDED {
            let fmu = Fmu::entered(kind, 5.0);
            assert_eq!((set_integer(&fmu, LIMIT, 1), fmu.exit()), (OK, OK));
            if kind == Kind::Cs2 {
                assert_eq!(fmu.step(5.0, 0.5).0, DISCARD);
            } else {
                assert_eq!(step(&fmu, 5.0, 0.5), (OK, [1, 0, 0], 5.5));
            }
            fmu.messages();
            let status = call(&fmu);
            if standards.contains(&kind.version()) {
                assert_eq!(status, OK, "{name}, {kind:?}: {:?}", fmu.messages());
            } else {
                let error = fmu.error();
                assert_eq!(status, ERROR, "{name}, {kind:?}");
                assert!(error.contains("not allowed in the state Ended by the model"), "{name}, {kind:?}: {error}");
            }
        }
    }
}

/// Outputs at the multiples of `grid` up to 3 s, with steps of `h`, and the times of the events seen by the importer.
fn run(kind: Kind, h: f64, grid: f64) -> (Vec<[u64; 3]>, Vec<f64>) {
    let fmu = Fmu::running(kind, 0.0);
    let (mut rows, mut events) = (vec![bits(&fmu)], Vec::new());
    let count = |x: f64| (x + 0.5).floor();
    let (mut t, mut n) = (0.0, 1.0);
    while n * h < 3.0 + 1e-9 {
        let (status, [_, early, event], last) = step(&fmu, t, n * h - t);
        assert_eq!(status, OK, "{:?}", fmu.messages());
        t = if early == 1 { last } else { n * h };
        n += f64::from(1 - early);
        if early == 1 || event == 1 {
            events.push(t);
        }
        if event == 1 {
            assert_eq!(fmu.event(), OK);
            assert!(fmu.settle().0, "a bounce at {t}");
            assert_eq!(fmu.leave(), OK);
        }
        if early == 0 && (count(t / grid) * grid - t).abs() < 1e-9 {
            rows.push(bits(&fmu));
        }
    }
    (rows, events)
}

#[test]
fn every_use_of_event_mode_and_early_return_has_the_same_bits() {
    let plain = Kind::Cs3 { event: false, early: false };
    let wanted = |grid: f64| run(plain, 1e-3, grid).0;
    let bounced = run(Kind::Cs3 { event: true, early: true }, 1.0, 1.0).1;
    assert_eq!((bounced.len(), bounced[0]), (12, 0.453));
    for h in [1e-3, 7e-3, 1e-2] {
        for (event, early) in [(false, false), (false, true), (true, false), (true, true)] {
            let (rows, events) = run(Kind::Cs3 { event, early }, h, h);
            assert_eq!(rows, wanted(h)[..rows.len()], "steps of {h} s, event mode {event}, early return {early}");
            if early || h < 2e-3 {
                assert!(events.iter().all(|t| bounced.iter().any(|b| (b - t).abs() < 1e-9)), "{events:?}");
            }
            if event && early {
                assert_eq!(events.len(), bounced.len(), "steps of {h} s");
            }
        }
    }
    let two = Fmu::running(Kind::Cs2, 0.0);
    assert_eq!((two.step(0.0, 0.5).0, two.step(0.5, 0.5).0), (OK, OK));
    assert_eq!(bits(&two), wanted(0.5)[2], "FMI 2.0");
}

#[test]
fn a_model_has_log_categories_of_its_own() {
    for kind in CS {
        let said = |fmu: &Fmu| -> Vec<(String, String)> {
            fmu.messages().into_iter().map(|m| (m.category, m.text)).filter(|(c, _)| c != "logEvents").collect()
        };
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!(fmu.logging(true, &[c"bounce", c"rest"]), OK);
        assert_eq!(fmu.step(0.0, 0.5).0, OK);
        assert_eq!(said(&fmu), [("bounce".into(), "it: at 0.5 s: 1 bounces".into())], "{kind:?}");
        assert_eq!(fmu.step(0.5, 0.2).0, OK);
        assert!(said(&fmu).is_empty(), "once in a second");
        assert_eq!((fmu.logging(false, &[c"bounce"]), fmu.step(0.7, 1.3).0, said(&fmu).len()), (OK, OK, 0));
        assert_eq!((fmu.logging(true, &[]), fmu.step(2.0, 0.1).0), (OK, OK));
        let all = said(&fmu);
        assert_eq!(all.iter().filter(|(category, _)| category == "bounce").count(), 1, "{all:?}");
        let unknown = (
            "logStatusWarning".to_owned(),
            "it: at 2.1 s: said (the model names no log category \"unknown\")".to_owned(),
        );
        assert!(all.contains(&unknown), "{all:?}");
        assert_eq!(fmu.logging(true, &[c"bouncing"]), ERROR);
        let text = fmu.messages().pop().unwrap().text;
        assert!(text.contains("logStatusFatal, bounce, rest"), "{text}");
    }
}

#[test]
fn the_description_has_it_all() {
    let d = Description::exported::<fmi::This>().unwrap();
    let v = |name: &str| d.variable(name).unwrap();
    let unknowns: Vec<&str> =
        d.variables.iter().filter(|v| v.initial_dependencies.is_some()).map(|v| v.name.as_str()).collect();
    assert_eq!(
        unknowns,
        ["energy", "der(h)", "der(v)"],
        "a variable with an exact start value is not an initial unknown"
    );
    assert_eq!(v("energy").initial_dependencies.as_ref().unwrap(), &[H, V_], "but a known of them");
    assert_eq!(v("der(v)").initial_dependencies.as_ref().unwrap(), &[RESTS]);
    assert!(v("h").exact && !v("energy").exact && v("v_min").start.is_some() && v("bounces").start.is_some());
    assert!(d.model_exchange.as_ref().unwrap().event_mode);
    assert_eq!(E, v("e").value_reference);
}
