//! The preset of an FMU: start values in a file of its resources, which replace the values of the model's `Default`.
//!
//! `fmu preset` writes the file, the exporter applies it when it creates an instance. It is JSON; each start value is a text,
//! as in the attribute `start` of `modelDescription.xml`, so numbers keep all bits and infinities are possible:
//!
//! ```json
//! {
//!   "format": "fmu preset",
//!   "version": 2,
//!   "start": {
//!     "motor.R_s": "0.775",
//!     "motor.n_p": "5",
//!     "label": "two\nlines",
//!     "weights[1,2]": "0.5"
//!   }
//! }
//! ```
//!
//! A name is that of a scalar or of an element of an array. An enumeration has its integer, a Boolean `true` or `false`. The
//! hash of the file follows the model's token after `+`, so the token identifies the preset.

use crate::{Fault, Hash};
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;

/// Name of the file in the folder `resources/`.
pub const FILE: &str = "fmu-preset.json";

/// Name of the file in the format 1, which earlier versions wrote.
pub const FORMER_FILE: &str = "fmu-preset.txt";

/// Largest size of the file in bytes.
pub const MOST: u64 = 1 << 20;

/// Entry `format` of the file.
const FORMAT: &str = "fmu preset";
/// The version that is written and read.
const VERSION: u64 = 2;

/// A start value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PresetValue {
    /// Name of the variable, an element of an array as `name[1,2]`.
    pub name: String,
    /// Its start value.
    pub value: String,
}

/// Format and version, in front of entries that other versions may not have.
#[derive(Deserialize)]
struct Head<'a> {
    #[serde(borrow)]
    format: Cow<'a, str>,
    version: u64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content<'a, V> {
    #[serde(borrow)]
    format: Cow<'a, str>,
    version: u64,
    start: V,
}

/// Start values in the order of the file.
struct InOrder(Vec<PresetValue>);

impl<'de> Deserialize<'de> for InOrder {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Entries)
    }
}

struct Entries;

impl<'de> Visitor<'de> for Entries {
    type Value = InOrder;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object with a start value for each name")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<InOrder, A::Error> {
        let mut values = Vec::new();
        while let Some(name) = map.next_key::<String>()? {
            let value = map.next_value().map_err(|e| A::Error::custom(format_args!("{name}: {e}")))?;
            values.push(PresetValue { name, value });
        }
        Ok(InOrder(values))
    }
}

/// Names and values that are written in their order.
struct Pairs<'a>(Vec<(&'a str, &'a str)>);

impl Serialize for Pairs<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().copied())
    }
}

/// The file with these names and values.
pub fn write<'a>(values: impl IntoIterator<Item = (&'a str, &'a str)>) -> String {
    let start = Pairs(values.into_iter().collect());
    // Texts always have a JSON form.
    let json = serde_json::to_string_pretty(&Content { format: FORMAT.into(), version: VERSION, start });
    json.unwrap_or_default() + "\n"
}

/// The names and values of a file.
///
/// # Errors
/// Names the fault and its position: size, syntax, format, version, or an entry that is not a text.
pub fn read(bytes: &[u8]) -> Result<Vec<PresetValue>, Fault> {
    if bytes.len() as u64 > MOST {
        return Err(Fault::new(format!("is larger than {MOST} bytes, the maximum size of a preset")));
    }
    if bytes.starts_with(b"fmu preset 1\n") {
        return Err(former());
    }
    let wrong = |e: serde_json::Error| Fault::new(format!("is not a preset: {e}"));
    let head: Head = serde_json::from_slice(bytes).map_err(wrong)?;
    if head.format != FORMAT {
        return Err(Fault::new(format!("is not a preset: its format is {:?}, not {FORMAT:?}", head.format)));
    }
    if head.version != VERSION {
        let found = head.version;
        return Err(Fault::new(format!("has the version {found}, and this FMU reads the version {VERSION}")));
    }
    serde_json::from_slice(bytes).map_err(wrong).map(|content: Content<'_, InOrder>| content.start.0)
}

/// The refusal of a preset in the format 1.
#[must_use]
pub fn former() -> Fault {
    Fault::new(format!(
        "{FORMER_FILE} is a preset in the format 1 of an earlier `fmu`, and this version reads {FILE}, version {VERSION}: build \
         the FMU again and write its preset with `fmu preset`"
    ))
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
        let head =
            "{\n  \"format\": \"fmu preset\",\n  \"version\": 2,\n  \"start\": {\n    \"motor.R_s\": \"0.775\",\n";
        assert!(text.starts_with(head) && text.ends_with("}\n"), "{text}");
        let back = read(text.as_bytes()).unwrap();
        let pairs: Vec<_> = back.iter().map(|e| (e.name.as_str(), e.value.as_str())).collect();
        assert_eq!(pairs, values, "in their order");
        assert_eq!(read(write([]).as_bytes()).unwrap(), []);
        // What a user's editor or script writes.
        let compact = br#"{"start":{"x":"1","x":"\u0032"},"version":2,"format":"fmu preset"}"#;
        let values = read(compact).unwrap();
        assert_eq!(values.iter().map(|e| e.value.as_str()).collect::<Vec<_>>(), ["1", "2"]);
    }

    #[test]
    fn what_is_no_preset_says_why() {
        let large = vec![b' '; (1 << 20) + 1];
        for (bytes, why) in [
            (&b""[..], "is not a preset: EOF while parsing"),
            (b"<xml/>\n", "is not a preset: expected value at line 1 column 1"),
            (b"fmu preset 1\nx\t1\n", "fmu-preset.txt is a preset in the format 1 of an earlier `fmu`"),
            (b"{}", "is not a preset: missing field `format`"),
            (br#"{"format":"x","version":2,"start":{}}"#, r#"is not a preset: its format is "x", not "fmu preset""#),
            (br#"{"format":"fmu preset","start":{}}"#, "missing field `version`"),
            (br#"{"format":"fmu preset","version":"2","start":{}}"#, "expected u64"),
            (
                br#"{"format":"fmu preset","version":3,"values":[]}"#,
                "has the version 3, and this FMU reads the version 2",
            ),
            (br#"{"format":"fmu preset","version":2}"#, "missing field `start`"),
            (br#"{"format":"fmu preset","version":2,"start":{},"more":1}"#, "unknown field `more`"),
            (br#"{"format":"fmu preset","version":2,"start":{}} x"#, "trailing characters"),
            (
                br#"{"format":"fmu preset","version":2,"start":[]}"#,
                "expected an object with a start value for each name",
            ),
            (
                br#"{"format":"fmu preset","version":2,"start":{"x":1}}"#,
                "x: invalid type: integer `1`, expected a string",
            ),
            (br#"{"format":"fmu preset","version":2,"start":{"x":"1"}"#, "EOF while parsing"),
            (b"{\"format\":\"fmu preset\",\"version\":2,\"start\":{\"x\":\"\xff\"}}", "is not a preset: "),
            (&large, "is larger than 1048576 bytes"),
        ] {
            let said = read(bytes).unwrap_err().to_string();
            assert!(said.contains(why), "{said}");
        }
    }

    #[test]
    fn a_token_identifies_its_preset() {
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
