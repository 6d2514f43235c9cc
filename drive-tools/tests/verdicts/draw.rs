//! Machines drawn within the ranges of data sheets: 5 W to 300 kW at 12 V to 800 V. Everything is scaled to the rated point,
//! as machines are: EMF, resistance and reactances in per unit, the inertia as the time to the rated speed.

use fmu_core::digits::rounded;
use fmu_core::draw::Draw;
use std::f64::consts::{PI, TAU};

fn one_of<T: Copy>(draw: &mut Draw, all: &[T]) -> T {
    let place = (draw.share() * f64::from(u32::try_from(all.len()).expect("few"))).floor();
    all.iter().copied().zip(0_u32..).find(|&(_, k)| f64::from(k) >= place).expect("one of them").0
}

/// A number with three digits, as in a data sheet.
fn short(x: f64) -> f64 {
    rounded(x, 3)
}

/// The text of a machine's file.
pub(crate) fn machine(draw: &mut Draw, name: &str) -> String {
    let P = draw.scaled(5.0, 300e3);
    let u_dc: f64 = match P {
        ..60.0 => one_of(draw, &[12.0, 24.0, 24.0, 36.0, 48.0]),
        ..1000.0 => one_of(draw, &[24.0, 36.0, 48.0, 72.0, 310.0, 325.0]),
        ..6000.0 => one_of(draw, &[48.0, 96.0, 310.0, 325.0, 540.0, 560.0]),
        ..30e3 => one_of(draw, &[325.0, 400.0, 540.0, 560.0, 600.0]),
        _ => one_of(draw, &[360.0, 400.0, 540.0, 600.0, 650.0, 800.0]),
    };
    // Direct drives turn slowly; small machines turn faster than large ones.
    let slow = draw.share() < 0.15;
    let rpm =
        if slow { draw.scaled(60.0, 600.0) } else { draw.scaled(1000.0, (60e3 / P.powf(0.15)).clamp(6000.0, 40e3)) };
    let rpm = if P > 30e3 { rpm.min(7000.0) } else { rpm };
    let speed = rpm * PI / 30.0;
    let torque = P / speed;
    let salient = P > 300.0 && draw.share() < 0.5;
    let f = draw.scaled(50.0, if P < 200.0 || rpm > 8000.0 { 1000.0 } else { 400.0 });
    let n_p = (f * TAU / speed).round().clamp(1.0, if slow { 30.0 } else { 10.0 });
    let w = n_p * speed;
    let emf = if salient { draw.between(0.35, 0.75) } else { draw.between(0.45, 0.82) } * u_dc / 3.0_f64.sqrt();
    let psi_M = emf / w;
    let i = torque / (1.5 * n_p * psi_M);
    let resistive = (0.16 * (P / 50.0).powf(-0.28) * draw.scaled(0.5, 2.0)).clamp(0.003, 0.3);
    let x_q = if salient { draw.scaled(0.35, 1.1) } else { draw.scaled(0.06, 0.5) };
    let ratio = if salient { draw.scaled(1.25, 3.5) } else { 1.0 };
    let (L_q, R_s) = (x_q * emf / (w * i), resistive * emf / i);
    let L_d = L_q / ratio;
    // The minimum current for a torque is smaller with saliency.
    let dL = L_q - L_d;
    let least = (1..=400)
        .map(|k| {
            let i_d = -2.0 * i * f64::from(k - 1) / 400.0;
            i_d.hypot(torque / (1.5 * n_p * (psi_M - dL * i_d)))
        })
        .fold(f64::INFINITY, f64::min);
    let current = least * if salient { draw.between(1.05, 2.0) } else { draw.between(1.4, 3.5) };
    let J = torque / speed * if slow { draw.scaled(0.05, 2.0) } else { draw.scaled(5e-3, 0.5) };
    let top = if draw.share() < 0.25 { speed * draw.between(1.2, if salient { 3.0 } else { 1.5 }) } else { speed };
    let friction = if draw.share() < 0.5 { 0.0 } else { draw.between(0.003, 0.03) * torque };
    let [psi_M, L_q, L_d, R_s, current, J, speed, top, torque, friction] =
        [psi_M, L_q, L_d, R_s, current, J, speed, top, torque, friction].map(short);
    let top = if top > speed { format!("speed_max = {top}\n") } else { String::new() };
    let coulomb = if friction > 0.0 {
        format!("tau_coulomb = {friction}\nw_coulomb = {}\n", short(0.002 * speed))
    } else {
        String::new()
    };
    format!(
        "name = \"{name}\"\nsource = \"drawn\"\n[machine]\nn_p = {n_p}\nR_s = {R_s:e}\nL_d = {L_d:e}\nL_q = {L_q:e}\npsi_M = {psi_M:e}\n\
         [mechanics]\nJ = {J:e}\n{coulomb}[rating]\nspeed = {speed}\n{top}torque = {torque}\ncurrent = {current}\n[dc_link]\nu_dc = {u_dc:.1}\n"
    )
}
