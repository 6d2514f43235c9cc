//! Habits of importers that the standards forbid but that do no harm: the call is accepted, and a warning names the habit once
//! for each instance. In all other respects the FMU is as strict as the standards.
//!
//! `docs/import.md` lists these importers, `tests/orders/` the orders of their calls.

/// A habit, the number of a bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Habit {
    /// Variables that cannot change now are set to their present values.
    Fixed,
    /// `SetContinuousStates` in Event Mode, and in Initialization Mode of FMI 2.0.
    States,
    /// `SetTime` to a time before the last completed step.
    Back,
    /// `fmi3SetTime` in Event Mode.
    Time,
    /// `fmi3EnterEventMode` in Event Mode.
    Event,
}

impl Habit {
    /// The importer's habit, and its effect.
    pub(crate) const fn tell(self) -> &'static str {
        match self {
            Self::Fixed => {
                "the importer sets variables that cannot change now, such as fixed parameters after the initialization; their values are unchanged"
            }
            Self::States => {
                "the importer sets the continuous states outside Continuous-Time Mode; they are used as values from its integrator"
            }
            Self::Back => {
                "the importer sets a time before the last completed step; counts after that time are discarded"
            }
            Self::Time => "the importer sets the time in Event Mode; the event is handled at that time",
            Self::Event => {
                "the importer enters Event Mode in Event Mode; the event is handled at the time that it has set"
            }
        }
    }
}
