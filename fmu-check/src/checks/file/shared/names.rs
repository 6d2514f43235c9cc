//! The grammar of structured names.

/// `name = identifier | "der(" identifier ["," order] ")"`, identifiers joined by dots, each with indices; FMI 2.0.5,
/// 2.2.9. A part in single quotes may contain any characters, with backslash escapes.
pub(crate) fn grammar(name: &str) -> Result<(), String> {
    let inner = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')'));
    let body = match inner {
        Some(inner) => match inner.rsplit_once(',') {
            Some((body, order)) if order.trim().bytes().all(|b| b.is_ascii_digit()) => body,
            _ => inner,
        },
        None => name,
    };
    let mut rest = body;
    loop {
        rest = part(rest)?;
        match rest.strip_prefix('.') {
            Some(next) => rest = next,
            None if rest.is_empty() => return Ok(()),
            None => return Err(format!("{rest:?} is unexpected")),
        }
    }
}

fn part(text: &str) -> Result<&str, String> {
    let mut rest = if let Some(quoted) = text.strip_prefix('\'') {
        let mut escaped = false;
        let end = quoted.char_indices().find(|&(_, c)| {
            let closes = c == '\'' && !escaped;
            escaped = c == '\\' && !escaped;
            closes
        });
        &quoted[end.ok_or("a quote is not closed")?.0 + 1..]
    } else {
        let letter = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let end = text.find(|c| !letter(c)).unwrap_or(text.len());
        if end == 0 || text.starts_with(|c: char| c.is_ascii_digit()) {
            return Err("a part does not start with a letter or an underscore".into());
        }
        &text[end..]
    };
    if let Some(indices) = rest.strip_prefix('[') {
        let (inside, after) = indices.split_once(']').ok_or("a bracket is not closed")?;
        let number = |i: &str| !i.trim().is_empty() && i.trim().bytes().all(|b| b.is_ascii_digit());
        if !inside.split(',').all(number) {
            return Err(format!("[{inside}] is not a list of indices"));
        }
        rest = after;
    }
    Ok(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_the_grammar() {
        for good in ["a", "_x1", "a.b.c", "a[1].b[2,3]", "der(a.b)", "der(a,2)", "'any thing.'", "a.'it\\'s'.c"] {
            assert_eq!(grammar(good), Ok(()), "{good}");
        }
        for bad in ["", "1a", "a b", "a.", ".a", "a[", "a[]", "a[x]", "a-b", "'open", "der(a"] {
            assert!(grammar(bad).is_err(), "{bad}");
        }
    }
}
