//! Finds dependencies by running the model itself: each known is varied individually at several operating points; every unknown
//! that changes by more than rounding depends on it (`ModelStructure` of FMI 2.0.5, 2.2.8 and FMI 3.0.2, 2.4.8).
//!
//! A missing dependency misleads an importer; one too many costs it little. So parameters are varied together: an unknown that
//! depends on one of them depends on all. Inputs, states and time are varied one by one. Every second operating point varies an
//! earlier one that showed something new, as a fuzzer does: what acts only behind several options is reached step by step.

use crate::capability::Capabilities;
use crate::kinds::Kinds;
use crate::model::{Block, Model};
use crate::row::Slot;
use crate::saved::Saving;
use crate::variable::{Causality, Kind, Meta, Variability};
use crate::{Elapsed, Fault};

/// Minimum and maximum number of operating points, the start values included.
const POINTS: (usize, usize) = (192, 2000);

/// Runs of the model that the maximum number of points may take.
const RUNS: usize = 45_000;

/// The index used for `time`.
pub(crate) const NOW: usize = usize::MAX;

/// For each variable, the indices that it depends on; wide arrays, each as a whole under its first index, and then derivatives
/// follow the table. `None` for a variable that is not an unknown.
pub(crate) type Dependencies = Vec<Option<Vec<usize>>>;

/// The dependencies of initial values, and those between two events.
pub(crate) fn dependencies<M: Model>(can: &Capabilities<M>, fresh: &Block<M>, states: &[usize]) -> [Dependencies; 2] {
    match &can.saved {
        Some(saving) => {
            let mut fresh = saving.block(fresh);
            fresh.model.shorten();
            [at_the_start(can, saving, &fresh, states), between_events(can, saving, &fresh, states)]
        }
        None => all_dependencies(can, states),
    }
}

/// Empty counterpart of [`dependencies`]: no variable is an unknown.
pub(crate) fn no_dependencies<M: Model>(states: &[usize]) -> [Dependencies; 2] {
    [const { None }; 2].map(|none| vec![none; metas::<M>().len() + states.len()])
}

/// The dependencies of a model that cannot be copied, from its table: every unknown depends on every known.
fn all_dependencies<M: Model>(can: &Capabilities<M>, states: &[usize]) -> [Dependencies; 2] {
    let metas = metas::<M>();
    let found = |known: &dyn Fn(&Meta) -> bool| {
        let mut found = Found::new(metas.len() + states.len());
        (0..metas.len()).filter(|&i| known(metas[i])).for_each(|i| found.suspect(i));
        found
    };
    let mut between = found(&|meta| can.model_exchange() && acts_between_events(meta));
    if can.model_exchange() {
        states.iter().chain([&NOW]).for_each(|&known| between.suspect(known));
    }
    [found(&Meta::takes_start).initial::<M>(&metas, states), between.between::<M>(&metas)]
}

/// Checks that an exact variable keeps the start value set by the importer.
pub(crate) fn keeps_starts<M: Model>(can: &Capabilities<M>, fresh: &Block<M>, states: &[usize]) -> Result<(), Fault> {
    let Some(saving) = &can.saved else { return Ok(()) };
    let mut draw = Draw::new(3);
    for (index, meta) in metas::<M>().into_iter().enumerate().filter(|(_, meta)| meta.exact) {
        let index = wide::<M>().index(index);
        let mut block = saving.block(fresh);
        block.model.shorten();
        change(can, &mut block, states, index, &mut draw);
        let set = can.place(&mut block, states, index).map(|(_, slot)| slot.bits());
        block.initialize();
        let shown = M::TABLE.entry(&mut block, index).map(|(_, slot)| slot.bits());
        if set != shown {
            let name = M::TABLE.locate(index).map_or_else(|| meta.name.into(), |(name, ..)| name);
            return Err(Fault::new(format!(
                "{name} is exact, and does not keep the value that the importer sets: `initialize` overwrites it, or its row \
                 leads to an output instead of the model"
            )));
        }
    }
    Ok(())
}

/// Dependencies of initial values: outputs, calculated parameters, states and derivatives on inputs and parameters.
fn at_the_start<M: Model>(
    can: &Capabilities<M>,
    saving: &Saving<M>,
    fresh: &Block<M>,
    states: &[usize],
) -> Dependencies {
    let metas = metas::<M>();
    let knowns: Vec<usize> = (0..metas.len()).filter(|&i| metas[i].takes_start()).collect();
    let mut found = Found::new(metas.len() + states.len());
    let varied = varied(&metas, &knowns);
    let mut points = Points::new(saving, fresh, &knowns, varied.len(), 1);
    while let Some(base) = points.next(can, states, &found) {
        let start = |mut block: Block<M>| {
            block.initialize();
            values(can, block, Elapsed::ZERO)
        };
        let before = start(saving.block(&base));
        for known in &varied {
            let mut changed = saving.block(&base);
            vary(can, &mut changed, states, known, &mut points.draw);
            found.compare(known, &before, &start(changed));
        }
    }
    for known in knowns.into_iter().filter(is_opaque::<M>) {
        found.suspect(known);
    }
    found.initial::<M>(&metas, states)
}

/// Whether a variable may change other variables between two events.
fn acts_between_events(meta: &Meta) -> bool {
    meta.causality == Causality::Input || meta.variability == Variability::Tunable
}

/// Dependencies between two events: outputs and derivatives on states, inputs, tunable parameters and time, for any values of
/// the parameters.
fn between_events<M: Model>(
    can: &Capabilities<M>,
    saving: &Saving<M>,
    fresh: &Block<M>,
    states: &[usize],
) -> Dependencies {
    let metas = metas::<M>();
    let mut found = Found::new(metas.len() + states.len());
    let settable: Vec<usize> = (0..metas.len()).filter(|&i| metas[i].takes_start()).collect();
    let knowns: Vec<usize> = (0..metas.len()).filter(|&i| acts_between_events(metas[i])).collect();
    let varied = varied(&metas, &knowns);
    let mut points = Points::new(saving, fresh, &settable, varied.len() + states.len() + 1, 2);
    while can.model_exchange()
        && let Some(mut base) = points.next(can, states, &found)
    {
        let draw = &mut points.draw;
        base.initialize();
        // At every second point, the states are moved before the event, so that the switches match them.
        let first = draw.below(2) == 0;
        let moved = |now: bool| (0..states.len()).filter(move |_| first == now);
        moved(true).for_each(|i| shift(can, &mut base, states, i, draw));
        let mut now = Elapsed::ZERO.plus(draw.between(0.0, 1.0));
        if let Some(events) = &can.events {
            (events.begin)(&mut base.model, now);
            // A point that the model refuses is not an operating point.
            if (events.event)(&mut base.model, now).is_err() {
                continue;
            }
        }
        moved(false).for_each(|i| shift(can, &mut base, states, i, draw));
        let before = observed(can, saving.block(&base), now);
        for known in &varied {
            let mut changed = saving.block(&base);
            vary(can, &mut changed, states, known, draw);
            if metas[known[0]].causality == Causality::Parameter {
                changed.model.derive();
            }
            found.compare(known, &before, &observed(can, changed, now));
        }
        for (i, &known) in states.iter().enumerate() {
            let mut changed = saving.block(&base);
            shift(can, &mut changed, states, i, draw);
            found.compare(&[known], &before, &observed(can, changed, now));
        }
        now = now.plus(draw.between(0.1, 1.0));
        found.compare(&[NOW], &before, &observed(can, base, now));
    }
    if can.model_exchange() {
        for input in settable.into_iter().filter(|&i| metas[i].causality == Causality::Input).filter(is_opaque::<M>) {
            found.suspect(input);
        }
    }
    found.between::<M>(&metas)
}

/// Whether a variable is a text or bytes; these are not varied, because meaningful values are unknown.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "a filter")]
fn is_opaque<M: Model>(&known: &usize) -> bool {
    M::TABLE
        .locate(wide::<M>().index(known))
        .is_some_and(|(_, meta, _)| matches!(meta.kind, Kind::Text | Kind::Binary { .. }))
}

/// Sets of knowns varied together: each known alone, and all parameters at once.
fn varied(metas: &[&Meta], knowns: &[usize]) -> Vec<Vec<usize>> {
    let (parameters, others): (Vec<usize>, Vec<usize>) =
        knowns.iter().partition(|&&i| metas[i].causality == Causality::Parameter);
    let together = (!parameters.is_empty()).then_some(parameters);
    others.into_iter().map(|known| vec![known]).chain(together).collect()
}

/// Operating points: the start values; then, in turn, other values for about half of the inputs and parameters, and an earlier
/// point that showed a new dependency with one to four values changed.
struct Points<'a, M: Model> {
    saving: &'a Saving<M>,
    fresh: &'a Block<M>,
    settable: &'a [usize],
    draw: Draw,
    fruitful: Vec<Block<M>>,
    last: Option<Block<M>>,
    count: usize,
    most: usize,
    /// Dependencies known before the last point.
    known: usize,
}

impl<'a, M: Model> Points<'a, M> {
    /// Number of points for a model that runs `runs` times at each.
    fn new(saving: &'a Saving<M>, fresh: &'a Block<M>, settable: &'a [usize], runs: usize, seed: u64) -> Self {
        let most = (RUNS / runs.max(1)).clamp(POINTS.0, POINTS.1);
        Self {
            saving,
            fresh,
            settable,
            draw: Draw::new(seed),
            fruitful: Vec::new(),
            last: None,
            count: 0,
            most,
            known: 0,
        }
    }

    fn next(&mut self, can: &Capabilities<M>, states: &[usize], found: &Found) -> Option<Block<M>> {
        let known = found.0.iter().map(Vec::len).sum();
        if known > self.known {
            self.fruitful.extend(self.last.take());
            self.known = known;
        }
        // The limit of an integer may be far from its start value: more points for a model that has some.
        self.draw.far = self.count >= self.most;
        let far = if const { M::TABLE.kinds().meets(Kinds::INTEGERS) } { self.most / 8 } else { 0 };
        if self.count >= self.most + far || self.settable.is_empty() && self.count >= POINTS.0 {
            return None;
        }
        let draw = &mut self.draw;
        let block = match self.fruitful.len() {
            n if n > 0 && !self.settable.is_empty() && self.count.is_multiple_of(2) => {
                let mut block = self.saving.block(&self.fruitful[draw.below(u32::try_from(n).unwrap_or(u32::MAX))]);
                for _ in 0..=draw.below(4) {
                    let i = draw.below(u32::try_from(self.settable.len()).unwrap_or(u32::MAX));
                    change(can, &mut block, states, self.settable[i], draw);
                }
                block
            }
            _ => {
                let mut block = self.saving.block(self.fresh);
                for &i in self.settable {
                    if self.count > 0 && draw.below(2) == 0 {
                        change(can, &mut block, states, i, draw);
                    }
                }
                block
            }
        };
        self.count += 1;
        self.last = Some(self.saving.block(&block));
        Some(block)
    }
}

/// Maximum relative change of a real number that counts as rounding: a torque, computed in stator axes, changes by about 1e-16
/// with the rotor angle.
const ROUNDING: f64 = 1e-11;

/// Whether two values differ by more than rounding. Integers, Booleans and hashes of texts, read as the bits of a real number,
/// differ by more.
fn differ(before: u64, after: u64) -> bool {
    let (a, b) = (f64::from_bits(before), f64::from_bits(after));
    let rounded = (a - b).abs() <= ROUNDING * a.abs().max(b.abs()) && a.is_finite() && b.is_finite();
    before != after && !rounded
}

/// The dependencies of the unknowns on the knowns.
struct Found(Vec<Vec<usize>>);

impl Found {
    fn new(unknowns: usize) -> Self {
        Self(vec![Vec::new(); unknowns])
    }

    fn compare(&mut self, knowns: &[usize], before: &[u64], after: &[u64]) {
        for (list, (before, after)) in self.0.iter_mut().zip(before.iter().zip(after)) {
            if differ(*before, *after) && !list.contains(&knowns[0]) {
                list.extend(knowns);
            }
        }
    }

    /// A known on which every unknown may depend.
    fn suspect(&mut self, known: usize) {
        self.0.iter_mut().for_each(|list| list.push(known));
    }

    /// Dependencies of the initial values of outputs, calculated parameters, states and derivatives.
    fn initial<M: Model>(self, metas: &[&Meta], states: &[usize]) -> Dependencies {
        let wide = wide::<M>();
        let unknown = |i: usize| {
            let calculated = |c| matches!(c, Causality::Output | Causality::CalculatedParameter);
            let state = states.contains(&wide.index(i));
            metas.get(i).is_none_or(|meta| !meta.has_start() && (state || calculated(meta.causality)))
        };
        self.list(unknown, &wide)
    }

    /// Dependencies of outputs and derivatives between two events.
    fn between<M: Model>(self, metas: &[&Meta]) -> Dependencies {
        self.list(|i| metas.get(i).is_none_or(|meta| meta.causality == Causality::Output), &wide::<M>())
    }

    fn list(self, unknown: impl Fn(usize) -> bool, wide: &Wide) -> Dependencies {
        let sorted = |mut list: Vec<usize>| {
            for known in &mut list {
                *known = wide.index(*known);
            }
            list.sort_unstable();
            list
        };
        self.0.into_iter().enumerate().map(|(i, list)| unknown(i).then(|| sorted(list))).collect()
    }
}

fn metas<M: Model>() -> Vec<&'static Meta> {
    let one = |i| M::TABLE.locate(i).map(|(_, meta, _)| meta);
    (0..M::TABLE.len()).chain(wide::<M>().arrays.into_iter().map(|(first, _)| first)).filter_map(one).collect()
}

/// The wide arrays of a table, whose positions follow those of its other variables.
pub(crate) struct Wide {
    /// Number of the other variables.
    len: usize,
    /// First index and number of elements of each.
    pub(crate) arrays: Vec<(usize, usize)>,
}

impl Wide {
    /// The table index of a position; [`NOW`] stays.
    fn index(&self, place: usize) -> usize {
        place.checked_sub(self.len).and_then(|i| self.arrays.get(i)).map_or(place, |(first, _)| *first)
    }
}

/// The wide arrays of a model's table.
pub(crate) fn wide<M: Model>() -> Wide {
    let mut arrays: Vec<(usize, usize)> = Vec::new();
    if const { M::TABLE.wide() == 0 } {
        return Wide { len: M::TABLE.len(), arrays };
    }
    for index in M::TABLE.indices().skip(M::TABLE.len()) {
        match M::TABLE.element(index) {
            Some(0) => arrays.push((index, 1)),
            _ => arrays.iter_mut().rev().take(1).for_each(|(_, n)| *n += 1),
        }
    }
    Wide { len: M::TABLE.len(), arrays }
}

/// Bits of all values after the outputs at `now` were computed.
fn observed<M: Model>(can: &Capabilities<M>, mut block: Block<M>, now: Elapsed) -> Vec<u64> {
    let observe = can.continuous.as_ref().map_or(M::output as fn(&M, _, &mut _), |continuous| continuous.observe);
    observe(&block.model, now, &mut block.out);
    values(can, block, now)
}

/// The bits of every variable, then of every derivative.
fn values<M: Model>(can: &Capabilities<M>, mut block: Block<M>, now: Elapsed) -> Vec<u64> {
    let mut dx = vec![f64::NAN; can.scalars()];
    let n = can.count_states(&mut block.model);
    if let Some(continuous) = &can.continuous
        && (continuous.derivatives)(&block.model, now, &mut dx[..n]).is_err()
    {
        dx.fill(f64::NAN);
    }
    can.spread(&mut block.model, &mut dx);
    let mut value = |i| M::TABLE.entry(&mut block, i).map_or(0, |(_, slot)| slot.bits());
    let mut all: Vec<u64> = (0..M::TABLE.len()).map(&mut value).collect();
    for (first, n) in wide::<M>().arrays {
        // Elements that differ only by rounding change the hash, so a wide array may get too many dependencies.
        let of_all = (first..first + n)
            .map(&mut value)
            .fold(0, |hash: u64, bits| (hash.rotate_left(5) ^ bits).wrapping_mul(0x0100_0000_01b3));
        all.push(of_all >> 12);
    }
    all.extend(dx.iter().map(|x| x.to_bits()));
    all
}

/// Moves state `i` by about its nominal value.
fn shift<M: Model>(can: &Capabilities<M>, block: &mut Block<M>, states: &[usize], i: usize, draw: &mut Draw) {
    let nominal = M::TABLE.entry(block, states[i]).and_then(|(meta, _)| meta.nominal).unwrap_or(1.0);
    let Some(x) = can.scalar(&mut block.model, i) else { return };
    *x += nominal * draw.between(0.3, 1.0) * if draw.below(2) == 0 { 1.0 } else { -1.0 };
    if let Some(continuous) = &can.continuous {
        (continuous.settle)(&mut block.model);
    }
}

/// Sets knowns to other allowed values: a single one, or about half of several.
fn vary<M: Model>(can: &Capabilities<M>, block: &mut Block<M>, states: &[usize], knowns: &[usize], draw: &mut Draw) {
    for &known in knowns {
        if knowns.len() == 1 || draw.below(2) == 0 {
            change(can, block, states, known, draw);
        }
    }
}

/// Sets the variable at a position to another allowed value; in a wide array, each element.
fn change<M: Model>(can: &Capabilities<M>, block: &mut Block<M>, states: &[usize], known: usize, draw: &mut Draw) {
    if let Some((first, n)) = known.checked_sub(M::TABLE.len()).and_then(|i| wide::<M>().arrays.get(i).copied()) {
        (first..first + n).for_each(|index| change_one(can, block, states, index, draw));
    } else {
        change_one(can, block, states, known, draw);
    }
}

fn change_one<M: Model>(can: &Capabilities<M>, block: &mut Block<M>, states: &[usize], index: usize, draw: &mut Draw) {
    let Some((meta, slot)) = can.place(block, states, index) else { return };
    match slot {
        Slot::Real(x) => {
            // The magnitude of a value that is 0 at the start is unknown, so 1 to 1000 times the nominal value is tried.
            let magnitude = [1.0, 10.0, 100.0, 1000.0][draw.below(4)];
            let scale = if *x == 0.0 { magnitude * meta.nominal.unwrap_or(1.0) } else { *x };
            for _ in 0..20 {
                let candidate =
                    if *x == 0.0 { scale * draw.between(-1.0, 1.0) } else { scale * draw.between(0.5, 1.5) };
                if meta.range.contains(candidate) && candidate.to_bits() != x.to_bits() {
                    *x = candidate;
                    return;
                }
            }
        }
        Slot::Float32(x) => {
            let candidate = if *x == 0.0 { 1.0 } else { 1.5 * *x };
            let other = [candidate, 0.75 * *x, -candidate].into_iter().find(|&v| meta.range.contains_single(v));
            *x = other.unwrap_or(*x);
        }
        Slot::Integer(x) => {
            let Kind::Integer(of) = meta.kind else { return };
            let value = x.get();
            let others = if draw.far {
                let scale = if value == 0 { [1, 10, 100, 1000][draw.below(4)] } else { 2 * value.abs() };
                let far = ((i128::from(draw.next()) * (2 * scale + 1)) >> 32) - scale;
                [far, -far, far / 8]
            } else {
                [value + 1, value - 1, value + 2]
            };
            let others = others.into_iter().filter(|&v| v != value && of.allows(v, &meta.range));
            if let Some(other) = others.collect::<Vec<_>>().get(draw.below(2)) {
                x.set(*other);
            }
        }
        Slot::Boolean(x) => *x = !*x,
        Slot::Enumeration(x) => {
            let Kind::Enumeration(e) = meta.kind else { return };
            let others = e.items.iter().map(|item| item.value).filter(|&v| v != x.get());
            if let Some(&other) = others.collect::<Vec<_>>().get(draw.below(2)) {
                x.set(other);
            }
        }
        Slot::Text(_) | Slot::Said(_) | Slot::Binary(_) | Slot::Constant(_) | Slot::Clock(_) => {}
    }
}

/// A deterministic stream of numbers (Knuth's 64-bit congruential generator).
struct Draw {
    state: u64,
    /// Integers change to values far from their own, also on the other side of 0.
    far: bool,
}

impl Draw {
    fn new(seed: u64) -> Self {
        Self { state: seed, far: false }
    }

    fn next(&mut self) -> u32 {
        self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from(self.state >> 32).unwrap_or_default()
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.next()) / f64::from(u32::MAX)
    }

    fn below(&mut self, n: u32) -> usize {
        usize::try_from(self.next() % n).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_not_a_dependency() {
        let bits = f64::to_bits;
        assert!(!differ(bits(0.1 + 0.2), bits(0.3)) && !differ(bits(f64::NAN), bits(f64::NAN)));
        assert!(
            differ(bits(1.0), bits(1.0 + 1e-10)) && differ(bits(0.0), bits(1e-300)) && differ(bits(1.0), bits(-1.0))
        );
        assert!(differ(1, 2) && differ(0, 1) && differ(u64::from(u32::MAX), u64::from(u32::MAX) - 1));
        assert!(differ(bits(f64::NAN), bits(1.0)) && differ(bits(f64::INFINITY), bits(1.0)));
    }
}
