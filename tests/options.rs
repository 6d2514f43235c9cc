//! Every option of every command, in each of its modes, changes the behavior of the command or is refused with a message that
//! names it.
//!
//! The options are read from the command line parser: an option without a value here fails the test. A row of [`COMMANDS`] has
//! the values and the modes of a command. Each option is added to each mode; exit status, text and files are compared with a
//! run without it. An option that is part of a mode is taken away instead. `same` lists options without effect in a mode, with
//! the reason, and [`ELSEWHERE`] the options that another test covers.
#![allow(missing_docs)]

#[path = "common/mod.rs"]
mod common;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

struct Options {
    command: &'static str,
    /// Values of the options that take one.
    values: &'static [(&'static str, &'static str)],
    modes: &'static [Mode],
}

struct Mode {
    /// Arguments, in the folder of a run, which has the inputs in `in/`.
    line: &'static str,
    /// Options without effect in this mode, and the reason.
    same: &'static [(&'static str, &'static str)],
}

const SPEED: &str = "changes only the run time of the command";
const LIMIT: &str = "a limit that this run does not reach";
const CERTAIN: &str = "the only finding is certain";
const ACCURATE: &str = "the models have no tolerance";
const NO_EVENT: &str = "no event falls into this run";
const EQUAL: &str = "connects no two units, and both ways of a run give the same values";
const BEST: &str = "the delay that is found without it";
const START: &str = "the value without the option";

/// Options of `fmu bode` without effect on the responses.
const GUARDED: &[(&str, &str)] = &[
    ("jobs", SPEED),
    ("memory", LIMIT),
    ("sandbox", LIMIT),
    ("in-process", EQUAL),
    ("no-unit-conversion", EQUAL),
    ("tolerance", ACCURATE),
];

/// Options that need a compiler, a browser's module, Python or several minutes, with the test that shows their effect.
const ELSEWHERE: &[(&str, &str, &str)] = &[
    ("build", "target", "tests/targets.rs"),
    ("build", "package", "tests/own_fmu.rs"),
    ("build", "release_dir", "tests/targets.rs"),
    ("build", "dev", "tests/new.rs"),
    ("build", "keep_symbols", "fmu-pack/src/compile.rs"),
    ("page", "package", "tests/page.rs"),
    ("page", "site", "tests/page.rs"),
    ("prove", "python", "tests/prove.rs"),
    ("reproduce", "out", "tests/figures.rs"),
];

const COMMANDS: &[Options] = &[
    Options {
        command: "bode",
        values: &[
            ("which", "reference"),
            ("from", "speed_ref"),
            ("to", "tau_e"),
            ("over", "tau_e"),
            ("spring", "50,0.05,1.5e-3"),
            ("frequencies", "200"),
            ("amplitude", "0.03"),
            ("settle", "0.03"),
            ("step", "5e-5"),
            ("set", "tau_load=0.5"),
            ("input", "tau_load=0:0.5"),
            ("connect", "PmsmPlant.i_a=PmsmPlant.u_a"),
            ("terminal", "PmsmPlant.phases=PmsmPlant.sensor"),
            ("parameters", "PmsmPlant=in/plant.ssv"),
            ("solver", "rk4"),
            ("rtol", "1e-14"),
            ("tolerance", "1e-3"),
            ("timeout", "1e-9"),
            ("memory", "64"),
            ("jobs", "1"),
            ("csv", "other.csv"),
            ("plot", "bode.svg"),
            ("html", "bode.html"),
        ],
        modes: &[
            Mode {
                line: "in/PmsmPlant.fmu --from tau_load --to speed --frequencies 100 --settle 0.01 --step 2e-4 --csv out.csv",
                same: GUARDED,
            },
            Mode {
                line: "in/PmsmPlant.fmu --from tau_load --to speed --frequencies 100 --settle 0.01 --step 2e-4 --me --csv out.csv",
                same: GUARDED.split_at(5).0,
            },
            Mode {
                line: "in/PmsmDrive.fmu --loop impedance --frequencies 50,200 --settle 0.02 --csv out.csv",
                same: GUARDED,
            },
        ],
    },
    Options {
        command: "build",
        values: &[
            ("fmi", "2"),
            ("out", "other"),
            ("package", "own-fmu"),
            ("library", "x86_64-windows=in/lib.so"),
            ("resources", "in/resources"),
            ("target", "x86_64-pc-windows-gnu"),
            ("linux64", "aarch64"),
            ("release_dir", "release"),
            ("timeout", "1e-9"),
            ("memory", "64"),
        ],
        modes: &[
            Mode {
                line: "--library in/lib.so --out out",
                same: &[("memory", LIMIT), ("sandbox", LIMIT), ("in-process", EQUAL)],
            },
            Mode {
                line: "--library in/lib.so --out out --fmi 3",
                same: &[("memory", LIMIT), ("sandbox", LIMIT), ("in-process", EQUAL)],
            },
        ],
    },
    Options {
        command: "merge",
        values: &[("out", "other.fmu"), ("linux64", "aarch64")],
        modes: &[
            Mode { line: "in/PmsmPlant.fmu in/PmsmPlant.fmu --out out.fmu", same: &[] },
            Mode { line: "in/PmsmPlant2.fmu in/PmsmPlant2.fmu --out out.fmu", same: &[] },
        ],
    },
    Options {
        command: "simulate",
        values: &[
            ("connect", "c.u_a=p.u_a"),
            ("terminal", "p.phases=c.phases"),
            ("parameters", "d=in/drive.ssv"),
            ("set", "u_dc=300"),
            ("input", "u_dc=0:300"),
            ("start", "0.001"),
            ("stop", "0.02"),
            ("step", "0.0005"),
            ("record", "speed"),
            ("overlay", "in/earlier.csv"),
            ("replay", "in/none.calls"),
            ("csv", "out.csv"),
            ("plot", "out.svg"),
            ("html", "out.html"),
            ("solver", "rk4"),
            ("rtol", "1e-3"),
            ("tolerance", "1e-3"),
            ("timeout", "1e-9"),
            ("memory", "64"),
        ],
        modes: &[
            Mode {
                line: "d=in/PmsmDrive.fmu --set plant.initial.speed=10 --stop 0.01 --step 0.002 --csv -",
                same: &[
                    ("memory", LIMIT),
                    ("sandbox", LIMIT),
                    ("in-process", EQUAL),
                    ("no-unit-conversion", EQUAL),
                    ("tolerance", ACCURATE),
                ],
            },
            Mode {
                line: "d=in/PmsmDrive.fmu --set plant.initial.speed=10 --stop 0.01 --record speed --plot out.png",
                same: &[
                    ("memory", LIMIT),
                    ("sandbox", LIMIT),
                    ("in-process", EQUAL),
                    ("no-unit-conversion", EQUAL),
                    ("tolerance", ACCURATE),
                    ("me", "less than a pixel of the picture"),
                ],
            },
            Mode {
                line: "p=in/PmsmPlant.fmu c=in/SensorlessController.fmu --auto-connect --set c.speed_ref=10 --stop 0.002 --csv -",
                same: &[
                    ("memory", LIMIT),
                    ("sandbox", LIMIT),
                    ("in-process", EQUAL),
                    ("no-unit-conversion", EQUAL),
                    ("tolerance", ACCURATE),
                    ("event-mode", NO_EVENT),
                    ("early-return", NO_EVENT),
                ],
            },
            Mode {
                line: "d=in/PmsmDrive.fmu --me --stop 0.002 --csv -",
                same: &[
                    ("memory", LIMIT),
                    ("sandbox", LIMIT),
                    ("in-process", EQUAL),
                    ("no-unit-conversion", EQUAL),
                    ("rtol", "each interval between two samples is a step"),
                ],
            },
            Mode {
                line: "d=in/PmsmDrive.fmu --in-process --stop 0.01 --html out.html",
                same: &[("in-process", EQUAL), ("no-unit-conversion", EQUAL), ("tolerance", ACCURATE)],
            },
        ],
    },
    Options {
        command: "sweep",
        values: &[("out", "other"), ("jobs", "1"), ("part", "1/2"), ("limit", "1"), ("csv", "out.csv")],
        modes: &[
            Mode {
                line: "in/sweep.toml --out out",
                same: &[("jobs", SPEED), ("restart", "nothing is there yet"), ("isolate", "no FMU crashes")],
            },
            Mode { line: "in/sweep.toml --out out --dry-run", same: &[] },
        ],
    },
    Options {
        command: "check",
        values: &[
            ("format", "json"),
            ("confidence", "hint"),
            ("only", "I01n"),
            ("allow", "I01"),
            ("baseline", "in/known.toml"),
            ("write_baseline", "known.toml"),
            ("timeout", "0"),
            ("patience", "9"),
            ("memory", "64"),
            ("explain", "I01"),
            ("replay", "L06"),
        ],
        modes: &[
            Mode {
                line: "in/wrong.fmu --only terminals",
                same: &[
                    ("patience", LIMIT),
                    ("memory", LIMIT),
                    ("sandbox", LIMIT),
                    ("strict", "a must is violated"),
                    ("confidence", CERTAIN),
                ],
            },
            Mode {
                line: "in/wrong.fmu --only terminals --format html",
                same: &[
                    ("patience", LIMIT),
                    ("memory", LIMIT),
                    ("sandbox", LIMIT),
                    ("strict", "a must is violated"),
                    ("confidence", CERTAIN),
                ],
            },
            Mode {
                line: "in/PmsmPlant.fmu --replay L06",
                same: &[("patience", LIMIT), ("memory", LIMIT), ("sandbox", LIMIT)],
            },
            Mode { line: "--list", same: &[] },
            Mode { line: "--explain I01", same: &[] },
        ],
    },
    Options {
        command: "compare",
        values: &[("only", "DirectEmf"), ("scenario", "speed-steps"), ("out", "other")],
        modes: &[Mode { line: "--list", same: &[] }],
    },
    Options {
        command: "atlas",
        values: &[
            ("estimator", "VoltageModel"),
            ("scenario", "speed"),
            ("resistance", "0.9"),
            ("flux", "0.9"),
            ("load", "0.5"),
            ("speed", "0.02"),
            ("angle", "90"),
            ("every", "2"),
            ("inverter", "Switched"),
            ("set", "adaptation.k_a=0.02"),
            ("jobs", "1"),
            ("out", "other"),
        ],
        modes: &[Mode {
            line: "--resistance 1 --flux 1 --load 0,1 --speed 0.01 --angle 0 --scenario load --out out",
            same: &[
                ("jobs", SPEED),
                ("full", "every axis is given"),
                ("set", "the adaptation is off"),
                ("angle", START),
                ("scenario", START),
            ],
        }],
    },
    Options {
        command: "tune",
        values: &[
            ("out", "other"),
            ("fmu", "in/PmsmPlant.fmu"),
            ("estimator", "Rasmussen"),
            ("control", "torque"),
            ("shaft", "imposed"),
        ],
        modes: &[
            Mode { line: "in/motor.toml --out out", same: &[] },
            Mode { line: "in/motor.toml --json", same: &[] },
            Mode { line: "in/motor.toml --fmu in/SensorlessController.fmu --out out.fmu", same: &[] },
            Mode { line: "--example", same: &[] },
        ],
    },
    Options {
        command: "identify",
        values: &[
            ("run", "in/run.csv"),
            ("given", "psi_M=0.5"),
            ("out", "other.toml"),
            ("n_p", "4"),
            ("current", "20"),
            ("speed", "200"),
            ("torque", "9"),
            ("u_dc", "400"),
            ("delay", "1"),
            ("every", "2"),
            ("rate", "1000"),
            ("map", "u_a=Vph1"),
            ("unit", "theta=deg"),
            ("zero", "0:0.01"),
            ("load", "none"),
            ("html", "out.html"),
        ],
        modes: &[
            Mode { line: "in/bench.csv --n-p 3 --current 15 --delay 0 --every 5 --json", same: &[("delay", BEST)] },
            Mode {
                line: "in/bench.csv --n-p 3 --current 15 --delay 0 --every 5 --out out.toml",
                same: &[("delay", BEST)],
            },
        ],
    },
    Options {
        command: "map",
        values: &[
            ("out", "other"),
            ("u_dc", "300"),
            ("T", "80"),
            ("grid", "7x5"),
            ("verify", "1"),
            ("cycle", "in/cycle.csv"),
            ("vehicle", "in/vehicle.toml"),
        ],
        modes: &[Mode { line: "in/traction.toml --out out --grid 5x5 --verify 0", same: &[] }],
    },
    Options {
        command: "datasheet",
        values: &[("out", "other"), ("fmu", "in/MappedDrive.fmu")],
        modes: &[
            Mode { line: "in/sheet.toml --out out", same: &[] },
            Mode { line: "in/sheet.toml --json", same: &[] },
            Mode { line: "in/sheet.toml --fmu in/MappedDrive.fmu --out out.fmu", same: &[] },
            Mode { line: "--example", same: &[] },
        ],
    },
    Options {
        command: "ssp",
        values: &[
            ("fmi", "2"),
            ("fmus", "in/none"),
            ("motor", "in/motor.toml"),
            ("parameters", "plant=in/plant.ssv"),
            ("out", "other.ssp"),
        ],
        modes: &[
            Mode { line: "--fmus in --out out.ssp", same: &[] },
            Mode { line: "--fmus in --motor in/motor.toml --out out.ssp", same: &[] },
        ],
    },
    Options {
        command: "modelica",
        values: &[("name", "Other"), ("block", "Blocks.Drive"), ("motor", "in/motor.toml"), ("out", "other")],
        modes: &[Mode { line: "in/PmsmPlant2.fmu --out out", same: &[] }],
    },
    Options {
        command: "simulink",
        values: &[("step", "0.0005"), ("out", "other")],
        modes: &[Mode { line: "in/PmsmPlant2.fmu --out out", same: &[] }],
    },
    Options {
        command: "preset",
        values: &[
            ("set", "tau_load=1"),
            ("ssv", "in/plant.ssv"),
            ("motor", "in/motor.toml"),
            ("name", "Pump"),
            ("stimuli", "in/stimuli.csv"),
            ("out", "other.fmu"),
        ],
        modes: &[Mode { line: "in/PmsmPlant.fmu --set u_dc=300 --out out.fmu", same: &[] }],
    },
    Options {
        command: "page",
        values: &[("out", "other.html"), ("package", "own-fmu"), ("site", "site"), ("module", "in/other.wasm")],
        modes: &[],
    },
    Options { command: "prove", values: &[], modes: &[] },
    Options { command: "reproduce", values: &[], modes: &[] },
];

/// Results of a run: exit status, standard output, standard error, files.
#[derive(PartialEq)]
struct Left {
    status: Option<i32>,
    out: Vec<u8>,
    error: String,
    files: BTreeMap<PathBuf, Vec<u8>>,
}

fn files(folder: &Path, from: &Path, all: &mut BTreeMap<PathBuf, Vec<u8>>) {
    for entry in folder.read_dir().unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, from, all);
        } else {
            all.insert(path.strip_prefix(from).unwrap().into(), fs::read(&path).unwrap());
        }
    }
}

fn run(inputs: &Path, command: &str, arguments: &[String]) -> Left {
    let dir = tempfile::tempdir().unwrap();
    let copy = dir.path().join("in");
    copy_all(inputs, &copy);
    let mut fmu = Command::new(env!("CARGO_BIN_EXE_fmu"));
    fmu.arg(command).args(arguments).current_dir(dir.path()).env("SOURCE_DATE_EPOCH", "1700000000");
    // Outside a workspace, the default folder would cause a Cargo error.
    let output = fmu.env("CARGO_TARGET_DIR", "target").output().unwrap();
    fs::remove_dir_all(&copy).unwrap();
    // The log of a sweep has the time of day.
    fs::remove_file(dir.path().join("out/log.txt")).ok();
    let mut left = BTreeMap::new();
    files(dir.path(), dir.path(), &mut left);
    // The folder differs from run to run.
    let plain = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).replace(&dir.path().display().to_string(), "DIR");
    Left { status: output.status.code(), out: plain(output.stdout).into(), error: plain(output.stderr), files: left }
}

fn copy_all(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in from.read_dir().unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_all(&entry.path(), &target);
        } else if fs::hard_link(entry.path(), &target).is_err() {
            fs::copy(entry.path(), &target).unwrap();
        }
    }
}

/// The files that the modes name.
fn inputs(folder: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    let copy = |from: &str, to: &str| assert!(fs::copy(root.join(from), folder.join(to)).unwrap() > 0);
    for name in ["MappedDrive", "PmsmDrive", "PmsmPlant", "SensorlessController"] {
        let file = format!("{name}.fmu");
        fs::copy(common::archives().join("fmi3").join(&file), folder.join(&file)).unwrap();
    }
    fs::copy(common::archives().join("fmi2/PmsmPlant.fmu"), folder.join("PmsmPlant2.fmu")).unwrap();
    let plant = folder.join("PmsmPlant.fmu");
    common::rewrite(&plant, &folder.join("wrong.fmu"), |name, bytes| {
        let text = || String::from_utf8(bytes.clone()).unwrap().replacen("fmiVersion=\"3.0\"", "fmiVersion=\"3.7\"", 1);
        Some(if name == "terminalsAndIcons/terminalsAndIcons.xml" { text().into() } else { bytes })
    });
    // A small model: each mode of `fmu build` runs it.
    let stair = &common::packed::packed("examples/reference-fmus/stair", "stair", &folder.join("packed"))[1];
    let mut archive = zip::ZipArchive::new(fs::File::open(stair).unwrap()).unwrap();
    let platform = fmu_import::platform::Platform::host();
    let library = (0..archive.len()).find_map(|k| {
        let mut entry = archive.by_index(k).unwrap();
        let is_it = entry.name().unwrap().starts_with(&format!("binaries/{}/", platform.tuple()));
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut entry, &mut bytes).unwrap();
        is_it.then_some(bytes)
    });
    fs::write(folder.join("lib.so"), library.expect("a library for this computer")).unwrap();
    fs::create_dir(folder.join("resources")).unwrap();
    write("resources/table.txt", "1\n");
    let motor = fs::read_to_string(root.join("motors/reference.toml")).unwrap();
    write("motor.toml", &(motor + "\n[control]\nestimator = \"ExtendedEmf\"\n"));
    copy("src/commands/datasheet.toml", "sheet.toml");
    copy("motors/traction-63kw.toml", "traction.toml");
    copy("examples/bench.csv", "bench.csv");
    write("cycle.csv", "t,v\n0,0\n10,20\n20,0\n");
    let vehicle = fs::read_to_string(root.join("examples/vehicle/vehicle.toml")).unwrap();
    write("vehicle.toml", &vehicle.replacen("mass = 1300.0", "mass = 900.0", 1));
    write("known.toml", "[\"PmsmPlant, FMI 3.0\"]\nmust = [\"I01\"]\n");
    write("stimuli.csv", "time,tau_load\n0,0\n0.1,1\n");
    let ssv = |name: &str| {
        let value = std::iter::once((name, &drive_tools::tune::setting::Value::Real(1.0)));
        fmu::ssv::text_of("values", value)
    };
    write("plant.ssv", &ssv("motor.R_s"));
    write("drive.ssv", &ssv("plant.motor.R_s"));
    write("earlier.csv", "time,speed\n0,0\n0.01,5\n");
    write(
        "sweep.toml",
        "fmus = [\"d=PmsmDrive.fmu\"]\nstop = 0.002\nstep = 1e-3\n[design]\nkind = \"random\"\nruns = 4\nseed = 1\npart = 1\n[vary]\n\
         \"d.tau_load\" = { uniform = [0.0, 1.0] }\n[measure]\nspeed = { of = \"d.speed\", is = \"final\" }\n",
    );
}

/// The arguments with the option added, or removed if already present.
fn changed(line: &[String], option: &clap::Arg, value: Option<&str>) -> Vec<String> {
    let flag = format!("--{}", option.get_long().unwrap());
    let takes_value = option.get_action().takes_values();
    if let Some(at) = line.iter().position(|word| *word == flag) {
        let mut rest = line.to_vec();
        rest.drain(at..=at + usize::from(takes_value));
        return rest;
    }
    let value = takes_value.then(|| value.unwrap().to_owned());
    line.iter().cloned().chain([flag]).chain(value).collect()
}

#[test]
fn every_option_changes_something_or_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    inputs(dir.path());
    let mut tree = fmu::cli::line();
    tree.build();
    let mut cases: Vec<(&'static str, &'static Mode, clap::Arg, Option<&'static str>)> = Vec::new();
    let mut problems: Vec<String> = Vec::new();
    for command in tree.get_subcommands().filter(|c| !c.is_hide_set() && c.get_name() != "help") {
        let is_option = |a: &&clap::Arg| {
            a.get_long().is_some() && !a.is_hide_set() && !["help", "version"].contains(&a.get_id().as_str())
        };
        let options: Vec<clap::Arg> = command.get_arguments().filter(is_option).cloned().collect();
        if options.is_empty() {
            continue;
        }
        let name = command.get_name();
        let Some(row) = COMMANDS.iter().find(|row| row.command == name) else {
            problems.push(format!("fmu {name}: has options and no row in COMMANDS"));
            continue;
        };
        for option in options {
            let id = option.get_id().as_str();
            if ELSEWHERE.iter().any(|(c, o, _)| (*c, *o) == (name, id)) {
                continue;
            }
            let value = row.values.iter().find(|(of, _)| *of == id).map(|(_, value)| *value);
            if option.get_action().takes_values() && value.is_none() {
                problems.push(format!("fmu {name} --{id}: has no value in COMMANDS"));
                continue;
            }
            cases.extend(row.modes.iter().map(|mode| (row.command, mode, option.clone(), value)));
        }
    }
    assert!(cases.len() > 150, "{} cases", cases.len());
    let words = |mode: &Mode| mode.line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let without: Mutex<BTreeMap<(&str, &str), std::sync::Arc<Left>>> = Mutex::default();
    let (next, found) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let work = || {
        while let Some((command, mode, option, value)) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
            let known = without.lock().unwrap().get(&(*command, mode.line)).cloned();
            let before = known.unwrap_or_else(|| {
                let left = std::sync::Arc::new(run(dir.path(), command, &words(mode)));
                without.lock().unwrap().insert((command, mode.line), left.clone());
                left
            });
            let flag = format!("--{}", option.get_long().unwrap());
            let after = run(dir.path(), command, &changed(&words(mode), option, *value));
            let same = mode.same.iter().any(|(id, _)| *id == option.get_id().as_str() || format!("--{id}") == flag);
            let refused = after.status == Some(2) && before.status != Some(2);
            let parts = value.iter().flat_map(|value| value.split('=')).any(|part| after.error.contains(part));
            // Of three or more options that exclude each other, the command line names the one that excludes the others.
            let excludes = after.error.contains("cannot be used with one or more of the other specified arguments");
            let setting = flag.trim_start_matches("--").replace('-', "_");
            let names_it = parts || excludes || after.error.contains(&flag) || after.error.contains(&setting);
            let removed = words(mode).contains(&flag);
            let problem = match (same, *before == after) {
                (false, true) => "has no effect and is not refused".to_owned(),
                (true, false) => format!("is listed as having no effect but has one: {}", after.error),
                _ if refused && !names_it && !removed => {
                    format!("is refused by a message that does not name it: {}", after.error)
                }
                _ => continue,
            };
            found.lock().unwrap().push(format!("fmu {command} {} with {flag}: {problem}", mode.line));
        }
    };
    std::thread::scope(|scope| {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        (0..threads).for_each(|_| drop(scope.spawn(work)));
    });
    problems.extend(found.into_inner().unwrap());
    for (left, (command, line)) in without.lock().unwrap().iter().map(|(key, left)| (left, key)) {
        if ![Some(0), Some(1)].contains(&left.status) {
            problems.push(format!("fmu {command} {line}: {}", left.error));
        }
    }
    problems.sort();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}
