//! The packed FMUs of the tests.

use std::path::{Path, PathBuf};

/// Folder with the packed FMUs of both standards, `fmi2/` and `fmi3/`: `FMU_TEST_ARCHIVES`, set by `.ci/run`, or built once for
/// each test program.
pub fn archives() -> &'static Path {
    static FOLDER: std::sync::OnceLock<PathBuf> = std::sync::OnceLock::new();
    FOLDER.get_or_init(|| {
        if let Some(folder) = std::env::var_os("FMU_TEST_ARCHIVES") {
            return folder.into();
        }
        let files = fmu::commands::build::models(&fmu::commands::build::Models::default()).expect("FMUs that build");
        files[0].parent().and_then(Path::parent).expect("DIR/fmi2/NAME.fmu").to_owned()
    })
}
