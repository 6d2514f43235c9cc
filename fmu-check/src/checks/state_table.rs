//! The tables of the life cycle: every function in every state.

use super::binary::functions;
use super::lifecycle_states::State::{Error, Initialization, Instantiated, Step, Terminated};
use super::lifecycle_states::{State, in_state};
use crate::encoding::bits;
use crate::instance::Instance;
use crate::session::{NotDetermined, Session, settable};
use fmu_import::Status;
use fmu_import::raw::{Buffer, Handle, Optional, Raw, SavedState, Simple, StepStatus};
use model_description::{BaseType, Causality, CoSimulation, FmiVersion, ModelVariable};

/// Makes the call on an instance.
type Make<'b> = Box<dyn Fn(&Instance<'_>) -> Result<Status, NotDetermined> + 'b>;

/// A call that can be made in any state.
struct Call<'b> {
    name: String,
    /// States that allow it.
    states: &'static [State],
    make: Make<'b>,
}

/// A scalar variable for getters and setters.
fn scalar(session: &Session, fits: impl Fn(&ModelVariable) -> bool) -> Option<&ModelVariable> {
    session.numeric().find(|v| v.clocks.is_empty() && !v.is_array() && fits(v))
}

fn calls<'b>(session: &'b Session) -> Vec<Call<'b>> {
    const ALL: &[State] = &[Instantiated, Initialization, Step, Terminated, Error];
    let v2 = session.description.version == FmiVersion::V2;
    let h = session.h();
    let mut list: Vec<Call<'b>> = Vec::new();
    let mut add = |name: &str, states: &'static [State], call: Make<'b>| {
        list.push(Call { name: name.into(), states, make: call });
    };
    add(
        "SetDebugLogging(false, 0)",
        ALL,
        Box::new(|instance| instance.call("SetDebugLogging", |raw| raw.debug_logging(instance.handle, false, None, 0))),
    );
    add("Reset", ALL, Box::new(|instance| instance.simple(Simple::Reset)));
    if v2 {
        add(
            "SetupExperiment",
            &[Instantiated],
            Box::new(|instance| {
                instance.call("SetupExperiment", |raw| raw.experiment(instance.handle, None, session.start(), None))
            }),
        );
        add(
            "EnterInitializationMode",
            &[Instantiated],
            Box::new(|instance| {
                // FMI 2.0 requires SetupExperiment first; in a state that does not allow it, its refusal does not matter.
                let _ = instance
                    .call("SetupExperiment", |raw| raw.experiment(instance.handle, None, session.start(), None))?;
                instance.simple(Simple::EnterInitializationMode)
            }),
        );
    } else {
        add(
            "EnterInitializationMode",
            &[Instantiated],
            Box::new(|instance| {
                instance
                    .call("EnterInitializationMode", |raw| raw.experiment(instance.handle, None, session.start(), None))
            }),
        );
    }
    add(
        "ExitInitializationMode",
        &[Initialization],
        Box::new(|instance| instance.simple(Simple::ExitInitializationMode)),
    );
    add("Terminate", &[Step], Box::new(|instance| instance.simple(Simple::Terminate)));
    add(
        "DoStep",
        &[Step],
        Box::new(move |instance| {
            instance.call("DoStep", |raw| {
                raw.do_step(instance.handle, instance.time.get(), h, false, [true; 4]).map(|(s, _)| s)
            })
        }),
    );
    if let Some(v) = scalar(session, |v| v.causality == Causality::Output) {
        // FMI 3.0 allows start values to be read in Instantiated; most outputs have none.
        let states: &[State] = if v2 || v.start.is_none() {
            &[Initialization, Step, Terminated]
        } else {
            &[Instantiated, Initialization, Step, Terminated]
        };
        add("Get(output)", states, Box::new(move |instance| instance.get(v).map(|(s, _)| s)));
    }
    if let Some((v, values)) = scalar(session, |v| v.causality == Causality::Input && v.base.is_float())
        .and_then(|v| Some((v, session.different_value(v, 1.0)?)))
    {
        // FMI 2.0 does not say whether inputs may be set before initialization; both answers are accepted.
        let states: &[State] = if v2 { &[Initialization, Step] } else { &[Instantiated, Initialization, Step] };
        add("Set(input)", states, Box::new(move |instance| instance.set(v, &values)));
    }
    if let Some((v, values)) =
        scalar(session, |v| v.causality == Causality::Parameter && settable(v) && v.base.is_float())
            .and_then(|v| Some((v, session.different_value(v, 1.0)?)))
    {
        add("Set(parameter)", &[Instantiated, Initialization], Box::new(move |instance| instance.set(v, &values)));
    }
    if session.description.co_simulation.as_ref().is_some_and(CoSimulation::can_get_and_set_state) {
        add(
            "GetFMUState",
            &[Instantiated, Initialization, Step, Terminated],
            Box::new(|instance| {
                let mut state = SavedState::NULL;
                instance.call("GetFMUState", |raw| raw.get_state(instance.handle, Some(&mut state)))
            }),
        );
    }
    list
}

pub(super) fn allowed(session: &Session) -> Result<(), NotDetermined> {
    for call in calls(session) {
        for &state in call.states.iter().filter(|s| **s != Error) {
            session.case(|| {
                let instance = in_state(session, state)?;
                let status = (call.make)(&instance)?;
                session.require(status.is_ok(), || format!("{} in {state:?} returned {status}", call.name));
                Ok(())
            });
        }
    }
    Ok(())
}

/// Whether the standard leaves the call open in this state: then both answers are accepted.
fn is_ambiguous(session: &Session, call: &str, state: State) -> bool {
    let v2 = session.description.version == FmiVersion::V2;
    match (call, state) {
        ("Set(input)", Instantiated) => v2,
        // For debugging; and a tunable parameter may be set, which `access` looks at.
        ("Get(output)", Instantiated | Error) | ("GetFMUState", Error) | ("Set(parameter)", Step) => true,
        _ => false,
    }
}

pub(super) fn refused(session: &Session) -> Result<(), NotDetermined> {
    for call in calls(session) {
        for state in [Instantiated, Initialization, Step, Terminated] {
            if call.states.contains(&state) || is_ambiguous(session, &call.name, state) {
                continue;
            }
            session.case(|| {
                let instance = in_state(session, state)?;
                let status = (call.make)(&instance)?;
                session.require(status == Status::ERROR, || format!("{} in {state:?} returned {status}", call.name));
                Ok(())
            });
        }
    }
    Ok(())
}

/// Functions whose capability the FMU does not have.
fn unsupported_functions(session: &Session) -> Vec<&'static str> {
    let flag = |name| session.flag(name);
    let i = session.description.co_simulation.as_ref();
    let (state, serial) =
        (i.is_some_and(CoSimulation::can_get_and_set_state), i.is_some_and(CoSimulation::can_serialize_state));
    let order = i.and_then(|i| i.attribute("maxOutputDerivativeOrder")).is_some_and(|o| o.trim() != "0");
    let exchange = [
        "EnterContinuousTimeMode",
        "CompletedIntegratorStep",
        "SetTime",
        "SetContinuousStates",
        "GetDerivatives",
        "GetContinuousStateDerivatives",
        "GetEventIndicators",
        "GetContinuousStates",
        "GetNominalsOfContinuousStates",
        "GetNumberOfEventIndicators",
        "GetNumberOfContinuousStates",
        "NewDiscreteStates",
    ];
    let clocks = session.description.variables.iter().any(|v| v.base == BaseType::Clock);
    let fits = |name: &&'static str| match *name {
        "EnterEventMode" | "EnterStepMode" | "UpdateDiscreteStates" | "EvaluateDiscreteStates" => !flag("hasEventMode"),
        "GetClock" | "SetClock" | "ActivateModelPartition" => !clocks,
        n if n.contains("Interval") || n.contains("Shift") => !clocks,
        "GetDirectionalDerivative" => !flag("providesDirectionalDerivative") && !flag("providesDirectionalDerivatives"),
        "GetAdjointDerivative" => !flag("providesAdjointDerivatives"),
        "GetNumberOfVariableDependencies" | "GetVariableDependencies" => !flag("providesPerElementDependencies"),
        "GetOutputDerivatives" | "GetRealOutputDerivatives" => !order,
        "SetRealInputDerivatives" => !flag("canInterpolateInputs"),
        "CancelStep" => !flag("canRunAsynchronuously"),
        "GetFMUstate" | "GetFMUState" => !state,
        "SerializedFMUstateSize" | "SerializedFMUStateSize" => !serial,
        n => exchange.contains(&n),
    };
    functions(session.description.version).into_iter().filter(fits).collect()
}

/// Calls a function by name with arguments that are as valid as possible.
fn call_by_name(raw: &Raw, name: &str, handle: Handle, reference: u32) -> Option<Status> {
    if let Some(name) = Simple::named(name) {
        raw.simple(name, handle)
    } else if let Some(name) = StepStatus::named(name) {
        raw.step_status(name, handle, 2).map(|(status, _)| status)
    } else {
        raw.optional(Optional::named(name)?, handle, reference)
    }
}

pub(super) fn unsupported(session: &Session) -> Result<(), NotDetermined> {
    let reference = session.watched().first().map_or(0, |v| v.value_reference);
    for name in unsupported_functions(session) {
        if !session.raw.has(name) {
            continue;
        }
        for state in [Instantiated, Initialization, Step, Terminated] {
            session.case(|| {
                let instance = in_state(session, state)?;
                let status = instance.call(name, |raw| match name {
                    "GetFMUstate" | "GetFMUState" => {
                        raw.get_state(instance.handle, Some(&mut SavedState::NULL.clone()))
                    }
                    "SerializedFMUstateSize" | "SerializedFMUStateSize" => {
                        raw.state_size(instance.handle, SavedState::NULL).map(|(s, _)| s)
                    }
                    _ => call_by_name(raw, name, instance.handle, reference),
                })?;
                session.require(status == Status::ERROR, || {
                    format!("{} in {state:?} returned {status}", session.raw.name(name))
                });
                Ok(())
            });
        }
    }
    Ok(())
}

pub(super) fn configuration(session: &Session) -> Result<(), NotDetermined> {
    if session.description.variables.iter().any(|v| v.causality == Causality::StructuralParameter) {
        return session.not_applicable("there are structural parameters");
    }
    let instance = session.fresh()?;
    let status = instance.simple(Simple::EnterConfigurationMode)?;
    session.require(status == Status::ERROR, || format!("fmi3EnterConfigurationMode returned {status}"));
    Ok(())
}

pub(super) fn null_instance(session: &Session) -> Result<(), NotDetermined> {
    let skip = ["GetVersion", "GetTypesPlatform", "FreeInstance"];
    for name in functions(session.description.version) {
        if skip.contains(&name) || name.starts_with("Instantiate") || !session.raw.has(name) {
            continue;
        }
        session.case(|| {
            session.record_call(&format!("{}(NULL)", session.raw.name(name)));
            let raw = &session.raw;
            let null = Handle::NULL;
            let base = |n: &str| {
                BaseType::ALL.iter().copied().find(|b| fmu_import::raw::type_name(*b, session.description.version) == n)
            };
            let status = match name {
                "DoStep" => raw.do_step(null, 0.0, 1.0, false, [true; 4]).map(|(s, _)| s),
                "SetupExperiment" => raw.experiment(null, None, 0.0, None),
                "EnterInitializationMode" if session.description.version == FmiVersion::V3 => {
                    raw.experiment(null, None, 0.0, None)
                }
                "SetDebugLogging" => raw.debug_logging(null, false, None, 0),
                "GetFMUstate" | "GetFMUState" => raw.get_state(null, Some(&mut SavedState::NULL.clone())),
                "FreeFMUstate" | "FreeFMUState" => raw.free_state(null, Some(&mut SavedState::NULL.clone())),
                "SetFMUstate" | "SetFMUState" => raw.set_state(null, SavedState::NULL),
                "SerializedFMUstateSize" | "SerializedFMUStateSize" => {
                    raw.state_size(null, SavedState::NULL).map(|(s, _)| s)
                }
                "SerializeFMUstate" | "SerializeFMUState" => {
                    raw.serialize(null, SavedState::NULL, 8).map_err(NotDetermined)?.map(|(s, ..)| s)
                }
                "DeSerializeFMUstate" | "DeserializeFMUState" => {
                    raw.deserialize(null, Some(&[0; 8]), 8).map(|(s, _)| s)
                }
                n => match n
                    .strip_prefix("Get")
                    .or_else(|| n.strip_prefix("Set"))
                    .and_then(base)
                    .filter(|b| !matches!(b, BaseType::Binary | BaseType::Clock))
                {
                    Some(base) => {
                        let mut buffer = Buffer::of(base, session.description.version, &[bits(base, 0.0)]);
                        if n.starts_with("Get") {
                            raw.get(null, base, Some(&[0]), 1, Some(&mut buffer), 1)
                        } else {
                            raw.set(null, base, Some(&[0]), 1, Some(&mut buffer), 1)
                        }
                    }
                    None => call_by_name(raw, n, null, 0),
                },
            };
            let status = status.ok_or_else(|| NotDetermined(format!("{name} is missing")))?;
            session.require(status == Status::ERROR, || format!("{}(NULL) returned {status}", raw.name(name)));
            Ok(())
        });
    }
    Ok(())
}
