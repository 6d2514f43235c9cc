//! A machine on a bench that shares no formula with the drive's plant: other saturation (algebraic, of fifth order, with cross
//! saturation), a dead time with a tail in 1/i, thresholds of the devices, cogging, Coulomb friction; 12-bit sensors with noise and
//! offset, an encoder of 4096 steps with an offset and a delay. The population covers 12 V to 700 V and 20 W to 100 kW.

use drive_tools::identify::Complex;
use fmu_core::draw::Draw;
use std::f64::consts::{PI, TAU};

/// A machine with its inverter and sensors.
#[derive(Clone, Debug, Default)]
pub(crate) struct Machine {
    pub(crate) n_p: f64,
    pub(crate) R: f64,
    /// Inductances at no current.
    pub(crate) L: [f64; 2],
    pub(crate) psi_M: f64,
    pub(crate) J: f64,
    pub(crate) B: f64,
    pub(crate) tau_coulomb: f64,
    pub(crate) u_dc: f64,
    /// Maximum current, twice the rated one.
    pub(crate) i_max: f64,
    pub(crate) speed: f64,
    pub(crate) torque: f64,
    pub(crate) T_s: f64,
    w_coulomb: f64,
    cogging: f64,
    /// i_d = (d_0 + d_4 d^4 + x q^2/2) d - i_f, i_q = (q_0 + q_4 q^4 + x d^2/2) q of the fluxes d and q.
    d: [f64; 2],
    q: [f64; 2],
    x: f64,
    i_f: f64,
    pub(crate) u_dead: f64,
    pub(crate) bend: f64,
    pub(crate) threshold: f64,
    pub(crate) knee: f64,
    range: f64,
    sigma: f64,
    offset: [f64; 3],
    theta: f64,
}

impl Machine {
    /// Number `index` of the population of a seed.
    pub(crate) fn drawn(seed: u64, index: u64) -> Self {
        let mut draw = Draw(seed.wrapping_mul(1_000_003).wrapping_add(index));
        loop {
            let mut m = Self { u_dc: draw.scaled(12.0, 700.0), ..Self::default() };
            let U = m.u_dc / 3.0_f64.sqrt();
            m.i_max = 2.0 * draw.scaled(20.0, 100e3) / (1.5 * 0.8 * U);
            m.n_p = 2.0 + (20.0 * draw.share()).floor();
            let f = draw.scaled(20.0, 800.0);
            let w = TAU * f;
            m.speed = w / m.n_p;
            m.psi_M = draw.between(0.45, 0.85) * U / w;
            let i = 0.5 * m.i_max;
            m.R = draw.scaled(0.008, 0.25) * U / i;
            m.L[0] = draw.scaled(0.04, 0.5) * U / i / w;
            let round = draw.share() < 0.35;
            m.L[1] = m.L[0] * if round { draw.between(1.0, 1.05) } else { draw.scaled(1.05, 6.0) };
            m.torque = 1.5 * m.n_p * m.psi_M * i;
            m.J = draw.scaled(0.005, 20.0) * m.torque / m.speed;
            m.tau_coulomb = draw.scaled(0.002, 0.05) * m.torque;
            m.B = draw.scaled(0.002, 0.05) * m.torque / m.speed;
            m.w_coulomb = 0.001 * m.speed;
            m.cogging = draw.between(0.0, 0.01) * m.torque;
            let (k_d, k_q, k_x) = (draw.between(0.0, 0.15), draw.between(0.0, 0.15), draw.between(0.0, 0.1));
            let (x, x_q) = (m.psi_M + m.L[0] * m.i_max, m.L[1] * m.i_max);
            m.d[1] = k_d / x.powi(4) / m.L[0];
            m.d[0] = 1.0 / m.L[0] - 5.0 * m.d[1] * m.psi_M.powi(4);
            m.q[1] = k_q / x_q.powi(4) / m.L[1];
            m.x = 2.0 * k_x / (m.L[1] * x * x);
            m.q[0] = 1.0 / m.L[1] - 0.5 * m.x * m.psi_M * m.psi_M;
            m.i_f = (m.d[0] + m.d[1] * m.psi_M.powi(4)) * m.psi_M;
            m.T_s = 1e-4;
            while m.T_s * f * 12.0 > 1.000_000_1 && m.T_s > 1.3e-5 {
                m.T_s *= 0.5;
            }
            m.u_dead = draw.between(0.005, 0.03) * m.u_dc;
            m.bend = draw.between(0.005, 0.04) * i;
            m.threshold = if m.u_dc > 100.0 { draw.between(0.4, 1.0) } else { 0.0 };
            m.knee = draw.between(0.005, 0.02) * i;
            m.range = 1.5 * m.i_max;
            m.sigma = draw.between(0.0005, 0.002) * m.range;
            m.offset = std::array::from_fn(|_| draw.between(-0.005, 0.005) * m.range);
            m.theta = draw.between(0.0, TAU);
            let [L_d, L_q] = m.L;
            if (5e-3..=20.0).contains(&m.R) && L_d >= 20e-6 && L_q <= 0.2 && L_q * i * w / U <= 1.2 {
                return m;
            }
        }
    }

    /// Currents of the fluxes, rotor axes.
    fn current(&self, psi: Complex) -> Complex {
        let (d_2, q_2) = (psi.re * psi.re, psi.im * psi.im);
        let i_d = (self.d[0] + self.d[1] * d_2 * d_2 + 0.5 * self.x * q_2) * psi.re - self.i_f;
        Complex::new(i_d, (self.q[0] + self.q[1] * q_2 * q_2 + 0.5 * self.x * d_2) * psi.im)
    }

    fn leg(&self, i: f64) -> f64 {
        let a = i.abs();
        let dead = if a < self.bend { 0.5 * i / self.bend } else { (1.0 - 0.5 * self.bend / a).copysign(i) };
        self.u_dead * dead + self.threshold * i / (a + self.knee + 1e-30)
    }

    /// Slopes of flux (stator axes), speed and angle with the voltage `u` and the load.
    fn slopes(&self, (psi, w, angle): State, u: Complex, load: f64) -> State {
        let turn = Complex::cis(self.n_p * angle);
        let own = psi * turn.conj();
        let i = self.current(own);
        let lost = vector(phases(i * turn).map(|i| self.leg(i)));
        let tau = 1.5 * self.n_p * (own.re * i.im - own.im * i.re);
        let friction = self.B * w + self.tau_coulomb * (w / self.w_coulomb).tanh();
        let cogging = self.cogging * (6.0 * self.n_p * angle).sin();
        (u - i * turn * self.R - lost, (tau - load - friction - cogging) / self.J, w)
    }

    /// One sample with Runge and Kutta's method.
    fn advance(&self, state: State, u: Complex, load: f64) -> State {
        let R = self.R + 4.0 / 3.0 * (0.5 * self.u_dead / self.bend + self.threshold / (self.knee + 1e-30));
        let h = (0.25 * self.T_s).min(1.2 * 0.4 * self.L[0] / R);
        let steps = (self.T_s / h).ceil().min(60.0);
        let h = self.T_s / steps;
        let plus = |a: State, b: State, h: f64| (a.0 + b.0 * h, a.1 + b.1 * h, a.2 + b.2 * h);
        let mut x = state;
        for _ in 0..steps as usize {
            let a = self.slopes(x, u, load);
            let b = self.slopes(plus(x, a, 0.5 * h), u, load);
            let c = self.slopes(plus(x, b, 0.5 * h), u, load);
            let d = self.slopes(plus(x, c, h), u, load);
            x = [(a, 1.0), (b, 2.0), (c, 2.0), (d, 1.0)].into_iter().fold(x, |x, (k, n)| plus(x, k, n * h / 6.0));
        }
        x
    }

    /// The sensor readings of a current vector: the phases.
    fn measured(&self, i: Complex, draw: &mut Draw) -> [f64; 3] {
        let step = 2.0 * self.range / 4096.0;
        let i = phases(i);
        std::array::from_fn(|k| {
            let x = i[k] + self.offset[k] + self.sigma * draw.normal();
            ((x / step).round() * step).clamp(-self.range, self.range)
        })
    }
}

/// Flux in stator axes, mechanical speed and angle.
type State = (Complex, f64, f64);

fn phases(x: Complex) -> [f64; 3] {
    let beta = x.im * 0.75_f64.sqrt();
    [x.re, -0.5 * x.re + beta, -0.5 * x.re - beta]
}

fn vector([a, b, c]: [f64; 3]) -> Complex {
    Complex::new((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}

/// A part of a run, of equal length as all others: speed in pu, d-axis current and load against the maximum current and the
/// rated torque.
pub(crate) type Part = (f64, f64, f64);

/// Steps of speed and of small d-axis currents.
pub(crate) const PLAIN: [Part; 8] = [
    (0.1, 0.0, 0.0),
    (0.3, -0.15, 0.0),
    (0.6, 0.0, 0.0),
    (0.3, 0.1, 0.3),
    (-0.2, -0.1, 0.3),
    (-0.5, 0.0, -0.2),
    (0.2, 0.15, 0.4),
    (0.45, -0.15, 0.1),
];

/// The record that docs/identify.md requires: speeds of both signs, and currents of all sizes at a low speed, which separate the
/// resistance from the inverter's loss.
pub(crate) const THOROUGH: [Part; 16] = [
    (0.1, 0.85, 0.0),
    (0.1, 0.7, 0.0),
    (0.1, 0.55, 0.0),
    (0.1, 0.4, 0.0),
    (0.1, 0.25, 0.0),
    (0.1, -0.25, 0.0),
    (0.1, -0.5, 0.0),
    (0.1, -0.8, 0.0),
    (0.3, -0.15, 0.0),
    (0.6, 0.0, 0.0),
    (0.3, 0.1, 0.3),
    (-0.2, -0.1, 0.3),
    (-0.5, 0.0, -0.2),
    (-0.1, 0.8, 0.0),
    (0.2, 0.15, 0.4),
    (0.45, -0.15, 0.1),
];

/// The record of a run: columns with their names, every so many samples.
pub(crate) fn record(
    m: &Machine,
    seed: u64,
    index: u64,
    time: f64,
    parts: &[Part],
    every: usize,
) -> Vec<(String, Vec<f64>)> {
    const PRE: f64 = 0.05;
    let names = ["t", "u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "tau_load", "u_dc"];
    let mut columns = names.map(|name| (name.to_owned(), Vec::new()));
    let mut noise = Draw(seed.wrapping_mul(31337).wrapping_add(index));
    let mut draw = Draw(seed.wrapping_mul(555).wrapping_add(index));
    let (theta_0, tau) = (draw.between(-0.2, 0.2), draw.share() * m.T_s);
    let K = 1.5 * m.n_p * m.psi_M;
    let w_c = (0.12 / m.T_s).min(4000.0);
    let bandwidth = (0.05 * w_c).min(20.0);
    let U = 0.95 * m.u_dc / 3.0_f64.sqrt();
    let zero = Complex::new(0.0, 0.0);
    let start = |angle: f64| (Complex::cis(m.n_p * angle) * m.psi_M, 0.0, angle);
    let mut state: State = start(m.theta / m.n_p);
    let (mut command, mut sum, mut i_sum, mut reference) = (zero, zero, 0.0, 0.0);
    let mut raw = m.measured(zero, &mut noise);
    for k in 0..(time / m.T_s) as usize {
        let t = k as f64 * m.T_s;
        let resting = t < PRE;
        let part = ((t - PRE) / (time - PRE) * parts.len() as f64).clamp(0.0, parts.len() as f64 - 1.0) as usize;
        let (speed, i_d, load) = parts[part];
        let load = if resting { 0.0 } else { load * m.torque * (state.1 / (0.02 * m.speed)).tanh() };
        let theta = m.n_p * state.2;
        let step = TAU / 4096.0 * m.n_p;
        let seen = (((theta - m.n_p * state.1 * tau + theta_0) / step).floor() * step).rem_euclid(TAU);
        if k % every == 0 {
            let row = [t, command.re, command.im, raw[0], raw[1], raw[2], seen, load, m.u_dc];
            columns.iter_mut().zip(row).for_each(|((_, column), x)| column.push(x));
        }
        if resting {
            raw = m.measured(zero, &mut noise);
            continue;
        }
        let rate = (m.speed / 0.15).min(0.8 * K * 0.5 * m.i_max / m.J);
        reference += (speed * m.speed - reference).clamp(-rate * m.T_s, rate * m.T_s);
        let error = reference - state.1;
        let wanted = bandwidth * m.J / K * error + i_sum;
        let i_q = wanted.clamp(-0.5 * m.i_max, 0.5 * m.i_max);
        if wanted.abs() <= 0.5 * m.i_max {
            i_sum += 0.25 * bandwidth * bandwidth * m.J / K * error * m.T_s;
        }
        let turn = Complex::cis(theta);
        let i = vector(std::array::from_fn(|k| raw[k] - m.offset[k])) * turn.conj();
        let off = Complex::new(i_d * m.i_max, i_q) - i;
        let (w, [L_d, L_q]) = (m.n_p * state.1, m.L);
        let proportional = Complex::new(L_d * off.re, L_q * off.im);
        let u = proportional * (0.5 * w_c) + sum + Complex::new(-w * L_q * i.im, w * (m.psi_M + L_d * i.re));
        let size = u.norm();
        let u = if size < U {
            sum += (proportional * (0.1 * w_c * w_c) + off * (0.25 * w_c * m.R)) * m.T_s;
            u
        } else {
            u * (U / size)
        };
        let next = u * Complex::cis(theta + 1.5 * m.T_s * w);
        state = m.advance(state, command, load);
        command = next;
        let turn = Complex::cis(m.n_p * state.2);
        raw = m.measured(m.current(state.0 * turn.conj()) * turn, &mut noise);
    }
    debug_assert!(state.1.abs() < PI * 1e6);
    columns.into()
}
