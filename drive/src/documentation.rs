//! The bodies of the models' documentation pages: fragments of HTML and SVG in `drive/docs`, joined at compile time.
//!
//! A page stands alone: what two models share (the equations of the drive's parts, the reference plots, torque over speed, the
//! limits, the tuning) has its own file, which each page contains. `fmu reproduce` draws the reference plots, and the numbers and
//! the other plots come from runs; tests check both.

/// Joins files from `drive/docs`.
macro_rules! joined {
    ($($file:literal)*) => {
        concat!($(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/", $file))),*)
    };
}

/// Documentation of [`PmsmPlant`](crate::PmsmPlant).
pub const PLANT: &str = joined!("pmsm_plant.svg" "pmsm_plant_intro.html" "pmsm_plant.html" "pmsm_plant_pair.html");

/// Documentation of [`SensorlessController`](crate::SensorlessController).
pub const CONTROLLER: &str = joined!(
    "sensorless_controller.svg" "sensorless_controller_intro.html" "sensorless_controller.html"
    "sensorless_controller_pair.html"
    "reference.html" "figure-4.svg" "figure-5.svg" "envelope.html" "envelope.svg" "limits.html"
    "tuning.html"
);

/// Documentation of [`PmsmDrive`](crate::PmsmDrive).
pub const DRIVE: &str = joined!(
    "pmsm_drive.svg" "pmsm_drive.html"
    "reference.html" "figure-4.svg" "figure-5.svg" "envelope.html" "envelope.svg"
    "losses.html" "losses.svg"
    "pmsm_drive_plant.html" "pmsm_plant.svg" "pmsm_plant.html"
    "pmsm_drive_controller.html" "sensorless_controller.svg" "sensorless_controller.html"
    "limits.html" "tuning.html"
);
