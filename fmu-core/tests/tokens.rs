//! A token changes with each row and with each setting of a row; the allowed values of rows, for messages.
#![allow(missing_docs)]

use fmu_core::table::numbered;
use fmu_core::unit::{DisplayUnit, PER_SECOND, Quantity, VOLT};
use fmu_core::*;

enumeration! {
    enum Gear("Gear", "A gear") {
        1 Low "Slow";
        4 High "Fast";
    }
}

enumeration! {
    enum Speed("Speed", "A speed") {
        1 Low "Slow";
        4 High "Fast";
    }
}

enumeration! {
    enum Wheel("Gear", "A gear") {
        1 Low "Slow";
        5 High "Fast";
    }
}

#[derive(Default)]
struct All {
    x: f64,
    single: f32,
    int: i32,
    small: i8,
    on: bool,
    text: String,
    bytes: Bytes,
    array: Vec<f64>,
}

type V = Row<All>;

const MILLIVOLT: Quantity = VOLT.shown_in(DisplayUnit { name: "mV", factor: 1e3, offset: 0.0 });

fn table(row: V) -> Table<All> {
    Table::new(Box::leak(Box::new(numbered([row]))))
}

fn token(row: V) -> String {
    table(row).hash().guid().as_str().to_owned()
}

fn real(name: &'static str) -> V {
    V::parameter(name, &VOLT, "", |m| &mut m.x)
}

#[test]
fn every_setting_of_a_row_is_in_the_token() {
    fn of<E: Enumerated>() -> V {
        V::enumeration_constant::<E>("x", "", 1)
    }
    let array = || V::array_parameter("x", &VOLT, "", 6, |m| &mut m.array);
    let rows = [
        real("x"),
        real("y"),
        V::input("x", &VOLT, "", |m| &mut m.x),
        V::parameter("x", &PER_SECOND, "", |m| &mut m.x),
        V::parameter("x", &MILLIVOLT, "", |m| &mut m.x),
        real("x").tunable(),
        real("x").at_least(1.0),
        real("x").above(1.0),
        real("x").at_most(1.0),
        real("x").below(1.0),
        V::output("x", &VOLT, "", |m| &mut m.x),
        V::output("x", &VOLT, "", |m| &mut m.x).nominal(2.0),
        V::output("x", &VOLT, "", |m| &mut m.x).exact(),
        V::output("x", &VOLT, "", |m| &mut m.x).intermediate(),
        V::discrete_output("x", &VOLT, "", |m| &mut m.x),
        V::discrete_output("x", &VOLT, "", |m| &mut m.x).on("a"),
        V::discrete_output("x", &VOLT, "", |m| &mut m.x).on("a b"),
        array(),
        array().shape(&[2, 3]),
        array().shape(&[3, 2]),
        V::float32_parameter("x", &VOLT, "", |m| &mut m.single),
        V::integer_parameter("x", "", |m| &mut m.int),
        V::int8_parameter("x", "", |m| &mut m.small),
        V::boolean_parameter("x", "", |m| &mut m.on),
        V::text_parameter("x", "", |m| &mut m.text),
        V::binary_parameter("x", "", "a/b", 4, |m| &mut m.bytes),
        V::binary_parameter("x", "", "a/c", 4, |m| &mut m.bytes),
        V::binary_parameter("x", "", "a/b", 5, |m| &mut m.bytes),
        of::<Gear>(),
        of::<Speed>(),
        of::<Wheel>(),
        V::clock("x", "", Clock::constant(0.5)),
        V::clock("x", "", Clock::constant(0.25)),
        V::clock("x", "", Clock::constant(0.5)).shift(0.25),
        V::clock("x", "", Clock::constant(0.5)).priority(1),
        V::clock("x", "", Clock::fraction(1, 2)),
        V::clock("x", "", Clock::fraction(2, 4)),
        V::clock("x", "", Clock::triggered()),
        V::clock("x", "", Clock::countdown()),
        V::clock_output("x", ""),
        real("x").aliases(&[Alias { name: "z", description: "", display: None }]),
    ];
    let tokens = rows.map(token);
    for (i, token) in tokens.iter().enumerate() {
        assert_eq!(tokens.iter().position(|other| other == token), Some(i), "row {i}");
    }
    // A description is for people alone.
    assert_eq!(tokens[0], token(V::parameter("x", &VOLT, "A voltage", |m| &mut m.x)));
}

#[test]
fn messages_name_the_allowed_values() {
    for (row, allowed) in [
        (real("x"), "any finite number"),
        (real("x").at_least(1.0).below(2.0), "at least 1 and less than 2"),
        (real("x").at_most(2.0), "at most 2"),
        (V::int8_parameter("x", "", |m| &mut m.small).at_most(10.0), "-128 to 10"),
        (V::binary_parameter("x", "", "", 4, |m| &mut m.bytes), "at most 4 bytes"),
        (V::enumeration_constant::<Gear>("x", "", 1), "1 (Low), 4 (High)"),
    ] {
        assert_eq!(table(row).locate(0).unwrap().1.allowed(), allowed);
    }
}
