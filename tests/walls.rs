//! The walls of ARCHITECTURE.md: the dependencies between crates, and the places of unsafe code.
#![allow(missing_docs)]

#[path = "common/circles.rs"]
mod circles;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Each crate, with the crates of this workspace that it may depend on.
const ARROWS: &[(&str, &[&str])] = &[
    ("fmu-core", &[]),
    ("fmu-export", &["fmu-core"]),
    ("model-description", &["fmu-core"]),
    ("fmu-import", &["fmu-core", "model-description"]),
    ("fmu-system", &["fmu-core", "fmu-import", "model-description"]),
    ("fmu-sweep", &["fmu-core", "fmu-import", "fmu-system", "model-description"]),
    ("fmu-check", &["fmu-import", "model-description"]),
    ("fmu-plot", &[]),
    ("fmu-pack", &["fmu-core", "fmu-import", "fmu-plot", "fmu-system", "model-description"]),
    ("cargo-fmu", &["fmu-core", "fmu-import", "fmu-pack", "fmu-plot", "fmu-system", "model-description"]),
    ("drive-base", &["fmu-core"]),
    ("drive-control", &["drive-base", "fmu-core"]),
    ("drive-plant", &["drive-base", "fmu-core"]),
    ("drive", &["drive-base", "drive-control", "drive-plant", "fmu-core"]),
    ("drive-tools", &["drive", "fmu-core", "fmu-import", "fmu-plot"]),
    ("virtual-motor", &["drive", "drive-tools", "fmu-core"]),
    ("drive-study", &["drive", "drive-tools", "fmu-core", "fmu-import", "fmu-plot"]),
    ("pmsm-plant", &["drive", "fmu-export"]),
    ("sensorless-controller", &["drive", "fmu-export"]),
    ("sensorless-controller-clocked", &["drive", "fmu-export"]),
    ("pmsm-drive", &["drive", "fmu-export"]),
    ("pmsm-drive-mean", &["drive", "fmu-export"]),
    ("mapped-drive", &["drive", "fmu-export"]),
    ("fmurun", &["drive-tools", "fmu-import", "fmu-plot", "fmu-sweep", "fmu-system", "model-description"]),
    (
        "fmu",
        &[
            "cargo-fmu",
            "drive",
            "drive-study",
            "drive-tools",
            "fmu-check",
            "fmu-core",
            "fmu-import",
            "fmu-pack",
            "fmu-plot",
            "fmu-sweep",
            "fmu-system",
            "model-description",
        ],
    ),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO")).args(arguments).current_dir(root()).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The crates of the workspace: folder, and the crates of the workspace that they depend on (not for tests).
fn crates() -> BTreeMap<String, (PathBuf, BTreeSet<String>)> {
    let json = cargo(&["metadata", "--offline", "--no-deps", "--format-version", "1"]);
    let metadata: serde_json::Value = serde_json::from_str(&json).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let text = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
    let names: BTreeSet<String> = packages.iter().map(|p| text(&p["name"])).collect();
    let one = |p: &serde_json::Value| {
        let manifest = PathBuf::from(text(&p["manifest_path"]));
        let all = p["dependencies"].as_array().unwrap().iter();
        let known = all.filter(|d| d["kind"].is_null()).map(|d| text(&d["name"])).filter(|n| names.contains(n));
        (text(&p["name"]), (manifest.parent().unwrap().to_owned(), known.collect()))
    };
    packages.iter().map(one).collect()
}

#[test]
fn every_arrow_goes_one_way() {
    let crates = crates();
    for (name, allowed) in ARROWS {
        let (_, known) = &crates[*name];
        let allowed: BTreeSet<String> = allowed.iter().map(|&a| a.to_owned()).collect();
        let more: Vec<_> = known.difference(&allowed).collect();
        assert!(
            more.is_empty(),
            "{name} may not depend on {more:?}: see ARCHITECTURE.md and this list for the allowed dependencies"
        );
    }
    let listed: BTreeSet<&str> = ARROWS.iter().map(|(name, _)| *name).collect();
    // An FMU of the examples depends on the same crates as an author's.
    let author = BTreeSet::from(["fmu-core".to_owned(), "fmu-export".to_owned()]);
    let is_example = |folder: &Path| folder.starts_with(root().join("examples"));
    let foreign = crates.values().find(|(folder, known)| is_example(folder) && !known.is_subset(&author));
    assert!(foreign.is_none(), "{foreign:?} depends on more than an author's package does");
    let others = crates.iter().filter(|(name, (folder, _))| !listed.contains(name.as_str()) && !is_example(folder));
    let others: Vec<_> = others.map(|(name, _)| name).collect();
    assert_eq!(others, ["faulty-fmu", "instructions", "ticks-fmu", "types-fmu"], "a new crate needs its row");
}

fn known_to(name: &str) -> BTreeSet<String> {
    let tree = cargo(&["tree", "--offline", "-p", name, "-e", "normal", "--prefix", "none"]);
    tree.lines().filter_map(|line| line.split(' ').next()).map(str::to_owned).collect()
}

#[test]
fn the_checker_knows_no_motor_no_plotter_and_no_system() {
    let known = known_to("fmu-check");
    assert!(known.contains("fmu-import") && known.contains("quick-xml"), "{known:?}");
    for foreign in
        ["drive", "drive-tools", "drive-study", "fmu-plot", "fmu-system", "nalgebra", "resvg", "libm", "anyhow"]
    {
        assert!(!known.contains(foreign), "fmu-check depends on {foreign}");
    }
}

#[test]
fn what_builds_fmus_knows_no_motor_and_no_command_line() {
    let known = known_to("fmu-pack");
    assert!(known.contains("fmu-system") && known.contains("resvg"), "{known:?}");
    for foreign in ["drive", "drive-tools", "drive-study", "fmu-check", "fmu-sweep", "nalgebra", "anyhow", "clap"] {
        assert!(!known.contains(foreign), "fmu-pack depends on {foreign}");
    }
}

/// What an author installs is small: under 60 crates.
#[test]
fn the_command_of_an_author_knows_no_motor_no_checker_and_no_fonts() {
    let tree = cargo(&["tree", "--offline", "-p", "cargo-fmu", "-e", "normal,build", "--prefix", "none"]);
    let known: BTreeSet<&str> = tree.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    assert!((30..60).contains(&known.len()), "{} crates: {known:?}", known.len());
    let names: BTreeSet<&str> = known.iter().filter_map(|line| line.split(' ').next()).collect();
    for foreign in ["drive", "drive-tools", "drive-study", "fmu-check", "fmu-sweep", "nalgebra", "resvg", "toml"] {
        assert!(!names.contains(foreign), "cargo-fmu depends on {foreign}");
    }
}

/// A library has an error type with cases or a text; only the commands collect errors of every kind.
#[test]
fn the_commands_alone_depend_on_anyhow() {
    for (name, (folder, _)) in &crates() {
        let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        assert_eq!(manifest.contains("\nanyhow"), ["fmu", "cargo-fmu"].contains(&name.as_str()), "{name}");
    }
}

/// Dependencies that are not named in the code: they choose a feature of another crate.
const FEATURES: &[(&str, &str)] = &[
    ("cargo-fmu", "once_cell"),
    ("fmu-import", "flate2"),
    ("fmurun", "bytemuck"),
    ("fmurun", "flate2"),
    ("fmurun", "getrandom"),
    ("fmurun", "simd-adler32"),
];

#[test]
fn every_dependency_is_used() {
    for (name, (folder, _)) in crates().iter().filter(|(_, (folder, _))| folder.join("src").is_dir()) {
        let manifest: toml::Table = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap();
        let mut files = Vec::new();
        sources(&folder.join("src"), &mut files);
        let code: String = files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
        let all = manifest.get("dependencies").and_then(toml::Value::as_table).into_iter().flat_map(toml::Table::keys);
        for dependency in all.filter(|d| !FEATURES.contains(&(name.as_str(), d.as_str()))) {
            let named = dependency.replace('-', "_");
            assert!(code.contains(&format!("{named}::")), "{name} does not use {dependency}");
        }
    }
}

/// A file that the code includes is in its package: another package, or a folder above, is missing from what Cargo packs.
#[test]
fn included_files_are_packed() {
    let mut seen = 0;
    for (name, (folder, _)) in crates().iter().filter(|(_, (folder, _))| folder.join("src").is_dir()) {
        let mut files = Vec::new();
        sources(&folder.join("src"), &mut files);
        for file in files {
            let text = std::fs::read_to_string(&file).unwrap();
            // Tests are not compiled from a package.
            let code = text.split("#[cfg(test)]").next().unwrap();
            for part in code.split("include_str!(\"").skip(1).chain(code.split("include_bytes!(\"").skip(1)) {
                let path = file.parent().unwrap().join(part.split('"').next().unwrap()).canonicalize().unwrap();
                let owner = path.ancestors().skip(1).find(|folder| folder.join("Cargo.toml").is_file());
                assert_eq!(owner, Some(folder.canonicalize().unwrap().as_path()), "{name}: {}", path.display());
                seen += 1;
            }
        }
    }
    assert!(seen > 5, "{seen} included files");
}

/// The licenses and the registry that `deny.toml` allows.
#[test]
fn every_linked_crate_has_an_allowed_license_and_registry() {
    let rules: toml::Table = std::fs::read_to_string(root().join("deny.toml")).unwrap().parse().unwrap();
    let list = |section: &str, key: &str| -> BTreeSet<String> {
        rules[section][key].as_array().unwrap().iter().map(|text| text.as_str().unwrap().to_owned()).collect()
    };
    let (licenses, registries) = (list("licenses", "allow"), list("sources", "allow-registry"));
    let host = fmu_pack::target::host_triple().unwrap();
    let json = cargo(&["metadata", "--offline", "--locked", "--format-version", "1", "--filter-platform", &host]);
    let metadata: serde_json::Value = serde_json::from_str(&json).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 100);
    for package in packages {
        let name = package["name"].as_str().unwrap();
        // An expression in which each license of one alternative of every part is allowed.
        let expression = package["license"].as_str().unwrap_or_default().replace('/', " OR ").replace(['(', ')'], "");
        let allowed =
            expression.split(" AND ").all(|part| part.split(" OR ").any(|license| licenses.contains(license)));
        assert!(allowed, "{name}: {expression} is not in deny.toml");
        if let Some(source) = package["source"].as_str() {
            let known = source.strip_prefix("registry+").is_some_and(|registry| registries.contains(registry));
            assert!(known, "{name} comes from {source}, which is not in deny.toml");
        }
    }
}

/// A thread pool that outlives a call does not survive a fork, and random numbers come from the row.
#[test]
fn a_sweep_knows_no_motor_no_thread_pool_and_no_generator() {
    let known = known_to("fmu-sweep");
    assert!(known.contains("fmu-system") && known.contains("libm"), "{known:?}");
    for foreign in
        ["drive", "drive-tools", "drive-study", "fmu-plot", "resvg", "clap", "indicatif", "rayon", "rayon-core", "rand"]
    {
        assert!(!known.contains(foreign), "fmu-sweep depends on {foreign}");
    }
}

/// The release profile saves compile time in the crates used only by the command.
#[test]
fn what_an_fmu_links_is_fully_optimized() {
    let manifest: toml::Table = std::fs::read_to_string(root().join("Cargo.toml")).unwrap().parse().unwrap();
    let lower = manifest["profile"]["release"]["package"].as_table().unwrap();
    assert!(lower.contains_key("fmu-check"));
    let examples = crates().into_iter().filter(|(_, (folder, _))| folder.starts_with(root().join("examples")));
    let examples: Vec<String> = examples.map(|(name, _)| name).collect();
    let fmus = [
        "mapped-drive",
        "pmsm-drive",
        "pmsm-drive-mean",
        "pmsm-plant",
        "sensorless-controller",
        "sensorless-controller-clocked",
    ];
    for fmu in fmus.into_iter().chain(examples.iter().map(String::as_str)) {
        let linked = known_to(fmu);
        let lowered = |name: &&String| lower.get(*name).is_some_and(|set| set.get("opt-level").is_some());
        let slow: Vec<_> = linked.iter().filter(lowered).collect();
        assert!(slow.is_empty(), "{fmu} links {slow:?}");
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
        if entry.is_dir() {
            sources(&entry, found);
        } else if entry.extension().is_some_and(|e| e == "rs") {
            found.push(entry);
        }
    }
}

#[test]
fn unsafe_stands_in_the_three_interfaces_to_c_alone() {
    let crates = crates();
    for (name, _) in ARROWS {
        let (folder, _) = &crates[*name];
        let source = |file: &str| std::fs::read_to_string(folder.join("src").join(file)).unwrap_or_default();
        let (lib, main) = (source("lib.rs"), source("main.rs"));
        if ["fmu-export", "fmu-import", "virtual-motor"].contains(name) {
            assert!(lib.contains("#![deny(unsafe_code)]"), "{name}");
            assert_eq!(lib.matches("#[allow(unsafe_code)]").count(), 1, "{name}: only the module abi");
            let mut files = Vec::new();
            sources(&folder.join("src"), &mut files);
            for file in files.iter().filter(|f| !f.starts_with(folder.join("src/abi"))) {
                let text = std::fs::read_to_string(file).unwrap();
                let allows = text.matches("allow(unsafe_code)").count();
                let expected = usize::from(file.ends_with("lib.rs"));
                assert_eq!(allows, expected, "{}", file.display());
            }
        } else if *name == "fmurun" {
            // PyO3's macros expand to `unsafe` with an `allow`, which `forbid` rejects.
            assert!(lib.contains("#![deny(unsafe_code)]"), "{name}");
            let mut files = Vec::new();
            sources(&folder.join("src"), &mut files);
            for file in files {
                let text = std::fs::read_to_string(&file).unwrap();
                assert!(!text.contains("allow(unsafe_code)") && !text.contains("unsafe {"), "{}", file.display());
            }
        } else if folder.starts_with(root().join("fmus")) {
            // One line each: export!, which expands to the functions of the C interface.
            assert!(lib.lines().filter(|l| !l.starts_with("//") && !l.is_empty()).count() <= 2, "{name}: {lib}");
        } else {
            for text in [&lib, &main].into_iter().filter(|text| !text.is_empty()) {
                assert!(text.contains("#![forbid(unsafe_code)]"), "{name} does not forbid unsafe code");
            }
        }
    }
}

/// An FMU reads the environment and writes files only for its call log.
#[test]
fn the_call_log_alone_reads_the_environment_and_writes_files() {
    let source = root().join("fmu-export/src");
    let mut files = Vec::new();
    sources(&source, &mut files);
    assert!(files.len() > 30, "{files:?}");
    let mut found = BTreeSet::new();
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let words = ["use std::env", "std::env::", "OpenOptions", "File::create", "fs::write", "create_dir"];
        for word in words.into_iter().filter(|word| text.contains(word)) {
            found.insert((file.strip_prefix(&source).unwrap().to_owned(), word));
        }
    }
    let expected = ["OpenOptions", "use std::env"].map(|word| (PathBuf::from("call_log.rs"), word));
    assert_eq!(found, BTreeSet::from(expected));
}

/// An estimator checks a small view of the controller, so the controller depends on the estimators, and they do not depend on it.
#[test]
fn an_estimator_does_not_know_the_controller() {
    let mut files = Vec::new();
    sources(&root().join("drive/control/src/estimator"), &mut files);
    assert!(files.len() > 25, "{files:?}");
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        for path in text.split("crate::").skip(1).map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_')) {
            let module = path.into_iter().next().unwrap();
            assert!(module == "estimator", "{} depends on the controller through crate::{module}", file.display());
        }
    }
}

/// A file of the checker names the module of a type; types at the root would tie all files into one circle.
#[test]
fn no_module_of_the_checker_depends_on_its_root() {
    let mut files = Vec::new();
    sources(&root().join("fmu-check/src"), &mut files);
    assert!(files.len() > 30, "{files:?}");
    let own = ["lib.rs", "main.rs", "command.rs"].map(|name| root().join("fmu-check/src").join(name));
    for file in files.iter().filter(|file| !own.contains(file)) {
        let text = std::fs::read_to_string(file).unwrap();
        let root_of = ["use crate::", "use super::"].map(|path| text.split(path).skip(1).collect::<Vec<_>>()).concat();
        let named = root_of.iter().find(|rest| rest.starts_with(|c: char| c == '{' || c.is_uppercase()));
        assert!(
            named.is_none(),
            "{}: imports from the root: {}",
            file.display(),
            named.unwrap().lines().next().unwrap()
        );
    }
}

/// The public types in the sources of a crate, each with its file.
fn public_types(folder: &Path) -> Vec<(String, PathBuf)> {
    let (mut files, mut found) = (Vec::new(), Vec::new());
    if folder.join("src").is_dir() {
        sources(&folder.join("src"), &mut files);
    }
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap();
        for line in code.lines().filter_map(|line| line.trim().strip_prefix("pub ")) {
            let kinds = ["struct ", "enum ", "trait ", "type ", "union "];
            let Some(rest) = kinds.iter().find_map(|kind| line.strip_prefix(kind)) else { continue };
            let name = rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap();
            // A macro names its type by a variable.
            if !name.is_empty() {
                found.push((name.to_owned(), file.clone()));
            }
        }
    }
    found
}

/// Public types of a crate have unique names: a word means one thing.
#[test]
fn no_two_public_types_of_a_crate_share_a_name() {
    for (name, (folder, _)) in &crates() {
        let mut found = BTreeMap::new();
        for (of, file) in public_types(folder) {
            let other = found.insert(of.clone(), file.clone());
            assert!(other.is_none(), "{name}: {of} is in {} and in {}", file.display(), other.unwrap().display());
        }
    }
}

/// Names of public types that several crates share.
const SHARED: &[(&str, &[&str])] = &[
    (
        "one for each crate or command",
        &["Atlas", "Error", "Info", "Kind", "Map", "Options", "Report", "Result", "Sweep"],
    ),
    (
        "a term of FMI or of XML, in the exporter, the importer and the description",
        &[
            "Alias",
            "Call",
            "DisplayUnit",
            "Element",
            "Experiment",
            "FmuState",
            "Instance",
            "Interface",
            "Item",
            "Member",
            "Next",
            "State",
            "Status",
            "Terminal",
            "TerminalPicture",
            "Unit",
        ],
    ),
    (
        "a part of the drive, and its data in a motor file",
        &["DcLink", "FluxMap", "Inverter", "Iron", "Machine", "Mechanics", "Saturation"],
    ),
    (
        "two meanings, one of them in a crate of the drive; the list may only become shorter",
        &[
            "Block",
            "Energy",
            "Entry",
            "Field",
            "Identified",
            "Limit",
            "Measured",
            "Motion",
            "Point",
            "Quantity",
            "Schedule",
            "Table",
            "Timing",
            "Value",
            "Verdict",
            "Voltage",
        ],
    ),
];

/// A public type has a name that no other crate uses with another meaning.
#[test]
fn no_two_crates_share_the_name_of_a_public_type() {
    let (crates, mut found) = (crates(), BTreeMap::<String, BTreeSet<&str>>::new());
    for (name, _) in ARROWS {
        for (of, _) in public_types(&crates[*name].0) {
            found.entry(of).or_default().insert(name);
        }
    }
    let shared: BTreeMap<_, _> = found.iter().filter(|(_, crates)| crates.len() > 1).collect();
    let listed: BTreeSet<String> = SHARED.iter().flat_map(|(_, names)| *names).map(|&name| name.to_owned()).collect();
    let new: Vec<_> = shared.iter().filter(|(name, _)| !listed.contains(**name)).collect();
    assert!(new.is_empty(), "public types with the name of a type of another crate: {new:?}");
    let gone: Vec<_> = listed.iter().filter(|&name| !shared.contains_key(name)).collect();
    assert!(gone.is_empty(), "remove from SHARED, because only one crate has the type: {gone:?}");
}

/// A line of source fits a screen; rows of a long table are split into several lines.
#[test]
fn no_line_is_longer_than_160_characters() {
    for (folder, _) in crates().values() {
        let mut files = Vec::new();
        for part in ["src", "tests", "benches"].map(|part| folder.join(part)).iter().filter(|part| part.is_dir()) {
            sources(part, &mut files);
        }
        for file in files {
            let text = std::fs::read_to_string(&file).unwrap();
            let long = text.lines().position(|line| line.chars().count() > 160).map(|at| at + 1);
            assert!(long.is_none(), "{}:{}", file.display(), long.unwrap());
        }
    }
}

/// Large circles of files that stay.
///
/// In fmu-core, a table is an array of rows, a row has a table within, and a capability is a trait that needs a table: one
/// recursive type in many files. In fmu-export, the files of the calls are `impl` blocks of `Instance`, which its own calls
/// use.
const STAYING: &[(&str, &[&str])] = &[
    (
        "fmu-core",
        &[
            "capability.rs",
            "clock.rs",
            "continuous.rs",
            "enumeration.rs",
            "events.rs",
            "integer.rs",
            "intermediate.rs",
            "kinds.rs",
            "list.rs",
            "model.rs",
            "reals.rs",
            "row.rs",
            "row/slot.rs",
            "rules.rs",
            "saved.rs",
            "sizes.rs",
            "table.rs",
            "token.rs",
            "variable.rs",
        ],
    ),
    (
        "fmu-export",
        &[
            "access.rs",
            "binary.rs",
            "blob.rs",
            "clocks.rs",
            "exchange.rs",
            "inside.rs",
            "instance.rs",
            "message.rs",
            "origin.rs",
            "preset.rs",
            "registry.rs",
            "sensitivity.rs",
            "snapshot.rs",
        ],
    ),
];

/// Small circles: a type in two files, or a function that calls its parts, which call it.
const SMALL: &[(&str, &[&str])] = &[
    ("fmu", &["commands/build.rs", "commands/page/mod.rs", "commands/page/site.rs"]),
    ("fmu", &["commands/preset.rs", "commands/preset/motor.rs", "commands/tune.rs"]),
    ("cargo-fmu", &["simulate.rs", "simulate/output.rs"]),
    (
        "fmu-core",
        &[
            "description.rs",
            "description/checks.rs",
            "description/clocks.rs",
            "description/sizes.rs",
            "description/terminals.rs",
        ],
    ),
    ("fmu-core", &["integrate.rs", "integrate/euler.rs"]),
    ("fmu-export", &["abi/fault.rs", "abi/gate.rs", "abi/mod.rs", "abi/types.rs"]),
    ("fmu-import", &["instance.rs", "instance/clocks.rs"]),
    ("fmu-system", &["cosimulation/exchange.rs", "cosimulation/loops.rs"]),
];

/// Dependencies between files go one way, so a file can be read alone.
#[test]
fn the_circles_of_files_are_those_listed() {
    assert!(STAYING.len() <= 2 && STAYING.len() + SMALL.len() <= 10, "too many circles of files");
    assert!(SMALL.iter().all(|(_, files)| files.len() <= 5), "a circle of more than 5 files is not small");
    let mut found = BTreeSet::new();
    for (name, (folder, _)) in crates() {
        let src = folder.join("src");
        let root = if src.join("lib.rs").is_file() { "lib.rs" } else { "main.rs" };
        if src.join(root).is_file() {
            found.extend(circles::circles(&src, root).into_iter().map(|files| (name.clone(), files)));
        }
    }
    let owned = |(name, files): &(&str, &[&str])| (name.to_string(), files.iter().map(ToString::to_string).collect());
    let listed: BTreeSet<(String, Vec<String>)> = STAYING.iter().chain(SMALL).map(owned).collect();
    let new: Vec<_> = found.difference(&listed).collect();
    assert!(new.is_empty(), "files that name each other in a circle: {new:#?}");
    let gone: Vec<_> = listed.difference(&found).collect();
    assert!(gone.is_empty(), "remove from the list, because these files form no circle: {gone:#?}");
}
