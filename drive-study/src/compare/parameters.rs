//! Scenarios with an imperfect model of the drive in the controller: wrong machine parameters, dead time.

use super::candidate::{Candidate, Class};
use super::measure::{Measure, Outcome};
use super::running::slowed_down;
use drive::motor::Motor;
use fmu_core::Fault;

/// Mean angle error with a machine parameter estimated 20 % too high and 20 % too low.
pub(super) fn wrong(candidate: &Candidate, speed: f64, of: fn(&mut Motor) -> &mut f64) -> Result<Outcome, Fault> {
    let speed = if candidate.class == Class::Injection { 0.1 } else { speed };
    let error = |factor: f64, name| -> Result<Measure, Fault> {
        let wrong = candidate.with(|p| *of(&mut p.controller.model.parameters.motor) *= factor);
        Ok(slowed_down(&wrong, speed)?.mean(name))
    };
    Ok(Outcome::Measured(vec![error(1.2, "+20 %")?, error(0.8, "-20 %")?], None))
}

/// Rated load at 0.1 pu with an inverter that has dead time.
pub(super) fn dead_time(candidate: &Candidate, compensated: bool) -> Result<Outcome, Fault> {
    let follow = slowed_down(&candidate.with_dead_time(compensated), 0.1)?;
    Ok(Outcome::Measured(vec![follow.rms(), follow.mean("mean angle error"), follow.peak()], None))
}
