//! The committed corpus of the fuzz target `motor`, through the function that it fuzzes; `fuzz/run 60 motor` searches for others.
#![allow(missing_docs)]

#[path = "../../fuzz/subjects/motor.rs"]
mod motor;

#[test]
fn the_corpus() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus/motor");
    let files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(files.len() > 1, "{} inputs", files.len());
    for file in files {
        println!("{}", file.display());
        motor::run(&std::fs::read(&file).unwrap());
    }
}
