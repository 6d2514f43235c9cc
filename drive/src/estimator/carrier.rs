//! The sinusoidal carrier of rotating and pulsating injection, and its filters.
//!
//! Band-pass: H(z) = alpha (1 - z^-2) / (1 + alpha - 2 cos(phi) z^-1 + (1 - alpha) z^-2), phi = w_h T_s,
//! alpha = zeta sin(phi); gain 1 and phase 0 at the carrier, beside it the phase turns by -1/alpha per radian. i - H i is
//! the current that is controlled.
//!
//! Low-pass behind the demodulation: the mean over one period of the carrier, zero at its multiples, where what is left
//! of the fundamental and of the part without an angle comes to lie.
//!
//! For Kim & Sul 2011, eq (38) to (45), Figs. 7 and 9, which draw the filters as blocks: the transfer functions are derived here.
//! w_h in rad/s, T_s in s.

use crate::estimator::Context;
use crate::frame::Vector;
use crate::math::sin_cos;
use fmu_core::unit::{ONE, RAD_PER_S, VOLT};
use fmu_core::{Fault, Row, Table};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The parameters with the prefix `carrier.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CarrierParameters {
    /// Voltage V, > 0.
    pub voltage: f64,
    /// Angular frequency w_h in rad/s, > 0; a period is a whole number of samples.
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

/// The carrier at a sample.
#[derive(Clone, Copy, Debug)]
pub struct Carrier {
    /// V cos(phi k) of the command of this sample, in V.
    pub cos: f64,
    /// V sin(phi k), in V.
    pub sin: f64,
    /// alpha of the band-pass.
    pub alpha: f64,
    /// cos(phi).
    cos_phi: f64,
    /// Samples in a period.
    samples: usize,
    /// Place of this sample in a period, from 0.
    place: usize,
}

impl Carrier {
    /// At sample `k`.
    #[inline]
    pub fn at(context: &Context, k: u64) -> Self {
        let par = &context.par.carrier;
        let phi = par.frequency * context.T_s;
        // A period is a whole number of samples: counted in integers, the phase never drifts.
        let samples = samples(context).unwrap_or(MIN_SAMPLES);
        let place = usize::try_from(k % samples as u64).unwrap_or(0);
        let (sin_phi, cos_phi) = sin_cos(phi);
        let (sin, cos) = sin_cos(phi * float(place));
        Self { cos: par.voltage * cos, sin: par.voltage * sin, alpha: par.zeta * sin_phi, cos_phi, samples, place }
    }
}

/// Samples in a period of the carrier, when they are a whole number that the filters can do.
#[inline]
fn samples(context: &Context) -> Option<usize> {
    let exact = TAU / (context.par.carrier.frequency * context.T_s);
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

/// The band-pass of a vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct BandPass<F> {
    x: [Vector<F>; 2],
    y: [Vector<F>; 2],
}

impl<F> BandPass<F> {
    /// After a long time at `x`.
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

/// The mean over a period of the carrier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PeriodMean {
    x: [f64; MAX_SAMPLES],
}

impl PeriodMean {
    /// The mean with the value `x` of this sample.
    #[inline]
    pub fn update(&mut self, carrier: &Carrier, x: f64) -> f64 {
        self.x[carrier.place] = x;
        self.x.iter().take(carrier.samples).sum::<f64>() / float(carrier.samples)
    }
}

/// Whether the carrier fits the sample period.
///
/// # Errors
/// A period is not a whole number of samples, or one of too few or too many.
pub fn validate(context: &Context) -> Result<(), Fault> {
    if samples(context).is_some() {
        return Ok(());
    }
    let (w, frequency) = (context.par.carrier.frequency, context.tell(|p| &mut p.carrier.frequency));
    let exact = TAU / (w * context.T_s);
    Err(Fault::new(format!(
        "{frequency} and T_s = {} s: a period of the carrier is {exact} samples; it must be a whole \
         number from {MIN_SAMPLES} to {MAX_SAMPLES}",
        context.T_s
    )))
}

type P = Row<CarrierParameters>;

/// The variables; their owner gives the prefix `carrier.`.
pub const CARRIER: &Table<CarrierParameters> = &Table::new(
    const {
        &[
            P::parameter("voltage", &VOLT, "Amplitude of the sinusoidal carrier voltage", |p| &mut p.voltage)
                .above(0.0),
            P::parameter("frequency", &RAD_PER_S, "Angular frequency of the sinusoidal carrier", |p| &mut p.frequency)
                .above(0.0),
            P::parameter("zeta", &ONE, "Damping ratio of the band-pass filter at the carrier frequency", |p| {
                &mut p.zeta
            })
            .above(0.0),
        ]
    },
);
