//! Cost and effect of an injected voltage: the carrier current and the angle found in it.

use super::candidate::Candidate;
use super::measure::{Measure, Outcome, Trace};
use crate::runner::{self, Statistics};
use fmu_core::Fault;

const NOTHING: Outcome = Outcome::NotApplicable("injects nothing");

fn injects(candidate: &Candidate) -> bool {
    candidate.class.injects()
}

/// RMS of the carrier current (magnitude of its space vector) and its copper loss, 1.5 R i^2.
pub(super) fn cost(candidate: &Candidate) -> Result<Outcome, Fault> {
    if !injects(candidate) {
        return Ok(NOTHING);
    }
    candidate.bench.pair.clone().start()?;
    let rms = runner::injected_current(candidate.bench.pair.clone());
    let r_s = candidate.bench.pair.plant.model.parameters.motor.R_s;
    let measures = vec![Measure::new("i_hf rms", "A", rms), Measure::new("copper loss", "W", 1.5 * r_s * rms * rms)];
    Ok(Outcome::Measured(measures, None))
}

/// Half a second at 0.05 pu: currents and angles at every sample, which [`super::plots`] draws as Fig. 8 and 11.
pub(super) fn response(candidate: &Candidate) -> Result<Outcome, Fault> {
    if !injects(candidate) {
        return Ok(NOTHING);
    }
    let (mut trace, mut error) = (Trace::default(), Statistics::default());
    candidate.turning(0.05).bench.run(
        0.5,
        |_, _| (0.05, 0.0),
        |moment| {
            if moment.t > 0.2 {
                error.add(moment.error());
            }
            let (plant, controller) = (&moment.pair.plant.out, &moment.pair.controller.out);
            let i = plant.i.to_stator();
            trace.t.push(moment.t);
            trace.current.push([i.alpha(), i.beta()]);
            trace.angles.push([plant.theta_e.to_degrees(), controller.theta_est.to_degrees()]);
        },
    )?;
    let measures = vec![
        Measure::new("mean angle error", "deg", error.mean()),
        Measure::new("std of the angle error", "deg", error.std()),
    ];
    Ok(Outcome::Measured(measures, Some(trace)))
}
