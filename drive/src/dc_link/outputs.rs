//! Outputs of the link, and their table.

use super::circuit::LinkEnergy;
use fmu_core::unit::{AMPERE, JOULE, VOLT, WATT};
use fmu_core::{Dual, Row, Scalar, Table, table};
use serde::{Deserialize, Serialize};

/// Outputs of the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinkOutputs<S = f64> {
    /// Voltage of the capacitor in V.
    pub u: S,
    /// Current from the source in A.
    pub i_source: S,
    /// Power of the chopper in W.
    pub p_chopper: S,
    /// Ripple current of the capacitor in A (rms).
    pub i_rms: S,
    /// The capacitor charges through the resistance of the precharge.
    pub precharges: bool,
    /// The chopper is on.
    pub chops: bool,
    /// Energies since the start.
    pub energy: LinkEnergy,
}

impl<S: Scalar> LinkOutputs<S> {
    /// Outputs without a link.
    pub fn none() -> Self {
        let none = S::from(0.0);
        let energy = LinkEnergy::default();
        Self { u: none, i_source: none, p_chopper: none, i_rms: none, precharges: false, chops: false, energy }
    }
}

impl LinkOutputs<Dual> {
    /// The change of the outputs; energies and switching states do not change.
    pub fn change(&self) -> LinkOutputs {
        let &Self { u, i_source, p_chopper, i_rms, .. } = self;
        let [u, i_source, p_chopper, i_rms] = [u, i_source, p_chopper, i_rms].map(|x| x.change);
        LinkOutputs { u, i_source, p_chopper, i_rms, ..LinkOutputs::none() }
    }
}

type O = Row<LinkOutputs>;

/// The link's outputs.
pub const LINK_OUTPUTS: &Table<LinkOutputs> = table![
            O::output("u_cap", &VOLT, "Voltage of the DC-link capacitor, which is a state; 0 without dc_link.use", |o| {
                &mut o.u
            })
            .nominal(100.0),
            O::output(
                "i_source",
                &AMPERE,
                "Current from the source of the DC link, mean over the last communication step (Model Exchange: at the instant); \
                 without dc_link.use as i_dc",
                |o| &mut o.i_source,
            )
            .mean(),
            O::output(
                "p_chopper",
                &WATT,
                "Power of the brake chopper, mean over the last communication step (Model Exchange: at the instant)",
                |o| &mut o.p_chopper,
            )
            .mean(),
            O::output(
                "i_cap_rms",
                &AMPERE,
                "Ripple current of the DC-link capacitor (rms), from currents and modulation at the instant; 0 without dc_link.use",
                |o| &mut o.i_rms,
            ),
            O::output(
                "energy_source",
                &JOULE,
                "Energy from the source of the DC link since the start; 0 without dc_link.use; in Model Exchange as energy_in",
                |o| &mut o.energy.source,
            ),
            O::output(
                "energy_resistor",
                &JOULE,
                "Energy lost in R_source, R_precharge and the limiter of a battery since the start; in Model Exchange as energy_in",
                |o| &mut o.energy.resistor,
            ),
            O::output(
                "energy_chopper",
                &JOULE,
                "Energy lost in the brake chopper since the start; in Model Exchange as energy_in",
                |o| &mut o.energy.chopper,
            ),
            O::boolean_output("precharging", "The capacitor charges through R_precharge; the controller rests", |o| {
                &mut o.precharges
            }),
            O::boolean_output("chopper_on", "The brake chopper conducts", |o| &mut o.chops),
        ];
