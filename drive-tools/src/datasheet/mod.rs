//! The values of `MappedDrive` for a drive that a data sheet describes: torque over speed, losses over speed and torque.
//!
//! [`mod@file`] reads the data sheet, [`losses`] brings its table of losses or efficiencies into one form, [`columns`] the map of
//! `fmu map`, and [`reduce`] chooses the speeds of the tables.
//! `plausible` refuses values in another unit.

pub mod column;
pub mod columns;
pub mod file;
pub mod losses;
mod plausible;
pub mod reduce;
pub mod remarks;

use crate::error::Result;
use crate::tune::setting::Value;
use drive::mapped_drive::map::Map;
use file::DataSheet;
use remarks::Remarks;
use serde_json::json;
use std::path::Path;

/// The drive of a data sheet.
#[derive(Clone, Debug)]
pub struct MappedSheet {
    /// Name, for files.
    pub name: String,
    /// Source of the values.
    pub source: String,
    /// The tables.
    pub map: Map,
    /// Moment of inertia in kg.m2.
    pub J: f64,
    /// Bandwidth of the torque in rad/s.
    pub bandwidth: f64,
    /// Assumptions about what the data sheet does not say.
    pub notes: Vec<String>,
    /// Values that may be wrong.
    pub doubts: Vec<String>,
}

/// The drive of the data sheet at `path`.
///
/// # Errors
/// The file cannot be read, or a value is wrong; the message names the file, the value and what is allowed.
pub fn read(path: &Path) -> Result<MappedSheet> {
    let sheet = DataSheet::read(path)?;
    let of_map = sheet.data.torque.is_none();
    if !of_map {
        plausible::check(&sheet, None)?;
    }
    let (columns, Remarks { notes, doubts }) = columns::of(&sheet)?;
    if of_map {
        let top = columns.iter().map(|column| column.speed).fold(0.0, f64::max);
        plausible::check(&sheet, Some([top, columns.iter().map(|column| column.peak[0]).fold(0.0, f64::max)]))?;
    }
    let t_overload = sheet.t_overload(&columns)?;
    let chosen = reduce::reduce(&columns);
    let mut map = Map { u_dc: sheet.data.dc_link.u_dc, t_overload, ..Map::default() };
    let [u_min, u_max] = sheet.voltages();
    (map.u_min, map.u_max) = (u_min, u_max);
    for (k, column) in chosen.iter().enumerate() {
        map.speed[k] = column.speed;
        [map.tau_motor[k], map.tau_generator[k]] = column.peak;
        (map.tau_continuous[k], map.tau_drag[k], map.p_loss[k]) = (column.continuous, column.drag, column.losses);
    }
    Ok(MappedSheet {
        name: sheet.data.name.clone(),
        source: sheet.data.source.clone(),
        map,
        J: sheet.data.mechanics.J,
        bandwidth: sheet.data.bandwidth.torque,
        notes,
        doubts,
    })
}

impl MappedSheet {
    /// The values of `MappedDrive`.
    pub fn values(&self) -> Vec<(&'static str, Value)> {
        let Map { u_dc, u_min, u_max, speed, tau_motor, tau_generator, tau_continuous, tau_drag, p_loss, t_overload } =
            &self.map;
        let reals = |values: &[f64]| Value::Reals(values.to_vec());
        vec![
            ("u_dc", Value::Real(*u_dc)),
            ("map.u_dc", Value::Real(*u_dc)),
            ("map.u_min", Value::Real(*u_min)),
            ("map.u_max", Value::Real(*u_max)),
            ("map.speed", reals(speed)),
            ("map.tau_motor", reals(tau_motor)),
            ("map.tau_generator", reals(tau_generator)),
            ("map.tau_continuous", reals(tau_continuous)),
            ("map.tau_drag", reals(tau_drag)),
            ("map.p_loss", reals(p_loss.as_flattened())),
            ("map.t_overload", Value::Real(*t_overload)),
            ("plant.mechanics.J", Value::Real(self.J)),
            ("controller.current.bandwidth", Value::Real(self.bandwidth)),
        ]
    }
}

/// The values of `MappedDrive` for the data sheet at `path`, as JSON, and its doubts.
///
/// # Errors
/// Those of [`read`].
pub fn values(path: &Path) -> Result<(serde_json::Value, Vec<String>)> {
    let mut all = serde_json::Map::new();
    let sheet = read(path)?;
    for (name, value) in sheet.values() {
        let value = match value {
            Value::Real(x) => json!(x),
            Value::Reals(all) => json!(all),
            Value::Integer(i) => json!(i),
            Value::Boolean(b) => json!(b),
            Value::Item(item) => json!(item),
        };
        all.insert(name.into(), value);
    }
    Ok((all.into(), sheet.doubts))
}
