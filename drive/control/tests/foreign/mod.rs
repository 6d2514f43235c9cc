//! An independent plant, which shares no formula with `drive-plant`: an algebraic flux model with saturation and
//! cross-saturation, legs with dead time and the threshold of their devices, cogging and friction, 12-bit sensors with offset and
//! noise, a command that acts a sample later. The population covers 12 V to 700 V and 20 W to 100 kW.
#![allow(dead_code, reason = "each test program uses a part")]

use drive_base::frame::{AlphaBeta, Phases, SQRT_3};
use fmu_core::draw::Draw;
use std::f64::consts::{PI, TAU};

/// A machine, its inverter and its sensors.
#[derive(Clone, Debug, Default)]
pub(crate) struct Motor {
    pub(crate) n_p: f64,
    pub(crate) R: f64,
    /// Differential inductances at zero current.
    pub(crate) L_d: f64,
    pub(crate) L_q: f64,
    pub(crate) psi: f64,
    pub(crate) J: f64,
    pub(crate) B: f64,
    pub(crate) tau_coulomb: f64,
    w_coulomb: f64,
    pub(crate) u_dc: f64,
    /// Twice the rated current.
    pub(crate) I: f64,
    /// Rated electrical speed.
    pub(crate) w_rated: f64,
    pub(crate) T: f64,
    /// i_d = (d_0 + d_4 psi_d^4 + c psi_q^2 / 2) psi_d - i_0, i_q = (q_0 + q_4 psi_q^4 + c psi_d^2 / 2) psi_q.
    d_0: f64,
    d_4: f64,
    q_0: f64,
    q_4: f64,
    cross: f64,
    i_0: f64,
    pub(crate) u_dead: f64,
    pub(crate) i_x: f64,
    pub(crate) u_th: f64,
    pub(crate) i_y: f64,
    range: f64,
    sigma: f64,
    /// Offsets of the current sensors in A.
    pub(crate) offset: [f64; 3],
    cogging: f64,
    pub(crate) theta_0: f64,
    pub(crate) blocked: bool,
    /// Ideal sensors.
    pub(crate) exact: bool,
}

/// Classes of machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    /// The EMF at the rated speed is near the voltage, and L_q >= L_d.
    Usual,
    /// PM-assisted reluctance machines: psi_M < (L_q - L_d) I.
    Assisted,
    /// L_d > L_q.
    Inverse,
    /// Cogging and friction of up to a fifth of the rated torque.
    Rough,
    /// Differential inductances that fall to a quarter at I.
    Saturated,
    /// 0.5 ms to 5 ms, or 20 s to 200 s, to the rated speed.
    Extreme,
}

impl Motor {
    /// The machine `index` of the population `seed`.
    pub(crate) fn draw(seed: u64, index: u64) -> Self {
        Self::of(Class::Usual, seed, index)
    }

    /// The machine `index` of the population `seed` of a class.
    pub(crate) fn of(class: Class, seed: u64, index: u64) -> Self {
        let mut r = Draw(seed * 1_000_003 + index);
        loop {
            let mut m = Self { u_dc: r.scaled(12.0, 700.0), ..Self::default() };
            let U = m.u_dc / SQRT_3;
            let P = r.scaled(20.0, 100e3);
            m.I = 2.0 * P / (1.5 * 0.8 * U);
            m.n_p = 2.0 + (20.0 * r.share()).floor();
            let f = r.scaled(20.0, 800.0);
            let w = TAU * f;
            let speed = w / m.n_p;
            m.w_rated = w;
            m.psi = if class == Class::Assisted { r.between(0.03, 0.45) } else { r.between(0.45, 0.85) } * U / w;
            let rated = 0.5 * m.I;
            let Z = U / rated;
            m.R = r.scaled(0.008, 0.25) * Z;
            m.L_d = r.scaled(0.04, 0.5) * Z / w;
            let ratio = match class {
                Class::Assisted => r.scaled(2.0, 8.0),
                Class::Inverse => r.scaled(0.3, 0.95),
                _ if r.share() < 0.35 => r.between(1.0, 1.05),
                _ => r.scaled(1.05, 6.0),
            };
            m.L_q = m.L_d * ratio;
            // At 45 degrees, the reluctance adds its torque.
            let reluctance = if class == Class::Assisted { 0.5 * (m.L_q - m.L_d) * rated } else { 0.0 };
            let tau = 1.5 * m.n_p * (m.psi + reluctance) * rated;
            m.J = match class {
                Class::Extreme if r.share() < 0.5 => r.scaled(0.0005, 0.005),
                Class::Extreme => r.scaled(20.0, 200.0),
                _ => r.scaled(0.005, 20.0),
            } * tau
                / speed;
            let rough = class == Class::Rough;
            m.tau_coulomb = if rough { r.scaled(0.02, 0.2) } else { r.scaled(0.002, 0.05) } * tau;
            m.B = r.scaled(0.002, 0.05) * tau / speed;
            m.w_coulomb = 0.001 * speed;
            m.cogging = r.between(0.0, if rough { 0.2 } else { 0.01 }) * tau;
            let most = if class == Class::Saturated { 0.6 } else { 0.15 };
            let (k_d, k_q, k_x) = (r.between(0.0, most), r.between(0.0, most), r.between(0.0, 0.1));
            // At the magnet alone, the differential inductance is still positive.
            let monotonic = 0.18 * (1.0 + m.L_d * m.I / m.psi).powi(4);
            m.saturate(if most > 0.15 { k_d.min(monotonic) } else { k_d }, k_q, k_x);
            m.T = 1e-4;
            while m.T * f * 12.0 > 1.000_000_1 && m.T > 1.3e-5 {
                m.T *= 0.5;
            }
            m.u_dead = r.between(0.005, 0.03) * m.u_dc;
            m.i_x = r.between(0.005, 0.04) * rated;
            m.u_th = if m.u_dc > 100.0 { r.between(0.4, 1.0) } else { 0.0 };
            m.i_y = r.between(0.005, 0.02) * rated;
            m.range = 1.5 * m.I;
            m.sigma = r.between(0.0005, 0.002) * m.range;
            m.offset = [0; 3].map(|_| r.between(-0.005, 0.005) * m.range);
            m.theta_0 = r.between(0.0, TAU);
            if m.R < 5e-3 || m.R > 20.0 || m.L_d < 20e-6 || m.L_q > 0.2 || m.L_q * rated * w / U > 1.2 {
                continue;
            }
            let share = m.psi / ((m.L_q - m.L_d) * m.I);
            if class == Class::Assisted && !(0.03..1.0).contains(&share) {
                continue;
            }
            return m;
        }
    }

    /// A PM-assisted reluctance machine of 10/30 mH and 0.25 Wb: with more than 12.5 A, its magnet rests at an angle to the
    /// current.
    pub(crate) fn reluctance(I: f64) -> Self {
        let mut m = Self { n_p: 2.0, R: 0.42, L_d: 10e-3, L_q: 30e-3, psi: 0.25, J: 0.055, ..Self::default() };
        (m.B, m.tau_coulomb, m.w_coulomb) = (1e-3, 0.3, 0.16);
        (m.u_dc, m.I, m.w_rated, m.T) = (560.0, I, 314.0, 1e-4);
        (m.u_dead, m.i_x, m.i_y, m.range, m.sigma, m.theta_0) = (11.2, 0.2, 0.1, 102.4, 0.05, 1.0);
        m.saturate(0.0, 0.0, 0.0);
        m
    }

    /// Saturation by the shares `k_d`, `k_q` and across by `k_x`.
    fn saturate(&mut self, k_d: f64, k_q: f64, k_x: f64) {
        let (x, x_q) = (self.psi + self.L_d * self.I, self.L_q * self.I);
        self.d_4 = k_d / x.powi(4) / self.L_d;
        self.d_0 = 1.0 / self.L_d - 5.0 * self.d_4 * self.psi.powi(4);
        self.q_4 = k_q / x_q.powi(4) / self.L_q;
        self.cross = 2.0 * k_x / (self.L_q * x * x);
        self.q_0 = 1.0 / self.L_q - 0.5 * self.cross * self.psi * self.psi;
        self.i_0 = (self.d_0 + self.d_4 * self.psi.powi(4)) * self.psi;
    }

    /// Rated speed in rad/s.
    pub(crate) fn speed(&self) -> f64 {
        self.w_rated / self.n_p
    }

    /// Torque in N.m of the magnet with half the maximum current.
    pub(crate) fn torque(&self) -> f64 {
        1.5 * self.n_p * self.psi * 0.5 * self.I
    }

    /// Number of pole pairs.
    pub(crate) fn pole_pairs(&self) -> i32 {
        (1..1000).find(|&n| f64::from(n) >= self.n_p).unwrap()
    }

    /// Friction in N.m at the mechanical speed `w` (rad/s).
    pub(crate) fn friction(&self, w: f64) -> f64 {
        self.B * w + self.tau_coulomb * drive_base::math::tanh(w / self.w_coulomb)
    }

    /// The rotor is blocked.
    pub(crate) fn held(mut self) -> Self {
        self.blocked = true;
        self
    }

    /// Without saturation, dead time, noise and quantization.
    pub(crate) fn ideal(mut self) -> Self {
        self.saturate(0.0, 0.0, 0.0);
        (self.u_dead, self.u_th, self.exact) = (0.0, 0.0, true);
        self
    }

    fn current(&self, d: f64, q: f64) -> [f64; 2] {
        let (d_2, q_2) = (d * d, q * q);
        [
            (self.d_0 + self.d_4 * d_2 * d_2 + 0.5 * self.cross * q_2) * d - self.i_0,
            (self.q_0 + self.q_4 * q_2 * q_2 + 0.5 * self.cross * d_2) * q,
        ]
    }

    /// (psi(i) - psi_M)/i along d, by bisection.
    pub(crate) fn chord_d(&self, i: f64) -> f64 {
        let at = |x: f64| self.current(self.psi + x, 0.0)[0];
        bisect(&at, i, 3.0 * self.L_d * i.abs()) / i
    }

    /// s_2 and s_3 of i = x/L_d + s_2 x^2 + s_3 x^3, by least squares over the flux linkages for +-`i` (A) on L_d.
    pub(crate) fn saturation(&self, i: f64) -> [f64; 2] {
        let psi = self.L_d * i;
        let (mut even, mut odd) = ([0.0; 2], [0.0; 2]);
        for k in -500..=500 {
            let z = f64::from(k) / 500.0;
            let y = self.current(self.psi + psi * z, 0.0)[0] / i - z;
            even = [even[0] + y * z * z, even[1] + z.powi(4)];
            odd = [odd[0] + y * z.powi(3), odd[1] + z.powi(6)];
        }
        [even[0] / even[1] * i / (psi * psi), odd[0] / odd[1] * i / (psi * psi * psi)]
    }

    /// psi(i)/i along q, where the current along d is 0: the flux linkage there follows.
    pub(crate) fn chord_q(&self, i: f64) -> f64 {
        let at = |q: f64| self.current(self.psi, q)[1];
        bisect(&at, i, 3.0 * self.L_q * i.abs()) / i
    }

    /// Twice the current in A at which the line of a leg ends, if its tail 1/i combines dead time and threshold.
    pub(crate) fn i_zero(&self) -> f64 {
        2.0 * (self.u_dead * self.i_x + 2.0 * self.u_th * self.i_y) / (self.u_dead + self.u_th)
    }

    fn leg(&self, i: f64) -> f64 {
        let a = i.abs();
        let line = if a < self.i_x { 0.5 * a / self.i_x } else { 1.0 - 0.5 * self.i_x / a };
        (self.u_dead * line + self.u_th * a / (a + self.i_y + 1e-30)).copysign(i)
    }

    fn legs(&self, i: AlphaBeta) -> AlphaBeta {
        let Phases { a, b, c } = Phases::from_stator(i);
        Phases { a: self.leg(a), b: self.leg(b), c: self.leg(c) }.to_stator()
    }
}

/// Solution x, with the sign of `i` and within +-`most`, of f(x) = `i` for an increasing f.
fn bisect(f: &dyn Fn(f64) -> f64, i: f64, most: f64) -> f64 {
    let (mut low, mut high) = (-most, most);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if f(middle) < i { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// A machine that runs.
pub(crate) struct Bench {
    pub(crate) motor: Motor,
    random: Draw,
    psi: AlphaBeta,
    pub(crate) w: f64,
    /// Mechanical angle in rad, not wrapped.
    pub(crate) theta: f64,
    /// Commands, the newest first, and which of them acts.
    commands: [AlphaBeta; 3],
    pub(crate) delay: usize,
    pub(crate) gates: bool,
    waiting: bool,
    steps: u32,
    /// Torque of a load in N.m, against the positive direction.
    pub(crate) load: f64,
    /// Voltage over the command.
    pub(crate) gain: f64,
    /// Maximum current so far in A.
    pub(crate) most: f64,
}

#[derive(Clone, Copy)]
struct Rates {
    psi: AlphaBeta,
    w: f64,
    theta: f64,
}

impl Bench {
    pub(crate) fn new(motor: Motor, seed: u64) -> Self {
        let (sin, cos) = motor.theta_0.sin_cos();
        let Z = motor.R + 4.0 / 3.0 * (motor.u_dead / (2.0 * motor.i_x) + motor.u_th / (motor.i_y + 1e-30));
        let h = (motor.T / 4.0).min(1.2 * motor.L_d * 0.4 / Z);
        let steps = (1..60_u32).find(|&n| f64::from(n) * h >= motor.T).unwrap_or(60);
        let (psi, theta) = (AlphaBeta::new(cos, sin) * motor.psi, motor.theta_0 / motor.n_p);
        let (commands, gates) = ([AlphaBeta::ZERO; 3], false);
        let random = Draw(seed);
        Self {
            motor,
            random,
            psi,
            w: 0.0,
            theta,
            commands,
            delay: 1,
            gates,
            waiting: false,
            steps,
            load: 0.0,
            gain: 1.0,
            most: 0.0,
        }
    }

    fn turned(v: AlphaBeta, cos: f64, sin: f64) -> AlphaBeta {
        AlphaBeta::new(v.alpha() * cos - v.beta() * sin, v.alpha() * sin + v.beta() * cos)
    }

    /// Measured phase currents in A.
    pub(crate) fn measure(&mut self) -> Phases {
        let m = &self.motor;
        let (sin, cos) = drive_base::math::sin_cos(m.n_p * self.theta);
        let psi = Self::turned(self.psi, cos, -sin);
        let [d, q] = m.current(psi.alpha(), psi.beta());
        let i = if self.gates { Self::turned(AlphaBeta::new(d, q), cos, sin) } else { AlphaBeta::ZERO };
        self.most = self.most.max(i.magnitude());
        let Phases { a, b, c } = Phases::from_stator(i);
        if m.exact {
            return Phases { a, b, c };
        }
        let step = 2.0 * m.range / 4096.0;
        let [a, b, c] = [(a, 0), (b, 1), (c, 2)].map(|(i, k)| {
            let x = i + m.offset[k] + m.sigma * self.random.normal();
            ((x / step).round() * step).clamp(-m.range, m.range)
        });
        Phases { a, b, c }
    }

    /// A command acts for a period; this is the pending one.
    pub(crate) fn tick(&mut self, u: AlphaBeta, gates: bool) {
        let m = &self.motor;
        self.commands = [u, self.commands[0], self.commands[1]];
        let command = self.commands[self.delay] * self.gain;
        let span = Phases::from_stator(command).span();
        let acting = if span > m.u_dc { command * (m.u_dc / span) } else { command };
        let h = m.T / f64::from(self.steps);
        if self.gates {
            for _ in 0..self.steps {
                let a = self.rates(Rates { psi: AlphaBeta::ZERO, w: 0.0, theta: 0.0 }, 0.0, acting);
                let b = self.rates(a, 0.5 * h, acting);
                let c = self.rates(b, 0.5 * h, acting);
                let d = self.rates(c, h, acting);
                self.psi += (a.psi + (b.psi + c.psi) * 2.0 + d.psi) * (h / 6.0);
                self.w += h / 6.0 * (a.w + 2.0 * (b.w + c.w) + d.w);
                self.theta += h / 6.0 * (a.theta + 2.0 * (b.theta + c.theta) + d.theta);
            }
        } else {
            // The current has ended, and the rotor coasts.
            self.w = if m.blocked { 0.0 } else { self.w * (-m.B / m.J * m.T).exp() };
            let braked = m.tau_coulomb / m.J * m.T;
            self.w -= self.w.clamp(-braked, braked);
            self.theta += self.w * m.T;
            let (sin, cos) = (m.n_p * self.theta).sin_cos();
            self.psi = AlphaBeta::new(cos, sin) * m.psi;
        }
        (self.gates, self.waiting) = (self.waiting, gates);
    }

    fn rates(&self, slope: Rates, h: f64, u: AlphaBeta) -> Rates {
        let m = &self.motor;
        let (psi, w, theta) = (self.psi + slope.psi * h, self.w + slope.w * h, self.theta + slope.theta * h);
        let (sin, cos) = drive_base::math::sin_cos(m.n_p * theta);
        let own = Self::turned(psi, cos, -sin);
        let [d, q] = m.current(own.alpha(), own.beta());
        let i = Self::turned(AlphaBeta::new(d, q), cos, sin);
        let dpsi = u - i * m.R - m.legs(i);
        if m.blocked {
            return Rates { psi: dpsi, w: 0.0, theta: 0.0 };
        }
        let tau = 1.5 * m.n_p * (own.alpha() * q - own.beta() * d);
        let (s_2, c_2) = (2.0 * sin * cos, cos * cos - sin * sin);
        let s_6 = s_2 * (4.0 * c_2 * c_2 - 1.0);
        let friction = m.friction(w) + m.cogging * s_6 + self.load;
        Rates { psi: dpsi, w: (tau - friction) / m.J, theta: w }
    }

    /// Electrical angle in rad.
    pub(crate) fn angle(&self) -> f64 {
        drive_base::math::wrap(self.motor.n_p * self.theta)
    }
}

/// Half of a turn is the same axis: the difference of two axes in rad.
pub(crate) fn between_axes(a: f64, b: f64) -> f64 {
    let d = drive_base::math::wrap(2.0 * (a - b));
    0.5 * if d > PI { d - TAU } else { d }
}
