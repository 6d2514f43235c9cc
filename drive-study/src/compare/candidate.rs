//! An estimator with the drive that it is compared on.
//!
//! All estimators but one run on the 2.2 kW machine with interior magnets, with the gains of the review's figures
//! ([`crate::runner`]). Rasmussen's observer is for machines without saliency. It runs on its own reference motor with
//! its own gains (the start values of the FMUs, R^ = 0.9 R), where 1 pu of torque is the 2 N.m of the paper's load
//! steps. 1 pu of speed is 1500 rpm on both machines.

use crate::runner;
use crate::runner::RATED_SPEED;
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
    set: fn(&mut ControllerParameters),
}

const VARIANTS: &[Entry] = &[
    Entry {
        kind: Kind::PulsatingInjection,
        name: "PulsatingInjection-45deg",
        set: |p| p.estimators.pulsating.demodulation = Demodulation::MeasurementAxes,
    },
    Entry {
        kind: Kind::SquareWaveInjection,
        name: "SquareWaveInjection-4",
        set: |p| {
            p.estimators.square_wave.samples = 4;
            p.speed_loop.bandwidth = TAU * 8.0;
        },
    },
    Entry {
        kind: Kind::FluxObserver,
        name: "FluxObserver-adapting",
        set: |p| (p.estimators.adaptation.resistance, p.estimators.flux_observer.magnet) = (true, 5.0),
    },
    Entry {
        kind: Kind::GradientObserver,
        name: "GradientObserver-clamped",
        set: |p| p.estimators.gradient.clamped = true,
    },
];

impl Entry {
    /// The machine it runs on, which also sets 1 pu of torque.
    pub fn machine(&self) -> &'static str {
        match self.kind {
            Kind::Rasmussen => "reference motor, 2 N.m",
            _ => "2.2 kW machine, 14 N.m",
        }
    }

    /// Its name in a table, with the machine if it differs from that of the others.
    pub fn label(&self) -> String {
        match self.kind {
            Kind::Rasmussen => format!("{} ({})", self.name, self.machine()),
            _ => self.name.into(),
        }
    }

    /// All estimators, each with its variants.
    pub fn all() -> Vec<Self> {
        let one = |&kind: &Kind| Self { kind, name: kind.name(), set: |_| () };
        let with_variants = |kind: &Kind| {
            let variants = VARIANTS.iter().copied().filter(|v| v.kind == *kind);
            std::iter::once(one(kind)).chain(variants).collect::<Vec<_>>()
        };
        Kind::ALL.iter().flat_map(with_variants).collect()
    }
}

/// An estimator and its drive.
#[derive(Clone)]
pub struct Candidate {
    /// The row.
    pub entry: Entry,
    /// The signal from which it finds the rotor.
    pub class: Class,
    /// The drive at rest.
    pub pair: Pair,
    /// 1 pu of torque in N.m.
    pub torque: f64,
}

impl Candidate {
    /// The candidate of a row.
    pub fn new(entry: Entry) -> Self {
        let class = entry.kind.class();
        let (mut pair, torque) = match entry.kind {
            Kind::Rasmussen => (Pair::default(), 2.0),
            _ => (runner::drive(entry.kind), runner::RATED_TORQUE),
        };
        pair.controller.model.parameters.estimator = entry.kind;
        (entry.set)(&mut pair.controller.model.parameters);
        Self { entry, class, pair, torque }
    }

    /// Why the estimator cannot be judged at standstill.
    pub fn no_standstill(&self) -> Option<&'static str> {
        (!self.entry.kind.holds_standstill()).then_some("no EMF at standstill")
    }

    /// Why the estimator cannot be judged at `speed` (pu).
    pub fn no_speed(&self, speed: f64) -> Option<&'static str> {
        (self.class == Class::Injection && speed > 0.2)
            .then_some("injection above 0.2 pu is limited by the voltage: Hybrid goes on from there")
    }

    /// The same with other parameters.
    pub fn with(&self, change: impl FnOnce(&mut Pair)) -> Self {
        let mut other = self.clone();
        change(&mut other.pair);
        other
    }

    /// With 2 us of dead time in the inverter, compensated or not.
    pub fn with_dead_time(&self, compensated: bool) -> Self {
        self.with(|p| {
            p.plant.model.parameters.inverter.dead_time = 2e-6;
            let u_dead = p.plant.model.parameters.inverter.u_dead(p.plant.model.inputs.u_dc);
            p.controller.model.parameters.compensation.u_dead = if compensated { u_dead } else { 0.0 };
        })
    }

    /// Running at `speed` (pu) with known angle and speed.
    pub fn turning(&self, speed: f64) -> Self {
        self.with(|p| *p = runner::turning(p.clone(), speed))
    }

    /// The start from an unknown angle: by I-f, by polarity pulses (which need saturation), or by the estimator itself.
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

    /// Runs for `duration` (s). Before every step, `each` gets the drive and the time, sets inputs by
    /// [`set`](Self::set) and reads outputs. Returns false when a step fails, which means that the drive was lost.
    ///
    /// # Errors
    /// The parameters are inconsistent.
    pub fn run(&self, duration: f64, each: impl FnMut(f64, &mut Pair)) -> Result<bool, Fault> {
        let mut pair = self.pair.clone();
        let h = pair.controller.model.parameters.T_s;
        runner::run_in_steps(&mut pair, h, duration, each)
    }

    /// Sets speed reference and load, both in pu.
    pub fn set(&self, pair: &mut Pair, speed: f64, load: f64) {
        pair.controller.model.inputs.speed_ref = speed * RATED_SPEED;
        pair.plant.model.inputs.tau_load = load * self.torque;
    }

    /// A load in pu that opposes the motion.
    pub fn opposing(pair: &Pair, load: f64) -> f64 {
        load * tanh(pair.plant.out.speed / 2.0)
    }
}
