//! A table with a row of every kind: values in messages and in a description, bounds, and what FMI 2.0 lacks.
#![allow(missing_docs)]

use fmu_core::unit::{ONE, VOLT};
use fmu_core::*;
use serde::{Deserialize, Serialize};

enumeration! {
    #[derive(Serialize, Deserialize)]
    enum Gear("Gear", "A gear") {
        1 Low "Slow";
        4 High "Fast";
    }
}

#[derive(Clone, Serialize, Deserialize)]
struct All {
    real: f64,
    single: f32,
    count: i32,
    on: bool,
    gear: Gear,
    text: String,
    frame: Bytes,
    interval: f64,
    words: Vec<String>,
    flags: [bool; 2],
    parts: [Gear; 2],
    singles: [f32; 2],
    wide: Vec<f64>,
    spare: f64,
}

impl Default for All {
    fn default() -> Self {
        Self {
            real: 1.5,
            single: 0.1,
            count: -3,
            on: true,
            gear: Gear::Low,
            text: "a \"b\"".into(),
            frame: Bytes::from(&[0, 255]),
            interval: 0.25,
            words: vec!["x".into(), "y".into()],
            flags: [false, true],
            parts: [Gear::High, Gear::Low],
            singles: [0.5, 2.0],
            wide: (0..200).map(f64::from).collect(),
            spare: 0.0,
        }
    }
}

type V = Row<Block<All>>;

const LEVELS: &[f64] = &[1.0, 2.0];
const LONG: &[f64] = &[7.0; 150];

impl Model for All {
    type Outputs = ();
    const INFO: Info = Info { name: "All", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::parameter("real", &VOLT, "", |m| &mut m.model.real).at_least(1.0).below(2.0),
        V::float32_parameter("single", &VOLT, "", |m| &mut m.model.single).at_most(0.5),
        V::integer_parameter("count", "", |m| &mut m.model.count).above(-4.0),
        V::boolean_parameter("on", "", |m| &mut m.model.on),
        V::enumeration_parameter("gear", "", &Field(|m: &mut Block<All>| &mut m.model.gear)),
        V::text_parameter("text", "", |m| &mut m.model.text),
        V::text_output("said", "", |m| &m.model.text[..1]),
        V::binary_parameter("frame", "", "application/x", 4, |m| &mut m.model.frame),
        V::clock("tick", "", Clock::fixed(|m: &mut Block<All>| &mut m.model.interval)),
        V::clock_output("tock", ""),
        V::computed_output("twice", &VOLT, "", |m| 2.0 * m.model.real),
        V::constant("real_constant", &VOLT, "", 2.5),
        V::float32_constant("single_constant", &ONE, "", 0.2),
        V::integer_constant("count_constant", "", 8),
        V::boolean_constant("on_constant", "", false),
        V::enumeration_constant::<Gear>("gear_constant", "", 4),
        V::text_constant("text_constant", "", "r1"),
        V::array_constant("levels", &VOLT, "", LEVELS),
        V::list_parameter("words", "", 2, &Items(|m: &mut Block<All>| &mut m.model.words)),
        V::list_parameter("flags", "", 2, &Items(|m: &mut Block<All>| &mut m.model.flags)),
        V::list_parameter("parts", "", 2, &Items(|m: &mut Block<All>| &mut m.model.parts)),
        V::list_parameter("singles", "", 2, &Items(|m: &mut Block<All>| &mut m.model.singles)),
        V::array_parameter("wide", &ONE, "", 200, |m| &mut m.model.wide),
        V::array_constant("long", &ONE, "", LONG),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

#[test]
fn messages_show_every_value() {
    let block = Block::<All>::default();
    for (name, told) in [
        ("real", "1.5 V"),
        ("single", "0.1 V"),
        ("count", "-3"),
        ("on", "true"),
        ("gear", "1 (Low)"),
        ("text", "\"a \\\"b\\\"\""),
        ("said", "\"a\""),
        ("frame", "00ff"),
        ("tick", "0.25 s"),
        ("tock", "a clock"),
        ("twice", "3 V"),
        ("real_constant", "2.5 V"),
        ("single_constant", "0.2"),
        ("count_constant", "8"),
        ("on_constant", "false"),
        ("gear_constant", "4 (High)"),
        ("text_constant", "\"r1\""),
        ("levels", "1 V"),
        ("words", "\"x\""),
        ("flags", "false"),
        ("parts", "4 (High)"),
        ("singles", "0.5"),
        ("wide", "0"),
        ("long", "7"),
    ] {
        assert_eq!(All::TABLE.tell_name(&block, name), Some(format!("{name} = {told}")));
    }
    assert_eq!(All::TABLE.tell_name(&block, "none"), None);
}

#[test]
fn a_value_is_found_where_the_model_has_it() {
    let block = Block::<All>::default();
    let table = All::TABLE;
    assert_eq!(table.tell(&block, |m| &mut m.model.single), "single = 0.1 V");
    assert_eq!(table.tell(&block, |m| &mut m.model.count), "count = -3");
    assert_eq!(table.tell(&block, |m| &mut m.model.on), "on = true");
    assert_eq!(table.tell(&block, |m| &mut m.model.text), "text = \"a \\\"b\\\"\"");
    assert_eq!(table.tell(&block, |m| &mut m.model.frame), "frame = 00ff");
    assert_eq!(table.tell(&block, |m| &mut m.model.interval), "tick = 0.25 s");
    assert_eq!(table.tell(&block, |m| &mut m.model.words[1]), "words = \"y\"");
    assert_eq!(table.tell(&block, |m| &mut m.model.wide[199]), "wide = 199");
    assert_eq!(table.tell(&block, |m| &mut m.model.spare), "a value without a variable");
}

#[test]
fn bounds_hold_for_every_type() {
    let mut block = Block::<All>::default();
    let mut allowed = |name: &str, change: fn(&mut All)| {
        change(&mut block.model);
        let index = All::TABLE.indices().find(|&i| All::TABLE.locate(i).is_some_and(|(found, ..)| found == name));
        let (meta, slot) = All::TABLE.entry(&mut block, index.unwrap()).unwrap();
        slot.is_allowed(meta)
    };
    assert!(allowed("real", |m| m.real = 1.0) && !allowed("real", |m| m.real = 2.0));
    assert!(allowed("single", |m| m.single = 0.5) && !allowed("single", |m| m.single = 0.75));
    assert!(allowed("count", |m| m.count = -3) && !allowed("count", |m| m.count = -4));
    assert!(allowed("frame", |m| m.frame.extend(&[1, 2])) && !allowed("frame", |m| m.frame.extend(&[3])));
    assert!(allowed("tick", |m| m.interval = 1e-9) && !allowed("tick", |m| m.interval = 0.0));
    assert!(!allowed("tick", |m| m.interval = f64::INFINITY));
    assert!(allowed("text", |m| m.text.clear()) && allowed("count_constant", |_| {}));
    assert!(allowed("real_constant", |_| {}) && allowed("single_constant", |_| {}) && allowed("tock", |_| {}));
}

struct This;

impl Exported for This {
    type Model = All;
    const CAN: Capabilities<All> = Capabilities::NONE;
}

#[test]
fn a_description_has_every_start_value() {
    use description::{Value, VariableKind};
    let description = Description::exported::<This>().unwrap();
    let text = |text: &str| Value::Text(text.into());
    let starts = [
        ("real", vec![Value::Real(1.5)]),
        ("single", vec![Value::Real(f64::from(0.1_f32))]),
        ("count", vec![Value::Integer(-3)]),
        ("on", vec![Value::Boolean(true)]),
        ("gear", vec![Value::Integer(1)]),
        ("text", vec![text("a \"b\"")]),
        ("frame", vec![Value::Binary(vec![0, 255])]),
        ("tick", vec![Value::Real(0.25)]),
        ("real_constant", vec![Value::Real(2.5)]),
        ("single_constant", vec![Value::Real(f64::from(0.2_f32))]),
        ("count_constant", vec![Value::Integer(8)]),
        ("on_constant", vec![Value::Boolean(false)]),
        ("gear_constant", vec![Value::Integer(4)]),
        ("text_constant", vec![text("r1")]),
        ("levels", LEVELS.iter().copied().map(Value::Real).collect()),
        ("words", vec![text("x"), text("y")]),
        ("flags", vec![Value::Boolean(false), Value::Boolean(true)]),
        ("parts", vec![Value::Integer(4), Value::Integer(1)]),
        ("singles", vec![Value::Real(0.5), Value::Real(2.0)]),
        ("wide", (0..200).map(|x| Value::Real(x.into())).collect()),
        ("long", LONG.iter().copied().map(Value::Real).collect()),
    ];
    for (name, start) in starts {
        assert_eq!(description.variable(name).unwrap().start, Some(start), "{name}");
    }
    for name in ["said", "tock", "twice"] {
        assert_eq!(description.variable(name).unwrap().start, None, "{name}");
    }
    let of = |name: &str| description.variable(name).unwrap();
    assert!(matches!(&of("frame").kind, VariableKind::Binary { mime_type, most: 4 } if mime_type == "application/x"));
    assert!(matches!(&of("tick").kind, VariableKind::Clock(timing) if timing.ticks.is_periodic()));
    assert!(matches!(of("text").kind, VariableKind::Text));
    let range = of("real").range();
    assert!(range.contains(1.0) && !range.contains(2.0) && range.contains(1.999));
    assert!(of("on").range().contains(f64::MAX));
    assert_eq!((of("wide").elements(), of("real").elements(), of("wide").is_array()), (200, 1, true));
    assert!(of("real").takes_start() && !of("said").takes_start());
    assert_eq!(description.model_name(), "All");
    assert_eq!(description.needs_fmi3().unwrap(), "frame is binary, and FMI 2.0 has no bytes");
    // The wide arrays follow everything else among the value references.
    assert_eq!((of("real").value_reference, of("wide").value_reference, of("long").value_reference), (1, 28, 228));
}
