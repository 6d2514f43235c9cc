//! The documentation page of the plant and its fragments, which are also part of the page of a whole drive.

use drive_base::joined;

/// Block diagram.
pub const DIAGRAM: &str = include_str!("../docs/pmsm_plant.svg");
/// The equations.
pub const EQUATIONS: &str = include_str!("../docs/pmsm_plant.html");

/// Documentation of [`PmsmPlant`](crate::PmsmPlant).
pub const PLANT: &str = joined!(
    DIAGRAM,
    include_str!("../docs/pmsm_plant_intro.html"),
    EQUATIONS,
    include_str!("../docs/pmsm_plant_pair.html"),
);
