//! Names while compiling: their form, and the ones that exist already.

use crate::refusal::{demand, fail};

/// Maximum number of rows in a table.
pub(crate) const MOST_ROWS: usize = 16_384;

/// Number of chains of names; a power of two.
const CHAINS: usize = 4096;

/// No name.
const NONE: u16 = u16::MAX;

/// The names of rows or states by their number, found in about the same time however many there are.
pub(crate) struct Names {
    /// Latest name of each chain.
    heads: [u16; CHAINS],
    /// The name before it in the same chain.
    next: [u16; MOST_ROWS],
    texts: [&'static str; MOST_ROWS],
    len: usize,
}

impl Names {
    #[expect(clippy::large_stack_arrays, reason = "only while compiling")]
    pub(crate) const fn new() -> Self {
        Self { heads: [NONE; CHAINS], next: [NONE; MOST_ROWS], texts: [""; MOST_ROWS], len: 0 }
    }

    /// The number of a name; `None` if absent.
    pub(crate) const fn find(&self, name: &str) -> Option<usize> {
        let mut at = self.heads[chain(name)];
        while at != NONE {
            if same(self.texts[at as usize], name) {
                return Some(at as usize);
            }
            at = self.next[at as usize];
        }
        None
    }

    /// Adds the next name, which differs from all others unless it is empty; `taken` is the fault.
    #[track_caller]
    #[expect(clippy::cast_possible_truncation, reason = "MOST_ROWS fits in 16 bits")]
    pub(crate) const fn add(&mut self, name: &'static str, taken: &str) {
        demand(self.len < MOST_ROWS, name, "more than 16384 rows or states: use parts, or arrays");
        let chain = chain(name);
        demand(name.is_empty() || self.find(name).is_none(), name, taken);
        (self.texts[self.len], self.next[self.len]) = (name, self.heads[chain]);
        self.heads[chain] = self.len as u16;
        self.len += 1;
    }
}

/// The chain of a name. Eight bytes at a time: the compiler counts rounds of loops, and stops at some millions.
#[expect(clippy::cast_possible_truncation, reason = "keeps the low bits")]
const fn chain(name: &str) -> usize {
    let (bytes, mut i, mut hash) = (name.as_bytes(), 0, name.len() as u64);
    while i < bytes.len() {
        let mut word = bytes[i] as u64;
        if i + 8 <= bytes.len() {
            word |= (bytes[i + 1] as u64) << 8
                | (bytes[i + 2] as u64) << 16
                | (bytes[i + 3] as u64) << 24
                | (bytes[i + 4] as u64) << 32
                | (bytes[i + 5] as u64) << 40
                | (bytes[i + 6] as u64) << 48
                | (bytes[i + 7] as u64) << 56;
            i += 8;
        } else {
            i += 1;
        }
        // The factor comes from Knuth's multiplicative hash.
        let product = (hash ^ word) as u128 * 0x9e37_79b9_7f4a_7c15;
        hash = (product ^ (product >> 64)) as u64;
    }
    (hash ^ (hash >> 32)) as usize & (CHAINS - 1)
}

/// Whether two texts are equal, eight bytes at a time.
const fn same(a: &str, b: &str) -> bool {
    let (a, b, mut i) = (a.as_bytes(), b.as_bytes(), 0);
    if a.len() != b.len() {
        return false;
    }
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
        if i + 7 <= a.len() {
            let first = a[i] == b[i] && a[i + 1] == b[i + 1] && a[i + 2] == b[i + 2] && a[i + 3] == b[i + 3];
            if !(first && a[i + 4] == b[i + 4] && a[i + 5] == b[i + 5] && a[i + 6] == b[i + 6]) {
                return false;
            }
            i += 7;
        }
    }
    true
}

/// Checks the name of a row: a structured name of both standards (FMI 2.0.5, 2.2.9; FMI 3.0.2, 2.4.7.5.1), or the prefix of a part.
#[track_caller]
pub(crate) const fn check_form(name: &str, is_prefix: bool) {
    let (mut room, plain) =
        ([0; 256], "not a structured name of FMI: letters of ASCII, digits and _ in parts with dots; ");
    let suggested = match form(name.as_bytes(), is_prefix) {
        Form::Structured => return,
        Form::Quotable if !is_prefix => quoted(name, &mut room),
        Form::Quotable | Form::Other => "",
    };
    if suggested.is_empty() {
        fail(&[name, ": ", plain, "put other characters of ASCII into single quotes, as in 'rate [1/s]' or 'Waerme'"]);
    }
    fail(&[name, ": ", plain, "write ", suggested]);
}

/// The name with its parts in single quotes where they need them; empty if it is too long.
const fn quoted<'a>(name: &str, text: &'a mut [u8; 256]) -> &'a str {
    let (bytes, mut first, mut len) = (name.as_bytes(), 0, 0);
    while first <= bytes.len() {
        let mut end = first;
        while end < bytes.len() && bytes[end] != b'.' {
            end += 1;
        }
        let part = bytes.split_at(end).0.split_at(first).1;
        if len + part.len() + 3 > text.len() {
            return "";
        }
        // An empty part has no quoted form: the whole name is one part.
        if part.is_empty() && first > 0 || end < bytes.len() && part.is_empty() {
            return whole(name, text);
        }
        let bare = matches!(form(part, false), Form::Structured);
        if first > 0 {
            text[len] = b'.';
            len += 1;
        }
        len = append(text, len, if bare { b"" } else { b"'" });
        len = append(text, len, part);
        len = append(text, len, if bare { b"" } else { b"'" });
        first = end + 1;
    }
    text_of(text, len)
}

/// The name in single quotes.
const fn whole<'a>(name: &str, text: &'a mut [u8; 256]) -> &'a str {
    let opened = append(text, 0, b"'");
    let named = append(text, opened, name.as_bytes());
    let len = append(text, named, b"'");
    text_of(text, len)
}

/// Writes `more` at `len`; returns the new length.
const fn append(text: &mut [u8; 256], len: usize, more: &[u8]) -> usize {
    let mut i = 0;
    while i < more.len() && len + i < text.len() {
        text[len + i] = more[i];
        i += 1;
    }
    len + i
}

const fn text_of(text: &[u8; 256], len: usize) -> &str {
    match std::str::from_utf8(text.split_at(len).0) {
        Ok(text) => text,
        Err(_) => "",
    }
}

enum Form {
    Structured,
    /// Structured in single quotes.
    Quotable,
    Other,
}

/// The form of a name: parts with dots, each with indices in brackets, as in `cells[2].u`; or `der(name)`.
const fn form(bytes: &[u8], is_prefix: bool) -> Form {
    let (mut i, mut quotable, mut structured) = (0, true, true);
    let mut end = bytes.len();
    if end > 5 && matches!([bytes[0], bytes[1], bytes[2], bytes[3], bytes[end - 1]], [b'd', b'e', b'r', b'(', b')']) {
        (i, end) = (4, end - 1);
    }
    let mut at = At::First;
    while i < end {
        let byte = bytes[i];
        if !matches!(byte, b' '..=b'~') {
            return Form::Other;
        }
        quotable &= !matches!(byte, b'\'' | b'\\');
        at = match (at, byte) {
            // An escape is a backslash and a character.
            (At::Quoted, b'\\') if i + 1 < end => {
                i += 1;
                At::Quoted
            }
            (At::Quoted, b'\'') | (At::Index, b']') => At::Last,
            (At::Quoted, _) | (At::First, b'\'') => At::Quoted,
            (At::First | At::Word, b'_' | b'a'..=b'z' | b'A'..=b'Z') | (At::Word, b'0'..=b'9') => At::Word,
            (At::Word | At::Last, b'[') | (At::Index, b'0'..=b'9' | b',') => At::Index,
            (At::Word | At::Last, b'.') => At::First,
            (at, _) => {
                structured = false;
                at
            }
        };
        i += 1;
    }
    let whole = match at {
        At::First => is_prefix || bytes.is_empty(),
        At::Word | At::Last => true,
        At::Quoted | At::Index => false,
    };
    if structured && whole {
        Form::Structured
    } else if quotable {
        Form::Quotable
    } else {
        Form::Other
    }
}

/// A position in a name.
#[derive(Clone, Copy)]
enum At {
    /// The start of a part.
    First,
    Word,
    Quoted,
    Index,
    /// After a quote or a bracket.
    Last,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structured_names() {
        let structured = |name: &str| matches!(form(name.as_bytes(), false), Form::Structured);
        for name in
            ["u", "_u2", "motor.R_s", "cells[2].u", "m[1,2]", "der(h)", "'rate [1/s]'", "a.'b c'.d", r"'don\'t'"]
        {
            assert!(structured(name), "{name}");
        }
        for name in
            ["Wärme", "T ambient", "2u", "a..b", "a.", "loss[W]", "loss/W", "m[1", "m[1]2", "'open", "a'b", "der(2)"]
        {
            assert!(!structured(name), "{name}");
        }
        let prefix = |name: &str| matches!(form(name.as_bytes(), true), Form::Structured);
        assert!(prefix("motor.") && prefix("energy_") && prefix("") && !prefix("T ambient."));
    }

    #[test]
    fn suggested_names_are_structured() {
        for (name, suggested) in [
            ("T ambient", "'T ambient'"),
            ("motor.loss [W]", "motor.'loss [W]'"),
            ("2u", "'2u'"),
            ("a..b", "'a..b'"),
            (".b", "'.b'"),
            ("cells[2].T max", "cells[2].'T max'"),
            ("der(2)", "'der(2)'"),
        ] {
            assert!(matches!(form(name.as_bytes(), false), Form::Quotable), "{name}");
            assert_eq!(quoted(name, &mut [0; 256]), suggested);
            assert!(matches!(form(suggested.as_bytes(), false), Form::Structured), "{suggested}");
        }
        assert_eq!(quoted(&"long ".repeat(60), &mut [0; 256]), "");
        assert!(["Wärme", "'open", "a'b"].iter().all(|name| matches!(form(name.as_bytes(), false), Form::Other)));
    }

    #[test]
    fn names_are_found() {
        let mut names = Box::new(Names::new());
        let all: Vec<&'static str> = (0..5000).map(|i| &*String::leak(format!("a.long.prefix.of.names_{i}"))).collect();
        for name in &all {
            names.add(name, "twice");
        }
        for (i, name) in all.iter().enumerate() {
            assert_eq!(names.find(name), Some(i));
        }
        assert_eq!(names.find("a.long.prefix.of.names_5000"), None);
    }
}
