//! When the controller's parameters and inputs act: a value that is set without effect is reported by name.
//!
//! Every parameter and every input is here once; `no_variable_is_forgotten` looks. Options that an estimator does not support are
//! refused ([`options`](crate::estimator)), and count as acting.

use crate::commissioning::CommissionMode;
use crate::estimator::{Class, Kind};
use crate::position::PositionSensor;
use crate::sensor::MeasuredPhases;
use crate::start::StartMode;
use crate::tables::ControllerParameters as Par;
use fmu_core::idle::Acts;

/// Whether the estimator in use, or the one for a lost sensor, is one `of` these.
fn reads(par: &Par, of: impl Fn(Kind) -> bool) -> bool {
    of(par.estimator) || par.has_fallback() && of(par.fallback)
}

fn is(par: &Par, kinds: &[Kind]) -> bool {
    reads(par, |kind| kinds.contains(&kind))
}

/// The controller's.
#[rustfmt::skip]
pub const ACTS: &[Acts<Par>] = &[
    Acts { names: &[
        "T_s", "timing.delay", "estimator", "motor.n_p", "motor.R_s", "motor.L_d", "motor.L_q", "motor.psi_M", "mechanics.J",
        "initial.theta_est", "initial.speed_est", "limit.i_q", "limit.i", "limit.tau", "limit.i_dc_use", "limit.tau_use",
        "zero_speed.by_need", "brake.tau", "brake.hold", "speed_loop.torque_mode",
        "current.bandwidth", "current.active_resistance", "current.integral", "current.reference_feed_forward", "current.mtpa",
        "weakening.use", "modulation.mode", "start.mode", "start.catch", "lock.u", "lock.angle", "lock.time", "trip.use", "sensor.gain_a",
        "sensor.offset_a", "sensor.noise", "sensor.resolution", "sensor.phases",
        "compensation.u_dead", "compensation.calibrate", "commission.mode", "adaptation.k_a",
        "adaptation.tracking", "flux_observer.magnet", "tracker.kind", "emf.frame_term", "emf.hold_reversal", "matsui.integral",
        "pulsating.demodulation", "gradient.clamped",
        "enable", "asc", "brake", "coast", "i_a", "i_b", "i_c", "u_dc",
    ], when: |_| true, why: "" },
    Acts { names: &["tau_ref"], when: |p| p.speed_loop.torque_mode, why: "no effect without speed_loop.torque_mode" },
    Acts { names: &["speed_ref", "speed_loop.bandwidth", "speed_loop.t_is", "speed_loop.b", "speed_loop.ramp"],
        when: |p| !p.speed_loop.torque_mode, why: "no effect with speed_loop.torque_mode" },
    Acts { names: &["limit.speed_use"], when: |p| p.speed_loop.torque_mode, why: "no effect without speed_loop.torque_mode" },
    Acts { names: &["limit.speed_max", "limit.speed_min"], when: |p| p.modes.speed.used && p.speed_loop.torque_mode,
        why: "no effect without limit.speed_use and speed_loop.torque_mode" },
    Acts { names: &["tau_limit_max", "tau_limit_min"], when: |p| p.modes.tau_used, why: "no effect without limit.tau_use" },
    Acts { names: &["limit.i_dc_max", "limit.i_dc_min"], when: |p| p.dc.used, why: "no effect without limit.i_dc_use" },
    Acts { names: &["zero_speed.i_0", "zero_speed.w_0"], when: |p| reads(p, |kind| kind.class() == Class::FluxObserver),
        why: "no effect with this estimator; Rasmussen and FluxObserver have the low-speed law" },
    Acts { names: &["zero_speed.release"], when: |p| p.speed_loop.torque_mode && reads(p, |kind| kind.class() == Class::FluxObserver),
        why: "no effect without speed_loop.torque_mode and an estimator with the low-speed law, Rasmussen or FluxObserver" },
    Acts { names: &["weakening.k_u", "weakening.k_t", "weakening.bandwidth"], when: |p| p.weakening.used,
        why: "no effect without weakening.use" },
    Acts { names: &["start.i", "start.t_align", "start.acceleration", "start.speed", "start.settle"],
        when: |p| p.start.mode == StartMode::CurrentFrequency, why: "no effect unless start.mode = CurrentFrequency" },
    Acts { names: &["polarity.t_find", "polarity.voltage", "polarity.samples", "saturation.s_2"],
        when: |p| p.start.mode == StartMode::Injection, why: "no effect unless start.mode = Injection" },
    Acts { names: &["trip.i", "trip.u_dc", "trip.u_dc_min", "trip.u_dc_restart", "trip.asc"], when: |p| p.trip.used, why: "no effect without trip.use" },
    Acts { names: &["sensor.gain_b", "sensor.offset_b"], when: |p| p.sensor.phases != MeasuredPhases::One,
        why: "no effect with sensor.phases = One" },
    Acts { names: &["sensor.gain_c", "sensor.offset_c"], when: |p| p.sensor.phases == MeasuredPhases::Three,
        why: "no effect unless sensor.phases = Three" },
    Acts { names: &["sensor.window"], when: |p| p.sensor.phases == MeasuredPhases::One, why: "no effect unless sensor.phases = One" },
    Acts { names: &["sensor.seed"], when: |p| p.sensor.noise > 0.0, why: "no effect without sensor.noise" },
    Acts { names: &["sensor.fallback", "theta_meas", "speed_meas"], when: |p| p.estimator == Kind::Sensored,
        why: "no effect unless estimator = Sensored" },
    Acts { names: &["sensor.position", "sensor.angle_offset"], when: |p| p.estimator == Kind::Sensored,
        why: "no effect unless estimator = Sensored" },
    Acts { names: &["sensor.counts"], when: |p| p.senses(PositionSensor::Encoder),
        why: "no effect unless estimator = Sensored and sensor.position = Encoder" },
    Acts { names: &["sensor.bandwidth"], when: |p| p.estimator == Kind::Sensored && p.position.tracks(),
        why: "no effect unless estimator = Sensored and sensor.position = Encoder or Resolver" },
    Acts { names: &["sensor.hall_b", "sensor.hall_c"], when: |p| p.senses(PositionSensor::Hall),
        why: "no effect unless estimator = Sensored and sensor.position = Hall" },
    Acts { names: &["sensor.cos_gain", "sensor.quadrature", "sensor.bits"], when: |p| p.senses(PositionSensor::Resolver),
        why: "no effect unless estimator = Sensored and sensor.position = Resolver" },
    Acts { names: &["sensor.resume"], when: Par::has_fallback,
        why: "no effect unless estimator = Sensored and sensor.fallback is another one" },
    Acts { names: &["sensor_valid"], when: Par::has_fallback, why: "no effect unless estimator = Sensored and sensor.fallback is another one" },
    Acts { names: &["compensation.i_zero", "compensation.observe"], when: |p| p.compensation.u_dead > 0.0,
        why: "no effect without compensation.u_dead" },
    Acts { names: &["commission_start", "commission.i", "commission.speed", "commission.t_max", "commission.update"],
        when: |p| p.commission.mode != CommissionMode::Off, why: "no effect with commission.mode = Off" },
    Acts { names: &["rasmussen.c_1", "rasmussen.c_2", "rasmussen.w_n", "rasmussen.zeta"], when: |p| is(p, &[Kind::Rasmussen]),
        why: "no effect unless estimator = Rasmussen" },
    Acts { names: &["adaptation.resistance"], when: |p| reads(p, |kind| kind != Kind::Sensored), why: "no effect with a sensor" },
    Acts { names: &["adaptation.bandwidth", "adaptation.i", "adaptation.start", "adaptation.min", "adaptation.max", "adaptation.k_c",
        "adaptation.flux"], when: |p| p.estimators.adaptation.resistance, why: "no effect without adaptation.resistance" },
    Acts { names: &["flux_observer.k_w"], when: |p| is(p, &[Kind::FluxObserver]), why: "no effect unless estimator = FluxObserver" },
    Acts { names: &["tracker.bandwidth"],
        when: |p| reads(p, |kind| !matches!(kind, Kind::Rasmussen | Kind::VoltageModel | Kind::CurrentModel | Kind::Sensored | Kind::KalmanFilter)),
        why: "no effect with this estimator, which has no tracker" },
    Acts { names: &["emf.bandwidth", "emf.w_sign"],
        when: |p| reads(p, |kind| !matches!(kind, Kind::Rasmussen | Kind::FluxObserver | Kind::Sensored | Kind::KalmanFilter)),
        why: "no effect with this estimator, which does not read the back EMF" },
    Acts { names: &["emf.w_hold"], when: |p| p.estimators.emf.hold_reversal, why: "no effect without emf.hold_reversal" },
    Acts { names: &["matsui.bandwidth", "matsui.filter"], when: |p| is(p, &[Kind::VoltageModel, Kind::CurrentModel]),
        why: "no effect unless estimator = VoltageModel or CurrentModel" },
    Acts { names: &["kalman.voltage_d", "kalman.voltage_q", "kalman.acceleration", "kalman.current"],
        when: |p| is(p, &[Kind::KalmanFilter]), why: "no effect unless estimator = KalmanFilter" },
    Acts { names: &["gradient.bandwidth"], when: |p| is(p, &[Kind::GradientObserver]), why: "no effect unless estimator = GradientObserver" },
    Acts { names: &["sliding_mode.gain", "sliding_mode.bandwidth"], when: |p| is(p, &[Kind::SlidingMode]),
        why: "no effect unless estimator = SlidingMode" },
    Acts { names: &["carrier.voltage", "carrier.frequency", "carrier.zeta"],
        when: |p| is(p, &[Kind::RotatingInjection, Kind::PulsatingInjection]),
        why: "no effect unless estimator = RotatingInjection or PulsatingInjection" },
    Acts { names: &["square_wave.voltage", "square_wave.samples"], when: |p| is(p, &[Kind::SquareWaveInjection, Kind::Hybrid]),
        why: "no effect unless estimator = SquareWaveInjection or Hybrid" },
    Acts { names: &["near_pwm.voltage"], when: |p| is(p, &[Kind::NearPwmInjection]), why: "no effect unless estimator = NearPwmInjection" },
    Acts { names: &["hybrid.w_low", "hybrid.w_high", "hybrid.bandwidth"], when: |p| is(p, &[Kind::Hybrid]),
        why: "no effect unless estimator = Hybrid" },
];

/// Said of a link without voltage.
pub const NO_VOLTAGE: &str = "the DC link has no voltage, and no torque follows: feed u_dc";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SensorlessController;
    use fmu_core::Model;
    use fmu_core::idle::unstated;

    #[test]
    fn no_variable_is_forgotten() {
        let missing = unstated(ACTS, SensorlessController::TABLE);
        assert!(missing.is_empty(), "{missing:?} must be in ACTS once");
    }

    /// Which of these the drive uses.
    fn acting(par: &Par) -> [bool; 4] {
        ["sensor.counts", "sensor.hall_b", "sensor.bits", "sensor.bandwidth"]
            .map(|name| ACTS.iter().any(|acts| acts.names.contains(&name) && (acts.when)(par)))
    }

    #[test]
    fn each_position_sensor_has_its_parameters() {
        use PositionSensor::{Encoder, Hall, Ideal, Resolver};
        let mut par = Par::default();
        for (kind, own) in [
            (Ideal, [false; 4]),
            (Encoder, [true, false, false, true]),
            (Hall, [false, true, false, false]),
            (Resolver, [false, false, true, true]),
        ] {
            par.position.kind = kind;
            par.estimator = Kind::Sensored;
            assert_eq!(acting(&par), own, "{kind:?}");
            par.estimator = Kind::FluxObserver;
            assert_eq!(acting(&par), [false; 4], "{kind:?} without a sensor in use");
        }
    }
}
