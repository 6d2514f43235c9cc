//! Compile-time checks of a model. A panic during compilation is an error whose text names the row, the state or the model.

use crate::capability::Exported;
use crate::clock::word;
use crate::continuous::ContinuousTime;
use crate::log;
use crate::model::{Experiment, Info, Model};
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
    let mut i = 0;
    check_intermediate::<E>(model);
    check_clocks::<E>(model);
    check_resizable::<E>(model);
    while i < states {
        let name = can.states()[i].name;
        let mut other = 0;
        while other < i {
            let twice = same_text(can.states()[other].name, name);
            demand(!twice, name, "two states have this name");
            other += 1;
        }
        check_state(rows, model, name, can.states()[i].dimension());
        i += 1;
    }
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
    demand(alone || can.clocked.is_none(), model, "Clocked excludes Sampled, which ticks by itself, and Intermediate");
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
const fn check_state<W>(rows: &[Row<W>], model: &str, name: &str, dimension: Option<usize>) {
    let mut row = 0;
    while row < rows.len() {
        let meta = &rows[row].meta;
        if let Access::Part { .. } = rows[row].access {
            // The compiler cannot read the names of a part's rows.
            if starts_with(name, meta.name) {
                return;
            }
        } else if same_text(meta.name, name) {
            let array = meta.dimension.is_none() || dimension.is_some();
            demand(array, name, "the row is an array: its state is State::array");
            let one = same_dimension(meta.dimension, dimension);
            demand(one, name, "State::array and its row have different numbers of elements");
            let rule =
                "the row of a state is V::output or V::state, that of an array V::array_output or V::array_local";
            demand(can_be_state(meta, dimension), name, rule);
            return;
        }
        row += 1;
    }
    fail(&["STATES of ", model, ": no row of the table has the name ", name]);
}

const fn same_dimension(a: Option<usize>, b: Option<usize>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a == b,
        (None, None) => true,
        _ => false,
    }
}

/// Whether a row can hold a continuous state, or an array of that many.
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
    let (mut states, mut i) = (0, 0);
    while i < M::STATES.len() {
        states += M::STATES[i].most();
        i += 1;
    }
    if states != given {
        let (states, given) = (digits(states, &mut of_model), digits(given, &mut of_call));
        fail(&["STATES of ", M::INFO.name, " has the length ", states, ", and its integrator is made for ", given]);
    }
}

/// A compile-time check of a row. The error is reported at the caller, which is the row, with the variable's name.
#[track_caller]
pub(crate) const fn demand(fits: bool, name: &str, why: &str) {
    if !fits {
        fail(&[name, ": ", why]);
    }
}

/// An error of the compiler with this text.
#[track_caller]
const fn fail(parts: &[&str]) -> ! {
    // A panic while compiling takes one text.
    let (mut text, mut len, mut part) = ([0_u8; 256], 0, 0);
    while part < parts.len() {
        let (bytes, mut i) = (parts[part].as_bytes(), 0);
        while i < bytes.len() && len < text.len() {
            text[len] = bytes[i];
            (i, len) = (i + 1, len + 1);
        }
        part += 1;
    }
    match std::str::from_utf8(text.split_at(len).0) {
        Ok(text) => panic!("{}", text),
        Err(_) => panic!("{}", parts[parts.len() - 1]),
    }
}

/// A number in decimal.
#[expect(clippy::cast_possible_truncation, reason = "a digit")]
const fn digits(mut number: usize, text: &mut [u8; 20]) -> &str {
    let mut first = text.len();
    while first == text.len() || number > 0 {
        first -= 1;
        text[first] = b'0' + (number % 10) as u8;
        number /= 10;
    }
    match std::str::from_utf8(text.split_at(first).1) {
        Ok(text) => text,
        Err(_) => "",
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

const fn starts_with(text: &str, start: &str) -> bool {
    let (text, start, mut i) = (text.as_bytes(), start.as_bytes(), 0);
    while i < start.len() {
        if i >= text.len() || text[i] != start[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// Whether two texts are equal.
pub(crate) const fn same_text(a: &str, b: &str) -> bool {
    a.len() == b.len() && starts_with(a, b)
}
