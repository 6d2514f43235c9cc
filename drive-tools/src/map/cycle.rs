//! A vehicle on a driving cycle: speed and torque at the shaft of its machine in the middle of each second, and the energy.

use crate::error::{Result, WithContext, bail, ensure};
use crate::plausible::{self, CORRECT, Check, INERTIA, Units};
use drive::plant::losses::Losses;
use fmu_core::digits::rounded;
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

    /// Reads the texts of a vehicle (TOML) and of a cycle (CSV: time in s, speed in km/h or in the unit of its header; comments
    /// with `#`).
    ///
    /// # Errors
    /// A key or a number is missing, wrong, or implausible, mostly in another unit.
    pub fn new(vehicle: &str, cycle: &str) -> Result<Self> {
        let vehicle: Vehicle = toml::from_str(vehicle).with_context(|| "the vehicle".to_owned())?;
        vehicle.check().with_context(|| "the vehicle".to_owned())?;
        Ok(Self { vehicle, corners: corners(cycle).with_context(|| "the driving cycle".to_owned())? })
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

impl Vehicle {
    fn check(&self) -> Result<()> {
        for (name, x, above) in [
            ("mass", self.mass, true),
            ("rolling_resistance", self.rolling_resistance, false),
            ("drag_area", self.drag_area, false),
            ("air_density", self.air_density, false),
            ("wheel_radius", self.wheel_radius, true),
            ("gear_ratio", self.gear_ratio, true),
            ("rotor_inertia", self.rotor_inertia, false),
        ] {
            let least = if above { "greater than" } else { "at least" };
            ensure!(x.is_finite() && x >= 0.0 && !(above && x == 0.0), "{name} = {x} must be {least} 0");
        }
        plausible::check(self, &checks, &|_| String::new())
    }
}

/// Units of lengths and shares.
const LENGTH: Units = &[("mm", 1e-3), ("cm", 1e-2)];
const SHARE: Units = &[("%", 1e-2)];
const MASS: Units = &[("t", 1e3), ("g", 1e-3)];

fn checks(vehicle: &Vehicle) -> Vec<Check<Vehicle>> {
    type Of = fn(&mut Vehicle) -> &mut f64;
    let (mut copy, per_wheel) = (vehicle.clone(), vehicle.gear_ratio / vehicle.wheel_radius);
    let mut check = |name, unit, units, of: Of, per_unit, what, range, usual| {
        let (value, convert) = (*of(&mut copy), Box::new(move |v: &mut Vehicle, x| *of(v) *= x));
        // Without air resistance there is no ratio to it.
        let per_unit = if f64::is_finite(per_unit) { per_unit } else { f64::NAN };
        Check { name, unit, units, convert, value, at: None, per_unit, what, range, usual, remedy: CORRECT.into() }
    };
    #[rustfmt::skip]
    let all = vec![
        check("rolling_resistance", "", SHARE, |v| &mut v.rolling_resistance, 1.0, "a share of the weight of", (0.0, 0.5), (1e-3, 0.1)),
        check("wheel_radius", "m", LENGTH, |v| &mut v.wheel_radius, 1.0, "a radius, in m,", (0.01, 3.0), (0.05, 1.5)),
        check("mass", "kg", MASS, |v| &mut v.mass, 1.0 / vehicle.drag_area, "its ratio to drag_area, in kg/m2,", (10.0, 1e6), (50.0, 2e4)),
        check("air_density", "kg/m3", &[], |v| &mut v.air_density, 1.0, "a density, in kg/m3,", (0.0, 2.0), (0.5, 1.5)),
        check("gear_ratio", "", &[], |v| &mut v.gear_ratio, 1.0, "turns of the machine per turn of the wheel of", (0.05, 500.0), (0.5, 100.0)),
        check("rotor_inertia", "kg.m2", INERTIA, |v| &mut v.rotor_inertia, per_wheel * per_wheel / vehicle.mass,
            "its share of the mass, at the wheel,", (0.0, 5.0), (1e-4, 0.5)),
    ];
    all
}

/// Units of a speed in a header, with their size in m/s.
const SPEEDS: [(&str, f64); 3] = [("km/h", 1.0 / 3.6), ("m/s", 1.0), ("mph", 0.447_04)];

/// Speed in m/s and acceleration in m/s2 beyond which a cycle has another unit.
const MOST: [f64; 2] = [140.0, 15.0];

/// Time in s and speed in m/s of each line.
fn corners(text: &str) -> Result<Vec<[f64; 2]>> {
    let mut corners: Vec<[f64; 2]> = Vec::new();
    let mut size = SPEEDS[0].1;
    for (k, line) in text.lines().enumerate() {
        let (number, line) = (k + 1, line.split('#').next().unwrap_or_default().trim());
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        if line.is_empty() {
            continue;
        }
        if corners.is_empty() && line.starts_with(|c: char| c.is_alphabetic()) {
            let unit = cells.get(1).and_then(|name| name.split(['[', ']']).nth(1));
            size = match unit.map(|unit| SPEEDS.iter().find(|(name, _)| *name == unit).ok_or(unit)) {
                None => size,
                Some(Ok((_, size))) => *size,
                Some(Err(unit)) => bail!("line {number}: the unit {unit} of a speed must be km/h, m/s or mph"),
            };
            continue;
        }
        let parsed =
            cells.iter().map(|cell| cell.parse().ok().filter(|x: &f64| x.is_finite())).collect::<Option<Vec<f64>>>();
        let Some([t, v]) = parsed.as_deref().and_then(|row| <[f64; 2]>::try_from(row).ok()) else {
            bail!("line {number}: {line} must be time (s) and speed (km/h)");
        };
        ensure!(v >= 0.0, "line {number}: the speed {v} must be at least 0");
        let v = v * size;
        ensure!(v < MOST[0], "line {number}: vehicles are slower than {} m/s: check the units", rounded(v, 4));
        if let Some([before, of_before]) = corners.last() {
            ensure!(*before < t, "line {number}: the time {t} s does not increase");
            let a = (v - of_before) / (t - before);
            ensure!(
                a.abs() < MOST[1],
                "line {number}: from {before} s to {t} s, vehicles accelerate less than {} m/s2: check the units",
                rounded(a, 4)
            );
        }
        corners.push([t, v]);
    }
    ensure!(corners.len() >= 2, "has no two times");
    Ok(corners)
}
