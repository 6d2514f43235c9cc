//! A heated body: C dT/dt = heat - G (T - T_ambient).

use fmu_core::unit::{Exponents, JOULE_PER_KELVIN, KELVIN, Quantity, Unit, WATT, WATT_PER_KELVIN};
use fmu_core::{
    Block, ContinuousTime, Elapsed, Experiment, Fault, Info, Model, Row, State, Step, Table, integrate, table,
};
use serde::{Deserialize, Serialize};

/// A new quantity: a name, a unit, its exponents of kg, m, s, A, and K.
const KELVIN_PER_SECOND: Quantity =
    Quantity::new("TemperatureRate", Unit::si("K/s", Exponents::mechanical(0, 0, -1, 0).with_kelvin(1)));

/// Inputs, parameters and the state.
#[derive(Clone, Serialize, Deserialize)]
struct Body {
    heat: f64,
    ambient: f64,
    capacity: f64,
    conductance: f64,
    initial: f64,
    temperature: f64,
}

/// The start values, which are written only here.
impl Default for Body {
    fn default() -> Self {
        Self { heat: 0.0, ambient: 293.15, capacity: 500.0, conductance: 2.0, initial: 293.15, temperature: 293.15 }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    temperature: f64,
    loss: f64,
}

type V = Row<Block<Body>>;

impl Model for Body {
    type Outputs = Outputs;

    const INFO: Info = Info {
        name: "{model}",
        description: "A heated body that loses heat to its surroundings",
        version: env!("CARGO_PKG_VERSION"),
        author: "The authors of {package}",
        license: "LicenseRef-proprietary",
        copyright: "Copyright (c) {year} the authors of {package}",
        experiment: Experiment { stop: 1000.0, step: 1.0, ..Experiment::DEFAULT },
        documentation: "<p>C dT/dt = heat − G (T − T_ambient)</p>",
        ..Info::DEFAULT
    };

    // Every variable once: name, unit, description, location, range.
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("heat", &WATT, "Power of the heater", |m| &mut m.model.heat),
        V::input("T_ambient", &KELVIN, "Temperature of the surroundings", |m| &mut m.model.ambient),
        V::output("T", &KELVIN, "Temperature of the body", |m| &mut m.out.temperature),
        V::output("loss", &WATT, "Heat flow to the surroundings", |m| &mut m.out.loss),
        V::parameter("C", &JOULE_PER_KELVIN, "Heat capacity", |m| &mut m.model.capacity).above(0.0),
        V::parameter("G", &WATT_PER_KELVIN, "Conductance to the surroundings", |m| &mut m.model.conductance)
            .at_least(0.0),
        V::parameter("T_start", &KELVIN, "Temperature at the start", |m| &mut m.model.initial).above(0.0),
    ];

    fn initialize(&mut self) {
        self.temperature = self.initial;
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        *out = Outputs { temperature: self.temperature, loss: self.conductance * (self.temperature - self.ambient) };
    }

    // Co-Simulation: the built-in integrator with one state, in substeps of at most 1 s.
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, { Self::SCALARS }>(self, step, 1.0)
    }
}

// The physics, for Co-Simulation and Model Exchange.
impl ContinuousTime for Body {
    const STATES: &'static [State<Self>] = &[State::new("T", &KELVIN_PER_SECOND, |m: &mut Self| &mut m.temperature)];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = (self.heat - self.conductance * (self.temperature - self.ambient)) / self.capacity;
        Ok(())
    }
}

fmu_export::export!(Body: ContinuousTime);

#[cfg(test)]
mod tests;
