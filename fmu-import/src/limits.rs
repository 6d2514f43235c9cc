//! Every limit on files and on processes that run FMUs, each with a message.
//!
//! They apply to all commands, and keep the static checks of a file below 512 MB and 20 s. The limits of descriptions are defined
//! with their reader, in `model-description`.

use model_description::limits;
pub use model_description::limits::{DEPENDENCIES, LEVELS, Limit, NODES, VALUES, VARIABLES, XML};

/// Bytes of an archive.
pub const ARCHIVE: Limit = Limit::new("Size of an archive", "has", 2 << 30, "bytes");
/// Entries of an archive.
pub const ENTRIES: Limit = Limit::new("Entries of an archive", "has", 100_000, "entries");
/// Bytes of the directory at the end of an archive.
pub const DIRECTORY: Limit =
    Limit::new("Size of the directory at the end of an archive", "has a directory of", 32 << 20, "bytes");
/// Bytes of all entries.
pub const UNPACKED: Limit = Limit::new("All entries of an archive together, unpacked", "unpacks to", 2 << 30, "bytes");
/// Bytes of a library.
pub const LIBRARY: Limit = Limit::new("A library whose symbols are read", "has", 256 << 20, "bytes");
/// Communication points.
pub const STEPS: Limit = Limit::new("Communication points of a simulation", "takes", 1 << 31, "steps");

/// Time for the checks of a file that do not run it, in s.
pub const STATIC_SECONDS: u64 = 12;
/// Address space of a process that runs FMUs, in bytes.
pub const PROCESS_MEMORY: u64 = 4 << 30;
/// Maximum number of open files of a process that runs FMUs.
pub const PROCESS_FILES: u64 = 1024;
/// Maximum number of threads that a process running FMUs may start in addition to the system's.
pub const PROCESS_THREADS: u64 = 1024;
/// Maximum size of a file that a probe of the checker writes, in bytes.
pub const PROBE_FILE: u64 = 1 << 30;

/// The limits as a Markdown table.
pub fn list() -> String {
    let grouped = |n: u64| {
        let digits = n.to_string();
        let groups: Vec<&str> =
            digits.as_bytes().rchunks(3).rev().map(|g| std::str::from_utf8(g).unwrap_or_default()).collect();
        groups.join(" ")
    };
    let row = |what: &str, most: u64, unit: &str| format!("| {what} | {} {unit} |\n", grouped(most));
    let archive = [ARCHIVE, ENTRIES, DIRECTORY, UNPACKED, LIBRARY];
    let files = archive.iter().chain(limits::ALL).chain([&STEPS]);
    let files: String = files.map(|limit| row(limit.subject, limit.most, limit.unit)).collect();
    let processes = [
        row("Time for the checks of a file that do not run it", STATIC_SECONDS, "s"),
        row("Address space of a process that runs FMUs (`--memory`)", PROCESS_MEMORY >> 30, "GiB"),
        row("Open files of a process that runs FMUs (no limit with `--memory 0`)", PROCESS_FILES, "files"),
        row(
            "Threads and processes that a process running FMUs may start in addition to the system's",
            PROCESS_THREADS,
            "threads",
        ),
        row("A file that a probe of `fmu check` writes", PROBE_FILE >> 30, "GiB"),
    ];
    format!("| what | limit |\n|---|---|\n{files}{}", processes.concat())
}
