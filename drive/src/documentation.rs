//! The documentation pages of the models. Each is complete: the page of the drive contains the fragments of its parts.

use drive_base::joined;
pub use drive_control::documentation::CONTROLLER;
use drive_control::documentation::{self as control, ENVELOPE, LIMITS_AND_TUNING, REFERENCE};
use drive_plant::documentation as plant;
pub use drive_plant::documentation::PLANT;

/// Documentation of [`PmsmDrive`](crate::PmsmDrive).
pub const DRIVE: &str = joined!(
    include_str!("../docs/pmsm_drive.svg"),
    include_str!("../docs/pmsm_drive.html"),
    REFERENCE,
    ENVELOPE,
    include_str!("../docs/losses.html"),
    include_str!("../docs/losses.svg"),
    include_str!("../docs/map.html"),
    include_str!("../docs/map.svg"),
    include_str!("../docs/pmsm_drive_plant.html"),
    plant::DIAGRAM,
    plant::EQUATIONS,
    include_str!("../docs/pmsm_drive_controller.html"),
    control::DIAGRAM,
    control::EQUATIONS,
    LIMITS_AND_TUNING,
);

/// Documentation of [`PmsmDriveMean`](crate::PmsmDriveMean).
pub const MEAN: &str = joined!(
    include_str!("../docs/pmsm_drive.svg"),
    include_str!("../docs/pmsm_drive_mean.html"),
    ENVELOPE,
    include_str!("../docs/losses.html"),
    include_str!("../docs/losses.svg"),
    include_str!("../docs/map.html"),
    include_str!("../docs/map.svg"),
);

/// Documentation of [`MappedDrive`](crate::MappedDrive).
pub const MAPPED: &str = joined!(include_str!("../docs/mapped_drive.svg"), include_str!("../docs/mapped_drive.html"));
