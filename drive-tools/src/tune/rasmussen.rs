//! The rules for Rasmussen's observer.
//!
//! w_n = observer, zeta = 1; c_1 = 4 |R - R^| i_0 / psi_M within 50..200 1/s, c_2 = c_1 / 50; K i_0 = 1.35 times the rated torque;
//! w_0 = 30 rad/s electrical within 5..40 rad/s mechanical; w_s <= w_n / 3; w_n >= sqrt(alpha / 0.35) with the maximum electrical
//! acceleration alpha = n_p K i_q / J.
//!
//! A resistance that is not adapted ([`adaptation`](super::adaptation)) is R^ = 0.9 R: the safe side at standstill, where R^ > R runs
//! away. At rest on i_0 the estimate then drifts by (R - R^) i_0 / psi_M, and the rotor swings about it with w_0 = sqrt(n_p K i_0 / J). The rules choose R^
//!
//! - closer to R where the drift would exceed w_0: the rotor is too heavy to follow the estimate;
//! - closer to R where (R - R^) i with the rated torque would exceed 0.15 of the EMF at 0.1 pu: the estimate turns away by c_1
//!   (R - R^) i / (w^2 psi_M), less torque remains, the current rises, and the estimate turns further;
//! - farther from R where the drift would be less than 0.025 w_0: from the opposite angle, the speed loop drives i_q to its
//!   limit before the rotor has turned around. At an angle near atan(i_q / i_0) from the rotor, the currents produce no torque,
//!   and only drift leads away from that angle.
//!
//! The shares 0.15 and 0.025 are found by trial on machines from 5 W to 300 kW.

use super::bandwidth::{Bandwidths, least_observer};
use super::motor::{Data, MotorFile, swing, torque_constant};
use super::setting::{LEVELS, Setting, real};
use crate::error::{Result, bail};
use drive::control::tables::ControllerParameters;

/// Maximum share of the EMF at 0.1 pu for (R - R^) i at the rated torque.
const LOST_EMF: f64 = 0.15;

/// Minimum drift of the estimate at rest as a share of the rotor's swing, and the maximum share of R that the rules sacrifice for
/// it.
const LEAST_DRIFT: (f64, f64) = (0.025, 0.5);

/// Minimum share by which R^ can be kept below R: a smaller share would be within the uncertainty of R.
pub const LEAST_MARGIN: f64 = 0.02;

/// Share by which R^ should be below R.
pub fn resistance_margin(data: &Data) -> f64 {
    let (followed, held) = bounds(data);
    let (share, most) = LEAST_DRIFT;
    0.1_f64.max((share * followed).min(most)).min(followed).min(held)
}

/// Maximum shares of R by which R^ may be below R: so that the rotor follows at rest, and so that the EMF at 0.1 pu stays larger.
fn bounds(data: &Data) -> (f64, f64) {
    let (R_s, psi_M) = (*data.machine.R_s.get_ref(), *data.machine.psi_M.get_ref());
    let (i_0, i) = (zero_speed_current(data), data.rating.torque.get_ref() / torque_constant(data));
    let emf = f64::from(*data.machine.n_p.get_ref()) * LEVELS[0] * data.rating.speed.get_ref() * psi_M;
    (swing(data, i_0) * psi_M / (R_s * i_0), LOST_EMF * emf / (R_s * i))
}

/// The controller's R_s.
pub fn resistance(data: &Data) -> Setting {
    let (margin, (followed, held)) = (resistance_margin(data), bounds(data));
    let reason = if margin > 0.1 {
        "the estimate leaves a wrong angle at rest"
    } else if margin < 0.1 && followed < held {
        "below R_s, and the rotor follows the estimate at rest"
    } else if margin < 0.1 {
        "(R - R^) i takes 0.15 of the EMF at 0.1 pu"
    } else {
        "the safe side at standstill"
    };
    let share = format!("{:.3}", 1.0 - margin);
    let rule = format!("{} R_s: {reason}", share.trim_end_matches('0'));
    real("motor.R_s", (1.0 - margin) * data.machine.R_s.get_ref(), &rule)
}

/// Current in A of the low-speed law: holds 1.35 times the rated torque.
pub fn zero_speed_current(data: &Data) -> f64 {
    1.35 * data.rating.torque.get_ref() / torque_constant(data)
}

/// Values of the controller.
///
/// # Errors
/// The maximum current cannot hold the rated torque at standstill, or the observer is too slow for it.
pub fn settings(motor: &MotorFile, bandwidths: &Bandwidths, notes: &mut Vec<String>) -> Result<Vec<Setting>> {
    let data = &motor.data;
    let Data { machine, rating, .. } = data;
    let n_p = f64::from(*machine.n_p.get_ref());
    let (limit, w_n) = (*rating.current.get_ref(), bandwidths.observer.value);
    let i_0 = zero_speed_current(data);
    if i_0 > limit {
        let place = motor.place(&rating.current);
        bail!(
            "{place}: rating.current = {limit} A, the maximum current, is less than the {i_0:.2} A needed to hold \
            rating.torque at standstill (1.35 torque / K, K = 1.5 n_p psi_M = {:.4} N.m/A): raise it, or lower the torque",
            torque_constant(data)
        );
    }
    let i_q = 0.8 * limit;
    let least = least_observer(data);
    if w_n < least {
        let place = motor.place_at(bandwidths.observer.origin.unwrap_or_default());
        bail!(
            "{place}: bandwidth.observer = {w_n} rad/s cannot follow the maximum acceleration: choose at least {least:.0} rad/s, or a lower rating.current"
        );
    }
    if !(150.0..=800.0).contains(&w_n) {
        notes.push(format!("bandwidth.observer is {w_n:.0} rad/s; 150 to 800 were tried"));
    }
    let w_s = bandwidths.speed.value;
    if !(40.0..=200.0).contains(&w_s) {
        notes.push(format!("bandwidth.speed is {w_s:.0} rad/s; 40 to 200 were tried"));
    }
    let c_1 = (4.0 * resistance_margin(data) * machine.R_s.get_ref() * i_0 / machine.psi_M.get_ref()).max(50.0);
    if c_1 > 200.0 {
        notes.push(format!("c_1 psi_M >= 4 |R - R^| i_0 requires c_1 = {c_1:.0} 1/s; values up to 200 were tried"));
    }
    let c_1 = c_1.min(200.0);
    Ok(vec![
        real("speed_loop.b", 0.5, "set-point weight of Rasmussen's drive"),
        real("limit.i_q", i_q, "0.8 of the maximum current"),
        real(
            "limit.tau",
            (torque_constant(data) * limit).max(ControllerParameters::default().limit.tau),
            "K times the maximum current, at least 1000 N.m: the currents are the limit",
        ),
        real("rasmussen.w_n", w_n, "bandwidth.observer"),
        real("rasmussen.zeta", 1.0, "aperiodic"),
        real("rasmussen.c_1", c_1, "4 |R - R^| i_0 / psi_M, at least 50, at most 200"),
        real("rasmussen.c_2", c_1 / 50.0, "c_1 / 50"),
        real("zero_speed.i_0", i_0, "1.35 times the rated torque / K"),
        real("zero_speed.w_0", (30.0 / n_p).clamp(5.0, 40.0), "30 rad/s electrical, 5 to 40 mechanical"),
    ])
}
