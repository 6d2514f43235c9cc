//! The position sensor of `estimator` = Sensored: ideal, encoder, three Hall sensors, or a resolver.
//!
//! It reads the electrical angle theta = theta_meas + angle_offset once per sample, as the current sensors do; the plant's angle stays
//! physical and continuous. With the pole rho = `sensor.bandwidth`, the tracker is a PLL with poles (s + rho)^2:
//!
//! | sensor | angle | speed |
//! |---|---|---|
//! | Encoder | middle of a count, (floor(theta / d) + 1/2) d with d = 2 pi n_p / counts | PLL on this angle |
//! | Hall | from the last edge on at the speed, at most to the next edge | pi/3 over the time between two edges |
//! | Resolver | PLL on s = sin theta, c = cos_gain cos(theta + quadrature), each rounded to 2^bits steps from -1 to 1 | the same PLL |
//!
//! The error of the PLL in a resolver is s cos theta^ - c sin theta^. The edges of a and those of b and c are pi/3 apart, except for the
//! errors `hall_b` and `hall_c`; a timer captures their instants, so the speed has no error of the sample period. It is 0 before the
//! second edge and after an edge that reverses, and falls as pi/3 over the time without an edge. The index of an encoder is known: count 0 is
//! at theta = 0. Without a speed, the angle of Hall sensors is wrong by up to pi/6. Angles in rad, electrical.

use crate::estimator::tracker::Tracker;
use crate::signals::ControllerInputs;
use drive_base::math::{sin_cos, wrap};
use fmu_core::unit::{ONE, RAD_PER_S, RADIAN};
use fmu_core::{Field, Row, Table, enumeration, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_3, PI, TAU};

enumeration! {
    /// The position sensors; values never change.
    #[derive(Default, Serialize, Deserialize)]
    pub enum PositionSensor("PositionSensor", "Sensor of the rotor's angle and speed") {
        #[default]
        1 Ideal "theta_meas and speed_meas as they are";
        2 Encoder "Incremental encoder with a known index";
        3 Hall "Three Hall sensors";
        4 Resolver "Resolver with as many pole pairs as the machine";
    }
}

/// Parameters of the position sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PositionParameters {
    /// The sensor.
    pub kind: PositionSensor,
    /// Error of its mounting in rad (electrical).
    pub angle_offset: f64,
    /// Edges of both tracks of an encoder in a mechanical turn, >= 4.
    pub counts: i32,
    /// Pole in rad/s, > 0.
    pub bandwidth: f64,
    /// Error in rad of the edges of b and c.
    pub hall: [f64; 2],
    /// Amplitude of the cosine divided by that of the sine.
    pub cos_gain: f64,
    /// Error in rad of the angle between sine and cosine.
    pub quadrature: f64,
    /// Resolution of both in bits, 4 to 24.
    pub bits: i32,
}

impl Default for PositionParameters {
    fn default() -> Self {
        Self {
            kind: PositionSensor::Ideal,
            angle_offset: 0.0,
            counts: 4096,
            bandwidth: TAU * 100.0,
            hall: [0.0; 2],
            cos_gain: 1.0,
            quadrature: 0.0,
            bits: 12,
        }
    }
}

/// Largest product of pole and sample period: twice that, the PLL is no longer stable.
pub(crate) const FASTEST: f64 = 0.5;

impl PositionParameters {
    /// Whether a tracker follows the angle.
    pub(crate) fn tracks(&self) -> bool {
        matches!(self.kind, PositionSensor::Encoder | PositionSensor::Resolver)
    }

    /// Angle of edge `k` in rad.
    fn edge(&self, k: f64) -> f64 {
        let [b, c] = self.hall;
        k * FRAC_PI_3
            + match k.rem_euclid(3.0) {
                n if n < 0.5 => 0.0,
                n if n < 1.5 => c,
                _ => b,
            }
    }
}

/// Hall sensors since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Halls {
    /// Number of the sector: from the edge of the same number to the next.
    sector: f64,
    /// The last edge, and the time in s since then.
    edge: Option<f64>,
    since: f64,
    /// Direction in which it was passed.
    forward: bool,
}

/// State of the sensor at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Position {
    /// Angle at the sensor in rad, not wrapped; `None` before the first sample.
    theta: Option<f64>,
    /// Its reading: angle in rad and electrical speed in rad/s.
    pub(crate) seen: (f64, f64),
    tracker: Tracker,
    halls: Halls,
}

impl Position {
    /// Reads the sensor at a sample, `T_s` (s) after the last one, on a machine with `n_p` pole pairs.
    pub(crate) fn read(&mut self, par: &PositionParameters, inputs: &ControllerInputs, n_p: i32, T_s: f64) {
        let (at, n_p) = (inputs.theta_meas + par.angle_offset, f64::from(n_p));
        let w = n_p * inputs.speed_meas;
        let theta = self.theta.map_or_else(|| wrap(at), |last| last + wrap(at - last));
        let first = self.theta.is_none();
        self.theta = Some(theta);
        self.seen = match par.kind {
            PositionSensor::Ideal => (theta, w),
            PositionSensor::Encoder => {
                let count = TAU * n_p / f64::from(par.counts);
                let seen = ((theta / count).floor() + 0.5) * count;
                self.track(par, T_s, first.then_some(seen), |tracked| seen - tracked);
                (seen, self.tracker.w)
            }
            PositionSensor::Hall => self.sectors(par, (theta, w), first, T_s),
            PositionSensor::Resolver => {
                let step = (1_u32 << par.bits.clamp(1, 31)) / 2;
                let rounded = |x: f64| (x * f64::from(step)).round() / f64::from(step);
                let (s, c) = (rounded(sin_cos(theta).0), rounded(par.cos_gain * sin_cos(theta + par.quadrature).1));
                self.track(par, T_s, first.then_some(theta), |tracked| {
                    let (sin, cos) = sin_cos(tracked);
                    s * cos - c * sin
                });
                (self.tracker.theta, self.tracker.w)
            }
        };
    }

    /// Follows the angle with this `error` (rad) of the tracked one, or begins at the angle `first` (rad).
    fn track(&mut self, par: &PositionParameters, T_s: f64, first: Option<f64>, error: impl Fn(f64) -> f64) {
        if let Some(theta) = first {
            self.tracker = Tracker::at(theta, 0.0, T_s);
            return;
        }
        self.tracker.advance(T_s);
        self.tracker.pull(par.bandwidth, error(self.tracker.theta), T_s);
    }

    /// The reading of Hall sensors at the angle `theta` (rad), turning at `w` (rad/s).
    fn sectors(&mut self, par: &PositionParameters, (theta, w): (f64, f64), first: bool, T_s: f64) -> (f64, f64) {
        let halls = &mut self.halls;
        let mut sector = (theta / FRAC_PI_3).floor();
        if theta < par.edge(sector) {
            sector -= 1.0;
        } else if theta >= par.edge(sector + 1.0) {
            sector += 1.0;
        }
        let (passed, before, mut speed) = (sector - halls.sector, halls.since + T_s, self.seen.1);
        if first || passed == 0.0 {
            halls.since = before;
            let least = FRAC_PI_3 / before;
            speed = speed.clamp(-least, least);
        } else {
            let forward = passed > 0.0;
            let edge = if forward { sector } else { sector + 1.0 };
            // Since the edge, at the present speed.
            let since = if w == 0.0 { 0.0 } else { ((theta - par.edge(edge)) / w).clamp(0.0, T_s) };
            let same = halls.edge.is_some() && forward == halls.forward;
            speed = if same { passed * FRAC_PI_3 / (before - since).max(1e-3 * T_s) } else { 0.0 };
            (halls.edge, halls.since, halls.forward) = (Some(edge), since, forward);
        }
        halls.sector = sector;
        let (low, high) = (sector * FRAC_PI_3, (sector + 1.0) * FRAC_PI_3);
        let moved = halls.edge.filter(|_| speed != 0.0).map(|edge| edge * FRAC_PI_3 + speed * halls.since);
        (moved.unwrap_or(0.5 * (low + high)).clamp(low, high), speed)
    }
}

type P = Row<PositionParameters>;

/// Variables of the position sensor.
pub const POSITION: &Table<PositionParameters> = table![
    P::enumeration_parameter(
        "sensor.position",
        "Sensor of angle and speed for estimator = Sensored",
        &Field(|p| &mut p.kind)
    ),
    P::parameter("sensor.angle_offset", &RADIAN, "Error of the mounting of the position sensor, electrical", |p| {
        &mut p.angle_offset
    }),
    P::integer_parameter(
        "sensor.counts",
        "Edges of both tracks of an encoder in a mechanical turn: four times its lines",
        |p| { &mut p.counts }
    )
    .at_least(4.0),
    P::parameter("sensor.bandwidth", &RAD_PER_S, "Pole of the tracking loop of an encoder or a resolver", |p| &mut p
        .bandwidth)
    .above(0.0),
    P::parameter(
        "sensor.hall_b",
        &RADIAN,
        "Error of the edges of Hall sensor b relative to those of a, electrical",
        |p| { &mut p.hall[0] }
    )
    .at_least(-0.5)
    .at_most(0.5),
    P::parameter(
        "sensor.hall_c",
        &RADIAN,
        "Error of the edges of Hall sensor c relative to those of a, electrical",
        |p| { &mut p.hall[1] }
    )
    .at_least(-0.5)
    .at_most(0.5),
    P::parameter("sensor.cos_gain", &ONE, "Amplitude of a resolver's cosine divided by that of its sine", |p| {
        &mut p.cos_gain
    })
    .above(0.0),
    P::parameter("sensor.quadrature", &RADIAN, "Error of the angle between a resolver's sine and cosine", |p| {
        &mut p.quadrature
    })
    .at_least(-PI / 4.0)
    .at_most(PI / 4.0),
    P::integer_parameter("sensor.bits", "Resolution of a resolver's sine and cosine in bits, from -1 to 1", |p| &mut p
        .bits)
    .at_least(4.0)
    .at_most(24.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    const T_S: f64 = 1e-4;

    /// The readings at a constant electrical speed `w` (rad/s) with 3 pole pairs: errors of angle and speed over the last half of
    /// `n` samples, the greatest and the means.
    fn errors(par: &PositionParameters, w: f64, n: u32) -> ([f64; 2], [f64; 2]) {
        let (mut position, mut most, mut mean) = (Position::default(), [0.0_f64; 2], [0.0; 2]);
        for k in 0..n {
            let theta = 0.3 + w * T_S * f64::from(k);
            let inputs =
                ControllerInputs { theta_meas: wrap(theta), speed_meas: w / 3.0, ..ControllerInputs::default() };
            position.read(par, &inputs, 3, T_S);
            if k >= n / 2 {
                let (seen, speed) = position.seen;
                for (x, (most, mean)) in
                    [wrap(seen - theta), speed - w].into_iter().zip(most.iter_mut().zip(mean.iter_mut()))
                {
                    *most = most.max(x.abs());
                    *mean += x / f64::from(n - n / 2);
                }
            }
        }
        (most, mean)
    }

    fn sensor(kind: PositionSensor) -> PositionParameters {
        PositionParameters { kind, ..PositionParameters::default() }
    }

    #[test]
    fn an_encoder_is_within_half_a_count() {
        for w in [300.0, -20.0, 3.0] {
            let (most, mean) = errors(&sensor(PositionSensor::Encoder), w, 20_000);
            let half = 0.5 * TAU * 3.0 / 4096.0;
            assert!(most[0] <= half + 1e-9 && most[0] > 0.9 * half, "{w}: {most:?}");
            assert!(mean[1].abs() < 0.01 && most[1] < 3.0, "{w}: {most:?} {mean:?}");
        }
        let (most, _) = errors(&sensor(PositionSensor::Encoder), 0.0, 20_000);
        assert!(most[1] < 1e-9, "it rests: {most:?}");
    }

    #[test]
    fn hall_sensors_are_exact_at_constant_speed() {
        for w in [300.0, -50.0] {
            let (most, _) = errors(&sensor(PositionSensor::Hall), w, 20_000);
            assert!(most[0] < 1e-6 && most[1] < 1e-5, "{w}: {most:?}");
        }
        // Without a speed, up to half a sector.
        let (most, _) = errors(&sensor(PositionSensor::Hall), 0.0, 10);
        assert!((most[0] - (PI / 6.0 - 0.3)).abs() < 1e-9 && most[1] < 1e-9, "{most:?}");
    }

    /// Edges that are too late: the angle is wrong by the error at most, and the speed changes three times per half turn.
    #[test]
    fn misplaced_hall_sensors_ripple() {
        let par = PositionParameters { hall: [0.1, -0.05], ..sensor(PositionSensor::Hall) };
        let (most, mean) = errors(&par, 300.0, 20_000);
        assert!(most[0] > 0.09 && most[0] < 0.3, "{most:?}");
        // The longest sector, from c to b, is 0.15 too long: the speed is pi/3 over its time.
        let slow = 300.0 * (1.0 - FRAC_PI_3 / (FRAC_PI_3 + 0.15));
        assert!((most[1] / slow - 1.0).abs() < 1e-3 && mean[1].abs() < 0.05 * 300.0, "{most:?} {slow}");
    }

    /// A rotor that stops: the speed falls as pi/3 over the time; one that reverses has no speed at its first edge.
    #[test]
    fn hall_sensors_notice_a_rotor_that_stops_and_reverses() {
        let (par, mut position) = (sensor(PositionSensor::Hall), Position::default());
        let mut at = |theta: f64, speed: f64| {
            let inputs =
                ControllerInputs { theta_meas: wrap(theta), speed_meas: speed / 3.0, ..ControllerInputs::default() };
            position.read(&par, &inputs, 3, T_S);
            position.seen
        };
        let mut theta = 0.0;
        for _ in 0..1000 {
            theta += 0.03;
            at(theta, 300.0);
        }
        let mut last = at(theta, 0.0);
        for _ in 0..2000 {
            last = at(theta, 0.0);
        }
        assert!(last.1 > 0.0 && last.1 <= FRAC_PI_3 / 0.2 * 1.01, "{last:?}");
        let mut speeds = Vec::new();
        for _ in 0..200 {
            theta -= 0.03;
            speeds.push(at(theta, -300.0).1);
        }
        assert!(speeds.contains(&0.0) && (speeds[199] + 300.0).abs() < 1e-6, "{speeds:?}");
    }

    /// From tan theta^ = sin theta / (g cos(theta + q)): to first order, theta^ - theta = (1 - g)/2 sin 2 theta + q/2 (1 - cos 2 theta).
    #[test]
    fn a_resolver_has_the_errors_of_its_signals() {
        let ideal = PositionParameters { bits: 24, ..sensor(PositionSensor::Resolver) };
        let (most, _) = errors(&ideal, 300.0, 20_000);
        assert!(most[0] < 1e-5 && most[1] < 1e-2, "{most:?}");
        let (most, _) = errors(&sensor(PositionSensor::Resolver), 300.0, 20_000);
        assert!(most[0] < 1.0 / 2048.0 && most[0] > 1e-5, "{most:?}");
        // Far below the pole, the angle is that of the signals.
        let gain = PositionParameters { cos_gain: 0.98, ..ideal.clone() };
        let ((most, _), (_, mean)) = (errors(&gain, 5.0, 40_000), errors(&gain, 5.0, 40_000));
        assert!((most[0] - 0.01).abs() < 3e-4 && mean[0].abs() < 1e-3, "{most:?}");
        let skew = PositionParameters { quadrature: 0.02, ..ideal };
        let (most, _) = errors(&skew, 5.0, 40_000);
        assert!((most[0] - 0.02).abs() < 5e-4, "{most:?}");
    }

    #[test]
    fn a_tracking_loop_too_fast_for_the_samples_is_refused() {
        let mut controller = crate::SensorlessController::default();
        let par = &mut controller.parameters;
        (par.estimator, par.position.bandwidth) = (crate::estimator::Kind::Sensored, 5001.0);
        for (kind, refused) in [
            (PositionSensor::Ideal, false),
            (PositionSensor::Encoder, true),
            (PositionSensor::Hall, false),
            (PositionSensor::Resolver, true),
        ] {
            controller.parameters.position.kind = kind;
            let error = fmu_core::Model::validate(&controller).err().map(|fault| fault.message().to_owned());
            assert_eq!(error.is_some(), refused, "{kind:?}: {error:?}");
            let names =
                |e: &String| e.contains("sensor.bandwidth = 5001 rad/s") && e.contains("5000") && e.contains("T_s");
            assert!(error.is_none_or(|e| names(&e)), "{kind:?}");
        }
    }

    #[test]
    fn an_ideal_sensor_has_only_its_mounting() {
        let par = PositionParameters { angle_offset: 0.2, ..sensor(PositionSensor::Ideal) };
        let (most, mean) = errors(&par, 300.0, 100);
        assert!((most[0] - 0.2).abs() < 1e-9 && (mean[0] - 0.2).abs() < 1e-9 && most[1] < 1e-9, "{most:?}");
    }
}
