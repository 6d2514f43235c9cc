//! Terminals of the drive: those of the plant at shaft, DC link and cooling, and the torque request of a vehicle controller.

use drive_plant::terminals::{
    COOLANT, DC_LINK, HEAT_INVERTER, HEAT_IRON, HEAT_MAGNET, HEAT_WINDING, SHAFT, SHAFT_IMPOSED,
};
use fmu_core::{Icon, Member, Terminal};

/// Terminals of `PmsmDrive`.
pub(crate) const DRIVE: &[Terminal] =
    &[TORQUE_REQUEST, SHAFT, SHAFT_IMPOSED, DC_LINK, COOLANT, HEAT_WINDING, HEAT_IRON, HEAT_MAGNET, HEAT_INVERTER];

/// Terminals of `MappedDrive`, whose losses have no separate places.
pub(crate) const MAPPED: &[Terminal] = &[TORQUE_REQUEST, SHAFT, SHAFT_IMPOSED, DC_LINK, COOLANT];

const TORQUE_REQUEST: Terminal = Terminal::plug(
    "torque_request",
    "Torque reference of a vehicle controller (controller.speed_loop.torque_mode), and the torque limits to it",
    &[Member::signal("tau_ref"), Member::signal("tau_max"), Member::signal("tau_min")],
)
.drawn(&ICON, -100.0, 40.0);

/// Icon of the terminal `torque_request`.
const ICON: Icon =
    Icon { name: "torque_request", svg: include_str!("../icons/torque_request.svg"), color: [95, 61, 196] };

#[cfg(test)]
mod tests {
    use crate::{PmsmDrive, PmsmPlant, SensorlessController};
    use fmu_core::{Causality, Description, Stored};

    fn described<M: Stored>() -> Description {
        Description::of::<M>().unwrap_or_else(|e| panic!("{}: {e}", M::INFO.name))
    }

    #[test]
    fn every_model_has_the_variables_of_its_terminals() {
        let [plant, controller, drive] =
            [described::<PmsmPlant>(), described::<SensorlessController>(), described::<PmsmDrive>()];
        let names = |d: &Description| d.terminals.iter().map(|t| t.name.clone()).collect::<Vec<_>>();
        let power = ["shaft", "shaft_imposed", "dc_link"];
        let heat = ["coolant", "heat_winding", "heat_iron", "heat_magnet", "heat_inverter"];
        assert_eq!(names(&plant), [&["phases", "sensor"][..], &power, &heat].concat());
        assert_eq!(names(&controller), ["phases", "sensor"]);
        assert_eq!(names(&drive), [&["torque_request"][..], &power, &heat].concat());
        assert!([plant, controller, drive].iter().all(|d| d.icon.is_some()));
    }

    /// In each pair of members, one side sends and the other receives, in the same unit.
    #[test]
    fn plant_and_controller_are_mirrored() {
        let (plant, controller) = (described::<PmsmPlant>(), described::<SensorlessController>());
        for one in &controller.terminals {
            let other = plant.terminals.iter().find(|t| t.name == one.name).unwrap();
            assert_eq!(one.members.len(), other.members.len());
            for (a, b) in one.members.iter().zip(&other.members) {
                assert_eq!((&a.name, a.kind), (&b.name, b.kind));
                let (a, b) = (controller.variable(&a.variable).unwrap(), plant.variable(&b.variable).unwrap());
                let pair = (a.causality, b.causality);
                let sent = [(Causality::Input, Causality::Output), (Causality::Output, Causality::Input)];
                assert!(sent.contains(&pair), "{} and {}: {pair:?}", a.name, b.name);
                assert_eq!(a.kind, b.kind, "{} and {}", a.name, b.name);
            }
        }
    }

    /// A drive can replace the plant.
    #[test]
    fn plant_and_drive_have_the_same_power_terminals() {
        let (plant, drive) = (described::<PmsmPlant>(), described::<PmsmDrive>());
        let power = drive.terminals.iter().filter(|t| t.name != "torque_request");
        assert!(power.clone().count() == 8 && power.into_iter().all(|t| plant.terminals.contains(t)));
    }
}
