//! The variable table of a type, composed of variables and of other types' tables.
//!
//! A variable's index is its running offset: a scalar takes one, an array one per element, a part as many as its table. A wide
//! array, of more than [`DENSE`] elements, has separate indices, from [`WIDE`] on. The rows of the first [`DIRECT`] indices are in
//! a list; the others, and wide arrays, are found by bisection. Everything that does not need a value is checked at compile time:
//! names, ranges, the number of variables.

use crate::clock::Ticks;
use crate::fault::Fault;
use crate::kinds::Kinds;
use crate::names::{MOST_ROWS, Names};
use crate::reals::RealInputs;
use crate::refusal::demand;
use crate::row::{Access, Constant, Node, Row, SizedNode, Slot, Start};
use crate::sizes::{Sizes, check_sized};
use crate::token::Hash;
use crate::variable::{Causality, Kind, Meta, Variability};
use std::fmt::Display;
use std::mem::MaybeUninit;
use std::ptr;

/// Number of indices whose rows are in a list.
pub const DIRECT: usize = 512;

/// Maximum number of elements of an array that is not wide.
pub const DENSE: usize = 128;

/// Index of the first element of the first wide array.
pub const WIDE: usize = 1 << 30;

/// The table of `P` as a part of `W`.
pub struct Part<W: 'static, P: 'static> {
    /// Table of the part.
    pub table: &'static Table<P>,
    /// Location of the part.
    pub lens: fn(&mut W) -> &mut P,
}

impl<W, P> Node<W> for Part<W, P> {
    fn entry<'a>(&self, whole: &'a mut W, index: usize) -> Option<(&'static Meta, Slot<'a>)> {
        self.table.entry((self.lens)(whole), index)
    }

    fn read(&self, whole: &mut W, list: &[u32], first: u32, out: &mut [MaybeUninit<f64>]) -> usize {
        self.table.read((self.lens)(whole), list, first, out)
    }

    fn write(&self, whole: &mut W, list: &[u32], first: u32, inputs: RealInputs<'_>) -> usize {
        self.table.write((self.lens)(whole), list, first, inputs)
    }

    fn locate(&self, index: usize, name: &mut String) -> Option<(&'static Meta, usize)> {
        self.table.locate_into(index, name)
    }

    fn element(&self, index: usize) -> Option<usize> {
        self.table.element(index)
    }

    fn clocks_of(&self, index: usize) -> &'static str {
        self.table.clocks_of(index)
    }
}

impl<W, P> SizedNode<W> for Part<W, P> {
    fn extent(&self, whole: &mut W, index: usize) -> Option<(&'static Meta, usize)> {
        self.table.extent((self.lens)(whole), index)
    }

    fn extents(&self, whole: &mut W, index: usize) -> Vec<usize> {
        self.table.extents((self.lens)(whole), index)
    }

    fn check_sizes(&self, whole: &mut W) -> Result<(), Fault> {
        self.table.check_sizes((self.lens)(whole))
    }
}

impl<W: 'static> Row<W> {
    /// All variables of a part, under a prefix that ends with a dot (or none).
    #[track_caller]
    pub const fn part<P>(prefix: &'static str, part: &'static Part<W, P>) -> Self {
        let Table { len, wide, hash, kinds, intermediate, sizes, .. } = *part.table;
        let sized = if sizes.any { Some(part as &dyn SizedNode<W>) } else { None };
        let access = Access::Part { len, wide, hash, kinds, sizes, node: part, sized };
        let mut row = Self::new(prefix, "", Kind::Boolean, access);
        row.meta.intermediate = intermediate;
        row
    }
}

/// A `&'static Table` from its rows, built and checked while compiling; [`Row`] has an example of every kind of row.
#[macro_export]
macro_rules! table {
    ($($row:expr),* $(,)?) => {
        &$crate::Table::new(const { &$crate::table::numbered([$($row),*]) })
    };
}

/// The rows of a table, for several tables that share some.
#[macro_export]
macro_rules! rows {
    ($($row:expr),* $(,)?) => {
        const { &$crate::table::numbered([$($row),*]) }
    };
}

/// The rows with the number of indices before each.
#[doc(hidden)]
pub const fn numbered<W: 'static, const N: usize>(mut rows: [Row<W>; N]) -> [Row<W>; N] {
    let (mut row, mut dense, mut wide) = (0, 0, 0);
    while row < N {
        rows[row].start = Start { dense, wide };
        let Start { dense: more, wide: wider } = rows[row].indices();
        (dense, wide, row) = (dense + more, wide + wider, row + 1);
    }
    rows
}

impl<W: 'static> Row<W> {
    /// Number of its indices.
    const fn indices(&self) -> Start {
        match (&self.access, self.meta.dimension) {
            (Access::Part { len, wide, .. }, _) => Start { dense: *len, wide: *wide },
            (_, Some(n)) if n > DENSE => Start { dense: 0, wide: n },
            (_, Some(n)) => Start { dense: n, wide: 0 },
            (_, None) => Start { dense: 1, wide: 0 },
        }
    }
}

/// A value of an enumeration with the name of its item.
fn item(meta: &Meta, value: i32) -> String {
    let Kind::Enumeration(enumeration) = meta.kind else { return value.to_string() };
    let name = enumeration.items.iter().find(|item| item.value == value).map_or("?", |item| item.name);
    format!("{value} ({name})")
}

/// The target of an index: a row, and the index inside it.
#[derive(Clone, Copy)]
pub(crate) struct RowPlace {
    pub(crate) row: u16,
    inner: u16,
}

/// Finds a value of a rare kind.
type Rare<W> = for<'a> fn(&'static Row<W>, &'a mut W, usize) -> Option<Slot<'a>>;

/// Finds an element of a wide array.
type Beyond<W> = for<'a> fn(&Table<W>, &'a mut W, usize) -> Option<(&'static Meta, Slot<'a>)>;

/// Finds the row of an index after the first ones, and the index in the row.
type Far<W> = fn(&Table<W>, usize) -> Option<(&'static Row<W>, usize)>;

/// All variables of `W`; [`table!`](crate::table!) makes one from its rows.
pub struct Table<W: 'static> {
    pub(crate) rows: &'static [Row<W>],
    places: [RowPlace; DIRECT],
    len: usize,
    /// Number of elements of wide arrays.
    wide: usize,
    hash: Hash,
    /// The kinds of its variables.
    kinds: Kinds,
    /// A variable can be read or set inside a communication step.
    pub(crate) intermediate: bool,
    /// Summary of the structural parameters.
    pub(crate) sizes: Sizes,
    /// Functions that only some tables need: other tables do not contain their code.
    rare: Option<Rare<W>>,
    beyond: Option<Beyond<W>>,
    far: Option<Far<W>>,
}

impl<W: 'static> Table<W> {
    /// Builds the table from [`rows!`](crate::rows!), or from consecutive ones of them.
    ///
    /// # Panics
    /// At compile time, on a duplicate name, an array without an element, or more than 16384 rows.
    #[track_caller]
    #[expect(clippy::cast_possible_truncation, reason = "rows and DIRECT fit in 16 bits")]
    pub const fn new(rows: &'static [Row<W>]) -> Self {
        assert!(MOST_ROWS < u16::MAX as usize);
        let mut names = Names::new();
        let mut row = 0;
        while row < rows.len() {
            // A part without a prefix has no name; its variables are checked by the description.
            names.add(rows[row].meta.name, "two rows of the table have this name");
            row += 1;
        }
        // No row past the end.
        let mut places = [RowPlace { row: u16::MAX, inner: 0 }; DIRECT];
        let (mut len, mut row, mut hash, mut kinds, mut intermediate) = (0, 0, Hash::START, Kinds::NONE, false);
        let (mut sizes, mut has_rare) = (Sizes::NONE, false);
        let mut wide = 0;
        while row < rows.len() {
            let meta = &rows[row].meta;
            intermediate |= meta.intermediate;
            has_rare |= rows[row].access.is_rare();
            if let Access::Part { hash: of_part, kinds: of_kinds, sizes: of_sizes, .. } = &rows[row].access {
                kinds = kinds.and(*of_kinds);
                sizes = sizes.and(*of_sizes);
                hash = hash.text(meta.name).join(of_part);
                if !meta.clocks.is_empty() {
                    hash = hash.text("on").text(meta.clocks);
                }
            } else {
                demand(!meta.name.is_empty(), meta.description, "a variable needs a name");
                demand(!matches!(meta.dimension, Some(0)), meta.name, "an array needs an element");
                check_sized(rows, row, &names);
                sizes = sizes.and(Sizes::of(meta));
                kinds = kinds.and(Kinds::of(&meta.kind));
                hash = hash.meta(meta);
            }
            let Start { dense, wide: wider } = rows[row].indices();
            let mut inner = 0;
            while inner < dense && len + inner < DIRECT {
                places[len + inner] = RowPlace { row: row as u16, inner: inner as u16 };
                inner += 1;
            }
            (len, wide) = (len + dense, wide + wider);
            row += 1;
        }
        assert!(len < WIDE);
        let rare: Option<Rare<W>> = if has_rare { Some(find_rare) } else { None };
        let beyond: Option<Beyond<W>> = if wide > 0 { Some(Self::wide_entry) } else { None };
        let far: Option<Far<W>> = if len > DIRECT { Some(Self::far_row) } else { None };
        Self { rows, places, len, wide, hash, kinds, intermediate, sizes, rare, beyond, far }
    }

    /// Whether a row is a clock that the model ticks, or one whose ticks the model requests.
    pub const fn announces(&self) -> bool {
        let mut row = 0;
        while row < self.rows.len() {
            if let Kind::Clock(timing) = self.rows[row].meta.kind
                && (matches!(self.rows[row].meta.causality, Causality::Output)
                    || matches!(timing.ticks, Ticks::Countdown))
            {
                return true;
            }
            row += 1;
        }
        false
    }

    /// Every index: below [`len`](Self::len), then for wide arrays from [`WIDE`] on.
    pub fn indices(&self) -> impl Iterator<Item = usize> + use<W> {
        (0..self.len).chain(WIDE..WIDE + self.wide)
    }

    /// Number of elements of wide arrays.
    pub const fn wide(&self) -> usize {
        self.wide
    }

    /// Number of indices without those of wide arrays: variables, array elements counted singly.
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether the table is empty.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The kinds of its variables.
    pub const fn kinds(&self) -> Kinds {
        self.kinds
    }

    /// Hash of the content of the rows.
    pub const fn hash(&self) -> Hash {
        self.hash
    }

    /// The variable `index` and its value in `whole`; `None` past the end.
    #[inline]
    pub fn entry<'a>(&self, whole: &'a mut W, index: usize) -> Option<(&'static Meta, Slot<'a>)> {
        if index >= self.len {
            return (self.beyond?)(self, whole, index);
        }
        let (row, inner) = self.near_or_far(index)?;
        let slot = match &row.access {
            Access::Real(get) => Slot::Real(get(whole)),
            Access::Reals(get) => Slot::Real(get(whole).get_mut(inner)?),
            Access::Integer(get) => Slot::Integer(get.find(whole)),
            Access::Boolean(get) => Slot::Boolean(get(whole)),
            Access::Enumeration(field) => Slot::Enumeration(field.find(whole)),
            Access::Text(get) => Slot::Text(get(whole)),
            Access::Said(say) => Slot::Said(say(whole)),
            Access::Part { node, .. } => return node.entry(whole, inner),
            _ => (self.rare?)(row, whole, inner)?,
        };
        Some((&row.meta, slot))
    }

    /// The row of an index that does not belong to a wide array, and the index in the row.
    #[inline]
    pub(crate) fn near_or_far(&self, index: usize) -> Option<(&'static Row<W>, usize)> {
        let Some(place) = self.places.get(index) else { return (self.far?)(self, index) };
        Some((self.rows.get(usize::from(place.row))?, usize::from(place.inner)))
    }

    /// [`near_or_far`](Self::near_or_far) of an index after the first ones.
    #[cold]
    fn far_row(&self, index: usize) -> Option<(&'static Row<W>, usize)> {
        let at = self.rows.first()?.start.dense + index;
        // A row without such indices starts at the same index as the next one.
        let after = self.rows.partition_point(|row| row.start.dense <= at);
        let row = self.rows.get(after.checked_sub(1)?)?;
        (index < self.len).then_some((row, at - row.start.dense))
    }

    /// [`entry`](Self::entry) of an element of a wide array.
    #[cold]
    fn wide_entry<'a>(&self, whole: &'a mut W, index: usize) -> Option<(&'static Meta, Slot<'a>)> {
        let (row, inner) = self.wide_place(index)?;
        let slot = match &row.access {
            Access::Reals(get) => Slot::Real(get(whole).get_mut(inner)?),
            Access::List(items) => items.find(whole, inner)?,
            Access::Constants(all) => Slot::Constant(Constant::Real(*all.get(inner)?)),
            Access::Part { node, .. } => return node.entry(whole, WIDE + inner),
            _ => return None,
        };
        Some((&row.meta, slot))
    }

    /// The row of an element of a wide array, and its position in the row.
    fn wide_place(&self, index: usize) -> Option<(&'static Row<W>, usize)> {
        let at = index.checked_sub(WIDE).filter(|at| *at < self.wide)? + self.rows.first()?.start.wide;
        let after = self.rows.partition_point(|row| row.start.wide <= at);
        let row = self.rows.get(after.checked_sub(1)?)?;
        Some((row, at - row.start.wide))
    }

    /// The row of a variable, and the index in it; for wide arrays of a part it counts from [`WIDE`].
    pub(crate) fn row_of(&self, index: usize) -> Option<(&'static Row<W>, usize)> {
        if index < self.len {
            return self.near_or_far(index);
        }
        let (row, inner) = self.wide_place(index)?;
        Some((row, if matches!(row.access, Access::Part { .. }) { WIDE + inner } else { inner }))
    }

    /// Which element of an array variable `index` is, 0 for a scalar; `None` past the end. Does not allocate.
    pub fn element(&self, index: usize) -> Option<usize> {
        let (row, inner) = self.row_of(index)?;
        if let Access::Part { node, .. } = &row.access { node.element(inner) } else { Some(inner) }
    }

    /// Names of the clocks of variable `index`, separated by spaces; empty if it has none. If a part is on a clock, all its
    /// variables except parameters are.
    pub fn clocks_of(&self, index: usize) -> &'static str {
        let Some((row, place)) = self.near_or_far(index) else { return "" };
        match &row.access {
            Access::Part { node, .. } => {
                let inner = node.clocks_of(place);
                let changes = || {
                    let found = node.locate(place, &mut String::new());
                    found.is_some_and(|(meta, _)| {
                        matches!(meta.causality, Causality::Input | Causality::Output | Causality::Local)
                            && !matches!(meta.kind, Kind::Clock(_))
                            && meta.variability != Variability::Constant
                    })
                };
                if inner.is_empty() && !row.meta.clocks.is_empty() && changes() { row.meta.clocks } else { inner }
            }
            _ => row.meta.clocks,
        }
    }

    /// Full name and description of variable `index`, and which element of an array it is (0 for a scalar).
    pub fn locate(&self, index: usize) -> Option<(String, &'static Meta, usize)> {
        let mut name = String::new();
        let (meta, element) = self.locate_into(index, &mut name)?;
        Some((name, meta, element))
    }

    /// A fault about the variable selected by `get`: its name, value and unit in `whole`, and the `allowed` values.
    pub fn fault<T>(&self, whole: &W, get: impl FnOnce(&mut W) -> &mut T, allowed: impl Display) -> Fault
    where
        W: Clone,
    {
        Fault::new(format!("{} is not allowed: {allowed}", self.tell(whole, get)))
    }

    /// Name, value and unit of the variable selected by `get` in `whole`, for messages.
    pub fn tell<T>(&self, whole: &W, get: impl FnOnce(&mut W) -> &mut T) -> String
    where
        W: Clone,
    {
        let mut whole = whole.clone();
        let wanted = ptr::from_mut(get(&mut whole)).addr();
        let found = self.indices().find(|&index| {
            let address = self.entry(&mut whole, index).and_then(|(_, slot)| match slot {
                Slot::Real(x) => Some(ptr::from_ref(x).addr()),
                Slot::Float32(x) => Some(ptr::from_ref(x).addr()),
                Slot::Integer(x) => Some(ptr::from_ref(x).addr()),
                Slot::Boolean(x) => Some(ptr::from_ref(x).addr()),
                Slot::Enumeration(x) => Some(ptr::from_ref(x).addr()),
                Slot::Text(x) => Some(ptr::from_ref(x).addr()),
                Slot::Clock(x) => x.map(|x| ptr::from_ref(x).addr()),
                Slot::Binary(x) => Some(ptr::from_ref(x).addr()),
                Slot::Said(_) | Slot::Constant(_) => None,
            });
            address == Some(wanted)
        });
        found
            .and_then(|index| self.tell_index(&mut whole, index))
            .unwrap_or_else(|| "a value without a variable".into())
    }

    /// Name, value and unit of the variable `name` in `whole`: for messages.
    pub fn tell_name(&self, whole: &W, name: &str) -> Option<String>
    where
        W: Clone,
    {
        let index = self.indices().find(|&index| self.locate(index).is_some_and(|(found, ..)| found == name))?;
        self.tell_index(&mut whole.clone(), index)
    }

    pub(crate) fn tell_index(&self, whole: &mut W, index: usize) -> Option<String> {
        let (meta, slot) = self.entry(whole, index)?;
        let value = match &slot {
            Slot::Enumeration(x) => item(meta, x.get()),
            Slot::Constant(Constant::Enumeration(x)) => item(meta, *x),
            other => other.to_string(),
        };
        let unit = if let Kind::Real(of) | Kind::Float32(of) = meta.kind { of.unit.name } else { "" };
        let space = if unit.is_empty() { "" } else { " " };
        Some(format!("{} = {value}{space}{unit}", self.locate(index)?.0))
    }

    fn locate_into(&self, index: usize, name: &mut String) -> Option<(&'static Meta, usize)> {
        let (row, inner) = self.row_of(index)?;
        name.push_str(row.meta.name);
        match &row.access {
            Access::Part { node, .. } => node.locate(inner, name),
            _ => Some((&row.meta, inner)),
        }
    }
}

impl<W> Access<W> {
    /// Whether [`find_rare`] finds the value.
    const fn is_rare(&self) -> bool {
        !matches!(
            self,
            Self::Real(_)
                | Self::Reals(_)
                | Self::Integer(_)
                | Self::Boolean(_)
                | Self::Enumeration(_)
                | Self::Text(_)
                | Self::Said(_)
                | Self::Part { .. }
        )
    }
}

fn find_rare<'a, W: 'static>(row: &'static Row<W>, whole: &'a mut W, inner: usize) -> Option<Slot<'a>> {
    Some(match &row.access {
        Access::Float32(get) => Slot::Float32(get(whole)),
        Access::List(items) => items.find(whole, inner)?,
        Access::Clock(interval) => Slot::Clock(interval.map(|get| get(whole))),
        Access::Binary(get) => Slot::Binary(get(whole)),
        Access::ConstantText(text) => Slot::Said(text),
        Access::Computed(compute) => Slot::Constant(Constant::Real(compute(whole))),
        Access::Constant(x) => Slot::Constant(*x),
        Access::Constants(all) => Slot::Constant(Constant::Real(*all.get(inner)?)),
        _ => return None,
    })
}

#[cfg(test)]
mod tests;
