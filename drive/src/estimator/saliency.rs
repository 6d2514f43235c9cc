//! What the estimators by injection share: the machine's high-frequency admittance and the checks of their parameters.
//!
//! In stator axes, with u and i as complex numbers, di/dt = S u + D e^{j 2 theta} conj(u), where S = (1/L_d + 1/L_q) / 2
//! and D = (1/L_d - 1/L_q) / 2: the angle is in D only, and as twice itself. So no injection tells the two ends of the
//! magnet apart; [`standstill`](crate::control::standstill) does. Limits, of all of them: saliency is needed, and
//! cross-saturation turns the axis of the inductances itself, by -9 to -21 deg at rated load.

use crate::estimator::{Context, Sample};
use crate::frame::{Axis, DqHat, Estimated};
use crate::motor::Motor;
use fmu_core::Fault;

/// Greatest angle error in rad that is passed to a tracker.
pub const CLIP: f64 = 0.5;

/// Least |L_q - L_d| / (L_q + L_d): below it the noise of the current sensors is all there is.
const LEAST_SALIENCY: f64 = 0.01;

/// The high-frequency admittance in 1/H.
#[derive(Clone, Copy, Debug)]
pub struct Admittance {
    /// S, the same in all directions.
    pub sum: f64,
    /// D, from the saliency; of the sign of L_q - L_d.
    pub difference: f64,
}

impl Admittance {
    /// Of the machine estimates.
    #[inline]
    pub fn of(motor: &Motor) -> Self {
        let (d, q) = (1.0 / motor.L_d, 1.0 / motor.L_q);
        Self { sum: 0.5 * (d + q), difference: 0.5 * (d - q) }
    }
}

/// What the last interval changed, seen from the estimated frame in its middle.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Change {
    /// Of the current, in A.
    pub i: DqHat,
    /// Of the flux linkage by the whole voltage, in Wb.
    pub psi: DqHat,
}

/// Of the current in A what the injected voltage made of it, and R i and back EMF, which are slow: without the share of
/// the current controller's voltage, which is known. Seen from the stator axes, and `middle`, the estimated frame in the
/// middle of the interval. Without that share taken off, noise goes round through the current controller into the angle.
#[inline]
pub fn response(motor: &Motor, middle: Axis<Estimated>, sample: &Sample, T_s: f64) -> DqHat {
    let i = middle.from_stator(sample.i - sample.i_last);
    let psi = middle.from_stator((sample.u - sample.u_injected) * T_s);
    DqHat::new(i.d() - psi.d() / motor.L_d, i.q() - psi.q() / motor.L_q)
}

impl Change {
    /// In [k - 1, k), while the frame turned from `theta_last` to `theta` (rad).
    #[inline]
    pub fn over(theta_last: f64, theta: f64, sample: &Sample, T_s: f64) -> Self {
        let middle = Axis::<Estimated>::at(0.5 * (theta_last + theta));
        Self { i: middle.from_stator(sample.i - sample.i_last), psi: middle.from_stator(sample.u * T_s) }
    }

    /// What changed more than in `earlier`: back EMF and R i are slow and drop out.
    #[inline]
    pub fn beyond(self, earlier: Self) -> Self {
        Self { i: self.i - earlier.i, psi: self.psi - earlier.psi }
    }
}

/// Whether the machine can be found by injection.
///
/// # Errors
/// The two inductances are too close.
pub fn validate_saliency(motor: &Motor) -> Result<(), Fault> {
    let Motor { L_d, L_q, .. } = motor;
    if (L_q - L_d).abs() < LEAST_SALIENCY * (L_q + L_d) {
        return Err(Fault::new(format!(
            "motor.L_d = {L_d} H and motor.L_q = {L_q} H: an estimator by injection needs inductances that differ by \
             more than {} % of their sum, since it finds the angle by their difference",
            100.0 * LEAST_SALIENCY
        )));
    }
    Ok(())
}
