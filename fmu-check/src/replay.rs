//! `--replay`: one probe, or one case of it, once more, with all its calls and their results.

use crate::check::{Options, Verdict};
use crate::checks::GROUPS;
use crate::error::Error;
use crate::fmu_file::FmuFile;
use crate::runner::Runner;
use fmu_import::printable_lines;
use std::path::Path;

/// Prints the calls of a check, `ID` or `ID#CASE`. Returns whether it found nothing.
pub(super) fn run(path: &Path, what: &str, options: &Options) -> Result<bool, Error> {
    let (id, case) = match what.split_once('#') {
        Some((id, case)) => match case.parse() {
            Ok(case) => (id, Some(case)),
            Err(_) => return Err(Error(format!("--replay {what}: {case} is not the number of a case"))),
        },
        None => (what, None),
    };
    let check = GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id.eq_ignore_ascii_case(id));
    let Some(check) = check.filter(|c| c.is_probe()) else {
        return Err(Error(format!("--replay {id}: unknown check of the binary; --list shows the checks")));
    };
    let fmu = FmuFile::open(path)?;
    let runner = Runner::new(&fmu, options).map_err(Error)?;
    let found = runner.replay(check, case)?;
    println!("\n");
    match found.verdict {
        Verdict::Violated(evidence) => {
            for text in evidence {
                println!("{id}: {}", printable_lines(&text));
            }
            return Ok(false);
        }
        Verdict::NotDetermined(why) | Verdict::NotApplicable(why) => println!("{id}: {}", printable_lines(&why)),
        Verdict::Pass(_) => println!("{id}: nothing found"),
    }
    Ok(true)
}
