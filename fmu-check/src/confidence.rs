//! How sure a finding is.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// How sure a finding is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Confidence {
    /// Seen directly: in a byte or line of the file, in what a call returned, or in a large difference between results.
    Certain,
    /// Concluded from a small difference or a measurement, which may have another cause.
    Likely,
    /// A rule of thumb that has exceptions.
    #[default]
    Hint,
}

/// Checks whose findings rest on a measurement, an approximation, or the usual meaning of a name.
const LIKELY: [&str; 13] =
    ["V09c", "V09d", "X01s", "B11", "B07a", "B07l", "B08p", "F01l", "T09s", "T13", "D01", "D02", "E19"];
/// Checks of rules of thumb.
const HINTS: [&str; 3] = ["B12", "T03", "V19"];

impl Confidence {
    /// The highest confidence of a finding of this check.
    pub(super) fn highest(id: &str) -> Self {
        match id {
            _ if LIKELY.contains(&id) => Self::Likely,
            _ if HINTS.contains(&id) => Self::Hint,
            _ => Self::Certain,
        }
    }

    /// Its word.
    pub(super) fn as_str(self) -> &'static str {
        match self {
            Self::Certain => "certain",
            Self::Likely => "likely",
            Self::Hint => "hint",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::GROUPS;

    #[test]
    fn every_id_is_that_of_a_check() {
        for id in LIKELY.iter().chain(&HINTS) {
            assert!(GROUPS.iter().any(|group| group.checks.iter().any(|check| check.id == *id)), "{id}");
        }
    }
}
