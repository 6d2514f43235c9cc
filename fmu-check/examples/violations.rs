//! Lists what an FMU violates in its file, without running it: `cargo run -p fmu-check --example violations FILE.fmu`.

use fmu_check::{Options, run};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("expected the path of an FMU")?;
    // Checks of the binary need a program with the guard: `fmu-check` and `fmu check` have it.
    let only = ["archive", "xml", "structure", "variables"].map(String::from).to_vec();
    let report = run(Path::new(&path), &Options { only, ..Options::default() })?;
    for finding in report.violated() {
        println!("{}: {} ({})", finding.id, finding.requirement, finding.clause);
    }
    println!("{}", if report.conforms() { "conforms" } else { "does not conform" });
    Ok(())
}
