//! The comparison on the user's machine: every estimator with the values of `fmu tune`, or the reason why the machine does not suit it.

use super::candidate::Entry;
use super::measure::{Effort, Outcome};
use super::run::Run;
use super::scenario::{Scenario, ScenarioRun};
use super::table;
use super::trials::running;
use drive::control::start::StartMode;
use drive::estimator::Kind;
use drive_tools::error::Result;
use drive_tools::queue;
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use drive_tools::tune::setting::{Suited, Tuned, Unsuited};
use fmu_core::{Elapsed, Step};
use std::time::Instant;

/// The estimators on a machine.
#[derive(Clone, Debug)]
pub struct OnMachine {
    /// Name and ratings of the machine, a sentence.
    pub machine: String,
    /// How its drives start, a sentence.
    pub starts: String,
    /// The runs of the estimators that the machine suits.
    pub runs: Vec<Run>,
    /// The others.
    pub refused: Vec<Unsuited>,
    /// Processor time in ns of a sample of each controller that ran. It differs from run to run, so it is left out of the tables.
    pub nanoseconds: Vec<(Kind, f64)>,
}

/// Tunes the estimators for a machine, runs them in the scenarios on all cores, and calls `done` after each run.
///
/// # Errors
/// The motor file is wrong for every estimator.
pub fn on_machine(
    motor: &MotorFile,
    kinds: &[Kind],
    scenarios: &[&'static Scenario],
    effort: Effort,
    done: impl Fn() + Sync,
) -> Result<OnMachine> {
    let (mut tuned, mut refused) = (Vec::new(), Vec::new());
    for suited in queue::map(kinds, |&kind| rules::suited(motor, kind)) {
        match suited? {
            Suited::Tuned(one) => tuned.push(*one),
            Suited::Refused(one) => refused.push(one),
        }
    }
    let jobs: Vec<_> = tuned.iter().flat_map(|one| scenarios.iter().map(move |&s| (one, s))).collect();
    let runs = queue::map(&jobs, |&(one, scenario)| {
        let ScenarioRun::Machine(run) = scenario.run else { unreachable!("a scenario of the review") };
        let outcome = run(one, effort).unwrap_or_else(|fault| Outcome::Refused(fault.message().into()));
        done();
        Run { entry: Entry::on_machine(one.estimator), scenario, outcome }
    });
    let nanoseconds = tuned.iter().filter_map(|one| Some((one.estimator, sample_time(one)?))).collect();
    let starts = table::starts(tuned.iter().map(|one| (one.estimator.name(), way(one))));
    Ok(OnMachine { machine: sentence(motor), starts, runs, refused, nanoseconds })
}

/// How a drive starts, in words.
fn way(tuned: &Tuned) -> &'static str {
    match tuned.pair().controller.model.parameters.start.mode {
        StartMode::Direct if tuned.estimator == Kind::Sensored => table::SENSOR,
        StartMode::Direct => table::ITSELF,
        StartMode::CurrentFrequency => table::I_F,
        StartMode::Injection => table::INJECTION,
    }
}

/// Time in ns of a sample of the turning drive's controller: the shortest of five rounds.
fn sample_time(tuned: &Tuned) -> Option<f64> {
    const SAMPLES: u32 = 1000;
    let (turning, begin) = running(tuned)?;
    let h = turning.controller.model.parameters.T_s;
    let mut shortest = f64::INFINITY;
    for _ in 0..5 {
        let (mut controller, mut now) = (turning.controller.clone(), Elapsed::ZERO.plus(begin));
        let clock = Instant::now();
        for _ in 0..SAMPLES {
            let step = Step { start: now, h };
            controller.step(&step).ok()?;
            now = step.end();
        }
        shortest = shortest.min(1e9 * clock.elapsed().as_secs_f64() / f64::from(SAMPLES));
    }
    Some(shortest)
}

fn sentence(motor: &MotorFile) -> String {
    let (data, machine, rating) = (&motor.data, &motor.data.machine, &motor.data.rating);
    format!(
        "{}: {} pole pairs, R_s {} Ohm, L_d {} mH, L_q {} mH, psi_M {} Wb; 1 pu is {:.4} rad/s and {} N.m; at most {} A; {} V. Every \
         estimator has the values of fmu tune.",
        data.name,
        machine.n_p.get_ref(),
        machine.R_s.get_ref(),
        1e3 * machine.L_d.get_ref(),
        1e3 * machine.L_q.get_ref(),
        machine.psi_M.get_ref(),
        rating.speed.get_ref(),
        rating.torque.get_ref(),
        rating.current.get_ref(),
        data.dc_link.u_dc.get_ref()
    )
}
