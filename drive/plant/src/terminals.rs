//! Terminals of the plant: connections to its controller, its load, its DC link and its cooling.
//!
//! At the shaft and the DC link, where power leaves the model, torque and current are flows: they sum to zero with the
//! connected component's. Heat is positive out of the model. The terminals that the controller mirrors are in
//! [`connection`](drive_base::connection).

use drive_base::connection::{PHASES, SENSOR, phases};
use fmu_core::{Member, Terminal};

/// Terminals of `PmsmPlant`.
pub(crate) const PLANT: &[Terminal] = &[
    Terminal::plug(
        "phases",
        "Voltage references, enable and active short circuit from the controller, measured currents to it",
        &phases(Member::signal("enable"), Member::signal("asc")),
    )
    .drawn(&PHASES, -100.0, 40.0),
    Terminal::plug(
        "sensor",
        "What a shaft sensor measures: mechanical speed and electrical angle",
        &[Member::signal("speed"), Member::signal("theta_e")],
    )
    .drawn(&SENSOR, -100.0, -40.0),
    SHAFT,
    SHAFT_IMPOSED,
    DC_LINK,
    COOLANT,
    HEAT_WINDING,
    HEAT_IRON,
    HEAT_MAGNET,
    HEAT_INVERTER,
];

/// The shaft end: the load receives speed and angle and returns its torque.
pub const SHAFT: Terminal = Terminal::plug(
    "shaft",
    "The shaft's end, turning freely: speed and angle to the load, torque from the load",
    &[Member::signal("speed"), Member::signal("angle"), Member::outflow("tau").of("tau_load")],
)
.drawn(&icon::SHAFT, 100.0, 40.0);

/// The shaft end in the reverse direction, with `mechanics.imposed`.
pub const SHAFT_IMPOSED: Terminal = Terminal::plug(
    "shaft_imposed",
    "The shaft's end with speed and angle imposed by the drive train (mechanics.imposed), and the torque to the drive train",
    &[
        Member::signal("speed").of("speed_shaft"),
        Member::signal("angle").of("angle_shaft"),
        Member::outflow("tau").of("tau_shaft"),
    ],
)
.drawn(&icon::SHAFT, 100.0, -40.0);

/// The DC link.
pub const DC_LINK: Terminal = Terminal::plug(
    "dc_link",
    "DC link of the inverter: its voltage, and the current drawn from it",
    &[Member::signal("u_dc"), Member::inflow("i_dc")],
)
.drawn(&icon::DC_LINK, 0.0, 100.0);

/// The coolant, with `thermal.mode` = Network; with Constant, all losses flow to it at once.
pub const COOLANT: Terminal = Terminal::plug(
    "coolant",
    "Coolant of machine and inverter: its temperature, and the heat to it",
    &[Member::signal("T").of("T_coolant"), Member::outflow("Q").of("Q_coolant")],
)
.drawn(&icon::COOLANT, 0.0, -100.0);

/// Heat out of the winding.
pub const HEAT_WINDING: Terminal = Terminal::plug(
    "heat_winding",
    "The winding in a thermal model outside (thermal.mode = Imposed): its temperature, and the heat out of it",
    &[Member::signal("T").of("T_winding_imposed"), Member::outflow("Q").of("Q_winding")],
)
.drawn(&icon::HEAT, -80.0, -100.0);

/// Heat out of the stator iron.
pub const HEAT_IRON: Terminal = Terminal::plug(
    "heat_iron",
    "The stator iron in a thermal model outside (thermal.mode = Imposed): its temperature, and the heat out of it",
    &[Member::signal("T").of("T_stator_imposed"), Member::outflow("Q").of("Q_iron")],
)
.drawn(&icon::HEAT, -40.0, -100.0);

/// Heat out of rotor and magnets.
pub const HEAT_MAGNET: Terminal = Terminal::plug(
    "heat_magnet",
    "Rotor and magnets in a thermal model outside (thermal.mode = Imposed): their temperature, and the heat out of them",
    &[Member::signal("T").of("T_magnet_imposed"), Member::outflow("Q").of("Q_magnet")],
)
.drawn(&icon::HEAT, 40.0, -100.0);

/// Heat out of the inverter.
pub const HEAT_INVERTER: Terminal = Terminal::plug(
    "heat_inverter",
    "The inverter in a thermal model outside (thermal.mode = Imposed): its temperature, and the heat out of it",
    &[Member::signal("T").of("T_inverter_imposed"), Member::outflow("Q").of("Q_inverter")],
)
.drawn(&icon::HEAT, 80.0, -100.0);

/// Icons of the terminals.
mod icon {
    use fmu_core::Icon;

    pub(super) const SHAFT: Icon = Icon { name: "shaft", svg: include_str!("../icons/shaft.svg"), color: [73, 80, 87] };
    pub(super) const DC_LINK: Icon =
        Icon { name: "dc_link", svg: include_str!("../icons/dc_link.svg"), color: [24, 100, 171] };
    pub(super) const COOLANT: Icon =
        Icon { name: "coolant", svg: include_str!("../icons/coolant.svg"), color: [11, 114, 133] };
    pub(super) const HEAT: Icon = Icon { name: "heat", svg: include_str!("../icons/heat.svg"), color: [201, 42, 42] };
}
