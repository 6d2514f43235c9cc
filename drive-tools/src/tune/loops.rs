//! The loops and limits of the methods with a tracker or a sensor, and the I-f start of those that need an EMF.
//!
//! The start: the rotor swings on the current vector with w_0 = sqrt(n_p K I / J), damped by 0.5, and the reluctance reduces
//! stiffness and damping by the share (L_q - L_d) I / psi_M. The alignments take 3 of its time constants each, the speed before
//! the hand-over 4.

use super::bandwidth::GREATEST_TORQUE;
use super::motor::{Data, electrical, swing, torque_constant};
use super::setting::{Setting, Value, real, set};
use drive::control::limits::Limits;
use drive::control::reference::max_torque;

/// Duration of a start (s) above which a note gives it.
const LONG: f64 = 2.0;

/// The loops; `active`: with active resistance.
pub fn settings(data: &Data, active: bool) -> Vec<Setting> {
    let mut all = vec![
        set("current.mtpa", Value::Boolean(true), "salient: minimum current for a torque"),
        real("speed_loop.b", 1.0, "proportional part on the whole error"),
        real("limit.i_q", *data.rating.current.get_ref(), "the maximum current"),
    ];
    if active {
        all.push(set("current.active_resistance", Value::Boolean(true), "K_i = w_c^2 L"));
    }
    all
}

/// The torque limit of a method that estimates.
pub fn limit(data: &Data) -> Setting {
    real("limit.tau", GREATEST_TORQUE * data.rating.torque.get_ref(), "1.6 times the rated torque")
}

/// The values of a drive with a sensor: only the current limits the torque.
pub fn sensored(data: &Data) -> Vec<Setting> {
    let i = *data.rating.current.get_ref();
    let most = max_torque(&electrical(data), &Limits { i_q: i, i, tau: f64::INFINITY }, true);
    let mut all = settings(data, true);
    all.push(real("limit.tau", most, "the torque of the maximum current, by maximum torque per ampere"));
    all
}

/// The I-f start up to `speed` (rad/s).
pub fn start(data: &Data, (speed, rule): (f64, &str), notes: &mut Vec<String>) -> Vec<Setting> {
    let (limit, torque) = (*data.rating.current.get_ref(), *data.rating.torque.get_ref());
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
    if stable >= wanted && wanted < 1.2 * torque / k {
        notes.push(format!(
            "the maximum current gives {:.2} N.m in the I-f start, {:.2} of the rated torque",
            k * wanted,
            k * wanted / torque
        ));
    }
    // Of the swing on the current vector, in 1/s.
    let decay = 0.5 * swing(data, lead) * (1.0 - saliency * lead / data.machine.psi_M.get_ref());
    let (align, settle) = ((3.0 / decay).max(0.25), (4.0 / decay).max(0.2));
    let acceleration = 0.3 * k * lead / data.mechanics.J.get_ref();
    let duration = 2.0 * align + speed / acceleration + settle;
    if duration > LONG {
        notes.push(format!(
            "the I-f start takes {duration:.1} s: the swing of the rotor on the current vector has a time constant of {:.2} s",
            1.0 / decay
        ));
    }
    vec![
        set("start.mode", Value::Item("CurrentFrequency".into()), "no EMF at standstill"),
        real(
            "start.i",
            lead,
            "1.4 times the rated torque / K, at most the maximum current and psi_M / (2 |L_q - L_d|)",
        ),
        real("start.speed", speed, rule),
        real("start.acceleration", acceleration, "0.3 of the start's torque"),
        real("start.t_align", align, "the rotor settles on the current vector: 3 time constants, at least 0.25 s"),
        real("start.settle", settle, "its swing has decayed at the hand-over: 4 time constants, at least 0.2 s"),
    ]
}
