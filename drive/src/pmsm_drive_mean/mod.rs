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
//! With the gates off, the diodes block or [rectify](drive_plant::rectifier): `enable` = false or a trip. A current that flows through
//! them continues to flow, so the past decides where both are possible. With `asc` or a trip with `trip.asc` the machine is
//! short-circuited.
//!
//! There is no estimator, start, sensor error or injection, no oscillation of the current loop and no capacitor of the DC link: their
//! parameters are accepted, and [`Model::has_effect`] names those with an effect. In Model Exchange the importer integrates the
//! same equations.
//!
//! [`advance`]: Model::advance

mod begin;
mod bridge;
mod exchange;
mod follow;
mod motion;
mod show;
mod supply;

use crate::apart;
use crate::beginning::{BEGINNING, BeginningParameters};
use crate::dc_link::{LINK, LinkEnergy, LinkParameters};
use crate::derating::DERATING;
use crate::happened::Happened;
use crate::idle;
use crate::pmsm_drive::{DriveInputs, DriveOutputs, INPUTS, OUTPUTS, in_part};
use crate::rules::same_pole_pairs;
use crate::speed_watch::{SpeedWatch, Watched};
use crate::steady::{At, Condition, Diodes, Point, Steady, check_saturation};
use crate::torque::{TORQUE, TorqueAt, TorqueParameters};
use drive_base::frame::Dq;
use drive_base::math::all_finite;
use drive_control::commissioning::{Held, IDENTIFIED};
use drive_control::model::clipped;
use drive_control::modes::Follows;
use drive_control::overload::Overload;
use drive_control::signals::ControllerOutputs;
use drive_control::speed;
use drive_control::tables::{self as control, ControllerParameters};
use drive_control::trip::{Cause, Trip};
use drive_plant::PmsmPlant;
use drive_plant::inverter::Gates;
use drive_plant::machine::Magnetics;
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
    /// Parameters of the DC link.
    pub link_parameters: LinkParameters,
    /// Where the torques of the interface apply.
    pub torque: TorqueParameters,
    /// The state in which the drive begins.
    pub beginning: BeginningParameters,
    state: State,
    /// Energies in J.
    energy: Energy,
    /// Energies of the DC link in J.
    link_energy: LinkEnergy,
    /// Temperatures in K of the network.
    network: Temperatures,
    /// The point at the end of the last step, the question that it answers, and whether it is still valid: a changed parameter
    /// invalidates it.
    point: Point,
    asked: Question,
    known: bool,
    /// What has tripped, and whether it short-circuits the machine.
    trip: Trip,
    /// The diodes at the end of the last step.
    diodes: Diodes,
    /// What the loops have followed.
    follows: Follows,
    /// Whether the gates have switched.
    gates_on: bool,
    /// Whether a step was taken.
    moved: bool,
    /// Model Exchange: outputs of the controller since the last event.
    held: ControllerOutputs,
    /// The first step, after which the data are compared.
    first: Happened,
    /// Whether the source cannot supply the power, or the loop cannot hold the current.
    impossible: Happened,
    /// Time in s for which the torque reference has exceeded its limits.
    clipped_for: f64,
    /// Whether the speed comes to its reference.
    watch: SpeedWatch,
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
            torque: TorqueParameters::default(),
            beginning: BeginningParameters::default(),
            state: State::default(),
            energy: Energy::default(),
            link_energy: LinkEnergy::default(),
            network,
            point: Point::default(),
            asked: Question::default(),
            known: false,
            trip: Trip::default(),
            diodes: Diodes::default(),
            follows: Follows::default(),
            gates_on: false,
            moved: false,
            held: ControllerOutputs::default(),
            first: Happened::default(),
            impossible: Happened::default(),
            clipped_for: 0.0,
            watch: SpeedWatch::default(),
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

/// Inputs of a point: the condition, the torque in N.m, and the gates.
type Question = (Condition, f64, Gates);

/// Outputs: as in `PmsmDrive`, plus the flux linkage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeanOutputs {
    /// Outputs of plant and controller.
    pub drive: DriveOutputs,
    /// Flux linkage in Wb.
    pub psi: Dq,
}

/// Share of `limit.i` above which the current is not held.
const HELD: f64 = 1.001;

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
        (self.condition(state, at), state.tau, self.bridge())
    }

    /// The point in this state at the temperatures `at` (K); the point at the end of the last step is cached.
    fn point_at(&self, state: &State, at: Temperatures) -> Point {
        if self.known && self.question(state, at) == self.asked {
            return self.point;
        }
        if self.linked() {
            return self.supplied(state, at);
        }
        self.point_of(&self.under(&self.condition(state, at)), (state.tau, self.diodes))
    }

    /// The powers of a point at the mechanical `speed` (rad/s); the torque of a free shaft equals the load.
    fn powers_of(&self, point: &Point, speed: f64) -> Powers {
        if self.drive.plant.mechanics.imposed {
            return point.powers;
        }
        Powers { tau_shaft: self.inputs.tau_load, p_mech: self.inputs.tau_load * speed, ..point.powers }
    }

    /// The drive in this state at its `point`.
    fn at(&self, state: &State, point: &Point) -> At<'_> {
        let condition = self.condition(state, self.temperatures());
        self.under(&Condition { u_dc: self.voltage(point.powers.p_in), ..condition })
    }

    /// Whether the torques of the interface apply at the shaft.
    fn at_shaft(&self) -> bool {
        self.torque.at == TorqueAt::Shaft
    }

    /// The torque reference (N.m) of the air gap under this condition.
    fn reference(&self, at: &At<'_>) -> f64 {
        let tau_ref = self.tau_ref();
        if self.at_shaft() && self.follows == Follows::Reference { at.reference_for(tau_ref) } else { tau_ref }
    }

    /// The limits (N.m) of a point in this state where the torques of the interface apply.
    fn limits(&self, state: &State, point: &Point) -> [f64; 2] {
        let limits = self.narrowed(state, point);
        if self.at_shaft() && self.gates() { self.at(state, point).at_shaft(limits) } else { limits }
    }

    /// Whether the torque reference exceeds its limits.
    fn is_clipped(&self) -> bool {
        let (tau_ref, [low, high]) = (self.inputs.tau_ref, self.limits(&self.state, &self.point));
        let ControllerParameters { speed_loop, modes, .. } = &self.drive.controller;
        let follows =
            speed_loop.torque_mode && self.follows == Follows::Reference && modes.allows(&self.inputs.modes, tau_ref);
        follows && self.inputs.enable && (tau_ref > high || tau_ref < low)
    }

    /// What the watch of the speed needs after a step to `state`.
    fn watched(&self, state: &State, point: &Point) -> Watched {
        let speeds = [&self.state, state].map(|state| self.speed(state));
        let controls = self.gates() && !self.torque_mode();
        let error = state.speed_ref - speeds[1];
        Watched {
            controls,
            imposed: self.drive.plant.mechanics.imposed,
            limited: controls && Overload::limited(state.tau, self.narrowed(state, point), error),
            speed_ref: state.speed_ref,
            tau_load: self.inputs.tau_load,
            speeds,
        }
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
const ONLY_IN_THE_DRIVE: &str = "no effect in PmsmDriveMean, which has no capacitor, no estimator, start, sensor, \
                                 trip by the current or commissioning; use PmsmDrive";

/// Parameters and groups of parameters of the controller with an effect.
const EFFECTIVE: [&str; 20] = [
    "T_s",
    "estimator",
    "motor.",
    "mechanics.J",
    "initial.speed_est",
    "limit.",
    "brake.",
    "trip.use",
    "trip.u_dc",
    "trip.u_dc_min",
    "trip.u_dc_restart",
    "trip.asc",
    "speed_loop.",
    "current.bandwidth",
    "current.mtpa",
    "zero_speed.",
    "weakening.use",
    "weakening.k_",
    "weakening.bandwidth",
    "modulation.mode",
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

    const STATE_VERSION: u16 = 14;

    const CONTINUOUS: bool = true;

    fn has_effect(parameter: &str) -> bool {
        if let Some(name) = parameter.strip_prefix("controller.") {
            let listed = |of: &&str| name == *of || (of.ends_with(['.', '_']) && name.starts_with(*of));
            return EFFECTIVE.iter().any(listed);
        }
        let elsewhere = [
            "dead_time",
            "i_zero",
            "mode",
            "update",
            "zero_sequence",
            "pulse_min",
            "carrier_delay",
            "open_switch",
            "open_phase",
        ];
        let elsewhere = parameter.strip_prefix("plant.inverter.").is_some_and(|name| elsewhere.contains(&name));
        !elsewhere && !["dc_link.R_precharge", "plant.modulation.mode"].contains(&parameter)
    }

    fn idle(&self, name: &str) -> Option<&'static str> {
        let C_only_stores = name == "dc_link.C" && !self.link_parameters.dc_link.pulsates();
        if C_only_stores || !Self::has_effect(name) || ["sensor_valid", "commission_start"].contains(&name) {
            return Some(ONLY_IN_THE_DRIVE);
        }
        let Steady { plant, controller, .. } = &self.drive;
        let DriveInputs { u_dc, speed_shaft, angle_shaft, .. } = self.inputs;
        idle::of_drive(
            (plant, controller, &self.link_parameters, &self.drive.derating),
            (u_dc, [speed_shaft, angle_shaft]),
            name,
        )
    }

    fn derive(&mut self) {
        self.drive.derive();
        self.known = false;
    }

    fn validate(&self) -> Result<(), Fault> {
        self.plant().validate().map_err(|fault| in_part("plant", &fault))?;
        let Steady { plant, controller, .. } = &self.drive;
        same_pole_pairs(plant, controller)?;
        check_saturation(plant, controller).map_err(|fault| in_part("plant", &fault))?;
        self.drive.derating.validate()?;
        let u_dc = if self.moved { 0.0 } else { self.inputs.u_dc };
        self.drive.controller.validate_limits(u_dc).map_err(|fault| in_part("controller", &fault))?;
        self.link_parameters.validate(u_dc)?;
        if self.moved { Ok(()) } else { self.validate_beginning() }
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
        (self.clipped_for, self.first, self.impossible) = (0.0, Happened::default(), Happened::default());
        self.link_energy = LinkEnergy::default();
        (self.known, self.point, self.trip) = (false, Point::default(), Trip::default());
        (self.diodes, self.watch) = (Diodes::default(), SpeedWatch::default());
        (self.follows, self.gates_on) = (self.inputs.modes.follows(), self.gates());
        self.begin_steadily();
        let temperatures = self.temperatures();
        self.point = self.point_at(&self.state, temperatures);
        (self.asked, self.known) = (self.question(&self.state, temperatures), true);
        self.settle();
        self.held = self.controller(&self.state, &self.point);
    }

    fn output(&self, _now: Elapsed, out: &mut MeanOutputs) {
        self.show(&self.state, &self.point, self.temperatures(), out);
        out.drive.controller = self.controller(&self.state, &self.point);
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        self.follow();
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
            return Err(self.diverged(step.h, &point));
        }
        let total = Energy::from(powers);
        self.energy.add(&Energy { r#in: total.r#in * step.h, mech: total.mech * step.h, loss: total.loss * step.h });
        self.link_energy.add(&self.link_powers(powers.p_in).times(step.h));
        let watched = self.watched(&state, &point);
        self.watch.update(step.h, &watched);
        (self.state, self.point, self.moved) = (state, point, true);
        (self.asked, self.known) = (self.question(&state, temperatures), true);
        self.impossible = self.impossible.followed_by(self.is_impossible());
        self.first = self.first.followed_by(true);
        self.clipped_for = if self.is_clipped() { self.clipped_for + step.h } else { 0.0 };
        if thermal.mode == ThermalMode::Network {
            let (heat, coolant) = (thermal.heat(&powers.losses), self.inputs.thermal.coolant);
            let next = thermal.network.step(&self.network, &heat, coolant, step.h);
            check_temperatures(&self.drive.plant, &next, ["T_winding", "T_magnet"], REMEDY)?;
            self.network = next;
        }
        self.settle();
        self.watch_voltage(self.voltage(self.point.powers.p_in));
        Ok(())
    }
}

impl PmsmDriveMean {
    /// Refuses a step of `h` (s) that ends at this `point`.
    #[cold]
    fn diverged(&self, h: f64, point: &Point) -> Fault {
        let saturates = matches!(self.drive.plant.magnetics(), Magnetics::Polynomial(_));
        let cause = if point.psi.d().is_nan() && saturates {
            ": no flux linkage gives the current at this speed, because plant.saturation (s_2, s_3, s_dq) describes the machine only up \
             to smaller currents; use coefficients closer to 0, or plant.flux_map"
        } else {
            ""
        };
        Fault::new(format!("the drive's state is no longer finite after a step of {h} s{cause}"))
    }

    /// Whether the source of the link cannot supply the power, or the current loop cannot hold the current, because the EMF exceeds the
    /// voltage of the link.
    fn is_impossible(&self) -> bool {
        self.is_overloaded() || self.gates() && self.point.i.magnitude() > HELD * self.drive.controller.limit.i
    }

    fn is_overloaded(&self) -> bool {
        self.linked() && self.link(self.point.powers.p_in).overloaded
    }
}

impl Warns for PmsmDriveMean {
    fn warn(&self, log: &mut Warnings<'_>) {
        if self.trip.cause != Cause::None {
            log.warn("tripped", || {
                let what = self.trip.cause.what(&self.drive.controller.trip);
                let stopped = if self.trip.shorts { "the machine is short-circuited" } else { "the gates are off" };
                let ends = self.trip.cause.ends(&self.drive.controller.trip);
                format!("{what} beyond its limit: {stopped} until {ends}")
            });
        }
        if self.impossible == Happened::Now {
            let p_in = self.point.powers.p_in;
            if self.is_overloaded() {
                return log.warn("u_cap", || self.link_parameters.lack(self.inputs.u_dc, p_in));
            }
            let (speed, i, limit) = (self.speed(&self.state), self.point.i.magnitude(), self.drive.controller.limit.i);
            let u_dc = self.voltage(p_in);
            log.warn("limit.i", || {
                format!(
                    "the current loop does not hold the current: {i:.1} A exceeds limit.i = {limit} A, because at {speed:.1} rad/s the EMF \
                     exceeds what the link of u_dc = {u_dc:.1} V can oppose; use field weakening, a lower speed or a higher voltage"
                )
            });
        }
        let speeds = [self.speed(&self.state), self.state.speed_ref];
        let controller = &self.drive.controller;
        let bandwidths = [controller.current.bandwidth, controller.speed_loop.bandwidth];
        self.watch.warn(speeds, bandwidths, || self.limits(&self.state, &self.point), log);
        if self.clipped_for >= 1.0 {
            log.warn("tau_ref", || clipped(self.inputs.tau_ref, self.limits(&self.state, &self.point)));
        }
        self.drive.derating.warn(log);
        let plant = &self.drive.plant;
        if self.first == Happened::Now {
            let drops = apart::drops(&plant.inverter.devices, self.drive.controller.limit.i, self.inputs.u_dc);
            let order = speed::order(bandwidths).filter(|_| !self.torque_mode() && !plant.mechanics.imposed);
            let apart = apart::message(plant, &self.drive.controller);
            for (key, message) in [("apart", apart), ("devices", drops), ("bandwidth", order)] {
                if let Some(message) = message {
                    log.warn(key, || message.clone());
                }
            }
        }
        plant.thermal.warn(&self.inputs.thermal, log);
        plant.inverter.warn(log);
        if !plant.is_linear() {
            let motor = plant.thermal.motor(&plant.motor, &self.temperatures());
            plant.magnetics().warn(&motor, self.point.psi, log);
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
    V::part("", &Part { table: TORQUE, lens: |m| &mut m.model.torque }),
    V::part("", &Part { table: DERATING, lens: |m| &mut m.model.drive.derating }),
    V::part("", &Part { table: BEGINNING, lens: |m| &mut m.model.beginning }),
    V::part("", &Part { table: STATES, lens: |m| &mut m.model.state }),
];
