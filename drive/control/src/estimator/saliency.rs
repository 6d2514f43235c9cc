//! Shared parts of the injection estimators: the machine's high-frequency admittance and the parameter checks.
//!
//! In stator axes, with u and i as complex numbers, di/dt = S u + D e^{j 2 theta} conj(u), where S = (1/L_d + 1/L_q) /
//! 2 and D = (1/L_d - 1/L_q) / 2. Only the D term contains the angle, and it contains 2 theta. Injection therefore
//! cannot identify the magnet polarity; the controller's start by injection does. Limits of all injection methods:
//! the machine must be salient, and cross-saturation shifts the axis of the inductances itself, by -9 to -21 deg at
//! rated load.
//!
//! Kim & Sul 2011, eq (33) to (37), inverted: the paper gives the voltage as a function of the current. S and D in 1/H.

use crate::estimator::contract::{Sample, SetupOf};
use drive_base::frame::{Axis, DqHat, Estimated};
use drive_base::motor::Motor;
use fmu_core::Fault;

/// Largest angle error in rad that is passed to a tracker.
pub const CLIP: f64 = 0.5;

/// Smallest |L_q - L_d| / (L_q + L_d): below it, the noise of the current sensors hides the saliency.
const MIN_SALIENCY: f64 = 0.01;

/// The high-frequency admittance in 1/H.
#[derive(Clone, Copy, Debug)]
pub struct Admittance {
    /// S, equal in all directions.
    pub sum: f64,
    /// D, from the saliency; it has the sign of L_q - L_d.
    pub difference: f64,
}

impl Admittance {
    /// From the machine estimates.
    #[inline]
    pub fn of(motor: &Motor) -> Self {
        let (d, q) = (1.0 / motor.L_d, 1.0 / motor.L_q);
        Self { sum: 0.5 * (d + q), difference: 0.5 * (d - q) }
    }
}

/// Response to the injected voltage in [k - 1, k): the change of the current (A) minus the known shares of the current
/// controller's voltage and of R i. The slowly varying back EMF remains in it. Without the first subtraction, noise
/// feeds back through the current controller into the angle. Without the second, a carrier that turns at w_h in stator
/// axes lags and the angle error is R S / w_h. The result is in the estimated frame at `middle`, its angle in the
/// middle of the interval.
#[inline]
pub fn response(motor: &Motor, middle: Axis<Estimated>, sample: &Sample, T_s: f64) -> DqHat {
    let i = middle.from_stator(sample.i - sample.i_last);
    let resistive = (sample.i + sample.i_last) * (0.5 * motor.R_s);
    let psi = middle.from_stator((sample.u - sample.u_injected - resistive) * T_s);
    DqHat::new(i.d() - psi.d() / motor.L_d, i.q() - psi.q() / motor.L_q)
}

/// Checks that injection can find the machine's axis.
///
/// # Errors
/// The two inductances are too close to each other.
pub fn validate<All>(setup: &SetupOf<All>) -> Result<(), Fault> {
    let Motor { L_d, L_q, .. } = setup.motor;
    if (L_q - L_d).abs() < MIN_SALIENCY * (L_q + L_d) {
        return Err(Fault::new(format!(
            "{} and {}: an estimator by injection needs inductances that differ by more than {} % of their sum, since \
             it finds the angle by their difference",
            setup.tell("motor.L_d"),
            setup.tell("motor.L_q"),
            100.0 * MIN_SALIENCY
        )));
    }
    Ok(())
}
