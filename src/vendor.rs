//! The sources of the crates that an FMU links. Until they are published, this program contains them for projects of `fmu new`.

use anyhow::{Context, Result};
use std::collections::{BTreeMap, BTreeSet};
use toml::{Table, Value};

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

/// A crate's manifest with the values inherited from the workspace.
fn standalone(text: &str) -> Result<String> {
    let root: Table = file("Cargo.toml")?.parse()?;
    let workspace = root["workspace"].as_table().context("workspace")?;
    let mut manifest: Table = text.parse()?;
    let inherits = |value: &Value| value.get("workspace").is_some();
    for key in ["package", "dependencies"] {
        let Some(table) = manifest.get_mut(key).and_then(Value::as_table_mut) else { continue };
        for (name, value) in table.iter_mut().filter(|(_, value)| inherits(value)) {
            *value = workspace[key][name.as_str()].clone();
            if let Some(path) = value.get_mut("path") {
                *path = format!("../{name}").into();
            }
        }
    }
    if let Some(package) = manifest.get_mut("package").and_then(Value::as_table_mut) {
        package.remove("readme");
    }
    manifest.retain(|key, _| ["package", "dependencies", "features"].contains(&key));
    Ok(manifest.to_string())
}

/// `Cargo.lock` of a package that depends on the crates and on serde: the versions with which these crates are tested.
///
/// # Errors
/// The lock file of the workspace cannot be read.
pub fn lock(package: &str, version: &str) -> Result<String> {
    let lock: Table = file("Cargo.lock")?.parse()?;
    let all = lock["package"].as_array().context("package")?;
    let named = |of: &Value, key: &str| of.get(key).and_then(Value::as_str).unwrap_or_default().to_owned();
    let mut own = Table::from_iter([("name".to_owned(), package.into()), ("version".to_owned(), version.into())]);
    let direct = CRATES.into_iter().chain(["serde"]).map(Value::from).collect();
    own.insert("dependencies".into(), Value::Array(direct));
    let mut locked = vec![Value::Table(own)];
    let mut open = CRATES.map(str::to_owned).to_vec();
    let mut seen = BTreeSet::new();
    while let Some(wanted) = open.pop() {
        // "name" or, if the workspace has several versions, "name version".
        let (name, version) = wanted.split_once(' ').unwrap_or((&wanted, ""));
        let is_wanted = |p: &&Value| named(p, "name") == name && (version.is_empty() || named(p, "version") == version);
        let mut found = all.iter().find(is_wanted).with_context(|| wanted.clone())?.clone();
        if !seen.insert((named(&found, "name"), named(&found, "version"))) {
            continue;
        }
        if let Some(dependencies) = found.get_mut("dependencies").and_then(Value::as_array_mut) {
            if CRATES.contains(&name) {
                // The dependencies of the crate's tests are not needed.
                let manifest: Table = file(&format!("{name}/Cargo.toml"))?.parse()?;
                dependencies.retain(|d| d.as_str().is_some_and(|d| manifest["dependencies"].get(d).is_some()));
            }
            open.extend(dependencies.iter().filter_map(Value::as_str).map(str::to_owned));
        }
        locked.push(found);
    }
    locked.sort_by_key(|p| (named(p, "name"), named(p, "version")));
    Ok(Table::from_iter([("version".to_owned(), lock["version"].clone()), ("package".to_owned(), locked.into())])
        .to_string())
}

fn file(name: &str) -> Result<&'static str> {
    let found = FILES.iter().find(|(file, _)| *file == name);
    Ok(found.with_context(|| format!("{name} is not in this program"))?.1)
}
