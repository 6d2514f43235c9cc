//! The file in which an FMU records its importer's calls: [`fmu-export`](https://docs.rs/fmu-export) writes it, the importer reads
//! and repeats it.
//!
//! A head, an empty line, then a line per call: time of the instance in s, function, arguments, `->`, status, results.
//!
//! ```text
//! FMU call log: 1
//! FMI: 3.0
//! model: PmsmPlant
//! version: 0.9.0
//! token: 53d2…
//!
//! 0.0 fmi3SetFloat64(vr=[1], n=1, values=[325.0], m=1) -> OK
//! 0.0 fmi3GetFloat64(vr=[4, 5], n=2, values=?2, m=2) -> OK values=[0.5, -0.0]
//! 0.0 fmi3DoStep(t=0.0, h=0.001, no_set_state_prior=1, ...) {
//!   0.0005 intermediateUpdate(time=0.0005, can_return=1) {
//!     0.0005 fmi3GetFloat64(vr=[4], n=1, values=?1, m=1) -> OK values=[0.25]
//!   } -> OK
//! } -> OK event=0 terminate=0 early=0 last=0.001
//! ```
//!
//! Numbers round-trip. A text is quoted, bytes are `0x...` in hexadecimal, `#2` is the second saved state of this log, and `?2` is
//! room for two values, which follow among the results. The call is written before it begins, so a crash inside it leaves a line
//! without `->`, the last of the file.

use std::fmt::{self, Display, Formatter, Write};

/// Version of the format.
const FORMAT: &str = "1";

/// Maximum number of calls that are in progress at once: a callback in a step, a call in it, and a call from the logger.
const DEPTH: usize = 16;

/// First words of the file.
const FIRST: &str = "FMU call log: ";

/// The head of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogHead {
    /// `2.0` or `3.0`.
    pub standard: String,
    /// Name of the model.
    pub model: String,
    /// Version of the model.
    pub version: String,
    /// Token of the binary, without the suffix of a preset.
    pub token: String,
}

impl Display for LogHead {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { standard, model, version, token } = self;
        write!(f, "{FIRST}{FORMAT}\nFMI: {standard}\nmodel: {model}\nversion: {version}\ntoken: {token}\n\n")
    }
}

/// An argument or a result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LogValue {
    /// A NULL pointer.
    Null,
    /// A function of the importer, or its struct of functions.
    Given,
    /// An array that cannot be read: misaligned or too long.
    Unreadable,
    /// Room for this number of values.
    Room(usize),
    /// A number.
    Number(String),
    /// A text.
    Text(Vec<u8>),
    /// Bytes.
    Bytes(Vec<u8>),
    /// A saved state: its number in this log, from 1.
    State(usize),
    /// An array.
    List(Vec<LogValue>),
}

/// A name with its value.
pub type NamedValue = (String, LogValue);

impl Display for LogValue {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Null => f.write_str("NULL"),
            Self::Given => f.write_str("given"),
            Self::Unreadable => f.write_str("unreadable"),
            Self::Room(n) => write!(f, "?{n}"),
            Self::Number(text) => f.write_str(text),
            Self::State(number) => write!(f, "#{number}"),
            Self::Text(bytes) => quote(f, bytes),
            Self::Bytes(bytes) => {
                f.write_str("0x")?;
                bytes.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
            }
            Self::List(values) => {
                f.write_char('[')?;
                for (i, value) in values.iter().enumerate() {
                    write!(f, "{}{value}", if i > 0 { ", " } else { "" })?;
                }
                f.write_char(']')
            }
        }
    }
}

fn quote(f: &mut Formatter<'_>, bytes: &[u8]) -> fmt::Result {
    f.write_char('"')?;
    for chunk in bytes.utf8_chunks() {
        for c in chunk.valid().chars() {
            match c {
                '"' | '\\' => write!(f, "\\{c}")?,
                '\n' => f.write_str("\\n")?,
                c if c.is_ascii_control() => write!(f, "\\x{:02x}", u32::from(c))?,
                c => f.write_char(c)?,
            }
        }
        chunk.invalid().iter().try_for_each(|byte| write!(f, "\\x{byte:02x}"))?;
    }
    f.write_char('"')
}

/// The beginning of a call: time, name and arguments.
pub fn begun(time: Option<f64>, name: &str, arguments: &[NamedValue]) -> String {
    let mut line = time.map_or_else(|| "-".into(), |time| format!("{time:?}"));
    let _ = write!(line, " {name}(");
    for (i, (name, value)) in arguments.iter().enumerate() {
        let _ = write!(line, "{}{name}={value}", if i > 0 { ", " } else { "" });
    }
    line + ")"
}

/// The end of a call.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CallEnd {
    /// The status; of an instantiation, `instance` or `NULL`.
    pub status: String,
    /// What the function wrote.
    pub results: Vec<NamedValue>,
}

impl Display for CallEnd {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.status)?;
        self.results.iter().try_for_each(|(name, value)| write!(f, " {name}={value}"))
    }
}

/// The name of a status.
pub fn status(number: i32) -> String {
    match number {
        0 => "OK".into(),
        1 => "Warning".into(),
        2 => "Discard".into(),
        3 => "Error".into(),
        4 => "Fatal".into(),
        other => other.to_string(),
    }
}

/// A call of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct LoggedCall {
    /// Number of its line, from 1.
    pub line: usize,
    /// Time of the instance in s; `None` before there is one.
    pub time: Option<f64>,
    /// Name of the function in C.
    pub name: String,
    /// Its arguments except the instance.
    pub arguments: Vec<NamedValue>,
    /// Callbacks and calls during this one.
    pub inside: Vec<LoggedCall>,
    /// How it ended; `None` if the file ends during it.
    pub ended: Option<CallEnd>,
}

impl Display for LoggedCall {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&begun(self.time, &self.name, &self.arguments))
    }
}

/// Reads a file call by call.
#[derive(Debug)]
pub struct LogReader<'a> {
    lines: Vec<&'a str>,
    next: usize,
    /// Number of blocks around the next line.
    depth: usize,
    /// The last line ends with a line feed.
    whole: bool,
}

impl<'a> LogReader<'a> {
    /// Reads the head.
    ///
    /// # Errors
    /// Line and reason.
    pub fn new(text: &'a str) -> Result<(LogHead, Self), String> {
        let lines: Vec<&str> = text.lines().collect();
        let format = lines.first().and_then(|line| line.strip_prefix(FIRST));
        match format {
            None => return Err(format!("line 1: not a call log of an FMU: it begins with {FIRST:?}")),
            Some(FORMAT) => {}
            Some(other) => return Err(format!("line 1: format {other:?}; this version reads format {FORMAT}")),
        }
        let field = |at: usize, name: &str| {
            let found = lines.get(at).and_then(|line| line.strip_prefix(name)).map(str::to_owned);
            found.ok_or_else(|| format!("line {}: the head has {name:?} here", at + 1))
        };
        let (standard, model) = (field(1, "FMI: ")?, field(2, "model: ")?);
        let (version, token) = (field(3, "version: ")?, field(4, "token: ")?);
        if lines.get(5).is_none_or(|line| !line.is_empty()) {
            return Err("line 6: an empty line ends the head".into());
        }
        let reader = Self { lines, next: 6, depth: 0, whole: text.ends_with('\n') };
        Ok((LogHead { standard, model, version, token }, reader))
    }

    /// The call on the next line with those inside it, and whether that line opens a block that the file does not close.
    fn call(&mut self) -> Result<Option<LoggedCall>, String> {
        let Some(&text) = self.lines.get(self.next) else { return Ok(None) };
        self.next += 1;
        let line = self.next;
        let cut = line == self.lines.len() && !self.whole;
        let mut scan = Scan { text: text.trim_start(), at: 0 };
        let read = scan.beginning().and_then(|(time, name, arguments)| {
            let mut call = LoggedCall { line, time, name, arguments, inside: Vec::new(), ended: None };
            if scan.skip(" -> ") {
                call.ended = Some(scan.end()?);
            }
            Ok(call)
        });
        let mut call = match read {
            Ok(call) => call,
            // The host ended while it wrote this line.
            Err(_) if cut => return Ok(None),
            Err(why) => return Err(format!("line {line}: {why}")),
        };
        match &text.trim_start()[scan.at..] {
            "" if call.ended.is_some() || line == self.lines.len() => {}
            " {" if self.depth == DEPTH => return Err(format!("line {line}: more than {DEPTH} calls in one another")),
            " {" if call.ended.is_none() => {
                self.depth += 1;
                self.inside(&mut call)?;
                self.depth -= 1;
            }
            // A partly written arrow or brace.
            rest if cut && call.ended.is_none() && (" -> ".starts_with(rest) || " {".starts_with(rest)) => {}
            "" => return Err(format!("line {line}: the call has no end, and is not the last one of the file")),
            rest => return Err(format!("line {line}: after the call: {rest:?}")),
        }
        Ok(Some(call))
    }

    /// Reads the block of a call up to its end, or to the end of the file.
    fn inside(&mut self, call: &mut LoggedCall) -> Result<(), String> {
        while let Some(text) = self.lines.get(self.next) {
            if let Some(end) = text.trim_start().strip_prefix("} -> ") {
                self.next += 1;
                let mut scan = Scan { text: end, at: 0 };
                let cut = self.next == self.lines.len() && !self.whole;
                match scan.end() {
                    Ok(ended) if scan.rest().is_empty() => call.ended = Some(ended),
                    _ if cut => {}
                    Ok(_) => return Err(format!("line {}: after the end of a call: {:?}", self.next, scan.rest())),
                    Err(why) => return Err(format!("line {}: {why}", self.next)),
                }
                return Ok(());
            }
            match self.call()? {
                Some(inner) => call.inside.push(inner),
                None => return Ok(()),
            }
        }
        Ok(())
    }
}

impl Iterator for LogReader<'_> {
    type Item = Result<LoggedCall, String>;

    fn next(&mut self) -> Option<Self::Item> {
        let call = self.call().transpose();
        if !matches!(call, Some(Ok(_))) {
            self.next = self.lines.len();
        }
        call
    }
}

/// A line that is being read.
struct Scan<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Scan<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn skip(&mut self, wanted: &str) -> bool {
        let found = self.rest().starts_with(wanted);
        self.at += if found { wanted.len() } else { 0 };
        found
    }

    fn expect(&mut self, wanted: &str) -> Result<(), String> {
        if self.skip(wanted) { Ok(()) } else { Err(format!("column {}: {wanted:?} is expected", self.at + 1)) }
    }

    /// Characters up to one of these.
    fn until(&mut self, ends: &[char]) -> &'a str {
        let rest = self.rest();
        let word = &rest[..rest.find(ends).unwrap_or(rest.len())];
        self.at += word.len();
        word
    }

    fn beginning(&mut self) -> Result<(Option<f64>, String, Vec<NamedValue>), String> {
        let time = match self.until(&[' ']) {
            "-" => None,
            word => Some(word.parse().map_err(|_| format!("{word:?} is not a time in s"))?),
        };
        self.expect(" ")?;
        let name = self.until(&['(', ' ']).to_owned();
        self.expect("(")?;
        let mut arguments = Vec::new();
        while !self.skip(")") {
            if !arguments.is_empty() {
                self.expect(", ")?;
            }
            arguments.push(self.named()?);
        }
        Ok((time, name, arguments))
    }

    fn end(&mut self) -> Result<CallEnd, String> {
        let status = self.until(&[' ']).to_owned();
        if status.is_empty() {
            return Err("the status is missing".into());
        }
        let mut results = Vec::new();
        while self.skip(" ") {
            results.push(self.named()?);
        }
        Ok(CallEnd { status, results })
    }

    fn named(&mut self) -> Result<NamedValue, String> {
        let name = self.until(&['=', ' ', ',', ')']).to_owned();
        self.expect("=")?;
        Ok((name, self.value()?))
    }

    fn value(&mut self) -> Result<LogValue, String> {
        if self.skip("[") {
            let mut values = Vec::new();
            while !self.skip("]") {
                if !values.is_empty() {
                    self.expect(", ")?;
                }
                if self.rest().starts_with('[') {
                    return Err(format!("column {}: an array in an array", self.at + 1));
                }
                values.push(self.value()?);
            }
            return Ok(LogValue::List(values));
        }
        if self.skip("\"") {
            return self.quoted().map(LogValue::Text);
        }
        let column = self.at + 1;
        let word = self.until(&[',', ' ', ')', ']']);
        let wrong = || format!("column {column}: {word:?} is not a value");
        let number = |text: &str| text.parse().map_err(|_| wrong());
        match word {
            "NULL" => Ok(LogValue::Null),
            "given" => Ok(LogValue::Given),
            "unreadable" => Ok(LogValue::Unreadable),
            _ if word.starts_with('?') => number(&word[1..]).map(LogValue::Room),
            _ if word.starts_with('#') => number(&word[1..]).map(LogValue::State),
            _ if word.starts_with("0x") => {
                let digits = &word.as_bytes()[2..];
                let byte = |pair: &[u8]| Some((digit(*pair.first()?)? << 4) | digit(*pair.get(1)?)?);
                digits.chunks(2).map(byte).collect::<Option<_>>().map(LogValue::Bytes).ok_or_else(wrong)
            }
            _ if word.parse::<f64>().is_ok() => Ok(LogValue::Number(word.into())),
            _ => Err(wrong()),
        }
    }

    /// The rest of a text after its opening quote.
    fn quoted(&mut self) -> Result<Vec<u8>, String> {
        let (mut bytes, all) = (Vec::new(), self.text.as_bytes());
        loop {
            let ended = || "a text has no end".to_owned();
            let byte = *all.get(self.at).ok_or_else(ended)?;
            self.at += 1;
            match byte {
                b'"' => return Ok(bytes),
                b'\\' => {
                    let escape = *all.get(self.at).ok_or_else(ended)?;
                    self.at += 1;
                    bytes.push(match escape {
                        b'n' => b'\n',
                        b'x' => {
                            let pair = all.get(self.at..self.at + 2).ok_or_else(ended)?;
                            self.at += 2;
                            let [high, low] = [pair[0], pair[1]].map(digit);
                            let value = high.zip(low).map(|(high, low)| high << 4 | low);
                            value.ok_or_else(|| format!("column {}: \\x has two hexadecimal digits", self.at - 1))?
                        }
                        b'"' | b'\\' => escape,
                        _ => return Err(format!("column {}: an unknown escape", self.at)),
                    });
                }
                byte => bytes.push(byte),
            }
        }
    }
}

fn digit(byte: u8) -> Option<u8> {
    char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head() -> LogHead {
        let [standard, model, version, token] = ["3.0", "Probe", "1.2", "ab"].map(str::to_owned);
        LogHead { standard, model, version, token }
    }

    fn read(calls: &str) -> Result<Vec<LoggedCall>, String> {
        let text = format!("{}{calls}", head());
        let (found, reader) = LogReader::new(&text)?;
        assert_eq!(found, head());
        reader.collect()
    }

    #[test]
    fn every_value_comes_back() {
        let numbers = [f64::INFINITY, f64::NEG_INFINITY, -0.0, 5e-324, 0.1 + 0.2, 1e300];
        let numbers = numbers.map(|x| LogValue::Number(format!("{x:?}"))).to_vec();
        let values = [
            LogValue::Null,
            LogValue::Given,
            LogValue::Unreadable,
            LogValue::Room(3),
            LogValue::State(2),
            LogValue::Number("NaN".into()),
            LogValue::Text(b"a \"b\" \\ \n\r\t\x01 \xff, [x]) -> { \xc3\xa4".to_vec()),
            LogValue::Text(Vec::new()),
            LogValue::Bytes(vec![0, 255, 16]),
            LogValue::Bytes(Vec::new()),
            LogValue::List(numbers),
            LogValue::List(vec![LogValue::Text(b", ".to_vec()), LogValue::Null, LogValue::Bytes(vec![7])]),
            LogValue::List(Vec::new()),
        ];
        let named: Vec<NamedValue> = values.iter().enumerate().map(|(i, v)| (format!("a{i}"), v.clone())).collect();
        let ended = CallEnd { status: status(0), results: named.clone() };
        let calls = read(&format!("{} -> {ended}\n", begun(Some(0.1), "f", &named))).unwrap();
        assert_eq!(calls.len(), 1);
        assert_eq!((calls[0].time, calls[0].name.as_str(), calls[0].line), (Some(0.1), "f", 7));
        assert_eq!((&calls[0].arguments, calls[0].ended.as_ref()), (&named, Some(&ended)));
    }

    #[test]
    fn calls_inside_a_call_belong_to_it() {
        let text =
            "0.0 f() {\n  0.0 g(a=1) {\n    0.5 h() -> OK\n  } -> OK b=2\n  0.0 i() -> OK\n} -> Error\n- k() -> OK\n";
        let calls = read(text).unwrap();
        let names = |calls: &[LoggedCall]| calls.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&calls), ["f", "k"]);
        assert_eq!(names(&calls[0].inside), ["g", "i"]);
        assert_eq!((calls[0].inside[0].inside[0].line, calls[1].line, calls[1].time), (9, 13, None));
        assert_eq!(calls[0].ended.as_ref().unwrap().status, "Error");
    }

    #[test]
    fn a_status_has_the_name_of_the_standards() {
        let names = [0, 1, 2, 3, 4, 5, -1].map(status);
        assert_eq!(names, ["OK", "Warning", "Discard", "Error", "Fatal", "5", "-1"]);
    }

    /// Wherever the file of a host that was killed ends, its whole calls are read.
    #[test]
    fn a_file_may_end_anywhere() {
        let text = "0.0 f(a=\"x\") -> OK b=[1, 2]\n0.0 f() {\n  0.0 g(a=1) -> OK\n} -> OK\n0.0 k(a=0x01)";
        for end in 0..=text.len() {
            let calls = read(&text[..end]).unwrap_or_else(|e| panic!("{:?}: {e}", &text[..end]));
            let whole = calls.iter().filter(|c| c.ended.is_some()).count();
            let lines = text[..end].matches("\n0.0").count() + usize::from(end > 28) - usize::from(end > 29);
            assert!(whole >= lines.min(2), "{end}: {calls:?}");
        }
        let last = read(text).unwrap().pop().unwrap();
        assert_eq!((last.name.as_str(), last.line, last.ended), ("k", 11, None));
    }

    #[test]
    fn a_wrong_line_is_named() {
        for (text, said) in [
            ("0.0 f() -> OK\nhello\n", "line 8: \"hello\" is not a time in s"),
            ("0.0 f(a=x) -> OK\n", "line 7: column 9: \"x\" is not a value"),
            ("0.0 f(a=0x1) -> OK\n", "line 7: column 9: \"0x1\" is not a value"),
            ("0.0 f(a=1 b=2) -> OK\n", "line 7: column 10: \", \" is expected"),
            ("0.0 f(a=\"x) -> OK\n", "line 7: a text has no end"),
            ("0.0 f()\n0.0 g() -> OK\n", "line 7: the call has no end, and is not the last one of the file"),
            ("0.0 f(a=[[1]]) -> OK\n", "line 7: column 10: an array in an array"),
            (&"0.0 f() {\n".repeat(99), "line 23: more than 16 calls in one another"),
            ("0.0 f() -> OK }\n", "line 7: column 16: \"=\" is expected"),
            ("0.0 f() [\n0.0 g() -> OK\n", "line 7: after the call: \" [\""),
            ("0.0 f() -> OK {\n", "line 7: column 16: \"=\" is expected"),
            ("0.0 f() {\n} -> OK a=1]\n", "line 8: after the end of a call: \"]\""),
            ("0.0 f() {\n} -> OK a=x\n", "line 8: column 6: \"x\" is not a value"),
            ("0.0 f(a=\"\\t\") -> OK\n", "line 7: column 11: an unknown escape"),
            ("0.0 f(a=\"\\x4g\") -> OK\n", "line 7: column 12: \\x has two hexadecimal digits"),
        ] {
            assert_eq!(read(text).unwrap_err(), said, "{text}");
        }
        assert!(LogReader::new("time,x\n").unwrap_err().starts_with("line 1: not a call log"));
        assert!(LogReader::new("FMU call log: 9\n").unwrap_err().contains("format \"9\""));
        assert!(LogReader::new("FMU call log: 1\nFMI: 3.0\n").unwrap_err().starts_with("line 3"));
        let headless = format!("{}0.0 f() -> OK\n", head().to_string().trim_end_matches('\n').to_owned() + "\n");
        assert_eq!(LogReader::new(&headless).unwrap_err(), "line 6: an empty line ends the head");
    }
}
