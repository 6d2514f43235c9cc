//! Self-commissioning in the controller: its parameters, its variables, and when it runs. The sequence is in
//! [`commission`](crate::commission).
//!
//! ```text
//! commission_start rises, enabled      gates off for 20 ms, then a new sequence; the controller does nothing else
//! commission_start stays true          after the end: gates off
//! commission_start is false            the controller works; the results stay until the next start
//! enable false, asc, a trip            the sequence is aborted
//! ```
//!
//! With `commission.mode` Off none of this exists: the sequence is allocated on the heap when the simulation starts.

pub use crate::commission::CommissionMode;
use crate::commission::{Commission, CommissionFault, CommissionSetup, CommissionState, Results, Voltage};
use drive_base::frame::Phases;
use drive_base::modulation::PwmUpdate;
use drive_base::motor::{A_PER_WB2, A_PER_WB3};
use fmu_core::unit::{AMPERE, HENRY, KG_M2, NEWTON_METER, NM_S_PER_RAD, OHM, ONE, SECOND, SPEED, VOLT, WEBER};
use fmu_core::{Field, Row, Table, table};
use serde::{Deserialize, Serialize};

/// Time in s with the gates off before the sequence: by then, the currents of the preceding control have decayed.
const QUIET: f64 = 0.02;

/// Parameters of the self-commissioning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CommissionParameters {
    /// What it finds.
    pub mode: CommissionMode,
    /// Maximum current in A, > 0.
    pub i: f64,
    /// Rated mechanical speed in rad/s, > 0.
    pub speed: f64,
    /// Longest time in s, > 0.
    pub t_max: f64,
    /// When the PWM takes over a voltage reference.
    pub update: PwmUpdate,
}

impl Default for CommissionParameters {
    fn default() -> Self {
        Self { mode: CommissionMode::Off, i: 5.0, speed: 314.0, t_max: 150.0, update: PwmUpdate::Single }
    }
}

type P = Row<CommissionParameters>;

/// The parameters with the prefix `commission.`.
pub const COMMISSION: &Table<CommissionParameters> = table![
    P::enumeration_parameter("mode", "Self-commissioning that commission_start starts", &Field(|p| &mut p.mode)),
    P::parameter(
        "i",
        &AMPERE,
        "Maximum current of the self-commissioning (peak), at most limit.i: the rated current to twice as much",
        |p| &mut p.i,
    )
    .above(0.0),
    P::parameter("speed", &SPEED, "Rated mechanical speed, where the back EMF is about u_dc / sqrt(3)", |p| {
        &mut p.speed
    })
    .above(0.0),
    P::parameter("t_max", &SECOND, "Longest time of the self-commissioning", |p| &mut p.t_max).above(0.0),
    P::enumeration_parameter(
        "update",
        "Updates of the PWM in a carrier period, of T_s or 2 T_s, whose ripple the self-commissioning takes into account",
        &Field(|p| &mut p.update),
    ),
];

/// Task of the controller at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Turn {
    /// It works.
    Works,
    /// It rests with the gates off.
    Rests,
    /// The sequence has the inverter; at its first sample the controller is reset.
    Commissions { voltage: Voltage, first: bool },
}

/// Self-commissioning inside a controller.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Commissioning {
    /// From the first start on.
    sequence: Option<Commission>,
    /// `commission_start` at the last sample.
    asked: bool,
    /// Time in s since the start, up to [`QUIET`].
    quiet: f64,
    /// Results visible now.
    shown: Results,
}

impl Commissioning {
    /// One sample of an enabled controller with `commission_start` = `asked`, currents `i` (A) and link voltage `u_dc` (V);
    /// `setup` configures a new sequence.
    pub(crate) fn update(&mut self, setup: &CommissionSetup, asked: bool, i: Phases, u_dc: f64) -> Turn {
        let before = std::mem::replace(&mut self.asked, asked);
        let first = asked && !before;
        if !asked {
            // The controller leaves the machine without current for a sample.
            return if self.abort() { Turn::Rests } else { Turn::Works };
        }
        if first {
            (self.sequence, self.quiet) = (Some(Commission::new(setup.clone())), 0.0);
        }
        match &mut self.sequence {
            Some(sequence) if sequence.is_running() => {
                let voltage = if self.quiet < QUIET {
                    self.quiet += setup.T_s;
                    Voltage::default()
                } else {
                    sequence.update(i, u_dc)
                };
                Turn::Commissions { voltage, first }
            }
            _ => Turn::Rests,
        }
    }

    /// A sample of a controller that rests: the sequence is aborted.
    pub(crate) fn rest(&mut self, asked: bool) {
        self.asked = asked;
        self.abort();
    }

    /// Aborts a sequence that runs, and returns whether one did.
    fn abort(&mut self) -> bool {
        let Some(sequence) = self.sequence.as_mut().filter(|sequence| sequence.is_running()) else { return false };
        sequence.abort();
        true
    }

    /// Its current stage, and the reason why it stopped.
    pub(crate) fn status(&self) -> (CommissionState, CommissionFault) {
        self.sequence.as_ref().map_or_else(Default::default, |sequence| (sequence.state(), sequence.fault()))
    }

    /// Makes the results of the last sample visible.
    pub(crate) fn show(&mut self) {
        if let Some(sequence) = &self.sequence {
            self.shown = *sequence.results();
        }
    }

    /// The results that are visible now.
    pub fn shown(&self) -> &Results {
        &self.shown
    }
}

/// A controller's self-commissioning, if available.
pub type Held = Option<Box<Commissioning>>;

type R = Row<Held>;

/// A result as shown by the outputs; without a commissioning, every value is unknown.
fn shown(held: &Held, get: impl FnOnce(&Results) -> f64) -> f64 {
    match held {
        Some(commissioning) => get(&commissioning.shown),
        None => get(&Results::default()),
    }
}

/// The variables of results, each with its half-width.
macro_rules! identified {
    ($($field:ident $unit:ident $what:literal;)*) => {
        table![$(
            R::computed_output(
                concat!("identified_", stringify!($field)),
                &$unit,
                concat!($what, ", from the self-commissioning; 0: not known"),
                |held| shown(held, |r| r.$field.value),
            ),
            R::computed_output(
                concat!("identified_", stringify!($field), "_u"),
                &ONE,
                concat!("Relative half-width of the 95 % interval of identified_", stringify!($field), "; 1: not known or refused"),
                |held| shown(held, |r| r.$field.u),
            ),
        )*]
    };
}

/// The results, outputs of the controller and of the drives.
pub const IDENTIFIED: &Table<Held> = identified! {
    R_s OHM "Stator resistance with that of a transistor";
    L_d HENRY "d-axis inductance without current";
    L_q HENRY "q-axis inductance without current";
    L_d_plus HENRY "d-axis flux linkage over current, at 0.9 commission.i along the magnet";
    L_d_minus HENRY "d-axis flux linkage over current, at 0.9 commission.i against the magnet";
    L_q_chord HENRY "q-axis flux linkage over current, at 0.9 commission.i";
    psi_M WEBER "Permanent-magnet flux linkage";
    J KG_M2 "Moment of inertia of the rotor and all that turns with it";
    B NM_S_PER_RAD "Viscous friction";
    tau_coulomb NEWTON_METER "Coulomb friction torque";
    tau_friction NEWTON_METER "Friction torque at 0.3 commission.speed, known better than B and tau_coulomb alone";
    u_dead VOLT "Dead-time voltage of an inverter leg, with the threshold of its devices";
    i_zero AMPERE "Current below which an inverter leg loses less";
    s_2 A_PER_WB2 "Second-order d-axis saturation coefficient";
    s_3 A_PER_WB3 "Third-order d-axis saturation coefficient";
};
