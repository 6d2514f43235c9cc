//! The output of the writer, read back and compared with the description and the rules of the standards.

mod common;

use common::{AWKWARD, VERSIONS, exchange_sample, generation, rare_sample, sample, sampled_sample, xml};
use fmu_core::description::{Value, VariableKind};
use fmu_core::{Description, IntegerType, Keeps};
use model_description::{
    BaseType, Causality, Dimension, FmiVersion, Initial, IntervalVariability, ModelDescription, Unknown, Variability,
    fits, read, write,
};

fn sample_read(version: FmiVersion) -> ModelDescription {
    read(xml(version)).unwrap()
}

/// The whole text, so that any change is noticed. `UPDATE_GOLDEN=1 cargo test -p model-description` accepts a change.
#[test]
fn golden_files() {
    let both = [("sample", sample()), ("exchange", exchange_sample()), ("sampled", sampled_sample())];
    let mut all: Vec<_> =
        both.into_iter().flat_map(|(name, of)| VERSIONS.map(|version| (name, of.clone(), version))).collect();
    all.push(("rare", rare_sample(), FmiVersion::V3));
    for (name, of, version) in all {
        let path = format!("{}/tests/golden/{name}-{version}.xml", env!("CARGO_MANIFEST_DIR"));
        let written = write(&of, version, &generation());
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            std::fs::write(&path, &written).unwrap();
        }
        let golden = std::fs::read_to_string(&path).unwrap();
        assert!(written == golden, "{path} differs from what is written now:\n{written}");
        assert_eq!(written, write(&of, version, &generation()), "not deterministic");
    }
}

#[test]
fn header() {
    for version in VERSIONS {
        let text = xml(version);
        assert!(text.starts_with("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"), "X01");
        let (md, sample) = (sample_read(version), sample());
        assert_eq!((md.version, md.fmi_version.as_str()), (version, version.to_string().as_str()), "X02");
        assert_eq!((md.model_name, md.token), (sample.name, sample.token), "X04");
        assert_eq!(md.generation_date_and_time.as_deref(), Some("2026-01-02T03:04:05Z"), "X05");
        assert_eq!(md.generation_tool, Some(generation().tool), "X06");
        assert_eq!(md.author.as_deref(), Some("A & B"), "X06");
        assert_eq!(md.model_version, Some(sample.version), "X06");
        assert_eq!(md.copyright, Some(sample.copyright), "X06");
        assert_eq!(md.license, Some(sample.license), "X06");
        assert_eq!(md.description.as_deref(), Some(AWKWARD), "X13");
        assert!(md.structured_names, "V01");
        let experiment = md.default_experiment;
        assert_eq!((experiment.start, experiment.stop, experiment.step), (Some(0.0), Some(2.0), Some(1e-4)), "X10");
        assert!(md.model_exchange.is_none() && md.scheduled_execution.is_none());
    }
}

/// The name for users may differ; the binary keeps its name.
#[test]
fn a_title_is_the_name_of_the_model() {
    for version in VERSIONS {
        let titled = Description { title: Some("My <motor>".into()), ..exchange_sample() };
        let md = read(write(&titled, version, &generation())).unwrap();
        assert_eq!(md.model_name, "My <motor>");
        let identifiers = [md.co_simulation, md.model_exchange].map(|interface| interface.unwrap().model_identifier);
        assert_eq!(identifiers, [exchange_sample().name, exchange_sample().name]);
    }
}

#[test]
fn capabilities() {
    for (version, state) in VERSIONS.into_iter().zip(["FMUstate", "FMUState"]) {
        let cs = sample_read(version).co_simulation.unwrap();
        assert_eq!(cs.model_identifier, "Sample", "X03");
        for name in [format!("canGetAndSet{state}"), format!("canSerialize{state}")] {
            assert_eq!(cs.attribute(&name), Some("true"), "X07: {name}");
        }
        assert!(
            cs.can_get_and_set_state() && cs.can_serialize_state() && cs.flag("canHandleVariableCommunicationStepSize"),
            "X08"
        );
        assert!(
            !cs.needs_execution_tool() && !cs.flag("canBeInstantiatedOnlyOncePerProcess") && !cs.has_event_mode(),
            "X08"
        );
        assert_eq!(cs.flag("canNotUseMemoryManagementFunctions"), version == FmiVersion::V2, "X08");
        assert_eq!(cs.attribute("canInterpolateInputs"), (version == FmiVersion::V2).then_some("false"));
    }
}

/// What an importer cannot keep is not promised, nor what is computed on a copy.
#[test]
fn a_model_that_cannot_be_copied() {
    for (version, state) in VERSIONS.into_iter().zip(["FMUstate", "FMUState"]) {
        for keeps in [Keeps::Nothing, Keeps::Saved, Keeps::Stored] {
            let md = read(write(&Description { keeps, ..exchange_sample() }, version, &generation())).unwrap();
            for interface in [md.co_simulation.unwrap(), md.model_exchange.unwrap()] {
                let given = |name: &str| interface.attribute(name) == Some("true");
                assert_eq!(given(&format!("canGetAndSet{state}")), keeps != Keeps::Nothing);
                assert_eq!(given(&format!("canSerialize{state}")), keeps == Keeps::Stored);
                let derivatives = ["providesDirectionalDerivative", "providesDirectionalDerivatives"];
                assert_eq!(derivatives.into_iter().any(given), keeps != Keeps::Nothing);
                assert!(!given("canInterpolateInputs") || keeps != Keeps::Nothing);
            }
        }
    }
}

#[test]
fn log_categories() {
    for version in VERSIONS {
        let names: Vec<_> = sample_read(version).log_categories.into_iter().map(|c| c.name).collect();
        let expected = fmu_core::log::CATEGORIES.iter().map(|(name, _)| (*name).to_owned());
        let all = (version == FmiVersion::V2).then(|| "logAll".to_owned());
        assert_eq!(names, expected.chain(all).collect::<Vec<_>>(), "G-L1");
    }
}

type Expected = (&'static str, BaseType, Causality, Variability, Option<Initial>, &'static str);

/// Name, base type, causality, variability, initial and the first start value of every variable of the sample.
const EXPECTED: [Expected; 12] = [
    ("u_dc", BaseType::Float64, Causality::Input, Variability::Continuous, None, "325.1"),
    ("enable", BaseType::Boolean, Causality::Input, Variability::Discrete, None, "true"),
    ("motor.n_p", BaseType::Int32, Causality::Parameter, Variability::Fixed, Some(Initial::Exact), "3"),
    ("filter.b", BaseType::Float64, Causality::Parameter, Variability::Fixed, Some(Initial::Exact), "0.1"),
    ("observer", BaseType::Enumeration, Causality::Parameter, Variability::Fixed, Some(Initial::Exact), "3"),
    ("bandwidth", BaseType::Float64, Causality::Parameter, Variability::Tunable, Some(Initial::Exact), "5e-324"),
    ("share", BaseType::Float64, Causality::Parameter, Variability::Fixed, Some(Initial::Exact), "50"),
    ("gain", BaseType::Float64, Causality::CalculatedParameter, Variability::Fixed, Some(Initial::Calculated), ""),
    ("speed", BaseType::Float64, Causality::Output, Variability::Continuous, Some(Initial::Calculated), ""),
    ("sector", BaseType::Int32, Causality::Output, Variability::Discrete, Some(Initial::Calculated), ""),
    ("ready", BaseType::Boolean, Causality::Output, Variability::Discrete, Some(Initial::Calculated), ""),
    ("inner", BaseType::Float64, Causality::Local, Variability::Continuous, Some(Initial::Calculated), ""),
];

#[test]
fn variables_come_back() {
    for version in VERSIONS {
        let (md, sample) = (sample_read(version), sample());
        if version == FmiVersion::V2 {
            assert!(md.variables.iter().all(|v| v.causality != Causality::Independent && v.value_reference > 0), "V03");
        } else {
            // OMSimulator counts value references of FMI 3.0 from 1: time, which is 0, comes last.
            let time = md.variables.last().unwrap();
            assert_eq!((time.name.as_str(), time.value_reference, time.unit.as_deref()), ("time", 0, Some("s")), "V03");
            assert_eq!((time.causality, time.variability), (Causality::Independent, Variability::Continuous), "V03");
            assert_eq!((&time.start, time.initial), (&None, None), "V03");
        }
        for (name, base, causality, variability, initial, start) in EXPECTED {
            let array = name == "filter.b" && version == FmiVersion::V2;
            let v = md.variable(if array { "filter.b[1]" } else { name }).unwrap();
            let of = sample.variable(name).unwrap();
            assert_eq!((v.base, v.causality, v.variability, v.initial), (base, causality, variability, initial), "V04");
            let first = v.start.as_ref().and_then(|text| text.split(' ').next());
            assert_eq!(first.unwrap_or_default(), start, "V04, V07: {name}");
            assert_eq!(v.value_reference, of.value_reference, "V02");
            assert_eq!(v.description.as_ref(), Some(&of.description), "X13");
        }
        let u_dc = md.variable("u_dc").unwrap();
        assert_eq!((u_dc.min, u_dc.max, u_dc.nominal), (Some(0.0), Some(1e21), Some(300.0)));
        // A bound of an integer that xs:int cannot express is omitted.
        let n_p = md.variable("motor.n_p").unwrap();
        assert_eq!((n_p.min, n_p.max), (Some(1.0), None));
        let mut names: Vec<_> = md.variables.iter().map(|v| &v.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), md.variables.len(), "V01");
    }
}

#[test]
fn arrays() {
    let three = sample_read(FmiVersion::V3);
    let b = three.variable("filter.b").unwrap();
    assert_eq!((&b.dimensions[..], b.is_array()), (&[Dimension::Fixed(3)][..], true), "C01");
    let start: Vec<f64> = b.start.as_ref().unwrap().split(' ').map(|x| x.parse().unwrap()).collect();
    assert_eq!(start, [0.1, -1e-7, 1.0 / 3.0]);
    let two = sample_read(FmiVersion::V2);
    for (i, start) in start.into_iter().enumerate() {
        let at = two.variables.iter().position(|v| v.name == format!("filter.b[{}]", i + 1)).unwrap();
        assert_eq!(at, 3 + i, "V01: elements are contiguous");
        assert_eq!(usize::try_from(two.variables[at].value_reference), Ok(4 + i));
        assert_eq!(two.variables[at].start.as_ref().unwrap().parse(), Ok(start));
    }
}

#[test]
fn units_and_types() {
    for version in VERSIONS {
        let md = sample_read(version);
        let names: Vec<_> = md.units.iter().map(|u| u.name.as_str()).collect();
        // Only time is in seconds.
        let seconds: &[&str] = if version == FmiVersion::V3 { &["s"] } else { &[] };
        assert_eq!(names, [seconds, &["V", "rad/s", "%"]].concat(), "V09: used ones only, each once");
        let base = |name: &str| md.unit(name).unwrap().base.unwrap();
        assert_eq!(
            (base("V").exponents, base("V").factor.to_bits()),
            ([1, 2, -3, -1, 0, 0, 0, 0], 1f64.to_bits()),
            "V09"
        );
        assert_eq!(base("rad/s").exponents, [0, 0, -1, 0, 0, 0, 0, 1], "V09");
        assert_eq!((base("%").exponents, base("%").factor.to_bits()), ([0; 8], 0.01f64.to_bits()), "V09");
        let speed = md.variable("speed").unwrap();
        assert_eq!((speed.unit.as_deref(), speed.display_unit.as_deref()), (Some("rad/s"), Some("rpm")), "V09");
        let rpm = md.unit("rad/s").unwrap().display_unit("rpm").unwrap();
        assert!((rpm.show(std::f64::consts::TAU) - 60.0).abs() < 1e-12, "V09: display = factor * unit");
        assert_eq!(md.variable("bandwidth").unwrap().display_unit, None);
        assert_eq!(md.variable("filter.b").or(md.variable("filter.b[1]")).unwrap().unit, None);
        for v in &md.variables {
            let Some(name) = &v.declared_type else { continue };
            let declared = md.type_definition(name).unwrap();
            assert_eq!(declared.base, v.base, "V08");
            assert_eq!((&declared.unit, &declared.display_unit), (&v.unit, &v.display_unit));
            assert!(md.variable(name).is_none(), "V08: a type named like a variable");
        }
        let observer = md.type_definition("Observer").unwrap();
        assert_eq!(observer.description.as_deref(), Some("What estimates the <speed>"));
        let items: Vec<_> = observer.items.iter().map(|i| (i.value, i.name.as_str())).collect();
        assert_eq!(items, [(1, "Simple"), (3, "Good")], "V08");
    }
}

#[test]
fn structure() {
    for version in VERSIONS {
        let md = sample_read(version);
        let name = |&reference: &u32| md.referenced(reference).unwrap().name.as_str();
        let names = |unknowns: &[Unknown]| unknowns.iter().map(|u| name(&u.reference).to_owned()).collect::<Vec<_>>();
        assert_eq!(names(&md.outputs), ["speed", "sector", "ready"], "S01");
        assert!(md.outputs.iter().all(|u| u.dependencies == Some(vec![]) && u.kinds.is_none()), "S04");
        assert_eq!(names(&md.initial_unknowns), ["gain", "speed", "sector", "ready"], "S02");
        assert!(md.initial_unknowns.is_sorted_by_key(|u| u.reference), "S02");
        let dependencies: Vec<Vec<_>> = md
            .initial_unknowns
            .iter()
            .map(|u| {
                let of = u.dependencies.as_ref().unwrap();
                assert!(of.is_sorted_by(|a, b| a < b), "S03");
                assert_eq!(u.kinds, None, "S03");
                of.iter().map(name).collect()
            })
            .collect();
        // FMI 2.0 has no variable for time, so no unknown can name it.
        let (gain, sector) = match version {
            FmiVersion::V2 => (vec!["motor.n_p", "filter.b[1]", "filter.b[3]"], vec!["bandwidth"]),
            FmiVersion::V3 => (vec!["motor.n_p", "filter.b"], vec!["time", "bandwidth"]),
        };
        assert_eq!(dependencies, [gain, vec![], sector, vec!["enable"]], "S03");
    }
}

#[test]
fn an_array_output_stands_once_in_fmi3_and_by_elements_in_fmi2() {
    let mut three = sample();
    let speed = three.variables.iter_mut().find(|v| v.name == "speed").unwrap();
    (speed.shape, speed.value_reference) = (vec![3], 100);
    for (version, count) in [(FmiVersion::V2, 3), (FmiVersion::V3, 1)] {
        let md = read(write(&three, version, &generation())).unwrap();
        let of_speed = |unknowns: &[Unknown]| {
            let name = |u: &Unknown| md.referenced(u.reference).unwrap().name.clone();
            unknowns.iter().filter(|u| name(u).starts_with("speed")).count()
        };
        assert_eq!((of_speed(&md.outputs), md.outputs.len()), (count, count + 2), "S01");
        assert_eq!((of_speed(&md.initial_unknowns), md.initial_unknowns.len()), (count, count + 3), "S02");
    }
}

/// FMI 2.0 has integers of 32 bits; FMI 3.0 has each type, and a matrix with two extents.
#[test]
fn wide_integers_and_matrices() {
    let mut d = sample();
    let n = d.variables.iter_mut().find(|v| v.name == "motor.n_p").unwrap();
    n.kind = VariableKind::Integer(IntegerType::UInt64);
    (n.start, n.min, n.max) = (Some(vec![Value::Integer(u64::MAX.into())]), None, Some(1e19));
    let b = d.variables.iter_mut().find(|v| v.name == "filter.b").unwrap();
    (b.shape, b.start) = (vec![1, 3], Some([0.0, 1.0, 2.0].map(Value::Real).to_vec()));
    let refusal = fits(&d, FmiVersion::V2).unwrap_err();
    assert!(refusal.starts_with("motor.n_p starts with 18446744073709551615, which does not fit"), "{refusal}");
    assert_eq!(fits(&d, FmiVersion::V3), Ok(()));
    let three = write(&d, FmiVersion::V3, &generation());
    assert!(three.contains(r#"max="10000000000000000000" start="18446744073709551615""#), "{three}");
    let (two, three) = (read(write(&d, FmiVersion::V2, &generation())).unwrap(), read(three).unwrap());
    assert_eq!(three.variable("motor.n_p").unwrap().base, BaseType::UInt64);
    assert_eq!(three.variable("filter.b").unwrap().dimensions, [Dimension::Fixed(1), Dimension::Fixed(3)]);
    assert_eq!(two.variable("filter.b[1,3]").unwrap().start.as_deref(), Some("2"));
}

#[test]
fn what_only_fmi_3_has_comes_back() {
    let rare = rare_sample();
    let refusal = fits(&rare, FmiVersion::V2).unwrap_err();
    assert_eq!(refusal, "frame is binary, and FMI 2.0 has no bytes: build for FMI 3.0 only");
    let md = read(write(&rare, FmiVersion::V3, &generation())).unwrap();
    let of = |name: &str| md.variable(name).unwrap();
    let clocks: Vec<_> = ["tick", "fixed", "tunable", "changing", "countdown", "triggered"]
        .into_iter()
        .map(|name| of(name).timing.as_ref().unwrap())
        .map(|timing| (timing.ticks, timing.interval, timing.shift.to_bits(), timing.priority))
        .collect();
    let (none, quarter) = (0f64.to_bits(), 0.25f64.to_bits());
    let expected = [
        (IntervalVariability::Constant, Some(0.5), quarter, Some(3)),
        (IntervalVariability::Fixed, Some(0.125), none, None),
        (IntervalVariability::Tunable, Some(0.75), none, None),
        (IntervalVariability::Changing, None, none, None),
        (IntervalVariability::Countdown, None, none, None),
        (IntervalVariability::Triggered, None, none, None),
    ];
    assert_eq!(clocks, expected);
    assert_eq!((of("tick").causality, of("triggered").causality), (Causality::Input, Causality::Output));
    assert_eq!((&of("frame").clocks[..], of("frame").start.as_deref()), (&[15, 16][..], Some("00ff")));
    assert_eq!((of("n").causality, of("n").start.as_deref()), (Causality::StructuralParameter, Some("2")));
    assert_eq!(of("axis").dimensions, [Dimension::Variable(1)]);
    assert_eq!((of("single").base, of("single").start.as_deref()), (BaseType::Float32, Some("0.1")));
    assert_eq!((of("constant").variability, of("constant").initial), (Variability::Constant, Some(Initial::Exact)));
    assert_eq!((of("kept").initial, of("kept").intermediate), (Some(Initial::Exact), true));
    assert_eq!(md.scheduled_execution.unwrap().model_identifier, "Rare");
}

/// In FMI 2.0 a structural parameter is a constant, a text is a String, and the derivative of an array has its elements.
#[test]
fn fmi_2_says_what_it_can() {
    let mut rare = rare_sample();
    rare.variables.retain(|v| !matches!(v.kind, VariableKind::Clock(_) | VariableKind::Binary { .. }));
    (rare.model_exchange, rare.terminals) = (None, Vec::new());
    let md = read(write(&rare, FmiVersion::V2, &generation())).unwrap();
    let of = |name: &str| md.variable(name).unwrap();
    assert_eq!((of("n").causality, of("n").variability), (Causality::Local, Variability::Constant));
    assert_eq!((of("texts[1]").base, of("texts[1]").start.as_deref()), (BaseType::String, Some("a <b>")));
    assert_eq!(of("single").start.as_deref().unwrap().parse(), Ok(f64::from(0.1_f32)));
    assert_eq!((of("kept").causality, of("kept").initial), (Causality::Output, Some(Initial::Exact)));
    assert_eq!(of("table[2]").value_reference, 7);
}

/// FMI 2.0 has an array of variable size as elements: named by its first alone, it is a whole, whose elements are not listed.
#[test]
fn a_dependency_on_a_whole_array_is_not_listed_in_fmi_2() {
    let listed = |elements: usize, references: &[u32]| {
        let mut rare = rare_sample();
        rare.variables.retain(|v| ["n", "table", "kept"].contains(&&*v.name));
        (rare.model_exchange, rare.terminals) = (None, Vec::new());
        for v in &mut rare.variables {
            match &*v.name {
                "table" => (v.shape, v.start) = (vec![elements], Some(vec![Value::Real(1.0); elements])),
                "kept" => (v.exact, v.start, v.initial_dependencies) = (false, None, Some(references.to_vec())),
                _ => {}
            }
        }
        VERSIONS.map(|version| {
            let md = read(write(&rare, version, &generation())).unwrap();
            md.initial_unknowns[0].dependencies.clone()
        })
    };
    // The constant, the elements, and the output by their indices; in FMI 3.0 the value reference of the array.
    assert_eq!(listed(2, &[6]), [None, Some(vec![6])]);
    assert_eq!(listed(2, &[6, 7]), [Some(vec![2, 3]), Some(vec![6])]);
    assert_eq!(listed(1, &[6]), [Some(vec![2]), Some(vec![6])]);
}

#[test]
fn a_model_without_outputs_has_no_empty_list() {
    let bare = Description { variables: Vec::new(), ..sample() };
    for version in VERSIONS {
        let text = write(&bare, version, &generation());
        assert!(text.contains("<ModelStructure/>") && !text.contains("TypeDefinitions"), "X01: {text}");
        let time = usize::from(version == FmiVersion::V3);
        assert_eq!(read(&text).map(|md| md.variables.len()).ok(), Some(time));
    }
    // The schema of FMI 2.0 requires a variable.
    let refusal = fits(&bare, FmiVersion::V2).unwrap_err();
    assert!(refusal.contains(" has no variable, and FMI 2.0 needs at least one"), "{refusal}");
    assert_eq!(fits(&bare, FmiVersion::V3), Ok(()));
}

/// FMI 2.0.5, 2.2.1, 2.2.7 and 2.2.8; FMI 3.0.2, 2.4.7.5 and 2.4.8.
#[test]
fn model_exchange() {
    for version in VERSIONS {
        let text = write(&exchange_sample(), version, &generation());
        let md = read(&text).unwrap();
        assert_eq!(md.model_exchange.as_ref().map(|i| i.model_identifier.as_str()), Some("Exchange"));
        assert!(text.find("<ModelExchange").unwrap() < text.find("<CoSimulation").unwrap(), "the order of the schemas");
        let two = version == FmiVersion::V2;
        assert_eq!(text.contains("numberOfEventIndicators=\"1\""), two);
        assert_eq!(text.contains("name=\"edge\""), !two);
        assert_eq!(text.matches("<EventIndicator valueReference=\"17\"/>").count(), usize::from(!two));
        let name = |&reference: &u32| md.referenced(reference).unwrap().name.as_str();
        let unknowns = |list: &[Unknown]| -> Vec<(String, Vec<String>)> {
            let of = |u: &Unknown| u.dependencies.iter().flatten().map(|r| name(r).to_owned()).collect();
            list.iter().map(|u| (name(&u.reference).to_owned(), of(u))).collect()
        };
        let named = |name: &str, of: &[&str]| (name.to_owned(), of.iter().map(ToString::to_string).collect::<Vec<_>>());
        // The order of the states, not that of the variables; an output that is a state depends on itself.
        let states = [named("der(inner)", &["u_dc", "speed", "inner"]), named("der(speed)", &[])];
        assert_eq!(unknowns(&md.derivatives), states, "S01");
        let sector: &[&str] = if two { &["enable", "inner"] } else { &["time", "enable", "bandwidth", "inner"] };
        let outputs = [named("speed", &["speed"]), named("sector", sector), named("ready", &[])];
        assert_eq!(unknowns(&md.outputs), outputs, "S01");
        let initial: Vec<_> = unknowns(&md.initial_unknowns).into_iter().map(|(name, _)| name).collect();
        assert_eq!(initial, ["gain", "speed", "sector", "ready", "inner", "der(inner)", "der(speed)"], "S02");
        assert!(md.initial_unknowns.is_sorted_by(|a, b| a.reference < b.reference), "S02: sorted, each once");
        for (derivative, state) in [("der(inner)", "inner"), ("der(speed)", "speed")] {
            let v = md.variable(derivative).unwrap();
            assert_eq!((v.causality, v.initial, &v.start), (Causality::Local, Some(Initial::Calculated), &None));
            // An index in FMI 2.0, a value reference in FMI 3.0.
            let position = md.variables.iter().position(|v| v.name == state).unwrap() + 1;
            let reference = md.variable(state).unwrap().value_reference;
            assert_eq!(v.derivative, Some(if two { u32::try_from(position).unwrap() } else { reference }));
        }
        assert_eq!(text.matches("reinit=\"true\"").count(), 1);
        let cs = md.co_simulation.unwrap();
        assert!(!cs.has_event_mode());
        assert_eq!(cs.attribute("maxOutputDerivativeOrder"), Some("1"));
        assert_eq!(cs.attribute("canInterpolateInputs"), two.then_some("true"));
        let flag =
            if two { "providesDirectionalDerivative=\"true\"" } else { "providesDirectionalDerivatives=\"true\"" };
        assert_eq!(text.matches(flag).count(), 2, "in both interfaces");
        assert_eq!(text.matches("providesAdjointDerivatives=\"true\"").count(), if two { 0 } else { 2 });
    }
}

/// Time events only: Event Mode and early return in FMI 3.0, no derivatives.
#[test]
fn a_sampled_model() {
    for version in VERSIONS {
        let text = write(&sampled_sample(), version, &generation());
        let md = read(&text).unwrap();
        let (two, cs) = (version == FmiVersion::V2, md.co_simulation.unwrap());
        assert_eq!((cs.has_event_mode(), cs.flag("mightReturnEarlyFromDoStep")), (!two, !two));
        assert!(md.derivatives.is_empty() && !text.contains("Derivative"), "{text}");
        assert_eq!(text.contains("numberOfEventIndicators=\"0\""), two);
        assert!(md.outputs.iter().all(|u| u.dependencies == Some(vec![])));
        assert_eq!(cs.attribute("canInterpolateInputs"), two.then_some("false"));
    }
}
