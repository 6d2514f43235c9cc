//! MATLAB as text: identifiers, literals, comments; units in Simulink's notation.

use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Longest name of a variable, function or model (`namelengthmax`).
const LONGEST: usize = 63;
/// Longest line of a script.
pub(super) const WIDTH: usize = 120;

/// The reserved words (`iskeyword`).
const RESERVED: [&str; 20] = [
    "break",
    "case",
    "catch",
    "classdef",
    "continue",
    "else",
    "elseif",
    "end",
    "for",
    "function",
    "global",
    "if",
    "otherwise",
    "parfor",
    "persistent",
    "return",
    "spmd",
    "switch",
    "try",
    "while",
];

/// A valid name that resembles this one, of at most `longest` characters.
pub(super) fn identifier(name: &str, longest: usize) -> String {
    let mut out = String::new();
    for c in name.chars() {
        let c = if c.is_ascii_alphanumeric() { c } else { '_' };
        if out.is_empty() && !c.is_ascii_alphabetic() {
            out.push('x');
        }
        out.push(c);
    }
    if out.is_empty() || RESERVED.contains(&out.as_str()) {
        out.insert(0, 'x');
    }
    out.truncate(longest.min(LONGEST));
    out
}

/// Names of one scope.
#[derive(Debug, Default)]
pub(super) struct Scope(BTreeSet<String>);

impl Scope {
    /// A name that is unique here, also for file systems and blocks, which may ignore the case.
    pub(super) fn name(&mut self, name: &str) -> String {
        let first = identifier(name, LONGEST);
        let mut candidate = first.clone();
        let mut number = 1;
        while !self.0.insert(candidate.to_ascii_lowercase()) {
            number += 1;
            let suffix = format!("_{number}");
            candidate = format!("{}{suffix}", &first[..first.len().min(LONGEST - suffix.len())]);
        }
        candidate
    }
}

/// A text on one line, without control characters.
pub(super) fn plain(text: &str) -> String {
    text.split(|c: char| c.is_whitespace() || c.is_control())
        .filter(|word| !word.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// A character vector, with this many columns before it; a long one is joined from parts.
pub(super) fn literal(text: &str, before: usize) -> String {
    let text = plain(text);
    let room = WIDTH.saturating_sub(before + 12).max(20);
    let mut parts = vec![String::new()];
    let mut used = 0;
    for c in text.chars() {
        if used + 2 > room {
            parts.push(String::new());
            used = 0;
        }
        let twice = usize::from(c == '\'') + 1;
        used += twice;
        if let Some(part) = parts.last_mut() {
            part.extend(std::iter::repeat_n(c, twice));
        }
    }
    let quoted: Vec<String> = parts.iter().map(|part| format!("'{part}'")).collect();
    if let [one] = quoted.as_slice() {
        return one.clone();
    }
    format!("[{}]", quoted.join(&format!(" ...\n{}", " ".repeat(before + 1))))
}

/// Lines of a comment.
pub(super) fn comment(text: &str, indent: usize) -> String {
    let head = format!("{}% ", " ".repeat(indent));
    let mut out = String::new();
    let mut line = head.clone();
    for word in plain(text).split(' ') {
        // A word without a space can be longer than a line.
        let word: String = word.chars().take(WIDTH - indent - 4).collect();
        if line.len() > head.len() && line.chars().count() + 1 + word.chars().count() > WIDTH {
            out += line.trim_end();
            out.push('\n');
            line.clone_from(&head);
        }
        if line.len() > head.len() {
            line.push(' ');
        }
        line += &word;
    }
    out + line.trim_end() + "\n"
}

/// A number.
pub(super) fn number(x: f64) -> String {
    if x.is_nan() {
        "NaN".into()
    } else if x.is_infinite() {
        (if x > 0.0 { "Inf" } else { "-Inf" }).into()
    } else {
        format!("{x:?}")
    }
}

/// A row of numbers, `indent` columns from the left.
pub(super) fn row(words: &[String], indent: usize) -> String {
    let mut out = String::from("[");
    let mut column = indent + 1;
    for (place, word) in words.iter().enumerate() {
        if place > 0 {
            if column + word.len() + 8 > WIDTH {
                let _ = write!(out, ", ...\n{}", " ".repeat(indent + 1));
                column = indent + 1;
            } else {
                out += ", ";
                column += 2;
            }
        }
        out += word;
        column += word.len();
    }
    out + "]"
}

/// Symbols that Simulink's list of units has in this spelling.
const SYMBOLS: [&str; 21] = [
    "A", "C", "F", "H", "Hz", "J", "K", "N", "Pa", "S", "T", "V", "W", "Wb", "cd", "deg", "kg", "m", "mol", "rad", "s",
];

/// A unit of FMI such as `N.m/rad` or `kg.m2` in Simulink's notation, `N*m/rad` and `kg*m^2`, if all its symbols are known there.
pub(super) fn unit(fmi: &str) -> Option<String> {
    let factor = |word: &str| {
        let symbol = word.trim_end_matches(|c: char| c.is_ascii_digit() || c == '-');
        let power = &word[symbol.len()..];
        let known = SYMBOLS.contains(&symbol);
        let whole = power.is_empty() || power.parse::<i8>().is_ok();
        (known && whole).then(|| if power.is_empty() { symbol.to_owned() } else { format!("{symbol}^{power}") })
    };
    let product = |words: &str| Some(words.split('.').map(factor).collect::<Option<Vec<_>>>()?.join("*"));
    match fmi.split('/').collect::<Vec<_>>().as_slice() {
        [one] => product(one),
        ["1", under] if !under.contains('.') => Some(format!("1/{}", product(under)?)),
        [over, under] if !under.contains('.') => Some(format!("{}/{}", product(over)?, product(under)?)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_valid_unique_and_short_enough() {
        let mut scope = Scope::default();
        assert_eq!(scope.name("plant.motor.R_s"), "plant_motor_R_s");
        assert_eq!(scope.name("plant_motor.R_s"), "plant_motor_R_s_2");
        assert_eq!(scope.name("PLANT.motor.R_S"), "PLANT_motor_R_S_3");
        assert_eq!(scope.name("end"), "xend");
        assert_eq!(scope.name("2nd \u{e4}"), "x2nd__");
        assert_eq!(scope.name("_a"), "x_a");
        assert_eq!(scope.name(""), "x");
        let long = "a".repeat(80);
        let (first, second) = (scope.name(&long), scope.name(&long));
        assert_eq!((first.len(), second.len()), (63, 63));
        assert!(first != second && second.ends_with("_2"), "{second}");
    }

    #[test]
    fn texts_stay_in_their_quotes_lines_and_comments() {
        assert_eq!(literal("it's\n \"2\"", 0), "'it''s \"2\"'");
        assert_eq!(literal("", 0), "''");
        let quotes = literal(&"'".repeat(300), 8);
        assert!(quotes.starts_with("['") && quotes.lines().all(|line| line.len() <= WIDTH), "{quotes}");
        for line in quotes.lines() {
            assert_eq!(line.matches('\'').count() % 2, 0, "{line}");
        }
        let words = comment(&format!("a\nb {}", "word ".repeat(60)), 4);
        assert!(words.lines().all(|line| line.starts_with("    % ") && line.len() <= WIDTH), "{words}");
        assert!(comment(&"x".repeat(400), 0).len() <= WIDTH + 1);
        assert_eq!(comment("", 0), "%\n");
    }

    #[test]
    fn units_are_those_of_simulink_or_none() {
        for (fmi, simulink) in
            [("N.m", "N*m"), ("kg.m2", "kg*m^2"), ("rad/s", "rad/s"), ("1/s", "1/s"), ("s-1", "s^-1")]
        {
            assert_eq!(unit(fmi).as_deref(), Some(simulink));
        }
        for unknown in ["Ohm", "N.m.s/rad/s", "1", "", "V/(rad/s)", "W/m.K"] {
            assert_eq!(unit(unknown), None, "{unknown}");
        }
    }

    #[test]
    fn numbers_are_matlabs() {
        assert_eq!([1e-5, -2.0, f64::NAN, f64::NEG_INFINITY].map(number), ["1e-5", "-2.0", "NaN", "-Inf"]);
        let many = row(&vec!["0.125".to_owned(); 100], 4);
        assert!(many.lines().all(|line| line.len() <= WIDTH) && many.matches("0.125").count() == 100, "{many}");
    }
}
