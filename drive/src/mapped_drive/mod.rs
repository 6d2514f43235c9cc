//! The model `MappedDrive`: the drive that a data sheet describes, by its [tables](map).
//!
//! It has the terminals of [`PmsmDriveMean`](crate::PmsmDriveMean), and its variables as far as they exist without a machine
//! behind them, under the same names. As there, only the torque has dynamics; x is the torque at the shaft:
//!
//! ```text
//! t_lag dx/dt = min(max(t, tau_min), tau_max) - x,  t_lag = 1 / current.bandwidth       p_in = x w + p_loss(w, x, u_dc)
//! J d speed/dt = x - tau_load, or with mechanics.imposed speed_shaft
//! ```
//!
//! The limits are an envelope over the speed, the peak torque, and the losses a table: Simscape's system-level block of motor and
//! drive has both. With `map.t_overload`, the peak torque is available until the overload theta reaches 1, and then falls to the
//! continuous torque:
//!
//! ```text
//! T d theta/dt = (x / tau_continuous)^2 - theta      tau_max = tau_continuous + min(1, (1 - theta) / 0.05) (tau_peak - tau_continuous)
//! ```
//!
//! With the gates off (`enable` false, or u_dc outside `map.u_min` ... `map.u_max`), the only torque is the drag torque, which
//! the shaft supplies.

mod exchange;
pub mod map;
mod motion;
mod show;
mod state;

pub use state::{MappedDrive, MappedInputs, MappedOutputs, MappedShaft};

use crate::happened::Happened;
use crate::speed_watch::{SpeedWatch, Watched};
use drive_base::math::all_finite;
use drive_control::idle::NO_VOLTAGE;
use drive_control::model::clipped;
use drive_control::overload::Overload;
use drive_control::speed;
use drive_control::speed::SPEED_LOOP;
use drive_plant::power::{ENERGY, Energy};
use fmu_core::idle::{Acts, why};
use fmu_core::log::Warnings;
use fmu_core::unit::{AMPERE, KELVIN, KG_M2, NEWTON_METER, ONE, RAD_PER_S, RADIAN, SPEED, VOLT, WATT};
use fmu_core::{Block, Elapsed, Experiment, Fault, Info, Model, Part, Row, Step, Table, Terminal, Warns, table};
use map::{MAP, Map};
use motion::Passed;
use state::State;

/// When parameters and inputs act.
const ACTS: &[Acts<MappedDrive>] = &[
    Acts {
        names: &[
            "enable",
            "map.u_dc",
            "map.u_min",
            "map.u_max",
            "map.speed",
            "map.tau_motor",
            "map.tau_generator",
            "map.tau_continuous",
            "map.tau_drag",
            "map.p_loss",
            "map.t_overload",
            "controller.current.bandwidth",
            "controller.speed_loop.torque_mode",
            "plant.mechanics.imposed",
        ],
        when: |_| true,
        why: "",
    },
    Acts { names: &["u_dc"], when: |m| m.inputs.u_dc > 0.0, why: NO_VOLTAGE },
    Acts {
        names: &["T_coolant"],
        when: |_| false,
        why: "no effect in MappedDrive: its tables hold at one temperature",
    },
    Acts { names: &["tau_ref"], when: |m| m.speed_loop.torque_mode, why: "no effect without speed_loop.torque_mode" },
    Acts {
        names: &[
            "speed_ref",
            "controller.speed_loop.bandwidth",
            "controller.speed_loop.t_is",
            "controller.speed_loop.b",
            "controller.speed_loop.ramp",
        ],
        when: |m| !m.speed_loop.torque_mode,
        why: "no effect with speed_loop.torque_mode",
    },
    Acts {
        names: &["tau_load", "plant.initial.speed"],
        when: |m| !m.shaft.imposed,
        why: "no effect with mechanics.imposed",
    },
    // With an imposed shaft, the inertia sets the gains of the speed loop.
    Acts {
        names: &["plant.mechanics.J"],
        when: |m| !m.shaft.imposed || !m.speed_loop.torque_mode,
        why: "no effect with mechanics.imposed and speed_loop.torque_mode",
    },
    Acts {
        names: &["speed_shaft", "angle_shaft"],
        when: |m| m.shaft.imposed,
        why: "no effect without mechanics.imposed",
    },
];

impl Model for MappedDrive {
    type Outputs = MappedOutputs;

    const INFO: Info = Info {
        name: "MappedDrive",
        description: "The drive of a data sheet for system models: torque over speed and a table of losses, with steps of 10 ms and more",
        experiment: Experiment { stop: 1.0, step: 1e-2, ..Experiment::DEFAULT },
        documentation: crate::documentation::MAPPED,
        ..drive_base::PROJECT
    };

    const TABLE: &'static Table<Block<Self>> = TABLE;

    const TERMINALS: &'static [Terminal] = crate::terminals::MAPPED;

    const ICON: Option<&'static str> = Some(include_str!("../../icons/pmsm_drive.svg"));

    const STATE_VERSION: u16 = 6;

    const CONTINUOUS: bool = true;

    fn idle(&self, name: &str) -> Option<&'static str> {
        why(ACTS, self, name.split('[').next().unwrap_or(name))
    }

    fn validate(&self) -> Result<(), Fault> {
        self.map.validate()
    }

    fn initialize(&mut self) {
        let (speed, angle) = if self.shaft.imposed {
            (self.inputs.speed_shaft, self.inputs.angle_shaft)
        } else {
            (self.shaft.speed, 0.0)
        };
        self.state = State { speed, angle, speed_ref: speed, ..State::default() };
        (self.energy, self.active) = (Energy::default(), self.is_active());
        self.last = self.instant(&self.state, &self.point(&self.state));
        (self.first, self.overspeed, self.off_voltage, self.far_voltage) = Default::default();
        self.clipped_for = 0.0;
        self.watch = SpeedWatch::default();
    }

    fn output(&self, _now: Elapsed, out: &mut MappedOutputs) {
        self.show(&self.state, &self.last, out);
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        self.take_up();
        let Passed { state, energy } = self.pass(step.h)?;
        if !all_finite([state.tau, state.integral, state.speed, state.angle, energy.r#in, energy.loss]) {
            return Err(Fault::new(format!("the drive's state is no longer finite after a step of {} s", step.h)));
        }
        self.energy.add(&energy);
        let point = self.point(&state);
        let speeds = [&self.state, &state].map(|state| self.speed(state));
        let controls = self.is_active() && !self.speed_loop.torque_mode;
        let limited = controls && Overload::limited(state.tau, point.limits, state.speed_ref - speeds[1]);
        let (imposed, tau_load, speed_ref) = (self.shaft.imposed, self.inputs.tau_load, state.speed_ref);
        self.watch.update(step.h, &Watched { controls, imposed, limited, speed_ref, tau_load, speeds });
        self.state = state;
        self.last = self.instant(&state, &point);
        self.overspeed = self.overspeed.followed_by(self.speed(&state).abs() > self.map.last());
        let off = self.inputs.enable && self.inputs.u_dc > 0.0 && !self.has_voltage();
        self.off_voltage = self.off_voltage.followed_by(off);
        self.far_voltage = self.far_voltage.followed_by(self.is_active() && self.inputs.u_dc > FAR * self.map.u_dc);
        self.first = self.first.followed_by(true);
        let [low, high] = point.limits;
        let (tau_ref, asked) = (self.inputs.tau_ref, self.speed_loop.torque_mode && self.is_active());
        self.clipped_for = if asked && (tau_ref > high || tau_ref < low) { self.clipped_for + step.h } else { 0.0 };
        Ok(())
    }
}

/// Multiple of `map.u_dc` beyond which the tables are of no use.
const FAR: f64 = 3.0;

impl Warns for MappedDrive {
    fn warn(&self, log: &mut Warnings<'_>) {
        let (speed, last, u_dc) = (self.speed(&self.state), self.map.last(), self.inputs.u_dc);
        if self.overspeed == Happened::Now {
            log.warn("speed", || {
                format!("{speed} rad/s is beyond the last of map.speed, {last} rad/s: there is no torque, and the losses are those of the last speed")
            });
        }
        if self.off_voltage == Happened::Now {
            let Map { u_min, u_max, .. } = self.map;
            log.warn("u_dc", || {
                format!("u_dc = {u_dc} V is outside {u_min} to {u_max} V (map.u_min, map.u_max): the drive is off")
            });
        }
        let bandwidths = [self.bandwidth, self.speed_loop.bandwidth];
        self.watch.warn([speed, self.state.speed_ref], bandwidths, || self.point(&self.state).limits, log);
        if self.first == Happened::Now {
            let order = speed::order(bandwidths).filter(|_| !self.speed_loop.torque_mode && !self.shaft.imposed);
            for (key, message) in [("map.p_loss", self.map.doubt()), ("bandwidth", order)] {
                if let Some(message) = message {
                    log.warn(key, || message.clone());
                }
            }
        }
        if self.far_voltage == Happened::Now {
            let of_tables = self.map.u_dc;
            log.warn("map.u_dc", || {
                format!(
                    "u_dc = {u_dc} V is more than {FAR} times map.u_dc = {of_tables} V: the tables do not describe the drive there; check \
                     that both are in V"
                )
            });
        }
        if self.clipped_for >= 1.0 {
            log.warn("tau_ref", || clipped(self.inputs.tau_ref, self.point(&self.state).limits));
        }
    }
}

type I = Row<MappedInputs>;

const INPUTS: &Table<MappedInputs> = table![
    I::input("speed_ref", &SPEED, "Mechanical speed reference", |i| &mut i.speed_ref),
    I::input("tau_ref", &NEWTON_METER, "Torque reference at the shaft", |i| &mut i.tau_ref)
        .read_with("speed_loop.torque_mode", "true"),
    I::boolean_input("enable", "The drive operates; false: the gates are off", |i| &mut i.enable).optional(),
    I::input("u_dc", &VOLT, "DC-link voltage", |i| &mut i.u_dc).at_least(0.0),
    I::input("tau_load", &NEWTON_METER, "Load torque at the shaft, positive against positive speed", |i| {
        &mut i.tau_load
    }),
    I::input("speed_shaft", &SPEED, "Mechanical speed of the shaft", |i| &mut i.speed_shaft)
        .read_with("mechanics.imposed", "true"),
    I::input("angle_shaft", &RADIAN, "Mechanical angle of the shaft", |i| &mut i.angle_shaft)
        .unbounded()
        .read_with("mechanics.imposed", "true"),
    I::input("T_coolant", &KELVIN, "Temperature of the coolant, without effect on the tables", |i| &mut i.T_coolant)
        .at_least(0.0)
        .nominal(300.0)
        .optional(),
];

type O = Row<MappedOutputs>;

const OUTPUTS: &Table<MappedOutputs> = table![
    O::output("speed", &SPEED, "Mechanical rotor speed", |o| &mut o.speed).nominal(100.0),
    O::output("angle", &RADIAN, "Mechanical rotor angle, not wrapped", |o| &mut o.angle).unbounded().nominal(1.0),
    O::output("tau_shaft", &NEWTON_METER, "Torque of the shaft on the load at the end of the step", |o| &mut o
        .tau_shaft,),
    O::output("i_dc", &AMPERE, "Current from the DC link at the end of the step", |o| &mut o.i_dc,),
    O::output("p_in", &WATT, "Power from the DC link, u_dc i_dc at the end of the step", |o| &mut o.p_in,),
    O::output("p_mech", &WATT, "Power delivered to the load at the shaft at the end of the step", |o| &mut o.p_mech,),
    O::output("p_loss", &WATT, "Losses of motor and inverter at the end of the step", |o| &mut o.p_loss,),
    O::output(
        "efficiency",
        &ONE,
        "p_mech / p_in of a motor, p_in / p_mech of a generator, else 0; of these powers",
        |o| &mut o.efficiency,
    ),
    O::part("energy_", &Part { table: ENERGY, lens: |o| &mut o.energy }),
    O::output("Q_coolant", &WATT, "Heat to the coolant, out of the FMU: all losses", |o| &mut o.Q_coolant),
    O::output("tau_max", &NEWTON_METER, "Maximum torque at the shaft at this speed, voltage and overload", |o| {
        &mut o.tau_max
    }),
    O::output("tau_min", &NEWTON_METER, "Minimum torque at the shaft at this speed, voltage and overload", |o| {
        &mut o.tau_min
    }),
    O::output(
        "overload",
        &ONE,
        "Square of the torque relative to the continuous torque, over map.t_overload; at 1 the limit is the continuous torque",
        |o| &mut o.overload,
    ),
    O::boolean_output("enabled", "The drive operates: enable is true, and u_dc within map.u_min and map.u_max", |o| {
        &mut o.enabled
    }),
];

type S = Row<State>;

const STATES: &Table<State> = table![
    S::state("tau_lag", &NEWTON_METER, "Torque at the shaft, which follows its reference", |s| &mut s.tau),
    S::state("speed_loop_integral", &NEWTON_METER, "Integral part of the speed loop", |s| &mut s.integral),
    S::state("speed_ref_ramp", &SPEED, "Speed reference on its ramp", |s| &mut s.speed_ref).nominal(100.0),
];

type V = Row<Block<MappedDrive>>;

const TABLE: &Table<Block<MappedDrive>> = table![
    V::part("", &Part { table: INPUTS, lens: |m| &mut m.model.inputs }),
    V::part("", &Part { table: OUTPUTS, lens: |m| &mut m.out }),
    V::part("map.", &Part { table: MAP, lens: |m| &mut m.model.map }),
    V::parameter(
        "plant.mechanics.J",
        &KG_M2,
        "Moment of inertia of the rotor, and of a load that turns with it",
        |m| &mut m.model.shaft.J
    )
    .above(0.0),
    V::boolean_parameter(
        "plant.mechanics.imposed",
        "The drive train imposes speed_shaft and angle_shaft, receives tau_shaft and includes the inertia; false: the shaft turns \
         freely under tau_load",
        |m| &mut m.model.shaft.imposed,
    ),
    V::parameter("plant.initial.speed", &SPEED, "Initial speed of a free shaft", |m| &mut m.model.shaft.speed),
    V::parameter(
        "controller.current.bandwidth",
        &RAD_PER_S,
        "Bandwidth of the torque, the reciprocal of its time constant",
        |m| &mut m.model.bandwidth,
    )
    .above(0.0),
    V::part("controller.speed_loop.", &Part { table: SPEED_LOOP, lens: |m| &mut m.model.speed_loop }),
    V::part("", &Part { table: STATES, lens: |m| &mut m.model.state }),
];

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_core::idle::unstated;

    #[test]
    fn no_variable_is_forgotten() {
        let missing = unstated(ACTS, TABLE);
        assert!(missing.is_empty(), "{missing:?} must be in ACTS once");
    }
}
