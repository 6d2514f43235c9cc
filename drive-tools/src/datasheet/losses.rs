//! Losses over speed and torque, from the losses or the efficiencies of a data sheet.
//!
//! From an efficiency e follows the loss |tau w| (1/e - 1) of a motor, |tau w| (1 - e) of a generator. The losses without
//! torque, where the efficiency is 0/0, are given or extrapolated with a + b tau^2 from the two smallest torques, and so are cells
//! without a value beyond the envelope. At standstill, the losses are those of the lowest speed minus those without torque.

use super::file::{LossTable, RPM, curve, increasing};
use super::remarks::Remarks;
use crate::error::{Result, WithContext, bail, ensure};
use fmu_core::digits::rounded;

/// Losses in W on a grid.
#[derive(Clone, Debug)]
pub struct LossGrid {
    /// Speeds in rad/s, the first 0.
    pub speed: Vec<f64>,
    /// Torques in N.m, with 0.
    torque: Vec<f64>,
    /// A row per speed.
    loss: Vec<Vec<f64>>,
}

/// The place on an axis: the interval, and the position in it.
pub fn cell(axis: &[f64], x: f64) -> (usize, f64) {
    let k = axis.partition_point(|a| *a <= x).clamp(1, axis.len() - 1) - 1;
    (k, ((x - axis[k]) / (axis[k + 1] - axis[k])).clamp(0.0, 1.0))
}

/// The value at `x` of a curve over an axis, constant beyond its ends.
pub fn between(axis: &[f64], values: &[f64], x: f64) -> f64 {
    let (k, by) = cell(axis, x);
    values[k] + (values[k + 1] - values[k]) * by
}

/// a and b of a + b x^2 through two points, with a >= 0.
fn parabola([x_1, y_1]: [f64; 2], [x_2, y_2]: [f64; 2]) -> [f64; 2] {
    let b = (y_2 - y_1) / (x_2 * x_2 - x_1 * x_1);
    let a = y_1 - b * x_1 * x_1;
    if a >= 0.0 { [a, b] } else { [0.0, y_2 / (x_2 * x_2)] }
}

impl LossGrid {
    /// The grid of a table, and remarks.
    ///
    /// # Errors
    /// A value that is wrong, or missing.
    pub fn new(table: &LossTable) -> Result<(Self, Remarks)> {
        let speed = table.speeds()?;
        let torque = table.torque.as_ref().context("losses.torque is missing: the torques of the table in N.m")?;
        increasing("losses.torque", torque)?;
        ensure!(torque.iter().filter(|tau| **tau > 0.0).count() >= 2, "losses.torque needs at least 2 torques above 0");
        if let Some(no_load) = &table.no_load {
            curve("losses.no_load", no_load, ("losses.rpm or losses.speed", speed.len()))?;
        }
        let (key, rows) = match (&table.efficiency, &table.loss) {
            (Some(rows), None) => ("losses.efficiency", rows),
            (None, Some(rows)) => ("losses.loss", rows),
            _ => bail!("losses: give efficiency or loss, one of them"),
        };
        ensure!(rows.len() == speed.len(), "{key} has {} rows, but the table has {} speeds", rows.len(), speed.len());
        let mut said = Remarks::default();
        let mirrored = torque[0] >= 0.0;
        if mirrored {
            said.notes.push(
                "a generator loses as much as a motor at the same torque: losses.torque has no negative values".into(),
            );
        }
        let mut grid = Self { speed: Vec::new(), torque: Vec::new(), loss: Vec::new() };
        let (mut extrapolated, mut doubts) = (false, Vec::new());
        for (k, (row, n)) in rows.iter().zip(&speed).enumerate() {
            ensure!(
                row.len() == torque.len(),
                "{key}[{}] has {} values, but losses.torque has {}",
                k + 1,
                row.len(),
                torque.len()
            );
            let mut points = Vec::new();
            for (j, (value, tau)) in row.iter().zip(torque).enumerate() {
                let of = || format!("{key}[{}][{}] = {value} at {:.0} rpm, {tau} N.m", k + 1, j + 1, n / RPM);
                if value.is_nan() {
                    continue;
                }
                if table.loss.is_some() {
                    ensure!(*value >= 0.0 && value.is_finite(), "{} must be at least 0 W", of());
                    points.push([*tau, *value]);
                } else if n * tau != 0.0 {
                    ensure!(*value <= 1.0, "{} is greater than 1: write 94 % as 0.94", of());
                    ensure!(*value > 0.0, "{} must be greater than 0", of());
                    let power = (n * tau).abs();
                    points.push([*tau, power * if *tau > 0.0 { 1.0 / value - 1.0 } else { 1.0 - value }]);
                }
            }
            if points.is_empty() && *n == 0.0 {
                // The row of standstill follows from the next one.
                continue;
            }
            let no_load = table.no_load.as_ref().map(|all| all[k]);
            let (row, is_extrapolated) = completed(&points, torque, no_load)
                .with_context(|| format!("{key}[{}], at {:.0} rpm", k + 1, n / RPM))?;
            extrapolated |= is_extrapolated;
            doubts.extend(doubt(&points, no_load, n / RPM));
            let (torque, row) =
                if mirrored { mirror(&row) } else { row.iter().map(|[tau, loss]| (*tau, *loss)).unzip() };
            grid.torque = torque;
            grid.speed.push(*n);
            grid.loss.push(row);
        }
        if extrapolated {
            said.notes.push(
                "the losses at zero torque are extrapolated from the two smallest torques: give losses.no_load".into(),
            );
        }
        said.doubt_all(doubts);
        grid.stand();
        Ok((grid, said))
    }

    /// Adds the row of standstill.
    fn stand(&mut self) {
        if self.speed.first() == Some(&0.0) {
            return;
        }
        let idle = between(&self.torque, &self.loss[0], 0.0);
        let row = self.loss[0].iter().map(|loss| (loss - idle).max(0.0)).collect();
        self.speed.insert(0, 0.0);
        self.loss.insert(0, row);
    }

    /// The range of the torques in N.m.
    pub fn range(&self) -> [f64; 2] {
        [self.torque[0], self.torque[self.torque.len() - 1]]
    }

    /// Losses in W at a speed (rad/s) and a torque (N.m).
    pub fn at(&self, n: f64, tau: f64) -> f64 {
        let (k, by) = cell(&self.speed, n);
        let row = |k: usize| between(&self.torque, &self.loss[k], tau);
        row(k) + (row(k + 1) - row(k)) * by
    }
}

/// Torque and loss of a row for all of `torque` and for 0, and whether the loss at 0 is extrapolated.
fn completed(points: &[[f64; 2]], torque: &[f64], no_load: Option<f64>) -> Result<(Vec<[f64; 2]>, bool)> {
    let mut motor: Vec<[f64; 2]> = points.iter().copied().filter(|[tau, _]| *tau > 0.0).collect();
    let mut generator: Vec<[f64; 2]> = points.iter().rev().copied().filter(|[tau, _]| *tau < 0.0).collect();
    ensure!(motor.len() >= 2, "has fewer than 2 values at torques above 0");
    let given = points.iter().find(|[tau, _]| *tau == 0.0).map(|[_, loss]| *loss).or(no_load);
    let idle = given.unwrap_or_else(|| parabola(motor[0], motor[1])[0]);
    let beyond = |side: &[[f64; 2]], tau: f64| match side {
        [.., one, two] => {
            let [a, b] = parabola(*one, *two);
            (a + b * tau * tau).max(two[1])
        }
        [one] => idle + (one[1] - idle).max(0.0) * (tau / one[0]).powi(2),
        [] => idle,
    };
    let (of_motor, of_generator) = (motor.clone(), generator.clone());
    for tau in torque.iter().filter(|tau| !points.iter().any(|[known, _]| known.total_cmp(tau).is_eq()) && **tau != 0.0)
    {
        if *tau > 0.0 {
            motor.push([*tau, beyond(&of_motor, *tau)]);
        } else {
            let side = if of_generator.is_empty() { &of_motor } else { &of_generator };
            generator.push([*tau, beyond(side, *tau)]);
        }
    }
    let mut all: Vec<[f64; 2]> = generator.into_iter().chain([[0.0, idle]]).chain(motor).collect();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Ok((all, given.is_none()))
}

/// What is odd in the losses of a row, of torques and losses without those that were extrapolated: losses that fall while the torque
/// rises, or a loss at zero torque that the others do not lead to.
fn doubt(points: &[[f64; 2]], no_load: Option<f64>, rpm: f64) -> Option<String> {
    let motor: Vec<[f64; 2]> = points.iter().copied().filter(|[tau, _]| *tau > 0.0).collect();
    let generator: Vec<[f64; 2]> = points.iter().rev().copied().filter(|[tau, _]| *tau < 0.0).collect();
    let at = |[tau, loss]: [f64; 2]| format!("{} W at {tau} N.m", rounded(loss, 4));
    let falls =
        |side: &[[f64; 2]]| side.windows(2).find(|pair| pair[1][1] < 0.8 * pair[0][1]).map(|pair| [pair[0], pair[1]]);
    if let Some([one, two]) = falls(&motor).or_else(|| falls(&generator)) {
        return Some(format!("at {rpm:.0} rpm, the losses fall from {} to {}: check both values", at(one), at(two)));
    }
    let (no_load, [one, two, ..]) = (no_load?, &motor[..]) else { return None };
    let [idle, _] = parabola(*one, *two);
    (no_load > 1.2 * one[1] || no_load < 0.5 * idle).then(|| {
        format!(
            "losses.no_load is {} W at {rpm:.0} rpm, but {} and {} lead to {} W without torque",
            rounded(no_load, 4),
            at(*one),
            at(*two),
            rounded(idle, 4)
        )
    })
}

/// Torques and losses of a row with the same losses at negative torques.
fn mirror(row: &[[f64; 2]]) -> (Vec<f64>, Vec<f64>) {
    let negative = row.iter().rev().filter(|[tau, _]| *tau > 0.0).map(|[tau, loss]| (-tau, *loss));
    negative.chain(row.iter().map(|[tau, loss]| (*tau, *loss))).unzip()
}
