//! Bringing an instance to a state of the life cycle.

use crate::instance::Instance;
use crate::session::{NotDetermined, Session};
use crate::state::Life;
use crate::state::State::{self, Continuous, Error, Event, Initialization, Instantiated, Terminated};
use fmu_import::Status;
use fmu_import::raw::{Arguments, Interface, Simple};

impl Session {
    /// A new instance in this state.
    pub(super) fn in_state(&self, life: Life, state: State) -> Result<Instance<'_>, NotDetermined> {
        match life {
            Life::CoSimulation => self.simulation(state),
            Life::ModelExchange => self.exchange(state),
            Life::EventMode => self.prepare(|| {
                let instance = self.made(&Arguments { event_mode: true, ..self.arguments("probe") })?;
                instance.initialize()?;
                if state == Event {
                    instance.perform(Simple::EnterEventMode)?;
                }
                Ok(instance)
            }),
        }
    }

    /// A new instance for co-simulation in this state; two steps lead to Step Mode and to what follows it.
    pub(super) fn simulation(&self, state: State) -> Result<Instance<'_>, NotDetermined> {
        let instance = match state {
            Instantiated => return self.fresh(),
            Initialization => return self.initializing(),
            _ => self.stepping()?,
        };
        instance.steps(2, self.h())?;
        match state {
            Terminated => instance.perform(Simple::Terminate)?,
            Error => drop(instance.provoke()?),
            _ => {}
        }
        Ok(instance)
    }

    /// A new instance for Model Exchange in this state.
    pub(super) fn exchange(&self, state: State) -> Result<Instance<'_>, NotDetermined> {
        self.prepare(|| {
            let interface = Interface::ModelExchange;
            let instance = self.made(&Arguments { interface, ..self.arguments("probe") })?;
            instance.bring_to(state)?;
            Ok(instance)
        })
    }
}

impl Instance<'_> {
    /// Brings a new instance for Model Exchange to a state.
    pub(super) fn bring_to(&self, state: State) -> Result<(), NotDetermined> {
        if state == Instantiated {
            return Ok(());
        }
        self.enter()?;
        if state == Initialization {
            return Ok(());
        }
        self.perform(Simple::ExitInitializationMode)?;
        if state == Event {
            return Ok(());
        }
        let _ = self.iterate()?;
        self.perform(Simple::EnterContinuousTimeMode)?;
        if state == Continuous {
            return Ok(());
        }
        self.perform(Simple::Terminate)
    }

    /// Makes the FMU return Error by one of two wrong calls; returns the call that produced the Error.
    pub(super) fn provoke(&self) -> Result<String, NotDetermined> {
        let (t, h) = (self.time.get(), self.session.h());
        if self.step_at(t, -h)? == Status::ERROR {
            return Ok(format!("DoStep(h={})", -h));
        }
        if self.simple(Simple::ExitInitializationMode)? == Status::ERROR {
            return Ok("ExitInitializationMode in step mode".into());
        }
        Err(NotDetermined("neither a negative step nor a call in the wrong state returned Error".into()))
    }
}
