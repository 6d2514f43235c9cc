//! Finds the dependencies of initial values by running the model itself.
//!
//! At several operating points, each input and parameter is changed alone; every output and calculated parameter whose
//! bits change depends on it (`InitialUnknowns` of FMI 2.0.5, 2.2.8 and FMI 3.0.2, 2.4.8).

use crate::model::{Block, Model};
use crate::row::Slot;
use crate::variable::{Causality, Kind, Meta};

/// Operating points tried, the start values among them.
const POINTS: u32 = 16;

/// For each index of the table that is an output or a calculated parameter, the indices that it depends on.
pub(crate) fn initial_dependencies<M: Model>() -> Vec<Option<Vec<usize>>> {
    let table = M::TABLE;
    let mut block = Block::<M>::default();
    let causality: Vec<Causality> =
        (0..table.len()).filter_map(|i| table.entry(&mut block, i).map(|(meta, _)| meta.causality)).collect();
    let mut found = vec![vec![false; table.len()]; table.len()];
    let mut draw = Draw(1);
    for point in 0..POINTS {
        let mut base = Block::<M>::default();
        if point > 0 {
            for i in (0..table.len()).filter(|&i| causality[i].is_settable()) {
                change::<M>(&mut base, i, &mut draw);
            }
        }
        let before = values(&mut base);
        for known in (0..table.len()).filter(|&i| causality[i].is_settable()) {
            let mut changed = base.clone();
            change::<M>(&mut changed, known, &mut draw);
            for (unknown, after) in values(&mut changed).into_iter().enumerate() {
                found[unknown][known] |= after != before[unknown];
            }
        }
    }
    let unknown = |c: Causality| matches!(c, Causality::Output | Causality::CalculatedParameter);
    let list = |of: &[bool]| (0..of.len()).filter(|&i| of[i]).collect();
    found.iter().zip(&causality).map(|(of, &c)| unknown(c).then(|| list(of))).collect()
}

/// The bits of every value after initialization.
fn values<M: Model>(block: &mut Block<M>) -> Vec<u64> {
    block.initialize();
    (0..M::TABLE.len())
        .map(|i| match M::TABLE.entry(block, i) {
            Some((_, Slot::Real(x))) => x.to_bits(),
            Some((_, Slot::Integer(x))) => u64::from(x.cast_unsigned()),
            Some((_, Slot::Boolean(x))) => u64::from(*x),
            Some((_, Slot::Enumeration(x))) => u64::from(x.get().cast_unsigned()),
            None => 0,
        })
        .collect()
}

/// Sets variable `index` to another value that is allowed.
fn change<M: Model>(block: &mut Block<M>, index: usize, draw: &mut Draw) {
    let Some((meta, slot)) = M::TABLE.entry(block, index) else { return };
    match slot {
        Slot::Real(x) => {
            let scale = if *x == 0.0 { meta.nominal.unwrap_or(1.0) } else { *x };
            for _ in 0..20 {
                let candidate =
                    if *x == 0.0 { scale * draw.between(-1.0, 1.0) } else { scale * draw.between(0.5, 1.5) };
                if meta.range.contains(candidate) && candidate.to_bits() != x.to_bits() {
                    *x = candidate;
                    return;
                }
            }
        }
        Slot::Integer(x) => {
            if let Some(&other) = other_integers(meta, *x).get(draw.below(2)) {
                *x = other;
            }
        }
        Slot::Boolean(x) => *x = !*x,
        Slot::Enumeration(x) => {
            if let Some(&other) = other_integers(meta, x.get()).get(draw.below(2)) {
                x.set(other);
            }
        }
    }
}

fn other_integers(meta: &Meta, x: i32) -> Vec<i32> {
    match &meta.kind {
        Kind::Enumeration(e) => e.items.iter().map(|item| item.value).filter(|&v| v != x).collect(),
        _ => [x + 1, x - 1, x + 2].into_iter().filter(|&v| meta.range.contains(f64::from(v))).collect(),
    }
}

/// A deterministic stream of numbers (Knuth's 64-bit congruential generator).
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from(self.0 >> 32).unwrap_or_default()
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.next()) / f64::from(u32::MAX)
    }

    fn below(&mut self, n: u32) -> usize {
        usize::try_from(self.next() % n).unwrap_or_default()
    }
}
