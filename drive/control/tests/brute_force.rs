//! The algebra of field weakening against brute force, over random machines whose voltage R i is up to 0.6 of the link's.
#![allow(missing_docs, non_snake_case)]

mod machines;
mod random_machines;

use drive_base::frame::DqHat;
use drive_control::envelope::WarmStart;
use drive_control::reference::max_torque_per_ampere;
use drive_control::tracking::LeastTracker;
use drive_control::weakening::{Weakening, WeakeningGains};
use machines::Machine;
use random_machines::{Brute, all};

/// Agreement of both, as a share of the maximum torque and of the current limit.
const SMALL: f64 = 1e-6;

fn brute(machine: &Machine, w: f64) -> Brute<'_> {
    Brute { motor: &machine.motor, I: machine.i, w, U: machine.U(0.95) }
}

/// The maximum torque of each sign: run to the end, and sample by sample from a cold start.
#[test]
fn the_limits() {
    let (mut count, mut inside, mut none) = (0, 0, 0);
    for machine in all() {
        let (envelope, U, motor) = (machine.envelope(), machine.U(0.95), &machine.motor);
        let most = envelope.settled(1e-3, 1.0, 1e9).tau;
        for w in random_machines::speeds(&machine) {
            for s in [1.0, -1.0] {
                let found = brute(&machine, w).limit(s);
                let settled = envelope.settled(w, s, U);
                let mut warm = WarmStart::default();
                let sampled = (0..9).map(|_| envelope.limit(w, s, U, &mut warm)).last().unwrap();
                for limit in [settled, sampled] {
                    let off = (limit.tau - found.0).abs() / most;
                    assert!(off < SMALL, "{motor:?}, {} A, {U} V, {w} rad/s, {s}: {limit:?}, not {found:?}", machine.i);
                }
                count += 1;
                none += usize::from(found.0 == 0.0);
                inside += usize::from(found.0 > 0.0 && settled.i.magnitude() < 0.999 * machine.i);
            }
        }
    }
    println!("{count} limits: {inside} within the current limit, {none} without torque");
    assert!(inside > 500 && none > 100);
}

/// The minimum current for a torque within the limits; at the base speed the voltage is exhausted.
#[test]
fn the_currents() {
    let mut weakened = 0;
    for machine in all() {
        let (par, U, motor) = (machine.parameters(), machine.U(0.95), &machine.motor);
        let envelope = machine.envelope();
        let most = envelope.settled(1e-3, 1.0, 1e9).tau;
        let gains = WeakeningGains::new(&par.motor, &par.limit, most, true, 1.0, LeastTracker::default());
        let i_most = most / motor.torque_constant();
        let base = envelope.base_speed(U);
        let at = |w: f64| brute(&machine, w).limit(1.0).0 / most;
        assert!(
            base == 0.0 && at(1e-3) < 1.0 || at(0.999 * base) > 1.0 - SMALL && at(1.01 * base) < 1.0,
            "{motor:?}: {base}"
        );
        for w in random_machines::speeds(&machine) {
            let (state, (low, high)) = Weakening::settled(&gains, &par.weakening, (w, machine.u_dc), i_most, 0.0);
            for share in [-0.98, -0.7, -0.3, -0.05, 0.0, 0.05, 0.3, 0.7, 0.98] {
                let tau = share * if share < 0.0 { low } else { high } * motor.torque_constant();
                let Some(wanted) = brute(&machine, w).least_current(tau) else { continue };
                let plain = || max_torque_per_ampere(motor, tau);
                let settled = state.clone().currents(&gains, tau, w, machine.i, true, plain);
                let mut run = Weakening::default();
                let mut sampled = DqHat::ZERO;
                for k in 0..30 {
                    run.limits(&gains, &par.weakening, (w, machine.u_dc, 0.0), i_most, k);
                    sampled = run.currents(&gains, tau, w, machine.i, true, plain);
                }
                weakened += usize::from(run.weakens);
                for (i, allowed) in [(settled, 1e-5), (sampled, 1e-3)] {
                    let (torque, u) = (motor.torque(i.d(), i.q()), brute(&machine, w).voltage([i.d(), i.q()]));
                    let off = (i.magnitude() - wanted) / machine.i;
                    assert!(
                        off.abs() < allowed && u < U * (1.0 + 1e-4) && (torque - tau).abs() < 1e-6 * most,
                        "{motor:?}, {} A, {U} V, {w} rad/s, {tau} N.m ({share}): {i:?}, {} A, not {wanted} A; {torque} N.m, {u} V",
                        machine.i,
                        i.magnitude()
                    );
                }
            }
        }
    }
    println!("{weakened} weakened");
    assert!(weakened > 1000);
}
