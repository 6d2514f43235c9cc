//! The bytes of an archive: what is read and unpacked before a binary is loaded.

use fmu_import::{Unpacked, check_entries, contents, outline};

pub(crate) fn run(bytes: &[u8]) {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    std::fs::write(&file, bytes).expect("space for it");
    let read = contents(file.path());
    if let Ok(outline) = outline(file.path()) {
        std::hint::black_box(outline);
    }
    // What is unpacked is what was read.
    if let (Ok((md, _)), Ok(unpacked)) = (&read, Unpacked::new(file.path())) {
        assert!(unpacked.resources().starts_with(std::env::temp_dir()), "{}", md.model_name);
    }
    if let Ok(mut zip) = zip::ZipArchive::new(std::io::Cursor::new(bytes)) {
        let _ = check_entries(&mut zip);
    }
}
