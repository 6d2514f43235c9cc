//! Bad rows, bad files, crashes, another definition, a full disk: one clear line, and no results are lost.

use crate::{Folder, STARTS, common, ends};
use fmu::commands::build::{self, Models};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

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
        (
            vary("'d.motor.R' = { uniform = [2, 3] }"),
            "d: has no variable motor.R; did you mean plant.motor.R_s or controller.motor.R_s?",
        ),
        (vary("'x.R' = { uniform = [2, 3] }"), "d: has no variable x.R"),
        (vary("'d.speed' = { uniform = [2, 3] }"), "d.speed: is continuous output and cannot be set"),
        (vary("'d.controller.estimator' = { values = ['Rasmusen'] }"), "Rasmusen is not one of Rasmussen"),
        (vary(&format!("{good}\n[set]\n'd.plant.motor.R_s' = 3")), "R_s is set for all runs and varied"),
        (vary("'d.tau_load' = { uniform = [0, 1] }\n[input]\n'd.tau_load' = '0:1'"), "d.tau_load: is fed by"),
        (vary(&format!("{good}\n[set]\n'd.plant.motor.R_s' = -3")), "R_s = -3"),
        (vary(good).replace("runs = 4", "runs = 0"), "it has no rows"),
        (vary(good).replace("stop = 0.01", "stop = 0.01\nstep = 0"), "step of 0 s must be positive"),
        (vary(good).replace("d.speed'", "d.spede'"), "d: has no variable spede; did you mean speed"),
        (vary(good).replace("d.speed'", "d.speed d.i_d'"), "\"d.i_d\" is not expected"),
        (vary(good).replace("'final'", "'final', after = 2"), "m: after = 2 s, expected a time from 0 to 0.01 s"),
        (vary(good).replace("\nm =", "\n'd.plant.motor.R_s' ="), "is the name of a varied variable"),
        (vary(good).replace("\nm =", "\nrun ="), "measure: run is the column with the number of each run: rename it"),
        (vary("run = { uniform = [0, 1] }"), "vary: run is the column with the number of each run: write INSTANCE.run"),
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
    let archives = build::models(&Models { package: vec!["faulty-fmu".into()], out, ..Models::default() }).unwrap();
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
    assert!(said.contains("an earlier process was interrupted; if an FMU crashes, --isolate"), "{said}");
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
    let text = STARTS.replace("stop = 0.4", "stop = 0.06").replace("runs = 400", "runs = 40");
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
        (text.replace("stop = 0.06", "stop = 0.07"), "definition.stop is 0.06 there and 0.07 here"),
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
    // A disk of 64 KiB, if mounting is allowed.
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
            assert!(said.contains("of 40 parts already exist"), "{said}");
            let half = fs::read_to_string(copy.join("ls")).unwrap();
            assert!(!half.contains(".part-") && half.contains("part-0"), "{half}");
            assert_eq!(folder.results("copy"), folder.results("whole"));
        }
        other => println!("no separate disk here: {other:?}"),
    }
}
