//! Data in which the plant and its controller differ so much that one of them is in another unit or of another machine: unlike a
//! controller on its own, a drive knows both.
//!
//! Temperature, saturation and tolerances change resistance, inductances and flux linkage by less than a factor of five. The inertia that the
//! controller counts may lack a load. With `plant.flux_map`, the map describes the machine; a commissioning measures it.
//! [`drops`] names devices of the inverter that would drop half of the link's voltage at the current limit: a threshold in mV, a
//! resistance in mOhm.

use drive_control::commission::CommissionMode;
use drive_control::tables::ControllerParameters;
use drive_plant::losses::conduction::Devices;
use drive_plant::tables::PlantParameters;
use fmu_core::digits;

/// Largest plausible ratio of the machine's data.
const MACHINE: f64 = 5.0;
/// Largest plausible ratio of the inertias.
const INERTIA: f64 = 10.0;

/// The message about the first of such data.
pub(crate) fn message(plant: &PlantParameters, controller: &ControllerParameters) -> Option<String> {
    if controller.commission.mode != CommissionMode::Off {
        return None;
    }
    let (is, hat) = (&plant.motor, &controller.motor);
    let linked = !plant.flux_map.used;
    let moves = !plant.mechanics.imposed && !controller.speed_loop.torque_mode;
    let pairs = [
        (true, "motor.R_s", "Ohm", hat.R_s, is.R_s, MACHINE),
        (linked, "motor.L_d", "H", hat.L_d, is.L_d, MACHINE),
        (linked, "motor.L_q", "H", hat.L_q, is.L_q, MACHINE),
        (linked, "motor.psi_M", "Wb", hat.psi_M, is.psi_M, MACHINE),
        (moves, "mechanics.J", "kg.m2", controller.J, plant.mechanics.J, INERTIA),
    ];
    let apart = |&(counts, _, _, hat, is, most): &(bool, &str, &str, f64, f64, f64)| {
        counts && is > 0.0 && hat > 0.0 && (hat > most * is || is > most * hat)
    };
    let (_, name, unit, hat, is, _) = pairs.into_iter().find(apart)?;
    let ratio = digits::text(hat / is, 3, 1e6);
    Some(format!(
        "controller.{name} = {hat} {unit} is {ratio} times plant.{name} = {is} {unit}: one of them is in another unit, or of another machine; \
         the controller needs the data of the machine that it controls"
    ))
}

/// Largest plausible voltage of a device at the current limit, as a share of the link's.
const DROP: f64 = 0.5;

/// The message about devices that leave too little of `u_dc` (V) at the current limit `i` (A).
pub(crate) fn drops(devices: &Devices, i: f64, u_dc: f64) -> Option<String> {
    let &Devices { u_transistor, r_transistor, u_diode, r_diode, .. } = devices;
    let values = [
        ("u_transistor", "V", u_transistor, u_transistor),
        ("r_transistor", "Ohm", r_transistor, r_transistor * i),
        ("u_diode", "V", u_diode, u_diode),
        ("r_diode", "Ohm", r_diode, r_diode * i),
    ];
    let (name, unit, x, drop) = values.into_iter().find(|(_, _, _, drop)| u_dc > 0.0 && *drop > DROP * u_dc)?;
    let drop = digits::text(drop, 3, 1e6);
    Some(format!(
        "plant.inverter.{name} = {x} {unit} drops {drop} V at controller.limit.i = {i} A, of u_dc = {u_dc} V: no inverter does; check that it is in {unit}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_of_another_unit_are_reported() {
        let said = |set: fn(&mut Devices)| {
            let mut devices = Devices {
                u_transistor: 0.8,
                r_transistor: 2.2e-3,
                u_diode: 0.9,
                r_diode: 1.6e-3,
                ..Devices::default()
            };
            set(&mut devices);
            drops(&devices, 240.0, 400.0).unwrap_or_default()
        };
        assert_eq!(said(|_| ()), "");
        assert_eq!(said(|d| d.r_diode = 0.5), "");
        let diode = "plant.inverter.r_diode = 1.6 Ohm drops 384 V at controller.limit.i = 240 A, of u_dc = 400 V";
        assert!(said(|d| d.r_diode = 1.6).starts_with(diode));
        assert!(said(|d| d.u_transistor = 800.0).contains("u_transistor = 800 V drops 800 V"));
        assert_eq!(drops(&Devices { r_diode: 1.6, ..Devices::default() }, 240.0, 0.0), None);
    }

    #[test]
    fn data_of_another_unit_are_reported_and_tolerances_are_not() {
        let said = |set: fn(&mut PlantParameters, &mut ControllerParameters)| {
            let (mut plant, mut controller) = (PlantParameters::default(), ControllerParameters::default());
            set(&mut plant, &mut controller);
            message(&plant, &controller).unwrap_or_default()
        };
        assert_eq!(said(|_, _| ()), "");
        assert_eq!(said(|plant, _| plant.motor.R_s *= 4.5), "");
        assert_eq!(said(|plant, _| plant.mechanics.J *= 9.0), "");
        assert!(said(|plant, _| plant.motor.L_d *= 1e-3).starts_with("controller.motor.L_d = 0.006 H is 1000 times"));
        assert!(said(|_, hat| hat.motor.psi_M *= 1e-3).contains("is 0.001 times plant.motor.psi_M"));
        assert!(said(|_, hat| hat.J *= 1e3).contains("controller.mechanics.J"));
        let other: [fn(&mut PlantParameters, &mut ControllerParameters); 3] = [
            |plant, hat| (plant.mechanics.imposed, hat.J) = (true, 1e3),
            |_, hat| (hat.speed_loop.torque_mode, hat.J) = (true, 1e3),
            |plant, hat| (plant.flux_map.used, hat.motor.psi_M) = (true, 1.0),
        ];
        for set in other {
            assert_eq!(said(set), "");
        }
    }
}
