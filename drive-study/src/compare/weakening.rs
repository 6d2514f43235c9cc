//! Field weakening: acceleration to a multiple of the base speed, and there a load above the capability of the machine.
//!
//! The base speed n_b is computed for the true machine at its maximum current and 0.95 u_dc / sqrt 3; so is the envelope, under
//! the limits of each estimator.

use super::candidate::Candidate;
use super::measure::{Measure, Outcome};
use crate::runner::{self, RATED_SPEED, Statistics, line};
use drive::Pair;
use drive::control::envelope::Envelope;
use drive::estimator::Kind;
use fmu_core::Fault;

/// The candidate with field weakening, the whole current and no other limit of the torque.
fn weakening(candidate: &Candidate) -> Candidate {
    candidate.with(|p| {
        let par = &mut p.controller.model.parameters;
        par.weakening.used = true;
        match par.estimator {
            // The gain of this estimator has no bound near the current -psi_M / L_d.
            Kind::VoltageModel => par.limit.i = 0.7 * par.motor.psi_M / par.motor.L_d,
            // This estimator mistakes a saturated hexagon for an angle error.
            Kind::VoltageFeedback => (par.weakening.k_u, par.weakening.k_t) = (0.9, 0.9),
            _ => {}
        }
        (par.limit.i_q, par.limit.tau) = (par.limit.i, 1e3);
    })
}

/// The true machine under the controller's limits.
struct Truth {
    envelope: Envelope,
    U: f64,
    n_p: f64,
}

impl Truth {
    fn new(candidate: &Candidate) -> Self {
        let (plant, par) = (&candidate.bench.pair.plant.model, &candidate.bench.pair.controller.model.parameters);
        Self {
            envelope: Envelope::new(&plant.parameters.motor, par.limit.i),
            U: par.weakening.k_u * plant.inputs.u_dc / 3.0_f64.sqrt(),
            n_p: f64::from(plant.parameters.motor.n_p),
        }
    }

    /// Base speed in pu.
    fn base_speed(&self) -> f64 {
        self.envelope.base_speed(self.U) / self.n_p / RATED_SPEED
    }

    /// Maximum torque (N.m) at `speed` (pu).
    fn torque(&self, speed: f64) -> f64 {
        self.envelope.settled(speed * RATED_SPEED * self.n_p, 1.0, self.U).tau
    }
}

/// A ramp of the reference to a multiple of the base speed, then 1.1 times the torque of the envelope as load: the drive slows
/// down along the envelope to the speed at which it carries the load.
pub(super) fn run(candidate: &Candidate) -> Result<Outcome, Fault> {
    const FROM: f64 = 0.5;
    if let Some(why) = candidate.no_speed(1.0) {
        return Ok(Outcome::NotApplicable(why));
    }
    // The envelope of Rasmussen's machine ends at 1.62 times its base speed.
    let times = if candidate.entry.kind == Kind::Rasmussen { 1.5 } else { 2.5 };
    let base = Truth::new(candidate).base_speed();
    let (candidate, target) = (weakening(candidate).turning(FROM), times * base);
    let truth = Truth::new(&candidate);
    let load = 1.1 * truth.torque(target) / candidate.bench.torque;
    let [mut fast, mut slow, mut torque] = [Statistics::default(); 3];
    let course = |t, p: &mut Pair| {
        let speed = runner::speed(p);
        if t <= 1.5 {
            fast.peak = fast.peak.max(speed);
        }
        if t > 1.4 && t <= 1.5 {
            fast.add(speed);
        }
        if t > 3.3 {
            slow.add(speed);
            torque.add(p.plant.out.tau_e);
        }
        (line(t, 0.5, FROM, 1.0, target), line(t, 1.5, 0.0, 1.8, load))
    };
    let (follow, survived) = candidate.follow(3.5, 0.5, course)?;
    let lost = !survived || follow.lost();
    let or_lost = |x: f64| if lost { f64::INFINITY } else { x };
    let measures = vec![
        Measure::new("reached speed", "n_b", or_lost(fast.mean() / base)),
        Measure::new("overshoot", "n_b", or_lost((fast.peak - target).max(0.0) / base)),
        follow.peak(),
        Measure::new("torque over envelope", "1", or_lost(torque.mean() / truth.torque(slow.mean()))),
    ];
    Ok(Outcome::Measured(measures, Some(follow.into_trace(survived))))
}
