//! Calls of functions by name: functions of capabilities that the FMU does not have, and every function without an instance.

use crate::checks::file::shared::libraries::functions;
use crate::encoding::bits;
use crate::session::{NotDetermined, Session};
use crate::state::Life;
use fmu_import::Status;
use fmu_import::raw::{Buffer, Handle, Optional, Raw, SavedState, Simple, StepStatus, type_name};
use model_description::{BaseType, Causality, CoSimulation, FmiVersion};

/// Functions of capabilities that the FMU does not have.
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

/// Calls a function by name with arguments that are as valid as possible; `None` if it is missing.
fn call_by_name(raw: &Raw, name: &str, handle: Handle, reference: u32) -> Option<Status> {
    let v3 = raw.version() == FmiVersion::V3;
    let mut state = SavedState::NULL;
    match name {
        "DoStep" => raw.do_step(handle, 0.0, 1.0, false, [true; 4]).map(|(s, _)| s),
        "SetupExperiment" => raw.experiment(handle, None, 0.0, None),
        "EnterInitializationMode" if v3 => raw.experiment(handle, None, 0.0, None),
        "SetDebugLogging" => raw.debug_logging(handle, false, None, 0),
        "GetFMUstate" | "GetFMUState" => raw.get_state(handle, Some(&mut state)),
        "FreeFMUstate" | "FreeFMUState" => raw.free_state(handle, Some(&mut state)),
        "SetFMUstate" | "SetFMUState" => raw.set_state(handle, state),
        "SerializedFMUstateSize" | "SerializedFMUStateSize" => raw.state_size(handle, state).map(|(s, _)| s),
        "SerializeFMUstate" | "SerializeFMUState" => raw.serialize(handle, state, 8).ok()?.map(|(s, ..)| s),
        "DeSerializeFMUstate" | "DeserializeFMUState" => raw.deserialize(handle, Some(&[0; 8]), 8).map(|(s, _)| s),
        _ => match (Simple::named(name), StepStatus::named(name), Optional::named(name)) {
            (Some(name), ..) => raw.simple(name, handle),
            (_, Some(name), _) => raw.step_status(name, handle, 2).map(|(s, _)| s),
            (_, _, Some(name)) => raw.optional(name, handle, reference),
            _ => get_or_set(raw, name, handle, reference),
        },
    }
}

/// Calls the getter or setter of this name.
fn get_or_set(raw: &Raw, name: &str, handle: Handle, reference: u32) -> Option<Status> {
    let (get, set) = (name.strip_prefix("Get"), name.strip_prefix("Set"));
    let base = BaseType::ALL.iter().copied().find(|base| Some(type_name(*base, raw.version())) == get.or(set))?;
    let mut buffer = Buffer::of(base, raw.version(), &[bits(base, 0.0)]);
    let (list, values) = (Some(&[reference][..]), Some(&mut buffer));
    if get.is_some() { raw.get(handle, base, list, 1, values, 1) } else { raw.set(handle, base, list, 1, values, 1) }
}

pub(crate) fn unsupported(session: &Session) -> Result<(), NotDetermined> {
    let reference = session.watched().first().map_or(0, |v| v.value_reference);
    for name in unsupported_functions(session).into_iter().filter(|name| session.raw.has(name)) {
        for &state in Life::CoSimulation.states() {
            session.case(|| {
                let instance = session.simulation(state)?;
                let status = instance.call(name, |raw| call_by_name(raw, name, instance.handle, reference))?;
                session.require(status == Status::ERROR, || {
                    format!("{} in {state:?} returned {status}", session.raw.name(name))
                });
                Ok(())
            });
        }
    }
    Ok(())
}

pub(crate) fn configuration(session: &Session) -> Result<(), NotDetermined> {
    if session.description.variables.iter().any(|v| v.causality == Causality::StructuralParameter) {
        return session.not_applicable("there are structural parameters");
    }
    let instance = session.fresh()?;
    let status = instance.simple(Simple::EnterConfigurationMode)?;
    session.require(status == Status::ERROR, || format!("fmi3EnterConfigurationMode returned {status}"));
    Ok(())
}

pub(crate) fn null_instance(session: &Session) -> Result<(), NotDetermined> {
    let skip = ["GetVersion", "GetTypesPlatform", "FreeInstance"];
    for name in functions(session.description.version) {
        if skip.contains(&name) || name.starts_with("Instantiate") || !session.raw.has(name) {
            continue;
        }
        session.case(|| {
            let full = session.raw.name(name);
            session.record_call(&format!("{full}(NULL)"));
            let status = call_by_name(&session.raw, name, Handle::NULL, 0)
                .ok_or_else(|| NotDetermined(format!("{name} is missing")))?;
            session.require(status == Status::ERROR, || format!("{full}(NULL) returned {status}"));
            Ok(())
        });
    }
    Ok(())
}
