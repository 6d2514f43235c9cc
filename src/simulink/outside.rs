//! The interface of an FMU in Simulink: its mode and step, ports, buses, parameters and flange.

use super::text::{Scope, identifier, number, row};
use anyhow::{Context, Result, bail, ensure};
use model_description::{BaseType, Causality, ModelDescription, ModelVariable, Terminal, TerminalsAndIcons};
use std::collections::BTreeMap;

/// Longest name of a parameter that the block FMU imports.
const LONGEST_PARAMETER: usize = 55;

/// Names of other blocks beside the ports.
const BLOCKS: [&str; 11] = [
    "FMU",
    "torque_source",
    "motion_sensor",
    "housing",
    "solver",
    "torque",
    "speed_of_shaft",
    "angle_of_shaft",
    "flange",
    "last_step",
    "rotor",
];

/// A port of the block FMU, in the order of the description.
#[derive(Clone, Debug)]
pub(super) struct Port {
    /// Name of the variable.
    pub(super) fmi: String,
    /// Name of its block in Simulink.
    pub(super) name: String,
    pub(super) about: String,
    pub(super) unit: Option<String>,
    /// Data type of a bus element; `None` for a port that stays outside the buses.
    pub(super) of: Option<&'static str>,
    /// Its start value as a MATLAB expression, if a constant can give it.
    pub(super) start: Option<String>,
}

/// A terminal's inputs or outputs: a bus.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Name of the port.
    pub(super) name: String,
    pub(super) about: String,
    /// Name of an element, and its port from 0.
    pub(super) elements: Vec<(String, usize)>,
}

/// A parameter, or an array that FMI 2.0 represents by its elements.
#[derive(Clone, Debug)]
pub(super) struct Setting {
    /// Names of the variables in the FMU.
    pub(super) fmi: Vec<String>,
    /// Field of the struct.
    pub(super) field: String,
    pub(super) about: String,
    pub(super) unit: Option<String>,
    pub(super) kind: Kind,
    /// MATLAB expressions, one for each variable.
    values: Vec<String>,
}

/// How the block's dialog takes a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// An edit field.
    Number,
    /// A check box.
    Truth,
    /// A list of items.
    Item,
}

impl Setting {
    /// The value of the field.
    pub(super) fn value(&self, indent: usize) -> String {
        match self.values.as_slice() {
            [one] => one.clone(),
            all => row(all, indent),
        }
    }

    /// The variables of the FMU with the expressions that give their values.
    pub(super) fn links(&self) -> impl Iterator<Item = (&str, String)> {
        let several = self.fmi.len() > 1;
        let expression = move |at: usize| {
            if several { format!("p.{}({})", self.field, at + 1) } else { format!("p.{}", self.field) }
        };
        self.fmi.iter().enumerate().map(move |(at, name)| (name.as_str(), expression(at)))
    }
}

/// The shaft whose torque the FMU gives: input ports of speed and angle, output port of the torque, from 0.
#[derive(Clone, Debug)]
pub(super) struct Flange {
    pub(super) speed: usize,
    pub(super) angle: Option<usize>,
    pub(super) torque: usize,
    /// Field with the inertia of the rotor, which is then outside.
    pub(super) inertia: Option<String>,
}

/// The FMU's interface in the script.
#[derive(Clone, Debug)]
pub(super) struct Outside {
    /// Communication step in s; `None` for Model Exchange.
    pub(super) step: Option<f64>,
    pub(super) stop: f64,
    /// Model Exchange is available in addition to Co-Simulation.
    pub(super) both: bool,
    pub(super) inputs: Vec<Port>,
    pub(super) outputs: Vec<Port>,
    pub(super) buses_in: Vec<Group>,
    pub(super) buses_out: Vec<Group>,
    pub(super) settings: Vec<Setting>,
    pub(super) flange: Option<Flange>,
    /// Variables omitted by the script, with reasons.
    pub(super) left: BTreeMap<&'static str, Vec<String>>,
}

impl Outside {
    /// Reads description and terminals; `step` replaces the communication step.
    ///
    /// # Errors
    /// The block FMU does not support the FMU, or the step does not fit it.
    pub(super) fn of(md: &ModelDescription, terminals: Option<&TerminalsAndIcons>, step: Option<f64>) -> Result<Self> {
        let interface = md.co_simulation.as_ref().or(md.model_exchange.as_ref());
        let identifier = interface.map_or("FMU", |interface| interface.model_identifier.as_str());
        ensure!(
            md.co_simulation.is_some() || md.model_exchange.is_some(),
            "has neither Co-Simulation nor Model Exchange; the block FMU of Simulink runs these two"
        );
        let clock = md.variables.iter().find(|v| v.base == BaseType::Clock || !v.clocks.is_empty());
        if let Some(v) = clock {
            bail!(
                "{}: the block FMU of Simulink has no clocks in its documentation; use an FMU without clocks",
                v.name
            );
        }
        let mut left = BTreeMap::new();
        let mut names = Scope::default();
        for block in BLOCKS.into_iter().chain([identifier]) {
            names.name(block);
        }
        let inputs = ports(md, Causality::Input, &mut names)?;
        let outputs = ports(md, Causality::Output, &mut names)?;
        let settings = settings(md, &mut left);
        let terminals = terminals.map(|t| t.terminals.as_slice()).unwrap_or_default();
        let mut outside = Self {
            step: step_of(md, step)?,
            stop: md.default_experiment.stop.filter(|t| t.is_finite() && *t > 0.0).unwrap_or(10.0),
            both: md.co_simulation.is_some() && md.model_exchange.is_some(),
            inputs,
            outputs,
            buses_in: Vec::new(),
            buses_out: Vec::new(),
            settings,
            flange: None,
            left,
        };
        outside.flange = terminals.iter().find_map(|t| outside.flange_of(t));
        if outside.flange.is_some() {
            outside.impose();
        }
        let bound: Vec<usize> = outside.flange.iter().flat_map(|f| [Some(f.speed), f.angle]).flatten().collect();
        (outside.buses_in, outside.buses_out) = outside.buses(terminals, &bound, &mut names);
        Ok(outside)
    }

    fn flange_of(&self, terminal: &Terminal) -> Option<Flange> {
        let member = |names: &[&str], ports: &[Port]| {
            let is = |m: &&model_description::Member| m.name.as_deref().is_some_and(|name| names.contains(&name));
            let found = terminal.members.iter().find(is)?;
            ports.iter().position(|p| p.fmi == found.variable && p.of == Some("double"))
        };
        Some(Flange {
            speed: member(&["speed", "w", "omega"], &self.inputs)?,
            angle: member(&["angle", "phi"], &self.inputs),
            torque: member(&["tau", "torque"], &self.outputs)?,
            inertia: None,
        })
    }

    /// Selects the imposed shaft, by the parameter `mechanics.imposed` of our FMUs, and the inertia that is then outside.
    fn impose(&mut self) {
        let Some(flag) =
            self.settings.iter_mut().find(|s| s.kind == Kind::Truth && s.fmi[0].ends_with("mechanics.imposed"))
        else {
            return;
        };
        flag.values = vec!["true".into()];
        let inertia = flag.fmi[0].strip_suffix("imposed").map(|head| format!("{head}J"));
        let field = self.settings.iter().find(|s| Some(&s.fmi[0]) == inertia.as_ref()).map(|s| s.field.clone());
        if let Some(flange) = &mut self.flange {
            flange.inertia = field;
        }
    }

    /// Buses of inputs and of outputs: terminals with two or more members of that direction.
    fn buses(&self, terminals: &[Terminal], bound: &[usize], names: &mut Scope) -> (Vec<Group>, Vec<Group>) {
        let mut taken = bound.to_vec();
        let (mut to, mut from) = (Vec::new(), Vec::new());
        for terminal in terminals {
            let group = |ports: &[Port], taken: &[usize], named: &[Group]| {
                let mut scope = Scope::default();
                let mut elements: Vec<(String, usize)> = Vec::new();
                for member in &terminal.members {
                    let port = ports.iter().position(|p| p.fmi == member.variable && p.of.is_some());
                    if let Some(at) = port.filter(|at| !taken.contains(at) && !elements.iter().any(|(_, e)| e == at)) {
                        let name = scope.name(member.name.as_deref().unwrap_or(&member.variable));
                        // An output has one line, and the line one name.
                        let other = |g: &Group| g.elements.iter().any(|(n, e)| *e == at && *n != name);
                        if !named.iter().any(other) {
                            elements.push((name, at));
                        }
                    }
                }
                elements
            };
            let about = terminal.description.clone().unwrap_or_default();
            let inward = group(&self.inputs, &taken, &[]);
            if inward.len() > 1 {
                taken.extend(inward.iter().map(|(_, at)| *at));
                to.push(Group {
                    name: names.name(&format!("{}_in", terminal.name)),
                    about: about.clone(),
                    elements: inward,
                });
            }
            let outward = group(&self.outputs, &[], &from);
            if outward.len() > 1 {
                from.push(Group { name: names.name(&format!("{}_out", terminal.name)), about, elements: outward });
            }
        }
        (to, from)
    }
}

/// The communication step: a multiple of the FMU's internal step.
fn step_of(md: &ModelDescription, asked: Option<f64>) -> Result<Option<f64>> {
    let Some(interface) = &md.co_simulation else {
        ensure!(asked.is_none(), "--step: the FMU is for Model Exchange only, and Simulink's solver chooses its steps");
        return Ok(None);
    };
    let positive = |x: &f64| x.is_finite() && *x > 0.0;
    let inner = interface.attribute("fixedInternalStepSize").and_then(|text| text.trim().parse().ok()).filter(positive);
    let default = &md.default_experiment;
    if let Some(step) = asked {
        ensure!(positive(&step), "--step {step}: expected a positive number of seconds");
        if let Some(inner) = inner {
            let ratio = step / inner;
            ensure!(
                ratio.round() >= 1.0 && (ratio - ratio.round()).abs() < 1e-6,
                "--step {step}: expected a multiple of the FMU's internal step, fixedInternalStepSize = {inner} s"
            );
        }
        let fixed = default.step.filter(positive).filter(|_| !interface.flag("canHandleVariableCommunicationStepSize"));
        if let Some(fixed) = fixed {
            ensure!(
                (step / fixed - 1.0).abs() < 1e-9,
                "--step {step}: the FMU has one communication step, {fixed} s (canHandleVariableCommunicationStepSize is false)"
            );
        }
        return Ok(Some(step));
    }
    let step = default.step.filter(positive).or(inner);
    // Without a recommendation in FMI: a thousandth of the default experiment, or 1 ms.
    let step = step.or_else(|| default.stop.filter(positive).map(|stop| stop / 1000.0)).unwrap_or(1e-3);
    Ok(Some(inner.map_or(step, |inner| inner * (step / inner - 1e-9).ceil().max(1.0))))
}

/// The ports of one direction.
fn ports(md: &ModelDescription, causality: Causality, names: &mut Scope) -> Result<Vec<Port>> {
    let port = |v: &ModelVariable| {
        let of = match v.base {
            BaseType::Binary => bail!("{}: the block FMU of Simulink has numeric and text ports, no Binary", v.name),
            _ if v.is_array() => None,
            BaseType::Enumeration | BaseType::String => None,
            BaseType::Boolean => Some("boolean"),
            BaseType::Float32 => Some("single"),
            base if base.is_float() => Some("double"),
            base => Some(integer(base)),
        };
        let cast = |(_, value): (Kind, String)| match of.or_else(|| v.base.is_integer().then(|| integer(v.base))) {
            None | Some("double" | "boolean") => value,
            Some(of) => format!("{of}({value})"),
        };
        let zero =
            if v.base == BaseType::Boolean { (Kind::Truth, "false".into()) } else { (Kind::Number, "0.0".into()) };
        let start = match v.base {
            BaseType::Enumeration | BaseType::String => None,
            _ => value(md, v).or_else(|| (!v.is_array()).then_some(zero)).map(cast),
        };
        Ok(Port {
            start,
            fmi: v.name.clone(),
            name: names.name(&v.name),
            about: v.description.clone().unwrap_or_default(),
            unit: v.unit.clone().filter(|unit| unit != "1"),
            of,
        })
    };
    md.variables.iter().filter(|v| v.causality == causality).map(port).collect()
}

/// Simulink's name of an integer type.
fn integer(base: BaseType) -> &'static str {
    match base {
        BaseType::Int8 => "int8",
        BaseType::UInt8 => "uint8",
        BaseType::Int16 => "int16",
        BaseType::UInt16 => "uint16",
        BaseType::UInt32 => "uint32",
        BaseType::Int64 => "int64",
        BaseType::UInt64 => "uint64",
        _ => "int32",
    }
}

/// The parameters that the struct has; the others go to `left`.
fn settings(md: &ModelDescription, left: &mut BTreeMap<&'static str, Vec<String>>) -> Vec<Setting> {
    let mut all: Vec<Setting> = Vec::new();
    let mut place: BTreeMap<String, usize> = BTreeMap::new();
    let mut fields = Scope::default();
    for v in &md.variables {
        let refused = match v.causality {
            Causality::StructuralParameter => Some("structural parameters keep the sizes of the FMU"),
            Causality::Parameter => refusal(v),
            _ => continue,
        };
        let read = refused.map_or_else(|| value(md, v), |_| None);
        let Some((kind, value)) = read else {
            left.entry(refused.unwrap_or("parameters without a readable start value"))
                .or_default()
                .push(v.name.clone());
            continue;
        };
        let element = v.name.strip_suffix(']').and_then(|head| head.split_once('['));
        let array =
            element.filter(|(_, index)| index.parse::<u32>().is_ok() && kind == Kind::Number).map(|(array, _)| array);
        if let Some(&at) = array.and_then(|array| place.get(array)) {
            all[at].fmi.push(v.name.clone());
            all[at].values.push(value);
            continue;
        }
        if let Some(array) = array {
            place.insert(array.into(), all.len());
        }
        all.push(Setting {
            fmi: vec![v.name.clone()],
            field: fields.name(array.unwrap_or(&v.name)),
            about: v.description.clone().unwrap_or_default(),
            unit: v.unit.clone().filter(|unit| unit != "1"),
            kind,
            values: vec![value],
        });
    }
    all
}

/// Why a parameter is not in the struct.
fn refusal(v: &ModelVariable) -> Option<&'static str> {
    let plain = v.base.is_float() || v.base.is_integer();
    if v.name.chars().count() > LONGEST_PARAMETER {
        Some("the block FMU imports names of at most 55 characters")
    } else if matches!(v.base, BaseType::String | BaseType::Binary) {
        Some("texts are set in the dialog of the block FMU")
    } else if v.dimensions.len() > 2 || (v.is_array() && !plain) {
        Some("arrays of items, truth values or three dimensions are set in the dialog of the block FMU")
    } else {
        None
    }
}

/// Kind and start value as a MATLAB expression.
fn value(md: &ModelDescription, v: &ModelVariable) -> Option<(Kind, String)> {
    let start = v.start.as_deref()?.trim();
    match v.base {
        BaseType::Boolean if v.is_array() => None,
        BaseType::Boolean => Some((Kind::Truth, (if matches!(start, "true" | "1") { "true" } else { "false" }).into())),
        BaseType::Enumeration => {
            let value: i64 = start.parse().ok()?;
            let items = &md.type_definition(v.declared_type.as_deref()?)?.items;
            let item = items.iter().find(|item| item.value == value)?;
            Some((Kind::Item, super::text::literal(&item.name, 8)))
        }
        base => {
            let one = |word: &str| {
                if base.is_float() { number_of(word) } else { word.parse::<i128>().ok().map(|i| i.to_string()) }
            };
            let words: Vec<String> = start.split_whitespace().map(one).collect::<Option<_>>()?;
            if !v.is_array() {
                return Some((Kind::Number, words.into_iter().next()?));
            }
            let shape = md.shape(v)?;
            let count: usize = shape.iter().product();
            let words = if words.len() == 1 { vec![words[0].clone(); count] } else { words };
            let columns = shape.last().copied().filter(|n| *n > 0 && words.len() == count)?;
            let rows: Vec<String> = words.chunks(columns).map(|words| row(words, 8)).collect();
            let whole = if rows.len() == 1 { rows[0].clone() } else { format!("[{}]", rows.join("; ...\n        ")) };
            Some((Kind::Number, whole))
        }
    }
}

/// A number of XML: `INF` and `NaN` are written as in XML schema.
fn number_of(word: &str) -> Option<String> {
    word.parse().ok().map(number)
}

/// The name of files, functions and models around this FMU.
pub(super) fn stem(md: &ModelDescription) -> Result<String> {
    let interface = md.co_simulation.as_ref().or(md.model_exchange.as_ref());
    let name = &interface.context("has neither Co-Simulation nor Model Exchange")?.model_identifier;
    // `_parameters` follows.
    Ok(identifier(name, 50))
}
