//! Values as a user writes them: of each type, with units, and converted into other types.

use fmu_import::{BaseType, ModelDescription, Number, Values};

/// One variable of each kind, and arrays of some.
fn description() -> ModelDescription {
    let xml = "<fmiModelDescription fmiVersion='3.0' modelName='m' instantiationToken='g'>\
        <CoSimulation modelIdentifier='m'/>\
        <UnitDefinitions>\
        <Unit name='rad/s'><BaseUnit rad='1' s='-1'/><DisplayUnit name='rpm' factor='10' offset='5'/></Unit>\
        <Unit name='krad/s'><BaseUnit rad='1' s='-1' factor='1000'/></Unit>\
        <Unit name='V'><BaseUnit kg='1' m='2' s='-3' A='-1'/></Unit></UnitDefinitions>\
        <TypeDefinitions><EnumerationType name='Mode'><Item name='off, or not' value='0'/><Item name='on' value='3'/>\
        </EnumerationType></TypeDefinitions>\
        <ModelVariables>\
        <Float64 name='speed' valueReference='1' causality='input' unit='rad/s' start='1.5'/>\
        <Float64 name='plain' valueReference='2' causality='output'/>\
        <Float64 name='reals' valueReference='3' causality='input' start='1 2 3'><Dimension start='3'/></Float64>\
        <Boolean name='flag' valueReference='4' causality='input' start='true'/>\
        <Int8 name='small' valueReference='5' causality='input' start='-7'/>\
        <UInt64 name='large' valueReference='6' causality='input' start='0'/>\
        <Enumeration name='mode' valueReference='7' causality='input' declaredType='Mode' start='3'/>\
        <String name='text' valueReference='8' causality='input'><Start value='a, b'/></String>\
        <String name='texts' valueReference='9' causality='input'><Dimension start='2'/><Start value='a'/><Start value='b'/></String>\
        <Binary name='bytes' valueReference='10' causality='input'><Start value='0aFF'/></Binary>\
        </ModelVariables><ModelStructure/></fmiModelDescription>";
    model_description::read(xml).unwrap()
}

fn read(name: &str, text: &str) -> Result<Values, String> {
    let description = description();
    Values::read(text, description.variable(name).unwrap(), &description)
}

fn reals<const N: usize>(x: [f64; N]) -> Values {
    Values::Reals(x.to_vec())
}

fn integers<const N: usize>(x: [i128; N]) -> Values {
    Values::Integers(x.to_vec())
}

fn texts<const N: usize>(x: [&str; N]) -> Values {
    Values::Strings(x.map(str::to_owned).to_vec())
}

#[test]
fn a_text_is_read_in_the_type_of_its_variable() {
    for (name, text, values) in [
        ("reals", "1, -2.5,3e2", reals([1.0, -2.5, 300.0])),
        ("reals", " 1  -2.5 3e2 ", reals([1.0, -2.5, 300.0])),
        ("flag", "TRUE", Values::Booleans(vec![true])),
        ("flag", "0", Values::Booleans(vec![false])),
        ("small", "-128", integers([-128])),
        ("large", "18446744073709551615", integers([u64::MAX.into()])),
        ("mode", "off, or not", integers([0])),
        ("mode", "on", integers([3])),
        ("mode", "7", integers([7])),
        ("text", "a, \"b\"", texts(["a, \"b\""])),
        ("texts", "\"a, b\", c", texts(["a, b", "c"])),
        ("bytes", "00fF", Values::Binaries(vec![vec![0, 255]])),
    ] {
        assert_eq!(read(name, text), Ok(values), "{name} = {text}");
    }
    for (name, text, message) in [
        ("speed", "fast", "speed = fast is not a number"),
        ("speed", "1,5", "speed = 1,5 is not a number: write a decimal point"),
        ("flag", "2", "flag = 2 is not true or false"),
        ("small", "1.5", "small = 1.5 is not an integer"),
        ("small", "128", "small = 128 is not of the type Int8: -128 to 127"),
        ("large", "-1", "large = -1 is not of the type UInt64: 0 to 18446744073709551615"),
        ("mode", "of", "mode = of is not one of off, or not, on"),
        ("bytes", "0", "bytes = 0 is not bytes, each of two hexadecimal digits"),
    ] {
        assert_eq!(read(name, text).unwrap_err(), message);
    }
}

#[test]
fn a_unit_converts_the_number_or_is_refused_with_those_that_fit() {
    assert_eq!(read("speed", "3"), Ok(reals([3.0])));
    assert_eq!(read("speed", "3 rad/s"), Ok(reals([3.0])));
    // What is shown is 10 times the value plus 5.
    assert_eq!(read("speed", "25rpm"), Ok(reals([2.0])));
    assert_eq!(read("speed", "3 krad/s"), Ok(reals([3000.0])));
    assert_eq!(read("speed", "3 V").unwrap_err(), "speed = 3V is not a number in rad/s or rpm");
    assert_eq!(read("plain", "3 V").unwrap_err(), "plain = 3V is not a number, and the variable has no unit");
    assert_eq!(read("speed", "1,5rpm").unwrap_err(), "speed = 1,5rpm is not a number: write a decimal point");
}

#[test]
fn a_start_value_has_all_elements() {
    let description = description();
    let start = |name: &str| Values::start(description.variable(name).unwrap(), &description);
    assert_eq!(start("speed"), Ok(reals([1.5])));
    assert_eq!(start("reals"), Ok(reals([1.0, 2.0, 3.0])));
    assert_eq!(start("text"), Ok(texts(["a, b"])));
    assert_eq!(start("texts"), Ok(texts(["a", "b"])));
    assert_eq!(start("bytes"), Ok(Values::Binaries(vec![vec![10, 255]])));
    assert_eq!(start("plain"), Err("plain has no start value".into()));
}

#[test]
fn values_become_another_type_without_losing_digits() {
    let of = |x: Number, base| Values::from_number(x, base);
    assert_eq!(of(Number::Integer(i128::from(u64::MAX)), BaseType::UInt64), Ok(integers([u64::MAX.into()])));
    assert_eq!(of(Number::Integer(-2), BaseType::Float64), Ok(reals([-2.0])));
    assert_eq!(of(Number::Integer(-2), BaseType::Boolean), Ok(Values::Booleans(vec![true])));
    assert_eq!(of(Number::Boolean(true), BaseType::Float32), Ok(reals([1.0])));
    assert_eq!(of(Number::Boolean(true), BaseType::Int32), Ok(integers([1])));
    assert_eq!(of(Number::Real(2.5), BaseType::Int32), Ok(integers([3])));
    assert_eq!(of(Number::Real(f64::NAN), BaseType::Int32), Ok(integers([0])));
    assert_eq!(of(Number::Real(0.0), BaseType::Clock), Ok(Values::Booleans(vec![false])));
    assert_eq!(of(Number::Missing, BaseType::Float64), Err("the number is missing".into()));
    assert_eq!(of(Number::Real(1.0), BaseType::String), Err("a number cannot become a String".into()));
    assert_eq!(integers([1]).into_base(BaseType::Binary), Err("a number cannot become a Binary".into()));
    assert_eq!(texts(["1"]).into_base(BaseType::Int8), Err("a text cannot become a Int8".into()));
    assert_eq!(texts(["1"]).into_base(BaseType::String), Ok(texts(["1"])));
}

#[test]
fn an_element_is_taken_and_replaced_alone() {
    let bytes = Values::Binaries(vec![vec![1], vec![2, 255]]);
    for (all, second, number, cell) in [
        (reals([1.5, 2.5]), reals([2.5]), Some(1.5), "1.5 2.5"),
        (integers([1, 2]), integers([2]), Some(1.0), "1 2"),
        (Values::Booleans(vec![true, false]), Values::Booleans(vec![false]), Some(1.0), "true false"),
        (texts(["a", "b"]), texts(["b"]), None, "a b"),
        (bytes, Values::Binaries(vec![vec![2, 255]]), None, "01 02ff"),
    ] {
        assert_eq!((all.number(), all.len(), all.is_empty()), (number, 2, false));
        assert_eq!(all.cell().to_lowercase(), cell);
        assert_eq!(all.clone().element(1).as_ref(), Some(&second));
        assert_eq!(all.clone().element(2), None);
        let mut changed = all.clone();
        assert!(changed.replace(0, &second));
        assert_eq!(changed.clone().element(0), Some(second.clone()));
        assert!(!changed.replace(2, &second) && !changed.replace(0, &all), "{all}");
    }
    assert!(!reals([1.0]).replace(0, &integers([1])), "another type");
    assert!(reals([]).is_empty());
    assert_eq!(reals([1.0]).one(1), Number::Missing);
}

#[test]
fn a_number_is_written_with_all_digits_of_its_type() {
    let large = (1_i128 << 53) + 1;
    let words =
        [Number::Integer(large), Number::Real(0.1), Number::Boolean(true), Number::Missing].map(|x| x.to_string());
    assert_eq!(words, ["9007199254740993", "0.1", "1", ""]);
    assert!(Number::Missing.real().is_nan());
    assert_eq!(
        [Number::Boolean(true), 2.5.into()].map(|x: Number| x.real().to_bits()),
        [1.0_f64, 2.5].map(f64::to_bits)
    );
}
