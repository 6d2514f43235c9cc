//! The axes and L(0): one least squares for the symmetric G of i = G psi over small loops at 0, 45, 90 and 135 degrees.
//!
//! ```text
//! 1/L = g_0 +- g_2         axis = atan2(g_s, g_c) / 2
//! ```
//!
//! Means and trends of each loop are removed. Up to L_q/L_d = 1.15 a free rotor's axis is taken from its alignment.

use super::bench::Bench;
use super::excitation::{Excitation, Record};
use super::least_squares::Normal;
use super::status::CommissionFault as Fault;
use drive_base::math::atan2;
use serde::{Deserialize, Serialize};

/// Minimum ratio of the inductances that determines the axis of a free rotor, which is also known from its alignment, and of a
/// blocked one.
const SALIENT: [f64; 2] = [1.15, 1.03];

/// Ratio of the inductances above which the angle at rest has revealed the magnet's inductance.
const LOOKED: f64 = 1.5;

/// The loops so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Loops {
    normal: Normal<3>,
}

/// Axis and inductances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Axes {
    /// Angle of the d-axis in rad.
    pub(super) axis: f64,
    /// L(0) in H of both axes.
    pub(super) L_d: f64,
    pub(super) L_q: f64,
    /// The axis is known, by the inductances or by the alignment.
    pub(super) known: bool,
    /// (L_q - L_d)/(L_q + L_d) where it is not: both are the mean.
    pub(super) spread: f64,
}

impl Loops {
    /// Takes a loop.
    pub(super) fn add(&mut self, bench: &Bench, excitation: &Excitation, record: &Record) {
        let L = excitation.plan.L;
        let rows = (0..record.len()).fold(0.0, |sum, _| sum + 1.0);
        let vectors = |row: [f64; 4]| {
            let (psi, i) = (excitation.stator(row[0], row[1]), excitation.stator(row[2], row[3]));
            [psi.alpha(), psi.beta(), i.alpha(), i.beta()]
        };
        // Time runs from -1 to 1: the mean of its square is (1 - 1/n^2)/3.
        let time = |k: f64| (2.0 * k + 1.0) / rows - 1.0;
        let (mut mean, mut slope, mut k) = ([0.0; 4], [0.0; 4], 0.0);
        excitation.flux(bench, record, L, |row| {
            for (j, x) in vectors(row).into_iter().enumerate() {
                mean[j] += x / rows;
                slope[j] += x * time(k) / rows;
            }
            k += 1.0;
        });
        let square = (1.0 - 1.0 / (rows * rows)) / 3.0;
        k = 0.0;
        excitation.flux(bench, record, L, |row| {
            let x = vectors(row);
            let [a, b, i_a, i_b]: [f64; 4] = std::array::from_fn(|j| x[j] - mean[j] - slope[j] / square * time(k));
            self.normal.add(&[a, b, 0.0], i_a);
            self.normal.add(&[0.0, a, b], i_b);
            k += 1.0;
        });
    }

    /// The axes of an `inverse` machine, which has L_d > L_q.
    ///
    /// # Errors
    /// They are not separable, an inductance is negative, or the magnet has changed its axis.
    pub(super) fn axes(&self, blocked: bool, inverse: bool) -> Result<Axes, Fault> {
        let [aa, ab, bb] = self.normal.solve(0.0).ok_or(Fault::Inductance)?.x;
        let (g_0, g_c, g_s) = (0.5 * (aa + bb), 0.5 * (aa - bb), ab);
        let g_2 = (g_c * g_c + g_s * g_s).sqrt();
        if g_2 >= g_0 {
            return Err(Fault::Inductance);
        }
        if g_0 + g_2 > SALIENT[usize::from(blocked)] * (g_0 - g_2) {
            let axis = 0.5 * atan2(g_s, g_c);
            let (L_d, L_q) = (1.0 / (g_0 + g_2), 1.0 / (g_0 - g_2));
            // A free rotor's magnet lies near 0.
            let beside = axis.abs() > std::f64::consts::FRAC_PI_4;
            if !blocked && beside != inverse && L_q > LOOKED * L_d {
                return Err(Fault::Inductance);
            }
            if !blocked && beside {
                let axis = axis - std::f64::consts::FRAC_PI_2.copysign(axis);
                return Ok(Axes { axis, L_d: L_q, L_q: L_d, known: true, spread: 0.0 });
            }
            return Ok(Axes { axis, L_d, L_q, known: true, spread: 0.0 });
        }
        if blocked {
            return Ok(Axes { axis: 0.0, L_d: 1.0 / g_0, L_q: 1.0 / g_0, known: false, spread: g_2 / g_0 });
        }
        Ok(Axes { axis: 0.0, L_d: 1.0 / (g_0 + g_c), L_q: 1.0 / (g_0 - g_c), known: true, spread: 0.0 })
    }
}
