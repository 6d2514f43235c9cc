//! Runs at a point and on both sides, for derivatives of measures with respect to variables.
//!
//! Two runs that the master integrates (Model Exchange) differ not only by their values: the solver chooses other steps, and
//! that difference, about its tolerance, is divided by the distance of the two. Here the two runs on both sides of a point form
//! one system ([`with_copy`](fmu_system::cosimulation::SystemPlan::with_copy)), which is integrated in common steps. Thus the
//! computed solution is differentiated, and its derivative is as accurate as the solution itself, at any tolerance. Each run
//! has its own events and samples.
//!
//! Source: H. G. Bock, Numerical treatment of inverse problems in chemical reaction kinetics, in: Modelling of Chemical Reaction
//! Systems, Springer 1981, 102-125: internal numerical differentiation.

use crate::plan::{Plan, RunResult, RunResults, RunVariable};
use crate::{Error, measure::Measure, pool};
use fmu_import::Number;
use fmu_system::cosimulation::{PlanTarget, Worker};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

impl Plan {
    /// Runs at a point, then with each variable increased by its step, then with each decreased: two rows per variable, plus
    /// one. `progress` is called with the number of rows done.
    ///
    /// # Errors
    /// An FMU refuses an instance, or `progress` stops it. An error of a run is in its row.
    pub fn run_around(
        &self,
        variables: &[RunVariable],
        point: &[f64],
        steps: &[f64],
        threads: usize,
        progress: &(dyn Fn(u64) -> ControlFlow<()> + Sync),
    ) -> Result<RunResults, Error> {
        let n = point.len().min(steps.len());
        let row = |row: usize, values: &mut Vec<Number>| {
            let moved = |k: usize| match row.checked_sub(1) {
                Some(j) if j % n == k => point[k] + if j < n { steps[j] } else { -steps[j - n] },
                _ => point[k],
            };
            values.clear();
            values.extend((0..point.len()).map(|k| Number::Real(moved(k))));
        };
        let count = |n: usize| u64::try_from(n).unwrap_or(u64::MAX);
        let index = |row: u64| usize::try_from(row).unwrap_or(usize::MAX);
        if !self.system().integrates() || self.only_one_instance().is_some() {
            return self.run_rows(variables, count(2 * n + 1), &|k, values| row(index(k), values), threads, progress);
        }
        let pairs = Arc::new(self.system().with_copy());
        let copied = |v: &RunVariable| v.targets().iter().map(|target| self.system().in_copy(target)).collect();
        let copies: Vec<Vec<PlanTarget>> = variables.iter().map(copied).collect();
        let all = Mutex::new((RunResults::empty(self.measures().len(), 2 * n + 1), 0));
        pool::run(
            count(n + 1),
            threads,
            |_| Ok((self.runner(variables)?, pairs.worker()?, [Vec::new(), Vec::new()])),
            |(runner, worker, [above, below]), block| {
                let k = index(block);
                row(k, above);
                let mut warning = None;
                let outcomes = if k == 0 {
                    runner.hear(true);
                    let outcome = runner.run(above, &mut |_, _| {});
                    warning = runner.warning();
                    vec![(0, outcome)]
                } else {
                    row(k + n, below);
                    let set = variables.iter().map(RunVariable::targets).zip(&*above);
                    let set = set.chain(copies.iter().map(Vec::as_slice).zip(&*below));
                    let set = set.flat_map(|(targets, x)| targets.iter().map(|target| (target, *x)));
                    let [above, below] = self.pair(worker, set);
                    vec![(k, above), (k + n, below)]
                };
                let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(text) = warning {
                    all.0.warned.add(0, text);
                }
                all.1 += count(outcomes.len());
                for (k, outcome) in outcomes {
                    all.0.put(k, outcome);
                }
                let done = all.1;
                drop(all);
                if progress(done).is_break() { Err(Error::Interrupted) } else { Ok(()) }
            },
        )?;
        Ok(all.into_inner().unwrap_or_else(PoisonError::into_inner).0)
    }

    /// Runs the system and its copy with these values.
    fn pair<'a>(&self, worker: &mut Worker, set: impl IntoIterator<Item = (&'a PlanTarget, Number)>) -> [RunResult; 2] {
        let renewed = if self.reuses() { Ok(()) } else { worker.renew() };
        let (mut end, columns) = (f64::NAN, self.system().columns().len());
        let begin = || self.readers().iter().map(|_| Measure::begin()).collect::<Vec<_>>();
        let mut readings = [begin(), begin()];
        let ended = renewed.and_then(|()| {
            worker.run(set, |t, row| {
                end = t;
                let (one, copy) = row.split_at(columns);
                for (readings, row) in readings.iter_mut().zip([one, copy]) {
                    self.readers().iter().zip(readings).for_each(|(measure, reading)| measure.take(reading, t, row));
                }
                ControlFlow::Continue(())
            })
        });
        let ended = ended.map_err(|error| error.to_string());
        readings.map(|readings| RunResult { result: ended.clone().and_then(|_| self.measured(&readings)), end })
    }
}
