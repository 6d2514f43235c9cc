//! Flux observer in stator axes with speed-adaptive tracking (Hinkkanen, Saarakkala, Awan, Mölsä, Tuovinen, "Observers
//! for sensorless synchronous motor drives: Framework for design and analysis", IEEE Trans. Ind. Appl. 54 (6), 2018, DOI
//! 10.1109/TIA.2018.2845877), with an adaptation of the resistance that works at every speed.
//!
//! ```text
//! d psi^/dt = u - R^ i + v        e = psi(i) - psi^        psi_a = psi_M^ + (L_d - L_q) i*        r + j s = e / psi_a
//! ```
//!
//! i* is the conjugate of the current in the estimated frame. For small theta~ = theta - theta^, s = -theta~ + Im(psi~ /
//! psi_a), psi~ = psi - psi^: the [tracker](crate::estimator::tracker) follows -s. The feedback v = c r psi_a, with
//! c = 2 k_1 = R^/2 (1/L_d + 1/L_q) + k_w |w^|, at most 1 / T_s, acts along psi_a only, so that the flux error z = psi~ / psi_a obeys
//!
//! ```text
//! dz/dt = -j w z - (R - R^) i / psi_a - c Re z,        poles s^2 + c s + w^2
//! ```
//!
//! independently of the tracker, and r = Re z shows it.
//!
//! **Resistance.** The sensitivity of psi~ to the resistance is known: h with dh/dt = -i - c rho psi_a, rho = Re(h / psi_a),
//! integrated along with psi^. It gives r = (R - R^) rho, at rest (rho = -i_d / (c psi_M)), at speed (rho = -i_q / (w psi_M)) and
//! in all transients between, with the right sign, also where rho passes zero. Hence the adaptive observer (Zhang, IEEE Trans.
//! Autom. Control 47 (3), 2002), with rho_0 = `adaptation.i` / (c_0 psi_M), c_0 = c at rest:
//!
//! ```text
//! dR^/dt = b r rho / (rho^2 + rho_0^2)        psi^ += h dR^        b = adaptation.bandwidth
//! ```
//!
//! The second equation removes what the old R^ left in psi^. The standstill gate and the freezing of R^ that Rasmussen's observer
//! needs ([`resistance`](crate::estimator::resistance)) are not necessary here: both substitute for the missing dynamics of r. A
//! small c makes the angle insensitive and rho large: while the reference is a speed, c <= k_c |w|, as there.
//! `adaptation.k_a` is not read: at creep it fought R^ and lost cells.
//!
//! **Magnet.** r also contains (psi_M^ - psi_M) / psi_a: psi_M^ follows -r where R^ has no part in it,
//! d psi_M^/dt = -b_M r psi_M^ / (1 + (rho / (0.3 rho_0))^2), stable: s^3 + (c + b_M) s^2 + w^2 s + b_M w^2.
//!
//! Limits: at w = 0 the angle is not observable; without current, neither is R. An offset of the current sensors acts like
//! a wrong R^ that turns: 20 mA loses cells at 0.01 pu. L_q^ = 1.2 L_q loses rated motoring load at 0.02 and 0.05 pu.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample};
use crate::estimator::resistance::{FILTER, ResistanceParameters, STANDSTILL};
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated, Turn};
use drive_base::math::at_most;
use drive_base::motor::Motor;
use fmu_core::unit::{ONE, PER_SECOND};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Share of `rho_0` above which the magnet flux adapts more slowly.
const MAGNET_ALONE: f64 = 0.3;
/// Minimum |psi_a|^2 as a share of `psi_M`^2.
const LEAST: f64 = 0.01;

/// Parameters of the observer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FluxObserverParameters {
    /// Gain c per electrical speed, >= 0.
    pub k_w: f64,
    /// Rate at which the magnet flux adapts in 1/s, >= 0; 0: not at all.
    pub magnet: f64,
}

impl Default for FluxObserverParameters {
    fn default() -> Self {
        Self { k_w: 0.4, magnet: 0.0 }
    }
}

/// State at the last sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FluxObserver {
    tracker: Tracker,
    /// Estimated stator flux linkage in Wb.
    psi: AlphaBeta,
    /// Its feedback in V.
    v: DqHat,
    /// Change of the flux error per resistance in Wb/Ohm.
    h: AlphaBeta,
    /// Its feedback in V/Ohm.
    v_h: DqHat,
    /// Adapted resistance in Ohm.
    R: f64,
    /// Adapted magnet flux linkage in Wb.
    psi_M: f64,
    /// Low-passed electrical speed in rad/s.
    w_f: f64,
}

impl<All: AsRef<FluxObserverParameters> + AsRef<ResistanceParameters> + AsRef<TrackerParameters>> Estimating<All>
    for FluxObserver
{
    /// The first resistance is on the safe side for Rasmussen's observer; in torque mode, it is `motor.R_s`.
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let ContextOf { motor, T_s, .. } = *context;
        let axis = Axis::<Estimated>::at(theta);
        let psi = axis.to_stator(flux(motor, motor.psi_M, axis.from_stator(sample.i)));
        let at_once = sample.speed_ref.is_none();
        let (R, psi_M) = (context.of::<ResistanceParameters>().first(motor, at_once), motor.psi_M);
        let tracker = Tracker::at(theta, w, T_s);
        (Self { tracker, psi, R, psi_M, w_f: w, ..Self::default() }, Estimate::new(theta, w, sample))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let ContextOf { motor, T_s, .. } = *context;
        self.tracker.advance(T_s);
        let axis = Axis::<Estimated>::at(self.tracker.theta);
        let half_way = axis.ahead(Turn::new(0.5 * (self.tracker.theta_last - self.tracker.theta)));
        let R = self.in_use(context);
        let mean = (sample.i_last + sample.i) * 0.5;
        self.psi += (sample.u - mean * R + half_way.to_stator(self.v)) * T_s;

        if context.of::<FluxObserverParameters>().magnet == 0.0 {
            self.psi_M = motor.psi_M;
        }
        let (i, psi_M, dL) = (axis.from_stator(sample.i), self.psi_M, motor.L_d - motor.L_q);
        let psi_a = DqHat::new(psi_M + dL * i.d(), -dL * i.q());
        let inverse = 1.0 / psi_a.dot(psi_a).max(LEAST * psi_M * psi_M);
        let e = flux(motor, psi_M, i) - axis.from_stator(self.psi);
        let r = inverse * psi_a.dot(e);

        let w = self.tracker.w;
        self.w_f += T_s * FILTER * (w - self.w_f);
        // Above 1 / T_s, the feedback overshoots; from 2 / T_s on, it is unstable.
        let most = 1.0 / T_s;
        let c_0 = at_most(0.5 * R * (1.0 / motor.L_d + 1.0 / motor.L_q), most);
        let mut c = at_most(c_0 + context.of::<FluxObserverParameters>().k_w * w.abs(), most);
        let mut others = 0.0;
        if context.of::<ResistanceParameters>().resistance {
            let asked = sample.speed_ref.map_or(0.0, f64::abs);
            if asked >= STANDSTILL {
                c = c.min(context.of::<ResistanceParameters>().k_c * self.w_f.abs().max(f64::from(motor.n_p) * asked));
            }
            self.h += (half_way.to_stator(self.v_h) - mean) * T_s;
            let rho = inverse * psi_a.dot(axis.from_stator(self.h));
            let rho_0 = context.of::<ResistanceParameters>().i / (c_0 * psi_M);
            self.adapt(context, r * rho / (rho * rho + rho_0 * rho_0));
            self.v_h = psi_a * (-c * rho);
            others = rho / (MAGNET_ALONE * rho_0);
        }
        self.v = psi_a * (c * r);
        self.psi_M -= T_s * context.of::<FluxObserverParameters>().magnet * r * psi_M / (1.0 + others * others);
        self.tracker.correct(context, context.of::<TrackerParameters>().bandwidth, -inverse * psi_a.cross(e), sample);
        Estimate { theta: self.tracker.theta, axis, w: self.tracker.w, i: sample.i, ..Estimate::default() }
    }

    #[inline]
    fn resistance(&self, context: &ContextOf<All>) -> f64 {
        self.in_use(context)
    }

    /// The adapted values of the machine stay.
    fn place(&mut self, context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) {
        *self = Self { R: self.R, ..Self::start(context, sample, theta, w).0 };
    }
}

impl FluxObserver {
    /// Resistance in Ohm.
    #[inline]
    fn in_use<All: AsRef<ResistanceParameters>>(&self, context: &ContextOf<All>) -> f64 {
        if context.of::<ResistanceParameters>().resistance { self.R } else { context.motor.R_s }
    }

    /// Moves the resistance along its estimated error (Ohm), within the clamps, and the flux with it.
    #[inline]
    fn adapt<All: AsRef<ResistanceParameters>>(&mut self, context: &ContextOf<All>, error: f64) {
        let ContextOf { motor, T_s, .. } = *context;
        let R = self.R + T_s * context.of::<ResistanceParameters>().bandwidth * error;
        let R = context.of::<ResistanceParameters>().within(motor, R);
        self.psi += self.h * (R - self.R);
        self.R = R;
    }
}

/// Stator flux linkage in Wb.
#[inline]
fn flux(motor: &Motor, psi_M: f64, i: DqHat) -> DqHat {
    DqHat::new(psi_M + motor.L_d * i.d(), motor.L_q * i.q())
}

type P = Row<FluxObserverParameters>;

/// The observer's variables; their owner adds the prefix `flux_observer.`.
pub const FLUX_OBSERVER: &Table<FluxObserverParameters> = table![
    P::parameter("k_w", &ONE, "Feedback gain of the flux error per electrical speed", |p| &mut p.k_w)
        .at_least(0.0)
        .tunable(),
    P::parameter(
        "magnet",
        &PER_SECOND,
        "Rate at which FluxObserver adapts psi_M, the others refuse it; 0: motor.psi_M",
        |p| &mut p.magnet,
    )
    .at_least(0.0),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::{beside, comes_to_the_rotor, salient, with_L_q};
    use drive_base::frame::Dq;

    #[test]
    fn comes_to_the_rotor_without_bias() {
        comes_to_the_rotor::<FluxObserver>(47.0);
    }

    #[test]
    fn a_wrong_l_q_turns_it() {
        let (more, less) = (with_L_q::<FluxObserver>(1.2), with_L_q::<FluxObserver>(0.8));
        assert!((more - 6.29).abs() < 0.3 && (less + 6.37).abs() < 0.3, "{more} {less} deg");
    }

    /// In both directions, motoring and generating: a wrong R^ turns the angle, and the adaptation removes it.
    #[test]
    fn the_resistance_converges_with_every_sign() {
        for w in [47.0, -47.0] {
            for i_q in [5.59, -5.59] {
                let hat = Motor { R_s: 1.3 * salient().R_s, ..salient() };
                let mut par = EstimatorParameters::default();
                let angle = |par: &EstimatorParameters, n| {
                    beside::<FluxObserver>(par, &hat, (w, Dq::new(2.0, i_q)), 0.0, n).0.to_degrees()
                };
                assert!(angle(&par, 20_000).abs() > 2.0, "{w} rad/s, {i_q} A: {} deg", angle(&par, 20_000));
                par.adaptation.resistance = true;
                assert!(angle(&par, 50_000).abs() < 0.02, "{w} rad/s, {i_q} A: {} deg", angle(&par, 50_000));
            }
        }
    }

    /// The magnet flux adapts together with the resistance.
    #[test]
    fn the_magnet_flux_converges() {
        let hat = Motor { psi_M: 1.2 * salient().psi_M, ..salient() };
        let mut par = EstimatorParameters::default();
        let angle = |par: &EstimatorParameters| {
            beside::<FluxObserver>(par, &hat, (235.0, Dq::new(-0.84, 5.59)), 0.0, 50_000).0.to_degrees()
        };
        assert!(angle(&par).abs() > 5.0, "{} deg", angle(&par));
        par.flux_observer.magnet = 5.0;
        assert!(angle(&par).abs() < 0.02, "{} deg", angle(&par));
    }

    /// The feedback, including the one of the resistance's effect, acts in the frame at the middle of the interval, in both
    /// directions.
    #[test]
    fn the_feedback_acts_half_way() {
        let (mut par, motor, T_s) = (EstimatorParameters::default(), salient(), 1e-4);
        par.adaptation.resistance = true;
        for w in [900.0, -900.0] {
            let context = ContextOf { par: &par, motor: &motor, J: 15e-3, T_s };
            let (mut observer, _) = FluxObserver::start(&context, &Sample::default(), 0.4, w);
            (observer.v, observer.v_h) = (DqHat::new(3.0, -2.0), DqHat::new(0.5, 1.5));
            let FluxObserver { psi, v, v_h, .. } = observer;
            // No error: the feedback is subtracted from the voltage, and the new flux linkage equals the magnet's.
            let middle = Axis::<Estimated>::at(0.4 + 0.5 * T_s * w);
            let end = Axis::<Estimated>::at(0.4 + T_s * w).along(motor.psi_M);
            let u = (end - psi) * (1.0 / T_s) - middle.to_stator(v);
            observer.update(&context, &Sample { u, ..Sample::default() });
            assert!((observer.psi - end).magnitude() < 1e-12, "{:?}, not {end:?} at {w} rad/s", observer.psi);
            let expected = middle.to_stator(v_h) * T_s;
            assert!((observer.h - expected).magnitude() < 1e-15, "{:?}, not {expected:?} at {w} rad/s", observer.h);
        }
    }

    /// One sample beside a rotor at `w` (rad/s), after which the flux is `error` (Wb) too long and h is `h` (Wb/Ohm), both along d.
    fn after(par: &EstimatorParameters, w: f64, error: f64, h: f64) -> FluxObserver {
        let (motor, T_s) = (salient(), 1e-4);
        let context = ContextOf { par, motor: &motor, J: 15e-3, T_s };
        let (mut observer, _) =
            FluxObserver::start(&context, &Sample { speed_ref: Some(w), ..Sample::default() }, 0.4, w);
        let d = Axis::<Estimated>::at(0.4 + T_s * w);
        (observer.h, observer.w_f) = (d.along(h), 0.0);
        let u = (d.along(motor.psi_M + error) - observer.psi) * (1.0 / T_s);
        observer.update(&context, &Sample { u, speed_ref: Some(w), ..Sample::default() });
        observer
    }

    /// v = c r psi_a, c = R/2 (1/L_d + 1/L_q) + k_w |w|, and the speed that bounds c follows with FILTER.
    #[test]
    fn the_feedback_grows_with_the_speed() {
        let (par, motor) = (EstimatorParameters::default(), salient());
        for w in [300.0, -300.0] {
            let observer = after(&par, w, 0.01, 0.0);
            let c = 0.5 * motor.R_s * (1.0 / motor.L_d + 1.0 / motor.L_q) + par.flux_observer.k_w * 300.0;
            assert!((observer.v - DqHat::new(-0.01 * c, 0.0)).magnitude() < 1e-9, "{:?} at {w} rad/s", observer.v);
            assert!((observer.w_f - 1e-4 * FILTER * w).abs() < 1e-9, "{} rad/s", observer.w_f);
        }
    }

    /// A small machine whose L/R is a fifth of the sample period: an error of the flux linkage decays.
    #[test]
    fn a_short_time_constant_is_stable() {
        let motor = Motor { n_p: 1, R_s: 5.0, L_d: 1e-4, L_q: 1e-4, psi_M: 1e-3 };
        let context = ContextOf { par: &EstimatorParameters::default(), motor: &motor, J: 1e-9, T_s: 1e-4 };
        let mut observer = FluxObserver::start(&context, &Sample::default(), 0.4, 0.0).0;
        observer.psi = observer.psi * 1.3;
        for _ in 0..20 {
            observer.update(&context, &Sample::default());
        }
        assert!((observer.psi.magnitude() / motor.psi_M - 1.0).abs() < 1e-9, "{:?} Wb", observer.psi);
    }

    /// dR^/dt = b r rho / (rho^2 + rho_0^2), psi^ += h dR^, and psi_M^ follows -r the less, the more R^ has to do with it.
    #[test]
    fn what_the_resistance_explains_is_not_the_magnet() {
        let (mut par, motor) = (EstimatorParameters::default(), salient());
        (par.adaptation.resistance, par.flux_observer.magnet) = (true, 5.0);
        let R = par.adaptation.first(&motor, false);
        let c_0 = 0.5 * R * (1.0 / motor.L_d + 1.0 / motor.L_q);
        let (rho_0, r) = (par.adaptation.i / (c_0 * motor.psi_M), -0.01 / motor.psi_M);
        for share in [0.0, 0.3, 1.0] {
            let rho = share * rho_0;
            let observer = after(&par, 300.0, 0.01, rho * motor.psi_M);
            let dR = 1e-4 * par.adaptation.bandwidth * r * rho / (rho * rho + rho_0 * rho_0);
            assert!((observer.R - R - dR).abs() < 1e-12, "{} Ohm at {share} rho_0", observer.R);
            let longer = observer.psi.magnitude() - motor.psi_M - 0.01;
            assert!((longer - rho * motor.psi_M * dR).abs() < 1e-12, "{longer} Wb at {share} rho_0");
            let left = 1.0 / (1.0 + (share / 0.3) * (share / 0.3));
            let expected = -1e-4 * 5.0 * r * motor.psi_M * left;
            assert!((observer.psi_M - motor.psi_M - expected).abs() < 1e-12, "{} Wb at {share} rho_0", observer.psi_M);
        }
    }
}
