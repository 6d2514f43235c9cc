//! Tables of text.

use std::fmt::Write as _;

/// Rows of cells in aligned columns; the row below the first is drawn by `rule` from the widths.
pub fn aligned(rows: &[Vec<String>], [left, between, right]: [&str; 3], rule: impl Fn(&[usize]) -> String) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|x| x.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for (k, row) in rows.iter().enumerate() {
        let padded = |(x, w): (&String, &usize)| format!("{x}{}", " ".repeat(w - x.chars().count()));
        let line: Vec<_> = row.iter().zip(&widths).map(padded).collect();
        let _ = writeln!(text, "{}", format!("{left}{}{right}", line.join(between)).trim_end());
        if k == 0 {
            text.push_str(&rule(&widths));
        }
    }
    text
}

/// A table in Markdown; the first row has the headings.
pub fn markdown(rows: &[Vec<String>]) -> String {
    aligned(rows, ["| ", " | ", " |"], |widths| {
        let lines: Vec<_> = widths.iter().map(|w| "-".repeat(w + 2)).collect();
        format!("|{}|\n", lines.join("|"))
    })
}
