//! An instance whose clocks are served: each ticks when it is due (FMI 3.0.2, 2.2.8).

use crate::instance::Instance;
use crate::session::{NotDetermined, Session};
use fmu_import::Status;
use fmu_import::raw::{Arguments, Simple, flag_text, number_text};
use model_description::IntervalVariability::{Changing, Constant, Countdown, Fixed, Triggered, Tunable};
use model_description::{BaseType, Causality, ClockTiming, IntervalVariability, ModelVariable};

/// `fmi3IntervalNotYetKnown`, `fmi3IntervalUnchanged`, `fmi3IntervalChanged`.
pub(super) const NOT_YET_KNOWN: i32 = 0;
pub(super) const UNCHANGED: i32 = 1;
pub(super) const CHANGED: i32 = 2;
/// Maximum number of updates of one event, and of events at one instant: a countdown may be over at once.
const AT_ONCE: usize = 100;

/// A clock that the importer ticks.
pub(super) struct Ticking<'b> {
    pub(super) v: &'b ModelVariable,
    pub(super) timing: ClockTiming,
    /// Time of the next tick in s.
    pub(super) due: Option<f64>,
    interval: f64,
}

/// The clocks of an FMU that are ticked by the importer (`inputs`) or by the FMU.
pub(super) fn clocks(session: &Session, inputs: bool) -> Vec<(&ModelVariable, ClockTiming)> {
    let all = session.description.variables.iter().filter(|v| v.base == BaseType::Clock);
    all.filter(|v| (v.causality == Causality::Input) == inputs).filter_map(|v| Some((v, v.timing?))).collect()
}

/// Whether a clock has a period.
pub(super) fn is_periodic(ticks: IntervalVariability) -> bool {
    matches!(ticks, Constant | Fixed | Tunable)
}

impl Instance<'_> {
    /// Whether a clock is active, as the byte that the FMU wrote.
    pub(super) fn clock(&self, v: &ModelVariable) -> Result<(Status, u8), NotDetermined> {
        let call = format!("GetClock({})", v.name);
        let (status, active) = self.call_for(&call, |raw| raw.clock(self.handle, v.value_reference))?;
        self.session.record_value(&flag_text(active.into()));
        Ok((status, active))
    }

    /// Makes a clock active.
    pub(super) fn tick(&self, v: &ModelVariable) -> Result<Status, NotDetermined> {
        self.call(&format!("SetClock({})", v.name), |raw| raw.tick(self.handle, v.value_reference))
    }

    /// The interval of a clock in s, and its qualifier.
    pub(super) fn interval(&self, v: &ModelVariable) -> Result<(Status, (f64, i32)), NotDetermined> {
        let call = format!("GetIntervalDecimal({})", v.name);
        let (status, answer) = self.call_for(&call, |raw| raw.interval(self.handle, v.value_reference))?;
        self.session.record_value(&format!("{} s, qualifier {}", number_text(answer.0), flag_text(answer.1)));
        Ok((status, answer))
    }

    /// The time in s from the start to the first tick of a clock with a period.
    pub(super) fn shift(&self, v: &ModelVariable) -> Result<(Status, f64), NotDetermined> {
        let call = format!("GetShiftDecimal({})", v.name);
        let (status, shift) = self.call_for(&call, |raw| raw.shift(self.handle, v.value_reference))?;
        self.session.record_value(&number_text(shift));
        Ok((status, shift))
    }

    /// [`interval`](Self::interval), which must succeed.
    fn known_interval(&self, v: &ModelVariable) -> Result<(f64, i32), NotDetermined> {
        let (status, answer) = self.interval(v)?;
        self.must(&format!("GetIntervalDecimal({})", v.name), status)?;
        Ok(answer)
    }
}

impl<'b> Ticking<'b> {
    /// In Initialization Mode, finds when each clock ticks first.
    pub(super) fn all(instance: &Instance<'b>) -> Result<Vec<Self>, NotDetermined> {
        let start = instance.session.start();
        let plan = |(v, timing): (&'b ModelVariable, ClockTiming)| {
            let mut clock = Self { v, timing, due: None, interval: timing.interval.unwrap_or(0.0) };
            match timing.ticks {
                Triggered => {}
                Changing | Countdown => clock.hear(instance.known_interval(v)?, start),
                _ if timing.interval.is_some() => clock.due = Some(start + timing.shift),
                Constant | Fixed | Tunable => {
                    clock.interval = instance.known_interval(v)?.0;
                    let (status, shift) = instance.shift(v)?;
                    instance.must(&format!("GetShiftDecimal({})", v.name), status)?;
                    clock.due = Some(start + shift);
                }
            }
            Ok(clock)
        };
        clocks(instance.session, true).into_iter().map(plan).collect()
    }

    /// Takes the interval of a clock without a period, which the FMU returned at `now`.
    pub(super) fn hear(&mut self, (interval, qualifier): (f64, i32), now: f64) {
        if qualifier == CHANGED {
            self.due = Some(now + interval);
        }
    }

    /// Whether it is due at `now`: a time from other sums may be a little earlier.
    pub(super) fn is_due(&self, now: f64) -> bool {
        let near = 1e-6 * self.interval + 4.0 * f64::EPSILON * now.abs();
        self.due.is_some_and(|due| due <= now + near)
    }

    /// It has ticked at `now`.
    pub(super) fn ticked(&mut self, now: f64) {
        let period = is_periodic(self.timing.ticks).then_some(self.interval);
        self.due = period.map(|period| self.due.unwrap_or(now) + period);
    }
}

/// An instance for co-simulation with Event Mode.
pub(super) struct Served<'b> {
    pub(super) instance: Instance<'b>,
    pub(super) clocks: Vec<Ticking<'b>>,
    /// Asks twice for each interval.
    pub(super) twice: bool,
    /// The intervals returned after updates: the index of the clock, and the result of each call.
    pub(super) intervals: Vec<(usize, Vec<(f64, i32)>)>,
    events: usize,
    over: bool,
}

/// Points at which an importer reads values in Event Mode: once its clocks are active, and after the last update.
pub(super) enum Moment {
    Active,
    Updated,
}

/// Called in Event Mode, with the indices of the clocks that tick.
pub(super) type Look<'a, 'b> = &'a mut dyn FnMut(&Served<'b>, Moment, &[usize]) -> Result<(), NotDetermined>;

impl<'b> Served<'b> {
    /// A new instance in the Event Mode that follows the initialization.
    pub(super) fn start(session: &'b Session) -> Result<Self, NotDetermined> {
        let instance = session.made(&Arguments { event_mode: true, ..session.arguments("probe") })?;
        instance.enter()?;
        let clocks = Ticking::all(&instance)?;
        instance.perform(Simple::ExitInitializationMode)?;
        Ok(Self { instance, clocks, twice: false, intervals: Vec::new(), events: 0, over: false })
    }

    /// The clocks that tick now. Triggered ones do so at every third event.
    pub(super) fn due(&self) -> Vec<usize> {
        let now = self.instance.time.get();
        let ticks = |c: &Ticking<'_>| match c.timing.ticks {
            Triggered => self.events.is_multiple_of(3),
            _ => c.is_due(now),
        };
        (0..self.clocks.len()).filter(|&i| ticks(&self.clocks[i])).collect()
    }

    /// Handles the events of this instant and leaves Event Mode.
    pub(super) fn event(&mut self, look: Look<'_, 'b>) -> Result<(), NotDetermined> {
        let now = self.instance.time.get();
        for _ in 0..AT_ONCE {
            let due = self.due();
            self.events += 1;
            for &i in &due {
                let v = self.clocks[i].v;
                self.instance.must(&format!("SetClock({})", v.name), self.instance.tick(v)?)?;
            }
            look(self, Moment::Active, &due)?;
            for _ in 0..AT_ONCE {
                let (status, updated) = self.instance.update()?;
                self.instance.must("UpdateDiscreteStates", status)?;
                self.over |= updated.terminate == 1;
                if updated.again == 0 || self.over {
                    break;
                }
            }
            look(self, Moment::Updated, &due)?;
            for i in 0..self.clocks.len() {
                let (ticks, ticked) = (self.clocks[i].timing.ticks, due.contains(&i));
                if ticked {
                    self.clocks[i].ticked(now);
                }
                if ticks == Countdown || ticks == Changing && ticked {
                    let answer = self.instance.known_interval(self.clocks[i].v)?;
                    let mut all = vec![answer];
                    if self.twice {
                        all.push(self.instance.known_interval(self.clocks[i].v)?);
                    }
                    self.intervals.push((i, all));
                    self.clocks[i].hear(answer, now);
                }
            }
            let again = |c: &Ticking<'_>| !is_periodic(c.timing.ticks) && c.is_due(now);
            if self.over || !self.clocks.iter().any(again) {
                break;
            }
        }
        if self.over { Ok(()) } else { self.instance.perform(Simple::EnterStepMode) }
    }

    /// Steps to the next tick, at most by a communication step, and enters Event Mode.
    pub(super) fn step(&self) -> Result<(), NotDetermined> {
        let (t, whole) = (self.instance.time.get(), self.instance.session.h());
        let next = self.clocks.iter().filter_map(|c| c.due).fold(t + whole, f64::min);
        let status = self.instance.call(&format!("DoStep(t={t:?}, h={:?})", next - t), |raw| {
            Some(raw.do_step(self.instance.handle, t, next - t, false, [true; 4])?.0)
        })?;
        self.instance.must("DoStep", status)?;
        self.instance.time.set(next);
        self.instance.perform(Simple::EnterEventMode)
    }

    /// Runs for this number of events.
    pub(super) fn run(&mut self, events: usize, look: Look<'_, 'b>) -> Result<(), NotDetermined> {
        self.event(look)?;
        for _ in 1..events {
            if self.over || self.instance.session.half_time_used() {
                break;
            }
            self.step()?;
            self.event(look)?;
        }
        Ok(())
    }
}
