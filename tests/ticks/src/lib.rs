//! A model with a clock of every kind that records all ticks.

use fmu_core::unit::SECOND;
use fmu_core::{Block, Clock, Clocked, Elapsed, Experiment, Fault, Info, Model, Row, Step, Table, table};
use serde::{Deserialize, Serialize};

/// Clocks that the importer ticks, and the number of recorded ticks of each.
const CLOCKS: usize = 7;
const TICKS: usize = 8;

#[derive(Clone, Serialize, Deserialize)]
struct EveryClock {
    fixed: f64,
    tunable: f64,
    /// Times (s) from the start; -1 if there was none.
    times: [[f64; TICKS]; CLOCKS],
    /// Time (s) of the tick of `countdown` that follows `triggered`.
    due: Option<f64>,
    tripped: bool,
}

impl Default for EveryClock {
    fn default() -> Self {
        Self { fixed: 0.2, tunable: 0.3, times: [[-1.0; TICKS]; CLOCKS], due: None, tripped: false }
    }
}

impl EveryClock {
    fn ticks(&self, clock: usize) -> usize {
        self.times[clock].iter().filter(|time| **time >= 0.0).count()
    }
}

type V = Row<Block<EveryClock>>;

impl Model for EveryClock {
    type Outputs = ();

    const INFO: Info = Info {
        name: "EveryClock",
        description: "A clock of every kind",
        author: "The tests",
        license: "MIT OR Apache-2.0",
        copyright: "None",
        experiment: Experiment { stop: 1.0, step: 0.1, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };

    const TABLE: &'static Table<Block<Self>> = table![
        V::clock("constant", "Every 0.25 s", Clock::constant(0.25)).shift(0.05),
        V::clock("fraction", "Three times a second", Clock::fraction(1, 3)).shift(1.0 / 3.0),
        V::clock("fixed", "Every 0.2 s", Clock::fixed(|m| &mut m.model.fixed)).shift(0.1),
        V::clock("tunable", "Every 0.3 s", Clock::tunable(|m| &mut m.model.tunable)),
        V::clock("changing", "After 0.1 s, then 0.2 s, then 0.3 s", Clock::changing()),
        V::clock("countdown", "0.025 s after triggered", Clock::countdown()),
        V::clock("triggered", "At any time", Clock::triggered()),
        V::clock_output("trip", "Every second tick of constant"),
        V::array_output("times", &SECOND, "When each clock ticked", CLOCKS * TICKS, |m| {
            m.model.times.as_flattened_mut()
        })
        .shape(&[CLOCKS, TICKS])
        .discrete(),
    ];

    fn initialize(&mut self) {
        *self = Self { fixed: self.fixed, tunable: self.tunable, ..Self::default() };
    }

    fn output(&self, _now: Elapsed, (): &mut ()) {}

    fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl Clocked for EveryClock {
    fn tick(&mut self, clock: usize, now: Elapsed) -> Result<(), Fault> {
        let ticks = self.ticks(clock);
        let place = self.times[clock].get_mut(ticks);
        *place.ok_or_else(|| Fault::new("a clock ticks more often than is written down"))? = now.seconds();
        match clock {
            0 => self.tripped = ticks % 2 == 1,
            5 => self.due = None,
            6 => self.due = Some(now.seconds() + 0.025),
            _ => {}
        }
        Ok(())
    }

    fn interval(&self, clock: usize, now: Elapsed) -> Option<f64> {
        match clock {
            4 => (0..=self.ticks(4)).map(|_| 0.1).reduce(|a, b| a + b),
            _ => self.due.map(|due| (due - now.seconds()).max(0.0)),
        }
    }

    fn ticked(&mut self, _clock: usize) -> bool {
        std::mem::take(&mut self.tripped)
    }
}

fmu_export::export!(EveryClock: Clocked);
