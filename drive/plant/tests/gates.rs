//! Given gate signals on the bridge of the switched inverter: those of the carrier give the carrier's currents.
#![allow(missing_docs, non_snake_case)]

use drive_base::frame::Phases;
use drive_plant::PmsmPlant;
use drive_plant::pwm::{InverterMode, ZeroSequence};
use drive_plant::switched::bridge::Command;
use fmu_core::draw::Draw;
use fmu_core::{Block, Elapsed, Fault, Step};

const T: f64 = 50e-6;
const U_DC: f64 = 325.0;

fn plant(dead_time: f64) -> Block<PmsmPlant> {
    let mut block = Block::<PmsmPlant>::default();
    let inverter = &mut block.model.parameters.inverter;
    (inverter.pwm.mode, inverter.pwm.zero_sequence, inverter.T_pwm) = (InverterMode::Switched, ZeroSequence::None, T);
    inverter.dead_time = dead_time;
    (inverter.devices.u_transistor, inverter.devices.u_diode, inverter.devices.E_sw) = (1.0, 0.8, 1e-4);
    block.model.parameters.initial.speed = 60.0;
    block.model.inputs.tau_load = 0.5;
    block.initialize();
    block
}

/// The commands of a leg with the duty cycle `d` at the time `t` (s) of a period, with the dead time `dead` (s) after each
/// change.
fn command(d: f64, t: f64, dead: f64) -> Command {
    let (on, off) = (0.5 * T * (1.0 - d), 0.5 * T * (1.0 + d));
    let within = |from: f64| (from..from + dead - 1e-13).contains(&(t + 1e-13));
    if within(on) || within(off) {
        Command::Off
    } else if t + 1e-13 >= on && t + 1e-13 < off {
        Command::Upper
    } else {
        Command::Lower
    }
}

/// A period of the carrier by gate signals, from one change to the next.
fn by_gates(block: &mut Block<PmsmPlant>, now: &mut Elapsed, d: [f64; 3], dead: f64) -> Result<(), Fault> {
    let mut instants = vec![0.0, T];
    for d in d {
        for edge in [0.5 * T * (1.0 - d), 0.5 * T * (1.0 + d)] {
            instants.extend([edge, edge + dead]);
        }
    }
    instants.sort_by(f64::total_cmp);
    for pair in instants.windows(2).filter(|pair| pair[1] - pair[0] > 1e-12) {
        let step = Step { start: *now, h: pair[1] - pair[0] };
        block.model.advance_gates(&step, d.map(|d| command(d, pair[0], dead)))?;
        *now = step.end();
    }
    fmu_core::Model::output(&block.model, *now, &mut block.out);
    Ok(())
}

#[test]
fn the_gate_signals_of_the_carrier_give_its_currents() {
    for dead in [0.0, 1e-6] {
        let (mut carrier, mut gates) = (plant(dead), plant(dead));
        let (mut draw, mut largest) = (Draw(7), 0.0_f64);
        // Before the first period, the carrier's lower switches wait for a dead time.
        let first = Step { start: Elapsed::ZERO, h: T };
        for block in [&mut carrier, &mut gates] {
            block.step(&first).unwrap();
        }
        let (mut now, mut at) = (first.end(), first.end());
        for k in 0..400 {
            // No change at the ends of a period, where the dead time would reach into the next one.
            let d = [0, 1, 2].map(|_| draw.between(0.3, 0.7));
            let [a, b, c] = d.map(|d| (d - 0.5) * U_DC);
            carrier.model.inputs.u = Phases { a, b, c };
            let step = Step { start: now, h: T };
            carrier.step(&step).unwrap();
            now = step.end();
            by_gates(&mut gates, &mut at, d, dead).unwrap();
            let (i, j) = (carrier.out.i, gates.out.i);
            assert!((i.a - j.a).abs() < 1e-6 && (i.b - j.b).abs() < 1e-6, "{dead} s, period {k}: {i:?}, not {j:?}");
            assert!((carrier.out.speed - gates.out.speed).abs() < 1e-7, "{dead} s, period {k}");
            largest = largest.max(i.a.abs());
        }
        let (energy, other) = (&carrier.out.energy, &gates.out.energy);
        assert!((energy.loss / other.loss - 1.0).abs() < 1e-6, "{dead} s: {energy:?}, not {other:?}");
        assert!(largest > 1.0, "{largest} A");
    }
}

/// A leg that the carrier has commanded, and whose dead time still runs, conducts at once when its gate is given.
#[test]
fn a_given_gate_waits_for_no_dead_time() {
    let mut block = plant(20e-6);
    let step = Step { start: Elapsed::ZERO, h: 1e-6 };
    block.step(&step).unwrap();
    let next = Step { start: step.end(), h: 10e-6 };
    block.model.advance_gates(&next, [Command::Lower; 3]).unwrap();
    assert_eq!(block.model.terminals().unwrap().u.map(|u| (-1.0..=1.0).contains(&u)), [true; 3]);
    block.model.advance_gates(&Step { start: next.end(), h: 10e-6 }, [Command::Upper; 3]).unwrap();
    let u = block.model.terminals().unwrap().u;
    assert_eq!(u.map(|u| (U_DC - 1.0..=U_DC + 1.0).contains(&u)), [true; 3], "{u:?}");
}
