//! Warnings of FMUs in many runs.

use std::fmt::Display;

/// Number of rows in which FMUs warned, and the first of them with its warning.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Warned {
    /// Number of rows whose FMUs were asked for warnings.
    pub asked: u64,
    /// Number of rows with a warning.
    pub count: u64,
    /// The first row that warned.
    pub first: Option<(u64, String)>,
}

impl Warned {
    /// Whether the FMUs are asked for warnings in this row of `rows`: in all rows of a short sweep, and in one of 16 of a longer one,
    /// because an FMU may take a third of a short run to look for them.
    pub(crate) fn asks(row: u64, rows: u64) -> bool {
        rows <= 1000 || row.is_multiple_of(16)
    }

    pub(crate) fn add(&mut self, row: u64, warning: String) {
        self.count += 1;
        if self.first.as_ref().is_none_or(|(first, _)| row < *first) {
            self.first = Some((row, warning));
        }
    }

    /// A sentence about the warnings in `rows` rows, if there are any; `number` gives the number under which a row is known.
    pub fn sentence<N: Display>(&self, rows: u64, number: impl Fn(u64) -> N) -> Option<String> {
        let (row, warning) = self.first.as_ref()?;
        let Self { asked, count, .. } = self;
        let of = if *asked == rows { format!("{rows} rows") } else { format!("the {asked} checked rows") };
        Some(format!("{count} of {of} have warnings; the first, in row {}: {warning}", number(*row)))
    }
}
