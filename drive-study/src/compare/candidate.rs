//! An estimator, with the drive used for its comparison.
//!
//! All estimators except one run on the 2.2 kW machine with interior magnets, with the gains of the review's figures
//! ([`crate::runner`]). Rasmussen's observer is for machines without saliency. It runs on its own reference motor with
//! its own gains (the start values of the FMUs, R^ = 0.9 R), where 1 pu of torque is the 2 N.m of the paper's load
//! steps. 1 pu of speed is 1500 rpm on both machines.

use super::measure::Follow;
use crate::runner::{self, Bench, RATED_SPEED};
use drive::Pair;
use drive::control::start::StartMode;
use drive::control::tables::ControllerParameters;
pub use drive::estimator::Class;
use drive::estimator::Kind;
use drive::estimator::pulsating::Demodulation;
use drive::math::tanh;
use fmu_core::Fault;
use std::f64::consts::TAU;

/// A row of the grid: an estimator, or a variant of one that has figures in the review.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// The estimator.
    pub kind: Kind,
    /// Name of the estimator or variant.
    pub name: &'static str,
    /// The machine it runs on, which also sets 1 pu of torque; empty on the user's machine.
    pub machine: &'static str,
    set: fn(&mut ControllerParameters),
}

/// The machine of most.
const IPMSM: &str = "2.2 kW machine, 14 N.m";

const VARIANTS: &[Entry] = &[
    Entry {
        kind: Kind::PulsatingInjection,
        name: "PulsatingInjection-45deg",
        machine: IPMSM,
        set: |p| p.estimators.pulsating.demodulation = Demodulation::MeasurementAxes,
    },
    Entry {
        kind: Kind::SquareWaveInjection,
        name: "SquareWaveInjection-4",
        machine: IPMSM,
        set: |p| {
            p.estimators.square_wave.samples = 4;
            p.speed_loop.bandwidth = TAU * 8.0;
        },
    },
    Entry {
        kind: Kind::FluxObserver,
        name: "FluxObserver-adapting",
        machine: IPMSM,
        set: |p| (p.estimators.adaptation.resistance, p.estimators.flux_observer.magnet) = (true, 5.0),
    },
    Entry {
        kind: Kind::GradientObserver,
        name: "GradientObserver-clamped",
        machine: IPMSM,
        set: |p| p.estimators.gradient.clamped = true,
    },
];

impl Entry {
    /// Its name in a table, with the machine if it differs from the others.
    pub fn label(&self) -> String {
        match self.machine {
            "" | IPMSM => self.name.into(),
            machine => format!("{} ({machine})", self.name),
        }
    }

    /// The row of an estimator.
    pub fn of(kind: Kind) -> Self {
        let machine = if kind == Kind::Rasmussen { "reference motor, 2 N.m" } else { IPMSM };
        Self { kind, name: kind.name(), machine, set: |_| () }
    }

    /// The row of an estimator on the user's machine.
    pub fn on_machine(kind: Kind) -> Self {
        Self { machine: "", ..Self::of(kind) }
    }

    /// The estimator or variant of this name, in capitals or not.
    pub fn find(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|entry| entry.name.eq_ignore_ascii_case(name))
    }

    /// All estimators, each with its variants.
    pub fn all() -> Vec<Self> {
        let with_variants = |&kind: &Kind| {
            let variants = VARIANTS.iter().copied().filter(move |v| v.kind == kind);
            std::iter::once(Self::of(kind)).chain(variants)
        };
        Kind::ALL.iter().flat_map(with_variants).collect()
    }
}

/// An estimator and its drive.
#[derive(Clone)]
pub struct Candidate {
    /// The row.
    pub entry: Entry,
    /// The signal used to locate the rotor.
    pub class: Class,
    /// The drive at rest; 1 pu of speed is 1500 rpm.
    pub bench: Bench,
}

impl Candidate {
    /// The candidate of a row.
    pub fn new(entry: Entry) -> Self {
        let class = entry.kind.class();
        let (mut pair, torque) = match entry.kind {
            Kind::Rasmussen => (Pair::default(), runner::PAPER_LOAD),
            _ => (runner::drive(entry.kind), runner::RATED_TORQUE),
        };
        pair.controller.model.parameters.estimator = entry.kind;
        (entry.set)(&mut pair.controller.model.parameters);
        Self { entry, class, bench: Bench { pair, speed: RATED_SPEED, torque } }
    }

    /// Why the scenarios at standstill leave the estimator out.
    pub fn no_standstill(&self) -> Option<&'static str> {
        (!self.entry.kind.holds_standstill()).then_some("no EMF at standstill")
    }

    /// Why the scenarios at `speed` (pu) leave the estimator out.
    pub fn no_speed(&self, speed: f64) -> Option<&'static str> {
        (self.class == Class::Injection && speed > 0.2)
            .then_some("injection above 0.2 pu is limited by the voltage: Hybrid covers the speeds above")
    }

    /// The candidate of an estimator without a variant.
    pub fn of(kind: Kind) -> Self {
        Self::new(Entry::of(kind))
    }

    /// The candidate with other parameters.
    pub fn with(&self, change: impl FnOnce(&mut Pair)) -> Self {
        let mut other = self.clone();
        change(&mut other.bench.pair);
        other
    }

    /// With 2 us of dead time in the inverter, compensated or not.
    pub fn with_dead_time(&self, compensated: bool) -> Self {
        self.with(|p| *p = runner::with_dead_time(p.clone(), compensated))
    }

    /// Running at `speed` (pu) with known angle and speed.
    pub fn turning(&self, speed: f64) -> Self {
        self.with(|p| *p = runner::turning(p.clone(), speed))
    }

    /// Starting from an unknown angle: by I-f, by polarity pulses (which need saturation), or by the estimator itself.
    pub fn starting(&self) -> Self {
        self.with(|p| {
            let mode = &mut p.controller.model.parameters.start.mode;
            match self.class {
                Class::FluxObserver | Class::Sensored => {}
                Class::BackEmf => *mode = StartMode::CurrentFrequency,
                Class::Injection | Class::Hybrid => {
                    *mode = StartMode::Injection;
                    *p = runner::with_saturation(p.clone());
                    p.controller.model.parameters.s_2 = p.plant.model.parameters.saturation.s_2;
                }
            }
        })
    }

    /// Runs for `duration` (s), tracing the whole run and measuring it from the time `from` (s). A step that fails
    /// means that the drive was lost; then the second value is false.
    ///
    /// # Errors
    /// The parameters are inconsistent.
    pub fn follow(
        &self,
        duration: f64,
        from: f64,
        course: impl FnMut(f64, &mut Pair) -> (f64, f64),
    ) -> Result<(Follow, bool), Fault> {
        let mut follow = Follow::default();
        let survived = self.bench.run(duration, course, |moment| {
            follow.trace(moment);
            if moment.t > from {
                follow.add(moment);
            }
        })?;
        Ok((follow, survived))
    }
}

/// A load in pu that opposes the motion.
pub fn opposing(pair: &Pair, load: f64) -> f64 {
    load * tanh(pair.plant.out.speed / 2.0)
}
