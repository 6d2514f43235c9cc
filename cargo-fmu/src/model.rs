//! Runs the model during a build in a separate process with the limits of `fmu simulate`. If the model does not return, exhausts the
//! memory or crashes, the process ends, and the build names the model.

use crate::worker::{self, ProcessOptions};
use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use fmu_core::Description;
use fmu_core::description::Dependencies;
use fmu_import::Folder;
use fmu_pack::archive::PackedFile;
use fmu_pack::reference;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// Runs a model that is being built
#[derive(Debug, Args)]
pub struct ModelWork {
    #[command(flatten)]
    /// The process.
    pub process: ProcessOptions,
    #[command(subcommand)]
    work: Work,
}

#[derive(Debug, Subcommand)]
enum Work {
    /// Writes the description of a library as JSON
    Describe { library: PathBuf, out: PathBuf, resources: Option<PathBuf> },
    /// Writes the reference files of an archive
    Reference {
        archive: PathBuf,
        description: PathBuf,
        out: PathBuf,
        #[arg(long)]
        stimuli: Option<PathBuf>,
        #[arg(long)]
        parameters: Option<PathBuf>,
    },
}

/// Writes a file; an error names it.
fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).with_context(|| path.display().to_string())
}

/// The hidden command of both programs.
const NAME: &str = "model";

/// Runs the hidden command, in the process that [`describe`] and [`reference()`] start.
///
/// # Errors
/// Those of the model.
pub fn run(args: &ModelWork) -> Result<()> {
    worker::run(NAME, &args.process, false, |_| match &args.work {
        Work::Describe { library, out, resources } => {
            let description = fmu_import::describe(library, resources.as_deref(), Dependencies::Probed)?;
            put(out, &serde_json::to_vec(&description)?)
        }
        Work::Reference { archive, description, out, stimuli, parameters } => {
            let description: Description = serde_json::from_slice(&fs::read(description)?)?;
            let parameters = parameters.as_deref().map(named).transpose()?;
            let parameters = parameters.as_ref().map(|(name, text)| (name.as_str(), text.as_str()));
            for (name, file) in
                reference::files(archive, &description, stimuli.as_deref().unwrap_or(Path::new("")), parameters)?
            {
                put(&out.join(name.trim_start_matches(reference::FOLDER)), &file.bytes)?;
            }
            Ok(())
        }
    })
}

/// The name of a file without its ending, and its text.
fn named(path: &Path) -> Result<(String, String)> {
    Ok((path.file_stem().unwrap_or_default().to_string_lossy().into_owned(), fs::read_to_string(path)?))
}

/// The description of a library, as [`fmu_import::describe`], within the limits of `options`.
///
/// # Errors
/// Those of [`fmu_import::describe`]; the model ends its process, or does not return in time.
pub fn describe(library: &Path, resources: Option<&Path>, options: &ProcessOptions) -> Result<Description> {
    if !worker::guards(options) {
        return Ok(fmu_import::describe(library, resources, Dependencies::Probed)?);
    }
    let folder = Folder::new()?;
    let out = folder.path().join("description.json");
    let positional = [Some(library), Some(&out), resources];
    guarded("describe", positional.into_iter().flatten(), &[], options)?;
    Ok(serde_json::from_slice(&fs::read(out)?)?)
}

/// The reference files of an archive, as [`reference::files`], within the limits of `options`.
///
/// # Errors
/// Those of [`reference::files`]; the model ends its process, or does not return in time.
pub fn reference(
    archive: &Path,
    description: &Description,
    stimuli: &Path,
    parameters: Option<&(String, String)>,
    options: &ProcessOptions,
) -> Result<BTreeMap<String, PackedFile>> {
    if !worker::guards(options) {
        let parameters = parameters.map(|(name, text)| (name.as_str(), text.as_str()));
        return Ok(reference::files(archive, description, stimuli, parameters)?);
    }
    let folder = Folder::new()?;
    let (json, out) = (folder.path().join("description.json"), folder.path().join("out"));
    fs::create_dir(&out).with_context(|| out.display().to_string())?;
    put(&json, &serde_json::to_vec(description)?)?;
    let set = parameters.map(|(name, _)| folder.path().join(format!("{name}.ssv")));
    if let (Some(path), Some((_, text))) = (&set, parameters) {
        put(path, text.as_bytes())?;
    }
    let further = [("--stimuli", Some(stimuli).filter(|file| file.is_file())), ("--parameters", set.as_deref())];
    guarded("reference", [archive, &json, &out], &further, options)?;
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(&out)? {
        let path = entry?.path();
        let name = format!("{}{}", reference::FOLDER, path.file_name().unwrap_or_default().to_string_lossy());
        files.insert(name, PackedFile { bytes: fs::read(path)?, executable: false });
    }
    Ok(files)
}

/// Runs the hidden command with absolute paths, because the working directory of its process is another.
fn guarded<'a>(
    work: &str,
    paths: impl IntoIterator<Item = &'a Path>,
    further: &[(&str, Option<&Path>)],
    options: &ProcessOptions,
) -> Result<()> {
    let mut arguments = vec![OsString::from(work)];
    for path in paths {
        arguments.push(std::path::absolute(path)?.into());
    }
    for (option, path) in further {
        if let Some(path) = path {
            arguments.extend([OsString::from(option), std::path::absolute(path)?.into()]);
        }
    }
    worker::guarded(NAME, arguments, options, false)
}
