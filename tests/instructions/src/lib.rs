//! Instructions that the processor executes for a call, counted by callgrind: repeatable, unlike times. A count above its budget in
//! `golden/instructions.csv` by more than 1 % fails.
//!
//! A separate process runs a subject `n` times, another one 2 `n` times: their difference excludes the start of the process and the first
//! call. The native drive is compiled with the optimized test profile; the FMUs are the packed ones.
//!
//! It is a separate package because the other programs in `tests/` compile without optimization.
#![allow(missing_docs)]
#![cfg(all(test, target_os = "linux", target_arch = "x86_64"))]

#[allow(unreachable_pub, reason = "reachable in the other tests")]
#[path = "../../common/archives.rs"]
mod archives;
#[allow(dead_code, reason = "the benchmarks need more")]
#[path = "../../../benches/candidates/mod.rs"]
mod candidates;
#[allow(dead_code, reason = "its main")]
#[path = "../../../fmu-sweep/examples/sweep.rs"]
mod sweep;

use archives::archives;
use candidates::{PERIODS, POINTS, native, references, start, through_c, whole_drive};
use fmu_import::{Fmu, Kind};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

/// Name, number of calls to compare with twice as many, and calls of one of them. The first two are cheap enough for each build.
const SUBJECTS: [(&str, u32, u32); 7] = [
    ("period", 1, PERIODS),
    ("derivative", 20_000, 1),
    ("set_get", 20_000, 1),
    ("pair through C", 1, PERIODS),
    ("PmsmDrive", 1, PERIODS),
    ("sweep row", 2, 1),
    ("open", 2, 1),
];

fn file(name: &str) -> PathBuf {
    archives().join("fmi3").join(name).with_extension("fmu")
}

/// Runs a subject `n` times.
fn run(subject: &str, n: u32) {
    let (point, folder) = (POINTS[0], archives().join("fmi3"));
    let turns = |mut candidate: candidates::Candidate| (0..n).for_each(|_| (candidate.turn)());
    match subject {
        // Plant and controller.
        "period" => turns(native(point)),
        "pair through C" => turns(through_c(point, &folder, subject.into())),
        "PmsmDrive" => turns(whole_drive(point, &folder, subject.into(), &[])),
        // States, three voltages, the derivatives of four states.
        "derivative" => {
            let mut plant =
                Fmu::open(file("PmsmPlant")).unwrap().instantiate_as(Kind::ModelExchange, "p", false).unwrap();
            plant.setup(0.0, None).unwrap();
            plant.enter_initialization().unwrap();
            plant.exit_initialization().unwrap();
            plant.enter_continuous_time_mode().unwrap();
            let u = references(&plant, ["u_a", "u_b", "u_c"]);
            for k in 0..n {
                plant.set_continuous_states(&[0.16, 0.02, 30.0, f64::from(k) * 1e-6]).unwrap();
                plant.set_reals(&u, &[20.0, -5.0, -15.0]).unwrap();
                plant.get_derivatives(black_box(&mut [0.0; 4])).unwrap();
            }
        }
        // Three real numbers in, three out.
        "set_get" => {
            let mut plant = start(&folder, "PmsmPlant", &[]);
            let (u, i) = (references(&plant, ["u_a", "u_b", "u_c"]), references(&plant, ["i_a", "i_b", "i_c"]));
            for _ in 0..n {
                plant.set_reals(&u, &[20.0, -5.0, -15.0]).unwrap();
                plant.get_reals(&i, black_box(&mut [0.0; 3])).unwrap();
            }
        }
        "sweep row" => {
            let loads: Vec<f64> = (0..n).map(|k| 0.1 * f64::from(k)).collect();
            black_box(sweep::run(&file("PmsmDrive"), &loads).unwrap());
        }
        "open" => (0..n).for_each(|_| drop(Fmu::open(file("PmsmDrive")).unwrap())),
        _ => panic!("no subject {subject}"),
    }
}

/// The process under callgrind.
#[test]
#[ignore = "started by the tests below"]
fn subject() {
    let (name, n) = (std::env::var("INSTRUCTIONS_OF").unwrap(), std::env::var("INSTRUCTIONS_N").unwrap());
    run(&name, n.parse().unwrap());
}

/// Instructions of a process that runs the subject `n` times.
fn executed(subject: &str, n: u32) -> f64 {
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]).arg(std::env::current_exe().unwrap());
    valgrind.args(["subject", "--exact", "--ignored", "--test-threads=1"]);
    valgrind.env("INSTRUCTIONS_OF", subject).env("INSTRUCTIONS_N", n.to_string());
    // The C library of any processor copies alike.
    valgrind.env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-AVX2_Usable,-AVX512F,-AVX512VL,-ERMS,-FSRM");
    valgrind.env("FMU_TEST_ARCHIVES", archives());
    let output = valgrind.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{subject}: {said}");
    let count = said.lines().find_map(|line| line.split_once("Collected : ")).unwrap_or_else(|| panic!("{said}")).1;
    count.trim().parse().unwrap()
}

/// Compares these subjects with their budgets; `UPDATE_GOLDEN=1` writes the budgets.
fn check(subjects: &[(&str, u32, u32)]) {
    if !Command::new("valgrind").arg("--version").output().is_ok_and(|output| output.status.success()) {
        println!("skipped: there is no valgrind (apt install valgrind)");
        return;
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../golden/instructions.csv");
    let budgets = || std::fs::read_to_string(&file).unwrap();
    let text = budgets();
    let (mut counts, mut above) = (Vec::new(), Vec::new());
    for &(subject, n, calls) in subjects {
        let count = (executed(subject, 2 * n) - executed(subject, n)) / f64::from(n * calls);
        let line = text.lines().find(|line| line.split(',').next() == Some(subject)).expect(subject);
        let budget: f64 = line.split_once(',').unwrap().1.parse().unwrap();
        println!("{subject}: {count:.0} instructions, {:+.2} % of {budget}", 100.0 * (count / budget - 1.0));
        if count > 1.01 * budget {
            above.push(format!("{subject}: {count:.0} instructions, more than 1 % above {budget}"));
        }
        counts.push((line, format!("{subject},{count:.0}")));
    }
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        // The tests of this file run side by side.
        static WRITING: Mutex<()> = Mutex::new(());
        let _one = WRITING.lock().unwrap();
        let new = counts.iter().fold(budgets(), |text, (old, new)| text.replace(old, new));
        return std::fs::write(&file, new).unwrap();
    }
    assert!(
        above.is_empty(),
        "{above:#?}\nIf you meant to, UPDATE_GOLDEN=1 cargo test -p instructions writes the budgets"
    );
}

#[test]
fn the_cheapest_within_their_budgets() {
    check(&SUBJECTS[..2]);
}

#[test]
#[ignore = "under valgrind, a minute"]
fn the_others_within_their_budgets() {
    check(&SUBJECTS[2..]);
}
