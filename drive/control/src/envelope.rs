//! The maximum torque under a current and a voltage limit, and the currents for a smaller torque: the algebra of field weakening.
//!
//! In steady state, with R exact, |u|^2 = R^2 |i|^2 + w^2 |psi|^2 + 2 R w t, t = tau / (1.5 n_p) = l i_q, l = psi_M - dL i_d,
//! dL = L_q - L_d. Largest torque of one sign s (motoring +1, generating -1; w > 0) under |u| <= U and |i| <= I:
//!
//! - **MTPA end**: maximum torque per ampere at |i| = I, where its voltage suffices;
//! - else **the circle**: i_d = -I (1 - x^2) / (1 + x^2), i_q = s 2 I x / (1 + x^2) make |u| = U a quartic in x > 0. Its root next
//!   to the MTPA end is the limit where the torque falls from there along |u| = U into the circle;
//! - else **MTPV**, which then lies within I: on the voltage limit, i(u) = Z^-1 (u - j w psi_M). With u turned by an angle, i' =
//!   Z^-1 j u and i'' = -Z^-1 u; the torque is stationary where l i_q' - dL i_d' i_q = 0.
//!
//! Both limits are convex, and log |t| is concave where l > 0 and s i_q > 0, so the gradient decides. Where only the circle
//! and |u| = U act, s grad t = m i + n grad |u|^2 with m, n >= 0. It follows that i_d is not above that of maximum torque per
//! ampere, so that the root on the other side of the MTPA end is never the limit. Without R, MTPV needs psi_M < L_d I; with R
//! it does not: a machine with R i above w L i reaches MTPV at any speed at which R I + w psi_M > U.
//!
//! For a torque below the limit, the minimum current on the voltage limit is the greater root of f(i_d) = |u|^2 - U^2 at i_q
//! = t / l. The cross term is constant and f is convex, so Newton's method from the right does not overshoot, and from
//! the inside it lands right of the root.
//!
//! MTPA and MTPV without R: Morimoto et al. 1990, DOI 10.1109/28.60058. The exact voltage, the quartic and the convexity
//! are derived here. u in V, i in A, psi in Wb, w (electrical) in rad/s, tau in N.m.

use drive_base::frame::DqHat;
use drive_base::motor::Motor;
use serde::{Deserialize, Serialize};

/// Machine and current limit, with what stays the same from sample to sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Envelope {
    /// Torque per Wb.A: 1.5 n_p.
    k: f64,
    R: f64,
    L_d: f64,
    L_q: f64,
    dL: f64,
    psi_M: f64,
    /// Current limit in A.
    I: f64,
    /// Maximum torque per ampere on the circle: its x.
    x_mtpa: f64,
}

/// Iterations run until a step is this small, so that the next one would be below rounding, and at most this many times.
const MOST: u32 = 60;
const SMALL: f64 = 1e-8;

/// Bisections that find the minimum voltage on the circle.
const HALVINGS: u32 = 30;

/// The limit of one sign: its currents (A) and the magnitude of its torque (N.m).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// Currents in A.
    pub i: DqHat,
    /// Magnitude of the torque in N.m; 0: no current fits the voltage.
    pub tau: f64,
}

/// Result of the iterations for one sign at the last sample, from which the next ones begin; zeros for a fresh start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WarmStart {
    x: f64,
    /// Direction of the voltage at MTPV.
    u: [f64; 2],
}

impl Envelope {
    /// For the estimates `motor` and the current limit `I` (A).
    pub fn new(motor: &Motor, I: f64) -> Self {
        let &Motor { n_p, R_s: R, L_d, L_q, psi_M } = motor;
        let dL = L_q - L_d;
        // i_d = (psi_M - sqrt(psi_M^2 + 8 (dL I)^2)) / (4 dL), without the division.
        let i_d = -2.0 * dL * I * I / (psi_M + (psi_M * psi_M + 8.0 * dL * dL * I * I).sqrt());
        Self { k: 1.5 * f64::from(n_p), R, L_d, L_q, dL, psi_M, I, x_mtpa: ((I + i_d) / (I - i_d)).sqrt() }
    }

    /// |u|^2 - U^2 (V^2) of the currents `i` (A) at the speed `w` (rad/s).
    #[inline]
    pub fn excess(&self, i: DqHat, w: f64, U: f64) -> f64 {
        let (psi_d, psi_q) = (self.psi_M + self.L_d * i.d(), self.L_q * i.q());
        let t = (self.psi_M - self.dL * i.d()) * i.q();
        self.R * self.R * i.dot(i) + w * w * (psi_d * psi_d + psi_q * psi_q) + 2.0 * self.R * w * t - U * U
    }

    fn torque(&self, i: DqHat) -> f64 {
        self.k * (self.psi_M - self.dL * i.d()) * i.q()
    }

    fn at(&self, i: DqHat) -> Limit {
        Limit { i, tau: self.torque(i).abs() }
    }

    /// Currents (A) on the circle.
    #[inline]
    fn on_circle(&self, x: f64, s: f64) -> DqHat {
        let r = self.I / (1.0 + x * x);
        DqHat::new(-r * (1.0 - x * x), s * 2.0 * r * x)
    }

    /// The base speed (electrical, rad/s) under the voltage `U` (V): up to it, the machine delivers its maximum torque.
    pub fn base_speed(&self, U: f64) -> f64 {
        let i = self.on_circle(self.x_mtpa, 1.0);
        let (psi_d, psi_q) = (self.psi_M + self.L_d * i.d(), self.L_q * i.q());
        let flux = psi_d * psi_d + psi_q * psi_q;
        let half = self.R * (self.psi_M - self.dL * i.d()) * i.q();
        let free = U * U - self.R * self.R * i.dot(i);
        ((half * half + flux * free).max(0.0).sqrt() - half).max(0.0) / flux
    }

    /// The limit of the sign `s` at |w| = `w` (rad/s) under the voltage `U` (V).
    #[inline]
    pub fn limit(&self, w: f64, s: f64, U: f64, warm: &mut WarmStart) -> Limit {
        self.iterated::<false>(w, s, U, warm)
    }

    /// [`limit`](Self::limit) with its iterations run to the end: the limit of a settled drive.
    pub fn settled(&self, w: f64, s: f64, U: f64) -> Limit {
        self.iterated::<true>(w, s, U, &mut WarmStart::default())
    }

    #[inline]
    fn iterated<const TO_THE_END: bool>(&self, w: f64, s: f64, U: f64, warm: &mut WarmStart) -> Limit {
        let p = self.quartic(w, s, U);
        if value(&p, self.x_mtpa) <= 0.0 {
            *warm = WarmStart::default();
            return self.at(self.on_circle(self.x_mtpa, s));
        }
        if warm.u.iter().any(|&x| x != 0.0) {
            // Where it was the limit at the last sample, it mostly still is.
            let i = self.max_torque_per_volt::<TO_THE_END>(w, s, U, &mut warm.u);
            if i.magnitude() <= self.I && s * i.q() > 0.0 {
                return self.at(i);
            }
            *warm = WarmStart::default();
        }
        let left = if p[0] > 0.0 { self.least_voltage(w, s) } else { 0.0 };
        if value(&p, left) <= 0.0 {
            warm.x = root::<TO_THE_END>(&p, left, self.x_mtpa, warm.x);
            let i = self.on_circle(warm.x, s);
            if self.falls_inwards(i, w, s) {
                return self.at(i);
            }
        }
        *warm = WarmStart::default();
        let i = self.max_torque_per_volt::<TO_THE_END>(w, s, U, &mut warm.u);
        if i.magnitude() <= self.I * (1.0 + 1e-9) && s * i.q() > 0.0 {
            return self.at(i);
        }
        *warm = WarmStart::default();
        Limit { i: DqHat::new(self.least_i_d(w), 0.0), tau: 0.0 }
    }

    /// i_d (A) of the minimum voltage without torque, within I.
    #[inline]
    pub fn least_i_d(&self, w: f64) -> f64 {
        let x = w * w * self.L_d;
        -self.I.min(x * self.psi_M / (self.R * self.R + x * self.L_d))
    }

    /// The position x on the circle with the minimum voltage, up to maximum torque per ampere.
    #[cold]
    fn least_voltage(&self, w: f64, s: f64) -> f64 {
        let (mut left, mut right) = (0.0, self.x_mtpa);
        for _ in 0..HALVINGS {
            let x = 0.5 * (left + right);
            let i = self.on_circle(x, s);
            // Along the circle, i turns by -90 degrees times s.
            let (_, [d, q]) = self.gradients(i, w);
            *(if s * (d * i.q() - q * i.d()) > 0.0 { &mut right } else { &mut left }) = x;
        }
        left
    }

    /// Gradients of t and of |u|^2 / 2 at the currents `i` (A).
    #[inline]
    fn gradients(&self, i: DqHat, w: f64) -> ([f64; 2], [f64; 2]) {
        let &Self { R, L_d, L_q, dL, psi_M, .. } = self;
        let t = [-dL * i.q(), psi_M - dL * i.d()];
        let flux = [L_d * (psi_M + L_d * i.d()), L_q * L_q * i.q()];
        let of = |k: usize, i: f64| R * R * i + w * w * flux[k] + R * w * t[k];
        (t, [of(0, i.d()), of(1, i.q())])
    }

    /// Whether the torque of the sign `s` falls from `i` (A), where the circle crosses |u| = U, along |u| = U into the circle.
    #[inline]
    fn falls_inwards(&self, i: DqHat, w: f64, s: f64) -> bool {
        let (t, u) = self.gradients(i, w);
        let (t_u, i_u) = (t[0] * u[1] - t[1] * u[0], i.d() * u[1] - i.q() * u[0]);
        s * t_u * i_u >= 0.0
    }

    /// Coefficients p_0 to p_4 of |u|^2 - U^2 on the circle, times (1 + x^2)^2.
    fn quartic(&self, w: f64, s: f64, U: f64) -> [f64; 5] {
        let &Self { R, L_d, L_q, dL, psi_M, I, .. } = self;
        let (e, a, b) = (R * R * I * I - U * U, psi_M - L_d * I, psi_M + L_d * I);
        let (w_2, c) = (w * w, 4.0 * R * w * s * I);
        [
            e + w_2 * a * a,
            c * (psi_M + dL * I),
            2.0 * e + w_2 * (2.0 * a * b + 4.0 * L_q * L_q * I * I),
            c * (psi_M - dL * I),
            e + w_2 * b * b,
        ]
    }

    /// Currents (A) of maximum torque per volt; `warm` is the direction of u, kept from the last sample.
    fn max_torque_per_volt<const TO_THE_END: bool>(&self, w: f64, s: f64, U: f64, warm: &mut [f64; 2]) -> DqHat {
        let &Self { R, L_d, L_q, dL, psi_M, .. } = self;
        let inverse = 1.0 / (R * R + w * w * L_d * L_q);
        // Currents of the voltage (d, q) with the magnet's EMF set to zero.
        let current = |d: f64, q: f64| ((R * d + w * L_q * q) * inverse, (R * q - w * L_d * d) * inverse);
        let of = |u: [f64; 2]| current(U * u[0], U * u[1] - w * psi_M);
        let torque = |u: [f64; 2]| {
            let (i_d, i_q) = of(u);
            s * (psi_M - dL * i_d) * i_q
        };
        let (mut u, steps) = if warm.iter().all(|&x| x == 0.0) {
            // Exact without R, and without saliency.
            let (salient, length) = (self.without_resistance(w, s, U), (R * R + w * w * L_d * L_d).sqrt());
            let round = [-s * w * L_d / length, s * R / length];
            (if torque(salient) > torque(round) { salient } else { round }, MOST)
        } else {
            (*warm, if TO_THE_END { MOST } else { 2 })
        };
        for _ in 0..steps {
            let (d, q) = (U * u[0], U * u[1]);
            let (i_d, i_q) = current(d, q - w * psi_M);
            let (i1_d, i1_q) = current(-q, d);
            let (i2_d, i2_q) = current(-d, -q);
            let l = psi_M - dL * i_d;
            let rise = s * (l * i1_q - dL * i1_d * i_q);
            let bend = s * (l * i2_q - 2.0 * dL * i1_d * i1_q - dL * i2_d * i_q);
            // Where the torque bends upwards, Newton's method would converge to the minimum.
            let h = if bend < 0.0 { (-rise / bend).clamp(-0.3, 0.3) } else { 0.3_f64.copysign(rise) };
            let turned = [u[0] - h * u[1], u[1] + h * u[0]];
            let length = (turned[0] * turned[0] + turned[1] * turned[1]).sqrt();
            u = [turned[0] / length, turned[1] / length];
            if h.abs() < SMALL {
                break;
            }
        }
        *warm = u;
        let (i_d, i_q) = of(u);
        DqHat::new(i_d, i_q)
    }

    /// Direction of the voltage at MTPV if R were 0.
    fn without_resistance(&self, w: f64, s: f64, U: f64) -> [f64; 2] {
        let (f, a) = (U / w, self.L_q * self.psi_M);
        let psi_d = -2.0 * f * f * self.dL / (a + (a * a + 8.0 * self.dL * self.dL * f * f).sqrt());
        [-s * (f * f - psi_d * psi_d).max(0.0).sqrt() / f, psi_d / f]
    }

    /// i_d (A) of the minimum current for the torque `tau` (N.m) on the voltage limit: the greater root of f, by at most `steps`
    /// of Newton's method from `i_d`; `None` if the slope is not positive.
    #[inline]
    pub fn i_d(&self, tau: f64, w: f64, U: f64, mut i_d: f64, steps: u32) -> Option<f64> {
        let &Self { k, R, L_d, L_q, dL, psi_M, .. } = self;
        let (t, w_2) = (tau / k, w * w);
        let (A2, A1) = (R * R + w_2 * L_d * L_d, w_2 * psi_M * L_d);
        let A0 = w_2 * psi_M * psi_M + 2.0 * R * w * t - U * U;
        let e = (R * R + w_2 * L_q * L_q) * t * t;
        for _ in 0..steps {
            let l = psi_M - dL * i_d;
            let g = (A2 * i_d + 2.0 * A1) * i_d + A0;
            let slope = 2.0 * ((A2 * i_d + A1) * l * l * l + e * dL);
            if slope <= 0.0 {
                return None;
            }
            let step = (g * l * l + e) * l / slope;
            i_d -= step;
            if step.abs() <= SMALL * SMALL * self.I {
                break;
            }
        }
        Some(i_d)
    }

    /// Derivative of the torque with respect to the angle of the rotor ahead of the frame with the constant currents `i` (A),
    /// in N.m/rad: 0 at maximum torque per ampere.
    #[inline]
    pub fn slope(&self, i: DqHat) -> f64 {
        -self.k * (i.d() * (self.psi_M - self.dL * i.d()) + self.dL * i.q() * i.q())
    }

    /// Whether i_d is below its value at maximum torque per ampere for the same torque.
    #[inline]
    pub fn beyond_mtpa(&self, i: DqHat) -> bool {
        self.slope(i) > 0.0
    }

    /// i_q (A) for the torque `tau` (N.m) with `i_d` (A).
    #[inline]
    pub fn i_q(&self, tau: f64, i_d: f64) -> f64 {
        tau / (self.k * (self.psi_M - self.dL * i_d))
    }
}

fn value(p: &[f64; 5], x: f64) -> f64 {
    (((p[4] * x + p[3]) * x + p[2]) * x + p[1]) * x + p[0]
}

/// The root of `p` between `left`, where it is not positive, and `right`, where it is positive; starts at `x` if that is inside.
/// A Newton step that leaves the bracket is replaced by bisection; one that hits its end stays.
fn root<const TO_THE_END: bool>(p: &[f64; 5], mut left: f64, mut right: f64, x: f64) -> f64 {
    let (mut x, steps) = if x > left && x < right { (x, 2) } else { (0.5 * (left + right), 6) };
    for _ in 0..if TO_THE_END { MOST } else { steps } {
        let y = value(p, x);
        *(if y > 0.0 { &mut right } else { &mut left }) = x;
        let slope = ((4.0 * p[4] * x + 3.0 * p[3]) * x + 2.0 * p[2]) * x + p[1];
        let next = x - y / slope;
        let last = x;
        x = if next >= left && next <= right { next } else { 0.5 * (left + right) };
        if TO_THE_END && (x - last).abs() < SMALL * x {
            break;
        }
    }
    x
}
