//! Brings an instance to a state of the life cycle.

use crate::instance::Instance;
use crate::session::{NotDetermined, Session};
use State::{Error, Initialization, Instantiated, Step, Terminated};
use fmu_import::Status;
use fmu_import::raw::Simple;

/// States that an instance can be brought to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    Instantiated,
    Initialization,
    Step,
    Terminated,
    Error,
}

/// An instance in a state.
pub(super) fn in_state(session: &Session, state: State) -> Result<Instance<'_>, NotDetermined> {
    match state {
        Instantiated => session.fresh(),
        Initialization => session.initializing(),
        Step => {
            let instance = session.stepping()?;
            instance.steps(2, session.h())?;
            Ok(instance)
        }
        Terminated => {
            let instance = in_state(session, Step)?;
            let status = instance.simple(Simple::Terminate)?;
            if status.is_ok() { Ok(instance) } else { Err(NotDetermined(format!("Terminate returned {status}"))) }
        }
        Error => {
            let instance = in_state(session, Step)?;
            instance.provoke()?;
            Ok(instance)
        }
    }
}

impl Instance<'_> {
    /// Makes the FMU return Error with one of two wrong calls; returns the call that succeeded in doing so.
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
