//! Rows from a CSV file: the header names the variables.

use crate::Error;
use fmu_import::Number;
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
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let cells = |line: &str| line.split(',').map(|c| c.trim().trim_matches('"').to_owned()).collect::<Vec<_>>();
    let (_, header) = lines.next().ok_or("is empty, expected a header with the names of variables")?;
    let names = cells(header.trim_start_matches('\u{feff}'));
    if let Some(k) = (0..names.len()).find(|&k| names[k].is_empty() || names[..k].contains(&names[k])) {
        return Err(format!(
            "line 1: column {} has the name {:?}, expected a name that no other column has",
            k + 1,
            names[k]
        ));
    }
    let mut rows = Vec::new();
    for (index, line) in lines {
        let row = cells(line);
        if row.len() != names.len() {
            return Err(format!("line {}: {} values, expected {}", index + 1, row.len(), names.len()));
        }
        let read = |(name, cell): (&String, &String)| number(name, cell);
        let values: Result<Vec<Number>, String> = names.iter().zip(&row).map(read).collect();
        rows.push(values.map_err(|cause| format!("line {}: {cause}", index + 1))?);
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
            ("a,b\n1,2\n3", "line 3: 1 values, expected 2"),
            ("a,b\n1,x", "line 2: b = x is not a number"),
        ] {
            assert_eq!(parse(text, &number).unwrap_err(), expected);
        }
    }
}
