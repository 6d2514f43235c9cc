//! `fmu sweep`: the same bytes whatever happens, and one clear line for what is wrong.
#![allow(missing_docs)]
#![cfg(unix)]

mod common;

use fmu::commands::build::{self, Build};
use fmu_sweep::{Definition, Plan, Sweep};
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn fmu() -> Command {
    Command::new(env!("CARGO_BIN_EXE_fmu"))
}

/// A folder for one test.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A file of a sweep of the drive.
    fn define(&self, name: &str, text: &str) -> PathBuf {
        let drive = common::archives().join("fmi3/PmsmDrive.fmu");
        let text = format!("fmus = ['d={}']\n{text}", drive.display());
        fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    fn sweep(&self, file: &Path, out: &str) -> Command {
        let mut command = fmu();
        command.arg("sweep").arg(file).arg("--out").arg(self.path(out)).stdin(Stdio::null());
        command
    }

    /// All files of the results that may not differ, with their bytes.
    fn results(&self, out: &str) -> Vec<(String, Vec<u8>)> {
        let results = |name: &str| name == "results.csv" || name.starts_with("part-");
        let mut all: Vec<_> = names(&self.path(out)).into_iter().filter(|name| results(name)).collect();
        all.sort();
        all.into_iter().map(|name| (name.clone(), fs::read(self.path(out).join(name)).unwrap())).collect()
    }

    fn rows(&self, out: &str) -> Vec<String> {
        let text = fs::read_to_string(self.path(out).join("results.csv")).unwrap();
        text.lines().skip(1).map(str::to_owned).collect()
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).map(|all| all.map(|e| e.unwrap().file_name().into_string().unwrap()).collect());
    entries.unwrap_or_default()
}

/// Runs to the end; returns standard error.
fn ends(command: &mut Command, status: i32) -> String {
    let Output { status: found, stderr, stdout } = command.output().unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert_eq!(found.code(), Some(status), "{command:?}: {said}{}", String::from_utf8_lossy(&stdout));
    said
}

/// 400 starts in 40 parts, about 1 s of work.
const STARTS: &str = "stop = 0.4\nstep = 1e-3\ninput.'d.speed_ref' = '0:0,0.05:104.72'\n\
    design = { kind = 'sobol', runs = 400, seed = 7, part = 10 }\n\
    [vary]\n'd.plant.motor.R_s' = { normal = [3.0, 0.15], within = [2.5, 3.5] }\n\
    'd.controller.motor.R_s' = { same = 'd.plant.motor.R_s', times = 0.9 }\n\
    'd.tau_load' = { values = [0, 0.5, 1] }\n\
    [measure]\npeak = { of = 'd.speed', is = 'max' }\nlast = { of = 'd.speed', is = 'final' }\n\
    error = { of = 'd.theta_est - d.theta_e', wrap = '2pi', is = 'rms', after = 0.005 }\n";

#[test]
fn a_killed_sweep_resumes_to_the_same_bytes() {
    let folder = Folder::new();
    let file = folder.define("starts.toml", STARTS);
    let temporary = folder.path("tmp");
    fs::create_dir(&temporary).unwrap();
    assert_eq!(ends(folder.sweep(&file, "whole").args(["--jobs", "1"]), 0), "");
    let whole = folder.results("whole");
    assert_eq!(whole.len(), 41);

    let parts = |out: &str| names(&folder.path(out)).iter().filter(|name| name.starts_with("part-")).count();
    let mut kills = 0;
    let start = || -> Child {
        let mut command = folder.sweep(&file, "killed");
        command.args(["--jobs", "2"]).env("TMPDIR", &temporary).stderr(Stdio::null()).stdout(Stdio::null());
        command.spawn().unwrap()
    };
    let kill = |child: &mut Child| {
        child.kill().unwrap();
        child.wait().unwrap();
        for (name, bytes) in folder.results("killed") {
            let expected = whole.iter().find(|(other, _)| *other == name);
            assert!(expected.is_some_and(|(_, expected)| *expected == bytes), "half a part: {name}");
        }
        assert_eq!(names(&temporary), [""; 0], "a kill leaves nothing");
    };
    let mut child = start();
    let begun = Instant::now();
    while parts("killed") < 3 {
        assert!(begun.elapsed() < Duration::from_secs(60) && child.try_wait().unwrap().is_none(), "no parts");
        std::thread::sleep(Duration::from_millis(1));
    }
    kill(&mut child);
    let there = parts("killed");
    assert!((3..40).contains(&there), "{there}");

    // Again and again, for longer each time, so that even a machine with no time to spare gets ahead.
    let mut patience = Duration::from_millis(50);
    loop {
        let mut child = start();
        std::thread::sleep(patience);
        patience = patience * 5 / 4;
        match child.try_wait().unwrap() {
            Some(status) => {
                assert!(status.success());
                break;
            }
            None => kill(&mut child),
        }
        kills += 1;
        assert!(begun.elapsed() < Duration::from_secs(120), "does not end");
    }
    println!("{there} parts at the first kill, {kills} more kills");
    assert_eq!(folder.results("killed"), whole);
    assert!(
        !names(&folder.path("killed")).iter().any(|name| name.starts_with('.')),
        "{:?}",
        names(&folder.path("killed"))
    );
    let said = ends(&mut folder.sweep(&file, "killed"), 0);
    assert!(said.contains("note: 40 of 40 parts are there already"), "{said}");

    // The first kill alone, to see what is said.
    for part in 5..40 {
        fs::remove_file(folder.path("killed").join(format!("part-{part:08}.csv"))).unwrap();
    }
    fs::write(folder.path("killed/.running-1"), "").unwrap();
    let said = ends(&mut folder.sweep(&file, "killed"), 0);
    assert!(said.contains("note: 5 of 40 parts are there already"), "{said}");
    assert!(said.contains("note: an earlier process ended in the middle; if an FMU crashes, --isolate"), "{said}");
    assert_eq!(folder.results("killed"), whole);
}

#[test]
fn jobs_processes_and_a_program_give_the_same_bits() {
    let folder = Folder::new();
    let file = folder.define("starts.toml", STARTS);
    ends(folder.sweep(&file, "two").args(["--jobs", "2"]), 0);
    let two = folder.results("two");
    // Three processes on one folder, each with a third of the parts.
    let third =
        |k: u32| folder.sweep(&file, "thirds").args(["--jobs", "1", "--part", &format!("{k}/3")]).spawn().unwrap();
    let all = [0, 1, 2].map(third);
    assert!(all.into_iter().all(|mut child| child.wait().unwrap().success()));
    assert_eq!(folder.results("thirds"), two);
    ends(folder.sweep(&file, "isolated").args(["--isolate", "--jobs", "2"]), 0);
    assert_eq!(folder.results("isolated"), two);
    let said = ends(folder.sweep(&file, "limited").args(["--limit", "25"]), 0);
    assert!(said.contains("30 rows done; 37 parts are missing"), "{said}");
    let csv = folder.path("copy.csv");
    ends(folder.sweep(&file, "limited").arg("--csv").arg(&csv), 0);
    assert_eq!((folder.results("limited"), fs::read(csv).unwrap()), (two.clone(), two[40].1.clone()));

    // A program, and the table of a program.
    let sweep = Sweep::open(&file).unwrap();
    let go_on = |_| ControlFlow::Continue(());
    let outcomes = sweep.run(100, 300, 2, &go_on).unwrap();
    let plan = Plan::new(sweep.definition(), Path::new("")).unwrap();
    let variables = plan.bind(sweep.rows().names()).unwrap();
    let mut columns = vec![Vec::new(); 3];
    let mut values = Vec::new();
    for row in 100..400 {
        sweep.rows().row(row, &mut values);
        columns.iter_mut().zip(&values).for_each(|(column, x)| column.push(*x));
    }
    let slices: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    assert_eq!(plan.run_many(&variables, &slices, 1, &go_on).unwrap(), outcomes);
    let named: Vec<String> = sweep.columns().into_iter().map(|column| column.name).collect();
    assert_eq!(named[4..], ["peak", "last", "error", "end", "error_"], "the measure has the name of a column");
    let rows = folder.rows("two");
    for k in 0..300 {
        let cells: Vec<f64> = rows[100 + k].split(',').take(8).map(|cell| cell.parse().unwrap()).collect();
        let inputs = [columns[0][k], columns[1][k], columns[2][k]];
        let found = [outcomes.measures[0][k], outcomes.measures[1][k], outcomes.measures[2][k], outcomes.end[k]];
        assert_eq!(cells[1..], [&inputs[..], &found[..]].concat(), "row {k}");
    }

    // `fmu simulate` of three rows.
    for k in [0, 57, 399] {
        let cells: Vec<&str> = rows[k].split(',').collect();
        let mut simulate = fmu();
        simulate.args(["simulate", &sweep.definition().fmus[0], "--stop", "0.4", "--step", "1e-3", "--csv", "-"]);
        simulate.args(["--input", "d.speed_ref=0:0,0.05:104.72", "--record", "d.speed,d.theta_est,d.theta_e"]);
        for (name, value) in sweep.rows().names().zip(&cells[1..]) {
            simulate.args(["--set", &format!("{name}={value}")]);
        }
        let Output { status, stdout, .. } = simulate.output().unwrap();
        assert!(status.success());
        let text = String::from_utf8(stdout).unwrap();
        let points: Vec<Vec<f64>> =
            text.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
        let peak = points.iter().map(|p| p[1]).fold(f64::NAN, f64::max);
        let wrapped = |x: f64| x - std::f64::consts::TAU * (x / std::f64::consts::TAU).round();
        let squares: Vec<f64> =
            points.iter().filter(|p| p[0] > 0.00499).map(|p| wrapped(p[2] - p[3])).map(|x| x * x).collect();
        #[expect(clippy::cast_precision_loss, reason = "some hundreds")]
        let rms = (squares.iter().copied().reduce(|a, b| a + b).unwrap() / squares.len() as f64).sqrt();
        let found: Vec<f64> = cells[4..8].iter().map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(found, [peak, points.last().unwrap()[1], rms, 0.4], "row {k}");
    }
}

#[test]
fn a_bad_row_is_a_row_with_its_error() {
    let folder = Folder::new();
    let list = |name: &str, resistances: &str| {
        fs::write(folder.path(&format!("{name}.csv")), format!("d.plant.motor.R_s,d.tau_load\n{resistances}")).unwrap();
        folder.define(
            &format!("{name}.toml"),
            &format!(
                "stop = 0.02\nstep = 1e-3\ndesign = {{ kind = 'list', file = '{name}.csv', part = 4 }}\n\
                 [measure]\npeak = {{ of = 'd.speed', is = 'max_abs' }}\ni = {{ of = 'd.i_d', is = 'mean' }}\n"
            ),
        )
    };
    let good = list("good", "3,0\n3.1,0\n3.2,0\n3.3,0\n");
    assert_eq!(ends(&mut folder.sweep(&good, "good"), 0), "");
    let bad = list("bad", "3,0\n-1,0\n3.1,0\nNaN,0\n3.2,0\n3,1e308\n3.3,0\n1e308,0\n");
    let said = ends(&mut folder.sweep(&bad, "bad"), 1);
    let (good, bad) = (folder.rows("good"), folder.rows("bad"));
    println!("{said}{}", bad.join("\n"));
    assert!(said.contains("of 8 rows failed") && said.lines().count() == 4, "{said}");
    assert!(said.contains("row 1: d: fmi3SetFloat64 returned Error: d.plant.motor.R_s = -1: "), "{said}");
    let rest = |line: &String| line.split_once(',').unwrap().1.to_owned();
    let same: Vec<String> = [0, 2, 4, 6].map(|k| rest(&bad[k])).to_vec();
    assert_eq!(same, good.iter().map(rest).collect::<Vec<_>>());
    for (k, part) in [(1, "R_s = -1"), (3, "R_s = NaN"), (5, "1e308"), (7, "")] {
        let cells: Vec<&str> = bad[k].splitn(7, ',').collect();
        assert!((&cells[3..5], cells[6].is_empty()) == (&["", ""][..], false), "measures of a failing row: {cells:?}");
        assert!(bad[k].contains(part), "{part}: {}", bad[k]);
    }
    let isolated = ends(folder.sweep(&folder.path("bad.toml"), "isolated").arg("--isolate"), 1);
    assert_eq!((isolated, folder.rows("isolated")), (said, bad));
}

#[test]
fn what_can_be_known_before_the_first_run_is_told_before_it() {
    let folder = Folder::new();
    let design = "stop = 0.01\ndesign = { kind = 'random', runs = 4 }\n";
    let measure = "[measure]\nm = { of = 'd.speed', is = 'final' }\n";
    let vary = |text: &str| format!("{design}[vary]\n{text}\n{measure}");
    let good = "'d.plant.motor.R_s' = { uniform = [2, 3] }";
    for (text, part) in [
        (vary("'d.motor.R' = { uniform = [2, 3] }"), "d: PmsmDrive has no variable motor.R"),
        (vary("'x.R' = { uniform = [2, 3] }"), "x.R: is not INSTANCE.VARIABLE; the instances are d"),
        (vary("'d.speed' = { uniform = [2, 3] }"), "d.speed: is continuous output and takes no value"),
        (vary("'d.controller.estimator' = { values = ['Rasmusen'] }"), "Rasmusen is not one of Rasmussen"),
        (vary(&format!("{good}\n[set]\n'd.plant.motor.R_s' = 3")), "R_s is set for all runs and varied"),
        (vary("'d.tau_load' = { uniform = [0, 1] }\n[input]\n'd.tau_load' = '0:1'"), "d.tau_load: is fed by"),
        (vary(&format!("{good}\n[set]\n'd.plant.motor.R_s' = -3")), "R_s = -3"),
        (vary(good).replace("runs = 4", "runs = 0"), "it has no rows"),
        (vary(good).replace("stop = 0.01", "stop = 0.01\nstep = 0"), "step 0 be positive"),
        (vary(good).replace("d.speed'", "d.spede'"), "d: PmsmDrive has no variable spede"),
        (vary(good).replace("d.speed'", "d.speed d.i_d'"), "\"d.i_d\" is not expected"),
        (vary(good).replace("'final'", "'final', after = 2"), "m: after = 2 s, expected a time from 0 to 0.01 s"),
        (vary(good).replace("\nm =", "\n'd.plant.motor.R_s' ="), "is the name of a varied variable"),
        (format!("{design}[vary]\n{good}\n"), "nothing is measured"),
        (measure.into(), "expected a table [design]"),
        (vary(good).replace("[vary]", "[varied]"), "line 4: unknown field `varied`"),
        (vary(good).replace("random", "list").replace("runs = 4", "file = 'no.csv'"), "no.csv: No such file"),
        (vary(good).replace("stop =", "connect = [['d.speed', 'd.angle']]\nstop ="), "d.angle: is not an input"),
    ] {
        let file = folder.define("bad.toml", &text);
        let said = ends(folder.sweep(&file, "bad").env("RUST_BACKTRACE", "1"), 2);
        assert!(said.contains(part) && said.starts_with("error: ") && said.lines().count() == 1, "{part}: {said}");
        assert!(!folder.path("bad").exists(), "{part}");
    }
    let said = ends(&mut folder.sweep(&folder.path("none.toml"), "bad"), 2);
    assert!(said.contains("none.toml: No such file"), "{said}");
    fs::write(folder.path("none.toml"), "fmus = ['none.fmu']").unwrap();
    let said = ends(&mut folder.sweep(&folder.path("none.toml"), "bad"), 2);
    assert!(said.contains("none.fmu: No such file"), "{said}");
}

#[test]
fn a_row_that_crashes_is_one_row() {
    let folder = Folder::new();
    let out = Some(folder.path("fmu"));
    let archives = build::run(&Build { package: Some("faulty-fmu".into()), out, ..Build::default() }).unwrap();
    // n = 1234567 aborts: fmu-export/tests/common/model.rs.
    fs::write(folder.path("rows.csv"), "p.n\n1\n2\n1234567\n3\n4\n5\n1234567\n6\n7\n8\n").unwrap();
    let text = format!(
        "fmus = ['p={}']\nstop = 1\ndesign = {{ kind = 'list', file = 'rows.csv', part = 5 }}\n\
         [measure]\nx = {{ of = 'p.x', is = 'final' }}\n",
        archives[0].display()
    );
    fs::write(folder.path("crash.toml"), text).unwrap();
    let file = folder.path("crash.toml");
    let died = |said: &Output| std::os::unix::process::ExitStatusExt::signal(&said.status) == Some(6);
    let first = folder.sweep(&file, "out").output().unwrap();
    let again = folder.sweep(&file, "out").output().unwrap();
    assert!(died(&first) && died(&again), "{first:?} {again:?}");
    let said = String::from_utf8(again.stderr).unwrap();
    assert!(said.contains("an earlier process ended in the middle; if an FMU crashes, --isolate"), "{said}");
    let said = ends(folder.sweep(&file, "out").args(["--isolate", "--jobs", "2"]), 1);
    assert!(said.contains("row 2: killed by SIGABRT") && said.contains("2 of 10 rows failed"), "{said}");
    let rows = folder.rows("out");
    assert_eq!(
        (rows[2].as_str(), rows[6].as_str()),
        ("2,1234567,,,killed by SIGABRT", "6,1234567,,,killed by SIGABRT")
    );
    assert!([0, 1, 3, 4, 5, 7, 8, 9].iter().all(|k: &usize| rows[*k].ends_with(",1,")), "{rows:?}");
    assert_eq!(rows.len(), 10);
}

#[test]
fn another_sweep_does_not_go_on_in_the_same_folder() {
    let folder = Folder::new();
    let copy = folder.path("drive.fmu");
    fs::copy(common::archives().join("fmi3/PmsmDrive.fmu"), &copy).unwrap();
    let text = STARTS.replace("stop = 0.4", "stop = 0.01").replace("runs = 400", "runs = 40");
    let define = |text: &str| {
        fs::write(folder.path("a.toml"), format!("fmus = ['d=drive.fmu']\n{text}")).unwrap();
        folder.path("a.toml")
    };
    let file = define(&text);
    ends(&mut folder.sweep(&file, "out"), 0);
    let before = folder.results("out");
    for (other, part) in [
        (text.replace("seed = 7", "seed = 8"), "definition.design.seed is 7 there and 8 here"),
        (text.replace("runs = 40", "runs = 50"), "definition.design.runs is 40 there and 50 here"),
        (text.replace("\nlast", "\nfinal"), "sweep.json: is of another sweep: "),
        (text.replace("stop = 0.01", "stop = 0.02"), "definition.stop is 0.01 there and 0.02 here"),
    ] {
        let said = ends(&mut folder.sweep(&define(&other), "out"), 2);
        assert!(said.contains(part) && said.contains("--restart") && said.lines().count() == 1, "{part}: {said}");
    }
    let file = define(&text);
    ends(folder.sweep(&file, "out").arg("--dry-run"), 0);
    let changed = |name: &str, bytes: Vec<u8>| (!name.ends_with("license.txt")).then_some(bytes);
    common::rewrite(&common::archives().join("fmi3/PmsmDrive.fmu"), &copy, changed);
    let said = ends(&mut folder.sweep(&file, "out"), 2);
    assert!(said.contains("files.drive.fmu.sha256 is \""), "{said}");
    assert_eq!(folder.results("out"), before, "finished rows are kept");
    assert_eq!(ends(folder.sweep(&file, "out").arg("--restart"), 0), "");
    assert_eq!(folder.results("out"), before, "the same model in another archive");
}

#[test]
fn a_full_disk_names_the_file_and_loses_no_part() {
    let folder = Folder::new();
    let text = STARTS.replace("stop = 0.4", "stop = 0.01");
    let file = folder.define("a.toml", &text);
    ends(&mut folder.sweep(&file, "whole"), 0);
    let sweep =
        |out: &Path| format!("'{}' sweep '{}' --out '{}'", env!("CARGO_BIN_EXE_fmu"), file.display(), out.display());
    // A disk of 64 KiB, where a process may have one of its own.
    let (disk, copy) = (folder.path("disk"), folder.path("copy"));
    fs::create_dir(&disk).unwrap();
    fs::create_dir(&copy).unwrap();
    let script = format!(
        "mount -t tmpfs -o size=64k none '{disk}' || exit 77; {run}; echo status $?; ls -a '{disk}' > '{copy}/ls'; \
         mount -o remount,size=4m '{disk}'; {run} || exit 1; cp '{disk}'/* '{copy}'",
        disk = disk.display(),
        copy = copy.display(),
        run = sweep(&disk),
    );
    match Command::new("unshare").args(["--user", "--map-root-user", "--mount", "sh", "-c", &script]).output() {
        Ok(Output { status, stdout, stderr }) if status.success() => {
            let said = String::from_utf8(stderr).unwrap();
            assert!(String::from_utf8(stdout).unwrap().contains("status 2"), "{said}");
            assert!(said.contains("error: ") && said.contains("disk/") && said.contains("No space left"), "{said}");
            assert!(said.contains("of 40 parts are there already"), "{said}");
            let half = fs::read_to_string(copy.join("ls")).unwrap();
            assert!(!half.contains(".part-") && half.contains("part-0"), "{half}");
            assert_eq!(folder.results("copy"), folder.results("whole"));
        }
        other => println!("no disk of one's own here: {other:?}"),
    }
}

#[test]
fn systems_of_several_fmus_and_ssp_files_are_swept() {
    let folder = Folder::new();
    let archives = common::archives().join("fmi2");
    let ssp = folder.path("drive.ssp");
    ends(fmu().args(["ssp", "--out"]).arg(&ssp), 0);
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
    let last = |line: &String, column: usize| line.split(',').nth(column).unwrap().to_owned();
    let of_pair: Vec<String> = folder.rows("pair").iter().map(|line| last(line, 5)).collect();
    let of_ssp: Vec<String> = folder.rows("ssp").iter().map(|line| last(line, 4)).collect();
    assert_eq!(of_pair, of_ssp);
    assert!(of_pair.windows(2).any(|w| w[0] != w[1]), "the rows differ: {of_pair:?}");
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

/// FMUs in C that forget to reset a state, end their binary by the status Fatal, print what they like, or can be there once.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn rude_fmus_run_as_well_as_polite_ones() {
    let folder = Folder::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let pack = |fault: &str| {
        let library = folder.path(&format!("{fault}.so"));
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-O1", "-w", "-fvisibility=hidden", &format!("-DFAULT_{fault}")]);
        ends(cc.arg(root.join("tests/check/fmu.c")).arg("-o").arg(&library).arg("-lm"), 0);
        let mut xml = fs::read_to_string(root.join("tests/check/fmu.xml")).unwrap();
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
    assert_eq!(said, "note: s can have one instance per process: rows run in processes, as with --isolate\n");
    assert_eq!(rows, polite);
    fs::remove_dir_all(folder.path("ONCE")).unwrap();
    assert_eq!(sweep("ONCE", &["--jobs", "1"], 0), (String::new(), polite));
}

/// What the documentation shows: the file of docs/sweeps.md and examples/sweep.toml, with fewer runs.
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
    assert_eq!(ends(&mut folder.sweep(&folder.path("example.toml"), "example"), 0), "");
    let error = |row: &String| row.split(',').nth(6).unwrap().parse::<f64>().unwrap();
    let lost = folder.rows("example").iter().filter(|row| error(row).abs() > std::f64::consts::FRAC_PI_2).count();
    println!("{lost} of 256 starts lost");
    assert!((1..20).contains(&lost), "{lost} of 256 starts lost");
}

/// A run of one period beside the model: reset, two values, initialization, end.
#[test]
fn a_run_costs_microseconds() {
    let drive = common::archives().join("fmi3/PmsmDrive.fmu");
    let text = format!(
        "fmus = ['d={}']\nstop = 1e-4\nstep = 1e-4\n[measure]\nx = {{ of = 'd.speed', is = 'final' }}",
        drive.display()
    );
    let plan = Plan::new(&Definition::parse(&text).unwrap(), Path::new("")).unwrap();
    let variables = plan.bind(["d.plant.motor.R_s", "d.tau_load"]).unwrap();
    let columns = [vec![3.0; 5000], vec![0.5; 5000]];
    let columns = [columns[0].as_slice(), columns[1].as_slice()];
    let once = || {
        let begun = Instant::now();
        let outcomes = plan.run_many(&variables, &columns, 1, &|_| ControlFlow::Continue(())).unwrap();
        assert!(outcomes.errors.iter().all(Option::is_none));
        begun.elapsed().as_secs_f64() / 5000.0
    };
    let best = (0..5).map(|_| once()).fold(f64::INFINITY, f64::min);
    println!("{:.2} us a run of one period", 1e6 * best);
    assert!(best < 50e-6, "{:.1} us", 1e6 * best);
}
