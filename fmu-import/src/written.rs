//! Names as a user writes them, alone, before an equals sign, in a list, or as a pattern: a name may contain commas, equals
//! signs and blanks, so the known names decide where it ends.

/// `NAME=VALUE`: the name is the shortest known one before an equals sign; else it ends at the first sign outside of quotation
/// marks.
pub fn assignment(text: &str, known: impl Fn(&str) -> bool) -> Option<(&str, &str)> {
    pair(text, known, |_| true)
}

/// `NAME=OTHER`, where both sides are known.
pub fn pair(text: &str, known: impl Fn(&str) -> bool, other: impl Fn(&str) -> bool) -> Option<(&str, &str)> {
    let signs = || text.match_indices('=').map(move |(at, _)| (text[..at].trim(), &text[at + 1..]));
    let both = signs().find(|(name, value)| known(name) && other(value.trim()));
    let one = || signs().find(|(name, _)| known(name));
    let outside = || signs().find(|(name, _)| name.matches('\'').count().is_multiple_of(2));
    both.or_else(one).or_else(outside).or_else(|| signs().next())
}

/// Names with commas between them: the shortest known one each; else it ends at a comma outside of brackets and quotation marks.
/// A name may be in double quotation marks.
pub fn names(text: &str, known: impl Fn(&str) -> bool) -> Vec<String> {
    let (mut names, mut rest) = (Vec::new(), text);
    while !rest.trim().is_empty() {
        let ends = || rest.match_indices(',').map(|(at, _)| at).chain([rest.len()]);
        let whole = |name: &str| {
            name.matches('[').count() == name.matches(']').count()
                && name.matches('\'').count().is_multiple_of(2)
                && name.matches('"').count().is_multiple_of(2)
        };
        let found = ends().find(|&at| known(rest[..at].trim()));
        let end = found.or_else(|| ends().find(|&at| whole(&rest[..at]))).unwrap_or(rest.len());
        let name = rest[..end].trim();
        let inner = name.strip_prefix('"').and_then(|name| name.strip_suffix('"'));
        match inner.filter(|_| !known(name)) {
            Some(inner) => names.push(inner.replace("\"\"", "\"")),
            None if name.is_empty() => {}
            None => names.push(name.to_owned()),
        }
        rest = rest.get(end + 1..).unwrap_or_default();
    }
    names
}

/// Whether a name is a pattern: `*` stands for any text, `?` for one character.
pub fn is_pattern(name: &str) -> bool {
    name.contains(['*', '?'])
}

/// Whether a name has the form of a pattern.
pub fn matches(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    // The position after the last star, and the text it matches so far.
    let (mut p, mut n, mut back) = (0, 0, None);
    while n < name.len() {
        if p < pattern.len() && pattern[p] == '*' {
            back = Some((p + 1, n));
            p += 1;
        } else if p < pattern.len() && (pattern[p] == '?' || pattern[p] == name[n]) {
            (p, n) = (p + 1, n + 1);
        } else if let Some((after, covered)) = back {
            (p, n, back) = (after, covered + 1, Some((after, covered + 1)));
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(name: &str) -> bool {
        ["a", "'a=b'", "m[1,2]", "'x,y'", "c d", "q\"r", "p.u", "b=c"].contains(&name)
    }

    #[test]
    fn a_name_ends_where_it_is_known() {
        for (text, name, value) in [
            ("a=1", "a", "1"),
            ("'a=b'=3", "'a=b'", "3"),
            ("a=x=y", "a", "x=y"),
            ("b=c=d=e", "b=c", "d=e"),
            ("m[1,2]=1,5", "m[1,2]", "1,5"),
            ("c d = 4", "c d", " 4"),
            ("'no=ne'=5", "'no=ne'", "5"),
            ("none=5", "none", "5"),
        ] {
            assert_eq!(assignment(text, known), Some((name, value)), "{text}");
        }
        assert_eq!(assignment("a", known), None);
        assert_eq!(pair("b=c='a=b'", known, known), Some(("b=c", "'a=b'")));
    }

    #[test]
    fn a_list_splits_between_names() {
        let all = "a, m[1,2],'x,y',c d,\"q\"\"r\",none[3,4],'no,ne',*";
        assert_eq!(names(all, known), ["a", "m[1,2]", "'x,y'", "c d", "q\"r", "none[3,4]", "'no,ne'", "*"]);
        assert_eq!(names("q\"r,a", known), ["q\"r", "a"]);
    }

    #[test]
    fn patterns_match_whole_names() {
        for (pattern, name, is) in [
            ("*", "p.u", true),
            ("p.*", "p.u", true),
            ("p.*", "q.p.u", false),
            ("*.u?", "p.u", false),
            ("*.u?", "p.u1", true),
            ("*a*b*", "xaybz", true),
            ("*a*b*", "xbya", false),
            ("m[?,2]", "m[1,2]", true),
        ] {
            assert_eq!(matches(pattern, name), is, "{pattern} {name}");
        }
    }
}
