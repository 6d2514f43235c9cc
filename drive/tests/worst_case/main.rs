//! The longest step of the controller and of `PmsmDrive`, for users with a real-time target: instructions by callgrind, which are
//! repeatable, and times. A count above `tests/golden/worst_case.csv` by more than 1 % fails; `UPDATE_GOLDEN=1` writes the file.
#![allow(missing_docs, non_snake_case)]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

mod cases;
#[path = "../tuned/mod.rs"]
mod tuned;

use cases::{Case, cases};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Steps of a scenario that are counted one by one: of longer scenarios, those that take the longest time.
const COUNTED: usize = 4000;
/// Runs of a scenario: the time of a step is the least of them.
const ROUNDS: u32 = 5;
/// Marks the line with the times in the output of a process.
const TIMES: &str = "times: ";

fn case(name: &str) -> Case {
    cases().into_iter().find(|case| case.name == name).unwrap()
}

/// The process that is measured: under callgrind with a list of the counted steps, or alone with nothing.
#[test]
#[ignore = "started by the test below"]
fn subject() {
    let Ok(name) = std::env::var("WORST_CASE_OF") else { return };
    if let Ok(counted) = std::env::var("WORST_CASE_COUNTED") {
        let counted: Vec<u32> = counted.split_whitespace().map(|k| k.parse().unwrap()).collect();
        let mut case = case(&name);
        for k in 0..case.steps {
            (case.step)(k, counted.is_empty() || counted.binary_search(&k).is_ok());
        }
        return;
    }
    let mut times = vec![f64::MAX; case(&name).steps as usize];
    for _ in 0..ROUNDS {
        let mut case = case(&name);
        for (k, least) in (0..).zip(&mut times) {
            *least = least.min((case.step)(k, true));
        }
    }
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by(|&a, &b| times[b].total_cmp(&times[a]));
    // All steps but one of 10,000 are as fast as the first of these, and all as fast as the second.
    let [most, all] = [times.len() / 10_000, 0].map(|n| times[order[n]]);
    order.truncate(COUNTED);
    order.sort_unstable();
    println!("{TIMES}{most:e} {all:e} {}", order.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "));
}

/// What `program` with these arguments writes when it runs a scenario.
fn run(name: &str, program: &[&str], counted: Option<&str>) -> String {
    let mut command = Command::new(program[0]);
    command.args(&program[1..]).arg(std::env::current_exe().unwrap());
    command.args(["subject", "--exact", "--ignored", "--test-threads=1", "--nocapture"]).env("WORST_CASE_OF", name);
    if let Some(counted) = counted {
        command.env("WORST_CASE_COUNTED", counted);
        // The C library of any processor copies alike.
        command.env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-AVX2_Usable,-AVX512F,-AVX512VL,-ERMS,-FSRM");
    }
    let output = command.output().unwrap();
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    assert!(output.status.success(), "{name}: {said}");
    said
}

/// Instructions of each step in the output of callgrind, which has a part per step: those of its call, because other threads of the
/// process run meanwhile.
fn parts(text: &str) -> Vec<u64> {
    let mut lines = text.lines();
    let mut counts = Vec::new();
    while let Some(line) = lines.next() {
        if line.starts_with("cfn=") && line.contains("counted_step") {
            // Below the number of calls: position and count.
            counts.push(lines.nth(1).unwrap().split_once(' ').unwrap().1.parse().unwrap());
        }
    }
    counts
}

/// Figures of a scenario: mean and maximum number of instructions of a step, the number of the step with the maximum, times in us of
/// 99.99 % of the steps and of all.
fn measure(case: &Case, out: &Path) -> (f64, u64, u32, [f64; 2]) {
    let name = &case.name;
    let times = run(name, &["taskset", "-c", "1"], None);
    let mut times = times.lines().find_map(|line| line.split_once(TIMES)).unwrap().1.splitn(3, ' ');
    let [most, all] = [times.next(), times.next()].map(|time| 1e6 * time.unwrap().parse::<f64>().unwrap());
    let counted = times.next().unwrap();
    let file = format!("--callgrind-out-file={}", out.display());
    let callgrind = ["valgrind", "--tool=callgrind", &file];
    let sum = run(name, &[&callgrind[..], &["--toggle-collect=*counted_step*"]].concat(), Some(""));
    let sum: f64 = sum.lines().find_map(|line| line.split_once("Collected : ")).unwrap().1.trim().parse().unwrap();
    let each = ["--combine-dumps=yes", "--compress-strings=no", "--dump-before=*step_end*"];
    run(name, &[&callgrind[..], &each].concat(), Some(counted));
    let counts = parts(&fs::read_to_string(out).unwrap());
    fs::remove_file(out).unwrap();
    let steps: Vec<u32> = counted.split(' ').map(|k| k.parse().unwrap()).collect();
    assert_eq!(counts.len(), steps.len(), "{name}");
    let (max, step): (u64, u32) = counts.into_iter().zip(steps).max_by_key(|(count, _)| *count).unwrap();
    (sum / f64::from(case.steps), max, step, [most, all])
}

#[test]
#[ignore = "a minute under callgrind"]
fn the_longest_step_is_within_its_budget() {
    for tool in ["valgrind", "taskset"] {
        if !Command::new(tool).arg("--version").output().is_ok_and(|output| output.status.success()) {
            println!("skipped: there is no {tool}");
            return;
        }
    }
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/worst_case.csv");
    let text = fs::read_to_string(&golden).unwrap_or_default();
    let budgets: BTreeMap<&str, Vec<&str>> = text
        .lines()
        .skip(1)
        .filter_map(|line| Some((line.split(',').next()?, line.splitn(7, ',').skip(1).collect())))
        .collect();
    let (mut table, mut above) =
        (String::from("scenario,mean,max,step,us of 99.99 %,us of all,reason of the maximum\n"), Vec::new());
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("worst_case.out");
    for case in cases() {
        let (mean, max, step, [most, all]) = measure(&case, &out);
        let budget = budgets.get(case.name.as_str());
        let reason = budget.map_or("", |budget| budget[5]);
        let line = format!("{},{mean:.0},{max},{step},{most:.2},{all:.2},{reason}", case.name);
        println!("{line}");
        table += &(line + "\n");
        #[expect(clippy::cast_precision_loss, reason = "thousands")]
        for (is, k) in [(mean, 0), (max as f64, 1)] {
            let allowed: f64 = budget.map_or(0.0, |budget| budget[k].parse().unwrap());
            if is > 1.01 * allowed {
                above.push(format!("{}: {is:.0} instead of {allowed}", case.name));
            }
        }
    }
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        return fs::write(golden, table).unwrap();
    }
    assert!(above.is_empty(), "{}", above.join("\n"));
}
