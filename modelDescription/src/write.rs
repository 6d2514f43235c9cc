//! The neutral description as modelDescription.xml of either standard.

mod structure;
mod terminals;
mod types;
mod variables;

pub use terminals::write_terminals;

use crate::number;
use crate::version::FmiVersion;
use crate::xml::{Element, print};
use fmu_core::description::{ModelExchange, Value, VariableKind};
use fmu_core::{Description, Keeps};

/// The tool and the time of generation: the only content that does not follow from the description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Generation {
    /// Name and version of the tool.
    pub tool: String,
    /// `YYYY-MM-DDThh:mm:ssZ`, see [`date_from_epoch`](crate::date_from_epoch).
    pub date_and_time: String,
}

/// modelDescription.xml of an FMU; equal arguments give equal text.
pub fn write(description: &Description, version: FmiVersion, generation: &Generation) -> String {
    let units = types::units(description, version);
    let definitions = types::definitions(description, version);
    let only = description.model_exchange.as_ref().is_some_and(|exchange| exchange.only);
    let root = header(description, version, generation).children(
        // The order of the schemas.
        [
            description.model_exchange.as_ref().map(|exchange| model_exchange(description, exchange, version)),
            (!only).then(|| co_simulation(description, version)),
            description
                .model_exchange
                .as_ref()
                .filter(|of| of.scheduled)
                .map(|_| scheduled_execution(description, version)),
            units,
            definitions,
            Some(log_categories(description, version)),
            Some(experiment(description)),
            Some(variables::variables(description, version)),
            Some(structure::structure(description, version)),
        ]
        .into_iter()
        .flatten(),
    );
    print(&root)
}

/// Checks that the standard supports the variables: FMI 2.0 needs at least one, and its Integer has 32 bits.
///
/// # Errors
/// Names the variable, its value and the remedy.
pub fn fits(description: &Description, version: FmiVersion) -> Result<(), String> {
    if version == FmiVersion::V2 && description.variables.is_empty() {
        let name = &description.name;
        return Err(format!(
            "{name} has no variable, and FMI 2.0 needs at least one: add one, or build for FMI 3.0 only, which has time"
        ));
    }
    if let Some(why) = description.needs_fmi3().filter(|_| version == FmiVersion::V2) {
        return Err(format!("{why}: build for FMI 3.0 only"));
    }
    let narrow = |value: &Value| matches!(value, Value::Integer(x) if i32::try_from(*x).is_err());
    for v in description.variables.iter().filter(|_| version == FmiVersion::V2) {
        if let (VariableKind::Integer(of), Some(Value::Integer(x))) =
            (&v.kind, v.start.iter().flatten().find(|value| narrow(value)))
        {
            let (name, of) = (&v.name, of.name());
            return Err(format!(
                "{name} starts with {x}, which does not fit a 32-bit FMI 2.0 Integer: choose another start value, or build for FMI 3.0 only, where it is {of}"
            ));
        }
    }
    Ok(())
}

/// FMI 2.0.5, 2.2.1; FMI 3.0.2, 2.4.1.
fn header(description: &Description, version: FmiVersion, generation: &Generation) -> Element {
    let token = match version {
        FmiVersion::V2 => "guid",
        FmiVersion::V3 => "instantiationToken",
    };
    Element::new("fmiModelDescription")
        .with("fmiVersion", version.to_string())
        .with("modelName", description.model_name())
        .with(token, &*description.token)
        .with_text("description", &description.description)
        .with_text("author", &description.author)
        .with_text("version", &description.version)
        .with_text("copyright", &description.copyright)
        .with_text("license", &description.license)
        .with_text("generationTool", &generation.tool)
        .with_text("generationDateAndTime", &generation.date_and_time)
        .with("variableNamingConvention", "structured")
        .with_some("numberOfEventIndicators", number_of_indicators(description, version))
}

/// FMI 2.0 counts the event indicators, FMI 3.0 lists them.
fn number_of_indicators(description: &Description, version: FmiVersion) -> Option<String> {
    let exchange = description.model_exchange.as_ref().filter(|_| version == FmiVersion::V2)?;
    Some(exchange.indicators.len().to_string())
}

/// FMI 2.0.5, 3.3.1; FMI 3.0.2, 2.4.2 and 3.4.
fn model_exchange(description: &Description, exchange: &ModelExchange, version: FmiVersion) -> Element {
    let (flag, needed) = match version {
        FmiVersion::V2 => ("completedIntegratorStepNotNeeded", false),
        FmiVersion::V3 => ("needsCompletedIntegratorStep", true),
    };
    let element = Element::new("ModelExchange")
        .with("modelIdentifier", &*description.name)
        .with("needsExecutionTool", "false")
        .with_some(flag, (needed == exchange.completed_steps).then_some("true"))
        .with("canBeInstantiatedOnlyOncePerProcess", "false");
    derivatives(description, states_and_memory(description, element, version), exchange, version)
}

/// The state can be read, set and serialized; memory.
fn states_and_memory(description: &Description, element: Element, version: FmiVersion) -> Element {
    let (element, saves, stores) = match version {
        // A Rust library has its own allocator; using it without this flag violates the standard.
        FmiVersion::V2 => {
            (element.with("canNotUseMemoryManagementFunctions", "true"), "canGetAndSetFMUstate", "canSerializeFMUstate")
        }
        FmiVersion::V3 => (element, "canGetAndSetFMUState", "canSerializeFMUState"),
    };
    element
        .with_some(saves, is_saved(description).then_some("true"))
        .with_some(stores, (description.keeps == Keeps::Stored).then_some("true"))
}

/// Whether the model can be copied: for saved states, and for derivatives, which are computed on a copy.
fn is_saved(description: &Description) -> bool {
    description.keeps != Keeps::Nothing
}

/// Directional and adjoint derivatives of a model with states.
fn derivatives(description: &Description, element: Element, exchange: &ModelExchange, version: FmiVersion) -> Element {
    if exchange.states.is_empty() || !is_saved(description) {
        return element;
    }
    match version {
        FmiVersion::V2 => element.with("providesDirectionalDerivative", "true"),
        FmiVersion::V3 => {
            element.with("providesDirectionalDerivatives", "true").with("providesAdjointDerivatives", "true")
        }
    }
}

/// FMI 2.0.5, 4.3.1; FMI 3.0.2, 2.4.2 and 4.4. Omitted attributes are `false` in both.
fn co_simulation(description: &Description, version: FmiVersion) -> Element {
    let exchange = description.model_exchange.as_ref();
    let continuous = exchange.is_some_and(|exchange| !exchange.states.is_empty()) && is_saved(description);
    let event_mode = version == FmiVersion::V3 && exchange.is_some_and(|exchange| exchange.event_mode);
    let intermediate = version == FmiVersion::V3 && description.variables.iter().any(|v| v.intermediate);
    let interpolates = if continuous { "true" } else { "false" };
    let element = Element::new("CoSimulation")
        .with("modelIdentifier", &*description.name)
        .with("needsExecutionTool", "false")
        .with("canHandleVariableCommunicationStepSize", "true")
        .with("canBeInstantiatedOnlyOncePerProcess", "false")
        .with_some("canInterpolateInputs", (version == FmiVersion::V2).then_some(interpolates))
        .with_some("maxOutputDerivativeOrder", continuous.then_some("1"));
    let fixed_step = description.experiment.fixed_step.filter(|_| version == FmiVersion::V3);
    let element = states_and_memory(description, element, version)
        .with_some("fixedInternalStepSize", fixed_step.map(number::format))
        .with_some("hasEventMode", event_mode.then_some("true"))
        .with_some("mightReturnEarlyFromDoStep", (event_mode && !clocked(description)).then_some("true"))
        .with_some("providesIntermediateUpdate", intermediate.then_some("true"))
        .with_some("canReturnEarlyAfterIntermediateUpdate", intermediate.then_some("true"));
    match exchange {
        Some(exchange) => derivatives(description, element, exchange, version),
        None => element,
    }
}

/// FMI 3.0.2, 2.4.2 and 5.4.
fn scheduled_execution(description: &Description, version: FmiVersion) -> Element {
    let element = Element::new("ScheduledExecution")
        .with("modelIdentifier", &*description.name)
        .with("needsExecutionTool", "false")
        .with("canBeInstantiatedOnlyOncePerProcess", "false");
    states_and_memory(description, element, version)
}

/// Whether the model has clocks, which FMI 3.0 has.
fn clocked(description: &Description) -> bool {
    description.variables.iter().any(|v| matches!(v.kind, VariableKind::Clock(_)))
}

/// FMI 2.0.5, 2.2.4; FMI 3.0.2, 2.4.5.
fn log_categories(description: &Description, version: FmiVersion) -> Element {
    let category = |(name, description): (&str, &str)| {
        Element::new("Category").with("name", name).with_text("description", description)
    };
    // FMI 3.0 dropped the category; an empty list of categories means all of them in both standards.
    let all = (version == FmiVersion::V2).then_some((fmu_core::log::ALL, "All messages"));
    let own = description.categories.iter().map(|(name, about)| (name.as_str(), about.as_str()));
    let standard = fmu_core::log::CATEGORIES.iter().chain(&all).copied();
    Element::new("LogCategories").children(standard.chain(own).map(category))
}

/// FMI 2.0.5, 2.2.5; FMI 3.0.2, 2.4.6.
fn experiment(description: &Description) -> Element {
    let experiment = &description.experiment;
    Element::new("DefaultExperiment")
        .with("startTime", number::format(experiment.start))
        .with("stopTime", number::format(experiment.stop))
        .with_some("tolerance", experiment.tolerance.map(number::format))
        .with("stepSize", number::format(experiment.step))
}
