//! The rules for the methods that find the rotor by its back EMF.
//!
//! All have the same target rho = `bandwidth.observer`, and ratios to it that give the gains of the Kim & Sul review on its 2.2 kW
//! machine (rho = 2 pi 20 rad/s, 0.257 kV of EMF at the rated speed, T_s = 100 us):
//!
//! | method | values |
//! |---|---|
//! | DirectEmf, EmfObserver, ExtendedEmf | tracker rho, EMF 7.5 rho |
//! | SlidingMode | the same, gain twice the maximum EMF, w_z = 1 / (2 T_s) |
//! | VoltageFeedback | tracker 0.75 rho, EMF 20 times that; decoupling by the references, K_i = 0.2 w_c^2 L |
//! | VoltageModel, CurrentModel | angle 0.75 rho, speed filter 2.5 rho |
//! | KalmanFilter | densities of the voltage: (EMF / 257)^2 1 ms 2 pi 20 / rho, 1000 times that on q; of the acceleration: w_0 = rho at 0.05 pu |
//! | GradientObserver | tracker rho, rate to the circle 0.04 of the rated electrical speed |
//!
//! A load step at low speed reverses the rotor: `emf.hold_reversal` keeps the direction below 0.08 of the rated speed.

use super::bandwidth::{Bandwidths, EMF_PER_TRACKER};
use super::motor::{Data, MotorFile, electrical, torque_constant};
use super::setting::{LEVELS, Setting, Value, real, set};
use crate::error::{Result, bail};
use drive::control::reference::max_torque_per_ampere;
use drive::estimator::Kind;
use drive::estimator::kalman::KalmanParameters;
use std::f64::consts::TAU;

/// Tracker and angle gain of the methods without an observer, as a share of the target.
const SLOWER: f64 = 0.75;
/// Speed filter of voltage and current model in units of the target.
const FILTER: f64 = 2.5;
/// Maximum action of the saliency on the angle of voltage and current model, in units of the angle gain: 0.8 of `compressor-1kw`
/// and `ipmsm-2.2kw` holds, 4.5 of `traction-80kw` does not.
const MOST_TURN: f64 = 3.0;
/// Smoothing of VoltageFeedback in units of its tracker.
const SMOOTHING: f64 = 20.0;
/// Rated EMF in V of the review's machine, and its target in rad/s.
const REVIEW: (f64, f64) = (257.0, TAU * 20.0);
/// Error of the predicted current as a share of the maximum current: that of the inductances counts, not only the 10 mA of 15 A of the
/// review's sensors. With the latter, saturation turns the filter away at the hand-over from 8 A on the d-axis.
const CURRENT: f64 = 0.02;

/// Rated electrical speed in rad/s.
fn rated(data: &Data) -> f64 {
    f64::from(*data.machine.n_p.get_ref()) * data.rating.speed.get_ref()
}

/// Notes on the target, and on the resistance of a cold winding.
pub fn narrow(data: &Data, bandwidths: &Bandwidths, notes: &mut Vec<String>) {
    let rho = bandwidths.observer.value;
    if rho < TAU * 15.0 * (1.0 - 1e-9) {
        notes.push(format!(
            "bandwidth.observer is {rho} rad/s; below 94 rad/s a load step of half the torque loses the rotor"
        ));
    }
    // Copper of -30 degC has 0.80 R_s, R^ is 0.9 R_s: the bound of the estimator, with the EMF of the magnet.
    let i = data.rating.torque.get_ref() / torque_constant(data);
    let least = 0.1 * data.machine.R_s.get_ref() * i / (rated(data) * data.machine.psi_M.get_ref());
    if least > LEVELS[0] {
        notes.push(format!(
            "a winding at -30 degC has less resistance than R^ = 0.9 R_s: below (R^ - R) i / (n_p psi_M) = {least:.2} pu, the rated torque turns the \
             estimate by half a turn"
        ));
    }
}

/// Direct EMF, EMF observer and extended EMF.
pub fn observer(data: &Data, bandwidths: &Bandwidths) -> Vec<Setting> {
    let rho = bandwidths.observer.value;
    let mut all = vec![
        real("tracker.bandwidth", rho, "bandwidth.observer"),
        real("emf.bandwidth", EMF_PER_TRACKER * rho, "7.5 times the tracker's; at least 3 times is needed"),
    ];
    all.extend(reversal(data));
    all
}

/// The direction of rotation, kept through zero.
fn reversal(data: &Data) -> [Setting; 3] {
    [
        sign(data),
        set("emf.hold_reversal", Value::Boolean(true), "a load step at low speed passes zero"),
        real("emf.w_hold", 0.08 * rated(data), "0.08 of the rated electrical speed"),
    ]
}

fn sign(data: &Data) -> Setting {
    real("emf.w_sign", 0.01 * rated(data), "0.01 of the rated electrical speed")
}

/// Sliding mode.
pub fn sliding_mode(data: &Data, bandwidths: &Bandwidths) -> Vec<Setting> {
    let (machine, rating) = (&data.machine, &data.rating);
    let saliency = (machine.L_q.get_ref() - machine.L_d.get_ref()).abs();
    let top = f64::from(*machine.n_p.get_ref()) * rating.top();
    let emf = top * (machine.psi_M.get_ref() + saliency * rating.current.get_ref());
    let mut all = observer(data, bandwidths);
    all.extend([
        real(
            "sliding_mode.gain",
            2.0 * emf,
            "2 n_p w (psi_M + |L_q - L_d| i) at the highest speed and the maximum current",
        ),
        real("sliding_mode.bandwidth", 0.5 / bandwidths.T_s.value, "1 / (2 T_s): half of the limit of chattering"),
    ]);
    all
}

/// Voltage feedback, with the current loop that it needs.
pub fn voltage_feedback(data: &Data, bandwidths: &Bandwidths) -> Vec<Setting> {
    let rho = SLOWER * bandwidths.observer.value;
    let mut all = vec![
        real("tracker.bandwidth", rho, "0.75 of bandwidth.observer: it reads the lag of the current loop"),
        real("emf.bandwidth", SMOOTHING * rho, "20 times the tracker's"),
        set(
            "current.reference_feed_forward",
            Value::Boolean(true),
            "the angle error acts only on the integrators (31)",
        ),
        real("current.integral", 0.2, "K_i = 0.2 w_c^2 L"),
    ];
    all.extend(reversal(data));
    all
}

/// Voltage model and current model. Their q row turns an angle error theta~ into a speed error of n_p w (L_q - L_d) i_q theta~ / psi_M,
/// in one direction of the torque away from the rotor; the d row corrects it with the gain `matsui.bandwidth`.
///
/// # Errors
/// The saliency acts more than 3 times as much as the correction, at the rated speed and torque.
pub fn model(motor: &MotorFile, estimator: Kind, bandwidths: &Bandwidths) -> Result<Vec<Setting>> {
    let data = &motor.data;
    let (rho, machine) = (bandwidths.observer.value, electrical(data));
    let i_q = max_torque_per_ampere(&machine, *data.rating.torque.get_ref()).q();
    let turns = rated(data) * (machine.L_q - machine.L_d).abs() * i_q / machine.psi_M;
    let gain = SLOWER * rho;
    if turns > MOST_TURN * gain {
        bail!(
            "{}: {} takes the speed from the magnet's EMF alone: at the rated speed and torque, the saliency turns an angle error into a \
             speed error of n_p w |L_q - L_d| i_q / psi_M = {turns:.0} rad/s per rad, {:.1} times the gain {gain:.0} rad/s that \
             corrects it, and {MOST_TURN} times are held: choose ExtendedEmf, or a lower rating.speed",
            motor.place(&data.machine.L_q),
            estimator.name(),
            turns / gain
        );
    }
    Ok(vec![
        real("matsui.bandwidth", gain, "0.75 of bandwidth.observer"),
        real("matsui.filter", FILTER * rho, "2.5 times bandwidth.observer"),
        sign(data),
    ])
}

/// The Kalman filter.
pub fn kalman(data: &Data, bandwidths: &Bandwidths) -> Vec<Setting> {
    let (psi_M, rho) = (*data.machine.psi_M.get_ref(), bandwidths.observer.value);
    let share = rated(data) * psi_M / REVIEW.0;
    let scale = share * share * REVIEW.1 / rho;
    let sigma = CURRENT * data.rating.current.get_ref();
    // The densities of the review's voltage; all but that of the current are in proportion.
    let own = KalmanParameters::new(psi_M, rho, 0.05 * rated(data), sigma, bandwidths.T_s.value);
    vec![
        real(
            "kalman.voltage_d",
            scale * own.voltage_d,
            "(EMF at rated speed / 257)^2 1 ms 2 pi 20 / bandwidth.observer",
        ),
        real("kalman.voltage_q", scale * own.voltage_q, "1000 times that"),
        real("kalman.acceleration", scale * own.acceleration, "w_0 = bandwidth.observer at 0.05 of the rated speed"),
        real("kalman.current", own.current, "(0.02 rating.current)^2 T_s: noise, and the error of the inductances"),
    ]
}

/// The gradient observer.
pub fn gradient(data: &Data, bandwidths: &Bandwidths) -> Vec<Setting> {
    vec![
        real("tracker.bandwidth", bandwidths.observer.value, "bandwidth.observer"),
        real(
            "gradient.bandwidth",
            0.04 * rated(data),
            "0.04 of the rated electrical speed: slow poles below 0.02 of it",
        ),
    ]
}
