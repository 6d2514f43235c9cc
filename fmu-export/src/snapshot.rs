//! Everything that changes in an instance, as one plain value that an FMU state saves.

use crate::lifecycle::{Life, State};
use crate::message;
use crate::value::Value;
use fmu_core::{Block, Causality, Elapsed, Fault, Model, Slot};
use serde::{Deserialize, Serialize};

/// Start and stop time of the importer's experiment in s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// Start time.
    pub start: f64,
    /// Stop time, if the importer fixed one.
    pub stop: Option<f64>,
}

impl Experiment {
    /// Checks the times.
    ///
    /// # Errors
    /// A time is not finite, or the stop time is not after the start time.
    pub fn new(start: f64, stop: Option<f64>) -> Result<Self, Fault> {
        if !start.is_finite() {
            return Err(Fault::value("startTime", start, "any finite number"));
        }
        match stop {
            Some(stop) if !(stop.is_finite() && stop > start) => {
                Err(Fault::value("stopTime", stop, format_args!("finite and greater than startTime = {start}")))
            }
            _ => Ok(Self { start, stop }),
        }
    }
}

/// Model, outputs, time and state of the lifecycle.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Snapshot<M: Model> {
    /// State of the lifecycle.
    pub life: Life,
    /// Set by `SetupExperiment` or `EnterInitializationMode`.
    pub experiment: Option<Experiment>,
    /// Time since the start, summed here.
    pub elapsed: Elapsed,
    /// End of the last step as the importer computes it, `t + h`; before the first step the start time.
    pub end: f64,
    /// A set call awaits processing by the model: before the start for any variable, afterwards for a tunable parameter.
    pub dirty: bool,
    /// The model and its outputs.
    pub block: Block<M>,
}

impl<M: Model> Default for Snapshot<M> {
    fn default() -> Self {
        Self {
            life: Life::default(),
            experiment: None,
            elapsed: Elapsed::ZERO,
            end: M::INFO.experiment.start,
            dirty: true,
            block: Block::default(),
        }
    }
}

impl<M: Model> Clone for Snapshot<M> {
    fn clone(&self) -> Self {
        Self { block: self.block.clone(), ..*self }
    }

    /// Reuses what `self` holds: for a plain model, and one with a `clone_from` of its own, nothing is allocated.
    fn clone_from(&mut self, source: &Self) {
        let Self { life, experiment, elapsed, end, dirty, block } = source;
        (self.life, self.experiment, self.elapsed) = (*life, *experiment, *elapsed);
        (self.end, self.dirty) = (*end, *dirty);
        self.block.model.clone_from(&block.model);
        self.block.out.clone_from(&block.out);
    }
}

impl<M: Model> Snapshot<M> {
    /// Every value that the importer sets is one that it could have set, and no other is NaN.
    ///
    /// # Errors
    /// Names the first variable that is not, its value and what is allowed.
    pub fn check(&mut self) -> Result<(), Fault> {
        for index in 0..M::TABLE.len() {
            let Some((meta, slot)) = M::TABLE.entry(&mut self.block, index) else { continue };
            let set = matches!(meta.causality, Causality::Input | Causality::Parameter);
            let refused = match &slot {
                Slot::Real(x) if set => (**x).judge(meta) != Some(true),
                Slot::Integer(x) if set => (**x).judge(meta) != Some(true),
                Slot::Real(x) => x.is_nan(),
                _ => false,
            };
            if refused {
                let allowed = if set { message::allowed(meta) } else { "a number".into() };
                return Err(Fault::value(&message::name::<M>(index), message::value(&slot), allowed));
            }
        }
        Ok(())
    }

    /// The model with its calculated parameters, if its parameters fit together; this one stays as it is.
    ///
    /// # Errors
    /// As [`Model::validate`].
    pub fn judged(&self) -> Result<M, Fault> {
        let mut model = self.block.model.clone();
        model.derive();
        model.validate()?;
        Ok(model)
    }

    /// Checks that a simulation can reach this time: the sum of the steps matches the importer's own time, which rounding can at
    /// most double if a step is as short as the last digit of the time.
    ///
    /// # Errors
    /// Names the time and the state of the lifecycle that contradict each other.
    pub fn check_time(&self) -> Result<(), Fault> {
        let start = self.experiment.map_or(M::INFO.experiment.start, |e| e.start);
        let (elapsed, since) = (self.elapsed.seconds(), self.end - start);
        let rounding = 8.0 * f64::EPSILON * start.abs().max(self.end.abs());
        // A sum that is not in its normal form hides numbers that cancel.
        let fits = self.elapsed == self.elapsed.plus(0.0)
            && match (self.life.state(), self.experiment) {
                (State::Instantiated, _) | (State::Initialization, Some(_)) => since == 0.0 && elapsed == 0.0,
                (State::Step | State::Terminated, Some(_)) => {
                    self.end.is_finite()
                        && elapsed >= 0.0
                        && elapsed <= 2.0 * since + rounding
                        && since <= 2.0 * elapsed + rounding
                }
                _ => false,
            };
        if !fits {
            return Err(Fault::new(format!("time {} after {elapsed} s of simulation from {start}", self.end)));
        }
        self.experiment.map_or(Ok(()), |e| Experiment::new(e.start, e.stop).map(|_| ()))
    }
}
