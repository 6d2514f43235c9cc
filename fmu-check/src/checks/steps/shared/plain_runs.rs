//! Two plain runs of two instances, in each interface: other checks skip a variable in which they differ.
//!
//! Such a variable is a measured time, a random number, memory that is not initialized, or data that instances share.

use crate::checks::life::shared::kept::texts;
use crate::checks::process::instances::only_once;
use crate::encoding::or_null;
use crate::exchange::Importer;
use crate::instance::Instance;
use crate::lines::Line;
use crate::session::{ENDED, NotDetermined, Session};
use crate::state::State;
use crate::trajectory::difference;
use model_description::{Causality, ModelVariable};
use std::collections::HashSet;

/// Steps of a run.
const STEPS: u32 = 30;
/// Maximum number of variables that are compared, outputs first.
const VARIABLES: usize = 2000;
/// Maximum number of variables with a finding each.
const NAMED: usize = 10;

/// An instance after its run, the values after each step, and the texts at the end.
type Plain<'b> = (Instance<'b>, Vec<Vec<Vec<u64>>>, Vec<(String, Option<String>)>);

/// The variables in which two runs differ.
struct Varying<'b> {
    session: &'b Session,
    variables: Vec<&'b ModelVariable>,
    names: HashSet<String>,
}

pub(crate) fn determinism(session: &Session) -> Result<(), NotDetermined> {
    let mut variables: Vec<_> = session.numeric().filter(|v| v.clocks.is_empty()).collect();
    variables.sort_by_key(|v| v.causality != Causality::Output);
    variables.truncate(VARIABLES);
    let mut varying = Varying { session, variables, names: HashSet::new() };
    let simulated = match session.description.co_simulation {
        Some(_) => varying.compare("co-simulation", Varying::simulate),
        None => Ok(()),
    };
    if session.exchanges_here() {
        varying.compare("Model Exchange", Varying::exchange)?;
    }
    if varying.names.len() > NAMED {
        session.violated(format!("{} more variables differ", varying.names.len() - NAMED));
    }
    simulated
}

impl<'b> Varying<'b> {
    /// Steps with changing inputs.
    fn simulate(&self) -> Result<Plain<'b>, NotDetermined> {
        let (session, instance, mut rows) = (self.session, self.session.stepping()?, Vec::new());
        let mut step = |k| {
            instance.change_inputs(k)?;
            let status = instance.step(session.h())?;
            if !instance.over.get() {
                instance.must("DoStep", status)?;
                rows.push(instance.snapshot(&self.variables)?);
            }
            Ok(())
        };
        // The first step is recorded call by call: a second instance may hang in it.
        step(0)?;
        session.record_calls(&self.what("steps with changing inputs"), || {
            (1..STEPS).take_while(|_| !instance.over.get() && !session.half_time_used()).try_for_each(step)
        })?;
        let words = texts(&instance)?;
        Ok((instance, rows, words))
    }

    /// Steps of the integrator.
    fn exchange(&self) -> Result<Plain<'b>, NotDetermined> {
        let (session, instance, mut rows) = (self.session, self.session.exchange(State::Event)?, Vec::new());
        let mut importer = Importer::start(&instance)?;
        session.record_calls(&self.what("integrator steps"), || {
            for k in 0..STEPS {
                if importer.over || (k > 0 && session.half_time_used()) {
                    break;
                }
                importer.step(session.integrator_step(), &mut |_, _| ())?;
                rows.push(instance.snapshot(&self.variables)?);
            }
            Ok(())
        })?;
        let words = texts(&instance)?;
        Ok((instance, rows, words))
    }

    /// The entry for the log of calls.
    fn what(&self, steps: &str) -> String {
        format!("{STEPS} {steps}, each followed by getting {} variables", self.variables.len())
    }

    fn compare(
        &mut self,
        interface: &str,
        run: fn(&Self) -> Result<Plain<'b>, NotDetermined>,
    ) -> Result<(), NotDetermined> {
        let (first, rows, words) = run(self)?;
        if only_once(self.session) {
            first.free()?;
        }
        let (_, again, words_again) = run(self)?;
        let steps = rows.len().min(again.len());
        if steps == 0 {
            return Err(NotDetermined(format!("{ENDED} in its first step")));
        }
        for (i, v) in self.variables.clone().into_iter().enumerate() {
            let column =
                |rows: &[Vec<Vec<u64>>]| rows[..steps].iter().map(|row| vec![row[i].clone()]).collect::<Vec<_>>();
            if let Some(found) = difference(self.session.description.version, &[v], &column(&rows), &column(&again))
                && self.is_new(&v.name)
            {
                let ([one, other], at) = (&found.values, found.at());
                let text = format!("{} differs between two runs of {interface}{at}: {one} and {other}", v.name);
                self.session.deviates(found.largest, &text);
            }
        }
        for (one, other) in words.iter().zip(&words_again).filter(|(one, other)| one != other) {
            if self.is_new(&one.0) {
                let text = format!(
                    "{} differs between two runs of {interface}: {} and {}",
                    one.0,
                    or_null(&one.1),
                    or_null(&other.1)
                );
                self.session.violated(text);
            }
        }
        Ok(())
    }

    /// Adds a variable; returns whether it is new and needs a separate finding.
    fn is_new(&mut self, name: &str) -> bool {
        let new = self.names.insert(name.to_owned());
        if new {
            self.session.write(&Line::Varies(name.to_owned()));
        }
        new && self.names.len() <= NAMED
    }
}
