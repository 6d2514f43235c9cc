//! What a person reads of all outputs: large groups that nothing happens in are left out.

use fmu_system::cosimulation::Recording;
use std::collections::BTreeMap;

/// Minimum number of outputs whose names begin with one word to form a group.
const GROUP: usize = 8;

/// Maximum number of outputs that the terminal shows with those that do not change.
const SHOWN: usize = 24;

/// The first word of a name, after the name of its instance, with what is before it.
fn word(name: &str, instances: &[&str]) -> String {
    let strip = |instance: &&str| name.strip_prefix(*instance)?.strip_prefix('.');
    let rest = instances.iter().find_map(strip).unwrap_or(name);
    let end = rest.find(['_', '.', '[']).map_or(name.len(), |end| name.len() - rest.len() + end + 1);
    name[..end].to_owned()
}

/// Removes groups of which no output changes in the run; returns a line that names them.
pub(super) fn leave_out(recording: &mut Recording, instances: &[&str]) -> Option<String> {
    let mut groups: BTreeMap<String, (usize, bool)> = BTreeMap::new();
    for column in &recording.columns {
        let (count, moves) = groups.entry(word(&column.name, instances)).or_default();
        *count += 1;
        *moves |= column.moves();
    }
    groups.retain(|_, (count, moves)| *count >= GROUP && !*moves);
    recording.columns.retain(|column| !groups.contains_key(&word(&column.name, instances)));
    let names: Vec<String> = groups.iter().map(|(word, (count, _))| format!("{word}* ({count} outputs)")).collect();
    (!names.is_empty()).then(|| {
        format!(
            "not recorded, because nothing changes there in this run: {}; --all records all outputs of each run",
            names.join(", ")
        )
    })
}

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
    fn a_large_group_at_rest_is_left_out() {
        let names = |last: f64| {
            let group = (0..9).map(move |k| (format!("d.cell[{k}]"), if k == 4 { last } else { 0.0 }));
            group.chain([("d.speed".to_owned(), 0.0), ("d.x_1".into(), 0.0)])
        };
        let mut rests = recording(names(0.0));
        let said = leave_out(&mut rests, &["d"]).unwrap();
        assert_eq!(
            said,
            "not recorded, because nothing changes there in this run: d.cell[* (9 outputs); --all records all outputs of each run"
        );
        let left: Vec<&str> = rests.columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(left, ["d.speed", "d.x_1"], "small groups stay");
        let mut moves = recording(names(1.0));
        assert_eq!((leave_out(&mut moves, &["d"]), moves.columns.len()), (None, 11), "one that changes keeps all");
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
