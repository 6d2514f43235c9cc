//! The drive in steady state, by algebra: torque, currents, voltage, power and losses at a speed, without a transient.
//!
//! ```text
//! torque reference -> limits and currents of the controller, with its estimates      i_s   control::settled
//!                  -> flux linkage and its current, iron and saturation included     psi   flux
//!                  -> u = R i_s + j w psi, copper, iron and friction                       operating
//!                  -> conduction and switching, means over a period in closed form         plant::losses
//!                  -> reduced to the voltage of the link                                  voltage
//! torque at the shaft -> torque reference                                                  search
//! losses -> steady temperatures -> losses                                                 heat
//! ```
//!
//! [`Steady::new`] takes the parameters of plant and controller, [`Steady::at`] a [`Condition`]: speed, link voltage and
//! temperatures. There, [`At::by_reference`] gives the [`Point`] of a torque reference, [`At::by_shaft`] that of a torque at the
//! shaft, [`At::by_current`] that of a current, [`At::ends`] those of minimum and maximum torque, which over the speeds form the
//! envelope, and [`At::off`] that with the gates off. [`Steady::warmed`] also finds the temperatures.
//!
//! The controller's estimates of angle and speed are exact, and nothing is injected. Dead time loses no power. The means of
//! the inverter are those of sinusoidal currents. [`Steady::new`] has a controller without a sample period;
//! [`Steady::sampled`] accounts for the voltage that is constant over T_s.
//!
//! Units SI, peak-valued vectors; torque and power have the motor's sign.

mod flux;
mod heat;
mod operating;
mod sampling;
mod search;
mod voltage;

pub use operating::{At, Point, Region};

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

const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// A drive in steady state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Steady {
    /// The true machine, inverter and shaft.
    pub plant: PlantParameters,
    /// The controller with its estimates.
    pub controller: ControllerParameters,
    /// Computed from the controller's parameters.
    settled: Settled,
    /// The voltage is constant over the controller's sample period.
    sampled: bool,
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
        let mut drive = Self { plant, controller, settled: Settled::default(), sampled: false };
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

    /// The drive under a condition.
    #[inline]
    pub fn at(&self, condition: &Condition) -> At<'_> {
        At::new(self, condition)
    }

    /// Maximum speed (mechanical, rad/s) at which the controller's estimates give its full torque, on a link of `u_dc` (V);
    /// without field weakening, with the full voltage of the link.
    pub fn base_speed(&self, u_dc: f64) -> f64 {
        let par = &self.controller;
        let share = if par.weakening.used { par.weakening.k_u } else { 1.0 };
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
