//! Repeats the calls of a [call log](fmu_core::call_log) and compares their results.
//!
//! The player owns the memory of all arguments. Every array is as long as the largest count of its call, so no line of a file
//! leads to an access outside of it.

mod memory;
mod play;
mod table;

pub use play::{Difference, Replayed};

use crate::Error;
use crate::abi::{journal, library};
use crate::fmu::Unpacked;
use crate::text::file_uri;
use fmu_core::call_log::LogReader;
use model_description::{FmiVersion, ModelDescription};
use play::Player;
use std::ffi::CString;
use std::path::{MAIN_SEPARATOR, Path};

/// Repeats the calls of a log with the FMU of this path; `note` receives what the user should know before a call.
///
/// # Errors
/// The log cannot be read; the FMU cannot be loaded; or it is of another version than the one that wrote the log.
pub fn replay(path: &Path, log: &str, note: &dyn Fn(&str)) -> Result<Replayed, ReplayError> {
    let description = crate::outline(path)?.description;
    let (head, reader) = LogReader::new(log).map_err(ReplayError::Log)?;
    let standard = if description.version == FmiVersion::V2 { "2.0" } else { "3.0" };
    let mut reader = reader.peekable();
    let passed = match reader.peek() {
        Some(Ok(first)) => first.arguments.iter().find(|(name, _)| name == "token").map(|(_, token)| token.to_string()),
        Some(Err(why)) => return Err(ReplayError::Log(why.clone())),
        None => return Err(ReplayError::Log("line 7: there is no call".into())),
    };
    if let Some(of_log) = other_token(&head.token, passed.as_deref(), &description) {
        return Err(ReplayError::Other(format!(
            "the log is of another version of the FMU: its token is {of_log}, that of the FMU {}; the log is of {} {}",
            description.token, head.model, head.version
        )));
    }
    if head.standard != standard {
        return Err(ReplayError::Other(format!("the log is of FMI {}, the FMU of FMI {standard}", head.standard)));
    }
    let unpacked = Unpacked::new(path)?;
    let resources = match description.version {
        FmiVersion::V2 => file_uri(&unpacked.resources()),
        FmiVersion::V3 => format!("{}{MAIN_SEPARATOR}", unpacked.resources().display()),
    };
    let resources = CString::new(resources).map_err(|_| Error::file(path, "its folder has a null byte"))?;
    let name = journal::name(&path.to_string_lossy());
    journal::note(name, journal::Call::Load);
    let library = library::load(&unpacked.library)?;
    let player = Player::new(library, description.version, resources);
    player.play_all(name, reader, note).map_err(ReplayError::Log)
}

/// Why a log cannot be repeated.
#[derive(Debug)]
pub enum ReplayError {
    /// The log: line and reason.
    Log(String),
    /// The FMU.
    Fmu(Error),
    /// They do not belong together.
    Other(String),
}

impl From<Error> for ReplayError {
    fn from(error: Error) -> Self {
        Self::Fmu(error)
    }
}

/// The token of the log, if the FMU has another one. That of the binary lacks the suffix of a preset; that which the importer
/// passed may be wrong, which the log is then about.
fn other_token(of_binary: &str, passed: Option<&str>, description: &ModelDescription) -> Option<String> {
    let passed = passed.map(|token| token.trim_matches('"')).filter(|token| token.starts_with(of_binary));
    let same = match passed {
        Some(token) => description.token == token,
        None => description.token.starts_with(of_binary),
    };
    (!same).then(|| passed.unwrap_or(of_binary).to_owned())
}
