//! Equations of Kim & Sul from (33) on, as corrected, against the machine: residuals below 1e-10; where the printed equation is
//! wrong, its residual is shown.
#![allow(missing_docs, non_snake_case)]

use nalgebra::{Matrix2, Rotation2, Vector2};

type V = Vector2<f64>;

const R: f64 = 3.6;
const L_D: f64 = 36e-3;
const L_Q: f64 = 51e-3;
const PSI: f64 = 0.545;
/// Amplitude in V and angular frequency in rad/s of the carrier.
const V_INJ: f64 = 70.0;
const W_H: f64 = 2.0 * std::f64::consts::PI * 1000.0;
/// Sum and difference of (35) in H: halves, with L_d < L_q the difference is negative.
const SUM: f64 = 0.5 * (L_D + L_Q);
const DIFF: f64 = 0.5 * (L_D - L_Q);

/// Inductance in a frame that is `theta` behind the rotor: the rotor's, rotated. No double angle is used.
fn inductance(theta: f64) -> Matrix2<f64> {
    let turn = Rotation2::new(theta);
    turn * Matrix2::new(L_D, 0.0, 0.0, L_Q) * turn.inverse()
}

/// Its derivative by the angle.
fn inductance_slope(theta: f64) -> Matrix2<f64> {
    let j = Matrix2::new(0.0, -1.0, 1.0, 0.0);
    j * inductance(theta) - inductance(theta) * j
}

fn double(theta: f64) -> (f64, f64) {
    (2.0 * theta).sin_cos()
}

/// Points: angle, electrical speed in rad/s, current in A, its derivative in A/s.
fn points() -> impl Iterator<Item = (f64, f64, V, V)> {
    (0..60).map(|k| {
        let x = f64::from(k);
        let wave = |rate: f64, size: f64| size * (rate * x + 0.4).sin();
        (0.21 * x, wave(0.9, 471.0), V::new(wave(0.7, 8.0), wave(1.3, 9.0)), V::new(wave(2.1, 900.0), wave(1.7, 700.0)))
    })
}

fn small(residual: f64, of: &str) {
    assert!(residual.abs() < 1e-10, "{of}: {residual:e}");
}

/// (35) and (36): the position is in the second term (inductances) and in the third (fluxes); the text after (36) that calls
/// the inductances the third term is wrong, for at standstill the third is zero and the second is not.
#[test]
fn eq_36_is_exact_and_its_second_term_is_the_saliency() {
    for (theta, w, i, di) in points() {
        let (s, c) = double(theta);
        let of_35 = Matrix2::new(SUM + DIFF * c, DIFF * s, DIFF * s, SUM - DIFF * c);
        small((of_35 - inductance(theta)).norm(), "(35)");
        let magnet = V::new(-theta.sin(), theta.cos()) * PSI;
        let exact = i * R + inductance(theta) * di + (inductance_slope(theta) * i + magnet) * w;
        let third = (Matrix2::new(-s, c, c, s) * i * (2.0 * DIFF) + magnet) * w;
        small((i * R + of_35 * di + third - exact).norm(), "(36)");
    }
    let (at_rest, turned) = (inductance(0.0), inductance(0.5));
    assert!((at_rest - turned).norm() > 1e-3, "the second term has the angle at standstill");
}

/// (37) omits dL/dt i: zero at standstill, a share w / w_h of the whole when turning.
#[test]
fn eq_37_lacks_the_turning_inductance() {
    for (theta, w, i, di) in points() {
        let whole = inductance(theta) * di + inductance_slope(theta) * i * w;
        let dropped = whole - inductance(theta) * di;
        small((dropped - inductance_slope(theta) * i * w).norm(), "(37) with what it drops");
        assert!(w.abs() < 1.0 || dropped.norm() > 1e-6 * w.abs(), "{dropped:?} at {w} rad/s");
    }
}

/// (39) is right: it solves (37) for the rotating voltage (38).
#[test]
fn eq_39_solves_37_and_38() {
    let scale = V_INJ / (SUM * SUM - DIFF * DIFF);
    for (k, (theta_0, w, ..)) in points().enumerate() {
        let t = 1.7e-5 * f64::from(u32::try_from(k).unwrap());
        let (carrier, theta) = (W_H * t, theta_0 + w * t);
        // Derivatives of (39): the second part turns at 2 w_r - w_h.
        let di_alpha = scale * (-SUM * carrier.sin() - DIFF * (2.0 * theta - carrier).sin());
        let di_beta = scale * (SUM * carrier.cos() + DIFF * (2.0 * theta - carrier).cos());
        let u = V::new(-carrier.sin(), carrier.cos()) * V_INJ;
        small((inductance(theta) * V::new(di_alpha, di_beta) - u).norm(), "(37) with (38) and (39)");
    }
}

/// (44): cos^2 and sin^2 are of theta~, not of w_h t, and the q row has no 1/2 with dL = (L_d - L_q)/2: so (45) is a factor 2 low.
#[test]
fn eq_44_and_45_without_the_half() {
    for k in 0..60 {
        let error = -1.5 + 0.05 * f64::from(k);
        // L di/dt = V cos(w_h t) along the estimated d axis gives amplitudes L^-1 V / w_h of sin(w_h t).
        let exact = inductance(error).try_inverse().unwrap() * V::new(V_INJ / W_H, 0.0);
        let (sin, cos) = error.sin_cos();
        let d = V_INJ / W_H * (cos * cos / L_D + sin * sin / L_Q);
        let q = V_INJ / W_H * (-DIFF / (L_D * L_Q)) * (2.0 * error).sin();
        small((exact - V::new(d, q)).norm(), "(44)");
        assert!(error.abs() < 0.01 || (exact.y - 0.5 * q).abs() > 0.4 * q.abs(), "the print's half");
    }
    // (45), corrected: the slope of the q amplitude at zero error.
    let h = 1e-6;
    let amplitude = |error: f64| (inductance(error).try_inverse().unwrap() * V::new(V_INJ / W_H, 0.0)).y;
    let slope = (amplitude(h) - amplitude(-h)) / (2.0 * h);
    small(slope - V_INJ / W_H * (-DIFF / (L_D * L_Q)) * 2.0, "(45)");
}
