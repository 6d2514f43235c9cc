//! Random calls of all interfaces, right and wrong, against a state machine written down once more by hand from
//! FMI 2.0.5, 3.2.3 and 4.2.4 and FMI 3.0.2, 2.3, 3.2 and 4.2, which runs the model natively.
//!
//! Two instances that share saved states; after every call its status and its results, and from time to time every value and
//! the state of the lifecycle. 1e5 calls; `FMU_CALLS=10000000 cargo test --release -p fmu-export --test sampled_sequences
//! --test continuous_sequences` for more, `FMU_SEED=n` for others.

mod reads;
mod turn;
mod twin;

use super::draw::{Choices as _, Draw};
use super::*;
use std::collections::BTreeMap;
use std::fmt::Write;
use turn::Turn;
use twin::Snapshot;
pub use twin::Twin;

/// The calls, each with its number in the tally.
const CALLS: [&str; 22] = [
    "enter",
    "exit",
    "terminate",
    "reset",
    "event",
    "update",
    "leave",
    "set_time",
    "set_states",
    "completed",
    "step",
    "set",
    "get",
    "states",
    "derivatives",
    "indicators",
    "nominals",
    "directional",
    "save",
    "restore",
    "store",
    "new",
];

struct World<M: Twin> {
    fmus: [Fmu; 2],
    now: [Snapshot<M>; 2],
    slots: [(FmuState, Option<Snapshot<M>>); 3],
    trace: String,
    tally: BTreeMap<&'static str, [u64; 3]>,
}

impl<M: Twin> World<M> {
    fn new(draw: &mut Draw) -> Self {
        let kinds = [draw.of(M::KINDS), draw.of(M::KINDS)];
        Self {
            fmus: kinds.map(Fmu::new),
            now: kinds.map(Snapshot::new),
            slots: std::array::from_fn(|_| (null_mut(), None)),
            trace: String::new(),
            tally: BTreeMap::new(),
        }
    }

    /// A plausible next call of a plain simulation, or a random one.
    fn choose(&self, who: usize, draw: &mut Draw) -> &'static str {
        let now = &self.now[who];
        if draw.below(12) == 0 {
            return draw.of(&CALLS);
        }
        if draw.below(12) == 0 {
            return draw.of(&["save", "restore", "store", "directional", "states", "indicators", "nominals"]);
        }
        match now.state {
            'i' => draw.of(&["enter", "set", "enter"]),
            'n' => draw.of(&["exit", "set", "get", "exit"]),
            'v' if now.pending => draw.of(&["set", "update", "update", "get"]),
            'v' => draw.of(&["leave", "leave", "update", "set"]),
            'c' => draw.of(&["set_time", "set_states", "set", "derivatives", "completed", "event", "get"]),
            's' if now.kind.handles_events() => draw.of(&["step", "event", "step", "set", "get"]),
            's' => draw.of(&["step", "set", "step", "get"]),
            _ => draw.of(&["reset", "restore", "reset"]),
        }
    }

    fn call(&mut self, draw: &mut Draw) {
        let who = draw.below(2);
        let name = self.choose(who, draw);
        let (fmu, now) = (&self.fmus[who], &mut self.now[who]);
        let (kind, state) = (now.kind, now.state);
        let _ = write!(self.trace, "\n{who} {kind:?} {state} {name}");
        let mut before = now.clone();
        let mut turn = Turn { fmu, now, draw, trace: &mut self.trace };
        let (status, wanted) = match name {
            "enter" => turn.enter(),
            "exit" => turn.exit(),
            "terminate" => turn.terminate(),
            "reset" => turn.reset(),
            "event" => turn.event(),
            "update" => turn.update(),
            "leave" => turn.leave(),
            "set_time" => turn.set_time(),
            "set_states" => turn.set_states(),
            "completed" => turn.completed(),
            "step" => turn.step(),
            "set" => turn.set(),
            "get" | "states" | "derivatives" | "indicators" | "nominals" | "directional" => {
                let judged = match name {
                    "get" => turn.get(),
                    "directional" => turn.directional(),
                    _ => turn.values(name),
                };
                before = now.clone();
                judged
            }
            "save" => {
                let slot = draw.below(self.slots.len());
                let wanted = if "invcst".contains(state) { OK } else { ERROR };
                let status = fmu.save(&mut self.slots[slot].0);
                if status == OK {
                    if !"in".contains(state) {
                        now.show();
                    } else if std::mem::take(&mut now.old) {
                        now.observe();
                    }
                    self.slots[slot].1 = Some(now.clone());
                }
                before = now.clone();
                (status, wanted)
            }
            "restore" | "store" => {
                let slots = 0..self.slots.len();
                let fits =
                    |&i: &usize| self.slots[i].1.as_ref().is_some_and(|saved| interface(saved.kind) == interface(kind));
                let good = slots.clone().find(fits).filter(|_| !draw.rarely());
                let slot = good.unwrap_or_else(|| draw.below(slots.len()));
                let (handle, saved) = &self.slots[slot];
                let mut handle = *handle;
                let mut stored = null_mut();
                if name == "store"
                    && let Some(saved) = saved
                {
                    // Through bytes; a NaN is refused.
                    let bytes = fmu.serialized(handle);
                    let fits = saved.is_storable();
                    assert_eq!(fmu.deserialize(&bytes, &mut stored), if fits { OK } else { ERROR }, "{}", self.trace);
                    fmu.messages();
                    handle = stored;
                }
                let same = saved.as_ref().is_some_and(|saved| interface(saved.kind) == interface(kind));
                let wanted = if same && !handle.is_null() { OK } else { ERROR };
                if let (OK, Some(saved)) = (wanted, saved) {
                    *now = Snapshot { kind, ..saved.clone() };
                }
                let status = fmu.restore(handle);
                assert_eq!(fmu.free_state(&mut stored), OK);
                (status, wanted)
            }
            _ => {
                if draw.below(4) == 0 {
                    let kind = draw.of(M::KINDS);
                    self.fmus[who] = Fmu::new(kind);
                    self.now[who] = Snapshot::new(kind);
                    self.trace.push_str(" !");
                }
                return;
            }
        };
        let column = [OK, DISCARD, ERROR].iter().position(|&s| s == status).expect("a status");
        self.tally.entry(name).or_default()[column] += 1;
        assert_eq!(status, wanted, "{}\n{:?}", self.trace, fmu.messages());
        let messages = fmu.messages();
        assert_eq!(messages.len(), usize::from(status == ERROR), "{}\n{messages:?}", self.trace);
        match status {
            ERROR => {
                // The model may have done half of its work, and nothing else changes.
                if !matches!(name, "update" | "leave" | "step") {
                    *now = before;
                }
                now.state = 'e';
            }
            DISCARD => *now = before,
            _ => {}
        }
        if draw.below(5) == 0 || status == ERROR {
            self.look(who);
        }
    }

    /// Every value and the state of the lifecycle.
    fn look(&mut self, who: usize) {
        let (fmu, now) = (&self.fmus[who], &mut self.now[who]);
        if now.kind.version() == 3 || "nvcste".contains(now.state) {
            now.show();
            // Time is a variable only in FMI 3.0.
            let here = |r| usize::try_from(r).unwrap() <= M::TABLE.len() && (r > 0 || now.kind.version() == 3);
            let references: Vec<u32> = M::REALS.iter().copied().filter(|&r| here(r)).collect();
            let expected: Vec<f64> = references.iter().flat_map(|&r| now.reals(r).unwrap()).collect();
            let mut values = vec![f64::NAN; expected.len()];
            assert_eq!(fmu.try_get(&references, &mut values), OK, "{}", self.trace);
            assert_eq!(bits(&values), bits(&expected), "{references:?} {}", self.trace);
        }
        if now.block.model.is_healthy() {
            let state = fmu.state();
            assert_eq!(state, now.state, "{} {:?}", self.trace, (now.end, serde_json::to_string(&now.block)));
            fmu.messages();
        }
    }
}

fn interface(kind: Kind) -> u8 {
    match kind {
        Kind::Me2 | Kind::Me3 => 0,
        Kind::Cs3 { event: true, .. } => 1,
        _ => 2,
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

impl<M: Twin> Drop for World<M> {
    fn drop(&mut self) {
        for (state, _) in &mut self.slots {
            let _ = self.fmus[0].free_state(state);
        }
    }
}

fn asked(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |text| text.parse().expect("a whole number"))
}

pub fn random_calls<M: Twin>() {
    let (calls, seed) = (asked("FMU_CALLS", 100_000), asked("FMU_SEED", 1));
    let mut draw = Draw(seed);
    let mut tally = BTreeMap::<&str, [u64; 3]>::new();
    let mut done = 0;
    while done < calls {
        let mut world = World::<M>::new(&mut draw);
        for _ in 0..250 {
            world.call(&mut draw);
        }
        for (name, counts) in &world.tally {
            let all = tally.entry(name).or_default();
            for (all, count) in all.iter_mut().zip(counts) {
                *all += count;
                done += count;
            }
        }
    }
    for (name, [ok, discard, error]) in &tally {
        println!("{name:12} OK {ok:8}  Discard {discard:6}  Error {error:8}");
    }
    let [ok, other] = tally.values().fold([0, 0], |[a, b], [ok, discard, error]| [a + ok, b + discard + error]);
    assert!(ok > other, "most calls fail: {ok} {other}");
    assert!(tally.len() == CALLS.len() - 1 && tally.values().all(|[ok, ..]| *ok > 0 || M::CAN.states().is_empty()));
}
