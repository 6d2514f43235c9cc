//! Equations of Kim & Sul up to (32), as corrected, against the machine: residuals below 1e-10.
//!
//! The machine in a frame that is theta~ behind the rotor and turns at w_f, exactly: lambda = L(theta~) i + psi e^{j theta~},
//! v = R i + d lambda/dt + j w_f lambda, where theta~' = w_r - w_f.
#![allow(missing_docs, non_snake_case)]

use nalgebra::{Complex, Matrix2, Matrix4, Vector2, Vector4};
use std::f64::consts::TAU;

type V = Vector2<f64>;

const R: f64 = 3.6;
const L_D: f64 = 36e-3;
const L_Q: f64 = 51e-3;
const PSI: f64 = 0.545;
const J: Matrix2<f64> = Matrix2::new(0.0, -1.0, 1.0, 0.0);

/// An operating point: current (A) and its derivative (A/s) in the frame, speeds of rotor and frame in rad/s.
#[derive(Clone, Copy)]
struct Point {
    i: V,
    di: V,
    w_r: f64,
    w_f: f64,
}

fn points() -> impl Iterator<Item = Point> {
    (0..50).map(|k| {
        let x = f64::from(k);
        let wave = |rate: f64, size: f64| size * (rate * x + 0.3).sin();
        let w_r = wave(0.9, 471.0);
        let (i, di) = (V::new(wave(0.7, 8.0), wave(1.3, 9.0)), V::new(wave(2.1, 900.0), wave(1.7, 700.0)));
        Point { i, di, w_r, w_f: w_r + wave(1.1, 40.0) }
    })
}

fn e_j(theta: f64) -> V {
    V::new(theta.cos(), theta.sin())
}

/// Inductance in the frame.
fn L(theta: f64, l_d: f64, l_q: f64) -> Matrix2<f64> {
    let (sum, half) = (0.5 * (l_d + l_q), 0.5 * (l_d - l_q));
    let (s, c) = (2.0 * theta).sin_cos();
    Matrix2::new(sum + half * c, half * s, half * s, sum - half * c)
}

/// Voltage of the machine.
fn voltage(p: &Point, theta: f64, l_d: f64, l_q: f64) -> V {
    let half = 0.5 * (l_d - l_q);
    let (s, c) = (2.0 * theta).sin_cos();
    let dL = Matrix2::new(-s, c, c, s) * (2.0 * half);
    let slip = p.w_r - p.w_f;
    let lambda = L(theta, l_d, l_q) * p.i + e_j(theta) * PSI;
    let d_lambda = L(theta, l_d, l_q) * p.di + dL * p.i * slip + J * e_j(theta) * (PSI * slip);
    p.i * R + d_lambda + J * lambda * p.w_f
}

/// Derivative at 0 of a trigonometric polynomial of degree below 8: exact.
fn slope(f: impl Fn(f64) -> V) -> V {
    let n = 16;
    let mut sum = V::zeros();
    for k in 1..n {
        let x = TAU * f64::from(k) / f64::from(n);
        let weight = if k % 2 == 0 { 1.0 } else { -1.0 } * -0.5 / (0.5 * x).tan();
        sum += f(x) * -weight;
    }
    -sum
}

fn small(residual: V, of: &str) {
    assert!(residual.norm() < 1e-10, "{of}: {residual:?}");
}

#[test]
fn the_slope_is_exact() {
    let d = slope(|x| V::new(3.0 * x.sin() - 2.0 * (2.0 * x).sin(), x.cos()));
    assert!((d - V::new(-1.0, 0.0)).norm() < 1e-12, "{d:?}");
}

/// (9), (10): w_r multiplies both vectors, and the gain of the d row is psi + (L_d - L_q) i_d.
#[test]
fn eq_10_gain_of_the_angle() {
    for p in points().map(|p| Point { w_f: p.w_r, ..p }) {
        let e = |theta: f64| voltage(&p, theta, L_D, L_Q) - p.i * R - L(theta, L_D, L_Q) * p.di;
        small(e(0.0) - V::new(-L_Q * p.i.y, L_D * p.i.x + PSI) * p.w_r, "(9) at no error");
        let gain = V::new((L_Q - L_D) * p.i.x - PSI, -(L_Q - L_D) * p.i.y) * p.w_r;
        small(slope(e) - gain, "(10)");
    }
}

/// (11) with the frame term: in a correct frame, only w_r psi on q remains, at any speed of the frame.
#[test]
fn eq_11_and_14_with_the_frame_term() {
    for p in points() {
        let v = voltage(&p, 0.0, L_D, L_Q);
        let slip = p.w_f - p.w_r;
        let e = V::new(
            v.x - R * p.i.x - L_D * p.di.x + p.w_r * L_Q * p.i.y + slip * L_D * p.i.y,
            v.y - R * p.i.y - L_Q * p.di.y - p.w_r * L_D * p.i.x - slip * L_Q * p.i.x,
        );
        small(e - V::new(0.0, p.w_r * PSI), "(11)");
        // (14): -1/L_d and -1/L_q in the EMF columns, input (v_ds, v_qs).
        let p = Point { w_f: p.w_r, ..p };
        let (v, w) = (voltage(&p, 0.0, L_D, L_Q), p.w_r);
        #[rustfmt::skip]
        let A = Matrix4::new(
            -R / L_D, w * L_Q / L_D, -1.0 / L_D, 0.0,
            -w * L_D / L_Q, -R / L_Q, 0.0, -1.0 / L_Q,
            0.0, 0.0, 0.0, 0.0,
            0.0, 0.0, 0.0, 0.0,
        );
        let dx = A * Vector4::new(p.i.x, p.i.y, 0.0, w * PSI) + Vector4::new(v.x / L_D, v.y / L_Q, 0.0, 0.0);
        let scale = 1e-3; // A/s to the size of volts
        small((V::new(dx.x, dx.y) - p.di) * scale, "(14)");
    }
}

/// (16)-(18): exact at every angle error and frame speed, currents changing.
#[test]
fn eq_18_extended_emf_is_exact() {
    for (k, p) in points().enumerate() {
        let theta = 0.1 * f64::from(u32::try_from(k).unwrap()) - 2.0;
        let v = voltage(&p, theta, L_D, L_Q);
        let e = v - p.i * R - p.di * L_D - J * p.i * (p.w_r * L_Q);
        // The derivative of i_q in the true rotor frame.
        let turn = |x: V| V::new(x.x * theta.cos() + x.y * theta.sin(), x.y * theta.cos() - x.x * theta.sin());
        let i = turn(p.i);
        let di = turn(p.di) - J * i * (p.w_r - p.w_f);
        let E = p.w_r * ((L_D - L_Q) * i.x + PSI) - (L_D - L_Q) * di.y;
        let right = V::new(-theta.sin(), theta.cos()) * E + J * p.i * ((p.w_f - p.w_r) * L_D);
        small(e - right, "(18)");
    }
}

/// (21): with the measured current in the innovation, l_1 = 2 w_o - R/L and l_2 = -w_o^2 L give (s + w_o)^2.
#[test]
fn eq_21_poles() {
    let w_o = TAU * 150.0;
    let (l_1, l_2) = (2.0 * w_o - R / L_D, -w_o * w_o * L_D);
    let A = Matrix2::new(-R / L_D - l_1, -1.0 / L_D, -l_2, 0.0);
    for s in [0.0, 500.0, 2000.0] {
        let determinant = (Matrix2::identity() * s - A).determinant();
        assert!((determinant / ((s + w_o) * (s + w_o)) - 1.0).abs() < 1e-10);
    }
}

/// (24), (25): the q row is L_q p i_q + w L_d i_d; the calculated speed is exact with the frame term.
#[test]
fn eq_24_and_25() {
    for p in points() {
        let v = voltage(&p, 0.0, L_D, L_Q);
        let slip = p.w_f - p.w_r;
        let w = (v.y - R * p.i.y - L_Q * p.di.y - slip * L_Q * p.i.x) / (PSI + L_D * p.i.x);
        assert!((w - p.w_r).abs() < 1e-10, "(25): {w}, not {}", p.w_r);
        let still = Point { w_f: p.w_r, ..p };
        let v = voltage(&still, 0.0, L_D, L_Q);
        let q = R * p.i.y + L_Q * p.di.y + p.w_r * L_D * p.i.x + p.w_r * PSI;
        small(V::new(0.0, v.y - q), "(24)");
    }
}

/// (27), (30), (32), where they are exact (L_d = L_q): the d row shows the angle, the q row the speed.
#[test]
fn eq_30_and_32_without_saliency() {
    let T_s = 1e-4;
    for (k, p) in points().enumerate() {
        let theta = 0.05 * f64::from(u32::try_from(k).unwrap()) - 1.2;
        // The frame turns at the estimated speed.
        let w_hat = p.w_f;
        let v = voltage(&p, theta, L_D, L_D);
        let model = V::new(
            (v.x - R * p.i.x + w_hat * L_D * p.i.y) / L_D,
            (v.y - R * p.i.y - w_hat * L_D * p.i.x - w_hat * PSI) / L_D,
        );
        let di = (p.di - model) * T_s;
        let right = V::new(p.w_r * theta.sin(), w_hat - p.w_r * theta.cos()) * (PSI * T_s / L_D);
        small(di - right, "(30)");
        // (31) with R_s on both rows, constant currents.
        let steady = Point { di: V::zeros(), ..p };
        let v = voltage(&steady, theta, L_D, L_D);
        let forward = p.i * R + J * p.i * (w_hat * L_D) + V::new(0.0, w_hat * PSI);
        small(V::new(v.x - forward.x + p.w_r * PSI * theta.sin(), 0.0), "(32)");
    }
}

/// The convention: Complex and the matrices above turn the same way.
#[test]
fn j_is_j() {
    let z = Complex::new(0.3, -0.8) * Complex::i();
    assert!((J * V::new(0.3, -0.8) - V::new(z.re, z.im)).norm() < 1e-15);
}
