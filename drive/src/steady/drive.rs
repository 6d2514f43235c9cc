//! A drive whose steady state is computed, and its operating condition.

use crate::derating::Derating;
use drive_control::envelope::Envelope;
use drive_control::settled::Settled;
use drive_control::tables::ControllerParameters;
use drive_plant::tables::PlantParameters;
use drive_plant::thermal::Temperatures;
use serde::{Deserialize, Serialize};

/// `x` within the limits; unlike `clamp`, it does not panic if the limits are NaN.
#[inline]
pub(crate) fn within(x: f64, [low, high]: [f64; 2]) -> f64 {
    x.max(low).min(high)
}

pub(super) const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// A drive in steady state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Steady {
    /// The true machine, inverter and shaft.
    pub plant: PlantParameters,
    /// The controller with its estimates.
    pub controller: ControllerParameters,
    /// Computed from the controller's parameters.
    pub(super) settled: Settled,
    /// The maximum torque of a hot winding.
    pub derating: Derating,
    /// The voltage is constant over the controller's sample period.
    pub(super) sampled: bool,
}

/// Operating condition, apart from the torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// Mechanical speed in rad/s.
    pub speed: f64,
    /// DC-link voltage in V.
    pub u_dc: f64,
    /// Temperatures in K.
    pub temperatures: Temperatures,
}

impl Steady {
    /// For these parameters, without regard to the sample period.
    pub fn new(plant: PlantParameters, controller: ControllerParameters) -> Self {
        let mut drive =
            Self { plant, controller, settled: Settled::default(), derating: Derating::default(), sampled: false };
        drive.derive();
        drive
    }

    /// The drive with a voltage that is constant over the sample period, as in `PmsmDrive`.
    pub fn sampled(self) -> Self {
        Self { sampled: true, ..self }
    }

    /// Updates derived values; call it after changing the parameters.
    pub fn derive(&mut self) {
        self.settled = Settled::new(&self.controller);
    }

    /// Values derived from the controller's parameters.
    pub fn settled(&self) -> &Settled {
        &self.settled
    }

    /// The temperatures (K) of the parameter `thermal.T_start` in all parts.
    pub fn start_temperatures(&self) -> Temperatures {
        Temperatures::all(self.plant.thermal.T_start)
    }

    /// Maximum speed (mechanical, rad/s) at which the controller's estimates allow full torque, on a link of `u_dc` (V);
    /// without field weakening, with the full voltage of the link.
    pub fn base_speed(&self, u_dc: f64) -> f64 {
        let par = &self.controller;
        let share = if par.weakening.used { par.weakening.k_u } else { 1.0 } * par.modulation.mode.reach();
        let envelope = Envelope::new(&par.motor, par.limit.i);
        envelope.base_speed(share * u_dc / SQRT_3) / f64::from(par.motor.n_p)
    }

    /// The speed (mechanical, rad/s) above which the back EMF charges a link of `u_dc` (V) through the diodes when the gates are
    /// off, with magnets at `T_magnet` (K).
    pub fn diode_speed(&self, u_dc: f64, T_magnet: f64) -> f64 {
        let motor = self.plant.thermal.motor(&self.plant.motor, &Temperatures::all(T_magnet));
        (u_dc + 2.0 * self.plant.inverter.devices.u_diode) / (SQRT_3 * motor.psi_M * f64::from(motor.n_p))
    }
}
