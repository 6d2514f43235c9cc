//! The Cargo workspace around the current folder: what it holds, and compiling it.

use anyhow::{Context, Result, anyhow, bail};
use serde::Deserialize;
use std::collections::{HashMap, HashSet};
use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A Cargo workspace.
pub struct Workspace {
    /// Its root folder.
    pub root: PathBuf,
    /// Cargo's target folder, `CARGO_TARGET_DIR` honoured.
    pub target: PathBuf,
    /// Every package that its members depend on, members included.
    pub packages: Vec<Package>,
    members: HashSet<String>,
    edges: HashMap<String, Vec<String>>,
}

/// A package, as Cargo describes it.
#[derive(Clone, Debug, Deserialize)]
pub struct Package {
    id: String,
    /// Name.
    pub name: String,
    /// Version.
    pub version: String,
    /// Licence, an SPDX expression.
    pub license: Option<String>,
    /// Where it comes from.
    pub repository: Option<String>,
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

#[derive(Deserialize)]
struct Artifact {
    reason: String,
    package_id: Option<String>,
    target: Option<ArtifactTarget>,
    #[serde(default)]
    filenames: Vec<PathBuf>,
}

#[derive(Deserialize)]
struct ArtifactTarget {
    name: String,
    crate_types: Vec<String>,
}

impl Package {
    /// Its folder.
    pub fn folder(&self) -> &Path {
        self.manifest_path.parent().unwrap_or(Path::new("."))
    }

    /// Whether it has a library that C can load.
    pub fn has_cdylib(&self) -> bool {
        self.targets
            .iter()
            .any(|t| t.kind.iter().all(|k| k != "example") && t.crate_types.iter().any(|c| c == "cdylib"))
    }

    /// A procedural macro runs in the compiler; nothing of it is in the binary.
    fn is_linked(&self) -> bool {
        !self.targets.iter().any(|t| t.kind.iter().any(|k| k == "proc-macro"))
    }
}

/// What to compile.
pub enum Selection<'a> {
    /// The cdylibs of these packages.
    Packages(&'a [String]),
    /// A cdylib among the examples.
    Example(&'a str),
}

impl Workspace {
    /// The workspace around the current folder.
    ///
    /// # Errors
    /// There is none, or Cargo cannot be run.
    pub fn find() -> Result<Self> {
        let mut metadata = cargo();
        metadata.args(["metadata", "--format-version", "1", "--filter-platform", &host_triple()?]);
        let output = metadata.stdin(Stdio::null()).output().context("cargo cannot be run")?;
        if !output.status.success() {
            let message = String::from_utf8_lossy(&output.stderr);
            let message = message.split_whitespace().collect::<Vec<_>>().join(" ");
            bail!("no Cargo workspace here: {}", message.trim_start_matches("error: "));
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

    /// The packages of FMUs: the workspace's members below `fmus/`.
    pub fn fmus(&self) -> Vec<&Package> {
        let below = self.root.join("fmus");
        self.packages.iter().filter(|p| self.is_member(p) && p.folder().starts_with(&below)).collect()
    }

    /// The package of this name, a member of the workspace if several have it.
    pub fn package(&self, name: &str) -> Option<&Package> {
        let member = self.packages.iter().find(|p| p.name == name && self.is_member(p));
        member.or_else(|| self.packages.iter().find(|p| p.name == name))
    }

    /// Whether the package is one of the workspace's own.
    pub fn is_member(&self, package: &Package) -> bool {
        self.members.contains(&package.id)
    }

    /// What is linked into a package's library, the package included, sorted by name.
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

    /// Compiles, optimised, in a target folder of its own (a `cargo` that waits for this program holds the usual one);
    /// returns each cdylib with the name of its package. Paths of this machine stay out of the binaries, so that builds
    /// at two places agree byte for byte.
    ///
    /// # Errors
    /// Cargo fails; it has then told why.
    pub fn compile(&self, selection: &Selection<'_>) -> Result<Vec<(String, PathBuf)>> {
        let mut build = cargo();
        build.args(["build", "--release", "--message-format", "json-render-diagnostics", "--target-dir"]);
        build.arg(self.target.join("fmu-build"));
        match selection {
            Selection::Packages(names) => build.args(names.iter().flat_map(|name| ["--package", name])),
            Selection::Example(name) => build.args(["--example", name]),
        };
        build.env("CARGO_ENCODED_RUSTFLAGS", self.flags());
        let output = build.stdin(Stdio::null()).stderr(Stdio::inherit()).output().context("cargo cannot be run")?;
        if !output.status.success() {
            return Err(crate::Failed(format!("cargo build failed ({})", output.status)).into());
        }
        let wanted = |target: &ArtifactTarget| match selection {
            Selection::Packages(_) => true,
            Selection::Example(name) => target.name == *name,
        };
        let mut libraries = Vec::new();
        for line in String::from_utf8_lossy(&output.stdout).lines() {
            let Ok(Artifact { reason, package_id: Some(id), target: Some(target), filenames }) =
                serde_json::from_str(line)
            else {
                continue;
            };
            let is_cdylib = target.crate_types.iter().any(|t| t == "cdylib") && wanted(&target);
            let package = self.packages.iter().find(|p| p.id == id);
            let library =
                filenames.into_iter().find(|f| f.extension().is_some_and(|e| e == std::env::consts::DLL_EXTENSION));
            if let ("compiler-artifact", true, Some(package), Some(library)) =
                (reason.as_str(), is_cdylib, package, library)
            {
                let selected = match selection {
                    Selection::Packages(names) => names.contains(&package.name),
                    Selection::Example(_) => true,
                };
                if selected {
                    libraries.push((package.name.clone(), library));
                }
            }
        }
        libraries.sort();
        Ok(libraries)
    }

    /// The flags for rustc: the user's, and the removal of local paths.
    fn flags(&self) -> OsString {
        const SEPARATOR: &str = "\u{1f}";
        let words = |text: String| text.split_whitespace().collect::<Vec<_>>().join(SEPARATOR);
        let users = env::var("CARGO_ENCODED_RUSTFLAGS").or_else(|_| env::var("RUSTFLAGS").map(words));
        let home = env::var_os("CARGO_HOME").map(PathBuf::from);
        let home = home.or_else(|| env::home_dir().map(|h| h.join(".cargo")));
        let mut flags = OsString::from(users.unwrap_or_default());
        let mut remap = |from: &Path, to: &str| {
            if !flags.is_empty() {
                flags.push(SEPARATOR);
            }
            flags.push("--remap-path-prefix=");
            flags.push(from);
            flags.push(format!("={to}"));
        };
        remap(&self.root, ".");
        if let Some(home) = home {
            remap(&home, "/cargo");
        }
        flags
    }
}

fn cargo() -> Command {
    Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

fn host_triple() -> Result<String> {
    let rustc = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("-vV").output().context("rustc cannot be run")?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).ok_or_else(|| anyhow!("rustc -vV names no host"))
}
