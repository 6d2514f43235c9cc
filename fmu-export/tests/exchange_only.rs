//! A model for Model Exchange alone, with sizes that are fixed from the initialization on: what it refuses, and why.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

mod solver;

use fmi::*;
use fmu_core::unit::ONE;
use fmu_core::{Block, ContinuousTime, Elapsed, Fault, Info, Model, Resizable, Row, State, Step, Table, table};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use solver::{ERROR, Fmu, Journal, Kind, ME, OK};

/// x' = sum of the gains.
#[derive(Clone, Serialize, Deserialize)]
struct Sum {
    n: u64,
    gains: Vec<f64>,
    x: f64,
}

impl Default for Sum {
    fn default() -> Self {
        Self { n: 2, gains: vec![1.0; 2], x: 0.0 }
    }
}

type V = Row<Block<Sum>>;

const N: u32 = 1;

impl Model for Sum {
    type Outputs = f64;
    const INFO: Info = Info { name: "Sum", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::structural("n", "Number of gains", |m| &mut m.model.n).at_most(4.0),
        V::array_parameter("gains", &ONE, "Summed", 4, |m| &mut m.model.gains).sized(&["n"]),
        V::output("x", &ONE, "State", |m| &mut m.out),
    ];

    fn initialize(&mut self) {
        self.x = 0.0;
    }

    fn output(&self, _: Elapsed, x: &mut f64) {
        *x = self.x;
    }

    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        unreachable!("it is not for Co-Simulation")
    }
}

impl ContinuousTime for Sum {
    const STATES: &'static [State<Self>] = &[State::new("x", &ONE, |m| &mut m.x)];

    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = self.gains.iter().sum();
        Ok(())
    }
}

impl Resizable for Sum {
    fn resize(&mut self) -> Result<(), Fault> {
        self.gains.resize(usize::try_from(self.n).unwrap_or(0), 1.0);
        Ok(())
    }
}

fmu_export::export!(Sum: ContinuousTime + Resizable + ModelExchangeOnly);

#[test]
fn an_instance_of_co_simulation_is_refused() {
    let (no, other) = (
        "not supported: Co-Simulation; this FMU is for Model Exchange",
        "fmi2ModelExchange (0): the FMU has no Co-Simulation",
    );
    let ways = [
        (Kind::Cs2, other),
        (Kind::Cs3 { event: false, early: false }, no),
        (Kind::Cs3 { event: true, early: true }, no),
    ];
    for (kind, why) in ways {
        let journal = Journal::default();
        assert!(Fmu::open(kind, &journal, true, false).is_null());
        let said = journal.0.borrow();
        assert!(said.len() == 1 && said[0].status == ERROR && said[0].text.contains(why), "{kind:?}: {said:?}");
    }
}

#[test]
fn sizes_change_before_the_initialization_only() {
    let fmu = Fmu::new(Kind::Me3);
    unsafe {
        assert_eq!(fmi3EnterConfigurationMode(fmu.it), OK);
        let (n, count) = (N, 3);
        assert_eq!(
            (fmi3SetUInt64(fmu.it, &raw const n, 1, &raw const count, 1), fmi3ExitConfigurationMode(fmu.it)),
            (OK, OK)
        );
    }
    assert_eq!((fmu.enter(0.0, None), fmu.exit(), fmu.derivatives()), (OK, OK, [3.0]));
    assert_eq!(unsafe { fmi3EnterConfigurationMode(fmu.it) }, ERROR);
    let said = fmu.error();
    assert!(
        said.contains("no structural parameter is tunable: sizes can be set before the initialization only"),
        "{said}"
    );
    for kind in ME {
        assert_eq!(Fmu::started(kind, 0.0).derivatives(), [2.0], "{kind:?}");
    }
}
