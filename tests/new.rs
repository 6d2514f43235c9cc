//! `fmu new`: all steps from an empty folder to a checked FMU in FMPy, and invalid names.
#![allow(missing_docs)]

mod common;

use common::python;
use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Instant;

const FMU: &str = env!("CARGO_BIN_EXE_fmu");

/// A command in a folder, with the two programs of the command first in `PATH`, as when they are installed.
fn command(program: &str, folder: &Path) -> Command {
    let own = Path::new(FMU).parent().unwrap();
    let inherited = env::var_os("PATH").unwrap_or_default();
    let paths = std::iter::once(own.to_owned()).chain(env::split_paths(&inherited));
    let mut command = Command::new(program);
    command.current_dir(folder).env("PATH", env::join_paths(paths).unwrap()).env_remove("CARGO_TARGET_DIR");
    command
}

fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

fn succeeds(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", text(&output));
    text(&output)
}

/// Heated by 100 W from 20 degC, after 1000 s: 20 degC + 50 K (1 - exp(-4)), in every interface of both standards.
const IN_FMPY: &str = "
import math, sys, fmpy
for path in sys.argv[1:]:
    for kind in ['CoSimulation', 'ModelExchange']:
        result = fmpy.simulate_fmu(path, fmi_type=kind, start_values={'heat': 100}, stop_time=1000, relative_tolerance=1e-8)
        error = result['T'][-1] - (293.15 + 50 * (1 - math.exp(-4)))
        assert abs(error) < (1e-6 if kind == 'CoSimulation' else 1e-3), (path, kind, error)
        print(path, kind, error)
";

/// Outside of any checkout: `fmu new`, then the steps of the project's file for CI.
#[test]
#[expect(clippy::too_many_lines, reason = "one way from the name to FMPy, in order")]
fn from_a_name_to_a_checked_fmu_in_fmpy() {
    let requirements = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy/requirements.txt");
    let python = python::environment(&requirements);
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("my-model");
    let start = Instant::now();
    let said = succeeds(command("fmu", dir.path()).args(["new", "my-model"]));
    assert!(said.contains("my-model: the FMU MyModel"), "{said}");
    // All dependencies have the versions of this workspace.
    succeeds(command("cargo", &folder).args(["metadata", "--locked", "--format-version", "1"]));
    let ci = fs::read_to_string(folder.join(".github/workflows/fmu.yml")).unwrap();
    let steps: Vec<&str> = ci.lines().map(|l| l.trim().trim_start_matches("run: ")).collect();
    let steps: Vec<&str> =
        steps.into_iter().filter(|l| ["cargo test", "fmu ", "fmpy "].iter().any(|p| l.starts_with(p))).collect();
    assert_eq!(steps.len(), 5, "{ci}");
    for step in &steps {
        // The scripts of the virtual environment do not start: it was moved when it was complete.
        let step = step.replace("fmpy ", &format!("{} -m fmpy ", python.display()));
        let mut words = step.split(' ');
        let said = succeeds(command(words.next().unwrap(), &folder).args(words));
        let printed = match step.as_str() {
            "cargo test" => "1 passed",
            "fmu build" => "target/fmu/fmi3/MyModel.fmu",
            check if check.starts_with("fmu check") => {
                "2 files, 0 of which violate requirements of the standard (must)."
            }
            _ => "",
        };
        assert!(said.contains(printed) && !said.contains("warning"), "{step}: {said}");
    }
    let archives = ["target/fmu/fmi2/MyModel.fmu", "target/fmu/fmi3/MyModel.fmu"];
    let said = succeeds(command(python.to_str().unwrap(), &folder).args(["-c", IN_FMPY]).args(archives));
    assert_eq!(said.lines().count(), 4, "{said}");
    println!("{said}from the name to FMPy: {:.0} s", start.elapsed().as_secs_f64());

    let simulate = ["simulate", archives[1], "--input", "heat=100", "--set", "T_ambient=10degC", "--stop", "1000"];
    let said = succeeds(command("fmu", &folder).args(simulate).args(["--csv", "-"]));
    let last = said.lines().find(|line| line.starts_with("1000,")).unwrap();
    let last: f64 = last.split(',').nth(1).unwrap().parse().unwrap();
    assert!((last - (333.15 - 40.0 * (-4.0_f64).exp())).abs() < 1e-6, "{last}");

    // A release: correct checksums, and the crates with their licenses.
    let host = fmu_pack::target::host_triple().unwrap();
    succeeds(command("fmu", &folder).args(["build", "--release-dir", "release", "--target", &host]));
    let release = folder.join("release");
    if cfg!(target_os = "linux") {
        let said = succeeds(command("sha256sum", &release).args(["--check", "--strict", "SHA256SUMS"]));
        for file in ["fmi2/MyModel.fmu: OK", "fmi3/MyModel.fmu: OK", "sbom.cdx.json: OK"] {
            assert!(said.contains(file), "{said}");
        }
    }
    let bill: serde_json::Value = serde_json::from_slice(&fs::read(release.join("sbom.cdx.json")).unwrap()).unwrap();
    let components = bill["components"].as_array().unwrap();
    let of = |name: &str| components.iter().find(|c| c["name"] == name).unwrap();
    assert_eq!((&of("my-model")["type"], &of("my-model")["purl"]), (&"application".into(), &serde_json::Value::Null));
    assert_eq!(of("postcard")["licenses"][0]["expression"], "MIT OR Apache-2.0");
    assert!(of("serde")["purl"].as_str().unwrap().starts_with("pkg:cargo/serde@1."), "{bill}");
    assert_eq!(bill["dependencies"][0]["dependsOn"].as_array().unwrap().len() + 1, components.len());

    // The licenses of all linked crates, the two included; no license for the model that its author did not choose.
    let files = fmu_import::contents(&folder.join(archives[1])).unwrap().1;
    for file in ["MyModel_ref.csv", "MyModel_in.csv", "smoke-test.exp", "fmi-ls-manifest.xml"] {
        assert!(files.contains_key(&format!("extra/org.fmi-standard.fmi-ls-ref/{file}")), "{file}");
    }
    let licenses = String::from_utf8_lossy(&files["documentation/licenses/license.txt"]).into_owned();
    for part in ["fmu-core 0.1.0: MIT OR Apache-2.0", "serde 1.0", "fmu-core, fmu-export\n\nMIT License"] {
        assert!(licenses.contains(part), "{part}: {licenses}");
    }
    assert!(!licenses.contains("my-model 0.1.0"), "{licenses}");
    // The written files contain no path of the checkout or of the project.
    let root = env!("CARGO_MANIFEST_DIR");
    for file in walk(&folder).iter().filter(|f| !f.starts_with(folder.join("target"))) {
        assert!(!String::from_utf8_lossy(&fs::read(file).unwrap()).contains(root), "{}", file.display());
    }
    let binary = files.iter().find(|(name, _)| name.starts_with("binaries/")).unwrap().1;
    assert!(!binary.windows(root.len()).any(|w| w == root.as_bytes()), "the binary names a folder of this machine");

    // A default experiment that fails is an error, and the archives of before stay.
    let (stimuli, before) = (folder.join("stimuli.csv"), fs::read(folder.join(archives[1])).unwrap());
    let right = fs::read_to_string(&stimuli).unwrap();
    fs::write(&stimuli, "time,hea\n0,1\n").unwrap();
    let output = command("fmu", &folder).arg("build").output().unwrap();
    let said = text(&output);
    let line = said.lines().find(|line| line.starts_with("error: ")).unwrap();
    assert!(output.status.code() == Some(1) && line.contains("MyModel: the default experiment fails: "), "{said}");
    assert!(line.contains("hea") && line.ends_with("or build with --no-reference"), "{said}");
    assert_eq!(fs::read(folder.join(archives[1])).unwrap(), before);
    succeeds(command("fmu", &folder).args(["build", "--no-reference"]));
    assert!(fmu_import::contents(&folder.join(archives[1])).unwrap().1.keys().all(|name| !name.contains("fmi-ls-ref")));
    fs::write(&stimuli, right).unwrap();

    // The description of an unchanged library is kept: the model does not run again.
    let files = walk(&folder.join("target/fmu-build"));
    let kept = files.iter().find(|file| file.ends_with("release/libmy_model.description.json")).unwrap();
    let description = fs::read_to_string(kept).unwrap();
    let other = description.replacen("\"description\":\"", "\"description\":\"Kept: ", 1);
    assert_ne!(other, description);
    fs::write(kept, other).unwrap();
    succeeds(command("fmu", &folder).args(["build", "--no-reference"]));
    let files = fmu_import::contents(&folder.join(archives[1])).unwrap().1;
    assert!(String::from_utf8_lossy(&files["modelDescription.xml"]).contains("description=\"Kept: "));

    // A build for development has the paths of the sources, for a debugger, and no reference result.
    let lines = ("CARGO_PROFILE_DEV_DEBUG", "line-tables-only");
    succeeds(command("fmu", &folder).args(["build", "--dev"]).env(lines.0, lines.1));
    let files = fmu_import::contents(&folder.join(archives[1])).unwrap().1;
    let binary = files.iter().find(|(name, _)| name.starts_with("binaries/")).unwrap().1;
    let path = folder.to_str().unwrap().as_bytes();
    assert!(binary.windows(path.len()).any(|w| w == path), "the binary does not name the folder of its sources");
    assert!(files.keys().all(|name| !name.contains("fmi-ls-ref")));

    // A mistake of the model found while `fmu build` varies its parameters is reported with the model's message.
    let source = folder.join("src/lib.rs");
    let right = fs::read_to_string(&source).unwrap();
    let mistake =
        "assert!(self.conductance < 3.0, \"{} W/K is too much\", self.conductance);\n        *out = Outputs {";
    let wrong = right.replacen("*out = Outputs {", mistake, 1);
    assert_ne!(wrong, right);
    fs::write(&source, wrong).unwrap();
    let output = command("fmu", &folder).args(["build", "--dev"]).env(lines.0, lines.1).output().unwrap();
    let said = text(&output);
    assert!(!output.status.success(), "{said}");
    let line = said.lines().find(|line| line.starts_with("error: ")).unwrap();
    assert!(
        line.contains("a fault in the model's code (panic): ") && line.contains(" W/K is too much (src/lib.rs:"),
        "{said}"
    );
    println!("{line}");
}

fn walk(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] }).collect()
}

/// Lines that are neither blank nor part of the model: the manifest, imports, derives, the export line, the module of tests.
#[test]
fn at_most_20_lines_are_not_the_model() {
    let template = Path::new(env!("CARGO_MANIFEST_DIR")).join("cargo-fmu/template");
    let read = |name: &str| fs::read_to_string(template.join(name)).unwrap();
    let manifest = read("manifest.toml").replace("{dependencies}", "fmu-core\nfmu-export");
    let beside = |line: &&str| ["use ", "#[", "fmu_export::", "mod tests"].iter().any(|p| line.starts_with(p));
    let lines = manifest.lines().filter(|l| !l.is_empty()).count() + read("lib.rs").lines().filter(beside).count();
    assert!((15..=20).contains(&lines), "{lines}");
}

#[test]
fn what_cannot_be_made_is_refused_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("there")).unwrap();
    let refused = |folder: &Path, name: &str, part: &str| {
        let output = command(FMU, folder).args(["new", "--", name]).output().unwrap();
        let said = text(&output);
        assert_eq!(output.status.code(), Some(2), "{name}: {said}");
        assert!(said.lines().count() == 1 && said.starts_with(&format!("error: {name}: ")), "{said}");
        assert!(said.contains(part), "{name}: {part:?} is not in {said}");
    };
    for (name, part) in [
        ("1x", "does not start with a letter: a name starts with a letter and has letters a to z, digits, - and _"),
        ("-x", "does not start with a letter"),
        ("a b", "has the character ' '"),
        ("größe", "has the character 'ö'"),
        ("a/b", "is a path: change to a and run fmu new b"),
        ("/b", "is a path: change to / and run fmu new b"),
        ("match", "is a keyword of Rust: choose another name, for example match-model"),
        ("test", "is a name of Rust or Cargo: choose another name, for example test-model"),
        ("serde", "is a package that the FMU itself needs: choose another name, for example serde-model"),
        ("syn", "is a package that the FMU itself needs"),
        ("there", "already exists: choose another name, or remove it"),
        (&"x".repeat(65), "has 65 characters: at most 64 are allowed"),
    ] {
        refused(dir.path(), name, part);
    }
    refused(dir.path(), "", "does not start with a letter");
    if cfg!(target_os = "linux") {
        refused(Path::new("/proc"), "my-model", "cannot be written in /proc: change to a folder that you may write");
    }
    assert!(walk(dir.path()).is_empty(), "nothing is left");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "the folder that was there");
}
