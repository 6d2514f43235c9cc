//! The documentation pages of the models. Each stands alone: that of the drive contains the fragments of its parts.

use drive_base::joined;
pub use drive_control::documentation::CONTROLLER;
use drive_control::documentation::{DIAGRAM, ENVELOPE, EQUATIONS, LIMITS_AND_TUNING, REFERENCE};

/// Documentation of [`PmsmPlant`](crate::PmsmPlant).
pub const PLANT: &str = joined!(
    include_str!("../docs/pmsm_plant.svg"),
    include_str!("../docs/pmsm_plant_intro.html"),
    include_str!("../docs/pmsm_plant.html"),
    include_str!("../docs/pmsm_plant_pair.html"),
);

/// Documentation of [`PmsmDrive`](crate::PmsmDrive).
pub const DRIVE: &str = joined!(
    include_str!("../docs/pmsm_drive.svg"),
    include_str!("../docs/pmsm_drive.html"),
    REFERENCE,
    ENVELOPE,
    include_str!("../docs/losses.html"),
    include_str!("../docs/losses.svg"),
    include_str!("../docs/pmsm_drive_plant.html"),
    include_str!("../docs/pmsm_plant.svg"),
    include_str!("../docs/pmsm_plant.html"),
    include_str!("../docs/pmsm_drive_controller.html"),
    DIAGRAM,
    EQUATIONS,
    LIMITS_AND_TUNING,
);
