//! Checks of parameters that belong to several parts of the controller: each part checks only its own values.

use crate::battery::DcLimits;
use crate::commission::CommissionMode;
use crate::current::{COLD, CurrentGains};
use crate::estimator::{Class, Kind};
use crate::position;
use crate::reference::max_torque;
use crate::sensor::MeasuredPhases;
use crate::tables::{ControllerParameters, PARAMETERS};
use crate::weakening::{INVERSE_SQRT_3, WeakeningGains};
use drive_base::math::sin_cos;
use fmu_core::Fault;
use std::f64::consts::PI;

/// Minimum torque per ampere of i_q, as a share of the magnet's.
const LEAST_TORQUE: f64 = 0.2;

/// Maximum w_c T_s as a share of the gain at which a loop without resistance oscillates: 2 pi 0.06 with one sample of delay.
const GREATEST_GAIN: f64 = 0.12 * PI;

/// Checks that the sample period is short enough for the bandwidth.
///
/// A sampled integrator with d samples of delay oscillates at the gain w_c T_s = 2 sin(pi / (4 d + 2)): 2, 1 and 0.618 for d
/// = 0, 1 and 2. With active resistance, which doubles the gain, it does at 2, 0.456 and 0.268.
///
/// # Errors
/// The loop would oscillate, or nearly so.
pub(crate) fn current(par: &ControllerParameters) -> Result<(), Fault> {
    let critical = 2.0 * sin_cos(PI / f64::from(4 * par.delay + 2)).0;
    let most = GREATEST_GAIN * critical / par.T_s;
    if par.current.bandwidth <= most * (1.0 + 1e-9) {
        return Ok(());
    }
    let table = PARAMETERS;
    let allowed = format!(
        "at most {most:.4} rad/s (2 pi {:.3} / T_s) with {} and {}, or the current oscillates; lower it or T_s",
        0.06 * critical,
        table.tell(par, |p| &mut p.T_s),
        table.tell(par, |p| &mut p.delay)
    );
    Err(table.fault(par, |p| &mut p.current.bandwidth, allowed))
}

/// Minimum difference of the peaks, computed from the controller's estimates, in units of x / L_d.
const MIN_DIFFERENCE: f64 = 0.02;

/// Checks that the pulses distinguish the poles, given the estimated saturation coefficient, and stay within the
/// current limit.
///
/// # Errors
/// States which parameters do not fit.
pub(crate) fn polarity(par: &ControllerParameters) -> Result<(), Fault> {
    let x = par.polarity.voltage * par.T_s * f64::from(par.polarity.samples);
    let (linear, saturated) = (x / par.motor.L_d, par.s_2 * x * x);
    let pulses = || {
        let voltage = PARAMETERS.tell(par, |p| &mut p.polarity.voltage);
        let samples = PARAMETERS.tell(par, |p| &mut p.polarity.samples);
        format!("{voltage} for {samples} of {}", PARAMETERS.tell(par, |p| &mut p.T_s))
    };
    if 2.0 * saturated.abs() < MIN_DIFFERENCE * linear {
        return Err(Fault::new(format!(
            "{}: {} make peaks of {linear} A that differ by {} A only; the ends of the magnet differ by saturation \
             alone, and the start by injection needs {} A",
            PARAMETERS.tell(par, |p| &mut p.s_2),
            pulses(),
            2.0 * saturated.abs(),
            MIN_DIFFERENCE * linear
        )));
    }
    if linear + saturated.abs() > par.limit.i {
        let peak = linear + saturated.abs();
        let limit = PARAMETERS.tell(par, |p| &mut p.limit.i);
        return Err(Fault::new(format!("{} make a current of {peak} A, above {limit}", pulses())));
    }
    Ok(())
}

/// Checks that field weakening can work with the other parameters, on a DC link of `u_dc` (V).
///
/// # Errors
/// States the incompatible parameters and a remedy.
pub(crate) fn weakening(par: &ControllerParameters, u_dc: f64) -> Result<(), Fault> {
    let ControllerParameters { weakening: own, motor, limit, estimator, .. } = par;
    if !own.used {
        return Ok(());
    }
    let table = PARAMETERS;
    let estimator_is = table.tell(par, |p| &mut p.estimator);
    let limit_is = table.tell(par, |p| &mut p.limit.i);
    let use_is = table.tell(par, |p| &mut p.weakening.used);
    if own.k_t < own.k_u {
        let least = table.tell(par, |p| &mut p.weakening.k_u);
        return Err(table.fault(par, |p| &mut p.weakening.k_t, format!("at least {least}")));
    }
    if *estimator == Kind::Hybrid && u_dc > 0.0 {
        // Above this speed the references may need field weakening; an injection leaves them less voltage.
        let mtpa = par.current.mtpa;
        let gains = WeakeningGains::new(
            motor,
            limit,
            max_torque(motor, limit, mtpa),
            mtpa,
            par.modulation.mode.reach(),
            par.least_tracker(),
        );
        let onset = gains.onset(own.k_u * gains.highest(u_dc) - par.estimators.square_wave.voltage);
        if par.estimators.hybrid.w_high > onset {
            let injected = table.tell(par, |p| &mut p.estimators.square_wave.voltage);
            let allowed = format!(
                "at most {onset:.4} rad/s, where field weakening begins with {use_is}, {injected} and a DC link of {u_dc} V; \
                 lower it or the injected voltage, or raise the DC link's"
            );
            return Err(table.fault(par, |p| &mut p.estimators.hybrid.w_high, allowed));
        }
    }
    if *estimator == Kind::VoltageFeedback && (own.k_u > 0.9 || own.k_t > own.k_u) {
        return Err(Fault::new(format!(
            "{} and {} with {estimator_is}, which mistakes a saturated hexagon for an angle error: set both to the same \
             value, at most 0.9",
            table.tell(par, |p| &mut p.weakening.k_u),
            table.tell(par, |p| &mut p.weakening.k_t)
        )));
    }
    let most = 0.7 * motor.psi_M / motor.L_d;
    if *estimator == Kind::VoltageModel && limit.i > most {
        return Err(Fault::new(format!(
            "{limit_is} with {estimator_is} and {use_is}: the estimator's gain has no bound near the current -psi_M / L_d; at \
             most {most:.4} A (0.7 psi_M / L_d), or another estimator"
        )));
    }
    let most = (1.0 - LEAST_TORQUE) * motor.psi_M / (motor.L_d - motor.L_q);
    if motor.L_q < motor.L_d && limit.i > most {
        return Err(Fault::new(format!(
            "{limit_is} with {use_is} and L_q < L_d: the torque of i_q vanishes at the current -psi_M / (L_d - L_q); at most \
             {most:.4} A (0.8 psi_M / (L_d - L_q))"
        )));
    }
    Ok(())
}

/// Maximum current of a flying start in units of `limit.i`.
const CAUGHT: f64 = 1.1;

/// Checks that a short circuit of one sample stays within the current limit at any speed at which the diodes do not conduct, on a DC
/// link of `u_dc` (V) at the start, or 0 later.
///
/// # Errors
/// The sample period is too long for a flying start.
pub(crate) fn catch(par: &ControllerParameters, u_dc: f64) -> Result<(), Fault> {
    let L = par.motor.L_d.min(par.motor.L_q);
    let i = u_dc * INVERSE_SQRT_3 * par.T_s / L;
    if !par.start.catch || par.estimator == Kind::Sensored || i <= CAUGHT * par.limit.i {
        return Ok(());
    }
    let table = PARAMETERS;
    Err(Fault::new(format!(
        "{}: a short circuit of one sample, {}, may reach {i:.3} A with an EMF of u_dc / sqrt(3), u_dc = {u_dc} V; at most {CAUGHT} times {}: \
         shorten T_s",
        table.tell(par, |p| &mut p.start.catch),
        table.tell(par, |p| &mut p.T_s),
        table.tell(par, |p| &mut p.limit.i)
    )))
}

/// Checks that the tracking loop of the position sensor is stable.
///
/// # Errors
/// Its pole is too fast for the sample period.
pub(crate) fn position(par: &ControllerParameters) -> Result<(), Fault> {
    let most = position::FASTEST / par.T_s;
    if par.estimator != Kind::Sensored || !par.position.tracks() || par.position.bandwidth <= most {
        return Ok(());
    }
    let (kind, T_s) = (PARAMETERS.tell(par, |p| &mut p.position.kind), PARAMETERS.tell(par, |p| &mut p.T_s));
    let allowed = format!("at most {most} rad/s with {kind} and {T_s}: {} / T_s", position::FASTEST);
    Err(PARAMETERS.fault(par, |p| &mut p.position.bandwidth, allowed))
}

/// Checks the limits of the trips, on a DC link of `u_dc` (V) at the start, or 0 later.
///
/// # Errors
/// A trip that normal operation would reach.
pub(crate) fn trip(par: &ControllerParameters, u_dc: f64) -> Result<(), Fault> {
    let (trip, table) = (&par.trip, PARAMETERS);
    if !trip.used {
        return Ok(());
    }
    if trip.i.is_nan() || trip.i <= par.limit.i {
        let limit = table.tell(par, |p| &mut p.limit.i);
        return Err(table.fault(par, |p| &mut p.trip.i, format!("above {limit}, the current limit")));
    }
    if trip.u_dc.is_nan() || trip.u_dc <= u_dc.max(0.0) {
        return Err(table.fault(par, |p| &mut p.trip.u_dc, format!("above u_dc, {u_dc} V at the start")));
    }
    if u_dc > 0.0 && trip.u_dc_min >= u_dc {
        return Err(table.fault(par, |p| &mut p.trip.u_dc_min, format!("below u_dc, {u_dc} V at the start")));
    }
    let restart = trip.u_dc_restart;
    if restart.is_nan() || restart > 0.0 && !(trip.u_dc_min..trip.u_dc).contains(&restart) {
        let (least, most) = (table.tell(par, |p| &mut p.trip.u_dc_min), table.tell(par, |p| &mut p.trip.u_dc));
        let allowed = format!("at least {least} and below {most}; 0: the trip ends when enable falls");
        return Err(table.fault(par, |p| &mut p.trip.u_dc_restart, allowed));
    }
    Ok(())
}

/// Checks that one shunt sees the currents that the drive needs.
///
/// # Errors
/// Self-commissioning, a flying start or a calibration is in use: they need currents without a voltage.
pub(crate) fn shunt(par: &ControllerParameters) -> Result<(), Fault> {
    let needs = [
        (par.commission.mode != CommissionMode::Off, "commission.mode", "Off"),
        (par.start.catch && par.estimator != Kind::Sensored, "start.catch", "false"),
        (par.compensation.calibrate, "compensation.calibrate", "false"),
    ];
    let Some((_, name, allowed)) =
        needs.into_iter().find(|(used, ..)| *used && par.sensor.phases == MeasuredPhases::One)
    else {
        return Ok(());
    };
    let (phases, is) =
        (PARAMETERS.tell(par, |p| &mut p.sensor.phases), PARAMETERS.tell_name(par, name).unwrap_or_default());
    Err(Fault::new(format!(
        "{is} needs currents at 0 V, which {phases} does not see: set {name} = {allowed}, or measure two phases"
    )))
}

/// Checks that the parameters fit together.
///
/// # Errors
/// Names the current and its limit.
pub(crate) fn commissioning(par: &ControllerParameters) -> Result<(), Fault> {
    if par.commission.mode == CommissionMode::Off || par.commission.i <= par.limit.i {
        return Ok(());
    }
    let limit = PARAMETERS.tell(par, |p| &mut p.limit.i);
    Err(PARAMETERS.fault(par, |p| &mut p.commission.i, format!("at most {limit}")))
}

/// Checks the limits, where they are in use.
///
/// # Errors
/// A limit of the wrong sign.
pub(crate) fn dc_limits(par: &ControllerParameters) -> Result<(), Fault> {
    let DcLimits { used, max, min } = par.dc;
    if used && max < 0.0 {
        return Err(PARAMETERS.fault(par, |p| &mut p.dc.max, "at least 0 A: at no speed could the drive keep it"));
    }
    if used && min > 0.0 {
        return Err(PARAMETERS.fault(par, |p| &mut p.dc.min, "at most 0 A: at no speed could the drive keep it"));
    }
    Ok(())
}

impl ControllerParameters {
    /// Checks the bandwidth of the current and the limits of the DC link and of the trips, on a DC link of `u_dc` (V) at the start, or 0
    /// later.
    ///
    /// # Errors
    /// A bandwidth too high for the sample period, a limit of the wrong sign, or a trip that normal operation would reach.
    pub fn validate_limits(&self, u_dc: f64) -> Result<(), Fault> {
        trip(self, u_dc)?;
        current(self)?;
        dc_limits(self)
    }
}

/// Checks that i_q produces torque despite the law's i_d, where the references depend on it.
///
/// # Errors
/// The reluctance torque cancels most of the magnet's torque.
pub(crate) fn zero_speed(par: &ControllerParameters) -> Result<(), Fault> {
    let ControllerParameters { current, weakening, speed_loop, motor, zero_speed, estimator, estimators, .. } = par;
    if zero_speed.by_need && !estimators.adaptation.resistance {
        return Err(Fault::new(format!(
            "{}: needs {}: with a resistance that was not measured, the load turns the frame, and i_q does not show it",
            PARAMETERS.tell(par, |p| &mut p.zero_speed.by_need),
            "adaptation.resistance = true"
        )));
    }
    let by_torque = current.mtpa || weakening.used || speed_loop.torque_mode;
    let share = (motor.L_q - motor.L_d) / motor.psi_M;
    if estimator.class() != Class::FluxObserver || !by_torque || zero_speed.i_0 * share <= 1.0 - LEAST_TORQUE {
        return Ok(());
    }
    let table = PARAMETERS;
    let with = if weakening.used {
        table.tell(par, |p| &mut p.weakening.used)
    } else if current.mtpa {
        table.tell(par, |p| &mut p.current.mtpa)
    } else {
        table.tell(par, |p| &mut p.speed_loop.torque_mode)
    };
    Err(Fault::new(format!(
        "{} with {}, {with} and L_q > L_d: the torque of i_q vanishes at the current psi_M / (L_q - L_d); at most {:.4} A \
         (0.8 psi_M / (L_q - L_d))",
        table.tell(par, |p| &mut p.zero_speed.i_0),
        table.tell(par, |p| &mut p.estimator),
        (1.0 - LEAST_TORQUE) / share
    )))
}

/// Whether the limits lower `zero_speed.i_0` on a link of `u_dc` (V).
pub(crate) fn lowers_i_0(par: &ControllerParameters, u_dc: f64) -> bool {
    par.dc.used && par.estimator.class() == Class::FluxObserver && par.zero_speed.i_0 > par.dc.i_0(&par.motor, u_dc)
}

/// The warning of this.
pub(crate) fn lowered_i_0(par: &ControllerParameters, u_dc: f64) -> String {
    let (i_0, most) = (par.zero_speed.i_0, par.dc.i_0(&par.motor, u_dc));
    let alone = 1.5 * par.motor.R_s * i_0 * i_0 / u_dc;
    format!(
        "{}: {} alone would take 1.5 R_s i_0^2 / u_dc = {alone:.3} A at standstill, more than half of it; i_0 is {most:.3} A, \
         which holds a load of up to {:.3} N.m",
        PARAMETERS.tell(par, |p| &mut p.dc.max),
        PARAMETERS.tell(par, |p| &mut p.zero_speed.i_0),
        par.motor.torque_constant() * most
    )
}

/// A warning about a current loop that subtracts more resistance than a cold winding has.
pub(crate) fn subtracts(par: &ControllerParameters) -> Option<String> {
    let tolerated = CurrentGains::tolerates(&par.current, &par.motor);
    (tolerated < COLD).then(|| {
        format!(
            "{} and {}: the loop oscillates if the resistance of the winding is {:.0} % below that, as in a cold one; set \
             current.active_resistance to false, or raise current.bandwidth",
            PARAMETERS.tell(par, |p| &mut p.current.active_resistance),
            PARAMETERS.tell(par, |p| &mut p.motor.R_s),
            100.0 * tolerated
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The current of a short circuit of one sample, u_dc T_s / (sqrt(3) L), is compared with 1.1 times the limit.
    #[test]
    fn a_flying_start_needs_short_samples() {
        let mut par = ControllerParameters::default();
        par.start.catch = true;
        let longest = 1.1 * par.limit.i * 3.0_f64.sqrt() * par.motor.L_d.min(par.motor.L_q) / 325.0;
        par.T_s = 0.999 * longest;
        assert!(catch(&par, 325.0).is_ok() && catch(&par, 330.0).is_err());
        par.T_s = 1.001 * longest;
        let refused = catch(&par, 325.0).unwrap_err().to_string();
        assert!(refused.contains("start.catch") && refused.contains("shorten T_s"), "{refused}");
        par.start.catch = false;
        assert!(catch(&par, 325.0).is_ok());
    }
}
