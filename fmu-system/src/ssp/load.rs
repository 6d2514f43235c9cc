//! An SSP as a system of our co-simulation.

use super::DESCRIPTION;
use super::component::Component;
use super::error::{Error, invalid};
use super::flat::Reached;
pub use super::outside::{Connectors, Inlet};
use super::package::Package;
use super::path::{Hop, Way, along};
use super::ssv::Parameter;
use super::structure::{Connection, ConnectionEnd, Connector, Structure};
use super::values::{self, Given};
use crate::cosimulation::{Crossing, Method, Outlet, Schedule, Sequence, Settings, System, Units, incompatible};
use fmu_import::written::{is_pattern, matches};
use fmu_import::{Fmu, Folder, Instance, check_entries, limits};
use model_description::{BaseType, Experiment, ModelVariable, Variability};
use std::fs::File;
use std::path::Path;
use zip::ZipArchive;

/// A system from files, ready to run.
#[derive(Default)]
pub struct Loaded {
    /// Its FMUs, connected and with their values.
    pub system: System,
    /// Default experiments: the times of the file, the steps of the FMUs.
    pub experiments: Vec<Experiment>,
    /// The connectors of an SSP's system.
    pub connectors: Connectors,
    /// Values for unknown names, which SSP 1.0 allows (4.4, ParameterBindings).
    pub notes: Vec<String>,
}

impl Loaded {
    /// Opens FMUs written `FILE` or `NAME=FILE`, or one SSP file. Relative paths begin in `folder`.
    ///
    /// # Errors
    /// As for [`open`](Self::open), or an SSP file is combined with other files.
    pub fn open_files(files: &[String], folder: &Path, logging: bool) -> Result<Self, Error> {
        Self::open_files_with(files, folder, logging, |_| System::default())
    }

    /// Like [`open_files`](Self::open_files), in a system that suits the FMUs.
    ///
    /// # Errors
    /// As [`open_files`](Self::open_files), or an FMU lacks the interface that the method needs.
    pub fn open_files_with(
        files: &[String],
        folder: &Path,
        logging: bool,
        system: impl FnOnce(&[(String, Fmu)]) -> System,
    ) -> Result<Self, Error> {
        let mut fmus = Vec::new();
        for text in files {
            let (name, path) = name_and_path(text)?;
            let (path, variant) = variant(path);
            if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ssp")) {
                if files.len() > 1 {
                    return invalid(format!(
                        "{}: an SSP file cannot be combined with other files: it contains its FMUs",
                        path.display()
                    ));
                }
                return Self::open_with(&folder.join(path), variant, logging, system);
            }
            fmus.push((name, Fmu::open(folder.join(path))?));
        }
        let mut loaded = Self { system: system(&fmus), ..Self::default() };
        for (name, fmu) in &fmus {
            loaded.experiments.push(fmu.description().default_experiment);
            loaded.system.add(name, fmu, logging)?;
        }
        Ok(loaded)
    }

    /// Missing times come from the files: the latest stop, the shortest step. A later start keeps the duration of the files.
    pub fn settings(&self, start: Option<f64>, stop: Option<f64>, step: Option<f64>, sequential: bool) -> Settings {
        let usual = self.experiments.iter().find_map(|x| x.start).unwrap_or(0.0);
        let start = start.unwrap_or(usual);
        let latest = self.experiments.iter().filter_map(|x| x.stop).reduce(f64::max);
        let latest = latest.map(|stop| if stop > start { stop } else { start + (stop - usual) });
        let stop = stop.or(latest).unwrap_or(start + 1.0);
        let shortest = self.experiments.iter().filter_map(|x| x.step).reduce(f64::min);
        let step = step.or(shortest).unwrap_or((stop - start) / 1000.0);
        Settings { start, stop, step, sequential }
    }

    /// Opens an SSP file.
    ///
    /// # Errors
    /// Names the file, the location in it, the fault and the remedy.
    pub fn open(path: &Path, logging: bool) -> Result<Self, Error> {
        Self::open_with(path, DESCRIPTION, logging, |_| System::default())
    }

    /// Like [`open`](Self::open), in a system that suits the FMUs.
    fn open_with(
        path: &Path,
        description: &str,
        logging: bool,
        system: impl FnOnce(&[(String, Fmu)]) -> System,
    ) -> Result<Self, Error> {
        let of = || path.display();
        let within = |cause: String| Error::Invalid(format!("{}: {cause}", of()));
        let unreadable = |e: std::io::Error| within(e.to_string());
        let file = File::open(path).map_err(unreadable)?;
        limits::ARCHIVE.check(file.metadata().map_err(unreadable)?.len()).map_err(within)?;
        let mut zip = ZipArchive::new(file).map_err(|e| within(format!("not a ZIP archive, or cut short: {e}")))?;
        check_entries(&mut zip).map_err(|e| within(e.to_string()))?;
        let names = zip.file_names().filter_map(Result::ok).map(std::borrow::Cow::into_owned);
        let mut variants: Vec<String> =
            names.filter(|name| Path::new(name).extension().is_some_and(|e| e == "ssd")).collect();
        variants.sort_unstable();
        if !variants.iter().any(|name| name == description) && !variants.is_empty() {
            let (all, file) = (variants.join(", "), path.file_name().unwrap_or_default().display());
            return Err(within(format!(
                "has no {description}; its variants are {all}: name one, as in {file}#{}",
                variants[0]
            )));
        }
        let mut package = Package { path, description, zip, notes: Vec::new() };
        let text = package.text(description)?;
        let in_description = |cause: String| within(format!("{description}: {cause}"));
        // The name of the archive is in front of every message.
        let named = format!("{}: ", path.display());
        let mut files = |name: &str| package.text(name).map_err(|e| e.to_string().replacen(&named, "", 1));
        let structure = Structure::read_with(&text, &mut files).map_err(in_description)?;
        let mut fmus = Vec::new();
        let temporary = |e: std::io::Error| within(format!("no temporary folder: {e}"));
        let dir = Folder::new().map_err(temporary)?;
        for (index, component) in structure.components.iter().enumerate() {
            let fmu = dir.path().join(format!("{index}.fmu"));
            std::fs::write(&fmu, package.bytes(&component.source)?).map_err(temporary)?;
            let fmu = Fmu::open(&fmu).map_err(|e| within(format!("{}: {}", component.source, e.cause())))?;
            fmus.push((component.name.clone(), fmu));
        }
        let system = system(&fmus);
        let exchange = matches!(system.method(), Method::ModelExchange(_));
        let other = if exchange { "CoSimulation" } else { "ModelExchange" };
        let mut loaded = Self { system, ..Self::default() };
        let is_other = |component: &&Component| component.implementation.as_deref() == Some(other);
        if let Some(Component { line, .. }) = structure.components.iter().find(is_other) {
            let what = format!("line {line}: implementation=\"{other}\"");
            if !exchange {
                return Err(in_description(format!("{what} is not Co-Simulation: simulate it with --me")));
            }
            loaded.notes.push(format!("{}: {description}: {what}, and it is integrated, as requested", of()));
        }
        loaded.experiments.push(Experiment { start: structure.start, stop: structure.stop, ..Experiment::default() });
        for (name, fmu) in &fmus {
            let experiment = fmu.description().default_experiment;
            // The system's times take precedence over those of its parts.
            let times = structure.start.or(structure.stop).is_some();
            let part = Experiment { step: experiment.step, ..Experiment::default() };
            loaded.experiments.push(if times { part } else { experiment });
            loaded.system.add(name, fmu, logging)?;
        }
        for component in &structure.components {
            let notes = check_connectors(&loaded.system, component).map_err(in_description)?;
            loaded.notes.extend(notes.into_iter().map(|note| format!("{}: {description}: {note}", of())));
        }
        loaded.notes.extend(structure.notes.iter().map(|note| format!("{}: {description}: {note}", of())));
        // Inner values first; the system's values replace them. Sizes of arrays are set before arrays are connected.
        let mut given = Vec::new();
        for component in &structure.components {
            for binding in &component.bindings {
                let (file, parameters) = package.parameters(binding, &component.source)?;
                given.extend(loaded.bound(&file, parameters, &format!("{}.", component.name), &structure));
            }
        }
        for binding in &structure.bindings {
            let (file, parameters) = package.parameters(binding, "")?;
            given.extend(loaded.bound(&file, parameters, &binding.path, &structure));
        }
        loaded.notes.append(&mut package.notes);
        values::set(&mut loaded.system, &given)?;
        for component in &structure.components {
            check_extents(&loaded.system, component).map_err(in_description)?;
        }
        for connection in &structure.connections {
            let wrong = |cause: String| in_description(format!("line {}: {cause}", connection.line));
            loaded.connect(&structure, connection).map_err(wrong)?;
        }
        Ok(loaded)
    }

    /// Feeds an input over time: one of the system's, or `component.variable`.
    ///
    /// # Errors
    /// No input has this name, or it is already fed.
    pub fn input(&mut self, name: &str, schedule: &Schedule) -> Result<(), Error> {
        for inlet in self.connectors.inlets(name)? {
            self.system.input(&inlet.port, inlet.schedule(schedule.clone())?)?;
        }
        Ok(())
    }

    /// Feeds an input of any type over time, as [`input`](Self::input), from texts of a user or a file.
    ///
    /// # Errors
    /// No input has this name, it is already fed, or a text is not a value of its type.
    pub fn sequence(&mut self, name: &str, texts: &Sequence) -> Result<(), Error> {
        for inlet in self.connectors.inlets(name)? {
            self.system.sequence(&inlet.port, &inlet.sequence(texts)?)?;
        }
        Ok(())
    }

    /// Feeds an input over time from user input: see [`Schedule::parse`] for a number, and [`Sequence::parse`] for an input of
    /// another type.
    ///
    /// # Errors
    /// As [`input`](Self::input), or the text has another form.
    pub fn points(&mut self, name: &str, text: &str) -> Result<(), Error> {
        for inlet in self.connectors.inlets(name)? {
            let (port, wrong) = (&inlet.port, Error::Invalid);
            if self.system.is_real(port)? || (!self.system.is_text(port)? && text.contains('~')) {
                self.system.input(port, inlet.schedule(Schedule::parse(text).map_err(wrong)?)?)?;
            } else {
                self.system.sequence(port, &inlet.sequence(&Sequence::parse(text).map_err(wrong)?)?)?;
            }
        }
        Ok(())
    }

    /// Sets the value of an input of the system, or of `component.variable`.
    ///
    /// # Errors
    /// No variable has this name, or the FMU refuses the value.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), Error> {
        for inlet in self.connectors.inlets(name)? {
            self.system.set(&inlet.port, &inlet.text(value)?)?;
        }
        Ok(())
    }

    /// Whether a name belongs to a connector of the system or to a variable, written `component.variable`.
    pub fn has(&self, name: &str) -> bool {
        self.connectors.outlet(name).is_ok_and(|outlet| self.system.has(&outlet.port))
    }

    /// Records a connector of the system, or `component.variable`; a pattern with `*` and `?` records all that have its form.
    ///
    /// # Errors
    /// The variable does not exist, or is neither a number nor a text.
    pub fn record(&mut self, name: &str) -> Result<(), Error> {
        if is_pattern(name) && !self.has(name) {
            let of_system = self.connectors.outputs.iter().map(|outlet| &outlet.name).filter(|n| matches(name, n));
            let all: Vec<String> = of_system.cloned().chain(self.system.matching(name)).collect();
            if all.is_empty() {
                return invalid(format!("{name}: no variable has a name of this form"));
            }
            return all.iter().try_for_each(|name| self.record_one(name));
        }
        self.record_one(name)
    }

    fn record_one(&mut self, name: &str) -> Result<(), Error> {
        let outlet = self.connectors.outlet(name)?;
        if outlet.transformation.is_none() && self.system.is_text(&outlet.port)? {
            return Ok(self.system.record_text_as(&outlet.port, name)?);
        }
        Ok(self.system.record_through(&outlet)?)
    }

    /// Records all outputs of the system or, if it has none, of all FMUs.
    ///
    /// # Errors
    /// As [`record`](Self::record).
    pub fn record_outputs(&mut self) -> Result<(), Error> {
        if self.connectors.outputs.is_empty() {
            return Ok(self.system.record_outputs()?);
        }
        self.connectors.outputs.clone().iter().try_for_each(|outlet| self.record(&outlet.name))
    }

    fn connect(&mut self, structure: &Structure, c: &Connection) -> Result<(), String> {
        // `flat` has determined the direction.
        let (from, to) = (&c.start, &c.end);
        let (start, end) = (find(structure, from)?, find(structure, to)?);
        let text = |e: fmu_import::Error| e.to_string();
        let port = |end: &ConnectionEnd| end.element.as_ref().map(|element| format!("{element}.{}", end.connector));
        let (source, target) = (port(from), port(to));
        if let Some(target) = target.as_ref().filter(|target| self.is_fed(target) == Ok(true)) {
            return Err(format!("{target} is fed twice: remove one of the connections"));
        }
        let way = self.way([(source.as_deref(), start), (target.as_deref(), end)], &c.hops);
        let named = |port: &Option<String>, end: &ConnectionEnd| port.clone().unwrap_or_else(|| end.to_string());
        let (from_name, to_name) = (named(&source, from), named(&target, to));
        let way = way.map_err(|cause| format!("{to_name}: {}", incompatible(&from_name, &cause)))?;
        for note in way.notes {
            self.system.note(format!("{from_name} to {to_name}: {note}"));
        }
        match (source, target) {
            (Some(source), Some(target)) => {
                let crossing = Crossing { units: Units::PassOn, transformation: way.transformation };
                self.system.connect_by(&source, &target, &crossing).map_err(text)
            }
            (None, Some(port)) => {
                let unit = start.unit.as_ref().map(|unit| unit.name.clone());
                let (transformation, only_units) = (way.transformation, way.only_units);
                let inlet = Inlet { port, transformation, unit, only_units };
                match self.connectors.inputs.iter_mut().find(|(name, _)| *name == from.connector) {
                    Some((_, targets)) => targets.push(inlet),
                    None => self.connectors.inputs.push((from.connector.clone(), vec![inlet])),
                }
                Ok(())
            }
            (Some(port), None) => {
                let name = to.connector.clone();
                if self.connectors.outputs.iter().any(|outlet| outlet.name == name) {
                    return Err(format!("the output {name} is connected twice: remove one of the connections"));
                }
                let (transformation, unit, items) = (way.transformation, way.unit, end.items.clone());
                self.connectors.outputs.push(Outlet { port, name, transformation, unit, items });
                Ok(())
            }
            (None, None) => Err("connects the system with itself, which is not supported: remove it".into()),
        }
    }

    /// Transformation of a value between two connectors, each with its variable if it belongs to a component.
    fn way(&self, ends: [(Option<&str>, &Connector); 2], hops: &[Hop]) -> Result<Way, String> {
        let own =
            |port: Option<&str>| port.map(|port| self.system.measured(port)).transpose().map_err(|e| e.to_string());
        let [(source, start), (target, end)] = ends;
        let (of_source, of_target) = (own(source)?, own(target)?);
        let relative = of_source.or(of_target).is_some_and(|unit| unit.relative);
        // The FMU defines the units of its variables, and a file the units of variables without one.
        let first = of_source.filter(|unit| unit.unit.is_some());
        let first = first.or_else(|| start.unit.as_ref().map(|unit| unit.measured(relative))).or(of_source);
        let last = of_target.filter(|unit| unit.unit.is_some());
        let last = last.or_else(|| end.unit.as_ref().map(|unit| unit.measured(relative))).or(of_target);
        along(first, hops, last, self.system.units() == Units::PassOn)
    }

    fn is_fed(&self, target: &str) -> Result<bool, String> {
        let outside = self.connectors.inputs.iter().any(|(_, targets)| targets.iter().any(|t| t.port == target));
        Ok(outside || self.system.is_fed(target).map_err(|e| e.to_string())?)
    }

    /// The values of a binding; names begin with `prefix`; the name of a system's connector refers to the variables connected to
    /// it.
    fn bound(
        &mut self,
        file: &str,
        parameters: Vec<(Parameter, Hop)>,
        prefix: &str,
        structure: &Structure,
    ) -> Vec<Given> {
        let mut given = Vec::new();
        for (p, hop) in parameters {
            let full = format!("{prefix}{}", p.name);
            let reached = structure.reach.iter().find(|(name, _)| *name == full);
            let itself = || vec![Reached { port: full.clone(), unit: None, hops: Vec::new() }];
            for Reached { port, unit, hops } in reached.map_or_else(itself, |(_, targets)| targets.clone()) {
                let has = |i: &Instance| {
                    let variable = port.strip_prefix(i.name())?.strip_prefix('.')?;
                    values::find(i.description(), variable).map(|_| (i.name().to_owned(), variable.to_owned()))
                };
                let Some((instance, name)) = self.system.instances().iter().find_map(has) else {
                    self.notes.push(format!("{file}: line {}: there is no {port}; the value is ignored", p.line));
                    continue;
                };
                let mut parameter = Parameter { name, ..p.clone() };
                // A number without a unit takes the connector's.
                if let (None, Some(unit)) = (&parameter.unit, &unit) {
                    (parameter.unit, parameter.base) = (Some(unit.name.clone()), unit.base);
                }
                let mut hops = hops;
                if hop != Hop::default() || hops.is_empty() {
                    hops.insert(0, Hop { unit, ..hop.clone() });
                }
                given.push(Given { instance, file: file.into(), parameter, hops });
            }
        }
        given
    }
}

/// Every connector of a component is a variable of its FMU, of that kind; returns notes on differences.
fn check_connectors(system: &System, component: &Component) -> Result<Vec<String>, String> {
    let Some(instance) = system.instances().iter().find(|i| i.name() == component.name) else { return Ok(Vec::new()) };
    let (md, of) = (instance.description(), &component.name);
    let mut notes = Vec::new();
    for Connector { name, kind, base, unit, ticks, clocks, line, .. } in &component.connectors {
        let Some(v) = values::find(md, name) else {
            let of_kind: Vec<&str> =
                md.variables.iter().filter(|v| v.causality.as_str() == kind).map(|v| v.name.as_str()).collect();
            let known = format!("its variables of kind {kind} are {}", of_kind.join(", "));
            return Err(format!("line {line}: {of} ({}) has no variable {name}; {known}", md.model_name));
        };
        let is_constant = v.variability == Variability::Constant && kind == "constant";
        if v.causality.as_str() != kind && !is_constant {
            return Err(format!("line {line}: {of}.{name} is {} and not {kind}: correct kind", v.causality));
        }
        let timing = v.timing.map(|timing| timing.ticks.as_str());
        if let Some(ticks) = ticks.as_deref().filter(|ticks| Some(*ticks) != timing) {
            let own = timing.unwrap_or("no clock");
            return Err(format!("line {line}: {of}.{name} is {own} and not {ticks}: correct intervalVariability"));
        }
        for clock in clocks {
            let on = |v: &ModelVariable| Some(v.value_reference) == md.variable(clock).map(|c| c.value_reference);
            if !md.variables.iter().any(|c| on(c) && v.clocks.contains(&c.value_reference)) {
                return Err(format!("line {line}: {of}.{name} is not on the clock {clock}: remove it"));
            }
        }
        if let Some(base) = base.as_deref().filter(|base| !is_of_type(v.base, base)) {
            notes.push(format!("line {line}: {of}.{name} is not {base} but {}, which counts", v.base));
        }
        if let (Some(stated), Some(own)) = (unit, &v.unit)
            && stated.name != *own
        {
            notes.push(format!("line {line}: {of}.{name} is not in {} but in {own}, which counts", stated.name));
        }
    }
    Ok(notes)
}

/// Whether a connector's type matches a variable's. Integer types are converted, and FMI 2.0 has one type of each kind.
fn is_of_type(base: BaseType, stated: &str) -> bool {
    match stated {
        "Real" | "Float64" | "Float32" => base.is_float(),
        "Boolean" => base == BaseType::Boolean,
        "String" => base == BaseType::String,
        "Binary" => base == BaseType::Binary,
        "Clock" => base == BaseType::Clock,
        _ => base.is_integer(),
    }
}

/// Every connector has the extents of its variable, with the sizes set.
fn check_extents(system: &System, component: &Component) -> Result<(), String> {
    for Connector { name, extents, line, .. } in component.connectors.iter().filter(|c| !c.extents.is_empty()) {
        let port = format!("{}.{name}", component.name);
        let own = system.shape(&port).map_err(|e| e.to_string())?;
        let fits =
            own.len() == extents.len() && extents.iter().zip(&own).all(|(one, own)| one.is_none_or(|n| n == *own));
        if !fits {
            let said = |all: Vec<String>| all.join(" x ");
            let stated = said(extents.iter().map(|n| n.map_or("?".into(), |n| n.to_string())).collect());
            let own = said(own.iter().map(usize::to_string).collect());
            return Err(format!("line {line}: {port} has the extents {own:?} and not {stated}: correct Dimension"));
        }
    }
    Ok(())
}

/// `plant=a/b.fmu`, or `a/b.fmu` with the name `b`.
///
/// # Errors
/// The name is empty, or the file name is missing.
pub fn name_and_path(text: &str) -> Result<(String, &Path), Error> {
    // A path may have an equals sign; a name has no separator.
    if let Some((name, path)) = text.split_once('=').filter(|(name, _)| !name.contains(['/', '\\'])) {
        if name.is_empty() {
            return invalid(format!("{text}: the name before = is empty"));
        }
        return Ok((name.into(), Path::new(path)));
    }
    let path = Path::new(text);
    let stem = path.file_stem().ok_or_else(|| Error::Invalid(format!("{text}: is not a file")))?;
    Ok((stem.to_string_lossy().into_owned(), path))
}

/// `a.ssp#B.ssd` as the file and the name of the description in it.
fn variant(path: &Path) -> (&Path, &str) {
    match path.to_str().and_then(|text| text.rsplit_once('#')) {
        Some((file, name)) if file.to_lowercase().ends_with(".ssp") => (Path::new(file), name),
        _ => (path, DESCRIPTION),
    }
}

/// The connector at an end of a connection.
fn find<'a>(structure: &'a Structure, end: &ConnectionEnd) -> Result<&'a Connector, String> {
    let (of, connectors) = match &end.element {
        None => (format!("the system {}", structure.name), &structure.connectors),
        Some(element) => {
            let names: Vec<&str> = structure.components.iter().map(|c| c.name.as_str()).collect();
            let none = || format!("there is no component {element}; available: {}", names.join(", "));
            (element.clone(), &structure.component(element).ok_or_else(none)?.connectors)
        }
    };
    let names = || connectors.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
    let found = connectors.iter().find(|c| c.name == end.connector);
    found.ok_or_else(|| format!("{of} has no connector {}; it has {}", end.connector, names()))
}

#[cfg(test)]
mod tests;
