//! A master for several FMUs: connects outputs to inputs, feeds inputs over time, steps, records.
//!
//! At every communication point `t = start + k h` the master reads all outputs and sets all inputs; then it steps all
//! FMUs (Jacobi), so that what is sent at `t` acts from `t` on. With [`Settings::sequential`] it steps them one after the
//! other in the order they were added, each with what those before it have just computed (Gauss-Seidel).
//!
//! ```no_run
//! # fn main() -> Result<(), fmu_import::Error> {
//! use fmu_import::{Fmu, cosimulation::{Schedule, Settings, System}};
//!
//! let mut system = System::default();
//! system.add("plant", &Fmu::open("target/fmu/fmi3/PmsmPlant.fmu")?, false)?;
//! system.add("controller", &Fmu::open("target/fmu/fmi3/SensorlessController.fmu")?, false)?;
//! system.connect_by_name()?;
//! system.set("plant.motor.R_s", "3.0")?;
//! system.input("controller.speed_ref", Schedule::parse("0:0,0.1:52.36").unwrap())?;
//! system.record("plant.speed")?;
//! let settings = Settings { start: 0.0, stop: 1.0, step: 1e-4, sequential: false };
//! let recording = system.run(&settings, |_| Ok(std::ops::ControlFlow::Continue(())))?;
//! println!("{:?}", recording.column("plant.speed").unwrap().values.last());
//! # Ok(()) }
//! ```

mod exchange;
mod grid;
mod recording;
mod run;
mod schedule;
mod terminals;

pub use grid::Settings;
pub use recording::{Column, Recording};
pub use run::Point;
pub use schedule::Schedule;

use crate::{Error, Fmu, Instance, Message};
use exchange::{Source, Wiring};
use model_description::{BaseType, Causality, ModelVariable, TerminalsAndIcons};

/// FMUs and how they belong together.
#[derive(Default)]
pub struct System {
    instances: Vec<Instance>,
    /// Of each instance; what is wrong with them only matters to who asks for them.
    terminals: Vec<Result<Option<TerminalsAndIcons>, Error>>,
    wiring: Wiring,
    /// Variables that were set from outside.
    set: Vec<Port>,
    records: Vec<Port>,
    /// Names of the recorded columns.
    columns: Vec<String>,
}

/// A variable of one of the instances.
#[derive(Clone, Debug, PartialEq)]
struct Port {
    instance: usize,
    name: String,
    reference: u32,
    base: BaseType,
}

impl System {
    /// Adds an instance of an FMU.
    ///
    /// # Errors
    /// The name is taken, or the FMU refuses.
    pub fn add(&mut self, name: &str, fmu: &Fmu, logging: bool) -> Result<(), Error> {
        if self.instances.iter().any(|i| i.name() == name) {
            return Err(Error::usage(name, "two instances have this name; NAME=FILE gives another"));
        }
        self.instances.push(fmu.instantiate(name, logging)?);
        self.terminals.push(fmu.terminals().map(Option::<&_>::cloned));
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

    /// Sets a parameter, or the value of an input that nothing else feeds: `instance.variable` and a text.
    ///
    /// # Errors
    /// There is no such variable, the text is no value of its type, or the FMU refuses.
    pub fn set(&mut self, port: &str, text: &str) -> Result<(), Error> {
        let port = self.port(port)?;
        self.instances[port.instance].set_text(&port.name, text)?;
        self.set.push(port);
        Ok(())
    }

    /// Connects an output to an input, both written `instance.variable`.
    ///
    /// # Errors
    /// There is no such variable, the causalities or types do not fit, or the input is fed already.
    pub fn connect(&mut self, from: &str, to: &str) -> Result<(), Error> {
        let (source, target) = (self.scalar(from)?, self.scalar(to)?);
        if !matches!(self.causality(&source), Causality::Output | Causality::Local) {
            return Err(Error::usage(from, "is no output"));
        }
        if kind(source.base) != kind(target.base) {
            return Err(Error::usage(to, format!("has the type {}, {from} has {}", target.base, source.base)));
        }
        self.feed(target, to, Source::Port(source))
    }

    /// Connects every input that nothing feeds to the output of the same name of another FMU; returns the connections.
    ///
    /// # Errors
    /// Several FMUs have the output.
    pub fn connect_by_name(&mut self) -> Result<Vec<(String, String)>, Error> {
        let mut found = Vec::new();
        let names = |i: &Instance, causality| -> Vec<String> {
            i.description().variables.iter().filter(|v| v.causality == causality).map(|v| v.name.clone()).collect()
        };
        for (index, target) in self.instances.iter().enumerate() {
            for input in names(target, Causality::Input) {
                if self.wiring.feeds(index, &input) {
                    continue;
                }
                let others = self.instances.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, other)| other);
                let sources: Vec<_> = others.filter(|o| names(o, Causality::Output).contains(&input)).collect();
                let to = format!("{}.{input}", target.name());
                match sources.as_slice() {
                    [] => {}
                    [one] => found.push((format!("{}.{input}", one.name()), to)),
                    [one, two, ..] => {
                        let cause = format!("both {} and {} have an output of this name", one.name(), two.name());
                        return Err(Error::usage(&to, cause));
                    }
                }
            }
        }
        for (from, to) in &found {
            self.connect(from, to)?;
        }
        Ok(found)
    }

    /// Feeds an input over time.
    ///
    /// # Errors
    /// There is no such variable, it is no number, or it is fed already.
    pub fn input(&mut self, port: &str, schedule: Schedule) -> Result<(), Error> {
        let target = self.scalar(port)?;
        self.feed(target, port, Source::Schedule(schedule))
    }

    /// Records a variable at every communication point. A connected input is recorded as what it is connected to.
    ///
    /// # Errors
    /// There is no such variable, or it is no number.
    pub fn record(&mut self, port: &str) -> Result<(), Error> {
        self.record_as(port, port)
    }

    /// The same under another name.
    ///
    /// # Errors
    /// As [`record`](Self::record).
    pub fn record_as(&mut self, port: &str, name: &str) -> Result<(), Error> {
        let port = self.scalar(port)?;
        self.records.push(port);
        self.columns.push(name.into());
        Ok(())
    }

    /// Whether a connection or a schedule feeds an input, written `instance.variable`.
    ///
    /// # Errors
    /// There is no such variable.
    pub fn is_fed(&self, port: &str) -> Result<bool, Error> {
        let port = self.port(port)?;
        Ok(self.wiring.feeds(port.instance, &port.name))
    }

    /// The inputs of an instance that nothing feeds and nobody has set: they keep their start values.
    pub fn untouched(&self, instance: usize) -> Vec<&ModelVariable> {
        let touched = |name: &str| {
            self.wiring.feeds(instance, name) || self.set.iter().any(|p| p.instance == instance && p.name == name)
        };
        let is_free =
            |v: &&ModelVariable| v.causality == Causality::Input && v.base != BaseType::Clock && !touched(&v.name);
        self.instances[instance].description().variables.iter().filter(is_free).collect()
    }

    /// Records all outputs of all instances.
    ///
    /// # Errors
    /// None that is known: outputs that are no numbers are left out.
    pub fn record_outputs(&mut self) -> Result<(), Error> {
        let outputs = |i: &Instance| {
            let is_scalar =
                |v: &&ModelVariable| v.causality == Causality::Output && !v.is_array() && kind(v.base).is_some();
            let name = |v: &ModelVariable| format!("{}.{}", i.name(), v.name);
            i.description().variables.iter().filter(is_scalar).map(name).collect::<Vec<_>>()
        };
        let all: Vec<String> = self.instances.iter().flat_map(outputs).collect();
        all.iter().try_for_each(|port| self.record(port))
    }

    fn feed(&mut self, target: Port, written: &str, source: Source) -> Result<(), Error> {
        if self.causality(&target) != Causality::Input {
            return Err(Error::usage(written, "is no input"));
        }
        if self.wiring.feeds(target.instance, &target.name) {
            return Err(Error::usage(written, "is fed twice"));
        }
        self.wiring.add(target, source);
        Ok(())
    }

    fn causality(&self, port: &Port) -> Causality {
        let variable = self.instances[port.instance].description().variable(&port.name);
        variable.map_or(Causality::Local, |v| v.causality)
    }

    /// `instance.variable`.
    fn port(&self, text: &str) -> Result<Port, Error> {
        let (instance, name) = self.instance_and_rest(text, "VARIABLE")?;
        let variable = self.instances[instance].variable(name)?;
        Ok(Port { instance, reference: variable.value_reference, base: variable.base, name: name.to_owned() })
    }

    /// The instance and what follows its name and a dot; an instance's name may itself have dots.
    fn instance_and_rest<'a>(&self, text: &'a str, what: &str) -> Result<(usize, &'a str), Error> {
        let split = |(index, i): (usize, &Instance)| {
            Some((index, i.name().len(), text.strip_prefix(i.name())?.strip_prefix('.')?))
        };
        let best = self.instances.iter().enumerate().filter_map(split).max_by_key(|(_, length, _)| *length);
        let names = || self.instances.iter().map(Instance::name).collect::<Vec<_>>().join(", ");
        let wrong = || Error::usage(text, format!("is not INSTANCE.{what}; the instances are {}", names()));
        best.map(|(index, _, rest)| (index, rest)).ok_or_else(wrong)
    }

    /// A port that is one number.
    fn scalar(&self, text: &str) -> Result<Port, Error> {
        let port = self.port(text)?;
        if self.instances[port.instance].variable(&port.name)?.is_array() {
            return Err(Error::usage(text, "is an array; only scalars can be connected, fed and recorded"));
        }
        if kind(port.base).is_none() {
            return Err(Error::usage(
                text,
                format!("is a {}; only numbers can be connected, fed and recorded", port.base),
            ));
        }
        Ok(port)
    }
}

fn take_messages(instances: &[Instance]) -> Vec<(String, Message)> {
    let of = |i: &Instance| i.take_messages().into_iter().map(|m| (i.name().to_owned(), m)).collect::<Vec<_>>();
    instances.iter().flat_map(of).collect()
}

/// Types between which a value may travel have the same letter.
fn kind(base: BaseType) -> Option<char> {
    match base {
        BaseType::Float32 | BaseType::Float64 => Some('r'),
        BaseType::Boolean => Some('b'),
        BaseType::String | BaseType::Binary | BaseType::Clock => None,
        _ => Some('i'),
    }
}
