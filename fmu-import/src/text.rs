//! Foreign text for a terminal, and paths as URIs.

use std::borrow::Cow;
use std::fmt::Write;
use std::path::Path;

/// The text with its control characters escaped, `\u{1b}` for ESC: text of an FMU must not control a terminal.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(commands) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if commands(c) {
            let _ = write!(out, "{}", c.escape_unicode());
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

/// Like [`printable`], for a text of several lines.
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    if text.chars().any(|c| c != '\n' && commands(c)) {
        return Cow::Owned(text.split('\n').map(printable).collect::<Vec<_>>().join("\n"));
    }
    Cow::Borrowed(text)
}

/// Control characters, and those that change the text direction (Unicode, 9.0, UAX 9).
fn commands(c: char) -> bool {
    c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A message that names each thing once: `--record x: x: is not there` becomes `--record x: is not there`. A name is the text
/// between colons; it is already present if the part before ends with it, or with it and a value.
pub fn once(text: &str) -> String {
    let (parts, mut kept) = (text.split(": ").collect::<Vec<_>>(), Vec::<&str>::new());
    let mut next = 0;
    while next < parts.len() {
        // An error and its cause may have the same text of several parts.
        let repeats = |&len: &usize| kept.len() > len && parts[next..].starts_with(&kept[kept.len() - len..]);
        if let Some(len) = [3, 2].into_iter().find(repeats) {
            next += len;
            continue;
        }
        let part = parts[next];
        next += 1;
        let is_named = kept.last().is_some_and(|before| {
            let mut ends = before.match_indices(part).map(|(at, _)| (at, &before[at + part.len()..]));
            let begins = |at: usize| at == 0 || before[..at].ends_with(' ');
            !part.is_empty() && ends.any(|(at, rest)| begins(at) && (rest.is_empty() || rest.starts_with('=')))
        });
        if !is_named {
            kept.push(part);
        }
    }
    kept.join(": ")
}

/// `file:///` and the path, with characters outside RFC 3986 percent-encoded.
pub fn file_uri(path: &Path) -> String {
    let path = path.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
    let root = if path.starts_with('/') { "file://" } else { "file:///" };
    let encode = |byte: u8| {
        let plain = byte.is_ascii_alphanumeric() || b"-._~/:".contains(&byte);
        if plain { char::from(byte).to_string() } else { format!("%{byte:02X}") }
    };
    root.chars().map(String::from).chain(path.bytes().map(encode)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_commands_a_terminal_is_escaped() {
        assert_eq!(printable("\u{1b}[31mred\u{7}"), "\\u{1b}[31mred\\u{7}");
        assert_eq!(printable("a\nb \u{202e}c"), "a\\u{a}b \\u{202e}c");
        assert_eq!(printable_lines("a\u{1b}\nb\u{e9}\u{4e2d}\n"), "a\\u{1b}\nb\u{e9}\u{4e2d}\n");
        assert!(matches!(printable("plain \u{e9}"), Cow::Borrowed(_)));
    }

    #[test]
    fn a_message_names_each_thing_once() {
        for (text, expected) in [
            ("--record x: x: is no variable", "--record x: is no variable"),
            ("--input u=0:1,1:2: u: is no input", "--input u=0:1,1:2: is no input"),
            ("input: a b: a b: is no input; it has b", "input: a b: is no input; it has b"),
            ("--record p.x: x: is no variable", "--record p.x: x: is no variable"),
            ("a.ssp: line 3: x has 3: y", "a.ssp: line 3: x has 3: y"),
            ("a: b: a", "a: b: a"),
            ("a.fmu: i/o error: full: i/o error: full", "a.fmu: i/o error: full"),
            ("", ""),
        ] {
            assert_eq!(once(text), expected);
        }
    }

    #[test]
    #[cfg(unix)]
    fn uris_are_encoded() {
        assert_eq!(file_uri(Path::new("/tmp/a b#ü")), "file:///tmp/a%20b%23%C3%BC");
    }
}
