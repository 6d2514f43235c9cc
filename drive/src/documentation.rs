//! The bodies of the models' documentation pages: fragments of HTML and SVG in `drive/docs`, joined while compiling.
//!
//! What two models share (the reference plots, the limits, the tuning) is a file of its own. The plots are those that
//! `fmu reproduce` draws and the numbers of the limits those of runs; tests hold both.

/// Joins files of `drive/docs`.
macro_rules! joined {
    ($($file:literal)*) => {
        concat!($(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/", $file))),*)
    };
}

/// Of [`PmsmPlant`](crate::PmsmPlant).
pub const PLANT: &str = joined!("pmsm_plant.svg" "pmsm_plant.html");

/// Of [`SensorlessController`](crate::SensorlessController).
pub const CONTROLLER: &str = joined!(
    "sensorless_controller.svg" "sensorless_controller.html"
    "reference.html" "figure-4.svg" "figure-5.svg" "limits.html" "tuning.html"
);

/// Of [`PmsmDrive`](crate::PmsmDrive).
pub const DRIVE: &str = joined!(
    "pmsm_drive.svg" "pmsm_drive.html" "reference.html" "figure-4.svg" "figure-5.svg" "limits.html" "tuning.html"
);
