//! The controller's parameters, and the tables of its parameters and outputs.

use crate::battery::{DC_LIMITS, DcLimits};
use crate::commission::CommissionSetup;
use crate::commissioning::{COMMISSION, CommissionParameters};
use crate::current::{CURRENT_LOOP, CurrentLoop};
use crate::estimator::Kind;
use crate::estimator::tables::{ESTIMATOR_PARAMETERS, EstimatorParameters};
use crate::limits::Limits;
use crate::lock::{LOCK, LockParameters};
use crate::modes::{MODES, Modes};
use crate::polarity::{POLARITY, PolarityParameters};
use crate::position::{POSITION, PositionParameters, PositionSensor};
use crate::sensor::{SENSOR, Sensor};
use crate::signals::ControllerOutputs;
use crate::speed::{SPEED_LOOP, SpeedLoop};
use crate::start::{START, StartParameters};
use crate::tracking::LeastTracker;
use crate::trip::{TRIP, TripParameters};
use crate::weakening::{WEAKENING, WeakeningParameters};
use crate::zero_speed::{ZERO_SPEED, ZeroSpeed};
use drive_base::motor::A_PER_WB2;
use drive_base::motor::{MOTOR, Motor};
use drive_base::overmodulation::{MODULATION, Modulation};
use fmu_core::unit::{AMPERE, KG_M2, NEWTON_METER, OHM, ONE, RADIAN, SECOND, SPEED, VOLT};
use fmu_core::{Field, Part, Row, Table, rows, table};
use serde::{Deserialize, Serialize};

/// Dead-time compensation, added to the command, and the voltage that the estimators receive. With u_loss(i) of
/// [`modulation`](drive_base::modulation) (V, stator axes, at the currents i in A):
///
/// ```text
/// command of the legs                    u* = u + u_loss(i_ref), limited to the hexagon
/// voltage of the estimators              u, the command without compensation: exact only for i = i_ref
///   with `observe`                       u* - (u_loss(i[k-1]) + u_loss(i[k])) / 2, i measured: the trapezoid over [k-1, k)
/// measured currents with `calibrate`     i - mean of i while the controller is not enabled, over its last 20 ms
/// ```
///
/// Derived here: within +-i_zero, a leg is a resistance u_dead / i_zero that the compensation follows 1.5 T_s late.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compensation {
    /// Voltage that a leg loses in V, >= 0; 0: none.
    pub u_dead: f64,
    /// Current in A below which the compensation is reduced, > 0.
    pub i_zero: f64,
    /// The estimators use the voltage loss of the inverter at the measured currents.
    pub observe: bool,
    /// The offsets of the current sensors are measured while the controller is not enabled.
    pub calibrate: bool,
}

impl Default for Compensation {
    fn default() -> Self {
        Self { u_dead: 0.0, i_zero: 0.1, observe: false, calibrate: false }
    }
}

type C = Row<Compensation>;

/// Variables of the compensation; their owner supplies the prefix `compensation.`.
const COMPENSATION: &Table<Compensation> = table![
    C::parameter(
        "u_dead",
        &VOLT,
        "Dead-time voltage of an inverter leg, added to the command; 0: no compensation",
        |p| &mut p.u_dead,
    )
    .at_least(0.0),
    C::parameter("i_zero", &AMPERE, "Current below which the compensation falls linearly to zero", |p| {
        &mut p.i_zero
    })
    .above(0.0),
    C::boolean_parameter(
        "observe",
        "The estimators and lock_lost subtract the dead-time voltage at the measured currents; false: they assume that the compensation is exact",
        |p| &mut p.observe,
    ),
    C::boolean_parameter(
        "calibrate",
        "The controller measures the offsets of the current sensors while enable is false; false: offsets stay",
        |p| &mut p.calibrate,
    ),
];

/// All parameters that a commissioning engineer sets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerParameters {
    /// Sample period in s, > 0.
    pub T_s: f64,
    /// Delay in samples between current sampling and voltage output: 0, 1 (Jacobi exchange) or 2.
    pub delay: i32,
    /// The estimator of angle and speed.
    pub estimator: Kind,
    /// Estimates of the machine.
    pub motor: Motor,
    /// Estimate of the second-order d-axis saturation coefficient in A/Wb2, >= 0; 0: unknown.
    pub s_2: f64,
    /// Inertia in kg.m2 used to tune the speed loop, > 0.
    pub J: f64,
    /// Initial estimate of the electrical angle in rad.
    pub theta_est: f64,
    /// Initial estimate of the mechanical speed in rad/s.
    pub speed_est: f64,
    /// Limits of the references.
    pub limit: Limits,
    /// Limits of the current of the DC link.
    pub dc: DcLimits,
    /// Brake, coast and limits of speed and torque.
    pub modes: Modes,
    /// The speed loop.
    pub speed_loop: SpeedLoop,
    /// The current loop.
    pub current: CurrentLoop,
    /// The low-speed law.
    pub zero_speed: ZeroSpeed,
    /// Field weakening.
    pub weakening: WeakeningParameters,
    /// Voltage beyond the hexagon.
    pub modulation: Modulation,
    /// The start.
    pub start: StartParameters,
    /// The start by injection.
    pub polarity: PolarityParameters,
    /// Detection of a lost rotor.
    pub lock: LockParameters,
    /// Over-current and over-voltage trips.
    pub trip: TripParameters,
    /// Current sensors.
    pub sensor: Sensor,
    /// Position sensor of the estimator `Sensored`.
    pub position: PositionParameters,
    /// Estimator that replaces a lost sensor; `Sensored`: none.
    pub fallback: Kind,
    /// The sensor takes over again once it works.
    pub resume: bool,
    /// Dead-time compensation.
    pub compensation: Compensation,
    /// Self-commissioning.
    pub commission: CommissionParameters,
    /// Parameters of the estimators.
    pub estimators: EstimatorParameters,
}

impl Default for ControllerParameters {
    /// Tuned for the reference motor, with R^ = 0.9 R on purpose: the safe side at standstill.
    fn default() -> Self {
        let motor = Motor::default();
        Self {
            T_s: 1e-4,
            delay: 1,
            estimator: Kind::Rasmussen,
            motor: Motor { R_s: 0.9 * motor.R_s, ..motor },
            s_2: 0.0,
            J: 1.5e-3,
            theta_est: 0.0,
            speed_est: 0.0,
            limit: Limits { i_q: 6.0, i: 7.5, tau: 1000.0 },
            dc: DcLimits::default(),
            modes: Modes::default(),
            speed_loop: SpeedLoop::default(),
            current: CurrentLoop::default(),
            zero_speed: ZeroSpeed::default(),
            weakening: WeakeningParameters::default(),
            modulation: Modulation::default(),
            start: StartParameters::default(),
            polarity: PolarityParameters::default(),
            lock: LockParameters::default(),
            trip: TripParameters::default(),
            sensor: Sensor::default(),
            fallback: Kind::Sensored,
            resume: false,
            position: PositionParameters::default(),
            compensation: Compensation::default(),
            commission: CommissionParameters::default(),
            estimators: EstimatorParameters::default(),
        }
    }
}

impl ControllerParameters {
    /// The estimator in use; `lost`: the sensor is lost.
    #[inline]
    pub(crate) fn estimator_with(&self, lost: bool) -> Kind {
        if lost { self.fallback } else { self.estimator }
    }

    /// The minimum bandwidth of the tracker while field weakening acts.
    pub(crate) fn least_tracker(&self) -> LeastTracker {
        let Self { estimator, estimators, speed_loop, motor, J, T_s, .. } = self;
        LeastTracker::new(*estimator, estimators, speed_loop, motor.n_p, (*J, *T_s))
    }

    /// Inputs of the self-commissioning sequence.
    pub(crate) fn commission_setup(&self) -> CommissionSetup {
        CommissionSetup {
            mode: self.commission.mode,
            n_p: self.motor.n_p,
            T_s: self.T_s,
            delay: self.delay,
            i: self.commission.i,
            speed: f64::from(self.motor.n_p) * self.commission.speed,
            t_max: self.commission.t_max,
            carrier: self.commission.update.each_period() * self.T_s,
        }
    }

    /// Whether a position sensor of this `kind` is in use.
    pub(crate) fn senses(&self, kind: PositionSensor) -> bool {
        self.estimator == Kind::Sensored && self.position.kind == kind
    }

    /// Whether a fallback estimator exists for the shaft sensor.
    #[inline]
    pub(crate) fn has_fallback(&self) -> bool {
        self.estimator == Kind::Sensored && self.fallback != Kind::Sensored
    }
}

type P = Row<ControllerParameters>;

/// The controller's parameters.
pub const PARAMETERS: &Table<ControllerParameters> = &Table::new(PARAMETER_ROWS);

/// The sample period, and all other parameters.
pub(crate) const PARAMETER_ROWS: &[P] = rows![
    P::parameter("T_s", &SECOND, "Sample period, independent of the communication step", |p| &mut p.T_s).above(0.0),
    P::integer_parameter(
        "timing.delay",
        "Samples from taking the currents to the voltage acting, as the importer exchanges values: 1 (all \
                 outputs read, then all inputs set), 0 (one FMU gets what the other has computed in this step) or 2 \
                 (voltages or currents take a step more)",
        |p| &mut p.delay,
    )
    .at_least(0.0)
    .at_most(2.0),
    P::enumeration_parameter("estimator", "Estimator of rotor angle and speed", &Field(|p| &mut p.estimator)),
    P::part("motor.", &Part { table: MOTOR, lens: |p| &mut p.motor }),
    P::parameter(
        "saturation.s_2",
        &A_PER_WB2,
        "Second-order d-axis saturation coefficient (estimate), read by the start by injection; 0: unknown",
        |p| &mut p.s_2,
    )
    .at_least(0.0),
    P::parameter("mechanics.J", &KG_M2, "Moment of inertia used to tune the speed loop", |p| &mut p.J)
        .above(0.0)
        .tunable(),
    P::parameter("initial.theta_est", &RADIAN, "First estimate of the electrical rotor angle", |p| {
        &mut p.theta_est
    }),
    P::parameter("initial.speed_est", &SPEED, "First estimate of the mechanical speed", |p| &mut p.speed_est),
    P::parameter("limit.i_q", &AMPERE, "Maximum magnitude of the q-axis current", |p| &mut p.limit.i_q)
        .above(0.0)
        .tunable(),
    P::parameter("limit.i", &AMPERE, "Maximum phase current (peak); i_d has priority over i_q", |p| &mut p.limit.i)
        .above(0.0)
        .tunable(),
    P::parameter("limit.tau", &NEWTON_METER, "Maximum magnitude of the torque reference", |p| &mut p.limit.tau)
        .above(0.0)
        .tunable(),
    P::part("limit.", &Part { table: DC_LIMITS, lens: |p| &mut p.dc }),
    P::part("", &Part { table: MODES, lens: |p| &mut p.modes }),
    P::part("speed_loop.", &Part { table: SPEED_LOOP, lens: |p| &mut p.speed_loop }),
    P::part("current.", &Part { table: CURRENT_LOOP, lens: |p| &mut p.current }),
    P::part("zero_speed.", &Part { table: ZERO_SPEED, lens: |p| &mut p.zero_speed }),
    P::part("weakening.", &Part { table: WEAKENING, lens: |p| &mut p.weakening }),
    P::part("modulation.", &Part { table: MODULATION, lens: |p| &mut p.modulation }),
    P::part("start.", &Part { table: START, lens: |p| &mut p.start }),
    P::part("polarity.", &Part { table: POLARITY, lens: |p| &mut p.polarity }),
    P::part("lock.", &Part { table: LOCK, lens: |p| &mut p.lock }),
    P::part("trip.", &Part { table: TRIP, lens: |p| &mut p.trip }),
    P::part("sensor.", &Part { table: SENSOR, lens: |p| &mut p.sensor }),
    P::part("", &Part { table: POSITION, lens: |p| &mut p.position }),
    P::enumeration_parameter(
        "sensor.fallback",
        "Estimator that takes over when sensor_valid becomes false, until enable falls or with sensor.resume; Sensored: none",
        &Field(|p| &mut p.fallback),
    ),
    P::boolean_parameter(
        "sensor.resume",
        "The sensor takes over again once sensor_valid is true; false: sensor.fallback leads until enable falls",
        |p| &mut p.resume,
    ),
    P::part("compensation.", &Part { table: COMPENSATION, lens: |p| &mut p.compensation }),
    P::part("commission.", &Part { table: COMMISSION, lens: |p| &mut p.commission }),
    P::part("", &Part { table: ESTIMATOR_PARAMETERS, lens: |p| &mut p.estimators }),
];

type O = Row<ControllerOutputs>;

/// The voltage references: outputs of the controller and of `PmsmDrive`.
pub const VOLTAGES: &Table<ControllerOutputs> = table![
    O::discrete_output("u_a", &VOLT, "Voltage reference of phase a, inside the hexagon of u_dc", |o| { &mut o.u.a }),
    O::discrete_output("u_b", &VOLT, "Voltage reference of phase b", |o| &mut o.u.b),
    O::discrete_output("u_c", &VOLT, "Voltage reference of phase c", |o| &mut o.u.c),
];

/// The estimates: outputs of the controller and of `PmsmDrive`.
pub const ESTIMATES: &Table<ControllerOutputs> = table![
    O::discrete_output("speed_est", &SPEED, "Estimated mechanical speed", |o| &mut o.speed_est),
    O::discrete_output("theta_est", &RADIAN, "Estimated electrical rotor angle, in (-pi, pi]", |o| {
        &mut o.theta_est
    }),
];

/// The limits and the state of the control: outputs of the controller and of `PmsmDrive`.
pub const STATUS: &Table<ControllerOutputs> = table![
    O::discrete_output("tau_max", &NEWTON_METER, "Maximum torque that the references may ask for now", |o| {
        &mut o.tau_max
    }),
    O::discrete_output(
        "tau_min",
        &NEWTON_METER,
        "Minimum torque that the references may ask for now, 0 or less",
        |o| { &mut o.tau_min },
    ),
    O::discrete_output(
        "u_share",
        &ONE,
        "Voltage that the current loop requests, before the hexagon, as a share of u_dc / sqrt(3)",
        |o| &mut o.u_share,
    ),
    O::boolean_output(
        "voltage_limited",
        "The voltage hexagon of u_dc limited the voltage references of the last sample",
        |o| &mut o.voltage_limited,
    ),
    O::boolean_output(
        "current_limited",
        "A limit (limit.*, tau_limit_max, tau_limit_min, brake.tau) or field weakening limited current references or voltage of the last sample",
        |o| &mut o.current_limited,
    ),
    O::boolean_output("weakens", "Field weakening lowers i_d_ref", |o| &mut o.weakens),
    O::boolean_output("enabled", "The controller is running: the voltage references are its own", |o| {
        &mut o.enabled
    }),
    O::boolean_output(
        "short_circuit",
        "The inverter short-circuits the machine: all upper or all lower transistors conduct",
        |o| &mut o.short_circuit,
    ),
    O::enumeration_output(
        "tripped",
        "What has tripped: the controller rests until enable falls",
        &Field(|o| &mut o.tripped),
    ),
    O::boolean_output("sensor_lost", "The sensor is lost: sensor.fallback supplies angle and speed", |o| {
        &mut o.sensor_lost
    }),
    O::discrete_output(
        "lock_lost",
        &ONE,
        "Mismatch of the estimate with the applied voltage or the speed reference: 0 locked, 1 or more lost, 10 at most",
        |o| &mut o.lock_lost,
    ),
    O::discrete_output(
        "R_s_est",
        &OHM,
        "Stator resistance that the estimator uses: motor.R_s, or what adaptation.resistance makes of it",
        |o| &mut o.R_s_est,
    ),
    O::enumeration_output(
        "commission_state",
        "What the self-commissioning does: it ends with Done or Refused",
        &Field(|o| &mut o.commission_state),
    ),
    O::enumeration_output(
        "commission_fault",
        "Why the self-commissioning was refused",
        &Field(|o| &mut o.commission_fault),
    ),
    O::enumeration_output(
        "start_state",
        "What the start does: speed or torque follow the reference once it is Running",
        &Field(|o| &mut o.start_state),
    ),
];

/// The controller's outputs.
pub const OUTPUTS: &Table<ControllerOutputs> = table![
    O::part("", &Part { table: VOLTAGES, lens: |o| o }),
    O::part("", &Part { table: ESTIMATES, lens: |o| o }),
    O::discrete_output("i_d", &AMPERE, "d-axis stator current in the estimated rotor frame", |o| &mut o.i.d),
    O::discrete_output("i_q", &AMPERE, "q-axis stator current in the estimated rotor frame", |o| &mut o.i.q),
    O::discrete_output("i_d_ref", &AMPERE, "d-axis stator current reference", |o| &mut o.i_ref.d),
    O::discrete_output("i_q_ref", &AMPERE, "q-axis stator current reference", |o| &mut o.i_ref.q),
    O::part("", &Part { table: STATUS, lens: |o| o }),
];
