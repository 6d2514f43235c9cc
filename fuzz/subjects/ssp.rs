//! A system of SSP: its package, or the text of its structure, values or mapping.

use fmu_system::ssp::{load::Loaded, ssm, ssv, structure::Structure};
use model_description::Element;
use std::path::Path;

pub(crate) fn run(bytes: &[u8]) {
    if bytes.starts_with(b"PK") {
        let file = tempfile::Builder::new().suffix(".ssp").tempfile().expect("a temporary file");
        std::fs::write(&file, bytes).expect("space for it");
        let _ = Loaded::open_files(&[file.path().display().to_string()], Path::new(""), false);
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    // A structure that refers to other files finds itself.
    let _ = Structure::read_with(text, &mut |_| Ok(text.to_owned()));
    let _ = ssv::read(text);
    if let Ok(root) = Element::parse(text) {
        let _ = ssm::read(&root);
    }
}
