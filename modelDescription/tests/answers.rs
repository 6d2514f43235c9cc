//! What a description answers about sizes, elements, units and capabilities.

use model_description::{BaseType, FmiVersion, ModelDescription, Passage, read, read_terminals};
use std::time::{Duration, Instant};

const THREE: &str = "<fmiModelDescription fmiVersion='3.0' modelName='m' instantiationToken='g'>
  <CoSimulation modelIdentifier='m' canReturnEarlyAfterIntermediateUpdate='true' providesDirectionalDerivatives='1'/>
  <ModelExchange modelIdentifier='m' needsExecutionTool='true' mightReturnEarlyFromDoStep='true'/>
  <UnitDefinitions>
    <Unit name='K'><BaseUnit K='1'/><DisplayUnit name='degF' factor='1.8' offset='-459.67'/>
      <DisplayUnit name='degC' offset='-273.15'/></Unit>
    <Unit name='mK'><BaseUnit K='1' factor='0.001'/></Unit>
  </UnitDefinitions>
  <ModelVariables>
    <Int32 name='rows' valueReference='1' causality='structuralParameter' start=' 2 '/>
    <Int32 name='columns' valueReference='2' causality='structuralParameter' start='3'/>
    <Float64 name='m' valueReference='3' start='0'><Dimension valueReference='2'/><Dimension start='2'/></Float64>
    <Float64 name='t' valueReference='9' unit='K' displayUnit='degC'/>
    <Float64 name='band' valueReference='4' unit='K' displayUnit='degC' relativeQuantity='true'/>
    <Float64 name='fine' valueReference='5' unit='mK'/>
    <Float64 name='bare' valueReference='6'/>
  </ModelVariables>
  <ModelStructure/></fmiModelDescription>";

fn three() -> ModelDescription {
    read(THREE).unwrap()
}

/// An element is counted row by row, by the sizes in the file or by those that the importer has set.
#[test]
fn sizes_and_elements() {
    let md = three();
    let m = md.variable("m").unwrap();
    assert_eq!(md.shape(m), Some(vec![3, 2]));
    assert_eq!(md.shape_with(m, |reference| (reference == 2).then_some(5)), Some(vec![5, 2]));
    assert_eq!(md.shape(md.variable("t").unwrap()), Some(vec![]), "a scalar");
    assert!(m.is_array() && !md.variable("t").unwrap().is_array());
    let at = |found: Option<(_, usize)>| {
        found.map(|(v, number): (&model_description::ModelVariable, _)| (v.value_reference, number))
    };
    assert_eq!(at(md.element("m[2,1]")), Some((3, 2)));
    assert_eq!(at(md.element("m[4,1]")), None, "outside");
    assert_eq!(at(md.element_with("m[4,1]", |_| Some(5))), Some((3, 6)));
    assert_eq!((at(md.element("t[1]")), at(md.element("m")), at(md.element("x[1]"))), (None, None, None));
}

/// The value references do not ascend; in FMI 2.0 a reference is an index, counted from 1.
#[test]
fn references() {
    let mut md = three();
    for name in ["rows", "m", "t", "band", "bare"] {
        let reference = md.variable(name).unwrap().value_reference;
        assert_eq!(md.referenced(reference).map(|v| &*v.name), Some(name));
    }
    assert_eq!(md.referenced(7), None);
    md.version = FmiVersion::V2;
    assert_eq!(md.referenced(4).map(|v| &*v.name), Some("t"));
    assert_eq!((md.referenced(0), md.referenced(8)), (None, None));
}

/// The first of two variables with the same name is found. A search also works after the variables have changed.
#[test]
fn names() {
    let mut md = three();
    let names: Vec<_> = md.variables.iter().map(|v| v.name.clone()).collect();
    for name in &names {
        assert_eq!(md.variable(name).map(|v| &v.name), Some(name));
    }
    assert_eq!(md.variable("none"), None);
    md.variables.reverse();
    for name in &names {
        assert_eq!(md.variable(name).map(|v| &v.name), Some(name));
    }
    assert_eq!(md.clone(), md);
    let mut twice = three();
    twice.variables[3].name.clone_from(&names[1]);
    assert_eq!(twice.variable(&names[1]), Some(&twice.variables[1]));
    assert_eq!(twice.variable(&names[3]), None);
}

#[test]
fn units_of_variables() {
    let md = three();
    let [t, band, fine, bare] = ["t", "band", "fine", "bare"].map(|name| md.variable(name).unwrap());
    let shown = |v, name, x| md.display_unit(v, name).map(|d| (d.show(x) * 1e6).round() / 1e6);
    assert_eq!(shown(t, None, 300.0), Some(26.85));
    assert_eq!(shown(t, Some("degF"), 273.15), Some(32.0));
    assert_eq!((shown(band, None, 1.0), shown(band, Some("degF"), 10.0)), (Some(1.0), Some(18.0)), "differences");
    assert_eq!(
        (shown(fine, None, 1.0), shown(fine, Some("degC"), 1.0), shown(bare, Some("degC"), 1.0)),
        (None, None, None)
    );
    assert_eq!(md.measured(t).into_unit(md.measured(t)), Ok(Passage::Equal));
    let Ok(Passage::Converted(conversion)) = md.measured(fine).into_unit(md.measured(t)) else { panic!("mK to K") };
    assert!((conversion.apply(5000.0) - 5.0).abs() < 1e-12);
    assert!(matches!(md.measured(bare).into_unit(md.measured(t)), Ok(Passage::Unknown(_))));
    assert!(md.measured(band).into_unit(md.measured(t)).is_err(), "a difference is not a temperature");
}

#[test]
fn capabilities() {
    let md = three();
    let (cs, me) = (md.co_simulation.unwrap(), md.model_exchange.unwrap());
    // Either attribute is enough.
    assert!(cs.may_return_early() && me.may_return_early());
    assert_eq!((cs.needs_execution_tool(), me.needs_execution_tool()), (false, true));
    assert_eq!((cs.has_directional_derivatives(), me.has_directional_derivatives()), (true, false));
    assert!(!cs.can_get_and_set_state() && !cs.can_serialize_state() && !cs.has_event_mode());
    assert_eq!(cs.attribute("canSerializeFMUState"), None);
    // The two standards have opposite defaults: an importer of FMI 2.0 calls after each step unless the description says otherwise.
    let needs = |version| me.needs_completed_integrator_step(version);
    assert_eq!((needs(FmiVersion::V2), needs(FmiVersion::V3)), (true, false));
    let of_none = read(THREE.replace("canReturnEarlyAfterIntermediateUpdate='true' ", "")).unwrap();
    assert!(!of_none.co_simulation.unwrap().may_return_early());
}

#[test]
fn every_base_type_is_of_one_sort() {
    let of = |sort: fn(BaseType) -> bool| -> Vec<&str> {
        BaseType::ALL.iter().filter(|&&base| sort(base)).map(|base| base.as_str()).collect()
    };
    assert_eq!(of(BaseType::is_float), ["Float32", "Float64"]);
    let integers = ["Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Enumeration"];
    assert_eq!(of(BaseType::is_integer), integers);
}

/// A name may have a dot, and one may begin like another.
#[test]
fn terminals_by_their_paths() {
    let terminal =
        |name: &str, inside: &str| format!("<Terminal name='{name}' matchingRule='plug'>{inside}</Terminal>");
    let text = format!(
        "<fmiTerminalsAndIcons fmiVersion='3.0'><Terminals>{}{}{}</Terminals></fmiTerminalsAndIcons>",
        terminal("a", &terminal("b", "")),
        terminal("ab", ""),
        terminal("a.c", &terminal("d", "")),
    );
    let found = read_terminals(text).unwrap();
    let name = |path| found.terminal(path).map(|t| t.name.as_str());
    assert_eq!(["a", "a.b", "ab", "a.c", "a.c.d"].map(name), ["a", "b", "ab", "a.c", "d"].map(Some));
    assert_eq!(["b", "a.d", "abc", "a."].map(name), [None; 4]);
}

/// 100,000 searches among as many variables take a fraction of a second; linear searches take more than 20 s.
#[test]
fn many_names() {
    let (before, after) = THREE.split_once("<ModelVariables>").unwrap();
    let variable = |i: u32| format!("<Float64 name='part.x[{i}]' valueReference='{}'/>", i + 10);
    let many: String = (0..100_000).map(variable).collect();
    let md = read(format!("{before}<ModelVariables>{many}{after}")).unwrap();
    let start = Instant::now();
    for v in &md.variables {
        assert_eq!(md.variable(&v.name).map(|found| found.value_reference), Some(v.value_reference));
    }
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
}
