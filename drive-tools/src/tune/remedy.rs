//! Remedies for a drive that does not start or does not hold its load. Each is tried before it is named.

use super::motor::MotorFile;
use super::pace::Pace;
use super::rules;
use super::setting::{Tuned, Value};
use super::trial::{self, Task, Trial};
use fmu_core::digits::rounded;
use std::fmt;
use toml::Spanned;

/// Number of start angles in the first try, which rules out most ineffective remedies.
const FEW: u32 = 4;

/// A condition under which a drive fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// The start from any angle.
    Start,
    /// The load as a step.
    Load,
}

impl fmt::Display for What {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "START",
            Self::Load => "LOAD",
        })
    }
}

/// A remedy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cure {
    /// The load rises in this time in s.
    Rise(f64),
    /// A load step of this torque in N.m instead.
    Torque(f64),
    /// Other bandwidths in rad/s.
    Bandwidths {
        /// Bandwidth of the speed loop.
        speed: f64,
        /// Bandwidth of observer or tracker.
        observer: f64,
    },
    /// Another inertia.
    Inertia {
        /// Inertia in kg.m2.
        J: f64,
        /// Whether it is more than in the file: with the inertia of the load.
        more: bool,
    },
    /// Maximum change of the speed reference in rad/s2.
    Ramp(f64),
    /// A sensor of the rotor's angle.
    Sensor,
}

impl fmt::Display for Cure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rise(time) => write!(f, "let the load rise over at least {time} s"),
            Self::Torque(torque) => write!(f, "keep steps of the load below {torque} N.m"),
            Self::Bandwidths { speed, observer } => {
                write!(f, "set bandwidth.speed to {speed} rad/s and bandwidth.observer to {observer} rad/s")
            }
            Self::Inertia { J, more: true } => {
                write!(f, "count the load's inertia in mechanics.J: {J:.2e} kg.m2 would hold")
            }
            Self::Inertia { J, .. } => write!(f, "lower mechanics.J to {J:.2e} kg.m2"),
            Self::Ramp(rate) => {
                write!(f, "limit the change of speed_ref to {rate} rad/s2 (speed_loop.ramp of the controller)")
            }
            Self::Sensor => f.write_str("use a sensor (estimator Sensored)"),
        }
    }
}

impl Cure {
    /// Drive and task with this change; none if the rules refuse it.
    pub fn applied(&self, motor: &MotorFile, tuned: &Tuned, task: &Task) -> Option<(Tuned, Task)> {
        let number = |x: f64| Spanned::new(0..0, x);
        let mut motor = motor.clone();
        match *self {
            Self::Rise(rise) => return Some((tuned.clone(), Task { rise, ..*task })),
            Self::Torque(torque) => return Some((tuned.clone(), Task { torque, ..*task })),
            Self::Ramp(rate) => return Some((tuned.with("speed_loop.ramp", Value::Real(rate)), *task)),
            Self::Sensor => {
                let sensed = tuned
                    .with("estimator", Value::Item("Sensored".into()))
                    .with("start.mode", Value::Item("Direct".into()))
                    .with("emf.hold_reversal", Value::Boolean(false));
                return Some((sensed, *task));
            }
            Self::Bandwidths { speed, observer } => {
                motor.data.bandwidth.speed = Some(number(speed));
                motor.data.bandwidth.observer = Some(number(observer));
            }
            Self::Inertia { J, .. } => motor.data.mechanics.J = number(J),
        }
        Some((rules::tune(&motor).ok()?, *task))
    }
}

/// The remedies if `trial` showed that the drive does not start or does not hold: the shortest rise time, and the smallest
/// change of each kind. With them, the drive still passes everything it passed in `trials`.
pub fn found(motor: &MotorFile, tuned: &Tuned, trials: &[Trial], trial: &Trial, what: What) -> Vec<Cure> {
    let speed = tuned.real("speed_loop.bandwidth").unwrap_or_default();
    let observer = tuned.observer;
    let J = *motor.data.mechanics.J.get_ref();
    let first = |cures: &[Cure]| cures.iter().copied().find(|cure| helps(motor, tuned, trials, (trial, what), cure));
    let each = |factors: &[f64], cure: &dyn Fn(f64) -> Cure| factors.iter().map(|&x| cure(x)).collect::<Vec<_>>();
    let unit = 2.0 * Pace::of(tuned, &tuned.pair(), trial.task.level, 0.0).loops();
    let kinds: Vec<Vec<Cure>> = match what {
        What::Load => vec![
            each(&[1.0, 2.0, 4.0, 8.0, 16.0, 32.0], &|x| Cure::Rise(short(x * unit))),
            each(&[1.5, 2.0, 3.0], &|x| {
                let speed = short(x * speed);
                Cure::Bandwidths { speed, observer: short((3.0 * speed).max(observer)) }
            }),
            each(&[1.25, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0], &|x| Cure::Inertia { J: short(x * J), more: true }),
        ],
        What::Start => vec![
            each(&[0.3, 0.1, 0.03], &|x| Cure::Ramp(short(x * tuned.torque / J))),
            each(&[0.7, 0.5, 0.35, 0.25], &|x| Cure::Bandwidths { speed: short(x * speed), observer: short(observer) }),
            each(&[0.5, 0.25, 0.1, 0.05], &|x| Cure::Inertia { J: short(x * J), more: false }),
        ],
    };
    let mut cures: Vec<Cure> = kinds.iter().filter_map(|kind| first(kind)).collect();
    if cures.is_empty() && what == What::Load {
        cures.extend(first(&each(&[0.95, 0.9, 0.75, 0.5, 0.25], &|x| Cure::Torque(short(x * trial.task.torque)))));
    }
    if cures.is_empty() {
        cures.extend(first(&[Cure::Sensor]));
    }
    cures
}

/// A lower bandwidth of the speed loop that ends the swings of a drive without a load, without failing anything it passed before.
pub fn calm(motor: &MotorFile, tuned: &Tuned, trials: &[Trial]) -> Option<Cure> {
    let (speed, observer) = (tuned.real("speed_loop.bandwidth")?, tuned.observer);
    let each = [0.7, 0.5, 0.35, 0.25].map(|x| Cure::Bandwidths { speed: short(x * speed), observer: short(observer) });
    each.into_iter().find(|cure| {
        let holds = |(tuned, task): (Tuned, Task), old: &Trial| {
            let new = trial::at(&tuned, &task, FEW);
            (new.starts() || !old.starts()) && (new.holds() || !old.holds())
        };
        let with = |task: &Task| cure.applied(motor, tuned, task);
        let quiet = trials
            .first()
            .and_then(|trial| with(&trial.task))
            .is_some_and(|(tuned, _)| trial::swings(&tuned).is_empty());
        quiet && trials.iter().all(|trial| with(&trial.task).is_some_and(|cured| holds(cured, trial)))
    })
}

/// Whether the drive passes `what` with the change, and everything it passed before.
fn helps(motor: &MotorFile, tuned: &Tuned, trials: &[Trial], (trial, what): (&Trial, What), cure: &Cure) -> bool {
    let Some((cured, task)) = cure.applied(motor, tuned, &trial.task) else { return false };
    let does = |angles| {
        let new = trial::at(&cured, &task, angles);
        match what {
            What::Start => new.starts(),
            What::Load => new.holds() && (new.starts() || !trial.starts()),
        }
    };
    let still = |other: &Trial| {
        let new = trial::at(&cured, &other.task, FEW);
        (new.starts() || !other.starts()) && (new.holds() || !other.holds())
    };
    let alone = matches!(cure, Cure::Rise(_) | Cure::Torque(_));
    let others = || trials.iter().filter(|other| other.task != trial.task);
    does(1) && does(FEW) && does(trial.angles) && (alone || others().all(still))
}

/// A number with two digits, rounded up.
fn short(x: f64) -> f64 {
    let scale = 10.0_f64.powf(x.log10().floor() - 1.0);
    rounded((x / scale).ceil() * scale, 2)
}
