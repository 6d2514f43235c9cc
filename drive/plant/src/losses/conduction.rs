//! Conduction loss of the inverter: the voltage drop of transistors and diodes.
//!
//! A leg with the current i > 0 conducts for the share d of a PWM period through its upper transistor and for 1 - d through its
//! lower diode; i < 0 is the mirror image with 1 - d for d:
//!
//! ```text
//! d      = 1/2 + (u_x + u_0) / u_dc,  u_0 = -(max + min)/2 of the phases        p = drop i
//! drop   = d (u_transistor + r_transistor i) + (1 - d) (u_diode + r_diode i)
//! ```
//!
//! u_x is the leg's voltage with dead time, which shifts d without losing power. Below `inverter.i_zero` the constant part
//! falls linearly, like the dead-time voltage. With the gates off, only the diodes conduct. Over a period with a sinusoidal
//! current of amplitude I, modulation m = 2 |u| / u_dc and angle phi, six switches lose 6 times the sum over transistor
//! (+) and diode (-) of
//!
//! ```text
//! u I (1/(2 pi) +- m cos phi / 8) + r I^2 (1/8 +- m cos phi / (3 pi) +- c_3),  c_3 = -(3 sqrt 3/(8 pi)) m cos(3 phi)/(15 pi)
//! ```
//!
//! The model of a device (threshold and resistance) follows the data sheets, and the closed form is standard; a test
//! compares [`mean`] with the legs. u in V, i in A.

use drive_base::frame::{AlphaBeta, Phases, SQRT_3, Stator, Vector};
use drive_base::modulation::clamp_unit;
use fmu_core::Scalar;
use fmu_core::unit::{AMPERE, JOULE, OHM, ONE, VOLT};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_1_PI, PI};

/// Parameters of transistors and diodes; all zero gives lossless devices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Devices {
    /// Threshold voltage of a transistor in V, >= 0.
    pub u_transistor: f64,
    /// Resistance of a transistor in Ohm, >= 0.
    pub r_transistor: f64,
    /// Threshold voltage of a diode in V, >= 0.
    pub u_diode: f64,
    /// Resistance of a diode in Ohm, >= 0.
    pub r_diode: f64,
    /// Energy of switching a leg on and off once, with the diode's recovery, in J at i_sw and u_sw, >= 0.
    pub E_sw: f64,
    /// Current of E_sw in A, > 0.
    pub i_sw: f64,
    /// DC-link voltage of E_sw in V, > 0.
    pub u_sw: f64,
    /// Exponent of the DC-link voltage in the switching energy, >= 1.
    pub k_sw: f64,
}

impl Default for Devices {
    fn default() -> Self {
        Self {
            u_transistor: 0.0,
            r_transistor: 0.0,
            u_diode: 0.0,
            r_diode: 0.0,
            E_sw: 0.0,
            i_sw: 10.0,
            u_sw: 300.0,
            k_sw: 1.3,
        }
    }
}

impl Devices {
    /// Whether they are lossless.
    #[inline]
    pub fn is_none(&self) -> bool {
        let &Self { u_transistor, r_transistor, u_diode, r_diode, E_sw, i_sw: _, u_sw: _, k_sw: _ } = self;
        u_transistor + r_transistor + u_diode + r_diode + E_sw == 0.0
    }

    /// The larger threshold voltage in V.
    #[inline]
    pub fn threshold(&self) -> f64 {
        self.u_transistor.max(self.u_diode)
    }
}

/// Maximum modulation m = 2 |u| / u_dc of a sinusoidal voltage: 2 / sqrt(3).
const MAX_MODULATION: f64 = 1.154_700_538_379_251_5;

/// c_3 divided by m cos(3 phi), for a common-mode voltage of (max + min)/2.
const THIRD: f64 = -3.0 * 1.732_050_807_568_877_2 / (120.0 * PI * PI);

/// Mean loss (W) of six switches over a period with a sinusoidal current of amplitude `i` (A), at the modulation
/// `m` = 2 |u| / u_dc and the cosine `cos_phi` of the angle from the current to the voltage.
pub fn mean(devices: &Devices, m: f64, cos_phi: f64, i: f64) -> f64 {
    let &Devices { u_transistor, r_transistor, u_diode, r_diode, .. } = devices;
    let m = m.min(MAX_MODULATION);
    let cos_3_phi = (4.0 * cos_phi * cos_phi - 3.0) * cos_phi;
    let (u, r) = (m * cos_phi * 0.125, m * (cos_phi * (FRAC_1_PI / 3.0) + THIRD * cos_3_phi));
    let thresholds = (u_transistor + u_diode) * (0.5 * FRAC_1_PI) + (u_transistor - u_diode) * u;
    let resistances = (r_transistor + r_diode) * 0.125 + (r_transistor - r_diode) * r;
    6.0 * (thresholds + resistances * i) * i
}

/// A vector that is affine in the current (A).
#[derive(Clone, Copy, Debug)]
pub struct Affine {
    /// Without current.
    pub at_0: AlphaBeta,
    /// Symmetric matrix per ampere: alpha alpha, alpha beta, beta beta.
    pub by: [f64; 3],
}

impl Affine {
    /// At the current `i` (A).
    #[inline]
    pub fn at<S: Scalar>(&self, i: Vector<Stator, S>) -> Vector<Stator, S> {
        let &Self { at_0, by: [x, y, z] } = self;
        Vector::fixed(at_0) + Vector::new(i.alpha() * x + i.beta() * y, i.alpha() * y + i.beta() * z)
    }
}

/// The matrix of resistances of the legs (Ohm) in stator axes: alpha alpha, alpha beta, beta beta.
#[inline]
pub(crate) fn symmetric(Phases { a, b, c }: Phases) -> [f64; 3] {
    [(4.0 * a + b + c) * (1.0 / 6.0), (c - b) * (0.5 / SQRT_3), 0.5 * (b + c)]
}

/// Voltage drop of the conducting devices over an integration step.
#[derive(Clone, Copy, Debug)]
pub struct Conduction<S> {
    /// Half of the sum and of the difference of transistor and diode: threshold in V, resistance in Ohm.
    u: [f64; 2],
    r: [f64; 2],
    /// 2 / u_dc in 1/V; 0 without a DC link.
    by_u_dc: S,
    /// Current in A below which the threshold falls linearly.
    i_zone: S,
}

impl<S: Scalar> Conduction<S> {
    /// With switching legs or, with the gates off, diodes only; `None` without a drop.
    pub fn new(devices: &Devices, switching: bool, u_dc: S, i_zone: S) -> Option<Self> {
        let &Devices { u_transistor, r_transistor, u_diode, r_diode, .. } = devices;
        let (u, r) = if switching { (u_transistor, r_transistor) } else { (u_diode, r_diode) };
        let halves = |a: f64, b: f64| [0.5 * (a + b), 0.5 * (a - b)];
        let by_u_dc = if u_dc.value() > 0.0 { S::from(2.0) / u_dc } else { 0.0.into() };
        let found = Self { u: halves(u, u_diode), r: halves(r, r_diode), by_u_dc, i_zone };
        (found.u[0] > 0.0 || found.r[0] > 0.0).then_some(found)
    }

    /// Voltage drop (V) at the stator with the voltage `u` (V) of the legs and the current `i` (A).
    pub fn drop(&self, u: Vector<Stator, S>, i: Vector<Stator, S>) -> Vector<Stator, S> {
        let i = Phases::from_stator(i);
        let sign = |i: S| clamp_unit(i / self.i_zone);
        self.drop_with(u, i, Phases { a: sign(i.a), b: sign(i.b), c: sign(i.c) })
    }

    /// The [`drop`](Self::drop) (V) with these `signs` of the currents `i` (A), linear in the zone.
    #[inline]
    pub fn drop_with(&self, u: Vector<Stator, S>, i: Phases<S>, signs: Phases<S>) -> Vector<Stator, S> {
        let on = self.on(u);
        let leg = |on: S, i: S, sign: S| {
            let transistor = sign * on;
            (transistor * self.u[1] + self.u[0].into()) * sign + (transistor * self.r[1] + self.r[0].into()) * i
        };
        Phases { a: leg(on.a, i.a, signs.a), b: leg(on.b, i.b, signs.b), c: leg(on.c, i.c, signs.c) }.to_stator()
    }

    /// 2 d - 1 of the legs with the voltage `u` (V).
    #[inline]
    fn on(&self, u: Vector<Stator, S>) -> Phases<S> {
        let u = Phases::from_stator(u);
        let max = |a: S, b: S| if a.value() > b.value() { a } else { b };
        let min = |a: S, b: S| if a.value() < b.value() { a } else { b };
        let middle = (max(max(u.a, u.b), u.c) + min(min(u.a, u.b), u.c)) * 0.5;
        let leg = |u: S| clamp_unit((u - middle) * self.by_u_dc);
        Phases { a: leg(u.a), b: leg(u.b), c: leg(u.c) }
    }
}

impl Conduction<f64> {
    /// The larger threshold voltage in V.
    #[inline]
    pub fn threshold(&self) -> f64 {
        self.u[0] + self.u[1].abs()
    }

    /// The [`drop`](Self::drop) (V) while the currents of the legs have these `signs`.
    #[inline]
    pub fn affine(&self, u: AlphaBeta, signs: Phases) -> Affine {
        let on = self.on(u);
        let leg = |on: f64, sign: f64| {
            let transistor = sign * on;
            ((transistor * self.u[1] + self.u[0]) * sign, transistor * self.r[1] + self.r[0])
        };
        let [(a, r_a), (b, r_b), (c, r_c)] = [leg(on.a, signs.a), leg(on.b, signs.b), leg(on.c, signs.c)];
        Affine { at_0: Phases { a, b, c }.to_stator(), by: symmetric(Phases { a: r_a, b: r_b, c: r_c }) }
    }
}

type P = Row<Devices>;

/// Variables of the devices; their owner supplies the prefix `inverter.`.
pub const DEVICES: &Table<Devices> = table![
    P::parameter("u_transistor", &VOLT, "Threshold voltage of a transistor; 0: none", |p| &mut p.u_transistor)
        .at_least(0.0),
    P::parameter("r_transistor", &OHM, "Resistance of a transistor; 0: none", |p| &mut p.r_transistor).at_least(0.0),
    P::parameter("u_diode", &VOLT, "Threshold voltage of a diode; 0: none", |p| &mut p.u_diode).at_least(0.0),
    P::parameter("r_diode", &OHM, "Resistance of a diode; 0: none", |p| &mut p.r_diode).at_least(0.0),
    P::parameter(
        "E_sw",
        &JOULE,
        "Energy of switching a leg on and off once at i_sw and u_sw, with the diode's recovery; 0: none",
        |p| &mut p.E_sw,
    )
    .at_least(0.0),
    P::parameter("i_sw", &AMPERE, "Current of E_sw", |p| &mut p.i_sw).above(0.0),
    P::parameter("u_sw", &VOLT, "DC-link voltage of E_sw", |p| &mut p.u_sw).above(0.0),
    P::parameter("k_sw", &ONE, "Exponent of the DC-link voltage in the switching energy", |p| &mut p.k_sw)
        .at_least(1.0),
];

#[cfg(test)]
mod tests {
    use super::*;
    use drive_base::frame::AlphaBeta;

    #[test]
    fn over_a_period_it_is_the_closed_form() {
        let devices =
            Devices { u_transistor: 0.8, r_transistor: 2.2e-3, u_diode: 0.9, r_diode: 1.6e-3, ..Devices::default() };
        let (u_dc, i_hat) = (400.0, 150.0);
        for (m, phi) in [(0.2, 0.0), (0.7, 0.5), (1.1, -0.3), (1.0, 2.8), (0.9, 1.5)] {
            let conduction = Conduction::new(&devices, true, u_dc, 1e-6).unwrap();
            let count = 36_000;
            let at = |k: u32| {
                let theta = 2.0 * PI * (f64::from(k) + 0.37) / f64::from(count);
                let u = AlphaBeta::new(theta.cos(), theta.sin()) * (0.5 * m * u_dc);
                let i = AlphaBeta::new((theta - phi).cos(), (theta - phi).sin()) * i_hat;
                1.5 * conduction.drop(u, i).dot(i)
            };
            let mean = (0..count).map(at).sum::<f64>() / f64::from(count);
            let closed = super::mean(&devices, m, phi.cos(), i_hat);
            println!("m = {m}, phi = {phi}: {mean} W, closed form {closed} W");
            assert!((mean / closed - 1.0).abs() < 1e-4, "m = {m}, phi = {phi}: {mean} W, not {closed} W");
        }
    }
}
