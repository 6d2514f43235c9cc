//! The one lifecycle table: which call is allowed in which state, for both standards, and where it leads.
//!
//! FMI 2.0.5, 4.2.4 (state machine of co-simulation) and FMI 3.0.2, 2.3 and 4.2. The states that are not here
//! (configuration, event and intermediate-update mode, step in progress) do not exist in an FMU without structural
//! parameters, clocks and asynchronous steps: the calls that would lead to them are [`Call::Unsupported`].

use serde::{Deserialize, Serialize};
use std::fmt;

/// One of the two standards that the binary speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standard {
    /// FMI 2.0.
    Fmi2,
    /// FMI 3.0.
    Fmi3,
}

/// State of an instance, a bit of [`States`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum State {
    /// After instantiation and after a reset.
    #[default]
    Instantiated = 1,
    /// Initialization Mode of both standards.
    Initialization = 2,
    /// `stepComplete` of FMI 2.0, Step Mode of FMI 3.0.
    Step = 4,
    /// After a termination.
    Terminated = 8,
    /// After an error; values can be read, Reset and SetFMUState lead out.
    Error = 16,
}

impl State {
    const ALL: [Self; 5] = [Self::Instantiated, Self::Initialization, Self::Step, Self::Terminated, Self::Error];
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Instantiated => "Instantiated",
            Self::Initialization => "Initialization Mode",
            Self::Step => "Step Mode",
            Self::Terminated => "Terminated",
            Self::Error => "Error",
        })
    }
}

/// A set of states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct States(u8);

impl States {
    const fn of(states: &[State]) -> Self {
        let (mut bits, mut i) = (0, 0);
        while i < states.len() {
            bits |= states[i] as u8;
            i += 1;
        }
        Self(bits)
    }

    /// Whether `state` is one of them.
    pub const fn contains(self, state: State) -> bool {
        self.0 & state as u8 != 0
    }
}

impl fmt::Display for States {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut names = State::ALL.into_iter().filter(|&s| self.contains(s));
        match names.next() {
            None => f.write_str("no state"),
            Some(first) => {
                write!(f, "{first}")?;
                names.try_for_each(|name| write!(f, ", {name}"))
            }
        }
    }
}

/// A call of the importer, by what it does; several functions of the standards share one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// `Instantiate`: there is no instance yet, so no state.
    Instantiate,
    /// `SetDebugLogging`.
    SetDebugLogging,
    /// `fmi2SetupExperiment`; FMI 3.0 has it in `EnterInitializationMode`.
    SetupExperiment,
    /// `EnterInitializationMode`.
    EnterInitialization,
    /// `ExitInitializationMode`.
    ExitInitialization,
    /// `Terminate`.
    Terminate,
    /// `Reset`.
    Reset,
    /// All getters.
    Get,
    /// All setters; which variable may be set is decided for each.
    Set,
    /// `DoStep`.
    DoStep,
    /// `GetFMUState`.
    SaveState,
    /// `SetFMUState`: the restored snapshot brings the next state.
    RestoreState,
    /// Free, size, serialize and deserialize a saved state.
    UseState,
    /// `fmi2Get...Status`.
    Status,
    /// A capability that this FMU does not have: refused in every state, with that reason.
    Unsupported,
}

/// A row of the table.
#[derive(Clone, Copy, Debug)]
struct Row {
    fmi2: States,
    fmi3: States,
    next: Option<State>,
}

const fn both(states: &[State], next: Option<State>) -> Row {
    Row { fmi2: States::of(states), fmi3: States::of(states), next }
}

const fn each(fmi2: &[State], fmi3: &[State]) -> Row {
    Row { fmi2: States::of(fmi2), fmi3: States::of(fmi3), next: None }
}

impl Call {
    const fn row(self) -> Row {
        use State::{Error, Initialization, Instantiated, Step, Terminated};
        match self {
            Self::SetDebugLogging | Self::RestoreState | Self::UseState | Self::Unsupported => both(&State::ALL, None),
            Self::Instantiate => both(&[], None),
            Self::SetupExperiment => each(&[Instantiated], &[]),
            Self::EnterInitialization => both(&[Instantiated], Some(Initialization)),
            Self::ExitInitialization => both(&[Initialization], Some(Step)),
            Self::Terminate => both(&[Step], Some(Terminated)),
            Self::Reset => both(&State::ALL, Some(Instantiated)),
            // FMI 3.0.2, 2.3.2 lets start values be read before initialization; FMI 2.0.5, 4.2.4 does not.
            // In Error: for debugging (table of FMI 2.0.5, 4.2.4).
            Self::Get => each(&[Initialization, Step, Terminated, Error], &State::ALL),
            Self::Set => both(&[Instantiated, Initialization, Step], None),
            Self::DoStep => both(&[Step], None),
            // A state that an error left behind is of no use.
            Self::SaveState => both(&[Instantiated, Initialization, Step, Terminated], None),
            Self::Status => each(&[Step, Terminated], &[]),
        }
    }

    /// The state that it leads to, `None` if it stays.
    pub const fn next(self) -> Option<State> {
        self.row().next
    }

    /// The states that allow this call.
    pub const fn states(self, standard: Standard) -> States {
        match standard {
            Standard::Fmi2 => self.row().fmi2,
            Standard::Fmi3 => self.row().fmi3,
        }
    }
}

/// The state of one instance. It changes in [`Life::after`] and nowhere else; a restored FMU state brings its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Life(State);

impl Life {
    /// The state.
    pub const fn state(self) -> State {
        self.0
    }

    /// Records that a call succeeded, with the [next](Call::next) state, or failed.
    #[inline]
    pub const fn after(&mut self, succeeded: bool, next: Option<State>) {
        if !succeeded {
            self.0 = State::Error;
        } else if let Some(next) = next {
            self.0 = next;
        }
    }
}
