//! The model `SensorlessControllerClocked`: [`SensorlessController`] as a periodic task on a clock of FMI 3.0. The importer ticks
//! the clock, and its interval is the sample period.
//!
//! At an instant t_k the importer activates the clock `sample`, reads the command of the previous sample, sets the currents, and
//! lets the clock tick: the delay of one sample of `SensorlessController`, in any importer.

use crate::model::{ROWS, SensorlessController};
use crate::tables::{PARAMETER_ROWS, PARAMETERS};
use fmu_core::log::Warnings;
use fmu_core::unit::SECOND;
use fmu_core::{
    Block, Clock, Clocked, Elapsed, Experiment, Fault, Info, Interface, Model, Part, Row, Sampled, Step, Table,
    Terminal, Warns, table,
};
use serde::{Deserialize, Serialize};

/// Sensorless speed control that the importer calls once in each sample period.
#[derive(Clone, Default, Serialize, Deserialize)]
pub struct SensorlessControllerClocked {
    controller: Block<SensorlessController>,
}

impl Model for SensorlessControllerClocked {
    type Outputs = ();

    const INFO: Info = Info {
        name: "SensorlessControllerClocked",
        description: "SensorlessController on a clock: the importer calls it once in each sample period",
        experiment: Experiment { step: 1e-4, ..Experiment::DEFAULT },
        documentation: crate::documentation::CLOCKED,
        ..drive_base::PROJECT
    };

    const TABLE: &'static Table<Block<Self>> = TABLE;

    const TERMINALS: &'static [Terminal] = SensorlessController::TERMINALS;

    const ICON: Option<&'static str> = SensorlessController::ICON;

    const STATE_VERSION: u16 = SensorlessController::STATE_VERSION;

    fn idle(&self, name: &str) -> Option<&'static str> {
        self.controller.model.idle(name)
    }

    fn derive(&mut self) {
        self.controller.model.derive();
    }

    fn validate(&self) -> Result<(), Fault> {
        let parameters = &self.controller.model.parameters;
        if parameters.delay == 0 {
            let allowed = "1 or 2: when the clock ticks, the voltages of the last sample act";
            return Err(PARAMETERS.fault(parameters, |p| &mut p.delay, allowed));
        }
        self.controller.model.validate()
    }

    fn validate_for(&self, interface: Interface) -> Result<(), Fault> {
        self.controller.model.validate_for(interface)
    }

    fn initialize(&mut self) {
        self.controller.model.initialize();
        self.show(Elapsed::ZERO);
    }

    /// The clock shows them.
    fn output(&self, _now: Elapsed, (): &mut ()) {}

    /// The state does not change between ticks.
    fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl SensorlessControllerClocked {
    fn show(&mut self, now: Elapsed) {
        let Block { model, out } = &mut self.controller;
        model.show();
        model.output(now, out);
    }
}

impl Clocked for SensorlessControllerClocked {
    fn activate(&mut self, _clock: usize, now: Elapsed) {
        self.show(now);
    }

    fn tick(&mut self, _clock: usize, _now: Elapsed) -> Result<(), Fault> {
        self.controller.model.sample()
    }
}

impl Warns for SensorlessControllerClocked {
    fn warn(&self, log: &mut Warnings<'_>) {
        self.controller.model.warn(log);
    }
}

type V = Row<Block<SensorlessControllerClocked>>;

/// Inputs and outputs of the controller: all of its rows except the parameters.
const SIGNALS: &Table<Block<SensorlessController>> = &Table::new(ROWS.split_at(ROWS.len() - 1).0);

/// The parameters except `T_s`, the first one.
const OTHERS: &Table<crate::tables::ControllerParameters> = &Table::new(PARAMETER_ROWS.split_at(1).1);

const TABLE: &Table<Block<SensorlessControllerClocked>> = table![
    V::clock("sample", "The controller takes a sample", Clock::fixed(|m| &mut m.model.controller.model.parameters.T_s))
        .priority(0),
    V::part("", &Part { table: SIGNALS, lens: |m| &mut m.model.controller }).on("sample"),
    V::calculated("T_s", &SECOND, "Sample period: the interval of the clock sample", |m| {
        &mut m.model.controller.model.parameters.T_s
    }),
    V::part("", &Part { table: OTHERS, lens: |m| &mut m.model.controller.model.parameters }),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Signals and parameters have the same names as in `SensorlessController`.
    #[test]
    fn the_rows_are_those_of_the_plain_controller() {
        let names = |len, name: &dyn Fn(usize) -> Option<String>| (0..len).filter_map(name).collect::<Vec<_>>();
        let plain = SensorlessController::TABLE;
        let mut ours = names(TABLE.len(), &|i| TABLE.locate(i).map(|(name, ..)| name));
        assert_eq!(ours.remove(0), "sample");
        let theirs = names(plain.len(), &|i| plain.locate(i).map(|(name, ..)| name));
        assert_eq!(ours, theirs);
        let clocked = (0..TABLE.len()).filter(|&i| TABLE.clocks_of(i) == "sample").count();
        assert_eq!(clocked, SIGNALS.len(), "no parameter is on the clock");
    }
}
