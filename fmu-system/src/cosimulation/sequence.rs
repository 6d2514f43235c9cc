//! User input of values over time, for an input of any type; each value is held from its time on.

use super::schedule::{SAME, Schedule, last_before};
use fmu_import::csv::{Heading, Table};
use fmu_import::{Number, Values};
use model_description::{ModelDescription, ModelVariable};
use std::path::Path;
use std::sync::Arc;

/// Integers up to this one are doubles.
const EXACT: u128 = 1 << 53;

/// Texts over time: values of a variable whose type is not yet known.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// Time (s), text, and its location in the file.
    points: Vec<(f64, String, String)>,
    /// Unit of all values; empty means the variable's unit.
    unit: String,
}

impl Sequence {
    /// `0:off,0.5:on`, with spaces between the elements of an array; a text without a time is a constant. A comma begins a point
    /// only if a time and a colon follow it.
    ///
    /// # Errors
    /// Names the text that is not a point, or the times that do not increase.
    pub fn parse(text: &str) -> Result<Self, String> {
        let time = |part: &str| part.split_once(':').and_then(|(t, _)| t.trim().parse::<f64>().ok());
        if time(text).is_none() {
            return Self::new(vec![(0.0, text.to_owned(), String::new())], String::new());
        }
        let mut points: Vec<(f64, String, String)> = Vec::new();
        for part in text.split(',') {
            match (time(part), points.last_mut()) {
                (Some(t), _) => {
                    points.push((t, part.split_once(':').map_or("", |(_, x)| x).to_owned(), String::new()));
                }
                (None, Some((_, last, _))) => *last = format!("{last},{part}"),
                (None, None) => {}
            }
        }
        Self::new(points, String::new())
    }

    /// The columns of a CSV file: the first is time in s, or in another unit as in `time [ms]` or `time_ms`; the header of each
    /// other names its input, as in `speed_ref` or `speed_ref [rpm]`. A header for which `known` is true is the name of a variable
    /// and has no unit. A cell may be in quotation marks (RFC 4180).
    ///
    /// # Errors
    /// The file cannot be read, has no header, its first column is not time, or a row does not have as many cells as the header.
    pub fn read_csv(path: &Path, known: impl Fn(&str) -> bool) -> Result<Vec<(String, Self)>, String> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        Self::parse_csv(&text, known).map_err(|cause| format!("{}: {cause}", path.display()))
    }

    /// [`read_csv`](Self::read_csv) of the content of a file.
    fn parse_csv(text: &str, known: impl Fn(&str) -> bool) -> Result<Vec<(String, Self)>, String> {
        let Table { headings, rows } = Table::parse(text)?;
        let mut headings = headings.into_iter();
        let time = headings.next().ok_or("has no column")?;
        let headings: Vec<Heading> = headings.map(|heading| heading.among(&known)).collect();
        if headings.is_empty() {
            return Err("has no column but time".into());
        }
        let other = headings.iter().find(|other| other.is_time() && !known(&other.name));
        if !time.is_time() && (known(&time.text) || other.is_some()) {
            let what = other.map_or("is a variable", |_| "is not time, and a later one is");
            return Err(format!("line 1: the first column, {}, {what}: write time first", time.text));
        }
        let second = time.seconds().map_err(|cause| format!("line 1: {cause}"))?;
        let mut columns: Vec<Vec<(f64, String, String)>> = vec![Vec::new(); headings.len()];
        for (line, row) in rows {
            let at = format!("line {line}: ");
            let mut row = row.into_iter();
            let time = row.next().unwrap_or_default();
            let t = time.parse::<f64>().map_err(|_| format!("{at}{time:?} is not a number"))?;
            columns.iter_mut().zip(row).for_each(|(column, cell)| column.push((t * second, cell, at.clone())));
        }
        let column = |(heading, points): (Heading, Vec<_>)| Ok((heading.name, Self::new(points, heading.unit)?));
        headings.into_iter().zip(columns).map(column).collect()
    }

    /// The last time (s).
    pub fn end(&self) -> f64 {
        self.points.last().map_or(0.0, |(t, ..)| *t)
    }

    fn new(points: Vec<(f64, String, String)>, unit: String) -> Result<Self, String> {
        if points.is_empty() {
            return Err("has no point".into());
        }
        if let Some((t, x, _)) = points.iter().find(|(t, ..)| !t.is_finite()) {
            return Err(format!("{t}:{x} is not finite"));
        }
        match points.windows(2).find(|pair| pair[1].0 < pair[0].0) {
            Some(pair) => Err(format!("the time {} does not follow {}", pair[1].0, pair[0].0)),
            None => Ok(Self { points, unit }),
        }
    }

    /// Whether the values have a unit that differs from the variable's.
    pub(crate) fn has_unit(&self) -> bool {
        !self.unit.is_empty()
    }

    /// All texts, changed.
    pub(crate) fn through<E>(&self, change: impl Fn(&str) -> Result<String, E>) -> Result<Self, E> {
        let one = |(t, text, at): &(f64, String, String)| Ok((*t, change(text)?, at.clone()));
        Ok(Self { points: self.points.iter().map(one).collect::<Result<_, E>>()?, unit: self.unit.clone() })
    }

    /// The texts as numbers, connected by lines; a time that occurs twice is a jump.
    ///
    /// # Errors
    /// Names the first text that is not a number, and its line.
    pub fn lines(&self) -> Result<Schedule, String> {
        let number = |(t, text, at): &(f64, String, String)| {
            let what = if text.is_empty() { "a cell is empty".into() } else { format!("{text:?} is not a number") };
            text.parse().map(|x| (*t, x)).map_err(|_| format!("{at}{what}"))
        };
        let points = self.points.iter().map(number).collect::<Result<Vec<_>, _>>()?;
        Schedule::jumping(points, &self.unit)
    }

    /// The text at time `t` (s); before the first time, the first text.
    pub fn at(&self, t: f64) -> &str {
        let until = self.points.partition_point(|(time, ..)| *time <= t + SAME);
        &self.points[until.saturating_sub(1)].1
    }

    /// The texts as numbers of this variable, in its unit: real numbers interpolated linearly, others held until the next.
    ///
    /// # Errors
    /// Names the first text that is not a value of the variable, or a unit.
    pub fn schedule(&self, variable: &ModelVariable, description: &ModelDescription) -> Result<Schedule, String> {
        if variable.base.is_float() {
            return self.lines()?.in_unit_of(variable, description);
        }
        self.values(variable, description)?.steps().ok_or_else(|| "is not one number".to_owned())
    }

    /// The texts as values of this variable.
    pub(super) fn values(&self, variable: &ModelVariable, description: &ModelDescription) -> Result<Held, String> {
        let unit = self.unit.as_str();
        if !unit.is_empty() && !variable.base.is_float() {
            return Err(format!("is a {} without a unit, and its column has the unit {unit}", variable.base));
        }
        let value = |(t, text, at): &(f64, String, String)| {
            let with_unit = || text.split_whitespace().map(|x| format!("{x} {unit}")).collect::<Vec<_>>().join(",");
            let text = if unit.is_empty() { text.clone() } else { with_unit() };
            let values = Values::read(&text, variable, description).map_err(|cause| format!("{at}{cause}"));
            values.map(|values| (*t, values))
        };
        Ok(Held(self.points.iter().map(value).collect::<Result<_, _>>()?))
    }
}

/// Values over time, each held until the next one.
#[derive(Clone, Debug)]
pub(super) struct Held(Arc<[(f64, Values)]>);

impl Held {
    /// Number of the value at time `t` (s); before the first time, that of the first value.
    pub(super) fn index(&self, t: f64) -> usize {
        last_before(&self.0, t).saturating_sub(1)
    }

    /// Converts the sequence to steps, if every value is one number that a double represents exactly.
    pub(super) fn steps(&self) -> Option<Schedule> {
        let mut points: Vec<(f64, f64)> = Vec::new();
        for (t, values) in &*self.0 {
            let x = match values.one(0) {
                Number::Missing => None,
                // More digits than those of a double.
                Number::Integer(i) if i.unsigned_abs() > EXACT => None,
                number => Some(number.real()),
            };
            let x = x.filter(|_| values.len() == 1)?;
            // If several values have the same time, the last one applies.
            points.pop_if(|(last, _)| last.to_bits() == t.to_bits());
            points.push((*t, x));
        }
        Schedule::steps(points).ok()
    }

    pub(super) fn value(&self, index: usize) -> &Values {
        &self.0[index].1
    }

    /// Time (s) of the first value after `t`.
    pub(super) fn times(&self) -> impl Iterator<Item = f64> {
        self.0.iter().skip(1).map(|(t, _)| *t)
    }

    pub(super) fn next_point(&self, t: f64) -> Option<f64> {
        self.0.get(last_before(&self.0, t)).map(|(time, _)| *time)
    }

    /// Whether every value has this many elements.
    pub(super) fn fits(&self, count: usize) -> bool {
        self.0.iter().all(|(_, values)| values.len() == count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn csv(text: &str) -> Result<Vec<(String, Sequence)>, String> {
        Sequence::parse_csv(text, |name| name.starts_with("known"))
    }

    fn points(text: &str) -> Vec<(f64, String)> {
        Sequence::parse(text).unwrap().points.into_iter().map(|(t, x, _)| (t, x)).collect()
    }

    #[test]
    fn a_comma_begins_a_point_only_before_a_time() {
        assert_eq!(points("off"), [(0.0, "off".into())]);
        assert_eq!(points("0:off, and on,0.5:on: now"), [(0.0, "off, and on".into()), (0.5, "on: now".into())]);
        assert_eq!(points("1: 1 2 3"), [(1.0, " 1 2 3".into())]);
        assert!(Sequence::parse("1:a,0:b").unwrap_err().contains("does not follow"));
    }

    #[test]
    fn cells_may_be_quoted() {
        let columns = csv("time,\"a\",P[1]\n0,\"x, \"\"y\"\"\",1 2\n1,,3\n").unwrap();
        assert_eq!((columns[0].0.as_str(), columns[1].0.as_str()), ("a", "P[1]"));
        let texts: Vec<&str> = columns[0].1.points.iter().map(|(_, x, _)| x.as_str()).collect();
        assert_eq!(texts, ["x, \"y\"", ""]);
        assert_eq!(columns[0].1.lines().unwrap_err(), "line 2: \"x, \\\"y\\\"\" is not a number");
    }

    #[test]
    fn a_table_has_a_column_for_each_input() {
        let lines = |text: &str| {
            let columns = csv(text)?.into_iter().map(|(name, texts)| Ok((name, texts.lines()?)));
            columns.collect::<Result<Vec<_>, String>>()
        };
        let columns = lines("\"time\",\"c.speed_ref\",p.tau_load\n0,0,0\n1,10,2\n").unwrap();
        assert_eq!(columns[0].0, "c.speed_ref");
        assert_eq!((columns[0].1.at(0.5), columns[1].1.at(0.5)), (5.0, 1.0));
        for (text, cause) in [
            ("time,a\n0\n", "line 2: expected 2 numbers, found 1"),
            ("time,a\n0,1,5\n", "line 2: expected 2 numbers, found 3; commas separate columns: write a decimal point"),
            ("time,a\n0,x\n", "line 2: \"x\" is not a number"),
            ("time,a\n0,\n", "line 2: a cell is empty"),
            ("time;a\n0;1,5\n", "line 1: has semicolons; write commas between columns and a decimal point"),
            (
                "time [kg],a\n0,1\n",
                "line 1: time [kg]: the first column is time, in s, ms, us, ns, min, h or d, as in time [ms]",
            ),
            ("known,a\n0,1\n", "line 1: the first column, known, is a variable: write time first"),
            ("a,time\n0,1\n", "line 1: the first column, a, is not time, and a later one is: write time first"),
        ] {
            assert_eq!(lines(text).unwrap_err(), cause, "{text:?}");
        }
    }

    #[test]
    fn the_first_column_is_converted_and_a_known_name_keeps_its_brackets() {
        let columns = csv("time_ms,known[mm],other [mm]\n0,1,2\n500,3,4\n").unwrap();
        let of = |k: usize| (columns[k].0.as_str(), columns[k].1.unit.as_str(), columns[k].1.end());
        assert_eq!((of(0), of(1)), (("known[mm]", "", 0.5), ("other", "mm", 0.5)));
        assert_eq!([0, 1].map(|k| columns[k].1.has_unit()), [false, true]);
    }
}
