//! Rules across the parameters of the plant: a flux map describes a machine, a network has heat capacities, a period contains its dead
//! times, and the machine works at the temperatures.

use crate::tables::{PARAMETERS, PlantParameters};
use crate::thermal::{Temperatures, ThermalMode};
use drive_base::frame::Dq;
use drive_base::motor::Motor;
use fmu_core::Fault;

/// Minimum time constant of the current in s.
const SHORTEST_TIME: f64 = 1e-7;

/// Refuses parameters that contradict each other.
///
/// # Errors
/// Names the parameter, its value, and what is allowed.
pub fn validate(parameters: &PlantParameters) -> Result<(), Fault> {
    check_map(parameters)?;
    check_time_constant(parameters)?;
    check_dead_time(parameters)?;
    check_switched(parameters)?;
    check_network(parameters)
}

/// Refuses currents that settle so quickly that no machine can have them: a second would take millions of integration steps.
fn check_time_constant(par: &PlantParameters) -> Result<(), Fault> {
    let most = par.least_inductance() / SHORTEST_TIME;
    if par.motor.R_s > most {
        let allowed = format!(
            "at most {most:.4} Ohm with {} and {}: a time constant L/R of 0.1 us; check the units",
            PARAMETERS.tell(par, |p| &mut p.motor.L_d),
            PARAMETERS.tell(par, |p| &mut p.motor.L_q)
        );
        return Err(PARAMETERS.fault(par, |p| &mut p.motor.R_s, allowed));
    }
    Ok(())
}

/// Refuses a dead time that leaves no pulse: a leg switches twice in a period.
fn check_dead_time(par: &PlantParameters) -> Result<(), Fault> {
    if 2.0 * par.inverter.dead_time > par.inverter.T_pwm {
        let allowed = format!("at most half of {}", PARAMETERS.tell(par, |p| &mut p.inverter.T_pwm));
        return Err(PARAMETERS.fault(par, |p| &mut p.inverter.dead_time, allowed));
    }
    Ok(())
}

/// Refuses what the switched inverter does not model.
fn check_switched(par: &PlantParameters) -> Result<(), Fault> {
    if !par.is_switched() {
        return Ok(());
    }
    if 2.0 * par.inverter.pwm.pulse_min > par.inverter.T_pwm {
        let allowed = format!("at most half of {}", PARAMETERS.tell(par, |p| &mut p.inverter.T_pwm));
        return Err(PARAMETERS.fault(par, |p| &mut p.inverter.pwm.pulse_min, allowed));
    }
    if 2.0 * par.inverter.pwm.carrier_delay > par.inverter.T_pwm {
        let allowed = format!("at most half of {}", PARAMETERS.tell(par, |p| &mut p.inverter.T_pwm));
        return Err(PARAMETERS.fault(par, |p| &mut p.inverter.pwm.carrier_delay, allowed));
    }
    if !par.iron.is_none() {
        let allowed = format!(
            "1 (Average) with iron loss ({}, {}): under switched voltages, its conductance would also draw the PWM frequency",
            PARAMETERS.tell(par, |p| &mut p.iron.G_e),
            PARAMETERS.tell(par, |p| &mut p.iron.G_h)
        );
        return Err(PARAMETERS.fault(par, |p| &mut p.inverter.pwm.mode, allowed));
    }
    Ok(())
}

/// Refuses an active map that is physically impossible: a limit of the grid with the wrong sign, saturation parameters in
/// addition to the map, a current without flux linkage, or a knot at which the Hessian is not positive definite.
fn check_map(parameters: &PlantParameters) -> Result<(), Fault> {
    let map = &parameters.flux_map;
    if !map.used {
        return Ok(());
    }
    let (positive, negative) = ("greater than 0 with flux_map.use = true", "less than 0 with flux_map.use = true");
    if map.d_min >= 0.0 {
        return Err(PARAMETERS.fault(parameters, |p| &mut p.flux_map.d_min, negative));
    }
    if map.d_max <= 0.0 {
        return Err(PARAMETERS.fault(parameters, |p| &mut p.flux_map.d_max, positive));
    }
    if map.q_max <= 0.0 {
        return Err(PARAMETERS.fault(parameters, |p| &mut p.flux_map.q_max, positive));
    }
    if !parameters.saturation.is_none() {
        let allowed =
            "false with saturation.s_2, saturation.s_3 or saturation.s_dq: the map has the saturation; set these to 0";
        return Err(PARAMETERS.fault(parameters, |p| &mut p.flux_map.used, allowed));
    }
    if let Some(x) = map.flaw() {
        return Err(Fault::new(format!(
            "flux_map.w describes no machine: at psi_d = psi_M {:+.4} Wb, psi_q = {:.4} Wb, more flux needs less current; fit the map \
             with fmu tune",
            x.d(),
            x.q()
        )));
    }
    let (rest, scale) = (map.current(Dq::ZERO).d(), map.current(Dq::new(map.d_max, 0.0)).d());
    if rest.abs() > 1e-6 * scale.abs() {
        return Err(Fault::new(format!(
            "flux_map.w gives a current of {rest} A at the flux linkage psi_M, where it must be 0; fit the map with fmu tune"
        )));
    }
    Ok(())
}

/// Refuses a network without heat capacities.
fn check_network(par: &PlantParameters) -> Result<(), Fault> {
    if par.thermal.mode != ThermalMode::Network {
        return Ok(());
    }
    let capacities: [Get; 4] = [
        |p| &mut p.thermal.network.C_winding,
        |p| &mut p.thermal.network.C_stator,
        |p| &mut p.thermal.network.C_rotor,
        |p| &mut p.thermal.network.C_inverter,
    ];
    for get in capacities {
        if *get(&mut par.clone()) <= 0.0 {
            let mode = PARAMETERS.tell(par, |p| &mut p.thermal.mode);
            let allowed = format!("greater than 0 with {mode}; set the heat capacity, or thermal.mode = 1 (Constant)");
            return Err(PARAMETERS.fault(par, get, allowed));
        }
    }
    Ok(())
}

/// Refuses temperatures at which the machine has no resistance or no magnet; `names`: the temperatures of winding and magnets.
///
/// # Errors
/// Names the temperature, its effect and the remedy.
#[inline]
pub fn check_temperatures(
    par: &PlantParameters,
    at: &Temperatures,
    names: [&str; 2],
    remedy: &str,
) -> Result<(), Fault> {
    let Motor { R_s, psi_M, .. } = par.thermal.motor(&par.motor, at);
    let works = |x: f64| x > 0.0 && x.is_finite();
    if !works(R_s) {
        let effect = format!("resistance {R_s} Ohm");
        return Err(refused(par, (names[0], at.winding), |p| &mut p.thermal.alpha_R, &effect, remedy));
    }
    if !works(psi_M) {
        let effect = format!("permanent-magnet flux linkage {psi_M} Wb");
        return Err(refused(par, (names[1], at.magnet), |p| &mut p.thermal.alpha_psi, &effect, remedy));
    }
    Ok(())
}

type Get = fn(&mut PlantParameters) -> &mut f64;

#[cold]
fn refused(par: &PlantParameters, (name, T): (&str, f64), alpha: Get, effect: &str, remedy: &str) -> Fault {
    let [alpha, T_ref] = [PARAMETERS.tell(par, alpha), PARAMETERS.tell(par, |p| &mut p.thermal.T_ref)];
    Fault::new(format!(
        "{name} = {T} K with {alpha} and {T_ref} makes the {effect}, which must be greater than 0: {remedy}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flux_map::{self, D, FluxMap, Q};

    #[test]
    fn a_dead_time_longer_than_half_a_period_is_refused() {
        let with = |dead_time| {
            let mut parameters = PlantParameters::default();
            parameters.inverter.dead_time = dead_time;
            validate(&parameters).map_err(|fault| fault.message().to_owned())
        };
        assert_eq!(with(5e-5), Ok(()));
        let expected = "inverter.dead_time = 2 s is not allowed: at most half of inverter.T_pwm = 0.0001 s";
        assert_eq!(with(2.0).unwrap_err(), expected);
    }

    #[expect(clippy::cast_precision_loss, reason = "a few intervals")]
    #[test]
    fn a_map_of_no_machine_is_refused() {
        let with = |map: FluxMap| {
            let parameters = PlantParameters { flux_map: map, ..PlantParameters::default() };
            check_map(&parameters).map_err(|fault| fault.message().to_owned())
        };
        let linear = || flux_map::linear(&Motor::default(), [-0.2, 0.2], 0.2);
        assert_eq!(with(linear()), Ok(()));
        assert_eq!(with(FluxMap { used: false, d_max: -1.0, ..linear() }), Ok(()));
        let mut hollow = linear();
        hollow.w[6][3] += 1.0;
        let mut shifted = linear();
        shifted.w.iter_mut().enumerate().for_each(|(m, row)| row.iter_mut().for_each(|w| *w += 0.01 * m as f64));
        for (map, message) in [
            (FluxMap { d_min: 0.0, ..linear() }, "flux_map.d_min = 0 Wb is not allowed: less than 0"),
            (FluxMap { d_max: -0.1, ..linear() }, "flux_map.d_max = -0.1 Wb is not allowed: greater than 0"),
            (FluxMap { q_max: 0.0, ..linear() }, "flux_map.q_max = 0 Wb is not allowed: greater than 0"),
            (FluxMap { w: [[0.0; Q]; D], ..linear() }, "flux_map.w describes no machine: at psi_d = psi_M -0.2000 Wb"),
            (hollow, "more flux needs less current; fit the map with fmu tune"),
            (shifted, "where it must be 0"),
        ] {
            let error = with(map).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
        let mut parameters = PlantParameters { flux_map: linear(), ..PlantParameters::default() };
        parameters.saturation.s_2 = 1.0;
        let error = check_map(&parameters).unwrap_err();
        assert!(
            error.message().starts_with("flux_map.use = true is not allowed: false with saturation.s_2"),
            "{error}"
        );
    }
}
