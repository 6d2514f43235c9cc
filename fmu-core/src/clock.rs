//! Clocks (FMI 3.0.2, 2.2.8): they announce when a part of a model acts; the importer generates the ticks.

use crate::events::Sampled;
use crate::refusal::demand;
use crate::row::{Access, Row};
use crate::variable::{Causality, Kind, Variability};
use crate::{Elapsed, Fault, Model};
use serde::{Deserialize, Serialize};

/// The source of the ticks of a clock (`intervalVariability`; FMI 3.0.2, 2.2.8.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum Ticks {
    /// Always with one interval.
    Constant,
    /// With an interval that the importer chooses in Initialization Mode.
    Fixed,
    /// With an interval that the importer may also change at events.
    Tunable,
    /// With an interval that the model determines at each tick for the next one.
    Changing,
    /// After a time that the model gives at any event.
    Countdown,
    /// At any time the importer chooses; an output clock, at any time the model chooses.
    Triggered,
}

impl Ticks {
    /// Whether an interval lies between any two ticks.
    pub const fn is_periodic(self) -> bool {
        matches!(self, Self::Constant | Self::Fixed | Self::Tunable)
    }

    /// Whether the model determines the interval: [`Clocked::interval`].
    pub const fn is_aperiodic(self) -> bool {
        matches!(self, Self::Changing | Self::Countdown)
    }
}

/// Properties of a clock.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// The source of its ticks.
    pub ticks: Ticks,
    /// Interval (s) of a constant clock; for other clocks the start value is the interval.
    pub interval: Option<f64>,
    /// The interval of a constant clock as a fraction: counter and resolution.
    pub fraction: Option<(u64, u64)>,
    /// Time in s from the start to the first tick of a periodic clock.
    pub shift: f64,
    /// Its priority among the partitions of Scheduled Execution; 0 is the most urgent.
    pub priority: Option<u32>,
}

impl Timing {
    /// The shift of a clock with a fraction, in its resolution.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "saturates"
    )]
    pub const fn shift_counter(&self) -> Option<u64> {
        match self.fraction {
            Some((_, resolution)) => Some((self.shift * resolution as f64 + 0.5) as u64),
            None => None,
        }
    }
}

/// A clock that the importer ticks, for [`Row::clock`].
///
/// ```
/// # use fmu_core::unit::VOLT;
/// # use fmu_core::{Clock, Row, Table, table};
/// # #[derive(Default)] struct Model { t_s: f64, u: f64, y: f64 }
/// # type V = Row<Model>;
/// const TABLE: &Table<Model> = table![
///     V::clock("sample", "The controller acts", Clock::fixed(|m| &mut m.t_s)),
///     V::clock("slow", "Every 0.1 s, at 0.05 s first", Clock::constant(0.1)).shift(0.05),
///     V::clock("audio", "44100 times in a second", Clock::fraction(1, 44_100)),
///     V::clock("tuned", "The importer may change it", Clock::tunable(|m| &mut m.t_s)),
///     V::clock("pulse", "The model gives the next interval at each tick", Clock::changing()),
///     V::clock("ignition", "The model asks for a tick", Clock::countdown()).priority(2),
///     V::clock("interrupt", "At any time", Clock::triggered()),
///     V::clock_output("trip", "A limit was passed"),
///     V::input("u", &VOLT, "Read when the clock ticks", |m| &mut m.u).on("sample"),
///     V::output("y", &VOLT, "Changes when one of them ticks", |m| &mut m.y).on("sample interrupt"),
/// ];
/// assert_eq!(TABLE.clocks_of(8), "sample");
/// ```
pub struct Clock<W: 'static> {
    timing: Timing,
    interval: Option<fn(&mut W) -> &mut f64>,
}

impl<W: 'static> Clone for Clock<W> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<W: 'static> Copy for Clock<W> {}

impl<W: 'static> Clock<W> {
    const fn new(ticks: Ticks, interval: Option<fn(&mut W) -> &mut f64>) -> Self {
        Self { timing: Timing { ticks, interval: None, fraction: None, shift: 0.0, priority: None }, interval }
    }

    /// Ticks every `interval` (s).
    pub const fn constant(interval: f64) -> Self {
        let mut clock = Self::new(Ticks::Constant, None);
        clock.timing.interval = Some(interval);
        clock
    }

    /// Ticks every `counter` / `resolution` seconds.
    #[expect(clippy::cast_precision_loss, reason = "the decimal is the rounded quotient")]
    pub const fn fraction(counter: u64, resolution: u64) -> Self {
        let mut clock = Self::constant(counter as f64 / resolution as f64);
        clock.timing.fraction = Some((counter, resolution));
        clock
    }

    /// Ticks with the interval (s) in this field, which the importer may set in Initialization Mode.
    pub const fn fixed(interval: fn(&mut W) -> &mut f64) -> Self {
        Self::new(Ticks::Fixed, Some(interval))
    }

    /// Ticks with the interval (s) in this field, which the importer may set in Initialization Mode and at events.
    pub const fn tunable(interval: fn(&mut W) -> &mut f64) -> Self {
        Self::new(Ticks::Tunable, Some(interval))
    }

    /// [`Clocked::interval`] gives the time to the first tick, and at each tick the time to the next one.
    pub const fn changing() -> Self {
        Self::new(Ticks::Changing, None)
    }

    /// [`Clocked::interval`] gives, at any event, the time from then to the next tick, once it is known.
    pub const fn countdown() -> Self {
        Self::new(Ticks::Countdown, None)
    }

    /// Ticks when the importer chooses.
    pub const fn triggered() -> Self {
        Self::new(Ticks::Triggered, None)
    }
}

impl<W: 'static> Row<W> {
    /// A clock that the importer ticks.
    ///
    /// # Panics
    /// At compile time: an interval or a fraction that is not greater than 0.
    #[track_caller]
    pub const fn clock(name: &'static str, description: &'static str, clock: Clock<W>) -> Self {
        if let Some(interval) = clock.timing.interval {
            // A fraction with a 0 is 0, infinite or not a number.
            demand(interval > 0.0 && interval.is_finite(), name, "the interval of a clock is greater than 0");
        }
        Self::new(name, description, Kind::Clock(clock.timing), Access::Clock(clock.interval))
            .with(Causality::Input, Variability::Discrete)
    }

    /// The first tick of a clock is at `shift` (s) after the start.
    ///
    /// # Panics
    /// At compile time, if the variable is not a clock with a period, or the shift is negative.
    #[track_caller]
    pub const fn shift(mut self, shift: f64) -> Self {
        let Kind::Clock(mut timing) = self.meta.kind else { return self.only_clocks() };
        demand(shift >= 0.0 && shift.is_finite(), self.meta.name, "the shift of a clock is not negative");
        demand(timing.ticks.is_periodic(), self.meta.name, "only a clock with a period has a shift");
        timing.shift = shift;
        self.meta.kind = Kind::Clock(timing);
        self
    }

    /// The priority of a clock among the partitions of Scheduled Execution; 0 is the most urgent. Other interfaces ignore it.
    ///
    /// # Panics
    /// At compile time, if the variable is not a clock that the importer ticks.
    #[track_caller]
    pub const fn priority(mut self, priority: u32) -> Self {
        let (Kind::Clock(mut timing), Causality::Input) = (self.meta.kind, self.meta.causality) else {
            return self.only_clocks();
        };
        timing.priority = Some(priority);
        self.meta.kind = Kind::Clock(timing);
        self
    }

    #[track_caller]
    const fn only_clocks(self) -> Self {
        demand(false, self.meta.name, "only a clock that the importer ticks has a shift or a priority");
        self
    }

    /// A clock that the model ticks: [`Clocked::ticked`].
    #[track_caller]
    pub const fn clock_output(name: &'static str, description: &'static str) -> Self {
        Self::new(name, description, Kind::Clock(Clock::<W>::triggered().timing), Access::Clock(None))
            .with(Causality::Output, Variability::Discrete)
    }

    /// The variable, or every input, output and local variable of a part, changes when one of these clocks ticks, and is read
    /// and set while it is active. Names of several clocks are separated by spaces. A continuous variable becomes discrete.
    ///
    /// # Panics
    /// At compile time, if the variable is a fixed parameter.
    #[track_caller]
    pub const fn on(mut self, clocks: &'static str) -> Self {
        if !matches!(self.access, Access::Part { .. }) {
            let moves = !matches!(self.meta.variability, Variability::Fixed | Variability::Constant);
            demand(moves, self.meta.name, "only a variable that changes can be on a clock");
            if matches!(self.meta.variability, Variability::Continuous) {
                self.meta.variability = Variability::Discrete;
            }
        }
        self.meta.clocks = clocks;
        self
    }
}

/// A model whose parts act when clocks tick, in Event Mode of Co-Simulation and Model Exchange or in Scheduled Execution (FMI
/// 3.0.2, 2.2.8 and 5). Clocks are rows of the table; they are numbered in its order, from 0. Such an FMU supports only FMI 3.0
/// and importers that handle events.
///
/// A [`Sampled`] model with one clock needs no implementation: when the clock becomes active, the outputs computed by the last
/// sample become visible, and the model takes the next sample.
///
/// ```
/// # use fmu_core::*;
/// # use serde::{Deserialize, Serialize};
/// #[derive(Clone, Default, Serialize, Deserialize)]
/// struct Counter { ticks: i32 }
///
/// type V = Row<Block<Counter>>;
///
/// impl Model for Counter {
///     type Outputs = ();
///     const INFO: Info = Info { name: "Counter", description: "Counts ticks", ..Info::DEFAULT };
///     const TABLE: &'static Table<Block<Self>> = table![
///         V::clock("tick", "Counted", Clock::constant(0.1)),
///         V::integer_output("ticks", "Number of ticks", |m| &mut m.model.ticks).on("tick"),
///     ];
///     fn initialize(&mut self) { self.ticks = 0; }
///     fn output(&self, _: Elapsed, (): &mut ()) {}
///     // The state does not change between ticks.
///     fn advance(&mut self, _: &Step) -> Result<(), Fault> { Ok(()) }
/// }
///
/// impl Clocked for Counter {
///     fn tick(&mut self, _clock: usize, _now: Elapsed) -> Result<(), Fault> {
///         self.ticks += 1;
///         Ok(())
///     }
/// }
/// # const CAN: Capabilities<Counter> = Capabilities::NONE.Clocked();
/// # assert!(CAN.clocked.is_some() && CAN.model_exchange());
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no clocks: it lacks the capability `Clocked`",
    note = "write `impl Clocked for {Self}`, or remove `Clocked` from the line that exports the model"
)]
pub trait Clocked: Model {
    /// Outputs of an active clock depend on inputs of the same instant: a getter computes them by a tick on a copy. Otherwise
    /// they are the outputs that [`activate`](Self::activate) computes.
    const FEEDTHROUGH: bool = false;

    /// The clock becomes active: computes the outputs that apply from now on, regardless of the inputs.
    fn activate(&mut self, _clock: usize, _now: Elapsed) {}

    /// The clock ticks: acts on the inputs of this instant. Called once at each.
    ///
    /// # Errors
    /// Returns the reason why the model cannot continue.
    fn tick(&mut self, clock: usize, now: Elapsed) -> Result<(), Fault>;

    /// Time in s from `now` to the next tick of a changing clock, or of a countdown clock if it is known.
    fn interval(&self, _clock: usize, _now: Elapsed) -> Option<f64> {
        None
    }

    /// Whether an output clock has ticked since the last call.
    fn ticked(&mut self, _clock: usize) -> bool {
        false
    }
}

#[diagnostic::do_not_recommend]
impl<M: Sampled> Clocked for M {
    fn activate(&mut self, _clock: usize, _now: Elapsed) {
        self.show();
    }

    fn tick(&mut self, _clock: usize, _now: Elapsed) -> Result<(), Fault> {
        self.sample()
    }
}

/// The words of a list of names.
pub(crate) const fn word(text: &str, number: usize) -> &str {
    let (bytes, mut i, mut n) = (text.as_bytes(), 0, 0);
    while i < bytes.len() {
        while i < bytes.len() && bytes[i] == b' ' {
            i += 1;
        }
        let first = i;
        while i < bytes.len() && bytes[i] != b' ' {
            i += 1;
        }
        if first < i && n == number {
            return text.split_at(i).0.split_at(first).1;
        }
        n += 1;
    }
    ""
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::ONE;

    #[test]
    fn periodic_and_aperiodic_clocks() {
        let all = [Ticks::Constant, Ticks::Fixed, Ticks::Tunable, Ticks::Changing, Ticks::Countdown, Ticks::Triggered];
        assert_eq!(all.map(Ticks::is_periodic), [true, true, true, false, false, false]);
        assert_eq!(all.map(Ticks::is_aperiodic), [false, false, false, true, true, false]);
    }

    type V = Row<[f64; 2]>;

    fn timing(row: &V) -> Timing {
        let Kind::Clock(timing) = row.meta.kind else { panic!("not a clock") };
        timing
    }

    /// A shift is a whole number of resolutions: the nearest one.
    #[test]
    fn intervals_and_shifts() {
        let audio = timing(&V::clock("audio", "", Clock::fraction(147, 44_100)).shift(0.25));
        assert_eq!((audio.fraction, audio.shift_counter()), (Some((147, 44_100)), Some(11_025)));
        assert!(audio.interval.is_some_and(|s| (s - 1.0 / 300.0).abs() < 1e-15));
        let shift = |s| timing(&V::clock("c", "", Clock::fraction(1, 10)).shift(s)).shift_counter();
        assert_eq!([0.0, 0.14, 0.16, 0.3].map(shift), [Some(0), Some(1), Some(2), Some(3)]);
        let slow = timing(&V::clock("slow", "", Clock::constant(0.1)).shift(0.05).priority(3));
        assert_eq!((slow.interval, slow.shift.to_bits(), slow.priority), (Some(0.1), 0.05_f64.to_bits(), Some(3)));
        assert_eq!(slow.shift_counter(), None, "only a fraction has a resolution");
    }

    #[test]
    fn each_constructor_has_its_ticks() {
        let own = [Clock::constant(1.0), Clock::fixed(|m: &mut [f64; 2]| &mut m[0]), Clock::tunable(|m| &mut m[1])];
        let others = [Clock::changing(), Clock::countdown(), Clock::triggered()];
        let rows = own.into_iter().chain(others).map(|clock| V::clock("c", "", clock));
        let found: Vec<_> = rows.map(|row| timing(&row).ticks).collect();
        let all = [Ticks::Constant, Ticks::Fixed, Ticks::Tunable, Ticks::Changing, Ticks::Countdown, Ticks::Triggered];
        assert_eq!(found, all);
        let out = V::clock_output("out", "");
        assert_eq!((timing(&out).ticks, out.meta.causality), (Ticks::Triggered, Causality::Output));
    }

    fn refused(make: impl FnOnce() -> V + std::panic::UnwindSafe) -> bool {
        std::panic::catch_unwind(make).is_err()
    }

    #[test]
    fn impossible_clocks_are_refused() {
        for interval in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            assert!(refused(move || V::clock("c", "", Clock::constant(interval))), "{interval}");
        }
        for (counter, resolution) in [(0, 1), (1, 0), (0, 0)] {
            assert!(refused(move || V::clock("c", "", Clock::fraction(counter, resolution))));
        }
        for shift in [-1e-9, f64::INFINITY] {
            assert!(refused(move || V::clock("c", "", Clock::constant(1.0)).shift(shift)), "{shift}");
        }
        assert!(refused(|| V::clock("c", "", Clock::changing()).shift(1.0)), "no period");
        assert!(refused(|| V::clock_output("c", "").priority(1)), "the model ticks it");
        assert!(refused(|| V::input("u", &ONE, "", |m| &mut m[0]).shift(1.0)), "no clock");
        assert!(refused(|| V::parameter("p", &ONE, "", |m| &mut m[0]).on("c")), "a fixed parameter never changes");
    }

    #[test]
    fn a_clocked_variable_is_discrete() {
        let u = V::input("u", &ONE, "", |m| &mut m[0]).on("a b");
        assert_eq!((u.meta.clocks, u.meta.variability), ("a b", Variability::Discrete));
    }

    #[test]
    fn words_of_a_list() {
        let words = |text| [0, 1, 2, 3].map(|number| word(text, number));
        assert_eq!(words("a bc  def"), ["a", "bc", "def", ""]);
        assert_eq!(words("  a "), ["a", "", "", ""]);
        assert_eq!(words(""), [""; 4]);
    }
}
