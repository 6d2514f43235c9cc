//! The archives of the Reference-FMUs in Rust.

use super::common::packed::packed;
use super::common::python::scratch;
use std::path::PathBuf;

/// The archive of a model, of FMI 2.0 or FMI 3.0.
pub fn archive(model: &str, standard: usize) -> PathBuf {
    let package: String = model.chars().enumerate().fold(String::new(), |name, (i, c)| {
        let dash = if i > 0 && c.is_uppercase() { "-" } else { "" };
        name + dash + &c.to_lowercase().to_string()
    });
    let out = scratch().join("orders");
    let files = packed(&format!("examples/reference-fmus/{package}"), &package, &out);
    let folder = ["fmi2", "fmi3"][standard];
    files.into_iter().find(|file| file.parent().is_some_and(|parent| parent.ends_with(folder))).unwrap()
}
