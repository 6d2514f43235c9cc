//! Interpolation in a map: each loss, bilinear in speed and relative torque.
//!
//! ```text
//! x = tau / tau_lim(n)     p_k = bilinear p_k(n, x)     p_in = tau w_m + sum p_k
//! ```
//!
//! tau_lim is interpolated linearly between the speeds of the grid. The efficiency is computed from the losses and never
//! interpolated: it is 0/0 without load.
//!
//! At another voltage the map is read at the speed n u_ref / u_dc, where field weakening is equally deep, with the shaft torque
//! that corresponds to the same torque of the rotor before friction. p_sw grows with (u_dc / u_ref)^k_sw; p_iron is taken at
//! the speed and this flux linkage, p_friction at the speed. At another temperature of the winding, p_cu is in proportion to
//! R_s(T). `tests/map.rs` has the errors.

use super::sheet::{Axes, Sheet};
use drive::plant::losses::{Losses, efficiency};
use drive::plant::tables::PlantParameters;

/// A sheet that can be read between its points.
#[derive(Clone, Debug)]
pub struct Table<'a> {
    axes: &'a Axes,
    sheet: &'a Sheet,
    plant: &'a PlantParameters,
}

/// A reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Losses in W.
    pub losses: Losses,
    /// Power from the DC link in W.
    pub p_in: f64,
    /// Efficiency, 0 where it is undefined.
    pub efficiency: f64,
}

/// The interval of an axis that contains `x`, and the relative position of `x` in it.
fn cell(axis: &[f64], x: f64) -> Option<(usize, f64)> {
    let (first, last) = (axis.first()?, axis.last()?);
    let beyond = 1e-9 * (last - first);
    if !(x >= first - beyond && x <= last + beyond) {
        return None;
    }
    let k = axis.partition_point(|a| *a <= x).clamp(1, axis.len() - 1);
    Some((k - 1, ((x - axis[k - 1]) / (axis[k] - axis[k - 1])).clamp(0.0, 1.0)))
}

impl<'a> Table<'a> {
    /// A sheet on its axes, for a drive with this plant.
    pub fn new(axes: &'a Axes, sheet: &'a Sheet, plant: &'a PlantParameters) -> Self {
        Self { axes, sheet, plant }
    }

    /// Minimum and maximum torque (N.m) at the shaft at the mechanical `speed` (rad/s, not negative).
    pub fn limits(&self, speed: f64) -> Option<[f64; 2]> {
        let (k, share) = cell(&self.axes.speed, speed)?;
        let between = |s: usize| (1.0 - share) * self.sheet.limits[k][s] + share * self.sheet.limits[k + 1][s];
        Some([between(0), between(1)])
    }

    /// The losses at a speed and a share of the maximum torque; `None` where a point of the cell is out of reach.
    pub fn losses(&self, speed: f64, x: f64) -> Option<Losses> {
        let (k, b) = cell(&self.axes.speed, speed)?;
        let (j, a) = cell(&self.axes.x, x)?;
        let row = |k: usize| {
            let at = |j: usize| Some(self.sheet.points[k * self.axes.x.len() + j]?.powers.losses);
            Some(at(j)?.with(&at(j + 1)?, |p, q| (1.0 - a) * p + a * q))
        };
        Some(row(k)?.with(&row(k + 1)?, |p, q| (1.0 - b) * p + b * q))
    }

    /// The reading at a mechanical speed (rad/s) and a torque at the shaft (N.m) of any sign; `None` out of reach.
    pub fn read(&self, speed: f64, tau: f64) -> Option<Reading> {
        // The other direction of rotation is the mirror image.
        let (n, forward) = (speed.abs(), if speed < 0.0 { -tau } else { tau });
        let losses = self.losses(n, share(self.limits(n)?, forward)?)?;
        Some(reading(losses, n * forward))
    }

    /// [`read`](Self::read) at another DC-link voltage (V) and temperature of the winding (K).
    pub fn read_at(&self, speed: f64, tau: f64, u_dc: f64, T: f64) -> Option<Reading> {
        let Self { sheet, plant, .. } = self;
        let (n, forward, scale) = (speed.abs(), if speed < 0.0 { -tau } else { tau }, u_dc / sheet.u_dc);
        let read = n / scale;
        // The rotor torque is the same; friction differs at the speed of the lookup.
        let friction = |n: f64| plant.mechanics.friction(n);
        let at_speed = self.losses(read, share(self.limits(read)?, forward + friction(n) - friction(read))?)?;
        let iron = |n: f64| {
            let w = f64::from(plant.motor.n_p) * n;
            plant.iron.conductance(w) * w * w
        };
        let resistance = |T: f64| 1.0 + plant.thermal.alpha_R * (T - plant.thermal.T_ref);
        let losses = Losses {
            cu: at_speed.cu * resistance(T) / resistance(sheet.T),
            iron: if read > 0.0 && at_speed.iron > 0.0 { at_speed.iron * iron(n) / iron(read) } else { 0.0 },
            cond: at_speed.cond,
            sw: at_speed.sw * scale.powf(plant.inverter.devices.k_sw),
            friction: friction(n) * n,
        };
        Some(reading(losses, n * forward))
    }
}

/// A reading with these losses and this power (W) at the shaft.
pub(super) fn reading(losses: Losses, p_mech: f64) -> Reading {
    let p_in = p_mech + losses.sum();
    Reading { losses, p_in, efficiency: efficiency(p_in, p_mech) }
}

/// The torque as a share of the limit of its sign; `None` beyond it.
fn share([low, high]: [f64; 2], tau: f64) -> Option<f64> {
    if tau == 0.0 {
        return Some(0.0);
    }
    let x = if tau > 0.0 { tau / high } else { -tau / low };
    (x.abs() <= 1.0 + 1e-9).then(|| x.clamp(-1.0, 1.0))
}
