//! The committed corpora of the fuzz targets, each input through the function that its target fuzzes; an input that once crashed is one of
//! them. `fuzz/run` searches for others. The target `calls` has its corpus in the tests of fmu-export.
#![allow(missing_docs)]

#[path = "../fuzz/subjects/answers.rs"]
mod answers;
#[path = "../fuzz/subjects/archive.rs"]
mod archive;
#[path = "../fuzz/subjects/description.rs"]
mod description;
#[path = "../fuzz/subjects/ssp.rs"]
mod ssp;
#[path = "../fuzz/subjects/states.rs"]
mod states;
#[path = "../fuzz/subjects/text.rs"]
mod text;
#[path = "stored/trial.rs"]
#[allow(dead_code, reason = "the test of stored states needs more")]
mod trial;

use std::path::Path;
use std::time::{Duration, Instant};

/// As for the fuzzer.
const LONGEST: Duration = Duration::from_secs(10);

fn corpus(target: &str, run: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(files.len() > 1, "{} inputs", files.len());
    for file in files {
        println!("{}", file.display());
        let begun = Instant::now();
        run(&std::fs::read(&file).unwrap());
        assert!(begun.elapsed() < LONGEST, "{}: {:?}", file.display(), begun.elapsed());
    }
}

macro_rules! corpora {
    ($($target:ident),*) => {
        $(#[test]
        fn $target() {
            corpus(stringify!($target), $target::run);
        })*
    };
}

corpora!(answers, archive, description, ssp, states, text);
