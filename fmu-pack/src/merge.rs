//! One archive from several archives of one FMU, each with binaries for other platforms.

use crate::archive::{self, PackedFile};
use crate::error::{Result, invalid};
use fmu_import::platform::Platform;
use fmu_import::{contents, machine};
use model_description::{FmiVersion, ModelDescription};
use std::collections::BTreeMap;
use std::path::PathBuf;

const DESCRIPTION: &str = "modelDescription.xml";
const BINARIES: &str = "binaries/";

/// An FMU to merge.
struct Part {
    /// File name, for messages.
    name: String,
    description: ModelDescription,
    files: BTreeMap<String, Vec<u8>>,
}

/// The files of the merged FMU. `linux64` is the platform of the folder of that name in FMI 2.0, if the user names it.
///
/// # Errors
/// A file is not an FMU, two FMUs differ in more than binaries and date, or none has a library for `linux64`.
pub fn merge(files: &[PathBuf], linux64: Option<Platform>) -> Result<BTreeMap<String, PackedFile>> {
    let open = |path: &PathBuf| {
        let (description, files) = contents(path)?;
        Ok(Part { name: path.display().to_string(), description, files })
    };
    let parts = files.iter().map(open).collect::<Result<Vec<_>>>()?;
    let entry = |(name, bytes): (String, Vec<u8>)| {
        let executable = name.starts_with(BINARIES);
        (name, PackedFile { bytes, executable })
    };
    if let Some(linux64) = linux64 {
        has_linux64(&parts, linux64)?;
    }
    Ok(merged(parts, linux64.unwrap_or(Platform::X64Linux))?.into_iter().map(entry).collect())
}

/// Requires a library that `--linux64` moves or keeps in the folder linux64.
fn has_linux64(parts: &[Part], platform: Platform) -> Result<()> {
    if parts.iter().any(|part| part.description.version != FmiVersion::V2) {
        return Err(invalid!("--linux64: is for FMI 2.0; the folders of FMI 3.0 name the processor: leave it out"));
    }
    for part in parts {
        if libraries(part)?.iter().any(|library| library.platform == platform) {
            return Ok(());
        }
    }
    Err(invalid!("--linux64: none of the FMUs has a library for {platform}"))
}

/// The files of all parts.
fn merged(mut parts: Vec<Part>, linux64: Platform) -> Result<BTreeMap<String, Vec<u8>>> {
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
    let mut files: BTreeMap<String, Vec<u8>> = parts.iter().flat_map(|part| part.files.clone()).collect();
    let mut by_stem: BTreeMap<&str, BTreeMap<Platform, &[u8]>> = BTreeMap::new();
    for part in &parts {
        for library in libraries(part)? {
            files.remove(library.path);
            by_stem.entry(library.stem).or_default().insert(library.platform, library.bytes);
        }
    }
    for (stem, all) in by_stem {
        files.extend(archive::libraries_of(stem, &all, parts[0].description.version, linux64)?);
    }
    Ok(files)
}

fn date(part: &Part) -> &str {
    part.description.generation_date_and_time.as_deref().unwrap_or_default()
}

fn same_fmu(a: &Part, b: &Part) -> Result<()> {
    let version = |part: &Part| part.description.version;
    if version(a) != version(b) {
        let (of_a, of_b) = (version(a), version(b));
        return Err(invalid!(
            "{}: {DESCRIPTION}: is of FMI {of_b}, {} of FMI {of_a}; merge archives of one standard",
            b.name,
            a.name
        ));
    }
    let token = |part: &Part| part.description.token.clone();
    if token(a) != token(b) {
        let attribute = if version(a) == FmiVersion::V2 { "guid" } else { "instantiationToken" };
        return Err(invalid!(
            "{}: {DESCRIPTION}: {attribute}=\"{}\", in {} \"{}\": their interfaces differ; build both from the same sources",
            b.name,
            token(b),
            a.name,
            token(a)
        ));
    }
    Ok(())
}

/// Requires that everything except the binaries and the generation date is equal.
fn same_files(a: &Part, b: &Part) -> Result<()> {
    let shared = |part: &Part| part.files.keys().filter(|n| !n.starts_with(BINARIES)).cloned().collect::<Vec<_>>();
    for (one, other) in [(a, b), (b, a)] {
        if let Some(name) = shared(one).into_iter().find(|name| !other.files.contains_key(name)) {
            return Err(invalid!(
                "{}: has no {name}, but {} has; build both from the same sources",
                other.name,
                one.name
            ));
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
            return Err(invalid!("{}: {name}, line {line}: differs from {}; {remedy}", b.name, a.name));
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

/// A library named after the FMU, for one platform.
struct Library<'a> {
    /// Its path in the archive.
    path: &'a str,
    /// Its name without extension.
    stem: &'a str,
    platform: Platform,
    bytes: &'a [u8],
}

/// The libraries of a part; a universal library counts once for each processor. The folder counts if a library does not state
/// its platform.
fn libraries(part: &Part) -> Result<Vec<Library<'_>>> {
    let md = &part.description;
    let interfaces = [&md.co_simulation, &md.model_exchange, &md.scheduled_execution].into_iter().flatten();
    let stems: Vec<&str> = interfaces.map(|interface| interface.model_identifier.as_str()).collect();
    let mut found = Vec::new();
    for (path, bytes) in &part.files {
        let Some((folder, file)) = path.strip_prefix(BINARIES).and_then(|rest| rest.split_once('/')) else { continue };
        let Some(of_folder) = Platform::of_folder(folder, md.version) else { continue };
        let stem = file.strip_suffix(of_folder.extension()).and_then(|stem| stem.strip_suffix('.'));
        let Some(stem) = stem.filter(|stem| stems.contains(stem)) else { continue };
        let images = machine::images(bytes).map_err(|why| invalid!("{}: {path}: {why}", part.name))?;
        for bytes in images {
            let of = machine::platforms(bytes).first().copied().filter(|p| p.folders(md.version).contains(&folder));
            found.push(Library { path, stem, platform: of.unwrap_or(of_folder), bytes });
        }
    }
    Ok(found)
}

/// Requires that files which both FMUs have below `binaries/` are equal.
fn other_platforms(a: &Part, b: &Part) -> Result<()> {
    let (of_a, of_b) = (libraries(a)?, libraries(b)?);
    for theirs in &of_b {
        let fits = |l: &&Library<'_>| (l.stem, l.platform) == (theirs.stem, theirs.platform);
        let Some(ours) = of_a.iter().find(fits) else { continue };
        let folder = |path: &str| path.rsplit_once('/').map_or(String::new(), |(folder, _)| folder.to_owned());
        let (here, there) = (folder(theirs.path), folder(ours.path));
        if here != there {
            let what = format!("is for {}, as {there} of {} is", theirs.platform, a.name);
            return Err(invalid!("{}: {}: {what}; provide it in only one of them", b.name, theirs.path));
        }
        if ours.bytes != theirs.bytes {
            let name = here.trim_start_matches(BINARIES);
            return Err(invalid!(
                "{}: {}: differs from {}; provide {name} in only one of them",
                b.name,
                theirs.path,
                a.name
            ));
        }
    }
    let is_library = |path: &str| of_b.iter().any(|l| l.path == path);
    for (name, bytes) in b.files.iter().filter(|(name, _)| name.starts_with(BINARIES) && !is_library(name)) {
        if a.files.get(name).is_some_and(|other| other != bytes) {
            return Err(invalid!("{}: {name}: differs from {}; provide it in only one of them", b.name, a.name));
        }
    }
    Ok(())
}
