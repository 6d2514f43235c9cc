//! The commands that the pages show, run in the order of their page.

use crate::common;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// Commands that need minutes, a build, or another program: tests of their own run them.
const ELSEWHERE: [&str; 12] =
    ["atlas", "bode", "build", "check", "compare", "map", "merge", "new", "page", "prove", "reproduce", "sweep"];

/// Files that a page leaves to its reader, or that a build of other packages writes.
const OF_THE_READER: [&str; 4] = ["BouncingBall.fmu", "CanSensor.fmu", "MyModel.fmu", "system.ssp"];

/// The commands of a page: continued lines as one, without comments.
fn commands(page: &Path) -> Vec<String> {
    let text = fs::read_to_string(page).unwrap().replace("\\\n", " ");
    let blocks = text.split("```sh\n").skip(1).map(|block| block.split("```").next().unwrap_or_default());
    let lines = blocks.flat_map(str::lines).map(|line| line.split(" #").next().unwrap_or_default().trim());
    let whole = lines.map(|line| match line.strip_prefix("cargo run --release -- ") {
        Some(rest) => format!("fmu {rest}"),
        None => line.to_owned(),
    });
    // Without this option, it builds the FMUs of the checkout.
    let built = whole.map(|line| line.replace("fmu ssp --motor", "fmu ssp --fmus target/fmu --motor"));
    built.filter(|line| line.starts_with("fmu ")).collect()
}

/// A folder with what a checkout has after `fmu build`, for the commands of one page.
fn checkout(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = common::python::scratch().join(format!("pages-{name}"));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(folder.join("target")).unwrap();
    fs::create_dir_all(folder.join("docs")).unwrap();
    for shared in ["motors", "examples"] {
        std::os::unix::fs::symlink(root.join(shared), folder.join(shared)).unwrap();
    }
    std::os::unix::fs::symlink(common::archives(), folder.join("target/fmu")).unwrap();
    fs::copy(common::archives().join("fmi3/PmsmDrive.fmu"), folder.join("PmsmDrive.fmu")).unwrap();
    fs::copy(root.join("examples/bench.csv"), folder.join("bench.csv")).unwrap();
    folder
}

/// Each command succeeds; no drive loses its rotor, unless the page wants it.
#[test]
fn the_commands_of_the_pages_run() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut pages: Vec<PathBuf> = fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path()).collect();
    pages.push(root.join("README.md"));
    pages.retain(|page| page.extension().is_some_and(|extension| extension == "md"));
    pages.sort();
    let program = Path::new(env!("CARGO_BIN_EXE_fmu"));
    let path = env::join_paths(
        [program.parent().unwrap().to_owned()].into_iter().chain(env::split_paths(&env::var_os("PATH").unwrap())),
    );
    let path = path.unwrap();
    let (mut run, mut left, mut failed) = (0, Vec::new(), Vec::new());
    for page in pages {
        let folder = checkout(page.file_stem().unwrap().to_str().unwrap());
        for command in commands(&page) {
            let subcommand = command.split_whitespace().nth(1).unwrap_or_default();
            if ELSEWHERE.contains(&subcommand) {
                continue;
            }
            let reads = |file: &&&str| command.split([' ', '\'', '#', '/']).any(|word| word == **file);
            if let Some(file) = OF_THE_READER.iter().find(reads) {
                left.push(*file);
                continue;
            }
            let output =
                Command::new("sh").args(["-c", &command]).current_dir(&folder).env("PATH", &path).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            // `fmu identify` ends with 1 where it refuses a value.
            let succeeds = output.status.success() || subcommand == "identify" && output.status.code() == Some(1);
            let lost = said.contains("lock_lost") != command.contains("controller.motor.R_s=4");
            if !succeeds || lost {
                failed.push(format!("{}: {command}\n{}: {said}", page.display(), output.status));
            }
            run += 1;
        }
        fs::remove_dir_all(&folder).unwrap();
    }
    println!("{run} commands");
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    left.sort_unstable();
    left.dedup();
    assert_eq!(left, OF_THE_READER, "a file of OF_THE_READER that no command reads");
    assert!(run > 30, "{run} commands");
}
