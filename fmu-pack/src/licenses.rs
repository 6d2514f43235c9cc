//! The licenses of an FMU and of the crates linked into it.

use crate::workspace::{Package, Workspace};
use fmu_core::Description;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Licenses to pack with an FMU.
#[derive(Clone, Debug, Default)]
pub struct Licenses {
    /// Texts of the workspace's license.
    own: Vec<String>,
    /// The packages linked into the binary; `None` if unknown.
    crates: Option<Vec<Crate>>,
}

#[derive(Clone, Debug)]
struct Crate {
    name: String,
    version: String,
    license: Option<String>,
    source: String,
    texts: Vec<String>,
}

impl Licenses {
    /// The licenses of everything that is linked into the library of a package.
    pub fn of_package(workspace: &Workspace, package: &str) -> Self {
        let mut linked = workspace.linked(package);
        // The description has the FMU's license.
        linked.retain(|p| p.name != package || p.license.is_some());
        let crates = linked.into_iter().map(|p| Crate::of(p, workspace.is_member(p))).collect();
        Self { own: texts_in(&workspace.root, ""), crates: Some(crates) }
    }

    /// `license.txt`.
    pub fn text(&self, description: &Description) -> String {
        let mut out = format!("{} {}\n", description.name, description.version);
        let Description { license, copyright, .. } = description;
        // Writing to a String does not fail.
        let _ = writeln!(out, "{copyright}\nLicence: {license}\n");
        for text in &self.own {
            let _ = writeln!(out, "{}\n{}\n", RULE, text.trim_end());
        }
        let Some(crates) = &self.crates else { return out };
        let _ = writeln!(out, "{RULE}\nThe binary contains these Rust crates and parts of Rust's standard library.\n");
        for c in crates {
            let license = c.license.as_deref().unwrap_or("see its text");
            let _ = writeln!(out, "{} {}: {license}  {}", c.name, c.version, c.source);
        }
        let _ = writeln!(out, "std (Rust's standard library): MIT OR Apache-2.0  https://github.com/rust-lang/rust");
        // Many crates share one text.
        let mut by_text: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for c in crates {
            c.texts.iter().for_each(|text| by_text.entry(text).or_default().push(&c.name));
        }
        let mut texts: Vec<_> = by_text.into_iter().map(|(text, names)| (names.join(", "), text)).collect();
        texts.sort();
        for (names, text) in texts {
            let _ = writeln!(out, "\n{RULE}\n{names}\n\n{}", text.trim_end());
        }
        out
    }

    /// `license.spdx`: an SPDX 2.3 document in tag-value form.
    pub fn spdx(&self, description: &Description, date: &str) -> String {
        let Description { name, version, license, copyright, token, .. } = description;
        let id = token.trim_matches(['{', '}']);
        let mut out = format!(
            "SPDXVersion: SPDX-2.3\nDataLicense: CC0-1.0\nSPDXID: SPDXRef-DOCUMENT\nDocumentName: {name}\n\
             DocumentNamespace: https://spdx.org/spdxdocs/{name}-{version}-{id}\nCreator: Tool: {}\nCreated: {date}\n\n",
            crate::TOOL.replace(' ', "-"),
        );
        let mut package = |id: &str, name: &str, version: &str, license: &str, source: &str, copyright: &str| {
            // Writing to a String does not fail.
            let _ = write!(
                out,
                "PackageName: {name}\nSPDXID: SPDXRef-{id}\nPackageVersion: {version}\nPackageDownloadLocation: {source}\n\
                 FilesAnalyzed: false\nPackageLicenseConcluded: {license}\nPackageLicenseDeclared: {license}\n\
                 PackageCopyrightText: {copyright}\n",
            );
            let relation = if id == "FMU" { "SPDXRef-DOCUMENT DESCRIBES" } else { "SPDXRef-FMU CONTAINS" };
            let _ = writeln!(out, "Relationship: {relation} SPDXRef-{id}\n");
        };
        package("FMU", name, version, license, "NOASSERTION", &format!("<text>{copyright}</text>"));
        for c in self.crates.iter().flatten() {
            // "MIT/Apache-2.0" is an old spelling of Cargo's.
            let license = c.license.as_deref().unwrap_or("NOASSERTION").replace('/', " OR ");
            let source = if c.source.is_empty() { "NOASSERTION" } else { &c.source };
            let id =
                format!("{}-{}", c.name, c.version).replace(|x: char| !(x.is_ascii_alphanumeric() || x == '.'), "-");
            package(&id, &c.name, &c.version, &license, source, "NOASSERTION");
        }
        out
    }
}

const RULE: &str = "--------------------------------------------------------------------------------";

impl Crate {
    fn of(package: &Package, own: bool) -> Self {
        let license = package.license.clone();
        let texts = if own { Vec::new() } else { texts_in(package.folder(), license.as_deref().unwrap_or_default()) };
        let source = package.repository.clone().unwrap_or_default();
        Self { name: package.name.clone(), version: package.version.clone(), license, source, texts }
    }
}

/// The texts of licenses and notices in a folder; if MIT is a choice and has a file, only that file.
fn texts_in(folder: &Path, license: &str) -> Vec<String> {
    let is_text =
        |name: &str| ["LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE"].iter().any(|n| name.starts_with(n));
    let mut files: Vec<(String, String)> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(Result::ok)
        .filter(|entry| entry.path().is_file())
        .map(|entry| (entry.file_name().to_string_lossy().to_uppercase(), entry.path()))
        .filter(|(name, _)| is_text(name))
        .filter_map(|(name, path)| Some((name, fs::read_to_string(path).ok()?.replace("\r\n", "\n"))))
        .collect();
    files.sort();
    let by_mit = license.contains(" OR ") || license.contains('/');
    if by_mit && files.iter().any(|(name, _)| name.contains("MIT")) {
        files.retain(|(name, _)| name.contains("MIT") || name.starts_with("NOTICE"));
    }
    files.into_iter().map(|(_, text)| text).collect()
}
