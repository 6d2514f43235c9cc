//! The same bytes after kills, and for threads, processes and programs.

use crate::{Folder, STARTS, ends, fmu, names};
use fmu_sweep::{Plan, Sweep};
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::time::{Duration, Instant};

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
    };
    let mut child = start();
    let begun = Instant::now();
    while parts("killed") < 3 {
        assert!(begun.elapsed() < Duration::from_mins(1) && child.try_wait().unwrap().is_none(), "no parts");
        std::thread::sleep(Duration::from_millis(1));
    }
    kill(&mut child);
    let there = parts("killed");
    assert!((3..40).contains(&there), "{there}");

    // Repeatedly, for longer each time, so that even a busy machine makes progress.
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
        assert!(begun.elapsed() < Duration::from_mins(2), "does not end");
    }
    println!("{there} parts at the first kill, {kills} more kills");
    assert_eq!(folder.results("killed"), whole);
    // An archive left half unpacked by a killed process is removed by the next one.
    assert_eq!(names(&temporary), [""; 0], "kills leave nothing");
    assert!(
        !names(&folder.path("killed")).iter().any(|name| name.starts_with('.')),
        "{:?}",
        names(&folder.path("killed"))
    );
    let said = ends(&mut folder.sweep(&file, "killed"), 0);
    assert!(said.contains("note: 40 of 40 parts already exist"), "{said}");

    // Only the first kill, to check the messages.
    for part in 5..40 {
        fs::remove_file(folder.path("killed").join(format!("part-{part:08}.csv"))).unwrap();
    }
    fs::write(folder.path("killed/.running-1"), "").unwrap();
    let said = ends(&mut folder.sweep(&file, "killed"), 0);
    assert!(said.contains("note: 5 of 40 parts already exist"), "{said}");
    assert!(said.contains("note: an earlier process was interrupted; if an FMU crashes, --isolate"), "{said}");
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
        columns.iter_mut().zip(&values).for_each(|(column, x)| column.push(x.real()));
    }
    let slices: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    assert_eq!(plan.run_many(&variables, &slices, 1, &go_on).unwrap(), outcomes);
    let named: Vec<String> = sweep.columns().into_iter().map(|column| column.name).collect();
    assert_eq!(named[4..], ["peak", "last", "angle", "end", "error"]);
    let rows = folder.rows("two");
    for k in 0..300 {
        let cells: Vec<f64> = rows[100 + k].split(',').take(8).map(|cell| cell.parse().unwrap()).collect();
        let inputs = [columns[0][k], columns[1][k], columns[2][k]];
        let [peak, last, angle] = [0, 1, 2].map(|m| outcomes.measures[m][k].real());
        let found = [peak, last, angle, outcomes.end[k]];
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
