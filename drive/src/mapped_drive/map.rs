//! The tables of a drive: torque over speed, losses over speed and torque.
//!
//! Every table has the axis `map.speed`, n_k. The torque axis of the losses is the share x of the peak torque of the same sign,
//! x_j = -1, -0.9 ... 1, so that no cell crosses the envelope:
//!
//! ```text
//! tau_lim(n) = linear in n      x = tau / tau_lim(n)      p_loss = p_loss(n, x)      p_in = tau w + p_loss
//! ```
//!
//! Losses are interpolated, never the efficiency, which is 0/0 without load: linearly in n, and in x by parabolas, because copper
//! loss is one: straight lines between its points would lie above it, by a tenth at a small torque. Reverse rotation mirrors forward rotation: motoring
//! is x > 0.
//!
//! At another voltage than `map.u_dc`, the torque is read at the speed n map.u_dc / u_dc, where the voltage limits it equally;
//! the losses at n itself and the torque itself. Between two voltages the losses at one speed and torque differ by the current
//! of field weakening and the switching loss, which a data sheet does not separate; reading them at the scaled speed would scale
//! friction and iron loss too, which is worse. Beyond the peak torque of `map.u_dc`, where a higher voltage allows more, the part
//! of the losses that depends on the torque grows with its square. A torque that still falls to a smaller limit has the losses of that
//! limit.

use fmu_core::unit::{NEWTON_METER, SECOND, SPEED, VOLT, WATT};
use fmu_core::{Fault, Row, Table, digits, table};
use serde::{Deserialize, Serialize};

/// Number of speeds of the tables.
pub const SPEEDS: usize = 21;

/// Number of torques of the losses, from -1 to 1 times the peak torque.
pub const SHARES: usize = 21;

/// The share of the peak torque in column `j`.
pub fn share(j: usize) -> f64 {
    // Both are below 2^53.
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    let (j, half) = (j as f64, (SHARES / 2) as f64);
    (j - half) / half
}

/// The tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Map {
    /// DC-link voltage in V of the tables, and the minimum and maximum at which the drive operates.
    pub u_dc: f64,
    /// Minimum in V.
    pub u_min: f64,
    /// Maximum in V.
    pub u_max: f64,
    /// Mechanical speeds in rad/s, from 0 on.
    pub speed: [f64; SPEEDS],
    /// Peak torque in N.m as a motor, >= 0.
    pub tau_motor: [f64; SPEEDS],
    /// Peak torque in N.m as a generator, >= 0.
    pub tau_generator: [f64; SPEEDS],
    /// Continuous torque in N.m, > 0.
    pub tau_continuous: [f64; SPEEDS],
    /// Drag torque in N.m with the gates off, >= 0.
    pub tau_drag: [f64; SPEEDS],
    /// Losses in W, with a row per speed and a column per share of the peak torque.
    pub p_loss: [[f64; SHARES]; SPEEDS],
    /// Time constant of the overload in s, >= 0; 0: the peak torque is available at any time.
    pub t_overload: f64,
}

impl Default for Map {
    /// A drive of 0.6 kW; its values are assumed.
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    fn default() -> Self {
        let mut map = Self {
            u_dc: 325.0,
            u_min: 0.0,
            u_max: 1e3,
            speed: [0.0; SPEEDS],
            tau_motor: [0.0; SPEEDS],
            tau_generator: [0.0; SPEEDS],
            tau_continuous: [0.0; SPEEDS],
            tau_drag: [0.02; SPEEDS],
            p_loss: [[0.0; SHARES]; SPEEDS],
            t_overload: 0.0,
        };
        for k in 0..SPEEDS {
            let n = 25.0 * k as f64;
            let peak = if n > 200.0 { 6.0 * 200.0 / n } else { 6.0 };
            map.speed[k] = n;
            (map.tau_motor[k], map.tau_generator[k], map.tau_continuous[k]) = (peak, peak, 0.5 * peak);
            for j in 0..SHARES {
                // Copper at full current up to the maximum speed, inverter, drag.
                map.p_loss[k][j] = 10.0 + 0.04 * n + 120.0 * share(j) * share(j);
            }
        }
        map
    }
}

/// The position of a value on an axis: the interval, and the position in it from 0 to 1.
#[derive(Clone, Copy, Debug)]
struct Cell {
    k: usize,
    by: f64,
}

impl Cell {
    fn of(&self, of: &[f64; SPEEDS]) -> f64 {
        of[self.k] + (of[self.k + 1] - of[self.k]) * self.by
    }
}

/// Width of the band above the last speed over which the torque falls to 0, as a share of that speed.
const BEYOND: f64 = 0.01;

/// Minimum and maximum of the best efficiency of a drive.
const EFFICIENCY: [f64; 2] = [0.2, 0.999];

/// Speed in rad/s below which the drag torque falls to 0.
pub(super) const SLOW: f64 = 1.0;

/// The drive at a speed and a voltage; torques of the direction of rotation.
#[derive(Clone, Copy, Debug)]
pub(super) struct At<'a> {
    map: &'a Map,
    /// Place on the axis of the speeds.
    cell: Cell,
    /// Peak torques in N.m as a motor and as a generator, at `map.u_dc`.
    reference: [f64; 2],
    /// Peak torques in N.m at the present voltage.
    pub(super) peak: [f64; 2],
    /// Continuous torque in N.m at this voltage.
    pub(super) continuous: f64,
}

impl Map {
    fn cell(&self, n: f64) -> Cell {
        let k = self.speed.partition_point(|s| *s <= n).clamp(1, SPEEDS - 1) - 1;
        let [from, to] = [self.speed[k], self.speed[k + 1]];
        Cell { k, by: ((n - from) / (to - from)).clamp(0.0, 1.0) }
    }

    /// The last speed in rad/s.
    pub fn last(&self) -> f64 {
        self.speed[SPEEDS - 1]
    }

    /// The drive at the speed `n` (rad/s, >= 0) and the voltage `u_dc` (V).
    pub(super) fn at(&self, n: f64, u_dc: f64) -> At<'_> {
        let cell = self.cell(n);
        let scaled = if u_dc > 0.0 { n * self.u_dc / u_dc } else { n };
        let there = self.cell(scaled);
        // The speed of the last column is a limit at any voltage.
        let left = (1.0 - (scaled.max(n) / self.last() - 1.0) / BEYOND).clamp(0.0, 1.0);
        let peak = [there.of(&self.tau_motor) * left, there.of(&self.tau_generator) * left];
        At {
            map: self,
            cell,
            reference: [cell.of(&self.tau_motor), cell.of(&self.tau_generator)],
            peak,
            continuous: there.of(&self.tau_continuous) * left,
        }
    }

    /// Drag torque (N.m) at the speed `w` (rad/s), against it.
    pub(super) fn drag(&self, w: f64) -> f64 {
        self.cell(w.abs()).of(&self.tau_drag) * (w / SLOW).clamp(-1.0, 1.0)
    }

    /// The maximum power at the shaft (W) with its speed (rad/s), and the best efficiency with its speed and torque (N.m), as a
    /// motor, at the points of the tables.
    pub fn best(&self) -> ([f64; 2], [f64; 3]) {
        let (mut power, mut best) = ([0.0; 2], [0.0; 3]);
        for k in 0..SPEEDS {
            let (n, peak) = (self.speed[k], self.tau_motor[k]);
            if n * peak > power[0] {
                power = [n * peak, n];
            }
            for j in HALF + 1..SHARES {
                let tau = peak * share(j);
                let efficiency = n * tau / (n * tau + self.p_loss[k][j]);
                if efficiency > best[0] {
                    best = [efficiency, n, tau];
                }
            }
        }
        (power, best)
    }

    /// A message about implausible losses; tables without any losses describe an ideal drive.
    pub(super) fn doubt(&self) -> Option<String> {
        let (_, [efficiency, n, tau]) = self.best();
        let [least, most] = EFFICIENCY;
        if (least..=most).contains(&efficiency) || self.p_loss.as_flattened().iter().all(|p| *p == 0.0) {
            return None;
        }
        let short = |x: f64| digits::text(x, 4, 1e6);
        let percent = |share: f64| short(100.0 * share);
        Some(format!(
            "the best efficiency of map.p_loss is {} %, at {} rad/s and {} N.m; that of a drive is between {} and {} %: check that \
             map.p_loss is in W, map.tau_motor in N.m and map.speed in rad/s",
            percent(efficiency),
            short(n),
            short(tau),
            percent(least),
            percent(most)
        ))
    }

    /// Refuses tables that describe no drive.
    ///
    /// # Errors
    /// The first value that is wrong, and what is allowed.
    pub(super) fn validate(&self) -> Result<(), Fault> {
        let element = |name: &str, k: usize| format!("map.{name}[{}]", k + 1);
        if self.speed[0] != 0.0 {
            return Err(Fault::value(&element("speed", 0), format!("{} rad/s", self.speed[0]), "0, the standstill"));
        }
        if let Some(k) = (1..SPEEDS).find(|&k| self.speed[k] <= self.speed[k - 1]) {
            let allowed = format!("greater than {} = {}", element("speed", k - 1), self.speed[k - 1]);
            return Err(Fault::value(&element("speed", k), format!("{} rad/s", self.speed[k]), allowed));
        }
        if let Some(k) = (0..SPEEDS).find(|&k| self.tau_continuous[k] > self.tau_motor[k].max(self.tau_generator[k])) {
            let allowed = format!("at most the peak torque {} N.m", self.tau_motor[k].max(self.tau_generator[k]));
            let value = format!("{} N.m", self.tau_continuous[k]);
            return Err(Fault::value(&element("tau_continuous", k), value, allowed));
        }
        let Self { u_min, u_dc, u_max, .. } = *self;
        if !(u_min <= u_dc && u_dc <= u_max) {
            return Err(Fault::value(
                "map.u_dc",
                format!("{u_dc} V"),
                format!("map.u_min = {u_min} to map.u_max = {u_max}"),
            ));
        }
        Ok(())
    }
}

impl At<'_> {
    /// Losses in W at the torque `tau` (N.m) of the direction of rotation.
    pub(super) fn loss(&self, tau: f64) -> f64 {
        let side = usize::from(tau < 0.0);
        let (limit, most) = (self.reference[side], self.reference[side].max(self.peak[side]));
        let x = if limit > 0.0 { tau.clamp(-most, most) / limit } else { 0.0 };
        let inside = x.clamp(-1.0, 1.0);
        let loss = self.read(inside);
        if x.abs() <= 1.0 {
            return loss;
        }
        let idle = self.read(0.0);
        idle + (loss - idle) * x * x
    }

    /// Losses in W at a share of the peak torque.
    fn read(&self, x: f64) -> f64 {
        let Cell { k, by } = self.cell;
        let [one, two] = [k, k + 1].map(|k| along(&self.map.p_loss[k], x));
        one + (two - one) * by
    }
}

/// Half of the columns: those of one sign, with 0.
const HALF: usize = SHARES / 2;

/// A row of losses at the share `x` of the peak torque: per sign a cubic Hermite spline with the slopes of parabolas through
/// three points, which is exact for losses a + b x + c x^2, and at least 0.
fn along(row: &[f64; SHARES], x: f64) -> f64 {
    let at = |j: usize| row[if x < 0.0 { HALF - j } else { HALF + j }];
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let place = x.abs() * HALF as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to HALF - 1")]
    let j = (place as usize).min(HALF - 1);
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let t = place - j as f64;
    let slope = |j: usize| match j {
        0 => 2.0 * at(1) - 1.5 * at(0) - 0.5 * at(2),
        HALF => 1.5 * at(HALF) - 2.0 * at(HALF - 1) + 0.5 * at(HALF - 2),
        _ => 0.5 * (at(j + 1) - at(j - 1)),
    };
    let (from, to, of, at_end) = (at(j), at(j + 1), slope(j), slope(j + 1));
    let rise = to - from;
    (from + t * (of + t * (3.0 * rise - 2.0 * of - at_end + t * (of + at_end - 2.0 * rise)))).max(0.0)
}

type P = Row<Map>;

/// Variables of the tables; their owner supplies the prefix `map.`.
pub(super) const MAP: &Table<Map> = table![
    P::parameter("u_dc", &VOLT, "DC-link voltage of the tables; at another, the torque is read at the speed times u_dc of the tables / u_dc", |p| {
        &mut p.u_dc
    })
    .above(0.0),
    P::parameter("u_min", &VOLT, "Minimum DC-link voltage; below it the drive is off", |p| &mut p.u_min).at_least(0.0),
    P::parameter("u_max", &VOLT, "Maximum DC-link voltage; above it the drive is off", |p| &mut p.u_max).above(0.0),
    P::array_parameter("speed", &SPEED, "Speeds of all tables: 0, then increasing; no torque above the last", SPEEDS, |p| {
        &mut p.speed
    })
    .at_least(0.0),
    P::array_parameter("tau_motor", &NEWTON_METER, "Peak torque at the shaft as a motor, over map.speed", SPEEDS, |p| {
        &mut p.tau_motor
    })
    .at_least(0.0),
    P::array_parameter(
        "tau_generator",
        &NEWTON_METER,
        "Peak torque at the shaft as a generator, over map.speed, positive",
        SPEEDS,
        |p| &mut p.tau_generator,
    )
    .at_least(0.0),
    P::array_parameter(
        "tau_continuous",
        &NEWTON_METER,
        "Continuous torque at the shaft, over map.speed",
        SPEEDS,
        |p| &mut p.tau_continuous,
    )
    .at_least(0.0),
    P::array_parameter(
        "tau_drag",
        &NEWTON_METER,
        "Drag torque of the shaft with the gates off, over map.speed; it falls to 0 below 1 rad/s",
        SPEEDS,
        |p| &mut p.tau_drag,
    )
    .at_least(0.0),
    P::array_parameter(
        "p_loss",
        &WATT,
        "Losses of motor and inverter: a row for each of map.speed, with the torque from -1 to 1 times the peak torque in steps of 0.1",
        SPEEDS * SHARES,
        |p| p.p_loss.as_flattened_mut(),
    )
    .at_least(0.0),
    P::parameter(
        "t_overload",
        &SECOND,
        "Time constant of overload; 0: the peak torque is available at any time",
        |p| &mut p.t_overload,
    )
    .at_least(0.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Losses that are linear in the speed and a parabola of the share are exact.
    #[test]
    fn lines_and_parabolas_are_exact() {
        let mut map = Map { tau_motor: [8.0; SPEEDS], tau_generator: [4.0; SPEEDS], ..Map::default() };
        for k in 0..SPEEDS {
            for j in 0..SHARES {
                map.p_loss[k][j] = 40.0 + 0.1 * map.speed[k] + 20.0 * share(j) + 70.0 * share(j) * share(j);
            }
        }
        for n in [0.0, 3.0, 25.0, 260.0, 499.9, 500.0] {
            let at = map.at(n, map.u_dc);
            for (tau, x) in [(-4.0, -1.0), (-1.0, -0.25), (0.0, 0.0), (3.3, 3.3 / 8.0), (8.0, 1.0)] {
                assert!(
                    (at.loss(tau) - (40.0 + 0.1 * n + 20.0 * x + 70.0 * x * x)).abs() < 1e-9,
                    "{n} rad/s, {tau} N.m"
                );
            }
            assert!((at.peak[0] - 8.0).abs() < 1e-12 && (at.peak[1] - 4.0).abs() < 1e-12);
        }
        // No torque beyond the last speed.
        assert!(map.at(510.0, map.u_dc).peak[0].abs() < 1e-12);
    }

    #[test]
    fn half_the_voltage_halves_the_speed_of_the_envelope() {
        let map = Map::default();
        for n in [20.0, 130.0, 249.0] {
            let (half, whole) = (map.at(n, 0.5 * map.u_dc), map.at(2.0 * n, map.u_dc));
            assert!((half.peak[0] - whole.peak[0]).abs() < 1e-12);
            // The losses are those of the speed itself.
            assert!((half.loss(1.0) - map.at(n, map.u_dc).loss(1.0)).abs() < 1e-12);
        }
        // With more voltage there is more torque; its losses continue the table without a step.
        let at = map.at(400.0, 2.0 * map.u_dc);
        assert!((at.peak[0] - 6.0).abs() < 1e-12);
        assert!((at.loss(3.0 + 1e-9) - at.loss(3.0)).abs() < 1e-6 && at.loss(6.0) > at.loss(3.0) + 300.0);
    }

    /// A torque of 1 N.m beyond a peak of 0.006 N.m would have 27,778 times the losses of that peak.
    #[test]
    fn a_torque_that_falls_to_its_limit_has_the_losses_of_the_limit() {
        let map = Map { tau_motor: [6e-3; SPEEDS], ..Map::default() };
        let at = map.at(1.0, map.u_dc);
        assert!((at.loss(1.0) - at.loss(6e-3)).abs() < 1e-12, "{} W", at.loss(1.0));
        assert!(at.loss(-7.0) > at.loss(-1.0) && (at.loss(-7.0) - at.loss(-6.0)).abs() < 1e-12);
    }

    #[test]
    fn losses_in_another_unit_are_doubted() {
        let scaled = |by: f64| {
            let mut map = Map::default();
            map.p_loss.as_flattened_mut().iter_mut().for_each(|p| *p *= by);
            map.doubt()
        };
        for by in [0.0, 0.1, 1.0, 10.0] {
            assert_eq!(scaled(by), None, "{by}");
        }
        assert!(scaled(1e-3).unwrap().contains("is 99.9"));
        assert!(scaled(1e3).unwrap().contains("map.p_loss is in W"));
    }

    #[test]
    fn tables_that_describe_no_drive_are_refused() {
        let refused = |change: fn(&mut Map)| {
            let mut map = Map::default();
            change(&mut map);
            map.validate().unwrap_err().to_string()
        };
        Map::default().validate().unwrap();
        assert_eq!(refused(|m| m.speed[0] = 1.0), "map.speed[1] = 1 rad/s is not allowed: 0, the standstill");
        assert!(
            refused(|m| m.speed[4] = 75.0)
                .starts_with("map.speed[5] = 75 rad/s is not allowed: greater than map.speed[4]")
        );
        assert!(
            refused(|m| m.tau_continuous[2] = 7.0)
                .contains("map.tau_continuous[3] = 7 N.m is not allowed: at most the peak torque 6")
        );
        assert!(refused(|m| m.u_min = 400.0).contains("map.u_dc = 325 V is not allowed: map.u_min = 400"));
    }
}
