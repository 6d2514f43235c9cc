//! The output of the studies: files in a folder.

use drive_tools::error::{Result, WithContext};
use std::path::Path;

/// A folder for the files of a study.
pub(crate) struct Folder<'a>(&'a Path);

impl<'a> Folder<'a> {
    /// The folder at `path`, created if missing.
    ///
    /// # Errors
    /// It cannot be created.
    pub(crate) fn create(path: &'a Path) -> Result<Self> {
        std::fs::create_dir_all(path).with_context(|| format!("creating {}", path.display()))?;
        Ok(Self(path))
    }

    /// Writes a file.
    ///
    /// # Errors
    /// It cannot be written.
    pub(crate) fn write(&self, name: &str, text: &str) -> Result<()> {
        Ok(fmu_import::whole::write(&self.0.join(name), text.as_bytes())?)
    }
}
