//! When variables are set.

use super::*;
use State::*;
use fmu_core::unit::VOLT;
use fmu_core::{Row, table};

#[derive(Default)]
struct M {
    x: f64,
    n: u64,
}

const TABLE: &Table<M> = table![
    Row::structural("n", "", |m: &mut M| &mut m.n).at_most(3.0),
    Row::structural("k", "", |m: &mut M| &mut m.n).at_most(3.0).tunable(),
    Row::input("u", &VOLT, "", |m: &mut M| &mut m.x),
    Row::discrete_input("v", &VOLT, "", |m: &mut M| &mut m.x),
    Row::input("w", &VOLT, "", |m: &mut M| &mut m.x).intermediate(),
    Row::parameter("p", &VOLT, "", |m: &mut M| &mut m.x),
    Row::parameter("q", &VOLT, "", |m: &mut M| &mut m.x).tunable(),
    Row::output("y", &VOLT, "", |m: &mut M| &mut m.x),
    Row::output("z", &VOLT, "", |m: &mut M| &mut m.x).exact(),
];

fn of(index: usize, rule: fn(&Meta, State) -> bool) -> Vec<State> {
    let meta = TABLE.entry(&mut M::default(), index).unwrap().0;
    // Those in which an importer may set variables at all.
    let states = State::ALL.into_iter().filter(|state| !matches!(state, Ended | Terminated | Error));
    states.filter(|state| rule(meta, *state)).collect()
}

#[test]
fn variables_are_set_in_their_states() {
    let (at_start, computed) = ([Instantiated, Initialization], [Step, Event, Continuous]);
    let cases: [(&[State], &[State]); 9] = [
        (&[Instantiated, Configuration], &[]),
        (&[Instantiated, Configuration, Reconfiguration], &[]),
        (&[Instantiated, Initialization, Step, Event, Continuous, Activation, ClockUpdate], &[]),
        (&[Instantiated, Initialization, Step, Event, Activation, ClockUpdate], &[]),
        (&[Instantiated, Initialization, Step, Event, Continuous, Intermediate, Activation, ClockUpdate], &[]),
        (&at_start, &computed),
        (&[Instantiated, Initialization, Step, Event, Activation], &[Continuous]),
        (&[], &[]),
        (&at_start, &computed),
    ];
    for (index, (opened, kept)) in cases.into_iter().enumerate() {
        assert_eq!((&of(index, open)[..], &of(index, keeps)[..]), (opened, kept), "{index}");
    }
}
