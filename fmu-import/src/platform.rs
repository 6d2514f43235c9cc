//! Platforms and their names in both standards.

use model_description::FmiVersion;
use std::env::consts;
use std::fmt;
use std::str::FromStr;

/// An operating system and a processor for which FMUs have binaries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Platform {
    /// Linux on x86_64.
    X64Linux,
    /// Linux on 64-bit ARM.
    ArmLinux,
    /// Windows on x86_64.
    X64Windows,
    /// Windows on 64-bit ARM.
    ArmWindows,
    /// macOS on x86_64.
    X64Darwin,
    /// macOS on 64-bit ARM.
    ArmDarwin,
}

impl Platform {
    /// All known platforms.
    pub const ALL: [Self; 6] =
        [Self::X64Linux, Self::ArmLinux, Self::X64Windows, Self::ArmWindows, Self::X64Darwin, Self::ArmDarwin];

    /// The platform that this program runs on; another Unix counts as Linux.
    pub fn host() -> Self {
        let unix = || Self::of("linux", consts::ARCH);
        Self::of(consts::OS, consts::ARCH).or_else(unix).unwrap_or(Self::X64Linux)
    }

    /// The platform of an operating system and a processor, as Rust calls them.
    pub fn of(os: &str, processor: &str) -> Option<Self> {
        match (os, processor) {
            ("linux", "x86_64") => Some(Self::X64Linux),
            ("linux", "aarch64") => Some(Self::ArmLinux),
            ("windows", "x86_64") => Some(Self::X64Windows),
            ("windows", "aarch64") => Some(Self::ArmWindows),
            ("macos", "x86_64") => Some(Self::X64Darwin),
            ("macos", "aarch64") => Some(Self::ArmDarwin),
            _ => None,
        }
    }

    /// The platform of a folder under `binaries/`, if it is one of these; x86_64 for the names of FMI 2.0, which name no
    /// processor.
    pub fn of_folder(folder: &str, version: FmiVersion) -> Option<Self> {
        let first = |p: &Self| p.folders(version)[0] == folder;
        let any = |p: &Self| p.folders(version).contains(&folder);
        Self::ALL.into_iter().find(first).or_else(|| Self::ALL.into_iter().find(any))
    }

    /// The platform tuple of FMI 3.0 (FMI 3.0.2, 2.5.1.4.1).
    pub const fn tuple(self) -> &'static str {
        match self {
            Self::X64Linux => "x86_64-linux",
            Self::ArmLinux => "aarch64-linux",
            Self::X64Windows => "x86_64-windows",
            Self::ArmWindows => "aarch64-windows",
            Self::X64Darwin => "x86_64-darwin",
            Self::ArmDarwin => "aarch64-darwin",
        }
    }

    /// The folders under `binaries/` to look in, the one to write to first. FMI 2.0.5, 2.3 names three of 64 bits, which do not
    /// depend on the processor, and lets others use the tuples of FMI 3.0. Many importers recognize only those three, even on
    /// ARM.
    pub fn folders(self, version: FmiVersion) -> Vec<&'static str> {
        match (version, self) {
            (FmiVersion::V2, Self::X64Linux) => vec!["linux64", self.tuple()],
            (FmiVersion::V2, Self::X64Windows) => vec!["win64", self.tuple()],
            // A universal library is for both processors.
            (FmiVersion::V2, Self::X64Darwin | Self::ArmDarwin) => vec!["darwin64", self.tuple()],
            (FmiVersion::V2, Self::ArmLinux) => vec![self.tuple(), "linux64"],
            (FmiVersion::V2, Self::ArmWindows) => vec![self.tuple(), "win64"],
            (FmiVersion::V3, _) => vec![self.tuple()],
        }
    }

    /// Extension of a shared library.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::X64Linux | Self::ArmLinux => "so",
            Self::X64Windows | Self::ArmWindows => "dll",
            Self::X64Darwin | Self::ArmDarwin => "dylib",
        }
    }
}

impl fmt::Display for Platform {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.tuple())
    }
}

impl FromStr for Platform {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = || Self::ALL.map(Self::tuple).join(", ");
        Self::ALL
            .into_iter()
            .find(|p| p.tuple() == text)
            .ok_or_else(|| format!("{text} is not a platform: {}", known()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_the_standards() {
        assert_eq!(Platform::X64Linux.folders(FmiVersion::V2)[0], "linux64");
        assert_eq!(Platform::ArmDarwin.folders(FmiVersion::V2), ["darwin64", "aarch64-darwin"]);
        assert_eq!(Platform::ArmLinux.folders(FmiVersion::V2), ["aarch64-linux", "linux64"]);
        for platform in Platform::ALL {
            assert_eq!(platform.folders(FmiVersion::V3), [platform.tuple()]);
            assert_eq!(platform.tuple().parse(), Ok(platform));
        }
        assert!("x86_64-plan9".parse::<Platform>().is_err());
        for platform in Platform::ALL {
            for version in [FmiVersion::V2, FmiVersion::V3] {
                assert_eq!(Platform::of_folder(platform.tuple(), version), Some(platform));
            }
        }
        for (folder, platform) in
            [("linux64", Platform::X64Linux), ("win64", Platform::X64Windows), ("darwin64", Platform::X64Darwin)]
        {
            assert_eq!(Platform::of_folder(folder, FmiVersion::V2), Some(platform));
        }
        assert_eq!(Platform::of_folder("x86_64-linux", FmiVersion::V2), Some(Platform::X64Linux));
        assert_eq!(Platform::of_folder("linux64", FmiVersion::V3), None);
    }
}
