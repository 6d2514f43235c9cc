//! The closed loop on a test bench: a [`Bench`] follows a course of speed and load, and shows each [`Moment`] of its run.
//! Presets of the 2.2 kW machine, one per estimator, with the gains behind the figures of the Kim & Sul review.
//!
//! Speeds are relative to rated speed, torques to rated torque (pu); angle errors are theta - theta^ in degrees, as in
//! Kim & Sul.

use drive::estimator::Kind;
use drive::estimator::kalman::KalmanParameters;
use drive::estimator::tracker::TrackerKind;
use drive::math::{sin_cos, wrap};
use drive::motor::Motor;
use drive::pair::Pair;
use fmu_core::{Elapsed, Fault, Step};
use std::f64::consts::TAU;

/// Rated mechanical speed of the reference motor in rad/s, 3000 rpm, as in `motors/reference.toml`.
pub const REFERENCE_SPEED: f64 = TAU * 50.0;
/// Rated torque of the reference motor in N.m, as in `motors/reference.toml`.
pub const REFERENCE_TORQUE: f64 = 2.5;
/// Load step of the paper in N.m: 1 pu of torque of the reference motor in `fmu compare` and `fmu atlas`.
pub const PAPER_LOAD: f64 = 2.0;
/// Rated mechanical speed of the 2.2 kW machine in rad/s: 1500 rpm.
pub const RATED_SPEED: f64 = TAU * 25.0;
/// Rated torque of the 2.2 kW machine in N.m.
pub const RATED_TORQUE: f64 = 14.0;

/// The 2.2 kW machine with interior magnets.
pub fn machine() -> Motor {
    Motor::IPMSM_2_2_KW
}

/// The drive at rest, with the gains behind the figures, for one estimator.
pub fn drive(kind: Kind) -> Pair {
    let mut pair = Pair::default();
    let plant = &mut pair.plant.model;
    plant.parameters.motor = machine();
    let mechanics = &mut plant.parameters.mechanics;
    (mechanics.J, mechanics.B, mechanics.tau_coulomb) = (15e-3, 0.0, 0.0);
    plant.inputs.u_dc = 540.0;

    let controller = &mut pair.controller.model;
    controller.inputs.u_dc = 540.0;
    let par = &mut controller.parameters;
    par.estimator = kind;
    (par.motor, par.J) = (machine(), 15e-3);
    par.current.bandwidth = TAU * 200.0;
    par.current.active_resistance = true;
    // The figures of the flux observer use only its low-speed law.
    par.current.mtpa = kind != Kind::FluxObserver;
    (par.speed_loop.bandwidth, par.speed_loop.t_is, par.speed_loop.b) = (TAU * 5.0, 4.0, 1.0);
    (par.limit.i_q, par.limit.i, par.limit.tau) = (15.0, 15.0, 1.6 * RATED_TORQUE);
    (par.sensor.noise, par.sensor.resolution) = (0.01, 40.0 / 4096.0);
    // The error of an uncompensated dead time must not look like a lost rotor.
    par.lock.u = 15.0;
    (par.start.i, par.start.speed) = (8.0, 0.15 * RATED_SPEED);
    let w = 0.05 * 3.0 * RATED_SPEED;
    par.estimators.kalman = KalmanParameters::new(machine().psi_M, TAU * 20.0, w, 0.01, par.T_s);
    if kind == Kind::VoltageFeedback {
        par.current.active_resistance = false;
        par.current.reference_feed_forward = true;
        par.current.integral = 0.2;
        par.estimators.tracker.bandwidth = TAU * 15.0;
        par.estimators.emf.bandwidth = TAU * 300.0;
    }
    if kind == Kind::FluxObserver {
        // The flux is not filtered; the resistance and the magnet flux adapt slowly enough to be separable.
        par.estimators.tracker.bandwidth = TAU * 60.0;
        par.estimators.adaptation.bandwidth = 5.0;
    }
    if matches!(kind, Kind::GradientObserver | Kind::Hybrid) {
        par.estimators.tracker.bandwidth = TAU * 40.0;
    }
    if matches!(kind, Kind::SquareWaveInjection | Kind::NearPwmInjection) {
        par.estimators.tracker.bandwidth = TAU * 40.0;
        par.speed_loop.bandwidth = TAU * 12.0;
    }
    pair
}

/// The mechanical observer as tracker, with the bandwidth of the injection figures, and a speed loop of `bandwidth`
/// (rad/s).
pub fn with_mechanical_observer(mut pair: Pair, bandwidth: f64) -> Pair {
    let par = &mut pair.controller.model.parameters;
    (par.estimators.tracker.kind, par.estimators.tracker.bandwidth) = (TrackerKind::MechanicalObserver, TAU * 25.0);
    par.speed_loop.bandwidth = bandwidth;
    pair
}

/// Dead time of 2 us in the inverter, compensated in the controller or not.
pub fn with_dead_time(mut pair: Pair, compensated: bool) -> Pair {
    let plant = &mut pair.plant.model;
    plant.parameters.inverter.dead_time = 2e-6;
    let u_dead = plant.parameters.inverter.u_dead(plant.inputs.u_dc);
    pair.controller.model.parameters.compensation.u_dead = if compensated { u_dead } else { 0.0 };
    pair
}

/// The machine's saturation, which distinguishes the magnet's poles.
pub fn with_saturation(mut pair: Pair) -> Pair {
    let saturation = &mut pair.plant.model.parameters.saturation;
    (saturation.s_2, saturation.s_3) = (40.0, 40.0);
    pair
}

/// The drive running at `speed` (pu), with known angle and speed at the start.
pub fn turning(mut pair: Pair, speed: f64) -> Pair {
    pair.plant.model.parameters.initial.speed = speed * RATED_SPEED;
    let controller = &mut pair.controller.model;
    controller.parameters.speed_est = speed * RATED_SPEED;
    controller.inputs.speed_ref = speed * RATED_SPEED;
    pair
}

/// A drive at rest, with the values of 1 pu of speed and load.
#[derive(Clone)]
pub struct Bench {
    /// Plant and controller.
    pub pair: Pair,
    /// Rated mechanical speed in rad/s.
    pub speed: f64,
    /// Rated torque in N.m.
    pub torque: f64,
}

/// A run at one sample.
#[derive(Clone, Copy)]
pub struct Moment<'a> {
    /// Time in s.
    pub t: f64,
    /// Speed reference in pu.
    pub reference: f64,
    /// True speed in pu.
    pub speed: f64,
    /// Angle of the rotor ahead of the estimate: theta - theta^ in rad, wrapped.
    pub theta_tilde: f64,
    /// Plant and controller.
    pub pair: &'a Pair,
}

impl Moment<'_> {
    /// Angle error theta - theta^ in deg, wrapped.
    pub fn error(&self) -> f64 {
        self.theta_tilde.to_degrees()
    }

    /// Deviation of the speed from its reference in pu.
    pub fn deviation(&self) -> f64 {
        self.speed - self.reference
    }
}

impl Bench {
    /// Runs for `duration` (s) in steps of the sample period. Before every step and at the end, `course` gives speed reference and
    /// load in pu, and `see` gets the moment. Returns false when a step fails, which means that the drive was lost.
    ///
    /// # Errors
    /// The parameters are inconsistent.
    pub fn run(
        &self,
        duration: f64,
        mut course: impl FnMut(f64, &mut Pair) -> (f64, f64),
        mut see: impl FnMut(&Moment<'_>),
    ) -> Result<bool, Fault> {
        let mut pair = self.pair.clone();
        let T_s = pair.controller.model.parameters.T_s;
        run_in_steps(&mut pair, T_s, duration, |t, pair| {
            let (reference, load) = course(t, pair);
            pair.controller.model.inputs.speed_ref = reference * self.speed;
            pair.plant.model.inputs.tau_load = load * self.torque;
            let (plant, controller) = (&pair.plant.out, &pair.controller.out);
            let (speed, theta_tilde) = (plant.speed / self.speed, wrap(plant.theta_e - controller.theta_est));
            see(&Moment { t, reference, speed, theta_tilde, pair });
        })
    }
}

/// Linear ramp from `a` at time `from` to `b` at time `to`, constant outside.
pub fn line(t: f64, from: f64, a: f64, to: f64, b: f64) -> f64 {
    a + (b - a) * ((t - from) / (to - from)).clamp(0.0, 1.0)
}

/// 0 before the time `from`, 1 from then on. The exact instants of the samples are above or below by rounding.
pub fn step(t: f64, from: f64) -> f64 {
    if t >= from - 1e-9 { 1.0 } else { 0.0 }
}

/// Angle of the rotor ahead of the estimate: theta - theta^ in deg, wrapped.
pub fn rotor_ahead(pair: &Pair) -> f64 {
    wrap(pair.plant.out.theta_e - pair.controller.out.theta_est).to_degrees()
}

/// True speed in pu of the 2.2 kW machine.
pub fn speed(pair: &Pair) -> f64 {
    pair.plant.out.speed / RATED_SPEED
}

/// Runs a pair for `duration` (s) in steps of `h` (s). `each` gets the pair and the time before every step and at the
/// end. Returns false when a step fails, which means that the drive was lost.
///
/// # Errors
/// The parameters are inconsistent.
pub fn run_in_steps(
    pair: &mut Pair,
    h: f64,
    duration: f64,
    mut each: impl FnMut(f64, &mut Pair),
) -> Result<bool, Fault> {
    pair.start()?;
    let mut k = 0_u32;
    while f64::from(k) * h < duration - 0.5 * h {
        each(f64::from(k) * h, pair);
        if pair.step(h).is_err() {
            return Ok(false);
        }
        k += 1;
    }
    each(f64::from(k) * h, pair);
    Ok(true)
}

/// Runs a pair for `duration` (s) in steps of the sample period; `each` gets the pair and the time before every step and at the
/// end.
///
/// # Panics
/// If the parameters are inconsistent.
pub fn run(pair: &mut Pair, duration: f64, each: impl FnMut(f64, &mut Pair)) {
    let h = pair.controller.model.parameters.T_s;
    run_in_steps(pair, h, duration, each).expect("parameters that fit together");
}

/// Mean, standard deviation and maximum magnitude of a signal.
#[derive(Clone, Copy, Debug, Default)]
pub struct Statistics {
    n: f64,
    sum: f64,
    squares: f64,
    /// Maximum magnitude.
    pub peak: f64,
}

impl Statistics {
    /// Adds a value.
    pub fn add(&mut self, x: f64) {
        self.n += 1.0;
        self.sum += x;
        self.squares += x * x;
        self.peak = self.peak.max(x.abs());
    }

    /// Mean.
    pub fn mean(&self) -> f64 {
        self.sum / self.n
    }

    /// Root mean square.
    pub fn rms(&self) -> f64 {
        (self.squares / self.n).sqrt()
    }

    /// Number of values.
    pub fn count(&self) -> f64 {
        self.n
    }

    /// Standard deviation.
    pub fn std(&self) -> f64 {
        (self.squares / self.n - self.mean() * self.mean()).max(0.0).sqrt()
    }
}

/// Gain of the closed speed loop at `frequency` (Hz) around `speed` (pu), from the true speed.
fn speed_gain(pair: Pair, speed: f64, frequency: f64) -> f64 {
    // An amplitude of 0.02 pu, or less if that would need more than half the rated torque.
    let J = pair.plant.model.parameters.mechanics.J;
    let swing = (0.02 * RATED_SPEED).min(0.5 * RATED_TORQUE / (J * TAU * frequency));
    let (settle, periods) = (0.5, (0.5 * frequency).ceil().max(2.0));
    let end = settle + periods / frequency;
    let (mut pair, mut sine, mut cosine, mut n) = (turning(pair, speed), 0.0, 0.0, 0.0);
    run(&mut pair, end, |t, p| {
        let (sin, cos) = sin_cos(TAU * frequency * t);
        p.controller.model.inputs.speed_ref = speed * RATED_SPEED + swing * sin;
        if t >= settle {
            let w = p.plant.out.speed - speed * RATED_SPEED;
            (sine, cosine, n) = (sine + w * sin, cosine + w * cos, n + 1.0);
        }
    });
    2.0 * (sine * sine + cosine * cosine).sqrt() / (n * swing)
}

/// Bandwidth (-3 dB) of the closed speed loop in Hz around `speed` (pu), with ideal sensors. With noise, the result would depend on
/// the seed (42 to 64 Hz for the heterodyne demodulation), because a run of half a second determines the gain only to 15 %.
pub fn speed_bandwidth(pair: &Pair, speed: f64) -> f64 {
    const HALF_POWER: f64 = std::f64::consts::FRAC_1_SQRT_2;
    let mut pair = pair.clone();
    without_noise(&mut pair);
    let (mut low, mut gain) = (2.0, speed_gain(pair.clone(), speed, 2.0));
    while low < 300.0 {
        let high = 1.1 * low;
        let next = speed_gain(pair.clone(), speed, high);
        if next < HALF_POWER {
            return low + (high - low) * (gain - HALF_POWER) / (gain - next);
        }
        (low, gain) = (high, next);
    }
    f64::INFINITY
}

/// Current sensors without noise and steps.
fn without_noise(pair: &mut Pair) {
    let sensor = &mut pair.controller.model.parameters.sensor;
    (sensor.noise, sensor.resolution) = (0.0, 0.0);
}

/// RMS value in A of the current vector that an injection causes at standstill, including the time between samples.
///
/// # Panics
/// If a step fails.
pub fn injected_current(mut pair: Pair) -> f64 {
    const PARTS: u32 = 20;
    without_noise(&mut pair);
    let T_s = pair.controller.model.parameters.T_s;
    let (mut d, mut q) = (Statistics::default(), Statistics::default());
    run(&mut pair, 0.4, |t, p| {
        if t < 0.3 {
            return;
        }
        let mut plant = p.plant.clone();
        plant.model.inputs.u = p.controller.out.u;
        let mut now = Elapsed::ZERO;
        for _ in 0..PARTS {
            let step = Step { start: now, h: T_s / f64::from(PARTS) };
            plant.step(&step).expect("a step");
            now = step.end();
            d.add(plant.out.i_d);
            q.add(plant.out.i_q);
        }
    });
    d.std().hypot(q.std())
}
