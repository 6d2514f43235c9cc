//! Every limit on what a file may ask for and on what a process that runs an FMU may use: one place, one message each.
//!
//! They hold for all commands alike. The static checks of a file at these limits take at most 512 MB and 20 s.

use std::fmt::Display;

/// A limit on a number that a file has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    before: &'static str,
    after: &'static str,
    /// The greatest number that is allowed.
    pub most: u64,
}

impl Limit {
    const fn new(before: &'static str, most: u64, after: &'static str) -> Self {
        Self { before, after, most }
    }

    /// Compares a number with the limit.
    ///
    /// # Errors
    /// The message, for a greater number.
    pub fn check(&self, found: u64) -> Result<(), String> {
        if found > self.most { Err(self.exceeded(found)) } else { Ok(()) }
    }

    /// The message for a number beyond the limit; `found` may also say that counting ended there.
    pub fn exceeded(&self, found: impl Display) -> String {
        let Self { before, after, most } = self;
        format!("{before} {found} {after}; the limit is {most}")
    }
}

/// Size of an archive.
pub const ARCHIVE: Limit = Limit::new("has", 2 << 30, "bytes");
/// Entries of an archive.
pub const ENTRIES: Limit = Limit::new("has", 100_000, "entries");
/// Size of the directory at the end of an archive.
pub const DIRECTORY: Limit = Limit::new("has a directory of", 32 << 20, "bytes");
/// All entries of an archive together, unpacked.
pub const UNPACKED: Limit = Limit::new("unpacks to", 2 << 30, "bytes");
/// A library whose symbols are read.
pub const LIBRARY: Limit = Limit::new("has", 256 << 20, "bytes");
/// An XML document.
pub const XML: Limit = Limit::new("has", 64 << 20, "bytes");
/// Elements and attributes of an XML document.
pub const NODES: Limit = Limit::new("has", 2_000_000, "elements and attributes");
/// Levels of elements: both standards need 5, annotations of tools a few more. Trees are dropped recursively.
pub const LEVELS: Limit = Limit::new("has", 200, "levels of elements");
/// Variables of an FMU.
pub const VARIABLES: Limit = Limit::new("has", 200_000, "variables");
/// Values of all variables of an FMU: an array has as many as elements.
pub const VALUES: Limit = Limit::new("has variables of", 10_000_000, "values in all");
/// Communication points of a simulation.
pub const STEPS: Limit = Limit::new("takes", 1 << 31, "steps");

/// Time for the checks of a file that do not run it, in s.
pub const STATIC_SECONDS: u64 = 15;
/// Address space of a process that runs FMUs, in bytes.
pub const PROCESS_MEMORY: u64 = 4 << 30;
/// Open files of a process that runs FMUs.
pub const PROCESS_FILES: u64 = 1024;
/// Threads that a process that runs FMUs may add to those of the system.
pub const PROCESS_THREADS: u64 = 1024;
/// A file that a probe of the checker writes, in bytes.
pub const PROBE_FILE: u64 = 1 << 30;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_told_with_both_numbers() {
        assert_eq!(VARIABLES.check(200_000), Ok(()));
        assert_eq!(VARIABLES.check(200_001), Err("has 200001 variables; the limit is 200000".into()));
        assert_eq!(UNPACKED.exceeded("more than 7"), "unpacks to more than 7 bytes; the limit is 2147483648");
    }
}
