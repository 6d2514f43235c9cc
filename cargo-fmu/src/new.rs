//! `fmu new`: a project for a new FMU.

use crate::{command, vendor};
use anyhow::{Context, Result, bail};
use clap::Args;
use fmu_pack::archive::GenerationTime;
use fmu_pack::target::ZIG;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Creates a folder with a new FMU: a small model, its test, a manifest, a file for CI.
///
/// Replace the model in src/lib.rs with yours. The folder needs only Rust: it contains the crates that the FMU links.
///
///   fmu new my-model
///   cd my-model
///   cargo test                  # runs the model natively
///   fmu build                   # writes target/fmu/fmi2/MyModel.fmu and target/fmu/fmi3/MyModel.fmu
///   fmu check target/fmu/fmi3/MyModel.fmu
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct New {
    /// Name of the folder and of the package; my-model becomes the FMU MyModel
    #[arg(value_name = "NAME")]
    pub name: String,
}

/// The files of a project; names in braces are filled in.
const TEMPLATE: [(&str, &str); 7] = [
    ("Cargo.toml", include_str!("../template/manifest.toml")),
    ("src/lib.rs", include_str!("../template/lib.rs")),
    ("src/tests.rs", include_str!("../template/tests.rs")),
    ("stimuli.csv", include_str!("../template/stimuli.csv")),
    ("page.toml", include_str!("../template/page.toml")),
    (".github/workflows/fmu.yml", include_str!("../template/ci.yml")),
    ("README.md", include_str!("../template/README.md")),
];

/// Version of a new package.
const VERSION: &str = "0.1.0";

/// Runs the command; returns the next steps.
///
/// # Errors
/// The name is not a valid package name, the folder exists, or the current folder is not writable.
pub fn run(args: &New) -> Result<String> {
    let name = args.name.as_str();
    judge(name)?;
    if fs::symlink_metadata(name).is_ok() {
        bail!("{name}: already exists: choose another name, or remove it");
    }
    let files = files(name)?;
    // Uses a temporary name until it is complete.
    let here = std::env::current_dir().context("the current folder")?;
    let why = || format!("{name}: cannot be written in {}: change to a folder that you may write", here.display());
    let partial = tempfile::Builder::new().prefix(".fmu-new-").tempdir_in(&here).with_context(why)?;
    let inner = partial.path().join(name);
    for (file, text) in &files {
        let path = inner.join(file);
        path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(&path, text)).with_context(why)?;
    }
    fs::rename(&inner, Path::new(name)).with_context(why)?;
    let fmu = fmu_name(name);
    let command = command();
    Ok(format!(
        "{name}: the FMU {fmu}. Next:\n  cd {name}\n  cargo test\n  {command} build\n  {command} check target/fmu/fmi3/{fmu}.fmu\n\
         With the linker zig ({ZIG}), the FMU runs on older Linux systems and passes the check with --strict.\n"
    ))
}

/// All files by name.
fn files(name: &str) -> Result<BTreeMap<String, String>> {
    let carried = vendor::are_carried();
    let version = env!("CARGO_PKG_VERSION");
    let from = |name: &str| {
        if carried { format!("{name} = {{ path = \"vendor/{name}\" }}") } else { format!("{name} = \"{version}\"") }
    };
    let install =
        if carried { "cargo install --locked --git ${{ vars.FMU_GIT }} fmu" } else { "cargo install --locked fmu" };
    let year = &GenerationTime::of_environment()?.date_and_time()[..4];
    let places = [
        ("{package}", name),
        ("{model}", &fmu_name(name)),
        ("{year}", year),
        ("{dependencies}", &vendor::CRATES.map(from).join("\n")),
        ("{install}", install),
        ("{condition}", if carried { CONDITION } else { "" }),
        ("{vendor}", if carried { VENDOR } else { "" }),
    ];
    let fill = |text: &str| places.iter().fold(text.to_owned(), |text, (place, value)| text.replace(place, value));
    let mut files: BTreeMap<String, String> = TEMPLATE.map(|(file, text)| (file.to_owned(), fill(text))).into();
    files.insert(".gitignore".into(), "/target\n".into());
    if carried {
        files.extend(vendor::files()?);
        let lock = vendor::lock(name, VERSION)?;
        if lock.matches(&format!("name = \"{name}\"\n")).count() > 1 {
            bail!("{name}: is a package that the FMU itself needs: choose another name, for example {name}-model");
        }
        files.insert("Cargo.lock".into(), lock);
    }
    Ok(files)
}

/// Until the command is published, a project's CI needs its source.
const CONDITION: &str = "        # The variable of the repository that names the Git repository of the command fmu
        if: vars.FMU_GIT != ''
";
const VENDOR: &str = "`vendor/` contains the crates `fmu-core` and `fmu-export`. In CI, the native tests always run; the FMU is built and checked \
                      too\nif the repository's variable `FMU_GIT` names the Git repository of the command `fmu`.\n";

/// Refuses names that cannot be a package with a library and an FMU.
fn judge(name: &str) -> Result<()> {
    let remedy = "a name starts with a letter and has letters a to z, digits, - and _, as in my-model";
    if let Some((folder, last)) = name.rsplit_once(['/', '\\']) {
        bail!("{name}: is a path: change to {} and run fmu new {last}", if folder.is_empty() { "/" } else { folder });
    }
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if let Some(wrong) = name.chars().find(|c| !is_part(*c)) {
        bail!("{name}: has the character {wrong:?}: {remedy}");
    }
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        bail!("{name}: does not start with a letter: {remedy}");
    }
    if name.len() > 64 {
        bail!("{name}: has {} characters: at most 64 are allowed", name.len());
    }
    if KEYWORDS.contains(&name) {
        bail!("{name}: is a keyword of Rust: choose another name, for example {name}-model");
    }
    if TAKEN.contains(&name) {
        bail!("{name}: is a name of Rust or Cargo: choose another name, for example {name}-model");
    }
    Ok(())
}

/// Rust's keywords in lower case, which no crate can be named after (reference, "Keywords", edition 2024).
const KEYWORDS: [&str; 50] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate", "do", "dyn", "else",
    "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop", "macro", "match", "mod",
    "move", "mut", "override", "priv", "pub", "ref", "return", "self", "static", "struct", "super", "trait", "true",
    "try", "type", "typeof", "unsafe", "unsized", "use", "virtual", "where", "while",
];

/// Rust's own crates, and names reserved by Cargo.
const TAKEN: [&str; 9] = ["alloc", "build", "core", "deps", "examples", "incremental", "proc-macro", "std", "test"];

/// Name of the FMU: the words of the package's name, each with a capital letter.
fn fmu_name(package: &str) -> String {
    let capital = |word: &str| word[..1].to_ascii_uppercase() + &word[1..];
    package.split(['-', '_']).filter(|word| !word.is_empty()).map(capital).collect()
}
