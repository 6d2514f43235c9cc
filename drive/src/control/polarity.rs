//! The start from standstill by injection: the angle from any initial angle, then which end of the magnet it is.
//!
//! 1. The estimator injects for `t_find` and finds the magnet's axis, one end or the other; the current stays at zero.
//! 2. No voltage for 4 L/R: the currents of the injection decay.
//! 3. +V along the estimated d axis for `samples`, -V for as many; the peak of i_d; no voltage for 4 L/R. The same mirrored.
//! 4. Along the magnet the iron saturates and the current is greater: the greater peak was on the side of the north pole.
//!    The estimate stays, or turns by half a turn. Then speed and current control begin.
//!
//! With the flux linkage x = V T_s `samples` the peaks are x / L_d + s_2 x^2 and x / L_d - s_2 x^2, nearly.
//! Limits: the rotor stands still; where nothing saturates the noise decides.
//!
//! The saliency cannot tell the ends apart (Kim & Sul 2011, eq (36): the angle is in it as 2 theta); the sequence of pulses is derived
//! here from the saturation of [`saturation`](crate::plant::saturation). V in V, x in Wb, L in H, s_2 in A/Wb2.

use crate::estimator::{Context, Sample};
use crate::frame::{Axis, DqHat, Estimated};
use crate::motor::Motor;
use fmu_core::unit::{SECOND, VOLT};
use fmu_core::{Fault, Row, Table};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Rests in units of L/R.
const REST: f64 = 4.0;
/// Minimum difference of the peaks, by the controller's estimates, in units of x / L_d.
const MIN_DIFFERENCE: f64 = 0.02;

/// The parameters with the prefix `polarity.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolarityParameters {
    /// Time of injection in s, > 0.
    pub t_find: f64,
    /// Voltage V of the pulses, > 0.
    pub voltage: f64,
    /// Samples of a pulse, >= 1.
    pub samples: i32,
}

impl Default for PolarityParameters {
    fn default() -> Self {
        Self { t_find: 0.2, voltage: 150.0, samples: 8 }
    }
}

impl PolarityParameters {
    /// Whether the pulses tell the ends of the magnet apart, with the estimate `s_2` (A/Wb2) of its saturation, and stay
    /// within the current `limit` (A).
    ///
    /// # Errors
    /// Says which parameters do not fit.
    pub fn validate(&self, motor: &Motor, T_s: f64, s_2: f64, limit: f64) -> Result<(), Fault> {
        let Self { voltage, samples, .. } = self;
        let x = voltage * T_s * f64::from(*samples);
        let (linear, saturated) = (x / motor.L_d, s_2 * x * x);
        let pulses = format!("polarity.voltage = {voltage} V for polarity.samples = {samples} of T_s = {T_s} s");
        if 2.0 * saturated.abs() < MIN_DIFFERENCE * linear {
            return Err(Fault::new(format!(
                "saturation.s_2 = {s_2} A/Wb2: {pulses} make peaks of {linear} A that differ by {} A only; the ends of \
                 the magnet differ by saturation alone, and the start by injection needs {} A",
                2.0 * saturated.abs(),
                MIN_DIFFERENCE * linear
            )));
        }
        if linear + saturated.abs() > limit {
            let peak = linear + saturated.abs();
            return Err(Fault::new(format!("{pulses} make a current of {peak} A, above limit.i = {limit} A")));
        }
        Ok(())
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
    /// The axis that was found, in rad.
    theta: f64,
    /// Greatest current in A of the pulses along the axis, and against it.
    peaks: [f64; 2],
}

/// What the search requests at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SearchStep {
    /// The estimator injects; the current stays at zero.
    Inject,
    /// Apply the voltage `u` (V) in the frame at `theta` (rad) instead of the current controller's.
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

/// The search's variables; their owner gives the prefix `polarity.`.
pub const POLARITY: &Table<PolarityParameters> = &Table::new(
    const {
        &[
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
        ]
    },
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_that_cannot_decide_are_refused() {
        let motor = Motor::IPMSM_2_2_KW;
        let par = PolarityParameters::default();
        par.validate(&motor, 1e-4, 40.0, 15.0).unwrap();
        let message = |par: &PolarityParameters, s_2, limit| {
            par.validate(&motor, 1e-4, s_2, limit).unwrap_err().message().to_owned()
        };
        let unknown = message(&par, 0.0, 15.0);
        for part in ["saturation.s_2 = 0 A/Wb2", "polarity.voltage = 150 V", "polarity.samples = 8", "T_s = 0.0001 s"] {
            assert!(unknown.contains(part), "{unknown}");
        }
        let weak = message(&PolarityParameters { voltage: 5.0, ..par.clone() }, 40.0, 15.0);
        assert!(weak.contains("polarity.voltage = 5 V"), "{weak}");
        let strong = message(&PolarityParameters { samples: 80, ..par }, 40.0, 15.0);
        assert!(strong.contains("above limit.i = 15 A"), "{strong}");
    }
}
