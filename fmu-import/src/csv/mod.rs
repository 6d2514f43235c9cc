//! Comma-separated values (RFC 4180), by the crate `csv`: the reader and the writer of every such file.

mod heading;

pub use heading::Heading;
use std::collections::BTreeSet;
use std::io::{self, Write};

/// A table: headings, and rows with as many cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// The columns.
    pub headings: Vec<Heading>,
    /// The line of each row in the file, and its cells.
    pub rows: Vec<(u64, Vec<String>)>,
}

impl Table {
    /// A table with commas between columns.
    ///
    /// # Errors
    /// Names the line and what is wrong in it: other separators, a comment, a column without a name, a row with another number of
    /// cells.
    pub fn parse(text: &str) -> Result<Self, String> {
        Self::separated(text, b',', false)
    }

    /// A table of a measuring instrument: with commas, semicolons or tabs between columns, and with lines of comments after `#`.
    ///
    /// # Errors
    /// As [`parse`](Self::parse), without the first two.
    pub fn of_instrument(text: &str) -> Result<(Self, char), String> {
        let header = text.lines().map(str::trim_start).find(|line| !line.is_empty() && !line.starts_with('#'));
        let separator = [b'\t', b';'].into_iter().find(|c| header.is_some_and(|line| line.contains(char::from(*c))));
        let separator = separator.unwrap_or(b',');
        Ok((Self::separated(text, separator, true)?, char::from(separator)))
    }

    fn separated(text: &str, separator: u8, comments: bool) -> Result<Self, String> {
        let text = text.trim_start_matches('\u{feff}');
        let mut builder = ::csv::ReaderBuilder::new();
        builder.has_headers(false).flexible(true).trim(::csv::Trim::All).delimiter(separator);
        let mut reader = builder.comment(comments.then_some(b'#')).from_reader(text.as_bytes());
        let mut records = reader.records().map(|record| {
            let record = record.map_err(|e| e.to_string())?;
            // The position is that before lines without a record.
            let (byte, line) = record.position().map_or((0, 1), |at| (at.byte(), at.line()));
            let before = text.get(usize::try_from(byte).unwrap_or(usize::MAX)..).unwrap_or_default();
            let empty = |line: &&str| line.trim_matches('\r').is_empty() || (comments && line.starts_with('#'));
            let line = line + before.split('\n').take_while(empty).map(|_| 1).sum::<u64>();
            Ok::<_, String>((line, record.iter().map(str::to_owned).collect::<Vec<_>>()))
        });
        let mut records = records.by_ref().filter(|record| !matches!(record, Ok((_, cells)) if cells == &[""]));
        let (line, cells) = records.next().ok_or("is empty, expected a header with the names of variables")??;
        if !comments {
            refuse(&cells).map_err(|cause| format!("line {line}: {cause}"))?;
        }
        let headings = headings(&cells).map_err(|cause| format!("line {line}: {cause}"))?;
        let mut rows = Vec::new();
        for record in records {
            let (line, cells) = record?;
            let (expected, found) = (headings.len(), cells.len());
            if found != expected {
                let why = match cells.last().map(String::as_str) {
                    Some("") if found == expected + 1 => "; the line ends with a comma: remove it",
                    _ if found > expected && separator == b',' => "; commas separate columns: write a decimal point",
                    _ => "",
                };
                return Err(format!("line {line}: expected {expected} numbers, found {found}{why}"));
            }
            rows.push((line, cells));
        }
        Ok(Self { headings, rows })
    }
}

/// Defects in the header of one of our own files.
fn refuse(cells: &[String]) -> Result<(), String> {
    let first = cells.first().map_or("", String::as_str);
    if first.starts_with('#') {
        return Err("begins with #: remove lines of comments, and the # before headings".into());
    }
    let header = cells.join(",");
    if let ([only], Some((c, what))) =
        (cells, [(';', "semicolons"), ('\t', "tabs")].into_iter().find(|(c, _)| header.contains(*c)))
        && only.contains(c)
    {
        return Err(format!("has {what}; write commas between columns and a decimal point"));
    }
    if first.is_empty() && cells.len() > 1 {
        return Err(
            "the first column has no name: it numbers the rows (an index); write the file without it, in pandas \
                    with index=False"
                .into(),
        );
    }
    if cells.len() > 1 && cells.last().is_some_and(String::is_empty) {
        return Err("ends with a comma, which begins a column without a name: remove it, in every line".into());
    }
    let mut names = BTreeSet::new();
    if let Some(k) = cells.iter().position(|name| name.is_empty() || !names.insert(name)) {
        let expected = "expected a name that no other column has";
        return Err(format!("column {} has the name {:?}, {expected}", k + 1, cells[k]));
    }
    Ok(())
}

fn headings(cells: &[String]) -> Result<Vec<Heading>, String> {
    if let Some(number) = cells.iter().find(|cell| cell.parse::<f64>().is_ok()) {
        return Err(format!("{number} is a number; the first line names the columns"));
    }
    Ok(cells.iter().map(|cell| Heading::new(cell)).collect())
}

/// Writes rows of cells, in quotation marks where needed.
pub struct Writer<W: Write>(::csv::Writer<W>);

impl<W: Write> Writer<W> {
    /// Lines end with a line feed.
    pub fn new(out: W) -> Self {
        Self(::csv::WriterBuilder::new().flexible(true).from_writer(out))
    }

    /// Writes a row.
    ///
    /// # Errors
    /// As the writer's.
    pub fn row<C: AsRef<[u8]>>(&mut self, cells: impl IntoIterator<Item = C>) -> io::Result<()> {
        Ok(self.0.write_record(cells)?)
    }

    /// Everything is written.
    ///
    /// # Errors
    /// As the writer's.
    pub fn finish(mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// A row as text, with its line break.
pub fn line<C: AsRef<[u8]>>(cells: impl IntoIterator<Item = C>) -> String {
    let mut bytes = Vec::new();
    let mut writer = Writer::new(&mut bytes);
    // Writing to memory does not fail.
    let _ = writer.row(cells).and_then(|()| writer.finish());
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The cells of one row.
pub fn cells(line: &str) -> Vec<String> {
    // The reader takes one byte order mark off a file; a row has none, but its first cell may begin with one.
    let line = format!("\u{feff}{line}");
    let mut reader = ::csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(line.as_bytes());
    let first = reader.records().next().and_then(Result::ok);
    first.iter().flat_map(|record| record.iter()).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_have_units_and_cells_any_text() {
        let text = "\u{feff}time [ms],\"a,\"\"b\",\"m[1,2]\",speed [rpm]\r\n\r\n0,\"x\ny\", 1 ,\n";
        let table = Table::parse(text).unwrap();
        let found: Vec<_> = table.headings.iter().map(|h| (h.name.as_str(), h.unit.as_str())).collect();
        assert_eq!(found, [("time", "ms"), ("a,\"b", ""), ("m[1,2]", ""), ("speed", "rpm")]);
        assert_eq!(table.rows, [(3, ["0", "x\ny", "1", ""].map(str::to_owned).to_vec())]);
        assert_eq!(cells(&line(["a,b", "c\"d", ""])), ["a,b", "c\"d", ""]);
        assert_eq!(cells(&line(["\u{feff}a", "b"])), ["\u{feff}a", "b"]);
        assert_eq!(line(["a", "b c", "1,2", "\""]), "a,b c,\"1,2\",\"\"\"\"\n");
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, cause) in [
            ("", "is empty, expected a header with the names of variables"),
            (",time,u\n0,0,1\n", "line 1: the first column has no name: it numbers the rows (an index)"),
            ("time\tu\n0\t1\n", "line 1: has tabs; write commas"),
            ("time;u\n0;1\n", "line 1: has semicolons; write commas"),
            ("# made by a tool\ntime,u\n0,1\n", "line 1: begins with #: remove lines of comments"),
            ("time,u,\n0,1,\n", "line 1: ends with a comma"),
            ("time,u\n0,1,\n", "line 2: expected 2 numbers, found 3; the line ends with a comma"),
            ("time,u\n0,1,5\n", "line 2: expected 2 numbers, found 3; commas separate columns"),
            ("time,u\n\n0\n", "line 3: expected 2 numbers, found 1"),
            ("time,u,u\n", "line 1: column 3 has the name \"u\", expected a name that no other column has"),
            ("0,1\n", "line 1: 0 is a number; the first line names the columns"),
        ] {
            let error = Table::parse(text).unwrap_err();
            assert!(error.starts_with(cause), "{text:?}: {error}");
        }
        let (table, separator) = Table::of_instrument("# bench\ntime;u\n# gap\n0;1,5\n").unwrap();
        assert_eq!((separator, table.rows[0].1[1].as_str(), table.rows[0].0), (';', "1,5", 4));
    }
}
