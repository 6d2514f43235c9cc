//! Every function in every state of an interface, against a table.

use super::*;

/// Name, states that allow it by their letters, state afterwards (`.`: as before), the call.
pub type Line = (&'static str, &'static str, char, fn(&Fmu) -> c_int);

/// After a success the state is the one of the table, after a failure it is e, and one message names the function.
pub fn check(kind: Kind, states: &str, table: &[Line]) {
    for &(name, allowed, after, call) in table {
        for state in states.chars() {
            let fmu = Fmu::in_state(kind, state);
            let status = call(&fmu);
            let place = format!("{name} in {state}, {kind:?}");
            if allowed.contains(state) {
                assert_eq!(status, OK, "{place}: {:?}", fmu.journal.0.borrow());
                assert!(fmu.journal.0.borrow().is_empty());
                assert_eq!(fmu.state(), if after == '.' { state } else { after }, "{place}");
            } else {
                assert_eq!(status, ERROR, "{place}");
                let error = fmu.error();
                assert!(error.starts_with(&format!("{name}: ")), "{place}: {error}");
                assert_eq!(fmu.state(), 'e', "{place}");
            }
        }
    }
}

/// Works on a state that another instance of this kind made.
pub fn with_state<T>(kind: Kind, work: impl FnOnce(&Fmu, &mut FmuState) -> T) -> T {
    let other = Fmu::running(kind, 0.0);
    let mut state = null_mut();
    assert_eq!(other.save(&mut state), OK);
    let result = work(&other, &mut state);
    assert_eq!(other.free_state(&mut state), OK);
    result
}
