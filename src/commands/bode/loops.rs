//! The loops of a drive with the variables of `PmsmDrive`: excitation and measurement for each.

use anyhow::{Result, bail};
use clap::ValueEnum;
use model_description::ModelDescription;

/// A response of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Loop {
    /// Current loop: i_q_est over i_q_ref, and the open loop at the current error
    Current,
    /// Speed loop, opened at the shaft: tau_e over tau_load, and the open loop of the torque
    Speed,
    /// Reference of the speed loop: speed over speed_ref
    Reference,
    /// Estimator: speed_est over speed, excited by tau_load
    Observer,
    /// Disturbance: speed over tau_load
    Disturbance,
    /// Mechanical impedance of the shaft, rotor included: -tau_load over speed
    Impedance,
    /// Admittance of the DC link: i_dc over u_dc
    Admittance,
}

/// What a response is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meaning {
    /// A response without a loop.
    Plain,
    /// The closed loop T; its open loop is T / (1 - T).
    Closed,
    /// The open loop L itself, with the feedback -L.
    Open,
    /// The measured response is -1/Z of this impedance.
    Impedance,
}

/// Excitation and measurement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Probe {
    pub(super) from: String,
    pub(super) to: String,
    pub(super) over: Option<String>,
    pub(super) meaning: Meaning,
    /// A period in s, if the output is the mean of the last one: its delay and its gain below 1 are removed.
    pub(super) mean: f64,
    /// Flags of limits.
    pub(super) watch: Vec<String>,
    /// The sample period of the controller in s.
    pub(super) sample: Option<f64>,
    /// The inertia of the rotor in kg.m2.
    pub(super) rotor: Option<f64>,
}

/// Flags that tell that a limit acts or the rotor is lost.
const FLAGS: [&str; 4] = ["voltage_limited", "current_limited", "lock_lost", "weakens"];

impl Loop {
    /// The probe of a drive; `value` is the number that a parameter starts with.
    pub(super) fn probe(self, drive: &ModelDescription, value: impl Fn(&str) -> Option<f64>) -> Result<Probe> {
        let torque = value("controller.speed_loop.torque_mode") == Some(1.0);
        let reference = if torque { "tau_ref" } else { "speed_ref" };
        let link = value("dc_link.use") == Some(1.0);
        let (from, to, over, meaning) = match self {
            Self::Current => (reference, "i_q_est", Some("i_q_ref"), Meaning::Closed),
            Self::Speed => ("tau_load", "tau_e", None, Meaning::Closed),
            Self::Reference => (reference, if torque { "tau_e" } else { "speed" }, None, Meaning::Plain),
            Self::Observer => ("tau_load", "speed_est", Some("speed"), Meaning::Plain),
            Self::Disturbance => ("tau_load", "speed", None, Meaning::Plain),
            Self::Impedance => ("tau_load", "speed", None, Meaning::Impedance),
            Self::Admittance => ("u_dc", if link { "i_source" } else { "i_dc" }, None, Meaning::Plain),
        };
        let name = self.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default();
        let absent: Vec<&str> =
            [from, to].into_iter().chain(over).filter(|name| drive.variable(name).is_none()).collect();
        if !absent.is_empty() {
            bail!(
                "--loop {name}: {} has no variable {}; --from, --to and --over name those of any FMU",
                drive.model_name,
                absent.join(", ")
            );
        }
        if from == "tau_load" && value("plant.mechanics.imposed") == Some(1.0) {
            bail!("--loop {name}: tau_load has no effect with plant.mechanics.imposed");
        }
        if self == Self::Speed && torque {
            bail!("--loop speed: with controller.speed_loop.torque_mode there is no speed loop");
        }
        let sample = value("controller.T_s");
        Ok(Probe {
            from: from.into(),
            to: to.into(),
            over: over.map(str::to_owned),
            meaning,
            // Without a link, `i_dc` is the mean over the last sample period.
            mean: if to == "i_dc" { sample.unwrap_or_default() } else { 0.0 },
            watch: FLAGS.iter().filter(|name| drive.variable(name).is_some()).map(|name| (*name).to_owned()).collect(),
            sample,
            rotor: value("plant.mechanics.J"),
        })
    }
}
