//! Each parameter has exactly one variable, in the table of its part, so every refusal can name the parameter.

use drive::PmsmDrive;
use drive::control::tables as control;
use drive::plant::tables as plant;
use fmu_core::{Kind, Model, Slot, Table};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// The single values of `value`, by their path through the structs.
fn leaves(value: &impl Serialize) -> BTreeMap<String, String> {
    fn collect(path: &str, value: &Value, found: &mut BTreeMap<String, String>) {
        if let Value::Object(fields) = value {
            return fields.iter().for_each(|(name, value)| collect(&format!("{path}.{name}"), value, found));
        }
        if let Value::Array(elements) = value {
            let each = elements.iter().enumerate();
            return each.for_each(|(k, value)| collect(&format!("{path}[{k}]"), value, found));
        }
        found.insert(path.into(), value.to_string());
    }
    let mut found = BTreeMap::new();
    collect("", &serde_json::to_value(value).unwrap(), &mut found);
    found
}

/// Changes each variable of `table` in turn and looks for the changed field.
fn each_field_has_a_variable<P: Clone + Default + Serialize + 'static>(table: &Table<P>) {
    let start = P::default();
    let before = leaves(&start);
    let mut moved: BTreeMap<String, String> = BTreeMap::new();
    for index in 0..table.len() {
        let (name, meta, _) = table.locate(index).unwrap();
        let mut parameters = start.clone();
        match table.entry(&mut parameters, index).unwrap().1 {
            Slot::Real(x) => *x += 0.5,
            Slot::Boolean(x) => *x = !*x,
            Slot::Integer(x) => assert!(x.set(x.get() + 1), "{name}"),
            Slot::Enumeration(x) => {
                let Kind::Enumeration(of) = meta.kind else { panic!("{name} is an enumeration") };
                let other = of.items.iter().find(|item| item.value != x.get()).unwrap();
                assert!(x.set(other.value), "{name}");
            }
            other => panic!("{name}: no value of a parameter: {other:?}"),
        }
        let after = leaves(&parameters);
        let changed: Vec<&String> = before.keys().filter(|path| before[*path] != after[*path]).collect();
        let [field] = changed[..] else { panic!("{name} moves {changed:?}") };
        let other = moved.insert(field.clone(), name.clone());
        assert_eq!(other, None, "{field} has two variables, {name} is one");
        if matches!(meta.kind, Kind::Real(_)) {
            let named = table.tell(&start, |p| match table.entry(p, index) {
                Some((_, Slot::Real(x))) => x,
                other => panic!("{name}: {other:?}"),
            });
            assert!(named.starts_with(&format!("{name} = ")), "{named}, not {name}");
        }
    }
    let without: Vec<&String> = before.keys().filter(|path| !moved.contains_key(*path)).collect();
    assert!(without.is_empty(), "without a variable: {without:?}");
    assert!(before.len() > 40, "{before:?}");
}

#[test]
fn of_the_plant() {
    each_field_has_a_variable(plant::PARAMETERS);
}

#[test]
fn of_the_controller() {
    each_field_has_a_variable(control::PARAMETERS);
}

#[test]
fn pole_pairs_that_differ_within_a_drive() {
    let mut drive = PmsmDrive::default();
    drive.validate().unwrap();
    drive.pair.controller.model.parameters.motor.n_p = 4;
    let message = drive.validate().expect_err("must be refused").message().to_owned();
    for part in ["plant.motor.n_p = 3", "controller.motor.n_p = 4", "the same number"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    drive.pair.plant.model.parameters.motor.n_p = 4;
    drive.validate().unwrap();
}
