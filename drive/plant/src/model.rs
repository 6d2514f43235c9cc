//! The model `PmsmPlant`: inverter, machine and mechanics, integrated with constant inputs.

use crate::counters::Point;
use crate::flux_map;
use crate::idle;
use crate::legs::Legs;
use crate::losses::{Losses, efficiency};
use crate::machine;
use crate::power::Energy;
use crate::power::Powers;
use crate::signals::{Gates, PlantInputs, PlantOutputs};
use crate::state::{Instant, State};
use crate::tables::{PARAMETERS, PlantParameters, TABLE};
use crate::thermal::warm::Warm;
use crate::thermal::{self, Temperatures, ThermalMode};
use drive_base::connection::Measured;
use drive_base::frame::{Dq, Phases, Rotor, Vector};
use drive_base::math::wrap;
use drive_base::motor::Motor;
use fmu_core::idle::why;
use fmu_core::log::Warnings;
use fmu_core::{Block, Elapsed, Experiment, Fault, Info, Interface, Kept, Model, Scalar, Step, Table, Terminal, Warns};
use serde::{Deserialize, Serialize};

/// Permanent-magnet synchronous machine with an average inverter and one inertia.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PmsmPlant {
    /// Inputs, constant over a communication step.
    pub inputs: PlantInputs,
    /// Parameters; a step never changes them.
    pub parameters: PlantParameters,
    pub(super) state: State,
    /// The diodes block while the gates are off: decided by [`Events::event`](fmu_core::Events::event) and at the end of
    /// a step.
    pub(super) blocked: bool,
    /// Means over the last step.
    pub(super) powers: Powers,
    /// Since the start.
    pub(super) energy: Energy,
    /// In Model Exchange, the last point of the importer's solution, and the counts of earlier ones.
    pub(super) point: Point,
    pub(super) kept: Kept<(Energy, Point)>,
    /// Temperatures and the machine at them, constant over a step.
    pub(super) warm: Warm,
    /// Current (A) at the terminals minus that of the flux linkage, at the end of a step.
    pub(super) by_iron: Dq,
}

impl PmsmPlant {
    /// Voltage drop of the inverter legs.
    #[inline]
    pub(super) fn legs<S: Scalar>(&self, inputs: &PlantInputs<S>) -> Legs<S> {
        let (inverter, u_dc) = (&self.parameters.inverter, inputs.u_dc);
        match inputs.gates() {
            Gates::Switch => Legs::switching(inverter, u_dc),
            Gates::Short => Legs::shorted(inverter),
            Gates::Off => Legs::off(inverter, self.warm.least_inductance, u_dc),
        }
    }

    /// The current (A) of the flux linkage of this `motor` while the diodes block, at the mechanical `speed` (rad/s).
    #[inline]
    pub(super) fn idle_current<S: Scalar>(&self, motor: &Motor<S>, speed: S) -> Vector<Rotor, S> {
        let iron = &self.parameters.iron;
        if iron.is_none() {
            return Vector::fixed(Dq::ZERO);
        }
        iron.idle_current(motor, speed * f64::from(motor.n_p))
    }

    /// The flux linkage (Wb) of [`idle_current`](Self::idle_current).
    pub(super) fn idle_flux<S: Scalar>(&self, motor: &Motor<S>, speed: S) -> Vector<Rotor, S> {
        machine::flux(motor, self.idle_current(motor, speed))
    }

    /// The present instant, at the end of a step.
    #[inline]
    pub(super) fn reached(&self) -> Instant {
        let State { psi, speed, angle, axis } = self.state;
        let i = self.machine::<false>().current(psi);
        Instant { psi, i, speed, angle, axis, idle: self.blocked && self.inputs.is_off() }
    }

    /// [`reached`](Self::reached) with iron loss, and the current (A) at the terminals.
    fn reached_with_iron(&self) -> (Instant, Dq) {
        let at = self.reached();
        let at = if at.idle { Instant { i: self.idle_current(&self.warm.motor, at.speed), ..at } } else { at };
        let i = at.axis.from_stator(self.rates(&self.inputs, &at).i);
        (at, i)
    }

    /// The current (A) at the terminals minus that of the flux linkage.
    pub(super) fn current_by_iron(&self) -> Dq {
        let (_, i) = self.reached_with_iron();
        i - self.reached().i
    }

    /// The outputs with iron loss.
    #[inline(never)]
    fn output_with_iron(&self, out: &mut PlantOutputs) {
        let at = self.reached();
        *out = self.shown(&self.inputs, &at, at.i + self.by_iron, self.warm.at, self.powers);
    }

    /// The outputs under these `inputs` with the current `i` (A) at the terminals, the `temperatures` (K) and these `powers`.
    #[expect(clippy::inline_always, reason = "as for `drive`")]
    #[inline(always)]
    pub(super) fn shown<S: Scalar>(
        &self,
        inputs: &PlantInputs<S>,
        at: &Instant<S>,
        i: Vector<Rotor, S>,
        temperatures: Temperatures<S>,
        powers: Powers<S>,
    ) -> PlantOutputs<S> {
        let motor = &self.parameters.motor;
        let &Instant { psi, speed, angle, axis, .. } = at;
        let (theta, tau_e) = (angle * f64::from(motor.n_p), self.machine_of(motor).torque(psi, at.i));
        PlantOutputs {
            i: Phases::from_stator(axis.to_stator(i)),
            speed,
            angle,
            theta_e: theta.chain(wrap(theta.value()), 1.0),
            tau_e,
            i_d: i.d(),
            i_q: i.q(),
            powers,
            energy: self.energy,
            efficiency: efficiency(powers.p_in, powers.p_mech),
            temperatures,
            heat: self.heat(inputs, &temperatures, &powers.losses),
        }
    }

    /// The flux linkage (Wb), for its variables.
    #[inline]
    pub fn flux_mut(&mut self) -> &mut Dq {
        &mut self.state.psi
    }

    /// Mean powers over the last step.
    #[inline]
    pub fn powers(&self) -> Powers {
        self.powers
    }

    /// Mechanical speed (rad/s) and amplitude of the line-to-line back EMF (V).
    pub fn speed_and_emf(&self) -> (f64, f64) {
        let (Motor { n_p, psi_M, .. }, speed) = (&self.warm.motor, self.state.speed);
        (speed, 3.0_f64.sqrt() * psi_M * (f64::from(*n_p) * speed).abs())
    }

    /// Measured values for a controller: bit for bit those of the outputs.
    #[inline]
    pub fn measured(&self) -> Measured {
        let Instant { i, speed, angle, axis, .. } = self.reached();
        let i = if self.parameters.iron.is_none() { i } else { i + self.by_iron };
        let theta_e = wrap(angle * f64::from(self.parameters.motor.n_p));
        Measured { i: Phases::from_stator(axis.to_stator(i)), theta_e, speed }
    }

    /// Stator currents in A.
    #[inline(never)]
    pub(super) fn currents(&self) -> Phases {
        let (at, i) = self.reached_with_iron();
        Phases::from_stator(at.axis.to_stator(i))
    }
}

impl Model for PmsmPlant {
    type Outputs = PlantOutputs;

    const INFO: Info = Info {
        name: "PmsmPlant",
        description: "Permanent-magnet synchronous machine with average inverter and mechanics",
        experiment: Experiment { stop: 1.0, step: 1e-4, ..Experiment::DEFAULT },
        documentation: crate::documentation::PLANT,
        ..drive_base::PROJECT
    };

    const TABLE: &'static Table<Block<Self>> = TABLE;

    const TERMINALS: &'static [Terminal] = crate::terminals::PLANT;

    const ICON: Option<&'static str> = Some(include_str!("../icons/pmsm_plant.svg"));

    const STATE_VERSION: u16 = 12;

    fn idle(&self, name: &str) -> Option<&'static str> {
        let PlantInputs { u_dc, speed_shaft, angle_shaft, .. } = self.inputs;
        match name {
            "u_dc" if u_dc == 0.0 => Some(idle::NO_VOLTAGE),
            "mechanics.imposed" if speed_shaft == 0.0 && angle_shaft == 0.0 => Some(idle::AT_REST),
            _ => why(idle::ACTS, &self.parameters, name),
        }
    }

    fn derive(&mut self) {
        self.warm.least_inductance = self.parameters.least_inductance();
        self.take(self.warm.at);
    }

    fn validate(&self) -> Result<(), Fault> {
        let initial = &self.parameters.initial;
        let fastest = self.fastest();
        if initial.speed.abs() > fastest && !self.parameters.mechanics.imposed {
            let allowed = format!("at most {fastest} rad/s in magnitude, the speed of any machine with this motor.n_p");
            return Err(PARAMETERS.fault(&self.parameters, |p| &mut p.initial.speed, allowed));
        }
        flux_map::validate(&self.parameters)?;
        thermal::validate(&self.parameters)?;
        self.judge_temperatures(&self.inputs)
    }

    fn validate_for(&self, interface: Interface) -> Result<(), Fault> {
        self.validate_network(interface)
    }

    fn initialize(&mut self) {
        self.start_temperatures();
        let PlantParameters { mechanics, initial, .. } = &self.parameters;
        let motor = &self.warm.motor;
        let PlantInputs { speed_shaft, angle_shaft, .. } = self.inputs;
        let (speed, angle) = if mechanics.imposed {
            (speed_shaft, angle_shaft)
        } else {
            (initial.speed, initial.theta_e / f64::from(motor.n_p))
        };
        let psi = if self.inputs.is_off() { self.idle_flux(motor, speed) } else { machine::flux(motor, Dq::ZERO) };
        self.state = State::new(motor, psi, speed, angle);
        (self.energy, self.point, self.kept) = (Energy::default(), Point::default(), Kept::default());
        self.blocked = self.blocks(&self.inputs);
        self.by_iron = self.current_by_iron();
        // No current yet: only the shaft has a power.
        let friction = mechanics.friction(speed);
        let p_mech = mechanics.tau_shaft(0.0 - friction, self.inputs.tau_load) * speed;
        let losses = Losses { friction: friction * speed, ..Losses::default() };
        let (at, _) = self.reached_with_iron();
        let tau_e = self.machine::<false>().torque(at.psi, at.i);
        let tau_shaft = mechanics.tau_shaft(tau_e - friction, self.inputs.tau_load);
        self.powers = Powers { p_mech, p_loss: losses.friction, losses, tau_shaft, ..Powers::default() };
    }

    fn output(&self, _now: Elapsed, out: &mut PlantOutputs) {
        if !self.parameters.iron.is_none() {
            return self.output_with_iron(out);
        }
        let at = self.reached();
        *out = self.shown(&self.inputs, &at, at.i, self.warm.at, self.powers);
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        if self.parameters.thermal.mode == ThermalMode::Constant {
            self.advance_at_temperature(step.h)
        } else {
            self.advance_with_temperatures(step.h)
        }
    }
}

impl Warns for PmsmPlant {
    fn warn(&self, log: &mut Warnings<'_>) {
        let (map, psi) = (&self.parameters.flux_map, self.state.psi);
        if map.used && !map.holds(psi - Dq::new(self.warm.motor.psi_M, 0.0)) {
            log.warn("flux_map", || {
                format!(
                    "psi_d = {} Wb, psi_q = {} Wb is beyond the flux map, which continues with the inductances of its edge; limit the \
                     current, or fit a map to a table with larger currents",
                    psi.d(),
                    psi.q()
                )
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive_base::frame::AlphaBeta;

    /// Current (A) of `motor` after each of 20 samples of 0.1 ms in steps of `h` (s), at the `speed` (rad/s), with a voltage
    /// that jumps at every sample.
    pub(super) fn currents(motor: &Motor, speed: f64, h: f64) -> Vec<Dq> {
        let mut block = Block::<PmsmPlant>::default();
        block.model.parameters.motor = motor.clone();
        (block.model.parameters.initial.speed, block.model.parameters.mechanics.J) = (speed, 1e-2);
        block.initialize();
        let w = f64::from(motor.n_p) * speed;
        let mut now = Elapsed::ZERO;
        let sample = |k: u32| {
            let theta = w * 1e-4 * f64::from(k) + 1.8;
            let e = motor.psi_M * w;
            block.model.inputs.u_dc = 1e4;
            block.model.inputs.u =
                Phases::from_stator(AlphaBeta::new(e * theta.cos(), e * theta.sin() + f64::from(k % 3)));
            let mut done = 0.0;
            while done < 1e-4 - 0.5 * h {
                let step = Step { start: now, h };
                block.step(&step).unwrap();
                now = step.end();
                done += h;
            }
            Dq::new(block.out.i_d, block.out.i_q)
        };
        (0..20).map(sample).collect()
    }

    #[test]
    fn a_step_of_a_sample_period_is_as_good_as_64() {
        // Two steps in rotor axes instead of one in stator axes give errors of 8.5, 0.9 and 92 uA.
        let servo = Motor { n_p: 4, R_s: 0.2, L_d: 1.2e-3, L_q: 1.2e-3, psi_M: 0.09 };
        // At 20 000 rpm, the rotor turns 0.84 rad in a sample: four steps.
        for (motor, rpm, allowed) in [
            (&Motor::default(), 4500.0, 2e-6),
            (&Motor::IPMSM_2_2_KW, 3000.0, 3e-7),
            (&servo, 4500.0, 1e-5),
            (&servo, 20_000.0, 1e-5),
        ] {
            let speed = rpm * std::f64::consts::PI / 30.0;
            let (coarse, fine) = (currents(motor, speed, 1e-4), currents(motor, speed, 1e-4 / 64.0));
            let error = coarse.iter().zip(&fine).map(|(&a, &b)| (a - b).magnitude()).fold(0.0, f64::max);
            assert!(error < allowed && error > 0.0, "{error} A with {motor:?} at {rpm} rpm");
            assert!(fine[19].magnitude() > 0.1, "the current is not trivial: {:?}", fine[19]);
        }
    }

    #[test]
    fn a_voltage_that_depends_on_the_currents_is_integrated_in_short_steps() {
        // Within 2 ms, the phase currents pass the zone of the dead time, +-0.5 A.
        let after = |h: f64, steps: u32| {
            let mut block = Block::<PmsmPlant>::default();
            let PlantParameters { inverter, initial, .. } = &mut block.model.parameters;
            (inverter.dead_time, inverter.i_zero, initial.speed) = (4e-6, 0.5, 200.0);
            block.model.inputs.u = Phases::from_stator(AlphaBeta::new(-80.0, 60.0));
            block.initialize();
            let mut now = Elapsed::ZERO;
            for _ in 0..steps {
                let step = Step { start: now, h };
                block.step(&step).unwrap();
                now = step.end();
            }
            Dq::new(block.out.i_d, block.out.i_q)
        };
        let (coarse, fine) = (after(2e-3, 1), after(1e-6, 2000));
        let error = (coarse - fine).magnitude();
        // The kinks at the edges of the zone cost the method its order: 0.6 mA; with substeps of 400 us, 4 mA.
        assert!(error < 1e-3 && fine.magnitude() > 1.0, "{error} A, {fine:?}");
    }

    #[test]
    fn dead_time_stops_a_current_at_zero() {
        // A voltage below u_dead, 6.5 V, in every leg drives at most the zone's current, however narrow the zone is.
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
        block.model.parameters.initial.theta_e = 0.9;
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
        assert!(fault.message().contains("at most 1000 s"), "{fault}");
    }
}
