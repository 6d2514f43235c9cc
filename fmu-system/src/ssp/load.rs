//! An SSP as a system of our co-simulation.

use super::DESCRIPTION;
use super::error::{Error, invalid};
use super::package::Package;
use super::ssm;
use super::ssv::Parameter;
use super::structure::{Connection, ConnectionEnd, Connector, Structure};
use super::values::{self, Given};
use crate::cosimulation::{Crossing, Method, Schedule, Sequence, Settings, System, Units};
use fmu_import::written::{is_pattern, matches};
use fmu_import::{Fmu, check_entries, limits};
use model_description::{Experiment, Measured, Passage};
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

/// Connectors of a system, none for FMUs without an SSP.
#[derive(Clone, Debug, Default)]
pub struct Connectors {
    /// Names of the inputs, each with the inputs `component.variable` that it feeds.
    pub inputs: Vec<(String, Vec<String>)>,
    /// Names of the outputs, each with its source `component.variable`.
    pub outputs: Vec<(String, String)>,
}

impl Connectors {
    /// The ports denoted by a name to set: the inputs that an input of the system feeds, or the name itself.
    ///
    /// # Errors
    /// The name has no dot, and the system has no such input.
    pub fn ports(&self, name: &str) -> Result<Vec<String>, Error> {
        if let Some((_, targets)) = self.inputs.iter().find(|(n, _)| n == name) {
            return Ok(targets.clone());
        }
        let of_system = !(self.inputs.is_empty() && self.outputs.is_empty());
        if of_system && !name.contains('.') {
            let names: Vec<&str> = self.inputs.iter().map(|(n, _)| n.as_str()).collect();
            return invalid(format!("{name}: is not an input of the system; it has {}", names.join(", ")));
        }
        Ok(vec![name.to_owned()])
    }

    /// The port denoted by a name to record: an output of the system, an input fed by one of the system, or the name itself.
    ///
    /// # Errors
    /// As for [`ports`](Self::ports).
    pub fn source(&self, name: &str) -> Result<String, Error> {
        match self.outputs.iter().find(|(n, _)| n == name) {
            Some((_, source)) => Ok(source.clone()),
            None => Ok(self.ports(name)?.swap_remove(0)),
        }
    }
}

impl Loaded {
    /// Opens FMUs written `FILE` or `NAME=FILE`, or one SSP file. Relative paths begin in `folder`.
    ///
    /// # Errors
    /// As [`open`](Self::open), or an SSP file is not alone.
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
                    return invalid(format!("{}: an SSP is simulated alone: its FMUs are inside", path.display()));
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
        check_entries(&mut zip).map_err(within)?;
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
        let mut package = Package { path, description, zip };
        let text = package.text(description)?;
        let in_description = |cause: String| within(format!("{description}: {cause}"));
        let structure = Structure::read(&text).map_err(in_description)?;
        let mut fmus = Vec::new();
        let temporary = |e: std::io::Error| within(format!("no temporary folder: {e}"));
        let dir = tempfile::tempdir().map_err(temporary)?;
        for (index, component) in structure.components.iter().enumerate() {
            let fmu = dir.path().join(format!("{index}.fmu"));
            std::fs::write(&fmu, package.bytes(&component.source)?).map_err(temporary)?;
            let fmu = Fmu::open(&fmu).map_err(|e| within(format!("{}: {}", component.source, e.cause())))?;
            fmus.push((component.name.clone(), fmu));
        }
        let system = system(&fmus);
        if let (Method::CoSimulation { .. }, Some(component)) =
            (system.method(), structure.components.iter().find(|component| component.model_exchange))
        {
            let cause = "implementation=\"ModelExchange\" is not Co-Simulation: simulate it with --me";
            return Err(in_description(format!("line {}: {cause}", component.line)));
        }
        let mut loaded = Self { system, ..Self::default() };
        loaded.experiments.push(Experiment { start: structure.start, stop: structure.stop, ..Experiment::default() });
        for (component, (name, fmu)) in structure.components.iter().zip(&fmus) {
            let experiment = fmu.description().default_experiment;
            // The system's times take precedence over those of its parts.
            let times = structure.start.or(structure.stop).is_some();
            let part = Experiment { step: experiment.step, ..Experiment::default() };
            loaded.experiments.push(if times { part } else { experiment });
            loaded.system.add(name, fmu, logging)?;
            loaded.check_connectors(&component.connectors, &component.name).map_err(in_description)?;
        }
        for connection in &structure.connections {
            let wrong = |cause: String| in_description(format!("line {}: {cause}", connection.line));
            loaded.connect(&structure, connection).map_err(wrong)?;
        }
        // Inner values first: those of the system replace them.
        let mut given = Vec::new();
        for component in &structure.components {
            for binding in &component.bindings {
                let (file, parameters) = package.parameters(binding)?;
                given.extend(loaded.bound(&file, &parameters, &format!("{}.", component.name), &structure)?);
            }
        }
        for binding in &structure.bindings {
            let (file, parameters) = package.parameters(binding)?;
            given.extend(loaded.bound(&file, &parameters, "", &structure)?);
        }
        values::set(&mut loaded.system, &given)?;
        Ok(loaded)
    }

    /// Feeds an input over time: one of the system's, or `component.variable`.
    ///
    /// # Errors
    /// No input has this name, or it is already fed.
    pub fn input(&mut self, name: &str, schedule: &Schedule) -> Result<(), Error> {
        for port in self.connectors.ports(name)? {
            self.system.input(&port, schedule.clone())?;
        }
        Ok(())
    }

    /// Feeds an input of any type over time, as [`input`](Self::input), from texts of a user or a file.
    ///
    /// # Errors
    /// No input has this name, it is already fed, or a text is not a value of its type.
    pub fn sequence(&mut self, name: &str, texts: &Sequence) -> Result<(), Error> {
        for port in self.connectors.ports(name)? {
            self.system.sequence(&port, texts)?;
        }
        Ok(())
    }

    /// Feeds an input over time from user input: see [`Schedule::parse`] for a number, and [`Sequence::parse`] for an input of
    /// another type.
    ///
    /// # Errors
    /// As [`input`](Self::input), or the text has another form.
    pub fn points(&mut self, name: &str, text: &str) -> Result<(), Error> {
        for port in self.connectors.ports(name)? {
            let wrong = Error::Invalid;
            if self.system.is_real(&port)? || (!self.system.is_text(&port)? && text.contains('~')) {
                self.system.input(&port, Schedule::parse(text).map_err(wrong)?)?;
            } else {
                self.system.sequence(&port, &Sequence::parse(text).map_err(wrong)?)?;
            }
        }
        Ok(())
    }

    /// Sets a value: of an input of the system, or of `component.variable`.
    ///
    /// # Errors
    /// No variable has this name, or the FMU refuses the value.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), Error> {
        for port in self.connectors.ports(name)? {
            self.system.set(&port, value)?;
        }
        Ok(())
    }

    /// Whether a name is that of a connector of the system or of a variable, written `component.variable`.
    pub fn has(&self, name: &str) -> bool {
        self.connectors.source(name).is_ok_and(|port| self.system.has(&port))
    }

    /// Records a connector of the system, or `component.variable`; a pattern with `*` and `?` records all that have its form.
    ///
    /// # Errors
    /// The variable does not exist, or is neither a number nor a text.
    pub fn record(&mut self, name: &str) -> Result<(), Error> {
        if is_pattern(name) && !self.has(name) {
            let of_system = self.connectors.outputs.iter().map(|(name, _)| name).filter(|n| matches(name, n));
            let all: Vec<String> = of_system.cloned().chain(self.system.matching(name)).collect();
            if all.is_empty() {
                return invalid(format!("{name}: no variable has a name of this form"));
            }
            return all.iter().try_for_each(|name| self.record_one(name));
        }
        self.record_one(name)
    }

    fn record_one(&mut self, name: &str) -> Result<(), Error> {
        let port = self.connectors.source(name)?;
        if self.system.is_text(&port)? {
            return Ok(self.system.record_text_as(&port, name)?);
        }
        Ok(self.system.record_as(&port, name)?)
    }

    /// Records all outputs of the system, or those of all FMUs if it has none.
    ///
    /// # Errors
    /// As [`record`](Self::record).
    pub fn record_outputs(&mut self) -> Result<(), Error> {
        if self.connectors.outputs.is_empty() {
            return Ok(self.system.record_outputs()?);
        }
        self.connectors.outputs.clone().iter().try_for_each(|(name, _)| self.record(name))
    }

    /// Every connector of a component is a variable of its FMU, of that causality.
    fn check_connectors(&self, connectors: &[Connector], component: &str) -> Result<(), String> {
        let Some(instance) = self.system.instances().iter().find(|i| i.name() == component) else { return Ok(()) };
        let md = instance.description();
        for Connector { name, kind, line, .. } in connectors {
            match md.variable(name) {
                None => {
                    let of_kind: Vec<&str> =
                        md.variables.iter().filter(|v| v.causality.as_str() == kind).map(|v| v.name.as_str()).collect();
                    let known = format!("its variables of kind {kind} are {}", of_kind.join(", "));
                    return Err(format!(
                        "line {line}: {component} ({}) has no variable {name}; {known}",
                        md.model_name
                    ));
                }
                Some(v) if v.causality.as_str() != kind => {
                    return Err(format!(
                        "line {line}: {component}.{name} is {} and not {kind}: correct kind",
                        v.causality
                    ));
                }
                Some(_) => {}
            }
        }
        Ok(())
    }

    fn connect(&mut self, structure: &Structure, c: &Connection) -> Result<(), String> {
        // `flat` has determined the direction.
        let (from, to) = (&c.start, &c.end);
        let (start, end) = (find(structure, from)?, find(structure, to)?);
        let units = if c.no_conversion { Units::PassOn } else { self.system.units() };
        let stated = [start, end].map(|end| structure.measured(end));
        let port = |end: &ConnectionEnd| end.element.as_ref().map(|element| format!("{element}.{}", end.connector));
        match (port(from), port(to)) {
            (_, Some(target)) if self.is_fed(&target)? => {
                Err(format!("{target} is fed twice: remove one of the connections"))
            }
            (Some(source), Some(target)) => {
                let crossing = Crossing { units, stated, transformation: c.transformation, table: c.table.as_deref() };
                self.system.connect_by(&source, &target, &crossing).map_err(|e| e.to_string())
            }
            (None, Some(target)) => {
                self.check_unit(&target, units, stated)?;
                match self.connectors.inputs.iter_mut().find(|(name, _)| *name == from.connector) {
                    Some((_, targets)) => targets.push(target),
                    None => self.connectors.inputs.push((from.connector.clone(), vec![target])),
                }
                Ok(())
            }
            (Some(source), None) => {
                if self.connectors.outputs.iter().any(|(name, _)| *name == to.connector) {
                    return Err(format!(
                        "the output {} is connected twice: remove one of the connections",
                        to.connector
                    ));
                }
                self.check_unit(&source, units, [stated[1], stated[0]])?;
                self.connectors.outputs.push((to.connector.clone(), source));
                Ok(())
            }
            (None, None) => Err("connects the system with itself, which is not supported: remove it".into()),
        }
    }

    /// A connector of the system has the unit of the variable that it represents. `stated` are the units of the connector of the
    /// system and of that of the component.
    fn check_unit(&mut self, port: &str, units: Units, stated: [Option<Measured<'_>>; 2]) -> Result<(), String> {
        let [Some(of_system), _] = stated else { return Ok(()) };
        if units == Units::PassOn {
            return Ok(());
        }
        match of_system.into_unit(self.system.measured(port, stated[1]).map_err(|e| e.to_string())?) {
            Ok(Passage::Converted(_)) => Err(format!(
                "the connector of the system is in {}, and {port} in another unit: give both in one",
                of_system.unit.unwrap_or_default()
            )),
            Ok(Passage::Unknown(cause)) => {
                self.system.note(format!("the system to {port}: {cause}: the number passes unchanged"));
                Ok(())
            }
            Ok(Passage::Equal) => Ok(()),
            Err(cause) => Err(format!("{port}: {cause}")),
        }
    }

    fn is_fed(&self, target: &str) -> Result<bool, String> {
        let outside = self.connectors.inputs.iter().any(|(_, targets)| targets.iter().any(|t| t == target));
        Ok(outside || self.system.is_fed(target).map_err(|e| e.to_string())?)
    }

    /// The values of a binding; names begin with `prefix`; the name of a system's connector refers to the variable connected to
    /// it.
    fn bound(
        &mut self,
        file: &str,
        parameters: &[Parameter],
        prefix: &str,
        structure: &Structure,
    ) -> Result<Vec<Given>, Error> {
        let mut given = Vec::new();
        for p in parameters {
            let full = format!("{prefix}{}", p.name);
            let input = self.connectors.inputs.iter().find(|(name, _)| prefix.is_empty() && *name == p.name);
            let reached = structure.reach.iter().find(|(name, _)| *name == full);
            let ports = match (input, reached) {
                (Some((_, targets)), _) => targets.iter().map(|target| (target.clone(), None)).collect(),
                (None, Some((_, targets))) => targets.clone(),
                (None, None) => vec![(full, None)],
            };
            for (port, conversion) in ports {
                let has = |i: &fmu_import::Instance| {
                    let variable = port.strip_prefix(i.name())?.strip_prefix('.')?;
                    values::find(i.description(), variable).map(|_| (i.name().to_owned(), variable.to_owned()))
                };
                match self.system.instances().iter().find_map(has) {
                    Some((instance, name)) => {
                        let mut parameter = Parameter { name, ..p.clone() };
                        if let Some(conversion) = &conversion {
                            let wrong = |cause| Error::Invalid(format!("{file}: line {}: {}: {cause}", p.line, p.name));
                            parameter.value = ssm::transformed(&p.value, conversion).map_err(wrong)?;
                        }
                        given.push(Given { instance, file: file.into(), parameter });
                    }
                    None => {
                        self.notes.push(format!("{file}: line {}: there is no {port}; the value is ignored", p.line));
                    }
                }
            }
        }
        Ok(given)
    }
}

/// `plant=a/b.fmu`, or `a/b.fmu` with the name `b`.
///
/// # Errors
/// The name is empty, or there is no file name.
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
mod tests {
    use super::*;

    #[test]
    fn names_of_instances() {
        let name = |text| name_and_path(text).map(|(name, path)| (name, path.to_owned())).unwrap();
        assert_eq!(name("a/PmsmPlant.fmu"), ("PmsmPlant".into(), "a/PmsmPlant.fmu".into()));
        assert_eq!(name("p=a/x=y.fmu"), ("p".into(), "a/x=y.fmu".into()));
        assert_eq!(name("a=b/c.fmu"), ("a".into(), "b/c.fmu".into()));
        assert_eq!(name("./a=b/c.fmu"), ("c".into(), "./a=b/c.fmu".into()));
        assert!(name_and_path("=x.fmu").is_err());
    }

    #[test]
    fn what_is_not_said_comes_from_the_fmus() {
        let experiment = |stop, step| Experiment { start: None, stop, step, tolerance: None };
        let of = |experiments: &[Experiment]| Loaded { experiments: experiments.to_vec(), ..Loaded::default() };
        let two = of(&[experiment(Some(2.0), Some(1e-4)), experiment(Some(3.0), Some(2e-4))]);
        let s = two.settings(None, None, None, true);
        assert_eq!((s.start, s.stop, s.step, s.sequential), (0.0, 3.0, 1e-4, true));
        assert!((two.settings(Some(5.0), None, None, false).stop - 8.0).abs() < 1e-12);
        let s = of(&[experiment(None, None)]).settings(None, Some(4.0), None, false);
        assert_eq!((s.stop, s.step), (4.0, 0.004));
    }
}
