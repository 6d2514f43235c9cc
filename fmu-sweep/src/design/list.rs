//! Rows from a CSV file: the header names the variables.

use crate::Error;
use fmu_import::Number;
use fmu_import::csv::{Heading, Table};
use std::path::Path;

/// Names and rows.
pub(super) fn read(
    path: &Path,
    number: &dyn Fn(&str, &str) -> Result<Number, String>,
) -> Result<(Vec<String>, Vec<Vec<Number>>), Error> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
    parse(&text, number).map_err(|cause| Error::file(path, cause))
}

fn parse(
    text: &str,
    number: &dyn Fn(&str, &str) -> Result<Number, String>,
) -> Result<(Vec<String>, Vec<Vec<Number>>), String> {
    let Table { headings, rows: lines } = Table::parse(text)?;
    let mut rows = Vec::new();
    for (line, row) in lines {
        let read = |(heading, cell): (&Heading, &String)| number(&heading.name, &format!("{cell}{}", heading.unit));
        let values: Result<Vec<Number>, String> = headings.iter().zip(&row).map(read).collect();
        rows.push(values.map_err(|cause| format!("line {line}: {cause}"))?);
    }
    let names: Vec<String> = headings.into_iter().map(|heading| heading.name).collect();
    if let Some(k) = (0..names.len()).find(|&k| names[..k].contains(&names[k])) {
        return Err(format!(
            "line 1: column {} has the name {:?}, expected a name that no other column has",
            k + 1,
            names[k]
        ));
    }
    Ok((names, rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_read_whole_or_not_at_all() {
        let number = |name: &str, text: &str| {
            text.parse().map(Number::Real).map_err(|_| format!("{name} = {text} is not a number"))
        };
        let (names, rows) = parse("\u{feff}\"p.R\", p.J\r\n3,1e-3\r\n\r\n4,2e-3\r\n", &number).unwrap();
        assert_eq!(
            (names, rows),
            (
                vec!["p.R".into(), "p.J".into()],
                [[3.0, 1e-3], [4.0, 2e-3]].map(|row| row.map(Number::Real).to_vec()).to_vec()
            )
        );
        for (text, expected) in [
            ("", "is empty, expected a header with the names of variables"),
            ("a,a\n1,2", "line 1: column 2 has the name \"a\", expected a name that no other column has"),
            ("a,b\n1,2\n3", "line 3: expected 2 numbers, found 1"),
            ("a,b\n1,x", "line 2: b = x is not a number"),
        ] {
            assert_eq!(parse(text, &number).unwrap_err(), expected);
        }
    }
}
