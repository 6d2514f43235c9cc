//! `fmu check` on our own archives, on those of other tools, and on files other than FMUs. `fmu-check/tests/faults/` has a
//! fault for each check.
#![allow(missing_docs, unreachable_pub, clippy::missing_panics_doc)]

#[path = "../common/mod.rs"]
mod common;

#[path = "../../fmu-check/tests/faults/findings.rs"]
mod findings;
mod foreign;
mod plant;
mod scripts;
mod survives;
mod terminals;
#[path = "../../fmu-check/tests/faults/zip.rs"]
mod zip;

use findings::{check, check_within, listed, violated};
use fmu_check::Verdict;
use std::path::Path;

/// The program that runs the probes.
const PROGRAM: &str = env!("CARGO_BIN_EXE_fmu");

/// Our own archives pass every check; a plain build of this machine, which needs its C library and libgcc_s, all but B03 and B04.
#[test]
fn our_own_archives_violate_nothing() {
    let portable = std::env::var_os("FMU_TEST_ARCHIVES").is_some();
    for (standard, more) in [("fmi2", None), ("fmi3", Some("SensorlessControllerClocked"))] {
        for name in
            ["PmsmPlant", "SensorlessController", "PmsmDrive", "PmsmDriveMean", "MappedDrive"].into_iter().chain(more)
        {
            let report = check(&common::archives().join(standard).join(name).with_extension("fmu"), &[]);
            let found: Vec<_> =
                violated(&report).into_iter().filter(|id| portable || !["B03", "B04"].contains(id)).collect();
            assert!(found.is_empty(), "{standard} {name}: {}", listed(&report));
            let open = report.findings.iter().find(|f| matches!(f.verdict, Verdict::NotDetermined(_)));
            assert!(open.is_none(), "{standard} {name}: {open:?}");
        }
    }
}

/// The page has the program's list.
#[test]
fn the_page_has_the_list() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/check.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let (before, after) = page.split_once("<!-- list -->\n").unwrap();
    let (_, after) = after.split_once("<!-- end of list -->").unwrap();
    let [index, list] = [fmu_check::report::index(), fmu_check::report::list()];
    let expected = format!("{before}<!-- list -->\n{index}\n{list}<!-- end of list -->{after}");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, expected).unwrap();
    } else {
        assert!(page == expected, "docs/check.md is old: UPDATE_GOLDEN=1 cargo test --test check writes it");
    }
    let checks = list.lines().filter(|l| l.starts_with("| ") && !l.starts_with("| id")).count();
    for (file, text) in
        [("README.md", include_str!("../../README.md")), ("CHANGELOG.md", include_str!("../../CHANGELOG.md"))]
    {
        assert!(text.contains(&format!("{checks} checks")), "{file} has another number of checks than {checks}");
    }
}
