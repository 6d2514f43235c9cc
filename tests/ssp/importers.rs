//! Support of the files in other importers, and files written by them.

use super::*;

/// Features that some importers refuse are written only on demand, and the file contains the stepping method for OMSimulator.
#[test]
fn what_not_every_importer_takes_is_an_option() {
    let folder = folder();
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let motor = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/ipmsm-2.2kw.toml");
    packed(&["--motor", motor, "--names", "--gates", "--geometry", "--out", &path("all.ssp")]);
    let (plain, all) = (ssp("motor.ssp"), ssp("all.ssp"));
    let structure = |path: &str| entry(path, "SystemStructure.ssd");
    for part in ["<ssd:SystemGeometry ", "startConnector=\"enabled\" endElement=\"plant\" endConnector=\"enable\""] {
        assert!(!structure(&plain).contains(part) && structure(&all).contains(part), "{part}");
    }
    let master = "<oms:FixedStepMaster description=\"oms-ma\" stepSize=\"0.0001\" relativeTolerance=\"0.0001\"/>";
    let python = "<oms:SimulationInformation name=\"oms_ma_default\" method=\"oms_ma\" fixedStepSize=\"0.0001\">";
    assert!(structure(&plain).contains("<ssc:Annotation type=\"org.openmodelica\">"));
    assert!(structure(&plain).contains(python));
    assert!(structure(&plain).contains(master), "the step is T_s");
    let values = |path: &str| entry(path, "resources/controller.ssv");
    assert!(values(&all).contains("<ssv:Parameter name=\"estimator\"><ssv:Enumeration value=\"ExtendedEmf\"/>"));
    assert!(values(&plain).contains("<ssv:Parameter name=\"estimator\"><ssv:Integer value=\"4\"/>"));
    packed(&["--motor", motor, "--integers", "--out", &path("integers.ssp")]);
    assert!(values(&path("integers.ssp")) == values(&plain), "the default");
    // None of this changes the results.
    let run = |path: &str| {
        let time = ["--input", "speed_ref=0:0,0.02:52.36", "--stop", "0.3", "--csv", "-"];
        done(&[&["simulate", path][..], &time].concat())
    };
    assert!(run(&plain) == run(&all));
    let slower = std::fs::read_to_string(motor).unwrap().replace("[control]\n", "[control]\nT_s = 2e-4\n");
    let slower = if slower.contains("T_s") { slower } else { slower + "\n[control]\nT_s = 2e-4\n" };
    std::fs::write(folder.join("slower.toml"), slower).unwrap();
    packed(&["--motor", &path("slower.toml"), "--out", &path("slower.ssp")]);
    assert!(structure(&ssp("slower.ssp")).contains("stepSize=\"0.0002\""));
}

/// The input that OMSimulator accepts, from its sources: it stops at any other element, at a name that is not an identifier and
/// at a connector without a type, and it ignores a value whose type differs from the variable's.
#[test]
fn omsimulator_runs_it_as_it_is() {
    let folder = folder();
    let tuned = folder.join("tuned");
    let motor = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/ipmsm-2.2kw.toml");
    done(&["tune", motor, "--out", tuned.to_str().unwrap()]);
    let of = |component: &str, fmu: &str| format!("{component}={}/ipmsm-2.2kw.{fmu}.ssv", tuned.display());
    let given = [of("plant", "PmsmPlant"), of("controller", "SensorlessController")];
    let (bound, geometry) = (folder.join("bound.ssp"), folder.join("geometry.ssp"));
    packed(&["--parameters", &given[0], "--parameters", &given[1], "--out", bound.to_str().unwrap()]);
    packed(&["--geometry", "--out", geometry.to_str().unwrap()]);
    for name in ["fmi2.ssp", "fmi3.ssp", "motor.ssp", "bound.ssp"] {
        assert_eq!(refusals(&ssp(name)), Vec::<String>::new(), "{name}");
    }
    assert_eq!(refusals(&ssp("geometry.ssp")), ["System.cpp: ssd:SystemGeometry in ssd:System"]);
    // The values of a motor are the same by every route.
    for component in ["plant", "controller"] {
        let file = format!("resources/{component}.ssv");
        assert!(entry(&ssp("motor.ssp"), &file) == entry(&ssp("bound.ssp"), &file), "{component}");
    }
    // Each name that OMSimulator refuses is found.
    for (old, new, expected) in [
        (
            "name=\"tau_load\" kind=\"input\"",
            "name=\"tau.load\" kind=\"input\"",
            "ComRef.cpp: tau.load is not an identifier",
        ),
        ("<ssc:Boolean/>", "", "Connector.cpp: voltage_limited has no type"),
        ("oms-ma", "oms-mav", "SystemWC.cpp: the master oms-mav"),
    ] {
        let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", old, new);
        assert!(refusals(&path).iter().any(|found| found == expected), "{expected}: {:?}", refusals(&path));
    }
    let (old, new) = ("<ssv:Integer value=\"4\"/>", "<ssv:Enumeration value=\"ExtendedEmf\"/>");
    let (_dir, path) = changed(&ssp("motor.ssp"), "resources/controller.ssv", old, new);
    assert_eq!(refusals(&path), ["Values.cpp: controller.estimator is ssv:Enumeration, not ssv:Integer"]);
}

/// Parts of an SSP that OMSimulator refuses or ignores, with the source file.
fn refusals(path: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut refuse = |file: &str, what: String| found.push(format!("{file}: {what}"));
    let root = Element::parse(&entry(path, "SystemStructure.ssd")).unwrap();
    let mut only = |file: &str, parent: &Element, names: &[&str]| {
        for child in parent.children.iter().filter(|child| !names.contains(&child.name.as_str())) {
            refuse(file, format!("{} in {}", child.name, parent.name));
        }
    };
    let (system, experiment) = (root.child("ssd:System").unwrap(), root.child("ssd:DefaultExperiment").unwrap());
    let element = ["ssd:Connectors", "ssd:ElementGeometry", "ssd:ParameterBindings"];
    only("Model.cpp", &root, &["ssd:System", "ssd:Units", "ssd:Enumerations", "ssd:DefaultExperiment"]);
    only("System.cpp", system, &[&element[..], &["ssd:Elements", "ssd:Connections", "ssd:Annotations"]].concat());
    let components: Vec<&Element> = system.child("ssd:Elements").unwrap().all("ssd:Component").collect();
    for component in &components {
        only("ComponentFMUCS.cpp", component, &element);
    }
    let is_identifier = |name: &str| {
        name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
    };
    let mut base = BTreeMap::new();
    for owner in components.iter().copied().chain([system]) {
        let owned = owner.get("name").unwrap();
        let connectors: Vec<&Element> = owner.child("ssd:Connectors").unwrap().children.iter().collect();
        let names = connectors.iter().map(|c| c.get("name").unwrap()).chain([owned]);
        for name in names.filter(|name| !is_identifier(name)) {
            refuse("ComRef.cpp", format!("{name} is not an identifier"));
        }
        for connector in connectors {
            let name = connector.get("name").unwrap();
            assert!(["input", "output"].contains(&connector.get("kind").unwrap()), "{name}");
            if !["ssc:Real", "ssc:Integer", "ssc:Boolean"].iter().any(|base| connector.child(base).is_some()) {
                refuse("Connector.cpp", format!("{name} has no type"));
            }
        }
        for binding in owner.child("ssd:ParameterBindings").into_iter().flat_map(|all| &all.children) {
            assert!(binding.attributes.iter().all(|(name, _)| name == "source"), "Values.cpp has no prefix");
            let values = Element::parse(&entry(path, binding.get("source").unwrap())).unwrap();
            for parameter in &values.child("ssv:Parameters").unwrap().children {
                let port = format!("{owned}.{}", parameter.get("name").unwrap());
                assert!(base.insert(port, parameter.children[0].name.clone()).is_none());
            }
        }
        if let Some(source) = owner.get("source") {
            let description = component_description(path, source);
            for v in &description.variables {
                let expected = match v.base {
                    BaseType::Float64 => "ssv:Real",
                    BaseType::Boolean => "ssv:Boolean",
                    _ => "ssv:Integer",
                };
                let port = format!("{owned}.{}", v.name);
                if let Some(given) = base.get(&port).filter(|given| *given != expected) {
                    refuse("Values.cpp", format!("{port} is {given}, not {expected}"));
                }
            }
        }
    }
    // Both annotations are present, one with its type and one with its element.
    let own = |parent: &'_ Element| {
        let annotation = parent.child("ssd:Annotations")?.child("ssc:Annotation")?.clone();
        let is_own = annotation.get("type") == Some("org.openmodelica");
        annotation.child("oms:Annotations")?.child("oms:SimulationInformation").filter(|_| is_own).cloned()
    };
    if own(experiment).is_none() {
        refuse("Model.cpp", "deprecated content".into());
    }
    let master = own(system).unwrap().child("oms:FixedStepMaster").unwrap().get("description").unwrap().to_owned();
    if master != "oms-ma" {
        refuse("SystemWC.cpp", format!("the master {master}"));
    }
    found
}

/// SSPs of other tools: a connection has no direction, a prefix is added to names, and the times of the system override those of
/// its parts.
#[test]
fn what_other_tools_write_runs_too() {
    let run = |path: &str, stop: &[&str]| {
        let arguments = ["simulate", path, "--input", "speed_ref=0:0,0.01:50", "--csv", "-"];
        done(&[&arguments[..], stop].concat())
    };
    let (structure, until) = ("SystemStructure.ssd", ["--stop", "0.05"]);
    let expected = run(&ssp("motor.ssp"), &until);
    let (_dir, turned) = changed(
        &ssp("motor.ssp"),
        structure,
        "startElement=\"controller\" startConnector=\"u_a\" endElement=\"plant\"",
        "startElement=\"plant\" startConnector=\"u_a\" endElement=\"controller\"",
    );
    assert!(run(&turned, &until) == expected, "a connection from its input to its output");
    // The plant's values are bound to the system, with the plant's name before theirs.
    let inner = "<ssd:ParameterBinding source=\"resources/plant.ssv\"/>";
    let outer = "<ssd:ParameterBinding source=\"resources/SensorlessDrive.ssv\"/>";
    let both = format!("{outer}{}", inner.replace(" source=", " prefix=\"plant.\" source="));
    let (_dir, without) = changed(&ssp("motor.ssp"), structure, inner, &outer.replace("SensorlessDrive", "none"));
    let (_dir_too, prefixed) = changed(&without, structure, outer, &both);
    let none = "<ssd:ParameterBinding source=\"resources/none.ssv\"/>";
    let (_dir_three, prefixed) = changed(&prefixed, structure, none, "");
    assert!(run(&prefixed, &until) == expected, "values with a prefix");
    let (_dir, late) =
        changed(&ssp("motor.ssp"), structure, "startTime=\"0\" stopTime=\"1\"", "startTime=\"0.5\" stopTime=\"0.7\"");
    let csv = run(&late, &[]);
    let times: Vec<&str> = csv.lines().skip(1).map(|line| line.split(',').next().unwrap()).collect();
    assert_eq!((times[0], times[times.len() - 1]), ("0.5", "0.7"));
}
