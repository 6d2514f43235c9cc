//! A vehicle on a driving cycle: speed and torque at the shaft of its machine in the middle of each second, and the energy.

use crate::error::{Result, WithContext, bail};
use drive::plant::losses::Losses;
use serde::Deserialize;

/// A vehicle, in SI units.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vehicle {
    mass: f64,
    rolling_resistance: f64,
    drag_area: f64,
    air_density: f64,
    wheel_radius: f64,
    gear_ratio: f64,
    rotor_inertia: f64,
}

/// Acceleration of gravity in m/s2.
const GRAVITY: f64 = 9.81;

/// Copies of the files in `examples/vehicle`, because a Cargo package cannot include files outside its folder.
pub const VEHICLE: &str = include_str!("vehicle.toml");
/// The cycle beside it.
pub const CYCLE: &str = include_str!("cycle.csv");

/// A vehicle on a cycle.
#[derive(Clone, Debug)]
pub struct Cycle {
    vehicle: Vehicle,
    /// Time in s and speed in m/s, with straight lines between them.
    corners: Vec<[f64; 2]>,
}

/// Energy of a cycle in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Taken from the DC link, and given back, negative.
    pub link: [f64; 2],
    /// Losses.
    pub losses: Losses,
}

impl Energy {
    /// Drawn from the DC link, minus the regenerated energy.
    pub fn sum(&self) -> f64 {
        self.link[0] + self.link[1]
    }
}

impl Cycle {
    /// The vehicle and the cycle of `examples/vehicle`.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub fn example() -> Result<Self> {
        Self::new(VEHICLE, CYCLE)
    }

    /// Reads the texts of a vehicle (TOML) and of a cycle (CSV: time in s, speed in km/h; comments with `#`).
    ///
    /// # Errors
    /// A key or a number is missing or wrong.
    pub fn new(vehicle: &str, cycle: &str) -> Result<Self> {
        let vehicle = toml::from_str(vehicle).with_context(|| "the vehicle".to_owned())?;
        let mut corners: Vec<[f64; 2]> = Vec::new();
        for line in cycle.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())) {
            let corner = line.split_once(',').and_then(|(t, v)| Some([t.trim().parse().ok()?, v.trim().parse().ok()?]));
            let [t, v]: [f64; 2] = corner.with_context(|| format!("the driving cycle: {line}"))?;
            if corners.last().is_some_and(|last| last[0] >= t) {
                bail!("the driving cycle: the time {t} s does not increase");
            }
            corners.push([t, v / 3.6]);
        }
        if corners.len() < 2 {
            bail!("the driving cycle has no two times");
        }
        Ok(Self { vehicle, corners })
    }

    /// Speed (rad/s) of the machine and torque (N.m) at its shaft in the middle of each second.
    pub fn points(&self) -> impl Iterator<Item = [f64; 2]> {
        let end = self.corners.last().map_or(0.0, |corner| corner[0]);
        (0..u32::MAX).map(|k| f64::from(k) + 0.5).take_while(move |t| *t < end).map(|t| self.point(t))
    }

    fn point(&self, t: f64) -> [f64; 2] {
        let Vehicle { mass, rolling_resistance, drag_area, air_density, wheel_radius, gear_ratio, rotor_inertia } =
            self.vehicle;
        let k = self.corners.partition_point(|corner| corner[0] <= t).clamp(1, self.corners.len() - 1);
        let ([t_0, v_0], [t_1, v_1]) = (self.corners[k - 1], self.corners[k]);
        let a = (v_1 - v_0) / (t_1 - t_0);
        let v = v_0 + a * (t - t_0);
        let rolling = if v > 0.0 { mass * GRAVITY * rolling_resistance } else { 0.0 };
        let (force, per_wheel) =
            (mass * a + rolling + 0.5 * air_density * drag_area * v * v, gear_ratio / wheel_radius);
        [v * per_wheel, force / per_wheel + rotor_inertia * a * per_wheel]
    }

    /// The energy with the power from the link (W) and the losses of `read` at each speed and torque.
    ///
    /// # Errors
    /// The first speed and torque at which `read` returns no losses.
    pub fn energy(&self, mut read: impl FnMut(f64, f64) -> Option<(f64, Losses)>) -> Result<Energy, [f64; 2]> {
        let mut energy = Energy::default();
        for [speed, tau] in self.points() {
            let (p_in, losses) = read(speed, tau).ok_or([speed, tau])?;
            energy.link[usize::from(p_in < 0.0)] += p_in;
            energy.losses.add(&losses);
        }
        Ok(energy)
    }
}
