//! Gains computed from the parameters, and the references without field weakening that follow from them: the low-speed law, and
//! the currents of a torque.

use crate::current::CurrentGains;
use crate::estimator::{Class, Kind};
use crate::lock::{LockGains, Reach};
use crate::reference::{max_torque, max_torque_per_ampere};
use crate::speed::SpeedGains;
use crate::tables::ControllerParameters;
use crate::weakening::WeakeningGains;
use drive_base::frame::DqHat;
use drive_base::math::{at_least, at_most};
use serde::{Deserialize, Serialize};

/// Gains computed from the parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Gains {
    pub(crate) current: CurrentGains,
    /// Gains of the current loop in the frame of a start, which may be off the rotor by any angle.
    pub(crate) off_rotor: CurrentGains,
    pub(crate) speed: SpeedGains,
    /// Torque constant in N.m/A.
    pub(crate) k: f64,
    /// Maximum torque in N.m divided by the torque constant: the limit of the speed loop in A.
    pub(crate) i_tau: f64,
    /// i_d in A of the maximum torque, by maximum torque per ampere.
    pub(crate) i_d_end: f64,
    /// The estimator is a flux observer: it needs the low-speed law at standstill, where the others would only have its
    /// losses.
    pub(crate) observes_flux: bool,
    pub(crate) lock: LockGains,
    pub(crate) weakening: WeakeningGains,
}

impl Gains {
    /// From the parameters.
    pub(crate) fn new(par: &ControllerParameters) -> Self {
        Self::with(par, par.estimator)
    }

    /// From the parameters, with a different `estimator` in use.
    pub(crate) fn with(par: &ControllerParameters, estimator: Kind) -> Self {
        let ControllerParameters { current, speed_loop, motor, J, limit, lock, T_s, .. } = par;
        // Finite, so that zero current gives zero torque for any psi_M.
        let k = motor.torque_constant().min(f64::MAX);
        let observes_flux = estimator.class() == Class::FluxObserver;
        // With i_d of the low-speed law, the current limits are computed at each sample.
        let by_law = observes_flux && !current.mtpa;
        let tau = if by_law { limit.tau } else { max_torque(motor, limit, current.mtpa) };
        let weakening =
            WeakeningGains::new(motor, limit, tau, current.mtpa, par.modulation.mode.reach(), par.least_tracker());
        let speed = SpeedGains::new(speed_loop, *J, k);
        let (i, n_p) = ((tau / k).min(limit.i).min(limit.i_q), f64::from(motor.n_p));
        let reach = Reach { integral: n_p * speed.error_integral(i), acceleration: n_p / J, lag: speed_loop.lag() };
        Self {
            current: CurrentGains::new(current, motor),
            off_rotor: CurrentGains::off_rotor(current, motor, *T_s),
            speed,
            k,
            i_tau: tau / k,
            i_d_end: max_torque_per_ampere(motor, tau).d(),
            observes_flux,
            lock: LockGains::new(lock, motor, *T_s, reach),
            weakening,
        }
    }

    /// The low-speed law of a flux observer with the current `i_0` (A) at the estimated mechanical `speed` (rad/s), and the torque
    /// that remains; other estimators have no such law.
    #[inline]
    pub(crate) fn law(&self, par: &ControllerParameters, i_0: f64, speed: f64) -> Law {
        if !self.observes_flux {
            return Law { limit: self.i_tau, ..Law::default() };
        }
        let share = par.zero_speed.share(speed);
        let i_d = share * i_0;
        let end = if par.current.mtpa { i_d + (1.0 - share) * self.i_d_end } else { i_d };
        let i_q = par.limit.i_q_beside(end);
        let most = if Self::exact(par) { par.motor.torque(end, i_q) / self.k } else { i_q };
        Law { share, i_d, limit: at_least(at_most(most, self.i_tau), f64::MIN_POSITIVE) }
    }

    /// Output of the speed loop in A for the references `i` (A) without field weakening.
    pub(crate) fn loop_output(&self, par: &ControllerParameters, i: DqHat) -> f64 {
        let by_i_q = self.observes_flux && !Self::exact(par);
        if by_i_q { i.q() } else { par.motor.torque(i.d(), i.q()) / self.k }
    }

    /// Whether the torque includes the reluctance torque, also with the i_d of the low-speed law.
    #[inline]
    fn exact(par: &ControllerParameters) -> bool {
        par.current.mtpa || par.speed_loop.torque_mode
    }

    /// References of the currents (A) without field weakening for the torque of `i_q` (A): i_d of the `law`, blended into that
    /// of maximum torque per ampere.
    #[inline]
    pub(crate) fn currents(&self, par: &ControllerParameters, law: &Law, i_q: f64) -> DqHat {
        if par.current.mtpa && !self.observes_flux {
            return max_torque_per_ampere(&par.motor, self.k * i_q);
        }
        if !(self.observes_flux && Self::exact(par)) {
            return DqHat::new(law.i_d, i_q);
        }
        let mut i_d = law.i_d;
        if par.current.mtpa {
            // The limit is the end of the curve: no current exceeds its own limit before.
            let most = max_torque_per_ampere(&par.motor, self.k * self.i_tau * (i_q / law.limit));
            i_d += (1.0 - law.share) * most.d();
        }
        DqHat::new(i_d, self.k * i_q / par.motor.torque(i_d, 1.0))
    }
}

impl Law {
    /// The law without its current; the limit remains as for a nonzero torque reference.
    pub(crate) fn released(self) -> Self {
        Self { i_d: 0.0, ..self }
    }
}

/// The low-speed law at a sample.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Law {
    /// Share of `zero_speed.i_0`.
    pub(crate) share: f64,
    /// i_d in A that it requests.
    pub(crate) i_d: f64,
    /// Maximum torque in N.m that remains, divided by the torque constant.
    pub(crate) limit: f64,
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use drive_base::motor::Motor;

    /// Parameters after `set`, and their gains.
    pub(crate) fn controller(set: impl FnOnce(&mut ControllerParameters)) -> (Gains, ControllerParameters) {
        let mut controller = crate::SensorlessController::default();
        set(&mut controller.parameters);
        fmu_core::Model::derive(&mut controller);
        (controller.gains, controller.parameters)
    }

    /// i_d of the low-speed law fades into that of maximum torque per ampere, and i_q supplies the remaining torque.
    #[test]
    fn the_currents_give_the_torque_at_every_speed() {
        let (gains, par) = controller(|p| {
            (p.motor, p.current.mtpa) = (Motor::IPMSM_2_2_KW, true);
            (p.limit.i, p.limit.i_q, p.zero_speed.i_0) = (15.0, 15.0, 4.0);
        });
        for tau in [3.0, -9.0] {
            for (speed, law_share) in [(0.0, 1.0), (-10.0 * std::f64::consts::LN_2, 0.5), (1e4, 0.0)] {
                let law = gains.law(&par, par.zero_speed.i_0, speed);
                let i = gains.currents(&par, &law, tau / gains.k);
                let torque = par.motor.torque(i.d(), i.q());
                assert!((torque - tau).abs() < 1e-9, "{tau} N.m at {speed} rad/s: {torque} N.m");
                assert!((law.share - law_share).abs() < 1e-12 && (law.i_d - 4.0 * law_share).abs() < 1e-12);
            }
            let [still, fast] = [0.0, 1e4]
                .map(|speed| gains.currents(&par, &gains.law(&par, par.zero_speed.i_0, speed), tau / gains.k));
            assert!((still.d() - 4.0).abs() < 1e-12, "at rest only the law acts: {still:?}");
            let mtpa = max_torque_per_ampere(&par.motor, tau);
            assert!((fast - mtpa).magnitude() < 1e-6, "at speed: {fast:?}, not {mtpa:?}");
        }
    }

    /// The torque of the limit has exactly the limit's current.
    #[test]
    fn the_low_speed_law_leaves_the_rest_of_the_current_limit() {
        let (gains, par) = controller(|p| (p.limit.i, p.limit.i_q, p.zero_speed.i_0) = (5.0, 5.0, 3.0));
        let law = gains.law(&par, par.zero_speed.i_0, 0.0);
        assert!((law.limit - 4.0).abs() < 1e-12, "{} A", law.limit);
        let (others, par) = controller(|p| p.estimator = crate::estimator::Kind::ExtendedEmf);
        let law = others.law(&par, par.zero_speed.i_0, 0.0);
        assert!(law.i_d.abs() < 1e-15 && (law.limit - 6.0).abs() < 1e-12, "no law: {} A", law.limit);
    }
}
