//! The sample period and the bandwidths of the loops: as given in the machine's file, or by these rules.
//!
//! - T_s: the longest of 100, 50, 25 and 12.5 us that gives at least 12 samples per electrical period at the highest speed. A
//!   voltage that is held for a sample turns by 30 deg there against the rotor, a loss of 1.1 %, and the command,
//!   which acts 1.5 samples later on average, is turned ahead by 45 deg. The EMF observer gets as many samples for its poles.
//! - Observer, the target of every method: the (electrical) acceleration alpha that it must follow causes an angle error of at
//!   most alpha / w_n^2 = 0.35 rad. Flux observers follow the acceleration at maximum current, with at least 300 rad/s; all
//!   others that at 1.6 times the rated torque, the limit, with at least 2 pi 20 rad/s.
//! - Speed: a step of the torque T makes the speed dip by 2/e T / (J w_s), with a double pole at w_s / 2. The dip should be at
//!   most 0.05 pu; w_s is at least 40 rad/s (flux observers) or 2 pi 5 rad/s, at most a third of the observer, which rises for it up
//!   to a limit, or a fifth of the current loop (Sensored); with a back EMF, less where the gain through the change of i_q would be high
//!   ([`limits`](super::limits)). The hybrid has a third of that gain, and meets it with less bandwidth of the EMF as well.
//! - Current: 2 pi 250 rad/s (flux observers); 2 pi 200 rad/s for all others, and at most half of what is stable with the estimate 90 deg
//!   off, as in a reversal, where an estimator is without EMF for a moment. At standstill, the current through the plant's iron answers
//!   to the voltage at once, so with the gain K of the loop, K (T_s / L_q + G) is at most half, too. With an injection, the limit is a
//!   third: the mean over the carrier's period delays the current, and the loop answers to the carrier's current, too. VoltageFeedback
//!   reads the integrators of the current loop, whose slow pole turns at about -K_i / (L (w_c + j w)): at speeds above w_c it lags
//!   behind the tracker, and the drive swings. Its w_c is at least the highest electrical speed, with a gain w_c L T_s of at most 1/3
//!   of the least inductance.

use super::iron;
use super::motor::{Data, Located, torque_constant};
use super::setting::{LEVELS, Setting, Value};
use drive::estimator::{Class, Kind};
use fmu_core::digits::rounded;
use std::f64::consts::{E, TAU};

/// Minimum number of samples per electrical period at the highest speed.
const SAMPLES: f64 = 12.0;

/// Sample periods in s to choose from.
const PERIODS: [f64; 4] = [1e-4, 5e-5, 2.5e-5, 1.25e-5];

/// Target of the rules: dip of the speed in pu under a step of the rated torque.
const DIP: f64 = 0.05;

/// Gain of the speed loop through the EMF caused by a change of i_q, see [`limits`](super::limits): the limit of the rules.
const CALM: f64 = 0.6 * GREATEST_GAIN;

/// [`CALM`] for the hybrid, which changes over to the EMF at low speed.
const CALM_HYBRID: f64 = 0.2 * GREATEST_GAIN;

/// Maximum product of the gain of VoltageFeedback's current loop and T_s / L.
const FEEDBACK_GAIN: f64 = 1.0 / 3.0;

/// Minimum ratio of the current loop's bandwidth to that of the speed loop, with a sensor.
const CURRENT_PER_SPEED: f64 = 5.0;

/// A value and its origin.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The value in rad/s or s.
    pub value: f64,
    rule: String,
    /// Offset in the machine's file, where given.
    pub origin: Option<usize>,
}

impl Chosen {
    fn new(given: Option<&Located>, rule: &str, value: impl FnOnce() -> f64) -> Self {
        given.map_or_else(
            || Self { value: value(), rule: rule.into(), origin: None },
            |x| Self { value: *x.get_ref(), rule: "as given".into(), origin: Some(x.span().start) },
        )
    }

    /// The setting of the variable `name`.
    pub fn setting(&self, name: &'static str) -> Setting {
        Setting { name, value: Value::Real(self.value), rule: self.rule.clone(), origin: self.origin }
    }
}

/// Sample period in s, and bandwidths in rad/s.
#[derive(Clone, Debug)]
pub struct Bandwidths {
    /// Sample period.
    pub T_s: Chosen,
    /// Current loop.
    pub current: Chosen,
    /// Speed loop.
    pub speed: Chosen,
    /// Observer or tracker.
    pub observer: Chosen,
}

impl Bandwidths {
    /// The given ones, or those of the rules for this estimator.
    pub fn of(data: &Data, estimator: Kind) -> Self {
        let class = estimator.class();
        let (flux, sensored) = (class == Class::FluxObserver, class == Class::Sensored);
        let emf = matches!(class, Class::BackEmf | Class::Hybrid);
        let (given, machine) = (&data.bandwidth, &data.machine);
        let n_p = f64::from(*machine.n_p.get_ref());
        let needed = DIP_OF_A_STEP * acceleration(data) / (DIP * data.rating.speed.get_ref());
        let wanted = needed.max(if flux { 40.0 } else { TAU * 5.0 });
        let tracker = || {
            Chosen::new(given.observer.as_ref(), "follows the maximum torque, at least 2 pi 20 rad/s", || {
                let least = 1.1 * (n_p * GREATEST_TORQUE * acceleration(data) / 0.35).sqrt();
                // With w_s = rho / 3, this bounds the gain.
                let calm = if emf { (3.0 * CALM / gain_per_bandwidth(data, 1.0)).cbrt() } else { f64::INFINITY };
                least.max(TAU * 20.0).max((3.0 * wanted).min(TAU * 40.0).min(calm))
            })
        };
        let tracker = (!flux).then(tracker);
        let observed = tracker.as_ref().filter(|_| !sensored).map_or(0.0, |rho| EMF_PER_TRACKER * rho.value);
        let fastest = observed.max(n_p * data.rating.top());
        let rule = "12 samples or more per electrical period and per period of the EMF observer";
        let T_s = Chosen::new(data.control.T_s.as_ref(), rule, || {
            PERIODS.into_iter().find(|T_s| TAU / (fastest * T_s) >= SAMPLES).unwrap_or(PERIODS[3])
        });
        let observer = tracker.unwrap_or_else(|| {
            Chosen::new(given.observer.as_ref(), "follows the maximum acceleration, at least 300 rad/s", || {
                (1.05 * least_observer(data)).max(300.0).max((3.0 * wanted).min(600.0 * PERIODS[0] / T_s.value))
            })
        });
        let current = if flux {
            Chosen::new(given.current.as_ref(), "250 Hz", || TAU * 250.0)
        } else {
            let (L_d, L_q) = (*machine.L_d.get_ref(), *machine.L_q.get_ref());
            let injects = class.injects();
            let stable = (MARGIN * L_d.min(L_q) / T_s.value + 0.9 * machine.R_s.get_ref()) / (2.0 * L_d.max(L_q));
            let stable = if injects { CARRIER / MARGIN * stable } else { stable };
            // The estimate is right, and the rotor at rest: the iron's current answers to the voltage at once.
            let of_iron = iron::at_standstill(data);
            let iron =
                (MARGIN / (T_s.value / L_d.max(L_q) + of_iron) + 0.9 * machine.R_s.get_ref()) / (2.0 * L_d.max(L_q));
            let iron = if of_iron > 0.0 { iron } else { f64::INFINITY };
            let usual = if sensored { TAU * 200.0 } else { (TAU * 200.0).min(stable) }.min(iron);
            // Without active resistance.
            let fastest = FEEDBACK_GAIN * L_d.min(L_q) / (L_d.max(L_q) * T_s.value);
            let reads = (n_p * data.rating.top()).min(fastest);
            if estimator == Kind::VoltageFeedback && reads > usual {
                let rule =
                    "the highest electrical speed: the estimate lags with the integrators; gain T_s / L of 1/3 at most";
                Chosen::new(given.current.as_ref(), rule, || reads)
            } else {
                let rule = if usual >= iron {
                    "200 Hz, at most half of the stable limit with the iron's current at standstill"
                } else if injects {
                    "200 Hz, at most 1/3 of the stable limit with the estimate 90 deg off: the current without the carrier is late"
                } else {
                    "200 Hz, at most half of the stable limit with the estimate 90 deg off"
                };
                Chosen::new(given.current.as_ref(), rule, || usual)
            }
        };
        let calm = match class {
            // With a third of the EMF's bandwidth, which the gain limits as well: see `by_emf`.
            Class::Hybrid => (CALM_HYBRID / (9.0 * gain_per_bandwidth(data, 1.0))).cbrt(),
            _ if emf => CALM / gain_per_bandwidth(data, observer.value),
            _ => f64::INFINITY,
        };
        let most = if sensored { current.value / CURRENT_PER_SPEED } else { observer.value / 3.0 };
        let chosen = wanted.min(most).min(calm);
        let why = if chosen < wanted.min(most) {
            "limited by the gain through the change of i_q"
        } else if chosen < wanted {
            if sensored { "a fifth of the current loop" } else { "a third of the observer" }
        } else if chosen > needed {
            "the minimum"
        } else {
            "for this dip"
        };
        let dip = rounded(DIP * needed / chosen, 2);
        let rule = format!("{why}: with an exact estimate, a step of the rated torque takes {dip} pu off the speed");
        let speed = Chosen::new(given.speed.as_ref(), &rule, || chosen);
        Self { T_s, current, speed, observer }
    }

    /// Bandwidth in rad/s of the hybrid where it uses the EMF.
    pub fn by_emf(&self, data: &Data) -> f64 {
        self.observer.value.min((CALM_HYBRID / (gain_per_bandwidth(data, 1.0) * self.speed.value)).sqrt())
    }
}

/// Maximum product of the current loop's gain and T_s / L where the estimate is 90 deg off and the gain for the larger inductance acts on
/// the lower one: half of the value at which the loop oscillates.
const MARGIN: f64 = 0.5;

/// [`MARGIN`] with an injection: the mean over the carrier's period delays the current, and with one of three samples the loop oscillates
/// at 0.71.
const CARRIER: f64 = 1.0 / 3.0;

/// Dip of the speed loop under a step of the torque T, in units of T / (J w_s): a double pole at w_s / 2.
pub const DIP_OF_A_STEP: f64 = 2.0 / E;

/// Mechanical acceleration in rad/s2 by the rated torque.
pub fn acceleration(data: &Data) -> f64 {
    data.rating.torque.get_ref() / data.mechanics.J.get_ref()
}

/// Minimum bandwidth in rad/s of the observer: it must follow the maximum acceleration.
pub fn least_observer(data: &Data) -> f64 {
    let greatest = torque_constant(data) * 0.8 * data.rating.current.get_ref() / data.mechanics.J.get_ref();
    (f64::from(*data.machine.n_p.get_ref()) * greatest / 0.35).sqrt()
}

/// Limit of the torque in units of the rated torque.
pub const GREATEST_TORQUE: f64 = 1.6;

/// Bandwidth of the EMF observer in units of the tracker's.
pub const EMF_PER_TRACKER: f64 = 7.5;

/// Maximum loop gain through the EMF of the change of i_q, at 0.1 pu.
pub const GREATEST_GAIN: f64 = 40.0;

/// Gain of the speed loop through the EMF caused by a change of i_q, per rad/s of w_s, at 0.1 pu and the tracker's `rho`
/// (rad/s).
pub fn gain_per_bandwidth(data: &Data, rho: f64) -> f64 {
    let (machine, n_p) = (&data.machine, f64::from(*data.machine.n_p.get_ref()));
    let saliency = (machine.L_q.get_ref() - machine.L_d.get_ref()).abs();
    let emf = n_p * LEVELS[0] * data.rating.speed.get_ref() * machine.psi_M.get_ref();
    data.mechanics.J.get_ref() * saliency * rho * rho / (torque_constant(data) * n_p * emf)
}
