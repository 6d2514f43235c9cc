//! Writes the closed loop of plant and controller as an SSP, from the packed FMUs. Terminals connect them; the
//! remaining variables become connectors of the system, named as in `PmsmDrive`. Features that some importers do not
//! support are optional.

use crate::ssv;
use anyhow::{Context, Result};
use drive_tools::tune::setting::Value;
use fmu_import::{Fmu, Values as Read};
use fmu_pack::TOOL;
use fmu_pack::archive::{GenerationTime, PackedFile};
use fmu_system::cosimulation::{Settings, System};
use fmu_system::ssp::ssv::{Parameter, read};
use fmu_system::ssp::values::{self, Given};
use fmu_system::ssp::{DESCRIPTION, FMU_TYPE};
use model_description::{
    BaseType, BaseUnit, Causality, Element, ModelDescription, ModelVariable, Unit, format_number, parse_number,
};
use std::collections::BTreeMap;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

/// Name of the system.
const NAME: &str = "SensorlessDrive";

/// Names of the components, the FMUs, and their position in a diagram: lower left corner and width in the system's geometry.
pub const COMPONENTS: [(&str, &str, [f64; 2]); 2] =
    [("controller", "SensorlessController", [60.0, 50.0]), ("plant", "PmsmPlant", [240.0, 50.0])];

/// Terminals that connect them.
const TERMINALS: [&str; 2] = ["phases", "sensor"];

/// Width and height of a component in a diagram.
const SIZE: f64 = 100.0;

/// Parameter values for one of the components, with their file.
pub struct ComponentValues {
    /// Name of the component.
    pub component: String,
    /// Name of the file for errors.
    pub file: String,
    /// The text of the SSV file.
    pub text: String,
}

/// Features that not every importer supports.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Whether to connect Booleans. There is one: `enabled` of the controller to `enable` of the plant.
    pub gates: bool,
    /// Whether the system has a size in a diagram.
    pub geometry: bool,
    /// Whether the values of enumerations are the names of their items, as SSP 1.0 describes them. OMSimulator reads numbers only.
    pub names: bool,
}

/// A connector of the system.
struct Outside<'a> {
    name: String,
    variable: &'a ModelVariable,
    /// The connectors of components that it represents, with their components.
    inner: Vec<(&'static str, &'a str)>,
}

/// The files of an SSP around the FMUs in `folder`.
///
/// # Errors
/// An FMU cannot be read, or values do not fit; the error has file, line and remedy. The system is started once, to verify that
/// the file runs.
pub fn files(
    folder: &Path,
    parameters: &[ComponentValues],
    options: Options,
    moment: GenerationTime,
) -> Result<BTreeMap<String, PackedFile>> {
    let mut system = System::default();
    let mut files = BTreeMap::new();
    let mut put = |name: String, bytes: Vec<u8>| files.insert(name, PackedFile { bytes, executable: false });
    let mut descriptions = Vec::new();
    for (name, fmu, _) in COMPONENTS {
        let path = folder.join(fmu).with_extension("fmu");
        put(format!("resources/{fmu}.fmu"), fs::read(&path).with_context(|| path.display().to_string())?);
        let fmu = Fmu::open(&path)?;
        descriptions.push((name, fmu.description().clone()));
        system.add(name, &fmu, false)?;
    }
    let mut connections = Vec::new();
    let [(one, ..), (other, ..)] = COMPONENTS;
    for terminal in TERMINALS {
        connections.extend(system.connect_terminals(&format!("{one}.{terminal}"), &format!("{other}.{terminal}"))?);
    }
    let is_number = |port: &str| {
        let variable = |(name, md): &(&str, ModelDescription)| {
            Some(md.variable(port.strip_prefix(name)?.strip_prefix('.')?)?.base.is_float())
        };
        descriptions.iter().find_map(variable) == Some(true)
    };
    connections.retain(|(from, _)| options.gates || is_number(from));
    let mut given: Vec<(&str, Parameter)> = Vec::new();
    for v in parameters {
        let read = read(&v.text).map_err(|cause| anyhow::anyhow!("{}: {cause}", v.file))?;
        values::set(&mut system, &Given::all(&v.component, &v.file, &read))?;
        let typed = typed(&system, &v.component, &read, options.names)?;
        let typed = typed.iter().map(|(name, value)| (name.as_str(), value));
        put(binding_file(&v.component), ssv::text_of(&v.component, typed).into_bytes());
        given.extend(read.into_iter().map(|p| (v.component.as_str(), p)));
    }
    start(&mut system, &descriptions).context("the system does not start with these values")?;
    let inputs = inputs(&descriptions, &connections);
    let starts = starts(&inputs, &given);
    let starts = starts.iter().map(|(name, value)| (name.as_str(), value));
    put(binding_file(NAME), ssv::text_of(NAME, starts).into_bytes());
    let of_components: Vec<&str> = parameters.iter().map(|v| v.component.as_str()).collect();
    let step = step(&descriptions, &given);
    let outputs = outputs(&descriptions);
    let xml = description(&descriptions, &connections, &inputs, &outputs, &of_components, (options, step), moment);
    put(DESCRIPTION.into(), xml.into_bytes());
    Ok(files)
}

/// The values, each converted to the type of its variable: OMSimulator does not convert, and ignores a value of another type.
fn typed(system: &System, component: &str, given: &[Parameter], names: bool) -> Result<Vec<(String, Value)>> {
    let Some(instance) = system.instances().iter().find(|i| i.name() == component) else { return Ok(Vec::new()) };
    let md = instance.description();
    let one = |p: &Parameter| {
        let items = md.variable(&p.name).and_then(|v| md.type_definition(v.declared_type.as_ref()?)).map(|d| &d.items);
        let name = |value: i128| items?.iter().find(|i| i128::from(i.value) == value).map(|i| i.name.clone());
        let value = match instance.parse(&p.name, &p.value)? {
            Read::Reals(x) => x.first().copied().map(Value::Real),
            Read::Integers(x) => x.first().and_then(|&x| match name(x).filter(|_| names) {
                Some(item) => Some(Value::Item(item)),
                None => i32::try_from(x).ok().map(Value::Integer),
            }),
            Read::Booleans(x) => x.first().copied().map(Value::Boolean),
            Read::Strings(_) | Read::Binaries(_) => None,
        };
        let value = value.with_context(|| format!("line {}: {} has no value for an SSV file", p.line, p.name))?;
        Ok((p.name.clone(), value))
    };
    given.iter().map(one).collect()
}

fn binding_file(name: &str) -> String {
    format!("resources/{name}.ssv")
}

/// One step, which checks that the values are consistent.
fn start(system: &mut System, descriptions: &[(&str, ModelDescription)]) -> Result<()> {
    let step = descriptions.iter().filter_map(|(_, d)| d.default_experiment.step).fold(f64::INFINITY, f64::min);
    let step = if step.is_finite() { step } else { 1e-4 };
    let settings = Settings { start: 0.0, stop: step, step, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(())))?;
    Ok(())
}

/// Numeric inputs that no terminal feeds; inputs of the same name in both components become one of the system. Truth values
/// (`enable`) keep the start values of the FMUs: an importer that sets every input of a system to 0 would switch the drive off.
fn inputs<'a>(
    descriptions: &'a [(&'static str, ModelDescription)],
    connections: &[(String, String)],
) -> Vec<Outside<'a>> {
    let mut found: Vec<Outside<'a>> = Vec::new();
    for (component, md) in descriptions {
        for variable in md.variables.iter().filter(|v| v.causality == Causality::Input && v.base.is_float()) {
            let port = format!("{component}.{}", variable.name);
            if connections.iter().any(|(_, to)| *to == port) {
                continue;
            }
            let inner = (*component, variable.name.as_str());
            match found.iter_mut().find(|o| o.name == variable.name) {
                Some(outside) => outside.inner.push(inner),
                None => found.push(Outside { name: variable.name.clone(), variable, inner: vec![inner] }),
            }
        }
    }
    found
}

/// All outputs. If both components have a name, it denotes the plant's output; the controller's is an estimate.
fn outputs<'a>(descriptions: &'a [(&'static str, ModelDescription)]) -> Vec<Outside<'a>> {
    let outputs =
        |md: &'a ModelDescription| md.variables.iter().filter(|v| v.causality == Causality::Output && has_type(v));
    let plant = |name: &str| {
        descriptions.iter().any(|(component, md)| *component == "plant" && outputs(md).any(|v| v.name == name))
    };
    let one = |component: &'static str, variable: &'a ModelVariable| {
        let taken = component != "plant" && plant(&variable.name);
        let name = if taken { format!("{}_est", variable.name) } else { variable.name.clone() };
        Outside { name, variable, inner: vec![(component, variable.name.as_str())] }
    };
    descriptions.iter().flat_map(|(component, md)| outputs(md).map(|v| one(component, v))).collect()
}

/// Start values of the system's inputs: those given for the components, or the FMUs' own.
fn starts(inputs: &[Outside<'_>], given: &[(&str, Parameter)]) -> Vec<(String, Value)> {
    let start = |o: &Outside<'_>| {
        let of_inner =
            |(c, p): &&(&str, Parameter)| o.inner.iter().any(|(component, name)| c == component && p.name == *name);
        let text = given.iter().rev().find(of_inner).map(|(_, p)| p.value.as_str()).or(o.variable.start.as_deref());
        Some((o.name.clone(), Value::Real(parse_number(text?)?)))
    };
    inputs.iter().filter_map(start).collect()
}

/// The communication step in s: the controller's sample period.
fn step(descriptions: &[(&str, ModelDescription)], given: &[(&str, Parameter)]) -> f64 {
    let start = || descriptions.iter().find_map(|(_, md)| md.variable("T_s")?.start.as_deref());
    let given = given.iter().rev().find(|(_, p)| p.name == "T_s").map(|(_, p)| p.value.as_str());
    given.or_else(start).and_then(parse_number).unwrap_or(1e-4)
}

/// For OMSimulator: its master with a fixed step (Jacobi), which reads all outputs before it sets any input. The command line
/// reads the element inside (oms.xsd, SystemWC.cpp), the Python package the attributes under a different name (system.py).
fn master(step: f64) -> Element {
    let master = Element::new("oms:FixedStepMaster")
        .with("description", "oms-ma")
        .with("stepSize", format_number(step))
        .with("relativeTolerance", format_number(1e-4));
    let information = Element::new("oms:SimulationInformation")
        .with("name", "oms_ma_default")
        .with("method", "oms_ma")
        .with("fixedStepSize", format_number(step))
        .children([master]);
    for_omsimulator(information)
}

/// For OMSimulator: its file of results, with every communication point. Without it, OMSimulator warns of deprecated content
/// (Model.cpp, `importFromSnapshot`).
fn results() -> Element {
    let information = Element::new("oms:SimulationInformation")
        .with("resultFile", format!("{NAME}_res.mat"))
        .with("loggingInterval", "0")
        .with("bufferSize", "10");
    for_omsimulator(information)
}

fn for_omsimulator(information: Element) -> Element {
    let annotation = Element::new("ssc:Annotation")
        .with("type", "org.openmodelica")
        .children([Element::new("oms:Annotations").children([information])]);
    Element::new("ssd:Annotations").children([annotation])
}

/// SystemStructure.ssd.
fn description(
    descriptions: &[(&'static str, ModelDescription)],
    connections: &[(String, String)],
    inputs: &[Outside<'_>],
    outputs: &[Outside<'_>],
    of_components: &[&str],
    (options, step): (Options, f64),
    moment: GenerationTime,
) -> String {
    let outside = |kind: &str, all: &[Outside<'_>]| -> Vec<Element> {
        all.iter().map(|o| connector(&o.name, kind, o.variable)).collect()
    };
    let components = COMPONENTS.iter().zip(descriptions).map(|((name, fmu, corner), (_, md))| {
        let [x, y] = corner;
        let bound = of_components.contains(name).then(|| binding(name));
        let fed = |v: &ModelVariable| connections.iter().any(|(_, to)| *to == format!("{name}.{}", v.name));
        let connected = |v: &&ModelVariable| match v.causality {
            Causality::Input => v.base.is_float() || fed(v),
            causality => causality == Causality::Output && has_type(v),
        };
        let connectors = md.variables.iter().filter(connected).map(|v| connector(&v.name, v.causality.as_str(), v));
        Element::new("ssd:Component")
            .with("name", *name)
            .with("type", FMU_TYPE)
            .with("source", format!("resources/{fmu}.fmu"))
            .with("implementation", "CoSimulation")
            .children([Element::new("ssd:Connectors").children(connectors)])
            .children([corners("ssd:ElementGeometry", [*x, *y, x + SIZE, y + SIZE])])
            .children(bound)
    });
    let from_outside = inputs
        .iter()
        .flat_map(|o| o.inner.iter().map(|(element, name)| connection((None, &o.name), (Some(element), name))));
    let inside = connections.iter().map(|(from, to)| connection(split(from), split(to)));
    let to_outside = outputs
        .iter()
        .flat_map(|o| o.inner.iter().map(|(element, name)| connection((Some(element), name), (None, &o.name))));
    let all: Vec<Element> = from_outside.chain(inside).chain(to_outside).collect();
    let system = Element::new("ssd:System")
        .with("name", NAME)
        .with(
            "description",
            "Sensorless drive of a permanent-magnet synchronous machine. Exchange values at every communication point, all \
             outputs before all inputs, at a step of T_s of the controller or a divisor: then timing.delay = 1 is true.",
        )
        .children([Element::new("ssd:Connectors").children(outside("input", inputs)).children(outside("output", outputs))])
        .children([binding(NAME)])
        .children([Element::new("ssd:Elements").children(components)])
        .children([Element::new("ssd:Connections").children(all)])
        .children(options.geometry.then(|| corners("ssd:SystemGeometry", [0.0, 0.0, 400.0, 200.0])))
        .children([master(step)]);
    let experiments = || descriptions.iter().map(|(_, md)| md.default_experiment);
    let time = |t: Option<f64>| t.map(format_number);
    let experiment = Element::new("ssd:DefaultExperiment")
        .with_some("startTime", time(experiments().filter_map(|x| x.start).reduce(f64::min)))
        .with_some("stopTime", time(experiments().filter_map(|x| x.stop).reduce(f64::max)))
        .children([results()]);
    let root = Element::new("ssd:SystemStructureDescription")
        .with("xmlns:ssd", "http://ssp-standard.org/SSP1/SystemStructureDescription")
        .with("xmlns:ssc", "http://ssp-standard.org/SSP1/SystemStructureCommon")
        .with("xmlns:oms", "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd")
        .with("version", "1.0")
        .with("name", NAME)
        .with("generationTool", TOOL)
        .with("generationDateAndTime", moment.date_and_time())
        .children([system, units(descriptions), experiment]);
    root.to_xml()
}

fn split(port: &str) -> (Option<&str>, &str) {
    port.split_once('.').map_or((None, port), |(element, name)| (Some(element), name))
}

fn connection(start: (Option<&str>, &str), end: (Option<&str>, &str)) -> Element {
    Element::new("ssd:Connection")
        .with_some("startElement", start.0)
        .with("startConnector", start.1)
        .with_some("endElement", end.0)
        .with("endConnector", end.1)
}

fn binding(name: &str) -> Element {
    let one = Element::new("ssd:ParameterBinding").with("source", binding_file(name));
    Element::new("ssd:ParameterBindings").children([one])
}

/// Whether a connector can express the type of the variable. OMSimulator stops at a connector without a start value, and an
/// enumeration also needs its items in a file.
fn has_type(variable: &ModelVariable) -> bool {
    !matches!(variable.base, BaseType::Enumeration | BaseType::String | BaseType::Binary | BaseType::Clock)
}

fn connector(name: &str, kind: &str, variable: &ModelVariable) -> Element {
    let base = match variable.base {
        BaseType::Float32 | BaseType::Float64 => {
            let unit = variable.unit.as_deref().filter(|u| !u.is_empty());
            Some(Element::new("ssc:Real").with_some("unit", unit))
        }
        BaseType::Boolean => Some(Element::new("ssc:Boolean")),
        BaseType::Enumeration | BaseType::String | BaseType::Binary | BaseType::Clock => None,
        _ => Some(Element::new("ssc:Integer")),
    };
    Element::new("ssd:Connector").with("name", name).with("kind", kind).children(base)
}

/// The units of all connectors.
fn units(descriptions: &[(&str, ModelDescription)]) -> Element {
    let mut used: Vec<&Unit> = Vec::new();
    for (_, md) in descriptions {
        let connected = |v: &&ModelVariable| match v.causality {
            Causality::Input => v.base.is_float(),
            causality => causality == Causality::Output && has_type(v),
        };
        for unit in md.variables.iter().filter(connected).filter_map(|v| md.unit(v.unit.as_deref()?)) {
            if !used.iter().any(|u| u.name == unit.name) {
                used.push(unit);
            }
        }
    }
    used.sort_by(|a, b| a.name.cmp(&b.name));
    let unit = |u: &&Unit| {
        let base = u.base.map_or(Element::new("ssc:BaseUnit"), |base| {
            let exponents = BaseUnit::NAMES.into_iter().zip(base.exponents).filter(|(_, n)| *n != 0);
            let element = exponents.fold(Element::new("ssc:BaseUnit"), |e, (name, n)| e.with(name, n.to_string()));
            let differs = |x: f64, default: f64| (x.to_bits() != default.to_bits()).then(|| format_number(x));
            element.with_some("factor", differs(base.factor, 1.0)).with_some("offset", differs(base.offset, 0.0))
        });
        Element::new("ssc:Unit").with("name", &*u.name).children([base])
    };
    Element::new("ssd:Units").children(used.iter().map(unit))
}

fn corners(name: &str, corners: [f64; 4]) -> Element {
    let names = ["x1", "y1", "x2", "y2"];
    names.into_iter().zip(corners).fold(Element::new(name), |e, (name, x)| e.with(name, format_number(x)))
}
