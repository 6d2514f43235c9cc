//! Comparison of two runs: what is more than rounding.

/// Minimum scale of a deviation: anything far below it is noise around 0.
const MIN_SCALE: f64 = 1e-6;

/// Whether two vectors differ by more than rounding.
pub(super) fn differ(a: &[f64], b: &[f64]) -> bool {
    deviation(&[a.to_vec()], &[b.to_vec()]).is_some()
}

/// Where two trajectories differ by more than rounding.
pub(super) struct Deviation {
    /// The first such step, from 1.
    pub(super) step: usize,
    /// The largest difference in this step, relative to the largest value of the run.
    pub(super) largest: f64,
    /// The number of the value in its row, the one expected, and the one found; `None` if one trajectory is longer.
    values: Option<(usize, f64, f64)>,
}

impl Deviation {
    /// The value, with its name: `x is 2.0, expected 1.0`.
    pub(super) fn text(&self, names: &[String]) -> String {
        let Some((column, expected, found)) = self.values else { return "only one of the two runs continues".into() };
        let name = names.get(column).map_or("a value", String::as_str);
        format!("{name} is {found:?}, expected {expected:?}")
    }
}

/// Where two trajectories differ by more than rounding.
pub(super) fn deviation(a: &[Vec<f64>], b: &[Vec<f64>]) -> Option<Deviation> {
    if a.len() != b.len() {
        return Some(Deviation { step: a.len().min(b.len()) + 1, largest: f64::INFINITY, values: None });
    }
    let columns = a.first().map_or(0, Vec::len);
    let scale: Vec<f64> = (0..columns).map(|i| a.iter().map(|row| row[i].abs()).fold(0.0, f64::max)).collect();
    a.iter().zip(b).enumerate().find_map(|(k, (x, y))| {
        let differences = x.iter().zip(y).zip(&scale).map(|((x, y), scale)| {
            if x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan()) {
                0.0
            } else {
                let difference = (x - y).abs() / scale.max(MIN_SCALE);
                if difference.is_nan() { f64::INFINITY } else { difference }
            }
        });
        let (column, largest) = differences.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let values = Some((column, x[column], y[column]));
        (largest > 1e-9).then_some(Deviation { step: k + 1, largest, values })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_no_deviation() {
        let rows = |last: f64| [vec![1.0, 0.0], vec![2.0, last]];
        assert!(deviation(&rows(5.0), &rows(5.0)).is_none());
        assert!(deviation(&rows(5.0), &rows(5.0 + 4e-9)).is_none(), "below 1e-9 of the largest value");
        let found = deviation(&rows(5.0), &rows(5.0 + 1e-8)).unwrap();
        let Deviation { step, largest, .. } = found;
        assert_eq!(found.text(&["t".into(), "x".into()]), "x is 5.00000001, expected 5.0");
        assert!(step == 2 && (largest - 2e-9).abs() < 1e-12, "{step} {largest}");
        assert!(deviation(&rows(5.0), &rows(f64::NAN)).is_some_and(|d| d.step == 2 && d.largest.is_infinite()));
        assert!(deviation(&rows(f64::NAN), &rows(f64::NAN)).is_none());
        assert!(deviation(&rows(0.0), &rows(-8.7e-18)).is_none(), "noise about 0");
        assert!(deviation(&rows(5.0), &rows(5.0)[..1]).is_some_and(|d| d.step == 2 && d.largest.is_infinite()));
    }
}
