//! The file of a data sheet.

use super::column::SpeedColumn;
use crate::error::{Error, Result, WithContext, bail, ensure};
use serde::Deserialize;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// rad/s of a revolution per minute.
pub const RPM: f64 = PI / 30.0;

/// A data sheet, read and checked.
#[derive(Clone, Debug)]
pub struct DataSheet {
    /// Content of the file.
    pub data: SheetData,
    path: PathBuf,
}

/// The content of the file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SheetData {
    /// Short name, used for files.
    pub name: String,
    /// Source of the values.
    pub source: String,
    /// Torque over speed; from the map if omitted.
    pub torque: Option<Torque>,
    /// Losses.
    pub losses: LossTable,
    /// Inertia.
    pub mechanics: Inertia,
    /// Voltages.
    pub dc_link: Voltages,
    /// Bandwidth.
    #[serde(default)]
    pub bandwidth: TorqueBandwidth,
}

/// Torque at the shaft over speed, in N.m.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Torque {
    pub(super) rpm: Option<Vec<f64>>,
    pub(super) speed: Option<Vec<f64>>,
    /// Peak torque.
    pub peak: Vec<f64>,
    /// Continuous torque.
    pub continuous: Option<Vec<f64>>,
    /// Peak torque as a generator.
    pub generator: Option<Vec<f64>>,
    /// Drag torque with the gates off.
    pub drag: Option<Vec<f64>>,
    /// Time in s for which the peak torque is available.
    pub peak_time: Option<f64>,
}

/// Losses over speed and torque: a table, or the file of a map.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossTable {
    pub(super) rpm: Option<Vec<f64>>,
    pub(super) speed: Option<Vec<f64>>,
    /// Torques in N.m.
    pub torque: Option<Vec<f64>>,
    /// Efficiency, a row per speed.
    pub efficiency: Option<Vec<Vec<f64>>>,
    /// Losses in W, a row per speed.
    pub loss: Option<Vec<Vec<f64>>>,
    /// Losses in W at zero torque, for each speed.
    pub no_load: Option<Vec<f64>>,
    /// `map.csv` of `fmu map`.
    pub file: Option<PathBuf>,
    /// Temperature of the map in degC, if it has several.
    pub temperature: Option<f64>,
}

/// Inertia.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inertia {
    /// Moment of inertia in kg.m2.
    pub J: f64,
}

/// Voltages of the DC link in V.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Voltages {
    /// Voltage of the curves.
    pub u_dc: f64,
    /// Minimum voltage.
    pub u_min: Option<f64>,
    /// Maximum voltage.
    pub u_max: Option<f64>,
}

/// Bandwidth of the torque.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorqueBandwidth {
    /// In rad/s.
    pub torque: f64,
}

impl Default for TorqueBandwidth {
    fn default() -> Self {
        Self { torque: 600.0 }
    }
}

/// The speeds in rad/s of a table: its key `rpm` or `speed`, from 0 or above, increasing.
fn speeds(table: &str, rpm: Option<&Vec<f64>>, speed: Option<&Vec<f64>>) -> Result<Vec<f64>> {
    let (key, values, unit) = match (rpm, speed) {
        (Some(rpm), None) => ("rpm", rpm, RPM),
        (None, Some(speed)) => ("speed", speed, 1.0),
        (Some(_), Some(_)) => bail!("{table} has rpm and speed: give one of them"),
        (None, None) => bail!("{table} has no speeds: give rpm = [...], or speed = [...] in rad/s"),
    };
    let key = format!("{table}.{key}");
    increasing(&key, values)?;
    ensure!(values.len() >= 2, "{key} has {} values: give at least 2", values.len());
    ensure!(values[0] >= 0.0, "{key}[1] = {} must be at least 0: reverse rotation mirrors forward rotation", values[0]);
    Ok(values.iter().map(|n| n * unit).collect())
}

/// Checks that the values of an axis are finite and increase.
///
/// # Errors
/// The first value that does not.
pub fn increasing(key: &str, values: &[f64]) -> Result<()> {
    for (k, x) in values.iter().enumerate() {
        ensure!(x.is_finite(), "{key}[{}] = {x} is not a finite number", k + 1);
        ensure!(
            k == 0 || *x > values[k - 1],
            "{key}[{}] = {x} must be greater than {key}[{k}] = {}",
            k + 1,
            values[k.max(1) - 1]
        );
    }
    Ok(())
}

/// Checks that there are `count` values, finite and at least 0.
///
/// # Errors
/// Their number, or the first value that is wrong.
pub fn curve(key: &str, values: &[f64], (axis, count): (&str, usize)) -> Result<()> {
    ensure!(values.len() == count, "{key} has {} values, but {axis} has {count}", values.len());
    for (k, x) in values.iter().enumerate() {
        ensure!(x.is_finite() && *x >= 0.0, "{key}[{}] = {x} must be a number of at least 0", k + 1);
    }
    Ok(())
}

impl DataSheet {
    /// Reads and checks the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, or a value is wrong.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        Self::parse(&text, path)
    }

    /// Reads the text of the file at `path`.
    ///
    /// # Errors
    /// The first value that is wrong.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let data: SheetData = toml::from_str(text).map_err(|error| {
            let line = text.get(..error.span().map_or(0, |span| span.start)).unwrap_or(text).matches('\n').count() + 1;
            let message = error.message().lines().collect::<Vec<_>>().join(" ");
            Error::new(format!("{}:{line}: {message}; fmu datasheet --example shows every key", path.display()))
        })?;
        let sheet = Self { data, path: path.into() };
        sheet.check().with_context(|| path.display().to_string())?;
        Ok(sheet)
    }

    fn check(&self) -> Result<()> {
        let SheetData { name, torque, losses, mechanics, dc_link, bandwidth, .. } = &self.data;
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_. ".contains(c);
        ensure!(
            !name.is_empty() && name.chars().all(plain),
            "name = {name:?} must be letters, digits and -_. for files"
        );
        for (key, value) in
            [("mechanics.J", mechanics.J), ("dc_link.u_dc", dc_link.u_dc), ("bandwidth.torque", bandwidth.torque)]
        {
            ensure!(value.is_finite() && value > 0.0, "{key} = {value} must be greater than 0");
        }
        let [u_min, u_max] = self.voltages();
        let u_dc = dc_link.u_dc;
        ensure!(0.0 <= u_min && u_min <= u_dc, "dc_link.u_min = {u_min} V must be from 0 to u_dc = {u_dc} V");
        ensure!(u_max >= u_dc, "dc_link.u_max = {u_max} V must be at least u_dc = {u_dc} V");
        if let Some(torque) = torque {
            torque.check()?;
        }
        let table = losses.torque.is_some() || losses.efficiency.is_some() || losses.loss.is_some();
        match (&losses.file, table) {
            (Some(_), true) => bail!("losses has file and a table: give one of them"),
            (None, false) => {
                bail!("losses has no table: give rpm, torque and efficiency or loss, or file = \"map.csv\"")
            }
            (None, true) => ensure!(torque.is_some(), "torque is missing: only the file of a map replaces it"),
            (Some(_), false) => {}
        }
        Ok(())
    }

    /// The path of a file that is named in this one, relative to its folder.
    pub fn beside(&self, file: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(file)
    }

    /// The path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Minimum and maximum voltage in V; without them, any.
    pub fn voltages(&self) -> [f64; 2] {
        let Voltages { u_dc, u_min, u_max } = self.data.dc_link;
        [u_min.unwrap_or(0.0), u_max.unwrap_or(1e4_f64.max(u_dc))]
    }

    /// Time constant of the overload in s, from the time for which the peak torque is available from cold.
    ///
    /// # Errors
    /// The time is wrong, or there is no continuous torque below the peak torque.
    pub fn t_overload(&self, columns: &[SpeedColumn]) -> Result<f64> {
        let Some(time) = self.data.torque.as_ref().and_then(|torque| torque.peak_time) else { return Ok(0.0) };
        ensure!(
            time.is_finite() && time > 0.0,
            "{}: torque.peak_time = {time} must be greater than 0 s",
            self.path.display()
        );
        let ratio = columns.iter().filter(|c| c.continuous > 0.0).map(|c| c.peak[0] / c.continuous).fold(1.0, f64::max);
        ensure!(
            ratio > 1.0 + 1e-9,
            "{}: torque.peak_time = {time} s needs torque.continuous below torque.peak",
            self.path.display()
        );
        Ok(-time / (1.0 - 1.0 / (ratio * ratio)).ln())
    }
}

impl Torque {
    /// The speeds in rad/s.
    ///
    /// # Errors
    /// There are none, or they do not increase.
    pub fn speeds(&self) -> Result<Vec<f64>> {
        speeds("torque", self.rpm.as_ref(), self.speed.as_ref())
    }

    fn check(&self) -> Result<()> {
        let axis = ("torque.rpm or torque.speed", self.speeds()?.len());
        curve("torque.peak", &self.peak, axis)?;
        for (key, values) in [("continuous", &self.continuous), ("generator", &self.generator), ("drag", &self.drag)] {
            values.as_ref().map_or(Ok(()), |values| curve(&format!("torque.{key}"), values, axis))?;
        }
        for (k, (continuous, peak)) in self.continuous.iter().flatten().zip(&self.peak).enumerate() {
            let k = k + 1;
            ensure!(
                continuous <= peak,
                "torque.continuous[{k}] = {continuous} N.m is above torque.peak[{k}] = {peak} N.m"
            );
        }
        Ok(())
    }
}

impl LossTable {
    /// The speeds in rad/s.
    ///
    /// # Errors
    /// There are none, or they do not increase.
    pub fn speeds(&self) -> Result<Vec<f64>> {
        speeds("losses", self.rpm.as_ref(), self.speed.as_ref())
    }
}
