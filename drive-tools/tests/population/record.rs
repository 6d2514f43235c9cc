//! Records of an independent plant on a bench: its drive receives steps of speed, d-axis current and load, and an encoder of 4096
//! steps with an offset and a delay measures the angle.

use crate::foreign::{Bench, Motor};
use drive_base::frame::{AlphaBeta, Phases};
use drive_tools::identify::Complex;
use fmu_core::draw::Draw;
use std::f64::consts::TAU;

/// A part of a run, all of the same length: speed, d-axis current and load as shares of the rated speed, the maximum current and
/// the rated torque.
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

fn complex(x: AlphaBeta) -> Complex {
    Complex::new(x.alpha(), x.beta())
}

/// The record of a run: columns with their names, one row every `every` samples.
pub(crate) fn record(
    m: &Motor,
    seed: u64,
    index: u64,
    time: f64,
    parts: &[Part],
    every: usize,
) -> Vec<(String, Vec<f64>)> {
    /// Time in s with the gates off.
    const PRE: f64 = 0.05;
    let names = ["t", "u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "tau_load", "u_dc"];
    let mut columns = names.map(|name| (name.to_owned(), Vec::new()));
    let mut bench = Bench::new(m.clone(), seed.wrapping_mul(31337).wrapping_add(index));
    let mut draw = Draw(seed.wrapping_mul(555).wrapping_add(index));
    let (theta_0, tau) = (draw.between(-0.2, 0.2), draw.share() * m.T);
    let (rated, torque, K) = (m.speed(), m.torque(), 1.5 * m.n_p * m.psi);
    let w_c = (0.12 / m.T).min(4000.0);
    let bandwidth = (0.05 * w_c).min(20.0);
    let U = 0.95 * m.u_dc / 3.0_f64.sqrt();
    let zero = Complex::new(0.0, 0.0);
    let (mut command, mut sum, mut i_sum, mut reference) = (zero, zero, 0.0, 0.0);
    for k in 0..(time / m.T) as usize {
        let t = k as f64 * m.T;
        bench.gates = t >= PRE;
        let Phases { a, b, c } = bench.measure();
        let part = ((t - PRE) / (time - PRE) * parts.len() as f64).clamp(0.0, parts.len() as f64 - 1.0) as usize;
        let (speed, i_d, load) = parts[part];
        bench.load = if bench.gates { load * torque * (bench.w / (0.02 * rated)).tanh() } else { 0.0 };
        let theta = m.n_p * bench.theta;
        if k % every == 0 {
            let step = TAU / 4096.0 * m.n_p;
            let seen = (((theta - m.n_p * bench.w * tau + theta_0) / step).floor() * step).rem_euclid(TAU);
            let row = [t, command.re, command.im, a, b, c, seen, bench.load, m.u_dc];
            columns.iter_mut().zip(row).for_each(|((_, column), x)| column.push(x));
        }
        if !bench.gates {
            continue;
        }
        let rate = (rated / 0.15).min(0.8 * K * 0.5 * m.I / m.J);
        reference += (speed * rated - reference).clamp(-rate * m.T, rate * m.T);
        let error = reference - bench.w;
        let wanted = bandwidth * m.J / K * error + i_sum;
        let i_q = wanted.clamp(-0.5 * m.I, 0.5 * m.I);
        if wanted.abs() <= 0.5 * m.I {
            i_sum += 0.25 * bandwidth * bandwidth * m.J / K * error * m.T;
        }
        let [x, y, z] = m.offset;
        let i = complex(Phases { a: a - x, b: b - y, c: c - z }.to_stator()) * Complex::cis(theta).conj();
        let off = Complex::new(i_d * m.I, i_q) - i;
        let w = m.n_p * bench.w;
        let proportional = Complex::new(m.L_d * off.re, m.L_q * off.im);
        let u = proportional * (0.5 * w_c) + sum + Complex::new(-w * m.L_q * i.im, w * (m.psi + m.L_d * i.re));
        let size = u.norm();
        let u = if size < U {
            sum += (proportional * (0.1 * w_c * w_c) + off * (0.25 * w_c * m.R)) * m.T;
            u
        } else {
            u * (U / size)
        };
        command = u * Complex::cis(theta + 1.5 * m.T * w);
        bench.tick(AlphaBeta::new(command.re, command.im), true);
    }
    columns.into()
}
