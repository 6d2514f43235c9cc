//! A page that runs an FMU in a web browser: one HTML file with the module, its description and the code around it.

pub mod own;

use crate::error::{Context, Error, Result, ensure, invalid};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::{Compression, GzBuilder};
use fmu_core::Description;
use fmu_core::description::{Value as Start, Variable, VariableKind};
use fmu_core::variable::{Causality, Variability};
use fmu_plot::ink::CURVES;
use fmu_plot::page::{AXIS, document, escape};
use fmu_system::cosimulation::Sequence;
use model_description::{FmiVersion, Generation, ModelDescription};
use own::{Judged, Own, PresetRun, is_curve};
use serde_json::{Map, Value, json};
use std::io::Write as _;
use std::path::Path;

/// The file of a package that configures its page.
pub const FILE: &str = "page.toml";

const BODY: &str = include_str!("body.html");
const STYLE: &str = include_str!("run.css");
const RUN: &str = include_str!("run.js");
const TEXT: &str = include_str!("text.js");
const WORKER: &str = include_str!("worker.js");

/// The page loads nothing: scripts, styles and the worker are part of it.
const POLICY: &str = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline' \
     'wasm-unsafe-eval' blob:; worker-src blob:; style-src 'unsafe-inline'; img-src data:\">\n";

/// Maximum number of plots and of curves in a plot, where the author names none.
const PLOTS: usize = 4;

/// Maximum number of changes that a file of inputs becomes.
const CHANGES: usize = 2000;

/// The parts of a page.
pub struct Source<'a> {
    /// The model with the start values of the page.
    pub description: &'a Description,
    /// The model of the module, if the page is for a preset.
    pub plain: &'a Description,
    /// The module.
    pub module: &'a [u8],
    /// The text of `page.toml`, and its path.
    pub own: Option<(&'a Path, &'a str)>,
    /// The file that feeds the default experiment.
    pub stimuli: Option<&'a Path>,
    /// The licenses of the module's contents.
    pub licenses: &'a str,
}

/// Requires a model that a page can run.
///
/// # Errors
/// The model has no Co-Simulation.
pub fn is_possible(of: &Description) -> Result<()> {
    let alone = of.model_exchange.as_ref().is_some_and(|exchange| exchange.only);
    ensure!(!alone, "{}: a page runs Co-Simulation, but this FMU is for Model Exchange only", of.model_name());
    Ok(())
}

/// The page as HTML.
///
/// # Errors
/// The module is not one of this model; `page.toml` does not fit the model.
pub fn page(source: &Source<'_>) -> Result<String> {
    let Source { description: of, plain, module, licenses, .. } = source;
    fits(module, plain)?;
    let Judged { mut members, presets } = judged(plain, source.own)?;
    // The author's presets are for the author's start values.
    let is_plain = of.variables.iter().zip(&plain.variables).all(|(a, b)| a.start == b.start);
    let mut presets: Vec<Value> = presets.iter().filter(|_| is_plain).map(PresetRun::json).collect();
    if presets.is_empty() {
        let run = default_experiment(of, source.stimuli)?;
        if !is_plain {
            members.insert("ranges".into(), ranges_of(&run));
        }
        presets.push(run.json());
    }
    let json = described(of, plain, members, &presets).to_string().replace('<', "\\u003c");
    let body = BODY
        .replace("{title}", &escape(of.model_name()))
        .replace("{name}", &escape(&of.name))
        .replace("{version}", &escape(&of.version))
        .replace("{license}", &escape(&of.license))
        .replace("{description}", &escape(&of.description));
    let packed = packed(module)?;
    let licenses = self::packed(licenses.as_bytes())?;
    let body = format!(
        "{body}<script type=\"application/json\" id=\"fmu\">{json}</script>\n\
         <script type=\"text/plain\" id=\"module\">{packed}</script>\n\
         <script type=\"text/plain\" id=\"license\">{licenses}</script>\n\
         <script type=\"text/plain\" id=\"worker\">{WORKER}</script>\n<script>\n{AXIS}{TEXT}{RUN}</script>\n"
    );
    Ok(document(of.model_name(), POLICY, STYLE, &body))
}

/// The ranges of a run's inputs, twice as large as needed, for a machine to which the author's ranges do not apply.
fn ranges_of(run: &PresetRun) -> Value {
    let mut ranges = Map::new();
    for (_, name, value) in &run.events {
        let most = ranges.get(name).map_or(0.0, |range: &Value| range[1].as_f64().unwrap_or(0.0));
        let x = 2.0 * value.as_f64().unwrap_or(0.0).abs();
        if x > most {
            ranges.insert(name.clone(), json!([-x, x]));
        }
    }
    Value::Object(ranges)
}

/// Requires a module that a page can run and that contains the model with this token.
fn fits(module: &[u8], plain: &Description) -> Result<()> {
    let has = |text: &str| module.windows(text.len()).any(|part| part == text.as_bytes());
    ensure!(module.starts_with(b"\0asm\x01\0\0\0"), "the module is not one of WebAssembly (version 1)");
    ensure!(has("fmi3DoStep"), "the module has no function fmi3DoStep: not made with fmu_export::export!");
    ensure!(
        has("__indirect_function_table"),
        "the module does not export its table of functions: build it with fmu page"
    );
    ensure!(
        has(&plain.token),
        "the module is not of this {}: it lacks the token {}; build both again",
        plain.name,
        plain.token
    );
    Ok(())
}

/// The file of the author, checked against the model.
///
/// # Errors
/// Names the file, the location in it, and the fault.
pub fn judged(of: &Description, own: Option<(&Path, &str)>) -> Result<Judged> {
    let reader = reader(of)?;
    let file = own.map_or(Path::new(FILE), |(path, _)| path).display();
    let parsed = own.map_or(Ok(Own::default()), |(_, text)| Own::read(text));
    let judged = parsed.and_then(|own| own.judge(of, &reader));
    judged.map_err(|cause| invalid!("{file}: {cause}"))
}

/// The model as FMI 3.0 describes it.
fn reader(of: &Description) -> Result<ModelDescription> {
    let generation = Generation { tool: String::new(), date_and_time: String::new() };
    Ok(model_description::read(model_description::write(of, FmiVersion::V3, &generation))?)
}

/// The page's description of the model.
fn described(of: &Description, plain: &Description, mut members: Map<String, Value>, presets: &[Value]) -> Value {
    let ranges = members.remove("ranges").unwrap_or_default();
    if members.get("plots").is_none_or(|plots| plots == &json!([])) {
        members.insert("plots".into(), plots(of));
    }
    let mut enumerations = Map::new();
    for v in &of.variables {
        if let VariableKind::Enumeration { name, items, .. } = &v.kind {
            enumerations.insert(name.clone(), json!(items));
        }
    }
    // Bytes and clocks are omitted.
    let has_text = |v: &Variable| !matches!(v.kind, VariableKind::Binary { .. } | VariableKind::Clock(_));
    let shown = |v: &&Variable| (v.causality.is_settable() || is_curve(v)) && has_text(v);
    let variables: Vec<Value> = of.variables.iter().filter(shown).map(|v| variable(v, &ranges)).collect();
    // Start values of a preset archive that differ from the module's.
    let starts = of.variables.iter().filter(|v| plain.variable(&v.name).is_none_or(|p| p.start != v.start));
    let starts: Vec<Value> =
        starts.filter(|v| v.causality.is_settable() && has_text(v)).map(|v| json!([v.name, start(v)])).collect();
    let experiment = &of.experiment;
    let mut json = json!({
        "title": of.model_name(),
        "token": plain.token,
        "experiment": { "start": experiment.start, "stop": experiment.stop, "step": experiment.step },
        "enumerations": enumerations,
        "variables": variables,
        "starts": starts,
        "presets": presets,
        "inks": CURVES,
    });
    if let Some(object) = json.as_object_mut() {
        object.extend(members);
    }
    with_likes(json)
}

/// A difference has unit and display unit of its first part.
fn with_likes(mut json: Value) -> Value {
    let variables = json["variables"].clone();
    for difference in json["differences"].as_array_mut().into_iter().flatten() {
        let like = variables.as_array().into_iter().flatten().find(|v| v["name"] == difference["of"][0]);
        let mut like = like.cloned().unwrap_or_default();
        // A difference has no offset.
        if like["display"].is_array() {
            like["display"][2] = json!(0);
        }
        difference["like"] = json!({ "unit": like["unit"], "display": like["display"] });
    }
    json
}

fn variable(v: &Variable, ranges: &Value) -> Value {
    let (kind, unit, display, enumeration) = match &v.kind {
        VariableKind::Real { unit, display, relative, single, .. } => {
            let shown = |(name, factor, offset): &(String, f64, f64)| {
                json!([name, factor, if *relative { 0.0 } else { *offset }])
            };
            let display = display.as_ref().map(shown);
            (if *single { "Float32".into() } else { "Float64".into() }, Some(unit), display, None)
        }
        VariableKind::Integer(kind) => (format!("{kind:?}"), None, None, None),
        VariableKind::Boolean => ("Boolean".into(), None, None, None),
        VariableKind::Enumeration { name, .. } => ("Enumeration".into(), None, None, Some(name)),
        VariableKind::Text => (String::from("String"), None, None, None),
        VariableKind::Binary { .. } => (String::from("Binary"), None, None, None),
        VariableKind::Clock(_) => (String::from("Clock"), None, None, None),
    };
    let mut json = json!({
        "name": v.name,
        "reference": v.value_reference,
        "kind": kind,
        "causality": v.causality,
        "description": v.description,
    });
    let mut put = |key: &str, value: Value| {
        if !value.is_null() {
            json[key] = value;
        }
    };
    // Default properties are omitted.
    if v.variability == Variability::Tunable {
        put("variability", json!(v.variability));
    }
    if v.elements() != 1 {
        put("elements", json!(v.elements()));
    }
    put("unit", json!(unit.filter(|unit| !unit.is_empty())));
    put("display", json!(display));
    put("type", json!(enumeration));
    put("min", json!(v.min));
    put("max", json!(v.max));
    put("range", ranges.get(&v.name).cloned().unwrap_or_default());
    if v.above {
        put("above", json!(true));
    }
    if v.below {
        put("below", json!(true));
    }
    put("start", start(v));
    json
}

fn start(v: &Variable) -> Value {
    let one = |value: &Start| match value {
        Start::Real(x) => json!(x),
        // A page computes in doubles; a start value that does not fit is shown and set as a text of digits.
        Start::Integer(x) => i64::try_from(*x).map_or_else(|_| json!(x.to_string()), |x| json!(x)),
        Start::Boolean(x) => json!(x),
        Start::Text(x) => json!(x),
        Start::Binary(_) => Value::Null,
    };
    match v.start.as_deref() {
        Some([x]) if !v.is_array() => one(x),
        Some(all) => all.iter().map(one).collect(),
        None => Value::Null,
    }
}

/// A plot for each unit of the outputs.
fn plots(of: &Description) -> Value {
    let mut plots: Vec<(String, Vec<&str>)> = Vec::new();
    for v in of.variables.iter().filter(|v| v.causality == Causality::Output && is_curve(v)) {
        let VariableKind::Real { unit, .. } = &v.kind else { continue };
        match plots.iter_mut().find(|(of, _)| of == unit) {
            Some((_, curves)) if curves.len() < PLOTS => curves.push(&v.name),
            Some(_) => {}
            None => plots.push((unit.clone(), vec![&v.name])),
        }
    }
    if plots.is_empty() {
        let discrete = of.variables.iter().filter(|v| v.causality == Causality::Output && is_curve(v));
        plots.push((String::new(), discrete.take(PLOTS).map(|v| v.name.as_str()).collect()));
    }
    plots.retain(|(_, curves)| !curves.is_empty());
    plots.iter().take(PLOTS).map(|(_, curves)| json!({ "title": "", "curves": curves })).collect()
}

/// The default experiment, with constant inputs over each step.
fn default_experiment(of: &Description, stimuli: Option<&Path>) -> Result<PresetRun> {
    let experiment = &of.experiment;
    let mut run = PresetRun {
        title: "Default experiment".into(),
        text: String::new(),
        set: Vec::new(),
        events: Vec::new(),
        stop: Some(experiment.stop),
        rate: None,
        compare: false,
    };
    let Some(path) = stimuli.filter(|path| path.is_file()) else { return Ok(run) };
    let fed = Sequence::read_csv(path, |name| of.variable(name).is_some()).map_err(Error::Invalid)?;
    let reader = reader(of)?;
    for (name, texts) in fed {
        let wrong = |cause: String| invalid!("{}: {name}: {cause}", path.display());
        let v = of.variable(&name).with_context(|| format!("{}: there is no input {name}", path.display()))?;
        let read = reader.variable(&name).with_context(|| name.clone())?;
        let schedule = texts.schedule(read, &reader).map_err(wrong)?;
        let of_kind = |x: f64| match v.kind {
            VariableKind::Boolean => json!(x != 0.0),
            VariableKind::Real { .. } => json!(x),
            #[expect(clippy::cast_possible_truncation, reason = "an integer that a double has exactly")]
            _ => json!(x as i64),
        };
        let mut last = schedule.at(experiment.start);
        run.set.push((name.clone(), of_kind(last)));
        for k in 1_u32.. {
            let t = experiment.start + f64::from(k) * experiment.step;
            if t >= experiment.stop || run.events.len() >= CHANGES {
                break;
            }
            let x = schedule.at(t);
            if x.to_bits() != last.to_bits() {
                run.events.push((k.into(), name.clone(), of_kind(x)));
                last = x;
            }
        }
    }
    run.events.sort_by_key(|event| event.0);
    Ok(run)
}

/// Gzip and base64; the same bytes give the same text.
fn packed(bytes: &[u8]) -> Result<String> {
    let mut encoder = GzBuilder::new().mtime(0).write(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    Ok(STANDARD.encode(encoder.finish()?))
}
