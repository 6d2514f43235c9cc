//! What XML 1.0 allows in a document: characters (production 2) and names (productions 4 to 5).

/// Whether a document may have this character, as itself or by reference.
pub(super) fn is_legal(c: char) -> bool {
    matches!(c, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..)
}

/// Whether this is the name of an element or attribute, with or without a namespace prefix.
pub(super) fn is_name(text: &str) -> bool {
    // The names of the FMI standards are ASCII; only others need the tables below.
    let ascii = |c: char| c.is_ascii_alphabetic() || matches!(c, ':' | '_');
    let start = |c: char| ascii(c) || !c.is_ascii() && starts(c);
    let inner = |c: char| start(c) || c.is_ascii_digit() || matches!(c, '-' | '.') || continues(c);
    text.starts_with(start) && text.chars().all(inner)
}

/// Whether a name may start with this character, which is not ASCII.
fn starts(c: char) -> bool {
    matches!(c, '\u{c0}'..='\u{2ff}' | '\u{370}'..='\u{1fff}' | '\u{200c}' | '\u{200d}' | '\u{2070}'..='\u{218f}'
        | '\u{2c00}'..='\u{2fef}' | '\u{3001}'..='\u{d7ff}' | '\u{f900}'..='\u{fdcf}' | '\u{fdf0}'..='\u{fffd}' | '\u{10000}'..='\u{effff}')
        && !matches!(c, '\u{d7}' | '\u{f7}' | '\u{37e}')
}

/// Whether a name may go on with this character, which is not ASCII and starts none.
fn continues(c: char) -> bool {
    matches!(c, '\u{b7}' | '\u{300}'..='\u{36f}' | '\u{203f}' | '\u{2040}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names() {
        for name in ["a", "_", "ssd:System", "x-1.b", "\u{e4}", "a\u{b7}", "\u{37f}"] {
            assert!(is_name(name), "{name}");
        }
        for no_name in ["", "1a", "-a", ".", "a b", "a\n", "a<", "\u{d7}", "\u{b7}a", "\u{300}", "\u{37e}", "a\u{2000}"]
        {
            assert!(!is_name(no_name), "{no_name:?}");
        }
    }
}
