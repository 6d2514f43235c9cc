//! `ModelVariables`: the variables in the order of their value references, and in FMI 3.0 time behind them.
//!
//! FMI 3.0 requires the independent variable, FMI 2.0 allows it. Our FMI 2.0 archives omit it: OpenModelica's importer creates a
//! component for every variable, and Modelica reserves the name `time`. OMSimulator treats value references of FMI 3.0
//! as positions in the list, counted from 1 (ComponentFMU3CS.cpp, `initializeDependencyGraph_outputs`). Time has value reference
//! 0; with time at the end, the two agree.
//!
//! FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7. Unit and display unit are written on the variable as well as in its type
//! definition: both standards allow it, and importers that ignore type definitions need it.

use crate::number;
use crate::version::FmiVersion;
use crate::xml::Element;
use fmu_core::Description;
use fmu_core::description::{TIME, Value, Variable, VariableKind};
use fmu_core::unit::SECOND;
use fmu_core::variable::position;
use fmu_core::{Bytes, Causality, IntegerType, Range, Ticks, Timing, Variability};

/// All variables.
pub(super) fn variables(description: &Description, version: FmiVersion) -> Element {
    let indicators = description.model_exchange.as_ref().map_or(&[][..], |exchange| &exchange.indicators);
    // FMI 2.0 has no variables for event indicators.
    let shown = |v: &&Variable| version == FmiVersion::V3 || !indicators.contains(&v.value_reference);
    let variables = description.variables.iter().filter(shown).flat_map(|v| match version {
        FmiVersion::V2 => scalars(v, description),
        FmiVersion::V3 => vec![variable(v)],
    });
    let all = Element::new("ModelVariables");
    match version {
        FmiVersion::V2 => all.children(variables),
        FmiVersion::V3 => all.children(variables).children([time()]),
    }
}

/// The independent variable: no start value, no `initial`.
fn time() -> Element {
    Element::new("Float64")
        .with("name", "time")
        .with("valueReference", TIME.to_string())
        .with("description", "Simulation time")
        .with("causality", "independent")
        .with("variability", "continuous")
        .with("unit", SECOND.unit.name)
}

/// FMI 2.0 has no arrays: one scalar per element, `name[1]` the first (2.0.5, 2.2.9).
fn scalars(v: &Variable, description: &Description) -> Vec<Element> {
    let state = v.derivative.map(|reference| index(description, reference));
    let element = |name: &str, offset: u32, start: Option<&Value>| {
        let state = state.map(|first| (first + offset as usize).to_string());
        let mut typed = Element::new(match v.kind {
            VariableKind::Real { .. } => "Real",
            VariableKind::Integer(_) => "Integer",
            VariableKind::Boolean => "Boolean",
            VariableKind::Enumeration { .. } => "Enumeration",
            // They do not occur in archives of FMI 2.0.
            VariableKind::Text | VariableKind::Binary { .. } | VariableKind::Clock(_) => "String",
        });
        typed.attributes = type_attributes(v, FmiVersion::V2);
        typed =
            typed.with_some("derivative", state).with_some("start", start.map(|value| text(v, value, FmiVersion::V2)));
        identity("ScalarVariable", v, FmiVersion::V2, name, v.value_reference.saturating_add(offset)).children([typed])
    };
    let start = |i: usize| v.start.as_ref().and_then(|all| all.get(i));
    if !v.is_array() {
        return vec![element(&v.name, 0, start(0))];
    }
    let of_array = |(i, k)| element(&element_name(v, i), k, start(i));
    (0..v.elements()).zip(0..).map(of_array).collect()
}

/// Name of an element: `x[1]`, and `der(x[1])` of a derivative.
fn element_name(v: &Variable, i: usize) -> String {
    let at = position(&v.shape, i);
    match v.name.strip_suffix(')').filter(|_| v.derivative.is_some()) {
        Some(name) => format!("{name}{at})"),
        None => format!("{}{at}", v.name),
    }
}

/// Position in the list of FMI 2.0, from 1.
fn index(description: &Description, reference: u32) -> usize {
    let before = description.variables.iter().take_while(|v| v.value_reference != reference);
    1 + before.map(Variable::elements).sum::<usize>()
}

/// One variable of FMI 3.0, scalar or array.
fn variable(v: &Variable) -> Element {
    let base = match v.kind {
        VariableKind::Real { single: false, .. } => "Float64",
        VariableKind::Real { single: true, .. } => "Float32",
        VariableKind::Integer(of) => of.name(),
        VariableKind::Boolean => "Boolean",
        VariableKind::Enumeration { .. } => "Enumeration",
        VariableKind::Text => "String",
        VariableKind::Clock(timing) => return clock(v, &timing),
        VariableKind::Binary { .. } => "Binary",
    };
    let mut element = identity(base, v, FmiVersion::V3, &v.name, v.value_reference)
        .with_some("clocks", on_clocks(v))
        .with_some("intermediateUpdate", v.intermediate.then_some("true"));
    element.attributes.extend(type_attributes(v, FmiVersion::V3));
    let starts: Option<Vec<String>> =
        v.start.as_ref().map(|all| all.iter().map(|value| text(v, value, FmiVersion::V3)).collect());
    let dimension = |attribute: &str, n: String| Element::new("Dimension").with(attribute, n);
    let fixed = v.shape.iter().filter(|_| v.sized.is_empty()).map(|n| dimension("start", n.to_string()));
    let dimensions = fixed.chain(v.sized.iter().map(|n| dimension("valueReference", n.to_string())));
    let aliases = v.aliases.iter().map(|alias| {
        Element::new("Alias")
            .with("name", &alias.name)
            .with_text("description", &alias.description)
            .with_some("displayUnit", alias.display.as_ref().map(|(name, ..)| name.as_str()))
    });
    if matches!(v.kind, VariableKind::Text | VariableKind::Binary { .. }) {
        let starts = starts.into_iter().flatten().map(|value| Element::new("Start").with("value", value));
        return element.children(dimensions).children(starts).children(aliases);
    }
    let state = v.derivative.map(|reference| reference.to_string());
    let start = starts.map(|all| all.join(" "));
    element.with_some("derivative", state).with_some("start", start).children(dimensions).children(aliases)
}

/// The value references of the clocks that a variable is on.
fn on_clocks(v: &Variable) -> Option<String> {
    let list: Vec<String> = v.clocks.iter().map(u32::to_string).collect();
    (!list.is_empty()).then(|| list.join(" "))
}

/// FMI 3.0.2, 2.4.4.
fn clock(v: &Variable, timing: &Timing) -> Element {
    let interval = timing.interval.or(match v.start.as_deref() {
        Some([Value::Real(interval)]) => Some(*interval),
        _ => None,
    });
    let ticks = match timing.ticks {
        Ticks::Constant => "constant",
        Ticks::Fixed => "fixed",
        Ticks::Tunable => "tunable",
        Ticks::Changing => "changing",
        Ticks::Countdown => "countdown",
        Ticks::Triggered => "triggered",
    };
    let shift = (timing.shift > 0.0).then(|| number::format(timing.shift));
    let fraction = timing.fraction.map(|(counter, resolution)| (counter.to_string(), resolution.to_string()));
    let shifted = timing.shift_counter().filter(|counter| *counter > 0).map(|counter| counter.to_string());
    Element::new("Clock")
        .with("name", &*v.name)
        .with("valueReference", v.value_reference.to_string())
        .with_text("description", &v.description)
        .with("causality", if v.causality == Causality::Output { "output" } else { "input" })
        .with_some("clocks", on_clocks(v))
        .with("intervalVariability", ticks)
        .with_some("intervalDecimal", interval.map(number::format))
        .with_some("shiftDecimal", shift)
        .with_some("supportsFraction", fraction.is_some().then_some("true"))
        .with_some("resolution", fraction.as_ref().map(|(_, resolution)| resolution.clone()))
        .with_some("intervalCounter", fraction.map(|(counter, _)| counter))
        .with_some("shiftCounter", shifted)
        .with_some("priority", timing.priority.map(|priority| priority.to_string()))
}

/// Causality and variability. FMI 2.0 has no structural parameters: their values stay.
fn who(v: &Variable, version: FmiVersion) -> (Causality, Variability) {
    if version == FmiVersion::V2 && v.causality == Causality::StructuralParameter {
        return (Causality::Local, Variability::Constant);
    }
    (v.causality, v.variability)
}

/// The properties of the variable that do not depend on its base type.
fn identity(element: &str, v: &Variable, version: FmiVersion, name: &str, value_reference: u32) -> Element {
    let (causality, variability) = who(v, version);
    let exact = v.exact || variability == Variability::Constant;
    let (causality, initial) = match causality {
        Causality::StructuralParameter => ("structuralParameter", Some("exact")),
        Causality::Local if exact => ("local", Some("exact")),
        Causality::Output if exact => ("output", Some("exact")),
        Causality::Parameter => ("parameter", Some("exact")),
        Causality::CalculatedParameter => ("calculatedParameter", Some("calculated")),
        // FMI 2.0 forbids `initial` on an input, FMI 3.0 allows only the default.
        Causality::Input => ("input", None),
        Causality::Output => ("output", Some("calculated")),
        Causality::Local => ("local", Some("calculated")),
    };
    let variability = match variability {
        Variability::Fixed => "fixed",
        Variability::Tunable => "tunable",
        Variability::Discrete => "discrete",
        Variability::Continuous => "continuous",
        Variability::Constant => "constant",
    };
    Element::new(element)
        .with("name", name)
        .with("valueReference", value_reference.to_string())
        .with_text("description", &v.description)
        .with("causality", causality)
        .with("variability", variability)
        .with_some("initial", initial)
}

/// Type definition, unit and bounds. The XML cannot express a strict bound, so it is written like any other; the FMU
/// refuses the bound itself and gives the reason.
fn type_attributes(v: &Variable, version: FmiVersion) -> Vec<(String, String)> {
    let element = Element::default();
    let element = match &v.kind {
        VariableKind::Real { quantity, unit, display, relative, single, .. } => {
            let display = display.as_ref().map(|(name, ..)| name.as_str()).filter(|_| !unit.is_empty());
            // Type definitions are of double precision.
            let declared = if *single && version == FmiVersion::V3 { "quantity" } else { "declaredType" };
            element
                .with_text(declared, quantity)
                .with_text("unit", unit)
                .with_some("displayUnit", display)
                .with_some("relativeQuantity", relative.then_some("true"))
                .with_some("min", v.min.map(number::format))
                .with_some("max", v.max.map(number::format))
                // A magnitude, greater than 0 in both standards.
                .with_some("nominal", v.nominal.map(|x| number::format(x.abs())))
                .with_some("unbounded", v.unbounded.then(|| "true".to_owned()))
                .with_some("reinit", v.reinit.then(|| "true".to_owned()))
        }
        VariableKind::Integer(of) => {
            // Rounded inwards, and omitted where the type has no value outside: in FMI 2.0 that is xs:int for all of them.
            let carried = if version == FmiVersion::V2 { IntegerType::Int32 } else { *of };
            let ((low, high), (least, greatest)) =
                (of.within(&Range { above: false, below: false, ..v.range() }), carried.bounds());
            element
                .with_some("min", (low > least && low <= greatest).then(|| low.to_string()))
                .with_some("max", (high < greatest && high >= least).then(|| high.to_string()))
        }
        VariableKind::Boolean | VariableKind::Text | VariableKind::Clock(_) => element,
        VariableKind::Binary { mime_type, most } => {
            element.with("mimeType", mime_type).with("maxSize", most.to_string())
        }
        VariableKind::Enumeration { name, .. } => element.with("declaredType", name),
    };
    element.attributes
}

fn text(v: &Variable, value: &Value, version: FmiVersion) -> String {
    match value {
        // The shortest text that reads back as the same number in single precision; FMI 2.0 reads double precision.
        #[expect(clippy::cast_possible_truncation, reason = "exact")]
        Value::Real(x) if version == FmiVersion::V3 && matches!(v.kind, VariableKind::Real { single: true, .. }) => {
            number::format((*x as f32).to_string().parse().unwrap_or(*x))
        }
        Value::Real(x) => number::format(*x),
        Value::Integer(x) => x.to_string(),
        Value::Boolean(x) => x.to_string(),
        Value::Text(x) => x.clone(),
        Value::Binary(x) => Bytes::from(x).to_string(),
    }
}
