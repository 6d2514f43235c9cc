//! The source of the DC link.
//!
//! ```text
//! Ideal       U = u_dc                    i = (U - u) / R
//! Battery     U = u_dc                    the same, limited to i_min..i_max
//! Rectifier   U = u_dc cos(2 pi f tau)    the same, at least 0
//! ```
//!
//! tau is the time to the nearest peak: a rectifier has 2 pulses per period of the mains on one phase and 6 on three. u_dc is the
//! amplitude of its phase or line-to-line voltage, so the unloaded capacitor has u_dc. A battery at a limit is a source of constant
//! current; U - u is lost in its limiter. The mains have no inductance besides R, and the diodes no threshold.
//!
//! In Co-Simulation U is constant over a part of a pulse. U, u in V, i in A, R in Ohm, f in Hz, times in s.

use super::parameters::{DcLink, DcSource};
use drive_base::math::sin_cos;
use std::f64::consts::TAU;

/// Parts of a pulse in which U is constant.
const PARTS: f64 = 64.0;

/// Maximum number of parts of an interval.
const MAX_PARTS: f64 = 1000.0;

/// How the source supplies the capacitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flow {
    /// Through its resistance.
    Free,
    /// The diodes of the rectifier block.
    Blocked,
    /// With the maximum current of the battery.
    Maximum,
    /// With the minimum current of the battery.
    Minimum,
}

impl DcLink {
    /// How a source of `U` (V) behind `R` (Ohm) supplies a capacitor of `u` (V).
    #[inline]
    pub(super) fn flow(&self, R: f64, u: f64, U: f64) -> Flow {
        match self.source {
            DcSource::Battery if U - u > R * self.i_max => Flow::Maximum,
            DcSource::Battery if U - u < R * self.i_min => Flow::Minimum,
            DcSource::RectifierSingle | DcSource::RectifierThree if u >= U => Flow::Blocked,
            DcSource::Ideal | DcSource::Battery | DcSource::RectifierSingle | DcSource::RectifierThree => Flow::Free,
        }
    }

    /// The voltage of the source at the time `t` (s) since the start, divided by its amplitude.
    #[inline]
    pub(crate) fn wave(&self, t: f64) -> f64 {
        let Some(pulses) = self.source.pulses() else { return 1.0 };
        let passed = pulses * self.f_mains * t;
        sin_cos(TAU / pulses * (passed - passed.round())).1
    }

    /// Number of parts of an interval of `h` (s) in which U is constant.
    #[inline]
    pub(super) fn parts(&self, h: f64) -> f64 {
        self.source
            .pulses()
            .map_or(1.0, |pulses| (h * pulses * self.f_mains * PARTS * (1.0 - 1e-9)).ceil().clamp(1.0, MAX_PARTS))
    }

    /// Whether the source is a rectifier.
    pub(crate) fn pulsates(&self) -> bool {
        self.source.pulses().is_some()
    }

    /// Length in s of a pulse of the rectifier.
    pub(super) fn pulse(&self) -> Option<f64> {
        self.source.pulses().map(|pulses| 1.0 / (pulses * self.f_mains))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on(source: DcSource) -> DcLink {
        DcLink { source, ..DcLink::default() }
    }

    /// Against |cos| and the maximum of the six line-to-line voltages.
    #[test]
    fn the_rectified_voltage_is_the_envelope_of_its_phases() {
        for k in 0..1000 {
            let t = 0.1237e-3 * f64::from(k);
            let x = TAU * 50.0 * t;
            let lines = (0..6).map(|n| (x - TAU / 6.0 * f64::from(n)).cos()).fold(0.0, f64::max);
            assert!((on(DcSource::RectifierSingle).wave(t) - x.cos().abs()).abs() < 1e-9, "{t} s");
            assert!((on(DcSource::RectifierThree).wave(t) - lines).abs() < 1e-9, "{t} s");
            assert!((on(DcSource::Battery).wave(t) - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn a_battery_has_limits_and_a_rectifier_takes_nothing_back() {
        let of = |source, u| on(source).flow(0.1, u, 400.0);
        for (u, battery, rectifier) in [
            (397.9, Flow::Maximum, Flow::Free),
            (398.1, Flow::Free, Flow::Free),
            (401.9, Flow::Free, Flow::Blocked),
            (402.1, Flow::Minimum, Flow::Blocked),
        ] {
            assert_eq!(
                [DcSource::Battery, DcSource::RectifierSingle, DcSource::RectifierThree].map(|source| of(source, u)),
                [battery, rectifier, rectifier]
            );
            assert_eq!(of(DcSource::Ideal, u), Flow::Free);
        }
    }
}
