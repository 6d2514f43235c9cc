//! The documentation page of the controller, and its fragments, which the page of the drive also contains.
//!
//! `fmu reproduce` draws the reference plots, and the numbers and the other plots come from runs; tests check both.

use drive_base::joined;

/// Block diagram.
pub const DIAGRAM: &str = include_str!("../docs/sensorless_controller.svg");
/// The equations.
pub const EQUATIONS: &str = include_str!("../docs/sensorless_controller.html");
/// The reference plots.
pub const REFERENCE: &str = joined!(
    include_str!("../docs/reference.html"),
    include_str!("../docs/figure-4.svg"),
    include_str!("../docs/figure-5.svg"),
);
/// Torque over speed.
pub const ENVELOPE: &str = joined!(include_str!("../docs/envelope.html"), include_str!("../docs/envelope.svg"));
/// The limits of every estimator, and the tuning.
pub const LIMITS_AND_TUNING: &str = joined!(include_str!("../docs/limits.html"), include_str!("../docs/tuning.html"));

/// Documentation of [`SensorlessControllerClocked`](crate::clocked::SensorlessControllerClocked).
pub const CLOCKED: &str =
    joined!(include_str!("../docs/sensorless_controller_clocked.html"), DIAGRAM, EQUATIONS, LIMITS_AND_TUNING);

/// Documentation of [`SensorlessController`](crate::model::SensorlessController).
pub const CONTROLLER: &str = joined!(
    DIAGRAM,
    include_str!("../docs/sensorless_controller_intro.html"),
    EQUATIONS,
    include_str!("../docs/sensorless_controller_pair.html"),
    REFERENCE,
    ENVELOPE,
    LIMITS_AND_TUNING,
);
