//! Results of calls, as the FMU wrote them.

/// Value of a byte or an integer before a call.
pub(super) const UNTOUCHED: u8 = 0xc5;

/// Which results of `fmi3DoStep` get a pointer; the others get NULL.
pub type ResultPointers = [bool; 4];

/// The results of `fmi3DoStep`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepResults {
    /// `eventHandlingNeeded`, as a byte.
    pub event: u8,
    /// `terminateSimulation`, as a byte.
    pub terminate: u8,
    /// `earlyReturn`, as a byte.
    pub early: u8,
    /// `lastSuccessfulTime`.
    pub last: f64,
}

/// The results of an update of the discrete states; the flags as the FMU wrote them, 0xc5 where it did not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateResults {
    /// `newDiscreteStatesNeeded`, `discreteStatesNeedUpdate`.
    pub again: i32,
    /// `terminateSimulation`.
    pub terminate: i32,
    /// `nominalsOfContinuousStatesChanged`.
    pub nominals_changed: i32,
    /// `valuesOfContinuousStatesChanged`.
    pub states_changed: i32,
    /// `nextEventTimeDefined`.
    pub next_event_time_defined: i32,
    /// `nextEventTime`, NaN where the FMU did not write it.
    pub next_event_time: f64,
}
