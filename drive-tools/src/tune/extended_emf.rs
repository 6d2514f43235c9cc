//! The rules for the extended EMF with an I-f start.
//!
//! The start: the rotor swings on the current vector with w_0 = sqrt(n_p K I / J), damped by 0.5, and the reluctance reduces
//! stiffness and damping by the share (L_q - L_d) I / psi_M. The alignments take 3 of its time constants each, the speed before
//! the hand-over 4.
//!
//! A change of i_q acts on the estimated speed through (L_q - L_d) p i_q against the EMF; closed by the speed loop, the gain is
//! J w_s (L_q - L_d) rho^2 / (K n_p w psi_M). It is to be less than 40 at 0.1 pu.
//!
//! A load step at low speed drives the rotor through zero: `emf.hold_reversal` holds it there, below 0.08 of the rated speed.

use super::bandwidth::{Bandwidths, EMF_PER_TRACKER, GREATEST_TORQUE};
use super::motor::{Data, swing, torque_constant};
use super::setting::{LEVELS, Setting, Value, real, set};
use std::f64::consts::TAU;

/// Values of the controller.
pub fn settings(data: &Data, bandwidths: &Bandwidths, notes: &mut Vec<String>) -> Vec<Setting> {
    let Data { rating, mechanics, .. } = data;
    let (limit, torque, rho) = (*rating.current.get_ref(), *rating.torque.get_ref(), bandwidths.observer.value);
    if rho < TAU * 15.0 * (1.0 - 1e-9) {
        notes.push(format!(
            "bandwidth.observer is {rho} rad/s; below 94 rad/s a load step of half the torque loses the rotor"
        ));
    }
    // Copper of -30 degC has 0.80 R_s, R^ is 0.9 R_s: the bound of the estimator, with the EMF of the magnet.
    let i = torque / torque_constant(data);
    let least = 0.1 * data.machine.R_s.get_ref() * i
        / (f64::from(*data.machine.n_p.get_ref()) * data.machine.psi_M.get_ref() * rating.speed.get_ref());
    if least > LEVELS[0] {
        notes.push(format!(
            "a winding of -30 degC has less than R^ = 0.9 R_s: below (R^ - R) i / (n_p psi_M) = {least:.2} pu, the rated torque turns the \
             estimate by half a turn"
        ));
    }
    // A d-axis current holds the rotor only while magnet torque exceeds reluctance torque: |L_q - L_d| i
    // < psi_M.
    let k = torque_constant(data);
    let saliency = (data.machine.L_q.get_ref() - data.machine.L_d.get_ref()).abs();
    let (wanted, stable) = ((1.4 * torque / k).min(limit), 0.5 * data.machine.psi_M.get_ref() / saliency);
    let lead = wanted.min(stable);
    if stable < wanted {
        notes.push(format!(
            "the saliency leaves {stable:.2} A for the I-f start: it carries up to {:.2} N.m",
            k * stable
        ));
    }
    // Of the swing on the current vector, in 1/s.
    let n_p = f64::from(*data.machine.n_p.get_ref());
    let decay = 0.5 * swing(data, lead) * (1.0 - saliency * lead / data.machine.psi_M.get_ref());
    vec![
        set("current.active_resistance", Value::Boolean(true), "K_i = w_c^2 L"),
        set("current.mtpa", Value::Boolean(true), "salient: minimum current for a torque"),
        real("speed_loop.b", 1.0, "proportional part on the whole error"),
        real("limit.i_q", limit, "the maximum current"),
        real("limit.tau", GREATEST_TORQUE * torque, "1.6 times the rated torque"),
        real("tracker.bandwidth", rho, "bandwidth.observer"),
        set("adaptation.resistance", Value::Boolean(false), "the estimator does not adapt it"),
        real("emf.bandwidth", EMF_PER_TRACKER * rho, "7.5 times the tracker's; at least 3 times is needed"),
        real("emf.w_sign", 0.01 * n_p * rating.speed.get_ref(), "0.01 of the rated electrical speed"),
        set("emf.hold_reversal", Value::Boolean(true), "a load step at low speed passes zero"),
        real("emf.w_hold", 0.08 * n_p * rating.speed.get_ref(), "0.08 of the rated electrical speed"),
        real("zero_speed.i_0", 0.0, "not used"),
        set("start.mode", Value::Item("CurrentFrequency".into()), "no EMF at standstill"),
        real(
            "start.i",
            lead,
            "1.4 times the rated torque / K, at most the maximum current and psi_M / (2 |L_q - L_d|)",
        ),
        real("start.speed", 0.15 * rating.speed.get_ref(), "0.15 of the rated speed"),
        real(
            "start.acceleration",
            (0.3 * k * lead / mechanics.J.get_ref()).min(100.0),
            "0.3 of the start's torque, at most 100 rad/s2",
        ),
        real(
            "start.t_align",
            (3.0 / decay).max(0.25),
            "the rotor settles on the current vector: 3 time constants, at least 0.25 s",
        ),
        real(
            "start.settle",
            (4.0 / decay).max(0.2),
            "its swing has died at the hand-over: 4 time constants, at least 0.2 s",
        ),
    ]
}
