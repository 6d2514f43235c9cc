//! Refuses implausible values, which are mostly values in another unit: 36 H for 36 mH, rpm for rad/s, g.cm2 for
//! kg.m2.
//!
//! Each check forms a ratio of the value to others in the file, and states the range of this ratio for real machines. The value
//! to correct may be another one of the ratio: the error names the one that, converted from another unit, brings all ratios into
//! their ranges.

use crate::error::{Result, bail};
use fmu_core::digits::rounded;
use std::f64::consts::PI;

/// Other units in which a value may have been written, with their size in the expected unit.
pub(crate) type Units = &'static [(&'static str, f64)];

pub(crate) const SPEED: Units = &[("rpm", PI / 30.0), ("deg/s", PI / 180.0)];
pub(crate) const VOLTAGE: Units = &[("kV", 1e3), ("mV", 1e-3)];
pub(crate) const CURRENT: Units = &[("mA", 1e-3), ("kA", 1e3)];
pub(crate) const RESISTANCE: Units = &[("mOhm", 1e-3), ("uOhm", 1e-6)];
pub(crate) const INDUCTANCE: Units = &[("mH", 1e-3), ("uH", 1e-6)];
pub(crate) const FLUX_LINKAGE: Units = &[("mWb", 1e-3), ("uWb", 1e-6)];
pub(crate) const TORQUE: Units = &[("mN.m", 1e-3), ("N.cm", 1e-2), ("kN.m", 1e3)];
pub(crate) const INERTIA: Units = &[("kg.cm2", 1e-4), ("g.cm2", 1e-7), ("g.m2", 1e-3)];
pub(crate) const ENERGY: Units = &[("mJ", 1e-3), ("uJ", 1e-6)];
pub(crate) const FRICTION: Units = &[("mN.m.s/rad", 1e-3), ("N.m.s/deg", 180.0 / PI), ("N.m/rpm", 30.0 / PI)];
pub(crate) const POWER: Units = &[("kW", 1e3), ("mW", 1e-3)];
pub(crate) const FREQUENCY: Units = &[("kHz", 1e3), ("MHz", 1e6)];
pub(crate) const TIME: Units = &[("ms", 1e-3), ("us", 1e-6)];
pub(crate) const PER_KELVIN: Units = &[("%/K", 1e-2), ("ppm/K", 1e-6)];

/// Advice if nothing more precise is known.
pub(crate) const CORRECT: &str = "correct it, or the values it is compared with";

/// Multiplies a value of the file content `D`.
pub(crate) type Convert<D> = Box<dyn Fn(&mut D, f64)>;

/// A value of the file content `D`, and the ratio that shows whether it is plausible.
pub(crate) struct Check<D> {
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) units: Units,
    /// Multiplies the value in the data, and those written with it.
    pub(crate) convert: Convert<D>,
    pub(crate) value: f64,
    /// Offset of the value in the file, where it is known.
    pub(crate) at: Option<usize>,
    /// The ratio per unit of the value; it is proportional to the value.
    pub(crate) per_unit: f64,
    pub(crate) what: &'static str,
    pub(crate) range: (f64, f64),
    /// The usual range; a value converted from another unit must lie within it.
    pub(crate) usual: (f64, f64),
    /// Advice if no other unit fits.
    pub(crate) remedy: String,
}

impl<D: Clone> Check<D> {
    fn ratio(&self) -> f64 {
        self.value * self.per_unit
    }

    fn passes(&self) -> bool {
        // Without the values it is compared with, there is no ratio; a negative value is refused by the parameter's own range.
        let (ratio, (low, high)) = (self.ratio(), self.range);
        ratio.is_nan() || (low == 0.0 && ratio < 0.0) || (low..=high).contains(&ratio)
    }

    /// Whether the value, in a unit of this `size`, is a usual one.
    fn fits(&self, size: f64) -> bool {
        (self.usual.0..=self.usual.1).contains(&(self.ratio() * size))
    }

    /// Whether all values are plausible once this one is converted from a unit of this `size`.
    fn cures(&self, size: f64, data: &D, checks: &dyn Fn(&D) -> Vec<Self>) -> bool {
        let mut data = data.clone();
        (self.convert)(&mut data, size);
        self.fits(size) && checks(&data).iter().all(Self::passes)
    }

    /// The first other unit with this property, and the converted value.
    fn written_in(&self, fits: impl Fn(f64) -> bool) -> Option<String> {
        let &Self { value, unit, .. } = self;
        let (other, size) = self.units.iter().find(|(_, size)| fits(*size))?;
        Some(format!("{} {other} would fit: write {} {unit}", rounded(value, 6), rounded(value * size, 4)))
    }

    #[must_use]
    pub(crate) fn usual(self, low: f64, high: f64) -> Self {
        Self { usual: (low, high), ..self }
    }

    #[must_use]
    pub(crate) fn remedy(self, remedy: impl Into<String>) -> Self {
        Self { remedy: remedy.into(), ..self }
    }
}

/// Checks the values of `data` by `checks`; `place` names the place of an offset in the file.
///
/// # Errors
/// The first value that is out of its range: the value, the expected range, and a unit that would fit.
pub(crate) fn check<D: Clone>(
    data: &D,
    checks: &dyn Fn(&D) -> Vec<Check<D>>,
    place: &dyn Fn(usize) -> String,
) -> Result<()> {
    let all = checks(data);
    let Some(failed) = all.iter().find(|check| !check.passes()) else { return Ok(()) };
    let &Check { name, value, unit, what, range: (low, high), ref remedy, .. } = failed;
    let cure = |check: &Check<D>| check.written_in(|size| check.cures(size, data, checks));
    let placed = |check: &Check<D>| check.at.map_or_else(String::new, |at| format!("{}: ", place(at)));
    // Another value, if it is the only one.
    let other = || {
        let mut found = all.iter().filter_map(|check| Some((check, cure(check)?)));
        let (check, suggestion) = found.next()?;
        found
            .all(|(other, _)| other.name == check.name)
            .then(|| format!("{}: {}{suggestion}", check.name, placed(check)))
    };
    let suggestion = cure(failed).or_else(other).or_else(|| failed.written_in(|size| failed.fits(size)));
    bail!(
        "{}{name} = {} makes {what} {}, expected {low} to {high}: {}",
        placed(failed),
        format!("{} {unit}", rounded(value, 6)).trim_end(),
        rounded(failed.ratio(), 4),
        suggestion.as_ref().unwrap_or(remedy)
    )
}
