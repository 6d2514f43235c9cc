//! The two standards.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum FmiVersion {
    /// FMI 2.0.
    V2,
    /// FMI 3.0.
    V3,
}

impl fmt::Display for FmiVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // `fmiVersion` does not include a patch release: FMI 2.0.5, 2.2.1; FMI 3.0.2, 2.4.1.
        f.pad(match self {
            Self::V2 => "2.0",
            Self::V3 => "3.0",
        })
    }
}

/// A version other than 2.0 and 3.0.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is not a version of FMI that is known here: expected 2 or 3")]
pub struct UnknownVersion(String);

impl FromStr for FmiVersion {
    type Err = UnknownVersion;

    fn from_str(text: &str) -> Result<Self, UnknownVersion> {
        match text {
            "2" | "2.0" => Ok(Self::V2),
            "3" | "3.0" => Ok(Self::V3),
            _ => Err(UnknownVersion(text.into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_back() {
        for version in [FmiVersion::V2, FmiVersion::V3] {
            assert_eq!(version.to_string().parse(), Ok(version));
        }
        assert_eq!("3".parse(), Ok(FmiVersion::V3));
        let message = "1.0".parse::<FmiVersion>().map_err(|e| e.to_string());
        assert_eq!(message, Err("\"1.0\" is not a version of FMI that is known here: expected 2 or 3".into()));
    }
}
