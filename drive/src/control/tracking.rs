//! The tracker's bandwidth in field weakening, where an angle error makes torque.
//!
//! Beyond maximum torque per ampere, the torque of given currents grows with the angle theta~ of the rotor ahead of their frame,
//! by c = -1.5 n_p (i_d (psi_M - dL i_d) + dL i_q^2) > 0, dL = L_q - L_d. A tracker with the poles rho lags behind an
//! acceleration, theta~ = n_p s w / (s + rho)^2, so that acceleration makes torque. With A = n_p c / J and the speed loop on w^,
//!
//! ```text
//! s^4 + 2 rho s^3 + (rho^2 - A) s^2 + rho^2 w_s s + rho^2 w_s^2 / t_is = 0,   stable for w_s (1/2 + 2 / t_is) < rho - A / rho
//! ```
//!
//! and for the mechanical observer, which knows its own torque, (s + rho)^3 = A s, stable for A < 8/3 rho^2. A filter of the EMF
//! with three times rho or more changes the bounds by 2 %. While i_d is lowered, the tracker is at least as fast as they ask,
//! with the margin m: rho / m >= w_s (1/2 + 2 / t_is) + A / rho. m is 1.5, or what the parameters leave where A = 0; rho is at
//! most a third of the EMF's bandwidth, and 0.05 / T_s.

use crate::control::tables::ControllerParameters;
use crate::estimator::Kind;
use crate::estimator::tracker::TrackerKind;
use serde::{Deserialize, Serialize};

/// The least bandwidth of a tracker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LeastTracker {
    /// Half of the speed loop's part in rad/s.
    half: f64,
    /// Its square per c in rad2/s2 per N.m/rad.
    per_slope: f64,
    /// Greatest bandwidth in rad/s.
    most: f64,
}

/// Margin m of the tracker's bandwidth.
const MARGIN: f64 = 1.5;

/// Greatest product of the tracker's bandwidth and T_s that field weakening asks for.
const MOST_PER_SAMPLE: f64 = 0.05;

impl LeastTracker {
    /// For the estimator and the loops of `par`.
    pub fn new(par: &ControllerParameters) -> Self {
        let ControllerParameters { estimator, estimators, speed_loop, motor, J, T_s, .. } = par;
        let (inertia, hybrid) = (J / f64::from(motor.n_p), *estimator == Kind::Hybrid);
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

    /// Least bandwidth in rad/s where the torque grows by `slope` (N.m/rad) with the angle.
    #[inline]
    pub fn at(&self, slope: f64) -> f64 {
        (self.half + (self.half * self.half + self.per_slope * slope.max(0.0)).sqrt()).min(self.most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::envelope::{Envelope, Warm};
    use crate::control::reference::max_torque_per_ampere;
    use crate::frame::DqHat;
    use crate::motor::Motor;
    use crate::pair::Pair;
    use std::f64::consts::{PI, TAU};

    /// A machine with current limit (A), link (V), inertia (kg.m2) and sample period (s).
    struct Machine {
        name: &'static str,
        motor: Motor,
        i: f64,
        u_dc: f64,
        J: f64,
        T_s: f64,
    }

    fn machines() -> [Machine; 4] {
        let c = Motor { n_p: 3, R_s: 18e-3, L_d: 0.37e-3, L_q: 1.2e-3, psi_M: 66e-3 };
        let traction = Motor { n_p: 6, R_s: 5.5e-3, L_d: 0.09e-3, L_q: 0.25e-3, psi_M: 38e-3 };
        [
            Machine { name: "reference", motor: Motor::default(), i: 7.5, u_dc: 325.0, J: 1.5e-3, T_s: 1e-4 },
            Machine { name: "2.2 kW", motor: Motor::IPMSM_2_2_KW, i: 15.0, u_dc: 540.0, J: 0.015, T_s: 1e-4 },
            Machine { name: "55 kW", motor: c, i: 240.0, u_dc: 400.0, J: 0.038_83, T_s: 1e-4 },
            Machine { name: "traction", motor: traction, i: 450.0, u_dc: 360.0, J: 0.06, T_s: 5e-5 },
        ]
    }

    /// A drive at `rpm` that takes a load of `tau` (N.m), with the bandwidths of tracker and speed loop in rad/s.
    struct Point<'a> {
        machine: &'a Machine,
        rpm: f64,
        tau: f64,
        kind: Kind,
        tracker: TrackerKind,
        rho: f64,
        w_s: f64,
    }

    impl Point<'_> {
        /// The frequency A / rho in rad/s at this point.
        fn by_angle(&self) -> f64 {
            let Machine { motor, i, u_dc, J, .. } = self.machine;
            let (envelope, w) = (Envelope::new(motor, *i), f64::from(motor.n_p) * self.rpm * PI / 30.0);
            let (U, mtpa) = (0.95 * u_dc / 3.0_f64.sqrt(), max_torque_per_ampere(motor, self.tau));
            assert!(envelope.limit(w, 1.0, U, &mut Warm::default()).tau > 1.1 * self.tau, "{}", self.rpm);
            let i_d = envelope.i_d(self.tau, w, U, mtpa.d(), 20).unwrap();
            let i = DqHat::new(i_d, envelope.i_q(self.tau, i_d));
            f64::from(motor.n_p) * envelope.slope(i) / (J * self.rho)
        }

        /// Whether a disturbance dies, with or without the tracker's least bandwidth.
        fn held(&self, least: bool) -> bool {
            let &Machine { ref motor, i, u_dc, J, T_s, .. } = self.machine;
            let speed = self.rpm * PI / 30.0;
            let mut pair = Pair::default();
            let plant = &mut pair.plant.model.parameters;
            (plant.motor, plant.initial.speed) = (motor.clone(), speed);
            (plant.mechanics.J, plant.mechanics.B, plant.mechanics.tau_coulomb) = (J, 0.0, 0.0);
            let par = &mut pair.controller.model.parameters;
            (par.estimator, par.motor, par.J, par.T_s, par.speed_est) = (self.kind, motor.clone(), J, T_s, speed);
            (par.weakening.used, par.current.mtpa, par.current.active_resistance) = (true, true, true);
            (par.current.bandwidth, par.limit.i, par.limit.i_q) = (TAU * 200.0, i, i);
            (par.speed_loop.bandwidth, par.speed_loop.b, par.zero_speed.i_0) = (self.w_s, 1.0, 0.0);
            (par.estimators.tracker.kind, par.estimators.tracker.bandwidth) = (self.tracker, self.rho);
            (par.estimators.hybrid.bandwidth, par.estimators.emf.bandwidth) = (self.rho, 7.5 * self.rho);
            (par.estimators.sliding_mode.gain, par.estimators.sliding_mode.bandwidth) = (3.0 * u_dc, 0.5 / T_s);
            pair.set_inputs(speed, 0.0, u_dc);
            pair.initialize();
            if !least {
                pair.controller.model.gains.weakening.tracker = LeastTracker::default();
            }
            // The disturbance, then 89 times its duration.
            let kick = 1.0 / self.w_s;
            let (mut t, mut low, mut high) = (0.0, f64::INFINITY, 0.0_f64);
            while t < 1.0 + 90.0 * kick {
                let more = if t > 1.0 && t < 1.0 + kick { 0.05 * self.tau } else { 0.0 };
                pair.set_inputs(speed, self.tau * (2.0 * t).min(1.0) + more, u_dc);
                if pair.step(T_s).is_err() {
                    return false;
                }
                t += T_s;
                if t > 1.0 + 75.0 * kick {
                    low = low.min(pair.plant.out.speed);
                    high = high.max(pair.plant.out.speed);
                }
            }
            high - low < 0.001 * speed
        }
    }

    /// The bound separates what is held from what oscillates, over machines, speeds, loads and estimators; the least bandwidth
    /// of the tracker holds both.
    #[test]
    fn the_bound_of_the_speed_loop_separates_held_from_oscillating() {
        let points: [&[(f64, f64)]; 4] = [
            &[(4500.0, 1.0), (5000.0, 0.5)],
            &[(2500.0, 14.0), (4000.0, 5.0)],
            &[(12_000.0, 35.0), (12_000.0, 42.0)],
            &[(9000.0, 50.0), (11_400.0, 50.0)],
        ];
        for (machine, points) in machines().iter().zip(points) {
            for &(rpm, tau) in points {
                for kind in [Kind::ExtendedEmf, Kind::FluxObserver, Kind::SlidingMode] {
                    let (tracker, rho) = (TrackerKind::Pll, TAU * 20.0);
                    let mut point = Point { machine, rpm, tau, kind, tracker, rho, w_s: 0.0 };
                    // With t_is = 4, the part of the speed loop is w_s.
                    let bound = rho - point.by_angle();
                    for (share, expected) in [(0.75, true), (1.15, false)] {
                        point.w_s = share * bound;
                        let held = [point.held(false), point.held(true)];
                        println!(
                            "{} {rpm} rpm {tau} N.m {kind:?}: w_s = {:.1} of {bound:.1} rad/s: {held:?}",
                            machine.name, point.w_s
                        );
                        assert!(held == [expected, true], "{} {rpm} rpm {tau} N.m {kind:?}: {share}", machine.name);
                    }
                }
            }
        }
    }

    /// So does that of the mechanical observer, whatever the speed loop does.
    #[test]
    fn the_bound_of_the_mechanical_observer_separates_held_from_oscillating() {
        let [.., machine] = machines();
        for (rpm, tau) in [(9000.0, 50.0), (11_400.0, 50.0)] {
            for kind in [Kind::ExtendedEmf, Kind::FluxObserver] {
                let (tracker, machine) = (TrackerKind::MechanicalObserver, &machine);
                let mut point = Point { machine, rpm, tau, kind, tracker, rho: 1.0, w_s: 10.0 };
                let bound = (0.375 * point.by_angle()).sqrt();
                for (share, expected) in [(1.3, true), (0.85, false)] {
                    point.rho = share * bound;
                    let held = [point.held(false), point.held(true)];
                    println!("{rpm} rpm {tau} N.m {kind:?}: rho = {:.1} of {bound:.1} rad/s: {held:?}", point.rho);
                    assert!(held == [expected, true], "{rpm} rpm {tau} N.m {kind:?}: {share}");
                }
            }
        }
    }
}
