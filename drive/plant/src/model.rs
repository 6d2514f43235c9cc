//! The model `PmsmPlant`: inverter, machine and mechanics, integrated with constant inputs.

use crate::following::Following;
use crate::idle;
use crate::inverter::Gates;
use crate::legs::Legs;
use crate::losses::flow::Switches;
use crate::losses::{Losses, efficiency};
use crate::machine;
use crate::power::{Energy, Powers};
use crate::rules;
use crate::signals::{PlantInputs, PlantOutputs};
use crate::state::{Accepted, Instant, State};
use crate::switched::state::Bridge;
use crate::tables::{FLUX, OUTPUTS, PARAMETERS, PlantParameters};
use crate::thermal::warm::Warm;
use crate::thermal::{THERMAL_INPUTS, Temperatures, ThermalMode};
use drive_base::connection::Measured;
use drive_base::frame::{Dq, Phases, Rotor, Vector};
use drive_base::implausible;
use drive_base::math::wrap;
use drive_base::motor::Motor;
use fmu_core::idle::why;
use fmu_core::log::Warnings;
use fmu_core::unit::{NEWTON_METER, RADIAN, SPEED, VOLT};
use fmu_core::{
    Block, Elapsed, Experiment, Fault, Info, Interface, Kept, Model, Part, Row, Scalar, Step, Table, Terminal, Warns,
    table,
};
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
    pub(super) point: Accepted,
    pub(super) kept: Kept<(Energy, Accepted)>,
    /// Temperatures and the machine at them, constant over a step.
    pub(super) warm: Warm,
    /// Current (A) at the terminals minus the flux linkage's, at the end of a step.
    pub(super) by_iron: Dq,
    /// Carrier and legs of the switched inverter.
    pub(super) bridge: Bridge,
    /// The angle of an imposed shaft beside its speed.
    pub(super) following: Following,
}

impl PmsmPlant {
    /// Voltage drop of the inverter legs.
    #[inline]
    pub(super) fn legs<S: Scalar>(&self, inputs: &PlantInputs<S>) -> Legs<S> {
        let (inverter, u_dc) = (&self.parameters.inverter, inputs.u_dc);
        match inputs.gates() {
            Gates::Switch if inverter.i_zero == 0.0 && inverter.dead_time > 0.0 => {
                let by_L = if self.parameters.flux_map.used {
                    1.0 / self.warm.least_inductance
                } else {
                    0.5 * (1.0 / self.parameters.motor.L_d + 1.0 / self.parameters.motor.L_q)
                };
                Legs::rippled(inverter, inputs.u, u_dc, by_L)
            }
            Gates::Switch => Legs::switching(inverter, u_dc),
            Gates::Short => Legs::shorted(inverter),
            Gates::Off => Legs::off(inverter, self.warm.least_inductance, u_dc),
        }
    }

    /// These `legs` with devices and switching losses.
    #[inline]
    pub(super) fn switches<S: Scalar>(&self, inputs: &PlantInputs<S>, legs: Legs<S>) -> Switches<S> {
        Switches::new(&self.parameters.inverter, inputs.gates(), inputs.u_dc, legs)
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

    /// The current (A) at the terminals minus the flux linkage's.
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

    /// Measured values for a controller: bit for bit equal to the outputs.
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

    const STATE_VERSION: u16 = 18;

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
        rules::validate(&self.parameters)?;
        self.check_temperatures(&self.inputs)
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
        (self.energy, self.point, self.kept) = (Energy::default(), Accepted::default(), Kept::default());
        self.following = Following::default();
        self.blocked = self.blocks(&self.inputs);
        self.bridge = Bridge::default();
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

    #[inline]
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        if self.parameters.mechanics.imposed {
            self.follow(step.h);
        }
        if self.parameters.thermal.mode == ThermalMode::Constant {
            self.advance_at_temperature(step)
        } else {
            self.advance_with_temperatures(step)
        }
    }
}

impl PmsmPlant {
    /// Counts a step of `h` (s) of Co-Simulation with an imposed shaft, at its beginning.
    #[cold]
    #[inline(never)]
    fn follow(&mut self, h: f64) {
        let PlantInputs { speed_shaft, angle_shaft, .. } = self.inputs;
        self.following.count(speed_shaft * h, angle_shaft - self.state.angle);
    }

    /// Begins anew where it is, with the rotor at the mechanical `angle` (rad): the counters are 0, the machine goes on as it was.
    pub fn begin_here(&mut self, angle: f64) {
        self.state = State::new(&self.warm.motor, self.state.psi, self.state.speed, angle);
        (self.energy, self.point, self.kept) = (Energy::default(), Accepted::default(), Kept::default());
    }
}

impl Warns for PmsmPlant {
    fn warn(&self, log: &mut Warnings<'_>) {
        if !self.parameters.is_linear() {
            self.parameters.magnetics().warn(&self.warm.motor, self.state.psi, log);
        }
        implausible::angle("initial.theta_e", self.parameters.initial.theta_e, log);
        self.parameters.thermal.warn(&self.inputs.thermal, log);
        self.parameters.inverter.warn(log);
        self.following.warn(self.inputs.angle_shaft, self.inputs.speed_shaft, log);
    }
}

type V = Row<Block<PmsmPlant>>;

/// All variables of `PmsmPlant`.
const TABLE: &Table<Block<PmsmPlant>> = table![
    V::input("u_a", &VOLT, "Voltage reference of phase a, average over a PWM period", |m| { &mut m.model.inputs.u.a }),
    V::input("u_b", &VOLT, "Voltage reference of phase b", |m| &mut m.model.inputs.u.b),
    V::input("u_c", &VOLT, "Voltage reference of phase c", |m| &mut m.model.inputs.u.c),
    V::input("u_dc", &VOLT, "DC-link voltage", |m| &mut m.model.inputs.u_dc).at_least(0.0),
    V::boolean_input("enable", "The inverter switches; false: gates off, only the diodes conduct", |m| {
        &mut m.model.inputs.enable
    })
    .optional(),
    V::boolean_input(
        "asc",
        "Active short circuit: all upper or all lower transistors conduct, regardless of enable",
        |m| &mut m.model.inputs.asc,
    )
    .optional(),
    V::input("tau_load", &NEWTON_METER, "Load torque at the shaft, positive against positive speed", |m| {
        &mut m.model.inputs.tau_load
    }),
    V::input("speed_shaft", &SPEED, "Mechanical speed of the shaft", |m| &mut m.model.inputs.speed_shaft)
        .read_with("mechanics.imposed", "true"),
    V::input("angle_shaft", &RADIAN, "Mechanical angle of the shaft", |m| &mut m.model.inputs.angle_shaft)
        .unbounded()
        .read_with("mechanics.imposed", "true"),
    V::part("", &Part { table: THERMAL_INPUTS, lens: |m| &mut m.model.inputs.thermal }),
    V::part("", &Part { table: OUTPUTS, lens: |m| &mut m.out }),
    V::part("", &Part { table: FLUX, lens: |m| m.model.flux_mut() }),
    V::part("", &Part { table: PARAMETERS, lens: |m| &mut m.model.parameters }),
];

#[cfg(test)]
mod tests;
