//! The command leads the angle by the rotation of the rotor until the middle of the interval in which it acts: half a
//! sample and the delay (Rasmussen 2006, Fig. 2, sampled). In the closed loop the integrators hide a
//! wrong lead, so the test checks the first command.
#![allow(missing_docs)]
#![allow(non_snake_case, reason = "the papers' symbols")]

use drive_control::SensorlessController;
use drive_control::estimator::Kind;
use fmu_core::{Block, Elapsed, Model, Step};
use std::f64::consts::FRAC_PI_2;

#[test]
fn the_first_command_is_turned_to_where_it_acts() {
    let (T_s, theta, speed) = (1e-4, 0.7, 120.0);
    for (delay, lead) in [(1, 1.5), (0, 0.5), (2, 2.5)] {
        for sign in [1.0, -1.0] {
            let mut controller = Block::<SensorlessController>::default();
            let par = &mut controller.model.parameters;
            par.estimator = Kind::Sensored;
            (par.delay, par.speed_loop.b) = (delay, 1.0);
            let (n_p, psi_M, k_p) = (f64::from(par.motor.n_p), par.motor.psi_M, par.current.bandwidth * par.motor.L_q);
            let inputs = &mut controller.model.inputs;
            (inputs.theta_meas, inputs.speed_meas, inputs.speed_ref) = (theta, sign * speed, sign * 130.0);
            controller.initialize();
            controller.model.validate().unwrap();
            controller.step(&Step { start: Elapsed::ZERO, h: T_s }).unwrap();
            let out = &controller.out;
            // No current and i_d,ref = 0: all of the voltage is on the q axis, K_p i_q,ref + w psi_M.
            let w = n_p * sign * speed;
            let u_q = k_p * out.i_ref.q + w * psi_M;
            let angle = theta + lead * T_s * w + FRAC_PI_2;
            let (u_alpha, u_beta) = ((2.0 * out.u.a - out.u.b - out.u.c) / 3.0, (out.u.b - out.u.c) / 3.0_f64.sqrt());
            let (sin, cos) = angle.sin_cos();
            assert!(out.i_ref.q * sign > 0.1 && out.i_ref.d.abs() < 1e-12, "{:?}", out.i_ref);
            let off = (u_alpha - u_q * cos).hypot(u_beta - u_q * sin);
            assert!(off < 1e-9, "delay {delay}: off by {off} V of {u_q} V");
        }
    }
}
