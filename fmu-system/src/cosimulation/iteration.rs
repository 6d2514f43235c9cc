//! Event iteration: updates the discrete states of several FMUs in event mode until none needs another update.

use fmu_import::{Error, Instance};

/// Largest number of updates of one event.
const UPDATES: usize = 100;

/// Result of an event for each instance.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Iterated {
    /// Time (s) of the next time event.
    pub(super) next: Option<f64>,
    pub(super) states_changed: bool,
    pub(super) nominals_changed: bool,
    again: bool,
}

/// Updates the instances in this order. Before the first update of any, and after each, `pass_on` passes outputs on to inputs
/// and returns whether a discrete input changed; then another update follows (FMI 2.0.5, 3.1; FMI 3.0.2, 2.3.5). Returns the
/// index of an instance that requests the end of the simulation.
pub(super) fn iterate(
    instances: &mut [Instance],
    order: &[usize],
    outcomes: &mut [Iterated],
    t: f64,
    mut pass_on: impl FnMut(&mut [Instance]) -> Result<bool, Error>,
) -> Result<Option<usize>, Error> {
    for &index in order {
        outcomes[index] = Iterated::default();
    }
    pass_on(instances)?;
    for _ in 0..UPDATES {
        for &index in order {
            let update = instances[index].update_discrete_states()?;
            if update.terminate {
                return Ok(Some(index));
            }
            if update.next_event_time.is_some_and(f64::is_nan) {
                let cause = format!("its next event time at t = {t} s is not a number");
                return Err(Error::usage(instances[index].name(), cause));
            }
            let outcome = &mut outcomes[index];
            outcome.next = update.next_event_time;
            outcome.again = update.again;
            outcome.states_changed |= update.states_changed;
            outcome.nominals_changed |= update.nominals_changed;
        }
        let changed = pass_on(instances)?;
        if !changed && order.iter().all(|&index| !outcomes[index].again) {
            return Ok(None);
        }
    }
    let restless: Vec<&str> = order.iter().filter(|&&i| outcomes[i].again).map(|&i| instances[i].name()).collect();
    Err(match restless.as_slice() {
        [] => Error::usage("event", format!("discrete inputs still change after {UPDATES} updates at t = {t} s")),
        [one] => Error::usage(one, format!("needs more than {UPDATES} updates of its discrete states at t = {t} s")),
        some => {
            let cause = format!("need more than {UPDATES} updates of their discrete states at t = {t} s");
            Error::usage(&some.join(", "), cause)
        }
    })
}
