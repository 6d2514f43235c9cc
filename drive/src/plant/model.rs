//! The model `PmsmPlant`: inverter, machine and mechanics, integrated with held inputs.

use crate::frame::{AlphaBeta, Axis, Dq, Phases, Rotor};
use crate::integrate::rk4;
use crate::math::wrap;
use crate::modulation::limit_to_hexagon;
use crate::plant::legs::Legs;
use crate::plant::machine;
use crate::plant::power::{Energy, Powers};
use crate::plant::signals::{PlantInputs, PlantOutputs};
use crate::plant::tables::{OUTPUTS, PARAMETERS, PlantParameters};
use fmu_core::unit::{NEWTON_METER, RADIAN, SPEED, VOLT};
use fmu_core::{Block, Elapsed, Experiment, Fault, Info, Model, Part, Row, Step, Table, Terminal};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// Longest integration step in s. At 4500 rpm of the reference motor, the current error is less than 1e-5 A.
const LONGEST_SUBSTEP: f64 = 50e-6;

/// Maximum number of substeps in one communication step: 500 s of simulated time.
const MAX_SUBSTEPS: f64 = 1e7;

/// Integrated quantities: the state and the energies of the step.
type Vector = SVector<f64, 7>;

/// The state of machine and shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct State {
    /// Stator flux linkage in Wb.
    psi: Dq,
    /// Mechanical speed in rad/s.
    speed: f64,
    /// Mechanical angle in rad, not wrapped.
    angle: f64,
}

impl State {
    /// The state with the energy transferred so far in the step.
    fn to_vector(self, energy: &Energy) -> Vector {
        let Self { psi, speed, angle } = self;
        Vector::from([psi.d(), psi.q(), speed, angle, energy.r#in, energy.mech, energy.loss])
    }

    fn from_vector(x: &Vector) -> Self {
        Self { psi: Dq::new(x[0], x[1]), speed: x[2], angle: x[3] }
    }

    fn is_finite(self) -> bool {
        self.psi.is_finite() && self.speed.is_finite() && self.angle.is_finite()
    }
}

/// Permanent-magnet synchronous machine with an average inverter and one inertia.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PmsmPlant {
    /// Inputs, held over a communication step.
    pub inputs: PlantInputs,
    /// Parameters; a step never changes them.
    pub parameters: PlantParameters,
    state: State,
    /// Means over the last step.
    powers: Powers,
    /// Since the start.
    energy: Energy,
}

impl PmsmPlant {
    /// Voltage drop of the inverter legs.
    #[inline]
    fn legs(&self) -> Legs {
        let PlantParameters { motor, inverter, .. } = &self.parameters;
        let PlantInputs { u_dc, enable, .. } = self.inputs;
        if enable { Legs::switching(inverter, u_dc) } else { Legs::off(inverter, motor, u_dc) }
    }

    /// Stator current in the rotor frame and in the phases, in A.
    #[inline]
    fn currents(&self) -> (Dq, Phases) {
        let PlantParameters { motor, saturation, .. } = &self.parameters;
        let i = machine::current(motor, saturation, self.state.psi);
        let axis = Axis::<Rotor>::at(f64::from(motor.n_p) * self.state.angle);
        (i, Phases::from_stator(axis.to_stator(i)))
    }

    /// The state at the beginning of a step and the energy needed to reach it: an imposed shaft takes the angle of the
    /// drive train. A difference from the angle at the end of the last step turns the rotor under the stator flux
    /// linkage, which cannot jump; the magnetic field then does work on the shaft.
    #[inline]
    fn at_the_shaft(&self) -> (State, Energy) {
        let PlantParameters { motor, saturation, mechanics, .. } = &self.parameters;
        let PlantInputs { speed_shaft, angle_shaft, .. } = self.inputs;
        if !mechanics.imposed {
            return (self.state, Energy::default());
        }
        let axis = |angle: f64| Axis::<Rotor>::at(f64::from(motor.n_p) * angle);
        let psi = axis(angle_shaft).from_stator(axis(self.state.angle).to_stator(self.state.psi));
        let stored = |psi| machine::magnetic_energy(motor, saturation, psi);
        let energy = Energy { mech: stored(self.state.psi) - stored(psi), ..Energy::default() };
        (State { psi, speed: speed_shaft, angle: angle_shaft }, energy)
    }

    /// Derivative of state and energies with the stator voltage `u` held.
    #[inline]
    fn derivative(&self, x: &Vector, u: AlphaBeta, legs: &Legs) -> Vector {
        let PlantParameters { motor, saturation, .. } = &self.parameters;
        let State { psi, speed, angle } = State::from_vector(x);
        let n_p = f64::from(motor.n_p);
        let i = machine::current(motor, saturation, psi);
        let axis = Axis::<Rotor>::at(n_p * angle);
        let u = axis.from_stator(u - legs.loss(axis, i));
        let d_psi = machine::flux_derivative(motor, psi, u, i, n_p * speed);
        let copper = 1.5 * motor.R_s * i.dot(i);
        self.motion(d_psi, machine::torque(motor, psi, i), speed, (1.5 * u.dot(i), copper))
    }

    /// The derivative with the mechanical part: voltage `d_psi` (V), torque `tau_e` (N.m), `speed` (rad/s), and the
    /// electrical power in and lost (W).
    #[inline]
    fn motion(&self, d_psi: Dq, tau_e: f64, speed: f64, (p_in, copper): (f64, f64)) -> Vector {
        let mechanics = &self.parameters.mechanics;
        let friction = mechanics.friction(speed);
        let tau_shaft = mechanics.tau_shaft(tau_e, self.inputs.tau_load, friction);
        let acceleration = mechanics.acceleration(tau_e, tau_shaft, friction);
        let p_loss = copper + friction * speed;
        Vector::from([d_psi.d(), d_psi.q(), acceleration, speed, p_in, tau_shaft * speed, p_loss])
    }

    /// One substep of `h` (s) with the gates off.
    fn coast(&self, x: &Vector, h: f64, legs: &Legs) -> Vector {
        match self.blocked(x, legs) {
            Some(x) => rk4(x, h, |x| self.motion(Dq::ZERO, 0.0, x[2], (0.0, 0.0))),
            None => rk4(*x, h, |x| self.derivative(x, AlphaBeta::ZERO, legs)),
        }
    }

    /// The state without current, when the diodes block; the energy of the remaining current is lost.
    fn blocked(&self, x: &Vector, legs: &Legs) -> Option<Vector> {
        let PlantParameters { motor, saturation, .. } = &self.parameters;
        let State { psi, speed, angle } = State::from_vector(x);
        let (n_p, i) = (f64::from(motor.n_p), machine::current(motor, saturation, psi));
        legs.block(motor, Axis::at(n_p * angle), i, n_p * speed).then(|| {
            let free = machine::flux(motor, Dq::ZERO);
            let left = machine::magnetic_energy(motor, saturation, psi);
            Vector::from([free.d(), free.q(), speed, angle, x[4], x[5], x[6] + left])
        })
    }
}

impl Model for PmsmPlant {
    type Outputs = PlantOutputs;

    const INFO: Info = Info {
        name: "PmsmPlant",
        description: "Permanent-magnet synchronous machine with average inverter and mechanics",
        experiment: Experiment { start: 0.0, stop: 1.0, step: 1e-4 },
        documentation: crate::documentation::PLANT,
        ..crate::PROJECT
    };

    const TABLE: &'static Table<Block<Self>> = TABLE;

    const TERMINALS: &'static [Terminal] = crate::terminals::PLANT;

    const ICON: Option<&'static str> = Some(include_str!("../../icons/pmsm_plant.svg"));

    const STATE_VERSION: u16 = 4;

    fn initialize(&mut self) {
        let PlantParameters { motor, mechanics, initial, .. } = &self.parameters;
        let PlantInputs { speed_shaft, angle_shaft, .. } = self.inputs;
        let (speed, angle) = if mechanics.imposed {
            (speed_shaft, angle_shaft)
        } else {
            (initial.speed, initial.theta_e / f64::from(motor.n_p))
        };
        self.state = State { psi: machine::flux(motor, Dq::ZERO), speed, angle };
        self.energy = Energy::default();
        // No current yet: only the shaft has a power.
        let friction = mechanics.friction(speed);
        let tau_shaft = mechanics.tau_shaft(0.0, self.inputs.tau_load, friction);
        self.powers = Powers { p_mech: tau_shaft * speed, p_loss: friction * speed, ..Powers::default() };
    }

    fn output(&self, _now: Elapsed, out: &mut PlantOutputs) {
        let PlantParameters { motor, mechanics, .. } = &self.parameters;
        let State { psi, speed, angle } = self.state;
        let (i, phases) = self.currents();
        let tau_e = machine::torque(motor, psi, i);
        *out = PlantOutputs {
            i: phases,
            speed,
            angle,
            theta_e: wrap(f64::from(motor.n_p) * angle),
            tau_e,
            i_d: i.d(),
            i_q: i.q(),
            powers: self.powers,
            tau_shaft: mechanics.tau_shaft(tau_e, self.inputs.tau_load, mechanics.friction(speed)),
            energy: self.energy,
        };
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        let legs = self.legs();
        let substep = LONGEST_SUBSTEP.min(0.5 * legs.time(&self.parameters.motor));
        let count = (step.h / substep - 1e-9).ceil().max(1.0);
        if count > MAX_SUBSTEPS {
            let longest = MAX_SUBSTEPS * substep;
            return Err(Fault::value("the step size", format!("{} s", step.h), format!("at most {longest} s")));
        }
        let h = step.h / count;
        let (state, energy) = self.at_the_shaft();
        let mut x = state.to_vector(&energy);
        let mut left = count;
        if self.inputs.enable {
            let u = limit_to_hexagon(self.inputs.u, self.inputs.u_dc);
            while left > 0.0 {
                x = rk4(x, h, |x| self.derivative(x, u, &legs));
                left -= 1.0;
            }
        } else {
            while left > 0.0 {
                x = self.coast(&x, h, &legs);
                left -= 1.0;
            }
            x = self.blocked(&x, &legs).unwrap_or(x);
        }
        let (state, energy) = (State::from_vector(&x), Energy { r#in: x[4], mech: x[5], loss: x[6] });
        if !(state.is_finite() && energy.is_finite()) {
            return Err(Fault::new(format!(
                "the machine's state left the finite numbers within a step of {} s; the step before it ended with \
                 psi_d = {} Wb, psi_q = {} Wb, speed = {} rad/s",
                step.h,
                self.state.psi.d(),
                self.state.psi.q(),
                self.state.speed
            )));
        }
        self.state = state;
        self.energy.add(&energy);
        self.powers = Powers::mean(&energy, step.h, &self.inputs, &legs, || self.currents().1);
        Ok(())
    }
}

type V = Row<Block<PmsmPlant>>;

const TABLE: &Table<Block<PmsmPlant>> = &Table::new(
    const {
        &[
            V::discrete_input("u_a", &VOLT, "Voltage reference of phase a, average over a PWM period", |m| {
                &mut m.model.inputs.u.a
            }),
            V::discrete_input("u_b", &VOLT, "Voltage reference of phase b", |m| &mut m.model.inputs.u.b),
            V::discrete_input("u_c", &VOLT, "Voltage reference of phase c", |m| &mut m.model.inputs.u.c),
            V::input("u_dc", &VOLT, "DC-link voltage", |m| &mut m.model.inputs.u_dc).at_least(0.0),
            V::input("tau_load", &NEWTON_METER, "Load torque at the shaft, positive against positive speed", |m| {
                &mut m.model.inputs.tau_load
            }),
            V::input("speed_shaft", &SPEED, "Mechanical speed of the shaft; read only with mechanics.imposed", |m| {
                &mut m.model.inputs.speed_shaft
            }),
            V::input("angle_shaft", &RADIAN, "Mechanical angle of the shaft; read only with mechanics.imposed", |m| {
                &mut m.model.inputs.angle_shaft
            })
            .unbounded(),
            V::boolean_input("enable", "The inverter switches; false: gates off, only the diodes conduct", |m| {
                &mut m.model.inputs.enable
            }),
            V::part("", &Part { table: OUTPUTS, lens: |m| &mut m.out }),
            V::part("", &Part { table: PARAMETERS, lens: |m| &mut m.model.parameters }),
        ]
    },
);

#[cfg(test)]
mod tests {
    use super::*;

    /// The plant after 20 ms in steps of `h`, with a voltage that jumps every 0.1 ms.
    fn after(h: f64, speed: f64) -> Block<PmsmPlant> {
        let mut block = Block::<PmsmPlant>::default();
        block.model.parameters.initial.speed = speed;
        block.initialize();
        let mut now = Elapsed::ZERO;
        for k in 0..200_u32 {
            let theta = 3.0 * speed * 1e-4 * f64::from(k) + 1.8;
            let u = AlphaBeta::new(0.45 * speed * theta.cos(), 0.45 * speed * theta.sin() + f64::from(k % 3));
            block.model.inputs.u = Phases::from_stator(u);
            let mut done = 0.0;
            while done < 1e-4 - 0.5 * h {
                let step = Step { start: now, h };
                block.step(&step).unwrap();
                now = step.end();
                done += h;
            }
        }
        block
    }

    #[test]
    fn a_step_of_a_sample_period_is_integrated_to_ten_microamperes() {
        let (coarse, fine) = (after(1e-4, 471.0), after(1e-6, 471.0));
        let apart = (coarse.out.i_d - fine.out.i_d).abs().max((coarse.out.i_q - fine.out.i_q).abs());
        assert!(apart < 1e-5 && apart > 0.0, "{apart} A at 4500 rpm");
        assert!(fine.out.i_q.abs() > 0.5, "the current is not trivial: {} A", fine.out.i_q);
    }

    #[test]
    fn dead_time_stops_a_current_at_zero() {
        // A voltage below u_dead, 6.5 V, in every leg drives no more than the zone's current, however narrow the zone is.
        for i_zero in [0.1, 1e-3] {
            let mut block = Block::<PmsmPlant>::default();
            let inverter = &mut block.model.parameters.inverter;
            (inverter.dead_time, inverter.i_zero) = (2e-6, i_zero);
            block.model.inputs.u = Phases { a: 4.0, b: -2.0, c: -2.0 };
            block.initialize();
            let mut now = Elapsed::ZERO;
            for _ in 0..100 {
                let step = Step { start: now, h: 1e-4 };
                block.step(&step).unwrap();
                now = step.end();
                assert!(block.out.i.a.abs() < i_zero, "{} A with a zone of {i_zero} A", block.out.i.a);
            }
        }
    }

    #[test]
    fn power_is_balanced() {
        // Over 20 ms: electrical energy in = copper loss + friction + change of magnetic and kinetic energy.
        let mut block = Block::<PmsmPlant>::default();
        block.model.inputs.u = Phases { a: 20.0, b: -10.0, c: -10.0 };
        block.model.parameters.motor.L_q = 9e-3;
        block.initialize();
        let energy = |b: &Block<PmsmPlant>| {
            let PlantParameters { motor, mechanics, .. } = &b.model.parameters;
            let (i_d, i_q) = (b.out.i_d, b.out.i_q);
            0.75 * (motor.L_d * i_d * i_d + motor.L_q * i_q * i_q) + 0.5 * mechanics.J * b.out.speed * b.out.speed
        };
        let power = |b: &Block<PmsmPlant>| {
            let u = b.model.inputs.u;
            let input = u.a * b.out.i.a + u.b * b.out.i.b + u.c * b.out.i.c;
            let loss = 1.5 * b.model.parameters.motor.R_s * (b.out.i_d * b.out.i_d + b.out.i_q * b.out.i_q);
            input - loss - b.model.parameters.mechanics.friction(b.out.speed) * b.out.speed
        };
        block.model.state.angle = 0.3;
        let (mut now, mut work, mut last) = (Elapsed::ZERO, 0.0, power(&block));
        let h = 1e-6;
        for _ in 0..20_000 {
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
            let next = power(&block);
            work += 0.5 * h * (last + next);
            last = next;
        }
        assert!((energy(&block) - work).abs() < 1e-6 * work.abs(), "{} J stored, {work} J net in", energy(&block));
        assert!(energy(&block) > 0.01);
    }

    #[test]
    fn a_step_beyond_all_measure_is_refused() {
        let mut block = Block::<PmsmPlant>::default();
        block.initialize();
        let fault = block.step(&Step { start: Elapsed::ZERO, h: 1e300 }).unwrap_err();
        assert!(fault.message().contains("at most 500 s"), "{fault}");
    }
}
