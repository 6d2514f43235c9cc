//! Recordings: sampled variables.

use fmu_core::digits;
use fmu_import::csv::Writer;
use fmu_import::{Number, printable};
use model_description::DisplayUnit;
use std::io::{self, Write};

/// A recorded variable.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// `instance.variable`.
    pub name: String,
    /// Physical quantity in words, such as `Angular velocity`; empty if the description does not give it.
    pub quantity: String,
    /// Unit; empty if there is none.
    pub unit: String,
    /// Display unit.
    pub display: Option<DisplayUnit>,
    /// Numbers and names of an enumeration's values; empty for other types.
    pub items: Vec<(i64, String)>,
    /// One value for each communication point, as a double for computations and plots.
    pub values: Vec<f64>,
    /// Values in the type of the variable, where doubles lose information: for integers, and for a variable without a value
    /// until its clock ticks. Empty for others.
    pub exact: Vec<Number>,
}

impl Column {
    fn push(&mut self, x: Number) {
        self.values.push(x.real());
        if !self.exact.is_empty() || matches!(x, Number::Integer(_) | Number::Missing) {
            self.exact.push(x);
        }
    }

    /// The value at a communication point, with all its digits.
    pub fn at(&self, point: usize) -> Number {
        self.exact
            .get(point)
            .copied()
            .unwrap_or_else(|| self.values.get(point).map_or(Number::Missing, |x| Number::Real(*x)))
    }

    /// The last value.
    pub fn last(&self) -> Number {
        self.at(self.values.len().saturating_sub(1))
    }

    /// The unit to show the values in.
    pub fn shown_unit(&self) -> &str {
        self.display.as_ref().map_or(&self.unit, |display| &display.name)
    }

    /// Whether the value changes between the first and the last communication point.
    pub fn moves(&self) -> bool {
        self.values.iter().any(|x| x.to_bits() != self.values[0].to_bits())
    }

    /// The name of the enumeration's value `x`.
    pub fn item(&self, x: f64) -> Option<&str> {
        item(&self.items, x)
    }
}

/// A recorded text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TextColumn {
    /// `instance.variable`.
    pub name: String,
    /// One text for each communication point.
    pub values: Vec<String>,
}

/// Columns over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// The communication points in s.
    pub time: Vec<f64>,
    /// The recorded variables, in the order of the requests.
    pub columns: Vec<Column>,
    /// The recorded texts, in the order of the requests.
    pub texts: Vec<TextColumn>,
    /// The instance that requested the end of the simulation, if any.
    pub ended_by: Option<String>,
}

impl Recording {
    pub(super) fn new(columns: impl Iterator<Item = Column>) -> Self {
        Self { columns: columns.collect(), ..Self::default() }
    }

    pub(super) fn push(&mut self, time: f64, row: &[Number]) {
        self.time.push(time);
        self.columns.iter_mut().zip(row).for_each(|(column, x)| column.push(*x));
    }

    /// The column of this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.name == name)
    }

    /// Comma-separated, one header line; every number reads back to the same double. Texts follow the numbers. Names and texts
    /// are in quotation marks where needed (RFC 4180); control characters of names are escaped, as a terminal shows them.
    ///
    /// # Errors
    /// As the writer's.
    pub fn write_csv(&self, out: &mut impl Write) -> io::Result<()> {
        let columns = self.columns.iter().map(|c| c.name.as_str()).chain(self.texts.iter().map(|c| c.name.as_str()));
        let mut out = Writer::new(out);
        out.row(std::iter::once("time").chain(columns).map(|name| printable(name).into_owned()))?;
        for (k, t) in self.time.iter().enumerate() {
            let numbers = self.columns.iter().map(|c| c.at(k).to_string());
            out.row([t.to_string()].into_iter().chain(numbers).chain(self.texts.iter().map(|c| c.values[k].clone())))?;
        }
        out.finish()
    }

    /// The last values as a table, with the display unit, if any.
    pub fn last_values(&self) -> String {
        // Longer names of other tools misalign only their own row.
        let texts = || self.texts.iter().filter_map(|c| Some((c.name.as_str(), c.values.last()?)));
        let names = self.columns.iter().map(|c| c.name.as_str()).chain(texts().map(|(name, _)| name));
        let width = names.map(str::len).max().unwrap_or(0).min(200);
        let row = |c: &Column| {
            let (x, last) = (c.last().real(), c.last());
            let value = match last {
                Number::Integer(_) | Number::Missing => last.to_string(),
                _ => six(x),
            };
            let value = c.item(x).map_or(value, str::to_owned);
            let shown = c.display.as_ref().map(|d| format!("  = {} {}", six(d.show(x)), d.name));
            format!("{:width$}  {:>12} {}{}", c.name, value, c.unit, shown.unwrap_or_default()).trim_end().to_owned()
        };
        let text = |(name, value): (&str, &String)| format!("{name:width$}  {value:?}");
        let rows: Vec<String> = self.columns.iter().map(row).chain(texts().map(text)).collect();
        let time = self.time.last().copied().unwrap_or(f64::NAN);
        format!("{:width$}  {:>12} s\n{}", "time", six(time), rows.join("\n"))
    }
}

/// The name of the value `x` of an enumeration.
pub fn item(items: &[(i64, String)], x: f64) -> Option<&str> {
    #[expect(clippy::cast_precision_loss, reason = "as in the column")]
    let named = items.iter().find(|(value, _)| (*value as f64).to_bits() == x.to_bits());
    named.map(|(_, name)| name.as_str())
}

/// A number with six digits.
fn six(x: f64) -> String {
    digits::text(x, 6, 1e7)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording() -> Recording {
        let display =
            Some(DisplayUnit { name: "rpm".into(), factor: 30.0 / std::f64::consts::PI, offset: 0.0, inverse: false });
        let speed = Column { name: "p.speed".into(), unit: "rad/s".into(), display, ..Column::default() };
        let mut recording = Recording::new([speed].into_iter());
        recording.push(0.0, &[Number::Real(0.1 + 0.2)]);
        recording.push(1e-4, &[Number::Real(104.719_755_119_659_77)]);
        recording
    }

    #[test]
    fn csv_keeps_every_bit() {
        let mut text = Vec::new();
        recording().write_csv(&mut text).unwrap();
        assert_eq!(text, b"time,p.speed\n0,0.30000000000000004\n0.0001,104.71975511965977\n");
    }

    #[test]
    fn texts_follow_the_numbers() {
        let mut recording = recording();
        let values = vec!["off".into(), "a \"b\", c\nd".into()];
        recording.texts.push(TextColumn { name: "p.status".into(), values });
        let mut text = Vec::new();
        recording.write_csv(&mut text).unwrap();
        let expected = "time,p.speed,p.status\n0,0.30000000000000004,off\n\
                        0.0001,104.71975511965977,\"a \"\"b\"\", c\nd\"\n";
        assert_eq!(String::from_utf8(text).unwrap(), expected);
        assert!(recording.last_values().ends_with("\np.status  \"a \\\"b\\\", c\\nd\""), "{}", recording.last_values());
    }

    #[test]
    fn names_command_no_terminal_and_break_no_row() {
        let column = |name: &str| Column { name: name.into(), ..Column::default() };
        let mut recording = Recording::new([column("p.a\u{1b}[2J\n"), column("p.b[1,2]")].into_iter());
        recording.push(0.0, &[Number::Real(1.0), Number::Integer(2)]);
        let mut text = Vec::new();
        recording.write_csv(&mut text).unwrap();
        assert_eq!(String::from_utf8(text).unwrap(), "time,p.a\\u{1b}[2J\\u{a},\"p.b[1,2]\"\n0,1,2\n");
    }

    #[test]
    fn last_values_are_for_people() {
        let mut recording = recording();
        let items = vec![(1, "Off".into()), (2, "Network".into())];
        let mode = Column { name: "p.mode".into(), items, values: vec![1.0, 2.0], ..Column::default() };
        recording.columns.push(mode);
        let mut count = Column { name: "p.count".into(), ..Column::default() };
        count.push(Number::Integer(0));
        count.push(Number::Integer(123_456_789));
        recording.columns.push(count);
        assert_eq!(
            recording.last_values(),
            "time           0.0001 s\np.speed        104.72 rad/s  = 1000 rpm\np.mode        Network\np.count     123456789"
        );
    }
}
