//! Random calls, right and wrong, of two instances that share saved states, each against an [`Oracle`]: the state table of the
//! standards written down once more by hand, with the model run natively.
//!
//! Every message ends with the calls made so far. `FMU_CALLS=1000000` makes more of them, `FMU_SEED=n` others.

mod state;

use crate::fmi::*;
use fmu_core::draw::Draw;
use fmu_export::abi::types::*;
pub use state::State;
use std::collections::BTreeMap;
use std::fmt::{Debug, Write};
use std::ptr::null_mut;

const OK: c_int = 0;
const DISCARD: c_int = 2;
const ERROR: c_int = 3;

/// A call of the standard, by its purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Call {
    Enter,
    Exit,
    Configure,
    Configured,
    Terminate,
    Reset,
    Step,
    Event,
    Update,
    Leave,
    SetTime,
    Completed,
    SetStates,
    GetStates,
    Derivatives,
    Indicators,
    Nominals,
    Count,
    Directional,
    SetClock,
    GetClock,
    Interval,
    SetInterval,
    Shift,
    Activate,
    Set,
    Get,
    SetSizes,
    SetIntegers,
    SetMap,
    SetTexts,
    GetTexts,
    SetBytes,
    GetBytes,
    /// The importer saves a state, or restores one, possibly through bytes.
    Save,
    Restore,
    /// It frees the instance and creates another one.
    New,
}

/// The status of a call, and the expected one.
pub type Statuses = [c_int; 2];

/// The status of a call that may be wrong in one way only.
pub fn verdict(fits: bool) -> c_int {
    if fits { OK } else { ERROR }
}

/// Bits of numbers, for a comparison to the last one.
pub fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// An instance from its importer's point of view.
pub trait Importer {
    fn it(&self) -> InstancePointer;

    fn version(&self) -> u8 {
        3
    }

    /// The messages since the last call; `None` without a logger.
    fn messages(&self) -> Option<Vec<String>> {
        None
    }
}

/// The expected state of an instance.
pub trait Oracle: Clone {
    type Importer: Importer;
    /// The calls of this model; one in [`WILD`](Self::WILD) is any of them.
    const CALLS: &'static [Call];
    const WILD: usize;

    /// A new instance and its expected state.
    fn open(draw: &mut Draw) -> (Self::Importer, Self);

    fn state(&mut self) -> &mut State;

    /// The next calls of a simulation, weighted by repetition.
    fn next(&self) -> &'static [Call];

    /// Makes a call. If it fails, [`failed`](Self::failed) undoes the changes.
    fn call(&mut self, call: Call, turn: &mut Turn<'_, Self>) -> Statuses;

    /// Compares what can be read.
    fn look(&mut self, importer: &Self::Importer, trace: &str);

    /// The expected state after a call that failed: that `before` it. The state of the lifecycle follows from the status.
    fn failed(self, before: Self, _call: Call) -> Self {
        before
    }

    /// It is about to be saved.
    fn saves(&mut self) {}

    /// Whether an instance like this one can have the state `saved`.
    fn accepts(&self, _saved: &Self) -> bool {
        true
    }

    /// Whether its bytes can be restored.
    fn is_storable(&self) -> bool {
        true
    }

    /// Everything outside a saved state remains.
    fn restored(&mut self, saved: &Self) {
        self.clone_from(saved);
    }

    /// Whether the call can ever succeed for this model.
    fn can(_call: Call) -> bool {
        true
    }
}

/// Saved states, each with the expected state of an instance after restoring it.
type Saved<O> = [(FmuState, Option<O>); 3];

/// An instance at one call.
pub struct Turn<'a, O: Oracle> {
    pub importer: &'a mut O::Importer,
    pub draw: &'a mut Draw,
    pub trace: &'a mut String,
    saved: &'a mut Saved<O>,
}

impl<O: Oracle> Turn<'_, O> {
    /// True once in twenty calls.
    pub fn rarely(&mut self) -> bool {
        self.draw.below(20) == 0
    }

    /// Mostly one of the `right` values, rarely one of the `wrong` ones.
    pub fn mostly<T: Copy>(&mut self, right: &[T], wrong: &[T]) -> T {
        if self.rarely() { self.draw.of(wrong) } else { self.draw.of(right) }
    }

    /// A number of values, rarely one more or less.
    pub fn count(&mut self, right: usize) -> usize {
        self.mostly(&[right], &[right + 1, right.saturating_sub(1)])
    }

    /// The arguments of the call.
    pub fn note(&mut self, arguments: impl Debug) {
        let _ = write!(self.trace, " {arguments:?}");
    }

    /// `GetFMUState` in one of these states.
    fn save(&mut self, oracle: &mut O) -> Statuses {
        let (state, of) = &mut self.saved[self.draw.below(3)];
        let status = get_state(self.importer, state);
        if status == OK {
            oracle.saves();
            *of = Some(oracle.clone());
        }
        [status, verdict(State::SAVED.contains(oracle.state()))]
    }

    /// `SetFMUState`, half of the times with a copy of the state that went through bytes.
    fn restore(&mut self, oracle: &mut O) -> Statuses {
        let fits = |(_, of): &(FmuState, Option<O>)| of.as_ref().is_some_and(|saved| oracle.accepts(saved));
        let good = self.saved.iter().position(fits);
        let any = self.draw.below(3);
        let number = if self.rarely() { any } else { good.unwrap_or(any) };
        let (through, (state, of)) = (self.draw.below(2) == 0, &self.saved[number]);
        let (mut handle, mut fits, mut copy) = (*state, fits(&self.saved[number]), null_mut());
        if let (true, Some(saved)) = (through, of) {
            let storable = saved.is_storable();
            assert_eq!(through_bytes(self.importer, handle, &mut copy), verdict(storable), "bytes {}", self.trace);
            self.importer.messages();
            (handle, fits) = (copy, fits && storable);
            self.trace.push_str(" through bytes");
        }
        let status = set_state(self.importer, handle);
        if let (true, Some(saved)) = (fits, of) {
            oracle.restored(saved);
        }
        free_state(self.importer, &mut copy);
        [status, verdict(fits)]
    }
}

fn get_state(of: &impl Importer, state: &mut FmuState) -> c_int {
    unsafe { if of.version() == 2 { fmi2GetFMUstate(of.it(), state) } else { fmi3GetFMUState(of.it(), state) } }
}

fn set_state(of: &impl Importer, state: FmuState) -> c_int {
    unsafe { if of.version() == 2 { fmi2SetFMUstate(of.it(), state) } else { fmi3SetFMUState(of.it(), state) } }
}

fn free_state(of: &impl Importer, state: &mut FmuState) -> c_int {
    unsafe { if of.version() == 2 { fmi2FreeFMUstate(of.it(), state) } else { fmi3FreeFMUState(of.it(), state) } }
}

fn through_bytes(of: &impl Importer, state: FmuState, copy: &mut FmuState) -> c_int {
    let (it, mut size) = (of.it(), 0);
    unsafe {
        if of.version() == 2 {
            assert_eq!(fmi2SerializedFMUstateSize(it, state, &raw mut size), OK);
            let mut bytes = vec![0; size];
            assert_eq!(fmi2SerializeFMUstate(it, state, bytes.as_mut_ptr(), size), OK);
            fmi2DeSerializeFMUstate(it, bytes.as_ptr(), size, copy)
        } else {
            assert_eq!(fmi3SerializedFMUStateSize(it, state, &raw mut size), OK);
            let mut bytes = vec![0; size];
            assert_eq!(fmi3SerializeFMUState(it, state, bytes.as_mut_ptr(), size), OK);
            fmi3DeserializeFMUState(it, bytes.as_ptr(), size, copy)
        }
    }
}

/// Two instances, what is expected of them, and their saved states.
struct World<O: Oracle> {
    importers: [O::Importer; 2],
    oracles: [O; 2],
    saved: Saved<O>,
    trace: String,
}

impl<O: Oracle> World<O> {
    fn new(draw: &mut Draw) -> Self {
        let [(one, first), (other, second)] = [O::open(draw), O::open(draw)];
        let saved = std::array::from_fn(|_| (null_mut(), None));
        Self { importers: [one, other], oracles: [first, second], saved, trace: String::new() }
    }

    fn call(&mut self, draw: &mut Draw) -> (Call, c_int) {
        let Self { importers, oracles, saved, trace } = self;
        let who = draw.below(2);
        let (importer, oracle) = (&mut importers[who], &mut oracles[who]);
        let call = if draw.below(O::WILD) == 0 { draw.of(O::CALLS) } else { draw.of(oracle.next()) };
        let _ = write!(trace, "\n{who} {:?} {call:?}", oracle.state());
        let before = oracle.clone();
        let mut turn = Turn { importer, draw, trace, saved };
        let [status, wanted] = match call {
            Call::Save => turn.save(oracle),
            Call::Restore => turn.restore(oracle),
            _ => oracle.call(call, &mut turn),
        };
        let messages = importer.messages();
        assert_eq!(status, wanted, "{trace}\n{messages:?}");
        if let Some(messages) = messages {
            assert_eq!(messages.len(), usize::from(status == ERROR), "{trace}\n{messages:?}");
        }
        match status {
            ERROR => {
                *oracle = oracle.clone().failed(before, call);
                *oracle.state() = State::Error;
            }
            DISCARD => *oracle = oracle.clone().failed(before, call),
            _ => {}
        }
        if draw.below(4) == 0 || status == ERROR {
            for (oracle, importer) in self.oracles.iter_mut().zip(&self.importers) {
                oracle.look(importer, &self.trace);
            }
        }
        (call, status)
    }
}

impl<O: Oracle> Drop for World<O> {
    fn drop(&mut self) {
        for (state, _) in &mut self.saved {
            free_state(&self.importers[0], state);
        }
    }
}

fn asked(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |text| text.parse().expect("a whole number"))
}

/// At least this number of calls, in sequences of 250.
pub fn random_calls<O: Oracle>(calls: u64) {
    // The library silences panics; a test needs its own.
    fmu_export::abi::quiet();
    drop(std::panic::take_hook());
    let (calls, mut draw) = (asked("FMU_CALLS", calls), Draw(asked("FMU_SEED", 1)));
    let mut tally = BTreeMap::<Call, [u64; 3]>::new();
    while tally.values().flatten().sum::<u64>() < calls {
        let mut world = World::<O>::new(&mut draw);
        for _ in 0..250 {
            let (call, status) = world.call(&mut draw);
            let column = [OK, DISCARD, ERROR].iter().position(|&s| s == status).expect("a status");
            tally.entry(call).or_default()[column] += 1;
        }
    }
    for (call, [ok, discard, error]) in &tally {
        println!("{call:12?} OK {ok:8}  Discard {discard:6}  Error {error:8}");
    }
    let [ok, other] = tally.values().fold([0, 0], |[a, b], [ok, discard, error]| [a + ok, b + discard + error]);
    assert!(ok > other, "most calls fail: {ok} {other}");
    for call in O::CALLS {
        let [ok, ..] = tally.get(call).copied().unwrap_or_default();
        assert!((ok > 0) == O::can(*call), "{call:?}: {ok} succeed");
    }
}
