//! Embeds the sources of the two crates that an FMU links, for `fmu new`: a new project carries them until they are published.
//! A package from a registry lacks these folders; then nothing is embedded, and a new project depends on published versions.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

const CRATES: [&str; 2] = ["fmu-core", "fmu-export"];

fn main() -> io::Result<()> {
    let own = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let root = own.parent().unwrap_or(&own).to_owned();
    let mut files = Vec::new();
    for folder in CRATES.map(|name| root.join(name)).into_iter().filter(|folder| folder.is_dir()) {
        files.extend(["Cargo.toml", "LICENSE-MIT", "LICENSE-APACHE"].map(|file| folder.join(file)));
        sources(&folder.join("src"), &mut files)?;
        println!("cargo::rerun-if-changed={}", folder.join("src").display());
    }
    if !files.is_empty() {
        files.extend(["Cargo.toml", "Cargo.lock"].map(|file| root.join(file)));
    }
    println!("cargo::rerun-if-changed=build.rs");
    files.sort();
    let mut list = String::from("&[\n");
    for file in &files {
        let name = file.strip_prefix(&root).unwrap_or(file).to_string_lossy().replace('\\', "/");
        // Writing to a String does not fail.
        let _ = writeln!(list, "({name:?}, include_str!({:?})),", file.display().to_string());
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    fs::write(out.join("vendored.rs"), list + "]")
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            sources(&path, found)?;
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    Ok(())
}
