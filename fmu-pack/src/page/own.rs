//! The author's configuration of a page: `page.toml`, next to the package's `Cargo.toml`.

use fmu_core::Description;
use fmu_core::description::{Variable, VariableKind};
use fmu_core::variable::{Causality, Variability};
use fmu_import::{Values, suggest};
use model_description::ModelDescription;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Largest size of the file in bytes.
pub const LARGEST: u64 = 1 << 20;
/// Maximum numbers of presets, and of arrows in a plane.
const PRESETS: usize = 50;
const ARROWS: usize = 20;
/// Maximum number of changes in a preset.
const EVENTS: usize = 10_000;

/// The file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Own {
    inputs: Vec<String>,
    parameters: Vec<String>,
    range: BTreeMap<String, [Written; 2]>,
    plot: Vec<Plot>,
    difference: Vec<Difference>,
    plane: Vec<Plane>,
    preset: Vec<Preset>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Plot {
    title: String,
    curves: Vec<String>,
}

/// A curve that the page computes.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Difference {
    name: String,
    of: [String; 2],
    /// To the nearest turn.
    #[serde(default)]
    turn: bool,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Plane {
    title: String,
    arrows: Vec<Arrow>,
}

/// A vector with the components d and q, turned by an angle.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Arrow {
    name: String,
    angle: Option<String>,
    d: Vec<Term>,
    q: Vec<Term>,
    /// The length that reaches the circle, with its SI unit.
    full: Written,
    #[serde(default)]
    thin: bool,
}

/// A value; a text may contain one of the variable's units.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum Written {
    Flag(bool),
    Integer(i64),
    Number(f64),
    Text(String),
}

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(x) => x.fmt(f),
            Self::Integer(x) => x.fmt(f),
            Self::Number(x) => x.fmt(f),
            Self::Text(text) => text.fmt(f),
        }
    }
}

/// A name or a number, or a product of both.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum Term {
    Number(f64),
    Name(String),
    Product(Vec<Term>),
}

/// A preset run.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Preset {
    title: String,
    #[serde(default)]
    text: String,
    #[serde(default)]
    set: BTreeMap<String, Written>,
    #[serde(default)]
    events: Vec<(f64, String, Written)>,
    stop: Option<f64>,
    rate: Option<f64>,
    #[serde(default)]
    compare: bool,
}

/// The content of the file for the page, after its checks.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Members of the page's description of the model.
    pub members: serde_json::Map<String, Value>,
    /// The preset runs.
    pub presets: Vec<PresetRun>,
}

/// A preset in SI units and steps.
#[derive(Clone, Debug)]
pub struct PresetRun {
    /// Its name.
    pub title: String,
    /// What to see.
    pub text: String,
    /// Start values.
    pub set: Vec<(String, Value)>,
    /// Changes before the step of this number.
    pub events: Vec<(u64, String, Value)>,
    /// Stop time in s.
    pub stop: Option<f64>,
    /// Seconds of the run per second; `None` for the one that ends the default experiment in 10 s.
    pub rate: Option<f64>,
    /// The previous run stays in the plots.
    pub compare: bool,
}

impl PresetRun {
    /// The run in the form that the page uses.
    pub fn json(&self) -> Value {
        let Self { title, text, set, events, stop, rate, compare } = self;
        json!({ "title": title, "text": text, "set": set, "events": events, "stop": stop, "rate": rate, "compare": compare })
    }
}

impl Own {
    /// Reads the text of the file.
    ///
    /// # Errors
    /// Names the line and the fault.
    pub fn read(text: &str) -> Result<Self, String> {
        if text.len() as u64 > LARGEST {
            return Err(format!("has {} bytes; the maximum is {LARGEST}", text.len()));
        }
        toml::from_str(text).map_err(|error: toml::de::Error| {
            let line = error.span().map_or(1, |span| text[..span.start.min(text.len())].matches('\n').count() + 1);
            format!("line {line}: {}", error.message().lines().collect::<Vec<_>>().join(" "))
        })
    }

    /// Checks the file against the model: `reader` is the model as described by FMI 3.0.
    ///
    /// # Errors
    /// Names the location in the file and the fault.
    pub fn judge(&self, of: &Description, reader: &ModelDescription) -> Result<Judged, String> {
        let model = Model { of, reader };
        let computed: Vec<&str> = self.difference.iter().map(|d| d.name.as_str()).collect();
        for name in &self.inputs {
            let v = model.variable(name).map_err(|e| format!("inputs: {e}"))?;
            if v.causality != Causality::Input {
                return Err(format!("inputs: {name} is not an input"));
            }
        }
        for name in &self.parameters {
            let v = model.variable(name).map_err(|e| format!("parameters: {e}"))?;
            if v.causality != Causality::Parameter {
                return Err(format!("parameters: {name} is not a parameter"));
            }
        }
        let mut ranges = serde_json::Map::new();
        for (name, [low, high]) in &self.range {
            let place = |e: String| format!("range of {name}: {e}");
            let (low, high) = (model.number(name, low).map_err(place)?, model.number(name, high).map_err(place)?);
            if low >= high {
                return Err(place(format!("{low} is not below {high}")));
            }
            ranges.insert(name.clone(), json!([low, high]));
        }
        distinct("plot", self.plot.iter().map(|p| p.title.as_str()))?;
        distinct("difference", computed.iter().copied())?;
        distinct("plane", self.plane.iter().map(|p| p.title.as_str()))?;
        distinct("preset", self.preset.iter().map(|p| p.title.as_str()))?;
        for d in &self.difference {
            let place = |e: String| format!("difference {:?}: {e}", d.name);
            if of.variable(&d.name).is_some() {
                return Err(place("a variable has this name".into()));
            }
            d.of.iter().try_for_each(|name| model.curve(name, &[])).map_err(place)?;
        }
        for plot in &self.plot {
            let place = |e: String| format!("plot {:?}: {e}", plot.title);
            if plot.curves.is_empty() {
                return Err(place("has no curve".into()));
            }
            plot.curves.iter().try_for_each(|name| model.curve(name, &computed)).map_err(place)?;
        }
        let planes = self.plane.iter().map(|plane| model.plane(plane)).collect::<Result<Vec<_>, _>>()?;
        if self.preset.len() > PRESETS {
            return Err(format!("has {} presets; the maximum is {PRESETS}", self.preset.len()));
        }
        let presets =
            self.preset.iter().map(|preset| model.run(preset).map_err(|e| format!("preset {:?}: {e}", preset.title)));
        let presets = presets.collect::<Result<_, _>>()?;
        let differences: Vec<Value> =
            self.difference.iter().map(|d| json!({ "name": d.name, "of": d.of, "turn": d.turn })).collect();
        let plots: Vec<Value> = self.plot.iter().map(|p| json!({ "title": p.title, "curves": p.curves })).collect();
        let mut members = serde_json::Map::new();
        for (key, value) in [
            ("inputs", json!(self.inputs)),
            ("parameters", json!(self.parameters)),
            ("ranges", Value::Object(ranges)),
            ("plots", json!(plots)),
            ("differences", json!(differences)),
            ("planes", json!(planes)),
        ] {
            members.insert(key.into(), value);
        }
        Ok(Judged { members, presets })
    }
}

/// Whether a run of the page can have this curve.
pub fn is_curve(v: &Variable) -> bool {
    matches!(v.causality, Causality::Output | Causality::Input)
        && !v.is_array()
        && !matches!(v.kind, VariableKind::Text | VariableKind::Binary { .. } | VariableKind::Clock(_))
}

fn distinct<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    for name in names {
        if name.trim().is_empty() {
            return Err(format!("a {what} has no name"));
        }
        if !seen.insert(name) {
            return Err(format!("two {what}s have the name {name:?}"));
        }
    }
    Ok(())
}

/// The model of the file.
struct Model<'a> {
    of: &'a Description,
    reader: &'a ModelDescription,
}

impl Model<'_> {
    fn variable(&self, name: &str) -> Result<&Variable, String> {
        let names = || self.of.variables.iter().map(|v| v.name.as_str());
        self.of
            .variable(name)
            .ok_or_else(|| format!("{} has no variable {name}{}", self.of.name, suggest(name, names())))
    }

    /// The value of a variable from user input, checked against its range.
    fn value(&self, name: &str, written: &Written) -> Result<Value, String> {
        let text = &written.to_string();
        let v = self.variable(name)?;
        if !v.causality.is_settable() || v.is_array() {
            return Err(format!("{name} is not an input or a parameter with one value"));
        }
        let read = self.reader.variable(name).ok_or_else(|| format!("{name} cannot be read"))?;
        let number = |x: f64| {
            if v.range().contains(x) { Ok(json!(x)) } else { Err(format!("{name} = {text} is not {}", v.range())) }
        };
        match Values::read(text, read, self.reader)? {
            Values::Reals(x) if x.len() == 1 => number(x[0]),
            Values::Integers(x) if x.len() == 1 => {
                let x = i64::try_from(x[0]).map_err(|_| format!("{name} = {text} exceeds 64 bits"))?;
                if matches!(v.kind, VariableKind::Enumeration { .. }) {
                    return Ok(json!(x));
                }
                #[expect(clippy::cast_precision_loss, reason = "to compare with the bounds, which are real numbers")]
                number(x as f64).map(|_| json!(x))
            }
            Values::Booleans(x) if x.len() == 1 => Ok(json!(x[0])),
            Values::Strings(x) if x.len() == 1 => Ok(json!(x[0])),
            _ => Err(format!("{name} = {text} is not one value")),
        }
    }

    fn number(&self, name: &str, text: &Written) -> Result<f64, String> {
        self.value(name, text)?.as_f64().ok_or_else(|| format!("{name} has no numbers"))
    }

    fn curve(&self, name: &str, computed: &[&str]) -> Result<(), String> {
        if computed.contains(&name) || is_curve(self.variable(name)?) {
            return Ok(());
        }
        Err(format!("{name} is not a curve: a curve is an output or an input with one number"))
    }

    fn plane(&self, plane: &Plane) -> Result<Value, String> {
        let place = |e: String| format!("plane {:?}: {e}", plane.title);
        if plane.arrows.is_empty() || plane.arrows.len() > ARROWS {
            return Err(place(format!("has {} arrows; 1 to {ARROWS} are possible", plane.arrows.len())));
        }
        distinct("arrow", plane.arrows.iter().map(|a| a.name.as_str())).map_err(place)?;
        let arrow = |a: &Arrow| -> Result<Value, String> {
            let inside = |e: String| place(format!("arrow {:?}: {e}", a.name));
            let full = self.length(&a.full).map_err(inside)?;
            a.angle.iter().try_for_each(|name| self.curve(name, &[])).map_err(inside)?;
            let sum = |terms: &[Term]| terms.iter().map(|t| self.term(t)).collect::<Result<Vec<_>, _>>();
            let (d, q) = (sum(&a.d).map_err(inside)?, sum(&a.q).map_err(inside)?);
            Ok(json!({ "name": a.name, "angle": a.angle, "d": d, "q": q, "full": full, "thin": a.thin }))
        };
        let arrows = plane.arrows.iter().map(arrow).collect::<Result<Vec<_>, _>>()?;
        Ok(json!({ "title": plane.title, "arrows": arrows }))
    }

    /// The number before an SI unit of the model.
    fn length(&self, written: &Written) -> Result<f64, String> {
        let text = written.to_string();
        let (number, unit) = text.trim().split_once(' ').unwrap_or((text.trim(), ""));
        let is_unit = |v: &Variable| matches!(&v.kind, VariableKind::Real { unit: of, .. } if of == unit.trim());
        let full = number.parse().ok().filter(|x: &f64| *x > 0.0 && x.is_finite());
        match full {
            Some(full) if unit.is_empty() || self.of.variables.iter().any(is_unit) => Ok(full),
            _ => Err(format!("full = {text} is not a number above 0 with a unit of the model's variables")),
        }
    }

    fn term(&self, term: &Term) -> Result<Value, String> {
        match term {
            Term::Number(x) if x.is_finite() => Ok(json!(x)),
            Term::Number(x) => Err(format!("{x} is not a finite number")),
            Term::Name(name) => {
                let v = self.variable(name)?;
                let has_number = is_curve(v) || (v.causality == Causality::Parameter && !v.is_array());
                if has_number {
                    Ok(json!(name))
                } else {
                    Err(format!("the page cannot read {name}: expected a plotted variable or a scalar parameter"))
                }
            }
            Term::Product(parts) => {
                if parts.iter().any(|part| matches!(part, Term::Product(_))) {
                    return Err("a product has names and numbers only".into());
                }
                parts.iter().map(|part| self.term(part)).collect::<Result<Vec<_>, _>>().map(Value::Array)
            }
        }
    }

    fn run(&self, preset: &Preset) -> Result<PresetRun, String> {
        let experiment = &self.of.experiment;
        let set = preset.set.iter().map(|(name, text)| {
            self.value(name, text).map(|value| (name.clone(), value)).map_err(|e| format!("set: {e}"))
        });
        let set = set.collect::<Result<_, _>>()?;
        let stop = preset.stop.unwrap_or(experiment.stop);
        if !(stop.is_finite() && stop > experiment.start) {
            return Err(format!("stop = {stop} s is not after the start, {} s", experiment.start));
        }
        if preset.rate.is_some_and(|rate| !(rate.is_finite() && rate >= 0.0)) {
            return Err("rate is not a finite number of at least 0".into());
        }
        if preset.events.len() > EVENTS {
            return Err(format!("has {} events; the maximum is {EVENTS}", preset.events.len()));
        }
        let event = |(t, name, text): &(f64, String, Written)| -> Result<(u64, String, Value), String> {
            let place = |e: String| format!("event at {t} s: {e}");
            let v = self.variable(name).map_err(place)?;
            if v.causality != Causality::Input && v.variability != Variability::Tunable {
                return Err(place(format!("{name} does not change in a run: it is neither an input nor tunable")));
            }
            let steps = (t - experiment.start) / experiment.step;
            if !(steps > -0.5 && *t < stop) {
                return Err(place(format!("it is not between the start and the stop, {stop} s")));
            }
            if (steps - steps.round()).abs() > 1e-6 * steps.abs().max(1.0) {
                return Err(place(format!("it is between two steps of {} s", experiment.step)));
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounded, at least 0")]
            let k = steps.round().max(0.0) as u64;
            Ok((k, name.clone(), self.value(name, text).map_err(place)?))
        };
        let events = preset.events.iter().map(event).collect::<Result<_, _>>()?;
        let Preset { title, text, rate, compare, .. } = preset.clone();
        Ok(PresetRun { title, text, set, events, stop: Some(stop), rate, compare })
    }
}
