//! `fmu bode`: frequency responses of running FMUs.

mod arguments;
mod coupling;
mod loops;
mod output;

pub use arguments::Bode;

use anyhow::{Context, Result, anyhow, bail};
use cargo_fmu::Failed;
use cargo_fmu::message;
use cargo_fmu::system::EventOptions;
use cargo_fmu::worker;
use fmu_import::guard::Streams;
use fmu_import::{Instance, journal, printable};
use fmu_sweep::frequency::{Excitation, FrequencyOutcome};
use fmu_sweep::{Plan, threads_here};
use indicatif::{ProgressBar, ProgressStyle};
use loops::{Loop, Meaning, Probe};
use model_description::parse_number;
use output::Response;
use std::io::{IsTerminal, Write, stderr};
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

/// Maximum number of frequencies.
const MOST: usize = 10_000;

/// The frequencies (Hz) of the option.
fn frequencies(text: &str) -> Result<Vec<f64>> {
    let wrong = || {
        anyhow!(
            "--frequencies {text}: expected numbers above 0 such as 1,10,100, or FIRST:LAST:COUNT such as 1:1000:30"
        )
    };
    let number = |part: &str| part.trim().parse().ok().filter(|x: &f64| x.is_finite() && *x > 0.0).ok_or_else(wrong);
    let parts: Vec<&str> = text.split(':').collect();
    match parts[..] {
        [list] => list.split(',').map(number).collect(),
        [first, last, count] => {
            let (first, last, count) =
                (number(first)?, number(last)?, count.trim().parse::<u32>().map_err(|_| wrong())?);
            if count < 2 || count as usize > MOST || last <= first {
                return Err(wrong());
            }
            let share = |k: u32| f64::from(k) / f64::from(count - 1);
            Ok((0..count).map(|k| first * (last / first).powf(share(k))).collect())
        }
        _ => Err(wrong()),
    }
}

/// The start value of a variable: the one set, or that of the description.
fn value(args: &Bode, instance: &Instance, name: &str) -> Option<f64> {
    let given = args.system.given(instance.name(), name).ok().flatten();
    let text = given.or_else(|| instance.description().variable(name)?.start.clone())?;
    match text.as_str() {
        "true" => Some(1.0),
        "false" => Some(0.0),
        other => parse_number(other),
    }
}

/// The request made by the options.
fn probe(args: &Bode, instances: &[Instance]) -> Result<Probe> {
    if let Some(which) = args.which {
        let [instance] = instances else {
            bail!("--loop is for one FMU; --from, --to and --over name variables of several")
        };
        let probe = which.probe(instance.description(), |variable| value(args, instance, variable))?;
        // In Model Exchange, outputs are instantaneous.
        return Ok(if args.stepping.me { Probe { mean: 0.0, ..probe } } else { probe });
    }
    let meaning = match (args.closed, args.open) {
        (true, _) => Meaning::Closed,
        (_, true) => Meaning::Open,
        _ => Meaning::Plain,
    };
    Ok(Probe {
        from: args.from.clone().unwrap_or_default(),
        to: args.to.clone().unwrap_or_default(),
        over: args.over.clone(),
        meaning,
        mean: 0.0,
        watch: Vec::new(),
        sample: None,
        rotor: None,
    })
}

/// Runs the command.
///
/// # Errors
/// A file is not an FMU that runs here, a name or a number is wrong, or a run fails.
pub fn run(args: &Bode) -> Result<()> {
    output::check(args)?;
    if args.spring.is_some() && args.which != Some(Loop::Impedance) {
        bail!("--spring is for --loop impedance");
    }
    let threads = args.jobs.map_or_else(threads_here, usize::from);
    worker::run("bode", &args.process, threads > 1, |out| measure(args, threads, out))
}

fn measure(args: &Bode, threads: usize, out: Box<dyn Write>) -> Result<()> {
    // An FMU may change the working directory; file names of the command are relative to this one.
    let home = std::env::current_dir()?;
    let streams = Streams::now();
    let mut loaded = args.system.open(&args.stepping, EventOptions::default(), false, |system| system)?;
    let probe = probe(args, loaded.system.instances())?;
    let settings = loaded.settings(None, None, args.step.or(probe.sample), args.stepping.sequential);
    let settings = loaded.system.feasible(&settings)?;
    let plan = Plan::of(loaded, &settings)?;
    plan.notes().iter().for_each(|text| message::note(&printable(text)));
    let excitation = Excitation {
        input: probe.from.clone(),
        outputs: vec![probe.to.clone()],
        over: probe.over.clone(),
        watch: probe.watch.clone(),
        frequencies: args.frequencies.as_deref().map(frequencies).transpose()?.unwrap_or_default(),
        amplitude: args.amplitude,
        settle: args.settle,
    };
    let bar = if stderr().is_terminal() { ProgressBar::new(0) } else { ProgressBar::hidden() };
    let style = ProgressStyle::with_template("{wide_bar} {pos} frequencies  {elapsed}");
    let bar = bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let look = Mutex::new(worker::look(&args.process));
    let progress = |done: u64| {
        bar.set_position(done);
        let ends = look.lock().unwrap_or_else(PoisonError::into_inner)();
        if ends { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let outcomes = plan.frequency_response(&excitation, threads, &progress);
    bar.finish_and_clear();
    // The numbers of closed descriptors would be reused for files of the command.
    let lost = streams.lost();
    if !lost.is_empty() {
        // Files of the command may have been closed too, and their descriptors reused.
        std::mem::forget(plan);
        bail!("{}: an FMU closed or replaced {} of its process", args.system.fmus.join(" or "), lost.join(", "));
    }
    let outcomes: Vec<FrequencyOutcome> = match outcomes {
        Err(fmu_sweep::Error::Interrupted) => return Err(Failed("interrupted: nothing is written".into()).into()),
        other => other?,
    };
    journal::writes();
    std::env::set_current_dir(&home)?;
    let mut failed = Vec::new();
    let mut responses = Vec::new();
    for (frequency, outcome) in outcomes {
        match outcome {
            Ok(point) => responses.push(Response::new(point, &probe)),
            Err(cause) => failed.push(format!("{} Hz: {cause}", output::four(frequency))),
        }
    }
    if let (true, Some(first)) = (responses.is_empty(), failed.first()) {
        return Err(Failed(first.clone()).into());
    }
    for text in &failed {
        message::warning(&printable(text));
    }
    output::warn(&responses, &probe);
    output::write(args, &probe, &responses, out).context("output")?;
    match failed.len() {
        0 => Ok(()),
        count => Err(Failed(format!("{count} frequencies failed")).into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_are_a_list_or_a_range() {
        assert_eq!(frequencies("1, 10,100").unwrap(), [1.0, 10.0, 100.0]);
        let range = frequencies("1:1000:4").unwrap();
        assert!(range.iter().zip([1.0, 10.0, 100.0, 1000.0]).all(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{range:?}");
        for wrong in ["", "0", "-1,2", "1:10", "1:10:1", "10:1:5", "a", "1:10:99999", "nan"] {
            assert!(frequencies(wrong).unwrap_err().to_string().contains("FIRST:LAST:COUNT"), "{wrong}");
        }
    }
}
