//! The table of a small model with every kind of variable, a part and an array.
#![allow(missing_docs, clippy::float_cmp)]

use fmu_core::unit::{AMPERE, OHM, SPEED, VOLT};
use fmu_core::*;
use serde::{Deserialize, Serialize};

#[derive(Clone, Serialize, Deserialize)]
struct Load {
    r: f64,
    map: [f64; 3],
    mode: Mode,
}

fmu_core::enumeration! {
    #[derive(Serialize, Deserialize)]
    enum Mode("Mode", "How the load behaves") {
        1 Plain "";
        3 Odd "";
    }
}

type P = Row<Load>;
const LOAD: &Table<Load> = table![
    P::parameter("R", &OHM, "Resistance", |m| &mut m.r).above(0.0),
    P::array_parameter("map", &SPEED, "Map", 3, |m| &mut m.map),
    P::enumeration_parameter("mode", "Mode", &Field(|m| &mut m.mode)),
];

#[derive(Clone, Serialize, Deserialize)]
struct Small {
    u: f64,
    load: Load,
    on: bool,
    n: i32,
    gain: f64,
    i: f64,
}

impl Default for Small {
    fn default() -> Self {
        Self {
            u: 2.0,
            load: Load { r: 4.0, map: [0.0, 1.0, 2.0], mode: Mode::Plain },
            on: true,
            n: 1,
            gain: 0.0,
            i: 0.0,
        }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct SmallOutputs {
    i: f64,
}

type V = Row<Block<Small>>;

impl Model for Small {
    type Outputs = SmallOutputs;
    const INFO: Info = Info {
        name: "Small",
        description: "A test",
        version: "1",
        experiment: Experiment { stop: 1.0, step: 0.1, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("u", &VOLT, "Voltage", |m| &mut m.model.u),
        V::output("i", &AMPERE, "Current", |m| &mut m.out.i),
        V::part("load.", &Part { table: LOAD, lens: |m| &mut m.model.load }),
        V::boolean_parameter("on", "On", |m| &mut m.model.on),
        V::integer_parameter("n", "Count", |m| &mut m.model.n).at_least(1.0),
        V::calculated("gain", &OHM, "Gain", |m| &mut m.model.gain),
    ];
    fn derive(&mut self) {
        self.gain = 2.0 * self.load.r;
    }
    fn initialize(&mut self) {
        self.i = if self.on { self.u / self.load.r * f64::from(self.n) } else { 0.0 };
    }
    fn output(&self, _: Elapsed, out: &mut SmallOutputs) {
        out.i = self.i + self.load.map[1];
    }
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        self.i += step.h;
        Ok(())
    }
}

#[test]
fn indices_are_offsets_and_parts_are_seen_through() {
    let mut block = Block::<Small>::default();
    assert_eq!(Small::TABLE.len(), 10);
    let (name, meta, element) = Small::TABLE.locate(4).unwrap();
    assert_eq!((name.as_str(), meta.dimension, element), ("load.map", Some(3), 1));
    let elements: Vec<_> = (0..11).map(|i| Small::TABLE.element(i)).collect();
    assert_eq!(elements[2..7], [Some(0), Some(0), Some(1), Some(2), Some(0)]);
    assert_eq!(elements[10], None);
    let Some((_, Slot::Real(x))) = Small::TABLE.entry(&mut block, 5) else { panic!("an element") };
    *x = 7.0;
    assert_eq!(block.model.load.map, [0.0, 1.0, 7.0]);
    assert!(Small::TABLE.entry(&mut block, 10).is_none() && Small::TABLE.locate(10).is_none());
}

#[test]
fn description_says_what_depends_on_what() {
    let d = Description::of::<Small>().unwrap();
    let names: Vec<_> = d.variables.iter().map(|v| (v.name.as_str(), v.value_reference)).collect();
    let expected =
        [("u", 1), ("i", 2), ("load.R", 3), ("load.map", 4), ("load.mode", 7), ("on", 8), ("n", 9), ("gain", 10)];
    assert_eq!(names, expected);
    // i depends on u and on parameters; the gain only on parameters. All parameters are listed, also load.mode.
    assert_eq!(d.variable("i").unwrap().initial_dependencies, Some(vec![1, 3, 4, 5, 6, 7, 8, 9]));
    assert_eq!(d.variable("gain").unwrap().initial_dependencies, Some(vec![3, 4, 5, 6, 7, 8, 9]));
    assert_eq!(d.variable("load.map").unwrap().start.as_ref().unwrap().len(), 3);
    assert_eq!(d.variable("i").unwrap().start, None);
    assert_eq!(d.token, Small::HASH.guid().as_str());
}

/// A terminal's variables are looked up in the table; a wrong one is refused when the model is described.
mod terminals {
    use super::*;
    use fmu_core::terminal::MemberKind;

    const DOT: Icon = Icon { name: "dot", svg: "<svg/>", color: [1, 2, 3] };
    const OTHER_DOT: Icon = Icon { svg: "<svg >", ..DOT };
    const ICON: Icon = Icon { name: "icon", ..DOT };

    macro_rules! with_terminals {
        ($name:ident, $terminals:expr) => {
            #[derive(Clone, Default, Serialize, Deserialize)]
            struct $name(Small);
            impl Model for $name {
                type Outputs = SmallOutputs;
                const INFO: Info = Small::INFO;
                const TABLE: &'static Table<Block<Self>> = table![
                    Row::<Block<Self>>::input("u", &VOLT, "Voltage", |m| &mut m.model.0.u),
                    Row::<Block<Self>>::output("i", &AMPERE, "Current", |m| &mut m.out.i),
                    Row::<Block<Self>>::array_parameter("map", &SPEED, "Map", 3, |m| &mut m.model.0.load.map),
                ];
                const TERMINALS: &'static [Terminal] = $terminals;
                fn initialize(&mut self) {}
                fn output(&self, _: Elapsed, _: &mut SmallOutputs) {}
                fn advance(&mut self, _: &Step) -> Result<(), Fault> {
                    Ok(())
                }
            }
        };
    }

    with_terminals!(
        Good,
        &[const { Terminal::plug("port", "A port", const { &[Member::signal("u"), Member::outflow("q").of("i")] }) }
            .drawn(&DOT, -100.0, 40.0)]
    );
    with_terminals!(Bare, &[]);
    with_terminals!(NoVariable, &[Terminal::plug("port", "", const { &[Member::signal("v")] })]);
    with_terminals!(Array, &[Terminal::bus("port", "", const { &[Member::signal("map")] })]);
    with_terminals!(
        Twice,
        &[
            Terminal::bus("port", "", const { &[Member::signal("u")] }),
            Terminal::bus("port", "", const { &[Member::signal("i")] }),
        ]
    );
    with_terminals!(BadIcon, &[Terminal::bus("port", "", const { &[Member::signal("u")] }).drawn(&ICON, 0.0, 0.0)]);
    with_terminals!(
        OtherIcon,
        &[
            Terminal::bus("port", "", const { &[Member::signal("u")] }).drawn(&DOT, 0.0, 0.0),
            Terminal::bus("next", "", const { &[Member::signal("u")] }).drawn(&OTHER_DOT, 0.0, 0.0),
        ]
    );

    #[test]
    fn are_described_and_change_no_token() {
        let d = Description::of::<Good>().unwrap();
        let [port] = d.terminals.as_slice() else { panic!("one terminal") };
        let members: Vec<_> = port.members.iter().map(|m| (m.name.as_str(), m.variable.as_str(), m.kind)).collect();
        assert_eq!(members, [("u", "u", MemberKind::Signal), ("q", "i", MemberKind::Outflow)]);
        let picture = port.picture.as_ref().unwrap();
        assert_eq!((picture.area, picture.icon.as_str()), ([-110.0, 30.0, -90.0, 50.0], "dot"));
        assert_eq!(d.token, Description::of::<Bare>().unwrap().token);
        assert!(d.icon.is_none());
    }

    #[test]
    fn what_is_wrong_is_told() {
        fn why<M: Stored>() -> String {
            Description::of::<M>().unwrap_err().to_string()
        }
        assert_eq!(why::<NoVariable>(), "the terminal port names the variable v, which does not exist");
        assert!(why::<Array>().contains("has map: only a scalar"), "{}", why::<Array>());
        assert!(why::<Twice>().contains("port occurs twice"));
        assert!(why::<BadIcon>().contains("icon \"icon\""));
        assert!(why::<OtherIcon>().contains("draws its icon dot differently"));
    }
}

#[test]
fn a_fault_names_the_row_it_means() {
    let small = Small::default();
    let fault =
        Small::TABLE.fault(&Block { model: small, out: SmallOutputs::default() }, |m| &mut m.model.load.r, "less");
    assert_eq!(fault.message(), "load.R = 4 Ohm is not allowed: less");
    let load = Load { r: 1.0, map: [0.0; 3], mode: Mode::Odd };
    assert_eq!(LOAD.tell(&load, |m| &mut m.mode), "mode = 3 (Odd)");
}

#[test]
fn an_enum_takes_no_value_that_does_not_exist() {
    let mut block = Block::<Small>::default();
    let Some((_, Slot::Enumeration(mode))) = Small::TABLE.entry(&mut block, 6) else { panic!("an enumeration") };
    assert!(mode.set(3) && mode.get() == 3);
    assert!(!mode.set(2) && mode.get() == 3, "a refused value changes nothing");
    assert_eq!(block.model.load.mode, Mode::Odd);
}

/// A map on a grid (FMI-LS-STRUCT): its axes, its tables, and where they are read and looked up.
mod maps {
    use super::*;

    #[derive(Clone, Default, Serialize, Deserialize)]
    struct Maps {
        r: [f64; 6],
        n: [i32; 2],
        u: f64,
        k: i32,
    }

    macro_rules! with_map {
        ($name:ident, [$($member:expr),*]) => {
            #[derive(Clone, Default, Serialize, Deserialize)]
            struct $name(Maps);
            impl Model for $name {
                type Outputs = f64;
                const INFO: Info = Small::INFO;
                const TABLE: &'static Table<Block<Self>> = {
                    type V = Row<Block<$name>>;
                    table![
                        V::array_parameter("axis", &VOLT, "", 2, |m| &mut m.model.0.r[..2]),
                        V::array_parameter("long", &VOLT, "", 3, |m| &mut m.model.0.r[..3]),
                        V::array_parameter("values", &AMPERE, "", 2, |m| &mut m.model.0.r[..2]),
                        V::array_parameter("plane", &AMPERE, "", 6, |m| &mut m.model.0.r).shape(&[2, 3]),
                        V::array_input("moving", &AMPERE, "", 2, |m| &mut m.model.0.r[..2]),
                        V::parameter("one", &AMPERE, "", |m| &mut m.model.0.u),
                        V::input("u", &VOLT, "", |m| &mut m.model.0.u),
                        V::integer_input("k", "", |m| &mut m.model.0.k),
                        V::output("i", &AMPERE, "", |m| &mut m.out),
                    ]
                };
                const TERMINALS: &'static [Terminal] =
                    &[Terminal::map("map", "", const { &[$($member),*] })];
                fn initialize(&mut self) {}
                fn output(&self, _: Elapsed, _: &mut f64) {}
                fn advance(&mut self, _: &Step) -> Result<(), Fault> {
                    Ok(())
                }
            }
        };
    }

    with_map!(
        Curve,
        [Member::domain("axis"), Member::domain_input("u"), Member::codomain("values"), Member::codomain_output("i")]
    );
    with_map!(Plane, [Member::domain("axis"), Member::domain("long"), Member::codomain("plane")]);
    with_map!(Moving, [Member::domain("moving"), Member::codomain("values")]);
    with_map!(Scalar, [Member::domain("one"), Member::codomain("values")]);
    with_map!(Short, [Member::domain("long"), Member::codomain("values")]);
    with_map!(Fixed, [Member::domain("axis"), Member::domain_input("one"), Member::codomain("values")]);
    with_map!(Type, [Member::domain("axis"), Member::domain_input("k"), Member::codomain("values")]);
    with_map!(Output, [Member::domain("axis"), Member::codomain("values"), Member::codomain_output("u")]);

    #[test]
    fn fit_their_axes() {
        fn why<M: Stored>() -> String {
            Description::of::<M>().map_or_else(|fault| fault.to_string(), |_| String::new())
        }
        assert_eq!([why::<Curve>(), why::<Plane>()], ["", ""]);
        let one = "expected a parameter or a constant with one extent";
        assert_eq!(why::<Moving>(), format!("the terminal map has the domain moving: {one}"));
        assert_eq!(why::<Scalar>(), format!("the terminal map has the domain one: {one}"));
        let extents = "its extents are not the lengths of long";
        assert_eq!(why::<Short>(), format!("the terminal map has the codomain values: {extents}"));
        let shape = "expected an input, an output or a local variable of one shape";
        assert_eq!(why::<Fixed>(), format!("the terminal map has the input one of a domain: {shape}"));
        assert_eq!(why::<Type>(), "the terminal map has k of another type than axis");
        let output = "has the output u of a codomain, which is an input or a parameter";
        assert_eq!(why::<Output>(), format!("the terminal map {output}"));
    }
}
