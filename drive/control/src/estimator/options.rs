//! Options that only some estimators have. With any other estimator, the controller rejects them by name, so none is ignored
//! silently.
//!
//! An option is a variable that is off at its start value. Values of a method (bandwidths, voltages, noise densities) are not
//! options: each estimator reads its own, and a set of values may serve several.

use crate::estimator::pulsating::Demodulation;
use crate::estimator::tracker::TrackerKind;
use crate::estimator::{Class, Kind, Setup};
use Kind::{CurrentModel, DirectEmf, EmfObserver, ExtendedEmf, Hybrid, KalmanFilter, Rasmussen, Sensored, SlidingMode};
use Kind::{VoltageFeedback, VoltageModel};
use fmu_core::Fault;

struct Choice {
    /// Name of its variable.
    name: &'static str,
    /// Whether it is on with this estimator.
    asked: fn(&Setup, Kind) -> bool,
    /// Whether an estimator supports it.
    has: fn(Kind) -> bool,
    /// The function that other estimators lack.
    why: &'static str,
    /// How to turn it off.
    off: &'static str,
}

const NO_TRACKER: &[Kind] = &[Rasmussen, VoltageModel, CurrentModel, Sensored, KalmanFilter];
const SIGN_OF_EMF: &[Kind] = &[DirectEmf, EmfObserver, ExtendedEmf, VoltageFeedback, SlidingMode];
const FRAME_TERM: &[Kind] = &[DirectEmf, EmfObserver, ExtendedEmf, VoltageFeedback, Hybrid, VoltageModel, CurrentModel];

#[rustfmt::skip]
const CHOICES: &[Choice] = &[
    Choice { name: "start.mode", asked: |s, _| s.starts_by_injection, has: |kind| kind.class().injects(),
        why: "the start by injection needs an estimator that injects", off: "set start.mode = CurrentFrequency or Direct" },
    Choice { name: "zero_speed.by_need", asked: |s, _| s.by_need, has: |kind| kind == Kind::Rasmussen,
        why: "its i_q does not show a load at standstill, or it needs no current there", off: "set it to false" },
    Choice { name: "weakening.use", asked: |s, _| s.weakens, has: |kind| kind.class() != Class::Injection,
        why: "injection leaves no voltage for field weakening", off: "set it to false" },
    Choice { name: "modulation.mode", asked: |s, _| s.overmodulates, has: |kind| kind.class() != Class::Injection,
        why: "injection leaves no voltage for overmodulation", off: "set it to Linear" },
    Choice { name: "tracker.kind", asked: |s, _| s.par.tracker.kind != TrackerKind::Pll, has: |kind| !NO_TRACKER.contains(&kind),
        why: "it has no tracker", off: "set it to Pll" },
    Choice { name: "adaptation.resistance", asked: |s, kind| s.par.adaptation.resistance && kind != Sensored,
        has: |kind| matches!(kind, Kind::Rasmussen | Kind::FluxObserver),
        why: "it does not adapt the resistance", off: "set it to false" },
    Choice { name: "adaptation.tracking", asked: |s, _| s.par.adaptation.tracking > 0.0, has: |kind| kind == Kind::Rasmussen,
        why: "only Rasmussen needs it; FluxObserver adapts the resistance at every speed", off: "set adaptation.tracking = 0" },
    Choice { name: "adaptation.k_a", asked: |s, _| s.par.adaptation.k_a > 0.0, has: |kind| kind == Kind::Rasmussen,
        why: "it does not turn the frame at rest", off: "set adaptation.k_a = 0" },
    Choice { name: "flux_observer.magnet", asked: |s, _| s.par.flux_observer.magnet > 0.0, has: |kind| kind == Kind::FluxObserver,
        why: "it does not adapt psi_M", off: "set it to 0" },
    Choice { name: "emf.hold_reversal", asked: |s, _| s.par.emf.hold_reversal, has: |kind| SIGN_OF_EMF.contains(&kind),
        why: "it does not take the direction of rotation from the sign of the EMF", off: "set it to false" },
    Choice { name: "emf.frame_term", asked: |s, _| !s.par.emf.frame_term, has: |kind| FRAME_TERM.contains(&kind),
        why: "it has no such term", off: "set it to true" },
    Choice { name: "matsui.integral", asked: |s, _| !s.par.matsui.integral, has: |kind| matches!(kind, Kind::VoltageModel | Kind::CurrentModel),
        why: "it has no such integral", off: "set it to true" },
    Choice { name: "pulsating.demodulation", asked: |s, _| s.par.pulsating.demodulation != Demodulation::Heterodyne,
        has: |kind| kind == Kind::PulsatingInjection,
        why: "it has no pulsating carrier", off: "set it to Heterodyne" },
    Choice { name: "gradient.clamped", asked: |s, _| s.par.gradient.clamped, has: |kind| kind == Kind::GradientObserver,
        why: "it has no such clamp", off: "set it to false" },
];

/// Checks that the estimator has the options that are on.
///
/// # Errors
/// It does not have one of them.
pub fn validate(kind: Kind, setup: &Setup) -> Result<(), Fault> {
    let Some(choice) = CHOICES.iter().find(|choice| (choice.asked)(setup, kind) && !(choice.has)(kind)) else {
        return Ok(());
    };
    let names: Vec<&str> = Kind::ALL.iter().filter(|&&kind| (choice.has)(kind)).map(|kind| kind.name()).collect();
    let names = match names.as_slice() {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        one => one.concat(),
    };
    Err(Fault::new(format!(
        "{} is not allowed with {}: {}; {}, or set estimator = {names}",
        setup.tell(choice.name),
        setup.tell("estimator"),
        choice.why,
        choice.off
    )))
}
