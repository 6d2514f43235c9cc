//! Defects in the text of a message.

use crate::confidence::Confidence;
use fmu_import::raw::LogCall;

/// A text passed to the FMU, which it may log: `START` and `PERCENT`. Where an FMU uses it as a printf format, the `%d` is
/// replaced.
pub(crate) const START: &str = "a probe's text, 100";
/// See [`START`].
pub(crate) const PERCENT: &str = "%d";

/// A defect and its confidence.
pub(crate) fn fault(event: &LogCall) -> Option<(Confidence, String)> {
    let certain = |why: &str| Some((Confidence::Certain, why.to_owned()));
    if let Some(fault) = &event.fault {
        return certain(&format!("{fault}, so the importer cannot format the message"));
    }
    let Some(text) = event.text.as_deref() else {
        return match (&event.broken, &event.format) {
            (None, _) => certain("the message is NULL"),
            (_, None) => certain("it is not UTF-8"),
            (_, Some(_)) => certain("it is not UTF-8, because an argument of the format is missing or is not UTF-8"),
        };
    };
    let given = text.match_indices(START).map(|(at, start)| &text[at + start.len()..]);
    let mut altered = given.filter(|rest| !rest.starts_with(PERCENT));
    if text.trim().is_empty() {
        certain("the message is empty")
    } else if text.ends_with(['\n', '\r']) {
        certain("it ends with a line break")
    } else if let Some(c) = text.chars().find(|c| c.is_control() && !"\t\n\r\u{1b}".contains(*c)) {
        certain(&format!("it contains the control character {c:?}"))
    } else if altered.next().is_some() {
        certain(&format!("the FMU was given the text \"{START}{PERCENT}\" and has used it as a printf format"))
    } else if let Some(conversion) = unresolved(&text.replace(&format!("{START}{PERCENT}"), START)) {
        Some((Confidence::Likely, format!("{conversion:?} appears in place of a value")))
    } else if let Some(conversion) = event.format.as_deref().and_then(percentage) {
        Some((
            Confidence::Likely,
            format!("{conversion:?} is a conversion in this format; write a percent sign as \"%%\""),
        ))
    } else if text.contains(char::REPLACEMENT_CHARACTER) {
        Some((Confidence::Likely, "it contains the character U+FFFD, which replaces bytes that are not UTF-8".into()))
    } else {
        None
    }
}

/// A conversion of printf in a finished text, such as `%s` or `%.3g`. None follows a letter or digit, as in an encoded URL.
fn unresolved(text: &str) -> Option<&str> {
    text.match_indices('%').map(|(at, _)| &text[at..]).find_map(|rest| {
        let letters = rest[1..].trim_start_matches(|c: char| c == '.' || c.is_ascii_digit());
        // A width alone may be an encoded character.
        let bare = letters.len() + 1 == rest.len() || rest.starts_with("%.");
        let letters = letters.trim_start_matches(['l', 'z']);
        let after = letters.strip_prefix(['s', 'd', 'i', 'u', 'f', 'g', 'e', 'x']).filter(|_| bare)?;
        let alone = !after.starts_with(|c: char| c.is_alphanumeric() || c == '%');
        alone.then(|| &rest[..rest.len() - after.len()])
    })
}

/// A percentage that is a conversion, such as the `% d` of "100% done": a blank is a flag.
fn percentage(format: &str) -> Option<&str> {
    format.match_indices("% ").find_map(|(at, _)| {
        let letter = format[at + 2..].chars().next().filter(|c| "dioxXeEfFgGaAcsu".contains(*c))?;
        let word = format[at + 3..].starts_with(|c: char| c.is_ascii_lowercase());
        let number = format[..at].ends_with(|c: char| c.is_ascii_digit());
        (word && number).then_some(&format[at..at + 2 + letter.len_utf8()])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str, format: Option<&str>) -> Option<(Confidence, String)> {
        fault(&LogCall {
            environment: 0,
            instance: None,
            status: 0,
            category: None,
            text: Some(text.into()),
            broken: None,
            format: format.map(Into::into),
            fault: None,
            late: false,
        })
    }

    #[test]
    fn a_text_that_lacks_a_value_is_a_fault() {
        let texts = [
            ("", Confidence::Certain, "empty"),
            ("done\n", Confidence::Certain, "line break"),
            ("x\u{1}y", Confidence::Certain, "control character '\\u{1}'"),
            ("name a probe's text, 10012 is used", Confidence::Certain, "as a printf format"),
            ("x = %g", Confidence::Likely, "\"%g\" appears"),
            ("from %s, %.3g s", Confidence::Likely, "\"%s\" appears"),
            ("%.3g s", Confidence::Likely, "\"%.3g\" appears"),
            ("%lu steps", Confidence::Likely, "\"%lu\" appears"),
            ("a \u{fffd}", Confidence::Likely, "U+FFFD"),
        ];
        for (text, confidence, words) in texts {
            let found = of(text, None).unwrap_or_else(|| panic!("{text:?}"));
            assert!(found.0 == confidence && found.1.contains(words), "{text:?}: {found:?}");
        }
        let found = of("100 12one", Some("100% done")).expect("a percentage");
        assert!(found.1.contains("\"% d\" is a conversion"), "{found:?}");
    }

    #[test]
    fn percent_signs_of_finished_texts_are_none() {
        let good = [
            "100 % done",
            "100% done",
            "50%",
            "5%, 6%.",
            "file:///a%20b/c%2Fd%2e",
            "%PATH%",
            "%Y-%m",
            "100%%",
            "%something",
            "%data%",
            "two\nlines\tand \u{1b}[31mred\u{1b}[0m",
            "Grüße",
            "a probe's text, 100%d: wrong",
        ];
        for text in good {
            assert_eq!(of(text, None), None, "{text:?}");
        }
        for format in ["x =% d", "v% done", "%d of % d", "100%% done, %d"] {
            assert_eq!(of("x", Some(format)), None, "{format:?}");
        }
    }
}
