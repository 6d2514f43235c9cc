//! A motor whose engine runs on a thread, which cannot be saved, and a plain model without serde, which cannot be stored.
#![allow(missing_docs, non_snake_case, clippy::float_cmp, reason = "sums of few digits are exact")]

use fmu_core::unit::{NEWTON_METER, ONE, RAD_PER_S2, SPEED};
use fmu_core::{
    Block, ContinuousTime, Description, Elapsed, Exported, Fault, Info, Interface, Keeps, Model, Row, Slot, State,
    Step, Table, table,
};
use fmu_export::instance::{Instance, Refusal};
use fmu_export::lifecycle::{Next, Standard};
use fmu_export::log::{Log, Sink, Status};
use fmu_export::snapshot::Snapshot;
use std::cell::Cell;
use std::mem::MaybeUninit;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{JoinHandle, spawn};

thread_local! {
    /// Engines of this test that live.
    static ALIVE: Cell<usize> = const { Cell::new(0) };
}

/// An engine that nobody can copy: it integrates on a thread.
struct Engine {
    ask: Option<Sender<f64>>,
    answer: Receiver<f64>,
    thread: Option<JoinHandle<()>>,
}

impl Default for Engine {
    fn default() -> Self {
        let ((ask, asked), (said, answer)) = (channel(), channel());
        let run = move || {
            let mut speed = 0.0;
            for change in asked {
                speed += change;
                if said.send(speed).is_err() {
                    break;
                }
            }
        };
        ALIVE.set(ALIVE.get() + 1);
        Self { ask: Some(ask), answer, thread: Some(spawn(run)) }
    }
}

impl Engine {
    fn change(&self, by: f64) -> f64 {
        self.ask.as_ref().unwrap().send(by).unwrap();
        self.answer.recv().unwrap()
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.ask = None;
        self.thread.take().unwrap().join().unwrap();
        ALIVE.set(ALIVE.get() - 1);
    }
}

#[derive(Default)]
struct Motor {
    tau: f64,
    low: f64,
    high: f64,
    middle: f64,
    speed: f64,
    engine: Engine,
}

#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
struct Outputs {
    speed: f64,
}

type V = Row<Block<Motor>>;

impl Model for Motor {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Motor", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("tau", &NEWTON_METER, "Torque", |m| &mut m.model.tau),
        V::output("speed", &SPEED, "Speed", |m| &mut m.out.speed),
        V::parameter("low", &ONE, "Lower bound", |m| &mut m.model.low).tunable(),
        V::parameter("high", &ONE, "Upper bound", |m| &mut m.model.high).tunable(),
        V::calculated("middle", &ONE, "Their mean", |m| &mut m.model.middle),
    ];

    fn derive(&mut self) {
        self.middle = 0.5 * (self.low + self.high);
    }

    fn validate(&self) -> Result<(), Fault> {
        if self.low <= self.high { Ok(()) } else { Err(Fault::value("low", self.low, "at most high")) }
    }

    fn initialize(&mut self) {}

    fn output(&self, _: Elapsed, out: &mut Outputs) {
        out.speed = self.speed;
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        self.speed = self.engine.change(self.tau * step.h);
        Ok(())
    }
}

impl ContinuousTime for Motor {
    const STATES: &'static [State<Self>] = &[State::new("speed", &RAD_PER_S2, |m| &mut m.speed)];

    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = self.tau;
        Ok(())
    }
}

fmu_export::export!(Motor: Unsaved + ContinuousTime);

/// A model without serde.
mod plain {
    use super::*;

    #[derive(Clone, Default)]
    pub(super) struct Sum {
        x: f64,
        pub(super) sum: f64,
    }

    #[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
    pub(super) struct Total {
        total: f64,
    }

    type V = Row<Block<Sum>>;

    impl Model for Sum {
        type Outputs = Total;
        const INFO: Info = Info { name: "Sum", ..Info::DEFAULT };
        const TABLE: &'static Table<Block<Self>> =
            table![V::input("x", &ONE, "", |m| &mut m.model.x), V::output("total", &ONE, "", |m| &mut m.out.total),];

        fn initialize(&mut self) {
            self.sum = 0.0;
        }

        fn output(&self, _: Elapsed, out: &mut Total) {
            out.total = self.sum;
        }

        fn advance(&mut self, step: &Step) -> Result<(), Fault> {
            self.sum += self.x * step.h;
            Ok(())
        }
    }

    pub(super) struct This;

    impl Exported for This {
        type Model = Sum;
        const CAN: fmu_core::Capabilities<Sum> = fmu_core::Capabilities::unstored();
    }
}

struct Deaf;

impl Sink for Deaf {
    fn write(&self, _: Status, _: &str, _: &str) {}
    fn hears(&self) -> bool {
        false
    }
}

fn instance<E: Exported>(standard: Standard) -> Instance<E> {
    let fresh = Snapshot::new(Interface::CoSimulation);
    Instance::new(standard, "it".into(), Log::new(Box::new(Deaf), false), fresh)
}

fn start<E: Exported>(instance: &mut Instance<E>) {
    instance.set_up(0.0, None).unwrap();
    instance.exit_initialization().unwrap();
    instance.current.life.after(true, Next::Start);
}

fn get<E: Exported>(instance: &mut Instance<E>, reference: u32) -> f64 {
    instance.get::<f64>(&[reference], &mut [MaybeUninit::uninit()]).unwrap();
    match E::Model::TABLE.entry(&mut instance.current.block, reference as usize - 1) {
        Some((_, Slot::Real(x))) => *x,
        _ => panic!("{reference} is no real variable"),
    }
}

#[test]
fn a_model_on_a_thread_runs_and_is_made_again() {
    for standard in [Standard::Fmi2, Standard::Fmi3] {
        let mut motor = instance::<fmi::This>(standard);
        for _ in 0..3 {
            start(&mut motor);
            motor.set(&[1], &[2.0]).unwrap();
            motor.do_step(0.0, 0.5).unwrap();
            motor.do_step(0.5, 0.5).unwrap();
            assert_eq!(get(&mut motor, 2), 2.0);
            let before = ALIVE.get();
            motor.reset().unwrap();
            assert_eq!(ALIVE.get(), before, "the old engine ends");
            assert_eq!(get(&mut motor, 1), 0.0);
        }
    }
}

#[test]
fn nothing_can_be_kept_or_differentiated() {
    let mut motor = instance::<fmi::This>(Standard::Fmi3);
    start(&mut motor);
    let why = |fault: Fault, text: &str| assert!(fault.message().contains(text), "{fault}");
    why(motor.save(0).unwrap_err(), "the state of this model cannot be saved, and the description has no canGetAndSet");
    why(motor.restore(16).unwrap_err(), "cannot be saved");
    why(motor.deserialize(&[0; 99]).unwrap_err(), "cannot be stored as bytes, and the description has no canSerialize");
    let refused = motor.directional(&[2], &[1], &[1.0], &mut [0.0]).unwrap_err();
    let Refusal::Error(fault) = refused else { panic!("{refused:?}") };
    why(fault, "not supported: providesDirectionalDerivatives = false");
    motor.do_step(0.0, 0.5).unwrap();
}

/// They take effect at once, all of a call together; those that are refused leave the model as it was.
#[test]
fn tunable_parameters_are_judged_before_they_act() {
    let mut motor = instance::<fmi::This>(Standard::Fmi3);
    start(&mut motor);
    motor.set(&[3, 4], &[5.0, 7.0]).unwrap();
    assert_eq!(get(&mut motor, 5), 6.0);
    let Err(Refusal::Error(fault)) = motor.set(&[4, 3], &[9.0, 10.0]) else { panic!("taken") };
    assert_eq!(fault.message(), "low = 10 is not allowed: at most high");
    assert_eq!([3, 4, 5].map(|reference| get(&mut motor, reference)), [5.0, 7.0, 6.0]);
    motor.do_step(0.0, 0.5).unwrap();
    // Before the start, the end of initialization judges them.
    motor.reset().unwrap();
    motor.set(&[3], &[10.0]).unwrap();
    motor.set_up(0.0, None).unwrap();
    assert_eq!(motor.exit_initialization().unwrap_err().message(), "low = 10 is not allowed: at most high");
}

#[test]
fn the_description_says_so() {
    let description = Description::exported::<fmi::This>().unwrap();
    assert_eq!(description.keeps, Keeps::Nothing);
    let of = |name: &str| description.variables.iter().find(|v| v.name == name).unwrap();
    // Without a copy that could be varied, everything counts: inputs, parameters, states and time.
    assert_eq!(of("der(speed)").dependencies.as_deref(), Some(&[1, 2, 3, 4, 0][..]));
    assert_eq!(of("middle").initial_dependencies.as_deref(), Some(&[1, 3, 4][..]));
    assert_eq!(Description::exported::<plain::This>().unwrap().keeps, Keeps::Saved);
    // Tokens differ from those of the same model with saved states.
    let stored = fmu_core::Capabilities::<plain::Sum>::unstored();
    assert_ne!(stored.hash().guid().as_str(), <plain::Sum as Model>::HASH.guid().as_str());
}

#[test]
fn without_serde_a_state_is_saved_and_not_stored() {
    let mut sum = instance::<plain::This>(Standard::Fmi2);
    start(&mut sum);
    sum.set(&[1], &[3.0]).unwrap();
    sum.do_step(0.0, 1.0).unwrap();
    let saved = sum.save(0).unwrap();
    sum.do_step(1.0, 1.0).unwrap();
    assert_eq!(get(&mut sum, 2), 6.0);
    sum.restore(saved).unwrap();
    assert_eq!(get(&mut sum, 2), 3.0);
    sum.do_step(1.0, 1.0).unwrap();
    assert_eq!(get(&mut sum, 2), 6.0);
    let fault = sum.deserialize(&[0; 99]).unwrap_err();
    assert!(fault.message().contains("cannot be stored as bytes"), "{fault}");
    fmu_export::registry::free::<plain::Sum>(saved).unwrap();
}
