//! The pictures of `docs/inverter.md` match a run of the present code.
#![allow(missing_docs)]

use drive::Pair;
use drive::control::tables::ControllerParameters;
use drive::estimator::Kind;
use drive::frame::{AlphaBeta, Phases};
use drive::motor::Motor;
use drive::overmodulation::ModulationMode;
use drive::plant::PmsmPlant;
use drive::plant::inverter::Inverter;
use drive::plant::pwm::InverterMode;
use fmu_core::{Block, Elapsed, Step};
use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::ink::{CURVES, REFERENCE};
use fmu_plot::svg;
use std::path::Path;

/// Compares the picture `name` in `docs/` with this one.
fn keep(name: &str, figure: &Figure) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(name);
    let drawn = svg::draw(figure).unwrap();
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        return std::fs::write(&path, drawn).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap();
    assert!(kept == drawn, "docs/{name} is not what a run draws now; UPDATE_GOLDEN=1 draws it again");
}

/// Time in ms, i_a and the current from the link in A of the reference machine, imposed at 1000 rpm with this i_q (A), over the
/// last periods of a run.
fn run(i_q: f64, periods: u32, set: impl Fn(&mut Inverter)) -> Vec<[f64; 3]> {
    let mut block = Block::<PmsmPlant>::default();
    let par = &mut block.model.parameters;
    par.mechanics.imposed = true;
    set(&mut par.inverter);
    block.initialize();
    let w = 100.0 * std::f64::consts::PI;
    let (parts, all) = (100_u32, 1000_u32);
    let (mut now, mut seen) = (Elapsed::ZERO, Vec::new());
    for k in 0..all * parts {
        let t = 1e-6 * f64::from(k);
        let angle = w * (1e-4 * f64::from(k / parts) + 5e-5);
        let (d, q) = (-w * 6e-3 * i_q, 2.0 * i_q + w * 0.15);
        let (sin, cos) = angle.sin_cos();
        let inputs = &mut block.model.inputs;
        inputs.u = Phases::from_stator(AlphaBeta::new(d * cos - q * sin, d * sin + q * cos));
        (inputs.speed_shaft, inputs.angle_shaft) = (w / 3.0, w / 3.0 * t);
        let step = Step { start: now, h: 1e-6 };
        block.step(&step).unwrap();
        now = step.end();
        if k >= (all - periods) * parts {
            seen.push([1e3 * (now.seconds() - 1e-4 * f64::from(all - periods)), block.out.i.a, block.out.powers.i_dc]);
        }
    }
    seen
}

fn curve(name: &str, k: usize, seen: &[[f64; 3]], column: usize) -> Curve {
    Curve::through(name, CURVES[k], seen.iter().map(|x| (x[0], x[column])))
}

fn average(inverter: &mut Inverter) {
    inverter.pwm.mode = InverterMode::Average;
}

fn switched(inverter: &mut Inverter) {
    inverter.pwm.mode = InverterMode::Switched;
}

fn panel(title: &str, unit: &str, window: (f64, f64), curves: Vec<Curve>) -> Panel {
    Panel { title: title.into(), unit: unit.into(), window, curves, ..Panel::default() }
}

#[test]
fn the_ripple() {
    let (mean, exact) = (run(4.0, 20, average), run(4.0, 20, switched));
    let both = |column: usize| {
        let mean = Curve { ink: REFERENCE, ..curve("Average", 0, &mean, column) };
        vec![curve("Switched", 0, &exact, column), mean]
    };
    let short = |curves: Vec<Curve>| {
        curves.into_iter().map(|c| Curve::through(c.name.clone(), c.ink, c.points().filter(|p| p.0 <= 0.4))).collect()
    };
    let panels = vec![
        panel("current of phase a", "A", (0.0, 2.0), both(1)),
        panel("the same over four carrier periods", "A", (0.0, 0.4), short(both(1))),
        panel("current from the link", "A", (0.0, 0.4), short(both(2))),
    ];
    let title = "1000 rpm, i_q = 4 A, 325 V, carrier of 100 us".into();
    keep("inverter-ripple.svg", &Figure { title, x: "time in ms", columns: 1, panels });
}

#[test]
fn the_dead_time() {
    let dead = |inverter: &mut Inverter| {
        switched(inverter);
        inverter.dead_time = 1.5e-6;
    };
    let (ideal, exact) = (run(4.0, 200, switched), run(4.0, 200, dead));
    let by_ripple = run(4.0, 200, |inverter| (inverter.dead_time, inverter.i_zero) = (1.5e-6, 0.0));
    let at_extremes = |seen: &[[f64; 3]]| seen.chunks(100).map(|x| x[99]).collect::<Vec<_>>();
    let [ideal, with, ripple] = [ideal, exact.clone(), by_ripple].map(|seen| at_extremes(&seen));
    let mean = Curve { ink: REFERENCE, ..curve("Average, inverter.i_zero = 0", 0, &ripple, 1) };
    // Where the current passes zero.
    let k = exact.windows(2).rposition(|x| x[0][1] * x[1][1] <= 0.0 && x[0][0] > 1.0 && x[0][0] < 19.5).unwrap();
    let start = exact[k][0] - 0.15;
    let near = exact.iter().filter(|x| x[0] >= start && x[0] <= start + 0.3).map(|x| (1e3 * (x[0] - start), x[1]));
    let panels = vec![
        panel(
            "current of phase a at the extremes of the carrier, over ms",
            "A",
            (0.0, 20.0),
            vec![curve("without dead time", 1, &ideal, 1), curve("dead time of 1.5 us", 0, &with, 1), mean],
        ),
        panel(
            "where it passes zero, over us",
            "A",
            (0.0, 300.0),
            vec![Curve::through("dead time of 1.5 us", CURVES[0], near)],
        ),
    ];
    let title = "1000 rpm, voltages for i_q = 4 A, 325 V, carrier of 100 us".into();
    keep("inverter-dead-time.svg", &Figure { title, x: "time", columns: 1, panels });
}

/// Electrical angle of the rotor in degrees over two turns, and phase a of the voltage references in units of u_dc and of the current in
/// A: the 2.2 kW machine of Kim & Sul, imposed at 2500 rpm with its maximum torque, and the mean of the torque in N.m.
fn weakened(mode: ModulationMode) -> (Vec<[f64; 3]>, f64) {
    let (mut pair, u_dc, speed) = (Pair::default(), 540.0, 2500.0 * std::f64::consts::PI / 30.0);
    let plant = &mut pair.plant.model.parameters;
    (plant.motor, plant.mechanics.J, plant.mechanics.imposed) = (Motor::IPMSM_2_2_KW, 0.015, true);
    let mut par = ControllerParameters { motor: plant.motor.clone(), estimator: Kind::Sensored, ..Default::default() };
    (par.limit.i, par.limit.i_q, par.current.mtpa) = (15.0, 15.0, true);
    (par.speed_loop.torque_mode, par.weakening.used, par.modulation.mode) = (true, true, mode);
    pair.controller.model.parameters = par;
    pair.controller.model.inputs.tau_ref = 30.0;
    pair.set_inputs(0.0, 0.0, u_dc);
    pair.start().unwrap();
    let (h, n_p, mut seen, mut tau, mut count) = (1e-4, f64::from(Motor::IPMSM_2_2_KW.n_p), Vec::new(), 0.0, 0.0);
    let turn = std::f64::consts::TAU / (n_p * speed);
    for k in 0..10_000 {
        let inputs = &mut pair.plant.model.inputs;
        (inputs.speed_shaft, inputs.angle_shaft) = (speed, speed * h * f64::from(k));
        pair.step(h).unwrap();
        let left = h * f64::from(10_000 - k - 1);
        if left < 10.0 * turn {
            (tau, count) = (tau + pair.plant.out.tau_e, count + 1.0);
        }
        if left < 2.0 * turn {
            seen.push([720.0 - 360.0 * left / turn, pair.controller.out.u.a / u_dc, pair.plant.out.i.a]);
        }
    }
    (seen, tau / count)
}

#[test]
fn the_overmodulation() {
    let runs = ModulationMode::ALL.iter().map(|&mode| weakened(mode)).collect::<Vec<_>>();
    let all = |column: usize| {
        let named = ModulationMode::ALL.iter().zip(&runs).enumerate();
        named
            .map(|(k, (mode, (seen, tau)))| curve(&format!("{}: {tau:.1} N.m", mode.name()), k, seen, column))
            .collect()
    };
    let panels = vec![
        panel("voltage reference of phase a over u_dc", "1", (0.0, 720.0), all(1)),
        panel("current of phase a", "A", (0.0, 720.0), all(2)),
    ];
    let title = "maximum torque at 2500 rpm, 2.2 kW machine, 540 V, samples of 100 us".into();
    keep("inverter-overmodulation.svg", &Figure { title, x: "electrical angle in degrees", columns: 1, panels });
}
