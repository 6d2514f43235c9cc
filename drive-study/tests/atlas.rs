//! A small part of the atlas: the cells that the reference drive loses, `lock_lost` in them, and the files.
#![allow(missing_docs)]

use drive::estimator::Kind;
use drive_study::atlas::cell::{Course, Grid};
use drive_study::atlas::drive::Drive;
use drive_study::atlas::run::Atlas;
use drive_study::atlas::{self, map, report};
use drive_study::compare::candidate::Entry;
use std::path::Path;

fn of(name: &str) -> Drive {
    Drive::compared(Entry::find(name).unwrap())
}

/// Every 9th of the 1100 cells.
fn thinned() -> Atlas {
    let cells = Grid::default().cells(9).unwrap();
    atlas::run(&[of("Rasmussen")], &cells, 2, || ()).unwrap().remove(0)
}

#[test]
fn the_reference_drive_loses_two_cells_of_five_and_lock_lost_tells() {
    let atlas = thinned();
    let lost: Vec<_> = atlas.that_are(true).collect();
    assert!(atlas.runs.len() == 123 && (45..=55).contains(&lost.len()), "{} lost", lost.len());
    let silent: Vec<_> = lost.iter().filter(|(_, verdict)| !verdict.lock_lost_is_right()).collect();
    assert!(20 * silent.len() <= lost.len(), "{silent:?}");
    let alarms: Vec<_> = atlas.that_are(false).filter(|(_, verdict)| verdict.lock_lost >= 1.0).collect();
    assert!(alarms.is_empty(), "{alarms:?}");
}

/// Injection holds the cells that back-EMF methods lose, except with sensors of the wrong sign; every scenario runs, and any
/// number of threads gives the same bytes.
#[test]
fn every_scenario_and_any_number_of_threads() {
    let grid = Grid {
        scenarios: Course::ALL.to_vec(),
        R: vec![0.8],
        psi: vec![1.0],
        load: vec![1.0],
        speed: vec![-0.01],
        theta: vec![0.0],
    };
    let drives = vec![of("Rasmussen"), of("ExtendedEmf"), of("SquareWaveInjection")];
    let cells = grid.cells(1).unwrap();
    let files = |threads| {
        let atlases = atlas::run(&drives, &cells, threads, || ()).unwrap();
        let maps: String = atlases.iter().map(map::svg).collect();
        [report::csv(&atlases), report::markdown(&atlases), report::page(&atlases), maps]
    };
    let [csv, markdown, page, maps] = files(1);
    assert_eq!([&csv, &markdown, &page, &maps].map(String::as_str), files(3).each_ref().map(String::as_str));
    let lost = |name: &str| csv.lines().filter(|l| l.starts_with(name) && !l.contains(",-0.01,0,,,")).count();
    assert_eq!([lost("ExtendedEmf"), lost("SquareWaveInjection")], [9, 1], "{csv}");
    assert_eq!(csv.lines().count(), 28);
    assert!(markdown.contains("| SquareWaveInjection | 2.2 kW machine, 14 N.m | load: "), "{markdown}");
    assert!(maps.contains("class=\"l\"") && maps.contains("class=\"h\""), "{maps}");
    // Its links are the files beside it.
    for needs in ["src=", "href=\"http", "href=\"/", "@import", "url("] {
        assert!(!page.contains(needs), "the page needs {needs}");
    }
    assert!(page.contains("prefers-color-scheme:dark") && page.contains("width=device-width"));
}

/// Machines from motor files, tuned by the rules of `fmu tune`.
#[test]
fn a_tuned_machine_runs() {
    let motors = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors");
    let grid = Grid { R: vec![1.0], psi: vec![1.0], load: vec![0.0, 0.5], speed: vec![0.05], ..Grid::default() };
    let cells = grid.cells(1).unwrap();
    for (file, kind) in [("servo-6.6kw.toml", Kind::Rasmussen), ("ipmsm-2.2kw.toml", Kind::ExtendedEmf)] {
        let drive = Drive::tuned(&motors.join(file), kind).unwrap();
        let atlas = atlas::run(&[drive], &cells, 2, || ()).unwrap().remove(0);
        assert_eq!(atlas.that_are(true).count(), 0, "{file}: {:?}", atlas.runs);
        assert!(atlas.runs.iter().all(|(_, verdict)| verdict.lock_lost_is_right()), "{file}: {:?}", atlas.runs);
    }
    let error = Drive::tuned(Path::new("none.toml"), Kind::Rasmussen).err().unwrap();
    assert!(format!("{error:#}").starts_with("reading none.toml: "), "{error:#}");
}
