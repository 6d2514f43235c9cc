//! Limits on descriptions, each with a message; together with the limits of `fmu-import` they keep the checks of a file below
//! 512 MB and 20 s.

use std::fmt::Display;

/// A limit on a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    /// What is limited.
    pub subject: &'static str,
    before: &'static str,
    /// The maximum.
    pub most: u64,
    /// The unit of the number.
    pub unit: &'static str,
}

impl Limit {
    /// The message consists of `before`, the number and its unit.
    pub const fn new(subject: &'static str, before: &'static str, most: u64, unit: &'static str) -> Self {
        Self { subject, before, most, unit }
    }

    /// Compares a number with the limit.
    ///
    /// # Errors
    /// The message, for a greater number.
    pub fn check(&self, found: u64) -> Result<(), String> {
        if found > self.most { Err(self.exceeded(found)) } else { Ok(()) }
    }

    /// The message for a number above the limit; `found` may also state that counting ended there.
    pub fn exceeded(&self, found: impl Display) -> String {
        let Self { before, unit, most, .. } = self;
        format!("{before} {found} {unit}; the limit is {most}")
    }
}

/// Bytes of an XML document.
pub const XML: Limit = Limit::new("An XML document", "has", 64 << 20, "bytes");
/// Elements and attributes of an XML document.
pub const NODES: Limit =
    Limit::new("Elements and attributes of an XML document", "has", 2_000_000, "elements and attributes");
/// Levels of an XML document.
pub const LEVELS: Limit =
    Limit::new("Nested elements of an XML document; both standards need 5", "has", 200, "levels of elements");
/// Variables.
pub const VARIABLES: Limit = Limit::new("Variables of an FMU", "has", 200_000, "variables");
/// Elements of all variables.
pub const VALUES: Limit = Limit::new(
    "Values of all variables of an FMU: an array counts with all its elements",
    "has variables of",
    10_000_000,
    "values in all",
);
/// Words in a list of dependencies.
pub const DEPENDENCIES: Limit = Limit::new(
    "Dependencies of a list of the model structure, or words for their kinds",
    "has",
    2_000_000,
    "dependencies in one list",
);

/// Every limit on a description.
pub const ALL: &[Limit] = &[XML, NODES, LEVELS, VARIABLES, VALUES, DEPENDENCIES];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_told_with_both_numbers() {
        assert_eq!(VARIABLES.check(200_000), Ok(()));
        assert_eq!(VARIABLES.check(200_001), Err("has 200001 variables; the limit is 200000".into()));
        assert_eq!(VALUES.exceeded("more than 7"), "has variables of more than 7 values in all; the limit is 10000000");
    }
}
