//! Two instances, their references, and the importer's saved states and bytes.

use crate::common::model::*;
use crate::common::*;
use crate::operation::{Arrays, Call, Damage, Door, Kind, Mixed, Operation, PLACES, Slot};
use crate::perform::{self, Done};
use crate::reference::{ANY, GET, Reference, SAVE, Snapshot, elements};
use crate::state::State;
use fmu_export::abi::types::*;
use std::collections::BTreeMap;
use std::fmt;
use std::ptr::{null, null_mut, without_provenance_mut};
use std::rc::Rc;

/// How many calls of each function ended with OK, Discard and Error.
#[derive(Default)]
pub(crate) struct Tally(BTreeMap<&'static str, [u64; 3]>);

impl Tally {
    fn add(&mut self, (status, name): Done) {
        let column = [OK, DISCARD, ERROR].iter().position(|&s| s == status).expect("a status of the standards");
        self.0.entry(name).or_default()[column] += 1;
    }

    pub(crate) fn calls(&self) -> u64 {
        self.0.values().flatten().sum()
    }

    pub(crate) fn functions(&self) -> usize {
        self.0.len()
    }

    #[expect(clippy::cast_precision_loss, reason = "a share")]
    pub(crate) fn share_of_success(&self) -> f64 {
        let [ok, discard, error] = self.0.values().fold([0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
        ok as f64 / (ok + discard + error) as f64
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, [ok, discard, error]) in &self.0 {
            writeln!(f, "{name:36} OK {ok:8}  Discard {discard:6}  Error {error:8}")?;
        }
        Ok(())
    }
}

pub(crate) struct World {
    fmus: [Fmu; 2],
    references: [Reference; 2],
    slots: [(FmuState, Option<Snapshot>); PLACES],
    blobs: [(Vec<u8>, Snapshot); PLACES],
    freed: Vec<FmuState>,
    /// States that the importer has forgotten, to be freed at the end.
    lost: Vec<FmuState>,
    /// For reading without side effects.
    glass: FmuState,
    /// Size of a stored state in bytes: the same for every state of this model.
    size: usize,
    prints: [Vec<u8>; 2],
}

impl World {
    pub(crate) fn new(versions: [u8; 2]) -> Self {
        let fmus = versions.map(Fmu::new);
        let mut world = Self {
            size: fmus[0].bytes().len(),
            fmus,
            references: versions.map(|version| Reference::new(version, false)),
            slots: std::array::from_fn(|_| (null_mut(), None)),
            blobs: std::array::from_fn(|_| (Vec::new(), Snapshot::new())),
            freed: Vec::new(),
            lost: Vec::new(),
            glass: null_mut(),
            prints: [Vec::new(), Vec::new()],
        };
        world.prints = [world.fingerprint(0), world.fingerprint(1)];
        world
    }

    pub(crate) fn perform(&mut self, operation: &Operation, tally: &mut Tally) {
        let who = operation.who;
        let call = self.resolved(who, &operation.call);
        if let Call::New { version, wrong } = call {
            self.renew(who, version, wrong, tally);
        } else {
            let heard = self.references[who].heard;
            let (own, it) = (self.references[who].version, self.fmus[who].it);
            let mut expected = Reference { warns: false, ..self.references[who].clone() };
            let done = match operation.door {
                Door::Own => self.call(&call, own, it, &mut expected),
                // Both end at the gate, so the effect of the call does not matter.
                Door::Other | Door::Nobody => {
                    let (version, it) = if operation.door == Door::Other { (5 - own, it) } else { (own, null_mut()) };
                    let (status, name) = self.attempt(&call, version, it);
                    if operation.door == Door::Other {
                        expected.now.state = State::Error;
                    }
                    (status, ERROR, name)
                }
            };
            let (status, wanted, name) = done;
            assert_eq!(status, wanted, "{name} of {operation:?}");
            tally.add((status, name));
            self.references[who] = expected;
            let events = matches!(call, Call::Exit | Call::Terminate | Call::Reset);
            self.check_messages(who, status, name, heard, events, operation.door == Door::Nobody);
        }
        assert!(self.fmus[1 - who].journal.0.borrow().is_empty(), "a message of the other instance");
        assert_eq!(self.fingerprint(1 - who), self.prints[1 - who], "the other instance noticed {operation:?}");
        if operation.look || self.references[who].now.state == State::Error {
            self.look(who, operation);
        }
        self.prints[who] = self.fingerprint(who);
    }

    /// A call of this instance's standard, with values that its types can represent.
    fn resolved(&self, who: usize, call: &Call) -> Call {
        let reference = &self.references[who];
        let version = reference.version;
        let kind_of = |kind: Kind| if version == 2 && kind == Kind::Enumeration { Kind::Integer } else { kind };
        match call.clone() {
            Call::Onward => match reference.now.state {
                State::Instantiated if version == 2 && reference.now.is_without_experiment() => Call::SetUp(0.0, None),
                State::Instantiated => Call::Enter(0.0, None),
                State::Initialization => Call::Exit,
                State::Step => {
                    Call::Step { at: crate::operation::Point::Continues(0.0), h: 0.01, free: false, null: 4 }
                }
                _ => Call::Reset,
            },
            Call::SetUp(start, stop) if version == 3 => Call::Enter(start, stop),
            Call::Status { kind, .. } if version == 3 => Call::Unsupported(kind.unsigned_abs() as usize),
            Call::Get { kind, references, arrays } => Call::Get { kind: kind_of(kind), references, arrays },
            Call::Set { kind, references, values, arrays } => {
                #[expect(clippy::cast_possible_truncation, reason = "what a 32-bit type carries")]
                let narrow = |v: Mixed| Mixed { integer: i64::from(v.integer as i32), ..v };
                let kind = kind_of(kind);
                let values = if kind == Kind::Integer { values.into_iter().map(narrow).collect() } else { values };
                Call::Set { kind, references, values, arrays }
            }
            other => other,
        }
    }

    /// Frees an instance and creates another, after one try with a mistake.
    fn renew(&mut self, who: usize, version: u8, wrong: u8, tally: &mut Tally) {
        if wrong > 0 {
            let journal = Journal::default();
            let name = perform::miscarry(version, wrong, (&raw const journal).cast_mut().cast());
            tally.add((ERROR, name));
            let messages = journal.0.take();
            assert_eq!(messages.len(), usize::from(has_logger(version)), "{messages:?}");
            assert!(messages.iter().all(|m| m.status == ERROR));
        }
        let logging = wrong % 2 == 1;
        let journal = Rc::<Journal>::default();
        let it = Fmu::open(version, c"probe", &token(), &raw const *journal, true, logging);
        assert!(!it.is_null());
        assert_eq!(journal.0.borrow_mut().drain(..).count(), usize::from(logging && has_logger(version)));
        let free = if self.fmus[who].version == 2 { "fmi2FreeInstance" } else { "fmi3FreeInstance" };
        tally.add((OK, free));
        tally.add((OK, if version == 2 { "fmi2Instantiate" } else { "fmi3InstantiateCoSimulation" }));
        self.fmus[who] = Fmu { version, it, journal };
        self.references[who] = Reference::new(version, logging);
    }

    /// Makes the call; returns the actual and expected results and the function's name. `expected` is updated.
    fn call(
        &mut self,
        call: &Call,
        version: u8,
        it: InstancePointer,
        expected: &mut Reference,
    ) -> (c_int, c_int, &'static str) {
        let wanted = match call {
            Call::Logging { on, categories } => expected.logging(*on, categories),
            Call::SetUp(start, stop) => expected.set_up(*start, *stop),
            Call::Enter(start, stop) => expected.enter(*start, *stop),
            Call::Exit => expected.exit(),
            Call::Terminate => expected.terminate(),
            Call::Reset => expected.reset(),
            Call::Get { kind, references, arrays } => {
                let (wanted, bits) = expected.get(*kind, references, *arrays);
                let ((status, name), got) = perform::get(version, it, *kind, references, *arrays);
                if status == OK {
                    assert_eq!(got, bits, "{name} of {references:?}");
                }
                return (status, wanted, name);
            }
            Call::Set { kind, references, values, arrays } => expected.set(*kind, references, values, *arrays),
            Call::Step { at, h, null, .. } => {
                let t = expected.point(*at, *h);
                expected.step(t, *h, version == 3 && *null < 4)
            }
            Call::Save(slot) => expected.call(SAVE, |_| {
                let known = matches!(slot, Slot::Own(_));
                if known { Ok(OK) } else { Err(()) }
            }),
            Call::Restore(slot) => {
                let known = self.saved(*slot).cloned();
                expected.call(ANY, |it| {
                    it.now = known.ok_or(())?;
                    Ok(OK)
                })
            }
            Call::Free(slot) => expected.call(ANY, |_| {
                let known = matches!(slot, Slot::Own(_) | Slot::Null);
                if known { Ok(OK) } else { Err(()) }
            }),
            Call::Size { slot, null } => {
                let known = self.saved(*slot).is_some() && !null;
                expected.call(ANY, |_| if known { Ok(OK) } else { Err(()) })
            }
            Call::Serialize { slot, room, null, .. } => {
                let known = self.saved(*slot).is_some() && !null && *room == 0;
                expected.call(ANY, |_| if known { Ok(OK) } else { Err(()) })
            }
            Call::Deserialize { blob, damage, slot } => {
                let (bytes, snapshot) = &self.blobs[*blob];
                let whole = matches!(damage, Damage::None) && !bytes.is_empty();
                let fits = whole && snapshot.is_storable() && !matches!(slot, Slot::Null);
                expected.call(ANY, |_| if fits { Ok(OK) } else { Err(()) })
            }
            Call::Status { function, kind, null } => expected.status(*function, *kind, *null),
            Call::Unsupported(_) => expected.call([&[], &[]], |_| unreachable!()),
            Call::Onward | Call::New { .. } => unreachable!("resolved before"),
        };
        let who = usize::from(self.fmus[1].it == it);
        let now = self.references[who].now.clone();
        let (status, name) = self.attempt(call, version, it);
        // The importer's present states.
        match (call, status) {
            (Call::Save(Slot::Own(i)), OK) => self.slots[*i].1 = Some(now),
            (Call::Free(Slot::Own(i)), OK) => self.slots[*i].1 = None,
            _ => {}
        }
        (status, wanted, name)
    }

    fn saved(&self, slot: Slot) -> Option<&Snapshot> {
        if let Slot::Own(i) = slot { self.slots[i].1.as_ref() } else { None }
    }

    fn handle(&self, slot: Slot) -> FmuState {
        match slot {
            Slot::Own(i) => self.slots[i].0,
            Slot::Freed(age) => self.freed.iter().nth_back(age).copied().unwrap_or(without_provenance_mut(1)),
            Slot::Garbage(number) => without_provenance_mut(number),
            Slot::Null => null_mut(),
        }
    }

    /// Only the call; slots and blobs follow.
    fn attempt(&mut self, call: &Call, version: u8, it: InstancePointer) -> Done {
        match call {
            Call::Logging { on, categories } => perform::logging(version, it, *on, categories),
            Call::SetUp(start, stop) if version == 2 => perform::set_up(it, *start, *stop),
            Call::SetUp(start, stop) | Call::Enter(start, stop) => perform::enter(version, it, *start, *stop),
            Call::Exit => perform::exit(version, it),
            Call::Terminate => perform::terminate(version, it),
            Call::Reset => perform::reset(version, it),
            Call::Get { kind, references, arrays } => perform::get(version, it, *kind, references, *arrays).0,
            Call::Set { kind, references, values, arrays } => {
                perform::set(version, it, *kind, references, values, *arrays)
            }
            Call::Step { at, h, free, null } => {
                let who = usize::from(self.fmus[1].it == it);
                perform::step(version, it, (self.references[who].point(*at, *h), *h), *free, *null)
            }
            Call::Save(slot) => {
                let before = self.handle(*slot);
                let mut state = before;
                let done =
                    perform::save(version, it, if matches!(slot, Slot::Null) { null_mut() } else { &raw mut state });
                match slot {
                    Slot::Own(i) if done.0 == OK => {
                        assert!(
                            !state.is_null() && (before.is_null() || state == before),
                            "a new state for an old one"
                        );
                        self.slots[*i].0 = state;
                    }
                    _ => assert_eq!(state, before),
                }
                done
            }
            Call::Restore(slot) => perform::restore(version, it, self.handle(*slot)),
            Call::Free(slot) => {
                let before = self.handle(*slot);
                let mut state = before;
                let done = perform::free_state(
                    version,
                    it,
                    if matches!(slot, Slot::Null) { null_mut() } else { &raw mut state },
                );
                match slot {
                    Slot::Own(i) if done.0 == OK => {
                        assert!(state.is_null());
                        self.slots[*i].0 = state;
                        if !before.is_null() {
                            self.freed.push(before);
                        }
                    }
                    _ => assert_eq!(state, before),
                }
                done
            }
            Call::Size { slot, null } => {
                let mut size = 0;
                let done =
                    perform::size(version, it, self.handle(*slot), if *null { null_mut() } else { &raw mut size });
                assert_eq!(size, if done.0 == OK { self.size } else { 0 });
                done
            }
            Call::Serialize { slot, blob, room, null } => {
                let n = self.size.saturating_add_signed((*room).into());
                let mut bytes = vec![0xa5; n];
                let place = if *null { null_mut() } else { bytes.as_mut_ptr() };
                let done = perform::serialize(version, it, self.handle(*slot), place, n);
                if done.0 == OK {
                    let snapshot = self.saved(*slot).expect("a state").clone();
                    self.blobs[*blob] = (bytes, snapshot);
                } else {
                    assert!(bytes.iter().all(|&b| b == 0xa5), "bytes were written");
                }
                done
            }
            Call::Deserialize { blob, damage, slot } => self.deserialize(version, it, *blob, *damage, *slot),
            Call::Status { function, kind, null } if version == 2 => perform::status(it, *function, *kind, *null),
            Call::Status { kind, .. } => perform::unsupported(version, it, kind.unsigned_abs() as usize),
            Call::Unsupported(number) => perform::unsupported(version, it, *number),
            Call::Onward | Call::New { .. } => unreachable!("resolved before"),
        }
    }

    fn deserialize(&mut self, version: u8, it: InstancePointer, blob: usize, damage: Damage, slot: Slot) -> Done {
        let (bytes, snapshot) = &self.blobs[blob];
        let mut bytes = bytes.clone();
        let n = bytes.len();
        match damage {
            Damage::Flip(at) if n > 0 => bytes[at / 8 % n] ^= 1 << (at % 8),
            Damage::Cut(to) if n > 0 => bytes.truncate(to % n),
            _ => {}
        }
        let before = self.handle(slot);
        let mut state = before;
        let (from, n) = if matches!(damage, Damage::Null) { (null(), n) } else { (bytes.as_ptr(), bytes.len()) };
        let place = if matches!(slot, Slot::Null) { null_mut() } else { &raw mut state };
        let done = perform::deserialize(version, it, from, n, place);
        if done.0 == OK {
            assert!(!state.is_null() && state != before, "always a new state");
            if let Slot::Own(i) = slot {
                self.slots[i] = (state, Some(snapshot.clone()));
                self.lost.push(before);
            } else {
                self.lost.push(state);
            }
        } else {
            assert_eq!(state, before);
        }
        done
    }

    fn check_messages(&self, who: usize, status: c_int, name: &str, heard: [bool; 5], event: bool, nobody: bool) {
        let messages: Vec<Message> = self.fmus[who].journal.0.borrow_mut().drain(..).collect();
        let expected = match status {
            _ if !has_logger(self.fmus[who].version) => 0,
            ERROR => usize::from(!nobody) + usize::from(self.references[who].warns),
            DISCARD => usize::from(heard[2]),
            _ => usize::from(heard[0] && event) + usize::from(self.references[who].warns),
        };
        assert_eq!(messages.len(), expected, "{name}: {messages:?}");
        for message in messages {
            let warning = message.status == 1 && self.references[who].warns && message.text.starts_with("probe: at ");
            assert!(message.status == status || warning, "{message:?}");
            assert!(status == OK || warning || message.text.starts_with(&format!("{name}: ")), "{name}: {message:?}");
        }
    }

    /// The content of the instance as bytes, without changing it: its stored state, or after an error its values.
    fn fingerprint(&mut self, who: usize) -> Vec<u8> {
        let (version, it) = (self.fmus[who].version, self.fmus[who].it);
        let mut bytes = vec![0; self.size];
        if perform::save(version, it, &raw mut self.glass).0 == OK {
            let done = perform::serialize(version, it, self.glass, bytes.as_mut_ptr(), self.size);
            assert_eq!(done.0, OK);
        } else {
            assert_eq!(self.references[who].now.state, State::Error);
            bytes = self.values(who).iter().flat_map(|bits| bits.to_ne_bytes()).collect();
        }
        self.fmus[who].journal.0.borrow_mut().clear();
        bytes
    }

    /// Every value, through the getters.
    fn values(&self, who: usize) -> Vec<u64> {
        let (version, it) = (self.fmus[who].version, self.fmus[who].it);
        let get = |(kind, references)| {
            let ((status, name), bits) = perform::get(version, it, kind, references, Arrays::Good);
            assert_eq!(status, OK, "{name}: {:?}", self.fmus[who].journal.0.borrow());
            bits
        };
        lists(version).into_iter().flat_map(get).collect()
    }

    /// Compares every value and the state of the life cycle with the reference, without side effects.
    fn look(&mut self, who: usize, operation: &Operation) {
        let mut now = self.references[who].now.clone();
        let (version, it) = (self.fmus[who].version, self.fmus[who].it);
        let saved = perform::save(version, it, &raw mut self.glass).0;
        assert_eq!(saved == ERROR, now.state == State::Error, "after {operation:?}");
        if GET[usize::from(version - 2)].contains(&now.state) && !now.is_unlucky() {
            now.refresh().expect("no panic");
            let wanted: Vec<u64> = lists(version)
                .into_iter()
                .flat_map(|(kind, references)| references.iter().map(move |&r| (kind, r)))
                .flat_map(|(kind, r)| (r..).take(elements(version, r).unwrap_or(1)).map(move |r| (kind, r)))
                .map(|(kind, r)| now.value(version, kind, r).expect("a variable"))
                .collect();
            assert_eq!(self.values(who), wanted, "after {operation:?}");
        }
        if saved == OK {
            let restore = || assert_eq!(perform::restore(version, it, self.glass).0, OK);
            restore();
            assert_eq!(self.state(who), now.state, "after {operation:?}");
            restore();
        }
        self.fmus[who].journal.0.borrow_mut().clear();
    }

    /// The state of the life cycle, determined by the calls that it allows; changes it.
    fn state(&self, who: usize) -> State {
        let (fmu, version) = (&self.fmus[who], self.fmus[who].version);
        let restore = || assert_eq!(perform::restore(version, fmu.it, self.glass).0, OK);
        if fmu.set(&[U], &[1.0]) == ERROR {
            return State::Terminated;
        }
        if perform::terminate(version, fmu.it).0 == OK {
            return State::Step;
        }
        restore();
        if fmu.enter(0.0, None) == OK { State::Instantiated } else { State::Initialization }
    }
}

impl Drop for World {
    fn drop(&mut self) {
        let states = self.slots.iter().map(|(state, _)| *state).chain(self.lost.drain(..)).chain([self.glass]);
        for mut state in states {
            let (status, _) = perform::free_state(self.fmus[0].version, self.fmus[0].it, &raw mut state);
            assert!(status == OK || std::thread::panicking());
        }
    }
}

/// The variables by type in a standard: FMI 2.0 has no arrays.
fn lists(version: u8) -> [(Kind, &'static [u32]); 4] {
    let reals: &[u32] = if version == 2 {
        &[U, K, X, R, MAP, MAP + 1, MAP + 2, GAIN, DOUBLE_GAIN]
    } else {
        &[TIME, U, K, X, R, MAP, GAIN, DOUBLE_GAIN]
    };
    let (integers, enumerations): (&[u32], &[u32]) =
        if version == 2 { (&[COUNT, N, MODE], &[]) } else { (&[COUNT, N], &[MODE]) };
    [
        (Kind::Real, reals),
        (Kind::Integer, integers),
        (Kind::Enumeration, enumerations),
        (Kind::Boolean, &[ON, HIGH, FLAG]),
    ]
}
