//! Start from standstill by injection: finds the magnet axis from any initial angle, then identifies the north pole.
//!
//! 1. The estimator injects for `t_find` to locate the magnet axis without its polarity; the current reference is
//!    zero.
//! 2. No voltage for 4 L/R: the injection currents decay.
//! 3. +V along the estimated d-axis for `samples`, then -V for as many samples; the peak of i_d is stored; then no voltage for
//!    4 L/R. This sequence follows with the opposite sign.
//! 4. Along the magnet flux, the iron saturates and the current is larger, so the larger peak marks the north pole. The
//!    estimate stays or turns by half a turn. Then speed and current control begin.
//!
//! With the flux linkage x = V T_s `samples`, the peaks are approximately x / L_d + s_2 x^2 and x / L_d - s_2 x^2.
//! Limits: the rotor must stand still; without saturation, noise decides the polarity.
//!
//! Saliency cannot distinguish the poles (Kim & Sul 2011, eq (36) contains the angle as 2 theta); the pulse sequence is
//! derived here from the saturation of the plant. V in V, x in Wb, L in H, s_2 in A/Wb2.

use crate::estimator::{Context, Sample};
use drive_base::frame::{Axis, DqHat, Estimated};
use fmu_core::unit::{SECOND, VOLT};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Duration of the pauses in units of L/R.
const REST: f64 = 4.0;

/// The parameters with the prefix `polarity.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolarityParameters {
    /// Time of injection in s, > 0.
    pub t_find: f64,
    /// Magnitude V of the voltage pulses in V, > 0.
    pub voltage: f64,
    /// Duration of a pulse in samples, >= 1.
    pub samples: i32,
}

impl Default for PolarityParameters {
    fn default() -> Self {
        Self { t_find: 0.2, voltage: 150.0, samples: 8 }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    #[default]
    Find,
    Settle,
    Forward,
    Mirrored,
}

/// State of the search for the north pole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PolaritySearch {
    stage: Stage,
    /// Samples in this stage.
    n: f64,
    /// The axis found, in rad.
    theta: f64,
    /// Largest current in A of the pulses along the axis and of those against it.
    peaks: [f64; 2],
}

/// Requests of the search at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SearchStep {
    /// The estimator injects; the current reference is zero.
    Inject,
    /// Apply the voltage `u` (V) in the frame at `theta` (rad) instead of the current controller's output.
    Pulse {
        /// Angle of the frame.
        theta: f64,
        /// Voltage in the frame.
        u: DqHat,
    },
    /// The north pole is at this electrical angle (rad).
    Found(f64),
}

impl PolaritySearch {
    /// The estimator's angle (rad) at this sample.
    #[inline]
    pub fn sees(&mut self, theta: f64) {
        self.theta = theta;
    }

    /// One sample.
    pub fn update(&mut self, par: &PolarityParameters, context: &Context, sample: &Sample) -> SearchStep {
        let Context { motor, T_s, .. } = *context;
        let (n, pulse) = (self.n, f64::from(par.samples));
        let rest = (REST * motor.L_d.max(motor.L_q) / motor.R_s / T_s).ceil();
        let i_d = Axis::<Estimated>::at(self.theta).from_stator(sample.i).d();
        self.n += 1.0;
        let (voltage, duration) = match self.stage {
            Stage::Find => {
                if n * T_s < par.t_find {
                    return SearchStep::Inject;
                }
                (0.0, n)
            }
            Stage::Settle => (0.0, rest),
            Stage::Forward | Stage::Mirrored => {
                let (side, place) = if self.stage == Stage::Forward { (1.0, 0) } else { (-1.0, 1) };
                self.peaks[place] = self.peaks[place].max(side * i_d);
                let there_and_back = if n < pulse { par.voltage } else { -par.voltage };
                (if n < 2.0 * pulse { side * there_and_back } else { 0.0 }, 2.0 * pulse + rest)
            }
        };
        if n >= duration {
            self.n = 0.0;
            self.stage = match self.stage {
                Stage::Find => Stage::Settle,
                Stage::Settle => Stage::Forward,
                Stage::Forward => Stage::Mirrored,
                Stage::Mirrored => {
                    let [along, against] = self.peaks;
                    return SearchStep::Found(if along >= against { self.theta } else { self.theta + PI });
                }
            };
        }
        SearchStep::Pulse { theta: self.theta, u: DqHat::new(voltage, 0.0) }
    }
}

type P = Row<PolarityParameters>;

/// Variables of the search; their owner supplies the prefix `polarity.`.
pub const POLARITY: &Table<PolarityParameters> = table![
    P::parameter("t_find", &SECOND, "Duration of the injection before the pulses, start by injection", |p| {
        &mut p.t_find
    })
    .above(0.0),
    P::parameter("voltage", &VOLT, "Amplitude of the d-axis voltage pulses, start by injection", |p| {
        &mut p.voltage
    })
    .above(0.0),
    P::integer_parameter("samples", "Duration of a pulse in samples, start by injection", |p| &mut p.samples)
        .at_least(1.0)
        .at_most(1000.0),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use drive_base::motor::Motor;

    /// At rest, along the d axis, with i = x / L_d + s_2 x^2 for the flux linkage x: more current along the magnet flux.
    fn found(turned: bool) -> f64 {
        let (par, motor, estimators) =
            (PolarityParameters::default(), Motor::IPMSM_2_2_KW, EstimatorParameters::default());
        let context = Context { par: &estimators, motor: &motor, J: 0.015, T_s: 1e-4 };
        let (theta, s_2) = (0.4, 5.0);
        let pole = if turned { -1.0 } else { 1.0 };
        let (mut search, mut x) = (PolaritySearch::default(), 0.0_f64);
        for _ in 0..100_000 {
            let i_d = pole * (pole * x / motor.L_d + s_2 * x * x);
            let i = Axis::<Estimated>::at(theta).to_stator(DqHat::new(i_d, 0.0));
            match search.update(&par, &context, &Sample { i, ..Sample::default() }) {
                SearchStep::Inject => search.sees(theta),
                SearchStep::Pulse { theta: at, u } => {
                    assert!((at - theta).abs() < 1e-15 && u.q().abs() < 1e-15, "along the axis");
                    x += 1e-4 * (u.d() - motor.R_s * i_d);
                }
                SearchStep::Found(at) => return at,
            }
        }
        panic!("nothing found")
    }

    #[test]
    fn the_larger_current_marks_the_north_pole() {
        assert!((found(false) - 0.4).abs() < 1e-12, "{}", found(false));
        assert!((found(true) - 0.4 - PI).abs() < 1e-12, "{}", found(true));
    }
}
