//! Rows from a CSV file: the header names the variables.

use crate::Error;
use fmu_import::Number;
use fmu_import::csv::{Heading, Table};
use std::path::Path;

/// Names and rows; a heading that is the name of a variable has no unit.
pub(super) fn read(
    path: &Path,
    known: &dyn Fn(&str) -> bool,
    number: &dyn Fn(&str, &str) -> Result<Number, String>,
) -> Result<(Vec<String>, Vec<Vec<Number>>), Error> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
    parse(&text, known, number).map_err(|cause| Error::file(path, cause))
}

fn parse(
    text: &str,
    known: &dyn Fn(&str) -> bool,
    number: &dyn Fn(&str, &str) -> Result<Number, String>,
) -> Result<(Vec<String>, Vec<Vec<Number>>), String> {
    let Table { headings, rows: lines } = Table::parse(text)?;
    let headings: Vec<Heading> = headings.into_iter().map(|heading| heading.among(known)).collect();
    let mut rows = Vec::new();
    for (line, row) in lines {
        let read =
            |(heading, cell): (&Heading, &String)| number(&heading.name, format!("{cell} {}", heading.unit).trim_end());
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
    fn units_follow_their_numbers_and_names_keep_their_brackets() {
        let number =
            |name: &str, text: &str| Ok(Number::Real(f64::from(u32::try_from(name.len() + text.len()).unwrap())));
        let texts = std::cell::RefCell::new(Vec::new());
        let kept = |name: &str, text: &str| {
            texts.borrow_mut().push(format!("{name}={text}"));
            number(name, text)
        };
        parse("n [1/s],p[mm],q [mm]\n5,1,2\n", &|name| name == "p[mm]", &kept).unwrap();
        assert_eq!(*texts.borrow(), ["n=5 1/s", "p[mm]=1", "q=2 mm"]);
    }

    #[test]
    fn a_list_is_read_whole_or_not_at_all() {
        let number = |name: &str, text: &str| {
            text.parse().map(Number::Real).map_err(|_| format!("{name} = {text} is not a number"))
        };
        let known = |name: &str| name == "p[mm]";
        let (names, rows) = parse("\u{feff}\"p.R\", p.J\r\n3,1e-3\r\n\r\n4,2e-3\r\n", &known, &number).unwrap();
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
            assert_eq!(parse(text, &known, &number).unwrap_err(), expected);
        }
    }
}
