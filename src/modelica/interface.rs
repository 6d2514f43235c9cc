//! The mapping from an FMU to Modelica: ports from terminals, connectors from other inputs, parameters with their dialog.

use super::text::identifier;
use anyhow::{Context, Result, bail};
use model_description::{
    Area, BaseType, Causality, ModelDescription, ModelVariable, Terminal, TerminalsAndIcons, TypeDefinition,
};
use std::collections::BTreeMap;

/// The kind of a variable.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// A real number with unit and display unit.
    Real { unit: Option<String>, display: Option<String> },
    /// An integer.
    Integer,
    /// A truth value.
    Boolean,
    /// A text.
    Text,
    /// A named value: the type and its items.
    Enumeration { of: String, items: Vec<(i64, String)> },
}

/// A variable, or an array that FMI 2.0 represents by its elements.
#[derive(Clone, Debug)]
pub(super) struct Variable {
    /// Name in the FMU, without the index of an element.
    pub(super) fmi: String,
    /// Name in Modelica.
    pub(super) name: String,
    pub(super) about: String,
    pub(super) kind: Kind,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    /// Start values as Modelica literals; one for a scalar.
    pub(super) start: Vec<String>,
    /// Names of the elements in the imported block; empty for a scalar and for an array of FMI 3.0.
    pub(super) elements: Vec<String>,
    pub(super) is_array: bool,
}

impl Variable {
    /// The start value as an expression.
    pub(super) fn start(&self) -> String {
        if !self.is_array {
            return self.start[0].clone();
        }
        if self.start.iter().all(|x| *x == self.start[0]) {
            return format!("fill({}, {})", self.start[0], self.start.len());
        }
        format!("{{{}}}", self.start.join(", "))
    }

    /// Type and extent.
    pub(super) fn head(&self) -> String {
        let of = match &self.kind {
            Kind::Real { .. } => "Real".into(),
            Kind::Integer => "Integer".into(),
            Kind::Boolean => "Boolean".into(),
            Kind::Text => "String".into(),
            Kind::Enumeration { of, .. } => format!("Types.{of}"),
        };
        if self.is_array { format!("{of}[{}]", self.start.len()) } else { of }
    }

    /// Unit, display unit and bounds.
    pub(super) fn modifiers(&self) -> Vec<String> {
        let each = if self.is_array { "each " } else { "" };
        let mut all = Vec::new();
        if let Kind::Real { unit, display } = &self.kind {
            all.extend(unit.iter().map(|unit| format!("{each}unit=\"{unit}\"")));
            all.extend(display.iter().map(|unit| format!("{each}displayUnit=\"{unit}\"")));
        }
        if matches!(self.kind, Kind::Real { .. } | Kind::Integer) {
            all.extend(self.min.map(|x| format!("{each}min={x}")));
            all.extend(self.max.map(|x| format!("{each}max={x}")));
        }
        all
    }
}

/// The shaft's variables: names in Modelica.
#[derive(Clone, Debug)]
pub(super) struct Shaft {
    pub(super) speed: String,
    pub(super) angle: String,
    pub(super) tau: String,
}

/// A thermal port.
#[derive(Clone, Debug)]
pub(super) struct Heat {
    pub(super) name: String,
    pub(super) about: String,
    pub(super) temperature: String,
    pub(super) flow: String,
    pub(super) area: Option<Area>,
}

/// The FMU's interface in the wrapper.
#[derive(Clone, Debug)]
pub(super) struct Interface {
    pub(super) parameters: Vec<Variable>,
    pub(super) inputs: Vec<Variable>,
    pub(super) outputs: Vec<Variable>,
    pub(super) enumerations: Vec<TypeDefinition>,
    /// The shaft that turns inside the FMU.
    pub(super) shaft: Option<Shaft>,
    /// The shaft imposed by the drive train, the parameter that selects it, and the rotor's inertia.
    pub(super) imposed: Option<(Shaft, String, String)>,
    pub(super) heats: Vec<Heat>,
    /// Voltage and current of the DC link, and its position.
    pub(super) link: Option<(String, String, Option<Area>)>,
    /// Outputs that other terminals send as signals.
    pub(super) sent: Vec<String>,
}

impl Interface {
    /// Reads description and terminals.
    ///
    /// # Errors
    /// The FMU has no shaft terminal, or the wrapper does not support a variable.
    pub(super) fn of(md: &ModelDescription, terminals: Option<&TerminalsAndIcons>) -> Result<Self> {
        let terminals = terminals.map(|t| t.terminals.as_slice()).unwrap_or_default();
        let all = |causality| variables(md, causality);
        let mut interface = Self {
            parameters: all(Causality::Parameter)?,
            inputs: all(Causality::Input)?,
            outputs: all(Causality::Output)?,
            enumerations: md.types.iter().filter(|t| t.base == BaseType::Enumeration).cloned().collect(),
            shaft: None,
            imposed: None,
            heats: Vec::new(),
            link: None,
            sent: Vec::new(),
        };
        for terminal in terminals {
            interface.take(md, terminal);
        }
        if interface.shaft.is_none() && interface.imposed.is_none() {
            let names: Vec<&str> = terminals.iter().map(|t| t.name.as_str()).collect();
            let has =
                if names.is_empty() { "no terminals".into() } else { format!("the terminals {}", names.join(", ")) };
            bail!(
                "has no shaft for a flange: a terminal with the members speed, angle and the outflow tau; it has {has}. \
                 PmsmDrive, PmsmDriveMean, MappedDrive and PmsmPlant have one; for an FMU of signals, the imported block suffices"
            );
        }
        Ok(interface)
    }

    /// The port of a terminal, by the names of its members.
    fn take(&mut self, md: &ModelDescription, terminal: &Terminal) {
        let member = |name: &str, kind: &str| {
            let found = terminal.members.iter().find(|m| m.name.as_deref() == Some(name) && m.kind == kind)?;
            md.variable(&found.variable)
        };
        let is = |v: Option<&ModelVariable>, causality| v.is_some_and(|v| v.causality == causality);
        let area = terminal.picture.as_ref().map(|p| p.area);
        let of = |v: &ModelVariable| identifier(&v.name);
        let shaft = [member("speed", "signal"), member("angle", "signal"), member("tau", "outflow")];
        if let [Some(speed), Some(angle), Some(tau)] = shaft {
            let shaft = Shaft { speed: of(speed), angle: of(angle), tau: of(tau) };
            if is(Some(tau), Causality::Input) {
                self.shaft = Some(shaft);
            } else {
                let flag = self.parameters.iter().find(|p| p.fmi.ends_with("mechanics.imposed"));
                let inertia = flag.and_then(|flag| {
                    let name = format!("{}J", flag.fmi.strip_suffix("imposed")?);
                    self.parameters.iter().find(|p| p.fmi == name)
                });
                self.imposed = flag.zip(inertia).map(|(f, j)| (shaft, f.name.clone(), j.name.clone()));
            }
            return;
        }
        if let (Some(temperature), Some(heat)) = (member("T", "signal"), member("Q", "outflow"))
            && is(Some(temperature), Causality::Input)
        {
            self.heats.push(Heat {
                name: identifier(&terminal.name),
                about: terminal.description.clone().unwrap_or_default(),
                temperature: of(temperature),
                flow: of(heat),
                area,
            });
            return;
        }
        if let (Some(u), Some(i)) = (member("u_dc", "signal"), member("i_dc", "inflow"))
            && is(Some(u), Causality::Input)
        {
            self.link = Some((of(u), of(i), area));
            return;
        }
        let signals = terminal.members.iter().filter_map(|m| md.variable(&m.variable));
        self.sent.extend(signals.filter(|v| v.causality == Causality::Output).map(of));
    }

    /// The inputs without a port.
    pub(super) fn signals(&self) -> impl Iterator<Item = &Variable> {
        let mut taken: Vec<&str> = self.heats.iter().map(|h| h.temperature.as_str()).collect();
        taken.extend(self.link.iter().map(|(u, ..)| u.as_str()));
        taken.extend(self.shaft.iter().map(|s| s.tau.as_str()));
        taken.extend(self.imposed.iter().flat_map(|(s, ..)| [s.speed.as_str(), s.angle.as_str()]));
        self.inputs.iter().filter(move |v| !taken.contains(&v.name.as_str()))
    }

    /// An input.
    pub(super) fn input(&self, name: &str) -> Option<&Variable> {
        self.inputs.iter().find(|v| v.name == name)
    }
}

/// The variables of a causality, with an array as one.
fn variables(md: &ModelDescription, causality: Causality) -> Result<Vec<Variable>> {
    let mut all: Vec<Variable> = Vec::new();
    let mut place: BTreeMap<String, usize> = BTreeMap::new();
    for v in md.variables.iter().filter(|v| v.causality == causality && v.clocks.is_empty()) {
        let (fmi, element) = v.name.split_once('[').map_or((v.name.as_str(), false), |(array, _)| (array, true));
        let kind = kind(md, v)?;
        let start = starts(md, v, &kind).with_context(|| v.name.clone())?;
        if element && let Some(&at) = place.get(fmi) {
            all[at].start.extend(start);
            all[at].elements.push(identifier(&v.name));
            continue;
        }
        place.insert(fmi.into(), all.len());
        all.push(Variable {
            fmi: fmi.into(),
            name: identifier(fmi),
            about: v.description.clone().unwrap_or_default(),
            kind,
            min: v.min,
            max: v.max,
            start,
            elements: if element { vec![identifier(&v.name)] } else { Vec::new() },
            is_array: element || v.is_array(),
        });
    }
    Ok(all)
}

fn kind(md: &ModelDescription, v: &ModelVariable) -> Result<Kind> {
    Ok(match v.base {
        BaseType::Boolean => Kind::Boolean,
        BaseType::String => Kind::Text,
        BaseType::Enumeration => {
            let of = v.declared_type.as_deref().and_then(|t| md.type_definition(t));
            let of = of.with_context(|| format!("{}: the enumeration has no type", v.name))?;
            let items = of.items.iter().map(|i| (i.value, i.name.clone())).collect();
            Kind::Enumeration { of: identifier(&of.name), items }
        }
        base if base.is_float() => {
            // Modelica writes revolutions per minute in the notation of its units.
            let display = v.display_unit.as_deref().map(|unit| if unit == "rpm" { "rev/min" } else { unit });
            Kind::Real { unit: v.unit.clone().filter(|unit| unit != "1"), display: display.map(Into::into) }
        }
        base if base.is_integer() => Kind::Integer,
        base => bail!("{}: Modelica has no {base}", v.name),
    })
}

/// Start values as literals.
fn starts(md: &ModelDescription, v: &ModelVariable, kind: &Kind) -> Result<Vec<String>> {
    let Some(start) = v.start.as_deref() else { return Ok(vec![String::new()]) };
    let words: Vec<&str> = if *kind == Kind::Text { vec![start] } else { start.split_whitespace().collect() };
    let one = |word: &str| match kind {
        Kind::Text => Ok(super::text::literal(word)),
        Kind::Boolean => Ok((if matches!(word, "1" | "true") { "true" } else { "false" }).into()),
        Kind::Enumeration { of, items } => {
            let value: i64 = word.parse()?;
            let item =
                items.iter().find(|(v, _)| *v == value).with_context(|| format!("no item has the value {word}"))?;
            Ok(format!("Types.{of}.{}", item.1))
        }
        _ => Ok(word.into()),
    };
    let values: Vec<String> = words.into_iter().map(one).collect::<Result<_>>()?;
    let shape = md.shape(v).context("its size is unknown")?;
    let count = shape.iter().product::<usize>();
    if shape.len() > 1 {
        bail!("an array of {} dimensions; the wrapper supports one dimension", shape.len());
    }
    // FMI 3.0 allows one value for all elements.
    Ok(if values.len() == 1 && count > 1 { vec![values[0].clone(); count] } else { values })
}
