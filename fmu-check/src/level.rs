//! How binding a requirement is.

use serde::{Deserialize, Serialize};

/// How binding a requirement is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// The standard requires it.
    Must,
    /// The standard or its guides recommend it.
    Should,
    /// The standard leaves it open, but a robust FMU does it.
    Hard,
}
