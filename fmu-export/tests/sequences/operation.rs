//! The calls of an importer that may be wrong in everything except invalid pointers, which no binary can detect.

use crate::common::model::*;
use proptest::prelude::*;
use proptest::sample::select;

/// A call and its target.
#[derive(Clone, Debug)]
pub(crate) struct Operation {
    /// Which of the two instances.
    pub(crate) who: usize,
    /// As whose function.
    pub(crate) door: Door,
    pub(crate) call: Call,
    /// Whether every variable and the state of the life cycle are compared afterwards.
    pub(crate) look: bool,
}

/// Function, standard and target of the call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Door {
    /// That of the instance.
    Own,
    /// That of the other standard.
    Other,
    /// That of the instance's standard with NULL for an instance.
    Nobody,
}

/// A C type, in FMI 2.0 one of the first three or a text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Real,
    Integer,
    /// In FMI 3.0 a separate type, `Int64`.
    Enumeration,
    Boolean,
    /// One of the types that no variable of this model has.
    Foreign(u8),
}

/// Fault in the arrays of a getter or setter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Arrays {
    Good,
    NullReferences,
    NullValues,
    Misaligned,
    /// One value too many (FMI 3.0 only).
    More,
    /// One less.
    Less,
}

/// A value for any type.
#[derive(Clone, Copy)]
pub(crate) struct Mixed {
    pub(crate) real: f64,
    pub(crate) integer: i64,
    pub(crate) truth: u8,
}

impl std::fmt::Debug for Mixed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}|{}|{}", self.real, self.integer, self.truth)
    }
}

/// Categories of `SetDebugLogging`: names, `None` for NULL; the whole list may be NULL.
#[derive(Clone, Debug)]
pub(crate) enum Categories {
    Names(Vec<Option<&'static [u8]>>),
    NullOf(usize),
}

/// A variable for a saved state.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Slot {
    /// A variable of the importer: NULL or a state.
    Own(usize),
    /// A state that was freed, by its age.
    Freed(usize),
    /// A number that is not a state.
    Garbage(usize),
    /// No variable at all.
    Null,
}

/// Where a step begins.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Point {
    /// At the end of the last one, and this much of the step away.
    Continues(f64),
    At(f64),
}

/// Damage to stored bytes before they are restored.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Damage {
    None,
    Flip(usize),
    Cut(usize),
    Null,
}

#[derive(Clone, Debug)]
pub(crate) enum Call {
    /// The next call of a plain simulation.
    Onward,
    /// Frees the instance and creates another one, after a first attempt with this error (0: no such attempt).
    New {
        version: u8,
        wrong: u8,
    },
    Logging {
        on: bool,
        categories: Categories,
    },
    /// `fmi2SetupExperiment`; in FMI 3.0 as `Enter`.
    SetUp(f64, Option<f64>),
    Enter(f64, Option<f64>),
    Exit,
    Terminate,
    Reset,
    Get {
        kind: Kind,
        references: Vec<u32>,
        arrays: Arrays,
    },
    Set {
        kind: Kind,
        references: Vec<u32>,
        values: Vec<Mixed>,
        arrays: Arrays,
    },
    /// `null`: which of FMI 3.0's four results is NULL, 4 for none.
    Step {
        at: Point,
        h: f64,
        free: bool,
        null: usize,
    },
    Save(Slot),
    Restore(Slot),
    Free(Slot),
    Size {
        slot: Slot,
        null: bool,
    },
    /// Into the blob of this number; `room`: additional bytes.
    Serialize {
        slot: Slot,
        blob: usize,
        room: i8,
        null: bool,
    },
    Deserialize {
        blob: usize,
        damage: Damage,
        slot: Slot,
    },
    /// FMI 2.0: the function by its number, the kind of status, a NULL result.
    Status {
        function: u8,
        kind: i32,
        null: bool,
    },
    Unsupported(usize),
}

/// Numbers of slots and blobs.
pub(crate) const PLACES: usize = 3;

fn real() -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => select(vec![0.0, -0.0, 0.5, 1.0, 2.0, 5.0, 10.0, -1.0]),
        1 => select(vec![5.1, 10.1, -5.1, 1e308, -1e308, 5e-324, f64::NAN, f64::INFINITY, f64::NEG_INFINITY]),
        2 => 0.0..3.0_f64,
        1 => any::<f64>(),
    ]
}

fn mixed() -> impl Strategy<Value = Mixed> {
    let integer = prop_oneof![
        6 => select(vec![1, 2, 3, 4, 1, 1]),
        1 => select(vec![0, 13, -1, 1 << 32, (1 << 32) + 1, i64::MAX, i64::MIN, i64::from(i32::MAX)]),
    ];
    let truth = select(vec![0, 1, 2, 255]);
    (real(), integer, truth).prop_map(|(real, integer, truth)| Mixed { real, integer, truth })
}

/// Variables of a type, mostly.
fn access() -> impl Strategy<Value = (Kind, Vec<u32>)> {
    let many = |refs: Vec<u32>, n| prop::collection::vec(select(refs), 0..n);
    let all: Vec<u32> = (0..18).chain([1000, u32::MAX]).collect();
    let kinds = vec![Kind::Real, Kind::Integer, Kind::Enumeration, Kind::Boolean];
    prop_oneof![
        8 => many(vec![U, U, GAIN, K], 4).prop_map(|r| (Kind::Real, r)),
        2 => many(vec![U, K, X, R, MAP, GAIN, DOUBLE_GAIN, TIME], 12).prop_map(|r| (Kind::Real, r)),
        2 => many(vec![ON, ON, HIGH, FLAG], 4).prop_map(|r| (Kind::Boolean, r)),
        1 => many(vec![COUNT, N, MODE], 4).prop_map(|r| (Kind::Integer, r)),
        1 => many(vec![MODE], 2).prop_map(|r| (Kind::Enumeration, r)),
        1 => (select(kinds), many(all.clone(), 12)),
        1 => ((0..10_u8).prop_map(Kind::Foreign), many(all, 2)),
    ]
}

fn arrays() -> impl Strategy<Value = Arrays> {
    let wrong = vec![Arrays::NullReferences, Arrays::NullValues, Arrays::Misaligned, Arrays::More, Arrays::Less];
    prop_oneof![12 => Just(Arrays::Good), 1 => select(wrong)]
}

fn slot() -> impl Strategy<Value = Slot> {
    prop_oneof![
        12 => (0..PLACES).prop_map(Slot::Own),
        1 => (0..9_usize).prop_map(Slot::Freed),
        1 => select(vec![Slot::Garbage(1), Slot::Garbage(usize::MAX), Slot::Garbage(0x7fff_ffff_0000), Slot::Null]),
    ]
}

fn experiment() -> impl Strategy<Value = (f64, Option<f64>)> {
    let start = prop_oneof![6 => select(vec![0.0, -5.0, 1e6]), 1 => real()];
    let stop =
        prop_oneof![3 => Just(None), 2 => select(vec![0.5, 2.0, 2e6]).prop_map(Some), 1 => real().prop_map(Some)];
    (start, stop)
}

fn logging() -> impl Strategy<Value = Call> {
    let name =
        select(vec![&b"logEvents"[..], b"logStatusDiscard", b"logStatusError", b"logStatusWarning", b"logStatusFatal"]);
    let odd = select(vec![Some(&b"logAll"[..]), Some(b"logNothing"), Some(b""), Some(b"\xff"), None]);
    let names =
        prop::collection::vec(prop_oneof![8 => name.prop_map(Some), 1 => odd], 0..4).prop_map(Categories::Names);
    let categories = prop_oneof![12 => names, 1 => (1..3_usize).prop_map(Categories::NullOf)];
    (any::<bool>(), categories).prop_map(|(on, categories)| Call::Logging { on, categories })
}

fn step() -> impl Strategy<Value = Call> {
    let at = prop_oneof![
        20 => Just(Point::Continues(0.0)),
        2 => select(vec![0.009, -0.009, 0.02, -0.02, 1.0, -1.0]).prop_map(Point::Continues),
        1 => real().prop_map(Point::At),
    ];
    let h = prop_oneof![
        8 => select(vec![0.1, 1e-4, 0.01, 1e-3]),
        1 => 1e-6..0.5_f64,
        1 => prop_oneof![select(vec![0.0, -0.1, 1e-12, 1e6]), real()],
    ];
    let null = prop_oneof![20 => Just(4_usize), 1 => 0..4_usize];
    (at, h, any::<bool>(), null).prop_map(|(at, h, free, null)| Call::Step { at, h, free, null })
}

fn set() -> impl Strategy<Value = Call> {
    // Three for each reference are enough.
    let values = prop::collection::vec(mixed(), 36);
    (access(), values, arrays()).prop_map(|((kind, references), mut values, arrays)| {
        values.truncate(3 * references.len());
        Call::Set { kind, references, values, arrays }
    })
}

fn states() -> impl Strategy<Value = Call> {
    let rarely = || prop::bool::weighted(0.05);
    let room = prop_oneof![9 => Just(0_i8), 1 => -3..3_i8];
    let damage = prop_oneof![
        6 => Just(Damage::None),
        2 => any::<usize>().prop_map(Damage::Flip),
        1 => any::<usize>().prop_map(Damage::Cut),
        1 => Just(Damage::Null),
    ];
    let blob = || 0..PLACES;
    prop_oneof![
        4 => slot().prop_map(Call::Save),
        4 => slot().prop_map(Call::Restore),
        1 => slot().prop_map(Call::Free),
        1 => (slot(), rarely()).prop_map(|(slot, null)| Call::Size { slot, null }),
        2 => (slot(), blob(), room, rarely()).prop_map(|(slot, blob, room, null)| Call::Serialize { slot, blob, room, null }),
        2 => (blob(), damage, slot()).prop_map(|(blob, damage, slot)| Call::Deserialize { blob, damage, slot }),
    ]
}

fn call() -> impl Strategy<Value = Call> {
    prop_oneof![
        55 => Just(Call::Onward),
        10 => step(),
        12 => set(),
        10 => (access(), arrays()).prop_map(|((kind, references), arrays)| Call::Get { kind, references, arrays }),
        12 => states(),
        3 => logging(),
        2 => experiment().prop_map(|(start, stop)| Call::SetUp(start, stop)),
        2 => experiment().prop_map(|(start, stop)| Call::Enter(start, stop)),
        1 => Just(Call::Exit),
        1 => Just(Call::Terminate),
        1 => Just(Call::Reset),
        2 => (0..5_u8, -1..5, prop::bool::weighted(0.1)).prop_map(|(function, kind, null)| Call::Status { function, kind, null }),
        1 => any::<usize>().prop_map(Call::Unsupported),
        1 => (2..=3_u8, 0..8_u8).prop_map(|(version, wrong)| Call::New { version, wrong }),
    ]
}

pub(crate) fn operation() -> impl Strategy<Value = Operation> {
    let door = prop_oneof![60 => Just(Door::Own), 1 => Just(Door::Other), 1 => Just(Door::Nobody)];
    (0..2_usize, door, call(), prop::bool::weighted(0.4)).prop_map(|(who, door, call, look)| Operation {
        who,
        door,
        call,
        look,
    })
}
