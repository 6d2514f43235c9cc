//! Field weakening: the torque and the current references that the DC link allows, by feed-forward with a bounded trim.
//!
//! The voltage that the references may use is U = k_u u_max - y, u_max = u_dc / sqrt 3, or the maximum fundamental of overmodulation
//! ([`overmodulation`](drive_base::overmodulation)). From U, the estimated speed and the machine
//! estimates, [`Envelope`] gives the limits of the torque and, for the torque within them, the minimum current. Where
//! the plain reference (maximum torque per ampere, i_d = 0 or the low-speed law) fits the voltage, nothing is changed.
//!
//! The trim y corrects wrong estimates: dy/dt = w_t (|u| - k_t u_max), 0 <= y <= 0.3 u_max, with the voltage
//! |u| that the current loop requests, before the hexagon. It changes U, never i_d, so that MTPV and the current limit remain
//! valid; it also changes while the current error is large, where wrong estimates would otherwise saturate the loop
//! permanently.
//!
//! The torque limits also limit the speed loop. They fall as the speed rises, so while one acts, the integrator
//! follows: dI/dt = w_s (limited - wanted), in addition to the hold of [`speed`](crate::speed).
//!
//! A limit is computed at every sample while it acts; otherwise at every eighth sample and whenever the voltage has changed by 1
//! %.
//!
//! The tracker's bandwidth while weakening: [`tracking`](crate::tracking).

use crate::envelope::{Envelope, Limit, WarmStart};
use crate::limits::Limits;
use crate::reference::max_torque_per_ampere;
use crate::tracking::LeastTracker;
use drive_base::frame::DqHat;
use drive_base::motor::Motor;
use fmu_core::unit::{ONE, RAD_PER_S};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

const SQRT_3: f64 = 1.732_050_807_568_877_2;
pub(crate) const INVERSE_SQRT_3: f64 = 1.0 / SQRT_3;

/// Minimum share of u_max that the references may use.
const LEAST_SHARE: f64 = 0.05;

/// Maximum trim, as a share of u_max.
pub const GREATEST_TRIM: f64 = 0.3;

/// Samples after which a limit that does not act is computed again, and the change of the voltage, as a share, after which
/// both are.
const EVERY: u64 = 8;
const LEAST_CHANGE: f64 = 0.01;

/// Maximum number of steps from the plain reference to the voltage limit.
const COLD: u32 = 40;

/// Minimum electrical speed in rad/s that the limits are computed for.
const LEAST_SPEED: f64 = 1e-3;

/// Parameters of field weakening.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WeakeningParameters {
    /// Field weakening is in use.
    pub used: bool,
    /// Share of u_max that the references use, 0.5..1.
    pub k_u: f64,
    /// Share of u_max above which the trim acts, k_u..1.1.
    pub k_t: f64,
    /// Bandwidth w_t of the trim in rad/s, >= 0; 0: no trim.
    pub bandwidth: f64,
}

impl Default for WeakeningParameters {
    fn default() -> Self {
        Self { used: false, k_u: 0.95, k_t: 0.98, bandwidth: 10.0 * std::f64::consts::PI }
    }
}

/// Computed from the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WeakeningGains {
    envelope: Envelope,
    /// Currents (A) of the maximum positive torque of the plain reference.
    end: DqHat,
    /// Inverse of the torque constant in A/(N.m).
    per_torque: f64,
    /// Upper bounds of the parts of |u|^2 for all its currents: constant, in w, in w^2.
    voltage: [f64; 3],
    /// u_max in units of u_dc / sqrt 3.
    reach: f64,
    /// Minimum bandwidth of the tracker.
    pub(super) tracker: LeastTracker,
}

impl WeakeningGains {
    /// For a reference of up to `tau` (N.m), with maximum torque per ampere (`mtpa`) or i_d = 0, and a voltage of up to `reach`
    /// u_dc / sqrt 3.
    pub fn new(motor: &Motor, limit: &Limits, tau: f64, mtpa: bool, reach: f64, tracker: LeastTracker) -> Self {
        let end = if mtpa {
            max_torque_per_ampere(motor, tau)
        } else {
            DqHat::new(0.0, (tau / motor.torque_constant()).min(limit.i_q).min(limit.i))
        };
        let psi = DqHat::new(motor.psi_M + motor.L_d * end.d(), motor.L_q * end.q());
        let t = motor.torque(end.d(), end.q()) / (1.5 * f64::from(motor.n_p));
        let R = motor.R_s;
        Self {
            envelope: Envelope::new(motor, limit.i),
            end,
            per_torque: 1.0 / motor.torque_constant(),
            voltage: [R * R * end.dot(end), 2.0 * R * t, psi.dot(psi).max(motor.psi_M * motor.psi_M)],
            reach,
            tracker,
        }
    }
}

impl WeakeningGains {
    /// Maximum fundamental voltage in V on a link of `u_dc` (V).
    #[inline]
    pub fn highest(&self, u_dc: f64) -> f64 {
        u_dc * INVERSE_SQRT_3 * self.reach
    }

    /// Minimum bandwidth in rad/s of the tracker with the currents `i` (A).
    #[inline]
    pub fn tracker(&self, i: DqHat) -> f64 {
        self.tracker.at(self.envelope.slope(i))
    }

    /// No limit of the sign `s`: the maximum plain reference fits the voltage `U` (V) at the electrical speed `w` (rad/s).
    #[inline]
    fn beyond(&self, s: f64, w: f64, U: f64) -> Option<Limit> {
        let end = DqHat::new(self.end.d(), s * self.end.q());
        let fits = self.envelope.excess(end, w, U) <= 0.0;
        fits.then(|| Limit { i: DqHat::new(self.envelope.least_i_d(w), 0.0), tau: f64::INFINITY })
    }

    /// Electrical speed in rad/s below which all plain references fit the voltage `U` (V).
    pub fn onset(&self, U: f64) -> f64 {
        let [copper, cross, flux] = self.voltage;
        let free = U * U - copper;
        if U <= 0.0 || free <= 0.0 { 0.0 } else { 2.0 * free / (cross + (cross * cross + 4.0 * flux * free).sqrt()) }
    }
}

/// State from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "answers of the last sample, each on its own")]
pub struct Weakening {
    /// Trim in V.
    trim: f64,
    /// Voltage in V for the references of this sample.
    U: f64,
    /// Voltage in V at the last sample that had to compute both limits.
    U_then: f64,
    /// The voltage is not sufficient for every plain reference.
    near: bool,
    /// Limits for motoring and for generating.
    limits: [Limit; 2],
    warm: [WarmStart; 2],
    /// The drive generates: the second limit is the one in use.
    generates: bool,
    /// The limit in use acts.
    clipped: bool,
    /// i_d of the last sample in A, read while weakening.
    i_d: f64,
    /// i_d is below the plain reference's.
    pub weakens: bool,
}

impl Weakening {
    /// Maximum magnitudes of negative and positive torque at the electrical speed `w` (rad/s), as i_q (A) of the magnet's
    /// torque and at most `i`, where the DC link of `u_dc` (V) also feeds an injection of `injected` (V). `k` counts the
    /// samples.
    #[inline]
    pub fn limits(
        &mut self,
        gains: &WeakeningGains,
        par: &WeakeningParameters,
        (w, u_dc, injected): (f64, f64, f64),
        i: f64,
        k: u64,
    ) -> (f64, f64) {
        if self.fits(gains, par, (w, u_dc, injected)) {
            if self.near {
                let Self { trim, U, .. } = *self;
                *self = Self { trim, U, ..Self::default() };
            }
            return (i, i);
        }
        self.near = true;
        self.limits_near(gains, w.abs().max(LEAST_SPEED), k);
        self.both(gains, w, i)
    }

    /// The state of a drive that has settled at the electrical speed `w` (rad/s) on a DC link of `u_dc` (V) with this `trim`
    /// (V), and its limits as of [`limits`](Self::limits): the iterations run to their end.
    pub fn settled(
        gains: &WeakeningGains,
        par: &WeakeningParameters,
        (w, u_dc): (f64, f64),
        i: f64,
        trim: f64,
    ) -> (Self, (f64, f64)) {
        let mut found = Self { trim, ..Self::default() };
        if found.fits(gains, par, (w, u_dc, 0.0)) {
            return (found, (i, i));
        }
        found.near = true;
        let speed = w.abs().max(LEAST_SPEED);
        for (side, s) in [1.0, -1.0].into_iter().enumerate() {
            found.limits[side] =
                gains.beyond(s, speed, found.U).unwrap_or_else(|| gains.envelope.settled(speed, s, found.U));
        }
        (found, found.both(gains, w, i))
    }

    /// Sets the voltage for the references, and returns whether all plain references fit it.
    #[inline]
    fn fits(
        &mut self,
        gains: &WeakeningGains,
        par: &WeakeningParameters,
        (w, u_dc, injected): (f64, f64, f64),
    ) -> bool {
        let highest = gains.highest(u_dc);
        self.U = (par.k_u * highest - self.trim - injected).max(LEAST_SHARE * highest);
        let ([copper, cross, flux], speed) = (gains.voltage, w.abs());
        copper + speed * (cross + speed * flux) <= self.U * self.U
    }

    /// The limits (A) of negative and positive torque at the electrical speed `w` (rad/s), at most `i`.
    #[inline]
    fn both(&self, gains: &WeakeningGains, w: f64, i: f64) -> (f64, f64) {
        // NaN if the speed is NaN: no torque then.
        let [motoring, generating] = self.limits.map(|limit| (limit.tau * gains.per_torque).max(0.0).min(i));
        if w >= 0.0 { (generating, motoring) } else { (motoring, generating) }
    }

    /// Computes the limits, motoring and generating, if the plain references may exceed them.
    fn limits_near(&mut self, gains: &WeakeningGains, w: f64, k: u64) {
        let moved = (self.U - self.U_then).abs() > LEAST_CHANGE * self.U;
        if moved {
            self.U_then = self.U;
        }
        for (side, (s, turn)) in [(1.0, 0), (-1.0, EVERY / 2)].into_iter().enumerate() {
            let acts = self.clipped && self.generates == (side == 1);
            if moved || acts || (k + turn).is_multiple_of(EVERY) {
                self.limits[side] = self.limit(gains, side, s, w);
            }
        }
    }

    fn limit(&mut self, gains: &WeakeningGains, side: usize, s: f64, w: f64) -> Limit {
        if let Some(limit) = gains.beyond(s, w, self.U) {
            self.warm[side] = WarmStart::default();
            return limit;
        }
        gains.envelope.limit(w, s, self.U, &mut self.warm[side])
    }

    /// Currents (A) for the torque `tau` (N.m) at the electrical speed `w` (rad/s): the `plain` ones, of maximum torque per
    /// ampere if `mtpa`, or on the voltage limit; |i_q| at most `i_q_max`.
    #[inline]
    pub fn currents(
        &mut self,
        gains: &WeakeningGains,
        tau: f64,
        w: f64,
        i_q_max: f64,
        mtpa: bool,
        plain: impl Fn() -> DqHat,
    ) -> DqHat {
        if !self.near {
            return plain();
        }
        self.generates = tau * w < 0.0;
        let limit = self.limits[usize::from(self.generates)];
        self.clipped = tau.abs() >= limit.tau * (1.0 - 1e-9);
        let solve = |i_d, steps| gains.envelope.i_d(tau, w, self.U, i_d, steps);
        // Motoring, i_d falls up to the limit; generating, the voltage over R makes it rise at first.
        let least = if self.generates { limit.i.d().min(gains.envelope.least_i_d(w)) } else { limit.i.d() };
        let on_the_limit = |i_d: f64| {
            let i_d = i_d.max(least);
            DqHat::new(i_d, gains.envelope.i_q(tau, i_d))
        };
        // While weakening, the root is near the last one, and left of maximum torque per ampere.
        let warm = || solve(self.i_d, 2).map(on_the_limit).filter(|&i| gains.envelope.beyond_mtpa(i));
        let i = if self.clipped {
            // The root is double on MTPV, but its currents are known already.
            DqHat::new(limit.i.d(), limit.i.q().abs().copysign(tau))
        } else if let Some(i) = if self.weakens && mtpa { warm() } else { None } {
            i
        } else {
            let plain = plain();
            if gains.envelope.excess(plain, w, self.U) <= 0.0 {
                self.weakens = false;
                return plain;
            }
            let warm = if self.weakens && !mtpa { solve(self.i_d, 2) } else { None };
            let i = on_the_limit(warm.or_else(|| solve(plain.d(), COLD)).unwrap_or(least));
            if i.d() >= plain.d() {
                self.weakens = false;
                return plain;
            }
            i
        };
        (self.i_d, self.weakens) = (i.d(), true);
        DqHat::new(i.d(), i.q().clamp(-i_q_max, i_q_max))
    }

    /// Integrates the trim over one sample of `T_s` (s) with the voltage `u` (V) that the current loop requests.
    #[inline]
    pub fn integrate(&mut self, gains: &WeakeningGains, par: &WeakeningParameters, (u, u_dc): (f64, f64), T_s: f64) {
        let highest = gains.highest(u_dc);
        self.trim = (self.trim + T_s * par.bandwidth * (u - par.k_t * highest)).min(GREATEST_TRIM * highest).max(0.0);
    }
}

/// The voltage `u` (V) as a share of u_dc / sqrt 3; 0 without a link.
#[inline]
pub fn share(u: f64, u_dc: f64) -> f64 {
    if u_dc > 1e-3 { u * SQRT_3 / u_dc } else { 0.0 }
}

type P = Row<WeakeningParameters>;

/// Variables of field weakening; their owner supplies the prefix `weakening.`.
pub const WEAKENING: &Table<WeakeningParameters> = table![
    P::boolean_parameter(
        "use",
        "Field weakening: i_d and the torque limits follow the voltage of u_dc, injection methods refuse it; false: no i_d beyond current.mtpa",
        |p| &mut p.used,
    ),
    P::parameter(
        "k_u",
        &ONE,
        "Share of u_max that field weakening uses in steady state; u_max = u_dc/sqrt(3), or that of modulation.mode",
        |p| &mut p.k_u,
    )
    .at_least(0.5)
    .at_most(1.0),
    P::parameter(
        "k_t",
        &ONE,
        "Share of u_max above which the trim reduces the voltage of field weakening; at least k_u",
        |p| &mut p.k_t,
    )
    .at_least(0.5)
    .at_most(1.1),
    P::parameter("bandwidth", &RAD_PER_S, "Bandwidth of the trim; 0: no trim", |p| &mut p.bandwidth)
        .at_least(0.0)
        .tunable(),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::ControllerParameters;

    fn gains(par: &ControllerParameters, tau: f64, mtpa: bool) -> WeakeningGains {
        WeakeningGains::new(&par.motor, &par.limit, tau, mtpa, 1.0, LeastTracker::default())
    }

    /// A request above k_t lowers the voltage of the references at the rate `bandwidth`, one below it raises it again, within
    /// its bounds.
    #[test]
    fn the_trim_lowers_the_voltage_while_too_much_is_requested() {
        let (par, u_dc) = (WeakeningParameters { used: true, ..WeakeningParameters::default() }, 540.0);
        let (highest, mut weakening) = (u_dc * INVERSE_SQRT_3, Weakening::default());
        let gains = gains(&ControllerParameters::default(), 3.0, false);
        weakening.integrate(&gains, &par, ((par.k_t + 0.02) * highest, u_dc), 1e-4);
        let expected = 1e-4 * par.bandwidth * 0.02 * highest;
        assert!((weakening.trim - expected).abs() < 1e-9, "{} V, not {expected} V", weakening.trim);
        weakening.limits(&gains, &par, (1.0, u_dc, 10.0), 5.0, 0);
        assert!((weakening.U - (par.k_u * highest - expected - 10.0)).abs() < 1e-9, "{} V", weakening.U);
        for _ in 0..200_000 {
            weakening.integrate(&gains, &par, (1.2 * highest, u_dc), 1e-4);
        }
        assert!((weakening.trim - GREATEST_TRIM * highest).abs() < 1e-9, "{} V", weakening.trim);
        for _ in 0..200_000 {
            weakening.integrate(&gains, &par, (0.5 * highest, u_dc), 1e-4);
        }
        assert!(weakening.trim.abs() < 1e-12, "{} V", weakening.trim);
    }

    /// Up to the onset, the voltage of the torque's currents fits, and it does not above.
    #[test]
    fn the_onset_is_where_the_voltage_is_used_up() {
        let motor = Motor::IPMSM_2_2_KW;
        let par = ControllerParameters { motor: motor.clone(), ..ControllerParameters::default() };
        let gains = gains(&par, 14.0, true);
        let i = max_torque_per_ampere(&motor, 14.0);
        let w = gains.onset(200.0);
        let u = i * motor.R_s + DqHat::new(motor.psi_M + motor.L_d * i.d(), motor.L_q * i.q()).turned() * w;
        assert!(
            (u.magnitude() / 200.0 - 1.0).abs() < 0.01 && u.magnitude() < 200.0 + 1e-9,
            "{} V at {w} rad/s",
            u.magnitude()
        );
    }

    /// Torques are expressed as the i_q of the magnet alone.
    #[test]
    fn the_gains_count_the_magnet_along_d() {
        let motor = Motor::IPMSM_2_2_KW;
        let par = ControllerParameters { motor: motor.clone(), ..ControllerParameters::default() };
        let gains = gains(&par, 20.0, false);
        assert!((gains.per_torque * 1.5 * f64::from(motor.n_p) * motor.psi_M - 1.0).abs() < 1e-12);
    }
}
