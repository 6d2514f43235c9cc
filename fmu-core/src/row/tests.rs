//! The rules of rows at run time: for each a row that breaks it, and rows that just keep it.

use super::*;
use crate::bytes::Bytes;
use crate::list::Items;
use crate::unit::{ONE, SPEED, VOLT};
use crate::variable::Alias;
use std::panic::catch_unwind;

#[derive(Default)]
struct All {
    x: f64,
    f: f32,
    n: i32,
    size: u64,
    on: bool,
    a: Vec<f64>,
    list: Vec<i32>,
    text: String,
    bytes: Bytes,
}

type V = Row<All>;

/// Rows of many kinds; each name says which.
fn row(name: &'static str) -> V {
    match name {
        "input" => V::input(name, &VOLT, "", |m| &mut m.x),
        "discrete" => V::discrete_output(name, &VOLT, "", |m| &mut m.x),
        "output" => V::output(name, &VOLT, "", |m| &mut m.x),
        "local" => V::local(name, &VOLT, "", |m| &mut m.x),
        "parameter" => V::parameter(name, &VOLT, "", |m| &mut m.x),
        "number" => V::output(name, &ONE, "", |m| &mut m.x),
        "constant" => V::constant(name, &VOLT, "", 1.0),
        "constants" => V::array_constant(name, &VOLT, "", &[1.0; 6]),
        "single" => V::float32_output(name, &VOLT, "", |m| &mut m.f),
        "single_parameter" => V::float32_parameter(name, &VOLT, "", |m| &mut m.f),
        "integer" => V::integer_output(name, "", |m| &mut m.n),
        "integer_input" => V::integer_input(name, "", |m| &mut m.n),
        "integer_parameter" => V::integer_parameter(name, "", |m| &mut m.n),
        "size" => V::structural(name, "", |m| &mut m.size),
        "boolean" => V::boolean_output(name, "", |m| &mut m.on),
        "array" => V::array_input(name, &VOLT, "", 6, |m| &mut m.a),
        "list" => V::list_parameter(name, "", 6, &Items(|m: &mut All| &mut m.list)),
        "text" => V::text_parameter(name, "", |m| &mut m.text),
        "said" => V::text_output(name, "", |m| &m.text),
        "bytes" => V::binary_parameter(name, "", "", 9, |m| &mut m.bytes),
        "sent" => V::binary_output(name, "", "", 9, |m| &mut m.bytes),
        _ => unreachable!("{name}"),
    }
}

const NAMES: [&str; 21] = [
    "input",
    "discrete",
    "output",
    "local",
    "parameter",
    "number",
    "constant",
    "constants",
    "single",
    "single_parameter",
    "integer",
    "integer_input",
    "integer_parameter",
    "size",
    "boolean",
    "array",
    "list",
    "text",
    "said",
    "bytes",
    "sent",
];

/// Applies a setting to a row of each kind: it takes those of `fits`, and refuses all others with this rule.
#[track_caller]
fn takes(setting: fn(V) -> V, fits: &str, rule: &str) {
    let fits: Vec<&str> = fits.split_whitespace().collect();
    assert!(fits.iter().all(|name| NAMES.contains(name)));
    for name in NAMES {
        let made = catch_unwind(|| setting(row(name)).meta);
        let said = made.err().map(|panic| panic.downcast_ref::<String>().unwrap().clone());
        assert_eq!(said, (!fits.contains(&name)).then(|| format!("{name}: {rule}")), "{name}");
    }
}

#[test]
fn each_setting_has_its_kinds_of_variables() {
    takes(
        V::tunable,
        "parameter single_parameter integer_parameter size list",
        "only a parameter of a type other than text and bytes can be tunable",
    );
    takes(V::discrete, "input output local number array", "only a continuous variable can be made discrete");
    takes(
        V::exact,
        "discrete output local number single integer boolean",
        "only an output or a local variable can be exact, and neither a text, bytes, a mean nor a constant",
    );
    takes(V::as_output, "constant constants", "only a constant can be made an output");
    takes(V::continuous, "single", "only a variable in single precision other than a parameter can be made continuous");
    takes(|row| row.shape(&[2, 3]), "constants array list", "the product of the extents is not the number of elements");
    takes(|row| row.sized(&["n"]), "array list", "only an array without a shape can be sized, and no constant");
    takes(
        V::unbounded,
        "input discrete output local parameter number constant constants single single_parameter array",
        "only a real variable can be unbounded",
    );
    takes(V::intermediate, "input output number array", "only a continuous input or output can be intermediate");
    takes(V::mean, "discrete output number", "only a real output can be a mean");
    takes(V::optional, "input integer_input array", "only an input can be left unconnected");
    takes(|row| row.read_with("p", "true"), "input integer_input array", "only an input can be left unconnected");
    let real = "input discrete output local parameter number constant constants single single_parameter array";
    takes(|row| row.nominal(-2.0), real, "only a real variable has a nominal value");
    let numbers = real.to_owned() + " integer integer_input integer_parameter size list";
    takes(|row| row.at_least(1.0), &numbers, "only a number can have a bound");
    takes(|row| row.at_most(9.0), &numbers, "only a number can have a bound");
    takes(|row| row.above(1.0), &numbers, "only a number can have a bound");
    takes(|row| row.below(9.0), &numbers, "only a number can have a bound");
}

/// The refusal of a row.
fn refusal(make: fn() -> V) -> Option<String> {
    catch_unwind(|| make().meta).err().map(|panic| panic.downcast_ref::<String>().unwrap().clone())
}

#[test]
fn settings_that_exclude_each_other() {
    let exact = Some(
        "output: only an output or a local variable can be exact, and neither a text, bytes, a mean nor a constant",
    );
    assert_eq!(refusal(|| row("output").mean().exact()).as_deref(), exact);
    assert_eq!(refusal(|| row("output").exact().mean()).as_deref(), Some("output: only a real output can be a mean"));
    let mean = refusal(|| row("constant").as_output().mean());
    assert_eq!(mean.as_deref(), Some("constant: only a real output can be a mean"));
    let shape = Some("array: the product of the extents is not the number of elements");
    assert_eq!(refusal(|| row("array").sized(&["n"]).shape(&[2, 3])).as_deref(), shape);
    assert_eq!(refusal(|| row("array").shape(&[2, 4])).as_deref(), shape);
    assert_eq!(refusal(|| row("array").shape(&[5])).as_deref(), shape);
    assert_eq!(refusal(|| row("array").shape(&[1, 2, 3])), None);
    let sized = Some("array: only an array without a shape can be sized, and no constant");
    assert_eq!(refusal(|| row("array").shape(&[2, 3]).sized(&["n"])).as_deref(), sized);
    assert_eq!(refusal(|| row("array").sized(&[])).as_deref(), sized);
    assert_eq!(refusal(|| row("output").nominal(0.0)).as_deref(), Some("output: a nominal value must not be 0"));
}

#[test]
fn bounds_leave_a_value() {
    let none = Some("output: the bounds leave no value");
    assert_eq!(refusal(|| row("output").at_least(1.0).at_most(1.0)), None);
    assert_eq!(refusal(|| row("output").above(1.0).below(1.5)), None);
    assert_eq!(refusal(|| row("output").above(1.0).at_most(1.0)).as_deref(), none);
    assert_eq!(refusal(|| row("output").at_least(1.0).below(1.0)).as_deref(), none);
    assert_eq!(refusal(|| row("output").at_least(1.5).at_most(1.0)).as_deref(), none);
    assert_eq!(refusal(|| row("output").at_least(f64::NAN)).as_deref(), none);
}

#[test]
fn an_alias_has_a_name_and_a_unit_of_its_own() {
    const PLAIN: Alias = Alias { name: "b", description: "", display: None };
    const SHOWN: Alias = Alias { name: "c", description: "", display: SPEED.display };
    const NAMELESS: Alias = Alias { name: "", ..PLAIN };
    const SAME: Alias = Alias { name: "output", ..PLAIN };
    let own = Some("output: an alias needs its own name");
    assert_eq!(refusal(|| row("output").aliases(&[PLAIN, SHOWN])), None);
    assert_eq!(refusal(|| row("single").aliases(&[SHOWN])), None);
    assert_eq!(refusal(|| row("boolean").aliases(&[PLAIN])), None);
    assert_eq!(refusal(|| row("output").aliases(&[PLAIN, NAMELESS])).as_deref(), own);
    assert_eq!(refusal(|| row("output").aliases(&[PLAIN, SAME])).as_deref(), own);
    let unit = Some("c: only a real variable with a unit can have a display unit");
    assert_eq!(refusal(|| row("boolean").aliases(&[PLAIN, SHOWN])).as_deref(), unit);
    assert_eq!(refusal(|| row("number").aliases(&[SHOWN])).as_deref(), unit);
    assert_eq!(row("output").aliases(&[PLAIN, SHOWN]).meta.aliases.len(), 2);
}

/// What the settings write.
#[test]
fn settings_apply() {
    let meta = |row: V| row.meta;
    assert_eq!(meta(row("parameter").tunable()).variability, Variability::Tunable);
    assert_eq!(meta(row("input").discrete()).variability, Variability::Discrete);
    assert_eq!(meta(row("single").continuous()).variability, Variability::Continuous);
    assert_eq!(meta(row("constant").as_output()).causality, Causality::Output);
    assert_eq!(
        (meta(row("array").shape(&[2, 3])).shape, meta(row("array").sized(&["n"])).sized),
        (&[2, 3][..], &["n"][..])
    );
    let flags = |meta: Meta| [meta.exact, meta.unbounded, meta.intermediate, meta.mean];
    assert_eq!(flags(meta(row("output"))), [false; 4]);
    assert_eq!(flags(meta(row("output").exact())), [true, false, false, false]);
    assert_eq!(flags(meta(row("output").unbounded())), [false, true, false, false]);
    assert_eq!(flags(meta(row("output").intermediate())), [false, false, true, false]);
    assert_eq!(flags(meta(row("output").mean())), [false, false, false, true]);
    assert_eq!(meta(row("output").nominal(-2.0)).nominal, Some(-2.0));
    let range = |row: V| (row.meta.range.min, row.meta.range.above, row.meta.range.max, row.meta.range.below);
    assert_eq!(range(row("output").above(1.0).below(2.0)), (1.0, true, 2.0, true));
    assert_eq!(range(row("output").at_least(1.0).at_most(2.0)), (1.0, false, 2.0, false));
    let needs = [row("input"), row("input").optional(), row("input").read_with("p", "true")].map(|row| row.meta.need);
    assert_eq!(needs, [Need::Always, Need::Never, Need::With { parameter: "p", value: "true" }]);
}
