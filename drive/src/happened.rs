//! A condition that is reported once.

use serde::{Deserialize, Serialize};

/// Occurrence of a condition that is reported once, such as a load far above the torque of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) enum Happened {
    #[default]
    Never,
    /// First occurrence, at the last step.
    Now,
    /// Occurred earlier.
    Before,
}

impl Happened {
    /// The next value after a step; `is`: whether the condition was met in it.
    pub(crate) fn followed_by(self, is: bool) -> Self {
        match self {
            Self::Never if is => Self::Now,
            Self::Now => Self::Before,
            same => same,
        }
    }
}
