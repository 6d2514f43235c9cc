//! The preset of an FMU: start values in a file of its resources, which replace the values of the model's `Default`.
//!
//! `fmu preset` writes the file, the exporter applies it when it creates an instance. The first line names the format; each
//! other line has a scalar, or an element of an array, a tab (here `→`), and its start value:
//!
//! ```text
//! fmu preset 1
//! motor.R_s→0.775
//! motor.n_p→5
//! label→two\nlines
//! weights[1,2]→0.5
//! ```
//!
//! An enumeration has its integer, a Boolean `true` or `false`; `\n`, `\r`, `\t` and `\\` are escapes as in Rust. The hash of
//! the file follows the model's token after `+`, so the token identifies the preset.

use crate::{Fault, Hash};

/// Name of the file in the folder `resources/`.
pub const FILE: &str = "fmu-preset.txt";

/// Largest size of the file in bytes.
pub const MOST: u64 = 1 << 20;

/// The first line.
const HEAD: &str = "fmu preset ";
/// The format that is written and read.
const FORMAT: &str = "1";

/// A line of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PresetValue {
    /// Number of the line, from 1.
    pub line: usize,
    /// Name of the variable, an element of an array as `name[1,2]`.
    pub name: String,
    /// Its start value.
    pub value: String,
}

/// The file with these names and values.
pub fn write<'a>(values: impl IntoIterator<Item = (&'a str, &'a str)>) -> String {
    let mut text = format!("{HEAD}{FORMAT}\n");
    for (name, value) in values {
        text.push_str(name);
        text.push('\t');
        for c in value.chars() {
            match c {
                '\n' => text.push_str("\\n"),
                '\r' => text.push_str("\\r"),
                '\t' => text.push_str("\\t"),
                '\\' => text.push_str("\\\\"),
                c => text.push(c),
            }
        }
        text.push('\n');
    }
    text
}

/// The names and values of a file.
///
/// # Errors
/// Names the line and the fault: size, encoding, format, or syntax of a line.
pub fn read(bytes: &[u8]) -> Result<Vec<PresetValue>, Fault> {
    if bytes.len() as u64 > MOST {
        return Err(Fault::new(format!("is larger than {MOST} bytes, the maximum size of a preset")));
    }
    let text = std::str::from_utf8(bytes).map_err(|_| Fault::new("is not a preset: it is not UTF-8"))?;
    let mut lines = text.split('\n');
    match lines.next().and_then(|head| head.strip_prefix(HEAD)) {
        Some(FORMAT) => {}
        Some(other) if !other.is_empty() && other.bytes().all(|b| b.is_ascii_digit()) => {
            let why = format!("has the format {other}, and this FMU reads the format {FORMAT}: a later `fmu` wrote it");
            return Err(Fault::new(why));
        }
        _ => return Err(Fault::new(format!("is not a preset: its first line is not `{HEAD}{FORMAT}`"))),
    }
    if lines.next_back() != Some("") {
        return Err(Fault::new("is cut short: its last line does not end"));
    }
    let entry = |(line, text): (usize, &str)| {
        let wrong = |why: &str| Fault::new(format!("line {line}: {why}"));
        let (name, value) = text.split_once('\t').ok_or_else(|| wrong("expected a name, a tab and a value"))?;
        let value = unescaped(value).ok_or_else(|| wrong("after \\ comes n, r, t or \\"))?;
        Ok(PresetValue { line, name: name.into(), value })
    };
    (2..).zip(lines).map(entry).collect()
}

fn unescaped(text: &str) -> Option<String> {
    let (mut out, mut chars) = (String::with_capacity(text.len()), text.chars());
    while let Some(c) = chars.next() {
        out.push(match c {
            '\\' => match chars.next()? {
                'n' => '\n',
                'r' => '\r',
                't' => '\t',
                '\\' => '\\',
                _ => return None,
            },
            c => c,
        });
    }
    Some(out)
}

/// The suffix of the model's token for the preset of these bytes.
pub fn suffix(bytes: &[u8]) -> String {
    format!("+{}", Hash::START.bytes(bytes).guid().as_str())
}

/// The suffix of a token of the model, empty without a preset; `None` for any other token.
pub fn suffix_of<'a>(token: &'a str, model: &str) -> Option<&'a str> {
    token.strip_prefix(model).filter(|rest| rest.is_empty() || rest.starts_with('+'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back() {
        let values = [("motor.R_s", "0.775"), ("label", "a\tb\\n\nc\r = \u{3c8}"), ("empty", ""), ("a = b", "1")];
        let text = write(values);
        assert!(text.starts_with("fmu preset 1\nmotor.R_s\t0.775\nlabel\ta\\tb\\\\n\\nc\\r = \u{3c8}\n"), "{text}");
        let back = read(text.as_bytes()).unwrap();
        let pairs: Vec<_> = back.iter().map(|e| (e.name.as_str(), e.value.as_str())).collect();
        assert_eq!(pairs, values);
        assert_eq!(back.iter().map(|e| e.line).collect::<Vec<_>>(), [2, 3, 4, 5]);
        assert_eq!(read(write([]).as_bytes()).unwrap(), []);
    }

    #[test]
    fn what_is_no_preset_says_why() {
        let large = [b"fmu preset 1\n".to_vec(), vec![b'a'; 1 << 20]].concat();
        for (bytes, why) in [
            (&b""[..], "is not a preset: its first line is not `fmu preset 1`"),
            (b"<xml/>\n", "its first line"),
            (b"fmu preset \n", "its first line"),
            (b"fmu preset 1 \nx\t1\n", "its first line"),
            (b"fmu preset 1\r\nx\t1\r\n", "its first line"),
            (b"fmu preset 2\nx\t1\n", "has the format 2, and this FMU reads the format 1: a later `fmu` wrote it"),
            (b"fmu preset 1", "is cut short"),
            (b"fmu preset 1\nx\t1", "is cut short"),
            (b"fmu preset 1\nx\t1\n\ny\t1\n", "line 3: expected a name, a tab and a value"),
            (b"fmu preset 1\nx = 1\n", "line 2: expected a name"),
            (b"fmu preset 1\nx\ta\\b\n", "line 2: after \\ comes n, r, t or \\"),
            (b"fmu preset 1\nx\ta\\\n", "line 2: after"),
            (b"fmu preset 1\nx\t\xff\n", "is not a preset: it is not UTF-8"),
            (&large, "is larger than 1048576 bytes"),
        ] {
            let said = read(bytes).unwrap_err().to_string();
            assert!(said.contains(why), "{said}");
        }
    }

    #[test]
    fn a_token_tells_its_preset() {
        let model = Hash::START.guid();
        let (model, bytes) = (model.as_str(), write([("x", "1")]));
        let token = format!("{model}{}", suffix(bytes.as_bytes()));
        assert_eq!(token.len(), 38 + 1 + 38);
        assert_ne!(suffix(bytes.as_bytes()), suffix(write([("x", "2")]).as_bytes()));
        assert_eq!((suffix_of(model, model), suffix_of(&token, model)), (Some(""), Some(&token[38..])));
        for other in ["", "{}", &model[1..], &format!("{model}x"), &token[38..]] {
            assert_eq!(suffix_of(other, model), None, "{other}");
        }
    }
}
