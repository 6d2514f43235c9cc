//! An instance for Model Exchange under test, and a small importer that integrates it.
//!
//! The importer uses Euler's method and handles a state event at the end of its step, which is coarse but uses only calls
//! allowed by the standard.

use crate::instance::Instance;
use crate::session::{NotDetermined, Session};
use crate::state::State;
use fmu_import::Status;
use fmu_import::raw::{Sensitivity, SensitivityArguments, Simple, UpdateResults, Vector};
use model_description::{BaseType, Causality, FmiVersion, ModelVariable, Unknown};

/// The reason why a run of the integrator cannot continue.
pub(super) const UNSTABLE: &str = "Euler's method is not stable for this FMU";
/// Maximum number of steps to a communication point, those before events included.
const REACH: usize = 500;
/// Value that fills vectors before a call.
pub(super) const UNTOUCHED: f64 = f64::from_bits(0xc5c5_c5c5_c5c5_c5c5);
/// Largest number of updates of one event; an FMU that needs more never ends the event.
const UPDATES: usize = 100;

impl Session {
    fn elements_of(&self, unknowns: &[Unknown]) -> usize {
        unknowns.iter().filter_map(|u| self.description.referenced(u.reference)).map(|v| self.elements(v)).sum()
    }

    /// Number of continuous states.
    pub(super) fn states(&self) -> usize {
        self.elements_of(&self.description.derivatives)
    }

    /// Number of event indicators.
    pub(super) fn indicators(&self) -> usize {
        match self.description.version {
            FmiVersion::V2 => {
                self.description.number_of_event_indicators.and_then(|n| usize::try_from(n).ok()).unwrap_or(0)
            }
            FmiVersion::V3 => self.elements_of(&self.description.event_indicators),
        }
    }

    /// The comparable values in a vector with the values of these variables.
    pub(super) fn steady(&self, variables: &[&ModelVariable], values: Vec<f64>) -> Vec<f64> {
        if self.varying.is_empty() {
            return values;
        }
        let of = variables.iter().flat_map(|v| std::iter::repeat_n(self.is_steady(v), self.elements(v)));
        values.into_iter().zip(of).filter_map(|(x, steady)| steady.then_some(x)).collect()
    }

    /// Names of the values of these variables.
    pub(super) fn element_names<'v>(&self, variables: impl IntoIterator<Item = &'v ModelVariable>) -> Vec<String> {
        let of = |v: &ModelVariable| match self.elements(v) {
            1 => vec![v.name.clone()],
            n => (1..=n).map(|k| format!("element {k} of {}", v.name)).collect(),
        };
        variables.into_iter().flat_map(of).collect()
    }

    /// Names of the values that can be compared: the ones kept by [`steady`](Self::steady).
    pub(super) fn names_of(&self, variables: &[&ModelVariable]) -> Vec<String> {
        self.element_names(variables.iter().copied().filter(|v| self.is_steady(v)))
    }

    /// Names of the values of a row of [`Importer::trajectory`].
    pub(super) fn names_of_rows(&self) -> Vec<String> {
        let outputs: Vec<_> = self.watched().into_iter().filter(|v| v.base == BaseType::Float64).collect();
        [self.names_of(&self.description.states()), self.names_of(&outputs)].concat()
    }

    /// Names of the event indicators.
    pub(super) fn names_of_indicators(&self) -> Vec<String> {
        (1..=self.indicators()).map(|k| format!("event indicator {k}")).collect()
    }

    /// The variables that are the derivatives of the continuous states.
    pub(super) fn derivative_variables(&self) -> Vec<&ModelVariable> {
        self.description.derivatives.iter().filter_map(|u| self.description.referenced(u.reference)).collect()
    }

    /// A capability of Model Exchange.
    pub(super) fn exchange_flag(&self, name: &str) -> bool {
        self.description.model_exchange.as_ref().is_some_and(|i| i.flag(name))
    }

    /// The FMU saves states of Model Exchange.
    pub(super) fn exchange_saves(&self) -> bool {
        self.description.model_exchange.as_ref().is_some_and(model_description::Interface::can_get_and_set_state)
    }

    /// Inputs that are numbers and depend on no clock.
    pub(super) fn number_inputs(&self) -> impl Iterator<Item = &ModelVariable> {
        self.numeric().filter(|v| v.causality == Causality::Input && v.clocks.is_empty())
    }

    /// A step of the integrator in s.
    pub(super) fn integrator_step(&self) -> f64 {
        self.integrator.get().unwrap_or(self.h() / 20.0)
    }
}

/// A continuous state, by its number, that an update changes.
pub(super) struct Jump {
    pub(super) state: usize,
    pub(super) from: f64,
    pub(super) to: f64,
}

/// What an event did.
pub(super) struct Event {
    /// The results of each update, and the first state that it changed.
    pub(super) updates: Vec<(UpdateResults, Option<Jump>)>,
}

impl Event {
    /// The next time event, if one is known.
    pub(super) fn next(&self) -> Option<f64> {
        self.updates.last().filter(|(u, _)| u.next_event_time_defined != 0).map(|(u, _)| u.next_event_time)
    }

    /// The FMU requests the end of the simulation.
    pub(super) fn terminates(&self) -> bool {
        self.updates.iter().any(|(u, _)| u.terminate != 0)
    }

    /// The iteration came to an end.
    pub(super) fn ended(&self) -> bool {
        self.updates.last().is_some_and(|(u, _)| u.again == 0)
    }

    /// A state changed.
    pub(super) fn jumped(&self) -> bool {
        self.updates.iter().any(|(u, jump)| jump.is_some() || u.states_changed != 0)
    }
}

impl Instance<'_> {
    /// One update of the discrete states.
    pub(super) fn update(&self) -> Result<(Status, UpdateResults), NotDetermined> {
        let name = if self.session.is_v2() { "NewDiscreteStates" } else { "UpdateDiscreteStates" };
        self.call_for(name, |raw| raw.update_discrete_states(self.handle, false))
    }

    /// The iteration of an event, in Event Mode.
    pub(super) fn iterate(&self) -> Result<Event, NotDetermined> {
        let mut event = Event { updates: Vec::new() };
        let mut before = self.states()?;
        while event.updates.len() < UPDATES {
            let (status, updated) = self.update()?;
            self.must("UpdateDiscreteStates", status)?;
            let after = self.states()?;
            let changed = |k: &usize| {
                let (a, b) = (before[*k], after[*k]);
                (a - b).abs() > 0.0 || a.is_nan() != b.is_nan()
            };
            let jump =
                (0..before.len()).find(changed).map(|state| Jump { state, from: before[state], to: after[state] });
            before = after;
            event.updates.push((updated, jump));
            if updated.again == 0 || updated.terminate != 0 {
                break;
            }
        }
        Ok(event)
    }

    /// A vector of Model Exchange, and whether the memory behind it is intact.
    pub(super) fn vector(&self, name: Vector, n: usize) -> Result<(Status, Vec<f64>, bool), NotDetermined> {
        let untouched = UNTOUCHED;
        let mut values = vec![untouched; n + 8];
        let status = self.call(name.as_str(), |raw| raw.vector(name, self.handle, Some(&mut values), n))?;
        let intact = values[n..].iter().all(|v| v.to_bits() == untouched.to_bits());
        values.truncate(n);
        if status.is_ok() {
            self.session.record_value(&format!("{values:?}"));
        }
        Ok((status, values, intact))
    }

    fn read(&self, name: Vector, n: usize) -> Result<Vec<f64>, NotDetermined> {
        if n == 0 {
            return Ok(Vec::new());
        }
        let (status, values, _) = self.vector(name, n)?;
        self.must(name.as_str(), status)?;
        // An element that keeps its fill pattern was not written by the FMU.
        if values.iter().any(|v| v.to_bits() == UNTOUCHED.to_bits()) {
            return Err(NotDetermined(format!(
                "{} did not write all of the {n} values",
                self.session.raw.name(name.as_str())
            )));
        }
        Ok(values)
    }

    /// The continuous states.
    pub(super) fn states(&self) -> Result<Vec<f64>, NotDetermined> {
        self.read(Vector::GetContinuousStates, self.session.states())
    }

    /// The nominals of the continuous states.
    pub(super) fn nominals(&self) -> Result<Vec<f64>, NotDetermined> {
        self.read(Vector::GetNominalsOfContinuousStates, self.session.states())
    }

    /// The function that returns the derivatives of the states.
    pub(super) fn derivatives_name(&self) -> Vector {
        match self.session.description.version {
            FmiVersion::V2 => Vector::GetDerivatives,
            FmiVersion::V3 => Vector::GetContinuousStateDerivatives,
        }
    }

    /// The derivatives of the states.
    pub(super) fn derivatives(&self) -> Result<Vec<f64>, NotDetermined> {
        self.read(self.derivatives_name(), self.session.states())
    }

    /// The event indicators.
    pub(super) fn indicators(&self) -> Result<Vec<f64>, NotDetermined> {
        self.read(Vector::GetEventIndicators, self.session.indicators())
    }

    /// Sets the continuous states.
    pub(super) fn set_states(&self, x: &[f64]) -> Result<Status, NotDetermined> {
        let mut copy = x.to_vec();
        self.call(&format!("SetContinuousStates({x:?})"), |raw| {
            raw.vector(Vector::SetContinuousStates, self.handle, Some(&mut copy), x.len())
        })
    }

    /// Sets the time.
    pub(super) fn set_time(&self, t: f64) -> Result<Status, NotDetermined> {
        let status = self.call(&format!("SetTime({t:?})"), |raw| raw.set_time(self.handle, t))?;
        self.time.set(t);
        Ok(status)
    }

    /// Ends a step of the integrator.
    pub(super) fn completed(&self) -> Result<(Status, [i32; 2]), NotDetermined> {
        self.call_for("CompletedIntegratorStep", |raw| raw.completed_integrator_step(self.handle, false, false))
    }

    /// A directional derivative, or an adjoint one.
    pub(super) fn sensitivity(
        &self,
        name: Sensitivity,
        [unknowns, knowns]: [&[u32]; 2],
        seed: &[f64],
    ) -> Result<(Status, Vec<f64>), NotDetermined> {
        let adjoint = name == Sensitivity::GetAdjointDerivative;
        let mut result = vec![UNTOUCHED; self.session.values_of(if adjoint { knowns } else { unknowns })];
        let n = result.len();
        let arguments = SensitivityArguments {
            unknowns: (Some(unknowns), unknowns.len()),
            knowns: (Some(knowns), knowns.len()),
            seed: (Some(seed), seed.len()),
        };
        let call = format!("{}(unknowns {unknowns:?}, knowns {knowns:?}, seed {seed:?})", name.as_str());
        let status = self.call(&call, |raw| raw.sensitivity(name, self.handle, arguments, Some(&mut result), n))?;
        // An element that keeps its fill pattern was not written by the FMU.
        if status.is_ok() && result.iter().any(|x| x.to_bits() == UNTOUCHED.to_bits()) {
            self.session.violated(format!("{call} returned OK and did not write all of the {n} values"));
            return Err(NotDetermined(format!("{} did not write all values", name.as_str())));
        }
        Ok((status, result))
    }

    /// Sets all inputs that are numbers to values that differ from their start values, in Event Mode; false if one is refused.
    fn excite(&self) -> Result<bool, NotDetermined> {
        for (k, v) in self.session.number_inputs().enumerate() {
            if v.base != BaseType::Boolean && !v.base.is_float() {
                continue;
            }
            let scale = 5.0 + f64::from(u8::try_from(k % 7).unwrap_or(0));
            if let Some(values) = self.session.different_value(v, scale)
                && !self.set(v, &values)?.is_ok()
            {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// An importer in Continuous-Time Mode.
#[derive(Clone)]
pub(super) struct Importer<'a, 'b> {
    pub(super) instance: &'a Instance<'b>,
    /// The next time event.
    pub(super) next: Option<f64>,
    /// The event indicators after the last step or event.
    pub(super) z: Vec<f64>,
    /// The FMU requested the end.
    pub(super) over: bool,
    /// Variables to read before the next event, while the FMU is still in Continuous-Time Mode.
    pub(super) watched: Vec<&'b ModelVariable>,
    /// Their values before the last event.
    pub(super) before: Vec<Vec<u64>>,
}

impl Session {
    /// An instance in Event Mode whose inputs have been set; where the FMU does not take these values, with its start values.
    pub(super) fn excited(&self) -> Result<Instance<'_>, NotDetermined> {
        self.prepare(|| {
            let instance = self.exchange(State::Event)?;
            let trial = self.exchange(State::Event)?;
            let good = trial.excite()? && Importer::start(&trial).is_ok();
            Ok(if good && instance.excite()? { instance } else { self.exchange(State::Event)? })
        })
    }
}

impl<'a, 'b> Importer<'a, 'b> {
    fn new(instance: &'a Instance<'b>, next: Option<f64>, z: Vec<f64>) -> Self {
        Self { instance, next, z, over: false, watched: Vec::new(), before: Vec::new() }
    }

    /// Begins with the event that ends the initialization.
    pub(super) fn start(instance: &'a Instance<'b>) -> Result<Self, NotDetermined> {
        let mut importer = Self::new(instance, None, Vec::new());
        importer.leave(&mut |_, _| ())?;
        Ok(importer)
    }

    /// Begins like [`start`](Self::start), runs, and passes every event to `see`, and the importer after every step to `look`,
    /// with whether there was an event at its end.
    pub(super) fn survey(
        instance: &'a Instance<'b>,
        steps: usize,
        see: &mut dyn FnMut(&Instance<'_>, &Event),
        look: &mut dyn FnMut(&Self, bool) -> Result<(), NotDetermined>,
    ) -> Result<(), NotDetermined> {
        let mut importer = Self::new(instance, None, Vec::new());
        let (session, dt) = (instance.session, instance.session.integrator_step());
        session.record_calls(&format!("{steps} integrator steps of {dt} s with events"), || {
            importer.leave(see)?;
            for k in 0..steps {
                if importer.over || (k % 100 == 99 && session.half_time_used()) {
                    break;
                }
                look(&importer, k == 0)?;
                let event = importer.step(dt, see)?;
                if !importer.over {
                    look(&importer, event)?;
                }
            }
            Ok(())
        })
    }

    /// Continues in Continuous-Time Mode.
    pub(super) fn resume(instance: &'a Instance<'b>, next: Option<f64>) -> Result<Self, NotDetermined> {
        Ok(Self::new(instance, next, instance.indicators()?))
    }

    fn leave(&mut self, see: &mut dyn FnMut(&Instance<'_>, &Event)) -> Result<Event, NotDetermined> {
        let event = self.instance.iterate()?;
        see(self.instance, &event);
        self.next = event.next();
        self.over |= event.terminates() || !event.ended();
        if !self.over {
            self.instance.perform(Simple::EnterContinuousTimeMode)?;
            self.z = self.instance.indicators()?;
        }
        Ok(event)
    }

    /// An event at this time.
    pub(super) fn event(&mut self, see: &mut dyn FnMut(&Instance<'_>, &Event)) -> Result<Event, NotDetermined> {
        self.instance.perform(Simple::EnterEventMode)?;
        self.leave(see)
    }

    /// One step of the integrator, at most to the next time event; handles and returns an event at its end.
    pub(super) fn step(&mut self, dt: f64, see: &mut dyn FnMut(&Instance<'_>, &Event)) -> Result<bool, NotDetermined> {
        let i = self.instance;
        let t = i.time.get();
        let due = self.next.is_some_and(|next| next <= t + dt * (1.0 + 1e-9));
        let end = self.next.filter(|_| due).map_or(t + dt, |next| next.max(t));
        let (mut x, f) = (i.states()?, i.derivatives()?);
        for (x, f) in x.iter_mut().zip(&f) {
            *x += f * (end - t);
        }
        if x.iter().any(|x| !x.is_finite()) {
            return Err(NotDetermined(UNSTABLE.into()));
        }
        i.must("SetTime", i.set_time(end)?)?;
        if !x.is_empty() {
            i.must("SetContinuousStates", i.set_states(&x)?)?;
        }
        let z = i.indicators()?;
        let crossed = self.z.iter().zip(&z).any(|(a, b)| (*a > 0.0) != (*b > 0.0));
        self.z = z;
        let (status, [enter, terminate]) = i.completed()?;
        i.must("CompletedIntegratorStep", status)?;
        self.over |= terminate != 0;
        let event = !self.over && (due || crossed || enter != 0);
        if event {
            self.before = i.snapshot(&self.watched)?;
            self.event(see)?;
        }
        Ok(event)
    }

    /// Steps up to this time, with the events on the way.
    pub(super) fn reach(&mut self, end: f64, dt: f64) -> Result<(), NotDetermined> {
        for _ in 0..REACH {
            let left = end - self.instance.time.get();
            if self.over || left <= 1e-6 * dt {
                return Ok(());
            }
            self.step(dt.min(left), &mut |_, _| ())?;
        }
        Err(NotDetermined(format!("too many events before t = {end}")))
    }

    /// Several steps; `look` runs after each.
    pub(super) fn run(
        &mut self,
        steps: usize,
        look: &mut dyn FnMut(&Instance<'_>) -> Result<(), NotDetermined>,
    ) -> Result<(), NotDetermined> {
        let (session, dt) = (self.instance.session, self.instance.session.integrator_step());
        let what = format!("{steps} integrator steps of {dt} s from {}", self.instance.time.get());
        session.record_calls(&what, || {
            for k in 0..steps {
                if self.over || (k % 100 == 99 && session.half_time_used()) {
                    break;
                }
                self.step(dt, &mut |_, _| ())?;
                look(self.instance)?;
            }
            Ok(())
        })
    }

    /// States and outputs after each of several steps.
    pub(super) fn trajectory(&mut self, steps: usize) -> Result<Vec<Vec<f64>>, NotDetermined> {
        let session = self.instance.session;
        let outputs: Vec<_> = session.watched().into_iter().filter(|v| v.base == BaseType::Float64).collect();
        let mut rows = Vec::new();
        self.run(steps, &mut |instance| {
            let mut row = session.steady(&session.description.states(), instance.states()?);
            row.extend(instance.snapshot(&outputs)?.into_iter().flatten().map(f64::from_bits));
            rows.push(row);
            Ok(())
        })?;
        Ok(rows)
    }
}

impl Session {
    /// Whether this binary has Model Exchange.
    pub(super) fn exchanges_here(&self) -> bool {
        let own = self.binary.file_stem().unwrap_or_default();
        self.description.model_exchange.as_ref().is_some_and(|i| own == i.model_identifier.as_str())
    }

    /// A complete run of each interface of this binary, without findings.
    pub(super) fn complete_run(&self) -> Result<(), NotDetermined> {
        let d = &self.description;
        if d.co_simulation.is_some() {
            let instance = self.stepping()?;
            for k in 0..20 {
                instance.change_inputs(k)?;
                let _ = instance.step(self.h())?;
                let _ = instance.snapshot(&self.watched())?;
            }
            let _ = instance.simple(Simple::Terminate)?;
            instance.free()?;
        }
        if self.exchanges_here() {
            let instance = self.exchange(State::Event)?;
            let run = Importer::start(&instance).and_then(|mut importer| {
                importer.run(20, &mut |instance| instance.snapshot(&self.watched()).map(|_| ()))?;
                Ok(importer.over)
            });
            if run.is_ok_and(|over| !over) {
                let _ = instance.simple(Simple::Terminate)?;
            }
            instance.free()?;
        }
        Ok(())
    }
}
