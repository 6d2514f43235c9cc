//! Parameters of the DC link: their table and their limits.

use fmu_core::unit::{AMPERE, FARAD, HERTZ, OHM, VOLT};
use fmu_core::{Fault, Field, Row, Table, enumeration, table};
use serde::{Deserialize, Serialize};

enumeration! {
    /// Source of the link; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum DcSource("DcSource", "Source of the DC link") {
        1 Ideal "The voltage u_dc behind R_source, in both directions";
        2 Battery "The same, with the current kept between dc_link.i_min and dc_link.i_max";
        3 RectifierSingle "Diode rectifier on one phase of the amplitude u_dc: takes nothing back";
        4 RectifierThree "Diode rectifier on three phases of the line-to-line amplitude u_dc: takes nothing back";
    }
}

impl DcSource {
    /// Pulses of a rectifier in a period of the mains; none of a source of constant voltage.
    pub(super) fn pulses(self) -> Option<f64> {
        match self {
            Self::Ideal | Self::Battery => None,
            Self::RectifierSingle => Some(2.0),
            Self::RectifierThree => Some(6.0),
        }
    }
}

/// Capacitor and source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DcLink {
    /// The link is modeled; if false, the input sets the inverter's voltage.
    pub used: bool,
    /// Capacitance in F.
    pub C: f64,
    /// The source.
    pub source: DcSource,
    /// Resistance of the source in Ohm.
    pub R_source: f64,
    /// Maximum current out of the battery in A, > 0.
    pub i_max: f64,
    /// Minimum current of the battery in A, <= 0: into it.
    pub i_min: f64,
    /// Frequency of the mains in Hz.
    pub f_mains: f64,
    /// Resistance of the precharge in Ohm; 0: the capacitor is charged at the start.
    pub R_precharge: f64,
}

impl Default for DcLink {
    fn default() -> Self {
        let source = DcSource::Ideal;
        Self { used: false, C: 5e-4, source, R_source: 0.1, i_max: 20.0, i_min: -20.0, f_mains: 50.0, R_precharge: 0.0 }
    }
}

/// Maximum frequency of the mains in Hz.
const MAX_MAINS: f64 = 1000.0;

/// Brake chopper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chopper {
    /// The link has one.
    pub used: bool,
    /// Voltage in V at which it switches on.
    pub u_on: f64,
    /// Voltage in V at which it switches off.
    pub u_off: f64,
    /// Its resistance in Ohm.
    pub R: f64,
}

impl Default for Chopper {
    fn default() -> Self {
        Self { used: false, u_on: 360.0, u_off: 350.0, R: 50.0 }
    }
}

/// Parameters of the link.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinkParameters {
    /// Capacitor and source.
    pub dc_link: DcLink,
    /// Brake chopper.
    pub chopper: Chopper,
}

impl LinkParameters {
    /// Checks the parts in use, on a source of `u_dc` (V) at the start, or 0 later.
    ///
    /// # Errors
    /// States the variable, its value and the allowed range.
    pub fn validate(&self, u_dc: f64) -> Result<(), Fault> {
        let Self { dc_link, chopper } = self;
        let refuse = |get: fn(&mut Self) -> &mut f64, allowed: &str| Err(LINK.fault(self, get, allowed));
        if chopper.used && !dc_link.used {
            let link = LINK.tell(self, |p| &mut p.dc_link.used);
            return Err(LINK.fault(
                self,
                |p| &mut p.chopper.used,
                format!("false with {link}: it needs the capacitor"),
            ));
        }
        if !dc_link.used {
            return Ok(());
        }
        let is_above = |x: f64, bound: f64| x > bound;
        if !is_above(dc_link.C, 0.0) {
            return refuse(|p| &mut p.dc_link.C, "above 0 F; without a capacitor set dc_link.use to false");
        }
        if !is_above(dc_link.R_source, 0.0) {
            return refuse(|p| &mut p.dc_link.R_source, "above 0 Ohm; for an ideal source set dc_link.use to false");
        }
        if dc_link.R_precharge.is_nan() || dc_link.R_precharge < 0.0 {
            return refuse(|p| &mut p.dc_link.R_precharge, "at least 0 Ohm; 0: without a precharge");
        }
        if dc_link.source == DcSource::Battery && !is_above(dc_link.i_max, 0.0) {
            return refuse(|p| &mut p.dc_link.i_max, "above 0 A, the maximum current out of the battery");
        }
        if dc_link.source == DcSource::Battery && (dc_link.i_min.is_nan() || dc_link.i_min > 0.0) {
            return refuse(|p| &mut p.dc_link.i_min, "at most 0 A: a current into the battery is negative");
        }
        if dc_link.pulsates() && !(is_above(dc_link.f_mains, 0.0) && dc_link.f_mains <= MAX_MAINS) {
            return refuse(|p| &mut p.dc_link.f_mains, "above 0 Hz and at most 1000 Hz");
        }
        if !chopper.used {
            return Ok(());
        }
        if !is_above(chopper.R, 0.0) {
            return refuse(|p| &mut p.chopper.R, "above 0 Ohm");
        }
        let on = LINK.tell(self, |p| &mut p.chopper.u_on);
        if !is_above(chopper.u_off, u_dc) {
            let allowed =
                format!("above u_dc, {u_dc} V at the start, and below {on}: the source would supply the chopper");
            return Err(LINK.fault(self, |p| &mut p.chopper.u_off, allowed));
        }
        if !is_above(chopper.u_on, chopper.u_off) {
            return Err(LINK.fault(self, |p| &mut p.chopper.u_off, format!("below {on}")));
        }
        Ok(())
    }
}

type P = Row<LinkParameters>;

/// The link's parameters.
pub const LINK: &Table<LinkParameters> = table![
    P::boolean_parameter(
        "dc_link.use",
        "The drive contains its DC link, and u_dc is the voltage of the source; false: of inverter and controller",
        |p| &mut p.dc_link.used,
    ),
    P::parameter("dc_link.C", &FARAD, "Capacitance of the DC link", |p| &mut p.dc_link.C).nominal(1e-3),
    P::enumeration_parameter("dc_link.source", "Source of the DC link", &Field(|p| &mut p.dc_link.source)),
    P::parameter("dc_link.R_source", &OHM, "Resistance of the source of the DC link", |p| { &mut p.dc_link.R_source }),
    P::parameter("dc_link.i_max", &AMPERE, "Maximum current out of the battery", |p| &mut p.dc_link.i_max),
    P::parameter(
        "dc_link.i_min",
        &AMPERE,
        "Minimum current of the battery, negative into it; 0: takes nothing back",
        |p| { &mut p.dc_link.i_min }
    ),
    P::parameter("dc_link.f_mains", &HERTZ, "Frequency of the mains of a rectifier", |p| &mut p.dc_link.f_mains),
    P::parameter(
        "dc_link.R_precharge",
        &OHM,
        "Resistance in series with R_source while the capacitor charges from 0 V; 0: it is charged at the start",
        |p| &mut p.dc_link.R_precharge,
    ),
    P::boolean_parameter("chopper.use", "The DC link has a brake chopper; needs dc_link.use", |p| {
        &mut p.chopper.used
    }),
    P::parameter("chopper.u_on", &VOLT, "Voltage of the capacitor at which the chopper switches on", |p| {
        &mut p.chopper.u_on
    }),
    P::parameter("chopper.u_off", &VOLT, "Voltage of the capacitor at which the chopper switches off", |p| {
        &mut p.chopper.u_off
    }),
    P::parameter("chopper.R", &OHM, "Resistance of the brake chopper", |p| &mut p.chopper.R),
];
