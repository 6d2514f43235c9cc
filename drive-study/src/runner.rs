//! The test bench of the Kim & Sul figures: the 2.2 kW machine, a preset per estimator, and the measurements of a run.
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

/// Rated mechanical speed in rad/s: 1500 rpm.
pub const RATED_SPEED: f64 = TAU * 25.0;
/// Rated torque in N.m.
pub const RATED_TORQUE: f64 = 14.0;
/// Voltage that an inverter leg loses to 2 us dead time, in V.
const U_DEAD: f64 = 10.8;

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
    // Its figures are those of the low-speed law alone.
    par.current.mtpa = kind != Kind::FluxObserver;
    (par.speed_loop.bandwidth, par.speed_loop.t_is, par.speed_loop.b) = (TAU * 5.0, 4.0, 1.0);
    (par.limit.i_q, par.limit.i, par.limit.tau) = (15.0, 15.0, 1.6 * RATED_TORQUE);
    (par.sensor.noise, par.sensor.resolution) = (0.01, 40.0 / 4096.0);
    // The error left by an uncompensated dead time is no sign of a lost rotor.
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
        // Nothing lags behind the flux; the resistance and the magnet flux come slowly enough to tell them apart.
        par.estimators.tracker.bandwidth = TAU * 60.0;
        par.estimators.adaptation.bandwidth = 5.0;
    }
    if kind == Kind::GradientObserver {
        par.estimators.tracker.bandwidth = TAU * 40.0;
    }
    if kind == Kind::Hybrid {
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
    pair.plant.model.parameters.inverter.dead_time = 2e-6;
    pair.controller.model.parameters.compensation.u_dead = if compensated { U_DEAD } else { 0.0 };
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

/// Linear ramp from `a` at time `from` to `b` at time `to`, constant outside.
pub fn line(t: f64, from: f64, a: f64, to: f64, b: f64) -> f64 {
    a + (b - a) * ((t - from) / (to - from)).clamp(0.0, 1.0)
}

/// Angle of the rotor ahead of the estimate: theta - theta^ in deg, wrapped.
pub fn rotor_ahead(pair: &Pair) -> f64 {
    wrap(pair.plant.out.theta_e - pair.controller.out.theta_est).to_degrees()
}

/// True speed in pu.
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

/// The same, in steps of the sample period.
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

    /// Standard deviation.
    pub fn std(&self) -> f64 {
        (self.squares / self.n - self.mean() * self.mean()).max(0.0).sqrt()
    }
}

/// A load that ramps to `load` (pu) between 0.1 and 0.4 s.
fn ramp(load: f64, t: f64) -> f64 {
    load * RATED_TORQUE * ((t - 0.1) / 0.3).clamp(0.0, 1.0)
}

/// The steady state at `speed` and `load` (pu).
#[derive(Clone, Copy, Debug, Default)]
pub struct Steady {
    /// Angle error in deg.
    pub error: Statistics,
    /// Deviation of the true speed from its reference in pu.
    pub speed: Statistics,
}

impl Steady {
    /// Whether the drive follows speed and rotor.
    pub fn holds(&self) -> bool {
        self.error.peak < 30.0 && self.speed.peak < 0.02
    }
}

/// Runs at `speed`, takes `load` (both pu), settles until 2 s and measures for 0.5 s.
pub fn steady(pair: Pair, speed: f64, load: f64) -> Steady {
    let (mut pair, mut steady) = (turning(pair, speed), Steady::default());
    run(&mut pair, 2.5, |t, p| {
        p.plant.model.inputs.tau_load = ramp(load, t);
        if t > 2.0 {
            steady.error.add(rotor_ahead(p));
            steady.speed.add(self::speed(p) - speed);
        }
    });
    steady
}

/// Takes rated load at 0.5 pu, slows down to `speed` (pu) at 0.5 pu/s, settles for 1.5 s and measures for 0.5 s.
pub fn slowed_down(pair: Pair, speed: f64) -> Steady {
    let (mut pair, mut steady) = (turning(pair, 0.5), Steady::default());
    let arrival = 1.2 + (0.5 - speed) / 0.5;
    run(&mut pair, arrival + 2.0, |t, p| {
        p.plant.model.inputs.tau_load = ramp(1.0, t);
        p.controller.model.inputs.speed_ref = RATED_SPEED * (0.5 - 0.5 * (t - 1.2)).clamp(speed, 0.5);
        if t > arrival + 1.5 {
            steady.error.add(rotor_ahead(p));
            steady.speed.add(self::speed(p) - speed);
        }
    });
    steady
}

/// Lowest of the `speeds` (pu, descending) down to which rated load is held.
pub fn lowest_speed(pair: &Pair, speeds: &[f64]) -> Option<f64> {
    speeds.iter().copied().take_while(|&speed| slowed_down(pair.clone(), speed).holds()).last()
}

/// A load step at `speed` (pu): dip of the true speed in pu, peak angle error in deg relative to its mean before the
/// step.
pub fn load_step(pair: Pair, speed: f64, load: f64) -> (f64, f64) {
    let (mut pair, mut dip, mut peak) = (turning(pair, speed), 0.0_f64, 0.0_f64);
    run(&mut pair, 2.0, |t, p| {
        p.plant.model.inputs.tau_load = if t >= 0.5 - 1e-9 { load * RATED_TORQUE } else { 0.0 };
        if t > 0.5 {
            dip = dip.max(speed - self::speed(p));
            peak = peak.max(rotor_ahead(p).abs());
        }
    });
    (dip, peak)
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

/// Bandwidth (-3 dB) of the closed speed loop in Hz around `speed` (pu), with ideal sensors: with noise, the result depends on
/// the seed, 42 to 64 Hz for the heterodyne demodulation, because a run of half a second determines the gain only to 15 %.
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
