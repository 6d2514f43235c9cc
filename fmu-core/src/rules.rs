//! Compile-time checks of a model. A panic during compilation is an error whose text names the row, the state or the model.

use crate::capability::Exported;
use crate::clock::word;
use crate::continuous::{ContinuousTime, scalars};
use crate::log;
use crate::model::{Experiment, Info, Model};
use crate::names::Names;
use crate::refusal::{demand, digits, fail, same_text, starts_with};
use crate::row::{Access, Row};
use crate::variable::{Causality, Kind, Meta, Variability};

/// Checks a model as it is exported: its name, and that its states have rows. The line that exports a model calls it.
///
/// # Panics
/// At compile time: the name is not a C identifier (`modelIdentifier` of FMI 2.0.5, 4.3.1; FMI 3.0.2, 2.2.2), or a state has no
/// continuous real row that is an output or a local variable. Describing the model checks the rows of parts.
#[track_caller]
pub const fn check<E: Exported>() {
    let model = E::Model::INFO.name;
    let rule =
        "INFO.name must be a C identifier, as modelIdentifier of FMI is: a letter or _, then letters, digits and _";
    demand(is_identifier(model), model, rule);
    check_info(&E::Model::INFO);
    let complete = E::CAN.to_event.is_none() || (E::CAN.continuous.is_some() && E::CAN.events.is_some());
    let exchanges = !E::CAN.exchange_only || (E::CAN.model_exchange() && E::CAN.to_event.is_none());
    demand(exchanges, model, "ModelExchangeOnly is for a model with states or events, and without EventMode");
    demand(complete, model, "EventMode is for a model that is exported with ContinuousTime and Events");
    let (rows, states, can) = (E::Model::TABLE.rows, E::CAN.states().len(), E::CAN);
    check_intermediate::<E>(model);
    check_clocks::<E>(model);
    check_resizable::<E>(model);
    check_saved::<E>(model);
    if states == 0 {
        return;
    }
    let (mut of_rows, mut of_states, mut i) = (Names::new(), Names::new(), 0);
    while i < rows.len() {
        of_rows.add(rows[i].meta.name, "two rows of the table have this name");
        i += 1;
    }
    i = 0;
    while i < states {
        let name = can.states()[i].name;
        of_states.add(name, "two states have this name");
        match of_rows.find(name) {
            Some(row) if !matches!(rows[row].access, Access::Part { .. }) => {
                check_state(&rows[row].meta, name, can.states()[i].dimension());
            }
            // The compiler cannot read the names of a part's rows.
            _ if is_in_part(rows, name) => {}
            _ => fail(&["STATES of ", model, ": no row of the table has the name ", name]),
        }
        i += 1;
    }
}

/// Whether a name begins with the prefix of a part.
const fn is_in_part<W>(rows: &[Row<W>], name: &str) -> bool {
    let mut row = 0;
    while row < rows.len() {
        if matches!(rows[row].access, Access::Part { .. }) && starts_with(name, rows[row].meta.name) {
            return true;
        }
        row += 1;
    }
    false
}

/// Checks the experiment and the log categories.
#[track_caller]
const fn check_info(info: &Info) {
    let Experiment { tolerance, fixed_step, .. } = info.experiment;
    demand(is_positive(tolerance), info.name, "the tolerance of the experiment must be greater than 0");
    demand(is_positive(fixed_step), info.name, "the fixed step of the experiment must be greater than 0");
    demand(info.categories.len() <= log::OWN, info.name, "the model has more log categories than a log has room for");
    let mut i = 0;
    while i < info.categories.len() {
        let name = info.categories[i].0;
        let mut other = 0;
        while other < log::CATEGORIES.len() + i {
            let taken = if other < i { info.categories[other].0 } else { log::CATEGORIES[other - i].0 };
            demand(!same_text(name, taken), name, "two log categories have this name");
            other += 1;
        }
        demand(!name.is_empty() && !same_text(name, log::ALL), name, "a log category needs its own name");
        i += 1;
    }
}

const fn is_positive(x: Option<f64>) -> bool {
    match x {
        Some(x) => x > 0.0 && x < f64::INFINITY,
        None => true,
    }
}

/// Checks that the capability comes with its rows.
#[track_caller]
const fn check_intermediate<E: Exported>(model: &str) {
    let (capability, rows) = (E::CAN.intermediate.is_some(), E::Model::TABLE.intermediate);
    demand(rows || !capability, model, "the capability Intermediate needs a row of the table with .intermediate()");
    demand(capability || !rows, model, "a row of the table with .intermediate() needs the capability Intermediate");
    demand(!capability || E::CAN.continuous.is_some(), model, "the capability Intermediate needs ContinuousTime");
}

/// Checks that the capability comes with its rows.
#[track_caller]
const fn check_resizable<E: Exported>(model: &str) {
    let (capability, rows) = (E::CAN.resizable.is_some(), E::Model::TABLE.has_sizes());
    demand(rows || !capability, model, "the capability Resizable needs a row V::structural");
    demand(capability || !rows, model, "a row V::structural needs the capability Resizable");
}

/// Checks that a model that is not saved needs no copy.
#[track_caller]
const fn check_saved<E: Exported>(model: &str) {
    let saved = E::CAN.saved.is_some();
    let sizes = "a row V::structural needs a model that is saved, not Unsaved: new sizes are tried on a copy";
    demand(saved || E::CAN.resizable.is_none(), model, sizes);
    let clocks = "Clocked needs a model that is saved, not Unsaved: an importer asks for output clocks before the event, which is \
                  computed on a copy";
    demand(saved || E::CAN.clocked.is_none(), model, clocks);
}

/// Checks that clocks come with the capability, and that a clocked variable names an existing clock.
#[track_caller]
const fn check_clocks<E: Exported>(model: &str) {
    let (rows, can) = (E::Model::TABLE.rows, E::CAN);
    let (mut row, mut clocks) = (0, 0);
    while row < rows.len() {
        if let Kind::Clock(timing) = rows[row].meta.kind {
            clocks += 1;
            let ticked = matches!(rows[row].meta.causality, Causality::Input);
            let urgent = timing.priority.is_some() || !ticked || !can.scheduled;
            demand(urgent, rows[row].meta.name, "a clock of Scheduled Execution needs a priority");
        }
        let mut number = 0;
        while !word(rows[row].meta.clocks, number).is_empty() {
            let name = word(rows[row].meta.clocks, number);
            demand(is_clock(rows, name), rows[row].meta.name, "the table has no clock of the name that it is on");
            number += 1;
        }
        row += 1;
    }
    demand(clocks <= MAX_CLOCKS, model, "more than 64 clocks");
    demand(clocks > 0 || can.clocked.is_none(), model, "the capability Clocked needs a row V::clock");
    demand(clocks == 0 || can.clocked.is_some(), model, "a row V::clock needs the capability Clocked");
    demand(can.clocked.is_some() || !can.scheduled, model, "the capability ScheduledExecution needs Clocked");
    let alone = can.samples.is_none() && can.intermediate.is_none();
    demand(
        alone || can.clocked.is_none(),
        model,
        "Clocked excludes Sampled, which generates its own ticks, and Intermediate",
    );
}

/// Maximum number of clocks.
const MAX_CLOCKS: usize = 64;

const fn is_clock<W>(rows: &[Row<W>], name: &str) -> bool {
    let mut row = 0;
    while row < rows.len() {
        if same_text(rows[row].meta.name, name) {
            return matches!(rows[row].meta.kind, Kind::Clock(_));
        }
        row += 1;
    }
    false
}

#[track_caller]
const fn check_state(meta: &Meta, name: &str, dimension: Option<usize>) {
    let array = meta.dimension.is_none() || dimension.is_some();
    demand(array, name, "the row is an array: its state is State::array");
    let one = same_dimension(meta.dimension, dimension);
    demand(one, name, "State::array and its row have different numbers of elements");
    let rule = "the row of a state is V::output or V::state, the row of an array V::array_output or V::array_local";
    demand(can_be_state(meta, dimension), name, rule);
}

const fn same_dimension(a: Option<usize>, b: Option<usize>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a == b,
        (None, None) => true,
        _ => false,
    }
}

/// Whether a row can contain a continuous state, or an array of that many.
pub(crate) const fn can_be_state(meta: &Meta, dimension: Option<usize>) -> bool {
    matches!(meta.variability, Variability::Continuous)
        && same_dimension(meta.dimension, dimension)
        && matches!(meta.kind, Kind::Real(_))
        && matches!(meta.causality, Causality::Output | Causality::Local)
}

/// Checks the number of states that a model passes to an integrator.
///
/// # Panics
/// At compile time, if it is another.
#[track_caller]
pub(crate) const fn check_number<M: ContinuousTime>(given: usize) {
    let (mut of_model, mut of_call) = ([0; 20], [0; 20]);
    let states = scalars(M::STATES);
    if states != given {
        let (states, given) = (digits(states, &mut of_model), digits(given, &mut of_call));
        fail(&["STATES of ", M::INFO.name, " has the length ", states, ", and its integrator is made for ", given]);
    }
}

const fn is_identifier(name: &str) -> bool {
    let (bytes, mut i) = (name.as_bytes(), 0);
    while i < bytes.len() {
        if !(bytes[i] == b'_' || bytes[i].is_ascii_alphabetic() || i > 0 && bytes[i].is_ascii_digit()) {
            return false;
        }
        i += 1;
    }
    !bytes.is_empty()
}
