//! The torque-speed plane, the losses and the efficiency map of the reference drive, drawn for the documentation page: curves from the
//! equations of the steady state, dots from the running drive.
//!
//! To stack quantities, a [`Panel`] fills their sums down to zero, the largest first.
//!
//! Steady state of a drive whose controller receives the torque `tau` and has exact machine values but no model of the losses: at
//! the samples, i is the current for `tau` under the voltage of field weakening. The voltage is held over T_s while the rotor
//! turns; the mean current is i_s. With g = G w
//!
//! ```text
//! i_s = i + j w u T_s^2 / (12 L)
//! i_s = i_m + j g psi(i_m)    p_cu = 1.5 R |i_s|^2    p_iron = 1.5 g w |psi|^2    tau_e = 1.5 n_p psi x i_m
//! p_cond = 3 ((2/pi) u_on |i_s| + r_on |i_s|^2 / 2)         p_sw = 3 (2/pi) |i_s| k
//! ```
//!
//! u_on, r_on of transistor and diode alike, so the duty cycle has no influence; k is the switching loss per ampere.

use crate::runner::{self, REFERENCE_SPEED, REFERENCE_TORQUE};
use drive::Pair;
use drive::control::envelope::{Envelope, Limit};
use drive::estimator::Kind;
use drive::frame::{Dq, DqHat};
use drive::plant::losses::{Losses, efficiency, switching};
use drive::plant::machine;
use drive::steady::Steady;
use drive_tools::error::{Error, Result};
use drive_tools::map::{self, picture};
use fmu_plot::chart::Chart;
use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::ink::{CURVES, Ink};
use std::f64::consts::PI;

const RPM: f64 = PI / 30.0;

/// A figure of panels over the speed, one below the other.
pub fn figure(panels: Vec<Panel>) -> Figure {
    Figure { title: String::new(), x: "speed in rpm", columns: 1, panels }
}

/// A curve over the speed in rpm with the area between it and zero.
fn area(name: &str, ink: Ink, fill: f64, points: impl Iterator<Item = (f64, f64)>) -> Curve {
    Curve { fill, ..Curve::through(name, ink, points) }
}

/// The drive in steady state.
#[derive(Clone, Copy, Debug, Default)]
pub struct OperatingPoint {
    /// Speed in rpm.
    pub rpm: f64,
    /// Torque reference of the controller in N.m.
    pub tau: f64,
    /// Electromagnetic torque in N.m.
    pub tau_e: f64,
    /// Torque at the shaft in N.m.
    pub tau_shaft: f64,
    /// Losses in W.
    pub losses: Losses,
    /// Efficiency.
    pub efficiency: f64,
}

/// The reference drive with field weakening, exact estimates and a sensor, on a shaft that turns at an imposed speed.
struct Reference {
    pair: Pair,
    envelope: Envelope,
    /// Voltage in V that field weakening uses.
    U: f64,
}

impl Reference {
    fn new() -> Self {
        let mut pair = Pair::default();
        let plant = &mut pair.plant.model.parameters;
        plant.mechanics.imposed = true;
        let par = &mut pair.controller.model.parameters;
        par.motor.clone_from(&plant.motor);
        par.estimator = Kind::Sensored;
        (par.speed_loop.torque_mode, par.weakening.used) = (true, true);
        (par.limit.i_q, par.limit.tau) = (par.limit.i, 1000.0);
        let (envelope, u_dc) = (Envelope::new(&par.motor, par.limit.i), pair.plant.model.inputs.u_dc);
        let U = par.weakening.k_u * u_dc / 3.0_f64.sqrt();
        Self { pair, envelope, U }
    }

    /// The drive with assumed losses of iron and inverter.
    fn lossy() -> Self {
        let mut drive = Self::new();
        let plant = &mut drive.pair.plant.model.parameters;
        (plant.iron.G_e, plant.iron.G_h) = (1.3e-4, 0.12);
        let devices = &mut plant.inverter.devices;
        (devices.u_transistor, devices.r_transistor, devices.u_diode, devices.r_diode) = (0.8, 0.08, 0.8, 0.08);
        (devices.E_sw, devices.i_sw, devices.u_sw, devices.k_sw) = (0.5e-3, 10.0, 300.0, 1.3);
        drive
    }

    /// Electrical speed in rad/s.
    fn electrical(&self, rpm: f64) -> f64 {
        f64::from(self.pair.plant.model.parameters.motor.n_p) * rpm * RPM
    }

    /// The maximum torque with sign `s`.
    fn limit(&self, rpm: f64, s: f64) -> Limit {
        self.envelope.settled(self.electrical(rpm), s, self.U)
    }

    /// The current (A) for `tau` (N.m): i_d = 0 where the voltage suffices, because L_d = L_q.
    fn current(&self, rpm: f64, tau: f64) -> DqHat {
        let (envelope, w) = (&self.envelope, self.electrical(rpm));
        let limit = self.limit(rpm, tau.signum());
        let i = DqHat::new(0.0, envelope.i_q(tau, 0.0));
        if tau.abs() >= limit.tau {
            limit.i
        } else if envelope.excess(i, w, self.U) <= 0.0 {
            i
        } else {
            let i_d = envelope.i_d(tau, w, self.U, 0.0, 8).unwrap_or(f64::NAN);
            DqHat::new(i_d, envelope.i_q(tau, i_d))
        }
    }

    /// The steady state by the equations, for the torque `tau` (N.m) of the controller.
    fn steady(&self, rpm: f64, tau: f64) -> OperatingPoint {
        let plant = &self.pair.plant.model;
        let (par, motor) = (&plant.parameters, &plant.parameters.motor);
        let (sampled, w) = (self.current(rpm, tau), self.electrical(rpm));
        let (u_d, u_q) = (
            motor.R_s * sampled.d() - w * motor.L_q * sampled.q(),
            motor.R_s * sampled.q() + w * (motor.psi_M + motor.L_d * sampled.d()),
        );
        let held = w * self.pair.controller.model.parameters.T_s.powi(2) / 12.0;
        let i = Dq::new(sampled.d() - held * u_q / motor.L_d, sampled.q() + held * u_d / motor.L_q);
        let g = par.iron.conductance(w) * w;
        let i_d = (i.d() + g * motor.L_q * (i.q() - g * motor.psi_M)) / (1.0 + g * g * motor.L_d * motor.L_q);
        let i_m = Dq::new(i_d, i.q() - g * (motor.psi_M + motor.L_d * i_d));
        let psi = machine::flux(motor, i_m);
        let tau_e = 1.5 * f64::from(motor.n_p) * (psi.d() * i_m.q() - psi.q() * i_m.d());
        let (devices, friction) = (&par.inverter.devices, par.mechanics.friction(rpm * RPM));
        let (peak, mean) = (i.magnitude(), 2.0 / PI * i.magnitude());
        let losses = Losses {
            cu: 1.5 * motor.R_s * peak * peak,
            iron: 1.5 * g * w * psi.dot(psi),
            cond: 3.0 * (devices.u_transistor * mean + 0.5 * devices.r_transistor * peak * peak),
            sw: 3.0 * mean * switching::per_ampere(devices, par.inverter.T_pwm, plant.inputs.u_dc),
            friction: friction * rpm * RPM,
        };
        let (tau_shaft, p_mech) = (tau_e - friction, (tau_e - friction) * rpm * RPM);
        OperatingPoint { rpm, tau, tau_e, tau_shaft, losses, efficiency: efficiency(p_mech + losses.sum(), p_mech) }
    }

    /// The steady state with the torque `wanted` (N.m) at the shaft or, if this is out of reach, with the maximum of this sign.
    fn at_shaft(&self, rpm: f64, wanted: f64) -> OperatingPoint {
        let end = |s: f64| s * self.limit(rpm, s).tau;
        self.steady(rpm, bisect(end(-1.0), end(1.0), |tau| self.steady(rpm, tau).tau_shaft < wanted))
    }

    /// The steady state of the running drive: means of the last tenth of 0.5 s.
    fn run(&self, rpm: f64, tau: f64) -> Result<OperatingPoint> {
        let (mut pair, mut n, mut torque, mut p_in, mut p_mech) = (self.pair.clone(), 0.0, 0.0, 0.0, 0.0);
        let mut losses = Losses::none();
        let survived = runner::run_in_steps(&mut pair, 1e-4, 0.5, |t, pair| {
            let plant = &mut pair.plant.model.inputs;
            (plant.speed_shaft, plant.angle_shaft) = (rpm * RPM, rpm * RPM * t);
            pair.controller.model.inputs.tau_ref = tau;
            if t > 0.45 {
                let (out, powers) = (&pair.plant.out, &pair.plant.out.powers);
                (n, torque) = (n + 1.0, torque + out.tau_e);
                (p_in, p_mech) = (p_in + powers.p_in, p_mech + powers.p_mech);
                losses.add(&powers.losses);
            }
        })
        .map_err(Error::new)?;
        if !survived {
            return Err(Error::new(format!("a step failed at {rpm} rpm")));
        }
        let (tau_shaft, efficiency) = (p_mech / n / (rpm * RPM), efficiency(p_in, p_mech));
        Ok(OperatingPoint { rpm, tau, tau_e: torque / n, tau_shaft, losses: losses.map(|sum| sum / n), efficiency })
    }
}

/// The maximum value between `low` and `high` up to which `holds` is true.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..60 {
        let mid = 0.5 * (low + high);
        *(if holds(mid) { &mut low } else { &mut high }) = mid;
    }
    low
}

/// The envelope of the reference drive.
#[derive(Clone, Debug)]
pub struct Plane {
    /// Base speed in rpm.
    pub base: f64,
    /// Speed in rpm above which there is no motoring torque.
    pub end: f64,
    /// Maximum motoring and generating torque.
    pub panel: Panel,
}

/// The envelope of the reference drive: its curves, and the torque of the running drive at the speeds of `measured` (rpm).
///
/// # Errors
/// A step fails.
pub fn envelope(measured: &[f64]) -> Result<Plane> {
    let drive = Reference::new();
    let (limit, u_dc) = (&drive.pair.controller.model.parameters.limit, drive.pair.plant.model.inputs.u_dc);
    let base = drive.envelope.base_speed(drive.U) / drive.electrical(1.0);
    let end = bisect(base, 10.0 * base, |rpm| drive.limit(rpm, 1.0).tau > 0.0);
    let curve = |name, ink, s: f64| {
        let speeds = (0..=200).map(|k| end * f64::from(k) / 200.0);
        area(name, ink, 0.15, speeds.map(|rpm| (rpm, s * drive.limit(rpm, s).tau)))
    };
    let mut dots = Vec::new();
    for &rpm in measured {
        for tau in [20.0, -20.0] {
            dots.push((rpm, drive.run(rpm, tau)?.tau_e));
        }
    }
    let panel = Panel {
        title: format!("reference motor, {} A, {u_dc} V", limit.i),
        unit: "torque in N.m".into(),
        window: (0.0, 1.04 * end),
        curves: vec![curve("motoring", CURVES[0], 1.0), curve("generating", CURVES[1], -1.0)],
        dots,
        marks: vec![(base, format!("base speed {base:.0} rpm"))],
        ..Panel::default()
    };
    Ok(Plane { base, end, panel })
}

/// The losses of the reference drive at one torque over the speed.
#[derive(Clone, Debug)]
pub struct Split {
    /// Speed in rpm above which this torque needs field weakening.
    pub onset: f64,
    /// Speed in rpm above which the drive has less than this torque.
    pub end: f64,
    /// Losses, stacked, and efficiency.
    pub panels: [Panel; 2],
    /// Values from the equations and from the running drive, at each measured speed.
    pub points: Vec<[OperatingPoint; 2]>,
}

/// The losses of the reference drive with `torque` (N.m) at the shaft, or the maximum torque if that is less, up to
/// `highest` (rpm): curves by the equations, dots of the running drive at the speeds of `measured` (rpm).
///
/// # Errors
/// A step fails.
pub fn losses(torque: f64, highest: f64, measured: &[f64]) -> Result<Split> {
    let drive = Reference::lossy();
    let (limit, u_dc) = (drive.pair.controller.model.parameters.limit.i, drive.pair.plant.model.inputs.u_dc);
    let title = |what| format!("reference motor, {u_dc} V, {torque} N.m at the shaft: {what}");
    let at = |rpm| drive.at_shaft(rpm, torque);
    let end = bisect(0.0, highest, |rpm| at(rpm).tau_shaft.abs() > 0.9999 * torque.abs());
    let onset = bisect(0.0, highest, |rpm| drive.current(rpm, at(rpm).tau).d() == 0.0);
    let mut points = Vec::new();
    for &rpm in measured {
        // The page shows the reference with three decimals.
        let tau = (at(rpm).tau * 1e3).round() / 1e3;
        points.push([at(rpm), drive.run(rpm, tau)?]);
    }
    let curves: Vec<OperatingPoint> = (0..=200).map(|k| at(highest * f64::from(k) / 200.0)).collect();
    // Stacked from the axis upward.
    let sums = |p: &OperatingPoint| {
        let Losses { cu, iron, cond, sw, .. } = p.losses;
        [cu, cu + iron, cu + iron + cond, cu + iron + cond + sw, p.losses.sum()]
    };
    let names = ["p_cu", "p_iron", "p_cond", "p_sw", "p_friction"];
    let inks = [CURVES[4], CURVES[0], CURVES[2], CURVES[1], CURVES[5]];
    let stack = |k: usize| area(names[k], inks[k], 1.0, curves.iter().map(|p| (p.rpm, sums(p)[k])));
    let window = (0.0, 1.04 * highest);
    let stacked = Panel {
        title: title("losses"),
        unit: "losses, stacked, in W".into(),
        window,
        curves: (0..5).rev().map(stack).collect(),
        dots: points.iter().flat_map(|[_, run]| sums(run).map(|sum| (run.rpm, sum))).collect(),
        marks: vec![(onset, "field weakening".into()), (end, format!("{limit} A"))],
        ..Panel::default()
    };
    let percent = |p: &OperatingPoint| (p.rpm, 100.0 * p.efficiency);
    let efficiency = Panel {
        title: title("efficiency"),
        unit: "efficiency in %".into(),
        window,
        curves: vec![Curve::through("p_mech / p_in", CURVES[0], curves.iter().map(percent))],
        dots: points.iter().map(|[_, run]| percent(run)).collect(),
        marks: stacked.marks.clone(),
        ..Panel::default()
    };
    Ok(Split { onset, end, panels: [stacked, efficiency], points })
}

/// The efficiency map of the reference drive with the losses of [`losses`].
pub fn map() -> Chart {
    let drive = Reference::lossy();
    let (plant, controller) = (&drive.pair.plant.model, &drive.pair.controller.model);
    let steady = Steady::new(plant.parameters.clone(), controller.parameters.clone()).sampled();
    let rated = [REFERENCE_SPEED, REFERENCE_TORQUE];
    picture::chart(&map::of_drive("reference motor", steady, plant.inputs.u_dc, 5300.0 * RPM, rated), 0)
}
