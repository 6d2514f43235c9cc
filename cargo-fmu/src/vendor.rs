//! The sources of the crates that an FMU links. Until they are published, this program contains them for projects of `fmu new`.

use anyhow::{Context, Result};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

/// Files of the workspace by name; empty if this program was installed from a registry, which then also provides the crates.
const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/vendored.rs"));

/// The crates, each after those that it needs.
pub const CRATES: [&str; 2] = ["fmu-core", "fmu-export"];

/// Whether this program contains the crates.
pub fn are_carried() -> bool {
    !FILES.is_empty()
}

/// The files below `vendor/` by name. Their manifests are self-contained, without the workspace's settings, tests and benchmarks.
///
/// # Errors
/// A manifest cannot be read.
pub fn files() -> Result<BTreeMap<String, String>> {
    let inside = |(name, _): &&(&str, &str)| name.contains('/');
    let file = |(name, text): &(&str, &str)| {
        let text = if name.ends_with("Cargo.toml") { standalone(text)? } else { (*text).to_owned() };
        Ok((format!("vendor/{name}"), text))
    };
    FILES.iter().filter(inside).map(file).collect()
}

/// A crate's manifest with the values inherited from the workspace. Manifests of this workspace have a key and its value on one line.
fn standalone(text: &str) -> Result<String> {
    let root = file("Cargo.toml")?;
    let mut manifest = String::new();
    for (section, lines) in sections(text) {
        if !["package", "dependencies", "features"].contains(&section) {
            continue;
        }
        // Writing to a String does not fail.
        let _ = writeln!(manifest, "[{section}]");
        for line in lines {
            let Some(key) = line.strip_suffix(".workspace = true") else {
                let _ = writeln!(manifest, "{line}");
                continue;
            };
            if (section, key) == ("package", "readme") {
                continue;
            }
            let (_, inherited) =
                sections(root).find(|(name, _)| *name == format!("workspace.{section}")).context("no workspace")?;
            let found =
                inherited.iter().find(|line| line.strip_prefix(key).is_some_and(|rest| rest.starts_with(" = ")));
            let line = found.with_context(|| format!("the workspace does not state {key}"))?;
            let _ = writeln!(manifest, "{}", line.replace("path = \"", "path = \"../"));
        }
        manifest.push('\n');
    }
    Ok(manifest)
}

/// The sections of a manifest: name, and lines without comments.
fn sections(text: &str) -> impl Iterator<Item = (&str, Vec<&str>)> {
    text.split("\n[").filter_map(|part| {
        let (name, lines) = part.trim_start_matches('[').split_once(']')?;
        Some((name, lines.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).collect()))
    })
}

/// A package in `Cargo.lock`, which Cargo writes in this form.
struct Locked<'a> {
    /// Its lines except those of its dependencies.
    lines: Vec<&'a str>,
    /// `"name"` or, if the workspace has several versions, `"name version"`.
    dependencies: Vec<&'a str>,
}

impl<'a> Locked<'a> {
    fn of(text: &'a str) -> Self {
        let (lines, dependencies) = text.split_once("dependencies = [").unwrap_or((text, ""));
        let dependencies = dependencies.lines().filter_map(|line| line.trim().strip_suffix(','));
        Self {
            lines: lines.lines().filter(|line| !line.is_empty()).collect(),
            dependencies: dependencies.map(|name| name.trim_matches('"')).collect(),
        }
    }

    /// The value of a key.
    fn text(&self, key: &str) -> &'a str {
        let value = |line: &&'a str| line.strip_prefix(key)?.strip_prefix(" = ").map(|value| value.trim_matches('"'));
        self.lines.iter().find_map(value).unwrap_or_default()
    }
}

/// `Cargo.lock` of a package that depends on the crates and on serde: the versions with which these crates are tested.
///
/// # Errors
/// The lock file of the workspace cannot be read.
pub fn lock(package: &str, version: &str) -> Result<String> {
    let mut blocks = file("Cargo.lock")?.split("[[package]]\n");
    let head = blocks.next().unwrap_or_default();
    let all: Vec<Locked<'_>> = blocks.map(Locked::of).collect();
    let (name, of_version) = (format!("name = \"{package}\""), format!("version = \"{version}\""));
    let direct = CRATES.into_iter().chain(["serde"]).collect();
    let mut locked = BTreeMap::new();
    locked.insert((package, version), Locked { lines: vec![&name, &of_version], dependencies: direct });
    let mut open = CRATES.to_vec();
    while let Some(wanted) = open.pop() {
        let (name, version) = wanted.split_once(' ').unwrap_or((wanted, ""));
        let is_wanted =
            |p: &&Locked<'_>| p.text("name") == name && (version.is_empty() || p.text("version") == version);
        let found = all.iter().find(is_wanted).with_context(|| wanted.to_owned())?;
        let mut dependencies = found.dependencies.clone();
        if CRATES.contains(&name) {
            // The dependencies of the crate's tests are not needed.
            let manifest = file(&format!("{name}/Cargo.toml"))?;
            let (_, lines) = sections(manifest).find(|(section, _)| *section == "dependencies").unwrap_or_default();
            let known: BTreeSet<&str> = lines.iter().filter_map(|line| line.split(['.', ' ']).next()).collect();
            dependencies.retain(|d| known.contains(d));
        }
        let key = (found.text("name"), found.text("version"));
        if let Entry::Vacant(place) = locked.entry(key) {
            open.extend(&dependencies);
            place.insert(Locked { lines: found.lines.clone(), dependencies });
        }
    }
    let mut text = head.to_owned();
    for Locked { lines, dependencies } in locked.values() {
        let _ = writeln!(text, "[[package]]\n{}", lines.join("\n"));
        if !dependencies.is_empty() {
            let list: Vec<String> = dependencies.iter().map(|name| format!(" \"{name}\",\n")).collect();
            let _ = writeln!(text, "dependencies = [\n{}]", list.concat());
        }
        text.push('\n');
    }
    Ok(text.trim_end().to_owned() + "\n")
}

fn file(name: &str) -> Result<&'static str> {
    let found = FILES.iter().find(|(file, _)| *file == name);
    Ok(found.with_context(|| format!("{name} is not in this program"))?.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use toml::Table;

    /// What a line-wise reading overlooks is found by a reader of TOML.
    #[test]
    fn what_a_project_carries_stands_alone() {
        let files = files().unwrap();
        for name in CRATES {
            let manifest: Table = files[&format!("vendor/{name}/Cargo.toml")].parse().unwrap();
            let whole: Table = file(&format!("{name}/Cargo.toml")).unwrap().parse().unwrap();
            let keys = |table: &Table, of: &str| table[of].as_table().unwrap().keys().cloned().collect::<Vec<_>>();
            assert_eq!(keys(&manifest, "dependencies"), keys(&whole, "dependencies"));
            assert!(!manifest.to_string().contains("workspace"), "{manifest}");
            assert_eq!(manifest["package"]["name"].as_str(), Some(name));
        }
        let lock: Table = lock("my-model", "0.1.0").unwrap().parse().unwrap();
        let names: Vec<&str> =
            lock["package"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap()).collect();
        assert!(names.is_sorted() && names.contains(&"my-model") && names.contains(&"postcard"), "{names:?}");
        assert!(!names.contains(&"proptest"), "a dependency of tests: {names:?}");
    }
}
