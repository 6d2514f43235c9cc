//! The speeds of the tables: as many as `MappedDrive` has, where straight lines between them miss least.
//!
//! From the first and the last speed on, the speed at which the straight lines miss peak torque or losses most is added, relative
//! to the maximum of each. With fewer speeds than the tables have, the widest intervals are halved.

use super::column::SpeedColumn;
use drive::mapped_drive::map::{SHARES, SPEEDS};

/// The column between two, at the position `by` from 0 to 1.
fn middle(a: &SpeedColumn, b: &SpeedColumn, by: f64) -> SpeedColumn {
    let mean = |x: f64, y: f64| x + (y - x) * by;
    SpeedColumn {
        speed: mean(a.speed, b.speed),
        peak: [mean(a.peak[0], b.peak[0]), mean(a.peak[1], b.peak[1])],
        continuous: mean(a.continuous, b.continuous),
        drag: mean(a.drag, b.drag),
        losses: std::array::from_fn(|j| mean(a.losses[j], b.losses[j])),
    }
}

/// Quantities of a column that the lines shall meet.
fn quantities(column: &SpeedColumn) -> impl Iterator<Item = f64> {
    column.peak.into_iter().chain([column.continuous]).chain(column.losses)
}

/// The columns of the tables.
pub fn reduce(columns: &[SpeedColumn]) -> Vec<SpeedColumn> {
    let mut all = columns.to_vec();
    while all.len() < SPEEDS {
        let widths = all.windows(2).map(|pair| pair[1].speed - pair[0].speed).enumerate();
        let widest = widths.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(k, _)| k);
        all.insert(widest + 1, middle(&all[widest], &all[widest + 1], 0.5));
    }
    let mut scale = vec![1e-12_f64; SHARES + 3];
    for column in &all {
        scale.iter_mut().zip(quantities(column)).for_each(|(most, x)| *most = most.max(x));
    }
    let mut chosen = vec![0, all.len() - 1];
    while chosen.len() < SPEEDS {
        let mut worst = (0.0, 0);
        for pair in chosen.windows(2) {
            let [from, to] = [&all[pair[0]], &all[pair[1]]];
            for (k, column) in all.iter().enumerate().take(pair[1]).skip(pair[0] + 1) {
                let by = (column.speed - from.speed) / (to.speed - from.speed);
                let line = middle(from, to, by);
                let errors =
                    quantities(&line).zip(quantities(column)).zip(&scale).map(|((a, b), most)| (a - b).abs() / most);
                // Straight curves need no speed, but the tables have one: the widest interval gets it.
                let error = errors.fold(1e-9 * (to.speed - from.speed) * by * (1.0 - by), f64::max);
                if error > worst.0 {
                    worst = (error, k);
                }
            }
        }
        chosen.push(worst.1);
        chosen.sort_unstable();
    }
    chosen.into_iter().map(|k| all[k].clone()).collect()
}
