//! Your FMU in one file: a capacitor charged through a resistor, for Co-Simulation and Model Exchange.
//!
//! ```sh
//! cargo run --release -- build --package own-fmu
//! cargo run --release -- simulate target/fmu/fmi3/RcCircuit.fmu --set RcCircuit.R=2000 --input RcCircuit.u=0:0,0.5:5 \
//!     --stop 5 --step 0.1 --csv -
//! ```

use fmu_core::log::Warnings;
use fmu_core::unit::{AMPERE, Exponents, OHM, Quantity, Unit, VOLT};
use fmu_core::{
    Block, ContinuousTime, Elapsed, Experiment, Fault, Info, Model, Row, State, Step, Table, Warns, integrate, table,
};
use serde::{Deserialize, Serialize};

/// A new quantity: a name, a unit, its SI base exponents (kg, m, s, A).
const FARAD: Quantity = Quantity::new("Capacitance", Unit::si("F", Exponents::mechanical(-1, -2, 4, 2)));
const VOLT_PER_S: Quantity = Quantity::new("VoltageRate", Unit::si("V/s", Exponents::mechanical(1, 2, -4, -1)));

/// Inputs, parameters and state are plain data: the content of a saved FMU state.
#[derive(Clone, Serialize, Deserialize)]
struct RcCircuit {
    u: f64,
    resistance: f64,
    capacitance: f64,
    u_start: f64,
    u_rated: f64,
    u_c: f64,
}

/// Start values come only from here.
impl Default for RcCircuit {
    fn default() -> Self {
        Self { u: 0.0, resistance: 1e3, capacitance: 1e-3, u_start: 0.0, u_rated: 16.0, u_c: 0.0 }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    u_c: f64,
    i: f64,
}

type V = Row<Block<RcCircuit>>;

impl Model for RcCircuit {
    type Outputs = Outputs;

    const INFO: Info = Info {
        name: "RcCircuit",
        description: "A capacitor charged through a resistor",
        version: "1.0.0",
        author: "You",
        license: "MIT",
        copyright: "Copyright (c) 2026 You",
        experiment: Experiment { stop: 5.0, step: 0.1, ..Experiment::DEFAULT },
        documentation: "<p>R C du<sub>c</sub>/dt = u − u<sub>c</sub></p>",
        ..Info::DEFAULT
    };

    // Name, unit, range and location of every variable; duplicate names do not compile.
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("u", &VOLT, "Source voltage", |m| &mut m.model.u),
        V::output("u_c", &VOLT, "Voltage of the capacitor", |m| &mut m.out.u_c),
        V::output("i", &AMPERE, "Current into the capacitor", |m| &mut m.out.i),
        V::parameter("R", &OHM, "Resistance", |m| &mut m.model.resistance).above(0.0),
        V::parameter("C", &FARAD, "Capacitance", |m| &mut m.model.capacitance).above(0.0),
        V::parameter("u_start", &VOLT, "Voltage of the capacitor at the start", |m| &mut m.model.u_start),
        V::parameter("u_rated", &VOLT, "Rated voltage of the capacitor", |m| &mut m.model.u_rated).above(0.0),
    ];

    fn initialize(&mut self) {
        self.u_c = self.u_start;
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        *out = Outputs { u_c: self.u_c, i: (self.u - self.u_c) / self.resistance };
    }

    // Co-Simulation: the built-in integrator, with substeps of at most 1 ms.
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, { Self::SCALARS }>(self, step, 1e-3)
    }
}

// The physics. With it, the FMU also has Model Exchange and derivatives.
impl ContinuousTime for RcCircuit {
    const STATES: &'static [State<Self>] = &[State::new("u_c", &VOLT_PER_S, |m: &mut Self| &mut m.u_c)];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = (self.u - self.u_c) / (self.resistance * self.capacitance);
        Ok(())
    }
}

// Goes to the importer's log, at most once a second, if warnings are enabled.
impl Warns for RcCircuit {
    fn warn(&self, log: &mut Warnings<'_>) {
        if self.u_c.abs() > self.u_rated {
            log.warn("rating", || format!("u_c = {} V is above the rated {} V", self.u_c, self.u_rated));
        }
    }
}

fmu_export::export!(RcCircuit: ContinuousTime + Warns);
