//! Expected results of the example `TwoInertias`: the FMU in Co-Simulation, and the equations of the drive train by
//! Runge-Kutta.
//!
//! J_r dw_r/dt = tau_shaft - tau_c, J_l dw_l/dt = tau_c + tau_load, tau_c = c (phi_r - phi_l) + d (w_r - w_l). In a step h the
//! FMU uses the speed at its beginning, and the train the mean torque of the step, so the result has a delay error of about h /
//! 2.

use super::interface::Interface;
use anyhow::{Context, Result, ensure};
use fmu_import::{Fmu, Instance, Values};
use std::path::Path;

/// Speed reference in rad/s from 0.1 s on: 1000 rpm.
pub(super) const SPEED: f64 = 104.72;
/// Load torque in N.m from 0.6 s on.
pub(super) const LOAD: f64 = 1.0;
/// The coupling: stiffness in N.m/rad, damping in N.m.s/rad; and the inertia of the load in kg.m2.
pub(super) const COUPLING: (f64, f64, f64) = (500.0, 0.2, 2e-3);
/// End of the examples in s.
pub(super) const STOP: f64 = 1.0;

/// Steps per second. Halving their length changes the figures by 0.006 rad/s and 0.001 N.m.
const RATE: f64 = 50_000.0;

/// Numbers of steps at the figures: during the start, at speed, and twice under load.
const ROW: [u32; 4] = [7_500, 15_000, 35_000, 50_000];

/// A figure: time in s, speed of the load in rad/s, torque of the coupling in N.m.
pub(super) type Figure = (f64, f64, f64);

/// Runs the example.
///
/// # Errors
/// The binary for this computer is missing, or the FMU ends the run.
pub(super) fn of(file: &Path, interface: &Interface) -> Result<Vec<Figure>> {
    let (shaft, flag, inertia) = interface.imposed.as_ref().context("the FMU has no imposed shaft")?;
    let fmi = |name: &str| {
        let all = interface.inputs.iter().chain(&interface.outputs).chain(&interface.parameters);
        all.into_iter().find(|v| v.name == name).map(|v| v.fmi.clone()).with_context(|| name.to_owned())
    };
    let (speed, angle, tau) = (fmi(&shaft.speed)?, fmi(&shaft.angle)?, fmi(&shaft.tau)?);
    let reference = interface.signals().find(|v| v.name == "speed_ref").map(|v| v.fmi.clone());
    let fmu = Fmu::open(file)?;
    let mut drive = fmu.instantiate("drive", false)?;
    drive.set_text(&fmi(flag)?, "true")?;
    drive.setup(0.0, Some(STOP))?;
    drive.enter_initialization()?;
    let rotor = real(&mut drive, &fmi(inertia)?)?;
    drive.exit_initialization()?;
    let (c, d, load) = COUPLING;
    // Speed and angle of the rotor, of the load.
    let mut x = [0.0; 4];
    let mut rows = Vec::new();
    for k in 0..=ROW[3] {
        let t = f64::from(k) / RATE;
        let coupling = |x: &[f64; 4]| c * (x[1] - x[3]) + d * (x[0] - x[2]);
        if ROW.contains(&k) {
            rows.push((t, x[2], coupling(&x)));
        }
        let at = |from: f64| t > from - 0.5 / RATE;
        if let Some(name) = &reference {
            drive.set(name, Values::Reals(vec![if at(0.1) { SPEED } else { 0.0 }]))?;
        }
        drive.set(&speed, Values::Reals(vec![x[0]]))?;
        drive.set(&angle, Values::Reals(vec![x[1]]))?;
        ensure!(k == ROW[3] || drive.do_step(t, 1.0 / RATE)?.is_continue(), "the FMU ends the run at {t} s");
        let (shaft, outside) = (real(&mut drive, &tau)?, if at(0.6) { -LOAD } else { 0.0 });
        let rate = |x: &[f64; 4]| [(shaft - coupling(x)) / rotor, x[0], (coupling(x) + outside) / load, x[2]];
        let ahead = |k: &[f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
        let a = rate(&x);
        let b = rate(&ahead(&a, 0.5 / RATE));
        let e = rate(&ahead(&b, 0.5 / RATE));
        let f = rate(&ahead(&e, 1.0 / RATE));
        x = std::array::from_fn(|i| x[i] + 1.0 / (6.0 * RATE) * (a[i] + 2.0 * (b[i] + e[i]) + f[i]));
    }
    Ok(rows)
}

fn real(drive: &mut Instance, name: &str) -> Result<f64> {
    let values = drive.get(name)?;
    match &values {
        Values::Reals(all) if all.len() == 1 => Ok(all[0]),
        _ => anyhow::bail!("{name} = {values}: expected a real number"),
    }
}
