//! The time constants of the tuned drive at a speed. They time a trial.
//!
//! - **Speed loop.** s^2 + w_s s + w_s^2 / t_is = 0; with t_is = 4, a double pole at w_s / 2.
//! - **Observer.** Rasmussen's flux poles at the electrical speed w: s^2 + c_1 s + w^2 = 0, so 2 / c_1 above w = c_1 / 2 and
//!   about c_1 / w^2 below, where the back EMF carries little information; its speed adaptation: a double pole at w_n. A
//!   tracker: a double pole at rho.
//! - **Mechanics.** J w / T, the time in which the rated torque accelerates the rotor to its speed. A load tau_L moves the
//!   rotor of a lost drive by the rated speed in either direction: J w / T with the rated speed. The torque in excess of the
//!   load recovers the dip 2/e tau_L / (J w_s) in 2/e tau_L / (w_s (tau_max - tau_L)).

use super::bandwidth::DIP_OF_A_STEP;
use super::setting::Tuned;
use drive::Pair;
use drive::control::start::StartMode;
use drive::control::tables::ControllerParameters;
use drive::estimator::Kind;

/// Minimum torque available in excess of a load, as a share of the load: an assumption if less is available.
const LEAST_SPARE: f64 = 0.02;

/// Time constants in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Time constant of the mechanics.
    pub mechanics: f64,
    /// Time constant of the observer or tracker.
    pub observer: f64,
    /// Time constant of the speed loop.
    pub speed: f64,
}

impl Pace {
    /// The time constants at `level` (pu of the rated speed) under `load` (N.m).
    pub fn of(tuned: &Tuned, pair: &Pair, level: f64, load: f64) -> Self {
        let par = &pair.controller.model.parameters;
        let (speed_loop, estimators) = (&par.speed_loop, &par.estimators);
        let w = f64::from(par.motor.n_p) * level * tuned.speed;
        let observer = match par.estimator {
            Kind::Rasmussen => {
                let rasmussen = &estimators.rasmussen;
                slowest(rasmussen.c_1, w * w).max(1.0 / rasmussen.w_n)
            }
            // Both poles of the angle are at half of the gain.
            Kind::VoltageModel | Kind::CurrentModel => 2.0 / estimators.matsui.bandwidth,
            Kind::KalmanFilter => 1.0 / tuned.observer,
            Kind::Sensored => 0.0,
            _ => 1.0 / estimators.tracker.bandwidth,
        };
        let spare = (pair.controller.out.tau_max - load).max(LEAST_SPARE * load);
        let back = if load > 0.0 { DIP_OF_A_STEP * load / (speed_loop.bandwidth * spare) } else { 0.0 };
        let speed = if load > 0.0 { level.max(1.0) } else { level } * tuned.speed;
        Self {
            mechanics: (pair.plant.model.parameters.mechanics.J * speed / tuned.torque).max(back),
            observer,
            speed: slowest(speed_loop.bandwidth, speed_loop.bandwidth * speed_loop.bandwidth / speed_loop.t_is),
        }
    }

    /// The slower one of observer and speed loop.
    pub fn loops(&self) -> f64 {
        self.observer.max(self.speed)
    }

    /// The slowest one.
    pub fn slowest(&self) -> f64 {
        self.loops().max(self.mechanics)
    }
}

/// Time in s in which a start by injection finds the pole: the injection, two pairs of pulses, and three pauses of 4 L / R.
fn search(par: &ControllerParameters) -> f64 {
    let ControllerParameters { polarity, motor, T_s, .. } = par;
    polarity.t_find + 4.0 * f64::from(polarity.samples) * T_s + 12.0 * motor.L_d.max(motor.L_q) / motor.R_s
}

/// Time constant in s of the slower root of s^2 + `a` s + `b` = 0.
fn slowest(a: f64, b: f64) -> f64 {
    let half = 0.5 * a;
    // The product of the roots is b, their greater magnitude the sum.
    if half * half > b { (half + (half * half - b).sqrt()) / b } else { 1.0 / half }
}

/// Times in s of a start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Begin {
    /// At rest, with 0 as the speed reference.
    pub rest: f64,
    /// Maximum time for which the controller then keeps the rotor at rest to measure the resistance.
    pub measures: f64,
    /// Until the estimator has found the rotor after that, and a ramp has reached the speed.
    pub ready: f64,
}

impl Begin {
    /// The start of a drive that runs up to `level` (pu).
    pub fn of(tuned: &Tuned, pair: &Pair, level: f64) -> Self {
        let par = &pair.controller.model.parameters;
        let ramp = if par.speed_loop.ramp > 0.0 { level * tuned.speed / par.speed_loop.ramp } else { 0.0 };
        let (start, adaptation) = (&par.start, &par.estimators.adaptation);
        if start.mode == StartMode::CurrentFrequency {
            let ready = 2.0 * start.t_align + start.speed / start.acceleration + start.settle + ramp;
            return Self { rest: 0.0, measures: 0.0, ready };
        }
        if start.mode == StartMode::Injection {
            return Self { rest: 0.0, measures: 0.0, ready: search(par) + ramp };
        }
        let measures = if pair.controller.model.measures_resistance() { adaptation.longest_rest() } else { 0.0 };
        Self { rest: if measures > 0.0 { 0.0 } else { tuned.rest }, measures, ready: ramp }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slower_root_decides() {
        // (s + 2)(s + 10); a double root at 3; 2 +- j 5.
        assert!((slowest(12.0, 20.0) - 0.5).abs() < 1e-12);
        assert!((slowest(6.0, 9.0) - 1.0 / 3.0).abs() < 1e-12);
        assert!((slowest(4.0, 29.0) - 0.5).abs() < 1e-12);
    }
}
