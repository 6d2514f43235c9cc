//! Text for readers: doc comments, string literals and the lines of pages, with the patterns of awkward sentences.

use std::path::{Path, PathBuf};

/// Sources of every room without tests, and pages.
pub fn sources(root: &Path) -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_string_lossy();
            if path.is_dir() {
                if !["target", "tests", "benches"].contains(&&*name) && !name.starts_with('.') {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|e| e == "rs" || e == "md" || e == "html") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The texts of a file, each with the number of its first line.
pub fn texts(path: &Path) -> Vec<(usize, String)> {
    let text = std::fs::read_to_string(path).unwrap();
    if path.extension().is_some_and(|e| e == "rs") {
        let tests = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
        rust(&text[..tests])
    } else {
        // A paragraph may span several lines.
        let lines = text.lines().map(str::trim);
        blocks(lines.map(|line| (!line.is_empty()).then_some(line)))
    }
}

/// Joins neighboring lines.
fn blocks<'a>(lines: impl Iterator<Item = Option<&'a str>>) -> Vec<(usize, String)> {
    let (mut found, mut open): (Vec<(usize, String)>, bool) = (Vec::new(), false);
    for (number, line) in lines.enumerate() {
        match (line, found.last_mut()) {
            (Some(line), Some((_, block))) if open => {
                block.push(' ');
                block.push_str(line);
            }
            (Some(line), _) => found.push((number + 1, line.to_owned())),
            (None, _) => {}
        }
        open = line.is_some();
    }
    found
}

/// Doc comments by paragraph, and string literals.
fn rust(text: &str) -> Vec<(usize, String)> {
    fn doc(line: &str) -> Option<&str> {
        line.trim().strip_prefix("///").or_else(|| line.trim().strip_prefix("//!")).map(str::trim)
    }
    let mut found = blocks(text.lines().map(doc).map(|line| line.filter(|line| !line.is_empty())));
    let mut rest = text;
    while let Some(at) = rest.find(['"', '\'', '/']) {
        let begins = &rest[at..];
        let line = 1 + text[..text.len() - begins.len()].matches('\n').count();
        let end = if begins.starts_with("//") {
            begins.find('\n').unwrap_or(begins.len())
        } else if let Some(literal) = begins.strip_prefix('"') {
            let hashes = rest[..at].bytes().rev().take_while(|b| *b == b'#').count();
            let raw = rest[..at - hashes].ends_with('r');
            let close = format!("\"{}", "#".repeat(if raw { hashes } else { 0 }));
            let ends = |at: &usize| {
                let escapes = literal[..*at].bytes().rev().take_while(|b| *b == b'\\').count();
                literal[*at..].starts_with(&close) && (raw || escapes.is_multiple_of(2))
            };
            let end = literal.match_indices('"').map(|(at, _)| at).find(ends).unwrap_or(literal.len());
            let lines: Vec<&str> = literal[..end].split("\\\n").map(str::trim_start).collect();
            found.push((line, lines.concat()));
            1 + end + close.len()
        } else if let Some(rest) = begins.strip_prefix('\'') {
            // A character, or a lifetime.
            let mut after = rest.chars();
            match (after.next(), after.next()) {
                (Some('\\'), Some(escaped)) => {
                    let at = 1 + escaped.len_utf8();
                    2 + at + rest[at..].find('\'').unwrap_or(0)
                }
                (Some(c), Some('\'')) => 2 + c.len_utf8(),
                _ => 1,
            }
        } else {
            1
        };
        rest = &begins[end.min(begins.len())..];
    }
    found
}

/// The first pattern that a text has, with the words around it.
pub fn pattern(text: &str) -> Option<String> {
    let around = |at: usize| {
        let before: String = text[..at].chars().rev().take(30).collect();
        let before: String = before.chars().rev().collect();
        format!("… {before}{} …", text[at..].chars().take(50).collect::<String>())
    };
    if ["The same ", "As ", "Of "].iter().any(|beginning| text.starts_with(beginning)) {
        return Some(around(0));
    }
    for end in [". ", ": ", "! ", "? ", ">"] {
        if let Some(at) = text.find(&format!("{end}The same ")) {
            return Some(around(at));
        }
    }
    for words in ["is no ", "are no ", "belongs into", "belong into", "told as"] {
        for (at, _) in text.match_indices(words) {
            let (before, after) = (&text[..at], &text[at + words.len()..]);
            let whole = before.is_empty() || before.ends_with([' ', '(', '\'', '"', '`']);
            // "There is no ...", "is no longer", "is no more than".
            let plain = before.to_lowercase().ends_with("there ")
                || ["longer", "more than", "less than"].iter().any(|word| after.starts_with(word));
            if whole && !(plain && words.ends_with("no ")) {
                return Some(around(at));
            }
        }
    }
    None
}
