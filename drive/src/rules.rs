//! What plant and controller of a drive must have in common.

use drive_base::modulation::PwmUpdate;
use drive_control::commissioning::CommissionMode;
use drive_control::tables as control;
use drive_control::tables::ControllerParameters;
use drive_plant::pwm::ZeroSequence;
use drive_plant::tables as plant;
use drive_plant::tables::PlantParameters;
use fmu_core::Fault;

/// Relative difference of two periods that is rounding.
const ROUNDING: f64 = 1e-9;

/// Refuses a controller whose number of pole pairs differs from the machine's.
///
/// # Errors
/// Names both.
pub(crate) fn same_pole_pairs(plant: &PlantParameters, controller: &ControllerParameters) -> Result<(), Fault> {
    if plant.motor.n_p == controller.motor.n_p {
        return Ok(());
    }
    Err(Fault::new(format!(
        "plant.{} and controller.{}: the speed of the drive would differ from its reference; set both to the same number of pole \
         pairs",
        plant::PARAMETERS.tell(plant, |p| &mut p.motor.n_p),
        control::PARAMETERS.tell(controller, |p| &mut p.motor.n_p)
    )))
}

/// Refuses a self-commissioning whose PWM is not that of a switched inverter: its values would be outside their intervals.
///
/// # Errors
/// Names the parameters of the PWM that differ.
pub(crate) fn known_carrier(plant: &PlantParameters, controller: &ControllerParameters) -> Result<(), Fault> {
    if controller.commission.mode == CommissionMode::Off || !plant.is_switched() {
        return Ok(());
    }
    let mode = || control::PARAMETERS.tell(controller, |p| &mut p.commission.mode);
    let (update, expected) = (plant.inverter.pwm.update, controller.commission.update);
    let T = expected.each_period() * controller.T_s;
    if update != expected || (plant.inverter.T_pwm - T).abs() > ROUNDING * T {
        let samples = if expected == PwmUpdate::Single { "T_s" } else { "2 T_s" };
        return Err(Fault::new(format!(
            "plant.{} with plant.{} and controller.{}: with controller.{}, the carrier period is {samples} = {T} s with the same update, or \
             the ripple that the self-commissioning computes is not that of the inverter",
            plant::PARAMETERS.tell(plant, |p| &mut p.inverter.T_pwm),
            plant::PARAMETERS.tell(plant, |p| &mut p.inverter.pwm.update),
            control::PARAMETERS.tell(controller, |p| &mut p.commission.update),
            mode()
        )));
    }
    if plant.inverter.pwm.carrier_delay > 0.0 {
        return Err(Fault::new(format!(
            "plant.{} with controller.{}: samples between the extremes of the carrier contain the ripple, which the self-commissioning takes \
             for current; set plant.inverter.carrier_delay = 0",
            plant::PARAMETERS.tell(plant, |p| &mut p.inverter.pwm.carrier_delay),
            mode()
        )));
    }
    let rests = !matches!(plant.inverter.pwm.zero_sequence, ZeroSequence::MinMax | ZeroSequence::None);
    if rests && plant.inverter.dead_time > 0.0 {
        return Err(Fault::new(format!(
            "plant.{} with plant.{} and controller.{}: a leg that rests loses no voltage, and the self-commissioning takes the loss for that \
             of three legs; set plant.inverter.zero_sequence = 1 (MinMax) or 2 (None)",
            plant::PARAMETERS.tell(plant, |p| &mut p.inverter.pwm.zero_sequence),
            plant::PARAMETERS.tell(plant, |p| &mut p.inverter.dead_time),
            mode()
        )));
    }
    Ok(())
}
