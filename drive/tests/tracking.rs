//! The bounds of the tracker's bandwidth in field weakening ([`tracking`](drive::control::tracking)) in the running drive.

use drive::control::envelope::{Envelope, WarmStart};
use drive::control::reference::max_torque_per_ampere;
use drive::estimator::Kind;
use drive::estimator::tracker::TrackerKind;
use drive::frame::DqHat;
use drive::motor::Motor;
use drive::{Pair, SensorlessController};
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

/// A drive at `rpm` with a load of `tau` (N.m) and the bandwidths of tracker and speed loop in rad/s.
struct Loaded<'a> {
    machine: &'a Machine,
    rpm: f64,
    tau: f64,
    kind: Kind,
    tracker: TrackerKind,
    rho: f64,
    w_s: f64,
}

/// Removes the minimum bandwidth from the gains of the `controller`, in its stored form: no parameter disables it.
fn without_minimum_bandwidth(controller: &mut SensorlessController) {
    let mut stored = serde_json::to_value(&*controller).unwrap();
    let tracker = stored["gains"]["weakening"]["tracker"].as_object_mut().unwrap();
    assert!(tracker.values().any(|value| value.as_f64() > Some(0.0)), "{tracker:?}");
    tracker.values_mut().for_each(|value| *value = 0.0.into());
    *controller = serde_json::from_value(stored).unwrap();
}

impl Loaded<'_> {
    /// The frequency A / rho in rad/s at this point.
    fn by_angle(&self) -> f64 {
        let Machine { motor, i, u_dc, J, .. } = self.machine;
        let (envelope, w) = (Envelope::new(motor, *i), f64::from(motor.n_p) * self.rpm * PI / 30.0);
        let (U, mtpa) = (0.95 * u_dc / 3.0_f64.sqrt(), max_torque_per_ampere(motor, self.tau));
        assert!(envelope.limit(w, 1.0, U, &mut WarmStart::default()).tau > 1.1 * self.tau, "{}", self.rpm);
        let i_d = envelope.i_d(self.tau, w, U, mtpa.d(), 20).unwrap();
        let i = DqHat::new(i_d, envelope.i_q(self.tau, i_d));
        f64::from(motor.n_p) * envelope.slope(i) / (J * self.rho)
    }

    /// Whether a disturbance decays, with or without the tracker's minimum bandwidth.
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
            without_minimum_bandwidth(&mut pair.controller.model);
        }
        // The disturbance, then a pause of 89 times its duration.
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

/// The bound separates stable from oscillating drives, over machines, speeds, loads and estimators; the minimum bandwidth of
/// the tracker keeps both stable.
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
                let mut point = Loaded { machine, rpm, tau, kind, tracker, rho, w_s: 0.0 };
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

/// So does the bound of the mechanical observer, regardless of the speed loop.
#[test]
fn the_bound_of_the_mechanical_observer_separates_held_from_oscillating() {
    let [.., machine] = machines();
    for (rpm, tau) in [(9000.0, 50.0), (11_400.0, 50.0)] {
        for kind in [Kind::ExtendedEmf, Kind::FluxObserver] {
            let (tracker, machine) = (TrackerKind::MechanicalObserver, &machine);
            let mut point = Loaded { machine, rpm, tau, kind, tracker, rho: 1.0, w_s: 10.0 };
            let bound = (0.375 * point.by_angle()).sqrt();
            for (share, expected) in [(1.3, true), (0.85, false)] {
                // FluxObserver, which filters no EMF, returns from a swing that the current limit keeps small.
                if !expected && kind == Kind::FluxObserver && rpm > 1e4 {
                    continue;
                }
                point.rho = share * bound;
                let held = [point.held(false), point.held(true)];
                println!("{rpm} rpm {tau} N.m {kind:?}: rho = {:.1} of {bound:.1} rad/s: {held:?}", point.rho);
                assert!(held == [expected, true], "{rpm} rpm {tau} N.m {kind:?}: {share}");
            }
        }
    }
}
