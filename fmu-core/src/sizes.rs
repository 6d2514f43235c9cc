//! Arrays whose sizes the importer chooses: structural parameters (FMI 3.0.2, 2.3.6, 2.3.7 and 2.4.7.4).
//!
//! A [structural parameter](crate::Row::structural) is a size that rows of the table [name](crate::Row::sized). The number of
//! elements of an array is the length of the model's array, so lengths change only when [`Resizable::resize`] runs, when the
//! importer leaves Configuration Mode.

use crate::capability::Capabilities;
use crate::continuous::State;
use crate::fault::Fault;
use crate::model::Model;
use crate::names::Names;
use crate::refusal::demand;
use crate::row::{Access, Row, Slot};
use crate::table::Table;
use crate::variable::{Causality, Meta};

/// A model with structural parameters.
///
/// ```
/// # use fmu_core::unit::VOLT;
/// # use fmu_core::{Block, Elapsed, Fault, Info, Model, Resizable, Row, Step, Table, table};
/// # use serde::{Deserialize, Serialize};
/// #[derive(Clone, Serialize, Deserialize)]
/// struct Buffer { n: u64, x: Vec<f64> }
/// # impl Default for Buffer { fn default() -> Self { Self { n: 3, x: vec![0.0; 3] } } }
/// # type V = Row<Block<Buffer>>;
///
/// impl Model for Buffer {
///     # type Outputs = ();
///     # const INFO: Info = Info { name: "Buffer", ..Info::DEFAULT };
///     # fn initialize(&mut self) {}
///     # fn output(&self, _: Elapsed, (): &mut ()) {}
///     # fn advance(&mut self, _: &Step) -> Result<(), Fault> { Ok(()) }
///     const TABLE: &'static Table<Block<Self>> = table![
///         V::structural("n", "Number of values", |m| &mut m.model.n).at_most(5.0).tunable(),
///         V::array_input("x", &VOLT, "Values", 5, |m| &mut m.model.x).sized(&["n"]),
///     ];
///     // ...
/// }
///
/// impl Resizable for Buffer {
///     fn resize(&mut self) -> Result<(), Fault> {
///         self.x = vec![0.0; usize::try_from(self.n).unwrap_or(0)];
///         Ok(())
///     }
/// }
/// # let mut buffer = Block { model: Buffer { n: 4, ..Buffer::default() }, out: () };
/// # assert!(Buffer::TABLE.check_sizes(&mut buffer).is_err());
/// # buffer.model.resize()?;
/// # Buffer::TABLE.check_sizes(&mut buffer)?;
/// # assert_eq!(Buffer::TABLE.extent(&mut buffer, 1).map(|(_, n)| n), Some(4));
/// # Ok::<(), Fault>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no structural parameters: it lacks the capability `Resizable`",
    note = "write `impl Resizable for {Self}`, or remove `Resizable` from the line that exports the model"
)]
pub trait Resizable: Model {
    /// Gives every array whose sizes have changed its new length, and fills it: old values and start values are not kept.
    /// Arrays of the outputs follow in [`Model::output`]. A size never exceeds its bound, and may be 0 if the range includes 0.
    /// Once the simulation runs, only tunable structural parameters change.
    ///
    /// # Errors
    /// The combination of sizes is impossible; the model is unchanged.
    fn resize(&mut self) -> Result<(), Fault>;
}

/// Summary of the structural parameters of a table.
#[derive(Clone, Copy)]
pub(crate) struct Sizes {
    /// The table has one.
    pub(crate) any: bool,
    /// One can be set while the simulation runs.
    pub(crate) tunable: bool,
}

impl Sizes {
    pub(crate) const NONE: Self = Self { any: false, tunable: false };

    pub(crate) const fn and(self, other: Self) -> Self {
        Self { any: self.any || other.any, tunable: self.tunable || other.tunable }
    }

    pub(crate) const fn of(meta: &Meta) -> Self {
        let any = matches!(meta.causality, Causality::StructuralParameter);
        Self { any, tunable: any && matches!(meta.variability, crate::Variability::Tunable) }
    }
}

/// Checks that the number of elements of a row is the product of the maximum sizes that it names.
#[track_caller]
pub(crate) const fn check_sized<W>(rows: &[Row<W>], row: usize, names: &Names) {
    let meta = &rows[row].meta;
    let structural = matches!(meta.causality, Causality::StructuralParameter);
    let bounded = meta.range.max < f64::INFINITY && meta.range.max >= 1.0;
    demand(!structural || bounded, meta.name, "a structural parameter needs an upper bound: at_most");
    if meta.sized.is_empty() {
        return;
    }
    let (mut product, mut i) = (1, 0);
    while i < meta.sized.len() {
        let size = match names.find(meta.sized[i]) {
            Some(other) if matches!(rows[other].meta.causality, Causality::StructuralParameter) => {
                greatest(&rows[other].meta)
            }
            _ => 0,
        };
        demand(size > 0, meta.name, "the table has no structural parameter of the name that sizes it");
        product *= size;
        i += 1;
    }
    let fits = matches!(meta.dimension, Some(n) if n == product);
    demand(fits, meta.name, "the product of the maximum sizes is not the number of elements");
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a bound of a size")]
const fn greatest(meta: &Meta) -> usize {
    meta.range.max as usize
}

impl<W: 'static> Table<W> {
    /// Whether a variable is a structural parameter.
    pub const fn has_sizes(&self) -> bool {
        self.sizes.any
    }

    /// Whether a structural parameter can be set while the simulation runs.
    pub const fn has_tunable_sizes(&self) -> bool {
        self.sizes.tunable
    }

    /// The variable `index` and its present number of elements: 1 for a scalar; `None` past the end. Does not allocate.
    pub fn extent(&self, whole: &mut W, index: usize) -> Option<(&'static Meta, usize)> {
        let (row, inner) = self.row_of(index)?;
        Some(match &row.access {
            Access::Part { sized: Some(node), .. } => return node.extent(whole, inner),
            Access::Part { node, .. } => {
                let (meta, _) = node.entry(whole, inner)?;
                (meta, meta.dimension.unwrap_or(1))
            }
            _ if row.meta.sized.is_empty() => (&row.meta, row.meta.dimension.unwrap_or(1)),
            _ => (&row.meta, row.len(whole)),
        })
    }

    /// Present extents of the array that contains variable `index`; empty for a scalar, and for an array with one constant
    /// extent.
    pub fn extents(&self, whole: &mut W, index: usize) -> Vec<usize> {
        match self.row_of(index) {
            Some((Row { access: Access::Part { sized: Some(node), .. }, .. }, inner)) => node.extents(whole, inner),
            Some((Row { access: Access::Part { node, .. }, .. }, inner)) => {
                node.entry(whole, inner).map(|(meta, _)| meta.shape.to_vec()).unwrap_or_default()
            }
            Some((row, _)) if row.meta.sized.is_empty() => row.meta.shape.to_vec(),
            Some((row, _)) => row.meta.sized.iter().map(|name| self.size(whole, name)).collect(),
            None => Vec::new(),
        }
    }

    /// Checks that every array has the length given by its sizes.
    ///
    /// # Errors
    /// Names the first array with another length.
    pub fn check_sizes(&self, whole: &mut W) -> Result<(), Fault> {
        if !self.sizes.any {
            return Ok(());
        }
        for row in self.rows {
            if let Access::Part { sized: Some(node), .. } = &row.access {
                node.check_sizes(whole)?;
            }
            if row.meta.sized.is_empty() {
                continue;
            }
            let product: usize = row.meta.sized.iter().map(|name| self.size(whole, name)).product();
            let n = row.len(whole);
            if n != product {
                let sizes = row.meta.sized.join(" x ");
                return Err(Fault::new(format!("{} has {n} elements, and {sizes} is {product}", row.meta.name)));
            }
        }
        Ok(())
    }

    /// The structural parameter of this name.
    fn size(&self, whole: &mut W, name: &str) -> usize {
        let named = |&i: &usize| self.row_of(i).is_some_and(|(row, _)| row.meta.name == name);
        match (0..self.len()).find(named).and_then(|i| self.entry(whole, i)) {
            Some((_, Slot::Integer(x))) => usize::try_from(x.get()).unwrap_or(usize::MAX),
            _ => 0,
        }
    }
}

impl<W> Row<W> {
    /// Number of elements of an array in the model.
    fn len(&self, whole: &mut W) -> usize {
        match &self.access {
            Access::Reals(get) => get(whole).len(),
            Access::List(items) => items.count(whole),
            _ => 1,
        }
    }
}

/// Arrays of states: each scalar state has a number, counted with the maximum sizes, and its derivative has the same.
impl<M: Model> Capabilities<M> {
    /// Maximum number of scalar states.
    pub const fn scalars(&self) -> usize {
        let (mut sum, mut i) = (0, 0);
        while i < self.states().len() {
            sum += self.states()[i].most();
            i += 1;
        }
        sum
    }

    /// Whether a state is an array.
    pub const fn has_arrays(&self) -> bool {
        let mut i = 0;
        while i < self.states().len() {
            if self.states()[i].dimension().is_some() {
                return true;
            }
            i += 1;
        }
        false
    }

    /// Passes every present scalar state to `take`, with its number.
    #[inline]
    pub fn each_state(&self, model: &mut M, mut take: impl FnMut(usize, &mut f64)) {
        let mut first = 0;
        for state in self.states() {
            for (number, x) in (first..first + state.most()).zip(state.all(model)) {
                take(number, x);
            }
            first += state.most();
        }
    }

    /// Present number of scalar states.
    #[inline]
    pub fn count_states(&self, model: &mut M) -> usize {
        self.states().iter().map(|state| state.all(model).len().min(state.most())).sum()
    }

    /// The state that a number belongs to, and the number of its first element.
    pub fn state_of(&self, number: usize) -> Option<(&'static State<M>, usize)> {
        let mut first = 0;
        self.states().iter().find_map(|state| {
            let begin = first;
            first += state.most();
            (number < first).then_some((state, begin))
        })
    }

    /// A scalar state by its number, if it is present.
    pub fn scalar<'a>(&self, model: &'a mut M, number: usize) -> Option<&'a mut f64> {
        let (state, first) = self.state_of(number)?;
        state.all(model).get_mut(number - first)
    }

    /// Moves derivatives from the front of `dx`, as the model writes them, to the numbers of their states. Those of absent
    /// states are NaN.
    pub fn spread(&self, model: &mut M, dx: &mut [f64]) {
        if !self.has_arrays() {
            return;
        }
        let mut numbers = Vec::new();
        self.each_state(model, |number, _| numbers.push(number));
        for (place, &number) in numbers.iter().enumerate().rev() {
            dx.swap(place, number);
        }
        for number in (0..dx.len()).filter(|number| !numbers.contains(number)) {
            dx[number] = f64::NAN;
        }
    }
}
