//! A controller that is synchronous with the PWM, on a countdown clock: at each tick the model gives the time to the next point of
//! its grid, and its commands have the bits of the plain controller, in Co-Simulation with Event Mode, Model Exchange and Scheduled
//! Execution.
#![allow(missing_docs, non_snake_case, clippy::borrow_as_ptr)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions")]

#[path = "common/controller.rs"]
mod controller;

use controller::{Controller, Kind, OK, reference};
use drive::{Pair, SensorlessController};
use fmu_core::{Block, Clock, Clocked, Elapsed, Fault, Info, Model, Part, Row, Sampled, Step, Table, table};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use std::ptr::null_mut;

/// The controller takes a sample at each tick; the period of the PWM is its `T_s`.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Countdown {
    controller: Block<SensorlessController>,
}

type V = Row<Block<Countdown>>;

const SIGNALS: &Table<Block<SensorlessController>> = SensorlessController::TABLE;

impl Model for Countdown {
    type Outputs = ();
    const INFO: Info = Info { name: "Countdown", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::clock("pwm", "A period of the PWM begins", Clock::countdown()).priority(0),
        V::part("", &Part { table: SIGNALS, lens: |m| &mut m.model.controller }).on("pwm"),
    ];

    fn derive(&mut self) {
        self.controller.model.derive();
    }

    fn validate(&self) -> Result<(), Fault> {
        self.controller.model.validate()
    }

    fn initialize(&mut self) {
        self.controller.initialize();
    }

    fn output(&self, _: Elapsed, (): &mut ()) {}

    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl Clocked for Countdown {
    fn activate(&mut self, _: usize, now: Elapsed) {
        let Block { model, out } = &mut self.controller;
        model.show();
        model.output(now, out);
    }

    fn tick(&mut self, _: usize, _: Elapsed) -> Result<(), Fault> {
        self.controller.model.sample()
    }

    /// (k + 1) T_s - (t - t_0) after the sample k.
    fn interval(&self, _: usize, now: Elapsed) -> Option<f64> {
        let controller = &self.controller.model;
        Some(-now.minus_periods(controller.samples(), controller.period()))
    }
}

fmu_export::export!(Countdown: Clocked + ScheduledExecution);

use fmi::*;

const PWM: u32 = 1;
const SAMPLES: u32 = 20_000;
const MEASURED: [&str; 7] = ["i_a", "i_b", "i_c", "theta_meas", "speed_meas", "speed_ref", "u_dc"];
const COMMANDS: [&str; 4] = ["u_a", "u_b", "u_c", "speed_est"];

fn bits([a, b, c, d]: [f64; 4], enabled: bool) -> [u64; 5] {
    [a.to_bits(), b.to_bits(), c.to_bits(), d.to_bits(), enabled.into()]
}

/// Measurements of the plain controller in a closed loop at each sample, and its commands one sample later, as bits.
fn plain(T_s: f64) -> Vec<([f64; 7], [u64; 5])> {
    let mut pair = Pair::default();
    pair.controller.model.parameters.T_s = T_s;
    pair.start().unwrap();
    (0..SAMPLES)
        .map(|k| {
            let speed = if k < SAMPLES / 2 { 100.0 } else { -50.0 };
            pair.set_inputs(speed, 0.5, 325.0);
            let m = pair.plant.out.measured();
            pair.step(T_s).unwrap();
            let out = &pair.controller.out;
            let commands = bits([out.u.a, out.u.b, out.u.c, out.speed_est], out.enabled);
            ([m.i.a, m.i.b, m.i.c, m.theta_e, m.speed, speed, 325.0], commands)
        })
        .collect()
}

/// The instance, and the interval (s) from its last `clockUpdate`.
struct Announced {
    it: Cell<InstancePointer>,
    interval: Cell<Option<f64>>,
}

extern "C" fn clock_update(environment: *mut c_void) {
    let announced = unsafe { &*environment.cast::<Announced>() };
    announced.interval.set(Some(interval(announced.it.get())));
}

/// The interval (s) of the clock, which has changed.
fn interval(it: InstancePointer) -> f64 {
    const CHANGED: c_int = 2;
    let (mut interval, mut qualifier) = (f64::NAN, -1);
    assert_eq!(unsafe { fmi3GetIntervalDecimal(it, &PWM, 1, &mut interval, &mut qualifier) }, OK);
    assert_eq!(qualifier, CHANGED);
    interval
}

/// Feeds an instance with these measurements, each at the requested tick; returns its commands one tick later, and the times
/// (s) of the ticks.
fn counted(kind: Kind, T_s: f64, start: f64, measured: &[[f64; 7]]) -> (Vec<[u64; 5]>, Vec<f64>) {
    let announced = Box::new(Announced { it: Cell::new(null_mut()), interval: Cell::new(None) });
    let environment = std::ptr::from_ref(&*announced).cast_mut().cast();
    let controller = Controller::new(kind, start, Some(clock_update), environment);
    let it = controller.it;
    announced.it.set(it);
    controller.set(&[reference("T_s")], &[T_s]);
    let mut t = start + interval(it);
    assert_eq!(controller.exit(), OK);
    let (inputs, outputs, gates) = (MEASURED.map(reference), COMMANDS.map(reference), [reference("enabled")]);
    let (mut commands, mut times) = (Vec::new(), Vec::new());
    for (k, measured) in measured.iter().chain(measured.last()).enumerate() {
        times.push(t);
        if kind == Kind::Se {
            controller.set(&inputs, measured);
            assert_eq!(unsafe { fmi3ActivateModelPartition(it, PWM, t) }, OK);
        } else {
            assert_eq!(unsafe { fmi3SetClock(it, &PWM, 1, &Fmi3Boolean(1)) }, OK);
        }
        // Outputs at a tick belong to the tick before.
        let ([a, b, c, d], [enabled]) = (outputs.map(|vr| controller.get(&[vr])[0]), controller.get_booleans(gates));
        if k > 0 {
            commands.push(bits([a, b, c, d], enabled));
        }
        t = if kind == Kind::Se {
            t + announced.interval.take().expect("a clockUpdate in each activation")
        } else {
            controller.set(&inputs, measured);
            controller.update();
            let next = t + interval(it);
            controller.proceed(t, next - t, next);
            next
        };
    }
    (commands, times)
}

#[test]
fn a_countdown_on_the_grid_gives_the_same_controller_bits() {
    for T_s in [1e-4, 8e-5] {
        let (measured, expected): (Vec<_>, Vec<_>) = plain(T_s).into_iter().unzip();
        let speed = |k: usize| f64::from_bits(expected[k][3]);
        assert!(speed(9_000) > 90.0 && speed(19_000) < -40.0, "it runs");
        for (kind, start) in [(Kind::Cs, 0.0), (Kind::Me, 0.0), (Kind::Se, 0.0), (Kind::Cs, 0.7), (Kind::Se, 0.7)] {
            let (ours, times) = counted(kind, T_s, start, &measured);
            if let Some(k) = ours.iter().zip(&expected).position(|(a, b)| a != b) {
                panic!("{kind:?}, T_s = {T_s}: sample {k}: {:?} and {:?}", ours[k], expected[k]);
            }
            assert_eq!((ours.len(), times.len()), (expected.len(), expected.len() + 1));
            // Rounding does not accumulate: each tick is at its grid point, except for the rounding of one sum.
            let off = times.iter().zip(0..).map(|(t, k)| (t - (start + f64::from(k) * T_s)).abs()).fold(0.0, f64::max);
            println!("{kind:?}, T_s = {T_s} s, from {start} s: {} ticks, off the grid by {off:e} s", times.len());
            assert!(off <= 2.0 * f64::EPSILON * times[times.len() - 1], "{off}");
        }
    }
}
