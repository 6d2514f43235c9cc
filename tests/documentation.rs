//! What a user reads: the page inside each FMU, its plots, and the links of the Markdown pages.
#![allow(missing_docs)]

mod common;

use common::Native;
use drive::{PmsmDrive, PmsmPlant, SensorlessController, documentation as fragments};
use drive_study::reproduce::plots;
use drive_study::reproduce::scenario::{
    ClosedLoop, LOAD_0, LOAD_1000, START, STEP_20, STEP_500, STEP_1000, STEP_1500, Scenario, Trace,
};
use fmu::documentation;
use fmu_core::{Description, Model};
use model_description::FmiVersion;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The plots in `drive/docs`, shown by the README and by the pages, are those that a run gives today.
/// `UPDATE_GOLDEN=1 cargo test --test documentation` accepts others.
#[test]
fn the_plots_are_those_of_a_run() {
    let run = |s: &Scenario| -> Trace { Native.run(s, 1e-4).unwrap() };
    let figure_4 = plots::figure_4(&run(&START), [&STEP_20, &STEP_500, &STEP_1000, &STEP_1500].map(run).each_ref());
    let figure_5 = plots::figure_5(&run(&LOAD_0), &run(&LOAD_1000));
    for (name, drawn) in [("figure-4.svg", figure_4.unwrap()), ("figure-5.svg", figure_5.unwrap())] {
        let path = root().join("drive/docs").join(name);
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            std::fs::write(&path, &drawn).unwrap();
            continue;
        }
        let kept = std::fs::read_to_string(&path).unwrap();
        let line = kept.lines().zip(drawn.lines()).position(|(a, b)| a != b).map(|k| k + 1);
        assert!(kept == drawn, "drive/docs/{name} differs from line {line:?} on; UPDATE_GOLDEN=1 accepts");
        assert!(fragments::CONTROLLER.contains(&drawn) && fragments::DRIVE.contains(&drawn), "{name} is in both pages");
    }
}

/// A page opens without a network: no address but those of the SVG name space and of the licenses beside it.
#[test]
fn pages_need_nothing_from_outside() {
    fn check<M: Model>() {
        let page = documentation::page(&Description::of::<M>().unwrap(), FmiVersion::V3);
        let name = M::INFO.name;
        std::fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.html")), &page).unwrap();
        let outside = page.replace("http://www.w3.org/2000/svg", "");
        for part in ["http:", "https:", "src=", "@import", "url(h", "<script", "<link", "<iframe"] {
            assert!(!outside.contains(part), "{name}: {part}");
        }
        let mut places = BTreeSet::new();
        for place in page.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
            assert!(places.insert(place), "{name}: the place {place} is there twice");
        }
        for target in page.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
            let there = target.strip_prefix('#').map_or(target == "licenses/license.txt", |p| places.contains(p));
            assert!(there, "{name}: a link to {target}");
        }
        for tag in
            ["table", "tr", "td", "th", "p", "ul", "li", "h2", "h3", "svg", "text", "sub", "sup", "b", "i", "code"]
        {
            let opened = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
            assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{name}: <{tag}>");
        }
    }
    check::<PmsmPlant>();
    check::<SensorlessController>();
    check::<PmsmDrive>();
}

/// Every relative link of README, the pages at the root and `docs` leads to a file.
#[test]
fn links_lead_somewhere() {
    let mut pages: Vec<PathBuf> = [root().to_owned(), root().join("docs")]
        .iter()
        .flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()))
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
            // A name as the text of a link to a source stands in that source.
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
