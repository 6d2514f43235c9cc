//! What a description says of an FMU, and what the importer does with it.

use crate::workshop::{Workshop, array};
use fmu_import::{Fmu, Number};
use fmu_system::cosimulation::{Integration, Method, Outlet, Schedule, Settings, System, Units};
use fmu_system::ssp::load::Loaded;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

/// The last values of variables after 1 s in steps of 0.1 s.
fn last(fmu: &Fmu, method: Method, set: &[(&str, &str)], variables: &[&str]) -> Vec<f64> {
    let mut system = System::new(method);
    system.add("p", fmu, false).unwrap();
    for (name, value) in set {
        system.set(name, value).unwrap();
    }
    for name in variables {
        system.record(name).unwrap();
    }
    let settings = Settings { start: 0.0, stop: 1.0, step: 0.1, sequential: false };
    let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    recording.columns.iter().map(|column| *column.values.last().unwrap()).collect()
}

/// canRunAsynchronuously: the state is read when the step is over, which takes three more questions each.
#[test]
fn a_step_that_is_pending_is_awaited() {
    let xml = |xml: String| xml.replace("<CoSimulation ", "<CoSimulation canRunAsynchronuously='true' ");
    let workshop = Workshop::new();
    let fmu = workshop.fmu("plant", 2, &["-DASYNCHRONOUS"], xml);
    let found = last(&fmu, Method::default(), &[], &["x", "y"]);
    assert!((found[0] - f64::exp(-1.0)).abs() < 1e-12, "{found:?}");
    assert_eq!(found[1], -1.0, "not asked until the step was over");
}

/// noSetFMUStatePriorToCurrentPoint is true until a state is saved, and again when it is freed.
#[test]
fn an_fmu_knows_whether_the_importer_may_go_back() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let xml = |xml: String| xml.replace("<CoSimulation ", "<CoSimulation canGetAndSetFMUstate='true' ");
        let xml = |text: String| if version == 2 { xml(text) } else { xml(text).replace("FMUstate", "FMUState") };
        let fmu = workshop.fmu("plant", version, &[], xml);
        assert_eq!(last(&workshop.plain("plant", version), Method::default(), &[], &["prior"]), [1.0]);
        let mut p = fmu.instantiate("p", false).unwrap();
        p.setup(0.0, None).unwrap();
        p.enter_initialization().unwrap();
        p.exit_initialization().unwrap();
        let prior = |t: f64, p: &mut fmu_import::Instance| {
            let _ = p.do_step(t, 0.5).unwrap();
            p.get("prior").unwrap().number().unwrap()
        };
        assert_eq!(prior(0.0, &mut p), 1.0);
        let state = p.get_state().unwrap();
        assert_eq!(prior(0.5, &mut p), 0.0);
        p.free_state(state).unwrap();
        assert_eq!(prior(1.0, &mut p), 1.0);
    }
}

/// completedIntegratorStepNotNeeded, needsCompletedIntegratorStep: the plant counts the calls, with `fault` 7.
#[test]
fn completed_steps_are_told_to_an_fmu_that_needs_them() {
    let workshop = Workshop::new();
    let exchange = || Method::ModelExchange(Integration::default());
    for version in [2, 3] {
        let (need, not) = match version {
            2 => ("", "completedIntegratorStepNotNeeded='true'"),
            _ => ("needsCompletedIntegratorStep='true'", ""),
        };
        let with = |flag: &str| {
            let flag = format!("<ModelExchange {flag} modelIdentifier='x'/>");
            let one = "<ModelExchange modelIdentifier='x' needsCompletedIntegratorStep='true'/>";
            workshop.fmu("plant", version, &[], |xml| {
                xml.replace(one, &flag).replace("<ModelExchange modelIdentifier='x' />", &flag)
            })
        };
        let count = |fmu: &Fmu| last(fmu, exchange(), &[("p.fault", "7")], &["p.count"])[0];
        assert!(count(&with(need)) >= 10.0, "FMI {version}");
        assert_eq!(count(&with(not)), 0.0, "FMI {version}");
    }
}

/// startTime, stopTime and stepSize apply where the user gives none; a start after the default stop keeps the duration.
#[test]
fn the_default_experiment_gives_the_times() {
    let workshop = Workshop::new();
    let times = "<DefaultExperiment startTime='1' stopTime='3' stepSize='0.25' ";
    let archive = workshop.archive("plant", 3, &[], |xml| xml.replace("<DefaultExperiment ", times));
    let loaded = Loaded::open_files(&[archive.to_str().unwrap().to_owned()], Path::new(""), false).unwrap();
    let of = |start, stop, step| {
        let settings = loaded.settings(start, stop, step, false);
        [settings.start, settings.stop, settings.step]
    };
    assert_eq!(of(None, None, None), [1.0, 3.0, 0.25]);
    assert_eq!(of(Some(2.0), None, None), [2.0, 3.0, 0.25]);
    assert_eq!(of(Some(5.0), None, None), [5.0, 7.0, 0.25]);
    assert_eq!(of(None, Some(1.5), Some(0.1)), [1.0, 1.5, 0.1]);
    let plain = workshop.archive("plant", 3, &[], |xml| xml);
    let loaded = Loaded::open_files(&[plain.to_str().unwrap().to_owned()], Path::new(""), false).unwrap();
    let settings = loaded.settings(None, None, None, false);
    assert_eq!([settings.start, settings.stop, settings.step], [0.0, 1.0, 1e-3]);
}

/// maxOutputDerivativeOrder, canInterpolateInputs, providesIntermediateUpdate: an input keeps its value over a step.
#[test]
fn inputs_hold_over_a_step() {
    let workshop = Workshop::new();
    for (version, flags) in [
        (2, "maxOutputDerivativeOrder='1' canInterpolateInputs='true'"),
        (
            3,
            "maxOutputDerivativeOrder='1' recommendedIntermediateInputSmoothness='1' providesIntermediateUpdate='true'",
        ),
    ] {
        let xml = |xml: String| xml.replace("<CoSimulation ", &format!("<CoSimulation {flags} "));
        let mut system = System::default();
        system.add("p", &workshop.fmu("plant", version, &[], xml), false).unwrap();
        system.input("p.u", Schedule::parse("0:0~1:1").unwrap()).unwrap();
        system.record("p.x").unwrap();
        let settings = Settings { start: 0.0, stop: 1.0, step: 0.1, sequential: false };
        let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
        let held = (0..10).fold(1.0, |x, k| {
            let u = f64::from(k) * 0.1;
            u + (x - u) * f64::exp(-0.1)
        });
        let x = recording.columns[0].values[10];
        assert!((x - held).abs() < 1e-12, "FMI {version}: {x}, expected {held}");
    }
}

/// An alias of FMI 3.0 is a name like others; other versions of FMI are refused with their number.
#[test]
fn aliases_are_names_and_other_versions_are_refused() {
    let workshop = Workshop::new();
    let xml = |xml: String| {
        let x = "<Float64 name='x' valueReference='2' causality='output' variability='continuous'  ";
        assert!(xml.contains(x), "{xml}");
        xml.replace(&format!("{x}/>"), &format!("{x}><Alias name='position'/></Float64>"))
    };
    let fmu = workshop.fmu("plant", 3, &[], xml);
    let found = last(&fmu, Method::default(), &[], &["p.position", "x"]);
    assert_eq!(found[0].to_bits(), found[1].to_bits());
    for version in ["1.0", "4.0"] {
        let old = workshop
            .archive("plant", 3, &[], |xml| xml.replace("fmiVersion='3.0'", &format!("fmiVersion='{version}'")));
        let error = Fmu::open(old).err().unwrap().to_string();
        assert!(error.contains(version), "{error}");
    }
}

/// canBeInstantiatedOnlyOncePerProcess, of the interface that the run uses: a sweep then has one thread.
#[test]
fn an_fmu_of_one_instance_in_a_process_is_named() {
    let workshop = Workshop::new();
    let once = workshop.fmu("plant", 3, &[], |xml| {
        xml.replace("<CoSimulation ", "<CoSimulation canBeInstantiatedOnlyOncePerProcess='true' ")
    });
    let named = |method, fmus: &[(&str, &Fmu)]| {
        let mut system = System::new(method);
        for (name, fmu) in fmus {
            system.add(name, fmu, false).unwrap();
        }
        let plan = system.into_plan(&Settings { start: 0.0, stop: 1.0, step: 0.1, sequential: false }).unwrap();
        plan.only_one_instance().map(str::to_owned)
    };
    let plain = workshop.plain("plant", 3);
    assert_eq!(named(Method::default(), &[("a", &plain)]), None);
    assert_eq!(named(Method::default(), &[("a", &plain), ("b", &once)]).as_deref(), Some("b"));
    assert_eq!(named(Method::ModelExchange(Integration::default()), &[("b", &once)]), None);
}

#[test]
fn the_numeric_outputs_of_all_instances_have_their_names() {
    let workshop = Workshop::new();
    let plant = workshop.fmu("plant", 3, &[], |xml| array(&array(&xml, "i"), "y"));
    let sampler = workshop.plain("sampler", 3);
    let mut system = System::default();
    system.add("a", &plant, false).unwrap();
    system.add("b", &sampler, false).unwrap();
    let outputs = system.outputs();
    assert_eq!(["a.y", "b.y"].map(|name| outputs.iter().any(|output| output == name)), [false, true], "an array");
    assert!(["a.x", "b.x"].iter().all(|name| outputs.iter().any(|output| output == name)), "{outputs:?}");
    assert!(!outputs.iter().any(|output| ["a.u", "b.u"].contains(&output.as_str())), "{outputs:?}");
    assert!(!system.is_size("a.u").unwrap(), "an input is no size");
    let error = system.configure([("a.u", "2")]).unwrap_err().to_string();
    assert_eq!(error, "a.u: is not a structural parameter");
}

/// z = 1 - 2 u in m feeds u in km, converted or as it is.
#[test]
fn a_connection_converts_units_where_the_system_does() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let unit = |xml: String, name: &str, unit: &str| match version {
            2 => {
                let at = xml.find(&format!("<ScalarVariable name='{name}'")).unwrap();
                format!("{}{}", &xml[..at], xml[at..].replacen("<Real ", &format!("<Real unit='{unit}' "), 1))
            }
            _ => xml.replace(&format!("<Float64 name='{name}'"), &format!("<Float64 unit='{unit}' name='{name}'")),
        };
        let fmu = workshop.fmu("plant", version, &[], |xml| {
            let units = "<UnitDefinitions><Unit name='m'><BaseUnit m='1'/></Unit><Unit name='km'>\
                <BaseUnit m='1' factor='1000'/></Unit></UnitDefinitions><DefaultExperiment ";
            unit(unit(xml, "z", "m"), "u", "km").replace("<DefaultExperiment ", units)
        });
        for (units, expected) in [(Units::Convert, 1e-3), (Units::PassOn, 1.0)] {
            let mut system = System::default().with_units(units);
            system.add("a", &fmu, false).unwrap();
            system.add("b", &fmu, false).unwrap();
            system.connect("a.z", "b.u").unwrap();
            system.record("b.u").unwrap();
            let settings = Settings { start: 0.0, stop: 0.2, step: 0.1, sequential: false };
            let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
            let u = recording.columns[0].values[1];
            assert!((u - expected).abs() < 1e-15, "FMI {version}, {units:?}: {u}");
        }
    }
}

/// Terminals connect their members from output to input, whichever is written first.
#[test]
fn terminals_connect_their_members() {
    let terminal = |name: &str, variable: &str| {
        format!(
            "<Terminal name='{name}' matchingRule='plug'><TerminalMemberVariable variableName='{variable}' memberName='v' \
             variableKind='signal'/></Terminal>"
        )
    };
    let file = format!(
        "<fmiTerminalsAndIcons fmiVersion='3.0'><Terminals>{}{}</Terminals></fmiTerminalsAndIcons>",
        terminal("out", "z"),
        terminal("in", "u")
    );
    let workshop = Workshop::new();
    let fmu = workshop.fmu_with("plant", &[("terminalsAndIcons/terminalsAndIcons.xml", &file)]);
    for pair in [["a.out", "b.in"], ["b.in", "a.out"]] {
        let mut system = System::default();
        system.add("a", &fmu, false).unwrap();
        system.add("b", &fmu, false).unwrap();
        let made = system.connect_terminals(pair[0], pair[1]).unwrap();
        assert_eq!(made, [("a.z".to_owned(), "b.u".to_owned())]);
        assert!(system.is_fed("b.u").unwrap() && !system.is_fed("a.u").unwrap());
        let error = system.connect_terminals("a.in", "b.in").unwrap_err().to_string();
        assert!(error.contains("member v is input a.u here and input b.u there"), "{error}");
    }
}

/// An input that is set, or fed, is not untouched.
#[test]
fn inputs_that_nobody_sets_are_untouched() {
    let workshop = Workshop::new();
    let mut system = System::default();
    system.add("p", &workshop.plain("plant", 3), false).unwrap();
    let names = |system: &System| system.untouched(0).iter().map(|v| v.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&system), ["u", "i"]);
    system.set("p.u", "1").unwrap();
    assert_eq!(names(&system), ["i"]);
    system.input("p.i", Schedule::parse("0:1").unwrap()).unwrap();
    assert_eq!(names(&system), [""; 0]);
}

/// A unit that is stated of a recorded variable replaces its own, with the display unit.
#[test]
fn a_stated_unit_replaces_the_display_unit() {
    let workshop = Workshop::new();
    let fmu = workshop.fmu("plant", 3, &[], |xml| {
        let units = "<UnitDefinitions><Unit name='m'><BaseUnit m='1'/><DisplayUnit name='mm' factor='1000'/></Unit></UnitDefinitions>\
            <DefaultExperiment ";
        let x = "<Float64 unit='m' displayUnit='mm' name='x'";
        xml.replace("<Float64 name='x'", x).replace("<DefaultExperiment ", units)
    });
    let mut system = System::default();
    system.add("p", &fmu, false).unwrap();
    for unit in [None, Some("m"), Some("pu")] {
        let (port, name, unit) = ("p.x".to_owned(), format!("{unit:?}"), unit.map(str::to_owned));
        system.record_through(&Outlet { port, name, unit, ..Outlet::default() }).unwrap();
    }
    let settings = Settings { start: 0.0, stop: 0.2, step: 0.1, sequential: false };
    let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    let shown = recording.columns.iter().map(|c| (c.unit.as_str(), c.display.as_ref().map(|d| d.name.as_str())));
    assert_eq!(shown.collect::<Vec<_>>(), [("m", Some("mm")), ("m", Some("mm")), ("pu", None)]);
}

/// A plan with its copy runs both, and a target of the copy changes the copy alone.
#[test]
fn a_plan_runs_beside_its_copy() {
    let workshop = Workshop::new();
    let mut system = System::default();
    for name in ["a", "b"] {
        system.add(name, &workshop.plain("plant", 3), false).unwrap();
    }
    system.connect("a.z", "b.u").unwrap();
    system.set("a.u", "1").unwrap();
    system.record("b.x").unwrap();
    let plan = system.into_plan(&Settings { start: 0.0, stop: 1.0, step: 0.1, sequential: false }).unwrap();
    let target = plan.target("a.u").unwrap();
    let (copy, both) = (plan.in_copy(&target), Arc::new(plan.with_copy()));
    let recording = both.worker().unwrap().record([(&copy, Number::Real(2.0))]).unwrap();
    // b.u = 1 - 2 a.u, and b.x goes towards it from 1.
    let expected = [1.0, 2.0].map(|u| (1.0 - 2.0 * u) + 2.0 * u * f64::exp(-1.0));
    let found = [0, 1].map(|column: usize| *recording.columns[column].values.last().unwrap());
    assert!(found.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-12), "{found:?}, expected {expected:?}");
}
