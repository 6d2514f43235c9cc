//! The reader on foreign files, and on broken ones.

mod common;

use common::{VERSIONS, xml};
use model_description::{
    BaseType, Causality, Dimension, Error, FmiVersion, Initial, ModelDescription, Variability, read,
};

fn two(inside: &str) -> String {
    format!(
        "<fmiModelDescription fmiVersion='2.0' modelName='m' guid='g'>\n{inside}\n<ModelStructure/></fmiModelDescription>"
    )
}

fn three(inside: &str) -> String {
    format!(
        "<fmiModelDescription fmiVersion='3.0' modelName='m' instantiationToken='g'>\n{inside}\n\
         <ModelStructure/></fmiModelDescription>"
    )
}

#[test]
fn a_minimal_file_of_each_standard() {
    for text in [two("<ModelVariables/>"), three("<ModelVariables/>")] {
        let ModelDescription { token, co_simulation, default_experiment, variables, .. } = read(&text).unwrap();
        assert_eq!((token.as_str(), co_simulation, variables.len()), ("g", None, 0));
        assert_eq!(default_experiment, model_description::Experiment::default());
    }
}

/// FMI 2.0.5, 2.2.3: a type definition contains the defaults, and a variable may override them.
#[test]
fn the_declared_type_gives_what_the_variable_does_not_say() {
    let text = two("<TypeDefinitions><SimpleType name='Speed'>
          <Real quantity='AngularVelocity' unit='rad/s' displayUnit='rpm' min='-10' max='1E2' nominal='5'/>
        </SimpleType></TypeDefinitions>
        <ModelVariables>
          <ScalarVariable name='a' valueReference='1'><Real declaredType='Speed'/></ScalarVariable>
          <ScalarVariable name='b' valueReference='2'><Real declaredType='Speed' unit='1/s' max='7'/></ScalarVariable>
        </ModelVariables>");
    let md = read(&text).unwrap();
    let (a, b) = (md.variable("a").unwrap(), md.variable("b").unwrap());
    assert_eq!((a.unit.as_deref(), a.display_unit.as_deref()), (Some("rad/s"), Some("rpm")));
    assert_eq!(
        (a.min, a.max, a.nominal, a.quantity.as_deref()),
        (Some(-10.0), Some(100.0), Some(5.0), Some("AngularVelocity"))
    );
    assert_eq!((b.unit.as_deref(), b.display_unit.as_deref()), (Some("1/s"), None), "rpm belongs to rad/s");
    assert_eq!((b.min, b.max), (Some(-10.0), Some(7.0)));
    assert_eq!((a.line, b.line), (6, 7));
}

/// FMI 2.0.5, 2.2.7 and FMI 3.0.2, 2.4.7.4 disagree on the default variability.
#[test]
fn defaults_of_each_standard() {
    let md = read(two(
        "<ModelVariables><ScalarVariable name='i' valueReference='1'><Integer/></ScalarVariable></ModelVariables>",
    ));
    let md = md.unwrap();
    assert_eq!((md.variables[0].causality, md.variables[0].variability), (Causality::Local, Variability::Continuous));
    let md = read(three(
        "<ModelVariables><Int8 name='i' valueReference='1'/><Float32 name='f' valueReference='2'/>
         <UInt64 name='p' valueReference='3' causality='structuralParameter' start='4'/>
         <Float64 name='t' valueReference='4' causality='independent'/></ModelVariables>",
    ));
    let expected = [
        (BaseType::Int8, Variability::Discrete, Some(Initial::Calculated)),
        (BaseType::Float32, Variability::Continuous, Some(Initial::Calculated)),
        (BaseType::UInt64, Variability::Fixed, Some(Initial::Exact)),
        (BaseType::Float64, Variability::Continuous, None),
    ];
    for (v, expected) in md.unwrap().variables.iter().zip(expected) {
        assert_eq!((v.base, v.variability, v.initial_or_default()), expected, "{}", v.name);
    }
}

#[test]
fn what_only_fmi_3_has() {
    let md = read(three(
        "<CoSimulation modelIdentifier='m' hasEventMode='1' canGetAndSetFMUState=' true '/>
         <UnitDefinitions><Unit name='l/100km'><DisplayUnit name='mpg' inverse='true' factor='235.2'/></Unit></UnitDefinitions>
         <TypeDefinitions><ClockType name='Tick' intervalVariability='constant'/></TypeDefinitions>
         <ModelVariables>
           <UInt64 name='n' valueReference='1' causality='structuralParameter' start='2'/>
           <Float64 name='m' valueReference='2' start='1 2 3 4'><Dimension valueReference='1'/><Dimension start='2'/>
             <Alias name='other' displayUnit='deg'/></Float64>
           <String name='s' valueReference='3'><Dimension start='2'/><Start value='a &lt; b'/><Start value='c'/></String>
           <Clock name='c' valueReference='4' declaredType='Tick'/>
           <Float64 name='x' valueReference='5' clocks='4' derivative='2'/>
           <Novelty name='from a later standard'/>
         </ModelVariables>",
    ))
    .unwrap();
    let cs = md.co_simulation.as_ref().unwrap();
    assert!(cs.has_event_mode() && cs.can_get_and_set_state() && !cs.can_serialize_state());
    assert!((md.unit("l/100km").unwrap().display_unit("mpg").unwrap().show(10.0) - 23.52).abs() < 1e-12);
    assert_eq!(md.types[0].base, BaseType::Clock);
    let m = md.variable("other").unwrap();
    assert_eq!((m.name.as_str(), m.start.as_deref()), ("m", Some("1 2 3 4")));
    assert_eq!(m.dimensions, [Dimension::Variable(1), Dimension::Fixed(2)]);
    let s = md.variable("s").unwrap();
    assert_eq!((s.start.as_deref(), &s.start_texts[..]), (Some("a < b"), &["a < b".to_owned(), "c".to_owned()][..]));
    let x = md.variable("x").unwrap();
    assert_eq!((&x.clocks[..], x.derivative), (&[4][..], Some(2)));
    assert_eq!(md.variables.len(), 5);
}

#[test]
fn model_exchange() {
    let md = read(
        two("<ModelExchange modelIdentifier='m' completedIntegratorStepNotNeeded='true'/>
         <ModelVariables><ScalarVariable name='der(x)' valueReference='7'><Real derivative='2'/></ScalarVariable>
         <ScalarVariable name='x' valueReference='9'><Real reinit='true'/></ScalarVariable></ModelVariables>")
        .replace("guid=", "numberOfEventIndicators='3' guid=")
        .replace(
            "<ModelStructure/>",
            "<ModelStructure><Derivatives><Unknown index='1'/></Derivatives></ModelStructure>",
        ),
    )
    .unwrap();
    let me = md.model_exchange.as_ref().unwrap();
    assert!(md.co_simulation.is_none() && !me.needs_completed_integrator_step(md.version));
    assert_eq!((md.number_of_event_indicators, me.model_identifier.as_str()), (Some(3), "m"));
    let states: Vec<_> = md.states().iter().map(|v| (v.name.as_str(), v.reinit)).collect();
    assert_eq!(states, [("x", true)], "an index, not a value reference");

    let md = read(
        three("<ModelExchange modelIdentifier='m' needsCompletedIntegratorStep='1' providesDirectionalDerivatives='true'/>
         <ModelVariables><Float64 name='z' valueReference='1'/><Float64 name='b' valueReference='3'/>
         <Float64 name='der(a)' valueReference='5' derivative='2'/><Float64 name='der(b)' valueReference='4' derivative='3'/>
         <Float64 name='a' valueReference='2'/></ModelVariables>")
        .replace("<ModelStructure/>", "<ModelStructure><ContinuousStateDerivative valueReference='4'/>
         <ContinuousStateDerivative valueReference='5'/><EventIndicator valueReference='1'/></ModelStructure>"),
    )
    .unwrap();
    let me = md.model_exchange.as_ref().unwrap();
    assert!(me.needs_completed_integrator_step(md.version) && me.flag("providesDirectionalDerivatives"));
    assert_eq!(
        md.states().iter().map(|v| v.name.as_str()).collect::<Vec<_>>(),
        ["b", "a"],
        "the order of the derivatives"
    );
    assert_eq!(md.event_indicators.iter().map(|u| u.reference).collect::<Vec<_>>(), [1]);
    assert_eq!(md.number_of_event_indicators, None);
}

#[test]
fn versions() {
    let file = |version: &str| two("<ModelVariables/>").replace("'2.0'", &format!("'{version}'"));
    let token = |text: String| text.replace("guid", "instantiationToken");
    for version in ["3.0", "3.0.2", "3.0-rc.1"] {
        let md = read(token(file(version))).unwrap();
        assert_eq!((md.version, md.fmi_version.as_str()), (FmiVersion::V3, version));
    }
    for version in ["1.0", "2.1", "3.1", "3.01", "2", ""] {
        let error = read(file(version)).unwrap_err();
        assert_eq!(error, Error::UnsupportedVersion { line: 1, found: version.into() });
    }
    let text = read(file("1.0")).unwrap_err().to_string();
    assert_eq!(text, "line 1: fmiVersion=\"1.0\" is not supported, expected 2.0 or 3.0");
}

#[test]
fn errors_say_where_and_what() {
    let variable = |text: &str| two(&format!("<ModelVariables>\n{text}\n</ModelVariables>"));
    for (text, message) in [
        ("PK\u{3}\u{4}".into(), "line 1: not well-formed XML: text outside the root element"),
        (
            "<SystemStructureDescription/>".into(),
            "line 1: the root element is <SystemStructureDescription>, expected <fmiModelDescription>",
        ),
        ("<fmiModelDescription/>".into(), "line 1: <fmiModelDescription> has no attribute \"fmiVersion\""),
        (two("<ModelVariables/>").replace("guid", "GUID"), "line 1: <fmiModelDescription> has no attribute \"guid\""),
        (two(""), "line 1: <fmiModelDescription> has no element <ModelVariables>"),
        (two("<CoSimulation/>\n<ModelVariables/>"), "line 2: <CoSimulation> has no attribute \"modelIdentifier\""),
        (
            two("<CoSimulation modelIdentifier='m' canInterpolateInputs='yes'/><ModelVariables/>"),
            "line 2: <CoSimulation> has canInterpolateInputs=\"yes\", expected true or false",
        ),
        (
            variable("<ScalarVariable name='x'><Real/></ScalarVariable>"),
            "line 3: <ScalarVariable> has no attribute \"valueReference\"",
        ),
        (
            variable("<ScalarVariable name='x' valueReference='-1'><Real/></ScalarVariable>"),
            "line 3: <ScalarVariable> has valueReference=\"-1\", expected an integer of type u32",
        ),
        (
            variable("<ScalarVariable name='x' valueReference='1'/>"),
            "line 3: <ScalarVariable> has no element <Real, Integer, Boolean, String or Enumeration>",
        ),
        (
            variable("<ScalarVariable name='x' valueReference='1'>\n<Real min='1,5'/></ScalarVariable>"),
            "line 4: <Real> has min=\"1,5\", expected a number",
        ),
        (
            variable("<ScalarVariable name='x' valueReference='1' initial='none'><Real/></ScalarVariable>"),
            "line 3: <ScalarVariable> has initial=\"none\", expected one of exact, approx, calculated",
        ),
        (
            two("<ModelVariables/>").replace(
                "<ModelStructure/>",
                "<ModelStructure><Outputs><Unknown index='1' dependencies='x'/></Outputs></ModelStructure>",
            ),
            "line 3: <Unknown> has dependencies=\"x\", expected a list of unsigned integers",
        ),
    ] {
        assert_eq!(read(&text).map_err(|e| e.to_string()), Err(message.to_owned()), "{text}");
    }
    assert_eq!(read(b"<a>\n\xff</a>").unwrap_err().to_string(), "line 2: not well-formed XML: not UTF-8");
    for (bytes, encoding) in [
        (&b"\xff\xfe\0\0<\0\0\0"[..], "UTF-32"),
        (b"\0\0\xfe\xff\0\0\0<", "UTF-32"),
        (b"\xff\xfe<\0a\0", "UTF-16"),
        (b"\xfe\xff\0<\0a", "UTF-16"),
        (b"<\0a\0", "UTF-16"),
        (b"\0<\0a", "UTF-16"),
    ] {
        let expected = format!("line 1: not well-formed XML: the encoding is {encoding}, expected UTF-8");
        assert_eq!(read(bytes).unwrap_err().to_string(), expected);
    }
}

/// No panic, regardless of the bytes: every prefix of a file, and every byte of it replaced.
#[test]
fn broken_files_are_answered_by_an_error() {
    for version in VERSIONS {
        let whole = xml(version);
        let end = whole.trim_end().len();
        for length in 0..end {
            assert!(read(&whole.as_bytes()[..length]).is_err(), "{length} of {end} bytes were read as a whole file");
        }
        for at in 0..end {
            for byte in [0, b'<', b'"', b'&', b'9', 0xff] {
                let mut bytes = whole.clone().into_bytes();
                bytes[at] = byte;
                if let Err(error) = read(&bytes) {
                    assert!(error.to_string().starts_with("line "), "{error}");
                }
            }
        }
    }
}
