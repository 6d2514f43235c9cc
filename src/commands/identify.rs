//! The command `fmu identify`: a machine's data from a record.

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use drive_tools::identify::columns::{Naming, Signals};
use drive_tools::identify::electrical::Fit;
use drive_tools::identify::run::commissioned;
use drive_tools::identify::verdict::Quantity;
use drive_tools::identify::{self, Identified, Options, machine_file, page};
use fmu_core::digits::rounded;
use fmu_pack::{archive, release};
use std::path::PathBuf;

/// Identifies a machine from a record of its running drive: resistance, inductances, magnet flux, inertia, friction.
///
/// RECORD.csv has one row per sample of the controller: time t, voltage, current, electrical angle theta, and if known, u_dc
/// and the load torque. A header may name a unit: `i_a [mA]`, `speed [rpm]`. docs/identify.md lists the forms of columns.
///
/// With --run, the record is a run of the self-commissioning in PmsmDrive or SensorlessController, as `fmu simulate --csv` writes it: the
/// values are the outputs identified_* of its last row.
///
/// Each value has an interval (95 %), or the reason why this record does not determine it. Exit status: 0 if all values are
/// written, 1 if one is refused, 2 for an invalid record (nothing is written).
///
///   fmu identify bench.csv --n-p 3 --current 15 --out target/motor.toml
///   fmu identify bench.csv --n-p 3 --current 15 --html bench.html
///   fmu identify bench.csv --n-p 4 --map u_a=Vph1,u_b=Vph2,u_c=Vph3 --unit speed=rpm --load none --json
///   fmu identify --run run.csv --n-p 3 --current 15 --speed 157 --torque 14 --u-dc 540 --given psi_M=0.545,J=0.015 --out motor.toml
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Identify {
    /// Record of a running drive
    #[arg(value_name = "RECORD.csv", required_unless_present = "run", conflicts_with_all = ["run", "given"])]
    pub record: Option<PathBuf>,
    /// Recording of a self-commissioning instead: its last row has the values
    #[arg(long, value_name = "RUN.csv", conflicts_with_all = ["delay", "every", "rate", "map", "unit", "zero", "load"])]
    pub run: Option<PathBuf>,
    /// Values of the machine file that a commissioning does not determine: psi_M=0.545,J=0.015
    #[arg(long, value_name = "NAME=VALUE,...", value_delimiter = ',', requires = "run")]
    pub given: Vec<String>,
    /// Machine file to write, for `fmu tune`; its name without .toml names the machine
    #[arg(long, value_name = "MOTOR.toml")]
    pub out: Option<PathBuf>,
    /// Pole pairs
    #[arg(long = "n-p", value_name = "N")]
    pub n_p: Option<i32>,
    /// Maximum current in A, peak value [default: the maximum of the record]
    #[arg(long, value_name = "A")]
    pub current: Option<f64>,
    /// Rated mechanical speed in rad/s [default: the maximum of the record]
    #[arg(long, value_name = "RAD/S")]
    pub speed: Option<f64>,
    /// Rated torque in N.m [default: the maximum of the record]
    #[arg(long, value_name = "N.M")]
    pub torque: Option<f64>,
    /// DC-link voltage in V [default: the mean of the column u_dc]
    #[arg(long, value_name = "V")]
    pub u_dc: Option<f64>,
    /// Delay in samples from a row to the action of its voltage [default: the best of 0, 0.5, 1, 1.5, 2]
    #[arg(long, value_name = "SAMPLES")]
    pub delay: Option<f64>,
    /// The record keeps one of N samples of the controller [default: 1]
    #[arg(long, value_name = "N")]
    pub every: Option<u32>,
    /// Rows per second, if the record has no column t
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Columns under other headers: u_a=Vph1,i_a=I1
    #[arg(long, value_name = "COLUMN=HEADER,...", value_delimiter = ',')]
    pub map: Vec<String>,
    /// Units of columns: speed=rpm
    #[arg(long, value_name = "COLUMN=UNIT,...", value_delimiter = ',')]
    pub unit: Vec<String>,
    /// Interval in s without current, for the sensors' offset [default: the start without voltage]
    #[arg(long, value_name = "FROM:TO")]
    pub zero: Option<String>,
    /// `none` if the shaft is free; otherwise the column of the load torque, tau_load or tau_shaft
    #[arg(long, value_name = "none|COLUMN")]
    pub load: Option<String>,
    /// Page to write: the values, and each fit beside the record
    #[arg(long, value_name = "FILE.html")]
    pub html: Option<PathBuf>,
    /// Print only the result, as JSON
    #[arg(long)]
    pub json: bool,
}

/// Runs the command; returns whether every value is written.
///
/// # Errors
/// The record or an option is wrong, or the file cannot be written.
pub fn run(args: &Identify) -> Result<bool> {
    let options = options(args)?;
    let path = args.run.as_ref().or(args.record.as_ref()).context("RECORD.csv is missing")?;
    let file = path.display().to_string();
    let bytes = std::fs::read(path).with_context(|| format!("reading {file}"))?;
    let text = String::from_utf8_lossy(&bytes);
    let name = |path: &PathBuf| path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = args.out.as_ref().or(Some(path)).and_then(name).unwrap_or_else(|| "motor".into());
    let source = format!("fmu identify of {file} (sha256 {})", release::sha256(&bytes));
    let html = args.html.is_some();
    let result = if args.run.is_some() {
        let found = commissioned(&text, &file, &options)?;
        Written {
            machine: found.text(&name, &source),
            page: html.then(|| page::commissioning(&found, &file)).transpose()?,
            json: found.json(),
            rows: rows(found.values.iter().chain(&found.more)) + &notes(&found.notes),
            whole: found.values.iter().all(|v| v.refused.is_none()),
        }
    } else {
        let found = identify::identify(&Signals::parse(&text, &file, &options.naming)?, &options)?;
        Written {
            machine: machine_file::text(&found, &name, &source),
            page: html.then(|| page::page(&found, &file)).transpose()?,
            json: found.json(),
            rows: rows(found.values.iter()) + &facts(&found) + &notes(&found.notes),
            whole: found.values.iter().all(|v| v.refused.is_none()),
        }
    };
    result.write(args)?;
    Ok(result.whole)
}

/// The output of the command.
struct Written {
    machine: String,
    page: Option<String>,
    json: serde_json::Value,
    rows: String,
    /// Every value is written.
    whole: bool,
}

impl Written {
    fn write(&self, args: &Identify) -> Result<()> {
        if let Some(out) = &args.out {
            ensure!(
                out.extension().is_some_and(|e| e == "toml"),
                "--out {}: expected a file name with .toml",
                out.display()
            );
            archive::write(out, self.machine.as_bytes())?;
        }
        if let (Some(html), Some(page)) = (&args.html, &self.page) {
            archive::write(html, page.as_bytes())?;
        }
        if args.json {
            println!("{:#}", self.json);
            return Ok(());
        }
        print!("{}", self.rows);
        for (k, written) in args.out.iter().chain(&args.html).enumerate() {
            println!("{}{}", if k == 0 { "\n" } else { "" }, written.display());
        }
        Ok(())
    }
}

fn options(args: &Identify) -> Result<Options> {
    let pairs = |option: &str, list: &[String]| {
        let pair = |text: &String| match text.split_once('=') {
            Some((name, other)) => Ok((name.trim().to_owned(), other.trim().to_owned())),
            None => bail!("{option} {text}: expected NAME=..., for example --map u_a=Vph1"),
        };
        list.iter().map(pair).collect::<Result<Vec<_>>>()
    };
    let zero = args.zero.as_deref().map(|text| {
        let both = text.split_once(':').and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
        both.with_context(|| format!("--zero {text}: expected two times in s, for example --zero 0:0.05"))
    });
    let given = pairs("--given", &args.given)?.into_iter().map(|(name, value)| {
        let number = value.parse().with_context(|| format!("--given {name}={value}: expected a number"))?;
        Ok((name, number))
    });
    let mut map = pairs("--map", &args.map)?;
    let mut load = args.load.clone();
    if let Some(column) = &mut load
        && !["none", "tau_load", "tau_shaft"].contains(&column.as_str())
    {
        map.push(("tau_load".into(), std::mem::replace(column, "tau_load".into())));
    }
    Ok(Options {
        naming: Naming { map, units: pairs("--unit", &args.unit)? },
        n_p: args.n_p,
        current: args.current,
        speed: args.speed,
        torque: args.torque,
        u_dc: args.u_dc,
        delay: args.delay,
        every: args.every,
        rate: args.rate,
        zero: zero.transpose()?,
        load,
        given: given.collect::<Result<_>>()?,
    })
}

/// The values, one per line.
fn rows<'a>(values: impl Iterator<Item = &'a Quantity>) -> String {
    let row = |value: &Quantity| {
        let number = rounded(value.value, 5);
        let width = format!("+-{:.2} %", 100.0 * value.half_width);
        let width = if value.half_width.is_nan() { "given".to_owned() } else { width };
        match &value.refused {
            None => format!("{:12}{number:>12} {:10}{width:>11}\n", value.name, value.unit),
            Some(why) => format!("{:12}{:>12} {:10}{:>11}  refused: {why}\n", value.name, "-", value.unit, ""),
        }
    };
    values.map(row).collect()
}

/// Results of the fit in addition to the values.
fn facts(found: &Identified) -> String {
    let Fit { theta_0, tau, rest, noise, .. } = found.fit;
    format!(
        "\nsensor of the angle: offset {theta_0:.4} rad, delay {:.1} us\nthe voltage of a row acts {} samples \
         later\nresidual of the fit: {rest:.3} V; noise explains {noise:.3} V\n",
        tau * 1e6,
        found.timing.delay
    )
}

fn notes(notes: &[String]) -> String {
    notes.iter().fold(String::new(), |all, note| all + "\nnote: " + note + "\n")
}
