//! The references of a drive that has settled: the controller's limits and currents at a speed, without its sample grid.
//!
//! For maps and for models of the mean: the low-speed law, maximum torque per ampere and field weakening are computed as in a
//! sample ([`reference`](crate::reference), [`weakening`](crate::weakening)), with the machine estimates of the parameters, and
//! iterated to convergence. The estimates of angle and speed are the true ones, and nothing is injected.

use crate::gains::{Gains, Law};
use crate::tables::ControllerParameters;
use crate::weakening::Weakening;
use crate::zero_speed::ZeroSpeed;
use drive_base::frame::DqHat;
use drive_base::math::at_most;
use serde::{Deserialize, Serialize};

/// Torque that counts as zero with `zero_speed.release`, as a share of the torque of i_0.
const RELEASED: f64 = 1e-3;

/// Computed from the parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Settled {
    gains: Gains,
}

impl Settled {
    /// For these parameters.
    pub fn new(par: &ControllerParameters) -> Self {
        Self { gains: Gains::new(par) }
    }

    /// Gains of the speed loop, and the torque constant in N.m/A.
    #[inline]
    pub fn speed_loop(&self) -> (&crate::speed::SpeedGains, f64) {
        (&self.gains.speed, self.gains.k)
    }

    /// Proportional gains of the current loop in V/A.
    pub fn current_loop(&self) -> [f64; 2] {
        self.gains.current.proportional()
    }

    /// The references at the mechanical `speed` (rad/s) on a DC link of `u_dc` (V), with the trim `trim` (V) of field weakening;
    /// `par` are the parameters of [`new`](Self::new),
    /// `derating` is the share of the full torque.
    #[inline]
    pub fn at<'a>(
        &'a self,
        par: &'a ControllerParameters,
        (speed, u_dc): (f64, f64),
        trim: f64,
        derating: f64,
    ) -> SettledAt<'a> {
        let gains = &self.gains;
        let mut i_0 = par.zero_speed.i_0;
        if par.dc.used {
            i_0 = at_most(i_0, par.dc.i_0(&par.motor, u_dc));
        }
        let (law, w) = (gains.law(par, i_0, speed), f64::from(par.motor.n_p) * speed);
        let (weakening, (low, high)) = if par.weakening.used {
            Weakening::settled(&gains.weakening, &par.weakening, (w, u_dc), law.limit, trim)
        } else {
            (Weakening::default(), (law.limit, law.limit))
        };
        let derated = law.limit * derating;
        let (low, high): (f64, f64) = (low, high);
        let (low, high) = (low.min(derated), high.min(derated));
        let limits = [-gains.k * low, gains.k * high];
        let at = SettledAt { gains, par, law, i_0, w, weakening, limits, frees: false };
        if par.dc.used { at.within_the_battery(u_dc, speed) } else { at }
    }
}

/// The references at a speed and a DC-link voltage.
#[derive(Clone, Debug)]
pub struct SettledAt<'a> {
    gains: &'a Gains,
    par: &'a ControllerParameters,
    law: Law,
    /// Current of the law at standstill in A.
    i_0: f64,
    /// Electrical speed in rad/s.
    w: f64,
    weakening: Weakening,
    limits: [f64; 2],
    /// No current of the law flows.
    frees: bool,
}

impl SettledAt<'_> {
    /// With the limits of the DC link's current ([`battery`](crate::battery)).
    #[cold]
    fn within_the_battery(mut self, u_dc: f64, speed: f64) -> Self {
        let [low, high] = self.limits;
        let i_d = |tau: f64| self.currents(tau.max(low).min(high)).0.d();
        let (least, most) = self.par.dc.settled(&self.par.motor, u_dc, speed, i_d);
        self.limits = [low.max(-least), high.min(most)];
        self
    }

    /// Without the current of the low-speed law, if the shaft is to be free.
    #[must_use]
    pub fn freed(self, frees: bool) -> Self {
        Self { frees, ..self }
    }

    /// Whether no current of the low-speed law flows.
    pub fn frees(&self) -> bool {
        self.frees
    }

    /// Minimum and maximum torque in N.m that the references may request: the outputs `tau_min` and `tau_max`.
    #[inline]
    pub fn limits(&self) -> [f64; 2] {
        self.limits
    }

    /// Currents (A) for the torque `tau` (N.m) within the limits, and whether field weakening lowers i_d.
    #[inline]
    pub fn currents(&self, tau: f64) -> (DqHat, bool) {
        let &Self { gains, par, ref law, i_0, w, ref weakening, frees, .. } = self;
        // A torque that decays to 0 ends here.
        let asked = if tau.abs() > RELEASED * gains.k * par.zero_speed.i_0 { tau } else { 0.0 };
        let law = if frees || par.speed_loop.torque_mode && par.zero_speed.releases(asked) {
            law.released()
        } else if par.zero_speed.by_need {
            gains.law(par, ZeroSpeed::i_0_for(i_0, tau.abs() / gains.k), w / f64::from(par.motor.n_p))
        } else {
            *law
        };
        let plain = || gains.currents(par, &law, tau / gains.k);
        if !par.weakening.used {
            return (plain(), false);
        }
        let mut state = *weakening;
        let i = state.currents(&gains.weakening, tau, w, par.limit.i_q, par.current.mtpa, plain);
        (i, state.weakens)
    }
}
