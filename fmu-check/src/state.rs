//! States of the life cycle.

use State::{Continuous, Event, Initialization, Instantiated, Step, Terminated};

/// States of both interfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    Instantiated,
    Initialization,
    /// Step Mode.
    Step,
    /// Event Mode; its first update is still to come.
    Event,
    /// Continuous-Time Mode.
    Continuous,
    Terminated,
    Error,
}

/// Purpose of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Life {
    CoSimulation,
    ModelExchange,
    /// Co-Simulation with Event Mode (FMI 3.0).
    EventMode,
}

impl Life {
    /// The states that a call can be tried in.
    pub(super) fn states(self) -> &'static [State] {
        match self {
            Self::CoSimulation => &[Instantiated, Initialization, Step, Terminated],
            Self::ModelExchange => &[Instantiated, Initialization, Event, Continuous, Terminated],
            Self::EventMode => &[Step, Event],
        }
    }
}
