//! The table of the life cycle of Model Exchange: every function in every state.

use crate::exchange::Mode::{Continuous, Event, Initialization, Instantiated, Terminated};
use crate::exchange::{Importer, Mode};
use crate::instance::Instance;
use crate::session::{NotDetermined, Session, settable};
use fmu_import::Status;
use fmu_import::raw::{SavedState, Sensitivity, Simple, Vector};
use model_description::{Causality, FmiVersion, ModelVariable, Variability};

/// Makes the call on an instance that is in this state.
type Make<'b> = Box<dyn Fn(&Instance<'_>, Mode) -> Result<Status, NotDetermined> + 'b>;

struct Call<'b> {
    name: String,
    /// States that allow it.
    allowed: Vec<Mode>,
    /// States that a reader could take either way.
    open: Vec<Mode>,
    make: Make<'b>,
}

/// Every state but the first, in which a model can be evaluated.
const EVALUATED: [Mode; 4] = [Initialization, Event, Continuous, Terminated];

fn calls<'b>(session: &'b Session) -> Vec<Call<'b>> {
    let v2 = session.description.version == FmiVersion::V2;
    let mut list: Vec<Call<'b>> = Vec::new();
    let mut add = |name: &str, allowed: &[Mode], open: &[Mode], make: Make<'b>| {
        list.push(Call { name: name.into(), allowed: allowed.into(), open: open.into(), make });
    };
    let simple = |name: Simple| -> Make<'b> { Box::new(move |instance, _| instance.simple(name)) };
    add(
        "SetDebugLogging(false, 0)",
        &Mode::ALL,
        &[],
        Box::new(|instance, _| {
            instance.call("SetDebugLogging", |raw| raw.debug_logging(instance.handle, false, None, 0))
        }),
    );
    add("Reset", &Mode::ALL, &[], simple(Simple::Reset));
    let experiment = |instance: &Instance<'_>, name: &str| {
        instance.call(name, |raw| raw.experiment(instance.handle, None, session.start(), None))
    };
    if v2 {
        add("SetupExperiment", &[Instantiated], &[], Box::new(move |i, _| experiment(i, "SetupExperiment")));
    }
    add(
        "EnterInitializationMode",
        &[Instantiated],
        &[],
        Box::new(move |instance, mode| {
            if !v2 {
                return experiment(instance, "EnterInitializationMode");
            }
            if mode == Instantiated {
                let _ = experiment(instance, "SetupExperiment")?;
            }
            instance.simple(Simple::EnterInitializationMode)
        }),
    );
    add("ExitInitializationMode", &[Initialization], &[], simple(Simple::ExitInitializationMode));
    add("Terminate", &[Event, Continuous], &[], simple(Simple::Terminate));
    let update = if v2 { "NewDiscreteStates" } else { "UpdateDiscreteStates" };
    add(update, &[Event], &[], Box::new(|instance, _| instance.update().map(|(status, _)| status)));
    add(
        "EnterContinuousTimeMode",
        &[Event],
        &[],
        Box::new(|instance, mode| {
            if mode == Event {
                let _ = instance.iterate()?;
            }
            instance.simple(Simple::EnterContinuousTimeMode)
        }),
    );
    // In Event Mode, the table of FMI 2.0 allows it, and its text knows a use only for discrete FMUs.
    add("EnterEventMode", &[Continuous], &[Event], simple(Simple::EnterEventMode));
    add(
        "SetTime",
        &[Continuous],
        // FMI 2.0 allows it there for a purely discrete FMU, and does not say what that is.
        if v2 { &[Event] } else { &[] },
        Box::new(|instance, _| instance.set_time(instance.time.get())),
    );
    add(
        "CompletedIntegratorStep",
        &[Continuous],
        &[],
        Box::new(|instance, _| instance.completed().map(|(status, _)| status)),
    );
    vectors(session, &mut add);
    variables(session, &mut add);
    if session.exchange_saves() {
        add(
            "GetFMUState",
            &Mode::ALL,
            &[],
            Box::new(|instance, _| {
                let mut state = SavedState::NULL;
                instance.call("GetFMUState", |raw| raw.get_state(instance.handle, Some(&mut state)))
            }),
        );
    }
    if session.raw.has("DoStep") {
        add(
            "DoStep",
            &[],
            &[],
            Box::new(move |instance, _| {
                instance.call("DoStep", |raw| {
                    raw.do_step(instance.handle, instance.time.get(), session.h(), false, [true; 4]).map(|(s, _)| s)
                })
            }),
        );
    }
    if !v2 && session.raw.has("EnterStepMode") {
        add("EnterStepMode", &[], &[], simple(Simple::EnterStepMode));
    }
    list
}

type Add<'a, 'b> = &'a mut dyn FnMut(&str, &[Mode], &[Mode], Make<'b>);

/// States, derivatives, indicators, and partial derivatives.
fn vectors<'b>(session: &'b Session, add: Add<'_, 'b>) {
    let v2 = session.description.version == FmiVersion::V2;
    let (states, indicators) = (session.states(), session.indicators());
    let vector =
        |name, n| -> Make<'b> { Box::new(move |instance, _| instance.vector(name, n).map(|(status, ..)| status)) };
    if indicators > 0 {
        add("GetEventIndicators", &EVALUATED, &[], vector(Vector::GetEventIndicators, indicators));
    }
    if states == 0 {
        return;
    }
    add("GetContinuousStates", &EVALUATED, &[], vector(Vector::GetContinuousStates, states));
    let derivatives = if v2 { Vector::GetDerivatives } else { Vector::GetContinuousStateDerivatives };
    add(derivatives.as_str(), &EVALUATED, &[], vector(derivatives, states));
    let nominals: &[Mode] = if v2 { &Mode::ALL } else { &EVALUATED };
    add(
        "GetNominalsOfContinuousStates",
        nominals,
        &[Instantiated],
        vector(Vector::GetNominalsOfContinuousStates, states),
    );
    add(
        "SetContinuousStates",
        &[Continuous],
        &[],
        Box::new(move |instance, mode| {
            let x = if mode == Continuous { instance.states()? } else { vec![0.0; states] };
            instance.set_states(&x)
        }),
    );
    if session.exchange_flag("providesDirectionalDerivative") || session.exchange_flag("providesDirectionalDerivatives")
    {
        let reference = |v: Option<&&ModelVariable>| v.map(|v| v.value_reference);
        let known = session.description.states();
        let unknown: Vec<_> = session
            .description
            .derivatives
            .iter()
            .filter_map(|u| session.description.referenced(u.reference))
            .collect();
        if let (Some(known), Some(unknown)) = (reference(known.first()), reference(unknown.first())) {
            add(
                "GetDirectionalDerivative",
                &[Event, Continuous, Terminated],
                // Which unknowns there are in Initialization Mode depends on the list of initial unknowns.
                &[Initialization],
                Box::new(move |instance, _| {
                    let name = Sensitivity::GetDirectionalDerivative;
                    instance.sensitivity(name, [&[unknown], &[known]], &[1.0]).map(|(status, _)| status)
                }),
            );
        }
    }
}

/// Getting and setting variables.
fn variables<'b>(session: &'b Session, add: Add<'_, 'b>) {
    let v2 = session.description.version == FmiVersion::V2;
    let find = |fits: &dyn Fn(&ModelVariable) -> bool| {
        session.numeric().find(|v| v.clocks.is_empty() && !v.is_array() && fits(v))
    };
    if let Some(v) = find(&|v| v.causality == Causality::Output) {
        let allowed: &[Mode] = if v2 { &EVALUATED } else { &Mode::ALL };
        let make: Make<'b> = Box::new(move |instance, _| instance.get(v).map(|(status, _)| status));
        add("Get(output)", allowed, &[Instantiated], make);
    }
    let is_input = |v: &ModelVariable| v.causality == Causality::Input && v.base.is_float();
    let is_parameter = |v: &ModelVariable| v.causality == Causality::Parameter && settable(v) && v.base.is_float();
    let open: &[Mode] = if v2 { &[Instantiated] } else { &[] };
    let before: &[Mode] = if v2 { &[] } else { &[Instantiated] };
    let continuous = |v: &ModelVariable| is_input(v) && v.variability == Variability::Continuous;
    let discrete = |v: &ModelVariable| is_input(v) && v.variability == Variability::Discrete;
    let tunable = |v: &ModelVariable| is_parameter(v) && v.variability == Variability::Tunable;
    let fixed = |v: &ModelVariable| is_parameter(v) && v.variability == Variability::Fixed;
    let mut add_setter = |name: &str, fits: &dyn Fn(&ModelVariable) -> bool, allowed: &[Mode], open: &[Mode]| {
        if let Some((v, values)) = find(fits).and_then(|v| Some((v, session.different_value(v, 1.0)?))) {
            add(name, allowed, open, Box::new(move |instance, _| instance.set(v, &values)));
        }
    };
    add_setter("Set(continuous input)", &continuous, &[before, &[Initialization, Event, Continuous]].concat(), open);
    add_setter("Set(discrete input)", &discrete, &[before, &[Initialization, Event]].concat(), open);
    add_setter("Set(tunable parameter)", &tunable, &[Instantiated, Initialization, Event], &[]);
    add_setter("Set(fixed parameter)", &fixed, &[Instantiated, Initialization], &[]);
}

pub(super) fn minimal_run(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.exchange(Mode::Event)?;
    let mut importer = Importer::start(&instance)?;
    importer.run(10, &mut |_| Ok(()))?;
    let _ = instance.snapshot(&session.watched())?;
    if !importer.over {
        let status = instance.simple(Simple::Terminate)?;
        session.require(status.is_ok(), || format!("{} returned {status}", session.raw.name("Terminate")));
    }
    Ok(())
}

/// Functions that FMI 2.0 lists for Initialization Mode in its table, though a simulation needs them after it only.
const EARLY: [&str; 5] = [
    "GetContinuousStates",
    "GetDerivatives",
    "GetContinuousStateDerivatives",
    "GetEventIndicators",
    "GetNominalsOfContinuousStates",
];

fn is_early(call: &Call<'_>, mode: Mode) -> bool {
    matches!(mode, Instantiated | Initialization) && EARLY.contains(&call.name.as_str())
}

pub(super) fn allowed(session: &Session) -> Result<(), NotDetermined> {
    succeed(session, false)
}

pub(super) fn allowed_early(session: &Session) -> Result<(), NotDetermined> {
    succeed(session, true)
}

fn succeed(session: &Session, early: bool) -> Result<(), NotDetermined> {
    for call in calls(session) {
        for &mode in call.allowed.iter().filter(|mode| is_early(&call, **mode) == early) {
            session.case(|| {
                let instance = session.exchange(mode)?;
                let status = (call.make)(&instance, mode)?;
                session.require(status.is_ok(), || format!("{} in {mode:?} returned {status}", call.name));
                Ok(())
            });
        }
    }
    Ok(())
}

pub(super) fn refused(session: &Session) -> Result<(), NotDetermined> {
    for call in calls(session) {
        for mode in Mode::ALL {
            if call.allowed.contains(&mode) || call.open.contains(&mode) {
                continue;
            }
            session.case(|| {
                let instance = session.exchange(mode)?;
                let status = (call.make)(&instance, mode)?;
                session.require(status == Status::ERROR, || format!("{} in {mode:?} returned {status}", call.name));
                Ok(())
            });
        }
    }
    Ok(())
}
