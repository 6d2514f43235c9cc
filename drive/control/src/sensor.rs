//! The current sensors and their analog-to-digital converter: gain, offset, noise, quantization.
//!
//! measured = round((gain i + offset + noise) / resolution) resolution, per phase. The sensors belong to the
//! controller's input stage, where samples are taken: the plant's currents stay physical and continuous. The noise of
//! sample k depends only on seed, k and phase, so it is the same for every communication step and after every state
//! restore.
//!
//! Noise: normally distributed, generated from a counter by SplitMix64 (Steele, Lea, Flood 2014) and Box & Muller.

use drive_base::frame::Phases;
use drive_base::math::{ln, sin_cos};
use fmu_core::draw::{GOLDEN, mix};
use fmu_core::unit::{AMPERE, ONE, SECOND};
use fmu_core::{Field, Row, Table, enumeration, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

enumeration! {
    /// The phases with a current sensor; values never change.
    #[derive(Default, Serialize, Deserialize)]
    pub enum MeasuredPhases("MeasuredPhases", "Phases with a current sensor") {
        #[default]
        1 Three "All three phases";
        2 Two "Phases a and b: i_c = -i_a - i_b, with the errors of both";
        3 One "None: one shunt in the DC link, read while an active vector lasts";
    }
}

/// Parameters; by default the sensors are ideal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensor {
    /// Gain of each phase.
    pub gain: Phases,
    /// Offset of each phase in A.
    pub offset: Phases,
    /// Standard deviation of each phase's noise in A, >= 0.
    pub noise: f64,
    /// Seed of the noise.
    pub seed: i32,
    /// Step of the converter in A, >= 0; 0: none.
    pub resolution: f64,
    /// The phases that have one.
    pub phases: MeasuredPhases,
    /// Minimum duration in s of an active vector in which one shunt is read, >= 0.
    pub window: f64,
}

impl Default for Sensor {
    fn default() -> Self {
        let gain = Phases { a: 1.0, b: 1.0, c: 1.0 };
        let (offset, phases) = (Phases::default(), MeasuredPhases::Three);
        Self { gain, offset, noise: 0.0, seed: 1, resolution: 0.0, phases, window: 0.0 }
    }
}

impl Sensor {
    /// The measured values of the currents `i` (A) at sample `k`.
    #[inline]
    pub fn measure(&self, i: Phases, k: u64) -> Phases {
        let mut i = Phases {
            a: self.gain.a * i.a + self.offset.a,
            b: self.gain.b * i.b + self.offset.b,
            c: self.gain.c * i.c + self.offset.c,
        };
        if self.noise > 0.0 {
            let [a, b, c] = self.normal(k);
            i = Phases { a: i.a + self.noise * a, b: i.b + self.noise * b, c: i.c + self.noise * c };
        }
        if self.resolution > 0.0 {
            let step = |x: f64| (x / self.resolution).round() * self.resolution;
            i = Phases { a: step(i.a), b: step(i.b), c: step(i.c) };
        }
        if self.phases == MeasuredPhases::Two {
            i.c = -i.a - i.b;
        }
        i
    }

    /// Three standard normal numbers for sample `k`.
    fn normal(&self, k: u64) -> [f64; 3] {
        let seed = mix(u64::from(self.seed.cast_unsigned()).wrapping_mul(GOLDEN));
        let uniform = |of: u64| uniform(seed.wrapping_add(k.wrapping_mul(4)).wrapping_add(of));
        let radius = |u: f64| (-2.0 * ln(u)).sqrt();
        let ((sin, cos), first) = (sin_cos(TAU * uniform(0)), radius(uniform(1)));
        [first * cos, first * sin, radius(uniform(2)) * sin_cos(TAU * uniform(3)).0]
    }
}

/// A number in (0, 1) from 32 bits of the generator.
fn uniform(counter: u64) -> f64 {
    let [.., a, b, c, d] = mix(counter.wrapping_mul(GOLDEN)).to_le_bytes();
    (f64::from(u32::from_le_bytes([a, b, c, d])) + 0.5) / 4_294_967_296.0
}

/// Running mean of the measured currents while the drive rests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Offset {
    /// Mean in A.
    pub(crate) i: Phases,
    /// Number of stored samples, at most `MEMORY`.
    n: f64,
}

impl Offset {
    /// Time in s over which the mean extends: currents that decay after the drive was switched off are forgotten.
    const MEMORY: f64 = 0.02;

    /// One more sample of currents (A) with the sample period `T_s` (s).
    pub(crate) fn update(&mut self, measured: Phases, T_s: f64) {
        self.n = (self.n + 1.0).min((Self::MEMORY / T_s).max(1.0));
        let toward = |mean: f64, x: f64| mean + (x - mean) / self.n;
        let Phases { a, b, c } = self.i;
        self.i = Phases { a: toward(a, measured.a), b: toward(b, measured.b), c: toward(c, measured.c) };
    }
}

type P = Row<Sensor>;

/// Variables of the sensors; their owner supplies the prefix `sensor.`.
pub const SENSOR: &Table<Sensor> = table![
    P::parameter("gain_a", &ONE, "Gain of the current sensor of phase a", |p| &mut p.gain.a),
    P::parameter("gain_b", &ONE, "Gain of the current sensor of phase b", |p| &mut p.gain.b),
    P::parameter("gain_c", &ONE, "Gain of the current sensor of phase c", |p| &mut p.gain.c),
    P::parameter("offset_a", &AMPERE, "Offset of the current sensor of phase a", |p| &mut p.offset.a),
    P::parameter("offset_b", &AMPERE, "Offset of the current sensor of phase b", |p| &mut p.offset.b),
    P::parameter("offset_c", &AMPERE, "Offset of the current sensor of phase c", |p| &mut p.offset.c),
    P::parameter("noise", &AMPERE, "Standard deviation of the noise of each current sample; 0: none", |p| {
        &mut p.noise
    })
    .at_least(0.0),
    P::integer_parameter("seed", "Seed of the noise: the same seed gives the same noise", |p| &mut p.seed),
    P::parameter("resolution", &AMPERE, "Step of the current measurement; 0: none", |p| &mut p.resolution)
        .at_least(0.0),
    P::enumeration_parameter("phases", "Phases with a current sensor", &Field(|p| &mut p.phases)),
    P::parameter(
        "window",
        &SECOND,
        "Minimum duration of an active vector in which the shunt of phases = One is read",
        |p| { &mut p.window }
    )
    .at_least(0.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_the_start_the_sensors_are_ideal() {
        let i = Phases { a: 0.123, b: -4.0, c: 3.877 };
        assert_eq!(Sensor::default().measure(i, 7), i);
    }

    #[test]
    fn the_noise_is_normal_white_and_repeatable() {
        let sensor = Sensor { noise: 0.01, ..Sensor::default() };
        let n = 100_000;
        let (mut sums, mut squares, mut lag, mut cross, mut tails) = ([0.0; 3], [0.0; 3], 0.0, 0.0, 0);
        let mut last = 0.0;
        for k in 0..n {
            let Phases { a, b, c } = sensor.measure(Phases::default(), k);
            for (x, (sum, square)) in [a, b, c].into_iter().zip(sums.iter_mut().zip(squares.iter_mut())) {
                *sum += x / 0.01;
                *square += x * x / 1e-4;
                tails += u32::from(x.abs() > 0.02);
            }
            lag += a * last / 1e-4;
            cross += (a * b + b * c + a * c) / 1e-4;
            last = a;
        }
        let n = 1e5;
        for (sum, square) in sums.into_iter().zip(squares) {
            assert!((sum / n).abs() < 0.015 && (square / n - 1.0).abs() < 0.02, "{sum} {square}");
        }
        assert!((lag / n).abs() < 0.015 && (cross / n).abs() < 0.03, "{lag} {cross}");
        assert!((f64::from(tails) / (3.0 * n) - 0.0455).abs() < 0.002, "two sigmas: {tails}");
        assert_eq!(sensor.measure(Phases::default(), 5), sensor.clone().measure(Phases::default(), 5));
        let other = Sensor { seed: 2, ..sensor.clone() };
        assert_ne!(sensor.measure(Phases::default(), 5), other.measure(Phases::default(), 5));
    }

    #[test]
    fn steps_of_the_converter() {
        let sensor = Sensor { resolution: 40.0 / 4096.0, ..Sensor::default() };
        let measured = sensor.measure(Phases { a: 1.0, b: 0.004, c: -0.006 }, 0);
        assert!((measured.a - 1.0).abs() <= 0.5 * 40.0 / 4096.0 && measured.b.abs() < 1e-12 && measured.c < -0.009);
    }

    #[test]
    fn two_sensors_leave_the_third_current_to_the_sum() {
        let mut sensor = Sensor { offset: Phases { a: 0.1, b: 0.0, c: 9.0 }, ..Sensor::default() };
        sensor.phases = MeasuredPhases::Two;
        let Phases { a, b, c } = sensor.measure(Phases { a: 1.0, b: 2.0, c: -3.0 }, 0);
        assert!((a - 1.1).abs() < 1e-15 && (b - 2.0).abs() < 1e-15 && (c + 3.1).abs() < 1e-15, "{a} {b} {c}");
    }

    /// The mean is exact at once, and forgets currents that were still flowing at first.
    #[test]
    fn offsets_are_a_running_mean() {
        let mut offset = Offset::default();
        let at = |a: f64| Phases { a, b: -a, c: 0.01 };
        offset.update(at(0.02), 1e-4);
        assert!((offset.i.a - 0.02).abs() < 1e-15 && (offset.i.c - 0.01).abs() < 1e-15);
        offset.update(at(0.04), 1e-4);
        assert!((offset.i.a - 0.03).abs() < 1e-15 && (offset.i.b + 0.03).abs() < 1e-15);
        offset.update(at(5.0), 1e-4);
        for _ in 0..3000 {
            offset.update(at(0.02), 1e-4);
        }
        assert!((offset.i.a - 0.02).abs() < 1e-5, "{}", offset.i.a);
    }

    #[test]
    fn each_phase_has_its_gain_and_its_offset() {
        let sensor = Sensor {
            gain: Phases { a: 1.1, b: 0.9, c: 1.2 },
            offset: Phases { a: 0.1, b: -0.2, c: 0.3 },
            ..Sensor::default()
        };
        let Phases { a, b, c } = sensor.measure(Phases { a: 1.0, b: 2.0, c: -3.0 }, 4);
        assert!((a - 1.2).abs() < 1e-12 && (b - 1.6).abs() < 1e-12 && (c + 3.3).abs() < 1e-12, "{a} {b} {c}");
    }
}
