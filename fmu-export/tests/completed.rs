//! A model that follows the solution: the calls of an importer that report a point, in both standards.
#![allow(missing_docs)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod solver;

use fmu_core::unit::{ONE, PER_SECOND};
use fmu_core::{
    Account, Block, CompletedSteps, ContinuousTime, Description, Elapsed, Events, Fault, Info, Kept, Model, Next,
    Outcome, Row, State, Step, Table, integrate, table,
};
use serde::{Deserialize, Serialize};
use solver::{CS, ERROR, Fmu, ME, OK, has_logger};
use std::ptr::null_mut;

/// dx/dt = u, and the area under x by the trapezoidal rule between the points of the solution.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Meter {
    u: f64,
    x: f64,
    area: f64,
    points: i32,
    last: (Elapsed, f64),
    kept: Kept<(f64, i32, (Elapsed, f64))>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Outputs {
    area: f64,
    points: i32,
}

const U: u32 = 1;
const X: u32 = 2;
const AREA: u32 = 3;
const POINTS: u32 = 4;

type Var = Row<Block<Meter>>;

impl Model for Meter {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Meter", description: "An area under a curve", version: "1.0", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        Var::input("u", &PER_SECOND, "Slope", |m| &mut m.model.u),
        Var::output("x", &ONE, "Height", |m| &mut m.model.x),
        Var::output("area", &ONE, "Area below x", |m| &mut m.out.area),
        Var::integer_output("points", "Points reported", |m| &mut m.out.points),
    ];

    fn initialize(&mut self) {
        *self = Self { u: self.u, ..Self::default() };
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        (out.area, out.points) = (self.area, self.points);
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, 1>(self, step, 0.1)
    }
}

impl ContinuousTime for Meter {
    const STATES: &'static [State<Self>] = &[State::new("x", &PER_SECOND, |m: &mut Meter| &mut m.x).reinit()];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = self.u;
        Ok(())
    }
}

impl CompletedSteps for Meter {
    fn complete(&mut self, now: Elapsed) -> Result<(), Fault> {
        if self.x > 1e3 {
            return Err(Fault::value("x", self.x, "at most 1000"));
        }
        let (then, x) = self.last;
        self.area += 0.5 * (x + self.x) * now.since(then);
        (self.points, self.last) = (self.points + 1, (now, self.x));
        Ok(())
    }

    fn account(&mut self, account: Account) {
        let mut counts = (self.area, self.points, self.last);
        self.kept.follow(account, &mut counts);
        (self.area, self.points, self.last) = counts;
    }
}

impl Events for Meter {
    /// Every event halves the height.
    fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
        self.x *= 0.5;
        Ok(Outcome { states_changed: true, ..Outcome::default() })
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}

fmu_export::export!(Meter: ContinuousTime + Events + CompletedSteps);

/// The area, and the number of reported points.
fn counted(fmu: &Fmu) -> (f64, i32) {
    (fmu.get(AREA), fmu.get_integer(POINTS))
}

fn point(fmu: &Fmu, t: f64, x: f64) {
    assert_eq!((fmu.set_time(t), fmu.set_states(&[x])), (OK, OK));
}

#[test]
fn completed_steps_and_events_are_told_and_trials_are_not() {
    for kind in ME {
        // The event that ends the initialization, and its end.
        let fmu = Fmu::running(kind, 2.0);
        assert_eq!(counted(&fmu), (0.0, 2));
        // A step that is tried at several times and rejected, a shorter one that is complete.
        for (t, x) in [(2.5, 7.0), (3.0, 9.0), (2.1, 1.0)] {
            point(&fmu, t, x);
            let _: [f64; 1] = fmu.derivatives();
            assert_eq!(counted(&fmu), (0.0, 2));
        }
        point(&fmu, 2.5, 4.0);
        assert_eq!((fmu.completed(), counted(&fmu)), (OK, (1.0, 3)));
        assert_eq!((fmu.completed(), counted(&fmu)), (OK, (1.0, 3)), "no time has passed: counted again");
        point(&fmu, 2.5, 6.0);
        assert_eq!((fmu.completed(), counted(&fmu)), (OK, (1.5, 3)), "another iteration at the same time");
        point(&fmu, 2.5, 4.0);
        assert_eq!((fmu.completed(), counted(&fmu)), (OK, (1.0, 3)));
        // An event inside the next step: past it, then back to it.
        point(&fmu, 3.5, 6.0);
        point(&fmu, 3.0, 5.0);
        assert_eq!((fmu.event(), counted(&fmu)), (OK, (3.25, 4)));
        fmu.settle();
        assert_eq!((fmu.leave(), fmu.get(X), counted(&fmu)), (OK, 2.5, (3.25, 5)));
        // From the height after the event on.
        point(&fmu, 4.0, 3.5);
        assert_eq!((fmu.completed(), counted(&fmu)), (OK, (6.25, 6)));
    }
}

/// A completed step that is then rejected has no effect.
#[test]
fn what_completed_steps_counted_is_taken_back() {
    for kind in ME {
        let fmu = Fmu::with(kind, true, true);
        assert_eq!((fmu.enter(0.0, None), fmu.exit(), fmu.leave()), (OK, OK, OK));
        fmu.messages();
        for (t, x) in [(1.0, 4.0), (2.0, 8.0), (3.0, 9.0), (3.0, 11.0)] {
            point(&fmu, t, x);
            assert_eq!(fmu.completed(), OK);
        }
        assert_eq!(counted(&fmu), (2.0 + 6.0 + 9.5, 5));
        assert!(fmu.messages().is_empty());
        // Back between two points, and on from the one before.
        point(&fmu, 1.5, 6.0);
        assert_eq!(counted(&fmu), (2.0, 3));
        let warned = fmu.messages();
        assert!(warned.len() == usize::from(has_logger(kind.version())), "{warned:?}");
        assert!(warned.iter().all(|m| m.status == 1 && m.text.contains("a time before the last completed step")));
        assert_eq!((fmu.completed(), counted(&fmu)), (OK, (4.5, 4)));
        point(&fmu, 1.0, 5.0);
        assert_eq!((fmu.completed(), counted(&fmu), fmu.messages().len()), (OK, (2.5, 3), 0), "counted again");
        // As far as the last event, and no further.
        point(&fmu, 2.0, 5.0);
        assert_eq!((fmu.event(), fmu.set_time(1.9)), (OK, ERROR));
        assert!(fmu.error().contains("time = 1.9 is not allowed: finite and not before 2, the last event"));
    }
}

/// From one call to the next, with any number of rejected steps, only the solution counts.
#[test]
fn any_number_of_steps_is_given_up() {
    for kind in ME {
        // With more than are kept, counted anew from the event, which is exact on this line.
        for tries in 1..30_u32 {
            let (fmu, strict) = (Fmu::running(kind, 0.0), Fmu::running(kind, 0.0));
            for k in 0..5_u32 {
                let (t, end) = (f64::from(k), f64::from(k + 1));
                for i in 1..=tries {
                    let tried = t + 2.0 * f64::from(i) / f64::from(tries);
                    point(&fmu, tried, if tried < end { 3.0 * tried } else { 100.0 });
                    assert_eq!(fmu.completed(), OK);
                }
                for fmu in [&fmu, &strict] {
                    point(fmu, end, 3.0 * end);
                    assert_eq!(fmu.completed(), OK);
                }
            }
            assert!((fmu.get(AREA) - strict.get(AREA)).abs() < 1e-12, "{tries}");
        }
    }
}

#[test]
fn a_saved_state_goes_on_from_its_point() {
    for kind in ME {
        let fmu = Fmu::running(kind, 0.0);
        point(&fmu, 1.0, 4.0);
        assert_eq!(fmu.completed(), OK);
        point(&fmu, 1.5, 100.0);
        let (mut saved, bytes) = (null_mut(), fmu.bytes());
        assert_eq!(fmu.save(&mut saved), OK);
        point(&fmu, 3.0, 8.0);
        assert_eq!((fmu.completed(), counted(&fmu).0), (OK, 14.0));
        assert_eq!((fmu.restore(saved), counted(&fmu).0), (OK, 2.0));
        let (other, mut stored) = (Fmu::new(kind), null_mut());
        assert_eq!((other.deserialize(&bytes, &mut stored), other.restore(stored)), (OK, OK));
        for fmu in [&fmu, &other] {
            point(fmu, 3.0, 8.0);
            assert_eq!((fmu.completed(), counted(fmu).0), (OK, 14.0));
        }
        assert_eq!((fmu.free_state(&mut saved), other.free_state(&mut stored)), (OK, OK));
    }
}

#[test]
fn a_point_that_the_model_refuses_is_an_error() {
    for kind in ME {
        let fmu = Fmu::running(kind, 0.0);
        point(&fmu, 1.0, 2e3);
        assert_eq!(fmu.completed(), ERROR);
        let error = fmu.error();
        assert!(error.contains("x = 2000 is not allowed: at most 1000"), "{error}");
        let fmu = Fmu::running(kind, 0.0);
        point(&fmu, 1.0, 2e3);
        assert_eq!(fmu.event(), ERROR);
    }
}

#[test]
fn a_step_of_co_simulation_is_the_models_own() {
    for kind in CS {
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!((fmu.set(&[U], &[1.0]), fmu.step(0.0, 1.0).0, counted(&fmu)), (OK, OK, (0.0, 0)));
    }
}

#[test]
fn the_description_asks_for_completed_steps() {
    assert!(Description::exported::<fmi::This>().unwrap().model_exchange.unwrap().completed_steps);
}
