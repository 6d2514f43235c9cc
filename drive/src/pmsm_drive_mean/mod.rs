//! The model `PmsmDriveMean`: the drive for system models, a drop-in replacement for `PmsmDrive`.
//!
//! It has the variables of [`PmsmDrive`](crate::PmsmDrive) and, at every instant, the [steady state](crate::steady) of that
//! drive; only the torque has dynamics. With the torque reference t of torque mode or speed loop:
//!
//! ```text
//! t_lag dx/dt = min(max(t, tau_min), tau_max) - x,  t_lag = 1 / current.bandwidth       currents, voltage, powers: those of x
//! J d speed/dt = tau_e - friction - tau_load, or with mechanics.imposed speed_shaft
//! ```
//!
//! tau_min and tau_max depend on speed and u_dc. Without sampling, steps can be of any length: [`advance`] is exact for x
//! in torque mode, and stable and of second order for the speed. The energies are the integrals of the powers; all other
//! outputs are values at the end of the step. The estimates are the true values, the phase currents the sinusoids of i_d and
//! i_q.
//!
//! There is no estimator, start, sensor error or injection, and no oscillation of the current loop: their parameters are
//! accepted, and [`Model::has_effect`] names those with an effect. In Model Exchange the importer integrates the same equations.
//!
//! [`advance`]: Model::advance

mod exchange;
mod motion;
mod show;

use crate::dc_link::{LINK, LinkParameters};
use crate::idle;
use crate::pmsm_drive::{DriveInputs, DriveOutputs, Happened, INPUTS, OUTPUTS, in_part, same_pole_pairs};
use crate::steady::{Condition, Point, Steady};
use drive_base::frame::Dq;
use drive_base::math::all_finite;
use drive_control::commissioning::{Held, IDENTIFIED};
use drive_control::model::clipped;
use drive_control::signals::ControllerOutputs;
use drive_control::tables as control;
use drive_plant::PmsmPlant;
use drive_plant::power::{Energy, Powers};
use drive_plant::pwm::Pwm;
use drive_plant::rules::check_temperatures;
use drive_plant::tables as plant;
use drive_plant::thermal::{Temperatures, ThermalMode};
use fmu_core::log::Warnings;
use fmu_core::unit::{AMPERE, NEWTON_METER, SPEED};
use fmu_core::{
    Block, Elapsed, Experiment, Fault, Info, Interface, Model, Part, Row, Step, Table, Terminal, Warns, table,
};
use serde::{Deserialize, Serialize};

/// A drive with dynamics only in torque and shaft.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PmsmDriveMean {
    /// Inputs, constant over a communication step.
    pub inputs: DriveInputs,
    /// Plant and controller with their parameters.
    pub drive: Steady,
    /// Parameters of the DC link, without effect: `u_dc` is the voltage of the inverter.
    pub link_parameters: LinkParameters,
    state: State,
    /// Energies in J.
    energy: Energy,
    /// Temperatures in K of the network.
    network: Temperatures,
    /// The point at the end of the last step, the question that it answers, and whether it is still valid: a changed parameter
    /// invalidates it.
    point: Point,
    asked: Question,
    known: bool,
    /// Whether a step was taken.
    moved: bool,
    /// Model Exchange: outputs of the controller since the last event.
    held: ControllerOutputs,
    /// Whether no drive can operate like this.
    impossible: Happened,
    /// Time in s for which the torque reference has exceeded its limits.
    clipped_for: f64,
    /// Always `None`: a drive in steady state does not commission itself.
    commissioning: Held,
}

impl Default for PmsmDriveMean {
    fn default() -> Self {
        let drive = Steady::default().sampled();
        let network = drive.start_temperatures();
        Self {
            inputs: DriveInputs::default(),
            drive,
            link_parameters: LinkParameters::default(),
            state: State::default(),
            energy: Energy::default(),
            network,
            point: Point::default(),
            asked: Question::default(),
            known: false,
            moved: false,
            held: ControllerOutputs::default(),
            impossible: Happened::default(),
            clipped_for: 0.0,
            commissioning: None,
        }
    }
}

/// Quantities that take time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct State {
    /// Torque of the current loop in N.m: x.
    tau: f64,
    /// Integral part of the speed loop in A.
    integral: f64,
    /// Speed reference on its ramp in rad/s.
    speed_ref: f64,
    /// Mechanical speed in rad/s.
    speed: f64,
    /// Mechanical angle in rad, not wrapped.
    angle: f64,
}

/// Result of a step: state and point at its end, and the mean powers.
struct Passed {
    state: State,
    powers: Powers,
    point: Point,
}

/// Inputs of a point: the condition, the torque in N.m, and whether the drive is enabled.
type Question = (Condition, f64, bool);

/// Outputs: as in `PmsmDrive`, plus the flux linkage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeanOutputs {
    /// Outputs of plant and controller.
    pub drive: DriveOutputs,
    /// Flux linkage in Wb.
    pub psi: Dq,
}

/// Share of u_dc / sqrt 3 above which a voltage exceeds the link.
const FULL: f64 = 1.0 + 1e-6;

/// Remedy for impossible temperatures.
const REMEDY: &str = "the network became too hot; reduce the torque, or raise thermal.G_ws and thermal.G_sc";

impl PmsmDriveMean {
    /// The temperatures (K) under the inputs.
    fn temperatures(&self) -> Temperatures {
        match self.drive.plant.thermal.mode {
            ThermalMode::Constant => self.drive.start_temperatures(),
            ThermalMode::Network => self.network,
            ThermalMode::Imposed => self.inputs.thermal.imposed,
        }
    }

    /// Mechanical speed (rad/s) in this state.
    fn speed(&self, state: &State) -> f64 {
        if self.drive.plant.mechanics.imposed { self.inputs.speed_shaft } else { state.speed }
    }

    /// The condition in this state at the temperatures `at` (K).
    fn condition(&self, state: &State, at: Temperatures) -> Condition {
        Condition { speed: self.speed(state), u_dc: self.inputs.u_dc, temperatures: at }
    }

    /// The inputs of the point in this state at the temperatures `at` (K).
    fn question(&self, state: &State, at: Temperatures) -> Question {
        (self.condition(state, at), state.tau, self.inputs.enable)
    }

    /// The point in this state at the temperatures `at` (K); the point at the end of the last step is cached.
    fn point_at(&self, state: &State, at: Temperatures) -> Point {
        if self.known && self.question(state, at) == self.asked {
            return self.point;
        }
        let at = self.drive.at(&self.condition(state, at));
        if self.inputs.enable { at.by_reference(state.tau) } else { at.off() }
    }

    /// The powers of a point at the mechanical `speed` (rad/s); the torque of a free shaft equals the load.
    fn powers_of(&self, point: &Point, speed: f64) -> Powers {
        if self.drive.plant.mechanics.imposed {
            return point.powers;
        }
        Powers { tau_shaft: self.inputs.tau_load, p_mech: self.inputs.tau_load * speed, ..point.powers }
    }

    /// Whether the torque reference exceeds its limits.
    fn is_clipped(&self) -> bool {
        let (tau_ref, [low, high]) = (self.inputs.tau_ref, self.point.limits);
        self.drive.controller.speed_loop.torque_mode && self.inputs.enable && (tau_ref > high || tau_ref < low)
    }

    /// A plant with these parameters and inputs, to validate them.
    fn plant(&self) -> PmsmPlant {
        let mut plant = PmsmPlant::default();
        plant.parameters.clone_from(&self.drive.plant);
        // Means refer to the average inverter.
        plant.parameters.inverter.pwm = Pwm::default();
        plant.inputs.thermal = self.inputs.thermal;
        plant
    }
}

/// Reason given for parameters without effect.
const ONLY_IN_THE_DRIVE: &str = "no effect in PmsmDriveMean, which has no DC link, no limits of its current, no estimator, start, sensor, \
                                 trip, short circuit or commissioning; use PmsmDrive";

/// Parameters and groups of parameters of the controller with an effect.
const EFFECTIVE: [&str; 13] = [
    "T_s",
    "estimator",
    "motor.",
    "mechanics.J",
    "initial.speed_est",
    "limit.",
    "speed_loop.",
    "current.bandwidth",
    "current.mtpa",
    "zero_speed.",
    "weakening.use",
    "weakening.k_",
    "weakening.bandwidth",
];

impl Model for PmsmDriveMean {
    type Outputs = MeanOutputs;

    const INFO: Info = Info {
        name: "PmsmDriveMean",
        description: "PmsmDrive for system models: its steady state at every instant, with steps of 10 ms and more",
        experiment: Experiment { stop: 1.0, step: 1e-2, ..Experiment::DEFAULT },
        documentation: crate::documentation::MEAN,
        ..drive_base::PROJECT
    };

    const TABLE: &'static Table<Block<Self>> = TABLE;

    const TERMINALS: &'static [Terminal] = crate::terminals::DRIVE;

    const ICON: Option<&'static str> = Some(include_str!("../../icons/pmsm_drive.svg"));

    const STATE_VERSION: u16 = 3;

    const CONTINUOUS: bool = true;

    fn has_effect(parameter: &str) -> bool {
        if let Some(name) = parameter.strip_prefix("controller.") {
            let listed = |of: &&str| name == *of || (of.ends_with(['.', '_']) && name.starts_with(*of));
            return !name.starts_with("limit.i_dc_") && EFFECTIVE.iter().any(listed);
        }
        let elsewhere =
            ["dead_time", "i_zero", "mode", "update", "zero_sequence", "pulse_min", "open_switch", "open_phase"];
        let elsewhere = parameter.strip_prefix("plant.inverter.").is_some_and(|name| elsewhere.contains(&name));
        !elsewhere && !parameter.starts_with("dc_link.") && !parameter.starts_with("chopper.")
    }

    fn idle(&self, name: &str) -> Option<&'static str> {
        if !Self::has_effect(name) || ["asc", "sensor_valid", "commission_start"].contains(&name) {
            return Some(ONLY_IN_THE_DRIVE);
        }
        let Steady { plant, controller, .. } = &self.drive;
        let DriveInputs { u_dc, speed_shaft, angle_shaft, .. } = self.inputs;
        idle::of_drive((plant, controller, &self.link_parameters), (u_dc, [speed_shaft, angle_shaft]), name)
    }

    fn derive(&mut self) {
        self.drive.derive();
        self.known = false;
    }

    fn validate(&self) -> Result<(), Fault> {
        self.plant().validate().map_err(|fault| in_part("plant", &fault))?;
        same_pole_pairs(&self.drive.plant, &self.drive.controller)
    }

    fn validate_for(&self, interface: Interface) -> Result<(), Fault> {
        self.plant().validate_for(interface).map_err(|fault| in_part("plant", &fault))
    }

    fn initialize(&mut self) {
        let Steady { plant, controller, .. } = &self.drive;
        let (speed, angle) = if plant.mechanics.imposed {
            (self.inputs.speed_shaft, self.inputs.angle_shaft)
        } else {
            (plant.initial.speed, plant.initial.theta_e / f64::from(plant.motor.n_p))
        };
        self.state = State { speed, angle, speed_ref: controller.speed_est, ..State::default() };
        (self.energy, self.network, self.moved) = (Energy::default(), self.drive.start_temperatures(), false);
        (self.clipped_for, self.impossible) = (0.0, Happened::default());
        let temperatures = self.temperatures();
        self.point = self.point_at(&self.state, temperatures);
        (self.asked, self.known) = (self.question(&self.state, temperatures), true);
        self.held = self.controller(&self.state, &self.point);
    }

    fn output(&self, _now: Elapsed, out: &mut MeanOutputs) {
        self.show(&self.state, &self.point, self.temperatures(), out);
        out.drive.controller = self.controller(&self.state, &self.point);
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        let temperatures = self.temperatures();
        let thermal = &self.drive.plant.thermal;
        if thermal.mode == ThermalMode::Imposed {
            let names = ["T_winding_imposed", "T_magnet_imposed"];
            check_temperatures(
                &self.drive.plant,
                &temperatures,
                names,
                "temperatures are in K (20 degC are 293.15 K)",
            )?;
        }
        let Passed { state, powers, point } = self.pass(step.h, temperatures)?;
        if !all_finite([state.tau, state.integral, state.speed, state.angle, powers.p_in, powers.p_loss]) {
            return Err(Fault::new(format!("the drive's state is no longer finite after a step of {} s", step.h)));
        }
        let total = Energy::from(powers);
        self.energy.add(&Energy { r#in: total.r#in * step.h, mech: total.mech * step.h, loss: total.loss * step.h });
        (self.state, self.point, self.moved) = (state, point, true);
        (self.asked, self.known) = (self.question(&state, temperatures), true);
        self.impossible = self.impossible.followed_by(self.is_impossible());
        self.clipped_for = if self.is_clipped() { self.clipped_for + step.h } else { 0.0 };
        if thermal.mode == ThermalMode::Network {
            let (heat, coolant) = (thermal.heat(&powers.losses), self.inputs.thermal.coolant);
            let next = thermal.network.step(&self.network, &heat, coolant, step.h);
            check_temperatures(&self.drive.plant, &next, ["T_winding", "T_magnet"], REMEDY)?;
            self.network = next;
        }
        Ok(())
    }
}

impl PmsmDriveMean {
    /// Whether no drive can operate like this: no current fits the voltage of the link, or diodes conduct.
    fn is_impossible(&self) -> bool {
        let DriveInputs { u_dc, enable, .. } = self.inputs;
        if enable {
            return u_dc > 0.0 && self.point.u_share > FULL;
        }
        self.speed(&self.state).abs() > self.drive.diode_speed(u_dc, self.temperatures().magnet)
    }
}

impl Warns for PmsmDriveMean {
    fn warn(&self, log: &mut Warnings<'_>) {
        if self.impossible == Happened::Now {
            let (speed, u_share, u_dc) = (self.speed(&self.state), self.point.u_share, self.inputs.u_dc);
            log.warn("u_share", || {
                let why = if self.inputs.enable {
                    format!("no current fits u_dc = {u_dc} V (u_share = {u_share:.3})")
                } else {
                    format!("the back EMF is above u_dc = {u_dc} V with the gates off")
                };
                format!(
                    "{why} at {speed} rad/s: the diodes would conduct and the machine feed the link. PmsmDriveMean does not \
                     model this, and its outputs are not those of a drive; use PmsmDrive"
                )
            });
        }
        if self.clipped_for >= 1.0 {
            log.warn("tau_ref", || clipped(self.inputs.tau_ref, self.point.limits));
        }
    }
}

type S = Row<State>;

/// States that `PmsmDrive` does not have.
const STATES: &Table<State> = table![
    S::state("tau_lag", &NEWTON_METER, "Torque of the current loop, which follows its reference", |s| { &mut s.tau }),
    S::state("speed_loop_integral", &AMPERE, "Integral part of the speed loop", |s| &mut s.integral),
    S::state("speed_ref_ramp", &SPEED, "Speed reference on its ramp", |s| &mut s.speed_ref).nominal(100.0),
];

type V = Row<Block<PmsmDriveMean>>;

const TABLE: &Table<Block<PmsmDriveMean>> = table![
    V::part("", &Part { table: INPUTS, lens: |m| &mut m.model.inputs }),
    V::part("", &Part { table: OUTPUTS, lens: |m| &mut m.out.drive }),
    V::part("", &Part { table: IDENTIFIED, lens: |m| &mut m.model.commissioning }),
    V::part("", &Part { table: plant::FLUX, lens: |m| &mut m.out.psi }),
    V::part("plant.", &Part { table: plant::PARAMETERS, lens: |m| &mut m.model.drive.plant }),
    V::part("controller.", &Part { table: control::PARAMETERS, lens: |m| &mut m.model.drive.controller }),
    V::part("", &Part { table: LINK, lens: |m| &mut m.model.link_parameters }),
    V::part("", &Part { table: STATES, lens: |m| &mut m.model.state }),
];
