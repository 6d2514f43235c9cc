//! Checksums and bill of materials of a release.

use crate::TOOL;
use crate::archive::{self, GenerationTime};
use crate::error::{Context, Result};
use crate::workspace::{Package, Workspace};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// File of the checksums, in the format of `sha256sum --check`.
const SUMS: &str = "SHA256SUMS";
/// File of the bill of materials.
const MATERIALS: &str = "sbom.cdx.json";

/// Writes the bill of materials of these packages, and the checksums of it and of the files `written`, to the folder of a release;
/// returns the paths of both.
///
/// # Errors
/// A file cannot be read or written.
pub fn finish(
    workspace: &Workspace,
    packages: &[String],
    folder: &Path,
    written: &[PathBuf],
    moment: GenerationTime,
) -> Result<[PathBuf; 2]> {
    let materials = folder.join(MATERIALS);
    let text = serde_json::to_string_pretty(&bill(workspace, packages, moment))? + "\n";
    archive::write(&materials, text.as_bytes())?;
    let mut sums = BTreeMap::new();
    for file in written.iter().chain([&materials]) {
        let bytes = fs::read(file).with_context(|| file.display().to_string())?;
        let name = file.strip_prefix(folder).unwrap_or(file).to_string_lossy().replace('\\', "/");
        sums.insert(name, sha256(&bytes));
    }
    let mut text = String::new();
    for (name, hash) in sums {
        // Writing to a String does not fail.
        let _ = writeln!(text, "{hash}  {name}");
    }
    let sums = folder.join(SUMS);
    archive::write(&sums, text.as_bytes())?;
    Ok([sums, materials])
}

/// The packages and the crates linked into each, in the format CycloneDX 1.6 (<https://cyclonedx.org/docs/1.6/json/>).
fn bill(workspace: &Workspace, packages: &[String], moment: GenerationTime) -> Value {
    let reference = |p: &Package| format!("pkg:cargo/{}@{}", p.name, p.version);
    let mut components = BTreeMap::new();
    let mut dependencies = Vec::new();
    for name in packages {
        let linked = workspace.linked(name);
        let is_own = |p: &&&Package| p.name == *name && workspace.is_member(p);
        let Some(own) = linked.iter().find(is_own) else { continue };
        let others: Vec<String> = linked.iter().filter(|p| p.id != own.id).map(|p| reference(p)).collect();
        dependencies.push(json!({ "ref": reference(own), "dependsOn": others }));
        for package in &linked {
            let mut component = json!({
                "type": "library",
                "bom-ref": reference(package),
                "name": package.name,
                "version": package.version,
            });
            if let Some(license) = &package.license {
                // "MIT/Apache-2.0" is an old spelling of Cargo's.
                component["licenses"] = json!([{ "expression": license.replace('/', " OR ") }]);
            }
            if package.is_published() {
                component["purl"] = reference(package).into();
            }
            if let Some(source) = &package.repository {
                component["externalReferences"] = json!([{ "type": "vcs", "url": source }]);
            }
            components.entry(reference(package)).or_insert(component);
        }
        components.entry(reference(own)).and_modify(|c| c["type"] = "application".into());
    }
    json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "timestamp": moment.date_and_time(),
            "tools": { "components": [{ "type": "application", "name": "fmu", "version": TOOL.trim_start_matches("fmu ") }] },
        },
        "components": components.into_values().collect::<Vec<_>>(),
        "dependencies": dependencies,
    })
}
/// SHA-256 of some bytes in hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().fold(String::new(), |hash, byte| hash + &format!("{byte:02x}"))
}
