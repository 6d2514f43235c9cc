//! Start-up and load step of the pair in every exchange order that importers have, run natively: the expected results of the
//! packed FMUs in each importer.

pub use super::estimators::at;

use super::estimators::Schedule;
use drive::Pair;
use drive::pmsm_drive::PmsmDrive;
use drive_study::reproduce::experiment::RPM;
use fmu_core::{Block, Elapsed, Fault, Step};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// Communication step of the pair in s: the controller's sample period.
const T_S: f64 = 1e-4;
/// Communication steps from one recorded point to the next.
const EVERY: usize = 100;
/// Communication step of the whole drive in s.
pub const DRIVE_STEP: f64 = 1e-3;

/// An experiment: a start from the worst angle, or a load at standstill.
pub struct Experiment {
    /// Name.
    pub name: &'static str,
    /// Electrical angle of the rotor at the start in rad.
    pub theta_e: f64,
    /// Speed reference in rad/s over time in s.
    pub speed_ref: Schedule,
    /// Load torque in N.m over time in s.
    pub load: Schedule,
    /// End in s.
    pub duration: f64,
}

/// Rasmussen 2006: start from 180 degrees (Fig. 4) and load step at standstill (Fig. 5).
pub fn experiments() -> [Experiment; 2] {
    let start = vec![(0.2, 500.0 * RPM)];
    [
        Experiment { name: "start-up", theta_e: PI, speed_ref: start, load: vec![], duration: 1.2 },
        Experiment { name: "load step", theta_e: 0.0, speed_ref: vec![], load: vec![(0.5, 2.0)], duration: 2.0 },
    ]
}

/// How an importer exchanges the values of a pair in one communication step.
#[derive(Clone, Copy, PartialEq)]
enum Order {
    /// All outputs read, all inputs set, both stepped.
    Jacobi,
    /// The plant is stepped first, and the controller gets the currents at the end of the same step: the command of the sample
    /// already acts in the next one, `timing.delay` = 0.
    PlantFirst,
    /// The controller is stepped first, and the plant gets its command in the same step: `timing.delay` = 0.
    ControllerFirst,
}

fn step(pair: &mut Pair, order: Order) -> Result<(), Fault> {
    if order == Order::Jacobi {
        return pair.step(T_S);
    }
    let step = Step { start: pair.now, h: T_S };
    if order == Order::ControllerFirst {
        pair.controller.model.inputs.i = pair.plant.out.i;
        pair.controller.step(&step)?;
    }
    pair.plant.model.inputs.u = pair.controller.out.u;
    pair.plant.step(&step)?;
    if order == Order::PlantFirst {
        pair.controller.model.inputs.i = pair.plant.out.i;
        pair.controller.step(&step)?;
    }
    pair.now = step.end();
    Ok(())
}

fn trace(experiment: &Experiment, order: Order) -> Value {
    let mut pair = Pair::default();
    pair.plant.model.parameters.initial.theta_e = experiment.theta_e;
    pair.controller.model.parameters.delay = i32::from(order == Order::Jacobi);
    pair.start().expect("start values that fit together");
    let u_dc = pair.plant.model.inputs.u_dc;
    let mut rows: [Vec<f64>; 4] = Default::default();
    for (k, t) in times(T_S, experiment.duration).enumerate() {
        if k % EVERY == 0 {
            let (plant, controller) = (&pair.plant.out, &pair.controller.out);
            let row = [plant.speed, plant.i_q, controller.theta_est, controller.i_ref.q];
            rows.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        }
        pair.set_inputs(at(&experiment.speed_ref, t), at(&experiment.load, t), u_dc);
        step(&mut pair, order).expect("a step");
    }
    let [speed, i_q, theta_est, i_q_ref] = rows;
    json!({"delay": pair.controller.model.parameters.delay, "speed": speed, "i_q": i_q, "theta_est": theta_est, "i_q_ref": i_q_ref})
}

/// All experiments as JSON, each in every order, and with the whole drive.
pub fn references() -> Value {
    let one = |e: &Experiment| {
        json!({
            "name": e.name, "theta_e": e.theta_e, "speed_ref": e.speed_ref, "load": e.load, "every": EVERY,
            "steps": times(T_S, e.duration).count(),
            "jacobi": trace(e, Order::Jacobi), "plant first": trace(e, Order::PlantFirst),
            "controller first": trace(e, Order::ControllerFirst), "drive": drive_speed(e, 0.0),
        })
    };
    experiments().iter().map(one).collect()
}

/// Communication points in s from 0 to the last step before `duration`.
pub fn times(h: f64, duration: f64) -> impl Iterator<Item = f64> {
    (0_u32..).map(move |k| f64::from(k) * h).take_while(move |t| *t < duration - 0.5 * h)
}

/// Speed in rad/s of the whole drive at each communication point of 1 ms, the end included; inputs come `late` (s).
pub fn drive_speed(experiment: &Experiment, late: f64) -> Vec<f64> {
    let mut block = Block::<PmsmDrive>::default();
    block.model.pair.plant.model.parameters.initial.theta_e = experiment.theta_e;
    block.initialize();
    let (mut now, mut speed) = (Elapsed::ZERO, vec![block.out.plant.speed]);
    for t in times(DRIVE_STEP, experiment.duration) {
        block.model.inputs.speed_ref = at(&experiment.speed_ref, t - late);
        block.model.inputs.tau_load = at(&experiment.load, t - late);
        let step = Step { start: now, h: DRIVE_STEP };
        block.step(&step).expect("a step");
        now = step.end();
        speed.push(block.out.plant.speed);
    }
    speed
}
