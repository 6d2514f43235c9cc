//! A part of the run: radius, mean acceleration, mean speed and mean torque, without the observer.
//!
//! ```text
//! p(t)    = sum delta = c + d tau + psi e^(j theta)       c, d: start and drift; tau = -1..1 over the part
//! |p|^2   = 2 p c + 2 tau p d + const                     linear, five unknowns; again about the center found
//! theta   = a_0 + a_1 tau + a_2 tau^2 + a_3 tau^3         least squares of the angle about the moving center
//! ```
//!
//! For any course of the angle, a_2 of a least squares is its acceleration averaged with the weight (1 - tau^2)^2: the
//! second integral of the quadratic Legendre polynomial. Speed and torque are averaged with the same weight, so that
//! J w' + B w + tau_coulomb = tau holds for the means exactly, in spite of cogging and control in the part, and components with
//! a period much shorter than the part vanish. The torque 1.5 n_p (p - c - d tau) x i needs neither L_q nor psi_M.
//!
//! At most 256 points; when the buffer is full, every second point is dropped. The circle is Kasa's (1976, IEEE Trans. Instrum.
//! Meas. 25), extended by the drift here; noise s of p makes the radius (s/psi)^2 too large. A part of less than two turns
//! separates center and radius poorly.

use super::excitation::Rows;
use super::least_squares::Normal;
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::math::{atan2, wrap};
use serde::{Deserialize, Serialize};

/// Points of a part.
const POINTS: usize = 256;
/// Minimum number of points.
const FEWEST: usize = 24;
/// Fits of the center.
const PASSES: usize = 4;

/// The points of a part on their way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Points {
    /// At the end of a point, p (Wb) and the observer's angle (rad); over it, sums of p x i, p . i and i.
    rows: Rows<7, POINTS>,
    p: AlphaBeta,
    /// Samples of a point, and samples of the present one.
    every: f64,
    samples: f64,
    /// Sums over the present point: p x i, p . i, and i.
    products: [f64; 2],
    i: AlphaBeta,
}

/// Results of a part; angles are electrical, means weighted with (1 - tau^2)^2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Part {
    /// Acceleration in rad/s2 and its standard error, speed in rad/s.
    pub(super) acceleration: f64,
    pub(super) sigma: f64,
    pub(super) w: f64,
    /// (p - c - d tau) x i in Wb.A: the torque over 1.5 n_p.
    pub(super) torque: f64,
    /// Radius in Wb, and the root mean square deviation from it over the radius.
    pub(super) radius: f64,
    pub(super) deviation: f64,
    /// Current along the radius in A.
    pub(super) i_d: f64,
    /// Turns of the rotor.
    pub(super) turns: f64,
}

impl Points {
    /// A new part.
    pub(super) fn begin(&mut self) {
        self.rows.clear();
        (self.p, self.i, self.products) = (AlphaBeta::ZERO, AlphaBeta::ZERO, [0.0; 2]);
        (self.every, self.samples) = (1.0, 0.0);
    }

    /// Takes a sample: step `delta` (Wb) of the active flux, current `i` (A), the observer's angle `theta` (rad).
    pub(super) fn take(&mut self, delta: AlphaBeta, i: AlphaBeta, theta: f64) {
        self.p += delta;
        self.products = [self.products[0] + self.p.cross(i), self.products[1] + self.p.dot(i)];
        self.i += i;
        self.samples += 1.0;
        if self.samples < self.every {
            return;
        }
        if self.rows.len() == POINTS {
            self.every *= 2.0;
            self.rows.halve(|a, b| [b[0], b[1], b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5], a[6] + b[6]]);
            return;
        }
        let [cross, dot] = self.products;
        self.rows.push([self.p.alpha(), self.p.beta(), theta, cross, dot, self.i.alpha(), self.i.beta()]);
        (self.samples, self.products, self.i) = (0.0, [0.0; 2], AlphaBeta::ZERO);
    }

    /// Time of the part in s, for samples of `T` (s).
    pub(super) fn time(&self, T: f64) -> f64 {
        self.each().fold(0.0, |sum, _| sum + self.every) * T
    }

    /// tau, p in Wb, the observer's angle in rad, and the sums of each point.
    fn each(&self) -> impl Iterator<Item = (f64, AlphaBeta, f64, [f64; 2], AlphaBeta)> {
        let last = (1..self.rows.len()).fold(0.0, |sum, _| sum + 1.0);
        (0..self.rows.len()).scan(-1.0, move |tau, n| {
            let [a, b, theta, cross, dot, i_a, i_b] = self.rows.row(n);
            let now = *tau;
            *tau += 2.0 / last;
            Some((now, AlphaBeta::new(a, b), theta, [cross, dot], AlphaBeta::new(i_a, i_b)))
        })
    }

    /// The part that ends now, with the sample period `T` (s); `None` if it has too few points or no circle.
    pub(super) fn end(&self, T: f64) -> Option<Part> {
        if self.rows.len() < FEWEST {
            return None;
        }
        let share = 1.0 / self.each().fold(0.0, |sum, _| sum + 1.0);
        // Center and drift: first of the whole, whose turns are nearly a mean.
        let (mut c, mut d, mut squares) = (AlphaBeta::ZERO, AlphaBeta::ZERO, 0.0);
        for (tau, p, ..) in self.each() {
            (c, d, squares) = (c + p * share, d + p * tau, squares + tau * tau);
        }
        d = d * (1.0 / squares);
        let mut radius = 0.0;
        for _ in 0..PASSES {
            let mut normal = Normal::<5>::default();
            for (tau, p, ..) in self.each() {
                let p = p - c - d * tau;
                let (a, b) = (2.0 * p.alpha(), 2.0 * p.beta());
                normal.add(&[a, b, tau * a, tau * b, 1.0], p.dot(p));
            }
            let x = normal.solve(0.0)?.x;
            c += AlphaBeta::new(x[0], x[1]);
            d += AlphaBeta::new(x[2], x[3]);
            let square = x[4] + x[0] * x[0] + x[1] * x[1];
            radius = if square > 0.0 { square.sqrt() } else { return None };
        }
        let (mut angle, mut squares) = (Normal::<4>::default(), 0.0);
        let mut first = None;
        let (mut weights, mut torque, mut along, mut last) = (0.0, 0.0, 0.0, -1.0);
        for (tau, p, theta, [cross, dot], i) in self.each() {
            let eta = p - c - d * tau;
            squares += (eta.magnitude() - radius) * (eta.magnitude() - radius);
            let seen: DqHat = Axis::<Estimated>::at(theta).from_stator(eta);
            let off = atan2(seen.q(), seen.d());
            let (theta_0, off_0) = *first.get_or_insert((theta, off));
            angle.add(&[1.0, tau, tau * tau, tau * tau * tau], theta - theta_0 + wrap(off - off_0));
            // The point lies between the last one and this one.
            let middle = 0.5 * (last + tau);
            let weight = (1.0 - middle * middle) * (1.0 - middle * middle);
            if tau > last {
                weights += weight;
                torque += weight * (cross - (c + d * middle).cross(i)) / self.every;
                along += weight * (dot - (c + d * middle).dot(i)) / self.every;
            }
            last = tau;
        }
        let angle = angle.solve(0.0)?;
        let half = 0.5 * (self.time(T) - self.every * T);
        let [_, a_1, a_2, a_3] = angle.x;
        Some(Part {
            acceleration: 2.0 * a_2 / (half * half),
            sigma: angle.half_width[2] / (half * half),
            w: (a_1 + a_3 * (3.0 / 7.0)) / half,
            torque: torque / weights,
            i_d: along / weights / radius,
            radius,
            deviation: (squares * share).sqrt() / radius,
            turns: (a_1 + a_3).abs() / std::f64::consts::PI,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: f64 = 1e-4;
    const PSI: f64 = 0.15;

    /// A part of `n` samples at the angle `angle(t)` with the currents `current(t)` along d and q; p drifts, and the
    /// observer's angle lags.
    fn part(n: u32, angle: impl Fn(f64) -> f64, current: impl Fn(f64) -> [f64; 2]) -> Part {
        let mut points = Points::default();
        points.begin();
        let p = |k: f64| {
            let v = Axis::<Estimated>::at(angle(k * T)).along(PSI);
            v + AlphaBeta::new(0.07 + 0.9 * k * T, -0.04 - 0.6 * k * T)
        };
        for k in 1..=n {
            let k = f64::from(k);
            let [d, q] = current(k * T);
            let theta = angle(k * T);
            points.take(p(k) - p(k - 1.0), Axis::<Estimated>::at(theta).to_stator(DqHat::new(d, q)), theta - 0.1);
        }
        points.end(T).unwrap()
    }

    /// Radius, speed, acceleration, torque and i_d of a drifting circle, with more samples than points.
    #[test]
    fn an_exact_circle_comes_back() {
        for n in [250, 255, 3000, 9000] {
            let (w, a, end) = (200.0, 120.0, f64::from(n) * T);
            let r = part(n, |t| 0.4 + w * t + 0.5 * a * t * t, |_| [-0.3, 2.0]);
            let pairs = [
                ("radius", r.radius, PSI),
                ("speed", r.w, w + 0.5 * a * end),
                ("acceleration", r.acceleration, a),
                ("torque", r.torque, PSI * 2.0),
                ("i_d", r.i_d, -0.3),
                ("turns", r.turns, (w * end + 0.5 * a * end * end) / std::f64::consts::TAU),
            ];
            for (name, found, expected) in pairs {
                // The last point is up to 64 samples before the end of the part.
                let limit = match name {
                    "speed" | "turns" => 0.02,
                    "radius" | "acceleration" => 3e-4,
                    _ => 1e-3,
                };
                assert!((found / expected - 1.0).abs() < limit, "{name} of {n}: {found}, not {expected}");
            }
            assert!(r.deviation < 1e-3, "{}", r.deviation);
        }
    }

    /// J w' + B w = K i_q holds for the means, even if speed and current oscillate during the part.
    #[test]
    fn the_means_fulfill_the_equation_of_motion() {
        let (J, B) = (1e-3, 4e-4);
        for (amplitude, rate) in [(3.0, 20.0), (10.0, 37.0), (40.0, 300.0)] {
            let angle = |t: f64| 150.0 * t + 30.0 * t * t + amplitude / rate * (1.0 - (rate * t).cos());
            let w = |t: f64| 150.0 + 60.0 * t + amplitude * (rate * t).sin();
            let slope = |t: f64| 60.0 + amplitude * rate * (rate * t).cos();
            let r = part(4000, angle, |t| [0.5, (J * slope(t) + B * w(t)) / PSI]);
            let left = J * r.acceleration + B * r.w;
            assert!((r.torque / left - 1.0).abs() < 2e-3, "{amplitude} {rate}: {} {left}", r.torque);
        }
    }

    #[test]
    fn few_points_are_no_part() {
        let mut points = Points::default();
        points.begin();
        for _ in 0..FEWEST - 1 {
            points.take(AlphaBeta::new(1e-3, 0.0), AlphaBeta::ZERO, 0.0);
        }
        assert_eq!(points.end(T), None);
    }
}
