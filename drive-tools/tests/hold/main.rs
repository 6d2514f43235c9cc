//! Conditions under which a tuned drive works, as measured at the plant: every machine of `motors/` with wrong resistances and
//! at wrong temperatures, in speed and torque mode, at 0.1 to 1 pu, compared with the same drive with a sensor.
//!
//! ```sh
//! cargo test --release -p drive-tools --test hold -- --ignored --nocapture                 # all machines, a table a machine
//! HOLD_ONLY=hub-36v cargo test --release -p drive-tools --test hold -- --ignored --nocapture     # machines with this in the name
//! HOLD_MACHINES=DIR ...      # the machine files of a folder, in addition
//! HOLD_CELLS=1 ...           # a line for each cell that is not held
//! HOLD_FIXED=1 ...      # without the adaptation of the resistance that `fmu tune` may choose
//! HOLD_SET=adaptation.resistance=true,speed_loop.bandwidth=40 ...     # other values of the controller
//! ```
//!
//! | of a cell | |
//! |---|---|
//! | held | in the last 2 s, speed (speed mode) or torque (torque mode) is that of the sensor, and nothing swings |
//! | lost | the estimate slipped by a turn, or its mean speed was 5 % of rated off the rotor's for 1 s, or both swing by 10 % of rated |
//! | off | neither held nor lost |
//! | said | `lock_lost` was 1 or more within 1 s of the loss, or a limit, or the warning of a torque that moves nothing, says why the drive is off |
//! | named | `fmu tune` says that the drive will not hold a start or a load at this speed, or that it cannot adapt to this winding |
//! | false | a held cell in which `lock_lost` was 1 or more, later than 1 s after the start |
#![allow(missing_docs, non_snake_case)]

mod cell;

use cell::{Cell, Outcome};
use drive_tools::queue;
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use drive_tools::tune::setting::{Tuned, Value};
use drive_tools::tune::{limits, trial};
use std::path::{Path, PathBuf};

/// Start angles of the trial whose notes count.
const ANGLES: u32 = 4;

/// The files of a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut all: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    all.retain(|path| path.extension().is_some_and(|end| end == "toml"));
    all.sort();
    all
}

/// The machines of this run.
fn machines() -> Vec<PathBuf> {
    let mut all = files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors"));
    if let Ok(more) = std::env::var("HOLD_MACHINES") {
        all.extend(files(Path::new(&more)));
    }
    let only = std::env::var("HOLD_ONLY").unwrap_or_default();
    all.retain(|path| path.to_string_lossy().contains(&only));
    all
}

/// The drive with the values of `HOLD_SET`.
fn changed(tuned: Tuned) -> Tuned {
    let set = std::env::var("HOLD_SET").unwrap_or_default();
    set.split(',').filter(|one| !one.is_empty()).fold(tuned, |tuned, one| {
        let (name, value) = one.split_once('=').unwrap_or_else(|| panic!("HOLD_SET: {one} is not NAME=VALUE"));
        let value = match (value.parse(), value.parse()) {
            (Ok(x), _) => Value::Real(x),
            (_, Ok(yes)) => Value::Boolean(yes),
            _ => Value::Item(value.into()),
        };
        tuned.with(name.to_owned().leak(), value)
    })
}

/// Counts of cells, for one machine or for all.
#[derive(Clone, Copy, Default)]
struct Count {
    held: usize,
    lost_and_said: usize,
    lost_and_silent: usize,
    off_and_said: usize,
    off_and_silent: usize,
    named: usize,
    /// Cells held with the sensor, and how many of these the drive holds.
    on_sensor: (usize, usize),
    /// Held cells in which `lock_lost` reached 1 after the start.
    false_alarms: usize,
}

impl Count {
    fn of(outcomes: &[(Cell, Outcome)], named: &Named) -> Self {
        let mut count = Self::default();
        for (cell, outcome) in outcomes {
            let announced = named.names(cell);
            let class = match outcome.class() {
                _ if outcome.held => &mut count.held,
                _ if outcome.said => {
                    if outcome.lost.is_some() {
                        &mut count.lost_and_said
                    } else {
                        &mut count.off_and_said
                    }
                }
                _ if announced => &mut count.named,
                Some(_) => &mut count.lost_and_silent,
                None if !outcome.on_sensor => &mut count.off_and_said,
                None => &mut count.off_and_silent,
            };
            *class += 1;
            if outcome.on_sensor && !announced {
                count.on_sensor.0 += 1;
                count.on_sensor.1 += usize::from(outcome.held);
            }
            count.false_alarms += usize::from(outcome.held && outcome.alarm);
        }
        count
    }

    fn add(&mut self, other: Self) {
        self.held += other.held;
        self.lost_and_said += other.lost_and_said;
        self.lost_and_silent += other.lost_and_silent;
        self.off_and_said += other.off_and_said;
        self.off_and_silent += other.off_and_silent;
        self.named += other.named;
        self.on_sensor.0 += other.on_sensor.0;
        self.on_sensor.1 += other.on_sensor.1;
        self.false_alarms += other.false_alarms;
    }

    fn print(&self, name: &str) {
        let Self { held, lost_and_said, lost_and_silent, off_and_said, off_and_silent, named, on_sensor, false_alarms } =
            self;
        println!(
            "{name:18} {held:5} {lost_and_said:6} {lost_and_silent:6} {off_and_said:6} {off_and_silent:6} {named:6}   {:5} of {:5}  {false_alarms:5}",
            on_sensor.1, on_sensor.0
        );
    }
}

/// The head of the table.
const HEAD: &str = "                          lost,  lost,   off,   off,         held of what         \n\
                    machine             held   said silent   said silent  named    a sensor holds  false";

/// The cells of a machine and their outcomes.
fn run(tuned: &Tuned, cells: &[Cell]) -> Vec<(Cell, Outcome)> {
    let mut sensor: Vec<Cell> = Vec::new();
    for cell in cells {
        if !sensor.iter().any(|other| other.has_the_truth_of(cell)) {
            sensor.push(*cell);
        }
    }
    let goals = queue::map(&sensor, |cell| cell::on_sensor(tuned, cell));
    let goal = |cell: &Cell| {
        let place = sensor.iter().position(|other| other.has_the_truth_of(cell)).expect("the truth of a cell");
        goals[place]
    };
    let outcomes = queue::map(cells, |cell| cell::run(tuned, cell, goal(cell)));
    cells.iter().copied().zip(outcomes).collect()
}

/// Conditions named by the notes of `fmu tune`.
struct Named {
    /// Speeds in pu at which the drive will not hold a start or a load.
    levels: Vec<f64>,
    /// The adaptation is left off: a winding that does not fit its data may lose its load.
    fixed: bool,
}

impl Named {
    fn of(motor: &MotorFile, tuned: &Tuned) -> Self {
        let trials = trial::all(tuned, ANGLES);
        let levels = limits::of(motor, tuned, &trials).0.iter().map(|limit| limit.level).collect();
        Self { levels, fixed: tuned.notes.iter().any(|note| note.starts_with("adaptation.resistance is left off")) }
    }

    fn names(&self, cell: &Cell) -> bool {
        let fits = cell.R.map_or((cell.T - 20.0).abs() < 1e-9, |R| (R - 1.0).abs() < 1e-9);
        self.levels.iter().any(|level| (level - cell.level).abs() < 1e-9) || (self.fixed && !fits)
    }
}

/// `cargo test --release -p drive-tools --test hold -- --ignored --nocapture`
#[test]
#[ignore = "thousands of runs of some seconds"]
fn held_or_said() {
    println!("{HEAD}");
    let (mut all, mut refused) = (Count::default(), Vec::new());
    for path in machines() {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let motor = MotorFile::read(&path);
        let tune = if std::env::var("HOLD_FIXED").is_ok() { rules::fixed } else { rules::tune };
        let (motor, tuned) = match motor.and_then(|motor| tune(&motor).map(|tuned| (motor, tuned))) {
            Ok(both) => both,
            Err(reason) => {
                println!("{name:18} refused: {reason:#}");
                refused.push(name);
                continue;
            }
        };
        let tuned = changed(tuned);
        let outcomes = run(&tuned, &cell::all());
        let named = Named::of(&motor, &tuned);
        if std::env::var("HOLD_CELLS").is_ok() {
            for (cell, outcome) in outcomes.iter().filter(|(_, outcome)| !outcome.held || outcome.alarm) {
                println!("  {cell}: {outcome}");
            }
        }
        let count = Count::of(&outcomes, &named);
        count.print(&name);
        all.add(count);
    }
    all.print("all");
    println!("refused: {refused:?}");
    assert_eq!(all.lost_and_silent, 0, "a drive that is lost without a word");
    // A torque or speed that differs from the sensor's, with the right angle.
    assert!(100 * all.off_and_silent <= all.on_sensor.0, "{} cells are off without a word", all.off_and_silent);
    #[expect(clippy::cast_precision_loss, reason = "thousands")]
    let share = all.on_sensor.1 as f64 / all.on_sensor.0 as f64;
    assert!(share >= 0.95, "held {share:.3} of the cells held with a sensor");
}

/// A few cells that stay cheap enough for every run of the tests.
#[test]
fn a_tuned_drive_holds_at_its_own_temperature() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors/servo-48v.toml");
    let tuned = rules::tune(&MotorFile::read(&path).unwrap()).unwrap();
    let mut cells = cell::all();
    cells.retain(|cell| cell.level > 0.2 && cell.level < 0.4 && cell.R.is_some_and(|R| (R - 1.0).abs() < 1e-9));
    assert!(cells.len() >= 4);
    for (cell, outcome) in run(&tuned, &cells) {
        assert!(outcome.held && outcome.on_sensor && !outcome.alarm, "{cell}: {outcome}");
    }
}
