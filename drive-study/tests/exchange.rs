//! The order in which an importer exchanges the values of the pair, and the effect of `timing.delay`: the numbers of
//! `drive/control/docs/limits.html` and `docs/import.md`.
//!
//! The controller takes the currents at its sample k and shows the command of that sample, and theta^ for the instant one
//! period later, at the end of the step. Jacobi: the currents were measured at t_k, the command acts in [t_k + T_s, t_k + 2 T_s],
//! theta^ is recorded at the instant to which it applies. Controller first: the plant receives the command in the same step,
//! delay 0. Plant first: the currents were already measured at t_k + T_s and the command acts from that instant, delay 0, but
//! theta^ applies to t_k + 2 T_s: recorded at t_k + T_s it leads by w T_s with the right delay.
#![allow(missing_docs, non_snake_case)]

#[path = "common/shows.rs"]
mod shows;

use drive::Pair;
use drive::estimator::{Class, Kind};
use drive::math::wrap;
use drive_study::runner;
use fmu_core::Step;
use shows::shows;
use std::f64::consts::PI;

const LIMITS: &str = include_str!("../../drive/control/docs/limits.html");
const IMPORT: &str = include_str!("../../docs/import.md");
const RPM: f64 = PI / 30.0;
const T_S: f64 = 1e-4;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    Jacobi,
    ControllerFirst,
    PlantFirst,
    /// Jacobi, with a unit delay in the voltages.
    LateVoltages,
    /// Jacobi, with a unit delay in the currents.
    LateCurrents,
    /// Jacobi, with a unit delay in both: one sample more than the controller assumes.
    BothLate,
}

impl Order {
    const ALL: [Self; 6] =
        [Self::Jacobi, Self::ControllerFirst, Self::PlantFirst, Self::LateVoltages, Self::LateCurrents, Self::BothLate];

    /// Its name on the pages.
    fn name(self) -> &'static str {
        match self {
            Self::Jacobi => "all read, all set, both step (Jacobi)",
            Self::ControllerFirst => "controller first, its command in the same step",
            Self::PlantFirst => "plant first, its currents in the same step",
            Self::LateVoltages => "Jacobi, voltages one step late",
            Self::LateCurrents => "Jacobi, currents one step late",
            Self::BothLate => "Jacobi, both one step late",
        }
    }

    /// The correct `timing.delay`: the period from the instant of the currents to the voltage.
    fn right(self) -> i32 {
        match self {
            Self::ControllerFirst | Self::PlantFirst => 0,
            Self::Jacobi => 1,
            Self::LateVoltages | Self::LateCurrents => 2,
            Self::BothLate => 3,
        }
    }
}

/// Steady at 1500 rpm: theta^ - theta (deg), i_d and i_q of the plant (A).
struct Steady(f64, f64, f64);

/// After 1 s at 1500 rpm under `load` (N.m).
fn steady(order: Order, delay: i32, load: f64) -> Steady {
    let mut p = Pair::default();
    p.controller.model.parameters.delay = delay;
    p.start().unwrap();
    let (mut u, mut i) = (p.controller.out.u, p.plant.out.i);
    for k in 0..20_000_u32 {
        let at = |from: u32, value: f64| if k >= from { value } else { 0.0 };
        p.set_inputs(at(1000, 1500.0 * RPM), at(10_000, load), 325.0);
        let step = Step { start: p.now, h: T_S };
        match order {
            Order::ControllerFirst => {
                p.controller.model.inputs.i = p.plant.out.i;
                p.controller.step(&step).unwrap();
                p.plant.model.inputs.u = p.controller.out.u;
                p.plant.step(&step).unwrap();
            }
            Order::PlantFirst => {
                p.plant.model.inputs.u = p.controller.out.u;
                p.plant.step(&step).unwrap();
                p.controller.model.inputs.i = p.plant.out.i;
                p.controller.step(&step).unwrap();
            }
            Order::Jacobi | Order::LateVoltages | Order::LateCurrents | Order::BothLate => {
                let now = (p.controller.out.u, p.plant.out.i);
                let late = |one: Order| order == one || order == Order::BothLate;
                p.plant.model.inputs.u = if late(Order::LateVoltages) { u } else { now.0 };
                p.controller.model.inputs.i = if late(Order::LateCurrents) { i } else { now.1 };
                (u, i) = now;
                p.plant.step(&step).unwrap();
                p.controller.step(&step).unwrap();
            }
        }
        p.now = step.end();
    }
    let plant = &p.plant.out;
    assert!((plant.speed - 1500.0 * RPM).abs() < 0.1 * RPM, "{order:?}, delay {delay}: {} rpm", plant.speed / RPM);
    Steady(wrap(p.controller.out.theta_est - plant.theta_e).to_degrees(), plant.i_d, plant.i_q)
}

/// A number as the pages print it: no negative zero.
fn number(x: f64, decimals: usize) -> String {
    let half = 0.5 * 0.1_f64.powi(i32::try_from(decimals).unwrap());
    format!("{:.decimals$}", if x.abs() < half { 0.0 } else { x }).replace('-', "−")
}

/// The pages list a run for every order and delay, and only the current shows which is right.
#[test]
fn order_and_delay() {
    for order in Order::ALL {
        let mut cells = vec![order.name().to_owned(), order.right().to_string()];
        for delay in 0..=2 {
            let (Steady(angle, ..), Steady(_, i_d, i_q)) = (steady(order, delay, 0.0), steady(order, delay, 2.0));
            cells.push(format!("{}°, {} A", number(angle, 1), number(i_d, 2)));
            let off = f64::from(order.right() - delay);
            assert!((i_d + 0.155 * off).abs() < 0.01, "{order:?}, delay {delay}: i_d = {i_d} A");
            assert!((i_q - 3.055).abs() < 0.002, "{order:?}, delay {delay}: i_q = {i_q} A");
            // theta^ is recorded a period early, or late, where the currents are younger, or older, than the step.
            let recorded = match order {
                Order::PlantFirst => 1.0,
                Order::LateCurrents | Order::BothLate => -1.0,
                _ => 0.0,
            };
            assert!((angle - 2.7 * (off + recorded)).abs() < 0.03, "{order:?}, delay {delay}: {angle} deg");
        }
        let html = format!("<tr><td>{}</td></tr>", cells.join("</td><td>"));
        shows("drive/control/docs/limits.html", LIMITS, &html);
        let markdown = format!("| {} |", cells.join(" | "));
        shows("docs/import.md", IMPORT, &markdown);
    }
}

/// Mean angle error θ - θ^ (deg) of an estimator under half the rated torque, voltages `late` by a step or not.
fn loaded(kind: Kind, speed: f64, late: bool, delay: i32) -> f64 {
    let mut p = runner::turning(runner::drive(kind), speed);
    p.controller.model.parameters.delay = delay;
    p.start().unwrap();
    let (mut u, mut mean) = (p.controller.out.u, runner::Statistics::default());
    for k in 0..15_000_u32 {
        let load = if k >= 3000 { 0.5 * runner::RATED_TORQUE } else { 0.0 };
        p.set_inputs(speed * runner::RATED_SPEED, load, 540.0);
        p.controller.model.inputs.i = p.plant.out.i;
        p.controller.model.inputs.theta_meas = p.plant.out.theta_e;
        p.controller.model.inputs.speed_meas = p.plant.out.speed;
        let now = p.controller.out.u;
        p.plant.model.inputs.u = if late { u } else { now };
        u = now;
        let step = Step { start: p.now, h: T_S };
        p.plant.step(&step).unwrap();
        p.controller.step(&step).unwrap();
        p.now = step.end();
        if k >= 12_000 {
            mean.add(runner::rotor_ahead(&p));
        }
    }
    mean.mean()
}

/// Every estimator is as accurate with two samples as with one, at speeds suited to injection and to the EMF; if one is set
/// instead of two, those based on the EMF lag by w T_s.
#[test]
fn every_estimator_knows_two_samples() {
    for &kind in Kind::ALL {
        for speed in if kind.class().injects() { [0.0, 0.05] } else { [0.3, 0.8] } {
            let (one, two) = (loaded(kind, speed, false, 1), loaded(kind, speed, true, 2));
            assert!(one.abs().max(two.abs()) < 0.3, "{kind:?} at {speed}: {one} deg with one sample, {two} with two");
            if !kind.class().injects() && kind.class() != Class::Sensored {
                let wrong = loaded(kind, speed, true, 1);
                let turn = (3.0 * speed * runner::RATED_SPEED * T_S).to_degrees();
                assert!((wrong / turn + 1.0).abs() < 0.15, "{kind:?} at {speed}: {wrong} deg, not {}", -turn);
            }
        }
    }
}
