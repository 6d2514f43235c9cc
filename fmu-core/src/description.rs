//! The neutral description of a model, from which the XML, documentation and tools are generated.

mod checks;
mod clocks;
mod sizes;
mod terminals;

pub use terminals::{MemberDescription, TerminalDescription, TerminalPicture};

use crate::Fault;
use crate::capability::{Capabilities, Exported};
use crate::clock::Timing;
use crate::integer::IntegerType;
use crate::model::{Block, Experiment, Model};
use crate::need::Need;
use crate::probe;
use crate::row::{Constant, Row, Slot};
use crate::saved::{Keeps, Stored};
use crate::unit::{Exponents, ONE, Quantity};
use crate::variable::{Alias, Causality, Enumeration, Kind, Meta, Range, Variability};
use checks::{check_names, check_start, check_types};
use clocks::put_on_clocks;
use serde::{Deserialize, Serialize};
use sizes::{check_sizes, exchange, size};

/// Value reference of the independent variable `time`, which archives of FMI 3.0 have; the table's variable `i` has value reference `i + 1`.
pub const TIME: u32 = 0;

/// Everything that an importer can learn about a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Model identifier, and the name that users see unless there is a title.
    pub name: String,
    /// Display name, for example of a preset.
    pub title: Option<String>,
    /// One sentence.
    pub description: String,
    /// Version of the model.
    pub version: String,
    /// Who wrote it.
    pub author: String,
    /// License, an SPDX expression.
    pub license: String,
    /// Copyright line.
    pub copyright: String,
    /// Instantiation token (GUID in FMI 2.0).
    pub token: String,
    /// Recommended experiment.
    pub experiment: Experiment,
    /// The model's log categories: names and descriptions.
    #[serde(default)]
    pub categories: Vec<(String, String)>,
    /// Body of the documentation page, an HTML fragment.
    pub documentation: String,
    /// The variables in the order of their value references, without `time`.
    pub variables: Vec<Variable>,
    /// Groups of variables that are connected together.
    pub terminals: Vec<TerminalDescription>,
    /// Icon: an SVG document.
    pub icon: Option<String>,
    /// Capabilities of the model beyond co-simulation without events, if any.
    pub model_exchange: Option<ModelExchange>,
    /// What an importer can keep of the state.
    #[serde(default)]
    pub keeps: Keeps,
}

/// The interface for Model Exchange.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "properties that do not depend on each other")]
pub struct ModelExchange {
    /// Value references of the states.
    pub states: Vec<u32>,
    /// Value references of their derivatives, in the same order.
    pub derivatives: Vec<u32>,
    /// Value references of the event indicators; variables in FMI 3.0 only.
    pub indicators: Vec<u32>,
    /// Co-simulation with Event Mode and early return (FMI 3.0).
    pub event_mode: bool,
    /// The importer must call `CompletedIntegratorStep`.
    pub completed_steps: bool,
    /// Scheduled Execution (FMI 3.0).
    pub scheduled: bool,
    /// There is no Co-Simulation.
    #[serde(default)]
    pub only: bool,
}

/// A variable of the description.
#[expect(clippy::struct_excessive_bools, reason = "properties that do not depend on each other")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Variable {
    /// Full name.
    pub name: String,
    /// One sentence.
    pub description: String,
    /// Value reference; an array also owns the references of its further elements.
    pub value_reference: u32,
    /// Who sets it.
    pub causality: Causality,
    /// When it changes.
    pub variability: Variability,
    /// Base type, with the type definition that belongs to it.
    pub kind: VariableKind,
    /// Lower bound.
    pub min: Option<f64>,
    /// Upper bound.
    pub max: Option<f64>,
    /// The lower bound itself is excluded.
    pub above: bool,
    /// The upper bound itself is excluded.
    pub below: bool,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// The value is unbounded.
    pub unbounded: bool,
    /// Other names (FMI 3.0).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub aliases: Vec<AliasDescription>,
    /// Extents of an array at the start, whose elements are stored row by row; empty for a scalar.
    pub shape: Vec<usize>,
    /// Value references of the structural parameters that are its extents; empty for an array of one size.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sized: Vec<u32>,
    /// The importer may set the start value of this output or local variable.
    #[serde(default)]
    pub exact: bool,
    /// Start values (one, or one per element) of variables that the importer may set and of constants; `None` for calculated ones.
    pub start: Option<Vec<Value>>,
    /// Value references that the initial value depends on; `None` for variables that are not initial unknowns.
    pub initial_dependencies: Option<Vec<u32>>,
    /// Value references that the value depends on between two events: of outputs and derivatives.
    pub dependencies: Option<Vec<u32>>,
    /// Value reference of the state whose derivative this is.
    pub derivative: Option<u32>,
    /// A state that an event may change.
    pub reinit: bool,
    /// Value references of its clocks.
    pub clocks: Vec<u32>,
    /// It can be read or set inside a communication step (FMI 3.0).
    pub intermediate: bool,
}

/// Another name of a variable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AliasDescription {
    /// Full name.
    pub name: String,
    /// One sentence.
    pub description: String,
    /// Display unit: name, factor and offset.
    pub display: Option<(String, f64, f64)>,
}

/// A base type with its type definition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum VariableKind {
    /// A real number.
    Real {
        /// Name of the type definition.
        quantity: String,
        /// Unit name, empty for a number without a unit.
        unit: String,
        /// SI base exponents of the unit.
        exponents: Exponents,
        /// Factor of the unit to SI.
        factor: f64,
        /// Display unit: name, factor and offset.
        display: Option<(String, f64, f64)>,
        /// The value is a difference: the offset of the display unit does not apply.
        relative: bool,
        /// The variable is in single precision.
        single: bool,
    },
    /// An integer.
    Integer(IntegerType),
    /// A truth value.
    Boolean,
    /// A named value.
    Enumeration {
        /// Name of the type definition.
        name: String,
        /// Description of the type.
        description: String,
        /// Value, name and description of each item.
        items: Vec<(i32, String, String)>,
    },
    /// A text.
    Text,
    /// A clock; its start value is the interval in s, if the importer may set it.
    Clock(Timing),
    /// Bytes.
    Binary {
        /// MIME type of the content.
        mime_type: String,
        /// Maximum number of bytes.
        most: usize,
    },
}

/// A start value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum Value {
    /// Start value of a real variable.
    Real(f64),
    /// Start value of an integer or an enumeration.
    Integer(i128),
    /// Start value of a Boolean.
    Boolean(bool),
    /// Start value of a text.
    Text(String),
    /// Start value of bytes.
    Binary(Vec<u8>),
}

/// Whether a description has the dependencies of its variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dependencies {
    /// Found by running the model, which takes seconds if it is large.
    Probed,
    /// No variable has any: for a caller that knows them from the archive.
    Omitted,
}

impl Dependencies {
    /// Those of initial values, and those between two events.
    fn of<M: Model>(self, can: &Capabilities<M>, block: &Block<M>, states: &[usize]) -> [probe::Dependencies; 2] {
        match self {
            Self::Omitted => probe::no_dependencies::<M>(states),
            Self::Probed => probe::dependencies(can, block, states),
        }
    }
}

impl Description {
    /// Describes model `M` for co-simulation only: see [`exported`](Self::exported).
    ///
    /// # Errors
    /// As [`exported`](Self::exported).
    pub fn of<M: Stored>() -> Result<Self, Fault> {
        Self::probed(&Capabilities::<M>::NONE, fresh()?, Dependencies::Probed)
    }

    /// Describes the variables of a model: without dependencies, capabilities and derivatives. Nothing is run but `initialize`.
    ///
    /// # Errors
    /// As [`exported`](Self::exported).
    pub fn variables<M: Model>() -> Result<Self, Fault> {
        Self::with(&Capabilities::<M>::unsaved(), fresh()?, &[], probe::no_dependencies::<M>(&[]))
    }

    /// Describes a model as it is exported; start values come from its `Default`, dependencies from probing it.
    ///
    /// # Errors
    /// Reports problems that no compile-time check can find: a name shared by two parts, a start value outside its
    /// range, a type definition named like a variable, a terminal with missing variables, a state without a row.
    pub fn exported<E: Exported>() -> Result<Self, Fault> {
        Self::instantiated::<E>(fresh()?, Dependencies::Probed)
    }

    /// The description as JSON.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn json(&self) -> Result<String, Fault> {
        serde_json::to_string(self).map_err(|e| Fault::new(e.to_string()))
    }

    /// Describes an instance like [`exported`](Self::exported), with the start values and resources of `block`.
    ///
    /// # Errors
    /// As [`exported`](Self::exported).
    pub fn instantiated<E: Exported>(block: Block<E::Model>, dependencies: Dependencies) -> Result<Self, Fault> {
        Self::probed(&E::CAN, block, dependencies)
    }

    fn probed<M: Model>(can: &Capabilities<M>, block: Block<M>, dependencies: Dependencies) -> Result<Self, Fault> {
        let states = can.rows()?;
        check_sizes(can, &block)?;
        probe::keeps_starts(can, &block, &states)?;
        let dependencies = dependencies.of(can, &block, &states);
        Self::with(can, block, &states, dependencies)
    }

    fn with<M: Model>(
        can: &Capabilities<M>,
        mut block: Block<M>,
        states: &[usize],
        [initial, between]: [probe::Dependencies; 2],
    ) -> Result<Self, Fault> {
        block.initialize();
        let reference = |index: usize| if index == probe::NOW { TIME } else { can.reference(index) };
        let references = |of: &Option<Vec<usize>>| of.as_ref().map(|d| d.iter().map(|&i| reference(i)).collect());
        let (table, wide) = (M::TABLE, probe::wide::<M>().arrays);
        let mut variables: Vec<Variable> = Vec::new();
        let mut needs: Vec<(usize, Need<'static>)> = Vec::new();
        for index in 0..table.len() {
            let Some((name, meta, element)) = table.locate(index) else { continue };
            let Some((_, slot)) = table.entry(&mut block, index) else { continue };
            let start = (meta.has_start() && !matches!(slot, Slot::Clock(None))).then(|| value(&slot));
            if start.is_some() {
                check_start(&name, meta, &slot)?;
            }
            if element > 0 {
                let Some(array) = variables.last_mut() else { continue };
                if let (Some(all), Some(start)) = (&mut array.start, start) {
                    all.push(start);
                }
                join(&mut array.initial_dependencies, references(&initial[index]));
                join(&mut array.dependencies, references(&between[index]));
                continue;
            }
            if meta.need != Need::Always {
                needs.push((variables.len(), meta.need));
            }
            let state = states.iter().position(|&row| row == index).and_then(|number| can.state_of(number));
            variables.push(Variable {
                initial_dependencies: references(&initial[index]),
                dependencies: references(&between[index]),
                reinit: state.is_some_and(|(state, _)| state.reinit),
                ..variable(name, meta, reference(index), start)
            });
        }
        let mut number = 0;
        for state in can.states() {
            let (index, place) = (table.len() + number, table.len() + wide.len() + number);
            let (name, of) = (format!("der({})", state.name), format!("Derivative of {}", state.name));
            let meta = *V::state("", state.rate, "", |m| m).meta();
            let mut derivative = Variable {
                description: of,
                initial_dependencies: references(&initial[place]),
                dependencies: references(&between[place]),
                derivative: Some(reference(states[number])),
                ..variable(name, &meta, reference(index), None)
            };
            for place in place + 1..place + state.most() {
                join(&mut derivative.initial_dependencies, references(&initial[place]));
                join(&mut derivative.dependencies, references(&between[place]));
            }
            variables.push(derivative);
            number += state.most();
        }
        for (i, indicator) in can.indicators().iter().enumerate() {
            let meta = *V::state("", &ONE, indicator.description, |m| m).meta();
            let index = table.len() + number + i;
            variables.push(variable(indicator.name.into(), &meta, reference(index), None));
        }
        // In the order of the value references.
        for (place, &extent) in (table.len()..).zip(&wide) {
            let array = wide_array::<M>(can, &mut block, extent)?;
            let state = states.iter().position(|&row| row == extent.0).and_then(|number| can.state_of(number));
            variables.push(Variable {
                initial_dependencies: references(&initial[place]),
                dependencies: references(&between[place]),
                reinit: state.is_some_and(|(state, _)| state.reinit),
                ..array
            });
        }
        size(can, &mut variables)?;
        check_names(M::INFO.name, &variables)?;
        check_types(&variables)?;
        put_on_clocks::<M>(&mut variables, can.clocked.as_ref().is_some_and(|clocked| clocked.feedthrough))?;
        for (i, need) in needs {
            let words = words(&variables[i].name, need, &variables)?;
            variables[i].description += &words;
        }
        variables.iter_mut().for_each(in_place_of_another::<M>);
        let terminals = terminals::describe(M::TERMINALS, &variables)?;
        let info = M::INFO;
        Ok(Self {
            name: info.name.into(),
            title: None,
            description: info.description.into(),
            version: info.version.into(),
            author: info.author.into(),
            license: info.license.into(),
            copyright: info.copyright.into(),
            token: can.hash().guid().as_str().into(),
            experiment: info.experiment,
            categories: info.categories.iter().map(|&(name, about)| (name.into(), about.into())).collect(),
            documentation: info.documentation.into(),
            variables,
            terminals,
            icon: M::ICON.map(Into::into),
            model_exchange: exchange(can, states),
            keeps: can.keeps(),
        })
    }

    /// The name that users see.
    pub fn model_name(&self) -> &str {
        self.title.as_deref().unwrap_or(&self.name)
    }

    /// The reason why an archive of FMI 2.0 is impossible, if it is.
    pub fn needs_fmi3(&self) -> Option<String> {
        let binary = |v: &&Variable| matches!(v.kind, VariableKind::Binary { .. });
        let of_bytes = self.variables.iter().find(binary);
        let clock = self.variables.iter().find(|v| matches!(v.kind, VariableKind::Clock(_)));
        let bytes = of_bytes.map(|v| format!("{} is binary, and FMI 2.0 has no bytes", v.name));
        bytes.or_else(|| clock.map(|v| format!("{} is a clock, and FMI 2.0 has no clocks", v.name)))
    }

    /// The variable of this name.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|v| v.name == name)
    }
}

/// A variable of a table that several models share, as seen by this model.
fn in_place_of_another<M: Model>(v: &mut Variable) {
    let real = matches!(v.kind, VariableKind::Real { .. });
    if M::CONTINUOUS && real && v.causality == Causality::Output && v.variability == Variability::Discrete {
        v.variability = Variability::Continuous;
    }
    if v.causality == Causality::Parameter && !M::has_effect(&v.name) {
        v.description += "; accepted, without effect in this model";
    }
}

impl Variable {
    /// Allowed values.
    pub fn range(&self) -> Range {
        let (min, max) = (self.min.unwrap_or(f64::NEG_INFINITY), self.max.unwrap_or(f64::INFINITY));
        Range { min, max, above: self.above, below: self.below }
    }

    /// Whether the importer sets it before the simulation starts.
    pub fn takes_start(&self) -> bool {
        self.causality.is_settable() || self.exact
    }

    /// Whether it has elements, each with a value reference in FMI 2.0.
    pub fn is_array(&self) -> bool {
        !self.shape.is_empty()
    }

    /// Number of its elements, 1 for a scalar.
    pub fn elements(&self) -> usize {
        self.shape.iter().product()
    }
}

/// A model without resources.
fn fresh<M: Model>() -> Result<Block<M>, Fault> {
    let mut block = Block::<M>::default();
    block.model.load(None)?;
    Ok(block)
}

/// An array has the dependencies of all its elements.
fn join(all: &mut Option<Vec<u32>>, more: Option<Vec<u32>>) {
    if let (Some(all), Some(more)) = (all, more) {
        all.extend(more);
        all.sort_unstable();
        all.dedup();
    }
}

fn variable(name: String, meta: &Meta, value_reference: u32, start: Option<Value>) -> Variable {
    let prefix = name.strip_suffix(meta.name).unwrap_or_default();
    let alias = |a: &Alias| AliasDescription {
        name: format!("{prefix}{}", a.name),
        description: a.description.into(),
        display: a.display.map(|d| (d.name.into(), d.factor, d.offset)),
    };
    let aliases = meta.aliases.iter().map(alias).collect();
    Variable {
        name,
        description: meta.description.into(),
        value_reference,
        causality: meta.causality,
        variability: meta.variability,
        kind: kind(&meta.kind),
        min: meta.range.min.is_finite().then_some(meta.range.min),
        max: meta.range.max.is_finite().then_some(meta.range.max),
        above: meta.range.above,
        below: meta.range.below,
        nominal: meta.nominal,
        unbounded: meta.unbounded,
        aliases,
        shape: match (meta.shape, meta.dimension) {
            ([], n) => n.into_iter().collect(),
            (shape, _) => shape.to_vec(),
        },
        sized: Vec::new(),
        exact: meta.exact,
        start: start.map(|x| vec![x]),
        initial_dependencies: None,
        dependencies: None,
        derivative: None,
        reinit: false,
        clocks: Vec::new(),
        intermediate: meta.intermediate,
    }
}

/// The sentence stating when `input` is read, with the full name of the parameter: its name in the table, after the prefix of
/// a part.
fn words(input: &str, need: Need<'_>, variables: &[Variable]) -> Result<String, Fault> {
    let Need::With { parameter, value } = need else { return Ok(need.to_string()) };
    let named = |v: &&Variable| {
        let rest = v.name.strip_suffix(parameter);
        v.causality == Causality::Parameter && rest.is_some_and(|rest| rest.is_empty() || rest.ends_with('.'))
    };
    let found: Vec<&Variable> = variables.iter().filter(named).collect();
    let [found] = found[..] else {
        return Err(Fault::new(format!(
            "{input} is read with {parameter}: expected one parameter of this name, found {}",
            found.len()
        )));
    };
    let has = match &found.kind {
        VariableKind::Boolean => ["true", "false"].contains(&value),
        VariableKind::Enumeration { items, .. } => items.iter().any(|(_, name, _)| name == value),
        _ => false,
    };
    if !has {
        return Err(Fault::new(format!("{input} is read with {} = {value}, a value that it never has", found.name)));
    }
    Ok(Need::With { parameter: &found.name, value }.to_string())
}

/// Rows of variables that are not fields of a model: derivatives and indicators.
type V = Row<f64>;

fn value(slot: &Slot<'_>) -> Value {
    match slot {
        Slot::Real(x) => Value::Real(**x),
        Slot::Float32(x) => Value::Real((**x).into()),
        Slot::Integer(x) => Value::Integer(x.get()),
        Slot::Boolean(x) => Value::Boolean(**x),
        Slot::Enumeration(x) => Value::Integer(x.get().into()),
        Slot::Text(x) => Value::Text((*x).clone()),
        Slot::Said(x) => Value::Text((*x).into()),
        Slot::Clock(x) => Value::Real(x.as_ref().map_or(f64::NAN, |x| **x)),
        Slot::Constant(Constant::Real(x)) => Value::Real(*x),
        Slot::Constant(Constant::Float32(x)) => Value::Real((*x).into()),
        Slot::Constant(Constant::Integer(x)) => Value::Integer(*x),
        Slot::Constant(Constant::Boolean(x)) => Value::Boolean(*x),
        Slot::Constant(Constant::Enumeration(x)) => Value::Integer((*x).into()),
        Slot::Binary(x) => Value::Binary(x.to_vec()),
    }
}

fn kind(kind: &Kind) -> VariableKind {
    match kind {
        Kind::Real(Quantity { name, unit, display, relative })
        | Kind::Float32(Quantity { name, unit, display, relative }) => VariableKind::Real {
            quantity: (*name).into(),
            unit: unit.name.into(),
            exponents: unit.exponents,
            factor: unit.factor,
            display: display.map(|d| (d.name.into(), d.factor, d.offset)),
            relative: *relative,
            single: matches!(kind, Kind::Float32(_)),
        },
        Kind::Integer(of) => VariableKind::Integer(*of),
        Kind::Boolean => VariableKind::Boolean,
        Kind::Text => VariableKind::Text,
        Kind::Clock(timing) => VariableKind::Clock(*timing),
        Kind::Binary { mime_type, most } => VariableKind::Binary { mime_type: (*mime_type).into(), most: *most },
        Kind::Enumeration(Enumeration { name, description, items }) => VariableKind::Enumeration {
            name: (*name).into(),
            description: (*description).into(),
            items: items.iter().map(|i| (i.value, i.name.into(), i.description.into())).collect(),
        },
    }
}

/// A wide array, by its first index and its number of elements.
fn wide_array<M: Model>(
    can: &Capabilities<M>,
    block: &mut Block<M>,
    (first, n): (usize, usize),
) -> Result<Variable, Fault> {
    let located = M::TABLE.locate(first);
    let (name, meta, _) = located.ok_or_else(|| Fault::new(format!("no array at {first}")))?;
    let mut array = variable(name.clone(), meta, can.reference(first), None);
    if meta.has_start() {
        for index in first..first + n {
            let Some((_, slot)) = M::TABLE.entry(block, index) else { continue };
            check_start(&name, meta, &slot)?;
            array.start.get_or_insert_default().push(value(&slot));
        }
    }
    Ok(array)
}
