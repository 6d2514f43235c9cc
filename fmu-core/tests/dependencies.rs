//! Dependencies found by probing, for a model whose dependencies are known.
#![allow(missing_docs)]

use fmu_core::unit::ONE;
use fmu_core::*;
use serde::{Deserialize, Serialize};

/// dx/dt = -x + fixed u + k, dy/dt = q x if the time event has come; it holds the input.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Known {
    u: f64,
    k: f64,
    on: bool,
    unused: f64,
    fixed: f64,
    tunable: f64,
    twice: f64,
    x_start: f64,
    x: f64,
    y: f64,
    held: f64,
    late: bool,
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    through: f64,
    gated: f64,
    tuned: f64,
    clock: f64,
    held: f64,
    constant: f64,
    sum: f64,
}

type V = Row<Block<Known>>;

impl Model for Known {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Known", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("u", &ONE, "", |m| &mut m.model.u),
        V::discrete_input("k", &ONE, "", |m| &mut m.model.k).at_least(-1.0).at_most(1.0),
        V::boolean_input("on", "", |m| &mut m.model.on),
        V::input("unused", &ONE, "", |m| &mut m.model.unused),
        V::parameter("fixed", &ONE, "", |m| &mut m.model.fixed),
        V::parameter("tunable", &ONE, "", |m| &mut m.model.tunable).tunable(),
        V::parameter("x_start", &ONE, "", |m| &mut m.model.x_start),
        V::calculated("twice", &ONE, "", |m| &mut m.model.twice),
        V::output("x", &ONE, "", |m| &mut m.model.x),
        V::state("y", &ONE, "", |m| &mut m.model.y),
        V::output("through", &ONE, "", |m| &mut m.out.through),
        V::output("gated", &ONE, "", |m| &mut m.out.gated),
        V::output("tuned", &ONE, "", |m| &mut m.out.tuned),
        V::output("clock", &ONE, "", |m| &mut m.out.clock),
        V::discrete_output("held", &ONE, "", |m| &mut m.out.held),
        V::output("constant", &ONE, "", |m| &mut m.out.constant),
        V::output("sum", &ONE, "", |m| &mut m.out.sum),
    ];

    fn derive(&mut self) {
        self.twice = 2.0 * self.tunable;
    }

    fn initialize(&mut self) {
        (self.x, self.y, self.held, self.late) = (self.x_start, 0.0, self.u, false);
    }

    fn output(&self, now: Elapsed, out: &mut Outputs) {
        *out = Outputs {
            through: self.u,
            gated: if self.on { self.u * self.x } else { 0.0 },
            // Never -0, whose bits differ from 0.
            tuned: self.twice * self.y + 0.0,
            clock: now.seconds(),
            held: self.held,
            constant: 1.0,
            sum: self.k + self.x + self.fixed,
        };
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::hybrid::<Self, 2>(self, step, 0.1)
    }
}

impl ContinuousTime for Known {
    const STATES: &'static [State<Self>] =
        &[State::new("y", &ONE, |m: &mut Known| &mut m.y), State::new("x", &ONE, |m: &mut Known| &mut m.x)];

    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = if self.late { self.twice * self.x } else { 0.0 };
        dx[1] = -self.x + self.fixed * self.u + self.k;
        Ok(())
    }
}

impl Events for Known {
    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        self.held = self.u;
        self.late = now.seconds() > 0.5;
        Ok(Outcome::default())
    }

    fn next(&self, _: Elapsed) -> Next {
        Next::Never
    }
}

struct This;

impl Exported for This {
    type Model = Known;
    const CAN: Capabilities<Known> = Capabilities::NONE.ContinuousTime().Events();
}

fn names(description: &Description, of: Option<&Vec<u32>>) -> Option<String> {
    let name = |reference: &u32| match *reference {
        description::TIME => "time".to_owned(),
        reference => description.variables.iter().find(|v| v.value_reference == reference).unwrap().name.clone(),
    };
    of.map(|list| list.iter().map(name).collect::<Vec<_>>().join(" "))
}

#[test]
fn between_events() {
    let description = Description::exported::<This>().unwrap();
    let known = [
        ("x", Some("x")),
        ("through", Some("u")),
        ("gated", Some("u on x")),
        ("tuned", Some("tunable y")),
        ("clock", Some("time")),
        // Only events change it.
        ("held", Some("")),
        ("constant", Some("")),
        ("sum", Some("k x")),
        // Only after its event, which the probe must reach.
        ("der(y)", Some("tunable x")),
        ("der(x)", Some("u k x")),
        ("y", None),
        ("twice", None),
        ("u", None),
    ];
    for (name, wanted) in known {
        let variable = description.variable(name).unwrap();
        assert_eq!(names(&description, variable.dependencies.as_ref()).as_deref(), wanted, "{name}");
    }
}

/// An unknown that depends on one parameter is listed with all: one too many does no harm.
#[test]
fn at_the_start() {
    let description = Description::exported::<This>().unwrap();
    let known = [
        ("x", Some("fixed tunable x_start")),
        ("y", Some("")),
        ("twice", Some("fixed tunable x_start")),
        ("through", Some("u")),
        ("gated", Some("u on fixed tunable x_start")),
        ("tuned", Some("")),
        ("clock", Some("")),
        ("held", Some("u")),
        ("sum", Some("k fixed tunable x_start")),
        ("der(y)", Some("")),
        ("der(x)", Some("u k fixed tunable x_start")),
        ("tunable", None),
    ];
    for (name, wanted) in known {
        let variable = description.variable(name).unwrap();
        assert_eq!(names(&description, variable.initial_dependencies.as_ref()).as_deref(), wanted, "{name}");
    }
    // With only co-simulation nothing is continuous between events, and no state is an initial unknown.
    let plain = Description::of::<Known>().unwrap();
    assert!(plain.variables.iter().all(|v| v.dependencies.as_ref().is_none_or(Vec::is_empty)));
    assert!(plain.variable("y").unwrap().initial_dependencies.is_none() && plain.variable("der(x)").is_none());
}

/// The states are ordered as in STATES; their references follow the table.
#[test]
fn states_and_references() {
    let description = Description::exported::<This>().unwrap();
    let exchange = description.model_exchange.as_ref().unwrap();
    assert_eq!(
        (&exchange.states[..], &exchange.derivatives[..], exchange.event_mode),
        (&[10, 9][..], &[18, 19][..], false)
    );
    let der = description.variable("der(x)").unwrap();
    assert_eq!((der.value_reference, der.derivative, der.causality), (19, Some(9), Causality::Local));
    assert_ne!(description.token, Description::of::<Known>().unwrap().token, "another interface is another token");
}

/// Each output adds an option to those that let the input act; the last one also needs a level in a narrow band.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Deep {
    options: [bool; 8],
    level: f64,
    u: f64,
    idle: f64,
}

type D = Row<Block<Deep>>;

impl Model for Deep {
    type Outputs = [f64; 8];
    const INFO: Info = Info { name: "Deep", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        D::boolean_parameter("o0", "", |m| &mut m.model.options[0]),
        D::boolean_parameter("o1", "", |m| &mut m.model.options[1]),
        D::boolean_parameter("o2", "", |m| &mut m.model.options[2]),
        D::boolean_parameter("o3", "", |m| &mut m.model.options[3]),
        D::boolean_parameter("o4", "", |m| &mut m.model.options[4]),
        D::boolean_parameter("o5", "", |m| &mut m.model.options[5]),
        D::boolean_parameter("o6", "", |m| &mut m.model.options[6]),
        D::boolean_parameter("o7", "", |m| &mut m.model.options[7]),
        D::input("level", &ONE, "", |m| &mut m.model.level),
        D::input("u", &ONE, "", |m| &mut m.model.u),
        D::input("idle", &ONE, "", |m| &mut m.model.idle),
        D::output("y0", &ONE, "", |m| &mut m.out[0]),
        D::output("y1", &ONE, "", |m| &mut m.out[1]),
        D::output("y2", &ONE, "", |m| &mut m.out[2]),
        D::output("y3", &ONE, "", |m| &mut m.out[3]),
        D::output("y4", &ONE, "", |m| &mut m.out[4]),
        D::output("y5", &ONE, "", |m| &mut m.out[5]),
        D::output("y6", &ONE, "", |m| &mut m.out[6]),
        D::output("y7", &ONE, "", |m| &mut m.out[7]),
    ];

    fn initialize(&mut self) {}

    fn output(&self, _: Elapsed, out: &mut [f64; 8]) {
        for (k, y) in out.iter_mut().enumerate() {
            let band = k < 7 || (30.0..50.0).contains(&self.level);
            *y = if self.options[..=k].iter().all(|on| *on) && band { self.u } else { 0.0 };
        }
    }

    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

#[test]
fn behind_eight_options() {
    let description = Description::of::<Deep>().unwrap();
    let y = description.variable("y7").unwrap();
    let found = names(&description, y.initial_dependencies.as_ref()).unwrap();
    assert!(found.contains("level u") && !found.contains("idle"), "{found}");
}

/// Two levels of a tank, of which each drains through its own part of a wide array: its coefficients are one known.
#[derive(Clone, Serialize, Deserialize)]
struct Tanks {
    upper: f64,
    lower: f64,
    drains: Vec<f64>,
    inflow: f64,
}

impl Default for Tanks {
    fn default() -> Self {
        Self { upper: 1.0, lower: 2.0, drains: vec![0.5; 200], inflow: 0.0 }
    }
}

type T = Row<Block<Tanks>>;

impl Model for Tanks {
    type Outputs = ();
    const INFO: Info = Info { name: "Tanks", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        T::input("inflow", &ONE, "", |m| &mut m.model.inflow),
        T::array_input("drains", &ONE, "", 200, |m| &mut m.model.drains),
        T::output("upper", &ONE, "", |m| &mut m.model.upper),
        T::output("lower", &ONE, "", |m| &mut m.model.lower),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, 2>(self, step, 0.1)
    }
}

impl ContinuousTime for Tanks {
    const STATES: &'static [State<Self>] = &[
        State::new("upper", &ONE, |m: &mut Self| &mut m.upper),
        State::new("lower", &ONE, |m: &mut Self| &mut m.lower),
    ];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = self.inflow;
        dx[1] = self.drains[170] * self.upper;
        Ok(())
    }
}

struct Wide;

impl Exported for Wide {
    type Model = Tanks;
    const CAN: Capabilities<Tanks> = Capabilities::NONE.ContinuousTime();
}

/// The derivatives follow the wide array among the positions of the probe.
#[test]
fn derivatives_beside_a_wide_array() {
    let description = Description::exported::<Wide>().unwrap();
    for (name, wanted) in [("der(upper)", "inflow"), ("der(lower)", "upper drains"), ("upper", "upper")] {
        let variable = description.variable(name).unwrap();
        assert_eq!(names(&description, variable.dependencies.as_ref()).as_deref(), Some(wanted), "{name}");
    }
}

/// A counter on a clock: its output is on the clock too.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Counter {
    by: f64,
    sum: f64,
}

type C = Row<Block<Counter>>;

impl Model for Counter {
    type Outputs = ();
    const INFO: Info = Info { name: "Counter", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        C::clock("tick", "", Clock::constant(0.5)),
        C::discrete_input("by", &ONE, "", |m| &mut m.model.by).on("tick"),
        C::discrete_output("sum", &ONE, "", |m| &mut m.model.sum).on("tick"),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl Clocked for Counter {
    const FEEDTHROUGH: bool = true;
    fn tick(&mut self, _: usize, _: Elapsed) -> Result<(), Fault> {
        self.sum += self.by;
        Ok(())
    }
}

struct OnTicks;

impl Exported for OnTicks {
    type Model = Counter;
    const CAN: Capabilities<Counter> = Capabilities::NONE.Clocked();
}

#[test]
fn on_a_clock() {
    let description = Description::exported::<OnTicks>().unwrap();
    for (name, clocks, wanted) in [("tick", "", None), ("by", "tick", None), ("sum", "tick", Some("tick by"))] {
        let variable = description.variable(name).unwrap();
        assert_eq!(names(&description, Some(&variable.clocks)).as_deref(), Some(clocks), "{name}");
        assert_eq!(names(&description, variable.dependencies.as_ref()).as_deref(), wanted, "{name}");
    }
}

/// Outputs that switch at integers far from the start values.
#[derive(Clone, Serialize, Deserialize)]
struct Limits {
    parameter: i64,
    input: i32,
    bounded: u8,
    lowest: i32,
}

impl Default for Limits {
    fn default() -> Self {
        Self { parameter: 86, input: 0, bounded: 90, lowest: 1000 }
    }
}

type L = Row<Block<Limits>>;

impl Model for Limits {
    type Outputs = ([bool; 3], i32);
    const INFO: Info = Info { name: "Limits", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        L::int64_parameter("parameter", "", |m| &mut m.model.parameter),
        L::integer_input("input", "", |m| &mut m.model.input),
        L::uint8_input("bounded", "", |m| &mut m.model.bounded).at_most(100.0),
        L::integer_input("lowest", "", |m| &mut m.model.lowest).at_least(1000.0).at_most(1002.0),
        L::boolean_output("small", "", |m| &mut m.out.0[0]),
        L::boolean_output("great", "", |m| &mut m.out.0[1]),
        L::boolean_output("few", "", |m| &mut m.out.0[2]),
        L::integer_output("negative", "", |m| &mut m.out.1),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, out: &mut ([bool; 3], i32)) {
        out.0 = [self.parameter * self.parameter < 80, self.input > 300, self.bounded < 8];
        out.1 = self.lowest - 2000;
    }
    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

#[test]
fn behind_integers_far_from_the_start() {
    let description = Description::of::<Limits>().unwrap();
    let known = [("small", "parameter"), ("great", "input"), ("few", "bounded"), ("negative", "lowest")];
    for (name, wanted) in known {
        let variable = description.variable(name).unwrap();
        assert_eq!(names(&description, variable.initial_dependencies.as_ref()).as_deref(), Some(wanted), "{name}");
    }
}

/// Nothing can be set: x' = y, y' = -x.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Alone {
    x: f64,
    y: f64,
}

type A = Row<Block<Alone>>;

impl Model for Alone {
    type Outputs = ();
    const INFO: Info = Info { name: "Alone", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> =
        table![A::output("x", &ONE, "", |m| &mut m.model.x), A::state("y", &ONE, "", |m| &mut m.model.y)];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, 2>(self, step, 0.1)
    }
}

impl ContinuousTime for Alone {
    const STATES: &'static [State<Self>] =
        &[State::new("x", &ONE, |m: &mut Self| &mut m.x), State::new("y", &ONE, |m: &mut Self| &mut m.y)];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        (dx[0], dx[1]) = (self.y, -self.x);
        Ok(())
    }
}

struct Oscillator;

impl Exported for Oscillator {
    type Model = Alone;
    const CAN: Capabilities<Alone> = Capabilities::NONE.ContinuousTime();
}

#[test]
fn a_model_without_inputs_and_parameters() {
    let description = Description::exported::<Oscillator>().unwrap();
    for (name, wanted) in [("der(x)", "y"), ("der(y)", "x"), ("x", "x")] {
        let variable = description.variable(name).unwrap();
        assert_eq!(names(&description, variable.dependencies.as_ref()).as_deref(), Some(wanted), "{name}");
    }
}
