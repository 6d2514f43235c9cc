//! `fmu prove`: the FMI-LS-REF data in every archive are reproduced by the FMU, in this program and in FMPy.
#![allow(missing_docs)]

mod common;

use common::python;
use fmu_import::contents;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const FOLDER: &str = "extra/org.fmi-standard.fmi-ls-ref/";

fn prove(folder: &Path, archives: &[PathBuf]) -> Output {
    let python = python::environment(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy/requirements.txt"));
    let mut fmu = Command::new(env!("CARGO_BIN_EXE_fmu"));
    fmu.arg("prove").arg(folder).args(archives).arg("--python").arg(python).output().unwrap()
}

fn archives() -> Vec<PathBuf> {
    let names = ["MappedDrive", "PmsmDrive", "PmsmDriveMean", "PmsmPlant", "SensorlessController"];
    let of =
        |standard: &'static str| names.map(|name| common::archives().join(standard).join(name).with_extension("fmu"));
    ["fmi2", "fmi3"].into_iter().flat_map(of).collect()
}

/// Every importer gives the reference results again, and the folders are those required by the FMI tools page.
#[test]
fn the_reference_results_are_replayed() {
    let dir = tempfile::tempdir().unwrap();
    let output = prove(dir.path(), &archives());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !said.contains("note: "), "{said}");
    for archive in archives() {
        let (standard, name) = (archive.parent().unwrap().file_name().unwrap(), archive.file_stem().unwrap());
        let (folder, name) = (dir.path().join(standard).join(name), name.to_str().unwrap());
        let read = |file: &str| fs::read_to_string(folder.join(file)).unwrap();
        let readme = read("Readme.txt");
        for part in [
            "fmu 0.1.0: ",
            "FMPy 0.3.32: ",
            "validate_fmu: no problems",
            "fmu check: no requirement of the standard",
            "test with it: Co-Simulation, Model Exchange, FMU state",
        ] {
            assert!(readme.contains(part), "{part}: {readme}");
        }
        assert_eq!(fs::read(folder.join(format!("{name}.fmu"))).unwrap(), fs::read(&archive).unwrap());
        assert!(read(&format!("{name}_ref.opt")).starts_with("StartTime, 0.0\nStopTime, 1.0\nStepSize, "));
        let (md, files) = contents(&archive).unwrap();
        for file in [format!("{name}_ref.csv"), format!("{name}_in.csv")] {
            let text = read(&file);
            assert_eq!(text.as_bytes(), files[&format!("{FOLDER}{file}")]);
            let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
            let named = |quoted: &&str| md.variable(quoted.trim_matches('"')).is_some() && quoted.starts_with('"');
            assert!(header[0] == "\"time\"" && header[1..].iter().all(named) && header.len() <= 11, "{header:?}");
            let times: Vec<f64> = text.lines().skip(1).map(|l| l.split(',').next().unwrap().parse().unwrap()).collect();
            assert!(times.windows(2).all(|t| t[0] < t[1]) && times.last() == Some(&1.0), "{file}: {times:?}");
        }
        // The result varies: a constant run would be no evidence.
        let result = read(&format!("{name}_ref.csv"));
        let rows: Vec<&str> = result.lines().skip(1).map(|line| line.split_once(',').unwrap().1).collect();
        let last = rows.len() - 1;
        assert!(
            [100, 200].contains(&last) && rows[last] != rows[last / 2] && rows[last / 2] != rows[0],
            "{name}: {}",
            rows[last]
        );
    }
}

/// The manifest names the existing files, with the roles of the standard, and the set of values fits the FMU.
#[test]
fn the_manifest_names_what_is_there() {
    for archive in archives() {
        let (md, files) = contents(&archive).unwrap();
        let text = |file: &str| String::from_utf8(files[&format!("{FOLDER}{file}")].clone()).unwrap();
        let manifest = text("fmi-ls-manifest.xml");
        let attribute = |line: &str, name: &str| {
            line.split_once(&format!(" {name}=\"")).unwrap().1.split('"').next().unwrap().to_owned()
        };
        let related: Vec<_> = manifest.lines().filter(|line| line.contains("<Related ")).collect();
        let roles: Vec<_> = related.iter().map(|line| attribute(line, "role")).collect();
        // A data sheet is no set of values of the machine, which the others have.
        let mapped = archive.file_stem().is_some_and(|name| name == "MappedDrive");
        let expected = ["result", "experiment/smoke-test", "parameter"];
        assert_eq!(roles, expected[..if mapped { 2 } else { 3 }], "{manifest}");
        for line in &related {
            assert!(!text(&attribute(line, "source")).is_empty());
        }
        let experiment = text("smoke-test.exp");
        for part in ["<Stimuli source=\"", "<References source=\""] {
            let source = experiment.split_once(part).unwrap().1.split('"').next().unwrap();
            assert!(files.contains_key(&format!("{FOLDER}{source}")), "{experiment}");
        }
        if mapped {
            continue;
        }
        let values = fmu_system::ssp::ssv::read(&text("ipmsm-2.2kw.ssv")).unwrap();
        assert!(values.len() > 5 && values.iter().all(|p| md.variable(&p.name).is_some()), "{}", archive.display());
    }
}

/// A wrong reference is found, by each importer.
#[test]
fn a_wrong_reference_is_found() {
    let dir = tempfile::tempdir().unwrap();
    let all = archives();
    let archive = all.iter().find(|path| path.ends_with("fmi3/PmsmDrive.fmu")).unwrap();
    let wrong = dir.path().join("PmsmDrive.fmu");
    common::rewrite(archive, &wrong, |name, bytes| {
        let text = String::from_utf8_lossy(&bytes).into_owned();
        Some(if name.ends_with("_ref.csv") { text.replace("\n0.5,", "\n0.5,9").into_bytes() } else { bytes })
    });
    let output = prove(&dir.path().join("out"), &[wrong]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let deviation = |importer: &str| {
        let text = said.split_once(&format!("{importer}: ")).unwrap_or_else(|| panic!("{said}")).1;
        text.split([',', ';']).next().unwrap().parse::<f64>().unwrap()
    };
    assert!(deviation("fmu 0.1.0") > 0.1 && deviation("FMPy 0.3.32") > 0.1, "{said}");
}
