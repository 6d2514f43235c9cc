//! The tables of the life cycle: every function in every state.

use super::bench::{Bench, Blocked, bits, fine, settable};
use super::binary::functions;
use super::it::It;
use super::lifecycle::State::{self, Error, Initialisation, Instantiated, Step, Terminated};
use super::lifecycle::in_state;
use fmu_import::Status;
use fmu_import::raw::{Buffer, Handle, Optional, Raw, SavedState, Simple, StepStatus};
use model_description::{BaseType, Causality, CoSimulation, FmiVersion, ModelVariable};

/// What makes a call on an instance.
type Make<'b> = Box<dyn Fn(&It<'_>) -> Result<Status, Blocked> + 'b>;

/// A call that can be made in any state.
struct Call<'b> {
    name: String,
    /// States that allow it.
    states: &'static [State],
    make: Make<'b>,
}

/// One scalar of a kind to try getters and setters with.
fn one(bench: &Bench, fits: impl Fn(&ModelVariable) -> bool) -> Option<&ModelVariable> {
    bench.numeric().find(|v| v.clocks.is_empty() && !v.is_array() && fits(v))
}

fn calls<'b>(bench: &'b Bench) -> Vec<Call<'b>> {
    const ALL: &[State] = &[Instantiated, Initialisation, Step, Terminated, Error];
    let v2 = bench.md.version == FmiVersion::V2;
    let h = bench.h();
    let mut list: Vec<Call<'b>> = Vec::new();
    let mut add = |name: &str, states: &'static [State], call: Make<'b>| {
        list.push(Call { name: name.into(), states, make: call });
    };
    add(
        "SetDebugLogging(false, 0)",
        ALL,
        Box::new(|it| it.call("SetDebugLogging", |raw| raw.debug_logging(it.handle, false, None, 0))),
    );
    add("Reset", ALL, Box::new(|it| it.simple(Simple::Reset)));
    if v2 {
        add(
            "SetupExperiment",
            &[Instantiated],
            Box::new(|it| it.call("SetupExperiment", |raw| raw.experiment(it.handle, None, bench.start(), None))),
        );
        add(
            "EnterInitializationMode",
            &[Instantiated],
            Box::new(|it| {
                // SetupExperiment belongs to it; where it is not allowed its refusal does not matter.
                let _ = it.call("SetupExperiment", |raw| raw.experiment(it.handle, None, bench.start(), None))?;
                it.simple(Simple::EnterInitializationMode)
            }),
        );
    } else {
        add(
            "EnterInitializationMode",
            &[Instantiated],
            Box::new(|it| {
                it.call("EnterInitializationMode", |raw| raw.experiment(it.handle, None, bench.start(), None))
            }),
        );
    }
    add("ExitInitializationMode", &[Initialisation], Box::new(|it| it.simple(Simple::ExitInitializationMode)));
    add("Terminate", &[Step], Box::new(|it| it.simple(Simple::Terminate)));
    add(
        "DoStep",
        &[Step],
        Box::new(move |it| {
            it.call("DoStep", |raw| raw.do_step(it.handle, it.time.get(), h, false, [true; 4]).map(|(s, _)| s))
        }),
    );
    if let Some(v) = one(bench, |v| v.causality == Causality::Output) {
        let states: &[State] =
            if v2 { &[Initialisation, Step, Terminated] } else { &[Instantiated, Initialisation, Step, Terminated] };
        add("Get(output)", states, Box::new(move |it| it.get(v).map(|(s, _)| s)));
    }
    if let Some((v, values)) = one(bench, |v| v.causality == Causality::Input && v.base.is_float())
        .and_then(|v| Some((v, bench.other_value(v, 1.0)?)))
    {
        // Whether FMI 2.0 allows inputs before initialisation its text leaves open; both is fine.
        let states: &[State] = if v2 { &[Initialisation, Step] } else { &[Instantiated, Initialisation, Step] };
        add("Set(input)", states, Box::new(move |it| it.set(v, &values)));
    }
    if let Some((v, values)) = one(bench, |v| v.causality == Causality::Parameter && settable(v) && v.base.is_float())
        .and_then(|v| Some((v, bench.other_value(v, 1.0)?)))
    {
        add("Set(parameter)", &[Instantiated, Initialisation], Box::new(move |it| it.set(v, &values)));
    }
    if bench.md.co_simulation.as_ref().is_some_and(CoSimulation::can_get_and_set_state) {
        add(
            "GetFMUState",
            &[Instantiated, Initialisation, Step, Terminated],
            Box::new(|it| {
                let mut state = SavedState::NULL;
                it.call("GetFMUState", |raw| raw.get_state(it.handle, Some(&mut state)))
            }),
        );
    }
    list
}

pub(super) fn allowed(bench: &Bench) -> Result<(), Blocked> {
    for call in calls(bench) {
        for &state in call.states.iter().filter(|s| **s != Error) {
            bench.case(|| {
                let it = in_state(bench, state)?;
                let status = (call.make)(&it)?;
                bench.require(fine(status), || format!("{} in {state:?} returned {status}", call.name));
                Ok(())
            });
        }
    }
    Ok(())
}

/// What the texts leave open (the ambiguity register): either answer is fine.
fn open(bench: &Bench, call: &str, state: State) -> bool {
    let v2 = bench.md.version == FmiVersion::V2;
    match (call, state) {
        ("Get(output)" | "Set(input)", Instantiated) => v2,
        // For debugging; and a tunable parameter may be set, which `access` looks at.
        ("Get(output)" | "GetFMUState", Error) | ("Set(parameter)", Step) => true,
        _ => false,
    }
}

pub(super) fn refused(bench: &Bench) -> Result<(), Blocked> {
    for call in calls(bench) {
        for state in [Instantiated, Initialisation, Step, Terminated] {
            if call.states.contains(&state) || open(bench, &call.name, state) {
                continue;
            }
            bench.case(|| {
                let it = in_state(bench, state)?;
                let status = (call.make)(&it)?;
                bench.require(status == Status::ERROR, || format!("{} in {state:?} returned {status}", call.name));
                Ok(())
            });
        }
    }
    Ok(())
}

/// Functions whose capability the FMU does not have.
fn absent(bench: &Bench) -> Vec<&'static str> {
    let flag = |name| bench.flag(name);
    let i = bench.md.co_simulation.as_ref();
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
    let clocks = bench.md.variables.iter().any(|v| v.base == BaseType::Clock);
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
    functions(bench.md.version).into_iter().filter(fits).collect()
}

/// A function by its name, with arguments that are as good as possible.
fn unadorned(raw: &Raw, name: &str, handle: Handle, reference: u32) -> Option<Status> {
    if let Some(name) = Simple::named(name) {
        raw.simple(name, handle)
    } else if let Some(name) = StepStatus::named(name) {
        raw.step_status(name, handle, 2).map(|(status, _)| status)
    } else {
        raw.optional(Optional::named(name)?, handle, reference)
    }
}

pub(super) fn unsupported(bench: &Bench) -> Result<(), Blocked> {
    let reference = bench.watched().first().map_or(0, |v| v.value_reference);
    for name in absent(bench) {
        if !bench.raw.has(name) {
            continue;
        }
        for state in [Instantiated, Initialisation, Step, Terminated] {
            bench.case(|| {
                let it = in_state(bench, state)?;
                let status = it.call(name, |raw| match name {
                    "GetFMUstate" | "GetFMUState" => raw.get_state(it.handle, Some(&mut SavedState::NULL.clone())),
                    "SerializedFMUstateSize" | "SerializedFMUStateSize" => {
                        raw.state_size(it.handle, SavedState::NULL).map(|(s, _)| s)
                    }
                    _ => unadorned(raw, name, it.handle, reference),
                })?;
                bench.require(status == Status::ERROR, || {
                    format!("{} in {state:?} returned {status}", bench.raw.name(name))
                });
                Ok(())
            });
        }
    }
    Ok(())
}

pub(super) fn configuration(bench: &Bench) -> Result<(), Blocked> {
    if bench.md.variables.iter().any(|v| v.causality == Causality::StructuralParameter) {
        return bench.not_applicable("there are structural parameters");
    }
    let it = bench.fresh()?;
    let status = it.simple(Simple::EnterConfigurationMode)?;
    bench.require(status == Status::ERROR, || format!("fmi3EnterConfigurationMode returned {status}"));
    Ok(())
}

pub(super) fn nobody(bench: &Bench) -> Result<(), Blocked> {
    let skip = ["GetVersion", "GetTypesPlatform", "FreeInstance"];
    for name in functions(bench.md.version) {
        if skip.contains(&name) || name.starts_with("Instantiate") || !bench.raw.has(name) {
            continue;
        }
        bench.case(|| {
            bench.calling(&format!("{}(NULL)", bench.raw.name(name)));
            let raw = &bench.raw;
            let null = Handle::NULL;
            let base =
                |n: &str| BaseType::ALL.iter().copied().find(|b| fmu_import::raw::type_name(*b, bench.md.version) == n);
            let status = match name {
                "DoStep" => raw.do_step(null, 0.0, 1.0, false, [true; 4]).map(|(s, _)| s),
                "SetupExperiment" => raw.experiment(null, None, 0.0, None),
                "EnterInitializationMode" if bench.md.version == FmiVersion::V3 => {
                    raw.experiment(null, None, 0.0, None)
                }
                "SetDebugLogging" => raw.debug_logging(null, false, None, 0),
                "GetFMUstate" | "GetFMUState" => raw.get_state(null, Some(&mut SavedState::NULL.clone())),
                "FreeFMUstate" | "FreeFMUState" => raw.free_state(null, Some(&mut SavedState::NULL.clone())),
                "SetFMUstate" | "SetFMUState" => raw.set_state(null, SavedState::NULL),
                "SerializedFMUstateSize" | "SerializedFMUStateSize" => {
                    raw.state_size(null, SavedState::NULL).map(|(s, _)| s)
                }
                "SerializeFMUstate" | "SerializeFMUState" => raw.serialize(null, SavedState::NULL, 8).map(|(s, ..)| s),
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
                        let mut buffer = Buffer::of(base, bench.md.version, &[bits(base, 0.0)]);
                        if n.starts_with("Get") {
                            raw.get(null, base, Some(&[0]), 1, Some(&mut buffer), 1)
                        } else {
                            raw.set(null, base, Some(&[0]), 1, Some(&mut buffer), 1)
                        }
                    }
                    None => unadorned(raw, n, null, 0),
                },
            };
            let status = status.ok_or_else(|| Blocked(format!("{name} is missing")))?;
            bench.require(status == Status::ERROR, || format!("{}(NULL) returned {status}", raw.name(name)));
            Ok(())
        });
    }
    Ok(())
}
