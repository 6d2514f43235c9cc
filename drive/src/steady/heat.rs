//! Steady temperatures: the network dissipates the losses of the drive at these temperatures.
//!
//! A fixed-point iteration: losses at the temperatures, temperatures from the losses ([`Network::steady`]), and so on. A change
//! of the winding's temperature returns multiplied by alpha p (1/G_ws + 1/G_sc), p the copper loss at T_ref; from 1 on, the
//! winding runs away.
//!
//! [`Network::steady`]: drive_plant::thermal::network::Network::steady

use super::drive::{Condition, Steady};
use super::operating::{At, Point};
use drive_plant::thermal::Temperatures;

/// Maximum number of iterations, and the change in K at which they end.
const MAX_ITERATIONS: usize = 400;
const SMALL: f64 = 1e-7;

impl Steady {
    /// The steady temperatures (K) at the mechanical `speed` (rad/s) on a link of `u_dc` (V) with the coolant at `coolant` (K),
    /// and the point that `find` selects under the condition, for example for a given shaft torque. `None` if the winding
    /// runs away, a heated part is insulated, or `find` returns no point.
    pub fn warmed(
        &self,
        speed: f64,
        u_dc: f64,
        coolant: f64,
        find: impl Fn(&At<'_>) -> Option<Point>,
    ) -> Option<(Temperatures, Point)> {
        let thermal = &self.plant.thermal;
        let mut temperatures = Temperatures::all(coolant);
        for _ in 0..MAX_ITERATIONS {
            let point = find(&self.at(&Condition { speed, u_dc, temperatures }))?;
            let next = thermal.network.steady(&thermal.heat(&point.powers.losses), coolant);
            let parts = |t: &Temperatures| [t.winding, t.stator, t.magnet, t.inverter];
            let works = self.works_at(&next);
            let change = parts(&next).iter().zip(parts(&temperatures)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if !works || !change.is_finite() {
                return None;
            }
            temperatures = next;
            if change <= SMALL {
                return Some((temperatures, point));
            }
        }
        None
    }

    /// Whether the machine has a resistance and a magnet at these temperatures (K).
    fn works_at(&self, at: &Temperatures) -> bool {
        let motor = self.plant.thermal.motor(&self.plant.motor, at);
        let works = |x: f64| x > 0.0 && x.is_finite();
        works(motor.R_s) && works(motor.psi_M)
    }
}
