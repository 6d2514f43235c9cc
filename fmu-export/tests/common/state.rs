//! The state of an instance in tables written by hand.

/// State of an instance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    #[default]
    Instantiated,
    Configuration,
    Initialization,
    Step,
    Event,
    Continuous,
    Activation,
    Reconfiguration,
    Terminated,
    Error,
}

impl State {
    pub const ALL: &[Self] = &[
        Self::Instantiated,
        Self::Configuration,
        Self::Initialization,
        Self::Step,
        Self::Event,
        Self::Continuous,
        Self::Activation,
        Self::Reconfiguration,
        Self::Terminated,
        Self::Error,
    ];
    /// States in which it can be saved.
    pub const SAVED: &[Self] = {
        let [saved @ .., _] = Self::ALL else { unreachable!() };
        saved
    };
}
