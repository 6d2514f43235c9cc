//! One table of calls: which state of an instance's life allows which function, in each interface of both standards.

use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::settable::settable;
use crate::state::{Life, State};
use fmu_import::Status;
use fmu_import::raw::{SavedState, Sensitivity, Simple, Vector, take_events};
use model_description::{Causality, CoSimulation, FmiVersion, ModelVariable, Variability};

/// A row: the function; whether it is tried with an FMU; what each state of each interface answers; the call.
///
/// A cell has a sign for each of [`Life::states`]: `+` must succeed, `s` should succeed, `-` must return Error, `?` is open
/// (the standard can be read either way, or another check looks at it), a space is not tried.
struct Call(&'static str, fn(&Session) -> bool, [&'static str; 5], Make);

/// Makes the call on an instance that is in this state.
type Make = fn(&Instance<'_>, State) -> Result<Status, NotDetermined>;

#[rustfmt::skip]
const CALLS: &[Call] = &[
    //                                                             Co-Simulation   Model Exchange    Event Mode
    //                                                             2.0     3.0     2.0      3.0      3.0
    //                                                             INST    INST    INECT    INECT    SE
    Call("SetDebugLogging(false, 0)",     any,                  ["++++", "++++", "+++++", "+++++", ""  ], debug_logging),
    Call("Reset",                         any,                  ["++++", "++++", "+++++", "+++++", ""  ], |i, _| i.simple(Simple::Reset)),
    Call("SetupExperiment",               any,                  ["+---", "",     "+----", "",      ""  ], |i, _| experiment(i, "SetupExperiment")),
    Call("EnterInitializationMode",       any,                  ["+---", "+---", "+----", "+----", ""  ], enter_initialization),
    Call("ExitInitializationMode",        any,                  ["-+--", "-+--", "-+---", "-+---", ""  ], |i, _| i.simple(Simple::ExitInitializationMode)),
    Call("Terminate",                     any,                  ["--+-", "--+-", "--++-", "--++-", ""  ], |i, _| i.simple(Simple::Terminate)),
    Call("DoStep",                        any,                  ["--+-", "--+-", "",      "",      " -"], do_step),
    Call("DoStep",                        |s| s.raw.has("DoStep"), ["",  "",     "-----", "-----", ""  ], do_step),
    Call("NewDiscreteStates",             any,                  ["",     "",     "--+--", "",      ""  ], |i, _| Ok(i.update()?.0)),
    Call("UpdateDiscreteStates",          any,                  ["",     "",     "",      "--+--", "- "], |i, _| Ok(i.update()?.0)),
    // In Event Mode, the table of FMI 2.0 allows it, and its text mentions a use only for discrete FMUs.
    Call("EnterEventMode",                any,                  ["",     "",     "--?+-", "--?+-", ""  ], |i, _| i.simple(Simple::EnterEventMode)),
    Call("EnterStepMode",                 |s| s.raw.has("EnterStepMode"), ["", "", "",    "-----", "- "], |i, _| i.simple(Simple::EnterStepMode)),
    Call("EnterContinuousTimeMode",       any,                  ["",     "",     "--+--", "--+--", ""  ], enter_continuous_time),
    // In Event Mode, FMI 2.0 allows it for a purely discrete FMU, without a definition of that term.
    Call("SetTime",                       any,                  ["",     "",     "--?+-", "---+-", ""  ], |i, _| i.set_time(i.time.get())),
    Call("CompletedIntegratorStep",       any,                  ["",     "",     "---+-", "---+-", ""  ], |i, _| Ok(i.completed()?.0)),
    // FMI 2.0 allows the vectors in Initialization Mode, though a simulation needs them after it only.
    Call("GetEventIndicators",            |s| s.indicators() > 0, ["",   "",     "-s+++", "-s+++", ""  ], |i, _| vector(i, Vector::GetEventIndicators)),
    Call("GetContinuousStates",           |s| s.states() > 0,   ["",     "",     "-s+++", "-s+++", ""  ], |i, _| vector(i, Vector::GetContinuousStates)),
    Call("GetDerivatives",                |s| s.states() > 0,   ["",     "",     "-s+++", "",      ""  ], |i, _| vector(i, Vector::GetDerivatives)),
    Call("GetContinuousStateDerivatives", |s| s.states() > 0,   ["",     "",     "",      "-s+++", ""  ], |i, _| vector(i, i.derivatives_name())),
    Call("GetNominalsOfContinuousStates", |s| s.states() > 0,   ["",     "",     "ss+++", "?s+++", ""  ], nominals),
    Call("SetContinuousStates",           |s| s.states() > 0,   ["",     "",     "---+-", "---+-", ""  ], set_states),
    // Which unknowns there are in Initialization Mode depends on the list of initial unknowns.
    Call("GetDirectionalDerivative",      |s| direction(s).is_some(), ["", "",   "-?+++", "-?+++", ""  ], directional_derivative),
    Call("Get(output)",                   |s| output(s).is_some(), ["?+++", "?+++", "?++++", "?++++", ""], |i, _| get(i, output(i.session))),
    // FMI 3.0 allows start values to be read in Instantiated; most outputs have none.
    Call("Get(output with a start value)", |s| output(s).is_some_and(|v| v.start.is_some()), ["", "s", "", "s", ""], |i, _| get(i, output(i.session))),
    // FMI 2.0 does not say whether inputs may be set before initialization.
    Call("Set(continuous input)",         |s| input(s, Variability::Continuous).is_some(), ["?++-", "+++-", "?+++-", "++++-", ""], set_continuous_input),
    Call("Set(discrete input)",           |s| input(s, Variability::Discrete).is_some(),   ["?++-", "+++-", "?++--", "+++--", ""], set_discrete_input),
    // In Step Mode, `access` looks at both.
    Call("Set(tunable parameter)",        |s| parameter(s, Variability::Tunable).is_some(), ["++?-", "++?-", "+++--", "+++--", ""], set_tunable_parameter),
    Call("Set(fixed parameter)",          |s| parameter(s, Variability::Fixed).is_some(),   ["++?-", "++?-", "++---", "++---", ""], set_fixed_parameter),
    Call("GetFMUState",                   simulation_saves,     ["++++", "++++", "",      "",      ""  ], get_state),
    Call("GetFMUState",                   Session::exchange_saves, ["",  "",     "+++++", "+++++", ""  ], get_state),
];

/// Whether an FMU that accepts a call that the state does not allow logs a message of status Warning (with logging on).
fn warned(session: &Session, life: Life, state: State, make: Make) -> Result<bool, NotDetermined> {
    let instance = session.in_state(life, state)?;
    let _ = instance.call("SetDebugLogging", |raw| raw.debug_logging(instance.handle, true, None, 0))?;
    let _ = take_events();
    Ok(make(&instance, state)?.is_ok() && take_events().iter().any(|event| event.status == Status::WARNING.0))
}

/// Makes each call in each state with this sign; with `-`, it must return Error, or be taken with a warning, otherwise it must succeed.
pub(crate) fn attempt(session: &Session, life: Life, sign: char) {
    let column = match (life, session.description.version) {
        (Life::CoSimulation, FmiVersion::V2) => 0,
        (Life::CoSimulation, FmiVersion::V3) => 1,
        (Life::ModelExchange, FmiVersion::V2) => 2,
        (Life::ModelExchange, FmiVersion::V3) => 3,
        (Life::EventMode, _) => 4,
    };
    for Call(name, _, cells, make) in CALLS.iter().filter(|Call(_, tried, ..)| tried(session)) {
        // E01i covers Model Exchange.
        let wanted = |cell: char| cell == sign || (life == Life::CoSimulation && (sign, cell) == ('+', 's'));
        let states = life.states().iter().zip(cells[column].chars()).filter(|(_, cell)| wanted(*cell));
        for (&state, cell) in states {
            session.case(|| {
                let instance = session.in_state(life, state)?;
                let status = make(&instance, state)?;
                // FMI 2.0.5, 2.1.3; FMI 3.0.2, 2.2.4: a setter may discard a value, which the solver then tries after a shorter
                // step. A discrete input that an importer sets ahead of its event is such a value.
                let discarded = status == Status::DISCARD && state == State::Continuous && name.starts_with("Set(");
                let good = if sign == '-' { status == Status::ERROR || discarded } else { status.is_ok() };
                if sign == '-' && status.is_ok() && warned(session, life, state, *make)? {
                    return Ok(());
                }
                if !good {
                    let text = format!("{name} in {state:?} returned {status}");
                    if cell == sign { session.violated(text) } else { session.lesser(Level::Should, text) }
                }
                Ok(())
            });
        }
    }
}

/// The calls that a check of this table makes, with the states from the standard's state tables, for `--explain`.
pub(crate) fn explained(id: &str) -> Vec<String> {
    let (signs, life, columns): (_, _, &[(usize, &str)]) = match id {
        "L07" => ("+s", Life::CoSimulation, &[(0, "FMI 2.0"), (1, "FMI 3.0")]),
        "L08" => ("-", Life::CoSimulation, &[(0, "FMI 2.0"), (1, "FMI 3.0")]),
        "E01" => ("+", Life::ModelExchange, &[(2, "FMI 2.0"), (3, "FMI 3.0")]),
        "E01i" => ("s", Life::ModelExchange, &[(2, "FMI 2.0"), (3, "FMI 3.0")]),
        "E02" => ("-", Life::ModelExchange, &[(2, "FMI 2.0"), (3, "FMI 3.0")]),
        "N05" => ("-", Life::EventMode, &[(4, "FMI 3.0")]),
        _ => return Vec::new(),
    };
    let mut lines = Vec::new();
    for (column, standard) in columns {
        for Call(name, _, cells, _) in CALLS {
            let states = life.states().iter().zip(cells[*column].chars()).filter(|(_, cell)| signs.contains(*cell));
            let states: Vec<_> = states.map(|(state, _)| format!("{state:?}")).collect();
            if !states.is_empty() {
                lines.push(format!("{standard}: {name} in {}", states.join(", ")));
            }
        }
    }
    lines
}

fn any(_: &Session) -> bool {
    true
}

fn simulation_saves(session: &Session) -> bool {
    session.description.co_simulation.as_ref().is_some_and(CoSimulation::can_get_and_set_state)
}

fn debug_logging(instance: &Instance<'_>, _: State) -> Result<Status, NotDetermined> {
    instance.call("SetDebugLogging", |raw| raw.debug_logging(instance.handle, false, None, 0))
}

fn experiment(instance: &Instance<'_>, name: &str) -> Result<Status, NotDetermined> {
    instance.call(name, |raw| raw.experiment(instance.handle, None, instance.session.start(), None))
}

/// FMI 2.0 requires SetupExperiment first.
fn enter_initialization(instance: &Instance<'_>, state: State) -> Result<Status, NotDetermined> {
    if !instance.session.is_v2() {
        return experiment(instance, "EnterInitializationMode");
    }
    if state == State::Instantiated {
        let _ = experiment(instance, "SetupExperiment")?;
    }
    instance.simple(Simple::EnterInitializationMode)
}

fn do_step(instance: &Instance<'_>, _: State) -> Result<Status, NotDetermined> {
    let (t, h) = (instance.time.get(), instance.session.h());
    instance.call("DoStep", |raw| Some(raw.do_step(instance.handle, t, h, false, [true; 4])?.0))
}

fn enter_continuous_time(instance: &Instance<'_>, state: State) -> Result<Status, NotDetermined> {
    if state == State::Event {
        let _ = instance.iterate()?;
    }
    instance.simple(Simple::EnterContinuousTimeMode)
}

fn vector(instance: &Instance<'_>, name: Vector) -> Result<Status, NotDetermined> {
    let session = instance.session;
    let n = if name == Vector::GetEventIndicators { session.indicators() } else { session.states() };
    Ok(instance.vector(name, n)?.0)
}

fn nominals(instance: &Instance<'_>, _: State) -> Result<Status, NotDetermined> {
    vector(instance, Vector::GetNominalsOfContinuousStates)
}

fn set_states(instance: &Instance<'_>, state: State) -> Result<Status, NotDetermined> {
    let n = instance.session.states();
    let x = if state == State::Continuous { instance.states()? } else { vec![0.0; n] };
    instance.set_states(&x)
}

/// A derivative of a state and a state, by their references, if the FMU has directional derivatives.
fn direction(session: &Session) -> Option<[u32; 2]> {
    let names = ["providesDirectionalDerivative", "providesDirectionalDerivatives"];
    if !names.iter().any(|name| session.exchange_flag(name)) {
        return None;
    }
    let d = &session.description;
    let unknown = d.derivatives.iter().find_map(|u| d.referenced(u.reference))?;
    Some([unknown.value_reference, d.states().first()?.value_reference])
}

fn directional_derivative(instance: &Instance<'_>, _: State) -> Result<Status, NotDetermined> {
    let [unknown, known] = direction(instance.session).ok_or_else(nothing)?;
    let seed = vec![1.0; instance.session.values_of(&[known])];
    Ok(instance.sensitivity(Sensitivity::GetDirectionalDerivative, [&[unknown], &[known]], &seed)?.0)
}

/// The row's filter has already checked that such a variable exists.
fn nothing() -> NotDetermined {
    NotDetermined("there is no such variable".into())
}

/// A scalar variable for getters and setters.
fn scalar(session: &Session, fits: impl Fn(&ModelVariable) -> bool) -> Option<&ModelVariable> {
    session.numeric().find(|v| v.clocks.is_empty() && !v.is_array() && fits(v))
}

fn output(session: &Session) -> Option<&ModelVariable> {
    scalar(session, |v| v.causality == Causality::Output)
}

/// An input of this variability, and a value for it.
fn input(session: &Session, variability: Variability) -> Option<(&ModelVariable, Vec<u64>)> {
    let fits = |v: &ModelVariable| v.causality == Causality::Input && v.base.is_float() && v.variability == variability;
    scalar(session, fits).and_then(|v| Some((v, session.different_value(v, 1.0)?)))
}

/// A parameter of this variability, and a value for it.
fn parameter(session: &Session, variability: Variability) -> Option<(&ModelVariable, Vec<u64>)> {
    let fits = |v: &ModelVariable| {
        v.causality == Causality::Parameter && settable(v) && v.base.is_float() && v.variability == variability
    };
    scalar(session, fits).and_then(|v| Some((v, session.different_value(v, 1.0)?)))
}

fn get(instance: &Instance<'_>, v: Option<&ModelVariable>) -> Result<Status, NotDetermined> {
    Ok(instance.get(v.ok_or_else(nothing)?)?.0)
}

fn set(instance: &Instance<'_>, found: Option<(&ModelVariable, Vec<u64>)>) -> Result<Status, NotDetermined> {
    let (v, values) = found.ok_or_else(nothing)?;
    instance.set(v, &values)
}

fn set_continuous_input(instance: &Instance<'_>, _: State) -> Result<Status, NotDetermined> {
    set(instance, input(instance.session, Variability::Continuous))
}

fn set_discrete_input(instance: &Instance<'_>, _: State) -> Result<Status, NotDetermined> {
    set(instance, input(instance.session, Variability::Discrete))
}

fn set_tunable_parameter(instance: &Instance<'_>, _: State) -> Result<Status, NotDetermined> {
    set(instance, parameter(instance.session, Variability::Tunable))
}

fn set_fixed_parameter(instance: &Instance<'_>, _: State) -> Result<Status, NotDetermined> {
    set(instance, parameter(instance.session, Variability::Fixed))
}

fn get_state(instance: &Instance<'_>, _: State) -> Result<Status, NotDetermined> {
    let mut state = SavedState::NULL;
    instance.call("GetFMUState", |raw| raw.get_state(instance.handle, Some(&mut state)))
}
