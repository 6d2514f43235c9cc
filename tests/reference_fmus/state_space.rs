//! A linear system whose sizes the importer chooses.

use super::{BOTH, archive, exchange, open, run, script};
use fmu_import::{Instance, Kind, Values};
use fmu_system::cosimulation::{Method, Recording, Schedule, Settings, System};
use fmu_system::ssp::load::Loaded;
use model_description::FmiVersion::{V2, V3};
use model_description::{Causality, Dimension};
use std::io::Write;
use std::ops::ControlFlow;
use std::sync::Arc;

/// The output at every 1000th of the 10000 points: x += s (x + u), y = x + u.
fn expected() -> Vec<[f64; 3]> {
    let (u, mut x, mut rows) = ([1.0, 2.0, 3.0], [0.0; 3], vec![[1.0, 2.0, 3.0]]);
    for k in 1..=10_000 {
        x = std::array::from_fn(|i| x[i] + 1e-3 * (x[i] + u[i]));
        if k % 1000 == 0 {
            rows.push(std::array::from_fn(|i| x[i] + u[i]));
        }
    }
    rows
}

/// The output as columns of texts or of numbers.
fn rows(recording: &Recording) -> Vec<Vec<f64>> {
    if let Some(column) = recording.texts.first() {
        return column.values.iter().map(|row| row.split(' ').map(|x| x.parse().unwrap()).collect()).collect();
    }
    let columns: Vec<_> = recording.columns.iter().map(|c| &c.values).collect();
    (0..recording.time.len()).map(|k| columns.iter().map(|c| c[k]).collect()).collect()
}

fn reals(values: &[f64]) -> Values {
    Values::Reals(values.to_vec())
}

fn size(n: u32) -> Values {
    Values::Integers(vec![n.into()])
}

#[test]
fn its_description_names_the_sizes() {
    let fmu = open("state-space");
    let md = fmu.description();
    let named = |name: &str| md.variable(name).unwrap();
    assert_eq!(named("n").causality, Causality::StructuralParameter);
    let (m, n, r) = (named("m").value_reference, named("n").value_reference, named("r").value_reference);
    for (name, sizes) in [("A", vec![n, n]), ("B", vec![n, m]), ("D", vec![r, m]), ("x", vec![n]), ("der(x)", vec![n])]
    {
        let dimensions: Vec<_> = sizes.into_iter().map(Dimension::Variable).collect();
        assert_eq!(named(name).dimensions, dimensions, "{name}");
    }
    assert_eq!(named("A").start.as_deref(), Some("1 0 0 0 1 0 0 0 1"));
    assert_eq!((md.derivatives.len(), md.states()[0].name.as_str()), (1, "x"));
}

#[test]
fn has_the_bits_of_the_original() {
    let expected = expected();
    let last = [21_916.681_339_078_466, 43_833.362_678_156_93, 65_750.044_017_235_2];
    assert_eq!((expected.len(), expected[10]), (11, last));
    for version in BOTH {
        let recording = run(Method::default(), &archive("state-space", version), &[], 10.0, 1.0);
        assert_eq!(rows(&recording), expected, "{version:?}");
    }
}

#[test]
fn sizes_are_set_before_the_start() {
    let zeros = ["0"; 25].join(" ");
    let set = [("n", "5"), ("m", "1"), ("r", "2"), ("x0", "1 2 0 0 0"), ("u", "0"), ("A", &*zeros)];
    for method in [Method::default(), exchange()] {
        let recording = run(method, &archive("state-space", V3), &set, 1.0, 0.5);
        assert_eq!(rows(&recording), [[1.0, 2.0]; 3]);
    }
}

/// `examples/cs_reconfiguration.c` of the original: no states, and outputs that follow inputs whose number changes.
#[test]
fn sizes_change_while_it_runs() {
    let mut it = open("state-space").instantiate("it", false).unwrap();
    it.configure(&[("m", &size(2)), ("n", &size(0)), ("r", &size(2))]).unwrap();
    assert_eq!(it.get("D").unwrap(), reals(&[1.0, 0.0, 0.0, 1.0]));
    it.set("u", reals(&[0.0, 1.0])).unwrap();
    it.setup(0.0, Some(1.1)).unwrap();
    it.enter_initialization().unwrap();
    it.exit_initialization().unwrap();
    assert_eq!((it.get("y").unwrap(), it.get("x").unwrap()), (reals(&[0.0, 1.0]), reals(&[])));
    let mut inputs = 2;
    for step in 0..=10 {
        let time = f64::from(step) * 0.1;
        if step == 5 {
            it.configure(&[("m", &size(3)), ("r", &size(3))]).unwrap();
            inputs = 3;
        }
        let u: Vec<f64> = (0..inputs).map(|i| time + 0.1 + f64::from(i)).collect();
        it.set("u", reals(&u)).unwrap();
        assert!(it.do_step(time, 0.1).unwrap().is_continue());
        assert_eq!(it.get("y").unwrap(), reals(&u), "step {step}");
    }
}

/// Values that differ from element to element.
fn drawn(n: usize, seed: usize) -> Vec<f64> {
    (0..n).map(|i| f64::from(u8::try_from((7 * i + 3 * seed) % 11).unwrap()) - 5.0).collect()
}

/// The product of a matrix, row by row, and a vector, added up from `start`.
fn product(matrix: &[f64], vector: &[f64], start: &[f64]) -> Vec<f64> {
    let row = |i: usize| &matrix[i * vector.len()..(i + 1) * vector.len()];
    start.iter().enumerate().map(|(i, y)| row(i).iter().zip(vector).fold(*y, |y, (a, x)| y + a * x)).collect()
}

/// Sets matrices and inputs, makes three steps of the solver, and compares with the products of the matrices.
fn compare(it: &mut Instance, time: f64, [m, n, r]: [usize; 3]) {
    let matrices = [("A", n * n), ("B", n * m), ("C", r * n), ("D", r * m), ("u", m)];
    let [a, b, c, d, u] = std::array::from_fn(|seed| {
        let (name, count) = matrices[seed];
        let values = drawn(count, seed);
        it.set(name, reals(&values)).unwrap();
        values
    });
    let Values::Reals(mut x) = it.get("x").unwrap() else { unreachable!() };
    assert!(it.do_step(time, 3e-3).unwrap().is_continue());
    for _ in 0..3 {
        let dx = product(&b, &u, &product(&a, &x, &vec![0.0; n]));
        x.iter_mut().zip(dx).for_each(|(x, dx)| *x += 1e-3 * dx);
    }
    let y = product(&d, &u, &product(&c, &x, &vec![0.0; r]));
    assert_eq!((it.get("x").unwrap(), it.get("y").unwrap()), (reals(&x), reals(&y)), "{m} {n} {r}");
}

/// Every number of inputs, states and outputs, before the start and while it runs.
#[test]
fn every_size_gives_the_products_of_its_matrices() {
    let fmu = open("state-space");
    let begin = |it: &mut Instance| {
        it.setup(0.0, None).unwrap();
        it.enter_initialization().unwrap();
        it.exit_initialization().unwrap();
    };
    let mut running = fmu.instantiate("running", false).unwrap();
    begin(&mut running);
    let mut time = 0.0;
    let all = (0..6_u32).flat_map(|m| (0..6).flat_map(move |n| (0..6).map(move |r| [m, n, r])));
    for [m, n, r] in all {
        let (given, counts) = ([("m", &size(m)), ("n", &size(n)), ("r", &size(r))], [m, n, r].map(|n| n as usize));
        let mut it = fmu.instantiate("it", false).unwrap();
        it.configure(&given).unwrap();
        it.set("x0", reals(&drawn(counts[1], 9))).unwrap();
        begin(&mut it);
        compare(&mut it, 0.0, counts);
        running.configure(&given).unwrap();
        compare(&mut running, time, counts);
        time += 3e-3;
    }
}

/// Sizes are set together, first; elements count with them.
#[test]
fn elements_of_a_resized_array_are_found() {
    let fmu = open("state-space");
    let system = || {
        let mut system = System::default();
        system.add("it", &fmu, false).unwrap();
        system.configure([("it.n", "5"), ("m", "4"), ("r", "5")]).unwrap();
        system
    };
    let mut it = system();
    it.set("x0[5]", "3").unwrap();
    it.set("x0[2]", "7").unwrap();
    it.set("A[4,5]", "0.5").unwrap();
    it.input("u[4]", Schedule::parse("2").unwrap()).unwrap();
    for port in ["x[2]", "x[5]", "y[4]", "D[2,4]"] {
        it.record(port).unwrap();
    }
    for none in ["x0[6]", "B[5,5]", "u[5]"] {
        assert!(it.set(none, "1").is_err() && it.record(none).is_err(), "{none}");
    }
    assert!(it.configure([("x0", "1")]).unwrap_err().to_string().contains("is not a structural parameter"));
    let settings = Settings { start: 0.0, stop: 1e-3, step: 1e-3, sequential: false };
    let recording = it.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    let last: Vec<f64> = recording.columns.iter().map(|column| column.values[1]).collect();
    assert_eq!(last, [7.0 + 1e-3 * (7.0 + 2.0), 3.0 + 1e-3 * 3.0, 1e-3 * (0.5 * 3.0 + 2.0) + 2.0, 0.0]);
    // The sizes of a plan apply to each of its runs.
    let mut it = system();
    it.record("y[5]").unwrap();
    let plan = Arc::new(it.into_plan(&settings).unwrap());
    assert!(plan.target("n").unwrap_err().to_string().contains("has one value in all runs"));
    let mut worker = plan.worker().unwrap();
    for _ in 0..2 {
        assert_eq!(worker.record([]).unwrap().columns[0].values, [0.0, 0.0]);
    }
}

/// Whole arrays travel from FMU to FMU; other extents are refused.
#[test]
fn arrays_are_connected_whole() {
    for version in BOTH {
        let fmu = fmu_import::Fmu::open(archive("state-space", version)).unwrap();
        let mut system = System::default();
        for name in ["a", "b"] {
            system.add(name, &fmu, false).unwrap();
        }
        if version == V2 {
            // FMI 2.0 has no arrays.
            system.connect("a.y[2]", "b.u[2]").unwrap();
        } else {
            let said = system.connect("a.y", "b.u[2]").unwrap_err().to_string();
            let expected =
                "b.u[2]: takes one value, and a.y has 3 elements: name an element of the array, as in a.y[1]";
            assert_eq!(said, expected);
            system.connect("a.y", "b.u").unwrap();
        }
        system.set("a.u[2]", "5").unwrap();
        system.record("b.y[2]").unwrap();
        let settings = Settings { start: 0.0, stop: 1e-3, step: 1e-3, sequential: false };
        let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
        // x = 0 at the start, so y = u: b receives the 5 of a's input at once.
        assert_eq!(recording.columns[0].values[0], 5.0, "{version}");
    }
    let mut system = System::default();
    for name in ["a", "b"] {
        system.add(name, &open("state-space"), false).unwrap();
    }
    system.configure([("b.m", "2")]).unwrap();
    let said = system.connect("a.y", "b.u").unwrap_err().to_string();
    assert_eq!(said, "b.u: takes 2 elements, and a.y has 3 elements");
}

/// A state saved with other sizes restores them.
#[test]
fn a_saved_state_has_its_sizes() {
    let mut it = open("state-space").instantiate("it", false).unwrap();
    it.configure(&[("m", &size(3)), ("n", &size(3)), ("r", &size(3))]).unwrap();
    it.set("x0", reals(&[1.0, 2.0, 4.0])).unwrap();
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
    it.exit_initialization().unwrap();
    let (saved, x, y) = (it.get_state().unwrap(), it.get("x").unwrap(), it.get("y").unwrap());
    assert_eq!((&x, &y), (&reals(&[1.0, 2.0, 4.0]), &reals(&[2.0, 4.0, 7.0])));
    let bytes = it.serialize_state(saved).unwrap();
    assert!(it.do_step(0.0, 0.5).unwrap().is_continue());
    let same = it.deserialize_state(&bytes).unwrap();
    for state in [saved, same] {
        it.configure(&[("m", &size(5)), ("n", &size(1)), ("r", &size(2))]).unwrap();
        assert_eq!((it.get("x").unwrap(), it.get("y").unwrap()), (reals(&[0.0]), reals(&[1.0, 2.0])));
        it.set_state(state).unwrap();
        assert_eq!((it.get("x").unwrap(), it.get("y").unwrap()), (x.clone(), y.clone()));
        assert!(it.do_step(0.0, 0.5).unwrap().is_continue());
    }
}

/// In Model Exchange, the number of states follows.
#[test]
fn model_exchange_has_as_many_states_as_the_importer_wants() {
    let mut it = open("state-space").instantiate_as(Kind::ModelExchange, "it", false).unwrap();
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
    it.exit_initialization().unwrap();
    for n in [0_u32, 5, 2] {
        it.configure(&[("n", &size(n)), ("m", &size(2))]).unwrap();
        let n = n as usize;
        assert_eq!(it.state_and_indicator_counts().unwrap().0, n);
        let x: Vec<f64> = (0_u8..).take(n).map(f64::from).collect();
        it.enter_continuous_time_mode().unwrap();
        it.set_continuous_states(&x).unwrap();
        let mut dx = vec![f64::NAN; n];
        it.get_derivatives(&mut dx).unwrap();
        let rates: Vec<f64> = (0..n).map(|i| x[i] + [1.0, 2.0].get(i).unwrap_or(&0.0)).collect();
        assert_eq!((&dx, it.get("der(x)").unwrap()), (&rates, reals(&rates)));
        let mut nominals = vec![f64::NAN; n];
        it.get_nominals(&mut nominals).unwrap();
        assert_eq!(nominals, vec![1.0; n]);
        it.enter_event_mode().unwrap();
    }
}

#[test]
fn fmi2_has_the_sizes_of_the_start() {
    let fmu = fmu_import::Fmu::open(archive("state-space", V2)).unwrap();
    let md = fmu.description();
    assert_eq!((md.derivatives.len(), md.states()[2].name.as_str()), (3, "x[3]"));
    assert!(md.variable("A[3,3]").is_some() && md.variable("der(x[1])").is_some() && md.variable("A[4,1]").is_none());
    let mut it = fmu.instantiate("it", false).unwrap();
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
    assert_eq!(it.get("n").unwrap(), size(3));
    assert!(it.set("n", size(2)).is_err());
}

#[test]
fn fmpy_gives_the_same() {
    let last = script(
        "import sys, fmpy\n\
         from fmpy.validation import validate_fmu\n\
         assert validate_fmu(sys.argv[1]) == []\n\
         result = fmpy.simulate_fmu(sys.argv[1], stop_time=10, output_interval=1)\n\
         print(*(float(x).hex() for row in result['y'] for x in row))\n",
        &[&archive("state-space", V3)],
    );
    let found: Vec<f64> = last.split_whitespace().map(super::hexadecimal).collect();
    assert_eq!(found, expected().concat());
}

/// A preset numbers the elements of a matrix by the start sizes, like the description.
#[test]
fn a_preset_finds_an_element_of_a_matrix() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("StateSpace.fmu");
    let preset = |set: &str| {
        let mut fmu = std::process::Command::new(env!("CARGO_BIN_EXE_fmu"));
        fmu.arg("preset").arg(archive("state-space", V3)).args(["--set", set, "--out"]).arg(&out).status().unwrap()
    };
    assert!(preset("A[2,1]=5").success() && !preset("A[4]=5").success());
    let fmu = fmu_import::Fmu::open(&out).unwrap();
    let a = fmu.description().variable("A").unwrap();
    assert_eq!(a.start.as_deref(), Some("1 0 0 5 1 0 0 0 1"));
    // The binary does the same: y = x + u, and x_2 grows with 5 x_1.
    let of = |fmu| run(exchange(), fmu, &[], 1.0, 0.1);
    let (with, without) = (rows(&of(&out)), rows(&of(&archive("state-space", V3))));
    let last = |rows: &[Vec<f64>]| rows.last().unwrap().clone();
    let (with, without) = (last(&with), last(&without));
    assert_eq!((with[0].to_bits(), with[2].to_bits()), (without[0].to_bits(), without[2].to_bits()));
    assert!(with[1] > without[1] + 1.0, "{with:?} {without:?}");
}

/// Values of an SSP may name elements before the sizes: the structural parameters of all its files are set first, together.
#[test]
fn an_ssp_sets_sizes_before_arrays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sized.ssp");
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    let mut put = |name: &str, bytes: &[u8]| {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    };
    let binding = |values: &[(&str, &str)]| {
        let one = |(name, value): &(&str, &str)| {
            let kind = if name.contains('[') { "Real" } else { "Integer" };
            format!("<ssv:Parameter name=\"{name}\"><ssv:{kind} value=\"{value}\"/></ssv:Parameter>")
        };
        let all: String = values.iter().map(one).collect();
        format!(
            "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version=\"1.0\" name=\"s\">\
             <ssv:Parameters>{all}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>\
             </ssd:ParameterBindings>"
        )
    };
    let (inner, outer) = (
        binding(&[("x0[5]", "3"), ("A[4,5]", "0.5"), ("n", "2"), ("m", "4")]),
        binding(&[("it.x0[2]", "7"), ("it.r", "5"), ("it.n", "5")]),
    );
    let description = format!(
        "<ssd:SystemStructureDescription xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" \
         xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" version=\"1.0\" name=\"sized\">\
         <ssd:System name=\"sized\"><ssd:Elements><ssd:Component name=\"it\" source=\"it.fmu\" \
         type=\"application/x-fmu-sharedlibrary\">{inner}</ssd:Component></ssd:Elements>{outer}</ssd:System>\
         </ssd:SystemStructureDescription>"
    );
    put("SystemStructure.ssd", description.as_bytes());
    put("it.fmu", &std::fs::read(archive("state-space", V3)).unwrap());
    zip.finish().unwrap();
    let mut loaded = Loaded::open(&path, false).unwrap();
    assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
    for port in ["it.x[2]", "it.x[5]", "it.y[4]", "it.n", "it.m", "it.r"] {
        loaded.record(port).unwrap();
    }
    // Sizes that change later leave no inconsistent value behind.
    let settings = Settings { start: 0.0, stop: 1e-3, step: 1e-3, sequential: false };
    let wrong = loaded.system.configure([("it.n", "2")]).unwrap_err().to_string();
    assert!(wrong.contains("x0 has 2 elements, not 5"), "{wrong}");
    loaded.system.configure([("it.n", "5")]).unwrap();
    let recording = loaded.system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    let last: Vec<f64> = recording.columns.iter().map(|column| column.values[1]).collect();
    assert_eq!(last, [7.0 + 1e-3 * (7.0 + 2.0), 3.0 + 1e-3 * 3.0, 1e-3 * (0.5 * 3.0 + 4.0) + 4.0, 5.0, 4.0, 5.0]);
}
