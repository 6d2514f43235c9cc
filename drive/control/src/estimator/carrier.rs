//! The sinusoidal carrier for rotating and pulsating injection, with its filters.
//!
//! Band-pass: H(z) = alpha (1 - z^-2) / (1 + alpha - 2 cos(phi) z^-1 + (1 - alpha) z^-2), phi = w_h T_s, alpha = zeta
//! sin(phi). Its gain is 1 and its phase 0 at the carrier; near the carrier, the phase changes by -1/alpha per radian.
//! The controlled current is i - H i.
//!
//! Low-pass after the demodulation: the mean over one carrier period. It has zeros at the multiples of the carrier
//! frequency, which removes the residual fundamental and the term that does not depend on the angle.
//!
//! Kim & Sul 2011, eq (38) to (45), Figs. 7 and 9, show the filters only as blocks: the transfer functions are derived
//! here.
//! w_h in rad/s, T_s in s.

use crate::estimator::contract::{ContextOf, SetupOf};
use drive_base::frame::Vector;
use drive_base::math::sin_cos;
use fmu_core::unit::{ONE, RAD_PER_S, VOLT};
use fmu_core::{Fault, Row, Table, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The parameters with the prefix `carrier.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CarrierParameters {
    /// Amplitude V of the carrier voltage in V, > 0.
    pub voltage: f64,
    /// Angular frequency w_h in rad/s, > 0; one period must be a whole number of samples.
    pub frequency: f64,
    /// Damping zeta of the band-pass, > 0.
    pub zeta: f64,
}

impl Default for CarrierParameters {
    fn default() -> Self {
        Self { voltage: 70.0, frequency: TAU * 1000.0, zeta: 0.5 }
    }
}

/// Minimum samples per period: with fewer the band-pass filter degenerates.
const MIN_SAMPLES: usize = 6;
/// Maximum samples per period.
const MAX_SAMPLES: usize = 32;

/// The carrier at one sample.
#[derive(Clone, Copy, Debug)]
pub struct Carrier {
    /// V cos(phi k) of this sample's command, in V.
    pub cos: f64,
    /// V sin(phi k), in V.
    pub sin: f64,
    /// alpha of the band-pass.
    pub alpha: f64,
    /// cos(phi).
    cos_phi: f64,
    /// Samples per period.
    samples: usize,
    /// Index of this sample within the period, from 0.
    place: usize,
}

impl Carrier {
    /// At sample `k`.
    #[inline]
    pub fn at<All: AsRef<CarrierParameters>>(context: &ContextOf<All>, k: u64) -> Self {
        let par = context.of::<CarrierParameters>();
        let phi = par.frequency * context.T_s;
        // A period is a whole number of samples. Integer counting keeps the phase from drifting.
        let samples = samples(par.frequency, context.T_s).unwrap_or(MIN_SAMPLES);
        let place = usize::try_from(k % samples as u64).unwrap_or(0);
        let (sin_phi, cos_phi) = sin_cos(phi);
        let (sin, cos) = sin_cos(phi * float(place));
        Self { cos: par.voltage * cos, sin: par.voltage * sin, alpha: par.zeta * sin_phi, cos_phi, samples, place }
    }
}

/// Samples of `T_s` (s) per period of the carrier `frequency` (rad/s), if this is a whole number that the filters
/// support.
#[inline]
fn samples(frequency: f64, T_s: f64) -> Option<usize> {
    let exact = TAU / (frequency * T_s);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, and is checked")]
    let whole = exact.round() as usize;
    let fits = (MIN_SAMPLES..=MAX_SAMPLES).contains(&whole) && (exact - float(whole)).abs() < 1e-6 * exact;
    fits.then_some(whole)
}

/// A number of samples as a real number.
#[expect(clippy::cast_precision_loss, reason = "at most a few dozen")]
#[inline]
fn float(samples: usize) -> f64 {
    samples as f64
}

/// The band-pass for a vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct BandPass<F> {
    x: [Vector<F>; 2],
    y: [Vector<F>; 2],
}

impl<F> BandPass<F> {
    /// The settled state for a constant input `x`.
    pub fn start(x: Vector<F>) -> Self {
        Self { x: [x; 2], y: [Vector::ZERO; 2] }
    }

    /// The part of `x` around the carrier.
    #[inline]
    pub fn update(&mut self, carrier: &Carrier, x: Vector<F>) -> Vector<F> {
        let alpha = carrier.alpha;
        let y = ((x - self.x[1]) * alpha + self.y[0] * (2.0 * carrier.cos_phi) - self.y[1] * (1.0 - alpha))
            * (1.0 / (1.0 + alpha));
        self.x = [x, self.x[0]];
        self.y = [y, self.y[0]];
        y
    }
}

/// The mean over one carrier period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PeriodMean {
    x: [f64; MAX_SAMPLES],
}

impl PeriodMean {
    /// The mean, including this sample's value `x`.
    #[inline]
    pub fn update(&mut self, carrier: &Carrier, x: f64) -> f64 {
        self.x[carrier.place] = x;
        self.x.iter().take(carrier.samples).sum::<f64>() / float(carrier.samples)
    }
}

/// Checks that the carrier fits the sample period.
///
/// # Errors
/// The period is not a whole number of samples, or it has too few or too many samples.
pub fn validate<All: AsRef<CarrierParameters>>(setup: &SetupOf<All>) -> Result<(), Fault> {
    let (frequency, T_s) = (setup.of::<CarrierParameters>().frequency, setup.T_s);
    if samples(frequency, T_s).is_some() {
        return Ok(());
    }
    Err(Fault::new(format!(
        "{} and {}: a period of the carrier is {} samples; it must be a whole number from {MIN_SAMPLES} to \
         {MAX_SAMPLES}",
        setup.tell("carrier.frequency"),
        setup.tell("T_s"),
        TAU / (frequency * T_s)
    )))
}

type P = Row<CarrierParameters>;

/// The variables; their owner adds the prefix `carrier.`.
pub const CARRIER: &Table<CarrierParameters> = table![
    P::parameter("voltage", &VOLT, "Amplitude of the sinusoidal carrier voltage", |p| &mut p.voltage).above(0.0),
    P::parameter("frequency", &RAD_PER_S, "Angular frequency of the sinusoidal carrier", |p| &mut p.frequency)
        .above(0.0),
    P::parameter("zeta", &ONE, "Damping ratio of the band-pass filter at the carrier frequency", |p| { &mut p.zeta })
        .above(0.0),
];
