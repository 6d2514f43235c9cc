//! `fmu build`: compiles models and packs them.

use crate::compile::{Library, compile};
use crate::icons;
use crate::licences::Licences;
use crate::pack::{self, Moment};
use crate::target::{Target, Tools, ZIG};
use crate::workspace::{Package, Workspace};
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use fmu_core::Description;
use fmu_import::describe;
use fmu_import::elf::{FLOOR, Needs};
use fmu_import::platform::Platform;
use model_description::FmiVersion;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Compiles FMUs and packs them for both standards.
///
/// Without names, every FMU of the workspace: the packages in its folder fmus/. A name is that of the package
/// (pmsm-plant) or of the FMU (PmsmPlant).
///
/// An FMU of your own is any cdylib with one line `fmu_export::export!(MyModel);`:
///   a package of the workspace     fmu build --package own-fmu
///   a library that is already built, or several of one model for several platforms
///                                  fmu build --library target/release/libmy_fmu.so
///                                  fmu build --library libmy_fmu.so --library x86_64-windows=my_fmu.dll
///
/// For other platforms, by Rust's names of them; the FMUs then hold a binary for each of these, and only these:
///   fmu build --target x86_64-unknown-linux-gnu,aarch64-unknown-linux-gnu,x86_64-pc-windows-gnu
/// It needs Rust's standard library for each (rustup target add TRIPLE), mingw for Windows, cargo-zigbuild with ziglang for
/// Linux and macOS. A build for this machine is made all the same, if it is not asked for: it describes the model.
///
/// Linux binaries need glibc 2.17 (2012) where cargo-zigbuild is in PATH; otherwise what this machine's linker makes them
/// need, which is told. CARGO_TARGET_TRIPLE_LINKER, in Cargo's spelling, names another linker.
///
/// With SOURCE_DATE_EPOCH set, the same sources give the same bytes.
#[derive(Debug, Default, Args)]
#[command(verbatim_doc_comment)]
pub struct Build {
    /// FMUs to build, by package or FMU name
    #[arg(value_name = "FMU", conflicts_with_all = ["package", "library"])]
    pub fmus: Vec<String>,
    /// The standard: 2 or 3; both without this option
    #[arg(long, value_name = "VERSION", value_parser = clap::builder::PossibleValuesParser::new(["2", "3"]))]
    pub fmi: Option<String>,
    /// Where fmi2/NAME.fmu and fmi3/NAME.fmu go [default: fmu in Cargo's target folder]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// A package with a cdylib, of this workspace
    #[arg(long, value_name = "NAME", conflicts_with = "library")]
    pub package: Option<String>,
    /// A library that is already built; PLATFORM= if it is not for this machine
    #[arg(long, value_name = "[PLATFORM=]FILE")]
    pub library: Vec<String>,
    /// What to build for, instead of this machine; several with commas, or by repeating it
    #[arg(long, value_name = "TRIPLE", value_delimiter = ',', conflicts_with = "library")]
    pub target: Vec<String>,
}

/// A compiled model, ready to be packed.
struct Model {
    description: Description,
    binaries: Vec<(Platform, Vec<u8>)>,
    licences: Licences,
}

/// Runs the command; returns the files that were written.
///
/// # Errors
/// A name that is no FMU, a compiler that fails, a library that is none of ours, a folder that cannot be written.
pub fn run(args: &Build) -> Result<Vec<PathBuf>> {
    let moment = Moment::of_environment()?;
    let versions = match args.fmi.as_deref() {
        None => vec![FmiVersion::V2, FmiVersion::V3],
        Some(version) => vec![version.parse()?],
    };
    let (models, out) = if args.library.is_empty() {
        let workspace = Workspace::find()?;
        let out = args.out.clone().unwrap_or_else(|| workspace.target.join("fmu"));
        (compiled(&workspace, args)?, out)
    } else {
        let out = args.out.clone().map_or_else(|| Workspace::find().map(|w| w.target.join("fmu")), Ok);
        (vec![given(&args.library)?], out.context("--out says where to write to when there is no workspace")?)
    };
    for note in notes(&models) {
        eprintln!("note: {note}");
    }
    let mut written = Vec::new();
    for model in &models {
        for &version in &versions {
            let folder = if version == FmiVersion::V2 { "fmi2" } else { "fmi3" };
            let path = out.join(folder).join(format!("{}.fmu", model.description.name));
            let mut files = pack::contents(&model.description, &model.binaries, &model.licences, version, moment);
            files.extend(icons::files(&model.description, version)?);
            pack::write(&path, &pack::archive(&files, moment)?)?;
            written.push(path);
        }
    }
    Ok(written)
}

fn compiled(workspace: &Workspace, args: &Build) -> Result<Vec<Model>> {
    // Before anything is compiled: what is missing for the last target is told at once.
    let tools = Tools::find()?;
    let targets = match &args.target[..] {
        [] => vec![tools.host()],
        triples => targets(&tools, triples)?,
    };
    let packages = match &args.package {
        Some(name) => {
            let package = workspace.package(name).filter(|p| p.has_cdylib());
            vec![package.ok_or_else(|| anyhow!("{name} is no package with crate-type = [\"cdylib\"] here"))?]
        }
        None => choose(&workspace.fmus(), &args.fmus)?,
    };
    let names: Vec<String> = packages.iter().map(|p| p.name.clone()).collect();
    let mut built: BTreeMap<String, Vec<(Platform, PathBuf)>> = BTreeMap::new();
    let mut describing: Option<Vec<Library>> = None;
    for target in &targets {
        let libraries = compile(workspace, &names, target)?;
        for (package, library) in &libraries {
            built.entry(package.clone()).or_default().push((target.platform, library.clone()));
        }
        if target.platform == Platform::host() {
            describing = Some(libraries);
        }
    }
    let describing = match describing {
        Some(libraries) => libraries,
        None => compile(workspace, &names, &tools.host())?,
    };
    if describing.is_empty() {
        bail!("nothing that was compiled is a cdylib: set crate-type = [\"cdylib\"]");
    }
    let model = |(package, own): &Library| {
        load(own, built.get(package).map_or(&[], Vec::as_slice), Licences::of_package(workspace, package))
    };
    describing.iter().map(model).collect()
}

/// The targets of these names, each for another platform.
fn targets(tools: &Tools, triples: &[String]) -> Result<Vec<Target>> {
    let mut targets: Vec<Target> = Vec::new();
    for triple in triples {
        let target = tools.target(triple)?;
        match targets.iter().find(|t| t.platform == target.platform) {
            Some(same) if same.triple == target.triple => {}
            Some(same) => bail!("--target {triple}: is for {}, as {} is; take one", target.platform, same.triple),
            None => targets.push(target),
        }
    }
    Ok(targets)
}

/// What the Linux binaries need of the importing machine beyond what each has: a line for all that need the same.
fn notes(models: &[Model]) -> Vec<String> {
    let mut by_needs: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for Model { description, binaries, .. } in models {
        for (platform, bytes) in binaries {
            if let Ok(needs) = Needs::of(bytes)
                && !needs.are_modest()
            {
                by_needs.entry(format!("for {platform} needs {needs}")).or_default().push(&description.name);
            }
        }
    }
    let remedy = format!("built with cargo-zigbuild ({ZIG}) it needs {FLOOR} at most");
    let note = |(needs, names): (String, Vec<&str>)| format!("{} {needs} where it runs; {remedy}", names.join(", "));
    by_needs.into_iter().map(note).collect()
}

/// The packages that are meant: by their names, or by those of their FMUs, which only differ in how words are joined.
fn choose<'a>(all: &[&'a Package], names: &[String]) -> Result<Vec<&'a Package>> {
    let letters = |name: &str| name.to_lowercase().replace(['-', '_'], "");
    if all.is_empty() {
        bail!("the workspace has no folder fmus/ with packages");
    }
    if names.is_empty() {
        return Ok(all.to_vec());
    }
    let one = |name: &String| {
        let known = || all.iter().map(|p| p.name.as_str()).collect::<Vec<_>>().join(", ");
        let found = all.iter().copied().find(|p| letters(&p.name) == letters(name));
        found.ok_or_else(|| anyhow!("there is no FMU {name}; there are {}", known()))
    };
    names.iter().map(one).collect()
}

/// Libraries of one model, built before.
fn given(libraries: &[String]) -> Result<Model> {
    let parse = |text: &String| match text.split_once('=') {
        Some((platform, file)) => Ok((platform.parse().map_err(|e: String| anyhow!(e))?, PathBuf::from(file))),
        None => Ok((Platform::host(), PathBuf::from(text))),
    };
    let libraries = libraries.iter().map(parse).collect::<Result<Vec<_>>>()?;
    let own = libraries.iter().find(|(platform, _)| *platform == Platform::host());
    let (_, own) = own.ok_or_else(|| {
        anyhow!("one library must be for this machine ({}): it describes the model", Platform::host())
    })?;
    load(own, &libraries, Licences::default())
}

/// A model of these libraries, described by one for this machine.
fn load(own: &Path, libraries: &[(Platform, PathBuf)], licences: Licences) -> Result<Model> {
    let description = describe(own)?;
    let read = |(platform, path): &(Platform, PathBuf)| Ok((*platform, read(path)?));
    Ok(Model { description, binaries: libraries.iter().map(read).collect::<Result<_>>()?, licences })
}

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).with_context(|| path.display().to_string())
}
