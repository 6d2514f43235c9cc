//! One instance of a batch: inputs in, a number of steps, outputs out.

use crate::cache::{self, Opened};
use fmu_import::{Error, FmuState, Instance, Logging, Status, Values};
use fmu_system::cosimulation::with_name;
use model_description::BaseType;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A scalar variable.
#[derive(Clone, Debug)]
pub(crate) struct Port {
    pub(crate) name: String,
    base: BaseType,
    reference: u32,
}

/// Variables that are read or written together.
#[derive(Clone)]
pub(crate) struct Ports {
    pub(crate) all: Vec<Port>,
    references: Vec<u32>,
    /// Whether all are double-precision numbers.
    fast: bool,
}

impl Ports {
    /// Variables by their names.
    pub(crate) fn find(fmu: &fmu_import::Fmu, names: &[String]) -> Result<Self, Error> {
        let description = fmu.description();
        let usage = |cause: String| Error::Usage { instance: description.model_name.clone(), cause };
        let port = |name: &String| {
            let none = || Error::variable(&description.model_name, name, description);
            let v = description.variable(name).ok_or_else(none)?;
            if v.is_array() || matches!(v.base, BaseType::String | BaseType::Binary | BaseType::Clock) {
                return Err(usage(format!("{name} is not a scalar number")));
            }
            Ok(Port { name: name.clone(), base: v.base, reference: v.value_reference })
        };
        let all: Vec<Port> = names.iter().map(port).collect::<Result<_, _>>()?;
        let fast = all.iter().all(|p| p.base == BaseType::Float64);
        Ok(Self { references: all.iter().map(|p| p.reference).collect(), all, fast })
    }

    fn write(&self, instance: &mut Instance, values: &[f64]) -> Result<(), Error> {
        if self.fast {
            return if values.is_empty() { Ok(()) } else { instance.set_reals(&self.references, values) };
        }
        for (port, &x) in self.all.iter().zip(values) {
            let value = Values::from_number(x, port.base);
            let value = value.map_err(|cause| Error::Usage { instance: port.name.clone(), cause })?;
            instance.set_at(port.base, port.reference, &value)?;
        }
        Ok(())
    }

    fn read(&self, instance: &mut Instance, values: &mut [f64]) -> Result<(), Error> {
        if self.fast {
            return instance.get_reals(&self.references, values);
        }
        for (port, x) in self.all.iter().zip(values) {
            *x = instance.get_at(port.base, port.reference, 1)?.number().unwrap_or(f64::NAN);
        }
        Ok(())
    }
}

/// The data that all lanes share.
pub(crate) struct Common {
    pub(crate) actions: Ports,
    pub(crate) observations: Ports,
    /// Communication step (s).
    pub(crate) step: f64,
    /// The FMU can save and set its state.
    pub(crate) states: bool,
    /// A lane has a warning that has not been reported to Python.
    pub(crate) news: AtomicBool,
}

/// One instance with its time.
pub(crate) struct Lane {
    name: String,
    instance: Option<Instance>,
    /// State after the last initialization.
    initial: Option<FmuState>,
    /// Steps since the start; time is never summed up.
    steps: u32,
    /// The error that stops the lane until it is reset.
    pub(crate) error: Option<Error>,
    /// The first warning since the last initialization.
    pub(crate) warning: Option<String>,
    /// The FMU logs warnings in all steps, otherwise only in the first step after an initialization: its checks can take a third of a
    /// short step.
    asks: bool,
    /// The FMU logs warnings now.
    asked: bool,
}

impl Lane {
    pub(crate) fn new(name: String, asks: bool) -> Self {
        Self { name, instance: None, initial: None, steps: 0, error: None, warning: None, asks, asked: false }
    }

    /// Initializes with these start values; replaces an instance that had an error.
    pub(crate) fn initialize(
        &mut self,
        common: &Common,
        opened: &Arc<Opened>,
        ports: &Ports,
        values: &[f64],
    ) -> Result<(), Error> {
        if self.error.take().is_some() {
            self.instance = None;
        }
        self.initial = None;
        let begun = self.begin(common, opened, ports, values);
        if let Err(error) = &begun {
            self.error = Some(error.clone());
        }
        begun
    }

    fn begin(&mut self, common: &Common, opened: &Arc<Opened>, ports: &Ports, values: &[f64]) -> Result<(), Error> {
        let again = self.instance.take().map(|mut instance| {
            instance.reset()?;
            drop(instance.take_messages());
            // A reset may end the logging. An FMU that refuses it gets a new instance.
            Ok(instance.log_warnings(true).is_ok().then_some(instance))
        });
        let instance = match again.transpose()?.flatten() {
            Some(instance) => instance,
            None => opened.fmu.instantiate(&self.name, Logging::Warnings)?,
        };
        (self.steps, self.warning, self.asked) = (0, None, true);
        let instance = self.instance.insert(instance);
        instance.setup(0.0, None)?;
        ports.write(instance, values)?;
        instance.enter_initialization()?;
        instance.exit_initialization()?;
        if common.states {
            self.initial = Some(instance.get_state()?);
        }
        self.listen(common);
        Ok(())
    }

    /// Keeps the first warning.
    fn listen(&mut self, common: &Common) {
        let Self { instance: Some(instance), warning, .. } = self else { return };
        let mut messages = instance.take_messages().into_iter();
        if warning.is_none() {
            let first = messages.find(|message| message.status == Status::WARNING);
            if let Some(message) = first {
                *warning = Some(with_name(&self.name, message.text));
                common.news.store(true, Ordering::Relaxed);
            }
        }
    }

    /// Returns to the last initialization; false if that needs [`initialize`](Self::initialize).
    pub(crate) fn rewind(&mut self) -> Result<bool, Error> {
        let (Some(instance), Some(state), None) = (&mut self.instance, self.initial, &self.error) else {
            return Ok(false);
        };
        instance.set_state(state)?;
        self.steps = 0;
        Ok(true)
    }

    /// Writes the actions, steps and reads. An error stays in `error`, and the observations become NaN.
    pub(crate) fn advance(&mut self, common: &Common, actions: &[f64], repeat: u32, observations: &mut [f64]) {
        let Self { instance: Some(instance), steps, error: None, asks, asked, .. } = self else {
            return observations.fill(f64::NAN);
        };
        let heard = *asked;
        let mut work = || {
            common.actions.write(instance, actions)?;
            for _ in 0..repeat {
                let ended = instance.do_step(f64::from(*steps) * common.step, common.step)?.is_break();
                *steps = steps.checked_add(1).ok_or_else(|| usage(&self.name, "has taken 2^32 steps; reset it"))?;
                if ended {
                    return Err(usage(&self.name, "asked to end the simulation"));
                }
            }
            if *asked && !*asks {
                *asked = false;
                instance.log_warnings(false)?;
            }
            common.observations.read(instance, observations)
        };
        if let Err(error) = work() {
            observations.fill(f64::NAN);
            self.error = Some(error);
        }
        if heard {
            self.listen(common);
        }
    }

    /// Reads the observations without a step.
    pub(crate) fn observe(&mut self, common: &Common, observations: &mut [f64]) {
        let Self { instance: Some(instance), error: None, .. } = self else { return observations.fill(f64::NAN) };
        if let Err(error) = common.observations.read(instance, observations) {
            observations.fill(f64::NAN);
            self.error = Some(error);
        }
    }

    /// Steps since the start, and the state as bytes.
    pub(crate) fn save(&mut self) -> Result<(u32, Vec<u8>), Error> {
        let steps = self.steps;
        let instance = self.living()?;
        let state = instance.get_state()?;
        let bytes = instance.serialize_state(state);
        instance.free_state(state)?;
        Ok((steps, bytes?))
    }

    /// Continues from a state of [`save`](Self::save), of this or another lane.
    pub(crate) fn restore(&mut self, steps: u32, bytes: &[u8]) -> Result<(), Error> {
        let instance = self.living()?;
        let state = instance.deserialize_state(bytes)?;
        let set = instance.set_state(state);
        instance.free_state(state)?;
        self.steps = steps;
        set
    }

    fn living(&mut self) -> Result<&mut Instance, Error> {
        match (&mut self.instance, &self.error) {
            (Some(instance), None) => Ok(instance),
            (_, Some(error)) => Err(error.clone()),
            (None, None) => Err(usage(&self.name, "is not initialized")),
        }
    }

    /// Whether the library had a fatal error, so none of its instances can be used.
    pub(crate) fn is_fatal(&self) -> bool {
        matches!(&self.error, Some(Error::Call { status, .. }) if status == "Fatal")
    }

    /// Drops the instance; the next one comes from another library.
    pub(crate) fn leave(&mut self) {
        (self.instance, self.initial) = (None, None);
    }
}

fn usage(name: &str, cause: &str) -> Error {
    Error::Usage { instance: name.into(), cause: cause.into() }
}

/// Loads the library again if one of the lanes had a fatal error; every lane then gets a new instance.
pub(crate) fn renew(opened: &mut Arc<Opened>, lanes: &mut [Lane]) -> Result<bool, Error> {
    if !lanes.iter().any(Lane::is_fatal) {
        return Ok(false);
    }
    *opened = cache::renewed(opened)?;
    lanes.iter_mut().for_each(Lane::leave);
    Ok(true)
}
