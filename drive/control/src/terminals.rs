//! Terminals of the controller, which mirror those of the plant.

use drive_base::connection::{PHASES, SENSOR, phases};
use fmu_core::{Member, Terminal};

/// Terminals of `SensorlessController`.
pub(crate) const CONTROLLER: &[Terminal] = &[
    Terminal::plug(
        "phases",
        "Voltage references, enable and active short circuit to the plant, measured currents from it",
        &phases(Member::signal("enable").of("enabled"), Member::signal("asc").of("short_circuit")),
    )
    .drawn(&PHASES, 100.0, 40.0),
    Terminal::plug(
        "sensor",
        "A shaft sensor, read by the sensored estimator only: mechanical speed and electrical angle",
        &[Member::signal("speed").of("speed_meas"), Member::signal("theta_e").of("theta_meas")],
    )
    .drawn(&SENSOR, 100.0, -40.0),
];
