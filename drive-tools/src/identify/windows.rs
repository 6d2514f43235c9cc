//! Windows of a record: the voltage equations in integral form, in rotor axes.
//!
//! ```text
//! d: [psi_d] - int(w psi_q) + R int(i_d) + sum c_j int(s_jd) = int(u_d)       [x]: end minus start
//! q: [psi_q] + int(w psi_d) + R int(i_q) + sum c_j int(s_jq) = int(u_q)
//! psi_d = psi_M + L_d i_d + a_2 i_d^2 + a_3 i_d^3 + a_x i_q^2 / 2,  psi_q = L_q i_q + b_3 i_q^3 + a_x i_d i_q
//! ```
//!
//! Both fluxes come from one energy. The voltage is held in stator axes for a sample; its mean in rotor axes is
//! `u e^(-j theta) sin(w T/2)/(w T/2)` at the middle. `s_j` is the voltage loss of the three legs for `u_dead` = 1 V and the
//! current `i_xj` at which the dead-time curve bends: the sum of three approximates its tail.
//!
//! Over a sample of the controller, a current runs exponentially: its mean is `(1 - c) i[k] + c i[k+1]` with
//! `c = 1/(1 - e^-x) - 1/x`, `x = R T/L`; c = 1/2 is the trapezoid.

use super::legs;
use super::motion::Motion;
use super::record::{BenchRecord, Complex};
use std::ops::Range;

/// Parameters: R, L_d, L_q, psi_M, c_1, c_2, c_3, a_2, a_3, b_3, a_x.
pub const SIZE: usize = 11;

/// Positions of the inverter's curve among them.
pub const CURVE: Range<usize> = 4..7;

/// Places of the saturation.
pub const BENT: Range<usize> = 7..SIZE;

/// Bends of the dead time's curve, as shares of the maximum current.
const BENDS: [f64; 3] = [0.003, 0.01, 0.03];

/// Points of a sample at which the inverter's loss is taken.
const POINTS: usize = 8;

/// One window: the regressors of both axes and the quantity to explain, integrated over its time.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Time in s at its middle.
    pub t: f64,
    /// Regressors of the d-axis.
    pub d: [f64; SIZE],
    /// Regressors of the q-axis.
    pub q: [f64; SIZE],
    /// Integral of the voltage in V.s, rotor axes.
    pub u: Complex,
}

/// When the voltage of a row acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Samples of the controller between a row and the action of its voltage.
    pub delay: f64,
    /// Samples of the controller per row of the record.
    pub every: u32,
}

/// Effects included in the equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// Weight of a step's end in the mean of a current: d and q.
    pub share: [f64; 2],
    /// Terms of the saturation: a_2, a_3, b_3, a_x.
    pub bent: [bool; 4],
}

impl Form {
    /// Trapezoids, no saturation.
    pub const PLAIN: Self = Self { share: [0.5; 2], bent: [false; 4] };

    /// Means of exponentials with `x` = R T/L of both axes.
    pub fn share_of(x: f64) -> f64 {
        if x < 0.02 { 0.5 + x / 12.0 } else { 1.0 / (1.0 - (-x).exp()) - 1.0 / x }
    }
}

/// A record prepared for fits.
pub struct Problem<'a> {
    pub(super) record: &'a BenchRecord,
    motion: &'a Motion,
    pub(super) timing: Timing,
    /// Mean loss of the legs over the step after each row, for each bend, per volt of dead time, stator axes.
    losses: Vec<[Complex; 3]>,
    pub(super) bends: [f64; 3],
    pub(super) window: usize,
    pub(super) form: Form,
}

impl<'a> Problem<'a> {
    /// Prepares a record; `i_max` is the maximum current in A.
    pub fn new(record: &'a BenchRecord, motion: &'a Motion, timing: Timing, i_max: f64) -> Self {
        let window = 4.max(16 / timing.every.max(1) as usize);
        let bends = BENDS.map(|share| share * i_max);
        let problem = Self { record, motion, timing, losses: Vec::new(), bends, window, form: Form::PLAIN };
        problem.with(Form::PLAIN, 0.0)
    }

    /// This record with equations of another form; `x` is R T/L of the stator.
    pub fn with(&self, form: Form, x: f64) -> Self {
        let Self { record, motion, timing, bends, window, .. } = *self;
        let loss = |i: Complex| bends.map(|bend| legs::loss(i, bend));
        let rows = record.i.len();
        let losses = (0..rows).map(|k| {
            let (a, b) = (record.i[k], record.i[(k + 1).min(rows - 1)]);
            if x < 0.02 {
                let (a, b) = (loss(a), loss(b));
                return std::array::from_fn(|j| (a[j] + b[j]) * 0.5);
            }
            let mut sum = [Complex::new(0.0, 0.0); 3];
            for point in 0..POINTS {
                let part = (point as f64 + 0.5) / POINTS as f64;
                let way = (1.0 - (-x * part).exp()) / (1.0 - (-x).exp());
                let at = loss(a + (b - a) * way);
                sum.iter_mut().zip(at).for_each(|(sum, s)| *sum += s / POINTS as f64);
            }
            sum
        });
        let losses = losses.collect();
        Self { record, motion, timing, losses, bends, window, form }
    }

    /// Mean of the voltage over the step after row `k`, in rotor axes shifted by `theta_0` and `tau`.
    fn voltage(&self, k: usize, frame: impl Fn(usize, f64) -> f64) -> Complex {
        let (T, w) = (self.record.step, self.motion.w[k]);
        let u = &self.record.u;
        // The vector `u` that acts from `from` to `to` (parts of the step), in rotor axes.
        let seen = |row: usize, from: f64, to: f64| {
            let (middle, half) = (0.5 * (from + to) * T, 0.5 * (to - from) * T * w);
            let width = if half.abs() < 1e-4 { 1.0 } else { half.sin() / half };
            if self.record.rotor_voltage {
                // Given in rotor axes of the sensor: only the sensor's own error turns it.
                let turned = frame(k, 0.0) - self.motion.theta[k];
                return u[row] * Complex::cis(-self.record.theta[row] - turned) * (to - from);
            }
            u[row] * Complex::cis(-frame(k, middle)) * width * (to - from)
        };
        if self.timing.every > 1 {
            // The log has a vector of one sample; between two of them, the vector in rotor axes changes smoothly.
            let held = T / f64::from(self.timing.every);
            let shift = (self.timing.delay + 0.5) * held;
            let at = |row: usize| {
                if self.record.rotor_voltage {
                    let turned = frame(row, 0.0) - self.motion.theta[row];
                    return u[row] * Complex::cis(-self.record.theta[row] - turned);
                }
                let half = 0.5 * held * self.motion.w[row];
                let width = if half.abs() < 1e-4 { 1.0 } else { half.sin() / half };
                u[row] * Complex::cis(-frame(row, shift)) * width
            };
            // Mean over a step of the straight line through the vectors, which lie `shift` after the rows.
            let late = shift / T;
            let back = late.floor() as usize;
            let part = late - late.floor();
            let row = |offset: isize| (k + 1).saturating_add_signed(offset - back as isize).min(u.len() - 1);
            let (a, b, c) = (at(row(-2)), at(row(-1)), at(row(0)));
            // Integral from -part to 1 - part of the line through (-1, a), (0, b), (1, c).
            let before = b * part + (a - b) * (0.5 * part * part);
            let rest = 1.0 - part;
            return before + b * rest + (c - b) * (0.5 * rest * rest);
        }
        let whole = self.timing.delay.floor();
        let part = self.timing.delay - whole;
        let row = k.saturating_sub(whole as usize);
        if part > 0.0 { seen(row.saturating_sub(1), 0.0, part) + seen(row, part, 1.0) } else { seen(row, 0.0, 1.0) }
    }

    /// The windows of a stretch.
    fn stretch(&self, run: Range<usize>, theta_0: f64, tau: f64, out: &mut Vec<Window>) {
        let (T, motion) = (self.record.step, self.motion);
        let [c_d, c_q] = self.form.share;
        let bent = self.form.bent.map(|bent| if bent { 1.0 } else { 0.0 });
        let frame = |k: usize, later: f64| motion.theta[k] - theta_0 + motion.w[k] * (tau + later);
        let view = |k: usize| self.record.i[k] * Complex::cis(-frame(k, 0.0));
        let lag = (self.timing.delay.ceil() as usize + 2).min(run.len());
        let mut start = run.start + lag;
        while start + self.window < run.end {
            let first = view(start);
            let mut before = first;
            let [mut i, mut w_i, mut u] = [Complex::new(0.0, 0.0); 3];
            let (mut s, mut angle) = ([Complex::new(0.0, 0.0); 3], 0.0);
            // Integrals of w times i_d^2, i_d^3, i_q^3, i_q^2 and i_d i_q.
            let mut turned = [0.0; 5];
            for k in start..start + self.window {
                let after = view(k + 1);
                let (w_0, w_1) = (motion.w[k], motion.w[k + 1]);
                let mean = |c: f64, a: f64, b: f64| ((1.0 - c) * a + c * b) * T;
                i += Complex::new(mean(c_d, before.re, after.re), mean(c_q, before.im, after.im));
                w_i += Complex::new(
                    mean(c_d, w_0 * before.re, w_1 * after.re),
                    mean(c_q, w_0 * before.im, w_1 * after.im),
                );
                angle += (w_0 + w_1) * (0.5 * T);
                let (a, b) = (products(before), products(after));
                for (k, sum) in turned.iter_mut().enumerate() {
                    *sum += mean(if k < 2 { c_d } else { c_q }, w_0 * a[k], w_1 * b[k]);
                }
                let middle = Complex::cis(-frame(k, 0.5 * T)) * T;
                for (s, loss) in s.iter_mut().zip(self.losses[k]) {
                    *s += loss * middle;
                }
                u += self.voltage(k, frame) * T;
                before = after;
            }
            let rise = before - first;
            let (a, b) = (products(first), products(before));
            let more: [f64; 5] = std::array::from_fn(|k| b[k] - a[k]);
            let d = [more[0], more[1], -turned[2], 0.5 * more[3] - turned[4]];
            let q = [turned[0], turned[1], more[2], more[4] + 0.5 * turned[3]];
            let [d, q] = [d, q].map(|x| std::array::from_fn::<_, 4, _>(|k| x[k] * bent[k]));
            out.push(Window {
                t: 0.5 * (self.record.t[start] + self.record.t[start + self.window]),
                d: [i.re, rise.re, -w_i.im, 0.0, s[0].re, s[1].re, s[2].re, d[0], d[1], d[2], d[3]],
                q: [i.im, w_i.re, rise.im, angle, s[0].im, s[1].im, s[2].im, q[0], q[1], q[2], q[3]],
                u,
            });
            start += self.window;
        }
    }

    /// All windows, in axes rotated back by `theta_0` (rad) and delayed by `tau` (s).
    pub fn windows(&self, theta_0: f64, tau: f64) -> Vec<Window> {
        let mut windows = Vec::new();
        for run in &self.motion.runs {
            self.stretch(run.clone(), theta_0, tau, &mut windows);
        }
        windows
    }

    /// Length of a window in s.
    pub fn length(&self) -> f64 {
        self.window as f64 * self.record.step
    }
}

/// i_d^2, i_d^3, i_q^3, i_q^2, i_d i_q.
fn products(i: Complex) -> [f64; 5] {
    [i.re * i.re, i.re.powi(3), i.im.powi(3), i.im * i.im, i.re * i.im]
}
