//! Field weakening: the torque and the current references that the DC link allows, by feed-forward with a bounded trim.
//!
//! The voltage that the references may use is U = k_u u_dc / sqrt 3 - y. From U, the estimated speed and the machine
//! estimates, [`Envelope`] gives the limits of the torque and, for the torque within them, the least current. Where
//! today's reference (maximum torque per ampere, i_d = 0 or the low-speed law) fits the voltage, nothing is changed.
//!
//! The trim y corrects wrong estimates: dy/dt = w_t (|u| - k_t u_dc / sqrt 3), 0 <= y <= 0.3 u_dc / sqrt 3, with the voltage
//! |u| that the current loop requests, before the hexagon. It changes U, never i_d, so that MTPV and the current limit
//! stay right; it also moves while the current error is large, where wrong estimates would saturate the loop for good.
//!
//! The speed loop's limits are those of the torque. They fall as the speed rises, so while one acts, the integrator
//! follows: dI/dt = w_s (limited - wanted), besides the hold of [`speed`](crate::control::speed).
//!
//! The limit of the sign that the drive uses is computed at every sample while it acts, else at every other one, and that
//! of the other sign at every eighth.

use crate::control::envelope::{Envelope, Limit, Warm};
use crate::control::reference::max_torque_per_ampere;
use crate::control::tables::{ALL_PARAMETERS, ControllerParameters};
use crate::estimator::{Class, Kind};
use crate::frame::DqHat;
use fmu_core::unit::{ONE, RAD_PER_S};
use fmu_core::{Fault, Row, Table};
use serde::{Deserialize, Serialize};

const SQRT_3: f64 = 1.732_050_807_568_877_2;
const INVERSE_SQRT_3: f64 = 1.0 / SQRT_3;

/// Least share of u_dc / sqrt 3 that the references may use.
const LEAST_SHARE: f64 = 0.05;

/// Greatest trim, as a share of u_dc / sqrt 3.
const GREATEST_TRIM: f64 = 0.3;

/// Least electrical speed in rad/s that the limits are computed for.
const LEAST_SPEED: f64 = 1e-3;

/// Least torque per ampere of i_q, as a share of that of the magnet alone.
const LEAST_TORQUE: f64 = 0.2;

/// Parameters of field weakening.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WeakeningParameters {
    /// Field weakening is in use.
    pub used: bool,
    /// Share of u_dc / sqrt 3 that the references use, 0.5..1.
    pub k_u: f64,
    /// Share of u_dc / sqrt 3 above which the trim acts, k_u..1.1.
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
    /// Currents (A) of the greatest positive torque of today's reference.
    end: DqHat,
    /// Inverse of the torque constant in A/(N.m).
    per_torque: f64,
    /// Parts of |u|^2 that bound those of all its currents: constant, by w, by w^2.
    voltage: [f64; 3],
    /// Least useful i_d in A.
    least: f64,
}

impl WeakeningGains {
    /// For a reference that may ask for `tau` (N.m), with maximum torque per ampere (`mtpa`) or i_d = 0.
    pub fn new(par: &ControllerParameters, tau: f64, mtpa: bool) -> Self {
        let ControllerParameters { motor, limit, .. } = par;
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
            least: -limit.i.min(motor.psi_M / motor.L_d),
        }
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
    /// Some of today's references does not fit the voltage.
    near: bool,
    /// Motoring, generating.
    limits: [Limit; 2],
    warm: [Warm; 2],
    /// The drive generates: the second limit is the one in use.
    generates: bool,
    /// The limit in use acts.
    clipped: bool,
    /// i_d of the last sample in A, read while weakening.
    i_d: f64,
    /// i_d is below today's reference.
    pub weakens: bool,
}

impl Weakening {
    /// Greatest magnitudes of negative and positive torque at the electrical speed `w` (rad/s), as i_q (A) of the magnet's
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
        let highest = u_dc * INVERSE_SQRT_3;
        self.U = (par.k_u * highest - self.trim - injected).max(LEAST_SHARE * highest);
        let ([copper, cross, flux], speed) = (gains.voltage, w.abs());
        if copper + speed * (cross + speed * flux) <= self.U * self.U {
            if self.near {
                let Self { trim, U, .. } = *self;
                *self = Self { trim, U, ..Self::default() };
            }
            return (i, i);
        }
        self.near = true;
        let [motoring, generating] = self.limits_near(gains, speed.max(LEAST_SPEED), i, k);
        if w >= 0.0 { (generating, motoring) } else { (motoring, generating) }
    }

    /// The limits (A), motoring and generating, where today's references may not fit; at most `i`.
    #[inline(never)]
    fn limits_near(&mut self, gains: &WeakeningGains, w: f64, i: f64, k: u64) -> [f64; 2] {
        let mut allowed = [i; 2];
        for (side, s) in [1.0, -1.0].into_iter().enumerate() {
            let end = DqHat::new(gains.end.d(), s * gains.end.q());
            if gains.envelope.excess(end, w, self.U) <= 0.0 {
                self.warm[side] = Warm::default();
                self.limits[side] = Limit { i: DqHat::new(gains.least, 0.0), tau: f64::INFINITY };
                continue;
            }
            let every = if self.generates != (side == 1) {
                8
            } else if self.clipped {
                1
            } else {
                2
            };
            if k.is_multiple_of(every) || self.warm[side].is_cold() {
                self.limits[side] = gains.envelope.limit(w, s, self.U, &mut self.warm[side]);
            }
            // Not a number if the speed is none: no torque then.
            allowed[side] = (self.limits[side].tau * gains.per_torque).max(0.0).min(i);
        }
        allowed
    }

    /// Currents (A) for the torque `tau` (N.m) at the electrical speed `w` (rad/s): `today`'s, or on the voltage limit; |i_q|
    /// at most `i_q_max`.
    #[inline]
    pub fn currents(&mut self, gains: &WeakeningGains, tau: f64, w: f64, today: DqHat, i_q_max: f64) -> DqHat {
        if self.near { self.currents_near(gains, tau, w, today, i_q_max) } else { today }
    }

    #[inline(never)]
    fn currents_near(&mut self, gains: &WeakeningGains, tau: f64, w: f64, today: DqHat, i_q_max: f64) -> DqHat {
        self.generates = tau * w < 0.0;
        let limit = self.limits[usize::from(self.generates)];
        if gains.envelope.excess(today, w, self.U) <= 0.0 {
            self.weakens = false;
            return today;
        }
        self.clipped = tau.abs() >= limit.tau * (1.0 - 1e-9);
        let i = if self.clipped {
            // At the limit, the root is double on MTPV: its currents are known already.
            DqHat::new(limit.i.d(), limit.i.q().abs().copysign(tau))
        } else {
            let solve = |i_d, steps| gains.envelope.i_d(tau, w, self.U, i_d, steps);
            let warm = if self.weakens { solve(self.i_d, 2) } else { None };
            let i_d = warm.or_else(|| solve(today.d(), 8)).unwrap_or(limit.i.d()).max(limit.i.d());
            DqHat::new(i_d, gains.envelope.i_q(tau, i_d))
        };
        self.i_d = i.d();
        self.weakens = i.d() < today.d();
        if self.weakens { DqHat::new(i.d(), i.q().clamp(-i_q_max, i_q_max)) } else { today }
    }

    /// Integrates the trim over one sample of `T_s` (s) with the voltage `u` (V) that the current loop requests.
    #[inline]
    pub fn integrate(&mut self, par: &WeakeningParameters, u: f64, u_dc: f64, T_s: f64) {
        let highest = u_dc * INVERSE_SQRT_3;
        self.trim = (self.trim + T_s * par.bandwidth * (u - par.k_t * highest)).min(GREATEST_TRIM * highest).max(0.0);
    }
}

/// Share of u_dc / sqrt 3 that the voltage `u` (V) takes; 0 without a link.
#[inline]
pub fn share(u: f64, u_dc: f64) -> f64 {
    if u_dc > 1e-3 { u * SQRT_3 / u_dc } else { 0.0 }
}

/// Checks that field weakening can work with the other parameters.
///
/// # Errors
/// States which parameters do not fit together, and what to do.
pub fn validate(par: &ControllerParameters) -> Result<(), Fault> {
    let ControllerParameters { weakening: own, motor, limit, estimator, .. } = par;
    if !own.used {
        return Ok(());
    }
    let table = ALL_PARAMETERS;
    let estimator_is = table.tell(par, |p| &mut p.estimator);
    let limit_is = table.tell(par, |p| &mut p.limit.i);
    let use_is = table.tell(par, |p| &mut p.weakening.used);
    if own.k_t < own.k_u {
        let least = table.tell(par, |p| &mut p.weakening.k_u);
        return Err(table.fault(par, |p| &mut p.weakening.k_t, format!("at least {least}")));
    }
    if estimator.class() == Class::Injection {
        return Err(Fault::new(format!(
            "{use_is} with {estimator_is}: injection leaves no voltage for field weakening; choose Hybrid, or set the first \
             to false"
        )));
    }
    if *estimator == Kind::VoltageFeedback && (own.k_u > 0.9 || own.k_t > own.k_u) {
        return Err(Fault::new(format!(
            "{} and {} with {estimator_is}, which mistakes a saturated hexagon for an angle error: set both to the same \
             value, at most 0.9",
            table.tell(par, |p| &mut p.weakening.k_u),
            table.tell(par, |p| &mut p.weakening.k_t)
        )));
    }
    let most = 0.7 * motor.psi_M / motor.L_d;
    if *estimator == Kind::VoltageModel && limit.i > most {
        return Err(Fault::new(format!(
            "{limit_is} with {estimator_is} and {use_is}: the estimator's gain has no bound near the current -psi_M / L_d; at \
             most {most:.4} A (0.7 psi_M / L_d), or another estimator"
        )));
    }
    let most = (1.0 - LEAST_TORQUE) * motor.psi_M / (motor.L_d - motor.L_q);
    if motor.L_q < motor.L_d && limit.i > most {
        return Err(Fault::new(format!(
            "{limit_is} with {use_is} and L_q < L_d: the torque of i_q vanishes at the current -psi_M / (L_d - L_q); at most \
             {most:.4} A (0.8 psi_M / (L_d - L_q))"
        )));
    }
    Ok(())
}

type P = Row<WeakeningParameters>;

/// Variables of field weakening; their owner supplies the prefix `weakening.`.
pub const WEAKENING: &Table<WeakeningParameters> = &Table::new(
    const {
        &[
            P::boolean_parameter(
                "use",
                "Field weakening: i_d and the torque limits follow the voltage of u_dc; false: no i_d beyond current.mtpa",
                |p| &mut p.used,
            ),
            P::parameter(
                "k_u",
                &ONE,
                "Share of u_dc / sqrt(3) that field weakening uses in steady state; the rest is for changes",
                |p| &mut p.k_u,
            )
            .at_least(0.5)
            .at_most(1.0),
            P::parameter(
                "k_t",
                &ONE,
                "Share of u_dc / sqrt(3) above which the trim reduces the voltage of field weakening; at least k_u",
                |p| &mut p.k_t,
            )
            .at_least(0.5)
            .at_most(1.1),
            P::parameter("bandwidth", &RAD_PER_S, "Bandwidth of the trim; 0: no trim", |p| &mut p.bandwidth)
                .at_least(0.0)
                .tunable(),
        ]
    },
);
