//! The model `PmsmDrive`: plant and controller in one closed-loop block, for drive-train models with steps of 1 ms or
//! more.
//!
//! It combines [`PmsmPlant`] and [`SensorlessController`], which exchange values at every sample instant. With a
//! communication step that is a multiple of T_s, it gives the results of the pair bit for bit. With any other step, plant and
//! controller also stop at the sample instants in between, which an importer's exchange cannot do.
//!
//! In Model Exchange, the importer integrates the plant's states. At every sample instant, an event passes the voltages
//! of the last sample to the plant and the plant's currents to the controller, in the order of [`Pair::step`]. Means over
//! T_s are the same in both interfaces ([`Means`]).

mod begin;
mod exchange;
mod inputs;
mod period;
mod slip;
#[cfg(test)]
mod tests;

pub use inputs::DriveInputs;
pub(crate) use inputs::INPUTS;
pub use period::Means;

use crate::apart;
use crate::backward::Backward;
use crate::beginning::{BEGINNING, BeginningParameters};
use crate::dc_link::ripple::ripple;
use crate::dc_link::{LINK, LINK_OUTPUTS, Link, LinkOutputs, LinkParameters};
use crate::derating::{DERATING, Derating};
use crate::happened::Happened;
use crate::idle;
use crate::pair::Pair;
use crate::rules::{known_carrier, same_pole_pairs};
use crate::steady::{Steady, check_saturation};
use crate::torque::{Calibration, TORQUE, TorqueAt, TorqueParameters};
use drive_base::connection::Commanded;
use drive_base::frame::Phases;
use drive_base::overmodulation::ModulationMode;
use drive_control::commissioning::IDENTIFIED;
#[cfg(doc)]
use drive_control::model::SensorlessController;
use drive_control::signals::ControllerOutputs;
use drive_control::start::StartState;
use drive_control::tables::{self as control, ESTIMATES, STATUS, VOLTAGES};
#[cfg(doc)]
use drive_plant::PmsmPlant;
use drive_plant::following::Following;
use drive_plant::signals::{PlantInputs, PlantOutputs};
use drive_plant::tables as plant;
use fmu_core::log::Warnings;
use fmu_core::unit::AMPERE;
use fmu_core::{
    Block, Elapsed, Experiment, Fault, Info, Interface, Model, Part, Row, SampleGrid, Sampled, Step, Table, Terminal,
    Warns, table,
};
use period::{MEANS, Period};
use serde::{Deserialize, Serialize};
use slip::Slip;

/// Maximum number of samples in one communication step.
const MAX_SAMPLES: f64 = 1e6;

/// Outputs of plant and controller.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveOutputs {
    /// The plant's.
    pub plant: PlantOutputs,
    /// The controller's.
    pub controller: ControllerOutputs,
    /// Means over the last sample period, in both interfaces.
    pub means: Means,
    /// The DC link's.
    pub link: LinkOutputs,
}

/// A complete sensorless drive.
#[derive(Clone, Default, Serialize, Deserialize)]
pub struct PmsmDrive {
    /// Inputs, constant over a communication step.
    pub inputs: DriveInputs,
    /// Plant and controller with their parameters.
    pub pair: Pair,
    /// Parameters of the DC link.
    pub link_parameters: LinkParameters,
    /// The maximum torque of a hot winding.
    pub derating: Derating,
    /// Where the torques of the interface apply.
    pub torque: TorqueParameters,
    /// The state in which the drive begins.
    pub beginning: BeginningParameters,
    /// The steady state in which the drive should begin was not found.
    unsettled: bool,
    /// It runs only some samples before a start in a steady state, which shows the same dependencies.
    #[serde(skip)]
    short: bool,
    /// Their conversion to torques of the air gap, unless they apply there.
    calibration: Option<Box<Calibration>>,
    /// The DC link.
    link: Link,
    /// Model Exchange: the command that has been active in the plant since the last sample.
    before: Commanded,
    period: Period,
    overload: Happened,
    /// The angle of an imposed shaft beside its speed, over communication steps.
    following: Following,
    /// The estimate beside the rotor, over communication steps.
    slip: Slip,
    /// The shaft against the direction of its reference, over communication steps.
    backward: Backward,
}

/// Load, as a multiple of `tau_max`, above which it is reported.
const FAR: f64 = 2.0;

impl PmsmDrive {
    fn set_inputs(&mut self) {
        let u_dc = self.link_voltage();
        let Self { inputs, pair, link, .. } = self;
        pair.set_inputs(inputs.speed_ref, inputs.tau_load, u_dc);
        let plant = &mut pair.plant.model.inputs;
        (plant.speed_shaft, plant.angle_shaft, plant.thermal) =
            (inputs.speed_shaft, inputs.angle_shaft, inputs.thermal);
        let controller = &mut pair.controller.model.inputs;
        (controller.tau_ref, controller.asc, controller.modes) = (inputs.tau_ref, inputs.asc, inputs.modes);
        // During the precharge no voltage is available for control.
        controller.enable = inputs.enable && !link.precharges;
        controller.sensor_valid = inputs.sensor_valid;
        controller.commission_start = inputs.commission_start;
        if self.derating.used {
            let plant = &pair.plant.model;
            controller.derating = self.derating.share(plant.temperatures(&plant.inputs).winding);
        }
        self.convert_reference();
    }

    /// Converts the torque reference to the air gap.
    #[inline]
    fn convert_reference(&mut self) {
        if let Some(calibration) = &self.calibration {
            calibration.ask(&mut self.pair, (self.inputs.tau_ref, self.inputs.modes));
        }
    }

    /// Converts the controller's limits, which change at its samples.
    #[inline]
    fn convert_limits(&mut self) {
        if let Some(calibration) = &mut self.calibration {
            calibration.take(&self.pair);
        }
    }

    /// `out` with the limits where they apply.
    fn with_limits(&self, out: &mut ControllerOutputs) {
        if let Some(calibration) = &self.calibration {
            [out.tau_min, out.tau_max] = calibration.limits;
        }
    }

    /// Voltage of the DC-link capacitor in V; 0 without the link.
    pub fn link_u(&self) -> f64 {
        self.link.u
    }

    /// Voltage (V) of the source of the DC link.
    fn source(&self, now: Elapsed) -> f64 {
        self.inputs.u_dc * self.link_parameters.dc_link.wave(now.seconds())
    }

    /// Voltage (V) of inverter and controller.
    #[inline]
    fn link_voltage(&self) -> f64 {
        // A solver may try voltages below 0, which the diodes of the inverter prevent.
        if self.link_parameters.dc_link.used { self.link.u.max(0.0) } else { self.inputs.u_dc }
    }

    /// What the plant's modulator does beyond the hexagon.
    #[inline]
    fn modulation(&self) -> ModulationMode {
        self.pair.plant.model.parameters.inverter.pwm.modulation.mode
    }

    /// Ripple current (A, rms) of the capacitor with the `currents` (A) of the machine and the power `p_in` (W).
    fn ripple(&self, currents: Phases, p_in: f64) -> f64 {
        let (inputs, mode) = (&self.pair.plant.model.inputs, self.modulation());
        ripple(inputs.voltage(mode), currents.to_stator(), p_in, inputs.u_dc)
    }

    /// The plant's inputs: the drive's inputs and the controller's voltages.
    fn plant_inputs(&self) -> PlantInputs {
        let DriveInputs { tau_load, speed_shaft, angle_shaft, thermal, .. } = self.inputs;
        let u_dc = self.link_voltage();
        let PlantInputs { u, enable, asc, .. } = self.pair.plant.model.inputs;
        PlantInputs { u, u_dc, tau_load, speed_shaft, angle_shaft, enable, asc, thermal }
    }

    /// Watches the load after a step. A start sequence and a drive at rest have no torque limits; after a flying start, the limits are still
    /// rising.
    fn watch_load(&mut self) {
        let Self { inputs: DriveInputs { tau_load, .. }, pair, overload, .. } = self;
        let ControllerOutputs { tau_max, tau_min, .. } = pair.controller.out;
        let limited = tau_max > 0.0 && tau_min < 0.0 && !pair.controller.model.rises();
        let acts = limited && !pair.plant.model.parameters.mechanics.imposed;
        *overload = overload.followed_by(acts && (*tau_load > FAR * tau_max || *tau_load < FAR * tau_min));
    }

    /// Watches the estimate after a step of `h` (s), at whose end the rotor has the electrical angle `theta_e` (rad) and the `speed`
    /// (rad/s).
    fn watch_estimate(&mut self, h: f64, (theta_e, speed): (f64, f64)) {
        let ControllerOutputs { start_state, enabled, theta_est, speed_est, .. } = self.pair.controller.out;
        let works = enabled && start_state == StartState::Running;
        let controls = works && !self.pair.controller.model.parameters.speed_loop.torque_mode;
        self.backward.update(h, controls, self.inputs.speed_ref, speed);
        if !works {
            self.slip = Slip::default();
            return;
        }
        let faster = f64::from(self.pair.plant.model.parameters.motor.n_p) * (speed_est - speed);
        self.slip.count(h, theta_est - theta_e, faster);
    }
}

impl Model for PmsmDrive {
    type Outputs = DriveOutputs;

    const INFO: Info = Info {
        name: "PmsmDrive",
        description: "Sensorless drive: permanent-magnet synchronous machine, inverter and controller in one",
        experiment: Experiment { stop: 1.0, step: 1e-3, ..Experiment::DEFAULT },
        documentation: crate::documentation::DRIVE,
        ..drive_base::PROJECT
    };

    const TABLE: &'static Table<Block<Self>> = TABLE;

    const TERMINALS: &'static [Terminal] = crate::terminals::DRIVE;

    const ICON: Option<&'static str> = Some(include_str!("../icons/pmsm_drive.svg"));

    const STATE_VERSION: u16 = 36;

    fn idle(&self, name: &str) -> Option<&'static str> {
        let (plant, controller) = (&self.pair.plant.model.parameters, &self.pair.controller.model.parameters);
        let DriveInputs { u_dc, speed_shaft, angle_shaft, .. } = self.inputs;
        idle::of_drive(
            (plant, controller, &self.link_parameters, &self.derating),
            (u_dc, [speed_shaft, angle_shaft]),
            name,
        )
    }

    fn derive(&mut self) {
        self.pair.plant.model.derive();
        self.pair.controller.model.derive();
        let limits = self.calibration.as_ref().map_or([0.0; 2], |calibration| calibration.limits);
        self.calibration = (self.torque.at == TorqueAt::Shaft).then(|| {
            let Pair { plant, controller, .. } = &self.pair;
            let mut drive = Steady::new(plant.model.parameters.clone(), controller.model.parameters.clone());
            drive.derating.clone_from(&self.derating);
            Box::new(Calibration::new(drive, limits))
        });
    }

    fn validate(&self) -> Result<(), Fault> {
        self.pair.plant.model.validate().map_err(|fault| in_part("plant", &fault))?;
        self.pair.controller.model.validate_on(self.inputs.u_dc).map_err(|fault| in_part("controller", &fault))?;
        let (plant, controller) = (&self.pair.plant.model.parameters, &self.pair.controller.model.parameters);
        same_pole_pairs(plant, controller)?;
        known_carrier(plant, controller)?;
        check_saturation(plant, controller).map_err(|fault| in_part("plant", &fault))?;
        self.derating.validate()?;
        let starts = self.pair.controller.model.samples() == 0;
        self.link_parameters.validate(if starts { self.inputs.u_dc } else { 0.0 })?;
        if starts { self.validate_beginning() } else { Ok(()) }
    }

    fn validate_for(&self, interface: Interface) -> Result<(), Fault> {
        self.pair.plant.model.validate_for(interface).map_err(|fault| in_part("plant", &fault))?;
        self.pair.controller.model.validate_for(interface).map_err(|fault| in_part("controller", &fault))
    }

    fn initialize(&mut self) {
        self.link = Link::new(&self.link_parameters, self.inputs.u_dc);
        if self.begins_steadily() && self.link_parameters.dc_link.used {
            self.link.charge(self.inputs.u_dc);
        }
        self.set_inputs();
        self.pair.initialize();
        self.convert_reference();
        self.convert_limits();
        self.period = Period::new(self.pair.plant.out.powers);
        self.overload = Happened::default();
        self.following = Following::default();
        (self.slip, self.backward) = (Slip::default(), Backward::default());
        self.before = self.pair.plant.model.inputs.commanded();
        self.unsettled = self.begins_steadily() && !self.begin_steady();
        self.convert_limits();
    }

    fn shorten(&mut self) {
        self.short = true;
    }

    fn output(&self, _now: Elapsed, out: &mut DriveOutputs) {
        let (Block { model, out: plant }, powers) = (&self.pair.plant, self.period.last);
        out.plant = plant.with(powers, model.heat(&model.inputs, &plant.temperatures, &powers.losses));
        out.controller.clone_from(&self.pair.controller.out);
        self.with_limits(&mut out.controller);
        out.means = self.period.means();
        out.link = if self.link_parameters.dc_link.used {
            LinkOutputs {
                i_rms: self.ripple(out.plant.i, powers.p_in),
                ..self.link.reached(&self.link_parameters, self.inputs.u_dc)
            }
        } else {
            LinkOutputs { u: self.link.u, i_source: powers.i_dc, ..LinkOutputs::default() }
        };
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        self.set_inputs();
        self.link.begin(step.h);
        if self.pair.plant.model.parameters.mechanics.imposed {
            let DriveInputs { speed_shaft, angle_shaft, .. } = self.inputs;
            self.following.count(speed_shaft * step.h, angle_shaft - self.pair.plant.out.angle);
        }
        let Self { inputs, pair, period, link, link_parameters, calibration, .. } = self;
        let linked = link_parameters.dc_link.used;
        let grid = SampleGrid { period: pair.controller.model.parameters.T_s };
        let end = step.end();
        if step.h > MAX_SAMPLES * grid.period {
            let longest = format!("at most {} s at this T_s", MAX_SAMPLES * grid.period);
            return Err(Fault::value("the step size", format!("{} s", step.h), longest));
        }
        pair.now = step.start;
        let mut outputs_are_present = true;
        let mut at_sample = false;
        loop {
            let left = end.since(pair.now);
            if left <= grid.width() {
                break;
            }
            let next = if at_sample { grid.period } else { to_next_sample(grid, pair.now) };
            let before = pair.now;
            // An imposed shaft turns at constant speed over all samples of the step.
            pair.plant.model.inputs.angle_shaft = inputs.angle_shaft + inputs.speed_shaft * before.since(step.start);
            let ends = next <= left + grid.width();
            let h = if ends { next } else { left };
            let (h, ends) = if linked {
                let longest = link.longest(link_parameters, h, grid.period, pair.plant.model.powers().i_dc);
                (longest, ends && longest >= h)
            } else {
                (h, ends)
            };
            // Between the samples of a step, the outputs are not read.
            if std::mem::take(&mut outputs_are_present) {
                pair.exchange();
            } else {
                pair.exchange_present();
            }
            if let Some(calibration) = calibration {
                calibration.ask(pair, (inputs.tau_ref, inputs.modes));
            }
            pair.advance(h)?;
            at_sample = ends;
            if let Some(calibration) = calibration
                && ends
            {
                calibration.take(pair);
            }
            period.add(pair.plant.model.powers(), h, ends);
            if linked {
                supply(link, link_parameters, inputs, pair, (h, ends));
            }
            if pair.now == before {
                return Err(Fault::new(format!(
                    "{} s after the start, T_s is below the resolution of time",
                    before.seconds()
                )));
            }
        }
        pair.output();
        self.watch_load();
        self.watch_estimate(step.h, (self.pair.plant.out.theta_e, self.pair.plant.out.speed));
        Ok(())
    }
}

/// Supplies the `pair` from the `link` over an interval of `h` (s), at whose end a sample period may end.
#[inline(never)]
fn supply(link: &mut Link, par: &LinkParameters, inputs: &DriveInputs, pair: &mut Pair, (h, ends): (f64, bool)) {
    link.advance(par, inputs.u_dc, (pair.now.seconds() - h, h), pair.plant.model.powers().p_in * h);
    if ends {
        link.sample(inputs.u_dc);
    }
    pair.supply(link.u, inputs.enable && !link.precharges);
}

pub(crate) fn in_part(part: &str, fault: &Fault) -> Fault {
    Fault::new(format!("{part}.{fault}"))
}

/// Back EMF, as a multiple of the DC-link voltage, above which the drive cannot control the speed of the shaft.
const DRIVEN: f64 = 3.0;

impl Warns for PmsmDrive {
    fn warn(&self, log: &mut Warnings<'_>) {
        let (plant, u_dc, lock_lost) = (&self.pair.plant.model, self.inputs.u_dc, self.pair.controller.out.lock_lost);
        let (speed, emf) = plant.speed_and_emf();
        if lock_lost >= 1.0 && emf > DRIVEN * u_dc {
            let remedy = if plant.parameters.mechanics.imposed { "" } else { " or use plant.mechanics.imposed" };
            return log.warn("driven", || {
                format!(
                    "lock_lost = {lock_lost:.2}: at {speed} rad/s the back EMF is {emf:.0} V line to line, and u_dc = {u_dc} V \
                     cannot hold the shaft: its load drives it, or the coupling is unstable; shorten the communication step{remedy}"
                )
            });
        }
        if self.unsettled && self.pair.now.seconds() <= 1.0 {
            log.warn("initial.steady", || self.unsettled_message());
        }
        if self.pair.now.seconds() <= 1.0 {
            let controller = &self.pair.controller.model.parameters;
            let messages = [
                ("T_pwm", self.pair.skips_commands()),
                ("i_zero", self.pair.wrong_zone()),
                ("apart", apart::message(&plant.parameters, controller)),
                ("devices", apart::drops(&plant.parameters.inverter.devices, controller.limit.i, u_dc)),
            ];
            for (key, message) in messages {
                if let Some(message) = message {
                    log.warn(key, || message.clone());
                }
            }
        }
        plant.warn(log);
        self.derating.warn(log);
        self.backward.warn(self.inputs.speed_ref, speed, log);
        self.following.warn(self.inputs.angle_shaft, self.inputs.speed_shaft, log);
        if lock_lost < 1.0 && self.slip.is_lost() {
            let speed_est = self.pair.controller.out.speed_est;
            log.warn("slip", || {
                format!(
                    "the estimate has lost the rotor, and lock_lost = {lock_lost:.2} does not show it: the shaft turns at {speed:.1} rad/s, \
                     and speed_est = {speed_est:.1} rad/s; the controller's data or bandwidths do not fit the plant, its inverter, temperature \
                     or load"
                )
            });
        }
        let controller = &self.pair.controller.model;
        match &self.calibration {
            Some(calibration) => controller.warn_with(log, self.inputs.tau_ref, calibration.limits),
            None => controller.warn(log),
        }
        if self.overload == Happened::Now {
            let ControllerOutputs { tau_max, tau_min, .. } = self.pair.controller.out;
            let tau_load = self.inputs.tau_load;
            log.warn("tau_load", || {
                format!(
                    "tau_load = {tau_load} N.m is more than {FAR} times the torque of the drive, {tau_min} to {tau_max} N.m \
                     (tau_min, tau_max): the load turns the shaft; lower it, check its unit, or raise controller.limit.i, \
                     controller.limit.i_q and controller.limit.tau"
                )
            });
        }
    }
}

/// Time in s from `now` to the next sample instant: exactly one period if `now` is a sample instant, because the pair at T_s
/// makes only steps of T_s.
fn to_next_sample(grid: SampleGrid, now: Elapsed) -> f64 {
    let k = grid.first_after(now);
    if k > 0 && !grid.passed(k - 1, now) { grid.period } else { -now.minus_periods(k, grid.period) }
}

type V = Row<Block<PmsmDrive>>;

const TABLE: &Table<Block<PmsmDrive>> = table![
    V::part("", &Part { table: INPUTS, lens: |m| &mut m.model.inputs }),
    V::part("", &Part { table: OUTPUTS, lens: |m| &mut m.out }),
    V::part("", &Part { table: IDENTIFIED, lens: |m| m.model.pair.controller.model.commissioning_mut() }),
    V::part("", &Part { table: plant::FLUX, lens: |m| m.model.pair.plant.model.flux_mut() }),
    V::part("plant.", &Part { table: plant::PARAMETERS, lens: |m| &mut m.model.pair.plant.model.parameters }),
    V::part(
        "controller.",
        &Part { table: control::PARAMETERS, lens: |m| &mut m.model.pair.controller.model.parameters },
    ),
    V::part("", &Part { table: LINK, lens: |m| &mut m.model.link_parameters }),
    V::part("", &Part { table: TORQUE, lens: |m| &mut m.model.torque }),
    V::part("", &Part { table: DERATING, lens: |m| &mut m.model.derating }),
    V::part("", &Part { table: BEGINNING, lens: |m| &mut m.model.beginning }),
];

type D = Row<DriveOutputs>;

/// The outputs, of `PmsmDrive` and of `PmsmDriveMean`.
pub(crate) const OUTPUTS: &Table<DriveOutputs> = table![
    D::part("", &Part { table: plant::OUTPUTS, lens: |o| &mut o.plant }),
    D::part("", &Part { table: MEANS, lens: |o| &mut o.means }),
    D::part("", &Part { table: LINK_OUTPUTS, lens: |o| &mut o.link }),
    D::part("", &Part { table: CONTROLLER_OUTPUTS, lens: |o| &mut o.controller }),
];

type O = Row<ControllerOutputs>;

/// The controller's outputs, renamed so that `i_d` and `i_q` remain the plant's.
const CONTROLLER_OUTPUTS: &Table<ControllerOutputs> = table![
    O::part("", &Part { table: ESTIMATES, lens: |o| o }),
    O::discrete_output("i_d_est", &AMPERE, "d-axis stator current in the estimated rotor frame", |o| { &mut o.i.d }),
    O::discrete_output("i_q_est", &AMPERE, "q-axis stator current in the estimated rotor frame", |o| { &mut o.i.q }),
    O::discrete_output("i_d_ref", &AMPERE, "Reference of i_d_est", |o| &mut o.i_ref.d),
    O::discrete_output("i_q_ref", &AMPERE, "Reference of i_q_est", |o| &mut o.i_ref.q),
    O::part("", &Part { table: VOLTAGES, lens: |o| o }),
    O::part("", &Part { table: STATUS, lens: |o| o }),
];
