//! Clocks of the Reference-FMUs: three partitions that count their activations; one requests a tick of another, and all of them
//! tick an output clock.

use fmu_core::{Block, Clock, Clocked, Elapsed, Experiment, Fault, Info, Model, Row, Step, Table, table};
use serde::{Deserialize, Serialize};

#[derive(Clone, Default, Serialize, Deserialize)]
struct Clocks {
    input2: i32,
    counts: Counts,
    /// `inClock3` must tick at once.
    asked: bool,
    /// `outClock` has ticked.
    ticked: bool,
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Counts {
    ticks: [i32; 3],
    total: i32,
    result2: i32,
    output3: i32,
}

type V = Row<Block<Clocks>>;

impl Model for Clocks {
    type Outputs = Counts;
    const INFO: Info = Info {
        name: "Clocks",
        description: "This model demonstrates clocks and Scheduled Execution",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers; after the Reference-FMUs of the Modelica Association",
        experiment: Experiment { stop: 10.0, step: 1.0, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::clock("inClock1", "Ticks every second", Clock::constant(1.0)).priority(0),
        V::clock("inClock2", "Ticks when the importer likes", Clock::triggered()).priority(1),
        V::clock("inClock3", "Ticks when inClock1 asks for it", Clock::countdown()).priority(2).on("inClock1"),
        V::clock_output("outClock", "Ticks when totalInClockTicks is a multiple of 5").on("inClock1 inClock2 inClock3"),
        V::integer_output("inClock1Ticks", "Ticks of inClock1", |m| &mut m.out.ticks[0]).on("inClock1"),
        V::integer_output("inClock2Ticks", "Ticks of inClock2", |m| &mut m.out.ticks[1]).on("inClock2"),
        V::integer_output("inClock3Ticks", "Ticks of inClock3", |m| &mut m.out.ticks[2]).on("inClock3"),
        V::integer_output("totalInClockTicks", "Ticks of all", |m| &mut m.out.total).on("inClock1 inClock2 inClock3"),
        V::integer_output("result2", "Sum of input2 over the ticks", |m| &mut m.out.result2).on("inClock2"),
        V::integer_input("input2", "Summed by inClock2", |m| &mut m.model.input2).on("inClock2"),
        V::integer_output("output3", "1000 after the first tick of inClock3", |m| &mut m.out.output3).on("inClock3"),
    ];

    fn initialize(&mut self) {
        *self = Self { input2: self.input2, ..Self::default() };
    }

    fn output(&self, _now: Elapsed, out: &mut Counts) {
        out.clone_from(&self.counts);
    }

    fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl Clocked for Clocks {
    const FEEDTHROUGH: bool = true;

    fn tick(&mut self, clock: usize, now: Elapsed) -> Result<(), Fault> {
        self.counts.ticks[clock] += 1;
        self.counts.total += 1;
        match clock {
            0 => self.asked |= (4.0..5.0).contains(&now.seconds()),
            1 => self.counts.result2 += self.input2,
            _ => (self.asked, self.counts.output3) = (false, 1000),
        }
        self.ticked = !self.ticked && self.counts.total % 5 == 0;
        Ok(())
    }

    fn interval(&self, _clock: usize, _now: Elapsed) -> Option<f64> {
        self.asked.then_some(0.0)
    }

    fn ticked(&mut self, _clock: usize) -> bool {
        std::mem::take(&mut self.ticked)
    }
}

fmu_export::export!(Clocks: Clocked + ScheduledExecution);

#[cfg(test)]
mod tests;
