//! Capabilities of a model with events: instants at which the importer stops, exchanges values and lets the model act.

use crate::{ContinuousTime, Elapsed, Fault, Model, SampleGrid, Step};

/// Maximum number of samples in one event or communication step: bounds its duration for any time and any period.
const MAX_SAMPLES: f64 = 1e7;

/// When a model needs the next event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// At no known time.
    Never,
    /// At `k` times `period` (s) after the start.
    Grid {
        /// Number of the instant.
        k: u64,
        /// Period in s.
        period: f64,
    },
    /// At this time.
    At(Elapsed),
}

impl Next {
    /// Seconds from `now` to this event: 0 if it is due, or if only rounding separates the two. An importer's time counts as
    /// the event's time if both agree to a relative 1e-9.
    pub fn left(self, now: Elapsed) -> Option<f64> {
        let left = match self {
            Self::Never => return None,
            Self::Grid { k, period } => -now.minus_periods(k, period),
            Self::At(time) => time.since(now),
        };
        Some(if left <= self.width(now) { 0.0 } else { left })
    }

    /// Instants closer than this many seconds are the same instant.
    pub(crate) fn width(self, now: Elapsed) -> f64 {
        match self {
            Self::Never => 0.0,
            Self::Grid { period, .. } => SampleGrid { period }.width(),
            Self::At(_) => 1e-9 * now.seconds().abs(),
        }
    }

    /// The earlier of two events, for a model with several reasons to stop: samples on a grid and the end of a delay, for example.
    ///
    /// ```
    /// # use fmu_core::{Elapsed, Next};
    /// let sample = Next::Grid { k: 3, period: 0.1 };
    /// let delay = Next::At(Elapsed::ZERO.plus(0.25));
    /// assert_eq!(sample.or(delay, Elapsed::ZERO), delay);
    /// assert_eq!(sample.or(Next::Never, Elapsed::ZERO), sample);
    /// ```
    #[must_use]
    pub fn or(self, other: Self, now: Elapsed) -> Self {
        match (self.left(now), other.left(now)) {
            (Some(left), Some(others)) if others < left => other,
            (None, _) => other,
            _ => self,
        }
    }

    /// Whether the event is due at `now`.
    pub fn is_due(self, now: Elapsed) -> bool {
        self.left(now) == Some(0.0)
    }
}

/// Effects of an event beyond changed discrete variables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Another call of [`Events::event`] follows before time advances.
    pub again: bool,
    /// A continuous state has changed.
    pub states_changed: bool,
    /// The simulation must end.
    pub terminate: bool,
}

/// A quantity whose change of sign is an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Indicator {
    /// Name of the variable that shows it in FMI 3.0.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
}

/// A model with events. The importer enters Event Mode at the time given by [`next`](Self::next), where an indicator changes
/// its sign, or for other reasons; there it exchanges inputs and outputs.
///
/// A ball that bounces until it rests, a whole model:
///
/// ```
/// use fmu_core::unit::{METER, METER_PER_S, METER_PER_S2, ONE};
/// use fmu_core::{
///     Block, ContinuousTime, Elapsed, Events, Fault, Indicator, Info, Model, Next, Outcome, Row, State, Step, Table, integrate, table,
/// };
/// use serde::{Deserialize, Serialize};
///
/// #[derive(Clone, Serialize, Deserialize)]
/// struct Ball { e: f64, h_start: f64, h: f64, v: f64, resting: bool }
///
/// impl Default for Ball {
///     fn default() -> Self {
///         Self { e: 0.7, h_start: 1.0, h: 1.0, v: 0.0, resting: false }
///     }
/// }
///
/// #[derive(Clone, Default, Serialize, Deserialize)]
/// struct Outputs { h: f64, v: f64, resting: bool }
///
/// type V = Row<Block<Ball>>;
///
/// impl Model for Ball {
///     type Outputs = Outputs;
///     const INFO: Info = Info { name: "Ball", description: "A ball that bounces until it rests", ..Info::DEFAULT };
///     const TABLE: &'static Table<Block<Self>> = table![
///         V::output("h", &METER, "Height", |m| &mut m.out.h),
///         V::output("v", &METER_PER_S, "Velocity, positive upwards", |m| &mut m.out.v),
///         V::boolean_output("resting", "The ball lies on the ground", |m| &mut m.out.resting),
///         V::parameter("e", &ONE, "Coefficient of restitution", |m| &mut m.model.e).at_least(0.0).below(1.0),
///         V::parameter("h_start", &METER, "Height at the start", |m| &mut m.model.h_start).above(0.0),
///     ];
///
///     fn initialize(&mut self) {
///         (self.h, self.v, self.resting) = (self.h_start, 0.0, false);
///     }
///
///     fn output(&self, _now: Elapsed, out: &mut Outputs) {
///         *out = Outputs { h: self.h, v: self.v, resting: self.resting };
///     }
///
///     fn advance(&mut self, step: &Step) -> Result<(), Fault> {
///         integrate::hybrid::<Self, { Self::SCALARS }>(self, step, 1e-2)
///     }
/// }
///
/// impl ContinuousTime for Ball {
///     const STATES: &'static [State<Self>] = &[
///         State::new("h", &METER_PER_S, |m: &mut Self| &mut m.h).reinit(),
///         State::new("v", &METER_PER_S2, |m: &mut Self| &mut m.v).reinit(),
///     ];
///
///     // `resting` changes only in an event, so that the rates are continuous between events.
///     fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
///         dx.copy_from_slice(&if self.resting { [0.0, 0.0] } else { [self.v, -9.81] });
///         Ok(())
///     }
/// }
///
/// /// Height (m) below the ground at which the event begins: after a bounce the indicator is above 0.
/// const DEPTH: f64 = 1e-9;
///
/// impl Events for Ball {
///     const INDICATORS: &'static [Indicator] = &[Indicator { name: "z", description: "Height above the ground" }];
///
///     fn indicators(&self, _now: Elapsed, z: &mut [f64]) {
///         z[0] = if self.resting { 1.0 } else { self.h + DEPTH };
///     }
///
///     fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
///         let bounces = !self.resting && self.h + DEPTH <= 0.0;
///         if bounces {
///             (self.h, self.v) = (0.0, -self.e * self.v);
///             // The bounces would come ever faster.
///             self.resting = self.v < 0.05;
///             self.v = if self.resting { 0.0 } else { self.v };
///         }
///         Ok(Outcome { states_changed: bounces, ..Outcome::default() })
///     }
///
///     fn next(&self, _now: Elapsed) -> Next {
///         Next::Never
///     }
/// }
///
/// let mut ball = Block::<Ball>::default();
/// ball.initialize();
/// // It falls for sqrt(2/g) and is at the highest point of its first bounce e times that later.
/// let fall = (2.0_f64 / 9.81).sqrt();
/// ball.step(&Step { start: Elapsed::ZERO, h: 1.7 * fall })?;
/// assert!((ball.out.h - 0.49).abs() < 1e-6 && ball.out.v.abs() < 1e-6);
/// ball.step(&Step { start: Elapsed::ZERO.plus(1.7 * fall), h: 3.0 })?;
/// assert!(ball.out.resting && ball.out.h == 0.0);
/// # Ok::<(), Fault>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no events: it lacks the capability `Events`",
    note = "write `impl Events for {Self}`, or remove `Events` from the line that exports the model"
)]
pub trait Events: Model {
    /// The event indicators, in the order of all calls.
    const INDICATORS: &'static [Indicator] = &[];

    /// Writes the indicators to `z`. After an event none is 0, and the sign shows on which side the model is.
    fn indicators(&self, _now: Elapsed, _z: &mut [f64]) {}

    /// Event Mode begins, before the importer exchanges values: discrete outputs take their values from this instant on, as far
    /// as these do not depend on the inputs of this instant.
    fn begin(&mut self, _now: Elapsed) {}

    /// Acts on the inputs of this instant. If nothing is due, it has no effect.
    ///
    /// # Errors
    /// Returns the reason why the model cannot continue.
    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault>;

    /// When the next event is due, after all events due at `now` have been handled.
    fn next(&self, now: Elapsed) -> Next;
}

/// End of a step towards an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// The instant, not after the end of the step: the model's state is of this instant.
    pub at: Elapsed,
    /// An event must be handled at this instant.
    pub event: bool,
    /// [`Model::advance`] would handle it at once, even at the end of a step; otherwise an event at the end belongs to the next
    /// step.
    pub settles: bool,
}

/// A model with states and events whose importer may handle the events in Co-Simulation: Event Mode and early return of FMI 3.0
/// (3.0.2, 2.3.5, 4.1.3 and 4.2.1). The results equal those of [`Model::advance`] for any sequence of calls.
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not stop at its events: it lacks the capability `EventMode`",
    note = "write `impl EventMode for {Self}`, or remove `EventMode` from the line that exports the model"
)]
pub trait EventMode: ContinuousTime + Events {
    /// Advances the state up to the first event after the beginning of the step, or to its end. A step begins as one of
    /// [`Model::advance`] does: an event due at its beginning is handled there.
    /// [`integrate::to_event`](crate::integrate::to_event) and [`integrate::euler_to_event`](crate::integrate::euler_to_event)
    /// are implementations in one line.
    ///
    /// # Errors
    /// As [`Model::advance`].
    fn to_event(&mut self, step: &Step) -> Result<Stop, Fault>;
}

/// A model that acts only at the instants k T, like a digital controller: it reads its inputs at one instant, and the results
/// become visible at the next one. An importer that handles events gives it the inputs of every instant, regardless of its
/// communication step.
pub trait Sampled: Model {
    /// The sample period T in s.
    fn period(&self) -> f64;

    /// Number of samples taken: the next one is at this number times the period.
    fn samples(&self) -> u64;

    /// An instant has come: the outputs computed by the last sample become visible. A second call has no effect.
    fn show(&mut self);

    /// Takes one sample: reads the inputs and computes the outputs of the next instant.
    ///
    /// # Errors
    /// Gives the reason why the sample is impossible.
    fn sample(&mut self) -> Result<(), Fault>;
}

/// The instants of a sampled model.
#[inline]
pub fn grid<M: Sampled>(model: &M) -> SampleGrid {
    SampleGrid { period: model.period() }
}

/// Refuses an unreasonable number of samples.
///
/// # Errors
/// More than 1e7 samples are due at `now`.
pub fn bounded<M: Sampled>(model: &M, now: Elapsed) -> Result<(), Fault> {
    bounded_by(model, grid(model).past(model.samples(), now), now)
}

/// Refuses a point `past` (s) after the next sample if too many samples are due.
#[inline]
pub(crate) fn bounded_by<M: Sampled>(model: &M, past: f64, now: Elapsed) -> Result<(), Fault> {
    if past <= MAX_SAMPLES * model.period() { Ok(()) } else { Err(endless(model.period(), now)) }
}

#[cold]
fn endless(period: f64, now: Elapsed) -> Fault {
    let longest = format!("at most {MAX_SAMPLES} sample periods of {period} s after the last sample");
    Fault::value("the time", format!("{} s after the start", now.seconds()), longest)
}

#[diagnostic::do_not_recommend]
impl<M: Sampled> Events for M {
    fn begin(&mut self, now: Elapsed) {
        if grid(self).reached(self.samples(), now) {
            self.show();
        }
    }

    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        bounded(self, now)?;
        let grid = grid(self);
        while grid.reached(self.samples(), now) {
            self.show();
            self.sample()?;
        }
        Ok(Outcome::default())
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Grid { k: self.samples(), period: self.period() }
    }
}
