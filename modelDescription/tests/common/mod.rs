//! A description with every kind of variable, written by hand: it has no model.

#![allow(dead_code)] // each test file uses its own part

use fmu_core::description::{
    AliasDescription, MemberDescription, ModelExchange, TerminalDescription, TerminalPicture, Value, Variable,
    VariableKind,
};
use fmu_core::terminal::{MatchingRule, MemberKind};
use fmu_core::unit::{ONE, Quantity, RAD_PER_S, SPEED, Unit, VOLT};
use fmu_core::{Causality, Description, Experiment, IntegerType, Ticks, Timing, Variability};
use model_description::{FmiVersion, Generation, write};

/// Both standards.
pub(crate) const VERSIONS: [FmiVersion; 2] = [FmiVersion::V2, FmiVersion::V3];

/// Every character with a meaning in XML, and those that a careless writer loses.
pub(crate) const AWKWARD: &str = "a < b & c > d, \"quoted\" 'and' \u{3c8}_M\u{b2} \u{1f50b}\n\tsecond line";

pub(crate) fn generation() -> Generation {
    Generation { tool: "sample 1.0".into(), date_and_time: "2026-01-02T03:04:05Z".into() }
}

pub(crate) fn xml(version: FmiVersion) -> String {
    write(&sample(), version, &generation())
}

pub(crate) fn real(quantity: &Quantity) -> VariableKind {
    VariableKind::Real {
        quantity: quantity.name.into(),
        unit: quantity.unit.name.into(),
        exponents: quantity.unit.exponents,
        factor: quantity.unit.factor,
        display: quantity.display.map(|d| (d.name.into(), d.factor, d.offset)),
        relative: quantity.relative,
        single: false,
    }
}

pub(crate) fn variable(
    name: &str,
    value_reference: u32,
    pair: (Causality, Variability),
    kind: VariableKind,
) -> Variable {
    Variable {
        aliases: Vec::new(),
        name: name.into(),
        description: format!("The variable {name}"),
        value_reference,
        causality: pair.0,
        variability: pair.1,
        kind,
        min: None,
        max: None,
        above: false,
        below: false,
        nominal: None,
        unbounded: false,
        shape: Vec::new(),
        sized: Vec::new(),
        exact: false,
        start: None,
        initial_dependencies: None,
        dependencies: None,
        derivative: None,
        reinit: false,
        clocks: Vec::new(),
        intermediate: false,
    }
}

/// Every kind of variable; the array owns the value references 4, 5 and 6.
pub(crate) fn sample() -> Description {
    let parameter = (Causality::Parameter, Variability::Fixed);
    let output = (Causality::Output, Variability::Discrete);
    let observer = VariableKind::Enumeration {
        name: "Observer".into(),
        description: "What estimates the <speed>".into(),
        items: vec![(1, "Simple".into(), "The simple one".into()), (3, "Good".into(), "5 % better & slower".into())],
    };
    let percent = VariableKind::Real {
        quantity: "Share".into(),
        unit: "%".into(),
        exponents: ONE.unit.exponents,
        factor: 0.01,
        display: Some(("ppm".into(), 1e4, 0.5)),
        relative: false,
        single: false,
    };
    let variables = vec![
        Variable {
            start: Some(vec![Value::Real(325.1)]),
            min: Some(0.0),
            max: Some(1e21),
            nominal: Some(300.0),
            description: AWKWARD.into(),
            ..variable("u_dc", 1, (Causality::Input, Variability::Continuous), real(&VOLT))
        },
        Variable {
            start: Some(vec![Value::Boolean(true)]),
            ..variable("enable", 2, (Causality::Input, Variability::Discrete), VariableKind::Boolean)
        },
        Variable {
            start: Some(vec![Value::Integer(3)]),
            min: Some(1.0),
            max: Some(3e9),
            ..variable("motor.n_p", 3, parameter, VariableKind::Integer(IntegerType::Int32))
        },
        Variable {
            start: Some(vec![Value::Real(0.1), Value::Real(-1e-7), Value::Real(1.0 / 3.0)]),
            shape: vec![3],
            sized: Vec::new(),
            ..variable("filter.b", 4, parameter, real(&ONE))
        },
        Variable { start: Some(vec![Value::Integer(3)]), ..variable("observer", 7, parameter, observer) },
        Variable {
            start: Some(vec![Value::Real(5e-324)]),
            min: Some(f64::MIN),
            ..variable("bandwidth", 8, (Causality::Parameter, Variability::Tunable), real(&RAD_PER_S))
        },
        Variable { start: Some(vec![Value::Real(50.0)]), ..variable("share", 9, parameter, percent) },
        Variable {
            initial_dependencies: Some(vec![6, 3, 4]),
            ..variable("gain", 10, (Causality::CalculatedParameter, Variability::Fixed), real(&ONE))
        },
        Variable {
            initial_dependencies: Some(vec![]),
            ..variable("speed", 11, (Causality::Output, Variability::Continuous), real(&SPEED))
        },
        Variable {
            initial_dependencies: Some(vec![0, 8]),
            ..variable("sector", 12, output, VariableKind::Integer(IntegerType::Int32))
        },
        Variable { initial_dependencies: Some(vec![2]), ..variable("ready", 13, output, VariableKind::Boolean) },
        variable("inner", 14, (Causality::Local, Variability::Continuous), real(&SPEED)),
    ];
    Description {
        name: "Sample".into(),
        title: None,
        description: AWKWARD.into(),
        version: "1.2.3".into(),
        author: "A & B".into(),
        license: "MIT OR Apache-2.0".into(),
        copyright: "\u{a9} 2026".into(),
        token: "{01234567-89ab-cdef-0123-456789abcdef}".into(),
        experiment: Experiment { stop: 2.0, step: 1e-4, ..Experiment::DEFAULT },
        categories: Vec::new(),
        documentation: String::new(),
        variables,
        terminals: terminals(),
        icon: Some(SVG.into()),
        model_exchange: None,
        keeps: fmu_core::Keeps::Stored,
    }
}

/// The sample with two states, in another order than the variables, and an event indicator.
pub(crate) fn exchange_sample() -> Description {
    let local = (Causality::Local, Variability::Continuous);
    let acceleration = Quantity::new("Acceleration", Unit::si("rad/s2", RAD_PER_S.unit.exponents));
    let mut description = sample();
    for v in &mut description.variables {
        match &*v.name {
            "speed" => v.dependencies = Some(vec![11]),
            // On a discrete input, a state, a parameter, which FMI 2.0 does not count, and time.
            "sector" => v.dependencies = Some(vec![2, 14, 8, 0]),
            "ready" => v.dependencies = Some(vec![]),
            "inner" => (v.initial_dependencies, v.reinit, v.nominal) = (Some(vec![1]), true, Some(-20.0)),
            _ => {}
        }
    }
    let derivative = |name: &str, reference, of, dependencies: &[u32]| Variable {
        initial_dependencies: Some(dependencies.iter().copied().filter(|&known| known < 11).collect()),
        dependencies: Some(dependencies.to_vec()),
        derivative: Some(of),
        ..variable(name, reference, local, real(&acceleration))
    };
    description.variables.extend([
        derivative("der(inner)", 15, 14, &[1, 11, 14]),
        derivative("der(speed)", 16, 11, &[]),
        variable("edge", 17, local, real(&ONE)),
    ]);
    let exchange = ModelExchange {
        states: vec![14, 11],
        derivatives: vec![15, 16],
        indicators: vec![17],
        event_mode: false,
        completed_steps: true,
        scheduled: false,
        only: false,
    };
    Description { name: "Exchange".into(), model_exchange: Some(exchange), ..description }
}

/// The sample as a sampled model: time events, no states.
pub(crate) fn sampled_sample() -> Description {
    let exchange = ModelExchange {
        states: Vec::new(),
        derivatives: Vec::new(),
        indicators: Vec::new(),
        event_mode: true,
        completed_steps: false,
        scheduled: false,
        only: false,
    };
    let mut description = sample();
    for v in description.variables.iter_mut().filter(|v| v.causality == Causality::Output) {
        v.dependencies = Some(Vec::new());
    }
    Description { name: "Sampled".into(), model_exchange: Some(exchange), ..description }
}

/// A voltage in single precision.
fn single() -> VariableKind {
    let mut kind = real(&VOLT);
    if let VariableKind::Real { quantity, single, .. } = &mut kind {
        (*quantity, *single) = ("Voltage32".into(), true);
    }
    kind
}

/// A clock of every kind.
fn clocks() -> [Variable; 6] {
    let input = (Causality::Input, Variability::Discrete);
    let clock = |name: &str, reference, ticks, interval: Option<f64>| {
        let timing = Timing { ticks, interval, fraction: None, shift: 0.0, priority: None };
        variable(name, reference, input, VariableKind::Clock(timing))
    };
    let exact =
        Timing { ticks: Ticks::Constant, interval: Some(0.5), fraction: Some((1, 2)), shift: 0.25, priority: Some(3) };
    [
        variable("tick", 15, input, VariableKind::Clock(exact)),
        Variable { start: Some(vec![Value::Real(0.125)]), ..clock("fixed", 16, Ticks::Fixed, None) },
        Variable { start: Some(vec![Value::Real(0.75)]), ..clock("tunable", 17, Ticks::Tunable, None) },
        clock("changing", 18, Ticks::Changing, None),
        clock("countdown", 19, Ticks::Countdown, None),
        Variable { causality: Causality::Output, ..clock("triggered", 20, Ticks::Triggered, None) },
    ]
}

/// What only FMI 3.0 has: clocks of every kind, bytes, sizes, texts, single precision, other names, constants, a bus and a map.
pub(crate) fn rare_sample() -> Description {
    let (parameter, input) = ((Causality::Parameter, Variability::Fixed), (Causality::Input, Variability::Discrete));
    let text = |text: &str| Value::Text(text.into());
    let frame = VariableKind::Binary { mime_type: "application/octet-stream".into(), most: 8 };
    let alias = |name: &str, display: Option<(&str, f64, f64)>| AliasDescription {
        name: name.into(),
        description: AWKWARD.into(),
        display: display.map(|(name, factor, offset)| (name.into(), factor, offset)),
    };
    let mut variables = vec![
        Variable {
            start: Some(vec![Value::Integer(2)]),
            max: Some(4.0),
            ..variable(
                "n",
                1,
                (Causality::StructuralParameter, Variability::Fixed),
                VariableKind::Integer(IntegerType::UInt64),
            )
        },
        Variable {
            start: Some(vec![Value::Real(1.0), Value::Real(2.0)]),
            shape: vec![2],
            sized: vec![1],
            ..variable("axis", 2, parameter, real(&VOLT))
        },
        Variable {
            start: Some(vec![Value::Real(3.0), Value::Real(4.0)]),
            shape: vec![2],
            sized: vec![1],
            aliases: vec![alias("other", None), alias("shown", Some(("kV", 1e-3, 0.0)))],
            ..variable("table", 6, parameter, real(&VOLT))
        },
        Variable {
            start: Some(vec![text("a <b>"), text("")]),
            shape: vec![2],
            ..variable("texts", 10, parameter, VariableKind::Text)
        },
        Variable {
            start: Some(vec![Value::Real(0.1_f32.into())]),
            ..variable("single", 12, (Causality::Input, Variability::Continuous), single())
        },
        Variable {
            start: Some(vec![Value::Binary(vec![0, 255])]),
            clocks: vec![15, 16],
            ..variable("frame", 13, input, frame)
        },
        Variable {
            start: Some(vec![Value::Integer(-5)]),
            ..variable(
                "constant",
                14,
                (Causality::Local, Variability::Constant),
                VariableKind::Integer(IntegerType::Int8),
            )
        },
        Variable {
            start: Some(vec![Value::Real(7.0)]),
            exact: true,
            intermediate: true,
            ..variable("kept", 21, (Causality::Output, Variability::Continuous), real(&VOLT))
        },
    ];
    variables.extend(clocks());
    let terminal = |name: &str, rule, members: &[(&str, MemberKind)]| TerminalDescription {
        name: name.into(),
        description: String::new(),
        rule,
        members: members
            .iter()
            .map(|(name, kind)| MemberDescription { name: (*name).into(), variable: (*name).into(), kind: *kind })
            .collect(),
        picture: None,
    };
    let map = [
        ("axis", MemberKind::Domain),
        ("single", MemberKind::DomainInput),
        ("table", MemberKind::Codomain),
        ("kept", MemberKind::CodomainOutput),
    ];
    let bus = [("frame", MemberKind::Signal), ("tick", MemberKind::Signal)];
    let exchange = ModelExchange {
        states: Vec::new(),
        derivatives: Vec::new(),
        indicators: Vec::new(),
        event_mode: true,
        completed_steps: false,
        scheduled: true,
        only: false,
    };
    Description {
        name: "Rare".into(),
        variables,
        terminals: vec![terminal("map", MatchingRule::Map, &map), terminal("can", MatchingRule::Transceiver, &bus)],
        icon: None,
        model_exchange: Some(exchange),
        ..sample()
    }
}

/// An empty picture.
pub(crate) const SVG: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"8\" height=\"8\"/>";

/// One drawn, one not; every kind of member.
fn terminals() -> Vec<TerminalDescription> {
    let member =
        |name: &str, variable: &str, kind| MemberDescription { name: name.into(), variable: variable.into(), kind };
    let picture =
        TerminalPicture { area: [-110.0, 30.5, -90.0, 50.5], icon: "dc".into(), svg: SVG.into(), color: [255, 0, 7] };
    vec![
        TerminalDescription {
            name: "supply".into(),
            description: AWKWARD.into(),
            rule: MatchingRule::Plug,
            members: vec![member("u", "u_dc", MemberKind::Inflow), member("ready", "ready", MemberKind::Outflow)],
            picture: Some(picture),
        },
        TerminalDescription {
            name: "all".into(),
            description: String::new(),
            rule: MatchingRule::Bus,
            members: vec![member("w", "speed", MemberKind::Signal)],
            picture: None,
        },
    ]
}
