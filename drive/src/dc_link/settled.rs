//! The DC link in steady state, for `PmsmDriveMean`: the capacitor's voltage for a power of the inverter, without its charging.
//!
//! ```text
//! (U - u) / R = p / u + p_chopper / u                 u = (U + sqrt(U^2 - 4 R p)) / 2 without the chopper
//! u_c: the same with the chopper's resistance, always on
//! u_m = (u_on + u_off) / 2, the mean voltage of a chopper that switches
//! ```
//!
//! The chopper keeps u at u_m where it would be higher without it, and is always on where that does not suffice: u = max(u_c,
//! u_m). A chopper in `PmsmDrive` begins at u_on and keeps the voltage between u_off and u_on; in between, it may be on or off.
//! No voltage supplies p > U^2 / (4 R); u is then U / 2, and the drive reports it. Derived here. u in V, p in W, R in Ohm.
//!
//! A battery at its minimum current leaves the rest to the chopper; beyond its maximum, or without a chopper, there is no steady state.
//! A rectifier has the periodic solution of the link for a constant power; u is its mean.

use super::parameters::{Chopper, DcLink, DcSource, LinkParameters};
use drive_base::math::exp;

/// The link with a constant power of the inverter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SettledLink {
    /// Voltage of the capacitor in V.
    pub(crate) u: f64,
    /// Current from the source in A.
    pub(crate) i_source: f64,
    /// Power of the chopper in W.
    pub(crate) p_chopper: f64,
    /// Power lost between source and capacitor in W.
    pub(crate) p_resistor: f64,
    /// Whether the source cannot supply or take the power at any voltage.
    pub(crate) overloaded: bool,
}

/// Intervals of a pulse, in which the voltage of the source is constant; maximum number of rounds to the periodic solution, and its
/// relative accuracy.
const INTERVALS: usize = 64;
const SHARE: f64 = 1.0 / 64.0;
const MAX_ROUNDS: u32 = 100;
const PERIODIC: f64 = 1e-9;

/// A pulse of a rectifier: voltage (V) at its end and its mean, charge (C) and energy (J) of the source.
struct Pulse {
    end: f64,
    mean: f64,
    charge: f64,
    energy: f64,
}

impl DcLink {
    /// The pulse that ends at the voltage at which it begins, by the Illinois method; `None` if there is none.
    fn periodic(&self, amplitude: f64, p: f64, pulse: f64, waves: &[f64; INTERVALS]) -> Option<Pulse> {
        let change = |u: f64| self.over_a_pulse(u, p, pulse, waves).map(|pulse| (pulse.end - u, pulse));
        let (mut low, mut high, mut rose) = (0.5 * amplitude, amplitude, None);
        let ((mut rises, _), (mut falls, _)) = (change(low)?, change(high)?);
        if rises <= 0.0 {
            return None;
        }
        for _ in 0..MAX_ROUNDS {
            let u = (low * falls - high * rises) / (falls - rises);
            let (by, found) = change(u)?;
            if by.abs() <= PERIODIC * amplitude {
                return Some(found);
            }
            // An end that stays twice counts half.
            if by > 0.0 {
                falls *= if rose == Some(true) { 0.5 } else { 1.0 };
                (low, rises) = (u, by);
            } else {
                rises *= if rose == Some(false) { 0.5 } else { 1.0 };
                (high, falls) = (u, by);
            }
            rose = Some(by > 0.0);
        }
        None
    }

    /// From the voltage `u` (V), over a `pulse` (s) with the `waves` (V) of the source and the power `p` (W) > 0 of the inverter; `None`
    /// if the voltage collapses.
    fn over_a_pulse(&self, mut u: f64, p: f64, pulse: f64, waves: &[f64; INTERVALS]) -> Option<Pulse> {
        let (C, R, h) = (self.C, self.R_source, pulse * SHARE);
        let whole = exp(-h / (R * C));
        let (mut mean, mut charge, mut energy) = (0.0, 0.0, 0.0);
        for &U in waves {
            let (first, i, mut left) = (u, p / u, h);
            if u >= U {
                // The diodes block until the inverter has discharged the capacitor to U.
                let blocked = ((u - U) * C / i).min(h);
                u -= i * blocked / C;
                left -= blocked;
            }
            if left > 0.0 {
                let settled = U - R * i;
                let decay = if left < h { exp(-left / (R * C)) } else { whole };
                let next = settled + (u - settled) * decay;
                let supplied = C * (next - u) + i * left;
                (u, charge, energy) = (next, charge + supplied, energy + U * supplied);
            }
            if u.is_nan() || u <= 0.0 {
                return None;
            }
            mean += 0.5 * (first + u) * SHARE;
        }
        Some(Pulse { end: u, mean, charge, energy })
    }
}

impl LinkParameters {
    /// The link on a source of `U` (V) with the power `p` (W) of the inverter.
    pub(crate) fn settled(&self, U: f64, p: f64) -> SettledLink {
        match self.dc_link.source {
            DcSource::Ideal => self.settled_freely(U, p),
            DcSource::Battery => self.settled_within(U, p),
            DcSource::RectifierSingle | DcSource::RectifierThree => self.rectified(U, p),
        }
    }

    /// Why there is no steady state on a source of `U` (V) with the power `p` (W).
    pub(crate) fn lack(&self, U: f64, p: f64) -> String {
        let (source, R) = (self.dc_link.source, self.dc_link.R_source);
        if p < 0.0 && source != DcSource::Ideal {
            return format!(
                "the machine feeds {:.0} W into the DC link, which neither dc_link.source ({}) nor a chopper takes: the voltage would \
                 rise; set chopper.use, or controller.limit.i_dc_use with controller.limit.i_dc_min",
                -p,
                source.name()
            );
        }
        let (most, closed) = match source {
            DcSource::Battery if 2.0 * R * self.dc_link.i_max < U => {
                (self.dc_link.i_max * (U - R * self.dc_link.i_max), "with its limit dc_link.i_max ")
            }
            DcSource::RectifierSingle | DcSource::RectifierThree => {
                return format!(
                    "the rectifier cannot supply the {p:.0} W of the drive: the voltage would collapse; lower dc_link.R_source or the \
                     torque, or set controller.limit.i_dc_max"
                );
            }
            _ => (U * U / (4.0 * R), "u_dc^2 / (4 R_source) = "),
        };
        format!(
            "the source of the DC link gives at most {closed}{most:.0} W, and the drive takes {p:.0} W: the voltage would collapse; lower \
             dc_link.R_source or the torque, or set controller.limit.i_dc_max"
        )
    }

    /// With a battery, whose current has limits.
    fn settled_within(&self, U: f64, p: f64) -> SettledLink {
        let (free, dc_link) = (self.settled_freely(U, p), &self.dc_link);
        let i = if free.i_source > dc_link.i_max {
            dc_link.i_max
        } else if free.i_source < dc_link.i_min {
            dc_link.i_min
        } else {
            return free;
        };
        self.fed(U, p, i).unwrap_or_else(|| {
            let u = U - dc_link.R_source * i;
            SettledLink { u, i_source: i, p_chopper: 0.0, p_resistor: (U - u) * i, overloaded: true }
        })
    }

    /// With the constant current `i` (A) <= 0 of the source and a chopper that takes the rest, if there is one.
    fn fed(&self, U: f64, p: f64, i: f64) -> Option<SettledLink> {
        let Chopper { used, u_on, u_off, R } = self.chopper;
        if !used || i > 0.0 {
            return None;
        }
        // Always on: u^2 / R = i u - p.
        let on = 0.5 * R * (i + (i * i - 4.0 * p / R).max(0.0).sqrt());
        let u = on.max(0.5 * (u_on + u_off));
        Some(SettledLink { u, i_source: i, p_chopper: i * u - p, p_resistor: (U - u) * i, overloaded: false })
    }

    /// With a rectifier on an amplitude of `U` (V).
    fn rectified(&self, U: f64, p: f64) -> SettledLink {
        let Some(pulse) = self.dc_link.pulse() else { return SettledLink::default() };
        if !(p > 0.0 && U > 0.0) {
            let idle = SettledLink { u: U, overloaded: p != 0.0, ..SettledLink::default() };
            return if p < 0.0 { self.fed(U, p, 0.0).unwrap_or(idle) } else { idle };
        }
        let R = self.dc_link.R_source;
        if p > U * U / (4.0 * R) {
            let i_source = 0.5 * U / R;
            return SettledLink {
                u: 0.5 * U,
                i_source,
                p_chopper: 0.0,
                p_resistor: 0.5 * U * i_source,
                overloaded: true,
            };
        }
        let mut middle = -0.5 * SHARE * pulse;
        let waves = std::array::from_fn(|_| {
            middle += SHARE * pulse;
            U * self.dc_link.wave(middle)
        });
        let found = self.dc_link.periodic(U, p, pulse, &waves);
        found.map_or(
            SettledLink { u: 0.5 * U, i_source: p / U, overloaded: true, ..SettledLink::default() },
            |Pulse { mean, charge, energy, .. }| {
                let [i_source, supplied] = [charge / pulse, energy / pulse];
                SettledLink { u: mean, i_source, p_chopper: 0.0, p_resistor: supplied - p, overloaded: false }
            },
        )
    }

    /// With a source that has no limits.
    fn settled_freely(&self, U: f64, p: f64) -> SettledLink {
        let R = self.dc_link.R_source;
        let square = U * U - 4.0 * R * p;
        let free = 0.5 * (U + square.max(0.0).sqrt());
        let Chopper { used, u_on, u_off, R: of_chopper } = self.chopper;
        let held = 0.5 * (u_on + u_off);
        let u = if used && free > held {
            let (source, all) = (1.0 / R, 1.0 / R + 1.0 / of_chopper);
            let on = 0.5 * (U * source + (U * U * source * source - 4.0 * all * p).max(0.0).sqrt()) / all;
            on.max(held)
        } else {
            free
        };
        let i_source = (U - u) / R;
        let p_chopper = if used && free > held { u * i_source - p } else { 0.0 };
        SettledLink { u, i_source, p_chopper, p_resistor: i_source * i_source * R, overloaded: square < 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(chopper: bool) -> LinkParameters {
        LinkParameters {
            dc_link: DcLink { used: true, R_source: 2.0, ..DcLink::default() },
            chopper: Chopper { used: chopper, u_on: 420.0, u_off: 410.0, R: 40.0 },
        }
    }

    /// The power p_source = u_source i_source is balanced with the rest; a battery has U i_source.
    #[test]
    fn a_battery_beyond_its_limits_leaves_the_rest_to_the_chopper() {
        let on = |chopper| {
            let mut par = link(chopper);
            (par.dc_link.source, par.dc_link.i_max, par.dc_link.i_min) = (DcSource::Battery, 10.0, -5.0);
            par
        };
        for (p, u, i) in [(3e3, 384.396, 7.802), (-1.5e3, 407.36, -3.68), (-4e3, 415.0, -5.0), (-9e3, 508.28, -5.0)] {
            let is = on(true).settled(400.0, p);
            assert!((is.u - u).abs() < 0.02 && (is.i_source - i).abs() < 0.01 && !is.overloaded, "{p} W: {is:?}");
            let rest = 400.0 * is.i_source - is.p_resistor - is.p_chopper - p;
            assert!(rest.abs() < 1e-8 && is.p_chopper >= 0.0, "{p} W: {is:?}, {rest} W");
        }
        for (p, part) in [(5e3, "dc_link.i_max 3800 W"), (-4e3, "set chopper.use")] {
            assert!(on(false).settled(400.0, p).overloaded && on(false).lack(400.0, p).contains(part), "{p} W");
        }
    }

    /// The ideal bridge without a resistance has at most the amplitude and at least the voltage at its commutations; with a large
    /// capacitor, the voltage is constant and the current follows from the overlap of sine and voltage.
    #[test]
    fn a_rectifier_has_its_periodic_solution_and_takes_nothing_back() {
        for (source, pulses) in [(DcSource::RectifierSingle, 2.0_f64), (DcSource::RectifierThree, 6.0)] {
            let mut par = link(true);
            (par.dc_link.source, par.dc_link.C) = (source, 0.5);
            for p in [50.0, 1e3, 5e3] {
                let is = par.settled(400.0, p);
                // i = (U cos x - u) / R for |x| < acos(u / U), and u i = p.
                let share = pulses / std::f64::consts::TAU;
                let gives = |u: f64| {
                    let x = (u / 400.0).acos().min(std::f64::consts::PI / pulses);
                    2.0 * share * (400.0 * x.sin() - u * x) / par.dc_link.R_source
                };
                let (mut u, mut above) = (200.0, 400.0);
                for _ in 0..60 {
                    let middle: f64 = 0.5 * (u + above);
                    *(if middle * gives(middle) > p { &mut u } else { &mut above }) = middle;
                }
                println!("{source:?}, {p} W: {is:?}, {u} V");
                assert!((is.u - u).abs() < 0.1 && (is.i_source * is.u / p - 1.0).abs() < 2e-3, "{is:?}, not {u} V");
                assert!(!is.overloaded && is.p_resistor > 0.0 && is.p_chopper == 0.0);
            }
            for (p, u) in [(0.0, 400.0), (-2e3, 415.0), (-9e3, 600.0)] {
                let is = par.settled(400.0, p);
                assert!((is.u - u).abs() < 1e-9 && is.i_source == 0.0 && (is.p_chopper + p).abs() < 1e-9, "{is:?}");
            }
            assert!(link(false).settled(400.0, -1.0).u > 400.0, "an ideal source takes it");
            par.chopper.used = false;
            assert!(par.settled(400.0, -1.0).overloaded && par.settled(400.0, 1e5).overloaded);
            assert!(par.lack(400.0, -1.0).contains("set chopper.use") && par.lack(400.0, 1e5).contains("rectifier"));
        }
    }

    #[test]
    fn powers_are_balanced_and_the_chopper_holds_the_voltage() {
        for (p, u) in [(0.0, 400.0), (5e3, 373.205), (-1e3, 404.939), (-3e3, 414.4761), (-6e3, 415.0), (-9e3, 421.6126)]
        {
            let is = link(true).settled(400.0, p);
            assert!((is.u - u).abs() < 1e-3, "{p} W: {is:?}");
            let rest = 400.0 * is.i_source - is.p_resistor - is.p_chopper - p;
            assert!(rest.abs() < 1e-9 * 1e4 && is.p_chopper >= 0.0 && !is.overloaded, "{p} W: {is:?}, {rest} W");
        }
        assert!((link(false).settled(400.0, -6e3).u - 428.035).abs() < 1e-3);
    }

    #[test]
    fn more_than_the_source_gives_is_reported() {
        let [most, more] = [19_999.0, 20_001.0].map(|p| link(false).settled(400.0, p));
        assert!(!most.overloaded && more.overloaded && (more.u - 200.0).abs() < 1e-12, "{most:?} {more:?}");
    }
}
