//! The inputs of `PmsmDrive` and `PmsmDriveMean`.

use drive_control::model::TAU_REF;
use drive_control::modes::{MODE_INPUTS, ModeInputs};
use drive_plant::thermal::{THERMAL_INPUTS, ThermalInputs};
use fmu_core::unit::{NEWTON_METER, RADIAN, SPEED, VOLT};
use fmu_core::{Part, Row, Table, table};
use serde::{Deserialize, Serialize};

/// Inputs, constant over a communication step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "each is a variable")]
pub struct DriveInputs {
    /// Mechanical speed reference in rad/s.
    pub speed_ref: f64,
    /// Load torque in N.m, positive against positive speed.
    pub tau_load: f64,
    /// DC-link voltage in V, >= 0, for the inverter and for the controller, which measures it.
    pub u_dc: f64,
    /// Imposed mechanical speed of the shaft in rad/s.
    pub speed_shaft: f64,
    /// Imposed mechanical angle of the shaft in rad, at the beginning of the communication step.
    pub angle_shaft: f64,
    /// Torque reference in N.m, in torque mode.
    pub tau_ref: f64,
    /// The drive operates; false: the controller stays in its initial state and the gates are off.
    pub enable: bool,
    /// Active short circuit.
    pub asc: bool,
    /// The sensor of the shaft works.
    pub sensor_valid: bool,
    /// The self-commissioning runs, unless `controller.commission.mode` is Off.
    pub commission_start: bool,
    /// Brake, coast and the limits of the torque.
    pub modes: ModeInputs,
    /// Temperatures in K.
    pub thermal: ThermalInputs,
}

impl Default for DriveInputs {
    fn default() -> Self {
        Self {
            speed_ref: 0.0,
            tau_load: 0.0,
            u_dc: 325.0,
            speed_shaft: 0.0,
            angle_shaft: 0.0,
            tau_ref: 0.0,
            enable: true,
            asc: false,
            sensor_valid: true,
            commission_start: false,
            modes: ModeInputs::default(),
            thermal: ThermalInputs::default(),
        }
    }
}

type I = Row<DriveInputs>;

/// The inputs, of `PmsmDrive` and of `PmsmDriveMean`.
pub(crate) const INPUTS: &Table<DriveInputs> = table![
            I::input("speed_ref", &SPEED, "Mechanical speed reference", |i| &mut i.speed_ref),
            I::input("tau_ref", &NEWTON_METER, TAU_REF, |i| &mut i.tau_ref)
                .read_with("speed_loop.torque_mode", "true"),
            I::boolean_input(
                "enable",
                "The drive operates; false: the controller stays in its initial state, and the gates are off once enabled is false",
                |i| &mut i.enable,
            )
            .optional(),
            I::boolean_input(
                "asc",
                "Active short circuit, regardless of enable: all upper or all lower transistors conduct once short_circuit is true, and \
                 the controller stays in its initial state",
                |i| &mut i.asc,
            )
            .optional(),
            I::boolean_input(
                "sensor_valid",
                "The sensor of the shaft works; false: controller.sensor.fallback takes over from it, if there is one",
                |i| &mut i.sensor_valid,
            )
            .optional(),
            I::boolean_input(
                "commission_start",
                "A rising edge starts the self-commissioning that controller.commission.mode selects, while the drive is enabled; false \
                 aborts it, and the controller works",
                |i| &mut i.commission_start,
            )
            .optional(),
            I::part("", &Part { table: MODE_INPUTS, lens: |i| &mut i.modes }),
            I::input(
                "u_dc",
                &VOLT,
                "DC-link voltage of inverter and controller; with dc_link.use, voltage of its source, of a rectifier the amplitude",
                |i| &mut i.u_dc,
            )
            .at_least(0.0),
            I::input("tau_load", &NEWTON_METER, "Load torque at the shaft, positive against positive speed", |i| {
                &mut i.tau_load
            }),
            I::input("speed_shaft", &SPEED, "Mechanical speed of the shaft", |i| &mut i.speed_shaft)
                .read_with("mechanics.imposed", "true"),
            I::input("angle_shaft", &RADIAN, "Mechanical angle of the shaft", |i| &mut i.angle_shaft)
                .unbounded()
                .read_with("mechanics.imposed", "true"),
            I::part("", &Part { table: THERMAL_INPUTS, lens: |i| &mut i.thermal }),
        ];
