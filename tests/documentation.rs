//! Texts for users: the page inside each FMU, its plots, and the links of the Markdown pages.
#![allow(missing_docs)]

mod common;

use common::shows::{differs, shows};
use common::{Native, words};
use drive::estimator::Kind;
use drive::plant::losses::Losses;
use drive::{MappedDrive, PmsmDrive, PmsmDriveMean, PmsmPlant, SensorlessController, documentation as fragments};
use drive_study::plane::{self, OperatingPoint};
use drive_study::reproduce::experiment::{
    ClosedLoop, Experiment, LOAD_0, LOAD_1000, Record, START, STEP_20, STEP_500, STEP_1000, STEP_1500,
};
use drive_study::reproduce::plots;
use fmu_core::{Description, Stored};
use fmu_import::elf::FLOOR;
use fmu_pack::documentation;
use fmu_plot::{chart, svg};
use model_description::FmiVersion;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The plots in the models' `docs`, shown by the README and by the pages, match a run of the present code. `UPDATE_GOLDEN=1
/// cargo test
/// --test documentation` accepts others.
#[test]
fn the_plots_are_those_of_a_run() {
    let run = |s: &Experiment| -> Record { Native.run(s, 1e-4).unwrap() };
    let figure_4 = plots::figure_4(&run(&START), [&STEP_20, &STEP_500, &STEP_1000, &STEP_1500].map(run).each_ref());
    let figure_5 = plots::figure_5(&run(&LOAD_0), &run(&LOAD_1000));
    keep("figure-4.svg", &svg::draw(&figure_4).unwrap());
    keep("figure-5.svg", &svg::draw(&figure_5).unwrap());
}

/// Torque over speed on the pages: every number and every dot comes from a run and lies on the curves.
#[test]
fn the_envelope_is_that_of_the_running_drive() {
    let plane = plane::envelope(&[1000.0, 2000.0, 3000.0, 3500.0, 4000.0, 4500.0, 5000.0, 5300.0]).unwrap();
    let text = include_str!("../drive/control/docs/envelope.html");
    let [motoring, generating] = &plane.panel.curves[..] else { panic!() };
    for (k, &(rpm, torque)) in plane.panel.dots.iter().enumerate() {
        let points: Vec<_> = if k % 2 == 0 { motoring.points().collect() } else { generating.points().collect() };
        let after = points.partition_point(|p| p.0 < rpm);
        let ((x, y), (x_1, y_1)) = (points[after - 1], points[after]);
        let figure = y + (y_1 - y) * (rpm - x) / (x_1 - x);
        assert!((torque / figure - 1.0).abs() < 0.01, "{rpm} rpm: {torque} N.m, not {figure}");
    }
    for pair in plane.panel.dots.chunks(2).filter(|pair| [3000.0, 4000.0, 4500.0, 5000.0].contains(&pair[0].0)) {
        let row =
            format!("<tr><td>{} rpm</td><td>{:.2} N.m</td><td>{:.2} N.m</td></tr>", pair[0].0, pair[0].1, pair[1].1);
        let row = row.replace('-', "−");
        shows("drive/control/docs/envelope.html", text, &row);
    }
    for part in [format!("base speed, {:.0} rpm", plane.base), format!("above {:.0} rpm", plane.end)] {
        shows("drive/control/docs/envelope.html", text, &part);
    }
    keep("envelope.svg", &svg::draw(&plane::figure(vec![plane.panel])).unwrap());
}

/// Losses over speed on the page of the drive: every row and every dot comes from a run and lies on the curves within 0.3 % of
/// each loss, the torque and the efficiency. The equations neglect harmonics: those of the conduction drop (p_cond, p_sw at low
/// speed) and of the voltage held over T_s (p_iron at high speed) take up to 0.2 %.
#[test]
fn the_losses_are_those_of_the_running_drive() {
    let text = include_str!("../drive/docs/losses.html");
    let row = |p: &OperatingPoint| {
        let Losses { cu, iron, cond, sw, friction } = p.losses;
        let powers = [cu, iron, cond, sw, friction].map(|x| format!("<td>{x:.1} W</td>")).concat();
        let OperatingPoint { rpm, tau, tau_shaft, efficiency, .. } = p;
        format!(
            "<tr><td>{rpm} rpm</td><td>{tau:.3} N.m</td><td>{tau_shaft:.2} N.m</td>{powers}<td>{:.1} %</td></tr>",
            100.0 * efficiency
        )
        .replace('-', "−")
    };
    let motoring =
        plane::losses(2.5, 5000.0, &[500.0, 1000.0, 2000.0, 3000.0, 3500.0, 4000.0, 4500.0, 5000.0]).unwrap();
    let generating = plane::losses(-2.5, 5000.0, &[3000.0]).unwrap();
    let mut wrong = Vec::new();
    for [figure, run] in motoring.points.iter().chain(&generating.points) {
        let parts = |p: &OperatingPoint| {
            let Losses { cu, iron, cond, sw, friction } = p.losses;
            [cu, iron, cond, sw, friction, p.tau_shaft, p.efficiency]
        };
        for (got, wanted) in parts(run).iter().zip(parts(figure)) {
            if (got / wanted - 1.0).abs() > 3e-3 {
                wrong.push(format!("{} rpm: {got}, not {wanted}", run.rpm));
            }
        }
        let row = row(run);
        if [1000.0, 2000.0, 3000.0, 4000.0, 4500.0, 5000.0].contains(&run.rpm) && !text.contains(&row) {
            wrong.push(differs("drive/docs/losses.html", text, &row));
        }
    }
    for part in [format!("above {:.0} rpm", motoring.onset), format!("up to {:.0} rpm", motoring.end)] {
        if !text.contains(&part) {
            wrong.push(differs("drive/docs/losses.html", text, &part));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    keep_in(&[fragments::DRIVE], "drive/docs/losses.svg", &svg::draw(&plane::figure(motoring.panels.into())).unwrap());
}

/// The efficiency map on the pages of the drives is the one computed today, and the page names its best point.
#[test]
fn the_map_is_that_of_the_steady_state() {
    let chart = plane::map();
    let (_, best) = &chart.dots[0];
    shows(
        "drive/docs/map.html",
        include_str!("../drive/docs/map.html"),
        &format!("the best point of the motor has {best}"),
    );
    let drawn = chart::draw(&chart).unwrap();
    assert!(drawn.len() < 41_000, "{} bytes are too many for a page", drawn.len());
    keep_in(&[fragments::DRIVE, fragments::MEAN], "drive/docs/map.svg", &drawn);
}

/// Checks that the plot `drawn` is the one in the controller's `docs`, and in the pages of controller and drive.
fn keep(name: &str, drawn: &str) {
    keep_in(&[fragments::CONTROLLER, fragments::DRIVE], &format!("drive/control/docs/{name}"), drawn);
}

/// Checks that the plot `drawn` is the one in the file `name`, and in these pages.
fn keep_in(pages: &[&str], name: &str, drawn: &str) {
    let path = root().join(name);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        return std::fs::write(&path, drawn).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap();
    let line = kept.lines().zip(drawn.lines()).position(|(a, b)| a != b).map(|k| k + 1);
    assert!(
        kept == drawn,
        "{name} is not what a run draws now, from line {line:?} on. If you meant to change the drive, \
         UPDATE_GOLDEN=1 cargo test --test documentation writes the new plot"
    );
    assert!(pages.iter().all(|page| page.contains(drawn)), "a page does not include {name}");
}

/// A page works offline: no address except those of the SVG name space and of the licenses beside it.
#[test]
fn pages_need_nothing_from_outside() {
    fn check<M: Stored>() {
        let page = documentation::page(&Description::of::<M>().unwrap(), FmiVersion::V3);
        let name = M::INFO.name;
        std::fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.html")), &page).unwrap();
        assert!(!page.contains("<script"), "{name}: FMUs bring no script");
        common::pages::stands_alone(&page, |file| file == "licenses/license.txt");
        let icon = Description::of::<M>().unwrap().icon.unwrap();
        let drawing = icon.split_once('>').unwrap().1.trim();
        assert!(page.find(drawing).unwrap() < page.find("<h1>").unwrap(), "{name}: the icon is at the head");
    }
    check::<PmsmPlant>();
    check::<SensorlessController>();
    check::<PmsmDrive>();
}

/// The minimum version of the C library is in `elf.rs`; pages and helps name the same.
#[test]
fn one_floor_of_glibc() {
    let floor = format!("glibc {}.{}", FLOOR.0, FLOOR.1);
    let pages = ["README.md", "python/README.md", "docs/platforms.md", "docs/check.md", "cargo-fmu/src/build.rs"];
    for page in pages {
        let text = std::fs::read_to_string(root().join(page)).unwrap();
        let named: Vec<&str> = text.split("glibc ").skip(1).filter(|rest| rest.starts_with('2')).collect();
        assert!(!named.is_empty(), "{page} names no floor");
        for rest in named {
            let other = format!("glibc {}", rest.split([' ', ',', ';', '|']).next().unwrap());
            assert_eq!(other.trim_end_matches(['.', ':']), floor, "{page}");
        }
    }
}

/// The head of every estimator's file states the numbers of the table in `limits.html`, which `fmu compare` prints and whose
/// cells a test runs; so does the text about all methods without the frame-speed term.
#[test]
fn the_heads_of_the_estimators_have_the_numbers_of_the_table() {
    let read = |path: &str| std::fs::read_to_string(root().join(path)).unwrap();
    let head = |file: &str| -> String {
        let text = read(&format!("drive/control/src/estimator/{file}.rs"));
        let lines = text.lines().filter_map(|line| line.strip_prefix("//!"));
        lines.flat_map(str::split_whitespace).collect::<Vec<_>>().join(" ")
    };
    let (list, limits) = (read("drive/control/src/estimator/mod.rs"), read("drive/control/docs/limits.html"));
    let row = |kind: &str| -> Option<Vec<String>> {
        let row = limits.split_once(&format!("<tr><td>{kind}</td><td>"))?.1.split_once("</td></tr>")?.0;
        Some(row.split("</td><td>").map(Into::into).collect())
    };
    let (mut files, mut without) = (0, Vec::new());
    for line in list.split("estimators! {\n").nth(1).unwrap().lines().filter(|line| line.contains("standstill")) {
        let (kind, rest) = line.trim().split_once(' ').unwrap().1.split_once('(').unwrap();
        let file = rest.split("::").next().unwrap();
        let head = head(file);
        let claims = head.matches("rated load down to").count() + head.matches("rated load from").count();
        let held = row(kind).filter(|cells| cells[0] != "0.000");
        let expected = held.as_ref().map(|cells| {
            let [ideal, dead] = [&cells[0], &cells[1]];
            format!("holds rated load down to {ideal} of the rated speed, {dead} with a compensated dead time")
        });
        let file = format!("drive/control/src/estimator/{file}.rs");
        assert_eq!(
            claims,
            usize::from(expected.is_some()),
            "{file}: its documentation must say once down to which speed {kind} holds rated load, if drive/control/docs/limits.html has \
             that speed: {expected:?}"
        );
        let expected = expected.unwrap_or_default();
        assert!(
            head.contains(&expected),
            "{file}: its documentation must say, by drive/control/docs/limits.html: {expected}"
        );
        if let Some(cells) = held.filter(|cells| cells[2] != "–") {
            without.push((kind, cells[2].clone()));
        }
        files += 1;
    }
    assert_eq!(files, Kind::ALL.len(), "estimators whose row in the list this test has found");
    let of = |kind: &str| without.iter().find(|(name, _)| *name == kind).unwrap().1.clone();
    let feedback = format!("without the frame term, to {}", of("VoltageFeedback"));
    assert!(head("voltage_feedback").contains(&feedback), "{feedback}");
    let mut others: Vec<String> = ["DirectEmf", "EmfObserver", "ExtendedEmf"].map(of).to_vec();
    others.sort();
    let range = format!("rated load below {} to {} of the rated speed", others[0], others[2]);
    let page = read("docs/from-paper-to-code.md");
    assert!(head("emf").contains(&range) && page.contains(&range), "{range}");
}

/// A page is self-contained: it does not refer to pages of other FMUs, its diagram names every input, its anchors are unique,
/// and its head names the interfaces of the archive.
#[test]
fn pages_stand_alone() {
    use std::io::Read as _;
    let drawn =
        |svg: &str, name: &str| svg.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').any(|word| word == name);
    for (name, svg) in [
        ("PmsmPlant", include_str!("../drive/plant/docs/pmsm_plant.svg")),
        ("SensorlessController", include_str!("../drive/control/docs/sensorless_controller.svg")),
        ("PmsmDrive", include_str!("../drive/docs/pmsm_drive.svg")),
        ("PmsmDriveMean", include_str!("../drive/docs/pmsm_drive.svg")),
        ("MappedDrive", include_str!("../drive/docs/mapped_drive.svg")),
    ] {
        for standard in ["fmi2", "fmi3"] {
            let archive = common::archives().join(standard).join(name).with_extension("fmu");
            let mut archive = zip::ZipArchive::new(std::fs::File::open(archive).unwrap()).unwrap();
            let mut page = String::new();
            archive.by_name("documentation/index.html").unwrap().read_to_string(&mut page).unwrap();
            let version = if standard == "fmi2" { "2.0" } else { "3.0" };
            let head = format!("FMI {version} for Co-Simulation and Model Exchange · ");
            assert!(page.contains(&head), "{name}: {head}");
            let words = page.split_whitespace().collect::<Vec<_>>().join(" ");
            for elsewhere in ["page of", "documentation of", "their documentation"] {
                let at = words.find(elsewhere).map(|at| &words[at..words.len().min(at + 80)]);
                assert!(at.is_none(), "{name}: {at:?}");
            }
            let mut ids: Vec<&str> = page.split(" id=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
            let targets = page.split("href=\"#").skip(1).map(|rest| rest.split('"').next().unwrap());
            for target in targets {
                assert!(ids.contains(&target), "{name}: #{target} leads nowhere");
            }
            ids.sort_unstable();
            let twice = ids.windows(2).find(|pair| pair[0] == pair[1]);
            assert!(twice.is_none(), "{name}: {twice:?} is there twice");
        }
        let description = match name {
            "PmsmPlant" => Description::of::<PmsmPlant>(),
            "PmsmDrive" => Description::of::<PmsmDrive>(),
            "PmsmDriveMean" => Description::of::<PmsmDriveMean>(),
            "MappedDrive" => Description::of::<MappedDrive>(),
            _ => Description::of::<SensorlessController>(),
        };
        let inputs = description.unwrap().variables;
        for input in inputs.iter().filter(|v| v.causality == fmu_core::Causality::Input) {
            // T_winding_imposed represents the four of its kind.
            let shown = input.name.strip_suffix("_imposed").map_or(input.name.as_str(), |_| "T_winding_imposed");
            assert!(drawn(svg, shown), "the diagram of {name} lacks {}", input.name);
        }
    }
}

/// Every page in a browser at three widths, on light and dark paper: nothing wider than the page, no network access, curves
/// drawn; zoom, legend and keyboard of the page of a run. Pictures stay in `target/tmp/pages`.
#[test]
#[ignore = "opt-in: cargo test --test documentation browser -- --ignored (needs Chromium; CHROMIUM names it)"]
fn pages_in_a_browser() {
    pages_need_nothing_from_outside();
    let folder = common::python::scratch().join("pages");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    for model in ["PmsmDrive", "PmsmPlant", "SensorlessController"] {
        let page = format!("{model}.html");
        std::fs::copy(common::python::scratch().join(&page), folder.join(&page)).unwrap();
    }
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let drive = common::archives().join("fmi3/PmsmDrive.fmu");
    let inputs = ["--input", "speed_ref=0:0,0.1:1000rpm", "--input", "tau_load=0:0,0.5:2"];
    let commands = [
        [
            &["simulate", drive.to_str().unwrap()][..],
            &inputs,
            &["--html", &path("run.html"), "--csv", &path("run.csv")],
        ]
        .concat(),
        vec!["compare", "--scenario", "ramp,reversal,load-0,signal,signal-trace", "--out", &path("compare")],
        vec!["reproduce", "--out", &path("reproduce")],
        vec!["atlas", "--every", "20", "--out", &path("atlas")],
        vec!["map", "motors/traction-63kw.toml", "--u-dc", "320,400", "--out", &path("map")],
        vec![
            "identify",
            "examples/bench.csv",
            "--n-p",
            "3",
            "--every",
            "5",
            "--load",
            "tau_load",
            "--html",
            &path("bench.html"),
        ],
    ]
    .map(|command| command.into_iter().map(String::from).collect::<Vec<_>>());
    for command in commands {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_fmu")).args(&command).output().unwrap();
        // `fmu identify` ends with 1 where it refuses a value.
        let succeeds = output.status.success() || command[0] == "identify" && output.status.code() == Some(1);
        assert!(succeeds, "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    common::python::pytest("pages", "pages", &["test_browser.py"], &[("FMU_PAGES", &folder)]);
}

/// The lines of `docs/reference-fmus.md`, counted as described on the page; each file has at most 60 % of the lines of its
/// original.
#[test]
fn the_reference_fmus_have_the_lines_that_the_page_says() {
    let page = std::fs::read_to_string(root().join("docs/reference-fmus.md")).unwrap();
    let rows: Vec<Vec<&str>> = page
        .lines()
        .filter(|line| line.starts_with("| ["))
        .map(|line| line.split('|').map(str::trim).skip(1).collect())
        .collect();
    let packages = std::fs::read_dir(root().join("examples/reference-fmus")).unwrap().count();
    assert_eq!((rows.len(), packages), (9, 9));
    for row in rows {
        let (package, _) = row[0][1..].split_once(']').unwrap();
        let file = format!("examples/reference-fmus/{package}/src/lib.rs");
        let text = std::fs::read_to_string(root().join(&file)).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap().lines().map(str::trim);
        let count = code.filter(|line| !line.is_empty() && !line.starts_with("//")).count();
        let [original, printed] = [row[2], row[3]].map(|cell| cell.parse::<usize>().unwrap());
        assert_eq!(printed, count, "docs/reference-fmus.md: the lines of {file}");
        assert!(10 * count <= 6 * original, "{file}: {count} lines, more than 60 % of {original}");
    }
}

/// Every relative link of README, the pages at the root, of `docs` and of the Python package leads to a file.
#[test]
fn links_lead_somewhere() {
    let mut pages: Vec<PathBuf> = ["", "docs", "python", "python/docs"]
        .iter()
        .flat_map(|folder| std::fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path()))
        .filter(|path| path.extension().is_some_and(|e| e == "md"))
        .collect();
    pages.sort();
    assert!(pages.len() > 5, "{pages:?}");
    let mut broken = Vec::new();
    for page in &pages {
        let text = std::fs::read_to_string(page).unwrap();
        let mut rest = text.as_str();
        while let Some((before, after)) = rest.split_once("](") {
            let (target, path) =
                (after.split(')').next().unwrap_or_default(), after.split([')', '#']).next().unwrap_or_default());
            rest = after;
            if ["http://", "https://"].iter().any(|scheme| path.starts_with(scheme)) || path.is_empty() {
                continue;
            }
            let file = page.with_file_name(path);
            // A name as the text of a link to a source must occur in that source.
            let name = before.rsplit('[').next().and_then(|t| t.strip_prefix('`')?.strip_suffix('`'));
            let source = file.extension().is_some_and(|e| e == "rs");
            let named = |name: &str| !source || std::fs::read_to_string(&file).is_ok_and(|s| s.contains(name));
            if !file.exists() || !name.is_none_or(named) {
                broken.push(format!("{}: {} {target}", page.display(), name.unwrap_or_default()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// Doc comments, messages and pages are written in plain sentences: for each pattern there is a better wording.
#[test]
fn sentences_have_no_pattern_of_the_list() {
    let mut wrong = Vec::new();
    for path in words::sources(root()) {
        let name = path.strip_prefix(root()).unwrap();
        let texts = words::texts(&path);
        let found = texts.iter().filter_map(|(line, text)| Some((line, words::pattern(text)?)));
        wrong.extend(found.map(|(line, why)| format!("{}:{line}: {why}", name.display())));
    }
    assert!(wrong.is_empty(), "rewrite these sentences:\n{}", wrong.join("\n"));
}

/// The patterns match awkward sentences, but not plain English.
#[test]
fn patterns_are_found() {
    for wrong in [
        "The same with more children.",
        "Reads a file. The same for a folder.",
        "As [`printable`], for several lines.",
        "Of one call.",
        "a value that is no number",
        "The energies are no states.",
        "what it reads belongs into a field",
        "a step is told as lost",
    ] {
        assert!(words::pattern(wrong).is_some(), "{wrong}");
    }
    for plain in [
        "there is no such check",
        "It is no longer needed.",
        "Compares runs of the same FMU.",
        "A limit as large as the value.",
        "a size is no more than the limit",
    ] {
        assert_eq!(words::pattern(plain), None, "{plain}");
    }
}

/// Rows of the first table after a heading.
fn table<'a>(page: &'a str, heading: &str) -> Vec<Vec<&'a str>> {
    let (_, after) = page.split_once(heading).unwrap_or_else(|| panic!("docs/methods.md has no {heading}"));
    let rows = after.lines().skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|'));
    rows.skip(2).map(|row| row.trim_matches('|').split('|').map(str::trim).collect()).collect()
}

/// Every row of the table of attributes names a test that there is.
#[test]
fn every_attribute_of_a_description_has_a_test() {
    let page = std::fs::read_to_string(root().join("docs/import.md")).unwrap();
    let rows = table(&page, "## What our importer does with a description");
    assert!(rows.len() > 30, "{}", rows.len());
    let mut functions = std::collections::HashSet::new();
    let mut folders = vec![root().join("tests"), root().join("fmu-system/tests"), root().join("fmu-import/tests")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                let tests =
                    text.split("#[test]").skip(1).filter_map(|after| after.split_once("fn ")?.1.split_once('('));
                functions.extend(tests.map(|(name, _)| name.to_owned()));
            }
        }
    }
    for row in rows {
        let named: Vec<&str> = row[2].split('`').skip(1).step_by(2).collect();
        assert!(!named.is_empty(), "{row:?}");
        for name in named {
            assert!(functions.contains(name), "{}: there is no test {name}", row[0]);
        }
    }
}

/// The decision of docs/methods.md: each method once, with the worst cell of the machines that it holds, and the others.
#[test]
fn the_decision_is_that_of_the_comparison() {
    const MACHINES: [&str; 3] = ["reference", "ipmsm-2.2kw", "traction-100kw"];
    let page = std::fs::read_to_string(root().join("docs/methods.md")).unwrap();
    let machines = MACHINES.map(|name| table(&page, &format!("### `{name}`\n")));
    let decision = table(&page, "## The decision\n");
    let names = |cell: &str| cell.split(", ").map(|name| name.trim_matches('`').to_owned()).collect::<Vec<_>>();
    let mut chosen: Vec<String> = decision.iter().flat_map(|row| names(row[1])).collect();
    chosen.sort();
    let mut all: Vec<String> = Kind::ALL.iter().map(|kind| kind.name().to_owned()).collect();
    all.sort();
    assert_eq!(chosen, all, "each method once");
    for row in &decision {
        for method in names(row[1]) {
            let (mut cells, mut not_on): (Vec<Vec<&str>>, Vec<String>) = (Vec::new(), Vec::new());
            for (name, rows) in MACHINES.iter().zip(&machines) {
                match rows.iter().find(|row| row[0] == method).filter(|row| row[4] != "lost") {
                    Some(row) => cells.push(row[4..].to_vec()),
                    None => not_on.push(format!("`{name}`")),
                }
            }
            let worst = |k: usize| {
                let speed = |cells: &Vec<&str>| cells[k].parse().unwrap_or(f64::INFINITY);
                let worst = cells.iter().map(speed).fold(0.0, f64::max);
                if worst.is_finite() { worst.to_string() } else { "lost".into() }
            };
            assert_eq!(row[2], (0..5).map(worst).collect::<Vec<_>>().join(" / "), "{method}");
            assert_eq!(row[4], if not_on.is_empty() { "–".into() } else { not_on.join(", ") }, "{method}");
        }
    }
}
