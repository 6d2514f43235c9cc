//! Rows of a design: each is a function only of the definition, the seed and its number, and is computed without the other
//! rows.

mod list;
mod normal;
mod random;
mod sobol;
mod vary;

use crate::Error;
use crate::definition::{Design, Kind, Vary};
use crate::error::invalid;
use crate::ordered::Ordered;
use fmu_import::Number;
use sobol::Dimension;
use std::path::Path;
use vary::Source;

/// Largest number of rows.
const MOST: u64 = 1 << 40;

/// The rows of a design.
#[derive(Clone, Debug, PartialEq)]
pub struct DesignRows {
    columns: Vec<(String, Column)>,
    count: u64,
    kind: Kind,
    seed: u64,
    /// Direction numbers of a Sobol design, for each column with its own dimension.
    dimensions: Vec<Dimension>,
    /// Rows of a list.
    list: Vec<Vec<Number>>,
}

#[derive(Clone, Debug, PartialEq)]
enum Column {
    /// The n-th column with its own dimension.
    Free { dimension: usize, source: Source },
    /// The n-th column of a list.
    Listed(usize),
    /// Another column times a factor.
    Tied { to: usize, times: f64 },
}

impl DesignRows {
    /// `known` is true for names of variables. `number` converts a text, such as `true` or the name of an enumeration item, to the
    /// number that the variable takes.
    ///
    /// # Errors
    /// The design or a varied variable is invalid, or the design has no rows.
    pub(crate) fn new(
        design: &Design,
        vary: &Ordered<Vary>,
        folder: &Path,
        known: &dyn Fn(&str) -> bool,
        number: &dyn Fn(&str, &str) -> Result<Number, String>,
    ) -> Result<Self, Error> {
        let kind = design.kind;
        let mut rows = Self { columns: Vec::new(), count: 0, kind, seed: 0, dimensions: Vec::new(), list: Vec::new() };
        match (&design.file, kind) {
            (Some(file), Kind::List) => {
                let (names, list) = list::read(&folder.join(file), known, number)?;
                rows.columns = names.into_iter().enumerate().map(|(k, name)| (name, Column::Listed(k))).collect();
                rows.list = list;
            }
            (None, Kind::List) => return invalid("design: kind = \"list\" needs file, a CSV file with a header"),
            (Some(_), _) => return invalid("design: file belongs to kind = \"list\""),
            (None, _) => {}
        }
        let mut free = 0;
        for (name, vary) in vary {
            let column = rows.column(vary, &mut free, &|text| number(name, text));
            let column = column.map_err(|cause| Error::Invalid(format!("vary: {name}: {cause}")))?;
            if rows.columns.iter().any(|(other, _)| other == name) {
                return invalid(format!("vary: {name} is already a column of the list"));
            }
            rows.columns.push((name.clone(), column));
        }
        if rows.columns.is_empty() {
            return invalid("vary: no variable is varied");
        }
        rows.count = rows.counted(design)?;
        if rows.count == 0 {
            return invalid("design: it has no rows");
        }
        if kind == Kind::Sobol {
            if free > sobol::DIMENSIONS {
                let most = sobol::DIMENSIONS;
                return invalid(format!("vary: {free} variables, expected at most {most} of kind = \"sobol\""));
            }
            rows.dimensions = (0..free).map(Dimension::new).collect();
        }
        rows.seed = design.seed.unwrap_or(0);
        Ok(rows)
    }

    fn column(
        &self,
        vary: &Vary,
        free: &mut usize,
        number: &dyn Fn(&str) -> Result<Number, String>,
    ) -> Result<Column, String> {
        match Source::new(vary, number)? {
            Source::Same { of, times } => match self.columns.iter().position(|(name, _)| *name == of) {
                Some(to) if !matches!(self.columns[to].1, Column::Tied { .. }) => Ok(Column::Tied { to, times }),
                _ => Err(format!("same = {of:?} is not an earlier column that varies by itself")),
            },
            _ if self.kind == Kind::List => Err("a list varies only its own columns; expected same".into()),
            source if self.kind == Kind::Grid && !matches!(source, Source::Levels(_)) => {
                Err("a grid needs values, or from, to and count".into())
            }
            source => {
                *free += 1;
                Ok(Column::Free { dimension: *free - 1, source })
            }
        }
    }

    fn counted(&self, design: &Design) -> Result<u64, Error> {
        let counts = match self.kind {
            Kind::List => Some(u64::try_from(self.list.len()).unwrap_or(u64::MAX)),
            Kind::Grid => Some(self.levels().try_fold(1, u64::checked_mul).unwrap_or(u64::MAX)),
            Kind::Random | Kind::Lhs | Kind::Sobol => None,
        };
        let word = format!("{:?}", self.kind).to_lowercase();
        let count = match (counts, design.runs) {
            (Some(_), Some(runs)) => {
                return invalid(format!("design: runs = {runs} does not belong to kind = {word:?}"));
            }
            (Some(_), None) if design.seed.is_some() => {
                return invalid(format!("design: seed does not belong to kind = {word:?}"));
            }
            (Some(count), None) => count,
            (None, Some(runs)) => runs,
            (None, None) => return invalid(format!("design: kind = {word:?} needs runs")),
        };
        if count > MOST {
            return invalid(format!("design: {count} rows, expected at most {MOST}"));
        }
        Ok(count)
    }

    /// Number of levels of each column of a grid.
    fn levels(&self) -> impl DoubleEndedIterator<Item = u64> {
        let levels = |column: &Column| match column {
            Column::Free { source: Source::Levels(values), .. } => u64::try_from(values.len()).unwrap_or(u64::MAX),
            _ => 1,
        };
        self.columns.iter().map(move |(_, column)| levels(column))
    }

    /// Number of rows.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Names of the columns.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(name, _)| name.as_str())
    }

    /// The values of row `index`, one for each column.
    pub fn row(&self, index: u64, values: &mut Vec<Number>) {
        values.clear();
        // In a grid: the remaining index for the preceding columns.
        let mut rest = index;
        let mut picked: Vec<u64> = Vec::new();
        if self.kind == Kind::Grid {
            for count in self.levels().rev() {
                picked.push(rest % count);
                rest /= count;
            }
            picked.reverse();
        }
        for (k, (_, column)) in self.columns.iter().enumerate() {
            values.push(match column {
                Column::Tied { to, times: 1.0 } => values[*to],
                Column::Tied { to, times } => Number::Real(values[*to].real() * times),
                Column::Listed(column) => {
                    let row = usize::try_from(index).ok().and_then(|index| self.list.get(index));
                    row.map_or(Number::Missing, |row| row[*column])
                }
                Column::Free { source: Source::Levels(values), .. } if self.kind == Kind::Grid => {
                    usize::try_from(picked[k]).ok().and_then(|level| values.get(level)).copied().unwrap_or_default()
                }
                Column::Free { dimension, source } => source.at(self.unit(*dimension, index)),
            });
        }
    }

    /// A number between 0 and 1 for a column that has its own dimension.
    fn unit(&self, dimension: usize, index: u64) -> f64 {
        let of_column = u64::try_from(dimension).unwrap_or(u64::MAX);
        let random = random::bits(self.seed, of_column, index);
        match self.kind {
            Kind::Sobol => {
                // The shift of the column: the same bits flip in all rows, so strata stay strata.
                let shift = random::bits(self.seed, of_column, u64::MAX);
                random::unit(
                    (self.dimensions[dimension].coordinate(index) << (u64::BITS as usize - sobol::BITS)) ^ shift,
                )
            }
            Kind::Lhs => {
                let key = random::bits(self.seed, of_column, u64::MAX);
                stratified(random::permuted(key, index, self.count), random::unit(random), self.count)
            }
            Kind::Random | Kind::Grid | Kind::List => random::unit(random),
        }
    }
}

/// `u` in stratum `k` of `count`, even where rounding would move it out.
#[expect(clippy::cast_precision_loss, reason = "at most 2^40 rows")]
fn stratified(k: u64, u: f64, count: u64) -> f64 {
    let count = count as f64;
    ((k as f64 + u) / count).clamp(k as f64 / count, ((k + 1) as f64 / count).next_down())
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "the same numbers result")]
mod tests {
    use super::*;
    use crate::definition::Definition;

    fn rows(text: &str) -> Result<DesignRows, Error> {
        let definition = Definition::parse(text).unwrap();
        let number =
            |_: &str, text: &str| text.parse().map(Number::Real).map_err(|_| format!("{text} is not a number"));
        DesignRows::new(&definition.design.unwrap(), &definition.vary, Path::new(""), &|_| false, &number)
    }

    fn all(rows: &DesignRows) -> Vec<Vec<f64>> {
        let one = |k| {
            let mut values = Vec::new();
            rows.row(k, &mut values);
            values.into_iter().map(Number::real).collect()
        };
        (0..rows.count()).map(one).collect()
    }

    fn design(kind: &str, runs: u64, seed: u64) -> DesignRows {
        rows(&format!(
            "[design]\nkind = '{kind}'\nruns = {runs}\nseed = {seed}\n[vary]\na = {{ uniform = [0, 1] }}\n\
             b = {{ uniform = [-1, 1] }}\nc = {{ same = 'a', times = 2 }}\nd = {{ values = [1, 2, 3] }}"
        ))
        .unwrap()
    }

    #[test]
    fn a_grid_has_every_combination() {
        let grid = rows(
            "[design]\nkind = 'grid'\n[vary]\na = { values = [1, 2] }\nb = { same = 'a', times = 10 }\nc = { from = 0, to = 1, count = 3 }",
        );
        let expected = [
            [1.0, 10.0, 0.0],
            [1.0, 10.0, 0.5],
            [1.0, 10.0, 1.0],
            [2.0, 20.0, 0.0],
            [2.0, 20.0, 0.5],
            [2.0, 20.0, 1.0],
        ];
        assert_eq!(all(&grid.unwrap()), expected);
    }

    #[test]
    fn a_row_alone_is_that_row_of_all() {
        for kind in ["random", "lhs", "sobol"] {
            let rows = design(kind, 100, 7);
            let whole = all(&rows);
            for k in [99, 0, 57] {
                let mut alone = vec![Number::Real(5.0); 9];
                rows.row(k, &mut alone);
                let alone: Vec<f64> = alone.into_iter().map(Number::real).collect();
                assert_eq!(alone, whole[usize::try_from(k).unwrap()], "{kind} {k}");
            }
            assert!(whole.iter().all(|r| r[2] == 2.0 * r[0] && [1.0, 2.0, 3.0].contains(&r[3])));
            assert_ne!(whole, all(&design(kind, 100, 8)), "{kind}: another seed, other rows");
            assert_eq!(whole, all(&design(kind, 100, 7)));
        }
    }

    /// With 100 rows of LHS, or 128 of Sobol, each variable has exactly one point in each of 100 or 128 strata.
    #[test]
    fn every_stratum_has_one_point() {
        for (kind, count) in [("lhs", 100_u64), ("lhs", 1), ("lhs", 997), ("sobol", 128)] {
            let whole = all(&design(kind, count, 3));
            for (column, low, width) in [(0, 0.0, 1.0), (1, -1.0, 2.0)] {
                #[expect(
                    clippy::cast_precision_loss,
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "small"
                )]
                let stratum = |r: &Vec<f64>| ((r[column] - low) / width * count as f64) as u64;
                let mut strata: Vec<u64> = whole.iter().map(stratum).collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..count).collect::<Vec<_>>(), "{kind} {count} {column}");
            }
        }
        assert!(stratified(6, 1.0 - 1e-16, 7) < 1.0);
    }

    /// Designs have equal bits on every platform: they use only exact operations and functions of the crate `libm`.
    #[test]
    fn rows_have_these_bits() {
        #[rustfmt::skip]
        let bits = [
            ("random", [0x2478_fc01_4ab5_ef8b, 0xc3fc_6b62_3361_bd24, 0x6e40_d8cf_aecd_5150, 0x5212_92da_c2e7_165e]),
            ("lhs", [0xaae5_a6ca_eb32_f056, 0x728b_5cc8_b444_4d4a, 0x9592_df04_fa80_39dc, 0x6099_abad_b578_d5ed]),
            ("sobol", [0xfb31_394d_abe8_1611, 0xaa0e_bc08_2efa_626e, 0x7438_5626_91d1_30d1, 0xe356_f717_4a1d_dc11]),
        ];
        for (kind, expected) in bits {
            let rows = rows(&format!(
                "[design]\nkind = '{kind}'\nruns = 1000\nseed = 5\n[vary]\na = {{ uniform = [-3, 7] }}\n\
                 b = {{ log = [0.01, 30] }}\nc = {{ normal = [3, 0.15] }}\nd = {{ normal = [3, 0.15], within = [2.5, 3.1] }}"
            ));
            let sum = |column: usize| {
                all(rows.as_ref().unwrap()).iter().fold(0_u64, |sum, row| sum.rotate_left(1) ^ row[column].to_bits())
            };
            let found = [0, 1, 2, 3].map(sum);
            assert_eq!(found, expected, "{kind}: {found:#018x?}");
        }
    }

    #[test]
    fn nonsense_is_told() {
        let vary = "[vary]\na = { uniform = [0, 1] }";
        let many: Vec<String> = (0..65).map(|k| format!("v{k} = {{ uniform = [0, 1] }}")).collect();
        for (text, part) in [
            (format!("[design]\nkind = 'random'\nruns = 0\n{vary}"), "it has no rows"),
            (format!("[design]\nkind = 'lhs'\n{vary}"), "kind = \"lhs\" needs runs"),
            (format!("[design]\nkind = 'grid'\n{vary}"), "vary: a: a grid needs values"),
            ("[design]\nkind = 'grid'\nruns = 3\n[vary]\na = { values = [1] }".into(), "runs = 3 does not belong"),
            ("[design]\nkind = 'random'\nruns = 3".into(), "no variable is varied"),
            (format!("[design]\nkind = 'list'\n{vary}"), "needs file"),
            (format!("[design]\nkind = 'random'\nruns = 9\nfile = 'x'\n{vary}"), "file belongs to kind"),
            (
                format!("[design]\nkind = 'sobol'\nruns = 9\n[vary]\n{}", many.join("\n")),
                "65 variables, expected at most 64",
            ),
            (
                format!("[design]\nkind = 'random'\nruns = 9\n{vary}\nb = {{ same = 'c' }}"),
                "same = \"c\" is not an earlier column",
            ),
            (format!("[design]\nkind = 'random'\nruns = 2000000000000\n{vary}"), "expected at most 1099511627776"),
        ] {
            let error = rows(&text).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
