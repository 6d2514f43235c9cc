//! One 10 kHz period of plant and controller: natively, through the C interface of both standards with its gets and sets, and 1
//! s of PmsmDrive; as a ratio to a loop written by hand in C (`c_period.c`), if a C compiler `cc` is available.
//!
//! The candidates take turns in one run, so that other load on the computer affects all of them; the figures are
//! medians. `PERIOD_BASELINE=DIR` adds the FMUs of another build from `DIR/fmi2` and `DIR/fmi3`. Then PmsmDrive with each effect of the
//! plant, as a ratio to the default drive.
#![allow(missing_docs)]

mod candidates;
#[path = "../tests/common/mod.rs"]
mod common;

use candidates::{Candidate, PERIODS, POINTS, Point, native, through_c, whole_drive};
use libloading::{Library, Symbol};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// Turns of each candidate.
const TURNS: usize = 61;

/// The loop in C as a library, or the reason why it could not be built.
fn c_loop() -> Result<Library, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (source, library) =
        (Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/c_period.c"), folder.join("c_period.so"));
    let mut cc = Command::new("cc");
    cc.args(["-O3", "-march=native", "-shared", "-fPIC", "-o"]).arg(&library).arg(source).arg("-lm");
    match cc.status() {
        Ok(status) if status.success() => {}
        Ok(status) => return Err(format!("cc: {status}")),
        Err(error) => return Err(format!("cc: {error}")),
    }
    // SAFETY: a library without initialization code, compiled above.
    unsafe { Library::new(library) }.map_err(|error| error.to_string())
}

fn c(point: Point, library: &'static Library) -> Candidate {
    // SAFETY: the type of the function in c_period.c.
    let periods: Symbol<unsafe extern "C" fn(i64, f64) -> f64> = unsafe { library.get(b"c_periods") }.unwrap();
    Candidate::new("C loop", move || {
        // SAFETY: the function works on its own static data, in this thread only.
        assert!(unsafe { periods(i64::from(PERIODS), point.speed) }.is_finite());
    })
}

const DEAD_TIME: [(&str, &str); 2] = [("plant.inverter.dead_time", "2e-6"), ("controller.compensation.u_dead", "6.5")];

const LOSSES: [(&str, &str); 8] = [
    ("plant.iron.G_e", "2.7e-4"),
    ("plant.iron.G_h", "0.127"),
    ("plant.winding.k_ac", "1e-7"),
    ("plant.mechanics.k_w", "1e-6"),
    ("plant.inverter.u_transistor", "0.9"),
    ("plant.inverter.r_transistor", "0.06"),
    ("plant.inverter.u_diode", "0.7"),
    ("plant.inverter.E_sw", "1e-3"),
];

/// The effects of the plant.
fn effects() -> Vec<(&'static str, Vec<(&'static str, &'static str)>)> {
    let thermal = [
        ("plant.thermal.mode", "2"),
        ("plant.thermal.C_winding", "100"),
        ("plant.thermal.C_stator", "1000"),
        ("plant.thermal.C_rotor", "500"),
        ("plant.thermal.C_inverter", "200"),
        ("plant.thermal.G_ws", "5"),
        ("plant.thermal.G_sc", "10"),
    ];
    vec![
        ("default", vec![]),
        ("saturation", vec![("plant.saturation.s_2", "2"), ("plant.saturation.s_dq", "1")]),
        ("dead time", DEAD_TIME.to_vec()),
        ("all losses", LOSSES.to_vec()),
        ("losses and dead time", [DEAD_TIME.as_slice(), LOSSES.as_slice()].concat()),
        ("temperatures", thermal.to_vec()),
        ("imposed shaft", vec![("plant.mechanics.imposed", "true"), ("speed_shaft", "104.7")]),
        ("field weakening", vec![("controller.weakening.use", "true")]),
    ]
}

fn measure(candidates: &mut [Candidate]) {
    // The first turns start the drive and warm the caches.
    for _ in 0..3 {
        for candidate in &mut *candidates {
            (candidate.turn)();
        }
    }
    for _ in 0..TURNS {
        for candidate in &mut *candidates {
            let start = Instant::now();
            (candidate.turn)();
            candidate.times.push(start.elapsed().as_secs_f64() * 1e9 / f64::from(PERIODS));
        }
    }
}

fn main() {
    let library = c_loop().inspect_err(|cause| println!("without the loop in C: {cause}")).ok();
    let library: Option<&'static Library> = library.map(|library| &*Box::leak(Box::new(library)));
    let mut builds = vec![(String::new(), common::archives().to_owned())];
    builds.extend(std::env::var_os("PERIOD_BASELINE").map(|folder| ("baseline ".to_owned(), folder.into())));
    for point in POINTS {
        let mut candidates = Vec::new();
        candidates.extend(library.map(|library| c(point, library)));
        candidates.push(native(point));
        for (build, folder) in &builds {
            for standard in ["fmi2", "fmi3"] {
                candidates.push(through_c(point, &folder.join(standard), format!("{build}pair, {standard}")));
            }
            candidates.push(whole_drive(point, &folder.join("fmi3"), format!("{build}PmsmDrive at 1 ms"), &[]));
        }
        measure(&mut candidates);
        let to = candidates[0].median();
        println!("\n{} with {} N.m: ns per period of 0.1 ms, ratio to {}", point.name, point.load, candidates[0].name);
        for candidate in &mut candidates {
            let median = candidate.median();
            println!("{:<28}{median:>7.0}{:>7.2}", candidate.name, median / to);
        }
    }
    let (mut candidates, point) = (Vec::new(), POINTS[0]);
    for (effect, settings) in effects() {
        for (build, folder) in &builds {
            candidates.push(whole_drive(point, &folder.join("fmi3"), format!("{build}{effect}"), &settings));
        }
    }
    measure(&mut candidates);
    let default = candidates[0].median();
    println!("\nPmsmDrive at {}: ns per period of 0.1 ms, ratio to the default drive", point.name);
    for candidate in &mut candidates {
        let median = candidate.median();
        println!("{:<32}{median:>7.0}{:>7.2}", candidate.name, median / default);
    }
}
