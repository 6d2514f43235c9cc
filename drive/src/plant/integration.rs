//! One integration step of the currents and the shaft.

use crate::frame::Turn;
use crate::plant::circuit::{Circuit, Passed};
use crate::plant::losses::flow::Drops;
use crate::plant::mechanics::Coulomb;
use crate::plant::model::PmsmPlant;
use crate::plant::state::{State, axis_at};

/// Longest integration step in s: at 4500 rpm of the reference motor, the current error is less than 2e-6 A.
pub(super) const LONGEST_STEP: f64 = 100e-6;

/// Largest electrical angle in rad that the rotor turns in an integration step.
pub(super) const LARGEST_TURN: f64 = 0.25;

impl PmsmPlant {
    /// One integration step of `h` (s) with the classical Runge-Kutta method ([`rk4`](crate::integrate::rk4)): the flux
    /// linkage in stator axes, and the angle as the deviation from a motion at constant speed.
    ///
    /// In stator axes, the flux linkage is the integral of the held voltage minus R_s i. Only this small resistive part
    /// follows the rotor, so a step is more exact than two of half its length in rotor axes. The axes of the motion at
    /// constant speed do not wait for the stages, whose accelerations then turn them a little.
    #[expect(clippy::inline_always, reason = "as a call, it passes the state through memory: 10 % of a period")]
    #[inline(always)]
    pub(super) fn integrate<D: Drops<f64>, C: Coulomb<f64>, const LINEAR: bool>(
        &self,
        start: &State,
        h: f64,
        circuit: &Circuit<'_, D, C, f64, LINEAR>,
    ) -> (State, Passed) {
        let (motor, machine) = (&self.warm.motor, &circuit.machine);
        let (n_p, half, sixth, speed) = (f64::from(motor.n_p), 0.5 * h, h * (1.0 / 6.0), start.speed);
        let middle = start.axis.ahead(Turn::new(n_p * half * speed));
        let end = axis_at(motor, start.angle + h * speed);
        let psi = machine.to_stator(start.axis, start.psi);

        let k_1 = circuit.rates(start.axis, psi, speed);
        let k_2 = circuit.rates(middle, psi + k_1.d_psi * half, speed + k_1.acceleration * half);
        let axis = middle.slightly_ahead(n_p * half * half * k_1.acceleration);
        let k_3 = circuit.rates(axis, psi + k_2.d_psi * half, speed + k_2.acceleration * half);
        let axis = end.slightly_ahead(n_p * half * h * k_2.acceleration);
        let k_4 = circuit.rates(axis, psi + k_3.d_psi * h, speed + k_3.acceleration * h);

        let psi = psi + (k_1.d_psi + (k_2.d_psi + k_3.d_psi) * 2.0 + k_4.d_psi) * sixth;
        let deviation = h * sixth * (k_1.acceleration + k_2.acceleration + k_3.acceleration);
        let change = k_1.acceleration + 2.0 * (k_2.acceleration + k_3.acceleration) + k_4.acceleration;
        let (turned, speed) = (h * speed + deviation, speed + sixth * change);
        let axis = end.ahead(Turn::tiny(n_p * deviation));
        let state = State { psi: machine.from_stator(axis, psi), speed, angle: start.angle + turned, axis };
        (state, Passed::over::<D, C>(h, turned, &[k_1, k_2, k_3, k_4], &circuit.shaft))
    }
}
