//! The limits of the DC link: field weakening if the rated point or the highest speed needs it, and the torque there.
//!
//! The references may use U = k_u u_dc / sqrt 3. The rated torque at the rated speed must fit, with field weakening if need be;
//! at the highest speed, the torque at rated power.

use super::motor::{Data, MotorFile, electrical};
use super::setting::{Setting, Value, set};
use crate::error::{Result, bail};
use drive::control::envelope::Envelope;
use drive::control::reference::max_torque_per_ampere;
use drive::frame::DqHat;

/// Maximum load at the highest speed as a share of the maximum torque: the remainder is left for the speed loop.
const TOP_SHARE: f64 = 0.8;

/// Field weakening and load at the highest speed.
pub struct Voltage {
    /// The setting of field weakening, if needed.
    pub settings: Vec<Setting>,
    /// Load in N.m at the highest speed: from the rated power, at most 0.8 of the maximum torque, less friction.
    pub top_torque: f64,
}

/// Whether field weakening is needed, and the load at the highest speed; maximum torque per ampere if `mtpa`. The references may use
/// the share `k_u` of the voltage.
///
/// # Errors
/// The rated torque at the rated speed, or any torque at the highest speed, is out of reach.
pub fn of(motor: &MotorFile, mtpa: bool, k_u: f64, notes: &mut Vec<String>) -> Result<Voltage> {
    let Data { rating, dc_link, mechanics, .. } = &motor.data;
    let machine = electrical(&motor.data);
    let (speed, torque, current) = (*rating.speed.get_ref(), *rating.torque.get_ref(), *rating.current.get_ref());
    let (top, u_dc) = (rating.top(), *dc_link.u_dc.get_ref());
    let (n_p, highest) = (f64::from(machine.n_p), u_dc / 3.0_f64.sqrt());
    let (envelope, U) = (Envelope::new(&machine, current), k_u * highest);
    // Without field weakening.
    let currents = |torque: f64| {
        if mtpa { max_torque_per_ampere(&machine, torque) } else { DqHat::new(0.0, torque / machine.torque_constant()) }
    };
    let least = currents(torque).magnitude();
    if least > current {
        bail!(
            "{}: rating.current = {current} A, the maximum current, is less than the {least:.2} A needed for rating.torque: raise it, or lower the torque",
            motor.place(&rating.current)
        );
    }
    let most = |speed: f64| envelope.settled(n_p * speed, 1.0, U).tau;
    let fits = |torque: f64, speed: f64| envelope.excess(currents(torque), n_p * speed, U) <= 0.0;
    let rated_fits = fits(torque, speed);
    if !rated_fits && most(speed) < torque {
        bail!(
            "{}: at rating.speed, even field weakening gives at most {:.2} N.m of the {torque} N.m of rating.torque: lower the \
             speed or the torque, or raise rating.current or dc_link.u_dc = {u_dc} V",
            motor.place(&rating.speed),
            most(speed)
        );
    }
    let part = |x: &Option<super::motor::Located>| x.as_ref().map_or(0.0, |x| *x.get_ref());
    let friction = part(&mechanics.tau_coulomb) + (part(&mechanics.B) + part(&mechanics.k_w) * top) * top;
    let top_torque = (torque * speed / top).min(TOP_SHARE * most(top) - friction);
    if let Some(given) = rating.speed_max.as_ref().filter(|_| top_torque <= 0.0) {
        bail!(
            "{}: at rating.speed_max = {top} rad/s, even field weakening gives at most {:.2} N.m, and friction takes {friction:.2} \
             N.m: lower it, or raise rating.current = {current} A or dc_link.u_dc = {u_dc} V",
            motor.place(given),
            most(top)
        );
    }
    if rated_fits && (rating.speed_max.is_none() || fits(top_torque + friction, top)) {
        return Ok(Voltage { settings: Vec::new(), top_torque });
    }
    let diodes = highest / (n_p * machine.psi_M);
    if top > diodes {
        let key = if rating.speed_max.is_some() { "rating.speed_max" } else { "rating.speed" };
        notes.push(format!(
            "above {diodes:.0} rad/s, the magnet's EMF exceeds dc_link.u_dc = {u_dc} V: gates that switch off there feed the DC \
             link through the diodes; {key} is {top:.0} rad/s"
        ));
    }
    let what = if rated_fits { "the highest speed" } else { "rated torque at rated speed" };
    let rule = format!("{what} needs more than {k_u} u_dc / sqrt(3)");
    Ok(Voltage { settings: vec![set("weakening.use", Value::Boolean(true), &rule)], top_torque })
}
