//! `fmu merge`: one archive out of several of the same FMU, each with binaries for other platforms.

use crate::pack::{self, Entry, Moment};
use anyhow::{Result, anyhow, bail};
use clap::Args;
use fmu_import::contents;
use fmu_import::platform::Platform;
use model_description::{FmiVersion, ModelDescription};
use std::collections::BTreeMap;
use std::path::PathBuf;

const DESCRIPTION: &str = "modelDescription.xml";
const BINARIES: &str = "binaries/";

/// Merges builds of one FMU for different platforms into a single FMU.
///
/// The FMUs must have the same FMI version, token (GUID) and files, except for binaries/ and the generation date; the latest date
/// is kept. Otherwise the command writes nothing. The same FMUs give the same bytes in any order.
///
///   fmu merge linux/PmsmPlant.fmu windows/PmsmPlant.fmu --out PmsmPlant.fmu
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Merge {
    /// FMUs to merge
    #[arg(value_name = "FILE.fmu", num_args = 2.., required = true)]
    pub files: Vec<PathBuf>,
    /// File to write
    #[arg(long, value_name = "FILE.fmu")]
    pub out: PathBuf,
}

/// An FMU to merge.
struct Part {
    /// File name, for messages.
    name: String,
    description: ModelDescription,
    files: BTreeMap<String, Vec<u8>>,
}

/// Runs the command.
///
/// # Errors
/// A file is not an FMU, or two FMUs differ in more than binaries and date.
pub fn run(args: &Merge) -> Result<()> {
    let moment = Moment::of_environment()?;
    let open = |path: &PathBuf| {
        let (description, files) = contents(path)?;
        Ok(Part { name: path.display().to_string(), description, files })
    };
    let parts = args.files.iter().map(open).collect::<Result<Vec<_>>>()?;
    let entry = |(name, bytes): (String, Vec<u8>)| {
        let executable = name.starts_with(BINARIES);
        (name, Entry { bytes, executable })
    };
    let files = merge(parts)?.into_iter().map(entry).collect();
    pack::write(&args.out, &pack::archive(&files, moment)?)?;
    println!("{}", args.out.display());
    Ok(())
}

/// The files of all parts.
fn merge(mut parts: Vec<Part>) -> Result<BTreeMap<String, Vec<u8>>> {
    for later in 1..parts.len() {
        for earlier in 0..later {
            let (a, b) = (&parts[earlier], &parts[later]);
            same_fmu(a, b)?;
            same_files(a, b)?;
            other_platforms(a, b)?;
        }
    }
    // The base is the latest FMU: the result keeps its date.
    parts.sort_by(|a, b| (date(a), &a.files).cmp(&(date(b), &b.files)));
    Ok(parts.into_iter().flat_map(|part| part.files).collect())
}

fn date(part: &Part) -> &str {
    part.description.generation_date_and_time.as_deref().unwrap_or_default()
}

fn same_fmu(a: &Part, b: &Part) -> Result<()> {
    let version = |part: &Part| part.description.version;
    if version(a) != version(b) {
        let (of_a, of_b) = (version(a), version(b));
        bail!("{}: {DESCRIPTION}: is of FMI {of_b}, {} of FMI {of_a}; merge those of one standard", b.name, a.name);
    }
    let token = |part: &Part| part.description.token.clone();
    if token(a) != token(b) {
        let attribute = if version(a) == FmiVersion::V2 { "guid" } else { "instantiationToken" };
        bail!(
            "{}: {DESCRIPTION}: {attribute}=\"{}\", in {} \"{}\": their interfaces differ; build both from the same sources",
            b.name,
            token(b),
            a.name,
            token(a)
        );
    }
    Ok(())
}

/// Requires that everything except the binaries and the generation date is equal.
fn same_files(a: &Part, b: &Part) -> Result<()> {
    let shared = |part: &Part| part.files.keys().filter(|n| !n.starts_with(BINARIES)).cloned().collect::<Vec<_>>();
    for (one, other) in [(a, b), (b, a)] {
        if let Some(name) = shared(one).into_iter().find(|name| !other.files.contains_key(name)) {
            bail!("{}: has no {name}, but {} has; build both from the same sources", other.name, one.name);
        }
    }
    // The description first: if it differs, the documentation page generated from it differs too.
    let mut names = shared(a);
    names.sort_by_key(|name| name != DESCRIPTION);
    for name in names {
        let text = |part: &Part| part.files.get(&name).map(|bytes| dateless(bytes, date(part))).unwrap_or_default();
        let (of_a, of_b) = (text(a), text(b));
        if of_a != of_b {
            let alike = of_a.iter().zip(&of_b).take_while(|(x, y)| x == y).count();
            let line = of_b[..alike].split(|byte| *byte == b'\n').count();
            let remedy = "build both from the same sources with the same fmu";
            bail!("{}: {name}, line {line}: differs from that of {}; {remedy}", b.name, a.name);
        }
    }
    Ok(())
}

/// A file without the date of generation.
fn dateless(bytes: &[u8], date: &str) -> Vec<u8> {
    match std::str::from_utf8(bytes) {
        Ok(text) if !date.is_empty() => text.replace(date, "").into_bytes(),
        _ => bytes.to_vec(),
    }
}

/// Requires that the binaries of a platform that both FMUs have are equal.
fn other_platforms(a: &Part, b: &Part) -> Result<()> {
    let version = a.description.version;
    let folder = |name: &str| Some(name.strip_prefix(BINARIES)?.split_once('/')?.0.to_owned());
    for (name, bytes) in &b.files {
        let Some(of_b) = folder(name) else { continue };
        if a.files.get(name).is_some_and(|other| other != bytes) {
            bail!("{}: {name}: differs from that of {}; give {of_b} in one of them only", b.name, a.name);
        }
        // FMI 2.0 has two names for some platforms.
        let Some(platform) = Platform::of_folder(&of_b, version) else { continue };
        let is_other = |f: &String| *f != of_b && Platform::of_folder(f, version) == Some(platform);
        if let Some(of_a) = a.files.keys().filter_map(|name| folder(name)).find(is_other) {
            let what = format!("is for {platform}, as binaries/{of_a} of {} is", a.name);
            return Err(anyhow!("{}: {name}: {what}; give it in one of them only", b.name));
        }
    }
    Ok(())
}
