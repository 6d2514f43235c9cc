//! Voltage references beyond the hexagon of the DC link: where the modulator moves them, and the fundamental that remains.
//!
//! In the sector of an edge, x is the part of the reference along the normal of the edge, y the part along the edge; the
//! edge is x_0 = u_dc / sqrt 3, |y| <= u_dc / 3. A reference with x > x_0 becomes
//!
//! ```text
//! minimum phase error         (x_0, y x_0 / x)                                              same angle
//! minimum magnitude error     (x_0, y limited to +-u_dc / 3)                                nearest point of the hexagon
//! six-step                    (x_0, sign(y) min(sqrt(x^2 + y^2 - x_0^2), u_dc / 3))         same magnitude, next angle
//! ```
//!
//! While the reference of the magnitude r > x_0 turns, the output has the fundamental F (both in units of u_dc, r = 1 / (sqrt 3
//! cos b) up to 2/3, integrals over a twelfth of a turn):
//!
//! ```text
//! minimum phase error         2 sqrt 3 / pi (atanh sin b + (pi/6 - b) / cos b)              up to sqrt 3 ln 3 / pi = 0.6057
//! minimum magnitude error     6 r / pi (pi/6 - (b - sin b cos b) / 2), from r = 2/3 on      up to 2 / pi = 0.6366
//!                             (g / sin g + cos g) / pi,  sin g = 1 / (3 r)
//! six-step                    6 r / pi (sin b + pi/6 - b)                                   up to 2 / pi at r = 2/3
//! ```
//!
//! [`ModulationMode::apply`] inverts it: the reference that yields a fundamental. The nearest point is also the result of duty cycles that are clamped
//! leg by leg after the min-max zero sequence. Six-step with the hold at the corners: Bolognani and Zigliotto 1997, DOI
//! 10.1109/28.567804; the closed forms are derived here. u in V.

use crate::frame::{AlphaBeta, Phases, Stator, Vector};
use crate::hexagon::within_hexagon;
use crate::modulation::{limit_span, positive};
use fmu_core::{Field, Row, Scalar, Table, enumeration, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_1_PI, FRAC_PI_6};

const INVERSE_SQRT_3: f64 = 0.577_350_269_189_625_8;
const SQRT_3: f64 = crate::frame::SQRT_3;

/// Maximum magnitude of a reference in units of the edge's distance, where the fundamental would need an infinite one.
const MOST: f64 = 1e3;

enumeration! {
    /// What the modulator does with a reference beyond the hexagon; the assigned values never change.
    #[derive(Default, Serialize, Deserialize)]
    pub enum ModulationMode("ModulationMode", "Voltage beyond u_dc/sqrt(3)") {
        #[default]
        1 Linear "Sinusoidal up to u_dc/sqrt(3), the most that field weakening uses";
        2 MinimumPhase "Overmodulation with the angle of the reference, fundamental up to 0.6057 u_dc";
        3 MinimumMagnitude "Overmodulation to the nearest point of the hexagon, fundamental up to 2/pi u_dc";
        4 SixStep "Overmodulation with the magnitude of the reference, up to six-step, fundamental up to 2/pi u_dc";
    }
}

impl ModulationMode {
    /// Maximum fundamental of the phase voltage in units of u_dc / sqrt 3.
    #[inline]
    pub fn reach(self) -> f64 {
        match self {
            Self::Linear => 1.0,
            // 3 ln 3 / pi
            Self::MinimumPhase => 1.049_085_083_061_451_8,
            // 2 sqrt 3 / pi
            Self::MinimumMagnitude | Self::SixStep => 1.102_657_790_843_583_6,
        }
    }

    /// Stator voltage (V) for the references `u` (V) on a link of `u_dc` (V, >= 0).
    ///
    /// Only differences of the references matter; the inverter chooses the zero sequence. Every vector inside the hexagon (no
    /// line-to-line voltage above `u_dc`) is reproduced; [`Linear`](Self::Linear) treats others as minimum phase error.
    #[inline]
    pub fn limit<S: Scalar>(self, u: Phases<S>, u_dc: S) -> Vector<Stator, S> {
        let (v, span) = (u.to_stator(), u.span());
        match self {
            Self::Linear | Self::MinimumPhase => limit_span(v, span, u_dc),
            _ if span.value() <= u_dc.value() => v,
            _ => self.on_the_edge(v, positive(u_dc)),
        }
    }

    /// The point of the edge for `v` (V) beyond it.
    #[inline(never)]
    fn on_the_edge<S: Scalar>(self, v: Vector<Stator, S>, u_dc: S) -> Vector<Stator, S> {
        let Phases { a, b, c } = Phases::from_stator(v);
        let mut legs = [(0, a), (1, b), (2, c)];
        legs.sort_by(|(_, x), (_, y)| x.value().total_cmp(&y.value()));
        let [(lowest, _), (between, y), (highest, _)] = legs;
        let most = u_dc * (1.0 / 3.0);
        let along = if self == Self::SixStep {
            // The magnitude of y at the same magnitude of the reference.
            let square = v.dot(v) - u_dc * u_dc * (1.0 / 3.0);
            let inside = square.value() < most.value() * most.value() && square.value() > 0.0;
            if inside { square.chain(square.value().sqrt(), 0.5 / square.value().sqrt()) } else { most }
        } else if y.value().abs() < most.value() {
            if y.value() < 0.0 { -y } else { y }
        } else {
            most
        };
        let y = if y.value() < 0.0 { -along } else { along };
        let mut out = [S::from(0.0); 3];
        (out[lowest], out[between], out[highest]) = (-(u_dc + y) * 0.5, y, (u_dc - y) * 0.5);
        Phases { a: out[0], b: out[1], c: out[2] }.to_stator()
    }
}

/// Number of points of a curve: the request differs from the fundamental by 1e-4 at most.
const POINTS: usize = 32;

/// Fundamental in units of u_dc, and u_dc / (sqrt 3 r) of its reference r, from the edge of the linear range to the maximum.
type Curve = [[f64; 2]; POINTS];

const MINIMUM_PHASE: Curve = curve(ModulationMode::MinimumPhase);
const MINIMUM_MAGNITUDE: Curve = curve(ModulationMode::MinimumMagnitude);
const SIX_STEP: Curve = curve(ModulationMode::SixStep);

const fn curve(mode: ModulationMode) -> Curve {
    let (mut points, mut k) = ([[0.0; 2]; POINTS], 0);
    while k < POINTS {
        #[expect(clippy::cast_precision_loss, reason = "at most 31")]
        let x = k as f64 / (POINTS - 1) as f64;
        points[k] = exact(mode, x);
        k += 1;
    }
    points
}

/// Request in units of the maximum fundamental beyond which it is limited: the current loop answers the harmonics, and a mean below the
/// maximum has peaks above.
const MARGIN: f64 = 1.15;

/// A voltage as the modulator applies it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Applied {
    /// Voltage in V.
    pub u: AlphaBeta,
    /// The request in V as far as the modulator follows, if it is beyond.
    pub limited: Option<AlphaBeta>,
}

impl ModulationMode {
    /// The voltage for the request `u` (V), whose fundamental it has up to the maximum, on a link of `u_dc` (V).
    #[expect(clippy::inline_always, reason = "the compiler would call it")]
    #[inline(always)]
    pub fn apply(self, u: AlphaBeta, u_dc: f64) -> Applied {
        if self == Self::Linear {
            let (u, limited) = within_hexagon(u, u_dc);
            return Applied { u, limited: limited.then_some(u) };
        }
        self.overmodulated(u, u_dc)
    }

    #[inline(never)]
    fn overmodulated(self, u: AlphaBeta, u_dc: f64) -> Applied {
        let (magnitude, edge) = (u.magnitude(), u_dc * INVERSE_SQRT_3);
        if magnitude <= edge {
            return Applied { u, limited: None };
        }
        let most = self.reach() * edge;
        let reference = edge / (magnitude * self.inverse(magnitude / u_dc));
        let limited = (magnitude > MARGIN * most).then(|| u * (MARGIN * most / magnitude));
        Applied { u: self.limit(Phases::from_stator(u * reference), u_dc), limited }
    }

    /// The fundamental F in units of u_dc / sqrt 3 of a turning request from which the modulator cuts off mu F. With
    /// [`Linear`](Self::Linear), which limits the request as minimum phase error does, F grows with mu; the others keep it until they reach
    /// their maximum.
    pub fn cut(self, mu: f64) -> f64 {
        if self != Self::Linear {
            return self.reach();
        }
        // r = (1 + mu) F between two points of the curve.
        let mu_of = |[F, q]: [f64; 2]| INVERSE_SQRT_3 / (q * F) - 1.0;
        let above = MINIMUM_PHASE.partition_point(|&point| mu_of(point) < mu).clamp(1, POINTS - 1);
        let [low, high] = [MINIMUM_PHASE[above - 1], MINIMUM_PHASE[above]];
        let share = ((mu - mu_of(low)) / (mu_of(high) - mu_of(low))).clamp(0.0, 1.0);
        SQRT_3 * (low[0] + share * (high[0] - low[0]))
    }

    /// u_dc / (sqrt 3 r) of the reference r for the fundamental `F` (in units of u_dc), by straight lines between exact points.
    fn inverse(self, F: f64) -> f64 {
        let points = match self {
            Self::Linear => return 1.0,
            Self::MinimumPhase => &MINIMUM_PHASE,
            Self::MinimumMagnitude => &MINIMUM_MAGNITUDE,
            Self::SixStep => &SIX_STEP,
        };
        let above = points.partition_point(|point| point[0] < F).clamp(1, POINTS - 1);
        let [[F_0, q_0], [F_1, q_1]] = [points[above - 1], points[above]];
        let share = if F >= F_1 { 1.0 } else { (F - F_0) / (F_1 - F_0) };
        (q_0 + share * (q_1 - q_0)).max(1.0 / MOST)
    }
}

/// A point of the curve: `x` is 0 at the edge of the linear range, 1 at the maximum.
const fn exact(mode: ModulationMode, x: f64) -> [f64; 2] {
    // The angle b, or from the middle of the minimum magnitude error's on, g.
    let first = x < 0.5;
    let angle = match mode {
        ModulationMode::MinimumMagnitude if first => 2.0 * x,
        ModulationMode::MinimumMagnitude => 2.0 - 2.0 * x,
        _ => x,
    };
    let b = FRAC_PI_6 * angle;
    let (sin, cos) = (series(b, 1.0, b), series(1.0, 0.0, b));
    // 6 r / pi
    let by = 6.0 * FRAC_1_PI * INVERSE_SQRT_3 / cos;
    match mode {
        ModulationMode::Linear => [INVERSE_SQRT_3, 1.0],
        ModulationMode::MinimumPhase => [by * (cos * atanh(sin) + FRAC_PI_6 - b), cos],
        ModulationMode::MinimumMagnitude if first => [by * (FRAC_PI_6 - 0.5 * (b - sin * cos)), cos],
        ModulationMode::MinimumMagnitude if b > 0.0 => [FRAC_1_PI * (b / sin + cos), SQRT_3 * sin],
        ModulationMode::MinimumMagnitude => [FRAC_1_PI * 2.0, 0.0],
        ModulationMode::SixStep => [by * (sin + FRAC_PI_6 - b), cos],
    }
}

/// The series of the sine of `b` (`term` = b, `order` = 1) or of its cosine (1, 0), |b| < 1: known to the compiler.
const fn series(mut term: f64, mut order: f64, b: f64) -> f64 {
    let mut sum = 0.0;
    while order < 20.0 {
        sum += term;
        term *= -b * b / ((order + 1.0) * (order + 2.0));
        order += 2.0;
    }
    sum
}

/// The series of the inverse hyperbolic tangent of `x`, |x| <= 1/2.
const fn atanh(x: f64) -> f64 {
    let (mut sum, mut power, mut order) = (0.0, x, 1.0);
    while order < 60.0 {
        sum += power / order;
        power *= x * x;
        order += 2.0;
    }
    sum
}

/// Parameters of the modulator.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Modulation {
    /// What it does with a reference beyond the hexagon.
    pub mode: ModulationMode,
}

type P = Row<Modulation>;

/// Variables of the modulator; their owner supplies the prefix `modulation.`.
pub const MODULATION: &Table<Modulation> = table![P::enumeration_parameter(
    "mode",
    "Voltage beyond the hexagon of the DC link: none in steady state, or overmodulation up to six-step",
    &Field(|p| &mut p.mode),
)];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modulation::limit_to_hexagon;
    use fmu_core::Dual;
    use std::f64::consts::{FRAC_2_PI, TAU};

    const BEYOND: [ModulationMode; 3] =
        [ModulationMode::MinimumPhase, ModulationMode::MinimumMagnitude, ModulationMode::SixStep];

    fn at(r: f64, theta: f64) -> AlphaBeta {
        AlphaBeta::new(r * theta.cos(), r * theta.sin())
    }

    /// Fundamental along the turning reference of the magnitude `r`, by summing the output over a turn.
    fn summed(r: f64, output: impl Fn(AlphaBeta) -> AlphaBeta) -> AlphaBeta {
        let steps = 60_000;
        let mut sum = AlphaBeta::ZERO;
        for k in 0..steps {
            let theta = (f64::from(k) + 0.5) * TAU / f64::from(steps);
            let u = output(at(r, theta));
            let (along, across) = (u.dot(at(1.0, theta)), at(1.0, theta).cross(u));
            sum += AlphaBeta::new(along, across) * (1.0 / f64::from(steps));
        }
        sum
    }

    fn of(mode: ModulationMode, r: f64) -> f64 {
        let sum = summed(r, |u| mode.limit(Phases::from_stator(u), 1.0));
        assert!(sum.beta().abs() < 1e-9, "the fundamental keeps its angle: {sum:?}");
        sum.alpha()
    }

    /// The figures of the literature: 0.6057 for minimum phase error, 2/pi for the others.
    #[test]
    fn the_fundamental_has_its_closed_form() {
        for (r, expected) in [(0.7, 0.6117), (1.0, 0.6246), (3.0, 0.6353), (10.0, 0.63648)] {
            let found = of(ModulationMode::MinimumMagnitude, r);
            assert!((found - expected).abs() < 6e-5, "{found} at {r}, not {expected}");
        }
        let ends = [0.6057, FRAC_2_PI, FRAC_2_PI];
        for (mode, end) in BEYOND.into_iter().zip(ends) {
            assert!((of(mode, 40.0) - end).abs() < 5e-5 && (mode.reach() * INVERSE_SQRT_3 - end).abs() < 5e-5);
            for k in 0..=20 {
                let [F, q] = exact(mode, f64::from(k) / 20.0);
                if q > 0.0 {
                    let found = of(mode, INVERSE_SQRT_3 / q);
                    assert!((found - F).abs() < 1e-8, "{mode:?} {k}: {found}, not {F}");
                }
            }
        }
    }

    /// The request is the fundamental of the output over the whole range, and the maximum beyond it.
    #[test]
    fn the_curve_makes_the_modulator_linear() {
        let u_dc = 540.0;
        for mode in BEYOND {
            let most = mode.reach() * INVERSE_SQRT_3 * u_dc;
            for k in 0..=40 {
                let wanted = most * (0.85 + 0.35 * f64::from(k) / 40.0);
                let found = summed(wanted, |u| mode.apply(u, u_dc).u).alpha();
                assert!((found - wanted.min(most)).abs() < 1e-4 * most, "{mode:?}: {found}, not {wanted} V");
                let Applied { u, limited } = mode.apply(at(wanted, 0.3), u_dc);
                assert_eq!(limited.is_some(), wanted > MARGIN * most, "{mode:?} {wanted}");
                assert!(limited.is_none_or(|u| (u.magnitude() - MARGIN * most).abs() < 1e-9));
                assert!(Phases::from_stator(u).span() <= u_dc * (1.0 + 1e-12), "{mode:?}");
            }
        }
    }

    /// The harmonics of six-step: 1/5, 1/7, 1/11, 1/13 of the fundamental 2/pi u_dc.
    #[test]
    fn six_step_has_its_spectrum() {
        let steps = 60_000;
        for order in [1, 5, 7, 11, 13] {
            let (mut cos, mut sin) = (0.0, 0.0);
            for k in 0..steps {
                let theta = (f64::from(k) + 0.5) * TAU / f64::from(steps);
                let u = ModulationMode::SixStep.apply(at(1.0, theta), 1.0).u.alpha();
                cos += u * (f64::from(order) * theta).cos() * 2.0 / f64::from(steps);
                sin += u * (f64::from(order) * theta).sin() * 2.0 / f64::from(steps);
            }
            let expected = FRAC_2_PI / f64::from(order);
            assert!((cos.hypot(sin) - expected).abs() < 1e-4, "{order}: {} of {expected}", cos.hypot(sin));
        }
    }

    /// Duty cycles clamped leg by leg apply the nearest point.
    #[test]
    fn clamped_legs_apply_the_nearest_point() {
        for k in 0..720 {
            let p = Phases::from_stator(at(0.9, f64::from(k).to_radians() * 0.5 + 1e-3));
            let common = -0.5 * (p.a.max(p.b).max(p.c) + p.a.min(p.b).min(p.c));
            let clamped = [p.a, p.b, p.c].map(|u| (u + common).clamp(-0.5, 0.5));
            let legs = Phases { a: clamped[0], b: clamped[1], c: clamped[2] }.to_stator();
            assert!((ModulationMode::MinimumMagnitude.limit(p, 1.0) - legs).magnitude() < 1e-14, "{k}");
        }
    }

    #[test]
    fn inside_the_hexagon_every_mode_is_linear() {
        for mode in BEYOND {
            for k in 0..60 {
                let u = Phases::from_stator(at(170.0, 0.1 * f64::from(k)));
                assert_eq!(mode.limit(u, 300.0), limit_to_hexagon(u, 300.0));
                assert_eq!(mode.apply(u.to_stator(), 300.0).limited, None);
            }
            let none = mode.apply(at(10.0, 0.0), 0.0);
            assert_eq!((none.u, none.limited), (AlphaBeta::ZERO, Some(AlphaBeta::ZERO)), "without a link");
        }
    }

    /// The derivatives are those of central differences.
    #[test]
    fn the_derivatives_are_exact() {
        for mode in ModulationMode::ALL {
            for k in 0..90 {
                let theta = 0.07 * f64::from(k) + 0.013;
                for r in [0.5, 0.6, 0.65, 0.8] {
                    let (u, by) = (Phases::from_stator(at(r, theta)), Phases { a: 0.3, b: -0.7, c: 0.2 });
                    let dual = |x: f64, d: f64| Dual::new(x, d);
                    let of = |h: f64| {
                        let u = Phases { a: u.a + h * by.a, b: u.b + h * by.b, c: u.c + h * by.c };
                        mode.limit(u, 1.0 + 0.4 * h)
                    };
                    let exact = mode
                        .limit(Phases { a: dual(u.a, by.a), b: dual(u.b, by.b), c: dual(u.c, by.c) }, dual(1.0, 0.4));
                    let difference = (of(1e-6) - of(-1e-6)) * 0.5e6;
                    let off = AlphaBeta::new(exact.alpha().change, exact.beta().change) - difference;
                    assert!(off.magnitude() < 1e-6, "{mode:?} {r} {theta}: {off:?}");
                }
            }
        }
    }
}
