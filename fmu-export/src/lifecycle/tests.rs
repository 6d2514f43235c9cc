//! The calls that each state allows, and the states that they lead to, over all interfaces of both standards.

use super::*;
use Call::*;

const INTERFACES: [Interface; 4] =
    [Interface::CoSimulation, Interface::EventMode, Interface::ModelExchange, Interface::ScheduledExecution];

/// All calls but `Instantiate` and `Unsupported`, the first and the last: one that is missing does not compile.
const CALLS: [Call; Call::Unsupported as usize - 1] = [
    SetDebugLogging,
    SetupExperiment,
    EnterInitialization,
    ExitInitialization,
    EnterConfiguration,
    ExitConfiguration,
    Terminate,
    Reset,
    Get,
    Set,
    DoStep,
    EnterEvent,
    UpdateDiscrete,
    EvaluateDiscrete,
    EnterContinuous,
    EnterStep,
    SetTime,
    SetStates,
    CompletedStep,
    GetContinuous,
    GetNominals,
    Count,
    Sensitivity,
    OutputDerivatives,
    InputDerivatives,
    SaveState,
    RestoreState,
    UseState,
    Status,
    GetClock,
    SetClock,
    GetInterval,
    SetInterval,
    Shift,
    Activate,
];

/// Each interface of each standard that has it.
fn ways() -> impl Iterator<Item = (Standard, Interface)> {
    let both = |standard| INTERFACES.into_iter().map(move |interface| (standard, interface));
    let two = |(_, interface): &(_, _)| matches!(interface, Interface::CoSimulation | Interface::ModelExchange);
    both(Standard::Fmi2).filter(two).chain(both(Standard::Fmi3))
}

fn allowed(call: Call, (standard, interface): (Standard, Interface), state: State) -> bool {
    Allowed::of(call, standard).of_interface(interface).contains(state)
}

/// The states that an importer comes to, by the calls that a state allows and by a step in which the model ends.
fn reached(way: (Standard, Interface)) -> Vec<State> {
    let mut reached = vec![State::Instantiated];
    let mut i = 0;
    while let Some(&state) = reached.get(i) {
        for call in CALLS.into_iter().filter(|&call| allowed(call, way, state)) {
            let mut life = Life { state, interface: way.1 };
            life.after(true, call.next());
            let mut ended = life;
            if call == DoStep {
                ended.end();
            }
            for next in [life.state(), ended.state()] {
                if !reached.contains(&next) {
                    reached.push(next);
                }
            }
        }
        i += 1;
    }
    reached
}

#[test]
fn the_calls_lead_to_the_states_of_their_interface() {
    use State::*;
    for way in ways() {
        let mut wanted = vec![Instantiated, Initialization, Terminated];
        wanted.extend(match way.1 {
            Interface::CoSimulation => &[Step, Ended][..],
            Interface::EventMode => &[Step, Ended, Event],
            Interface::ModelExchange => &[Event, Continuous],
            Interface::ScheduledExecution => &[Activation],
        });
        if way.0 == Standard::Fmi3 {
            wanted.extend([Configuration, Reconfiguration]);
        }
        let mut found = reached(way);
        found.sort_by_key(|state| *state as u8);
        wanted.sort_by_key(|state| *state as u8);
        assert_eq!(found, wanted, "{way:?}");
    }
}

/// FMI 2.0.5, 4.2.4, and FMI 3.0.2, 2.3.1: a reset and a restored state lead out of every state between calls, and only they
/// lead out of the Error state.
#[test]
fn only_a_reset_and_a_restored_state_lead_out_of_an_error() {
    for way in ways() {
        for state in reached(way).into_iter().chain([State::Error]) {
            for call in [Reset, RestoreState, UseState, SetDebugLogging] {
                assert!(allowed(call, way, state), "{call:?} {way:?} {state}");
            }
        }
        let leave = |call: &Call| allowed(*call, way, State::Error) && call.next() != Next::Stay;
        assert_eq!(CALLS.into_iter().filter(leave).collect::<Vec<_>>(), [Reset], "{way:?}");
    }
}

/// Inside a callback the importer reads and sets values, and for clocks only reads.
#[test]
fn a_callback_may_make_few_calls() {
    for (way, state, wanted) in [
        ((Standard::Fmi3, Interface::CoSimulation), State::Intermediate, &[Get, Set, OutputDerivatives][..]),
        ((Standard::Fmi3, Interface::ScheduledExecution), State::ClockUpdate, &[GetClock, GetInterval]),
    ] {
        let found: Vec<Call> = CALLS.into_iter().filter(|&call| allowed(call, way, state)).collect();
        assert_eq!(found, wanted, "{way:?}");
    }
}

/// FMI 3.0.2, 5.1.2: the scheduler interrupts the calls between two partitions only.
#[test]
fn calls_that_a_scheduler_interrupts_are_those_of_running_partitions() {
    let way = (Standard::Fmi3, Interface::ScheduledExecution);
    for call in CALLS.into_iter().filter(|call| call.is_preempted()) {
        assert!(allowed(call, way, State::Activation), "{call:?}");
        assert_eq!(call.next(), Next::Stay, "{call:?}");
    }
    assert!(!CALLS.into_iter().any(|call| call.is_preempted() && matches!(call, Reset | Terminate | RestoreState)));
}

#[test]
fn a_missing_capability_is_refused_between_calls() {
    assert_eq!((Set.of(true), Set.of(false), Unsupported.next()), (Set, Unsupported, Next::Stay));
    for way in ways() {
        assert!(!allowed(Instantiate, way, State::Instantiated), "there is no instance yet");
    }
    assert_eq!(States::of(&[]).to_string(), "no state");
    assert_eq!(States::of(&[State::Error, State::Step]).to_string(), "Step Mode, Error");
}

/// A call that an interface has in no state is refused in other words.
#[test]
fn a_set_knows_whether_it_is_empty() {
    let (none, one) = (States::of(&[]), States::of(&[State::Step]));
    assert!(none.is_empty() && !one.is_empty());
    assert_eq!([none, one].map(|states| states.to_string()), ["no state", "Step Mode"]);
}
