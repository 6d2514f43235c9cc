//! A drive on a test bench, as a record for `fmu identify`: the pair of plant and controller runs without an angle sensor; the
//! bench also logs an encoder of 4096 steps, a torque sensor, and the currents measured by the controller.

use drive::Pair;
use drive::estimator::Kind;
use drive::frame::Phases;
use drive_study::runner;
use std::f64::consts::TAU;
use std::fmt::Write;

/// Length of the record in s.
pub(crate) const TIME: f64 = 3.2;

/// Samples per logged row of the bench.
pub(crate) const EVERY: u64 = 5;

/// Time in s without voltage, for the offset of the sensors.
const REST: f64 = 0.05;

/// Parts of the run: speed in pu of the rated speed, d-axis current in A, load in pu of the rated torque against the speed.
const PARTS: [(f64, f64, f64); 16] = [
    (0.1, 10.0, 0.0),
    (0.1, 6.0, 0.0),
    (0.1, 3.0, 0.0),
    (0.1, 0.0, 1.0),
    (0.3, 0.0, 0.6),
    (0.6, 0.0, 0.0),
    (0.6, 5.0, 0.0),
    (0.3, 8.0, 0.0),
    (-0.1, 8.0, 0.0),
    (-0.1, 0.0, 1.2),
    (-0.3, 0.0, 0.4),
    (-0.6, 0.0, 0.0),
    (-0.6, 5.0, 0.5),
    (-0.3, 8.0, 0.0),
    (0.2, 10.0, 0.8),
    (0.45, 0.0, 0.0),
];

/// Angle in rad from the encoder's zero to the magnet's axis, mechanical.
const MOUNTING: f64 = 0.05;

/// Steps of the encoder.
const STEPS: f64 = 4096.0;

/// The 2.2 kW machine with a saturated d-axis, dead time of 2 us, friction, and current sensors with noise, offset and 12 bits over
/// +-22.5 A.
pub(crate) fn drive() -> Pair {
    let mut pair = runner::with_dead_time(runner::drive(Kind::FluxObserver), true);
    let plant = &mut pair.plant.model.parameters;
    (plant.saturation.s_2, plant.saturation.s_3) = (2.0, 4.0);
    (plant.mechanics.B, plant.mechanics.tau_coulomb) = (5e-3, 0.3);
    let par = &mut pair.controller.model.parameters;
    (par.sensor.noise, par.sensor.resolution) = (0.02, 45.0 / 4096.0);
    par.sensor.offset = Phases { a: 0.12, b: -0.08, c: 0.05 };
    par.compensation.calibrate = true;
    // A soft current loop passes little of the sensors' noise on to the voltages.
    (par.current.bandwidth, par.current.active_resistance) = (TAU * 60.0, false);
    // The law of low speed at every speed: the bench sets i_d.
    par.zero_speed.w_0 = 1e6;
    pair
}

/// Runs a drive for `time` (s); one row of `every` samples, the voltage of a row acts from its time on.
pub(crate) fn record(mut pair: Pair, time: f64, every: u64) -> String {
    let T_s = pair.controller.model.parameters.T_s;
    let sensor = pair.controller.model.parameters.sensor.clone();
    let u_dc = pair.plant.model.inputs.u_dc;
    let samples = (time / T_s).round() as u64;
    let mut text = String::from("t [s],u_ab [V],u_bc [V],i_a [A],i_b [A],angle [deg],tau_load [N.m]\n");
    pair.controller.model.inputs.enable = false;
    pair.start().expect("parameters that fit together");
    for k in 0..samples {
        let t = k as f64 * T_s;
        let part = ((t - REST) / (time - REST) * PARTS.len() as f64).clamp(0.0, PARTS.len() as f64 - 1.0) as usize;
        let (speed, i_d, load) = PARTS[part];
        let out = &pair.plant.out;
        let tau_load = load * runner::RATED_TORQUE * (out.speed / 2.0).tanh();
        if k % every == 0 {
            let (u, i) = (pair.controller.out.commanded().u, sensor.measure(out.i, k));
            let step = ((out.angle - MOUNTING) / TAU * STEPS).floor().rem_euclid(STEPS);
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{}",
                short(t, 4),
                short(u.a - u.b, 1),
                short(u.b - u.c, 1),
                short(i.a, 3),
                short(i.b, 3),
                short(step * 360.0 / STEPS, 2),
                short(tau_load, 1),
            );
        }
        let controller = &mut pair.controller.model;
        controller.inputs.enable = t >= REST;
        controller.parameters.zero_speed.i_0 = i_d;
        pair.set_inputs(speed * runner::RATED_SPEED, tau_load, u_dc);
        pair.step(T_s).expect("a step that succeeds");
    }
    text
}

/// A number with at most this many decimals.
fn short(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}
