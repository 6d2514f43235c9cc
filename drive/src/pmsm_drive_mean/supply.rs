//! The point of `PmsmDriveMean` on its DC link: the voltage depends on the power, and the power on the voltage.
//!
//! With p(u) the power of the inverter at the voltage u and U(p) the voltage of the [link](crate::dc_link) for that power, u =
//! U(p(u)). The fixed point is found by Steffensen's method from the voltage of the last point: p hardly depends on u below the
//! voltage limit, so two or three points are enough.

use super::{PmsmDriveMean, State};
use crate::dc_link::ripple::ripple;
use crate::dc_link::{LinkEnergy, LinkOutputs, SettledLink};
use crate::steady::{Condition, Diodes, Point};
use drive_base::frame::{Axis, Rotor};
use drive_plant::inverter::Gates;
use drive_plant::power::Powers;
use drive_plant::thermal::Temperatures;

/// Maximum number of rounds, and the relative change of the voltage at which they end.
const ROUNDS: u32 = 12;
const SMALL: f64 = 1e-11;
const SMALL_WITH_DIODES: f64 = 1e-7;

impl PmsmDriveMean {
    /// Whether the drive contains its DC link.
    #[inline]
    pub(super) fn linked(&self) -> bool {
        self.link_parameters.dc_link.used
    }

    /// The link with the power `p` (W) of the inverter.
    pub(super) fn link(&self, p: f64) -> SettledLink {
        self.link_parameters.settled(self.inputs.u_dc, p)
    }

    /// Voltage (V) of the inverter with the power `p` (W).
    #[inline]
    pub(super) fn voltage(&self, p: f64) -> f64 {
        if self.linked() { self.link(p).u } else { self.inputs.u_dc }
    }

    /// The point in this state on the link, at the temperatures `at` (K).
    pub(super) fn supplied(&self, state: &State, at: Temperatures) -> Point {
        let source = self.condition(state, at);
        let (mut diodes, off) = (self.diodes, self.bridge() == Gates::Off);
        let small = if off { SMALL_WITH_DIODES } else { SMALL };
        let mut of = |u_dc: f64| {
            let point = self.point_of(&self.under(&Condition { u_dc, ..source }), (state.tau, diodes));
            // The next voltage is near this one, and so is the current of the diodes.
            diodes = point.diodes.map_or(diodes, Diodes::Conducted);
            point
        };
        let next = |point: &Point| self.link(point.powers.p_in).u;
        let mut u = self.voltage(self.point.powers.p_in);
        let mut point = of(u);
        for _ in 0..ROUNDS {
            let first = next(&point);
            if (first - u).abs() <= small * first {
                break;
            }
            point = of(first);
            let second = next(&point);
            if (second - first).abs() <= small * second {
                break;
            }
            let bend = second - 2.0 * first + u;
            let step = if bend == 0.0 { 0.0 } else { (second - first) * (second - first) / bend };
            let sought = second - step;
            // Far from the solution, the plain iteration stays within what the link can have.
            u = if sought > 0.5 * source.u_dc && sought < 2.0 * second { sought } else { second };
            point = of(u);
        }
        point
    }

    /// Powers (W) from the source, into its resistance and into the chopper, with the power `p` (W) of the inverter.
    pub(super) fn link_powers(&self, p: f64) -> LinkEnergy {
        if !self.linked() {
            return LinkEnergy::default();
        }
        let SettledLink { p_chopper, p_resistor, i_source, overloaded, .. } = self.link(p);
        // A rectifier takes nothing back, even if nothing else takes the power.
        let source = if overloaded && i_source == 0.0 { 0.0 } else { p + p_resistor + p_chopper };
        LinkEnergy { source, resistor: p_resistor, chopper: p_chopper }
    }

    /// The outputs of the link with the `point` and its `powers`.
    pub(super) fn link_outputs(&self, point: &Point, powers: &Powers, axis: &Axis<Rotor>) -> LinkOutputs {
        if !self.linked() {
            // The energies are states, and keep a value that is set.
            return LinkOutputs { i_source: powers.i_dc, energy: self.link_energy, ..LinkOutputs::none() };
        }
        let SettledLink { u, i_source, p_chopper, .. } = self.link(powers.p_in);
        LinkOutputs {
            u,
            i_source,
            p_chopper,
            i_rms: ripple(axis.to_stator(point.u), axis.to_stator(point.i), powers.p_in, u),
            chops: p_chopper > 0.0,
            energy: self.link_energy,
            ..LinkOutputs::none()
        }
    }
}
