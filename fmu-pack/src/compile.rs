//! Compiling the libraries of a workspace, for this machine or another.

use crate::error::{Context, Error, Result};
use crate::target::{BUILD_STD, Linker, MODULE, Target, cargo, rustc};
use crate::workspace::Workspace;
use fmu_import::elf::FLOOR;
use fmu_import::platform::Platform;
use serde::Deserialize;
use std::env;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A library and its package.
pub type Library = (String, PathBuf);

/// How a library is compiled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// Cargo's profile `release`, each crate optimized as one, without symbols.
    #[default]
    Release,
    /// [`Release`](Self::Release) with the whole program optimized as one, in twice the time: a distributed file, or the module of a page.
    Distribution,
    /// The profile `release` with the names of functions and with line numbers.
    Symbols,
    /// Cargo's profile `dev`, for this computer: compiled in seconds after a change, with the paths of its sources for a debugger.
    Development,
}

impl Profile {
    /// Its name in variables of the environment.
    const fn name(self) -> &'static str {
        match self {
            Self::Release | Self::Distribution | Self::Symbols => "RELEASE",
            Self::Development => "DEV",
        }
    }

    /// Settings that apply unless the caller's environment has others.
    const fn settings(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::Release => &[("LTO", "off"), ("CODEGEN_UNITS", "1"), ("STRIP", "symbols")],
            Self::Distribution => &[("LTO", "fat"), ("CODEGEN_UNITS", "1"), ("STRIP", "symbols")],
            Self::Symbols => {
                &[("LTO", "off"), ("CODEGEN_UNITS", "1"), ("STRIP", "none"), ("DEBUG", "line-tables-only")]
            }
            Self::Development => &[],
        }
    }
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
    crate_types: Vec<String>,
}

/// Compiles the cdylibs of these packages in a separate target folder (if `cargo` runs this program, it locks the usual one).
/// Except in the profile for development, local paths are removed from the binaries, so builds in two folders agree byte for byte.
///
/// # Errors
/// Cargo fails; it has then printed the reason.
pub fn compile(workspace: &Workspace, packages: &[String], target: &Target, profile: Profile) -> Result<Vec<Library>> {
    let mut libraries = Vec::new();
    if is_darwin(target) {
        // macOS stores an install name in a library, by default the path of the build. The argument that sets it applies to
        // one library only, so Cargo runs once per library.
        for name in packages {
            let one = std::slice::from_ref(name);
            let mut rustc = build("rustc", workspace, one, target, profile);
            rustc.arg("--lib").arg("--").args(install_name(name));
            libraries.extend(run(workspace, rustc, one, target)?);
        }
    } else {
        libraries = run(workspace, build("build", workspace, packages, target, profile), packages, target)?;
    }
    libraries.sort();
    Ok(libraries)
}

/// Compiles the cdylib of a package as a module of WebAssembly, which exports its C functions and its table of functions and
/// imports nothing.
///
/// # Errors
/// Those of [`compile`].
pub fn module(workspace: &Workspace, package: &str) -> Result<PathBuf> {
    let packages = [package.to_owned()];
    let mut rustc = with_options(cargo(), "rustc", workspace, &packages, MODULE, Profile::Distribution);
    rustc.args(["--target", MODULE, "--lib"]);
    // A panic ends the call in the host; `fmu_fault` has its text.
    rustc.env("CARGO_PROFILE_RELEASE_PANIC", "abort");
    // Optimized for size, because a page is sent by mail: a tenth smaller, a fifth slower.
    if env::var_os("CARGO_PROFILE_RELEASE_OPT_LEVEL").is_none() {
        rustc.env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "s");
    }
    if env::var_os(BUILD_STD).is_some() {
        rustc.env(BUILD_STD, "std,panic_abort");
    }
    // The host adds its logger to the table.
    rustc.args(["--", "-Clink-arg=--export-table", "-Clink-arg=--growable-table"]);
    let modules = artifacts(workspace, rustc, &packages, MODULE, "wasm")?;
    let module = modules.into_iter().next().map(|(_, file)| file);
    module.with_context(|| format!("{package} is not a cdylib: set crate-type = [\"cdylib\"]"))
}

/// Compiles a program of a package.
///
/// # Errors
/// The compiler cannot be run or fails.
pub fn program(workspace: &Workspace, package: &str, name: &str, target: &Target) -> Result<PathBuf> {
    let packages = [package.to_owned()];
    let mut build = build("build", workspace, &packages, target, Profile::Distribution);
    build.args(["--bin", name]);
    let program = build.get_program().to_string_lossy().into_owned();
    let status = build.stdin(Stdio::null()).stdout(Stdio::null()).status();
    if !status.with_context(|| format!("{program} cannot be run"))?.success() {
        return Err(Error::Failed(format!("building {name} failed")));
    }
    // `build` puts it below the target's name if one was given.
    let below = if target.linker == Linker::Zig { target.triple.as_str() } else { "" };
    let file = format!("{name}{}", env::consts::EXE_SUFFIX);
    Ok(workspace.target.join("fmu-build").join(below).join("release").join(file))
}

fn is_darwin(target: &Target) -> bool {
    matches!(target.platform, Platform::X64Darwin | Platform::ArmDarwin)
}

fn install_name(name: &str) -> [String; 2] {
    ["-C".into(), format!("link-arg=-Wl,-install_name,@rpath/lib{}.dylib", name.replace('-', "_"))]
}

/// The command, except for the arguments after `--`.
fn build(verb: &str, workspace: &Workspace, packages: &[String], target: &Target, profile: Profile) -> Command {
    let program = match target.linker {
        Linker::Usual => cargo(),
        Linker::Zig => Command::new("cargo-zigbuild"),
    };
    let verb = if verb == "build" && target.linker == Linker::Zig { "zigbuild" } else { verb };
    let mut build = with_options(program, verb, workspace, packages, &target.triple, profile);
    let linux = matches!(target.platform, Platform::X64Linux | Platform::ArmLinux);
    match target.linker {
        // zig links with the C library of this version.
        Linker::Zig if linux => build.args(["--target", &format!("{}.{}.{}", target.triple, FLOOR.0, FLOOR.1)]),
        Linker::Usual if target.is_host => &mut build,
        _ => build.args(["--target", &target.triple]),
    };
    // The C interface turns a panic into a status, so the workspace's panic strategy must not apply.
    build.env(format!("CARGO_PROFILE_{}_PANIC", profile.name()), "unwind");
    if target.is_host {
        // The host has a standard library; building one would require --target.
        build.env_remove(BUILD_STD);
    }
    if is_darwin(target) && env::var_os("MACOSX_DEPLOYMENT_TARGET").is_none() {
        // The first macOS with 64-bit ARM.
        build.env("MACOSX_DEPLOYMENT_TARGET", "11.0");
    }
    build
}

/// A build of these packages, with the options common to all targets.
fn with_options(
    mut build: Command,
    verb: &str,
    workspace: &Workspace,
    packages: &[String],
    triple: &str,
    profile: Profile,
) -> Command {
    build.args([verb, "--message-format", "json-render-diagnostics", "--target-dir"]);
    build.arg(workspace.target.join("fmu-build"));
    build.args(packages.iter().flat_map(|name| ["--package", name]));
    if profile != Profile::Development {
        build.arg("--release");
    }
    build.env("CARGO_ENCODED_RUSTFLAGS", flags(&workspace.root, triple, profile));
    for (setting, value) in profile.settings() {
        let name = format!("CARGO_PROFILE_{}_{setting}", profile.name());
        if env::var_os(&name).is_none() {
            build.env(name, value);
        }
    }
    build
}

/// Runs the command; returns the cdylibs that it built.
fn run(workspace: &Workspace, build: Command, packages: &[String], target: &Target) -> Result<Vec<Library>> {
    artifacts(workspace, build, packages, &target.triple, target.platform.extension())
}

/// Runs the command; returns the files with this extension that it built from the packages' cdylibs.
fn artifacts(
    workspace: &Workspace,
    mut build: Command,
    packages: &[String],
    triple: &str,
    extension: &str,
) -> Result<Vec<Library>> {
    let program = build.get_program().to_string_lossy().into_owned();
    let output = build.stdin(Stdio::null()).stderr(Stdio::inherit()).output();
    let output = output.with_context(|| format!("{program} cannot be run"))?;
    if !output.status.success() {
        let what = format!("building for {triple} failed ({})", output.status);
        return Err(Error::Failed(what));
    }
    let mut libraries = Vec::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let Ok(Artifact { reason, package_id: Some(id), target: Some(artifact), filenames }) =
            serde_json::from_str(line)
        else {
            continue;
        };
        let is_cdylib = artifact.crate_types.iter().any(|t| t == "cdylib");
        let package = workspace.packages.iter().find(|p| p.id == id);
        let library = filenames.into_iter().find(|f| f.extension().is_some_and(|e| e == extension));
        if let ("compiler-artifact", true, Some(package), Some(library)) =
            (reason.as_str(), is_cdylib, package, library)
            && packages.contains(&package.name)
        {
            libraries.push((package.name.clone(), library));
        }
    }
    Ok(libraries)
}

/// The flags for rustc: the user's, scalar arithmetic, and the removal of local paths and of the time.
fn flags(root: &Path, triple: &str, profile: Profile) -> OsString {
    const SEPARATOR: &str = "\u{1f}";
    let words = |text: String| text.split_whitespace().collect::<Vec<_>>().join(SEPARATOR);
    let users = env::var("CARGO_ENCODED_RUSTFLAGS").or_else(|_| env::var("RUSTFLAGS").map(words));
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| env::home_dir().map(|h| h.join(".cargo")));
    let mut flags = OsString::from(users.unwrap_or_default());
    let mut add = |flag: &OsStr| {
        if !flags.is_empty() {
            flags.push(SEPARATOR);
        }
        flags.push(flag);
    };
    let remap = |from: &Path, to: &str| {
        let mut flag = OsString::from("--remap-path-prefix=");
        flag.push(from);
        flag.push(format!("={to}"));
        flag
    };
    // Pairs of numbers in one register save little arithmetic. But the processor does not forward a store of a pair to a
    // load of a single number, or the reverse: a period of the drive takes a tenth longer.
    add(OsStr::new("-Cno-vectorize-slp"));
    if profile == Profile::Development {
        return flags;
    }
    add(&remap(root, "."));
    if let Some(home) = home {
        add(&remap(&home, "/cargo"));
    }
    if env::var_os(BUILD_STD).is_some()
        && let Ok(output) = rustc().args(["--print", "sysroot"]).output()
    {
        let root = String::from_utf8_lossy(&output.stdout);
        add(&remap(&Path::new(root.trim()).join("lib/rustlib/src/rust"), "/rust"));
    }
    if triple.ends_with("-windows-gnu") {
        // A DLL contains a link time stamp.
        add(OsStr::new("-Clink-arg=-Wl,--no-insert-timestamp"));
    }
    flags
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::Tools;

    /// The workspace profile's panic setting has no effect: Cargo gives priority to the environment.
    #[test]
    fn an_fmu_is_compiled_so_that_a_panic_unwinds() {
        let workspace = Workspace::find().unwrap();
        let host = Tools::find().unwrap().host();
        for (verb, profile) in [
            ("build", Profile::Release),
            ("rustc", Profile::Release),
            ("build", Profile::Distribution),
            ("build", Profile::Symbols),
            ("build", Profile::Development),
        ] {
            let build = build(verb, &workspace, &["own-fmu".into()], &host, profile);
            let set: Vec<_> = build.get_envs().collect();
            let panic = format!("CARGO_PROFILE_{}_PANIC", profile.name());
            assert!(set.contains(&(OsStr::new(&panic), Some(OsStr::new("unwind")))), "{set:?}");
            assert_eq!(build.get_args().any(|a| a == "--release"), profile != Profile::Development);
            let of = |name: &str| set.iter().find(|(of, _)| *of == OsStr::new(name)).and_then(|(_, value)| *value);
            let symbols = (profile == Profile::Symbols).then_some("none");
            let strip =
                of("CARGO_PROFILE_RELEASE_STRIP").filter(|_| env::var_os("CARGO_PROFILE_RELEASE_STRIP").is_none());
            assert_eq!(strip.map(|x| x == "none"), (profile != Profile::Development).then_some(symbols.is_some()));
            let flags = of("CARGO_ENCODED_RUSTFLAGS").unwrap().to_string_lossy();
            assert_eq!(flags.contains("--remap-path-prefix"), profile != Profile::Development, "{flags}");
        }
    }
}
