//! A table of numbers from a CSV file: a header with names, `#` before comments.

use crate::error::{Error, Result, WithContext, bail, ensure};
use fmu_import::csv::Table;
use std::path::Path;

/// The columns of a file.
#[derive(Clone, Debug)]
pub struct Columns {
    file: String,
    names: Vec<String>,
    /// Line in the file, and the numbers of a row.
    rows: Vec<(usize, Vec<f64>)>,
}

impl Columns {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or [`parse`](Self::parse) fails.
    pub fn read(path: &Path) -> Result<Self> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(|| format!("reading {file}"))?;
        Self::parse(&text, &file)
    }

    /// Reads the text of `file`.
    ///
    /// # Errors
    /// File and line, and what was expected: no header, semicolons, another number of cells than names, a cell that is not a
    /// finite number, no row.
    pub fn parse(text: &str, file: &str) -> Result<Self> {
        let (_, separator) = Table::of_instrument(text).map_err(|cause| Error::new(placed(file, &cause)))?;
        ensure!(separator == ',', "{file}:1: has semicolons or tabs; write commas between columns and a decimal point");
        Self::parse_some(text, file, |_| true)
    }

    /// Reads the columns of `file` whose header `wanted` accepts, between commas, semicolons or tabs. With semicolons or tabs, a
    /// number may have a decimal comma.
    ///
    /// # Errors
    /// Those of [`parse`](Self::parse), except that semicolons and the cells of other columns are allowed.
    pub fn parse_some(text: &str, file: &str, wanted: impl Fn(&str) -> bool) -> Result<Self> {
        let (table, separator) = Table::of_instrument(text).map_err(|cause| Error::new(placed(file, &cause)))?;
        let all: Vec<&str> = table.headings.iter().map(|heading| heading.text.as_str()).collect();
        let chosen: Vec<usize> = (0..all.len()).filter(|&k| wanted(all[k])).collect();
        let names: Vec<String> = chosen.iter().map(|&k| all[k].to_owned()).collect();
        let mut rows = Vec::new();
        for (line, cells) in &table.rows {
            let mut row = Vec::with_capacity(names.len());
            for &k in &chosen {
                let (cell, name) = (&cells[k], all[k]);
                let number = if separator == ',' { cell.parse() } else { cell.replace(',', ".").parse() };
                match number {
                    Ok(x) if f64::is_finite(x) => row.push(x),
                    _ => bail!("{file}:{line}:{name}: {cell:?} is not a finite number"),
                }
            }
            rows.push((usize::try_from(*line)?, row));
        }
        ensure!(!rows.is_empty(), "{file}: has no row of numbers below {}", all.join(","));
        Ok(Self { file: file.into(), names, rows })
    }

    /// A table of columns that are in memory; `name` stands for the file, and rows count from 1.
    ///
    /// # Errors
    /// Columns of different lengths, or a value that is not finite.
    pub fn of(name: &str, columns: &[(String, Vec<f64>)]) -> Result<Self> {
        let rows = columns.first().map_or(0, |(_, values)| values.len());
        for (column, values) in columns {
            ensure!(values.len() == rows, "{name}: {column} has {} values, the first column {rows}", values.len());
            if let Some(row) = values.iter().position(|x| !x.is_finite()) {
                bail!("{name}:{}:{column}: {} is not a finite number", row + 1, values[row]);
            }
        }
        let row = |k: usize| (k + 1, columns.iter().map(|(_, values)| values[k]).collect());
        Ok(Self {
            file: name.into(),
            names: columns.iter().map(|(column, _)| column.clone()).collect(),
            rows: (0..rows).map(row).collect(),
        })
    }

    /// Names of the columns that were read.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The file's name.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Line in the file, and the numbers of each row.
    pub fn rows(&self) -> &[(usize, Vec<f64>)] {
        &self.rows
    }

    /// Index of the column with this name, if any.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|found| found == name)
    }

    /// Place of a column in the rows.
    ///
    /// # Errors
    /// Names the columns that there are.
    pub fn column(&self, name: &str) -> Result<usize> {
        self.find(name)
            .with_context(|| format!("{}: has no column {name}; it has {}", self.file, self.names.join(", ")))
    }
}

/// `file:3: what is wrong`, from `line 3: what is wrong`.
fn placed(file: &str, cause: &str) -> String {
    let line = cause.strip_prefix("line ").and_then(|rest| rest.split_once(": "));
    line.map_or_else(|| format!("{file}: {cause}"), |(line, what)| format!("{file}:{line}: {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_and_what_is_none_is_refused() {
        let table = Columns::parse("# bench\n\na, b\n1,2\n# gap\n3 , -4e-3\n", "t.csv").unwrap();
        assert_eq!((table.column("b").unwrap(), table.find("c")), (1, None));
        assert_eq!(table.rows(), [(4, vec![1.0, 2.0]), (6, vec![3.0, -4e-3])]);
        assert_eq!(table.column("c").unwrap_err().to_string(), "t.csv: has no column c; it has a, b");
        for (text, message) in [
            ("# only\n", "t.csv: is empty"),
            ("a;b\n1;2\n", "t.csv:1: has semicolons"),
            ("1,2\n3,4\n", "t.csv:1: 1 is a number"),
            ("a,b\n", "t.csv: has no row of numbers below a,b"),
            ("a,b\n1\n", "t.csv:2: expected 2 numbers, found 1"),
            ("a,b\n1,x\n", "t.csv:2:b: \"x\" is not a finite number"),
            ("a,b\n1,NaN\n", "t.csv:2:b: \"NaN\" is not a finite number"),
        ] {
            let error = Columns::parse(text, "t.csv").unwrap_err().to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }
}
