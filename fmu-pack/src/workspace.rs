//! The Cargo workspace around the current folder, and its packages.

use crate::error::{Context, Result, invalid};
use crate::target::{cargo, host_triple};
use serde::Deserialize;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::process::Stdio;

/// A Cargo workspace.
pub struct Workspace {
    /// Its root folder.
    pub root: PathBuf,
    /// Cargo's target folder, `CARGO_TARGET_DIR` honored.
    pub target: PathBuf,
    /// Every package that its members depend on, members included.
    pub packages: Vec<Package>,
    members: HashSet<String>,
    edges: HashMap<String, Vec<String>>,
}

/// A package, as Cargo describes it.
#[derive(Clone, Debug, Deserialize)]
pub struct Package {
    pub(crate) id: String,
    /// Name of the package.
    pub name: String,
    /// Version of the package.
    pub version: String,
    /// License, an SPDX expression.
    pub license: Option<String>,
    /// Source of the package.
    pub repository: Option<String>,
    /// The registry or repository of its source; `None` for a folder.
    source: Option<String>,
    manifest_path: PathBuf,
    targets: Vec<Target>,
}

#[derive(Clone, Debug, Deserialize)]
struct Target {
    kind: Vec<String>,
    crate_types: Vec<String>,
}

#[derive(Deserialize)]
struct Metadata {
    workspace_root: PathBuf,
    target_directory: PathBuf,
    workspace_members: HashSet<String>,
    packages: Vec<Package>,
    resolve: Resolve,
}

#[derive(Deserialize)]
struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    pkg: String,
    dep_kinds: Vec<DependencyKind>,
}

#[derive(Deserialize)]
struct DependencyKind {
    kind: Option<String>,
}

/// The default folder for the files of a command: `name` in Cargo's target folder or, where there is no package, in the current
/// folder.
///
/// # Errors
/// Cargo's target folder is unknown although there is a package.
pub fn output_folder(name: &str) -> Result<PathBuf> {
    if has_manifest(&std::env::current_dir()?) { Ok(Workspace::find()?.target.join(name)) } else { Ok(name.into()) }
}

fn has_manifest(folder: &Path) -> bool {
    folder.ancestors().any(|folder| folder.join("Cargo.toml").is_file())
}

impl Package {
    /// Its folder.
    pub fn folder(&self) -> &Path {
        self.manifest_path.parent().unwrap_or(Path::new("."))
    }

    /// Whether it comes from a registry.
    pub fn is_published(&self) -> bool {
        self.source.as_ref().is_some_and(|source| source.starts_with("registry+"))
    }

    /// Whether it has a library that C can load.
    pub fn has_cdylib(&self) -> bool {
        self.targets
            .iter()
            .any(|t| t.kind.iter().all(|k| k != "example") && t.crate_types.iter().any(|c| c == "cdylib"))
    }

    /// Whether it is a procedural macro, which runs in the compiler and is not part of the binary.
    fn is_linked(&self) -> bool {
        !self.targets.iter().any(|t| t.kind.iter().any(|k| k == "proc-macro"))
    }
}

impl Workspace {
    /// The workspace around the current folder.
    ///
    /// # Errors
    /// There is no package, or Cargo cannot be run.
    pub fn find() -> Result<Self> {
        let here = std::env::current_dir().context("the current folder")?;
        if !has_manifest(&here) {
            return Err(invalid!(
                "no Cargo package here: expected a Cargo.toml in {} or above it; change to the folder of a package, or create one with fmu new my-model",
                here.display()
            ));
        }
        let mut metadata = cargo();
        metadata.args(["metadata", "--format-version", "1", "--filter-platform", &host_triple()?]);
        let output = metadata.stdin(Stdio::null()).output().context("cargo cannot be run")?;
        if !output.status.success() {
            let message = String::from_utf8_lossy(&output.stderr);
            let message = message.split_whitespace().collect::<Vec<_>>().join(" ");
            return Err(invalid!("cargo metadata: {}", message.trim_start_matches("error: ")));
        }
        let metadata: Metadata = serde_json::from_slice(&output.stdout).context("cargo metadata")?;
        let normal = |d: Dependency| d.dep_kinds.iter().any(|k| k.kind.is_none()).then_some(d.pkg);
        let edge = |n: Node| (n.id, n.deps.into_iter().filter_map(normal).collect());
        Ok(Self {
            root: metadata.workspace_root,
            target: metadata.target_directory,
            packages: metadata.packages,
            members: metadata.workspace_members,
            edges: metadata.resolve.nodes.into_iter().map(edge).collect(),
        })
    }

    /// The packages of FMUs: the workspace's members below `fmus/` or, in a workspace without that folder, every member with a
    /// library that C can load and with `fmu-export` among its dependencies.
    pub fn fmus(&self) -> Vec<&Package> {
        let below = self.root.join("fmus");
        let collected = below.is_dir();
        let exports = |p: &Package| p.has_cdylib() && self.linked(&p.name).iter().any(|l| l.name == "fmu-export");
        let is_fmu = |p: &&Package| if collected { p.folder().starts_with(&below) } else { exports(p) };
        self.packages.iter().filter(|p| self.is_member(p)).filter(is_fmu).collect()
    }

    /// The package of this name; if there are several, a member of the workspace.
    pub fn package(&self, name: &str) -> Option<&Package> {
        let member = self.packages.iter().find(|p| p.name == name && self.is_member(p));
        member.or_else(|| self.packages.iter().find(|p| p.name == name))
    }

    /// Whether the package is a member of the workspace.
    pub fn is_member(&self, package: &Package) -> bool {
        self.members.contains(&package.id)
    }

    /// The packages linked into a package's library, including the package itself, sorted by name.
    pub fn linked(&self, package: &str) -> Vec<&Package> {
        let mut open: Vec<&str> = self.package(package).map(|p| p.id.as_str()).into_iter().collect();
        let mut seen = HashSet::new();
        let mut linked = Vec::new();
        while let Some(id) = open.pop() {
            let Some(package) = self.packages.iter().find(|p| p.id == id) else { continue };
            if !seen.insert(id) || !package.is_linked() {
                continue;
            }
            linked.push(package);
            open.extend(self.edges.get(id).into_iter().flatten().map(String::as_str));
        }
        linked.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
        linked
    }
}
