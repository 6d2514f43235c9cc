//! The expected results: FMI 2.0.5, 4.2.4 and FMI 3.0.2, 2.3 and 4.2 written down once more, by hand, and the model run
//! natively.

use crate::common::model::*;
use crate::common::{DISCARD, ERROR, OK};
use crate::operation::{Arrays, Categories, Kind, Mixed, Point};
use crate::state::State;
use fmu_core::{Block, Elapsed, Model, Slot, Step};
use std::ffi::c_int;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// States that allow a call: first FMI 2.0, then FMI 3.0.
pub(crate) const GET: [&[State]; 2] = [
    &[State::Initialization, State::Step, State::Terminated, State::Error],
    &[State::Instantiated, State::Initialization, State::Step, State::Terminated, State::Error],
];
pub(crate) const SET: [&[State]; 2] = [
    &[State::Instantiated, State::Initialization, State::Step],
    &[State::Instantiated, State::Initialization, State::Step],
];
pub(crate) const SETUP: [&[State]; 2] = [&[State::Instantiated], &[]];
pub(crate) const ENTER: [&[State]; 2] = [&[State::Instantiated], &[State::Instantiated]];
pub(crate) const EXIT: [&[State]; 2] = [&[State::Initialization], &[State::Initialization]];
pub(crate) const STEP: [&[State]; 2] = [&[State::Step], &[State::Step]];
pub(crate) const TERMINATE: [&[State]; 2] = [&[State::Step], &[State::Step]];
pub(crate) const SAVE: [&[State]; 2] = [
    &[State::Instantiated, State::Initialization, State::Step, State::Terminated],
    &[State::Instantiated, State::Initialization, State::Step, State::Terminated],
];
pub(crate) const STATUS: [&[State]; 2] = [&[State::Step, State::Terminated], &[]];
pub(crate) const ANY: [&[State]; 2] = [
    &[State::Instantiated, State::Initialization, State::Step, State::Terminated, State::Error],
    &[State::Instantiated, State::Initialization, State::Step, State::Terminated, State::Error],
];

/// The values that a saved state must restore.
#[derive(Clone)]
pub(crate) struct Snapshot {
    pub(crate) state: State,
    experiment: Option<(f64, Option<f64>)>,
    elapsed: Elapsed,
    end: f64,
    /// Set but not yet passed to the model.
    fresh: bool,
    block: Block<Probe>,
}

impl Snapshot {
    pub(crate) fn new() -> Self {
        Self {
            state: State::Instantiated,
            experiment: None,
            elapsed: Elapsed::ZERO,
            end: 0.0,
            fresh: true,
            block: Block::default(),
        }
    }

    /// Bytes of a state with a NaN output are refused.
    pub(crate) fn is_storable(&self) -> bool {
        !self.real(X).is_nan() && !self.real(DOUBLE_GAIN).is_nan()
    }

    pub(crate) fn is_without_experiment(&self) -> bool {
        self.experiment.is_none()
    }

    /// The model's rules across parameters.
    fn is_valid(&self) -> bool {
        self.real(MAP) <= self.real(MAP + 2) && self.real(GAIN) * self.real(R) <= 50.0
    }

    /// Reading it would panic in the model.
    pub(crate) fn is_unlucky(&self) -> bool {
        self.fresh && self.integer(N) == 13
    }

    fn slot<T>(&self, reference: u32, read: impl FnOnce(Slot<'_>) -> T) -> T {
        let mut block = self.block.clone();
        read(Probe::TABLE.entry(&mut block, reference as usize - 1).unwrap().1)
    }

    fn real(&self, reference: u32) -> f64 {
        self.slot(reference, |slot| if let Slot::Real(x) = slot { *x } else { unreachable!() })
    }

    fn integer(&self, reference: u32) -> i32 {
        self.slot(reference, |slot| match slot {
            Slot::Integer(x) => i32::try_from(x.get()).unwrap(),
            Slot::Enumeration(x) => x.get(),
            _ => unreachable!(),
        })
    }

    fn truth(&self, reference: u32) -> bool {
        self.slot(reference, |slot| if let Slot::Boolean(x) = slot { *x } else { unreachable!() })
    }

    /// The value belongs to a fixed parameter: in Step Mode such a set is accepted without effect.
    fn is_kept(&self, version: u8, kind: Kind, reference: u32, value: Mixed) -> bool {
        match (kind, reference) {
            // -0 equals 0.
            (Kind::Real, R | 8..=10) => (self.real(reference) + 0.0).to_bits() == (value.real + 0.0).to_bits(),
            (Kind::Integer, MODE) if version != 2 => false,
            (Kind::Integer, N | MODE) | (Kind::Enumeration, MODE) => {
                i64::from(self.integer(reference)) == value.integer
            }
            (Kind::Boolean, FLAG) => self.truth(reference) == (value.truth != 0),
            _ => false,
        }
    }

    fn put(&mut self, reference: u32, value: Mixed) {
        match Probe::TABLE.entry(&mut self.block, reference as usize - 1).unwrap().1 {
            Slot::Real(x) => *x = value.real,
            Slot::Integer(x) => assert!(x.set(value.integer.into())),
            Slot::Boolean(x) => *x = value.truth != 0,
            Slot::Enumeration(x) => assert!(x.set(i32::try_from(value.integer).unwrap())),
            _ => unreachable!(),
        }
    }

    /// Before the start, outputs and calculated parameters match the values set.
    pub(crate) fn refresh(&mut self) -> Result<(), ()> {
        if self.fresh && [State::Instantiated, State::Initialization].contains(&self.state) {
            self.guarded(|it| {
                it.block.initialize();
                it.fresh = false;
            })?;
        }
        Ok(())
    }

    /// A panic of the model is an error that may leave half of the work.
    fn guarded(&mut self, work: impl FnOnce(&mut Self)) -> Result<(), ()> {
        catch_unwind(AssertUnwindSafe(|| work(self))).map_err(|_| ())
    }

    /// Bits of one value as a type, or `None`: another type, or no such variable.
    pub(crate) fn value(&self, version: u8, kind: Kind, reference: u32) -> Option<u64> {
        Some(match (kind, reference) {
            (Kind::Real, TIME) if version == 3 => self.end.to_bits(),
            (Kind::Real, U | K | X | R | 8..=10 | GAIN | DOUBLE_GAIN) => self.real(reference).to_bits(),
            (Kind::Integer, COUNT | N) => u64::from(self.integer(reference).cast_unsigned()),
            (Kind::Integer, MODE) if version == 2 => u64::from(self.integer(reference).cast_unsigned()),
            (Kind::Enumeration, MODE) => i64::from(self.integer(reference)).cast_unsigned(),
            (Kind::Boolean, ON | HIGH | FLAG) => self.truth(reference).into(),
            _ => return None,
        })
    }
}

/// Number of values of a reference; `None`: an element of an array, which FMI 3.0 cannot name.
pub(crate) fn elements(version: u8, reference: u32) -> Option<usize> {
    match (version, reference) {
        (3, MAP) => Some(3),
        (3, 9 | 10) => None,
        _ => Some(1),
    }
}

/// Whether the value may be set to a variable in a state.
fn settable(version: u8, kind: Kind, state: State, reference: u32, value: Mixed) -> bool {
    let (x, n) = (value.real, value.integer);
    let early = state != State::Step;
    match (kind, reference) {
        (Kind::Real, U) => x.is_finite(),
        (Kind::Real, K) => (-5.0..=5.0).contains(&x),
        (Kind::Real, R) => early && x > 0.0 && x.is_finite(),
        (Kind::Real, 8..=10) => early && x >= -1.0 && x.is_finite(),
        (Kind::Real, GAIN) => (0.0..=10.0).contains(&x),
        (Kind::Integer, N) => early && n >= 1,
        (Kind::Integer, MODE) if version == 2 => early && [1, 2, 4].contains(&n),
        (Kind::Enumeration, MODE) => early && [1, 2, 4].contains(&n),
        (Kind::Boolean, ON) => true,
        (Kind::Boolean, FLAG) => early,
        _ => false,
    }
}

/// One instance, as it should be.
#[derive(Clone)]
pub(crate) struct Reference {
    pub(crate) version: u8,
    pub(crate) now: Snapshot,
    /// Enabled categories: events, warning, discard, error, fatal.
    pub(crate) heard: [bool; 5],
    /// The last call is accepted with a warning, which is logged once.
    pub(crate) warns: bool,
    pub(crate) warned: bool,
    /// The first step has begun.
    pub(crate) begun: bool,
}

/// The names of the categories, in the order of [`Reference::heard`].
const CATEGORIES: [&[u8]; 5] =
    [b"logEvents", b"logStatusWarning", b"logStatusDiscard", b"logStatusError", b"logStatusFatal"];

impl Reference {
    pub(crate) fn new(version: u8, logging: bool) -> Self {
        Self { version, now: Snapshot::new(), heard: [logging; 5], warns: false, warned: false, begun: false }
    }

    /// The status of a call that needs one of these states, and the state afterwards if it failed.
    pub(crate) fn call(&mut self, states: [&[State]; 2], work: impl FnOnce(&mut Self) -> Result<c_int, ()>) -> c_int {
        let states = states[usize::from(self.version - 2)];
        let status = if states.contains(&self.now.state) { work(self).unwrap_or(ERROR) } else { ERROR };
        if status == ERROR {
            self.now.state = State::Error;
        }
        status
    }

    pub(crate) fn logging(&mut self, on: bool, categories: &Categories) -> c_int {
        self.call(ANY, |it| {
            let Categories::Names(names) = categories else { return Err(()) };
            let mut listed = [names.is_empty(); 5];
            for name in names {
                let name = name.ok_or(())?;
                match CATEGORIES.iter().position(|c| *c == name) {
                    Some(i) => listed[i] = true,
                    None if it.version == 2 && name == b"logAll" => listed = [true; 5],
                    None => return Err(()),
                }
            }
            for (heard, listed) in it.heard.iter_mut().zip(listed) {
                // In FMI 2.0, `on` switches on the listed categories and no others; in FMI 3.0 the others keep their state.
                *heard = if listed { on } else { *heard && !(it.version == 2 && on) };
            }
            Ok(OK)
        })
    }

    fn experiment(&mut self, start: f64, stop: Option<f64>) -> Result<(), ()> {
        let good = start.is_finite() && stop.is_none_or(|stop| stop.is_finite() && stop > start);
        if !good {
            return Err(());
        }
        self.now.experiment = Some((start, stop));
        self.now.end = start;
        Ok(())
    }

    pub(crate) fn set_up(&mut self, start: f64, stop: Option<f64>) -> c_int {
        self.call(SETUP, |it| it.experiment(start, stop).map(|()| OK))
    }

    pub(crate) fn enter(&mut self, start: f64, stop: Option<f64>) -> c_int {
        self.call(ENTER, |it| {
            if it.version == 3 {
                it.experiment(start, stop)?;
            }
            it.now.experiment.ok_or(())?;
            it.now.state = State::Initialization;
            Ok(OK)
        })
    }

    pub(crate) fn exit(&mut self) -> c_int {
        self.call(EXIT, |it| {
            if !it.now.is_valid() || !it.now.is_storable() {
                return Err(());
            }
            it.now.guarded(|now| now.block.initialize())?;
            it.now.fresh = false;
            it.now.state = State::Step;
            Ok(OK)
        })
    }

    pub(crate) fn terminate(&mut self) -> c_int {
        self.call(TERMINATE, |it| {
            it.now.state = State::Terminated;
            Ok(OK)
        })
    }

    pub(crate) fn reset(&mut self) -> c_int {
        (self.now, self.begun) = (Snapshot::new(), false);
        OK
    }

    /// The status and, if it is OK, the bits.
    pub(crate) fn get(&mut self, kind: Kind, references: &[u32], arrays: Arrays) -> (c_int, Vec<u64>) {
        let mut bits = Vec::new();
        let status = self.call(GET, |it| {
            it.arrays(kind, references, arrays)?;
            it.now.refresh()?;
            for &reference in references {
                for offset in 0..elements(it.version, reference).ok_or(())? {
                    let reference = reference.wrapping_add(u32::try_from(offset).unwrap());
                    bits.push(it.now.value(it.version, kind, reference).ok_or(())?);
                }
            }
            Ok(OK)
        });
        (status, bits)
    }

    /// Whether the arrays are usable.
    fn arrays(&self, kind: Kind, references: &[u32], arrays: Arrays) -> Result<(), ()> {
        let empty = references.is_empty();
        let byte = matches!(kind, Kind::Boolean | Kind::Foreign(1 | 2));
        let aligned = byte && self.version == 3;
        let usable = match arrays {
            Arrays::Good => true,
            Arrays::NullReferences | Arrays::NullValues => empty,
            Arrays::Misaligned => empty || aligned,
            Arrays::More => self.version == 2,
            Arrays::Less => self.version == 2 || empty,
        };
        if !usable {
            return Err(());
        }
        if references.iter().any(|&r| elements(self.version, r).is_none()) {
            return Err(());
        }
        Ok(())
    }

    pub(crate) fn set(&mut self, kind: Kind, references: &[u32], values: &[Mixed], arrays: Arrays) -> c_int {
        self.call(SET, |it| {
            it.arrays(kind, references, arrays)?;
            let mut values = values.iter();
            let (mut after, mut kept) = (it.now.clone(), false);
            for &reference in references {
                for offset in 0..elements(it.version, reference).unwrap_or(1) {
                    let reference = reference.wrapping_add(u32::try_from(offset).unwrap());
                    let value = *values.next().unwrap();
                    if it.now.state == State::Step && it.now.is_kept(it.version, kind, reference, value) {
                        kept = true;
                        continue;
                    }
                    if !settable(it.version, kind, it.now.state, reference, value) {
                        return Err(());
                    }
                    after.put(reference, value);
                    after.fresh |= it.now.state != State::Step || reference == GAIN;
                }
            }
            it.now = after;
            it.warns = kept && !it.warned && it.heard[1];
            it.warned |= it.warns;
            Ok(OK)
        })
    }

    /// Where a step begins.
    pub(crate) fn point(&self, at: Point, h: f64) -> f64 {
        match at {
            Point::Continues(away) => self.now.end + away * h,
            Point::At(t) => t,
        }
    }

    pub(crate) fn step(&mut self, t: f64, h: f64, null: bool) -> c_int {
        self.call(STEP, |it| {
            let now = &mut it.now;
            let rounding = |t: f64| 2.0 * f64::EPSILON * t.abs();
            let continues = (t - now.end).abs() <= h / 100.0 + rounding(t);
            let elapsed = now.elapsed.plus(h);
            let beyond = now.experiment.is_some_and(|(start, stop)| {
                stop.is_some_and(|stop| (start + elapsed.seconds()).min(t + h) > stop + 1e-9 * h + rounding(stop))
            });
            let fits = h.is_normal() && h > 0.0 && (t + h).is_finite() && t + h > t && continues;
            if null || !fits || beyond || now.fresh && !now.is_valid() {
                return Err(());
            }
            let step = Step { start: now.elapsed, h };
            // Two inputs do not start at 0.
            it.warns = !it.begun && it.heard[1] && (now.real(U) == 0.0 || !now.truth(ON));
            it.begun = true;
            now.guarded(|now| {
                if now.fresh {
                    now.block.model.derive();
                    now.fresh = false;
                }
                // A fault of the model appears in this mode; its changes until then remain.
                if now.block.step(&step).is_ok() {
                    now.elapsed = elapsed;
                    now.end = t + h;
                }
            })?;
            if now.integer(MODE) == FAULTY { Err(()) } else { Ok(OK) }
        })
    }

    /// A `fmi2Get...Status` by its number: status, real, integer, Boolean, text.
    pub(crate) fn status(&mut self, function: u8, kind: i32, null: bool) -> c_int {
        self.call(STATUS, |_| match (function, kind) {
            (1 | 3, _) if null => Err(()),
            (1, 2) | (3, 3) => Ok(OK),
            _ => Ok(DISCARD),
        })
    }
}
