//! The last values that the terminal shows. Files have all outputs in every run, so that scripts find their columns.

use fmu_system::cosimulation::Recording;

/// Maximum number of outputs that the terminal shows with those that do not change.
const SHOWN: usize = 24;

/// Removes outputs that do not change, if there are many; returns a line that counts them.
pub(super) fn still(recording: &mut Recording) -> Option<String> {
    let all = recording.columns.len();
    if all > SHOWN {
        recording.columns.retain(fmu_system::cosimulation::Column::moves);
    }
    let gone = all - recording.columns.len();
    (gone > 0).then(|| format!("{gone} outputs without a change are not shown; --all shows all"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_system::cosimulation::Column;

    fn recording(names: impl Iterator<Item = (String, f64)>) -> Recording {
        let column = |(name, last)| Column { name, values: vec![0.0, last], ..Column::default() };
        Recording { time: vec![0.0, 1.0], columns: names.map(column).collect(), ..Recording::default() }
    }

    #[test]
    fn of_many_outputs_the_terminal_shows_those_that_change() {
        let names = |count: u32| (0..count).map(|k| (format!("x{k}"), f64::from(k % 2)));
        let (mut few, mut many) = (recording(names(24)), recording(names(26)));
        assert_eq!((still(&mut few), few.columns.len()), (None, 24));
        assert_eq!(still(&mut many).as_deref(), Some("13 outputs without a change are not shown; --all shows all"));
        assert_eq!(many.columns.len(), 13);
    }
}
