//! Reading and writing several real scalars at once: what an importer does at every communication point.
//!
//! A part is looked up once for all its consecutive variables, and no value is wrapped.

use crate::row::Access;
use crate::table::Table;
use crate::variable::{Causality, Kind, Meta, Range, Variability};
use std::mem::{MaybeUninit, replace};

/// Values for real inputs.
#[derive(Debug)]
pub struct RealInputs<'a> {
    /// The values, one for each reference.
    pub values: &'a [f64],
    /// Buffer for the previous values of the inputs.
    pub before: &'a mut [f64],
    /// Only continuous inputs may be set.
    pub continuous: bool,
}

impl<W: 'static> Table<W> {
    /// Reads real scalars up to the first reference of another kind; returns their number. `first` is the reference of the
    /// table's first variable.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "indices fit in references")]
    pub fn read(&self, whole: &mut W, list: &[u32], first: u32, out: &mut [MaybeUninit<f64>]) -> usize {
        let n = list.len().min(out.len());
        let (list, out, mut i) = (&list[..n], &mut out[..n], 0);
        while i < n {
            let Some((row, inner)) = self.near_or_far(list[i].wrapping_sub(first) as usize) else { break };
            match &row.access {
                Access::Real(get) => {
                    out[i].write(*get(whole));
                    i += 1;
                }
                Access::Part { node, .. } => {
                    let done = node.read(whole, &list[i..], list[i].wrapping_sub(inner as u32), &mut out[i..]);
                    if done == 0 {
                        break;
                    }
                    i += done;
                }
                _ => break,
            }
        }
        i
    }

    /// Writes real scalar inputs up to the first reference of another kind, the first input that may not be set, or the first
    /// value out of range; returns their number. The buffer for previous values is large enough.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "indices fit in references")]
    pub fn write(&self, whole: &mut W, list: &[u32], first: u32, inputs: RealInputs<'_>) -> usize {
        let RealInputs { values, before, continuous } = inputs;
        let n = list.len().min(values.len()).min(before.len());
        let (list, values, before, mut i) = (&list[..n], &values[..n], &mut before[..n], 0);
        while i < n {
            let Some((row, inner)) = self.near_or_far(list[i].wrapping_sub(first) as usize) else { break };
            match &row.access {
                Access::Real(get) => {
                    let open = !continuous || row.meta.variability == Variability::Continuous;
                    if !open || !row.settable.contains(values[i]) {
                        break;
                    }
                    before[i] = replace(get(whole), values[i]);
                    i += 1;
                }
                Access::Part { node, .. } => {
                    let rest = RealInputs { values: &values[i..], before: &mut before[i..], continuous };
                    let done = node.write(whole, &list[i..], list[i].wrapping_sub(inner as u32), rest);
                    if done == 0 {
                        break;
                    }
                    i += done;
                }
                _ => break,
            }
        }
        i
    }
}

/// The allowed values of a real input as a closed interval; none for another variable.
pub(crate) struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    /// [`Range::contains`] as two comparisons.
    pub(crate) const fn of(meta: &Meta) -> Self {
        if !(matches!(meta.causality, Causality::Input) && matches!(meta.kind, Kind::Real(_))) {
            return Self { low: f64::INFINITY, high: f64::NEG_INFINITY };
        }
        let Range { min, max, above, below } = meta.range;
        let (low, high) = (if above { min.next_up() } else { min }, if below { max.next_down() } else { max });
        Self { low: low.max(f64::MIN), high: high.min(f64::MAX) }
    }

    #[inline]
    fn contains(&self, x: f64) -> bool {
        x >= self.low && x <= self.high
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::VOLT;
    use crate::{Part, Row, table};

    #[derive(Default)]
    struct Pair {
        a: f64,
        b: f64,
    }

    #[derive(Default)]
    struct Whole {
        u: f64,
        on: bool,
        pair: Pair,
        k: f64,
        y: f64,
    }

    type V = Row<Whole>;
    type P = Row<Pair>;

    const PAIR: &Table<Pair> =
        table![P::input("a", &VOLT, "", |p| &mut p.a), P::discrete_input("b", &VOLT, "", |p| &mut p.b).at_most(5.0)];
    const TABLE: &Table<Whole> = table![
        V::input("u", &VOLT, "", |m| &mut m.u),
        V::boolean_input("on", "", |m| &mut m.on),
        V::part("pair.", &Part { table: PAIR, lens: |m| &mut m.pair }),
        V::parameter("k", &VOLT, "", |m| &mut m.k),
        V::output("y", &VOLT, "", |m| &mut m.y),
    ];

    fn read(list: &[u32]) -> usize {
        let mut whole = Whole::default();
        TABLE.read(&mut whole, list, 1, &mut [MaybeUninit::uninit(); 8])
    }

    /// The number written, and all values afterwards.
    fn write(list: &[u32], values: &[f64], continuous: bool) -> (usize, [f64; 5]) {
        let (mut whole, mut before) = (Whole { u: 1.0, ..Whole::default() }, [f64::NAN; 8]);
        let inputs = RealInputs { values, before: &mut before, continuous };
        let n = TABLE.write(&mut whole, list, 1, inputs);
        for (&reference, x) in list[..n].iter().zip(&before) {
            assert_eq!(x.to_bits(), f64::from(u8::from(reference == 1)).to_bits(), "value of {reference} before");
        }
        (n, [whole.u, whole.pair.a, whole.pair.b, whole.k, whole.y])
    }

    #[test]
    fn a_vector_leads_into_parts_and_out_of_them() {
        assert_eq!(read(&[1, 3, 4, 5, 6, 4, 1]), 7);
        assert_eq!(write(&[1, 3, 4], &[7.0, 8.0, -9.0], false), (3, [7.0, 8.0, -9.0, 0.0, 0.0]));
        assert_eq!(write(&[4, 3, 1], &[-9.0, 8.0, 7.0], false), (3, [7.0, 8.0, -9.0, 0.0, 0.0]));
    }

    #[test]
    fn it_ends_at_what_is_no_real_scalar() {
        assert_eq!((read(&[1, 2, 3]), read(&[3, 0]), read(&[6, 7]), read(&[0]), read(&[])), (1, 1, 1, 0, 0));
        assert_eq!(write(&[1, 2], &[7.0, 8.0], false).0, 1);
        assert_eq!(write(&[3, u32::MAX], &[7.0, 8.0], false).0, 1);
    }

    #[test]
    fn it_writes_open_inputs_in_their_range_only() {
        for refused in [(5, 1.0), (6, 1.0), (4, 5.1), (4, f64::NAN), (1, f64::INFINITY)] {
            let (n, values) = write(&[3, refused.0], &[2.0, refused.1], false);
            assert_eq!((n, values), (1, [1.0, 2.0, 0.0, 0.0, 0.0]), "{refused:?}");
        }
        assert_eq!(write(&[3, 4], &[1.0, 1.0], true).0, 1, "b is discrete");
    }

    #[test]
    fn inputs_take_what_their_range_contains() {
        const EDGES: [f64; 8] = [0.0, -0.0, -1.0, 2.0, f64::MIN, f64::MAX, f64::INFINITY, f64::NEG_INFINITY];
        let row = || P::input("a", &VOLT, "", |p| &mut p.a);
        let rows = [
            row(),
            row().above(0.0),
            row().above(-0.0).below(2.0),
            row().at_least(-1.0).at_most(2.0),
            row().below(-1.0),
        ];
        for row in rows {
            for x in EDGES.into_iter().flat_map(|x| [x.next_down(), x, x.next_up()]).chain([f64::NAN]) {
                assert_eq!(row.settable.contains(x), row.meta.range.contains(x), "{x} in {}", row.meta.range);
            }
        }
        assert!(!P::output("a", &VOLT, "", |p| &mut p.a).settable.contains(0.0));
        assert!(!P::parameter("a", &VOLT, "", |p| &mut p.a).settable.contains(0.0));
    }
}
