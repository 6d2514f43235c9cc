//! Results derived from a frequency response: bandwidth and peak of a closed loop, margins of an open one, passivity of an
//! impedance.
//!
//! Between two frequencies, gain in dB and unwrapped phase are linear in the logarithm of the frequency.

use num_complex::Complex64;

/// A point of a frequency response: frequency in Hz and value.
pub type ResponsePoint = (f64, Complex64);

/// A magnitude in dB.
pub fn decibels(x: Complex64) -> f64 {
    20.0 * x.norm().log10()
}

/// Phases in degrees without jumps; the first is in (-270, 90], so that a loop with two integrators begins at -180.
pub fn phases(points: &[ResponsePoint]) -> Vec<f64> {
    let mut last: Option<f64> = None;
    let phase = |(_, x): &ResponsePoint| {
        let own = x.arg().to_degrees();
        let turns = last.map_or(if own > 90.0 { -1.0 } else { 0.0 }, |last| ((last - own) / 360.0).round());
        let phase = own + 360.0 * turns;
        // A value that is not finite has no phase, and the next one continues from the last.
        if phase.is_finite() {
            last = Some(phase);
        }
        phase
    };
    points.iter().map(phase).collect()
}

/// The open loop L = T / (1 - T) of a closed one, T = L / (1 + L).
pub fn open_loop(closed: Complex64) -> Complex64 {
    closed / (1.0 - closed)
}

/// Properties of a closed loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passband {
    /// Frequency (Hz) above which the gain is 3 dB below its value at the lowest frequency.
    pub bandwidth: Option<f64>,
    /// Frequency (Hz) of the largest gain.
    pub peak_at: f64,
    /// Largest gain in dB.
    pub peak: f64,
}

/// Properties of an open loop L, with the feedback -L.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Margins {
    /// Frequency (Hz) at which the gain is 0 dB: of several, the one with the smallest phase margin.
    pub crossover: Option<f64>,
    /// Phase margin there in degrees, in (-90, 270]; negative: unstable, if the loop without feedback is stable.
    pub phase: Option<f64>,
    /// Delay in s that makes the loop unstable; negative: the excess delay.
    pub delay: Option<f64>,
    /// Frequency (Hz) at which the phase is -180 degrees: of several, the one with the smallest gain margin.
    pub phase_crossover: Option<f64>,
    /// Gain margin there in dB: positive, the factor by which the gain may rise; negative, by which it may fall.
    pub gain: Option<f64>,
    /// Frequency (Hz) of the largest sensitivity 1 / |1 + L|.
    pub sensitivity_at: f64,
    /// Largest sensitivity in dB: a disturbance of this frequency is amplified so.
    pub sensitivity: f64,
}

/// Places (Hz) where `y` crosses 0, with the share of the way between two points and the index of the first.
fn crossings<'a>(points: &'a [ResponsePoint], y: &'a [f64]) -> impl Iterator<Item = (f64, f64, usize)> + 'a {
    (1..y.len()).filter_map(move |k| {
        let (a, b) = (y[k - 1], y[k]);
        let crosses = (a > 0.0) != (b > 0.0) && (a - b).is_finite();
        let share = if crosses { a / (a - b) } else { return None };
        let (from, to) = (points[k - 1].0.ln(), points[k].0.ln());
        Some(((from + share * (to - from)).exp(), share, k - 1))
    })
}

fn between(y: &[f64], share: f64, k: usize) -> f64 {
    y[k] + share * (y[k + 1] - y[k])
}

/// The point with the largest value in dB.
fn largest(points: &[ResponsePoint], of: impl Fn(Complex64) -> f64) -> (f64, f64) {
    let all = points.iter().map(|(f, x)| (*f, of(*x))).filter(|(_, x)| !x.is_nan());
    all.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((f64::NAN, f64::NAN))
}

/// Passband and peak of a closed loop.
pub fn band(points: &[ResponsePoint]) -> Passband {
    let first = points.first().map_or(f64::NAN, |(_, x)| decibels(*x));
    let above: Vec<f64> = points.iter().map(|(_, x)| decibels(*x) - first + 20.0 * 2.0_f64.sqrt().log10()).collect();
    let (peak_at, peak) = largest(points, decibels);
    Passband {
        bandwidth: crossings(points, &above).last().map(|(f, ..)| f).filter(|_| above.last() < Some(&0.0)),
        peak_at,
        peak,
    }
}

/// Frequencies (Hz) at which the gain of a loop is 0 dB, each with the phase in degrees there, in (-180, 180].
pub fn crossovers(points: &[ResponsePoint]) -> Vec<(f64, f64)> {
    let (gains, phases): (Vec<f64>, _) = (points.iter().map(|(_, x)| decibels(*x)).collect(), phases(points));
    let phase = |(f, share, k)| (f, between(&phases, share, k));
    let all: Vec<(f64, f64)> = crossings(points, &gains).map(phase).collect();
    all.into_iter().map(|(f, x)| (f, x - 360.0 * (x / 360.0).round())).collect()
}

/// Margins of an open loop.
pub fn margins(points: &[ResponsePoint]) -> Margins {
    let gains: Vec<f64> = points.iter().map(|(_, x)| decibels(*x)).collect();
    let phases = phases(points);
    let margin = |(f, phase): (f64, f64)| (f, phase + if phase > 90.0 { -180.0 } else { 180.0 });
    let by_phase: Vec<(f64, f64)> = crossovers(points).into_iter().map(margin).collect();
    let phase = by_phase.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
    let delay = by_phase.iter().map(|(f, x)| x / (360.0 * f)).min_by(f64::total_cmp);
    let (low, high) = phases.iter().fold((0.0_f64, 0.0_f64), |(low, high), x| (low.min(*x), high.max(*x)));
    let turns = |x: f64| (x + 180.0) / 360.0;
    let mut gain: Option<(f64, f64)> = None;
    let mut level = -180.0 + 360.0 * turns(low).floor();
    while level <= high {
        let above: Vec<f64> = phases.iter().map(|x| x - level).collect();
        for (f, share, k) in crossings(points, &above) {
            let margin = -between(&gains, share, k);
            if gain.is_none_or(|(_, other)| margin.abs() < other.abs()) {
                gain = Some((f, margin));
            }
        }
        level += 360.0;
    }
    let (sensitivity_at, sensitivity) = largest(points, |x| -decibels(1.0 + x));
    Margins {
        crossover: phase.map(|(f, _)| f),
        phase: phase.map(|(_, x)| x),
        delay,
        phase_crossover: gain.map(|(f, _)| f),
        gain: gain.map(|(_, x)| x),
        sensitivity_at,
        sensitivity,
    }
}

/// Ranges of frequency (Hz) in which the real part is negative, by more than the share `accuracy` of the magnitude: an impedance that
/// feeds oscillations there.
pub fn active_ranges(points: &[ResponsePoint], accuracy: f64) -> Vec<(f64, f64)> {
    let real: Vec<f64> = points.iter().map(|(_, x)| x.re + accuracy * x.norm()).collect();
    let mut ranges = Vec::new();
    let mut begun = points.first().filter(|_| real.first() < Some(&0.0)).map(|(f, _)| *f);
    for (f, _, k) in crossings(points, &real) {
        if real[k] > 0.0 {
            begun = Some(f);
        } else if let Some(from) = begun.take() {
            ranges.push((from, f));
        }
    }
    ranges.extend(begun.zip(points.last().map(|(f, _)| *f)));
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Frequencies from 0.1 Hz to 1 kHz.
    fn response(of: impl Fn(Complex64) -> Complex64) -> Vec<ResponsePoint> {
        let f = |k: i32| 10.0_f64.powf(-1.0 + f64::from(k) / 20.0);
        (0..=80).map(f).map(|f| (f, of(Complex64::new(0.0, TAU * f)))).collect()
    }

    fn near(found: Option<f64>, expected: f64, share: f64) {
        assert!(found.is_some_and(|x| (x / expected - 1.0).abs() < share), "{found:?}, not {expected}");
    }

    #[test]
    fn an_integrator_with_a_delay() {
        // L = w / s e^(-s d): crossover w, phase margin 90 deg - w d, gain margin pi / (2 w d).
        let (w, d) = (30.0, 0.01);
        let l = response(|s| w / s * (-s * d).exp());
        let found = margins(&l);
        near(found.crossover, w / TAU, 1e-3);
        near(found.phase, 90.0 - (w * d).to_degrees(), 2e-3);
        near(found.delay, (TAU / 4.0) / w - d, 2e-3);
        near(found.phase_crossover, 1.0 / (4.0 * d), 2e-3);
        near(found.gain, 20.0 * (TAU / 4.0 / (w * d)).log10(), 2e-3);
        // The same from the closed loop.
        let again: Vec<_> = l.iter().map(|(f, x)| (*f, open_loop(x / (1.0 + x)))).collect();
        near(margins(&again).phase, found.phase.unwrap(), 1e-9);
        // A delay larger than the margin makes it negative.
        assert!(margins(&response(|s| w / s * (-s * 0.06).exp())).phase.unwrap() < 0.0);
    }

    #[test]
    fn two_integrators_begin_at_minus_180() {
        // L = (s + a) k / s^2, whose phase starts at -180 deg; its principal value may have either sign.
        let l = response(|s| 40.0 * (s + 10.0) / (s * s) * Complex64::from_polar(1.0, -1e-9));
        assert!((phases(&l)[0] + 180.0).abs() < 5.0, "{}", phases(&l)[0]);
        let found = margins(&l);
        let w = (800.0 + (800.0_f64 * 800.0 + 160_000.0).sqrt()).sqrt();
        near(found.crossover, w / TAU, 2e-3);
        near(found.phase, (w / 10.0).atan().to_degrees(), 2e-3);
    }

    #[test]
    fn a_resonance_has_a_peak_and_a_bandwidth() {
        let (w, zeta) = (60.0, 0.2);
        let found = band(&response(|s| w * w / (s * s + 2.0 * zeta * w * s + w * w)));
        let peak = 1.0 / (2.0 * zeta * (1.0_f64 - zeta * zeta).sqrt());
        assert!((found.peak - 20.0 * peak.log10()).abs() < 0.1, "{found:?}");
        let a = 1.0 - 2.0 * zeta * zeta;
        near(found.bandwidth, w * (a + (a * a + 1.0_f64).sqrt()).sqrt() / TAU, 5e-3);
        // Without a fall of 3 dB there is no bandwidth.
        assert_eq!(band(&response(|s| 1.0 + 0.0 * s)).bandwidth, None);
    }

    #[test]
    fn an_impedance_is_active_where_its_real_part_is_negative() {
        let mass = response(|s| 1e-3 * s + 0.1);
        assert_eq!(active_ranges(&mass, 0.0), []);
        // A damper with a delay turns active at a quarter of its period.
        let late = active_ranges(&response(|s| 1e-3 * s + 0.1 * (-s * 0.01).exp()), 0.0);
        assert!((late[0].0 / 25.0 - 1.0).abs() < 0.02 && (late[0].1 / 75.0 - 1.0).abs() < 0.02, "{late:?}");
    }
}
