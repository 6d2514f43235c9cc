//! States in the description of an input whether an importer must feed it; neither standard has an attribute for this.
//!
//! A row states it by [`Row::optional`](crate::Row::optional) or [`Row::read_with`](crate::Row::read_with). The sentence is
//! written and parsed only here, so an importer has the same information as the table.

use std::fmt;

/// Whether an input must be fed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Need<'a> {
    /// Its start value only serves to begin a run.
    #[default]
    Always,
    /// Its start value usually suits.
    Never,
    /// The model reads it only while a parameter has a value.
    With {
        /// Name of a Boolean or an enumeration.
        parameter: &'a str,
        /// `true`, `false` or the name of an enumeration's value.
        value: &'a str,
    },
}

const OPTIONAL: &str = "; optional";
const ONLY_WITH: &str = ": read only with ";
const EQUALS: &str = " = ";

impl fmt::Display for Need<'_> {
    /// The suffix of the description.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Always => Ok(()),
            Self::Never => f.write_str(OPTIONAL),
            Self::With { parameter, value: "true" } => write!(f, "{OPTIONAL}{ONLY_WITH}{parameter}"),
            Self::With { parameter, value } => write!(f, "{OPTIONAL}{ONLY_WITH}{parameter}{EQUALS}{value}"),
        }
    }
}

impl<'a> Need<'a> {
    /// Reads the end of a description. A description by another tool also counts if it calls the input optional.
    pub fn of(description: &'a str) -> Self {
        let condition = description.rsplit_once(OPTIONAL).and_then(|(_, end)| end.strip_prefix(ONLY_WITH));
        if let Some(condition) = condition {
            let (parameter, value) = condition.split_once(EQUALS).unwrap_or((condition, "true"));
            return Self::With { parameter, value };
        }
        let words = || description.split(|c: char| !c.is_alphanumeric());
        if words().any(|word| word.eq_ignore_ascii_case("optional")) { Self::Never } else { Self::Always }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let with = |value| Need::With { parameter: "plant.thermal.mode", value };
        for need in [Need::Always, Need::Never, with("true"), with("Imposed")] {
            let text = format!("Temperature of the coolant{need}");
            assert_eq!(Need::of(&text), need, "{text}");
        }
        assert_eq!(with("true").to_string(), "; optional: read only with plant.thermal.mode");
        assert_eq!(with("Imposed").to_string(), "; optional: read only with plant.thermal.mode = Imposed");
    }

    #[test]
    fn descriptions_of_other_tools_have_words_of_their_own() {
        assert_eq!(Need::of("Optional heat flow (W)"), Need::Never);
        assert_eq!(Need::of("Load torque"), Need::Always);
        assert_eq!(Need::of("Optionality"), Need::Always);
    }
}
