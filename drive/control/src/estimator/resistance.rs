//! Adaptation of the stator resistance from the flux error of Rasmussen's observer.
//!
//! With R~ = R - R^, x = psi_rd^ - psi_M^, d = psi_M^ - psi_M, y = psi_M theta~ and the speed adaptation holding
//! psi_rq^ = 0, the observer's error obeys, for small theta~,
//!
//! ```text
//! dx/dt = -c_1 x + w y + R~ i_d        dy/dt = -w (x + d) + R~ i_q
//! ```
//!
//! **At rest** (w = 0), x settles at R~ i_d / c_1 for any psi_M^ and theta~. So R^ follows, at the `bandwidth` b:
//!
//! ```text
//! dR^/dt = b c_1 g x i_d / (i_d^2 + i_q^2 + i^2),   g = (1 - (w_f / (2 rad/s))^2)^4 at rest, otherwise 0
//! ```
//!
//! w_f is the low-passed mechanical speed; beyond 2 rad/s, g is 0. R^ adapts only while the reference is standstill: at a
//! creeping speed the same law gives s^3 + c_1 s^2 + (w^2 + k i_d) s + k w i_q, unstable for w i_q < 0. There, x = R~ i_q / w - d shows R~ only
//! together with the error of psi_M^, and a fast k with i_q / w as regressor lost 3 to 7 of 56 creeping cells with a generating
//! load. R^ therefore stays constant while the reference is a speed, unless it is tracked.
//!
//! A drive with Rasmussen's observer that starts at rest stays at rest, with i_0 and without a reference, until 0.05 of R~
//! remains (3.7 / b with i = i_0 / 2, longer where the rotor swings), at most for 20 / b: a rotor that starts before R^ is
//! measured fails to start.
//!
//! **At creep**, the steady state is sin theta~ = -(c_1 d + R~ i_d) / (w psi_M) + c_1 R~ i_q / (w^2 psi_M). A constant
//! c_1 lets both terms grow without limit towards w = 0: at 30 rpm, psi_M^ = 1.2 psi_M has no equilibrium. With
//! c_1 = k_c |w|, an error of psi_M^ costs the same angle at every speed, and the poles of s^2 + k_c |w| s + w^2 are
//! damped by k_c / 2. An equilibrium exists for psi_M^ / psi_M <= sqrt(1 + 1 / k_c^2): up to 1.41 with k_c = 1.
//! A small c_1 needs a known R^: the remaining share r of R~ obeys dr/dt = -b g i_d^2 / (i_d^2 + i_q^2 + i^2) r from
//! r = 1, as long as |w_f| psi_M < 0.05 R^ |i_d|, and c_1 = c_1' + r^2 (c_1 - c_1'), c_1' = min(c_1, k_c |w|).
//!
//! **Tracking at creep** (`adaptation.tracking` = k_t, off at the start): with the regressor i_q / w and only as far as x
//! exceeds the uncertainty delta psi_M^ (`adaptation.flux`) of the magnet flux,
//!
//! ```text
//! dR^/dt = k_t |w| f (x - sat(x, delta psi_M^)) w i_q / (i_q^2 + (0.12 i)^2),   f = (1 - (w k_c / (2 c_1))^2)^2
//! ```
//!
//! With c_1' = |w|, its poles are those of s^3 + |w| s^2 + (w^2 + k i_d) s + k w i_q, k = k_t |w| w i_q / (i_q^2 + ...):
//! stable for k_t (1 + i_d / |i_q|) < 1 with a generating load, where the zero at -w i_q / i_d lies in the right
//! half-plane. So k_t = 0.15 is the useful value; it lags a ramp of R by dR/dt / (k_t |w|). A psi_M^ that is wrong by more than
//! delta makes R^ drift; without i_q, nothing is observable and R^ stays.
//!
//! **k_a** adds the voltage k_a R_nom g i_q on the q-axis, which acts like a lower R^ there: dy/dt = k_a R_nom i_q
//! turns the frame until i_d carries the load, the safe side at rest, where theta~ is not observable: with an exact R^
//! an offset of current or voltage makes it drift. It also acts where the speed reference and i_q have the same sign:
//! a start under load then leaves the false lock at the limit of i_q. For a generating load it would be unstable.
//!
//! **In torque mode**, a zero torque reference counts as rest: i_q = 0 makes the last coefficient k w i_q of the polynomial above
//! vanish, so R^ may adapt while the rotor coasts below 2 rad/s, too. There it goes to the R^ that explains the error of psi_M^,
//! x = -d, and returns within 1 / b once the rotor rests. R^ stays constant while the torque reference is not zero, and a start
//! at speed begins with `motor.R_s`; c_1 does not fall below c_1 / 5, because no reference says in which direction the rotor will
//! turn.
//!
//! Not observable: R^ without current or while the speed or torque reference is not zero; theta~ and psi_M^ at rest.

use crate::estimator::contract::{ContextOf, Sample, SetupOf};
use drive_base::frame::DqHat;
use drive_base::motor::Motor;
use fmu_core::unit::{AMPERE, ONE, PER_SECOND};
use fmu_core::{Fault, Row, Table, table};
use serde::{Deserialize, Serialize};

/// Mechanical speed in rad/s below which a speed reference counts as standstill.
pub(super) const STANDSTILL: f64 = 0.05;
/// Mechanical speed in rad/s above which the adaptation stops.
const GATE: f64 = 2.0;
/// Corner frequency in rad/s of the low-pass filter of the speed.
pub(super) const FILTER: f64 = 100.0;

/// Current i_q below which the tracking slows down, as a share of `adaptation.i`.
const LITTLE: f64 = 0.12;

/// Current i_q that counts as no torque in torque mode, as a share of `adaptation.i`.
const NO_TORQUE: f64 = 5e-3;

/// Minimum c_1 in torque mode, as a share of c_1.
const LEAST_C_1: f64 = 0.2;

/// Share of R~ that may remain when a drive starts from rest, and the maximum time at rest in units of 1 / `bandwidth`.
const KNOWN: f64 = 0.05;
const LONGEST_REST: f64 = 20.0;

/// Voltage of a swinging rotor, as a share of R^ i_d, above which R~ does not count as measured.
const SWING: f64 = 0.05;

/// Parameters of the adaptation; shares are relative to `motor.R_s`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResistanceParameters {
    /// The observer adapts the resistance.
    pub resistance: bool,
    /// Voltage on the q-axis at standstill, as a share of R_s i_q, >= 0.
    pub k_a: f64,
    /// Rate at which R^ approaches R at rest in 1/s, > 0.
    pub bandwidth: f64,
    /// Current in A below which the adaptation slows down, > 0.
    pub i: f64,
    /// First value, as a share.
    pub start: f64,
    /// Lowest value, as a share.
    pub min: f64,
    /// Highest value, as a share.
    pub max: f64,
    /// c_1 at creep divided by the electrical speed, > 0.
    pub k_c: f64,
    /// Rate at which R^ follows R at creep divided by the electrical speed, >= 0; 0: R^ stays constant there.
    pub tracking: f64,
    /// Error of psi_M^ that the tracking does not attribute to R, as a share of psi_M^, >= 0.
    pub flux: f64,
}

impl Default for ResistanceParameters {
    fn default() -> Self {
        Self {
            resistance: false,
            k_a: 0.0,
            bandwidth: 20.0,
            i: 2.5,
            start: 0.8,
            min: 0.4,
            max: 2.5,
            k_c: 1.0,
            tracking: 0.0,
            flux: 0.06,
        }
    }
}

impl ResistanceParameters {
    /// First estimate in Ohm: `motor.R_s` if a torque requested `at_once` leaves no time to adapt.
    pub(super) fn first(&self, motor: &Motor, at_once: bool) -> f64 {
        let share = if at_once { 1.0 } else { self.start };
        share * motor.R_s
    }

    /// Maximum time in s for which a drive starting at rest waits to measure its resistance.
    pub fn longest_rest(&self) -> f64 {
        LONGEST_REST / self.bandwidth
    }

    /// The estimate `R` (Ohm) within the clamps.
    #[inline]
    pub(super) fn within(&self, motor: &Motor, R: f64) -> f64 {
        R.max(self.min * motor.R_s).min(self.max * motor.R_s)
    }
}

/// State of the adaptation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Resistance {
    /// Estimated resistance in Ohm.
    pub R: f64,
    /// Share of the initial error that remains.
    remaining: f64,
    /// Low-passed electrical speed in rad/s.
    w_f: f64,
}

/// Output of the adaptation to the observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted {
    /// Feedback gain of the d-axis flux error in 1/s.
    pub c_1: f64,
    /// Voltage to add on the q-axis in V.
    pub v_q: f64,
}

impl Resistance {
    /// The adaptation at the first sample, at the electrical speed `w` (rad/s).
    pub fn start<All: AsRef<ResistanceParameters>>(context: &ContextOf<All>, sample: &Sample, w: f64) -> Self {
        let at_once = sample.speed_ref.is_none() && w != 0.0;
        Self { R: context.of::<ResistanceParameters>().first(context.motor, at_once), remaining: 1.0, w_f: w }
    }

    /// One sample with the observer's gain `c_1` (1/s), the flux error `x` (Wb), the current `i` (A) in the estimated frame, and the electrical speed
    /// `w` (rad/s).
    #[inline]
    pub fn update<All: AsRef<ResistanceParameters>>(
        &mut self,
        context: &ContextOf<All>,
        c_1: f64,
        sample: &Sample,
        x: f64,
        i: DqHat,
        w: f64,
    ) -> Adapted {
        let ContextOf { motor, T_s, .. } = *context;
        let (par, n_p) = (context.of::<ResistanceParameters>(), f64::from(motor.n_p));
        self.w_f += T_s * FILTER * (w - self.w_f);
        // Whether the reference is zero, its sign, and the minimum speed at which c_1 is full.
        let (rest, asked, least) = match sample.speed_ref {
            Some(speed_ref) => (speed_ref.abs() < STANDSTILL, speed_ref, n_p * speed_ref.abs()),
            None => (sample.i_ref.q().abs() < NO_TORQUE * par.i, 0.0, LEAST_C_1 * c_1),
        };
        let share = self.w_f / (n_p * GATE);
        let near = (1.0 - share * share).max(0.0);
        let g = near * near * near * near;
        let v_q = if rest || asked * i.q() > 0.0 { par.k_a * motor.R_s * g * i.q() } else { 0.0 };
        if rest {
            let rate = T_s * par.bandwidth * g / (i.d() * i.d() + i.q() * i.q() + par.i * par.i);
            let R = self.R + rate * c_1 * x * i.d();
            self.R = par.within(motor, R);
            // A rotor that swings by w adds up to w psi_M to the R~ i_d that x shows.
            if self.w_f.abs() * motor.psi_M < SWING * self.R * i.d().abs() {
                self.remaining -= self.remaining * rate * i.d() * i.d();
            }
            return Adapted { c_1, v_q };
        }
        if par.tracking > 0.0 {
            self.track(context, c_1, x, i.q());
        }
        let low = c_1.min(par.k_c * self.w_f.abs().max(least));
        Adapted { c_1: low + self.remaining * self.remaining * (c_1 - low), v_q }
    }
}

impl Resistance {
    /// Whether little of the initial error remains.
    #[inline]
    pub fn is_known(&self) -> bool {
        self.remaining <= KNOWN
    }

    /// A creeping sample with the observer's gain `c_1` (1/s), the flux error `x` (Wb) and the current `i_q` (A).
    #[inline]
    fn track<All: AsRef<ResistanceParameters>>(&mut self, context: &ContextOf<All>, c_1: f64, x: f64, i_q: f64) {
        let ContextOf { motor, T_s, .. } = *context;
        let par = context.of::<ResistanceParameters>();
        let known = par.flux * motor.psi_M;
        let share = self.w_f * par.k_c / (2.0 * c_1);
        let fade = (1.0 - share * share).max(0.0);
        let (i_0, excess) = (LITTLE * par.i, x - x.max(-known).min(known));
        let rate = T_s * par.tracking * self.w_f.abs() * fade * fade;
        let R = self.R + rate * excess * self.w_f * i_q / (i_q * i_q + i_0 * i_0);
        self.R = par.within(motor, R);
    }
}

/// Checks that the clamps contain `motor.R_s`.
///
/// # Errors
/// States the unsuitable parameter and a remedy.
pub fn validate<All: AsRef<ResistanceParameters>>(setup: &SetupOf<All>) -> Result<(), Fault> {
    let ResistanceParameters { resistance, start, min, max, .. } = setup.of();
    if !resistance {
        return Ok(());
    }
    if *min > 1.0 {
        let allowed = "at most 1, so that motor.R_s lies between the clamps; lower it, or correct motor.R_s";
        return Err(setup.fault("adaptation.min", allowed));
    }
    if *max < 1.0 {
        let allowed = "at least 1, so that motor.R_s lies between the clamps; raise it, or correct motor.R_s";
        return Err(setup.fault("adaptation.max", allowed));
    }
    if !(min..=max).contains(&start) {
        let allowed = format!("{min} to {max}, the clamps adaptation.min and adaptation.max");
        return Err(setup.fault("adaptation.start", allowed));
    }
    Ok(())
}

type P = Row<ResistanceParameters>;

/// The adaptation's variables; their owner adds the prefix `adaptation.`.
pub const ADAPTATION: &Table<ResistanceParameters> = table![
            P::boolean_parameter(
                "resistance",
                "Rasmussen (while the reference is standstill, and after a start at rest, before any reference acts, for at \
                 most 20 / adaptation.bandwidth) and FluxObserver adapt the resistance, Sensored ignores it, the others refuse it; false: \
                 motor.R_s",
                |p| &mut p.resistance,
            ),
            P::parameter(
                "k_a",
                &ONE,
                "Rasmussen: voltage on the q axis near standstill as a share of R_s i_q, lets the d-axis current carry the load; others refuse it",
                |p| &mut p.k_a,
            )
            .at_least(0.0)
            .at_most(1.0)
            .tunable(),
            P::parameter("bandwidth", &PER_SECOND, "Rate at which the resistance converges at standstill", |p| {
                &mut p.bandwidth
            })
            .above(0.0)
            .tunable(),
            P::parameter("i", &AMPERE, "Current below which the adaptation slows down", |p| &mut p.i)
                .above(0.0)
                .tunable(),
            P::parameter("start", &ONE, "First resistance estimate as a share of motor.R_s; below 1: safe side", |p| {
                &mut p.start
            })
            .above(0.0),
            P::parameter("min", &ONE, "Lowest resistance estimate as a share of motor.R_s, 1 or less", |p| &mut p.min)
                .above(0.0),
            P::parameter("max", &ONE, "Highest resistance estimate as a share of motor.R_s, 1 or more", |p| &mut p.max)
                .above(0.0),
            P::parameter(
                "k_c",
                &ONE,
                "Upper limit of rasmussen.c_1 divided by the electrical speed, once the resistance is known",
                |p| &mut p.k_c,
            )
            .above(0.0)
            .tunable(),
            P::parameter(
                "tracking",
                &ONE,
                "Rasmussen: rate at which the resistance is followed at creeping speed divided by the electrical speed, \
                 others refuse it; 0: it stays constant there",
                |p| &mut p.tracking,
            )
            .at_least(0.0)
            .at_most(1.0),
            P::parameter(
                "flux",
                &ONE,
                "Error of psi_M that the tracking does not take for one of the resistance, as a share of motor.psi_M",
                |p| &mut p.flux,
            )
            .at_least(0.0)
            .at_most(1.0)
            .tunable(),
        ];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;

    const T_S: f64 = 1e-4;

    /// The adaptation after `seconds` next to a machine of 2 Ohm, from an estimate of `R_hat` (Ohm), with the currents `i` (A) at
    /// the speed reference `w` (rad/s); the flux error is the steady one of the observer, `x` (R~ in Ohm, c_1 in 1/s) in Wb.
    fn adapted(
        set: impl FnOnce(&mut EstimatorParameters),
        (R_hat, i, w): (f64, DqHat, f64),
        seconds: f64,
        x: impl Fn(f64, f64) -> f64,
    ) -> (Resistance, Adapted) {
        let mut par = EstimatorParameters::default();
        par.adaptation.resistance = true;
        set(&mut par);
        let motor = Motor::default();
        let context = ContextOf { par: &par, motor: &motor, J: 1.5e-3, T_s: T_S };
        let sample = Sample { speed_ref: Some(w / f64::from(motor.n_p)), ..Sample::default() };
        let mut resistance = Resistance { R: R_hat, ..Resistance::start(&context, &sample, w) };
        let (mut adapted, mut t) = (Adapted { c_1: par.rasmussen.c_1, v_q: 0.0 }, 0.0);
        while t < seconds {
            let of_error = x(2.0 - resistance.R, adapted.c_1);
            adapted = resistance.update(&context, par.rasmussen.c_1, &sample, of_error, i, w);
            t += T_S;
        }
        (resistance, adapted)
    }

    /// At rest, x = R~ i_d / c_1: the estimate converges to the resistance from both sides, at the rate
    /// b i_d^2 / (i_d^2 + i_q^2 + i^2).
    #[test]
    fn at_rest_the_estimate_comes_to_the_resistance() {
        for (R_hat, i_d) in [(1.6, 5.0), (2.6, 5.0), (1.6, -5.0)] {
            let i = DqHat::new(i_d, 1.0);
            let (resistance, _) = adapted(|_| (), (R_hat, i, 0.0), 0.1, |error, c_1| error * i_d / c_1);
            let par = ResistanceParameters::default();
            let left = (R_hat - 2.0) * (-0.1 * par.bandwidth * 25.0 / (26.0 + par.i * par.i)).exp();
            assert!((resistance.R - 2.0 - left).abs() < 1e-3, "from {R_hat} Ohm: {} Ohm", resistance.R);
        }
    }

    /// At creep, x = R~ i_q / w beyond the uncertainty of the magnet: tracking converges to the resistance in both directions of
    /// rotation, motoring and generating.
    #[test]
    fn tracking_comes_to_the_resistance() {
        let track = |p: &mut EstimatorParameters| (p.adaptation.tracking, p.adaptation.flux) = (0.15, 0.0);
        for (w, i_q) in [(10.0, 4.0), (10.0, -4.0), (-10.0, 4.0), (-10.0, -4.0)] {
            for R_hat in [1.6, 2.6] {
                let (resistance, _) =
                    adapted(track, (R_hat, DqHat::new(0.0, i_q), w), 20.0, |error, _| error * i_q / w);
                assert!((resistance.R - 2.0).abs() < 1e-3, "{w} rad/s, {i_q} A: {} Ohm", resistance.R);
            }
        }
        let (held, _) = adapted(|_| (), (1.6, DqHat::new(0.0, 4.0), 10.0), 1.0, |error, _| error * 0.4);
        assert!((held.R - 1.6).abs() < 1e-12, "without tracking, it stays: {} Ohm", held.R);
    }

    /// Once the resistance is known, c_1 falls to k_c |w|; before, it stays.
    #[test]
    fn a_known_resistance_lowers_the_gain() {
        let ((_, unknown), (_, rest)) = (
            adapted(|_| (), (1.6, DqHat::new(5.0, 1.0), 10.0), 0.1, |_, _| 0.0),
            adapted(|_| (), (1.6, DqHat::new(5.0, 1.0), 0.0), 0.1, |_, _| 0.0),
        );
        assert!((unknown.c_1 - 50.0).abs() < 1e-9 && (rest.c_1 - 50.0).abs() < 1e-12, "{unknown:?} {rest:?}");
        let par = EstimatorParameters::default();
        let (motor, i) = (Motor::default(), DqHat::new(5.0, 1.0));
        let context = ContextOf { par: &par, motor: &motor, J: 1.5e-3, T_s: T_S };
        let at = |speed: f64| Sample { speed_ref: Some(speed), ..Sample::default() };
        let mut resistance = Resistance::start(&context, &at(0.0), 0.0);
        for _ in 0..20_000 {
            resistance.update(&context, par.rasmussen.c_1, &at(0.0), 0.0, i, 0.0);
        }
        let creep = resistance.update(&context, par.rasmussen.c_1, &at(10.0 / 3.0), 0.0, i, 10.0);
        assert!((creep.c_1 - par.adaptation.k_c * 10.0).abs() < 1e-3, "{creep:?}");
    }
}
