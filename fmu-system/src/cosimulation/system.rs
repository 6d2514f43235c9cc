//! FMUs and their connections, before a run.

use super::Column;
use super::grid::{Grid, Settings};
use super::method::Method;
use super::parts::{Part, Parts, Port, kind};
use super::point::take_messages;
use super::schedule::{SAME, Schedule};
use super::sequence::Sequence;
use super::wiring::{Outlet, Record, Source, Units, Wiring};
use fmu_core::Need;
use fmu_import::written::matches;
use fmu_import::{Error, Fmu, Instance, Kind, Logging, Message, Values};
use model_description::{BaseType, Causality, Interface, ModelVariable, Variability, parse_number};

/// Integers below this one are doubles.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// FMUs and their connections.
#[derive(Default)]
pub struct System {
    pub(super) method: Method,
    pub(super) parts: Parts,
    /// One of each part.
    pub(super) instances: Vec<Instance>,
    pub(super) wiring: Wiring,
    /// Values set by the user.
    pub(super) set: Vec<(Port, Values)>,
    pub(super) records: Vec<Record>,
    /// The recorded columns, without values.
    pub(super) columns: Vec<Column>,
    /// Texts that a single run records, with the names of their columns.
    pub(super) texts: Vec<(Port, String)>,
    pub(super) units: Units,
    tolerance: Option<f64>,
    pub(super) notes: Vec<String>,
    pub(super) listener: Option<fn(&str)>,
}

impl System {
    /// A system to be run by this method.
    pub fn new(method: Method) -> Self {
        Self { method, ..Self::default() }
    }

    /// The system with other connections from here on: by default they convert units.
    #[must_use]
    pub fn with_units(self, units: Units) -> Self {
        Self { units, ..self }
    }

    /// The system with this relative tolerance for the solvers inside FMUs for Co-Simulation; by default each uses the
    /// tolerance of its default experiment.
    #[must_use]
    pub fn with_tolerance(self, tolerance: Option<f64>) -> Self {
        Self { tolerance, ..self }
    }

    /// The system with a listener for notes during a run, which [`take_notes`](Self::take_notes) then omits.
    #[must_use]
    pub fn with_listener(self, listener: fn(&str)) -> Self {
        Self { listener: Some(listener), ..self }
    }

    /// The effect of connections between different units.
    pub fn units(&self) -> Units {
        self.units
    }

    /// The method of running the system.
    pub fn method(&self) -> &Method {
        &self.method
    }

    /// The settings that the FMUs can follow: where one cannot vary its step (`canHandleVariableCommunicationStepSize` is false), no
    /// shorter last step. A resulting change is reported as a [note](Self::take_notes), as are a step that an FMU's
    /// `fixedInternalStepSize` does not divide, and an input that jumps between two communication points.
    ///
    /// # Errors
    /// The settings are invalid, or allow no step.
    pub fn feasible(&mut self, settings: &Settings) -> Result<Settings, Error> {
        let wrong = |cause| Error::usage("settings", cause);
        let grid = settings.grid().map_err(wrong)?;
        let stepping = |i: &Instance| match i.kind() {
            Kind::CoSimulation { .. } => i.description().co_simulation.clone().map(|of| (i.name().to_owned(), of)),
            Kind::ModelExchange => None,
        };
        let interfaces: Vec<(String, Interface)> = self.instances.iter().filter_map(stepping).collect();
        for (name, interface) in &interfaces {
            let internal = interface.attribute("fixedInternalStepSize").and_then(parse_number).filter(|h| *h > 0.0);
            let count = internal.map_or(1.0, |internal| settings.step / internal);
            if count < 0.5 || (count - count.round()).abs() > 1e-6 * count {
                let h = internal.unwrap_or_default();
                let cause = format!(
                    "its fixedInternalStepSize is {h} s, and the step of {} s is not a multiple",
                    settings.step
                );
                self.notes.push(format!("{name}: {cause}"));
            }
        }
        let never = self.wiring.jumps().filter_map(|(port, times)| {
            let first = *times.first().filter(|t| **t > settings.stop + SAME)?;
            let (name, stop) = (self.instances[port.instance].name(), settings.stop);
            Some(format!("{name}.{}: its value first changes at {first} s, after the stop time of {stop} s", port.name))
        });
        let never: Vec<String> = never.collect();
        self.notes.extend(never);
        let meets = self.meets();
        let late = self.wiring.jumps().filter_map(|(port, times)| {
            let instance = &self.instances[port.instance];
            let stepped = matches!(instance.kind(), Kind::CoSimulation { event_mode: false, .. });
            let (t, after) = times.into_iter().find_map(|t| Some((t, grid.after(t)?))).filter(|_| stepped)?;
            let what = format!("the value at {t} s lies between two communication points");
            let cause = match &meets {
                Ok(()) => format!("{what}: a step ends there"),
                Err(why) => format!("{what} and acts from {after} s on: {why}"),
            };
            Some(format!("{}.{}: {cause}", instance.name(), port.name))
        });
        let late: Vec<String> = late.collect();
        self.notes.extend(late);
        let fixed = interfaces.iter().find(|(_, of)| !of.flag("canHandleVariableCommunicationStepSize"));
        let (Some((name, _)), Some(shorter)) = (fixed, grid.without_short_step()) else { return Ok(*settings) };
        let cause = format!("{name} cannot vary its step (canHandleVariableCommunicationStepSize is false)");
        if shorter.stop <= shorter.start {
            return Err(wrong(format!("{cause}, and the simulation is shorter than one step of {} s", settings.step)));
        }
        self.notes.push(format!("{cause}: the simulation ends with the last whole step, at {} s", shorter.stop));
        Ok(shorter)
    }

    /// Whether steps may end where an input jumps, or the FMU that does not allow it.
    fn meets(&self) -> Result<(), String> {
        if let Method::ModelExchange(_) = self.method {
            return Err("FMUs for Co-Simulation step from one communication point to the next".into());
        }
        let rigid = |i: &&Instance| {
            let of = i.description().co_simulation.as_ref();
            !of.is_some_and(|of| {
                of.flag("canHandleVariableCommunicationStepSize") && of.attribute("fixedInternalStepSize").is_none()
            })
        };
        let fixed = self.instances.iter().find(rigid);
        fixed.map_or(Ok(()), |i| Err(format!("{} cannot vary its step", i.name())))
    }

    /// The communication points of a run.
    pub(super) fn grid(&mut self, settings: &Settings) -> Result<Grid, Error> {
        let mut grid = self.feasible(settings)?.grid().map_err(|cause| Error::usage("settings", cause))?;
        (grid.tolerance, grid.meets) = (self.tolerance, self.meets().is_ok());
        Ok(grid)
    }

    /// Adds a note.
    pub(crate) fn note(&mut self, text: String) {
        self.notes.push(text);
    }

    /// Notes since the last call: unknown units.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Adds an instance of an FMU, which logs everything or, without `logging`, warnings and errors.
    ///
    /// # Errors
    /// The name is taken, or the FMU refuses.
    pub fn add(&mut self, name: &str, fmu: &Fmu, logging: bool) -> Result<(), Error> {
        if self.instances.iter().any(|i| i.name() == name) {
            return Err(Error::usage(name, "two instances have this name; NAME=FILE gives another"));
        }
        // An FMU with clocks needs event mode.
        let clocked = fmu.description().variables.iter().any(|v| v.base == BaseType::Clock);
        if let Method::CoSimulation { event_mode, .. } = &mut self.method {
            *event_mode |= clocked;
        }
        let kind = self.method.kind(name, fmu);
        let logging = if logging { Logging::All } else { Logging::Warnings };
        self.instances.push(fmu.instantiate_as(kind, name, logging)?);
        self.parts.0.push(Part { name: name.into(), fmu: fmu.clone(), logging, kind, sizes: Vec::new() });
        Ok(())
    }

    /// The instances, in the order they were added.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Log messages since the last call, with the names of the instances.
    pub fn take_messages(&self) -> Vec<(String, Message)> {
        take_messages(&self.instances)
    }

    /// Whether a variable, written `instance.variable`, is a structural parameter.
    ///
    /// # Errors
    /// The variable does not exist.
    pub fn is_size(&self, port: &str) -> Result<bool, Error> {
        Ok(self.parts.causality(&self.parts.port(port)?) == Causality::StructuralParameter)
    }

    /// Sets structural parameters, each as `instance.variable` and a text; all of an instance together, in Configuration Mode.
    /// Arrays then have other sizes, so call this before anything that names variables; values already set are set again.
    ///
    /// # Errors
    /// A variable does not exist or is not a structural parameter, a text is not a value of its type, an array already set has
    /// another size now, or the FMU refuses.
    pub fn configure<'a>(&mut self, sizes: impl IntoIterator<Item = (&'a str, &'a str)>) -> Result<(), Error> {
        let mut changed = vec![false; self.instances.len()];
        for (written, text) in sizes {
            if !self.is_size(written)? {
                return Err(Error::usage(written, "is not a structural parameter"));
            }
            let port = self.parts.port(written)?;
            let values = self.instances[port.instance].parse(&port.name, text)?;
            changed[port.instance] = true;
            self.parts.0[port.instance].sizes.retain(|(other, _)| *other != port);
            self.parts.0[port.instance].sizes.push((port, values));
        }
        for (index, instance) in self.instances.iter_mut().enumerate().filter(|(index, _)| changed[*index]) {
            self.parts.0[index].configure(instance)?;
            let mut set = self.set.iter().filter(|(port, _)| port.instance == index);
            set.try_for_each(|(port, values)| instance.set(&port.name, values))?;
        }
        Ok(())
    }

    /// Sets a parameter or the value of an unconnected input: `instance.variable` and a text. Setting an element
    /// of an array keeps the set or start values of the others. [`configure`](Self::configure) sets several structural
    /// parameters.
    ///
    /// # Errors
    /// The variable does not exist, the text is not a value of its type, or the FMU refuses.
    pub fn set(&mut self, port: &str, text: &str) -> Result<(), Error> {
        if self.is_size(port)? {
            return self.configure([(port, text)]);
        }
        let port = self.parts.port(port)?;
        let present = self.present(&port)?;
        let (index, description) = (port.instance, self.parts.0[port.instance].description());
        let variable = self.parts.variable(index, &port.name)?;
        let wrong = |cause: String| Error::usage(self.instances[index].name(), cause);
        let read = |text: &str| Values::read(text, variable, description).map_err(wrong);
        let mut values = read(text)?;
        let mut whole = port;
        if let Some(element) = whole.element.take() {
            let count = whole.count;
            let one = values;
            let name = std::mem::replace(&mut whole.name, variable.name.clone());
            let before = self.value_set(index, &whole.name).cloned().or(present);
            values = before.map_or_else(|| Values::start(variable, description).map_err(wrong), Ok)?;
            if values.len() != count || !values.replace(element, &one) {
                return Err(wrong(format!("{name} = {text} is not one value, or the start values are not known")));
            }
        }
        self.instances[index].set(&whole.name, &values)?;
        self.set.pop_if(|(last, _)| *last == whole);
        self.set.push((whole, values));
        Ok(())
    }

    /// Feeds an input or a tunable parameter over time.
    ///
    /// # Errors
    /// The variable does not exist, is not a number, has other units, or is fed already.
    pub fn input(&mut self, port: &str, schedule: Schedule) -> Result<(), Error> {
        let target = self.parts.scalar(port)?;
        let variable = self.parts.variable(target.instance, &target.name)?;
        let schedule = schedule.in_unit_of(variable, self.instances[target.instance].description());
        let schedule = schedule.map_err(|cause| Error::usage(self.instances[target.instance].name(), cause))?;
        if !target.base.is_float() && schedule.magnitude() >= EXACT {
            let cause =
                format!("is a {}, and lines to integers of 2^53 and more would lose digits: give steps", target.base);
            return Err(Error::usage(port, cause));
        }
        self.feed(target, port, Source::Schedule(schedule))
    }

    /// The columns of a recording, in the order of the requests, without values.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Records a variable at every communication point. A connected input is recorded as its source.
    ///
    /// # Errors
    /// The variable does not exist or is not a number.
    pub fn record(&mut self, port: &str) -> Result<(), Error> {
        self.record_as(port, port)
    }

    /// Records a variable under another name.
    ///
    /// # Errors
    /// As [`record`](Self::record).
    pub fn record_as(&mut self, port: &str, name: &str) -> Result<(), Error> {
        self.record_through(&Outlet { port: port.into(), name: name.into(), ..Outlet::default() })
    }

    /// Records a variable under another name and through a transformation.
    ///
    /// # Errors
    /// As [`record`](Self::record), or its type does not fit the transformation.
    pub fn record_through(&mut self, outlet: &Outlet) -> Result<(), Error> {
        let port = self.parts.scalar(&outlet.port)?;
        self.columns.push(self.parts.outlet(&port, outlet));
        self.records.push(Record { change: self.parts.change(&port, outlet)?, port });
        Ok(())
    }

    /// Texts over time as [`sequence`](Self::sequence) feeds them to a real variable: lines, in its unit; `None` for other types.
    ///
    /// # Errors
    /// The variable does not exist, a text is not a number, or the unit is not the variable's.
    pub fn lines(&self, port: &str, texts: &Sequence) -> Result<Option<Schedule>, Error> {
        if !self.is_real(port)? {
            return Ok(None);
        }
        let (target, wrong) = (self.parts.port(port)?, |cause| Error::usage(port, cause));
        let variable = self.parts.variable(target.instance, &target.name)?;
        let schedule = texts.lines().map_err(wrong)?;
        schedule.in_unit_of(variable, self.instances[target.instance].description()).map(Some).map_err(wrong)
    }

    /// Feeds an input or a tunable parameter of any type over time; values that are not real numbers are held.
    ///
    /// # Errors
    /// The variable does not exist, a text is not a value of its type, or it is fed already.
    pub fn sequence(&mut self, port: &str, texts: &Sequence) -> Result<(), Error> {
        if let Some(schedule) = self.lines(port, texts)? {
            return self.input(port, schedule);
        }
        let target = self.parts.port(port)?;
        let variable = self.parts.variable(target.instance, &target.name)?;
        let (instance, wrong) = (&self.instances[target.instance], |cause: String| Error::usage(port, cause));
        if target.element.is_some() {
            return Err(wrong("is an element of an array: feed the array, with spaces between its elements".into()));
        }
        self.check_fed(&target, port, true)?;
        let values = texts.values(variable, instance.description()).map_err(wrong)?;
        let count = instance.elements(variable)?;
        if !values.fits(count) {
            return Err(wrong(format!("has {count} elements, and a value has another number")));
        }
        if let Some(steps) = values.steps().filter(|_| !target.is_whole()) {
            return self.feed(target, port, Source::Schedule(steps));
        }
        self.wiring.hold(target, values);
        Ok(())
    }

    /// Whether there is a variable of this name, written `instance.variable`.
    pub fn has(&self, port: &str) -> bool {
        self.parts.port(port).is_ok()
    }

    /// The extents of an array, written `instance.variable`, with the sizes set; none for one value.
    ///
    /// # Errors
    /// The variable does not exist.
    pub fn shape(&self, port: &str) -> Result<Vec<usize>, Error> {
        let port = self.parts.port(port)?;
        Ok(if port.is_whole() { self.parts.shape(&port) } else { Vec::new() })
    }

    /// The variables whose names match a pattern, in the order of the FMUs, without clocks and time.
    pub fn matching(&self, pattern: &str) -> Vec<String> {
        let alone = self.instances.len() == 1;
        let is_value = |v: &&ModelVariable| v.base != BaseType::Clock && v.causality != Causality::Independent;
        let of = |i: &Instance| {
            let full = |v: &ModelVariable| {
                let full = format!("{}.{}", i.name(), v.name);
                (matches(pattern, &full) || (alone && matches(pattern, &v.name))).then_some(full)
            };
            i.description().variables.iter().filter(is_value).filter_map(full).collect::<Vec<_>>()
        };
        self.instances.iter().flat_map(of).collect()
    }

    /// Records a variable under this name in a column of texts, in a single run: a text, bytes in hexadecimal digits, or an array
    /// with spaces between its elements.
    ///
    /// # Errors
    /// The variable does not exist, is one number, or is a clock.
    pub fn record_text_as(&mut self, port: &str, name: &str) -> Result<(), Error> {
        let found = self.parts.port(port)?;
        if !self.is_text(port)? || found.base == BaseType::Clock {
            return Err(Error::usage(port, "is one number, or a clock"));
        }
        self.texts.push((found, name.into()));
        Ok(())
    }

    /// Whether a variable, written `instance.variable`, is recorded as text: it is not one number.
    ///
    /// # Errors
    /// The variable does not exist.
    pub fn is_text(&self, port: &str) -> Result<bool, Error> {
        let port = self.parts.port(port)?;
        Ok(port.is_whole() || matches!(port.base, BaseType::String | BaseType::Binary))
    }

    /// Whether a variable, written `instance.variable`, is one real number.
    ///
    /// # Errors
    /// The variable does not exist.
    pub fn is_real(&self, port: &str) -> Result<bool, Error> {
        Ok(!self.is_text(port)? && self.parts.port(port)?.base.is_float())
    }

    /// Whether a connection or a schedule feeds an input, written `instance.variable`.
    ///
    /// # Errors
    /// The variable does not exist.
    pub fn is_fed(&self, port: &str) -> Result<bool, Error> {
        let port = self.parts.port(port)?;
        Ok(self.wiring.feeds(port.instance, &port.name))
    }

    /// The inputs of an instance that must be fed but are neither fed nor set: they keep their start values.
    pub fn untouched(&self, instance: usize) -> Vec<&ModelVariable> {
        let reference = |name: &str| self.parts.variable(instance, name).map(|v| v.value_reference).ok();
        let touched =
            |name: &str| self.wiring.feeds_any(instance, reference(name)) || self.value_set(instance, name).is_some();
        let is_free =
            |v: &&ModelVariable| v.causality == Causality::Input && v.base != BaseType::Clock && !touched(&v.name);
        let needed = |v: &&ModelVariable| match Need::of(v.description.as_deref().unwrap_or_default()) {
            Need::Always => true,
            Need::Never => false,
            Need::With { parameter, value } => self.has_value(instance, parameter, value),
        };
        self.instances[instance].description().variables.iter().filter(is_free).filter(needed).collect()
    }

    /// The elements of the array of `port`, if sizes were set: its start values are lost.
    fn present(&mut self, port: &Port) -> Result<Option<Values>, Error> {
        let part = &self.parts.0[port.instance];
        if part.sizes.is_empty() || port.element.is_none() {
            return Ok(None);
        }
        let name = &self.parts.variable(port.instance, &port.name)?.name;
        self.instances[port.instance].get(name).map(Some)
    }

    /// The value set last.
    fn value_set(&self, instance: usize, name: &str) -> Option<&Values> {
        let of = |(port, _): &&(Port, Values)| port.instance == instance && port.name == name;
        self.set.iter().rev().find(of).map(|(_, values)| values)
    }

    /// Whether a variable was set to this value or, if it was not set, starts at it.
    fn has_value(&self, instance: usize, name: &str, value: &str) -> bool {
        let description = self.instances[instance].description();
        let Some(variable) = description.variable(name) else { return false };
        let read = |text: &str| Values::read(text, variable, description).ok();
        let now = self.value_set(instance, name).cloned().or_else(|| Values::start(variable, description).ok());
        now.is_some() && now == read(value)
    }

    /// The inputs of these names that a connection or a schedule feeds, written `instance.variable`.
    pub fn fed_inputs(&self, names: &[&str]) -> Vec<String> {
        let all =
            self.instances.iter().enumerate().flat_map(|(index, i)| names.iter().map(move |name| (index, i, *name)));
        all.filter(|(index, _, name)| self.wiring.feeds(*index, name))
            .map(|(_, i, name)| format!("{}.{name}", i.name()))
            .collect()
    }

    /// Records all outputs of all instances.
    ///
    /// # Errors
    /// The variables come from the descriptions, so no error is known.
    pub fn record_outputs(&mut self) -> Result<(), Error> {
        self.outputs().iter().try_for_each(|port| self.record(port))?;
        let texts = self.outputs_of(|v| v.base != BaseType::Clock && (v.is_array() || kind(v.base).is_none()));
        texts.iter().try_for_each(|port| self.record_text_as(port, port))
    }

    /// All numeric outputs of all instances, written `instance.variable`.
    pub fn outputs(&self) -> Vec<String> {
        self.outputs_of(|v| !v.is_array() && kind(v.base).is_some())
    }

    fn outputs_of(&self, of: impl Fn(&ModelVariable) -> bool) -> Vec<String> {
        let outputs = |i: &Instance| {
            let is_one = |v: &&ModelVariable| v.causality == Causality::Output && v.base != BaseType::Clock && of(v);
            let name = |v: &ModelVariable| format!("{}.{}", i.name(), v.name);
            i.description().variables.iter().filter(is_one).map(name).collect::<Vec<_>>()
        };
        self.instances.iter().flat_map(outputs).collect()
    }

    pub(super) fn feed(&mut self, target: Port, written: &str, source: Source) -> Result<(), Error> {
        self.check_fed(&target, written, matches!(source, Source::Schedule(_)))?;
        let variable = self.parts.variable(target.instance, &target.name)?;
        let continuous = variable.variability == Variability::Continuous && variable.base.is_float();
        self.wiring.add(target, source, continuous);
        Ok(())
    }

    /// Whether the variable takes values, over time or from a connection, and is not fed yet.
    pub(super) fn check_fed(&self, target: &Port, written: &str, over_time: bool) -> Result<(), Error> {
        if self.wiring.feeds(target.instance, &target.name) {
            return Err(Error::usage(written, "is fed twice"));
        }
        let variable = self.parts.variable(target.instance, &target.name)?;
        let tunable = variable.causality == Causality::Parameter && variable.variability == Variability::Tunable;
        if variable.causality != Causality::Input && !(tunable && over_time) {
            let also = if over_time { " or a tunable parameter" } else { "" };
            return Err(Error::usage(written, format!("is not an input{also}")));
        }
        Ok(())
    }
}
