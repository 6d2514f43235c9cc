//! `fmu sweep`: many runs from one file.

use anyhow::{Context, Result, bail};
use cargo_fmu::message;
use clap::Args;
use fmu_import::whole;
use fmu_sweep::isolate::Isolation;
use fmu_sweep::{Options, Progress, Report, Sweep as Definition, threads_here};
use indicatif::{ProgressBar, ProgressStyle};
use std::fs::File;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};

/// Runs FMUs many times with varied parameters and measures each run.
///
/// The file names the FMUs (or one SSP file), the varied variables, the design (grid, random, LHS, Sobol or a list) and the
/// measures: docs/sweeps.md and examples/sweep.toml. Results are rows of CSV in parts, in DIR, and at the end DIR/results.csv.
/// A row depends on the file, the seed and its number only, so results have the same bytes for any number of jobs.
///
/// Started again, even after a kill, the command runs the missing parts. Several processes may work on one DIR, for example the
/// tasks of an array job on a shared folder, each with its --part. A run that fails becomes a row with its error.
///
/// Exit status: 0 if all rows are good, 1 if some failed, 2 for wrong usage or an unusable file.
///
///   fmu sweep examples/sweep.toml --out target/sweep
///   fmu sweep examples/sweep.toml --out target/sweep --part 3/100 --jobs 1
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Sweep {
    /// Definition of the sweep
    #[arg(value_name = "SWEEP.toml")]
    pub file: PathBuf,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Threads, or processes with --isolate [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Run only the parts whose number leaves the remainder I when divided by N
    #[arg(long, value_name = "I/N", value_parser = part)]
    pub part: Option<(u64, u64)>,
    /// Stop after N rows, rounded up to whole parts; the next call continues
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub limit: Option<u64>,
    /// Remove the results in DIR and start again
    #[arg(long)]
    pub restart: bool,
    /// Run rows in separate processes: an FMU that crashes ends only its row
    #[arg(long)]
    pub isolate: bool,
    /// Check the file and list the missing parts in DIR
    #[arg(long, conflicts_with_all = ["jobs", "part", "limit", "restart", "isolate", "csv"])]
    pub dry_run: bool,
    /// Write all results as CSV once they are complete; - for standard output
    #[arg(long, value_name = "FILE|-")]
    pub csv: Option<PathBuf>,
}

/// Runs the command; returns whether all rows are good.
///
/// # Errors
/// The file, one that it names, or the folder is unusable.
pub fn run(args: &Sweep) -> Result<bool> {
    let sweep = Definition::open(&args.file)?;
    let watch = Shown::default();
    sweep.plan().notes().iter().for_each(|note| watch.note(note));
    if args.dry_run {
        return plan(&sweep, args);
    }
    let mut isolate = args.isolate;
    let jobs = args.jobs.map_or_else(threads_here, usize::from);
    if let Some(name) = sweep.plan().only_one_instance().filter(|_| !isolate && jobs > 1) {
        watch.note(&format!(
            "{name} allows only one instance per process: rows run in separate processes, as with --isolate"
        ));
        isolate = true;
    }
    let isolate = isolate.then(std::env::current_exe).transpose().context("the path of this program")?;
    let isolate = isolate.map(|program| Isolation { program, arguments: vec!["sweep-worker".into()] });
    let options = Options { jobs: Some(jobs), part: args.part, limit: args.limit, restart: args.restart, isolate };
    let outcome = fmu_sweep::run(&sweep, &args.out, &options, &watch);
    watch.end();
    report(&outcome?, &sweep, args)
}

fn report(report: &Report, sweep: &Definition, args: &Sweep) -> Result<bool> {
    let Report { rows, missing, results, failures, warned } = report;
    if let Some(text) = warned.sentence(*rows, |row| row) {
        message::warning(&text);
    }
    for (row, error) in &failures.first {
        eprintln!("row {row}: {error}");
    }
    let of = results.as_ref().map_or(*rows, |_| sweep.rows().count());
    if failures.count > 0 {
        eprintln!("{} of {of} rows failed", failures.count);
    }
    let Some(results) = results else {
        eprintln!("{rows} rows done; {missing} parts are missing: run the command again for them");
        return Ok(failures.count == 0);
    };
    match args.csv.as_deref() {
        Some(path) if path == Path::new("-") => {
            let mut file = File::open(results).with_context(|| results.display().to_string())?;
            match io::copy(&mut file, &mut io::stdout().lock()) {
                // A reader such as `head` closes the pipe early.
                Err(e) if e.kind() == io::ErrorKind::BrokenPipe => {}
                other => drop(other.context("standard output")?),
            }
        }
        other => {
            if let Some(path) = other {
                let of = || results.display().to_string();
                whole::write(path, &std::fs::read(results).with_context(of)?)?;
            }
            println!("{of} rows: {}", results.display());
        }
    }
    Ok(failures.count == 0)
}

/// Prints the parts that would run.
fn plan(sweep: &Definition, args: &Sweep) -> Result<bool> {
    let with_unit = |name: &str, unit: &str| if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") };
    let columns: Vec<String> = sweep.columns().iter().map(|c| with_unit(&c.name, &c.unit)).collect();
    println!("{} rows: {}", sweep.rows().count(), columns.join(", "));
    match fmu_sweep::missing(sweep, &args.out)? {
        None => println!("{}: not begun", args.out.display()),
        Some((missing, all, rows)) if missing.is_empty() => {
            println!("{}: all {all} parts of {rows} rows exist", args.out.display());
        }
        Some((missing, all, rows)) => {
            println!(
                "{}: {} of {all} parts of {rows} rows are missing: {}",
                args.out.display(),
                missing.len(),
                ranges(&missing)
            );
        }
    }
    Ok(true)
}

/// `0-3, 7`.
fn ranges(numbers: &[u64]) -> String {
    let of = |run: &[u64]| match run {
        [one] => one.to_string(),
        [first, .., last] => format!("{first}-{last}"),
        [] => String::new(),
    };
    numbers.chunk_by(|a, b| a + 1 == *b).map(of).collect::<Vec<_>>().join(", ")
}

fn part(text: &str) -> Result<(u64, u64)> {
    let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match numbers {
        Some((i, n)) if n > 0 && i <= n => Ok((i, n)),
        _ => bail!("expected I/N with I from 0 to N, such as 3/100"),
    }
}

/// Notes on standard error, and a bar on a terminal.
#[derive(Default)]
struct Shown {
    bar: std::sync::OnceLock<ProgressBar>,
}

impl Progress for Shown {
    fn note(&self, text: &str) {
        cargo_fmu::message::note(text);
    }

    fn progress(&self, done: u64, failed: u64, all: u64) {
        if !io::stderr().is_terminal() {
            return;
        }
        let bar = self.bar.get_or_init(|| {
            let style = ProgressStyle::with_template("{wide_bar} {pos} of {len} rows, {msg}, {per_sec}, {eta} left");
            ProgressBar::new(all).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        bar.set_message(format!("{failed} failed"));
        bar.set_position(done);
    }
}

impl Shown {
    fn end(&self) {
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_read_and_shown() {
        assert_eq!((part("3/100").unwrap(), part("100/100").unwrap()), ((3, 100), (100, 100)));
        assert!(["", "3", "4/3", "0/0", "-1/3", "a/b"].iter().all(|text| part(text).is_err()));
        assert_eq!(ranges(&[0, 1, 2, 3, 7, 9, 10]), "0-3, 7, 9-10");
    }
}
