//! The tables at one speed.

use drive::mapped_drive::map::SHARES;

/// A speed of the tables.
#[derive(Clone, Debug)]
pub struct SpeedColumn {
    /// Mechanical speed in rad/s.
    pub speed: f64,
    /// Peak torque in N.m as a motor and as a generator, both positive.
    pub peak: [f64; 2],
    /// Continuous torque in N.m.
    pub continuous: f64,
    /// Drag torque in N.m.
    pub drag: f64,
    /// Losses in W at the shares of the peak torque.
    pub losses: [f64; SHARES],
}
