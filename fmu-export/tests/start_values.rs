//! Checks at the end of initialization, in the first run of an instance and after each reset.
#![allow(missing_docs, non_snake_case)]

use fmu_core::unit::OHM;
use fmu_core::{Block, Elapsed, Fault, Info, Interface, Model, Plain, Row, Step, Table, table};
use fmu_export::instance::Instance;
use fmu_export::lifecycle::Standard;
use fmu_export::log::{Log, Sink, Status};
use fmu_export::snapshot::Snapshot;
use serde::{Deserialize, Serialize};

/// A model whose author left a value to the importer.
#[derive(Clone, Serialize, Deserialize)]
struct Open {
    R: f64,
}

impl Default for Open {
    fn default() -> Self {
        Self { R: 0.0 }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Nothing;

impl Model for Open {
    type Outputs = Nothing;
    const INFO: Info = Info { name: "Open", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> =
        table![Row::<Block<Open>>::parameter("R", &OHM, "Resistance, to be set", |m| &mut m.model.R).above(0.0)];

    fn initialize(&mut self) {}

    fn output(&self, _: Elapsed, _: &mut Nothing) {}

    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

struct Deaf;

impl Sink for Deaf {
    fn write(&self, _: Status, _: &str, _: &str) {}
    fn hears(&self) -> bool {
        false
    }
}

/// A start value that no importer could set is refused in every run that leaves it, regardless of values set in earlier runs.
#[test]
fn a_start_value_out_of_range_is_refused_after_each_reset() {
    let (log, fresh) = (Log::new(Box::new(Deaf), false), Snapshot::new(Interface::CoSimulation));
    let mut open = Instance::<Plain<Open>>::new(Standard::Fmi3, "open".into(), log, fresh);
    for sets in [false, true, true, false, true, false, false] {
        open.set_up(0.0, None).unwrap();
        if sets {
            open.current.block.model.R = 2.0;
        }
        match open.exit_initialization() {
            Ok(()) => assert!(sets),
            Err(fault) => assert!(!sets && fault.message() == "R = 0 is not allowed: greater than 0", "{fault:?}"),
        }
        open.reset().unwrap();
    }
}
