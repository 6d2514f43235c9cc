//! Random calls of all interfaces, right and wrong, against a state machine written down once more by hand from
//! FMI 2.0.5, 3.2.3 and 4.2.4 and FMI 3.0.2, 2.3, 3.2 and 4.2, which runs the model natively.
//!
//! Two instances that share saved states; after every call its status and what it wrote, and now and then every value and
//! the state of the lifecycle. 1e5 calls; `FMU_CALLS=10000000 cargo test --release -p fmu-export --test sampled_sequences
//! --test continuous_sequences` for more, `FMU_SEED=n` for others.

use super::*;
use fmu_core::{Block, Capabilities, Elapsed, Model, Next, SampleGrid, Slot, Step, Variability};
use fmu_core::{Causality, Meta};
use std::collections::BTreeMap;
use std::fmt::Write;

/// What the driver must know of a model, besides its capabilities.
pub trait Twin: Model + PartialEq {
    const CAN: Capabilities<Self>;
    /// Interfaces that the FMU has.
    const KINDS: &'static [Kind];
    /// References of all reals in the table, of arrays the first.
    const REALS: &'static [u32];
    /// Variables that are set most.
    const SET: &'static [u32];
    /// Values that they are set to, besides wrong ones.
    const VALUES: &'static [f64];
    /// Whether the next call of the model can succeed: parameters fit together, inputs lead to no fault.
    fn is_healthy(&self) -> bool;
    /// The parameters fit together.
    fn fits(&self) -> bool;
}

struct Draw(u64);

impl Draw {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from(self.0 >> 32).unwrap()
    }

    fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.next()).unwrap() % n
    }

    fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }

    fn rarely(&mut self) -> bool {
        self.below(20) == 0
    }
}

#[derive(Clone)]
struct Snapshot<M: Twin> {
    kind: Kind,
    state: char,
    start: Option<f64>,
    elapsed: Elapsed,
    end: f64,
    settled: f64,
    pending: bool,
    fresh: bool,
    /// Initialization is over.
    running: bool,
    block: Block<M>,
}

impl<M: Twin> Snapshot<M> {
    fn new(kind: Kind) -> Self {
        let start = M::INFO.experiment.start;
        Self {
            kind,
            state: 'i',
            start: None,
            elapsed: Elapsed::ZERO,
            end: start,
            settled: start,
            pending: false,
            fresh: true,
            running: false,
            block: Block::default(),
        }
    }

    /// What a getter shows.
    fn show(&mut self) {
        if "in".contains(self.state) {
            if self.fresh {
                self.block.initialize();
                self.fresh = false;
            }
        } else if self.kind.exchanges() && self.running {
            match &M::CAN.continuous {
                Some(continuous) => (continuous.observe)(&self.block.model, self.elapsed, &mut self.block.out),
                None => self.block.model.output(self.elapsed, &mut self.block.out),
            }
        }
    }

    /// No variable is NaN.
    fn is_storable(&self) -> bool {
        let mut block = self.block.clone();
        let real = |i| !matches!(M::TABLE.entry(&mut block, i), Some((_, Slot::Real(x))) if x.is_nan());
        (0..M::TABLE.len()).all(real)
    }

    fn derivatives(&mut self) -> Result<Vec<f64>, c_int> {
        let mut dx = vec![0.0; M::CAN.states().len()];
        if let Some(continuous) = &M::CAN.continuous {
            (continuous.derivatives)(&self.block.model, self.elapsed, &mut dx).map_err(|_| DISCARD)?;
        }
        if dx.iter().all(|x| x.is_finite()) { Ok(dx) } else { Err(DISCARD) }
    }

    fn indicators(&self) -> Vec<f64> {
        let mut z = vec![0.0; M::CAN.indicators().len()];
        if let Some(events) = &M::CAN.events {
            (events.indicators)(&self.block.model, self.elapsed, &mut z);
        }
        z
    }

    fn states(&mut self) -> Vec<f64> {
        M::CAN.states().iter().map(|state| *(state.at)(&mut self.block.model)).collect()
    }

    /// The values of a real reference.
    fn reals(&mut self, reference: u32) -> Result<Vec<f64>, c_int> {
        let (table, states) = (M::TABLE.len(), M::CAN.states().len());
        let index = match reference.checked_sub(1) {
            None => return Ok(vec![self.end]),
            Some(index) => usize::try_from(index).unwrap(),
        };
        let (flat, element) = (self.kind.version() == 2, M::TABLE.element(index));
        if index < table {
            let n = M::TABLE.entry(&mut self.block, index).unwrap().0.dimension.filter(|_| !flat).unwrap_or(1);
            if !flat && element.is_some_and(|element| element > 0) {
                return Err(ERROR);
            }
            let one = |i| match M::TABLE.entry(&mut self.block, i) {
                Some((_, Slot::Real(x))) => Ok(*x),
                _ => Err(ERROR),
            };
            return (index..index + n).map(one).collect();
        }
        if index < table + states {
            return self.derivatives().map(|dx| vec![dx[index - table]]);
        }
        // Event indicators are variables in FMI 3.0 only.
        if flat {
            return Err(ERROR);
        }
        self.indicators().get(index - table - states).map(|z| vec![*z]).ok_or(ERROR)
    }

    fn due(&self, k: u64, at: Elapsed) -> bool {
        M::CAN.samples.as_ref().is_some_and(|s| SampleGrid { period: (s.period)(&self.block.model) }.reached(k, at))
    }

    fn tune(&mut self) -> Result<(), c_int> {
        if self.fresh {
            if !self.block.model.fits() {
                return Err(ERROR);
            }
            self.block.model.derive();
            self.fresh = false;
        }
        Ok(())
    }

    fn begin(&mut self) {
        self.settled = self.settled.max(self.end);
        self.pending = true;
        if let Some(events) = &M::CAN.events {
            (events.begin)(&mut self.block.model, self.elapsed);
        }
        self.output();
    }

    /// In Co-Simulation, outputs are those of the last step or event.
    fn output(&mut self) {
        self.block.model.output(self.elapsed, &mut self.block.out);
    }

    fn update(&mut self) -> Result<Update, c_int> {
        self.tune()?;
        let events = M::CAN.events.as_ref().unwrap();
        let outcome = (events.event)(&mut self.block.model, self.elapsed).map_err(|_| ERROR)?;
        let start = self.start.unwrap();
        let next = match (events.next)(&self.block.model, self.elapsed) {
            Next::Never => None,
            Next::Grid { k, period } => Some(f64::mul_add(f64::from(u32::try_from(k).unwrap()), period, start)),
            Next::At(time) => Some(start + time.seconds()),
        };
        self.pending = outcome.again;
        self.output();
        Ok(Update { again: outcome.again, terminate: outcome.terminate, states_changed: outcome.states_changed, next })
    }

    /// FMI 3.0.2, 4.2.1; the first instant that the step meets ends it, if it may.
    fn step(&mut self, t: f64, h: f64) -> Result<Stepped, c_int> {
        let rounding = 2.0 * f64::EPSILON * t.abs();
        let fits = h > 0.0 && h.is_finite() && t.is_finite() && t + h > t;
        if !fits || (t - self.end).abs() > h / 100.0 + rounding {
            return Err(ERROR);
        }
        self.tune()?;
        let (start, end, last) = (self.elapsed, self.elapsed.plus(h), self.end);
        let (event, early) = match self.kind {
            Kind::Cs3 { event, early } if M::CAN.event_mode() => (event, early),
            _ => (false, false),
        };
        let mut stepped = Stepped { end: t + h, ..Stepped::default() };
        self.end = t + h;
        let mut reached = end;
        if event || early {
            let samples = M::CAN.samples.as_ref().unwrap();
            let period = (samples.period)(&self.block.model);
            let before = |k: u64, model: &Self| model.due(k, end) && SampleGrid { period }.passed(k, end);
            loop {
                let k = (samples.samples)(&self.block.model);
                let at_start = self.due(k, start);
                if before(k, self) && (at_start || !early) {
                    (samples.show)(&mut self.block.model);
                    if (samples.sample)(&mut self.block.model).is_err() {
                        // Time has not passed.
                        self.end = last;
                        return Err(ERROR);
                    }
                } else if self.due(k, end) {
                    stepped.event = event;
                    if before(k, self) {
                        stepped.early = true;
                        reached = Elapsed::periods(k, period);
                        stepped.end = f64::mul_add(f64::from(u32::try_from(k).unwrap()), period, self.start.unwrap());
                        self.end = stepped.end;
                    }
                    if !event {
                        (samples.show)(&mut self.block.model);
                    }
                    break;
                } else {
                    break;
                }
            }
        } else if self.block.model.advance(&Step { start, h }).is_err() {
            self.end = last;
            return Err(ERROR);
        }
        self.elapsed = reached;
        self.output();
        Ok(stepped)
    }

    /// The status of setting one value, without setting it.
    fn judge(&mut self, index: usize, value: f64) -> c_int {
        let (state, exchanges) = (self.state, self.kind.exchanges());
        let row = M::CAN.rows().unwrap().contains(&index);
        let Some((meta, Slot::Real(x))) = M::TABLE.entry(&mut self.block, index) else { return ERROR };
        let Meta { causality, variability, range, .. } = *meta;
        let may = match (causality, variability) {
            (Causality::Input, Variability::Continuous) => "invcs".contains(state),
            (Causality::Input, _) => "invs".contains(state) || (exchanges && state == 'c' && *x == value),
            (Causality::Parameter, Variability::Tunable) => "invs".contains(state),
            (Causality::Parameter, _) => "in".contains(state),
            _ => exchanges && row && "vc".contains(state),
        };
        match (may, range.contains(value)) {
            (true, true) => OK,
            (true, false) if state == 'c' => DISCARD,
            _ if exchanges && state == 'c' && causality == Causality::Input => DISCARD,
            _ => ERROR,
        }
    }

    fn set(&mut self, references: &[u32], values: &[f64]) -> c_int {
        let mut places = Vec::new();
        let mut next = values.iter();
        for &reference in references {
            let index = usize::try_from(reference).unwrap().wrapping_sub(1);
            let of = M::TABLE.entry(&mut self.block, index).and_then(|(meta, _)| meta.dimension);
            let n = of.filter(|_| self.kind.version() == 3).unwrap_or(1);
            places.extend((0..n).zip(next.by_ref()).map(|(i, value)| (index.wrapping_add(i), *value)));
        }
        for &(index, value) in &places {
            match self.judge(index, value) {
                OK => {}
                status => return status,
            }
        }
        let rows = M::CAN.rows().unwrap();
        for (index, value) in places {
            self.fresh |= "in".contains(self.state);
            if let Some(i) = rows.iter().position(|row| *row == index) {
                *(M::CAN.states()[i].at)(&mut self.block.model) = value;
            } else if let Some((meta, Slot::Real(x))) = M::TABLE.entry(&mut self.block, index) {
                *x = value;
                self.fresh |= meta.causality == Causality::Parameter;
            }
        }
        OK
    }
}

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

    /// What a plain simulation would do next, or anything.
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

    #[expect(clippy::too_many_lines, reason = "one arm for each call")]
    fn call(&mut self, draw: &mut Draw) {
        let who = draw.below(2);
        let name = self.choose(who, draw);
        let (fmu, now) = (&self.fmus[who], &mut self.now[who]);
        let (kind, state, version) = (now.kind, now.state, now.kind.version());
        let is = |states: &str| states.contains(state);
        let (nx, nz) = (M::CAN.states().len(), M::CAN.indicators().len());
        let exchanges = kind.exchanges();
        let in_exchange = |two: &str, three: &str| exchanges && is(if version == 2 { two } else { three });
        let n = |right: usize, draw: &mut Draw| if draw.rarely() { right + 1 } else { right };
        let _ = write!(self.trace, "\n{who} {kind:?} {state} {name}");
        let mut before = now.clone();
        let wanted: c_int;
        let status = match name {
            "enter" => {
                let start = if draw.rarely() { f64::NAN } else { draw.of(&[0.0, 1e4]) };
                let fits = is("i") && start.is_finite();
                wanted = if fits { OK } else { ERROR };
                if fits {
                    (now.start, now.end, now.settled, now.state) = (Some(start), start, start, 'n');
                }
                fmu.enter(start, None)
            }
            "exit" => {
                wanted = if is("n") && now.block.model.fits() && now.is_storable() { OK } else { ERROR };
                if wanted == OK {
                    now.block.initialize();
                    (now.fresh, now.running) = (false, true);
                    now.state = if kind.handles_events() { 'v' } else { 's' };
                    if kind.handles_events() {
                        now.begin();
                    }
                }
                fmu.exit()
            }
            "terminate" => {
                wanted = if is("vcs") { OK } else { ERROR };
                now.state = 't';
                fmu.terminate()
            }
            "reset" => {
                wanted = OK;
                *now = Snapshot::new(kind);
                fmu.reset()
            }
            "event" => {
                let may = if exchanges {
                    is(if version == 2 { "vc" } else { "c" })
                } else {
                    kind.handles_events() && is("s")
                };
                wanted = if may { OK } else { ERROR };
                if may {
                    now.begin();
                    now.state = 'v';
                }
                fmu.event()
            }
            "update" => {
                let expected = if is("v") { now.update() } else { Err(ERROR) };
                let (status, update) = fmu.try_update();
                wanted = expected.map_or_else(|status| status, |_| OK);
                if let Ok(expected) = expected {
                    assert_eq!(update, expected, "{}", self.trace);
                }
                status
            }
            "leave" => {
                let mut done = if is("v") { Ok(()) } else { Err(ERROR) };
                if done.is_ok() && exchanges {
                    while done.is_ok() && (now.pending || now.fresh) {
                        done = now.update().map(|_| ());
                    }
                }
                wanted = done.map_or_else(|status| status, |()| OK);
                (now.state, now.pending) = (if exchanges { 'c' } else { 's' }, false);
                fmu.leave()
            }
            "set_time" => {
                let wrong = draw.rarely();
                let t = now.end
                    + draw.of(if wrong { &[-1.0, f64::NAN, f64::INFINITY] } else { &[0.0, 0.005, 0.01, 0.02, 0.003] });
                let fits = t.is_finite() && t >= now.settled - 4.0 * f64::EPSILON * now.settled.abs();
                wanted = if in_exchange("vc", "c") && fits { OK } else { ERROR };
                if wanted == OK {
                    let start = now.start.unwrap();
                    now.end = t.max(start);
                    now.elapsed = Elapsed::between(start, now.end);
                }
                fmu.set_time(t)
            }
            "set_states" => {
                let x: Vec<f64> = (0..n(nx, draw))
                    .map(|_| {
                        if draw.rarely() {
                            draw.of(&[2e6, 1e5, 2e9, f64::NAN])
                        } else {
                            draw.of(&[0.0, 0.5, -1.0, 1.0, 3.0, -1e-3])
                        }
                    })
                    .collect();
                let rows = M::CAN.rows().unwrap();
                let ranges = rows.iter().map(|&row| M::TABLE.locate(row).unwrap().1.range);
                wanted = match () {
                    () if !in_exchange("c", "c") || x.len() != nx => ERROR,
                    () if ranges.zip(&x).any(|(range, x)| !range.contains(*x)) => DISCARD,
                    () => OK,
                };
                if wanted == OK {
                    for (state, x) in M::CAN.states().iter().zip(&x) {
                        *(state.at)(&mut now.block.model) = *x;
                    }
                }
                fmu.set_states(&x)
            }
            "completed" => {
                wanted = if in_exchange("c", "c") { OK } else { ERROR };
                now.settled = now.settled.max(now.end);
                fmu.completed()
            }
            "step" => {
                let wrong = draw.rarely();
                let h = draw.of(if wrong { &[0.0, -0.01, f64::NAN] } else { &[0.01, 0.003, 0.007, 0.025, 0.073] });
                let t = now.end + if draw.rarely() { draw.of(&[h, 0.005 * h, -h, f64::NAN]) } else { 0.0 };
                let expected = if is("s") { now.step(t, h) } else { Err(ERROR) };
                let (status, stepped) = fmu.step(t, h);
                wanted = expected.map_or_else(|status| status, |_| OK);
                if let Ok(expected) = expected {
                    assert_eq!(stepped, expected, "{}", self.trace);
                }
                status
            }
            "set" => {
                let references: Vec<u32> = (0..draw.below(4))
                    .map(|_| if draw.rarely() { draw.next() % 30 } else { draw.of(M::SET) })
                    .filter(|&r| {
                        // Elements of arrays have no reference of their own in FMI 3.0.
                        version == 2
                            || usize::try_from(r)
                                .unwrap()
                                .checked_sub(1)
                                .and_then(|i| M::TABLE.element(i))
                                .is_none_or(|e| e == 0)
                    })
                    .collect();
                let sizes = references.iter().map(|&r| {
                    let index = usize::try_from(r).unwrap().wrapping_sub(1);
                    let of = M::TABLE.locate(index).and_then(|(_, meta, _)| meta.dimension);
                    of.filter(|_| version == 3).unwrap_or(1)
                });
                let values: Vec<f64> = (0..sizes.sum())
                    .map(|_| {
                        if draw.rarely() { draw.of(&[-1.0, f64::NAN, 1e12, f64::INFINITY]) } else { draw.of(M::VALUES) }
                    })
                    .collect();
                let _ = write!(self.trace, " {references:?} {values:?}");
                wanted = match () {
                    () if !(is("invs") || exchanges && is("c")) => ERROR,
                    () if references.is_empty() => OK,
                    () => now.set(&references, &values),
                };
                fmu.set(&references, &values)
            }
            "get" => {
                let references: Vec<u32> = (0..draw.below(4))
                    .map(|_| if draw.rarely() { draw.next() % 30 } else { draw.of(M::REALS) })
                    .collect();
                let _ = write!(self.trace, " {references:?}");
                let may = if version == 2 { is("nvcste") } else { true };
                let mut expected = Vec::new();
                let mut verdict = if may { OK } else { ERROR };
                if may {
                    // The number of values is judged first, then the values are looked at.
                    let element = |r: u32| {
                        version == 3
                            && usize::try_from(r)
                                .unwrap()
                                .checked_sub(1)
                                .and_then(|i| M::TABLE.element(i))
                                .is_some_and(|e| e > 0)
                    };
                    if references.iter().any(|&r| element(r)) {
                        verdict = ERROR;
                    } else {
                        now.show();
                    }
                }
                for &reference in &references {
                    match if verdict == OK { now.reals(reference) } else { break } {
                        Ok(values) => expected.extend(values),
                        Err(status) => verdict = status,
                    }
                }
                let size = |&r: &u32| {
                    let of = usize::try_from(r)
                        .unwrap()
                        .checked_sub(1)
                        .and_then(|i| M::TABLE.locate(i))
                        .and_then(|(_, meta, _)| meta.dimension);
                    of.filter(|_| version == 3).unwrap_or(1)
                };
                let mut values = vec![f64::NAN; references.iter().map(size).sum()];
                let status = fmu.try_get(&references, &mut values);
                wanted = verdict;
                if wanted == OK && status == OK {
                    assert_eq!(bits(&values), bits(&expected), "{}", self.trace);
                }
                before = now.clone();
                status
            }
            "states" | "derivatives" | "indicators" | "nominals" => {
                let n = n(if name == "indicators" { nz } else { nx }, draw);
                let mut values = vec![f64::NAN; n];
                let may = if name == "nominals" { in_exchange("invcte", "nvct") } else { in_exchange("nvcte", "nvct") };
                let right = n == if name == "indicators" { nz } else { nx };
                let mut expected = Err(ERROR);
                if may && right {
                    if state == 'n' && name != "nominals" {
                        now.show();
                    }
                    expected = match name {
                        "states" => Ok(now.states()),
                        "derivatives" => now.derivatives(),
                        "indicators" => Ok(now.indicators()),
                        _ => Ok(M::CAN
                            .rows()
                            .unwrap()
                            .iter()
                            .map(|&r| M::TABLE.locate(r).unwrap().1.nominal.unwrap_or(1.0))
                            .collect()),
                    };
                }
                let status = match name {
                    "states" => fmu.try_states(&mut values),
                    "derivatives" => fmu.try_derivatives(&mut values),
                    "indicators" => fmu.try_indicators(&mut values),
                    _ => fmu.try_nominals(&mut values),
                };
                wanted = match &expected {
                    Ok(_) => OK,
                    Err(status) => *status,
                };
                if let Ok(expected) = expected {
                    assert_eq!(bits(&values), bits(&expected), "{}", self.trace);
                }
                before = now.clone();
                status
            }
            "directional" => {
                let last = u32::try_from(M::TABLE.len() + nx).unwrap();
                let (unknown, known) = (if nx > 0 { last } else { 1 }, M::SET[0]);
                let seed = [draw.of(&[1.0, -2.0, 0.0, f64::NAN])];
                let named = draw.of(&[1, 1, 2]);
                let (unknowns, knowns) = ([unknown; 1], [known; 2]);
                let may =
                    is(if version == 2 { "nvcste" } else { "nvcst" }) && nx > 0 && named == 1 && seed[0].is_finite();
                let mut out = [f64::NAN];
                if may {
                    now.show();
                }
                let full = [seed[0]; 2];
                let status = fmu.directional(&unknowns, &knowns[..named], &full[..named], &mut out);
                // Derivatives that do not exist here are discarded; those near the edge may be either.
                let exist = may && now.derivatives().is_ok();
                wanted = match () {
                    () if !may => ERROR,
                    () if exist && seed[0] != 0.0 => OK,
                    () => status,
                };
                assert!(status != ERROR || !may, "{}", self.trace);
                before = now.clone();
                status
            }
            "save" => {
                let slot = draw.below(self.slots.len());
                wanted = if is("invcst") { OK } else { ERROR };
                let status = fmu.save(&mut self.slots[slot].0);
                if status == OK {
                    if !"in".contains(state) {
                        now.show();
                    }
                    self.slots[slot].1 = Some(now.clone());
                }
                before = now.clone();
                status
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
                    // Through bytes; a variable that is no number is refused.
                    let bytes = fmu.serialized(handle);
                    let fits = saved.is_storable();
                    assert_eq!(fmu.deserialize(&bytes, &mut stored), if fits { OK } else { ERROR }, "{}", self.trace);
                    fmu.messages();
                    handle = stored;
                }
                let same = saved.as_ref().is_some_and(|saved| interface(saved.kind) == interface(kind));
                wanted = if same && !handle.is_null() { OK } else { ERROR };
                if let (OK, Some(saved)) = (wanted, saved) {
                    *now = Snapshot { kind, ..saved.clone() };
                }
                let status = fmu.restore(handle);
                assert_eq!(fmu.free_state(&mut stored), OK);
                status
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
            let references: Vec<u32> =
                M::REALS.iter().copied().filter(|&r| usize::try_from(r).unwrap() <= M::TABLE.len()).collect();
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
