//! Every limit on what a file may ask for and on what a process that runs an FMU may use: one place, one message each.
//!
//! They hold for all commands, and keep the static checks of a file below 512 MB and 20 s.

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

macro_rules! limits {
    ($(#[doc = $doc:literal] $name:ident = $before:literal, $most:expr, $after:literal;)*) => {
        $(#[doc = $doc] pub const $name: Limit = Limit::new($before, $most, $after);)*

        /// Every limit on a file, with its subject.
        pub const ALL: &[(&str, Limit)] = &[$(($doc, $name),)*];
    };
}

limits! {
    /// Size of an archive.
    ARCHIVE = "has", 2 << 30, "bytes";
    /// Entries of an archive.
    ENTRIES = "has", 100_000, "entries";
    /// Size of the directory at the end of an archive.
    DIRECTORY = "has a directory of", 32 << 20, "bytes";
    /// All entries of an archive together, unpacked.
    UNPACKED = "unpacks to", 2 << 30, "bytes";
    /// A library whose symbols are read.
    LIBRARY = "has", 256 << 20, "bytes";
    /// An XML document.
    XML = "has", 64 << 20, "bytes";
    /// Elements and attributes of an XML document.
    NODES = "has", 2_000_000, "elements and attributes";
    /// Nested elements of an XML document; both standards need 5.
    LEVELS = "has", 200, "levels of elements";
    /// Variables of an FMU.
    VARIABLES = "has", 200_000, "variables";
    /// Values of all variables of an FMU: an array has as many as elements.
    VALUES = "has variables of", 10_000_000, "values in all";
    /// Dependencies of a list of the model structure, or words for their kinds.
    DEPENDENCIES = "has", 2_000_000, "dependencies in one list";
    /// Communication points of a simulation.
    STEPS = "takes", 1 << 31, "steps";
}

/// Time for the checks of a file that do not run it, in s.
pub const STATIC_SECONDS: u64 = 12;
/// Address space of a process that runs FMUs, in bytes.
pub const PROCESS_MEMORY: u64 = 4 << 30;
/// Open files of a process that runs FMUs.
pub const PROCESS_FILES: u64 = 1024;
/// Threads that a process that runs FMUs may add to those of the system.
pub const PROCESS_THREADS: u64 = 1024;
/// A file that a probe of the checker writes, in bytes.
pub const PROBE_FILE: u64 = 1 << 30;

/// The limits as a Markdown table.
pub fn list() -> String {
    let grouped = |n: u64| {
        let digits = n.to_string();
        let groups: Vec<&str> =
            digits.as_bytes().rchunks(3).rev().map(|g| std::str::from_utf8(g).unwrap_or_default()).collect();
        groups.join(" ")
    };
    let row = |what: &str, most: u64, unit: &str| {
        format!("| {} | {} {unit} |\n", what.trim().trim_end_matches('.'), grouped(most))
    };
    let files: String = ALL.iter().map(|(what, limit)| row(what, limit.most, limit.after)).collect();
    let processes = [
        row("Time for the checks of a file that do not run it", STATIC_SECONDS, "s"),
        row("Address space of a process that runs FMUs (`--memory`)", PROCESS_MEMORY >> 30, "GiB"),
        row("Open files of a process that runs FMUs", PROCESS_FILES, "files"),
        row(
            "Threads and processes that a process that runs FMUs may add to those of the system",
            PROCESS_THREADS,
            "threads",
        ),
        row("A file that a probe of `fmu check` writes", PROBE_FILE >> 30, "GiB"),
    ];
    format!("| what | limit |\n|---|---|\n{files}{}", processes.concat())
}

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
