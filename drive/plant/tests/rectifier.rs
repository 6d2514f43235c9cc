//! The steady state of the diodes beside the running plant, which turns at a constant speed until it is settled: with saliency and
//! with all losses, from rest and from a current that flows.
#![allow(missing_docs, non_snake_case)]

mod lossy;

use drive_plant::PmsmPlant;
use drive_plant::rectifier::{From, Rectified, rectified};
use drive_plant::tables::PlantParameters;
use drive_plant::thermal::Temperatures;
use fmu_core::{Block, Elapsed, Step};

/// Turns the plant with the gates off at `speed` (rad/s) for 0.3 s: the means of i_d, i_q, tau_shaft and p_in over the last tenth.
fn runs(block: &mut Block<PmsmPlant>, speed: f64) -> [f64; 4] {
    let (h, mut now, angle) = (5e-5, Elapsed::ZERO, block.out.angle);
    let (mut sum, mut count) = ([0.0; 4], 0.0);
    while now.seconds() < 0.3 {
        let inputs = &mut block.model.inputs;
        (inputs.speed_shaft, inputs.angle_shaft) = (speed, angle + speed * now.seconds());
        let step = Step { start: now, h };
        block.step(&step).unwrap();
        now = step.end();
        if now.seconds() > 0.27 {
            let out = &block.out;
            let now = [out.i_d, out.i_q, out.powers.tau_shaft, out.powers.p_in];
            sum.iter_mut().zip(now).for_each(|(sum, x)| *sum += x);
            count += 1.0;
        }
    }
    sum.map(|x| x / count)
}

#[test]
fn the_steady_state_is_that_of_the_running_plant() {
    for (name, drive) in [("a", lossy::a()), ("b", lossy::b()), ("c", lossy::c())] {
        for bare in [false, true] {
            let par = if bare {
                PlantParameters { motor: drive.par.motor.clone(), ..PlantParameters::default() }
            } else {
                drive.par.clone()
            };
            let opening = (drive.u_dc + 2.0 * par.inverter.devices.u_diode)
                / (3.0_f64.sqrt() * par.motor.psi_M * f64::from(par.motor.n_p));
            let mut block = Block::<PmsmPlant>::default();
            block.model.parameters = par.clone();
            block.model.parameters.mechanics.imposed = true;
            (block.model.inputs.enable, block.model.inputs.u_dc) = (false, drive.u_dc);
            block.initialize();
            let mut last: Option<Rectified> = None;
            let mut most = [0.0; 4];
            for share in [1.5, 1.02, 1.1, 0.95] {
                let speed = share * opening;
                let whole = runs(&mut block, speed);
                let from = last.map_or(From::Fundamental, |last| From::Near(last.start));
                last = rectified(&par, Temperatures::all(293.15), speed, drive.u_dc, from);
                let friction = par.mechanics.friction(speed);
                let found = last.map_or([0.0; 4], |Rectified { i, tau_e, losses, .. }| {
                    [i.d(), i.q(), tau_e - friction, tau_e * speed + losses.sum()]
                });
                println!("{name} {share:4.2}: {whole:10.3?} {found:10.3?}");
                assert_eq!(last.is_none(), share < 1.0);
                if share > 1.4 {
                    most = whole;
                }
                for k in (0..4).filter(|_| last.is_some()) {
                    assert!(
                        (found[k] - whole[k]).abs() < 1e-3 * most[k].abs(),
                        "{name} {share}: {found:?}, not {whole:?}"
                    );
                }
            }
        }
    }
}
