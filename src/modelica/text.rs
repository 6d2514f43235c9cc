//! Modelica as text: identifiers, literals, declarations.

use anyhow::{Result, ensure};
use std::fmt::Write as _;

/// The reserved words of Modelica 3.6.
const RESERVED: &str = " algorithm and annotation block break class connect connector constant constrainedby der discrete each \
     else elseif elsewhen encapsulated end enumeration equation expandable extends external false final flow for function if \
     import impure in initial inner input loop model not operator or outer output package parameter partial protected public \
     pure record redeclare replaceable return stream then true type when while within ";

/// The identifier that an import derives from a variable's name. OpenModelica replaces each character that is invalid in an
/// identifier (`plant_flux_map_w_46_`); Modelica-FMI replaces a sequence of them by one `_`, which gives the same for our
/// names.
pub(super) fn identifier(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// Checks that a name can be a class of Modelica.
///
/// # Errors
/// States the rules of a name.
pub(super) fn check(what: &str, name: &str) -> Result<()> {
    let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let starts = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    let reserved = RESERVED.contains(&format!(" {name} "));
    ensure!(
        plain && starts && !reserved,
        "{what} {name}: expected a Modelica name: a letter, then letters, digits and _, and no reserved word"
    );
    Ok(())
}

/// A string literal.
pub(super) fn literal(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            '\n' | '\r' | '\t' => out.push(' '),
            c => out.push(c),
        }
    }
    out + "\""
}

/// A text for the HTML of a documentation annotation, inside a string literal.
pub(super) fn html(text: &str) -> String {
    let quoted = literal(&text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;"));
    quoted[1..quoted.len() - 1].into()
}

/// A declaration: the part before the name, name, modifiers, value, description, annotation.
pub(super) fn declare(
    head: &str,
    name: &str,
    modifiers: &[String],
    value: &str,
    about: &str,
    annotation: &str,
) -> String {
    let mut line = format!("  {head} {name}");
    if !modifiers.is_empty() {
        let _ = write!(line, "({})", modifiers.join(", "));
    }
    if !value.is_empty() {
        let _ = write!(line, " = {value}");
    }
    if !about.is_empty() {
        let _ = write!(line, "\n    {}", literal(about));
    }
    if !annotation.is_empty() {
        let _ = write!(line, "\n    annotation({annotation})");
    }
    line + ";\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_imports() {
        assert_eq!(identifier("plant.motor.R_s"), "plant_motor_R_s");
        assert_eq!(identifier("plant.flux_map.w[46]"), "plant_flux_map_w_46_");
        for bad in ["", "2x", "a-b", "model", "\u{e4}"] {
            assert!(check("--name", bad).is_err(), "{bad}");
        }
        check("--name", "_Drive2").unwrap();
    }

    #[test]
    fn a_text_stays_in_its_quotes() {
        assert_eq!(literal("a \"b\" \\c\nd"), r#""a \"b\" \\c d""#);
        assert_eq!(html("a < \"b\""), r#"a &lt; \"b\""#);
    }
}
