//! The variable table of a type, composed of variables and of other types' tables.
//!
//! A variable's index is its running offset: a scalar takes one, an array one per element, a part as many as its table. A wide
//! array, of more than [`DENSE`] elements, has separate indices, from [`WIDE`] on, and is found by a scan. Everything that does
//! not need a value is checked at compile time: names, ranges, the number of variables.

use crate::clock::Ticks;
use crate::fault::Fault;
use crate::kinds::Kinds;
use crate::reals::RealInputs;
use crate::row::{Access, Constant, Node, Row, SizedNode, Slot};
use crate::rules::{demand, same_text};
use crate::sizes::{Sizes, check_sized};
use crate::token::Hash;
use crate::variable::{Causality, Kind, Meta, Variability};
use std::fmt::Display;
use std::mem::MaybeUninit;
use std::ptr;

/// Maximum number of variables in a table, including those of its parts, without wide arrays.
pub const CAPACITY: usize = 512;

/// Maximum number of elements of an array that is not wide.
pub const DENSE: usize = 128;

/// Index of the first element of the first wide array.
pub const WIDE: usize = 1 << 30;

/// Maximum number of wide arrays in a table, and of parts that have some.
const WIDE_ROWS: usize = 16;

/// The table of `P` seen through `W`, of which `P` is a part.
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
        &$crate::Table::new(const { &[$($row),*] })
    };
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
    pub(crate) inner: u16,
}

/// A wide array, or a part that has some: its row, and the elements before it.
#[derive(Clone, Copy)]
struct WidePlace {
    row: u16,
    first: usize,
    len: usize,
}

/// Finds a value of a rare kind.
type Rare<W> = for<'a> fn(&'static Row<W>, &'a mut W, usize) -> Option<Slot<'a>>;

/// Finds an element of a wide array.
type Beyond<W> = for<'a> fn(&Table<W>, &'a mut W, usize) -> Option<(&'static Meta, Slot<'a>)>;

/// All variables of `W`; [`table!`](crate::table!) makes one from its rows.
pub struct Table<W: 'static> {
    pub(crate) rows: &'static [Row<W>],
    pub(crate) places: [RowPlace; CAPACITY],
    len: usize,
    wide_places: [WidePlace; WIDE_ROWS],
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
}

impl<W: 'static> Table<W> {
    /// Builds the table.
    ///
    /// # Panics
    /// At compile time, on a duplicate name, an array without an element, more than [`CAPACITY`] variables, or too many wide arrays.
    #[expect(clippy::cast_possible_truncation, reason = "CAPACITY fits in 16 bits, asserted below")]
    pub const fn new(rows: &'static [Row<W>]) -> Self {
        assert!(CAPACITY <= u16::MAX as usize);
        // No row past the end.
        let mut places = [RowPlace { row: u16::MAX, inner: 0 }; CAPACITY];
        let (mut len, mut row, mut hash, mut kinds, mut intermediate) = (0, 0, Hash::START, Kinds::NONE, false);
        let (mut sizes, mut has_rare) = (Sizes::NONE, false);
        let (mut wide_places, mut wide, mut wide_rows) = ([WidePlace { row: 0, first: 0, len: 0 }; WIDE_ROWS], 0, 0);
        while row < rows.len() {
            let meta = &rows[row].meta;
            intermediate |= meta.intermediate;
            has_rare |= rows[row].access.is_rare();
            let (count, beyond) = match (&rows[row].access, meta.dimension) {
                (Access::Part { len, wide, hash: of_part, kinds: of_kinds, sizes: of_sizes, .. }, _) => {
                    kinds = kinds.and(*of_kinds);
                    sizes = sizes.and(*of_sizes);
                    hash = hash.text(meta.name).join(of_part);
                    if !meta.clocks.is_empty() {
                        hash = hash.text("on").text(meta.clocks);
                    }
                    (*len, *wide)
                }
                (_, dimension) => {
                    check(meta);
                    check_sized(rows, row);
                    sizes = sizes.and(Sizes::of(meta));
                    kinds = kinds.and(Kinds::of(&meta.kind));
                    hash = hash.meta(meta);
                    match dimension {
                        Some(n) if n > DENSE => (0, n),
                        Some(n) => (n, 0),
                        None => (1, 0),
                    }
                }
            };
            let mut inner = 0;
            while inner < count {
                assert!(len < CAPACITY, "the table holds more variables than CAPACITY");
                places[len] = RowPlace { row: row as u16, inner: inner as u16 };
                len += 1;
                inner += 1;
            }
            if beyond > 0 {
                demand(wide_rows < WIDE_ROWS, meta.name, "the table has too many arrays of more than 128 elements");
                wide_places[wide_rows] = WidePlace { row: row as u16, first: wide, len: beyond };
                (wide, wide_rows) = (wide + beyond, wide_rows + 1);
            }
            check_unique(rows, row);
            row += 1;
        }
        let rare: Option<Rare<W>> = if has_rare { Some(find_rare) } else { None };
        let beyond: Option<Beyond<W>> = if wide > 0 { Some(Self::wide_entry) } else { None };
        Self { rows, places, len, wide_places, wide, hash, kinds, intermediate, sizes, rare, beyond }
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

    /// Every index: those below [`len`](Self::len), then those of wide arrays from [`WIDE`] on.
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
        let place = self.places[index];
        let row = &self.rows[usize::from(place.row)];
        let slot = match &row.access {
            Access::Real(get) => Slot::Real(get(whole)),
            Access::Reals(get) => Slot::Real(get(whole).get_mut(usize::from(place.inner))?),
            Access::Integer(get) => Slot::Integer(get.find(whole)),
            Access::Boolean(get) => Slot::Boolean(get(whole)),
            Access::Enumeration(field) => Slot::Enumeration(field.find(whole)),
            Access::Text(get) => Slot::Text(get(whole)),
            Access::Said(say) => Slot::Said(say(whole)),
            Access::Part { node, .. } => return node.entry(whole, usize::from(place.inner)),
            _ => (self.rare?)(row, whole, usize::from(place.inner))?,
        };
        Some((&row.meta, slot))
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
        let at = index.checked_sub(WIDE).filter(|at| *at < self.wide)?;
        let place = self.wide_places.iter().find(|place| (place.first..place.first + place.len).contains(&at))?;
        Some((&self.rows[usize::from(place.row)], at - place.first))
    }

    /// The row of a variable, and the index in it; for wide arrays of a part it counts from [`WIDE`].
    pub(crate) fn row_of(&self, index: usize) -> Option<(&'static Row<W>, usize)> {
        if let Some(place) = self.places[..self.len].get(index) {
            return Some((&self.rows[usize::from(place.row)], usize::from(place.inner)));
        }
        let (row, inner) = self.wide_place(index)?;
        Some((row, if matches!(row.access, Access::Part { .. }) { WIDE + inner } else { inner }))
    }

    /// Which element of an array variable `index` is, 0 for a scalar; `None` past the end. Does not allocate.
    pub fn element(&self, index: usize) -> Option<usize> {
        let (row, inner) = self.row_of(index)?;
        if let Access::Part { node, .. } = &row.access { node.element(inner) } else { Some(inner) }
    }

    /// Names of the clocks of variable `index`, separated by spaces; empty for none. If a part is on a clock, all its variables
    /// except parameters are.
    pub fn clocks_of(&self, index: usize) -> &'static str {
        let Some(place) = self.places[..self.len].get(index) else { return "" };
        let row = &self.rows[usize::from(place.row)];
        match &row.access {
            Access::Part { node, .. } => {
                let inner = node.clocks_of(usize::from(place.inner));
                let changes = || {
                    let found = node.locate(usize::from(place.inner), &mut String::new());
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

    /// A fault of the variable that `get` finds: its name, value and unit in `whole`, and what is `allowed`.
    pub fn fault<T>(&self, whole: &W, get: impl FnOnce(&mut W) -> &mut T, allowed: impl Display) -> Fault
    where
        W: Clone,
    {
        Fault::new(format!("{} is not allowed: {allowed}", self.tell(whole, get)))
    }

    /// Name, value and unit of the variable that `get` finds in `whole`: for messages.
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

const fn check(meta: &Meta) {
    demand(!meta.name.is_empty(), meta.description, "a variable needs a name");
    demand(!matches!(meta.dimension, Some(0)), meta.name, "an array needs an element");
}

/// Checks that the name of row `last` differs from all before it.
const fn check_unique<W>(rows: &[Row<W>], last: usize) {
    let mut row = 0;
    while row < last {
        // A part without a prefix has no name; its variables are checked by the description.
        let same = !rows[row].meta.name.is_empty() && same_text(rows[row].meta.name, rows[last].meta.name);
        demand(!same, rows[last].meta.name, "two rows of the table have this name");
        row += 1;
    }
}
