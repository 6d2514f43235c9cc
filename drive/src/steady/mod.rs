//! The drive in steady state, by algebra: torque, currents, voltage, power and losses at a speed, without a transient.
//!
//! ```text
//! torque reference -> limits and currents of the controller, with its estimates      i_s   control::settled
//!                  -> flux linkage and its current, iron and saturation included     psi   flux
//!                  -> u = R i_s + j w psi, copper, iron and friction                       operating
//!                  -> conduction and switching, means over a period in closed form         plant::losses
//!                  -> reduced to the voltage of the link                                   voltage
//! torque at the shaft -> torque reference                                                  search
//! losses -> steady temperatures -> losses                                                  heat
//! ```
//!
//! [`Steady::new`] takes the parameters of plant and controller, [`Steady::at`] a [`Condition`]: speed, link voltage and
//! temperatures. There, [`At::by_reference`] gives the [`Point`] of a torque reference, [`At::by_shaft`] the point of a shaft
//! torque, [`At::by_current`] the point of a current, [`At::ends`] the points of minimum and maximum torque, which form the
//! envelope over speed, [`At::off`] the point with the gates off, and [`At::shorted`] that of a short circuit. [`Steady::warmed`]
//! also computes the temperatures.
//!
//! The controller's estimates of angle and speed are exact, and nothing is injected. Dead time loses no power. The means of the
//! inverter are computed for sinusoidal currents. [`Steady::new`] has a controller without a sample period; [`Steady::sampled`]
//! accounts for the voltage that is constant over T_s.
//!
//! Units SI, peak-valued vectors; torque and power have the motor's sign.

mod drive;
mod flux;
mod heat;
mod operating;
mod rest;
mod sampling;
mod search;
mod voltage;

pub(crate) use drive::within;
pub use drive::{Condition, Steady};
pub(crate) use flux::check_saturation;
pub use operating::{At, Point, Region};
pub use rest::Diodes;
