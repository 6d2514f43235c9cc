//! The file of a machine: what it is, what drives it, and how fast its loops shall be.

use anyhow::{Result, anyhow};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// A number of the file with its place.
pub type Number = Spanned<f64>;

/// A machine's file, read.
#[derive(Debug)]
pub struct MotorFile {
    /// What it says.
    pub data: Data,
    path: PathBuf,
    text: String,
}

/// What the file says. SI units; currents and fluxes are peak values.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// Short name, used for files.
    pub name: String,
    /// Where the values come from.
    pub source: String,
    /// The machine.
    pub machine: Machine,
    /// Inertia and friction.
    pub mechanics: Mechanics,
    /// Ratings.
    pub rating: Rating,
    /// What feeds the inverter.
    pub dc_link: DcLink,
    /// How fast the loops shall be.
    pub bandwidth: Bandwidth,
    /// Saturation of the plant.
    pub saturation: Option<Saturation>,
    /// What the rules would choose by themselves.
    #[serde(default)]
    pub control: Control,
}

/// The machine.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(non_snake_case, reason = "the symbols of the models")]
pub struct Machine {
    /// Pole pairs.
    pub n_p: Spanned<i32>,
    /// Stator resistance in Ohm.
    pub R_s: Number,
    /// Inductance along the magnet in H.
    pub L_d: Number,
    /// Inductance across the magnet in H.
    pub L_q: Number,
    /// Flux linkage of the magnet in Wb.
    pub psi_M: Number,
}

/// Inertia and friction.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(non_snake_case, reason = "the symbols of the models")]
pub struct Mechanics {
    /// Inertia in kg.m2.
    pub J: Number,
    /// Viscous friction in N.m.s/rad; none without it.
    pub B: Option<Number>,
    /// Coulomb friction in N.m; none without it.
    pub tau_coulomb: Option<Number>,
    /// Speed in rad/s over which that changes sign.
    pub w_coulomb: Option<Number>,
}

/// Ratings.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rating {
    /// Mechanical speed in rad/s.
    pub speed: Number,
    /// Torque in N.m.
    pub torque: Number,
    /// Greatest magnitude of the current in A.
    pub current: Number,
}

/// What feeds the inverter.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DcLink {
    /// Voltage in V.
    pub u_dc: Number,
}

/// How fast the loops shall be, in rad/s.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bandwidth {
    /// Current loop.
    pub current: Number,
    /// Speed loop.
    pub speed: Number,
    /// Speed adaptation of the flux observer, or tracker of the other estimators.
    pub observer: Number,
}

/// Saturation of the plant, in A/Wb2 and A/Wb3.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saturation {
    /// Of second order along the magnet.
    pub s_2: Option<Number>,
    /// Of third order along the magnet.
    pub s_3: Option<Number>,
    /// Between the axes.
    pub s_dq: Option<Number>,
}

/// What the rules would choose by themselves.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(non_snake_case, reason = "the symbols of the models")]
pub struct Control {
    /// Estimator: Rasmussen or ExtendedEmf.
    pub estimator: Option<Spanned<String>>,
    /// Sample period in s.
    pub T_s: Option<Number>,
}

impl MotorFile {
    /// Reads the text of the file at `path`.
    ///
    /// # Errors
    /// Says at which line and column a key is unknown or missing, or a value has the wrong type.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let data: Result<Data, toml::de::Error> = toml::from_str(text);
        data.map(|data| Self { data, path: path.into(), text: text.into() }).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            let message = error.message().lines().collect::<Vec<_>>().join(" ");
            let hint = if message.starts_with("missing") { "; motors/reference.toml shows every key" } else { "" };
            anyhow!("{}: {message}{hint}", place(path, text, offset))
        })
    }

    /// Where a value stands: `file:line:column`.
    pub fn place<T>(&self, value: &Spanned<T>) -> String {
        self.place_at(value.span().start)
    }

    /// Where an offset of the file is.
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
