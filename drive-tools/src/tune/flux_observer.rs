//! The rules for the flux observer of Hinkkanen et al.: a tracker with the bandwidth of Rasmussen's observer, which follows the
//! acceleration by the maximum current from rest, and the low-speed law.
//!
//! i_0 aligns the rotor like a compass needle while the EMF carries no information: with 1.35 times the rated torque, as in
//! Rasmussen's observer, on a machine without saliency. On a salient one, i_0 > 0 takes reluctance torque from i_q (psi_M -
//! (L_q - L_d) i_0), so it is 0.3 psi_M / (L_q - L_d) at most, and maximum torque per ampere carries the rest.

use super::bandwidth::{Bandwidths, GREATEST_TORQUE};
use super::motor::{MotorFile, electrical, torque_constant};
use super::rasmussen::zero_speed_current;
use super::setting::{Setting, Value, real, set};
use crate::error::{Result, bail};
use drive::control::reference::max_torque_per_ampere;

/// Maximum i_0 as a share of psi_M / (L_q - L_d).
const LEAST_RELUCTANCE: f64 = 0.3;

/// Values of the controller.
///
/// # Errors
/// The maximum current does not give the rated torque.
pub fn settings(motor: &MotorFile, bandwidths: &Bandwidths) -> Result<Vec<Setting>> {
    let data = &motor.data;
    let (machine, rating) = (electrical(data), &data.rating);
    let (n_p, limit, torque) = (f64::from(machine.n_p), *rating.current.get_ref(), *rating.torque.get_ref());
    let saliency = machine.L_q - machine.L_d;
    let wanted = zero_speed_current(data);
    let most = if saliency > 0.0 { LEAST_RELUCTANCE * machine.psi_M / saliency } else { f64::INFINITY };
    let i_0 = wanted.min(most);
    let least = max_torque_per_ampere(&machine, torque).magnitude().max(i_0);
    if least > limit {
        bail!(
            "{}: rating.current = {limit} A, the maximum current, is less than the {least:.2} A that FluxObserver takes for rating.torque at \
             standstill (1.35 torque / K with K = 1.5 n_p psi_M = {:.4} N.m/A, at most 0.3 psi_M / (L_q - L_d), or maximum torque per \
             ampere): raise it, or lower the torque",
            motor.place(&rating.current),
            torque_constant(data)
        );
    }
    let rho = bandwidths.observer.value;
    Ok(vec![
        set("current.mtpa", Value::Boolean(true), "salient: minimum current for a torque"),
        real("speed_loop.b", 0.5, "set-point weight of Rasmussen's drive"),
        real("limit.i_q", limit, "the maximum current"),
        real("limit.tau", GREATEST_TORQUE * torque, "1.6 times the rated torque"),
        real("tracker.bandwidth", rho, "bandwidth.observer"),
        real("zero_speed.i_0", i_0, "1.35 times the rated torque / K, at most 0.3 psi_M / (L_q - L_d)"),
        real("zero_speed.w_0", (30.0 / n_p).clamp(5.0, 40.0), "30 rad/s electrical, 5 to 40 mechanical"),
    ])
}
