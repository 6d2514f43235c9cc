//! `fmu simulate`: runs, files, reports and refusals.

use super::{archive, common, fails, fmu, text};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::Command;

const DESCRIPTION: &[u8] = br#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="X" instantiationToken="x">
<CoSimulation modelIdentifier="X"/><ModelVariables><Float64 name="time" valueReference="0" causality="independent"/>
</ModelVariables><ModelStructure/></fmiModelDescription>"#;

fn zip(path: &Path, entries: &[(&str, &[u8])]) {
    let mut zip = zip::ZipWriter::new(File::create(path).unwrap());
    for (name, bytes) in entries {
        zip.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap();
}

#[test]
fn a_bad_file_gives_one_line_and_status_2() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let refused = |name: &str, cause: &str| {
        let path = path(name);
        let path = path.to_str().unwrap();
        fails(&["simulate", path], 2, &[path, cause]);
    };
    refused("missing.fmu", "No such file");
    std::fs::write(path("text.fmu"), "hello").unwrap();
    refused("text.fmu", "not a ZIP archive");
    zip(&path("empty.fmu"), &[]);
    refused("empty.fmu", "has no modelDescription.xml");
    zip(&path("slip.fmu"), &[("modelDescription.xml", DESCRIPTION), ("../evil", b"x")]);
    refused("slip.fmu", "leads outside");
    zip(&path("xml.fmu"), &[("modelDescription.xml", b"<a")]);
    refused("xml.fmu", "modelDescription.xml: line 1");
    zip(&path("fmi1.fmu"), &[("modelDescription.xml", br#"<fmiModelDescription fmiVersion="1.0"/>"#)]);
    refused("fmi1.fmu", "fmiVersion=\"1.0\" is not supported");
    zip(&path("source.fmu"), &[("modelDescription.xml", DESCRIPTION), ("binaries/sparc-solaris/X.so", b"x")]);
    refused("source.fmu", "for this platform (FMI 3.0); it has binaries for sparc-solaris");
    let se = text(DESCRIPTION).replace("CoSimulation", "ScheduledExecution");
    zip(&path("se.fmu"), &[("modelDescription.xml", se.as_bytes())]);
    refused("se.fmu", "has neither Co-Simulation nor Model Exchange; it has Scheduled Execution (FMI 3.0)");
    let bytes = std::fs::read(path("slip.fmu")).unwrap();
    std::fs::write(path("cut.fmu"), &bytes[..bytes.len() / 2]).unwrap();
    refused("cut.fmu", "cut short");
}

#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_bad_binary_gives_one_line_and_status_2() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let with = |binary: &[u8]| {
        zip(&path, &[("modelDescription.xml", DESCRIPTION), ("binaries/x86_64-linux/X.so", binary)]);
    };
    with(b"not a library");
    fails(&["simulate", path.to_str().unwrap()], 2, &["x.fmu: "]);
    // A library of the system that is not an FMU.
    let system = ["/lib/x86_64-linux-gnu/libm.so.6", "/lib64/libm.so.6", "/usr/lib/libm.so.6"];
    if let Some(library) = system.iter().find_map(|path| std::fs::read(path).ok()) {
        with(&library);
        fails(
            &["simulate", path.to_str().unwrap()],
            2,
            &["x.fmu: the function fmi3InstantiateCoSimulation is missing"],
        );
    }
}

/// An FMU of another tool with only Model Exchange: x' = u - x from 1, in C.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn model_exchange_is_integrated() {
    let dir = tempfile::tempdir().unwrap();
    let (library, path) = (dir.path().join("x.so"), dir.path().join("p.fmu"));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("fmu-system/tests/model_exchange/fmu.c");
    let mut cc = Command::new("cc");
    cc.args(["-std=c11", "-D_GNU_SOURCE", "-shared", "-fPIC", "-w", "-DSTATES=1"]).arg(source);
    assert!(cc.arg("-o").arg(&library).arg("-lm").status().unwrap().success());
    let xml = br#"<fmiModelDescription fmiVersion="2.0" guid="g" modelName="P" numberOfEventIndicators="1">
<ModelExchange modelIdentifier="x"/><ModelVariables>
<ScalarVariable name="x" valueReference="2" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="der(x)" valueReference="3"><Real derivative="1"/></ScalarVariable>
</ModelVariables><ModelStructure><Derivatives><Unknown index="2"/></Derivatives></ModelStructure></fmiModelDescription>"#;
    zip(&path, &[("modelDescription.xml", xml), ("binaries/linux64/x.so", &std::fs::read(&library).unwrap())]);
    let path = path.to_str().unwrap();
    for (options, note, tolerance) in [
        (&[][..], "note: p has no Co-Simulation: the FMUs are integrated, as with --me", 1e-5),
        (&["--me", "--rtol", "1e-10"], "", 1e-9),
        (&["--me", "--solver", "rk4"], "", 1e-5),
    ] {
        let output = fmu(&[&["simulate", path, "--step", "0.1", "--stop", "1", "--csv", "-"], options].concat());
        let (csv, error) = (text(&output.stdout), text(&output.stderr));
        assert!(output.status.success() && error.contains(note), "{options:?}: {error}");
        let x: f64 = csv.lines().last().unwrap().split(',').nth(1).unwrap().parse().unwrap();
        assert!((x - (-1.0_f64).exp()).abs() < tolerance, "{options:?}: {csv}");
    }
    let refused = |options: &[&str], part: &str| fails(&[&["simulate", path], options].concat(), 2, &[part]);
    refused(&["--event-mode"], "p: has no Co-Simulation; it has Model Exchange (FMI 2.0)");
    refused(&["--me", "--rtol", "0"], "the relative tolerance 0 must be between 1e-14 and 0.1");
    refused(&["--me", "--solver", "rk4", "--rtol", "1e-3"], "--rtol is for --solver dopri");
    let drive = archive("fmi3", "PmsmDrive");
    fails(&["simulate", drive.to_str().unwrap(), "--rtol", "1e-3"], 2, &["--solver and --rtol are for Model Exchange"]);
}

#[test]
fn bad_usage_names_what_is_wrong() {
    let plant = archive("fmi3", "PmsmPlant");
    let controller = archive("fmi2", "SensorlessController");
    let (p, c) = (format!("p={}", plant.display()), format!("c={}", controller.display()));
    for (arguments, part) in [
        (["--set", "p.motor.R=3"], "p: has no variable motor.R; did you mean motor.R_s?"),
        (
            ["--set", "R_s=3"],
            "R_s: is not INSTANCE.VARIABLE; the instances are p, c; did you mean p.motor.R_s or c.motor.R_s?",
        ),
        (["--set", "p.motor.R_s=3,3"], "motor.R_s = 3,3 is not a number: write a decimal point"),
        (["--set", "p.motor.R_s=3 mH"], "motor.R_s = 3mH is not a number in Ohm"),
        (["--input", "c.speed_ref=0:0,1:5rps"], "c: speed_ref = 5rps is not a number in rad/s or rpm"),
        (["--input", "p.motor.L_d=0:1"], "p.motor.L_d=0:1: is not an input or a tunable parameter"),
        (["--plot", "run.pdf"], "plots are written as .svg or .png"),
        (["--set", "q.motor.R_s=3"], "q.motor.R_s: is not INSTANCE.VARIABLE; the instances are p, c"),
        (["--set", "p.motor.n_p=2.5"], "motor.n_p = 2.5 is not an integer"),
        (["--set", "c.estimator=Magic"], "estimator = Magic is not one of Rasmussen, "),
        (["--connect", "c.u_a=p.speed"], "p.speed: is not an input"),
        (["--connect", "c.T_s=p.u_a"], "c.T_s: is not an output"),
        (["--input", "p.u_a=0:0,0:1"], "--input p.u_a=0:0,0:1: the time 0 does not follow 0"),
        (["--input", "nothing.csv"], "--input nothing.csv: "),
        (["--record", "p.nothing"], "p: has no variable nothing"),
        (["--step", "-1"], "step of -1 s must be positive"),
    ] {
        fails(&[&["simulate", p.as_str(), c.as_str()][..], &arguments[..]].concat(), 2, &[part]);
    }
    fails(&["simulate", p.as_str(), p.as_str()], 2, &["p: two instances have this name"]);
    fails(&["build", "Magic"], 2, &["there is no FMU Magic; available: "]);
    fails(&["build", "--library", "Cargo.toml"], 2, &["Cargo.toml: "]);
}

#[test]
fn a_refusal_of_an_fmu_is_told_in_its_own_words() {
    for standard in ["fmi2", "fmi3"] {
        let plant = format!("p={}", archive(standard, "PmsmPlant").display());
        fails(&["simulate", &plant, "--set", "p.motor.R_s=-1"], 1, &["p: fmi", "motor.R_s = -1 is not allowed"]);
    }
}

/// Plant and controller, connected by name, at 1000 rpm after 1 s.
#[test]
fn the_pair_runs_alike_in_both_standards() {
    let run = |standard: &str, more: &[&str]| {
        let [p, c] = [("p", "PmsmPlant"), ("c", "SensorlessController")]
            .map(|(name, file)| format!("{name}={}", archive(standard, file).display()));
        let arguments = ["simulate", &p, &c, "--auto-connect", "--input", "c.speed_ref=0:0,0.1:104.72", "--stop", "1"];
        let record = ["--record", "p.speed,c.speed_est,c.speed_ref", "--csv", "-"];
        let output = fmu(&[&arguments[..], &record[..], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(text(&output.stderr).contains("connected c.u_a -> p.u_a"));
        text(&output.stdout)
    };
    let [two, three] = ["fmi2", "fmi3"].map(|standard| run(standard, &[]));
    assert_eq!(two, three);
    assert_eq!(two.lines().count(), 10_002);
    assert_eq!(two.lines().next(), Some("time,p.speed,c.speed_est,c.speed_ref"));
    let last: Vec<f64> = two.lines().last().unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert!((last[1] - 104.72).abs() < 0.5 && (last[2] - last[1]).abs() < 0.5, "{last:?}");
    assert_ne!(run("fmi3", &["--sequential"]), three, "one step less on the way from plant to controller");
}

/// With the clocked controller instead of the sampled one, the plant behaves the same in every interface.
#[test]
fn clocks_tick() {
    let run = |controller: &str, more: &[&str]| {
        let (p, c) = (archive("fmi3", "PmsmPlant"), archive("fmi3", controller));
        let (p, c) = (format!("p={}", p.display()), format!("c={}", c.display()));
        let arguments = ["simulate", &p, &c, "--auto-connect", "--input", "c.speed_ref=0:0,0.01:80", "--stop", "0.1"];
        let output = fmu(&[&arguments[..], &["--record", "p.i_a,p.speed", "--csv", "-"], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let (plain, clocked) = ("SensorlessController", "SensorlessControllerClocked");
    for method in [&[][..], &["--event-mode"], &["--me", "--solver", "rk4"]] {
        let (grid, clock) = (run(plain, method), run(clocked, method));
        assert_eq!(grid.lines().count(), 1002, "{method:?}");
        assert!(grid == clock, "{method:?}");
        let speed: f64 = grid.lines().last().unwrap().split(',').nth(2).unwrap().parse().unwrap();
        assert!(speed > 30.0, "{method:?}: {speed}");
    }
    // A communication step of ten ticks.
    let fine = run(clocked, &["--step", "1e-4"]);
    let coarse = run(clocked, &["--step", "1e-3"]);
    assert_eq!(coarse.lines().count(), 102);
    for (k, row) in coarse.lines().skip(1).enumerate() {
        let numbers = |row: &str| row.split(',').map(|cell| cell.parse::<f64>().unwrap()).collect::<Vec<_>>();
        let (coarse, fine) = (numbers(row), numbers(fine.lines().nth(1 + 10 * k).unwrap()));
        assert!(coarse.iter().zip(&fine).all(|(a, b)| (a - b).abs() < 1e-9), "{coarse:?} {fine:?}");
    }
}

/// Settings that FMUs accept but that may invalidate a result are reported after the run; the exit status stays 0.
#[test]
fn inputs_left_alone_and_long_steps_are_told() {
    let warned = |more: &[&str]| {
        let drive = format!("d={}", archive("fmi3", "PmsmDrive").display());
        let output = fmu(&[&["simulate", &drive, "--stop", "0.01"][..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{more:?}");
        text(&output.stderr)
    };
    let printed = warned(&["--step", "0.002"]);
    let lines: Vec<_> = printed.lines().collect();
    assert_eq!(lines.len(), 2, "{printed}");
    assert!(lines[0].starts_with("warning: d: inputs left at their start values: "), "{printed}");
    for value in ["speed_ref = 0 rad/s", "tau_load = 0 N.m", "u_dc = 325 V", "--set"] {
        assert!(lines[0].contains(value), "{value}: {printed}");
    }
    assert_eq!(
        lines[1],
        "warning: d: the step of 0.002 s is longer than the stepSize of its DefaultExperiment, 0.001 s; --step 0.001 shows \
         whether the results depend on it"
    );
    // Inputs that the description calls optional are reported only if they are read, depending on a set parameter or a start
    // value.
    for optional in ["enable", "speed_shaft", "angle_shaft", "tau_ref", "T_coolant", "T_winding_imposed"] {
        assert!(!printed.contains(optional), "{optional}: {printed}");
    }
    let printed = warned(&["--set", "d.plant.mechanics.imposed=true", "--set", "d.plant.thermal.mode=Imposed"]);
    for read in ["speed_shaft = 0 rad/s", "angle_shaft", "T_winding_imposed = 293.15 K"] {
        assert!(printed.contains(read), "{read}: {printed}");
    }
    assert!(!printed.contains("tau_ref") && !printed.contains("T_coolant"), "{printed}");
    // A connected or set input is not reported, even at its start value, and neither is a step up to stepSize.
    let printed = warned(&["--input", "d.speed_ref=0:0,0.005:10", "--set", "d.tau_load=0", "--step", "0.001"]);
    assert!(printed.lines().count() == 1 && printed.contains("u_dc") && !printed.contains("speed_ref ="), "{printed}");
    assert!(!printed.contains("tau_load"), "{printed}");
}

/// A warning of an FMU is shown without `--logging`, once, in both standards and interfaces; an instance without warnings is
/// quiet.
#[test]
fn warnings_of_the_fmus_are_shown() {
    for standard in ["fmi2", "fmi3"] {
        for interface in [&[][..], &["--me"]] {
            let drive = |name: &str| format!("{name}={}", archive(standard, "PmsmDrive").display());
            let run =
                ["simulate", &drive("low"), &drive("d"), "--set", "low.u_dc=0", "--stop", "2.5", "--step", "0.001"];
            let output = fmu(&[&run[..], interface].concat());
            assert_eq!(output.status.code(), Some(0), "{standard} {interface:?}");
            let printed = text(&output.stderr);
            let shown = |part: &str| {
                printed.lines().filter(|line| line.starts_with("warning: low: at ") && line.contains(part)).count()
            };
            assert_eq!(
                (shown("u_dc = 0 V: the DC link has no voltage"), shown("begins with u_dc = 0")),
                (1, 1),
                "{printed}"
            );
            assert!(!printed.contains(": d: at "), "{printed}");
        }
    }
}

/// The README's first run ends with useful output: the speed reached, and the page with a command to open it.
#[test]
fn the_first_run_of_the_readme() {
    let readme = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap();
    let block = readme.split("```sh\n").nth(1).unwrap().split("```").next().unwrap().replace("\\\n", " ");
    let command = block.lines().find_map(|line| line.strip_prefix("cargo fmu simulate ")).unwrap();
    let archives = common::archives().display().to_string();
    let arguments = command.split_whitespace().map(|word| word.replace("target/fmu", &archives));
    let dir = tempfile::tempdir().unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_fmu"));
    let output = run.arg("simulate").args(arguments).current_dir(dir.path()).output().unwrap();
    let (said, printed) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success() && printed.is_empty(), "{printed}");
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines[..2], ["at 1 s:", "  speed 1000 rpm, speed_ref 1000 rpm, speed_est 1000 rpm"], "{said}");
    let [.., page, open, address] = &lines[..] else { panic!("{said}") };
    let path = dir.path().canonicalize().unwrap().join("speed.html");
    assert!(lines.len() <= 10 && path.exists(), "{said}");
    assert_eq!(*page, "page: speed.html");
    assert!(open.starts_with("open it with: ") && open.ends_with("/speed.html"), "{open}");
    assert_eq!(*address, format!("or in a browser: file://{}", path.display()));
}

/// A single FMU needs no name before its variables; numbers have the units that the FMU shows; a tunable parameter changes.
#[test]
fn what_a_person_types() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (load, png) = (file("load.csv"), file("run.png"));
    std::fs::write(&load, "t,torque\n0,0\n0.1,1\n").unwrap();
    for standard in ["fmi2", "fmi3"] {
        let drive = archive(standard, "PmsmDrive");
        let load = format!("tau_load={load}");
        let output =
            fmu(
                &[
                    &[
                        "simulate",
                        drive.to_str().unwrap(),
                        "--stop",
                        "0.1",
                        "--input",
                        "speed_ref=0:0rpm,0.05:1000 rpm",
                    ][..],
                    &["--input", &load, "--input", "controller.motor.R_s=0:1.8,0.05:1.9", "--set", "T_coolant=20degC"],
                    &[
                        "--record",
                        "speed_ref,tau_load,controller.motor.R_s,T_coolant,R_s_est",
                        "--csv",
                        "-",
                        "--plot",
                        &png,
                    ],
                ]
                .concat(),
            );
        assert!(output.status.success(), "{}", text(&output.stderr));
        let csv = text(&output.stdout);
        let row =
            |k: usize| -> Vec<f64> { csv.lines().nth(k + 1).unwrap().split(',').map(|x| x.parse().unwrap()).collect() };
        let near = |k: usize, wanted: [f64; 6]| {
            assert!(
                row(k).iter().zip(wanted).all(|(x, y)| (x - y).abs() < 1e-6),
                "{standard}: {:?}, {wanted:?}",
                row(k)
            );
        };
        near(49, [0.049, 0.0, 0.49, 1.8, 293.15, 1.8]);
        near(100, [0.1, 1000.0 * std::f64::consts::PI / 30.0, 1.0, 1.9, 293.15, 1.9]);
        assert!(std::fs::read(&png).unwrap().starts_with(b"\x89PNG"), "a picture");
    }
}

/// Without --record a plot shows the main variables of a drive, and the CSV has only the outputs.
#[test]
fn a_first_plot_has_five_panels() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (csv, svg, drive) = (file("run.csv"), file("run.svg"), archive("fmi2", "PmsmDrive"));
    let run = |more: &[&str]| {
        let arguments = ["simulate", drive.to_str().unwrap(), "--stop", "0.02", "--input", "speed_ref=1000rpm"];
        let output = fmu(&[&arguments[..], &["--csv", &csv, "--plot", &svg], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let header = std::fs::read_to_string(&csv).unwrap().lines().next().unwrap().to_owned();
        assert!(
            header.starts_with("time,speed,") && header.contains(",i_a,") && !header.contains("speed_ref"),
            "{header}"
        );
        std::fs::read_to_string(&svg).unwrap()
    };
    let first = run(&[]);
    for part in [
        "height=\"1200\"",
        ">speed_ref</text>",
        "theta_est - theta_e",
        ">i_q_ref</text>",
        ">Speed</text>",
        ">Torque</text>",
        ">rpm</text>",
        ">W</text>",
    ] {
        assert!(first.contains(part), "{part}");
    }
    assert!(!first.contains(">i_a<") && run(&["--all"]).contains(">i_a<"));
}

/// The page of a run: the panels of the plot with all their points, and no external content; also for a foreign FMU.
#[test]
fn a_run_is_written_as_a_page() {
    let dir = tempfile::tempdir().unwrap();
    let html = dir.path().join("run.html");
    let run = |arguments: &[&str]| {
        let output = fmu(&[&["simulate"], arguments, &["--html", html.to_str().unwrap()]].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let page = std::fs::read_to_string(&html).unwrap();
        common::pages::stands_alone(&page, |_| false);
        page
    };
    let drive = archive("fmi3", "PmsmDrive");
    let drive = drive.to_str().unwrap();
    let arguments = [drive, "--stop", "0.02", "--input", "speed_ref=1000rpm"];
    let page = run(&arguments);
    assert!(page.contains("<h1>PmsmDrive.fmu</h1>") && page.contains("DecompressionStream"), "title and script");
    let [figure] = &common::pages::figures(&page)[..] else { panic!("one figure") };
    let panels = figure["panels"].as_array().unwrap();
    let units: Vec<&str> = panels.iter().map(|panel| panel["unit"].as_str().unwrap()).collect();
    assert_eq!(units, ["rpm", "N.m", "A", "W", "deg"]);
    let titles: Vec<&str> = panels.iter().map(|panel| panel["title"].as_str().unwrap()).collect();
    assert_eq!(titles, ["Speed", "Torque", "Current", "Power", "Angle"]);
    let names: Vec<&str> = panels
        .iter()
        .flat_map(|panel| panel["curves"].as_array().unwrap())
        .map(|curve| curve["name"].as_str().unwrap())
        .collect();
    assert!(names.contains(&"speed_ref") && names.contains(&"theta_est - theta_e"), "{names:?}");
    // The time in two parts, then every curve.
    let lengths = figure["lengths"].as_array().unwrap();
    assert!(lengths.len() == names.len() + 2 && lengths.iter().all(|n| n == 21), "{lengths:?}");
    let long = run(&[&arguments[..], &["--all", "--step", "2e-7"]].concat());
    assert!(common::pages::figures(&long)[0]["lengths"][0] == 100_001);
    assert!(long.len() < 5_000_000, "100001 points of every output take {} bytes", long.len());
    for (option, file, remedy) in
        [("--html", "run.svg", "pages are written as .html"), ("--overlay", "run.csv", "--html: add one")]
    {
        let arguments: Vec<&str> = ["simulate", drive, option, file].into_iter().filter(|a| !a.is_empty()).collect();
        fails(&arguments, 2, &[file, remedy]);
    }
}

/// An earlier run and a measurement in the plot of a run, with their own times and units.
#[test]
fn runs_and_measurements_are_overlaid() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (csv, bench, html) = (file("first.csv"), file("bench.csv"), file("both.html"));
    std::fs::write(&bench, "t [ms];speed [rpm];torque\n0;0,0;1\n10;5,5;2\n30;6;3\n").unwrap();
    for standard in ["fmi2", "fmi3"] {
        let drive = archive(standard, "PmsmDrive");
        let run = |more: &[&str]| {
            let arguments = ["simulate", drive.to_str().unwrap(), "--stop", "0.02", "--input", "speed_ref=1000rpm"];
            let output = fmu(&[&arguments[..], more].concat());
            assert!(output.status.success(), "{}", text(&output.stderr));
            (text(&output.stdout), text(&output.stderr))
        };
        let (said, _) = run(&["--set", "controller.estimator=Sensored", "--csv", &csv]);
        let header = std::fs::read_to_string(&csv).unwrap().lines().next().unwrap().to_owned();
        assert!(header.contains(",identified_R_s,") && header.contains(",energy_loss,"), "{header}");
        assert!(!said.contains("identified_"), "{said}");
        assert!(said.contains("outputs without a change are not shown; --all shows all"), "{said}");
        let named = format!("bench={bench}");
        run(&["--overlay", &csv, "--overlay", &named, "--html", &html]);
        let figures = common::pages::figures(&std::fs::read_to_string(&html).unwrap());
        let curves: Vec<&serde_json::Value> = figures[0]["panels"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|panel| panel["curves"].as_array().unwrap())
            .collect();
        let names: Vec<&str> = curves.iter().map(|curve| curve["name"].as_str().unwrap()).collect();
        for name in
            ["speed", "speed_ref", "speed (first)", "speed (bench)", "i_q (first)", "theta_est - theta_e (first)"]
        {
            assert!(names.contains(&name), "{name}: {names:?}");
        }
        assert!(!names.iter().any(|name| name.contains("torque") || *name == "i_a (first)"), "{names:?}");
        let (_, warned) = run(&["--overlay", &named, "--record", "i_a", "--html", &html]);
        assert!(warned.contains("--overlay bench: no column is drawn; it has speed, torque, the plot i_a"), "{warned}");
        let (all, _) = run(&["--all"]);
        assert!(all.contains("identified_R_s"), "{all}");
        // A name stays as it is written.
        run(&["--record", "PmsmDrive.speed,tau_e", "--csv", &csv]);
        assert!(std::fs::read_to_string(&csv).unwrap().starts_with("time,PmsmDrive.speed,tau_e\n"));
        // The name that the user gives an instance stays, and is read back.
        let d = format!("d={}", drive.display());
        let output = fmu(&["simulate", &d, "--stop", "0.01", "--csv", &csv, "--overlay", &bench, "--html", &html]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(std::fs::read_to_string(&csv).unwrap().starts_with("time,d.speed,"));
        run(&["--overlay", &csv, "--html", &html]);
        assert!(
            common::pages::figures(&std::fs::read_to_string(&html).unwrap())[0].to_string().contains("speed (first)")
        );
    }
    let drive = archive("fmi3", "PmsmDrive");
    let refused = |file: &str, part: &str| {
        fails(
            &["simulate", drive.to_str().unwrap(), "--stop", "0.01", "--overlay", file, "--html", &html],
            2,
            &["--overlay", part],
        );
    };
    refused("missing.csv", "missing.csv");
    std::fs::write(&bench, "t,speed [krpm]\n0,1\n").unwrap();
    refused(&bench, "speed [krpm]: expected the unit rad/s or rpm");
}

/// Ctrl-C keeps the results so far.
#[cfg(unix)]
#[test]
fn an_interrupted_run_keeps_its_results() {
    for how in [&[][..], &["--in-process"]] {
        let dir = tempfile::tempdir().unwrap();
        let (csv, temporary) = (dir.path().join("out.csv"), dir.path().join("tmp"));
        std::fs::create_dir(&temporary).unwrap();
        let drive = archive("fmi3", "PmsmDrive");
        let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
        let arguments = ["--set", "u_dc=0", "--step", "1e-3", "--stop", "1e5", "--record", "speed", "--csv"];
        command.arg("simulate").arg(&drive).args(arguments).arg(&csv).args(how).env("TMPDIR", &temporary);
        command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped());
        let mut child = command.spawn().unwrap();
        // The drive warns after its first step: the run has begun.
        let (mut lines, mut printed) = (BufReader::new(child.stderr.take().unwrap()), String::new());
        while !printed.contains("the DC link has no voltage") {
            assert!(lines.read_line(&mut printed).unwrap() > 0, "{how:?}: {printed}");
        }
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        lines.read_to_string(&mut printed).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(1), "{printed}");
        let (_, end) = printed.split_once("error: interrupted at ").unwrap_or_else(|| panic!("{printed}"));
        let (end, _) = end.split_once(" s, where the results end").unwrap_or_else(|| panic!("{printed}"));
        let rows = end.parse::<f64>().unwrap() / 1e-3;
        // With the names and the row of the start.
        let found = f64::from(u32::try_from(std::fs::read_to_string(&csv).unwrap().lines().count()).unwrap()) - 2.0;
        assert!(rows > 0.5 && (found - rows).abs() < 0.5, "{found} rows: {printed}");
        let left: Vec<_> = std::fs::read_dir(&temporary).unwrap().collect();
        assert!(left.is_empty(), "{how:?}: {left:?}");
    }
}

#[test]
fn results_are_written() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (csv, svg, table) = (file("sub/out.csv"), file("out.svg"), file("in.csv"));
    std::fs::write(&table, "time,PmsmPlant.tau_load\n0,0\n0.01,-1\n").unwrap();
    let plant = archive("fmi3", "PmsmPlant");
    let arguments = ["simulate", plant.to_str().unwrap(), "--input", &table, "--csv", &csv, "--plot", &svg];
    let output = fmu(&[&arguments[..], &["--stop", "0.02", "--record", "PmsmPlant.speed,PmsmPlant.tau_load"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("rpm"), "the final values have display units");
    let csv = std::fs::read_to_string(csv).unwrap();
    assert!(csv.lines().nth(51).unwrap().ends_with(",-0.5"), "{csv}");
    assert!(std::fs::read_to_string(svg).unwrap().starts_with("<svg"));
}
