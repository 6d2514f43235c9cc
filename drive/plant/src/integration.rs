//! One integration step of the currents and the shaft.

use crate::circuit::{Circuit, Passed, Rates};
use crate::damping::{Classical, Damped, Matrix, Stages};
use crate::losses::flow::Drops;
use crate::mechanics::Coulomb;
use crate::model::PmsmPlant;
use crate::state::{State, axis_at};
use drive_base::frame::{AlphaBeta, Axis, Rotor, Turn};

/// Largest electrical angle in rad that the rotor turns in an integration step.
pub(super) const LARGEST_TURN: f64 = 0.25;

impl PmsmPlant {
    /// One integration step of `h` (s) with the classical Runge-Kutta method ([`rk4`](drive_base::integrate::rk4)).
    #[expect(clippy::inline_always, reason = "as a call, it passes the state through memory: 10 % of a period")]
    #[inline(always)]
    pub(super) fn integrate<D: Drops<f64>, C: Coulomb<f64>, const LINEAR: bool>(
        &self,
        start: &State,
        h: f64,
        circuit: &Circuit<'_, D, C, f64, LINEAR>,
    ) -> (State, Passed) {
        let (end, turned, [a, b, c, d]) = self.advance_by(start, h, circuit, &Classical(h));
        (end, Passed::over::<D, C>(h, turned, [&a, &b, &c, &d], &circuit.shaft))
    }

    /// One integration step of `h` (s) that is long compared with the time constant of a current in the zone: two half steps,
    /// with the energies from the rates at their ends, because the voltage that makes the current settle is not yet exact in
    /// the stages. The damping follows from the change of the rates with a `small` change of the flux linkage (Wb).
    pub(super) fn integrate_damped<D: Drops<f64>, C: Coulomb<f64>, const LINEAR: bool>(
        &self,
        start: &State,
        h: f64,
        circuit: &Circuit<'_, D, C, f64, LINEAR>,
        small: f64,
    ) -> (State, Passed) {
        let machine = &circuit.machine;
        let psi = machine.to_stator(start.axis, start.psi);
        let d_psi = |away| circuit.rates(start.axis, psi + away, start.speed).d_psi;
        let at_start = d_psi(AlphaBeta::ZERO);
        let column = |direction| (at_start - d_psi(direction * small)) * (1.0 / small);
        let damping = Matrix::new(column(AlphaBeta::new(1.0, 0.0)), column(AlphaBeta::new(0.0, 1.0)));
        let stages = Damped::new(0.5 * h, damping, self.warm.motor.psi_M, start.axis);
        let (middle, first, [a, ..]) = self.advance_damped(start, 0.5 * h, circuit, &stages);
        let (end, second, [b, ..]) = self.advance_damped(&middle, 0.5 * h, circuit, &stages.from(middle.axis));
        let c = circuit.rates(end.axis, machine.to_stator(end.axis, end.psi), end.speed);
        (end, Passed::over::<D, C>(h, first + second, [&a, &b, &b, &c], &circuit.shaft))
    }

    /// [`advance_by`](Self::advance_by) as a call.
    #[inline(never)]
    fn advance_damped<D: Drops<f64>, C: Coulomb<f64>, const LINEAR: bool>(
        &self,
        start: &State,
        h: f64,
        circuit: &Circuit<'_, D, C, f64, LINEAR>,
        stages: &Damped,
    ) -> (State, f64, [Rates; 4]) {
        self.advance_by(start, h, circuit, stages)
    }

    /// The state after `h` (s), the angle (rad) by which the shaft has turned, and the rates in the four stages. The flux
    /// linkage is integrated in stator axes, the angle as the deviation from a motion at constant speed.
    ///
    /// In stator axes, the flux linkage is the integral of the constant voltage minus R_s i. Only this small resistive part
    /// follows the rotor, so a step is more exact than two half steps in rotor axes. The axes of the motion at constant
    /// speed are known before the stages, whose accelerations then turn them slightly.
    #[expect(clippy::inline_always, reason = "as for `integrate`")]
    #[inline(always)]
    fn advance_by<D: Drops<f64>, C: Coulomb<f64>, const LINEAR: bool>(
        &self,
        start: &State,
        h: f64,
        circuit: &Circuit<'_, D, C, f64, LINEAR>,
        stages: &impl Stages,
    ) -> (State, f64, [Rates; 4]) {
        let (motor, machine) = (&self.warm.motor, &circuit.machine);
        let (n_p, half, sixth, speed) = (f64::from(motor.n_p), 0.5 * h, h * (1.0 / 6.0), start.speed);
        let middle = start.axis.ahead(Turn::new(n_p * half * speed));
        let end = axis_at(motor, start.angle + h * speed);
        let psi = machine.to_stator(start.axis, start.psi);

        let (k_1, g_1) = stage(circuit, stages, start.axis, psi, AlphaBeta::ZERO, speed);
        let a = stages.half(g_1);
        let (k_2, g_2) = stage(circuit, stages, middle, psi, a, speed + k_1.acceleration * half);
        let b = stages.half(g_2);
        let axis = middle.slightly_ahead(n_p * half * half * k_1.acceleration);
        let (k_3, g_3) = stage(circuit, stages, axis, psi, b, speed + k_2.acceleration * half);
        let c = stages.last(a, g_1, g_3);
        let axis = end.slightly_ahead(n_p * half * h * k_2.acceleration);
        let (k_4, g_4) = stage(circuit, stages, axis, psi, c, speed + k_3.acceleration * h);

        let deviation = h * sixth * (k_1.acceleration + k_2.acceleration + k_3.acceleration);
        let change = k_1.acceleration + 2.0 * (k_2.acceleration + k_3.acceleration) + k_4.acceleration;
        let (turned, speed) = (h * speed + deviation, speed + sixth * change);
        let axis = end.ahead(Turn::tiny(n_p * deviation));
        let psi = stages.at(psi, stages.whole([g_1, g_2, g_3, g_4]), axis);
        let state = State { psi: machine.from_stator(axis, psi), speed, angle: start.angle + turned, axis };
        (state, turned, [k_1, k_2, k_3, k_4])
    }
}

/// The rates at a stage with the d-axis on `axis` and the flux linkage at a distance of `away` (Wb) from that at the start,
/// `psi` (Wb), and the derivative of [`Stages`].
#[expect(clippy::inline_always, reason = "as for `PmsmPlant::integrate`")]
#[inline(always)]
fn stage<D: Drops<f64>, C: Coulomb<f64>, const LINEAR: bool>(
    circuit: &Circuit<'_, D, C, f64, LINEAR>,
    stages: &impl Stages,
    axis: Axis<Rotor>,
    psi: AlphaBeta,
    away: AlphaBeta,
    speed: f64,
) -> (Rates, AlphaBeta) {
    let rates = circuit.rates(axis, stages.at(psi, away, axis), speed);
    let g = stages.beside(rates.d_psi, away, axis, circuit.machine.electrical(speed));
    (rates, g)
}
