//! The one lifecycle table: which call is allowed in which state, for both standards and all interfaces, and to which state it
//! leads.
//!
//! FMI 2.0.5, 3.2.3 and 4.2.4; FMI 3.0.2, 2.3, 3.2 and 4.2. The missing state (step in progress) does not exist in an FMU
//! without asynchronous steps: the calls that would lead to it are [`Call::Unsupported`].

use fmu_core::Interface;
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

/// State of an instance, the number of a bit of [`States`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum State {
    /// After instantiation and after a reset.
    #[default]
    Instantiated,
    /// Initialization Mode of both standards.
    Initialization,
    /// `stepComplete` of FMI 2.0, Step Mode of FMI 3.0.
    Step,
    /// After a termination.
    Terminated,
    /// After an error; Reset and SetFMUState lead out.
    Error,
    /// Event Mode of Model Exchange, and of co-simulation in FMI 3.0.
    Event,
    /// Continuous-Time Mode of Model Exchange.
    Continuous,
    /// Co-simulation after a step in which the model has ended the simulation: `stepFailed` of FMI 2.0, Step Mode of FMI 3.0,
    /// where no step follows.
    Ended,
    /// Intermediate Update Mode of co-simulation in FMI 3.0: while the importer's callback runs.
    Intermediate,
    /// Clock Activation Mode of Scheduled Execution.
    Activation,
    /// Clock Update Mode of Scheduled Execution: while the importer's callback runs.
    ClockUpdate,
    /// Configuration Mode: structural parameters are set before the initialization.
    Configuration,
    /// Reconfiguration Mode: tunable structural parameters are set while the simulation runs.
    Reconfiguration,
}

impl State {
    pub(crate) const ALL: [Self; 13] = [
        Self::Instantiated,
        Self::Initialization,
        Self::Step,
        Self::Event,
        Self::Continuous,
        Self::Ended,
        Self::Terminated,
        Self::Error,
        Self::Configuration,
        Self::Reconfiguration,
        Self::Intermediate,
        Self::Activation,
        Self::ClockUpdate,
    ];

    /// The states between calls; Clock Activation Mode replaces Step Mode in Scheduled Execution.
    const REST: [Self; 10] = {
        let [rest @ .., _, _, _] = Self::ALL;
        rest
    };

    /// Whether the instance waits for a callback of the importer.
    pub const fn calls_back(self) -> bool {
        matches!(self, Self::Intermediate | Self::ClockUpdate)
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Instantiated => "Instantiated",
            Self::Initialization => "Initialization Mode",
            Self::Step => "Step Mode",
            Self::Terminated => "Terminated",
            Self::Error => "Error",
            Self::Event => "Event Mode",
            Self::Continuous => "Continuous-Time Mode",
            Self::Ended => "Ended by the model",
            Self::Intermediate => "Intermediate Update Mode",
            Self::Activation => "Clock Activation Mode",
            Self::ClockUpdate => "Clock Update Mode",
            Self::Configuration => "Configuration Mode",
            Self::Reconfiguration => "Reconfiguration Mode",
        })
    }
}

/// A set of states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct States(u16);

impl States {
    const fn of(states: &[State]) -> Self {
        let (mut bits, mut i) = (0, 0);
        while i < states.len() {
            bits |= 1 << states[i] as u8;
            i += 1;
        }
        Self(bits)
    }

    /// The states of Scheduled Execution, where Clock Activation Mode corresponds to Step Mode.
    const fn scheduled(self) -> Self {
        use State::{
            Activation, Configuration, Error, Initialization, Instantiated, Reconfiguration, Step, Terminated,
        };
        let both = &[Instantiated, Configuration, Initialization, Reconfiguration, Terminated, Error];
        let common = Self::of(both).0 & self.0;
        Self(if self.contains(Step) { common | Self::of(&[Activation]).0 } else { common })
    }

    /// Whether the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether `state` is in the set.
    pub const fn contains(self, state: State) -> bool {
        self.0 >> state as u8 & 1 != 0
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

/// A call of the importer, by its purpose; several functions of the standards share one.
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
    /// `fmi3EnterConfigurationMode`.
    EnterConfiguration,
    /// `fmi3ExitConfigurationMode`.
    ExitConfiguration,
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
    /// `EnterEventMode`.
    EnterEvent,
    /// `fmi2NewDiscreteStates`, `fmi3UpdateDiscreteStates`.
    UpdateDiscrete,
    /// `fmi3EvaluateDiscreteStates`, which has nothing to evaluate.
    EvaluateDiscrete,
    /// `EnterContinuousTimeMode`.
    EnterContinuous,
    /// `fmi3EnterStepMode`.
    EnterStep,
    /// `SetTime`.
    SetTime,
    /// `SetContinuousStates`.
    SetStates,
    /// `CompletedIntegratorStep`.
    CompletedStep,
    /// `GetContinuousStates`, `fmi2GetDerivatives`, `fmi3GetContinuousStateDerivatives`, `GetEventIndicators`.
    GetContinuous,
    /// `GetNominalsOfContinuousStates`.
    GetNominals,
    /// `fmi3GetNumberOfContinuousStates`, `fmi3GetNumberOfEventIndicators`.
    Count,
    /// `GetDirectionalDerivative`, `fmi3GetAdjointDerivative`.
    Sensitivity,
    /// `fmi2GetRealOutputDerivatives`, `fmi3GetOutputDerivatives`.
    OutputDerivatives,
    /// `fmi2SetRealInputDerivatives`.
    InputDerivatives,
    /// `GetFMUState`.
    SaveState,
    /// `SetFMUState`: the restored snapshot determines the next state.
    RestoreState,
    /// Free, size, serialize and deserialize a saved state.
    UseState,
    /// `fmi2Get...Status`.
    Status,
    /// `fmi3GetClock`.
    GetClock,
    /// `fmi3SetClock`.
    SetClock,
    /// `fmi3GetInterval...`.
    GetInterval,
    /// `fmi3SetInterval...`.
    SetInterval,
    /// `fmi3GetShift...`, `fmi3SetShift...`.
    Shift,
    /// `fmi3ActivateModelPartition`.
    Activate,
    /// A capability that this FMU lacks: refused in every state, for this reason.
    Unsupported,
}

/// The state that a successful call leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Unchanged.
    Stay,
    /// This one.
    To(State),
    /// The state after initialization: Step Mode, or Event Mode where the importer handles events.
    Start,
    /// Configuration Mode from Instantiated, Reconfiguration Mode from another state.
    Configure,
    /// Back to the state in which one of these was entered.
    Configured,
}

/// A row of the table: the states that allow a call, for FMI 2.0 and FMI 3.0.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// In co-simulation.
    step: [States; 2],
    /// In co-simulation with Event Mode, in addition.
    event: States,
    /// In Model Exchange.
    exchange: [States; 2],
    /// In Scheduled Execution.
    scheduled: States,
    next: Next,
}

const NONE: [States; 2] = [States(0); 2];

const fn both(states: &[State]) -> [States; 2] {
    [States::of(states), States::of(states)]
}

const fn each(fmi2: &[State], fmi3: &[State]) -> [States; 2] {
    [States::of(fmi2), States::of(fmi3)]
}

/// A call of every interface.
const fn any(states: [States; 2], next: Next) -> Row {
    Row { step: states, event: states[1], exchange: states, scheduled: states[1].scheduled(), next }
}

/// A call of co-simulation only; Event Mode does not allow it.
const fn stepping(states: [States; 2], next: Next) -> Row {
    Row { step: states, event: states[1], exchange: NONE, scheduled: States(0), next }
}

/// A call of Model Exchange only.
const fn exchange(states: [States; 2], next: Next) -> Row {
    Row { step: NONE, event: States(0), exchange: states, scheduled: States(0), next }
}

/// A call about clocks: where the importer handles events, and in Scheduled Execution.
const fn clocks(events: &[State], scheduled: &[State]) -> Row {
    Row { event: States::of(events), scheduled: States::of(scheduled), ..exchange(each(&[], events), Next::Stay) }
}

impl Call {
    const fn row(self) -> Row {
        use Next::{Configure, Configured, Start, Stay, To};
        use State::{
            Activation, ClockUpdate, Configuration, Continuous, Ended, Error, Event, Initialization, Instantiated,
            Intermediate, Reconfiguration, Step, Terminated,
        };
        match self {
            Self::SetDebugLogging | Self::RestoreState | Self::UseState | Self::Unsupported => {
                any(both(&State::REST), Stay)
            }
            Self::Instantiate => any(NONE, Stay),
            Self::SetupExperiment => any(each(&[Instantiated], &[]), Stay),
            Self::EnterInitialization => any(both(&[Instantiated]), To(Initialization)),
            Self::ExitInitialization => any(both(&[Initialization]), Start),
            Self::EnterConfiguration => {
                Row { exchange: each(&[], &[Instantiated, Event]), ..any(each(&[], &[Instantiated, Step]), Configure) }
            }
            Self::ExitConfiguration => any(each(&[], &[Configuration, Reconfiguration]), Configured),
            Self::Terminate => any(
                each(&[Step, Event, Continuous, Ended], &[Step, Event, Continuous, Ended, Reconfiguration]),
                To(Terminated),
            ),
            Self::Reset => any(both(&State::REST), To(Instantiated)),
            // FMI 3.0.2, 2.3.2 lets start values be read before initialization; FMI 2.0.5, 4.2.4 does not.
            // In Error: for debugging (2.0.5, 4.2.4).
            Self::Get => {
                any(each(&[Initialization, Step, Event, Continuous, Ended, Terminated, Error], &State::ALL), Stay)
            }
            Self::Set => any(
                each(
                    &[Instantiated, Initialization, Step, Event, Continuous],
                    &[
                        Instantiated,
                        Configuration,
                        Initialization,
                        Step,
                        Event,
                        Continuous,
                        Ended,
                        Reconfiguration,
                        Intermediate,
                    ],
                ),
                Stay,
            ),
            Self::DoStep => stepping(both(&[Step]), Stay),
            // The state after an error is useless.
            Self::SaveState => {
                let saved = &[Instantiated, Initialization, Step, Event, Continuous, Ended, Terminated];
                let also = &[
                    Instantiated,
                    Configuration,
                    Initialization,
                    Step,
                    Event,
                    Continuous,
                    Ended,
                    Reconfiguration,
                    Terminated,
                ];
                any(each(saved, also), Stay)
            }
            Self::Status => stepping(each(&[Step, Ended, Terminated], &[]), Stay),
            // An FMU of FMI 2.0 without states may never leave Event Mode (FMI 2.0.5, 3.2.3). FMI 3.0: `Habit::Event`.
            Self::EnterEvent => Row { event: States::of(&[Step]), ..exchange(both(&[Event, Continuous]), To(Event)) },
            Self::UpdateDiscrete => Row { event: States::of(&[Event]), ..exchange(both(&[Event]), Stay) },
            Self::EvaluateDiscrete => Row { event: States::of(&[Event]), ..exchange(each(&[], &[Event]), Stay) },
            Self::EnterContinuous => exchange(both(&[Event]), To(Continuous)),
            Self::EnterStep => Row { event: States::of(&[Event]), ..exchange(NONE, To(Step)) },
            // In Event Mode of FMI 3.0: `Habit::Time`.
            Self::SetTime => exchange(both(&[Event, Continuous]), Stay),
            // Outside of Continuous-Time Mode: `Habit::States`.
            Self::SetStates => exchange(each(&[Initialization, Event, Continuous], &[Event, Continuous]), Stay),
            Self::CompletedStep => exchange(both(&[Continuous]), Stay),
            Self::GetContinuous => exchange(
                each(
                    &[Initialization, Event, Continuous, Terminated, Error],
                    &[Initialization, Event, Continuous, Terminated],
                ),
                Stay,
            ),
            Self::GetNominals => exchange(
                each(
                    &[Instantiated, Initialization, Event, Continuous, Terminated, Error],
                    &[Initialization, Event, Continuous, Terminated],
                ),
                Stay,
            ),
            Self::Count => exchange(each(&[], &[Instantiated, Initialization, Event, Continuous, Terminated]), Stay),
            Self::Sensitivity => any(
                each(
                    &[Initialization, Step, Event, Continuous, Ended, Terminated, Error],
                    &[Initialization, Step, Event, Continuous, Ended, Terminated],
                ),
                Stay,
            ),
            Self::OutputDerivatives => {
                stepping(each(&[Step, Ended, Terminated, Error], &[Step, Ended, Terminated, Intermediate]), Stay)
            }
            Self::InputDerivatives => stepping(each(&[Instantiated, Initialization, Step], &[]), Stay),
            Self::GetClock => clocks(&[Event], &[Activation, ClockUpdate]),
            Self::SetClock => clocks(&[Event], &[]),
            Self::GetInterval => clocks(&[Initialization, Event], &[Initialization, Activation, ClockUpdate]),
            Self::SetInterval => clocks(&[Initialization, Event], &[Initialization, Activation]),
            Self::Shift => clocks(&[Initialization], &[Initialization]),
            Self::Activate => clocks(&[], &[Activation]),
        }
    }

    /// This call for an FMU that `has` its capability.
    pub const fn of(self, has: bool) -> Self {
        if has { self } else { Self::Unsupported }
    }

    /// A scheduler may interrupt it in Scheduled Execution (FMI 3.0.2, 5.1.2).
    pub(crate) const fn is_preempted(self) -> bool {
        matches!(self, Self::Get | Self::Set | Self::GetClock | Self::GetInterval | Self::SetInterval | Self::Activate)
    }

    /// The state that it leads to.
    pub const fn next(self) -> Next {
        self.row().next
    }

    /// The states that allow this call.
    pub const fn states(self, standard: Standard, interface: Interface) -> States {
        let row = self.row();
        match interface {
            Interface::CoSimulation => row.step[standard as usize],
            Interface::EventMode => row.event,
            Interface::ModelExchange => row.exchange[standard as usize],
            Interface::ScheduledExecution => row.scheduled,
        }
    }
}

/// The states that allow a call: for each interface.
#[derive(Clone, Copy, Debug)]
pub struct Allowed([States; 4]);

impl Allowed {
    /// The states that allow `call`.
    pub const fn of(call: Call, standard: Standard) -> Self {
        Self([
            call.states(standard, Interface::CoSimulation),
            call.states(standard, Interface::EventMode),
            call.states(standard, Interface::ModelExchange),
            call.states(standard, Interface::ScheduledExecution),
        ])
    }

    /// The states of one interface.
    #[inline]
    pub const fn of_interface(&self, interface: Interface) -> States {
        self.0[interface as usize]
    }
}

/// The state of one instance and its interface. It changes only in [`Life::after`] and [`Life::end`]; a restored FMU state
/// includes its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Life {
    state: State,
    interface: Interface,
}

impl Life {
    /// After instantiation.
    pub const fn new(interface: Interface) -> Self {
        Self { state: State::Instantiated, interface }
    }

    /// The state.
    #[inline]
    pub const fn state(self) -> State {
        self.state
    }

    /// The interface.
    #[inline]
    pub const fn interface(self) -> Interface {
        self.interface
    }

    /// Whether the importer handles events.
    pub const fn handles_events(self) -> bool {
        matches!(self.interface, Interface::EventMode | Interface::ModelExchange)
    }

    /// Records that the model has ended the simulation in a step.
    pub const fn end(&mut self) {
        self.state = State::Ended;
    }

    /// Records that a call succeeded, with the [next](Call::next) state, or failed.
    #[inline]
    pub const fn after(&mut self, succeeded: bool, next: Next) {
        if !succeeded {
            self.state = State::Error;
            return;
        }
        match next {
            Next::Stay => {}
            Next::To(state) => self.state = state,
            Next::Start if self.handles_events() => self.state = State::Event,
            Next::Start if matches!(self.interface, Interface::ScheduledExecution) => self.state = State::Activation,
            Next::Start => self.state = State::Step,
            Next::Configure if matches!(self.state, State::Instantiated) => self.state = State::Configuration,
            Next::Configure => self.state = State::Reconfiguration,
            Next::Configured if matches!(self.state, State::Configuration) => self.state = State::Instantiated,
            Next::Configured => {
                self.state = match self.interface {
                    Interface::ModelExchange => State::Event,
                    Interface::ScheduledExecution => State::Activation,
                    Interface::CoSimulation | Interface::EventMode => State::Step,
                }
            }
        }
    }

    /// Records that a step, or a partition, waits for a callback of the importer.
    pub(crate) const fn call_back(&mut self) {
        self.state = match self.state {
            State::Activation => State::ClockUpdate,
            _ => State::Intermediate,
        };
    }

    /// Records that the callback has returned; false if a call in it has failed.
    pub(crate) const fn called_back(&mut self) -> bool {
        match self.state {
            State::Intermediate => self.state = State::Step,
            State::ClockUpdate => self.state = State::Activation,
            _ => return false,
        }
        true
    }
}

#[cfg(test)]
mod tests;
