//! Legs and devices while each current stays on its side, with at least one inside the zone +-`inverter.i_zero`.
//!
//! The sign of each current, by which dead time and thresholds act, is then affine in the current:
//!
//! ```text
//! u = u_ref - u_dead sign(i)          sign = i / i_zero inside, 1 above, -1 below
//! ```
//!
//! This is [`Switches`] without limits and divisions. The two differ only beyond an edge, where the step ends. A zone that follows
//! from the ripple has further kinks inside, so it has no such form.

use crate::losses::conduction::{Affine, Conduction, symmetric};
use crate::losses::flow::{Drops, Switches};
use crate::losses::sides::{Sides, phases};
use crate::losses::switching;
use drive_base::frame::{AlphaBeta, Phases};

/// A sign of each leg's current, affine in it.
#[derive(Clone, Copy, Debug)]
struct Signs {
    at_0: Phases,
    /// Per ampere.
    slope: Phases,
}

impl Signs {
    /// The signs of currents on these `sides` of the zone +-`zone` (A).
    fn of(sides: [i8; 3], zone: f64) -> Self {
        let [a, b, c] = sides.map(|side| if side == 0 { 1.0 / zone } else { 0.0 });
        Self { at_0: phases(sides), slope: Phases { a, b, c } }
    }

    #[inline]
    fn at(&self, i: Phases) -> Phases {
        let Self { at_0, slope } = self;
        Phases { a: at_0.a + slope.a * i.a, b: at_0.b + slope.b * i.b, c: at_0.c + slope.c * i.c }
    }
}

/// Legs and devices while the currents keep their sides.
#[derive(Clone, Copy, Debug)]
pub struct InZone {
    /// Voltage of the legs with dead time in V, at the current in steady state.
    u: Affine,
    conduction: Option<Conduction<f64>>,
    /// The signs of the currents that determine the drop of the devices.
    signs: Signs,
    /// Switching loss in W per ampere.
    sw: f64,
}

impl Switches {
    /// These legs and devices under the voltage `u` (V) while the currents keep their `sides`; `None` if the zone follows from the
    /// ripple.
    pub fn in_zone(&self, u: AlphaBeta, sides: &Sides) -> Option<InZone> {
        let Self { legs, conduction, sw } = *self;
        if legs.is_rippled() {
            return None;
        }
        let [dead_time, devices] = sides.legs().map(|sides| Signs::of(sides, legs.i_zone()));
        let by = symmetric(dead_time.slope).map(|slope| -slope * legs.u_dead());
        Some(InZone { u: Affine { at_0: u - legs.loss_beyond(dead_time.at_0), by }, conduction, signs: devices, sw })
    }
}

impl Drops<f64> for InZone {
    #[inline]
    fn legs(&self, _u: AlphaBeta, steady: impl FnOnce() -> AlphaBeta) -> AlphaBeta {
        self.u.at(steady())
    }

    #[inline]
    fn devices(&self, u: AlphaBeta, i: AlphaBeta) -> Option<AlphaBeta> {
        let i = Phases::from_stator(i);
        self.conduction.map(|conduction| conduction.drop_with(u, i, self.signs.at(i)))
    }

    #[inline]
    fn switching(&self, i: AlphaBeta) -> Option<f64> {
        Some(switching::magnitudes(i) * self.sw)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverter::Gates;
    use crate::legs::Legs;
    use crate::losses::conduction::Devices;
    use crate::losses::flow::Path;
    use crate::losses::sides::tests::{assert_near, lossy};

    #[test]
    fn on_their_sides_the_currents_have_the_voltages_of_the_switches() {
        let mut par = lossy();
        par.inverter.i_zero = 0.5;
        let devices = par.inverter.devices.clone();
        let (u, w) = (AlphaBeta::new(70.0, -90.0), 300.0);
        let dissipation = par.dissipation(2.0, w);
        let mut inside = [0; 4];
        for (dead_time, devices) in [(2e-6, devices.clone()), (2e-6, Devices::default()), (0.0, devices)] {
            (par.inverter.dead_time, par.inverter.devices) = (dead_time, devices);
            let switches = Switches::new(&par.inverter, Gates::Switch, 325.0, Legs::switching(&par.inverter, 325.0));
            for k in 0..40_u32 {
                let (angle, magnitude) = (0.37 * f64::from(k), 0.04 * f64::from(k));
                let i = AlphaBeta::new(magnitude * angle.cos(), magnitude * angle.sin());
                let wanted = Path { u, dissipation, drops: switches };
                let sides = Sides::of(wanted.guides(AlphaBeta::ZERO, i, w), 0.5);
                inside[sides.legs()[0].iter().filter(|&&side| side == 0).count()] += 1;
                let drops = switches.in_zone(u, &sides).unwrap();
                let got = Path { u, dissipation, drops }.flow(AlphaBeta::ZERO, i, w);
                assert_near(&got, &wanted.flow(AlphaBeta::ZERO, i, w), i);
            }
        }
        assert!(inside.iter().all(|&count| count > 4), "legs inside the zone: {inside:?}");
        // A zone that follows from the ripple has kinks inside.
        let rippled = Legs::rippled(&par.inverter, Phases::from_stator(u), 325.0, 100.0);
        let switches = Switches::new(&par.inverter, Gates::Switch, 325.0, rippled);
        assert!(switches.in_zone(u, &Sides::default()).is_none());
    }
}
