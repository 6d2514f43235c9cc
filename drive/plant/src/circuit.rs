//! Inverter, machine and shaft at an instant: the derivatives of the states and all powers.
//!
//! ```text
//! i        = i(psi), tau_e = 1.5 n_p psi x i        machine
//! d psi/dt = e(u, i), p_in, losses                  losses::flow: legs, devices, winding, iron
//! dw/dt    = (tau_e - tau_load - friction) / J      mechanics
//! ```
//!
//! In stator axes, the flux linkage is the integral of a voltage that is constant over a step, minus the small resistive
//! part, the only one that follows the rotor. A step of Co-Simulation ([`integration`](crate::integration)), Model
//! Exchange ([`exchange`](crate::exchange)) with its energies, and the derivatives with respect to inputs and states
//! (as [`Dual`](fmu_core::Dual) numbers) all evaluate these equations. Properties that stay constant over a step are types, so
//! the compiler omits absent effects.

use crate::losses::Losses;
use crate::losses::flow::{Drops, Flow, Path};
use crate::machine::Machine;
use crate::mechanics::{Coulomb, Motion, Shaft};
use crate::power::Energy;
use drive_base::frame::{Axis, Rotor, Stator, Vector};
use fmu_core::Scalar;

/// Data that stay constant over an integration step.
pub(super) struct Circuit<'a, D, C, S = f64, const LINEAR: bool = false> {
    pub(super) machine: Machine<'a, S, LINEAR>,
    pub(super) path: Path<D, S>,
    pub(super) shaft: Shaft<'a, C, S>,
}

/// Derivatives and powers at an instant.
pub(super) struct Rates<S = f64> {
    /// Derivative of the flux linkage in stator axes, in V.
    pub(super) d_psi: Vector<Stator, S>,
    /// Acceleration in rad/s2.
    pub(super) acceleration: S,
    /// Torque of the machine less friction in N.m.
    pub(super) tau_given: S,
    /// Power from the DC link in W.
    pub(super) p_in: S,
    /// Losses in W.
    pub(super) losses: Losses<S>,
    /// Current at the terminals in A.
    pub(super) i: Vector<Stator, S>,
}

impl<S: Scalar, D: Drops<S>, C: Coulomb<S>, const LINEAR: bool> Circuit<'_, D, C, S, LINEAR> {
    /// With the d-axis on `axis`, the flux linkage `psi` (Wb) in stator axes and the mechanical `speed` (rad/s).
    #[expect(clippy::inline_always, reason = "its four calls take half of the time of a step")]
    #[inline(always)]
    pub(super) fn rates(&self, axis: Axis<Rotor, S>, psi: Vector<Stator, S>, speed: S) -> Rates<S> {
        let Self { machine, path, shaft } = self;
        let i = machine.stator_current(axis, psi);
        let Motion { acceleration, tau_given, p_friction } = shaft.motion(speed, machine.torque(psi, i));
        let Flow { i, d_psi, p_in, losses } = path.flow(psi, i, machine.electrical(speed));
        let losses = Losses { friction: p_friction, ..losses };
        Rates { d_psi, acceleration, tau_given, p_in, losses, i }
    }
}

/// Rates while the diodes block. No current flows at the terminals; the current `i` (A) of the flux linkage `psi` (Wb),
/// which the magnet drives through the iron, brakes by the iron loss.
pub(super) fn blocked_rates<S: Scalar, C: Coulomb<S>>(
    machine: &Machine<'_, S>,
    shaft: &Shaft<'_, C, S>,
    psi: Vector<Rotor, S>,
    i: Vector<Rotor, S>,
    speed: S,
) -> Rates<S> {
    let tau_e = machine.torque(psi, i);
    let Motion { acceleration, tau_given, p_friction } = shaft.motion(speed, tau_e);
    let losses = Losses { iron: S::from(0.0) - tau_e * speed, friction: p_friction, ..Losses::none() };
    let none = Vector::fixed(Vector::ZERO);
    Rates { d_psi: none, acceleration, tau_given, p_in: 0.0.into(), losses, i: none }
}

/// Energies and impulse transferred in a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Passed {
    pub(super) energy: Energy,
    /// In J.
    pub(super) losses: Losses,
    /// Integral of the torque of the machine less friction, in N.m.s.
    pub(super) impulse: f64,
}

impl Passed {
    /// Adds the values of another step.
    #[inline]
    pub(super) fn add(&mut self, step: &Self) {
        self.energy.add(&step.energy);
        self.losses.add(&step.losses);
        self.impulse += step.impulse;
    }

    /// The sums for a step of `h` (s) with these rates in its four stages, by the weights of the Runge-Kutta method, while the shaft
    /// turns by `turned` (rad): the load torque is constant, or the speed is imposed.
    #[expect(clippy::inline_always, reason = "as for `Circuit::rates`")]
    #[inline(always)]
    pub(super) fn over<D: Drops<f64>, C: Coulomb<f64>>(
        h: f64,
        turned: f64,
        [a, b, c, d]: [&Rates; 4],
        shaft: &Shaft<'_, C>,
    ) -> Self {
        let over = |value: fn(&Rates) -> f64| h * (1.0 / 6.0) * (value(a) + 2.0 * (value(b) + value(c)) + value(d));
        let [cu, friction] = [over(|k| k.losses.cu), over(|k| k.losses.friction)];
        let (losses, loss) = if D::IDEAL {
            (Losses { cu, friction, ..Losses::none() }, cu + friction)
        } else {
            let [iron, cond, sw] = [over(|k| k.losses.iron), over(|k| k.losses.cond), over(|k| k.losses.sw)];
            let losses = Losses { cu, iron, cond, sw, friction };
            (losses, losses.sum())
        };
        let impulse = over(|k| k.tau_given);
        let mech = shaft.tau_shaft(impulse * (1.0 / h)) * turned;
        Self { energy: Energy { r#in: over(|k| k.p_in), mech, loss }, losses, impulse }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverter::Gates;
    use crate::legs::Legs;
    use crate::losses::flow::{Dissipation, Ideal, Switches};
    use crate::machine::Magnetics;
    use crate::mechanics::{Mechanics, Standstill, Whole};
    use crate::saturation::Saturation;
    use crate::tables::PlantParameters;
    use drive_base::frame::{AlphaBeta, Dq};
    use drive_base::motor::Motor;
    use fmu_core::draw::Draw;

    #[test]
    fn what_the_compiler_leaves_out_would_add_nothing() {
        // Linear machine, ideal legs and full Coulomb torque, as types and as parameters, over random machines.
        let mut numbers = Draw(1);
        for _ in 0..1000 {
            let mut draw = |low: f64, high: f64| numbers.scaled(low, high);
            let motor = Motor {
                n_p: 4,
                R_s: draw(1e-3, 10.0),
                L_d: draw(1e-5, 1e-1),
                L_q: draw(1e-5, 1e-1),
                psi_M: draw(1e-3, 1.0),
            };
            let mechanics = Mechanics { J: draw(1e-5, 1.0), B: draw(1e-6, 1e-2), ..Mechanics::default() };
            let (k_w, tau_load, speed) = (draw(1e-9, 1e-5), draw(0.01, 100.0), draw(10.0, 1e3));
            let par = PlantParameters {
                motor: motor.clone(),
                mechanics: Mechanics { k_w, ..mechanics },
                ..PlantParameters::default()
            };
            let (u, axis) = (AlphaBeta::new(draw(1.0, 300.0), -draw(1.0, 300.0)), Axis::at(draw(0.1, 10.0)));
            let psi = axis.to_stator(Dq::new(draw(0.1, 2.0) * motor.psi_M, draw(1e-3, 1.0) * motor.psi_M));
            let quick = Circuit {
                machine: Machine::<_, true>::new(&motor, Magnetics::Linear),
                path: Path { u, dissipation: Dissipation { R: motor.R_s, G: None }, drops: Ideal },
                shaft: Shaft::new(&par.mechanics, tau_load, Whole::new(&par.mechanics, speed)),
            };
            // A saturation and a dead time too small to have an effect.
            let (saturation, dead_time) = (Saturation { s_2: 1e-300, ..Saturation::default() }, 1e-300);
            let mut inverter = par.inverter.clone();
            inverter.dead_time = dead_time;
            let general = Circuit {
                machine: Machine::<_, false>::new(&motor, Magnetics::Polynomial(&saturation)),
                path: Path {
                    u,
                    dissipation: par.dissipation(motor.R_s, 4.0 * speed),
                    drops: Switches::new(&inverter, Gates::Switch, 300.0, Legs::switching(&inverter, 300.0)),
                },
                shaft: Shaft::new(&par.mechanics, tau_load, Standstill::new(&par.mechanics, speed)),
            };
            let (a, b) = (quick.rates(axis, psi, speed), general.rates(axis, psi, speed));
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * (1.0 + b.abs());
            assert!((a.d_psi - b.d_psi).magnitude() <= 1e-12 * (1.0 + b.d_psi.magnitude()));
            assert!((a.i - b.i).magnitude() <= 1e-12 * (1.0 + b.i.magnitude()));
            assert!(near(a.acceleration, b.acceleration) && near(a.tau_given, b.tau_given) && near(a.p_in, b.p_in));
            assert!(near(a.losses.cu, b.losses.cu) && near(a.losses.friction, b.losses.friction));
            assert!(near(a.losses.sum(), b.losses.sum()));
        }
    }

    #[test]
    fn steady_state_voltage() {
        // Kim & Sul (1) with constant currents: u_d = R i_d - w L_q i_q, u_q = R i_q + w (L_d i_d + psi_M).
        let par = PlantParameters { motor: Motor { L_q: 9e-3, ..Motor::default() }, ..PlantParameters::default() };
        let (motor, i, speed) = (&par.motor, Dq::new(-1.0, 3.0), 200.0 / 3.0);
        let u = Dq::new(-motor.R_s - 200.0 * 9e-3 * 3.0, motor.R_s * 3.0 + 200.0 * (-6e-3 + 0.15));
        let (axis, psi) = (Axis::<Rotor>::at(0.4), crate::machine::flux(motor, i));
        let circuit = Circuit {
            machine: Machine::<_>::new(motor, par.magnetics()),
            path: Path { u: axis.to_stator(u), dissipation: Dissipation { R: motor.R_s, G: None }, drops: Ideal },
            shaft: Shaft::new(&par.mechanics, 0.5, Standstill::new(&par.mechanics, speed)),
        };
        let rates = circuit.rates(axis, axis.to_stator(psi), speed);
        // In stator axes, the flux linkage turns with the rotor.
        let rest = rates.d_psi - axis.to_stator(psi.turned() * 200.0);
        assert!(rest.magnitude() < 1e-13, "{rest:?}");
        let tau_e = 1.5 * 3.0 * (0.15 * 3.0 + (6e-3 - 9e-3) * -3.0);
        let acceleration = (tau_e - 0.5 - par.mechanics.friction(speed)) / par.mechanics.J;
        assert!((rates.acceleration - acceleration).abs() < 1e-9, "{} rad/s2", rates.acceleration);
        // The input power is copper loss and mechanical power.
        assert!((rates.p_in - rates.losses.cu - tau_e * speed).abs() < 1e-11, "{} W", rates.p_in);
    }
}
