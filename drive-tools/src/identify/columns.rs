//! Columns of a record: their names, their units, and their headers.

use crate::csv::Columns;
use crate::error::{Result, WithContext, bail, ensure};
use serde::Deserialize;
use std::f64::consts::PI;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Time,
    Voltage,
    Current,
    Share,
    Angle,
    Speed,
    Torque,
    Flag,
}

/// The columns that a record may have.
const KNOWN: &[(&str, Kind)] = &[
    ("t", Kind::Time),
    ("u_a", Kind::Voltage),
    ("u_b", Kind::Voltage),
    ("u_c", Kind::Voltage),
    ("u_ab", Kind::Voltage),
    ("u_bc", Kind::Voltage),
    ("u_alpha", Kind::Voltage),
    ("u_beta", Kind::Voltage),
    ("u_d", Kind::Voltage),
    ("u_q", Kind::Voltage),
    ("d_a", Kind::Share),
    ("d_b", Kind::Share),
    ("d_c", Kind::Share),
    ("i_a", Kind::Current),
    ("i_b", Kind::Current),
    ("i_c", Kind::Current),
    ("i_alpha", Kind::Current),
    ("i_beta", Kind::Current),
    ("i_d", Kind::Current),
    ("i_q", Kind::Current),
    ("u_dc", Kind::Voltage),
    ("theta", Kind::Angle),
    ("angle", Kind::Angle),
    ("speed", Kind::Speed),
    ("tau_load", Kind::Torque),
    ("tau_shaft", Kind::Torque),
    ("enable", Kind::Flag),
];

impl Kind {
    /// Units without a prefix, with their size in SI; the first is assumed where a header has none.
    fn units(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Time => &[("s", 1.0)],
            Self::Voltage => &[("V", 1.0)],
            Self::Current => &[("A", 1.0)],
            Self::Share => &[("1", 1.0), ("%", 0.01)],
            Self::Angle => &[("rad", 1.0), ("deg", PI / 180.0)],
            Self::Speed => {
                &[("rad/s", 1.0), ("rpm", PI / 30.0), ("1/min", PI / 30.0), ("deg/s", PI / 180.0), ("1/s", 2.0 * PI)]
            }
            Self::Torque => &[("N.m", 1.0), ("Nm", 1.0)],
            Self::Flag => &[("1", 1.0)],
        }
    }

    /// The size of a unit, with or without a prefix, in SI.
    fn size(self, unit: &str) -> Option<f64> {
        let plain = |unit: &str| self.units().iter().find(|(name, _)| *name == unit).map(|(_, size)| *size);
        plain(unit).or_else(|| {
            let (prefix, size) = PREFIXES.iter().find(|(prefix, _)| unit.starts_with(prefix))?;
            Some(size * plain(unit.strip_prefix(prefix)?)?)
        })
    }
}

const PREFIXES: &[(&str, f64)] = &[("n", 1e-9), ("u", 1e-6), ("µ", 1e-6), ("m", 1e-3), ("k", 1e3), ("M", 1e6)];

/// The options that assign headers to columns and units to columns.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Naming {
    /// Column and header: `u_a` and `Vph1`.
    pub map: Vec<(String, String)>,
    /// Column and unit: `speed` and `rpm`.
    pub units: Vec<(String, String)>,
}

impl Naming {
    /// Checks the names of the options.
    ///
    /// # Errors
    /// Names a column that no record has.
    pub fn check(&self) -> Result<()> {
        for (option, name) in
            self.map.iter().map(|(n, _)| ("--map", n)).chain(self.units.iter().map(|(n, _)| ("--unit", n)))
        {
            let known = || KNOWN.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
            ensure!(
                KNOWN.iter().any(|(k, _)| k == name),
                "{option} {name}: a record has no such column: use one of {}",
                known()
            );
        }
        Ok(())
    }

    /// The column named by a header.
    fn column(&self, header: &str) -> Option<(&'static str, Kind)> {
        let name = split(header).0;
        let mapped = self.map.iter().find(|(_, from)| from == header || from == name).map(|(to, _)| to.as_str());
        let taken = self.map.iter().any(|(to, _)| to == name);
        let name = mapped.or((!taken).then_some(if name == "time" { "t" } else { name }))?;
        KNOWN.iter().find(|(known, _)| *known == name).copied()
    }
}

/// A header's name and unit: `i_a [mA]`.
fn split(header: &str) -> (&str, Option<&str>) {
    match header.split_once('[') {
        Some((name, unit)) => (name.trim(), unit.trim().strip_suffix(']').map(str::trim)),
        None => (header.trim(), None),
    }
}

/// The signals of a record in SI units.
#[derive(Clone, Debug)]
pub struct Signals {
    /// Name of the file.
    pub file: String,
    /// Line of each row in the file.
    pub lines: Vec<usize>,
    columns: Vec<(&'static str, Vec<f64>)>,
}

impl Signals {
    /// Reads the known columns of a file's text.
    ///
    /// # Errors
    /// The table cannot be read, two headers name the same column, a header of `--map` is missing, or a unit does not fit.
    pub fn parse(text: &str, file: &str, naming: &Naming) -> Result<Self> {
        Self::of(&Columns::parse_some(text, file, |header| naming.column(header).is_some())?, naming)
    }

    /// The known columns of a table.
    ///
    /// # Errors
    /// Those of [`parse`](Self::parse).
    pub fn of(table: &Columns, naming: &Naming) -> Result<Self> {
        naming.check()?;
        let file = table.file();
        let mut columns: Vec<(&'static str, Vec<f64>)> = Vec::new();
        for (place, header) in table.names().iter().enumerate() {
            let Some((name, kind)) = naming.column(header) else { continue };
            ensure!(columns.iter().all(|(n, _)| *n != name), "{file}: two columns contain {name}: remove one");
            let given = naming.units.iter().find(|(n, _)| n == name).map(|(_, unit)| unit.as_str());
            let size = match given.or(split(header).1) {
                None => 1.0,
                Some(unit) => kind.size(unit).with_context(|| {
                    let units = kind.units().iter().map(|(unit, _)| *unit).collect::<Vec<_>>().join(", ");
                    format!("{file}: {name} [{unit}]: the unit is not known; {name} has one of {units}, or one with a prefix")
                })?,
            };
            columns.push((name, table.rows().iter().map(|(_, row)| row[place] * size).collect()));
        }
        for (name, header) in &naming.map {
            ensure!(
                columns.iter().any(|(n, _)| n == name),
                "{file}: --map {name}={header}: the record has no column {header}"
            );
        }
        for (name, unit) in &naming.units {
            ensure!(
                columns.iter().any(|(n, _)| n == name),
                "{file}: --unit {name}={unit}: the record has no column {name}"
            );
        }
        Ok(Self { file: file.into(), lines: table.rows().iter().map(|(line, _)| *line).collect(), columns })
    }

    /// A signal, if the record has it.
    pub fn get(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(n, _)| *n == name).map(|(_, values)| values.as_slice())
    }

    /// Several signals, if the record has all of them.
    pub fn all<const N: usize>(&self, names: [&str; N]) -> Option<[&[f64]; N]> {
        let found = names.map(|name| self.get(name));
        found.iter().all(Option::is_some).then(|| found.map(Option::unwrap_or_default))
    }

    /// Names of the signals.
    pub fn names(&self) -> String {
        self.columns.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
    }

    /// Fails at a row: `FILE:ROW:COLUMN: problem; remedy`.
    ///
    /// # Errors
    /// Always.
    pub fn refuse<T>(&self, row: usize, column: &str, what: &str) -> Result<T> {
        bail!("{}:{}:{column}: {what}", self.file, self.lines.get(row).copied().unwrap_or(row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_have_units_and_options_name_columns() {
        let text = "time [ms];Vph1;i_a [mA];speed;note\n0,5;1,5;20;30;hello\n";
        let pairs = |list: &[(&str, &str)]| list.iter().map(|(a, b)| ((*a).into(), (*b).into())).collect();
        let naming = Naming { map: pairs(&[("u_a", "Vph1")]), units: pairs(&[("speed", "rpm")]) };
        let signals = Signals::parse(text, "r.csv", &naming).unwrap();
        assert_eq!(signals.names(), "t, u_a, i_a, speed");
        for (name, x) in [("t", 0.5e-3), ("u_a", 1.5), ("i_a", 20e-3), ("speed", PI)] {
            assert!((signals.get(name).unwrap()[0] - x).abs() < 1e-15, "{name}");
        }
        for (text, map, message) in [
            (
                "t,i_a [kg]\n0,1\n",
                None,
                "r.csv: i_a [kg]: the unit is not known; i_a has one of A, or one with a prefix",
            ),
            ("t,i_a,i_a\n0,1,1\n", None, "r.csv: two columns contain i_a"),
            ("t,x\n0,1\n", Some(("i_a", "y")), "r.csv: --map i_a=y: the record has no column y"),
            ("t,x\n0,1\n", Some(("amps", "x")), "--map amps: a record has no such column: use one of t, u_a,"),
        ] {
            let naming = Naming { map: pairs(map.as_slice()), units: Vec::new() };
            let error = Signals::parse(text, "r.csv", &naming).unwrap_err().to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }
}
