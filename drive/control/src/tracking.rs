//! The tracker's bandwidth in field weakening, where an angle error produces torque.
//!
//! Beyond maximum torque per ampere, the torque of given currents grows with the angle theta~ of the rotor ahead of their frame,
//! by c = -1.5 n_p (i_d (psi_M - dL i_d) + dL i_q^2) > 0, dL = L_q - L_d. A tracker with the poles rho lags behind an
//! acceleration, theta~ = n_p s w / (s + rho)^2, so acceleration produces torque. With A = n_p c / J and the speed loop on w^,
//!
//! ```text
//! s^4 + 2 rho s^3 + (rho^2 - A) s^2 + rho^2 w_s s + rho^2 w_s^2 / t_is = 0,   stable for w_s (1/2 + 2 / t_is) < rho - A / rho
//! ```
//!
//! and for the mechanical observer, which accounts for the torque, (s + rho)^3 = A s, stable for A < 8/3 rho^2. A filter of the
//! EMF with three times rho or more changes the bounds by 2 %. While i_d is lowered, the tracker is at least as fast as these
//! bounds require, with the margin m: rho / m >= w_s (1/2 + 2 / t_is) + A / rho. m is 1.5, or less where the set bandwidth leaves
//! less at A = 0; rho is at most a third of the EMF's bandwidth, and 0.05 / T_s.

use crate::estimator::tracker::TrackerKind;
use crate::estimator::{EstimatorParameters, Kind};
use crate::speed::SpeedLoop;
use serde::{Deserialize, Serialize};

/// The minimum bandwidth of a tracker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LeastTracker {
    /// Half of the speed loop's part in rad/s.
    half: f64,
    /// Its square per c in rad2/s2 per N.m/rad.
    per_slope: f64,
    /// Maximum bandwidth in rad/s.
    most: f64,
}

/// Margin m of the tracker's bandwidth.
const MARGIN: f64 = 1.5;

/// Maximum product of the tracker's bandwidth and T_s that field weakening requires.
const MOST_PER_SAMPLE: f64 = 0.05;

impl LeastTracker {
    /// For the `estimator` with its parameters, the speed loop, the number of pole pairs `n_p`, the inertia `J` (kg.m2) and the sample
    /// period `T_s` (s).
    pub fn new(
        estimator: Kind,
        estimators: &EstimatorParameters,
        speed_loop: &SpeedLoop,
        n_p: i32,
        (J, T_s): (f64, f64),
    ) -> Self {
        let (inertia, hybrid) = (J / f64::from(n_p), estimator == Kind::Hybrid);
        let rho = if hybrid { estimators.hybrid.bandwidth } else { estimators.tracker.bandwidth };
        // These two have no filter of the EMF.
        let by_flux = matches!(estimator, Kind::FluxObserver | Kind::GradientObserver);
        let observer = if by_flux { f64::INFINITY } else { estimators.emf.bandwidth };
        let most = (MOST_PER_SAMPLE / T_s).min(observer / 3.0);
        if estimators.tracker.kind == TrackerKind::MechanicalObserver {
            return Self { half: 0.0, per_slope: 0.375 * MARGIN / inertia, most };
        }
        let w_s = if speed_loop.torque_mode { 0.0 } else { speed_loop.bandwidth };
        let part = w_s * (0.5 + 2.0 / speed_loop.t_is);
        let margin = if MARGIN * part > rho { rho / part } else { MARGIN };
        Self { half: 0.5 * margin * part, per_slope: margin / inertia, most }
    }

    /// Minimum bandwidth in rad/s where the torque grows by `slope` (N.m/rad) with the angle.
    #[inline]
    pub fn at(&self, slope: f64) -> f64 {
        (self.half + (self.half * self.half + self.per_slope * slope.max(0.0)).sqrt()).min(self.most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::ControllerParameters;

    /// rho / m = part + A / rho for the PLL, A = 8/3 (rho / m)^2 for the mechanical observer, and no more than the bounds.
    #[test]
    fn the_least_bandwidth_fulfills_its_equation() {
        let mut par = ControllerParameters { estimator: Kind::ExtendedEmf, ..ControllerParameters::default() };
        par.estimators.emf.bandwidth = 1e4;
        par.estimators.tracker.bandwidth = 200.0;
        (par.speed_loop.bandwidth, par.speed_loop.t_is) = (40.0, 4.0);
        let (part, inertia) = (40.0, par.J / f64::from(par.motor.n_p));
        for slope in [0.0, 5.0, 40.0] {
            let (A, rho) = (slope / inertia, par.least_tracker().at(slope));
            assert!((rho / MARGIN - part - A / rho).abs() < 1e-9 || rho >= MOST_PER_SAMPLE / par.T_s, "{slope}: {rho}");
        }
        par.estimators.tracker.kind = TrackerKind::MechanicalObserver;
        let (A, rho) = (5.0 / inertia, par.least_tracker().at(5.0));
        assert!((rho * rho - 0.375 * MARGIN * A).abs() < 1e-6 * rho * rho, "{rho}");
        par.estimators.emf.bandwidth = 90.0;
        assert!((par.least_tracker().at(1e9) - 30.0).abs() < 1e-9, "a third of the EMF's bandwidth");
        assert!(par.least_tracker().at(-5.0).abs() < 1e-12, "no torque by angle, no bound");
    }

    /// If the set bandwidth has a margin below 1.5, weakening does not raise it at A = 0.
    #[test]
    fn a_tracker_with_little_margin_stays() {
        let mut par = ControllerParameters { estimator: Kind::ExtendedEmf, ..ControllerParameters::default() };
        par.estimators.emf.bandwidth = 1e4;
        (par.speed_loop.bandwidth, par.speed_loop.t_is) = (40.0, 4.0);
        for (rho, expected) in [(50.0, 50.0), (60.0, 60.0), (90.0, 60.0)] {
            par.estimators.tracker.bandwidth = rho;
            let least = par.least_tracker().at(0.0);
            assert!((least - expected).abs() < 1e-9, "{least} rad/s with {rho} rad/s");
        }
    }
}
