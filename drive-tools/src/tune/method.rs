//! The rules of each estimator. The list of estimators is in `drive-control`; one without rules here does not compile.

use super::bandwidth::Bandwidths;
use super::motor::{Data, MotorFile, electrical};
use super::setting::{Setting, Value, real};
use super::{back_emf, flux_observer, injection, loops, rasmussen};
use crate::error::{Result, bail};
use drive::control::reference::max_torque_per_ampere;
use drive::control::weakening::WeakeningParameters;
use drive::estimator::Kind;

/// The values of the controller that depend on the `estimator`.
///
/// # Errors
/// The machine does not suit it: why, with numbers.
pub fn settings(
    motor: &MotorFile,
    estimator: Kind,
    bandwidths: &Bandwidths,
    notes: &mut Vec<String>,
) -> Result<Vec<Setting>> {
    let data = &motor.data;
    let by_emf = |active, own: Vec<Setting>, notes: &mut Vec<String>| {
        back_emf::narrow(data, bandwidths, notes);
        let mut all = loops::settings(data, active);
        all.push(loops::limit(data));
        all.extend(own);
        all.extend(loops::start(data, handed_over(data), false, notes));
        Ok(all)
    };
    match estimator {
        Kind::Rasmussen => rasmussen::settings(motor, bandwidths, notes),
        Kind::FluxObserver => flux_observer::settings(motor, bandwidths),
        Kind::DirectEmf | Kind::EmfObserver | Kind::ExtendedEmf => {
            by_emf(true, back_emf::observer(data, bandwidths), notes)
        }
        Kind::SlidingMode => by_emf(true, back_emf::sliding_mode(data, bandwidths), notes),
        Kind::VoltageFeedback => by_emf(false, back_emf::voltage_feedback(data, bandwidths), notes),
        Kind::VoltageModel | Kind::CurrentModel => by_emf(true, back_emf::model(motor, estimator, bandwidths)?, notes),
        Kind::KalmanFilter => by_emf(true, back_emf::kalman(data, bandwidths), notes),
        Kind::GradientObserver => by_emf(true, back_emf::gradient(data, bandwidths), notes),
        Kind::RotatingInjection => injection::settings(motor, bandwidths, (injection::rotating, true), notes),
        Kind::PulsatingInjection => injection::settings(motor, bandwidths, (injection::pulsating, true), notes),
        Kind::SquareWaveInjection => injection::settings(motor, bandwidths, (injection::square_wave, false), notes),
        Kind::NearPwmInjection => injection::settings(motor, bandwidths, (injection::near_pwm, false), notes),
        Kind::Hybrid => injection::hybrid(motor, bandwidths, notes),
        Kind::Sensored => Ok(loops::sensored(data)),
    }
}

/// Share of u_dc / sqrt(3) that the references may use with field weakening.
pub fn voltage_share(estimator: Kind) -> f64 {
    match estimator {
        Kind::VoltageFeedback => 0.9,
        _ => WeakeningParameters::default().k_u,
    }
}

/// Changes to an estimator's values for field weakening.
///
/// # Errors
/// The estimator cannot carry the rated torque in that case.
pub fn weaken(
    motor: &MotorFile,
    estimator: Kind,
    controller: &mut Vec<Setting>,
    notes: &mut Vec<String>,
) -> Result<()> {
    let (rating, machine) = (&motor.data.rating, electrical(&motor.data));
    match estimator {
        Kind::VoltageFeedback => {
            let rule = "a saturated hexagon would look like an angle error";
            controller
                .extend(["weakening.k_u", "weakening.k_t"].map(|name| real(name, voltage_share(estimator), rule)));
        }
        Kind::VoltageModel => {
            let (most, limit) = (LEAST_FLUX * machine.psi_M / machine.L_d, *rating.current.get_ref());
            let needed = max_torque_per_ampere(&machine, *rating.torque.get_ref()).magnitude();
            if needed > most {
                bail!(
                    "{}: VoltageModel divides by psi_M + L_d i_d: with field weakening, limit.i may be at most 0.7 psi_M / \
                    L_d = {most:.2} A, and rating.torque needs {needed:.2} A: choose CurrentModel or another estimator",
                    motor.place(&rating.torque)
                );
            }
            if most < limit {
                notes.push(format!(
                    "limit.i is 0.7 psi_M / L_d = {most:.2} A, not {limit} A: VoltageModel divides by psi_M + L_d i_d"
                ));
                for setting in controller.iter_mut().filter(|s| ["limit.i", "limit.i_q", "start.i"].contains(&s.name)) {
                    if let Value::Real(x) = &mut setting.value
                        && *x > most
                    {
                        *x = most;
                        setting.rule = "0.7 psi_M / L_d: VoltageModel with field weakening".into();
                    }
                }
            }
        }
        _ => {}
    }
    Ok(())
}

/// Minimum psi_M + L_d i_d of VoltageModel, as a share of psi_M below 1.
const LEAST_FLUX: f64 = 0.7;

/// Speed in rad/s at which an EMF method takes over from the I-f start.
fn handed_over(data: &Data) -> (f64, &'static str) {
    (0.15 * data.rating.speed.get_ref(), "0.15 of the rated speed")
}

/// The highest speed in pu of a method that does not reach rated speed.
///
/// # Errors
/// Those of [`settings`].
pub fn highest(motor: &MotorFile, estimator: Kind, bandwidths: &Bandwidths) -> Result<Option<f64>> {
    let of =
        |carrier: fn(&injection::View) -> injection::Injected| injection::highest(motor, bandwidths, carrier).map(Some);
    match estimator {
        Kind::RotatingInjection => of(injection::rotating),
        Kind::PulsatingInjection => of(injection::pulsating),
        Kind::SquareWaveInjection => of(injection::square_wave),
        Kind::NearPwmInjection => of(injection::near_pwm),
        _ => Ok(None),
    }
}
