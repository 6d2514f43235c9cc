//! The Rust targets of FMUs, and a check that this machine can build for them.

use crate::error::{Context, Result, invalid};
use fmu_import::platform::Platform;
use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// How to install zig as a linker.
pub const ZIG: &str = "pip install cargo-zigbuild ziglang";

/// Makes Cargo build the standard library from source.
pub(crate) const BUILD_STD: &str = "CARGO_UNSTABLE_BUILD_STD";

/// The target of the modules that pages run. It is not a platform of FMI: modules are not loaded natively.
pub const MODULE: &str = "wasm32-unknown-unknown";

/// A target that can be built here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// Its rustc name.
    pub triple: String,
    /// Its FMI platform name.
    pub platform: Platform,
    /// Whether it is the build machine.
    pub is_host: bool,
    /// Its linker.
    pub linker: Linker,
}

/// The linker of a target's libraries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Linker {
    /// The default linker of rustc, or the one that the user configured in Cargo.
    Usual,
    /// zig, through cargo-zigbuild: it has the C library of every Linux and of macOS.
    Zig,
}

/// The compiler and its helpers on this machine.
#[derive(Debug)]
pub struct Tools {
    host: String,
    /// zig as a linker, or the missing prerequisite.
    zig: Result<(), String>,
}

impl Tools {
    /// Detects the compiler and its helpers.
    ///
    /// # Errors
    /// rustc cannot be run.
    pub fn find() -> Result<Self> {
        Ok(Self { host: host_triple()?, zig: zig() })
    }

    /// The target of this machine.
    pub fn host(&self) -> Target {
        let platform = Platform::host();
        let linker = self.linker(&self.host, platform, "gnu").unwrap_or(Linker::Usual);
        Target { triple: self.host.clone(), platform, is_host: true, linker }
    }

    /// A target by its name, with the tools for its build.
    ///
    /// # Errors
    /// rustc does not support the target, FMI has no platform for it, or its standard library or a linker is missing; the error
    /// explains how to install it.
    pub fn target(&self, triple: &str) -> Result<Target> {
        let wrong = |cause: String| invalid!("--target {triple}: {cause}");
        let mut rustc = rustc();
        rustc.args(["--print", "cfg", "--print", "target-libdir", "--target", triple]);
        let output = rustc.stdin(Stdio::null()).output().context("rustc cannot be run")?;
        if !output.status.success() {
            return Err(wrong("rustc has no such target; rustc --print target-list lists all".into()));
        }
        let text = String::from_utf8_lossy(&output.stdout);
        let value = |key: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix("=\""));
            line.map_or("", |rest| rest.trim_end_matches('"'))
        };
        let (os, processor, environment) = (value("target_os"), value("target_arch"), value("target_env"));
        let known = || Platform::ALL.map(Platform::tuple).join(", ");
        let platform = Platform::of(os, processor)
            .ok_or_else(|| wrong(format!("is not a supported platform of FMUs; available: {}", known())))?;
        if os == "linux" && environment != "gnu" {
            // A process has one C library, and importers use the GNU one.
            let instead = format!("{processor}-unknown-linux-gnu");
            return Err(wrong(format!("importers on Linux do not load a library for {environment}; use {instead}")));
        }
        let linker = self.linker(triple, platform, environment).map_err(wrong)?;
        has_std(&text, triple).map_err(wrong)?;
        Ok(Target { triple: triple.into(), platform, is_host: triple == self.host, linker })
    }

    /// The linker of a target, or the missing prerequisite.
    fn linker(&self, triple: &str, platform: Platform, environment: &str) -> Result<Linker, String> {
        let users = format!("CARGO_TARGET_{}_LINKER", triple.to_uppercase().replace(['-', '.'], "_"));
        if env::var_os(users).is_some() {
            return Ok(Linker::Usual);
        }
        let native = triple == self.host;
        match platform {
            Platform::X64Linux | Platform::ArmLinux => match &self.zig {
                Ok(()) => Ok(Linker::Zig),
                Err(_) if native => Ok(Linker::Usual),
                Err(missing) => Err(missing.clone()),
            },
            // macOS builds for both of its processors.
            Platform::X64Darwin | Platform::ArmDarwin if cfg!(target_os = "macos") => Ok(Linker::Usual),
            Platform::X64Darwin | Platform::ArmDarwin => self.zig.clone().map(|()| Linker::Zig),
            Platform::X64Windows | Platform::ArmWindows if cfg!(windows) => Ok(Linker::Usual),
            Platform::X64Windows | Platform::ArmWindows if environment == "msvc" => {
                Err("can be linked only on Windows; use x86_64-pc-windows-gnu".into())
            }
            Platform::X64Windows if find("x86_64-w64-mingw32-gcc").is_none() => {
                Err("its linker x86_64-w64-mingw32-gcc is missing: apt install gcc-mingw-w64-x86-64-win32".into())
            }
            Platform::X64Windows | Platform::ArmWindows => Ok(Linker::Usual),
        }
    }
}

/// Checks that the modules of pages can be built here.
///
/// # Errors
/// The standard library for them is missing; the error explains how to install it.
pub fn has_modules() -> Result<()> {
    let mut rustc = rustc();
    rustc.args(["--print", "target-libdir", "--target", MODULE]);
    let output = rustc.stdin(Stdio::null()).output().context("rustc cannot be run")?;
    has_std(&String::from_utf8_lossy(&output.stdout), MODULE).map_err(|cause| invalid!("{MODULE}: {cause}"))
}

/// The compiler.
pub fn rustc() -> Command {
    Command::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()))
}

/// Cargo.
pub fn cargo() -> Command {
    Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// The compiler's own target.
///
/// # Errors
/// rustc cannot be run.
pub fn host_triple() -> Result<String> {
    let output = rustc().arg("-vV").output().context("rustc cannot be run")?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).context("rustc -vV does not name the host")
}

/// Whether cargo-zigbuild is installed and finds zig.
fn zig() -> Result<(), String> {
    if find("cargo-zigbuild").is_none() {
        return Err(format!("its linker zig needs cargo-zigbuild, which is not in PATH: {ZIG}"));
    }
    let asked = Command::new("cargo-zigbuild").args(["zig", "cc", "--", "--version"]).stdin(Stdio::null()).output();
    match asked {
        Ok(output) if output.status.success() => Ok(()),
        _ => Err(format!("its linker zig is missing, cargo-zigbuild finds none: {ZIG}")),
    }
}

/// Checks that a standard library for a target exists or is built by Cargo. `printed` is the output of rustc, with the
/// folder in one line.
fn has_std(printed: &str, triple: &str) -> Result<(), String> {
    let libraries = printed.lines().find(|line| Path::new(line).is_absolute()).unwrap_or_default();
    let is_std = |name: &str| name.starts_with("libstd-");
    let mut files = Path::new(libraries).read_dir().into_iter().flatten().flatten();
    if files.any(|file| file.file_name().to_str().is_some_and(is_std)) || env::var_os(BUILD_STD).is_some() {
        return Ok(());
    }
    Err(format!("Rust's standard library for it is missing: rustup target add {triple}"))
}

/// A program in `PATH`.
pub fn find(program: &str) -> Option<PathBuf> {
    let name = format!("{program}{}", env::consts::EXE_SUFFIX);
    env::split_paths(&env::var_os("PATH")?).map(|folder| folder.join(&name)).find(|path| path.is_file())
}
