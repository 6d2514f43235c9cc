//! Rows, tables, states and members that are built at run time: their properties and values.
#![allow(missing_docs, clippy::float_cmp)]

use fmu_core::bytes::Bytes;
use fmu_core::table::numbered;
use fmu_core::terminal::MemberKind;
use fmu_core::unit::{DisplayUnit, Exponents, PER_SECOND, Quantity, Unit, VOLT};
use fmu_core::variable::{Causality, Variability};
use fmu_core::{Dual, Kinds, Member, Part, Row, Slot, State, Table, enumeration, table};
use std::panic::catch_unwind;

enumeration! {
    enum Color("Color", "A color") {
        2 Red "Red";
        5 Blue "Blue";
    }
}

#[derive(Default)]
struct Motor {
    u: f64,
    sample: bool,
    angles: Vec<f64>,
}

#[derive(Default)]
struct Whole {
    motor: Motor,
}

const MOTOR: &Table<Motor> = table![
    Row::discrete_input("u", &VOLT, "", |m: &mut Motor| &mut m.u),
    Row::boolean_input("sample", "", |m: &mut Motor| &mut m.sample),
];

/// A table of these rows.
fn of<const N: usize>(rows: [Row<Whole>; N]) -> Table<Whole> {
    Table::new(Box::leak(Box::new(numbered(rows))))
}

/// Name, causality, variability and value of a variable.
fn properties(table: &Table<Whole>, index: usize) -> (&'static str, Causality, Variability, String) {
    let mut whole = Whole { motor: Motor { u: 1.5, ..Motor::default() } };
    let (meta, slot) = table.entry(&mut whole, index).unwrap();
    (meta.name, meta.causality, meta.variability, slot.to_string())
}

#[test]
fn constants_hold_their_values() {
    let table = of([
        Row::constant("real", &VOLT, "", 0.1),
        Row::float32_constant("single", &VOLT, "", 0.1),
        Row::boolean_constant("on", "", true),
        Row::text_constant("text", "", "said"),
        Row::enumeration_constant::<Color>("color", "", Color::Blue as i32),
        Row::uint64_constant("large", "", u64::MAX),
        Row::array_constant("list", &VOLT, "", &[1.0, -2.0]),
    ]);
    let values = ["0.1", "0.1", "true", "\"said\"", "5", "18446744073709551615", "1", "-2"];
    for (index, value) in values.into_iter().enumerate() {
        let (name, causality, variability, found) = properties(&table, index);
        assert_eq!((causality, variability), (Causality::Local, Variability::Constant), "{name}");
        assert_eq!(found, value, "{name}");
    }
    assert!(
        table.kinds().meets(Kinds::TEXT) && table.kinds().meets(Kinds::BOOLEAN) && !table.kinds().meets(Kinds::CLOCK)
    );
    assert!(catch_unwind(|| Row::<Whole>::enumeration_constant::<Color>("color", "", 3)).is_err(), "no item has it");
    assert_eq!((Color::ALL.len(), Color::Red.name(), Color::Blue.name()), (2, "Red", "Blue"));
}

#[test]
fn a_part_keeps_its_rows_and_what_is_computed_is_read() {
    static PART: Part<Whole, Motor> = Part { table: MOTOR, lens: |m| &mut m.motor };
    let table = of([Row::part("motor.", &PART), Row::computed_output("y", &VOLT, "", |m| 2.0 * m.motor.u)]);
    assert_eq!((table.len(), table.is_empty(), of::<0>([]).is_empty()), (3, false, true));
    assert_eq!(table.locate(0).unwrap().0, "motor.u");
    assert_eq!(properties(&table, 0), ("u", Causality::Input, Variability::Discrete, "1.5".to_owned()));
    assert_eq!(properties(&table, 2), ("y", Causality::Output, Variability::Discrete, "3".to_owned()));
    let mut whole = Whole::default();
    let Some((_, Slot::Boolean(sample))) = table.entry(&mut whole, 1) else { panic!("motor.sample is no truth value") };
    *sample = true;
    assert!(whole.motor.sample && table.entry(&mut whole, 3).is_none());
}

#[test]
fn states_say_what_they_are() {
    let one = State::new("u", &PER_SECOND, |m: &mut Motor| &mut m.u).reinit();
    let many = State::array("angles", &PER_SECOND, 3, |m: &mut Motor| &mut m.angles);
    assert_eq!((one.dimension(), one.most(), many.dimension(), many.most()), (None, 1, Some(3), 3));
    let of_part = State::of_part(&one, |m: &mut Whole| &mut m.motor.u);
    assert_eq!((of_part.name, of_part.reinit, many.reinit), ("u", true, false));
    let mut whole = Whole::default();
    *of_part.at(&mut whole) = 7.0;
    assert_eq!((whole.motor.u, one.all(&mut whole.motor)), (7.0, &mut [7.0][..]));
    assert!(catch_unwind(move || *many.at(&mut Motor::default())).is_err(), "an array has no single place");
}

#[test]
fn members_and_quantities_have_their_names() {
    let members = [Member::signal("a"), Member::inflow("b"), Member::outflow("c").of("motor.i")];
    assert_eq!(members.map(|member| (member.name, member.variable)), [("a", "a"), ("b", "b"), ("c", "motor.i")]);
    let kinds = members.map(|member| member.kind);
    assert!(matches!(kinds, [MemberKind::Signal, MemberKind::Inflow, MemberKind::Outflow]));
    let quantity = Quantity::new("Speed", Unit::si("m/s", Exponents::mechanical(0, 1, -1, 0)));
    let shown = quantity.shown_in(DisplayUnit { name: "km/h", factor: 3.6, offset: 0.0 });
    assert_eq!((quantity.unit.factor, quantity.display, shown.display.unwrap().name), (1.0, None, "km/h"));
}

#[test]
fn values_are_changed_in_place() {
    let mut bytes = Bytes::from([1, 2]);
    bytes[1] = 7;
    assert_eq!(bytes.to_string(), "0107");
    let mut x = Dual::new(1.0, 2.0);
    x += Dual::new(3.0, 5.0);
    assert_eq!((x.value, x.change), (4.0, 7.0));
}
