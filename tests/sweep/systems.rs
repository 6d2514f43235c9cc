//! Several FMUs, SSP files, FMUs of other tools, recorded runs, the files of the documentation, the cost of a run.

use crate::{Folder, STARTS, common, ends, fmu, names};
use fmu_sweep::{Definition, Plan};
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

#[test]
fn systems_of_several_fmus_and_ssp_files_are_swept() {
    let folder = Folder::new();
    let archives = common::archives().join("fmi2");
    let ssp = folder.path("drive.ssp");
    ends(fmu().args(["ssp", "--fmus"]).arg(&archives).arg("--out").arg(&ssp), 0);
    let design = "stop = 0.02\nstep = 1e-4\ndesign = { kind = 'lhs', runs = 20, seed = 3 }\n";
    let measure = |p: &str| format!("[measure]\nlast = {{ of = '{p}', is = 'final' }}\n");
    let pair = format!(
        "fmus = ['plant={0}/PmsmPlant.fmu', 'controller={0}/SensorlessController.fmu']\nauto_connect = true\ninput.'controller.speed_ref' = '50'\n{design}\
         [vary]\n'plant.motor.R_s' = {{ uniform = [2.5, 3.5] }}\n\
         'controller.estimator' = {{ values = ['Rasmussen', 'DirectEmf'] }}\n\
         'controller.u_dc' = {{ uniform = [300, 340] }}\n'plant.u_dc' = {{ same = 'controller.u_dc' }}\n{1}",
        archives.display(),
        measure("plant.speed"),
    );
    fs::write(folder.path("pair.toml"), &pair).unwrap();
    let dry =
        fmu().arg("sweep").arg(folder.path("pair.toml")).arg("--out").arg(folder.path("x")).arg("--dry-run").output();
    println!("{}", String::from_utf8(dry.unwrap().stdout).unwrap());
    ends(&mut folder.sweep(&folder.path("pair.toml"), "pair"), 0);
    // One input of the system feeds both.
    let system = format!(
        "fmus = ['drive.ssp']\ninput.speed_ref = '50'\n{design}[vary]\n'plant.motor.R_s' = {{ uniform = [2.5, 3.5] }}\n\
         'controller.estimator' = {{ values = ['Rasmussen', 'DirectEmf'] }}\nu_dc = {{ uniform = [300, 340] }}\n{}",
        measure("speed")
    );
    fs::write(folder.path("ssp.toml"), system).unwrap();
    ends(&mut folder.sweep(&folder.path("ssp.toml"), "ssp"), 0);
    let estimators = |out: &str| -> Vec<String> {
        let of = |row: &String| row.split(',').nth(2).unwrap().to_owned();
        folder.rows(out).iter().map(of).collect()
    };
    assert!(estimators("pair").iter().all(|name| ["Rasmussen", "DirectEmf"].contains(&name.as_str())));
    assert_eq!(estimators("pair"), estimators("ssp"));
    let last = |line: &String, column: usize| line.split(',').nth(column).unwrap().to_owned();
    let of_pair: Vec<String> = folder.rows("pair").iter().map(|line| last(line, 5)).collect();
    let of_ssp: Vec<String> = folder.rows("ssp").iter().map(|line| last(line, 4)).collect();
    assert_eq!(of_pair, of_ssp);
    assert!(of_pair.windows(2).any(|w| w[0] != w[1]), "the rows differ: {of_pair:?}");
}

/// Terms in two units are added unchanged, with a note; a factor says that the user knows.
#[test]
fn a_sum_of_two_units_is_noted() {
    let archive = common::archives().join("fmi2/PmsmDrive.fmu");
    let notes = |of: &str| {
        let text = format!("fmus = ['d={}']\n[measure]\nm = {{ of = '{of}', is = 'final' }}\n", archive.display());
        Plan::new(&Definition::parse(&text).unwrap(), Path::new("")).unwrap().notes().to_vec()
    };
    let expected = "measure: m: its terms are in rad/s and A: the numbers are added unchanged";
    assert_eq!(notes("d.speed - d.i_a"), [expected]);
    for of in ["d.speed", "d.i_a - d.i_a", "d.speed - 2 * d.i_a"] {
        assert_eq!(notes(of), [""; 0], "{of}");
    }
}

/// Enumerations have their names in the results, in measures of their values and in traces; a list of names runs again.
/// A plant whose resistance is in mOhm, in half of the rows.
#[test]
fn warnings_of_the_fmus_are_counted() {
    let folder = Folder::new();
    let text = |runs: u32, values: &str| {
        format!(
            "stop = 2e-3\ndesign = {{ kind = 'random', runs = {runs} }}\n\
             [vary]\n'd.controller.motor.R_s' = {{ values = {values} }}\n[measure]\nm = {{ of = 'd.speed', is = 'final' }}\n"
        )
    };
    let said = |name: &str, text: &str, isolate: bool| {
        let file = folder.define(&format!("{name}.toml"), text);
        let mut command = folder.sweep(&file, &format!("{name}-{isolate}"));
        if isolate {
            command.arg("--isolate");
        }
        ends(&mut command, 0)
    };
    let half = [false, true].map(|isolate| said("half", &text(64, "[1.8, 1800]"), isolate));
    assert_eq!(half[0], half[1]);
    let count: u32 = half[0].split_once("warning: ").unwrap().1.split(' ').next().unwrap().parse().unwrap();
    assert!((10..54).contains(&count), "{}", half[0]);
    assert!(half[0].contains(" of 64 rows have warnings; the first, in row "), "{}", half[0]);
    assert!(half[0].contains(": controller.motor.R_s = 1800 Ohm is "), "{}", half[0]);
    let many = said("many", &text(1600, "[1800]"), false);
    assert!(many.contains("warning: 100 of the 100 checked rows have warnings; the first, in row 0: d: "), "{many}");
    assert!(!said("none", &text(8, "[1.8]"), false).contains("warning"));
}

#[test]
fn enumerations_keep_their_names() {
    let folder = Folder::new();
    let tail = "[measure]\nfirst = { of = 'd.controller.estimator', is = 'at', time = 0 }\n\
        mean = { of = 'd.controller.estimator', is = 'mean' }\nspeed = { of = 'd.speed', is = 'final' }\n\
        [trace]\nof = ['d.controller.estimator', 'd.speed']\nruns = [1]\n";
    let head = "stop = 0.01\nstep = 1e-3\ninput.'d.speed_ref' = '50'\n";
    let file = folder.define(
        "grid.toml",
        &format!("{head}design.kind = 'grid'\nvary.'d.controller.estimator' = {{ values = ['Rasmussen', 13, 'DirectEmf'] }}\n{tail}"),
    );
    ends(&mut folder.sweep(&file, "grid"), 0);
    let rows = folder.rows("grid");
    for (row, beginning) in
        rows.iter().zip(["0,Rasmussen,Rasmussen,1,", "1,Sensored,Sensored,13,", "2,DirectEmf,DirectEmf,2,"])
    {
        assert!(row.starts_with(beginning), "{row}");
    }
    let trace = fs::read_to_string(folder.path("grid/traces/run-00000001.csv")).unwrap();
    assert!(trace.lines().nth(1).unwrap().starts_with("0,Sensored,0"), "{trace}");
    let whole = fs::read_to_string(folder.path("grid/results.csv")).unwrap();
    let list: String = whole.lines().map(|line| line.split(',').nth(1).unwrap().to_owned() + "\n").collect();
    fs::write(folder.path("list.csv"), list).unwrap();
    let file = folder.define("list.toml", &format!("{head}design = {{ kind = 'list', file = 'list.csv' }}\n{tail}"));
    ends(&mut folder.sweep(&file, "list"), 0);
    assert_eq!(folder.rows("list"), rows);
}

#[test]
fn chosen_runs_are_recorded() {
    let folder = Folder::new();
    let trace = "[trace]\nof = ['d.speed', 'd.i_q']\nevery = 2\nruns = [3, 17]\n";
    let text = STARTS.replace("stop = 0.4", "stop = 0.01").replace("runs = 400", "runs = 20");
    let file = folder.define("a.toml", &format!("{text}{trace}"));
    ends(&mut folder.sweep(&file, "out"), 0);
    let mut traces = names(&folder.path("out/traces"));
    traces.sort();
    assert_eq!(traces, ["run-00000003.csv", "run-00000017.csv"]);
    let trace = fs::read_to_string(folder.path("out/traces/run-00000017.csv")).unwrap();
    let lines: Vec<&str> = trace.lines().collect();
    assert_eq!((lines[0], lines.len()), ("time,d.speed,d.i_q", 7));
    assert!(lines[1].starts_with("0,") && lines[6].starts_with("0.01,"), "{trace}");
}

/// FMUs in C that do not reset a state, end their binary by the status Fatal, print text, or allow only one instance.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn rude_fmus_run_as_well_as_polite_ones() {
    let folder = Folder::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let pack = |fault: &str| {
        let library = folder.path(&format!("{fault}.so"));
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-O1", "-w", "-fvisibility=hidden", &format!("-DFAULTS=\"{fault}\"")]);
        ends(cc.arg(root.join("fmu-check/tests/faults/fmu.c")).arg("-o").arg(&library).arg("-lm"), 0);
        let mut xml = fs::read_to_string(root.join("fmu-check/tests/faults/fmu.xml")).unwrap();
        if fault == "ONCE" {
            xml = xml.replace("canGetAndSet", "canBeInstantiatedOnlyOncePerProcess=\"true\" canGetAndSet");
        }
        let mut zip = zip::ZipWriter::new(fs::File::create(folder.path(&format!("{fault}.fmu"))).unwrap());
        let library = fs::read(library).unwrap();
        for (name, bytes) in [("modelDescription.xml", xml.as_bytes()), ("binaries/linux64/Small.so", &library[..])] {
            zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            std::io::Write::write_all(&mut zip, bytes).unwrap();
        }
        zip.finish().unwrap();
    };
    fs::write(folder.path("rows.csv"), "s.bias\n1\n2\n9\n3\n4\n5\n6\n7\n8\n1.5\n").unwrap();
    let sweep = |fault: &str, arguments: &[&str], status: i32| {
        pack(fault);
        let text = format!(
            "fmus = ['s={fault}.fmu']\nstop = 0.1\nstep = 0.01\ninput.'s.u' = '1'\n\
             design = {{ kind = 'list', file = 'rows.csv', part = 4 }}\n[measure]\ny = {{ of = 's.y', is = 'final' }}\n"
        );
        fs::write(folder.path(&format!("{fault}.toml")), text).unwrap();
        let said = ends(folder.sweep(&folder.path(&format!("{fault}.toml")), fault).args(arguments), status);
        (said, folder.rows(fault))
    };
    let (said, polite) = sweep("NONE", &["--jobs", "2"], 0);
    assert!(said.is_empty() && polite[9].starts_with("9,1.5,0.35") && polite[9].ends_with(",0.1,"), "{said}{polite:?}");
    let (said, rows) = sweep("L06", &["--jobs", "2"], 0);
    assert!(said.contains("note: a run after a reset differs from a run of a new instance"), "{said}");
    assert_eq!(rows, polite);
    let (said, mut rows) = sweep("FATAL", &["--jobs", "1"], 1);
    assert!(said.contains("row 2: s: fmi2DoStep returned Fatal") && said.contains("1 of 10 rows failed"), "{said}");
    rows[2].clone_from(&polite[2]);
    assert_eq!(rows, polite, "after the status Fatal there is another copy of the binary");
    assert_eq!(sweep("PRINT", &["--isolate", "--jobs", "2"], 0), (String::new(), polite.clone()));
    let (said, rows) = sweep("ONCE", &["--jobs", "2"], 0);
    assert_eq!(
        said,
        "note: s allows only one instance per process: rows run in separate processes, as with --isolate\n"
    );
    assert_eq!(rows, polite);
    fs::remove_dir_all(folder.path("ONCE")).unwrap();
    assert_eq!(sweep("ONCE", &["--jobs", "1"], 0), (String::new(), polite));
}

/// The examples of the documentation: the file of docs/sweeps.md and examples/sweep.toml, with fewer runs.
#[test]
fn the_files_of_the_documentation_run() {
    let folder = Folder::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["PmsmPlant.fmu", "SensorlessController.fmu", "PmsmDrive.fmu"] {
        fs::copy(common::archives().join("fmi3").join(name), folder.path(name)).unwrap();
    }
    let page = fs::read_to_string(root.join("docs/sweeps.md")).unwrap();
    let file = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    fs::write(folder.path("page.toml"), file.replace("runs = 4096", "runs = 4")).unwrap();
    assert_eq!(ends(&mut folder.sweep(&folder.path("page.toml"), "page"), 0), "");
    let settled = folder.rows("page").iter().filter(|row| row.split(',').nth(4).unwrap().starts_with("0.")).count();
    assert_eq!(settled, 4, "{:?}", folder.rows("page"));

    let file = fs::read_to_string(root.join("examples/sweep.toml")).unwrap();
    let fewer = file.replace("runs = 100000", "runs = 256").replace("../target/fmu/fmi3/", "");
    fs::write(folder.path("example.toml"), fewer).unwrap();
    let said = ends(&mut folder.sweep(&folder.path("example.toml"), "example"), 0);
    assert!(
        said.contains(" of 256 rows have warnings; the first, in row 0: d: at ") && said.lines().count() == 1,
        "{said}"
    );
    let angle = |row: &String| row.split(',').nth(6).unwrap().parse::<f64>().unwrap();
    let lost = folder.rows("example").iter().filter(|row| angle(row).abs() > std::f64::consts::FRAC_PI_2).count();
    println!("{lost} of 256 starts lost");
    assert!((1..20).contains(&lost), "{lost} of 256 starts lost");
}

/// The overhead of a run of one period: reset, two values, initialization, end.
#[test]
fn a_run_costs_microseconds() {
    let drive = common::archives().join("fmi3/PmsmDrive.fmu");
    let text = format!(
        "fmus = ['d={}']\nstop = 1e-4\nstep = 1e-4\n[measure]\nx = {{ of = 'd.speed', is = 'final' }}",
        drive.display()
    );
    let plan = Plan::new(&Definition::parse(&text).unwrap(), Path::new("")).unwrap();
    let variables = plan.bind(["d.plant.motor.R_s", "d.tau_load"]).unwrap();
    // Rounds are shorter than a time slice: so the fastest of many runs undisturbed.
    let columns: [&[f64]; 2] = [&[3.0; 50], &[0.5; 50]];
    let once = || {
        let begun = Instant::now();
        let outcomes = plan.run_many(&variables, &columns, 1, &|_| ControlFlow::Continue(())).unwrap();
        assert!(outcomes.errors.iter().all(Option::is_none));
        begun.elapsed().as_secs_f64() / 50.0
    };
    let best = (0..500).map(|_| once()).fold(f64::INFINITY, f64::min);
    println!("{:.2} us a run of one period", 1e6 * best);
    assert!(best < 50e-6, "{:.1} us", 1e6 * best);
}
