//! The rules that the compiler applies to an exported model, at run time: each with models that break it, and with models that just keep it.
#![allow(missing_docs)]

use fmu_core::rules::check;
use fmu_core::unit::{METER, METER_PER_S};
use fmu_core::*;
use serde::{Deserialize, Serialize};
use std::thread;

/// The text of a refusal. The tables of names are for the compiler: without optimization, copies of them fill the stack of a test.
fn refusal(check: fn()) -> Option<String> {
    let checked = thread::Builder::new().stack_size(64 << 20).spawn(check).unwrap().join();
    checked.err().map(|panic| panic.downcast_ref::<String>().unwrap().clone())
}

const INFO: Info = Info { name: "Ball", ..Info::DEFAULT };

#[derive(Clone, Default, Serialize, Deserialize)]
struct Part {
    x: f64,
}

const PART: &Table<Part> = table![Row::<Part>::state("x", &METER, "", |p| &mut p.x)];

/// The refusal of a model `M` with this information, rows `V`, states `S` and capabilities. A `Timed` model has every trait but `Sampled`,
/// which brings its own events and clocks.
macro_rules! refused {
    ($kind:ident, $info:expr, [$($row:expr),* $(,)?], [$($state:expr),*], $can:expr) => {{
        #[derive(Clone, Default, Serialize, Deserialize)]
        struct M {
            h: f64,
            v: f64,
            a: [f64; 2],
            n: u64,
            part: Part,
        }
        #[allow(dead_code, reason = "a table without rows")]
        type V = Row<Block<M>>;
        type S = State<M>;
        impl Model for M {
            type Outputs = ();
            const INFO: Info = $info;
            const TABLE: &'static Table<Block<Self>> = table![$($row),*];
            fn initialize(&mut self) {}
            fn output(&self, _: Elapsed, (): &mut ()) {}
            fn advance(&mut self, _: &Step) -> Result<(), Fault> {
                Ok(())
            }
        }
        impl ContinuousTime for M {
            const STATES: &'static [S] = &[$($state),*];
            fn derivatives(&self, _: Elapsed, _: &mut [f64]) -> Result<(), Fault> {
                Ok(())
            }
        }
        impl Intermediate for M {
            fn longest(&self) -> f64 {
                1.0
            }
        }
        impl Resizable for M {
            fn resize(&mut self) -> Result<(), Fault> {
                Ok(())
            }
        }
        refused!($kind);
        struct E;
        impl Exported for E {
            type Model = M;
            const CAN: Capabilities<M> = $can;
        }
        refusal(|| check::<E>())
    }};
    (Timed) => {
        impl Events for M {
            fn event(&mut self, _: Elapsed) -> Result<Outcome, Fault> {
                Ok(Outcome::default())
            }
            fn next(&self, _: Elapsed) -> Next {
                Next::Never
            }
        }
        impl EventMode for M {
            fn to_event(&mut self, step: &Step) -> Result<Stop, Fault> {
                Ok(Stop { at: step.end(), event: false, settles: true })
            }
        }
        impl Clocked for M {
            fn tick(&mut self, _: usize, _: Elapsed) -> Result<(), Fault> {
                Ok(())
            }
        }
    };
    (Sampled) => {
        impl Sampled for M {
            fn period(&self) -> f64 {
                1.0
            }
            fn samples(&self) -> u64 {
                0
            }
            fn show(&mut self) {}
            fn sample(&mut self) -> Result<(), Fault> {
                Ok(())
            }
        }
    };
}

/// A model with nothing but this information.
macro_rules! informed {
    ($($field:ident: $value:expr),*) => {
        refused!(Timed, Info { $($field: $value,)* ..INFO }, [], [], Capabilities::NONE)
    };
}

macro_rules! state {
    ($name:literal) => {
        S::new($name, &METER_PER_S, |m| &mut m.h)
    };
}

macro_rules! states {
    ($name:literal, $n:literal) => {
        S::array($name, &METER_PER_S, $n, |m| &mut m.a)
    };
}

macro_rules! clock {
    ($name:literal) => {
        V::clock($name, "", Clock::triggered())
    };
}

#[test]
fn a_name_is_an_identifier() {
    let rule =
        "INFO.name must be a C identifier, as modelIdentifier of FMI is: a letter or _, then letters, digits and _";
    assert_eq!(informed!(name: "B"), None);
    assert_eq!(informed!(name: "_2"), None);
    assert_eq!(informed!(name: "b_all9Z"), None);
    assert_eq!(informed!(name: ""), Some(format!(": {rule}")));
    assert_eq!(informed!(name: "2Balls"), Some(format!("2Balls: {rule}")));
    assert_eq!(informed!(name: "My-Ball"), Some(format!("My-Ball: {rule}")));
    assert_eq!(informed!(name: "B "), Some(format!("B : {rule}")));
}

#[test]
fn the_experiment_has_positive_numbers() {
    const fn tolerant(x: f64) -> Experiment {
        Experiment { tolerance: Some(x), ..Experiment::DEFAULT }
    }
    const fn fixed(x: f64) -> Experiment {
        Experiment { fixed_step: Some(x), ..Experiment::DEFAULT }
    }
    assert_eq!(informed!(experiment: Experiment { fixed_step: Some(1e-9), ..tolerant(1e-300) }), None);
    let rule = Some("Ball: the tolerance of the experiment must be greater than 0".to_owned());
    assert_eq!(informed!(experiment: tolerant(0.0)), rule);
    assert_eq!(informed!(experiment: tolerant(-1e-4)), rule);
    assert_eq!(informed!(experiment: tolerant(f64::INFINITY)), rule);
    let rule = Some("Ball: the fixed step of the experiment must be greater than 0".to_owned());
    assert_eq!(informed!(experiment: fixed(0.0)), rule);
    assert_eq!(informed!(experiment: fixed(f64::NAN)), rule);
}

#[test]
fn log_categories_have_names_of_their_own() {
    const MOST: [(&str, &str); log::OWN + 1] = {
        let mut all = [("", ""); log::OWN + 1];
        let (names, mut i) = ("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ", 0);
        while i < all.len() {
            all[i].0 = names.split_at(i + 1).0.split_at(i).1;
            i += 1;
        }
        all
    };
    assert_eq!(informed!(categories: MOST.split_at(log::OWN).0), None);
    let rule = "Ball: the model has more log categories than a log has room for";
    assert_eq!(informed!(categories: &MOST).as_deref(), Some(rule));
    let twice = |name: &str| Some(format!("{name}: two log categories have this name"));
    assert_eq!(informed!(categories: &[("a", ""), ("b", ""), ("a", "")]), twice("a"));
    assert_eq!(informed!(categories: &[("a", ""), ("b", ""), ("b", "")]), twice("b"));
    let last = log::CATEGORIES.len() - 1;
    assert_eq!(informed!(categories: &[log::CATEGORIES[0]]), twice(log::CATEGORIES[0].0));
    assert_eq!(
        informed!(categories: &[("a", ""), log::CATEGORIES[log::CATEGORIES.len() - 1]]),
        twice(log::CATEGORIES[last].0)
    );
    assert_eq!(informed!(categories: &[("", "")]).as_deref(), Some(": a log category needs its own name"));
    let all = format!("{}: a log category needs its own name", log::ALL);
    assert_eq!(informed!(categories: &[("a", ""), (log::ALL, "")]), Some(all));
}

#[test]
fn each_state_has_its_row() {
    macro_rules! stated {
        ($($state:expr),*) => {
            refused!(Timed, INFO, [
                V::state("h", &METER, "", |m| &mut m.model.h),
                V::discrete_local("v", &METER_PER_S, "", |m| &mut m.model.v),
                V::parameter("p", &METER, "", |m| &mut m.model.v),
                V::structural("n", "", |m| &mut m.model.n).at_most(9.0),
                V::array_local("a", &METER, "", 2, |m| &mut m.model.a),
                V::part("part.", &fmu_core::Part { table: PART, lens: |m: &mut Block<M>| &mut m.model.part }),
                V::output("y", &METER, "", |m| &mut m.model.v),
            ], [$($state),*], Capabilities::NONE.ContinuousTime().Resizable())
        };
    }
    assert_eq!(stated!(), None);
    assert_eq!(stated!(state!("h"), states!("a", 2), state!("y"), state!("part.x")), None);
    let none = |name: &str| Some(format!("STATES of Ball: no row of the table has the name {name}"));
    assert_eq!(stated!(state!("h"), state!("hight")), none("hight"));
    assert_eq!(stated!(state!("par.x")), none("par.x"));
    let wrong = "the row of a state is V::output or V::state, the row of an array V::array_output or V::array_local";
    assert_eq!(stated!(state!("v")), Some(format!("v: {wrong}")));
    assert_eq!(stated!(state!("p")), Some(format!("p: {wrong}")));
    assert_eq!(stated!(state!("n")), Some(format!("n: {wrong}")));
    assert_eq!(stated!(state!("h"), state!("h")).as_deref(), Some("h: two states have this name"));
    assert_eq!(stated!(state!("a")).as_deref(), Some("a: the row is an array: its state is State::array"));
    let other = "State::array and its row have different numbers of elements";
    assert_eq!(stated!(states!("a", 3)), Some(format!("a: {other}")));
    assert_eq!(stated!(states!("a", 1)), Some(format!("a: {other}")));
    assert_eq!(stated!(states!("h", 2)), Some(format!("h: {other}")));
}

#[test]
fn capabilities_fit_together() {
    type Can<M> = Capabilities<M>;
    macro_rules! able {
        ($kind:ident, [$($row:expr),*], $can:expr) => {
            refused!($kind, INFO, [V::state("h", &METER, "", |m| &mut m.model.h), $($row),*], [state!("h")], $can)
        };
        ($can:expr) => { able!(Timed, [], $can) };
    }
    macro_rules! structural {
        () => {
            V::structural("n", "", |m| &mut m.model.n).at_most(9.0)
        };
    }
    macro_rules! inner {
        () => {
            V::output("y", &METER, "", |m| &mut m.model.v).intermediate()
        };
    }
    let said = |rule: &str| Some(format!("Ball: {rule}"));
    // Model Exchange alone.
    let exchange = said("ModelExchangeOnly is for a model with states or events, and without EventMode");
    assert_eq!(able!(Can::NONE.ContinuousTime().ModelExchangeOnly()), None);
    assert_eq!(able!(Can::NONE.Events().ModelExchangeOnly()), None);
    assert_eq!(able!(Can::NONE.ModelExchangeOnly()), exchange);
    assert_eq!(able!(Can::NONE.ContinuousTime().Events().EventMode().ModelExchangeOnly()), exchange);
    // Event Mode.
    let complete = said("EventMode is for a model that is exported with ContinuousTime and Events");
    assert_eq!(able!(Can::NONE.ContinuousTime().Events().EventMode()), None);
    assert_eq!(able!(Can::NONE.ContinuousTime().EventMode()), complete);
    assert_eq!(able!(Can::NONE.Events().EventMode()), complete);
    // Intermediate updates.
    assert_eq!(able!(Timed, [inner!()], Can::NONE.ContinuousTime().Intermediate()), None);
    let rows = said("the capability Intermediate needs a row of the table with .intermediate()");
    assert_eq!(able!(Can::NONE.ContinuousTime().Intermediate()), rows);
    let capability = said("a row of the table with .intermediate() needs the capability Intermediate");
    assert_eq!(able!(Timed, [inner!()], Can::NONE.ContinuousTime()), capability);
    let states = said("the capability Intermediate needs ContinuousTime");
    assert_eq!(able!(Timed, [inner!()], Can::NONE.Intermediate()), states);
    // Sizes.
    assert_eq!(able!(Timed, [structural!()], Can::NONE.Resizable()), None);
    assert_eq!(able!(Can::NONE.Resizable()), said("the capability Resizable needs a row V::structural"));
    let capability = said("a row V::structural needs the capability Resizable");
    assert_eq!(able!(Timed, [structural!()], Can::NONE), capability);
    let saved = said("a row V::structural needs a model that is saved, not Unsaved: new sizes are tried on a copy");
    assert_eq!(able!(Timed, [structural!()], Can::unsaved().Resizable()), saved);
    assert_eq!(able!(Timed, [structural!()], Can::unstored().Resizable()), None);
    // Clocks.
    assert_eq!(able!(Timed, [clock!("c")], Can::NONE.Clocked()), None);
    assert_eq!(able!(Timed, [clock!("c").priority(0)], Can::NONE.Clocked().ScheduledExecution()), None);
    assert_eq!(able!(Can::NONE.Clocked()), said("the capability Clocked needs a row V::clock"));
    assert_eq!(able!(Timed, [clock!("c")], Can::NONE), said("a row V::clock needs the capability Clocked"));
    assert_eq!(able!(Can::NONE.ScheduledExecution()), said("the capability ScheduledExecution needs Clocked"));
    let saved = said(
        "Clocked needs a model that is saved, not Unsaved: an importer asks for output clocks before the event, which is computed on a \
         copy",
    );
    assert_eq!(able!(Timed, [clock!("c")], Can::unsaved().Clocked()), saved);
    let alone = said("Clocked excludes Sampled, which generates its own ticks, and Intermediate");
    assert_eq!(able!(Sampled, [], Can::NONE.Sampled()), None);
    assert_eq!(able!(Sampled, [clock!("c")], Can::NONE.Clocked()), None);
    assert_eq!(able!(Sampled, [clock!("c")], Can::NONE.Sampled().Clocked()), alone);
    assert_eq!(able!(Timed, [inner!(), clock!("c")], Can::NONE.ContinuousTime().Intermediate().Clocked()), alone);
}

#[test]
fn a_variable_names_clocks_of_its_table() {
    macro_rules! clocked {
        ([$($row:expr),*], $can:expr) => {
            refused!(Timed, INFO, [
                clock!("c"),
                V::clock_output("out", ""),
                clock!("c2").priority(1),
                V::parameter("p", &METER, "", |m| &mut m.model.h),
                $($row),*
            ], [], $can)
        };
    }
    macro_rules! on {
        ($clocks:literal) => {
            clocked!([V::input("u", &METER, "", |m| &mut m.model.v).on($clocks)], Capabilities::NONE.Clocked())
        };
    }
    for right in [on!("c"), on!("c out"), on!("c2 c out"), on!("")] {
        assert_eq!(right, None);
    }
    for wrong in [on!("p"), on!("c p"), on!("d"), on!("c out d"), on!("C")] {
        assert_eq!(wrong.as_deref(), Some("u: the table has no clock of the name that it is on"));
    }
    // A clock that the model ticks has no priority.
    let scheduled = clocked!([], Capabilities::NONE.Clocked().ScheduledExecution());
    assert_eq!(scheduled.as_deref(), Some("c: a clock of Scheduled Execution needs a priority"));
}

#[test]
#[expect(clippy::large_stack_arrays, reason = "only while compiling")]
fn sixty_four_clocks_are_the_most() {
    macro_rules! clocks {
        ($($name:literal)*) => {
            refused!(Timed, INFO, [$(clock!($name)),*], [], Capabilities::NONE.Clocked())
        };
    }
    macro_rules! sixty_four {
        ($($more:literal)*) => {
            clocks!("a1" "a2" "a3" "a4" "a5" "a6" "a7" "a8" "b1" "b2" "b3" "b4" "b5" "b6" "b7" "b8"
                "c1" "c2" "c3" "c4" "c5" "c6" "c7" "c8" "d1" "d2" "d3" "d4" "d5" "d6" "d7" "d8"
                "e1" "e2" "e3" "e4" "e5" "e6" "e7" "e8" "f1" "f2" "f3" "f4" "f5" "f6" "f7" "f8"
                "g1" "g2" "g3" "g4" "g5" "g6" "g7" "g8" "h1" "h2" "h3" "h4" "h5" "h6" "h7" "h8" $($more)*)
        };
    }
    assert_eq!(sixty_four!(), None);
    assert_eq!(sixty_four!("i1").as_deref(), Some("Ball: more than 64 clocks"));
}
