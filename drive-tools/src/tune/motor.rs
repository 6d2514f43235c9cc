//! The file of a machine: its data, its supply, and the bandwidths of its loops.

use crate::error::{Error, Result, WithContext, bail};
use drive::estimator::Kind;
use drive::motor::Motor;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// A number of the file with its position.
pub type Located = Spanned<f64>;

/// A machine's file, read.
#[derive(Clone, Debug)]
pub struct MotorFile {
    /// Content of the file.
    pub data: Data,
    path: PathBuf,
    text: String,
}

/// The content of the file, in SI units; currents and fluxes are peak values.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// Short name, used for files.
    pub name: String,
    /// Source of the values.
    pub source: String,
    /// The machine.
    pub machine: Machine,
    /// Inertia and friction.
    pub mechanics: Mechanics,
    /// Ratings.
    pub rating: Rating,
    /// Supply of the inverter.
    pub dc_link: DcLink,
    /// Bandwidths of the loops; by the rules where omitted.
    #[serde(default)]
    pub bandwidth: Bandwidth,
    /// Saturation of the plant.
    pub saturation: Option<Saturation>,
    /// Flux map of the plant.
    pub flux_map: Option<FluxMap>,
    /// Iron loss of the plant.
    pub iron: Option<Iron>,
    /// Losses of the inverter.
    pub inverter: Option<Inverter>,
    /// Temperature coefficients of the plant.
    pub temperature: Option<Temperature>,
    /// Overrides of the rules' choices.
    #[serde(default)]
    pub control: Control,
}

/// The machine.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(non_snake_case, reason = "the symbols of the models")]
pub struct Machine {
    /// Pole pairs.
    pub n_p: Spanned<i32>,
    /// Stator resistance in Ohm.
    pub R_s: Located,
    /// d-axis inductance in H.
    pub L_d: Located,
    /// q-axis inductance in H.
    pub L_q: Located,
    /// Permanent-magnet flux linkage in Wb, peak value.
    pub psi_M: Located,
}

/// Inertia and friction.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(non_snake_case, reason = "the symbols of the models")]
pub struct Mechanics {
    /// Inertia in kg.m2.
    pub J: Located,
    /// Viscous friction in N.m.s/rad; none if omitted.
    pub B: Option<Located>,
    /// Coulomb friction in N.m; none if omitted.
    pub tau_coulomb: Option<Located>,
    /// Speed range in rad/s over which the Coulomb friction changes sign.
    pub w_coulomb: Option<Located>,
    /// Windage in N.m.s2/rad2: torque over the square of the speed; none if omitted.
    pub k_w: Option<Located>,
}

/// Ratings.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rating {
    /// Rated mechanical speed in rad/s.
    pub speed: Located,
    /// Highest mechanical speed in rad/s, with field weakening; `speed` if omitted.
    pub speed_max: Option<Located>,
    /// Rated torque in N.m.
    pub torque: Located,
    /// Maximum current in A, peak value of a phase: the short-time limit of inverter and magnets, not the rated current.
    pub current: Located,
}

impl Rating {
    /// Highest mechanical speed in rad/s.
    pub fn top(&self) -> f64 {
        *self.speed_max.as_ref().unwrap_or(&self.speed).get_ref()
    }
}

/// Supply of the inverter.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DcLink {
    /// Voltage in V.
    pub u_dc: Located,
}

/// Bandwidths of the loops, in rad/s; by the rules where omitted.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bandwidth {
    /// Current loop.
    pub current: Option<Located>,
    /// Speed loop.
    pub speed: Option<Located>,
    /// Speed adaptation of the flux observer, or tracker of the other estimators.
    pub observer: Option<Located>,
}

/// Saturation of the plant, in A/Wb2 and A/Wb3.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saturation {
    /// Second-order d-axis coefficient.
    pub s_2: Option<Located>,
    /// Third-order d-axis coefficient.
    pub s_3: Option<Located>,
    /// Cross-saturation coefficient.
    pub s_dq: Option<Located>,
}

/// Flux map of the plant.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FluxMap {
    /// CSV file with the columns i_d,i_q,psi_d,psi_q and optionally torque, in the folder of the machine's file.
    pub file: Spanned<String>,
    /// Axes of the table: "pm" (the d-axis on the magnet) or "syr" (the magnet on the negative q-axis); "pm" if omitted.
    pub convention: Option<Spanned<String>>,
    /// Values of the table: "peak" or "rms"; "peak" if omitted.
    pub scale: Option<Spanned<String>>,
    /// Temperature of the magnet in degC; 20 if omitted.
    pub temperature: Option<Located>,
    /// Temperature coefficient of the magnet in 1/K, where the temperature is not 20 degC.
    pub alpha: Option<Located>,
}

/// Iron loss of the plant.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Iron {
    /// Drag test: pairs of mechanical speed in rad/s and iron loss in W.
    pub p: Spanned<Vec<[f64; 2]>>,
}

/// Losses of the inverter's devices, and its switching frequency.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(non_snake_case, reason = "the symbols of the models")]
pub struct Inverter {
    /// Threshold voltage of a transistor in V; none if omitted, like the three below.
    pub u_transistor: Option<Located>,
    /// Resistance of a transistor in Ohm.
    pub r_transistor: Option<Located>,
    /// Threshold voltage of a diode in V.
    pub u_diode: Option<Located>,
    /// Resistance of a diode in Ohm.
    pub r_diode: Option<Located>,
    /// Switching energy of a leg and PWM period in J at `i_sw` and `u_sw`: turn-on, turn-off and recovery; none if omitted.
    pub E_sw: Option<Located>,
    /// Current of `E_sw` in A.
    pub i_sw: Option<Located>,
    /// DC-link voltage of `E_sw` in V.
    pub u_sw: Option<Located>,
    /// Exponent of the DC-link voltage in the switching energy; 1.3 if omitted.
    pub k_sw: Option<Located>,
    /// Switching frequency in Hz; 1 / T_s if omitted.
    pub f_sw: Option<Located>,
    /// Voltage in V that a leg loses to the dead time; none if omitted.
    pub u_dead: Option<Located>,
    /// Current in A below which that voltage falls linearly to zero; 2 % of the maximum current if omitted.
    pub i_zero: Option<Located>,
}

/// Temperature coefficients in 1/K, from the 20 degC of the file's values.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Temperature {
    /// Coefficient of the resistance: copper 3.93e-3.
    pub winding: Option<Located>,
    /// Coefficient of the magnet's flux linkage: NdFeB -1.1e-3, SmCo -0.4e-3, ferrite -2e-3.
    pub magnet: Option<Located>,
}

/// Overrides of the rules' choices.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(non_snake_case, reason = "the symbols of the models")]
pub struct Control {
    /// Estimator, by its name.
    pub estimator: Option<Spanned<String>>,
    /// Sample period in s.
    pub T_s: Option<Located>,
}

/// The names of all estimators.
pub fn estimators() -> String {
    Kind::ALL.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ")
}

/// Torque constant K = 1.5 n_p psi_M in N.m/A.
pub fn torque_constant(data: &Data) -> f64 {
    1.5 * f64::from(*data.machine.n_p.get_ref()) * data.machine.psi_M.get_ref()
}

/// Natural frequency in rad/s of the rotor on a current vector of `i` (A): w_0 = sqrt(n_p K i / J).
pub fn swing(data: &Data, i: f64) -> f64 {
    (f64::from(*data.machine.n_p.get_ref()) * torque_constant(data) * i / data.mechanics.J.get_ref()).sqrt()
}

/// The machine's electrical data.
pub fn electrical(data: &Data) -> Motor {
    let m = &data.machine;
    Motor {
        n_p: *m.n_p.get_ref(),
        R_s: *m.R_s.get_ref(),
        L_d: *m.L_d.get_ref(),
        L_q: *m.L_q.get_ref(),
        psi_M: *m.psi_M.get_ref(),
    }
}

impl MotorFile {
    /// Reads the text of the file at `path`.
    ///
    /// # Errors
    /// Gives the line and column of an unknown or missing key, or of a value of the wrong type.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let data: Result<Data, toml::de::Error> = toml::from_str(text);
        data.map(|data| Self { data, path: path.into(), text: text.into() }).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            let message = error.message().lines().collect::<Vec<_>>().join(" ");
            let hint = if message.starts_with("missing") { "; motors/reference.toml shows every key" } else { "" };
            Error::new(format!("{}: {message}{hint}", place(path, text, offset)))
        })
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, or [`parse`](Self::parse) fails.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        Self::parse(&text, path)
    }

    /// Tunes for this estimator instead of the file's.
    ///
    /// # Errors
    /// No motor has this name.
    pub fn choose(&mut self, estimator: &str) -> Result<()> {
        if !Kind::ALL.iter().any(|kind| kind.name() == estimator) {
            bail!("estimator {estimator}: is not an estimator; choose one of {}", estimators());
        }
        self.data.control.estimator = Some(Spanned::new(0..0, estimator.to_owned()));
        Ok(())
    }

    /// A file named in this one, relative to its folder.
    pub fn beside(&self, file: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(file)
    }

    /// Position of a value: `file:line:column`.
    pub fn place<T>(&self, value: &Spanned<T>) -> String {
        self.place_at(value.span().start)
    }

    /// Position of an offset in the file.
    pub fn place_at(&self, offset: usize) -> String {
        place(&self.path, &self.text, offset)
    }
}

fn place(path: &Path, text: &str, offset: usize) -> String {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
    format!("{}:{line}:{column}", path.display())
}
