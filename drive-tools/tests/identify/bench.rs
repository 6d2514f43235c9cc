//! A machine and a controller that share no formula with the drive's plant.

use drive_tools::identify::Complex;
use std::f64::consts::PI;
use std::fmt::Write;

pub(crate) const T_S: f64 = 1e-4;
pub(crate) const U_DC: f64 = 540.0;

/// The machine of the bench, its sensors and its run.
#[derive(Clone, Copy)]
pub(crate) struct Bench {
    pub(crate) n_p: f64,
    pub(crate) R: f64,
    pub(crate) L_d: f64,
    pub(crate) L_q: f64,
    pub(crate) psi_M: f64,
    pub(crate) J: f64,
    pub(crate) B: f64,
    pub(crate) tau_coulomb: f64,
    pub(crate) u_dead: f64,
    pub(crate) noise: f64,
    pub(crate) resolution: f64,
    pub(crate) offset: f64,
    pub(crate) steps_of_i_d: bool,
    pub(crate) steps_of_speed: bool,
    pub(crate) blocked: bool,
    pub(crate) time: f64,
}

/// The 2.2 kW machine, ideal.
pub(crate) const IDEAL: Bench = Bench {
    n_p: 3.0,
    R: 3.6,
    L_d: 36e-3,
    L_q: 51e-3,
    psi_M: 0.545,
    J: 15e-3,
    B: 5e-3,
    tau_coulomb: 0.3,
    u_dead: 0.0,
    noise: 0.0,
    resolution: 0.0,
    offset: 0.0,
    steps_of_i_d: true,
    steps_of_speed: true,
    blocked: false,
    time: 4.0,
};

/// With dead time, noise, offset and a converter of 12 bits.
pub(crate) const REAL: Bench = Bench { u_dead: 6.0, noise: 20e-3, resolution: 30.0 / 2048.0, offset: 0.2, ..IDEAL };

/// A row: time, voltage command, phase currents, electrical angle, load.
#[derive(Clone, Copy)]
pub(crate) struct Row {
    pub(crate) t: f64,
    pub(crate) u: Complex,
    pub(crate) i: [f64; 3],
    pub(crate) theta: f64,
    pub(crate) load: f64,
}

pub(crate) fn phases(x: Complex) -> [f64; 3] {
    let beta = x.im * 0.75_f64.sqrt();
    [x.re, -0.5 * x.re + beta, -0.5 * x.re - beta]
}

pub(crate) fn vector([a, b, c]: [f64; 3]) -> Complex {
    Complex::new((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}

impl Bench {
    /// The run: the voltage of a row acts until the next one, computed a sample before.
    pub(crate) fn run(&self) -> Vec<Row> {
        let Self { n_p, R, L_d, L_q, psi_M, J, B, tau_coulomb, .. } = *self;
        let mut seed = 0x5EED_u64;
        let mut uniform = move || {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let k_t = 1.5 * n_p * psi_M;
        let (mut i, mut w, mut angle) = (Complex::new(0.0, 0.0), 0.0_f64, 0.3_f64);
        let (mut command, mut sum, mut speed_sum) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0), 0.0);
        let mut rows = Vec::new();
        let pre = 0.05;
        for k in 0..(self.time / T_S) as usize {
            let t = k as f64 * T_S;
            let theta = n_p * angle;
            let stator = phases(i * Complex::cis(theta));
            let measured = stator.map(|x| {
                let noise: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                let x = x + self.offset + self.noise * noise;
                if self.resolution > 0.0 { (x / self.resolution).round() * self.resolution } else { x }
            });
            let part = ((t - pre) / (self.time - pre) * 8.0).clamp(0.0, 7.0) as usize;
            let speed =
                157.0 * if self.steps_of_speed { [0.1, 0.3, 0.6, 0.3, -0.2, -0.5, 0.2, 0.45][part] } else { 0.3 };
            let i_d = if self.steps_of_i_d { [0.0, -0.3, 0.0, 0.2, -0.2, 0.0, 0.3, -0.3][part] * 7.5 } else { 0.0 };
            let load = if self.steps_of_speed {
                [0.0, 0.0, 0.0, 3.0, 0.0, -3.0, 4.0, 1.0][part] * (w / 3.0).tanh()
            } else {
                0.0
            };
            rows.push(Row { t, u: command, i: measured, theta: theta.rem_euclid(2.0 * PI), load });
            // The plant over a sample, with its own method.
            let steps = 20;
            let h = T_S / f64::from(steps);
            for _ in 0..steps {
                let slope = |i: Complex, w: f64, angle: f64| {
                    let turn = Complex::cis(n_p * angle);
                    let [a, b, c] = phases(i * turn).map(|x| self.u_dead * (x / 0.05).tanh());
                    let u = (command - vector([a, b, c])) / turn;
                    let e = n_p * w;
                    let d = (u.re - R * i.re + e * L_q * i.im) / L_d;
                    let q = (u.im - R * i.im - e * (L_d * i.re + psi_M)) / L_q;
                    let tau = 1.5 * n_p * (psi_M + (L_d - L_q) * i.re) * i.im;
                    let rise = (tau - load - B * w - tau_coulomb * (w / 0.05).tanh()) / J;
                    (Complex::new(d, q), if self.blocked { 0.0 } else { rise })
                };
                if t < pre {
                    break;
                }
                let a = slope(i, w, angle);
                let b = slope(i + a.0 * (0.5 * h), w + 0.5 * h * a.1, angle + 0.5 * h * w);
                (i, angle) = (i + b.0 * h, angle + h * (w + 0.5 * h * a.1));
                w += h * b.1;
            }
            if t < pre {
                continue;
            }
            // The controller, with the measured current of the row and the angle of the sensor.
            let error = speed - w;
            speed_sum = (speed_sum + 0.4 * J * 300.0 / k_t * error * T_S).clamp(-7.0, 7.0);
            let i_q = (J * 30.0 / k_t * error + speed_sum).clamp(-7.0, 7.0);
            let i_q = if self.blocked { [1.0, 3.0, -3.0, 6.0, -6.0, 2.0, -1.0, 5.0][part] } else { i_q };
            let seen = vector(measured.map(|x| x - self.offset)) * Complex::cis(-theta);
            let off = Complex::new(i_d, i_q) - seen;
            let e = n_p * w;
            sum += Complex::new(off.re * R * 800.0, off.im * R * 800.0) * T_S;
            let u = Complex::new(
                800.0 * L_d * off.re - e * L_q * seen.im,
                800.0 * L_q * off.im + e * (psi_M + L_d * seen.re),
            ) + sum;
            command = u * (0.9 * U_DC / 3.0_f64.sqrt() / u.norm()).min(1.0) * Complex::cis(theta + 1.5 * T_S * e);
        }
        rows
    }
}

/// The file of some rows.
pub(crate) fn file(rows: &[Row]) -> String {
    let mut text = String::from("t [s],u_alpha,u_beta,i_a,i_b,i_c,theta,tau_load,u_dc\n");
    for Row { t, u, i, theta, load } in rows {
        let _ = writeln!(text, "{t},{},{},{},{},{},{theta},{load},{U_DC}", u.re, u.im, i[0], i[1], i[2]);
    }
    text
}
