//! Parameters of the DC link: their table and their limits.

use fmu_core::unit::{FARAD, OHM, VOLT};
use fmu_core::{Fault, Row, Table, table};
use serde::{Deserialize, Serialize};

/// Capacitor and source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DcLink {
    /// The link is modeled; if false, the input sets the inverter's voltage.
    pub used: bool,
    /// Capacitance in F.
    pub C: f64,
    /// Resistance of the source in Ohm.
    pub R_source: f64,
    /// Resistance of the precharge in Ohm; 0: the capacitor is charged at the start.
    pub R_precharge: f64,
}

impl Default for DcLink {
    fn default() -> Self {
        Self { used: false, C: 5e-4, R_source: 0.1, R_precharge: 0.0 }
    }
}

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
    P::parameter("dc_link.R_source", &OHM, "Resistance of the source of the DC link", |p| { &mut p.dc_link.R_source }),
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
